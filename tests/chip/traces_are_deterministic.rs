//! A simulation's trace is a function of its input alone: not of the order in which what happens at one instant is
//! handled, not of the number of threads, not of the build. `vectors/traces/hashes.csv` holds the hashes of
//! random circuits; every build must find the same ones.

use crate::every_edge;
use crate::scenario;

use std::fmt::Write as _;
use std::path::Path;

use every_edge::circuit::{self, Case};
use guided_dtof::engine::{Engine, Gate, GateSimulation, Histograms, Replay};
use guided_dtof::kernel::{Kernel, TraceHash, in_order};
use guided_dtof::netlist::Netlist;
use guided_dtof::units::Time;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use rand::{SeedableRng, rngs::StdRng};
use rayon::prelude::*;
use scenario::Scenario;

const MACROPIXELS: u64 = 8;
const CIRCUITS: usize = 60;

/// Number of changes and hash of one random macropixel, with instants handled in a random order where there is a
/// seed for it.
fn macropixel(seed: u64, shuffle: Option<u64>) -> (u64, u64) {
    let scenario = Scenario::random(&mut StdRng::seed_from_u64(seed), 1, 1);
    let (config, exposure) = (&scenario.config, &scenario.exposure);
    let pulses = scenario.pulses();
    let mut gate = GateSimulation::new(config, exposure, (0, 0), (1, 1), &scenario.starts, &pulses);
    if let Some(seed) = shuffle {
        gate = gate.shuffled(seed);
    }
    let mut hash = TraceHash::new(gate.netlist());
    gate.run(&mut hash);
    (hash.changes(), hash.hash())
}

/// The same of a random circuit.
fn random_circuit(case: &Case, shuffle: Option<u64>) -> (u64, u64) {
    let netlist = Netlist::elaborate(&case.circuit());
    let mut kernel = Kernel::new(&netlist, &case.timing(&netlist));
    if let Some(seed) = shuffle {
        kernel = kernel.shuffled(seed);
    }
    let drives = case.drives(&netlist);
    let end = drives.last().map_or(Time::ZERO, |d| d.time) + Time::from_ns(2);
    let mut hash = TraceHash::new(&netlist);
    kernel.run(&mut in_order(drives), end, &mut hash);
    (hash.changes(), hash.hash())
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
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors/traces/hashes.csv");
    if std::env::var_os("GDTOF_REMAKE").is_some() {
        std::fs::write(&file, &found).unwrap();
    }
    let golden = std::fs::read_to_string(&file).unwrap();
    assert_eq!(found, golden);
}

#[test]
fn macropixels_do_not_depend_on_the_order_within_an_instant() {
    for seed in 0..MACROPIXELS {
        let straight = macropixel(seed, None);
        assert!(straight.0 > 1_000);
        for shuffle in 0..3 {
            assert_eq!(
                macropixel(seed, Some(shuffle)),
                straight,
                "{seed}, {shuffle}"
            );
        }
    }
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

#[test]
fn the_number_of_threads_changes_nothing() {
    let scenario = Scenario::random(&mut StdRng::seed_from_u64(99), 4, 20);
    let gate = Gate::new(&scenario.config, &scenario.exposure);
    let pulses = scenario.pulses();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let traces: Vec<_> = (0..MACROPIXELS)
                .into_par_iter()
                .map(|seed| macropixel(seed, None))
                .collect();
            let batches = scenario.starts.par_chunks(7).zip(pulses.par_chunks(7));
            let histograms = batches.map(|(starts, pulses)| gate.histograms(starts, pulses));
            let histograms: Vec<Histograms> = histograms.map(Result::unwrap).collect();
            (traces, Histograms::joined(gate.bins(), histograms))
        })
    };
    let alone = run(1);
    assert!(alone.1.counts().iter().any(|&count| count > 0));
    for threads in [2, 3, 8] {
        assert_eq!(run(threads), alone, "{threads} threads");
    }
}
