//! Designs on engines: what theory says of them beside `cohort`, and one macropixel at the gates.

use super::goal::Goal;
use super::point::DesignPoint;
use super::problem::Problem;
use crate::chip::{Exposure, Sensor, WindowLaw};
use crate::engine::{Cohort, CohortOptions, EngineError, Expose, Gate, LitPixel, Window, expose};
use crate::files::InputError;
use crate::numerics::intervals::{Estimate, deviation, share};
use crate::photon::{PhotonStream, PixelLight, RandomPurpose, normal, random_stream};
use crate::ranging::DepthOptions;
use crate::request::{Spelling, guided_exposure};
use crate::scene::Scene;
use crate::system::{FrameError, photon_stream, range_counts};
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time, TimeOfFlight};

/// Rows and columns of the array that is checked, at most.
const CHECKED: (usize, usize) = (8, 64);

/// Laser cycles of the macropixel at the gates.
const GATE_CYCLES: u32 = 50;

/// What `cohort` finds of a design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Check {
    /// Share of macropixels that find the target: a significant peak, no farther from the truth than a bin, or four standard deviations.
    pub detection: Estimate,
    /// Standard deviation of their distances, m.
    pub precision_m: Estimate,
}

impl Check {
    /// Whether both intervals reach what `goal` asks for.
    pub fn reaches(&self, goal: &Goal) -> bool {
        self.detection.high >= goal.detection && self.precision_m.low <= goal.precision_m
    }

    /// How many times the laser cycles it takes, about: variances and the chance to miss fall with them.
    pub(super) fn short_of(&self, goal: &Goal) -> f64 {
        let missed = |detection: f64| libm::log((1.0 - detection).clamp(1e-9, 1.0));
        let of_detection = missed(goal.detection) / missed(self.detection.value).min(-1e-3);
        let of_precision = (self.precision_m.value / goal.precision_m).powi(2);
        of_precision.max(of_detection)
    }

    /// Whether what theory says of this point lies in both intervals.
    pub fn agrees(&self, point: &DesignPoint) -> bool {
        self.detection.contains(point.detection) && self.precision_m.contains(point.precision_m)
    }
}

/// A design, ready to be exposed.
struct Bench {
    sensor: Sensor,
    exposure: Exposure,
    law: WindowLaw,
    stream: PhotonStream,
    scene: Scene,
}

impl Bench {
    fn new(
        problem: &Problem,
        point: &DesignPoint,
        most: u32,
        seed: u64,
    ) -> Result<Self, InputError> {
        let design = &point.design;
        let mut config = problem.config_of(design);
        config.rows = config.rows.min(CHECKED.0);
        config.cols = config.cols.min(CHECKED.1);
        let sensor = Sensor::from(config);
        let cycles = design.laser_cycles.min(most);
        let exposure = guided_exposure(&sensor, design.stop_periods, cycles, Spelling::Options)?;
        let scene = problem.scene_of(design);
        Ok(Bench {
            law: WindowLaw::new(&sensor, &exposure),
            stream: photon_stream(&sensor, &exposure, seed, &scene),
            sensor,
            exposure,
            scene,
        })
    }

    /// Macropixel `number`, its target at the goal's range but for a part of a bin, and its guide's estimate as wrong as the design allows: the
    /// target's range, m, with the macropixel.
    fn pixel(
        &self,
        problem: &Problem,
        point: &DesignPoint,
        number: u32,
        seed: u64,
    ) -> (f64, LitPixel) {
        let design = &point.design;
        let mut random = random_stream(seed, RandomPurpose::Guide, number, 0);
        let bin_m = 0.5 * SPEED_OF_LIGHT_M_PER_S / design.clk_hz;
        let phase = (f64::from(number) * 0.618_033_988_749_895).fract() - 0.5;
        let range_m = problem.goal().range_m + phase * bin_m;
        let guided_m = (range_m + design.guide_sigma_m * normal(&mut random)).max(0.0);
        let (signal, background_hz) = problem.light(design.pulse_energy_uj);
        let light = PixelLight::echo(signal, Time::of_flight(range_m));
        // An estimate that is out of reach opens the last window.
        let start = self.law.start_for(Time::of_flight(guided_m));
        let pixel = LitPixel {
            number,
            start: start.unwrap_or(self.sensor.largest_start()),
            light: Some(light.with_background(background_hz)),
        };
        (range_m, pixel)
    }
}

/// A point on `cohort`, in up to 512 macropixels, or on `window` where `cohort` refuses.
///
/// # Errors
/// What an engine refuses.
pub(super) fn check(
    problem: &Problem,
    point: &DesignPoint,
    seed: u64,
) -> Result<Check, FrameError> {
    let bench = Bench::new(problem, point, u32::MAX, seed)?;
    let pixels = 0..bench.sensor.pixels() as u32;
    let (ranges_m, pixels): (Vec<f64>, Vec<LitPixel>) = pixels
        .map(|number| bench.pixel(problem, point, number, seed))
        .unzip();
    let on = |engine: &dyn Expose| expose(engine, &bench.stream, &pixels, |_| ());
    let cohort = Cohort::new(&bench.sensor, &bench.exposure, CohortOptions::default());
    let exposed = match on(&cohort) {
        Err(why) if why.is_refusal() => on(&Window::new(&bench.sensor, &bench.exposure))?,
        exposed => exposed?,
    };
    let starts: Vec<Option<u16>> = pixels.iter().map(|pixel| Some(pixel.start)).collect();
    let readings = range_counts(
        (&bench.sensor, &bench.exposure),
        &bench.scene,
        &DepthOptions::default(),
        None,
        &starts,
        exposed.histograms.counts(),
    )?;
    let bin_m = 0.5 * SPEED_OF_LIGHT_M_PER_S / point.design.clk_hz;
    let farthest_m = bin_m.max(4.0 * point.precision_m);
    let errors_m: Vec<f64> = (readings.iter().zip(&ranges_m))
        .filter_map(|(reading, range_m)| Some(reading.measured_m? - range_m))
        .filter(|error_m| error_m.abs() <= farthest_m)
        .collect();
    let none = [f64::NAN, 0.0, f64::INFINITY];
    Ok(Check {
        detection: share(errors_m.len() as f64, ranges_m.len() as f64),
        precision_m: match errors_m.len() {
            0 | 1 => Estimate {
                value: none[0],
                low: none[1],
                high: none[2],
            },
            _ => deviation(&errors_m),
        },
    })
}

/// Whether the gates of one macropixel count what `window` counts of the same photons, in the first laser cycles of a design; and in how many.
///
/// # Errors
/// What an engine refuses.
pub fn gates_agree(
    problem: &Problem,
    point: &DesignPoint,
    seed: u64,
) -> Result<(bool, u32), FrameError> {
    let bench = Bench::new(problem, point, GATE_CYCLES, seed)?;
    let (_, pixel) = bench.pixel(problem, point, 0, seed);
    let pixels = [pixel];
    let count = |engine: &dyn Expose| -> Result<Vec<u16>, EngineError> {
        let exposed = expose(engine, &bench.stream, &pixels, |_| ())?;
        Ok(exposed.histograms.counts().to_vec())
    };
    let gates = count(&Gate::new(&bench.sensor, &bench.exposure))?;
    let window = count(&Window::new(&bench.sensor, &bench.exposure))?;
    Ok((gates == window, bench.exposure.laser_cycles))
}
