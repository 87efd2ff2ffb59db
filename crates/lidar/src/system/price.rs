//! What a macropixel costs on the window engine and on the cohort engine, before either runs it.
//!
//! Prices are nanoseconds of processor time of one thread. `cargo bench --bench prices` measures them and prints each
//! estimate beside what it stands for: the least of three runs of 16 macropixels, 384 MHz, 16 bins, laser cycles of 520 CLK
//! periods, 1000 and 16 000 of them, from 0.1 to 1600 Mcounts/s of background and 0 to 60 signal photons a laser cycle.
//! The machine was shared; only ratios matter here. Where there is a choice, estimates were 0.7 to 1.4 times (window) and 0.3
//! to 1.0 times (cohort) what was measured, and the dearer engine is chosen in 8 of these 84 lights: for 5 to 10 % more in
//! five, four of them with 1600 Mcounts/s, and for some microseconds where both take below 20. What the
//! window engine takes for any macropixel, some 10 µs, is left out, as is what afterpulses and crosstalk cost either.

use crate::chip::SensorConfig;
use crate::engine::{Cohort, EngineError, LitPixel, Window};
use crate::photon::{PhotonStream, PixelLight};

/// A photon in the window of the window engine.
const PHOTON_NS: f64 = 5.0;

/// More for each photon that the same laser cycle's window has on average: they may share a SPAD or a bin, which is looked
/// into.
const TOGETHER_NS: f64 = 4.7;

/// A laser cycle in bright light, which is drawn cycle by cycle; a photon of its background; a SPAD that its echo fires.
const BRIGHT_CYCLE_NS: f64 = 80.0;
const BRIGHT_PHOTON_NS: f64 = 30.0;
const BRIGHT_ECHO_NS: f64 = 35.0;

/// A photon where whole laser cycles are drawn and sorted.
const SORTED_NS: f64 = 50.0;

/// A cohort in a step of the cohort engine: 0.3 to 0.7 µs were measured, but 1.4 µs where there are as many states as 16 000
/// laser cycles can be in.
const COHORT_NS: f64 = 400.0;

/// The bound on the depth error that comes before it, means at two exactnesses: 40 to 220 µs, but in light so little that
/// the window engine is cheaper anyway.
pub const BOUND_NS: f64 = 80_000.0;

/// What the window engine takes for `pixel` under `light`, ns.
pub fn window_ns(
    window: &Window,
    config: &SensorConfig,
    stream: &PhotonStream,
    pixel: &LitPixel,
    light: &PixelLight,
) -> f64 {
    let cycles = f64::from(stream.config().laser_cycles);
    if window.draws_whole_cycles(stream, pixel) {
        return cycles * SORTED_NS * stream.config().most_photons_per_cycle(light);
    }
    let background = light.background_hz() * config.bins as f64 / config.clk_hz;
    let signal = light.signal_per_cycle();
    let photons = background + signal;
    let spads = config.spads() as f64;
    let fired = -spads * libm::expm1(-signal / spads);
    let one_by_one = photons * (PHOTON_NS + TOGETHER_NS * photons);
    let bright = BRIGHT_CYCLE_NS + BRIGHT_PHOTON_NS * background + BRIGHT_ECHO_NS * fired;
    // The engine draws cycle by cycle where that is cheaper, or nearly so.
    cycles * one_by_one.min(bright)
}

/// What the cohort engine takes for a macropixel with its bound, ns.
///
/// # Errors
/// As [`Cohort::draw`].
pub fn cohort_ns(
    cohort: &Cohort,
    stream: &PhotonStream,
    start: u16,
    light: &PixelLight,
) -> Result<f64, EngineError> {
    let cohorts = cohort.cohorts_in_steps(stream.config(), start, light)?;
    Ok(BOUND_NS + COHORT_NS * cohorts)
}
