//! What a testbench checked: one line each with the value expected and the value found, and a verdict.

use std::fmt;

use serde::Serialize;

use crate::units::Time;

/// The checks of one testbench, in the order in which they were made.
#[derive(Debug, Clone, Default)]
pub struct Checks {
    notes: Vec<String>,
    lines: Vec<CheckedValue>,
}

/// A value that was checked, in words.
#[derive(Debug, Clone, Serialize)]
pub struct CheckedValue {
    /// What was looked at.
    pub what: String,
    /// What it should be.
    pub expected: String,
    /// What it is.
    pub found: String,
    /// Whether that is as it should be.
    #[serde(skip)]
    pub holds: bool,
}

impl Checks {
    /// No checks yet.
    pub(crate) fn new() -> Self {
        Self::default()
    }

    /// Checks that a value is the expected one.
    pub(crate) fn equal<T: PartialEq + fmt::Display>(
        &mut self,
        what: impl Into<String>,
        expected: T,
        found: T,
    ) {
        let holds = expected == found;
        self.add_verdict(what, expected, found, holds);
    }

    /// Checks that a time is the expected one, to the femtosecond; printed in nanoseconds.
    pub(crate) fn time(&mut self, what: impl Into<String>, expected: Time, found: Time) {
        let holds = expected == found;
        self.add_verdict(what, exact(expected), exact(found), holds);
    }

    /// Checks that all times are the expected one; prints the extremes of those found.
    pub(crate) fn times(&mut self, what: impl Into<String>, expected: Time, found: &[Time]) {
        let holds = !found.is_empty() && found.iter().all(|&t| t == expected);
        self.add_verdict(what, exact(expected), range(found), holds);
    }

    /// A check whose verdict the caller has reached: `expected` says what was wanted.
    pub(crate) fn add_verdict(
        &mut self,
        what: impl Into<String>,
        expected: impl fmt::Display,
        found: impl fmt::Display,
        holds: bool,
    ) {
        self.lines.push(CheckedValue {
            what: what.into(),
            expected: expected.to_string(),
            found: found.to_string(),
            holds,
        });
    }

    /// Text to be printed before the checks: a table of what was found, say.
    pub(crate) fn note(&mut self, text: impl Into<String>) {
        self.notes.push(text.into());
    }

    /// How many checks were made.
    pub fn count(&self) -> usize {
        self.lines.len()
    }

    /// The checks that failed.
    pub fn failures(&self) -> impl Iterator<Item = &CheckedValue> {
        self.lines.iter().filter(|line| !line.holds)
    }

    /// How many checks failed.
    pub fn failed(&self) -> usize {
        self.failures().count()
    }

    /// Whether something was checked and nothing failed.
    pub fn passed(&self) -> bool {
        self.failed() == 0 && !self.lines.is_empty()
    }
}

impl fmt::Display for Checks {
    /// The notes, then one line per check, columns aligned, and a line that counts them.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for note in &self.notes {
            writeln!(f, "{note}")?;
        }
        let width = |cell: fn(&CheckedValue) -> &str, title: &str| {
            let cells = self.lines.iter().map(|line| cell(line).chars().count());
            cells.max().unwrap_or(0).max(title.len())
        };
        let what = width(|line| &line.what, "checked");
        let expected = width(|line| &line.expected, "expected");
        let found = width(|line| &line.found, "found");
        let (a, b, c) = ("checked", "expected", "found");
        writeln!(f, "{a:what$}  {b:expected$}  {c:found$}")?;
        for line in &self.lines {
            let verdict = if line.holds { "ok" } else { "FAILED" };
            let (a, b, c) = (&line.what, &line.expected, &line.found);
            writeln!(f, "{a:what$}  {b:expected$}  {c:found$}  {verdict}")?;
        }
        writeln!(f, "{} checked, {} failed", self.lines.len(), self.failed())
    }
}

/// A time in nanoseconds, to the femtosecond.
fn exact(time: Time) -> String {
    format!("{:.6} ns", time.as_ns())
}

/// The extremes of some times, as one time where they agree.
fn range(times: &[Time]) -> String {
    match (times.iter().min(), times.iter().max()) {
        (Some(&least), Some(&most)) if least == most => exact(least),
        (Some(&least), Some(&most)) => format!("{} to {}", exact(least), exact(most)),
        _ => "none".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_check_is_printed_and_fails_the_testbench() {
        let mut checks = Checks::new();
        checks.equal("rows", 4, 4);
        checks.time("delay", Time::from_fs(1_000_001), Time::from_fs(1_000_002));
        let expected = "\
checked  expected     found      \n\
rows     4            4            ok\n\
delay    1.000001 ns  1.000002 ns  FAILED\n\
2 checked, 1 failed\n";
        assert_eq!(checks.to_string(), expected);
        assert!(!checks.passed());
        let failures: Vec<&str> = checks
            .failures()
            .map(|failed| failed.what.as_str())
            .collect();
        assert_eq!(failures, ["delay"]);
    }

    #[test]
    fn nothing_checked_is_no_success() {
        assert!(!Checks::new().passed());
        let mut checks = Checks::new();
        checks.times("rises", Time::ZERO, &[]);
        assert_eq!(checks.failed(), 1);
        checks = Checks::new();
        checks.times("rises", Time::ZERO, &[Time::ZERO; 2]);
        assert!(checks.passed());
    }
}
