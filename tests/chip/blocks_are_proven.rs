//! Blocks of the exported netlist are proven equal to a few lines of RTL (`vectors/formal`) by Yosys, with the cells that are
//! exported for other tools.
//!
//! | block | is | for |
//! |---|---|---|
//! | P-counter, every variant and tap | proven by induction | all start values, 9 bits, steps of 1, 2, 4 and 8; 2 and 12 bits |
//! | correlation | proven | all inputs, TYPE and THRESHOLD of 1, 2, 4 and 16 SPADs |
//! | METDC of CLK periods | proven by induction | 16 bins, both modes; 1 and 64 bins |
//! | histogram | proven by induction | 16 bins of 14 bits, saturating and wrapping; 1 bit |
//!
//! A proof knows steps and no times. In a step inputs change at will, within the contract that the RTL states, and everything
//! settles: a ripple runs through all stages (`clk2fflogic`, which turns clocks into data sampled at each step). So it says that
//! the gates compute what the RTL does, whatever was done before and for however long. When they do, and that no signal races
//! another, is for static timing and the event simulators. Two inverters whose delay matters even so are a step long
//! (`a_step_later.v`).
//!
//! Induction is over steps. It closes within two, since nets that hold the state have the names of the RTL's variables and are compared
//! as well (`expose -shared`). Nothing is bounded. Not proven are correlations of more SPADs (32 take 24 s of processor time, 64 did not
//! end within 100 s: their adders are trees, and the RTL's is a chain) and METDCs with delay lines, which are nothing but times.
//!
//! What would a proof miss? Cells are exchanged for others in the text of small blocks, one at a time, and the same script must find a
//! run from power-up that differs. "Not proven" is not enough.

use crate::cases;
use crate::{scenario, tool};

use std::fs;
use std::path::Path;
use std::process::Command;

use guided_dtof::chip::{Overflow, PCounter, SensorConfig, Tap, count_bits};
use guided_dtof::stimulus::export_verilog;

/// A module of the exported netlist and the RTL that it is to be equal to.
struct Block {
    /// The sensor that is exported.
    config: SensorConfig,
    /// The module; in the RTL its name ends with `_rtl`.
    module: &'static str,
    /// The RTL, in `vectors/formal`.
    rtl: &'static str,
    parameters: Vec<(&'static str, usize)>,
    /// A module whose inverters are a step long.
    a_step_later: Option<&'static str>,
}

#[derive(Debug, PartialEq, Eq)]
enum Verdict {
    Proven,
    /// A run from power-up, within the contract, shows a difference.
    Refuted,
}

impl Block {
    fn p_counter(config: SensorConfig) -> Self {
        let has_borrow = usize::from(config.tap == Tap::Borrow);
        let row = config.p_counter.row();
        let is_gray = usize::from((row.code)(2) != 2);
        let (rtl, own): (_, &[_]) = match (row.has_memory, row.no_msb) {
            (false, _) => ("memoryless_counter.v", &[("BORROW", has_borrow)]),
            (true, None) => (
                "down_counter.v",
                &[
                    ("BORROW", has_borrow),
                    ("STEP", config.step_periods),
                    ("GRAY", is_gray),
                ],
            ),
            (true, Some(_)) => ("up_counter.v", &[("STEP", config.step_periods)]),
        };
        let mut parameters = vec![("BITS", config.counter_bits)];
        parameters.extend(own);
        let has_pulse = !row.has_memory;
        Block {
            config,
            module: "p_counter",
            rtl,
            parameters,
            a_step_later: has_pulse.then_some("p_counter"),
        }
    }

    fn correlation(spad_rows: usize, spad_cols: usize) -> Self {
        let spads = spad_rows * spad_cols;
        Block {
            config: SensorConfig {
                spad_rows,
                spad_cols,
                ..SensorConfig::default()
            },
            module: "correlation",
            rtl: "correlation.v",
            parameters: vec![("SPADS", spads), ("BITS", count_bits(spads))],
            a_step_later: None,
        }
    }

    fn metdc(bins: usize) -> Self {
        Block {
            config: SensorConfig {
                bins,
                ..SensorConfig::default()
            },
            module: "metdc",
            rtl: "metdc.v",
            parameters: vec![("BINS", bins)],
            a_step_later: None,
        }
    }

    fn histogram(bin_bits: usize, overflow: Overflow) -> Self {
        let saturates = overflow == Overflow::Saturate;
        Block {
            config: SensorConfig {
                bin_bits,
                overflow,
                ..SensorConfig::default()
            },
            module: "histogram",
            rtl: "histogram.v",
            parameters: vec![("BITS", bin_bits), ("SATURATES", usize::from(saturates))],
            a_step_later: saturates.then_some("bin_counter"),
        }
    }

    /// Exports the netlist into `folder`, beside the RTL.
    fn export(&self, folder: &Path) {
        let config = SensorConfig {
            rows: 1,
            cols: 1,
            ..self.config.clone()
        };
        export_verilog(folder, &config, None, None).unwrap();
        for file in [self.rtl, "a_step_later.v"] {
            let from = Path::new("vectors/formal").join(file);
            fs::copy(from, folder.join(file)).unwrap();
        }
    }

    /// What Yosys finds of the netlist in `folder`, by induction over at most `steps` steps.
    ///
    /// # Panics
    /// When that is neither.
    fn verdict(&self, folder: &Path, steps: usize) -> Verdict {
        let (module, rtl) = (self.module, self.rtl);
        let parameters = self.parameters.iter();
        let parameters: String = parameters
            .map(|(name, value)| format!(" -set {name} {value}"))
            .collect();
        let later = self.a_step_later.map_or(String::new(), |module| {
            format!("chtype -set INV_A_STEP_LATER {module}/t:INV")
        });
        let script = format!(
            "
            read_verilog -formal {rtl}
            chparam{parameters} {module}_rtl
            hierarchy -check -top {module}_rtl
            proc
            flatten
            check -assert
            rename -top rtl
            design -stash rtl

            read_verilog design.v cells_specify.v
            read_verilog -formal a_step_later.v
            {later}
            hierarchy -check -top {module}
            proc
            flatten
            check -assert
            rename -top gates
            design -stash gates

            design -copy-from rtl rtl
            design -copy-from gates gates
            expose -shared rtl gates
            miter -equiv -make_assert -flatten rtl gates both
            hierarchy -check -top both
            clk2fflogic
            opt_clean
            check -assert
            sat -tempinduct -set-assumes -prove-asserts -maxsteps {steps} -timeout 60 both
            "
        );
        fs::write(folder.join("proof.ys"), script).unwrap();
        let output = Command::new("yosys")
            .args(["-s", "proof.ys"])
            .current_dir(folder)
            .output()
            .unwrap();
        let log = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
        let has = |text: &str| output.status.success() && log.contains(text);
        match (
            has("Induction step proven: SUCCESS!"),
            has("model found for base case: FAIL!"),
        ) {
            (true, false) => Verdict::Proven,
            (false, true) => Verdict::Refuted,
            _ => panic!(
                "neither proven nor refuted: {module} {:?}\n{log}",
                self.config
            ),
        }
    }

    fn prove(&self) {
        let folder = tempfile::tempdir().unwrap();
        self.export(folder.path());
        let verdict = self.verdict(folder.path(), 2);
        let (module, config) = (self.module, &self.config);
        assert_eq!(verdict, Verdict::Proven, "{module} {config:?}");
    }

    /// Exchanges cells of `module` for another one, in turn, and wants a difference within `steps` steps: every fifth cell, or
    /// every one where `GDTOF_CASES` asks for more than usual.
    fn refute_mutants_of(&self, module: &str, steps: usize) {
        let folder = tempfile::tempdir().unwrap();
        self.export(folder.path());
        let file = folder.path().join("design.v");
        let design = fs::read_to_string(&file).unwrap();
        let begin = design.find(&format!("\nmodule {module}(")).unwrap();
        let end = begin + design[begin..].find("\nendmodule").unwrap();
        let apart = if cases::cases(1) > 1 { 1 } else { 5 };
        let cells = design[begin..end].lines();
        let cells = cells.filter_map(|line| Some((line, mutant(line)?)));
        let mut mutants = 0;
        for (line, mutant) in cells.step_by(apart) {
            let text = [
                &design[..begin],
                &design[begin..end].replace(line, &mutant),
                &design[end..],
            ];
            fs::write(&file, text.concat()).unwrap();
            let verdict = self.verdict(folder.path(), steps);
            assert_eq!(verdict, Verdict::Refuted, "{mutant} instead of {line}");
            mutants += 1;
        }
        assert!(mutants > 0, "{module} has no cell");
    }
}

/// A line of the netlist with another cell, where it is one: its gate's counterpart, a multiplexer whose inputs are swapped, a
/// buffer or inverter whose input is stuck at 0, or a flip-flop that is never reset.
fn mutant(line: &str) -> Option<String> {
    const GATES: [(&str, &str); 3] = [("AND2", "OR2"), ("NAND2", "NOR2"), ("XOR2", "XNOR2")];
    let cell = line.trim_start().split(' ').next()?;
    let mut both_ways = GATES.into_iter().flat_map(|(a, b)| [(a, b), (b, a)]);
    let tied = |pin: &str| {
        let (before, net) = line.split_once(pin)?;
        let (_, after) = net.split_once(')')?;
        Some(format!("{before}{pin}1'b0){after}"))
    };
    match cell {
        "MUX2" => {
            let names = [(".A(", ".?("), (".B(", ".A("), (".?(", ".B(")];
            let swap = |line: String, (from, to)| line.replace(from, to);
            Some(names.into_iter().fold(line.to_owned(), swap))
        }
        "INV" | "BUF" => tied(".A("),
        "DFFR" | "DFFSR" => tied(".R("),
        _ => {
            let (_, counterpart) = both_ways.find(|gate| gate.0 == cell)?;
            Some(line.replacen(cell, counterpart, 1))
        }
    }
}

fn yosys_is_here() -> bool {
    tool::is_here("yosys", "no block was proven")
}

/// Sensors with each P-counter of the list and each tap that it has.
fn p_counters() -> Vec<SensorConfig> {
    let mut p_counters = scenario::p_counters();
    // What comes after the borrow is no matter of this block.
    p_counters.dedup_by_key(|&mut (p_counter, tap, _)| (p_counter, tap));
    let sensor = |(p_counter, tap, after_borrow)| SensorConfig {
        p_counter,
        tap,
        after_borrow,
        ..SensorConfig::default()
    };
    p_counters.into_iter().map(sensor).collect()
}

#[test]
fn p_counters_of_9_bits_are_proven_for_all_start_values_and_steps() {
    if !yosys_is_here() {
        return;
    }
    let steps = if cases::cases(1) > 1 {
        &[1, 2, 4, 8][..]
    } else {
        &[1, 8]
    };
    for sensor in p_counters() {
        for &step_periods in steps {
            let config = SensorConfig {
                step_periods,
                ..sensor.clone()
            };
            if config.check().is_ok() {
                Block::p_counter(config).prove();
            }
        }
    }
}

#[test]
fn p_counters_of_2_and_12_bits_are_proven() {
    if !yosys_is_here() {
        return;
    }
    for sensor in p_counters() {
        for counter_bits in [2, 12] {
            let config = SensorConfig {
                counter_bits,
                ..sensor.clone()
            };
            Block::p_counter(config).prove();
        }
    }
}

#[test]
fn correlations_of_up_to_16_spads_are_proven_for_all_inputs() {
    if !yosys_is_here() {
        return;
    }
    for (rows, cols) in [(1, 1), (1, 2), (2, 2), (4, 4)] {
        Block::correlation(rows, cols).prove();
    }
}

#[test]
fn metdcs_are_proven() {
    if !yosys_is_here() {
        return;
    }
    for bins in [1, 16, 64] {
        Block::metdc(bins).prove();
    }
}

#[test]
fn histograms_are_proven() {
    if !yosys_is_here() {
        return;
    }
    for overflow in [Overflow::Saturate, Overflow::Wrap] {
        for bin_bits in [1, 14] {
            Block::histogram(bin_bits, overflow).prove();
        }
    }
}

#[test]
fn no_cell_of_a_p_counter_can_be_exchanged() {
    if !yosys_is_here() {
        return;
    }
    for p_counter in PCounter::ALL {
        let sensor = p_counter.sensor();
        let config = SensorConfig {
            // One more than synchronous segments have.
            counter_bits: 4,
            step_periods: if p_counter.row().has_memory { 2 } else { 1 },
            ..sensor
        };
        Block::p_counter(config).refute_mutants_of("p_counter", 12);
    }
    Block::p_counter(SensorConfig::default()).refute_mutants_of("p_counter_memory", 12);
}

#[test]
fn no_cell_of_correlation_metdc_and_histogram_can_be_exchanged() {
    if !yosys_is_here() {
        return;
    }
    Block::correlation(2, 2).refute_mutants_of("correlation", 1);
    Block::metdc(3).refute_mutants_of("metdc", 12);
    // A bin of two bits is full after three hits.
    for overflow in [Overflow::Saturate, Overflow::Wrap] {
        Block::histogram(2, overflow).refute_mutants_of("bin_counter", 12);
    }
}

#[test]
fn mutants_are_what_they_are_said_to_be() {
    let and = "  AND2 u0(.Z(n1), .A(AND2), .B(b));";
    let mux = "  MUX2 m(.Z(z), .A(a), .B(b), .S(s));";
    let inv = "  INV u1(.Z(n2), .A(n1));";
    let dffr = "  DFFR d(.Q(q), .QN(), .D(d), .CK(c), .R(r));";
    let cases = [
        (and, Some("  OR2 u0(.Z(n1), .A(AND2), .B(b));")),
        (inv, Some("  INV u1(.Z(n2), .A(1'b0));")),
        (mux, Some("  MUX2 m(.Z(z), .B(a), .A(b), .S(s));")),
        (
            dffr,
            Some("  DFFR d(.Q(q), .QN(), .D(d), .CK(c), .R(1'b0));"),
        ),
        ("  wire n1;", None),
    ];
    for (line, expected) in cases {
        assert_eq!(mutant(line).as_deref(), expected);
    }
}
