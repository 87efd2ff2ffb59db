//! `gdtof export verilog --mapped` and `gdtof export sdc`: a macropixel in the cells of a Liberty file, for timing analysis and layout.

use std::path::{Path, PathBuf};

use clap::Args;

use super::SensorArgs;
use super::voice::{note, notes, say_unless_quiet};
use crate::chip::{CellLibrary, FromFile, Probes, SensorConfig, macropixel};
use crate::files::{InputError, OutputFile, ResultSet};
use crate::liberty::{
    CharacterisedNetlist, Clocking, write_constraints, write_mapped, write_mapped_cells,
    write_mapped_sdf,
};
use crate::netlist::{Netlist, ScopeId};

/// Arguments of `gdtof export sdc`.
#[derive(Args)]
pub(super) struct SdcArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    /// Constraints to write, for the mapped.v of `gdtof export verilog --mapped`.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// A macropixel, sized and timed.
struct MappedMacropixel<'c> {
    config: &'c SensorConfig,
    cells: &'static FromFile,
    netlist: Netlist,
    characterised: CharacterisedNetlist,
}

impl<'c> MappedMacropixel<'c> {
    /// # Errors
    /// A sensor of the built-in cells.
    fn new(config: &'c SensorConfig, option: &str) -> Result<Self, InputError> {
        let cells = CellLibrary::from_config(config)
            .ok()
            .and_then(CellLibrary::from_file);
        let Some(cells) = cells else {
            let message = "the built-in cells are no library's; add --liberty FILE";
            return Err(InputError::new(option, message));
        };
        let netlist = Netlist::elaborate(&macropixel::circuit(config));
        let characterised = cells.characterised(&netlist);
        for sentence in &cells.liberty.map.notes {
            note(sentence);
        }
        Ok(MappedMacropixel {
            config,
            cells,
            netlist,
            characterised,
        })
    }

    fn write_sdc(&self, path: &Path) -> Result<(), InputError> {
        let ripple = Probes::p_counter_cells(&self.netlist);
        let clocking = Clocking {
            port: "CLK",
            period: self.config.clock().period(),
            ripple: &ripple,
            after_fall: &[("STOP", self.config.stop_phase())],
        };
        OutputFile::write_with(path, |out| {
            let sized = (&self.characterised, &self.cells.environment);
            write_constraints(out, &self.netlist, &self.cells.liberty, sized, clocking)
        })
    }
}

/// Runs `gdtof export sdc`.
///
/// # Errors
/// Bad input and unwritable output.
pub(super) fn run_sdc(args: &SdcArgs) -> anyhow::Result<()> {
    let config = args.sensor.read()?;
    MappedMacropixel::new(&config, "export sdc")?.write_sdc(&args.out)?;
    say_unless_quiet(format_args!("{}\n", args.out.display()))?;
    Ok(())
}

/// Writes mapped.v, mapped_cells.v, mapped.sdf and mapped.sdc into `folder`.
///
/// # Errors
/// A sensor of the built-in cells, and unwritable output.
pub(super) fn write(folder: &Path, config: &SensorConfig) -> anyhow::Result<()> {
    let mapped = MappedMacropixel::new(config, "--mapped")?;
    let MappedMacropixel {
        cells,
        netlist,
        characterised,
        ..
    } = &mapped;
    let set = ResultSet::begin(folder, "export verilog --mapped")?;
    let file = |name: &str| set.staging().join(name);
    OutputFile::write_with(&file("mapped.v"), |out| {
        write_mapped(out, netlist, &cells.liberty, characterised)
    })?;
    OutputFile::write_with(&file("mapped_cells.v"), |out| {
        write_mapped_cells(out, netlist, &cells.liberty, characterised)
    })?;
    OutputFile::write_with(&file("mapped.sdf"), |out| {
        write_mapped_sdf(out, netlist, &cells.liberty, characterised)
    })?;
    mapped.write_sdc(&file("mapped.sdc"))?;
    notes(set.commit(config)?);
    let (area, leakage_w) = characterised.silicon(netlist, &cells.liberty, ScopeId::TOP);
    say_unless_quiet(format_args!(
        "mapped.v, mapped_cells.v, mapped.sdf and mapped.sdc in {}: a macropixel of {} in {}, area {area:.0} um2, leakage {:.3} nW\n",
        folder.display(),
        netlist.cells().len(),
        cells.liberty.name,
        leakage_w * 1e9
    ))?;
    Ok(())
}
