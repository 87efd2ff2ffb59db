//! Histograms as `.npy` or CSV.

use std::io::Write;
use std::path::Path;

use crate::chip::SensorConfig;
use crate::engine::Histograms;
use crate::files::{InputError, OutputFile};
use crate::report::write_npy_u16;

/// Format of histograms.
#[derive(Clone, Copy)]
pub(super) enum Format {
    Npy,
    Csv,
}

impl Format {
    /// That of a file's name.
    pub(super) fn from_path(path: &Path) -> Result<Self, InputError> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("npy") => Ok(Format::Npy),
            Some("csv") => Ok(Format::Csv),
            _ => {
                let message = "is neither .npy nor .csv; choose one of the two";
                Err(InputError::new(
                    format!("--out {}", path.display()),
                    message,
                ))
            }
        }
    }
}

/// Writes histograms to `out`, or as CSV to standard output.
pub(super) fn write(
    config: &SensorConfig,
    histograms: &Histograms,
    out: Option<&Path>,
    format: Format,
) -> anyhow::Result<()> {
    let csv = |w: &mut dyn Write| {
        writeln!(w, "row,col,bin,count")?;
        for (pixel, histogram) in histograms.iter().enumerate() {
            let (row, col) = (pixel / config.cols, pixel % config.cols);
            for (bin, count) in histogram.iter().enumerate() {
                writeln!(w, "{row},{col},{bin},{count}")?;
            }
        }
        Ok(())
    };
    match (out, format) {
        (None, _) => csv(&mut std::io::stdout().lock())?,
        (Some(path), Format::Csv) => OutputFile::write_with(path, csv)?,
        (Some(path), Format::Npy) => {
            let shape = [config.rows, config.cols, config.bins];
            write_npy_u16(path, &shape, histograms.counts())?;
        }
    }
    Ok(())
}
