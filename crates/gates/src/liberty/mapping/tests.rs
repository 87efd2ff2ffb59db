//! Recipes compute what their kind does, whatever a library has and lacks, and families are what their tables say.

mod flip_flops;
mod sentences;

use super::*;
use crate::liberty::Liberty;

/// Tables over the load: a larger cell is stronger.
fn arc(related: &str, more: &str, area: f64) -> String {
    let table = |kind: &str, base: f64| {
        format!(
            "{kind} (load) {{ values (\"{base}, {}\"); }} ",
            base + 1.0 / area
        )
    };
    let tables = [
        ("cell_rise", 0.02),
        ("cell_fall", 0.02),
        ("rise_transition", 0.01),
        ("fall_transition", 0.01),
    ];
    let tables = tables.map(|(kind, base)| table(kind, base));
    format!(
        "timing () {{ related_pin : \"{related}\"; {more} {} }} ",
        tables.concat()
    )
}

fn gate_text(name: &str, area: f64, inputs: &[&str], function: &str) -> String {
    let pins = inputs
        .iter()
        .map(|pin| format!("pin ({pin}) {{ direction : input; capacitance : 0.01; }} "));
    let arcs = inputs.iter().map(|pin| arc(pin, "", area));
    format!(
        "cell ({name}) {{ area : {area}; {} pin (Y) {{ direction : output; function : \"{function}\"; {} }} }}\n",
        pins.collect::<String>(),
        arcs.collect::<String>()
    )
}

/// A flip-flop of pins that are called as what they are.
fn flip_flop_text(name: &str, group: &str, inputs: &[&str], outputs: &[(&str, &str)]) -> String {
    let arcs = inputs.iter().filter_map(|&input| {
        let kind = match input {
            "CK" => "rising_edge",
            "CKN" => "falling_edge",
            "R" | "RN" => "clear",
            "S" | "SN" => "preset",
            _ => return None,
        };
        Some(arc(input, &format!("timing_type : {kind};"), 9.0))
    });
    let arcs: String = arcs.collect();
    let inputs = inputs
        .iter()
        .map(|pin| format!("pin ({pin}) {{ direction : input; capacitance : 0.01; }} "));
    let outputs = outputs.iter().map(|(pin, shows)| {
        format!("pin ({pin}) {{ direction : output; function : \"{shows}\"; {arcs} }} ")
    });
    let (inputs, outputs) = (inputs.collect::<String>(), outputs.collect::<String>());
    format!("cell ({name}) {{ area : 9; ff (IQ, IQN) {{ {group} }} {inputs}{outputs} }}\n")
}

const HEAD: &str = "library (few) { capacitive_load_unit (1, pf); lu_table_template (load) { variable_1 : total_output_net_capacitance; index_1 (\"0, 1\"); }\n";

fn map(cells: &str, wanted: &[(CellKind, String)]) -> Result<CellMap, LibertyError> {
    Liberty::read(&format!("{HEAD}{cells}}}"), wanted).map(|library| library.map)
}

/// An inverter, a NAND and flip-flops: enough for everything.
fn enough_cells() -> String {
    gate_text("INV_1", 1.0, &["A"], "!A")
        + &gate_text("NAND_1", 2.0, &["A", "B"], "!(A B)")
        + &flip_flops()
}

/// A stage's output for levels at its pins: by the name of its cell, which says what it does here.
fn stage_output(name: &str, levels: &[bool]) -> bool {
    match name.split('_').next().unwrap() {
        "INV" => !levels[0],
        "BUF" => levels[0],
        "NAND" => !(levels[0] && levels[1]),
        "NOR" => !(levels[0] || levels[1]),
        "AND" => levels[0] && levels[1],
        "OR" => levels[0] || levels[1],
        "XNOR" => levels[0] == levels[1],
        // Pins A, B, S in the order of their names: an inverting multiplexer.
        "IMUX" => !if levels[2] { levels[1] } else { levels[0] },
        other => panic!("{other}"),
    }
}

/// What a gate's recipe computes.
fn computed(recipe: &Recipe, inputs: u32) -> bool {
    let mut outputs: Vec<bool> = Vec::new();
    let level = |outputs: &[bool], source: &Source| match *source {
        Source::Input(pin) => inputs >> pin & 1 == 1,
        Source::Stage(stage, _) => outputs[stage],
        Source::Constant(level) => level,
    };
    for stage in &recipe.stages {
        let levels: Vec<bool> = stage
            .sources
            .iter()
            .map(|source| level(&outputs, source))
            .collect();
        outputs.push(stage_output(&stage.drives[0].name, &levels));
    }
    level(&outputs, &recipe.outputs[0])
}

fn flip_flops() -> String {
    let plain = "next_state : \"D\"; clocked_on : \"!CKN\"; clear : \"!RN\";";
    let both = "next_state : \"D\"; clocked_on : \"CK\"; clear : \"R\"; preset : \"!SN\"; clear_preset_var1 : H;";
    flip_flop_text("DN_1", plain, &["D", "CKN", "RN"], &[("Q", "IQ")])
        + &flip_flop_text("DSR_1", both, &["SN", "R", "CK", "D"], &[("QB", "IQN")])
        + &flip_flop_text(
            "SCAN",
            "next_state : \"(D !SE) + (SI SE)\"; clocked_on : \"CK\"; clear : \"!RN\";",
            &["D", "SE", "SI", "CK", "RN"],
            &[("Q", "IQ")],
        )
}

#[test]
fn every_gate_is_made_from_few_cells() {
    let inverter = gate_text("INV_1", 1.0, &["A"], "!A");
    let sets = [
        gate_text("NAND_1", 2.0, &["X", "W"], "(X W)'"),
        gate_text("NOR_1", 2.0, &["A", "B"], "!(A + B)")
            + &gate_text("NAND_1", 9.0, &["A", "B"], "!(A*B)"),
        gate_text("NOR_1", 2.0, &["A", "B"], "!(A + B)"),
        gate_text("OR_1", 2.0, &["A", "B"], "A + B")
            + &gate_text("NAND_1", 2.0, &["X", "W"], "(X W)'"),
        gate_text("AND_1", 2.0, &["A", "B"], "A B")
            + &gate_text("XNOR_1", 3.0, &["A", "B"], "!(A ^ B)")
            + &gate_text("IMUX_1", 3.0, &["A", "B", "S"], "!((A !S) + (B S))"),
        gate_text("NAND_1", 2.0, &["A", "B"], "!(A B)")
            + &gate_text("XNOR_1", 3.0, &["A", "B"], "!(A ^ B)")
            + &gate_text("IMUX_1", 3.0, &["S", "B", "A"], "!((A !S) + (B S))")
            + &gate_text("AOI_1", 0.1, &["A", "B", "C"], "!(A B + C)"),
    ];
    for set in sets {
        let map = map(&(inverter.clone() + &set + &flip_flops()), &[]).unwrap();
        for kind in CellKind::ALL
            .into_iter()
            .filter(|kind| !kind.is_flip_flop())
        {
            let (recipe, function) = (map.recipe(kind), gate_function(kind));
            for inputs in 0..1 << function.inputs {
                assert_eq!(
                    computed(recipe, inputs),
                    function.value(inputs),
                    "{} {inputs}",
                    kind.name()
                );
            }
        }
    }
}

#[test]
fn wanted_cells_are_taken_and_must_do_what_is_wanted() {
    let gates = gate_text("INV_1", 1.0, &["A"], "!A")
        + &gate_text("INV_4", 3.0, &["A"], "!A")
        + &gate_text("NAND_1", 2.0, &["A", "B"], "!(A B)")
        + &flip_flops();
    let wanted = |kind, name: &str| [(kind, name.to_owned())];
    let usual = map(&gates, &[]).unwrap();
    assert_eq!(usual.recipe(CellKind::Inv).stages[0].drives.len(), 2);
    let own = map(&gates, &wanted(CellKind::Inv, "INV_4")).unwrap();
    assert_eq!(own.cells(CellKind::Inv), ["INV_4"]);
    let own = map(&gates, &wanted(CellKind::Dffr, "DN_1")).unwrap();
    assert_eq!(
        own.cells(CellKind::Dffr),
        ["INV_1", "INV_1", "DN_1", "INV_1"]
    );
    let fault = map(&gates, &wanted(CellKind::Nor2, "NAND_1")).unwrap_err();
    assert!(
        fault
            .to_string()
            .contains("NAND_1 that does what NOR2 does"),
        "{}",
        fault
    );
    let fault = map(&gate_text("INV_1", 1.0, &["A"], "!A"), &[]).unwrap_err();
    assert!(fault.to_string().contains("nothing to make a"), "{}", fault);
}

/// Leakage, area and loads, in every unit that a file may have.
#[test]
fn units_of_leakage_and_load_are_those_of_the_file() {
    let cells = enough_cells().replacen("area : 1;", "area : 1; cell_leakage_power : 2;", 1);
    let read = |unit: &str, load: &str| {
        let unit = format!("leakage_power_unit : \"{unit}\"; capacitive_load_unit {load};");
        let head = HEAD.replace("capacitive_load_unit (1, pf);", &unit);
        Liberty::read(&format!("{head}{cells}}}"), &[])
    };
    for (unit, watts) in [
        ("1pW", 1e-12),
        ("10pW", 1e-11),
        ("100pW", 1e-10),
        ("1nW", 1e-9),
        ("100nW", 1e-7),
        ("1uW", 1e-6),
        ("1mW", 1e-3),
        ("1W", 1.0),
    ] {
        let library = read(unit, "(1, pf)").unwrap();
        let found = library.map.recipe(CellKind::Inv).stages[0].drives[0].leakage_w;
        assert!(
            (found / (2.0 * watts) - 1.0).abs() < 1e-12,
            "{unit}: {found}"
        );
        assert_eq!(
            [CellKind::Inv, CellKind::Nand2].map(|kind| library.area(kind)),
            [1.0, 2.0]
        );
    }
    assert!(
        read("1nA", "(1, pf)")
            .unwrap_err()
            .to_string()
            .contains("\"1nA\"")
    );
    let loads = ["(10, ff)", "(1, pf)"].map(|load| {
        let library = read("1nW", load).unwrap();
        library.map.recipe(CellKind::Inv).stages[0].drives[0].inputs[0].load_ff[0]
    });
    assert!(
        (loads[0] - 0.1).abs() < 1e-12 && (loads[1] - 10.0).abs() < 1e-12,
        "{loads:?}"
    );
}

/// Drives are told by their tables, whatever they are called and however pins are listed. A cell that is larger but no stronger is none.
#[test]
fn drives_are_ordered_by_their_tables() {
    let with_area = |name: &str, strength: f64, area: f64| {
        let text = gate_text(name, strength, &["A"], "!A");
        text.replace(&format!("area : {strength};"), &format!("area : {area};"))
    };
    for names in [
        ["inv_x1_w13_svt", "inv_x2_w13_svt", "inv_x4_w13_svt"],
        ["INVxp5_75t_R", "INVx1_75t_R", "INVx1p5_75t_R"],
        ["C", "B", "A"],
        ["INV_1", "INV_2", "INV_4"],
    ] {
        let [one, two, four] = names;
        let cells = gate_text(four, 4.0, &["A"], "!A")
            + &gate_text(one, 1.0, &["A"], "!A")
            + &with_area("DELAY", 1.0, 3.0)
            + &with_area("LARGE", 3.9, 8.0)
            + &gate_text("OTHER", 6.0, &["X"], "!X")
            + &gate_text(two, 2.0, &["A"], "!A")
            + &gate_text("NANDxp5", 1.0, &["A", "B"], "!(A B)")
            + &gate_text("NANDx1", 2.0, &["B", "A"], "!(A B)")
            + &flip_flops();
        let map = map(&cells, &[]).unwrap();
        let drives = |kind: CellKind| {
            let drives = map.recipe(kind).stages[0].drives.iter();
            drives.map(|drive| drive.name.as_str()).collect::<Vec<_>>()
        };
        assert_eq!(drives(CellKind::Inv), names);
        assert_eq!(drives(CellKind::Nand2), ["NANDxp5", "NANDx1"]);
    }
}

/// Files of one kit are one library, each in its own units.
#[test]
fn several_files_are_one_library() {
    let head = |name: &str, more: &str| {
        HEAD.replace("library (few)", &format!("library ({name})"))
            .replace("capacitive_load_unit (1, pf);", more)
    };
    let inverters = gate_text("INV_1", 1.0, &["A"], "!A");
    let others = gate_text("NAND_1", 2.0, &["A", "B"], "!(A B)") + &flip_flops();
    let pf = "capacitive_load_unit (1, pf); nom_voltage : 1.1;";
    let ff = "capacitive_load_unit (1, ff); time_unit : \"1ps\"; nom_voltage : 1.1;";
    let first = head("first", pf) + &inverters + "}";
    let second = head("second", ff) + &others + "}";
    let read =
        |second: &str| Liberty::read_files(&[("first.lib", &first), ("second.lib", second)], &[]);
    let library = read(&second).unwrap();
    assert_eq!(
        (library.name.as_str(), library.cells),
        ("first and 1 more files", 5)
    );
    let load = |kind: CellKind| library.map.recipe(kind).stages[0].drives[0].inputs[0].load_ff[0];
    assert!(
        (load(CellKind::Inv) - 10.0).abs() < 1e-9 && (load(CellKind::Nand2) - 0.01).abs() < 1e-12
    );
    let place = &library.map.recipe(CellKind::Nand2).stages[0].drives[0].place;
    assert_eq!(place, "second.lib:2");
    for (text, line, says) in [
        (
            second.replace("nom_voltage : 1.1", "nom_voltage : 0.9"),
            1,
            "give files of one corner",
        ),
        (
            second.replace("NAND_1", "INV_1"),
            2,
            "the cell INV_1 is in first.lib as well",
        ),
        (
            second.replace("time_unit : \"1ps\"", "time_unit : \"1\""),
            1,
            "time_unit",
        ),
        ("library (x) {".to_owned(), 1, "no closing brace"),
    ] {
        let fault = read(&text).unwrap_err();
        assert_eq!((fault.file, fault.error.line), (1, line), "{fault}");
        assert!(fault.to_string().contains(says), "{fault}");
    }
}
