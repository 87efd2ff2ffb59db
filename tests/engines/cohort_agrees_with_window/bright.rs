//! Light in which steps of a CLK period are farthest from the truth: blinding echoes, echoes anywhere and of any width,
//! afterpulses and crosstalk.

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{
    Cohort, CohortOptions, Expose, LitPixel, Window, stream_config, variance_left_out,
};
use guided_dtof::photon::{DeadTimeLaw, PhotonStream, PixelLight};
use guided_dtof::units::Time;
use proptest::prelude::*;

use super::comparison::{Case, case, seeds};

/// The light in which steps of a CLK period are farthest from the truth.
#[test]
fn blinding_echoes_and_the_tails_behind_them() {
    for law in [DeadTimeLaw::NonParalysable, DeadTimeLaw::Paralysable] {
        for (name, dead_time_ns, sigma, arrival) in [
            ("saturating echo", 8.0, 1_900, 85),
            ("its tail", 8.0, 1_900, 66),
            ("saturating flash", 8.0, 0, 85),
            ("tail of a flash", 8.0, 0, 63),
            ("saturating echo, long dead time", 23.0, 1_900, 75),
            ("tail, dead time of one CLK period", 2.605, 1_900, 66),
            ("a pulse of 200 ps", 8.0, 200, 70),
        ] {
            let name = format!("{name}, {law:?}");
            let light = PixelLight::echo(60.0, Time::from_ns(arrival)).with_background(200e6);
            let sensor = SensorConfig {
                dead_time_ns,
                ..SensorConfig::default()
            };
            Case {
                name: &name,
                sensor,
                light,
                law,
                sigma: Time::from_ps(sigma),
                stop_periods: 240,
                laser_cycles: 12,
                seeds: seeds() / 4,
                ..case()
            }
            .agrees();
        }
    }
}

/// Each of 1 %, and both of 5 % where they show more.
#[test]
fn afterpulses_and_crosstalk() {
    for (name, probability, afterpulse_time_ns, signal_per_cycle, background_hz) in [
        ("daylight", 0.01, 5.0, 0.8, 40e6),
        ("dusk, slow traps", 0.05, 30.0, 0.3, 4e6),
        ("saturating echo", 0.01, 5.0, 60.0, 200e6),
        ("5 %", 0.05, 5.0, 5.0, 80e6),
    ] {
        let sensor = SensorConfig {
            afterpulse_probability: probability,
            afterpulse_time_ns,
            crosstalk_probability: probability,
            ..SensorConfig::default()
        };
        let light = PixelLight::echo(signal_per_cycle, case().light.arrival())
            .with_background(background_hz);
        let name = format!("secondaries, {name}");
        Case {
            name: &name,
            sensor,
            light,
            stop_periods: 400,
            laser_cycles: 12,
            seeds: seeds() / 4,
            options: CohortOptions {
                memory: 1.0,
                ..CohortOptions::default()
            },
            ..case()
        }
        .agrees();
    }
}

/// In little light, with windows longer than traps hold, nearly all is left out that can be; without afterpulses nothing is.
#[test]
fn the_variance_that_afterpulses_add_is_left_out_as_told() {
    const MACROPIXELS: u32 = 2500;
    for probability in [0.0, 0.2] {
        let sensor = SensorConfig {
            bins: 64,
            afterpulse_probability: probability,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&sensor, 400, 50);
        let stream = stream_config(&sensor, &exposure, 7, Time::from_ps(1_900));
        let light = PixelLight::background(2e6);
        let pixels: Vec<LitPixel> = (0..MACROPIXELS)
            .map(|number| LitPixel {
                number,
                start: 380,
                light: Some(light.clone()),
            })
            .collect();
        let mean_and_variance = |engine: &dyn Expose| {
            let exposed = engine.expose(&PhotonStream::new(&stream), &pixels).unwrap();
            let of_one = |counts: &[u16]| counts.iter().map(|&n| f64::from(n)).sum();
            let totals: Vec<f64> = exposed.histograms.iter().map(of_one).collect();
            let mean = totals.iter().sum::<f64>() / totals.len() as f64;
            let squares: f64 = totals.iter().map(|n| (n - mean).powi(2)).sum();
            (mean, squares / (totals.len() - 1) as f64)
        };
        let window = mean_and_variance(&Window::new(&sensor, &exposure));
        let options = CohortOptions {
            memory: 1.0,
            ..CohortOptions::default()
        };
        let cohort = mean_and_variance(&Cohort::new(&sensor, &exposure, options));
        let error = (2.0 / f64::from(MACROPIXELS)).sqrt();
        assert!(
            (cohort.0 / window.0 - 1.0).abs() < 5.0 * error * (window.1 / 2.0).sqrt() / window.0
        );
        let left_out = 1.0 - cohort.1 / window.1;
        let told = variance_left_out(probability);
        let told = 0.6 * told - 5.0 * error..=told + 5.0 * error;
        assert!(
            told.contains(&left_out),
            "{left_out} of {probability}: {told:?}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, max_shrink_iters: 0, ..ProptestConfig::default() })]
    /// Arrivals from before a laser cycle to after it, pulses from none to longer than a window.
    #[test]
    fn echoes_anywhere(
        place in 0.0f64..1.0,
        sigma_ns in prop_oneof![Just(0.0), 0.05f64..3.0, 3.0f64..60.0],
        start in 0u16..79,
        signal_per_cycle in 0.5f64..20.0,
    ) {
        let cycle_ns = 80.0 * 1e9 / 384e6;
        let arrival_ns = -3.0 * sigma_ns + place * (cycle_ns + 6.0 * sigma_ns);
        let light = PixelLight::echo(signal_per_cycle, Time::from_ps((1e3 * arrival_ns) as i64)).with_background(5e6);
        let name = format!("{signal_per_cycle:.1} photons at {arrival_ns:.1} ns, {sigma_ns:.2} ns wide, start {start}");
        Case {
            name: &name,
            light,
            start,
            sigma: Time::from_ps((1e3 * sigma_ns) as i64),
            stop_periods: 80,
            laser_cycles: 6,
            seeds: seeds() / 4,
            options: CohortOptions { memory: 1.0, ..CohortOptions::default() },
            ..case()
        }
        .agrees();
    }
}
