//! What a histogram says about distance: where its peak is, how sure that is, and where the echo must lie.
//!
//! ```text
//!   counts ─► fullest stretch ─► chance of it without an echo ─► confidence, significant or not
//!                   └──► peak: centre of mass about its fullest bin ─► fit of the light ─► position and its bound
//! ```
//!
//! The *confidence* is −log₁₀ of the chance that light without an echo makes as full a stretch anywhere in the histogram
//! ([`theory::significance`](crate::theory::significance)): 0 says nothing, 3 is wrong once in a thousand dark windows. A peak
//! is significant where that chance is at most the false-alarm rate.
//!
//! Where TYPE and THRESHOLD make bins count that see little light (less, or equal to none), an echo is a dip. Laser cycles in which a bin
//! did not count are then what is looked at.

use super::expected::{EchoLight, Response};
use super::peak::{Peak, PeakOptions, interpolate_at};
use super::walk::{Corrected, WalkCorrection, WalkLeft};
use crate::chip::{Overflow, Tdc, WindowLaw};
use crate::theory::significance::{Scan, Stretch};
use crate::units::Time;

/// How depths are found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthOptions {
    /// Peaks.
    pub peak: PeakOptions,
    /// Share of macropixels without an echo that may get a depth, above 0 and at most 1, which takes every peak.
    pub false_alarm_rate: f64,
    /// Whether range walk is taken out.
    pub correct_walk: bool,
}

impl Default for DepthOptions {
    fn default() -> Self {
        DepthOptions {
            peak: PeakOptions::default(),
            false_alarm_rate: 1e-3,
            correct_walk: true,
        }
    }
}

/// The peak of a histogram, judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// As the counts have it.
    pub peak: Peak,
    /// Where the echo must lie, bins: the peak's position without range walk, if that is taken out.
    pub position_bins: f64,
    /// The light that explains the peak, if range walk is taken out.
    pub light: Option<EchoLight>,
    /// Cramér-Rao bound of the position under this light, bins.
    pub bound_bins: Option<f64>,
    /// Why range walk is not taken out of a significant peak, where that was asked for.
    pub walk_left: Option<WalkLeft>,
    /// −log₁₀ of the chance that light without an echo makes such a peak, at least 0.
    pub confidence: f64,
    /// Whether that chance is at most the false-alarm rate.
    pub is_significant: bool,
    /// Whether a bin of the peak is full, or light so strong that its counts do not tell where it came: neither the peak's height
    /// nor its centre is known.
    pub is_saturated: bool,
}

/// Bins whose lengths differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("bins differ in length, but the significance of a peak is known for equal bins only")]
pub struct UnequalBins;

/// Finds echoes in the histograms of one sensor and exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EchoFinder {
    /// Length of a bin, s.
    pub bin_s: f64,
    peak: PeakOptions,
    ln_false_alarm: f64,
    scan: Scan,
    /// Counts at which bins stop counting, where they can be reached. One that wraps shows nothing.
    full: Option<u32>,
    walk: Option<Result<WalkCorrection, WalkLeft>>,
    /// Laser cycles, where bins that do not count are what an echo makes.
    uncounted_of: Option<u32>,
}

/// Where each SPAD has a photon of the echo, counts may not tell its place. If the bound is more than this many bins,
/// the error no longer follows the bound (measured at 10² to 10⁴ photons).
const MOST_BOUND_BINS: f64 = 0.25;

/// Standard deviation of a pulse most of which lies within a bin, bins.
const SHORT: f64 = 0.4;

impl EchoFinder {
    /// For the bins of `law` and Gaussian pulses of standard deviation `pulse_sigma`.
    ///
    /// Range walk is taken out where bins are CLK periods, SPADs have lines of their own, and have recovered from one echo before
    /// the next window opens.
    ///
    /// # Errors
    /// Bins of a clocked TDC that differ: pile-up moves peaks otherwise in each. Those of delay lines are told to
    /// [`EchoFinder::find_in`], and range walk stays in.
    pub fn new(
        law: &WindowLaw,
        pulse_sigma: Time,
        options: &DepthOptions,
    ) -> Result<Self, UnequalBins> {
        let (config, exposure) = (law.sensor(), law.exposure());
        let bin_s = match config.tdc {
            Tdc::Clocked | Tdc::Counter => law.bin_width_s().ok_or(UnequalBins)?,
            Tdc::DelayLine => config.delay_element().as_s(),
        };
        let laser_cycles = exposure.laser_cycles;
        let response = Response::new(config, bin_s, pulse_sigma);
        let laser_cycle_bins = exposure.stop(1).as_s() / bin_s;
        let recovers = response.dead_time_bins() + config.bins as f64 <= laser_cycle_bins;
        let complement = response.complement();
        let walk = match config.tdc {
            Tdc::DelayLine => Err(WalkLeft::DelayLine),
            Tdc::Counter => Err(WalkLeft::CounterTdc),
            Tdc::Clocked if config.front_end.joins() => Err(WalkLeft::JoinedSpads),
            Tdc::Clocked if !recovers => Err(WalkLeft::ShortLaserCycle),
            Tdc::Clocked => Ok(WalkCorrection {
                response: complement.unwrap_or(response),
                laser_cycles,
            }),
        };
        let capacity = (1u32 << config.bin_bits) - 1;
        Ok(EchoFinder {
            bin_s,
            peak: options.peak,
            ln_false_alarm: libm::log(options.false_alarm_rate),
            scan: Scan::matched(response.pulse_sigma_bins, config.bins, laser_cycles),
            full: (config.overflow == Overflow::Saturate && capacity < laser_cycles)
                .then_some(capacity),
            walk: options.correct_walk.then_some(walk),
            uncounted_of: complement.map(|_| laser_cycles),
        })
    }

    /// The echo in `counts`, one entry per bin, earliest first; `None` if no bin stands out at all.
    pub fn find(&self, counts: &[u32]) -> Option<Sighting> {
        let Some(cycles) = self.uncounted_of else {
            return self.judge(counts, self.scan.fullest(counts));
        };
        let uncounted: Vec<u32> = counts.iter().map(|&n| cycles.saturating_sub(n)).collect();
        let sighting = self.judge(&uncounted, self.scan.fullest(&uncounted))?;
        // A full bin may have counted more often than it says.
        let is_full = counts.iter().any(|&n| Some(n) == self.full);
        Some(Sighting {
            is_saturated: is_full || sighting.is_saturated,
            ..sighting
        })
    }

    /// The same where bins differ in length: `shares` are their lengths over the mean length.
    pub fn find_in(&self, counts: &[u32], shares: &[f64]) -> Option<Sighting> {
        self.judge(counts, self.scan.least_likely(counts, shares))
    }

    fn judge(&self, counts: &[u32], stretch: Stretch) -> Option<Sighting> {
        let bins = stretch.first..stretch.first + self.scan.width;
        let peak_bin = bins.rev().max_by_key(|&bin| counts[bin])?;
        let real: Vec<f64> = counts.iter().map(|&n| f64::from(n)).collect();
        let peak = interpolate_at(&real, peak_bin, &self.peak);
        let region = self.peak.region(peak_bin, counts.len());
        let is_saturated = counts[region].iter().any(|&n| Some(n) == self.full);
        // Full bins all over leave no peak, but are something to tell.
        let peak = peak.or(is_saturated.then_some(Peak {
            position_bins: peak_bin as f64,
            peak_bin,
            signal_counts: 0.0,
            background_per_bin: real[peak_bin],
        }))?;
        let is_significant = stretch.ln_false_alarm <= self.ln_false_alarm;
        // Where there is no depth anyway, nothing is known of the light either.
        let corrects = is_significant && !is_saturated;
        let walk = self.walk.filter(|_| corrects);
        let fitted = walk.map(|walk| walk.and_then(|walk| walk.correct(&real, &peak)));
        let corrected = fitted.and_then(Result::ok);
        Some(Sighting {
            position_bins: corrected.map_or(peak.position_bins, |c| c.light.position_bins),
            light: corrected.map(|c| c.light),
            bound_bins: corrected.map(|c| c.bound_bins.min(self.most_bound_bins(&c))),
            walk_left: fitted.and_then(Result::err),
            peak,
            confidence: -stretch.ln_false_alarm / std::f64::consts::LN_10,
            is_significant,
            is_saturated: is_saturated || corrected.is_some_and(|c| self.is_lost(&c)),
        })
    }

    /// What the bound of a significant peak is at most: its bin is known if a pulse is shorter than that, and the window otherwise.
    /// Under a THRESHOLD other lights may explain the counts from anywhere.
    fn most_bound_bins(&self, corrected: &Corrected) -> f64 {
        let Some(Ok(WalkCorrection { response, .. })) = self.walk else {
            return f64::INFINITY;
        };
        let is_in_a_bin = corrected.light.sigma_bins < SHORT && response.counting.threshold == 0;
        if is_in_a_bin {
            1.0
        } else {
            response.bins as f64
        }
    }

    /// Whether an echo is so strong that its counts do not tell its place.
    fn is_lost(&self, corrected: &Corrected) -> bool {
        let Some(Ok(walk)) = self.walk else {
            return false;
        };
        corrected.light.signal > walk.response.counting.spads as f64
            && corrected.bound_bins > MOST_BOUND_BINS
    }
}

#[cfg(test)]
mod tests;
