//! Run time against error: the engines and their knobs on scenes from dark to bright and near to far.
//!
//! A *cell* of the experiment is a wall at one range under one light, seen by a row of macropixels whose ranges differ
//! by fractions of a bin. Every *method* exposes the same cells with the same seed; the [`Method::Cycle`] engine, which
//! steps the netlist through every CLK period, is what the others are held against. Run times are wall-clock
//! medians of some runs on all threads, method after method, so that only their ratios should be quoted.
//!
//! What a difference from `cycle` means depends on what the method was given (`Method::against_cycle`). One that
//! simulates the same photons is right or wrong count by count ([`Errors::mismatch`]). One that has photons of its own, or
//! none, is right if its histograms have the same distribution: its means must agree ([`Errors::mean_shift`]), while
//! count by count it differs as much as the exact engine with another seed does, which is why [`Method::AnotherSeed`]
//! is among them. What is left of the mean shift beyond chance is its discretisation.

mod errors;
mod method;
mod summary;

use std::time::Instant;

use serde::Serialize;

pub use errors::Errors;
use method::MEASURED_PERIODS;
pub use method::{GATE_CYCLES, Method};
pub use summary::{MethodSummary, Worst, summarise};

use super::light::photon_stream;
use crate::chip::{Exposure, Sensor, WindowLaw};
use crate::engine::{
    Cohort, CohortOptions, Cycle, EngineError, ExposureResult, Gate, LitPixel, Window, expose,
    expose_without_skipping,
};
use crate::photon::{PhotonStream, PixelLight};
use crate::scene::Scene;
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time, TimeOfFlight};

/// What [`ParetoSettings::compare`] has done.
#[derive(Debug, Clone, Copy)]
pub enum Done<'p> {
    /// All runs of a method on one wall.
    Wall,
    /// A method on every wall.
    Method(&'p [ParetoPoint]),
}

/// What to compare.
#[derive(Debug, Clone, PartialEq)]
pub struct ParetoSettings {
    /// The chip.
    pub sensor: Sensor,
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

/// One method on one cell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ParetoPoint {
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
    exposed: ExposureResult,
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
        let bin_m = |range_m: f64| {
            let window = law
                .window(law.start_for(Time::of_flight(range_m))?)
                .open()?;
            let width_s = law.edges(&window, 0).mean_width_s();
            Some(width_s * SPEED_OF_LIGHT_M_PER_S / 2.0)
        };
        let cells = self.illuminances_klux.iter().flat_map(|&klux| {
            let ranges = self.ranges_m.iter();
            ranges.map(move |&range_m| (klux, range_m))
        });
        cells
            .filter_map(|(illuminance_klux, range_m)| {
                let bin_m = bin_m(range_m)?;
                let pixel = |number: usize| {
                    let phase = number as f64 / self.macropixels as f64 - 0.5;
                    let range_m = range_m + phase * bin_m;
                    let arrival = Time::of_flight(range_m);
                    Some(LitPixel {
                        number: number as u32,
                        start: law.start_for(arrival)?,
                        light: Some(
                            PixelLight::echo(
                                budget.signal_per_pulse(range_m, self.reflectivity),
                                arrival,
                            )
                            .with_background(
                                budget.background_hz(self.reflectivity, illuminance_klux)
                                    + self.scene.lidar.dark_counts_hz(),
                            ),
                        ),
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
        photon_stream(&self.sensor, &exposure, seed, &self.scene)
    }

    fn run(&self, method: Method, cell: &Cell) -> Result<ExposureResult, EngineError> {
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
            Method::Cohort => {
                let cohort = Cohort::new(sensor, &exposure, CohortOptions::default());
                expose(&cohort, &stream, pixels, silent)
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

    /// How often [`Done::Wall`] is reported: once for each method and wall, the reference included.
    pub fn run_count(&self, methods: &[Method]) -> usize {
        let others = methods.iter().filter(|&&m| m != Method::Cycle).count();
        self.cell_count() * (others + 1)
    }

    /// About how much processor time the comparison takes, s.
    pub fn processor_s(&self, methods: &[Method]) -> f64 {
        let periods = f64::from(self.stop_periods) / MEASURED_PERIODS;
        let runs = self.macropixels as f64 * self.repeats as f64 * periods;
        let cells = self.cells();
        let run_times_s = methods.iter().flat_map(|&method| {
            let cycles = f64::from(self.cycles_of(method));
            let [dark_ns, each_klux_ns] = method.processor_ns();
            let cell_ns = move |cell: &Cell| dark_ns + each_klux_ns * cell.illuminance_klux;
            cells
                .iter()
                .map(move |cell| runs * cycles * cell_ns(cell) * 1e-9)
        });
        run_times_s.sum()
    }

    /// Runs every method on every cell, method after method; `done` is called after each wall and each method.
    ///
    /// # Errors
    /// Configurations that an engine refuses.
    pub fn compare(
        &self,
        methods: &[Method],
        mut done: impl FnMut(Done<'_>),
    ) -> Result<Vec<ParetoPoint>, EngineError> {
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
    ) -> Result<ParetoPoint, EngineError> {
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
        Ok(ParetoPoint {
            method,
            range_m: cell.range_m,
            illuminance_klux: cell.illuminance_klux,
            run_time_ns,
            speed_up: reference.time_ns / run_time_ns,
            errors: Errors::compare(&law, &cell.pixels, &run.exposed, exact, scale),
        })
    }
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}
