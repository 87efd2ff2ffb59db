//! `gdtof replay`: recorded SPAD events in, histograms out.

mod histograms;
mod nothing_counted;
mod stimuli;

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use rayon::prelude::*;

use super::asked::WaveFormatOption;
use super::sdf::annotated_timing;
use super::settings::SiliconArgs;
use super::voice::{note, progress, say_json, table_to_stderr};
use crate::ORIGIN;
use crate::analysis::{TimingVerdict, VerdictReport};
use crate::chip::{SensorConfig, Silicon};
use crate::engine::waveform::{self, View};
use crate::engine::{
    ClosedFormCoverage, EngineError, Gate, GateSimulation, Histograms, PulsedPixel, Replay, Runner,
    Timed, cancelled,
};
use crate::files::{InputError, OutputFile, refuse_input};
use crate::kernel::{Activity, CheckReport, Observer, Policy};
use crate::report::Table;
use crate::stimulus::{HardwareEventKind, HardwareEventReport};
use crate::system::EngineKind;
use crate::units::Time;
use crate::waves::{WaveFormat, write_saif};
use histograms::{Format, write};
pub(super) use stimuli::Stimuli;
use stimuli::StimulusArgs;

/// Arguments of `gdtof replay`.
#[derive(Args)]
pub(super) struct ReplayArgs {
    #[command(flatten)]
    stimuli: StimulusArgs,
    /// Engine that runs the chip.
    #[arg(long, value_enum, default_value_t)]
    engine: EngineKind,
    #[command(flatten)]
    silicon: SiliconArgs,
    /// File for the histograms: `.npy` (uint16, rows × cols × bins) or `.csv` (row,col,bin,count) [default: CSV on
    /// standard output].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Waveform of every named net: FST if its name ends in .fst, else VCD. Views for GTKWave and Surfer go beside
    /// it. Needs --engine gate.
    #[arg(long, value_name = "FILE")]
    vcd: Option<PathBuf>,
    /// File for the switching activity of every net, from power-up to the end, as SAIF 2.0 for power tools. Needs
    /// --engine gate.
    #[arg(long, value_name = "FILE")]
    saif: Option<PathBuf>,
    /// Also count transport glitches (TG) in the SAIF file; some readers refuse these.
    #[arg(long, requires = "saif")]
    saif_glitches: bool,
    /// Format of the waveform, whatever its file is called.
    #[arg(long, value_enum, requires = "vcd")]
    wave_format: Option<WaveFormatOption>,
    /// Delays to use instead of the library's (SDF, in the sensor's corner). Needs --engine gate.
    #[arg(long, value_name = "FILE")]
    sdf: Option<PathBuf>,
    /// Check setup, hold, recovery, removal and pulse widths of every flip-flop, watch for hardware events, and print
    /// a summary on standard error. Needs --engine gate.
    #[arg(long, value_enum, value_name = "POLICY")]
    checks: Option<Checks>,
    /// File for violations, summary and slack histograms of the timing checks, and hardware events, as JSON. Needs
    /// --checks.
    #[arg(long, value_name = "FILE")]
    checks_json: Option<PathBuf>,
    /// Print the number of events and of those that are not counted, and the timing verdict, as JSON. Works on any
    /// engine; needs --out.
    #[arg(long, requires = "out")]
    json: bool,
}

/// What a timing violation does.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Checks {
    /// Report it.
    Report,
    /// Report it, and set the flip-flop to X.
    X,
}

impl From<Checks> for Policy {
    fn from(checks: Checks) -> Self {
        match checks {
            Checks::Report => Policy::ReportOnly,
            Checks::X => Policy::XOnViolation,
        }
    }
}

/// Runs the command.
///
/// # Errors
/// Bad input, unwritable output, and configurations that the engine refuses.
pub(super) fn run(args: &ReplayArgs) -> anyhow::Result<()> {
    let format = match &args.out {
        None => Format::Csv,
        Some(path) => Format::from_path(path)?,
    };
    let file = |path: &Option<PathBuf>| Some(format!(" {}", path.as_ref()?.display()));
    for (option, given, what) in [
        ("--vcd", file(&args.vcd), "waveforms"),
        ("--sdf", file(&args.sdf), "delays of single cells"),
        ("--saif", file(&args.saif), "nets that toggle"),
        (
            "--checks",
            args.checks.map(|_| String::new()),
            "timing checks",
        ),
    ] {
        if let (Some(file), true) = (given, args.engine != EngineKind::Gate) {
            let message =
                format!("only the gate engine has {what}; add --engine gate or leave {option} out");
            return Err(InputError::new(option.to_owned() + &file, message).into());
        }
    }
    if let (Some(json), None) = (&args.checks_json, args.checks) {
        let message = "there are no timing checks to write; add --checks report";
        return Err(InputError::new(format!("--checks-json {}", json.display()), message).into());
    }
    let stimuli = args.stimuli.read()?;
    for out in [&args.out, &args.vcd, &args.saif, &args.checks_json] {
        out.as_deref().map_or(Ok(()), refuse_input)?;
    }
    let silicon = args.silicon.read(&stimuli.sensor)?;
    // Delays of a file are the gates' to judge, and mismatched macropixels each their own (`gdtof timing --mismatch`).
    let timing = (args.sdf.is_none() && silicon.mismatch.is_none())
        .then(|| TimingVerdict::analyse(&stimuli.sensor, &silicon, (0, 0)).report());
    let silicon = (silicon != Silicon::new(&stimuli.sensor)).then_some(silicon);
    if silicon.is_some() && args.sdf.is_some() {
        let message = "takes delays and limits from elsewhere; leave out either --sdf or process, voltage, temperature and mismatch";
        return Err(InputError::new("--sdf", message).into());
    }
    let warning = timing.as_ref().and_then(VerdictReport::warning);
    // The other engines refuse what matters to them; the gates do not.
    if let (Some(warning), EngineKind::Gate) = (&warning, args.engine) {
        note(warning);
    }
    let needs_array =
        args.vcd.is_some() || args.saif.is_some() || args.sdf.is_some() || args.checks.is_some();
    let replayed = match silicon {
        _ if needs_array => replay_array(&stimuli, args, silicon)?,
        silicon => replay(&stimuli, args.engine, silicon.as_ref())?,
    };
    let recording = &stimuli.recording;
    let summary = Summary {
        engine: args.engine,
        events: recording.read,
        lost_to_dead_time: recording.lost_to_dead_time,
        after_the_end: recording.after_the_end,
        photons_that_cancel: replayed.cancelled,
        timing,
        time_keeping: replayed.coverage,
    };
    summary.print_losses(&stimuli.sensor);
    if recording.read > 0 && replayed.histograms.counts().iter().all(|&count| count == 0) {
        note(nothing_counted::sentence(&stimuli, recording.read));
    }
    let out = args.out.as_deref();
    write(&stimuli.sensor, &replayed.histograms, out, format)?;
    if args.json {
        say_json(&summary)?;
    }
    Ok(())
}

/// Histograms of the array, and what else a replay finds.
struct ReplayResult {
    histograms: Histograms,
    cancelled: u64,
    coverage: Option<ClosedFormCoverage>,
}

/// How many events there are, and how many are not counted for which reason.
#[derive(serde::Serialize)]
struct Summary {
    engine: EngineKind,
    events: u64,
    lost_to_dead_time: u64,
    after_the_end: u64,
    photons_that_cancel: u64,
    timing: Option<VerdictReport>,
    time_keeping: Option<ClosedFormCoverage>,
}

impl Summary {
    /// Says on standard error what the chip loses silently.
    fn print_losses(&self, config: &SensorConfig) {
        if let Some(coverage) = &self.time_keeping {
            table_to_stderr(table(coverage));
        }
        let unmet = self.timing.as_ref().filter(|timing| !timing.met);
        if let (Some(timing), true) = (unmet, self.engine != EngineKind::Gate) {
            note(format_args!("timing {}", timing.verdict));
        }
        let later_windows = |timing: &VerdictReport| timing.later_windows.clone();
        if let Some(text) = self.timing.as_ref().and_then(later_windows) {
            note(format_args!("note on timing: {text}"));
        }
        if self.photons_that_cancel > 0 {
            note(format_args!(
                "{} photons cancel: two of one SPAD within a CLK period ({}) undo each other in the front end; a dead time ({}) no shorter than the period prevents it",
                self.photons_that_cancel,
                config.clock().period(),
                config.pulse_width(),
            ));
        }
    }
}

/// The whole array as one netlist, with its waveform, annotated delays and timing checks.
fn replay_array(
    stimuli: &Stimuli,
    args: &ReplayArgs,
    silicon: Option<Silicon>,
) -> anyhow::Result<ReplayResult> {
    let sensor = match silicon {
        Some(silicon) => &stimuli.sensor.made_of(&silicon),
        None => &stimuli.sensor,
    };
    let mut simulation = GateSimulation::new(
        sensor,
        &stimuli.exposure,
        (0, 0),
        (sensor.rows, sensor.cols),
        &stimuli.starts,
        &stimuli.pulses(),
    );
    if let Some(sdf) = &args.sdf {
        let timing = annotated_timing(sdf, simulation.netlist(), sensor)?;
        simulation = simulation.with_timing(&timing);
    }
    let mut events = simulation.hardware_events();
    match args.checks {
        // Pulses reach flip-flops whose delays only the gates know.
        None if args.sdf.is_some() => watch(&mut simulation, stimuli, args, &mut events)?,
        None => watch(&mut simulation, stimuli, args, &mut ())?,
        Some(policy) => {
            let mut checks = simulation.timing_checks(policy.into());
            watch(
                &mut simulation,
                stimuli,
                args,
                &mut (&mut checks, &mut events),
            )?;
            let report = Report {
                checks: checks.report(simulation.netlist()),
                events: &events.report,
            };
            table_to_stderr(format_args!("{}{}", report.checks, report.events));
            // Before the histograms, which unknown states may have spoilt: this says why.
            if let Some(path) = &args.checks_json {
                OutputFile::write_with(path, |w| Ok(serde_json::to_writer_pretty(w, &report)?))?;
            }
        }
    }
    let pulses = stimuli.pulses();
    let pixels = PulsedPixel::array(&stimuli.starts, &pulses);
    let exposure = &stimuli.exposure;
    let cancelled = match silicon {
        _ if args.sdf.is_some() => 2 * events.count(HardwareEventKind::PulsesCancelled),
        Some(_) => {
            let timed = Timed::new(sensor, exposure, Runner::Gate);
            cancelled(&timed, sensor, &pixels)
        }
        None => cancelled(&Gate::new(sensor, exposure), sensor, &pixels),
    };
    Ok(ReplayResult {
        histograms: simulation.histograms()?,
        cancelled,
        coverage: None,
    })
}

/// What `--checks-json` writes.
#[derive(serde::Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    checks: CheckReport,
    #[serde(flatten)]
    events: &'a HardwareEventReport,
}

fn watch(
    simulation: &mut GateSimulation,
    stimuli: &Stimuli,
    args: &ReplayArgs,
    observer: &mut dyn Observer,
) -> Result<(), InputError> {
    let Some(saif) = &args.saif else {
        return record(simulation, stimuli, args, observer);
    };
    let netlist = Arc::clone(simulation.netlist());
    let mut activity = Activity::new(&netlist, Time::ZERO);
    record(simulation, stimuli, args, &mut (&mut activity, observer))?;
    let end = simulation.now();
    OutputFile::write_with(saif, |out| {
        let nets = activity.net_activity(end);
        write_saif(out, &netlist, &nets, end, args.saif_glitches, ORIGIN)
    })
}

/// Runs the simulation, with its waveform if one is asked for.
fn record(
    simulation: &mut GateSimulation,
    stimuli: &Stimuli,
    args: &ReplayArgs,
    observer: &mut dyn Observer,
) -> Result<(), InputError> {
    let Some(waves) = &args.vcd else {
        simulation.run(observer);
        return Ok(());
    };
    let Stimuli {
        sensor,
        exposure,
        starts,
        ..
    } = stimuli;
    let pixels = (0..sensor.rows).flat_map(|row| (0..sensor.cols).map(move |col| (row, col)));
    let start = *starts.first().expect("a sensor has a macropixel");
    let view = View::of_array(pixels.collect(), sensor, exposure, start);
    let format = args
        .wave_format
        .map_or(WaveFormat::from_path(waves), WaveFormat::from);
    waveform::record(simulation, waves, format, &view, observer)
}

/// Which macropixels met timing, and why the others did not.
fn table(coverage: &ClosedFormCoverage) -> Table {
    let mut table = Table::new("Time keeping")
        .row("macropixels in closed form", coverage.decided)
        .row(
            "macropixels replayed at gate level",
            coverage.replayed.values().sum::<usize>(),
        );
    for (why, macropixels) in &coverage.replayed {
        table.push(format!("  {why}"), macropixels);
    }
    table
}

/// Each macropixel by itself: with the library's delays, or with those of `silicon`.
fn replay(
    stimuli: &Stimuli,
    kind: EngineKind,
    silicon: Option<&Silicon>,
) -> anyhow::Result<ReplayResult> {
    let Stimuli {
        sensor, exposure, ..
    } = stimuli;
    let Some(silicon) = silicon else {
        return run_engine(stimuli, &*kind.replay(sensor, exposure)?);
    };
    let runner = kind.runner()?;
    let timed = Timed::new(sensor.made_of(silicon), exposure, runner);
    let replayed = run_engine(stimuli, &timed)?;
    Ok(ReplayResult {
        coverage: (runner != Runner::Gate).then(|| timed.coverage()),
        ..replayed
    })
}

fn run_engine(stimuli: &Stimuli, engine: &dyn Replay) -> anyhow::Result<ReplayResult> {
    let template = "replaying {bar:40} {pos}/{len} macropixels";
    let progress = progress(stimuli.starts.len() as u64, template);
    let pulses = stimuli.pulses();
    let pixels = PulsedPixel::array(&stimuli.starts, &pulses);
    let batches: Result<Vec<Histograms>, EngineError> = pixels
        .par_chunks(engine.batch())
        .map(|pixels| {
            let histograms = engine.replay(pixels);
            progress.inc(pixels.len() as u64);
            histograms
        })
        .collect();
    progress.finish_and_clear();
    Ok(ReplayResult {
        histograms: Histograms::joined(engine.bins(), batches?),
        cancelled: cancelled(engine, &stimuli.sensor, &pixels),
        coverage: None,
    })
}
