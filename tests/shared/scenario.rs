//! Random sensors with random start values, exposures and SPAD pulses.

use std::path::{Path, PathBuf};

use guided_dtof::chip::{
    AfterBorrow, EventType, Exposure, Mode, PCounter, SensorConfig, Silicon, Tap,
};
use guided_dtof::netlist::{Conditions, Corner, Mismatch};
use guided_dtof::photon::{SpadEvent, apply_dead_time};
use guided_dtof::units::Time;
use rand::{RngExt, rngs::StdRng};

/// A sensor and everything that happens to it.
pub struct Scenario {
    /// The chip.
    pub config: SensorConfig,
    /// Its clocks.
    pub exposure: Exposure,
    /// Start values, row-major.
    pub starts: Vec<u16>,
    /// Rising edges of SPAD_RAW per macropixel, row-major.
    pub pulses: Vec<Vec<SpadEvent>>,
}

impl Scenario {
    /// Anything that the chip allows.
    pub fn random(random: &mut StdRng, rows: usize, cols: usize) -> Self {
        let config = random_sensor(random, rows, cols);
        Self::of(random, config)
    }

    /// Anything that may happen to this sensor.
    pub fn of(random: &mut StdRng, config: SensorConfig) -> Self {
        // Without memory a counter must come round with STOP, or no two laser cycles are alike.
        let wider = usize::from(config.tap == Tap::Borrow);
        let round = 1 << (config.counter_bits + wider);
        let stop_periods = match config.p_counter.row().has_memory {
            false if round <= 128 => round,
            _ => random.random_range(20..80),
        };
        let exposure = Exposure::new(&config, stop_periods, random.random_range(1..8));
        Self::exposed(random, config, exposure)
    }

    /// Any start values and pulses.
    pub fn exposed(random: &mut StdRng, config: SensorConfig, exposure: Exposure) -> Self {
        // Some never open their window.
        let most = exposure.stop_periods as usize / config.step_periods + 1;
        let most = config.largest_start().min(most as u16);
        let pixels = config.pixels();
        let starts = (0..pixels).map(|_| random.random_range(0..=most)).collect();
        let pulses = (0..pixels as u32)
            .map(|pixel| {
                let mut pulses: Vec<SpadEvent> = (0..random.random_range(0..200))
                    .map(|_| SpadEvent {
                        time: Time::from_fs(random.random_range(0..exposure.end().as_fs())),
                        spad: random.random_range(0..config.spads() as u8),
                    })
                    .collect();
                pulses.sort_unstable();
                apply_dead_time(&mut pulses, &config.spad_model(), pixel);
                pulses
            })
            .collect();
        Scenario {
            config,
            exposure,
            starts,
            pulses,
        }
    }

    /// What the P-counters' memories hold after the load, if they have any.
    #[allow(dead_code)]
    pub fn loaded(&self) -> Vec<Option<u16>> {
        let has_memory = self.config.p_counter.row().has_memory;
        self.starts
            .iter()
            .map(|&start| has_memory.then_some(start))
            .collect()
    }

    /// The pulses as the engines take them.
    pub fn pulses(&self) -> Vec<&[SpadEvent]> {
        self.pulses.iter().map(Vec::as_slice).collect()
    }
}

/// Every P-counter that a sensor may have.
pub fn p_counters() -> Vec<(PCounter, Tap, AfterBorrow)> {
    let mut all = Vec::new();
    for p_counter in PCounter::ALL {
        for tap in Tap::ALL {
            for after_borrow in AfterBorrow::ALL {
                let config = SensorConfig {
                    p_counter,
                    tap,
                    after_borrow,
                    ..SensorConfig::default()
                };
                if config.check().is_ok() {
                    all.push((p_counter, tap, after_borrow));
                }
            }
        }
    }
    all
}

/// What a chip of this description is made of, its library in any conditions: any process, voltage and temperature, and mismatch now and then.
#[allow(dead_code)]
pub fn silicon(random: &mut StdRng, config: &SensorConfig) -> Silicon {
    let conditions = Conditions {
        process: Corner::ALL[random.random_range(0..3)],
        voltage_v: random.random_range(0.95..1.3),
        temperature_c: random.random_range(-40.0..125.0),
    };
    let mismatch = Mismatch {
        sigma: random.random_range(0.0..0.2),
        seed: random.random(),
    };
    Silicon {
        factor: match random.random_bool(0.3) {
            true => 1.0,
            false => conditions.delay_factor().expect("delays are known there"),
        },
        mismatch: random.random_bool(0.3).then_some(mismatch),
        ..Silicon::of(config)
    }
}

/// The library of invented numbers.
pub fn example_library() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors/liberty/example.lib")
}

fn random_sensor(random: &mut StdRng, rows: usize, cols: usize) -> SensorConfig {
    let clk_hz = random.random_range(100e6..500e6);
    // Each as often as the others, however many there are, and whatever it can do.
    let p_counter = PCounter::ALL[random.random_range(0..PCounter::ALL.len())];
    let mut p_counters = p_counters();
    p_counters.retain(|of| of.0 == p_counter);
    let (_, tap, after_borrow) = p_counters[random.random_range(0..p_counters.len())];
    // Every other macropixel is the QuantIC4x4's.
    const GRIDS: [(usize, usize); 5] = [(2, 2), (8, 8), (1, 1), (2, 4), (8, 1)];
    let (spad_rows, spad_cols) = match random.random_bool(0.5) {
        true => (4, 4),
        false => GRIDS[random.random_range(0..GRIDS.len())],
    };
    let mut config = SensorConfig {
        spad_rows,
        spad_cols,
        p_counter,
        tap,
        after_borrow,
        // Without a reset there is no divider.
        step_periods: match p_counter.row().has_memory {
            false => 1,
            true => [1, 1, 1, 2, 4, 8][random.random_range(0..6)],
        },
        rows,
        cols,
        clk_hz,
        stop_phase_ps: random.random_range(-0.45..0.45) * 1e12 / clk_hz,
        counter_bits: random.random_range(3..10),
        bins: random.random_range(2..17),
        bin_bits: random.random_range(2..15),
        dead_time_ns: random.random_range(3.0..12.0),
        threshold: random.random_range(0..2 + u8::from(spad_rows * spad_cols > 1)),
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
    // One that some number of SPADs meets.
    let possible = match config.event_type {
        EventType::Less => 1..=u8::MAX,
        EventType::Equal => 0..=config.spads() as u8,
        EventType::Greater => 0..=config.spads() as u8 - 1,
    };
    config.threshold = config.threshold.clamp(*possible.start(), *possible.end());
    // One in six is made of a library, by a bit that no other draw sees.
    if clk_hz.to_bits() % 6 == 0 {
        for file in [
            &mut config.liberty,
            &mut config.liberty_slow,
            &mut config.liberty_fast,
        ] {
            *file = example_library();
        }
    }
    config
}
