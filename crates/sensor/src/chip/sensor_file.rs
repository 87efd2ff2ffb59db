//! Sensor files: reading, printing, and checking that a sensor is possible.

use std::fmt;
use std::ops::RangeInclusive;

use super::config::{AfterBorrow, EventType, FrontEnd, Mode, PCounter, SensorConfig, Tap, Tdc};
use super::front_end::DeadTimeTooShort;
use super::own_block::CONTRACTS;
use super::timing::ChipTiming;
use super::timing::cell_library::CellLibrary;
use super::timing::library_files::{library_files, library_setting};
use super::timing::silicon::Silicon;
use crate::files::{InputError, placed};
use crate::photon::{SIDES, count_bits};
use crate::settings::{Document, Fault, Key, Notes, Section, Settings, commented, remarks, schema};

/// What is impossible about a sensor, and what would be possible.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
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
        "step_periods = {steps} is impossible with p_counter = {:?}, whose divider nothing resets; give 1",
        .p_counter.name()
    )]
    StepsWithoutReset {
        /// What is asked for.
        steps: usize,
        /// The counter.
        p_counter: PCounter,
    },
    /// A threshold that the correlation block has no bits for.
    #[error("threshold = {threshold} has more bits than THRESHOLD with {lines}; give 0 to {most}")]
    Threshold {
        /// What is asked for.
        threshold: u8,
        /// What is counted.
        lines: CorrelationLines,
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
    /// What this TDC has no place for.
    #[error("{key} = {asked} is impossible with tdc = {:?}, {why}; give {only}", .tdc.name())]
    NotWithTdc {
        /// The key.
        key: &'static str,
        /// What is asked for.
        asked: String,
        /// The TDC.
        tdc: Tdc,
        /// What it does instead.
        why: &'static str,
        /// What is possible.
        only: &'static str,
    },
    /// Delay lines take another front end.
    #[error(
        "front_end = {:?} is impossible with tdc = \"delay_line\", whose photon line joins SPADs itself; give front_end = \"summation\"",
        .0.name()
    )]
    FrontEndOfDelayLine(FrontEnd),
    /// No bit of the count can be LOCAL_STOP.
    #[error(
        "tap = \"msb\" is impossible with p_counter = {:?}, which {why}; give tap = \"borrow\"",
        .p_counter.name()
    )]
    NoMsb {
        /// The counter.
        p_counter: PCounter,
        /// What it does instead.
        why: &'static str,
    },
    /// A counter without memory that holds would never come round.
    #[error(
        "after_borrow = \"hold\" is impossible with p_counter = {:?}, which keeps its start value by coming round; give after_borrow = \"wrap\"",
        .0.name()
    )]
    HoldWithoutMemory(PCounter),
    /// A cell library that cannot be used.
    #[error("{why}")]
    Liberty {
        /// The key at fault.
        key: &'static str,
        /// What is wrong with it.
        why: String,
    },
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
pub struct CorrelationLines {
    /// Its front end.
    pub front_end: FrontEnd,
    /// Lines of SPAD_TIMED.
    pub count: usize,
}

impl fmt::Display for CorrelationLines {
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
    pub lines: CorrelationLines,
}

impl NeverMet {
    /// The thresholds of this type that a number from 0 to `lines` meets.
    pub(crate) fn possible(event_type: EventType, lines: usize) -> RangeInclusive<usize> {
        match event_type {
            EventType::Less => 1..=(1 << count_bits(lines)) - 1,
            EventType::Equal => 0..=lines,
            EventType::Greater => 0..=lines - 1,
        }
    }
}

impl fmt::Display for NeverMet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let asks = match self.event_type {
            EventType::Less => "fewer than",
            EventType::Equal => "exactly",
            EventType::Greater => "more than",
        };
        let name = self.event_type.name();
        let possible = NeverMet::possible(self.event_type, self.lines.count);
        let (threshold, lines) = (self.threshold, self.lines);
        let (least, most) = possible.into_inner();
        write!(
            f,
            "threshold = {threshold} with event_type = {name:?} asks for {asks} {threshold}, which {lines} can never be; give "
        )?;
        if least == most {
            write!(f, "{least}")
        } else {
            write!(f, "{least} to {most}")
        }
    }
}

/// CLK periods that windows may step by.
const STEPS: [usize; 4] = [1, 2, 4, 8];

impl SensorFault {
    /// The key at fault, as in a sensor file.
    pub(crate) fn key(&self) -> &str {
        match self {
            SensorFault::Value { key, .. } => key,
            SensorFault::SpadRows(_) => "spad_rows",
            SensorFault::SpadCols(_) => "spad_cols",
            SensorFault::StepPeriods(_) | SensorFault::StepsWithoutReset { .. } => "step_periods",
            SensorFault::Threshold { .. } | SensorFault::NeverMet(_) => "threshold",
            SensorFault::FrontEndOfDelayLine(_) => "front_end",
            SensorFault::NotWithTdc { key, .. } | SensorFault::Liberty { key, .. } => key,
            SensorFault::CoincidentSpads { .. } => "coincident_spads",
            SensorFault::NoMsb { .. } => "tap",
            SensorFault::HoldWithoutMemory(_) => "p_counter",
            SensorFault::DeadTime(_) => "dead_time_ns",
            SensorFault::StopPhase { .. } => "stop_phase_ps",
        }
    }
}

impl SensorConfig {
    /// The one section of a sensor file.
    pub const SECTION: Section = Section {
        name: "",
        what: "A sensor; keys that are left out are the QuantIC4x4's",
        keys: SensorConfig::KEYS,
    };

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
        let read = document.section::<Self>("", &document.table, &mut faults);
        let mut config: Self = read.try_into().unwrap_or_default();
        for file in [
            &mut config.liberty,
            &mut config.liberty_slow,
            &mut config.liberty_fast,
        ] {
            let files = library_files(file).into_iter();
            *file = library_setting(files.map(|file| placed(&document.folder, &file)));
        }
        // A library that cannot be read is complained of below.
        let library = CellLibrary::from_config(&config).ok();
        let library = library.and_then(CellLibrary::from_file);
        let library = library.map(|read| &read.liberty);
        for contract in &CONTRACTS {
            if let Some(block) = (contract.own_mut)(&mut config)
                && let Err(message) = block.load(&document.folder, library)
            {
                let path = contract.key.to_owned();
                faults.push(Fault { path, message });
            }
        }
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

    /// Sentences on values that are probably in another unit than their key has, and on start values that a P-counter of one's own does not serve.
    pub fn remarks(&self) -> Vec<String> {
        let of_units = remarks(&[Self::SECTION], &self.table());
        let silent = self.counter_law().and_then(|law| law.silent_in_words());
        let silent = silent.map(|codes| {
            format!("its P-counter never raises LOCAL_STOP with COUNTER_INIT {codes}; no window opens from these")
        });
        of_units.into_iter().chain(silent).collect()
    }

    /// What there is to know of a key of a sensor file, if it is one.
    pub fn key(name: &str) -> Option<Key> {
        Self::KEYS.iter().find(|key| key.name == name).copied()
    }

    /// The configuration as a commented file, which [`SensorConfig::parse`] reads back.
    pub fn commented(&self) -> String {
        self.commented_with(&Notes::default())
    }

    /// As [`SensorConfig::commented`], with reasons for values, which [`Sensor::built_in_notes`](super::Sensor::built_in_notes) has.
    pub fn commented_with(&self, notes: &Notes) -> String {
        let left_out = Self::default().table();
        commented(&[Self::SECTION], &self.table(), &left_out, notes)
    }

    /// All values as a TOML table.
    pub(super) fn table(&self) -> toml::Table {
        toml::Table::try_from(self).expect("numbers and words")
    }

    /// The JSON schema of a sensor file.
    pub fn schema() -> serde_json::Value {
        let table = toml::Table::try_from(Self::default()).expect("numbers and words");
        schema("A sensor of gdtof", &[Self::SECTION], &table)
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
        if let Some(fault) = Self::KEYS.iter().find_map(fault_of) {
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
        let tdc = self.tdc;
        if compares && tdc != Tdc::Clocked {
            let (key, asked, only) = match self.event_type {
                EventType::Greater => ("threshold", self.threshold.to_string(), "0"),
                EventType::Less => ("event_type", "\"less\"".to_owned(), "\"greater\""),
                EventType::Equal => ("event_type", "\"equal\"".to_owned(), "\"greater\""),
            };
            let why = match tdc {
                Tdc::Counter => "which counts all SPADs that fire and compares nothing",
                _ => "where every pulse is an edge and nothing is compared",
            };
            return Err(SensorFault::NotWithTdc {
                key,
                asked,
                tdc,
                why,
                only,
            });
        }
        if tdc == Tdc::Counter {
            self.check_counter_tdc()?;
        }
        let asked = self.coincident_spads;
        if self.spads_of_an_event() > self.spads() {
            let spads = self.spads();
            return Err(SensorFault::CoincidentSpads { asked, spads });
        }
        let most = (1 << self.threshold_bits()) - 1;
        let (threshold, event_type) = (self.threshold, self.event_type);
        let lines = CorrelationLines {
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
        let (p_counter, variant) = (self.p_counter, self.p_counter.row());
        if let (Some(why), Tap::Msb) = (variant.no_msb, self.tap) {
            return Err(SensorFault::NoMsb { p_counter, why });
        }
        if !variant.has_memory && self.step_periods > 1 {
            let steps = self.step_periods;
            return Err(SensorFault::StepsWithoutReset { steps, p_counter });
        }
        if !variant.has_memory && self.after_borrow == AfterBorrow::Hold {
            return Err(SensorFault::HoldWithoutMemory(p_counter));
        }
        for contract in &CONTRACTS {
            contract.check(self).map_err(|why| {
                let key = contract.key.to_owned();
                SensorFault::Value { key, why }
            })?;
        }
        let library = CellLibrary::from_config(self)
            .map_err(|(key, why)| SensorFault::Liberty { key, why })?;
        Silicon::at_temperature(library, self).map_err(|why| SensorFault::Liberty {
            key: "temperature_c",
            why: why.to_string(),
        })?;
        ChipTiming::new(self).pulses.follow(self)?;
        let half_period_ps = 0.5e12 / self.clk_hz;
        if self.stop_phase_ps.is_nan() || self.stop_phase_ps.abs() > half_period_ps {
            return Err(SensorFault::StopPhase {
                phase_ps: self.stop_phase_ps,
                half_period_ps,
            });
        }
        Ok(())
    }

    /// Whether a counter TDC has a place for the rest.
    fn check_counter_tdc(&self) -> Result<(), SensorFault> {
        let tdc = Tdc::Counter;
        if self.mode == Mode::Conventional {
            return Err(SensorFault::NotWithTdc {
                key: "mode",
                asked: "\"conventional\"".to_owned(),
                tdc,
                why: "which remembers nothing of the CLK periods before STOP",
                only: "\"guided\"",
            });
        }
        let own = [
            ("correlation_block", &self.correlation_block),
            ("metdc_block", &self.metdc_block),
            ("histogram_block", &self.histogram_block),
        ];
        let replaced = own.into_iter().find(|(_, own)| own.is_some());
        replaced.map_or(Ok(()), |(key, _)| {
            let why = format!(
                "{key} is impossible with tdc = \"counter\", whose blocks have other ports; leave it out"
            );
            let key = key.to_owned();
            Err(SensorFault::Value { key, why })
        })
    }
}

#[cfg(test)]
mod tests;
