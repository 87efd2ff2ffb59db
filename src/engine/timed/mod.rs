//! The fast engines with the timing of each macropixel: gate-accurate histograms where every macropixel has delays of its own.
//!
//! ```text
//!   silicon ─► delays ─► orders ─┬ decided ─► pulses shifted by each SPAD's latency ─► Window or Cycle ─┐
//!   (corner, factor, mismatch)   └ in doubt ─► Gate, with exactly these delays ─────────────────────────┴► histograms
//! ```
//!
//! The gate engine's flip-flops take what is there: a histogram depends on delays only through the order in which events
//! arrive. Static timing of a macropixel's own netlist bounds every arrival ([`MacropixelDelays`]); where the bounds decide every
//! order that counts ([`orders`]), [`WindowLaw`] with its own delays says which CLK edges its bins see, each by itself where
//! they differ. Only macropixels with an order in doubt are simulated. Histograms are those of
//! [`Gate::histograms_with`], bit for bit.

mod orders;

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::{
    Cancelling, Cycle, Engine, EngineError, Gate, Histograms, LaneSimulation, Replay, Window,
};
use crate::bench::StimulusPlan;
use crate::chip::timing::macropixel::{CounterDelays, MacropixelCircuit, MacropixelDelays};
use crate::chip::{ChipTiming, Exposure, Mode, PCounter, SensorConfig, Silicon, WindowLaw, sensor};
use crate::kernel::LANES;
use crate::netlist::Timing;
use crate::photon::SpadEvent;
use orders::{Delays, Doubt, Orders, Part, Setting};

/// What runs the macropixels whose orders are decided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Runner {
    /// The levelised netlist where windows lie as the library has them, and the window law elsewhere.
    Cycle,
    /// The window law.
    Window,
}

/// How many macropixels were decided in closed form, and why the others were simulated.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct ClosedFormCoverage {
    /// Macropixels whose every order of events was decided in closed form.
    #[serde(rename = "kept")]
    pub decided: usize,
    /// Macropixels replayed at gate level, by what was in doubt.
    pub replayed: BTreeMap<&'static str, usize>,
}

/// Histograms, and how they came about.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TimedHistograms {
    /// Counts of every macropixel and bin, row-major, bin 0 earliest.
    pub histograms: Histograms,
    /// Which macropixels were simulated.
    pub coverage: ClosedFormCoverage,
}

/// Runs an array of macropixels made of one silicon.
pub struct Timed<'a> {
    setting: Setting<'a>,
    silicon: Silicon,
    circuit: MacropixelCircuit,
    /// Path of each cell before and, where the macropixel is in it, after its name.
    paths: Vec<(String, Option<String>)>,
    /// Without mismatch all macropixels are alike.
    alike: Option<(Timing, Orders)>,
}

/// What a look at a macropixel's delays leads to.
enum Judged {
    Counted(Vec<u16>),
    ForCycle(Vec<SpadEvent>),
    InDoubt(Doubt),
}

impl<'a> Timed<'a> {
    /// An engine for this sensor and exposure; `silicon` says what its macropixels are made of.
    pub fn new(config: &'a SensorConfig, exposure: &'a Exposure, silicon: &Silicon) -> Self {
        // Macropixels differ in the names of their cells only.
        let circuit = MacropixelCircuit::new(config, (0, 0));
        let name = circuit.probes.macropixel();
        let paths = (0..circuit.netlist.cells().len()).map(|cell| {
            let path = circuit.netlist.cell_path(cell);
            match path.split_once(name) {
                Some((before, after)) => (before.to_owned(), Some(after.to_owned())),
                None => (path, None),
            }
        });
        let mut engine = Timed {
            paths: paths.collect(),
            circuit,
            setting: Setting {
                config,
                exposure,
                nominal: ChipTiming::of(config),
                schedule: StimulusPlan::new(config, exposure, 1, &[0], &[&[]]).schedule(),
            },
            silicon: *silicon,
            alike: None,
        };
        if silicon.mismatch.is_none() {
            let timing = silicon.timing(&engine.circuit.netlist);
            let orders = engine.orders(&timing);
            engine.alike = Some((timing, orders));
        }
        engine
    }

    /// Histograms of the whole array, row-major. `done` is told of macropixels as they are finished.
    ///
    /// # Errors
    /// When a bit of a count is unknown.
    ///
    /// # Panics
    /// When there is not one start value and one list of pulses for every macropixel.
    pub fn histograms(
        &self,
        runner: Runner,
        starts: &[u16],
        pulses: &[&[SpadEvent]],
        done: impl Fn(usize) + Sync,
    ) -> Result<TimedHistograms, EngineError> {
        let pixels = self.setting.config.pixels();
        assert!(starts.len() == pixels && pulses.len() == pixels);
        let cycle = Cycle::new(self.setting.config, self.setting.exposure);
        let is_levelled = runner == Runner::Cycle && cycle.unlevelled().is_none();
        let common = WindowLaw::new(self.setting.config, self.setting.exposure);
        let corrupted = self.corrupted_starts(starts);
        let judge = |pixel: usize| {
            let (start, pulses) = (starts[pixel], pulses[pixel]);
            if corrupted.contains(&start) {
                return Ok(Judged::InDoubt("the load leaves another start value"));
            }
            let timing = self.timing(pixel);
            let orders = self.orders_of(&timing);
            let parts = match orders.parts(&self.setting, start) {
                Ok(parts) => parts,
                Err(doubt) => return Ok(Judged::InDoubt(doubt)),
            };
            let window = common.window(start).open();
            let is_common = |part: &Part| part.first_edge == window.map(|w| w.first_edge);
            if is_levelled && window.is_some() && parts.iter().all(is_common) {
                return Ok(Judged::ForCycle(orders.shifted(&common, pulses)));
            }
            Ok(Judged::Counted(
                self.by_laws(&orders, parts, start, pulses)?,
            ))
        };
        let judged: Result<Vec<Judged>, EngineError> = (0..pixels)
            .into_par_iter()
            .map(|pixel| {
                let judged = judge(pixel)?;
                done(usize::from(matches!(judged, Judged::Counted(_))));
                Ok(judged)
            })
            .collect();
        let mut judged = judged?;
        self.run_cycle(&cycle, starts, &mut judged, &done)?;
        self.finish(starts, pulses, judged, &done)
    }

    /// How many of the array's pulses cancel, two to a pair: each macropixel's flip-flops have delays of their own.
    ///
    /// # Panics
    /// When there is not one list of pulses for every macropixel.
    pub fn cancelled(&self, pulses: &[&[SpadEvent]]) -> u64 {
        let Setting {
            config, exposure, ..
        } = self.setting;
        assert!(pulses.len() == config.pixels());
        let law = || WindowLaw::new(config, exposure);
        let Some(cancelling) = Cancelling::of(config.dead_time(), exposure.clock, law) else {
            return 0;
        };
        let of_pixel = |(pixel, pulses): (usize, &&[SpadEvent])| {
            let orders = self.orders_of(&self.timing(pixel)).into_owned();
            let shifted = orders.shifted(cancelling.law(), pulses);
            2 * cancelling.pairs(&shifted).count() as u64
        };
        pulses.par_iter().enumerate().map(of_pixel).sum()
    }

    /// Histograms of the whole array, every macropixel at gate level with its own delays.
    ///
    /// # Errors
    /// As [`Timed::histograms`].
    ///
    /// # Panics
    /// As [`Timed::histograms`].
    pub fn by_gates(
        &self,
        starts: &[u16],
        pulses: &[&[SpadEvent]],
        done: impl Fn(usize) + Sync,
    ) -> Result<Histograms, EngineError> {
        assert!(starts.len() == self.setting.config.pixels() && pulses.len() == starts.len());
        let all: Vec<usize> = (0..starts.len()).collect();
        self.replay(&all, starts, pulses, &done)
    }

    /// Counts of one macropixel whose bins follow these laws.
    fn by_laws(
        &self,
        orders: &Orders,
        parts: Vec<Part>,
        start: u16,
        pulses: &[SpadEvent],
    ) -> Result<Vec<u16>, EngineError> {
        let mut counts = vec![0; self.setting.config.bins];
        for Part { law, bins, .. } in parts {
            let pulses = orders.shifted(&law, pulses);
            let engine = Window::with_law(self.setting.config, self.setting.exposure, law);
            let histogram = engine.histogram(start, &pulses)?;
            for bin in bins {
                counts[bin] = histogram[bin];
            }
        }
        Ok(counts)
    }

    /// Counts the macropixels that were left to the cycle engine.
    fn run_cycle(
        &self,
        cycle: &Cycle<'_>,
        starts: &[u16],
        judged: &mut [Judged],
        done: &impl Fn(usize),
    ) -> Result<(), EngineError> {
        let mut numbers = Vec::new();
        let mut pulses = Vec::new();
        for (pixel, judged) in judged.iter_mut().enumerate() {
            if let Judged::ForCycle(shifted) = judged {
                numbers.push(pixel);
                pulses.push(std::mem::take(shifted));
            }
        }
        let starts: Vec<u16> = numbers.iter().map(|&pixel| starts[pixel]).collect();
        let pulses: Vec<&[SpadEvent]> = pulses.iter().map(Vec::as_slice).collect();
        for ((numbers, starts), pulses) in numbers
            .chunks(cycle.batch())
            .zip(starts.chunks(cycle.batch()))
            .zip(pulses.chunks(cycle.batch()))
        {
            let counts = cycle.histograms(starts, pulses)?;
            for (&pixel, counts) in numbers.iter().zip(&counts) {
                judged[pixel] = Judged::Counted(counts.to_vec());
            }
            done(numbers.len());
        }
        Ok(())
    }

    /// Replays what is in doubt.
    fn finish(
        &self,
        starts: &[u16],
        pulses: &[&[SpadEvent]],
        judged: Vec<Judged>,
        done: &(impl Fn(usize) + Sync),
    ) -> Result<TimedHistograms, EngineError> {
        let bins = self.setting.config.bins;
        let mut found = TimedHistograms {
            histograms: Histograms::empty(starts.len(), bins),
            coverage: ClosedFormCoverage::default(),
        };
        let mut in_doubt = Vec::new();
        for (pixel, judged) in judged.into_iter().enumerate() {
            match judged {
                Judged::Counted(counts) => {
                    found.coverage.decided += 1;
                    found.histograms[pixel].copy_from_slice(&counts);
                }
                Judged::InDoubt(doubt) => {
                    *found.coverage.replayed.entry(doubt).or_default() += 1;
                    in_doubt.push(pixel);
                }
                Judged::ForCycle(_) => unreachable!("the cycle engine has run"),
            }
        }
        let replayed = self.replay(&in_doubt, starts, pulses, done)?;
        for (pixel, counts) in in_doubt.into_iter().zip(&replayed) {
            found.histograms[pixel].copy_from_slice(counts);
        }
        Ok(found)
    }

    /// Macropixels at gate level, each with its own delays.
    fn replay(
        &self,
        numbers: &[usize],
        starts: &[u16],
        pulses: &[&[SpadEvent]],
        done: &(impl Fn(usize) + Sync),
    ) -> Result<Histograms, EngineError> {
        let gate = Gate::new(self.setting.config, self.setting.exposure);
        // Those that are alike share an event queue.
        let together = if self.alike.is_some() { LANES } else { 1 };
        let batches: Result<Vec<Histograms>, EngineError> = numbers
            .par_chunks(together)
            .map(|numbers| {
                let timing = self.timing(numbers[0]);
                let timings = vec![&*timing; numbers.len()];
                let starts: Vec<u16> = numbers.iter().map(|&pixel| starts[pixel]).collect();
                let pulses: Vec<&[SpadEvent]> =
                    numbers.iter().map(|&pixel| pulses[pixel]).collect();
                let histograms = gate.histograms_with(&timings, &starts, &pulses);
                done(numbers.len());
                histograms.map_err(|error| self.named(numbers, error))
            })
            .collect();
        Ok(Histograms::joined(self.setting.config.bins, batches?))
    }

    /// An error of one macropixel alone, with its name in the array.
    fn named(&self, numbers: &[usize], error: EngineError) -> EngineError {
        let cols = self.setting.config.cols;
        match (numbers, error) {
            (&[pixel], EngineError::Unknown { bin, .. }) => EngineError::Unknown {
                macropixel: sensor::pixel_name(pixel / cols, pixel % cols),
                bin,
            },
            (_, error) => error,
        }
    }

    /// Start values that the load does not bring into the P-counters. Its delays are the same for every macropixel.
    fn corrupted_starts(&self, starts: &[u16]) -> BTreeSet<u16> {
        let Setting {
            config,
            exposure,
            schedule,
            ..
        } = self.setting;
        let mut corrupted = BTreeSet::new();
        if config.mode == Mode::Conventional || config.p_counter == PCounter::Memoryless {
            return corrupted;
        }
        let timing = self.timing(0);
        let distinct: Vec<u16> = starts
            .iter()
            .copied()
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect();
        for starts in distinct.chunks(LANES) {
            let dark: Vec<&[SpadEvent]> = vec![&[]; starts.len()];
            let lanes = LaneSimulation::new(config, exposure, starts, &dark);
            let mut lanes = lanes.with_timing(&timing);
            lanes.run_until(schedule.origin - exposure.clock.period(), &mut ());
            let loaded = starts.iter().zip(lanes.loaded());
            corrupted.extend(
                loaded
                    .filter(|&(&start, found)| found != Some(start))
                    .map(|(s, _)| *s),
            );
        }
        corrupted
    }

    /// Delays of a macropixel, whose cells are known by its place in the array.
    fn timing(&self, pixel: usize) -> Cow<'_, Timing> {
        if let Some((timing, _)) = &self.alike {
            return Cow::Borrowed(timing);
        }
        let cols = self.setting.config.cols;
        let name = sensor::pixel_name(pixel / cols, pixel % cols);
        let path = |cell: usize| match &self.paths[cell] {
            (path, None) => path.clone(),
            (before, Some(after)) => [before, name.as_str(), after].concat(),
        };
        Cow::Owned(self.silicon.timing_as(&self.circuit.netlist, path))
    }

    fn orders(&self, timing: &Timing) -> Orders {
        let paths = self.circuit.paths(timing);
        let macropixel = MacropixelDelays::of(&paths);
        let is_guided = self.setting.config.mode == Mode::Guided;
        let counter = is_guided.then(|| CounterDelays::of(&paths, &macropixel));
        let delays = Delays {
            macropixel,
            counter,
        };
        Orders::new(&self.setting, &delays)
    }

    fn orders_of(&self, timing: &Timing) -> Cow<'_, Orders> {
        match &self.alike {
            Some((_, orders)) => Cow::Borrowed(orders),
            None => Cow::Owned(self.orders(timing)),
        }
    }
}
