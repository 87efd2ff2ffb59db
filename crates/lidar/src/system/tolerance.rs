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
//! cheaper one ([`super::price`]) and those that the cohort engine refuses ([`OnWindow`]).

use std::collections::BTreeMap;
use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use super::price;
use crate::chip::{Exposure, Sensor, WindowLaw};
use crate::engine::{
    Answer, Cohort, CohortOptions, EngineError, EngineWork, Expose, ExposureResult, Histograms,
    LitPixel, Window, expose,
};
use crate::photon::{PhotonStream, PixelLight};
use crate::ranging::{PeakOptions, interpolate};
use crate::units::TimeOfFlight;

/// The part of a bin's counting noise to which its mean is known for the bound.
const BOUND_ERROR: f64 = 0.001;

/// Totals to which mean counts are scaled before they are rounded to whole ones: a depth keeps nine digits.
const WHOLE_COUNTS: f64 = 1e9;

/// Why a macropixel is on the window engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OnWindow {
    /// No light, or no error allowed: there is no choice.
    NoChoice,
    /// The window engine is the cheaper one.
    Cheaper,
    /// The bound on the depth error is larger than the tolerance, or there is no depth.
    BeyondTolerance,
    /// The cohort engine refuses: laser cycles may depend on each other.
    CyclesDepend,
    /// The cohort engine refuses: it does not know its means exactly enough.
    NotExact,
    /// The cohort engine refuses: its model leaves this light or these SPADs out.
    NotModelled,
}

impl OnWindow {
    /// What stands behind a refusal of the cohort engine, in words; `None` where it did not refuse.
    pub(crate) fn refusal(self) -> Option<&'static str> {
        match self {
            OnWindow::NoChoice | OnWindow::Cheaper | OnWindow::BeyondTolerance => None,
            OnWindow::CyclesDepend => Some("laser cycles may depend on each other"),
            OnWindow::NotExact => Some("means not exact enough"),
            OnWindow::NotModelled => Some("light or SPADs that it does not model"),
        }
    }

    fn refused(error: &EngineError) -> Self {
        match error {
            EngineError::CyclesNotIndependent { .. } => OnWindow::CyclesDepend,
            EngineError::CoarseCohorts { .. } => OnWindow::NotExact,
            _ => OnWindow::NotModelled,
        }
    }
}

/// What was chosen, and the bound that it keeps.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ToleranceResult {
    /// What was asked for, m.
    pub tolerance_m: f64,
    /// Largest bound of all macropixels, m.
    pub bound_m: f64,
    /// Macropixels on the window engine.
    pub on_window: usize,
    /// These by the reason why they are there.
    pub on_window_by_reason: BTreeMap<OnWindow, usize>,
    /// Macropixels on the cohort engine.
    pub on_cohort: usize,
    /// Share of the exposure's run time, planning included, that macropixels took which the cohort engine refused.
    pub refused_run_time_share: f64,
}

impl ToleranceResult {
    /// Macropixels that the cohort engine refused, by the reason in words.
    pub fn refused(&self) -> impl Iterator<Item = (&'static str, usize)> {
        let reasons = self.on_window_by_reason.iter();
        reasons.filter_map(|(why, &pixels)| Some((why.refusal()?, pixels)))
    }
}

/// A frame's chip and clocks, and the depth error that it may have.
#[derive(Debug, Clone, Copy)]
pub struct Tolerance<'a> {
    /// Depth error that the choice of engine may add on average, m.
    pub tolerance_m: f64,
    /// The chip.
    pub sensor: &'a Sensor,
    /// Its exposure.
    pub exposure: &'a Exposure,
    /// Depth from histograms.
    pub peak: &'a PeakOptions,
}

impl Tolerance<'_> {
    /// Exposes `pixels`, each on the cheapest engine that keeps its depth within the tolerance of the exact one's on
    /// average. `done` is called with macropixels as they are finished, and may stop the exposure as in [`expose`].
    ///
    /// # Errors
    /// Configurations that the window engine refuses, and [`EngineError::Stopped`].
    pub fn expose<A: Answer>(
        &self,
        stream: &PhotonStream,
        pixels: &[LitPixel],
        done: impl Fn(usize) -> A + Sync,
    ) -> Result<(ExposureResult, ToleranceResult), EngineError> {
        let Tolerance {
            tolerance_m,
            sensor,
            exposure,
            peak,
        } = *self;
        let cohort = Cohort::new(sensor, exposure, CohortOptions::default());
        let options = CohortOptions {
            error: BOUND_ERROR,
            ..CohortOptions::default()
        };
        let exact = Cohort::new(sensor, exposure, options);
        let law = WindowLaw::new(sensor, exposure);
        let window = Window::new(sensor, exposure);
        let planner = Planner {
            cohort: &cohort,
            exact: &exact,
            law: &law,
            peak,
            window: &window,
            stream,
            sensor,
        };
        let begin = Instant::now();
        let plan: Vec<Result<f64, OnWindow>> = pixels
            .par_iter()
            .map(|pixel| planner.choose(pixel, tolerance_m))
            .collect();

        let mut kept = ToleranceResult {
            tolerance_m,
            bound_m: plan.iter().flatten().copied().fold(0.0, f64::max),
            on_cohort: plan.iter().flatten().count(),
            ..ToleranceResult::default()
        };
        kept.on_window = pixels.len() - kept.on_cohort;
        for &why in plan.iter().filter_map(|choice| choice.as_ref().err()) {
            *kept.on_window_by_reason.entry(why).or_default() += 1;
        }
        let is_refused = |choice: &Result<f64, OnWindow>| match choice {
            Ok(_) => false,
            Err(why) => why.refusal().is_some(),
        };
        let mut histograms = Histograms::empty(pixels.len(), self.sensor.bins);
        let mut work = EngineWork::default();
        let mut run = |engine: &dyn Expose, takes: &dyn Fn(&Result<f64, OnWindow>) -> bool| {
            let begin = Instant::now();
            let members: Vec<usize> = (0..pixels.len()).filter(|&i| takes(&plan[i])).collect();
            let chosen: Vec<LitPixel> = members.iter().map(|&i| pixels[i].clone()).collect();
            let exposed = expose(engine, stream, &chosen, &done)?;
            work += exposed.work;
            for (pixel, counts) in members.into_iter().zip(&exposed.histograms) {
                histograms[pixel].copy_from_slice(counts);
            }
            Ok::<_, EngineError>(begin.elapsed())
        };
        run(&cohort, &|choice| choice.is_ok())?;
        run(&window, &|choice| choice.is_err() && !is_refused(choice))?;
        let refused = run(&window, &is_refused)?;
        if kept.refused().next().is_some() {
            kept.refused_run_time_share = refused.as_secs_f64() / begin.elapsed().as_secs_f64();
        }
        Ok((ExposureResult { histograms, work }, kept))
    }
}

struct Planner<'a> {
    cohort: &'a Cohort,
    exact: &'a Cohort,
    law: &'a WindowLaw,
    peak: &'a PeakOptions,
    window: &'a Window,
    stream: &'a PhotonStream,
    sensor: &'a Sensor,
}

impl Planner<'_> {
    /// The bound on the depth error of `pixel` on the cohort engine, m, where that is the cheaper one and keeps it.
    fn choose(&self, pixel: &LitPixel, tolerance_m: f64) -> Result<f64, OnWindow> {
        let light = pixel.light.as_ref().filter(|_| tolerance_m > 0.0);
        let light = light.ok_or(OnWindow::NoChoice)?;
        let window_ns = price::window_ns(self.window, self.sensor, self.stream, pixel, light);
        if window_ns <= price::BOUND_NS {
            return Err(OnWindow::Cheaper);
        }
        let refused = |error| OnWindow::refused(&error);
        let cohort_ns = price::cohort_ns(self.cohort, self.stream, pixel.start, light);
        if window_ns <= cohort_ns.map_err(refused)? {
            return Err(OnWindow::Cheaper);
        }
        match self.bound_m(pixel, light).map_err(refused)? {
            Some(bound_m) if bound_m <= tolerance_m => Ok(bound_m),
            _ => Err(OnWindow::BeyondTolerance),
        }
    }

    /// Bound on what the cohort engine adds to the depth of `pixel` on average, m; `None` where there is no depth.
    ///
    /// # Errors
    /// As [`Cohort::draw`].
    fn bound_m(&self, pixel: &LitPixel, light: &PixelLight) -> Result<Option<f64>, EngineError> {
        let stream = self.stream.config();
        let exact = self.exact.expected(stream, pixel.start, light)?;
        let drawn = self.cohort.expected(stream, pixel.start, light)?;
        Ok(self.bound_between_m(pixel, &exact, &drawn))
    }

    /// As [`Planner::bound_m`], from means at both exactnesses.
    fn bound_between_m(&self, pixel: &LitPixel, exact: &[f64], drawn: &[f64]) -> Option<f64> {
        let drawn_m = self.depth_m(pixel, drawn)?;
        let exact_m = self.depth_m(pixel, exact)?;
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
