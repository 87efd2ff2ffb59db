//! Energies within a library's cells and of their loads: a chain of inverters by OpenSTA.

use crate::library_chips;
use crate::tool;

use guided_dtof::liberty::{CharacterisedNetlist, Environment, Liberty, write_mapped};
use guided_dtof::netlist::{CellKind, ModuleBuilder, Netlist, ScopeId};

/// OpenSTA 2.0.17 charges both energies, of rise and fall, at every change; we charge one of them, on average.
#[test]
fn of_a_chain_by_opensta() {
    if !tool::is_here("sta", "no library's energies were compared with OpenSTA") {
        return;
    }
    let is_qflow = |(name, _): &(&str, String)| name.starts_with("osu");
    for (name, text) in library_chips::libraries().into_iter().filter(is_qflow) {
        let library = Liberty::read(&text, &[]).unwrap();
        let mut m = ModuleBuilder::new("chain");
        let mut net = m.input("A");
        for _ in 0..6 {
            net = m.gate(CellKind::Inv, &[net]);
        }
        let netlist = Netlist::elaborate(&m.finish().unwrap());
        let environment = Environment::new(&library);
        let made = CharacterisedNetlist::new(&netlist, &library, &environment);
        let folder = tempfile::tempdir().unwrap();
        let mut verilog = Vec::new();
        write_mapped(&mut verilog, &netlist, &library, &made).unwrap();
        std::fs::write(folder.path().join("mapped.v"), verilog).unwrap();
        std::fs::write(folder.path().join("cells.lib"), &text).unwrap();
        let slew_ns = environment.input_slew_fs * 1e-6;
        let report = library_chips::opensta(
            folder.path(),
            "chain",
            &format!(
                "set_load 0 [get_nets *]\nset_input_transition {slew_ns:.9} [all_inputs]\nset_power_activity -input -activity 1 -duty 0.5\nreport_power -digits 9\n"
            ),
        );
        let total = report.lines().find_map(|line| line.strip_prefix("Total"));
        let words = total
            .unwrap_or_else(|| panic!("{report}"))
            .split_whitespace();
        let theirs: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
        let volt = library.conditions[0].unwrap();
        let [within, loads] = made.energy_j((&netlist, ScopeId::TOP), &library, volt, |_| 1.0);
        // We take the mean of a pin's two slews and of its two capacitances: 0.6 % and 0.2 % at most.
        for (ours, theirs, apart) in [(2.0 * within, theirs[0], 1e-2), (loads, theirs[1], 5e-3)] {
            assert!(
                (ours / theirs - 1.0).abs() < apart,
                "{name}: {ours} {theirs}"
            );
        }
    }
}
