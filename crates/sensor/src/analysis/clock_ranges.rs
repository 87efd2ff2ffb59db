//! How fast a chip can be clocked as it is: the ranges of CLK in which it keeps every limit of the verdict.
//!
//! ```text
//!   CLK   ├─ kept ───────────────┤ broken ├─ kept again ──┤ broken ├ … ┤ too fast for a path between flip-flops
//! ```
//!
//! Where the strobe comes relative to the shift register's changes is periodic in CLK's period, and so is where LOCAL_STOP blocks
//! COUNTER_CLK. So limits that are broken at one CLK may be kept at a higher one. STOP's phase, dead time and LOAD_CLK stay as they are.

use super::verdict::{Margin, TimingAnalysis};
use crate::units::Time;

/// The slowest CLK that is tried: below, periods are longer than any ripple.
const SLOWEST_HZ: f64 = 1e6;

/// And the fastest.
const FASTEST_HZ: f64 = 1e12;

/// The step of the search. Ranges in which a limit is broken or kept are some 4 % wide, or wider.
const STEP: f64 = 1.005;

/// Ends of ranges are as exact as this, as a share of them.
const EXACT: f64 = 1e-5;

/// A range of CLK in which a chip keeps every limit.
#[derive(Debug, Clone, PartialEq)]
pub struct ClockRange {
    /// Its lowest CLK, Hz; `None` if slower clocks work, too.
    pub from_hz: Option<f64>,
    /// Its highest CLK, Hz.
    pub to_hz: f64,
    /// The limit that a slightly higher CLK breaks; `None` if there is none.
    pub limit: Option<Margin>,
}

impl ClockRange {
    /// Whether a CLK is in it.
    pub fn contains(&self, clk_hz: f64) -> bool {
        self.from_hz.is_none_or(|from_hz| from_hz <= clk_hz) && clk_hz <= self.to_hz
    }
}

/// All ranges of CLK in which a chip keeps every limit, rising; none if one is broken at every CLK.
pub fn clock_ranges(analysis: &TimingAnalysis<'_>) -> Vec<ClockRange> {
    let broken = |clk_hz: f64| {
        let worst = analysis.at_clk(clk_hz).worst().clone();
        (worst.slack < Time::ZERO).then_some(worst)
    };
    // Between a CLK that keeps limits and one that does not: the end of the range, and the limit there.
    let end = |mut kept_hz: f64, mut broken_hz: f64, mut limit: Margin| {
        while (broken_hz - kept_hz).abs() > EXACT * kept_hz {
            let middle_hz = 0.5 * (kept_hz + broken_hz);
            match broken(middle_hz) {
                None => kept_hz = middle_hz,
                Some(margin) => (broken_hz, limit) = (middle_hz, margin),
            }
        }
        (kept_hz, limit)
    };
    let mut ranges: Vec<ClockRange> = Vec::new();
    let mut before: Option<(f64, Option<Margin>)> = None;
    let mut clk_hz = SLOWEST_HZ;
    while clk_hz < FASTEST_HZ {
        let here = broken(clk_hz);
        match (&before, &here) {
            (Some((kept_hz, None)), Some(limit)) => {
                let (to_hz, limit) = end(*kept_hz, clk_hz, limit.clone());
                let range = ranges.last_mut().expect("one has begun");
                (range.to_hz, range.limit) = (to_hz, Some(limit));
            }
            (None, None) => ranges.push(ClockRange {
                from_hz: None,
                to_hz: clk_hz,
                limit: None,
            }),
            (Some((broken_hz, Some(limit))), None) => ranges.push(ClockRange {
                from_hz: Some(end(clk_hz, *broken_hz, limit.clone()).0),
                to_hz: clk_hz,
                limit: None,
            }),
            (Some((_, None)), None) => ranges.last_mut().expect("one has begun").to_hz = clk_hz,
            (_, Some(limit)) if limit.is_for_good() => break,
            (_, Some(_)) => {}
        }
        before = Some((clk_hz, here));
        clk_hz *= STEP;
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::{SensorConfig, Silicon};

    fn at_mhz(mhz: f64) -> SensorConfig {
        SensorConfig {
            clk_hz: mhz * 1e6,
            ..SensorConfig::default()
        }
    }

    fn ranges(config: &SensorConfig) -> Vec<ClockRange> {
        clock_ranges(&TimingAnalysis::new(config, &Silicon::new(config), (0, 0)))
    }

    #[test]
    fn the_chip_of_the_thesis_runs_as_fast_as_its_setup_and_hold_allow() {
        let found = ranges(&at_mhz(384.0));
        // The table of shortest periods has 2.457 ns for STOP on CLK's fall, to a picosecond.
        assert!((1e9 / found[0].to_hz - 2.4565).abs() < 1e-3, "{found:?}");
        assert!(found[0].from_hz.is_none());
        let limits: Vec<&str> = found
            .iter()
            .map(|r| &*r.limit.as_ref().unwrap().check)
            .collect();
        // Past its strobe's change of the shift register, then past a pulse that LOCAL_STOP cuts.
        assert!(
            limits[0].contains("strobe") && limits[1].contains("blocking"),
            "{limits:?}"
        );
        // What works does not depend on the CLK that the sensor has.
        for mhz in [1.0, 415.0, 500.0] {
            assert_eq!(ranges(&at_mhz(mhz)), found);
        }
    }

    /// Verdicts of chips that are analysed anew, at the ends of ranges and within them.
    #[test]
    fn verdicts_change_at_the_ends_of_ranges() {
        let found = ranges(&at_mhz(384.0));
        let is_met = |clk_hz: f64| {
            let config = at_mhz(clk_hz * 1e-6);
            let silicon = Silicon::new(&config);
            super::super::TimingVerdict::analyse(&config, &silicon, (0, 0)).is_met()
        };
        for range in &found {
            assert!(
                is_met(range.to_hz) && !is_met(1.0001 * range.to_hz),
                "{range:?}"
            );
            if let Some(from_hz) = range.from_hz {
                assert!(is_met(from_hz) && !is_met(0.9999 * from_hz), "{range:?}");
            }
        }
        for mhz in (20..1000).step_by(11) {
            let clk_hz = f64::from(mhz) * 1e6;
            let is_known = found.iter().any(|range| range.contains(clk_hz));
            assert_eq!(is_met(clk_hz), is_known, "{mhz} MHz");
        }
    }
}
