//! `gdtof propose`: which chip to build.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;

use super::SceneArgs;
use super::voice::{notes, progress, say_unless_quiet};
use crate::chip::{CellLibrary, Sensor, SensorConfig};
use crate::files::{InputError, MANIFEST, OutputFile, ResultSet};
use crate::numerics::intervals::Estimate;
use crate::propose::{
    Check, ConfirmedDesign, DesignPoint, Goal, NotFound, Own, Problem, SearchResult, SearchStep,
    Space, gates_agree, search,
};
use crate::report::{Axis, Chart, Grid};

/// Arguments of `gdtof propose`.
#[derive(Args)]
pub(super) struct ProposeArgs {
    /// What designs have in common: array, SPADs, dead time and cell library of the sensor; optics and laser of the scene, but for its energy.
    #[command(flatten)]
    scene: SceneArgs,
    /// Distance of the target, m.
    #[arg(long, value_name = "M")]
    range: f64,
    /// Reflectivity of the target.
    #[arg(long, value_name = "R")]
    reflectivity: f64,
    /// Sunlight on the target, klux.
    #[arg(long, value_name = "KLUX")]
    klux: f64,
    /// Frames per second.
    #[arg(long, value_name = "HZ")]
    fps: f64,
    /// Probability that the target is in the window and found.
    #[arg(long, value_name = "P", default_value_t = 0.99)]
    detection: f64,
    /// Standard deviation of the distance, m.
    #[arg(long, value_name = "M", default_value_t = 0.1)]
    precision: f64,
    /// Histogram bins to try, 2 to 64.
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_values_t = Space::default().bins)]
    bins: Vec<usize>,
    /// CLK to try, MHz.
    #[arg(long, value_name = "MHZ,…", value_delimiter = ',', default_values_t = Space::default().clk_hz.into_iter().map(|hz| hz * 1e-6))]
    clk: Vec<f64>,
    /// THRESHOLD to try.
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_values_t = Space::default().thresholds)]
    thresholds: Vec<u8>,
    /// Errors of the guide to try, standard deviation in m.
    #[arg(long, value_name = "M,…", value_delimiter = ',', default_values_t = Space::default().guide_sigma_m)]
    guide_sigma: Vec<f64>,
    /// Seed of the photons of checks.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for designs.csv, front.svg, sensor.toml and scene.toml; created if missing.
    #[arg(long, value_name = "DIR", default_value = "propose")]
    out: PathBuf,
}

/// A point of the front that stands for something, and what `cohort` says of it.
struct Corner {
    name: &'static str,
    point: DesignPoint,
    check: Check,
}

/// What corners have least of, in the order of [`DesignPoint::costs`].
const CORNERS: [&str; 5] = [
    "least laser power",
    "smallest macropixel",
    "least data",
    "most frames",
    "worst guide",
];

/// Runs the command.
///
/// # Errors
/// Bad input, a goal that no design reaches, unwritable output.
pub(super) fn run(args: &ProposeArgs) -> anyhow::Result<()> {
    let (sensor, scene) = args.scene.read()?;
    let (goal, space) = goal_and_space(args)?;
    let problem = Problem::new(goal, sensor, &scene)?;
    let results = ResultSet::begin(&args.out, "propose")?;
    let clocks = space.clk_hz.len() * space.thresholds.len();
    let bar = progress(
        clocks as u64,
        "judging {bar:40} {pos}/{len} clocks and checks",
    );
    let begin = Instant::now();
    let told = |step| match step {
        SearchStep::Clock => bar.inc(1),
        SearchStep::Check => {
            // How many there will be shows only as they are checked.
            bar.inc_length(1);
            bar.inc(1);
        }
    };
    let found = search(&problem, &space, args.seed, told).map_err(|why| match why {
        NotFound::Limit(limit) => InputError::new("no chip does it", limit.to_string()).into(),
        NotFound::Engine(why) => anyhow::Error::from(why),
    })?;
    let took_s = begin.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let corners = corners(&found);
    let proposed = &corners[0].point;
    let (agree, cycles) = gates_agree(&problem, proposed, args.seed)?;
    anyhow::ensure!(
        agree,
        "the gates of the balanced design count otherwise than the window engine: a fault of this program"
    );

    let staging = results.staging();
    let area = area_unit(problem.sensor());
    write_designs(&staging.join("designs.csv"), &found, &corners)?;
    chart(&problem, &found, proposed, area).write(&staging.join("front.svg"))?;
    let chip = Sensor::from(problem.config_of(&proposed.design));
    OutputFile::write_text(&staging.join("sensor.toml"), &chip.commented())?;
    let target = problem.scene_of(&proposed.design);
    OutputFile::write_text(&staging.join("scene.toml"), &target.commented())?;
    let asked = serde_json::json!({
        "goal": goal,
        "sensor": SensorConfig::clone(problem.sensor()),
        "lidar": target.lidar,
        "seed": args.seed,
    });
    notes(results.commit(asked)?);
    say_unless_quiet(format_args!(
        "A target of reflectivity {} at {} m under {} klux, found with probability {} in {} frames a second, to {} m:\n\
         {} designs by theory, {} of them on the front and confirmed on cohort, in {took_s:.1} s; its corners are\n\n{}\n",
        goal.reflectivity,
        goal.range_m,
        goal.illuminance_klux,
        goal.detection,
        goal.fps,
        goal.precision_m,
        found.tried,
        found.front.len(),
        grid(&corners, &found, area),
    ))?;
    say_unless_quiet(sentences(&problem, &found, &corners))?;
    let (laser, design) = (1e2 * proposed.times_class_1, &proposed.design);
    say_unless_quiet(format_args!(
        "Every chip on the front meets its static timing. The balanced one's laser has {laser:.0} % of what class 1 allows at {} frames a second.\n\
         One of its macropixels, simulated gate by gate, counts as the window engine in {cycles} laser cycles.\n\
         In {out}: designs.csv front.svg front.csv sensor.toml scene.toml {MANIFEST}\n\n  \
         gdtof frame --sensor {out}/sensor.toml --scene {out}/scene.toml --stop-periods {} --laser-cycles {} --guide truth:sigma_m={}\n",
        goal.fps,
        design.stop_periods,
        design.laser_cycles,
        design.guide_sigma_m,
        out = args.out.display(),
    ))?;
    Ok(())
}

/// What is asked for, and what is tried.
fn goal_and_space(args: &ProposeArgs) -> Result<(Goal, Space), InputError> {
    let goal = Goal {
        range_m: args.range,
        reflectivity: args.reflectivity,
        illuminance_klux: args.klux,
        fps: args.fps,
        detection: args.detection,
        precision_m: args.precision,
    };
    let space = Space {
        bins: args.bins.clone(),
        clk_hz: args.clk.iter().map(|mhz| mhz * 1e6).collect(),
        thresholds: args.thresholds.clone(),
        guide_sigma_m: args.guide_sigma.clone(),
    };
    match goal.fault().or_else(|| space.fault()) {
        Some(fault) => Err(InputError::new(option_of(&fault), fault)),
        None => Ok((goal, space)),
    }
}

/// The option that gives the setting which a complaint begins with.
fn option_of(fault: &str) -> &'static str {
    let options = [
        ("range_m", "--range"),
        ("reflectivity", "--reflectivity"),
        ("illuminance_klux", "--klux"),
        ("fps", "--fps"),
        ("detection", "--detection"),
        ("precision_m", "--precision"),
        ("bins", "--bins"),
        ("clk_hz", "--clk"),
        ("thresholds", "--thresholds"),
        ("guide_sigma_m", "--guide-sigma"),
    ];
    let named = options.iter().find(|(key, _)| fault.starts_with(key));
    named.map_or("gdtof propose", |(_, option)| option)
}

/// In what areas are.
fn area_unit(sensor: &SensorConfig) -> &'static str {
    let library = CellLibrary::from_config(sensor).ok();
    match library.and_then(CellLibrary::from_file) {
        Some(_) => "um2",
        None => "transistors",
    }
}

/// The balanced design, then those with the least of something, each once.
fn corners(found: &SearchResult) -> Vec<Corner> {
    let least = |cost: &dyn Fn(&DesignPoint) -> f64| -> ConfirmedDesign {
        let order = |one: &ConfirmedDesign| (cost(&one.point), one.point.ln_cost());
        let least = found.front.iter().copied().reduce(|best, next| {
            if order(&next) < order(&best) {
                next
            } else {
                best
            }
        });
        least.expect("a front has a point")
    };
    let named = |name, ConfirmedDesign { point, check }| Corner { name, point, check };
    let mut chosen = vec![named("balanced", least(&DesignPoint::ln_cost))];
    for (at, name) in CORNERS.into_iter().enumerate() {
        let corner = named(name, least(&|point| point.costs()[at]));
        if !chosen.iter().any(|known| known.point == corner.point) {
            chosen.push(corner);
        }
    }
    chosen
}

/// Columns of costs and design that the table and the CSV share.
fn cells(point: &DesignPoint) -> [String; 12] {
    let design = &point.design;
    [
        format!("{:.3}", 1e3 * point.power_w),
        format!("{:.0}", point.area),
        format!("{:.2}", 1e-6 * point.data_bit_s),
        format!("{:.1}", point.fps),
        design.guide_sigma_m.to_string(),
        design.bins.to_string(),
        design.bin_bits.to_string(),
        format!("{}", (design.clk_hz * 1e-6 * 1e3).round() * 1e-3),
        design.threshold.to_string(),
        format!("{:.4}", design.pulse_energy_uj),
        format!(
            "{:.1}",
            1e-3 * design.clk_hz / f64::from(design.stop_periods)
        ),
        design.laser_cycles.to_string(),
    ]
}

fn headings(area: &str) -> Vec<String> {
    format!("|laser mW|{area}|Mbit/s|frames/s|guide m|bins|bits|CLK MHz|THRESHOLD|pulse uJ|kHz|laser cycles")
        .split('|')
        .map(str::to_owned)
        .collect()
}

/// A measurement beside its theory.
fn theory_and_measured(theory: f64, measured: &Estimate, decimals: usize) -> String {
    format!("{theory:.decimals$} / {:.decimals$}", measured.value)
}

fn grid(corners: &[Corner], found: &SearchResult, area: &str) -> Grid {
    let checked = ["found, % (theory / cohort)", "sigma, m"].map(str::to_owned);
    let mut grid = Grid::new(headings(area).into_iter().chain(checked));
    for Corner { name, point, check } in corners {
        let own = [(*name).to_owned()].into_iter().chain(cells(point));
        let share = check.detection.map(|share| 100.0 * share);
        grid.push(own.chain([
            theory_and_measured(100.0 * point.detection, &share, 2),
            theory_and_measured(point.precision_m, &check.precision_m, 3),
        ]));
    }
    if let Some(point) = found.own.point() {
        let own = ["this sensor".to_owned()].into_iter().chain(cells(point));
        let checked = [
            format!("{:.2}", 100.0 * point.detection),
            format!("{:.3}", point.precision_m),
        ];
        grid.push(own.chain(checked));
    }
    grid
}

/// What to know beside the table: where theory and engine differ, and what becomes of the sensor as it is.
fn sentences(problem: &Problem, found: &SearchResult, corners: &[Corner]) -> String {
    let mut text = String::new();
    for Corner { name, point, check } in corners.iter().filter(|c| !c.check.agrees(&c.point)) {
        let [share, sigma] = [check.detection.map(|s| 100.0 * s), check.precision_m];
        text += &format!(
            "{name}: theory and cohort differ: found {:.2} % by theory, {:.2} % ({:.2} to {:.2}) on cohort; sigma {:.4} m, {:.4} m ({:.4} to {:.4})\n",
            100.0 * point.detection,
            share.value,
            share.low,
            share.high,
            point.precision_m,
            sigma.value,
            sigma.low,
            sigma.high,
        );
    }
    let sensor = problem.sensor();
    let usual = SensorConfig::default();
    let design_values = |s: &SensorConfig| {
        (
            s.bins,
            s.bin_bits,
            s.counter_bits,
            s.clk_hz as u64,
            s.threshold,
        )
    };
    let name = if design_values(sensor) == design_values(&usual) {
        "The QuantIC4x4"
    } else {
        "The sensor itself"
    };
    text + &match &found.own {
        Own::OnFront(_) => format!("{name} is on the front.\n\n"),
        Own::Impossible(limit) => format!("{name} cannot do it: {limit}.\n\n"),
        Own::Beaten(own, better) => {
            let best = &better[0];
            let [mine, theirs] = [own, best].map(DesignPoint::costs);
            let what = [
                "laser power",
                "macropixel",
                "data",
                "time of a frame",
                "exactness of the guide",
            ];
            let less = (what.iter().zip(mine.iter().zip(&theirs)))
                .filter(|(_, (mine, theirs))| theirs < mine)
                .map(|(what, (mine, theirs))| {
                    format!("{:.0} % of its {what}", 1e2 * theirs / mine)
                });
            let less: Vec<String> = less.collect();
            let design = &best.design;
            format!(
                "{name} is not on the front: {} of its points beat it, best {} bins of {} bits at {} MHz with THRESHOLD {}, {:.4} uJ at {:.1} kHz\nand a guide of {} m, which take {}, and no more of anything else.\n\n",
                better.len(),
                design.bins,
                design.bin_bits,
                design.clk_hz * 1e-6,
                design.threshold,
                design.pulse_energy_uj,
                1e-3 * design.clk_hz / f64::from(design.stop_periods),
                design.guide_sigma_m,
                less.join(", "),
            )
        }
    }
}

/// All of the front and the sensor itself by their numbers, with what was measured of the front.
fn write_designs(path: &Path, found: &SearchResult, corners: &[Corner]) -> anyhow::Result<()> {
    let numbers = |point: &DesignPoint| toml::Table::try_from(point);
    let keys = numbers(&found.front[0].point)?;
    let measured = "cohort_detection | cohort_detection_low | cohort_detection_high | cohort_precision_m | cohort_precision_low_m | cohort_precision_high_m";
    let headings = ["corner"]
        .into_iter()
        .chain(keys.keys().map(String::as_str));
    let mut grid = Grid::new(headings.chain(measured.split(" | ")));
    let mut push = |name: &str, point: &DesignPoint, measured: [String; 6]| -> anyhow::Result<()> {
        let numbers = numbers(point)?;
        let numbers = numbers.values().map(ToString::to_string);
        grid.push([name.to_owned()].into_iter().chain(numbers).chain(measured));
        Ok(())
    };
    for ConfirmedDesign { point, check } in &found.front {
        let corner = corners.iter().find(|corner| corner.point == *point);
        let [a, b] = [check.detection, check.precision_m];
        let measured = [a.value, a.low, a.high, b.value, b.low, b.high].map(|x| x.to_string());
        push(corner.map_or("", |corner| corner.name), point, measured)?;
    }
    if let Some(own) = found.own.point() {
        push("this sensor", own, [const { String::new() }; 6])?;
    }
    Ok(OutputFile::write_with(path, |out| grid.write_csv(out))?)
}

/// Laser power over area; how fast chips are by their marks.
fn chart(problem: &Problem, found: &SearchResult, proposed: &DesignPoint, area: &str) -> Chart {
    let goal = problem.goal();
    let title = format!(
        "Designs for reflectivity {} at {} m, {} klux, {} frames/s that nothing beats",
        goal.reflectivity, goal.range_m, goal.illuminance_klux, goal.fps
    );
    let area_and_power = |point: &DesignPoint| (point.area, 1e3 * point.power_w);
    let front = || found.front.iter().map(|one| &one.point);
    let powers = front().map(|point| point.power_w);
    let [least, most] = [f64::min, f64::max].map(|of| powers.clone().reduce(of).unwrap_or(1.0));
    let power = if most > 10.0 * least {
        Axis::log("mean laser power (mW)")
    } else {
        Axis::linear("mean laser power (mW)")
    };
    let area = Axis::linear(format!("macropixel ({area})"));
    let mut chart = Chart::new(title, area, power);
    let ends = [1.0, 2.0, 5.0, f64::INFINITY];
    for pair in ends.windows(2) {
        let [from, to] = [pair[0] * goal.fps, pair[1] * goal.fps];
        let within = |point: &&DesignPoint| (from..to).contains(&point.fps.max(goal.fps));
        let points: Vec<(f64, f64)> = front().filter(within).map(area_and_power).collect();
        let name = if to.is_finite() {
            format!("{from:.0} to {to:.0} frames/s")
        } else {
            format!("{from:.0} frames/s and more")
        };
        if !points.is_empty() {
            chart = chart.points(name, points);
        }
    }
    if let Some(point) = found.own.point() {
        chart = chart.points("this sensor", [area_and_power(point)]);
    }
    chart.points("balanced: sensor.toml", [area_and_power(proposed)])
}
