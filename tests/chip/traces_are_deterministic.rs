//! A macropixel's trace is a function of its input alone: not of the order in which what happens at one instant is
//! handled, not of the number of threads.

use guided_dtof::engine::{Engine, Gate, GateSimulation, Histograms, Replay};
use guided_dtof::kernel::TraceHash;
use rand::{SeedableRng, rngs::StdRng};
use rayon::prelude::*;

use crate::scenario;

const MACROPIXELS: u64 = 8;

/// Number of changes and hash of one random macropixel, with instants handled in a random order where there is a
/// seed for it.
fn macropixel(seed: u64, shuffle: Option<u64>) -> (u64, u64) {
    let scenario = scenario::random(&mut StdRng::seed_from_u64(seed), 1, 1);
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

#[test]
fn the_number_of_threads_changes_nothing() {
    let scenario = scenario::random(&mut StdRng::seed_from_u64(99), 4, 20);
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
