//! Delays in and out as SDF (Standard Delay Format, IEEE 1497, also called OVI 3.0).
//!
//! ```text
//!   Timing (min, typ, max) ──write_sdf──► FILE.sdf ──Sdf::parse──► Sdf ──annotate──► Timing of one corner
//! ```
//!
//! Paths of instances are relative to the chip's top: `mp_r0_c0.p_counter.u3`.
//!
//! # What is taken over
//! IOPATH, DEVICE, PORT and INTERCONNECT, each ABSOLUTE or INCREMENT; timing checks SETUP, HOLD, SETUPHOLD,
//! RECOVERY, REMOVAL, RECREM and WIDTH become the limits of the instance. Instances are named exactly, or `*`
//! for every instance of a cell type. A member missing from min:typ:max leaves its corner alone.
//!
//! # What is left out, counted and reported ([`Sdf::skipped`], [`Annotation::notes`])
//! COND and CONDELSE (a delay that depends on other pins must not become the delay at all times), PATHPULSE,
//! PATHPULSEPERCENT, NETDELAY, RETAIN, pulse limits, transitions to and from Z, PERIOD, SKEW, BIDIRECTSKEW,
//! NOCHANGE, LABEL, TIMINGENV. Anything else is refused.
//!
//! # What a cell cannot tell apart
//! A cell has one delay for each pair of input and output pin and each direction of the output. Where a file says
//! more, the longest delay is used and the arc is counted: rising and falling inputs of a non-unate arc (XOR2, XNOR2,
//! select of MUX2, reset of DFFSR) that differ.
//!
//! # Chains
//! A cell with transport delays is one cell of the netlist and a chain of stages for other tools
//! ([`Chain`](crate::netlist::Chain)): a file names the stages, whose delays are added up, or the cell.
//!
//! # Wires
//! Wire delays (INTERCONNECT, PORT) are added to the arcs of the pin they end at. That gives every change of
//! the cell's output the time it would have with a wire of its own, with these exceptions:
//! * A non-unate arc takes the longer of a wire's rising and falling delay; exact if they are equal.
//! * Glitches: a pulse filtered by the cell is one shorter than wire and cell together, where a wire of its
//!   own filters at its own delay and the cell at its own. Two inputs that change in one instant before
//!   their wires are treated as simultaneous, though they reach the cell apart, and a new value waits for the
//!   arc of the later change alone.
//! * D of a flip-flop has no arc. A wire to D makes the flip-flop sample what its net was one wire delay
//!   earlier; the model samples the net as it is at the clock edge. Such delays are left out and counted with
//!   the longest: they matter only where D changes within that time before the edge. A wire to CK is exact
//!   for the output but samples D when CK's net rises, not one wire delay later.
//! * Timing checks are judged at nets, where wires to D and to CK begin, with the limits of the pins.

mod annotate;
mod entries;
mod error;
mod limits;
mod parser;
mod skipped;
mod stages;
mod suspect_delays;
#[cfg(test)]
mod tests;
mod tokens;
mod wires;
mod writer;

pub use annotate::{Annotation, annotate};
pub use error::{SdfError, SdfExpected, SdfFault, SdfPart, SdfToken};
pub(super) use limits::checks_of;
pub use skipped::{SkippedEntry, SkippedKind};
pub use suspect_delays::{SuspectDelay, suspect_delays};
pub use writer::{SdfDivider, SdfOptions, SdfTimescale, write_library_sdf, write_sdf};

use std::borrow::Cow;

use crate::netlist::{Corner, Edge};
use crate::units::Time;

/// The dotted path of a name in a scope; the empty path is the top.
fn join(path: &str, name: &str) -> String {
    if path.is_empty() {
        name.to_owned()
    } else {
        format!("{path}.{name}")
    }
}

/// Minimum, typical and maximum of a time; members may be missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Triple(pub [Option<Time>; 3]);

impl Triple {
    /// The same in every corner.
    pub const fn fixed(time: Time) -> Self {
        Triple([Some(time); 3])
    }

    /// The member of one corner.
    pub const fn in_corner(self, corner: Corner) -> Option<Time> {
        self.0[corner as usize]
    }
}

/// A pin, perhaps only one of its edges.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PinEdge<'a> {
    /// The edge meant; both without one.
    pub edge: Option<Edge>,
    /// Name of the pin.
    pub pin: Cow<'a, str>,
}

/// Which delay an entry gives.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DelayPath<'a> {
    /// From an input of the cell to one of its outputs.
    IoPath(PinEdge<'a>, Cow<'a, str>),
    /// From every input to an output, or to all outputs.
    Device(Option<Cow<'a, str>>),
    /// The wire that ends at an input of the cell.
    Port(Cow<'a, str>),
    /// The wire from one pin to another; dotted paths below the entry's instance.
    Interconnect(Cow<'a, str>, Cow<'a, str>),
}

/// One delay.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SdfDelay<'a> {
    /// Line it stands in, from 1.
    pub line: usize,
    /// Whether it is added to what is there (INCREMENT) or replaces it (ABSOLUTE).
    pub increment: bool,
    /// What it is the delay of.
    pub path: DelayPath<'a>,
    /// Delay of a rising change. For an arc the output's, for a wire the wire's.
    pub rise: Triple,
    /// Delay of a falling change.
    pub fall: Triple,
}

impl SdfDelay<'_> {
    /// Whether it gives a value for a corner.
    pub fn has_value(&self, corner: Corner) -> bool {
        [self.rise, self.fall]
            .iter()
            .any(|value| value.in_corner(corner).is_some())
    }
}

/// What an entry checks, as SDF names it. The limits of a cell have a [`CheckKind`](crate::netlist::CheckKind) each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CheckKeyword {
    /// Data stable before the reference edge.
    Setup,
    /// Data stable after the reference edge.
    Hold,
    /// Both; limits are setup, hold.
    SetupHold,
    /// Reset or set released before the clock edge.
    Recovery,
    /// Reset or set held after the clock edge.
    Removal,
    /// Both; limits are recovery, removal.
    RecRem,
    /// Shortest pulse that begins with the edge of the pin.
    Width,
}

impl CheckKeyword {
    /// Every kind.
    pub const ALL: [CheckKeyword; 7] = [
        CheckKeyword::Setup,
        CheckKeyword::Hold,
        CheckKeyword::SetupHold,
        CheckKeyword::Recovery,
        CheckKeyword::Removal,
        CheckKeyword::RecRem,
        CheckKeyword::Width,
    ];

    /// Keyword in SDF.
    pub const fn keyword(self) -> &'static str {
        match self {
            CheckKeyword::Setup => "SETUP",
            CheckKeyword::Hold => "HOLD",
            CheckKeyword::SetupHold => "SETUPHOLD",
            CheckKeyword::Recovery => "RECOVERY",
            CheckKeyword::Removal => "REMOVAL",
            CheckKeyword::RecRem => "RECREM",
            CheckKeyword::Width => "WIDTH",
        }
    }

    /// Number of limits.
    pub const fn limits(self) -> usize {
        match self {
            CheckKeyword::SetupHold | CheckKeyword::RecRem => 2,
            _ => 1,
        }
    }
}

/// One timing check.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SdfCheck<'a> {
    /// Line it stands in, from 1 (0 where it comes from no file).
    pub line: usize,
    /// What is checked.
    pub kind: CheckKeyword,
    /// The pin that must be stable; for [`CheckKeyword::Width`] the one whose pulse is measured.
    pub pin: PinEdge<'a>,
    /// The edge it is measured against; none for [`CheckKeyword::Width`].
    pub reference: Option<PinEdge<'a>>,
    /// Limits; the second only where [`CheckKeyword::limits`] is 2. They may be negative there.
    pub limits: [Triple; 2],
}

impl SdfCheck<'_> {
    /// Whether it gives a limit for a corner.
    pub fn has_value(&self, corner: Corner) -> bool {
        self.limits
            .iter()
            .any(|limit| limit.in_corner(corner).is_some())
    }
}

/// Which instances a CELL entry is about.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SdfInstance<'a> {
    /// Every instance of the cell type.
    Every,
    /// One, by its path below the top with dots between names; empty for the top itself. A dot that is part of
    /// a name is written `\.`.
    Path(Cow<'a, str>),
}

/// One CELL entry.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SdfCell<'a> {
    /// Line it starts in, from 1.
    pub line: usize,
    /// Its CELLTYPE.
    pub cell_type: &'a str,
    /// Which instances.
    pub instance: SdfInstance<'a>,
    /// Delays in file order.
    pub delays: Vec<SdfDelay<'a>>,
    /// Timing checks in file order.
    pub checks: Vec<SdfCheck<'a>>,
}

/// What the head of a file says. All but divider and time scale is for people only.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SdfHeader<'a> {
    /// Texts of SDFVERSION, DESIGN, DATE, VENDOR, PROGRAM, VERSION, PROCESS, VOLTAGE and TEMPERATURE, where
    /// there are any, as (keyword, text).
    pub texts: Vec<(&'static str, Cow<'a, str>)>,
    /// Between names of a path: `.` or `/`.
    pub divider: char,
    /// What 1 stands for.
    pub timescale: Time,
}

/// A delay file; it borrows the text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sdf<'a> {
    /// Name of the file, for complaints.
    pub source: String,
    /// Its head.
    pub header: SdfHeader<'a>,
    /// Its entries in file order.
    pub cells: Vec<SdfCell<'a>>,
    /// Constructs of the format that are not modelled.
    pub skipped: Vec<SkippedEntry>,
}

impl Sdf<'_> {
    /// Delays and timing checks that give a value for a corner.
    pub fn values(&self, corner: Corner) -> usize {
        let cells = self.cells.iter();
        let values = cells.map(|cell| {
            let delays = cell.delays.iter().filter(|delay| delay.has_value(corner));
            let checks = cell.checks.iter().filter(|check| check.has_value(corner));
            delays.count() + checks.count()
        });
        values.sum()
    }
}
