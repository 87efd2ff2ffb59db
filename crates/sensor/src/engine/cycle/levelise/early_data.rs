//! Flip-flops whose data change between the edge of their clock and that of their output.
//!
//! ```text
//!   clock  ▁▁▁▁╱▔▔▔▔▔▔▔▔▔▔▔   what the flip-flop takes
//!   data   ════════╳═══════   must not change …
//!   Q      ════════════╳═══   … before its place on the tape, where it reads its data
//! ```
//!
//! A cause that brings such data along is seen in its own [`Reach`]. Of two causes, their edges in the event kernel say how they lie to
//! one another: a flip-flop that is the same in all macropixels, for example, changes after a clock that is another cause.

use super::*;

/// Edges of shared nets, and what they change.
#[derive(Default)]
pub(super) struct SharedEdges {
    /// When each cause comes, from the first STOP edge on; CLK's come in every period and are left out.
    times_fs: BTreeMap<Cause, Vec<i64>>,
    /// Causes that reach a net, and when after them it changes, earliest and latest.
    changes: HashMap<NetId, Vec<(Cause, i64, i64)>>,
}

impl SharedEdges {
    pub(super) fn new(edges: &[(Time, Cause)], reaches: &[Reach]) -> Self {
        let mut shared = SharedEdges::default();
        for &(time, cause) in edges {
            shared.times_fs.entry(cause).or_default().push(time.as_fs());
        }
        for reach in reaches {
            for (&(net, _), &(early, late)) in &reach.arrival {
                let of_net = shared.changes.entry(net).or_default();
                of_net.push((reach.cause, early, late));
            }
        }
        shared
    }

    /// Times from an edge of one cause to those of another that may matter to it: those within `period_fs`.
    fn distances(&self, from: Cause, to: Cause, period_fs: i64) -> Vec<i64> {
        let (Some(from), Some(others)) = (self.times_fs.get(&from), self.times_fs.get(&to)) else {
            let distance = (to.position_fs - from.position_fs).rem_euclid(period_fs);
            return vec![distance - period_fs, distance];
        };
        let near = |&time: &i64| {
            let first = others.partition_point(|&other| other < time - period_fs);
            let near = others[first..].iter();
            near.map(move |other| other - time)
                .take_while(move |&distance| distance < period_fs)
        };
        let mut all: Vec<i64> = from.iter().flat_map(near).collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}

impl Leveliser<'_> {
    /// Refuses a flip-flop whose data change after the earliest edge of its clock and before its output.
    pub(super) fn refuse_early_data(
        &self,
        reach: &Reach,
        cell: usize,
        (clock_fs, output_fs): (i64, i64),
    ) -> Result<(), LevelisationError> {
        let leaf = &self.survey.netlist.cells()[cell];
        let data = leaf.input(0);
        if leaf.outputs.contains(&Some(data)) || self.survey.class(data) == Class::Stream {
            return Ok(());
        }
        let changes = self.shared_edges.changes.get(&data);
        for &(cause, early, late) in changes.into_iter().flatten() {
            let is_early = if cause == reach.cause {
                early < output_fs
            } else if self.hold_fs(cause, cell) > 0 {
                // A reset or set decides what the flip-flop is.
                false
            } else {
                let distances = self
                    .shared_edges
                    .distances(reach.cause, cause, self.period_fs);
                let mut distances = distances.iter();
                distances
                    .any(|distance| distance + early < output_fs && distance + late >= clock_fs)
            };
            if is_early {
                return Err(self.ambiguous(data, (clock_fs, output_fs)));
            }
        }
        Ok(())
    }
}
