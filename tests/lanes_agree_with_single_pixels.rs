//! 64 macropixels in one lane-parallel simulation: every value change of every net of every lane comes at the
//! time, and with the value, that it has when the macropixel is simulated alone.

mod scenario;

use guided_dtof::engine::{GateSimulation, LaneSimulation};
use guided_dtof::kernel::{LaneObserver, Lanes, Observer};
use guided_dtof::logic::Logic;
use guided_dtof::netlist::NetId;
use guided_dtof::units::Time;
use rand::{RngExt, SeedableRng, rngs::StdRng};
use scenario::Scenario;

type Change = (Time, NetId, Logic);

#[derive(Default)]
struct Trace(Vec<Change>);

impl Observer for Trace {
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        self.0.push((time, net, value));
    }
}

struct LaneTraces(Vec<Vec<Change>>);

impl LaneObserver for LaneTraces {
    fn change(&mut self, time: Time, net: NetId, mask: u64, values: Lanes) {
        for (lane, trace) in self.0.iter_mut().enumerate() {
            if mask >> lane & 1 == 1 {
                trace.push((time, net, values.lane(lane)));
            }
        }
    }
}

#[test]
fn change_by_change() {
    for seed in 0..12 {
        let random = &mut StdRng::seed_from_u64(seed);
        let lanes = random.random_range(1..=64);
        let scenario = Scenario::random(random, 1, lanes);
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
        assert!(together.kernel().lane_changes() > together.kernel().events());

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
