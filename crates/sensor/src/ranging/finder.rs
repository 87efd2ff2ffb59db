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

use std::ops::Range;

use super::expected::{EchoLight, Response};
use super::peak::{Peak, PeakOptions, interpolate_at, median};
use super::returns::{CountStretch, Others, Search, WindowReturn};
use super::walk::{CorrectedPeak, MOST_BOUND_BINS, WalkCorrection, WalkLeft};
use crate::chip::{Overflow, Tdc, WindowLaw};
use crate::photon::EchoWidth;
use crate::theory::significance::{Scan, Stretch};

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
    /// Standard deviation of the position, bins: its Cramér-Rao bound under this light, or the distance to other lights that explain the
    /// counts as well, and a part of the echo's spread. Of a pulse shorter than 0.4 bins, that of all places which explain the counts. A bin where
    /// the counts tell no more ([`WalkLeft::ToABin`]).
    pub bound_bins: Option<f64>,
    /// Why range walk is not taken out of a significant peak, where that was asked for.
    pub walk_left: Option<WalkLeft>,
    /// −log₁₀ of the chance that light without an echo makes such a peak, at least 0.
    pub confidence: f64,
    /// Whether that chance is at most the false-alarm rate.
    pub is_significant: bool,
    /// Further returns, where the peak is significant.
    pub others: Others,
    /// Whether a bin of the peak is full, or light so strong that its counts do not tell where it came, not even to a bin: neither the
    /// peak's height nor its centre is known.
    pub is_saturated: bool,
}

/// Bins whose lengths differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("bins differ in length, but the significance of a peak is known for equal bins only")]
pub struct UnequalBins;

/// Finds echoes in the histograms of one sensor and exposure.
#[derive(Debug, Clone, PartialEq)]
pub struct EchoFinder {
    /// Length of a bin, s.
    pub bin_s: f64,
    peak: PeakOptions,
    ln_false_alarm: f64,
    scan: Scan,
    /// Counts at which bins stop counting, where they can be reached.
    full: Option<u32>,
    /// Counts from which on a bin may have wrapped, or be about to: half of those that it has bits for (chosen).
    may_wrap: Option<u32>,
    walk: Option<Result<WalkCorrection, WalkLeft>>,
    /// Laser cycles, where bins that do not count are what an echo makes.
    uncounted_of: Option<u32>,
}

/// Photons for each SPAD above which the few bins that count under a THRESHOLD no longer tell the place to the bound: of 1000 walls at
/// 4.5·10³ and 10⁴ photons up to 69 were beyond five bounds, at 900 none.
const MOST_UNDER_THRESHOLD: f64 = 60.0;

/// Echoes of deep surfaces are no Gaussian pulses: their mean is known to this part of their spread. Chosen: of some 80 000 depths of 45 frames 80
/// are beyond five bounds, with 0.2 83 are.
const OF_SHAPE: f64 = 0.3;

/// The same in light that fires every SPAD in every laser cycle: its counts show the front of an echo, and a surface ends where a Gaussian
/// pulse does not. Chosen: of 16 629 places of a slanting wall in short pulses 47 were beyond five bounds with [`OF_SHAPE`] alone.
const OF_FRONT: f64 = 0.8;

/// An echo is cut off where the window's first or last bin has more than this part of its peak: chosen.
const MOST_AT_END: f64 = 0.5;

impl EchoFinder {
    /// For the bins of `law` and pulses of this width: a [`Time`](crate::units::Time) is the standard deviation of Gaussian ones.
    ///
    /// Range walk is taken out where bins are CLK periods, SPADs have lines of their own, and have recovered from one echo before
    /// the next window opens.
    ///
    /// # Errors
    /// Bins of a clocked TDC that differ: pile-up moves peaks otherwise in each. Those of delay lines are told to
    /// [`EchoFinder::find_in`], and range walk stays in.
    pub fn new(
        law: &WindowLaw,
        pulse: impl Into<EchoWidth>,
        options: &DepthOptions,
    ) -> Result<Self, UnequalBins> {
        let (config, exposure) = (law.sensor(), law.exposure());
        let bin_s = match config.tdc {
            Tdc::Clocked | Tdc::Counter => law.bin_width_s().ok_or(UnequalBins)?,
            Tdc::DelayLine => config.delay_element().as_s(),
        };
        let laser_cycles = exposure.laser_cycles;
        let pulse = pulse.into();
        let response = Response::new(config, bin_s, pulse);
        let laser_cycle_bins = exposure.stop(1).as_s() / bin_s;
        let recovers = response.dead_time_bins() + config.bins as f64 <= laser_cycle_bins;
        let complement = response.complement();
        let walk = match config.tdc {
            Tdc::DelayLine => Err(WalkLeft::DelayLine),
            Tdc::Counter => Err(WalkLeft::CounterTdc),
            Tdc::Clocked if config.front_end.joins() => Err(WalkLeft::JoinedSpads),
            Tdc::Clocked if !recovers => Err(WalkLeft::ShortLaserCycle),
            Tdc::Clocked if !pulse.is_gaussian => Err(WalkLeft::PulseShape),
            Tdc::Clocked => Ok(WalkCorrection {
                response: complement.clone().unwrap_or_else(|| response.clone()),
                laser_cycles,
            }),
        };
        let capacity = (1u32 << config.bin_bits) - 1;
        let full = (capacity < laser_cycles).then_some(capacity);
        Ok(EchoFinder {
            bin_s,
            peak: options.peak,
            ln_false_alarm: libm::log(options.false_alarm_rate),
            scan: Scan::matched(response.pulse_sigma_bins, config.bins, laser_cycles),
            full: full.filter(|_| config.overflow == Overflow::Saturate),
            may_wrap: full
                .filter(|_| config.overflow == Overflow::Wrap)
                .map(|capacity| capacity / 2),
            walk: options.correct_walk.then_some(walk),
            uncounted_of: complement.is_some().then_some(laser_cycles),
        })
    }

    /// For counts of a detector with this response in `laser_cycles`, with bins of `bin_s` seconds on average, which stop at `full`.
    pub(super) fn of_response(
        response: Response,
        bin_s: f64,
        (laser_cycles, full): (u32, Option<u32>),
        options: &DepthOptions,
    ) -> Self {
        EchoFinder {
            bin_s,
            peak: options.peak,
            ln_false_alarm: libm::log(options.false_alarm_rate),
            scan: Scan::matched(response.pulse_sigma_bins, response.bins, laser_cycles),
            full,
            may_wrap: None,
            walk: options.correct_walk.then_some(Ok(WalkCorrection {
                response,
                laser_cycles,
            })),
            uncounted_of: None,
        }
    }

    /// The echo in `counts`, one entry per bin, earliest first; `None` if no bin stands out at all.
    pub fn find(&self, counts: &[u32]) -> Option<Sighting> {
        let Some(cycles) = self.uncounted_of else {
            return self.sighting(counts, self.scan.fullest(counts), &|_| 1.0);
        };
        let uncounted: Vec<u32> = counts.iter().map(|&n| cycles.saturating_sub(n)).collect();
        let sighting = self.sighting(&uncounted, self.scan.fullest(&uncounted), &|_| 1.0)?;
        // A full bin may have counted more often than it says.
        let is_full = counts.iter().any(|&n| Some(n) == self.full);
        Some(Sighting {
            is_saturated: is_full || sighting.is_saturated,
            ..sighting
        })
    }

    /// The same where bins differ in length: `shares` are their lengths over the mean length.
    pub fn find_in(&self, counts: &[u32], shares: &[f64]) -> Option<Sighting> {
        self.sighting(counts, self.scan.least_likely(counts, shares), &|bin| {
            shares[bin]
        })
    }

    /// The same where bins have `dark` counts without an echo, times any factor.
    pub(super) fn find_over(&self, counts: &[u32], dark: &[f64]) -> Option<Sighting> {
        let mean = dark.iter().sum::<f64>() / dark.len() as f64;
        let usual = median(dark.iter());
        let shares: Vec<f64> = dark.iter().map(|dark| dark / mean).collect();
        self.sighting(counts, self.scan.least_likely(counts, &shares), &|bin| {
            dark[bin] / usual
        })
    }

    /// What `counts` say whose fullest stretch is `stretch`; `share` is that of each bin in light that comes at any time alike.
    fn sighting(
        &self,
        counts: &[u32],
        stretch: Stretch,
        share: &dyn Fn(usize) -> f64,
    ) -> Option<Sighting> {
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
        // What has wrapped looks like less light.
        let has_wrapped = self
            .may_wrap
            .is_some_and(|least| counts.iter().any(|&n| n > least));
        let corrects = is_significant && !is_saturated && !has_wrapped;
        let walk = self.walk.as_ref().filter(|_| corrects);
        let whole = walk.map(|walk| match walk {
            Ok(walk) => walk.correct(&real, &peak),
            Err(left) => Err(*left),
        });
        let is_unlike = has_wrapped && is_significant && self.walk.is_some();
        let whole = whole.or(is_unlike.then_some(Err(WalkLeft::NotOneEcho)));
        let (fitted, others) = if corrects {
            self.first_echo_and_others(&real, &peak, whole, share)
        } else {
            (whole, Others::default())
        };
        let corrected = fitted.and_then(Result::ok);
        let is_cut = corrected.is_some_and(|c| self.is_cut(&c, &real, peak.peak_bin));
        let is_lost = corrected.is_some_and(|c| self.is_lost(&c));
        let bounded = corrected.filter(|_| !is_cut && !is_lost);
        let position = corrected.map(|c| c.light.position_bins);
        // Where counts do not tell the place within a bin, they may tell the bin.
        let near = corrected.filter(|c| is_lost && !is_cut && c.bound_bins <= 1.0);
        let bin = if is_saturated {
            self.full_bin(counts, peak_bin)
        } else {
            position.filter(|_| near.is_some())
        };
        let why = match bin {
            Some(_) => Some(WalkLeft::ToABin),
            None => is_cut.then_some(WalkLeft::CutEcho),
        };
        Some(Sighting {
            position_bins: bin.or(position).unwrap_or(peak.position_bins),
            light: corrected.map(|c| c.light),
            bound_bins: bounded.map(|c| self.bound_bins(&c)).or(bin.map(|_| 1.0)),
            walk_left: fitted.and_then(Result::err).or(why),
            others,
            peak,
            confidence: -stretch.ln_false_alarm / std::f64::consts::LN_10,
            is_significant,
            is_saturated: (is_saturated || is_lost) && bin.is_none(),
        })
    }

    /// The middle of one full bin, or of two, about a peak that the window shows whole.
    fn full_bin(&self, counts: &[u32], peak_bin: usize) -> Option<f64> {
        let is_full = |bin: usize| Some(counts[bin]) == self.full;
        let full: Vec<usize> = (0..counts.len()).filter(|&bin| is_full(bin)).collect();
        let (&first, &last) = (full.first()?, full.last()?);
        let is_one = last - first < 2 && first.abs_diff(peak_bin) < 2;
        let is_whole = first > 0 && last + 1 < counts.len();
        (is_one && is_whole && self.uncounted_of.is_none()).then(|| (first + last) as f64 / 2.0)
    }

    /// The first echo's light, from its own bins where there are others, and those others. `whole` is what all bins together say of it, and
    /// `share` that of each bin in light that comes at any time alike.
    fn first_echo_and_others(
        &self,
        counts: &[f64],
        peak: &Peak,
        whole: Option<Result<CorrectedPeak, WalkLeft>>,
        share: &dyn Fn(usize) -> f64,
    ) -> (Option<Result<CorrectedPeak, WalkLeft>>, Others) {
        let walk = self.walk_correction();
        let light = whole.and_then(Result::ok).map(|c| c.light);
        let flat = |per_bin: f64| (0..counts.len()).map(|bin| per_bin * share(bin)).collect();
        let mut search = Search {
            counts,
            expected: flat(peak.background_per_bin),
            taken: vec![false; counts.len()],
            width: self.scan.width,
            ln_false_alarm: self.ln_false_alarm,
        };
        let own = search.extent(peak.peak_bin);
        search.mark_bins(own.clone());
        if let (Some(walk), Some(light)) = (walk, light) {
            let cycles = f64::from(walk.laser_cycles);
            let chances = walk.response.chances(&light);
            search.expected = chances.iter().map(|chance| cycles * chance).collect();
            let half = 3.0 * light.sigma_bins + 0.5;
            let ends =
                [-half, half].map(|off| (light.position_bins + off).round().max(0.0) as usize);
            search.mark_bins(ends[0]..ends[1] + 1);
        } else {
            let outside = counts
                .iter()
                .zip(&search.taken)
                .filter(|(_, taken)| !**taken);
            search.expected = flat(median(outside.map(|(counts, _)| counts)));
        }
        let mut others = Others::default();
        let mut founds: Vec<CountStretch> = Vec::new();
        while founds.len() < others.len()
            && let Some(found) = search.next()
        {
            founds.push(found);
        }
        let is_explained = search.is_explained();
        for (other, found) in others.iter_mut().zip(&founds) {
            *other = Some(self.as_return(&search, found, is_explained));
        }
        // All bins together are no one echo's where there are several.
        let fitted = match (whole, walk) {
            (Some(Err(WalkLeft::NotOneEcho | WalkLeft::NotConverged)), Some(walk))
                if others[0].is_some() =>
            {
                let bins = wider(&own, counts.len());
                Some(if is_explained && search.is_apart(&own) {
                    let background = walk.background_of(search.expected[peak.peak_bin]);
                    walk.correct_in(counts, bins, peak, background)
                } else {
                    Err(WalkLeft::NotOneEcho)
                })
            }
            _ => whole,
        };
        (fitted, others)
    }

    /// A further echo, fitted where its counts are those of one.
    fn as_return(
        &self,
        search: &Search<'_>,
        found: &CountStretch,
        is_explained: bool,
    ) -> WindowReturn {
        let walk = self.walk_correction();
        let CountStretch {
            bins,
            peak_bin,
            confidence,
        } = found;
        let above = |bin: usize| (search.counts[bin] - search.expected[bin]).max(0.0);
        let sum: f64 = bins.clone().map(above).sum();
        let moment: f64 = bins.clone().map(|bin| above(bin) * bin as f64).sum();
        let expected = search.expected[*peak_bin];
        let centre = Peak {
            position_bins: moment / sum,
            peak_bin: *peak_bin,
            signal_counts: sum,
            background_per_bin: expected,
        };
        let is_full = |bin: usize| Some(search.counts[bin] as u32) == self.full;
        let has_full = bins.clone().any(is_full);
        let fits = is_explained && !has_full && search.is_apart(bins);
        let fitted = walk.filter(|_| fits).and_then(|walk| {
            let bins = wider(bins, search.counts.len());
            let background = walk.background_of(expected);
            let fitted = walk.correct_in(search.counts, bins, &centre, background);
            fitted.ok()
        });
        let mean = sum / f64::from(self.scan.laser_cycles);
        WindowReturn {
            position_bins: fitted.map_or(centre.position_bins, |c| c.light.position_bins),
            bound_bins: fitted.map(|c| self.bound_bins(&c)),
            photons: fitted.map_or(mean, |c| c.light.signal),
            spread_bins: fitted.and_then(|c| self.spread_bins(&c.light)),
            confidence: *confidence,
        }
    }

    fn walk_correction(&self) -> Option<&WalkCorrection> {
        self.walk.as_ref()?.as_ref().ok()
    }

    /// Standard deviation of what widens the pulse to this echo, bins.
    pub fn spread_bins(&self, light: &EchoLight) -> Option<f64> {
        let walk = self.walk_correction()?;
        let (echo, pulse) = (light.sigma_bins, walk.response.pulse_sigma_bins);
        Some((echo * echo - pulse * pulse).max(0.0).sqrt())
    }

    /// Whether the window ends within an echo: its width is a guess then.
    fn is_cut(&self, corrected: &CorrectedPeak, counts: &[f64], peak_bin: usize) -> bool {
        let last = counts.len() - 1;
        let cycles = f64::from(self.scan.laser_cycles);
        let walk = self.walk_correction();
        let dark = walk.and_then(|walk| walk.response.dark_chances(&corrected.light));
        let above = |bin: usize| {
            let background = corrected.light.background_per_bin;
            counts[bin] - cycles * dark.as_ref().map_or(background, |dark| dark[bin])
        };
        let ends_high = [0, last].map(|end| above(end) > MOST_AT_END * above(peak_bin));
        let is_inside = (-0.5..last as f64 + 0.5).contains(&corrected.light.position_bins);
        !is_inside || ends_high != [false; 2]
    }

    /// What is said of an echo's place: the least that its counts allow, and what its unknown shape, and SPADs and pulses that differ, add.
    fn bound_bins(&self, corrected: &CorrectedPeak) -> f64 {
        let Some(walk) = self.walk_correction() else {
            return corrected.bound_bins;
        };
        let of_a_spad = corrected.light.signal / walk.response.counting.spads as f64;
        let share_fired = -libm::expm1(-of_a_spad);
        let of_spread = OF_SHAPE + (OF_FRONT - OF_SHAPE) * share_fired;
        let spread = self.spread_bins(&corrected.light).unwrap_or(0.0);
        let bound = libm::hypot(corrected.bound_bins, of_spread * spread);
        let of_spreads = walk.error_of_spreads(&corrected.light);
        // Under a THRESHOLD other lights may explain the counts from anywhere.
        libm::hypot(bound, of_spreads).min(walk.response.bins as f64)
    }

    /// Whether an echo is so strong that its counts do not tell its place.
    fn is_lost(&self, corrected: &CorrectedPeak) -> bool {
        let Some(walk) = self.walk_correction() else {
            return false;
        };
        let of_a_spad = corrected.light.signal / walk.response.counting.spads as f64;
        let is_strong = of_a_spad > 1.0 && corrected.bound_bins > MOST_BOUND_BINS;
        is_strong || walk.response.counting.threshold > 0 && of_a_spad > MOST_UNDER_THRESHOLD
    }
}

/// One bin more on either side.
fn wider(bins: &Range<usize>, all: usize) -> Range<usize> {
    bins.start.saturating_sub(1)..(bins.end + 1).min(all)
}

#[cfg(test)]
mod tests;
