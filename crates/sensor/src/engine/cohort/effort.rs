//! How many cohorts a macropixel's window takes, without drawing any. The engine's time follows that number.
//!
//! Where laser cycles are pooled there is one cohort a step. Elsewhere there are as many as states that laser cycles are in:
//! how many SPADs fired 1, 2, … steps ago. Of N cycles nearly all are within √(2 ln N) standard deviations of a state's
//! mean along each age, and no more states are occupied than there are cycles. A history of events costs a part of that.

use super::blindness::Ages;
use super::cycles::LikeCycles;

/// Which part of √(2 ln N) standard deviations counts: with it the estimate is within a factor of two of the states that N
/// cycles are in, from a few of them to thousands, and of three with 4 or 64 SPADs (the test below).
const OCCUPIED: f64 = 0.9;

/// States that `cycles` laser cycles are expected to be in, each of whose `spads` are in the state `ages` with these probabilities.
pub(super) fn occupied_states(ages: &Ages, spads: usize, cycles: u64) -> f64 {
    let cycles = cycles as f64;
    let reach = OCCUPIED * (2.0 * cycles.ln()).sqrt();
    let deviation = |share: f64| (spads as f64 * share * (1.0 - share).max(0.0)).sqrt();
    let states: f64 = ages
        .aged
        .iter()
        .map(|&share| 1.0 + reach * deviation(share))
        .product();
    // Not more than there are ways to spread SPADs over ages.
    let ways =
        (1..=ages.aged.len()).fold(1.0, |ways, age| ways * (spads + age) as f64 / age as f64);
    let states = states.min(ways);
    states * cycles / (states + cycles)
}

/// What a history in a bin takes, its chances and how many laser cycles it has, in cohorts.
const HISTORY: f64 = 0.02;

/// The effort of `number` histories, in cohorts, summed over the bins of a window.
pub(super) fn of_histories(number: usize) -> f64 {
    HISTORY * number as f64
}

/// Cohorts of laser cycles alike, summed over the steps of a window.
pub(super) fn of_joint_states(like: &LikeCycles, spads: usize) -> f64 {
    let mut ages = like.ages.clone();
    let steps = like.means.iter().enumerate();
    steps
        .map(|(step, &mean)| {
            ages.step(&like.blindness, step, mean);
            occupied_states(&ages, spads, like.cycles)
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::engine::cohort::blindness::Blindness;
    use crate::photon::DeadTimeLaw;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]
        #[test]
        fn the_estimate_is_near_the_states_that_drawn_cycles_are_in(
            dead_time in 1.0f64..4.0,
            mean in 0.005f64..1.0,
            cycles in 100u64..4_000,
            spads in prop_oneof![Just(4usize), Just(16), Just(64)],
            seed in any::<u64>(),
        ) {
            use rand::{RngExt, SeedableRng};
            let blindness = Blindness::new(DeadTimeLaw::NonParalysable, dead_time);
            let ages = Ages::steady(&blindness, mean);
            let mut random = rand::rngs::StdRng::seed_from_u64(seed);
            let mut states = HashSet::new();
            for _ in 0..cycles {
                let mut state = vec![0u8; ages.aged.len()];
                for _ in 0..spads {
                    let mut at = random.random::<f64>();
                    let age = ages.aged.iter().position(|share| {
                        at -= share;
                        at < 0.0
                    });
                    age.into_iter().for_each(|age| state[age] += 1);
                }
                states.insert(state);
            }
            let (drawn, estimated) = (states.len() as f64, occupied_states(&ages, spads, cycles));
            let factor = if spads == 16 { 2.0 } else { 3.0 };
            prop_assert!((1.0 / factor..factor).contains(&(estimated / drawn)), "{estimated} for {drawn}");
        }
    }
}
