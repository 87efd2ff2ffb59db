//! The kernel beside Icarus Verilog and beside definitions, in random circuits.

mod every_edge {
    pub mod circuit;
    mod placement;
    pub mod waves;
}
mod icarus;
mod testbench;
mod tool;
mod traces;

mod lanes_agree_with_single_circuits;
mod random_circuits_agree_with_icarus;
mod shift_banks_change_nothing;
mod timing_checks_find_violations;
mod violations_are_those_of_the_definitions;
mod waves_read_back;
