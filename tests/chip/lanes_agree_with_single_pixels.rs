//! 64 macropixels in one lane-parallel simulation: every value change of every net of every lane comes at the
//! time, and with the value, that it has when the macropixel is simulated alone.

use guided_dtof::engine::{Gate, GateSimulation, LaneSimulation, PulsedPixel};
use guided_dtof::netlist::{Mismatch, Timing, varied};
use rand::{RngExt, SeedableRng, rngs::StdRng};

use crate::scenario::{self, Scenario};
use crate::traces::{LaneTraces, Trace};

#[test]
fn change_by_change() {
    for seed in 0..12 {
        let random = &mut StdRng::seed_from_u64(seed);
        let lanes = random.random_range(1..=64);
        let scenario = scenario::random(random, 1, lanes);
        let pulses = scenario.pulses();
        let Scenario {
            config,
            exposure,
            starts,
            ..
        } = &scenario;
        let mut together = LaneSimulation::new(config, exposure, starts, &pulses);
        let mut traces = LaneTraces(vec![Vec::new(); lanes]);
        together.run(&mut traces);
        let counts = together.histograms().unwrap();
        assert!(together.kernel.lane_changes() > together.kernel.events());

        for lane in 0..lanes {
            let (start, pulses) = (&starts[lane..=lane], &pulses[lane..=lane]);
            let mut alone = GateSimulation::new(config, exposure, (0, 0), (1, 1), start, pulses);
            let mut trace = Trace::default();
            alone.run(&mut trace);
            trace.0.sort_by_key(|(time, net, _)| (*time, *net));
            traces.0[lane].sort_by_key(|(time, net, _)| (*time, *net));
            let differing = trace.0.iter().zip(&traces.0[lane]).find(|(a, b)| a != b);
            if let Some(((time, net, value), found)) = differing {
                let path = alone.netlist().net_path(*net);
                panic!(
                    "seed {seed}, lane {lane}: {path:?} becomes {value} at {time}, in its lane {found:?}"
                );
            }
            assert_eq!(
                trace.0.len(),
                traces.0[lane].len(),
                "seed {seed}, lane {lane}"
            );
            assert_eq!(
                alone.histograms().unwrap()[0],
                counts[lane],
                "seed {seed}, lane {lane}"
            );
            assert_eq!(alone.loaded()[0], together.loaded()[lane]);
        }
    }
}

/// Macropixels of which some share their delays and others have their own: lanes take the former, the latter run
/// alone, and nothing shows which did.
#[test]
fn where_macropixels_have_delays_of_their_own() {
    for seed in 0..4 {
        let random = &mut StdRng::seed_from_u64(seed);
        let pixels = random.random_range(2..40);
        let scenario = scenario::random(random, 1, pixels);
        let (config, exposure) = (&scenario.config, &scenario.exposure);
        let (starts, pulses) = (&scenario.starts, scenario.pulses());
        let gate = Gate::new(config, exposure);
        let nominal = gate.nominal_timing();
        let silicon: Vec<Timing> = (0..3)
            .map(|seed| {
                let mismatch = Mismatch { sigma: 0.02, seed };
                varied(&gate.netlist(), &nominal, 1.0, Some(mismatch))
            })
            .chain([nominal.clone()])
            .collect();
        let timings: Vec<&Timing> = (0..pixels)
            .map(|_| &silicon[random.random_range(0..4)])
            .collect();
        let pixels_with_pulses = PulsedPixel::array(starts, &pulses);
        let found = gate.replay_with(&timings, &pixels_with_pulses).unwrap();
        for pixel in 0..pixels {
            let (start, pulses) = (&starts[pixel..=pixel], &pulses[pixel..=pixel]);
            let alone = GateSimulation::new(config, exposure, (0, 0), (1, 1), start, pulses);
            let mut alone = alone.with_timing(timings[pixel]);
            alone.run(&mut ());
            assert_eq!(
                alone.histograms().unwrap()[0],
                found[pixel],
                "{seed}, {pixel}"
            );
        }
    }
}
