//! Times, counts and lists of them as checks show them.

use crate::units::Time;

/// Times in nanoseconds, to the picosecond.
pub(super) fn listed(times: &[Time]) -> String {
    if times.is_empty() {
        return "none".to_owned();
    }
    in_a_row(times.iter().map(|t| format!("{:.3}", t.as_ns())))
}

/// Anything, one after the other.
pub(super) fn in_a_row(items: impl IntoIterator<Item = impl ToString>) -> String {
    let items = items.into_iter().map(|item| item.to_string());
    items.collect::<Vec<_>>().join(" ")
}

/// A number, or X.
pub(super) fn number_text(number: Option<u64>) -> String {
    number.map_or("X".to_owned(), |n| n.to_string())
}
