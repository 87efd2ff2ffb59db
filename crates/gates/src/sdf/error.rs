//! What can be wrong with a delay file, as such or for a design.

use std::fmt;

use crate::InputError;
use crate::netlist::{CellKind, Direction, Edge};
use crate::units::Time;

/// A fault of a delay file, with the place where it is.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", InputError::from(self.clone()))]
#[non_exhaustive]
pub struct SdfError {
    /// Name of the file, as [`Sdf::parse`](super::Sdf::parse) was told it.
    pub source_name: String,
    /// Line, from 1.
    pub line: usize,
    /// What is wrong, and what to do.
    pub fault: SdfFault,
}

impl From<SdfError> for InputError {
    fn from(error: SdfError) -> Self {
        InputError::at_line(&error.source_name, error.line, error.fault.to_string())
    }
}

/// What is wrong with a delay file, and what to do. The variants up to [`SdfFault::NumberTooLarge`] are of the file as such; the others
/// are of a design that it does not fit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SdfFault {
    /// A quoted text without an end.
    #[error("this quoted text has no end; close it with \"")]
    UnclosedText,
    /// A comment without an end.
    #[error("this comment has no end; close it with */")]
    UnclosedComment,
    /// Something stands where something else belongs.
    #[error("found {found} where {expected} belongs; give an SDF file, or write this one anew")]
    UnexpectedToken {
        /// What is there.
        found: SdfToken,
        /// What belongs there.
        expected: SdfExpected,
    },
    /// The file does not begin as a delay file does.
    #[error("this is not an SDF file, which begins with (DELAYFILE; give one that does")]
    NoDelayFile,
    /// An entry that SDF does not have in this place.
    #[error("{keyword} is not an entry of SDF that belongs here; remove it")]
    UnknownEntry {
        /// Its keyword, of which at most 60 characters are kept.
        keyword: String,
    },
    /// An entry of the head behind the first CELL.
    #[error("{keyword} follows a CELL; move it to the head of the file")]
    EntryAfterCell {
        /// Its keyword.
        keyword: String,
    },
    /// A divider that SDF does not have.
    #[error("the divider is neither . nor /; choose one of the two")]
    UnknownDivider,
    /// A time scale that SDF does not have.
    #[error("{text} is not a time scale; give 1, 10 or 100 and s, ms, us, ns, ps or fs")]
    UnknownTimescale {
        /// What is given.
        text: String,
    },
    /// A CELL that does not begin with its type.
    #[error("a CELL begins with (CELLTYPE \"…\"); add its type")]
    NoCellType,
    /// A CELL with two instances.
    #[error("a second INSTANCE in one CELL; make it a CELL of its own")]
    SecondInstance,
    /// A delay below zero that is not an increment.
    #[error("an absolute delay is negative; give 0 or more")]
    NegativeDelay,
    /// A delay with more values than there are transitions.
    #[error("a delay has more than 12 values; give 1, 2, 3, 6 or 12")]
    TooManyValues,
    /// A delay without a value.
    #[error("a delay has no value; give it one in parentheses")]
    NoValue,
    /// Two numbers where one or three belong.
    #[error("two numbers are no delay; give one or min:typ:max")]
    TwoNumbers,
    /// An edge that is neither rising nor falling.
    #[error("the edge is neither posedge nor negedge; choose one of the two")]
    UnknownEdge,
    /// An entry within a timing check that is no condition.
    #[error("{keyword} does not belong in a check; remove it")]
    EntryInCheck {
        /// Its keyword.
        keyword: String,
    },
    /// A number beyond what delays are kept in.
    #[error("{number} is beyond ±4.29 µs in this time scale; correct it or TIMESCALE")]
    NumberTooLarge {
        /// The number as the file has it.
        number: String,
    },
    /// A cell type that is none of the library's.
    #[error("the library has no cell {cell_type}; correct CELLTYPE")]
    UnknownCellType {
        /// The type.
        cell_type: String,
    },
    /// An instance that the design does not have.
    #[error("the chip has no instance {path}{}", .alternative.as_ref().map_or_else(
        || "; give a path below its top and the right DIVIDER, and an array with as many rows and columns".to_owned(),
        |meant| format!(", but has {meant}; give paths below its top and the right DIVIDER"),
    ))]
    UnknownInstance {
        /// Its path, with dots between names.
        path: String,
        /// The instance that the path may mean, if there is one.
        alternative: Option<String>,
    },
    /// An instance of another type than the file says.
    #[error("{part} is a {actual} and no {stated}; correct CELLTYPE or INSTANCE")]
    WrongCellType {
        /// The instance.
        part: SdfPart,
        /// Its type in the design.
        actual: String,
        /// Its type in the file.
        stated: String,
    },
    /// A stage of a chain with something else than its one delay.
    #[error("a stage of a delay has one path; give it an IOPATH A Z")]
    StagePath,
    /// A module with a delay that only cells have.
    #[error("{module} is a module, which has no delays but INTERCONNECT; name one of its cells")]
    DelayOfModule {
        /// Type of the module.
        module: String,
    },
    /// A cell with a wire inside.
    #[error(
        "a cell has no wires inside; move INTERCONNECT to the CELL of its module or of the top"
    )]
    WireInCell,
    /// A pin that a cell does not have.
    #[error("{} has no {} pin {pin}; give {}", .kind.name(), direction_name(*.direction), pins(*.kind, *.direction).join(" or "))]
    UnknownPin {
        /// Kind of the cell.
        kind: CellKind,
        /// Whether an input or an output is meant.
        direction: Direction,
        /// Name of the pin.
        pin: String,
    },
    /// A delay from a pin, or from one edge of it, that changes no output.
    #[error("{}{pin} of {} changes no output; remove this IOPATH", if .edge.is_some() { "this edge of " } else { "" }, .kind.name())]
    NoEffect {
        /// Kind of the cell.
        kind: CellKind,
        /// The pin.
        pin: String,
        /// The edge, if the delay is of one alone.
        edge: Option<Edge>,
    },
    /// A wire between pins of different nets.
    #[error("{from} and {to} are not connected; correct one of the two")]
    NotConnected {
        /// Pin or port at which the wire begins, as the file has it.
        from: String,
        /// Pin at which it ends.
        to: String,
    },
    /// An end of a wire at which the design has neither pin nor port.
    #[error(
        "{path} is neither a pin of a cell nor a port of the chip that a wire could have here; correct it"
    )]
    UnknownWireEnd {
        /// The end, as the file has it.
        path: String,
    },
    /// A sum of delays beyond what is kept.
    #[error("the delay becomes {} fs; keep what is added up between 0 and 4.29 µs", .delay.as_fs())]
    DelayOutOfRange {
        /// The sum.
        delay: Time,
    },
    /// A timing check of a cell that has none.
    #[error("{} has no timing checks; remove this one", .kind.name())]
    CheckOfGate {
        /// Kind of the cell.
        kind: CellKind,
    },
}

/// Which part of a design a fault is of.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum SdfPart {
    /// The design itself.
    Top,
    /// The instance of this path, with dots between names.
    Instance(String),
    /// A stage of a chain, which is one cell of the netlist.
    Stage,
}

impl fmt::Display for SdfPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            SdfPart::Top => "the top",
            SdfPart::Instance(path) => path,
            SdfPart::Stage => "this stage of a delay",
        })
    }
}

/// What stands in a delay file.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum SdfToken {
    /// An opening parenthesis.
    Open,
    /// A closing parenthesis.
    Close,
    /// A colon.
    Colon,
    /// A quoted text.
    Text(String),
    /// A keyword, a name or a number, of which at most 60 characters are kept.
    Word(String),
    /// The end of the file.
    End,
}

impl fmt::Display for SdfToken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            SdfToken::Open => "(",
            SdfToken::Close => ")",
            SdfToken::Colon => ":",
            SdfToken::Text(text) => return write!(f, "{text:?}"),
            SdfToken::Word(word) => word,
            SdfToken::End => "the end of the file",
        })
    }
}

/// What belongs in a place of a delay file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SdfExpected {
    /// An opening parenthesis.
    Open,
    /// A closing parenthesis.
    Close,
    /// The end of the file.
    End,
    /// This word.
    Keyword(&'static str),
    /// The keyword of an entry.
    AnyKeyword,
    /// What stands between the names of a path.
    Divider,
    /// What 1 stands for.
    Timescale,
    /// The type of a cell.
    CellType,
    /// A pin of a cell.
    Pin,
    /// An input of a cell.
    InputPin,
    /// An output of a cell.
    OutputPin,
    /// Where a wire begins.
    DrivingPin,
    /// Where a wire ends.
    DrivenPin,
    /// An edge of a pin.
    Edge,
    /// A number.
    Number,
    /// The value of a delay or limit.
    Value,
}

impl fmt::Display for SdfExpected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            SdfExpected::Open => "(",
            SdfExpected::Close => ")",
            SdfExpected::End => "the end of the file",
            SdfExpected::Keyword(word) => word,
            SdfExpected::AnyKeyword => "a keyword",
            SdfExpected::Divider => "a divider",
            SdfExpected::Timescale => "a time scale",
            SdfExpected::CellType => "a quoted cell type",
            SdfExpected::Pin => "a pin",
            SdfExpected::InputPin => "an input pin",
            SdfExpected::OutputPin => "an output pin",
            SdfExpected::DrivingPin => "a driving pin",
            SdfExpected::DrivenPin => "a driven pin",
            SdfExpected::Edge => "an edge",
            SdfExpected::Number => "a number",
            SdfExpected::Value => "a number, min:typ:max or )",
        })
    }
}

fn direction_name(direction: Direction) -> &'static str {
    match direction {
        Direction::Input => "input",
        Direction::Output => "output",
    }
}

/// The pins of a cell in one direction.
pub(super) fn pins(kind: CellKind, direction: Direction) -> &'static [&'static str] {
    match direction {
        Direction::Input => kind.inputs(),
        Direction::Output => kind.outputs(),
    }
}
