//! Which cells of a library stand for each [`CellKind`].
//!
//! ```text
//!   DFFR    D ───────────────► D   Q ──┬───────► Q
//!           CK ──────────────► CK      └─ INV ─► QN        a library whose flip-flop has an active-low
//!           R ── INV ────────► RESET_B                     reset and no inverse output
//! ```
//!
//! A gate is any cell with its truth table, whatever its name. The one of least area gives the family, of which others are stronger drives
//! (`family`). What a library lacks is put together from what it has: an AND from NAND and INV, a multiplexer or exclusive OR from four
//! NANDs or NORs, a flip-flop of the other edge or of active-low controls with inverters (`flip_flops`). [`CellMap::notes`] says so.
//! A cell that lacks something is passed over, and [`CellMap::remarks`] says why.

mod family;
mod flip_flops;

use crate::nearest;
use std::cell::RefCell;
use std::collections::HashMap;

use super::candidate::{Candidate, FlipFlop, Role};
use super::cell::CellModel;
use super::error::{KitError, LibertyError, LibertyFault, PassedOver};
use super::function::TruthTable;
use super::kit::LibraryFile;
use super::passed_over::cells_behind;
use super::remark::{CellRemark, LibraryRemark, MadeOf};
use crate::logic::Logic;
use crate::netlist::{CellKind, MAX_INPUTS, MAX_OUTPUTS};

/// Where a pin of a stage gets its signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Source {
    /// An input of the whole.
    Input(usize),
    /// An output of an earlier stage.
    Stage(usize, usize),
    /// A constant.
    Constant(bool),
}

/// One cell of what stands for a kind: drives to choose from, the weakest first.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stage {
    pub drives: Vec<CellModel>,
    /// By input pin of each drive's model, which all have theirs in the same order.
    pub sources: Vec<Source>,
}

/// What stands for a kind of cell.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Recipe {
    pub stages: Vec<Stage>,
    /// What drives each output.
    pub outputs: Vec<Source>,
    /// Input pin and stage of the flip-flop, if it is one.
    pub flip_flop: Option<(usize, FlipFlop)>,
}

/// What cells of a library every kind is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct CellMap {
    pub(super) recipes: Vec<Recipe>,
    /// Kinds that several cells stand for together.
    pub notes: Vec<MadeOf>,
    /// What is odd about the library and matters here: cells that were passed over, and what cells that are used leave out.
    pub remarks: Vec<LibraryRemark>,
}

/// The same while they are found.
#[derive(Default)]
struct Notes {
    made: Vec<MadeOf>,
    remarks: Vec<LibraryRemark>,
}

impl CellMap {
    /// What stands for this kind.
    pub(super) fn recipe(&self, kind: CellKind) -> &Recipe {
        &self.recipes[kind as usize]
    }

    /// Names of the weakest cells that stand for a kind, in order of the signal.
    pub fn cells(&self, kind: CellKind) -> Vec<&str> {
        let stages = self.recipe(kind).stages.iter();
        stages.map(|stage| stage.drives[0].name.as_str()).collect()
    }
}

/// What the library has, and what the user wants of it.
pub(super) struct Maker<'g, 't> {
    files: &'g [LibraryFile<'g, 't>],
    candidates: &'g [Candidate<'g, 't>],
    /// Cells that are no candidates, and why, for what is missing.
    unusable: &'g [PassedOver],
    /// Kinds whose cell is given by name.
    wanted: &'g [(CellKind, String)],
    /// Slowest slew that drives are chosen to keep, fs.
    slowest_slew_fs: f64,
    /// Tables that have been read, by the cell's group.
    models: RefCell<HashMap<*const (), Result<CellModel, LibertyError>>>,
    /// Cells that are not used though they would fit.
    passed_over: RefCell<Vec<PassedOver>>,
}

impl<'g, 't> Maker<'g, 't> {
    pub(super) fn new(
        files: &'g [LibraryFile<'g, 't>],
        candidates: &'g [Candidate<'g, 't>],
        unusable: &'g [PassedOver],
        wanted: &'g [(CellKind, String)],
    ) -> Self {
        let mut maker = Maker {
            files,
            candidates,
            unusable,
            wanted,
            slowest_slew_fs: 0.0,
            models: RefCell::default(),
            passed_over: RefCell::default(),
        };
        maker.slowest_slew_fs = maker.slowest_slew();
        maker
    }

    /// A recipe for every kind.
    ///
    /// # Errors
    /// A kind that nothing can stand for, and wanted cells that are not there, do something else or lack something.
    pub(super) fn make(&self) -> Result<CellMap, KitError> {
        let library = self.files[0].group;
        let error = |fault: LibertyFault| KitError {
            file: 0,
            error: LibertyError::new(library.line, self.with_passed_over(fault)),
        };
        for (kind, name) in self.wanted {
            let found = self.candidates.iter().find(|c| c.name() == name);
            let fits = found.filter(|cell| match (&cell.role, kind.is_flip_flop()) {
                (Role::Gate(function), false) => order(*function, gate_function(*kind)).is_some(),
                (Role::FlipFlop(_), true) => true,
                _ => false,
            });
            let Some(cell) = fits else {
                let alike = nearest(name, self.candidates.iter().map(|c| c.name()));
                let alike = alike.filter(|alike| *alike != name);
                return Err(error(LibertyFault::NoSuchCell {
                    library: library.name().to_owned(),
                    cell: name.clone(),
                    kind: *kind,
                    alike: alike.map(str::to_owned),
                    passed_over: Vec::new(),
                }));
            };
            let file = cell.file;
            self.read_model(cell)
                .map_err(|error| KitError { file, error })?;
        }
        let (mut recipes, mut notes) = (Vec::new(), Notes::default());
        for kind in CellKind::ALL {
            let recipe = if kind.is_flip_flop() {
                self.flip_flop(kind, &mut notes)
            } else {
                self.gate(kind)
            };
            let recipe: Recipe = recipe.ok_or_else(|| {
                error(LibertyFault::NothingToMake {
                    library: library.name().to_owned(),
                    kind,
                    incomplete: self.passed_over.borrow().clone(),
                    passed_over: Vec::new(),
                })
            })?;
            if recipe.stages.len() > 1 {
                let stages = recipe.stages.iter();
                let cells = stages.map(|stage| stage.drives[0].name.clone()).collect();
                notes.made.push(MadeOf { kind, cells });
            }
            recipes.push(recipe);
        }
        let not_used = self.passed_over.take().into_iter();
        notes.remarks.extend(not_used.map(LibraryRemark::NotUsed));
        notes.remarks.extend(remarks(&recipes));
        Ok(CellMap {
            recipes,
            notes: notes.made,
            remarks: notes.remarks,
        })
    }

    /// A fault with the cells that it may be about.
    fn with_passed_over(&self, mut fault: LibertyFault) -> LibertyFault {
        let cells = cells_behind(&fault, self.unusable);
        if let LibertyFault::NoSuchCell { passed_over, .. }
        | LibertyFault::NothingToMake { passed_over, .. } = &mut fault
        {
            *passed_over = cells;
        }
        fault
    }

    fn gate(&self, kind: CellKind) -> Option<Recipe> {
        use CellKind::*;
        use Source::{Input, Stage as Of};
        let inputs: Vec<Source> = (0..kind.inputs().len()).map(Input).collect();
        let function = gate_function(kind);
        if let Some(stage) = self.family(function, Some(kind), &inputs) {
            return chain(vec![Some(stage)]);
        }
        // The same with its output inverted, and an inverter.
        if let Some(first) = self.family(function.inverted(), None, &inputs) {
            return chain(vec![Some(first), self.inverter(Of(0, 0))]);
        }
        match kind {
            Nand2 | Nor2 | And2 | Or2 => {
                // A NOR's inputs and output inverted, and so on.
                let inverters = vec![self.inverter(Input(0)), self.inverter(Input(1))];
                let dual = TruthTable::from_fn(2, |inputs| function.value(!inputs & 0b11));
                let of_inverses = |function| self.family(function, None, &[Of(0, 0), Of(1, 0)]);
                let stages = match of_inverses(dual) {
                    Some(stage) => vec![Some(stage)],
                    None => vec![of_inverses(dual.inverted()), self.inverter(Of(2, 0))],
                };
                chain(inverters.into_iter().chain(stages).collect())
            }
            Xor2 | Xnor2 | Mux2 => {
                let two = [Nand2, Nor2].into_iter();
                two.map(|gate| self.of_four(kind, gate))
                    .find(Option::is_some)?
            }
            _ => None,
        }
    }

    /// An exclusive OR or a multiplexer of four NANDs, or of four NORs, which make the exclusive NOR, and take select and its inverse the
    /// other way round.
    fn of_four(&self, kind: CellKind, gate: CellKind) -> Option<Recipe> {
        use CellKind::*;
        use Source::{Input, Stage as Of};
        let two = |a, b| self.family(gate_function(gate), None, &[a, b]);
        let stages = match (kind, gate) {
            (Mux2, _) => {
                let (select, inverse) = (Input(2), Of(0, 0));
                let is_nand = gate == Nand2;
                let [for_a, for_b] = if is_nand {
                    [inverse, select]
                } else {
                    [select, inverse]
                };
                vec![
                    self.inverter(select),
                    two(Input(0), for_a),
                    two(Input(1), for_b),
                    two(Of(1, 0), Of(2, 0)),
                ]
            }
            _ => {
                let mut stages = vec![
                    two(Input(0), Input(1)),
                    two(Input(0), Of(0, 0)),
                    two(Input(1), Of(0, 0)),
                    two(Of(1, 0), Of(2, 0)),
                ];
                if (kind == Xor2) != (gate == Nand2) {
                    stages.push(self.inverter(Of(3, 0)));
                }
                stages
            }
        };
        chain(stages)
    }

    fn inverter(&self, from: Source) -> Option<Stage> {
        self.family(gate_function(CellKind::Inv), Some(CellKind::Inv), &[from])
    }
}

/// What the cells of recipes leave out, or have that is not used, each with the cells.
fn remarks(recipes: &[Recipe]) -> Vec<LibraryRemark> {
    let mut cells_by_remark: Vec<(&CellRemark, Vec<String>)> = Vec::new();
    let stages = recipes.iter().flat_map(|recipe| &recipe.stages);
    for model in stages.flat_map(|stage| &stage.drives) {
        for remark in &model.remarks {
            let at = cells_by_remark
                .iter()
                .position(|(known, _)| *known == remark);
            let at = at.unwrap_or_else(|| {
                cells_by_remark.push((remark, Vec::new()));
                cells_by_remark.len() - 1
            });
            let cells = &mut cells_by_remark[at].1;
            if !cells.contains(&model.name) {
                cells.push(model.name.clone());
            }
        }
    }
    let of_library = |(remark, cells): (&CellRemark, Vec<String>)| {
        let remark = remark.clone();
        LibraryRemark::Cells { remark, cells }
    };
    cells_by_remark.into_iter().map(of_library).collect()
}

/// Stages of which the last one drives the output; none where one is missing.
fn chain(stages: Vec<Option<Stage>>) -> Option<Recipe> {
    let stages: Vec<Stage> = stages.into_iter().collect::<Option<_>>()?;
    let last = stages.len() - 1;
    Some(Recipe {
        stages,
        outputs: vec![Source::Stage(last, 0)],
        flip_flop: None,
    })
}

const _: () = assert!(MAX_OUTPUTS == 2 && MAX_INPUTS == 4);

/// The truth table of a gate.
fn gate_function(kind: CellKind) -> TruthTable {
    let level = |inputs: u32, pin: usize| match inputs >> pin & 1 {
        1 => Logic::One,
        _ => Logic::Zero,
    };
    TruthTable::from_fn(kind.inputs().len() as u32, |inputs| {
        kind.output(std::array::from_fn(|pin| level(inputs, pin))) == Logic::One
    })
}

/// The order of inputs that makes `own` the function `wanted`: for each input of `own` that of `wanted`.
fn order(own: TruthTable, wanted: TruthTable) -> Option<Vec<usize>> {
    if own.inputs != wanted.inputs {
        return None;
    }
    let orders: &[&[usize]] = match own.inputs {
        1 => &[&[0]],
        2 => &[&[0, 1], &[1, 0]],
        3 => &[
            &[0, 1, 2],
            &[0, 2, 1],
            &[1, 0, 2],
            &[1, 2, 0],
            &[2, 0, 1],
            &[2, 1, 0],
        ],
        _ => return None,
    };
    let fits = |order: &&&[usize]| {
        TruthTable::from_fn(own.inputs, |inputs| {
            let packed = order
                .iter()
                .enumerate()
                .map(|(pin, &input)| (inputs >> input & 1) << pin);
            own.value(packed.sum())
        }) == wanted
    };
    orders.iter().find(fits).map(|order| order.to_vec())
}

#[cfg(test)]
mod tests;
