//! Pulses through the window law: which bins they count in.

use std::borrow::Cow;

use crate::chip::window_law::OpenWindow;
use crate::chip::{Exposure, Sensor, Tdc, WindowLaw, correlation, histogram, photon_line};
use crate::engine::EngineError;
use crate::engine::error::{follows, has_a_line_a_spad, refuse_races};
use crate::photon::SpadEvent;

/// Counts through the window law.
#[derive(Clone)]
pub struct Window {
    pub(super) sensor: Sensor,
    pub(super) exposure: Exposure,
    pub(super) law: WindowLaw,
    /// Whether `law` is that of one macropixel, where each has its own.
    pub(super) is_of_macropixel: bool,
}

impl Window {
    /// An engine for this sensor and exposure.
    pub fn new(sensor: impl Into<Sensor>, exposure: &Exposure) -> Self {
        Self::with_law(WindowLaw::new(sensor, exposure))
    }

    /// An engine for macropixels with delays, or edges of bins, of their own, which `law` is made of.
    pub fn with_law(law: WindowLaw) -> Self {
        Window {
            sensor: law.sensor().clone(),
            exposure: *law.exposure(),
            law,
            is_of_macropixel: false,
        }
    }

    /// An engine for any number of exposures of the one macropixel that `law` is of, whatever their numbers.
    pub fn of_one(law: WindowLaw) -> Self {
        Window {
            is_of_macropixel: true,
            ..Self::with_law(law)
        }
    }

    /// This engine with the law of a macropixel.
    pub(super) fn of_macropixel(&self, number: u32) -> Cow<'_, Self> {
        if self.sensor.has_own_laws() && !self.is_of_macropixel {
            Cow::Owned(Self::of_one(self.law.of_macropixel(number)))
        } else {
            Cow::Borrowed(self)
        }
    }

    /// The window of a start value, if it opens.
    pub(super) fn window(&self, start: u16) -> Result<Option<OpenWindow>, EngineError> {
        self.refuse(std::iter::once(start))?;
        Ok(self.law.window(start).settled()?)
    }

    /// Refuses a sensor that this engine does not follow, and start values whose signals race.
    pub(super) fn refuse(&self, starts: impl Iterator<Item = u16>) -> Result<(), EngineError> {
        follows(&self.sensor, &self.law.timing().pulses)?;
        has_a_line_a_spad(&self.sensor)?;
        refuse_races(&self.law, starts)
    }

    fn is_event(&self, spads: u64) -> bool {
        correlation::model(spads, self.sensor.event_type, self.sensor.threshold)
    }

    /// What the SPADs that fire in a bin add to its hits, beyond those of an empty macropixel.
    pub(super) fn adds(&self, spads: u64) -> i64 {
        match self.sensor.tdc {
            Tdc::DelayLine => i64::from(spads.count_ones() % 2),
            Tdc::Counter => i64::from(spads.count_ones()),
            Tdc::Clocked => i64::from(self.is_event(spads)) - i64::from(self.is_event(0)),
        }
    }

    /// Counts pulses, sorted by time, of which no bin takes two parts.
    pub(super) fn count_pulses(&self, pulses: &[SpadEvent], window: &OpenWindow, hits: &mut [i64]) {
        if self.sensor.tdc == Tdc::DelayLine {
            let mut edges = pulses.to_vec();
            self.keep_line_edges(&mut edges, |pulse| *pulse);
            return self.count_between_edges(&edges, window, hits);
        }
        if !self.law.has_clk_bins() {
            return self.count_between_edges(pulses, window, hits);
        }
        for (edge, spads) in odd_spads_by(pulses, |pulse| self.law.edge_of(pulse.time)) {
            let adds = self.adds(spads);
            if adds != 0 {
                for bin in self.law.bins_of_edge(window, edge) {
                    hits[bin] += adds;
                }
            }
        }
    }

    /// Keeps those of some pulses that leave an edge on the photon line.
    pub(super) fn keep_line_edges<P: Copy>(
        &self,
        pulses: &mut Vec<P>,
        event_of: impl Fn(&P) -> SpadEvent,
    ) {
        let stage = self.law.timing().photon_line_stage;
        let time_and_spad = |pulse: &P| {
            let event = event_of(pulse);
            (event.time, event.spad)
        };
        photon_line::model(pulses, time_and_spad, self.sensor.spads(), stage);
    }

    /// The same by the edges of the bins, whatever those are: laser cycle by laser cycle, leaving out those without pulses.
    pub(super) fn count_between_edges(
        &self,
        pulses: &[SpadEvent],
        window: &OpenWindow,
        hits: &mut [i64],
    ) {
        let cycles = self.law.latched_cycles();
        let mut cycle = cycles.start;
        let mut pulses = pulses;
        while cycle < cycles.end {
            let seen = self.law.interval_in(window, cycle);
            // The next laser cycle's window may begin before this one's has ended.
            pulses = &pulses[pulses.partition_point(|pulse| pulse.time < seen.start)..];
            let Some(next) = pulses.first() else {
                return;
            };
            if next.time < seen.end {
                let within = pulses.partition_point(|pulse| pulse.time < seen.end);
                let edges = self.law.edges(window, cycle);
                let bin_of = |pulse: &SpadEvent| edges.bin_of(pulse.time);
                for (bin, spads) in odd_spads_by(&pulses[..within], bin_of) {
                    let bin = bin.expect("a window is its bins");
                    hits[bin] += self.adds(spads);
                }
                cycle += 1;
            } else {
                // Laser cycles are equal but for a femtosecond: at the latest in the one after these the pulse may be seen.
                let cycle_fs = self.exposure.stop(1).as_fs();
                let without = (next.time - seen.end).as_fs() / cycle_fs;
                cycle += without.max(1);
            }
        }
    }

    pub(super) fn counts(&self, hits: &[i64]) -> Vec<u16> {
        histogram::counts(&self.sensor, hits.iter().map(|&n| n as u64))
    }
}

/// Pulses grouped by what takes them, a CLK edge or a bin, and the SPADs with an odd number of them.
fn odd_spads_by<'p, K: PartialEq + 'p>(
    pulses: &'p [SpadEvent],
    taker_of: impl Fn(&SpadEvent) -> K + 'p,
) -> impl Iterator<Item = (K, u64)> + 'p {
    let mut pulses = pulses
        .iter()
        .map(move |pulse| (taker_of(pulse), pulse.spad))
        .peekable();
    std::iter::from_fn(move || {
        let (taker, spad) = pulses.next()?;
        let mut spads = 1 << spad;
        while let Some((_, spad)) = pulses.next_if(|(other, _)| *other == taker) {
            spads ^= 1 << spad;
        }
        Some((taker, spads))
    })
}
