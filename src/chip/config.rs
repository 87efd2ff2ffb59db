//! Sensor configuration: what a user may set of the chip. What of it is possible says `sensor_file`; what a file leaves out
//! is the QuantIC4x4's (`sensors/quantic4x4`).

use serde::{Deserialize, Serialize};

use super::blocks::metdc_delay_line::Elements;
use super::blocks::readout::ReadoutOrder;
use super::spad_grid::{SpadGrid, count_bits};
use crate::netlist::Corner;
use crate::units::{Frequency, Time};

/// TYPE: how the number of fired SPADs is compared with THRESHOLD.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EventType {
    /// Fewer SPADs than THRESHOLD. True of an empty pixel in every CLK period.
    Less,
    /// Exactly THRESHOLD SPADs.
    Equal,
    /// More SPADs than THRESHOLD.
    Greater,
}

impl EventType {
    /// TYPE\<1:0\> as the correlation block decodes it.
    pub const fn code(self) -> u8 {
        match self {
            EventType::Less => 0,
            EventType::Equal => 1,
            EventType::Greater => 2,
        }
    }
}

/// What a full histogram bin does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Overflow {
    /// Stays full.
    Saturate,
    /// Starts again from zero.
    Wrap,
}

/// Which edge freezes the METDC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Each macropixel's own LOCAL_STOP (thesis 4.3).
    Guided,
    /// The global STOP: the last CLK periods of the laser cycle (thesis 4.2).
    Conventional,
}

/// How the pulses of a macropixel's SPADs become SPAD_TIMED (thesis 2.4.1, Fig. 22).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FrontEnd {
    /// A toggle flip-flop and samplers for each SPAD, whose events the correlation block sums up (Fig. 22d).
    Summation,
    /// Pulse shapers and an OR tree (Fig. 22a).
    OrTree,
    /// Toggle flip-flops and an XOR tree (Fig. 22b).
    XorTree,
    /// Pulse shapers, and an event where so many SPADs as the sensor says fire within a shaped pulse (Fig. 22c).
    Coincidence,
}

impl FrontEnd {
    /// Every variant, the sensor's own first.
    pub const ALL: [FrontEnd; 4] = [
        FrontEnd::Summation,
        FrontEnd::OrTree,
        FrontEnd::XorTree,
        FrontEnd::Coincidence,
    ];

    /// Name in sensor files and tables.
    pub const fn name(self) -> &'static str {
        match self {
            FrontEnd::Summation => "summation",
            FrontEnd::OrTree => "or_tree",
            FrontEnd::XorTree => "xor_tree",
            FrontEnd::Coincidence => "coincidence",
        }
    }

    /// Whether all SPADs share one line, whose edges depend on more than one SPAD.
    pub const fn joins(self) -> bool {
        !matches!(self, FrontEnd::Summation)
    }
}

/// How the P-counter is built (thesis 4.4). All have the same pins. All but the last open the same time windows where the
/// counter holds after LOCAL_STOP. Where it wraps, LOCAL_STOP comes again after 2ⁿ⁺¹ counts of a counter of n bits with
/// its borrow, and after 2ⁿ of one without: of the comparator, and of all with the tap `msb`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PCounter {
    /// Ripple down counter of reset-only flip-flops, Q or Q̄ chosen by the memory bit (Fig. 51c, 53).
    Ripple,
    /// Ripple down counter of set/reset flip-flops and a delayed reset (Fig. 51b), the HSLIDAR's (4.9.2).
    SetReset,
    /// Synchronous down counter (Fig. 50a).
    Synchronous,
    /// Up counter from zero and a comparator (Fig. 49a).
    Comparator,
    /// Ripple down counter without memory, loaded once, never reset: it comes round with STOP (4.4.3).
    Memoryless,
}

impl PCounter {
    /// Every variant, the sensor's own first.
    pub const ALL: [PCounter; 5] = [
        PCounter::Ripple,
        PCounter::SetReset,
        PCounter::Synchronous,
        PCounter::Comparator,
        PCounter::Memoryless,
    ];

    /// Name in sensor files and tables.
    pub const fn name(self) -> &'static str {
        match self {
            PCounter::Ripple => "ripple",
            PCounter::SetReset => "set_reset",
            PCounter::Synchronous => "synchronous",
            PCounter::Comparator => "comparator",
            PCounter::Memoryless => "memoryless",
        }
    }
}

/// Where the P-counter's LOCAL_STOP comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Tap {
    /// One stage more than is programmed: it rises when the counter rolls over past zero.
    Borrow,
    /// The most significant programmed bit, as the thesis has it (4.5). It is high from the reset on for start
    /// values of 2ⁿ⁻¹ and more.
    Msb,
}

/// What the P-counter does once LOCAL_STOP has risen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AfterBorrow {
    /// Waits for the next reset: LOCAL_STOP blocks COUNTER_CLK.
    #[default]
    Hold,
    /// Counts on, and raises LOCAL_STOP again whenever it comes round.
    Wrap,
}

/// What times photons within a window (thesis 4.9.3, Table 10).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tdc {
    /// A shift register that CLK clocks: bins are CLK periods.
    #[default]
    Clocked,
    /// Delay lines, whose elements are the bins. SPADs come together in a tree of XORs, so that TYPE and THRESHOLD have
    /// nothing to compare.
    DelayLine,
}

/// A sensor, as its TOML file describes it. Keys that are left out take the QuantIC4x4's value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorConfig {
    /// Macropixel rows, 1…256.
    pub rows: usize,
    /// Macropixel columns, 1…256.
    pub cols: usize,
    /// Rows of a macropixel's SPADs: 1, 2, 4 or 8.
    pub spad_rows: usize,
    /// Columns of a macropixel's SPADs: 1, 2, 4 or 8.
    pub spad_cols: usize,
    /// How pulses of SPADs become SPAD_TIMED: summation, or_tree, xor_tree or coincidence. All but the first join SPADs on one
    /// line, and are run by the gate engine.
    pub front_end: FrontEnd,
    /// SPADs that must fire within a shaped pulse for an event, from 1; of the front end coincidence.
    pub coincident_spads: usize,
    /// Programmable bits of the P-counter, 2…12.
    pub counter_bits: usize,
    /// How the P-counter is built: ripple, set_reset, synchronous, comparator or memoryless.
    pub p_counter: PCounter,
    /// Where LOCAL_STOP comes from, borrow or msb; the comparator has no msb.
    pub tap: Tap,
    /// What the P-counter does after LOCAL_STOP, hold or wrap; without memory it must wrap.
    pub after_borrow: AfterBorrow,
    /// CLK periods from a start value's window to the next one's: 1, 2, 4 or 8; without memory 1.
    pub step_periods: usize,
    /// What times photons: clocked or delay_line.
    pub tdc: Tdc,
    /// Control voltage of the delay lines, V ([`SensorConfig::delay_element`]).
    pub delay_control_v: f64,
    /// How the elements of the delay lines differ: standard deviation relative to the mean, 0…0.25.
    pub delay_sigma: f64,
    /// Which chip, of those whose elements differ.
    pub delay_seed: u32,
    /// How much later CLK and STOP come to each column of macropixels than to the one left of it, ps.
    pub clk_skew_ps: f64,
    /// Histogram bins, 1…64.
    pub bins: usize,
    /// Bits of each bin, 1…16.
    pub bin_bits: usize,
    /// CLK frequency, Hz; its period is one histogram bin where the TDC is clocked.
    pub clk_hz: f64,
    /// Rise of STOP after the falling edge of CLK, ps; at most half a CLK period either way.
    pub stop_phase_ps: f64,
    /// Deserialiser clock, Hz (thesis 4.7: “a few hundred megahertz”).
    pub load_clk_hz: f64,
    /// Whether the sensor must be reset, and stand still, before windows are written (thesis 4.9.5, Table 11).
    pub reset_to_load: bool,
    /// Pins through which histograms leave, each with a serialiser for its share of the columns, 1…256; no more are used than
    /// there are columns.
    pub readout_pins: usize,
    /// Serialiser clock, Hz.
    pub read_clk_hz: f64,
    /// SPAD dead time and width of a SPAD_RAW pulse, ns; no shorter than the front end follows, and longer than a CLK
    /// period if no photons are to cancel.
    pub dead_time_ns: f64,
    /// Whether a photon during the dead time begins it anew.
    pub paralysable: bool,
    /// Chance that an avalanche has an afterpulse, 0…1.
    pub afterpulse_probability: f64,
    /// Time constant of afterpulses after the dead time, ns.
    pub afterpulse_time_ns: f64,
    /// Chance that an avalanche fires one of its SPAD's four neighbours, 0…1.
    pub crosstalk_probability: f64,
    /// TYPE.
    pub event_type: EventType,
    /// THRESHOLD, SPADs, or lines of a front end that joins them: one that TYPE can meet.
    pub threshold: u8,
    /// What full bins do.
    pub overflow: Overflow,
    /// Which STOP counts.
    pub mode: Mode,
    /// Delay corner of the cell library: slow, typ or fast.
    pub corner: Corner,
}

impl SensorConfig {
    /// CLK. The configuration must have passed [`SensorConfig::check`].
    pub fn clock(&self) -> Frequency {
        Frequency::from_hz_f64(self.clk_hz).expect("checked")
    }

    /// Deserialiser clock. The configuration must have passed [`SensorConfig::check`].
    pub fn load_clock(&self) -> Frequency {
        Frequency::from_hz_f64(self.load_clk_hz).expect("checked")
    }

    /// Serialiser clock. The configuration must have passed [`SensorConfig::check`].
    pub fn read_clock(&self) -> Frequency {
        Frequency::from_hz_f64(self.read_clk_hz).expect("checked")
    }

    /// Rise of STOP after CLK's fall.
    pub fn stop_phase(&self) -> Time {
        Time::from_s(self.stop_phase_ps * 1e-12)
    }

    /// SPAD dead time.
    pub fn dead_time(&self) -> Time {
        Time::from_s(self.dead_time_ns * 1e-9)
    }

    /// Largest start value, 2ⁿ − 1.
    pub fn largest_start(&self) -> u16 {
        ((1u32 << self.counter_bits) - 1) as u16
    }

    /// The SPADs of a macropixel. The configuration must have passed [`SensorConfig::check`].
    pub fn spad_grid(&self) -> SpadGrid {
        SpadGrid::new(self.spad_rows, self.spad_cols)
    }

    /// SPADs of a macropixel.
    pub fn spads(&self) -> usize {
        self.spad_rows * self.spad_cols
    }

    /// Lines of SPAD_TIMED, which the correlation block counts: one a SPAD, or one for all.
    pub fn lines(&self) -> usize {
        match self.front_end.joins() {
            false => self.spads(),
            true => 1,
        }
    }

    /// SPADs that must fire together to raise a line of SPAD_TIMED.
    pub fn spads_of_an_event(&self) -> usize {
        match self.front_end {
            FrontEnd::Coincidence => self.coincident_spads,
            FrontEnd::Summation | FrontEnd::OrTree | FrontEnd::XorTree => 1,
        }
    }

    /// Bits of THRESHOLD.
    pub fn threshold_bits(&self) -> usize {
        count_bits(self.lines())
    }

    /// k, where windows step by 2ᵏ CLK periods. The configuration must have passed [`SensorConfig::check`].
    pub fn step_bits(&self) -> u32 {
        self.step_periods.trailing_zeros()
    }

    /// Delay of a delay line's element on average, in typical silicon: T_DL of Table 10.
    ///
    /// The thesis says that no formula leads from control voltage to delay (6.3.1), and gives none of its measurements. Here the
    /// voltage drives transistors that starve the elements' current: the alpha-power law with α = 1.3 and a threshold of
    /// 0.40 V, as for the other cells, and 0.70 V for the 2.6 ns that the demonstrator had.
    pub fn delay_element(&self) -> Time {
        const REFERENCE_V: f64 = 0.70;
        const REFERENCE_S: f64 = 2.6e-9;
        const THRESHOLD_V: f64 = 0.40;
        const ALPHA: f64 = 1.3;
        let overdrive = (self.delay_control_v - THRESHOLD_V) / (REFERENCE_V - THRESHOLD_V);
        Time::from_s(REFERENCE_S * libm::pow(overdrive, -ALPHA))
    }

    /// The elements of its delay lines.
    pub(super) fn delay_elements(&self) -> Elements {
        Elements {
            mean_fs: self.delay_element().as_fs() as u32,
            sigma: self.delay_sigma,
            seed: self.delay_seed.into(),
        }
    }

    /// Delay of the wires that bring CLK and STOP to a column of macropixels, in the typical corner. What they take in the
    /// sensor's silicon is [`Sensor::clk_skew`](super::Sensor::clk_skew).
    pub fn clk_wire(&self, col: usize) -> Time {
        Time::from_s(self.clk_skew_ps * 1e-12 * col as f64)
    }

    /// Macropixels.
    pub fn pixels(&self) -> usize {
        self.rows * self.cols
    }

    /// Bits of one serial load (thesis 4.7: 36.9 kbit).
    pub fn load_bits(&self) -> usize {
        self.pixels() * self.counter_bits
    }

    /// Bits of all histograms.
    pub fn histogram_bits(&self) -> usize {
        self.pixels() * self.bins * self.bin_bits
    }

    /// Time of one readout.
    pub fn readout_time(&self) -> Time {
        let periods = ReadoutOrder::of(self).periods();
        self.read_clock().periods(periods as i64)
    }

    /// Time of one serial load.
    pub fn load_time(&self) -> Time {
        self.load_clock()
            .half_periods(2 * self.load_bits() as i64 + 1)
    }

    /// Time from one frame to the next one with windows of its own, of an exposure that ends `exposed` after it began: the load
    /// goes on while the frame before is exposed and read out, and is hidden behind them, unless the sensor has to be reset for
    /// it (thesis 4.9.5). Guide and ranging take none of it.
    pub fn frame_time(&self, exposed: Time) -> Time {
        let counted = exposed + self.readout_time();
        match self.reset_to_load {
            true => counted + self.load_time(),
            false => counted.max(self.load_time()),
        }
    }
}
