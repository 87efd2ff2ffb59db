//! The cohort engine: histograms without photons, at a cost that does not grow with the laser cycles.
//!
//! Laser cycles whose SPADs are in the same state move together: a binomial draw says how many of them see what in the
//! next step. Three ways of keeping that state share one model of light and dead time:
//!
//! | way | state | exact | cost of a bin |
//! |---|---|---|---|
//! | `pooled.rs` | how many SPADs fired 1, 2, … steps ago | every bin; two bins' correlation up to [`CohortOptions::neglect`] | a few draws |
//! | `recent.rs` | in how many cycles which of the last 4, 6 or 8 bins had an event | every bin; two bins' correlation up to [`CohortOptions::neglect`] | 16, 64 or 256 draws, most of them of nothing |
//! | `joint.rs` | how many cycles have which of these on one macropixel | all of it | a draw for every state that occurs |
//!
//! What they share, and what it costs in exactness:
//!
//! * **Dead time** (`fine.rs`): cohorts move in steps of a CLK period. How able a SPAD is to fire in one, by the step
//!   of its last avalanche, is computed from the light on cells that are halved until the mean of every bin is known
//!   to within [`CohortOptions::error`] of its counting noise, and refused where 256 cells to a CLK period do not do.
//!   In little light it is as in even light, which a bound shows first (`is_even_enough`). So means and each two
//!   successive pulses of a SPAD have their probabilities; how three in successive dead times depend on each other
//!   within a period is left out.
//! * **Start.** A window begins with every SPAD in the state that the light before it leaves behind: the steady state
//!   of the background, carried through an echo where one comes before the window. It is a
//!   probability for each age of one SPAD, computed, not drawn.
//! * **Memory.** Laser cycles are taken to be independent (`cycles.rs`). They are unless a SPAD stays busy from one window
//!   to the next; the probability of that, over all SPADs and cycles, is bounded, and beyond [`CohortOptions::memory`]
//!   the engine refuses.
//! * **Afterpulses and crosstalk** enter the light as probabilities of one SPAD among its neighbours (`fine.rs`): means are
//!   kept, but how an afterpulse follows its own pulse is remembered for a dead time only, so that the variance of a macropixel's counts is
//!   small by up to [`variance_left_out`] (8.7 % with 5 % of afterpulses), which `frame` says in its table. Crosstalk,
//!   which blinds a SPAD of a cycle that has its event already, hits any SPAD. So crosstalk is refused where an event
//!   takes several SPADs, as both are for paralysable SPADs.
//! * A SPAD is to fire at most once in a bin: a shorter dead time is refused. So are measured laser pulses, and SPADs that
//!   differ.
//! * Bins of delay lines are the steps, unequal as they are; what is before a window is remembered in steps as long as the shortest
//!   bin. An odd number of SPADs counts in them; light in which pulses meet on the photon line is refused (`events.rs`).
//!
//! So an exposure takes one step a bin, whatever light there is. Where two bins' correlations may be neglected as much as the ways
//! before it leave out, the first way in the table that does so is taken; only events of several SPADs, dead times of many bins
//! and the brightest light are left to the joint state, which has at most as many states as there are laser cycles.

mod abreast;
mod blindness;
mod cycles;
mod draw;
mod events;
mod fine;
mod grid;
mod hits;
mod joint;
mod kept;
#[cfg(test)]
mod one_by_one;
mod overlap;
mod pooled;
mod prepare;
mod recent;
mod rejection;
mod secondaries;
mod spad_light;
mod weighted;
mod words;

use std::borrow::Cow;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use smallvec::{SmallVec, smallvec};

use self::blindness::Ages;
pub use self::blindness::BlindSpad;
use self::cycles::LikeCycles;
pub use self::draw::none_of;
use self::events::EventTable;
pub use self::hits::at_least_hit;
use self::kept::{KeptCohorts, LikeCyclesMethod, WindowCycles};
use self::recent::Histories;
pub use self::secondaries::variance_left_out;
use self::words::RandomWords;
use super::{Engine, EngineError, EngineWork, Expose, ExposureResult, LitPixel};
use crate::chip::{Exposure, Sensor, WindowLaw, histogram, window_law};
use crate::photon::{PhotonStream, PixelLight, StreamConfig};

/// Dead times before a window from which on another laser's pulses are followed: what came before them has blinded its SPADs only by way
/// of four others.
const REMEMBERED: i64 = 4;

/// SPADs that are worth following one by one in a CLK period before [`joint`] is the cheaper way.
const WORTH_LOOKING_AT: f64 = 200.0;

/// Draws histograms from their distribution.
#[derive(Clone)]
pub struct Cohort {
    sensor: Sensor,
    law: WindowLaw,
    /// What the law says of each start value, once it has been asked.
    windows: Vec<OnceLock<Opening>>,
    options: CohortOptions,
    /// Photons on a SPAD in a CLK period up to which cycles may be pooled.
    most_photons: f64,
    is_event: EventTable,
    /// Whether the law is that of one macropixel, where each has its own.
    is_of_macropixel: bool,
    /// What was prepared of macropixels, from the first exposure on, if anything is to be kept.
    kept: Option<Arc<OnceLock<KeptCohorts>>>,
}

/// How the state of laser cycles alike is kept.
enum StateMethod {
    Pooled,
    Recent(Histories),
    Joint,
}

/// A start value's window, and the beginning of the photon times it collects, in femtoseconds after STOP.
#[derive(Debug, Clone, Copy)]
struct Opening {
    window: window_law::WindowOutcome,
    from_fs: f64,
}

impl Cohort {
    /// An engine for this sensor and exposure.
    pub fn new(sensor: impl Into<Sensor>, exposure: &Exposure, options: CohortOptions) -> Self {
        Self::with_law(WindowLaw::new(sensor, exposure), options)
    }

    /// An engine for macropixels with a law of their own.
    pub fn with_law(law: WindowLaw, options: CohortOptions) -> Self {
        let sensor = law.sensor().clone();
        let is_event = EventTable::from_sensor(&sensor);
        Cohort {
            law,
            windows: vec![OnceLock::new(); usize::from(sensor.largest_start()) + 1],
            options,
            most_photons: pooled::most_photons(options.neglect),
            is_event,
            sensor,
            is_of_macropixel: false,
            kept: None,
        }
    }

    /// The same engine for exposures that differ in their seed: what it computes of a macropixel's start value and light is kept, up to 64 MB.
    #[must_use]
    pub fn keeping(mut self) -> Self {
        // With laws of their own macropixels have engines of their own.
        self.kept = (!self.sensor.has_own_laws()).then(Arc::default);
        self
    }

    /// This engine with the law of a macropixel, where each has its own: what [`Cohort::expected`] and
    /// [`Cohort::cohorts_in_steps`] are asked of there.
    pub fn of_macropixel(&self, number: u32) -> Cow<'_, Self> {
        if self.sensor.has_own_laws() && !self.is_of_macropixel {
            Cow::Owned(Cohort {
                is_of_macropixel: true,
                ..Self::with_law(self.law.of_macropixel(number), self.options)
            })
        } else {
            Cow::Borrowed(self)
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

    /// When another laser's pulses matter to the window of a start value, fs after the start of the laser cycle: from [`REMEMBERED`] dead times before
    /// it on.
    fn sight_fs(&self, stream: &StreamConfig, start: u16) -> Range<i64> {
        let window = self.opening(start).window.open();
        window.map_or(0..0, |window| {
            let seen = self.law.interval(&window);
            // Macropixels' own laws differ by less than a CLK period.
            let room = stream.clock.period();
            let before = room + stream.spads.dead_time * REMEMBERED;
            (seen.start - before).as_fs()..(seen.end + room).as_fs()
        })
    }

    /// A histogram of macropixel `pixel` under `light`, bin 0 earliest: a pure function of the stream's seed and
    /// everything given.
    ///
    /// # Errors
    /// Races of the window law, a dead time below a CLK period, laser cycles that depend on each other, and light in which
    /// [`CohortOptions::error`] cannot be kept.
    pub fn draw(
        &self,
        stream: &StreamConfig,
        pixel: u32,
        start: u16,
        light: &PixelLight,
    ) -> Result<Vec<u16>, EngineError> {
        let sums = self.sums(stream, pixel, start, light)?;
        Ok(histogram::counts(&self.sensor, sums))
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
        let prepared = self.of_macropixel(pixel).prepared(stream, start, light)?;
        Ok(self.sums_of(&prepared, stream.seed, pixel))
    }

    /// What the laser cycles of a window are made of.
    fn prepared(
        &self,
        stream: &StreamConfig,
        start: u16,
        light: &PixelLight,
    ) -> Result<WindowCycles, EngineError> {
        let ready = |like: LikeCycles| LikeCyclesMethod {
            way: self.way(&like),
            like,
        };
        let cohorts = self.cohorts(stream, start, light)?;
        Ok(cohorts.map(|cohorts| cohorts.into_iter().map(ready).collect()))
    }

    /// Draws the counts of a macropixel.
    fn sums_of(&self, prepared: &WindowCycles, seed: u64, pixel: u32) -> Counts {
        let mut sums: Counts = smallvec![0; self.sensor.bins];
        let random = &mut RandomWords::new(seed, pixel);
        let is_event = &self.is_event;
        for LikeCyclesMethod { like, way } in prepared.iter().flatten() {
            let counts = match way {
                StateMethod::Pooled => pooled::draw_counts(like, is_event, random),
                StateMethod::Recent(histories) => histories.draw_counts(like.cycles, random),
                StateMethod::Joint => joint::draw_counts(like, is_event, random),
            };
            let compared = sums.iter_mut().zip(counts).skip(like.not_compared);
            compared.for_each(|(sum, count)| *sum += count);
        }
        sums
    }

    /// The cheapest way that neglects no more than it may.
    fn way(&self, like: &LikeCycles) -> StateMethod {
        let photons = pooled::largest(&like.means);
        let spads = self.is_event.spads() as u64 * like.cycles;
        if photons <= self.most_photons
            && pooled::looked_at(&like.blindness, photons, spads) <= WORTH_LOOKING_AT
        {
            return StateMethod::Pooled;
        }
        recent::histories(like, &self.is_event, self.options.neglect)
            .map_or(StateMethod::Joint, StateMethod::Recent)
    }

    /// Cohorts that [`Cohort::draw`] follows, summed over the steps of the window: what its time goes with, estimated.
    ///
    /// # Errors
    /// As [`Cohort::draw`].
    pub fn cohorts_in_steps(
        &self,
        stream: &StreamConfig,
        start: u16,
        light: &PixelLight,
    ) -> Result<f64, EngineError> {
        let steps = |like: LikeCycles| match self.way(&like) {
            StateMethod::Pooled => like.means.len() as f64,
            StateMethod::Recent(histories) => of_histories(histories.number()),
            StateMethod::Joint => of_joint_states(&like, self.is_event.spads()),
        };
        let cohorts = self.cohorts(stream, start, light)?.unwrap_or_default();
        Ok(cohorts.into_iter().map(steps).sum())
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
        let mut sums = vec![0.0; self.sensor.bins];
        let Some(cohorts) = self.cohorts(stream, start, light)? else {
            return Ok(sums);
        };
        for like in &cohorts {
            let mut ages = like.ages.clone();
            for ((bin, &mean), sum) in like.means.iter().enumerate().zip(&mut sums) {
                let pulse = ages.pulse(&like.blindness, bin, mean);
                ages.step(&like.blindness, bin, mean);
                if bin >= like.not_compared {
                    let [event, _] = fine::event(&self.is_event, pulse);
                    *sum += like.cycles as f64 * event;
                }
            }
        }
        Ok(sums)
    }
}

impl Engine for Cohort {
    fn law(&self) -> WindowLaw {
        self.law.clone()
    }
}

impl Expose for Cohort {
    fn expose(
        &self,
        stream: &PhotonStream,
        pixels: &[LitPixel],
    ) -> Result<ExposureResult, EngineError> {
        let dark = PixelLight::dark();
        let config = stream.config();
        let mut exposed = ExposureResult::new(self.sensor.bins);
        let begun = || KeptCohorts::new(config, self.sensor.pixels());
        let kept = self.kept.as_ref().map(|kept| kept.get_or_init(begun));
        let kept = kept.filter(|kept| kept.is_of(config));
        for pixel in pixels {
            let light = pixel.light.as_ref().unwrap_or(&dark);
            let light = if light.has_trains() {
                &stream.with_trains_as_echoes(light, self.sight_fs(config, pixel.start))
            } else {
                light
            };
            let sums = match kept {
                Some(kept) => {
                    let prepared = kept.prepared(self, pixel.number, pixel.start, light)?;
                    self.sums_of(&prepared, config.seed, pixel.number)
                }
                None => self.sums(config, pixel.number, pixel.start, light)?,
            };
            let counts = histogram::counts(&self.sensor, sums);
            exposed.histograms.push(&counts);
            let closed = self.opening(pixel.start).window.open().is_none();
            let periods = u64::from(config.stop_periods) * u64::from(config.laser_cycles);
            exposed.work += EngineWork {
                macropixels: 1,
                skipped_closed: u64::from(closed),
                clk_periods: periods,
                clk_periods_visited: if closed { 0 } else { self.sensor.bins as u64 },
                ..EngineWork::default()
            };
        }
        Ok(exposed)
    }
}

/// Steps of a window that need no memory of their own.
const FEW_STEPS: usize = 16;

/// Laser cycles with an event, for every bin of a window.
type Counts = SmallVec<[u64; FEW_STEPS]>;

/// Mean photons on one SPAD in every bin of a window.
type Means = SmallVec<[f64; FEW_STEPS]>;

/// The engine's knobs: what may be left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CohortOptions {
    /// Largest error of a bin's mean, in standard deviations of its count over the exposure.
    pub error: f64,
    /// Largest correlation between two bins that may be neglected to save time; 0 never neglects any.
    pub neglect: f64,
    /// Largest probability, for a whole exposure of a macropixel, that laser cycles depend on each other.
    pub memory: f64,
}

impl Default for CohortOptions {
    fn default() -> Self {
        CohortOptions {
            error: 0.1,
            neglect: 1e-4,
            memory: 1e-6,
        }
    }
}

// How many cohorts a macropixel's window takes, without drawing any. The engine's time follows that number.
//
// Where laser cycles are pooled there is one cohort a step. Elsewhere there are as many as states that laser cycles are in:
// how many SPADs fired 1, 2, … steps ago. Of N cycles nearly all are within √(2 ln N) standard deviations of a state's
// mean along each age, and no more states are occupied than there are cycles. A history of events costs a part of that.

/// Which part of √(2 ln N) standard deviations counts: with it the estimate is within a factor of two of the states that N
/// cycles are in, from a few of them to thousands, and of three with 4 or 64 SPADs (the test below).
const OCCUPIED: f64 = 0.9;

/// States that `cycles` laser cycles are expected to be in, each of whose `spads` are in the state `ages` with these probabilities.
fn occupied_states(ages: &Ages, spads: usize, cycles: u64) -> f64 {
    let cycles = cycles as f64;
    let reach = OCCUPIED * (2.0 * libm::log(cycles)).sqrt();
    let deviation = |share: f64| (spads as f64 * share * (1.0 - share).max(0.0)).sqrt();
    let states: f64 = ages
        .aged
        .iter()
        .map(|&share| 1.0 + reach * deviation(share))
        .product();
    // Not more than there are ways to spread SPADs over ages.
    let ways =
        (1..=ages.aged.len()).fold(1.0, |ways, age| ways * (spads + age) as f64 / age as f64);
    let states = states.min(ways);
    states * cycles / (states + cycles)
}

/// What a history in a bin takes, its chances and how many laser cycles it has, in cohorts.
const HISTORY: f64 = 0.02;

/// The effort of `number` histories, in cohorts, summed over the bins of a window.
fn of_histories(number: usize) -> f64 {
    HISTORY * number as f64
}

/// Cohorts of laser cycles alike, summed over the steps of a window.
fn of_joint_states(like: &LikeCycles, spads: usize) -> f64 {
    let mut ages = like.ages.clone();
    let steps = like.means.iter().enumerate();
    steps
        .map(|(step, &mean)| {
            ages.step(&like.blindness, step, mean);
            occupied_states(&ages, spads, like.cycles)
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::engine::cohort::blindness::Blindness;
    use crate::photon::DeadTimeLaw;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]
        #[test]
        fn the_estimate_is_near_the_states_that_drawn_cycles_are_in(
            dead_time in 1.0f64..4.0,
            mean in 0.005f64..1.0,
            cycles in 100u64..4_000,
            spads in prop_oneof![Just(4usize), Just(16), Just(64)],
            seed in any::<u64>(),
        ) {
            use rand::{RngExt, SeedableRng};
            let blindness = Blindness::new(DeadTimeLaw::NonParalysable, dead_time);
            let ages = Ages::steady(&blindness, mean);
            let mut random = rand::rngs::StdRng::seed_from_u64(seed);
            let mut states = HashSet::new();
            for _ in 0..cycles {
                let mut state = vec![0u8; ages.aged.len()];
                for _ in 0..spads {
                    let mut at = random.random::<f64>();
                    let age = ages.aged.iter().position(|share| {
                        at -= share;
                        at < 0.0
                    });
                    age.into_iter().for_each(|age| state[age] += 1);
                }
                states.insert(state);
            }
            let (drawn, estimated) = (states.len() as f64, occupied_states(&ages, spads, cycles));
            let factor = if spads == 16 { 2.0 } else { 3.0 };
            prop_assert!((1.0 / factor..factor).contains(&(estimated / drawn)), "{estimated} for {drawn}");
        }
    }
}
