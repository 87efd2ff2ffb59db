//! Run time against error: the engines and their knobs on scenes from dark to bright and near to far.
//!
//! A *cell* of the experiment is a wall at one range under one light, seen by a row of macropixels whose ranges differ
//! by fractions of a bin. Every *method* exposes the same cells with the same seed; the [`Method::Cycle`] engine, which
//! steps the netlist through every CLK period, is what the others are held against. Run times are wall-clock
//! medians of some runs on all threads, method after method, so that only their ratios should be quoted.
//!
//! What a difference from `cycle` means depends on what the method was given ([`Method::against_cycle`]). One that
//! simulates the same photons is right or wrong count by count ([`Errors::mismatch`]). One that has photons of its own, or
//! none, is right if its histograms have the same distribution: its means must agree ([`Errors::mean_shift`]), while
//! count by count it differs as much as the exact engine with another seed does, which is why [`Method::AnotherSeed`]
//! is among them. What is left of the mean shift beyond chance is its discretisation.

use std::time::Instant;

use serde::Serialize;

use crate::chip::{Exposure, SensorConfig, WindowLaw};
use crate::engine::{
    Cohort, CohortOptions, Cycle, EngineError, Exposed, Gate, LitPixel, Window, expose,
    expose_without_skipping, stream_config,
};
use crate::photon::{PhotonStream, PixelLight};
use crate::ranging::{PeakOptions, interpolate};
use crate::scene::Scene;
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time};

/// An engine with its knob.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Event-driven, every net; on at most [`GATE_CYCLES`] laser cycles.
    Gate,
    /// Every CLK period: what the others are compared with.
    Cycle,
    /// The window law, with every photon of the exposure drawn.
    WindowWithoutSkipping,
    /// The window law, with only the photons that matter.
    Window,
    /// The same with another seed: how far apart two exact frames are.
    AnotherSeed,
    /// The window engine on one laser cycle in this many, counts multiplied.
    FewerCycles(u32),
    /// The cohort engine with this many steps to a CLK period.
    Cohort(usize),
}

/// Laser cycles that are run at gate level at most.
pub const GATE_CYCLES: u32 = 20;

impl Method {
    /// Every method of the comparison: the one that the others are held against, and last the one that takes longest.
    pub const ALL: [Method; 11] = [
        Method::Cycle,
        Method::WindowWithoutSkipping,
        Method::Window,
        Method::AnotherSeed,
        Method::FewerCycles(2),
        Method::FewerCycles(8),
        Method::FewerCycles(32),
        Method::Cohort(8),
        Method::Cohort(4),
        Method::Cohort(1),
        Method::Gate,
    ];

    /// Engine and knob, as tables name them.
    pub fn name(self) -> String {
        match self {
            Method::Gate => "gate".into(),
            Method::Cycle => "cycle".into(),
            Method::WindowWithoutSkipping => "window, no skipping".into(),
            Method::Window => "window".into(),
            Method::AnotherSeed => "window, another seed".into(),
            Method::FewerCycles(n) => format!("window, 1/{n} of the laser cycles"),
            Method::Cohort(1) => "cohort, 1 step a bin".into(),
            Method::Cohort(n) => format!("cohort, {n} steps a bin"),
        }
    }
}

impl Method {
    /// What makes its counts differ from those of the `cycle` engine, in a few words.
    pub fn against_cycle(self) -> String {
        match self {
            Method::Cycle => "the reference".into(),
            Method::Gate | Method::WindowWithoutSkipping | Method::Window => "same photons".into(),
            Method::AnotherSeed => "another seed".into(),
            Method::FewerCycles(n) => format!("1/{n} of the photons"),
            Method::Cohort(1) => "own draws, 1 step".into(),
            Method::Cohort(n) => format!("own draws, {n} steps"),
        }
    }
}

/// What [`ParetoSettings::compare`] has done.
#[derive(Debug, Clone, Copy)]
pub enum Done<'p> {
    /// All runs of a method on one wall.
    Wall,
    /// A method on every wall.
    Method(&'p [Point]),
}

/// What to compare.
#[derive(Debug, Clone, PartialEq)]
pub struct ParetoSettings {
    /// The chip.
    pub sensor: SensorConfig,
    /// Optics, laser and dark counts; illuminance and surfaces are the cells'.
    pub scene: Scene,
    /// CLK periods in a laser cycle.
    pub stop_periods: u32,
    /// Laser cycles of an exposure.
    pub laser_cycles: u32,
    /// Ranges of the walls, m.
    pub ranges_m: Vec<f64>,
    /// Sunlight on them, klux.
    pub illuminances_klux: Vec<f64>,
    /// Their reflectivity, 0 to 1.
    pub reflectivity: f64,
    /// Macropixels that see a wall.
    pub macropixels: usize,
    /// Timed runs of each method on each cell.
    pub repeats: usize,
    /// Seed of the photons.
    pub seed: u64,
}

/// How far a method is from the `cycle` engine, over the macropixels of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Errors {
    /// Sum of the differences of all counts, over the sum of all counts.
    pub mismatch: f64,
    /// Root mean square over the bins of the difference between mean counts, in standard deviations of one
    /// histogram's counts. Two exact methods that share no photons come to about √(2 / macropixels).
    pub mean_shift: f64,
    /// Root mean square difference of depths, m; `None` without a macropixel in which both find a peak.
    pub depth_rms_m: Option<f64>,
    /// Mean difference of depths, m.
    pub depth_mean_m: Option<f64>,
}

/// One method on one cell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Point {
    /// Engine and knob.
    pub method: Method,
    /// Range of the wall, m.
    pub range_m: f64,
    /// Sunlight on it, klux.
    pub illuminance_klux: f64,
    /// Median wall-clock time for a macropixel and laser cycle, ns.
    pub run_time_ns: f64,
    /// That of the `cycle` engine on the same cell, over this one's.
    pub speed_up: f64,
    /// Error against it.
    pub errors: Errors,
}

/// A method's histograms of a wall.
struct Run {
    exposed: Exposed,
    /// Median wall-clock time for a macropixel and laser cycle.
    time_ns: f64,
}

/// A wall, as a row of macropixels sees it.
struct Cell {
    range_m: f64,
    illuminance_klux: f64,
    pixels: Vec<LitPixel>,
}

impl ParetoSettings {
    fn exposure(&self, laser_cycles: u32) -> Exposure {
        Exposure::new(&self.sensor, self.stop_periods, laser_cycles)
    }

    /// Walls out of the sensor's reach are left out.
    fn cells(&self) -> Vec<Cell> {
        let law = WindowLaw::new(&self.sensor, &self.exposure(1));
        let budget = self
            .scene
            .photon_budget(self.sensor.rows as u32, self.sensor.cols as u32);
        let bin_m = SPEED_OF_LIGHT_M_PER_S / (2.0 * self.sensor.clk_hz);
        let cells = self.illuminances_klux.iter().flat_map(|&klux| {
            let ranges = self.ranges_m.iter();
            ranges.map(move |&range_m| (klux, range_m))
        });
        cells
            .filter_map(|(illuminance_klux, range_m)| {
                let pixel = |number: usize| {
                    let phase = number as f64 / self.macropixels as f64 - 0.5;
                    let range_m = range_m + phase * bin_m;
                    let arrival = Time::of_flight(range_m);
                    Some(LitPixel {
                        number: number as u32,
                        start: law.start_for(arrival)?,
                        light: Some(PixelLight {
                            signal_per_cycle: budget.signal_per_pulse(range_m, self.reflectivity),
                            arrival,
                            background_hz: budget
                                .background_hz(self.reflectivity, illuminance_klux)
                                + self.scene.lidar.dark_count_hz,
                        }),
                    })
                };
                let pixels: Option<Vec<LitPixel>> = (0..self.macropixels).map(pixel).collect();
                Some(Cell {
                    range_m,
                    illuminance_klux,
                    pixels: pixels?,
                })
            })
            .collect()
    }

    /// Walls within the sensor's reach.
    pub fn cell_count(&self) -> usize {
        self.cells().len()
    }

    fn stream(&self, laser_cycles: u32, seed: u64) -> PhotonStream {
        let exposure = self.exposure(laser_cycles);
        let sigma = self.scene.pulse_sigma();
        PhotonStream::new(&stream_config(&self.sensor, &exposure, seed, sigma))
    }

    fn run(&self, method: Method, cell: &Cell) -> Result<Exposed, EngineError> {
        let (sensor, pixels) = (&self.sensor, &cell.pixels);
        let laser_cycles = self.cycles_of(method);
        let exposure = self.exposure(laser_cycles);
        let seed = self.seed + u64::from(method == Method::AnotherSeed);
        let stream = self.stream(laser_cycles, seed);
        let silent = |_| ();
        let windows = |exposure| Window::new(sensor, exposure);
        match method {
            Method::Gate => expose(&Gate::new(sensor, &exposure), &stream, pixels, silent),
            Method::Cycle => expose(&Cycle::new(sensor, &exposure), &stream, pixels, silent),
            Method::WindowWithoutSkipping => {
                expose_without_skipping(&windows(&exposure), &stream, pixels, silent)
            }
            Method::Window | Method::AnotherSeed | Method::FewerCycles(_) => {
                expose(&windows(&exposure), &stream, pixels, silent)
            }
            Method::Cohort(sub_bins) => {
                let options = CohortOptions {
                    sub_bins: Some(sub_bins),
                    ..CohortOptions::default()
                };
                expose(
                    &Cohort::new(sensor, &exposure, options),
                    &stream,
                    pixels,
                    silent,
                )
            }
        }
    }

    fn cycles_of(&self, method: Method) -> u32 {
        match method {
            Method::Gate => self.laser_cycles.min(GATE_CYCLES),
            Method::FewerCycles(n) => (self.laser_cycles / n).max(1),
            _ => self.laser_cycles,
        }
    }

    /// How often [`Done::Wall`] is told: once for each method and wall, the reference included.
    pub fn run_count(&self, methods: &[Method]) -> usize {
        let others = methods.iter().filter(|&&m| m != Method::Cycle).count();
        self.cell_count() * (others + 1)
    }

    /// Runs every method on every cell, method after method; `done` is told of each wall and each method.
    ///
    /// # Errors
    /// Configurations that an engine refuses.
    pub fn compare(
        &self,
        methods: &[Method],
        mut done: impl FnMut(Done<'_>),
    ) -> Result<Vec<Point>, EngineError> {
        let cells = self.cells();
        let mut references = Vec::new();
        for cell in &cells {
            references.push(self.timed(Method::Cycle, cell)?);
            done(Done::Wall);
        }
        let mut points = Vec::new();
        for &method in methods {
            let first = points.len();
            for (cell, reference) in cells.iter().zip(&references) {
                if method == Method::Cycle {
                    points.push(self.point(method, cell, reference, reference)?);
                } else {
                    let run = self.timed(method, cell)?;
                    points.push(self.point(method, cell, &run, reference)?);
                    done(Done::Wall);
                }
            }
            done(Done::Method(&points[first..]));
        }
        Ok(points)
    }

    /// A method on a wall, as often as it is to be timed.
    fn timed(&self, method: Method, cell: &Cell) -> Result<Run, EngineError> {
        let work = self.macropixels as f64 * f64::from(self.cycles_of(method));
        let mut times_ns = Vec::new();
        loop {
            let begin = Instant::now();
            let exposed = self.run(method, cell)?;
            times_ns.push(begin.elapsed().as_secs_f64() * 1e9 / work);
            if times_ns.len() >= self.repeats {
                let time_ns = median(&times_ns);
                return Ok(Run { exposed, time_ns });
            }
        }
    }

    fn point(
        &self,
        method: Method,
        cell: &Cell,
        run: &Run,
        reference: &Run,
    ) -> Result<Point, EngineError> {
        let law = WindowLaw::new(&self.sensor, &self.exposure(1));
        let shorter;
        let exact = match method {
            Method::Gate => {
                let laser_cycles = self.cycles_of(method);
                let settings = ParetoSettings {
                    laser_cycles,
                    ..self.clone()
                };
                shorter = settings.run(Method::Cycle, cell)?;
                &shorter
            }
            _ => &reference.exposed,
        };
        let scale = match method {
            Method::FewerCycles(_) => {
                f64::from(self.laser_cycles) / f64::from(self.cycles_of(method))
            }
            _ => 1.0,
        };
        // Fewer laser cycles take less time for the same exposure.
        let run_time_ns = run.time_ns / scale;
        Ok(Point {
            method,
            range_m: cell.range_m,
            illuminance_klux: cell.illuminance_klux,
            run_time_ns,
            speed_up: reference.time_ns / run_time_ns,
            errors: errors(&law, &cell.pixels, &run.exposed, exact, scale),
        })
    }
}

fn errors(
    law: &WindowLaw,
    pixels: &[LitPixel],
    found: &Exposed,
    exact: &Exposed,
    scale: f64,
) -> Errors {
    let (mut differences, mut counts) = (0.0, 0.0);
    let bins = exact.histograms.first().map_or(0, Vec::len);
    let mut moments = vec![[0.0; 3]; bins];
    let mut depths = Vec::new();
    for ((pixel, found), exact) in pixels.iter().zip(&found.histograms).zip(&exact.histograms) {
        for ((&found, &exact), moments) in found.iter().zip(exact).zip(&mut moments) {
            let (found, exact) = (scale * f64::from(found), f64::from(exact));
            differences += (found - exact).abs();
            counts += exact;
            moments[0] += found - exact;
            moments[1] += exact;
            moments[2] += exact * exact;
        }
        if let (Some(found), Some(exact)) = (depth_m(law, pixel, found), depth_m(law, pixel, exact))
        {
            depths.push(found - exact);
        }
    }
    let n = pixels.len() as f64;
    let shifts = moments.iter().map(|[difference, sum, squares]| {
        let variance = (squares / n - (sum / n).powi(2)).max(1.0 / n);
        (difference / n).powi(2) / variance
    });
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let values: Vec<f64> = values.collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    Errors {
        mismatch: if counts > 0.0 {
            differences / counts
        } else {
            0.0
        },
        mean_shift: f64::sqrt(shifts.sum::<f64>() / bins.max(1) as f64),
        depth_rms_m: mean(&mut depths.iter().map(|d| d * d)).map(f64::sqrt),
        depth_mean_m: mean(&mut depths.iter().copied()),
    }
}

fn depth_m(law: &WindowLaw, pixel: &LitPixel, counts: &[u16]) -> Option<f64> {
    let window = law.window(pixel.start).open()?;
    let counts: Vec<u32> = counts.iter().map(|&n| n.into()).collect();
    let peak = interpolate(&counts, &PeakOptions::default())?;
    Some(law.time_of(&window, peak.position_bins).as_range_m())
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// One method over all cells: medians, and the worst cell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Summary {
    /// Engine and knob.
    pub method: Method,
    /// Run time for a macropixel and laser cycle, ns.
    pub run_time_ns: f64,
    /// Speed-up over the `cycle` engine.
    pub speed_up: f64,
    /// See [`Errors::mismatch`].
    pub mismatch: f64,
    /// See [`Errors::mean_shift`].
    pub mean_shift: f64,
    /// See [`Errors::depth_rms_m`].
    pub depth_rms_m: Option<f64>,
    /// Mean difference of depths, either way, m.
    pub depth_mean_m: Option<f64>,
    /// Each of these where it is worst.
    pub worst: Worst,
}

/// The worst of each figure over all cells.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Worst {
    /// Longest run time, ns.
    pub run_time_ns: f64,
    /// Least speed-up.
    pub speed_up: f64,
    /// Largest mismatch.
    pub mismatch: f64,
    /// Largest mean shift.
    pub mean_shift: f64,
    /// Largest, m.
    pub depth_rms_m: Option<f64>,
    /// Largest, m.
    pub depth_mean_m: Option<f64>,
    /// Range of the wall with the largest RMS difference of depths, m; `None` where there is none at all.
    pub range_m: Option<f64>,
    /// Sunlight on it, klux.
    pub illuminance_klux: Option<f64>,
}

/// Sums up one method over the cells; `None` without a point.
pub fn summarise(points: &[Point]) -> Option<Summary> {
    let method = points.first()?.method;
    debug_assert!(points.iter().all(|point| point.method == method));
    // Each figure's values in ascending order: the median is in the middle, the worst at an end.
    let sorted = |value: &dyn Fn(&Point) -> Option<f64>| {
        let mut values: Vec<f64> = points.iter().filter_map(value).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let middle = |values: &[f64]| values.get(values.len() / 2).copied();
    let most = |values: &[f64]| values.last().copied();
    let run_time = sorted(&|p| Some(p.run_time_ns));
    let speed_up = sorted(&|p| Some(p.speed_up));
    let mismatch = sorted(&|p| Some(p.errors.mismatch));
    let mean_shift = sorted(&|p| Some(p.errors.mean_shift));
    let depth_rms = sorted(&|p| p.errors.depth_rms_m);
    let depth_mean = sorted(&|p| p.errors.depth_mean_m.map(f64::abs));
    let farthest = points
        .iter()
        .filter(|p| p.errors.depth_rms_m > Some(0.0))
        .max_by(|a, b| {
            a.errors
                .depth_rms_m
                .partial_cmp(&b.errors.depth_rms_m)
                .expect("no NaN")
        });
    Some(Summary {
        method,
        run_time_ns: middle(&run_time)?,
        speed_up: middle(&speed_up)?,
        mismatch: middle(&mismatch)?,
        mean_shift: middle(&mean_shift)?,
        depth_rms_m: middle(&depth_rms),
        depth_mean_m: middle(&depth_mean),
        worst: Worst {
            run_time_ns: most(&run_time)?,
            speed_up: speed_up.first().copied()?,
            mismatch: most(&mismatch)?,
            mean_shift: most(&mean_shift)?,
            depth_rms_m: most(&depth_rms),
            depth_mean_m: most(&depth_mean),
            range_m: farthest.map(|p| p.range_m),
            illuminance_klux: farthest.map(|p| p.illuminance_klux),
        },
    })
}
