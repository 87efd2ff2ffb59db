//! `gdtof speed`: how fast the fast engines are, how that grows with the array and with threads, and the memory it takes.
//!
//! Every figure is taken in a process of its own, so that its peak memory and its number of threads are its own. The
//! frame is that of [`SpeedFrame`]: 8 Mcounts/s and a tenth of a signal photon a laser cycle on every macropixel.

use std::process::Command;
use std::time::Instant;

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};

use super::say;
use crate::engine::{Cohort, CohortOptions, Cycle, Window};
use crate::photon::SpadEvent;
use crate::report::Grid;
use crate::system::{SPEED_LASER_CYCLES, SpeedFrame};

/// CLK periods in a laser cycle at 80 kHz and 384 MHz (thesis 6.4).
const STOP_PERIODS: u32 = 4800;

/// Those of the cycle engine's exposure: the reach of the P-counter, without the rest that it would skip.
const CYCLE_STOP_PERIODS: u32 = 520;

/// Laser cycles of the cycle engine's exposure, whose photons are drawn beforehand and kept: 350 MB of them.
fn cycle_laser_cycles(side: u16) -> u32 {
    let macropixels = u32::from(side).pow(2);
    (500 * 64 * 64 / macropixels).clamp(1, 500)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
enum SpeedEngine {
    /// Logic only: photons are drawn and sorted beforehand.
    Cycle,
    /// Photon stream included.
    Window,
    /// All of it.
    Cohort,
}

/// Arguments of `gdtof speed`.
#[derive(Args)]
pub struct SpeedArgs {
    /// Timed runs of each figure; the median counts.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    runs: u16,
    /// Largest array, macropixels to a side.
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u16).range(1..=256))]
    largest: u16,
    /// JSON instead of the table.
    #[arg(long)]
    json: bool,
    /// One engine only, with --side and --threads: what a figure's own process does.
    #[arg(long, hide = true, requires_all = ["side", "threads"])]
    only: Option<SpeedEngine>,
    #[arg(long, hide = true)]
    side: Option<u16>,
    #[arg(long, hide = true)]
    threads: Option<usize>,
}

/// One figure.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Figure {
    engine: SpeedEngine,
    side: u16,
    threads: usize,
    laser_cycles: u32,
    stop_periods: u32,
    /// Median wall-clock time of an exposure, s.
    median_s: f64,
    /// Shortest of the runs, s.
    least_s: f64,
    /// Macropixel-CLK periods of the exposure.
    macropixel_clk: f64,
    /// Largest resident memory of the process, KiB; where the system tells.
    peak_kib: Option<u64>,
}

/// Runs the command.
///
/// # Errors
/// When a process for a figure cannot be started.
pub fn run(args: &SpeedArgs) -> anyhow::Result<()> {
    if let (Some(engine), Some(side), Some(threads)) = (args.only, args.side, args.threads) {
        let figure = measure(engine, side, threads, args.runs)?;
        say(format_args!("{}\n", serde_json::to_string(&figure)?))?;
        return Ok(());
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let plan = plan(args.largest, cores.min(2));
    let progress = ProgressBar::new(plan.len() as u64).with_style(ProgressStyle::with_template(
        "measuring {bar:40} {pos}/{len} figures, {eta} left",
    )?);
    let mut figures = Vec::new();
    for (engine, side, threads) in plan {
        figures.push(in_its_own_process(engine, side, threads, args.runs)?);
        progress.inc(1);
    }
    progress.finish_and_clear();
    if args.json {
        say(format_args!(
            "{}\n",
            serde_json::to_string_pretty(&figures)?
        ))?;
    } else {
        say(table(&figures))?;
    }
    Ok(())
}

/// Engines by size at `threads`, then 64×64 on one.
fn plan(largest: u16, threads: usize) -> Vec<(SpeedEngine, u16, usize)> {
    let mut plan = Vec::new();
    for engine in [SpeedEngine::Cycle, SpeedEngine::Window, SpeedEngine::Cohort] {
        let sides = [1, 4, 16, 64, 128, 256].into_iter();
        plan.extend(
            sides
                .filter(|&side| side <= largest)
                .map(|side| (engine, side, threads)),
        );
        if threads > 1 && largest >= 64 {
            plan.push((engine, 64, 1));
        }
    }
    plan
}

fn in_its_own_process(
    engine: SpeedEngine,
    side: u16,
    threads: usize,
    runs: u16,
) -> anyhow::Result<Figure> {
    let engine = engine.to_possible_value().expect("no engine is skipped");
    let numbers = [side.to_string(), threads.to_string(), runs.to_string()];
    let output = Command::new(std::env::current_exe()?)
        .args(["speed", "--only", engine.get_name(), "--side", &numbers[0]])
        .args(["--threads", &numbers[1], "--runs", &numbers[2]])
        .output()
        .context("a process for a figure cannot be started")?;
    if !output.status.success() {
        bail!("{}", String::from_utf8_lossy(&output.stderr).trim());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

fn measure(engine: SpeedEngine, side: u16, threads: usize, runs: u16) -> anyhow::Result<Figure> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()?;
    let (stop_periods, laser_cycles) = match engine {
        SpeedEngine::Cycle => (CYCLE_STOP_PERIODS, cycle_laser_cycles(side)),
        SpeedEngine::Window | SpeedEngine::Cohort => (STOP_PERIODS, SPEED_LASER_CYCLES),
    };
    let frame = SpeedFrame::new(side.into(), stop_periods, laser_cycles);
    let (config, exposure) = (&frame.config, &frame.exposure);
    let mut times = match engine {
        SpeedEngine::Cycle => pool.install(|| cycle_times(&frame, runs))?,
        SpeedEngine::Window => {
            let window = Window::new(config, exposure);
            pool.install(|| timed(runs, || frame.expose(&window)))?
        }
        SpeedEngine::Cohort => {
            let cohort = Cohort::new(config, exposure, CohortOptions::default());
            pool.install(|| timed(runs, || frame.expose(&cohort)))?
        }
    };
    times.sort_by(f64::total_cmp);
    let pixels = f64::from(side) * f64::from(side);
    Ok(Figure {
        engine,
        side,
        threads,
        laser_cycles,
        stop_periods,
        median_s: times[times.len() / 2],
        least_s: times[0],
        macropixel_clk: pixels * f64::from(stop_periods) * f64::from(laser_cycles),
        peak_kib: peak_kib(),
    })
}

fn cycle_times(frame: &SpeedFrame, runs: u16) -> anyhow::Result<Vec<f64>> {
    let lit = frame
        .pixels
        .iter()
        .filter_map(|p| Some((p, p.light.as_ref()?)));
    let photons: Vec<Vec<SpadEvent>> = lit
        .map(|(pixel, light)| frame.stream.pixel_events(pixel.number, light).events)
        .collect();
    let pulses: Vec<&[SpadEvent]> = photons.iter().map(Vec::as_slice).collect();
    let starts: Vec<u16> = frame.pixels.iter().map(|pixel| pixel.start).collect();
    let engine = Cycle::new(&frame.config, &frame.exposure);
    let packed = engine.pack(&starts, &pulses);
    timed(runs, || engine.run(&starts, &packed))
}

/// Wall-clock times of `runs` runs after one that is not counted, s.
fn timed<T, E: std::error::Error + Send + Sync + 'static>(
    runs: u16,
    run: impl Fn() -> Result<T, E>,
) -> anyhow::Result<Vec<f64>> {
    run()?;
    (0..runs)
        .map(|_| {
            let begin = Instant::now();
            std::hint::black_box(run()?);
            Ok(begin.elapsed().as_secs_f64())
        })
        .collect()
}

/// Largest resident memory of this process, KiB, where /proc tells.
fn peak_kib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}

fn table(figures: &[Figure]) -> String {
    let mut grid = Grid::new([
        "engine",
        "array",
        "threads",
        "laser cycles",
        "median (ms)",
        "least (ms)",
        "G macropixel-CLK/s",
        "peak (MiB)",
    ]);
    for figure in figures {
        let name = match figure.engine {
            SpeedEngine::Cycle => "cycle, logic only",
            SpeedEngine::Window => "window, with its photons",
            SpeedEngine::Cohort => "cohort",
        };
        let peak = figure
            .peak_kib
            .map(|kib| format!("{:.0}", kib as f64 / 1024.0));
        grid.push([
            name.to_owned(),
            format!("{0}x{0}", figure.side),
            figure.threads.to_string(),
            format!("{} of {} CLK", figure.laser_cycles, figure.stop_periods),
            format!("{:.3}", 1e3 * figure.median_s),
            format!("{:.3}", 1e3 * figure.least_s),
            format!("{:.2}", 1e-9 * figure.macropixel_clk / figure.median_s),
            peak.unwrap_or_else(|| "-".into()),
        ]);
    }
    format!(
        "8 Mcounts/s and 0.1 signal photons a laser cycle on every macropixel, 384 MHz\n\n{grid}\n\
         The silicon exposes {SPEED_LASER_CYCLES} laser cycles in {:.0} ms.\n",
        1e3 * f64::from(SPEED_LASER_CYCLES) * f64::from(STOP_PERIODS) / 384e6,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_engine_is_measured_small() {
        for engine in [SpeedEngine::Cycle, SpeedEngine::Window, SpeedEngine::Cohort] {
            let figure = measure(engine, 1, 1, 1).unwrap();
            assert!(figure.median_s > 0.0 && figure.least_s <= figure.median_s);
            assert!(table(&[figure]).contains("1x1"));
        }
    }

    #[test]
    fn the_plan_ends_at_the_largest_array() {
        let plan = plan(16, 2);
        assert_eq!(plan.len(), 9);
        assert!(
            plan.iter()
                .all(|&(_, side, threads)| side <= 16 && threads == 2)
        );
    }
}
