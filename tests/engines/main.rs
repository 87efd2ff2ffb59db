//! The engines held to each other and to the theory.

#[path = "../shared/scenario.rs"]
mod scenario;

mod chip_against_theory;
mod cohort_agrees_with_window;
mod cohort_draws_what_it_computes;
mod cycle_agrees_with_gate;
mod timed_agrees_with_gate;
mod window_sees_what_the_full_stream_shows;
