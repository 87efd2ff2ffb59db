//! Capacitances of wires as SDC, for the netlist of [`write_mapped`](super::write_mapped), as our delays have them.
//!
//! Timing analysers take a library's `default_wire_load` where nobody says what the wires are. So every net has a load here: none, or
//! `wire_ff` for each pin of ours that it leads to. Nets within what stands for one cell have none.

use std::io::{self, Write};

use super::characterised::Environment;
use super::mapped_verilog::names;
use super::read::Liberty;
use crate::netlist::Netlist;

/// Writes `set_load` for every net that leads somewhere, in the library's unit of capacitance.
pub(super) fn write_wires(
    out: &mut dyn Write,
    netlist: &Netlist,
    library: &Liberty,
    environment: &Environment,
) -> io::Result<()> {
    writeln!(out, "set_load 0 [get_nets *]")?;
    if environment.wire_ff == 0.0 {
        return Ok(());
    }
    let mut pins = vec![0_u32; netlist.net_count()];
    for cell in netlist.cells() {
        for net in cell.input_nets() {
            pins[net.index()] += 1;
        }
    }
    for (name, pins) in names(netlist)
        .iter()
        .zip(pins)
        .filter(|(_, pins)| *pins > 0)
    {
        let load = f64::from(pins) * environment.wire_ff / library.units.load_ff;
        let name = name.trim_start_matches('\\').trim_end();
        writeln!(out, "set_load {load:.9} [get_nets {{{name}}}]")?;
    }
    Ok(())
}
