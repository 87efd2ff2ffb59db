//! What timing tools need beside the netlist of [`write_mapped`](super::write_mapped): its delays as SDF, its clocks as SDC.

use std::collections::BTreeSet;
use std::io::{self, Write};

use super::characterised::{CharacterisedNetlist, Environment};
use super::mapped_wires::write_wires;
use super::mapping::Source;
use super::read::Liberty;
use super::verilog_name::in_sdf;
use crate::netlist::{CellId, Edge, NetId, Netlist, ScopeId, caused};
use crate::units::Time;

/// Writes the delays of every library cell's arcs as SDF, for the netlist of [`write_mapped`](super::write_mapped): ps, one value.
///
/// # Errors
/// Those of the writer.
pub fn write_mapped_sdf(
    out: &mut dyn Write,
    netlist: &Netlist,
    library: &Liberty,
    characterised: &CharacterisedNetlist,
) -> io::Result<()> {
    let top = netlist.scopes()[0].module.name();
    writeln!(
        out,
        "(DELAYFILE\n(SDFVERSION \"3.0\")\n(DESIGN \"{top}\")\n(DIVIDER /)\n(TIMESCALE 1ps)"
    )?;
    for cell in netlist.cells_below(ScopeId::TOP) {
        let (composite, conditions) = characterised.instance(netlist, &library.map, cell);
        let path = netlist.cell_path(cell);
        for stage in composite.used() {
            let model = composite.cell(stage);
            let instance = in_sdf(&composite.instance_name(&path, stage));
            writeln!(
                out,
                "(CELL (CELLTYPE \"{}\") (INSTANCE {instance})\n (DELAY (ABSOLUTE",
                model.name.replace('"', "\\\"")
            )?;
            let delays = composite.stage_delays(stage, &conditions);
            for from in 0..model.inputs.len() {
                for to in 0..model.outputs.len() {
                    let text = |edge| match delays.get(&(from, to, edge)) {
                        Some(fs) => format!("({:.3})", fs / 1e3),
                        None => "()".to_owned(),
                    };
                    let [rise, fall] = Edge::BOTH.map(text);
                    if rise != "()" || fall != "()" {
                        let (from, to) = (&model.inputs[from].name, &model.outputs[to].name);
                        let (from, to) = (in_sdf(from), in_sdf(to));
                        writeln!(out, "  (IOPATH {from} {to} {rise} {fall})")?;
                    }
                }
            }
            writeln!(out, " ))\n)")?;
        }
    }
    writeln!(out, ")")
}

/// A clock and what divides it.
#[derive(Debug, Clone, Copy)]
pub struct Clocking<'c> {
    /// Input port of the clock.
    pub port: &'c str,
    /// Its period.
    pub period: Time,
    /// Flip-flops that may clock each other, such as a ripple counter's, from the first on.
    pub ripple: &'c [CellId],
    /// Input ports whose rise follows the clock's fall, and by how much.
    pub after_fall: &'c [(&'c str, Time)],
}

/// Writes constraints (SDC) for the netlist of [`write_mapped`](super::write_mapped): the clock, a generated clock at each flip-flop that clocks another, when
/// inputs come, their slew, and what the wires load. Of a ripple's flip-flops one whose output is a port may clock others outside.
///
/// # Errors
/// Those of the writer.
pub fn write_constraints(
    out: &mut dyn Write,
    netlist: &Netlist,
    library: &Liberty,
    (characterised, environment): (&CharacterisedNetlist, &Environment),
    clocking: Clocking<'_>,
) -> io::Result<()> {
    let Clocking { port, period, .. } = clocking;
    // Times are in the library's unit, which SDC can name where it is a single one.
    let in_unit = |fs: f64| fs / library.units.time_fs;
    let (unit, can_be_named) = library.units.time_word();
    if can_be_named {
        writeln!(out, "set_units -time {unit}")?;
    } else {
        writeln!(out, "# Times are in the library's unit, {unit}.")?;
    }
    write_wires(out, netlist, library, environment)?;
    writeln!(
        out,
        "set_input_transition {:.9} [all_inputs]",
        in_unit(environment.input_slew_fs)
    )?;
    writeln!(
        out,
        "create_clock -name {port} -period {:.9} [get_ports {port}]",
        in_unit(period.as_fs() as f64)
    )?;
    writeln!(out, "set_propagated_clock [get_clocks {port}]")?;
    for (input, after) in clocking.after_fall {
        let after = in_unit(after.as_fs() as f64);
        writeln!(
            out,
            "set_input_delay {after:.9} -rise -clock {port} -clock_fall [get_ports {input}]"
        )?;
    }
    let top = &netlist.scopes()[0];
    let ports = top
        .module
        .port_signals()
        .flat_map(|(_, signal)| netlist.signal_nets(top, signal));
    let ports: BTreeSet<NetId> = ports.collect();
    let others = netlist.cells_below(ScopeId::TOP).zip(netlist.cells());
    let others =
        others.filter(|(cell, leaf)| leaf.kind.is_flip_flop() && !clocking.ripple.contains(cell));
    let outside: BTreeSet<NetId> = others.map(|(_, leaf)| leaf.input(1)).collect();
    let mut divided: Vec<(NetId, String)> = Vec::new();
    // Second outputs of flip-flops: what the first one clocks does not meet them.
    let mut second: Vec<usize> = Vec::new();
    for (index, &cell) in clocking.ripple.iter().enumerate() {
        // What comes back to an earlier one, as LOCAL_STOP does to block COUNTER_CLK, gates a clock and is none.
        let later = clocking.ripple[index + 1..].iter();
        let later: BTreeSet<NetId> = later
            .map(|&cell| netlist.cells()[cell.index()].input(1))
            .collect();
        let leaf = &netlist.cells()[cell.index()];
        let (composite, _) = characterised.instance(netlist, &library.map, cell);
        let path = netlist.cell_path(cell);
        let Some((stage, pin)) = composite.pin_behind(Source::Input(1)) else {
            continue;
        };
        let made = divided.iter().find(|(net, _)| {
            Edge::BOTH
                .iter()
                .any(|&edge| reaches(netlist, (*net, edge), leaf.input(1)))
        });
        let (from, at, master) = match made {
            Some((net, name)) => {
                let master = format!(" -master_clock [get_clocks {{{name}}}]");
                (*net, format!("[get_pins {{{name}}}]"), master)
            }
            None => {
                let from = netlist.net(port).expect("the clock's port");
                (from, format!("[get_ports {port}]"), String::new())
            }
        };
        // Timing analysers take the edges of the source as they are there, whatever inverts them on the way.
        let source = if reaches(netlist, (from, Edge::Rise), leaf.input(1)) {
            format!(
                "-source [get_pins {{{}/{}}}]{master} -divide_by 2",
                composite.instance_name(&path, stage),
                composite.cell(stage).inputs[pin].name
            )
        } else {
            format!("-source {at}{master} -edges {{2 4 6}}")
        };
        let (before, outputs) = (
            divided.len(),
            leaf.outputs.iter().zip(&composite.recipe.outputs),
        );
        for (net, &output) in outputs.filter_map(|(&net, output)| Some((net?, output))) {
            let Source::Stage(stage, pin) = output else {
                continue;
            };
            let clocks = |clock: &NetId| {
                Edge::BOTH
                    .iter()
                    .any(|&edge| reaches(netlist, (net, edge), *clock))
            };
            let clocks_outside = ports.contains(&net) && outside.iter().any(clocks);
            if !(clocks_outside || later.iter().any(clocks)) {
                continue;
            }
            let at = format!(
                "{}/{}",
                composite.instance_name(&path, stage),
                composite.cell(stage).outputs[pin].name
            );
            writeln!(
                out,
                "create_generated_clock -name {{{at}}} {source} [get_pins {{{at}}}]"
            )?;
            writeln!(out, "set_propagated_clock [get_clocks {{{at}}}]")?;
            divided.push((net, at));
            if divided.len() > before + 1 {
                second.push(divided.len() - 1);
            }
        }
    }
    for index in second {
        let others = divided.iter().enumerate().skip(index - 1);
        let others = others.filter(|(other, _)| *other != index);
        let others: Vec<&str> = others.map(|(_, (_, name))| name.as_str()).collect();
        let (own, others) = (&divided[index].1, others.join(" "));
        writeln!(
            out,
            "set_clock_groups -physically_exclusive -group [get_clocks {{{own}}}] -group [get_clocks {{{others}}}]"
        )?;
    }
    Ok(())
}

/// Whether an edge of `from` makes `to` rise, through gates.
fn reaches(netlist: &Netlist, from: (NetId, Edge), to: NetId) -> bool {
    let mut behind = vec![from];
    let mut seen = BTreeSet::from([(from.0, from.1 as usize)]);
    while let Some((net, edge)) = behind.pop() {
        if (net, edge) == (to, Edge::Rise) {
            return true;
        }
        for cell in netlist
            .cells()
            .iter()
            .filter(|cell| !cell.kind.is_flip_flop())
        {
            for pin in (0..cell.kind.inputs().len()).filter(|&pin| cell.input(pin) == net) {
                let after = caused(cell.kind, pin, edge, 0).iter();
                let after = after.filter_map(|&edge| Some((cell.outputs[0]?, edge)));
                behind.extend(after.filter(|&(net, edge)| seen.insert((net, edge as usize))));
            }
        }
    }
    false
}
