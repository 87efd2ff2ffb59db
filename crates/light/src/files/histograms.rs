//! Histograms of any sensor: a table of text, a line for each zone, or a NumPy array whose last axis is bins.
//!
//! | kind | counts |
//! |---|---|
//! | `.npy` | whole numbers of any type, floats that are whole, truth values; either order of axes |
//! | text | whole numbers with commas, semicolons, tabs or spaces between them; a first line of words is a heading; `#` begins a remark |

use std::io::{self, BufReader};
use std::path::Path;

use femtogate::{InputError, in_words};

use super::guarded::open_input;
use super::input::Lines;
use super::npy::{NpyHead, Number};

/// Most bins of a histogram.
const MOST_BINS: usize = 1 << 16;

/// Histograms of equally many bins.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Histograms {
    /// Bins of each.
    pub bins: usize,
    /// Counts, zone by zone.
    pub counts: Vec<u32>,
}

impl Histograms {
    /// Reads a file; one whose name ends in `.npy` is an array.
    ///
    /// # Errors
    /// What cannot be read, is no whole number from 0 to 2³² − 1, or has another number of bins than the first zone.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        if path.extension().is_some_and(|extension| extension == "npy") {
            read_npy(path)
        } else {
            read_table(path)
        }
    }

    /// The counts of each zone.
    pub fn zones(&self) -> std::slice::ChunksExact<'_, u32> {
        self.counts.chunks_exact(self.bins)
    }
}

fn read_table(path: &Path) -> Result<Histograms, InputError> {
    let mut lines = Lines::open(path)?;
    let mut found = Histograms {
        bins: 0,
        counts: Vec::new(),
    };
    let mut is_first = true;
    while let Some((number, line)) = lines.next_used()? {
        let complain = |message: String| InputError::at(path.display(), number, message);
        let is_between = |c: char| matches!(c, ',' | ';' | '\t' | ' ');
        let cells: Vec<&str> = line.split(is_between).filter(|c| !c.is_empty()).collect();
        let is_heading = is_first && cells.iter().all(|cell| cell.parse::<f64>().is_err());
        is_first = false;
        if is_heading {
            continue;
        }
        if found.bins == 0 {
            found.bins = cells.len();
        }
        if cells.len() != found.bins {
            let message = format!(
                "has {} bins, and the first zone has {}; give as many for each zone",
                cells.len(),
                found.bins
            );
            return Err(complain(message));
        }
        for (bin, cell) in cells.iter().enumerate() {
            let count = cell.parse::<f64>().ok().and_then(|n| whole(Number::Float(n)));
            let count = count.ok_or_else(|| {
                complain(format!(
                    "has `{cell}` in bin {bin}; give whole numbers of counts, 0 to {}",
                    u32::MAX
                ))
            })?;
            found.counts.push(count);
        }
    }
    checked(path, found)
}

fn read_npy(path: &Path) -> Result<Histograms, InputError> {
    let complain = |message: String| InputError::new(path.display(), message);
    let broken = |error: &io::Error| {
        let error = in_words(error);
        complain(format!("is not a NumPy file of counts ({error}); give a .npy"))
    };
    let mut reader = BufReader::new(open_input(path)?);
    let head = NpyHead::read(&mut reader).map_err(|e| broken(&e))?;
    let Some(&bins) = head.shape.last() else {
        return Err(complain("is a single number; give an array whose last axis is bins".into()));
    };
    let numbers = head.numbers(&mut reader).ok_or_else(|| {
        let kind = &head.descr;
        complain(format!("has elements of type {kind}; save counts as whole numbers, as uint32"))
    })?;
    let numbers = numbers.map_err(|e| broken(&e))?;
    let counts = (0..numbers.len()).map(|at| {
        let place = if head.is_fortran {
            first_axis_fastest(at, &head.shape)
        } else {
            at
        };
        whole(numbers[place]).ok_or_else(|| {
            complain(format!(
                "has {} in bin {} of zone {}; give whole numbers of counts, 0 to {}",
                shown(numbers[place]),
                at % bins,
                at / bins,
                u32::MAX
            ))
        })
    });
    let counts = counts.collect::<Result<_, _>>()?;
    checked(path, Histograms { bins, counts })
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

fn whole(number: Number) -> Option<u32> {
    match number {
        Number::Whole(number) => u32::try_from(number).ok(),
        Number::Float(number) => {
            let is_count = (0.0..=f64::from(u32::MAX)).contains(&number);
            (is_count && number.trunc() == number).then_some(number as u32)
        }
    }
}

fn shown(number: Number) -> String {
    match number {
        Number::Whole(number) => number.to_string(),
        Number::Float(number) => number.to_string(),
    }
}

fn checked(path: &Path, found: Histograms) -> Result<Histograms, InputError> {
    let complain = |message: String| Err(InputError::new(path.display(), message));
    if found.counts.is_empty() {
        return complain("has no histograms; give counts, a line for each zone".into());
    }
    if !(2..=MOST_BINS).contains(&found.bins) {
        let message = format!(
            "has {} bins in a zone; give 2 to {MOST_BINS}, a line for each zone",
            found.bins
        );
        return complain(message);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_npy;
    use proptest::prelude::*;

    fn read(name: &str, bytes: &[u8]) -> Result<Histograms, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        Histograms::read(&path).map_err(|error| error.to_string())
    }

    #[test]
    fn tables_of_every_spelling_are_read() {
        let expected = Histograms {
            bins: 3,
            counts: vec![1, 2, 30, 4, 5, 6],
        };
        for text in [
            "1,2,30\n4,5,6\n",
            "bin0;bin1;bin2\n1;2;30\n4;5;6",
            "\u{feff}# a remark\n1 2 30\r\n\r\n4\t5\t6.0\r\n",
        ] {
            assert_eq!(read("counts.csv", text.as_bytes()), Ok(expected.clone()));
        }
    }

    #[test]
    fn what_is_wrong_is_said_with_its_place() {
        let said = |text: &str| read("counts.csv", text.as_bytes()).unwrap_err();
        assert!(said("1,2\n1,2,3\n").contains(":2: has 3 bins"));
        assert!(said("1,2\n1,-2\n").contains("`-2` in bin 1"));
        assert!(said("1,2\n1,x\n").contains("`x` in bin 1"));
        assert!(said("1,2.5\n").contains("`2.5`"));
        assert!(said("a,b\n").contains("no histograms"));
        assert!(said("7\n8\n").contains("1 bins"));
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
            let expected = Histograms { bins, counts: counts.clone() };
            prop_assert_eq!(read("counts.npy", &file), Ok(expected.clone()));
            // The same with its elements in the other order.
            let mut other = vec![0u32; all];
            for (at, &count) in counts.iter().enumerate() {
                other[first_axis_fastest(at, &shape)] = count;
            }
            let mut file = Vec::new();
            write_npy(&mut file, &shape, &other).unwrap();
            let text = String::from_utf8_lossy(&file[..128]).replace("False", "True ");
            prop_assume!(text.len() == 128);
            file[10..128].copy_from_slice(&text.as_bytes()[text.len() - 118..]);
            prop_assert_eq!(read("counts.npy", &file), Ok(expected));
        }
    }
}
