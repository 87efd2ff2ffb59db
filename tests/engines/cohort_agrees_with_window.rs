//! The cohort engine draws from the distribution of the window engine: means, variances and covariances over many
//! seeds, for every TYPE, mode and place of the window, in little light and in much.
//!
//! `COHORT_SEEDS=n` sets the number of seeds; the more, the smaller the difference that shows.

mod bright;
mod chip;
pub mod comparison;
mod ways;
