//! Delays and timing checks of a design as SDF text.

use std::borrow::Cow;
use std::io::{self, Write};

use super::limits::checks_of;
use super::{PinEdge, SdfCheck, Triple, join};
use crate::Origin;
use crate::netlist::{
    ArcDelay, Cell, CellDelays, CellKind, Chain, Corner, Edge, InstanceLimits, Library, MAX_INPUTS,
    MAX_OUTPUTS, Module, Netlist, ScopeId, Timing,
};
use crate::units::Time;

/// What stands between the names of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum SdfDivider {
    /// `a.b`
    #[default]
    Dot,
    /// `a/b`
    Slash,
}

impl SdfDivider {
    fn symbol(self) -> char {
        match self {
            SdfDivider::Dot => '.',
            SdfDivider::Slash => '/',
        }
    }
}

/// The unit of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
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
    /// The program that the file names as its writer.
    pub origin: Origin,
}

/// Writes every cell of `netlist` with its delays and timing checks in the three corners (fast, typical, slow).
///
/// # Errors
/// Those of the writer.
///
/// # Example
///
/// ```
/// use femtogate::netlist::{CellKind, Corner, Library, ModuleBuilder, Netlist, Timing};
/// use femtogate::sdf::{Sdf, SdfOptions, write_sdf};
///
/// let mut m = ModuleBuilder::new("top");
/// let (a, z) = (m.input("A"), m.output("Z"));
/// m.cell("inverter", CellKind::Inv, &[a], &[z]);
/// let netlist = Netlist::elaborate(&m.finish()?);
/// let library = Library::generic_40nm();
/// let corners = Corner::ALL.map(|corner| Timing::nominal(&netlist, &library, corner));
/// let mut text = Vec::new();
/// write_sdf(&mut text, &netlist, corners.each_ref(), SdfOptions::default())?;
///
/// let text = String::from_utf8(text)?;
/// let sdf = Sdf::parse("top.sdf", &text)?;
/// assert_eq!((sdf.cells.len(), &*sdf.cells[0].cell_type), (1, "INV"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_sdf(
    out: &mut dyn Write,
    netlist: &Netlist,
    corners: [&Timing; 3],
    options: SdfOptions,
) -> io::Result<()> {
    let design = netlist.scopes()[0].module.name();
    write_head(out, design, options)?;
    for (index, scope) in netlist.scopes().iter().enumerate() {
        let id = ScopeId::new(index);
        // Paths start below the top.
        let path = netlist.scope_path(id);
        let path = path[design.len()..].trim_start_matches('.');
        for (cell, leaf) in netlist.cells_of(id).zip(scope.module.cells()) {
            let delays = corners.map(|timing| *timing.cell_delays(cell));
            let limits = corners.map(|timing| timing.limits(cell, leaf.kind));
            write_cell(out, &join(path, &leaf.name), leaf, delays, limits, options)?;
        }
    }
    writeln!(out, ")")
}

/// Writes every cell below `top` with the library's delays and limits, or with the delays that are its own: what
/// [`write_sdf`] writes of [`Timing::nominal`], without elaborating the design, so that memory does not grow with it.
/// `design` is what the file calls it. Gives the number of cells.
///
/// # Errors
/// Those of the writer.
pub fn write_library_sdf(
    out: &mut dyn Write,
    (top, design): (&Module, &str),
    library: &Library,
    options: SdfOptions,
) -> io::Result<usize> {
    // All cells of a kind are alike: their text is made once.
    let bodies = CellKind::ALL.map(|kind| {
        let delays = Corner::ALL.map(|corner| library.delays(kind, corner));
        let limits =
            Corner::ALL.map(|corner| InstanceLimits::from_library(library.checks(kind), corner));
        body(kind, delays, Some(limits.each_ref()), options)
    });
    let mut cells = 0;
    write_head(out, design, options)?;
    write_below(top, "", &mut |path, leaf| {
        let (kind, path) = (leaf.kind, join(path, &leaf.name));
        cells += 1;
        let Some(own) = leaf.own_delay else {
            return write_entry(out, kind.name(), &path, &bodies[kind as usize], options);
        };
        let whole = join(top.name(), &path);
        let delays = Corner::ALL.map(|corner| own.delays(|| whole.clone(), corner));
        let limits =
            Corner::ALL.map(|corner| InstanceLimits::from_library(library.checks(kind), corner));
        write_cell(out, &path, leaf, delays, limits.each_ref(), options)
    })?;
    writeln!(out, ")")?;
    Ok(cells)
}

/// Hands over every cell with the path it lies in, in the order of a netlist's scopes.
fn write_below(
    module: &Module,
    path: &str,
    write: &mut dyn FnMut(&str, &Cell) -> io::Result<()>,
) -> io::Result<()> {
    for cell in module.cells() {
        write(path, cell)?;
    }
    for child in module.instances() {
        write_below(&child.module, &join(path, &child.name), write)?;
    }
    Ok(())
}

fn write_head(out: &mut dyn Write, design: &str, options: SdfOptions) -> io::Result<()> {
    let divider = options.divider.symbol();
    let unit = match options.timescale {
        SdfTimescale::Fs => "fs",
        SdfTimescale::Ps => "ps",
    };
    let Origin {
        program, version, ..
    } = options.origin;
    write!(
        out,
        "(DELAYFILE\n  (SDFVERSION \"3.0\")\n  (DESIGN \"{design}\")\n  (PROGRAM \"{program}\")\n  (VERSION \"{version}\")\n  (DIVIDER {divider})\n  (TIMESCALE 1{unit})\n"
    )
}

/// The entry of one cell at a path, or of each stage of the chain that it is.
fn write_cell(
    out: &mut dyn Write,
    path: &str,
    leaf: &Cell,
    delays: [CellDelays; 3],
    limits: [&InstanceLimits; 3],
    options: SdfOptions,
) -> io::Result<()> {
    let kind = leaf.kind;
    let Some(chain) = Chain::from_delay(kind, leaf.own_delay) else {
        let body = body(kind, delays, Some(limits), options);
        return write_entry(out, kind.name(), path, &body, options);
    };
    let mut parts = delays.map(|delays| {
        let ArcDelay { rise_fs, fall_fs } = delays[0][0];
        chain.parts(rise_fs).zip(chain.parts(fall_fs))
    });
    for number in 0..chain.stages {
        let delays = parts.each_mut().map(|parts| {
            let (rise_fs, fall_fs) = parts.next().expect("a part for each stage");
            [[ArcDelay { rise_fs, fall_fs }; MAX_OUTPUTS]; MAX_INPUTS]
        });
        let stage = join(path, &Chain::stage(number));
        let body = body(kind, delays, None, options);
        write_entry(out, &chain.stage_module(), &stage, &body, options)?;
    }
    Ok(())
}

fn write_entry(
    out: &mut dyn Write,
    cell_type: &str,
    path: &str,
    body: &str,
    options: SdfOptions,
) -> io::Result<()> {
    let path = match options.divider {
        SdfDivider::Dot => Cow::from(path),
        SdfDivider::Slash => path.replace('.', "/").into(),
    };
    writeln!(
        out,
        "  (CELL (CELLTYPE \"{cell_type}\") (INSTANCE {path})\n{body}"
    )
}

/// What an entry says of its cell: delays and, where it has limits, checks.
fn body(
    kind: CellKind,
    delays: [CellDelays; 3],
    limits: Option<[&InstanceLimits; 3]>,
    options: SdfOptions,
) -> String {
    let timescale = options.timescale;
    let mut text = "    (DELAY (ABSOLUTE\n".to_owned();
    for (pin, name) in kind.inputs().iter().enumerate() {
        if !kind.triggers(pin) {
            continue;
        }
        let from = pin_edge(&PinEdge {
            edge: (kind.is_flip_flop() && pin == 1).then_some(Edge::Rise),
            pin: (*name).into(),
        });
        for (number, output) in kind.outputs().iter().enumerate() {
            let arcs = delays.map(|delays| delays[pin][number]);
            let rise = triple(
                Triple(arcs.map(|arc| Some(Time::from_fs(arc.rise_fs.into())))),
                timescale,
            );
            let fall = triple(
                Triple(arcs.map(|arc| Some(Time::from_fs(arc.fall_fs.into())))),
                timescale,
            );
            text += &format!("      (IOPATH {from} {output} {rise} {fall})\n");
        }
    }
    text += "    ))";
    if let Some(limits) = limits.filter(|_| kind.is_flip_flop()) {
        text += "\n    (TIMINGCHECK\n";
        for check in &checks_of(kind, limits) {
            text += &format!("      {}\n", check_entry(check, timescale));
        }
        text += "    )";
    }
    text + ")"
}

fn check_entry(check: &SdfCheck<'_>, timescale: SdfTimescale) -> String {
    let mut words = vec![check.kind.keyword().to_owned(), pin_edge(&check.pin)];
    words.extend(check.reference.as_ref().map(pin_edge));
    let limits = check.limits[..check.kind.limits()].iter();
    words.extend(limits.map(|&limit| triple(limit, timescale)));
    format!("({})", words.join(" "))
}

fn pin_edge(pin: &PinEdge<'_>) -> String {
    match pin.edge {
        None => pin.pin.to_string(),
        Some(Edge::Rise) => format!("(posedge {})", pin.pin),
        Some(Edge::Fall) => format!("(negedge {})", pin.pin),
    }
}

fn triple(triple: Triple, timescale: SdfTimescale) -> String {
    let number = |time: Option<Time>| match (time.map(Time::as_fs), timescale) {
        (None, _) => String::new(),
        (Some(fs), SdfTimescale::Fs) => fs.to_string(),
        (Some(fs), SdfTimescale::Ps) => {
            let sign = if fs < 0 { "-" } else { "" };
            let fs = fs.unsigned_abs();
            format!("{sign}{}.{:03}", fs / 1000, fs % 1000)
        }
    };
    match triple.0 {
        [None, None, None] => "()".to_owned(),
        [min, typ, max] if min == typ && typ == max => format!("({})", number(typ)),
        members => format!("({})", members.map(number).join(":")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_of_a_triple_are_written_where_they_differ() {
        let text = |members: [Option<i64>; 3], timescale| {
            let members = members.map(|fs| fs.map(Time::from_fs));
            triple(Triple(members), timescale)
        };
        let (fs, ps) = (SdfTimescale::Fs, SdfTimescale::Ps);
        assert_eq!(text([Some(1_250); 3], ps), "(1.250)");
        assert_eq!(text([Some(1), Some(2), Some(2)], fs), "(1:2:2)");
        assert_eq!(text([Some(1), Some(1), Some(2)], fs), "(1:1:2)");
        assert_eq!(text([Some(1), Some(2), Some(1)], fs), "(1:2:1)");
        assert_eq!(text([None, Some(-7), None], ps), "(:-0.007:)");
        assert_eq!(text([Some(0); 3], ps), "(0.000)");
        assert_eq!(text([None; 3], fs), "()");
    }
}
