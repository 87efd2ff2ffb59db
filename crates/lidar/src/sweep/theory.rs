//! What chapter 3 of the thesis says about one macropixel: [`theory`](crate::theory) at a point of a study.
//!
//! Light and clocks are those of sensor and scene; the target is a wall at a range of its own. Assumptions are the formulas' own: a Gaussian
//! pulse, a Gaussian error of the guide, a window centred on its estimate as nearly as start values allow. The pulse fills bins as it falls
//! on them ([`SpreadEcho`]); the Gaussian models put the share of its fullest bin into one.

use super::cell::{Column, Holds, TableCell};
use crate::chip::{SensorConfig, Tdc};
use crate::photon::PhotonBudget;
use crate::scene::Scene;
use crate::settings::Range::{Above, Within};
use crate::settings::{keys, words};
use crate::theory::cycles::laser_cycles_for;
use crate::theory::design::share_inside;
use crate::theory::detection::{Detection, DetectionModel, PerCycle, probability};
use crate::theory::precision::{cramer_rao, cramer_rao_one_a_cycle, range_m, thompson};
use crate::theory::spread_echo::{Hits, SpreadEcho};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

words! {
    /// How counts are distributed.
    #[derive(Default)]
    pub(super) enum Counts {
        /// One hit a bin and laser cycle.
        #[default]
        Bernoulli = "bernoulli",
        /// Every photon.
        Poisson = "poisson",
        /// As many photons that they are normal.
        Gaussian = "gaussian",
        /// The same, as the thesis prints it.
        GaussianAsPrinted = "gaussian_as_printed",
    }
}

keys! {
    /// Settings of theory.
    pub(super) struct TheorySettings {
        /// Range of the wall; 50 if left out.
        range_m: f64 ["m"] = 50.0, in Above(0.0, 1e5);
        /// Its reflectivity; 0.3 if left out.
        reflectivity: f64 = 0.3, in Within(0.0, 1.0);
        /// Sunlight on it; the scene's if left out.
        illuminance_klux: Option<f64> ["klux"] = None, in Within(0.0, 200.0);
        /// Laser cycles of the exposure; 1000 if left out.
        laser_cycles: u64 = 1000, in Within(1.0, 1e9);
        /// Standard deviation of the guide's estimate; 1 if left out.
        guide_sigma_m: f64 ["m"] = 1.0, in Above(0.0, 1e5);
        /// How counts are distributed; bernoulli, one hit a bin and laser cycle, if left out.
        model: Counts = Counts::Bernoulli, from "thesis 3.2.2";
        /// Probability of detection for which the number of laser cycles is computed, if given.
        goal_detection: Option<f64> = None, in Within(0.5, 0.999_999_999);
    }
}

/// Results, in order.
pub(super) fn columns() -> Vec<Column> {
    [
        ("signal_per_cycle", ""),
        ("background_per_bin_cycle", ""),
        ("p_detection", ""),
        ("p_miss", ""),
        ("precision_thompson_m", "m"),
        ("precision_bound_m", "m"),
        ("laser_cycles_for_goal", ""),
        ("bin_m", "m"),
        ("window_m", "m"),
        ("reach_m", "m"),
        ("share_in_window", ""),
        ("p_right", ""),
    ]
    .map(|(name, unit)| Column::new(name, unit, Holds::Number))
    .into()
}

/// What sensor and scene say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rig {
    budget: PhotonBudget,
    dark_count_hz: f64,
    pulse_sigma_ns: f64,
    /// A bin's length, s: a CLK period, or a delay line's element on average.
    bin_s: f64,
    /// From one start value's window to the next, s.
    step_s: f64,
    bins: usize,
    counter_bits: usize,
    illuminance_klux: f64,
}

impl Rig {
    pub(super) fn new(sensor: &SensorConfig, scene: &Scene) -> Self {
        let clk_s = 1.0 / sensor.clk_hz;
        Rig {
            budget: scene.photon_budget(sensor.rows as u32, sensor.cols as u32),
            dark_count_hz: scene.lidar.dark_counts_hz(),
            pulse_sigma_ns: scene.pulse_sigma().as_s() * 1e9,
            bin_s: match sensor.tdc {
                Tdc::Clocked | Tdc::Counter => clk_s,
                Tdc::DelayLine => sensor.delay_element().as_s(),
            },
            step_s: sensor.step_periods as f64 * clk_s,
            bins: sensor.bins,
            counter_bits: sensor.counter_bits,
            illuminance_klux: scene.light.illuminance_klux,
        }
    }
}

/// What has just been computed.
#[derive(Debug, Default)]
pub(super) struct TheoryCache {
    /// Of a wall without its guide.
    detection: Option<(Wall, Detection, Option<f64>)>,
    /// Of a wall in one laser cycle; precision goes with the root of their number.
    bound_m: Option<(Wall, f64)>,
}

/// A wall before a rig. Its `Debug` text says all of it, and is what its results are kept under.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wall {
    rig: Rig,
    range_m: f64,
    reflectivity: f64,
    laser_cycles: u64,
    guide_sigma_m: f64,
    model: Counts,
    goal_detection: Option<f64>,
}

impl Wall {
    pub(super) fn new(mut rig: Rig, asked: &TheorySettings) -> Self {
        rig.illuminance_klux = asked.illuminance_klux.unwrap_or(rig.illuminance_klux);
        Wall {
            rig,
            range_m: asked.range_m,
            reflectivity: asked.reflectivity,
            laser_cycles: asked.laser_cycles,
            guide_sigma_m: asked.guide_sigma_m,
            model: asked.model,
            goal_detection: asked.goal_detection,
        }
    }

    /// The results. `last` makes those of a wall that differs from the one before in the guide alone, or in laser cycles, cheap: the bound
    /// takes an integral, detection and the search for laser cycles a sum.
    pub(super) fn results(&self, last: &mut TheoryCache) -> Vec<TableCell> {
        let Wall { rig, .. } = self;
        let (bin_s, cycles) = (rig.bin_s, self.laser_cycles as f64);
        let background_hz = (rig.budget).background_hz(self.reflectivity, rig.illuminance_klux);
        let light = PerCycle {
            signal: rig.budget.signal_per_pulse(self.range_m, self.reflectivity),
            background: (background_hz + rig.dark_count_hz) * bin_s,
            bins: rig.bins as u32,
        };
        let wall = Wall {
            guide_sigma_m: 1.0,
            ..*self
        };
        let (detection, needed) = match last.detection {
            Some((known, found, needed)) if known == wall => (found, needed),
            _ => {
                let (found, needed) = self.detection(&light);
                last.detection = Some((wall, found, needed));
                (found, needed)
            }
        };
        let wall = Wall {
            laser_cycles: 1,
            model: match self.model {
                Counts::Bernoulli => Counts::Bernoulli,
                Counts::Poisson | Counts::Gaussian | Counts::GaussianAsPrinted => Counts::Gaussian,
            },
            goal_detection: None,
            ..wall
        };
        let bound_of_one_cycle = match last.bound_m {
            Some((known, bound_m)) if known == wall => bound_m,
            _ => {
                let bound = match wall.model {
                    Counts::Bernoulli => cramer_rao_one_a_cycle,
                    _ => cramer_rao,
                };
                let bound_ns = bound(
                    bin_s * 1e9,
                    rig.pulse_sigma_ns,
                    light.background,
                    light.signal,
                );
                last.bound_m = Some((wall, range_m(bound_ns)));
                range_m(bound_ns)
            }
        };
        let (background, signal) = (cycles * light.background, cycles * light.signal);
        let thompson_ns = thompson(bin_s * 1e9, rig.pulse_sigma_ns, background, signal);
        let [bin_m, step_m] = [bin_s, rig.step_s].map(|s| 0.5 * s * SPEED_OF_LIGHT_M_PER_S);
        let window_m = rig.bins as f64 * bin_m;
        let reach_m = libm::exp2(rig.counter_bits as f64) * step_m;
        // Too little light says less than the window does.
        let precision = |m: f64| (light.signal > 0.0 && m < window_m).then_some(m);
        let in_window = if self.range_m <= reach_m {
            share_inside(self.guide_sigma_m, window_m, step_m)
        } else {
            0.0
        };
        [
            Some(light.signal),
            Some(light.background),
            Some(detection.probability),
            Some(detection.miss),
            precision(range_m(thompson_ns)),
            precision(bound_of_one_cycle / cycles.sqrt()),
            needed,
            Some(bin_m),
            Some(window_m),
            Some(reach_m),
            Some(in_window),
            Some(in_window * detection.probability),
        ]
        .map(TableCell::maybe)
        .into()
    }

    /// How likely the peak is right, and the laser cycles that the goal takes, if there is one: infinite where light never suffices.
    fn detection(&self, light: &PerCycle) -> (Detection, Option<f64>) {
        let bin_ns = self.rig.bin_s * 1e9;
        let echo = SpreadEcho {
            signal: light.signal,
            background: light.background,
            bins: light.bins,
            sigma_bins: self.rig.pulse_sigma_ns / bin_ns,
        };
        let spread = |hits| {
            let found = echo.detection(self.laser_cycles, hits);
            let needed = |goal| echo.laser_cycles_for(goal, hits);
            (found, self.goal_detection.map(needed))
        };
        let in_one_bin = |model| {
            let fullest = PerCycle {
                signal: light.signal * echo.fullest_share(),
                ..*light
            };
            let found = probability(&fullest, self.laser_cycles, model);
            let needed = |goal| laser_cycles_for(goal, &fullest, model);
            // Nobody finds what sends nothing back, and the search would go on for long.
            let needed = |goal| (fullest.signal > 0.0).then(|| needed(goal)).flatten();
            (found, self.goal_detection.map(needed))
        };
        let (found, needed) = match self.model {
            Counts::Bernoulli => spread(Hits::OneACycle),
            Counts::Poisson => spread(Hits::All),
            Counts::Gaussian => in_one_bin(DetectionModel::Gaussian),
            Counts::GaussianAsPrinted => in_one_bin(DetectionModel::GaussianAsPrinted),
        };
        let cycles = |cycles: Option<u64>| cycles.map_or(f64::INFINITY, |cycles| cycles as f64);
        (found, needed.map(cycles))
    }
}

#[cfg(test)]
mod tests;
