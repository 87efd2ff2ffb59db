//! The engines held to each other and to the theory.

#[path = "../../crates/gates/tests/kernel/cases.rs"]
mod cases;
#[path = "../shared/counters.rs"]
mod counters;
#[path = "../shared/scenario.rs"]
mod scenario;
#[path = "../shared/wide8x8.rs"]
mod wide8x8;
#[path = "../shared/yosys.rs"]
mod yosys;

mod a_sensor_in_one_file;
mod bins_lie_where_edges_say;
mod chip_against_theory;
mod clk_comes_late_in_any_silicon;
mod cohort_agrees_with_window;
mod cohort_draws_what_it_computes;
mod counter_tdc_adds_up;
mod cycle_agrees_with_gate;
mod delay_lines_time_photons;
mod echoes_do_not_vanish;
mod impossible_light_is_refused;
mod keys_hold_at_their_limits;
mod late_cycle_is_that_of_the_whole_run;
mod light_is_a_list;
mod own_blocks_agree_with_built_in_ones;
mod own_counters_remember_nothing;
mod photons_drawn_are_those_of_the_exposure;
mod properties_hold;
mod random_libraries_count_alike;
mod spads_have_a_timing_of_their_own;
mod timed_agrees_with_gate;
mod window_sees_what_the_full_stream_shows;
