//! The gate engine: the netlist itself, event by event.

use std::sync::Arc;

use super::hardware_events::HardwareEvents;
use super::lanes::LaneSimulation;
use super::stimulus::{Pins, Schedule, StimulusPlan};
use super::{Engine, EngineError};
use crate::chip::{Exposure, SensorConfig, front_end, histogram, sensor};
use crate::kernel::{Kernel, LANES, Observer, Policy, Statistics, TimingChecks};
use crate::netlist::{Library, Netlist, Timing};
use crate::photon::SpadEvent;

/// A rectangle of the sensor at gate level, loaded and exposed through its pins.
pub struct GateSimulation<'a> {
    config: &'a SensorConfig,
    first: (usize, usize),
    size: (usize, usize),
    netlist: Arc<Netlist>,
    kernel: Kernel,
    plan: StimulusPlan<'a>,
}

impl<'a> GateSimulation<'a> {
    /// Prepares `size` (rows, cols) macropixels from `first` (row, col) on; `starts` and `pulses` are
    /// row-major over that rectangle.
    pub fn new(
        config: &'a SensorConfig,
        exposure: &'a Exposure,
        first: (usize, usize),
        size: (usize, usize),
        starts: &[u16],
        pulses: &[&[SpadEvent]],
    ) -> Self {
        let netlist = Arc::new(Netlist::elaborate(&sensor::window(config, first, size)));
        let timing = Timing::nominal(&netlist, &Library::default(), config.corner);
        let kernel = Kernel::new(&netlist, &timing);
        GateSimulation {
            config,
            first,
            size,
            netlist,
            kernel,
            plan: StimulusPlan::new(config, exposure, size.1, starts, pulses),
        }
    }

    /// The same simulation with other delays than the library's: annotated, mismatched. Call it before
    /// [`GateSimulation::run`]; `timing` must be of the same netlist.
    pub fn with_timing(mut self, timing: &Timing) -> Self {
        self.kernel = Kernel::new(&self.netlist, timing);
        self
    }

    /// The netlist that is simulated.
    pub fn netlist(&self) -> &Arc<Netlist> {
        &self.netlist
    }

    /// Where load and exposure lie in simulation time.
    pub fn schedule(&self) -> Schedule {
        self.plan.schedule()
    }

    /// Timing checks of this netlist in the sensor's corner, from the end of the power-up reset on, to run it with. The
    /// front ends' first samplers count as asynchronous.
    pub fn timing_checks(&self, policy: Policy) -> TimingChecks {
        TimingChecks::new(&self.netlist, &Library::default(), self.config.corner)
            .policy(policy)
            .not_before(self.schedule().reset_end)
            .asynchronous(&self.netlist, front_end::is_asynchronous_sampler)
    }

    /// A watch for hardware events in every macropixel, from the end of the power-up reset on, to run it with.
    pub fn hardware_events(&self) -> HardwareEvents {
        let paths = self.of_pixels(str::to_owned);
        HardwareEvents::new(&self.netlist, &paths, self.schedule().reset_end)
    }

    /// Simulates load and exposure to the end.
    pub fn run<O: Observer>(&mut self, observer: &mut O) {
        let pins = Pins::of(&self.netlist);
        let mut stimulus = self.plan.stimulus(&pins);
        let end = self.plan.schedule().end;
        self.kernel.run(&mut stimulus, end, observer);
    }

    /// What the simulation did so far.
    pub fn statistics(&self) -> Statistics {
        self.kernel.statistics()
    }

    /// Start values in the P-counters' memories, row-major; `None` where a bit is unknown.
    pub fn loaded(&self) -> Vec<Option<u16>> {
        self.of_pixels(|path| {
            let memory = self.netlist.signal(&format!("{path}.p_counter.MEMORY"));
            let memory = memory.expect("every macropixel has a memory");
            self.kernel.number(&memory).map(|code| code as u16)
        })
    }

    /// Counts of every macropixel and bin, row-major, bin 0 earliest.
    ///
    /// # Errors
    /// When a bit of a count is unknown.
    pub fn histograms(&self) -> Result<Vec<Vec<u16>>, EngineError> {
        let pixels = self.of_pixels(|path| {
            (0..self.config.bins)
                .map(|bin| {
                    let count = format!("{path}.histogram.{}", histogram::bin_name(bin));
                    let count = self.netlist.signal(&count).expect("every bin has a count");
                    self.kernel.number(&count).map(|n| n as u16).ok_or(bin)
                })
                .collect::<Result<Vec<u16>, usize>>()
        });
        let checked = pixels.into_iter().enumerate().map(|(index, histogram)| {
            let (row, col) = (index / self.size.1, index % self.size.1);
            histogram.map_err(|bin| EngineError::Unknown {
                macropixel: sensor::pixel_name(self.first.0 + row, self.first.1 + col),
                bin,
            })
        });
        checked.collect()
    }

    fn of_pixels<T>(&self, f: impl Fn(&str) -> T) -> Vec<T> {
        let (rows, cols) = self.size;
        let at = |row, col| f(&sensor::pixel_name(self.first.0 + row, self.first.1 + col));
        (0..rows)
            .flat_map(|row| (0..cols).map(move |col| (row, col)))
            .map(|(row, col)| at(row, col))
            .collect()
    }
}

/// Simulates macropixels at gate level, each with a load path of its own: one alone, several in lanes.
pub struct Gate<'a> {
    config: &'a SensorConfig,
    exposure: &'a Exposure,
}

impl<'a> Gate<'a> {
    /// An engine for this sensor and exposure.
    pub fn new(config: &'a SensorConfig, exposure: &'a Exposure) -> Self {
        Gate { config, exposure }
    }
}

impl Engine for Gate<'_> {
    fn histogram(&self, start: u16, pulses: &[SpadEvent]) -> Result<Vec<u16>, EngineError> {
        let mut simulation = GateSimulation::new(
            self.config,
            self.exposure,
            (0, 0),
            (1, 1),
            &[start],
            &[pulses],
        );
        simulation.run(&mut ());
        Ok(simulation.histograms()?.remove(0))
    }

    fn histograms(
        &self,
        starts: &[u16],
        pulses: &[&[SpadEvent]],
    ) -> Result<Vec<Vec<u16>>, EngineError> {
        let batches = starts.chunks(LANES).zip(pulses.chunks(LANES));
        let mut histograms = Vec::with_capacity(starts.len());
        for (starts, pulses) in batches {
            // One alone is quicker without lanes.
            if let ([start], [pulses]) = (starts, pulses) {
                histograms.push(self.histogram(*start, pulses)?);
                continue;
            }
            let mut lanes = LaneSimulation::new(self.config, self.exposure, starts, pulses);
            lanes.run(&mut ());
            histograms.extend(lanes.histograms()?);
        }
        Ok(histograms)
    }
}
