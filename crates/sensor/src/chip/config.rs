//! Sensor configuration: what a user may set. `sensor_file` checks that it is possible. Keys that a file leaves out
//! are those of the QuantIC4x4.

use std::path::PathBuf;

use super::blocks::metdc_delay_line::Elements;
use super::own_block::block::OwnBlock;
use crate::netlist::{Conditions, Corner};
use crate::photon::{DeadTimeLaw, MOST_SPADS, MOST_SPREAD, SpadGrid, SpadModel, count_bits};
use crate::settings::Range::{Above, OneOf, Within};
use crate::settings::{keys, words};
use crate::units::{BOLTZMANN_EV_PER_K, Frequency, Time, ZERO_CELSIUS_K};

pub use super::blocks::{front_end::variants::FrontEnd, p_counter::variants::PCounter};

words! {
    /// TYPE: how the number of fired SPADs is compared with THRESHOLD.
    pub enum EventType {
        /// Fewer SPADs than THRESHOLD. True of an empty pixel in every CLK period.
        Less = "less",
        /// Exactly THRESHOLD SPADs.
        Equal = "equal",
        /// More SPADs than THRESHOLD.
        Greater = "greater",
    }
}

impl EventType {
    /// TYPE\<1:0\> as the correlation block decodes it: they are declared in its order.
    pub(crate) const fn code(self) -> u8 {
        self as u8
    }
}

words! {
    /// What a full histogram bin does.
    pub enum Overflow {
        /// Stays full.
        Saturate = "saturate",
        /// Starts again from zero.
        Wrap = "wrap",
    }
}

words! {
    /// Which edge freezes the METDC.
    pub enum Mode {
        /// Each macropixel's own LOCAL_STOP (thesis 4.3).
        Guided = "guided",
        /// The global STOP: the last CLK periods of the laser cycle (thesis 4.2).
        Conventional = "conventional",
    }
}

words! {
    /// Where the P-counter's LOCAL_STOP comes from.
    pub enum Tap {
        /// One stage more than is programmed: it rises when the counter rolls over past zero.
        Borrow = "borrow",
        /// The most significant programmed bit, as the thesis has it (4.5). It is high from the reset on for start
        /// values of 2ⁿ⁻¹ and more.
        Msb = "msb",
    }
}

words! {
    /// What the P-counter does once LOCAL_STOP has risen.
    #[derive(Default)]
    pub enum AfterBorrow {
        /// Waits for the next reset: LOCAL_STOP blocks COUNTER_CLK.
        #[default]
        Hold = "hold",
        /// Counts on, and raises LOCAL_STOP again whenever it comes round.
        Wrap = "wrap",
    }
}

words! {
    /// What times photons within a window (thesis 4.9.3, Table 10).
    #[derive(Default)]
    pub enum Tdc {
        /// A shift register that CLK clocks: bins are CLK periods, and count one event in each.
        #[default]
        Clocked = "clocked",
        /// A counter of CLK periods: bins are CLK periods, and add up the SPADs that fire in each, so that TYPE and THRESHOLD have nothing
        /// to compare.
        Counter = "counter",
        /// Delay lines, whose elements are the bins. SPADs come together in a tree of XORs, so that TYPE and THRESHOLD have
        /// nothing to compare.
        DelayLine = "delay_line",
    }
}

impl Tdc {
    /// Whether bins are CLK periods.
    pub fn has_clk_bins(self) -> bool {
        self != Tdc::DelayLine
    }
}

const CHIP: &str = "the QuantIC4x4, thesis Table 11";

keys! {
    /// A sensor, as its TOML file describes it. Keys that are left out take the QuantIC4x4's value.
    pub struct SensorConfig {
        /// Macropixel rows.
        rows: usize = 64, in Within(1.0, 256.0), from CHIP;
        /// Macropixel columns.
        cols: usize = 64, in Within(1.0, 256.0), from CHIP;
        /// Rows of a macropixel's SPADs: 1, 2, 4 or 8.
        spad_rows: usize = 4, in Within(1.0, 8.0), from "thesis 4.2";
        /// Columns of a macropixel's SPADs: 1, 2, 4 or 8.
        spad_cols: usize = 4, in Within(1.0, 8.0), from "thesis 4.2";
        /// How SPADs' pulses become events; all but the first join them on one line, for the gate engine.
        front_end: FrontEnd = FrontEnd::Summation, from "thesis 2.4.1, Fig. 22";
        /// SPADs that must fire together with front_end = "coincidence".
        coincident_spads: usize = 2, in Within(1.0, MOST_SPADS as f64);
        /// Programmable bits of the P-counter.
        counter_bits: usize = 9, in Within(2.0, 12.0), from "thesis 4.5";
        /// How the P-counter is built.
        p_counter: PCounter = PCounter::Ripple, from "thesis 4.4, Fig. 53";
        /// Netlist that takes the P-counter's place: JSON of Yosys, as FILE or FILE:MODULE.
        ///
        /// Relative to the sensor file.
        #[serde(skip_serializing_if = "Option::is_none")]
        p_counter_block: Option<OwnBlock> = None, from "none: the built-in p_counter";
        /// Bit that LOCAL_STOP comes from; the comparator has no msb.
        tap: Tap = Tap::Borrow,
            from "chosen: the thesis's msb (4.5) is high from the reset on for start values of 2^(n-1) and more";
        /// What the P-counter does after LOCAL_STOP; without memory it must wrap.
        after_borrow: AfterBorrow = AfterBorrow::Hold, from "thesis 4.5";
        /// CLK periods from a start value's window to the next one's: 1, 2, 4 or 8; without memory 1.
        step_periods: usize = 1, in Within(1.0, 8.0), from "thesis 4.9.3, Table 10";
        /// Buffers of the delay chain that sets the width of COUNTER_RESET; 0 takes as many as the cells need, at least 6.
        reset_stages: usize = 0, in Within(0.0, 1000.0), from "chosen: the pulse outlasts what it resets by a tenth";
        /// What times photons: a shift register, with bins of CLK periods, a counter, whose bins add up all SPADs that fire in a CLK period, or
        /// delay lines, whose elements are the bins and on which photons of a bin cancel in pairs.
        tdc: Tdc = Tdc::Clocked,
            from "thesis 4.2 and 4.9.3, Table 10; how a counter adds and that photons cancel are chosen";
        /// Control voltage of the delay lines: 0.7 V makes elements of 2.6 ns.
        ///
        /// [`SensorConfig::delay_element`] is the law.
        delay_control_v: f64 ["V"] = 0.70, in Within(0.5, 1.1),
            from "chosen: the thesis has the delay, not the voltage (6.3.1)";
        /// How the delay lines' elements differ, relative to their mean.
        ///
        /// Their standard deviation.
        delay_sigma: f64 = 0.154, in Within(0.0, 0.25),
            from "thesis 6.3.1, Fig. 91: 0.4 ns of 2.6 ns";
        /// Number of the chip, which decides how its elements differ.
        delay_seed: u32 = 1, in Within(0.0, u32::MAX as f64);
        /// How much later CLK and STOP come to each column than to the one left of it.
        clk_skew_ps: f64 ["ps"] = 0.0, in Within(0.0, 200.0),
            from "chosen: Fig. 90 shows it without a scale";
        /// Histogram bins.
        bins: usize = 16, in Within(1.0, 64.0), from CHIP;
        /// Bits of each bin.
        bin_bits: usize = 14, in Within(1.0, 16.0), from CHIP;
        /// CLK frequency; its period is one histogram bin, unless delay lines are.
        clk_hz: f64 ["Hz"] = 384e6, in Within(1e6, 2e9), from "thesis 4.8";
        /// Rise of STOP after the falling edge of CLK; at most half a CLK period either way.
        stop_phase_ps: f64 ["ps"] = 0.0, in Within(-5e5, 5e5);
        /// Deserialiser clock.
        load_clk_hz: f64 ["Hz"] = 200e6, in Within(1e6, 1e9),
            from "thesis 4.7, a few hundred megahertz";
        /// Whether the sensor must be reset and idle before windows are written.
        reset_to_load: bool = false, from "thesis 4.9.5, Table 11: no, but HSLIDAR must";
        /// Pins through which histograms leave, each with a serialiser for its share of the columns.
        ///
        /// No more are used than there are columns.
        readout_pins: usize = 8, in Within(1.0, 256.0);
        /// Serialiser clock.
        read_clk_hz: f64 ["Hz"] = 200e6, in Within(1e6, 1e9),
            from "chosen: that of the deserialiser";
        /// SPAD dead time and width of a SPAD_RAW pulse.
        ///
        /// No shorter than the front end follows, and longer than a CLK period if no photons are to cancel.
        dead_time_ns: f64 ["ns"] = 8.0, in Above(0.0, 1e6), usually (0.5, 2000.0);
        /// Standard deviation of the SPADs' dead times over the array, relative to their mean; each is Gaussian, cut off at four of them.
        ///
        /// SPAD_RAW pulses are as wide as the shortest dead time. For the engines window, gate and cycle.
        dead_time_spread: f64 = 0.0, in Within(0.0, MOST_SPREAD),
            from "none in the thesis";
        /// Seed that decides which SPAD has which dead time.
        dead_time_seed: u32 = 1, in Within(0.0, 4_294_967_295.0);
        /// Whether a photon during the dead time restarts it.
        paralysable: bool = false;
        /// Probability that a photon's or dark count's avalanche has an afterpulse, which has none itself.
        afterpulse_probability: f64 = 0.0, in Within(0.0, 1.0), from "chosen: none";
        /// Time constant of afterpulses after the dead time.
        afterpulse_time_ns: f64 ["ns"] = 5.0, in Within(0.0, 1e6), usually (0.1, 1e4);
        /// Activation energy of the traps behind afterpulses: with the junction's temperature their time constant falls, and more are released within the dead time.
        ///
        /// At 50 degC, probability and time constant are those given.
        afterpulse_activation_ev: f64 ["eV"] = 0.0, in Within(0.0, 2.0),
            from "none in the thesis; Cova, Lacaita and Ripamonti, IEEE EDL 12 (1991) 685";
        /// Probability that a photon's or dark count's avalanche fires one of its SPAD's four neighbours, which fires no others.
        crosstalk_probability: f64 = 0.0, in Within(0.0, 1.0), from "chosen: none";
        /// Netlist that takes the correlation block's place, as p_counter_block; for the engines gate and cycle.
        #[serde(skip_serializing_if = "Option::is_none")]
        correlation_block: Option<OwnBlock> = None, from "none: the built-in correlation";
        /// Netlist that takes the front end's place, as correlation_block.
        #[serde(skip_serializing_if = "Option::is_none")]
        front_end_block: Option<OwnBlock> = None, from "none: the built-in front_end";
        /// Netlist that takes the METDC's place, as correlation_block.
        #[serde(skip_serializing_if = "Option::is_none")]
        metdc_block: Option<OwnBlock> = None, from "none: the built-in METDC";
        /// Netlist that takes the histogram's place, as correlation_block.
        #[serde(skip_serializing_if = "Option::is_none")]
        histogram_block: Option<OwnBlock> = None, from "none: the built-in histogram";
        /// TYPE: how the number of fired SPADs is compared with THRESHOLD.
        event_type: EventType = EventType::Greater, from "thesis 4.2";
        /// THRESHOLD: SPADs; at most 31 with 4x4 of them.
        ///
        /// Lines of a front end that joins SPADs. One that TYPE can meet.
        threshold: u8 = 0, in Within(0.0, ((1 << count_bits(MOST_SPADS)) - 1) as f64),
            from "chosen: any photon counts";
        /// What a full bin does.
        overflow: Overflow = Overflow::Saturate;
        /// Which STOP counts: each macropixel's own, or the global one.
        mode: Mode = Mode::Guided, from "thesis 4.3 and 4.2";
        /// Silicon corner of the cells' delays; min and max mean fast and slow.
        corner: Corner = Corner::Typ, in OneOf(&["slow", "typ", "fast"]);
        /// Junction temperature, to which delays belong; 25 K above the scene's lidar.temperature_c, if left out.
        #[serde(skip_serializing_if = "Option::is_none")]
        temperature_c: Option<f64> ["C"] = None, in Within(-55.0, 150.0),
            from "chosen: 50 degC, where the built-in cells are characterised";
        /// Cell library, a Liberty file (.lib or .lib.gz) or the files of one kit separated by commas, instead of the built-in delays;
        /// without one in the slow and fast corner only corner = "typ" is possible.
        liberty: PathBuf = PathBuf::new(), from "chosen: the built-in cells, which take the thesis's 1.2 ns (4.6)";
        /// The library in the slow corner.
        liberty_slow: PathBuf = PathBuf::new(), from "chosen: none";
        /// The library in the fast corner.
        liberty_fast: PathBuf = PathBuf::new(), from "chosen: none";
        /// Cells of the library to take for a kind, "DFFR=NAME, INV=NAME", instead of those of least area and the drive that
        /// the load asks for.
        liberty_cells: String = String::new(), from "chosen: none";
        /// Slew of a macropixel's inputs with a library; 0 is that of its smallest inverter which drives four of its kind.
        input_slew_ps: f64 ["ps"] = 0.0, in Within(0.0, 1e5), usually (0.5, 1e4);
        /// Capacitance of wires with a library, for each pin that a net leads to.
        wire_ff: f64 ["fF"] = 0.0, in Within(0.0, 1e4), usually (0.01, 1000.0), from "chosen: pins only, as before layout";
    }
}

/// The largest `afterpulse_time_ns`, s.
const LONGEST_AFTERPULSE_S: f64 = 1e-3;

impl SensorConfig {
    /// CLK. The configuration must have passed [`SensorConfig::check`].
    pub fn clock(&self) -> Frequency {
        Frequency::from_hz_f64(self.clk_hz).expect("checked")
    }

    /// Where its cells are operated: in typical silicon, at their own supply.
    pub fn conditions(&self) -> Conditions {
        let usual = Conditions::default();
        Conditions {
            temperature_c: self.temperature_c.unwrap_or(usual.temperature_c),
            ..usual
        }
    }

    /// Afterpulses of the SPADs at the junction's temperature: their probability after an avalanche, and their time constant, s.
    ///
    /// A trap releases its carrier after a time that is exponential with the constant τ ~ exp(E/kT) (Cova, Lacaita and Ripamonti, IEEE Electron
    /// Device Letters 12 (1991) 685). Of N carriers that an avalanche traps, N exp(−d/τ) outlast the dead time d. N stays what the keys say
    /// at 50 °C; τ is at most the longest that can be given.
    pub fn afterpulses(&self) -> (f64, f64) {
        let (given, time_s) = (self.afterpulse_probability, self.afterpulse_time_ns * 1e-9);
        let inverse = |celsius: f64| 1.0 / (BOLTZMANN_EV_PER_K * (celsius + ZERO_CELSIUS_K));
        let (own, usual) = (self.conditions(), Conditions::default());
        let colder = inverse(own.temperature_c) - inverse(usual.temperature_c);
        let exponent = self.afterpulse_activation_ev * colder;
        if exponent == 0.0 || time_s == 0.0 {
            return (given, time_s);
        }
        let warm_s = (time_s * libm::exp(exponent)).min(LONGEST_AFTERPULSE_S);
        let dead_s = self.dead_time().as_s();
        let left = libm::exp(dead_s / time_s - dead_s / warm_s);
        ((given * left).min(1.0), warm_s)
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

    /// SPAD dead time, the mean of the array.
    pub fn dead_time(&self) -> Time {
        Time::from_s(self.dead_time_ns * 1e-9)
    }

    /// Width of SPAD_RAW pulses: the shortest dead time of the array.
    pub fn pulse_width(&self) -> Time {
        self.spad_model().shortest_dead_time()
    }

    /// How the SPADs answer to photons. The configuration must have passed [`SensorConfig::check`].
    pub fn spad_model(&self) -> SpadModel {
        let (afterpulse_probability, afterpulse_time_s) = self.afterpulses();
        SpadModel {
            grid: self.spad_grid(),
            dead_time: self.dead_time(),
            dead_time_spread: self.dead_time_spread,
            dead_time_seed: self.dead_time_seed,
            law: if self.paralysable {
                DeadTimeLaw::Paralysable
            } else {
                DeadTimeLaw::NonParalysable
            },
            afterpulse_probability,
            afterpulse_time: Time::from_s(afterpulse_time_s),
            crosstalk_probability: self.crosstalk_probability,
        }
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

    /// k, where windows step by 2ᵏ CLK periods. The configuration must have passed [`SensorConfig::check`].
    pub(crate) fn step_bits(&self) -> u32 {
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
            mean: self.delay_element(),
            sigma: self.delay_sigma,
            seed: self.delay_seed.into(),
        }
    }

    /// Delay of the wires that bring CLK and STOP to a column of macropixels, in the typical corner. What they take in the
    /// sensor's silicon is [`Sensor::clk_skew`](super::Sensor::clk_skew).
    pub(crate) fn clk_wire(&self, col: usize) -> Time {
        Time::from_s(self.clk_skew_ps * 1e-12 * col as f64)
    }

    /// Macropixels.
    pub fn pixels(&self) -> usize {
        self.rows * self.cols
    }

    /// Row and column of a macropixel, by its number in the array, row-major.
    pub(crate) fn position(&self, number: usize) -> (usize, usize) {
        (number / self.cols, number % self.cols)
    }

    /// Bits of one serial load (thesis 4.7: 36.9 kbit).
    pub fn load_bits(&self) -> usize {
        self.pixels() * self.counter_bits
    }

    /// Bits of all histograms.
    pub fn histogram_bits(&self) -> usize {
        self.pixels() * self.bins * self.bin_bits
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half and twice the overdrive of 0.70 V, at the alpha-power law's 2.46.
    #[test]
    fn a_delay_element_is_slower_the_less_its_control_voltage() {
        for (delay_control_v, delay_ps) in [(0.55, 6_402.0), (0.70, 2_600.0), (1.0, 1_055.9)] {
            let config = SensorConfig {
                delay_control_v,
                ..SensorConfig::default()
            };
            let found_ps = config.delay_element().as_s() * 1e12;
            assert!(
                (found_ps / delay_ps - 1.0).abs() < 1e-4,
                "{delay_control_v} V: {found_ps}"
            );
        }
    }
}
