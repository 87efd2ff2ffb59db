//! `gdtof tb`: lists and runs the testbenches; and the binaries `tb_*`, each of which runs one.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::{Args, CommandFactory, FromArgMatches, Parser};
use rayon::prelude::*;
use serde::Serialize;

use super::SensorArgs;
use super::asked::WaveFormatOption;
use super::voice::{complain, note, notes, progress, say_json, say_unless_quiet};
use crate::chip::SensorConfig;
use crate::files::{InputError, ResultSet, clean_up_when_interrupted, instead_of};
use crate::report::{CheckedValue, Checks, Grid};
use crate::testbenches::{TESTBENCHES, Testbench};
use crate::waves::WaveFormat;

/// Where waveforms go.
#[derive(Args)]
struct WaveArgs {
    /// Folder for waveforms and their views for GTKWave and Surfer; created if missing.
    #[arg(long, value_name = "DIR", default_value = "waves")]
    out: PathBuf,
    /// Format of the waveforms.
    #[arg(long, value_enum, default_value_t)]
    wave_format: WaveFormatOption,
}

impl WaveArgs {
    fn file(&self, testbench: &Testbench) -> String {
        let extension = WaveFormat::from(self.wave_format).extension();
        format!("{}.{extension}", testbench.name)
    }

    /// Waveforms of other testbenches stay.
    fn begin(&self) -> Result<ResultSet, InputError> {
        Ok(ResultSet::begin(&self.out, "tb")?.beside_others())
    }
}

/// Arguments of `gdtof tb`.
#[derive(Args)]
pub(super) struct TbArgs {
    /// Testbenches to run, with or without `tb_` [default: all of them].
    #[arg(value_name = "NAME")]
    names: Vec<String>,
    #[command(flatten)]
    sensor: SensorArgs,
    /// List the testbenches, and run none.
    #[arg(long, conflicts_with_all = ["out", "wave_format", "verbose", "block", "sensor", "set", "liberty"])]
    list: bool,
    /// Print every check, not only those that fail.
    #[arg(long, short)]
    verbose: bool,
    #[command(flatten)]
    waves: WaveArgs,
    /// Print JSON instead of the table.
    #[arg(long)]
    json: bool,
}

/// A testbench that has run, or is only listed.
#[derive(Serialize)]
struct Entry {
    name: &'static str,
    about: &'static str,
    #[serde(flatten)]
    result: Option<RunResult>,
}

#[derive(Serialize)]
struct RunResult {
    passed: bool,
    checked: usize,
    failed: usize,
    failures: Vec<CheckedValue>,
    run_time_s: f64,
    waveform: PathBuf,
    #[serde(skip)]
    checks: Checks,
}

/// Runs the command; exit status 1 when a check fails.
///
/// # Errors
/// Unknown names and files that cannot be written.
pub(super) fn run(args: &TbArgs) -> anyhow::Result<ExitCode> {
    let sensor = args.sensor.read_if_given()?;
    let sensor = sensor.as_deref();
    let testbenches = chosen(&args.names, sensor)?;
    let has_library = sensor.is_some_and(|sensor| !sensor.liberty.as_os_str().is_empty());
    if has_library && testbenches.iter().any(|tb| tb.name == "tb_p_counter") {
        note(
            "p_counter runs with the built-in delays, whatever the library; `gdtof timing` has the ripple in the library's cells",
        );
    }
    let entries = if args.list {
        let listed = |testbench| Entry::new(testbench, None);
        testbenches.iter().map(listed).collect()
    } else {
        run_all(&testbenches, sensor, &args.waves)?
    };
    let results = || entries.iter().filter_map(|entry| entry.result.as_ref());
    if args.json {
        say_json(&entries)?;
    } else {
        for entry in &entries {
            let Some(result) = &entry.result else {
                continue;
            };
            if args.verbose || !result.passed {
                say_unless_quiet(format_args!("{}\n{}\n", entry.name, result.checks))?;
            }
        }
        say_unless_quiet(table(&entries))?;
        if let Some(first) = results().next() {
            let view = first.waveform.with_extension("gtkw");
            say_unless_quiet(format_args!(
                "waveforms: gtkwave {}, for example\n",
                view.display()
            ))?;
        }
    }
    Ok(if results().all(|result| result.passed) {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn chosen(names: &[String], sensor: Option<&SensorConfig>) -> Result<Vec<Testbench>, InputError> {
    let drives = |tb: &Testbench| sensor.is_none_or(|sensor| tb.drives(sensor));
    let driving = TESTBENCHES.iter().filter(|tb| drives(tb));
    let driving: Vec<Testbench> = driving.copied().collect();
    let any = driving
        .iter()
        .map(|tb| tb.name)
        .collect::<Vec<_>>()
        .join(" or ");
    if driving.is_empty() {
        let message = "no testbench drives all of these; give one at a time";
        return Err(InputError::new("--block", message));
    }
    if names.is_empty() {
        return able(driving, sensor);
    }
    let mut chosen: Vec<Testbench> = Vec::new();
    for name in names {
        let testbench = Testbench::named(name).ok_or_else(|| {
            let instead = instead_of(name, TESTBENCHES.iter().map(|tb| tb.name));
            InputError::new(name, format!("is not a testbench; {instead}"))
        })?;
        if !drives(&testbench) {
            let message = format!("does not drive a sensor that is given; give {any}");
            return Err(InputError::new(name, message));
        }
        if chosen.iter().all(|other| other.name != testbench.name) {
            chosen.push(testbench);
        }
    }
    Ok(chosen)
}

/// Those that can drive the sensor; of the others it is noted why they cannot.
///
/// # Errors
/// Why the first cannot, if none can.
fn able(
    driving: Vec<Testbench>,
    sensor: Option<&SensorConfig>,
) -> Result<Vec<Testbench>, InputError> {
    let (mut able, mut refusals) = (Vec::new(), Vec::new());
    for testbench in driving {
        match sensor.map_or(Ok(()), |sensor| testbench.check(sensor)) {
            Ok(()) => able.push(testbench),
            Err(refusal) => refusals.push(refusal),
        }
    }
    if able.is_empty() {
        return Err(refusals.swap_remove(0));
    }
    refusals.iter().for_each(note);
    Ok(able)
}

impl Entry {
    fn new(testbench: &Testbench, result: Option<RunResult>) -> Self {
        Entry {
            name: testbench.name,
            about: testbench.about,
            result,
        }
    }
}

fn run_all(
    testbenches: &[Testbench],
    sensor: Option<&SensorConfig>,
    waves: &WaveArgs,
) -> Result<Vec<Entry>, InputError> {
    let set = waves.begin()?;
    let bar = progress(
        testbenches.len() as u64,
        "running {bar:30} {pos}/{len} testbenches, {elapsed}",
    );
    let entry = |testbench: &Testbench| {
        let result = run_one(testbench, sensor, waves, &set)?;
        bar.inc(1);
        Ok(Entry::new(testbench, Some(result)))
    };
    let entries: Result<Vec<Entry>, InputError> = testbenches.par_iter().map(entry).collect();
    bar.finish_and_clear();
    let entries = entries?;
    let names: Vec<&str> = entries.iter().map(|entry| entry.name).collect();
    notes(set.commit(names)?);
    Ok(entries)
}

fn run_one(
    testbench: &Testbench,
    sensor: Option<&SensorConfig>,
    waves: &WaveArgs,
    set: &ResultSet,
) -> Result<RunResult, InputError> {
    let begin = Instant::now();
    let file = waves.file(testbench);
    let checks = testbench.run(sensor, &set.staging().join(&file))?;
    Ok(RunResult {
        passed: checks.passed(),
        checked: checks.count(),
        failed: checks.failed(),
        failures: checks.failures().cloned().collect(),
        run_time_s: begin.elapsed().as_secs_f64(),
        waveform: waves.out.join(file),
        checks,
    })
}

fn table(entries: &[Entry]) -> String {
    let width = entries.iter().map(|entry| entry.name.len()).max();
    let width = width.unwrap_or(0);
    if entries.iter().all(|entry| entry.result.is_none()) {
        let line = |entry: &Entry| format!("{:width$}  {}\n", entry.name, entry.about);
        return entries.iter().map(line).collect();
    }
    let mut grid = Grid::new(["testbench", "checked", "failed", "run time", ""]);
    for entry in entries {
        let Some(result) = &entry.result else {
            continue;
        };
        grid.push([
            entry.name.to_owned(),
            result.checked.to_string(),
            result.failed.to_string(),
            format!("{:.2} s", result.run_time_s),
            if result.passed { "ok" } else { "FAILED" }.to_owned(),
        ]);
    }
    grid.to_string()
}

#[derive(Parser)]
struct OneArgs {
    #[command(flatten)]
    waves: WaveArgs,
}

/// Runs the testbench `name` as a program of its own, and prints its checks. Exit status 0 when every check holds, 1
/// when one fails, 2 when a file cannot be written.
///
/// # Panics
/// When there is no testbench of this name.
pub fn testbench(name: &'static str) -> ExitCode {
    let testbench = Testbench::named(name).expect("a testbench for each tb_* binary");
    let command = OneArgs::command().name(name).about(testbench.about);
    let args = OneArgs::from_arg_matches(&command.get_matches());
    let args = args.unwrap_or_else(|error| error.exit()).waves;
    if let Err(error) = clean_up_when_interrupted() {
        note(format_args!("signals cannot be watched ({error})"));
    }
    match run_all(&[testbench], None, &args) {
        Ok(entries) => {
            let result = entries.iter().find_map(|entry| entry.result.as_ref());
            let result = result.expect("it has run");
            let view = result.waveform.with_extension("gtkw");
            let text = format!("{}waveform: gtkwave {}\n", result.checks, view.display());
            // A reader that has gone away changes no verdict.
            let _ = say_unless_quiet(text);
            if result.passed {
                ExitCode::SUCCESS
            } else {
                ExitCode::FAILURE
            }
        }
        Err(error) => {
            complain(error);
            ExitCode::from(2)
        }
    }
}
