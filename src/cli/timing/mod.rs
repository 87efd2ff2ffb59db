//! `gdtof timing`: ripple, shortest periods of CLK and LOAD_CLK, margins, corners and mismatch, by static timing
//! and by simulation.

mod distribution;
mod section;
mod tables;

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use self::section::{Cell, Section};
use self::tables::Subject;
use super::{SensorArgs, say};
use crate::engine::timing::{Limits, LoadTiming, Silicon as Made};
use crate::files::InputError;
use crate::netlist::{Conditions, Mismatch, Process};

#[derive(Clone, Copy, ValueEnum)]
enum Silicon {
    Slow,
    Typ,
    Fast,
}

/// Arguments of `gdtof timing`.
#[derive(Args)]
pub struct TimingArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    /// Silicon; like voltage and temperature it scales the delays of the sensor's corner.
    #[arg(long, value_enum, default_value = "typ")]
    process: Silicon,
    /// Supply, V.
    #[arg(long, value_name = "V", default_value_t = 1.1)]
    voltage: f64,
    /// Junction temperature, °C.
    #[arg(
        long,
        value_name = "C",
        default_value_t = 50.0,
        allow_negative_numbers = true
    )]
    temperature: f64,
    /// Random mismatch: standard deviation of an inverter's delay, relative.
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0)]
    mismatch: f64,
    /// Seed of the mismatch.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Distribution of the ripple over the array's macropixels (SVG, with its numbers as CSV beside it; needs --mismatch).
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Every step of the longest and shortest paths.
    #[arg(long)]
    paths: bool,
    /// JSON instead of tables; times in picoseconds.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Bad input.
pub fn run(args: &TimingArgs) -> anyhow::Result<()> {
    let config = args.sensor.read()?;
    let conditions = Conditions {
        process: match args.process {
            Silicon::Slow => Process::Slow,
            Silicon::Typ => Process::Typ,
            Silicon::Fast => Process::Fast,
        },
        voltage_v: args.voltage,
        temperature_c: args.temperature,
    };
    let factor = conditions.delay_factor().ok_or_else(|| {
        let message = "no delays are known there; give -55 to 150 °C and a supply up to 2 V at least 0.2 V above the threshold of about 0.4 V";
        InputError::new("--voltage, --temperature", message)
    })?;
    if !(0.0..=0.5).contains(&args.mismatch) {
        let message = format!("{} is no relative spread; give 0 to 0.5", args.mismatch);
        return Err(InputError::new("--mismatch", message).into());
    }
    let mismatch = (args.mismatch > 0.0).then_some(Mismatch {
        sigma: args.mismatch,
        seed: args.seed,
    });
    if let (Some(plot), None) = (&args.plot, mismatch) {
        let message =
            "without mismatch all macropixels are equal; add --mismatch 0.05, for example";
        return Err(InputError::new(format!("--plot {}", plot.display()), message).into());
    }
    let silicon = Made {
        corner: config.corner,
        factor,
        mismatch,
    };
    let subject = Subject::new(&config, &silicon);
    let load = LoadTiming::of(&config, &silicon, Limits::Kept);
    let mut sections = vec![
        condition_table(args, factor),
        tables::windows(&subject),
        tables::reset_pulse(&subject),
        tables::periods(&subject),
        tables::forbidden(&subject),
        tables::load_clk(&subject, &load),
        tables::flip_flops(&subject, &load),
        tables::ripples(&config, &silicon),
        tables::corners(&config, &silicon),
    ];
    if args.paths {
        sections.push(tables::paths(&subject, &load));
    }
    if mismatch.is_some() {
        let found = distribution::analyse(&config, &silicon)?;
        sections.push(distribution::table(&config, &found));
        if let Some(path) = &args.plot {
            distribution::plot(&config, &found, path)?;
        }
    }
    if args.json {
        let mut document = serde_json::Map::new();
        for section in &sections {
            section.add_to(&mut document);
        }
        let document = serde_json::Value::Object(document);
        say(format_args!("{document:#}\n"))?;
    } else {
        for section in &sections {
            say(section.text())?;
        }
    }
    Ok(())
}

fn condition_table(args: &TimingArgs, factor: f64) -> Section {
    let process = args.process.to_possible_value();
    let process = process.map_or(String::new(), |value| value.get_name().to_owned());
    let headings = &["process", "voltage (V)", "temperature (C)", "delay factor"];
    let mut section = Section::new("conditions", "Conditions", headings);
    section.push([
        process.into(),
        Cell::Number(Some(args.voltage), 3),
        Cell::Number(Some(args.temperature), 1),
        Cell::Number(Some(factor), 4),
    ]);
    section
}
