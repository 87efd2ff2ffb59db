//! `gdtof timing`: ripple, shortest periods of CLK and LOAD_CLK, margins, corners and mismatch, by static timing
//! and by simulation.

mod distribution;
mod explain;
mod section;
mod tables;

use std::path::PathBuf;

use clap::Args;

use self::section::{Section, SectionCell};
use self::tables::Subject;
use super::SensorArgs;
use super::settings::SiliconArgs;
use super::voice::{busy, say_json, say_unless_quiet};
use crate::analysis::{
    ClockRange, LoadTiming, ReadTiming, TimingAnalysis, TimingVerdict, clock_ranges,
};
use crate::chip::{Limits, SensorConfig, Silicon, Tdc};
use crate::files::InputError;

/// Arguments of `gdtof timing`.
#[derive(Args)]
pub(super) struct TimingArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    #[command(flatten)]
    silicon: SiliconArgs,
    /// Plot the distribution of the ripple over the array (SVG, with its numbers as CSV beside it; needs --mismatch).
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// List the library's cells that stand for each kind, and those that were passed over, with the reason (needs
    /// --liberty).
    #[arg(long)]
    explain: bool,
    /// Print every step of the longest and shortest paths.
    #[arg(long)]
    paths: bool,
    /// Print JSON instead of tables; times are in picoseconds.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Bad input.
pub(super) fn run(args: &TimingArgs) -> anyhow::Result<()> {
    let config = args.sensor.read()?;
    let silicon = args.silicon.read(&config)?;
    let other_tdc = match config.tdc {
        Tdc::Clocked => None,
        Tdc::Counter => Some(
            "has a counter; frame states whether its timing is met, and --set sensor.tdc=clocked shows the tables of the same chip with a shift register",
        ),
        Tdc::DelayLine => Some(
            "has delay lines; frame states whether its timing is met, and calibrate measures its bins",
        ),
    };
    if let Some(what) = other_tdc {
        let message = format!("the tables are those of a shift register, and this sensor {what}");
        return Err(InputError::new("--sensor", message).into());
    }
    let is_other = |extension| {
        ["png", "jpg", "pdf", "eps"]
            .iter()
            .any(|other| extension == *other)
    };
    if let Some(plot) = &args.plot
        && plot.extension().is_some_and(is_other)
    {
        let message = "is written as SVG; give a name that ends in .svg";
        return Err(InputError::new(format!("--plot {}", plot.display()), message).into());
    }
    if let (Some(plot), None) = (&args.plot, silicon.mismatch) {
        let message =
            "without mismatch all macropixels are equal; add --mismatch 0.05, for example";
        return Err(InputError::new(format!("--plot {}", plot.display()), message).into());
    }
    let busy = busy("analysing");
    let subject = Subject::new(&config, &silicon);
    let load = LoadTiming::analyse(&config, &silicon, Limits::Kept);
    let read = ReadTiming::analyse(&config, &silicon, Limits::Kept);
    let mismatched = silicon.mismatch.is_some();
    let spread = mismatched.then(|| distribution::analyse(&config, &silicon));
    let position = spread.as_ref().map_or((0, 0), |spread| {
        let tightest = spread.tightest();
        (tightest.row, tightest.col)
    });
    let analysis = TimingAnalysis::new(&config, &silicon, position);
    let (verdict, ranges) = (analysis.at_clk(config.clk_hz), clock_ranges(&analysis));
    let mut sections = vec![
        condition_table(&args.silicon, &config, &silicon),
        tables::verdict(&verdict),
        tables::windows(&subject),
        tables::reset_pulse(&subject),
        tables::periods(&subject),
        tables::forbidden(&subject),
        tables::load_clk(&subject, &load),
        tables::read_clk(&subject, &read),
        tables::flip_flops(&subject, &load, &read),
        tables::ripples(&config, &silicon),
        tables::corners(&config, &silicon),
    ];
    sections.extend(tables::own_counter(&config));
    if args.paths {
        sections.push(tables::paths(&subject, &load));
    }
    if let Some(found) = &spread {
        sections.push(distribution::table(&config, found));
        if let Some(path) = &args.plot {
            distribution::plot(&config, found, path)?;
        }
    }
    if args.explain {
        sections.extend(explain::cells(&silicon)?);
    }
    drop(busy);
    if args.json {
        let mut document = serde_json::Map::new();
        document.insert("timing".to_owned(), serde_json::to_value(verdict.report())?);
        document.insert(
            "clk_ranges".to_owned(),
            ranges.iter().map(range_report).collect(),
        );
        for section in &sections {
            section.add_to(&mut document);
        }
        say_json(&document)?;
    } else {
        say_unless_quiet(answer(&config, &verdict, &ranges))?;
        for section in &sections {
            say_unless_quiet(section.text())?;
        }
    }
    Ok(())
}

/// The first line: whether the chip keeps its timing, how fast it may be clocked, and what limits it.
fn answer(config: &SensorConfig, verdict: &TimingVerdict, ranges: &[ClockRange]) -> String {
    let own_mhz = config.clk_hz / 1e6;
    let kept = if verdict.is_met() { "keeps" } else { "breaks" };
    let said = |range: &ClockRange| {
        let to_mhz = range.to_hz / 1e6;
        let within = match range.from_hz {
            None => format!("up to {to_mhz:.1} MHz"),
            Some(from_hz) => format!("from {:.1} to {to_mhz:.1} MHz", from_hz / 1e6),
        };
        let limit = range
            .limit
            .as_ref()
            .filter(|_| range.contains(config.clk_hz));
        match limit {
            Some(limit) => format!("{within}, limited by {}", limit.cause()),
            None => within,
        }
    };
    let said: Vec<String> = ranges.iter().map(said).collect();
    let works = match said.split_last() {
        None => "It does at every CLK.".to_owned(),
        Some((last, [])) => format!("It works {last}."),
        Some((last, others)) => format!("It works {}, and {last}.", others.join(", ")),
    };
    let uneven = config
        .counter_law()
        .and_then(|law| law.uneven())
        .map_or(String::new(), |why| {
            format!(" Its P-counter cannot be used: {why}.")
        });
    format!("This chip {kept} its timing at {own_mhz} MHz. {works}{uneven}\n")
}

/// A range of CLK as JSON; from `null` on, if slower clocks work, too.
fn range_report(range: &ClockRange) -> serde_json::Value {
    let limit = range.limit.as_ref();
    serde_json::json!({
        "from_mhz": range.from_hz.map(|from_hz| from_hz * 1e-6),
        "to_mhz": range.to_hz * 1e-6,
        "check": limit.map(|limit| &limit.check),
        "path": limit.map(|limit| &limit.path),
    })
}

fn condition_table(args: &SiliconArgs, config: &SensorConfig, silicon: &Silicon) -> Section {
    let conditions = args.conditions(config);
    let headings = &[
        "corner",
        "process",
        "voltage (V)",
        "temperature (C)",
        "delay factor",
    ];
    let mut section = Section::new("conditions", "Conditions", headings);
    let (process, [voltage_v, temperature_c]) = match silicon.cell_library.from_file() {
        Some(library) => (library.liberty.name.as_str(), library.liberty.conditions),
        None => (
            conditions.process.name(),
            [Some(conditions.voltage_v), Some(conditions.temperature_c)],
        ),
    };
    section.push([
        silicon.corner.name().into(),
        process.into(),
        SectionCell::Number(voltage_v, 3),
        SectionCell::Number(temperature_c, 1),
        SectionCell::Number(Some(silicon.factor), 4),
    ]);
    section
}
