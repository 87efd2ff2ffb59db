//! Families: cells of one function and the same pins, which are drives of each other, whatever they are called.
//!
//! ```text
//!   INV_X1   area 0.5   drives 12 fF ─► weakest
//!   INV_X2   area 0.8   drives 25 fF ─► next
//!   DLY_X1   area 1.6   drives 12 fF    left out: no stronger than a smaller one
//!   INV_X8   area 2.7   drives 98 fF ─► strongest
//! ```
//!
//! A cell's strength is measured in its tables: the load at which the slew it makes, from one as slow, is the slowest that drives are
//! chosen to keep. That is eight of the smallest inverter's kind on the smallest inverter. A larger cell is a drive of its own only if it
//! is stronger. So cells that delay on purpose are none.

use super::super::candidate::{Candidate, Role};
use super::super::cell::CellModel;
use super::super::error::{LibertyError, PassedOver, PassedOverReason};
use super::{Maker, Source, Stage, gate_function, order};
use crate::liberty::function::TruthTable;
use crate::netlist::CellKind;

impl Maker<'_, '_> {
    /// A candidate's tables, read once; none, with a reason for the user, of a cell that lacks something.
    pub(super) fn model(&self, candidate: &Candidate<'_, '_>) -> Option<CellModel> {
        let known = self.read_model(candidate);
        match known {
            Ok(model) => Some(model),
            Err(error) => {
                self.pass_over(candidate, error);
                None
            }
        }
    }

    /// The same.
    ///
    /// # Errors
    /// What it lacks.
    pub(super) fn read_model(
        &self,
        candidate: &Candidate<'_, '_>,
    ) -> Result<CellModel, LibertyError> {
        let mut models = self.models.borrow_mut();
        let read = || CellModel::read(candidate, &self.files[candidate.file]);
        models
            .entry(std::ptr::from_ref(candidate.group).cast())
            .or_insert_with(read)
            .clone()
    }

    /// Keeps for the user why a cell is not used.
    pub(super) fn pass_over(&self, candidate: &Candidate<'_, '_>, error: LibertyError) {
        let file = &self.files[candidate.file];
        let why = PassedOverReason::Faulty(Box::new(error));
        let cell = PassedOver::new(file, candidate.group, why);
        let mut passed_over = self.passed_over.borrow_mut();
        if !passed_over.contains(&cell) {
            passed_over.push(cell);
        }
    }

    /// Cells of a function, the weakest first, that take their inputs from `sources`.
    pub(super) fn family(
        &self,
        function: TruthTable,
        kind: Option<CellKind>,
        sources: &[Source],
    ) -> Option<Stage> {
        let wanted = kind.and_then(|kind| self.wanted.iter().find(|(k, _)| *k == kind));
        let gates = self.candidates.iter().filter_map(|c| match c.role {
            Role::Gate(own) if wanted.map_or(!c.dont_use, |(_, name)| c.name() == name) => {
                let pins = order(own, function)?;
                Some((c, self.model(c)?, pins))
            }
            _ => None,
        });
        let mut gates: Vec<_> = gates.collect();
        gates.sort_by(|(_, a, _), (_, b, _)| a.by_size(b));
        let (first, _, pins) = gates.first()?;
        let alike = gates.iter().filter(|(c, ..)| c.pins() == first.pins());
        let models: Vec<CellModel> = alike.map(|(_, model, _)| model.clone()).collect();
        Some(Stage {
            sources: pins.iter().map(|&input| sources[input]).collect(),
            drives: drives(models, self.slowest_slew_fs),
        })
    }

    /// The slowest slew that drives are chosen to keep, by the library's inverters; 0 if it has none.
    pub(super) fn slowest_slew(&self) -> f64 {
        let inverters = || {
            self.family(
                gate_function(CellKind::Inv),
                Some(CellKind::Inv),
                &[Source::Input(0)],
            )
        };
        let first = inverters().map(|stage| stage.drives[0].settled_slew(8.0));
        first.unwrap_or(0.0)
    }
}

impl CellModel {
    /// Smaller ones first; of equal ones that with the plainer name.
    pub(super) fn by_size(&self, other: &Self) -> std::cmp::Ordering {
        let by_area = self.area.total_cmp(&other.area);
        let by_name = (self.name.len(), &self.name).cmp(&(other.name.len(), &other.name));
        by_area.then(by_name)
    }

    /// The slowest slew of its outputs for a slew at every input and a load on each output: fs, fF.
    fn slew(&self, slew_fs: f64, load_ff: f64) -> f64 {
        let slews = self.arcs.iter().map(|arc| {
            let own = self.outputs[arc.to].load_ff[arc.effect as usize];
            arc.slew.interpolate(slew_fs, own + load_ff)
        });
        slews.fold(0.0, f64::max)
    }

    /// Slew in a chain of such cells of one input, each of which drives the given number of its kind, fs.
    pub(in super::super) fn settled_slew(&self, fan_out: f64) -> f64 {
        // Eight stages are settled.
        (0..8).fold(0.0, |slew: f64, _| {
            let slews = self.arcs.iter().map(|arc| {
                let edge = arc.effect as usize;
                let load = fan_out * self.inputs[0].load_ff[edge] + self.outputs[0].load_ff[edge];
                arc.slew.interpolate(slew, load)
            });
            slews.fold(0.0, f64::max)
        })
    }

    /// The load at which its slew is as slow as that at its inputs, fF.
    fn strength(&self, slew_fs: f64) -> f64 {
        let (mut low, mut high) = (0.0, 1e5);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.slew(slew_fs, middle) <= slew_fs {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }
}

/// How much stronger a drive is at least than the next weaker one. Buffers of equal drive differ by up to 1 % (gf180mcu), and neighbouring drives
/// of asap7, gf180mcu, gt2, sg13g2 and sky130 by 3 % and more.
const STRONGER: f64 = 1.02;

/// Those of a family's cells that are drives, the weakest first.
pub(super) fn drives(mut cells: Vec<CellModel>, slowest_slew_fs: f64) -> Vec<CellModel> {
    cells.sort_by(CellModel::by_size);
    let mut drives: Vec<(CellModel, f64)> = Vec::new();
    for cell in cells {
        let strength = cell.strength(slowest_slew_fs);
        let is_stronger = |(_, weaker): &(CellModel, f64)| strength > weaker * STRONGER;
        if drives.last().is_none_or(is_stronger) {
            drives.push((cell, strength));
        }
    }
    drives.into_iter().map(|(cell, _)| cell).collect()
}
