//! Built-in blocks go to Yosys as Verilog and come back as its netlists, of other gates that do the same. Skipped, loudly, without
//! Yosys.

use crate::bench;
use crate::scenario;
use crate::yosys;

use std::collections::BTreeSet;
use std::io::Write as _;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use bench::{Bench, SETTLING};
use guided_dtof::chip::Exposure;
use guided_dtof::chip::p_counter::{self, starts_high};
use guided_dtof::chip::{
    Overflow, OwnBlock, SensorConfig, WindowLaw, WindowOutcome, correlation, histogram, metdc,
    readout,
};
use guided_dtof::netlist::{Corner, Library, Module};
use guided_dtof::settings::Document;
use guided_dtof::units::Time;
use guided_dtof::verilog::{write_modules, write_standard_cells};
use rand::{RngExt, SeedableRng, rngs::StdRng};

/// What Yosys writes of the Verilog in `folder/block.v` as generic gates, or what `mapping` makes of them; none where it is not installed.
fn synthesised(folder: &Path, top: &str, mapping: &str) -> Option<String> {
    let script =
        format!("read_verilog block.v; synth -flatten -top {top}; {mapping}write_json block.json");
    let Ok(output) = Command::new("yosys")
        .args(["-q", "-p", &script])
        .current_dir(folder)
        .output()
    else {
        // Not eprintln, which cargo hides where a test passes.
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED: yosys is not installed, so it has synthesised no block (apt-get install yosys)"
        );
        return None;
    };
    assert!(output.status.success(), "{output:?}");
    Some(std::fs::read_to_string(folder.join("block.json")).unwrap())
}

/// A module after a journey through Yosys, with the JSON that it was read from.
fn there_and_back(module: &Arc<Module>) -> Option<(Arc<Module>, String)> {
    let folder = tempfile::tempdir().unwrap();
    let mut verilog = Vec::new();
    write_modules(&mut verilog, module).unwrap();
    write_standard_cells(&mut verilog, &Library::generic_40nm(), &BTreeSet::new()).unwrap();
    std::fs::write(folder.path().join("block.v"), verilog).unwrap();
    let json = synthesised(folder.path(), module.name(), "")?;
    let read = Module::from_yosys(&json, None).unwrap();
    let ports = |m: &Module| -> Vec<_> {
        let ports = m.port_signals();
        ports
            .map(|(d, s)| (format!("{d:?}"), s.name.clone(), s.width()))
            .collect()
    };
    assert_eq!(ports(&read), ports(module));
    Some((read, json))
}

/// Those with a memory: the pulse that loads the other one is a delay, which logic synthesis takes away.
#[test]
fn p_counters_open_the_same_windows() {
    for (p_counter, tap, after_borrow) in scenario::p_counters() {
        for step_periods in [1, 2] {
            let config = SensorConfig {
                p_counter,
                tap,
                after_borrow,
                step_periods,
                counter_bits: 5,
                ..SensorConfig::default()
            };
            if !p_counter.row().has_memory || config.check().is_err() {
                continue;
            }
            let Some((module, json)) = there_and_back(&p_counter::circuit(&config)) else {
                return;
            };
            let own = SensorConfig {
                p_counter_block: Some(OwnBlock::from_module("block.json", module, &json)),
                ..config.clone()
            };
            own.check().unwrap();
            let law = own.counter_law().unwrap();
            assert_eq!((law.uneven(), law.is_plain()), (None, true), "{config:?}");
            // A slow clock, at which a few gates more move no window.
            let slow = |config: &SensorConfig| {
                let config = SensorConfig {
                    clk_hz: 2e7,
                    ..config.clone()
                };
                let exposure = Exposure::new(&config, 300, 2);
                WindowLaw::new(&config, &exposure)
            };
            let laws = [slow(&config), slow(&own)];
            for start in 0..=config.largest_start() {
                assert_eq!(starts_high(&own, start), starts_high(&config, start));
                let windows = laws.each_ref().map(|law| match law.window(start) {
                    WindowOutcome::Open(open) => Ok(open.first_edge),
                    other => Err(other),
                });
                assert_eq!(windows[0].is_ok(), windows[1].is_ok(), "{config:?} {start}");
                if let [Ok(built_in), Ok(own)] = windows {
                    assert_eq!(built_in, own, "{config:?} {start}");
                }
            }
        }
    }
}

/// The counter of the book's chapter, in cells of the example library.
#[test]
fn a_librarys_cells_count_as_generic_gates_do() {
    let folder = tempfile::tempdir().unwrap();
    let source = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/examples/blocks/lfsr_p_counter.v"
    );
    std::fs::copy(source, folder.path().join("block.v")).unwrap();
    let library = scenario::example_library();
    let library = library.to_str().unwrap();
    let mapping = format!("dfflibmap -liberty {library}; abc -liberty {library}; opt_clean; ");
    let Some(json) = synthesised(folder.path(), "lfsr_p_counter", &mapping) else {
        return;
    };
    assert!(
        json.contains("\"DFFRN_1\"") && !json.contains("\"$_"),
        "{json}"
    );
    let read = |library: &str| {
        let block = folder.path().join("block.json");
        let keys = [
            ("p_counter_block", block.to_str().unwrap()),
            ("liberty", library),
        ];
        let keys = keys.map(|(key, value)| (key.to_owned(), value.into()));
        SensorConfig::read_document(&Document::from_table("a test", keys.into_iter().collect()))
    };
    let (own, generic) = (read(library).unwrap(), yosys::lfsr());
    let laws = [&own, &generic].map(|config| config.counter_law().unwrap());
    assert_eq!(laws[0].uneven(), None);
    for start in 0..=generic.largest_start() {
        assert_eq!(laws[0].code(start), laws[1].code(start));
        assert_eq!(laws[0].rises(start), laws[1].rises(start));
    }
    let complaint = read("").unwrap_err().to_string();
    assert!(
        complaint.contains("_1, which is no gate or flip-flop of the sensor's library"),
        "{complaint}"
    );
}

/// Blocks that have no delays of their own, on random changes of one input at a time.
#[test]
fn other_blocks_do_the_same() {
    let random = &mut StdRng::seed_from_u64(1);
    for block in [
        correlation::circuit(4),
        correlation::circuit(16),
        metdc::circuit(5),
        histogram::circuit(2, 3, Overflow::Wrap),
        readout::bin_select(5, 4),
    ] {
        let Some((read, _)) = there_and_back(&block) else {
            return;
        };
        let mut benches = [&block, &read].map(|module| Bench::new(module, Corner::Typ));
        let inputs: Vec<String> = block
            .port_signals()
            .filter(|(d, _)| *d == guided_dtof::netlist::Direction::Input)
            .flat_map(|(_, s)| {
                let width = s.width();
                (0..width).map(move |bit| {
                    if s.is_bus {
                        format!("{}[{bit}]", s.name)
                    } else {
                        s.name.clone()
                    }
                })
            })
            .collect();
        let outputs = block.port_signals();
        let outputs: Vec<String> = outputs
            .filter(|(d, _)| *d == guided_dtof::netlist::Direction::Output)
            .map(|(_, s)| s.name.clone())
            .collect();
        let steps = 400;
        for step in 1..steps {
            let input = &inputs[random.random_range(0..inputs.len())];
            let value = random.random_bool(0.5);
            for bench in &mut benches {
                bench.drive(SETTLING * step, input, value);
            }
        }
        let buses = benches.each_ref().map(|bench| {
            let nets = outputs.iter().map(|name| bench.bus(name));
            nets.collect::<Vec<_>>()
        });
        let [mut ours, mut theirs] = benches.map(|mut bench| bench.start(&[]));
        let mut known = 0;
        for step in 2..steps {
            let time = SETTLING * step - Time::from_ps(1);
            for (bus, other) in buses[0].iter().zip(&buses[1]) {
                let values = (ours.number_at(time, bus), theirs.number_at(time, other));
                if let (Some(ours), Some(theirs)) = values {
                    assert_eq!(ours, theirs, "{} {step}", block.name());
                    known += 1;
                }
            }
        }
        assert!(known > 100, "{}: {known}", block.name());
    }
}
