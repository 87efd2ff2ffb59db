//! Random cell libraries as Liberty files: rise ≠ fall, Q ≠ QN, random limits, and now and then without the cells that a kit may lack.
//!
//! ```text
//!   numbers from 0 to 1 ──► library_of ──► text ──► FILE.lib ──► liberty = "FILE.lib" of a sensor
//!      0.5 is the middle of every delay and limit, and every cell
//! ```
//!
//! Delays are tables of slew and load that are planes, so that interpolation adds nothing of its own. The middles are those of an invented
//! 40 nm library, up to three times more or less; a whole library is 0.6 to 10 times as slow.

use std::fmt::Write;

use proptest::collection::vec;
use proptest::prelude::*;

/// Slews (ns) and loads (pF) of every table, which is a plane through them.
const SLEWS: [f64; 2] = [0.005, 0.3];
const LOADS: [f64; 2] = [0.0005, 0.04];

/// Numbers that a library with all cells takes.
const NUMBERS: usize = 205;

/// Text of Liberty files. It shrinks towards a library of all cells with the middles of their delays and limits.
pub fn libraries() -> impl Strategy<Value = String> + Clone {
    vec(-50i8..=50, NUMBERS).prop_map(|steps| {
        let mut steps = steps.into_iter();
        library_of(|| 0.5 + f64::from(steps.next().unwrap_or(0)) / 101.0)
    })
}

/// The text of the library that `next` decides, which gives numbers from 0 to 1.
pub fn library_of(mut next: impl FnMut() -> f64) -> String {
    let slower = libm::pow(10.0, -0.2 + 1.2 * next());
    let mut maker = Maker {
        next: &mut next,
        text: HEAD.to_owned(),
        slower,
    };
    maker.cells();
    maker.text + "}\n"
}

struct Maker<'n> {
    next: &'n mut dyn FnMut() -> f64,
    text: String,
    /// On every delay and limit.
    slower: f64,
}

const HEAD: &str = "library (random) {
  delay_model : table_lookup;
  time_unit : \"1ns\";
  voltage_unit : \"1V\";
  leakage_power_unit : \"1nW\";
  capacitive_load_unit (1, pf);
  nom_voltage : 1.1;
  lu_table_template (delay) {
    variable_1 : input_net_transition;
    variable_2 : total_output_net_capacitance;
    index_1 (\"0.005, 0.3\");
    index_2 (\"0.0005, 0.04\");
  }
";

impl Maker<'_> {
    /// `middle`, or up to three times more or less.
    fn within_factor_3(&mut self, middle: f64) -> f64 {
        middle * libm::pow(3.0, 2.0 * (self.next)() - 1.0)
    }

    fn has(&mut self, probability: f64) -> bool {
        (self.next)() < probability
    }

    fn cells(&mut self) {
        self.gate("INV", "A", "!A", "negative_unate", 0.006);
        self.gate("NAND2", "AB", "!(A B)", "negative_unate", 0.009);
        self.gate("NOR2", "AB", "!(A + B)", "negative_unate", 0.012);
        for (name, function, sense) in [
            ("BUF", "A", "positive_unate"),
            ("AND2", "A B", "positive_unate"),
            ("OR2", "A + B", "positive_unate"),
            ("XOR2", "A ^ B", "non_unate"),
            ("XNOR2", "!(A ^ B)", "non_unate"),
        ] {
            if self.has(0.6) {
                let inputs = if name == "BUF" { "A" } else { "AB" };
                self.gate(name, inputs, function, sense, 0.02);
            }
        }
        if self.has(0.6) {
            self.gate("MUX2", "DES", "(D !S) + (E S)", "non_unate", 0.024);
        }
        self.flip_flop("DFFR", false);
        self.flip_flop("DFFSR", true);
    }

    fn gate(&mut self, name: &str, inputs: &str, function: &str, sense: &str, delay: f64) {
        let _ = write!(self.text, "  cell ({name}) {{\n    area : 1;\n");
        for input in inputs.chars() {
            self.input(&input.to_string(), "");
        }
        let _ = writeln!(
            self.text,
            "    pin (Y) {{ direction : output; function : \"{function}\";"
        );
        for input in inputs.chars() {
            self.arc(&input.to_string(), sense, "", delay, &["rise", "fall"]);
        }
        self.text += "    }\n  }\n";
    }

    fn input(&mut self, name: &str, more: &str) {
        let load = self.within_factor_3(0.0009);
        let _ = writeln!(
            self.text,
            "    pin ({name}) {{ direction : input; capacitance : {load:.6}; {more} }}"
        );
    }

    fn arc(&mut self, related: &str, sense: &str, kind: &str, delay: f64, edges: &[&str]) {
        let _ = write!(
            self.text,
            "      timing () {{ related_pin : \"{related}\"; timing_sense : {sense};"
        );
        if !kind.is_empty() {
            let _ = write!(self.text, " timing_type : {kind};");
        }
        self.text.push('\n');
        for edge in edges {
            let base = self.within_factor_3(delay) * self.slower;
            let per_pf = self.within_factor_3(4.0) * self.slower;
            self.table(&format!("cell_{edge}"), [base, 0.18, per_pf]);
            let per_pf = self.within_factor_3(7.0) * self.slower;
            self.table(
                &format!("{edge}_transition"),
                [0.006 * self.slower, 0.04, per_pf],
            );
        }
        self.text += "      }\n";
    }

    /// A plane: its value without slew and load, ns, and what it gains for a ns of slew and a pF of load.
    fn table(&mut self, name: &str, [base, per_slew, per_pf]: [f64; 3]) {
        let row = |slew: f64| {
            let values = LOADS.map(|load| format!("{:.6}", base + per_slew * slew + per_pf * load));
            format!("\"{}\"", values.join(", "))
        };
        let rows = SLEWS.map(row).join(", ");
        let _ = writeln!(self.text, "        {name} (delay) {{ values ({rows}); }}");
    }

    /// Setup, hold, recovery or removal against CK: rise and fall differ.
    fn limit(&mut self, kind: &str, middle: f64, edges: &[&str]) -> String {
        let mut text = format!("timing () {{ related_pin : \"CK\"; timing_type : {kind}_rising; ");
        for edge in edges {
            let mut ns = self.within_factor_3(middle) * self.slower;
            // Some libraries have negative hold and removal times.
            if matches!(kind, "hold" | "removal") && self.has(0.3) {
                ns = -ns;
            }
            let _ = write!(
                text,
                "{edge}_constraint (scalar) {{ values (\"{ns:.6}\"); }} "
            );
        }
        text + "}"
    }

    fn flip_flop(&mut self, name: &str, preset: bool) {
        let (high, low) = (
            self.within_factor_3(0.04) * self.slower,
            self.within_factor_3(0.04) * self.slower,
        );
        let _ = write!(
            self.text,
            "  cell ({name}) {{\n    area : 4;\n    ff (IQ, IQN) {{ clocked_on : \"CK\"; next_state : \"D\"; clear : \"R\"; "
        );
        if preset {
            self.text += "preset : \"S\"; clear_preset_var1 : L; clear_preset_var2 : L; ";
        }
        self.text += "}\n";
        self.input(
            "CK",
            &format!(
                "clock : true; min_pulse_width_high : {high:.6}; min_pulse_width_low : {low:.6};"
            ),
        );
        let both = ["rise", "fall"];
        let data = [
            self.limit("setup", 0.025, &both),
            self.limit("hold", 0.003, &both),
        ];
        self.input("D", &data.join(" "));
        for control in if preset { &["R", "S"][..] } else { &["R"] } {
            let width = self.within_factor_3(0.04) * self.slower;
            let limits = [
                self.limit("recovery", 0.02, &["fall"]),
                self.limit("removal", 0.015, &["fall"]),
            ];
            self.input(
                control,
                &format!("min_pulse_width_high : {width:.6}; {}", limits.join(" ")),
            );
        }
        let outputs = if self.has(0.7) { 2 } else { 1 };
        for (pin, function) in [("Q", "IQ"), ("QN", "IQN")].into_iter().take(outputs) {
            let _ = writeln!(
                self.text,
                "    pin ({pin}) {{ direction : output; function : \"{function}\";"
            );
            self.arc("CK", "non_unate", "rising_edge", 0.055, &both);
            let (cleared, set) = if pin == "Q" {
                (
                    ("clear", "negative_unate", "fall"),
                    ("preset", "positive_unate", "rise"),
                )
            } else {
                (
                    ("preset", "positive_unate", "rise"),
                    ("clear", "negative_unate", "fall"),
                )
            };
            self.arc("R", cleared.1, cleared.0, 0.045, &[cleared.2]);
            if preset {
                self.arc("S", set.1, set.0, 0.045, &[set.2]);
            }
            self.text += "    }\n";
        }
        self.text += "  }\n";
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::{Sensor, SensorConfig};
    use crate::strategies::drawn;

    #[test]
    fn the_simplest_library_has_all_cells() {
        let mut numbers = 0;
        let text = library_of(|| {
            numbers += 1;
            0.5
        });
        assert_eq!(numbers, NUMBERS);
        for cell in [
            "INV", "BUF", "AND2", "OR2", "XOR2", "XNOR2", "MUX2", "DFFR", "DFFSR",
        ] {
            assert!(text.contains(&format!("cell ({cell})")), "{cell}");
        }
    }

    #[test]
    fn chips_are_made_of_any_library() {
        let folder = tempfile::tempdir().unwrap();
        let ripples = (0..6).map(|seed| {
            let liberty = folder.path().join(format!("{seed}.lib"));
            std::fs::write(&liberty, drawn(seed, &libraries())).unwrap();
            let config = SensorConfig {
                liberty,
                clk_hz: 10e6,
                dead_time_ns: 400.0,
                ..SensorConfig::default()
            };
            Sensor::new(config).unwrap().timing().ripple()
        });
        let ripples: std::collections::BTreeSet<_> = ripples.collect();
        assert_eq!(ripples.len(), 6);
    }
}
