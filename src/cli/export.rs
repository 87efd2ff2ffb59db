//! `gdtof export`: the chip for other tools.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::replay::StimulusArgs;
use crate::engine::{StimulusPlan, export_verilog};

/// What to export.
#[derive(Subcommand)]
pub enum ExportCommand {
    /// Structural Verilog with cell models, delays, and a testbench that replays the same stimulus.
    Verilog(VerilogArgs),
}

/// Arguments of `gdtof export verilog`.
#[derive(Args)]
pub struct VerilogArgs {
    #[command(flatten)]
    stimuli: StimulusArgs,
    /// Folder for cells.v, design.v, stimulus.txt and tb.v; it is made if need be.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// Bad input and unwritable output.
pub fn run(command: &ExportCommand) -> anyhow::Result<()> {
    let ExportCommand::Verilog(args) = command;
    let stimuli = args.stimuli.read()?;
    let plan = StimulusPlan::new(
        &stimuli.config,
        &stimuli.exposure,
        stimuli.config.cols,
        &stimuli.starts,
        &stimuli.pulses(),
    );
    export_verilog(&args.out, &stimuli.config, &plan)?;
    println!(
        "cd {} && iverilog -g2005 -o sim tb.v design.v cells.v && vvp sim",
        args.out.display()
    );
    Ok(())
}
