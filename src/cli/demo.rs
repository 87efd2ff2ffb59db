//! `gdtof demo`: the experiments of the thesis's demonstrator.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::voice::{announce, notes, progress, say_unless_quiet};
use crate::demo::disturbed::{Disturbance, DisturbanceOutcome};
use crate::demo::show::{Show, ShowResult};
use crate::demo::{Demonstrator, LASER_CYCLES, limit, shows, sweep};
use crate::files::{InputError, MANIFEST, OutputFile, ResultSet};
use crate::guide::{BehaviouralStereo, Guide, options};
use crate::report::{Grid, write_ply};
use crate::units::Time;

/// Most laser cycles of an exposure: more than a second of 80 kHz.
const MOST_LASER_CYCLES: i64 = 100_000;

/// The experiments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
enum Demo {
    /// A van drives away to 75 m in clear weather (Fig. 99, 100).
    Van,
    /// A pedestrian and a car in fog of several visibilities (Fig. 101).
    Fog,
    /// A figure behind a glass door (Fig. 102).
    Glass,
    /// A street without light and without a guide: windows step until they find a target, and hold it.
    Night,
    /// A pedestrian comes nearer, and the right camera is misaligned (Fig. 70, 107).
    Yaw,
    /// A car drives away at up to 65 mph while frames come three times a second (6.5.3).
    Speed,
    /// What the QuantIC4x4 needs for 200 m at 25 frames a second (7.3.3).
    Limit,
    /// A figure stands at several distances up to 50 m, under 72 klux (Fig. 103 to 105).
    Sweep,
    /// Ten vehicles with lidars: how they disturb guided, full, sliding and zooming histograms (8.2).
    Interference,
    /// A road sign beside a pedestrian, in lenses that scatter light.
    Sign,
    /// A wall that reflects laser light onto a target.
    Corner,
}

impl Demo {
    /// Processor time with the calibration, s, of the release build on one thread, those of `sign` and `interference` beside other work.
    fn processor_s(self) -> f64 {
        match self {
            Demo::Glass | Demo::Sweep => 9.0,
            Demo::Fog | Demo::Yaw | Demo::Speed | Demo::Limit | Demo::Corner => 13.0,
            Demo::Van | Demo::Night => 33.0,
            Demo::Sign => 600.0,
            Demo::Interference => 1700.0,
        }
    }

    /// Laser cycles of an exposure, unless others are asked for.
    fn laser_cycles(self) -> u32 {
        if self == Demo::Night {
            shows::NIGHT_LASER_CYCLES
        } else {
            LASER_CYCLES
        }
    }
}

/// Arguments of `gdtof demo`.
#[derive(Args)]
pub(super) struct DemoArgs {
    /// Experiment to run.
    #[arg(value_enum)]
    demo: Demo,
    /// Folder for the results; created if missing [default: the name of the demo].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Guide to use instead of the stereo pair, as in `gdtof drive`; several are fused.
    #[arg(long, value_name = "GUIDE")]
    guide: Vec<String>,
    /// Seed of photons and guide errors.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Step of the laser that calibrates the chip's delay lines before the demo, ps.
    #[arg(long, value_name = "PS", default_value_t = 40.0)]
    calibration_step_ps: f64,
    /// Laser cycles of each exposure: few for a quick look [default: 16000, and 2000 in night].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MOST_LASER_CYCLES))]
    laser_cycles: Option<u32>,
}

/// The request, for the manifest.
#[derive(Serialize)]
struct Configuration {
    demo: Demo,
    guide: Vec<String>,
    seed: u64,
    calibration_step_ps: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    laser_cycles: Option<u32>,
}

/// Runs the command.
///
/// # Errors
/// Bad input, unwritable output, and what drives and the calibration report.
pub(super) fn run(args: &DemoArgs) -> anyhow::Result<()> {
    if !(1.0..=200.0).contains(&args.calibration_step_ps) {
        let message = format!("{} is impossible; give 1 to 200", args.calibration_step_ps);
        return Err(InputError::new("--calibration-step-ps", message).into());
    }
    if args.demo == Demo::Limit && args.laser_cycles.is_some() {
        let message = "is no part of limit, which finds how many fit into a frame; leave it out";
        return Err(InputError::new("--laser-cycles", message).into());
    }
    let guide = if args.guide.is_empty() {
        None
    } else {
        let texts = args.guide.iter().map(String::as_str);
        Some(options::parse_all(texts, "--guide")?)
    };
    let name = args
        .demo
        .to_possible_value()
        .expect("every demo has a name");
    let out = args
        .out
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("demo_{}", name.get_name())));
    let results = ResultSet::begin(&out, "demo")?;
    let usual = f64::from(args.demo.laser_cycles());
    let share = args
        .laser_cycles
        .map_or(1.0, |cycles| f64::from(cycles) / usual);
    let seconds = args.demo.processor_s() * share / rayon::current_num_threads() as f64;
    announce(name.get_name(), seconds);
    let began = Instant::now();
    let bar = |what: &str, length: u64| {
        let template = format!("{what} {{bar:40}} {{pos}}/{{len}}, {{eta}} left");
        progress(length, &template)
    };
    let calibrated = || -> anyhow::Result<Demonstrator> {
        let progress = bar("calibrating", 2048);
        let step = Time::from_s(args.calibration_step_ps * 1e-12);
        let mut demonstrator = Demonstrator::calibrated(step, || progress.inc(1))?;
        if let Some(cycles) = args.laser_cycles {
            demonstrator.exposure.laser_cycles = cycles;
        }
        progress.finish_and_clear();
        Ok(demonstrator)
    };
    let mut text = match args.demo {
        Demo::Limit => {
            let runs = limit::LASER_PERIODS.len() * limit::ENERGIES.len();
            let progress = bar("driving", (runs * limit::DISPARITIES_PX.len()) as u64);
            let limits = limit::limits(args.seed, || progress.inc(1))?;
            progress.finish_and_clear();
            write_limits(results.staging(), &limits)?
        }
        Demo::Interference | Demo::Sign | Demo::Corner => {
            let disturbance = match args.demo {
                Demo::Interference => Disturbance::interference(),
                Demo::Sign => Disturbance::sign(),
                _ => Disturbance::corner(),
            };
            let demonstrator = calibrated()?;
            let draws = disturbance.draws * disturbance.cases.len() as u64;
            let progress = bar("drawing", draws);
            let outcomes = disturbance.outcomes(&demonstrator, args.seed, || progress.inc(1))?;
            progress.finish_and_clear();
            let cycles = demonstrator.exposure.laser_cycles;
            write_disturbed(results.staging(), disturbance.name, cycles, &outcomes)?
        }
        Demo::Sweep => {
            let demonstrator = calibrated()?;
            let frames = sweep::DISTANCES_M.len() as u64 * u64::from(sweep::FRAMES);
            let progress = bar("sweeping", frames);
            let points = sweep::sweep(&demonstrator, sweep::REFLECTIVITY, args.seed, || {
                progress.inc(1);
            })?;
            progress.finish_and_clear();
            write_sweep(results.staging(), &points)?
        }
        shown => {
            let demonstrator = calibrated()?;
            let shows = match shown {
                Demo::Van => shows::van,
                Demo::Fog => shows::fog,
                Demo::Glass => shows::glass,
                Demo::Night => shows::night,
                Demo::Yaw => shows::yaw,
                Demo::Speed => shows::speed,
                _ => unreachable!("they have no shows"),
            };
            let mut shows = shows(&demonstrator, args.seed);
            if let Some(cycles) = args.laser_cycles {
                for show in &mut shows {
                    show.settings.frame.exposure.laser_cycles = cycles;
                }
            }
            if let Some(guide) = &guide {
                // Those that show what another guide makes of it keep theirs.
                let of_stereo =
                    |show: &&mut Show| show.settings.frame.guide.name() == BehaviouralStereo.name();
                for show in shows.iter_mut().filter(of_stereo) {
                    show.settings.frame.guide = guide.clone();
                }
            }
            let frames = shows.iter().map(|show| u64::from(show.frames)).sum();
            let progress = bar("driving", frames);
            let mut text = String::new();
            for show in &shows {
                let shown = show.run(&demonstrator, || progress.inc(1))?;
                text += &write_shown(results.staging(), show, &shown)?;
            }
            progress.finish_and_clear();
            text
        }
    };
    let configuration = Configuration {
        demo: args.demo,
        guide: args.guide.clone(),
        seed: args.seed,
        calibration_step_ps: args.calibration_step_ps,
        laser_cycles: args.laser_cycles,
    };
    let names = file_names(results.staging())?;
    notes(results.commit(&configuration)?);
    text += &format!(
        "run time {:.1} s\nin {}: {names} {MANIFEST}\n",
        began.elapsed().as_secs_f64(),
        out.display(),
    );
    Ok(say_unless_quiet(text)?)
}

fn file_names(folder: &Path) -> std::io::Result<String> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        names.push(entry?.file_name().to_string_lossy().into_owned());
    }
    names.sort();
    Ok(names.join(" "))
}

/// Pictures, point clouds, and what became of the targets.
fn write_shown(folder: &Path, show: &Show, shown: &ShowResult) -> anyhow::Result<String> {
    let name = &show.name;
    for (number, picture) in &shown.pictures {
        picture.write_png(&folder.join(format!("{name}_{number:03}.png")))?;
    }
    for (number, points) in &shown.clouds {
        write_ply(&folder.join(format!("{name}_{number:03}.ply")), points)?;
    }
    let json = serde_json::to_string_pretty(&shown.frames)?;
    OutputFile::write_text(&folder.join(format!("{name}.json")), &(json + "\n"))?;
    let [load_s, exposure_s, readout_s] = shown.chip_s.map(|s| s * 1e3);
    let mut text = format!(
        "{name}: guide {:.0} ms, load {load_s:.2} ms, exposure {exposure_s:.1} ms, readout {readout_s:.2} ms: {:.2} fps\n",
        show.settings.clock.guide_latency_s * 1e3,
        1.0 / shown.period_s
    );
    for (n, target) in show.targets.iter().enumerate() {
        for frame in &shown.frames {
            let found = &frame.targets[n];
            text += &format!("  frame {}, {} {found}\n", frame.number, target.name);
        }
    }
    for outcome in &shown.schemes {
        text += &format!(
            "  {}, {} bins, {} exposures: {}\n",
            outcome.scheme, outcome.bins, outcome.exposures, outcome.found
        );
    }
    Ok(text)
}

/// What 200 m at 25 fps take.
fn write_limits(folder: &Path, limits: &[limit::Limit]) -> anyhow::Result<String> {
    let json = serde_json::to_string_pretty(limits)?;
    OutputFile::write_text(&folder.join("limit.json"), &(json + "\n"))?;
    let mut grid = Grid::headed(
        "laser | cycles | energy | stereo error | in window | right to a bin | wrong | no peak",
    );
    for at in limits {
        let clock_hz = 384e6 / f64::from(at.stop_periods);
        let found = &at.found;
        let percent = |n: usize| format!("{:.0} %", 100.0 * n as f64 / found.seen_by.max(1) as f64);
        let without = found.without.values().sum();
        grid.push([
            format!("{:.0} kHz", clock_hz * 1e-3),
            at.laser_cycles.to_string(),
            format!("{} x", at.energy),
            format!("{} px", at.disparity_px),
            percent(found.in_window),
            percent(found.right),
            percent(found.wrong),
            percent(without),
        ]);
    }
    Ok(format!(
        "QuantIC4x4, target of 10 % at {} m, {} klux, {} fps; energy a macropixel over the demonstrator's\n{grid}",
        limit::RANGE_M,
        limit::KLUX,
        limit::FPS,
    ))
}

/// What a disturbance costs each scheme.
fn write_disturbed(
    folder: &Path,
    name: &str,
    laser_cycles: u32,
    outcomes: &[DisturbanceOutcome],
) -> anyhow::Result<String> {
    let json = serde_json::to_string_pretty(outcomes)?;
    OutputFile::write_text(&folder.join("outcomes.json"), &(json + "\n"))?;
    let mut grid = Grid::headed(&format!(
        "{name} | scheme | bins | wrong | no depth | mean error, m"
    ));
    let percent = |ends: [f64; 3]| {
        let [value, low, high] = ends.map(|share| 100.0 * share);
        format!("{value:.1} % ({low:.1} to {high:.1})")
    };
    for at in outcomes {
        grid.push([
            at.case.clone(),
            at.scheme.to_owned(),
            at.bins.to_string(),
            percent(at.wrong),
            percent(at.lost),
            at.mean_error_m
                .map_or("-".into(), |error_m| format!("{error_m:.3}")),
        ]);
    }
    Ok(format!(
        "HSLIDAR, {laser_cycles} laser cycles for each scheme, 30 klux: shares of macropixels on targets, with 95 % intervals, and the mean error of depths that are right to a bin\n{grid}"
    ))
}

/// Fig. 103 to 105.
fn write_sweep(folder: &Path, points: &[sweep::SweepPoint]) -> anyhow::Result<String> {
    for (number, chart) in sweep::charts(points) {
        chart.write(&folder.join(format!("fig_{number}.svg")))?;
    }
    let json = serde_json::to_string_pretty(points)?;
    OutputFile::write_text(&folder.join("sweep.json"), &(json + "\n"))?;
    let mut grid = Grid::headed(
        "distance, m | depths | in window | mean error, m | sigma, m | RMS, m | guide RMS, m",
    );
    for p in points {
        grid.push([
            format!("{:.0}", p.distance_m),
            format!("{} of {}", p.depths, p.samples),
            p.in_window.to_string(),
            format!("{:.3}", p.mean_error_m),
            format!("{:.3}", p.sigma_m),
            format!("{:.3}", p.rms_m),
            format!("{:.3}", p.guide_rms_m),
        ]);
    }
    Ok(grid.to_string())
}
