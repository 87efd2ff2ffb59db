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
mod photon_selection;
mod pulses;
mod row_ranks;
mod sight;
mod table;
mod tables;

use std::borrow::Cow;

use super::exposing::refuse_other_spads;
use super::traits::by_own_clk;
use super::{
    Cancelling, Engine, EngineError, EngineWork, Expose, ExposureResult, Histograms, LitPixel,
    PulsedPixel, Replay,
};
use crate::chip::WindowLaw;
use crate::chip::window_law::OpenWindow;
use crate::photon::{PhotonStream, PixelLight, SpadEvent};
use counting::Counting;
pub use pulses::Window;
use sight::Sight;

/// A window that opens, and what decides its histogram where that is a part of every laser cycle.
type SightedWindow = (OpenWindow, Option<Sight>);

impl Window {
    /// Whether all photons of a macropixel are drawn, and not only those that its window may see: laser cycles hardly
    /// longer than the window, SPADs that are blind nearly all the time, or bins that are not CLK periods.
    pub fn draws_whole_cycles(&self, stream: &PhotonStream, pixel: &LitPixel) -> bool {
        let window = self.law.window(pixel.start).open();
        window
            .zip(pixel.light.as_ref())
            .is_some_and(|(window, light)| {
                sight::is_blinding(stream, light)
                    || Sight::new(&self.law, &window, stream).is_none()
            })
    }

    /// Counts all pulses of a macropixel, part by part.
    fn count_stream(
        &self,
        stream: &PhotonStream,
        pixel: &LitPixel,
        light: &PixelLight,
        window: &OpenWindow,
    ) -> (Vec<i64>, EngineWork) {
        let config = stream.config();
        let cancelling =
            Cancelling::from_law(config.spads.shortest_dead_time(), config.clock, || {
                self.law.clone()
            });
        let mut hits = self.law.empty_hits(window);
        let mut work = EngineWork::default();
        let mut cancelled = 0;
        let mut count = |pulses: &[SpadEvent]| {
            self.count_pulses(pulses, window, &mut hits);
            let seen = cancelling
                .as_ref()
                .map(|cancelling| cancelling.cancelled_pulses(pixel.start, pulses));
            cancelled += seen.unwrap_or(0);
        };
        // Pulses that the next ones may share a bin with.
        let mut waiting: Vec<SpadEvent> = Vec::new();
        let photons = stream.pixel_pulses(pixel.number, light, |pulses| {
            work.pulses += pulses.len() as u64;
            waiting.extend_from_slice(pulses);
            let Some(last) = waiting.last().filter(|_| self.law.has_clk_bins()) else {
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
}

impl Engine for Window {
    fn law(&self) -> WindowLaw {
        self.law.clone()
    }

    /// Macropixels in bright light stand together, and take so much longer than others that in larger batches some processors wait.
    fn batch(&self) -> usize {
        16
    }
}

impl Replay for Window {
    fn replay(&self, pixels: &[PulsedPixel<'_>]) -> Result<Histograms, EngineError> {
        self.refuse(pixels.iter().map(|pixel| pixel.start))?;
        let mut histograms = Histograms::new(self.sensor.bins);
        for &PulsedPixel {
            number,
            start,
            pulses,
        } in pixels
        {
            let engine = self.of_macropixel(number);
            let mut hits = vec![0; self.sensor.bins];
            if let Some(window) = engine.window(start)? {
                hits = engine.law.empty_hits(&window);
                engine.count_pulses(pulses, &window, &mut hits);
            }
            histograms.push(&self.counts(&hits));
        }
        Ok(histograms)
    }

    fn as_the_law_sees<'p>(&self, number: u32, pulses: &'p [SpadEvent]) -> Cow<'p, [SpadEvent]> {
        if self.is_of_macropixel {
            Cow::Borrowed(pulses)
        } else {
            by_own_clk(&self.sensor, number, pulses)
        }
    }
}

impl Expose for Window {
    fn expose(
        &self,
        stream: &PhotonStream,
        pixels: &[LitPixel],
    ) -> Result<ExposureResult, EngineError> {
        refuse_other_spads(stream, pixels)?;
        self.refuse(pixels.iter().map(|pixel| pixel.start))?;
        if self.sensor.has_own_laws() && !self.is_of_macropixel {
            let mut exposed = ExposureResult::new(self.sensor.bins);
            for pixel in pixels {
                let engine = self.of_macropixel(pixel.number);
                let alone = engine.expose(stream, std::slice::from_ref(pixel))?;
                exposed.histograms.append(&alone.histograms);
                exposed.work += alone.work;
            }
            return Ok(exposed);
        }
        let mut counting = Counting::new(self, stream);
        let mut exposed = ExposureResult::new(self.sensor.bins);
        // Many exposures of one macropixel, as a sweep takes them, are in one window.
        let mut last: Option<(u16, Option<SightedWindow>)> = None;
        let clk_periods =
            u64::from(self.exposure.stop_periods) * u64::from(self.exposure.laser_cycles);
        for pixel in pixels {
            let Some(light) = &pixel.light else {
                exposed.histograms.push(&self.histogram(pixel.start, &[])?);
                exposed.work.skipped_dark += 1;
                continue;
            };
            let seen = match last.take() {
                Some((start, seen)) if start == pixel.start => seen,
                _ => self
                    .window(pixel.start)?
                    .map(|window| (window, Sight::new(&self.law, &window, stream))),
            };
            let (_, seen) = last.insert((pixel.start, seen));
            let Some((window, sight)) = seen else {
                exposed.histograms.push(&vec![0; self.sensor.bins]);
                exposed.work.skipped_closed += 1;
                continue;
            };
            let sight = sight.as_ref();
            let sight = sight.filter(|_| !sight::is_blinding(stream, light));
            let (hits, work) = match sight {
                Some(sight) => {
                    let parts = stream.parts(pixel.number, light);
                    counting.expose(sight, &parts)
                }
                None => self.count_stream(stream, pixel, light, window),
            };
            exposed.histograms.push(&self.counts(&hits));
            exposed.work += work;
        }
        counting.finish();
        exposed.work.macropixels += pixels.len() as u64;
        exposed.work.clk_periods += pixels.len() as u64 * clk_periods;
        Ok(exposed)
    }
}
