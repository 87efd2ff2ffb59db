//! One net's value in 64 lanes: two words, and gates as word operations.

use crate::logic::Logic;

/// Lanes of one simulation.
pub const LANES: usize = 64;

/// A value in every lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Lanes {
    /// Lanes that are 1.
    pub one: u64,
    /// Lanes that are 0. Lanes that are neither are X.
    pub zero: u64,
}

impl Lanes {
    /// The same value in every lane.
    pub const fn all(value: Logic) -> Self {
        match value {
            Logic::One => Lanes {
                one: u64::MAX,
                zero: 0,
            },
            Logic::Zero => Lanes {
                one: 0,
                zero: u64::MAX,
            },
            Logic::X | Logic::Z => Lanes { one: 0, zero: 0 },
        }
    }

    /// Known values, one bit a lane.
    pub const fn from_bits(bits: u64) -> Self {
        Lanes {
            one: bits,
            zero: !bits,
        }
    }

    /// The value of one lane.
    pub const fn lane(self, lane: usize) -> Logic {
        match (self.one >> lane & 1, self.zero >> lane & 1) {
            (1, _) => Logic::One,
            (_, 1) => Logic::Zero,
            _ => Logic::X,
        }
    }

    pub(super) const fn unknown(self) -> u64 {
        !(self.one | self.zero)
    }

    pub(super) const fn not(self) -> Self {
        Lanes {
            one: self.zero,
            zero: self.one,
        }
    }

    pub(super) const fn and(self, other: Self) -> Self {
        Lanes {
            one: self.one & other.one,
            zero: self.zero | other.zero,
        }
    }

    pub(super) const fn or(self, other: Self) -> Self {
        Lanes {
            one: self.one | other.one,
            zero: self.zero & other.zero,
        }
    }

    pub(super) const fn xor(self, other: Self) -> Self {
        Lanes {
            one: self.one & other.zero | self.zero & other.one,
            zero: self.one & other.one | self.zero & other.zero,
        }
    }

    pub(super) const fn mux(a: Self, b: Self, select: Self) -> Self {
        Lanes {
            one: select.zero & a.one | select.one & b.one | a.one & b.one,
            zero: select.zero & a.zero | select.one & b.zero | a.zero & b.zero,
        }
    }

    /// `other` in the lanes of `mask`, itself elsewhere.
    pub(super) const fn replaced(self, mask: u64, other: Self) -> Self {
        Lanes {
            one: self.one & !mask | other.one & mask,
            zero: self.zero & !mask | other.zero & mask,
        }
    }

    /// X in the lanes of `mask` where the two differ, itself elsewhere.
    pub(super) const fn blurred(self, mask: u64, other: Self) -> Self {
        Lanes {
            one: self.one & (!mask | other.one),
            zero: self.zero & (!mask | other.zero),
        }
    }

    pub(super) const fn differs(self, other: Self) -> u64 {
        (self.one ^ other.one) | (self.zero ^ other.zero)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn word_operations_are_the_truth_tables() {
        let values = [Logic::Zero, Logic::One, Logic::X];
        let lanes = |f: &dyn Fn(usize) -> Logic| {
            (0..27).fold(Lanes::default(), |mut word, lane| {
                match f(lane) {
                    Logic::One => word.one |= 1 << lane,
                    Logic::Zero => word.zero |= 1 << lane,
                    _ => {}
                }
                word
            })
        };
        let pick = |digit: u32| move |lane: usize| values[lane / 3usize.pow(digit) % 3];
        let (a, b, s) = (lanes(&pick(0)), lanes(&pick(1)), lanes(&pick(2)));
        for lane in 0..27 {
            let (x, y, z) = (pick(0)(lane), pick(1)(lane), pick(2)(lane));
            assert_eq!(a.and(b).lane(lane), x.and(y));
            assert_eq!(a.or(b).lane(lane), x.or(y));
            assert_eq!(a.xor(b).lane(lane), x.xor(y));
            assert_eq!(a.not().lane(lane), !x);
            assert_eq!(Lanes::mux(a, b, s).lane(lane), Logic::mux(x, y, z));
        }
    }
}
