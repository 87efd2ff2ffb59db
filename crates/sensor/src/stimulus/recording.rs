//! Recorded stimuli: start values and SPAD events from CSV files.
//!
//! * Start values: header `row,col,init`, one line for every macropixel.
//! * Events: header `time_fs,row,col,spad`, rising edges of SPAD_RAW in any order. Time 0 is the first rising
//!   edge of STOP. A pulse lasts the dead time; an event within it makes no edge and is dropped, as is
//!   one at or after the end of the exposure.

use std::collections::HashMap;
use std::io::BufRead;
use std::path::Path;

use crate::chip::{Exposure, SensorConfig};
use crate::files::{InputError, Lines};
use crate::photon::{SpadEvent, apply_dead_time};
use crate::units::Time;

/// Start values of an array, row-major.
///
/// # Errors
/// Unreadable files, malformed lines, pixels outside the array, values beyond 2ⁿ − 1, duplicated or
/// missing macropixels: file, line and cure.
pub fn read_starts(path: &Path, config: &SensorConfig) -> Result<Vec<u16>, InputError> {
    starts_of(Lines::open(path)?, config)
}

/// As [`read_starts`], from text; `source` names it in complaints.
///
/// # Errors
/// As [`read_starts`].
#[cfg(test)]
pub(crate) fn parse_starts(
    source: &str,
    text: &str,
    config: &SensorConfig,
) -> Result<Vec<u16>, InputError> {
    starts_of(Lines::new(source, text.as_bytes()), config)
}

fn starts_of<R: BufRead>(lines: Lines<R>, config: &SensorConfig) -> Result<Vec<u16>, InputError> {
    let mut starts = vec![None; config.pixels()];
    let mut first_line = HashMap::new();
    let source = &lines.source.to_owned();
    for row in rows(lines, ["row", "col", "init"])? {
        let (line, [r, c, init]) = row?;
        let pixel = pixel_index(source, line, r, c, config)?;
        if init < 0 || init > config.largest_start() as i64 {
            let message = format!(
                "start value {init} does not fit the {}-bit P-counter; give 0 to {}",
                config.counter_bits,
                config.largest_start()
            );
            return Err(InputError::at_line(source, line, message));
        }
        if let Some(before) = first_line.insert(pixel, line) {
            let message = format!(
                "macropixel ({r}, {c}) already has a start value in line {before}; remove one of them"
            );
            return Err(InputError::at_line(source, line, message));
        }
        starts[pixel] = Some(init as u16);
    }
    if let Some(pixel) = starts.iter().position(Option::is_none) {
        let (r, c) = config.position(pixel);
        let message = format!(
            "macropixel ({r}, {c}) has no start value; add a line for it or shrink the array (rows, cols)"
        );
        return Err(InputError::new(source, message));
    }
    Ok(starts.into_iter().flatten().collect())
}

/// SPAD pulses of an array as the chip sees them.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Recording {
    /// Pulses of every macropixel, row-major, sorted by time and thinned by the dead time.
    pub pulses: Vec<Vec<SpadEvent>>,
    /// Events read.
    pub read: u64,
    /// Events within the pulse of an earlier one.
    pub lost_to_dead_time: u64,
    /// Events at or after the end of the exposure.
    pub after_the_end: u64,
}

impl Recording {
    /// Of events in any order, each with the number of its macropixel, row-major.
    ///
    /// # Panics
    /// When the array has no such macropixel.
    pub fn from_events(
        events: impl IntoIterator<Item = (usize, SpadEvent)>,
        config: &SensorConfig,
        exposure: &Exposure,
    ) -> Self {
        let mut recording = Recording::empty(config);
        for (pixel, event) in events {
            recording.push(pixel, event, exposure);
        }
        recording.settle(config);
        recording
    }

    fn empty(config: &SensorConfig) -> Self {
        Recording {
            pulses: vec![Vec::new(); config.pixels()],
            ..Recording::default()
        }
    }

    fn push(&mut self, pixel: usize, event: SpadEvent, exposure: &Exposure) {
        self.read += 1;
        if event.time >= exposure.end() {
            self.after_the_end += 1
        } else {
            self.pulses[pixel].push(event)
        }
    }

    /// Sorts what was pushed, and drops what falls into dead times.
    fn settle(&mut self, config: &SensorConfig) {
        let spads = config.spad_model();
        for (pixel, pulses) in (0..).zip(&mut self.pulses) {
            pulses.sort_unstable();
            self.lost_to_dead_time += apply_dead_time(pulses, &spads, pixel);
        }
    }
}

/// Recorded SPAD events of an array.
///
/// # Errors
/// Unreadable files, malformed lines, pixels or SPADs that do not exist, events before time 0: file, line
/// and cure.
pub fn read_events(
    path: &Path,
    config: &SensorConfig,
    exposure: &Exposure,
) -> Result<Recording, InputError> {
    events_of(Lines::open(path)?, config, exposure)
}

/// As [`read_events`], from text; `source` names it in complaints.
///
/// # Errors
/// As [`read_events`].
#[cfg(test)]
pub(crate) fn parse_events(
    source: &str,
    text: &str,
    config: &SensorConfig,
    exposure: &Exposure,
) -> Result<Recording, InputError> {
    events_of(Lines::new(source, text.as_bytes()), config, exposure)
}

fn events_of<R: BufRead>(
    lines: Lines<R>,
    config: &SensorConfig,
    exposure: &Exposure,
) -> Result<Recording, InputError> {
    let source = &lines.source.to_owned();
    let mut recording = Recording::empty(config);
    for row in rows(lines, ["time_fs", "row", "col", "spad"])? {
        let (line, [time_fs, r, c, spad]) = row?;
        let pixel = pixel_index(source, line, r, c, config)?;
        if !(0..config.spads() as i64).contains(&spad) {
            let message = format!(
                "SPAD {spad} does not exist; give 0 to {}",
                config.spads() - 1
            );
            return Err(InputError::at_line(source, line, message));
        }
        if time_fs < 0 {
            let message = format!(
                "an event at {time_fs} fs is before time 0, the first rising edge of STOP; shift or remove it"
            );
            return Err(InputError::at_line(source, line, message));
        }
        let event = SpadEvent::new(Time::from_fs(time_fs), spad as u8);
        recording.push(pixel, event, exposure);
    }
    recording.settle(config);
    Ok(recording)
}

fn pixel_index(
    source: &str,
    line: usize,
    row: i64,
    col: i64,
    config: &SensorConfig,
) -> Result<usize, InputError> {
    let inside = |at: i64, size: usize| (0..size as i64).contains(&at);
    if inside(row, config.rows) && inside(col, config.cols) {
        return Ok(row as usize * config.cols + col as usize);
    }
    let message = format!(
        "macropixel ({row}, {col}) is outside the {}x{} array; give rows 0 to {} and columns 0 to {}",
        config.rows,
        config.cols,
        config.rows - 1,
        config.cols - 1
    );
    Err(InputError::at_line(source, line, message))
}

/// Line number and numbers of every line of a table with this header. Blank lines and lines that start with
/// `#` are passed over.
fn rows<R: BufRead, const N: usize>(
    mut lines: Lines<R>,
    header: [&'static str; N],
) -> Result<impl Iterator<Item = Result<(usize, [i64; N]), InputError>>, InputError> {
    let expected = header.join(",");
    let source = lines.source.to_owned();
    match lines.next_used()? {
        Some((_, found)) if found.split(',').map(str::trim).eq(header) => {}
        Some((line, found)) => {
            let found: String = found.chars().take(80).collect();
            let message = format!("the header is {found:?}; it must be \"{expected}\"");
            return Err(InputError::at_line(source, line, message));
        }
        None => {
            let message = format!("the file is empty; start it with the header \"{expected}\"");
            return Err(InputError::new(source, message));
        }
    }
    let row = move |line: usize, content: &str| {
        let mut values = [0; N];
        let mut fields = content.split(',').map(str::trim);
        for (value, name) in values.iter_mut().zip(header) {
            let Some(field) = fields.next() else {
                let message = format!("{name} is missing; a line needs \"{expected}\"");
                return Err(InputError::at_line(&source, line, message));
            };
            *value = field.parse().map_err(|_| {
                let field: String = field.chars().take(80).collect();
                let message = format!("{name} is {field:?}; write a whole number");
                InputError::at_line(&source, line, message)
            })?;
        }
        match fields.next() {
            None => Ok((line, values)),
            Some(_) => {
                let message = format!("too many values; a line needs \"{expected}\"");
                Err(InputError::at_line(&source, line, message))
            }
        }
    };
    Ok(std::iter::from_fn(move || match lines.next_used() {
        Ok(None) => None,
        Ok(Some((line, content))) => Some(row(line, content)),
        Err(error) => Some(Err(error)),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn config() -> SensorConfig {
        SensorConfig {
            rows: 2,
            cols: 2,
            ..SensorConfig::default()
        }
    }

    fn exposure() -> Exposure {
        Exposure::new(&config(), 100, 10)
    }

    #[test]
    fn events_in_memory_are_recorded_as_those_of_a_file() {
        let text = "time_fs,row,col,spad\n500,1,0,3\n100,1,0,3\n100,0,1,2\n99999999999,0,0,0\n";
        let read = parse_events("e", text, &config(), &exposure()).unwrap();
        let events = [
            (2, 500, 3),
            (2, 100, 3),
            (1, 100, 2),
            (0, 99_999_999_999, 0),
        ];
        let events = events.map(|(pixel, fs, spad)| {
            let time = Time::from_fs(fs);
            (pixel, SpadEvent { time, spad })
        });
        assert_eq!(Recording::from_events(events, &config(), &exposure()), read);
        assert_eq!((read.lost_to_dead_time, read.after_the_end), (1, 1));
    }

    const FOUR: &str = "row,col,init\n0,0,1\n0,1,2\n1,0,3\n1,1,4\n";

    #[test]
    fn start_values_come_row_major() {
        assert_eq!(parse_starts("i", FOUR, &config()).unwrap(), [1, 2, 3, 4]);
    }

    #[test]
    fn bad_start_values_are_named_with_their_line() {
        for (text, line) in [
            ("", None),
            ("row,col\n", Some(1)),
            ("row,col,init\n0,0,512\n", Some(2)),
            ("row,col,init\n0,0,1\n\n0,2,1\n", Some(4)),
            ("row,col,init\n0,0,1\n0,0,2\n", Some(3)),
            ("row,col,init\n0,0,1\n", None),
            ("row,col,init\n0,0,x\n", Some(2)),
            ("row,col,init\n0,0\n", Some(2)),
            ("row,col,init\n0,0,-1\n", Some(2)),
        ] {
            let error = parse_starts("inits.csv", text, &config()).unwrap_err();
            assert_eq!(error.line, line, "{text:?}: {error}");
            assert!(error.message.contains(';'), "no cure: {error}");
        }
    }

    #[test]
    fn bad_events_are_named_with_their_line() {
        for (text, line) in [
            ("time_fs,row,col,spad\n-1,0,0,0\n", 2),
            ("time_fs,row,col,spad\n5,0,0,16\n", 2),
            ("time_fs,row,col,spad\n5,0,0,1\n5,9,0,1\n", 3),
            ("time_fs,row,col,spad\n99999999999999999999,0,0,1\n", 2),
            ("time,row,col,spad\n", 1),
        ] {
            let error = parse_events("events.csv", text, &config(), &exposure()).unwrap_err();
            assert_eq!(error.line, Some(line), "{text:?}: {error}");
        }
    }

    #[test]
    fn events_are_sorted_thinned_and_cut() {
        let text =
            "time_fs,row,col,spad\n9000000,0,1,3\n500,0,1,3\n600,0,1,3\n9000000000000,0,0,0\n";
        let recording = parse_events("e", text, &config(), &exposure()).unwrap();
        let times: Vec<i64> = recording.pulses[1].iter().map(|p| p.time.as_fs()).collect();
        assert_eq!(times, [500, 9_000_000]);
        assert_eq!(
            (
                recording.read,
                recording.lost_to_dead_time,
                recording.after_the_end
            ),
            (4, 1, 1)
        );
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in "(time_fs,row,col,spad\n|row,col,init\n)?[-0-9,\n\"#x \\PC]{0,120}") {
            let _ = parse_starts("g", &text, &config());
            let _ = parse_events("g", &text, &config(), &exposure());
        }
    }
}
