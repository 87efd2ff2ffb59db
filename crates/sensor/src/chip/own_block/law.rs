//! What a P-counter of one's own does, measured on its gates: with which COUNTER_CLK edge each COUNTER_INIT raises LOCAL_STOP.
//!
//! ```text
//!   code (COUNTER_INIT)   edge of the first rise, E             start value s of the code
//!     0 … 2ⁿ − 1     ──►   distinct, on a line     ──sort──►    E = step · s + offset
//! ```
//!
//! 64 codes at a time are loaded, reset and clocked, slowly, in the lanes of one event queue, with the library's typical delays.
//! A counter that is not binary, such as a shift register with feedback, so gets its map from start values to codes. Where no line
//! goes through the edges, where LOCAL_STOP is not one clean edge, or where a reset does not bring a start value back, the law is
//! [`Uneven`]: start values are codes, then, and only the gates say what is counted.

use std::sync::Arc;

use crate::chip::config::AfterBorrow;
use crate::chip::p_counter::Rises;
use crate::chip::p_counter::count_down::{CountDown, CountDownResult, CountDownSetup};
use crate::chip::timing::silicon::Silicon;
use crate::chip::{Probe, Probes};
use crate::kernel::LANES;
use crate::netlist::{Corner, Module, Netlist};

/// Most cells of a block: its law is measured while somebody waits.
pub(super) const MOST_CELLS: usize = 10_000;

/// Ranges of codes that are said.
const MOST_RANGES: usize = 3;

/// Why start values open no windows that a line describes. Codes are values of COUNTER_INIT.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum Uneven {
    /// LOCAL_STOP is unknown.
    #[error("LOCAL_STOP is unknown with COUNTER_INIT {0}")]
    Unknown(u16),
    /// LOCAL_STOP moves more than once with an edge of COUNTER_CLK, or with a falling one.
    #[error("LOCAL_STOP is not one clean edge with COUNTER_INIT {0}")]
    Glitch(u16),
    /// LOCAL_STOP rises with other edges after the next reset.
    #[error("COUNTER_RESET does not bring COUNTER_INIT {0} back")]
    Forgets(u16),
    /// LOCAL_STOP never rises.
    #[error("LOCAL_STOP does not rise from any COUNTER_INIT")]
    Never,
    /// Two codes raise LOCAL_STOP with the same edge.
    #[error("COUNTER_INIT {0} and {1} raise LOCAL_STOP with the same edge of COUNTER_CLK")]
    Same(u16, u16),
    /// An edge off the line.
    #[error(
        "the edges that raise LOCAL_STOP are not {step} apart: COUNTER_INIT {code} is off the line"
    )]
    OffLine {
        /// The code.
        code: u16,
        /// Edges from one start value's to the next one's.
        step: usize,
    },
    /// A counter that wraps, without one time of coming round.
    #[error(
        "LOCAL_STOP comes again after another number of counts from COUNTER_INIT {0} on than from others"
    )]
    Round(u16),
}

/// What a P-counter of one's own does.
#[derive(Debug)]
pub struct CounterLaw {
    /// By start value.
    codes: Vec<u16>,
    /// By start value.
    counted: Vec<CountDownResult>,
    offset: u32,
    uneven: Option<Uneven>,
}

impl CounterLaw {
    /// COUNTER_INIT for a start value.
    pub fn code(&self, start: u16) -> u16 {
        self.codes[usize::from(start)]
    }

    /// The start value of a code.
    pub fn start(&self, code: u16) -> u16 {
        let place = self.codes.iter().position(|&known| known == code);
        place.expect("each code has one place") as u16
    }

    /// Whether start values are loaded as they are.
    pub fn is_plain(&self) -> bool {
        (0..).zip(&self.codes).all(|(start, &code)| start == code)
    }

    /// The COUNTER_CLK edge that raises LOCAL_STOP from start value 0.
    pub fn offset(&self) -> u32 {
        self.offset
    }

    /// Why no line describes it, if none does.
    pub fn uneven(&self) -> Option<Uneven> {
        self.uneven
    }

    /// Whether LOCAL_STOP is high already after the reset.
    pub(crate) fn starts_high(&self, start: u16) -> bool {
        self.counted[usize::from(start)].starts_high
    }

    /// When LOCAL_STOP rises; `None` where it does not.
    pub fn rises(&self, start: u16) -> Option<Rises> {
        let [first, second] = self.counted[usize::from(start)].rises;
        let first = i64::from(first?);
        let every = second.map(|second| i64::from(second) - first);
        Some(Rises { first, every })
    }

    /// Codes from which LOCAL_STOP never rises, in order; none where nothing is known ([`CounterLaw::uneven`]).
    pub fn silent_codes(&self) -> Vec<u16> {
        if self.uneven.is_some() {
            return Vec::new();
        }
        let silent = |(_, of): &(&u16, &CountDownResult)| of.rises[0].is_none() && !of.starts_high;
        let by_start = self.codes.iter().zip(&self.counted);
        let mut codes: Vec<u16> = by_start.filter(silent).map(|(&code, _)| code).collect();
        codes.sort_unstable();
        codes
    }

    /// These codes in words, as `16 to 511 (496 of 512)`; `None` where there are none.
    pub fn silent_in_words(&self) -> Option<String> {
        let codes = self.silent_codes();
        let said = in_ranges(&codes)?;
        Some(format!("{said} ({} of {})", codes.len(), self.codes.len()))
    }

    /// Measures it on the gates.
    pub(super) fn measure(module: &Arc<Module>, expected: CountDownSetup) -> Self {
        let netlist = Netlist::elaborate(module);
        let probes = &Probes::of_block(&netlist);
        let bits = probes.bus(Probe::CounterInit).len();
        let codes: Vec<u16> = (0..1u32 << bits).map(|code| code as u16).collect();
        // On this thread: whoever else wants the law waits for it, and may be next in this thread's own queue.
        let timing = Silicon::nominal(Corner::Typ).timing(&netlist);
        // A reset must bring the start value back.
        let times = if expected.has_memory { 2 } else { 1 };
        let parts = codes.chunks(LANES).map(|codes| {
            let counter = CountDown::new((&netlist, probes), &timing, codes, expected);
            counter.measure(times)
        });
        let parts: Result<Vec<Vec<CountDownResult>>, Uneven> = parts.collect();
        let straight = parts.map(|parts| parts.concat());
        let plain = |counted: Vec<CountDownResult>, uneven| CounterLaw {
            codes: codes.clone(),
            counted,
            offset: 0,
            uneven: Some(uneven),
        };
        match straight {
            Err(why) => plain(vec![CountDownResult::NEVER; codes.len()], why),
            Ok(counted) => match line(&counted, expected) {
                Err(why) => plain(counted, why),
                Ok((codes, offset)) => CounterLaw {
                    counted: codes
                        .iter()
                        .map(|&code| counted[usize::from(code)])
                        .collect(),
                    codes,
                    offset,
                    uneven: None,
                },
            },
        }
    }
}

/// Rising codes in words, as `3, 5 and 16 to 511`; `None` where there are none.
fn in_ranges(codes: &[u16]) -> Option<String> {
    let mut ranges: Vec<[u16; 2]> = Vec::new();
    for &code in codes {
        match ranges.last_mut() {
            Some([_, last]) if *last + 1 == code => *last = code,
            _ => ranges.push([code; 2]),
        }
    }
    let range = |[first, last]: &[u16; 2]| {
        if first == last {
            first.to_string()
        } else {
            format!("{first} to {last}")
        }
    };
    let mut said: Vec<String> = ranges.iter().take(MOST_RANGES).map(range).collect();
    if ranges.len() > MOST_RANGES {
        said.push("others".to_owned());
    }
    let (last, others) = said.split_last()?;
    Some(match others {
        [] => last.clone(),
        _ => format!("{} and {last}", others.join(", ")),
    })
}

/// The codes by start value, and the offset, of a line through the edges of all codes that raise LOCAL_STOP.
fn line(counted: &[CountDownResult], expected: CountDownSetup) -> Result<(Vec<u16>, u32), Uneven> {
    let step = expected.step_periods;
    let rising = (0u16..).zip(counted);
    let rising = rising.filter_map(|(code, of)| Some((of.rises[0]?, code)));
    let mut rising: Vec<(u32, u16)> = rising.collect();
    rising.sort_unstable();
    let &(offset, first) = rising.first().ok_or(Uneven::Never)?;
    let round = |code: u16| {
        let [first, second] = counted[usize::from(code)].rises;
        Some(second? - first?)
    };
    let mut codes = vec![None; counted.len()];
    for &(edge, code) in &rising {
        let counts = (edge - offset) as usize;
        let place = codes.get_mut(counts / step);
        match place.filter(|_| counts.is_multiple_of(step)) {
            Some(Some(other)) => return Err(Uneven::Same(*other, code)),
            Some(place) => *place = Some(code),
            None => return Err(Uneven::OffLine { code, step }),
        }
        let wraps = expected.after_borrow == AfterBorrow::Wrap;
        if wraps && (round(code).is_none() || round(code) != round(first)) {
            return Err(Uneven::Round(code));
        }
    }
    let mut others = (0u16..)
        .zip(counted)
        .filter(|(_, of)| of.rises[0].is_none());
    let codes = codes.into_iter().map(|code| {
        let other = || others.next().expect("each code has one place").0;
        code.unwrap_or_else(other)
    });
    Ok((codes.collect(), offset))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::p_counter::{self, starts_high};
    use crate::chip::{PCounter, SensorConfig, Tap};

    /// The measured law of every built-in counter is the one that its row says.
    #[test]
    fn what_is_measured_of_built_in_counters_is_what_is_known_of_them() {
        for p_counter in PCounter::ALL {
            for tap in Tap::ALL {
                for (after_borrow, step_periods) in [
                    (AfterBorrow::Hold, 1),
                    (AfterBorrow::Hold, 4),
                    (AfterBorrow::Wrap, 1),
                    (AfterBorrow::Wrap, 2),
                ] {
                    let config = SensorConfig {
                        p_counter,
                        tap,
                        after_borrow,
                        step_periods,
                        counter_bits: 5,
                        ..SensorConfig::default()
                    };
                    if config.check().is_err() {
                        continue;
                    }
                    let expected = CountDownSetup::of_sensor(&config);
                    let law = CounterLaw::measure(&p_counter::circuit(&config), expected);
                    assert_eq!((law.uneven(), law.offset()), (None, 0), "{config:?}");
                    assert!(law.is_plain(), "{config:?}");
                    for start in 0..=config.largest_start() {
                        assert_eq!(
                            law.starts_high(start),
                            starts_high(&config, start),
                            "{config:?} {start}"
                        );
                        assert_eq!(
                            law.rises(start),
                            Rises::from_start_value(&config, start),
                            "{config:?} {start}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn codes_are_said_in_ranges() {
        let said = |codes: &[u16]| in_ranges(codes).unwrap_or_default();
        assert_eq!(said(&[]), "");
        assert_eq!(said(&[511]), "511");
        assert_eq!(said(&[3, 5, 6, 7]), "3 and 5 to 7");
        assert_eq!(said(&[0, 1, 3, 5, 6, 9]), "0 to 1, 3, 5 to 6 and others");
    }
}
