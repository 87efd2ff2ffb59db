//! Cells as simulators, linters and synthesis expect them: function without time, and time in `specify` blocks.
//!
//! Path delays and limits are the library's, min:typ:max. They are what
//! [`write_sdf`](crate::sdf::write_sdf) names, so that every entry of such a file finds its path or check.
//! Flip-flops are user-defined primitives (UDP) with the transitions of [`next_state`](crate::netlist::next_state),
//! unknown levels included. A notifier turns the state unknown when setup, hold, recovery or removal is broken; a
//! broken width is reported alone, as by the event kernel.
//!
//! The time unit is the picosecond, as in an exported SDF file: Icarus Verilog (at least to version 12) reads
//! delays in the unit of the cell, whatever TIMESCALE the file has.
//!
//! IEEE 1364 (14.6) makes path delays inertial, as the event kernel's are. Icarus Verilog 11 does so for one pulse, but
//! of three changes within one delay it passes on what the cell shows when the first is due. In one block of a
//! chip, annotated with the library's delays, 1 % of the value changes of nets differ so at 200 asynchronous pulses in 240
//! clock periods, and 8 % at 2000; its outputs (to the femtosecond) and counts were the same in 300 random runs.
//!
//! Cells with transport delays are modules of stages ([`Chain`]), which let short pulses through.
//!
//! Tools without UDPs (Verilator, Yosys) take the macro `FUNCTIONAL` for granted: a flip-flop is a process there. The
//! set of DFFSR is masked by its reset in that process, so that a set still high when the reset goes is seen. Paths
//! have numbers in them because Yosys reads no `specparam` there, and whole ones; it knows neither `$width` nor
//! notifiers.

use std::collections::BTreeSet;
use std::io::{self, Write};

use super::primitive;
use crate::netlist::{CellKind, Chain, Corner, Delay, Edge, InstanceLimits, Library};
use crate::sdf::{CheckKeyword, PinEdge, SdfCheck, checks_of};
use crate::units::Time;

/// What a file of cells begins with.
pub(crate) const HEAD: &str = "\
`timescale 1ps/1fs

// With FUNCTIONAL, flip-flops are processes without notifiers, for tools that have no user-defined primitives.
`ifdef VERILATOR
`define FUNCTIONAL
`endif
`ifdef YOSYS
`define FUNCTIONAL
`endif

// All cells share this file.
/* verilator lint_off DECLFILENAME */

`celldefine
";

/// Transitions of DFFR. A combination that no row names leads to x, as IEEE 1364 has it; rows of levels alone win.
const DFFR_STATE: &str = "
`ifndef FUNCTIONAL
primitive DFFR_STATE(q, d, ck, r, notifier);
  output q;
  reg q;
  input d, ck, r, notifier;
  table
    // d  ck   r   n : q : q+
       ?   ?   1   ? : ? : 0;
       0 (01)  0   ? : ? : 0;
       1 (01)  0   ? : ? : 1;
       0 (01)  x   ? : ? : 0;
       // What may have been a rising edge matters only if it could change q.
       0 (0x)  ?   ? : 0 : 0;
       0 (x1)  ?   ? : 0 : 0;
       1 (0x)  0   ? : 1 : 1;
       1 (x1)  0   ? : 1 : 1;
       ? (?0)  ?   ? : ? : -;
       ? (1x)  ?   ? : ? : -;
       ?   ? (?0)  ? : ? : -;
       ?   ? (?x)  ? : 0 : 0;
       *   ?   ?   ? : ? : -;
       ?   ?   ?   * : ? : x;
  endtable
endprimitive
`endif
";

/// Transitions of DFFSR; the reset wins.
pub(crate) const DFFSR_STATE: &str = "
`ifndef FUNCTIONAL
primitive DFFSR_STATE(q, d, ck, r, s, notifier);
  output q;
  reg q;
  input d, ck, r, s, notifier;
  table
    // d  ck   r   s   n : q : q+
       ?   ?   1   ?   ? : ? : 0;
       ?   ?   0   1   ? : ? : 1;
       0 (01)  0   0   ? : ? : 0;
       1 (01)  0   0   ? : ? : 1;
       0 (01)  x   0   ? : ? : 0;
       1 (01)  0   x   ? : ? : 1;
       // What may have been a rising edge matters only if it could change q.
       0 (0x)  ?   0   ? : 0 : 0;
       0 (x1)  ?   0   ? : 0 : 0;
       1 (0x)  0   ?   ? : 1 : 1;
       1 (x1)  0   ?   ? : 1 : 1;
       ? (?0)  ?   ?   ? : ? : -;
       ? (1x)  ?   ?   ? : ? : -;
       ?   ? (?0)  0   ? : ? : -;
       ?   ? (?x)  0   ? : 0 : 0;
       ?   ?   0 (?0)  ? : ? : -;
       ?   ?   0 (?x)  ? : 1 : 1;
       *   ?   ?   ?   ? : ? : -;
       ?   ?   ?   ?   * : ? : x;
  endtable
endprimitive
`endif
";

const MUX2_BODY: &str = "  assign Z = S ? B : A;\n";

const DFFR_BODY: &str = "\
`ifdef FUNCTIONAL
  reg state;
  always @(posedge CK or posedge R)
    if (R) state <= 1'b0;
    else state <= D;
`else
  wire state;
  reg notifier;
  DFFR_STATE memory(state, D, CK, R, notifier);
`endif
  buf to_q(Q, state);
  not to_qn(QN, state);
";

const DFFSR_BODY: &str = "\
`ifdef FUNCTIONAL
  reg state;
  wire set = S & ~R;
  always @(posedge CK or posedge R or posedge set)
    if (R) state <= 1'b0;
    else if (set) state <= 1'b1;
    else state <= D;
`else
  wire state;
  reg notifier;
  DFFSR_STATE memory(state, D, CK, R, S, notifier);
`endif
  buf to_q(Q, state);
  not to_qn(QN, state);
";

/// Writes the standard model of every cell with the library's delays and limits, and modules of the chains that a netlist has.
///
/// # Errors
/// Those of the writer.
pub fn write_standard_cells(
    out: &mut dyn Write,
    library: &Library,
    chains: &BTreeSet<Chain>,
) -> io::Result<()> {
    out.write_all(HEAD.as_bytes())?;
    for kind in CellKind::ALL {
        write_cell(out, kind, library)?;
    }
    for &chain in chains {
        write_chain(out, chain)?;
    }
    writeln!(out, "\n`endcelldefine")
}

/// A chain, and its stages with the delay that they have on average.
fn write_chain(out: &mut dyn Write, chain: Chain) -> io::Result<()> {
    let stage = chain.stage_module();
    let typical_fs = chain.parts(Delay::kept_fs(chain.typical)).last();
    let typical = Time::from_fs(typical_fs.unwrap_or(0).into());
    let delay = Corner::ALL.map(|corner| Delay::scaled(typical).in_corner_fs(corner));
    writeln!(
        out,
        "\nmodule {stage}(output Z, input A);\n  buf body(Z, A);"
    )?;
    for (reader, line) in [
        (Reader::Synthesis, "`ifdef FUNCTIONAL"),
        (Reader::Simulator, "`else"),
    ] {
        let delay = reader.triple(delay);
        writeln!(
            out,
            "{line}\n  specify\n    (A => Z) = ({delay}, {delay});\n  endspecify"
        )?;
    }
    writeln!(out, "`endif\nendmodule\n")?;
    writeln!(out, "module {}(output Z, input A);", chain.module())?;
    writeln!(out, "  wire [{}:0] node;", chain.stages)?;
    writeln!(
        out,
        "  assign node[0] = A;\n  assign Z = node[{}];",
        chain.stages
    )?;
    for number in 0..chain.stages {
        let name = Chain::stage(number);
        writeln!(
            out,
            "  {stage} {name}(node[{}], node[{number}]);",
            number + 1
        )?;
    }
    writeln!(out, "endmodule")
}

fn write_cell(out: &mut dyn Write, kind: CellKind, library: &Library) -> io::Result<()> {
    let (inputs, outputs) = (kind.inputs().join(", "), kind.outputs().join(", "));
    let gate = || primitive(kind).map(|primitive| format!("  {primitive} body(Z, {inputs});\n"));
    let (state, body) = match kind {
        CellKind::Dffr => (DFFR_STATE, DFFR_BODY.to_owned()),
        CellKind::Dffsr => (DFFSR_STATE, DFFSR_BODY.to_owned()),
        _ => ("", gate().unwrap_or_else(|| MUX2_BODY.to_owned())),
    };
    let name = kind.name();
    write!(
        out,
        "{state}\nmodule {name}(output {outputs}, input {inputs});\n{body}`ifdef FUNCTIONAL\n"
    )?;
    write_specify(out, kind, library, Reader::Synthesis)?;
    writeln!(out, "`else")?;
    write_specify(out, kind, library, Reader::Simulator)?;
    writeln!(out, "`endif\nendmodule")
}

/// Whose numbers and checks they are.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Reader {
    /// Picoseconds with three decimals; every check.
    Simulator,
    /// Whole picoseconds, the only numbers that Yosys takes here; checks that relate two pins.
    Synthesis,
}

impl Reader {
    fn triple<N: Into<i64>>(self, corners: [N; 3]) -> String {
        let numbers = corners.map(|fs| {
            let fs = fs.into();
            match self {
                Reader::Simulator => format!("{}.{:03}", fs / 1000, fs % 1000),
                Reader::Synthesis => ((fs + 500) / 1000).to_string(),
            }
        });
        numbers.join(":")
    }
}

/// Paths and checks of one cell: those that an SDF file names.
fn write_specify(
    out: &mut dyn Write,
    kind: CellKind,
    library: &Library,
    reader: Reader,
) -> io::Result<()> {
    writeln!(out, "  specify")?;
    for (pin, from) in kind.inputs().iter().enumerate() {
        if !kind.triggers(pin) {
            continue;
        }
        for (output, arc) in kind.outputs().iter().zip(library.arcs(kind)[pin]) {
            let [rise, fall] = [arc.rise, arc.fall]
                .map(|delay| reader.triple(Corner::ALL.map(|corner| delay.in_corner_fs(corner))));
            let path = match (*from, *output) {
                ("CK", "Q") => "posedge CK => (Q +: D)".to_owned(),
                // Not `-: D`, which Yosys takes for a part-select where it skips these blocks.
                ("CK", _) => format!("posedge CK => ({output} +: ~D)"),
                _ => format!("{from} => {output}"),
            };
            writeln!(out, "    ({path}) = ({rise}, {fall});")?;
        }
    }
    if kind.is_flip_flop() {
        let limits =
            Corner::ALL.map(|corner| InstanceLimits::from_library(library.checks(kind), corner));
        for check in checks_of(kind, limits.each_ref()) {
            if check.kind != CheckKeyword::Width || reader == Reader::Simulator {
                writeln!(out, "    {};", system_task(&check, reader))?;
            }
        }
    }
    writeln!(out, "  endspecify")
}

/// One check. SDF names the data first; in Verilog they come first where a control is released, and second for D.
fn system_task(check: &SdfCheck<'_>, reader: Reader) -> String {
    let [first, second] = check.limits.map(|limit| {
        let corners = Corner::ALL.map(|corner| limit.in_corner(corner).map_or(0, Time::as_fs));
        reader.triple(corners)
    });
    let data = event(&check.pin);
    let clock = check.reference.as_ref().map(event).unwrap_or_default();
    let notifier = match reader {
        Reader::Simulator => ", notifier",
        Reader::Synthesis => "",
    };
    match check.kind {
        CheckKeyword::Width => format!("$width({data}, {first})"),
        CheckKeyword::RecRem => format!("$recrem({data}, {clock}, {first}, {second}{notifier})"),
        CheckKeyword::SetupHold => {
            format!("$setuphold({clock}, {data}, {first}, {second}{notifier})")
        }
        _ => unreachable!("limits that come in pairs are given so"),
    }
}

fn event(pin: &PinEdge<'_>) -> String {
    let edge = match pin.edge {
        None => "",
        Some(Edge::Rise) => "posedge ",
        Some(Edge::Fall) => "negedge ",
    };
    format!("{edge}{}", pin.pin)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Yosys knows no check of one pin.
    #[test]
    fn a_simulator_alone_is_told_widths() {
        let checks = |reader| {
            let mut text = Vec::new();
            write_specify(&mut text, CellKind::Dffr, &Library::generic_40nm(), reader).unwrap();
            let text = String::from_utf8(text).unwrap();
            ["$width", "$setuphold", "$recrem"].map(|check| text.matches(check).count())
        };
        assert_eq!(checks(Reader::Simulator), [3, 2, 1]);
        assert_eq!(checks(Reader::Synthesis), [0, 2, 1]);
    }
}
