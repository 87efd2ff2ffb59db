//! The cohort engine: histograms without photons, at a cost that does not grow with the laser cycles.
//!
//! Laser cycles whose SPADs are in the same state move together: a binomial draw says how many of them see what in the
//! next step. Three ways of keeping that state share one model of light and dead time:
//!
//! | way | state | exact | cost of a bin |
//! |---|---|---|---|
//! | `pooled.rs` | how many SPADs fired 1, 2, … steps ago | every bin; two bins' correlation up to [`CohortOptions::neglect`] | a few draws |
//! | `joint.rs` | how many cycles have which of these on one macropixel | all of it | a draw for every state that occurs |
//! | `alone.rs` | one cycle, its SPADs one by one | all of it | a random number, more if a SPAD is hit |
//!
//! What they share, and what it costs in exactness:
//!
//! * **Dead time in steps** (`blindness.rs`): [`CohortOptions::sub_bins`] steps to a CLK period, the error knob. The
//!   probability of being blind is exact to first order in the photons on one SPAD in a step. Twice the steps leave
//!   a quarter of the error: at one signal photon a laser cycle and 8 Mcounts/s, 4·10⁻³ of the mean of the worst bin
//!   in one step, 2·10⁻⁴ in four.
//! * **Start.** A window begins with every SPAD in the state that the light before it leaves behind: the steady state
//!   of the background, carried step by step through an echo where one comes before the window. It is a
//!   probability for each age of one SPAD, computed, not drawn.
//! * **Memory.** Laser cycles are taken to be independent. They are unless a SPAD stays busy from one window to the
//!   next: without a dead time's length free of photons it cannot be told whether it has recovered.
//!   The probability of that, over all SPADs and cycles, is bounded; beyond [`CohortOptions::memory`]
//!   the engine refuses. Cycles so early that the first STOP edge is still remembered are run one by one from rest.
//! * A SPAD is to fire at most once in a CLK period: a shorter dead time is refused. So are afterpulses, crosstalk and
//!   measured laser pulses.

mod abreast;
mod alone;
mod blindness;
mod draw;
mod hits;
mod joint;
mod light;
mod overlap;
mod period;
mod pooled;
mod rejection;
mod words;

use std::ops::Range;
use std::sync::OnceLock;

use smallvec::{SmallVec, smallvec};

pub use self::blindness::BlindSpad;
use self::blindness::{Ages, Blindness};
pub use self::draw::none_of;
use self::hits::Hits;
pub use self::hits::at_least_hit;
use self::light::{SpadLight, absorbed};
use self::words::RandomWords;
use super::{Engine, EngineError, Exposed, LitPixel, Work, follows};
use crate::chip::{Exposure, Mode, SensorConfig, WindowLaw, correlation, histogram, window_law};
use crate::photon::{PhotonStream, PixelLight, SPADS, SpadEvent, StreamConfig};

/// Whether 0, 1, 2, … SPADs that fire in a CLK period make an event.
type EventTable = [bool; SPADS + 1];

/// Steps of a window that need no memory of their own.
const FEW_STEPS: usize = 16;

/// Laser cycles with an event, for every bin of a window.
type Counts = SmallVec<[u64; FEW_STEPS]>;

/// Light on one SPAD over a window.
#[derive(Debug, Clone)]
struct Steps {
    /// Mean photons of each step.
    means: SmallVec<[f64; FEW_STEPS]>,
    /// Steps to a CLK period.
    per_period: usize,
}

/// The engine's knobs: what may be left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CohortOptions {
    /// Steps to a CLK period, at least 1. More make the dead time's end finer and cost more.
    pub sub_bins: usize,
    /// Largest correlation between two bins that may be neglected to save time; 0 never neglects any.
    pub neglect: f64,
    /// Largest probability, for a whole exposure of a macropixel, that laser cycles depend on each other.
    pub memory: f64,
}

impl Default for CohortOptions {
    fn default() -> Self {
        CohortOptions {
            sub_bins: 1,
            neglect: 1e-4,
            memory: 1e-6,
        }
    }
}

/// SPADs that are worth following one by one in a CLK period, for each of its steps, before [`joint`] is the cheaper
/// way.
const WORTH_LOOKING_AT: f64 = 200.0;

/// What is left of a state that counts as forgotten.
const FORGOTTEN: f64 = 1e-15;

/// Draws histograms from their distribution.
pub struct Cohort<'a> {
    config: &'a SensorConfig,
    exposure: &'a Exposure,
    law: WindowLaw,
    /// What the law says of each start value, once it has been asked.
    windows: Vec<OnceLock<Opening>>,
    options: CohortOptions,
    /// Photons on a SPAD in a CLK period up to which cycles may be pooled.
    most_photons: f64,
    is_event: EventTable,
}

/// A start value's window, and the beginning of the photon times it collects, in femtoseconds after STOP.
#[derive(Debug, Clone, Copy)]
struct Opening {
    window: window_law::Window,
    from_fs: f64,
}

impl<'a> Cohort<'a> {
    /// An engine for this sensor and exposure.
    pub fn new(config: &'a SensorConfig, exposure: &'a Exposure, options: CohortOptions) -> Self {
        debug_assert!(options.sub_bins >= 1, "a period has a step");
        let is_event = std::array::from_fn(|fired| {
            let spads = ((1u32 << fired) - 1) as u16;
            correlation::model(spads, config.event_type, config.threshold)
        });
        Cohort {
            config,
            exposure,
            law: WindowLaw::new(config, exposure),
            windows: vec![OnceLock::new(); usize::from(config.largest_start()) + 1],
            options,
            most_photons: pooled::most_photons(options.neglect),
            is_event,
        }
    }

    fn opening(&self, start: u16) -> Opening {
        let of_law = || {
            let window = self.law.window(start);
            let from_fs = window.open().map_or(0.0, |window| {
                self.law.interval(&window).start.as_fs() as f64
            });
            Opening { window, from_fs }
        };
        *self.windows[usize::from(start)].get_or_init(of_law)
    }

    /// A histogram of macropixel `pixel` under `light`, bin 0 earliest: a pure function of the stream's seed and
    /// everything given.
    ///
    /// # Errors
    /// Races of the window law, a dead time below a CLK period, and laser cycles that depend on each other.
    pub fn draw(
        &self,
        stream: &StreamConfig,
        pixel: u32,
        start: u16,
        light: &PixelLight,
    ) -> Result<Vec<u16>, EngineError> {
        let (bits, overflow) = (self.config.bin_bits as u32, self.config.overflow);
        let sums = self.sums(stream, pixel, start, light)?;
        let counts = sums.iter().map(|&n| histogram::model(n, bits, overflow));
        Ok(counts.collect())
    }

    /// As [`Cohort::draw`], before counters saturate or wrap.
    ///
    /// # Errors
    /// As [`Cohort::draw`].
    pub fn hits(
        &self,
        stream: &StreamConfig,
        pixel: u32,
        start: u16,
        light: &PixelLight,
    ) -> Result<Vec<u64>, EngineError> {
        Ok(self.sums(stream, pixel, start, light)?.to_vec())
    }

    fn sums(
        &self,
        stream: &StreamConfig,
        pixel: u32,
        start: u16,
        light: &PixelLight,
    ) -> Result<Counts, EngineError> {
        let mut sums: Counts = smallvec![0; self.config.bins];
        let Some(cohorts) = self.cohorts(stream, start, light)? else {
            return Ok(sums);
        };
        let random = &mut RandomWords::new(stream.seed, pixel);
        let (blindness, is_event) = (&cohorts.blindness, &self.is_event);
        for LikeCycles {
            cycles,
            ages,
            steps,
            not_compared,
        } in cohorts.iter()
        {
            let counts = match cycles {
                0 => continue,
                1 => alone::run(blindness, ages, steps, is_event, random),
                _ if self.is_pooled(blindness, steps, *cycles) => {
                    pooled::run(blindness, ages, steps, is_event, *cycles, random)
                }
                _ => joint::run(blindness, ages, steps, is_event, *cycles, random),
            };
            let compared = sums.iter_mut().zip(counts).skip(*not_compared);
            compared.for_each(|(sum, count)| *sum += count);
        }
        Ok(sums)
    }

    fn is_pooled(&self, blindness: &Blindness, steps: &Steps, cycles: u64) -> bool {
        let photons = pooled::largest(steps);
        photons <= self.most_photons
            && pooled::looked_at(blindness, steps, photons, cycles)
                <= WORTH_LOOKING_AT * steps.per_period as f64
    }

    /// Whether a macropixel's settled laser cycles are pooled, which is some thirty times as fast as following their
    /// joint state.
    ///
    /// # Errors
    /// As [`Cohort::draw`].
    pub fn pools(
        &self,
        stream: &StreamConfig,
        start: u16,
        light: &PixelLight,
    ) -> Result<bool, EngineError> {
        let cohorts = self.cohorts(stream, start, light)?;
        Ok(cohorts.is_none_or(
            |Cohorts {
                 blindness, settled, ..
             }| { self.is_pooled(&blindness, &settled.steps, settled.cycles) },
        ))
    }

    /// Mean of every bin of [`Cohort::hits`], computed.
    ///
    /// # Errors
    /// As [`Cohort::draw`].
    pub fn expected(
        &self,
        stream: &StreamConfig,
        start: u16,
        light: &PixelLight,
    ) -> Result<Vec<f64>, EngineError> {
        let mut means = vec![0.0; self.config.bins];
        let Some(cohorts) = self.cohorts(stream, start, light)? else {
            return Ok(means);
        };
        for cohort in cohorts.iter() {
            let mut ages = cohort.ages.clone();
            let periods = cohort.steps.means.chunks(cohort.steps.per_period);
            for (bin, (sum, period)) in means.iter_mut().zip(periods).enumerate() {
                let mut pulse = 0.0;
                for &mean in period {
                    pulse += ages.pulse(&cohorts.blindness, mean);
                    ages.step(&cohorts.blindness, mean);
                }
                let fired = Hits::new(SPADS, pulse, 1.0 - pulse);
                let events = (0..=SPADS).filter(|&spads| self.is_event[spads]);
                let event: f64 = events.map(|spads| fired.exactly(spads)).sum();
                if bin >= cohort.not_compared {
                    *sum += cohort.cycles as f64 * event;
                }
            }
        }
        Ok(means)
    }

    /// The laser cycles of an exposure by what they have in common; `None` where no window opens.
    fn cohorts(
        &self,
        stream: &StreamConfig,
        start: u16,
        light: &PixelLight,
    ) -> Result<Option<Cohorts>, EngineError> {
        let bins = self.config.bins;
        follows(self.config, &self.law.timing().pulses)?;
        let Opening { window, from_fs } = self.opening(start);
        let window = match window {
            window_law::Window::Open(window) => window,
            window_law::Window::Never => return Ok(None),
            window_law::Window::Irregular(why) => return Err(EngineError::Irregular(why)),
            window_law::Window::Race(why) => return Err(EngineError::Race(why)),
        };
        let period_fs = 1e15 / stream.clock.as_hz();
        let dead_fs = stream.spads.dead_time.as_fs() as f64;
        let refusals = [
            (dead_fs < period_fs, "a dead time shorter than a CLK period"),
            (stream.spads.has_secondaries(), "afterpulses and crosstalk"),
            (stream.pulse_shape.is_some(), "a measured laser pulse"),
        ];
        if let Some((_, what)) = refusals.into_iter().find(|(refuses, _)| *refuses) {
            return Err(EngineError::NotInCohorts(what));
        }
        let dead_steps = dead_fs / period_fs * self.options.sub_bins as f64;
        let light = SpadLight::new(stream, light);
        let scene = Scene {
            light,
            busy: absorbed(light.background(dead_fs)),
            blindness: Blindness::new(stream.spads.law, dead_steps),
            step_fs: period_fs / self.options.sub_bins as f64,
            dead_fs,
            from_fs,
            cycle_fs: period_fs * f64::from(stream.stop_periods),
        };
        let cycles = i64::from(self.exposure.laser_cycles);
        let between_fs = scene.cycle_fs - bins as f64 * period_fs;
        let memory = scene.remembers(between_fs) * SPADS as f64 * cycles as f64;
        if cycles > 1 && memory > self.options.memory {
            return Err(EngineError::Memory(memory));
        }

        // A conventional cycle is latched by the STOP edge that ends it; the exposure's first one ends one, too.
        let first_cycle = match self.config.mode {
            Mode::Guided => 0,
            Mode::Conventional => -1,
        };
        let settled = |cycle: i64| {
            let since_fs = cycle as f64 * scene.cycle_fs + scene.from_fs;
            scene.remembers(since_fs) * SPADS as f64 <= self.options.memory
        };
        let early = (first_cycle..cycles)
            .take_while(|&cycle| !settled(cycle))
            .map(|cycle| {
                let dark_until_fs = -(cycle as f64) * scene.cycle_fs;
                // The pipeline starts empty: nothing before rising edge -1 was ever compared.
                let first_edge = cycle * i64::from(self.exposure.stop_periods) + window.first_edge;
                LikeCycles {
                    cycles: 1,
                    ages: scene.rested_start(dark_until_fs),
                    steps: self.steps(&scene, dark_until_fs),
                    not_compared: (-1 - first_edge).clamp(0, bins as i64) as usize,
                }
            });
        let early: Vec<LikeCycles> = early.collect();
        let settled = LikeCycles {
            cycles: (cycles - first_cycle) as u64 - early.len() as u64,
            ages: scene.steady_start(),
            steps: self.steps(&scene, f64::NEG_INFINITY),
            not_compared: 0,
        };
        Ok(Some(Cohorts {
            blindness: scene.blindness,
            early,
            settled,
        }))
    }

    fn steps(&self, scene: &Scene, dark_until_fs: f64) -> Steps {
        let per_period = self.options.sub_bins;
        let count = self.config.bins * per_period;
        Steps {
            means: scene
                .light
                .steps(scene.from_fs, scene.step_fs, count, dark_until_fs),
            per_period,
        }
    }
}

impl Engine for Cohort<'_> {
    fn law(&self) -> WindowLaw {
        self.law.clone()
    }

    fn histogram(&self, _: u16, _: &[SpadEvent]) -> Result<Vec<u16>, EngineError> {
        Err(EngineError::NoPhotons("cohort"))
    }

    fn expose(&self, stream: &PhotonStream, pixels: &[LitPixel]) -> Result<Exposed, EngineError> {
        let dark = PixelLight {
            signal_per_cycle: 0.0,
            arrival: crate::units::Time::ZERO,
            background_hz: 0.0,
        };
        let config = stream.config();
        let mut exposed = Exposed::default();
        for pixel in pixels {
            let light = pixel.light.unwrap_or(dark);
            let counts = self.draw(config, pixel.number, pixel.start, &light)?;
            exposed.histograms.push(counts);
            let closed = self.opening(pixel.start).window.open().is_none();
            let periods = u64::from(config.stop_periods) * u64::from(config.laser_cycles);
            exposed.work += Work {
                macropixels: 1,
                skipped_closed: u64::from(closed),
                clk_periods: periods,
                clk_periods_visited: if closed { 0 } else { self.config.bins as u64 },
                ..Work::default()
            };
        }
        Ok(exposed)
    }
}

/// A macropixel's laser cycles.
struct Cohorts {
    blindness: Blindness,
    /// Those that may remember the first STOP edge, one by one.
    early: Vec<LikeCycles>,
    settled: LikeCycles,
}

impl Cohorts {
    fn iter(&self) -> impl Iterator<Item = &LikeCycles> {
        self.early.iter().chain([&self.settled])
    }
}

/// Laser cycles with the same light and the same state at the start of the window.
struct LikeCycles {
    cycles: u64,
    ages: Ages,
    steps: Steps,
    /// First bins that the pipeline has not reached yet.
    not_compared: usize,
}

/// Light and dead time around one macropixel's window. Times in femtoseconds from its laser cycle's STOP edge.
struct Scene {
    light: SpadLight,
    blindness: Blindness,
    step_fs: f64,
    dead_fs: f64,
    from_fs: f64,
    cycle_fs: f64,
    /// Probability of a background photon on a SPAD within a dead time.
    busy: f64,
}

impl Scene {
    /// Bound on the probability that a SPAD has no dead time's length without photons in `duration_fs`, one echo in it
    /// included: that it cannot be told whether it has recovered.
    fn remembers(&self, duration_fs: f64) -> f64 {
        let echo = self.light.echo(0.0);
        let (echo_fs, cuts) = echo.map_or((0.0, 0.0), |echo| (echo.end - echo.start, 1.0));
        let stretches = ((duration_fs - echo_fs) / self.dead_fs - cuts).floor();
        self.busy.powi(stretches.clamp(0.0, 1e9) as i32)
    }

    /// The state at the start of the window in a settled laser cycle.
    fn steady_start(&self) -> Ages {
        let background = self.light.background(self.step_fs);
        let steady = Ages::steady(&self.blindness, background);
        let is_remembered = |echo: &Range<f64>| {
            let stretches = ((self.from_fs - echo.end) / self.dead_fs).clamp(0.0, 1e9);
            self.busy.powi(stretches as i32) > FORGOTTEN
        };
        let own_cycle = (self.from_fs / self.cycle_fs).floor();
        let echoes = [own_cycle - 1.0, own_cycle].map(|cycle| self.light.echo(cycle));
        let earliest = echoes
            .into_iter()
            .flatten()
            .filter(|echo| echo.start < self.from_fs && is_remembered(echo))
            .map(|echo| echo.start)
            .reduce(f64::min);
        match earliest {
            Some(since) => self.carried(steady, since, f64::NEG_INFINITY),
            None => steady,
        }
    }

    /// The state at the start of a window after rest until `since_fs`.
    fn rested_start(&self, since_fs: f64) -> Ages {
        self.carried(Ages::rested(&self.blindness), since_fs, since_fs)
    }

    /// The state at the start of the window, when it was `ages` at `since_fs`.
    fn carried(&self, mut ages: Ages, since_fs: f64, dark_until_fs: f64) -> Ages {
        let count = ((self.from_fs - since_fs) / self.step_fs).ceil().max(0.0);
        let from_fs = self.from_fs - count * self.step_fs;
        for mean in self
            .light
            .steps(from_fs, self.step_fs, count as usize, dark_until_fs)
        {
            ages.step(&self.blindness, mean);
        }
        ages
    }
}
