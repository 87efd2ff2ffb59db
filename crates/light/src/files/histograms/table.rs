//! Histograms as a table, an array or lists.
//!
//! | kind | counts |
//! |---|---|
//! | `.npy` | whole numbers of any type, floats that are whole, truth values; either order of axes |
//! | `.npz` | the same in an archive: its only array, or the one with the name `counts` or `histograms` |
//! | `.json` | lists of numbers, in lists of any depth; all of the innermost have as many |
//! | text | numbers with commas, semicolons, tabs or spaces between them; a first line of words is a heading; `#` begins a remark |

use std::io::{self, BufReader, Read};
use std::path::Path;

use femtogate::{InputError, in_words};
use serde_json::Value;

use super::npz::read_counts;
use super::{ZoneCounts, ZoneHistograms, counts_of, cure};
use crate::files::guarded::open_input;
use crate::files::input::{Lines, parse_json, read_text};
use crate::files::npy::{NpyHead, Number};

/// Reads a file; its name says which of them it is.
pub(super) fn read(
    path: &Path,
    counts_per_unit: Option<f64>,
) -> Result<ZoneHistograms, InputError> {
    let extension = path.extension().and_then(|extension| extension.to_str());
    let extension = extension.map(str::to_lowercase);
    let (bins, counts) = match extension.as_deref() {
        Some("npy") => {
            let reader = BufReader::new(open_input(path)?);
            read_array(path, reader, counts_per_unit)?
        }
        Some("npz") => read_array(path, &read_counts(path)?[..], counts_per_unit)?,
        Some("json") => read_lists(path, counts_per_unit)?,
        _ => read_lines(path, counts_per_unit)?,
    };
    let capture = ZoneCounts {
        counts,
        ..ZoneCounts::default()
    };
    Ok(ZoneHistograms {
        bins,
        captures: vec![capture],
        cut_short: 0,
    })
}

fn read_lines(path: &Path, counts_per_unit: Option<f64>) -> Result<(usize, Vec<u32>), InputError> {
    let mut lines = Lines::open(path)?;
    let (mut bins, mut counts) = (0, Vec::new());
    let (mut is_first, mut headings) = (true, None);
    while let Some((number, line)) = lines.next_used()? {
        let complain = |message: String| InputError::at_line(path.display(), number, message);
        if std::mem::take(&mut is_first)
            && let Some(names) = headings_of(line)
        {
            if let Some(word) = names.iter().find(|name| names_no_bin(name)) {
                return Err(complain(format!(
                    "has a column {word}, which is no bin; leave that column out"
                )));
            }
            headings = Some(names.len());
            continue;
        }
        let cells: Vec<&str> = cells_of(line);
        if bins == 0 {
            bins = cells.len();
            if let Some(headings) = headings.filter(|headings| *headings != bins) {
                return Err(complain(format!(
                    "has {bins} numbers below {headings} headings; leave columns out that are no bins (of pandas: to_csv(…, index=False))"
                )));
            }
        }
        if cells.len() != bins {
            return Err(complain(format!(
                "has {} bins, and the first zone has {bins}; give as many for each zone",
                cells.len(),
            )));
        }
        for (bin, cell) in cells.iter().enumerate() {
            let number = cell.parse().ok();
            let count = number.and_then(|number| counts_of(number, counts_per_unit));
            let cure = || {
                complain(format!(
                    "has `{cell}` in bin {bin}; {}",
                    cure(counts_per_unit)
                ))
            };
            counts.push(count.ok_or_else(cure)?);
        }
    }
    Ok((bins, counts))
}

/// The names in a line of headings, in which none is a number. An index has no name.
fn headings_of(line: &str) -> Option<Vec<&str>> {
    let between = [',', ';', '\t'].into_iter().find(|&c| line.contains(c));
    let names = line
        .split(between.unwrap_or(' '))
        .map(|name| name.trim().trim_matches('"'));
    let names: Vec<&str> = names.filter(|name| !name.is_empty()).collect();
    let is_heading = names.iter().all(|name| name.parse::<f64>().is_err());
    is_heading.then_some(names)
}

/// Whether a heading says that its column has something else than counts of a bin.
fn names_no_bin(heading: &str) -> bool {
    matches!(
        &*heading.to_lowercase(),
        "zone"
            | "pixel"
            | "id"
            | "index"
            | "unnamed: 0"
            | "row"
            | "col"
            | "column"
            | "x"
            | "y"
            | "name"
            | "time"
            | "timestamp"
            | "frame"
    )
}

/// The cells of a line. A spreadsheet's comma at the end of a line, or its `1;2` with spaces beside, makes no cell.
pub(super) fn cells_of(line: &str) -> Vec<&str> {
    let is_between = |c: char| matches!(c, ',' | ';' | '\t' | ' ');
    line.split(is_between).filter(|c| !c.is_empty()).collect()
}

fn read_lists(path: &Path, counts_per_unit: Option<f64>) -> Result<(usize, Vec<u32>), InputError> {
    let wanted = "lists of counts, one for each zone";
    let value: Value = parse_json(path.display(), &read_text(path)?, wanted)?;
    let (mut bins, mut counts) = (0, Vec::new());
    gather(&value, counts_per_unit, (&mut bins, &mut counts)).map_err(|what| {
        let zone = counts.len().checked_div(bins).unwrap_or(0);
        InputError::new(path.display(), format!("zone {zone} {what}; give {wanted}"))
    })?;
    Ok((bins, counts))
}

/// Appends the innermost lists of `value`.
fn gather(
    value: &Value,
    counts_per_unit: Option<f64>,
    (bins, counts): (&mut usize, &mut Vec<u32>),
) -> Result<(), String> {
    let Some(list) = value.as_array() else {
        return Err(format!("is `{}`, not a list", shortened(value)));
    };
    if list.iter().any(Value::is_array) {
        for inner in list {
            gather(inner, counts_per_unit, (bins, counts))?;
        }
        return Ok(());
    }
    if *bins == 0 {
        *bins = list.len();
    }
    if list.len() != *bins {
        return Err(format!("has {} bins, and the first has {bins}", list.len()));
    }
    let mut zone = Vec::new();
    for (bin, value) in list.iter().enumerate() {
        let number = value.as_f64().or(value.as_bool().map(f64::from));
        let count = number.and_then(|number| counts_of(number, counts_per_unit));
        zone.push(count.ok_or_else(|| format!("has `{}` in bin {bin}", shortened(value)))?);
    }
    counts.extend(zone);
    Ok(())
}

fn shortened(value: &Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(20) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

fn read_array(
    path: &Path,
    mut reader: impl Read,
    counts_per_unit: Option<f64>,
) -> Result<(usize, Vec<u32>), InputError> {
    let complain = |message: String| InputError::new(path.display(), message);
    let broken = |error: &io::Error| {
        let error = in_words(error);
        complain(format!(
            "is not a NumPy file of counts ({error}); give a .npy"
        ))
    };
    let mut head = NpyHead::read(&mut reader).map_err(|e| broken(&e))?;
    // Truth values are bytes of 0 and 1: one photon or none.
    if head.descr == "'|b1'" {
        head.descr = "'|u1'".into();
    }
    let Some(&bins) = head.shape.last() else {
        return Err(complain(
            "is a single number; give an array whose last axis is bins".into(),
        ));
    };
    let numbers = head.numbers(&mut reader).ok_or_else(|| {
        let kind = &head.descr;
        complain(format!(
            "has elements of type {kind}; save counts as whole numbers, as uint32"
        ))
    })?;
    let numbers = numbers.map_err(|e| broken(&e))?;
    let counts = (0..numbers.len()).map(|at| {
        let place = if head.is_fortran {
            first_axis_fastest(at, &head.shape)
        } else {
            at
        };
        let number = match numbers[place] {
            Number::Whole(number) => number as f64,
            Number::Float(number) => number,
        };
        counts_of(number, counts_per_unit).ok_or_else(|| {
            let (bin, zone) = (at % bins, at / bins);
            let cure = cure(counts_per_unit);
            complain(format!("has {number} in bin {bin} of zone {zone}; {cure}"))
        })
    });
    Ok((bins, counts.collect::<Result<_, _>>()?))
}

/// Where element number `at`, counted with the last axis fastest, is in an array whose first axis is fastest.
fn first_axis_fastest(at: usize, shape: &[usize]) -> usize {
    let (mut rest, mut place, mut stride) = (at, 0, shape.iter().product::<usize>());
    for &length in shape.iter().rev() {
        stride /= length;
        place += rest % length * stride;
        rest /= length;
    }
    place
}

#[cfg(test)]
mod tests {
    use super::super::HistogramFormat;
    use super::super::tests::read_bytes;
    use super::*;
    use crate::files::write_npy;
    use proptest::prelude::*;

    fn read(name: &str, bytes: &[u8]) -> Result<ZoneHistograms, String> {
        read_bytes(name, bytes, HistogramFormat::Table, None)
    }

    fn zones(bins: usize, counts: &[u32]) -> ZoneHistograms {
        let capture = ZoneCounts {
            counts: counts.to_vec(),
            ..ZoneCounts::default()
        };
        ZoneHistograms {
            bins,
            captures: vec![capture],
            cut_short: 0,
        }
    }

    #[test]
    fn tables_of_every_spelling_are_read() {
        for (name, text) in [
            ("counts.csv", "1,2,30\n4,5,6\n"),
            ("counts.csv", "bin0;bin1;bin2\n1;2;30\n4;5;6"),
            (
                "counts.txt",
                "\u{feff}# a remark\n1 2 30\r\n\r\n4\t5\t6.0\r\n",
            ),
            ("counts.json", "[[1, 2, 30], [4, 5, 6.0]]"),
            ("counts.json", "[[[1, 2, 30]], [[4, 5, 6]]]"),
        ] {
            let expected = zones(3, &[1, 2, 30, 4, 5, 6]);
            assert_eq!(read(name, text.as_bytes()), Ok(expected), "{text}");
        }
    }

    #[test]
    fn what_is_wrong_is_said_with_its_place() {
        let said = |text: &str| read("counts.csv", text.as_bytes()).unwrap_err();
        assert!(said("1,2\n1,2,3\n").contains(":2: has 3 bins"));
        assert!(said("1,2\n1,-2\n").contains("`-2` in bin 1"));
        assert!(said("1,2\n1,x\n").contains("`x` in bin 1"));
        assert!(said("1,2.5\n").contains("--counts-per-unit"));
        assert!(said("a,b\n").contains("no histograms"));
        assert!(said("7\n8\n").contains("1 bins"));
        let said = |text: &str| read("counts.json", text.as_bytes()).unwrap_err();
        assert!(said("[[1, 2], [3]]").contains("zone 1 has 1 bins"));
        assert!(said("[[1, 2], [3, null]]").contains("zone 1 has `null` in bin 1"));
        assert!(said("{\"a\": [1, 2]}").contains("not a list"));
        let labelled = read("a.csv", b"Zone,b0,b1\n1,2,3\n").unwrap_err();
        assert!(labelled.contains("a column Zone"), "{labelled}");
        for text in [
            ",bin0,bin1\n0,2,3\n",
            "\"\",bin0,bin1\n0,2,3\n",
            "bin 0;bin 1;\n0;2;3\n",
        ] {
            let index = read("a.csv", text.as_bytes()).unwrap_err();
            assert!(index.contains("3 numbers below 2 headings"), "{index}");
        }
        assert_eq!(
            read("a.csv", b"bin 0,bin 1,\n2,3,\n"),
            Ok(zones(2, &[2, 3]))
        );
    }

    #[test]
    fn truth_values_are_photons() {
        let mut file = Vec::new();
        write_npy(&mut file, &[2, 2], &[1u8, 0, 0, 1]).unwrap();
        let kind = file.windows(3).position(|three| three == b"|u1").unwrap();
        file[kind..kind + 3].copy_from_slice(b"|b1");
        assert_eq!(read("counts.npy", &file), Ok(zones(2, &[1, 0, 0, 1])));
    }

    proptest! {
        /// The same counts in either order of axes.
        #[test]
        fn arrays_are_read_in_either_order(shape in prop::collection::vec(1usize..5, 1..3), bins in 2usize..6) {
            let shape = [&shape[..], &[bins]].concat();
            let all: usize = shape.iter().product();
            let counts: Vec<u32> = (0..all as u32).map(|n| 7 * n).collect();
            let mut file = Vec::new();
            write_npy(&mut file, &shape, &counts).unwrap();
            prop_assert_eq!(read("counts.npy", &file), Ok(zones(bins, &counts)));
            // The same with its elements in the other order.
            let mut other = vec![0u32; all];
            for (at, &count) in counts.iter().enumerate() {
                other[first_axis_fastest(at, &shape)] = count;
            }
            let mut file = Vec::new();
            write_npy(&mut file, &shape, &other).unwrap();
            let place = file.windows(5).position(|five| five == b"False").unwrap();
            file[place..place + 5].copy_from_slice(b"True ");
            prop_assert_eq!(read("counts.npy", &file), Ok(zones(bins, &counts)));
        }
    }
}
