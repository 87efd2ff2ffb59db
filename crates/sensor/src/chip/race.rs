//! Two signals too close to call: what they are, how close they come, and what keeps them apart.

use std::fmt;

use super::own_block::Uneven;
use crate::units::Time;

/// What a cure adds to the end of a forbidden time: clock edges are rounded to whole femtoseconds, each by itself.
const ROUNDING: Time = Time::from_fs(4);

/// What meets what. The first is the one that comes at the wrong time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
#[non_exhaustive]
pub enum Conflict {
    /// Data and clock of the METDC's shift register.
    #[error("the correlation block is slower than a CLK period")]
    SlowCorrelation,
    /// One count and the next.
    #[error("the P-counter is slower than a CLK period")]
    SlowCounter,
    /// Data and CLK of some flip-flop.
    #[error("a path is slower than a CLK period")]
    SlowPath,
    /// Data and CLK of some flip-flop, at any CLK period.
    #[error("data of a flip-flop change within its hold time")]
    BrokenHold,
    /// STROBE after LOCAL_STOP and the shift register.
    #[error("the strobe meets a change of the shift register")]
    StrobeAtShift,
    /// The shift register and STROBE after STOP, in the conventional mode.
    #[error("a change of the shift register meets the strobe")]
    ShiftAtStrobe,
    /// START of a counter TDC and CLK, after LOCAL_STOP.
    #[error("START rises as CLK samples it")]
    StartAtClk,
    /// START of a counter TDC and CLK, after STOP.
    #[error("START falls as CLK samples it")]
    StartFallsAtClk,
    /// COUNTER_CLK and COUNTER_RESET.
    #[error("a CLK edge meets the end of the reset pulse")]
    ClkAtResetEnd,
    /// COUNTER_RESET falls while what it resets still changes.
    #[error("the reset pulse is shorter than what it resets needs")]
    ShortReset,
    /// BLOCK rises within a pulse of COUNTER_CLK.
    #[error("LOCAL_STOP cuts a pulse of COUNTER_CLK short")]
    CutPulse,
    /// COUNTER_INIT and the pulse that loads a P-counter without memory.
    #[error("the pulse that loads start values is not over when COUNTER_INIT changes")]
    InitAtLoadPulse,
    /// STROBE and HIT's reset at the end of its laser cycle.
    #[error("the strobe meets the next laser cycle's reset")]
    StrobeAtNextReset,
    /// STROBE of a P-counter that nothing resets, or of STOP in the conventional mode, and HIT's reset.
    #[error("the strobe meets a laser cycle's reset")]
    StrobeAtReset,
    /// STROBE where COUNTER_RESET raises LOCAL_STOP, and HIT's reset.
    #[error("the strobe that the reset makes meets the end of HIT's reset")]
    ResetStrobeAtHitReset,
    /// CLK and ENABLE of a P-counter that nothing resets.
    #[error("CLK rises as ENABLE lets it through")]
    ClkAtEnable,
    /// LOCAL_STOP of a P-counter that nothing resets, and ENABLE.
    #[error("LOCAL_STOP rises as ENABLE changes")]
    LocalStopAtEnable,
}

impl Conflict {
    /// Whether it may concern some start values and not others.
    pub fn depends_on_start(self) -> bool {
        matches!(
            self,
            Conflict::StrobeAtShift
                | Conflict::StartAtClk
                | Conflict::CutPulse
                | Conflict::StrobeAtNextReset
                | Conflict::StrobeAtReset
                | Conflict::ResetStrobeAtHitReset
                | Conflict::LocalStopAtEnable
        )
    }
}

/// The event that the times of a race are counted from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum RaceOrigin {
    /// CLK's fall that the P-counter counts.
    #[error("CLK falls")]
    ClkFalls,
    /// The edge of CLK that launches the signal.
    #[error("CLK's edge")]
    ClkEdge,
    /// The laser cycle's STOP edge.
    #[error("STOP rises")]
    StopRises,
    /// The laser cycle's reset.
    #[error("COUNTER_RESET rises")]
    ResetRises,
    /// LOAD_CLK's edge that writes a row of start values.
    #[error("LOAD_CLK falls")]
    LoadClkFalls,
    /// The exposure's first STOP edge.
    #[error("the first STOP edge")]
    FirstStop,
}

/// Why the histogram is not latched once in every laser cycle, in the same CLK period of each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum Irregular {
    /// The P-counter wraps within the laser cycle.
    #[error("LOCAL_STOP rises more than once in a laser cycle ({rises} times)")]
    LocalStopRepeats {
        /// Rising edges of LOCAL_STOP in a laser cycle.
        rises: usize,
    },
    /// A counter TDC's window is still open when the next laser cycle's reset ends it.
    #[error("the next laser cycle begins before the counter TDC has come to the last bin")]
    CutWindow,
    /// A counter TDC's START rises again before CLK has seen it low.
    #[error("START of the counter TDC is not low at any CLK edge between two windows")]
    StartStaysHigh,
    /// A P-counter of one's own that no line describes.
    #[error("{0}: no window law describes this P-counter")]
    OwnCounter(Uneven),
    /// A P-counter of one's own whose start values are not loaded as they are.
    #[error(
        "delay lines take the lowest bit of COUNTER_INIT for that of the start value, and this P-counter has codes of its own"
    )]
    OwnCodes,
    /// The cells' delays make the P-counter count something else.
    #[error("{}", miscounts(*.start, *.found))]
    Miscounts {
        /// From which start value.
        start: u16,
        /// The count that raises LOCAL_STOP, the first one being 0; none where none does.
        found: Option<u32>,
    },
    /// Another block of one's own, by its key.
    #[error("no window law describes the netlist of {0}")]
    OwnBlock(&'static str),
    /// A P-counter without memory, which STOP does not reset, comes round in another time than STOP does.
    #[error(
        "STOP comes every {stop_periods} CLK periods and the P-counter without memory comes round in {round}, so windows drift"
    )]
    OutOfStep {
        /// CLK periods from one STOP edge to the next.
        stop_periods: i64,
        /// CLK periods in which the P-counter comes round.
        round: i64,
    },
}

fn miscounts(start: u16, found: Option<u32>) -> String {
    let found = match found {
        Some(count) => format!("LOCAL_STOP rises with count number {count}"),
        None => "LOCAL_STOP does not rise".to_owned(),
    };
    format!(
        "with the delays of these cells the P-counter does not count down from start value {start}: {found}"
    )
}

/// Why windows cannot be aimed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoAim {
    /// Two signals are too close to call.
    #[error("{0}")]
    Race(Race),
    /// No single window describes what is counted.
    #[error("{0}")]
    Irregular(Irregular),
}

/// A signal that comes when it must not: a flip-flop's setup, hold, recovery or removal time is broken, or may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Race {
    /// What meets what.
    pub what: Conflict,
    /// The event that times are counted from.
    pub after: RaceOrigin,
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
    /// The period of LOAD_CLK: at least this.
    LoadPeriod(Time),
    /// The length of a laser cycle against the start value.
    LaserCycle,
    /// The tap `msb`.
    Tap,
    /// The delay chain that makes the reset pulse.
    ResetChain,
    /// The cells: no clock helps.
    Cells,
}

impl Race {
    /// What is missing to the nearer end of the forbidden time: negative.
    pub(crate) fn slack(&self) -> Time {
        let before = self.comes - self.from;
        let after = self.to.map_or(before, |to| to - self.comes);
        -before.min(after)
    }

    /// The strobe of the HIT flip-flops near a change of the shift register, `edges` rising CLK edges after the first that
    /// follows the counted fall; all times from CLK's fall. `strobes` are the earliest and the latest of all start values,
    /// `shift` is CLK's rise to the change, and `shortest` the shortest CLK period that everything else allows.
    pub(crate) fn strobe_at_shift(
        period: Time,
        edges: i64,
        (strobe, shift): (Time, Time),
        (setup, hold): (Time, Time),
        (strobes, shortest): ((Time, Time), Time),
    ) -> Self {
        let change = Time::from_fs(period.as_fs() * (2 * edges + 1) / 2) + shift;
        let band = (strobes.0 - shift - setup, strobes.1 - shift + hold);
        let halves = |edge: i64| 2 * edge + 1;
        Race {
            what: Conflict::StrobeAtShift,
            after: RaceOrigin::ClkFalls,
            comes: strobe,
            from: change - hold,
            to: Some(change + setup),
            cure: clear_periods(period, edges, halves, band, shortest),
        }
    }

    /// A block of COUNTER_CLK at `block` after CLK's fall, within pulse number `pulses` after the one that it follows. `blocks` are
    /// the earliest and the latest of all start values; each is too late from the first time of `within` after CLK's fall on, until
    /// the second.
    pub(crate) fn cut_pulse(
        period: Time,
        pulses: i64,
        block: Time,
        (blocks, within): ((Time, Time), (Time, Time)),
        shortest: Time,
    ) -> Self {
        let pulse = period * pulses;
        let band = (blocks.0 - within.1, blocks.1 - within.0);
        Race {
            what: Conflict::CutPulse,
            after: RaceOrigin::ClkFalls,
            comes: block,
            from: pulse + within.0,
            to: Some(pulse + within.1),
            cure: if pulses > 0 {
                clear_periods(period, pulses, |pulse| 2 * pulse, band, shortest)
            } else {
                Cure::Cells
            },
        }
    }

    /// Data that come too soon by this much.
    pub(crate) fn broken_hold(need: Time) -> Self {
        Race {
            cure: Cure::Cells,
            ..Race::too_slow(Conflict::BrokenHold, need, Time::ZERO)
        }
    }

    /// A reset pulse of this `width` that must outlast `need`.
    pub(crate) fn short_reset(need: Time, width: Time) -> Self {
        Race {
            what: Conflict::ShortReset,
            after: RaceOrigin::ResetRises,
            comes: need,
            from: width,
            to: None,
            cure: Cure::ResetChain,
        }
    }

    /// A pulse that loads start values for this long, where LOAD_CLK allows half a `period`.
    pub(crate) fn long_load(pulse: Time, period: Time) -> Self {
        Race {
            what: Conflict::InitAtLoadPulse,
            after: RaceOrigin::LoadClkFalls,
            comes: pulse,
            from: Time::from_fs(period.as_fs() / 2),
            to: None,
            cure: Cure::LoadPeriod(pulse * 2 + ROUNDING * 2),
        }
    }

    /// A signal that CLK launches (so that it comes earlier after STOP where STOP comes later) in a time that STOP forbids.
    pub(crate) fn with_stop(
        what: Conflict,
        comes: Time,
        (from, to): (Time, Time),
        phase: Time,
        period: Time,
    ) -> Self {
        let within = |p: &Time| p.as_fs().abs() <= period.as_fs() / 2;
        Race {
            what,
            after: RaceOrigin::StopRises,
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
    pub(crate) fn too_slow(what: Conflict, comes: Time, until: Time) -> Self {
        Race {
            what,
            after: RaceOrigin::ClkEdge,
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

/// The CLK periods next to `period` at which no edge of CLK, `halves(edge)` half periods after its fall, lies within `band`, which is
/// where edge number `edge` lies now.
fn clear_periods(
    period: Time,
    edge: i64,
    halves: impl Fn(i64) -> i64,
    band: (Time, Time),
    shortest: Time,
) -> Cure {
    let share = |time: Time, edge: i64| match halves(edge) {
        halves if halves > 0 => Time::from_fs(2 * time.as_fs() / halves),
        // That edge is where CLK falls, at every period.
        _ => Time::MAX,
    };
    let upper = |edge| share(band.1, edge).max(period) + ROUNDING;
    let lower = |edge| share(band.0, edge).min(period) - ROUNDING;
    // Bands of edges that come before may overlap with this one's, if start values differ much.
    let mut before = edge;
    while before > 0
        && halves(before - 1) > 0
        && upper(before) >= share(band.0, before - 1) - ROUNDING
    {
        before -= 1;
    }
    let mut after = edge;
    while lower(after) > shortest && lower(after) <= share(band.1, after + 1) + ROUNDING {
        after += 1;
    }
    let at_most = lower(after);
    Cure::Period {
        at_least: upper(before),
        at_most: (at_most > shortest).then_some(at_most),
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
            Cure::LoadPeriod(at_least) => {
                write!(
                    f,
                    "give load_clk_hz of at most {:.1} MHz",
                    mhz_below(at_least)
                )
            }
            Cure::LaserCycle => write!(
                f,
                "give another length of the laser cycle, or start values whose windows end elsewhere in it"
            ),
            Cure::Tap => write!(f, "give tap = \"borrow\""),
            Cure::ResetChain => write!(
                f,
                "give reset_stages = 0, which makes the delay chain as long as the cells need, or more stages"
            ),
            Cure::Cells => write!(f, "give another library; no clk_hz helps"),
        }
    }
}

#[cfg(test)]
mod tests;
