//! The settings of a frame: the chip, the world, the clocks, and which engine runs it.

use std::path::PathBuf;
use std::sync::Arc;

use crate::chip::{Exposure, Sensor};
use crate::engine::waveform::WaveCycles;
use crate::engine::{
    Cohort, CohortOptions, Cycle, EngineError, Expose, Gate, Replay, Runner, Window,
};
use crate::guide::{BehaviouralStereo, Guide};
use crate::ranging::{BinProfile, DepthOptions};
use crate::scene::Scene;
use crate::settings::words;

words! {
    /// Which engine runs the macropixels that are not probed.
    #[derive(Default)]
    #[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
    #[non_exhaustive]
    pub enum EngineKind {
        /// Event-driven simulation of the netlist with its delays.
        Gate = "gate",
        /// The netlist without delays, many macropixels at once, for every CLK period in which anything can change.
        Cycle = "cycle",
        /// Only the photons and CLK periods that a window can see.
        #[default]
        Window = "window",
        /// No photons: histograms are drawn from their distribution.
        Cohort = "cohort",
    }
}

impl EngineKind {
    /// The engine that probes at gate level are compared with when this one is asked for: `window` in the place of
    /// `cohort`, which has no photons, and of what a tolerance chooses.
    pub fn of_probes(self, has_tolerance: bool) -> Self {
        match self {
            EngineKind::Cohort => EngineKind::Window,
            _ if has_tolerance => EngineKind::Window,
            kind => kind,
        }
    }

    /// The engine that replays pulses, for a sensor and an exposure.
    ///
    /// # Errors
    /// `cohort` has no photons.
    pub fn replay(
        self,
        sensor: &Sensor,
        exposure: &Exposure,
    ) -> Result<Box<dyn Replay>, EngineError> {
        match self {
            EngineKind::Gate => Ok(Box::new(Gate::new(sensor, exposure))),
            EngineKind::Cycle => Ok(Box::new(Cycle::new(sensor, exposure))),
            EngineKind::Window => Ok(Box::new(Window::new(sensor, exposure))),
            EngineKind::Cohort => Err(EngineError::NoPhotons),
        }
    }

    /// What runs macropixels with delays of their own where this engine is asked for.
    ///
    /// # Errors
    /// `cohort` has no photons.
    pub fn runner(self) -> Result<Runner, EngineError> {
        match self {
            EngineKind::Gate => Ok(Runner::Gate),
            EngineKind::Cycle => Ok(Runner::Cycle),
            EngineKind::Window => Ok(Runner::Window),
            EngineKind::Cohort => Err(EngineError::NoPhotons),
        }
    }

    /// The engine that is exposed to light, for a sensor and an exposure; `cohort` has the knobs of `options`.
    pub fn expose(
        self,
        sensor: &Sensor,
        exposure: &Exposure,
        options: CohortOptions,
    ) -> Box<dyn Expose> {
        match self {
            EngineKind::Gate => Box::new(Gate::new(sensor, exposure)),
            EngineKind::Cycle => Box::new(Cycle::new(sensor, exposure)),
            EngineKind::Window => Box::new(Window::new(sensor, exposure)),
            EngineKind::Cohort => Box::new(Cohort::new(sensor, exposure, options)),
        }
    }
}

/// A macropixel to run at gate level as well, with its waveform.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GateProbe {
    /// Row in the array.
    pub row: usize,
    /// Column in the array.
    pub col: usize,
    /// Where its waveform goes, in the format of the name; the views for GTKWave and Surfer go beside it.
    pub waves: PathBuf,
    /// What the waveform keeps.
    pub wave_cycles: WaveCycles,
}

/// Everything a frame depends on.
#[derive(Debug, Clone)]
pub struct FrameSettings {
    /// The chip.
    pub sensor: Sensor,
    /// The world, the optics and the camera pair.
    pub scene: Scene,
    /// The exposure of `sensor`.
    pub exposure: Exposure,
    /// Seed of photons and stereo errors.
    pub seed: u64,
    /// Engine of the macropixels.
    pub engine: EngineKind,
    /// Knobs of the cohort engine.
    pub cohort: CohortOptions,
    /// Depth error that a cheaper engine may add on average, m: each macropixel gets the cheapest that keeps it, whatever
    /// `engine` says.
    pub tolerance_m: Option<f64>,
    /// Leave out what the engine can do without; `false` draws and runs everything, for the same histograms.
    pub skip: bool,
    /// Depth from histograms.
    pub depth: DepthOptions,
    /// When the bins of delay lines are, if that has been measured; without it, all are taken to be alike.
    pub calibration: Option<BinProfile>,
    /// What tells where targets roughly are.
    pub guide: Arc<dyn Guide>,
}

impl FrameSettings {
    /// A frame of `scene` on the `window` engine, with nothing drawn that it can do without: seed 1, depths by the default options, bins
    /// that have not been calibrated, and the scene's camera pair with drawn errors as its guide. `exposure` must be one of `sensor`.
    pub fn new(sensor: impl Into<Sensor>, scene: Scene, exposure: Exposure) -> Self {
        FrameSettings {
            sensor: sensor.into(),
            scene,
            exposure,
            seed: 1,
            engine: EngineKind::default(),
            cohort: CohortOptions::default(),
            tolerance_m: None,
            skip: true,
            depth: DepthOptions::default(),
            calibration: None,
            guide: Arc::new(BehaviouralStereo),
        }
    }
}
