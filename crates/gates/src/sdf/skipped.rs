//! What is left out of a delay file, or taken over in another form, counted by kind.

use std::fmt;

/// Something left out of a file or an annotation, or approximated.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SkippedEntry {
    /// What it was.
    pub what: SkippedKind,
    /// How often.
    pub count: usize,
    /// Line of the first.
    pub first_line: usize,
}

impl SkippedEntry {
    pub(super) fn count(list: &mut Vec<SkippedEntry>, what: SkippedKind, line: usize) {
        match list.iter_mut().find(|s| s.what == what) {
            Some(skipped) => skipped.count += 1,
            None => list.push(SkippedEntry {
                what,
                count: 1,
                first_line: line,
            }),
        }
    }
}

/// What is left out or approximated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SkippedKind {
    /// COND: a delay or check that depends on other pins.
    Cond,
    /// CONDELSE: a delay where no condition holds.
    CondElse,
    /// PATHPULSE: widths of pulses that a path swallows.
    PathPulse,
    /// PATHPULSEPERCENT: the same in percent of the delay.
    PathPulsePercent,
    /// NETDELAY: one delay for all ends of a net.
    NetDelay,
    /// PERIOD: the shortest period of a clock.
    Period,
    /// SKEW: the longest time between two edges.
    Skew,
    /// BIDIRECTSKEW: the same in both directions.
    BidirectSkew,
    /// NOCHANGE: data stable while a control is active.
    NoChange,
    /// LABEL: parameters of models.
    Label,
    /// TIMINGENV: constraints of the environment.
    TimingEnv,
    /// RETAIN: how long an output keeps its value.
    Retain,
    /// Limits of pulses behind a delay.
    PulseLimits,
    /// Delays of more transitions than 0 to 1 and 1 to 0.
    OtherTransitions,
    /// Several delays of one arc, of which the longest is used.
    SeveralDelays,
    /// Wires to D of a flip-flop.
    WireToD,
    /// Wires to outputs of the design.
    WireToOutput,
    /// Wires with two delays into an arc that takes the longer.
    UnequalWire,
    /// Timing checks of pins or edges that a flip-flop does not act on.
    NoSuchCheck,
    /// Limits below zero, which become zero.
    NegativeLimit,
}

impl SkippedKind {
    /// Entries that are left out as a whole, by their keyword.
    const ENTRIES: [SkippedKind; 11] = [
        SkippedKind::Cond,
        SkippedKind::CondElse,
        SkippedKind::PathPulse,
        SkippedKind::PathPulsePercent,
        SkippedKind::NetDelay,
        SkippedKind::Period,
        SkippedKind::Skew,
        SkippedKind::BidirectSkew,
        SkippedKind::NoChange,
        SkippedKind::Label,
        SkippedKind::TimingEnv,
    ];

    /// The entry of this keyword, if it is one that is left out.
    pub(super) fn from_keyword(keyword: &str) -> Option<Self> {
        let mut entries = Self::ENTRIES.into_iter();
        entries.find(|kind| kind.name() == keyword)
    }

    /// The keyword of an entry, or what is left out in words.
    pub const fn name(self) -> &'static str {
        match self {
            SkippedKind::Cond => "COND",
            SkippedKind::CondElse => "CONDELSE",
            SkippedKind::PathPulse => "PATHPULSE",
            SkippedKind::PathPulsePercent => "PATHPULSEPERCENT",
            SkippedKind::NetDelay => "NETDELAY",
            SkippedKind::Period => "PERIOD",
            SkippedKind::Skew => "SKEW",
            SkippedKind::BidirectSkew => "BIDIRECTSKEW",
            SkippedKind::NoChange => "NOCHANGE",
            SkippedKind::Label => "LABEL",
            SkippedKind::TimingEnv => "TIMINGENV",
            SkippedKind::Retain => "RETAIN",
            SkippedKind::PulseLimits => "pulse limits",
            SkippedKind::OtherTransitions => "transitions to and from Z",
            SkippedKind::SeveralDelays => "arcs with several delays, of which the longest is used",
            SkippedKind::WireToD => "wires to D of a flip-flop",
            SkippedKind::WireToOutput => "wires to outputs of the chip",
            SkippedKind::UnequalWire => "wires that rise and fall differently into a non-unate arc",
            SkippedKind::NoSuchCheck => "checks of pins or edges that a flip-flop does not act on",
            SkippedKind::NegativeLimit => "negative limits, which become 0",
        }
    }
}

impl fmt::Display for SkippedKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
