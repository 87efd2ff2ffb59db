//! The reference of the ways to draw: one laser cycle, SPAD by SPAD, with a random number for whatever may happen.

use super::Counts;
use super::cycles::LikeCycles;
use super::events::EventTable;
use super::spad_light::absorbed;
use super::words::RandomWords;
use crate::photon::DeadTimeLaw;

/// Events of every bin of one of these laser cycles.
pub(super) fn draw_counts(
    like: &LikeCycles,
    is_event: &EventTable,
    random: &mut RandomWords,
) -> Counts {
    let blindness = &like.blindness;
    // The step of each SPAD's last avalanche, counted from the window's first.
    let fired_before = |random: &mut RandomWords| {
        let mut place = random.uniform();
        let is_age = |share: &f64| {
            place -= share;
            place < 0.0
        };
        let age = like.ages.aged.iter().position(is_age)?;
        Some(-1 - age as i64)
    };
    let spads = 0..is_event.spads();
    let mut fired: Vec<Option<i64>> = spads.map(|_| fired_before(random)).collect();
    let mut events = Counts::new();
    for (step, &mean) in (0i64..).zip(&like.means) {
        let mut pulses = 0;
        for fired in &mut fired {
            if random.uniform() >= absorbed(mean) {
                continue;
            }
            let able = fired.map_or(1.0, |before| {
                blindness.firing_probability(step as usize, (step - before) as usize)
            });
            let makes_pulse = random.uniform() < able;
            pulses += usize::from(makes_pulse);
            if makes_pulse || blindness.law == DeadTimeLaw::Paralysable {
                *fired = Some(step);
            }
        }
        events.push(u64::from(is_event.0[pulses]));
    }
    events
}

#[cfg(test)]
mod tests {
    use super::super::blindness::Blindness;
    use super::super::joint;
    use super::*;

    /// Events of every bin and of pairs of bins, against the joint state of one cycle.
    #[test]
    fn joint_state_of_one_cycle_is_like_it() {
        const TRIALS: u32 = 60_000;
        const BINS: usize = 4;
        let means = [0.03, 0.05, 0.2, 0.02];
        for law in [DeadTimeLaw::NonParalysable, DeadTimeLaw::Paralysable] {
            for least in [1, 2] {
                let blindness = Blindness::new(law, 1.6);
                let like = LikeCycles::steady(1, blindness, 0.1, &means);
                let is_event = EventTable::new(16, |spads| spads >= least);
                let mut random = RandomWords::new(5, 0);
                let mut both = [[[0u32; BINS]; BINS]; 2];
                for _ in 0..TRIALS {
                    let reference = draw_counts(&like, &is_event, &mut random);
                    let tree = joint::draw_counts(&like, &is_event, &mut random);
                    for (both, counts) in both.iter_mut().zip([reference, tree]) {
                        for (a, both) in both.iter_mut().enumerate() {
                            for (b, both) in both.iter_mut().enumerate() {
                                *both += (counts[a] * counts[b]) as u32;
                            }
                        }
                    }
                }
                let [reference, tree] = both;
                for (reference, tree) in reference.as_flattened().iter().zip(tree.as_flattened()) {
                    let error = 5.0 * f64::from(reference + tree + 1).sqrt();
                    let off = f64::from(*reference) - f64::from(*tree);
                    assert!(off.abs() < error, "{law:?} {least}: {reference} {tree}");
                }
            }
        }
    }
}
