//! Depths from the histograms of any sensor: how long its bins are, and which events they count.
//!
//! ```text
//!   an event      a photon, or the photon with which k SPADs fire together
//!   every event   a bin counts each event that comes in it                 counts are Poisson numbers
//!   first event   a laser cycle counts its first event, in one bin         later bins see what is left (pile-up)
//! ```
//!
//! The echo finder is that of our own chip, whose bins count at most once a laser cycle. A histogram is taken for one of a hundred times
//! as many laser cycles with as much less light, so that the bins are hardly tied together. What ties events together is in the mean
//! histogram ([`expected`](super::expected)), and so is light that is known, as that of a cover glass. The search for echoes knows from the
//! counts before a bin in what share of laser cycles it was still to count (Coates 1968, doi 10.1088/0022-3735/1/8/437).
//!
//! No timing of gates is asked for.

mod crosstalk;
mod description;
mod echo_width;
mod mean;

use std::ops::Range;

use super::arrival::{ArrivalOptions, arrival};
use super::expected::{FiringTogether, OtherBins, Response};
use super::finder::{DepthOptions, EchoFinder};
use super::peak::median;
use super::walk::WalkLeft;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

pub use crosstalk::UnknownCrosstalk;
pub use description::{BadDetector, DescribedCoincidence, DetectorDescription};
pub use mean::{Agreement, SurfaceLight};

/// Parts that a laser cycle is cut into; and laser cycles for each count of the fullest bin, where these are not known.
const PARTS: u32 = 100;

/// Lengths of bins that differ by less than this are equal.
const EQUAL: f64 = 1e-6;

/// Which events of a laser cycle count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CountedEvents {
    /// All of them.
    Every,
    /// The first one.
    First,
}

/// SPADs that fire together make an event. The output of a SPAD is high for a time after a photon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coincidence {
    /// How many outputs must be high, 1 or more.
    pub spads: u32,
    /// How long an output is high after the last photon of its SPAD, s.
    pub within_s: f64,
    /// SPADs on which the light comes evenly.
    pub lit_spads: u32,
}

/// What counts photons, and the laser pulses that it sees.
#[derive(Debug, Clone, PartialEq)]
pub struct Detector {
    /// Where bins begin, and the last one ends, after the centre of the laser pulse has left, s: one more than bins, rising.
    pub edges_s: Vec<f64>,
    /// Standard deviation of the laser pulse with all jitter, s.
    pub pulse_sigma_s: f64,
    /// Which events count.
    pub counted: CountedEvents,
    /// Laser cycles of a histogram. It may be unknown where every photon counts.
    pub laser_cycles: Option<u32>,
    /// What an event is, if it is not a photon.
    pub coincidence: Option<Coincidence>,
    /// Counts at which a bin stops.
    pub most_counts: Option<u32>,
    /// Photons, not events, that come to each bin in all laser cycles without a target, as from a cover glass; empty without any.
    pub crosstalk: Vec<f64>,
}

/// An echo in a histogram.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct DetectedReturn {
    /// Distance, m.
    pub depth_m: f64,
    /// Standard deviation of the distance, m; `None` where counts are not those of echoes of this pulse.
    pub bound_m: Option<f64>,
    /// Why there is no bound, or one of a bin.
    pub no_bound: Option<WalkLeft>,
    /// Standard deviation of the depths that the zone sees there, m.
    pub spread_m: Option<f64>,
    /// Photons of the echo in all laser cycles.
    pub photons: f64,
    /// −log₁₀ of the chance that light without this echo makes such counts.
    pub confidence: f64,
}

/// Why a histogram has no echo.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NoReturn {
    /// No stretch of bins stands out.
    #[error("no significant peak")]
    NoSignificantPeak,
    /// Light is so strong that its counts do not tell its place.
    #[error("saturated")]
    Saturated,
    /// The echo would come from behind the sensor.
    #[error("behind the sensor")]
    BehindSensor,
}

/// Counts that a detector cannot have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TooManyCounts {
    /// More than laser cycles.
    #[error(
        "has {counts} counts in {laser_cycles} laser cycles, each of which counts its first event only"
    )]
    InAll {
        /// Counts of all bins.
        counts: u64,
        /// Laser cycles of the histogram.
        laser_cycles: u32,
    },
    /// More than a bin may have.
    #[error("has {counts} counts in bin {bin}, where a bin stops at {most}")]
    InABin {
        /// The bin.
        bin: usize,
        /// Its counts.
        counts: u32,
        /// The most.
        most: u32,
    },
}

impl NoReturn {
    /// All of them.
    pub const ALL: [NoReturn; 3] = [
        NoReturn::NoSignificantPeak,
        NoReturn::Saturated,
        NoReturn::BehindSensor,
    ];
}

impl Detector {
    /// Edges of equal bins of `bin_s` seconds, the first of which begins at `begins_s`, s.
    pub fn equal_edges_s(bins: usize, begins_s: f64, bin_s: f64) -> Vec<f64> {
        let edge_s = |edge| begins_s + edge as f64 * bin_s;
        (0..=bins).map(edge_s).collect()
    }

    /// Bins of a histogram.
    pub fn bins(&self) -> usize {
        self.edges_s.len() - 1
    }

    /// Length of a bin, s: the mean of all.
    pub fn bin_s(&self) -> f64 {
        (self.edges_s[self.bins()] - self.edges_s[0]) / self.bins() as f64
    }

    /// The same with all bins so much later, s.
    pub fn later(&self, by_s: f64) -> Self {
        let mut later = self.clone();
        later.edges_s.iter_mut().for_each(|edge_s| *edge_s += by_s);
        later
    }

    /// The same with these bins alone.
    pub fn with_bins(&self, kept: Range<usize>) -> Self {
        let mut some = self.clone();
        some.edges_s = self.edges_s[kept.start..=kept.end].to_vec();
        if !self.crosstalk.is_empty() {
            some.crosstalk = self.crosstalk[kept].to_vec();
        }
        some
    }

    /// Checks that a histogram may be this detector's.
    ///
    /// # Errors
    /// More counts than the detector can have.
    pub fn check(&self, counts: &[u32]) -> Result<(), TooManyCounts> {
        let all: u64 = counts.iter().map(|&n| u64::from(n)).sum();
        if self.counted == CountedEvents::First
            && let Some(laser_cycles) = self.laser_cycles
            && all > u64::from(laser_cycles)
        {
            return Err(TooManyCounts::InAll {
                counts: all,
                laser_cycles,
            });
        }
        let most = self.most_counts.unwrap_or(u32::MAX);
        match counts.iter().position(|&count| count > most) {
            Some(bin) => Err(TooManyCounts::InABin {
                bin,
                counts: counts[bin],
                most,
            }),
            None => Ok(()),
        }
    }

    /// The echoes in `counts`, one for each bin, the clearest first.
    ///
    /// # Errors
    /// Why there is none.
    pub fn returns(
        &self,
        counts: &[u32],
        options: &DepthOptions,
    ) -> Result<Vec<DetectedReturn>, NoReturn> {
        debug_assert_eq!(counts.len(), self.bins());
        let all_parts = self.parts_of_cycles(counts);
        let bin_s = self.bin_s();
        let law = self.law(all_parts);
        let response = self.response(&law);
        let dark = (self.counted == CountedEvents::First || self.has_unlike_bins())
            .then(|| dark_counts(&law, &response, counts, all_parts));
        let finder =
            EchoFinder::of_response(response, bin_s, (all_parts, self.most_counts), options);
        let sighting = match dark {
            Some(dark) => finder.find_over(counts, &dark),
            None => finder.find(counts),
        };
        let sighting = sighting.ok_or(NoReturn::NoSignificantPeak)?;
        if !sighting.is_significant {
            return Err(NoReturn::NoSignificantPeak);
        }
        if sighting.is_saturated {
            return Err(NoReturn::Saturated);
        }
        let to_m = 0.5 * SPEED_OF_LIGHT_M_PER_S;
        let place_m = |position_bins: f64| {
            let (bins, _) = law.time(position_bins);
            to_m * (self.edges_s[0] + (bins + 0.5) * bin_s)
        };
        // A bound is in bins of the place.
        let bound_m = |position_bins: f64, bound_bins: Option<f64>| {
            let (_, length_bins) = law.time(position_bins);
            bound_bins.map(|bins| bins * length_bins * bin_s * to_m)
        };
        let spread_m = |bins: f64| bins * bin_s * to_m;
        let first_bound_m = bound_m(sighting.position_bins, sighting.bound_bins);
        let depth_m = place_m(sighting.position_bins);
        if depth_m < -first_bound_m.map_or(bin_s * to_m, |bound_m| 5.0 * bound_m) {
            return Err(NoReturn::BehindSensor);
        }
        let spread_bins = sighting.light.and_then(|light| finder.spread_bins(&light));
        let first = DetectedReturn {
            depth_m,
            bound_m: first_bound_m,
            no_bound: sighting.walk_left,
            spread_m: first_bound_m.and(spread_bins).map(spread_m),
            photons: match sighting.light {
                Some(light) => light.signal * f64::from(all_parts),
                None => sighting.peak.signal_counts,
            },
            confidence: sighting.confidence,
        };
        let others = sighting.others.into_iter().flatten();
        let others = others.map(|other| DetectedReturn {
            depth_m: place_m(other.position_bins),
            bound_m: bound_m(other.position_bins, other.bound_bins),
            no_bound: None,
            spread_m: other.spread_bins.map(spread_m),
            photons: other.photons * f64::from(all_parts),
            confidence: other.confidence,
        });
        Ok(std::iter::once(first).chain(others).collect())
    }

    /// When bin 0 begins after the laser pulse has left, s, if `reference` has counts of the pulse itself in such bins; `None` without a
    /// pulse.
    pub fn begins_after_reference_s(&self, reference: &[u32]) -> Option<f64> {
        let pulse = arrival(reference, &ArrivalOptions::default())?;
        Some(-(pulse.position_bins + 0.5) * self.bin_s())
    }

    /// Parts of laser cycles in which our bins would count like this detector's.
    fn parts_of_cycles(&self, counts: &[u32]) -> u32 {
        let fullest = counts.iter().copied().max().unwrap_or(0);
        let cycles = self.laser_cycles.unwrap_or(fullest).max(1);
        // A bin of a laser cycle may count several photons.
        cycles.max(fullest).saturating_mul(PARTS)
    }

    fn has_unlike_bins(&self) -> bool {
        let bin_s = self.bin_s();
        let is_unlike = |ends: &[f64]| ((ends[1] - ends[0]) / bin_s - 1.0).abs() > EQUAL;
        !self.crosstalk.is_empty() || self.edges_s.windows(2).any(is_unlike)
    }

    /// How bins count, in `all_parts` parts of all laser cycles.
    fn law(&self, all_parts: u32) -> OtherBins {
        let bin_s = self.bin_s();
        let cycles = match self.laser_cycles {
            Some(cycles) => f64::from(cycles),
            None => f64::from(all_parts),
        };
        let edge_bins = |edge_s: &f64| (edge_s - self.edges_s[0]) / bin_s - 0.5;
        OtherBins {
            edges: if self.has_unlike_bins() {
                self.edges_s.iter().map(edge_bins).collect()
            } else {
                OtherBins::equal_edges(self.bins())
            },
            known: self.crosstalk.iter().map(|all| all / cycles).collect(),
            together: self.coincidence.map(|coincidence| {
                FiringTogether::new(
                    coincidence.spads,
                    coincidence.within_s / bin_s,
                    coincidence.lit_spads,
                    self.counted == CountedEvents::First,
                )
            }),
            first_only: self.counted == CountedEvents::First,
            parts: f64::from(all_parts) / cycles,
        }
    }

    fn response(&self, law: &OtherBins) -> Response {
        Response::of_other_bins(self.pulse_sigma_s / self.bin_s(), law.clone())
    }
}

/// Counts that bins would have without an echo, with the background of most bins. Laser cycles whose first event came before a bin
/// do not count there.
fn dark_counts(law: &OtherBins, response: &Response, counts: &[u32], all_parts: u32) -> Vec<f64> {
    let real: Vec<f64> = counts.iter().map(|&count| f64::from(count)).collect();
    let open = response.reached(&real, f64::from(all_parts));
    let open: Vec<f64> = open.iter().map(|parts| parts / law.parts).collect();
    let chances = |(bin, &count): (usize, &u32)| {
        let length = law.edges[bin + 1] - law.edges[bin];
        let known = law.known.get(bin).map_or(0.0, |known| known / law.parts) / length;
        let chance = f64::from(count) / (open[bin] * law.parts) / length;
        (chance, known)
    };
    let chances = counts.iter().enumerate().map(chances);
    let level = if law.together.is_some() {
        // Known light and background make coincidences together, so that bins with known light do not tell the background.
        let of_a_count = law.steady_light(f64::from(all_parts).recip());
        let dark = chances.filter(|(_, known)| *known < of_a_count);
        law.steady_light(middle_mean(dark.map(|(chance, _)| chance).collect()))
    } else {
        let levels = chances.map(|(chance, known)| (law.steady_light(chance) - known).max(0.0));
        median(levels.collect::<Vec<f64>>().iter())
    };
    // Half a count in all bins at least, so that none is impossible.
    let least = law.steady_light(0.5 / (counts.len() as f64 * f64::from(all_parts)));
    let dark = law.dark_events(response, level.max(least));
    let counted = |(open, events): (&f64, f64)| {
        if law.first_only {
            open * -libm::expm1(-events)
        } else {
            open * events
        }
    };
    open.iter().zip(dark).map(counted).collect()
}

/// The mean of the middle half, 0 of none: a median of small counts is one of few numbers.
fn middle_mean(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let quarter = values.len() / 4;
    let middle = &values[quarter..values.len() - quarter];
    middle.iter().sum::<f64>() / middle.len().max(1) as f64
}

#[cfg(test)]
mod tests;
