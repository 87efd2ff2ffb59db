//! A module as Yosys would write it, of its generic cells, without Yosys; and one that Yosys has written.

// Each binary uses its own part of this.
#![allow(dead_code)]

use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

use guided_dtof::chip::SensorConfig;
use guided_dtof::netlist::{CellKind, Direction, Module, NetId, Netlist};
use guided_dtof::settings::Document;

/// The QuantIC4x4 with the counter of the book's chapter.
pub fn lfsr() -> SensorConfig {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/blocks/lfsr_p_counter.json");
    let key = ("p_counter_block".to_owned(), file.to_str().unwrap().into());
    let document = Document::from_table("a test", toml::Table::from_iter([key]));
    SensorConfig::read_document(&document).unwrap()
}

/// The netlist as JSON. Each of our cells is one generic cell; an output QN is an inverter.
pub fn json(module: &Arc<Module>) -> String {
    let netlist = Netlist::elaborate(module);
    // Yosys counts from 2 on.
    let bits = |nets: &[NetId]| {
        let numbers: Vec<String> = nets.iter().map(|n| (n.index() + 2).to_string()).collect();
        format!("[{}]", numbers.join(", "))
    };
    let signal = |name: &str| bits(&netlist.signal(name).unwrap());
    let ports = module.port_signals().map(|(direction, s)| {
        let word = if direction == Direction::Input {
            "input"
        } else {
            "output"
        };
        format!(
            r#""{}": {{"direction": "{word}", "bits": {}}}"#,
            s.name,
            signal(&s.name)
        )
    });
    let names = module.signals().iter().filter(|s| s.is_named);
    let names = names.map(|s| {
        format!(
            r#""{}": {{"hide_name": 0, "bits": {}}}"#,
            s.name,
            signal(&s.name)
        )
    });
    let mut next = netlist.net_count() + 2;
    let mut cells = Vec::new();
    for (index, cell) in netlist.cells().iter().enumerate() {
        let kind = match cell.kind {
            CellKind::Inv => "$_NOT_",
            CellKind::Buf => "$_BUF_",
            CellKind::Nand2 => "$_NAND_",
            CellKind::Nor2 => "$_NOR_",
            CellKind::And2 => "$_AND_",
            CellKind::Or2 => "$_OR_",
            CellKind::Xor2 => "$_XOR_",
            CellKind::Xnor2 => "$_XNOR_",
            CellKind::Mux2 => "$_MUX_",
            CellKind::Dffr => "$_DFF_PP0_",
            CellKind::Dffsr => "$_DFFSR_PPP_",
        };
        let mut pins = String::new();
        for (pin, net) in cell.kind.inputs().iter().zip(cell.input_nets()) {
            let pin = if *pin == "CK" { "C" } else { pin };
            write!(pins, r#""{pin}": {}, "#, bits(&[net])).unwrap();
        }
        let out = match cell.outputs[0] {
            Some(net) => net.index() + 2,
            None => {
                next += 1;
                next - 1
            }
        };
        let pin = if cell.kind.is_flip_flop() { "Q" } else { "Y" };
        let mut add = |name: String, kind: &str, pins: String| {
            cells.push(format!(
                r#""{name}": {{"type": "{kind}", "connections": {{{pins}}}}}"#
            ));
        };
        add(
            format!("$cell${index}"),
            kind,
            format!(r#"{pins}"{pin}": [{out}]"#),
        );
        if let Some(inverted) = cell.outputs[1] {
            let pins = format!(r#""A": [{out}], "Y": {}"#, bits(&[inverted]));
            add(format!("$qn${index}"), "$_NOT_", pins);
        }
    }
    let list = |entries: Vec<String>| entries.join(",\n");
    format!(
        "{{\"modules\": {{\"{}\": {{\"ports\": {{{}}},\n\"cells\": {{{}}},\n\"netnames\": {{{}}}}}}}}}",
        module.name(),
        list(ports.collect()),
        list(cells),
        list(names.collect())
    )
}
