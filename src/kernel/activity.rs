//! Switching activity: how often each net changes, and how long it has each value. Power and SAIF files come from it.

use super::observer::Observer;
use crate::logic::Logic;
use crate::netlist::NetId;
use crate::units::Time;

/// What one net did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NetActivity {
    /// Changes between 0 and 1, either way; one through X counts once.
    pub toggles: u64,
    /// Times that it went to X and came back to the value before: what is left of a pulse too short to decide.
    pub glitches: u64,
    /// Time at 0.
    pub low: Time,
    /// Time at 1.
    pub high: Time,
    /// Time at X or Z, which cells cannot tell apart.
    pub unknown: Time,
}

#[derive(Debug, Clone, Copy)]
struct State {
    found: NetActivity,
    since: Time,
    now: Logic,
    /// The last known value.
    known: Logic,
}

/// Counts the activity of every net from some time on.
#[derive(Debug, Clone)]
pub struct Activity {
    from: Time,
    nets: Vec<State>,
}

impl Activity {
    /// Nothing observed yet of `nets` nets, all unknown; what happens before `from` only sets their values.
    pub fn new(nets: usize, from: Time) -> Self {
        let state = State {
            found: NetActivity::default(),
            since: from,
            now: Logic::X,
            known: Logic::X,
        };
        Activity {
            from,
            nets: vec![state; nets],
        }
    }

    /// From when on it counts.
    pub fn from(&self) -> Time {
        self.from
    }

    /// What each net did until `end`, which must not be before its last change.
    pub fn until(&self, end: Time) -> Vec<NetActivity> {
        let close = |state: &State| {
            let mut state = *state;
            state.spend(end);
            state.found
        };
        self.nets.iter().map(close).collect()
    }
}

impl State {
    /// Adds the time since the last change.
    fn spend(&mut self, until: Time) {
        let found = &mut self.found;
        let time = match self.now {
            Logic::Zero => &mut found.low,
            Logic::One => &mut found.high,
            Logic::X | Logic::Z => &mut found.unknown,
        };
        *time += until - self.since;
        self.since = until;
    }
}

impl Observer for Activity {
    #[inline]
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        let state = &mut self.nets[net.index()];
        let counts = time >= self.from;
        if counts {
            state.spend(time);
        }
        if value.to_bool().is_some() {
            if counts && state.known.to_bool().is_some() {
                if state.known != value {
                    state.found.toggles += 1;
                } else if state.now != value {
                    state.found.glitches += 1;
                }
            }
            state.known = value;
        }
        state.now = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Logic::{One, X, Zero};

    fn observed(from: i64, changes: &[(i64, Logic)], end: i64) -> NetActivity {
        let mut activity = Activity::new(1, Time::from_fs(from));
        for &(time, value) in changes {
            activity.change(Time::from_fs(time), NetId::new(0), value);
        }
        activity.until(Time::from_fs(end))[0]
    }

    #[test]
    fn values_are_timed_and_toggles_counted() {
        let found = observed(0, &[(10, Zero), (15, One), (18, Zero), (30, One)], 100);
        let times = [found.low, found.high, found.unknown].map(Time::as_fs);
        assert_eq!((found.toggles, found.glitches), (3, 0));
        assert_eq!(times, [5 + 12, 3 + 70, 10]);
    }

    #[test]
    fn x_on_the_way_is_one_toggle_and_x_and_back_a_glitch() {
        let changes = [(0, Zero), (5, X), (6, One), (8, X), (9, One)];
        let found = observed(0, &changes, 10);
        assert_eq!((found.toggles, found.glitches), (1, 1));
        assert_eq!(found.unknown.as_fs(), 2);
    }

    #[test]
    fn what_comes_before_sets_values_only() {
        let found = observed(20, &[(0, Zero), (5, One), (25, Zero)], 30);
        assert_eq!(found.toggles, 1);
        let times = [found.low, found.high, found.unknown].map(Time::as_fs);
        assert_eq!(times, [5, 5, 0]);
    }
}
