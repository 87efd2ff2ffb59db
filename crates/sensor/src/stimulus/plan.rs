//! What a tester drives into the sensor's pins: power-up, serial load, exposure.
//!
//! ```text
//!   RESETB           ▁▁▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔
//!   HISTOGRAM_CLEAR  ▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁
//!   LOAD_ENABLE      ▁▁▁▁▔▔▔▔▔▔▔▔▔▔▔▔▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁
//!   LOAD_CLK         ▁▁▁▁▁▔▁▔▁▔ … ▔▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁  one rising edge per bit of COUNTER_INITS
//!   ENABLE           ▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▔▔▔▔▔▔▔▔▔▔▔▔▔▔▁▁▁▁▁▁▁▁  sampled by STOP
//!   STOP             ▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▔▔▁▁▔▔▁▁ … ▔▔▁▁▔▁▁▁  laser cycles + 1 rising edges
//!   CLK              ▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▁▔▁▔▁▔▁▔▁▔ … ▔▁▔▁▔▁▁  idles high, starts with its falling edge
//!                                         └ origin: time 0 of the exposure
//! ```
//!
//! Where histograms are read through the pins, that comes last: READ_ENABLE is high for it, with one rising edge of READ_CLK
//! for each bit of DATA_OUT.
//!
//! The same drives go into the event kernel and into the exported Verilog testbench.

use std::collections::BTreeSet;

use bitvec::slice::BitSlice;

use crate::chip::readout::ReadoutOrder;
use crate::chip::{
    Exposure, LoadPins, Mode, ReadPins, Sensor, SensorConfig, SensorPins, load_path,
};
use crate::kernel::{Drive, Stimulus, clock};
use crate::photon::SpadEvent;
use crate::units::{Frequency, Time};

/// When the chip comes out of reset.
const RESET_END: Time = Time::from_ns(2);
/// Falling LOAD_CLK edge that precedes the first bit.
const LOAD_START: Time = Time::from_ns(5);
/// From READ_ENABLE to the first bit: the first word settles, in any corner.
const READ_SETTLING: Time = Time::from_ns(5);
/// Quiet time between load and exposure, and for counts to ripple through after it.
const SETTLING: Time = Time::from_ns(20);

/// Power-up and serial load: the bits of `stream` on COUNTER_INITS, and the time at which they are in.
pub(crate) fn load_stimulus<'a>(
    pins: LoadPins,
    clock: Frequency,
    stream: &'a BitSlice,
) -> (Time, Stimulus<'a>) {
    let enabled = Time::from_fs((RESET_END + LOAD_START).as_fs() / 2);
    let power_up = [
        Drive::new(Time::ZERO, pins.resetb, false),
        Drive::new(Time::ZERO, pins.enable, false),
        Drive::new(Time::ZERO, pins.clk, false),
        Drive::new(Time::ZERO, pins.serial, false),
        Drive::new(RESET_END, pins.resetb, true),
    ];
    let (end, load) = reload_stimulus(pins, clock, (enabled, LOAD_START), stream);
    (end, Stimulus::new(power_up).with_drives(load))
}

/// The serial load alone: LOAD_ENABLE rises at `enabled`, the first bit is there at `start`, and the time at which all bits
/// are in.
pub(crate) fn reload_stimulus<'a>(
    pins: LoadPins,
    clock: Frequency,
    (enabled, start): (Time, Time),
    stream: &'a BitSlice,
) -> (Time, Stimulus<'a>) {
    let bits = stream.len() as i64;
    let half = move |k| start + clock.half_periods(k);
    let end = half(2 * bits + 1);
    let control = [
        Drive::new(enabled, pins.enable, true),
        Drive::new(end, pins.enable, false),
    ];
    // Data change with falling edges and are taken by rising ones.
    let edges = (0..=2 * bits).flat_map(move |k| {
        let edge = Drive::new(half(k), pins.clk, k % 2 == 1);
        let data = (k % 2 == 0 && k < 2 * bits)
            .then(|| Drive::new(half(k), pins.serial, stream[k as usize / 2]));
        std::iter::once(edge).chain(data)
    });
    (end, Stimulus::new(control).with_drives(edges))
}

/// Longer than delay lines take to be empty and CLK to come to the last column.
fn delay_lines(sensor: &Sensor) -> Time {
    sensor.longest_delay_line() + sensor.clk_skew(sensor.cols)
}

/// A readout from `start` on, READ_ENABLE's rise: `periods` of READ_CLK, and the time at which all bits are out.
pub(crate) fn read_stimulus(
    pins: &ReadPins,
    clock: Frequency,
    start: Time,
    periods: usize,
) -> (Time, Stimulus<'static>) {
    let (enable, clk) = (pins.enable, pins.clk);
    let first = start + READ_SETTLING;
    let half = move |k: i64| first + clock.half_periods(k);
    let end = half(2 * periods as i64);
    let edges = (0..2 * periods as i64).map(move |k| Drive::new(half(k), clk, k % 2 == 0));
    let begin = std::iter::once(Drive::new(start, enable, true));
    let close = std::iter::once(Drive::new(end, enable, false));
    (end, Stimulus::new(begin.chain(edges).chain(close)))
}

/// Where load and exposure lie in simulation time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Schedule {
    /// Rise of RESETB: the chip comes out of its power-up reset.
    pub reset_end: Time,
    /// Rising edge of LOAD_CLK that takes the first bit.
    pub first_bit: Time,
    /// The end of the load.
    pub load_end: Time,
    /// First rising edge of STOP: time 0 of the exposure.
    pub origin: Time,
    /// When all counts have settled.
    pub counted: Time,
    /// When everything has settled, and all counts have been read if they are to be.
    pub end: Time,
}

/// Laser cycles that are left out: after the load comes the end of one of them, and then the rest of the exposure, at the
/// times that it has in the whole one.
///
/// ```text
///   STOP      ▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▔▔▔▔▁▁▁▁▔▔▔▔   first laser cycle, the next one, …
///   CLK       ▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▁▔▁▔▁▔▁▔▁▔▁▔▁▔▁▔▁▔▁▔   `lead_periods` before it
///   SPAD_RAW  ▁▁▁▁▁▁▁▁▁▔▔▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▔▔▁▁▁▁▁▔▔▁▁▁▁▁▔▔▁   one pulse where an odd number is left out
///                     origin        at rest
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Skip {
    /// The first laser cycle that is driven.
    pub first_cycle: u32,
    /// CLK periods that are driven before it.
    pub lead_periods: u32,
}

impl Skip {
    /// Falling CLK edge with which CLK sets in.
    fn first_edge(self, exposure: &Exposure) -> i64 {
        i64::from(self.first_cycle) * i64::from(exposure.stop_periods)
            - i64::from(self.lead_periods)
    }
}

/// Everything that is driven into one sensor for one frame.
#[derive(Clone)]
pub struct StimulusPlan {
    sensor: Sensor,
    exposure: Exposure,
    stream: bitvec::vec::BitVec,
    pulses: Vec<(usize, SpadEvent)>,
    /// Where load and exposure lie in simulation time.
    pub schedule: Schedule,
    skip: Option<Skip>,
    /// In which order counts leave the pins.
    pub(crate) order: ReadoutOrder,
    is_read: bool,
}

impl StimulusPlan {
    /// Plans the load of `starts` (row-major, `cols` to a row) and an exposure with these rising edges of
    /// SPAD_RAW (one list per macropixel, in the same order, thinned by the dead time).
    pub fn new(
        sensor: impl Into<Sensor>,
        exposure: &Exposure,
        cols: usize,
        starts: &[u16],
        pulses: &[&[SpadEvent]],
    ) -> Self {
        debug_assert_eq!(starts.len(), pulses.len());
        let sensor = sensor.into();
        let stream = load_path::stream(&sensor.load_codes(starts), cols, sensor.counter_bits);
        let half = |k| LOAD_START + sensor.load_clock().half_periods(k);
        let load_end = half(2 * stream.len() as i64 + 1);
        // On a whole nanosecond, so that edges are easy to read off.
        let quiet = SETTLING + exposure.clock.period() + delay_lines(&sensor);
        let origin_ns = (load_end + quiet).as_fs() / 1_000_000 + 1;
        let origin = Time::from_ns(origin_ns);
        let last_edge = exposure.clock.half_periods(LAST_HALF_PERIODS) + exposure.end();
        let mut all: Vec<(usize, SpadEvent)> = pulses
            .iter()
            .enumerate()
            .flat_map(|(pixel, list)| list.iter().map(move |p| (pixel, *p)))
            .collect();
        all.sort_unstable_by_key(|(pixel, p)| (p.time, *pixel, p.spad));
        let counted =
            origin + last_edge + exposure.clock.period() + SETTLING + delay_lines(&sensor);
        let schedule = Schedule {
            reset_end: RESET_END,
            first_bit: half(1),
            load_end,
            origin,
            counted,
            end: counted,
        };
        StimulusPlan {
            exposure: *exposure,
            stream,
            pulses: all,
            schedule,
            skip: None,
            order: ReadoutOrder::new(&SensorConfig {
                rows: starts.len() / cols,
                cols,
                ..(*sensor).clone()
            }),
            is_read: false,
            sensor,
        }
    }

    /// The same without some laser cycles, and when the chip is at rest before the others: whatever was to be counted until then
    /// can be set. `None` if there is no time for that.
    #[must_use]
    pub(crate) fn skipping(self, skip: Skip) -> Option<(Self, Time)> {
        let resumes = self.exposure.falling(skip.first_edge(&self.exposure));
        let rest = resumes - self.exposure.clock.period();
        let settled = self.sensor.pulse_width() + SETTLING;
        (rest > settled).then(|| {
            let rest = self.schedule.origin + rest;
            let skip = Some(skip);
            (StimulusPlan { skip, ..self }, rest)
        })
    }

    /// The same, and then all counts are read through the pins.
    #[must_use]
    pub fn with_readout(mut self) -> Self {
        self.is_read = true;
        let periods = self.order.periods() as i64;
        let read = self.sensor.read_clock().periods(periods);
        self.schedule.end = self.schedule.counted + READ_SETTLING + read + SETTLING;
        self
    }

    /// In which order counts leave the pins, if they are read.
    pub fn readout(&self) -> Option<ReadoutOrder> {
        self.is_read.then_some(self.order)
    }

    /// All drives in time order.
    pub fn stimulus(&self, pins: &SensorPins) -> Stimulus<'_> {
        Stimulus::merge([
            Stimulus::new(self.control(pins)),
            load_stimulus(pins.load, self.sensor.load_clock(), &self.stream).1,
            Stimulus::new(self.clk(pins)),
            Stimulus::new(self.stop(pins)),
            Stimulus::new(self.spads(pins)),
            Stimulus::new(self.read(pins)),
        ])
    }

    fn control(&self, pins: &SensorPins) -> Vec<Drive> {
        let (config, schedule) = (&self.sensor, self.schedule);
        let mut drives = Vec::new();
        let mut drive = |time, net, value: bool| drives.push(Drive::new(time, net, value));
        let start = Time::ZERO;
        drive(start, pins.histogram_clear, true);
        drive(start, pins.enable, false);
        drive(start, pins.read.enable, false);
        drive(start, pins.read.clk, false);
        drive(start, pins.conventional, config.mode == Mode::Conventional);
        for (bit, &net) in pins.event_type.iter().enumerate() {
            drive(start, net, config.event_type.code() >> bit & 1 == 1);
        }
        for (bit, &net) in pins.threshold.iter().enumerate() {
            drive(start, net, config.threshold >> bit & 1 == 1);
        }
        for &net in &pins.spad_raw {
            drive(start, net, false);
        }
        let before = Time::from_fs((schedule.load_end + schedule.origin).as_fs() / 2);
        drive(before, pins.histogram_clear, false);
        drive(before, pins.enable, true);
        let last_cycle = self.exposure.laser_cycles as i64 - 1;
        drive(
            schedule.origin + self.exposure.stop_fall(last_cycle),
            pins.enable,
            false,
        );
        drives
    }

    fn read(&self, pins: &SensorPins) -> impl Iterator<Item = Drive> + Send + use<> {
        let clock = self.sensor.read_clock();
        let read = || {
            read_stimulus(
                &pins.read,
                clock,
                self.schedule.counted,
                self.order.periods(),
            )
        };
        self.is_read
            .then(read)
            .into_iter()
            .flat_map(|(_, read)| read)
    }

    fn clk(&self, pins: &SensorPins) -> impl Iterator<Item = Drive> + Send + use<> {
        let exposure = self.exposure;
        let origin = self.schedule.origin - exposure.stop_phase;
        let periods = exposure.laser_cycles as i64 * exposure.stop_periods as i64;
        let first = self.skip.map_or(0, |skip| skip.first_edge(&exposure));
        let edges = clock(
            pins.clk,
            exposure.clock,
            origin,
            2 * first,
            2 * periods + LAST_HALF_PERIODS + 1,
        );
        std::iter::once(Drive::new(Time::ZERO, pins.clk, true)).chain(edges)
    }

    fn stop(&self, pins: &SensorPins) -> impl Iterator<Item = Drive> + Send + use<> {
        let (exposure, origin, stop) = (self.exposure, self.schedule.origin, pins.stop);
        let last = exposure.laser_cycles as i64;
        let first = self.skip.map_or(0, |skip| i64::from(skip.first_cycle));
        let edges = (first..=last).flat_map(move |cycle| {
            let fall = if cycle == last {
                exposure.stop(cycle) + exposure.clock.periods(1)
            } else {
                exposure.stop_fall(cycle)
            };
            [
                Drive::new(origin + exposure.stop(cycle), stop, true),
                Drive::new(origin + fall, stop, false),
            ]
        });
        std::iter::once(Drive::new(Time::ZERO, stop, false)).chain(edges)
    }

    fn spads<'p>(&'p self, pins: &SensorPins) -> impl Iterator<Item = Drive> + Send + use<'p> {
        let (origin, width) = (self.schedule.origin, self.sensor.pulse_width());
        let (nets, spads) = (pins.spad_raw.clone(), self.sensor.spads());
        let end = self.schedule.counted;
        let net =
            move |(pixel, pulse): &(usize, SpadEvent)| nets[pixel * spads + pulse.spad as usize];
        let (left_out, driven) = match self.skip {
            None => (&[][..], &self.pulses[..]),
            Some(skip) => {
                let from = self.exposure.falling(skip.first_edge(&self.exposure));
                let driven = self.pulses.partition_point(|(_, pulse)| pulse.time < from);
                self.pulses.split_at(driven)
            }
        };
        let mut odd = BTreeSet::new();
        for net in left_out.iter().map(&net) {
            if !odd.insert(net) {
                odd.remove(&net);
            }
        }
        let edges = move |offset: Time, value: bool| {
            let (net, odd) = (net.clone(), odd.clone());
            let odd = odd
                .into_iter()
                .map(move |net| Drive::new(origin + offset, net, value));
            let drives = driven
                .iter()
                .map(move |pulse| Drive::new(origin + pulse.1.time + offset, net(pulse), value));
            Stimulus::new(odd.chain(drives.take_while(move |d| d.time <= end)))
        };
        Stimulus::merge([edges(Time::ZERO, true), edges(width, false)])
    }
}

/// Half CLK periods that CLK goes on after the last STOP edge.
const LAST_HALF_PERIODS: i64 = 2;
