//! The limits that a flip-flop's inputs must keep: setup, hold, recovery, removal, pulse widths.
//!
//! ```text
//!            setup  hold                    recovery                removal
//!   D   ▔▔▔▔▔╳◄───►│◄──►╳▔▔▔     R  ▔▔▔▔▔╲◄─────────►│     R  ▔▔▔▔▔▔▔▔│◄───────►╲▁▁▁▁
//!   CK  ▁▁▁▁▁▁▁▁▁▁▁╱▔▔▔▔▔▔▔▔     CK ▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁╱▔    CK ▁▁▁▁▁▁▁▁╱▔▔▔▔▔▔▔▔▔▔▔▔▔
//! ```
//!
//! The numbers are chosen, not measured: no characterisation of the custom cell is published. They are
//! what a 40 nm master-slave flip-flop with the delays of [`Library`](super::Library) would plausibly have.
//! Setup is about the two inverters and the transmission gate of the master latch, hold a third of it,
//! recovery and removal are those of the reset gates, and no pulse may be shorter than the time to turn
//! a latch over. Setup and hold differ between a rising and a falling D, as the latch's two inverters do. Corners
//! scale as the delays do.

use super::cell::CellKind;
use super::corner::{Corner, Delay, Edge};
use crate::units::Time;

/// A limit on D, by the direction in which it changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DataLimit {
    /// D rises.
    pub rise: Delay,
    /// D falls.
    pub fall: Delay,
}

impl DataLimit {
    /// Corners scaled from the typical limits.
    pub const fn scaled(rise: Time, fall: Time) -> Self {
        DataLimit {
            rise: Delay::scaled(rise),
            fall: Delay::scaled(fall),
        }
    }

    /// The same limit for both directions.
    pub const fn both(limit: Delay) -> Self {
        DataLimit {
            rise: limit,
            fall: limit,
        }
    }

    /// The limit of one direction.
    pub const fn for_edge(self, edge: Edge) -> Delay {
        match edge {
            Edge::Rise => self.rise,
            Edge::Fall => self.fall,
        }
    }
}

/// Limits of one flip-flop cell; zero means that the check always passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CheckLimits {
    /// D stable before a rising CK.
    pub setup: DataLimit,
    /// D stable after a rising CK.
    pub hold: DataLimit,
    /// Release of R or S before a rising CK that is to count.
    pub recovery: Delay,
    /// Release of R or S after a rising CK that is not to count.
    pub removal: Delay,
    /// Shortest high pulse of CK.
    pub clock_high: Delay,
    /// Shortest low pulse of CK.
    pub clock_low: Delay,
    /// Shortest high pulse of R or S.
    pub control_high: Delay,
}

/// A check on a flip-flop's inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum CheckKind {
    /// D before CK.
    Setup,
    /// D after CK.
    Hold,
    /// R or S released before CK.
    Recovery,
    /// R or S released after CK.
    Removal,
    /// CK's high pulse.
    ClockHigh,
    /// CK's low pulse.
    ClockLow,
    /// High pulse of R or S.
    ControlHigh,
}

impl CheckKind {
    /// Every check.
    pub const ALL: [CheckKind; 7] = [
        CheckKind::Setup,
        CheckKind::Hold,
        CheckKind::Recovery,
        CheckKind::Removal,
        CheckKind::ClockHigh,
        CheckKind::ClockLow,
        CheckKind::ControlHigh,
    ];

    /// Name in tables and JSON.
    pub const fn name(self) -> &'static str {
        match self {
            CheckKind::Setup => "setup",
            CheckKind::Hold => "hold",
            CheckKind::Recovery => "recovery",
            CheckKind::Removal => "removal",
            CheckKind::ClockHigh => "clock_high",
            CheckKind::ClockLow => "clock_low",
            CheckKind::ControlHigh => "control_high",
        }
    }

    /// Whether breaking it leaves the flip-flop's state in doubt: the checks that relate two pins do.
    pub(crate) const fn spoils_state(self) -> bool {
        matches!(
            self,
            CheckKind::Setup | CheckKind::Hold | CheckKind::Recovery | CheckKind::Removal
        )
    }

    /// Whether it watches D, which an asynchronous sampler cannot keep still.
    pub const fn concerns_data(self) -> bool {
        matches!(self, CheckKind::Setup | CheckKind::Hold)
    }
}

impl CheckLimits {
    /// The library's limits of one cell (all zero for gates).
    pub const fn for_cell(kind: CellKind) -> Self {
        const fn limit(fs: i64) -> Delay {
            Delay::scaled(Time::from_fs(fs))
        }
        const fn data(rise_fs: i64, fall_fs: i64) -> DataLimit {
            DataLimit::scaled(Time::from_fs(rise_fs), Time::from_fs(fall_fs))
        }
        match kind {
            CellKind::Dffr => CheckLimits {
                setup: data(31_019, 35_023),
                hold: data(12_037, 10_009),
                recovery: limit(40_009),
                removal: limit(25_031),
                clock_high: limit(60_013),
                clock_low: limit(62_017),
                control_high: limit(61_027),
            },
            CellKind::Dffsr => CheckLimits {
                setup: data(39_023, 44_017),
                hold: data(15_013, 12_511),
                recovery: limit(51_031),
                removal: limit(32_009),
                clock_high: limit(77_017),
                clock_low: limit(79_031),
                control_high: limit(78_007),
            },
            _ => {
                const NONE: Delay = Delay::fixed(Time::ZERO);
                CheckLimits {
                    setup: DataLimit::both(NONE),
                    hold: DataLimit::both(NONE),
                    recovery: NONE,
                    removal: NONE,
                    clock_high: NONE,
                    clock_low: NONE,
                    control_high: NONE,
                }
            }
        }
    }

    /// Every limit times `factor`, rounded to whole femtoseconds.
    pub fn scaled(&self, factor: f64) -> Self {
        let delay = |limit: Delay| limit.times(factor);
        let data = |limit: DataLimit| DataLimit {
            rise: delay(limit.rise),
            fall: delay(limit.fall),
        };
        CheckLimits {
            setup: data(self.setup),
            hold: data(self.hold),
            recovery: delay(self.recovery),
            removal: delay(self.removal),
            clock_high: delay(self.clock_high),
            clock_low: delay(self.clock_low),
            control_high: delay(self.control_high),
        }
    }

    /// The limit of one check in one corner; that of setup and hold for D changing in the direction of `edge`,
    /// which the other checks ignore.
    pub const fn edge_limit(&self, check: CheckKind, edge: Edge, corner: Corner) -> Time {
        let limit = match check {
            CheckKind::Setup => self.setup.for_edge(edge),
            CheckKind::Hold => self.hold.for_edge(edge),
            CheckKind::Recovery => self.recovery,
            CheckKind::Removal => self.removal,
            CheckKind::ClockHigh => self.clock_high,
            CheckKind::ClockLow => self.clock_low,
            CheckKind::ControlHigh => self.control_high,
        };
        limit.in_corner(corner)
    }

    /// The limit of one check in one corner; the larger one where D's directions differ.
    pub fn limit(&self, check: CheckKind, corner: Corner) -> Time {
        let limits = Edge::BOTH.map(|edge| self.edge_limit(check, edge, corner));
        limits[0].max(limits[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logic::Logic;
    use crate::netlist::Library;

    #[test]
    fn limits_are_ordered_by_corner_and_gates_have_none() {
        for kind in CellKind::ALL {
            for check in CheckKind::ALL {
                let [min, typ, max] =
                    Corner::ALL.map(|c| CheckLimits::for_cell(kind).limit(check, c));
                assert!(min <= typ && typ <= max);
                assert_eq!(typ != Time::ZERO, kind.is_flip_flop());
            }
        }
    }

    #[test]
    fn of_two_directions_the_longer_limit_is_meant() {
        for kind in CellKind::ALL {
            for check in CheckKind::ALL {
                for corner in Corner::ALL {
                    let limits = CheckLimits::for_cell(kind);
                    let either =
                        [Edge::Rise, Edge::Fall].map(|edge| limits.edge_limit(check, edge, corner));
                    assert_eq!(Some(&limits.limit(check, corner)), either.iter().max());
                }
            }
        }
    }

    /// A flip-flop that drives its own D (a toggle) or its neighbour's (a shift register) holds by construction.
    #[test]
    fn hold_is_shorter_than_clock_to_q_in_every_corner() {
        let library = Library::generic_40nm();
        for kind in CellKind::ALL.into_iter().filter(|k| k.is_flip_flop()) {
            for corner in Corner::ALL {
                let clock_to_q = library.delay(kind, 1, Logic::One, corner);
                let hold = library.checks(kind).limit(CheckKind::Hold, corner);
                assert!(hold < clock_to_q);
            }
        }
    }
}
