//! `gdtof export sdf`, and delay files as input of other commands.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use indicatif::DecimalBytes;

use super::SensorArgs;
use super::voice::{note, progress, say_unless_quiet};
use crate::ORIGIN;
use crate::chip::{SensorConfig, Silicon, array};
use crate::files::{InputError, OutputFile, read_text};
use crate::netlist::{Corner, Netlist, Timing};
use crate::sdf::{
    Annotation, Sdf, SdfCell, SdfDivider, SdfOptions, SdfTimescale, SkippedEntry, annotate,
    suspect_delays, write_library_sdf, write_sdf,
};
use crate::units::Time;

#[derive(Clone, Copy, ValueEnum)]
enum Divider {
    /// a.b
    Dot,
    /// a/b
    Slash,
}

#[derive(Clone, Copy, ValueEnum)]
enum Timescale {
    /// Whole femtoseconds. Icarus Verilog takes them for picoseconds (steveicarus/iverilog#947).
    Fs,
    /// Picoseconds with three decimals.
    Ps,
}

/// Largest file that is written without --rows and --cols, bytes: some 200 macropixels, more than anybody reads or a
/// simulator annotates without having planned to. All 4096 of the QuantIC4x4 take 1.8 GB.
const LARGEST_UNASKED: u64 = 100_000_000;

/// Arguments of `gdtof export sdf`.
#[derive(Args)]
pub(super) struct SdfArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    /// Delay file to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Separator between names in paths.
    #[arg(long, value_enum, default_value = "dot")]
    divider: Divider,
    /// Unit of delays.
    #[arg(long, value_enum, default_value = "ps")]
    timescale: Timescale,
}

/// Runs the command.
///
/// # Errors
/// Bad input and unwritable output.
pub(super) fn run(args: &SdfArgs) -> anyhow::Result<()> {
    let config = args.sensor.read()?;
    let options = SdfOptions {
        divider: match args.divider {
            Divider::Dot => SdfDivider::Dot,
            Divider::Slash => SdfDivider::Slash,
        },
        timescale: match args.timescale {
            Timescale::Fs => SdfTimescale::Fs,
            Timescale::Ps => SdfTimescale::Ps,
        },
        origin: ORIGIN,
    };
    let design = args.sensor.chip();
    let bytes = size(&config, design, options)?;
    let SensorConfig { rows, cols, .. } = &*config;
    if bytes > LARGEST_UNASKED && !args.sensor.gives_size() {
        let message = format!(
            "the delays of {rows} × {cols} macropixels take about {}; choose how many with --rows and --cols, as for export verilog (--rows {rows} --cols {cols} writes all)",
            DecimalBytes(bytes)
        );
        return Err(InputError::new(format!("--out {}", args.out.display()), message).into());
    }
    if bytes > LARGEST_UNASKED {
        note(format_args!(
            "the delays of {rows} × {cols} macropixels take about {} in {}",
            DecimalBytes(bytes),
            args.out.display()
        ));
    }
    let progress = progress(
        bytes,
        "writing {bar:40} {decimal_bytes} of about {decimal_total_bytes}",
    );
    let mut cells = 0;
    OutputFile::write_with(&args.out, |out| {
        cells = write_library(&mut progress.wrap_write(out), &config, design, options)?;
        Ok(())
    })?;
    progress.finish_and_clear();
    say_unless_quiet(format_args!("{cells} cells in {}\n", args.out.display()))?;
    Ok(())
}

/// Writes the library's delays of the whole array; gives the number of cells. Those of a Liberty file are each cell's own, in the one
/// corner that the file is of.
fn write_library(
    out: &mut dyn Write,
    config: &SensorConfig,
    design: &str,
    options: SdfOptions,
) -> std::io::Result<usize> {
    let top = array::circuit(config);
    let silicon = Silicon::new(config);
    if silicon.cell_library.from_file().is_some() {
        let netlist = Netlist::elaborate(&top.renamed(design));
        let timing = silicon.timing(&netlist);
        write_sdf(out, &netlist, [&timing; 3], options)?;
        return Ok(netlist.cells().len());
    }
    write_library_sdf(out, (&top, design), silicon.cell_library.cells(), options)
}

/// About how many bytes the file will have: its size grows with the number of macropixels, as that of a corner of the array. From
/// 4 × 4 of 64 × 64 macropixels it is 1.3 % too many.
fn size(config: &SensorConfig, design: &str, options: SdfOptions) -> std::io::Result<u64> {
    let corner = SensorConfig {
        rows: config.rows.min(4),
        cols: config.cols.min(4),
        ..config.clone()
    };
    let mut text = Vec::new();
    write_library(&mut text, &corner, design, options)?;
    Ok((text.len() as u64 * config.pixels() as u64) / corner.pixels() as u64)
}

/// The delays of `netlist` in the corner of `config`, those of the file where it gives any. What could not be
/// taken over is said on standard error.
///
/// # Errors
/// Unreadable and malformed files, files of another design, and those of which nothing is used.
pub(super) fn annotated_timing(
    path: &Path,
    netlist: &Netlist,
    config: &SensorConfig,
) -> Result<Timing, InputError> {
    let text = read_text(path)?;
    let sdf = Sdf::parse(&path.display().to_string(), &text)?;
    let mut timing = Silicon::new(config).timing(netlist);
    let result = annotate(&mut timing, netlist, &sdf, config.corner)?;
    if result.is_empty() {
        return Err(InputError::new(
            sdf.source.clone(),
            why_unused(&sdf, config.corner, &result),
        ));
    }
    for suspect in suspect_delays(&sdf, config.corner) {
        note(format_args!("{}:{}: {suspect}", sdf.source, suspect.line()));
    }
    let skipped_line = |skipped: &SkippedEntry| {
        format!(
            "{}:{}: left out or approximated {} of: {}",
            sdf.source, skipped.first_line, skipped.count, skipped.what
        )
    };
    for skipped in sdf.skipped.iter().chain(&result.notes) {
        note(skipped_line(skipped));
    }
    if result.longest_wire_to_d > Time::ZERO {
        note(format_args!(
            "the longest wire to D left out is {} fs",
            result.longest_wire_to_d.as_fs()
        ));
    }
    let corner = config.corner;
    let values = sdf.values(corner);
    let others = Corner::ALL.map(|other| sdf.values(other));
    if let Some(most) = others.into_iter().max().filter(|&most| most > values) {
        let missing = most - values;
        note(format_args!(
            "{}: {missing} of {most} entries have no value for {} and leave the library's; the file has {}",
            sdf.source,
            corner_name(corner),
            corners(&sdf),
        ));
    }
    note(format_args!(
        "{}: {} arcs, {} wires and {} timing checks annotated",
        sdf.source, result.arcs, result.wires, result.checks
    ));
    Ok(timing)
}

/// Why nothing of a file was taken over, and what to do.
fn why_unused(sdf: &Sdf<'_>, corner: Corner, result: &Annotation) -> String {
    let left_out = |skipped: &[SkippedEntry]| {
        let names: Vec<&str> = skipped.iter().map(|skipped| skipped.what.name()).collect();
        names.join(", ")
    };
    if sdf.cells.is_empty() {
        return "it has no CELL, so no delay changes; give a file with the delays of this chip"
            .to_owned();
    }
    let is_bare = |cell: &SdfCell<'_>| cell.delays.is_empty() && cell.checks.is_empty();
    if sdf.cells.iter().all(is_bare) {
        return match left_out(&sdf.skipped) {
            none if none.is_empty() => {
                "its cells have neither delays nor timing checks; give a file with the delays of this chip".to_owned()
            }
            kinds => format!(
                "all that its cells have is left out ({kinds}); give IOPATH, DEVICE, PORT, INTERCONNECT or timing checks without conditions"
            ),
        };
    }
    if sdf.values(corner) == 0 {
        let is_there = |&other: &Corner| sdf.values(other) > 0;
        let Some(other) = Corner::ALL.into_iter().find(is_there) else {
            return "all of its values are empty; write the file again with numbers".to_owned();
        };
        return format!(
            "it has no value for {}, the sensor's corner, and has {}; write the file with all three, or set sensor.corner={}",
            corner_name(corner),
            corners(sdf),
            other.name()
        );
    }
    match left_out(&result.notes) {
        none if none.is_empty() => {
            "its entries are for every instance of cell types that this chip does not have; correct CELLTYPE or INSTANCE".to_owned()
        }
        kinds => format!("nothing of it changes a delay or limit of this chip ({kinds}); correct its entries"),
    }
}

/// What SDF calls a corner, and what the sensor does.
fn corner_name(corner: Corner) -> String {
    let place = ["min", "typ", "max"][corner as usize];
    match corner {
        Corner::Typ => place.to_owned(),
        _ => format!("{place} (corner {})", corner.name()),
    }
}

/// The corners that a file has values for, and how many.
fn corners(sdf: &Sdf<'_>) -> String {
    let given = Corner::ALL.map(|corner| (corner, sdf.values(corner)));
    let given = given.iter().filter(|(_, values)| *values > 0);
    let texts = given.map(|&(corner, values)| format!("{values} for {}", corner_name(corner)));
    texts.collect::<Vec<_>>().join(", ")
}
