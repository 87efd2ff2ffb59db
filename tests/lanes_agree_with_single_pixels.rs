//! 64 macropixels in one lane-parallel simulation: every value change of every net of every lane comes at the
//! time, and with the value, that it has when the macropixel is simulated alone.

use guided_dtof::chip::{EventType, Exposure, Mode, SensorConfig};
use guided_dtof::engine::{GateSimulation, LaneSimulation};
use guided_dtof::kernel::{LaneObserver, Lanes, Observer};
use guided_dtof::logic::Logic;
use guided_dtof::netlist::{Corner, NetId};
use guided_dtof::photon::{SpadEvent, apply_dead_time};
use guided_dtof::units::Time;
use rand::{RngExt, SeedableRng, rngs::StdRng};

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

fn random_case(random: &mut StdRng) -> (SensorConfig, u32, u32) {
    let clk_hz = random.random_range(200e6..450e6);
    let config = SensorConfig {
        rows: 1,
        cols: 1,
        clk_hz,
        stop_phase_ps: random.random_range(-0.45..0.45) * 1e12 / clk_hz,
        counter_bits: random.random_range(3..10),
        bins: random.random_range(2..17),
        bin_bits: random.random_range(2..15),
        dead_time_ns: random.random_range(2.0..9.0),
        threshold: random.random_range(0..3),
        event_type: [EventType::Greater, EventType::Equal, EventType::Less]
            [random.random_range(0..3)],
        mode: if random.random_bool(0.2) {
            Mode::Conventional
        } else {
            Mode::Guided
        },
        corner: Corner::ALL[random.random_range(0..3)],
        ..SensorConfig::default()
    };
    (
        config,
        random.random_range(20..70),
        random.random_range(1..6),
    )
}

#[test]
fn change_by_change() {
    for seed in 0..12 {
        let random = &mut StdRng::seed_from_u64(seed);
        let (config, stop_periods, laser_cycles) = random_case(random);
        let exposure = Exposure::new(&config, stop_periods, laser_cycles);
        let lanes = random.random_range(1..=64);
        let most = config.largest_start().min(stop_periods as u16);
        let starts: Vec<u16> = (0..lanes).map(|_| random.random_range(0..=most)).collect();
        let pulses: Vec<Vec<SpadEvent>> = (0..lanes)
            .map(|_| {
                let mut pulses: Vec<SpadEvent> = (0..random.random_range(0..120))
                    .map(|_| SpadEvent {
                        time: Time::from_fs(random.random_range(0..exposure.end().as_fs())),
                        spad: random.random_range(0..16),
                    })
                    .collect();
                pulses.sort_unstable();
                apply_dead_time(&mut pulses, config.dead_time());
                pulses
            })
            .collect();
        let pulses: Vec<&[SpadEvent]> = pulses.iter().map(Vec::as_slice).collect();

        let mut together = LaneSimulation::new(&config, &exposure, &starts, &pulses);
        let mut traces = LaneTraces(vec![Vec::new(); lanes]);
        together.run(&mut traces);
        let counts = together.histograms().unwrap();
        assert!(together.kernel().lane_changes() > together.kernel().events());

        for lane in 0..lanes {
            let (start, pulses) = (&starts[lane..=lane], &pulses[lane..=lane]);
            let mut alone = GateSimulation::new(&config, &exposure, (0, 0), (1, 1), start, pulses);
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
