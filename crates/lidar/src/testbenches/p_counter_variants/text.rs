//! Times and counts as checks show them.

use crate::units::Time;

/// Times in nanoseconds, to the picosecond.
pub(super) fn listed(times: &[Time]) -> String {
    let times: Vec<String> = times.iter().map(|t| format!("{:.3}", t.as_ns())).collect();
    if times.is_empty() {
        "none".to_owned()
    } else {
        times.join(" ")
    }
}

/// Counts, one after the other.
pub(super) fn numbers(numbers: &[usize]) -> String {
    numbers
        .iter()
        .map(usize::to_string)
        .collect::<Vec<_>>()
        .join(" ")
}
