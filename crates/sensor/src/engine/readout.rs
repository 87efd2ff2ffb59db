//! Reads histograms through the chip's pins at gate level: of a sensor that has been exposed, or of a whole array with
//! nothing but counts behind the readout.

use super::load::{load, load_netlist};
use crate::chip::readout::{ReadoutOrder, with_counts};
use crate::chip::{LoadProbe, ReadPins, ReadProbe, SensorConfig, Silicon};
use crate::kernel::{Drive, Kernel, Observer, Recorder, Statistics, Stimulus};
use crate::logic::Logic;
use crate::netlist::{NetId, Netlist};
use crate::stimulus::read_stimulus;
use crate::units::{Frequency, Time};
use bitvec::vec::BitVec;

/// Samples DATA_OUT with READ_CLK's falling edges, as whoever reads the chip does.
#[derive(Debug, Clone)]
pub struct PinSampler {
    clk: NetId,
    is_high: bool,
    /// By net: 1 more than its pin, 0 for others.
    pin: Vec<u16>,
    now: Vec<Logic>,
    values: Vec<BitVec>,
    known: Vec<BitVec>,
}

impl PinSampler {
    /// Nothing sampled yet; the pins have the values that `value` tells.
    pub fn new(netlist: &Netlist, value: impl Fn(NetId) -> Logic) -> Self {
        let pins = ReadPins::find(netlist);
        let mut pin = vec![0; netlist.net_count()];
        for (index, net) in pins.data.iter().enumerate() {
            pin[net.index()] = index as u16 + 1;
        }
        let streams = vec![BitVec::new(); pins.data.len()];
        PinSampler {
            clk: pins.clk,
            is_high: false,
            pin,
            now: pins.data.iter().map(|&net| value(net)).collect(),
            values: streams.clone(),
            known: streams,
        }
    }

    /// Bits of each pin, first one first; unknown ones are 0.
    pub fn streams(&self) -> &[BitVec] {
        &self.values
    }

    /// Counts of every macropixel and bin, row-major, bin 0 first; `None` where a bit is unknown or has not come.
    pub fn counts(&self, order: &ReadoutOrder) -> Vec<Option<u16>> {
        let all_known = ((1u32 << order.bits) - 1) as u16;
        let known = order.counts(&self.known).into_iter();
        let counts = order.counts(&self.values).into_iter().zip(known);
        counts
            .map(|(count, known)| (known == all_known).then_some(count))
            .collect()
    }
}

impl Observer for PinSampler {
    #[inline]
    fn change(&mut self, _: Time, net: NetId, value: Logic) {
        if net == self.clk {
            if self.is_high && value == Logic::Zero {
                let streams = self.values.iter_mut().zip(&mut self.known);
                for (&now, (values, known)) in self.now.iter().zip(streams) {
                    values.push(now == Logic::One);
                    known.push(now.to_bool().is_some());
                }
            }
            self.is_high = value == Logic::One;
        } else if let Some(pin) = self.pin[net.index()].checked_sub(1) {
            self.now[usize::from(pin)] = value;
        }
    }
}

/// What came out of the pins.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Readout {
    /// Counts of every macropixel and bin, row-major, bin 0 first; `None` where a bit is unknown.
    pub counts: Vec<Option<u16>>,
    /// From the rising edge of READ_CLK that brings the first bit to the end of the last bit.
    pub duration: Time,
    /// What the simulation did.
    pub statistics: Statistics,
}

/// When a readout with counts in place of histograms comes out of reset, and when it is enabled.
const RESET_END: Time = Time::from_ns(10);
pub(crate) const READ_ENABLED: Time = Time::from_ns(20);

/// Drives that put `counts` (macropixels row-major, bin 0 first) behind a readout, and bring it out of reset.
pub(crate) fn power_up(netlist: &Netlist, order: &ReadoutOrder, counts: &[u16]) -> Vec<Drive> {
    debug_assert_eq!(counts.len(), order.rows * order.cols * order.bins);
    let (pins, resetb) = (ReadPins::find(netlist), ReadProbe::ResetB.net(netlist));
    let bits = counts
        .iter()
        .flat_map(|count| (0..order.bits).map(move |bit| count >> bit & 1 == 1));
    let counts = ReadProbe::Count.bus(netlist).into_iter().zip(bits);
    let low = [pins.clk, pins.enable, resetb].map(|net| Drive::new(Time::ZERO, net, false));
    counts
        .map(|(net, bit)| Drive::new(Time::ZERO, net, bit))
        .chain(low)
        .chain([Drive::new(RESET_END, resetb, true)])
        .collect()
}

/// How long a stream took of which each bit has a rising edge of `clock`: from the first of `rises`, of which there is one at
/// least, to the end of the last one's period.
fn clocked(rises: &[Time], clock: Frequency) -> Time {
    rises[rises.len() - 1] - rises[0] + clock.period()
}

/// Reads `counts` (macropixels row-major, bin 0 first) through the pins of a readout; `observer` sees the netlist that
/// `netlist` is, one of [`readout_netlist`].
pub fn read_out(
    config: &SensorConfig,
    netlist: &Netlist,
    counts: &[u16],
    observer: &mut dyn Observer,
) -> Readout {
    let order = ReadoutOrder::new(config);
    let pins = ReadPins::find(netlist);
    let (end, read) = read_stimulus(&pins, config.read_clock(), READ_ENABLED, order.periods());
    let mut stimulus = Stimulus::sorted(power_up(netlist, &order, counts)).with_drives(read);
    let mut kernel = Kernel::new(netlist, &Silicon::new(config).timing(netlist));
    let mut sampler = PinSampler::new(netlist, |_| Logic::X);
    kernel
        .run(&mut stimulus, end, &mut (&mut sampler, observer))
        .expect("no loop of cells without delay");
    Readout {
        counts: sampler.counts(&order),
        duration: config.readout_time(),
        statistics: kernel.statistics(),
    }
}

/// The readout of this sensor with pins for counts in place of its macropixels, elaborated.
pub fn readout_netlist(config: &SensorConfig) -> Netlist {
    Netlist::elaborate(&with_counts(ReadoutOrder::new(config)))
}

/// A sensor's pins with nothing but memories and counts behind them, elaborated once for all clocks.
#[derive(Debug, Clone)]
pub struct PinNetlists {
    load: Netlist,
    read: Netlist,
}

/// What one load and one readout through the pins did, and how long they took.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PinTimes {
    /// Rising LOAD_CLK edges.
    pub load_bits: usize,
    /// Macropixels whose start value arrived.
    pub starts_right: usize,
    /// Bins whose count was read as it was put in.
    pub counts_right: usize,
    /// First to last rising LOAD_CLK edge, and a period.
    pub load: Time,
    /// First to last rising READ_CLK edge, and a period.
    pub read: Time,
}

impl PinNetlists {
    /// Those of this sensor.
    pub fn new(config: &SensorConfig) -> Self {
        PinNetlists {
            load: load_netlist(config),
            read: readout_netlist(config),
        }
    }

    /// Loads start values that are all over the counter's range, and reads `counts` (macropixels row-major, bin 0 first), with
    /// both clocks at `mhz`; `config` is that of the netlists.
    pub fn run_at(&self, mhz: u32, config: &SensorConfig, counts: &[u16]) -> PinTimes {
        let clock_hz = f64::from(mhz) * 1e6;
        let config = SensorConfig {
            load_clk_hz: clock_hz,
            read_clk_hz: clock_hz,
            ..config.clone()
        };
        let starts: Vec<u16> = (0..config.pixels() as u32)
            .map(|i| (i.wrapping_mul(2_654_435_761) >> 7) as u16 & config.largest_start())
            .collect();
        let clocks = [
            LoadProbe::Clk.net(&self.load),
            ReadProbe::Clk.net(&self.read),
        ];
        let mut edges = clocks.map(|clock| Recorder::new([clock]));
        let loaded = load(&config, &self.load, &starts, &mut edges[0]);
        let read = read_out(&config, &self.read, counts, &mut edges[1]);
        let [load_rises, read_rises] = [0, 1].map(|i| edges[i].rising_edges(clocks[i]));
        let right = |found: &[Option<u16>], sent: &[u16]| {
            let pairs = found.iter().zip(sent);
            pairs.filter(|(a, b)| **a == Some(**b)).count()
        };
        PinTimes {
            load_bits: load_rises.len(),
            starts_right: right(&loaded.starts, &starts),
            counts_right: right(&read.counts, counts),
            load: clocked(&load_rises, config.load_clock()),
            read: clocked(&read_rises, config.read_clock()),
        }
    }
}

/// A count in one of 97 bins of the whole array, macropixels row-major: zeros shift as fast as anything, and cost nothing to
/// simulate.
pub fn sparse_counts(config: &SensorConfig) -> Vec<u16> {
    let mut counts = vec![0; config.pixels() * config.bins];
    for index in (0..counts.len()).step_by(97) {
        counts[index] = (index % (1 << config.bin_bits)) as u16;
    }
    counts
}
