//! `gdtof export`: the chip for other tools.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::replay::StimulusArgs;
use super::{say, sdf};
use crate::chip::sensor;
use crate::engine::{StimulusPlan, export_annotated_verilog, export_verilog};
use crate::netlist::Netlist;

/// What to export.
#[derive(Subcommand)]
pub enum ExportCommand {
    /// Structural Verilog with cell models, delays, and a testbench that replays the same stimulus.
    Verilog(VerilogArgs),
    /// The delay of every cell, min:typ:max, as SDF (IEEE 1497).
    Sdf(sdf::SdfArgs),
}

/// Arguments of `gdtof export verilog`.
#[derive(Args)]
pub struct VerilogArgs {
    #[command(flatten)]
    stimuli: StimulusArgs,
    /// Folder for cells.v, design.v, stimulus.txt and tb.v; it is made if need be.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Delays that replace the library's (SDF); they go into delays.v.
    #[arg(long, value_name = "FILE")]
    sdf: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// Bad input and unwritable output.
pub fn run(command: &ExportCommand) -> anyhow::Result<()> {
    match command {
        ExportCommand::Verilog(args) => run_verilog(args),
        ExportCommand::Sdf(args) => sdf::run(args),
    }
}

fn run_verilog(args: &VerilogArgs) -> anyhow::Result<()> {
    let stimuli = args.stimuli.read()?;
    let plan = StimulusPlan::new(
        &stimuli.config,
        &stimuli.exposure,
        stimuli.config.cols,
        &stimuli.starts,
        &stimuli.pulses(),
    );
    match &args.sdf {
        None => export_verilog(&args.out, &stimuli.config, &plan)?,
        Some(path) => {
            let netlist = Netlist::elaborate(&sensor::circuit(&stimuli.config));
            let timing = sdf::annotated_timing(path, &netlist, &stimuli.config)?;
            export_annotated_verilog(&args.out, &stimuli.config, &plan, &timing)?;
        }
    }
    say(format_args!(
        "cd {} && iverilog -g2005 -o sim tb.v design.v cells.v && vvp sim\n",
        args.out.display()
    ))?;
    Ok(())
}
