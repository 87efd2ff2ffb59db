//! `gdtof pareto`: run time against error, for each engine and knob.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::SceneArgs;
use super::voice::{announce, notes, progress, say_json, say_unless_quiet};
use crate::chip::SensorConfig;
use crate::engine::EngineError;
use crate::files::{InputError, MANIFEST, OutputFile, ResultSet};
use crate::report::{Axis, Chart, Grid, aligned, width};
use crate::request::{self, Spelling};
use crate::system::pareto::{
    Done, GATE_CYCLES, Method, MethodSummary, ParetoPoint, ParetoSettings, summarise,
};

/// Arguments of `gdtof pareto`.
#[derive(Args)]
pub(super) struct ParetoArgs {
    /// Of the scene, optics and laser are used.
    #[command(flatten)]
    scene: SceneArgs,
    /// Distances of the walls, m. Those beyond the P-counter's reach are left out (9 bits at 384 MHz: beyond about
    /// 197 m).
    #[arg(long, value_name = "M,…", value_delimiter = ',', default_values_t = [5.0, 20.0, 50.0, 100.0, 195.0])]
    ranges: Vec<f64>,
    /// Sunlight on the walls, klux.
    #[arg(long, value_name = "KLUX,…", value_delimiter = ',', default_values_t = [0.0, 1.0, 10.0, 100.0])]
    klux: Vec<f64>,
    /// Reflectivity of the walls.
    #[arg(long, value_name = "R", default_value_t = 0.3)]
    reflectivity: f64,
    /// Macropixels that see each wall.
    #[arg(long, value_name = "N", default_value_t = 512)]
    macropixels: usize,
    /// CLK periods in a laser cycle.
    #[arg(long, value_name = "P", default_value_t = 520)]
    stop_periods: u32,
    /// Laser cycles of an exposure.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    laser_cycles: u32,
    /// Timed runs of each engine on each wall, of which the median is used.
    #[arg(long, value_name = "N", default_value_t = 3)]
    repeats: usize,
    /// Seed of the photons.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Leave out the gate level, which takes most of the time.
    #[arg(long)]
    no_gate: bool,
    /// Folder for pareto.svg, pareto.csv and pareto_cells.csv; created if missing.
    #[arg(long, value_name = "DIR", default_value = "pareto")]
    out: PathBuf,
    /// Print JSON instead of the table.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    laser_cycles: u32,
    stop_periods: u32,
    macropixels: usize,
    methods: &'a [MethodSummary],
    cells: &'a [ParetoPoint],
}

/// Runs the command.
///
/// # Errors
/// Bad input, configurations that an engine refuses, files that cannot be written.
pub(super) fn run(args: &ParetoArgs) -> anyhow::Result<()> {
    let settings = settings(args)?;
    let methods: Vec<Method> = Method::ALL
        .into_iter()
        .filter(|&method| !(args.no_gate && method == Method::Gate))
        .collect();
    let cells = settings.cell_count();
    if cells == 0 {
        let message = "all are out of the sensor's reach; give nearer ones";
        return Err(InputError::new("--ranges", message).into());
    }
    let results = ResultSet::begin(&args.out, "pareto")?;
    announce(
        "this comparison",
        settings.processor_s(&methods) / rayon::current_num_threads() as f64,
    );
    let bar = progress(
        settings.run_count(&methods) as u64,
        "comparing {bar:40} {pos}/{len} engines and walls, {eta} left",
    );
    let rows = (!args.json).then(|| Rows::new(&methods));
    if let Some(rows) = &rows {
        bar.suspend(|| say_unless_quiet(head(args, &settings, cells) + &rows.headings()))?;
    }
    let mut summaries = Vec::new();
    let mut said = Ok(());
    let compared = settings.compare(&methods, |done| match done {
        Done::Wall => bar.inc(1),
        Done::Method(points) => {
            let summary = summarise(points).expect("there is a wall");
            if let (Some(rows), Ok(())) = (&rows, &said) {
                said = bar.suspend(|| say_unless_quiet(rows.row(&summary)));
            }
            summaries.push(summary);
        }
    });
    let points = compared.map_err(refusal)?;
    bar.finish_and_clear();
    said?;

    write_cells(&results.staging().join("pareto_cells.csv"), &points)?;
    chart(&settings, &summaries).write(&results.staging().join("pareto.svg"))?;
    notes(results.commit(serde_json::json!({
        "sensor": SensorConfig::clone(&settings.sensor),
        "lidar": settings.scene.lidar,
        "stop_periods": settings.stop_periods,
        "laser_cycles": settings.laser_cycles,
        "ranges_m": settings.ranges_m,
        "illuminances_klux": settings.illuminances_klux,
        "reflectivity": settings.reflectivity,
        "macropixels": settings.macropixels,
        "repeats": settings.repeats,
        "seed": settings.seed,
    }))?);
    if args.json {
        let report = Report {
            laser_cycles: settings.laser_cycles,
            stop_periods: settings.stop_periods,
            macropixels: settings.macropixels,
            methods: &summaries,
            cells: &points,
        };
        say_json(&report)?;
    } else {
        say_unless_quiet(foot(args, &settings))?;
    }
    Ok(())
}

/// An engine that refuses: all of them are compared, and none is chosen.
fn refusal(error: EngineError) -> anyhow::Error {
    if !error.is_refusal() {
        return error.into();
    }
    let cure = "all engines are compared, so give less light (--klux, --reflectivity), longer laser cycles (--stop-periods) or another sensor";
    InputError::new("gdtof pareto", format!("{error}; {cure}")).into()
}

fn settings(args: &ParetoArgs) -> Result<ParetoSettings, InputError> {
    let (sensor, scene) = args.scene.read()?;
    let periods = (args.stop_periods, args.laser_cycles);
    request::exposure(&sensor, periods.0, periods.1, Spelling::Options)?;
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

fn write_cells(path: &Path, points: &[ParetoPoint]) -> Result<(), InputError> {
    OutputFile::write_with(path, |out| {
        let mut cells = Grid::headed(
            "method | against_cycle | range_m | illuminance_klux | run_time_ns | speed_up \
        | mismatch | mean_shift | depth_rms_m | depth_mean_m",
        );
        for point in points {
            let metres = |value: Option<f64>| value.map_or(String::new(), |m| m.to_string());
            let errors = &point.errors;
            cells.push([
                point.method.name(),
                point.method.against_cycle(),
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

fn chart(settings: &ParetoSettings, summaries: &[MethodSummary]) -> Chart {
    let title = format!(
        "Run time against error, {} laser cycles; errors of 0 are drawn at {FLOOR_M:e} m",
        settings.laser_cycles
    );
    let time = Axis::log("run time for a macropixel and laser cycle (ns)");
    let error = Axis::log("RMS difference of depth from the cycle engine, median wall (m)");
    summaries
        .iter()
        .fold(Chart::new(title, time, error), |chart, summary| {
            let error_m = summary.depth_rms_m.unwrap_or(0.0).max(FLOOR_M);
            let point = (summary.run_time_ns, error_m);
            chart.points(summary.method.name(), [point])
        })
}

/// What stands above the table.
fn head(args: &ParetoArgs, settings: &ParetoSettings, cells: usize) -> String {
    let gate = if args.no_gate {
        String::new()
    } else {
        format!(" (gate level: {})", settings.laser_cycles.min(GATE_CYCLES))
    };
    format!(
        "{cells} walls, {} macropixels each, {} laser cycles of {} CLK periods{gate}; median / worst wall\n\n",
        settings.macropixels, settings.laser_cycles, settings.stop_periods,
    )
}

/// What stands below it.
fn foot(args: &ParetoArgs, settings: &ParetoSettings) -> String {
    format!(
        "\nErrors are differences from the cycle engine, which steps every CLK period, on the same wall. With the same\n\
         photons any at all would be a fault. Another seed shows what chance makes of two exact engines: {:.3} of mean\n\
         shift, and the depths' own noise. Own draws differ by as much; only what they differ more is their discretisation.\n\
         The worst wall is that of the largest depth RMS: an echo too faint to be found is ranged at random.\n\
         In {}: pareto.svg pareto.csv pareto_cells.csv {MANIFEST}\n",
        f64::sqrt(2.0 / settings.macropixels as f64),
        args.out.display(),
    )
}

/// The table's rows, which are printed as they are finished, so that their widths must be known before.
struct Rows {
    widths: [usize; 8],
}

const HEADINGS: [&str; 8] = [
    "engine and knob",
    "against cycle",
    "ns a pixel-cycle",
    "speed-up",
    "mismatch",
    "mean shift (σ)",
    "depth RMS (m)",
    "worst wall",
];

impl Rows {
    fn new(methods: &[Method]) -> Self {
        let widest = |text: fn(Method) -> String| {
            let texts: Vec<String> = methods.iter().map(|&m| text(m)).collect();
            width(texts.iter())
        };
        let mut widths = [0; 8];
        let least = [
            widest(Method::name),
            widest(Method::against_cycle),
            19,
            15,
            15,
            15,
            15,
            15,
        ];
        for ((width, heading), least) in widths.iter_mut().zip(HEADINGS).zip(least) {
            *width = least.max(heading.chars().count());
        }
        Rows { widths }
    }

    fn headings(&self) -> String {
        aligned(&HEADINGS.map(str::to_owned), &self.widths)
    }

    fn row(&self, summary: &MethodSummary) -> String {
        let worst = &summary.worst;
        let pair = |median: f64, worst: f64, decimals: usize| {
            format!("{median:.decimals$} / {worst:.decimals$}")
        };
        let depth = match (summary.depth_rms_m, worst.depth_rms_m) {
            (Some(median_m), Some(worst_m)) => pair(median_m, worst_m, 4),
            _ => "-".into(),
        };
        let wall = match (worst.range_m, worst.illuminance_klux) {
            (Some(range_m), Some(klux)) => format!("{range_m} m, {klux} klux"),
            _ => "-".into(),
        };
        let cells = [
            summary.method.name(),
            summary.method.against_cycle(),
            pair(summary.run_time_ns, worst.run_time_ns, 3),
            pair(summary.speed_up, worst.speed_up, 3),
            pair(summary.mismatch, worst.mismatch, 4),
            pair(summary.mean_shift, worst.mean_shift, 3),
            depth,
            wall,
        ];
        aligned(&cells, &self.widths)
    }
}
