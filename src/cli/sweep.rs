//! `gdtof sweep`: a table of frames, or of what theory says, over any settings.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, Subcommand};
use serde::Serialize;

use super::settings::note_unusual;
use super::voice::{note, notes, progress, quantity, say_unless_quiet};
use crate::files::{InputError, ResultSet};
use crate::report::Table;
use crate::sweep::{
    Drawing, Outcome, Plot, Results, Shard, Study, StudyKind, SweepError, WrittenTable, columns,
    run as take, study_of,
};

/// Arguments of `gdtof sweep`.
#[derive(Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct SweepArgs {
    #[command(subcommand)]
    command: Option<SweepCommand>,
    /// Study (TOML): keys that vary in `[vary]`, fixed ones in `[fixed]`.
    #[arg(required = true, value_name = "STUDY")]
    study: Option<PathBuf>,
    /// Take only every N-th point, from the I-th on. N processes can share a study this way, in one folder or in
    /// several; `gdtof sweep merge` joins the results.
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<Shard>,
    #[command(flatten)]
    results: ResultArgs,
}

#[derive(Subcommand)]
enum SweepCommand {
    /// Make one table from the rows in several folders.
    Merge(MergeArgs),
}

/// Arguments of `gdtof sweep merge`.
#[derive(Args)]
struct MergeArgs {
    /// Folders that `gdtof sweep` has written, all of one study.
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// Make the table even if points are missing.
    #[arg(long)]
    partial: bool,
    #[command(flatten)]
    results: ResultArgs,
}

/// What becomes of the rows.
#[derive(Args)]
struct ResultArgs {
    /// Folder for the results, instead of the study's. `merge` without it uses the first of its folders.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Plot column Y over column X, with a line for each value of SERIES if given; may be repeated.
    #[arg(long = "plot", value_name = "X,Y[,SERIES]")]
    plots: Vec<String>,
}

/// Runs the command.
///
/// # Errors
/// Bad input, files that cannot be written, faults of the program.
pub(super) fn run(args: &SweepArgs) -> anyhow::Result<()> {
    match (&args.command, &args.study) {
        (Some(SweepCommand::Merge(merge)), _) => run_merge(merge),
        (None, Some(study)) => run_study(args, study),
        (None, None) => unreachable!("clap wants one of them"),
    }
}

fn run_study(args: &SweepArgs, path: &Path) -> anyhow::Result<()> {
    let study = Study::load(path)?;
    note_unusual(path.display(), &study.remarks());
    let plots = plots(&args.results, &study)?;
    let shard = args.shard.unwrap_or(Shard::WHOLE);
    let folder = args
        .results
        .out
        .clone()
        .unwrap_or_else(|| study.out.clone());
    let begin = Instant::now();
    let progress = progress(
        shard.share(study.len()),
        "sweeping {bar:40} {pos}/{len} points, {eta} left",
    );
    let outcome = take(&study, &folder, shard, |points| progress.inc(points));
    progress.finish_and_clear();
    let outcome = outcome.map_err(plain)?;
    let seconds = begin.elapsed().as_secs_f64();
    if outcome.spoilt_lines > 0 {
        note(format_args!(
            "damaged in the journal: {}; their points were taken anew",
            quantity(outcome.spoilt_lines, "line")
        ));
    }
    let mut table = outcome_table(&study, &outcome, seconds);
    if shard == Shard::WHOLE {
        let folders = std::slice::from_ref(&folder);
        let written = write(&study, folders, &folder, &plots, Some(outcome), |missing| {
            anyhow::ensure!(
                missing == 0,
                "{missing} of {} rows are no longer in the journal of {}, and no table was written; run the same command once more",
                study.len(),
                folder.display()
            );
            Ok(())
        })?;
        table.push("in", folder.display());
        say_unless_quiet(table)?;
        written.check(&study)?;
    } else {
        say_unless_quiet(table)?;
        say_unless_quiet(format_args!(
            "\nThis is one of {} parts; when all are done: gdtof sweep merge {}\n",
            shard.parts,
            folder.display()
        ))?;
    }
    Ok(())
}

fn run_merge(args: &MergeArgs) -> anyhow::Result<()> {
    let study = study_of(&args.folders[0])?;
    for folder in &args.folders[1..] {
        if study_of(folder)?.text() != study.text() {
            let message = format!(
                "is of another study than {}; merge folders of one study",
                args.folders[0].display()
            );
            return Err(InputError::new(folder.display(), message).into());
        }
    }
    let plots = plots(&args.results, &study)?;
    let out = args.results.out.as_ref().unwrap_or(&args.folders[0]);
    let written = write(&study, &args.folders, out, &plots, None, |missing| {
        if missing == 0 || args.partial {
            return Ok(());
        }
        let message = format!(
            "{missing} of {} points are in none of these folders; run the shards that take them, or give --partial",
            study.len()
        );
        Err(InputError::new("gdtof sweep merge", message).into())
    })?;
    let mut table =
        Table::new(format!("Sweep {}", study.name)).row("points", study.len() - written.missing);
    if written.missing > 0 {
        table.push("points that are missing", written.missing);
    }
    table.push("in", out.display());
    say_unless_quiet(table)?;
    Ok(written.check(&study)?)
}

/// What is drawn, by columns that there are.
fn plots(args: &ResultArgs, study: &Study) -> Result<Vec<Plot>, InputError> {
    let columns = columns(study);
    let parse = |text: &String| {
        let plot = Plot::parse(text).ok_or_else(|| {
            InputError::new(
                "--plot",
                format!("{text:?} is not a pair of columns; give X,Y or X,Y,SERIES"),
            )
        })?;
        Drawing::new(&plot, study, &columns, "--plot")?;
        Ok(plot)
    };
    args.plots.iter().map(parse).collect()
}

/// Writes table and charts, if `check` allows as many points to be missing in them.
fn write(
    study: &Study,
    folders: &[PathBuf],
    out: &Path,
    plots: &[Plot],
    outcome: Option<Outcome>,
    check: impl FnOnce(u64) -> anyhow::Result<()>,
) -> anyhow::Result<WrittenTable> {
    let columns = columns(study);
    let set = ResultSet::begin(out, "sweep")?;
    let drawings = plots
        .iter()
        .map(|plot| Drawing::new(plot, study, &columns, "--plot"));
    let mut drawings: Vec<Drawing<'_>> = drawings.collect::<Result<_, _>>()?;
    let results = Results::read(study, folders)?;
    let written = results.write(set.staging(), |cells| {
        drawings
            .iter_mut()
            .for_each(|drawing| drawing.add_row(cells));
    });
    let written = written.map_err(plain)?;
    check(written.missing)?;
    for (drawing, plot) in drawings.into_iter().zip(plots) {
        let chart = drawing.chart("--plot")?;
        chart.write(&set.staging().join(plot.file_name() + ".svg"))?;
    }
    let configuration = Configuration {
        study: study.text(),
        points: study.len() - written.missing,
        outcome,
    };
    notes(set.commit(configuration)?);
    Ok(written)
}

/// As what it is, for the exit status.
fn plain(error: SweepError) -> anyhow::Error {
    match error {
        SweepError::Input(error) => error.into(),
        SweepError::Frame(error) => error.into(),
        error @ SweepError::Stopped => error.into(),
    }
}

/// What the manifest says.
#[derive(Serialize)]
struct Configuration<'a> {
    study: &'a str,
    points: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    outcome: Option<Outcome>,
}

fn outcome_table(study: &Study, outcome: &Outcome, seconds: f64) -> Table {
    let mut table = Table::new(format!("Sweep {}", study.name)).row("points", outcome.points);
    if outcome.reused > 0 {
        table.push("there before", outcome.reused);
    }
    table.push("taken", outcome.taken);
    if outcome.without_results > 0 {
        table.push("without results; see error", outcome.without_results);
    }
    if outcome.taken > 0 {
        table.push("run time", format!("{seconds:.1} s"));
        let digits = usize::from(study.kind == StudyKind::Frame);
        let rate_hz = outcome.taken as f64 / seconds;
        table.push("points taken", format!("{rate_hz:.digits$} /s"));
    }
    table
}

fn shard(text: &str) -> Result<Shard, String> {
    let numbers = text.split_once('/').and_then(|(part, of)| {
        let number = |text: &str| text.trim().parse::<u64>().ok();
        Some((number(part)?, number(of)?))
    });
    match numbers {
        Some((part, of)) if (1..=of).contains(&part) && of <= 1_000_000 => Ok(Shard {
            part: part - 1,
            parts: of,
        }),
        _ => Err(
            "is not a part of a study; give a part and the number of parts, such as 3/16"
                .to_owned(),
        ),
    }
}
