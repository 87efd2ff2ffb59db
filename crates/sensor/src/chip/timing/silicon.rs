//! What a chip is made of: a cell library in one corner, its conditions, and the mismatch of its cells.

use super::cell_library::CellLibrary;
use crate::chip::SensorConfig;
use crate::netlist::{
    CellId, Conditions, Corner, Library, Mismatch, Netlist, Timing, derated_limits, varied_as,
};

/// What the chip is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Silicon {
    /// Corner of the library.
    pub corner: Corner,
    /// Factor on every delay and limit: process, voltage, temperature.
    pub factor: f64,
    /// Random differences between cells, on delays only.
    pub mismatch: Option<Mismatch>,
    /// The cells themselves.
    pub cell_library: CellLibrary,
}

/// Whether flip-flops' limits count, or only what they capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limits {
    /// Setup, hold, recovery, removal and pulse widths must be kept.
    Kept,
    /// A flip-flop captures what is at D in the instant of its clock edge.
    Ignored,
}

impl Silicon {
    /// The library as it stands, without mismatch.
    pub const fn nominal(corner: Corner) -> Self {
        Silicon {
            corner,
            factor: 1.0,
            mismatch: None,
            cell_library: CellLibrary::BUILT_IN,
        }
    }

    /// That of a sensor without mismatch: its library in its corner at its temperature. The description must have passed
    /// [`SensorConfig::check`].
    pub fn new(config: &SensorConfig) -> Self {
        let cell_library = CellLibrary::from_config(config).expect("checked");
        Silicon::at_temperature(cell_library, config).expect("checked")
    }

    /// The silicon of a sensor whose library has been read.
    ///
    /// # Errors
    /// Temperatures for which no delays are known.
    pub(in crate::chip) fn at_temperature(
        cell_library: CellLibrary,
        config: &SensorConfig,
    ) -> Result<Self, UnknownConditions> {
        let silicon = Silicon {
            cell_library,
            ..Silicon::nominal(config.corner)
        };
        silicon.in_conditions(config.conditions())
    }

    /// The same chip with every delay and limit times `factor`, instead of its own.
    #[must_use]
    pub const fn with_factor(mut self, factor: f64) -> Self {
        self.factor = factor;
        self
    }

    /// The same chip in other conditions.
    ///
    /// # Errors
    /// Conditions for which no delays are known.
    pub fn in_conditions(self, conditions: Conditions) -> Result<Self, UnknownConditions> {
        if self.cell_library.from_file().is_some() && conditions != Conditions::default() {
            return Err(UnknownConditions::OfLibrary);
        }
        let factor = conditions.delay_factor();
        Ok(self.with_factor(factor.ok_or(UnknownConditions::Far)?))
    }

    /// Delays of a netlist.
    pub fn timing(&self, netlist: &Netlist) -> Timing {
        self.timing_as(netlist, |cell| netlist.cell_path(cell))
    }

    /// Delays of another netlist that differs from this one in names only: there each cell is at this path.
    pub(crate) fn timing_as(&self, netlist: &Netlist, path: impl Fn(CellId) -> String) -> Timing {
        self.timing_of(netlist, self.cell_timing(netlist), path)
    }

    /// Delays of the library's cells in a netlist, whatever they are called.
    pub(crate) fn cell_timing(&self, netlist: &Netlist) -> Timing {
        self.cell_library.timing(netlist, self.corner)
    }

    /// [`Silicon::timing_as`] where the library's delays are known.
    pub(crate) fn timing_of(
        &self,
        netlist: &Netlist,
        library: Timing,
        path: impl Fn(CellId) -> String,
    ) -> Timing {
        let nominal = library.with_own_delays(netlist, self.corner, &path);
        varied_as(netlist, &nominal, self.factor, self.mismatch, path)
    }

    /// The library with this silicon's limits (and nominal delays).
    pub(crate) fn limits(&self, limits: Limits) -> Library {
        let factor = match limits {
            Limits::Kept => self.factor,
            Limits::Ignored => 0.0,
        };
        derated_limits(self.cell_library.cells(), factor)
    }
}

/// Conditions for which no delays are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum UnknownConditions {
    /// Any but its own, with a library.
    #[error(
        "a library is characterised at conditions of its own; give its file of other conditions as liberty_slow or liberty_fast, and corner = \"slow\" or \"fast\""
    )]
    OfLibrary,
    /// Too far away.
    #[error(
        "no delays are known there; give -55 to 150 °C and a supply up to 2 V at least 0.2 V above the threshold of about 0.4 V"
    )]
    Far,
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    /// Lines of code that ask for the invented library, in all files below a folder: tests and comments left out.
    fn users(folder: &Path, found: &mut Vec<String>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                // A testbench of one block makes that of the library itself.
                if !path.ends_with("testbenches") {
                    users(&path, found);
                }
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap();
            let mut lines = code
                .lines()
                .filter(|line| !line.trim_start().starts_with("//"));
            if !path.ends_with("tests.rs")
                && lines.any(|line| line.contains("Library::generic_40nm"))
            {
                found.push(path.display().to_string());
            }
        }
    }

    #[test]
    fn one_place_says_which_library_chips_are_made_of() {
        let mut found = Vec::new();
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        for folder in [
            "src",
            "crates/lidar/src",
            "crates/light/src",
            "crates/scene/src",
            "crates/sensor/src",
            "crates/thesis/src",
        ] {
            users(&root.join(folder), &mut found);
        }
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].ends_with("cell_library.rs"), "{found:?}");
    }
}
