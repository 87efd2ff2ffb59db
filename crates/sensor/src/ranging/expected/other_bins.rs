//! Mean histograms of sensors other than ours: bins of any lengths, which count photons or SPADs that fire together.
//!
//! ```text
//!   every event   mean of bin i = Hᵢ                                 a count is a Poisson number
//!   first event   mean of bin i = e^(−H₀ − … − Hᵢ₋₁)·(1 − e^(−Hᵢ))   a laser cycle counts at most once, in any of the bins
//!   Hᵢ            events of bin i: its photons, or ∫ λ·(chance that a photon at t is the one that completes k SPADs) dt
//! ```
//!
//! An event of k SPADs within τ comes with the photon whose SPAD is the k-th that had a photon in the last τ. The other SPADs had photons
//! independently, so that the number of those is binomial. This is exact where every event counts and a SPAD may fire again at any time.
//! Where only the first event counts, no event before says that there were fewer than k; that is all that is taken from it.
//!
//! Light may be given of a part of a laser cycle. With few counts in each part, binomial counts of bins that are taken for independent have
//! the variances of Poisson numbers. Those of first events have no more, so that bounds are rather too long there.
//!
//! Bins of unequal lengths are equal ones on a bent axis: position i + ½ is the edge behind bin i, and time is linear in between. Times are
//! in mean lengths of a bin.

use super::{EchoLight, OfBins, PARAMETERS, Response};
use crate::numerics::Dual;

/// Steps to the time in which SPADs must fire together, and the most of them to a bin: chosen. Twice as many move no mean by 1 % of it.
const STEPS_OF_WINDOW: f64 = 8.0;
const MOST_STEPS: f64 = 64.0;

/// SPADs that fire together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::ranging) struct FiringTogether {
    /// How many, 1 or more.
    pub(in crate::ranging) least: u32,
    /// Within this time, mean bins.
    pub(in crate::ranging) within_bins: f64,
    /// SPADs in all, on which light comes evenly.
    pub(in crate::ranging) of_spads: u32,
    /// Light, photons in a mean bin and laser cycle, of which most events come: in more light more outputs are high than may be. Of two
    /// lights with as many events the weaker one is told.
    most_light: f64,
}

/// How the bins of another sensor count.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::ranging) struct OtherBins {
    /// Where bins begin, and the last one ends, mean bins: from −½ to their number less ½.
    pub(in crate::ranging) edges: Vec<f64>,
    /// Photons of light that is known, in each bin and laser cycle; empty without.
    pub(in crate::ranging) known: Vec<f64>,
    /// What an event is, if it is not a photon.
    pub(in crate::ranging) together: Option<FiringTogether>,
    /// Whether a laser cycle counts its first event only.
    pub(in crate::ranging) first_only: bool,
    /// Parts that a laser cycle is cut into. Light is of a part, and so are chances.
    pub(in crate::ranging) parts: f64,
}

impl OtherBins {
    /// Edges of equal bins.
    pub(in crate::ranging) fn equal_edges(bins: usize) -> Vec<f64> {
        (0..=bins).map(|edge| edge as f64 - 0.5).collect()
    }

    /// The time of a position, and how long the bin about it is, mean bins.
    pub(in crate::ranging) fn time(&self, position_bins: f64) -> (f64, f64) {
        let last = self.edges.len() - 2;
        let bin = ((position_bins + 0.5).max(0.0) as usize).min(last);
        let length = self.edges[bin + 1] - self.edges[bin];
        let within = position_bins + 0.5 - bin as f64;
        (self.edges[bin] + within * length, length)
    }

    /// The position of a time, mean bins.
    pub(in crate::ranging) fn position(&self, time_bins: f64) -> f64 {
        let last = self.edges.len() - 2;
        let begun = self.edges.partition_point(|&edge| edge <= time_bins);
        let bin = begun.saturating_sub(1).min(last);
        let length = self.edges[bin + 1] - self.edges[bin];
        bin as f64 - 0.5 + (time_bins - self.edges[bin]) / length
    }

    /// The light, photons in a mean bin and part of a laser cycle, of which a mean bin counts with `chance`, if no event came before.
    pub(in crate::ranging) fn steady_light(&self, chance: f64) -> f64 {
        let events = if self.first_only {
            -libm::log1p(-(chance * self.parts).min(0.999))
        } else {
            chance * self.parts
        };
        let Some(together) = self.together else {
            return events / self.parts;
        };
        let is_less = |photons: f64| together.rate(photons, self.first_only).value < events;
        greatest(together.most_light, is_less) / self.parts
    }

    /// The chance of every bin, with its slopes with the first K parameters.
    pub(super) fn chances<const K: usize>(
        &self,
        response: &Response,
        light: &EchoLight,
    ) -> OfBins<K> {
        let mut events_before = Dual::ZERO;
        let parts = self.parts.recip();
        let bin = |events: Dual<K>| {
            if !self.first_only {
                return events * parts;
            }
            let (hit, _) = events.hits();
            let is_first = (events_before * -1.0).exp();
            events_before += events;
            is_first * hit * parts
        };
        self.events(response, light).into_iter().map(bin).collect()
    }

    /// Events of each bin in a laser cycle of background and known light alone, in which none came before.
    pub(in crate::ranging) fn dark_events(
        &self,
        response: &Response,
        background_per_bin: f64,
    ) -> Vec<f64> {
        let dark = EchoLight {
            position_bins: 0.0,
            signal: 0.0,
            background_per_bin,
            sigma_bins: response.pulse_sigma_bins,
        };
        let events = self.events::<0>(response, &dark);
        events.into_iter().map(|events| events.value).collect()
    }

    /// Events of each bin in a laser cycle in which none came before.
    fn events<const K: usize>(&self, response: &Response, light: &EchoLight) -> Vec<Dual<K>> {
        let (place, length) = self.time(light.position_bins);
        let pulse = response.pulse(&EchoLight {
            position_bins: place,
            ..*light
        });
        let known_sums = self.known_sums();
        // Photons until some times, which rise.
        let until = |times: &[f64]| -> Vec<Dual<K>> {
            let [signal, by_place, by_width] = pulse.until_each(times);
            let photons = |(at, &time): (usize, &f64)| {
                let background = light.background_per_bin * (time + 0.5);
                let slopes: [f64; PARAMETERS] =
                    [by_place[at] * length, signal[at], background, by_width[at]];
                let photons = Dual {
                    value: signal[at] + background,
                    slope: std::array::from_fn(|parameter| slopes[parameter]),
                };
                photons * self.parts + Dual::constant(self.known_until(&known_sums, time))
            };
            times.iter().enumerate().map(photons).collect()
        };
        let Some(together) = self.together else {
            let until = until(&self.edges);
            return until.windows(2).map(|ends| ends[1] - ends[0]).collect();
        };
        let mut steps = vec![self.edges[0]];
        let mut first_steps = vec![0];
        for ends in self.edges.windows(2) {
            let length = ends[1] - ends[0];
            let wanted = STEPS_OF_WINDOW * length / together.within_bins;
            let count = wanted.ceil().clamp(2.0, MOST_STEPS) as usize;
            let step = |n: usize| ends[0] + length * n as f64 / count as f64;
            steps.extend((1..count).map(step));
            steps.push(ends[1]);
            first_steps.push(steps.len() - 1);
        }
        let middles: Vec<f64> = steps
            .windows(2)
            .map(|ends| 0.5 * (ends[0] + ends[1]))
            .collect();
        let begins: Vec<f64> = middles
            .iter()
            .map(|time| time - together.within_bins)
            .collect();
        let [until_step, until_middle, until_begin] = [&steps, &middles, &begins].map(|t| until(t));
        let of_step = |step: usize| {
            let photons = until_step[step + 1] - until_step[step];
            let window = until_middle[step] - until_begin[step];
            photons * together.completes(window, self.first_only)
        };
        let of_bin = |ends: &[usize]| {
            let mut events = Dual::ZERO;
            (ends[0]..ends[1]).for_each(|step| events += of_step(step));
            events
        };
        first_steps.windows(2).map(of_bin).collect()
    }

    /// Known photons of a laser cycle until each edge; empty without any.
    fn known_sums(&self) -> Vec<f64> {
        let mut sum = 0.0;
        let until_end = self.known.iter().map(|photons| {
            sum += photons;
            sum
        });
        let until_end: Vec<f64> = until_end.collect();
        if until_end.is_empty() {
            return until_end;
        }
        std::iter::once(0.0).chain(until_end).collect()
    }

    /// Known photons of a laser cycle until a time, where `sums` are those until each edge.
    ///
    /// In a bin they are a cubic that never falls: its slope at an edge is the harmonic mean of the light of both bins (Fritsch and Butland
    /// 1984, doi 10.1137/0905021). Even light in each bin would tell too few coincidences under a pulse.
    fn known_until(&self, sums: &[f64], time: f64) -> f64 {
        let Some((&all, last)) = sums.last().zip(self.known.len().checked_sub(1)) else {
            return 0.0;
        };
        if time <= self.edges[0] {
            return 0.0;
        }
        if time >= self.edges[last + 1] {
            return all;
        }
        let bin = self.edges.partition_point(|&edge| edge <= time) - 1;
        let length = |bin: usize| self.edges[bin + 1] - self.edges[bin];
        let light = |bin: usize| self.known[bin] / length(bin);
        let slope = |edge: usize| {
            if edge == 0 || edge > last {
                return 0.0;
            }
            let (before, behind) = (light(edge - 1), light(edge));
            if before <= 0.0 || behind <= 0.0 {
                return 0.0;
            }
            let (length_before, length_behind) = (length(edge - 1), length(edge));
            let of_before = length_before + 2.0 * length_behind;
            let of_behind = 2.0 * length_before + length_behind;
            (of_before + of_behind) / (of_before / before + of_behind / behind)
        };
        let share = (time - self.edges[bin]) / length(bin);
        let (begins, ends) = (length(bin) * slope(bin), length(bin) * slope(bin + 1));
        let gain = self.known[bin];
        let squared = 3.0 * gain - 2.0 * begins - ends;
        let cubed = begins + ends - 2.0 * gain;
        sums[bin] + share * (begins + share * (squared + share * cubed))
    }
}

/// The greatest number up to `most` that `is_so`, as all smaller ones are.
fn greatest(most: f64, is_so: impl Fn(f64) -> bool) -> f64 {
    let (mut least, mut most) = (0.0, most);
    for _ in 0..50 {
        let middle = 0.5 * (least + most);
        if is_so(middle) {
            least = middle;
        } else {
            most = middle;
        }
    }
    least
}

impl FiringTogether {
    /// `least` of `of_spads` SPADs within a time in mean bins, of which all events count, or the first one of a laser cycle.
    pub(in crate::ranging) fn new(
        least: u32,
        within_bins: f64,
        of_spads: u32,
        first_only: bool,
    ) -> Self {
        let mut together = FiringTogether {
            least,
            within_bins,
            of_spads,
            most_light: 0.0,
        };
        let all_high = 4.0 * f64::from(of_spads) / within_bins;
        let grows = |photons: f64| together.rate(photons, first_only).slope[0] > 0.0;
        together.most_light = greatest(all_high, grows);
        together
    }

    /// Events in a mean bin and laser cycle under even light, `photons` in the same, with their slope.
    fn rate(&self, photons: f64, first_only: bool) -> Dual<1> {
        let photons = Dual::parameter(photons, 0);
        photons * self.completes(photons * self.within_bins, first_only)
    }

    /// The chance that a photon's SPAD is the one that was missing, where `window` photons came within the time before it; if
    /// `none_before`, given that too few had a photon.
    fn completes<const K: usize>(&self, window: Dual<K>, none_before: bool) -> Dual<K> {
        let spads = f64::from(self.of_spads);
        let mean = window.value.max(0.0) / spads;
        let (quiet, fired) = (libm::exp(-mean), -libm::expm1(-mean));
        // `others` of the other SPADs had a photon. The rest and the photon's own had none.
        let (others, still) = (self.least - 1, self.of_spads + 1 - self.least);
        let of_others = Self::exactly(self.of_spads - 1, others, (fired, quiet));
        let chance = of_others * quiet;
        let of_fired = if others > 0 && fired > 0.0 {
            f64::from(others) * quiet / fired
        } else {
            0.0
        };
        let slope = chance * (of_fired - f64::from(still)) / spads;
        let completes = window.chain(chance, slope);
        if !none_before {
            return completes;
        }
        let too_few = (0..self.least).map(|n| Self::exactly(self.of_spads, n, (fired, quiet)));
        // It shrinks as often as one SPAD more fires than may.
        let too_few = window.chain(too_few.sum(), -chance);
        completes * too_few.recip()
    }

    /// The chance that `number` of `spads` SPADs had a photon: each has had one with the chance `fired`, and none with `quiet`.
    fn exactly(spads: u32, number: u32, (fired, quiet): (f64, f64)) -> f64 {
        let ways = (0..number).fold(1.0, |ways, n| {
            ways * f64::from(spads - n) / f64::from(n + 1)
        });
        ways * fired.powi(number as i32) * quiet.powi((spads - number) as i32)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn known(edges: Vec<f64>, known: Vec<f64>) -> OtherBins {
        OtherBins {
            edges,
            known,
            together: None,
            first_only: false,
            parts: 1.0,
        }
    }

    proptest! {
        /// Known photons come in their bins, and none is taken back.
        #[test]
        fn known_photons_only_come(bins in prop::collection::vec((0.3f64..3.0, prop_oneof![Just(0.0), 0.0f64..100.0]), 1..12)) {
            let mut edges = vec![-0.5];
            for (length, _) in &bins {
                edges.push(edges.last().unwrap() + length);
            }
            let law = known(edges, bins.iter().map(|bin| bin.1).collect());
            let sums = law.known_sums();
            for (bin, ends) in law.edges.windows(2).enumerate() {
                let mut before = law.known_until(&sums, ends[0]);
                prop_assert!((before - sums[bin]).abs() < 1e-9);
                for step in 1..=40 {
                    let time = ends[0] + (ends[1] - ends[0]) * f64::from(step) / 40.0;
                    let until = law.known_until(&sums, time);
                    prop_assert!(until > before - 1e-9, "{until} after {before}");
                    before = until;
                }
            }
            let all: f64 = law.known.iter().sum();
            prop_assert!((law.known_until(&sums, 1e9) - all).abs() < 1e-9);
            prop_assert_eq!(law.known_until(&sums, -1.0), 0.0);
        }
    }

    /// A pulse between edges of its bins, as it is and from its bins.
    #[test]
    fn a_pulse_is_nearly_told_by_its_bins() {
        let sigma = 0.8;
        let until =
            |time: f64| 0.5 * libm::erfc(-(time - 6.3) / (sigma * std::f64::consts::SQRT_2));
        let edges = OtherBins::equal_edges(14);
        let photons = edges.windows(2).map(|ends| until(ends[1]) - until(ends[0]));
        let law = known(edges.clone(), photons.collect());
        let sums = law.known_sums();
        let worst = (0..400).map(|step| {
            let time = 0.03 * f64::from(step);
            (law.known_until(&sums, time) - until(time)).abs()
        });
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < 0.02, "{worst}");
    }
}
