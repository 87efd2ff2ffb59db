//! The engines and knobs that are compared.

use serde::Serialize;

/// An engine with its knob.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Event-driven, every net; on at most [`GATE_CYCLES`] laser cycles.
    Gate,
    /// Every CLK period: what the others are compared with.
    Cycle,
    /// The window law, with every photon of the exposure drawn.
    WindowWithoutSkipping,
    /// The window law, with only the photons that matter.
    Window,
    /// The same with another seed: how far apart two exact frames are.
    AnotherSeed,
    /// The window engine on one laser cycle in this many, counts multiplied.
    FewerCycles(u32),
    /// The cohort engine.
    Cohort,
}

/// Laser cycles that are run at gate level at most.
pub const GATE_CYCLES: u32 = 20;

/// CLK periods of the laser cycles for which [`Method::processor_ns`] was measured.
pub(super) const MEASURED_PERIODS: f64 = 520.0;

impl Method {
    /// Every method of the comparison: the one that the others are held against, and last the one that takes longest.
    pub const ALL: [Method; 9] = [
        Method::Cycle,
        Method::WindowWithoutSkipping,
        Method::Window,
        Method::AnotherSeed,
        Method::FewerCycles(2),
        Method::FewerCycles(8),
        Method::FewerCycles(32),
        Method::Cohort,
        Method::Gate,
    ];

    /// Processor time for a macropixel and laser cycle in the dark, ns, and what each klux adds: medians of the walls of
    /// `gdtof pareto --macropixels 256 --laser-cycles 200 --repeats 1`, other work beside it.
    pub(super) fn processor_ns(self) -> [f64; 2] {
        match self {
            Method::Gate => [24e3, 3.4e3],
            Method::Cycle | Method::WindowWithoutSkipping => [3.4e3, 75.0],
            Method::Window | Method::AnotherSeed | Method::FewerCycles(_) | Method::Cohort => {
                [800.0, 3.0]
            }
        }
    }

    /// Engine and knob, as tables name them.
    pub fn name(self) -> String {
        match self {
            Method::Gate => "gate".into(),
            Method::Cycle => "cycle".into(),
            Method::WindowWithoutSkipping => "window, no skipping".into(),
            Method::Window => "window".into(),
            Method::AnotherSeed => "window, another seed".into(),
            Method::FewerCycles(n) => format!("window, 1/{n} of the laser cycles"),
            Method::Cohort => "cohort".into(),
        }
    }

    /// What makes its counts differ from those of the `cycle` engine, in a few words.
    pub fn against_cycle(self) -> String {
        match self {
            Method::Cycle => "the reference".into(),
            Method::Gate | Method::WindowWithoutSkipping | Method::Window => "same photons".into(),
            Method::AnotherSeed => "another seed".into(),
            Method::FewerCycles(n) => format!("1/{n} of the photons"),
            Method::Cohort => "own draws".into(),
        }
    }
}
