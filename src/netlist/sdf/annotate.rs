//! The delays of a file put into a design.

use std::collections::HashMap;
use std::sync::Arc as Shared;

use super::{DelayPath, Edge, PinEdge, Sdf, SdfCell, SdfDelay, SdfInstance, Skipped};
use crate::files::InputError;
use crate::netlist::cell::{CellKind, MAX_INPUTS};
use crate::netlist::flat::{NetId, Netlist};
use crate::netlist::library::Corner;
use crate::netlist::module::{Direction, Module};
use crate::netlist::timing::Timing;

/// What an annotation did.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Annotation {
    /// Arcs (input pin of a cell, both directions) that got a delay from IOPATH or DEVICE.
    pub arcs: usize,
    /// Input pins that a wire delay was added to.
    pub wires: usize,
    /// Delays that could not be taken over as they are.
    pub notes: Vec<Skipped>,
    /// Longest wire delay left out because it ends at a flip-flop's D, fs.
    pub longest_wire_to_d_fs: i64,
}

const WIRE_TO_D: &str = "wires to D of a flip-flop";
const WIRE_TO_OUTPUT: &str = "wires to outputs of the chip";
const LONGEST_ARC: &str = "arcs with several delays, of which the longest is used";
const UNEQUAL_WIRE: &str = "wires that rise and fall differently into a non-unate arc";

/// Puts the delays of `sdf` in one corner into `timing`: first all arcs in file order, then the wires on top of
/// them. Wires of an earlier annotation count as part of the arcs.
///
/// # Errors
/// Unknown instances, cell types and pins, wires between pins that are not connected, and sums that are
/// negative or beyond 4.29 µs: line, reason and cure. `timing` is then only partly annotated.
pub fn annotate(
    timing: &mut Timing,
    netlist: &Netlist,
    sdf: &Sdf<'_>,
    corner: Corner,
) -> Result<Annotation, InputError> {
    let mut annotator = Annotator {
        index: Index::new(netlist),
        netlist,
        sdf,
        corner,
        wires: HashMap::new(),
        result: Annotation::default(),
    };
    for cell in &sdf.cells {
        annotator.cell(timing, cell)?;
    }
    annotator.add_wires(timing)?;
    Ok(annotator.result)
}

/// Finds cells by path: scopes by their path, cells within a module by name.
struct Index<'n> {
    netlist: &'n Netlist,
    scopes: HashMap<String, usize>,
    cells: HashMap<*const Module, HashMap<&'n str, usize>>,
    of_kind: HashMap<&'static str, Vec<usize>>,
}

impl<'n> Index<'n> {
    fn new(netlist: &'n Netlist) -> Self {
        let mut paths: Vec<String> = Vec::with_capacity(netlist.scopes().len());
        let mut cells = HashMap::new();
        for (index, scope) in netlist.scopes().iter().enumerate() {
            // A parent comes before its children.
            paths.push(match index {
                0 => String::new(),
                _ => join(&paths[scope.parent], &scope.name),
            });
            let of_module = || {
                let names = scope.module.cells().iter().enumerate();
                names.map(|(i, c)| (c.name.as_str(), i)).collect()
            };
            cells
                .entry(Shared::as_ptr(&scope.module))
                .or_insert_with(of_module);
        }
        let mut of_kind: HashMap<&'static str, Vec<usize>> = HashMap::new();
        for (index, cell) in netlist.cells().iter().enumerate() {
            of_kind.entry(cell.kind.name()).or_default().push(index);
        }
        let scopes = paths.into_iter().enumerate().map(|(i, p)| (p, i)).collect();
        Index {
            netlist,
            scopes,
            cells,
            of_kind,
        }
    }

    fn scope(&self, path: &str) -> Option<usize> {
        self.scopes.get(path).copied()
    }

    fn cell(&self, path: &str) -> Option<usize> {
        let (scope, name) = path.rsplit_once('.').unwrap_or(("", path));
        let scope = self.scope(scope)?;
        let module = Shared::as_ptr(&self.netlist.scopes()[scope].module);
        let local = *self.cells.get(&module)?.get(name)?;
        Some(self.netlist.cells_of(scope).start + local)
    }
}

fn join(path: &str, name: &str) -> String {
    if path.is_empty() {
        name.to_owned()
    } else {
        format!("{path}.{name}")
    }
}

/// Delays of one arc by output, by edge of the input, by direction of the output, as far as given.
type ArcSlots = [[[Option<i64>; 2]; 2]; 2];

/// The wire to one input pin.
struct Wire {
    line: usize,
    rise_fs: i64,
    fall_fs: i64,
}

struct Annotator<'n, 's, 'a> {
    netlist: &'n Netlist,
    index: Index<'n>,
    sdf: &'s Sdf<'a>,
    corner: Corner,
    wires: HashMap<(usize, usize), Wire>,
    result: Annotation,
}

impl Annotator<'_, '_, '_> {
    fn error<T>(&self, line: usize, message: impl Into<String>) -> Result<T, InputError> {
        Err(InputError::at(&self.sdf.source, line, message))
    }

    fn note(&mut self, what: &'static str, line: usize) {
        Skipped::count(&mut self.result.notes, what, line);
    }

    fn cell(&mut self, timing: &mut Timing, entry: &SdfCell<'_>) -> Result<(), InputError> {
        let kind = CellKind::ALL
            .into_iter()
            .find(|k| k.name() == entry.cell_type);
        match (&entry.instance, kind) {
            (SdfInstance::Every, None) => self.error(
                entry.line,
                format!(
                    "the library has no cell {}; correct CELLTYPE",
                    entry.cell_type
                ),
            ),
            (SdfInstance::Every, Some(kind)) => {
                let cells = self.index.of_kind.get(kind.name()).cloned();
                for cell in cells.unwrap_or_default() {
                    self.leaf(timing, entry, cell)?;
                }
                Ok(())
            }
            (SdfInstance::Path(path), _) => {
                let (name, wanted) = if let Some(cell) = self.index.cell(path) {
                    let name = self.netlist.cells()[cell].kind.name();
                    if name == entry.cell_type {
                        return self.leaf(timing, entry, cell);
                    }
                    (path.as_ref(), name)
                } else if let Some(scope) = self.index.scope(path) {
                    let name = self.netlist.scopes()[scope].module.name();
                    if name == entry.cell_type {
                        return self.module(entry, path);
                    }
                    (if path.is_empty() { "the top" } else { path }, name)
                } else {
                    return self.error(
                        entry.line,
                        format!(
                            "the chip has no instance {path}; give a path below its top and the right DIVIDER, --rows and --cols"
                        ),
                    );
                };
                self.error(
                    entry.line,
                    format!(
                        "{name} is a {wanted} and no {}; correct CELLTYPE or INSTANCE",
                        entry.cell_type
                    ),
                )
            }
        }
    }

    fn module(&mut self, entry: &SdfCell<'_>, path: &str) -> Result<(), InputError> {
        for delay in &entry.delays {
            match &delay.path {
                DelayPath::Interconnect(from, to) => self.interconnect(path, delay, from, to)?,
                _ => {
                    let message = format!(
                        "{} is a module, which has no delays but INTERCONNECT; name one of its cells",
                        entry.cell_type
                    );
                    return self.error(delay.line, message);
                }
            }
        }
        Ok(())
    }

    fn leaf(
        &mut self,
        timing: &mut Timing,
        entry: &SdfCell<'_>,
        cell: usize,
    ) -> Result<(), InputError> {
        let kind = self.netlist.cells()[cell].kind;
        let mut slots: [ArcSlots; MAX_INPUTS] = Default::default();
        let mut last_line = [entry.line; MAX_INPUTS];
        for delay in &entry.delays {
            match &delay.path {
                DelayPath::IoPath(from, to) => {
                    let pin = self.input(kind, &from.pin, delay.line)?;
                    self.check_arc(kind, pin, from, delay.line)?;
                    let output = self.output(kind, to, delay.line)?;
                    last_line[pin] = delay.line;
                    self.fill(timing, cell, pin, &mut slots[pin][output], from.edge, delay);
                }
                DelayPath::Device(to) => {
                    let outputs = match to {
                        None => 0..kind.outputs().len(),
                        Some(to) => {
                            let output = self.output(kind, to, delay.line)?;
                            output..output + 1
                        }
                    };
                    for pin in (0..kind.inputs().len()).filter(|&p| kind.triggers(p)) {
                        last_line[pin] = delay.line;
                        for output in outputs.clone() {
                            self.fill(timing, cell, pin, &mut slots[pin][output], None, delay);
                        }
                    }
                }
                DelayPath::Port(to) => {
                    let pin = self.input(kind, to, delay.line)?;
                    self.wire(cell, pin, delay);
                }
                DelayPath::Interconnect(..) => {
                    let message = "a cell has no wires inside; move INTERCONNECT to the CELL of its module or of the top";
                    return self.error(delay.line, message);
                }
            }
        }
        let mut delays = *timing.of(cell);
        let mut changed = false;
        for pin in 0..kind.inputs().len() {
            let arc = &mut delays[pin];
            let mut ambiguous = false;
            let mut given = false;
            for (direction, delay) in [&mut arc.rise_fs, &mut arc.fall_fs].into_iter().enumerate() {
                let all = || {
                    slots[pin]
                        .iter()
                        .flat_map(|edges| edges.iter().zip([Edge::Rising, Edge::Falling]))
                        .filter(|(_, edge)| causes(kind, pin, *edge, direction == 0))
                        .filter_map(|(slot, _)| slot[direction])
                };
                let Some(longest) = all().max() else { continue };
                ambiguous |= all().any(|d| d != longest);
                given = true;
                let Ok(fs) = u32::try_from(longest) else {
                    return self.out_of_range(last_line[pin], longest);
                };
                *delay = fs;
            }
            self.result.arcs += given as usize;
            changed |= given;
            if ambiguous {
                self.note(LONGEST_ARC, last_line[pin]);
            }
        }
        if changed && delays != *timing.of(cell) {
            timing.set(cell, delays);
        }
        Ok(())
    }

    /// Enters one delay for the edges it is about.
    fn fill(
        &self,
        timing: &Timing,
        cell: usize,
        pin: usize,
        slots: &mut [[Option<i64>; 2]; 2],
        edge: Option<Edge>,
        delay: &SdfDelay<'_>,
    ) {
        let before = timing.of(cell)[pin];
        let values = [(delay.rise, before.rise_fs), (delay.fall, before.fall_fs)];
        for (of_edge, slot) in [Edge::Rising, Edge::Falling].into_iter().zip(slots) {
            if edge.is_some_and(|e| e != of_edge) {
                continue;
            }
            for (slot, (value, before)) in slot.iter_mut().zip(values) {
                if let Some(fs) = value.at(self.corner) {
                    *slot = Some(if delay.increment {
                        slot.unwrap_or(before as i64) + fs
                    } else {
                        fs
                    });
                }
            }
        }
    }

    fn input(&self, kind: CellKind, name: &str, line: usize) -> Result<usize, InputError> {
        self.pin(kind, kind.inputs(), "input", name, line)
    }

    fn output(&self, kind: CellKind, name: &str, line: usize) -> Result<usize, InputError> {
        self.pin(kind, kind.outputs(), "output", name, line)
    }

    fn pin(
        &self,
        kind: CellKind,
        pins: &[&str],
        side: &str,
        name: &str,
        line: usize,
    ) -> Result<usize, InputError> {
        match pins.iter().position(|p| *p == name) {
            Some(pin) => Ok(pin),
            None => self.error(
                line,
                format!(
                    "{} has no {side} pin {name}; give {}",
                    kind.name(),
                    pins.join(" or ")
                ),
            ),
        }
    }

    /// Refuses arcs of which neither edge does anything.
    fn check_arc(
        &self,
        kind: CellKind,
        pin: usize,
        from: &PinEdge<'_>,
        line: usize,
    ) -> Result<(), InputError> {
        let edges = match from.edge {
            Some(edge) => vec![edge],
            None => vec![Edge::Rising, Edge::Falling],
        };
        let does_something =
            |&edge: &Edge| causes(kind, pin, edge, true) || causes(kind, pin, edge, false);
        if edges.iter().any(does_something) {
            return Ok(());
        }
        let message = match from.edge {
            None => format!("{} of {} changes no output", from.pin, kind.name()),
            Some(_) => format!(
                "this edge of {} of {} changes no output",
                from.pin,
                kind.name()
            ),
        };
        self.error(line, message + "; remove this IOPATH")
    }

    fn interconnect(
        &mut self,
        scope: &str,
        delay: &SdfDelay<'_>,
        from: &str,
        to: &str,
    ) -> Result<(), InputError> {
        let source = self.net_of(scope, from, delay.line, Direction::Input)?;
        let target = join(scope, to);
        if let Some((instance, name)) = target.rsplit_once('.')
            && let Some(cell) = self.index.cell(instance)
        {
            let flat = self.netlist.cells()[cell];
            let pin = self.input(flat.kind, name, delay.line)?;
            if flat.inputs[pin] != source {
                let message = format!("{from} and {to} are not connected; correct one of the two");
                return self.error(delay.line, message);
            }
            self.wire(cell, pin, delay);
            return Ok(());
        }
        self.net_of(scope, to, delay.line, Direction::Output)?;
        self.note(WIRE_TO_OUTPUT, delay.line);
        Ok(())
    }

    /// The net of a cell's output pin, or of a port of the top with this direction.
    fn net_of(
        &self,
        scope: &str,
        path: &str,
        line: usize,
        port: Direction,
    ) -> Result<NetId, InputError> {
        let full = join(scope, path);
        if let Some((instance, name)) = full.rsplit_once('.')
            && let Some(cell) = self.index.cell(instance)
        {
            let flat = self.netlist.cells()[cell];
            let output = self.output(flat.kind, name, line)?;
            return Ok(flat.outputs[output]);
        }
        let signal = full.split('[').next().unwrap_or("");
        let top = &self.netlist.scopes()[0].module;
        let is_port = top
            .port_signals()
            .any(|(direction, s)| direction == port && s.name == signal);
        match self.netlist.net(&full) {
            Some(net) if is_port => Ok(net),
            _ => self.error(
                line,
                format!(
                    "{path} is neither a pin of a cell nor a port of the chip that a wire could have here; correct it"
                ),
            ),
        }
    }

    fn wire(&mut self, cell: usize, pin: usize, delay: &SdfDelay<'_>) {
        let kind = self.netlist.cells()[cell].kind;
        let values = [delay.rise, delay.fall].map(|triple| triple.at(self.corner));
        if !kind.triggers(pin) {
            let longest = values.into_iter().flatten().max().unwrap_or(0);
            self.result.longest_wire_to_d_fs = self.result.longest_wire_to_d_fs.max(longest);
            self.note(WIRE_TO_D, delay.line);
            return;
        }
        let wire = self.wires.entry((cell, pin)).or_insert(Wire {
            line: delay.line,
            rise_fs: 0,
            fall_fs: 0,
        });
        wire.line = delay.line;
        for (member, value) in [&mut wire.rise_fs, &mut wire.fall_fs]
            .into_iter()
            .zip(values)
        {
            if let Some(fs) = value {
                *member = fs + if delay.increment { *member } else { 0 };
            }
        }
    }

    fn add_wires(&mut self, timing: &mut Timing) -> Result<(), InputError> {
        let mut wires: Vec<_> = std::mem::take(&mut self.wires).into_iter().collect();
        // In the order of the file, so that the first mistake is the one reported.
        wires.sort_unstable_by_key(|((cell, pin), wire)| (wire.line, *cell, *pin));
        for ((cell, pin), wire) in wires {
            let kind = self.netlist.cells()[cell].kind;
            let mut delays = *timing.of(cell);
            let arc = &mut delays[pin];
            let mut unequal = false;
            for (delay, rises) in [(&mut arc.rise_fs, true), (&mut arc.fall_fs, false)] {
                let by_edge = [(Edge::Rising, wire.rise_fs), (Edge::Falling, wire.fall_fs)];
                let causes = by_edge
                    .iter()
                    .filter(|(edge, _)| causes(kind, pin, *edge, rises))
                    .map(|(_, fs)| *fs);
                let Some(longest) = causes.clone().max() else {
                    continue;
                };
                unequal |= causes.clone().any(|fs| fs != longest);
                let sum = *delay as i64 + longest;
                let Ok(fs) = u32::try_from(sum) else {
                    return self.out_of_range(wire.line, sum);
                };
                *delay = fs;
            }
            if unequal {
                self.note(UNEQUAL_WIRE, wire.line);
            }
            self.result.wires += 1;
            timing.set(cell, delays);
        }
        Ok(())
    }

    fn out_of_range<T>(&self, line: usize, fs: i64) -> Result<T, InputError> {
        let message =
            format!("the delay becomes {fs} fs; keep what is added up between 0 and 4.29 µs");
        self.error(line, message)
    }
}

/// Whether an edge of an input pin can make an output of the cell rise (or fall). A flip-flop has one delay for
/// Q and Q̄, so that each of its edges causes both.
fn causes(kind: CellKind, pin: usize, edge: Edge, output_rises: bool) -> bool {
    let rises = edge == Edge::Rising;
    match (kind, pin) {
        (CellKind::Inv | CellKind::Nand2 | CellKind::Nor2, _) => rises != output_rises,
        (CellKind::Buf | CellKind::And2 | CellKind::Or2, _) => rises == output_rises,
        (CellKind::Mux2, 0 | 1) => rises == output_rises,
        (CellKind::Xor2 | CellKind::Xnor2 | CellKind::Mux2, _) => true,
        (CellKind::Dffr | CellKind::Dffsr, 0) => false,
        // Releasing the reset does something only where a set is still waiting.
        (CellKind::Dffsr, 2) => true,
        (CellKind::Dffr | CellKind::Dffsr, _) => rises,
    }
}
