//! The gate engine for many macropixels at once: 64 of them in one lane-parallel event queue.
//!
//! Each lane is a macropixel with a load path of its own, as in [`Gate`](super::Gate); they share clocks and
//! control pins and differ in the serial bits and the photons.

use bitvec::vec::BitVec;

use super::{EngineError, Histograms};
use crate::chip::{Exposure, Probe, Probes, Sensor, SensorPins, array, load_path};
use crate::kernel::{LANES, LaneDrive, LaneKernel, LaneObserver, Lanes};
use crate::netlist::{NetId, Netlist, Timing};
use crate::photon::SpadEvent;
use crate::stimulus::{Schedule, StimulusPlan};
use crate::units::Time;

/// Up to 64 macropixels at gate level, loaded and exposed together.
pub struct LaneSimulation {
    sensor: Sensor,
    netlist: Netlist,
    probes: Probes,
    /// The kernel, for what it counted.
    pub kernel: LaneKernel,
    shared: StimulusPlan,
    serial: Vec<BitVec>,
    pulses: Vec<(usize, SpadEvent)>,
}

impl LaneSimulation {
    /// Prepares one lane for each start value and its pulses.
    ///
    /// # Panics
    /// When there are more than [`LANES`], or lists of different lengths.
    pub fn new(
        sensor: impl Into<Sensor>,
        exposure: &Exposure,
        starts: &[u16],
        pulses: &[&[SpadEvent]],
    ) -> Self {
        assert!(starts.len() <= LANES && starts.len() == pulses.len());
        let sensor = sensor.into();
        let netlist = Netlist::elaborate(&array::subarray(&sensor, (0, 0), (1, 1)));
        let timing = sensor.silicon().timing(&netlist);
        let kernel = LaneKernel::new(&netlist, &timing);
        let end = exposure.end();
        let mut all: Vec<(usize, SpadEvent)> = pulses
            .iter()
            .enumerate()
            .flat_map(|(lane, list)| list.iter().map(move |&pulse| (lane, pulse)))
            .filter(|(_, pulse)| pulse.time < end)
            .collect();
        all.sort_unstable_by_key(|(lane, pulse)| (pulse.time, *lane, pulse.spad));
        LaneSimulation {
            probes: Probes::of_macropixel(&netlist, 0, 0),
            netlist,
            kernel,
            shared: StimulusPlan::new(&sensor, exposure, 1, &[0], &[&[]]),
            serial: sensor
                .load_codes(starts)
                .iter()
                .map(|&code| load_path::stream(&[code], 1, sensor.counter_bits))
                .collect(),
            pulses: all,
            sensor,
        }
    }

    /// The same simulation with other delays than the library's, those of every lane. Call it before
    /// [`LaneSimulation::run`]; `timing` must be of the same netlist.
    pub(crate) fn with_timing(mut self, timing: &Timing) -> Self {
        self.kernel = LaneKernel::new(&self.netlist, timing);
        self
    }

    /// Where load and exposure lie in simulation time.
    pub(crate) fn schedule(&self) -> Schedule {
        self.shared.schedule
    }

    /// Simulates load and exposure to the end.
    pub fn run<O: LaneObserver>(&mut self, observer: &mut O) {
        self.run_until(self.schedule().end, observer);
    }

    /// Simulates from power-up to `end`, in simulation time.
    pub(super) fn run_until<O: LaneObserver>(&mut self, end: Time, observer: &mut O) {
        let pins = SensorPins::find(&self.netlist);
        let mut stimulus = self.stimulus(&pins).peekable();
        self.kernel
            .run(&mut stimulus, end, observer)
            .expect("no loop of cells without delay");
    }

    fn stimulus(&self, pins: &SensorPins) -> impl Iterator<Item = LaneDrive> + use<> {
        let serial = pins.load.serial;
        let everyone = |time, net, values| LaneDrive {
            time,
            net,
            mask: u64::MAX,
            values,
        };
        let mut drives: Vec<LaneDrive> = Vec::new();
        let mut bit = 0;
        for drive in self.shared.stimulus(pins) {
            if drive.net != serial {
                drives.push(everyone(drive.time, drive.net, Lanes::all(drive.value)));
            } else if drive.time == Time::ZERO {
                drives.push(everyone(drive.time, serial, Lanes::all(drive.value)));
            } else {
                let bits = self.serial.iter().enumerate();
                let word = bits.fold(0, |word, (lane, bits)| word | u64::from(bits[bit]) << lane);
                drives.push(everyone(drive.time, serial, Lanes::from_bits(word)));
                bit += 1;
            }
        }
        let (origin, width) = (self.schedule().origin, self.sensor.pulse_width());
        for &(lane, pulse) in &self.pulses {
            let net = pins.spad_raw[usize::from(pulse.spad)];
            let time = origin + pulse.time;
            let mask = 1 << lane;
            let (rise, fall) = (Lanes::from_bits(u64::MAX), Lanes::from_bits(0));
            drives.push(LaneDrive {
                time,
                net,
                mask,
                values: rise,
            });
            drives.push(LaneDrive {
                time: time + width,
                net,
                mask,
                values: fall,
            });
        }
        drives.sort_by_key(|d| d.time);
        drives.into_iter()
    }

    /// Start value in the P-counter's memory of each lane; `None` where a bit is unknown, and without memory.
    pub fn loaded(&self) -> Vec<Option<u16>> {
        let memory = self.probes.find(Probe::Memory);
        let loaded = |lane| {
            let code = self.kernel.number(memory?, lane)? as u16;
            Some(self.sensor.start_of_code(code))
        };
        (0..self.serial.len()).map(loaded).collect()
    }

    /// Counts of each lane, bin 0 earliest.
    ///
    /// # Errors
    /// When a bit of a count is unknown; the lane stands for the column.
    pub fn histograms(&self) -> Result<Histograms, EngineError> {
        let bins = self.probes.bins();
        let mut histograms = Histograms::new(bins.len());
        for lane in 0..self.serial.len() {
            let count = |nets: &Vec<NetId>| self.kernel.number(nets, lane).map(|n| n as u16);
            let macropixel = || format!("the macropixel in lane {lane}");
            histograms.push_known(bins.iter().map(count), macropixel)?;
        }
        Ok(histograms)
    }
}
