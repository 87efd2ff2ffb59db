//! Four-valued logic and the truth tables of the gates built on it.
//!
//! The values and tables are those of IEEE 1364: X is unknown, Z is undriven and reads as X at
//! every gate input. A controlling input decides an output whatever the other input is, so
//! `0 & X = 0` and `1 | X = 1`.

use std::fmt;
use std::ops::Not;

/// One wire's value.
///
/// # Example
///
/// ```
/// use femtogate::logic::Logic;
///
/// assert_eq!(!Logic::One, Logic::Zero);
/// assert_eq!(!Logic::Z, Logic::X);
/// assert_eq!((Logic::One.to_bool(), Logic::X.to_bool()), (Some(true), None));
/// assert_eq!(Logic::from(true), Logic::One);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[repr(u8)]
pub enum Logic {
    /// Low.
    Zero = 0,
    /// High.
    One = 1,
    /// Unknown: every net before anything drives it.
    #[default]
    X = 2,
    /// Undriven.
    Z = 3,
}

use Logic::{One, X, Z, Zero};

impl Logic {
    /// All four values.
    pub const ALL: [Logic; 4] = [Zero, One, X, Z];

    /// From the two bits that encode a value in packed words.
    #[inline]
    pub const fn from_bits(bits: u8) -> Logic {
        match bits & 3 {
            0 => Zero,
            1 => One,
            2 => X,
            _ => Z,
        }
    }

    /// The two bits that encode this value in packed words.
    #[inline]
    pub(crate) const fn bits(self) -> u8 {
        self as u8
    }

    /// What a gate input makes of this value: Z reads as X.
    #[inline]
    pub const fn as_gate_input(self) -> Logic {
        match self {
            Z => X,
            v => v,
        }
    }

    /// True or false where known.
    pub const fn to_bool(self) -> Option<bool> {
        match self {
            Zero => Some(false),
            One => Some(true),
            X | Z => None,
        }
    }

    /// Logical and.
    pub const fn and(self, other: Logic) -> Logic {
        match (self.as_gate_input(), other.as_gate_input()) {
            (Zero, _) | (_, Zero) => Zero,
            (One, One) => One,
            _ => X,
        }
    }

    /// Logical or.
    pub const fn or(self, other: Logic) -> Logic {
        match (self.as_gate_input(), other.as_gate_input()) {
            (One, _) | (_, One) => One,
            (Zero, Zero) => Zero,
            _ => X,
        }
    }

    /// Exclusive or.
    pub const fn xor(self, other: Logic) -> Logic {
        match (self.as_gate_input(), other.as_gate_input()) {
            (X, _) | (_, X) => X,
            (Zero, One) | (One, Zero) => One,
            _ => Zero,
        }
    }

    /// Complement.
    pub const fn inverted(self) -> Logic {
        match self.as_gate_input() {
            Zero => One,
            One => Zero,
            _ => X,
        }
    }

    /// 2:1 multiplexer: `a` when `select` is 0, `b` when it is 1. An unknown select passes a value
    /// only where both inputs agree on it.
    pub const fn mux(a: Logic, b: Logic, select: Logic) -> Logic {
        match (select.as_gate_input(), a.as_gate_input(), b.as_gate_input()) {
            (Zero, a, _) => a,
            (One, _, b) => b,
            (_, Zero, Zero) => Zero,
            (_, One, One) => One,
            _ => X,
        }
    }

    /// The character VCD and Verilog write for this value.
    pub const fn to_char(self) -> char {
        match self {
            Zero => '0',
            One => '1',
            X => 'x',
            Z => 'z',
        }
    }
}

impl From<bool> for Logic {
    fn from(value: bool) -> Logic {
        if value { One } else { Zero }
    }
}

impl Not for Logic {
    type Output = Logic;
    fn not(self) -> Logic {
        self.inverted()
    }
}

impl fmt::Display for Logic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.to_char())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// X stands for "0 or 1": the output is known exactly when it is the same for every choice.
    fn by_cases(inputs: [Logic; 3], f: impl Fn([bool; 3]) -> bool) -> Logic {
        let mut seen = [false; 2];
        for choice in 0..8u8 {
            let bit = |i: usize| choice >> i & 1 == 1;
            let agrees = (0..3).all(|i| inputs[i].to_bool().is_none_or(|v| v == bit(i)));
            if agrees {
                seen[f([bit(0), bit(1), bit(2)]) as usize] = true;
            }
        }
        match seen {
            [true, false] => Zero,
            [false, true] => One,
            _ => X,
        }
    }

    #[test]
    fn tables_are_exact_over_unknowns() {
        for a in Logic::ALL {
            for b in Logic::ALL {
                for s in Logic::ALL {
                    assert_eq!(a.and(b), by_cases([a, b, s], |[a, b, _]| a & b));
                    assert_eq!(a.or(b), by_cases([a, b, s], |[a, b, _]| a | b));
                    assert_eq!(a.xor(b), by_cases([a, b, s], |[a, b, _]| a ^ b));
                    assert_eq!(!a, by_cases([a, b, s], |[a, _, _]| !a));
                    let mux = by_cases([a, b, s], |[a, b, s]| if s { b } else { a });
                    assert_eq!(Logic::mux(a, b, s), mux);
                }
            }
        }
    }

    #[test]
    fn bits_round_trip() {
        for v in Logic::ALL {
            assert_eq!(Logic::from_bits(v.bits()), v);
            assert_eq!(v.to_string(), v.to_char().to_string());
        }
        assert_eq!([false, true].map(Logic::from), [Zero, One]);
    }
}
