//! `gdtof calibrate`: the bin profile of a sensor with delay lines, by a swept laser.

use std::path::PathBuf;

use clap::Args;

use super::SensorArgs;
use super::voice::{progress, say_unless_quiet};
use crate::chip::{Tdc, WindowLaw};
use crate::files::{InputError, OutputFile, refuse_input};
use crate::numerics::intervals::mean_and_sigma;
use crate::report::Table;
use crate::request::{self, Spelling};
use crate::system::{BinCalibration, BinSweepError, Sweep, calibrate};
use crate::units::Time;

/// Arguments of `gdtof calibrate`.
#[derive(Args)]
pub(super) struct CalibrateArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    /// File for the bin profile (JSON), to be read by `gdtof frame --calibration`.
    #[arg(long, value_name = "FILE", default_value = "calibration.json")]
    out: PathBuf,
    /// CLK periods in a laser cycle.
    #[arg(long, value_name = "P", default_value_t = 140)]
    stop_periods: u32,
    /// Delay of the laser from one step to the next, ps.
    #[arg(long, value_name = "PS", default_value_t = 10.0)]
    step_ps: f64,
    /// Laser cycles in each step.
    #[arg(long, value_name = "N", default_value_t = Sweep::default().laser_cycles, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    laser_cycles: u32,
    /// Average number of detected photons in a macropixel and laser cycle.
    #[arg(long, value_name = "N", default_value_t = Sweep::default().photons_per_cycle)]
    photons_per_cycle: f64,
    /// Sweep every window, not just one even and one odd one, and take the mean. Also reports how far the windows of
    /// a line differ.
    #[arg(long)]
    every_window: bool,
    /// Seed of the photons.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Runs the command.
///
/// # Errors
/// Bad input, and a file that cannot be written.
pub(super) fn run(args: &CalibrateArgs) -> anyhow::Result<()> {
    let sensor = args.sensor.read()?;
    refuse_input(&args.out)?;
    if sensor.tdc != Tdc::DelayLine {
        let message = "bins of a clocked TDC are CLK periods, and there is nothing to calibrate; give a sensor with tdc = \"delay_line\", such as hslidar_delay_line";
        return Err(InputError::new("--sensor", message).into());
    }
    for (option, value, least, most) in [
        ("--step-ps", args.step_ps, 1.0, 1e3),
        ("--photons-per-cycle", args.photons_per_cycle, 0.01, 100.0),
    ] {
        if !(least..=most).contains(&value) {
            let message = format!("{value} is impossible; give {least} to {most}");
            return Err(InputError::new(option, message).into());
        }
    }
    let (stop_periods, laser_cycles) = (args.stop_periods, args.laser_cycles);
    let exposure = request::exposure(&sensor, stop_periods, laser_cycles, Spelling::Options)?;
    if let Some(why) = WindowLaw::new(&sensor, &exposure).refusal() {
        let (why, cure) = request::of_no_aim(&why, Spelling::Options);
        return Err(InputError::new("--sensor", format!("{why}; {cure}")).into());
    }
    let sweep = Sweep {
        step: Time::from_s(args.step_ps * 1e-12),
        laser_cycles: args.laser_cycles,
        photons_per_cycle: args.photons_per_cycle,
        seed: args.seed,
        every_window: args.every_window,
        ..Sweep::default()
    };
    let progress = progress(
        sensor.pixels() as u64,
        "sweeping {bar:40} {pos}/{len} macropixels, {eta} left",
    );
    let found = calibrate(&sensor, args.stop_periods, &sweep, || progress.inc(1));
    progress.finish_and_clear();
    let found = match found {
        Err(why @ BinSweepError::NoWindow { .. }) => {
            let message = format!("{why}; give a longer laser cycle, or more counter_bits");
            return Err(InputError::new("--stop-periods", message).into());
        }
        Err(BinSweepError::Engine(why)) => return Err(why.into()),
        Ok(found) => found,
    };
    OutputFile::write_with(&args.out, |out| {
        serde_json::to_writer(&mut *out, &found.profile)?;
        writeln!(out)
    })?;
    say_unless_quiet(table(&found))?;
    Ok(())
}

fn table(found: &BinCalibration) -> Table {
    let profile = &found.profile;
    let mut table = Table::new("Bins found");
    for (line, name) in ["even", "odd"].into_iter().enumerate() {
        let lengths = profile
            .macropixels
            .iter()
            .flat_map(|lines| &lines[line].length_s);
        let lengths: Vec<f64> = lengths.map(|s| s * 1e12).collect();
        let (mean, sigma) = mean_and_sigma(&lengths);
        let bound = |f: fn(f64, f64) -> f64| lengths.iter().copied().reduce(f).unwrap_or(mean);
        let row_name = format!("{name} windows");
        let windows = match found.windows[line] {
            1 => "1 window".to_owned(),
            windows => format!("mean of {windows} windows"),
        };
        table.push(&row_name, format!("{} bins, {windows}", lengths.len()));
        table.push(
            format!("{row_name}, length"),
            format!("{mean:.1} ps, σ {sigma:.1} ps"),
        );
        let (least, most) = (bound(f64::min), bound(f64::max));
        table.push(
            format!("{row_name}, least and most"),
            format!("{least:.0} and {most:.0} ps"),
        );
    }
    if found.windows.iter().any(|&windows| windows > 1) {
        let largest_ps = found.largest_difference.as_s() * 1e12;
        let text = format!("{largest_ps:.0} ps at most, of a bin's middle from its mean");
        table.push("windows of a line differ by", text);
    }
    table
}
