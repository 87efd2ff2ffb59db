//! Pulses of a block's macropixels, sorted into the chunks of CLK periods that take them.
//!
//! Which CLK edge takes a pulse is the window law's to say ([`WindowLaw::edge_of`]). This is the
//! one place where photons cost anything by themselves: everything after it works on whole words.

use super::word::WORD_LANES;
use crate::chip::{MOST_SPADS, WindowLaw};
use crate::photon::SpadEvent;

/// One pulse in a chunk: its period there, its SPAD and its lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Pulse(u32);

/// CLK periods in a chunk.
pub(super) const PERIODS: usize = 16;

const _: () = assert!(MOST_SPADS <= 1 << 6 && WORD_LANES <= 1 << 10 && PERIODS <= 1 << 16);

impl Pulse {
    fn new(period: usize, spad: usize, lane: usize) -> Self {
        Pulse((period << 16 | spad << 10 | lane) as u32)
    }

    /// Rising edge within the chunk.
    #[inline(always)]
    pub(super) fn period(self) -> usize {
        (self.0 >> 16) as usize
    }

    /// SPAD.
    #[inline(always)]
    pub(super) fn spad(self) -> usize {
        (self.0 >> 10 & 0x3f) as usize
    }

    /// Lane.
    #[inline(always)]
    pub(super) fn lane(self) -> usize {
        (self.0 & 0x3ff) as usize
    }
}

/// The pulses of a block.
#[derive(Debug, Default)]
pub(super) struct Packed {
    pulses: Vec<Pulse>,
    /// First pulse of every chunk, and the end.
    chunks: Vec<u32>,
}

impl Packed {
    /// Sorts one list of pulses per lane into `chunks` chunks; later pulses are left out.
    pub(super) fn new<'p>(
        law: &WindowLaw,
        chunks: usize,
        lanes: impl Iterator<Item = &'p [SpadEvent]> + Clone,
    ) -> Self {
        let edges = chunks * PERIODS;
        let taken = |events: &'p [SpadEvent]| {
            let edges_of = events
                .iter()
                .map(move |event| (law.edge_of(event.time).max(0) as usize, event.spad));
            edges_of.take_while(move |&(edge, _)| edge < edges)
        };
        let mut ends = vec![0u32; chunks + 1];
        for events in lanes.clone() {
            for (edge, _) in taken(events) {
                ends[edge / PERIODS + 1] += 1;
            }
        }
        for chunk in 0..chunks {
            ends[chunk + 1] += ends[chunk];
        }
        let mut next = ends.clone();
        let mut pulses = vec![Pulse(0); ends[chunks] as usize];
        for (lane, events) in lanes.enumerate() {
            for (edge, spad) in taken(events) {
                let place = &mut next[edge / PERIODS];
                pulses[*place as usize] = Pulse::new(edge % PERIODS, usize::from(spad), lane);
                *place += 1;
            }
        }
        Packed {
            pulses,
            chunks: ends,
        }
    }

    /// The pulses of one chunk; none after the last.
    pub(super) fn chunk(&self, chunk: usize) -> &[Pulse] {
        match self.chunks[chunk.min(self.chunks.len() - 1)..] {
            [first, end, ..] => &self.pulses[first as usize..end as usize],
            _ => &[],
        }
    }
}
