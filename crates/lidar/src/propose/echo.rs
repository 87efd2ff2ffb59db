//! What a macropixel sees of the target through windows of any number of bins, and how many laser cycles it takes to find and to
//! measure it.

use crate::chip::SensorConfig;
use crate::numerics::{normal_above, normal_density};
use crate::photon::EchoWidth;
use crate::ranging::{DepthOptions, EchoLight, Response};
use crate::theory::significance::{Chances, Scan};

/// Bins that are looked at: more than any window and pulse have.
const BINS: usize = 96;

/// Places of the echo relative to the bins, over which precision is averaged, and every second of which detection.
const PHASES: usize = 8;

/// Laser cycles are found to this share of their number.
const CLOSE: f64 = 2e-3;

/// An echo under one THRESHOLD, in bins of one length.
#[derive(Debug, Clone)]
pub(super) struct BinnedEcho {
    /// At every phase, chance and information of every bin.
    phases: Vec<Vec<(f64, f64)>>,
    sigma_bins: f64,
}

/// The same through a window in whose middle it is.
#[derive(Debug, Clone)]
pub(super) struct WindowedEcho {
    bins: usize,
    /// Neighbouring bins that are tested together.
    pub(super) width: usize,
    /// At every second phase.
    chances: Vec<Chances>,
    /// Least variances of the place after one laser cycle, bins², where the window is 0, 1, … bins off.
    variances: Vec<f64>,
    /// The greatest chance of a bin to count in a laser cycle.
    pub(super) fullest: f64,
}

impl BinnedEcho {
    /// Of `signal` photons a laser cycle before `background_hz`, for a sensor's macropixels.
    pub(super) fn new(
        config: &SensorConfig,
        pulse: EchoWidth,
        signal: f64,
        background_hz: f64,
    ) -> Self {
        let wide = SensorConfig {
            bins: BINS,
            ..config.clone()
        };
        let response = Response::new(&wide, 1.0 / config.clk_hz, pulse);
        let sigma_bins = response.pulse_sigma_bins;
        let information = |phase: usize| {
            let offset = (phase as f64 + 0.5) / PHASES as f64 - 0.5;
            response.information(&EchoLight {
                position_bins: (BINS / 2) as f64 + offset,
                signal,
                background_per_bin: background_hz / config.clk_hz,
                sigma_bins,
            })
        };
        BinnedEcho {
            phases: (0..PHASES).map(information).collect(),
            sigma_bins,
        }
    }

    /// Through a window of `bins` bins.
    pub(super) fn windowed(&self, bins: usize) -> WindowedEcho {
        let first = BINS / 2 - bins / 2;
        let windows = || self.phases.iter().map(|phase| &phase[first..first + bins]);
        let width = Scan::matched(self.sigma_bins, bins, 1).width;
        let sum = |bins: &[(f64, f64)]| bins.iter().map(|bin| bin.0).sum::<f64>();
        let chances = windows().step_by(2).map(|window| {
            let fullest = window.windows(width).map(sum).fold(0.0, f64::max);
            Chances {
                bins,
                stretch: fullest / width as f64,
                beside: (sum(window) - fullest).max(0.0) / (bins - width) as f64,
            }
        });
        // Bins that are not looked at tell nothing.
        let told = |phase: &Vec<(f64, f64)>, off: isize| -> f64 {
            let end = |at: usize| at.saturating_add_signed(off).min(BINS);
            let seen = &phase[end(first)..end(first + bins)];
            seen.iter().map(|bin| bin.1).sum()
        };
        let variance = |off: usize| {
            let both = [1, -1].map(|side| off as isize * side);
            let each = self
                .phases
                .iter()
                .flat_map(|phase| both.map(|off| 1.0 / told(phase, off)));
            each.sum::<f64>() / (2 * PHASES) as f64
        };
        let all = windows().flatten().map(|bin| bin.0);
        WindowedEcho {
            bins,
            width,
            chances: chances.collect(),
            variances: (0..=(bins - width) / 2).map(variance).collect(),
            fullest: all.fold(0.0, f64::max),
        }
    }
}

impl WindowedEcho {
    /// How often the target is found after `laser_cycles` where the window holds it.
    pub(super) fn detection(&self, laser_cycles: u32) -> f64 {
        let scan = Scan {
            width: self.width,
            laser_cycles,
        };
        let ln_false_alarm = libm::log(DepthOptions::default().false_alarm_rate);
        let powers = self.chances.iter().map(|c| scan.power(c, ln_false_alarm));
        powers.sum::<f64>() / self.chances.len() as f64
    }

    /// Variance of the place after one laser cycle, bins², in windows that a guide with an error of `guide_bins` (standard deviation) puts
    /// where they hold the tested stretch.
    pub(super) fn variance(&self, guide_bins: f64) -> f64 {
        // A window is off by the error and a part of a bin, rounded: the second difference of the integral of the error's distribution.
        let integral = |t: f64| {
            let x = t / guide_bins;
            t * (1.0 - normal_above(x)) + guide_bins * normal_density(x)
        };
        let (mut weights, mut sum) = (0.0, 0.0);
        for (off, variance) in self.variances.iter().enumerate() {
            let t = off as f64;
            let one = (integral(t + 1.0) - 2.0 * integral(t) + integral(t - 1.0)).max(0.0);
            let weight = if off == 0 { one } else { 2.0 * one };
            weights += weight;
            sum += weight * variance;
        }
        sum / weights
    }

    /// The fewest laser cycles, from `from` to `most`, that find it with this probability, about: the last steps are of [`CLOSE`].
    pub(super) fn cycles_for(&self, detection: f64, from: u32, most: u32) -> Option<u32> {
        // What is missed falls about exponentially with the laser cycles.
        let excess = |n: u32| {
            let miss = (1.0 - self.detection(n)).max(1e-15);
            libm::log(miss / (1.0 - detection))
        };
        let (mut low, mut high) = (from.max(1), from.max(1));
        let (mut at_low, mut at_high) = (excess(low), f64::NAN);
        if at_low <= 0.0 {
            return Some(low);
        }
        while at_high.is_nan() || at_high > 0.0 {
            if high >= most {
                return None;
            }
            (low, at_low) = (high, if at_high.is_nan() { at_low } else { at_high });
            high = high.saturating_mul(2).min(most);
            at_high = excess(high);
        }
        for round in 0..30 {
            let gap = high - low;
            if f64::from(gap) <= (CLOSE * f64::from(high)).max(1.0) {
                break;
            }
            let share = match round % 3 {
                2 => 0.5,
                _ => (at_low / (at_low - at_high)).clamp(0.02, 0.98),
            };
            let middle = (low + (share * f64::from(gap)) as u32).clamp(low + 1, high - 1);
            let at_middle = excess(middle);
            if at_middle <= 0.0 {
                (high, at_high) = (middle, at_middle);
            } else {
                (low, at_low) = (middle, at_middle);
            }
        }
        Some(high)
    }

    /// Bins of the window that may hold the echo's centre if the tested stretch is to be in it.
    pub(super) fn usable_bins(&self) -> usize {
        self.bins + 1 - self.width
    }
}
