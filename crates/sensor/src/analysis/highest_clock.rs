//! How fast a chip can be clocked as it is: the highest CLK up to which every limit of the verdict is kept.
//!
//! ```text
//!   limits kept ├──────────────●──────────────┤ one is broken   ├── kept again ──┤
//!                          configured      the highest CLK
//! ```
//!
//! Where the strobe comes relative to the shift register's changes is periodic in CLK's period. So limits that are broken at one CLK may
//! be kept at a higher one. What counts is the stretch that the configured CLK is in, or else the next one below it. STOP's phase, dead
//! time and, where it is given, LOAD_CLK stay as they are.

use super::verdict::{Margin, TimingVerdict};
use crate::chip::{SensorConfig, Silicon};
use crate::units::Time;

/// The step of the search: stretches of CLK periods at which the strobe breaks a limit are some 4 % long.
const STEP: f64 = 1.02;

/// No CLK is tried that is farther from the configured one than this factor.
const FARTHEST: f64 = 16.0;

/// The result is as exact as this, as a share of it.
const EXACT: f64 = 1e-5;

/// The highest CLK at which a chip keeps every limit.
#[derive(Debug, Clone, PartialEq)]
pub struct HighestClock {
    /// CLK, Hz.
    pub clk_hz: f64,
    /// The limit that a slightly higher CLK breaks. `None` if sixteen times the configured CLK breaks none.
    pub limit: Option<Margin>,
}

/// Searches the highest CLK of a chip; where macropixels differ, that of the one at `position`. `None` if a limit is broken at every CLK
/// down to a sixteenth of the configured one.
pub fn highest_clock(
    config: &SensorConfig,
    silicon: &Silicon,
    position: (usize, usize),
) -> Option<HighestClock> {
    let broken = |clk_hz: f64| broken_limit(config, silicon, position, clk_hz);
    let own_hz = config.clk_hz;
    let (mut kept_hz, mut broken_hz, mut limit);
    match broken(own_hz) {
        None => {
            kept_hz = own_hz;
            loop {
                broken_hz = kept_hz * STEP;
                limit = broken(broken_hz);
                if limit.is_some() {
                    break;
                }
                if broken_hz > FARTHEST * own_hz {
                    return Some(HighestClock {
                        clk_hz: broken_hz,
                        limit: None,
                    });
                }
                kept_hz = broken_hz;
            }
        }
        Some(at_own) => {
            (broken_hz, limit) = (own_hz, Some(at_own));
            loop {
                kept_hz = broken_hz / STEP;
                let Some(below) = broken(kept_hz) else {
                    break;
                };
                if kept_hz < own_hz / FARTHEST {
                    return None;
                }
                (broken_hz, limit) = (kept_hz, Some(below));
            }
        }
    }
    while broken_hz - kept_hz > EXACT * kept_hz {
        let middle_hz = 0.5 * (kept_hz + broken_hz);
        match broken(middle_hz) {
            None => kept_hz = middle_hz,
            Some(margin) => (broken_hz, limit) = (middle_hz, Some(margin)),
        }
    }
    Some(HighestClock {
        clk_hz: kept_hz,
        limit,
    })
}

/// The tightest limit that is broken at a CLK.
fn broken_limit(
    config: &SensorConfig,
    silicon: &Silicon,
    position: (usize, usize),
    clk_hz: f64,
) -> Option<Margin> {
    let config = SensorConfig {
        clk_hz,
        ..config.clone()
    };
    let worst = TimingVerdict::analyse(&config, silicon, position)
        .worst()
        .clone();
    (worst.slack < Time::ZERO).then_some(worst)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chip_of_the_thesis_runs_as_fast_as_its_setup_and_hold_allow() {
        let config = SensorConfig::default();
        let silicon = Silicon::new(&config);
        let found = highest_clock(&config, &silicon, (0, 0)).unwrap();
        // The table of shortest periods has 2.457 ns for STOP on CLK's fall, to a picosecond.
        assert!((1e9 / found.clk_hz - 2.4565).abs() < 1e-3, "{found:?}");
        let is_met = |clk_hz| {
            let config = SensorConfig {
                clk_hz,
                ..config.clone()
            };
            TimingVerdict::analyse(&config, &silicon, (0, 0)).is_met()
        };
        assert!(is_met(found.clk_hz) && !is_met(1.0001 * found.clk_hz));
        assert!(found.limit.unwrap().check.contains("strobe"));
    }

    #[test]
    fn a_chip_that_fails_has_a_lower_clock() {
        let config = SensorConfig {
            clk_hz: 415e6,
            ..SensorConfig::default()
        };
        let found = highest_clock(&config, &Silicon::new(&config), (0, 0)).unwrap();
        assert!((1e9 / found.clk_hz - 2.4565).abs() < 1e-3, "{found:?}");
    }

    /// At 500 MHz the strobe comes between other changes of the shift register.
    #[test]
    fn limits_that_are_kept_again_end_at_a_clock_of_their_own() {
        let config = SensorConfig {
            clk_hz: 500e6,
            ..SensorConfig::default()
        };
        let found = highest_clock(&config, &Silicon::new(&config), (0, 0)).unwrap();
        assert!(found.clk_hz > 500e6, "{found:?}");
        assert!(found.limit.unwrap().check.contains("blocking"));
    }
}
