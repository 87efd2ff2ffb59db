//! OpenSTA, given a macropixel in a library's cells and the library itself, finds the delay of every arc that we find.
//!
//! | what | held to |
//! |---|---|
//! | every arc of every library cell, both edges of its output | 1 ps or 0.5 % |
//! | arcs of which both edges of the input make the same edge of the output (exclusive ORs, a multiplexer's select) | OpenSTA writes one of them into SDF; ours, the slower, is no faster |
//! | arcs that OpenSTA cuts to open a loop, and of pins at a constant | not compared: OpenSTA has none |
//!
//! Chips: the QuantIC4x4 with every P-counter, HSLIDAR in both modes. Libraries: `vectors/liberty/example.lib`, osu018 and osu035 where Debian has put them, and
//! sky130_fd_sc_hd where `shared/data` beside the checkout has it. OpenSTA applies a library's default wire load, with resistances; we leave
//! wires out, so that attribute is taken out of its copy.

use crate::{scenario, tool};

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use std::process::Command;

use guided_dtof::chip::{
    AfterBorrow, CellLibrary, PCounter, SensorConfig, hslidar, hslidar_delay_line, macropixel,
};
use guided_dtof::netlist::Netlist;
use guided_dtof::netlist::liberty::{write_mapped, write_mapped_sdf};

/// Rise and fall delay of each arc (instance, from, to), ps; the later where a file has several.
type Arcs = BTreeMap<(String, String, String), [Option<f64>; 2]>;

/// The arcs of an SDF file whose unit is `unit_ps`.
fn arcs(text: &str, unit_ps: f64) -> Arcs {
    let (mut found, mut instance) = (Arcs::new(), String::new());
    for line in text.lines().map(str::trim) {
        if let Some((_, rest)) = line.split_once("(INSTANCE") {
            let name = rest.split(')').next().unwrap_or_default();
            instance = name.trim().replace('\\', "");
        }
        let Some(rest) = line.strip_prefix("(IOPATH ") else {
            continue;
        };
        let mut words = rest.splitn(3, ' ');
        let (from, to) = (words.next().unwrap(), words.next().unwrap());
        let values = words.next().unwrap().split('(').skip(1).map(|value| {
            let last = value.split(')').next().unwrap().rsplit(':').next().unwrap();
            last.parse::<f64>().ok().map(|value| value * unit_ps)
        });
        let values: Vec<Option<f64>> = values.collect();
        // OpenSTA writes a preset's arc with a rise alone.
        let edges = [values[0], values.get(1).copied().flatten()];
        let known = found
            .entry((instance.clone(), from.to_owned(), to.to_owned()))
            .or_default();
        for (known, value) in known.iter_mut().zip(edges) {
            *known = match (*known, value) {
                (Some(a), Some(b)) => Some(a.max(b)),
                (a, b) => a.or(b),
            };
        }
    }
    found
}

fn text_of(path: &Path) -> Option<String> {
    let bytes = std::fs::read(path).ok()?;
    let mut text = String::new();
    match path.extension().is_some_and(|e| e == "gz") {
        true => flate2::read::GzDecoder::new(&bytes[..])
            .read_to_string(&mut text)
            .ok()?,
        false => (&bytes[..]).read_to_string(&mut text).ok()?,
    };
    Some(text.replace("default_wire_load :", "default_wire_load_left_out :"))
}

/// Libraries that are here: name and text.
fn libraries() -> Vec<(&'static str, String)> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files = [
        ("example", scenario::example_library()),
        (
            "osu018",
            "/usr/share/qflow/tech/osu018/osu018_stdcells.lib".into(),
        ),
        (
            "osu035",
            "/usr/share/qflow/tech/osu035/osu035_stdcells.lib".into(),
        ),
        (
            "sky130",
            here.join("../shared/data/sky130_fd_sc_hd_tt.lib.gz"),
        ),
    ];
    let found = files
        .into_iter()
        .filter_map(|(name, file)| Some((name, text_of(&file)?)));
    found.collect()
}

fn chips() -> Vec<SensorConfig> {
    let of = |p_counter: PCounter| SensorConfig {
        p_counter,
        after_borrow: match p_counter.row().has_memory {
            true => AfterBorrow::Hold,
            false => AfterBorrow::Wrap,
        },
        ..SensorConfig::default()
    };
    let mut chips: Vec<SensorConfig> = PCounter::ALL.into_iter().map(of).collect();
    chips.extend([hslidar(), hslidar_delay_line()].map(|chip| SensorConfig::clone(&chip)));
    chips
}

/// What OpenSTA makes of the macropixel in `folder`, as SDF.
fn opensta(folder: &Path, slew_ns: f64) -> String {
    let script = format!(
        "set sta_preset_clear_arcs_enabled 1
read_liberty cells.lib
read_verilog mapped.v
link_design macropixel
set_input_transition {slew_ns:.9} [all_inputs]
create_clock -name CLK -period 100 [get_ports CLK]
set_propagated_clock [get_clocks CLK]
write_sdf -digits 6 sta.sdf
"
    );
    std::fs::write(folder.join("run.tcl"), script).unwrap();
    let output = Command::new("sta")
        .args(["-no_splash", "-exit", "run.tcl"])
        .current_dir(folder)
        .output()
        .unwrap();
    let sdf = std::fs::read_to_string(folder.join("sta.sdf"));
    sdf.unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stdout)))
}

#[test]
fn of_every_arc_of_a_macropixel() {
    if !tool::is_here("sta", "no library's delays were compared with OpenSTA") {
        return;
    }
    let libraries = libraries();
    for (name, text) in &libraries {
        let (mut compared, mut slower) = (0, 0);
        for chip in chips() {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("cells.lib");
            std::fs::write(&file, text).unwrap();
            let config = SensorConfig {
                liberty: file,
                // Slow enough for any library.
                clk_hz: 10e6,
                dead_time_ns: 120.0,
                stop_phase_ps: 0.0,
                ..chip
            };
            config.check().unwrap_or_else(|e| panic!("{name}: {e}"));
            let library = CellLibrary::of(&config).unwrap().from_file().unwrap();
            let netlist = Netlist::elaborate(&macropixel::circuit(&config));
            let characterised = library.characterised(&netlist);
            let (mut verilog, mut sdf) = (Vec::new(), Vec::new());
            write_mapped(&mut verilog, &netlist, &library.liberty, &characterised).unwrap();
            write_mapped_sdf(&mut sdf, &netlist, &library.liberty, &characterised).unwrap();
            std::fs::write(folder.path().join("mapped.v"), verilog).unwrap();
            let slew_ns = library.environment.input_slew_fs / 1e6;
            let theirs = opensta(folder.path(), slew_ns);
            let (ours, theirs) = (
                arcs(&String::from_utf8(sdf).unwrap(), 1.0),
                arcs(&theirs, 1e3),
            );
            assert!(ours.len() > 1000, "{name}: {} arcs", ours.len());
            for (arc, own) in &ours {
                let other = theirs
                    .get(arc)
                    .unwrap_or_else(|| panic!("{name}: OpenSTA has no {arc:?}"));
                for (own, other) in own.iter().zip(other) {
                    let (Some(own), Some(other)) = (own, other) else {
                        continue;
                    };
                    if *other == 0.0 {
                        continue;
                    }
                    compared += 1;
                    let apart = own - other;
                    if apart.abs() > f64::max(1.0, 0.005 * other) {
                        slower += 1;
                        assert!(
                            apart > 0.0,
                            "{name}, {:?}: {arc:?} {own} ps, OpenSTA {other}",
                            config.p_counter
                        );
                    }
                }
            }
        }
        println!("{name}: {compared} delays compared, {slower} of them ours alone slower");
        // Up to 2.3 % are.
        assert!(
            slower * 20 < compared,
            "{name}: {slower} of {compared} delays are slower"
        );
    }
}
