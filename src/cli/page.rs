//! `gdtof page`: one HTML file to look at a frame or a drive.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::voice::{busy, say_json, say_unless_quiet};
use crate::page::Page;
use crate::report::Table;

/// Arguments of `gdtof page`.
#[derive(Args)]
pub(super) struct PageArgs {
    /// Folder that `gdtof frame` or `gdtof drive` has written.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// File to write.
    #[arg(long, short, value_name = "FILE", default_value = "page.html")]
    out: PathBuf,
    /// Show every N-th frame of a drive; each adds about 0.2 MB to the page.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
    /// Print JSON instead of the table.
    #[arg(long)]
    json: bool,
}

/// What was written.
#[derive(Serialize)]
struct Report<'a> {
    page: &'a PathBuf,
    frames: usize,
    bytes: usize,
}

/// Runs the command.
///
/// # Errors
/// Bad input and unwritable output.
pub(super) fn run(args: &PageArgs) -> anyhow::Result<()> {
    let busy = busy("making the page");
    let page = Page::read(&args.folder, &args.folder, args.every as usize)?;
    page.write(&args.out)?;
    drop(busy);
    let report = Report {
        page: &args.out,
        frames: page.frames,
        bytes: page.size(),
    };
    if args.json {
        return say_json(&report);
    }
    let table = Table::new(format!("Page of {}", args.folder.display()))
        .row("frames", report.frames)
        .row("size", format!("{:.1} MB", report.bytes as f64 / 1e6))
        .row("open in a browser", args.out.display());
    Ok(say_unless_quiet(table)?)
}
