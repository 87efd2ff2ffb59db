//! Recipes compute what their kind does, whatever a library has and lacks.

use super::*;
use crate::netlist::liberty::group::read;

const UNITS: Units = Units {
    time_fs: 1e6,
    load_ff: 1e3,
    energy_fj: 1e3,
};

fn gate_text(name: &str, area: f64, inputs: &[&str], function: &str) -> String {
    let pins = inputs
        .iter()
        .map(|pin| format!("pin ({pin}) {{ direction : input; }} "));
    format!(
        "cell ({name}) {{ area : {area}; {} pin (Y) {{ direction : output; function : \"{function}\"; }} }}\n",
        pins.collect::<String>()
    )
}

fn flip_flop_text(name: &str, group: &str, inputs: &[&str], outputs: &[(&str, &str)]) -> String {
    let inputs = inputs
        .iter()
        .map(|pin| format!("pin ({pin}) {{ direction : input; }} "));
    let outputs = outputs.iter().map(|(pin, shows)| {
        format!("pin ({pin}) {{ direction : output; function : \"{shows}\"; }} ")
    });
    let (inputs, outputs) = (inputs.collect::<String>(), outputs.collect::<String>());
    format!("cell ({name}) {{ area : 9; ff (IQ, IQN) {{ {group} }} {inputs}{outputs} }}\n")
}

fn map(cells: &str, wanted: &[(CellKind, String)]) -> Result<CellMap, LibertyError> {
    let text = format!("library (few) {{\n{cells}}}");
    let library = read(&text).unwrap();
    let candidates = library
        .of_kind("cell")
        .filter_map(|cell| Candidate::of(cell).unwrap());
    let candidates: Vec<_> = candidates.collect();
    let maker = Maker {
        candidates: &candidates,
        templates: &Templates::of(&library),
        units: UNITS,
        leakage_unit_w: 1e-9,
        wanted,
    };
    maker.make(&library)
}

/// A stage's output for levels at its pins: by the name of its cell, which says what it does here.
fn stage_output(name: &str, levels: &[bool]) -> bool {
    match name.split('_').next().unwrap() {
        "INV" => !levels[0],
        "BUF" => levels[0],
        "NAND" => !(levels[0] && levels[1]),
        "NOR" => !(levels[0] || levels[1]),
        "XNOR" => levels[0] == levels[1],
        // Pins S, B, A: an inverting multiplexer.
        "IMUX" => !if levels[0] { levels[1] } else { levels[2] },
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
                    function.at(inputs),
                    "{} {inputs}",
                    kind.name()
                );
            }
        }
    }
}

#[test]
fn flip_flops_of_other_edges_and_levels_get_inverters() {
    let gates =
        gate_text("INV_1", 4.0, &["A"], "!A") + &gate_text("NAND_1", 2.0, &["A", "B"], "!(A B)");
    let smaller_first = flip_flops().replacen("area : 9", "area : 8", 1);
    let map = map(&(gates + &smaller_first), &[]).unwrap();
    let dffr = map.recipe(CellKind::Dffr);
    // DSR_1 is larger and has a preset, but lacks two inverters less.
    assert_eq!(map.cells(CellKind::Dffr), ["DSR_1", "INV_1"]);
    assert_eq!(
        dffr.stages[0].sources,
        [
            Source::Constant(true),
            Source::Input(2),
            Source::Input(1),
            Source::Input(0)
        ]
    );
    assert_eq!(dffr.outputs, [Source::Stage(1, 0), Source::Stage(0, 0)]);
    assert_eq!(map.cells(CellKind::Dffsr), ["INV_1", "DSR_1", "INV_1"]);
    assert!(
        map.notes.iter().any(|note| note.contains("\"H\"")),
        "{:?}",
        map.notes
    );
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
        fault.message.contains("NAND_1 that does what NOR2 does"),
        "{}",
        fault.message
    );
    let fault = map(&gate_text("INV_1", 1.0, &["A"], "!A"), &[]).unwrap_err();
    assert!(
        fault.message.contains("nothing to make a"),
        "{}",
        fault.message
    );
}

/// Leakage, area and loads, in every unit that a file may have.
#[test]
fn units_of_leakage_and_load_are_those_of_the_file() {
    let inverter = gate_text("INV_1", 4.0, &["A"], "!A")
        .replacen("area : 4;", "area : 4; cell_leakage_power : 2;", 1)
        .replacen(
            "direction : input;",
            "direction : input; capacitance : 3;",
            1,
        );
    let cells = inverter + &gate_text("NAND_1", 2.0, &["A", "B"], "!(A B)") + &flip_flops();
    let read = |unit: &str, load: &str| {
        let unit = format!("leakage_power_unit : \"{unit}\"; capacitive_load_unit {load};");
        let text = format!("library (few) {{ time_unit : \"1ns\"; {unit}\n{cells}}}");
        crate::netlist::liberty::Liberty::read(&text, &[]).unwrap()
    };
    for (unit, watts) in [
        ("1pW", 1e-12),
        ("10pW", 1e-11),
        ("100pW", 1e-10),
        ("1nW", 1e-9),
        ("10nW", 1e-8),
        ("100nW", 1e-7),
        ("1uW", 1e-6),
        ("1mW", 1e-3),
    ] {
        let library = read(unit, "(1, pf)");
        let found = library.map.recipe(CellKind::Inv).stages[0].drives[0].leakage_w;
        assert!(
            (found / (2.0 * watts) - 1.0).abs() < 1e-12,
            "{unit}: {found}"
        );
        assert_eq!(
            [CellKind::Inv, CellKind::Nand2].map(|kind| library.area(kind)),
            [4.0, 2.0]
        );
    }
    let loads = ["(10, ff)", "(1, pf)"].map(|load| {
        let library = read("1nW", load);
        library.map.recipe(CellKind::Inv).stages[0].drives[0].inputs[0].load_ff
    });
    assert_eq!(loads, [[30.0; 2], [3000.0; 2]]);
}
