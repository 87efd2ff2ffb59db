//! What is replayed or exported as a testbench: a sensor, its start values and recorded SPAD events.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::chip::{Exposure, Sensor};
use crate::cli::SensorArgs;
use crate::cli::voice::note;
use crate::files::InputError;
use crate::photon::SpadEvent;
use crate::request::{self, Spelling};
use crate::stimulus::recording::{Recording, read_events, read_starts};

/// The stimulus.
#[derive(Args)]
pub(super) struct StimulusArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    /// Start values: CSV `row,col,init`, one line for every macropixel.
    #[arg(long, value_name = "FILE")]
    inits: PathBuf,
    /// Rising edges of SPAD_RAW: CSV `time_fs,row,col,spad`, with times from the first rising edge of STOP.
    #[arg(long, value_name = "FILE")]
    events: PathBuf,
    /// CLK periods in a laser cycle.
    #[arg(long, value_name = "P")]
    stop_periods: u32,
    /// Laser cycles of the exposure.
    #[arg(long, value_name = "N")]
    laser_cycles: u32,
}

/// The stimulus, read and checked; shared with `gdtof export verilog`.
pub(crate) struct Stimuli {
    /// The chip.
    pub sensor: Sensor,
    /// Its clocks.
    pub exposure: Exposure,
    /// Start values, row-major.
    pub starts: Vec<u16>,
    /// SPAD pulses.
    pub recording: Recording,
}

impl StimulusArgs {
    /// Reads and checks everything.
    ///
    /// # Errors
    /// One sentence about the first thing that is wrong.
    pub(super) fn read(&self) -> Result<Stimuli, InputError> {
        let periods = (self.stop_periods, self.laser_cycles);
        Stimuli::read(self.sensor.read()?, &self.inits, &self.events, periods)
    }
}

impl Stimuli {
    /// Reads start values and events of a sensor; `periods` are CLK periods in a laser cycle and laser cycles.
    ///
    /// # Errors
    /// One sentence about the first thing that is wrong.
    pub(crate) fn read(
        sensor: Sensor,
        inits: &Path,
        events: &Path,
        (stop_periods, laser_cycles): (u32, u32),
    ) -> Result<Self, InputError> {
        let exposure = request::exposure(&sensor, stop_periods, laser_cycles, Spelling::Options)?;
        let starts = read_starts(inits, &sensor)?;
        let recording = read_events(events, &sensor, &exposure)?;
        let dropped = [
            (
                recording.lost_to_dead_time,
                "fell into the dead time of their SPAD",
            ),
            (
                recording.after_the_end,
                "came after the end of the exposure",
            ),
        ];
        for (count, what) in dropped.into_iter().filter(|(count, _)| *count > 0) {
            note(format_args!(
                "{count} of {} events {what} and were not used",
                recording.read
            ));
        }
        Ok(Stimuli {
            sensor,
            exposure,
            starts,
            recording,
        })
    }

    /// Pulses of every macropixel, row-major.
    pub(crate) fn pulses(&self) -> Vec<&[SpadEvent]> {
        self.recording.pulses.iter().map(Vec::as_slice).collect()
    }
}
