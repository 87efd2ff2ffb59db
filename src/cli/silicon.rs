//! What the chip is made of and where it is operated: `--process`, `--voltage`, `--temperature`, `--mismatch`.
//!
//! ```text
//!   process, voltage, temperature ─► factor on every delay ─┐
//!   mismatch, its seed ─────────────► factor on each cell's ┴─► Silicon
//! ```

use clap::Args;

use crate::chip::{SensorConfig, Silicon, UnknownConditions};
use crate::files::InputError;
use crate::netlist::{Conditions, Corner, Mismatch};

/// Silicon and its conditions.
#[derive(Args)]
pub(super) struct SiliconArgs {
    /// Speed of the silicon: slow, typ or fast. Like voltage and temperature it scales the delays of the sensor's
    /// corner.
    #[arg(long, value_name = "SPEED", default_value = "typ")]
    process: Corner,
    /// Supply voltage, V.
    #[arg(long, value_name = "V", default_value_t = 1.1)]
    voltage: f64,
    /// Junction temperature, °C, instead of the sensor's [default: sensor.temperature_c, or 50].
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    temperature: Option<f64>,
    /// Random mismatch: relative standard deviation of an inverter's delay.
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0)]
    mismatch: f64,
    /// Seed of the mismatch.
    #[arg(long, value_name = "S", visible_alias = "seed", default_value_t = 1)]
    mismatch_seed: u64,
}

impl SiliconArgs {
    /// The silicon: a sensor's library in its corner.
    ///
    /// # Errors
    /// Conditions and mismatch for which no delays are known.
    pub(super) fn read(&self, config: &SensorConfig) -> Result<Silicon, InputError> {
        let silicon = Silicon::of(config).in_conditions(self.conditions(config));
        let silicon = silicon.map_err(|why| {
            let options = match why {
                UnknownConditions::OfLibrary => "--process, --voltage, --temperature",
                UnknownConditions::Far => "--voltage, --temperature",
            };
            InputError::new(options, why.to_string())
        })?;
        if !(0.0..=0.5).contains(&self.mismatch) {
            let message = format!("{} is not a relative spread; give 0 to 0.5", self.mismatch);
            return Err(InputError::new("--mismatch", message));
        }
        let mismatch = (self.mismatch > 0.0).then_some(Mismatch {
            sigma: self.mismatch,
            seed: self.mismatch_seed,
        });
        Ok(Silicon {
            mismatch,
            ..silicon
        })
    }

    /// Process, supply and temperature.
    pub(super) fn conditions(&self, config: &SensorConfig) -> Conditions {
        let usual = config.conditions();
        Conditions {
            process: self.process,
            voltage_v: self.voltage,
            temperature_c: self.temperature.unwrap_or(usual.temperature_c),
        }
    }
}
