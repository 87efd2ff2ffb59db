//! One laser cycle by itself, SPAD by SPAD.
//!
//! In most steps no SPAD is hit, which one random number tells. Otherwise the first one that is hit follows from that
//! number, and those after it are asked one by one.

use super::Counts;
use super::blindness::Ages;
use super::cycles::LikeCycles;
use super::events::EventTable;
use super::spad_light::absorbed;
use super::words::RandomWords;
use crate::photon::DeadTimeLaw;
use smallvec::{SmallVec, smallvec};

/// Events of every bin of one of these laser cycles.
pub(super) fn run(like: &LikeCycles, is_event: &EventTable, random: &mut RandomWords) -> Counts {
    let blindness = &like.blindness;
    let spads = is_event.spads();
    let mut fired = fired_before(&like.ages, spads, random);
    (0..)
        .zip(&like.means)
        .map(|(step, &mean)| {
            let mut pulses = 0;
            each_hit(absorbed(mean), spads, random, |spad, random| {
                let able = match fired[spad] {
                    Some(before) => blindness.able(step as usize, (step - before) as usize),
                    None => 1.0,
                };
                let makes_pulse = random.uniform() < able;
                pulses += usize::from(makes_pulse);
                if makes_pulse || blindness.law == DeadTimeLaw::Paralysable {
                    fired[spad] = Some(step);
                }
            });
            u64::from(is_event.0[pulses])
        })
        .collect()
}

/// The step of each SPAD's last avalanche, counted from the window's first.
fn fired_before(
    ages: &Ages,
    spads: usize,
    random: &mut RandomWords,
) -> SmallVec<[Option<i64>; 16]> {
    let blind: f64 = ages.aged.iter().sum();
    if blind == 0.0 {
        return smallvec![None; spads];
    }
    let age = |_| {
        let mut place = random.uniform();
        if place >= blind {
            return None;
        }
        let younger = |share: &f64| {
            place -= share;
            place < 0.0
        };
        let age = ages.aged.iter().position(younger)?;
        Some(-1 - age as i64)
    };
    (0..spads).map(age).collect()
}

/// Calls `hit` for every SPAD that gets a photon, each with probability `p`.
fn each_hit(
    p: f64,
    spads: usize,
    random: &mut RandomWords,
    mut hit: impl FnMut(usize, &mut RandomWords),
) {
    let mut place = random.uniform();
    if place >= p * spads as f64 {
        return; // more than the probability of any
    }
    let mut is_first = p;
    for first in 0..spads {
        if place < is_first {
            hit(first, random);
            for spad in first + 1..spads {
                if random.uniform() < p {
                    hit(spad, random);
                }
            }
            return;
        }
        place -= is_first;
        is_first *= 1.0 - p;
    }
}

#[cfg(test)]
mod tests {
    use super::super::blindness::Blindness;
    use super::super::joint;
    use super::*;

    /// Pulses of every bin and of pairs of bins, against the joint state of one cycle.
    #[test]
    fn one_cycle_is_like_a_cohort_of_one() {
        const TRIALS: u32 = 60_000;
        const BINS: usize = 4;
        let means = [0.03, 0.05, 0.2, 0.02];
        for law in [DeadTimeLaw::NonParalysable, DeadTimeLaw::Paralysable] {
            for least in [1, 2] {
                let blindness = Blindness::new(law, 1.6);
                let like = LikeCycles::of(1, blindness, 0.1, &means);
                let is_event = EventTable::new(16, |spads| spads >= least);
                let mut random = RandomWords::new(5, 0);
                let mut both = [[[0u32; BINS]; BINS]; 2];
                for _ in 0..TRIALS {
                    let alone = run(&like, &is_event, &mut random);
                    let tree = joint::run(&like, &is_event, &mut random);
                    for (both, counts) in both.iter_mut().zip([alone, tree]) {
                        for (a, both) in both.iter_mut().enumerate() {
                            for (b, both) in both.iter_mut().enumerate() {
                                *both += (counts[a] * counts[b]) as u32;
                            }
                        }
                    }
                }
                let [alone, tree] = both;
                for (alone, tree) in alone.as_flattened().iter().zip(tree.as_flattened()) {
                    let error = 5.0 * f64::from(alone + tree + 1).sqrt();
                    let off = f64::from(*alone) - f64::from(*tree);
                    assert!(off.abs() < error, "{law:?} {least}: {alone} {tree}");
                }
            }
        }
    }
}
