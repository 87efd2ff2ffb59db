//! Which flip-flop is taken, what is put around it, and what it does while set and reset are both active.

use super::sentences::sentences;
use super::*;

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
        // CK, D, R and SN.
        [
            Source::Input(1),
            Source::Input(0),
            Source::Input(2),
            Source::Constant(true)
        ]
    );
    assert_eq!(dffr.outputs, [Source::Stage(1, 0), Source::Stage(0, 0)]);
    // Its preset wins, so that it stands for the inverse state: D and the set are inverted, and Q is its QB.
    assert_eq!(
        map.cells(CellKind::Dffsr),
        ["INV_1", "INV_1", "DSR_1", "INV_1"]
    );
    let dffsr = map.recipe(CellKind::Dffsr);
    assert_eq!(
        dffsr.stages[2].sources,
        // CK, D, R and SN.
        [
            Source::Input(1),
            Source::Stage(0, 0),
            Source::Input(3),
            Source::Stage(1, 0)
        ]
    );
    assert_eq!(dffsr.outputs, [Source::Stage(2, 0), Source::Stage(3, 0)]);
}

/// Levels of Q and Q̄ of what stands for a DFFSR while set and reset are active, by the levels that a library states for its two states.
fn while_both_are_active(data: &str, levels: [&str; 2], outputs: &[(&str, &str)]) -> [bool; 2] {
    let states = format!(
        "next_state : \"{data}\"; clocked_on : \"CK\"; clear : \"R\"; preset : \"S\"; clear_preset_var1 : {}; clear_preset_var2 : {};",
        levels[0], levels[1]
    );
    let cell = flip_flop_text("BOTH_1", &states, &["CK", "D", "R", "S"], outputs);
    let wanted = [(CellKind::Dffsr, "BOTH_1".to_owned())];
    let map = map(&(enough_cells() + &cell), &wanted).unwrap();
    let recipe = map.recipe(CellKind::Dffsr);
    let (at, _) = recipe.flip_flop.unwrap();
    let level = |output: usize| {
        let name = &recipe.stages[at].drives[0].outputs[output].name;
        let (_, state) = outputs.iter().find(|(pin, _)| pin == name).unwrap();
        levels[usize::from(*state == "IQN")] == "H"
    };
    let shown = |source: &Source| match *source {
        Source::Stage(stage, output) if stage == at => level(output),
        Source::Stage(inverter, _) => match recipe.stages[inverter].sources[..] {
            [Source::Stage(stage, output)] if stage == at => !level(output),
            ref other => panic!("{other:?}"),
        },
        ref other => panic!("{other:?}"),
    };
    [shown(&recipe.outputs[0]), shown(&recipe.outputs[1])]
}

#[test]
fn reset_wins_over_set_whichever_the_library_lets_win() {
    let outputs: [&[(&str, &str)]; 3] = [
        &[("Q", "IQ"), ("QN", "IQN")],
        &[("Q", "IQ")],
        &[("QN", "IQN")],
    ];
    for outputs in outputs {
        for data in ["D", "!D"] {
            for levels in [["L", "H"], ["H", "L"], ["L", "L"], ["H", "H"]] {
                let found = while_both_are_active(data, levels, outputs);
                let case = format!("{outputs:?}, {data}, {levels:?}");
                assert_eq!(found, [false, true], "{case}");
            }
        }
    }
}

#[test]
fn a_scan_flip_flop_is_taken_where_there_is_no_other() {
    let gates =
        gate_text("INV_1", 1.0, &["A"], "!A") + &gate_text("NAND_1", 2.0, &["A", "B"], "!(A B)");
    let plain = flip_flop_text(
        "DR_1",
        "next_state : \"D\"; clocked_on : \"CK\"; clear : \"R\";",
        &["CK", "D", "R"],
        &[("Q", "IQ"), ("QN", "IQN")],
    );
    let scan = flip_flop_text(
        "SDRS_1",
        "next_state : \"(SE SI) + (!SE D)\"; clocked_on : \"CK\"; clear : \"R\"; preset : \"S\"; clear_preset_var1 : L;",
        &["CK", "D", "R", "S", "SE", "SI"],
        &[("Q", "IQ"), ("QN", "IQN")],
    );
    let unused = scan.replace("area : 9;", "area : 9; dont_use : true;");
    let in_capitals = unused.replace("true", "TRUE");
    let cases = [(&scan, false), (&unused, true), (&in_capitals, true)];
    for (set_and_reset, says_not_to_use) in cases {
        let found = map(&(gates.clone() + &plain + set_and_reset), &[]).unwrap();
        assert_eq!(found.cells(CellKind::Dffr), ["DR_1"]);
        assert_eq!(found.cells(CellKind::Dffsr), ["SDRS_1"]);
        let tied = Source::Constant(false);
        let inputs = [1, 0, 2, 3].map(Source::Input);
        let sources = [&inputs[..], &[tied, tied]].concat();
        assert_eq!(found.recipe(CellKind::Dffsr).stages[0].sources, sources);
        let remarks = sentences(&found);
        let told = |says: &str| remarks.iter().any(|sentence| sentence.contains(says));
        assert!(
            told("SDRS_1 with pins tied (SE = 0, SI = 0)"),
            "{remarks:?}"
        );
        assert_eq!(told("says not to use"), says_not_to_use, "{remarks:?}");
    }
    // A plain one is preferred, even if it is larger.
    let both = scan
        .replace("(SE SI) + (!SE D)", "D")
        .replace("SDRS_1", "DRS_1")
        .replace("area : 9", "area : 90");
    let both = both.replace("pin (SE)", "pin (SE1)");
    let found = map(&(gates.clone() + &plain + &scan + &both), &[]).unwrap();
    assert_eq!(
        found.cells(CellKind::Dffsr),
        ["SDRS_1"],
        "a pin without use is tied, too"
    );
    let plain_both = flip_flop_text(
        "DRS_1",
        "next_state : \"D\"; clocked_on : \"CK\"; clear : \"R\"; preset : \"S\"; clear_preset_var1 : L;",
        &["CK", "D", "R", "S"],
        &[("Q", "IQ"), ("QN", "IQN")],
    );
    let large = plain_both.replace("area : 9", "area : 90");
    let found = map(&(gates.clone() + &plain + &scan + &large), &[]).unwrap();
    assert_eq!(found.cells(CellKind::Dffsr), ["DRS_1"]);
    // The inverse state, as in a flip-flop that stores !D and shows it inverted: no inverters are needed.
    let inverse = flip_flop_text(
        "DQN_1",
        "next_state : \"!D\"; clocked_on : \"CK\"; clear : \"S\"; preset : \"R\"; clear_preset_var1 : L; clear_preset_var2 : L;",
        &["CK", "D", "R", "S"],
        &[("Q", "IQN")],
    );
    let found = map(&(gates + &inverse), &[]).unwrap();
    assert_eq!(found.cells(CellKind::Dffsr), ["DQN_1", "INV_1"]);
    let is_open = |remark: &LibraryRemark| matches!(remark, LibraryRemark::OpenState { .. });
    assert!(!found.remarks.iter().any(is_open), "{:?}", found.remarks);
}
