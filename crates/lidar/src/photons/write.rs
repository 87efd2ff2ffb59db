//! Files of pulses, and of the light that they come from.
//!
//! | format | file | of |
//! |---|---|---|
//! | `csv`, `npy` | `photons.csv`, `photons.npy` | all macropixels, one after the other |
//! | `txt`, `memh`, `vcd` | `photons_r3_c5.txt`, `.mem`, `.vcd` | a macropixel, in the order of time |

use std::io::{self, Write};
use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use super::lines::{ArrayWriter, Csv, Npy, PixelWriter, Txt};
use super::source::{LightSource, PulseTotals};
use super::waves::{CHANGE_BYTES, Vcd};
use super::words::{Memh, word_bytes, words};
use crate::files::{InputError, OutputFile};
use crate::settings::words as words_of_settings;
use crate::units::Time;

words_of_settings! {
    /// What pulses are written as.
    #[derive(Default)]
    #[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
    pub enum PulseFormat {
        /// photons.csv: `time_fs,row,col,spad`, which `gdtof replay` reads.
        #[default]
        Csv = "csv",
        /// A file for each macropixel with `time_fs spad` on each line, for $fscanf.
        Txt = "txt",
        /// A file for each macropixel with a word for each step of time and a bit for each SPAD, for $readmemh.
        Memh = "memh",
        /// A waveform for each macropixel: SPAD wires, STOP and CLK.
        Vcd = "vcd",
        /// photons.npy: NumPy records of time_fs, row, col and spad.
        Npy = "npy",
    }
}

/// How pulses are written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PulseOptions {
    /// The format.
    pub format: PulseFormat,
    /// Time that a word of `memh` covers, above 0.
    pub word: Time,
    /// Whether waveforms show CLK.
    pub has_clk: bool,
}

/// A file that was written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct PulseFile {
    /// Its name in the folder.
    pub name: String,
    /// Pulses in it.
    pub pulses: u64,
}

/// What was written.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct WrittenPulses {
    /// The files.
    pub files: Vec<PulseFile>,
    /// What was drawn.
    pub totals: PulseTotals,
    /// Pulses that are one bit with another of their SPAD: `memh` alone has such.
    pub merged: u64,
}

impl PulseFormat {
    /// Whether all macropixels are in one file.
    pub fn is_one_file(self) -> bool {
        matches!(self, PulseFormat::Csv | PulseFormat::Npy)
    }

    /// The name of a macropixel's file, or of the only one.
    fn file_name(self, (row, col): (usize, usize)) -> String {
        match self {
            PulseFormat::Csv => "photons.csv".to_owned(),
            PulseFormat::Npy => "photons.npy".to_owned(),
            PulseFormat::Txt => format!("photons_r{row}_c{col}.txt"),
            PulseFormat::Memh => format!("photons_r{row}_c{col}.mem"),
            PulseFormat::Vcd => format!("photons_r{row}_c{col}.vcd"),
        }
    }
}

impl PulseOptions {
    /// Bytes of the pulses of some macropixels to be expected, about.
    pub fn expected_bytes(&self, source: &LightSource, pixels: &[u32]) -> f64 {
        let pulses: f64 = pixels.iter().map(|p| source.expected_pulses(*p)).sum();
        let end = source.end();
        let digits = end.as_fs().max(1).ilog10() as f64 + 1.0;
        let array = [source.rows, source.cols];
        let of_places: u32 = array.map(|n| n.max(2).ilog10() + 1).iter().sum();
        let of_spads = f64::from(source.exposure.layout.spads().max(2).ilog10() + 1);
        match self.format {
            PulseFormat::Csv => pulses * (digits + f64::from(of_places) + of_spads + 4.0),
            PulseFormat::Txt => pulses * (digits + of_spads + 2.0),
            PulseFormat::Npy => pulses * 13.0,
            PulseFormat::Memh => {
                let bytes = word_bytes(source.exposure.layout.spads());
                words(end, self.word) as f64 * bytes as f64 * pixels.len() as f64
            }
            PulseFormat::Vcd => {
                let cycles = f64::from(source.exposure.laser_cycles);
                let clk = if self.has_clk {
                    2.0 * source.exposure.clk.as_hz() * end.as_s()
                } else {
                    0.0
                };
                let steady = (clk + 2.0 * cycles) * pixels.len() as f64;
                (2.0 * pulses + steady) * (digits + CHANGE_BYTES - 13.0)
            }
        }
    }
}

/// Writes the pulses of some macropixels into a folder; `done` is told of macropixels that are written.
///
/// # Errors
/// Files that cannot be written.
pub fn write_pulses(
    folder: &Path,
    source: &LightSource,
    pixels: &[u32],
    options: &PulseOptions,
    done: impl Fn(usize) + Sync,
) -> Result<WrittenPulses, InputError> {
    if options.format.is_one_file() {
        write_array(folder, source, pixels, options.format, done)
    } else {
        write_each(folder, source, pixels, options, done)
    }
}

fn write_array(
    folder: &Path,
    source: &LightSource,
    pixels: &[u32],
    format: PulseFormat,
    done: impl Fn(usize),
) -> Result<WrittenPulses, InputError> {
    let name = format.file_name((0, 0));
    let mut totals = PulseTotals::default();
    OutputFile::create_with(&folder.join(&name), |out| {
        let mut writer: Box<dyn ArrayWriter + '_> = match format {
            PulseFormat::Npy => Box::new(Npy::begin(out)?),
            _ => Box::new(Csv::begin(out)?),
        };
        let each = |pixel, pulses: &_| writer.write(source.position(pixel), pulses);
        totals = source.for_each(pixels, each, done)?;
        writer.finish()
    })?;
    let pulses = totals.pulses;
    Ok(WrittenPulses {
        files: vec![PulseFile { name, pulses }],
        totals,
        merged: 0,
    })
}

/// Files of macropixels, on all threads.
fn write_each(
    folder: &Path,
    source: &LightSource,
    pixels: &[u32],
    options: &PulseOptions,
    done: impl Fn(usize) + Sync,
) -> Result<WrittenPulses, InputError> {
    let written = pixels.par_iter().map(|&pixel| {
        let place = source.position(pixel);
        let name = options.format.file_name(place);
        let (mut totals, mut merged) = (PulseTotals::default(), 0);
        OutputFile::create_with(&folder.join(&name), |out| {
            let mut writer = pixel_writer(source, place, options, out)?;
            let each = |_, pulses: &_| writer.write(pulses);
            totals = source.for_each(&[pixel], each, |_| ())?;
            merged = writer.finish()?;
            Ok(())
        })?;
        done(1);
        let pulses = totals.pulses;
        Ok((PulseFile { name, pulses }, totals, merged))
    });
    let written: Vec<_> = written.collect::<Result<_, InputError>>()?;
    let mut all = WrittenPulses::default();
    for (file, totals, merged) in written {
        all.files.push(file);
        all.totals += totals;
        all.merged += merged;
    }
    Ok(all)
}

fn pixel_writer<'a, W: Write + 'a>(
    source: &'a LightSource,
    place: (usize, usize),
    options: &PulseOptions,
    out: W,
) -> io::Result<Box<dyn PixelWriter + 'a>> {
    let spads = source.exposure.layout.spads();
    Ok(match options.format {
        PulseFormat::Memh => Box::new(Memh::new(out, spads, source.end(), options.word)),
        PulseFormat::Vcd => Box::new(Vcd::begin(out, source, place, options.has_clk)?),
        _ => Box::new(Txt(out)),
    })
}

/// Writes the means of the light on some macropixels as CSV: `row,col,signal,background_hz,arrival_ns,truth_m`. What there is not is
/// empty.
///
/// # Errors
/// A file that cannot be written.
pub fn write_light(path: &Path, source: &LightSource, pixels: &[u32]) -> Result<(), InputError> {
    let text = |number: Option<f64>| number.map_or(String::new(), |number| number.to_string());
    OutputFile::write_with(path, |out| {
        writeln!(out, "row,col,signal,background_hz,arrival_ns,truth_m")?;
        for &pixel in pixels {
            let ((row, col), facts) = (source.position(pixel), source.facts(pixel));
            writeln!(
                out,
                "{row},{col},{},{},{},{}",
                facts.signal,
                facts.background_hz,
                text(facts.arrival.map(Time::as_ns)),
                text(facts.truth_m),
            )?;
        }
        Ok(())
    })
}
