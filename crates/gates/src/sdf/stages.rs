//! Stages of chains in a file: their delays are those of the cell that the netlist has, added up.

use super::annotate::Annotator;
use super::error::{SdfError, SdfFault, SdfPart};
use super::{DelayPath, SdfCell};
use crate::netlist::{ArcDelay, CellId, Chain, MAX_INPUTS, MAX_OUTPUTS, Timing};
use crate::units::Time;

impl Annotator<'_, '_, '_> {
    /// Takes the delays of one stage.
    pub(super) fn stage(
        &mut self,
        timing: &Timing,
        entry: &SdfCell<'_>,
        (cell, chain, number): (CellId, Chain, usize),
    ) -> Result<(), SdfError> {
        let module = chain.stage_module();
        if module != entry.cell_type {
            let fault = SdfFault::WrongCellType {
                part: SdfPart::Stage,
                actual: module,
                stated: entry.cell_type.to_owned(),
            };
            return self.error(entry.line, fault);
        }
        for delay in &entry.delays {
            let is_its = |from: &str, to: &str| from == "A" && to == "Z";
            let is_path = match &delay.path {
                DelayPath::IoPath(from, to) => from.edge.is_none() && is_its(&from.pin, to),
                _ => false,
            };
            if !is_path {
                return self.error(delay.line, SdfFault::StagePath);
            }
            let arc = timing.cell_delays(cell)[0][0];
            let (stages, line) = self.stages.entry(cell).or_insert_with(|| {
                let parts = chain.parts(arc.rise_fs).zip(chain.parts(arc.fall_fs));
                let parts = parts.map(|(rise, fall)| [rise, fall].map(i64::from));
                (parts.collect(), delay.line)
            });
            *line = delay.line;
            for (member, value) in stages[number].iter_mut().zip([delay.rise, delay.fall]) {
                if let Some(fs) = value.in_corner(self.corner).map(Time::as_fs) {
                    *member = fs + if delay.increment { *member } else { 0 };
                }
            }
            let is_given = delay.has_value(self.corner);
            self.result.arcs += usize::from(is_given);
        }
        Ok(())
    }

    /// Gives cells the sums of their stages' delays.
    pub(super) fn add_stages(&mut self, timing: &mut Timing) -> Result<(), SdfError> {
        let mut chains: Vec<_> = std::mem::take(&mut self.stages).into_iter().collect();
        // In the order of the file, so that the first mistake is the one reported.
        chains.sort_unstable_by_key(|(cell, (_, line))| (*line, *cell));
        for (cell, (stages, line)) in chains {
            let mut sums = [0; 2];
            for (direction, sum) in sums.iter_mut().enumerate() {
                let fs = stages.iter().map(|stage| stage[direction]).sum::<i64>();
                let Ok(fs) = u32::try_from(fs) else {
                    return self.out_of_range(line, fs);
                };
                *sum = fs;
            }
            let [rise_fs, fall_fs] = sums;
            let arcs = [[ArcDelay { rise_fs, fall_fs }; MAX_OUTPUTS]; MAX_INPUTS];
            if arcs[0][0] != timing.cell_delays(cell)[0][0] {
                timing.set(cell, arcs);
            }
        }
        Ok(())
    }
}
