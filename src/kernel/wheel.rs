//! The event queue: a time wheel with an occupancy bitmap, and a heap for the far future.
//!
//! Gate delays span tens to hundreds of picoseconds, so nearly every event falls into the wheel's
//! 16.8 ns; long quiet gaps between events are skipped by scanning the bitmap. Events of
//! one 8.2 ps slot are sorted by (time, net) when the slot is opened. At most one *valid* event per
//! net exists, so that order is total; cancelled events stay queued and are recognised by their
//! generation.
//!
//! ```text
//!   first[slot] ──► node ──► node ──► NONE        free ──► node ──► NONE
//! ```
//!
//! The slots are linked lists in one pool whose nodes are taken again last freed first: few events are on their
//! way at once, so what the wheel touches stays in the nearest cache, wherever in the wheel they lie.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

const SLOT_BITS: u32 = 13;
const SLOTS: usize = 2048;
const WORDS: usize = SLOTS / 64;

/// A scheduled value of one net.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Event {
    pub time_fs: i64,
    pub net: u32,
    /// Generation in the upper 30 bits, value in the lower two.
    pub tag: u32,
}

/// No node.
const NONE: u32 = u32::MAX;

#[derive(Debug, Clone, Copy)]
struct Node {
    event: Event,
    next: u32,
}

/// Events in time order. Time never runs backwards: pushes must not precede [`TimeWheel::advance`].
#[derive(Debug, Clone)]
pub(super) struct TimeWheel {
    /// First node of each slot's list.
    first: Box<[u32; SLOTS]>,
    nodes: Vec<Node>,
    /// First node that is not in use.
    free: u32,
    occupied: [u64; WORDS],
    /// Bit w is set when `occupied[w]` is not zero.
    summary: u32,
    far: BinaryHeap<Reverse<Event>>,
    /// The slot being drained, sorted; `position` is the next event of it.
    open: Vec<Event>,
    position: usize,
    open_slot: i64,
}

impl TimeWheel {
    pub(super) fn new() -> Self {
        TimeWheel {
            first: Box::new([NONE; SLOTS]),
            nodes: Vec::new(),
            free: NONE,
            occupied: [0; WORDS],
            summary: 0,
            far: BinaryHeap::new(),
            open: Vec::new(),
            position: 0,
            open_slot: 0,
        }
    }

    #[inline]
    pub(super) fn push(&mut self, event: Event) {
        let slot = event.time_fs >> SLOT_BITS;
        debug_assert!(slot >= self.open_slot, "an event before the present");
        if slot == self.open_slot {
            let rest = &self.open[self.position..];
            let key = |e: &Event| (e.time_fs, e.net);
            let at = self.position + rest.partition_point(|e| key(e) <= key(&event));
            self.open.insert(at, event);
        } else if slot - self.open_slot < SLOTS as i64 {
            self.put(slot, event);
        } else {
            self.far.push(Reverse(event));
        }
    }

    #[inline]
    fn put(&mut self, slot: i64, event: Event) {
        let index = slot as usize % SLOTS;
        let next = std::mem::replace(&mut self.first[index], self.free);
        let node = Node { event, next };
        match self.nodes.get_mut(self.free as usize) {
            Some(unused) => self.free = std::mem::replace(unused, node).next,
            None => {
                self.first[index] = self.nodes.len() as u32;
                self.nodes.push(node);
            }
        }
        self.occupied[index / 64] |= 1 << (index % 64);
        self.summary |= 1 << (index / 64);
    }

    /// Time of the next event if it is not after `limit_fs`.
    #[inline]
    pub(super) fn next_time(&mut self, limit_fs: i64) -> Option<i64> {
        loop {
            if let Some(event) = self.open.get(self.position) {
                return (event.time_fs <= limit_fs).then_some(event.time_fs);
            }
            let slot = match (self.next_slot(), self.far.peek()) {
                (Some(slot), _) => slot,
                (None, Some(Reverse(event))) => event.time_fs >> SLOT_BITS,
                (None, None) => return None,
            };
            if slot > limit_fs >> SLOT_BITS {
                return None;
            }
            self.open(slot);
        }
    }

    /// The next event, if it is due at exactly `time_fs`.
    #[inline]
    pub(super) fn pop_at(&mut self, time_fs: i64) -> Option<Event> {
        let event = *self.open.get(self.position)?;
        (event.time_fs == time_fs).then(|| {
            self.position += 1;
            event
        })
    }

    /// Moves the present to `time_fs`; no event may be due before it.
    #[inline]
    pub(super) fn advance(&mut self, time_fs: i64) {
        let slot = time_fs >> SLOT_BITS;
        if slot != self.open_slot {
            debug_assert!(self.position == self.open.len() && slot > self.open_slot);
            self.open(slot);
        }
    }

    fn open(&mut self, slot: i64) {
        self.open.clear();
        self.position = 0;
        self.open_slot = slot;
        let index = slot as usize % SLOTS;
        let mut at = std::mem::replace(&mut self.first[index], NONE);
        while let Some(node) = self.nodes.get_mut(at as usize) {
            self.open.push(node.event);
            let next = std::mem::replace(&mut node.next, self.free);
            self.free = at;
            at = next;
        }
        self.occupied[index / 64] &= !(1 << (index % 64));
        if self.occupied[index / 64] == 0 {
            self.summary &= !(1 << (index / 64));
        }
        while let Some(Reverse(event)) = self.far.peek() {
            let far_slot = event.time_fs >> SLOT_BITS;
            if far_slot - slot >= SLOTS as i64 {
                break;
            }
            let Reverse(event) = self.far.pop().expect("peeked");
            if far_slot == slot {
                self.open.push(event);
            } else {
                self.put(far_slot, event);
            }
        }
        if self.open.len() > 1 {
            self.open.sort_unstable_by_key(|e| (e.time_fs, e.net));
        }
    }

    /// The first occupied slot after the open one, going once around the wheel.
    #[inline]
    fn next_slot(&self) -> Option<i64> {
        if self.summary == 0 {
            return None;
        }
        let start = (self.open_slot as usize + 1) % SLOTS;
        let (word, bit) = (start / 64, start % 64);
        let here = self.occupied[word] >> bit << bit;
        let index = if here != 0 {
            word * 64 + here.trailing_zeros() as usize
        } else {
            // Words after this one, then around to it again.
            let turned = self.summary.rotate_right((word as u32 + 1) % WORDS as u32);
            let next = (word + 1 + turned.trailing_zeros() as usize) % WORDS;
            next * 64 + self.occupied[next].trailing_zeros() as usize
        };
        let ahead = (index + SLOTS - self.open_slot as usize % SLOTS) % SLOTS;
        Some(self.open_slot + ahead as i64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against a sorted list, with pushes interleaved with pops as a simulation does them.
        #[test]
        fn delivers_in_time_order(
            delays in prop::collection::vec((0i64..100_000_000, 0u32..50), 1..400),
        ) {
            let mut wheel = TimeWheel::new();
            let mut reference: Vec<(i64, u32)> = Vec::new();
            let mut now = 0;
            for (i, chunk) in delays.chunks(5).enumerate() {
                for &(delay, net) in chunk {
                    // Every third round stays within a slot.
                    let delay = if i % 3 == 0 { delay % 5_000 } else { delay };
                    wheel.push(Event { time_fs: now + delay, net, tag: 0 });
                    reference.push((now + delay, net));
                }
                reference.sort_unstable();
                for _ in 0..3 {
                    let Some(time) = wheel.next_time(i64::MAX - 1) else { break };
                    now = time;
                    wheel.advance(now);
                    let event = wheel.pop_at(now).unwrap();
                    prop_assert_eq!((event.time_fs, event.net), reference.remove(0));
                }
            }
            while let Some(time) = wheel.next_time(i64::MAX - 1) {
                wheel.advance(time);
                let event = wheel.pop_at(time).unwrap();
                prop_assert_eq!((event.time_fs, event.net), reference.remove(0));
            }
            prop_assert!(reference.is_empty());
        }

        #[test]
        fn never_passes_its_limit(times in prop::collection::vec(0i64..200_000_000, 1..50), limit in 0i64..200_000_000) {
            let mut wheel = TimeWheel::new();
            for &time_fs in &times {
                wheel.push(Event { time_fs, net: 0, tag: 0 });
            }
            let mut seen = 0;
            while let Some(t) = wheel.next_time(limit) {
                wheel.advance(t);
                wheel.pop_at(t).unwrap();
                seen += 1;
            }
            prop_assert_eq!(seen, times.iter().filter(|&&t| t <= limit).count());
        }
    }
}
