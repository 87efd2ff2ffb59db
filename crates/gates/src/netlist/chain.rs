//! Cells with transport delays as standard cells have them: chains of stages.
//!
//! ```text
//!   A ─► STAGE s0 ─► STAGE s1 ─► … ─► Z        each a part of the delay, all alike to the femtosecond
//! ```
//!
//! The paths of `specify` blocks swallow pulses shorter than they are long (IEEE 1364, 14.6), and an element of a delay line
//! passes them: it is itself a chain, much faster than it is long. So in the netlist, which engines run, it is one cell, and for
//! other tools a module of stages, each of them an instance that SDF names. A stage passes
//! pulses of 57.6 ps in the typical corner, and in proportion in the others.

use std::collections::BTreeSet;

use super::cell::CellKind;
use super::delay::DelayModel;
use super::flat::Netlist;
use super::id::CellId;
use super::own_delay::OwnDelay;
use crate::units::Time;

/// Longest stage in the typical corner, fs: shorter than the shortest pulse that gates of this library leave, 57.6 ps.
const LONGEST_STAGE_FS: f64 = 50_000.0;

/// Standard deviations by which an element may be slower than the mean and still have stages that short.
const SLOWEST_SIGMAS: f64 = 5.0;

/// A kind of chain: what its cells are on average.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Chain {
    /// Delay of all stages in the typical corner.
    pub typical: Time,
    /// Number of stages.
    pub stages: usize,
}

impl Chain {
    /// The chain that a cell is; none where it delays as gates do.
    pub(crate) fn from_delay(kind: CellKind, own: Option<OwnDelay>) -> Option<Self> {
        let own = own.filter(|own| own.model == DelayModel::Transport)?;
        debug_assert_eq!(kind, CellKind::Buf, "only wires have transport delays");
        let sigma = own.spread.map_or(0.0, |spread| spread.sigma);
        let slowest_fs = own.typical.as_fs() as f64 * (1.0 + SLOWEST_SIGMAS * sigma);
        Some(Chain {
            typical: own.typical,
            stages: (slowest_fs / LONGEST_STAGE_FS).ceil().max(1.0) as usize,
        })
    }

    /// The chain that a cell of a netlist is.
    pub(crate) fn of_cell(netlist: &Netlist, cell: CellId) -> Option<Self> {
        let own = netlist.own_delays();
        let at = own.binary_search_by_key(&cell, |own| own.0).ok()?;
        Chain::from_delay(netlist.cells()[cell.index()].kind, Some(own[at].1))
    }

    /// The kinds of chain in a netlist.
    pub fn all(netlist: &Netlist) -> BTreeSet<Self> {
        let own = netlist.own_delays().iter();
        own.filter_map(|&(cell, own)| {
            Chain::from_delay(netlist.cells()[cell.index()].kind, Some(own))
        })
        .collect()
    }

    /// Name of its module in Verilog.
    pub(crate) fn module(self) -> String {
        format!("DELAY_{}_{}", self.typical.as_fs(), self.stages)
    }

    /// Name of its stages' module in Verilog and SDF.
    pub(crate) fn stage_module(self) -> String {
        format!("STAGE_{}_{}", self.typical.as_fs(), self.stages)
    }

    /// Name of one of its stages.
    pub(crate) fn stage(number: usize) -> String {
        format!("s{number}")
    }

    /// The stage of a chain at a dotted path: its cell, and its number.
    pub(crate) fn find(netlist: &Netlist, path: &str) -> Option<(CellId, Self, usize)> {
        let (element, stage) = path.rsplit_once('.')?;
        let cell = netlist.cell(element)?;
        let chain = Chain::of_cell(netlist, cell)?;
        let number = (0..chain.stages).find(|&number| Chain::stage(number) == stage)?;
        Some((cell, chain, number))
    }

    /// Parts of a delay, one for each stage.
    pub(crate) fn parts(self, fs: u32) -> impl Iterator<Item = u32> {
        let stages = self.stages as u64;
        let until = move |stage: u64| u64::from(fs) * stage / stages;
        (0..stages).map(move |stage| (until(stage + 1) - until(stage)) as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Chains of other delays or stages are other modules.
    #[test]
    fn modules_are_named_after_delay_and_stages() {
        let chain = |fs| {
            let wire = OwnDelay::wire(Time::from_fs(fs));
            Chain::from_delay(CellKind::Buf, Some(wire)).unwrap()
        };
        let (short, long) = (chain(50_000), chain(120_000));
        assert_eq!(
            (short.stages, short.module()),
            (1, "DELAY_50000_1".to_owned())
        );
        assert_eq!(
            (long.stages, long.module()),
            (3, "DELAY_120000_3".to_owned())
        );
        assert_eq!(long.stage_module(), "STAGE_120000_3");
    }

    proptest! {
        #[test]
        fn stages_are_alike_and_add_up(fs: u32, typical_fs in 1u32..10_000_000) {
            let wire = OwnDelay::wire(Time::from_fs(typical_fs.into()));
            let chain = Chain::from_delay(CellKind::Buf, Some(wire)).unwrap();
            let parts: Vec<u32> = chain.parts(fs).collect();
            prop_assert_eq!(parts.len(), chain.stages);
            prop_assert_eq!(parts.iter().map(|&fs| u64::from(fs)).sum::<u64>(), u64::from(fs));
            let (least, most) = (parts.iter().min().unwrap(), parts.iter().max().unwrap());
            prop_assert!(most - least <= 1);
            prop_assert!(chain.parts(typical_fs).all(|fs| fs <= 50_000));
        }
    }
}
