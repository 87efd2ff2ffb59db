//! The window engine: only what a start value can see.
//!
//! The window law gives the rising CLK edges whose photons reach a bin. Each pulse is taken by one edge;
//! the pulses of one edge that lies in the window of some laser cycle are summed, compared and counted.
//! CLK periods without photons are never visited: what an empty period does is the same for all of them
//! and is added in one step.
//!
//! In the light of a photon stream it draws only the slots that a window can see and those before it that may have
//! blinded a SPAD ([`sight`]), and counts them a group of laser cycles at a time ([`counting`]). Macropixels whose
//! SPADs are off or whose window never opens are left out.

mod binning;
mod codes;
mod counting;
mod echo_rows;
mod past;
mod sight;
mod tables;

use super::{Cancelling, Engine, EngineError, Expose, Exposed, LitPixel, Replay, Work, follows};
use crate::chip::window_law::OpenWindow;
use crate::chip::{Exposure, Mode, SensorConfig, WindowLaw, correlation, histogram, window_law};
use crate::photon::{PhotonStream, PixelLight, SpadEvent};
use counting::Counting;
use sight::Sight;

/// Counts through the window law.
pub struct Window<'a> {
    config: &'a SensorConfig,
    exposure: &'a Exposure,
    law: WindowLaw,
}

impl<'a> Window<'a> {
    /// An engine for this sensor and exposure.
    pub fn new(config: &'a SensorConfig, exposure: &'a Exposure) -> Self {
        Self::with_law(config, exposure, WindowLaw::new(config, exposure))
    }

    /// An engine for macropixels with delays of their own, which `law` is made of.
    pub(super) fn with_law(
        config: &'a SensorConfig,
        exposure: &'a Exposure,
        law: WindowLaw,
    ) -> Self {
        Window {
            config,
            exposure,
            law,
        }
    }

    /// The window of a start value, if it opens.
    fn window(&self, start: u16) -> Result<Option<OpenWindow>, EngineError> {
        follows(self.config, &self.law.timing().pulses)?;
        match self.law.window(start) {
            window_law::Window::Open(window) => Ok(Some(window)),
            window_law::Window::Never => Ok(None),
            window_law::Window::Irregular(why) => Err(EngineError::Irregular(why)),
            window_law::Window::Race(why) => Err(EngineError::Race(why)),
        }
    }

    /// Whether all photons of a macropixel are drawn, and not only those that its window may see: laser cycles hardly
    /// longer than the window, or SPADs that are blind nearly all the time.
    pub fn draws_whole_cycles(&self, stream: &PhotonStream, pixel: &LitPixel) -> bool {
        let window = self.law.window(pixel.start).open();
        window.zip(pixel.light).is_some_and(|(window, light)| {
            sight::is_blinding(stream, &light) || Sight::new(&self.law, &window, stream).is_none()
        })
    }

    fn is_event(&self, spads: u16) -> bool {
        correlation::model(spads, self.config.event_type, self.config.threshold)
    }

    /// Hits of every bin in the dark. A conventional cycle is latched by the STOP edge that ends it; the exposure's first
    /// STOP edge ends one, too.
    fn dark_hits(&self, first_edge: i64) -> Vec<i64> {
        let bins = self.config.bins as i64;
        if !self.is_event(0) {
            return vec![0; self.config.bins];
        }
        let periods = self.exposure.stop_periods as i64;
        let cycles = self.exposure.laser_cycles as i64;
        (0..bins)
            .map(|bin| {
                // The pipeline starts empty: nothing before rising edge -1 was ever compared.
                let first_compared = (-1 - first_edge - bin + periods - 1).div_euclid(periods);
                (cycles - first_compared.max(self.first_cycle())).max(0)
            })
            .collect()
    }

    fn first_cycle(&self) -> i64 {
        match self.config.mode {
            Mode::Guided => 0,
            Mode::Conventional => -1,
        }
    }

    /// What a CLK period with light adds to the hits of its bin, beyond those in the dark.
    fn adds(&self, spads: u16) -> i64 {
        i64::from(self.is_event(spads)) - i64::from(self.is_event(0))
    }

    /// Counts pulses, sorted by time, of which no edge takes two parts.
    fn count_pulses(&self, pulses: &[SpadEvent], first_edge: i64, hits: &mut [i64]) {
        let bins = self.config.bins as i64;
        let periods = self.exposure.stop_periods as i64;
        let cycles = self.exposure.laser_cycles as i64;
        for (edge, spads) in taken(pulses, |p| self.law.edge_of(p.time)) {
            let adds = self.adds(spads);
            if adds == 0 {
                continue;
            }
            let offset = edge - first_edge;
            let last_cycle = offset.div_euclid(periods).min(cycles - 1);
            // More than one laser cycle sees an edge only when a cycle is shorter than the window.
            for cycle in (self.first_cycle()..=last_cycle).rev() {
                let bin = offset - cycle * periods;
                if bin >= bins {
                    break;
                }
                hits[bin as usize] += adds;
            }
        }
    }

    /// Counts all pulses of a macropixel, part by part.
    fn count_stream(
        &self,
        stream: &PhotonStream,
        pixel: &LitPixel,
        light: &PixelLight,
        first_edge: i64,
    ) -> (Vec<i64>, Work) {
        let config = stream.config();
        let cancelling = Cancelling::of(config.spads.dead_time, config.clock, || self.law.clone());
        let mut hits = self.dark_hits(first_edge);
        let mut work = Work::default();
        let mut cancelled = 0;
        let mut count = |pulses: &[SpadEvent]| {
            self.count_pulses(pulses, first_edge, &mut hits);
            let seen = cancelling
                .as_ref()
                .map(|cancelling| cancelling.seen(pixel.start, pulses));
            cancelled += seen.unwrap_or(0);
        };
        // Pulses that the next ones may share an edge with.
        let mut waiting: Vec<SpadEvent> = Vec::new();
        let photons = stream.pixel_pulses(pixel.number, light, |pulses| {
            work.pulses += pulses.len() as u64;
            waiting.extend_from_slice(pulses);
            let Some(last) = waiting.last() else {
                return;
            };
            let last_edge = self.law.edge_of(last.time);
            let done = waiting.partition_point(|pulse| self.law.edge_of(pulse.time) < last_edge);
            count(&waiting[..done]);
            waiting.drain(..done);
        });
        count(&waiting);
        work.cancelled = cancelled;
        work.photons_drawn = photons.drawn;
        work.lost_to_dead_time = photons.lost_to_dead_time;
        work.clk_periods_visited = u64::from(config.stop_periods) * u64::from(config.laser_cycles);
        (hits, work)
    }

    fn counts(&self, hits: &[i64]) -> Vec<u16> {
        let (bits, overflow) = (self.config.bin_bits as u32, self.config.overflow);
        hits.iter()
            .map(|&n| histogram::model(n as u64, bits, overflow))
            .collect()
    }
}

impl Engine for Window<'_> {
    fn law(&self) -> WindowLaw {
        self.law.clone()
    }

    fn bins(&self) -> usize {
        self.config.bins
    }
}

impl Replay for Window<'_> {
    fn histogram(&self, start: u16, pulses: &[SpadEvent]) -> Result<Vec<u16>, EngineError> {
        let Some(window) = self.window(start)? else {
            return Ok(vec![0; self.config.bins]);
        };
        let mut hits = self.dark_hits(window.first_edge);
        self.count_pulses(pulses, window.first_edge, &mut hits);
        Ok(self.counts(&hits))
    }
}

impl Expose for Window<'_> {
    fn expose(&self, stream: &PhotonStream, pixels: &[LitPixel]) -> Result<Exposed, EngineError> {
        let mut counting = Counting::new(self, stream);
        let mut exposed = Exposed::new(self.config.bins);
        let clk_periods =
            u64::from(self.exposure.stop_periods) * u64::from(self.exposure.laser_cycles);
        for pixel in pixels {
            let Some(light) = &pixel.light else {
                exposed.histograms.push(&self.histogram(pixel.start, &[])?);
                exposed.work.skipped_dark += 1;
                continue;
            };
            let Some(window) = self.window(pixel.start)? else {
                exposed.histograms.push(&vec![0; self.config.bins]);
                exposed.work.skipped_closed += 1;
                continue;
            };
            let sight = Sight::new(&self.law, &window, stream);
            let sight = sight.filter(|_| !sight::is_blinding(stream, light));
            let (hits, work) = match sight {
                Some(sight) => {
                    let plain = stream.pixel(pixel.number, light);
                    let breeding = stream.breeding(pixel.number, light);
                    counting.expose(&sight, &plain, breeding.as_ref())
                }
                None => self.count_stream(stream, pixel, light, window.first_edge),
            };
            exposed.histograms.push(&self.counts(&hits));
            exposed.work += work;
        }
        exposed.work.macropixels += pixels.len() as u64;
        exposed.work.clk_periods += pixels.len() as u64 * clk_periods;
        Ok(exposed)
    }
}

/// Pulses grouped by the edge that takes them: (edge, SPADs with an odd number of pulses).
fn taken<'p>(
    pulses: &'p [SpadEvent],
    edge_of: impl Fn(&SpadEvent) -> i64 + 'p,
) -> impl Iterator<Item = (i64, u16)> + 'p {
    let mut pulses = pulses
        .iter()
        .map(move |pulse| (edge_of(pulse), pulse.spad))
        .peekable();
    std::iter::from_fn(move || {
        let (edge, spad) = pulses.next()?;
        let mut spads = 1 << spad;
        while let Some((_, spad)) = pulses.next_if(|&(e, _)| e == edge) {
            spads ^= 1 << spad;
        }
        Some((edge, spads))
    })
}
