//! Pulses of a block's macropixels, sorted into the chunks of CLK periods that take them.
//!
//! A pulse is taken by the first rising CLK edge at or after pulse + clk-to-Q of the flip-flop that it toggles, to
//! the femtosecond. This is the one place where photons cost anything by themselves: everything after it works
//! on whole words.

use super::stream::PERIODS;
use super::word::WORD_LANES;
use crate::chip::{Exposure, SPADS};
use crate::photon::SpadEvent;
use crate::units::Time;

/// One pulse in a chunk: its period there, its SPAD and its lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pulse(u32);

const _: () = assert!(SPADS <= 16 && WORD_LANES <= 1 << 12 && PERIODS <= 1 << 16);

impl Pulse {
    fn new(period: usize, spad: usize, lane: usize) -> Self {
        Pulse((period << 16 | spad << 12 | lane) as u32)
    }

    /// Rising edge within the chunk.
    #[inline(always)]
    pub fn period(self) -> usize {
        (self.0 >> 16) as usize
    }

    /// SPAD.
    #[inline(always)]
    pub fn spad(self) -> usize {
        (self.0 >> 12 & 15) as usize
    }

    /// Lane.
    #[inline(always)]
    pub fn lane(self) -> usize {
        (self.0 & 0xfff) as usize
    }
}

/// Which rising CLK edge takes a pulse.
#[derive(Debug, Clone, Copy)]
pub struct Sampling<'a> {
    exposure: &'a Exposure,
    /// SPAD_RAW rising to the toggle flip-flop's output.
    latency: Time,
    period_fs: f64,
}

impl<'a> Sampling<'a> {
    /// For a front end with this latency.
    pub fn new(exposure: &'a Exposure, latency: Time) -> Self {
        Sampling {
            exposure,
            latency,
            period_fs: 1e15 / exposure.clock.as_hz(),
        }
    }

    /// The first rising CLK edge of the exposure at or after the pulse has toggled its flip-flop.
    #[inline]
    pub fn edge(&self, pulse: Time) -> usize {
        let sampled = pulse + self.latency;
        let periods = (sampled + self.exposure.stop_phase).as_fs() as f64 / self.period_fs - 0.5;
        let edge = periods.ceil();
        // Exact arithmetic only where rounding could decide.
        let edge = if (edge - periods - 0.5).abs() < 0.499 {
            edge as i64
        } else {
            self.exposure.rising_until(sampled - Time::from_fs(1)) + 1
        };
        edge.max(0) as usize
    }
}

/// The pulses of a block.
#[derive(Debug, Default)]
pub struct Packed {
    pulses: Vec<Pulse>,
    /// First pulse of every chunk, and the end.
    chunks: Vec<u32>,
}

impl Packed {
    /// Sorts one list of pulses per lane into `chunks` chunks; later pulses are left out.
    pub fn new<'p>(
        sampling: Sampling<'_>,
        chunks: usize,
        lanes: impl Iterator<Item = &'p [SpadEvent]> + Clone,
    ) -> Self {
        let edges = chunks * PERIODS;
        let taken = |events: &'p [SpadEvent]| {
            let edges_of = events
                .iter()
                .map(move |event| (sampling.edge(event.time), event.spad));
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

    /// The pulses of one chunk.
    pub fn chunk(&self, chunk: usize) -> &[Pulse] {
        &self.pulses[self.chunks[chunk] as usize..self.chunks[chunk + 1] as usize]
    }
}
