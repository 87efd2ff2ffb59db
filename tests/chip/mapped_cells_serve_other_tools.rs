//! The library cells of `mapped_cells.v`, for tools other than Icarus: Verilator and Yosys read them, and Yosys proves each one equal to the cell that it
//! reads from the Liberty file itself.

use crate::library_chips::{self, Mapped};
use crate::tool;

use std::path::Path;
use std::process::Command;

use guided_dtof::chip::SensorConfig;

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

/// The default chip and HSLIDAR's, whose P-counter has flip-flops with set and reset.
fn chips() -> [SensorConfig; 2] {
    [
        SensorConfig::default(),
        SensorConfig::clone(&guided_dtof::chip::hslidar()),
    ]
}

#[test]
fn verilator_reads_them() {
    if !tool::is_here("verilator", "it has not read the library cells") {
        return;
    }
    for (name, text) in library_chips::libraries() {
        for chip in chips() {
            let mapped = Mapped::of(&text, chip);
            // A toggle flip-flop's clock is made of its own output, and outputs that nothing reads stay open.
            let quiet = ["-Wno-UNOPTFLAT", "-Wno-PINMISSING"];
            let lint = [
                "--lint-only",
                "--top-module",
                "macropixel",
                "mapped.v",
                "mapped_cells.v",
            ];
            let said = run(
                mapped.folder.path(),
                "verilator",
                &[&lint[..], &quiet].concat(),
            );
            assert!(said.trim().is_empty(), "{name}: {said}");
        }
    }
}

/// Every gate and flip-flop: what it shows is the same after any inputs, from any state.
#[test]
fn yosys_proves_them_equal_to_the_library() {
    if !tool::is_here("yosys", "no library cell was proven") {
        return;
    }
    for (name, text) in library_chips::libraries() {
        for chip in chips() {
            let mapped = Mapped::of(&text, chip);
            let models = mapped.text("mapped_cells.v");
            let cells = models
                .lines()
                .filter_map(|line| line.strip_prefix("module "));
            let cells: Vec<&str> = cells.map(|line| line.split('(').next().unwrap()).collect();
            assert!(cells.len() >= 8, "{name}: {cells:?}");
            let mut script = String::from(
                "read_liberty -ignore_miss_func cells.lib\nproc\ndesign -stash gold\nread_verilog mapped_cells.v mapped.v\nhierarchy -check -top macropixel\nproc\ncheck -assert\ndesign -stash gate\n",
            );
            for cell in &cells {
                script += &format!(
                    "design -reset\ndesign -copy-from gold -as gold {cell}\ndesign -copy-from gate -as gate {cell}\nclk2fflogic\nmiter -equiv -flatten -ignore_gold_x gold gate miter\nhierarchy -top miter\nsat -verify -tempinduct -seq 1 -set-init-undef -set-def-inputs -prove trigger 0 miter\n"
                );
            }
            std::fs::write(mapped.folder.path().join("prove.ys"), script).unwrap();
            let said = run(mapped.folder.path(), "yosys", &["-s", "prove.ys"]);
            let proven = said.matches("Induction step proven: SUCCESS!").count();
            assert_eq!(proven, cells.len(), "{name}: {said}");
        }
    }
}
