//! The cycle engine: the netlist itself, levelised into tapes of word operations, 512 macropixels to a word.
//!
//! ```text
//!                 ┌ survey ──► expression ──► stream   photons to SPAD_EVENT, 16 CLK periods at a time
//!   netlist ──────┤
//!                 └ levelise ───────────────► tape     counters, strobe, histogram, pass by pass
//!
//!   SPAD pulses ──► packing ──► stream ──► tape ──► counts          (a block of 512 macropixels, a thread each)
//! ```
//!
//! Every CLK period of the exposure is stepped. Time enters twice, exactly: in which CLK edge takes a pulse, and in
//! the order in which the edges of one period arrive. Otherwise there is no delay and, after the reset that the
//! event kernel simulates, no X. What is run is what the netlist says; of the macropixel only pins and bins are named.
//!
//! Macropixels go into blocks by their start values, so that a block's windows are open in the same CLK periods, and
//! its counters at rest in the others, which are skipped where nothing would change. A netlist, or a configuration, for
//! which no tape can be made is run by the gate engine, and so is a block in which a lane does what a tape cannot follow.

mod expression;
mod levelise;
mod packing;
mod parts;
mod passes;
mod schedule;
mod stream;
mod survey;
mod tape;
mod unlevelled;
mod word;

use std::sync::OnceLock;

use rayon::prelude::*;

use super::error::{has_no_delay_lines, refuse_races};
use super::{
    Engine, EngineError, Expose, ExposureResult, Gate, Histograms, LitPixel, PulsedPixel, Replay,
    follows, full_stream,
};
use crate::chip::timing::macropixel::MacropixelCircuit;
use crate::chip::window_law::WindowLaw;
use crate::chip::{Exposure, Sensor};
use crate::photon::{PhotonStream, SpadEvent};
use levelise::LevelisedLogic;
use packing::{PERIODS, Packed};
use schedule::Schedule;
use stream::Flow;
use survey::Survey;
use tape::Block;
pub use unlevelled::LevelisationError;
use word::{WORD_LANES, Word, inversion};

/// A netlist that can be run.
struct Machine {
    survey: Survey,
    levelised: LevelisedLogic,
}

/// Runs the levelised netlist.
pub struct Cycle {
    sensor: Sensor,
    exposure: Exposure,
    law: WindowLaw,
    replays_control: bool,
    machine: OnceLock<Result<Machine, LevelisationError>>,
}

/// Pulses, sorted for [`Cycle::replay_packed`].
pub struct PackedPulses {
    /// Macropixels of each block, by their index in the caller's order.
    blocks: Vec<(Vec<usize>, Packed)>,
}

impl Cycle {
    /// An engine for this sensor and exposure. The netlist is levelised when it is first needed.
    pub fn new(sensor: impl Into<Sensor>, exposure: &Exposure) -> Self {
        let sensor = sensor.into();
        Cycle {
            law: WindowLaw::new(&sensor, exposure),
            sensor,
            exposure: *exposure,
            replays_control: true,
            machine: OnceLock::new(),
        }
    }

    /// The same engine with control simulated in every laser cycle, where otherwise one that repeats is recorded once and
    /// replayed. Histograms are the same; the time that it takes shows what the recording saves.
    #[must_use]
    pub fn with_live_control(self) -> Self {
        Cycle {
            replays_control: false,
            ..self
        }
    }

    fn machine(&self) -> Result<&Machine, &LevelisationError> {
        let machine = self.machine.get_or_init(|| {
            if self.sensor.front_end.joins() {
                let wire = "the wire that all SPADs share".to_owned();
                return Err(LevelisationError::Structure(wire));
            }
            if self.sensor.front_end_block.is_some() {
                let circuit = MacropixelCircuit::new(&self.sensor, (0, 0));
                let timing = self.sensor.silicon().timing(&circuit.netlist);
                let latency = circuit.paths(&timing).front_end_latency();
                // Packing knows one.
                if latency
                    .iter()
                    .any(|of_spad| *of_spad != (latency[0].0, latency[0].0))
                {
                    let what =
                        "a front end in which CLK sees SPADs after different times".to_owned();
                    return Err(LevelisationError::Structure(what));
                }
            }
            let survey = Survey::new(&self.sensor, &self.exposure);
            let levelised = LevelisedLogic::new(&survey, &self.sensor, &self.exposure)?;
            Ok(Machine { survey, levelised })
        });
        machine.as_ref()
    }

    /// Why this sensor's macropixels cannot be levelised and are left to the gate engine, if so.
    pub fn unlevelled(&self) -> Option<&LevelisationError> {
        self.machine().err()
    }

    /// CLK periods with clock edges, as the stimulus of the gate engine has them.
    fn clocked(&self) -> usize {
        self.exposure.stop_periods as usize * self.exposure.laser_cycles as usize + 2
    }

    fn chunks(&self) -> usize {
        self.clocked().div_ceil(PERIODS)
    }

    /// Sorts pulses (one list per macropixel, by time) for [`Cycle::replay_packed`].
    pub fn pack(&self, starts: &[u16], pulses: &[&[SpadEvent]]) -> PackedPulses {
        let mut order: Vec<usize> = (0..starts.len()).collect();
        // Counters that start alike open their windows, and come to rest, together.
        order.sort_by_key(|&pixel| (starts[pixel], pixel));
        let chunks = self.chunks();
        let blocks = order.par_chunks(WORD_LANES).map(|pixels| {
            let lanes = pixels.iter().map(|&pixel| pulses[pixel]);
            (pixels.to_vec(), Packed::new(&self.law, chunks, lanes))
        });
        PackedPulses {
            blocks: blocks.collect(),
        }
    }

    /// Histograms of packed macropixels, in the caller's order: the logic alone.
    ///
    /// # Errors
    /// As [`Cycle::unlevelled`], or when an edge goes where the tape has no place for it.
    pub fn replay_packed(
        &self,
        starts: &[u16],
        packed: &PackedPulses,
    ) -> Result<Histograms, LevelisationError> {
        let machine = self.machine().map_err(LevelisationError::clone)?;
        let blocks: Result<Vec<_>, LevelisationError> = packed
            .blocks
            .par_iter()
            .map(|(pixels, pulses)| {
                let starts: Vec<u16> = pixels.iter().map(|&pixel| starts[pixel]).collect();
                let schedule =
                    Schedule::new(&machine.levelised.causes, &self.exposure, self.clocked());
                machine.replay_block(schedule, self.replays_control, &starts, pulses)
            })
            .collect();
        let mut histograms = Histograms::empty(starts.len(), self.sensor.bins);
        for ((pixels, _), block) in packed.blocks.iter().zip(blocks?) {
            for (&pixel, histogram) in pixels.iter().zip(&block) {
                histograms[pixel].copy_from_slice(histogram);
            }
        }
        Ok(histograms)
    }
}

impl Machine {
    /// Histograms of one block.
    fn replay_block(
        &self,
        schedule: Schedule<'_>,
        replays_control: bool,
        starts: &[u16],
        pulses: &Packed,
    ) -> Result<Histograms, LevelisationError> {
        let LevelisedLogic {
            stream,
            passes: tape,
            parts,
            ..
        } = &self.levelised;
        let mut block = Block::new(tape, self.start(starts)?);
        let mut flow = Flow::new(stream, pulses);
        passes::run_passes(
            tape,
            parts,
            &mut block,
            &mut flow,
            schedule,
            replays_control,
        );
        if let Some(place) = block.trapped {
            return Err(LevelisationError::Trapped(self.name(place)));
        }
        if !block.is_settled() {
            return Err(LevelisationError::Trapped(
                "a net that does not settle".to_owned(),
            ));
        }
        Ok(self.counts(&block, starts.len()))
    }

    /// Every place of a block when the exposure starts. Lanes that are left over repeat the last start value.
    fn start(&self, starts: &[u16]) -> Result<Vec<Word>, LevelisationError> {
        let mut words = vec![Word::ZERO; self.levelised.places];
        let last = *starts.last().expect("a block has a macropixel");
        for &(place, net, inverted) in &self.levelised.initial {
            let word = &mut words[usize::from(place)];
            if let Some(value) = self.survey.shared_initial(net) {
                *word = Word::all(value ^ inverted);
                continue;
            }
            for lane in 0..WORD_LANES {
                let start = starts.get(lane).copied().unwrap_or(last);
                word.set(lane, self.survey.initial(net, start)? ^ inverted);
            }
        }
        Ok(words)
    }

    /// The net at a place.
    fn name(&self, place: u16) -> String {
        let net = self.levelised.initial.iter().find(|(p, ..)| *p == place);
        net.map_or_else(String::new, |&(_, net, _)| self.survey.name(net))
    }

    fn counts(&self, block: &Block, lanes: usize) -> Histograms {
        let bins = &self.levelised.bins;
        let mut counts = Histograms::empty(lanes, bins.len());
        for (bin, bits) in bins.iter().enumerate() {
            for (weight, &(place, inverted)) in bits.iter().enumerate() {
                let word = block.words[usize::from(place)] ^ inversion(inverted);
                for lane in 0..lanes {
                    counts[lane][bin] |= u16::from(word.lane(lane)) << weight;
                }
            }
        }
        counts
    }
}

impl Engine for Cycle {
    fn law(&self) -> WindowLaw {
        self.law.clone()
    }

    fn batch(&self) -> usize {
        8 * WORD_LANES
    }
}

impl Replay for Cycle {
    fn replay(&self, pixels: &[PulsedPixel<'_>]) -> Result<Histograms, EngineError> {
        follows(&self.sensor, &self.law.timing().pulses)?;
        has_no_delay_lines(&self.sensor)?;
        let starts: Vec<u16> = pixels.iter().map(|pixel| pixel.start).collect();
        let seen = PulsedPixel::all_by_own_clk(pixels, &self.sensor);
        let pulses: Vec<&[SpadEvent]> = seen.iter().map(|pulses| &**pulses).collect();
        refuse_races(&self.law, starts.iter().copied())?;
        if self.unlevelled().is_none()
            && let Ok(histograms) = self.replay_packed(&starts, &self.pack(&starts, &pulses))
        {
            return Ok(histograms);
        }
        Gate::new(&self.sensor, &self.exposure).replay(pixels)
    }
}

impl Expose for Cycle {
    fn expose(
        &self,
        stream: &PhotonStream,
        pixels: &[LitPixel],
    ) -> Result<ExposureResult, EngineError> {
        full_stream(self, stream, pixels)
    }
}
