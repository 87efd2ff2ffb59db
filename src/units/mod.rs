//! Units that cannot be mixed up: integer-femtosecond [`Time`], exact [`Frequency`], constants.
//!
//! Everything the chip does is timed in whole femtoseconds. Lengths and energies are `f64` whose
//! names end in their unit (`_m`, `_j`, `_nm`).

mod constants;
mod frequency;
mod time;

pub use constants::{PLANCK_J_S, SPEED_OF_LIGHT_M_PER_S};
pub use frequency::{Every, Frequency, FrequencyError};
pub use time::Time;
