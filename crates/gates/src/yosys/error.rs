//! What can be wrong with a netlist of Yosys.

use crate::netlist::NetlistError;

/// What is wrong with a netlist of Yosys, and the cure.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum YosysError {
    /// The text is no such netlist.
    #[error(
        "is no netlist of Yosys ({0}); write one with: yosys -p \"read_verilog my.v; synth -flatten; write_json my.json\""
    )]
    NoNetlist(JsonFault),
    /// The text is too long.
    #[error("has {0} bytes, of which at most {most} are read; give one block", most = super::MOST_BYTES)]
    TooLong(usize),
    /// No module of this name.
    #[error("has no module {asked}; give {}", .there.join(" or "))]
    NoModule {
        /// What is asked for.
        asked: String,
        /// What there is.
        there: Vec<String>,
    },
    /// Several modules, and none is the top.
    #[error("has several modules and no top; name one as FILE:MODULE, {}, or run synth -flatten -top", .0.join(" or "))]
    NoTop(Vec<String>),
    /// A port that is neither input nor output.
    #[error("module {module}: port {port} is {direction:?}; make it an input or an output")]
    Direction {
        /// Module at fault.
        module: String,
        /// Port at fault.
        port: String,
        /// What it is.
        direction: String,
    },
    /// A cell that has no counterpart here.
    #[error("module {module}: cell {cell} is a {kind}, {why}")]
    Cell {
        /// Module at fault.
        module: String,
        /// Cell at fault.
        cell: String,
        /// Its type.
        kind: String,
        /// Why it is none of ours, and the cure.
        why: CellFault,
    },
    /// A pin of a cell that is not connected to one net that is driven.
    #[error("module {module}: pin {pin} of cell {cell} ({kind}) {problem}")]
    Pin {
        /// Module at fault.
        module: String,
        /// Cell at fault.
        cell: String,
        /// Its type.
        kind: String,
        /// Pin at fault.
        pin: String,
        /// What is wrong with it, and the cure.
        problem: PinFault,
    },
    /// An output that nothing drives.
    #[error("module {module}: nothing drives {net}; connect an output to it or remove it")]
    Undriven {
        /// Module at fault.
        module: String,
        /// Net without a driver.
        net: String,
    },
    /// A net with two drivers.
    #[error("module {module}: {first} and {second} both drive {net}; give each its own net")]
    TwoDrivers {
        /// Module at fault.
        module: String,
        /// Net driven twice.
        net: String,
        /// First driver.
        first: String,
        /// Second driver.
        second: String,
    },
    /// What the netlist's own rules say.
    #[error(transparent)]
    Netlist(#[from] NetlistError),
}

/// Why a text is no netlist of Yosys.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum JsonFault {
    /// It is no JSON.
    #[error("line {line}: it is no JSON")]
    Syntax {
        /// Line, from 1.
        line: usize,
    },
    /// It ends within an entry.
    #[error("line {line}: the text ends early")]
    EndsEarly {
        /// Line, from 1.
        line: usize,
    },
    /// An entry lacks a field.
    #[error("line {line}: `{field}` is missing")]
    MissingField {
        /// Line, from 1.
        line: usize,
        /// Name of the field.
        field: String,
    },
    /// A number is where a text should be, or the like.
    #[error("line {line}: an entry is of another kind than a netlist has there")]
    WrongKind {
        /// Line, from 1.
        line: usize,
    },
    /// It has no module.
    #[error("it has no module")]
    NoModule,
}

impl JsonFault {
    /// What a reader of JSON found.
    pub(super) fn new(error: &serde_json::Error) -> Self {
        let line = error.line();
        let text = error.to_string();
        let missing = text.strip_prefix("missing field `");
        if error.is_eof() {
            JsonFault::EndsEarly { line }
        } else if let Some((field, _)) = missing.and_then(|rest| rest.split_once('`')) {
            let field = field.to_owned();
            JsonFault::MissingField { line, field }
        } else if error.is_data() {
            JsonFault::WrongKind { line }
        } else {
            JsonFault::Syntax { line }
        }
    }
}

/// Why a cell has no counterpart, and what helps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CellFault {
    /// A latch.
    #[error("a latch, which has no counterpart here; write it as a flip-flop")]
    Latch,
    /// A memory.
    #[error("a memory, which is not mapped to gates; run synth -flatten; memory_map; techmap")]
    Memory,
    /// A gate that Yosys has and this crate lacks.
    #[error("which has no counterpart here; run synth -flatten; abc -g simple")]
    Gate,
    /// A cell that is no gate yet.
    #[error("which is not mapped to gates; run synth -flatten; techmap")]
    NotMapped,
    /// A cell that is neither Yosys's nor the library's.
    #[error(
        "which is no gate or flip-flop of the sensor's library; run synth -flatten, or give the library (liberty) whose cell it is"
    )]
    Unknown,
}

/// What is wrong with a pin, and what helps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PinFault {
    /// Nothing drives its net.
    #[error("is connected to a net that nothing drives; drive it")]
    Undriven,
    /// It has no net.
    #[error("is connected to nothing; connect it")]
    Open,
    /// It has several nets.
    #[error("has several bits; run synth -flatten")]
    Bus,
    /// It needs a constant, and the module has no input to make one of.
    #[error("must be constant, which takes an input of the module; give it one")]
    NoConstant,
}
