//! Exposing macropixels to light, on all threads.
//!
//! An engine takes macropixels with their start values and the light on them and gives histograms. How it comes by
//! photons is its own business: [`full_stream`] draws every photon of the exposure and hands the pulses to the engine;
//! an engine that needs fewer photons, or none, has a way of its own ([`Expose::expose`]).

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::{
    Cancelling, Engine, EngineError, EngineWork, Expose, ExposureResult, LitPixel, PulsedPixel,
    Replay,
};
use crate::chip::{Exposure, Sensor, WindowLaw};
use crate::photon::{PhotonStream, PixelLight, PixelPhotons, SpadEvent, StreamConfig};
use crate::units::Time;

/// The stream of light for a sensor in an exposure, with its slots where the sensor's bins are. `pulse_sigma` is that of
/// the laser pulse with all jitter.
pub fn stream_config(
    sensor: impl Into<Sensor>,
    exposure: &Exposure,
    seed: u64,
    pulse_sigma: Time,
) -> StreamConfig {
    let sensor = sensor.into();
    StreamConfig {
        seed,
        clock: exposure.clock,
        stop_periods: exposure.stop_periods,
        laser_cycles: exposure.laser_cycles,
        lead: WindowLaw::new(&sensor, exposure).lead(),
        pulse_sigma,
        pulse_shape: None,
        energy_spread: 0.0,
        spads: sensor.spad_model(),
    }
}

/// What those who are told of progress answer: nothing, or whether to go on.
pub trait Answer {
    /// Whether what is in progress is no longer wanted.
    fn stops(self) -> bool;
}

impl Answer for () {
    fn stops(self) -> bool {
        false
    }
}

impl Answer for ControlFlow<()> {
    fn stops(self) -> bool {
        self.is_break()
    }
}

/// Exposes `pixels` on as many threads as rayon has, in batches of the engine's liking; `done` is told of
/// macropixels as they are finished, of none before each batch, and may stop the exposure by its [`Answer`]: no batch begins after
/// that. Neither threads nor batches change the histograms.
///
/// # Errors
/// As [`Expose::expose`], where background light blinds SPADs so much that following them all takes
/// too long, and [`EngineError::Stopped`].
pub fn expose<E: Expose + ?Sized, A: Answer>(
    engine: &E,
    stream: &PhotonStream,
    pixels: &[LitPixel],
    done: impl Fn(usize) -> A + Sync,
) -> Result<ExposureResult, EngineError> {
    refuse_blinding(stream, pixels)?;
    in_batches(engine, pixels, done, |batch| engine.expose(stream, batch))
}

/// As [`expose`], but draws every photon of every macropixel and lets the engine run them all. The histograms are the
/// same; what it took is not.
///
/// # Errors
/// As [`expose`].
pub fn expose_without_skipping<E: Replay + ?Sized, A: Answer>(
    engine: &E,
    stream: &PhotonStream,
    pixels: &[LitPixel],
    done: impl Fn(usize) -> A + Sync,
) -> Result<ExposureResult, EngineError> {
    refuse_blinding(stream, pixels)?;
    in_batches(engine, pixels, done, |batch| {
        full_stream(engine, stream, batch)
    })
}

/// Background photons of a SPAD in a dead time from which on it is blind more than half of the time: so often that its
/// state is found by following all of its photons, and no longer from those shortly before a window.
const BLINDING: f64 = 1.0;

/// Photons of macropixels in such light that are drawn at most: chosen, not measured, to be of the order of a minute. A small
/// array before a whole field of view, which gathers much light on each macropixel, stays below.
const MOST_BLINDING_PHOTONS: f64 = 1e9;

/// Refuses light whose SPADs differ, but are not those of the sensor.
pub(super) fn refuse_other_spads(
    stream: &PhotonStream,
    pixels: &[LitPixel],
) -> Result<(), EngineError> {
    let spads = stream.spads();
    let lights = pixels.iter().filter_map(|pixel| pixel.light.as_ref());
    let mut counts = lights.filter_map(|light| Some(light.spads()?.spads()));
    match counts.find(|&given| given != spads) {
        None => Ok(()),
        Some(given) => Err(EngineError::OtherSpads { given, spads }),
    }
}

/// Photons of an echo that are held in memory at most: with those of 16 laser cycles 0.4 GB on each thread.
const MOST_ECHO_PHOTONS: f64 = 1e6;

/// Refuses echoes that do not fit into memory, on macropixels with these numbers.
///
/// # Errors
/// [`EngineError::Flooded`].
pub fn refuse_floods<'a>(
    stream: &PhotonStream,
    lit: impl Iterator<Item = (u32, &'a PixelLight)>,
) -> Result<(), EngineError> {
    // Most macropixels have fewer, and their parts need no look.
    let flooded = lit.filter(|(_, light)| light.signal_per_cycle() > MOST_ECHO_PHOTONS);
    for (number, light) in flooded {
        for part in stream.parts(number, light) {
            let photons = part.listed_photons();
            if photons > MOST_ECHO_PHOTONS {
                return Err(EngineError::Flooded {
                    photons,
                    most_photons: MOST_ECHO_PHOTONS,
                });
            }
        }
    }
    Ok(())
}

fn refuse_blinding(stream: &PhotonStream, pixels: &[LitPixel]) -> Result<(), EngineError> {
    let lit = pixels
        .iter()
        .filter_map(|pixel| Some((pixel.number, pixel.light.as_ref()?)));
    refuse_floods(stream, lit)?;
    let config = stream.config();
    let spads = stream.spads() as f64;
    let most_hz = BLINDING / config.spads.dead_time.as_s();
    let lights = pixels.iter().filter_map(|pixel| pixel.light.as_ref());
    let rates_hz = lights.map(PixelLight::background_hz);
    let blinding_hz = rates_hz.filter(|hz| hz / spads > most_hz);
    let (brightest_hz, total_hz) =
        blinding_hz.fold((0f64, 0f64), |(most, sum), hz| (most.max(hz), sum + hz));
    let photons = total_hz * config.cycle_s() * f64::from(config.laser_cycles);
    if photons <= MOST_BLINDING_PHOTONS {
        Ok(())
    } else {
        Err(EngineError::Blinding {
            background_hz: brightest_hz / spads,
            most_hz,
            photons,
            most_photons: MOST_BLINDING_PHOTONS,
        })
    }
}

fn in_batches<E: Engine + ?Sized, A: Answer>(
    engine: &E,
    pixels: &[LitPixel],
    done: impl Fn(usize) -> A + Sync,
    expose: impl Fn(&[LitPixel]) -> Result<ExposureResult, EngineError> + Sync,
) -> Result<ExposureResult, EngineError> {
    let batches: Vec<ExposureResult> = pixels
        .par_chunks(engine.batch())
        .map(|batch| {
            if done(0).stops() {
                return Err(EngineError::Stopped);
            }
            let exposed = expose(batch)?;
            if done(batch.len()).stops() {
                Err(EngineError::Stopped)
            } else {
                Ok(exposed)
            }
        })
        .collect::<Result<_, EngineError>>()?;
    let mut all = ExposureResult::new(engine.bins());
    for batch in batches {
        all.histograms.append(&batch.histograms);
        all.work += batch.work;
    }
    Ok(all)
}

/// Bytes of pulses that a thread keeps at a time, unless a single macropixel has more. Chosen, so that two threads keep less
/// than 200 MB of them.
const MOST_PULSE_BYTES: f64 = 64e6;

/// Draws every photon of the exposure and gives the pulses to [`Replay::replay`], as many macropixels at a time as the
/// memory for their pulses allows.
///
/// # Errors
/// As [`Replay::replay`], and where light is given for another number of SPADs.
pub fn full_stream<E: Replay + ?Sized>(
    engine: &E,
    stream: &PhotonStream,
    pixels: &[LitPixel],
) -> Result<ExposureResult, EngineError> {
    let bytes = |pixel: &LitPixel| {
        let light = pixel.light.as_ref();
        let edges = light.map_or(0.0, |light| stream.config().most_edges(light));
        edges * size_of::<SpadEvent>() as f64
    };
    refuse_other_spads(stream, pixels)?;
    let mut exposed = ExposureResult::new(engine.bins());
    let mut rest = pixels;
    while !rest.is_empty() {
        let mut total = 0.0;
        let fitting = rest.iter().take_while(|pixel| {
            total += bytes(pixel);
            total <= MOST_PULSE_BYTES
        });
        let (now, later) = rest.split_at(fitting.count().max(1));
        let ExposureResult { histograms, work } = whole_pixels(engine, stream, now)?;
        exposed.histograms.append(&histograms);
        exposed.work += work;
        rest = later;
    }
    Ok(exposed)
}

fn whole_pixels<E: Replay + ?Sized>(
    engine: &E,
    stream: &PhotonStream,
    pixels: &[LitPixel],
) -> Result<ExposureResult, EngineError> {
    let photons: Vec<PixelPhotons> = pixels
        .iter()
        .map(|pixel| match &pixel.light {
            Some(light) => stream.pixel_events(pixel.number, light),
            None => PixelPhotons::default(),
        })
        .collect();
    let pulsed = pixels.iter().zip(&photons);
    let pulsed: Vec<PulsedPixel<'_>> = pulsed
        .map(|(pixel, photons)| PulsedPixel {
            number: pixel.number,
            start: pixel.start,
            pulses: &photons.events,
        })
        .collect();
    let histograms = engine.replay(&pulsed)?;
    let config = stream.config();
    let cancelling = Cancelling::from_law(config.spads.shortest_dead_time(), config.clock, || {
        engine.law()
    });
    let cancelled = cancelling.map_or(0, |cancelling| {
        let seen = |pixel: &PulsedPixel<'_>| {
            let pulses = engine.as_the_law_sees(pixel.number, pixel.pulses);
            cancelling.cancelled_pulses(pixel.start, &pulses)
        };
        pulsed.iter().map(seen).sum()
    });
    let clk_periods =
        pixels.len() as u64 * u64::from(config.stop_periods) * u64::from(config.laser_cycles);
    let work = EngineWork {
        macropixels: pixels.len() as u64,
        photons_drawn: photons.iter().map(|p| p.drawn).sum(),
        pulses: photons.iter().map(|p| p.events.len() as u64).sum(),
        lost_to_dead_time: photons.iter().map(|p| p.lost_to_dead_time).sum(),
        cancelled,
        clk_periods,
        clk_periods_visited: clk_periods,
        ..EngineWork::default()
    };
    Ok(ExposureResult { histograms, work })
}
