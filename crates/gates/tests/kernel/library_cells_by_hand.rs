//! Cells of `vectors/liberty/example.lib`, whose tables are straight lines (`make.py` beside it): delays, limits, energies, area and
//! leakage by hand.

use femtogate::kernel::{Drive, Kernel, Recorder, Stimulus};
use femtogate::liberty::{CharacterisedNetlist, Environment, Liberty};
use femtogate::logic::Logic;
use femtogate::netlist::{
    CellId, CellKind, CheckKind, Control, Edge, ModuleBuilder, Netlist, ScopeId,
};
use femtogate::units::Time;

/// Input capacitance of INV_1, pF.
const INVERTER_PF: f64 = 0.0008;

fn library() -> Liberty {
    Liberty::read(&text(), &[]).unwrap()
}

fn text() -> String {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../vectors/liberty/example.lib"
    );
    std::fs::read_to_string(path).unwrap()
}

/// One cell with its inputs A, B … and its output Z; and its slew at the inputs, ns.
fn alone(library: &Liberty, kind: CellKind) -> (Netlist, CharacterisedNetlist, f64) {
    let mut m = ModuleBuilder::new("alone");
    let names = ["A", "B", "C", "D"];
    let inputs: Vec<_> = kind
        .inputs()
        .iter()
        .zip(names)
        .map(|(_, name)| m.input(name))
        .collect();
    let z = m.output("Z");
    m.gate_into(kind, &inputs, z);
    let netlist = Netlist::elaborate(&m.finish().unwrap());
    let environment = Environment::new(library);
    let made = CharacterisedNetlist::new(&netlist, library, &environment);
    (netlist, made, environment.input_slew_fs * 1e-6)
}

fn assert_near(found: f64, by_hand: f64) {
    assert!(
        (found / by_hand - 1.0).abs() < 1e-3,
        "{found}, by hand {by_hand}"
    );
}

/// A NAND and an inverter stand for AND.
#[test]
fn delays_of_a_gate_of_two_cells() {
    let library = library();
    let (netlist, made, slew) = alone(&library, CellKind::And2);
    let [a, b, z] = ["A", "B", "Z"].map(|name| netlist.net(name).unwrap());
    let drives = [
        (0, a, Logic::Zero),
        (0, b, Logic::One),
        (2, a, Logic::One),
        (4, a, Logic::Zero),
    ];
    let drives = drives.map(|(ns, net, value)| Drive::new(Time::from_ns(ns), net, value));
    let mut seen = Recorder::new([a, b, z]);
    let mut kernel = Kernel::new(&netlist, &made.timing);
    kernel
        .run(
            &mut Stimulus::sorted(drives.to_vec()),
            Time::from_ns(3),
            &mut seen,
        )
        .unwrap();
    assert_eq!(kernel.number(&[a, b, z]), Some(0b111));
    kernel
        .run(
            &mut Stimulus::sorted(drives[3..].to_vec()),
            Time::from_ns(6),
            &mut seen,
        )
        .unwrap();
    assert_eq!(kernel.number(&[a, b, z]), Some(0b010));
    // The NAND's edge is the inverse one, and its slew what the inverter sees.
    let by_hand = |nand: f64, inverter: f64| {
        let between = 0.006 + 7.5 * nand * INVERTER_PF + 0.04 * slew;
        let delays = [
            nand * (0.009 + 4.2 * INVERTER_PF) + 0.18 * slew,
            inverter * 0.006 + 0.18 * between,
        ];
        delays[0] + delays[1]
    };
    for (found, start_ns, ns) in [
        (seen.rising_edges(z), 2, by_hand(0.94, 1.06)),
        (seen.falling_edges(z), 4, by_hand(1.06, 0.94)),
    ] {
        let last = *found.last().unwrap() - Time::from_ns(start_ns);
        assert_near(last.as_fs() as f64, ns * 1e6);
    }
    let numbers = [1, 3, 5].map(|ns| seen.number_at(&[a, b, z], Time::from_ns(ns)));
    assert_eq!(numbers, [0b010, 0b111, 0b010].map(Some));
    let at = [1, 3, 5].map(|ns| seen.value_at(z, Time::from_ns(ns)));
    assert_eq!(at, [Logic::Zero, Logic::One, Logic::Zero]);
    let (area, leakage_w) = made.silicon(&netlist, &library, ScopeId::TOP);
    assert_near(area, 1.0 + 0.7);
    assert_near(leakage_w, (0.5 + 0.35) * 1e-9);
}

/// D and CK lead to the library's flip-flop directly, R through an inverter.
#[test]
fn limits_of_a_flip_flop() {
    let library = library();
    let mut m = ModuleBuilder::new("alone");
    let (d, ck, r, q) = (m.input("D"), m.input("CK"), m.input("R"), m.output("Q"));
    let unused = m.wire("QN");
    m.cell("flip_flop", CellKind::Dffr, &[d, ck, r], &[q, unused]);
    let netlist = Netlist::elaborate(&m.finish().unwrap());
    let environment = Environment::new(&library);
    let slew = environment.input_slew_fs * 1e-6;
    let made = CharacterisedNetlist::new(&netlist, &library, &environment);
    let limits = made.timing.limits(CellId::new(0), CellKind::Dffr);
    let limit = |kind, edge| limits.limit(Control::Reset, kind, edge).as_fs();
    for (kind, [rise_fs, fall_fs]) in [
        (CheckKind::Setup, [25_000, 30_000]),
        (CheckKind::Hold, [4_000, 2_000]),
        (CheckKind::ClockHigh, [40_000; 2]),
        (CheckKind::ClockLow, [45_000; 2]),
    ] {
        let found = [limit(kind, Edge::Rise), limit(kind, Edge::Fall)];
        assert_eq!(found, [rise_fs, fall_fs], "{kind:?}");
    }
    // The flip-flop's RN (1.2 fF) rises later than R falls.
    let late_fs = 1e6 * (1.06 * (0.006 + 4.2 * 0.0012) + 0.18 * slew);
    let recovery_fs = limit(CheckKind::Recovery, Edge::Rise) as f64;
    assert_near(recovery_fs, 20_000.0 + late_fs);
    assert!(late_fs > 15_000.0, "the removal that is left is zero");
    assert_eq!(limit(CheckKind::Removal, Edge::Rise), 0);
    assert_eq!(limit(CheckKind::ControlHigh, Edge::Rise), 40_000);
}

/// What a library says not to use, stands for nothing.
#[test]
fn cells_that_are_not_to_be_used() {
    let inverters = |library: &Liberty| library.map.cells(CellKind::Inv).join(" ");
    let all = inverters(&library());
    assert!(all.contains("INV_1"), "{all}");
    let text = text().replace("cell (INV_1) {", "cell (INV_1) { dont_use : true;");
    let left = inverters(&Liberty::read(&text, &[]).unwrap());
    assert!(!left.contains("INV_1") && left.contains("INV_2"), "{left}");
}

/// Two inverters: what they take within, and what their loads take.
#[test]
fn energies_of_two_inverters() {
    let energies = |library: &Liberty| {
        let mut m = ModuleBuilder::new("pair");
        let a = m.input("A");
        let between = m.gate(CellKind::Inv, &[a]);
        let z = m.output("Z");
        m.gate_into(CellKind::Inv, &[between], z);
        let netlist = Netlist::elaborate(&m.finish().unwrap());
        let environment = Environment::new(library);
        let made = CharacterisedNetlist::new(&netlist, library, &environment);
        let [within, loads] = made.energy_j((&netlist, ScopeId::TOP), library, 2.0, |_| 10.0);
        (within, loads, environment.input_slew_fs * 1e-6)
    };
    let (within, loads, slew) = energies(&library());
    // ns, pF and pJ; of rise and fall the mean.
    let next = 0.006 + 7.5 * INVERTER_PF + 0.04 * slew;
    let by_hand = 2.0 * 0.0006 * 0.7 + 0.01 * INVERTER_PF + 0.001 * (slew + next);
    assert!(
        (within / (10.0 * by_hand * 1e-12) - 1.0).abs() < 1e-9,
        "{within}"
    );
    assert!(
        (loads / (10.0 * 0.5 * INVERTER_PF * 4.0 * 1e-12) - 1.0).abs() < 1e-9,
        "{loads}"
    );

    // An energy is a load at the square of the unit of voltage.
    for (unit, volt) in [("1mV", 1e-3), ("10mV", 1e-2), ("100mV", 0.1)] {
        let text = text().replace(
            "voltage_unit : \"1V\"",
            &format!("voltage_unit : \"{unit}\""),
        );
        let (scaled, ..) = energies(&Liberty::read(&text, &[]).unwrap());
        assert!(
            (scaled / (within * volt * volt) - 1.0).abs() < 1e-9,
            "{unit}"
        );
    }
}

/// The energy of a gate of two cells is that of both.
#[test]
fn energy_of_a_gate_of_two_cells() {
    let library = library();
    let (netlist, made, slew) = alone(&library, CellKind::And2);
    let a = netlist.net("A").unwrap();
    let z = netlist.net("Z").unwrap();
    let [within, loads] = made.energy_j((&netlist, ScopeId::TOP), &library, 1.0, |net| {
        f64::from(u8::from(net == a || net == z))
    });
    let between = 0.006 + 7.5 * INVERTER_PF + 0.04 * slew;
    let nand = 0.0006 * 1.0 + 0.01 * INVERTER_PF + 0.001 * slew;
    let inverter = 0.0006 * 0.7 + 0.001 * between;
    assert_near(within, (nand + inverter) * 1e-12);
    assert_near(loads, 0.5 * INVERTER_PF * 1e-12);
}
