//! A simulation's trace is a function of its input alone: not of the order in which what happens at one instant is
//! handled, not of the build. `vectors/traces/hashes.csv` holds the hashes of random circuits; every build must find the same ones.

use std::fmt::Write as _;
use std::path::Path;

use femtogate::netlist::Netlist;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

use crate::every_edge::circuit::{self, Case};
use crate::traces::trace;

const CIRCUITS: usize = 60;

fn random_circuit(case: &Case, shuffle: Option<u64>) -> (u64, u64) {
    let netlist = Netlist::elaborate(&case.circuit());
    trace(
        &netlist,
        &case.timing(&netlist),
        case.drives(&netlist),
        shuffle,
    )
}

/// The same random circuits in every run.
fn circuits() -> Vec<Case> {
    let mut runner = TestRunner::deterministic();
    let strategy = prop_oneof![circuit::flat(), circuit::hierarchical()];
    (0..CIRCUITS)
        .map(|_| strategy.new_tree(&mut runner).unwrap().current())
        .collect()
}

/// Set GDTOF_REMAKE to write the file anew (`vectors/remake.sh` does) after a deliberate change.
#[test]
fn every_build_finds_the_golden_hashes() {
    let mut found = "what,changes,hash\n".to_owned();
    for (index, case) in circuits().iter().enumerate() {
        let (changes, hash) = random_circuit(case, None);
        writeln!(found, "circuit {index},{changes},{hash:016x}").unwrap();
    }
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vectors/traces/hashes.csv");
    if std::env::var_os("GDTOF_REMAKE").is_some() {
        std::fs::write(&file, &found).unwrap();
    }
    let golden = std::fs::read_to_string(&file).unwrap();
    assert_eq!(found, golden);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn random_circuits_do_not_depend_on_the_order_within_an_instant(
        case in prop_oneof![circuit::flat(), circuit::hierarchical()],
        shuffle in any::<u64>(),
    ) {
        prop_assert_eq!(random_circuit(&case, Some(shuffle)), random_circuit(&case, None));
    }
}
