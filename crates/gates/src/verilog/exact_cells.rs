//! Cells that agree with the event kernel edge for edge, for differential tests in Icarus Verilog.
//!
//! A cell's output passes through a continuous assignment with delays: inertial by IEEE 1364, which
//! is the delay model of the event kernel, so both see the same glitches. A gate whose inputs all
//! have the same delay is a Verilog primitive before it. A cell with different arcs (multiplexer,
//! flip-flops) is a procedural model with variable delays for each output: the delay is that of the input that
//! changed and, when several change in one instant, the shortest.
//!
//! What happens within one instant is left to the simulator by IEEE 1364, except for one thing:
//! `#0` waits until no other event of the instant is left. Every cell waits so, from time 0 on,
//! before it looks at its inputs, and only then schedules its output. It therefore never sees half
//! of the changes of an instant, such as a bus of which one bit was passed on earlier than
//! another, and an output due in this very instant has come before a new value could cancel it.
//! That is the order of the event kernel, too. A testbench needs no precautions, as long as it
//! drives pins in the active region (by `=`, not after a `#0` of its own or by `<=`).
//!
//! Where instances have delays of their own, every cell is a procedural model with delays that are parameters
//! ([`write_parametric_cells`]), and `defparam`s set those that differ ([`write_delays`]); one more parameter
//! makes them transport delays. Verilog has none of its own that keep to the active region and let a change
//! cancel those it overtakes: a module with a queue of changes does that.

use std::collections::BTreeSet;
use std::io::{self, Write};

use super::{TIMESCALE, primitive};
use crate::logic::Logic;
use crate::netlist::{
    CellArcs, CellKind, Chain, Corner, DelayModel, Library, Netlist, ScopeId, Timing,
};

/// Lets every change of `value` arrive after its delay. One that overtakes others cancels them. The queue's last place
/// has a variable, as an index that is a difference need not wrap at 8 bits.
const TRANSPORT_PATH: &str = "
module TRANSPORT_PATH(output reg out, input value, input [31:0] rise, input [31:0] fall);
  reg [63:0] due [0:255];
  reg to [0:255];
  reg [7:0] head, tail, newest;
  reg [63:0] at;
  reg last;
  initial begin
    head = 0;
    tail = 0;
    forever begin : deliver
      if (head == tail) @(tail);
      else if (due[head] > $time) #(due[head] - $time);
      else begin
        out = to[head];
        head = head + 8'd1;
      end
    end
  end
  always @(value) begin
    at = $time + (value === 1'b1 ? rise : value === 1'b0 ? fall : rise < fall ? rise : fall);
    newest = tail - 8'd1;
    while (head != tail && due[newest] >= at) begin
      tail = newest;
      newest = tail - 8'd1;
    end
    last = out;
    if (head != tail) last = to[newest];
    if (value !== last) begin
      due[tail] = at;
      to[tail] = value;
      tail = tail + 8'd1;
      if (head == tail) begin
        $display(\"%m: more than 255 changes on their way\");
        $finish;
      end
    end
    disable deliver;
  end
endmodule
";

/// Writes the model of every cell with the delays of one corner.
///
/// # Errors
/// Those of the writer.
pub fn write_cells(out: &mut dyn Write, library: &Library, corner: Corner) -> io::Result<()> {
    write!(out, "{TIMESCALE}")?;
    for kind in CellKind::ALL {
        writeln!(out)?;
        write_cell(out, kind, library.arcs(kind), corner)?;
    }
    Ok(())
}

/// As [`write_cells`], with parameters `RISE_<input>_<output>` and `FALL_<input>_<output>` (fs) for the delays of every arc, and
/// `TRANSPORT`, 1 for transport delays; and the chains that a netlist has, as one such cell each.
///
/// # Errors
/// Those of the writer.
pub fn write_parametric_cells(
    out: &mut dyn Write,
    library: &Library,
    chains: &BTreeSet<Chain>,
    corner: Corner,
) -> io::Result<()> {
    write!(out, "{TIMESCALE}{TRANSPORT_PATH}")?;
    let cells = CellKind::ALL.map(|kind| (kind.name().to_owned(), kind));
    let chains = chains.iter().map(|chain| (chain.module(), CellKind::Buf));
    for (name, kind) in cells.into_iter().chain(chains) {
        let (inputs, outputs) = (kind.inputs().join(", "), kind.outputs().join(", "));
        writeln!(out, "\nmodule {name}(output {outputs}, input {inputs});")?;
        for (pin, output, name) in arc_names(kind) {
            let arc = library.arcs(kind)[pin][output];
            let (rise, fall) = (arc.rise.in_corner_fs(corner), arc.fall.in_corner_fs(corner));
            writeln!(out, "  parameter [31:0] RISE_{name} = {rise};")?;
            writeln!(out, "  parameter [31:0] FALL_{name} = {fall};")?;
        }
        write_arc_selecting_cell(out, kind, |pin, output| {
            let name = arc_name(kind, pin, output);
            (format!("RISE_{name}"), format!("FALL_{name}"))
        })?;
        writeln!(out, "  parameter TRANSPORT = 0;")?;
        writeln!(out, "  generate if (TRANSPORT) begin : transport")?;
        for (output, value) in outputs_of(kind) {
            writeln!(
                out,
                "    TRANSPORT_PATH to_{output}({output}, {value}, rise_{output}, fall_{output});"
            )?;
        }
        writeln!(out, "  end else begin : inertial")?;
        for (output, value) in outputs_of(kind) {
            writeln!(
                out,
                "    assign #(rise_{output}, fall_{output}) {output} = {value};"
            )?;
        }
        writeln!(out, "  end endgenerate")?;
        writeln!(out, "endmodule")?;
    }
    Ok(())
}

/// Writes a `defparam` for every delay of `timing` that differs from `library`, the delays that the cells were
/// written with, and for every cell with transport delays; `instance` is the name that the top has where the file is included.
///
/// # Errors
/// Those of the writer.
pub fn write_delays(
    out: &mut dyn Write,
    instance: &str,
    netlist: &Netlist,
    timing: &Timing,
    library: &Timing,
) -> io::Result<()> {
    let top = netlist.scopes()[0].name.len();
    for (index, scope) in netlist.scopes().iter().enumerate() {
        let id = ScopeId::new(index);
        let path = format!("{instance}{}", &netlist.scope_path(id)[top..]);
        for (cell, leaf) in netlist.cells_of(id).zip(scope.module.cells()) {
            if timing.model(cell) == DelayModel::Transport {
                writeln!(out, "  defparam {path}.{}.TRANSPORT = 1;", leaf.name)?;
            }
            for (pin, output, name) in arc_names(leaf.kind) {
                let [arc, nominal] = [timing, library].map(|t| t.cell_delays(cell)[pin][output]);
                let values = [
                    ("RISE", arc.rise_fs, nominal.rise_fs),
                    ("FALL", arc.fall_fs, nominal.fall_fs),
                ];
                for (direction, fs, nominal) in values {
                    if fs != nominal {
                        let cell = &leaf.name;
                        writeln!(out, "  defparam {path}.{cell}.{direction}_{name} = {fs};")?;
                    }
                }
            }
        }
    }
    Ok(())
}

fn write_cell(
    out: &mut dyn Write,
    kind: CellKind,
    arcs: &CellArcs,
    corner: Corner,
) -> io::Result<()> {
    let (inputs, outputs) = (kind.inputs().join(", "), kind.outputs().join(", "));
    writeln!(
        out,
        "module {}(output {outputs}, input {inputs});",
        kind.name()
    )?;
    let delays = |pin: usize, output: usize| {
        let arc = arcs[pin][output];
        (
            arc.delay(corner, Logic::One).as_fs(),
            arc.delay(corner, Logic::Zero).as_fs(),
        )
    };
    let uniform = (1..kind.inputs().len()).all(|pin| delays(pin, 0) == delays(0, 0));
    if let (Some(primitive), true) = (primitive(kind), uniform) {
        let (rise, fall) = delays(0, 0);
        writeln!(out, "  wire now;")?;
        writeln!(out, "  reg value;")?;
        writeln!(out, "  {primitive} g(now, {inputs});")?;
        writeln!(out, "  always begin")?;
        writeln!(out, "    #0;")?;
        writeln!(out, "    value = now;")?;
        writeln!(out, "    @(now);")?;
        writeln!(out, "  end")?;
        writeln!(out, "  assign #({rise}, {fall}) Z = value;")?;
    } else {
        write_arc_selecting_cell(out, kind, delays)?;
        for (output, value) in outputs_of(kind) {
            writeln!(
                out,
                "  assign #(rise_{output}, fall_{output}) {output} = {value};"
            )?;
        }
    }
    writeln!(out, "endmodule")
}

/// The body of a cell that picks its delays, all but the assignment of its outputs.
fn write_arc_selecting_cell<D: std::fmt::Display>(
    out: &mut dyn Write,
    kind: CellKind,
    delays: impl Fn(usize, usize) -> (D, D),
) -> io::Result<()> {
    let pins = kind.inputs();
    let triggers: Vec<usize> = (0..pins.len()).filter(|&p| kind.triggers(p)).collect();
    let events: Vec<&str> = triggers.iter().map(|&p| pins[p]).collect();
    for &pin in &triggers {
        writeln!(out, "  reg was_{};", pins[pin])?;
    }
    writeln!(out, "  reg value, next;")?;
    for output in kind.outputs() {
        writeln!(out, "  reg [31:0] rise_{output}, fall_{output};")?;
    }
    writeln!(out, "  always begin")?;
    writeln!(out, "    #0;")?;
    for output in kind.outputs() {
        writeln!(out, "    rise_{output} = 32'hffffffff;")?;
        writeln!(out, "    fall_{output} = 32'hffffffff;")?;
    }
    for &pin in &triggers {
        let name = pins[pin];
        // A clock going low causes nothing.
        let unless_falling = if name == "CK" { " && CK !== 1'b0" } else { "" };
        writeln!(out, "    if ({name} !== was_{name}{unless_falling}) begin")?;
        for (number, output) in kind.outputs().iter().enumerate() {
            let (rise, fall) = delays(pin, number);
            for (delay, fs) in [("rise", rise), ("fall", fall)] {
                writeln!(
                    out,
                    "      if ({delay}_{output} > {fs}) {delay}_{output} = {fs};"
                )?;
            }
        }
        writeln!(out, "    end")?;
    }
    if kind.is_flip_flop() {
        writeln!(out, "    next = value;")?;
        writeln!(
            out,
            "    if (was_CK === 1'b0 && CK === 1'b1) next = D | 1'b0;"
        )?;
        writeln!(
            out,
            "    else if ((was_CK === 1'b0 && CK !== 1'b0) || (was_CK !== 1'b0 && was_CK !== 1'b1 && CK === 1'b1))"
        )?;
        writeln!(out, "      if (next !== D) next = 1'bx;")?;
        if kind == CellKind::Dffsr {
            writeln!(out, "    if (S === 1'b1) next = 1'b1;")?;
            writeln!(
                out,
                "    else if (S !== 1'b0 && next !== 1'b1) next = 1'bx;"
            )?;
        }
        writeln!(out, "    if (R === 1'b1) next = 1'b0;")?;
        writeln!(
            out,
            "    else if (R !== 1'b0 && next !== 1'b0) next = 1'bx;"
        )?;
    } else {
        let expression = match kind {
            CellKind::Mux2 => "(S ? B : A) | 1'b0".to_owned(),
            CellKind::Inv => "~A".to_owned(),
            CellKind::Buf => "A | 1'b0".to_owned(),
            CellKind::Nand2 => "~(A & B)".to_owned(),
            CellKind::Nor2 => "~(A | B)".to_owned(),
            CellKind::And2 => "A & B".to_owned(),
            CellKind::Or2 => "A | B".to_owned(),
            CellKind::Xor2 => "A ^ B".to_owned(),
            CellKind::Xnor2 => "~(A ^ B)".to_owned(),
            CellKind::Dffr | CellKind::Dffsr => unreachable!("handled above"),
        };
        writeln!(out, "    next = {expression};")?;
    }
    for &pin in &triggers {
        writeln!(out, "    was_{0} = {0};", pins[pin])?;
    }
    writeln!(out, "    value = next;")?;
    writeln!(out, "    @({});", events.join(" or "))?;
    writeln!(out, "  end")?;
    Ok(())
}

/// Every arc of a cell: numbers of its input and output pin, and its name.
fn arc_names(kind: CellKind) -> impl Iterator<Item = (usize, usize, String)> {
    let triggers = (0..kind.inputs().len()).filter(move |&pin| kind.triggers(pin));
    triggers.flat_map(move |pin| {
        let outputs = 0..kind.outputs().len();
        outputs.map(move |output| (pin, output, arc_name(kind, pin, output)))
    })
}

fn arc_name(kind: CellKind, pin: usize, output: usize) -> String {
    format!("{}_{}", kind.inputs()[pin], kind.outputs()[output])
}

/// Output pins of a cell, and what each shows of the `value` that [`write_arc_selecting_cell`] computes.
fn outputs_of(kind: CellKind) -> impl Iterator<Item = (&'static str, &'static str)> {
    let pins = kind.outputs().iter().copied();
    pins.zip(["value", "~value"])
}
