//! What a histogram says of distance: where its peak is, how sure that is, and where the echo must lie.
//!
//! ```text
//!   counts ─► fullest stretch ─► chance of it without an echo ─► confidence, significant or not
//!                   └──► peak: centre of mass about its fullest bin ─► range walk taken out ─► position
//! ```
//!
//! The *confidence* is −log₁₀ of the chance that light without an echo makes as full a stretch anywhere in the histogram
//! ([`theory::significance`](crate::theory::significance)): 0 says nothing, 3 is wrong once in a thousand dark windows. A peak
//! is significant where that chance is at most the false-alarm rate.

use super::expected::{EchoLight, Response};
use super::peak::{Peak, PeakOptions, interpolate_at};
use super::walk::WalkCorrection;
use crate::chip::{EventType, Overflow, Tdc, WindowLaw};
use crate::theory::significance::{Scan, Stretch};
use crate::units::Time;

/// How depths are found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthOptions {
    /// Peaks.
    pub peak: PeakOptions,
    /// Share of macropixels without an echo that may be given a depth, above 0 and at most 1, which takes every peak.
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
    /// −log₁₀ of the chance that light without an echo makes such a peak, at least 0.
    pub confidence: f64,
    /// Whether that chance is at most the false-alarm rate.
    pub is_significant: bool,
    /// Whether a bin of the peak is full, so that neither its height nor its centre is known.
    pub is_saturated: bool,
}

/// Bins whose lengths differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "bins differ in length, and what is significant in a histogram is known for equal ones only"
)]
pub struct UnequalBins;

/// Finds echoes in the histograms of one sensor and exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EchoFinder {
    bin_s: f64,
    peak: PeakOptions,
    ln_false_alarm: f64,
    scan: Scan,
    /// Counts at which bins stop counting, where they can be reached. One that wraps shows nothing.
    full: Option<u32>,
    walk: Option<WalkCorrection>,
}

impl EchoFinder {
    /// For the bins of `law` and Gaussian pulses of standard deviation `pulse_sigma`.
    ///
    /// Range walk is taken out where brighter light gives more counts (TYPE greater, and THRESHOLD below the number of
    /// SPADs) and the SPADs have recovered from one echo before the next window opens.
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
            Tdc::Clocked => law.bin_width_s().ok_or(UnequalBins)?,
            Tdc::DelayLine => config.delay_element().as_s(),
        };
        let laser_cycles = exposure.laser_cycles;
        let response = Response::new(config, bin_s, pulse_sigma);
        let laser_cycle_bins = exposure.stop(1).as_s() / bin_s;
        let recovers = response.dead_time_bins() + config.bins as f64 <= laser_cycle_bins;
        // On a line that all SPADs share, photons cancel, and brighter light may give fewer counts.
        let brighter_is_more =
            config.event_type == EventType::Greater && config.tdc == Tdc::Clocked;
        let capacity = (1u32 << config.bin_bits) - 1;
        Ok(EchoFinder {
            bin_s,
            peak: options.peak,
            ln_false_alarm: options.false_alarm_rate.ln(),
            scan: Scan::matched(response.pulse_sigma_bins(), config.bins, laser_cycles),
            full: (config.overflow == Overflow::Saturate && capacity < laser_cycles)
                .then_some(capacity),
            walk: (options.correct_walk && recovers && brighter_is_more).then_some(
                WalkCorrection {
                    response,
                    laser_cycles,
                    peak: options.peak,
                },
            ),
        })
    }

    /// Length of a bin, s.
    pub fn bin_s(&self) -> f64 {
        self.bin_s
    }

    /// The echo in `counts`, one entry per bin, earliest first; `None` if no bin stands out at all.
    pub fn find(&self, counts: &[u32]) -> Option<Sighting> {
        self.judge(counts, self.scan.fullest(counts))
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
        let corrected = self
            .walk
            .filter(|_| corrects)
            .and_then(|walk| walk.correct(&peak));
        Some(Sighting {
            position_bins: corrected.map_or(peak.position_bins, |c| c.position_bins),
            light: corrected.map(|c| c.light),
            peak,
            confidence: -stretch.ln_false_alarm / std::f64::consts::LN_10,
            is_significant,
            is_saturated,
        })
    }
}
