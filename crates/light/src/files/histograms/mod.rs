//! Histograms of any sensor, as people have them: tables, NumPy arrays, and the logs of evaluation kits.
//!
//! | format | what a file is |
//! |---|---|
//! | table | `table.rs`: text with a line for each zone, NumPy arrays whose last axis is bins (in archives: `npz.rs`), JSON lists of lists |
//! | TMF882x | `tmf882x.rs`: `#Raw` lines, three for each histogram, with the low, middle and high bytes of its counts |
//! | TMF8829 | `tmf8829.rs`: JSON with a `Result_Set`, packed by gzip or not |
//! | CNH | `cnh.rs`: lines `Agg, zone, …` of compact normalised histograms of VL53L5, VL53L7 and VL53L8 sensors |

mod cnh;
mod kind;
mod npz;
mod table;
mod tmf8829;
mod tmf882x;

use std::ops::Range;
use std::path::Path;

use femtogate::InputError;

pub use kind::other_kind;

/// Most bins of a histogram.
const MOST_BINS: usize = 1 << 16;

/// What a file of histograms is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HistogramFormat {
    /// A table, an array or lists.
    Table,
    /// A log of an ams TMF8820, TMF8821 or TMF8828.
    Tmf882x,
    /// A log of an ams TMF8829.
    Tmf8829,
    /// A log of an ST VL53L5, VL53L7 or VL53L8.
    Cnh,
}

/// Histograms of equally many bins: captures of zones.
#[derive(Debug, Clone, PartialEq)]
pub struct ZoneHistograms {
    /// Bins of each.
    pub bins: usize,
    /// In the order in which they were taken; all have as many zones.
    pub captures: Vec<ZoneCounts>,
    /// Captures of a log that are not whole, as at its beginning and end. They are left out.
    pub cut_short: usize,
}

/// The histograms that a sensor took at one time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ZoneCounts {
    /// Counts, zone by zone.
    pub counts: Vec<u32>,
    /// Counts of the light that goes straight from the laser to a SPAD; its bins may be others than those of zones.
    pub reference: Option<Vec<u32>>,
    /// What the sensor itself made of each zone, m, where it saw something. Empty if the file does not say.
    pub own_depths_m: Vec<Option<f64>>,
}

impl ZoneHistograms {
    /// Reads a file. Numbers that are no counts are multiplied by `counts_per_unit` and rounded; less than none is none.
    ///
    /// # Errors
    /// What cannot be read or is no such file; without `counts_per_unit` also what is no whole number from 0 to 2³² − 1.
    pub fn read(
        path: &Path,
        format: HistogramFormat,
        counts_per_unit: Option<f64>,
    ) -> Result<Self, InputError> {
        let found = match format {
            HistogramFormat::Table => table::read(path, counts_per_unit),
            HistogramFormat::Tmf882x => tmf882x::read(path),
            HistogramFormat::Tmf8829 => tmf8829::read(path),
            HistogramFormat::Cnh => cnh::read(path, counts_per_unit),
        };
        let name_kind = |error| other_kind(path, format.name()).unwrap_or(error);
        let found = found.map_err(name_kind)?;
        let complain = |message: String| Err(name_kind(InputError::new(path.display(), message)));
        if found
            .captures
            .iter()
            .all(|capture| capture.counts.is_empty())
        {
            return complain(format!("has no histograms; give {}", format.wanted()));
        }
        if !(2..=MOST_BINS).contains(&found.bins) {
            let bins = found.bins;
            return complain(format!("has {bins} bins in a zone; give 2 to {MOST_BINS}"));
        }
        Ok(found)
    }

    /// Zones of a capture.
    pub fn zones(&self) -> usize {
        self.captures[0].counts.len() / self.bins
    }

    /// The counts of every zone, capture by capture.
    pub fn histograms(&self) -> impl Iterator<Item = &[u32]> {
        let captures = self.captures.iter();
        captures.flat_map(|capture| capture.counts.chunks_exact(self.bins))
    }

    /// Leaves out all bins of zones but these. Reference histograms stay whole.
    pub fn keep_bins(&mut self, kept: Range<usize>) {
        for capture in &mut self.captures {
            let zones = capture.counts.chunks_exact(self.bins);
            capture.counts = zones
                .flat_map(|zone| &zone[kept.clone()])
                .copied()
                .collect();
        }
        self.bins = kept.len();
    }
}

impl HistogramFormat {
    /// Its name on the command line.
    fn name(self) -> &'static str {
        match self {
            HistogramFormat::Table => "counts",
            HistogramFormat::Tmf882x => "tmf882x",
            HistogramFormat::Tmf8829 => "tmf8829",
            HistogramFormat::Cnh => "cnh",
        }
    }

    /// What to give, for complaints.
    fn wanted(self) -> &'static str {
        match self {
            HistogramFormat::Table => "counts, a line for each zone",
            HistogramFormat::Tmf882x => "a log with `#Raw` lines of whole captures",
            HistogramFormat::Tmf8829 => {
                "a log with `mp_histo`, for which histograms must be switched on"
            }
            HistogramFormat::Cnh => "a log with lines `Agg, zone, …`",
        }
    }
}

/// The counts that a number stands for.
fn counts_of(number: f64, counts_per_unit: Option<f64>) -> Option<u32> {
    let counts = match counts_per_unit {
        Some(per_unit) => libm::round(number * per_unit).max(0.0),
        None => number,
    };
    let is_count = (0.0..=f64::from(u32::MAX)).contains(&counts);
    (number.is_finite() && is_count && libm::trunc(counts) == counts).then_some(counts as u32)
}

/// What to give instead of a number that is no count.
fn cure(counts_per_unit: Option<f64>) -> String {
    match counts_per_unit {
        Some(per_unit) => format!(
            "give numbers that are at most {} times {per_unit} counts",
            u32::MAX
        ),
        None => format!(
            "give whole numbers of counts, 0 to {}, or say how many counts one is (--counts-per-unit)",
            u32::MAX
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads `bytes` as a file of this name.
    pub(super) fn read_bytes(
        name: &str,
        bytes: &[u8],
        format: HistogramFormat,
        counts_per_unit: Option<f64>,
    ) -> Result<ZoneHistograms, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        ZoneHistograms::read(&path, format, counts_per_unit).map_err(|error| error.to_string())
    }

    #[test]
    fn bins_are_left_out_of_every_zone() {
        let text = b"1,2,3,4\n5,6,7,8\n";
        let mut read = read_bytes("a.csv", text, HistogramFormat::Table, None).unwrap();
        read.keep_bins(1..3);
        assert_eq!((read.bins, read.zones()), (2, 2));
        let kept: Vec<&[u32]> = read.histograms().collect();
        assert_eq!(kept, [[2, 3], [6, 7]]);
    }

    #[test]
    fn rates_are_rounded_to_counts() {
        assert_eq!(counts_of(2.5, None), None);
        assert_eq!(counts_of(-1.0, None), None);
        assert_eq!(counts_of(f64::NAN, Some(2.0)), None);
        assert_eq!(counts_of(7.0, None), Some(7));
        assert_eq!(counts_of(2.26, Some(10.0)), Some(23));
        assert_eq!(counts_of(-3.0, Some(10.0)), Some(0));
        assert_eq!(counts_of(1e9, Some(10.0)), None);
    }
}
