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
//! [`Gate::replay_with`], bit for bit.

mod doubt;
mod orders;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard};

use rayon::prelude::*;

pub use self::doubt::Doubt;
use self::orders::{Delays, Orders, Part, Setting};
use super::error::{follows, has_no_delay_lines};
use super::traits::by_own_clk;
use super::{
    Cycle, Engine, EngineError, Expose, ExposureResult, Gate, Histograms, LaneSimulation, LitPixel,
    PulsedPixel, Replay, Window, full_stream,
};
use crate::chip::timing::macropixel::{CounterDelays, MacropixelCircuit, MacropixelDelays};
use crate::chip::{Exposure, Mode, Sensor, Silicon, Tdc, WindowLaw, array};
use crate::kernel::LANES;
use crate::netlist::Timing;
use crate::photon::{PhotonStream, SpadEvent};
use crate::stimulus::StimulusPlan;

/// What runs the macropixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Runner {
    /// Those whose orders are decided: the levelised netlist where windows lie as the library has them, and the window law
    /// elsewhere. The others: the gates.
    Cycle,
    /// Those whose orders are decided: the window law. The others: the gates.
    Window,
    /// All of them: the gates.
    Gate,
}

/// How many macropixels were decided in closed form, and why the others were simulated.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct ClosedFormCoverage {
    /// Macropixels whose every order of events was decided in closed form.
    #[serde(rename = "kept")]
    pub decided: usize,
    /// Macropixels replayed at gate level, by what was in doubt.
    pub replayed: BTreeMap<Doubt, usize>,
}

/// Runs macropixels made of one silicon.
pub struct Timed {
    setting: Setting,
    silicon: Silicon,
    /// The sensor without differences between cells: the wires of CLK, and delay lines where other cells do not differ.
    uniform: Sensor,
    runner: Runner,
    circuit: MacropixelCircuit,
    /// Without mismatch all macropixels are alike.
    alike: Option<(Timing, Orders)>,
    /// The law with the library's delays.
    common: WindowLaw,
    cycle: Cycle,
    /// Whether the load leaves each start value as it was sent, as far as it is known.
    arrives: Mutex<BTreeMap<u16, bool>>,
    coverage: Mutex<ClosedFormCoverage>,
}

/// What a look at a macropixel's delays leads to.
enum TimedOutcome {
    Counted(Vec<u16>),
    ForCycle(Vec<SpadEvent>),
    InDoubt(Doubt),
}

impl Timed {
    /// An engine for this sensor, in which each macropixel has the delays of its own silicon, and exposure.
    pub fn new(sensor: impl Into<Sensor>, exposure: &Exposure, runner: Runner) -> Self {
        let made: Sensor = sensor.into();
        let silicon = *made.silicon();
        let sensor = made.made_of(&Silicon::new(&made));
        // Macropixels differ in the names of their cells only.
        let circuit = MacropixelCircuit::new(&sensor, (0, 0));
        let mut engine = Timed {
            circuit,
            setting: Setting {
                exposure: *exposure,
                nominal: *sensor.timing(),
                schedule: StimulusPlan::new(&sensor, exposure, 1, &[0], &[&[]]).schedule,
                sensor: sensor.clone(),
            },
            silicon,
            uniform: made.made_of(&Silicon {
                mismatch: None,
                ..silicon
            }),
            runner,
            alike: None,
            common: WindowLaw::new(&sensor, exposure),
            cycle: Cycle::new(&sensor, exposure),
            arrives: Mutex::default(),
            coverage: Mutex::default(),
        };
        if silicon.mismatch.is_none() && made.tdc == Tdc::Clocked {
            let timing = silicon.timing(&engine.circuit.netlist);
            let orders = engine.orders(&timing);
            engine.alike = Some((timing, orders));
        }
        engine
    }

    /// What became of the macropixels that were replayed so far; nothing where the gates run all of them.
    pub fn coverage(&self) -> ClosedFormCoverage {
        locked(&self.coverage).clone()
    }

    /// Counts in closed form where a macropixel's delays decide every order of events.
    fn count_in_closed_form(&self, pixel: &PulsedPixel<'_>) -> Result<TimedOutcome, EngineError> {
        match self.uniform.tdc {
            Tdc::Clocked => {}
            Tdc::Counter => return Ok(TimedOutcome::InDoubt(Doubt::CounterTdc)),
            Tdc::DelayLine => return self.judge_lines(pixel),
        }
        let pulses = &*by_own_clk(&self.uniform, pixel.number, pixel.pulses);
        let timing = self.timing(pixel.number);
        let orders = self.orders_of(&timing);
        let parts = match orders.parts(&self.setting, pixel.start) {
            Ok(parts) => parts,
            Err(doubt) => return Ok(TimedOutcome::InDoubt(doubt)),
        };
        let window = self.common.window(pixel.start).open();
        let is_common = |part: &Part| part.first_edge == window.map(|w| w.first_edge);
        let is_levelled = self.runner == Runner::Cycle && self.cycle.unlevelled().is_none();
        if is_levelled && window.is_some() && parts.iter().all(is_common) {
            let pulses = orders.shifted(&self.common, pulses);
            return Ok(TimedOutcome::ForCycle(pulses));
        }
        let counts = self.by_laws(&orders, parts, pixel.start, pulses)?;
        Ok(TimedOutcome::Counted(counts))
    }

    /// The same where delay lines time photons, whose law is that of their silicon.
    fn judge_lines(&self, pixel: &PulsedPixel<'_>) -> Result<TimedOutcome, EngineError> {
        if self.silicon.mismatch.is_some() {
            return Ok(TimedOutcome::InDoubt(Doubt::DelayLines));
        }
        let window = Window::new(&self.uniform, &self.setting.exposure);
        match window.replay(std::slice::from_ref(pixel)) {
            Ok(counts) => Ok(TimedOutcome::Counted(counts.into_counts())),
            Err(EngineError::Race { race, .. }) => {
                Ok(TimedOutcome::InDoubt(Doubt::Race(race.what)))
            }
            Err(EngineError::Irregular(why)) => Ok(TimedOutcome::InDoubt(Doubt::Irregular(why))),
            Err(other) => Err(other),
        }
    }

    /// Counts of one macropixel whose bins follow these laws.
    fn by_laws(
        &self,
        orders: &Orders,
        parts: Vec<Part>,
        start: u16,
        pulses: &[SpadEvent],
    ) -> Result<Vec<u16>, EngineError> {
        let mut counts = vec![0; self.setting.sensor.bins];
        for Part { law, bins, .. } in parts {
            let pulses = orders.shifted(&law, pulses);
            let engine = Window::with_law(law);
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
        pixels: &[PulsedPixel<'_>],
        judged: &mut [TimedOutcome],
    ) -> Result<(), EngineError> {
        let is_for_cycle = |judged: &TimedOutcome| matches!(judged, TimedOutcome::ForCycle(_));
        let places: Vec<usize> = (0..judged.len())
            .filter(|&place| is_for_cycle(&judged[place]))
            .collect();
        for places in places.chunks(self.cycle.batch()) {
            let shifted = places.iter().map(|&place| match &judged[place] {
                // By the CLK of the first column.
                TimedOutcome::ForCycle(pulses) => PulsedPixel {
                    number: 0,
                    pulses,
                    ..pixels[place]
                },
                TimedOutcome::Counted(_) | TimedOutcome::InDoubt(_) => unreachable!("filtered"),
            });
            let shifted: Vec<PulsedPixel<'_>> = shifted.collect();
            let counts = self.cycle.replay(&shifted)?;
            for (&place, counts) in places.iter().zip(&counts) {
                judged[place] = TimedOutcome::Counted(counts.to_vec());
            }
        }
        Ok(())
    }

    /// Macropixels at gate level, each with its own delays.
    fn by_gates(&self, pixels: &[PulsedPixel<'_>]) -> Result<Histograms, EngineError> {
        let gate = Gate::new(&self.uniform, &self.setting.exposure);
        // Those that are alike share an event queue.
        let together = if self.alike.is_some() { LANES } else { 1 };
        let batches: Result<Vec<Histograms>, EngineError> = pixels
            .par_chunks(together)
            .map(|pixels| {
                let timing = self.timing(pixels[0].number);
                let histograms = gate.replay_with(&vec![&*timing; pixels.len()], pixels);
                histograms.map_err(|error| self.named(pixels, error))
            })
            .collect();
        Ok(Histograms::joined(self.setting.sensor.bins, batches?))
    }

    /// An error of one macropixel alone, with its name in the array.
    fn named(&self, pixels: &[PulsedPixel<'_>], error: EngineError) -> EngineError {
        match (pixels, error) {
            ([pixel], EngineError::Unknown { bin, .. }) => EngineError::Unknown {
                macropixel: self.name(pixel.number),
                bin,
            },
            (_, error) => error,
        }
    }

    fn name(&self, number: u32) -> String {
        let (row, col) = self.setting.sensor.position(number as usize);
        array::pixel_name(row, col)
    }

    /// Whether the load brings each of these start values into the P-counters. Its delays are the same for every macropixel.
    fn arrive(&self, starts: impl Iterator<Item = u16>) -> BTreeMap<u16, bool> {
        let Setting {
            sensor,
            exposure,
            schedule,
            ..
        } = &self.setting;
        let always = sensor.mode == Mode::Conventional || !sensor.p_counter.row().has_memory;
        let mut found: BTreeMap<u16, bool> = starts.map(|start| (start, true)).collect();
        if always {
            return found;
        }
        // Kept locked, so that no start value is simulated twice.
        let mut known = locked(&self.arrives);
        let unknown = found.keys().filter(|start| !known.contains_key(start));
        let unknown: Vec<u16> = unknown.copied().collect();
        let timing = self.timing(0);
        for starts in unknown.chunks(LANES) {
            let dark: Vec<&[SpadEvent]> = vec![&[]; starts.len()];
            let lanes = LaneSimulation::new(sensor, exposure, starts, &dark);
            let mut lanes = lanes.with_timing(&timing);
            lanes.run_until(schedule.origin - exposure.clock.period(), &mut ());
            let loaded = starts.iter().zip(lanes.loaded());
            known.extend(loaded.map(|(&start, found)| (start, found == Some(start))));
        }
        for (start, arrives) in &mut found {
            *arrives = known[start];
        }
        found
    }

    /// Delays of a macropixel, whose cells are known by its place in the array.
    fn timing(&self, number: u32) -> Cow<'_, Timing> {
        if let Some((timing, _)) = &self.alike {
            return Cow::Borrowed(timing);
        }
        let position = self.setting.sensor.position(number as usize);
        Cow::Owned(self.circuit.timing_at(&self.silicon, position))
    }

    fn orders(&self, timing: &Timing) -> Orders {
        let paths = self.circuit.paths(timing);
        let macropixel = MacropixelDelays::measure(&paths);
        let is_guided = self.setting.sensor.mode == Mode::Guided;
        let counter = is_guided.then(|| CounterDelays::measure(&paths, &macropixel));
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

impl Engine for Timed {
    /// With the library's delays.
    fn law(&self) -> WindowLaw {
        self.common.clone()
    }

    fn batch(&self) -> usize {
        match self.runner {
            Runner::Cycle => self.cycle.batch(),
            // This many macropixels have most of an array's start values, which are loaded together.
            Runner::Window => 8 * LANES,
            Runner::Gate => LANES,
        }
    }
}

impl Replay for Timed {
    fn replay(&self, pixels: &[PulsedPixel<'_>]) -> Result<Histograms, EngineError> {
        if self.runner == Runner::Gate {
            return self.by_gates(pixels);
        }
        if self.runner == Runner::Cycle {
            has_no_delay_lines(&self.uniform)?;
        }
        follows(&self.uniform, &self.uniform.timing().pulses)?;
        let arrive = self.arrive(pixels.iter().map(|pixel| pixel.start));
        let judge = |pixel: &PulsedPixel<'_>| {
            if arrive[&pixel.start] {
                self.count_in_closed_form(pixel)
            } else {
                Ok(TimedOutcome::InDoubt(Doubt::Load))
            }
        };
        let judged: Result<Vec<TimedOutcome>, EngineError> = pixels.par_iter().map(judge).collect();
        let mut judged = judged?;
        self.run_cycle(pixels, &mut judged)?;

        let mut histograms = Histograms::empty(pixels.len(), self.bins());
        let mut coverage = ClosedFormCoverage::default();
        let mut in_doubt = Vec::new();
        for (place, judged) in judged.into_iter().enumerate() {
            match judged {
                TimedOutcome::Counted(counts) => {
                    coverage.decided += 1;
                    histograms[place].copy_from_slice(&counts);
                }
                TimedOutcome::InDoubt(doubt) => {
                    *coverage.replayed.entry(doubt).or_default() += 1;
                    in_doubt.push(place);
                }
                TimedOutcome::ForCycle(_) => unreachable!("the cycle engine has run"),
            }
        }
        let doubtful: Vec<PulsedPixel<'_>> = in_doubt.iter().map(|&place| pixels[place]).collect();
        let replayed = self.by_gates(&doubtful)?;
        for (place, counts) in in_doubt.into_iter().zip(&replayed) {
            histograms[place].copy_from_slice(counts);
        }
        locked(&self.coverage).add(coverage);
        Ok(histograms)
    }

    fn as_the_law_sees<'p>(&self, number: u32, pulses: &'p [SpadEvent]) -> Cow<'p, [SpadEvent]> {
        let pulses = by_own_clk(&self.uniform, number, pulses);
        if self.uniform.tdc != Tdc::Clocked {
            return pulses;
        }
        let timing = self.timing(number);
        Cow::Owned(self.orders_of(&timing).shifted(&self.common, &pulses))
    }
}

impl Expose for Timed {
    fn expose(
        &self,
        stream: &PhotonStream,
        pixels: &[LitPixel],
    ) -> Result<ExposureResult, EngineError> {
        full_stream(self, stream, pixels)
    }
}

impl ClosedFormCoverage {
    fn add(&mut self, other: Self) {
        self.decided += other.decided;
        for (doubt, macropixels) in other.replayed {
            *self.replayed.entry(doubt).or_default() += macropixels;
        }
    }
}

/// What a thread that panicked left is as whole as it was: it is changed in one step.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex
        .lock()
        .unwrap_or_else(|poisoned| poisoned.into_inner())
}
