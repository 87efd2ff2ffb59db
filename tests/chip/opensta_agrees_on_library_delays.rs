//! OpenSTA, given a macropixel in a library's cells and the library itself, finds the delay of every arc that we find.
//!
//! | what | held to |
//! |---|---|
//! | every arc of every library cell, both edges of its output | 1 ps or 0.5 % |
//! | arcs of which both edges of the input make the same edge of the output (exclusive ORs, a multiplexer's select) | OpenSTA writes one of them into SDF; ours, the slower, is no faster |
//! | arcs that OpenSTA cuts to open a loop, and of pins at a constant | not compared: OpenSTA has none |
//!
//! Chips and libraries are those of `library_chips`.

use crate::library_chips::{self, MappedChip};
use crate::tool;

use std::collections::BTreeMap;

/// Rise and fall delay of each arc (instance, from, to), ps; the later where a file has several.
pub type Arcs = BTreeMap<(String, String, String), [Option<f64>; 2]>;

/// The arcs of an SDF file whose unit is `unit_ps`.
pub fn arcs(text: &str, unit_ps: f64) -> Arcs {
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

#[test]
fn of_every_arc_of_a_macropixel() {
    if !tool::is_here("sta", "no library's delays were compared with OpenSTA") {
        return;
    }
    let libraries = library_chips::libraries();
    for (name, text) in &libraries {
        let (mut compared, mut slower) = (0, 0);
        for chip in library_chips::chips() {
            let mapped = MappedChip::new(text, chip);
            let slew_ns = mapped.cells.environment.input_slew_fs / 1e6;
            mapped.opensta(&format!(
                "set sta_preset_clear_arcs_enabled 1
set_load 0 [get_nets *]
set_input_transition {slew_ns:.9} [all_inputs]
create_clock -name CLK -period 100 [get_ports CLK]
set_propagated_clock [get_clocks CLK]
write_sdf -digits 6 sta.sdf
"
            ));
            let (ours, theirs) = (
                arcs(&mapped.text("mapped.sdf"), 1.0),
                arcs(&mapped.text("sta.sdf"), 1e3),
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
                            mapped.config.p_counter
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
