//! The cheapest engine for every macropixel that keeps a stated depth error.
//!
//! The window engine is exact and its cost goes with the photons in a window. The cohort engine's does not, but the means of
//! its bins, and so the depth they give, are a little off. How much is computed and not guessed: its means are known
//! to within a part of their counting noise, [`CohortOptions::error`], so from means a hundred times as exact follows
//! another depth. Twice the difference, and what the hundredth that is left may do to it, bound what the engine adds
//! to the depth of a macropixel on average; the photons' own noise is the same on both engines and no error of either.
//! Both follow one law of echoes ([`crate::photon::EchoLaw`]).
//!
//! Macropixels without light, or whose bound cannot be kept, go to the window engine, as do those in which it is the
//! cheaper one.

use rayon::prelude::*;
use serde::Serialize;

use crate::chip::{Exposure, SensorConfig, WindowLaw};
use crate::engine::{Cohort, CohortOptions, EngineError, Exposed, LitPixel, Window, Work, expose};
use crate::photon::{PhotonStream, PixelLight, SPADS};
use crate::ranging::{PeakOptions, interpolate};

/// The part of a bin's counting noise to which its mean is known for the bound.
const BOUND_ERROR: f64 = 0.001;

/// Photons that the window engine handles in the time in which the cohort engine computes what SPADs do in light that is
/// far from even: means for the bound at both exactnesses, and once more to draw.
const PHOTONS_PER_LIGHT: f64 = 6000.0;

/// Photons that the window engine handles in the time of one bin of the cohort engine, where it pools laser
/// cycles.
const PHOTONS_PER_POOL: f64 = 30.0;

/// The same where it follows their joint state: with every SPAD ready, and for each one that is blind on average. Fitted to macropixels of 16 000 laser cycles under 8 and 50 Mcounts/s.
const PHOTONS_PER_JOINT: [f64; 2] = [300.0, 3000.0];

/// The same in the time of one photon where blinding light makes the window engine draw whole laser cycles and sort them.
const PHOTONS_PER_SORTED: f64 = 15.0;

/// Totals to which mean counts are scaled before they are rounded to whole ones: a depth keeps nine digits.
const WHOLE_COUNTS: f64 = 1e9;

/// How a macropixel is exposed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Choice {
    Window,
    Cohort,
}

/// What was chosen, and the bound that it keeps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Kept {
    /// What was asked for, m.
    pub tolerance_m: f64,
    /// Largest bound of all macropixels, m.
    pub bound_m: f64,
    /// Macropixels on the window engine.
    pub on_window: usize,
    /// Macropixels on the cohort engine.
    pub on_cohort: usize,
}

/// A frame's chip and clocks, and the depth error that it may have.
#[derive(Debug, Clone, Copy)]
pub struct Tolerance<'a> {
    /// Depth error that the choice of engine may add on average, m.
    pub tolerance_m: f64,
    /// The chip.
    pub config: &'a SensorConfig,
    /// Its exposure.
    pub exposure: &'a Exposure,
    /// Depth from histograms.
    pub peak: &'a PeakOptions,
}

impl Tolerance<'_> {
    /// Exposes `pixels`, each on the cheapest engine that keeps its depth within the tolerance of the exact one's on
    /// average. `done` is told of macropixels as they are finished.
    ///
    /// # Errors
    /// Configurations that the window engine refuses.
    pub fn expose(
        &self,
        stream: &PhotonStream,
        pixels: &[LitPixel],
        done: impl Fn(usize) + Sync,
    ) -> Result<(Exposed, Kept), EngineError> {
        let Tolerance {
            tolerance_m,
            config,
            exposure,
            peak,
        } = *self;
        let cohort = Cohort::new(config, exposure, CohortOptions::default());
        let options = CohortOptions {
            error: BOUND_ERROR,
            ..CohortOptions::default()
        };
        let exact = Cohort::new(config, exposure, options);
        let law = WindowLaw::new(config, exposure);
        let window = Window::new(config, exposure);
        let planner = Planner {
            cohort: &cohort,
            exact: &exact,
            law: &law,
            peak,
            window: &window,
            stream,
            bins: config.bins,
        };
        let plan: Vec<(Choice, f64)> = pixels
            .par_iter()
            .map(|pixel| planner.choose(pixel, tolerance_m))
            .collect();

        let mut kept = Kept {
            tolerance_m,
            bound_m: plan.iter().map(|(_, bound_m)| *bound_m).fold(0.0, f64::max),
            ..Kept::default()
        };
        let mut histograms = vec![Vec::new(); pixels.len()];
        let mut work = Work::default();
        for choice in [Choice::Window, Choice::Cohort] {
            let members: Vec<usize> = (0..pixels.len()).filter(|&i| plan[i].0 == choice).collect();
            let chosen: Vec<LitPixel> = members.iter().map(|&i| pixels[i]).collect();
            let exposed = match choice {
                Choice::Window => {
                    kept.on_window = members.len();
                    expose(&window, stream, &chosen, &done)?
                }
                Choice::Cohort => {
                    kept.on_cohort = members.len();
                    expose(&cohort, stream, &chosen, &done)?
                }
            };
            work += exposed.work;
            for (pixel, counts) in members.into_iter().zip(exposed.histograms) {
                histograms[pixel] = counts;
            }
        }
        Ok((Exposed { histograms, work }, kept))
    }
}

struct Planner<'a> {
    cohort: &'a Cohort<'a>,
    exact: &'a Cohort<'a>,
    law: &'a WindowLaw,
    peak: &'a PeakOptions,
    window: &'a Window<'a>,
    stream: &'a PhotonStream,
    bins: usize,
}

impl Planner<'_> {
    /// The cheapest way to expose `pixel` and the bound on its depth error, m.
    fn choose(&self, pixel: &LitPixel, tolerance_m: f64) -> (Choice, f64) {
        let exact = (Choice::Window, 0.0);
        let Some(light) = pixel.light.as_ref().filter(|_| tolerance_m > 0.0) else {
            return exact;
        };
        let stream = self.stream.config();
        let window_s = self.bins as f64 / stream.clock.as_hz();
        let per_cycle = light.background_hz * window_s + light.signal_per_cycle;
        let handled = match self.window.draws_whole_cycles(self.stream, pixel) {
            true => PHOTONS_PER_SORTED * light.photons_per_cycle(stream),
            false => per_cycle,
        };
        let photons = handled * f64::from(stream.laser_cycles);
        let per_dead_time = per_cycle / window_s * stream.spads.dead_time.as_s();
        let blind = per_dead_time / (1.0 + per_dead_time / SPADS as f64);
        let [ready, more] = PHOTONS_PER_JOINT;
        let per_bin = match self.cohort.pools(stream, pixel.start, light) {
            Ok(true) => PHOTONS_PER_POOL,
            Ok(false) => ready + more * blind,
            Err(_) => return exact,
        };
        if self.bins as f64 * per_bin + PHOTONS_PER_LIGHT >= photons {
            return exact;
        }
        match self.bound_m(pixel, light) {
            Some(bound_m) if bound_m <= tolerance_m => (Choice::Cohort, bound_m),
            _ => exact,
        }
    }

    /// Bound on what the cohort engine adds to the depth of `pixel` on average, m; `None` where there is no depth, or where
    /// it refuses.
    fn bound_m(&self, pixel: &LitPixel, light: &PixelLight) -> Option<f64> {
        let stream = self.stream.config();
        let means = |cohort: &Cohort| cohort.expected(stream, pixel.start, light).ok();
        let exact = means(self.exact)?;
        let drawn_m = self.depth_m(pixel, &means(self.cohort)?)?;
        let exact_m = self.depth_m(pixel, &exact)?;
        // What is left of the error is worst where it has one sign before the peak and the other after it.
        let (peak, _) = exact
            .iter()
            .enumerate()
            .max_by(|(_, a), (_, b)| a.total_cmp(b))?;
        let tilted_m = [1.0, -1.0].map(|sign| {
            let tilted = exact.iter().enumerate().map(|(bin, mean)| {
                let sign = if bin <= peak { sign } else { -sign };
                (mean + sign * BOUND_ERROR * mean.sqrt()).max(0.0)
            });
            self.depth_m(pixel, &tilted.collect::<Vec<_>>())
        });
        let left_m = tilted_m.map(|tilted_m| tilted_m.map(|tilted_m| (tilted_m - exact_m).abs()));
        Some(2.0 * (drawn_m - exact_m).abs() + left_m[0]?.max(left_m[1]?))
    }

    /// The depth of mean counts, m; `None` where there is none.
    fn depth_m(&self, pixel: &LitPixel, means: &[f64]) -> Option<f64> {
        let window = self.law.window(pixel.start).open()?;
        let scale = WHOLE_COUNTS / means.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let counts: Vec<u32> = means
            .iter()
            .map(|mean| (mean * scale).round() as u32)
            .collect();
        let found = interpolate(&counts, self.peak)?;
        Some(self.law.time_of(&window, found.position_bins).as_range_m())
    }
}
