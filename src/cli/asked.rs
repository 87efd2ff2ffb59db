//! Options about the exposure that `gdtof frame` and `gdtof drive` share.

use std::path::PathBuf;

use clap::Args;

use super::guiding::GuideArgs;
use crate::request::{FrameRequest, Spelling};
use crate::system::EngineKind;

/// An exposure, and how its windows are guided.
#[derive(Args)]
pub(super) struct ExposureArgs {
    #[command(flatten)]
    pub(super) guiding: GuideArgs,
    /// CLK periods in a laser cycle.
    #[arg(long, value_name = "P", default_value_t = 520)]
    pub(super) stop_periods: u32,
    /// Laser cycles of an exposure.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    pub(super) laser_cycles: u32,
    /// Seed of photons and guide errors.
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Engine that runs the macropixels.
    #[arg(long, value_enum, default_value_t)]
    pub(super) engine: EngineKind,
    /// Bins of the sensor's delay lines as `gdtof calibrate` has measured them. Without it all are taken to be equal.
    #[arg(long, value_name = "FILE")]
    pub(super) calibration: Option<PathBuf>,
}

impl ExposureArgs {
    /// The request with these options, and defaults for everything else.
    pub(super) fn request(&self) -> FrameRequest {
        self.guiding.ask(FrameRequest {
            stop_periods: self.stop_periods,
            laser_cycles: self.laser_cycles,
            seed: self.seed,
            engine: self.engine,
            calibration: self.calibration.clone(),
            spelling: Spelling::Options,
            ..FrameRequest::default()
        })
    }
}
