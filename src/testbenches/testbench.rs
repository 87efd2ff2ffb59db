//! What a testbench is.

use std::path::Path;

use crate::chip::SensorConfig;
use crate::files::InputError;
use crate::report::Checks;

/// A testbench.
#[derive(Debug, Clone, Copy)]
pub struct Testbench {
    /// Its name, which is also its waveform's.
    pub name: &'static str,
    /// What it is about, in a line.
    pub about: &'static str,
    /// Fills in the checks and writes the waveform to the path it is given, with the views beside it.
    pub(super) run: fn(&Path, &mut Checks) -> Result<(), InputError>,
    /// How it drives blocks of one's own.
    pub(super) own: Option<OwnBlocks>,
}

/// A testbench's way with blocks of one's own.
#[derive(Debug, Clone, Copy)]
pub(super) struct OwnBlocks {
    /// Blocks that it drives, as `--block` calls them.
    pub blocks: &'static [&'static str],
    /// The same as [`Testbench::run`] with those of this sensor.
    pub run: fn(&SensorConfig, &Path, &mut Checks) -> Result<(), InputError>,
}

impl Testbench {
    /// Runs it, on the own blocks of a sensor if it has any. The waveform goes to `waves`, in the format of its name; what belongs to
    /// it goes beside it.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(crate) fn run(&self, sensor: &SensorConfig, waves: &Path) -> Result<Checks, InputError> {
        let mut checks = Checks::new();
        match self.own.filter(|_| sensor.own_files().next().is_some()) {
            Some(own) => (own.run)(sensor, waves, &mut checks)?,
            None => (self.run)(waves, &mut checks)?,
        }
        Ok(checks)
    }

    /// Whether it drives all blocks of its own that a sensor has.
    pub(crate) fn drives(&self, sensor: &SensorConfig) -> bool {
        let blocks = self.own.map_or(&[][..], |own| own.blocks);
        sensor.own_files().all(|(name, _)| blocks.contains(&name))
    }
}
