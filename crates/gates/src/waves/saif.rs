//! Switching activity files: SAIF 2.0 (IEEE 1801, annex on the switching activity interchange format), backward, as power
//! tools read them.
//!
//! Every net of every scope is there under each of its names, those that never change and those that the builder numbered
//! included: names are the ones of the exported Verilog. T0 + T1 + TX is the duration for each. TX has Z, too. The counts are
//! of edges, two a pulse; what is a glitch is this crate's definition:
//!
//! * TC: changes between 0 and 1, one through X once. All that happens, glitches let through included.
//! * TG: those of them that are extra on the way to a steady value ([`NetActivity::transport_glitch_edges`]). Only on request:
//!   there are readers whose grammar has no TG (OpenSTA's), and they refuse the file.
//! * IG: what an inertial delay takes away or makes X, and is not in TC ([`NetActivity::inertial_glitch_edges`]).

use std::io::{self, Write};

use crate::Origin;
use crate::kernel::NetActivity;
use crate::netlist::Netlist;
use crate::units::Time;

/// Writes what `nets` did, by net of `netlist`, in `duration`; TG only with `transport_glitches`. `origin` is the program that the
/// file names as its writer.
///
/// # Errors
/// Those of `out`.
///
/// # Example
///
/// ```
/// use femtogate::Origin;
/// use femtogate::kernel::{Activity, Drive, Kernel, Stimulus};
/// use femtogate::netlist::{CellKind, Corner, Library, ModuleBuilder, Netlist, Timing};
/// use femtogate::units::Time;
/// use femtogate::waves::write_saif;
///
/// let mut m = ModuleBuilder::new("top");
/// let (a, z) = (m.input("A"), m.output("Z"));
/// m.cell("inverter", CellKind::Inv, &[a], &[z]);
/// let netlist = Netlist::elaborate(&m.finish()?);
/// let a = netlist.net("A").unwrap();
/// let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
/// let mut activity = Activity::new(&netlist, Time::ZERO);
/// let mut stimulus = Stimulus::new([Drive::new(Time::from_ns(1), a, true)]);
/// let end = Time::from_ns(2);
/// Kernel::new(&netlist, &timing).run(&mut stimulus, end, &mut activity)?;
/// let mut saif = Vec::new();
/// write_saif(&mut saif, &netlist, &activity.net_activity(end), end, false, Origin::default())?;
/// assert!(String::from_utf8(saif)?.contains("(DURATION 2000000)"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_saif(
    out: &mut dyn Write,
    netlist: &Netlist,
    nets: &[NetActivity],
    duration: Time,
    transport_glitches: bool,
    origin: Origin,
) -> io::Result<()> {
    let top = &netlist.scopes()[0].name;
    writeln!(out, "(SAIFILE")?;
    writeln!(out, "(SAIFVERSION \"2.0\")")?;
    writeln!(out, "(DIRECTION \"backward\")")?;
    writeln!(out, "(DESIGN \"{top}\")")?;
    writeln!(out, "(VENDOR \"{}\")", origin.vendor)?;
    writeln!(out, "(PROGRAM_NAME \"{}\")", origin.program)?;
    writeln!(out, "(VERSION \"{}\")", origin.version)?;
    writeln!(out, "(DIVIDER / )")?;
    writeln!(out, "(TIMESCALE 1 fs)")?;
    writeln!(out, "(DURATION {})", duration.as_fs())?;
    // Ends of the subtrees that are open.
    let mut open: Vec<usize> = Vec::new();
    for (index, scope) in netlist.scopes().iter().enumerate() {
        while open.last().is_some_and(|&end| end <= index) {
            open.pop();
            writeln!(out, ")")?;
        }
        open.push(index + scope.subtree);
        writeln!(out, "(INSTANCE {}", scope.name)?;
        let signals = scope.module.signals();
        if signals.is_empty() {
            continue;
        }
        writeln!(out, "(NET")?;
        for signal in signals {
            for (bit, net) in netlist.signal_nets(scope, signal).enumerate() {
                write!(out, "({}", signal.name)?;
                if signal.is_bus {
                    write!(out, "\\[{bit}\\]")?;
                }
                let found = &nets[net.index()];
                let [low, high, unknown] = [found.low, found.high, found.unknown].map(Time::as_fs);
                write!(
                    out,
                    " (T0 {low}) (T1 {high}) (TX {unknown}) (TC {})",
                    found.toggles
                )?;
                if transport_glitches {
                    write!(out, " (TG {})", found.transport_glitch_edges)?;
                }
                writeln!(out, " (IG {}))", found.inertial_glitch_edges)?;
            }
        }
        writeln!(out, ")")?;
    }
    for _ in open {
        writeln!(out, ")")?;
    }
    writeln!(out, ")")
}
