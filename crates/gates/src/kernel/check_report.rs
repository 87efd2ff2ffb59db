//! What timing checks found: each violation, a table by kind of check, and how near the others came.
//!
//! Slack is the time left to the limit, negative where it was broken. Slacks are counted in bins of 10 ps from
//! −100 ps to +400 ps; what lies outside goes into the first or last bin, which is therefore where an idle
//! design's slacks are.

use std::fmt;

use crate::netlist::{CheckKind, Corner, Edge};
use crate::units::Time;

/// Width of a slack bin.
pub const BIN_WIDTH: Time = Time::from_ps(10);
/// Lower edge of the first slack bin.
pub const FIRST_BIN: Time = Time::from_ps(-100);
/// Slack bins.
pub const BINS: usize = 50;

/// The bin of a slack.
#[inline]
pub(super) fn slack_bin(slack_fs: i64) -> usize {
    const FIRST_FS: i64 = FIRST_BIN.as_fs();
    const WIDTH_FS: i64 = BIN_WIDTH.as_fs();
    let slack_fs = slack_fs.clamp(FIRST_FS, FIRST_FS + WIDTH_FS * BINS as i64 - 1);
    ((slack_fs - FIRST_FS) / WIDTH_FS) as usize
}

/// What a violation does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Policy {
    /// It is reported.
    #[default]
    ReportOnly,
    /// It is reported, and if it relates two pins (setup, hold, recovery, removal), the flip-flop's state becomes
    /// X; its outputs follow one clock-to-output delay after the instant that completed the violation.
    ///
    /// An X that reaches a clock pin is one possible edge, when it arrives; the edges that the clock would have made
    /// later do not happen. Known values at the end do not prove that nothing was spoilt: the violations do.
    XOnViolation,
}

/// A limit that was broken.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Violation {
    /// Which limit.
    pub kind: CheckKind,
    /// Dotted path of the flip-flop.
    pub cell: String,
    /// The pin measured against CK, or whose pulse it is.
    pub pin: String,
    /// Direction in which that pin changed: D's for setup and hold, the release for recovery and removal, the
    /// end of the pulse for widths.
    pub edge: Edge,
    /// The event that completed it.
    #[cfg_attr(feature = "serde", serde(rename = "time_fs"))]
    pub time: Time,
    /// Distance less limit; negative.
    #[cfg_attr(feature = "serde", serde(rename = "slack_fs"))]
    pub slack: Time,
    /// Whether the flip-flop samples an asynchronous signal, so that this is by design.
    pub is_asynchronous: bool,
}

/// Where and when a slack was smallest.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SlackLocation {
    /// Dotted path of the flip-flop.
    pub cell: String,
    /// The pin measured against CK, or whose pulse it is.
    pub pin: String,
    /// The event that completed the check.
    #[cfg_attr(feature = "serde", serde(rename = "time_fs"))]
    pub time: Time,
    /// Distance less limit.
    #[cfg_attr(feature = "serde", serde(rename = "slack_fs"))]
    pub slack: Time,
}

/// All checks of one kind.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CheckSummary {
    /// Which.
    pub kind: CheckKind,
    /// Times it was evaluated, asynchronous samplers left out.
    pub checked: u64,
    /// Times it was broken, asynchronous samplers left out.
    pub violated: u64,
    /// Times it was evaluated at asynchronous samplers.
    pub asynchronous_checked: u64,
    /// Times it was broken at asynchronous samplers.
    pub asynchronous_violated: u64,
    /// The first smallest slack, asynchronous samplers left out; none if nothing was checked.
    pub worst: Option<SlackLocation>,
    /// Slacks by bin ([`BINS`] of [`BIN_WIDTH`] from [`FIRST_BIN`]), asynchronous samplers left out.
    pub histogram: Vec<u64>,
}

/// Everything that was found.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CheckReport {
    /// What violations did.
    pub policy: Policy,
    /// Corner of the limits.
    pub corner: Corner,
    /// Nothing before this was judged; none if everything was.
    #[cfg_attr(feature = "serde", serde(rename = "not_before_fs"))]
    pub not_before: Option<Time>,
    /// Flip-flops that were watched.
    pub flip_flops: usize,
    /// Of these, samplers of asynchronous signals.
    pub asynchronous_flip_flops: usize,
    /// Memory that the checks took, bytes.
    pub memory_bytes: usize,
    /// By kind of check.
    pub summaries: Vec<CheckSummary>,
    /// Every violation by time, those of asynchronous samplers included and marked.
    pub violations: Vec<Violation>,
    /// Violations that were counted but not kept.
    pub violations_left_out: u64,
}

impl CheckReport {
    /// The summary of one kind.
    ///
    /// # Panics
    /// When a report read from a file lacks it.
    pub fn summary(&self, kind: CheckKind) -> &CheckSummary {
        let summary = self.summaries.iter().find(|s| s.kind == kind);
        summary.expect("a report has every kind")
    }

    /// Violations of flip-flops that are not asynchronous samplers.
    pub fn violated(&self) -> u64 {
        self.summaries.iter().map(|s| s.violated).sum()
    }
}

impl fmt::Display for CheckReport {
    /// A table for a terminal: one line per kind of check.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "Timing checks: {} flip-flops, {} of them asynchronous samplers (setup and hold counted apart)",
            self.flip_flops, self.asynchronous_flip_flops
        )?;
        writeln!(
            f,
            "  {:<13}{:>12}{:>10}{:>13}{:>14}  where",
            "check", "checked", "violated", "asynchronous", "worst slack"
        )?;
        for s in &self.summaries {
            let worst = s.worst.as_ref();
            let slack = worst.map_or("-".to_owned(), |p| p.slack.to_string());
            let place = worst.map_or(String::new(), |p| {
                format!("  {}.{} at {}", p.cell, p.pin, p.time)
            });
            writeln!(
                f,
                "  {:<13}{:>12}{:>10}{:>13}{slack:>14}{place}",
                s.kind.name(),
                s.checked,
                s.violated,
                s.asynchronous_violated
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slack_bins_are_half_open_and_the_outermost_take_the_rest() {
        assert_eq!(slack_bin(-1), 9);
        assert_eq!(slack_bin(0), 10);
        assert_eq!(slack_bin(9_999), 10);
        assert_eq!(slack_bin(i64::MIN), 0);
        assert_eq!(slack_bin(i64::MAX), BINS - 1);
    }
}
