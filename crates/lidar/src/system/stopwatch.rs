//! Elapsed time, split into laps.

use std::time::Instant;

/// What some work gives, and how long it took, s.
pub(super) fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let mut clock = Stopwatch::new();
    let given = work();
    (given, clock.lap())
}

/// Runs from when it was made.
pub(super) struct Stopwatch(Instant);

impl Stopwatch {
    pub(super) fn new() -> Self {
        Stopwatch(Instant::now())
    }

    /// Time since the last lap, or since the beginning, s.
    pub(super) fn lap(&mut self) -> f64 {
        let now = Instant::now();
        let lap = now - self.0;
        self.0 = now;
        lap.as_secs_f64()
    }
}
