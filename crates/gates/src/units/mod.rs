//! Units that cannot be mixed up: integer-femtosecond [`Time`], exact [`Frequency`].

mod frequency;
mod time;

pub use frequency::{Every, Frequency, FrequencyError};
pub use time::Time;
