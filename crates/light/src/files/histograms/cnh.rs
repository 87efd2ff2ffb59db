//! Compact normalised histograms (CNH) of the ST VL53L5CX, VL53L7CH and VL53L8CH, as a host prints them.
//!
//! ```text
//!   Agg, <zone>, <word>, <ambient>, <word>, <value of each bin>
//! ```
//!
//! Values are rates, from which the sensor has taken the ambient light, so that they may be below zero. `counts_per_unit` makes counts of
//! values and ambient together. A line of zone 0 begins a capture. Other lines are passed over. Source: the public host programs of
//! these sensors; ST documents the values (UM3138) and no file.

use std::path::Path;

use femtogate::InputError;

use super::{ZoneCounts, ZoneHistograms, counts_of, cure};
use crate::files::input::read_text;

/// Cells before the first bin.
const BEFORE: usize = 5;

/// Reads a log.
pub(super) fn read(
    path: &Path,
    counts_per_unit: Option<f64>,
) -> Result<ZoneHistograms, InputError> {
    let text = read_text(path)?;
    let mut bins = 0;
    // The zones of each capture.
    let mut captures: Vec<Vec<Vec<u32>>> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let cells: Vec<&str> = line
            .split(',')
            .map(str::trim)
            .filter(|c| !c.is_empty())
            .collect();
        if cells.first() != Some(&"Agg") {
            continue;
        }
        let complain = |message: String| InputError::at_line(path.display(), 1 + number, message);
        let cured = "give `Agg, zone, word, ambient, word, values`";
        let zone = cells.get(1).and_then(|cell| cell.parse::<usize>().ok());
        let ambient = cells.get(3).and_then(|cell| cell.parse::<f64>().ok());
        let (Some(zone), Some(ambient)) = (zone, ambient) else {
            return Err(complain(format!(
                "has no zone or no ambient light; {cured}"
            )));
        };
        let values = cells.get(BEFORE..).unwrap_or_default();
        if bins == 0 {
            bins = values.len();
        }
        if values.len() != bins {
            let found = values.len();
            return Err(complain(format!(
                "has {found} bins, and the first has {bins}; {cured}"
            )));
        }
        let counts = values.iter().enumerate().map(|(bin, cell)| {
            let value = cell.parse::<f64>().ok();
            let count = value.and_then(|value| counts_of(value + ambient, counts_per_unit));
            count.ok_or_else(|| {
                let cure = cure(counts_per_unit);
                complain(format!(
                    "has `{cell}` in bin {bin} over {ambient} of ambient light; {cure}"
                ))
            })
        });
        let counts = counts.collect::<Result<_, _>>()?;
        match captures.last_mut() {
            _ if zone == 0 => captures.push(vec![counts]),
            Some(capture) if zone == capture.len() => capture.push(counts),
            // Of a capture whose beginning is not in the log.
            _ => captures.push(Vec::new()),
        }
    }
    let zones = captures.iter().map(Vec::len).max().unwrap_or(0);
    let all = captures.len();
    captures.retain(|capture| capture.len() == zones && zones > 0);
    Ok(ZoneHistograms {
        bins,
        cut_short: all - captures.len(),
        captures: captures
            .into_iter()
            .map(|capture| ZoneCounts {
                counts: capture.concat(),
                ..ZoneCounts::default()
            })
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::HistogramFormat;
    use super::super::tests::read_bytes;
    use super::*;

    fn read(text: &str, counts_per_unit: Option<f64>) -> Result<ZoneHistograms, String> {
        read_bytes(
            "log.csv",
            text.as_bytes(),
            HistogramFormat::Cnh,
            counts_per_unit,
        )
    }

    const LOG: &str = "Data Count: 7\n\
        Agg, 1, Ambient, 0.5, Bins, 9.0, 9.0, 9.0\n\
        Agg, 0, Ambient, 0.5, Bins, -0.7, 2.0, 10.25\n\
        Agg, 1, Ambient, 1.0, Bins, 0.0, 0.0, 3.0,\n\
        Data Count: 8\n\
        Agg, 0, Ambient, 0.0, Bins, 1.0, 2.0, 3.0\n";

    #[test]
    fn values_and_ambient_light_make_counts() {
        let read = read(LOG, Some(10.0)).unwrap();
        assert_eq!((read.bins, read.zones(), read.captures.len()), (3, 2, 1));
        assert_eq!(read.cut_short, 2);
        assert_eq!(read.captures[0].counts, [0, 25, 108, 10, 10, 40]);
    }

    #[test]
    fn rates_without_their_counts_are_refused() {
        assert!(read(LOG, None).unwrap_err().contains("--counts-per-unit"));
        assert!(
            read("Agg, x, a, b\n", Some(1.0))
                .unwrap_err()
                .contains(":1: has no zone")
        );
        assert!(
            read("none\n", Some(1.0))
                .unwrap_err()
                .contains("lines `Agg")
        );
    }
}
