//! The cell library's functions: which cells exist, their pins, their truth tables, their area.
//!
//! Flip-flops reset (and set) on a *high* level.
//!
//! Transistor counts are those of static CMOS, with transmission gates where they save area: a
//! 4-transistor multiplexer and a 6-transistor OR gate. The custom flip-flop with reset is
//! a 24-transistor master-slave pair. The library flip-flop with set and reset has 36 transistors,
//! but occupies about three times the custom cell's layout (Taneski, *Guided Direct Time-of-Flight Lidar*, Fig. 52): [`CellKind::area`] says so.

use crate::logic::Logic;

/// Most inputs any cell has.
pub const MAX_INPUTS: usize = 4;
/// Most outputs any cell has.
pub const MAX_OUTPUTS: usize = 2;

/// A leaf cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum CellKind {
    /// Inverter: A → Z.
    Inv,
    /// Buffer: A → Z.
    Buf,
    /// 2-input NAND.
    Nand2,
    /// 2-input NOR.
    Nor2,
    /// 2-input AND.
    And2,
    /// 2-input OR.
    Or2,
    /// 2-input exclusive OR.
    Xor2,
    /// 2-input exclusive NOR.
    Xnor2,
    /// 2:1 multiplexer: Z = S ? B : A.
    Mux2,
    /// D flip-flop, rising CK, asynchronous reset R (active high).
    Dffr,
    /// D flip-flop, rising CK, asynchronous set S and reset R (active high, reset wins).
    Dffsr,
}

use CellKind::*;

impl CellKind {
    /// Every cell of the library.
    pub const ALL: [CellKind; 11] = [
        Inv, Buf, Nand2, Nor2, And2, Or2, Xor2, Xnor2, Mux2, Dffr, Dffsr,
    ];

    /// Name in netlists and Verilog.
    pub const fn name(self) -> &'static str {
        match self {
            Inv => "INV",
            Buf => "BUF",
            Nand2 => "NAND2",
            Nor2 => "NOR2",
            And2 => "AND2",
            Or2 => "OR2",
            Xor2 => "XOR2",
            Xnor2 => "XNOR2",
            Mux2 => "MUX2",
            Dffr => "DFFR",
            Dffsr => "DFFSR",
        }
    }

    /// Input pins in order.
    pub const fn inputs(self) -> &'static [&'static str] {
        match self {
            Inv | Buf => &["A"],
            Nand2 | Nor2 | And2 | Or2 | Xor2 | Xnor2 => &["A", "B"],
            Mux2 => &["A", "B", "S"],
            Dffr => &["D", "CK", "R"],
            Dffsr => &["D", "CK", "R", "S"],
        }
    }

    /// Output pins in order.
    pub const fn outputs(self) -> &'static [&'static str] {
        match self {
            Dffr | Dffsr => &["Q", "QN"],
            _ => &["Z"],
        }
    }

    /// Whether the cell holds state.
    pub const fn is_flip_flop(self) -> bool {
        matches!(self, Dffr | Dffsr)
    }

    /// Whether a change of input `pin` alone can change an output. A flip-flop's D cannot.
    pub const fn triggers(self, pin: usize) -> bool {
        !(self.is_flip_flop() && pin == 0)
    }

    /// Transistors in the cell.
    pub const fn transistors(self) -> u32 {
        match self {
            Inv => 2,
            Buf | Nand2 | Nor2 | Mux2 => 4,
            And2 | Or2 => 6,
            Xor2 | Xnor2 => 8,
            Dffr => 24,
            Dffsr => 36,
        }
    }

    /// Layout area in transistors of the custom flip-flop's density: the cell's transistors, and for the
    /// library's flip-flop three times the custom one (see the head of this file).
    pub const fn area(self) -> u32 {
        match self {
            Dffsr => 3 * Dffr.transistors(),
            _ => self.transistors(),
        }
    }

    /// Output of a gate for its inputs (unused inputs are ignored).
    ///
    /// # Panics
    /// For flip-flops, whose output is not a function of their inputs: see `next_state`.
    pub const fn output(self, inputs: [Logic; MAX_INPUTS]) -> Logic {
        let [a, b, s, _] = inputs;
        match self {
            Inv => a.inverted(),
            Buf => a.as_gate_input(),
            Nand2 => a.and(b).inverted(),
            Nor2 => a.or(b).inverted(),
            And2 => a.and(b),
            Or2 => a.or(b),
            Xor2 => a.xor(b),
            Xnor2 => a.xor(b).inverted(),
            Mux2 => Logic::mux(a, b, s),
            Dffr | Dffsr => panic!("a flip-flop is no gate"),
        }
    }
}

/// The state of a flip-flop after its clock went from `clock_before` to `clock`.
///
/// A clock edge from or to an unknown level may or may not have been a rising edge, and an unknown
/// reset may or may not be active: the new state is known only if every possibility leads to it.
pub(crate) const fn next_state(
    state: Logic,
    data: Logic,
    clock_before: Logic,
    clock: Logic,
    reset: Logic,
    set: Logic,
) -> Logic {
    let data = data.as_gate_input();
    let clocked = match (clock_before.as_gate_input(), clock.as_gate_input()) {
        (Logic::Zero, Logic::One) => data,
        (Logic::Zero, Logic::X) | (Logic::X, Logic::One) => agreed(state, data),
        _ => state,
    };
    let after_set = match set.as_gate_input() {
        Logic::Zero => clocked,
        Logic::One => Logic::One,
        _ => agreed(clocked, Logic::One),
    };
    match reset.as_gate_input() {
        Logic::Zero => after_set,
        Logic::One => Logic::Zero,
        _ => agreed(after_set, Logic::Zero),
    }
}

const fn agreed(a: Logic, b: Logic) -> Logic {
    if a.bits() == b.bits() { a } else { Logic::X }
}

#[cfg(test)]
mod tests {
    use super::Logic::{One, X, Z, Zero};
    use super::*;

    #[test]
    fn a_flip_flop_captures_on_the_rising_edge_only() {
        assert_eq!(next_state(Zero, One, Zero, One, Zero, Zero), One);
        assert_eq!(next_state(Zero, One, One, Zero, Zero, Zero), Zero);
        assert_eq!(next_state(Zero, One, One, One, Zero, Zero), Zero);
        assert_eq!(next_state(Zero, Z, Zero, One, Zero, Zero), X);
    }

    #[test]
    fn reset_wins_over_set_and_clock() {
        assert_eq!(next_state(One, One, Zero, One, One, One), Zero);
        assert_eq!(next_state(Zero, Zero, Zero, One, Zero, One), One);
    }

    #[test]
    fn unknown_edges_spoil_only_what_they_could_change() {
        assert_eq!(next_state(Zero, One, Zero, X, Zero, Zero), X);
        assert_eq!(next_state(One, One, X, One, Zero, Zero), One);
        assert_eq!(next_state(One, Zero, One, X, Zero, Zero), One);
        assert_eq!(next_state(Zero, Zero, Zero, Zero, X, Zero), Zero);
        assert_eq!(next_state(One, Zero, Zero, Zero, X, Zero), X);
    }

    #[test]
    fn pin_counts_fit() {
        for kind in CellKind::ALL {
            assert!(kind.inputs().len() <= MAX_INPUTS && kind.outputs().len() <= MAX_OUTPUTS);
        }
    }
}
