//! Sensor files: reading, printing, and what of a sensor is possible.

use std::fmt;
use std::ops::RangeInclusive;
use std::path::Path;

use super::config::{AfterBorrow, EventType, FrontEnd, PCounter, SensorConfig, Tap, Tdc};
use super::config_keys::{KEYS, SECTION};
use super::front_end::DeadTimeTooShort;
use super::spad_grid::{SIDES, count_bits};
use super::timing::ChipTiming;
use crate::files::{InputError, read_text};
use crate::settings::{Document, Fault, Key, commented};

/// What is impossible about a sensor, and what would be possible.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SensorFault {
    /// A value that its key does not take.
    #[error("{why}")]
    Value {
        /// The key in a sensor file.
        key: String,
        /// What it takes.
        why: String,
    },
    /// Rows of SPADs that a macropixel cannot have.
    #[error("spad_rows = {0} is impossible; give 1, 2, 4 or 8")]
    SpadRows(usize),
    /// Columns of SPADs that a macropixel cannot have.
    #[error("spad_cols = {0} is impossible; give 1, 2, 4 or 8")]
    SpadCols(usize),
    /// Steps of windows that no divider makes.
    #[error("step_periods = {0} is impossible; give 1, 2, 4 or 8")]
    StepPeriods(usize),
    /// A counter without memory has no reset, which a divider needs.
    #[error(
        "step_periods = {0} is impossible with p_counter = \"memoryless\", whose divider nothing resets; give 1"
    )]
    StepsWithoutReset(usize),
    /// A threshold that the correlation block has no bits for.
    #[error("threshold = {threshold} has more bits than THRESHOLD with {lines}; give 0 to {most}")]
    Threshold {
        /// What is asked for.
        threshold: u8,
        /// What is counted.
        lines: Lines,
        /// The largest that there are bits for.
        most: u32,
    },
    /// A threshold that no number of SPADs meets.
    #[error("{0}")]
    NeverMet(NeverMet),
    /// More SPADs must fire than there are.
    #[error("coincident_spads = {asked} is impossible with {spads} SPADs; give 1 to {spads}")]
    CoincidentSpads {
        /// What is asked for.
        asked: usize,
        /// SPADs of a macropixel.
        spads: usize,
    },
    /// Delay lines have no correlation block.
    #[error(
        "{key} = {asked} is impossible with tdc = \"delay_line\", where every pulse is an edge and nothing is compared; give {only}"
    )]
    CorrelationOfDelayLine {
        /// The key.
        key: &'static str,
        /// What is asked for.
        asked: String,
        /// What is possible.
        only: &'static str,
    },
    /// Delay lines take another front end.
    #[error(
        "front_end = {:?} is impossible with tdc = \"delay_line\", whose photon line joins SPADs itself; give front_end = \"summation\"",
        .0.name()
    )]
    FrontEndOfDelayLine(FrontEnd),
    /// A comparator has no stages to tap.
    #[error(
        "tap = \"msb\" is impossible with p_counter = \"comparator\", which counts up; give tap = \"borrow\""
    )]
    TapOfComparator,
    /// A counter without memory that holds would never come round.
    #[error(
        "after_borrow = \"hold\" is impossible with p_counter = \"memoryless\", which keeps its start value by coming round; give after_borrow = \"wrap\""
    )]
    HoldWithoutMemory,
    /// SPADs are too fast for the front end.
    #[error("{0}; {cure}", cure = .0.cure())]
    DeadTime(#[from] DeadTimeTooShort),
    /// STOP rises nearer to another fall of CLK.
    #[error(
        "stop_phase_ps = {phase_ps} is impossible; give at most half a CLK period, {half_period_ps:.1}, either way"
    )]
    StopPhase {
        /// What is asked for, ps.
        phase_ps: f64,
        /// Half a CLK period, ps.
        half_period_ps: f64,
    },
}

/// What the correlation block of a sensor counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lines {
    /// Its front end.
    pub front_end: FrontEnd,
    /// Lines of SPAD_TIMED.
    pub count: usize,
}

impl fmt::Display for Lines {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.front_end.joins(), self.count) {
            (true, _) => write!(f, "the one line of front_end = {:?}", self.front_end.name()),
            (false, 1) => write!(f, "1 SPAD"),
            (false, count) => write!(f, "{count} SPADs"),
        }
    }
}

/// A condition that no number of SPADs meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NeverMet {
    /// TYPE.
    pub event_type: EventType,
    /// THRESHOLD.
    pub threshold: u8,
    /// What is counted.
    pub lines: Lines,
}

impl NeverMet {
    /// The thresholds of this type that a number from 0 to `lines` meets.
    fn possible(event_type: EventType, lines: usize) -> RangeInclusive<usize> {
        match event_type {
            EventType::Less => 1..=(1 << count_bits(lines)) - 1,
            EventType::Equal => 0..=lines,
            EventType::Greater => 0..=lines - 1,
        }
    }
}

impl fmt::Display for NeverMet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (asks, name) = match self.event_type {
            EventType::Less => ("fewer than", "less"),
            EventType::Equal => ("exactly", "equal"),
            EventType::Greater => ("more than", "greater"),
        };
        let possible = NeverMet::possible(self.event_type, self.lines.count);
        let (threshold, lines) = (self.threshold, self.lines);
        let (least, most) = possible.into_inner();
        write!(
            f,
            "threshold = {threshold} with event_type = {name:?} asks for {asks} {threshold}, which {lines} can never be; give "
        )?;
        match least == most {
            true => write!(f, "{least}"),
            false => write!(f, "{least} to {most}"),
        }
    }
}

/// CLK periods that windows may step by.
const STEPS: [usize; 4] = [1, 2, 4, 8];

impl SensorFault {
    /// The key at fault, as in a sensor file.
    pub fn key(&self) -> &str {
        match self {
            SensorFault::Value { key, .. } => key,
            SensorFault::SpadRows(_) => "spad_rows",
            SensorFault::SpadCols(_) => "spad_cols",
            SensorFault::StepPeriods(_) | SensorFault::StepsWithoutReset(_) => "step_periods",
            SensorFault::Threshold { .. } | SensorFault::NeverMet(_) => "threshold",
            SensorFault::FrontEndOfDelayLine(_) => "front_end",
            SensorFault::CorrelationOfDelayLine { key, .. } => key,
            SensorFault::CoincidentSpads { .. } => "coincident_spads",
            SensorFault::TapOfComparator => "tap",
            SensorFault::HoldWithoutMemory => "p_counter",
            SensorFault::DeadTime(_) => "dead_time_ns",
            SensorFault::StopPhase { .. } => "stop_phase_ps",
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
            faults.extend(fault.map(|fault| Fault {
                path: fault.key().to_owned(),
                message: fault.to_string(),
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
    /// The first fault found.
    pub fn check(&self) -> Result<(), SensorFault> {
        let values = toml::Table::try_from(self).expect("numbers and words");
        let fault_of = |key: &Key| {
            let why = key.fault(values.get(key.name)?)?;
            let key = key.name.to_owned();
            Some(SensorFault::Value { key, why })
        };
        if let Some(fault) = KEYS.iter().find_map(fault_of) {
            return Err(fault);
        }
        if !SIDES.contains(&self.spad_rows) {
            return Err(SensorFault::SpadRows(self.spad_rows));
        }
        if !SIDES.contains(&self.spad_cols) {
            return Err(SensorFault::SpadCols(self.spad_cols));
        }
        if !STEPS.contains(&self.step_periods) {
            return Err(SensorFault::StepPeriods(self.step_periods));
        }
        if self.front_end.joins() && self.tdc == Tdc::DelayLine {
            return Err(SensorFault::FrontEndOfDelayLine(self.front_end));
        }
        let compares = self.event_type != EventType::Greater || self.threshold > 0;
        if compares && self.tdc == Tdc::DelayLine {
            let (key, asked, only) = match self.event_type {
                EventType::Greater => ("threshold", self.threshold.to_string(), "0"),
                EventType::Less => ("event_type", "\"less\"".to_owned(), "\"greater\""),
                EventType::Equal => ("event_type", "\"equal\"".to_owned(), "\"greater\""),
            };
            return Err(SensorFault::CorrelationOfDelayLine { key, asked, only });
        }
        let asked = self.coincident_spads;
        if self.front_end == FrontEnd::Coincidence && asked > self.spads() {
            let spads = self.spads();
            return Err(SensorFault::CoincidentSpads { asked, spads });
        }
        let most = (1 << self.threshold_bits()) - 1;
        let (threshold, event_type) = (self.threshold, self.event_type);
        let lines = Lines {
            front_end: self.front_end,
            count: self.lines(),
        };
        if u32::from(threshold) > most {
            return Err(SensorFault::Threshold {
                threshold,
                lines,
                most,
            });
        }
        if !NeverMet::possible(event_type, lines.count).contains(&usize::from(threshold)) {
            return Err(SensorFault::NeverMet(NeverMet {
                event_type,
                threshold,
                lines,
            }));
        }
        if self.p_counter == PCounter::Comparator && self.tap == Tap::Msb {
            return Err(SensorFault::TapOfComparator);
        }
        if self.p_counter == PCounter::Memoryless && self.step_periods > 1 {
            return Err(SensorFault::StepsWithoutReset(self.step_periods));
        }
        if self.p_counter == PCounter::Memoryless && self.after_borrow == AfterBorrow::Hold {
            return Err(SensorFault::HoldWithoutMemory);
        }
        ChipTiming::of(self).pulses.follow(self.dead_time_ns)?;
        let half_period_ps = 0.5e12 / self.clk_hz;
        if self.stop_phase_ps.is_nan() || self.stop_phase_ps.abs() > half_period_ps {
            return Err(SensorFault::StopPhase {
                phase_ps: self.stop_phase_ps,
                half_period_ps,
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::correlation;
    use crate::netlist::Corner;
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
            ("spad_rows = 2\nspad_cols = 2\nthreshold = 8", 3),
            ("threshold = 16", 1),
            ("threshold = 17\nevent_type = \"equal\"", 1),
            ("event_type = \"less\"\nthreshold = 0", 2),
            ("front_end = \"or_tree\"\nthreshold = 1", 2),
            ("front_end = \"coincidence\"\ncoincident_spads = 17", 2),
            ("coincident_spads = 0", 1),
            ("front_end = \"and_tree\"", 1),
            ("tdc = \"delay_line\"\nfront_end = \"xor_tree\"", 2),
            ("front_end = \"or_tree\"\ndead_time_ns = 0.9", 2),
            ("spad_cols = 3", 1),
            ("step_periods = 5", 1),
            (
                "p_counter = \"memoryless\"\nafter_borrow = \"wrap\"\nstep_periods = 4",
                3,
            ),
            ("tdc = \"delay_line\"\nthreshold = 1", 2),
            (
                "\nevent_type = \"less\"\nthreshold = 3\ntdc = \"delay_line\"",
                2,
            ),
            ("clk_skew_ps = -1", 1),
            ("delay_sigma = -0.1", 1),
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
    fn a_threshold_that_can_never_be_met_is_refused_with_those_that_can() {
        for (text, says) in [
            (
                "threshold = 16",
                "threshold = 16 with event_type = \"greater\" asks for more than 16, which 16 SPADs can never be; give 0 to 15",
            ),
            (
                "threshold = 17\nevent_type = \"equal\"",
                "asks for exactly 17, which 16 SPADs can never be; give 0 to 16",
            ),
            (
                "threshold = 0\nevent_type = \"less\"",
                "asks for fewer than 0, which 16 SPADs can never be; give 1 to 31",
            ),
            (
                "threshold = 1\nfront_end = \"xor_tree\"",
                "which the one line of front_end = \"xor_tree\" can never be; give 0",
            ),
        ] {
            let error = SensorConfig::parse("s.toml", text).unwrap_err();
            assert!(error.message.ends_with(says), "{error}");
        }
        // Every other condition is one that some number of SPADs meets.
        let types = [EventType::Less, EventType::Equal, EventType::Greater];
        for (event_type, threshold) in types.into_iter().flat_map(|t| (0..32).map(move |n| (t, n)))
        {
            let config = SensorConfig {
                event_type,
                threshold,
                ..SensorConfig::default()
            };
            let is_met = |spads: u32| correlation::model((1 << spads) - 1, event_type, threshold);
            assert_eq!(config.check().is_ok(), (0..=16).any(is_met), "{config:?}");
        }
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
                    // Fewer than none are never.
                    let met = if key.name == "event_type" {
                        "\nthreshold = 1"
                    } else {
                        ""
                    };
                    SensorConfig::parse("s", &format!("{text}{met}")).unwrap();
                }
                assert!(parse("\"other\"").is_err(), "{}", key.name);
            }
            if let Range::Within(least, most) = key.range {
                // The slowest clock allows every phase.
                // The most SPADs allow every threshold, and fewer than the largest there are always.
                let with = |value: f64| {
                    let clk = match key.name {
                        "clk_hz" => "",
                        "threshold" if value > 0.0 => {
                            "spad_rows = 8\nspad_cols = 8\nevent_type = \"less\"\n"
                        }
                        _ => "clk_hz = 1e6\n",
                    };
                    SensorConfig::parse("s", &format!("{clk}{} = {value}", key.name))
                };
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
