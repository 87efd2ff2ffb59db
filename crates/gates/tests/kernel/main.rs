//! The kernel beside Icarus Verilog and beside definitions, in random circuits.

mod every_edge {
    pub mod circuit;
    mod placement;
    pub mod waves;
}
mod cases;
mod icarus;
mod saif;
mod testbench;
mod tool;
mod traces;

mod activity_agrees_with_waves;
mod lanes_agree_with_single_circuits;
#[cfg(feature = "liberty")]
mod library_cells_by_hand;
#[cfg(feature = "liberty")]
mod library_files_as_delivered;
mod random_circuits_agree_with_icarus;
mod shift_banks_change_nothing;
mod timing_checks_find_violations;
mod traces_are_deterministic;
mod violations_are_those_of_the_definitions;
#[cfg(feature = "fst")]
mod waves_read_back;
