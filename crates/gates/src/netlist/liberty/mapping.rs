//! Which cells of a library stand for each [`CellKind`].
//!
//! ```text
//!   DFFR    D ───────────────► D   Q ──┬───────► Q
//!           CK ──────────────► CK      └─ INV ─► QN        a library whose flip-flop has an active-low
//!           R ── INV ────────► RESET_B                     reset and no inverse output
//! ```
//!
//! A gate is any cell with its truth table, whatever its name. The one of least area gives the family; others of its name with
//! another number at the end are its stronger drives. What a library lacks is put together from what it has: an AND from
//! NAND and INV, a multiplexer or exclusive OR from four NANDs, a flip-flop of the other edge or of active-low controls with inverters.
//! [`CellMap::notes`] says so.

use super::cell::{Candidate, CellModel, FlipFlop, Role};
use super::error::{LibertyError, Units};
use super::function::TruthTable;
use super::group::Group;
use super::table::Templates;
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
    /// What was put together, and other things to know, one sentence each.
    pub notes: Vec<String>,
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
    pub candidates: &'g [Candidate<'g, 't>],
    pub templates: &'g Templates<'g, 't>,
    pub units: Units,
    pub leakage_unit_w: f64,
    /// Kinds whose cell is given by name.
    pub wanted: &'g [(CellKind, String)],
}

impl<'g, 't> Maker<'g, 't> {
    /// A recipe for every kind.
    ///
    /// # Errors
    /// A library without inverter, NAND or flip-flop with reset, and wanted cells that are not there or do something else.
    pub(super) fn make(&self, library: &Group<'t>) -> Result<CellMap, LibertyError> {
        for (kind, name) in self.wanted {
            let found = self.candidates.iter().find(|c| c.name() == name);
            let fits = found.is_some_and(|cell| match (&cell.role, kind.is_flip_flop()) {
                (Role::Gate(function), false) => order(*function, gate_function(*kind)).is_some(),
                (Role::FlipFlop(_), true) => true,
                _ => false,
            });
            if !fits {
                return Err(LibertyError {
                    line: library.line,
                    message: format!(
                        "the library {} has no cell {name} that does what {} does",
                        library.name(),
                        kind.name()
                    ),
                });
            }
        }
        let mut map = CellMap {
            recipes: Vec::new(),
            notes: Vec::new(),
        };
        for kind in CellKind::ALL {
            let recipe = match kind.is_flip_flop() {
                true => self.flip_flop(kind, &mut map.notes)?,
                false => self.gate(kind)?,
            };
            let recipe = recipe.ok_or_else(|| LibertyError {
                line: library.line,
                message: format!(
                    "the library {} has nothing to make a {} from; give one with an inverter, a 2-input NAND or NOR, and a flip-flop with asynchronous reset (and one with set and reset)",
                    library.name(),
                    kind.name()
                ),
            })?;
            if recipe.stages.len() > 1 {
                let cells: Vec<&str> = recipe
                    .stages
                    .iter()
                    .map(|s| s.drives[0].name.as_str())
                    .collect();
                map.notes
                    .push(format!("{} is made of {}", kind.name(), cells.join(" + ")));
            }
            map.recipes.push(recipe);
        }
        Ok(map)
    }

    fn gate(&self, kind: CellKind) -> Result<Option<Recipe>, LibertyError> {
        use CellKind::*;
        use Source::{Input, Stage as Of};
        let inputs: Vec<Source> = (0..kind.inputs().len()).map(Input).collect();
        if let Some(stage) = self.family(gate_function(kind), Some(kind), &inputs)? {
            return Ok(chain(vec![Some(stage)]));
        }
        // The same with its output inverted, and an inverter.
        let inverse = gate_function(kind).inverted();
        if let Some(first) = self.family(inverse, None, &inputs)? {
            return Ok(chain(vec![Some(first), self.inverter(Of(0, 0))?]));
        }
        let nand = |a, b| self.family(gate_function(Nand2), None, &[a, b]);
        let stages = match kind {
            // A NOR's inputs and output inverted, and the other way round.
            Nand2 | And2 => {
                let nor = self.family(gate_function(Nor2), None, &[Of(0, 0), Of(1, 0)])?;
                let mut stages = vec![self.inverter(Input(0))?, self.inverter(Input(1))?, nor];
                if kind == Nand2 {
                    stages.push(self.inverter(Of(2, 0))?);
                }
                stages
            }
            Nor2 | Or2 => {
                let mut stages = vec![
                    self.inverter(Input(0))?,
                    self.inverter(Input(1))?,
                    nand(Of(0, 0), Of(1, 0))?,
                ];
                if kind == Nor2 {
                    stages.push(self.inverter(Of(2, 0))?);
                }
                stages
            }
            Xor2 | Xnor2 => {
                let mut stages = vec![
                    nand(Input(0), Input(1))?,
                    nand(Input(0), Of(0, 0))?,
                    nand(Input(1), Of(0, 0))?,
                    nand(Of(1, 0), Of(2, 0))?,
                ];
                if kind == Xnor2 {
                    stages.push(self.inverter(Of(3, 0))?);
                }
                stages
            }
            Mux2 => vec![
                self.inverter(Input(2))?,
                nand(Input(0), Of(0, 0))?,
                nand(Input(1), Input(2))?,
                nand(Of(1, 0), Of(2, 0))?,
            ],
            _ => return Ok(None),
        };
        Ok(chain(stages))
    }

    fn inverter(&self, from: Source) -> Result<Option<Stage>, LibertyError> {
        self.family(gate_function(CellKind::Inv), Some(CellKind::Inv), &[from])
    }

    /// Cells of a function, the weakest first, that take their inputs from `sources`.
    fn family(
        &self,
        function: TruthTable,
        kind: Option<CellKind>,
        sources: &[Source],
    ) -> Result<Option<Stage>, LibertyError> {
        let gates = self
            .candidates
            .iter()
            .filter_map(|candidate| match candidate.role {
                Role::Gate(own) => Some((candidate, order(own, function)?)),
                Role::FlipFlop(_) => None,
            });
        let mut gates: Vec<_> = gates.collect();
        let key = |c: &Candidate<'_, '_>| (c.area, stem(c.name()).len());
        gates.sort_by(|(a, _), (b, _)| {
            key(a)
                .partial_cmp(&key(b))
                .expect("finite")
                .then_with(|| a.name().cmp(b.name()))
        });
        let wanted = kind.and_then(|kind| self.wanted.iter().find(|(k, _)| *k == kind));
        if let Some((_, name)) = wanted {
            gates.retain(|(candidate, _)| candidate.name() == name);
        }
        let Some((first, pins)) = gates.first() else {
            return Ok(None);
        };
        let alike = |c: &&(&Candidate<'_, '_>, Vec<usize>)| {
            stem(c.0.name()) == stem(first.name()) && c.0.inputs == first.inputs
        };
        let drives = gates.iter().filter(alike).map(|(c, _)| self.model(c));
        Ok(Some(Stage {
            drives: drives.collect::<Result<_, _>>()?,
            sources: pins.iter().map(|&input| sources[input]).collect(),
        }))
    }

    fn model(&self, candidate: &Candidate<'_, '_>) -> Result<CellModel, LibertyError> {
        CellModel::read(candidate, self.templates, self.units, self.leakage_unit_w)
    }

    /// A flip-flop with reset (and set): the one of least area, its inverters counted.
    fn flip_flop(
        &self,
        kind: CellKind,
        notes: &mut Vec<String>,
    ) -> Result<Option<Recipe>, LibertyError> {
        let Some(inverter) = self.inverter(Source::Input(0))? else {
            return Ok(None);
        };
        let with_set = kind == CellKind::Dffsr;
        let wanted = self.wanted.iter().find(|(k, _)| *k == kind);
        let flip_flops = self
            .candidates
            .iter()
            .filter_map(|candidate| match &candidate.role {
                Role::FlipFlop(roles)
                    if roles.clear.is_some()
                        && (roles.preset.is_some() || !with_set)
                        && wanted.is_none_or(|(_, name)| name == candidate.name()) =>
                {
                    let inverted = [
                        Some(roles.data),
                        Some(roles.clock),
                        roles.clear,
                        roles.preset.filter(|_| with_set),
                    ];
                    let inverted = inverted.into_iter().flatten().filter(|pin| pin.1).count();
                    let missing = usize::from(roles.q.is_none()) + usize::from(roles.qn.is_none());
                    let area =
                        candidate.area + (inverted + missing) as f64 * inverter.drives[0].area;
                    Some((area, candidate, *roles))
                }
                _ => None,
            });
        let least = flip_flops.min_by(|(a, x, _), (b, y, _)| {
            a.partial_cmp(b)
                .expect("finite")
                .then_with(|| x.name().cmp(y.name()))
        });
        let Some((_, chosen, roles)) = least else {
            return Ok(None);
        };
        if with_set {
            let ff = chosen.group.of_kind("ff").next();
            let winner = ff.and_then(|ff| ff.value("clear_preset_var1"));
            if winner != Some("L") {
                notes.push(format!(
                    "with set and reset both active {} is {}; the model's reset wins",
                    chosen.name(),
                    winner.map_or("undefined".to_owned(), |state| format!("{state:?}"))
                ));
            }
        }
        let mut stages = Vec::new();
        // Pins of the kind: D, CK, R, S.
        let mut sources = vec![Source::Constant(false); chosen.inputs.len()];
        let given = [
            Some(roles.data),
            Some(roles.clock),
            roles.clear,
            roles.preset,
        ];
        for (pin, role) in given.into_iter().enumerate() {
            let Some((at, inverted)) = role else { continue };
            sources[at] = match (pin < kind.inputs().len(), inverted) {
                (false, active_low) => Source::Constant(active_low),
                (true, false) => Source::Input(pin),
                (true, true) => {
                    let stage = self.inverter(Source::Input(pin))?;
                    stages.push(stage.expect("there is one"));
                    Source::Stage(stages.len() - 1, 0)
                }
            };
        }
        let alike = self.candidates.iter().filter(|c| {
            let given = wanted.is_none() || c.name() == chosen.name();
            given
                && stem(c.name()) == stem(chosen.name())
                && c.inputs == chosen.inputs
                && c.role == chosen.role
        });
        let mut drives = alike
            .map(|c| self.model(c))
            .collect::<Result<Vec<_>, _>>()?;
        drives.sort_by(|a, b| a.area.total_cmp(&b.area));
        let flip_flop = stages.len();
        stages.push(Stage { drives, sources });
        let mut show = |own: Option<usize>, other: Option<usize>| match (own, other) {
            (Some(output), _) => Ok(Source::Stage(flip_flop, output)),
            (None, other) => {
                let shown = Source::Stage(flip_flop, other.expect("a flip-flop shows its state"));
                stages.push(self.inverter(shown)?.expect("there is one"));
                Ok(Source::Stage(stages.len() - 1, 0))
            }
        };
        let outputs = vec![show(roles.q, roles.qn)?, show(roles.qn, roles.q)?];
        Ok(Some(Recipe {
            stages,
            outputs,
            flip_flop: Some((flip_flop, roles)),
        }))
    }
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

/// A name without the number of its drive: `nand2_4` and `NAND2X4` are of one family.
fn stem(name: &str) -> &str {
    name.trim_end_matches(|c: char| c.is_ascii_digit())
}

/// The truth table of a gate.
fn gate_function(kind: CellKind) -> TruthTable {
    let level = |inputs: u32, pin: usize| match inputs >> pin & 1 {
        1 => Logic::One,
        _ => Logic::Zero,
    };
    TruthTable::of(kind.inputs().len() as u32, |inputs| {
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
        TruthTable::of(own.inputs, |inputs| {
            let packed = order
                .iter()
                .enumerate()
                .map(|(pin, &input)| (inputs >> input & 1) << pin);
            own.at(packed.sum())
        }) == wanted
    };
    orders.iter().find(fits).map(|order| order.to_vec())
}

#[cfg(test)]
mod tests;
