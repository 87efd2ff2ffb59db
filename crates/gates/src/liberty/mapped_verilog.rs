//! The netlist in a library's cells, as flat structural Verilog for synthesis, place-and-route and timing tools.
//!
//! Instances are named by their path in the hierarchy, `a__b` where one cell stands for one of ours and `a__b__0`, `a__b__1`, … where
//! several do. Cells with delays of their own (elements of delay lines, wires) are what their kind is mapped to.

use std::io::{self, Write};

use super::characterised::CharacterisedNetlist;
use super::mapping::Source;
use super::read::Liberty;
use super::verilog_name::in_verilog;
use crate::netlist::{Direction, NetId, Netlist, ScopeId};

const HEAD: &str = "\
// Outputs that nothing reads stay open.
/* verilator lint_off PINMISSING */
/* verilator lint_off DECLFILENAME */
";

/// Writes a netlist in the cells and drives that [`CharacterisedNetlist::new`] chose, as a module of its top's name.
///
/// # Errors
/// Those of the writer.
pub fn write_mapped(
    out: &mut dyn Write,
    netlist: &Netlist,
    library: &Liberty,
    characterised: &CharacterisedNetlist,
) -> io::Result<()> {
    let top = &netlist.scopes()[0];
    let names = names(netlist);
    let of_net = |net: NetId| &names[net.index()];
    let ports: Vec<_> = top.module.port_signals().collect();
    let listed: Vec<&str> = ports
        .iter()
        .map(|(_, signal)| signal.name.as_str())
        .collect();
    out.write_all(HEAD.as_bytes())?;
    writeln!(out, "module {}({});", top.module.name(), listed.join(", "))?;
    let mut is_port = vec![false; netlist.net_count()];
    for (direction, signal) in &ports {
        let keyword = match direction {
            Direction::Input => "input",
            Direction::Output => "output",
        };
        let range = if signal.is_bus {
            format!("[{}:0] ", signal.width() - 1)
        } else {
            String::new()
        };
        writeln!(out, "  {keyword} {range}{};", signal.name)?;
        for net in netlist.signal_nets(top, signal) {
            is_port[net.index()] = true;
        }
    }
    for (name, _) in names.iter().zip(&is_port).filter(|(_, is_port)| !**is_port) {
        writeln!(out, "  wire {name};")?;
    }
    for (id, cell) in netlist.cells_below(ScopeId::TOP).zip(netlist.cells()) {
        let (composite, _) = characterised.instance(netlist, &library.map, id);
        let path = netlist.cell_path(id);
        let inner = |stage: usize, output: usize| format!("\\{path}.{stage}.{output} ");
        let driven = |stage: usize, output: usize| {
            let mut outputs = composite.recipe.outputs.iter().zip(&cell.outputs);
            outputs.find_map(|(source, net)| {
                let net = net.filter(|_| *source == Source::Stage(stage, output))?;
                Some(of_net(net).clone())
            })
        };
        for stage in composite.used() {
            let model = composite.cell(stage);
            let instance = format!("\\{} ", composite.instance_name(&path, stage));
            let mut pins = Vec::new();
            for (output, pin) in model.outputs.iter().enumerate() {
                let net = driven(stage, output);
                if net.is_none() {
                    let is_read = composite.is_read(Source::Stage(stage, output));
                    if is_read {
                        writeln!(out, "  wire {};", inner(stage, output))?;
                    } else {
                        continue;
                    }
                }
                pins.push(format!(
                    ".{}({})",
                    in_verilog(&pin.name),
                    net.unwrap_or_else(|| inner(stage, output))
                ));
            }
            for (pin, source) in model
                .inputs
                .iter()
                .zip(&composite.recipe.stages[stage].sources)
            {
                let net = match *source {
                    Source::Constant(level) => format!("1'b{}", u8::from(level)),
                    Source::Input(pin) => of_net(cell.input(pin)).clone(),
                    Source::Stage(stage, output) => {
                        driven(stage, output).unwrap_or_else(|| inner(stage, output))
                    }
                };
                pins.push(format!(".{}({net})", in_verilog(&pin.name)));
            }
            let cell = in_verilog(&model.name);
            writeln!(out, "  {cell} {instance}({});", pins.join(", "))?;
        }
    }
    writeln!(out, "endmodule")
}

/// A name for each net: a port's, the path, or a number.
pub(super) fn names(netlist: &Netlist) -> Vec<String> {
    let top = &netlist.scopes()[0];
    let mut names: Vec<String> = (0..netlist.net_count())
        .map(|net| match netlist.net_path(NetId::new(net)) {
            Some(path) => format!("\\{path} "),
            None => format!("unnamed_{net}"),
        })
        .collect();
    for (_, signal) in top.module.port_signals() {
        for (bit, net) in netlist.signal_nets(top, signal).enumerate() {
            names[net.index()] = if signal.is_bus {
                format!("{}[{bit}]", signal.name)
            } else {
                signal.name.clone()
            };
        }
    }
    names
}
