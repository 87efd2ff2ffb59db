//! Flip-flops that timing checks judge together.
//!
//! A bank is all flip-flops with the same clock, reset and set nets and the same limits. What relates only those nets
//! (recovery, removal, pulse widths) is the same for each of them and is judged once. Setup is judged for those whose
//! D changed not long ago; the others keep a slack that is larger than at their last clock edge, beyond the end of the
//! histogram, and are only counted.
//!
//! ```text
//!   D changes ─► recent ─► judged at each rise of CK ─► slack in the last bin? ─► settled (a number)
//!                  ▲                                                                 │
//!                  └────────────────────────── D changes ────────────────────────────┘
//! ```

use std::collections::HashMap;

use crate::netlist::{CellKind, Netlist};

pub(super) const NO_NET: u32 = u32::MAX;

pub(super) const DATA: usize = 0;
pub(super) const CLOCK: usize = 1;
pub(super) const RESET: usize = 2;
pub(super) const SET: usize = 3;

/// What is known of a flip-flop's D.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Data {
    /// It never changed.
    Still,
    /// It changed so recently that its setup is judged: the flip-flop is on its bank's list.
    Recent,
    /// It changed long ago: the flip-flop is counted among its bank's settled ones.
    Settled,
}

#[derive(Clone, Copy)]
pub(super) struct FlipFlop {
    pub cell: u32,
    /// D, CK, R, S; [`NO_NET`] where the cell has no such pin.
    pub nets: [u32; 4],
    pub is_asynchronous: bool,
    /// Index of its limits.
    pub limits: u32,
    pub bank: u32,
    pub data: Data,
}

/// The flip-flops of `netlist`; the limits are numbered 1 for those with a set, 0 for the others.
pub(super) fn flip_flops(netlist: &Netlist) -> Vec<FlipFlop> {
    let cells = netlist.cells().iter().enumerate();
    cells
        .filter(|(_, cell)| cell.kind.is_flip_flop())
        .map(|(index, cell)| FlipFlop {
            cell: index as u32,
            nets: cell
                .inputs
                .map(|net| net.map_or(NO_NET, |net| net.index() as u32)),
            is_asynchronous: false,
            limits: u32::from(cell.kind == CellKind::Dffsr),
            bank: 0,
            data: Data::Still,
        })
        .collect()
}

pub(super) struct Bank {
    /// CK, R and S under their pins' numbers.
    pub nets: [u32; 4],
    pub limits: u32,
    pub is_asynchronous: bool,
    pub members: Vec<u32>,
    pub recent: Vec<u32>,
    pub settled: u64,
}

/// Groups flip-flops and tells each its bank.
pub(super) fn banks(flip_flops: &mut [FlipFlop]) -> Vec<Bank> {
    let mut banks: Vec<Bank> = Vec::new();
    let mut index_of = HashMap::new();
    for (index, flip_flop) in flip_flops.iter_mut().enumerate() {
        let mut nets = flip_flop.nets;
        nets[DATA] = NO_NET;
        let (limits, is_asynchronous) = (flip_flop.limits, flip_flop.is_asynchronous);
        let key = (nets, limits, is_asynchronous);
        flip_flop.bank = *index_of.entry(key).or_insert_with(|| {
            banks.push(Bank {
                nets,
                limits,
                is_asynchronous,
                members: Vec::new(),
                recent: Vec::new(),
                settled: 0,
            });
            banks.len() as u32 - 1
        });
        banks[flip_flop.bank as usize].members.push(index as u32);
    }
    banks
}

/// Fan-out of every net to what is checked: D pins of flip-flops, and the other pins of banks.
pub(super) struct CheckedPins {
    /// Where each net's begin in `loads`.
    start: Vec<u32>,
    /// Flip-flop or bank, and pin.
    loads: Vec<(u32, u8)>,
}

impl CheckedPins {
    pub(super) fn new(flip_flops: &[FlipFlop], banks: &[Bank], net_count: usize) -> Self {
        let pins = || {
            let data = flip_flops.iter().enumerate();
            let data = data.map(|(index, f)| (index as u32, DATA as u8, f.nets[DATA]));
            let shared = banks.iter().enumerate().flat_map(|(index, bank)| {
                let pins = [CLOCK, RESET, SET].into_iter();
                pins.map(move |pin| (index as u32, pin as u8, bank.nets[pin]))
            });
            data.chain(shared).filter(|&(_, _, net)| net != NO_NET)
        };
        let mut start = vec![0u32; net_count + 1];
        for (_, _, net) in pins() {
            start[net as usize + 1] += 1;
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let mut next = start.clone();
        let mut loads = vec![(0, 0); start[net_count] as usize];
        for (index, pin, net) in pins() {
            let at = &mut next[net as usize];
            loads[*at as usize] = (index, pin);
            *at += 1;
        }
        CheckedPins { start, loads }
    }

    /// Whether any pin on `net` is checked.
    #[inline]
    pub(super) fn has_any(&self, net: usize) -> bool {
        self.start[net] != self.start[net + 1]
    }

    /// Positions in the list of all, for [`CheckedPins::pin`].
    #[inline]
    pub(super) fn positions(&self, net: usize) -> std::ops::Range<usize> {
        self.start[net] as usize..self.start[net + 1] as usize
    }

    /// Flip-flop (for D) or bank (for other pins), and pin.
    #[inline]
    pub(super) fn pin(&self, position: usize) -> (u32, usize) {
        let (index, pin) = self.loads[position];
        (index, pin as usize)
    }

    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(&self.start[..]) + size_of_val(&self.loads[..])
    }
}
