//! `gdtof reproduce`: the thesis's figures, published beside computed.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use super::voice::{announce, busy, notes, progress, say_json, say_unless_quiet};
use crate::files::{InputError, OutputFile, ResultSet};
use crate::reproduce::{self, Report, Selection};

/// Arguments of `gdtof reproduce`.
#[derive(Args)]
pub(super) struct ReproduceArgs {
    /// Only this claim of the list; may be repeated [default: everything].
    #[arg(long, value_name = "N")]
    claim: Vec<u32>,
    /// Only this figure of the thesis; may be repeated.
    #[arg(long, value_name = "N")]
    figure: Vec<u32>,
    /// Only this table of the thesis; may be repeated.
    #[arg(long, value_name = "N")]
    table: Vec<u32>,
    /// Only this measurement of the chip beside its theory: 1 probability of detection, 2 precision, 3 penalty, 4
    /// zooming and sliding at 200 m and 75 m; may be repeated.
    #[arg(long, value_name = "N")]
    measurement: Vec<u32>,
    /// Print only the thesis's chip in this cell library (a Liberty file, or the files of one kit, separated by commas), beside the
    /// built-in cells; may be repeated for further libraries.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["claim", "figure", "table", "measurement", "frames", "json"])]
    liberty: Vec<PathBuf>,
    /// Frames behind each measured number, at least 100 [default: 300].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    frames: Option<u32>,
    /// Folder for the page (report.md, report.html, report.json), the figures as SVG and their numbers as CSV;
    /// created if missing.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON instead of tables.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Numbers that do not exist, unwritable output, and claims that leave their tolerance.
pub(super) fn run(args: &ReproduceArgs) -> anyhow::Result<()> {
    if !args.liberty.is_empty() {
        let busy = busy("measuring");
        let table = reproduce::libraries(&args.liberty)?;
        drop(busy);
        if let Some(folder) = &args.out {
            let set = ResultSet::begin(folder, "reproduce --liberty")?;
            let path = set.staging().join("libraries.csv");
            OutputFile::write_with(&path, |out| table.write_csv(out))?;
            notes(set.commit(&args.liberty)?);
        }
        return Ok(say_unless_quiet(table)?);
    }
    let chosen = Selection {
        claims: args.claim.clone(),
        figures: args.figure.clone(),
        tables: args.table.clone(),
        measurements: args.measurement.clone(),
        frames: args.frames.map(|frames| frames as usize),
    };
    let selection = if chosen.is_empty() {
        Selection {
            frames: chosen.frames,
            ..Selection::all()
        }
    } else {
        chosen
    };
    selection
        .check()
        .map_err(|fault| InputError::new(format!("--{}", fault.part.name()), fault.to_string()))?;
    let asked = serde_json::json!({
        "claim": args.claim,
        "figure": args.figure,
        "table": args.table,
        "measurement": args.measurement,
        "frames": args.frames,
    });
    let begin = |folder: &PathBuf| ResultSet::begin(folder, "reproduce");
    let set = args.out.as_ref().map(begin).transpose()?;
    announce(
        "reproducing this",
        selection.run_time_s(rayon::current_num_threads()),
    );
    let bar = progress(
        selection.parts() as u64,
        "{bar:30} {pos}/{len} claims, tables, figures, measurements, {elapsed}",
    );
    let report = reproduce::reproduce(&selection, || bar.inc(1));
    bar.finish_and_clear();
    if let Some(set) = set {
        write(&report, set.staging())?;
        notes(set.commit(asked)?);
    }
    if args.json {
        say_json(&report.json())?;
    } else {
        print(&report, args.out.as_deref())?;
    }
    let failures = report.failures();
    if let Some((claim, row)) = failures.first() {
        anyhow::bail!(
            "{} published figures are left, the first in claim {claim}: {}",
            failures.len(),
            row.what
        );
    }
    Ok(())
}

/// Tables on the terminal.
fn print(report: &Report, folder: Option<&Path>) -> std::io::Result<()> {
    for result in &report.claims {
        let claim = &result.claim;
        say_unless_quiet(format_args!(
            "Claim {}: {} ({}): {}\n{}",
            claim.number,
            claim.title,
            claim.source,
            reproduce::overall(&result.rows).text(),
            reproduce::grid(&result.rows)
        ))?;
        for row in result.rows.iter().filter(|row| !row.notes().is_empty()) {
            say_unless_quiet(format_args!("  {}: {}\n", row.what, row.notes()))?;
        }
        say_unless_quiet("\n")?;
    }
    for table in &report.tables {
        say_unless_quiet(format_args!(
            "Table {}: {}\n{}\n",
            table.number, table.title, table.it
        ))?;
    }
    for figure in &report.figures {
        say_unless_quiet(format_args!("Fig. {}: {}\n", figure.number, figure.title))?;
        if folder.is_none() {
            say_unless_quiet("  give --out DIR for the picture and its numbers\n")?;
        }
    }
    for result in &report.measurements {
        say_unless_quiet(format_args!("{}\n", reproduce::heading(result)))?;
        for note in &result.it.notes {
            say_unless_quiet(format_args!("  {note}\n"))?;
        }
        for (_, title, grid) in result.tables() {
            say_unless_quiet(format_args!("\n{title}\n{grid}"))?;
        }
        say_unless_quiet("\n")?;
    }
    if !report.slips.is_empty() {
        say_unless_quiet(format_args!("{}\n", reproduce::SLIPS_TITLE))?;
        for slip in &report.slips {
            say_unless_quiet(format_args!(
                "  {}: {}; but {}. Model: {}.\n",
                slip.place, slip.printed, slip.against, slip.model
            ))?;
        }
        say_unless_quiet("\n")?;
    }
    if !report.claims.is_empty() {
        say_unless_quiet(format_args!("{}\n", reproduce::tally(report)))?;
    }
    if let Some(folder) = folder {
        say_unless_quiet(format_args!(
            "page: {}\n",
            folder.join("report.html").display()
        ))?;
    }
    Ok(())
}

/// The page, the figures and the tables as files.
fn write(report: &Report, folder: &Path) -> Result<(), InputError> {
    for figure in &report.figures {
        let name = format!("{}.svg", figure.file());
        figure.it.write(&folder.join(name))?;
    }
    for table in &report.tables {
        let path = folder.join(format!("table_{:03}.csv", table.number));
        OutputFile::write_with(&path, |out| table.it.write_csv(out))?;
    }
    for result in &report.measurements {
        for (name, _, grid) in result.tables() {
            let path = folder.join(format!("{name}.csv"));
            OutputFile::write_with(&path, |out| grid.write_csv(out))?;
        }
        for (name, chart) in result.files() {
            chart.write(&folder.join(format!("{name}.svg")))?;
        }
    }
    let json = format!("{:#}\n", report.json());
    let pages = [
        ("report.md", reproduce::markdown(report)),
        ("report.html", reproduce::html(report)),
        ("report.json", json),
    ];
    for (name, text) in pages {
        OutputFile::write_with(&folder.join(name), |out: &mut dyn Write| {
            out.write_all(text.as_bytes())
        })?;
    }
    Ok(())
}
