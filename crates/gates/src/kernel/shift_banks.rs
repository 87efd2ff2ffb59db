//! Long shift registers, a word at a time.
//!
//! ```text
//!   D ─►[0]─►[1]─► … ─►[n−1]      one clock, one reset, equal delays; outputs go to other flip-flops' D only
//! ```
//!
//! With a clock edge every other stage of a shift register changes, all of them one clock-to-output delay later, and
//! nothing looks before a clock edge of its own. So while all values are known, reset and set are low and nothing is on
//! its way, an edge shifts 64 stages with one instruction and makes one event for all that change. Nets have their values
//! and observers hear of each change at the same instants and in the same order as from single flip-flops. Where no observer
//! needs changes, the nets take their values only before something reads them. Anything
//! else (a reset, an unknown, an edge before the last one's changes have come) goes through the flip-flops, and the bank
//! forms again at a later edge.
//!
//! The deserialiser of 64 columns is one of 576 stages, which change 10 million times in a load: some 0.35 s through single
//! flip-flops, a tenth of it so.

use super::compiled::CLOCK;
use crate::netlist::{CellId, CellKind, DelayModel, FlatCell, Netlist, Timing};

/// Stages below which words gain nothing; and METDCs of any size stay as they are.
const FEWEST: usize = 65;

/// Pin of a flip-flop's reset.
const RESET: usize = 2;

/// One shift register.
pub(super) struct ShiftBank {
    pub clock: u32,
    /// D of the first stage.
    pub data: u32,
    /// Flip-flops in order.
    pub cells: Vec<u32>,
    /// Their outputs, in ascending order.
    pub nets: Vec<u32>,
    /// Delays to Q.
    pub delays: u32,
    /// States, and what the outputs show, while it is formed.
    pub state: Vec<u64>,
    pub shown: Vec<u64>,
    pub is_formed: bool,
    /// A change of the outputs is on its way.
    pub arrives_fs: Option<i64>,
    /// Clocks of other flip-flops whose D is one of the outputs, in ascending order.
    pub reading_clocks: Vec<u32>,
    /// The nets do not have the values yet that the outputs show.
    pub nets_are_late: bool,
}

impl ShiftBank {
    /// The longest possible banks of a netlist.
    pub(super) fn all(netlist: &Netlist, timing: &Timing) -> Vec<Self> {
        let cells = netlist.cells();
        const NOBODY: usize = usize::MAX;
        // Who drives each net by its Q, and whether anything but a flip-flop's D looks at it.
        let mut driver = vec![NOBODY; netlist.net_count()];
        let mut is_watched = vec![false; netlist.net_count()];
        for (index, cell) in cells.iter().enumerate() {
            for (pin, net) in cell.input_nets().enumerate() {
                is_watched[net.index()] |= cell.kind.triggers(pin);
            }
            if let (CellKind::Dffr, Some(q)) = (cell.kind, cell.outputs[0]) {
                driver[q.index()] = index;
            }
        }
        let may_be = |index: usize| {
            let cell = &cells[index];
            let [Some(q), None] = cell.outputs else {
                return false;
            };
            let is_plain = cell.kind == CellKind::Dffr && !is_watched[q.index()];
            is_plain && timing.model(CellId::new(index)) == DelayModel::Inertial
        };
        let follows = |before: usize, after: usize| {
            let (a, b) = (&cells[before], &cells[after]);
            may_be(before)
                && a.inputs[CLOCK..=RESET] == b.inputs[CLOCK..=RESET]
                && timing.set_of(CellId::new(before)) == timing.set_of(CellId::new(after))
                && a.outputs[0] < b.outputs[0]
        };
        let mut next = vec![NOBODY; cells.len()];
        let mut has_before = vec![false; cells.len()];
        for after in (0..cells.len()).filter(|&index| may_be(index)) {
            let before = driver[cells[after].input(0).index()];
            if before != NOBODY && next[before] == NOBODY && follows(before, after) {
                next[before] = after;
                has_before[after] = true;
            }
        }
        let firsts = (0..cells.len()).filter(|&i| next[i] != NOBODY && !has_before[i]);
        let next = |&index: &usize| Some(next[index]).filter(|&next| next != NOBODY);
        let mut banks = Vec::new();
        for first in firsts {
            let chain: Vec<usize> = std::iter::successors(Some(first), next).collect();
            if chain.len() >= FEWEST {
                banks.push(ShiftBank::new(netlist, timing, &chain));
            }
        }
        banks
    }

    fn new(netlist: &Netlist, timing: &Timing, chain: &[usize]) -> Self {
        let cell = |index: usize| &netlist.cells()[index];
        let words = vec![0; chain.len().div_ceil(64)];
        ShiftBank {
            clock: cell(chain[0]).input(CLOCK).index() as u32,
            data: cell(chain[0]).input(0).index() as u32,
            cells: chain.iter().map(|&index| index as u32).collect(),
            nets: chain
                .iter()
                .filter_map(|&index| Some(cell(index).outputs[0]?.index() as u32))
                .collect(),
            delays: timing.set_of(CellId::new(chain[0])),
            state: words.clone(),
            shown: words,
            is_formed: false,
            arrives_fs: None,
            reading_clocks: reading_clocks(netlist, chain),
            nets_are_late: false,
        }
    }

    /// The state of a stage.
    pub(super) fn is_set(&self, stage: usize) -> bool {
        self.state[stage / 64] >> (stage % 64) & 1 == 1
    }

    /// What the output of a stage shows.
    pub(super) fn shows(&self, stage: usize) -> bool {
        self.shown[stage / 64] >> (stage % 64) & 1 == 1
    }

    /// Takes `data` and what the outputs show; tells whether any output is to change.
    pub(super) fn shift(&mut self, data: bool) -> bool {
        let mut carry = u64::from(data);
        let mut changes = 0;
        let last = self.state.len() - 1;
        for (word, (state, &shown)) in self.state.iter_mut().zip(&self.shown).enumerate() {
            *state = shown << 1 | carry;
            carry = shown >> 63;
            if word == last && !self.cells.len().is_multiple_of(64) {
                *state &= (1 << (self.cells.len() % 64)) - 1;
            }
            changes |= *state ^ shown;
        }
        changes != 0
    }

    /// Forms the bank with this state, which the outputs show.
    pub(super) fn form(&mut self, state: impl Iterator<Item = bool>) {
        self.state.fill(0);
        for (stage, _) in state.enumerate().filter(|(_, is_set)| *is_set) {
            self.state[stage / 64] |= 1 << (stage % 64);
        }
        self.shown.copy_from_slice(&self.state);
        self.is_formed = true;
        self.arrives_fs = None;
    }
}

/// Clocks of flip-flops outside of a chain whose D is an output of it.
fn reading_clocks(netlist: &Netlist, chain: &[usize]) -> Vec<u32> {
    let cells = netlist.cells();
    let (mut is_output, mut is_inside) =
        (vec![false; netlist.net_count()], vec![false; cells.len()]);
    for &index in chain {
        is_inside[index] = true;
        for output in cells[index].output_nets() {
            is_output[output.index()] = true;
        }
    }
    let reads = |&(index, cell): &(usize, &FlatCell)| {
        !is_inside[index] && cell.kind.is_flip_flop() && is_output[cell.input(0).index()]
    };
    let readers = cells.iter().enumerate().filter(reads);
    let mut clocks: Vec<u32> = readers
        .map(|(_, cell)| cell.input(CLOCK).index() as u32)
        .collect();
    clocks.sort_unstable();
    clocks.dedup();
    clocks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::netlist::{Corner, Library, ModuleBuilder};

    /// What a stage of a shift register may have of its own.
    #[derive(Clone, Copy, PartialEq)]
    enum Own {
        Nothing,
        Clock,
        Reset,
        Inverted,
        Gate,
        Wire,
    }

    /// First stages and lengths of the banks of a register of `stages`, one of which has something of its own.
    fn banks(stages: usize, (odd, own): (usize, Own)) -> Vec<(usize, usize)> {
        let mut m = ModuleBuilder::new("register");
        let (d, ck, r) = (m.input("D"), m.input("CK"), m.input("R"));
        let (other_ck, other_r) = (m.input("CK2"), m.input("R2"));
        let q = m.output_bus("Q", stages);
        let qn = (own == Own::Inverted).then(|| m.output("QN"));
        for stage in 0..stages {
            let data = if stage == 0 { d } else { q[stage - 1] };
            let has = |what: Own| stage == odd && own == what;
            let clock = if has(Own::Clock) { other_ck } else { ck };
            let reset = if has(Own::Reset) { other_r } else { r };
            let inverted = qn.filter(|_| stage == odd);
            let name = format!("stage_{stage}");
            m.cell(
                &name,
                CellKind::Dffr,
                &[data, clock, reset],
                &[Some(q[stage]), inverted],
            );
        }
        if own == Own::Gate {
            m.gate(CellKind::Inv, &[q[odd]]);
        }
        let netlist = Netlist::elaborate(&m.finish().expect("a register"));
        let mut timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
        if own == Own::Wire {
            timing.set_model(CellId::new(odd), DelayModel::Transport);
        }
        let net = |name: &str| netlist.net(name).expect("a net").index() as u32;
        let banks = ShiftBank::all(&netlist, &timing).into_iter().map(|bank| {
            let first = bank.cells[0] as usize;
            let in_order = |all: &[u32]| all.windows(2).all(|pair| pair[1] == pair[0] + 1);
            assert!(in_order(&bank.cells) && in_order(&bank.nets));
            assert_eq!(bank.nets[0], net("Q[0]") + first as u32);
            assert_eq!(bank.nets.len(), bank.cells.len());
            let data = if first == 0 {
                net("D")
            } else {
                bank.nets[0] - 1
            };
            assert_eq!((bank.clock, bank.data), (net("CK"), data));
            (first, bank.cells.len())
        });
        banks.collect()
    }

    #[test]
    fn stages_that_are_alike_are_one_bank_from_65_on() {
        assert_eq!(banks(64, (0, Own::Nothing)), []);
        assert_eq!(banks(65, (0, Own::Nothing)), [(0, 65)]);
        assert_eq!(banks(200, (0, Own::Nothing)), [(0, 200)]);
        // One that is not alike is in no bank; its output is the data of those after it.
        for own in [Own::Clock, Own::Reset, Own::Inverted, Own::Gate, Own::Wire] {
            assert_eq!(banks(200, (70, own)), [(0, 70), (71, 129)]);
        }
    }
}
