//! The chip and its kernel: blocks, timing, waveforms, other simulators.

mod bench;
#[path = "../../crates/gates/tests/kernel/cases.rs"]
mod cases;
#[path = "../shared/command.rs"]
mod command;
#[path = "../../crates/gates/tests/kernel/every_edge"]
mod every_edge {
    pub mod waves;
}
mod icarus;
mod library_chips;
#[path = "../../crates/gates/tests/kernel/saif.rs"]
mod saif;
#[path = "../shared/scenario.rs"]
mod scenario;
#[path = "../../crates/gates/tests/kernel/testbench.rs"]
mod testbench;
#[path = "../../crates/gates/tests/kernel/tool.rs"]
mod tool;
#[path = "../../crates/gates/tests/kernel/traces.rs"]
mod traces;
#[path = "../../crates/gates/tests/kernel/icarus.rs"]
mod verilog;
#[path = "../shared/wide8x8.rs"]
mod wide8x8;
#[path = "../shared/yosys.rs"]
mod yosys;

mod activity_agrees_with_waves;
mod annotated_delays_agree_with_icarus;
mod blocks_agree_with_their_models;
mod blocks_are_proven;
mod clock_period_limits;
mod every_edge_agrees_with_icarus;
mod front_ends_agree_with_their_models;
mod gate_level_agrees_with_reference;
mod icarus_agrees_with_the_kernel;
mod lanes_agree_with_single_pixels;
mod library_energies;
mod load_path_agrees_with_its_models;
mod loading_and_stop_edges_are_safe;
mod mapped_cells_serve_other_tools;
mod mapped_netlists_agree_with_icarus;
mod opensta_agrees_as_the_book_says;
mod opensta_agrees_on_library_delays;
mod opensta_agrees_on_slacks;
mod p_counter_traps;
mod p_counters_agree_with_their_models;
mod readout_agrees_with_its_models;
mod serial_load_reaches_every_macropixel;
mod shift_banks_change_nothing;
mod standard_cells_serve_other_tools;
mod static_timing_bounds_the_kernel;
mod tdcs_agree_with_their_models;
mod testbenches_pass;
mod the_correlation_block_agrees_with_its_model;
mod the_sensor_keeps_its_timing_checks;
mod timing_verdicts_agree_with_gates;
mod traces_are_deterministic;
mod yosys_gives_back_what_it_was_given;
