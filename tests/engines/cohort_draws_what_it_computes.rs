//! The cohort engine by itself: its draws have the means that it computes, those follow closed forms, histograms depend on
//! seed and macropixel alone, and what it cannot follow it refuses.

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{Cohort, CohortOptions, Expose, Histograms, LitPixel, stream_config};
use guided_dtof::photon::{DeadTimeLaw, PhotonStream, PixelLight};
use guided_dtof::units::Time;

/// A target in bright daylight.
const LIGHT: PixelLight = PixelLight::echo(0.8, Time::from_ns(85)).with_background(40e6);

const DARK: PixelLight = PixelLight::dark();

#[test]
fn paralysable_spads_follow_their_closed_form() {
    // Even light r on a SPAD: it fires at r·exp(−r·dead) per second.
    let sensor = SensorConfig::default();
    let exposure = Exposure::new(&sensor, 520, 1_000_000_000);
    let mut stream = stream_config(&sensor, &exposure, 1, Time::from_ps(1_900));
    let light = DARK.with_background(200e6);
    stream.spads.law = DeadTimeLaw::Paralysable;
    let options = CohortOptions {
        neglect: 0.0,
        ..CohortOptions::default()
    };
    let expected = Cohort::new(&sensor, &exposure, options)
        .expected(&stream, 300, &light)
        .unwrap();
    let rate: f64 = 200e6 / 16.0;
    let period_s = 1.0 / exposure.clock.as_hz();
    let pulse = rate * (-rate * 8e-9).exp() * period_s;
    let event = 1.0 - (1.0 - pulse).powi(16);
    let off = expected[7] / 1e9 / event - 1.0;
    assert!(off.abs() < 2e-4, "{off}");
}

#[test]
fn draws_have_the_computed_means_for_a_billion_cycles_and_every_law() {
    let sensor = SensorConfig {
        bin_bits: 16,
        ..SensorConfig::default()
    };
    for cycles in [1, 100, 1_000_000_000] {
        let exposure = Exposure::new(&sensor, 520, cycles);
        for (law, background_hz, signal_per_cycle) in [
            (DeadTimeLaw::NonParalysable, 8e6, 0.1),
            (DeadTimeLaw::Paralysable, 8e6, 0.1),
            (DeadTimeLaw::NonParalysable, 1e-3, 1e-12),
            (DeadTimeLaw::Paralysable, 100e6, 500.0),
            (DeadTimeLaw::NonParalysable, 100e6, 500.0),
        ] {
            let options = CohortOptions::default();
            let cohort = Cohort::new(&sensor, &exposure, options);
            let light = PixelLight::echo(signal_per_cycle, Time::from_ns(760))
                .with_background(background_hz);
            let stream = |seed| {
                let mut stream = stream_config(&sensor, &exposure, seed, Time::from_ps(1_900));
                stream.spads.law = law;
                stream
            };
            let expected = cohort.expected(&stream(0), 300, &light).unwrap();
            let seeds = 20u64;
            let mut sums = vec![0.0; expected.len()];
            for seed in 0..seeds {
                let hits = cohort.hits(&stream(seed), 3, 300, &light).unwrap();
                sums.iter_mut()
                    .zip(&hits)
                    .for_each(|(sum, &n)| *sum += n as f64);
            }
            for (bin, (sum, mean)) in sums.iter().zip(&expected).enumerate() {
                let p = mean / f64::from(cycles);
                let (sum_mean, variance) = (mean * seeds as f64, mean * (1.0 - p) * seeds as f64);
                let off = (sum - sum_mean).abs();
                assert!(
                    off <= 5.0 * variance.sqrt() + 5.0,
                    "{cycles} {law:?} {light:?} bin {bin}: {sum} {sum_mean}"
                );
            }
        }
    }
}

#[test]
fn what_cohorts_cannot_follow_is_refused() {
    let short = SensorConfig {
        dead_time_ns: 2.0,
        ..SensorConfig::default()
    };
    for (sensor, light, expected) in [
        (short, LIGHT, "dead time"),
        (SensorConfig::default(), LIGHT.with_background(1e12), "busy"),
        (
            SensorConfig {
                dead_time_ns: 500.0,
                ..SensorConfig::default()
            },
            LIGHT,
            "busy",
        ),
    ] {
        let exposure = Exposure::new(&sensor, 64, 10);
        let stream = stream_config(&sensor, &exposure, 1, Time::from_ps(1_900));
        let cohort = Cohort::new(&sensor, &exposure, CohortOptions::default());
        let error = cohort.draw(&stream, 0, 40, &light).unwrap_err().to_string();
        assert!(
            error.contains(expected) && error.contains("cannot follow"),
            "{error}"
        );
    }
}

#[test]
fn histograms_depend_on_seed_and_pixel_alone() {
    let sensor = SensorConfig::default();
    let exposure = Exposure::new(&sensor, 64, 60);
    let cohort = Cohort::new(&sensor, &exposure, CohortOptions::default());
    let stream = |seed| stream_config(&sensor, &exposure, seed, Time::from_ps(1_900));
    let draw = |seed, pixel| cohort.draw(&stream(seed), pixel, 40, &LIGHT).unwrap();
    let pixels = [3, 9, 2].map(|number| LitPixel {
        number,
        start: 40,
        light: Some(LIGHT),
    });
    let exposed = cohort.expose(&PhotonStream::new(&stream(7)), &pixels);
    let histograms = exposed.unwrap().histograms;
    let drawn = [draw(7, 3), draw(7, 9), draw(7, 2)];
    assert_eq!(histograms, Histograms::from_rows(sensor.bins, drawn));
    assert_ne!(draw(7, 3), draw(8, 3));
    assert_ne!(draw(7, 3), draw(7, 9));
}
