//! The exported netlist with its standard cells in other tools: exported SDF annotates onto it in Icarus Verilog without
//! a warning, cells do what those of our kernel do, Verilator and Yosys read it all. A tool that is absent is skipped,
//! loudly, and must be there in CI.

use crate::cases;
use crate::command::gdtof;
use crate::icarus;
use crate::scenario;
use crate::tool;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use guided_dtof::chip::{PCounter, SensorConfig, array, hslidar_delay_line, quantic4x4};
use guided_dtof::engine::GateSimulation;
use guided_dtof::netlist::{CellKind, Corner, Library, Netlist, ScopeId, Timing};
use guided_dtof::sdf::{Sdf, SdfOptions, annotate, write_library_sdf, write_sdf};
use guided_dtof::stimulus::{StimulusPlan, export_verilog};
use guided_dtof::units::Time;
use guided_dtof::verilog::{write_cells, write_standard_cells};
use icarus::IcarusChanges;
use rand::{SeedableRng, rngs::StdRng};
use scenario::Scenario;

/// Names of a folder's files, sorted.
fn files(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

/// Compares an array whose library delays come from the file that `export sdf` writes; gives what both have seen.
fn compare(scenario: &Scenario) -> IcarusChanges {
    let Scenario {
        config,
        exposure,
        starts,
        ..
    } = scenario;
    let (rows, cols) = (config.rows, config.cols);
    let pulses = scenario.pulses();
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let plan = StimulusPlan::new(config, exposure, cols, starts, &pulses);
    export_verilog(here, config, Some(&plan), None).unwrap();
    fs::write(here.join("chip.toml"), toml::to_string(config).unwrap()).unwrap();
    let exported = gdtof(
        here,
        &[
            "export",
            "sdf",
            "--sensor",
            "chip.toml",
            "--out",
            "chip.sdf",
        ],
    );
    assert!(exported.status.success(), "{exported:?}");
    let said = icarus::simulate(here, &icarus::standard_cells(config.corner), &["-sdf-warn"]);
    assert_eq!(said, "", "every entry finds its path");
    let mut gate = GateSimulation::new(config, exposure, (0, 0), (rows, cols), starts, &pulses);
    let ours = IcarusChanges::by_kernel(&mut gate, cols);
    assert_eq!(
        IcarusChanges::by_testbench(here),
        ours,
        "{starts:?} {config:?}"
    );
    ours
}

#[test]
fn macropixels_annotated_in_icarus_agree_with_our_kernel() {
    if icarus::is_here() {
        let random =
            |seed, rows, cols| scenario::random(&mut StdRng::seed_from_u64(seed), rows, cols);
        for seed in 0..cases::cases(6).into() {
            compare(&random(seed, 1, 1));
        }
        compare(&random(1000, 2, 3));
    }
}

/// Elements are 2.6 ns long, and photons leave pulses down to 0.2 ns on the lines. Closer ones meet in an XOR of their line,
/// where Icarus lets pass what a gate swallows.
#[test]
fn delay_lines_pass_pulses_shorter_than_their_elements() {
    if !icarus::is_here() {
        return;
    }
    let mut photons = 0;
    // One corner, or all where `GDTOF_CASES` asks for more than usual.
    let corners = if cases::cases(1) > 1 { 3 } else { 1 };
    for (seed, corner) in (0..).zip(Corner::ALL).take(corners) {
        let config = SensorConfig {
            rows: 1,
            cols: 1,
            corner,
            ..(*hslidar_delay_line()).clone()
        };
        let mut scenario = scenario::of_sensor(&mut StdRng::seed_from_u64(seed), config);
        for pulses in &mut scenario.pulses {
            let mut last = Time::ZERO;
            pulses.retain(|pulse| {
                let is_apart = pulse.time - last >= Time::from_ps(200);
                last = if is_apart { pulse.time } else { last };
                is_apart
            });
        }
        let seen = compare(&scenario);
        photons += seen.counts.iter().map(|count| count[3]).sum::<i64>();
    }
    assert!(photons > 0, "no photon was counted");
}

/// What is written cell by cell is what an elaborated design has.
#[test]
fn delays_are_written_without_elaborating_the_design() {
    for sensor in [quantic4x4(), hslidar_delay_line()] {
        let config = SensorConfig {
            rows: 2,
            cols: 3,
            ..(*sensor).clone()
        };
        let (top, library) = (array::circuit(&config), Library::generic_40nm());
        let netlist = Netlist::elaborate(&top);
        let corners = Corner::ALL.map(|corner| Timing::nominal(&netlist, &library, corner));
        let options = SdfOptions::default();
        let [mut elaborated, mut streamed] = [Vec::new(), Vec::new()];
        write_sdf(&mut elaborated, &netlist, corners.each_ref(), options).unwrap();
        let cells =
            write_library_sdf(&mut streamed, (&top, top.name()), &library, options).unwrap();
        assert_eq!(cells, netlist.cells().len());
        assert!(elaborated == streamed, "{} bytes", elaborated.len());
        let text = String::from_utf8(streamed).unwrap();
        let sdf = Sdf::parse("chip.sdf", &text).unwrap();
        for (corner, nominal) in Corner::ALL.into_iter().zip(&corners) {
            let mut timing = corners[1].clone();
            annotate(&mut timing, &netlist, &sdf, corner).unwrap();
            for (id, cell) in netlist.cells_below(ScopeId::TOP).zip(netlist.cells()) {
                for (pin, output) in (0..cell.kind.inputs().len())
                    .flat_map(|pin| (0..cell.kind.outputs().len()).map(move |output| (pin, output)))
                {
                    let [read, written] =
                        [&timing, nominal].map(|t| t.cell_delays(id)[pin][output]);
                    assert_eq!(read, written, "{}", netlist.cell_path(id));
                }
            }
        }
    }
}

/// A testbench that changes one pin of every cell at a time, in both models, to one of `levels` (0, 1, x), and prints
/// where their outputs differ.
fn walk(levels: usize) -> String {
    let mut cells = String::new();
    let mut comparisons = String::new();
    for kind in CellKind::ALL {
        let (name, width) = (kind.name(), kind.outputs().len());
        let inputs = kind.inputs().iter().enumerate();
        let inputs: Vec<_> = inputs
            .map(|(i, pin)| format!(".{pin}(pins[{i}])"))
            .collect();
        for model in ["", "EXACT_"] {
            let outputs = kind.outputs().iter().enumerate();
            let outputs = outputs.map(|(i, pin)| format!(".{pin}({model}{name}_out[{i}])"));
            let pins = inputs.iter().cloned().chain(outputs).collect::<Vec<_>>();
            writeln!(cells, "  wire [{}:0] {model}{name}_out;", width - 1).unwrap();
            let pins = pins.join(", ");
            writeln!(cells, "  {model}{name} {model}{name}_under_test({pins});").unwrap();
        }
        writeln!(
            comparisons,
            "      if ({name}_out !== EXACT_{name}_out) $display(\"{name} %b -> %b: %b, not %b\", before, pins, {name}_out, EXACT_{name}_out);"
        )
        .unwrap();
    }
    format!(
        "`timescale 1fs/1fs
module tb;
  reg [3:0] pins, before;
  integer step, pin, level;
{cells}  initial begin
    pins = 0;
    #1000000;
    for (step = 0; step < 20000; step = step + 1) begin
      before = pins;
      pin = $urandom % 4;
      level = $urandom % {levels};
      pins[pin] = level == 2 ? 1'bx : level == 1;
      #1000000;
{comparisons}    end
  end
endmodule
"
    )
}

/// Both models of every cell in the typical corner: files standard.v and exact.v.
fn write_both_models(folder: &Path) {
    let library = Library::generic_40nm();
    let mut text = Vec::new();
    write_standard_cells(&mut text, &library, &BTreeSet::new()).unwrap();
    fs::write(folder.join("standard.v"), &text).unwrap();
    text.clear();
    write_cells(&mut text, &library, Corner::Typ).unwrap();
    let text = String::from_utf8(text).unwrap();
    let text = text.replace("\nmodule ", "\nmodule EXACT_");
    fs::write(folder.join("exact.v"), text).unwrap();
}

#[test]
fn standard_cells_do_what_exact_ones_do() {
    if !icarus::is_here() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    write_both_models(folder.path());
    // Unknown levels are for the models with tables; processes know 0 and 1.
    for (levels, define) in [(3, "-DTABLES"), (2, "-DFUNCTIONAL")] {
        fs::write(folder.path().join("walk.v"), walk(levels)).unwrap();
        let sources = [
            "-gspecify",
            "-Ttyp",
            define,
            "walk.v",
            "standard.v",
            "exact.v",
        ];
        let said = icarus::simulate(folder.path(), &sources, &[]);
        assert_eq!(said, "", "{define}");
    }
}

/// Icarus evaluates no timing checks, so the notifier is moved by hand.
#[test]
fn a_notifier_makes_the_state_unknown_until_the_next_edge() {
    if !icarus::is_here() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    write_both_models(folder.path());
    let bench = "`timescale 1ns/1ns
module tb;
  reg d, ck, r;
  wire [1:0] dffr, dffsr;
  DFFR a(dffr[0], dffr[1], d, ck, r);
  DFFSR b(dffsr[0], dffsr[1], d, ck, r, 1'b0);
  task see; #1 $display(\"%b %b\", dffr, dffsr); endtask
  initial begin
    d = 1; ck = 0; r = 1; see;
    r = 0; ck = 1; see;
    a.notifier = 0; b.notifier = 0; see;
    ck = 0; see;
    ck = 1; see;
    a.notifier = 1; b.notifier = 1; see;
    r = 1; see;
  end
endmodule
";
    fs::write(folder.path().join("bench.v"), bench).unwrap();
    let sources = ["-gspecify", "-Ttyp", "bench.v", "standard.v"];
    let said = icarus::simulate(folder.path(), &sources, &[]);
    let states: Vec<&str> = said.lines().collect();
    let (zero, one, unknown) = ("10 10", "01 01", "xx xx");
    assert_eq!(states, [zero, one, unknown, unknown, one, unknown, zero]);
}

/// Runs `program` in `folder` where it is installed, and wants its silence but for what is `known`.
fn is_silent(folder: &Path, program: &str, arguments: &[&str], known: &str) {
    if !tool::is_here(program, "it has not read the exported netlist") {
        return;
    }
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    let is_silent = text.lines().all(|line| line.is_empty() || line == known);
    assert!(output.status.success() && is_silent, "{text}");
}

/// The netlists of a macropixel with every P-counter.
fn with_every_p_counter(mut check: impl FnMut(&Path)) {
    for p_counter in PCounter::ALL {
        let config = SensorConfig {
            rows: 1,
            cols: 1,
            ..p_counter.sensor()
        };
        let folder = tempfile::tempdir().unwrap();
        export_verilog(folder.path(), &config, None, None).unwrap();
        check(folder.path());
    }
}

#[test]
fn verilator_has_nothing_to_say() {
    let lint = |folder: &Path| {
        let arguments = ["--lint-only", "-Wall", "design.v", "cells_specify.v"];
        is_silent(folder, "verilator", &arguments, "");
    };
    with_every_p_counter(lint);
    let config = SensorConfig {
        rows: 1,
        cols: 1,
        ..(*hslidar_delay_line()).clone()
    };
    let folder = tempfile::tempdir().unwrap();
    export_verilog(folder.path(), &config, None, None).unwrap();
    lint(folder.path());
}

/// What Yosys says of any flip-flop with both set and reset.
const DFFSR: &str = "Warning: Complex async reset for dff `\\state'.";

/// With no loops, no net without a driver or with two, and every flip-flop a flip-flop.
#[test]
fn yosys_reads_it() {
    with_every_p_counter(|folder| {
        let script = "read_verilog design.v cells_specify.v; hierarchy -check -top quantic4x4; proc; \
                      check -assert; flatten; check -assert; select -assert-none t:$dlatch t:$sr";
        is_silent(folder, "yosys", &["-q", "-p", script], DFFSR);
        // The same cells in every chip: their timing is read without the rest.
        let cells = "read_verilog -specify cells_specify.v; hierarchy -check; proc; check -assert";
        is_silent(folder, "yosys", &["-q", "-p", cells], DFFSR);
    });
}

/// Pins depend on every counter: without the readout all of them were cleared away.
#[test]
fn yosys_finds_no_counter_that_does_nothing() {
    with_every_p_counter(|folder| {
        let script = "read_verilog -specify -lib cells_specify.v; read_verilog design.v; hierarchy -check -top quantic4x4; \
                      flatten; opt_clean -purge; select -assert-count 224 c:*.histogram.bin_*.bit_*";
        is_silent(folder, "yosys", &["-q", "-p", script], "");
    });
}

#[test]
fn without_a_stimulus_the_netlist_comes_alone() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let incomplete = gdtof(
        here,
        &["export", "verilog", "--inits", "i.csv", "--out", "v"],
    );
    assert_eq!(incomplete.status.code(), Some(2));
    assert_eq!(files(here), [""; 0]);
    let exported = gdtof(here, &["export", "verilog", "--out", "v"]);
    assert!(exported.status.success(), "{exported:?}");
    let names = ["cells.v", "cells_specify.v", "design.v", "manifest.json"];
    assert_eq!(files(&here.join("v")), names);
}

#[test]
fn the_top_has_the_name_of_the_chip_and_a_fast_clk_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for (sensor, name) in [
        ("quantic4x4", "quantic4x4"),
        ("hslidar", "hslidar"),
        ("hslidar_delay_line", "hslidar"),
    ] {
        let small = ["--rows", "1", "--cols", "1", "--set"];
        for (clk, is_told) in [("200e6", false), ("201e6", name == "hslidar")] {
            let clk = format!("sensor.clk_hz={clk}");
            let sensor_words = ["--sensor", sensor].into_iter().chain(small).chain([&*clk]);
            let sensor_arguments: Vec<&str> = sensor_words.collect();
            let sdf = [
                &["export", "sdf", "--out", "chip.sdf"],
                &sensor_arguments[..],
            ]
            .concat();
            let verilog = [&["export", "verilog", "--out", "v"], &sensor_arguments[..]].concat();
            for arguments in [sdf, verilog] {
                let exported = gdtof(here, &arguments);
                assert!(exported.status.success(), "{exported:?}");
                let said = String::from_utf8(exported.stderr).unwrap();
                assert_eq!(said.contains("200 MHz at most"), is_told, "{said}");
            }
        }
        let read = |file: &str| fs::read_to_string(here.join(file)).unwrap();
        assert!(read("chip.sdf").contains(&format!("(DESIGN \"{name}\")")));
        assert!(read("v/design.v").contains(&format!("\nmodule {name}(\n")));
    }
}

#[test]
fn delays_of_the_whole_chip_are_written_only_when_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let refused = gdtof(here, &["export", "sdf", "--out", "chip.sdf"]);
    let error = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(2), "{error}");
    let says = "64 × 64 macropixels take about 1.86 GB";
    let cure = "--rows 64 --cols 64";
    assert!(error.contains(says) && error.contains(cure), "{error}");
    assert_eq!(error.trim_end().lines().count(), 1, "{error}");
    assert_eq!(files(here), [""; 0]);
}
