//! The cheapest engine for every macropixel that keeps a stated depth error.
//!
//! The window engine is exact and its cost goes with the photons in a window. The cohort engine's does not, but its
//! dead time ends in steps: with k steps to a CLK period the mean counts of its bins, and so the depth they give, are a
//! little off. How much is computed and not guessed: from the mean counts with k and 2k steps follow two depths, and
//! since the error falls at least in proportion to the steps, twice their difference bounds what k steps leave. The
//! bound is on the depth that a histogram of mean counts gives, that is on what the engine adds to the depth
//! of a macropixel on average; the photons' own noise is the same on both engines and no error of either.
//!
//! Macropixels without light, or whose bound cannot be kept, go to the window engine, as do those in which it is the
//! cheaper one.

use rayon::prelude::*;
use serde::Serialize;

use crate::chip::{Exposure, SensorConfig, WindowLaw};
use crate::engine::{Cohort, CohortOptions, EngineError, Exposed, LitPixel, Window, Work, expose};
use crate::photon::{PhotonStream, SPADS};
use crate::ranging::{PeakOptions, interpolate};

/// Steps to a CLK period that the cohort engine may take, cheapest first.
const STEPS: [usize; 4] = [1, 2, 4, 8];

/// Photons that the window engine handles in the time of one bin and step of the cohort engine, where it pools laser
/// cycles.
const PHOTONS_PER_POOL: f64 = 30.0;

/// The same where it follows their joint state: with every SPAD ready, and for each one that is blind on average, times
/// the square root of the steps. Fitted to macropixels of 16 000 laser cycles under 8 and 50 Mcounts/s.
const PHOTONS_PER_JOINT: [f64; 2] = [300.0, 3000.0];

/// The same in the time of one photon where blinding light makes the window engine draw whole laser cycles and sort them.
const PHOTONS_PER_SORTED: f64 = 15.0;

/// Totals to which mean counts are scaled before they are rounded to whole ones: a depth keeps nine digits.
const WHOLE_COUNTS: f64 = 1e9;

/// How a macropixel is exposed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Choice {
    Window,
    /// Index into [`STEPS`].
    Cohort(usize),
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
    /// Macropixels on the cohort engine with 1, 2, 4 and 8 steps to a CLK period.
    pub on_cohort: [usize; STEPS.len()],
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
        let cohorts = STEPS.map(|sub_bins| {
            let options = CohortOptions {
                sub_bins,
                ..CohortOptions::default()
            };
            Cohort::new(config, exposure, options)
        });
        let law = WindowLaw::new(config, exposure);
        let window = Window::new(config, exposure);
        let planner = Planner {
            cohorts: &cohorts,
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
        let choices = (0..STEPS.len()).map(Choice::Cohort);
        for choice in std::iter::once(Choice::Window).chain(choices) {
            let members: Vec<usize> = (0..pixels.len()).filter(|&i| plan[i].0 == choice).collect();
            let chosen: Vec<LitPixel> = members.iter().map(|&i| pixels[i]).collect();
            let exposed = match choice {
                Choice::Window => {
                    kept.on_window = members.len();
                    expose(&window, stream, &chosen, &done)?
                }
                Choice::Cohort(steps) => {
                    kept.on_cohort[steps] = members.len();
                    expose(&cohorts[steps], stream, &chosen, &done)?
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
    cohorts: &'a [Cohort<'a>; STEPS.len()],
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
        let mut coarse = self.depth_m(0, pixel);
        for (steps, per_period) in STEPS.iter().enumerate().take(STEPS.len() - 1) {
            let pools = self.cohorts[steps].pools(stream, pixel.start, light);
            let [ready, more] = PHOTONS_PER_JOINT;
            let per_step = match pools {
                Ok(true) => PHOTONS_PER_POOL,
                _ => ready + more * blind * (*per_period as f64).sqrt(),
            };
            if (self.bins * per_period) as f64 * per_step >= photons {
                return exact;
            }
            let fine = self.depth_m(steps + 1, pixel);
            let (Some(a), Some(b)) = (coarse, fine) else {
                return exact;
            };
            let bound_m = 2.0 * (a - b).abs();
            if bound_m <= tolerance_m {
                return (Choice::Cohort(steps), bound_m);
            }
            coarse = fine;
        }
        exact
    }

    /// The depth of mean counts, m; `None` where there is none, or where the cohort engine refuses.
    fn depth_m(&self, steps: usize, pixel: &LitPixel) -> Option<f64> {
        let window = self.law.window(pixel.start).open()?;
        let cohort = &self.cohorts[steps];
        let means = cohort
            .expected(self.stream.config(), pixel.start, &pixel.light?)
            .ok()?;
        let scale = WHOLE_COUNTS / means.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let counts: Vec<u32> = means
            .iter()
            .map(|mean| (mean * scale).round() as u32)
            .collect();
        let found = interpolate(&counts, self.peak)?;
        Some(self.law.time_of(&window, found.position_bins).as_range_m())
    }
}
