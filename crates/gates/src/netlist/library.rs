//! Delays of the cell library: an arc from each input pin to each output pin, rise and fall, at three corners.
//!
//! An arc's delay is that from a change of the input to the change of the output it causes. The
//! default numbers stand for a 40 nm logic process at 50 °C with extracted wiring; they are chosen
//! so that a ripple counter of nine programmable bits in custom cells takes the published 1.2 ns in the typical corner
//! (F. Taneski, *Guided Direct Time-of-Flight Lidar for Self-Driving Vehicles*, 4.6, Fig. 56). Fast and slow corners scale it
//! by 0.72 and 1.45, the usual spread of such a process over voltage and temperature.
//!
//! A flip-flop's Q and Q̄ have the same delays here, rising and falling: the custom cell drives both from its slave
//! latch. Gate delays differ between rise and fall, and the numbers share no common divisor, so
//! that two different paths almost never end in the same femtosecond.

use super::cell::{CellKind, MAX_INPUTS, MAX_OUTPUTS};
use super::check_limits::CheckLimits;
use super::corner::{Corner, Delay};
use super::delay::{ArcDelay, CellDelays};
use crate::logic::Logic;
use crate::units::Time;

/// Delays from one input pin to one output pin, by direction of the output's change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TimingArc {
    /// Output rises.
    pub rise: Delay,
    /// Output falls.
    pub fall: Delay,
}

impl TimingArc {
    /// Both directions, corners scaled from the typical delays.
    pub const fn scaled(rise: Time, fall: Time) -> Self {
        TimingArc {
            rise: Delay::scaled(rise),
            fall: Delay::scaled(fall),
        }
    }

    /// The same in every corner.
    #[cfg(feature = "liberty")]
    pub(crate) const fn fixed(delay: ArcDelay) -> Self {
        TimingArc {
            rise: Delay::fixed(delay.rise()),
            fall: Delay::fixed(delay.fall()),
        }
    }

    /// Delay of an output change to `to` in one corner. A change to X takes the shorter of the
    /// two, as in IEEE 1364 for gates without a third delay.
    pub fn delay(self, corner: Corner, to: Logic) -> Time {
        let (rise, fall) = (self.rise.in_corner(corner), self.fall.in_corner(corner));
        match to {
            Logic::One => rise,
            Logic::Zero => fall,
            Logic::X | Logic::Z => rise.min(fall),
        }
    }
}

/// Arcs of one cell, indexed by input pin and output pin. The D pin of a flip-flop has none (all zero).
pub type CellArcs = [[TimingArc; MAX_OUTPUTS]; MAX_INPUTS];

/// The delays of every cell, and the limits of every flip-flop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Library {
    cells: [CellArcs; CellKind::ALL.len()],
    checks: [CheckLimits; CellKind::ALL.len()],
}

impl Library {
    /// An invented library that stands for a 40 nm logic process at 1.1 V and 50 °C with extracted wiring. No foundry's numbers
    /// are in it: its delays are chosen so that a ripple counter of nine programmable bits takes 1.2 ns.
    ///
    /// Delays of a real library come from its Liberty file: [`Liberty::timing`](crate::liberty::Liberty::timing).
    pub fn generic_40nm() -> Self {
        /// To every output alike.
        const fn arcs(rise_fs: i64, fall_fs: i64) -> [TimingArc; MAX_OUTPUTS] {
            [TimingArc::scaled(Time::from_fs(rise_fs), Time::from_fs(fall_fs)); MAX_OUTPUTS]
        }
        const NONE: [TimingArc; MAX_OUTPUTS] = arcs(0, 0);
        const fn gate(rise_fs: i64, fall_fs: i64) -> CellArcs {
            [arcs(rise_fs, fall_fs), arcs(rise_fs, fall_fs), NONE, NONE]
        }
        const CLOCK_TO_Q: [TimingArc; MAX_OUTPUTS] = arcs(75_311, 75_311);
        const RESET_TO_Q: [TimingArc; MAX_OUTPUTS] = arcs(81_043, 81_043);
        const MUX_DATA: [TimingArc; MAX_OUTPUTS] = arcs(45_127, 46_381);
        const MUX_SELECT: [TimingArc; MAX_OUTPUTS] = arcs(52_919, 54_037);
        let cells = CellKind::ALL.map(|kind| match kind {
            CellKind::Inv => gate(21_013, 18_979),
            CellKind::Buf => gate(46_219, 45_403),
            CellKind::Nand2 => gate(27_109, 29_147),
            CellKind::Nor2 => gate(40_763, 26_053),
            CellKind::And2 => gate(43_117, 41_081),
            CellKind::Or2 => gate(44_059, 47_137),
            CellKind::Xor2 => gate(58_067, 57_041),
            CellKind::Xnor2 => gate(59_083, 56_039),
            CellKind::Mux2 => [MUX_DATA, MUX_DATA, MUX_SELECT, NONE],
            CellKind::Dffr => [NONE, CLOCK_TO_Q, RESET_TO_Q, NONE],
            CellKind::Dffsr => {
                const SLOWER_CLOCK: [TimingArc; MAX_OUTPUTS] = arcs(96_181, 96_181);
                const SLOWER_CLEAR: [TimingArc; MAX_OUTPUTS] = arcs(104_233, 104_233);
                [NONE, SLOWER_CLOCK, SLOWER_CLEAR, SLOWER_CLEAR]
            }
        });
        let checks = CellKind::ALL.map(CheckLimits::for_cell);
        Library { cells, checks }
    }

    /// Arcs of one cell.
    pub fn arcs(&self, kind: CellKind) -> &CellArcs {
        &self.cells[kind as usize]
    }

    /// Delays of one cell in a corner.
    pub(crate) fn delays(&self, kind: CellKind, corner: Corner) -> CellDelays {
        let arc =
            |arc: TimingArc| ArcDelay::new(arc.rise.in_corner(corner), arc.fall.in_corner(corner));
        self.arcs(kind).map(|outputs| outputs.map(arc))
    }

    /// Replaces the arcs of one cell.
    pub fn set_arcs(&mut self, kind: CellKind, arcs: CellArcs) {
        self.cells[kind as usize] = arcs;
    }

    /// Limits of one flip-flop's inputs; all zero for a gate.
    pub fn checks(&self, kind: CellKind) -> &CheckLimits {
        &self.checks[kind as usize]
    }

    /// Replaces the limits of one cell.
    pub fn set_checks(&mut self, kind: CellKind, limits: CheckLimits) {
        self.checks[kind as usize] = limits;
    }

    /// Delay from input `pin` to the first output changing to `to`.
    ///
    /// # Example
    ///
    /// ```
    /// use femtogate::logic::Logic;
    /// use femtogate::netlist::{CellKind, Corner, Library};
    ///
    /// let library = Library::generic_40nm();
    /// let [fast, typ, slow] =
    ///     Corner::ALL.map(|corner| library.delay(CellKind::Inv, 0, Logic::Zero, corner));
    /// assert!(fast < typ && typ < slow);
    /// assert_eq!(typ.to_string(), "18.979 ps");
    /// ```
    pub fn delay(&self, kind: CellKind, pin: usize, to: Logic, corner: Corner) -> Time {
        self.arcs(kind)[pin][0].delay(corner, to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_ordered() {
        let library = Library::generic_40nm();
        for kind in CellKind::ALL {
            for pin in 0..kind.inputs().len() {
                let [min, typ, max] = Corner::ALL.map(|c| library.delay(kind, pin, Logic::One, c));
                assert!(min <= typ && typ <= max, "{}", kind.name());
                assert_eq!(typ == Time::ZERO, !kind.triggers(pin), "{}", kind.name());
            }
        }
    }

    #[test]
    fn unknown_outputs_come_as_early_as_any() {
        let [longer, shorter] = [20, 10].map(Time::from_fs);
        let arc = TimingArc::scaled(longer, shorter);
        assert_eq!(arc.delay(Corner::Typ, Logic::X), shorter);
    }
}
