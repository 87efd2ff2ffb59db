//! Ctrl-C and other requests to end: what is half written is removed at once, whatever the program is doing.
//!
//! The exit status is 128 plus the signal's number, as a shell reports it: 130 for SIGINT, 143 for SIGTERM, 129 for
//! SIGHUP, which is left alone where it is ignored already (`nohup`). SIGKILL cannot be caught: what it leaves, the
//! next run removes (see `temporary`).

use std::io;
use std::path::Path;

use super::input::read_text;

/// From now on, signals that ask this process to end remove its unfinished files and end it. For `main` alone: a
/// library has no say in what signals do.
///
/// # Errors
/// When the signals cannot be watched.
#[cfg(unix)]
pub fn clean_up_when_interrupted() -> io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

    let mut wanted = vec![SIGINT, SIGTERM];
    if !is_ignored(SIGHUP) {
        wanted.push(SIGHUP);
    }
    let mut signals = signal_hook::iterator::Signals::new(wanted)?;
    std::thread::Builder::new()
        .name("signals".into())
        .spawn(move || {
            if let Some(signal) = signals.forever().next() {
                end(signal);
            }
        })?;
    Ok(())
}

/// There are no such signals to watch.
///
/// # Errors
/// None.
#[cfg(not(unix))]
pub fn clean_up_when_interrupted() -> io::Result<()> {
    Ok(())
}

#[cfg(unix)]
fn end(signal: i32) -> ! {
    use super::temporary::Registry;
    use std::io::{IsTerminal, Write};

    // Held to the end, so that nothing is made or renamed any more.
    let mut registry = Registry::lock();
    registry.remove_all();
    let mut stderr = io::stderr();
    // On a terminal the line may hold half a progress bar.
    let clear = if stderr.is_terminal() { "\r\x1b[K" } else { "" };
    let _ = writeln!(
        stderr,
        "{clear}gdtof: interrupted; unfinished files are removed"
    );
    signal_hook::low_level::exit(128 + signal)
}

/// Whether the process was started with this signal ignored. Linux tells; elsewhere it counts as ignored.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = read_text(Path::new("/proc/self/status")).unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_none_or(|mask| mask >> (signal - 1) & 1 == 1)
}
