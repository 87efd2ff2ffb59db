//! What a user is told of a library: what is wrong with it, what would be enough, what it leaves out.

use super::*;

/// What is odd about a library, one sentence each.
pub(super) fn sentences(map: &CellMap) -> Vec<String> {
    map.remarks.iter().map(LibraryRemark::to_string).collect()
}

/// A cell without an arc that its function needs is passed over with its line; where no other does, the library is refused.
#[test]
fn cells_that_lack_something_are_refused_with_their_line() {
    let good = gate_text("INV_2", 2.0, &["A"], "!A");
    let rest = gate_text("NAND_1", 2.0, &["A", "B"], "!(A B)") + &flip_flops();
    let small = gate_text("INV_1", 1.0, &["A"], "!A");
    for (from, to, says) in [
        (
            "cell_fall",
            "cell_gone",
            "no delay and slew from the rise of A to the fall of Y",
        ),
        (
            "rise_transition",
            "gone",
            "no delay and slew from the fall of A to the rise of Y",
        ),
        ("timing ()", "gone ()", "no delay and slew"),
        (
            "related_pin : \"A\"",
            "related_pin : \"B\"",
            "no delay and slew",
        ),
        (
            "capacitance : 0.01",
            "drive : 1",
            "its pin A has no capacitance",
        ),
        (
            "capacitance : 0.01",
            "capacitance : -0.01",
            "capacitance of its pin A is -0.01",
        ),
        ("area : 1", "area : -1", "its area is -1"),
        (
            "values (\"0.02, 1.02",
            "values (\"0.02, 5000",
            "its cell_rise reaches 5.000 us",
        ),
        ("values (\"0.02, 1.02", "values (\"0.02, 1, 2", "3 values"),
        (
            "related_pin",
            "timing_type : combinatorial; related_pin",
            "\"combinatorial\" is not known",
        ),
        (
            "related_pin",
            "timing_sense : unate; related_pin",
            "timing_sense \"unate\" is not known",
        ),
        (
            "cell (INV_1)",
            "cell (\"INV 1\")",
            "Verilog can have no name like \"INV 1\"",
        ),
    ] {
        let bad = small.replacen(from, to, if from == "timing ()" { 9 } else { 1 });
        assert_ne!(bad, small);
        let found = map(&format!("\n{bad}{good}{rest}"), &[]).unwrap();
        assert_eq!(found.cells(CellKind::Inv), ["INV_2"], "{to}");
        let remarks = sentences(&found);
        let told = remarks.iter().find(|sentence| sentence.contains(says));
        let told = told.unwrap_or_else(|| panic!("{to}: {remarks:?}"));
        assert!(
            told.starts_with("line 3: INV") && told.contains("is not used"),
            "{told}"
        );
        let fault = map(&format!("\n{bad}{rest}"), &[]).unwrap_err();
        assert!(
            fault.to_string().contains("an inverter would be enough"),
            "{}",
            fault
        );
        assert!(fault.to_string().contains(says), "{fault}");
    }
    let bad = small.replacen("cell_fall", "gone", 1);
    let wanted = [(CellKind::Inv, "INV_1".to_owned())];
    let fault = map(&format!("\n{bad}{good}{rest}"), &wanted).unwrap_err();
    assert_eq!(fault.line, 3, "{fault}");
    // Flip-flops, by the pins that are used.
    let gates =
        gate_text("INV_1", 1.0, &["A"], "!A") + &gate_text("NAND_1", 2.0, &["A", "B"], "!(A B)");
    for (from, says) in [
        (
            "timing_type : falling_edge",
            "DN_1 is not used: it has no delay and slew from the fall of CKN",
        ),
        (
            "timing_type : clear",
            "DN_1 is not used: it has no delay and slew from the fall of RN",
        ),
    ] {
        let bad = flip_flops().replacen(from, "timing_type : skew_rising", 1);
        let found = map(
            &(gates.clone() + &bad),
            &[(CellKind::Dffr, "DN_1".to_owned())],
        );
        let message = found.unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
    }
}

#[test]
fn the_message_names_what_would_be_enough() {
    let inverter = gate_text("INV_1", 1.0, &["A"], "!A");
    let with_xor = inverter.clone()
        + &gate_text("AND_1", 2.0, &["A", "B"], "A B")
        + &gate_text("XOR_1", 2.0, &["A", "B"], "A ^ B");
    for (cells, kind, says) in [
        (String::new(), "INV", "an inverter"),
        (
            inverter.clone(),
            "NAND2",
            "a NAND, NOR, AND or OR of two inputs",
        ),
        (
            inverter.clone() + &gate_text("AND_1", 2.0, &["A", "B"], "A B"),
            "XOR2",
            "an exclusive OR or NOR, a NAND or a NOR of two inputs",
        ),
        (with_xor, "MUX2", "or a NAND or a NOR of two inputs"),
        (
            inverter + &gate_text("NOR_1", 2.0, &["A", "B"], "!(A + B)"),
            "DFFR",
            "a flip-flop with an asynchronous clear or preset",
        ),
    ] {
        let message = map(&cells, &[]).unwrap_err().to_string();
        let expected = format!("nothing to make a {kind} from; {says}");
        assert!(
            message.contains(&expected) || message.contains(says),
            "{message}"
        );
        assert!(
            message.contains(&format!("make a {kind} from")),
            "{message}"
        );
    }
}

/// What is not stated, or stated and not used, is told with the cells.
#[test]
fn what_is_missing_or_not_used_is_told() {
    let remarks = |cells: &str| sentences(&map(cells, &[]).unwrap()).join("\n");
    let told = remarks(&enough_cells());
    for says in [
        "no leakage is stated for INV_1, NAND_1, DSR_1; it counts as 0",
        "no internal_power is stated for INV_1, NAND_1, DSR_1; it counts as 0",
        "no limits of setup, hold, recovery, removal, clock high, clock low, control high are stated for DSR_1",
    ] {
        assert!(told.contains(says), "{told}");
    }
    assert!(!told.contains("no area"), "{told}");
    let power = "power_lut_template (three) { variable_1 : input_transition_time; variable_2 : total_output_net_capacitance; variable_3 : equal_or_opposite_output_net_capacitance; }\n";
    let cells = enough_cells()
        .replacen("area : 1;", "", 1)
        .replacen("function : \"!A\";", "function : \"!A\"; internal_power () { rise_power (three) { values (\"1\"); } }", 1)
        .replacen("pin (CK) { direction : input;", "pin (CK) { direction : input; min_period : 1; timing () { timing_type : setup_rising; related_pin : \"CK\"; rise_constraint (scalar) { values (\"0.1\"); } }", 1);
    let told = remarks(&format!("{power}{cells}"));
    for says in [
        "no area is stated for INV_1; it counts as 0",
        "internal_power that is no table over a slew and a load is not used, in INV_1",
        "the shortest period of the clock is not used, in DSR_1",
    ] {
        assert!(told.contains(says), "{told}");
    }
    // What is stated in groups, or by the library, is not missing.
    let stated = enough_cells().replace(
        "cell (INV_1) {",
        "cell (INV_1) { leakage_power () { value : 3; when : \"A\"; }",
    );
    let found = map(&stated, &[]).unwrap();
    assert_eq!(
        found.recipe(CellKind::Inv).stages[0].drives[0].leakage_w,
        3.0 * 1e-9
    );
    let told = sentences(&found).join("\n");
    assert!(!told.contains("leakage is stated for INV_1"), "{told}");
    let by_default = Liberty::read(
        &format!(
            "{HEAD} default_cell_leakage_power : 4; {}}}",
            enough_cells()
        ),
        &[],
    );
    let map = by_default.unwrap().map;
    assert_eq!(
        map.recipe(CellKind::Inv).stages[0].drives[0].leakage_w,
        4.0 * 1e-9
    );
    let told = sentences(&map).join("\n");
    assert!(!told.contains("leakage"), "{told}");
}

#[test]
fn what_a_library_leaves_unstated_or_says_twice_is_told() {
    let twice = enough_cells() + &gate_text("INV_1", 4.0, &["A"], "!A");
    let said = sentences(&map(&twice, &[]).unwrap());
    assert!(
        said.iter()
            .any(|said| said.contains("no time_unit is stated")),
        "{said:?}"
    );
    assert!(
        said.iter()
            .any(|said| said.starts_with("INV_1: a file has such a cell")),
        "{said:?}"
    );
    let text = HEAD.replace("{ cap", "{ time_unit : \"1ns\"; cap") + &enough_cells() + "}";
    let said = sentences(&Liberty::read(&text, &[]).unwrap().map).concat();
    assert!(
        !said.contains("time_unit") && !said.contains("more than once"),
        "{said}"
    );
}
