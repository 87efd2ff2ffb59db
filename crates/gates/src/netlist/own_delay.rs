//! Delays that a designer gives to single cells instead of taking the library's: elements of a delay line, whose current a
//! control voltage sets, gates that are laid out to switch equally fast either way, and wires long enough to count.
//!
//! Elements differ at random, each by its place in the chip, as [`Mismatch`] has it for the rest of the cells. They differ in
//! every chip, whether or not other cells are taken to.

use super::cell::{MAX_INPUTS, MAX_OUTPUTS};
use super::corner::{Corner, Delay};
use super::delay::{ArcDelay, CellDelays, DelayModel};
use super::mismatch::Mismatch;
use crate::units::Time;

/// The delay of one cell, the same from every input and in either direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OwnDelay {
    /// Delay in the typical corner, on average over cells like this.
    pub typical: Time,
    /// How cells like this differ from each other: the standard deviation is relative to the mean.
    pub spread: Option<Mismatch>,
    /// What becomes of short pulses.
    pub model: DelayModel,
    /// Whether mismatch makes the cell another than its likes.
    pub mismatches: bool,
}

impl OwnDelay {
    /// A gate that is as fast either way, and otherwise as gates are.
    pub const fn balanced(typical: Time) -> Self {
        OwnDelay {
            typical,
            spread: None,
            model: DelayModel::Inertial,
            mismatches: true,
        }
    }

    /// A wire with repeaters: as fast or slow as the silicon, and too many of them to differ from another such wire.
    pub const fn wire(typical: Time) -> Self {
        OwnDelay {
            typical,
            spread: None,
            model: DelayModel::Transport,
            mismatches: false,
        }
    }

    /// The delays of the cell at this dotted path, in a corner.
    pub(crate) fn delays(&self, path: impl FnOnce() -> String, corner: Corner) -> CellDelays {
        // A spread is that of the element, whatever it is made of: of an inverter's size in the law of areas.
        let own = self.spread.map_or(1.0, |spread| spread.factor(&path(), 2));
        let typical = Time::from_fs((self.typical.as_fs() as f64 * own).round() as i64);
        let delay = Delay::scaled(typical).in_corner(corner);
        let arc = ArcDelay::new(delay, delay);
        [[arc; MAX_OUTPUTS]; MAX_INPUTS]
    }
}
