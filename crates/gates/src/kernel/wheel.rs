//! The event queue: a short sorted list of what comes next, a time wheel with an occupancy bitmap, and a heap for the far
//! future.
//!
//! Gate delays span tens to hundreds of picoseconds, so nearly every event falls into the wheel's
//! 16.8 ns; long quiet gaps between events are skipped by scanning the bitmap. Events of
//! one 8.2 ps slot are sorted by (time, net) when the slot is opened. At most one *valid* event per
//! net exists, so that order is total; cancelled events stay queued and are recognised by their
//! generation.
//!
//! ```text
//!   near ─► event, event, … before `horizon`, sorted      first[slot] ──► node ──► node ──► NONE, from `horizon` on
//! ```
//!
//! Where few events are on their way at once, as in a small block, all are in the sorted list, and the wheel
//! is empty. Where the list grows to twice [`MOST_NEAR`], its last slots go to the wheel. The wheel's slots are linked
//! lists in one pool whose nodes are taken again last freed first, so that what it touches stays in the nearest cache.

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

/// Events that may stay in the sorted list when it is shortened, which it is at twice as many. Chosen.
const MOST_NEAR: usize = 24;

/// Events in time order. Time never runs backwards: pushes must not precede [`TimeWheel::advance`].
#[derive(Debug, Clone)]
pub(super) struct TimeWheel {
    /// Events in slots before `horizon`, sorted by (time, net); those before `position` are over.
    near: Vec<Event>,
    position: usize,
    /// First slot whose events are in the wheel.
    horizon: i64,
    /// Slot of the present: the wheel's slots lie from here to once around it.
    present: i64,
    /// First node of each slot's list.
    first: Box<[u32; SLOTS]>,
    nodes: Vec<Node>,
    /// First node that is not in use.
    free: u32,
    occupied: [u64; WORDS],
    /// Bit w is set when `occupied[w]` is not zero.
    summary: u32,
    far: BinaryHeap<Reverse<Event>>,
}

impl TimeWheel {
    pub(super) fn new() -> Self {
        TimeWheel {
            near: Vec::new(),
            position: 0,
            horizon: i64::MAX,
            present: 0,
            first: Box::new([NONE; SLOTS]),
            nodes: Vec::new(),
            free: NONE,
            occupied: [0; WORDS],
            summary: 0,
            far: BinaryHeap::new(),
        }
    }

    #[inline]
    pub(super) fn push(&mut self, event: Event) {
        let slot = event.time_fs >> SLOT_BITS;
        debug_assert!(slot >= self.present, "an event before the present");
        if slot >= self.horizon {
            return self.insert_event(slot, event);
        }
        let key = (event.time_fs, event.net);
        // What is pushed last mostly comes last.
        let mut at = self.near.len();
        while at > self.position && (self.near[at - 1].time_fs, self.near[at - 1].net) > key {
            at -= 1;
        }
        self.near.insert(at, event);
        if self.near.len() > 2 * MOST_NEAR {
            self.shorten();
        }
    }

    /// Forgets what is over, and moves the last slots to the wheel where the list is still long.
    #[cold]
    fn shorten(&mut self) {
        self.near.drain(..self.position);
        self.position = 0;
        if self.near.len() <= MOST_NEAR {
            return;
        }
        let horizon = (self.near[MOST_NEAR / 2].time_fs >> SLOT_BITS) + 1;
        self.horizon = horizon;
        let is_near = |event: &Event| event.time_fs >> SLOT_BITS < horizon;
        let stay = self.near.partition_point(is_near);
        for at in stay..self.near.len() {
            let event = self.near[at];
            self.insert_event(event.time_fs >> SLOT_BITS, event);
        }
        self.near.truncate(stay);
    }

    /// Into the wheel, or where that does not reach.
    fn insert_event(&mut self, slot: i64, event: Event) {
        if slot - self.present >= SLOTS as i64 {
            return self.far.push(Reverse(event));
        }
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
            if let Some(event) = self.near.get(self.position) {
                return (event.time_fs <= limit_fs).then_some(event.time_fs);
            }
            self.near.clear();
            self.position = 0;
            if self.horizon == i64::MAX {
                return None;
            }
            let slot = match (self.next_slot(), self.far.peek()) {
                (Some(slot), _) => slot,
                (None, Some(Reverse(event))) => event.time_fs >> SLOT_BITS,
                (None, None) => {
                    self.horizon = i64::MAX;
                    return None;
                }
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
        let event = *self.near.get(self.position)?;
        (event.time_fs == time_fs).then(|| {
            self.position += 1;
            event
        })
    }

    /// Moves the present to `time_fs`; no event may be due before it.
    #[inline]
    pub(super) fn advance(&mut self, time_fs: i64) {
        let slot = time_fs >> SLOT_BITS;
        if slot != self.present {
            debug_assert!(slot > self.present, "the past");
            self.present = slot;
            if !self.far.is_empty() {
                self.approach();
            }
            // Events of the present are in the list, so that what is pushed into its slot comes in order.
            if slot >= self.horizon {
                self.open(slot);
            }
        }
    }

    /// Takes into the wheel what it reaches by now.
    #[cold]
    fn approach(&mut self) {
        while let Some(Reverse(event)) = self.far.peek() {
            let slot = event.time_fs >> SLOT_BITS;
            if slot - self.present >= SLOTS as i64 {
                break;
            }
            let Reverse(event) = self.far.pop().expect("peeked");
            self.insert_event(slot, event);
        }
    }

    /// Moves the wheel's first slot to the list; nothing may be in the wheel before it.
    fn open(&mut self, slot: i64) {
        self.present = slot;
        self.approach();
        self.horizon = slot + 1;
        let from = self.near.len();
        let index = slot as usize % SLOTS;
        let mut at = std::mem::replace(&mut self.first[index], NONE);
        while let Some(node) = self.nodes.get_mut(at as usize) {
            self.near.push(node.event);
            let next = std::mem::replace(&mut node.next, self.free);
            self.free = at;
            at = next;
        }
        self.occupied[index / 64] &= !(1 << (index % 64));
        if self.occupied[index / 64] == 0 {
            self.summary &= !(1 << (index / 64));
        }
        if self.summary == 0 && self.far.is_empty() {
            self.horizon = i64::MAX;
        }
        if self.near.len() > from + 1 {
            self.near[from..].sort_unstable_by_key(|e| (e.time_fs, e.net));
        }
    }

    /// The first occupied slot from the present on, going once around the wheel.
    #[inline]
    fn next_slot(&self) -> Option<i64> {
        if self.summary == 0 {
            return None;
        }
        let start = self.present as usize % SLOTS;
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
        let ahead = (index + SLOTS - start) % SLOTS;
        Some(self.present + ahead as i64)
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
