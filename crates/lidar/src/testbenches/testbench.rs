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
    /// How it drives a sensor that it is given.
    pub(super) given: Option<GivenSensor>,
}

/// How a testbench drives a sensor that it is given.
#[derive(Debug, Clone, Copy)]
pub(super) struct GivenSensor {
    /// Blocks of one's own that it drives, as `--block` calls them.
    pub blocks: &'static [&'static str],
    /// Complains of a sensor that it cannot drive.
    pub check: fn(&SensorConfig) -> Result<(), InputError>,
    /// The same as [`Testbench::run`] with this sensor, which has been checked.
    pub run: fn(&SensorConfig, &Path, &mut Checks) -> Result<(), InputError>,
}

impl Testbench {
    /// Runs it on a sensor, if one is given, or else on those that it is about. The waveform goes to `waves`, in the format of its
    /// name; what belongs to it goes beside it.
    ///
    /// # Errors
    /// When a file cannot be written, and for a sensor that it cannot drive.
    pub fn run(&self, sensor: Option<&SensorConfig>, waves: &Path) -> Result<Checks, InputError> {
        let mut checks = Checks::new();
        match (self.given, sensor) {
            (Some(given), Some(sensor)) => {
                (given.check)(sensor)?;
                (given.run)(sensor, waves, &mut checks)?;
            }
            _ => (self.run)(waves, &mut checks)?,
        }
        Ok(checks)
    }

    /// Whether it can drive this sensor, as far as it takes one.
    ///
    /// # Errors
    /// Why it cannot.
    pub fn check(&self, sensor: &SensorConfig) -> Result<(), InputError> {
        self.given.map_or(Ok(()), |given| (given.check)(sensor))
    }

    /// Whether it drives sensors, and all blocks of its own that this one has.
    pub fn drives(&self, sensor: &SensorConfig) -> bool {
        let drives = |given: GivenSensor| {
            let mut own = sensor.own_files();
            own.all(|(name, _)| given.blocks.contains(&name))
        };
        self.given.is_some_and(drives)
    }
}
