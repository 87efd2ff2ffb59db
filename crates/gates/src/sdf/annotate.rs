//! The delays and limits of a file put into a design.

use std::collections::HashMap;

use super::error::{SdfError, SdfFault, SdfPart, pins};
use super::skipped::{SkippedEntry, SkippedKind};
use super::{DelayPath, PinEdge, Sdf, SdfCell, SdfDelay, SdfInstance};
use crate::netlist::{
    ArcDelay, CellId, CellKind, Chain, Corner, Direction, Edge, MAX_INPUTS, Netlist, Timing,
};
use crate::units::Time;

/// What an annotation did.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Annotation {
    /// Arcs (input and output pin of a cell, both directions) that got a delay from IOPATH or DEVICE.
    pub arcs: usize,
    /// Input pins that a wire delay was added to.
    pub wires: usize,
    /// Timing checks of single instances whose limits were taken over.
    pub checks: usize,
    /// Delays and limits that could not be taken over as they are.
    pub notes: Vec<SkippedEntry>,
    /// Longest wire delay left out because it ends at a flip-flop's D.
    pub longest_wire_to_d: Time,
}

impl Annotation {
    /// Whether nothing of the file was taken over.
    pub fn is_empty(&self) -> bool {
        self.arcs + self.wires + self.checks == 0
    }
}

/// Puts delays and limits of `sdf` in one corner into `timing`: first all arcs in file order, then the wires on top of
/// them. Wires of an earlier annotation count as part of the arcs.
///
/// # Errors
/// Unknown instances, cell types and pins, wires between pins that are not connected, and sums that are
/// negative or beyond 4.29 µs, each with its line. `timing` is then only partly annotated.
///
/// # Example
///
/// ```
/// use femtogate::netlist::{
///     CellKind, Corner, Edge, Library, ModuleBuilder, Netlist, StaticTiming, Timing,
/// };
/// use femtogate::sdf::{Sdf, annotate};
/// use femtogate::units::Time;
///
/// let mut m = ModuleBuilder::new("top");
/// let (a, z) = (m.input("A"), m.output("Z"));
/// m.cell("inverter", CellKind::Inv, &[a], &[z]);
/// let netlist = Netlist::elaborate(&m.finish()?);
/// let [a, z] = ["A", "Z"].map(|name| netlist.net(name).unwrap());
/// let mut timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
///
/// let text = r#"(DELAYFILE (SDFVERSION "3.0") (TIMESCALE 1ps)
///   (CELL (CELLTYPE "INV") (INSTANCE inverter)
///     (DELAY (ABSOLUTE (IOPATH A Z (60.0) (50.0)))))
/// )"#;
/// let sdf = Sdf::parse("layout.sdf", text)?;
/// assert_eq!(annotate(&mut timing, &netlist, &sdf, Corner::Typ)?.arcs, 1);
/// let arrivals = StaticTiming::new(&netlist, &timing).arrivals(&[(a, Edge::Rise)], &[])?;
/// assert_eq!(arrivals.window(z).unwrap().1, Time::from_ps(50));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn annotate(
    timing: &mut Timing,
    netlist: &Netlist,
    sdf: &Sdf<'_>,
    corner: Corner,
) -> Result<Annotation, SdfError> {
    let mut annotator = Annotator {
        netlist,
        of_kind: cells_by_kind(netlist),
        sdf,
        corner,
        wires: HashMap::new(),
        stages: Stages::new(),
        result: Annotation::default(),
    };
    for cell in &sdf.cells {
        annotator.cell(timing, cell)?;
    }
    annotator.add_stages(timing)?;
    annotator.add_wires(timing)?;
    Ok(annotator.result)
}

fn cells_by_kind(netlist: &Netlist) -> HashMap<CellKind, Vec<CellId>> {
    let mut cells: HashMap<CellKind, Vec<CellId>> = HashMap::new();
    for (index, cell) in netlist.cells().iter().enumerate() {
        cells.entry(cell.kind).or_default().push(CellId::new(index));
    }
    cells
}

/// Delays of one arc by output, by edge of the input, by direction of the output, as far as given.
type ArcSlots = [[[Option<i64>; 2]; 2]; 2];

/// Delays of the stages (rise, fall, fs) by cell, and the line of the last of them.
pub(super) type Stages = HashMap<CellId, (Vec<[i64; 2]>, usize)>;

/// The wire to one input pin.
pub(super) struct Wire {
    pub(super) line: usize,
    pub(super) rise_fs: i64,
    pub(super) fall_fs: i64,
}

pub(super) struct Annotator<'n, 's, 'a> {
    pub(super) netlist: &'n Netlist,
    of_kind: HashMap<CellKind, Vec<CellId>>,
    sdf: &'s Sdf<'a>,
    pub(super) corner: Corner,
    pub(super) wires: HashMap<(CellId, usize), Wire>,
    pub(super) stages: Stages,
    pub(super) result: Annotation,
}

impl Annotator<'_, '_, '_> {
    pub(super) fn error<T>(&self, line: usize, fault: SdfFault) -> Result<T, SdfError> {
        Err(SdfError {
            source_name: self.sdf.source.clone(),
            line,
            fault,
        })
    }

    pub(super) fn note(&mut self, what: SkippedKind, line: usize) {
        SkippedEntry::count(&mut self.result.notes, what, line);
    }

    fn cell(&mut self, timing: &mut Timing, entry: &SdfCell<'_>) -> Result<(), SdfError> {
        let kind = CellKind::ALL
            .into_iter()
            .find(|k| k.name() == entry.cell_type);
        match (&entry.instance, kind) {
            (SdfInstance::Every, None) => {
                let cell_type = entry.cell_type.to_owned();
                self.error(entry.line, SdfFault::UnknownCellType { cell_type })
            }
            (SdfInstance::Every, Some(kind)) => {
                let cells = self.of_kind.get(&kind).cloned();
                for cell in cells.unwrap_or_default() {
                    self.leaf(timing, entry, cell)?;
                }
                Ok(())
            }
            (SdfInstance::Path(path), _) => {
                let actual = if let Some(cell) = self.netlist.cell(path) {
                    let name = self.netlist.cells()[cell.index()].kind.name();
                    if name == entry.cell_type {
                        return self.leaf(timing, entry, cell);
                    }
                    name
                } else if let Some(stage) = Chain::find(self.netlist, path) {
                    return self.stage(timing, entry, stage);
                } else if let Some(scope) = self.netlist.scope(path) {
                    let name = self.netlist.scopes()[scope.index()].module.name();
                    if name == entry.cell_type {
                        return self.module(entry, path);
                    }
                    name
                } else {
                    let fault = SdfFault::UnknownInstance {
                        alternative: self.alternative_path(path),
                        path: path.to_string(),
                    };
                    return self.error(entry.line, fault);
                };
                let part = if path.is_empty() {
                    SdfPart::Top
                } else {
                    SdfPart::Instance(path.to_string())
                };
                let (actual, stated) = (actual.to_owned(), entry.cell_type.to_owned());
                let fault = SdfFault::WrongCellType {
                    part,
                    actual,
                    stated,
                };
                self.error(entry.line, fault)
            }
        }
    }

    /// The instance that a path may mean: with the other divider, or below a testbench.
    fn alternative_path(&self, path: &str) -> Option<String> {
        let dotted = path.replace("\\.", ".").replace('/', ".");
        let mut rest = Some(dotted.as_str());
        let mut below = std::iter::from_fn(|| {
            let path = rest?;
            rest = path.split_once('.').map(|(_, below)| below);
            Some(path)
        });
        let is_there = |path: &&str| {
            let is_cell = self.netlist.cell(path).is_some();
            !path.is_empty() && (is_cell || self.netlist.scope(path).is_some())
        };
        below.find(is_there).map(str::to_owned)
    }

    fn module(&mut self, entry: &SdfCell<'_>, path: &str) -> Result<(), SdfError> {
        for delay in &entry.delays {
            match &delay.path {
                DelayPath::Interconnect(from, to) => self.interconnect(path, delay, from, to)?,
                _ => {
                    let module = entry.cell_type.to_owned();
                    return self.error(delay.line, SdfFault::DelayOfModule { module });
                }
            }
        }
        Ok(())
    }

    fn leaf(
        &mut self,
        timing: &mut Timing,
        entry: &SdfCell<'_>,
        cell: CellId,
    ) -> Result<(), SdfError> {
        self.limits(timing, entry, cell)?;
        let kind = self.netlist.cells()[cell.index()].kind;
        let mut slots: [ArcSlots; MAX_INPUTS] = Default::default();
        let mut last_line = [entry.line; MAX_INPUTS];
        for delay in &entry.delays {
            match &delay.path {
                DelayPath::IoPath(from, to) => {
                    let pin = self.input(kind, &from.pin, delay.line)?;
                    self.check_arc(kind, pin, from, delay.line)?;
                    let output = self.output(kind, to, delay.line)?;
                    last_line[pin] = delay.line;
                    let before = timing.cell_delays(cell)[pin][output];
                    self.fill(before, &mut slots[pin][output], from.edge, delay);
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
                            let before = timing.cell_delays(cell)[pin][output];
                            self.fill(before, &mut slots[pin][output], None, delay);
                        }
                    }
                }
                DelayPath::Port(to) => {
                    let pin = self.input(kind, to, delay.line)?;
                    self.wire(cell, pin, delay);
                }
                DelayPath::Interconnect(..) => {
                    return self.error(delay.line, SdfFault::WireInCell);
                }
            }
        }
        let mut delays = *timing.cell_delays(cell);
        let mut changed = false;
        let outputs = kind.outputs().len();
        for (pin, output) in (0..kind.inputs().len() * outputs).map(|n| (n / outputs, n % outputs))
        {
            let arc = &mut delays[pin][output];
            let mut ambiguous = false;
            let mut given = false;
            for (direction, delay) in [&mut arc.rise_fs, &mut arc.fall_fs].into_iter().enumerate() {
                let all = || {
                    (slots[pin][output].iter().zip(Edge::BOTH))
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
                self.note(SkippedKind::SeveralDelays, last_line[pin]);
            }
        }
        if changed && delays != *timing.cell_delays(cell) {
            timing.set(cell, delays);
        }
        Ok(())
    }

    /// Enters one delay for the edges it is about.
    fn fill(
        &self,
        before: ArcDelay,
        slots: &mut [[Option<i64>; 2]; 2],
        edge: Option<Edge>,
        delay: &SdfDelay<'_>,
    ) {
        let values = [(delay.rise, before.rise_fs), (delay.fall, before.fall_fs)];
        for (of_edge, slot) in Edge::BOTH.into_iter().zip(slots) {
            if edge.is_some_and(|e| e != of_edge) {
                continue;
            }
            for (slot, (value, before)) in slot.iter_mut().zip(values) {
                if let Some(fs) = value.in_corner(self.corner).map(Time::as_fs) {
                    *slot = Some(if delay.increment {
                        slot.unwrap_or(before as i64) + fs
                    } else {
                        fs
                    });
                }
            }
        }
    }

    pub(super) fn input(&self, kind: CellKind, name: &str, line: usize) -> Result<usize, SdfError> {
        self.pin(kind, Direction::Input, name, line)
    }

    pub(super) fn output(
        &self,
        kind: CellKind,
        name: &str,
        line: usize,
    ) -> Result<usize, SdfError> {
        self.pin(kind, Direction::Output, name, line)
    }

    fn pin(
        &self,
        kind: CellKind,
        direction: Direction,
        name: &str,
        line: usize,
    ) -> Result<usize, SdfError> {
        let mut pins = pins(kind, direction).iter();
        match pins.position(|pin| *pin == name) {
            Some(pin) => Ok(pin),
            None => {
                let fault = SdfFault::UnknownPin {
                    kind,
                    direction,
                    pin: name.to_owned(),
                };
                self.error(line, fault)
            }
        }
    }

    /// Refuses arcs of which neither edge does anything.
    fn check_arc(
        &self,
        kind: CellKind,
        pin: usize,
        from: &PinEdge<'_>,
        line: usize,
    ) -> Result<(), SdfError> {
        let edges = match from.edge {
            Some(edge) => vec![edge],
            None => Edge::BOTH.to_vec(),
        };
        let does_something =
            |&edge: &Edge| causes(kind, pin, edge, true) || causes(kind, pin, edge, false);
        if edges.iter().any(does_something) {
            return Ok(());
        }
        let fault = SdfFault::NoEffect {
            kind,
            pin: from.pin.to_string(),
            edge: from.edge,
        };
        self.error(line, fault)
    }

    pub(super) fn out_of_range<T>(&self, line: usize, fs: i64) -> Result<T, SdfError> {
        let delay = Time::from_fs(fs);
        self.error(line, SdfFault::DelayOutOfRange { delay })
    }
}

/// Whether the delay to a rising (or falling) output of the cell matters to an edge of an input pin. A flip-flop's
/// outputs may become unknown with any of its edges, after the shorter of both delays.
pub(super) fn causes(kind: CellKind, pin: usize, edge: Edge, output_rises: bool) -> bool {
    let rises = edge == Edge::Rise;
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
