//! What a replay says when none of its events is counted: where windows are, and which start values open none.

use std::ops::Range;

use super::stimuli::Stimuli;
use crate::chip::{WindowLaw, WindowOutcome};
use crate::units::Time;

/// One sentence for a recording of `events` SPAD pulses that left every bin empty.
pub(super) fn sentence(stimuli: &Stimuli, events: u64) -> String {
    let law = WindowLaw::new(stimuli.sensor.clone(), &stimuli.exposure);
    let outcomes = || stimuli.starts.iter().map(|&start| law.window(start));
    let none = format!("none of {events} events is counted");
    if outcomes().all(|outcome| outcome == WindowOutcome::Never) {
        return format!(
            "{none}: no start value opens a window within {} CLK periods; give smaller start values or more --stop-periods",
            stimuli.exposure.stop_periods
        );
    }
    let Some(window) = outcomes().find_map(WindowOutcome::open) else {
        return none;
    };
    let Range { start, end } = law.interval(&window);
    let ns = |time: Time| time.as_s() * 1e9;
    format!(
        "{none}: the window of start value {} is from {:.1} to {:.1} ns after STOP; times in the file are fs",
        window.start,
        ns(start),
        ns(end)
    )
}
