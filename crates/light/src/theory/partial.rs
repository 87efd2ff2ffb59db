//! What it costs to do with few bins: zooming and sliding histograms beside full and guided ones (thesis 2.5.2,
//! 3.3.3, 3.4 and 6.4.2; Fig. 27, 35, 42 to 45, 108 and 109).
//!
//! ```text
//!   full      ├┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┤   all bins at once
//!   zooming   ├───────┼───────┼───────┼───────┤   detect the peak in coarse bins, then measure it in fine ones
//!   sliding   ├┼┼┼┼┤  ·  ·  ·  ·  ·  ·  ·  ·      measure in every window in turn
//!   guided                   ├┼┼┼┼┤               measure in the window that something else points out
//! ```
//!
//! The thesis's calculation, which this follows:
//! * Measuring takes as many laser cycles as the wanted precision needs, with the light of the far end of the window.
//! * Detecting takes as many as the wanted P_D needs among the coarse bins up to the target's, the whole echo in one
//!   bin and the target at that bin's far end. One coarse bin needs no detection.
//! * Sliding up to a range adds up the windows that lead there; each takes what its own far end needs.
//! * Full and guided histograms only measure. (That the guide must be right is counted in [`super::design`].)
//!
//! What it leaves out, and [`Cost`] counts on request: bins overflow. A step whose fullest bin would overflow with
//! more than the allowed chance of missing is split into several exposures, each read out and cleared, whose
//! histograms are added off the chip. The laser cycles stay the same, the data grow.

use super::Counts;
use super::capacity::full_bins;
use super::cycles::laser_cycles_for;
use super::detection::{self, PerCycle};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Light as a function of range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// Signal photons per pulse at 1 m; falls with the square of the range.
    pub signal: f64,
    /// Background photons per second.
    pub background_hz: f64,
    /// Standard deviation of the (Gaussian) pulse, s.
    pub pulse_sigma_s: f64,
}

/// What must be reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangingGoal {
    /// Standard deviation of the range, m.
    pub precision_m: f64,
    /// Probability of detection, 0 to 1.
    pub detection: f64,
}

/// Standard deviation of a measured time, ns, from bin interval (ns), pulse σ (ns), mean background counts per bin
/// and mean signal counts: [`super::precision::thompson`] or [`super::precision::cramer_rao`].
pub type Precision = fn(f64, f64, f64, f64) -> f64;

/// Which formulas are believed.
#[derive(Debug, Clone, Copy)]
pub struct Models {
    /// For the laser cycles of a measurement.
    pub precision: Precision,
    /// For those of a detection.
    pub detection: detection::DetectionModel,
}

/// A system whose histogram is too small for its range.
#[derive(Debug, Clone, Copy)]
pub struct System {
    /// The light.
    pub link: Link,
    /// What must be reached.
    pub goal: RangingGoal,
    /// The formulas.
    pub models: Models,
    /// Bins M.
    pub bins: u32,
    /// Bin interval of the measurement, s.
    pub bin_s: f64,
    /// Background counts and ranges of coarse bins follow from this window, m: the range of all M bins.
    pub window_m: f64,
}

/// What a step is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StepPurpose {
    /// Finding the echo among coarse bins.
    Detect {
        /// Bins that may hold the echo.
        candidates: u32,
        /// Range of one bin, m.
        bin_m: f64,
    },
    /// Measuring the range in bins of the measurement's interval.
    Measure,
}

/// One exposure of a scheme, before overflow splits it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExposureStep {
    /// What it is for.
    pub purpose: StepPurpose,
    /// The range whose light it uses, m.
    pub range_m: f64,
    /// Laser cycles it needs; infinite where no number is enough.
    pub laser_cycles: f64,
    /// Mean counts per laser cycle in the fullest bin, if every photon counts.
    pub fullest: f64,
}

/// What a scheme costs up to a range.
#[derive(Debug, Clone, PartialEq)]
pub struct Cost {
    /// Its steps in order.
    pub steps: Vec<ExposureStep>,
    /// The allowed chance of overflow in a step: that of missing the target, 1 − P_D.
    pub overflow_chance: f64,
}

impl Cost {
    /// Laser cycles of all steps.
    pub fn laser_cycles(&self) -> f64 {
        self.steps.iter().map(|step| step.laser_cycles).sum()
    }

    /// Exposures once steps are split so that bins of `bin_bits` do not overflow; each is read out once.
    pub fn exposures(&self, bin_bits: u32) -> f64 {
        let most = largest_mean(bin_bits, self.overflow_chance);
        let of_step =
            |step: &ExposureStep| (step.laser_cycles * step.fullest / most).ceil().max(1.0);
        self.steps.iter().map(of_step).sum()
    }
}

/// The greatest mean of a Poisson count that exceeds a counter of `bin_bits` with no more than `chance`.
pub fn largest_mean(bin_bits: u32, chance: f64) -> f64 {
    let capacity = (1u64 << bin_bits) - 1;
    let overflows = |mean: f64| Counts::poisson(mean, 0.0).tail_above(capacity) > chance;
    let (mut low, mut high) = (0.0, capacity as f64);
    if !overflows(high) {
        return high;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if overflows(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    low
}

/// Share of a full histogram's bins that `bins` bins need which zoom over `steps` steps (Eq. 5).
pub fn zooming_reduction(bins: u32, steps: u32) -> f64 {
    f64::from(bins) / f64::from(bins).powi(steps as i32)
}

/// Share of a full histogram's bins that `bins` bins need which slide over `windows` windows, each of which repeats
/// `overlap` bins of the one before.
pub fn sliding_reduction(bins: u32, windows: u32, overlap: u32) -> f64 {
    let covered = bins + (windows - 1) * (bins - overlap);
    f64::from(bins) / f64::from(covered)
}

impl System {
    /// A system of `bins` bins of `bin_s` whose window is just as long.
    pub fn new(link: Link, goal: RangingGoal, models: Models, bins: u32, bin_s: f64) -> Self {
        System {
            link,
            goal,
            models,
            bins,
            bin_s,
            window_m: f64::from(bins) * bin_s * SPEED_OF_LIGHT_M_PER_S / 2.0,
        }
    }

    fn signal(&self, range_m: f64) -> f64 {
        self.link.signal / (range_m * range_m)
    }

    fn cost(&self, steps: Vec<ExposureStep>) -> Cost {
        Cost {
            steps,
            overflow_chance: 1.0 - self.goal.detection,
        }
    }

    /// Laser cycles that measure a target at `range_m` to the wanted precision, the bins being in the right place.
    pub fn measure(&self, range_m: f64) -> ExposureStep {
        let signal = self.signal(range_m);
        let background = self.link.background_hz * self.bin_s;
        let sigma_s = self.link.pulse_sigma_s;
        let one_cycle_ns =
            (self.models.precision)(1e9 * self.bin_s, 1e9 * sigma_s, background, signal);
        let wanted_ns = 2e9 * self.goal.precision_m / SPEED_OF_LIGHT_M_PER_S;
        let in_peak = libm::erf(0.5 * self.bin_s / (sigma_s * std::f64::consts::SQRT_2));
        ExposureStep {
            purpose: StepPurpose::Measure,
            range_m,
            // Both bounds shrink with the square root of the counts.
            laser_cycles: (one_cycle_ns / wanted_ns).powi(2).ceil(),
            fullest: background + signal * in_peak,
        }
    }

    /// Laser cycles that find a target at the far end `range_m` of one of `candidates` bins of `bin_m`.
    pub(crate) fn detect(&self, bin_m: f64, candidates: u32, range_m: f64) -> ExposureStep {
        let light = PerCycle {
            signal: self.signal(range_m),
            background: self.link.background_hz * 2.0 * bin_m / SPEED_OF_LIGHT_M_PER_S,
            bins: candidates,
        };
        let cycles = laser_cycles_for(self.goal.detection, &light, self.models.detection);
        ExposureStep {
            purpose: StepPurpose::Detect { candidates, bin_m },
            range_m,
            laser_cycles: cycles.map_or(f64::INFINITY, |n| n as f64),
            fullest: light.signal + light.background,
        }
    }

    /// A full histogram, or a guided one.
    pub fn full(&self, range_m: f64) -> Cost {
        self.cost(vec![self.measure(range_m)])
    }

    /// Zooming: detections in bins as wide as the next finer window, as many as `range_m` asks for, coarsest first;
    /// then the measurement. The first detection has the bins up to the target to choose from, later ones all M.
    pub fn zooming(&self, range_m: f64) -> Cost {
        let mut steps = vec![self.measure(range_m)];
        let mut bin_m = self.window_m;
        while bin_m < range_m * (1.0 - 1e-12) {
            let up_to_target = full_bins(range_m, bin_m);
            let far_m = f64::from(up_to_target) * bin_m;
            steps.push(self.detect(bin_m, up_to_target.min(self.bins), far_m));
            bin_m *= f64::from(self.bins);
        }
        steps.reverse();
        self.cost(steps)
    }

    /// Sliding: a measurement in every window up to the one that holds `range_m`, each window repeating `overlap`
    /// (below M) bins of the one before.
    pub fn sliding(&self, range_m: f64, overlap: u32) -> Cost {
        debug_assert!(overlap < self.bins);
        let stride_m = self.window_m * f64::from(self.bins - overlap) / f64::from(self.bins);
        let mut steps = Vec::new();
        let mut end_m = self.window_m;
        loop {
            steps.push(self.measure(end_m));
            if end_m >= range_m * (1.0 - 1e-12) {
                return self.cost(steps);
            }
            end_m += stride_m;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::detection::{DetectionModel, Ties, probability};
    use super::super::precision::{cramer_rao, thompson};
    use super::*;
    use proptest::prelude::*;

    fn demonstrator(precision: Precision) -> System {
        let link = Link {
            signal: 89.0,
            background_hz: 8e6,
            pulse_sigma_s: 4.5e-9 / 2.354_820_045_030_949,
        };
        let goal = RangingGoal {
            precision_m: 0.1,
            detection: 0.997,
        };
        let models = Models {
            precision,
            detection: DetectionModel::Poisson(Ties::Random),
        };
        System::new(link, goal, models, 8, 2.6e-9)
    }

    /// Eq. 20 by hand at 75 m: σ = 1.911 ns, a = 2.6 ns, µ_S = 0.015822, µ_B = 0.0208 a cycle; 0.1 m are 0.66713 ns.
    /// (3.6518 + 0.5633)/0.015822 + 4√π·6.9786·0.0208/(2.6·2.50344e-4) = 266.4 + 1581.1; over 0.44506 that is 4151.
    #[test]
    fn one_measurement_by_hand() {
        let cycles = demonstrator(thompson).measure(75.0).laser_cycles;
        assert!((cycles - 4151.0).abs() < 2.0, "{cycles}");
    }

    #[test]
    fn published_reductions() {
        assert_eq!(zooming_reduction(8, 3), 1.0 / 64.0);
        assert_eq!(zooming_reduction(2, 8), 1.0 / 128.0);
        assert_eq!(sliding_reduction(16, 16, 0), 1.0 / 16.0);
        // 32 bins, then 15 times 26 new ones.
        assert_eq!(sliding_reduction(32, 16, 6), 32.0 / 422.0);
    }

    #[test]
    fn zooming_adds_a_step_with_every_power_of_the_bins() {
        let system = demonstrator(thompson);
        let candidates = |z_m: f64| -> Vec<u32> {
            let steps = system.zooming(z_m).steps;
            let detects = steps.iter().filter_map(|step| match step.purpose {
                StepPurpose::Detect { candidates, .. } => Some(candidates),
                StepPurpose::Measure => None,
            });
            detects.collect()
        };
        assert!(candidates(3.0).is_empty());
        assert_eq!(candidates(3.2), [2]);
        assert_eq!(candidates(24.9), [8]);
        assert_eq!(candidates(25.0), [2, 8]);
        assert_eq!(candidates(75.0), [4, 8]);
        assert_eq!(candidates(200.0), [2, 8, 8]);
    }

    #[test]
    fn a_detection_takes_the_fewest_cycles_that_do() {
        let system = demonstrator(thompson);
        let step = system.detect(system.window_m, 8, 24.9);
        let light = PerCycle {
            signal: 89.0 / (24.9 * 24.9),
            background: 8e6 * 8.0 * 2.6e-9,
            bins: 8,
        };
        let found = |cycles: f64| {
            probability(&light, cycles as u64, system.models.detection).probability >= 0.997
        };
        assert!(found(step.laser_cycles) && !found(step.laser_cycles - 1.0));
    }

    #[test]
    fn sliding_sums_the_windows_up_to_the_target() {
        let system = demonstrator(thompson);
        let cost = system.sliding(10.0, 0);
        let ends: Vec<f64> = cost
            .steps
            .iter()
            .map(|s| s.range_m / system.window_m)
            .collect();
        assert_eq!(ends.len(), 4);
        let sum: f64 = (1..=4)
            .map(|l| system.measure(f64::from(l) * system.window_m).laser_cycles)
            .sum();
        assert!((cost.laser_cycles() - sum).abs() < 1e-9 * sum);
        // Half of every window repeated: 3.12 m, then 1.56 m more each.
        assert_eq!(system.sliding(10.0, 4).steps.len(), 6);
    }

    #[test]
    fn the_largest_mean_just_does_not_overflow() {
        for bits in [1, 8, 12, 14] {
            let mean = largest_mean(bits, 0.003);
            let capacity = (1u64 << bits) - 1;
            let chance = |mean: f64| Counts::poisson(mean, 0.0).tail_above(capacity);
            assert!(
                chance(mean) <= 0.003 && chance(mean * 1.001) > 0.003,
                "{bits}: {mean}"
            );
        }
    }

    #[test]
    fn overflow_splits_a_step_into_whole_exposures() {
        let step = |laser_cycles| ExposureStep {
            purpose: StepPurpose::Measure,
            range_m: 1.0,
            laser_cycles,
            fullest: 1.0,
        };
        let most = largest_mean(8, 0.003);
        let cost = Cost {
            steps: vec![step(0.5 * most), step(2.5 * most)],
            overflow_chance: 0.003,
        };
        assert_eq!(cost.exposures(8), 4.0);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn nothing_is_cheaper_than_a_full_histogram(z_m in 1.0f64..150.0, overlap in 0u32..8, bound: bool) {
            let system = demonstrator(if bound { cramer_rao } else { thompson });
            let full = system.full(z_m).laser_cycles();
            prop_assert!(system.zooming(z_m).laser_cycles() >= full);
            prop_assert!(system.sliding(z_m, overlap).laser_cycles() >= full);
        }
    }
}
