//! Sensor configuration: what a user may set of the chip, and what of it is possible.
//!
//! The defaults are the guided QuantIC4x4 (thesis 4.2, 4.8, Table 11): 64×64 macropixels, a 9-bit
//! P-counter, 16 bins of 14 bits, 384 MHz.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::config_keys::{KEYS, SECTION};
use super::timing::ChipTiming;
use crate::files::{InputError, read_text};
use crate::netlist::Corner;
use crate::settings::{Document, Fault, Key, commented};
use crate::units::{Frequency, Time};

/// Bits of THRESHOLD: enough for "more than all sixteen SPADs".
pub const THRESHOLD_BITS: usize = 5;

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

/// A sensor, as its TOML file describes it. Keys that are left out take the QuantIC4x4's value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorConfig {
    /// Macropixel rows, 1…256.
    pub rows: usize,
    /// Macropixel columns, 1…256.
    pub cols: usize,
    /// Programmable bits of the P-counter, 2…12.
    pub counter_bits: usize,
    /// How the P-counter is built: ripple, set_reset, synchronous, comparator or memoryless.
    pub p_counter: PCounter,
    /// Where LOCAL_STOP comes from, borrow or msb; the comparator has no msb.
    pub tap: Tap,
    /// What the P-counter does after LOCAL_STOP, hold or wrap; without memory it must wrap.
    pub after_borrow: AfterBorrow,
    /// Histogram bins, 1…64.
    pub bins: usize,
    /// Bits of each bin, 1…16.
    pub bin_bits: usize,
    /// CLK frequency, Hz; its period is one histogram bin.
    pub clk_hz: f64,
    /// Rise of STOP after the falling edge of CLK, ps; at most half a CLK period either way.
    pub stop_phase_ps: f64,
    /// Deserialiser clock, Hz (thesis 4.7: "a few hundred megahertz").
    pub load_clk_hz: f64,
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
    /// THRESHOLD, 0…31 SPADs.
    pub threshold: u8,
    /// What full bins do.
    pub overflow: Overflow,
    /// Which STOP counts.
    pub mode: Mode,
    /// Delay corner of the cell library: slow, typ or fast.
    pub corner: Corner,
}

impl Default for SensorConfig {
    fn default() -> Self {
        SensorConfig {
            rows: 64,
            cols: 64,
            counter_bits: 9,
            p_counter: PCounter::Ripple,
            tap: Tap::Borrow,
            after_borrow: AfterBorrow::Hold,
            bins: 16,
            bin_bits: 14,
            clk_hz: 384e6,
            stop_phase_ps: 0.0,
            load_clk_hz: 200e6,
            dead_time_ns: 8.0,
            paralysable: false,
            afterpulse_probability: 0.0,
            afterpulse_time_ns: 5.0,
            crosstalk_probability: 0.0,
            event_type: EventType::Greater,
            threshold: 0,
            overflow: Overflow::Saturate,
            mode: Mode::Guided,
            corner: Corner::Typ,
        }
    }
}

impl SensorConfig {
    /// Reads and checks a TOML file.
    ///
    /// # Errors
    /// One sentence naming file, line and cure.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Self::parse(path.display(), &read_text(path)?)
    }

    /// Parses and checks TOML text; `source` names it in complaints.
    ///
    /// # Errors
    /// Unknown keys, wrong types and impossible values, with their line.
    pub fn parse(source: impl std::fmt::Display, text: &str) -> Result<Self, InputError> {
        Self::read_document(&Document::parse(source, text)?)
    }

    /// Reads and checks a document.
    ///
    /// # Errors
    /// Unknown keys, wrong types and impossible values, all of them at once.
    pub fn read_document(document: &Document) -> Result<Self, InputError> {
        let mut faults = Vec::new();
        let nothing = toml::Table::new();
        let given = document.table();
        let read = document.section::<Self>("", given, KEYS, &nothing, &mut faults);
        let config: Self = read.try_into().unwrap_or_default();
        if faults.is_empty() {
            let fault = config.check().err();
            faults.extend(fault.map(|(key, message)| Fault {
                path: key.into(),
                message,
            }));
        }
        document.complain(faults)?;
        Ok(config)
    }

    /// The configuration as a commented file, which [`SensorConfig::parse`] reads back.
    pub fn commented(&self) -> String {
        let table = |config: &Self| toml::Table::try_from(config).expect("numbers and words");
        commented(&[SECTION], &table(self), &table(&Self::default()))
    }

    /// Checks every value; on failure names the key at fault and says what it may be.
    ///
    /// # Errors
    /// The key and a sentence about it.
    pub fn check(&self) -> Result<(), (&'static str, String)> {
        let values = toml::Table::try_from(self).expect("numbers and words");
        let fault_of = |key: &Key| Some((key.name, key.fault(values.get(key.name)?)?));
        if let Some(fault) = KEYS.iter().find_map(fault_of) {
            return Err(fault);
        }
        if self.p_counter == PCounter::Comparator && self.tap == Tap::Msb {
            let message = "tap = \"msb\" is impossible with p_counter = \"comparator\", which counts up; give tap = \"borrow\"";
            return Err(("tap", message.to_owned()));
        }
        if self.p_counter == PCounter::Memoryless && self.after_borrow == AfterBorrow::Hold {
            let message = "after_borrow = \"hold\" is impossible with p_counter = \"memoryless\", which keeps its start value by coming round; give after_borrow = \"wrap\"";
            let key = "p_counter";
            return Err((key, message.to_owned()));
        }
        if let Some(message) = ChipTiming::of(self).pulses.complaint(self.dead_time_ns) {
            return Err(("dead_time_ns", message));
        }
        let half_period_ps = 0.5e12 / self.clk_hz;
        if self.stop_phase_ps.is_nan() || self.stop_phase_ps.abs() > half_period_ps {
            let message = format!(
                "stop_phase_ps = {} is impossible; give at most half a CLK period, {half_period_ps:.1}, either way",
                self.stop_phase_ps
            );
            return Err(("stop_phase_ps", message));
        }
        Ok(())
    }

    /// CLK. The configuration must have passed [`SensorConfig::check`].
    pub fn clock(&self) -> Frequency {
        Frequency::from_hz_f64(self.clk_hz).expect("checked")
    }

    /// Deserialiser clock. The configuration must have passed [`SensorConfig::check`].
    pub fn load_clock(&self) -> Frequency {
        Frequency::from_hz_f64(self.load_clk_hz).expect("checked")
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

    /// Macropixels.
    pub fn pixels(&self) -> usize {
        self.rows * self.cols
    }

    /// Bits of one serial load (thesis 4.7: 36.9 kbit).
    pub fn load_bits(&self) -> usize {
        self.pixels() * self.counter_bits
    }

    /// Time of one serial load.
    pub fn load_time(&self) -> Time {
        self.load_clock()
            .half_periods(2 * self.load_bits() as i64 + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Range;
    use proptest::prelude::*;

    #[test]
    fn the_default_sensor_loads_in_a_few_hundred_microseconds() {
        let config = SensorConfig::default();
        assert_eq!(config.load_bits(), 36_864);
        let us = config.load_time().as_s() * 1e6;
        assert!((100.0..400.0).contains(&us), "{us}");
    }

    #[test]
    fn impossible_values_are_refused_with_their_line() {
        for (text, line) in [
            ("cols = 4\nrows = 0", 2),
            ("clk_hz = 0", 1),
            ("clk_hz = nan", 1),
            ("\n\ndead_time_ns = -1.0", 3),
            ("\n\ndead_time_ns = 8e-9", 3),
            ("corner = \"slow\"\ndead_time_ns = 0.15", 2),
            ("stop_phase_ps = 2e3", 1),
            ("threshold = 32", 1),
            ("colour = 1", 1),
            ("rows = -3", 1),
            ("afterpulse_probability = 1.1", 1),
            ("crosstalk_probability = -0.1", 1),
            ("afterpulse_time_ns = inf", 1),
            ("event_type = \"more\"", 1),
            ("p_counter = \"grey\"", 1),
            ("p_counter = \"comparator\"\ntap = \"msb\"", 2),
            ("\np_counter = \"memoryless\"", 2),
        ] {
            let error = SensorConfig::parse("s.toml", text).unwrap_err();
            assert_eq!(error.line, Some(line), "{text}: {error}");
            assert!(error.message.contains(';'), "no cure: {error}");
        }
    }

    #[test]
    fn a_dead_time_below_what_the_front_end_follows_is_refused_with_what_was_meant() {
        for (text, says) in [
            ("dead_time_ns = 8e-9", "did you mean 8 (ns)?"),
            ("dead_time_ns = 0.01", "did you mean 10 (ns)?"),
            (
                "dead_time_ns = 0.11",
                "give at least 0.1104; did you mean 110 (ns)?",
            ),
        ] {
            let error = SensorConfig::parse("s.toml", text).unwrap_err();
            assert!(error.message.contains(says), "{error}");
        }
        assert!(SensorConfig::parse("s.toml", "dead_time_ns = 0.1104").is_ok());
    }

    #[test]
    fn delay_files_names_of_corners_are_understood() {
        for (name, corner) in [
            ("min", Corner::Fast),
            ("typ", Corner::Typ),
            ("max", Corner::Slow),
        ] {
            let config = SensorConfig::parse("s.toml", &format!("corner = {name:?}")).unwrap();
            assert_eq!(config.corner, corner);
            assert_eq!(name.parse(), Ok(corner));
            let again = format!("corner = {:?}", corner.name());
            assert_eq!(SensorConfig::parse("s.toml", &again).unwrap(), config);
            assert!(toml::to_string(&config).unwrap().contains(&again));
        }
    }

    #[test]
    fn a_printed_configuration_reads_back() {
        let config = SensorConfig::default();
        let text = toml::to_string(&config).unwrap();
        assert_eq!(SensorConfig::parse("default", &text).unwrap(), config);
        assert_eq!(
            SensorConfig::parse("default", &config.commented()).unwrap(),
            config
        );
    }

    #[test]
    fn every_key_is_explained_and_has_its_range() {
        let text = SensorConfig::default().commented();
        let table = toml::Table::try_from(SensorConfig::default()).unwrap();
        let mut known: Vec<&str> = KEYS.iter().map(|key| key.name).collect();
        known.sort_unstable();
        assert!(table.keys().eq(&known), "{known:?}");
        for key in KEYS {
            assert!(
                !key.what.is_empty() && !key.source.is_empty(),
                "{}",
                key.name
            );
            let line = format!("{} = {}", key.name, table[key.name]);
            assert!(text.lines().any(|l| l == line), "{line}");
            // Units stand in names, too.
            let suffix = format!("_{}", key.unit.to_lowercase());
            assert!(
                key.unit.is_empty() || key.name.ends_with(&suffix),
                "{}",
                key.name
            );
            let parse = |value: &str| SensorConfig::parse("s", &format!("{} = {value}", key.name));
            if let Range::OneOf(words) = key.range {
                for word in words {
                    let text = format!("after_borrow = \"wrap\"\n{} = \"{word}\"", key.name);
                    let text = if key.name == "after_borrow" {
                        &text[22..]
                    } else {
                        &text[..]
                    };
                    SensorConfig::parse("s", text).unwrap();
                }
                assert!(parse("\"other\"").is_err(), "{}", key.name);
            }
            if let Range::Within(least, most) = key.range {
                // The slowest clock allows every phase.
                let clk = if key.name == "clk_hz" {
                    ""
                } else {
                    "clk_hz = 1e6\n"
                };
                let with =
                    |value| SensorConfig::parse("s", &format!("{clk}{} = {value}", key.name));
                for value in [least, most] {
                    with(value).unwrap();
                }
                for value in [least - 1.0, most + 1.0] {
                    assert!(with(value).is_err(), "{} = {value}", key.name);
                }
            }
        }
    }

    #[test]
    fn numbers_may_have_units_and_all_faults_are_told() {
        let config = SensorConfig::parse("s", "clk_hz = \"300 MHz\"\ndead_time_ns = \"9500 ps\"");
        let config = config.unwrap();
        assert_eq!((config.clk_hz, config.dead_time_ns), (300e6, 9.5));
        let text = "rows = 0\nclk_hz = \"8 ns\"\ncolour = 1\nbins = 2.5\nmode = 3\n";
        let error = SensorConfig::parse("s.toml", text).unwrap_err();
        let told = error.to_string();
        let lines: Vec<&str> = told.lines().collect();
        assert_eq!(lines.len(), 5, "{told}");
        for (line, says) in [
            "s.toml:1: rows = 0 is impossible; give 1 to 256",
            "s.toml:2: clk_hz = \"8 ns\" is a time; give a frequency",
            "s.toml:3: unknown field `colour`",
            "s.toml:4: bins: ",
            "s.toml:5: mode: ",
        ]
        .iter()
        .enumerate()
        {
            assert!(lines[line].starts_with(says), "{told}");
        }
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in "\\PC{0,200}") {
            let _ = SensorConfig::parse("garbage", &text);
        }

        #[test]
        fn any_numbers_are_accepted_or_refused(clk: f64, phase: f64, dead: f64, rows: u16) {
            let text = format!("rows = {rows}\nclk_hz = {clk:e}\nstop_phase_ps = {phase:e}\ndead_time_ns = {dead:e}");
            if let Ok(config) = SensorConfig::parse("numbers", &text) {
                config.clock();
                config.dead_time();
                config.stop_phase();
            }
        }
    }
}
