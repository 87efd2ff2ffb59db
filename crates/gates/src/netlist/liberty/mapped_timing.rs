//! What timing tools need beside the netlist of [`write_mapped`](super::write_mapped): its delays as SDF, its clocks as SDC.

use std::collections::BTreeSet;
use std::io::{self, Write};

use super::characterised::{Characterised, Environment};
use super::mapping::Source;
use super::read::Liberty;
use crate::netlist::{Edge, NetId, Netlist};
use crate::units::Time;

/// Writes the delays of every library cell's arcs as SDF, for the netlist of [`write_mapped`](super::write_mapped): ps, one value.
///
/// # Errors
/// Those of the writer.
pub fn write_mapped_sdf(
    out: &mut dyn Write,
    netlist: &Netlist,
    library: &Liberty,
    characterised: &Characterised,
) -> io::Result<()> {
    let top = netlist.scopes()[0].module.name();
    writeln!(
        out,
        "(DELAYFILE\n(SDFVERSION \"3.0\")\n(DESIGN \"{top}\")\n(DIVIDER /)\n(TIMESCALE 1ps)"
    )?;
    let escaped = |name: &str| {
        let special = |c: char| !(c.is_ascii_alphanumeric() || c == '_');
        name.chars().fold(String::new(), |mut text, c| {
            text.extend(special(c).then_some('\\'));
            text.push(c);
            text
        })
    };
    for index in 0..netlist.cells().len() {
        let (composite, conditions) = characterised.instance(netlist, &library.map, index);
        let path = netlist.cell_path(index);
        for stage in composite.used() {
            let model = composite.cell(stage);
            let instance = escaped(&composite.instance_name(&path, stage));
            writeln!(
                out,
                "(CELL (CELLTYPE \"{}\") (INSTANCE {instance})\n (DELAY (ABSOLUTE",
                model.name
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
                        let (from, to) = (&model.inputs[from].name, &model.outputs[to]);
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
    pub ripple: &'c [usize],
}

/// Writes constraints (SDC) for the netlist of [`write_mapped`](super::write_mapped): the clock, a generated clock at each flip-flop that clocks another, and the
/// slew of every input.
///
/// # Errors
/// Those of the writer.
pub fn write_constraints(
    out: &mut dyn Write,
    netlist: &Netlist,
    library: &Liberty,
    (characterised, environment): (&Characterised, &Environment),
    clocking: Clocking<'_>,
) -> io::Result<()> {
    let Clocking { port, period, .. } = clocking;
    // The library's unit of time is the SDC's: all known here are 1 ns.
    let ns = |fs: f64| fs / 1e6;
    writeln!(out, "set_units -time ns")?;
    writeln!(
        out,
        "set_input_transition {:.9} [all_inputs]",
        ns(environment.input_slew_fs)
    )?;
    writeln!(
        out,
        "create_clock -name {port} -period {:.9} [get_ports {port}]",
        period.as_ns()
    )?;
    writeln!(out, "set_propagated_clock [get_clocks {port}]")?;
    let mut divided: Vec<(NetId, String)> = Vec::new();
    for (index, &cell) in clocking.ripple.iter().enumerate() {
        // What comes back to an earlier one, as LOCAL_STOP does to block COUNTER_CLK, gates a clock and is none.
        let later = clocking.ripple[index + 1..].iter();
        let later: BTreeSet<NetId> = later.map(|&cell| netlist.cells()[cell].inputs[1]).collect();
        let leaf = &netlist.cells()[cell];
        let (composite, _) = characterised.instance(netlist, &library.map, cell);
        let path = netlist.cell_path(cell);
        let Some((stage, pin)) = composite.pin_behind(Source::Input(1)) else {
            continue;
        };
        let source = format!(
            "{}/{}",
            composite.instance_name(&path, stage),
            composite.cell(stage).inputs[pin].name
        );
        let from: Vec<&str> = divided
            .iter()
            .filter(|(net, _)| reaches(netlist, *net, leaf.inputs[1]))
            .map(|(_, name)| name.as_str())
            .collect();
        let master = match from.first() {
            Some(master) => format!(" -master_clock [get_clocks {{{master}}}]"),
            None => String::new(),
        };
        let outputs = leaf.outputs.iter().zip(&composite.recipe.outputs);
        for (&net, &output) in outputs.filter(|(net, _)| net.is_some()) {
            let Source::Stage(stage, pin) = output else {
                continue;
            };
            if !later.iter().any(|&clock| reaches(netlist, net, clock)) {
                continue;
            }
            let at = format!(
                "{}/{}",
                composite.instance_name(&path, stage),
                composite.cell(stage).outputs[pin]
            );
            writeln!(
                out,
                "create_generated_clock -name {{{at}}} -source [get_pins {{{source}}}]{master} -divide_by 2 [get_pins {{{at}}}]"
            )?;
            writeln!(out, "set_propagated_clock [get_clocks {{{at}}}]")?;
            divided.push((net, at));
        }
    }
    Ok(())
}

/// Whether a change of `from` comes to `to` through gates.
fn reaches(netlist: &Netlist, from: NetId, to: NetId) -> bool {
    let mut behind = vec![from];
    let mut seen = BTreeSet::from([from]);
    while let Some(net) = behind.pop() {
        if net == to {
            return true;
        }
        for cell in netlist
            .cells()
            .iter()
            .filter(|cell| !cell.kind.is_flip_flop() && cell.inputs.contains(&net))
        {
            behind.extend(
                cell.outputs
                    .iter()
                    .filter(|net| net.is_some() && seen.insert(**net)),
            );
        }
    }
    false
}
