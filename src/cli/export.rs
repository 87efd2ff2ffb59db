//! `gdtof export`: the chip, and frames, for other tools.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::replay::Stimuli;
use super::voice::{notes, say_unless_quiet};
use super::{SensorArgs, export_frame, mapped, sdf};
use crate::chip::{SensorConfig, array};
use crate::files::{InputError, ResultSet};
use crate::netlist::Netlist;
use crate::stimulus::{Export, StimulusPlan};

/// What to export.
#[derive(Subcommand)]
pub(super) enum ExportCommand {
    /// Write structural Verilog, two sets of cell models and, for a stimulus, a testbench that replays it.
    Verilog(VerilogArgs),
    /// Write clocks and slews of a macropixel in a library's cells, as SDC.
    Sdc(mapped::SdcArgs),
    /// Write the delays of all cells, min:typ:max, as SDF (IEEE 1497).
    Sdf(sdf::SdfArgs),
    /// Write a frame as point clouds (PLY, PCD), arrays (NPY, NPZ) and a 16-bit picture.
    Frame(export_frame::FrameExportArgs),
}

/// Arguments of `gdtof export verilog`.
#[derive(Args)]
pub(super) struct VerilogArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    /// Start values for a testbench: CSV `row,col,init`, one line for every macropixel.
    #[arg(long, value_name = "FILE", requires_all = ["events", "stop_periods", "laser_cycles"])]
    inits: Option<PathBuf>,
    /// Rising edges of SPAD_RAW for a testbench: CSV `time_fs,row,col,spad`, from the first rising edge of STOP.
    #[arg(long, value_name = "FILE", requires = "inits")]
    events: Option<PathBuf>,
    /// CLK periods in a laser cycle.
    #[arg(long, value_name = "P", requires = "inits")]
    stop_periods: Option<u32>,
    /// Laser cycles of the exposure.
    #[arg(long, value_name = "N", requires = "inits")]
    laser_cycles: Option<u32>,
    /// Folder for design.v, cells.v, cells_specify.v and, with a stimulus, stimulus.txt and tb.v; created if missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Let the testbench also read the histograms through the pins, into readout.csv.
    #[arg(long, requires = "inits")]
    readout: bool,
    /// Delays to use instead of the library's (SDF); they go into delays.v, which tb.v includes.
    #[arg(long, value_name = "FILE", requires = "inits")]
    sdf: Option<PathBuf>,
    /// Write one macropixel in the cells of --liberty instead: mapped.v with mapped_cells.v, mapped.sdf and mapped.sdc.
    #[arg(long, conflicts_with = "inits")]
    mapped: bool,
}

/// Runs the command.
///
/// # Errors
/// Bad input and unwritable output.
pub(super) fn run(command: &ExportCommand) -> anyhow::Result<()> {
    match command {
        ExportCommand::Verilog(args) => run_verilog(args),
        ExportCommand::Sdc(args) => mapped::run_sdc(args),
        ExportCommand::Sdf(args) => sdf::run(args),
        ExportCommand::Frame(args) => export_frame::run(args),
    }
}

fn run_verilog(args: &VerilogArgs) -> anyhow::Result<()> {
    let sensor = args.sensor.read()?;
    if args.mapped {
        return mapped::write(&args.out, &sensor);
    }
    let top = args.sensor.chip();
    let folder = args.out.display();
    let (Some(inits), Some(events), Some(stop_periods), Some(laser_cycles)) = (
        &args.inits,
        &args.events,
        args.stop_periods,
        args.laser_cycles,
    ) else {
        let (plan, timing) = (None, None);
        write(args, Export { top, plan, timing }, &sensor)?;
        say_unless_quiet(format_args!(
            "design.v, cells.v and cells_specify.v in {folder}; for a testbench, add --inits, --events, --stop-periods and --laser-cycles\n"
        ))?;
        return Ok(());
    };
    let stimuli = Stimuli::read(sensor, inits, events, (stop_periods, laser_cycles))?;
    let plan = StimulusPlan::new(
        &stimuli.sensor,
        &stimuli.exposure,
        stimuli.sensor.cols,
        &stimuli.starts,
        &stimuli.pulses(),
    );
    let plan = if args.readout {
        plan.with_readout()
    } else {
        plan
    };
    let timing = args.sdf.as_ref().map(|path| {
        let netlist = Netlist::elaborate(&array::circuit(&stimuli.sensor));
        sdf::annotated_timing(path, &netlist, &stimuli.sensor)
    });
    let timing = timing.transpose()?;
    let (plan, timing) = (Some(&plan), timing.as_ref());
    write(args, Export { top, plan, timing }, &stimuli.sensor)?;
    say_unless_quiet(format_args!(
        "cd {folder} && iverilog -g2005 -o sim tb.v design.v cells.v && vvp sim\n"
    ))?;
    Ok(())
}

fn write(args: &VerilogArgs, export: Export<'_>, sensor: &SensorConfig) -> Result<(), InputError> {
    let set = ResultSet::begin(&args.out, "export verilog")?;
    export.write(set.staging(), sensor)?;
    notes(set.commit(sensor)?);
    Ok(())
}
