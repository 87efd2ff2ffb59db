//! Every check of every flip-flop in random netlists, against a reference that derives the violations from a full trace:
//! the same ones, at the same femtosecond, with the same slack.

use crate::cases;
use crate::every_edge::circuit::{self, Case};
use crate::timing_checks_find_violations::{Script, pair, simulate};

use std::cell::Cell;

use femtogate::kernel::{CheckReport, Kernel, Policy, Recorder, Stimulus, TimingChecks};
use femtogate::logic::Logic;
use femtogate::netlist::{
    CellKind, CheckKind, CheckLimits, Corner, DataLimit, Delay, Edge, Library, NetId, Netlist,
    ScopeId, TimingArc,
};
use femtogate::units::Time;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestCaseError, TestRunner};

use Logic::{One, X, Zero};

/// Events (time, before, after) of one net, instants with no net effect left out; Z is X.
fn events(trace: &Recorder, net: NetId) -> Vec<(i64, Logic, Logic)> {
    let mut values: Vec<(i64, Logic)> = vec![(i64::MIN, X)];
    for (time, _, value) in trace.changes().iter().filter(|(_, n, _)| *n == net) {
        match values.last_mut() {
            Some(last) if last.0 == time.as_fs() => last.1 = value.as_gate_input(),
            _ => values.push((time.as_fs(), value.as_gate_input())),
        }
    }
    let pairs = values.windows(2);
    let steps = pairs.map(|w| (w[1].0, w[0].1, w[1].1));
    steps.filter(|(_, before, after)| before != after).collect()
}

/// Every violation of one flip-flop, straight from the definitions: (kind, pin, time, slack).
fn reference(
    trace: &Recorder,
    kind: CellKind,
    inputs: &[Option<NetId>],
    limits: &CheckLimits,
) -> Vec<(CheckKind, String, i64, i64)> {
    let pin = |name: &str| {
        let index = kind.inputs().iter().position(|pin| *pin == name).unwrap();
        events(trace, inputs[index].unwrap())
    };
    let rises = |list: &[(i64, Logic, Logic)]| -> Vec<i64> {
        let up = list
            .iter()
            .filter(|(_, before, after)| *after == One || *before == Zero);
        up.map(|e| e.0).collect()
    };
    let falls = |list: &[(i64, Logic, Logic)]| -> Vec<i64> {
        let down = list
            .iter()
            .filter(|(_, before, after)| *after == Zero || *before == One);
        down.map(|e| e.0).collect()
    };
    let value_at = |list: &[(i64, Logic, Logic)], time: i64| {
        list.iter().rfind(|e| e.0 <= time).map_or(X, |e| e.2)
    };
    let (data, clock) = (pin("D"), pin("CK"));
    let controls = &kind.inputs()[2..];
    let is_held = |time| controls.iter().any(|c| value_at(&pin(c), time) == One);
    let mut found = Vec::new();
    let mut check =
        |which: CheckKind, name: &str, edge: Edge, completing: &[i64], since: &[i64]| {
            let limit = limits.edge_limit(which, edge, Corner::Typ).as_fs();
            for &time in completing.iter().filter(|t| !is_held(**t)) {
                let Some(&from) = since.iter().rfind(|s| **s <= time) else {
                    continue;
                };
                if from == time && matches!(which, CheckKind::Setup | CheckKind::Removal) {
                    continue;
                }
                // At most one violation of each kind and time: the worst.
                let same = |v: &&mut (CheckKind, String, i64, i64)| {
                    v.0 == which && v.1 == name && v.2 == time
                };
                let slack = time - from - limit;
                match found.iter_mut().find(same) {
                    Some(worse) => worse.3 = worse.3.min(slack),
                    None if slack < 0 => found.push((which, name.to_owned(), time, slack)),
                    None => {}
                }
            }
        };
    let (up, down) = (rises(&clock), falls(&clock));
    for (edge, changes) in [(Edge::Rise, rises(&data)), (Edge::Fall, falls(&data))] {
        check(CheckKind::Setup, "D", edge, &up, &changes);
        check(CheckKind::Hold, "D", edge, &changes, &up);
    }
    check(CheckKind::ClockHigh, "CK", Edge::Fall, &down, &up);
    check(CheckKind::ClockLow, "CK", Edge::Rise, &up, &down);
    for name in controls {
        let control = pin(name);
        check(CheckKind::Recovery, name, Edge::Fall, &up, &falls(&control));
        check(CheckKind::Removal, name, Edge::Fall, &falls(&control), &up);
        check(
            CheckKind::ControlHigh,
            name,
            Edge::Fall,
            &falls(&control),
            &rises(&control),
        );
    }
    found.sort();
    found
}

/// These limits for every flip-flop: setup and hold of a rising and a falling D, recovery, removal, high and low clock,
/// high control.
fn limits(fs: [i64; 9]) -> CheckLimits {
    let [
        setup,
        setup_fall,
        hold,
        hold_fall,
        recovery,
        removal,
        clock_high,
        clock_low,
        control_high,
    ] = fs.map(|fs| Delay::fixed(Time::from_fs(fs)));
    let setup = DataLimit {
        rise: setup,
        fall: setup_fall,
    };
    let hold = DataLimit {
        rise: hold,
        fall: hold_fall,
    };
    CheckLimits {
        setup,
        hold,
        recovery,
        removal,
        clock_high,
        clock_low,
        control_high,
    }
}

/// Every flip-flop's violations in `report` are those of the definitions.
fn check_violations(
    netlist: &Netlist,
    report: &CheckReport,
    trace: &Recorder,
    limits: &CheckLimits,
) -> Result<(), TestCaseError> {
    let cells = netlist.cells_below(ScopeId::TOP).zip(netlist.cells());
    for (id, cell) in cells.filter(|(_, cell)| cell.kind.is_flip_flop()) {
        let path = netlist.cell_path(id);
        let mut found: Vec<_> = report
            .violations
            .iter()
            .filter(|v| v.cell == path)
            .map(|v| (v.kind, v.pin.clone(), v.time.as_fs(), v.slack.as_fs()))
            .collect();
        found.sort();
        prop_assert_eq!(
            found,
            reference(trace, cell.kind, &cell.inputs, limits),
            "{}",
            path
        );
    }
    let violated: u64 = report.summaries.iter().map(|s| s.violated).sum();
    prop_assert_eq!(violated, report.violations.len() as u64);
    for summary in &report.summaries {
        prop_assert_eq!(summary.histogram.iter().sum::<u64>(), summary.checked);
    }
    Ok(())
}

/// All flip-flops of a random netlist with these limits; gives the numbers of checks and of violations by kind.
fn judge_netlist(
    case: &Case,
    limits: &CheckLimits,
    policy: Policy,
) -> Result<Tally, TestCaseError> {
    let netlist = Netlist::elaborate(&case.circuit());
    let mut library = case.cell_library();
    for kind in CellKind::ALL.into_iter().filter(|kind| kind.is_flip_flop()) {
        library.set_checks(kind, *limits);
    }
    let mut checks = TimingChecks::new(&netlist, &library, Corner::Typ).policy(policy);
    let mut trace = Recorder::new((0..netlist.net_count()).map(NetId::new));
    let mut kernel = Kernel::new(&netlist, &case.timing(&netlist));
    let drives = case.drives(&netlist);
    let end = drives.last().map_or(Time::ZERO, |d| d.time) + Time::from_ns(2);
    kernel
        .run(
            &mut Stimulus::sorted(drives),
            end,
            &mut (&mut trace, &mut checks),
        )
        .unwrap();
    let report = checks.report(&netlist);
    check_violations(&netlist, &report, &trace, limits)?;
    Ok(CheckKind::ALL.map(|kind| {
        let summary = report.summary(kind);
        [summary.checked, summary.violated]
    }))
}

/// Checks and violations of each kind.
type Tally = [[u64; 2]; CheckKind::ALL.len()];

/// `GDTOF_CASES=10000` runs more, and `--nocapture` shows how much was checked.
#[test]
fn random_netlists_give_the_violations_of_the_definitions() {
    let all = Cell::new(Tally::default());
    let config = Config {
        cases: cases::cases(300),
        source_file: Some(file!()),
        ..Config::default()
    };
    let cases = prop_oneof![circuit::flat(), circuit::hierarchical()];
    let strategy = (
        cases,
        prop::array::uniform9(1_000i64..300_000),
        any::<bool>(),
    );
    TestRunner::new(config)
        .run(&strategy, |(case, fs, spreads_x)| {
            let policy = if spreads_x {
                Policy::XOnViolation
            } else {
                Policy::ReportOnly
            };
            let found = judge_netlist(&case, &limits(fs), policy)?;
            let mut sum = all.get();
            for (sum, found) in sum.as_flattened_mut().iter_mut().zip(found.as_flattened()) {
                *sum += found;
            }
            all.set(sum);
            Ok(())
        })
        .unwrap();
    for (kind, [checked, violated]) in CheckKind::ALL.into_iter().zip(all.get()) {
        println!("{kind:?}: {checked} checks, {violated} violations");
        assert!(violated > 0, "no {kind:?} was ever violated");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases::cases(300), ..ProptestConfig::default() })]

    /// Limits and delays of a few femtoseconds and stimuli at every femtosecond: coincidences, boundaries and unknown
    /// values are the rule.
    #[test]
    fn random_stimuli_give_the_violations_of_the_definitions(
        steps in prop::collection::vec((0i64..150, 0usize..4, 0usize..4), 1..120),
        limits in prop::array::uniform9(0i64..8),
        delays in prop::array::uniform2(1i64..5),
        has_set: bool,
        spreads_x: bool,
    ) {
        let kind = if has_set { CellKind::Dffsr } else { CellKind::Dffr };
        let policy = if spreads_x { Policy::XOnViolation } else { Policy::ReportOnly };
        let mut library = Library::generic_40nm();
        let limits = self::limits(limits);
        library.set_checks(kind, limits);
        let arc = |fs| {
            let delay = Delay::fixed(Time::from_fs(fs));
            [TimingArc { rise: delay, fall: delay }; 2]
        };
        library.set_arcs(kind, [arc(0), arc(delays[0]), arc(delays[1]), arc(delays[1])]);
        let netlist = pair(kind);
        let pins = kind.inputs();
        let script: Script = steps
            .into_iter()
            .map(|(time, pin, value)| (time, pins[pin % pins.len()], Logic::ALL[value]))
            .collect();
        let (report, trace, _) = simulate(&netlist, &library, Corner::Typ, policy, &script);
        check_violations(&netlist, &report, &trace, &limits)?;
    }
}
