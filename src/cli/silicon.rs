//! What the chip is made of and where it is operated: `--process`, `--voltage`, `--temperature`, `--mismatch`.
//!
//! ```text
//!   process, voltage, temperature ─► factor on every delay ─┐
//!   mismatch, its seed ─────────────► factor on each cell's ┴─► Silicon
//! ```

use clap::Args;

use crate::chip::{SensorConfig, Silicon};
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
    /// Junction temperature, °C.
    #[arg(
        long,
        value_name = "C",
        default_value_t = 50.0,
        allow_negative_numbers = true
    )]
    temperature: f64,
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
        let silicon = Silicon::of(config);
        if silicon.library.from_file().is_some() && self.conditions() != Conditions::default() {
            let message = "a library is characterised at conditions of its own; give its file of other conditions as sensor.liberty_slow or sensor.liberty_fast, and --set sensor.corner=slow or fast";
            return Err(InputError::new(
                "--process, --voltage, --temperature",
                message,
            ));
        }
        let factor = self.conditions().delay_factor().ok_or_else(|| {
            let message = "no delays are known there; give -55 to 150 °C and a supply up to 2 V at least 0.2 V above the threshold of about 0.4 V";
            InputError::new("--voltage, --temperature", message)
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
            factor,
            mismatch,
            ..silicon
        })
    }

    /// Process, supply and temperature.
    pub(super) fn conditions(&self) -> Conditions {
        Conditions {
            process: self.process,
            voltage_v: self.voltage,
            temperature_c: self.temperature,
        }
    }
}
