//! Two signals too close to call: what they are, how close they come, and what keeps them apart.

use std::fmt;

use crate::units::Time;

/// What a cure adds to the end of a forbidden time: clock edges are rounded to whole femtoseconds, each by itself.
const ROUNDING: Time = Time::from_fs(4);

/// A signal that comes when it must not: a flip-flop's setup, hold, recovery or removal time is broken, or may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Race {
    /// What meets what. The first is the one that comes at the wrong time.
    pub what: &'static str,
    /// The event that times are counted from.
    pub after: &'static str,
    /// When it comes.
    pub comes: Time,
    /// From when on it must not …
    pub from: Time,
    /// … until it may again, if ever.
    pub to: Option<Time>,
    /// What keeps them apart.
    pub cure: Cure,
}

/// What to change of a sensor or exposure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cure {
    /// The CLK period.
    Period {
        /// Long enough from here on.
        at_least: Time,
        /// Where one shorter will do, too, up to here.
        at_most: Option<Time>,
    },
    /// STOP's rise after CLK's fall.
    Phase {
        /// Early enough up to here.
        at_most: Option<Time>,
        /// Late enough from here on.
        at_least: Option<Time>,
    },
    /// The length of a laser cycle against the start value.
    LaserCycle,
    /// The tap `msb`.
    Tap,
}

impl Race {
    /// What is missing to the nearer end of the forbidden time: negative.
    pub fn slack(&self) -> Time {
        let before = self.comes - self.from;
        let after = self.to.map_or(before, |to| to - self.comes);
        -before.min(after)
    }

    /// The strobe of the HIT flip-flops near a change of the shift register, `edges` rising CLK edges after the first that
    /// follows the counted fall; all times from CLK's fall. `shift` is CLK's rise to the change, and `shortest` the shortest
    /// CLK period that everything else allows.
    pub fn strobe_at_shift(
        period: Time,
        edges: i64,
        (strobe, shift): (Time, Time),
        (setup, hold): (Time, Time),
        shortest: Time,
    ) -> Self {
        let odd = 2 * edges + 1;
        let change = Time::from_fs(period.as_fs() * odd / 2) + shift;
        let band = |offset: Time, odd: i64| 2 * offset.as_fs() / odd;
        let upper = |odd| Time::from_fs(band(strobe - shift + hold, odd)) + ROUNDING;
        let at_most = Time::from_fs(band(strobe - shift - setup, odd)) - ROUNDING;
        let is_possible = at_most > shortest && at_most > upper(odd + 2);
        Race {
            what: "the strobe meets a change of the shift register",
            after: "CLK falls",
            comes: strobe,
            from: change - hold,
            to: Some(change + setup),
            cure: Cure::Period {
                at_least: upper(odd),
                at_most: is_possible.then_some(at_most),
            },
        }
    }

    /// A signal that CLK launches (so that it comes earlier after STOP where STOP comes later) in a time that STOP forbids.
    pub fn with_stop(
        what: &'static str,
        comes: Time,
        (from, to): (Time, Time),
        phase: Time,
        period: Time,
    ) -> Self {
        let within = |p: &Time| p.as_fs().abs() <= period.as_fs() / 2;
        Race {
            what,
            after: "STOP rises",
            comes,
            from,
            to: Some(to),
            cure: Cure::Phase {
                at_most: Some(phase - (to - comes) - ROUNDING).filter(within),
                at_least: Some(phase + (comes - from) + ROUNDING).filter(within),
            },
        }
    }

    /// A path that takes `comes` from CLK's edge where the period allows `until`.
    pub fn too_slow(what: &'static str, comes: Time, until: Time) -> Self {
        Race {
            what,
            after: "CLK's edge",
            comes,
            from: until,
            to: None,
            cure: Cure::Period {
                at_least: comes + ROUNDING,
                at_most: None,
            },
        }
    }
}

impl fmt::Display for Race {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Race {
            what,
            after,
            comes,
            from,
            to,
            ..
        } = self;
        match to {
            Some(to) => write!(
                f,
                "{what} (it comes {comes} after {after}, and must not from {from} to {to})"
            ),
            None => write!(
                f,
                "{what} (it takes {comes} after {after}, and must not take more than {from})"
            ),
        }
    }
}

impl fmt::Display for Cure {
    /// Rounded to what is sure to help.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // 0.1 MHz and 1 ps are finer than anybody sets them.
        let mhz_below = |t: &Time| (1e-5 / t.as_s()).floor() / 10.0;
        let mhz_above = |t: &Time| (1e-5 / t.as_s()).ceil() / 10.0;
        let (floor, ceil) = (
            |t: &Time| (t.as_ns() * 1e3).floor(),
            |t: &Time| (t.as_ns() * 1e3).ceil(),
        );
        match self {
            Cure::Period { at_least, at_most } => {
                write!(f, "give clk_hz of at most {:.1} MHz", mhz_below(at_least))?;
                match at_most {
                    Some(at_most) => write!(f, ", or of at least {:.1} MHz", mhz_above(at_most)),
                    None => Ok(()),
                }
            }
            Cure::Phase { at_most, at_least } => match (at_most, at_least) {
                (Some(most), Some(least)) => write!(
                    f,
                    "give stop_phase_ps of at most {}, or of at least {}",
                    floor(most),
                    ceil(least)
                ),
                (Some(most), None) => write!(f, "give stop_phase_ps of at most {}", floor(most)),
                (None, Some(least)) => write!(f, "give stop_phase_ps of at least {}", ceil(least)),
                (None, None) => write!(f, "give a lower clk_hz"),
            },
            Cure::LaserCycle => write!(
                f,
                "give other --stop-periods, or start values whose windows end elsewhere in the laser cycle"
            ),
            Cure::Tap => write!(f, "give tap = \"borrow\""),
        }
    }
}
