//! What a delay is: from which input to which output, to which edge, and what it does to short pulses.

use super::cell::{MAX_INPUTS, MAX_OUTPUTS};
use super::corner::Delay;
use crate::logic::Logic;
use crate::units::Time;

/// What becomes of a pulse that is shorter than the delay it meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DelayModel {
    /// It is swallowed, as by a gate that has to charge its load: a new value cancels the one on its way.
    #[default]
    Inertial,
    /// It comes through, as on a wire: every change arrives, except that one whose delay is so much shorter that
    /// it overtakes earlier ones cancels those it overtakes (VHDL's `transport`; IEEE 1364, 14.6.4.3).
    Transport,
}

/// Delays from one input pin to one output pin. They are kept in 32 bits, as a chip has many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ArcDelay {
    /// To a rising output.
    pub(crate) rise_fs: u32,
    /// To a falling output.
    pub(crate) fall_fs: u32,
}

impl ArcDelay {
    /// Delays to a rising and to a falling output: from 0 to [`Delay::LONGEST`], of which the nearer one counts for others.
    pub const fn new(rise: Time, fall: Time) -> Self {
        ArcDelay {
            rise_fs: Delay::kept_fs(rise),
            fall_fs: Delay::kept_fs(fall),
        }
    }

    /// Delay to a rising output.
    pub const fn rise(self) -> Time {
        Time::from_fs(self.rise_fs as i64)
    }

    /// Delay to a falling output.
    pub const fn fall(self) -> Time {
        Time::from_fs(self.fall_fs as i64)
    }

    /// Delay of an output change to `to`; a change to X takes the shorter one.
    #[inline]
    pub fn delay(self, to: Logic) -> Time {
        Time::from_fs(self.delay_fs(to).into())
    }

    #[inline]
    pub(crate) fn delay_fs(self, to: Logic) -> u32 {
        match to {
            Logic::One => self.rise_fs,
            Logic::Zero => self.fall_fs,
            Logic::X | Logic::Z => self.rise_fs.min(self.fall_fs),
        }
    }
}

/// Delays of one cell by input pin and output pin. Those to an output that a cell does not have mean nothing.
pub type CellDelays = [[ArcDelay; MAX_OUTPUTS]; MAX_INPUTS];
