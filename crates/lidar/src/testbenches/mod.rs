//! Testbenches: each drives one block of the chip at gate level, checks what it does and leaves its waveform.
//!
//! `gdtof tb` runs them, as do the binaries `tb_*`. A new one is a file here with a `TESTBENCH`, and its line in
//! [`TESTBENCHES`]. It has stimulus, layout and expectations; netlist, kernel and waveform are those of the rig (`rig.rs`).

mod counter_tdc;
mod delay_line;
mod front_ends;
mod load_path;
mod macropixel;
mod p_counter;
mod p_counter_variants;
mod readout;
mod rig;
mod ripple_hazard;
mod tdc;
mod testbench;
mod text;

pub use testbench::Testbench;

/// All of them, simplest block first.
pub const TESTBENCHES: &[Testbench] = &[
    p_counter::TESTBENCH,
    p_counter_variants::TESTBENCH,
    load_path::TESTBENCH,
    macropixel::TESTBENCH,
    counter_tdc::TESTBENCH,
    delay_line::TESTBENCH,
    readout::TESTBENCH,
    ripple_hazard::TESTBENCH,
    front_ends::TESTBENCH,
    tdc::TESTBENCH,
];

impl Testbench {
    /// The testbench of this name, with or without its `tb_`.
    pub fn named(name: &str) -> Option<Self> {
        let is_named =
            |tb: &&Testbench| name == tb.name || Some(name) == tb.name.strip_prefix("tb_");
        TESTBENCHES.iter().find(is_named).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_testbench_is_found_by_its_name_and_without_tb() {
        for testbench in TESTBENCHES {
            let short = testbench.name.strip_prefix("tb_").unwrap();
            for name in [testbench.name, short] {
                assert_eq!(Testbench::named(name).unwrap().name, testbench.name);
            }
        }
        assert!(Testbench::named("tb_").is_none());
    }
}
