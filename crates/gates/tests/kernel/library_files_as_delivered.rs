//! Library files as foundries deliver them, made from `vectors/liberty/example.lib`: units of other sizes, odd names, capacitances of outputs,
//! delays beyond what can be kept, scan cells. What other tools are given follows.

use crate::tool;

use femtogate::liberty::{
    CharacterisedNetlist, Clocking, Environment, Liberty, LibraryRemark, write_constraints,
    write_mapped, write_mapped_cells, write_mapped_sdf,
};
use femtogate::netlist::{CellId, CellKind, ModuleBuilder, Netlist};
use femtogate::units::Time;

fn text() -> String {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../vectors/liberty/example.lib"
    );
    std::fs::read_to_string(path).unwrap()
}

/// A flip-flop with set and reset, and two inverters behind it.
fn small() -> Netlist {
    let mut m = ModuleBuilder::new("behind");
    let inputs = ["D", "CK", "R", "S"].map(|name| m.input(name));
    let (q, z) = (m.wire("Q"), m.output("Z"));
    let unused = m.wire("QN");
    m.cell("flip_flop", CellKind::Dffsr, &inputs, &[q, unused]);
    let between = m.gate(CellKind::Inv, &[q]);
    m.gate_into(CellKind::Inv, &[between], z);
    Netlist::elaborate(&m.finish().unwrap())
}

/// mapped.v, mapped_cells.v, mapped.sdf and mapped.sdc of a library.
fn files(text: &str) -> [String; 4] {
    let library = Liberty::read(text, &[]).unwrap_or_else(|e| panic!("{}: {e}", e.line));
    let (netlist, environment) = (small(), Environment::new(&library));
    let made = CharacterisedNetlist::new(&netlist, &library, &environment);
    let mut files: [Vec<u8>; 4] = Default::default();
    let [verilog, models, sdf, sdc] = &mut files;
    write_mapped(verilog, &netlist, &library, &made).unwrap();
    write_mapped_cells(models, &netlist, &library, &made).unwrap();
    write_mapped_sdf(sdf, &netlist, &library, &made).unwrap();
    let clocking = Clocking {
        port: "CK",
        period: Time::from_ns(2),
        ripple: &[],
        after_fall: &[("S", Time::from_ns(1))],
    };
    write_constraints(sdc, &netlist, &library, (&made, &environment), clocking).unwrap();
    files.map(|file| String::from_utf8(file).unwrap())
}

/// The number behind a word.
fn number_after(text: &str, word: &str) -> f64 {
    let (_, rest) = text
        .split_once(word)
        .unwrap_or_else(|| panic!("{word}: {text}"));
    rest.split_whitespace().next().unwrap().parse().unwrap()
}

#[test]
fn constraints_are_in_the_librarys_unit_of_time() {
    let [.., sdc] = files(&text());
    let slew_ns = number_after(&sdc, "set_input_transition ");
    for (unit, ns, says) in [
        ("1ns", 1.0, "set_units -time ns\n"),
        ("1ps", 1e-3, "set_units -time ps\n"),
        ("10ps", 1e-2, "# Times are in the library's unit, 10ps.\n"),
        ("100ps", 0.1, "# Times are in the library's unit, 100ps.\n"),
    ] {
        let [.., sdc] = files(&text().replace("\"1ns\"", &format!("\"{unit}\"")));
        assert!(sdc.starts_with(says), "{sdc}");
        assert!(
            (number_after(&sdc, "-period ") * ns - 2.0).abs() < 1e-9,
            "{unit}: {sdc}"
        );
        assert!(
            (number_after(&sdc, "set_input_delay ") * ns - 1.0).abs() < 1e-9,
            "{unit}: {sdc}"
        );
        // Slews of the tables are in that unit, too.
        let slew = number_after(&sdc, "set_input_transition ");
        assert!((slew / slew_ns - 1.0).abs() < 1e-6, "{unit}: {sdc}");
    }
}

#[test]
fn odd_names_of_cells_and_pins_are_escaped() {
    let odd = text()
        .replace("cell (INV_1)", "cell (\"INV\\\\$1\")")
        .replace("cell (DFFSRN_1)", "cell (\"dffsr:1\")")
        .replace("(RN)", "(\"RN[0]\")")
        .replace("\"RN\"", "\"RN[0]\"")
        .replace("!RN", "!RN[0]");
    let odd = odd.replace("\"INV\\\\$1\"", "\"INV$1\"");
    let [verilog, models, sdf, _] = files(&odd);
    assert!(verilog.contains("  \\INV$1  \\"), "{verilog}");
    assert!(verilog.contains("  \\dffsr:1  \\behind"), "{verilog}");
    assert!(verilog.contains(".\\RN[0] ("), "{verilog}");
    assert!(models.contains("module \\INV$1 ("), "{models}");
    assert!(models.contains("primitive \\INV$1_FUNCTION ("), "{models}");
    assert!(sdf.contains("(CELLTYPE \"dffsr:1\")"), "{sdf}");
    assert!(sdf.contains("(IOPATH RN\\[0\\] Q () ("), "{sdf}");
    if tool::is_here("iverilog", "no escaped names were read by Icarus Verilog") {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("mapped.v"), &verilog).unwrap();
        std::fs::write(folder.path().join("cells.v"), &models).unwrap();
        let output = std::process::Command::new("iverilog")
            .args(["-g2005", "-gspecify", "-o", "sim", "cells.v", "mapped.v"])
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    // A keyword is no plain name.
    let [verilog, ..] = files(&text().replace("cell (INV_1)", "cell (not)"));
    assert!(verilog.contains("  \\not  \\"), "{verilog}");
    // A name that no Verilog can have is passed over with its line.
    let broken = text().replace("cell (INV_1)", "cell (\"INV\n1\")");
    let library = Liberty::read(&broken, &[]).unwrap();
    assert!(!library.map.cells(CellKind::Inv).concat().contains('\n'));
    let told = |remark: &LibraryRemark| remark.to_string().contains("Verilog can have no name");
    let remarks = &library.map.remarks;
    assert!(remarks.iter().any(told), "{remarks:?}");
}

/// An output's own capacitance loads it beside its net, as in OpenSTA.
#[test]
fn capacitance_of_outputs_is_a_load() {
    let delays = |text: &str| {
        let library = Liberty::read(text, &[]).unwrap();
        let mut m = ModuleBuilder::new("alone");
        let (a, z) = (m.input("A"), m.output("Z"));
        m.gate_into(CellKind::Inv, &[a], z);
        let netlist = Netlist::elaborate(&m.finish().unwrap());
        let environment = Environment {
            input_slew_fs: 5e3,
            slowest_slew_fs: 1e9,
            wire_ff: 0.0,
        };
        let made = CharacterisedNetlist::new(&netlist, &library, &environment);
        let arc = made.timing.cell_delays(CellId::new(0))[0][0];
        [arc.rise(), arc.fall()].map(|delay| delay.as_fs() as f64)
    };
    let before = delays(&text());
    let with = "pin (Y) {\n    capacitance : 0.01;";
    let after = delays(&text().replace("pin (Y) {", with));
    // 10 fF at 4.2 ns/pF, and what is slower or faster of it.
    for (edge, slower) in [(0, 1.06), (1, 0.94)] {
        let more = after[edge] - before[edge];
        assert!((more - 42e3 * slower).abs() < 2.0, "{before:?} {after:?}");
    }
}

/// Delays are whole femtoseconds from 0 to 4.295 us: what is beyond is told before it is cut off.
#[test]
fn the_extremes_of_delays_are_those_of_the_tables() {
    let extremes = |text: &str| {
        let library = Liberty::read(text, &[]).unwrap();
        let (netlist, environment) = (small(), Environment::new(&library));
        let made = CharacterisedNetlist::new(&netlist, &library, &environment);
        made.extreme_delays(&netlist, &library)
    };
    let [(shortest, _), (longest, of_longest)] = extremes(&text());
    assert!(
        shortest > 0.0 && longest > shortest && longest < 1e6,
        "{shortest} {longest}"
    );
    assert!(of_longest.contains("DFFSRN_1 (line "), "{of_longest}");
    // Inverters that are faster than nothing.
    let (before, inverter) = text()
        .split_once("cell (INV_1) {")
        .map(|(a, b)| (a.to_owned(), b.to_owned()))
        .unwrap();
    let (inverter, after) = inverter.split_once("cell (INV_2) {").unwrap();
    let negative = inverter.replacen("values (\"0.0", "values (\"-9.0", 1);
    let negative = format!("{before}cell (INV_1) {{{negative}cell (INV_2) {{{after}");
    let [(shortest, of_shortest), _] = extremes(&negative);
    assert!(shortest < 0.0, "{shortest}");
    assert!(of_shortest.contains("INV_1 (line "), "{of_shortest}");
}

/// A kit whose flip-flops all have a scan chain: the same chip as of plain ones, with pins tied.
#[test]
fn scan_flip_flops_stand_for_plain_ones() {
    let scan = text()
        .replace("next_state : \"D\";", "next_state : \"(SE * SI) + (!SE * D)\";")
        .replace(
            "    pin (D) {",
            "    pin (SE) { direction : input; capacitance : 0.001; nextstate_type : scan_enable; }\n    pin (SI) { direction : input; capacitance : 0.001; nextstate_type : scan_in; }\n    pin (D) {",
        );
    let [plain, scanned] = [text(), scan].map(|text| files(&text));
    assert!(
        scanned[0].contains(".SE(1'b0), .SI(1'b0)"),
        "{}",
        scanned[0]
    );
    assert_eq!(scanned[2], plain[2], "delays");
    assert_eq!(scanned[3], plain[3]);
}
