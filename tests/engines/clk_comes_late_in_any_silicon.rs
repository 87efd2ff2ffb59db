//! CLK that comes late to a column, in any corner, process, voltage, temperature and mismatch, of every chip: what the whole array
//! counts at gate level, its wires included (as with a waveform), every engine counts that runs macropixels by themselves.

use crate::cases::cases;
use crate::scenario::{self, Scenario};

use guided_dtof::chip::{
    Exposure, Mode, Sensor, SensorConfig, Silicon, WindowLaw, hslidar, hslidar_delay_line,
};
use guided_dtof::engine::{
    Cycle, EngineError, Gate, GateSimulation, PulsedPixel, Replay, Runner, Timed, Window, cancelled,
};
use guided_dtof::netlist::Corner;
use guided_dtof::photon::SpadEvent;
use guided_dtof::units::Time;
use rand::{RngExt, SeedableRng, rngs::StdRng};

/// A chip of any kind with a skew of its own, and what happens to it.
fn any(random: &mut StdRng) -> (Scenario, Silicon) {
    let (rows, cols) = (random.random_range(1..3), random.random_range(2..5));
    let mut config = match random.random_range(0..3) {
        0 => scenario::random(random, rows, cols).config,
        1 => (*hslidar()).clone(),
        _ => (*hslidar_delay_line()).clone(),
    };
    config = SensorConfig {
        rows,
        cols,
        corner: Corner::ALL[random.random_range(0..3)],
        clk_skew_ps: random.random_range(0.0..=200.0),
        delay_sigma: random.random_range(0.0..0.2),
        delay_seed: random.random(),
        mode: if random.random_bool(0.2) {
            Mode::Conventional
        } else {
            Mode::Guided
        },
        ..config
    };
    let silicon = scenario::silicon(random, &config);
    (scenario::of_sensor(random, config), silicon)
}

#[test]
fn every_engine_counts_what_the_array_counts() {
    let (mut compared, mut by_law) = (0, 0);
    for seed in 0..u64::from(cases(40)) {
        let (scenario, silicon) = any(&mut StdRng::seed_from_u64(seed));
        let Scenario {
            config,
            exposure,
            starts,
            ..
        } = &scenario;
        let pulses = scenario.pulses();
        let sensor = Sensor::from(config).made_of(&silicon);
        let size = (config.rows, config.cols);
        let mut array = GateSimulation::new(&sensor, exposure, (0, 0), size, starts, &pulses);
        array.run(&mut ());
        let pixels = PulsedPixel::array(starts, &pulses);
        let Ok(counts) = array.histograms() else {
            let alone = Timed::new(&sensor, exposure, Runner::Gate).replay(&pixels);
            assert!(alone.is_err(), "seed {seed}: {config:?} {silicon:?}");
            continue;
        };
        let timed = [Runner::Gate, Runner::Window, Runner::Cycle]
            .map(|runner| Box::new(Timed::new(&sensor, exposure, runner)) as Box<dyn Replay>);
        let untimed: [Box<dyn Replay>; 3] = [
            Box::new(Gate::new(&sensor, exposure)),
            Box::new(Window::new(&sensor, exposure)),
            Box::new(Cycle::new(&sensor, exposure)),
        ];
        for (engine, runs) in timed.iter().chain(&untimed).enumerate() {
            match runs.replay(&pixels) {
                Ok(found) => assert_eq!(
                    found, counts,
                    "seed {seed}, engine {engine}: {config:?} {exposure:?} {starts:?} {silicon:?}"
                ),
                Err(EngineError::Unknown { .. }) => panic!("seed {seed}: nothing is unknown"),
                // By name: races, mismatch, delay lines without gates.
                Err(_) => {
                    assert!(engine > 0, "seed {seed}: gates with their own delays");
                    continue;
                }
            }
            compared += 1;
            by_law += usize::from(engine == 4);
        }
    }
    assert!(compared > 100 && by_law > 10, "{compared}, {by_law}");
}

/// Photons of a SPAD that CLK's edge parts in the last column, but not in the first.
#[test]
fn photons_cancel_by_the_clk_of_their_column() {
    let sensor = Sensor::from(SensorConfig {
        rows: 1,
        cols: 3,
        corner: Corner::Slow,
        clk_skew_ps: 200.0,
        dead_time_ns: 1.0,
        ..SensorConfig::default()
    });
    let exposure = Exposure::new(&sensor, 60, 1);
    let law = WindowLaw::new(&sensor, &exposure).of_macropixel(2);
    let window = law.window(30).open().unwrap();
    let edge = law.edges(&window, 0).edges()[4];
    let pulse = |ps| SpadEvent {
        time: edge + Time::from_ps(ps),
        spad: 3,
    };
    let (parted, cancel) = ([pulse(-600), pulse(500)], [pulse(50), pulse(1_100)]);
    let gate = Gate::new(&sensor, &exposure);
    for (pulses, lost) in [(parted, 0), (cancel, 2)] {
        let pixel = PulsedPixel {
            number: 2,
            start: 30,
            pulses: &pulses,
        };
        let counted: u16 = gate.replay(&[pixel]).unwrap().counts().iter().sum();
        assert_eq!(u64::from(counted), 2 - lost);
        let window = Window::new(&sensor, &exposure);
        let timed = Timed::new(&sensor, &exposure, Runner::Window);
        let engines: [&dyn Replay; 3] = [&gate, &window, &timed];
        for engine in engines {
            assert_eq!(cancelled(engine, &sensor, &[pixel]), lost);
        }
    }
}
