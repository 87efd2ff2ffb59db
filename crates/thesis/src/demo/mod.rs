//! The demonstrator of the thesis (chapter 6, Table 14): HSLIDAR in its delay-line mode with its calibration, before the scenes that it was
//! shown with.
//!
//! ```text
//!   scene in motion ─► guide ─► windows ─► 16 000 laser cycles at 80 kHz ─► histograms ─► depths, three times a second
//! ```
//!
//! Every demo is a drive ([`DriveSimulation`](crate::system::DriveSimulation)) of the whole chain, with what is asked of it measured at the end: whether a
//! target was found, and if not, why not.

pub mod disturbed;
pub(crate) mod found;
pub mod limit;
pub(crate) mod panel;
pub(crate) mod scenes;
pub(crate) mod schemes;
pub mod show;
pub mod shows;
pub mod sweep;

pub use found::TargetSummary;
pub use schemes::SchemeOutcome;

use crate::chip::{Exposure, Sensor, hslidar_delay_line};
use crate::ranging::BinProfile;
use crate::scene::Scene;
use crate::system::{BinSweepError, DriveSettings, FrameSettings, Sweep, calibrate};
use crate::units::Time;

/// CLK periods in a laser cycle: 80 kHz on a CLK of 80 MHz (Table 14).
pub(crate) const STOP_PERIODS: u32 = 1000;
/// Laser cycles of an exposure: 200 ms (6.4.2).
pub const LASER_CYCLES: u32 = 16_000;

/// The chip with its calibration.
#[derive(Debug, Clone)]
pub struct Demonstrator {
    pub(crate) sensor: Sensor,
    /// Its exposures.
    pub exposure: Exposure,
    pub(crate) calibration: BinProfile,
}

impl Demonstrator {
    /// Calibrates the chip as in 6.3.1, with a laser that steps by `step`.
    ///
    /// # Errors
    /// What the sweep reports.
    pub fn calibrated(step: Time, swept: impl Fn() + Sync) -> Result<Self, BinSweepError> {
        let sensor: Sensor = hslidar_delay_line();
        let sweep = Sweep {
            step,
            ..Sweep::default()
        };
        let calibrated = calibrate(&sensor, STOP_PERIODS, &sweep, swept)?;
        Ok(Self::new(calibrated.profile))
    }

    /// The chip that a calibration is of, perhaps with fewer rows.
    pub(crate) fn new(calibration: BinProfile) -> Self {
        Demonstrator {
            exposure: Exposure::new(&calibration.sensor, STOP_PERIODS, LASER_CYCLES),
            sensor: Sensor::from(&calibration.sensor),
            calibration,
        }
    }

    /// A drive through `scene`, as the demonstrator took it. Where the chip has fewer rows, the laser lights as much less with as much less
    /// energy.
    pub(crate) fn drive(&self, mut scene: Scene, seed: u64) -> DriveSettings {
        let rows = hslidar_delay_line().rows;
        scene.lidar.pulse_energy_uj *= self.sensor.rows as f64 / rows as f64;
        DriveSettings::new(FrameSettings {
            seed,
            calibration: Some(self.calibration.clone()),
            ..FrameSettings::new(&self.sensor, scene, self.exposure)
        })
    }
}
