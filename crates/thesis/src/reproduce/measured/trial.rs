//! One macropixel of the modelled chip before one echo, in as many frames as are wanted.
//!
//! ```text
//!   light ─► 16 SPADs, dead time ─► how many fired in a CLK period ─► TYPE, THRESHOLD ─► bin counter ─► peak
//!              DeadTime                          OneHit                  Threshold         Overflow     Ties
//! ```
//!
//! Every assumption of the formulas that the chip breaks can be taken out of the chip alone ([`Effect`]), so that what
//! it costs is measured. Two of them take a trick:
//!
//! * *Every pulse counted.* A bin of the chip adds one when more SPADs fired than THRESHOLD. The sum of exposures of the
//!   very same photons with THRESHOLD 0, 1, 2, … adds one for each SPAD instead.
//! * *Thin light.* The same photons in 256 times as many laser cycles meet neither dead time nor each other: this chip
//!   is the one that the formulas describe, and the control of everything here.
//!
//! Histograms come from the window engine, photon by photon, or from the cohort engine where that is quicker; both are
//! held to the gates elsewhere. A frame is a macropixel number: equal seeds, equal frames.

use rayon::prelude::*;

use crate::chip::window_law::OpenWindow;
use crate::chip::{EventType, Exposure, Mode, Sensor, SensorConfig, WindowLaw, histogram};
use crate::engine::{
    Cohort, CohortOptions, EngineError, Expose, Histograms, LitPixel, Window, stream_config,
};
use crate::photon::{PhotonStream, PixelLight, StreamConfig};
use crate::theory::detection::PerCycle;
use crate::theory::partial::Link;
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time};

/// What the formulas leave out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// The echo spreads over several bins.
    Spread,
    /// Of equal bins the peak finder takes the earliest.
    Ties,
    /// SPADs are blind after an avalanche.
    DeadTime,
    /// A bin adds at most one in a laser cycle.
    OneHit,
    /// More than one SPAD must fire together.
    Threshold,
    /// Counters saturate or wrap.
    Overflow,
}

impl Effect {
    /// Every effect.
    pub const ALL: [Effect; 6] = [
        Effect::Spread,
        Effect::Ties,
        Effect::DeadTime,
        Effect::OneHit,
        Effect::Threshold,
        Effect::Overflow,
    ];

    /// As a column's heading, taken out.
    pub(crate) fn absent(self) -> &'static str {
        match self {
            Effect::Spread => "narrow echo",
            Effect::Ties => "ties by lot",
            Effect::DeadTime => "no dead time",
            Effect::OneHit => "every pulse counts",
            Effect::Threshold => "threshold 1 SPAD",
            Effect::Overflow => "wide counters",
        }
    }
}

/// A macropixel, its light and its exposure.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// The chip.
    pub sensor: Sensor,
    /// CLK periods in a laser cycle.
    pub stop_periods: u32,
    /// Start value of the P-counter.
    pub start: u16,
    /// Where the echo's centre lies: bin b's centre is b.
    pub echo_bins: f64,
    /// Standard deviation of the echo, ns.
    pub sigma_ns: f64,
    /// Signal photons per laser cycle.
    pub signal: f64,
    /// Background, counts/s on the whole macropixel.
    pub background_hz: f64,
    /// Laser cycles.
    pub cycles: u32,
    /// Count every SPAD that fired beyond THRESHOLD, not only the first.
    pub every_pulse: bool,
    /// Counters that never overflow.
    pub wide_counters: bool,
    /// Ties of the fullest bins are decided by lot.
    pub ties_by_lot: bool,
}

/// By how much thin light is thinner.
const THINNING: u32 = 256;

/// Photons of a frame that the window engine draws rather than leave them to the cohort engine.
const WORTH_DRAWING: f64 = 40_000.0;

/// Photons within the dead time up to which the window engine finds where SPADs are certain to be ready.
const NOT_BLINDING: f64 = 3.0;

/// Photons on one SPAD in a CLK period below which laser cycles are pooled, at next to no cost.
const DIM: f64 = 0.01;

/// Microseconds that a frame may take; longer ones are fewer, down to a least number.
const AFFORDABLE_US: f64 = 150.0;
const FEWEST: usize = 60;

/// What a photon takes in the window engine, and a cohort in a step of the cohort engine, µs: of the order of what
/// `cargo bench --bench prices` measures.
const DRAWN_US: f64 = 0.05;
const COHORT_US: f64 = 0.5;

/// Frames that a thread exposes in one go.
const CHUNK: usize = 64;

/// Which engine makes the histograms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Maker {
    Window,
    Cohort,
}

impl Trial {
    /// The sensor as delivered, its window at about 36 m, and a narrow echo in the middle of its ninth bin. No
    /// formula asks where the window lies.
    pub fn new(signal: f64, background_hz: f64, cycles: u32) -> Self {
        Trial {
            sensor: Sensor::default(),
            stop_periods: 520,
            start: 100,
            echo_bins: 8.0,
            sigma_ns: 0.0,
            signal,
            background_hz,
            cycles,
            every_pulse: false,
            wide_counters: false,
            ties_by_lot: false,
        }
    }

    /// As [`Trial::new`], with what this link receives from `range_m` away, its pulse as wide as the link's.
    pub(crate) fn of_link(link: &Link, range_m: f64, cycles: u32) -> Self {
        Trial {
            sigma_ns: 1e9 * link.pulse_sigma_s,
            ..Trial::new(
                link.signal / (range_m * range_m),
                link.background_hz,
                cycles,
            )
        }
    }

    /// The same with `candidates` bins of `bin_m` metres, the echo in the middle of the last: CLK as slow as they are long, and
    /// the conventional mode, whose bins end with STOP.
    #[must_use]
    pub(crate) fn in_coarse_bins(self, candidates: u32, bin_m: f64) -> Self {
        Trial {
            stop_periods: candidates + 4,
            echo_bins: f64::from(candidates) - 1.0,
            ..self
        }
        .with_sensor_change(|sensor| {
            sensor.mode = Mode::Conventional;
            sensor.bins = candidates as usize;
            sensor.clk_hz = SPEED_OF_LIGHT_M_PER_S / (2.0 * bin_m);
        })
    }

    /// The same on a sensor whose description is changed, of the same silicon.
    #[must_use]
    pub(crate) fn with_sensor_change(mut self, change: impl FnOnce(&mut SensorConfig)) -> Self {
        self.sensor = changed(&self.sensor, change);
        self
    }

    /// Bin interval, ns.
    pub(crate) fn bin_ns(&self) -> f64 {
        1e9 / self.sensor.clk_hz
    }

    /// Background photons in a bin and laser cycle.
    pub(crate) fn background(&self) -> f64 {
        self.background_hz / self.sensor.clk_hz
    }

    /// The light as Eq. 17 knows it: the whole echo in one bin.
    pub fn per_cycle(&self) -> PerCycle {
        PerCycle {
            signal: self.signal,
            background: self.background(),
            bins: self.sensor.bins as u32,
        }
    }

    /// The same without `effect`; `None` where it plays no part.
    pub(crate) fn without_effect(&self, effect: Effect) -> Option<Self> {
        let mut trial = self.clone();
        match effect {
            Effect::Spread => {
                trial.sigma_ns = 0.0;
                trial.echo_bins = self.echo_bins.round();
            }
            Effect::Ties => trial.ties_by_lot = true,
            // The shortest that the front end follows.
            Effect::DeadTime => {
                let shortest = trial.sensor.timing().pulses.shortest();
                trial = trial.with_sensor_change(|sensor| sensor.dead_time_ns = shortest.as_ns());
            }
            Effect::OneHit => trial.every_pulse = true,
            Effect::Threshold => {
                trial = trial.with_sensor_change(|sensor| {
                    sensor.event_type = EventType::Greater;
                    sensor.threshold = 0;
                });
            }
            Effect::Overflow => {
                trial.wide_counters = true;
                if u64::from(self.cycles) < 1 << self.sensor.bin_bits {
                    return None;
                }
            }
        }
        (trial != *self).then_some(trial)
    }

    /// The same photons spread over enough laser cycles that two never meet, with counters that can hold them.
    pub fn in_thin_light(&self) -> Self {
        let thin = self.without_effect(Effect::Threshold);
        Trial {
            signal: self.signal / f64::from(THINNING),
            background_hz: self.background_hz / f64::from(THINNING),
            cycles: self.cycles * THINNING,
            wide_counters: true,
            ties_by_lot: true,
            ..thin.unwrap_or_else(|| self.clone())
        }
    }

    /// The engine that is the quickest; window where the cohort engine refuses.
    fn maker(&self) -> Maker {
        let on_spad = (self.signal + self.background()) / self.sensor.spads() as f64;
        let blinding = self.background_hz * 1e-9 * self.sensor.dead_time_ns > NOT_BLINDING;
        let is_worth_drawing = !blinding && self.photons() <= WORTH_DRAWING;
        if on_spad >= DIM && is_worth_drawing || self.cohorts().is_none() {
            Maker::Window
        } else {
            Maker::Cohort
        }
    }

    /// Cohorts that the cohort engine follows for a frame; `None` where it refuses.
    fn cohorts(&self) -> Option<f64> {
        let frames = Frames::new(self, 0, self.sensor.threshold);
        let (pixel, light) = frames.pixel(0, 0.0);
        let cohorts = frames
            .cohort()
            .cohorts_in_steps(&frames.stream, pixel.start, &light);
        cohorts.ok()
    }

    /// How many of `frames` frames to afford: fewer where an exposure takes very many photons.
    pub(crate) fn affordable(&self, frames: usize) -> usize {
        let cost_us = match self.maker() {
            Maker::Window => DRAWN_US * self.photons(),
            Maker::Cohort => COHORT_US * self.cohorts().unwrap_or(0.0),
        };
        let share = (AFFORDABLE_US / cost_us).min(1.0);
        ((share * frames as f64) as usize).max(FEWEST.min(frames))
    }

    /// Photons that fall into the window.
    fn photons(&self) -> f64 {
        (self.signal + self.background() * self.sensor.bins as f64) * f64::from(self.cycles)
    }

    /// Histograms of `frames` frames, their echoes `shift(frame)` bins after [`Trial::echo_bins`].
    ///
    /// # Errors
    /// Configurations that no engine can run.
    pub(crate) fn histograms(
        &self,
        frames: usize,
        seed: u64,
        shift: impl Fn(usize) -> f64 + Sync,
    ) -> Result<Vec<Vec<u32>>, EngineError> {
        let mut hits = self.hits(frames, seed, &shift, self.sensor.threshold)?;
        if self.every_pulse {
            for threshold in self.sensor.threshold + 1..self.sensor.spads() as u8 {
                let more = self.hits(frames, seed, &shift, threshold)?;
                if more.iter().flatten().all(|&n| n == 0) {
                    break;
                }
                let counts = hits.iter_mut().flatten().zip(more.iter().flatten());
                counts.for_each(|(sum, n)| *sum += n);
            }
        }
        let (bits, overflow) = (self.sensor.bin_bits as u32, self.sensor.overflow);
        let held = |n: u64| {
            if self.wide_counters {
                n as u32
            } else {
                histogram::model(n, bits, overflow).into()
            }
        };
        let histograms = hits.into_iter();
        Ok(histograms
            .map(|bins| bins.into_iter().map(held).collect())
            .collect())
    }

    /// Events of every bin before counters overflow.
    fn hits(
        &self,
        frames: usize,
        seed: u64,
        shift: &(impl Fn(usize) -> f64 + Sync),
        threshold: u8,
    ) -> Result<Vec<Vec<u64>>, EngineError> {
        let setup = Frames::new(self, seed, threshold);
        let numbers: Vec<usize> = (0..frames).collect();
        if self.maker() == Maker::Cohort {
            let engine = setup.cohort();
            let histograms = numbers.par_iter().map(|&frame| {
                let (pixel, light) = setup.pixel(frame, shift(frame));
                engine.hits(&setup.stream, pixel.number, pixel.start, &light)
            });
            return histograms.collect();
        }
        let engine = Window::new(&setup.sensor, &setup.exposure);
        let stream = PhotonStream::new(&setup.stream);
        let chunks = numbers.par_chunks(CHUNK).map(|chunk| {
            let pixels = chunk
                .iter()
                .map(|&frame| setup.pixel(frame, shift(frame)).0);
            let pixels: Vec<LitPixel> = pixels.collect();
            Ok(engine.expose(&stream, &pixels)?.histograms)
        });
        let chunks: Vec<Histograms> = chunks.collect::<Result<_, EngineError>>()?;
        let widen = |bins: &[u16]| bins.iter().copied().map(u64::from).collect();
        Ok(chunks.iter().flatten().map(widen).collect())
    }
}

/// A sensor of the same silicon whose description is changed; it must still be a possible one.
fn changed(sensor: &Sensor, change: impl FnOnce(&mut SensorConfig)) -> Sensor {
    let mut config = SensorConfig::clone(sensor);
    change(&mut config);
    Sensor::from(config).made_of(sensor.silicon())
}

/// What the frames of a trial share, on counters that hold all events.
struct Frames<'t> {
    trial: &'t Trial,
    sensor: Sensor,
    exposure: Exposure,
    stream: StreamConfig,
    law: WindowLaw,
    window: OpenWindow,
}

impl<'t> Frames<'t> {
    fn new(trial: &'t Trial, seed: u64, threshold: u8) -> Self {
        let sensor = changed(&trial.sensor, |sensor| {
            sensor.threshold = threshold;
            sensor.bin_bits = 16;
        });
        let exposure = Exposure::new(&sensor, trial.stop_periods, trial.cycles);
        let sigma = Time::from_s(1e-9 * trial.sigma_ns);
        let law = WindowLaw::new(&sensor, &exposure);
        let window = law.window(trial.start).open();
        Frames {
            trial,
            stream: stream_config(&sensor, &exposure, seed, sigma),
            window: window.expect("a start value whose window opens"),
            sensor,
            exposure,
            law,
        }
    }

    fn cohort(&self) -> Cohort {
        Cohort::new(&self.sensor, &self.exposure, CohortOptions::default())
    }

    /// The macropixel of a frame, its echo `shift` bins after [`Trial::echo_bins`], and its light.
    fn pixel(&self, frame: usize, shift: f64) -> (LitPixel, PixelLight) {
        let arrival = self.law.time_of(&self.window, self.trial.echo_bins + shift);
        let light =
            PixelLight::echo(self.trial.signal, arrival).with_background(self.trial.background_hz);
        let pixel = LitPixel {
            number: frame as u32,
            start: self.trial.start,
            light: Some(light.clone()),
        };
        (pixel, light)
    }
}
