//! Delays and timing checks of a design as SDF text.

use std::io::{self, Write};

use super::limits::checks_of;
use super::{Edge, PinEdge, SdfCheck, Triple};
use crate::netlist::flat::Netlist;
use crate::netlist::timing::Timing;

/// What stands between the names of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SdfDivider {
    /// `a.b`
    #[default]
    Dot,
    /// `a/b`
    Slash,
}

/// The unit of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SdfTimescale {
    /// Femtoseconds, whole numbers.
    Fs,
    /// Picoseconds with three decimals: the same resolution.
    #[default]
    Ps,
}

/// How a file is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SdfOptions {
    /// Between names.
    pub divider: SdfDivider,
    /// Unit of numbers.
    pub timescale: SdfTimescale,
}

/// Writes every cell of `netlist` with its delays and timing checks in the three corners (fast, typical, slow).
///
/// # Errors
/// Those of the writer.
pub fn write_sdf(
    out: &mut dyn Write,
    netlist: &Netlist,
    corners: [&Timing; 3],
    options: SdfOptions,
) -> io::Result<()> {
    let divider = match options.divider {
        SdfDivider::Dot => '.',
        SdfDivider::Slash => '/',
    };
    let unit = match options.timescale {
        SdfTimescale::Fs => "fs",
        SdfTimescale::Ps => "ps",
    };
    let design = netlist.scopes()[0].module.name();
    let version = env!("CARGO_PKG_VERSION");
    write!(
        out,
        "(DELAYFILE\n  (SDFVERSION \"3.0\")\n  (DESIGN \"{design}\")\n  (PROGRAM \"gdtof\")\n  (VERSION \"{version}\")\n  (DIVIDER {divider})\n  (TIMESCALE 1{unit})\n"
    )?;
    for (index, scope) in netlist.scopes().iter().enumerate() {
        let mut path = netlist.scope_path(index);
        // Paths start below the top.
        path = path[design.len()..].trim_start_matches('.').to_owned();
        if !path.is_empty() {
            path.push('.');
        }
        if divider != '.' {
            path = path.replace('.', "/");
        }
        for (cell, leaf) in netlist.cells_of(index).zip(scope.module.cells()) {
            write!(
                out,
                "  (CELL (CELLTYPE \"{}\") (INSTANCE {path}{})\n    (DELAY (ABSOLUTE\n",
                leaf.kind.name(),
                leaf.name
            )?;
            let kind = leaf.kind;
            for (pin, name) in kind.inputs().iter().enumerate() {
                if !kind.triggers(pin) {
                    continue;
                }
                let from = PinEdge {
                    edge: (kind.is_flip_flop() && pin == 1).then_some(Edge::Rising),
                    pin: (*name).into(),
                };
                for (number, output) in kind.outputs().iter().enumerate() {
                    let arcs = corners.map(|timing| timing.of(cell)[pin][number]);
                    let rise = arcs.map(|arc| Some(arc.rise_fs as i64));
                    let fall = arcs.map(|arc| Some(arc.fall_fs as i64));
                    write!(out, "      (IOPATH ")?;
                    write_pin(out, &from)?;
                    write!(out, " {output} ")?;
                    write_triple(out, Triple(rise), options.timescale)?;
                    write!(out, " ")?;
                    write_triple(out, Triple(fall), options.timescale)?;
                    writeln!(out, ")")?;
                }
            }
            write!(out, "    ))")?;
            if kind.is_flip_flop() {
                let checks = checks_of(kind, corners.map(|timing| timing.limits(cell, kind)));
                write!(out, "\n    (TIMINGCHECK\n")?;
                for check in &checks {
                    write!(out, "      ")?;
                    write_check(out, check, options.timescale)?;
                    writeln!(out)?;
                }
                write!(out, "    )")?;
            }
            writeln!(out, ")")?;
        }
    }
    writeln!(out, ")")
}

fn write_check(
    out: &mut dyn Write,
    check: &SdfCheck<'_>,
    timescale: SdfTimescale,
) -> io::Result<()> {
    write!(out, "({} ", check.kind.keyword())?;
    write_pin(out, &check.pin)?;
    if let Some(reference) = &check.reference {
        write!(out, " ")?;
        write_pin(out, reference)?;
    }
    for &limit in &check.limits[..check.kind.limits()] {
        write!(out, " ")?;
        write_triple(out, limit, timescale)?;
    }
    write!(out, ")")
}

fn write_pin(out: &mut dyn Write, pin: &PinEdge<'_>) -> io::Result<()> {
    match pin.edge {
        None => write!(out, "{}", pin.pin),
        Some(Edge::Rising) => write!(out, "(posedge {})", pin.pin),
        Some(Edge::Falling) => write!(out, "(negedge {})", pin.pin),
    }
}

fn write_triple(out: &mut dyn Write, triple: Triple, timescale: SdfTimescale) -> io::Result<()> {
    let number = |fs: Option<i64>| match (fs, timescale) {
        (None, _) => String::new(),
        (Some(fs), SdfTimescale::Fs) => fs.to_string(),
        (Some(fs), SdfTimescale::Ps) => {
            let sign = if fs < 0 { "-" } else { "" };
            let fs = fs.unsigned_abs();
            format!("{sign}{}.{:03}", fs / 1000, fs % 1000)
        }
    };
    match triple.0 {
        [None, None, None] => write!(out, "()"),
        [min, typ, max] if min == typ && typ == max => write!(out, "({})", number(typ)),
        members => write!(out, "({})", members.map(number).join(":")),
    }
}
