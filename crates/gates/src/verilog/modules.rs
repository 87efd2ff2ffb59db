//! The netlist as structural Verilog.
//!
//! One module of Verilog for each module of the hierarchy, each written once. Unnamed nets are wires with a
//! number.

use std::collections::HashSet;
use std::io::{self, Write};
use std::sync::Arc as Shared;

use super::TIMESCALE;
use crate::netlist::{Chain, Direction, Module, Net};

/// What Verilator need not mention with `-Wall`.
const LINT: &str = "
// All modules share this file.
/* verilator lint_off DECLFILENAME */
// A flip-flop has Q and QN, and most need only one of them.
/* verilator lint_off PINCONNECTEMPTY */
// Counts are read by name (histogram.BIN_0), and adders have a last carry, as in the chip.
/* verilator lint_off UNUSED */
";

/// Writes `top` and every module below it, children first, each once.
///
/// # Errors
/// Those of the writer.
///
/// # Example
///
/// ```
/// use femtogate::netlist::{CellKind, ModuleBuilder};
/// use femtogate::verilog::write_modules;
///
/// let mut m = ModuleBuilder::new("top");
/// let (a, z) = (m.input("A"), m.output("Z"));
/// m.cell("inverter", CellKind::Inv, &[a], &[z]);
/// let mut verilog = Vec::new();
/// write_modules(&mut verilog, &m.finish()?)?;
/// let verilog = String::from_utf8(verilog)?;
/// assert!(verilog.contains("module top"));
/// assert!(verilog.contains("INV inverter"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_modules(out: &mut dyn Write, top: &Shared<Module>) -> io::Result<()> {
    write!(out, "{TIMESCALE}{LINT}")?;
    write_below(out, top, &mut HashSet::new())
}

fn write_below(
    out: &mut dyn Write,
    module: &Shared<Module>,
    written: &mut HashSet<String>,
) -> io::Result<()> {
    if !written.insert(module.name().to_owned()) {
        return Ok(());
    }
    for instance in module.instances() {
        write_below(out, &instance.module, written)?;
    }
    write_module(out, module)
}

fn write_module(out: &mut dyn Write, module: &Module) -> io::Result<()> {
    let range = |is_bus: bool, width: usize| {
        if is_bus {
            format!("[{}:0] ", width - 1)
        } else {
            String::new()
        }
    };
    let ports: Vec<String> = module
        .port_signals()
        .map(|(direction, s)| {
            let keyword = match direction {
                Direction::Input => "input",
                Direction::Output => "output",
            };
            format!("  {keyword} {}{}", range(s.is_bus, s.width()), s.name)
        })
        .collect();
    writeln!(
        out,
        "\nmodule {}(\n{}\n);",
        module.name(),
        ports.join(",\n")
    )?;
    for (i, signal) in module.signals().iter().enumerate() {
        if !module.ports().iter().any(|p| p.signal == i) {
            writeln!(
                out,
                "  wire {}{};",
                range(signal.is_bus, signal.width()),
                signal.name
            )?;
        }
    }
    let names = NetNames::new(module);
    for cell in module.cells() {
        let kind = cell.kind;
        let outputs = kind.outputs().iter().zip(&cell.outputs);
        let inputs = kind.inputs().iter().zip(&cell.inputs);
        let pins: Vec<String> = outputs
            .chain(inputs)
            .map(|(pin, &net)| format!(".{pin}({})", names.expression(&[net])))
            .collect();
        let chain = Chain::from_delay(kind, cell.own_delay).map(Chain::module);
        let name = chain.as_deref().unwrap_or(kind.name());
        writeln!(out, "  {name} {}({});", cell.name, pins.join(", "))?;
    }
    for instance in module.instances() {
        let mut rest = &instance.connections[..];
        let mut pins = Vec::new();
        for (_, signal) in instance.module.port_signals() {
            let (nets, after) = rest.split_at(signal.width());
            rest = after;
            pins.push(format!("    .{}({})", signal.name, names.expression(nets)));
        }
        let (child, pins) = (instance.module.name(), pins.join(",\n"));
        writeln!(out, "  {child} {}(\n{pins}\n  );", instance.name)?;
    }
    writeln!(out, "endmodule")
}

/// Names of a module's nets: signal, and bit where the signal is a bus.
struct NetNames<'a> {
    module: &'a Module,
    of_net: Vec<(u32, u32)>,
}

impl<'a> NetNames<'a> {
    fn new(module: &'a Module) -> Self {
        let mut of_net = vec![(0, 0); module.net_count()];
        for (i, signal) in module.signals().iter().enumerate() {
            for (bit, net) in signal.nets().enumerate() {
                of_net[net.index()] = (i as u32, bit as u32);
            }
        }
        NetNames { module, of_net }
    }

    /// A Verilog expression for `nets` (bit 0 first): a name, a slice, or a concatenation.
    fn expression(&self, nets: &[Option<Net>]) -> String {
        // A port is open as a whole or not at all.
        let nets: Vec<Net> = nets.iter().copied().flatten().collect();
        let mut parts = Vec::new();
        let mut i = 0;
        while i < nets.len() {
            let (signal_index, low) = self.of_net[nets[i].index()];
            let mut length = 1;
            while i + length < nets.len()
                && self.of_net[nets[i + length].index()] == (signal_index, low + length as u32)
            {
                length += 1;
            }
            let signal = &self.module.signals()[signal_index as usize];
            parts.push(match (signal.is_bus, length) {
                (false, _) => signal.name.clone(),
                (true, n) if n == signal.width() => signal.name.clone(),
                (true, 1) => format!("{}[{low}]", signal.name),
                (true, n) => format!("{}[{}:{low}]", signal.name, low as usize + n - 1),
            });
            i += length;
        }
        match &parts[..] {
            [] => String::new(),
            [one] => one.clone(),
            many => {
                let reversed: Vec<&str> = many.iter().rev().map(String::as_str).collect();
                format!("{{{}}}", reversed.join(", "))
            }
        }
    }
}
