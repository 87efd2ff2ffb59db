//! The library cells of `mapped_cells.v`, for tools other than Icarus: Verilator and Yosys read them, and Yosys proves each one equal to the cell that it
//! reads from the Liberty file itself.

use crate::library_chips::{self, MappedChip};
use crate::tool;

use std::path::Path;
use std::process::Command;

use guided_dtof::chip::{SensorConfig, Tdc};

/// Runs `program`, which must succeed; gives what it said.
fn run(folder: &Path, program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program} {arguments:?}: {said}");
    said.into_owned()
}

/// The libraries that are here, and the first one with scan flip-flops alone.
fn libraries() -> Vec<(&'static str, String)> {
    let mut libraries = library_chips::libraries();
    let (_, example) = &libraries[0];
    let scan = example
        .replace("next_state : \"D\";", "next_state : \"(SE * SI) + (!SE * D)\";")
        .replace(
            "    pin (D) {",
            "    pin (SE) { direction : input; capacitance : 0.001; }\n    pin (SI) { direction : input; capacitance : 0.001; }\n    pin (D) {",
        );
    assert!(scan.contains("(SI)") && scan != *example);
    libraries.push(("scan", scan));
    libraries
}

/// The default chip and HSLIDAR's, whose P-counter has flip-flops with set and reset; with a shift register, because its own counter TDC
/// leaves TYPE and THRESHOLD unused, which lint tells.
fn chips() -> [SensorConfig; 2] {
    let hslidar = SensorConfig {
        tdc: Tdc::Clocked,
        ..SensorConfig::clone(&guided_dtof::chip::hslidar())
    };
    [SensorConfig::default(), hslidar]
}

#[test]
fn verilator_reads_them() {
    if !tool::is_here("verilator", "it has not read the library cells") {
        return;
    }
    for (name, text) in libraries() {
        for chip in chips() {
            let mapped = MappedChip::new(&text, chip);
            let lint = ["--lint-only", "-Wall", "--top-module", "macropixel"];
            let files = ["mapped_cells.v", "mapped.v"];
            let said = run(
                mapped.folder.path(),
                "verilator",
                &[&lint[..], &files].concat(),
            );
            assert!(said.trim().is_empty(), "{name}: {said}");
        }
    }
}

/// Inputs of a flip-flop that the library wants to be set where both clear and preset are active. Yosys 0.23 always clears it; so each of the two is tied off
/// in turn there.
fn ties(library: &str, models: &str, cell: &str) -> Vec<String> {
    let of_cell = library.split_once(&format!("cell (\"{cell}\")"));
    let of_cell = of_cell.and_then(|(_, rest)| rest.split("cell (").next());
    if !of_cell.is_some_and(|text| text.contains("clear_preset_var1 : \"H\"")) {
        return vec![String::new()];
    }
    let (_, model) = models.split_once(&format!("module {cell}(")).unwrap();
    let model = model.split("endmodule").next().unwrap();
    let tie = |wire: &str| {
        let mut lines = model.lines().filter(|line| line.contains(wire));
        let line = lines.next().unwrap();
        let pin = line.split(['(', ',', ')']).nth(2).unwrap().trim();
        format!("-set in_{pin} {}", u8::from(line.contains("not ")))
    };
    vec![tie("inner_at_r"), tie("inner_at_s")]
}

/// The levels of inputs that a cell's model does not use, which all its instances are to have, as in `-set in_SE 0`.
fn tied_pins(models: &str, netlist: &str, cell: &str) -> String {
    let (_, model) = models.split_once(&format!("module {cell}(")).unwrap();
    let (ports, body) = model
        .split("endmodule")
        .next()
        .unwrap()
        .split_once(");")
        .unwrap();
    let (_, inputs) = ports.split_once("input ").unwrap();
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let lines = body.lines().filter(|line| !line.contains("inner_unused"));
    let used: Vec<&str> = lines.flat_map(|line| line.split(|c| !is_name(c))).collect();
    let unused = inputs.split(", ").filter(|input| !used.contains(input));
    let instances = netlist.lines();
    let instances = instances.filter(|line| line.trim_start().starts_with(&format!("{cell} ")));
    let instances: Vec<&str> = instances.collect();
    let tie = |input: &str| {
        let level = |level: u8| {
            let pin = format!(".{input}(1'b{level})");
            instances.iter().all(|line| line.contains(&pin))
        };
        let level = [0, 1].into_iter().find(|&own| level(own));
        let level = level.unwrap_or_else(|| panic!("{input} of {cell} is not tied"));
        format!(" -set in_{input} {level}")
    };
    unused.map(tie).collect()
}

/// How many proofs Yosys finds that cells of `mapped_cells.v` are those of `cells.lib`, and how many there should be: what they show is the same after any
/// inputs, from any state.
fn proven(folder: &Path) -> (usize, usize) {
    let library = std::fs::read_to_string(folder.join("cells.lib")).unwrap();
    let models = std::fs::read_to_string(folder.join("mapped_cells.v")).unwrap();
    let netlist = std::fs::read_to_string(folder.join("mapped.v")).unwrap();
    let cells = models
        .lines()
        .filter_map(|line| line.strip_prefix("module "));
    let cells: Vec<&str> = cells.map(|line| line.split('(').next().unwrap()).collect();
    let mut script = String::from(
        "read_liberty -ignore_miss_func cells.lib
proc
design -stash gold
read_verilog mapped_cells.v mapped.v
hierarchy -check -top macropixel
proc
check -assert
design -stash gate
",
    );
    let mut proofs = 0;
    for cell in &cells {
        script += &format!(
            "design -reset
design -copy-from gold -as gold {cell}
design -copy-from gate -as gate {cell}
clk2fflogic
miter -equiv -flatten -ignore_gold_x gold gate miter
hierarchy -top miter
"
        );
        let tied = tied_pins(&models, &netlist, cell);
        for tie in ties(&library, &models, cell) {
            proofs += 1;
            let tie = tie + &tied;
            script += &format!(
                "sat -tempinduct -seq 1 -set-init-undef -set-def-inputs {tie} -prove trigger 0 miter\n"
            );
        }
    }
    std::fs::write(folder.join("prove.ys"), script).unwrap();
    let said = run(folder, "yosys", &["-s", "prove.ys"]);
    (said.matches("step proven: SUCCESS!").count(), proofs)
}

#[test]
fn yosys_proves_them_equal_to_the_library() {
    if !tool::is_here("yosys", "no library cell was proven") {
        return;
    }
    for (name, text) in libraries() {
        for chip in chips() {
            let mapped = MappedChip::new(&text, chip);
            let (proven, all) = proven(mapped.folder.path());
            assert!(proven == all && all >= 8, "{name}: {proven} of {all}");
        }
    }
}

/// The proof fails where a model is wrong.
#[test]
fn yosys_proves_no_other_cells() {
    if !tool::is_here("yosys", "no library cell was mutated") {
        return;
    }
    let (name, text) = library_chips::libraries().swap_remove(0);
    let [_, hslidar] = chips();
    let mapped = MappedChip::new(&text, hslidar);
    let folder = mapped.folder.path();
    let models = mapped.text("mapped_cells.v");
    let (_, all) = proven(folder);
    for (right, wrong) in [
        ("buf inner_at_d", "not inner_at_d"),
        ("buf inner_at_ck", "not inner_at_ck"),
        ("not inner_at_r", "buf inner_at_r"),
        (
            "if (inner_r) inner_state <= 1'b0",
            "if (inner_r) inner_state <= 1'b1",
        ),
        (
            "if (inner_set) inner_state <= 1'b1",
            "if (inner_set) inner_state <= inner_d",
        ),
        ("4'h7;", "4'h6;"),
    ] {
        assert!(models.contains(right), "{name} has no {right}");
        std::fs::write(folder.join("mapped_cells.v"), models.replace(right, wrong)).unwrap();
        let (proven, _) = proven(folder);
        assert!(proven < all, "{wrong}: {proven} of {all}");
    }
}
