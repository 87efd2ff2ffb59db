//! `gdtof speed`: how fast the engines are, which part of an exposure each figure leaves out, what the worst frames
//! cost, how time grows with the array and with threads, and the memory it takes.
//!
//! Every figure is taken in a process of its own, so that its peak memory and its number of threads are its own, as
//! often as asked, after one run that is not counted. Runs of one thread are timed by its processor time, which
//! neighbours disturb little; more threads only by the wall clock, which knows how they wait for each other. Both
//! clocks count nanoseconds.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, bail};
use clap::Args;
use cpu_time::ProcessTime;
use serde::{Deserialize, Serialize};

use super::voice::{progress, say_file, say_json, say_unless_quiet};
use crate::engine::{Cohort, CohortOptions, Cycle, Expose, Replay, Window};
use crate::files::{InputError, read_text};
use crate::photon::SpadEvent;
use crate::report::Grid;
use crate::system::{SPEED_LASER_CYCLES, SpeedCase, SpeedFrame};

/// CLK periods in a laser cycle at 80 kHz and 384 MHz (thesis 6.4).
const STOP_PERIODS: u32 = 4800;

/// Those of the cycle engine's exposure: the reach of the P-counter, without the rest that it would skip.
const CYCLE_STOP_PERIODS: u32 = 520;

/// Macropixels of the array on which engines are compared.
const ARRAY: (usize, usize) = (64, 64);

/// Macropixels that the cycle engine takes in one word. An array of this size has all start values in that word; in
/// [`ARRAY`] the engine sorts them into words of 64 values each.
const ONE_WORD: (usize, usize) = (16, 32);

/// What is run between the two readings of the clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum TimedWork {
    /// The cycle engine's logic on packed pulses.
    CycleLogic,
    /// The same, control simulated in every laser cycle.
    CycleLiveLogic,
    /// Packing pulses and the logic.
    CyclePacking,
    /// Photon stream, packing and logic.
    CycleWhole,
    /// The window engine on recorded pulses.
    WindowPulses,
    /// Photon stream and window engine.
    WindowWhole,
    /// All of the cohort engine.
    Cohort,
}

impl TimedWork {
    /// Its name, and what of an exposure is not done between the readings of the clock.
    fn texts(self) -> [&'static str; 2] {
        match self {
            TimedWork::CycleLogic => [
                "cycle, logic",
                "photons, packing, control after the recorded cycle",
            ],
            TimedWork::CycleLiveLogic => ["cycle, logic with live control", "photons, packing"],
            TimedWork::CyclePacking => [
                "cycle, packing and logic",
                "photons, control after the recorded cycle",
            ],
            TimedWork::CycleWhole => ["cycle, all", "control after the recorded cycle"],
            TimedWork::WindowPulses => [
                "window, recorded pulses",
                "photons, CLK periods outside windows",
            ],
            TimedWork::WindowWhole => ["window, all", "CLK periods, and photons, outside windows"],
            TimedWork::Cohort => ["cohort, all", "photons, CLK periods"],
        }
    }

    fn is_cycle(self) -> bool {
        use TimedWork::{Cohort, WindowPulses, WindowWhole};
        !matches!(self, WindowPulses | WindowWhole | Cohort)
    }
}

/// What a figure is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Subject {
    work: TimedWork,
    case: SpeedCase,
    rows: usize,
    cols: usize,
    threads: usize,
}

impl Subject {
    fn new(work: TimedWork, case: SpeedCase, (rows, cols): (usize, usize), threads: usize) -> Self {
        Subject {
            work,
            case,
            rows,
            cols,
            threads,
        }
    }

    /// CLK periods and laser cycles of the exposure. Pulses of the cycle engine, and those of the worst cases, are drawn
    /// beforehand and kept: these exposures are as long as some 300 MB of them.
    fn exposure(&self) -> (u32, u32) {
        let macropixels = (self.rows * self.cols) as u32;
        match (self.work, self.case) {
            (_, SpeedCase::EverySpadEveryClk) => (CYCLE_STOP_PERIODS, 4),
            (work, SpeedCase::Bright) if work.is_cycle() => (CYCLE_STOP_PERIODS, 20),
            (_, SpeedCase::Bright) => (STOP_PERIODS, SPEED_LASER_CYCLES / 100),
            (work, _) if work.is_cycle() => {
                let laser_cycles = (500 * 64 * 64 / macropixels).clamp(1, 500);
                (CYCLE_STOP_PERIODS, laser_cycles)
            }
            _ => (STOP_PERIODS, SPEED_LASER_CYCLES),
        }
    }

    fn case_text(&self) -> &'static str {
        match self.case {
            SpeedCase::Street if (self.rows, self.cols) == ONE_WORD => "512 start values in a word",
            SpeedCase::Street => "street",
            SpeedCase::ShortStop => "STOP period 40",
            SpeedCase::Bright => "100 Mcounts/s a SPAD",
            SpeedCase::EverySpadEveryClk => "every SPAD every CLK",
        }
    }
}

/// Arguments of `gdtof speed`.
#[derive(Args)]
pub(super) struct SpeedArgs {
    /// Timed runs for each figure; the table gives least, median and most.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    runs: u16,
    /// Side of the largest array, in macropixels.
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u16).range(1..=256))]
    largest: u16,
    /// Print JSON instead of the table.
    #[arg(long)]
    json: bool,
    /// One figure only, as JSON: what its own process does.
    #[arg(long, hide = true, value_name = "JSON")]
    only: Option<String>,
}

/// Least, median and most of several runs, s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Spread {
    least_s: f64,
    median_s: f64,
    most_s: f64,
}

impl Spread {
    fn from_times(mut times_s: Vec<f64>) -> Self {
        times_s.sort_by(f64::total_cmp);
        Spread {
            least_s: times_s[0],
            median_s: times_s[times_s.len() / 2],
            most_s: times_s[times_s.len() - 1],
        }
    }
}

/// One figure.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Figure {
    #[serde(flatten)]
    subject: Subject,
    laser_cycles: u32,
    stop_periods: u32,
    wall: Spread,
    /// Of all threads together.
    processor: Spread,
    /// Macropixel-CLK periods of the exposure.
    macropixel_clk: f64,
    /// Largest resident memory of the process, KiB; where the system tells.
    peak_kib: Option<u64>,
}

impl Figure {
    /// The clock that counts: see the module.
    fn time(&self) -> Spread {
        match self.subject.threads {
            1 => self.processor,
            _ => self.wall,
        }
    }
}

/// Runs the command.
///
/// # Errors
/// When a process for a figure cannot be started.
pub(super) fn run(args: &SpeedArgs) -> anyhow::Result<()> {
    if let Some(subject) = &args.only {
        let subject = serde_json::from_str(subject).map_err(|_| {
            InputError::new("--only", "is what this program tells itself; leave it out")
        })?;
        let figure = measure(subject, args.runs)?;
        say_file(format_args!("{}\n", serde_json::to_string(&figure)?))?;
        return Ok(());
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let plan = plan(args.largest.into(), cores.min(2));
    let progress = progress(
        plan.len() as u64,
        "measuring {bar:40} {pos}/{len} figures, {eta} left",
    );
    let mut figures = Vec::new();
    for subject in plan {
        figures.push(in_its_own_process(subject, args.runs)?);
        progress.inc(1);
    }
    progress.finish_and_clear();
    if args.json {
        say_json(&figures)?;
    } else {
        say_unless_quiet(table(&figures))?;
    }
    Ok(())
}

/// The engines on one frame, by what is left out and by threads; the worst cases on one thread; then growth with the array
/// at `threads`.
fn plan(largest: usize, threads: usize) -> Vec<Subject> {
    use TimedWork::*;
    let array = (ARRAY.0.min(largest), ARRAY.1.min(largest));
    let one_word = (ONE_WORD.0.min(largest), ONE_WORD.1.min(largest));
    let mut plan = Vec::new();
    for work in [
        CycleLogic,
        CycleLiveLogic,
        CyclePacking,
        CycleWhole,
        WindowWhole,
        Cohort,
    ] {
        let mut counts = vec![1, threads];
        counts.dedup();
        let subjects = counts.into_iter();
        plan.extend(subjects.map(|threads| Subject::new(work, SpeedCase::Street, array, threads)));
    }
    for work in [CycleLogic, CycleLiveLogic, CyclePacking] {
        for case in [
            SpeedCase::Street,
            SpeedCase::EverySpadEveryClk,
            SpeedCase::Bright,
        ] {
            plan.push(Subject::new(work, case, one_word, 1));
        }
        plan.push(Subject::new(work, SpeedCase::ShortStop, array, 1));
    }
    plan.push(Subject::new(
        WindowPulses,
        SpeedCase::EverySpadEveryClk,
        one_word,
        1,
    ));
    for work in [WindowWhole, Cohort] {
        for case in [SpeedCase::Bright, SpeedCase::ShortStop] {
            plan.push(Subject::new(work, case, array, 1));
        }
    }
    for work in [CyclePacking, WindowWhole, Cohort] {
        let sides = [1, 4, 16, 128, 256].into_iter();
        let subjects = sides
            .filter(|&side| side <= largest)
            .map(|side| Subject::new(work, SpeedCase::Street, (side, side), threads));
        plan.extend(subjects);
    }
    plan
}

fn in_its_own_process(subject: Subject, runs: u16) -> anyhow::Result<Figure> {
    let output = Command::new(std::env::current_exe()?)
        .args(["speed", "--only", &serde_json::to_string(&subject)?])
        .args(["--runs", &runs.to_string()])
        .output()
        .context("a process for a figure cannot be started")?;
    if !output.status.success() {
        bail!("{}", String::from_utf8_lossy(&output.stderr).trim());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

fn measure(subject: Subject, runs: u16) -> anyhow::Result<Figure> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(subject.threads)
        .build()?;
    let (stop_periods, laser_cycles) = subject.exposure();
    let array = (subject.rows, subject.cols);
    let frame = SpeedFrame::new(subject.case, array, stop_periods, laser_cycles);
    let (wall, processor) = pool.install(|| times(&frame, subject.work, runs))?;
    let pixels = subject.rows as f64 * subject.cols as f64;
    let stop_periods = frame.exposure.stop_periods;
    Ok(Figure {
        subject,
        laser_cycles,
        stop_periods,
        wall,
        processor,
        macropixel_clk: pixels * f64::from(stop_periods) * f64::from(laser_cycles),
        peak_kib: peak_kib(),
    })
}

fn times(frame: &SpeedFrame, work: TimedWork, runs: u16) -> anyhow::Result<(Spread, Spread)> {
    let (sensor, exposure) = (&frame.sensor, &frame.exposure);
    let cycle = || Cycle::new(sensor, exposure);
    let window = Window::new(sensor, exposure);
    let on_light = |engine: &dyn Expose| timed(runs, || frame.expose(engine));
    match work {
        TimedWork::CycleWhole => return on_light(&cycle()),
        TimedWork::WindowWhole => return on_light(&window),
        TimedWork::Cohort => {
            return on_light(&Cohort::new(sensor, exposure, CohortOptions::default()));
        }
        _ => (),
    }
    let (starts, photons) = (frame.starts(), frame.pulses());
    let pulses: Vec<&[SpadEvent]> = photons.iter().map(Vec::as_slice).collect();
    if work == TimedWork::WindowPulses {
        return timed(runs, || window.histograms(&starts, &pulses));
    }
    let engine = match work {
        TimedWork::CycleLiveLogic => cycle().with_live_control(),
        _ => cycle(),
    };
    if work == TimedWork::CyclePacking {
        return timed(runs, || {
            engine.replay_packed(&starts, &engine.pack(&starts, &pulses))
        });
    }
    let packed = engine.pack(&starts, &pulses);
    timed(runs, || engine.replay_packed(&starts, &packed))
}

/// Wall-clock and processor times of `runs` runs after one that is not counted.
fn timed<T, E: std::error::Error + Send + Sync + 'static>(
    runs: u16,
    run: impl Fn() -> Result<T, E>,
) -> anyhow::Result<(Spread, Spread)> {
    run()?;
    let (mut wall_s, mut processor_s) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        let (wall, processor) = (Instant::now(), ProcessTime::now());
        std::hint::black_box(run()?);
        processor_s.push(processor.elapsed().as_secs_f64());
        wall_s.push(wall.elapsed().as_secs_f64());
    }
    Ok((Spread::from_times(wall_s), Spread::from_times(processor_s)))
}

/// Largest resident memory of this process, KiB, where /proc tells.
fn peak_kib() -> Option<u64> {
    let status = read_text(Path::new("/proc/self/status")).ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}

fn table(figures: &[Figure]) -> String {
    let mut grid = Grid::headed(
        "engine, what is timed | left out | frame | array | threads | exposure | least (ms) \
        | median (ms) | most (ms) | G macropixel-CLK/s | peak (MiB)",
    );
    for figure in figures {
        let subject = &figure.subject;
        let [name, left_out] = subject.work.texts();
        let peak = figure
            .peak_kib
            .map(|kib| format!("{:.0}", kib as f64 / 1024.0));
        let time = figure.time();
        let ms = |seconds: f64| format!("{:.3}", 1e3 * seconds);
        grid.push([
            name.to_owned(),
            left_out.to_owned(),
            subject.case_text().to_owned(),
            format!("{}x{}", subject.rows, subject.cols),
            subject.threads.to_string(),
            format!("{} of {} CLK", figure.laser_cycles, figure.stop_periods),
            ms(time.least_s),
            ms(time.median_s),
            ms(time.most_s),
            format!("{:.2}", 1e-9 * figure.macropixel_clk / time.median_s),
            peak.unwrap_or_else(|| "-".into()),
        ]);
    }
    format!(
        "Street: 8 Mcounts/s and 0.1 signal photons a laser cycle on every macropixel, 384 MHz; the others differ from it as named.\n\
         Times are the processor's on one thread, the wall clock's on more; the rate is that of the median.\n\n{grid}\n\
         No engine steps what is at rest: the cycle engine skips CLK periods in which no net of a word would change.\n\
         The silicon exposes {SPEED_LASER_CYCLES} laser cycles in {:.0} ms.\n",
        1e3 * f64::from(SPEED_LASER_CYCLES) * f64::from(STOP_PERIODS) / 384e6,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_figure_is_measured_small() {
        for subject in plan(1, 1) {
            let figure = measure(subject, 1).unwrap();
            let time = figure.time();
            assert!(time.least_s > 0.0 && time.least_s <= time.most_s);
            let text = table(&[figure]);
            assert!(subject.work.texts().iter().all(|said| text.contains(said)));
        }
    }

    #[test]
    fn the_plan_ends_at_the_largest_array_and_sets_one_thread_against_one() {
        let plan = plan(16, 2);
        assert!(
            plan.iter()
                .all(|subject| subject.rows <= 16 && subject.cols <= 16)
        );
        for subject in plan
            .iter()
            .filter(|s| s.threads == 2 && s.rows == 16 && s.cols == 16)
        {
            let alone = Subject {
                threads: 1,
                ..*subject
            };
            assert!(plan.contains(&alone), "{subject:?}");
        }
    }
}
