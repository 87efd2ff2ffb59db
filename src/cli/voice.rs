//! What the command says, and how far it is. All of it comes through here: clippy refuses other prints.
//!
//! | function | where | with `--quiet` |
//! |---|---|---|
//! | [`complain`] | standard error | yes |
//! | [`say_json`], [`say_file`]: what a program or a file takes | standard output | yes |
//! | [`say_unless_quiet`]: tables and sentences about what was done | standard output | no |
//! | [`note`], [`announce`], [`table_to_stderr`] | standard error | no |
//! | [`progress`], [`busy`] | standard error, if it is a terminal | no |
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::fmt::Display;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressFinish, ProgressStyle};
use serde::Serialize;

use crate::files::in_words;

static IS_QUIET: AtomicBool = AtomicBool::new(false);

/// How often a bar is drawn where nothing is done meanwhile.
const TICK: Duration = Duration::from_millis(200);

/// For the rest of the run.
pub(super) fn be_quiet() {
    IS_QUIET.store(true, Ordering::Relaxed);
}

fn is_quiet() -> bool {
    IS_QUIET.load(Ordering::Relaxed)
}

/// Writes to standard output, whose reader may have gone away.
fn say(text: impl Display) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    let written = write!(out, "{text}").and_then(|()| out.flush());
    written.map_err(|error| {
        let said = format!("standard output cannot be written ({})", in_words(&error));
        std::io::Error::new(error.kind(), said)
    })
}

/// Writes the text of a file: settings, a script, histograms as CSV.
///
/// # Errors
/// Those of standard output.
pub(super) fn say_file(text: impl Display) -> std::io::Result<()> {
    say(text)
}

/// Writes data as JSON, for a machine to read.
///
/// # Errors
/// Those of standard output.
pub(super) fn say_json(data: &(impl Serialize + ?Sized)) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(data)?;
    Ok(say(format_args!("{text}\n"))?)
}

/// Writes a table or a sentence about what was done.
///
/// # Errors
/// Those of standard output.
pub(super) fn say_unless_quiet(text: impl Display) -> std::io::Result<()> {
    if is_quiet() {
        return Ok(());
    }
    say(text)
}

/// Writes to standard error, whose reader may have gone away as well; then nobody is told.
fn to_standard_error(text: impl Display) {
    let _ = write!(std::io::stderr().lock(), "{text}");
}

/// What is wrong, a line each.
pub(super) fn complain(text: impl Display) {
    for line in text.to_string().lines() {
        to_standard_error(format_args!("gdtof: {line}\n"));
    }
}

/// A note on standard error.
pub(super) fn note(text: impl Display) {
    if !is_quiet() {
        to_standard_error(format_args!("gdtof: {text}\n"));
    }
}

/// Runs that take longer say so before they begin.
const LONG_S: f64 = 5.0;

/// Says how long something takes, if that is long.
pub(super) fn announce(what: &str, seconds: f64) {
    if seconds > LONG_S {
        let time = if seconds < 120.0 {
            format!("{seconds:.0} s")
        } else {
            format!("{:.0} minutes", seconds / 60.0)
        };
        let threads = quantity(rayon::current_num_threads() as u64, "thread");
        note(format_args!("{what} takes about {time} on {threads}"));
    }
}

/// Notes on standard error, a line each.
pub(super) fn notes(sentences: Vec<String>) {
    sentences.iter().for_each(note);
}

/// A table on standard error, where standard output has data.
pub(super) fn table_to_stderr(text: impl Display) {
    if !is_quiet() {
        to_standard_error(text);
    }
}

/// A bar of `length` steps, in a template of `indicatif`. It goes when it is dropped.
pub(super) fn progress(length: u64, template: &str) -> ProgressBar {
    styled_bar(ProgressBar::new(length), template)
}

/// What is being done where nobody knows how far it is, and for how long already. It goes when it is dropped.
pub(super) fn busy(what: &str) -> ProgressBar {
    styled_bar(
        ProgressBar::new_spinner(),
        &format!("{what} {{spinner}} {{elapsed}}"),
    )
}

fn styled_bar(bar: ProgressBar, template: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(template).expect("a template that indicatif knows");
    let bar = bar.with_style(style).with_finish(ProgressFinish::AndClear);
    if is_quiet() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    bar.enable_steady_tick(TICK);
    bar
}

/// `1 line`, `3 lines`.
pub(super) fn quantity(number: u64, noun: &str) -> String {
    let s = if number == 1 { "" } else { "s" };
    format!("{number} {noun}{s}")
}
