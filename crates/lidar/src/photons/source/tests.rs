//! Photons of a light source: the same on any number of threads, at the rates that its facts state, within the memory allowed.

use super::*;
use crate::photon::SpadModel;

/// Macropixels of the street in few laser cycles.
fn street(exposure: impl FnOnce(LitExposure) -> LitExposure) -> LightSource {
    lit_street(&Scene::outdoor(), exposure)
}

fn lit_street(scene: &Scene, exposure: impl FnOnce(LitExposure) -> LitExposure) -> LightSource {
    let sensor = Sensor::default();
    let lit = LitExposure::of_sensor(&sensor, (520, 150), 4);
    LightSource::of_scene(scene, (6, 6), &exposure(lit)).unwrap()
}

fn all(source: &LightSource, most_bytes: f64) -> (Vec<(u32, SpadEvent)>, PulseTotals) {
    let pixels: Vec<u32> = (0..source.pixels() as u32).collect();
    let mut pulses = Vec::new();
    let each = |pixel, some: &[SpadEvent]| {
        pulses.extend(some.iter().map(|pulse| (pixel, *pulse)));
        Ok::<(), ()>(())
    };
    let totals = source.for_each_within(most_bytes, &pixels, each, |_| ());
    (pulses, totals.unwrap())
}

#[test]
fn chunks_and_threads_change_nothing() {
    let source = street(|lit| LitExposure {
        laser_cycles: 40,
        spads: SpadModel {
            afterpulse_probability: 0.02,
            afterpulse_time: Time::from_ns(20),
            crosstalk_probability: 0.02,
            ..lit.spads
        },
        ..lit
    });
    let whole = all(&source, f64::INFINITY);
    assert!(whole.0.len() > 5_000, "{}", whole.0.len());
    assert_eq!(whole.1.pulses, whole.0.len() as u64);
    // As they are drawn, and some macropixels at a time.
    for most_bytes in [0.0, 1e4, 1e5] {
        assert!(all(&source, most_bytes) == whole, "{most_bytes}");
    }
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().unwrap();
        assert!(pool.install(|| all(&source, 1e5)) == whole, "{threads}");
    }
}

#[test]
fn the_first_failure_ends_it() {
    let source = street(|lit| lit);
    for most_bytes in [0.0, f64::INFINITY] {
        let mut calls = 0;
        let each = |_, _: &[SpadEvent]| {
            calls += 1;
            Err("full")
        };
        let ended = source.for_each_within(most_bytes, &[0, 1, 2], each, |_| ());
        assert_eq!((ended, calls), (Err("full"), 1));
    }
}

/// Photons of SPADs that are nearly never blind, against the Poisson means that the facts say.
#[test]
fn rates_are_those_of_the_facts() {
    let mut dim = Scene::outdoor();
    dim.light.illuminance_klux = 0.1;
    dim.lidar.pulse_energy_uj = 0.5;
    for spads in [1, 7, 16, 64] {
        let source = lit_street(&dim, |lit| {
            let lit = lit.with_spads(spads).unwrap();
            LitExposure {
                clock: Frequency::from_period(Time::from_ns(2_000)).unwrap(),
                periods: 1,
                laser_cycles: 400,
                lead: Time::ZERO,
                spads: SpadModel {
                    dead_time: Time::from_ps(1),
                    afterpulse_probability: 0.0,
                    crosstalk_probability: 0.0,
                    ..lit.spads
                },
                ..lit
            }
        });
        let mut deviations = Vec::new();
        for pixel in 0..source.pixels() as u32 {
            let facts = source.facts(pixel);
            let mean = 400.0 * (facts.signal + facts.background_hz * 2e-6);
            let arrival = facts.arrival.map(Time::as_fs);
            let (mut pulses, mut near) = (0.0, 0.0);
            source.pulses(pixel, |some| {
                for pulse in some {
                    assert!(usize::from(pulse.spad) < spads);
                    pulses += 1.0;
                    let into_fs = pulse.time.as_fs() % 2_000_000_000;
                    let is_near = |arrival_fs: i64| (into_fs - arrival_fs).abs() < 10_000_000;
                    near += f64::from(u8::from(arrival.is_some_and(is_near)));
                }
                ControlFlow::Continue(())
            });
            deviations.push((pulses - mean) / mean.sqrt());
            if facts.signal > 0.25 {
                // Within five standard deviations of the laser pulse there are few others.
                assert!(
                    near > 0.2 * facts.signal * 400.0,
                    "{pixel}: {near} {facts:?}"
                );
            }
        }
        let n = deviations.len() as f64;
        let mean = deviations.iter().sum::<f64>() / n;
        let variance = deviations.iter().map(|z| z * z).sum::<f64>() / n;
        assert!(mean.abs() < 5.0 / n.sqrt(), "{spads}: {mean}");
        assert!(
            (variance - 1.0).abs() < 5.0 * (2.0 / n).sqrt(),
            "{spads}: {variance}"
        );
    }
}

#[test]
fn an_echo_later_than_several_laser_cycles_is_there() {
    let mut scene = Scene::outdoor();
    scene.light.illuminance_klux = 0.0;
    scene.lidar.pulse_energy_uj = 0.01;
    let lit = LitExposure {
        clock: Frequency::from_period(Time::from_ns(40)).unwrap(),
        periods: 1,
        laser_cycles: 20_000,
        lead: Time::ZERO,
        ..LitExposure::of_sensor(&Sensor::default(), (520, 1), 9)
    };
    let source = LightSource::of_scene(&scene, (1, 1), &lit).unwrap();
    let facts = source.facts(0);
    assert!(facts.arrival.unwrap() > Time::from_ns(80), "{facts:?}");
    let mut pulses = 0.0;
    source.pulses(0, |some| {
        pulses += some.len() as f64;
        ControlFlow::Continue(())
    });
    assert!(
        pulses > 1000.0 && pulses <= source.expected_pulses(0) * 1.1,
        "{pulses}"
    );
}

#[test]
fn light_that_does_not_fit_into_memory_is_refused() {
    let mut scene = Scene::outdoor();
    scene.light.illuminance_klux = 1e6;
    let lit = LitExposure {
        clock: Frequency::from_period(Time::from_ns(1_000_000)).unwrap(),
        periods: 1,
        ..LitExposure::of_sensor(&Sensor::default(), (520, 1), 9)
    };
    let refused = LightSource::of_scene(&scene, (1, 1), &lit);
    assert!(matches!(refused, Err(LightSourceError::Background { .. })));
}
