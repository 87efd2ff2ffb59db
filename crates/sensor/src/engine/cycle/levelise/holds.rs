//! Held flip-flops: those that ignore their clock because they are reset or set.
//!
//! ```text
//!   COUNTER_RESET    ▁▁╱▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔╲▁▁▁▁   shared: from every cause it is known how long it will hold
//!   COUNTER_RESET_D  ▁▁▁▁╱▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔╲▁▁   another cause, after which COUNTER_RESET still holds
//!   set<i>           ▁▁▁▁▁╱▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔╲▁   in some lanes: known when the tape runs
//! ```
//!
//! What a reset changes may clock flip-flops that it, or a net that is high at the time, holds. Such edges are no part of
//! a tape, which spares it the paths behind them: by these, a stage's clock could come at many times. An edge that
//! a shared net does not hold for certain is on the tape, and finds its flip-flop held or not.
//!
//! A flip-flop looks at reset and set in the instant of its clock's edge, but the tape changes it clk-to-Q later. Where
//! it may have been released by then, the instant has actions of its own ([`Leveliser::unheld`]).

use super::*;

impl Leveliser<'_> {
    /// Nets on a flip-flop's reset and set.
    fn controls_of(cell: &FlatCell) -> impl Iterator<Item = NetId> + use<> {
        cell.input_nets().skip(CLOCK + 1)
    }

    /// Flip-flops of the tape.
    fn flip_flops(&self) -> BTreeSet<usize> {
        let cells = self.loads.values().flatten().map(|&(cell, _)| cell);
        cells
            .filter(|&cell| self.survey.netlist.cells()[cell].kind.is_flip_flop())
            .collect()
    }

    /// Nets that reset or set them.
    fn controls(&self) -> BTreeSet<NetId> {
        let cells = self.survey.netlist.cells();
        let nets = self.flip_flops().into_iter();
        nets.flat_map(|cell| Self::controls_of(&cells[cell]))
            .collect()
    }

    /// Finds out how long shared nets hold after each cause, from all their edges in order.
    pub(super) fn find_holds(&mut self, edges: &[(Time, Cause)]) {
        let mut nets = self.controls();
        nets.retain(|&net| net != self.survey.clk && self.shared.contains(&net));
        // From the last edge back, when each net that is high will fall.
        let mut falls: BTreeMap<NetId, Time> = BTreeMap::new();
        for &net in &nets {
            let last = edges.iter().rfind(|(_, cause)| cause.net == net);
            let is_high = match last {
                Some((_, cause)) => cause.value,
                None => self.survey.shared_initial(net) == Some(true),
            };
            if is_high {
                falls.insert(net, Time::MAX);
            }
        }
        for instant in edges.chunk_by(|a, b| a.0 == b.0).rev() {
            let now = instant[0].0;
            for (_, cause) in instant {
                for &net in &nets {
                    let fall = falls.get(&net).unwrap_or(&now).as_fs();
                    let hold = fall.saturating_sub(now.as_fs());
                    let least = self.holds_fs.entry((*cause, net)).or_insert(hold);
                    *least = hold.min(*least);
                }
            }
            for (_, cause) in instant
                .iter()
                .filter(|(_, cause)| nets.contains(&cause.net))
            {
                if cause.value {
                    falls.remove(&cause.net);
                } else {
                    falls.insert(cause.net, now);
                }
            }
        }
    }

    /// How long shared nets hold a flip-flop after a cause, at least.
    pub(super) fn hold_fs(&self, cause: Cause, cell: usize) -> i64 {
        let nets = Self::controls_of(&self.survey.netlist.cells()[cell]);
        let holds = nets.filter_map(|net| self.holds_fs.get(&(cause, net)).copied());
        holds.max().unwrap_or(0)
    }

    /// Where a cause goes, past the flip-flops that are held for certain.
    ///
    /// # Errors
    /// When the cause is a reset, or set, that is too short for its own effects.
    pub(super) fn reach(&self, cause: Cause) -> Result<Reach, LevelisationError> {
        let cells = self.survey.netlist.cells();
        let mut held = self.flip_flops();
        held.retain(|&cell| self.hold_fs(cause, cell) > 0);
        let mut reach = self.spread(cause, held);
        // A clock that has turned out to come too late leads on to others.
        loop {
            let mut held = reach.held.clone();
            held.retain(|&cell| {
                let edge = (cells[cell].input(CLOCK), Edge::Rise);
                let removal = self.cell_library.checks(cells[cell].kind).removal;
                reach.arrival.get(&edge).is_none_or(|&(_, late)| {
                    late + removal.in_corner(self.config.corner).as_fs() < self.hold_fs(cause, cell)
                })
            });
            let mut released = reach.held.difference(&held);
            let is_own = |cell: &&usize| Self::controls_of(&cells[**cell]).any(|n| n == cause.net);
            if let Some(&cell) = released.find(|cell| cause.value && is_own(cell)) {
                return Err(LevelisationError::Clear(
                    self.survey.netlist.cell_path(CellId::new(cell)),
                ));
            }
            if held.len() == reach.held.len() {
                return Ok(reach);
            }
            reach = self.spread(cause, held);
        }
    }

    /// Notes when nets that reset or set may fall.
    ///
    /// # Errors
    /// When paths of different length lead there.
    pub(super) fn find_releases(&mut self, reaches: &[Reach]) -> Result<(), LevelisationError> {
        let nets = self.controls();
        for reach in reaches {
            for &(net, edge) in &reach.order {
                if edge != Edge::Fall || !nets.contains(&net) {
                    continue;
                }
                let (early, late) = reach.arrival[&(net, edge)];
                if early != late {
                    return Err(self.ambiguous(net, (early, late)));
                }
                let releases = self.releases_fs.entry(net).or_default();
                releases.push(reach.cause.position_fs + late);
            }
        }
        Ok(())
    }

    /// Whether a flip-flop's reset or set may end while an edge that has come to it is on its way to Q.
    pub(super) fn may_be_released(
        &self,
        cause: Cause,
        cell: &FlatCell,
        arrival_fs: i64,
        delay_fs: i64,
    ) -> bool {
        let edge_fs = cause.position_fs + arrival_fs;
        Self::controls_of(cell).any(|net| {
            if net == cause.net
                && cause.value
                && let Some(&hold) = self.holds_fs.get(&(cause, net))
            {
                return hold <= arrival_fs + delay_fs;
            }
            let mut releases = self.releases_fs.get(&net).into_iter().flatten();
            releases.any(|release| {
                let after = (release - edge_fs).rem_euclid(self.period_fs);
                0 < after && after <= delay_fs
            })
        })
    }

    pub(super) fn ambiguous(
        &self,
        net: NetId,
        (shortest_fs, longest_fs): (i64, i64),
    ) -> LevelisationError {
        LevelisationError::Ambiguous {
            net: self.survey.name(net),
            shortest_fs,
            longest_fs,
        }
    }
}
