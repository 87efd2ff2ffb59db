//! One SPAD followed under many weightings at once: the probabilities of whole histories come from these.
//!
//! A weighting names some bins, and gives the expectation of wᴷ, with K pulses of the SPAD in these bins: for w = 0 the
//! probability that it makes none in them. The SPADs of a macropixel do not depend on each other, so that the expectation
//! for all of them is that of one to the power of their number, exactly, whatever their dead time does in between.

use super::abreast::{LANES, Lanes};
use super::blindness::{Ages, Blindness};
use super::spad_light::absorbed;

/// One SPAD under rows of weightings.
pub(super) struct WeightedSpad<'a> {
    blindness: &'a Blindness,
    weight: f64,
    spads: usize,
    /// By age, youngest first, and for those that are free: expectations where the SPAD is of this age.
    ages: Vec<Vec<Lanes>>,
    /// Their sums.
    total: Vec<Lanes>,
    /// The youngest and the sums, were the last bin named, too.
    youngest_named: Vec<Lanes>,
    total_named: Vec<Lanes>,
}

impl<'a> WeightedSpad<'a> {
    /// A SPAD that begins in the state `ages`, one of `spads`, with `rows` rows of weightings by `weight`, still
    /// empty.
    #[inline(always)]
    pub(super) fn new(
        blindness: &'a Blindness,
        ages: &Ages,
        (weight, spads): (f64, usize),
        rows: usize,
    ) -> Self {
        debug_assert!(!ages.aged.is_empty(), "a pulse blinds for some time");
        let shares = ages.aged.iter().chain([&ages.free]);
        let ages = shares.map(|&share| vec![[share; LANES]; rows]).collect();
        WeightedSpad {
            blindness,
            weight,
            spads,
            ages,
            total: vec![[1.0; LANES]; rows],
            youngest_named: vec![[0.0; LANES]; rows],
            total_named: vec![[1.0; LANES]; rows],
        }
    }

    /// Makes weighting `number` name the last bin.
    #[inline(always)]
    pub(super) fn name(&mut self, number: usize) {
        let (row, lane) = (number / LANES, number % LANES);
        self.ages[0][row][lane] = self.youngest_named[row][lane];
        self.total[row][lane] = self.total_named[row][lane];
    }

    /// Makes those of every other `half` weightings what the `half` before them are with the last bin named.
    #[inline(always)]
    pub(super) fn name_every_other(&mut self, half: usize) {
        let (youngest, older) = self.ages.split_first_mut().expect("those that are free");
        copy_to_every_other(half, &self.youngest_named, youngest);
        copy_to_every_other(half, &self.total_named, &mut self.total);
        for age in older {
            for pairs in age.as_flattened_mut().chunks_exact_mut(2 * half) {
                let (from, to) = pairs.split_at_mut(half);
                // Halves are too short for a call of `memcpy`.
                to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
            }
        }
    }

    /// Moves on by bin `bin`, with `mean` photons.
    #[inline(always)]
    pub(super) fn bin(&mut self, bin: usize, mean: f64) {
        let p = absorbed(mean);
        let memory = self.ages.len() - 1;
        let mut renewed = vec![[0.0; LANES]; self.total.len()];
        // Of pulses, what is lost where they are weighted.
        let lost = &mut self.total_named;
        lost.fill([0.0; LANES]);
        for (index, age) in self.ages.iter_mut().enumerate() {
            let (renews, pulses) = if index < memory {
                self.blindness.hit(bin, index + 1, p)
            } else {
                (p, p)
            };
            if renews == 0.0 {
                continue;
            }
            let loses = (1.0 - self.weight) * pulses;
            for ((age, renewed), lost) in age.iter_mut().zip(&mut renewed).zip(&mut *lost) {
                for lane in 0..LANES {
                    renewed[lane] += renews * age[lane];
                    lost[lane] += loses * age[lane];
                    age[lane] -= renews * age[lane];
                }
            }
        }
        let named = self.youngest_named.iter_mut().zip(&mut self.total_named);
        for ((youngest, total), (renewed, all)) in named.zip(renewed.iter().zip(&self.total)) {
            for lane in 0..LANES {
                youngest[lane] = renewed[lane] - total[lane];
                total[lane] = all[lane] - total[lane];
            }
        }
        let (free, aged) = self.ages.split_last_mut().expect("those that are free");
        aged.rotate_right(1);
        let oldest = std::mem::replace(&mut aged[0], renewed);
        for (free, freed) in free.iter_mut().zip(oldest) {
            for lane in 0..LANES {
                free[lane] += freed[lane];
            }
        }
    }

    /// The expectation for all SPADs under every weighting.
    #[inline(always)]
    pub(super) fn expectations(&self, into: &mut [Lanes]) {
        for (powers, bases) in into.iter_mut().zip(&self.total) {
            *powers = powers_of(bases, self.spads);
        }
    }

    /// The same with the last bin named, too.
    #[inline(always)]
    pub(super) fn expectations_named(&self, into: &mut [Lanes]) {
        for (powers, bases) in into.iter_mut().zip(&self.total_named) {
            *powers = powers_of(bases, self.spads);
        }
    }
}

#[inline(always)]
fn copy_to_every_other(half: usize, from: &[Lanes], to: &mut [Lanes]) {
    let from = from.as_flattened().chunks_exact(2 * half);
    for (from, to) in from.zip(to.as_flattened_mut().chunks_exact_mut(2 * half)) {
        let to = to[half..].iter_mut();
        to.zip(from).for_each(|(to, from)| *to = *from);
    }
}

/// `bases` to the `exponent`.
#[inline(always)]
fn powers_of(bases: &Lanes, mut exponent: usize) -> Lanes {
    let (mut powers, mut bases) = ([1.0; LANES], *bases);
    while exponent > 0 {
        let takes = exponent & 1 == 1;
        for lane in 0..LANES {
            powers[lane] *= if takes { bases[lane] } else { 1.0 };
            bases[lane] *= bases[lane];
        }
        exponent >>= 1;
    }
    powers
}
