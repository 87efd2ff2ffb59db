//! Timing checks find every violation with its exact slack and nothing else: hand-made ones at the limit's very
//! femtosecond, random ones are in `violations_are_those_of_the_definitions`.

use femtogate::kernel::{CheckReport, Drive, Kernel, Policy, Recorder, Stimulus, TimingChecks};
use femtogate::logic::Logic;
use femtogate::netlist::{
    CellKind, CheckKind, Corner, Edge, Library, ModuleBuilder, NetId, Netlist, Timing,
};
use femtogate::sdf::{Sdf, annotate};
use femtogate::units::Time;

/// The clock edge, or whatever a test measures from.
const EDGE: i64 = 10_000_000;

/// (time, pin, value) of the inputs D, CK, R, S.
pub type Script = Vec<(i64, &'static str, Logic)>;

/// Two flip-flops of one kind in a row, `first` and `second`, with nets Q1 and Q2.
pub fn pair(kind: CellKind) -> Netlist {
    let mut m = ModuleBuilder::new("pair");
    let pins: Vec<_> = kind.inputs().iter().map(|pin| m.input(pin)).collect();
    let (q1, q2) = (m.output("Q1"), m.output("Q2"));
    m.cell("first", kind, &pins, &[Some(q1), None]);
    let mut second = pins;
    second[0] = q1;
    m.cell("second", kind, &second, &[Some(q2), None]);
    Netlist::elaborate(&m.finish().unwrap())
}

pub fn simulate(
    netlist: &Netlist,
    library: &Library,
    corner: Corner,
    policy: Policy,
    script: &Script,
) -> (CheckReport, Recorder, Kernel) {
    let mut checks = TimingChecks::new(netlist, library, corner).policy(policy);
    let mut trace = Recorder::new((0..netlist.net_count()).map(NetId::new));
    let mut kernel = Kernel::new(netlist, &Timing::nominal(netlist, library, corner));
    let mut script = script.clone();
    script.sort_by_key(|step| step.0);
    let drives = script.into_iter().map(|(fs, pin, value)| {
        let net = netlist.net(pin).unwrap();
        Drive::new(Time::from_fs(fs), net, value)
    });
    let end = Time::from_fs(4 * EDGE);
    kernel
        .run(
            &mut Stimulus::new(drives),
            end,
            &mut (&mut trace, &mut checks),
        )
        .unwrap();
    (checks.report(netlist), trace, kernel)
}

use Logic::{One, X, Zero};

/// Out of reset by 1 ns, everything low, then `steps`.
fn after_reset(kind: CellKind, steps: &[(i64, &'static str, Logic)]) -> Script {
    let mut script = vec![
        (0, "D", Zero),
        (0, "CK", Zero),
        (0, "R", One),
        (1_000_000, "R", Zero),
    ];
    if kind == CellKind::Dffsr {
        script.push((0, "S", Zero));
    }
    script.extend_from_slice(steps);
    script
}

/// Stimuli that complete `check` exactly `distance` after (or before) what it is measured from; D changes in the
/// direction of `edge`.
fn script(
    kind: CellKind,
    check: CheckKind,
    (control, edge): (&'static str, Edge),
    distance: i64,
) -> Script {
    let before = EDGE - 1_000_000;
    let (old, new) = match edge {
        Edge::Rise => (Zero, One),
        Edge::Fall => (One, Zero),
    };
    let steps = match check {
        CheckKind::Setup => vec![
            (before, "D", old),
            (EDGE - distance, "D", new),
            (EDGE, "CK", One),
        ],
        CheckKind::Hold => vec![
            (before, "D", old),
            (EDGE, "CK", One),
            (EDGE + distance, "D", new),
        ],
        CheckKind::Recovery => vec![
            (before, control, One),
            (EDGE - distance, control, Zero),
            (EDGE, "CK", One),
        ],
        CheckKind::Removal => vec![
            (before, control, One),
            (EDGE, "CK", One),
            (EDGE + distance, control, Zero),
        ],
        CheckKind::ClockHigh => vec![(EDGE, "CK", One), (EDGE + distance, "CK", Zero)],
        CheckKind::ClockLow => vec![
            (before, "CK", One),
            (EDGE, "CK", Zero),
            (EDGE + distance, "CK", One),
        ],
        CheckKind::ControlHigh => vec![(EDGE, control, One), (EDGE + distance, control, Zero)],
    };
    after_reset(kind, &steps)
}

#[test]
fn every_check_is_exact_to_the_femtosecond() {
    for kind in [CellKind::Dffr, CellKind::Dffsr] {
        for check in CheckKind::ALL {
            for corner in Corner::ALL {
                for control in kind.inputs()[2..].iter().copied() {
                    for edge in Edge::BOTH {
                        exact(kind, check, corner, (control, edge));
                    }
                }
            }
        }
    }
}

/// One kind of check at its limit and a femtosecond beside it.
fn exact(kind: CellKind, check: CheckKind, corner: Corner, varied: (&'static str, Edge)) {
    let (library, netlist) = (Library::generic_40nm(), pair(kind));
    let limit = library
        .checks(kind)
        .edge_limit(check, varied.1, corner)
        .as_fs();
    for slack in [1 - limit, -5_000, -1, 0, 1, 5_000] {
        let steps = script(kind, check, varied, limit + slack);
        let (report, ..) = simulate(&netlist, &library, corner, Policy::ReportOnly, &steps);
        let case = format!("{} {check:?} {corner:?} {varied:?}", kind.name());
        let of_kind = report.violations.iter().filter(|v| v.kind == check);
        let found: Vec<_> = of_kind.filter(|v| v.cell == "pair.first").collect();
        let slacks: Vec<_> = found.iter().map(|v| v.slack.as_fs()).collect();
        assert_eq!(
            slacks,
            if slack < 0 { vec![slack] } else { vec![] },
            "{case}"
        );
        if check.concerns_data() {
            assert!(found.iter().all(|v| v.edge == varied.1), "{case}");
        }
        let others = report.violations.iter().filter(|v| v.kind != check);
        assert_eq!(others.count(), 0, "{case} {slack}: {report}");
        if slack < 0 {
            let worst = report.summary(check).worst.clone().unwrap();
            assert_eq!(worst.slack.as_fs(), slack, "{case}");
        }
    }
}

/// R and S may have limits of their own, from a delay file.
#[test]
fn each_control_is_judged_by_its_own_limit() {
    let (kind, corner) = (CellKind::Dffsr, Corner::Typ);
    let (library, netlist) = (Library::generic_40nm(), pair(kind));
    let mut timing = Timing::nominal(&netlist, &library, corner);
    let text = "(DELAYFILE (SDFVERSION \"3.0\") (TIMESCALE 1fs)
        (CELL (CELLTYPE \"DFFSR\") (INSTANCE first) (TIMINGCHECK
        (WIDTH (posedge R) (5000)) (WIDTH (posedge S) (9000)))))";
    let sdf = Sdf::parse("own.sdf", text).unwrap();
    annotate(&mut timing, &netlist, &sdf, corner).unwrap();
    for (control, limit) in [("R", 5_000), ("S", 9_000)] {
        let mut checks = TimingChecks::new(&netlist, &library, corner).limits(&netlist, &timing);
        let steps = script(kind, CheckKind::ControlHigh, (control, Edge::Rise), 4_000);
        let drives = steps.into_iter().map(|(fs, pin, value)| {
            Drive::new(Time::from_fs(fs), netlist.net(pin).unwrap(), value)
        });
        let mut drives = Stimulus::sorted(drives);
        Kernel::new(&netlist, &timing)
            .run(&mut drives, Time::from_fs(2 * EDGE), &mut checks)
            .unwrap();
        let report = checks.report(&netlist);
        let first = report.violations.iter().filter(|v| v.cell == "pair.first");
        let slacks: Vec<_> = first.map(|v| v.slack.as_fs()).collect();
        assert_eq!(slacks, [4_000 - limit], "{control}");
        let said = report.to_string();
        assert!(said.contains(&format!(".{control} at ")), "{said}");
    }
}

#[test]
fn a_pulse_on_d_is_judged_at_both_its_edges() {
    let library = Library::generic_40nm();
    let limits = library.checks(CellKind::Dffr);
    let [rise, fall] =
        Edge::BOTH.map(|e| limits.edge_limit(CheckKind::Setup, e, Corner::Typ).as_fs());
    assert!(rise < fall);
    // The fall is within its limit, the later rise is not within its own.
    let steps = [
        (5_000_000, "D", One),
        (EDGE - rise - 1, "D", Zero),
        (EDGE - rise, "D", One),
        (EDGE, "CK", One),
    ];
    assert_eq!(kinds(&steps), [(CheckKind::Setup, rise + 1 - fall)]);
}

fn kinds(steps: &[(i64, &'static str, Logic)]) -> Vec<(CheckKind, i64)> {
    let (library, kind) = (Library::generic_40nm(), CellKind::Dffr);
    let steps = after_reset(kind, steps);
    let policy = Policy::ReportOnly;
    let (report, ..) = simulate(&pair(kind), &library, Corner::Typ, policy, &steps);
    let of_first = report.violations.iter().filter(|v| v.cell == "pair.first");
    of_first.map(|v| (v.kind, v.slack.as_fs())).collect()
}

/// The limit for a rising D.
fn limit(check: CheckKind) -> i64 {
    let library = Library::generic_40nm();
    let limits = library.checks(CellKind::Dffr);
    limits.edge_limit(check, Edge::Rise, Corner::Typ).as_fs()
}

#[test]
fn changes_at_once_break_hold_and_recovery_but_not_setup_and_removal() {
    assert_eq!(
        kinds(&[(EDGE, "D", One), (EDGE, "CK", One)]),
        [(CheckKind::Hold, -limit(CheckKind::Hold))]
    );
    assert_eq!(
        kinds(&[(5_000_000, "R", One), (EDGE, "CK", One), (EDGE, "R", Zero)]),
        [(CheckKind::Recovery, -limit(CheckKind::Recovery))]
    );
}

#[test]
fn possible_edges_count_and_glitches_within_an_instant_do_not() {
    let setup = (CheckKind::Setup, 7 - limit(CheckKind::Setup));
    assert_eq!(kinds(&[(EDGE - 7, "D", X), (EDGE, "CK", One)]), [setup]);
    assert_eq!(kinds(&[(EDGE - 7, "D", One), (EDGE, "CK", X)]), [setup]);
    // Undriven reads as unknown: going from one to the other is no event.
    assert_eq!(
        kinds(&[
            (5_000_000, "D", X),
            (EDGE - 7, "D", Logic::Z),
            (EDGE, "CK", One)
        ]),
        []
    );
    assert_eq!(
        kinds(&[
            (EDGE - 7, "D", One),
            (EDGE - 7, "D", Zero),
            (EDGE, "CK", One)
        ]),
        []
    );
}

#[test]
fn a_held_flip_flop_is_not_judged() {
    let held = [
        (5_000_000, "R", One),
        (EDGE, "CK", One),
        (EDGE + 3, "D", One),
        (EDGE + 9, "CK", Zero),
    ];
    assert_eq!(kinds(&held), []);
}

#[test]
fn nothing_is_judged_before_its_time_but_earlier_events_are_remembered() {
    let (library, netlist) = (Library::generic_40nm(), pair(CellKind::Dffr));
    let run = |not_before: i64| {
        let mut checks = TimingChecks::new(&netlist, &library, Corner::Typ)
            .not_before(Time::from_fs(not_before));
        let timing = Timing::nominal(&netlist, &library, Corner::Typ);
        let script = script(CellKind::Dffr, CheckKind::Setup, ("R", Edge::Rise), 100);
        let mut drives = script;
        drives.sort_by_key(|step| step.0);
        let drives = drives.into_iter().map(|(fs, pin, value)| {
            Drive::new(Time::from_fs(fs), netlist.net(pin).unwrap(), value)
        });
        let mut kernel = Kernel::new(&netlist, &timing);
        kernel
            .run(
                &mut Stimulus::new(drives),
                Time::from_fs(2 * EDGE),
                &mut checks,
            )
            .unwrap();
        checks.report(&netlist).violated()
    };
    assert_eq!(run(EDGE), 1);
    assert_eq!(run(EDGE + 1), 0);
}

#[test]
fn a_violation_makes_the_state_unknown_downstream_until_a_reset() {
    let (library, kind) = (Library::generic_40nm(), CellKind::Dffr);
    let netlist = pair(kind);
    let steps = after_reset(
        kind,
        &[
            (EDGE, "CK", One),
            (EDGE + 5_000, "D", One),
            (EDGE + 1_000_000, "CK", Zero),
            (EDGE + 2_000_000, "CK", One),
            (EDGE + 4_000_000, "R", One),
        ],
    );
    let [q1, q2] = ["Q1", "Q2"].map(|name| netlist.net(name).unwrap());
    let run = |policy| simulate(&netlist, &library, Corner::Typ, policy, &steps);
    let unknowns = |trace: &Recorder| {
        let after_start = |t: &Time| *t > Time::from_ns(2);
        let changes = trace.changes().iter();
        let x = changes.filter(|(t, _, v)| after_start(t) && *v == X);
        x.map(|(t, n, _)| (t.as_fs(), *n)).collect::<Vec<_>>()
    };
    let (report, trace, kernel) = run(Policy::XOnViolation);
    let clock_to_q = library.delay(kind, 1, One, Corner::Typ).as_fs();
    // The violation is complete when D changes; the next edge takes the unknown bit on.
    assert_eq!(
        unknowns(&trace),
        [
            (EDGE + 5_000 + clock_to_q, q1),
            (EDGE + 2_000_000 + clock_to_q, q2)
        ]
    );
    assert_eq!(report.violated(), 1);
    assert_eq!(
        [kernel.value(q1), kernel.value(q2)],
        [Zero, Zero],
        "after the reset"
    );
    let (report, trace, _) = run(Policy::ReportOnly);
    assert_eq!(unknowns(&trace), []);
    assert_eq!(report.violated(), 1);
}

/// A report survives JSON.
#[cfg(feature = "serde")]
#[test]
fn a_report_round_trips_through_json() {
    let steps = script(CellKind::Dffr, CheckKind::Hold, ("R", Edge::Rise), 4);
    let library = Library::generic_40nm();
    let policy = Policy::ReportOnly;
    let (report, ..) = simulate(
        &pair(CellKind::Dffr),
        &library,
        Corner::Slow,
        policy,
        &steps,
    );
    // 328 bytes on 64-bit machines, for two flip-flops and their six nets.
    assert!((200..500).contains(&report.memory_bytes), "{report:?}");
    let text = serde_json::to_string(&report).unwrap();
    assert_eq!(serde_json::from_str::<CheckReport>(&text).unwrap(), report);
}
