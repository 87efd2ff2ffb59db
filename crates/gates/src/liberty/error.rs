//! What can be wrong with a Liberty file, and what keeps one of its cells from being used.

use std::fmt;

use super::syntax_fault::LibertySyntaxFault;
use super::table_fault::LibertyTableFault;
use crate::netlist::{CellKind, Edge};

/// A fault of a Liberty file, with its line.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{fault}")]
#[non_exhaustive]
pub struct LibertyError {
    /// Line, from 1.
    pub line: usize,
    /// What is wrong, and what to do.
    pub fault: LibertyFault,
}

impl LibertyError {
    pub(super) fn new(line: usize, fault: impl Into<LibertyFault>) -> Self {
        let fault = fault.into();
        LibertyError { line, fault }
    }
}

/// A fault of one of several Liberty files.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{error}")]
#[non_exhaustive]
pub struct KitError {
    /// Which file, from 0.
    pub file: usize,
    /// What is wrong with it, and where.
    pub error: LibertyError,
}

/// What is wrong with a Liberty file: with its syntax, its units, its tables, one of its cells, or the library as a whole.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LibertyFault {
    /// Its syntax, or a value that is no number or word that belongs there.
    #[error(transparent)]
    Syntax(#[from] LibertySyntaxFault),
    /// Its units or its tables.
    #[error(transparent)]
    Table(#[from] LibertyTableFault),
    /// A cell whose area is negative.
    #[error("its area is {area}")]
    NegativeArea {
        /// The area, in the file's unit.
        area: f64,
    },
    /// A name of a cell or pin that Verilog cannot have.
    #[error("Verilog can have no name like {name:?}")]
    NoVerilogName {
        /// The name.
        name: String,
    },
    /// A pin without capacitance.
    #[error("its pin {pin} has no capacitance")]
    NoCapacitance {
        /// Name of the pin.
        pin: String,
    },
    /// A pin with a negative capacitance.
    #[error("the capacitance of its pin {pin} is {capacitance}")]
    NegativeCapacitance {
        /// Name of the pin.
        pin: String,
        /// Its capacitance, in the file's unit.
        capacitance: f64,
    },
    /// An edge of an output that a cell makes and has no delay for.
    #[error(
        "it has no delay and slew from the {} of {from} to the {} of {to}",
        word(*.cause),
        word(*.effect)
    )]
    NoDelay {
        /// Name of the input.
        from: String,
        /// Its edge.
        cause: Edge,
        /// Name of the output.
        to: String,
        /// Its edge.
        effect: Edge,
    },
    /// A group of leakage without a value.
    #[error("this leakage_power has no value")]
    NoLeakageValue,
    /// A delay model without tables.
    #[error("its delay_model is {model}; give a library with table_lookup")]
    DelayModel {
        /// The model.
        model: String,
    },
    /// Files of two corners.
    #[error(
        "its {attribute} is {own} {unit}, and that of {first} is {of_first}; give files of one corner"
    )]
    OtherCorner {
        /// Attribute that differs.
        attribute: &'static str,
        /// What it is in or of.
        unit: &'static str,
        /// Its value in this file.
        own: f64,
        /// Name of the first file's library.
        first: String,
        /// Its value in the first file.
        of_first: f64,
    },
    /// A cell that is in two files.
    #[error("the cell {cell} is in {other} as well; leave one of both files out")]
    CellTwice {
        /// Name of the cell.
        cell: String,
        /// The other file, or the name of its library.
        other: String,
    },
    /// A wanted cell that is not there, or that does something else.
    #[error(
        "the library {library} has no cell {cell} that does what {} does{}{}",
        .kind.name(),
        .alike.as_ref().map_or(String::new(), |alike| format!("; did you mean `{alike}`?")),
        listed(.passed_over)
    )]
    NoSuchCell {
        /// Name of the library.
        library: String,
        /// Name of the cell.
        cell: String,
        /// What it is to stand for.
        kind: CellKind,
        /// The cell whose name is most like it.
        alike: Option<String>,
        /// Cells that may be meant and are not used.
        passed_over: Vec<PassedOver>,
    },
    /// A library without cells for a kind.
    #[error(
        "the library {library} has nothing to make a {} from; {} would be enough (if the kit has more files, give all of them){}{}",
        .kind.name(),
        enough(*.kind),
        .incomplete.iter().map(|cell| format!("; {cell}")).collect::<String>(),
        listed(.passed_over)
    )]
    NothingToMake {
        /// Name of the library.
        library: String,
        /// The kind.
        kind: CellKind,
        /// Cells of any function that lack something.
        incomplete: Vec<PassedOver>,
        /// Cells that might have been of this kind and are not used.
        passed_over: Vec<PassedOver>,
    },
}

fn word(edge: Edge) -> &'static str {
    match edge {
        Edge::Rise => "rise",
        Edge::Fall => "fall",
    }
}

/// What a library needs for a kind, beside an inverter.
fn enough(kind: CellKind) -> &'static str {
    use CellKind::*;
    match kind {
        Inv => "an inverter",
        Buf => "a buffer or an inverter",
        Nand2 | Nor2 | And2 | Or2 => "a NAND, NOR, AND or OR of two inputs",
        Xor2 | Xnor2 => "an exclusive OR or NOR, a NAND or a NOR of two inputs",
        Mux2 => "a 2:1 multiplexer (inverting or not), or a NAND or a NOR of two inputs",
        Dffr => "a flip-flop with an asynchronous clear or preset (with a scan chain or not)",
        Dffsr => "a flip-flop with an asynchronous clear and preset (with a scan chain or not)",
    }
}

/// Cells that a message names.
const NAMED: usize = 3;

/// The first cells of a list, and how many more there are.
fn listed(cells: &[PassedOver]) -> String {
    let (named, others) = cells.split_at(cells.len().min(NAMED));
    let mut text: String = named.iter().map(|cell| format!("; {cell}")).collect();
    if !others.is_empty() {
        text += &format!("; and so are {} more", others.len());
    }
    text
}

/// A cell that is not used.
#[derive(Debug, Clone, PartialEq)]
pub struct PassedOver {
    /// Its name.
    pub cell: String,
    /// Name of the file that it is in; empty where there is only text.
    pub file: String,
    /// Line it begins in, from 1.
    pub line: usize,
    /// What keeps it from being used.
    pub why: PassedOverReason,
    pub(super) is_flip_flop: bool,
}

impl fmt::Display for PassedOver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let line = match &self.why {
            PassedOverReason::Faulty(error) => error.line,
            _ => self.line,
        };
        let (place, PassedOver { cell, why, .. }) = (place(&self.file, line), self);
        write!(f, "{place}: {cell} is not used: {why}")
    }
}

/// A line of a file as messages have it.
pub(super) fn place(file: &str, line: usize) -> String {
    if file.is_empty() {
        format!("line {line}")
    } else {
        format!("{file}:{line}")
    }
}

/// What keeps a cell from being used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PassedOverReason {
    /// The library says not to use it.
    #[error("it is marked dont_use")]
    DontUse,
    /// An earlier cell of the file has its name.
    #[error("line {line} has a cell of this name, which counts")]
    Duplicate {
        /// Line of the other.
        line: usize,
    },
    /// A latch, a bus or another group that no kind of cell here has.
    #[error("it has a {group}")]
    UnusableGroup {
        /// Kind of the group.
        group: String,
    },
    /// More than one flip-flop.
    #[error("it has several flip-flops")]
    SeveralFlipFlops,
    /// A pin without a name.
    #[error("a pin has no name")]
    UnnamedPin,
    /// Two pins of one name.
    #[error("pin {pin} is given twice")]
    PinTwice {
        /// Name of the pins.
        pin: String,
    },
    /// A pin that may drive nothing.
    #[error("pin {pin} is a three-state output")]
    ThreeState {
        /// Name of the pin.
        pin: String,
    },
    /// A pin that is neither an input nor an output.
    #[error("pin {pin} has the direction {direction}")]
    Direction {
        /// Name of the pin.
        pin: String,
        /// Its direction.
        direction: String,
    },
    /// A pin without a direction.
    #[error("pin {pin} has no direction")]
    NoDirection {
        /// Name of the pin.
        pin: String,
    },
    /// No output.
    #[error("it has no output")]
    NoOutput,
    /// Several outputs, and no flip-flop.
    #[error("it has {outputs} outputs and no flip-flop")]
    SeveralOutputs {
        /// How many outputs.
        outputs: usize,
    },
    /// No input, or more than gates have.
    #[error("it has {inputs} inputs; gates have 1 to {most}")]
    InputCount {
        /// How many inputs.
        inputs: usize,
        /// Most inputs of a gate.
        most: usize,
    },
    /// An output without a function.
    #[error("output {output} has no function")]
    NoFunction {
        /// Name of the output.
        output: String,
    },
    /// An output with a function of something else than inputs.
    #[error("the function {function:?} of {output} is none of its inputs")]
    OtherFunction {
        /// Name of the output.
        output: String,
        /// Its function.
        function: String,
    },
    /// A flip-flop with more pins than are known here.
    #[error("it is a flip-flop of {inputs} inputs and {outputs} outputs")]
    FlipFlopPins {
        /// How many inputs.
        inputs: usize,
        /// How many outputs.
        outputs: usize,
    },
    /// A clock, a clear or a preset of several pins.
    #[error("its {attribute} is {function:?} and not one pin")]
    ControlFunction {
        /// Attribute of the flip-flop.
        attribute: &'static str,
        /// Its value.
        function: String,
    },
    /// A flip-flop without a clock or a next state.
    #[error("its flip-flop has no {attribute}")]
    NoAttribute {
        /// Attribute that it lacks.
        attribute: &'static str,
    },
    /// A flip-flop whose state no output shows.
    #[error("no output shows its state")]
    HiddenState,
    /// A next state that is no pin, to whatever level the others are tied.
    #[error("its next_state is {function:?} and not one pin, whatever the others are tied to")]
    NextState {
        /// The next state.
        function: String,
    },
    /// Another function than those of the gates and flip-flops here.
    #[error("it is none of the gates and flip-flops that are used")]
    OtherKind,
    /// It lacks something that cells must state, or has something that is wrong.
    #[error(transparent)]
    Faulty(Box<LibertyError>),
}
