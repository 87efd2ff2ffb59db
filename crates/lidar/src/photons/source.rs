//! The light of an exposure on an array of SPADs, and the pulses that these make of it.

use std::ops::ControlFlow;

use rayon::prelude::*;

use crate::chip::Sensor;
use crate::engine::{EngineError, refuse_floods};
use crate::photon::{PhotonStream, PixelLight, SpadEvent, SpadLayout, SpadModel, StreamConfig};
use crate::scene::{GroundTruth, Scene, is_beyond_model};
use crate::system::TakenFrame;
use crate::units::{Frequency, Time};

/// Bytes of pulses that are kept at a time, unless they are written as they come. Chosen, as for the engines.
const MOST_KEPT_BYTES: f64 = 64e6;

/// Background photons of a macropixel in a laser cycle that are held in memory at most: 0.2 GB on each thread.
const MOST_IN_CYCLE: f64 = 1e7;

/// Why there are no pulses of a light.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LightSourceError {
    /// An echo has too many photons.
    #[error(transparent)]
    Echo(#[from] EngineError),
    /// Background light has too many photons in a laser cycle.
    #[error(
        "background light has {photons:.1e} photons a laser cycle on a macropixel, of which {most_photons:.0e} are held in memory"
    )]
    Background {
        /// Photons of the background in a laser cycle, on average.
        photons: f64,
        /// As many are held.
        most_photons: f64,
    },
}

/// The laser cycles and the SPADs of an exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LitExposure {
    /// A laser cycle has `periods` periods of this clock, exactly.
    pub clock: Frequency,
    /// Periods of the clock in a laser cycle, at least 1.
    pub periods: u32,
    /// Laser cycles, at least 1.
    pub laser_cycles: u32,
    /// How much before its laser cycle the background of a cycle is drawn, less than a period: of our own chip that of its bins, so
    /// that the photons are those of its frames, and 0 of any other.
    pub lead: Time,
    /// Equal seeds give equal photons.
    pub seed: u64,
    /// SPADs of a macropixel.
    pub layout: SpadLayout,
    /// How the SPADs answer; its grid is the layout's.
    pub spads: SpadModel,
    /// CLK that waveforms show.
    pub clk: Frequency,
    /// How much before a STOP edge CLK falls, at least 0 and less than a CLK period.
    pub clk_phase: Time,
}

/// The light on every macropixel of an array in an exposure.
#[derive(Debug, Clone)]
pub struct LightSource {
    /// Macropixel rows.
    pub rows: usize,
    /// Macropixel columns.
    pub cols: usize,
    /// The exposure.
    pub exposure: LitExposure,
    stream: PhotonStream,
    /// `None` where SPADs are off.
    lights: Vec<Option<PixelLight>>,
    truth_m: Vec<Option<f64>>,
}

/// What falls on a macropixel on average: what a golden model of a chip takes beside the pulses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightFacts {
    /// Detected signal photons a laser cycle, of all SPADs, before dead time.
    pub signal: f64,
    /// Detected background photons and dark counts of all SPADs per second, before dead time.
    pub background_hz: f64,
    /// When the brightest echo arrives after the laser pulse; `None` without an echo.
    pub arrival: Option<Time>,
    /// Distance of the surface that sends back most light, m; `None` for the sky.
    pub truth_m: Option<f64>,
}

/// How much was drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PulseTotals {
    /// Photons and dark counts, seen or not.
    pub photons: u64,
    /// Pulses of SPADs, afterpulses and crosstalk among them.
    pub pulses: u64,
}

impl std::ops::AddAssign for PulseTotals {
    fn add_assign(&mut self, other: Self) {
        self.photons += other.photons;
        self.pulses += other.pulses;
    }
}

impl LightSource {
    /// The light of a scene on `rows` × `cols` macropixels, all of which see it.
    ///
    /// # Errors
    /// Light whose photons of a single laser cycle do not fit into memory.
    ///
    /// # Panics
    /// When the SPADs have another grid than their layout.
    pub fn of_scene(
        scene: &Scene,
        (rows, cols): (usize, usize),
        exposure: &LitExposure,
    ) -> Result<Self, LightSourceError> {
        let config = StreamConfig {
            seed: exposure.seed,
            clock: exposure.clock,
            stop_periods: exposure.periods,
            laser_cycles: exposure.laser_cycles,
            lead: exposure.lead,
            pulse_sigma: scene.pulse_sigma(),
            pulse_shape: None,
            energy_spread: 0.0,
            spads: exposure.spads,
        };
        let stream = PhotonStream::new(&scene.with_pulse(config));
        let middle_s = 0.5 * stream.cycle_start(exposure.laser_cycles).as_s();
        let truth = GroundTruth::render(&scene.snapshot(middle_s), rows as u32, cols as u32);
        let spads = (&exposure.spads, exposure.layout);
        let cycle_s = stream.config().cycle_s();
        let lights = scene.light_on_layout(&truth, spads, exposure.laser_cycles, cycle_s);
        let source = LightSource {
            rows,
            cols,
            exposure: *exposure,
            stream,
            lights: lights.into_iter().map(Some).collect(),
            truth_m: truth.range_m,
        };
        source.refuse_floods()?;
        Ok(source)
    }

    /// The light of a frame that was taken: SPADs without a window are off.
    ///
    /// # Errors
    /// As [`LightSource::of_scene`].
    pub fn of_frame(frame: &TakenFrame) -> Result<Self, LightSourceError> {
        let settings = &frame.settings;
        let (sensor, exposure) = (&settings.sensor, &settings.exposure);
        let lit = LitExposure::of_sensor(
            sensor,
            (exposure.stop_periods, exposure.laser_cycles),
            settings.seed,
        );
        let size = (sensor.rows, sensor.cols);
        let mut source = Self::of_scene(&settings.scene, size, &lit)?;
        for (light, pixel) in source.lights.iter_mut().zip(&frame.pixels) {
            if pixel.start.is_none() {
                *light = None;
            }
        }
        Ok(source)
    }

    fn refuse_floods(&self) -> Result<(), LightSourceError> {
        let lit = (0..).zip(&self.lights);
        let lit = lit.filter_map(|(pixel, light)| Some((pixel, light.as_ref()?)));
        refuse_floods(&self.stream, lit)?;
        let lights = self.lights.iter().flatten();
        let photons = lights.map(|light| light.background_hz() * self.stream.config().cycle_s());
        let photons = photons.fold(0.0, f64::max);
        if photons > MOST_IN_CYCLE {
            return Err(LightSourceError::Background {
                photons,
                most_photons: MOST_IN_CYCLE,
            });
        }
        Ok(())
    }

    /// Macropixels of the array.
    pub fn pixels(&self) -> usize {
        self.lights.len()
    }

    /// Row and column of a macropixel.
    pub fn position(&self, pixel: u32) -> (usize, usize) {
        (pixel as usize / self.cols, pixel as usize % self.cols)
    }

    /// Whether the SPADs of a macropixel are on.
    pub fn is_on(&self, pixel: u32) -> bool {
        self.lights[pixel as usize].is_some()
    }

    /// When a laser cycle begins.
    pub fn cycle_start(&self, cycle: u32) -> Time {
        self.stream.cycle_start(cycle)
    }

    /// When the last laser cycle ends.
    pub fn end(&self) -> Time {
        self.cycle_start(self.exposure.laser_cycles)
    }

    /// How long a SPAD's wire is high.
    pub fn pulse_width(&self) -> Time {
        self.exposure.spads.shortest_dead_time()
    }

    /// What falls on a macropixel on average; nothing where its SPADs are off.
    pub fn facts(&self, pixel: u32) -> LightFacts {
        let light = self.lights[pixel as usize].as_ref();
        let mean = light.map(|light| light.mean(self.exposure.laser_cycles, self.cycle_start(1)));
        LightFacts {
            signal: mean.map_or(0.0, |mean| mean.signal_per_cycle),
            background_hz: mean.map_or(0.0, |mean| mean.background_hz),
            arrival: mean.and_then(|mean| mean.arrival),
            truth_m: self.truth_m[pixel as usize],
        }
    }

    /// Whether a macropixel would get more light than is modelled.
    pub fn is_beyond_model(&self, pixel: u32) -> bool {
        let light = self.lights[pixel as usize].as_ref();
        light.is_some_and(is_beyond_model)
    }

    /// Pulses of a macropixel to be expected in the exposure. Dead time is allowed for as far as it limits the rate of a SPAD; pulses
    /// of other lasers are left out.
    pub fn expected_pulses(&self, pixel: u32) -> f64 {
        let (facts, spads) = (self.facts(pixel), &self.exposure.spads);
        let cycle_s = self.stream.config().cycle_s();
        let causes = 1.0 + spads.afterpulse_probability + spads.crosstalk_probability;
        let photons = (facts.signal + facts.background_hz * cycle_s) * causes;
        let dead_s = spads.shortest_dead_time().as_s();
        let dead_times = self.exposure.layout.spads() as f64 * (cycle_s / dead_s + 1.0);
        photons.min(dead_times) * f64::from(self.exposure.laser_cycles)
    }

    /// Hands over the pulses of a macropixel part by part, in the order of their times, until `pulses` breaks.
    pub fn pulses(
        &self,
        pixel: u32,
        mut pulses: impl FnMut(&[SpadEvent]) -> ControlFlow<()>,
    ) -> PulseTotals {
        let Some(light) = &self.lights[pixel as usize] else {
            return PulseTotals::default();
        };
        let layout = self.exposure.layout;
        let (mut own, mut count) = (Vec::new(), 0);
        let photons = self.stream.pixel_pulses_while(pixel, light, |events| {
            let some = if layout.is_full() {
                events
            } else {
                own.clear();
                let spad = |event: &SpadEvent| {
                    let spad = layout.spad_at(event.spad)?;
                    Some(SpadEvent::new(event.time, spad))
                };
                own.extend(events.iter().filter_map(spad));
                &own
            };
            count += some.len() as u64;
            pulses(some)
        });
        PulseTotals {
            photons: photons.drawn,
            pulses: count,
        }
    }

    /// Hands over the pulses of some macropixels, one after the other in their order. They are drawn on all threads as far as memory
    /// for them allows; of a macropixel with more, they are handed over as they are drawn. `done` is told of macropixels that are.
    ///
    /// # Errors
    /// The first one of `each`, after which no more is drawn.
    pub fn for_each<E>(
        &self,
        pixels: &[u32],
        each: impl FnMut(u32, &[SpadEvent]) -> Result<(), E>,
        done: impl Fn(usize),
    ) -> Result<PulseTotals, E> {
        self.for_each_within(MOST_KEPT_BYTES, pixels, each, done)
    }

    fn for_each_within<E>(
        &self,
        most_bytes: f64,
        pixels: &[u32],
        mut each: impl FnMut(u32, &[SpadEvent]) -> Result<(), E>,
        done: impl Fn(usize),
    ) -> Result<PulseTotals, E> {
        let bytes = |pixel: u32| self.expected_pulses(pixel) * size_of::<SpadEvent>() as f64;
        let mut totals = PulseTotals::default();
        let mut rest = pixels;
        while let [first, ..] = rest {
            let mut total = 0.0;
            let fitting = rest.iter().take_while(|pixel| {
                total += bytes(**pixel);
                total <= most_bytes
            });
            let (now, later) = rest.split_at(fitting.count().max(1));
            rest = later;
            if now.len() == 1 {
                let mut failed = None;
                totals += self.pulses(*first, |pulses| match each(*first, pulses) {
                    Ok(()) => ControlFlow::Continue(()),
                    Err(error) => {
                        failed = Some(error);
                        ControlFlow::Break(())
                    }
                });
                if let Some(error) = failed {
                    return Err(error);
                }
            } else {
                let drawn = now.par_iter().map(|pixel| {
                    let mut kept = Vec::new();
                    let totals = self.pulses(*pixel, |pulses| {
                        kept.extend_from_slice(pulses);
                        ControlFlow::Continue(())
                    });
                    (kept, totals)
                });
                let drawn: Vec<(Vec<SpadEvent>, PulseTotals)> = drawn.collect();
                for (pixel, (pulses, of_pixel)) in now.iter().zip(drawn) {
                    each(*pixel, &pulses)?;
                    totals += of_pixel;
                }
            }
            done(now.len());
        }
        Ok(totals)
    }
}

impl LitExposure {
    /// Laser cycles of our own chip: CLK periods in a laser cycle, and laser cycles.
    pub fn of_sensor(sensor: &Sensor, (stop_periods, laser_cycles): (u32, u32), seed: u64) -> Self {
        let exposure = crate::chip::Exposure::new(sensor, stop_periods, laser_cycles);
        let config = crate::engine::stream_config(sensor, &exposure, seed, Time::ZERO);
        LitExposure {
            clock: config.clock,
            periods: stop_periods,
            laser_cycles,
            lead: config.lead,
            seed,
            layout: config.spads.grid.into(),
            spads: config.spads,
            clk: config.clock,
            clk_phase: exposure.stop_phase,
        }
    }

    /// The same with another number of SPADs; `None` if that is not 1 to 64.
    pub fn with_spads(self, spads: usize) -> Option<Self> {
        let layout = SpadLayout::new(spads)?;
        Some(LitExposure {
            layout,
            spads: SpadModel {
                grid: layout.grid(),
                ..self.spads
            },
            ..self
        })
    }
}

#[cfg(test)]
mod tests;
