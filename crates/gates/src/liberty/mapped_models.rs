//! Behavioural Verilog of the library cells in a mapped netlist, for simulators: the delays come from the SDF file beside it.
//!
//! A gate is a user-defined primitive of its truth table, whose output is unknown where unknown inputs leave it open. Flip-flops have
//! the state of the standard cells (`verilog/standard_cells`), with inverters at pins that are active low; where a library does not say
//! which of clear and preset wins, it is the clear. A path without a delay from a file takes 1 ps. Limits are not checked.
//!
//! Tools without user-defined primitives (Verilator, Yosys) take the macro `FUNCTIONAL` for granted, as in the standard cells: a gate
//! is its truth table there, and a flip-flop a process. Without delays the chip makes no reset pulse, so this serves linting, synthesis and
//! proofs, not simulation.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};

use super::candidate::{FlipFlop, Role};
use super::cell::CellModel;
use super::characterised::CharacterisedNetlist;
use super::function::TruthTable;
use super::read::Liberty;
use super::verilog_name::in_verilog;
use crate::netlist::{Netlist, ScopeId};
use crate::verilog::{DFFSR_STATE, HEAD};

/// Writes a module for every library cell and drive in the netlist of [`write_mapped`](super::write_mapped).
///
/// # Errors
/// Those of the writer.
pub fn write_mapped_cells(
    out: &mut dyn Write,
    netlist: &Netlist,
    library: &Liberty,
    characterised: &CharacterisedNetlist,
) -> io::Result<()> {
    let mut models = BTreeMap::new();
    for cell in netlist.cells_below(ScopeId::TOP) {
        let (composite, _) = characterised.instance(netlist, &library.map, cell);
        for stage in composite.used() {
            let model = composite.cell(stage);
            models.insert(model.name.as_str(), model);
        }
    }
    writeln!(out, "{HEAD}{DFFSR_STATE}")?;
    for (name, model) in models {
        let primitive = in_verilog(&format!("{name}_FUNCTION"));
        if let Role::Gate(function) = model.role {
            write_primitive(out, &primitive, function)?;
        }
        let inputs: Vec<String> = model
            .inputs
            .iter()
            .map(|pin| in_verilog(&pin.name))
            .collect();
        let output_names = model.outputs.iter().map(|pin| in_verilog(&pin.name));
        let output_names: Vec<String> = output_names.collect();
        let (name, outputs) = (in_verilog(name), output_names.join(", "));
        writeln!(
            out,
            "module {name}(output {outputs}, input {});",
            inputs.join(", ")
        )?;
        match &model.role {
            Role::Gate(function) => {
                let rows = 1 << function.inputs;
                let packed: Vec<&str> = inputs.iter().rev().map(String::as_str).collect();
                writeln!(
                    out,
                    "`ifdef FUNCTIONAL\n  wire [{}:0] inner_rows = {rows}'h{:x};\n  assign {outputs} = inner_rows[{{{}}}];\n`else\n  {primitive} inner_body({outputs}, {});\n`endif",
                    rows - 1,
                    function.bits,
                    packed.join(", "),
                    inputs.join(", ")
                )?;
            }
            Role::FlipFlop(roles) => write_flip_flop(out, model, roles)?,
        }
        writeln!(out, "  specify")?;
        let paths: BTreeSet<_> = model.arcs.iter().map(|arc| (arc.from, arc.to)).collect();
        for (from, to) in paths {
            writeln!(
                out,
                "    ({} => {}) = (1, 1);",
                inputs[from], output_names[to]
            )?;
        }
        writeln!(out, "  endspecify\nendmodule\n")?;
    }
    writeln!(out, "`endcelldefine")
}

/// Rows for all levels of the inputs that leave one value.
fn write_primitive(out: &mut dyn Write, name: &str, function: TruthTable) -> io::Result<()> {
    let pins: Vec<String> = (0..function.inputs).map(|pin| format!("a{pin}")).collect();
    let pins = pins.join(", ");
    writeln!(
        out,
        "`ifndef FUNCTIONAL\nprimitive {name}(y, {pins});\n  output y;\n  input {pins};\n  table"
    )?;
    for row in 0..3_u32.pow(function.inputs) {
        let level = |pin: u32| row / 3_u32.pow(pin) % 3;
        let fits = |packed: &u32| {
            (0..function.inputs).all(|pin| level(pin) == 2 || level(pin) == packed >> pin & 1)
        };
        let values: BTreeSet<bool> = (0..1 << function.inputs)
            .filter(fits)
            .map(|packed| function.value(packed))
            .collect();
        if let (1, Some(&value)) = (values.len(), values.first()) {
            let levels = (0..function.inputs).map(|pin| ["0 ", "1 ", "x "][level(pin) as usize]);
            writeln!(
                out,
                "    {}: {};",
                levels.collect::<String>(),
                u8::from(value)
            )?;
        }
    }
    writeln!(out, "  endtable\nendprimitive\n`endif\n")
}

/// Pins that are tied in the netlist do nothing here. The primitive's reset wins: where the preset does, the state is kept inverted. Names
/// of inner nets are none of a library's pins.
fn write_flip_flop(out: &mut dyn Write, model: &CellModel, roles: &FlipFlop) -> io::Result<()> {
    let inverts = |inverted: bool| if inverted { "not" } else { "buf" };
    let preset_wins = roles.with_outputs_that_agree().preset_wins() == Some(true);
    let (strong, weak) = if preset_wins {
        (roles.preset, roles.clear)
    } else {
        (roles.clear, roles.preset)
    };
    let data = (roles.data.0, roles.data.1 != preset_wins);
    let pins = [
        ("d", Some(data)),
        ("ck", Some(roles.clock)),
        ("r", strong),
        ("s", weak),
    ];
    let given = pins.iter().filter(|(_, pin)| pin.is_some());
    let wires: Vec<String> = given.map(|(wire, _)| format!("inner_{wire}")).collect();
    writeln!(out, "  wire {};", wires.join(", "))?;
    for (wire, pin) in pins {
        if let Some((pin, inverted)) = pin {
            writeln!(
                out,
                "  {} inner_at_{wire}(inner_{wire}, {});",
                inverts(inverted),
                in_verilog(&model.inputs[pin].name)
            )?;
        }
    }
    let tied = (0..model.inputs.len()).filter(|pin| roles.tied >> pin & 1 == 1);
    let tied: Vec<String> = tied
        .map(|pin| in_verilog(&model.inputs[pin].name))
        .collect();
    if !tied.is_empty() {
        // Lint asks what reads them, but for a wire of this name.
        writeln!(out, "  wire inner_unused = &{{1'b0, {}}};", tied.join(", "))?;
    }
    writeln!(out, "`ifdef FUNCTIONAL\n  reg inner_state;")?;
    let mut edges = String::from("posedge inner_ck");
    let mut next = String::from("inner_state <= inner_d;");
    if weak.is_some() {
        // One that is still active when the other ends is seen then.
        let set = if strong.is_some() {
            "inner_s & ~inner_r"
        } else {
            "inner_s"
        };
        writeln!(out, "  wire inner_set = {set};")?;
        edges += " or posedge inner_set";
        next = format!("if (inner_set) inner_state <= 1'b1;\n    else {next}");
    }
    if strong.is_some() {
        edges += " or posedge inner_r";
        next = format!("if (inner_r) inner_state <= 1'b0;\n    else {next}");
    }
    let level = |pin: Option<_>, wire| if pin.is_some() { wire } else { "1'b0" };
    let (reset, set) = (level(strong, "inner_r"), level(weak, "inner_s"));
    writeln!(
        out,
        "  always @({edges})\n    {next}\n`else\n  wire inner_state;\n  reg inner_notifier;\n  DFFSR_STATE inner_memory(inner_state, inner_d, inner_ck, {reset}, {set}, inner_notifier);\n`endif"
    )?;
    for (index, output) in model.outputs.iter().enumerate() {
        let inverted = (roles.q != Some(index)) != preset_wins;
        let output = in_verilog(&output.name);
        writeln!(
            out,
            "  {} inner_to_{index}({output}, inner_state);",
            inverts(inverted)
        )?;
    }
    Ok(())
}
