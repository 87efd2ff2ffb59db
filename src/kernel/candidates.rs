//! Which flip-flops the next edge of their clock may change.
//!
//! ```text
//!   D changes ─► bit set        clock rises ─► flip-flops with a bit are looked at; one that would keep its state loses it
//! ```
//!
//! CLK reaches 70 flip-flops of a macropixel, and in most periods none of them has another D than before. A flip-flop whose D, state, set
//! and reset are as they were when it was last found to keep its state would keep it again.

use std::ops::Range;

use super::compiled::{DATA, Loads};
use super::shift_banks::ShiftBank;
use crate::netlist::Netlist;

/// Flip-flops on a net's D above which they are looked at with every edge instead of being told of every change. Chosen: the macropixel
/// has at most 4, the rows of a start-value memory are 64 to a column.
const MOST_TOLD: usize = 8;

/// No place.
const NOWHERE: u32 = u32::MAX;

/// A bit for each clock pin of a [`Loads`] of clocks, by its place there.
pub(super) struct Candidates {
    /// Places of the flip-flops with D on each net: those of a net one after the other.
    start: Vec<u32>,
    places: Vec<u32>,
    /// The place of each cell.
    place_of: Vec<u32>,
    may_change: Vec<u64>,
    /// Looked at with every edge, because nobody tells of their D.
    always: Vec<u64>,
}

impl Candidates {
    /// For clocks of `netlist`, whose nets all change by [`Candidates::data_changes`] but for those of `banks`.
    pub(super) fn new(netlist: &Netlist, clocks: &Loads, banks: &[ShiftBank]) -> Self {
        let cells = netlist.cells();
        let mut place_of = vec![NOWHERE; cells.len()];
        for place in 0..clocks.len() {
            place_of[clocks.at(place).cell()] = place as u32;
        }
        let mut by_net: Vec<(usize, u32)> = (cells.iter().zip(&place_of))
            .filter(|(_, place)| **place != NOWHERE)
            .map(|(cell, &place)| (cell.inputs[DATA].index(), place))
            .collect();
        by_net.sort_unstable();
        let mut is_of_a_bank = vec![false; netlist.net_count()];
        for &net in banks.iter().flat_map(|bank| &bank.nets) {
            is_of_a_bank[net as usize] = true;
        }
        let words = clocks.len().div_ceil(64);
        let (mut always, mut places) = (vec![0u64; words], Vec::new());
        let mut start = vec![0; netlist.net_count() + 1];
        for of_net in by_net.chunk_by(|a, b| a.0 == b.0) {
            let net = of_net[0].0;
            let of_net = of_net.iter().map(|&(_, place)| place);
            if is_of_a_bank[net] || of_net.len() > MOST_TOLD {
                for place in of_net {
                    always[place as usize / 64] |= 1 << (place % 64);
                }
            } else {
                start[net + 1] = of_net.len() as u32;
                places.extend(of_net);
            }
        }
        for net in 1..start.len() {
            start[net] += start[net - 1];
        }
        Candidates {
            start,
            places,
            place_of,
            may_change: vec![!0; words],
            always,
        }
    }

    /// A net has another value.
    #[inline]
    pub(super) fn data_changes(&mut self, net: usize) {
        for &place in &self.places[self.start[net] as usize..self.start[net + 1] as usize] {
            self.may_change[place as usize / 64] |= 1 << (place % 64);
        }
    }

    /// A flip-flop has another state, set or reset.
    #[inline]
    pub(super) fn cell_changes(&mut self, cell: usize) {
        let place = self.place_of[cell];
        if place != NOWHERE {
            self.may_change[place as usize / 64] |= 1 << (place % 64);
        }
    }

    /// Asks of each candidate among `places` whether it `changes`; one that does not is none any more.
    #[inline]
    pub(super) fn examine(&mut self, places: Range<usize>, mut changes: impl FnMut(usize) -> bool) {
        let mut from = places.start;
        while from < places.end {
            let word = from / 64;
            let end = places.end.min(64 * (word + 1));
            let here = !0 >> (64 - (end - from)) << (from % 64);
            let mut left = self.may_change[word] & here;
            let mut keep = 0;
            while left != 0 {
                let bit = left.trailing_zeros();
                left &= left - 1;
                keep |= u64::from(!changes(64 * word + bit as usize)) << bit;
            }
            self.may_change[word] &= !keep | self.always[word];
            from = end;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::compiled::FanOut;
    use crate::netlist::{CellKind, ModuleBuilder, Net};

    /// A shift register of `stages`, and `sharing` flip-flops more with D on the first one's.
    fn netlist(stages: usize, sharing: usize) -> Netlist {
        let mut m = ModuleBuilder::new("m");
        let [d, clk, reset] = ["D", "CLK", "RESET"].map(|name| m.input(name));
        let mut data = d;
        for stage in 0..stages + sharing {
            let q = m.wire(&format!("q{stage}"));
            let name = format!("flip{stage}");
            let data = if stage < stages {
                std::mem::replace(&mut data, q)
            } else {
                d
            };
            m.cell(&name, CellKind::Dffr, &[data, clk, reset], &[q, Net::NONE]);
        }
        Netlist::elaborate(&m.finish().unwrap())
    }

    fn examined(
        candidates: &mut Candidates,
        places: Range<usize>,
        changing: &[usize],
    ) -> Vec<usize> {
        let mut seen = Vec::new();
        candidates.examine(places, |place| {
            seen.push(place);
            changing.contains(&place)
        });
        seen
    }

    #[test]
    fn only_those_that_changed_or_were_told_are_asked_again() {
        let netlist = netlist(150, 0);
        let clocks = FanOut::new(&netlist, &[]).clocks;
        let mut candidates = Candidates::new(&netlist, &clocks, &[]);
        // At first all.
        let all: Vec<usize> = (0..150).collect();
        assert_eq!(examined(&mut candidates, 0..150, &[3, 64, 149]), all);
        assert_eq!(examined(&mut candidates, 0..150, &[64]), [3, 64, 149]);
        let q = |stage: usize| netlist.cells()[stage].outputs[0].index();
        candidates.data_changes(q(126));
        candidates.data_changes(q(127));
        candidates.cell_changes(5);
        assert_eq!(examined(&mut candidates, 10..128, &[]), [64, 127]);
        assert_eq!(examined(&mut candidates, 0..150, &[]), [5, 128]);
        assert_eq!(examined(&mut candidates, 0..150, &[]), [0; 0]);
    }

    #[test]
    fn those_that_nobody_tells_are_always_asked() {
        let netlist = netlist(2, MOST_TOLD);
        let clocks = FanOut::new(&netlist, &[]).clocks;
        let mut candidates = Candidates::new(&netlist, &clocks, &[]);
        let shared: Vec<usize> = (0..MOST_TOLD + 2).filter(|&place| place != 1).collect();
        examined(&mut candidates, 0..MOST_TOLD + 2, &[]);
        assert_eq!(examined(&mut candidates, 0..MOST_TOLD + 2, &[]), shared);
    }
}
