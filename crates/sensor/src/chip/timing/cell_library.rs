//! The cells that a chip is made of: the built-in ones with their chosen delays, or those of a Liberty file.
//!
//! ```text
//!   sensor.liberty, .liberty_cells, .input_slew_ps, .wire_ff ─► read once a process ─► delays of every instance, limits, area, leakage
//! ```
//!
//! A macropixel is sized and timed by itself and then placed everywhere, as a block that is laid out once: its delays are the same alone
//! and in the array, so that all engines follow one window law. What lies around the macropixels (loading, readout, CLK's wires) is sized
//! around them. Cells with delays of their own (delay lines, wires, the balanced gates of a photon line) keep these.

use std::collections::HashMap;
use std::hash::{Hash, Hasher};
use std::path::PathBuf;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use super::library_files::library_files;
use super::library_text::read_library;
use crate::chip::SensorConfig;
use crate::chip::blocks::{front_end, macropixel};
use crate::files::instead_of;
use crate::liberty::{CharacterisedNetlist, Environment, Liberty};
use crate::netlist::{ArcDelay, CellKind, Corner, Library, Module, Netlist, ScopeId, Timing};

/// The cells that a chip is made of. Copies are the same; a file is read once a process.
#[derive(Debug, Clone, Copy)]
pub struct CellLibrary(Option<&'static FromFile>);

/// A Liberty file, read.
#[derive(Debug)]
pub struct FromFile {
    /// Its cells.
    pub liberty: Liberty,
    /// What is odd about them, one sentence each.
    pub remarks: Vec<String>,
    /// Slews and wires that they are timed with.
    pub environment: Environment,
    /// Delays and limits of each kind by itself.
    nominal: Library,
}

/// Everything that decides what a file becomes.
#[derive(Clone, PartialEq, Eq, Hash)]
struct LibraryKey {
    path: PathBuf,
    cells: String,
    input_slew_ps: u64,
    wire_ff: u64,
}

impl CellLibrary {
    /// The built-in cells.
    pub const BUILT_IN: Self = CellLibrary(None);

    /// What a sensor is made of.
    ///
    /// # Errors
    /// The key at fault and what is wrong: a file that cannot be read or is no library, a corner without one, cells that are not there.
    pub fn from_config(config: &SensorConfig) -> Result<Self, (&'static str, String)> {
        let (key, path) = match config.corner {
            Corner::Typ => ("liberty", &config.liberty),
            Corner::Slow => ("liberty_slow", &config.liberty_slow),
            Corner::Fast => ("liberty_fast", &config.liberty_fast),
        };
        if path.as_os_str().is_empty() {
            let others = [&config.liberty, &config.liberty_slow, &config.liberty_fast];
            if others.iter().all(|other| other.as_os_str().is_empty()) {
                return Ok(Self::BUILT_IN);
            }
            let corner = config.corner.name();
            let message =
                format!("corner = {corner:?} with a library in another corner; give {key}, too");
            return Err((key, message));
        }
        let wanted = LibraryKey {
            path: path.clone(),
            cells: config.liberty_cells.clone(),
            input_slew_ps: config.input_slew_ps.to_bits(),
            wire_ff: config.wire_ff.to_bits(),
        };
        static READ: LazyLock<Mutex<HashMap<LibraryKey, &'static FromFile>>> =
            LazyLock::new(Mutex::default);
        let mut read = READ.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = read.get(&wanted) {
            return Ok(CellLibrary(Some(known)));
        }
        let cells =
            wanted_cells(&config.liberty_cells).map_err(|message| ("liberty_cells", message))?;
        let files = library_files(path);
        let mut texts = Vec::new();
        for file in &files {
            let text = read_library(file);
            texts.push(text.map_err(|message| (key, format!("{}: {message}", file.display())))?);
        }
        let names = files
            .iter()
            .map(|file| file.file_name().unwrap_or_default());
        let names: Vec<_> = names.map(|name| name.to_string_lossy()).collect();
        let named: Vec<(&str, &str)> = names
            .iter()
            .zip(&texts)
            .map(|(name, text)| (&**name, &**text))
            .collect();
        let liberty = Liberty::read_files(&named, &cells).map_err(|e| {
            let place = format!("{}:{}", files[e.file].display(), e.error.line);
            (key, format!("{place}: {e}"))
        })?;
        let mut environment = Environment::new(&liberty);
        if config.input_slew_ps > 0.0 {
            environment.input_slew_fs = config.input_slew_ps * 1e3;
        }
        environment.wire_ff = config.wire_ff;
        // A kind's limits are the largest that any flip-flop of the QuantIC4x4's macropixel has.
        let mut nominal = liberty.nominal(&environment);
        let pixel = Netlist::elaborate(&macropixel::circuit(&SensorConfig::default()));
        let placed = CharacterisedNetlist::new(&pixel, &liberty, &environment);
        let [(shortest_fs, of_shortest), (longest_fs, of_longest)] =
            placed.extreme_delays(&pixel, &liberty);
        if longest_fs > f64::from(u32::MAX) {
            let us = longest_fs * 1e-9;
            let message = format!(
                "a macropixel's longest delay would be {us:.3} us, of {of_longest}; delays up to 4.295 us are known"
            );
            return Err((key, format!("{}: {message}", path.display())));
        }
        let remarks = liberty.map.remarks.iter();
        let mut remarks: Vec<String> = remarks.map(ToString::to_string).collect();
        if shortest_fs < 0.0 {
            let ps = shortest_fs * 1e-3;
            remarks.push(format!(
                "delays below zero count as 0: the least in a macropixel is {ps:.3} ps, of {of_shortest}"
            ));
        }
        for kind in CellKind::ALL {
            if let Some(limits) = placed.largest_limits(&pixel, kind) {
                nominal.set_checks(kind, limits);
            }
        }
        // As long as the process: a sensor's copies share it, and a process has few libraries.
        let from_file: &'static FromFile = Box::leak(Box::new(FromFile {
            liberty,
            remarks,
            environment,
            nominal,
        }));
        read.insert(wanted, from_file);
        Ok(CellLibrary(Some(from_file)))
    }

    /// Delays and limits of each kind of cell.
    pub fn cells(self) -> &'static Library {
        static BUILT_IN: LazyLock<Library> = LazyLock::new(Library::generic_40nm);
        self.0.map_or(&*BUILT_IN, |from_file| &from_file.nominal)
    }

    /// What was read, if not the built-in cells.
    pub fn from_file(self) -> Option<&'static FromFile> {
        self.0
    }

    /// Delays of a netlist in a corner; cells with delays of their own have the library's.
    pub(super) fn timing(self, netlist: &Netlist, corner: Corner) -> Timing {
        match self.0 {
            None => Timing::of_library(netlist, self.cells(), corner),
            Some(from_file) => from_file.timing(netlist),
        }
    }
}

impl FromFile {
    /// Delays of a netlist. A SPAD's toggle flip-flop takes the slower of its two delays either way: which way a photon turns it depends on
    /// all photons before, which the fast engines do not draw.
    fn timing(&self, netlist: &Netlist) -> Timing {
        let mut timing = self.characterised(netlist).timing;
        let mut toggles: HashMap<*const Module, Option<usize>> = HashMap::new();
        for (index, scope) in netlist.scopes().iter().enumerate() {
            let toggle = toggles
                .entry(Arc::as_ptr(&scope.module))
                .or_insert_with(|| scope.module.cell(front_end::TOGGLE));
            let Some(toggle) = *toggle else { continue };
            let mut cells = netlist.cells_of(ScopeId::new(index));
            let cell = cells.nth(toggle).expect("a cell of the module");
            let mut delays = *timing.cell_delays(cell);
            for arc in delays.as_flattened_mut() {
                let slower = arc.rise().max(arc.fall());
                *arc = ArcDelay::new(slower, slower);
            }
            timing.set(cell, delays);
        }
        timing
    }

    /// A netlist in its cells, each macropixel by itself.
    pub fn characterised(&self, netlist: &Netlist) -> CharacterisedNetlist {
        CharacterisedNetlist::with_blocks(netlist, &self.liberty, &self.environment, |module| {
            module.name() == macropixel::NAME
        })
    }
}

/// Two are equal if they come from one reading.
impl PartialEq for CellLibrary {
    fn eq(&self, other: &Self) -> bool {
        self.0.map(std::ptr::from_ref) == other.0.map(std::ptr::from_ref)
    }
}

impl Eq for CellLibrary {}

impl Hash for CellLibrary {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.map(std::ptr::from_ref).hash(state);
    }
}

/// `KIND=NAME` pairs.
fn wanted_cells(text: &str) -> Result<Vec<(CellKind, String)>, String> {
    let pairs = text
        .split(',')
        .map(str::trim)
        .filter(|pair| !pair.is_empty());
    let pair = |pair: &str| {
        let kinds = CellKind::ALL.into_iter();
        let found = pair.split_once('=').and_then(|(kind, name)| {
            let kind = kinds
                .clone()
                .find(|k| k.name().eq_ignore_ascii_case(kind.trim()))?;
            Some((kind, name.trim().to_owned()))
        });
        found.ok_or_else(|| {
            let kind = pair.split('=').next().unwrap_or_default().trim();
            let names = kinds.clone().map(CellKind::name);
            format!(
                "{pair:?} is not KIND=NAME with a kind of cell; {}",
                instead_of(kind, names)
            )
        })
    };
    pairs.map(pair).collect()
}
