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
    NoNetlist(String),
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
        why: &'static str,
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
        problem: &'static str,
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

/// What a reader of JSON says, without Rust's words.
pub(super) fn in_words(error: &serde_json::Error) -> String {
    let said = error.to_string();
    let missing = said.strip_prefix("missing field `");
    let what = if error.is_eof() {
        "the text ends early".to_owned()
    } else if let Some((name, _)) = missing.and_then(|rest| rest.split_once('`')) {
        format!("`{name}` is missing")
    } else if error.is_data() {
        "an entry is of another kind than a netlist has there".to_owned()
    } else {
        "it is no JSON".to_owned()
    };
    format!("line {}: {what}", error.line())
}
