//! `gdtof wave`: one laser cycle of one macropixel of a frame that has been taken.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::asked;
use super::voice::{note, say_json, say_unless_quiet};
use crate::engine::late_cycle;
use crate::engine::waveform::{self, View};
use crate::files::InputError;
use crate::report::Table;
use crate::system::TakenFrame;
use crate::waves::WaveFormat;

/// Arguments of `gdtof wave`.
#[derive(Args)]
pub(super) struct WaveArgs {
    /// The frame.json of the frame.
    #[arg(long, value_name = "FILE", default_value = "out/frame.json")]
    frame: PathBuf,
    /// Macropixel, as row,col; the upper left one is 0,0.
    #[arg(long, value_name = "R,C")]
    pixel: String,
    /// Laser cycle; the first one is 0.
    #[arg(long, value_name = "K")]
    cycle: u32,
    /// Waveform to write: FST if its name ends in .fst, else VCD [default: a VCD beside the frame].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print JSON instead of the table.
    #[arg(long)]
    json: bool,
}

/// What was replayed.
#[derive(Serialize)]
struct Report {
    row: usize,
    col: usize,
    cycle: u32,
    start: Option<u16>,
    /// Rising edges of the macropixel's SPADs in the laser cycle.
    pulses: usize,
    /// From the power-up of the waveform, fs: when the laser fires, and when the laser cycle ends.
    from_fs: i64,
    to_fs: i64,
    waveform: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// Bad input and unwritable output.
pub(super) fn run(args: &WaveArgs) -> anyhow::Result<()> {
    if !args.frame.exists() {
        let message = "does not exist; run `gdtof frame` first, or give the file of another frame with --frame";
        return Err(InputError::new(args.frame.display(), message).into());
    }
    let frame = TakenFrame::read(&args.frame)?;
    let (sensor, exposure) = (&frame.settings.sensor, &frame.settings.exposure);
    let at = asked::pixel("--pixel", &args.pixel, sensor)?;
    if args.cycle >= exposure.laser_cycles {
        let message = format!(
            "the exposure has {} laser cycles; give 0 to {}",
            exposure.laser_cycles,
            exposure.laser_cycles - 1
        );
        return Err(InputError::new(format!("--cycle {}", args.cycle), message).into());
    }
    let (row, col) = at;
    let waves = args.out.clone().unwrap_or_else(|| {
        let name = format!("wave_r{row}_c{col}_k{}.vcd", args.cycle);
        args.frame.with_file_name(name)
    });
    let pixel = frame.pixel(at, args.cycle + 1)?;
    let (start, pulses) = (pixel.start, &pixel.pulses);
    let mut simulation = late_cycle(sensor, exposure, at, start, pulses, args.cycle);
    let origin = simulation.schedule().origin;
    let view = View::of_cycle(at, sensor, exposure, start, args.cycle);
    let format = WaveFormat::from_path(&waves);
    waveform::record(&mut simulation, &waves, format, &view, &mut ())?;

    let (from, to) = (
        exposure.stop(args.cycle.into()),
        exposure.stop(i64::from(args.cycle) + 1),
    );
    let within = pulses.iter().filter(|p| (from..to).contains(&p.time));
    let report = Report {
        row,
        col,
        cycle: args.cycle,
        start: pixel.is_on.then_some(start),
        pulses: within.count(),
        from_fs: (origin + from).as_fs(),
        to_fs: (origin + to).as_fs(),
        waveform: waves,
    };
    let engine = frame.settings.engine;
    let replaced = engine.of_probes(frame.has_tolerance) != engine || frame.has_tolerance;
    if replaced {
        note(
            "the frame's counts were not all made of photons (cohort); these are the photons that the window engine counts",
        );
    }
    if args.json {
        return say_json(&report);
    }
    let start = report
        .start
        .map_or("SPADs off".to_owned(), |s| s.to_string());
    let table = Table::new(format!(
        "Laser cycle {} of macropixel ({row}, {col})",
        args.cycle
    ))
    .row("start value", start)
    .row("SPAD pulses", report.pulses)
    .row(
        "from power-up on",
        format!("{} to {}", origin + from, origin + to),
    );
    let view = report.waveform.with_extension("gtkw");
    Ok(say_unless_quiet(format_args!(
        "{table}gtkwave {}\n",
        view.display()
    ))?)
}
