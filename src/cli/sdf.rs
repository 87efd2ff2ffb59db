//! `gdtof export sdf`, and delay files as input of other commands.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::{SensorArgs, say};
use crate::chip::{SensorConfig, sensor};
use crate::files::{InputError, OutputFile, read_text};
use crate::netlist::sdf::{
    Sdf, SdfDivider, SdfOptions, SdfTimescale, Skipped, annotate, write_sdf,
};
use crate::netlist::{Corner, Library, Netlist, Timing};

#[derive(Clone, Copy, ValueEnum)]
enum Divider {
    /// a.b
    Dot,
    /// a/b
    Slash,
}

#[derive(Clone, Copy, ValueEnum)]
enum Timescale {
    /// Whole femtoseconds.
    Fs,
    /// Picoseconds with three decimals.
    Ps,
}

/// Arguments of `gdtof export sdf`.
#[derive(Args)]
pub struct SdfArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    /// The delay file.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// What stands between names in paths.
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
pub fn run(args: &SdfArgs) -> anyhow::Result<()> {
    let config = args.sensor.read()?;
    let netlist = Netlist::elaborate(&sensor::circuit(&config));
    let library = Library::default();
    let [min, typ, max] = Corner::ALL.map(|c| Timing::nominal(&netlist, &library, c));
    let options = SdfOptions {
        divider: match args.divider {
            Divider::Dot => SdfDivider::Dot,
            Divider::Slash => SdfDivider::Slash,
        },
        timescale: match args.timescale {
            Timescale::Fs => SdfTimescale::Fs,
            Timescale::Ps => SdfTimescale::Ps,
        },
    };
    OutputFile::write_with(&args.out, |out| {
        write_sdf(out, &netlist, [&min, &typ, &max], options)
    })?;
    say(format_args!(
        "{} cells in {}\n",
        netlist.cells().len(),
        args.out.display()
    ))?;
    Ok(())
}

/// The delays of `netlist` in the corner of `config`, those of the file where it gives any. What could not be
/// taken over is said on standard error.
///
/// # Errors
/// Unreadable and malformed files, and files of another design.
pub fn annotated_timing(
    path: &Path,
    netlist: &Netlist,
    config: &SensorConfig,
) -> Result<Timing, InputError> {
    let text = read_text(path)?;
    let sdf = Sdf::parse(&path.display().to_string(), &text)?;
    let mut timing = Timing::nominal(netlist, &Library::default(), config.corner);
    let result = annotate(&mut timing, netlist, &sdf, config.corner)?;
    let at = |skipped: &Skipped| {
        format!(
            "gdtof: {}:{}: left out or approximated {} of: {}",
            sdf.source, skipped.first_line, skipped.count, skipped.what
        )
    };
    for skipped in sdf.skipped.iter().chain(&result.notes) {
        eprintln!("{}", at(skipped));
    }
    if result.longest_wire_to_d_fs > 0 {
        eprintln!(
            "gdtof: the longest wire to D left out is {} fs",
            result.longest_wire_to_d_fs
        );
    }
    eprintln!(
        "gdtof: {}: {} arcs, {} wires and {} timing checks annotated",
        sdf.source, result.arcs, result.wires, result.checks
    );
    Ok(timing)
}
