//! Macropixels in the cells of libraries: which there are, and their netlist, delays and clocks as files for other tools.

use crate::scenario;

use std::io::Read;
use std::path::Path;
use std::process::Command;

use guided_dtof::chip::{
    AfterBorrow, CellLibrary, FromFile, PCounter, Probes, SensorConfig, Tdc, hslidar,
    hslidar_delay_line, macropixel,
};
use guided_dtof::liberty::{
    CharacterisedNetlist, Clocking, write_constraints, write_mapped, write_mapped_cells,
    write_mapped_sdf,
};
use guided_dtof::netlist::Netlist;
use guided_dtof::units::Time;

/// CLK's period in mapped.sdc. OpenSTA computes in single precision, and hundreds of long periods would leave it no picoseconds.
pub const PERIOD_NS: f64 = 2.0;

/// Libraries that are here, name and text: `vectors/liberty/example.lib`, osu018 and osu035 where Debian has put them, and
/// sky130_fd_sc_hd where `shared/data` beside the checkout has it.
pub fn libraries() -> Vec<(&'static str, String)> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let qflow = |name: &str| format!("/usr/share/qflow/tech/{name}/{name}_stdcells.lib").into();
    let sky130 = here.join("../shared/data/sky130_fd_sc_hd_tt.lib.gz");
    let files = [
        ("example", scenario::example_library()),
        ("osu018", qflow("osu018")),
        ("osu035", qflow("osu035")),
        ("sky130", sky130),
    ];
    let found = files
        .into_iter()
        .filter_map(|(name, file)| Some((name, text_of(&file)?)));
    found.collect()
}

fn text_of(path: &Path) -> Option<String> {
    let bytes = std::fs::read(path).ok()?;
    let mut text = String::new();
    if path.extension().is_some_and(|e| e == "gz") {
        flate2::read::GzDecoder::new(&bytes[..])
            .read_to_string(&mut text)
            .ok()?
    } else {
        (&bytes[..]).read_to_string(&mut text).ok()?
    };
    Some(text)
}

/// The QuantIC4x4 with every P-counter, and HSLIDAR in both modes.
pub fn chips() -> Vec<SensorConfig> {
    let chip = |p_counter: PCounter| SensorConfig {
        p_counter,
        after_borrow: if p_counter.row().has_memory {
            AfterBorrow::Hold
        } else {
            AfterBorrow::Wrap
        },
        ..SensorConfig::default()
    };
    let mut chips: Vec<SensorConfig> = PCounter::ALL.into_iter().map(chip).collect();
    // With a shift register: OpenSTA asks less behind the exclusive ORs of the counter TDC's adders than we do.
    let hslidar = SensorConfig {
        tdc: Tdc::Clocked,
        ..SensorConfig::clone(&hslidar())
    };
    chips.extend([hslidar, SensorConfig::clone(&hslidar_delay_line())]);
    chips
}

/// A macropixel in a library's cells, and a folder with cells.lib, mapped.v, mapped_cells.v, mapped.sdf and mapped.sdc.
pub struct MappedChip {
    pub folder: tempfile::TempDir,
    pub config: SensorConfig,
    pub cells: &'static FromFile,
    pub netlist: Netlist,
    pub characterised: CharacterisedNetlist,
}

impl MappedChip {
    pub fn new(text: &str, chip: SensorConfig) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let liberty = folder.path().join("cells.lib");
        std::fs::write(&liberty, text).unwrap();
        let config = SensorConfig {
            liberty,
            // Slow enough for any library.
            clk_hz: 10e6,
            dead_time_ns: 120.0,
            stop_phase_ps: 0.0,
            ..chip
        };
        config.check().unwrap_or_else(|e| panic!("{e}"));
        let of_library = CellLibrary::from_config(&config)
            .unwrap()
            .from_file()
            .unwrap();
        // An `input_slew_ps` of 0 leaves the library's own.
        assert!(of_library.environment.input_slew_fs > 0.0);
        let netlist = Netlist::elaborate(&macropixel::circuit(&config));
        let characterised = of_library.characterised(&netlist);
        let cells = &of_library.liberty;
        let mut files: [Vec<u8>; 4] = Default::default();
        let [verilog, models, sdf, sdc] = &mut files;
        write_mapped(verilog, &netlist, cells, &characterised).unwrap();
        write_mapped_cells(models, &netlist, cells, &characterised).unwrap();
        write_mapped_sdf(sdf, &netlist, cells, &characterised).unwrap();
        let clocking = Clocking {
            port: "CLK",
            period: Time::from_fs((PERIOD_NS * 1e6) as i64),
            ripple: &Probes::p_counter_cells(&netlist),
            after_fall: &[("STOP", Time::ZERO)],
        };
        let sized = (&characterised, &of_library.environment);
        write_constraints(sdc, &netlist, cells, sized, clocking).unwrap();
        let names = ["mapped.v", "mapped_cells.v", "mapped.sdf", "mapped.sdc"];
        for (name, file) in names.into_iter().zip(files) {
            std::fs::write(folder.path().join(name), file).unwrap();
        }
        MappedChip {
            folder,
            config,
            cells: of_library,
            netlist,
            characterised,
        }
    }

    pub fn text(&self, file: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(file)).unwrap()
    }

    /// What OpenSTA prints of `commands`.
    pub fn opensta(&self, commands: &str) -> String {
        opensta(self.folder.path(), "macropixel", commands)
    }
}

/// Lets OpenSTA read cells.lib and mapped.v in `folder` and then run `commands`; gives what it printed.
pub fn opensta(folder: &Path, top: &str, commands: &str) -> String {
    let script =
        format!("read_liberty cells.lib\nread_verilog mapped.v\nlink_design {top}\n{commands}");
    std::fs::write(folder.join("run.tcl"), script).unwrap();
    let output = Command::new("sta")
        .args(["-no_splash", "-exit", "run.tcl"])
        .current_dir(folder)
        .output()
        .unwrap();
    String::from_utf8(output.stdout).unwrap()
}
