//! Logs of the ams TMF8820, TMF8821 and TMF8828 with histograms switched on.
//!
//! ```text
//!   #Raw,<sub-capture>,<line>,<128 bytes>       line 0 to 29: a line of 0 begins a capture
//!
//!   line     0 to 9        low bytes of the reference (0) and of channels 1 to 9
//!           10 to 19       middle bytes
//!           20 to 29       high bytes
//! ```
//!
//! Other lines, as `#Obj`, are passed over. A capture without all thirty lines is left out and counted. Source: the log of the maker's
//! Arduino driver, as its users read it.

use std::path::Path;

use femtogate::InputError;

use super::{ZoneCounts, ZoneHistograms};
use crate::files::input::read_text;

const CHANNELS: usize = 10;

/// Three bytes a count.
const LINES: usize = 3 * CHANNELS;

/// Reads a log.
pub(super) fn read(path: &Path) -> Result<ZoneHistograms, InputError> {
    let text = read_text(path)?;
    let mut found = ZoneHistograms {
        bins: 0,
        captures: Vec::new(),
        cut_short: 0,
    };
    // Line by line, for as long as they follow each other.
    let mut lines: Vec<Vec<u32>> = Vec::new();
    let mut is_lost = false;
    for (number, line) in text.lines().enumerate() {
        let Some(rest) = line.trim().strip_prefix("#Raw,") else {
            continue;
        };
        let complain = |message: String| InputError::at_line(path.display(), 1 + number, message);
        let cells: Vec<&str> = rest
            .split(',')
            .map(str::trim)
            .filter(|c| !c.is_empty())
            .collect();
        let cured = "give the line as the sensor's driver wrote it, or remove it";
        let index = cells.get(1).and_then(|cell| cell.parse::<usize>().ok());
        let Some(index) = index.filter(|index| *index < LINES) else {
            return Err(complain(format!(
                "has no line number from 0 to {}; {cured}",
                LINES - 1
            )));
        };
        let bytes = cells[2..].iter().map(|cell| {
            let byte = cell.parse::<u8>();
            byte.map(u32::from)
                .map_err(|_| complain(format!("has `{cell}`, no byte; {cured}")))
        });
        let bytes: Vec<u32> = bytes.collect::<Result<_, _>>()?;
        let goes_on = index == lines.len() && lines.iter().all(|line| line.len() == bytes.len());
        if !goes_on {
            // One for all lines of a capture whose beginning is missing.
            found.cut_short += usize::from(!lines.is_empty() || index != 0 && !is_lost);
            is_lost = index != 0;
            lines.clear();
            if is_lost {
                continue;
            }
        }
        is_lost = false;
        lines.push(bytes);
        if lines.len() == LINES {
            let bins = lines[0].len();
            if found.captures.is_empty() {
                found.bins = bins;
            }
            if bins == found.bins {
                found.captures.push(capture(&lines));
            } else {
                found.cut_short += 1;
            }
            lines.clear();
        }
    }
    found.cut_short += usize::from(!lines.is_empty());
    Ok(found)
}

fn capture(lines: &[Vec<u32>]) -> ZoneCounts {
    let bins = lines[0].len();
    let count = |channel: usize, bin: usize| {
        let byte = |plane: usize| lines[plane * CHANNELS + channel][bin];
        byte(0) | byte(1) << 8 | byte(2) << 16
    };
    let channel = |channel: usize| (0..bins).map(move |bin| count(channel, bin));
    ZoneCounts {
        reference: Some(channel(0).collect()),
        counts: (1..CHANNELS).flat_map(channel).collect(),
        own_depths_m: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::HistogramFormat;
    use super::super::tests::read_bytes;
    use super::*;
    use std::fmt::Write;

    /// A count for each channel and bin that has three different bytes.
    fn count(capture: usize, channel: usize, bin: usize) -> u32 {
        (1 + capture + 3 * channel + 50 * bin) as u32 * 0x01_01_01 % 0xff_fffd
    }

    fn log(captures: usize, bins: usize) -> String {
        let mut text = String::from("#TMF8820 log\n");
        for capture in 0..captures {
            for line in 0..LINES {
                write!(text, "#Raw,0,{line}").unwrap();
                for bin in 0..bins {
                    let count = count(capture, line % CHANNELS, bin);
                    write!(text, ",{}", count >> (8 * (line / CHANNELS)) & 0xff).unwrap();
                }
                text += "\r\n";
            }
            text += "#Obj,65,1,2,3\n";
        }
        text
    }

    fn read(text: &str) -> Result<ZoneHistograms, String> {
        read_bytes("log.txt", text.as_bytes(), HistogramFormat::Tmf882x, None)
    }

    #[test]
    fn three_bytes_make_a_count() {
        let read = read(&log(2, 5)).unwrap();
        assert_eq!(
            (read.bins, read.captures.len(), read.zones(), read.cut_short),
            (5, 2, 9, 0)
        );
        for (capture, zones) in read.captures.iter().enumerate() {
            for (at, &found) in zones.counts.iter().enumerate() {
                assert_eq!(found, count(capture, 1 + at / 5, at % 5));
            }
            let reference: Vec<u32> = (0..5).map(|bin| count(capture, 0, bin)).collect();
            assert_eq!(zones.reference, Some(reference));
        }
    }

    #[test]
    fn captures_that_are_cut_short_are_left_out_and_counted() {
        let whole = log(3, 5);
        let lines: Vec<&str> = whole.lines().collect();
        // The log begins within the first capture and ends within the last.
        let cut = lines[9..lines.len() - 4].join("\n");
        let read = read(&cut).unwrap();
        assert_eq!((read.captures.len(), read.cut_short), (1, 2));
        assert_eq!(read.captures[0].counts[0], count(1, 1, 0));
        let none = lines[9..20].join("\n");
        assert!(
            super::tests::read(&none)
                .unwrap_err()
                .contains("no histograms")
        );
        assert!(
            super::tests::read("#Raw,0,3,300,1\n")
                .unwrap_err()
                .contains("`300`")
        );
        assert!(
            super::tests::read("#Raw,0,40,3,1\n")
                .unwrap_err()
                .contains(":1: has no line number")
        );
    }
}
