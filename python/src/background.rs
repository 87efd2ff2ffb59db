//! Work on a thread of its own, while Python goes on.
//!
//! ```text
//!   Python's thread   ├─ spawn ─┬─ wait 50 ms ─ signals? ─┬─ wait 50 ms ─ …   Ctrl-C: flag up, exception at once
//!   (GIL released)              │                         │
//!   the work's thread           └── batch ─ flag? ─ batch ─ flag? ─ …          ends at its next look at the flag
//! ```

use std::any::Any;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;

use crate::failure::Failure;

/// How often Python's signal handlers get their turn: well within the 0.2 s that a user waits for Ctrl-C.
const POLL: Duration = Duration::from_millis(50);

/// As much as the main thread of a program has.
const STACK_BYTES: usize = 8 << 20;

/// Between the work and who waits for it: how far it is, and whether it is still wanted.
#[derive(Debug, Clone, Default)]
pub(crate) struct Watch(Arc<(AtomicBool, AtomicUsize)>);

impl Watch {
    /// The work is no longer wanted.
    pub(crate) fn stop(&self) {
        self.0.0.store(true, Ordering::Relaxed);
    }

    /// So many macropixels are done; whether to go on.
    pub(crate) fn done(&self, macropixels: usize) -> ControlFlow<()> {
        self.0.1.fetch_add(macropixels, Ordering::Relaxed);
        if self.0.0.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    /// Macropixels done.
    fn progress(&self) -> usize {
        self.0.1.load(Ordering::Relaxed)
    }

    /// Whether the work is still wanted.
    ///
    /// # Errors
    /// When it is not.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        match self.done(0) {
            ControlFlow::Break(()) => Err(Failure::Stopped),
            ControlFlow::Continue(()) => Ok(()),
        }
    }
}

/// What a piece of work gave: its result, or its panic.
pub(crate) type Outcome<T> = Result<Result<T, Failure>, Box<dyn Any + Send>>;

/// Runs `work` on a thread of its own and waits for it with the GIL released. A signal whose handler raises, such as Ctrl-C, ends
/// the wait at once; the work ends at its next look at the [`Watch`]. `progress` is called with the macropixels done about every
/// 50 ms, where some are.
///
/// # Errors
/// What the work reports, what a signal handler or `progress` raises.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watch) -> Result<T, Failure> + Send + 'static,
) -> PyResult<T> {
    let watch = Watch::default();
    let theirs = watch.clone();
    let (give, take) = sync_channel(1);
    spawn(move || {
        // Nobody listens after a signal.
        let _ = give.send(guarded(|| work(&theirs)));
    })?;
    wait(py, take, &watch, progress).1
}

/// A thread for `work`.
///
/// # Errors
/// When the system has none.
pub(crate) fn spawn(work: impl FnOnce() + Send + 'static) -> PyResult<()> {
    let thread = thread::Builder::new()
        .name("gdtof".into())
        .stack_size(STACK_BYTES);
    thread.spawn(work)?;
    Ok(())
}

/// The outcome of `work`, panics included.
pub(crate) fn guarded<T>(work: impl FnOnce() -> Result<T, Failure>) -> Outcome<T> {
    catch_unwind(AssertUnwindSafe(work))
}

/// Waits for an outcome on `take`, which comes back with it.
///
/// # Errors
/// As [`run`].
pub(crate) fn wait<T: Send>(
    py: Python<'_>,
    mut take: Receiver<Outcome<T>>,
    watch: &Watch,
    progress: Option<&Bound<'_, PyAny>>,
) -> (Receiver<Outcome<T>>, PyResult<T>) {
    let mut told = 0;
    loop {
        let outcome;
        (take, outcome) = py.detach(move || {
            let outcome = take.recv_timeout(POLL);
            (take, outcome)
        });
        let heard = py.check_signals().and_then(|()| {
            let done = watch.progress();
            if let Some(progress) = progress.filter(|_| done > told) {
                told = done;
                progress.call1((done,))?;
            }
            Ok(())
        });
        if let Err(raised) = heard {
            watch.stop();
            return (take, Err(raised));
        }
        match outcome {
            Ok(Ok(result)) => return (take, result.map_err(PyErr::from)),
            Ok(Err(panic)) => resume_unwind(panic),
            Err(RecvTimeoutError::Timeout) => (),
            Err(RecvTimeoutError::Disconnected) => return (take, Err(Failure::Stopped.into())),
        }
    }
}
