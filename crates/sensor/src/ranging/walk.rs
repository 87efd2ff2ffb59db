//! Range walk: how far pile-up moves a peak, from what is known of the pulse and the SPADs.
//!
//! SPADs that fired in the early part of a strong echo are blind for its late part, and a bin counts once a laser
//! cycle however many photons come. So the centre of mass lies before the echo's centre, the more the brighter
//! it is. The mean histogram of an echo is known ([`Response`]), so its place is fitted ([`likelihood`](super::likelihood)):
//!
//! ```text
//!   centre of mass, light of its bins ─► fit over all bins ─► explains the counts? ─► with its own width ─► position, bound
//!   strong light: best of many ────────────┘             no │ with a width of its own? ─► position, bound
//!                                                        no │ other echoes besides?  ─► fit of the peak's bins alone
//!                                                        no ╰─► the reason, and the centre of mass as it is
//! ```
//!
//! Nothing is called corrected that does not explain its counts. The thesis assumes pile-up away (3.2.2); the correction
//! is ours.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use self::many_starts::{has_another, with_rivals};
use super::expected::{EchoLight, Response, Steps};
use super::likelihood::{
    ECHO, Fit, Free, IN_REGION, Likelihood, OF_A_WIDTH, WIDE_ECHO, WIDE_IN_REGION,
};
use super::peak::Peak;
use super::place::{SHORT, averaged};
use crate::chip::EventType;

mod many_starts;

/// Shares of the most background with which the best fit under a THRESHOLD is tried again: chosen. Of 495 random lights under a
/// THRESHOLD six were fitted more than half a bound beside without, and one is with it.
const DARKER: [f64; 4] = [0.3, 0.1, 0.03, 0.01];

/// Photons on a SPAD in a laser cycle from which on its first one tells the place: chosen. Of 256 depths of a sign with 156 of them in bright sun, 17 and 19 %
/// were beyond five bounds of the likelihood's curvature at two of three distances.
/// The fewest steps of time take such light for another one.
const SHARP: f64 = 20.0;

/// Share of the laser cycles that must reach a bin to tell the background: chosen.
const WELL_REACHED: f64 = 0.02;

/// Where each SPAD has a photon of the echo, counts may not tell its place. If the bound is more than this many bins,
/// the error no longer follows the bound (measured at 10² to 10⁴ photons).
pub(super) const MOST_BOUND_BINS: f64 = 0.25;

/// Standard deviation with which a deep echo is sought, bins: chosen.
const DEEP_BINS: f64 = 2.5;

/// A bound, bins, up to which no deep echo is sought: photons of such an echo are many, and a wrong width explains no counts.
const WELL_KNOWN: f64 = 0.05;

/// Range walk stays in a depth, and why.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum WalkLeft {
    /// On the line that a delay line's SPADs share photons cancel.
    DelayLine,
    /// A counter TDC adds up SPADs, where the correction takes one event of a CLK period.
    CounterTdc,
    /// The front end joins SPADs on one line.
    JoinedSpads,
    /// SPADs have not recovered from one echo before the window opens again.
    ShortLaserCycle,
    /// The laser pulse is measured, and no Gaussian.
    PulseShape,
    /// The counts are not those of one echo of the laser pulse.
    NotOneEcho,
    /// The echo's centre lies outside the window, and what is within does not tell its width.
    CutEcho,
    /// Bins are full, or light is so strong that its counts tell only the bin that it came in.
    ToABin,
    /// Two different lights, more than a bin apart, give such counts; under a THRESHOLD, nearer ones too. Or what is seen may be the end of an echo that
    /// came before the window.
    Ambiguous,
    /// No most likely light was found.
    NotConverged,
}

impl WalkLeft {
    /// Every reason.
    pub const ALL: [WalkLeft; 10] = [
        WalkLeft::DelayLine,
        WalkLeft::CounterTdc,
        WalkLeft::JoinedSpads,
        WalkLeft::ShortLaserCycle,
        WalkLeft::PulseShape,
        WalkLeft::NotOneEcho,
        WalkLeft::CutEcho,
        WalkLeft::ToABin,
        WalkLeft::Ambiguous,
        WalkLeft::NotConverged,
    ];

    /// The reason as a number in arrays: its place in [`WalkLeft::ALL`] from 1 on, and 0 where no walk is left.
    pub fn number(walk_left: Option<Self>) -> u8 {
        walk_left.map_or(0, |why| 1 + why as u8)
    }

    /// In tables.
    pub const fn name(self) -> &'static str {
        match self {
            WalkLeft::DelayLine => "photons cancel on a delay line's line",
            WalkLeft::CounterTdc => "a counter TDC adds up SPADs",
            WalkLeft::JoinedSpads => "the front end joins SPADs",
            WalkLeft::ShortLaserCycle => "SPADs do not recover within a laser cycle",
            WalkLeft::PulseShape => "the laser pulse is no Gaussian",
            WalkLeft::NotOneEcho => "counts are not those of one echo",
            WalkLeft::CutEcho => "the window cuts the echo off",
            WalkLeft::ToABin => "saturated, and known to a bin",
            WalkLeft::Ambiguous => "two lights give such counts",
            WalkLeft::NotConverged => "no light was found",
        }
    }
}

/// Takes the range walk out of peaks.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkCorrection {
    /// What the macropixels make of light.
    pub response: Response,
    /// Laser cycles of the exposure.
    pub laser_cycles: u32,
}

/// A peak after correction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorrectedPeak {
    /// The most likely light; its position is without walk.
    pub light: EchoLight,
    /// Cramér-Rao bound of the position, bins: the least standard deviation of any unbiased estimate from counts of this light. It is longer where
    /// other lights explain the counts about as well. Of strong light and short pulses, the standard deviation of all places that explain them.
    pub bound_bins: f64,
}

impl WalkCorrection {
    /// The light that made the peak.
    ///
    /// # Errors
    /// Why that is not known.
    pub(crate) fn correct(&self, counts: &[f64], peak: &Peak) -> Result<CorrectedPeak, WalkLeft> {
        let cycles = self.cycles(counts);
        let [background, most_background] = self.background(counts, cycles);
        let likelihood = |free: Free| Likelihood {
            response: &self.response,
            counts,
            cycles,
            bins: 0..counts.len(),
            free,
            most_background,
        };
        let linear = self.linear_start(counts, cycles, (peak, background));
        let (of_all, wide) = (likelihood(ECHO), likelihood(WIDE_ECHO));
        let mut fits = match &linear {
            Some(start) => vec![of_all.maximise(start)],
            None => self.of_many(&of_all, (peak, background))?,
        };
        let best = fits[0];
        // The glow after an echo that came before the window may look like a weaker one.
        let begins_unseen = best.light.position_bins < 2.0 * best.light.sigma_bins;
        // So may the few bins in which enough SPADs fire, before all are blind.
        let counting = self.response.counting;
        let is_edge = counting.threshold > 0 && best.light.signal > counting.spads as f64;
        let begins_unseen = begins_unseen || is_edge;
        if linear.is_some() && begins_unseen {
            fits = self.of_many(&of_all, (peak, background))?;
        }
        fits[0] = self.darker(&of_all, fits[0]);
        if fits[0].explains() {
            return self.corrected_peak(&wide, &fits);
        }
        // Few photons are an echo in one place only.
        let is_weak = fits[0].has_converged && counts.iter().all(|&n| n < 0.9 * cycles);
        if linear.is_some() && !is_weak && !begins_unseen {
            fits = self.of_many(&of_all, (peak, background))?;
            fits[0] = self.darker(&of_all, fits[0]);
            if fits[0].explains() {
                return self.corrected_peak(&wide, &fits);
            }
        }
        let best = fits[0];
        let of_wide = wide.maximise(&best.light);
        if of_wide.explains() && of_wide.light.sigma_bins < self.widest() {
            let told = if self.is_short(&of_wide) {
                averaged(&wide, &[of_wide], &of_wide)
            } else {
                of_wide
            };
            return Ok(told.into());
        }
        if !best.is_close() {
            return Err(WalkLeft::NotOneEcho);
        }
        // Fits need not converge on the flat stretch that is a short pulse's place.
        if self.is_short(&best) {
            return self.corrected_peak(&wide, &fits);
        }
        Err(WalkLeft::NotConverged)
    }

    /// Whether counts may not tell the place of a pulse within a bin.
    fn has_short_pulses(&self) -> bool {
        self.response.pulse_sigma_bins < SHORT && self.response.counting.threshold == 0
    }

    /// The same of this echo, which may be wider.
    fn is_short(&self, fit: &Fit) -> bool {
        self.has_short_pulses() && fit.light.sigma_bins < SHORT
    }

    /// Whether light is so strong that SPADs fire within a short part of its edge.
    fn is_sharp(&self, fit: &Fit) -> bool {
        let counting = self.response.counting;
        counting.threshold == 0 && fit.light.signal > SHARP * counting.spads as f64
    }

    /// What is told of the lights that explain the counts, the most likely first.
    ///
    /// # Errors
    /// As `widened`; lights that explain the counts from places more than a bin apart, or from before the window.
    fn corrected_peak(
        &self,
        wide: &Likelihood<'_>,
        fits: &[Fit],
    ) -> Result<CorrectedPeak, WalkLeft> {
        let widened = self.widened(wide, fits[0])?;
        if self.is_short(&fits[0]) {
            return Ok(averaged(wide, fits, &widened).into());
        }
        let is_one = !has_another(fits);
        if is_one && !self.is_sharp(&fits[0]) {
            return Ok(widened.into());
        }
        // The most likely place is less off on average than the mean of all, and its curvature says too little.
        let mean = averaged(wide, fits, &widened);
        let off = mean.light.position_bins - widened.light.position_bins;
        let bound_bins = libm::hypot(mean.bound_bins, off).max(widened.bound_bins);
        // What follows an echo before the window may be a weak one within it.
        let is_before = widened.light.position_bins < -0.5;
        let most_bins = if is_before { MOST_BOUND_BINS } else { 1.0 };
        if bound_bins > most_bins && (is_before || !is_one) {
            return Err(WalkLeft::Ambiguous);
        }
        Ok(Fit {
            bound_bins,
            ..widened
        }
        .into())
    }

    /// The same echo with its own width, where its counts ask for one. Of a deep surface with few counts a bin, the pulse alone finds the
    /// fullest place; so the bound reaches to other lights that explain the counts as well.
    ///
    /// # Errors
    /// An echo wider than the window can show.
    fn widened(&self, wide: &Likelihood<'_>, best: Fit) -> Result<Fit, WalkLeft> {
        if self.response.counting.threshold > 0 {
            return Ok(best);
        }
        let mut starts = vec![best.light];
        if best.bound_bins > WELL_KNOWN {
            starts.extend(self.deep_start(wide, &best.light));
        }
        let mut fits = wide.maximise_each(&starts);
        fits.sort_by(|a, b| a.deviance.total_cmp(&b.deviance));
        // A width that hardly explains more would only pull the place after it.
        let is_worth_it = |fit: &&Fit| fit.deviance + OF_A_WIDTH < best.deviance;
        let widest = self.widest();
        if fits
            .iter()
            .find(is_worth_it)
            .is_some_and(|fit| fit.light.sigma_bins >= widest)
        {
            return Err(WalkLeft::NotOneEcho);
        }
        let is_better = |fit: &&Fit| is_worth_it(fit) && fit.has_converged;
        let first = fits.iter().find(is_better).copied().unwrap_or(best);
        // Other lights are as many standard deviations away as the root of what their deviance is more.
        let place = |fit: &Fit| {
            let off = (fit.light.position_bins - first.light.position_bins).abs();
            off / (fit.deviance - first.deviance).abs().max(1.0).sqrt()
        };
        let others = fits.iter().chain([&best]);
        let bound_bins = others.map(place).fold(first.bound_bins, f64::max);
        Ok(Fit {
            bound_bins,
            ..first
        })
    }

    /// The most likely of some deep echoes, `None` where no bin has light beyond the background. The fit `narrow` of a narrow echo takes what
    /// is left of a deep one for background, if that is free.
    fn deep_start(&self, likelihood: &Likelihood<'_>, narrow: &EchoLight) -> Option<EchoLight> {
        let (counts, cycles) = (likelihood.counts, likelihood.cycles);
        let [_, _, background_is_free, _] = likelihood.free;
        let background_per_bin = if background_is_free {
            self.background(counts, cycles)[0]
        } else {
            narrow.background_per_bin
        };
        let bins = likelihood.bins.clone();
        let all = self.echo_in(bins.clone(), counts, cycles, background_per_bin)?;
        let lights = bins.step_by(2).map(|bin| EchoLight {
            position_bins: bin as f64,
            sigma_bins: self.response.pulse_sigma_bins.max(DEEP_BINS),
            ..all
        });
        let lights: Vec<EchoLight> = lights.collect();
        let judged = likelihood
            .deviances(&lights, Steps::Coarse)
            .into_iter()
            .zip(lights);
        let best = judged.min_by(|a, b| a.0.total_cmp(&b.0));
        best.map(|(_, light)| light)
    }

    /// The light of one echo of several, from its own `bins`. Elsewhere there is light of `background_per_bin`.
    ///
    /// # Errors
    /// Counts that are not those of an echo of this pulse.
    pub(crate) fn correct_in(
        &self,
        counts: &[f64],
        bins: Range<usize>,
        peak: &Peak,
        background_per_bin: f64,
    ) -> Result<CorrectedPeak, WalkLeft> {
        if self.response.counting.event_type != EventType::Greater {
            return Err(WalkLeft::NotOneEcho);
        }
        let cycles = self.cycles(counts);
        let background_per_bin = background_per_bin.max(1e-3 / cycles);
        let start = self.echo_in(bins.clone(), counts, cycles, background_per_bin);
        let start = start.ok_or(WalkLeft::NotOneEcho)?;
        let likelihood = |free| Likelihood {
            response: &self.response,
            counts,
            cycles,
            bins: bins.clone(),
            free,
            most_background: background_per_bin,
        };
        let narrow = likelihood(IN_REGION).maximise(&start);
        let fit = self.widened(&likelihood(WIDE_IN_REGION), narrow)?;
        let off = (fit.light.position_bins - peak.peak_bin as f64).abs();
        if fit.explains() && off < 2.0 + fit.light.sigma_bins {
            Ok(fit.into())
        } else {
            Err(WalkLeft::NotOneEcho)
        }
    }

    /// Laser cycles, and no fewer than a bin has counts.
    fn cycles(&self, counts: &[f64]) -> f64 {
        let most = counts.iter().copied();
        most.fold(f64::from(self.laser_cycles), f64::max)
    }

    /// The echo of the light that each of some bins had beyond the background, if it was alone; `None` where that is none.
    fn echo_in(
        &self,
        bins: Range<usize>,
        counts: &[f64],
        cycles: f64,
        background_per_bin: f64,
    ) -> Option<EchoLight> {
        let reached = self.response.reached(counts, cycles);
        let (signal, moment) = bins.fold((0.0, 0.0), |(signal, moment), bin| {
            let light = self.response.steady_light(counts[bin] / reached[bin]);
            let of_bin = (light - background_per_bin).max(0.0);
            (signal + of_bin, moment + of_bin * bin as f64)
        });
        (signal > 0.0).then(|| EchoLight {
            position_bins: moment / signal,
            signal,
            background_per_bin,
            sigma_bins: self.response.pulse_sigma_bins,
        })
    }

    /// The background of bins with this mean count, photons a bin.
    pub(crate) fn background_of(&self, counts_per_bin: f64) -> f64 {
        self.response
            .steady_light((counts_per_bin / f64::from(self.laser_cycles)).max(0.0))
    }

    /// A start from the light that each bin of the peak had, if it was alone; `None` where bins do not tell.
    fn linear_start(
        &self,
        counts: &[f64],
        cycles: f64,
        (peak, background_per_bin): (&Peak, f64),
    ) -> Option<EchoLight> {
        let counting = self.response.counting;
        if counting.event_type != EventType::Greater {
            return None;
        }
        let half = (2.0 * self.response.pulse_sigma_bins).ceil().max(1.0) as usize;
        if counts.iter().any(|&counts| counts > 0.98 * cycles) {
            return None;
        }
        let end = (peak.peak_bin + half + 1).min(counts.len());
        let bins = peak.peak_bin.saturating_sub(half)..end;
        self.echo_in(bins, counts, cycles, background_per_bin)
    }

    /// The best of a fit and of those with less background. Under a THRESHOLD bins without an echo say next to nothing of the background, and
    /// fits stay where it is too much.
    fn darker(&self, likelihood: &Likelihood<'_>, best: Fit) -> Fit {
        if self.response.counting.threshold == 0 {
            return best;
        }
        let held = Likelihood {
            free: IN_REGION,
            ..likelihood.clone()
        };
        let starts = DARKER.map(|share| EchoLight {
            background_per_bin: share * likelihood.most_background,
            ..best.light
        });
        let near = held.near_each(&starts, Steps::Coarse);
        let lights: Vec<EchoLight> = near.iter().map(|fit| fit.light).collect();
        let mut fits = vec![best];
        fits.extend(likelihood.maximise_each(&lights));
        fits.sort_by(|a, b| a.deviance.total_cmp(&b.deviance));
        with_rivals(fits[0], &fits, likelihood)
    }

    /// The widest echo, whose ends are to be seen either side of it.
    fn widest(&self) -> f64 {
        let of_bins = self.response.bins as f64 / 4.0;
        of_bins.max(1.5 * self.response.pulse_sigma_bins)
    }

    /// The background to begin with, and the most that it may be: from the third of the bins with the fewest counts, because the
    /// median is too much where an echo is wide. Where SPADs are blind they say too little, which the fit finds out.
    fn background(&self, counts: &[f64], cycles: f64) -> [f64; 2] {
        if self.response.counting.event_type != EventType::Greater {
            return [0.03, 1.0];
        }
        let reached = self.response.reached(counts, cycles);
        let is_reached = |(_, reached): &(&f64, &f64)| **reached > WELL_REACHED * cycles;
        let known = counts.iter().zip(&reached).filter(is_reached);
        let mut sorted: Vec<f64> = known.map(|(n, reached)| n * (cycles / reached)).collect();
        sorted.sort_by(f64::total_cmp);
        let few = sorted[sorted.len() / 3];
        // Where nothing counts, the background is some tenth of what would show.
        let begin = if few >= 1.0 {
            self.response.steady_light(few / cycles)
        } else {
            0.1 * self.response.steady_light(0.3 / cycles)
        };
        // No count in a bin allows three.
        [begin, self.response.steady_light((few + 3.0) / cycles)]
    }
}

impl From<Fit> for CorrectedPeak {
    fn from(fit: Fit) -> Self {
        CorrectedPeak {
            light: fit.light,
            bound_bins: fit.bound_bins,
        }
    }
}

#[cfg(test)]
mod tests;
