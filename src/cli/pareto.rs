//! `gdtof pareto`: run time against error, for each engine and knob; and the numerical stability of the functions
//! that everything rests on.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use super::{SensorArgs, say};
use crate::engine::recording::check_exposure;
use crate::files::{InputError, OutputFile, create_folder};
use crate::report::{Axis, Chart, Grid, Style};
use crate::scene::Scene;
use crate::system::pareto::{GATE_CYCLES, Method, ParetoSettings, Point, Summary, summarise};
use crate::system::stability;

/// Arguments of `gdtof pareto`.
#[derive(Args)]
pub struct ParetoArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    /// Scene (TOML) whose optics and laser are used; without it, the built-in street's.
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Ranges of the walls that are looked at, m; those out of the P-counter's reach are left out (9 bits at 384 MHz:
    /// beyond about 197 m).
    #[arg(long, value_name = "M,…", value_delimiter = ',', default_values_t = [5.0, 20.0, 50.0, 100.0, 195.0])]
    ranges: Vec<f64>,
    /// Sunlight on them, klux.
    #[arg(long, value_name = "KLUX,…", value_delimiter = ',', default_values_t = [0.0, 1.0, 10.0, 100.0])]
    klux: Vec<f64>,
    /// Reflectivity of the walls.
    #[arg(long, value_name = "R", default_value_t = 0.3)]
    reflectivity: f64,
    /// Macropixels that see a wall.
    #[arg(long, value_name = "N", default_value_t = 512)]
    macropixels: usize,
    /// CLK periods in a laser cycle.
    #[arg(long, value_name = "P", default_value_t = 520)]
    stop_periods: u32,
    /// Laser cycles of an exposure.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    laser_cycles: u32,
    /// Timed runs of each engine on each wall; the median counts.
    #[arg(long, value_name = "N", default_value_t = 3)]
    repeats: usize,
    /// Seed of the photons.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Leave the gate level out, which takes most of the time.
    #[arg(long)]
    no_gate: bool,
    /// Folder for pareto.svg, pareto.csv and pareto_cells.csv; it is made if need be.
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// JSON instead of the table.
    #[arg(long)]
    json: bool,
    /// Instead of all that: worst error of each function against references of many digits, at extreme arguments.
    #[arg(long)]
    stability: bool,
    /// The table of --stability as Markdown.
    #[arg(long, requires = "stability")]
    markdown: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    laser_cycles: u32,
    stop_periods: u32,
    macropixels: usize,
    methods: &'a [Summary],
    cells: &'a [Point],
}

/// Runs the command.
///
/// # Errors
/// Bad input, configurations that an engine refuses, files that cannot be written, a function that breaks its promise.
pub fn run(args: &ParetoArgs) -> anyhow::Result<()> {
    if args.stability {
        return stability(args.markdown);
    }
    let settings = settings(args)?;
    let methods: Vec<Method> = Method::ALL
        .into_iter()
        .filter(|&method| !(args.no_gate && method == Method::Gate))
        .collect();
    create_folder(&args.out)?;
    let cells = settings.cell_count();
    if cells == 0 {
        let message = "all are out of the sensor's reach; give nearer ones";
        return Err(InputError::new("--ranges", message).into());
    }
    let progress =
        ProgressBar::new((methods.len() * cells) as u64).with_style(ProgressStyle::with_template(
            "comparing {bar:40} {pos}/{len} engines and scenes, {eta} left",
        )?);
    let points = settings.compare(&methods, || progress.inc(1))?;
    progress.finish_and_clear();
    let summaries = summarise(&methods, &points);

    write_cells(&args.out.join("pareto_cells.csv"), &points)?;
    chart(&settings, &summaries).write(&args.out.join("pareto.svg"))?;
    if args.json {
        let report = Report {
            laser_cycles: settings.laser_cycles,
            stop_periods: settings.stop_periods,
            macropixels: settings.macropixels,
            methods: &summaries,
            cells: &points,
        };
        say(format_args!("{}\n", serde_json::to_string_pretty(&report)?))?;
    } else {
        say(table(args, &settings, cells, &summaries))?;
    }
    Ok(())
}

fn stability(markdown: bool) -> anyhow::Result<()> {
    let (table, kept) = stability::table();
    say(if markdown {
        table.markdown()
    } else {
        table.to_string()
    })?;
    if !kept {
        bail!("a function is further from its reference than it promises");
    }
    Ok(())
}

fn settings(args: &ParetoArgs) -> Result<ParetoSettings, InputError> {
    let sensor = args.sensor.read()?;
    check_exposure(&sensor, args.stop_periods, args.laser_cycles)?;
    let scene = match &args.scene {
        Some(path) => Scene::load(path)?,
        None => Scene::outdoor(),
    };
    let numbers = [
        ("--ranges", &args.ranges[..], 0.1, 1e4),
        ("--klux", &args.klux[..], 0.0, 1e3),
        ("--reflectivity", &[args.reflectivity][..], 0.0, 1.0),
    ];
    for (option, values, least, most) in numbers {
        if let Some(bad) = values.iter().find(|v| !(least..=most).contains(*v)) {
            let message = format!("{bad} is impossible; give {least} to {most}");
            return Err(InputError::new(option, message));
        }
    }
    for (option, value) in [
        ("--macropixels", args.macropixels),
        ("--repeats", args.repeats),
    ] {
        if !(1..=65_536).contains(&value) {
            let message = format!("{value} is impossible; give 1 to 65536");
            return Err(InputError::new(option, message));
        }
    }
    Ok(ParetoSettings {
        sensor,
        scene,
        stop_periods: args.stop_periods,
        laser_cycles: args.laser_cycles,
        ranges_m: args.ranges.clone(),
        illuminances_klux: args.klux.clone(),
        reflectivity: args.reflectivity,
        macropixels: args.macropixels,
        repeats: args.repeats,
        seed: args.seed,
    })
}

fn write_cells(path: &Path, points: &[Point]) -> Result<(), InputError> {
    OutputFile::write_with(path, |out| {
        let mut cells = Grid::new([
            "method",
            "range_m",
            "illuminance_klux",
            "run_time_ns",
            "speed_up",
            "mismatch",
            "mean_shift",
            "depth_rms_m",
            "depth_mean_m",
        ]);
        for point in points {
            let metres = |value: Option<f64>| value.map_or(String::new(), |m| m.to_string());
            let errors = &point.errors;
            cells.push([
                point.method.name(),
                point.range_m.to_string(),
                point.illuminance_klux.to_string(),
                point.run_time_ns.to_string(),
                point.speed_up.to_string(),
                errors.mismatch.to_string(),
                errors.mean_shift.to_string(),
                metres(errors.depth_rms_m),
                metres(errors.depth_mean_m),
            ]);
        }
        cells.write_csv(out)
    })
}

/// Depth errors below this are drawn here: equal results have no place on a logarithmic axis.
const FLOOR_M: f64 = 1e-4;

fn chart(settings: &ParetoSettings, summaries: &[Summary]) -> Chart {
    let title = format!(
        "Run time against error, {} laser cycles; errors of 0 are drawn at {FLOOR_M:e} m",
        settings.laser_cycles
    );
    let time = Axis::log("run time for a macropixel and laser cycle (ns)");
    let error = Axis::log("RMS difference of depth from the cycle engine (m)");
    summaries
        .iter()
        .fold(Chart::new(title, time, error), |chart, summary| {
            let error_m = summary.depth_rms_m.unwrap_or(0.0).max(FLOOR_M);
            let point = (summary.run_time_ns, error_m);
            chart.with(summary.method.name(), Style::Points, [point])
        })
}

fn table(
    args: &ParetoArgs,
    settings: &ParetoSettings,
    cells: usize,
    summaries: &[Summary],
) -> String {
    let mut grid = Grid::new([
        "engine and knob",
        "ns a pixel-cycle",
        "speed-up",
        "mismatch",
        "mean shift (σ)",
        "depth RMS (m)",
        "depth mean (m)",
    ]);
    for summary in summaries {
        let metres = |value: Option<f64>| value.map_or("-".into(), |m| format!("{m:.4}"));
        grid.push([
            summary.method.name(),
            format!("{:.3}", summary.run_time_ns),
            format!("{:.3}", summary.speed_up),
            format!("{:.4}", summary.mismatch),
            format!("{:.3}", summary.mean_shift),
            metres(summary.depth_rms_m),
            metres(summary.depth_mean_m),
        ]);
    }
    let gate = match args.no_gate {
        true => String::new(),
        false => format!(" (gate level: {})", settings.laser_cycles.min(GATE_CYCLES)),
    };
    format!(
        "{cells} walls, {} macropixels each, {} laser cycles of {} CLK periods{gate}\n\n{grid}\n\
         Errors are against the cycle engine, which steps every CLK period; medians over the walls.\n\
         Engines that draw photons of their own differ from it as another seed does: compare with that row.\n\
         A mean shift of {:.3} is what chance gives two exact engines.\n\
         In {}: pareto.svg pareto.csv pareto_cells.csv\n",
        settings.macropixels,
        settings.laser_cycles,
        settings.stop_periods,
        f64::sqrt(2.0 / settings.macropixels as f64),
        args.out.display(),
    )
}
