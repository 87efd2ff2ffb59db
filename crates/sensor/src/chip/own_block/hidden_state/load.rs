//! Loads and rounds of a P-counter of one's own, simulated 64 codes at a time with the library's delays.

use super::Counter;
use crate::chip::Probe;
use crate::chip::p_counter::count_down::{CountDownSetup, SHORTEST_PAUSE};
use crate::chip::timing::silicon::Silicon;
use crate::kernel::{LANES, LaneDrive, LaneKernel, Lanes};
use crate::netlist::{Corner, NetId};
use crate::units::Time;

/// Up to 64 codes, loaded into a counter whose flip-flops were unknown.
pub(super) struct Load<'c> {
    counter: &'c Counter<'c>,
    pub(super) codes: &'c [u16],
    kernel: LaneKernel,
    now: Time,
}

impl<'c> Load<'c> {
    /// `moves`: COUNTER_INIT changes while MEMORY_LOAD is high.
    pub(super) fn new(counter: &'c Counter<'c>, codes: &'c [u16], moves: bool) -> Self {
        let netlist = counter.netlist;
        let timing = Silicon::nominal(Corner::Typ).timing(netlist);
        let mut load = Load {
            counter,
            codes,
            kernel: LaneKernel::new(netlist, &timing),
            now: Time::ZERO,
        };
        let low: Vec<_> = netlist.inputs().iter().map(|&net| (net, 0)).collect();
        load.drive(&low);
        load.set(Probe::CounterReset, true);
        let bits = (0..).zip(counter.init()).map(|(bit, &net)| {
            let lanes = (0..).zip(codes);
            let word = lanes.fold(0, |word, (lane, code)| {
                word | u64::from(code >> bit & 1) << lane
            });
            (net, word)
        });
        let bits: Vec<(NetId, u64)> = bits.collect();
        load.drive(&bits);
        load.set(Probe::MemoryLoad, true);
        if moves {
            let moved: Vec<_> = bits.iter().map(|&(net, word)| (net, !word)).collect();
            load.drive(&moved);
        }
        load.set(Probe::MemoryLoad, false);
        load
    }

    fn drive(&mut self, drives: &[(NetId, u64)]) {
        let time = self.now;
        let drives = drives.iter().map(|&(net, word)| LaneDrive {
            time,
            net,
            mask: u64::MAX,
            values: Lanes::from_bits(word),
        });
        self.now += SHORTEST_PAUSE;
        self.kernel
            .run(&mut drives.peekable(), self.now, &mut ())
            .expect("no loop of cells without delay");
    }

    fn set(&mut self, pin: Probe, value: bool) {
        let net = self.counter.probes.net(pin);
        self.drive(&[(net, if value { u64::MAX } else { 0 })]);
    }

    fn used(&self) -> u64 {
        u64::MAX >> (LANES - self.codes.len())
    }

    /// Lanes in which a flip-flop holds a 1.
    pub(super) fn ones(&self, cell: usize) -> u64 {
        let [q, qn] = self.counter.netlist.cells()[cell].outputs;
        self.used()
            & match (q, qn) {
                (Some(q), _) => self.kernel.value(q).one,
                (None, Some(qn)) => self.kernel.value(qn).zero,
                (None, None) => 0,
            }
    }

    /// Lanes in which nobody knows what a flip-flop holds.
    pub(super) fn unknown(&self, cell: usize) -> u64 {
        let net = self.counter.netlist.cells()[cell].output_nets().next();
        let known = net.map(|net| self.kernel.value(net));
        self.used() & !known.map_or(u64::MAX, |known| known.one | known.zero)
    }

    /// A flip-flop that is not the same when LOCAL_STOP rises for the second time as when it rose first.
    pub(super) fn changed_by_a_round(
        mut self,
        counting: &[usize],
        expected: CountDownSetup,
    ) -> Option<usize> {
        self.set(Probe::CounterReset, false);
        let local_stop = self.counter.local_stop();
        let bits = self.counter.init().len();
        let mut first = vec![0; counting.len()];
        let (mut risen, mut done) = (0, 0);
        let mut high = self.kernel.value(local_stop).one;
        // As many edges as the law is measured with.
        for _ in 0..(expected.step_periods as u32) << (bits + 2) {
            if done == self.used() {
                break;
            }
            self.set(Probe::CounterClk, true);
            let level = self.kernel.value(local_stop).one;
            let rose = level & !high & self.used();
            high = level;
            for (&cell, first) in counting.iter().zip(&mut first) {
                let ones = self.ones(cell);
                if (ones ^ *first) & rose & risen & !done != 0 {
                    return Some(cell);
                }
                *first |= ones & rose & !risen;
            }
            done |= rose & risen;
            risen |= rose;
            self.set(Probe::CounterClk, false);
        }
        None
    }
}
