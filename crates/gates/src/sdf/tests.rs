//! Round trips, what files may say, and what is refused.

use proptest::prelude::*;

use super::*;
use crate::netlist::{
    CellId, CellKind, Library, ModuleBuilder, Netlist, OwnDelay, ScopeId, Timing,
};
use crate::units::Time;

/// An inverter and a module of one cell of every kind, twice.
pub(super) fn design() -> Netlist {
    let mut m = ModuleBuilder::new("leaf");
    let inputs: Vec<_> = ["A", "B", "C", "D"].map(|n| m.input(n)).into();
    for (i, kind) in CellKind::ALL.into_iter().enumerate() {
        let outputs: Vec<_> = (0..kind.outputs().len())
            .map(|o| m.wire(&format!("z{i}_{o}")))
            .collect();
        let name = kind.name().to_lowercase();
        m.cell(&name, kind, &inputs[..kind.inputs().len()], &outputs);
    }
    let leaf = m.finish().unwrap();
    let mut m = ModuleBuilder::new("chip");
    let a = m.input("A");
    let z = m.output("Z");
    m.cell("first", CellKind::Inv, &[a], &[z]);
    for name in ["u1", "u2"] {
        m.instance(
            name,
            &leaf,
            &[("A", &[z]), ("B", &[a]), ("C", &[a]), ("D", &[a])],
        );
    }
    Netlist::elaborate(&m.finish().unwrap())
}

pub(super) fn nominal(netlist: &Netlist, corner: Corner) -> Timing {
    Timing::nominal(netlist, &Library::generic_40nm(), corner)
}

/// Compares the pins that cells have.
fn same(netlist: &Netlist, a: &Timing, b: &Timing) -> bool {
    let mut cells = netlist.cells_below(ScopeId::TOP).zip(netlist.cells());
    cells.all(|(cell, flat)| {
        let (inputs, outputs) = (flat.kind.inputs().len(), flat.kind.outputs().len());
        let pins = (0..inputs).flat_map(|input| (0..outputs).map(move |output| (input, output)));
        pins.into_iter()
            .all(|(i, o)| a.cell_delays(cell)[i][o] == b.cell_delays(cell)[i][o])
    })
}

pub(super) fn export(netlist: &Netlist, corners: [&Timing; 3], options: SdfOptions) -> String {
    let mut out = Vec::new();
    write_sdf(&mut out, netlist, corners, options).unwrap();
    String::from_utf8(out).unwrap()
}

pub(super) fn file(body: &str) -> String {
    format!("(DELAYFILE (SDFVERSION \"3.0\") (DIVIDER /)\n(TIMESCALE 1ps)\n{body})")
}

/// `body` annotated in the typical corner, and delays (rise, fall; fs) of one pin of a cell.
pub(super) fn annotated(body: &str) -> Result<(Netlist, Timing, Annotation), SdfError> {
    let netlist = design();
    let mut timing = nominal(&netlist, Corner::Typ);
    let text = file(body);
    let sdf = Sdf::parse("a.sdf", &text)?;
    let result = annotate(&mut timing, &netlist, &sdf, Corner::Typ)?;
    Ok((netlist, timing, result))
}

fn arc(body: &str, path: &str, pin: usize) -> (u32, u32) {
    arc_to(body, path, (pin, 0))
}

/// Rise and fall of the arc from an input pin to an output pin.
fn arc_to(body: &str, path: &str, (pin, output): (usize, usize)) -> (u32, u32) {
    let (netlist, timing, _) = annotated(body).unwrap();
    let path = format!("chip.{path}");
    let mut cells = netlist.cells_below(ScopeId::TOP);
    let cell = cells.find(|&c| netlist.cell_path(c) == path).unwrap();
    let arc = timing.cell_delays(cell)[pin][output];
    (arc.rise_fs, arc.fall_fs)
}

fn inv(delays: &str) -> String {
    format!("(CELL (CELLTYPE \"INV\") (INSTANCE u1/inv) (DELAY {delays}))")
}

#[test]
fn one_value_serves_both_directions_and_missing_ones_change_nothing() {
    let inverter_arc = |delays: &str| {
        arc(
            &inv(&format!("(ABSOLUTE (IOPATH A Z {delays}))")),
            "u1.inv",
            0,
        )
    };
    assert_eq!(inverter_arc("(0.12:0.15:0.2)"), (150, 150));
    assert_eq!(inverter_arc("(0.12::0.2)"), (21_013, 18_979));
    assert_eq!(inverter_arc("() (1e1)"), (21_013, 10_000));
    assert_eq!(inverter_arc("((1:2:3) (4:5:6)) (7) (8)"), (2_000, 7_000));
    let twice = "(ABSOLUTE (IOPATH A Z (1) (2))) (INCREMENT (IOPATH A Z (0.5) (-1)))";
    assert_eq!(arc(&inv(twice), "u1.inv", 0), (1_500, 1_000));
    let increment = "(INCREMENT (IOPATH A Z (1)))";
    assert_eq!(arc(&inv(increment), "u1.inv", 0), (22_013, 19_979));
}

#[test]
fn wildcards_reach_every_instance_and_paths_only_theirs() {
    let every = "(CELL (CELLTYPE \"INV\") (INSTANCE *) (DELAY (ABSOLUTE (IOPATH A Z (1)))))";
    for path in ["first", "u1.inv", "u2.inv"] {
        assert_eq!(arc(every, path, 0), (1_000, 1_000));
    }
    let escaped = inv("(ABSOLUTE (IOPATH A Z (1)))").replace("u1/inv", "u\\1/in\\v");
    assert_eq!(arc(&escaped, "u1.inv", 0), (1_000, 1_000));
    assert_eq!(arc(&escaped, "u2.inv", 0), (21_013, 18_979));
}

#[test]
fn a_flip_flop_has_an_arc_to_each_output() {
    let body = "(CELL (CELLTYPE \"DFFR\") (INSTANCE u1/dffr) (DELAY (INCREMENT
        (IOPATH (posedge CK) Q (1)) (IOPATH (posedge CK) QN (2)) (IOPATH R Q (1)))))";
    let (ck, r, q, qn) = (1, 2, 0, 1);
    let to = |pins| arc_to(body, "u1.dffr", pins);
    assert_eq!(
        [to((ck, q)), to((ck, qn))],
        [(76_311, 76_311), (77_311, 77_311)]
    );
    assert_eq!(
        [to((r, q)), to((r, qn))],
        [(82_043, 82_043), (81_043, 81_043)]
    );
    let result = annotated(body).unwrap().2;
    assert_eq!((result.arcs, result.notes), (3, vec![]));
    let device = |output: &str| {
        format!("(CELL (CELLTYPE \"DFFR\") (INSTANCE *) (DELAY (ABSOLUTE (DEVICE {output} (1)))))")
    };
    let qn_alone = device("QN");
    assert_eq!(arc_to(&qn_alone, "u1.dffr", (ck, qn)), (1_000, 1_000));
    assert_eq!(arc_to(&qn_alone, "u1.dffr", (ck, q)), (75_311, 75_311));
    assert_eq!(arc_to(&device(""), "u1.dffr", (r, q)), (1_000, 1_000));
    let wire = "(CELL (CELLTYPE \"DFFR\") (INSTANCE *) (DELAY (ABSOLUTE (PORT CK (1)))))";
    assert_eq!(
        [q, qn].map(|output| arc_to(wire, "u1.dffr", (ck, output))),
        [(76_311, 76_311); 2]
    );
}

/// The edge of an input decides which edge of the output its delay is of; of two for one edge the longer counts, and that is said.
#[test]
fn delays_by_edge_go_where_the_edge_leads() {
    let cell = |kind: &str, path: &str| {
        format!(
            "(CELL (CELLTYPE \"{kind}\") (INSTANCE u1/{path}) (DELAY (ABSOLUTE
            (IOPATH (posedge A) Z (1) (2)) (IOPATH (negedge A) Z (3) (4)))))"
        )
    };
    for (kind, path, delays, notes) in [
        ("INV", "inv", (3_000, 2_000), 0),
        ("AND2", "and2", (1_000, 4_000), 0),
        ("XOR2", "xor2", (3_000, 4_000), 1),
    ] {
        let body = cell(kind, path);
        assert_eq!(arc(&body, &format!("u1.{path}"), 0), delays, "{kind}");
        assert_eq!(annotated(&body).unwrap().2.notes.len(), notes, "{kind}");
    }
}

#[test]
fn stages_of_a_chain_add_up_to_its_cell() {
    let mut m = ModuleBuilder::new("chip");
    let (a, z) = (m.input("A"), m.output("Z"));
    m.cell_with_delay(
        "line",
        CellKind::Buf,
        &[a],
        &[z],
        OwnDelay::wire(Time::from_fs(2_600_001)),
    );
    let netlist = Netlist::elaborate(&m.finish().unwrap());
    let nominal = |corner| Timing::nominal(&netlist, &Library::generic_40nm(), corner);
    let delay = |body: &str| {
        let mut timing = nominal(Corner::Typ);
        let text = file(body);
        annotate(
            &mut timing,
            &netlist,
            &Sdf::parse("a.sdf", &text)?,
            Corner::Typ,
        )?;
        let arc = timing.cell_delays(CellId::new(0))[0][0];
        Ok::<_, SdfError>((arc.rise_fs, arc.fall_fs))
    };
    let stage = |number: u32, cell_type: &str, entry: &str| {
        let delays = format!("(DELAY {entry})");
        delay(&format!(
            "(CELL (CELLTYPE \"{cell_type}\") (INSTANCE line/s{number}) {delays})"
        ))
    };
    let of_line = "STAGE_2600001_53";
    // A stage is 49.056 ps: 2600.001 by 53, rounded down.
    let fixed = "(ABSOLUTE (IOPATH A Z (100) (10)))";
    assert_eq!(stage(0, of_line, fixed).unwrap(), (2_650_945, 2_560_945));
    let more = "(INCREMENT (IOPATH A Z (1)))";
    assert_eq!(stage(52, of_line, more).unwrap(), (2_601_001, 2_601_001));
    let whole = "(CELL (CELLTYPE \"BUF\") (INSTANCE line) (DELAY (ABSOLUTE (IOPATH A Z (7)))))";
    assert_eq!(delay(whole).unwrap(), (7_000, 7_000));
    for (number, cell_type, entry, says) in [
        (53, of_line, fixed, "no instance line.s53"),
        (1, "BUF", fixed, "is a STAGE_2600001_53 and no BUF"),
        (1, of_line, "(ABSOLUTE (PORT A (1)))", "has one path"),
        (
            1,
            of_line,
            "(INCREMENT (IOPATH A Z (-3000)))",
            "between 0 and 4.29",
        ),
    ] {
        let said = stage(number, cell_type, entry).unwrap_err().to_string();
        assert!(said.contains("a.sdf:") && said.contains(says), "{said}");
    }
}

#[test]
fn wires_are_added_to_the_arcs_their_edges_cause() {
    let body = format!(
        "(CELL (CELLTYPE \"chip\") (INSTANCE) (DELAY (ABSOLUTE
           (INTERCONNECT first/Z u1/inv/A (1) (2)) (INTERCONNECT first/Z u1/xor2/A (1) (2))
           (INTERCONNECT first/Z Z (9)) (INTERCONNECT A u1/dffr/CK (5) (6))
           (INTERCONNECT first/Z u1/dffr/D (7)))))\n{}",
        inv("(ABSOLUTE (IOPATH A Z (10)))")
    );
    assert_eq!(
        arc(&body, "u1.inv", 0),
        (12_000, 11_000),
        "an inverter inverts"
    );
    assert_eq!(arc(&body, "u1.xor2", 0), (60_067, 59_041));
    assert_eq!(arc(&body, "u1.dffr", 1), (80_311, 80_311));
    let result = annotated(&body).unwrap().2;
    assert_eq!((result.arcs, result.wires, result.notes.len()), (1, 3, 3));
    assert_eq!(result.longest_wire_to_d, Time::from_ps(7));
    let port = inv("(ABSOLUTE (PORT A (3)))");
    assert_eq!(arc(&port, "u1.inv", 0), (24_013, 21_979));
}

#[test]
fn what_is_not_modelled_is_counted() {
    let text = file(
        "(CELL (CELLTYPE \"XOR2\") (INSTANCE u1/xor2)
          (DELAY (PATHPULSE A Z (1)) (ABSOLUTE (COND B==1'b0 && (A|B) (IOPATH A Z (1)))
            (IOPATH B Z (RETAIN (1) (2)) (1) (2) (3))))
          (TIMINGCHECK (WIDTH (posedge A) (1:2:3)) (PERIOD A (3)) (SETUPHOLD B (negedge A) (-1) (2))
            (HOLD (COND B A) (posedge B) (2)) (SETUP A B (1) ) ))",
    );
    let sdf = Sdf::parse("a.sdf", &text).unwrap();
    let counts: Vec<_> = sdf
        .skipped
        .iter()
        .map(|s| (s.what.name(), s.count))
        .collect();
    assert_eq!(
        counts,
        [
            ("PATHPULSE", 1),
            ("COND", 2),
            ("RETAIN", 1),
            ("transitions to and from Z", 1),
            ("PERIOD", 1)
        ]
    );
    let checks = &sdf.cells[0].checks;
    assert_eq!(checks.len(), 3);
    assert_eq!(
        checks[1].limits,
        [-1, 2].map(|ps| Triple::fixed(Time::from_ps(ps)))
    );
}

/// One delay of four is zero (an increment of zero is none), and a cell's arc is given again by two entries.
#[test]
fn suspect_delays_are_counted() {
    let cell = |path: &str, delays: &str| {
        format!("(CELL (CELLTYPE \"INV\") (INSTANCE {path}) (DELAY {delays}))\n")
    };
    let text = file(
        &[
            cell("a", "(ABSOLUTE (IOPATH A Y (0) (0)))"),
            cell("b", "(ABSOLUTE (IOPATH A Y (0) (7)))"),
            cell("b", "(INCREMENT (IOPATH A Y (0) (0)))"),
            cell("c", "(ABSOLUTE (IOPATH A Y () ()))"),
            cell("a", "(ABSOLUTE (IOPATH A Y (5) (6)))"),
            cell("a", "(ABSOLUTE (IOPATH A Y (6) (7)))"),
        ]
        .concat(),
    );
    let found = suspect_delays(&Sdf::parse("a.sdf", &text).unwrap(), Corner::Typ);
    let first = text
        .lines()
        .position(|line| line.contains("INSTANCE a"))
        .unwrap()
        + 1;
    let zeros = SuspectDelay::Zeros {
        zeros: 1,
        arcs: 4,
        line: first,
    };
    let SuspectDelay::Twice {
        before,
        entries,
        line,
    } = found[1]
    else {
        panic!("{found:?}");
    };
    assert_eq!(found[0], zeros);
    assert_eq!((before, entries, line), (first, 2, first + 4));
}

#[test]
fn mistakes_are_named_with_line_and_cure() {
    let cell = |body: &str| file(&inv(body));
    for (text, line, says) in [
        (String::new(), 1, "the end of the file"),
        ("(VERILOG)".into(), 1, "DELAYFILE"),
        (file("(TIMESCALE 3ps)"), 3, "3ps"),
        (file("(DIVIDER :)"), 3, "divider"),
        (file("(COLOUR 1)"), 3, "COLOUR"),
        (file("/* /* */"), 3, "comment"),
        (file("(DESIGN \"x)"), 3, "quoted"),
        (cell("(ABSOLUTE (IOPATH A Z))"), 3, "no value"),
        (cell("(ABSOLUTE (IOPATH A Z (1:2)))"), 3, "two numbers"),
        (cell("(ABSOLUTE\n(IOPATH A Z (x)))"), 4, "a number"),
        (cell("(ABSOLUTE\n(IOPATH A Z (inf)))"), 4, "a number"),
        (cell("(ABSOLUTE (IOPATH A Z (-1)))"), 3, "negative"),
        (cell("(ABSOLUTE (IOPATH A Z (1e99)))"), 3, "4.29"),
        (cell("(INCREMENT\n(IOPATH A Z (-99)))"), 4, "-77987"),
        (cell("(ABSOLUTE\n(IOPATH B Z (1)))"), 4, "no input pin B"),
        (cell("(ABSOLUTE (IOPATH A Q (1)))"), 3, "no output pin Q"),
        (
            cell("(ABSOLUTE (INTERCONNECT A Z (1)))"),
            3,
            "no wires inside",
        ),
        (cell("").replace("u1", "u9"), 3, "no instance u9"),
        (
            file("(CELL (CELLTYPE \"INV\") (INSTANCE first) (TIMINGCHECK\n(WIDTH A (1))))"),
            4,
            "INV has no timing checks",
        ),
        (
            file("(CELL (CELLTYPE \"DFFR\") (INSTANCE *) (TIMINGCHECK\n(SETUP E CK (1))))"),
            4,
            "no input pin E",
        ),
        (cell("").replace("INV", "BUF"), 3, "no BUF"),
        (
            cell("").replace("u1/inv", "*").replace("INV", "FOO"),
            3,
            "no cell FOO",
        ),
        (
            cell("(ABSOLUTE (IOPATH A Z (1)))")
                .replace("INV", "leaf")
                .replace("u1/inv", "u1"),
            3,
            "is a module",
        ),
        (
            file(
                "(CELL (CELLTYPE \"chip\") (INSTANCE) (DELAY (ABSOLUTE (INTERCONNECT A u1/inv/A (1)))))",
            ),
            3,
            "not connected",
        ),
        (
            file("(CELL (CELLTYPE \"chip\") (INSTANCE) (DELAY (ABSOLUTE (INTERCONNECT A Y (1)))))"),
            3,
            "neither",
        ),
        (
            file(
                "(CELL (CELLTYPE \"DFFR\") (INSTANCE u1/dffr) (DELAY (ABSOLUTE (IOPATH D Q (1)))))",
            ),
            3,
            "changes no output",
        ),
        (
            file(
                "(CELL (CELLTYPE \"DFFR\") (INSTANCE u1/dffr) (DELAY (ABSOLUTE (IOPATH (negedge CK) Q (1)))))",
            ),
            3,
            "changes no output",
        ),
    ] {
        let netlist = design();
        let mut timing = nominal(&netlist, Corner::Typ);
        let error = Sdf::parse("a.sdf", &text)
            .and_then(|sdf| annotate(&mut timing, &netlist, &sdf, Corner::Typ))
            .expect_err(&text);
        assert_eq!(error.line, line, "{text}: {error}");
        let message = error.fault.to_string();
        assert!(
            message.contains(says) && message.contains(';'),
            "{text}: {error}"
        );
    }
}

#[test]
fn nominal_delays_come_back_exactly_in_every_corner() {
    let netlist = design();
    let [min, typ, max] = Corner::ALL.map(|c| nominal(&netlist, c));
    let text = export(&netlist, [&min, &typ, &max], SdfOptions::default());
    let sdf = Sdf::parse("a.sdf", &text).unwrap();
    for (corner, wanted) in Corner::ALL.into_iter().zip([&min, &typ, &max]) {
        let mut timing = nominal(&netlist, corner);
        annotate(&mut timing, &netlist, &sdf, corner).unwrap();
        assert!(
            timing == *wanted,
            "nothing differs, so nothing gets a set of its own"
        );
        // From other delays as well.
        let mut timing = nominal(&netlist, Corner::Slow);
        annotate(&mut timing, &netlist, &sdf, corner).unwrap();
        assert!(same(&netlist, &timing, wanted));
    }
}

fn randomised(netlist: &Netlist, corner: Corner, values: &[u32]) -> Timing {
    let mut timing = nominal(netlist, corner);
    let mut values = values.iter().cycle().copied();
    for (id, cell) in netlist.cells_below(ScopeId::TOP).zip(netlist.cells()) {
        let mut delays = *timing.cell_delays(id);
        for pin in (0..cell.kind.inputs().len()).filter(|&pin| cell.kind.triggers(pin)) {
            for delay in &mut delays[pin][..cell.kind.outputs().len()] {
                delay.rise_fs = values.next().unwrap();
                delay.fall_fs = values.next().unwrap();
            }
        }
        timing.set(id, delays);
    }
    timing
}

proptest! {
    #[test]
    fn delays_of_every_instance_come_back_exactly(
        values in proptest::collection::vec(proptest::num::u32::ANY, 1..200),
        slash: bool,
        fs: bool,
    ) {
        let netlist = design();
        let options = SdfOptions {
            divider: if slash { SdfDivider::Slash } else { SdfDivider::Dot },
            timescale: if fs { SdfTimescale::Fs } else { SdfTimescale::Ps },
            ..SdfOptions::default()
        };
        let [min, typ, max] = [0, 1, 2].map(|skip| {
            let shifted: Vec<u32> = values.iter().map(|v| v.wrapping_mul(skip * 2 + 1)).collect();
            randomised(&netlist, Corner::Typ, &shifted)
        });
        let text = export(&netlist, [&min, &typ, &max], options);
        let sdf = Sdf::parse("a.sdf", &text).unwrap();
        for (corner, wanted) in Corner::ALL.into_iter().zip([&min, &typ, &max]) {
            let mut timing = nominal(&netlist, Corner::Typ);
            let result = annotate(&mut timing, &netlist, &sdf, corner).unwrap();
            prop_assert!(same(&netlist, &timing, wanted));
            prop_assert!(result.notes.is_empty());
        }
    }

    #[test]
    fn garbage_never_panics(text in "(\\(DELAYFILE )?[-()/*:\"\\\\a-zA-Z0-9. \n\\PC]{0,200}") {
        let _ = Sdf::parse("g", &text);
    }

    #[test]
    fn mutated_files_never_panic(
        cuts in proptest::collection::vec((any::<prop::sample::Index>(), 0usize..12, "[-()/*:\" 0-9\\\\aZ\u{e9}]{0,6}"), 1..4),
    ) {
        let netlist = design();
        let typ = nominal(&netlist, Corner::Typ);
        let mut text: Vec<char> = export(&netlist, [&typ; 3], SdfOptions::default()).chars().collect();
        for (at, length, insert) in cuts {
            let start = at.index(text.len());
            let end = (start + length).min(text.len());
            text.splice(start..end, insert.chars());
        }
        let text: String = text.into_iter().collect();
        let mut timing = typ.clone();
        if let Ok(sdf) = Sdf::parse("g", &text) {
            let _ = annotate(&mut timing, &netlist, &sdf, Corner::Typ);
        }
    }
}
