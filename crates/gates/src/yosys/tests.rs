//! Hand-written netlists; none needs Yosys. What Yosys itself writes is read in `tests/chip`.

use proptest::prelude::*;

use super::*;
use crate::kernel::{Drive, Kernel, Stimulus};
use crate::logic::Logic;
use crate::netlist::{CellKind, Corner, Direction, Library, Netlist, Timing};
use crate::units::Time;

/// A module `m` of one cell, whose pins are ports of its own names.
fn cell(kind: &str, inputs: &[&str], output: &str) -> String {
    let all: Vec<&str> = inputs.iter().copied().chain([output]).collect();
    let joined = |entry: &dyn Fn(usize, &str) -> String| -> String {
        let entries: Vec<String> = all
            .iter()
            .enumerate()
            .map(|(i, pin)| entry(i, pin))
            .collect();
        entries.join(", ")
    };
    let ports = joined(&|i, pin| {
        let direction = if pin == output { "output" } else { "input" };
        format!(r#""{pin}": {{"direction": "{direction}", "bits": [{i}]}}"#)
    });
    let pins = joined(&|i, pin| format!(r#""{pin}": [{i}]"#));
    let cell = format!(r#"{{"type": "{kind}", "connections": {{{pins}}}}}"#);
    format!(r#"{{"modules": {{"m": {{"ports": {{{ports}}}, "cells": {{"it": {cell}}}}}}}}}"#)
}

struct Bench {
    netlist: Netlist,
    kernel: Kernel,
}

impl Bench {
    fn new(text: &str) -> Self {
        Self::from_module(&Module::from_yosys(text, None).unwrap())
    }

    fn from_module(module: &Arc<Module>) -> Self {
        let netlist = Netlist::elaborate(module);
        let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
        let kernel = Kernel::new(&netlist, &timing);
        Bench { netlist, kernel }
    }

    /// Drives inputs one after the other, waits, and gives the output.
    fn set(&mut self, inputs: &[(&str, bool)], output: &str) -> Logic {
        let mut time = self.kernel.now();
        let drives: Vec<Drive> = inputs
            .iter()
            .map(|&(name, value)| {
                time += Time::from_ps(1000);
                let net = self.netlist.net(name).unwrap();
                let value = if value { Logic::One } else { Logic::Zero };
                Drive { time, net, value }
            })
            .collect();
        let mut drives = Stimulus::new(drives);
        self.kernel
            .run(&mut drives, time + Time::from_ps(1000), &mut ())
            .expect("no loop of cells without delay");
        self.kernel.value(self.netlist.net(output).unwrap())
    }
}

#[test]
fn gates_do_what_their_names_say() {
    type Law = fn(&[bool]) -> bool;
    let gates: [(&str, &[&str], Law); 16] = [
        ("$_BUF_", &["A"], |i| i[0]),
        ("$_NOT_", &["A"], |i| !i[0]),
        ("$_AND_", &["A", "B"], |i| i[0] & i[1]),
        ("$_NAND_", &["A", "B"], |i| !(i[0] & i[1])),
        ("$_OR_", &["A", "B"], |i| i[0] | i[1]),
        ("$_NOR_", &["A", "B"], |i| !(i[0] | i[1])),
        ("$_XOR_", &["A", "B"], |i| i[0] ^ i[1]),
        ("$_XNOR_", &["A", "B"], |i| !(i[0] ^ i[1])),
        ("$_ANDNOT_", &["A", "B"], |i| i[0] & !i[1]),
        ("$_ORNOT_", &["A", "B"], |i| i[0] | !i[1]),
        (
            "$_MUX_",
            &["A", "B", "S"],
            |i| if i[2] { i[1] } else { i[0] },
        ),
        (
            "$_NMUX_",
            &["A", "B", "S"],
            |i| !if i[2] { i[1] } else { i[0] },
        ),
        ("$_AOI3_", &["A", "B", "C"], |i| !(i[0] & i[1] | i[2])),
        ("$_OAI3_", &["A", "B", "C"], |i| !((i[0] | i[1]) & i[2])),
        ("$_AOI4_", &["A", "B", "C", "D"], |i| {
            !(i[0] & i[1] | i[2] & i[3])
        }),
        ("$_OAI4_", &["A", "B", "C", "D"], |i| {
            !((i[0] | i[1]) & (i[2] | i[3]))
        }),
    ];
    for (kind, pins, law) in gates {
        let mut bench = Bench::new(&cell(kind, pins, "Y"));
        for word in 0..1 << pins.len() {
            let values: Vec<bool> = (0..pins.len()).map(|bit| word >> bit & 1 == 1).collect();
            let inputs: Vec<_> = pins.iter().copied().zip(values.iter().copied()).collect();
            let found = bench.set(&inputs, "Y");
            let wanted = if law(&values) {
                Logic::One
            } else {
                Logic::Zero
            };
            assert_eq!(found, wanted, "{kind} {word:b}");
        }
    }
}

/// Every generic flip-flop beside what Yosys's simulation library says of it, on random edges of one pin at a time.
#[test]
fn flip_flops_do_what_their_names_say() {
    let families: [(&str, &str); 11] = [
        ("DFF", "C"),
        ("DFF", "CR0"),
        ("DFFE", "CE"),
        ("DFFE", "CR0E"),
        ("SDFF", "CR0"),
        ("SDFFE", "CR0E"),
        ("SDFFCE", "CR0E"),
        ("DFFSR", "CSR"),
        ("DFFSRE", "CSRE"),
        ("ALDFF", "CL"),
        ("ALDFFE", "CLE"),
    ];
    let mut random = 1u64;
    let mut next = move || {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        random >> 33
    };
    for (family, pins) in families {
        for polarity in 0..1u32 << pins.len() {
            let high = |bit: usize| polarity >> bit & 1 == 1;
            let letter = |(bit, pin)| match (pin, high(bit)) {
                ('0', to_one) => {
                    if to_one {
                        '1'
                    } else {
                        '0'
                    }
                }
                (_, is_high) => {
                    if is_high {
                        'P'
                    } else {
                        'N'
                    }
                }
            };
            let letters: String = pins.chars().enumerate().map(letter).collect();
            let kind = format!("$_{family}_{letters}_");
            let mut inputs: Vec<&str> = vec!["D"];
            inputs.extend(pins.split("").filter(|pin| !pin.is_empty() && *pin != "0"));
            if family.starts_with("AL") {
                inputs.push("AD");
            }
            let mut bench = Bench::new(&cell(&kind, &inputs, "Q"));
            let mut values: HashMap<&str, bool> = inputs.iter().map(|&pin| (pin, false)).collect();
            let first: Vec<_> = values.iter().map(|(&pin, &value)| (pin, value)).collect();
            bench.set(&first, "Q");
            // What the state becomes; `before` is that of the last step.
            let step = |state, before: &HashMap<&str, bool>, values: &HashMap<&str, bool>| {
                let is_active = |pin: &str, values: &HashMap<&str, bool>| {
                    let at = pins.find(pin)?;
                    Some(values[pin] == high(at))
                };
                let is = |pin| is_active(pin, values).unwrap_or(false);
                let is_enabled = is_active("E", values).unwrap_or(true);
                let to = Some(pins.find('0').is_some_and(high));
                let rises = !is_active("C", before).unwrap() && is_active("C", values).unwrap();
                let is_sync = family.starts_with('S');
                if is("L") {
                    Some(values["AD"])
                } else if !is_sync && is("R") {
                    if pins.contains('0') { to } else { Some(false) }
                } else if is("S") {
                    Some(true)
                } else if rises && is_sync && is("R") && (is_enabled || family == "SDFFE") {
                    to
                } else if rises && is_enabled {
                    Some(values["D"])
                } else {
                    state
                }
            };
            let mut state = step(None, &values, &values);
            for _ in 0..300 {
                let pin = inputs[next() as usize % inputs.len()];
                let before = values.clone();
                values.insert(pin, next() & 1 == 1);
                state = step(state, &before, &values);
                let wanted = match state {
                    None => Logic::X,
                    Some(true) => Logic::One,
                    Some(false) => Logic::Zero,
                };
                let found = bench.set(&[(pin, values[pin])], "Q");
                assert_eq!(found, wanted, "{kind}");
            }
        }
    }
}

fn module(ports: &str, cells: &str, names: &str) -> String {
    format!(
        r#"{{"modules": {{"m": {{"ports": {{{ports}}}, "cells": {{{cells}}}, "netnames": {{{names}}}}}}}}}"#
    )
}

const PORTS: &str = r#""Z_FIRST": {"direction": "input", "bits": [2, 3]}, "A": {"direction": "output", "bits": [4, 2, "1"]}"#;

/// The library of invented numbers, and cells that nothing here is made of.
#[cfg(feature = "liberty")]
fn library() -> Liberty {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../vectors/liberty/example.lib"
    );
    let text = std::fs::read_to_string(file).unwrap();
    let gate = |name: &str, inputs: &[&str], function: &str| {
        let pins = inputs
            .iter()
            .map(|pin| format!("pin ({pin}) {{ direction : input; }}"));
        let pins: String = pins.collect();
        format!(
            "cell ({name}) {{ area : 99; {pins} pin (Z) {{ direction : output; function : \"{function}\"; }} }}\n"
        )
    };
    let more = [
        gate("AOI22_1", &["A1", "A2", "B1", "B2"], "!((A1 A2) + (B1 B2))"),
        gate("NAND4_1", &["A", "B", "C", "D"], "!(A B C D)"),
        gate("MUXI_1", &["S", "A", "B"], "!((A !S) + (B S))"),
        gate("XNOR3_1", &["A", "B", "C"], "!(A ^ B ^ C)"),
        gate("MAJ_1", &["A", "B", "C"], "(A B) + (B C) + (A C)"),
        gate("ONE_1", &["A"], "A + !A"),
        "cell (DFFNS_1) { area : 99; ff (IQ, IQN) { clocked_on : \"!CKN\"; next_state : \"D\"; preset : \"!SN\"; }
            pin (CKN) { direction : input; } pin (D) { direction : input; } pin (SN) { direction : input; }
            pin (Q) { direction : output; function : \"IQ\"; } pin (QN) { direction : output; function : \"IQN\"; } }"
            .to_owned(),
    ];
    let end = text.rfind('}').unwrap();
    let text = format!("{}{}}}\n", &text[..end], more.concat());
    Liberty::read(&text, &[]).unwrap()
}

#[cfg(feature = "liberty")]
#[test]
fn cells_of_a_library_do_what_it_says() {
    type Law = fn(&[bool]) -> bool;
    let gates: [(&str, &[&str], Law); 7] = [
        ("AOI22_1", &["A1", "A2", "B1", "B2"], |i| {
            !(i[0] & i[1] | i[2] & i[3])
        }),
        ("NAND4_1", &["A", "B", "C", "D"], |i| {
            !(i[0] & i[1] & i[2] & i[3])
        }),
        (
            "MUXI_1",
            &["S", "A", "B"],
            |i| if i[0] { !i[2] } else { !i[1] },
        ),
        ("XNOR3_1", &["A", "B", "C"], |i| !(i[0] ^ i[1] ^ i[2])),
        ("MAJ_1", &["A", "B", "C"], |i| {
            i[0] & i[1] | i[1] & i[2] | i[0] & i[2]
        }),
        ("ONE_1", &["A"], |_| true),
        ("NAND2_4", &["A", "B"], |i| !(i[0] & i[1])),
    ];
    let library = library();
    let read = |text: &str| Module::from_yosys_of(text, None, Some(&library));
    for (kind, pins, law) in gates {
        let output = if kind == "NAND2_4" { "Y" } else { "Z" };
        let mut bench = Bench::from_module(&read(&cell(kind, pins, output)).unwrap());
        for bits in 0..1u32 << pins.len() {
            let values: Vec<bool> = (0..pins.len()).map(|pin| bits >> pin & 1 == 1).collect();
            let inputs: Vec<_> = pins.iter().copied().zip(values.iter().copied()).collect();
            let wanted = if law(&values) {
                Logic::One
            } else {
                Logic::Zero
            };
            assert_eq!(bench.set(&inputs, output), wanted, "{kind} {values:?}");
        }
    }
    for (output, inverts) in [("Q", false), ("QN", true)] {
        let module = read(&cell("DFFNS_1", &["CKN", "D", "SN"], output)).unwrap();
        let mut bench = Bench::from_module(&module);
        let mut is = |inputs: &[(&str, bool)], state: bool| {
            let wanted = if state != inverts {
                Logic::One
            } else {
                Logic::Zero
            };
            assert_eq!(bench.set(inputs, output), wanted, "{output} {inputs:?}");
        };
        is(&[("CKN", true), ("D", false), ("SN", false)], true);
        is(&[("SN", true)], true);
        is(&[("CKN", false)], false);
        is(&[("D", true), ("CKN", true)], false);
        is(&[("CKN", false)], true);
    }
    let unknown = read(&cell("NAND9_1", &["A"], "Y"));
    assert!(
        unknown
            .unwrap_err()
            .to_string()
            .contains("cell it is a NAND9_1, which is no gate")
    );
}

#[test]
fn ports_and_nets_keep_their_names_and_order() {
    let cells = r#"
        "$abc$1": {"type": "$_NOT_", "connections": {"A": [2], "Y": [5]}},
        "x": {"type": "$_AND_", "port_directions": {"A": "input", "B": "input", "Y": "output"}, "connections": {"A": [5], "B": ["x"], "Y": [4]}}"#;
    let names = r#""inner": {"hide_name": 0, "bits": [5]}, "also_inner": {"bits": [5]}, "n7": {"bits": [4]}, "$hidden": {"hide_name": 1, "bits": [5]}"#;
    let read = Module::from_yosys(&module(PORTS, cells, names), None).unwrap();
    let ports: Vec<_> = read
        .port_signals()
        .map(|(direction, s)| (direction, s.name.as_str(), s.width()))
        .collect();
    assert_eq!(
        ports,
        [
            (Direction::Input, "Z_FIRST", 2),
            (Direction::Output, "A", 3)
        ]
    );
    assert!(read.signal("inner").is_some() && read.signal("also_inner").is_none());
    let kinds: Vec<CellKind> = read.cells().iter().map(|c| c.kind).collect();
    use CellKind::{And2, Buf, Inv, Xnor2, Xor2};
    assert_eq!(kinds, [Inv, Xor2, And2, Buf, Xnor2, Buf]);
}

#[test]
fn what_is_wrong_is_said_with_its_place_and_cure() {
    let complaint = |text: &str, top| Module::from_yosys(text, top).unwrap_err().to_string();
    for (kind, cure) in [
        (
            "$_DLATCH_P_",
            "a latch, which has no counterpart here; write it as a flip-flop",
        ),
        (
            "$mem_v2",
            "a memory, which is not mapped to gates; run synth -flatten; memory_map; techmap",
        ),
        (
            "$add",
            "which is not mapped to gates; run synth -flatten; techmap",
        ),
        (
            "$_TBUF_",
            "which has no counterpart here; run synth -flatten; abc -g simple",
        ),
        (
            "$_DFF_PQ_",
            "which has no counterpart here; run synth -flatten; abc -g simple",
        ),
        (
            "other",
            "which is no gate or flip-flop of the sensor's library; run synth -flatten, or give the library (liberty) whose cell it is",
        ),
    ] {
        let wanted = format!("module m: cell it is a {kind}, {cure}");
        assert_eq!(complaint(&cell(kind, &["A"], "Y"), None), wanted);
    }
    let not = |a: &str, y: &str| {
        format!(r#"{{"type": "$_NOT_", "connections": {{"A": {a}, "Y": {y}}}}}"#)
    };
    for (cells, wanted) in [
        (
            format!(r#""u": {}, "v": {}"#, not("[2]", "[4]"), not("[3]", "[4]")),
            "module m: u and v both drive A[0]; give each its own net",
        ),
        (
            format!(r#""u": {}"#, not("[2]", "[3]")),
            "module m: Z_FIRST and u both drive Z_FIRST[1]; give each its own net",
        ),
        (
            format!(r#""u": {}"#, not("[9]", "[4]")),
            "module m: pin A of cell u ($_NOT_) is connected to a net that nothing drives; drive it",
        ),
        (
            format!(r#""u": {}"#, not("[\"z\"]", "[4]")),
            "module m: pin A of cell u ($_NOT_) is connected to a net that nothing drives; drive it",
        ),
        (
            format!(r#""u": {}"#, not("[2, 3]", "[4]")),
            "module m: pin A of cell u ($_NOT_) has several bits; run synth -flatten",
        ),
        (
            r#""u": {"type": "$_NOT_", "connections": {"A": [2]}}"#.to_owned(),
            "module m: pin Y of cell u ($_NOT_) is connected to nothing; connect it",
        ),
        (
            String::new(),
            "module m: nothing drives A[0]; connect an output to it or remove it",
        ),
    ] {
        let names = r#""Z_FIRST": {"bits": [2, 3]}, "A": {"bits": [4, 2, "1"]}"#;
        assert_eq!(complaint(&module(PORTS, &cells, names), None), wanted);
    }
    let inout = r#""P": {"direction": "inout", "bits": [2]}"#;
    assert_eq!(
        complaint(&module(inout, "", ""), None),
        "module m: port P is \"inout\"; make it an input or an output"
    );
    let name = r#""a.b": {"direction": "input", "bits": [2]}"#;
    assert!(complaint(&module(name, "", ""), None).contains("is not an identifier"));
    for text in [
        "",
        "[]",
        "{}",
        "not json",
        r#"{"modules": {}}"#,
        r#"{"modules": {"m": 1}}"#,
    ] {
        assert!(
            complaint(text, None).starts_with("is no netlist of Yosys ("),
            "{text}"
        );
    }
    assert_eq!(
        complaint(&" ".repeat(MOST_BYTES + 1), None),
        "has 16777217 bytes, of which at most 16777216 are read; give one block"
    );
}

#[test]
fn of_several_modules_one_is_the_top() {
    let two = |attributes: &str| {
        format!(r#"{{"modules": {{"a": {{}}, "b": {{"attributes": {{{attributes}}}}}}}}}"#)
    };
    let name = |text: &str, top| Module::from_yosys(text, top).map(|m| m.name().to_owned());
    let marked = two(r#""top": "00000000000000000000000000000001""#);
    assert_eq!(name(&marked, None), Ok("b".into()));
    assert_eq!(name(&marked, Some("a")), Ok("a".into()));
    assert_eq!(name(&two(r#""top": 1"#), None), Ok("b".into()));
    let complaint = |text: &str, top| name(text, top).unwrap_err().to_string();
    assert_eq!(
        complaint(&two(""), None),
        "has several modules and no top; name one as FILE:MODULE, a or b, or run synth -flatten -top"
    );
    assert_eq!(
        complaint(&two(""), Some("c")),
        "has no module c; give a or b"
    );
}

#[test]
fn an_inverter_behind_a_flip_flop_is_its_other_output() {
    let ports = r#""C": {"direction": "input", "bits": [2]}, "R": {"direction": "input", "bits": [3]}, "Q": {"direction": "output", "bits": [4]}"#;
    let toggle = |to: char| {
        format!(
            r#""n": {{"type": "$_NOT_", "connections": {{"A": [4], "Y": [5]}}}},
            "f": {{"type": "$_DFF_PP{to}_", "connections": {{"C": [2], "D": [5], "R": [3], "Q": [4]}}}}"#
        )
    };
    let kinds = |to| {
        let read = Module::from_yosys(&module(ports, &toggle(to), ""), None).unwrap();
        read.cells().iter().map(|c| c.kind).collect::<Vec<_>>()
    };
    assert_eq!(kinds('0'), [CellKind::Dffr]);
    // The flip-flop holds the inverse, whose inverse is what it takes.
    assert_eq!(kinds('1'), [CellKind::Inv, CellKind::Dffr]);
}

proptest! {
    /// Whatever becomes of a file, it is read or refused.
    #[test]
    fn spoilt_text_is_read_or_refused(edits in prop::collection::vec((0usize..2000, "[0-9xz\"{}\\[\\],: AYQDCR]"), 1..6)) {
        let ports = r#""C": {"direction": "input", "bits": [2, 3]}, "Q": {"direction": "output", "bits": [4, 5]}"#;
        let cells = r#""n": {"type": "$_NOT_", "connections": {"A": [4], "Y": [5]}},
            "g": {"type": "$_MUX_", "connections": {"A": [5], "B": ["1"], "S": [3], "Y": [6]}},
            "f": {"type": "$_SDFFE_PN0P_", "connections": {"C": [2], "D": [6], "R": [3], "E": ["x"], "Q": [4]}}"#;
        let mut text = module(ports, cells, r#""Q": {"bits": [4, 5]}, "W": {"bits": [6]}"#);
        prop_assert!(Module::from_yosys(&text, None).is_ok());
        for (at, with) in edits {
            let at = at % text.len();
            text.replace_range(at..=at, &with);
        }
        if let Ok(read) = Module::from_yosys(&text, None) {
            Netlist::elaborate(&read);
        }
    }
}
