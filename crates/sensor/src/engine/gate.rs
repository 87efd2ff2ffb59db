//! The gate engine: the netlist itself, event by event.

use std::collections::HashSet;
use std::sync::Arc;

use rayon::prelude::*;

use super::lanes::LaneSimulation;
use super::readout::PinSampler;
use super::{
    Engine, EngineError, Expose, ExposureResult, Histograms, LitPixel, PulsedPixel, Replay,
    follows, full_stream,
};
use crate::chip::timing::macropixel::MacropixelCircuit;
use crate::chip::{
    Exposure, LoadPins, Probe, Probes, ReadPins, Sensor, SensorPins, WindowLaw, array, load_path,
    metdc_delay_line,
};
use crate::kernel::{Kernel, LANES, Observer, Policy, Statistics, Stimulus, TimingChecks};
use crate::netlist::{CellId, NetId, Netlist, Timing};
use crate::photon::{PhotonStream, SpadEvent};
use crate::stimulus::{
    HardwareEvents, Schedule, Skip, StimulusPlan, read_stimulus, reload_stimulus,
};
use crate::units::Time;

/// A rectangle of the sensor at gate level, loaded and exposed through its pins.
pub struct GateSimulation {
    sensor: Sensor,
    netlist: Arc<Netlist>,
    /// Of each macropixel, row-major.
    probes: Vec<Probes>,
    timing: Timing,
    kernel: Kernel,
    plan: StimulusPlan,
    /// When counts are set that would have come of laser cycles that are left out, and the flip-flops of those counts.
    preset: Option<(Time, Vec<(CellId, bool)>)>,
}

impl GateSimulation {
    /// Prepares `size` (rows, cols) macropixels from `first` (row, col) on; `starts` and `pulses` are
    /// row-major over that rectangle.
    pub fn new(
        sensor: impl Into<Sensor>,
        exposure: &Exposure,
        first: (usize, usize),
        size: (usize, usize),
        starts: &[u16],
        pulses: &[&[SpadEvent]],
    ) -> Self {
        let sensor = sensor.into();
        let netlist = Arc::new(Netlist::elaborate(&array::subarray(&sensor, first, size)));
        let timing = sensor.silicon().timing(&netlist);
        Self::of_netlist(
            (netlist, timing),
            sensor,
            exposure,
            (first, size),
            starts,
            pulses,
        )
    }

    /// The simulation of a netlist that is elaborated already, and its delays: those of [`GateSimulation::new`] do not depend on the clocks.
    pub(crate) fn of_netlist(
        (netlist, timing): (Arc<Netlist>, Timing),
        sensor: Sensor,
        exposure: &Exposure,
        (first, size): ((usize, usize), (usize, usize)),
        starts: &[u16],
        pulses: &[&[SpadEvent]],
    ) -> Self {
        let kernel = Kernel::new(&netlist, &timing);
        let rectangle = (0..size.0).flat_map(|row| (0..size.1).map(move |col| (row, col)));
        let probes = rectangle
            .map(|(row, col)| Probes::of_macropixel(&netlist, first.0 + row, first.1 + col))
            .collect();
        GateSimulation {
            netlist,
            probes,
            timing,
            kernel,
            plan: StimulusPlan::new(&sensor, exposure, size.1, starts, pulses),
            preset: None,
            sensor,
        }
    }

    /// The same simulation with other delays and limits than the library's: annotated, mismatched. Call it before
    /// [`GateSimulation::run`]; `timing` must be of the same netlist.
    pub fn with_timing(mut self, timing: &Timing) -> Self {
        self.kernel = Kernel::new(&self.netlist, timing);
        self.timing = timing.clone();
        self
    }

    /// The same simulation with the events of each instant in a random order, which changes no result. Call it
    /// after [`GateSimulation::with_timing`].
    pub fn shuffled(mut self, seed: u64) -> Self {
        self.kernel = self.kernel.shuffled(seed);
        self
    }

    /// The same simulation without the laser cycles before `skip`, in which the macropixels count what `counted` has,
    /// row-major. As it is where there is no time to set that.
    #[must_use]
    pub(super) fn skipping(mut self, skip: Skip, counted: &Histograms) -> Self {
        let Some((plan, rest)) = self.plan.clone().skipping(skip) else {
            return self;
        };
        let netlist = &self.netlist;
        let states = self.probes.iter().enumerate().flat_map(|(pixel, probes)| {
            let counts = counted[pixel].iter().enumerate();
            counts.flat_map(move |(bin, &count)| {
                let cells = probes.bin_cells(netlist, bin).into_iter().enumerate();
                cells.map(move |(bit, cell)| (cell, count >> bit & 1 == 1))
            })
        });
        self.preset = Some((rest, states.collect()));
        self.plan = plan;
        self
    }

    /// The same simulation, which reads all counts through the pins in the end. Call it before [`GateSimulation::run`].
    pub fn with_readout(mut self) -> Self {
        self.plan = self.plan.with_readout();
        self
    }

    /// Delays of that netlist.
    pub fn timing(&self) -> &Timing {
        &self.timing
    }

    /// The netlist that is simulated.
    pub fn netlist(&self) -> &Arc<Netlist> {
        &self.netlist
    }

    /// Where load and exposure lie in simulation time.
    pub fn schedule(&self) -> Schedule {
        self.plan.schedule
    }

    /// Timing checks of this netlist in the sensor's corner, from the end of the power-up reset on, to run it with. The
    /// front ends' first samplers count as asynchronous.
    pub fn timing_checks(&self, policy: Policy) -> TimingChecks {
        let library = self.sensor.silicon().cell_library.cells();
        let samplers = self.samplers();
        TimingChecks::new(&self.netlist, library, self.sensor.corner)
            .limits(&self.netlist, &self.timing)
            .policy(policy)
            .not_before(self.schedule().reset_end)
            .asynchronous(&self.netlist, |cell| {
                samplers.contains(cell) || metdc_delay_line::is_asynchronous_sampler(cell)
            })
    }

    /// Paths of the front ends' first samplers, which count as asynchronous.
    pub(crate) fn samplers(&self) -> HashSet<String> {
        let cells = self
            .probes
            .iter()
            .flat_map(|probes| probes.samplers(&self.netlist));
        cells.map(|cell| self.netlist.cell_path(cell)).collect()
    }

    /// A watch for hardware events in every macropixel, from the end of the power-up reset on, to run it with.
    pub fn hardware_events(&self) -> HardwareEvents {
        let released = self.schedule().reset_end;
        HardwareEvents::new(&self.netlist, &self.sensor, &self.probes, released)
    }

    /// Simulates load and exposure to the end.
    pub fn run(&mut self, observer: &mut dyn Observer) {
        self.run_until(self.plan.schedule.end, observer);
    }

    /// Simulates from power-up to `until`.
    pub(super) fn run_until(&mut self, until: Time, observer: &mut dyn Observer) {
        let pins = SensorPins::find(&self.netlist);
        let mut stimulus = self.plan.stimulus(&pins);
        if let Some((rest, states)) = self.preset.take() {
            self.kernel
                .run(&mut stimulus, rest, observer)
                .expect("no loop of cells without delay");
            self.kernel.preset(states, observer);
        }
        self.kernel
            .run(&mut stimulus, until, observer)
            .expect("no loop of cells without delay");
    }

    /// Reads all counts through the pins, after [`GateSimulation::run`] and as often as one likes; at the same time the start values
    /// of the next exposure (row-major) are loaded, if there are any, which takes its own time.
    ///
    /// # Errors
    /// When a bit of a count is unknown.
    pub fn read_out(
        &mut self,
        next: Option<&[u16]>,
        observer: &mut dyn Observer,
    ) -> Result<Histograms, EngineError> {
        let now = self.kernel.now();
        let stream = next.map(|starts| {
            debug_assert_eq!(starts.len(), self.probes.len());
            let codes = self.sensor.load_codes(starts);
            load_path::stream(&codes, self.plan.order.cols, self.sensor.counter_bits)
        });
        let (others_end, others) = match &stream {
            None => (now, Stimulus::new([])),
            Some(stream) => {
                let clock = self.sensor.load_clock();
                let times = (now, now + clock.period());
                reload_stimulus(LoadPins::find(&self.netlist), clock, times, stream)
            }
        };
        let order = self.plan.order;
        let pins = ReadPins::find(&self.netlist);
        let (clock, start) = (self.sensor.read_clock(), self.kernel.now());
        let (end, read) = read_stimulus(&pins, clock, start, order.periods());
        let mut stimulus = read.with_drives(others);
        let mut sampler = PinSampler::new(&self.netlist, |net| self.kernel.value(net));
        let mut observers = (&mut sampler, observer);
        let settled = end.max(others_end) + clock.period();
        self.kernel
            .run(&mut stimulus, settled, &mut observers)
            .expect("no loop of cells without delay");
        let mut histograms = Histograms::new(self.sensor.bins);
        let counts = sampler.counts(&order);
        for (probes, counts) in self.probes.iter().zip(counts.chunks(self.sensor.bins)) {
            histograms.push_known(counts.iter().copied(), || probes.macropixel().to_owned())?;
        }
        Ok(histograms)
    }

    /// The present, in simulation time.
    pub fn now(&self) -> Time {
        self.kernel.now()
    }

    /// What the simulation did so far.
    pub fn statistics(&self) -> Statistics {
        self.kernel.statistics()
    }

    /// Start values in the P-counters' memories, row-major; `None` where a bit is unknown, and without memory.
    pub fn loaded(&self) -> Vec<Option<u16>> {
        let loaded = |probes: &Probes| {
            let memory = probes.find(Probe::Memory)?;
            let code = self.kernel.number(memory)? as u16;
            Some(self.sensor.start_of_code(code))
        };
        self.probes.iter().map(loaded).collect()
    }

    /// Counts of every macropixel and bin, row-major, bin 0 earliest.
    ///
    /// # Errors
    /// When a bit of a count is unknown.
    pub fn histograms(&self) -> Result<Histograms, EngineError> {
        let count = |nets: &Vec<NetId>| self.kernel.number(nets).map(|n| n as u16);
        let mut histograms = Histograms::new(self.sensor.bins);
        for probes in &self.probes {
            let counts = probes.bins().iter().map(count);
            histograms.push_known(counts, || probes.macropixel().to_owned())?;
        }
        Ok(histograms)
    }

    /// Handles of each macropixel's nets, row-major.
    pub fn probes(&self) -> &[Probes] {
        &self.probes
    }
}

/// Simulates macropixels at gate level, each with a load path of its own: one alone, several in lanes.
pub struct Gate {
    sensor: Sensor,
    exposure: Exposure,
}

impl Gate {
    /// An engine for this sensor and exposure.
    pub fn new(sensor: impl Into<Sensor>, exposure: &Exposure) -> Self {
        Gate {
            sensor: sensor.into(),
            exposure: *exposure,
        }
    }

    /// The netlist of each macropixel with its load path.
    pub fn netlist(&self) -> Netlist {
        Netlist::elaborate(&array::subarray(&self.sensor, (0, 0), (1, 1)))
    }

    /// The library's delays of that netlist in the sensor's corner.
    pub fn nominal_timing(&self) -> Timing {
        self.sensor.silicon().timing(&self.netlist())
    }

    /// Histograms of macropixels with delays of their own, such as the mismatch of each. Neighbours in the list
    /// that have the same [`Timing`] share lanes; one whose neighbours have others runs alone, because events that
    /// each have their own time leave nothing to share.
    ///
    /// # Errors
    /// When a bit of a count is unknown, and where the front end cannot follow the SPADs.
    ///
    /// # Panics
    /// When the lists have different lengths.
    pub fn replay_with(
        &self,
        timings: &[&Timing],
        pixels: &[PulsedPixel<'_>],
    ) -> Result<Histograms, EngineError> {
        assert!(timings.len() == pixels.len());
        follows(&self.sensor, &self.sensor.timing().pulses)?;
        let mut histograms = Histograms::new(self.sensor.bins);
        for alike in timings.chunk_by(|a, b| std::ptr::eq(*a, *b)) {
            let (from, to) = (histograms.len(), histograms.len() + alike.len());
            for pixels in pixels[from..to].chunks(LANES) {
                histograms.append(&self.run_batch(alike[0], pixels)?);
            }
        }
        Ok(histograms)
    }

    /// At most [`LANES`] macropixels with the same delays.
    fn run_batch(
        &self,
        timing: &Timing,
        pixels: &[PulsedPixel<'_>],
    ) -> Result<Histograms, EngineError> {
        let starts: &Vec<u16> = &pixels.iter().map(|pixel| pixel.start).collect();
        let seen = PulsedPixel::all_by_own_clk(pixels, &self.sensor);
        let pulses: &Vec<&[SpadEvent]> = &seen.iter().map(|pulses| &**pulses).collect();
        // One alone is quicker without lanes.
        if starts.len() == 1 {
            let (first, size) = ((0, 0), (1, 1));
            let alone =
                GateSimulation::new(&self.sensor, &self.exposure, first, size, starts, pulses);
            let mut alone = alone.with_timing(timing);
            alone.run(&mut ());
            return alone.histograms();
        }
        let lanes = LaneSimulation::new(&self.sensor, &self.exposure, starts, pulses);
        let mut lanes = lanes.with_timing(timing);
        lanes.run(&mut ());
        lanes.histograms()
    }
}

impl Engine for Gate {
    fn law(&self) -> WindowLaw {
        WindowLaw::new(&self.sensor, &self.exposure)
    }
}

impl Replay for Gate {
    fn replay(&self, pixels: &[PulsedPixel<'_>]) -> Result<Histograms, EngineError> {
        if self.sensor.tdc.has_clk_bins() {
            let nominal = self.nominal_timing();
            return self.replay_with(&vec![&nominal; pixels.len()], pixels);
        }
        let circuit = MacropixelCircuit::new(&self.sensor, (0, 0));
        let alone = pixels.par_iter().map(|pixel| {
            let position = self.sensor.position(pixel.number as usize);
            let timing = circuit.timing_at(self.sensor.silicon(), position);
            self.replay_with(&[&timing], std::slice::from_ref(pixel))
        });
        let alone: Result<Vec<Histograms>, EngineError> = alone.collect();
        Ok(Histograms::joined(self.sensor.bins, alone?))
    }
}

impl Expose for Gate {
    fn expose(
        &self,
        stream: &PhotonStream,
        pixels: &[LitPixel],
    ) -> Result<ExposureResult, EngineError> {
        full_stream(self, stream, pixels)
    }
}
