//! The kernel beside Icarus Verilog and beside definitions, in random circuits.

mod every_edge {
    pub mod circuit;
    mod placement;
    pub mod waves;
}
mod icarus;
mod testbench;
mod tool;

mod random_circuits_agree_with_icarus;
mod timing_checks_find_violations;
mod violations_are_those_of_the_definitions;
mod waves_read_back;
