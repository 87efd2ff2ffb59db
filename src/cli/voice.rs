//! What the command says: data that was asked for, what was done, and how far it is.
//!
//! `--quiet` leaves only the first, and errors. Progress shows on a terminal alone.

use std::fmt::Display;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

static IS_QUIET: AtomicBool = AtomicBool::new(false);

/// For the rest of the run.
pub(super) fn be_quiet() {
    IS_QUIET.store(true, Ordering::Relaxed);
}

fn is_quiet() -> bool {
    IS_QUIET.load(Ordering::Relaxed)
}

/// Writes data to standard output, whose reader may have gone away.
pub(super) fn say(text: impl Display) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    write!(out, "{text}")?;
    out.flush()
}

/// Writes data as JSON, for a machine to read.
///
/// # Errors
/// Those of standard output.
pub(super) fn say_json(data: &(impl Serialize + ?Sized)) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(data)?;
    Ok(say(format_args!("{text}\n"))?)
}

/// Writes to standard output what was done, where the results are files.
pub(super) fn tell(text: impl Display) -> std::io::Result<()> {
    if is_quiet() {
        return Ok(());
    }
    say(text)
}

/// A note on standard error.
pub(super) fn note(text: impl Display) {
    if !is_quiet() {
        eprintln!("gdtof: {text}");
    }
}

/// Notes on standard error, a line each.
pub(super) fn notes(sentences: Vec<String>) {
    sentences.iter().for_each(note);
}

/// A bar of `length` steps, in a template of `indicatif`.
pub(super) fn progress(length: u64, template: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(template).expect("a template that indicatif knows");
    let bar = ProgressBar::new(length).with_style(style);
    if is_quiet() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    bar
}
