//! Studies of theory beside the formulas.

use super::*;
use rand_philox::Philox;

use crate::chip::{hslidar, hslidar_delay_line};
use crate::photon::{RandomPurpose, normal, random_stream};
use crate::settings::Settings;

#[test]
fn every_key_is_taken_and_every_result_has_its_column() {
    let wall = |asked: &str| {
        let rig = Rig::new(&SensorConfig::default(), &Scene::outdoor());
        Wall::new(rig, &toml::from_str(asked).unwrap())
    };
    let usual = wall("");
    for key in TheorySettings::KEYS {
        let asked = match key.name {
            "model" => "model = \"poisson\"".to_owned(),
            name => format!("{name} = 0.9").replace("laser_cycles = 0.9", "laser_cycles = 9"),
        };
        assert_ne!(wall(&asked), usual, "{} changes nothing", key.name);
    }
    assert_eq!(
        usual.results(&mut TheoryCache::default()).len(),
        columns().len()
    );
}

#[test]
fn results_are_those_of_the_formulas() {
    let (sensor, scene) = (SensorConfig::default(), Scene::outdoor());
    let asked = TheorySettings {
        range_m: 120.0,
        goal_detection: Some(0.99),
        ..TheorySettings::default()
    };
    let wall = Wall::new(Rig::new(&sensor, &scene), &asked);
    let results = wall.results(&mut TheoryCache::default());
    let number = |name: &str| {
        let at = columns().iter().position(|c| c.name == name).unwrap();
        results[at].number().unwrap()
    };
    let budget = scene.photon_budget(64, 64);
    assert_eq!(
        number("signal_per_cycle"),
        budget.signal_per_pulse(120.0, 0.3)
    );
    assert!((number("p_detection") + number("p_miss") - 1.0).abs() < 1e-12);
    assert_eq!(
        number("p_right"),
        number("p_detection") * number("share_in_window")
    );
    // Every photon counts: the bound is that of its formula. One hit a bin and laser cycle tells less.
    let all = TheorySettings {
        model: Counts::Poisson,
        ..asked
    };
    let of_all = Wall::new(Rig::new(&sensor, &scene), &all).results(&mut TheoryCache::default());
    let at = columns()
        .iter()
        .position(|c| c.name == "precision_bound_m")
        .unwrap();
    let of_all = of_all[at].number().unwrap();
    assert!(of_all > 0.0 && number("precision_bound_m") > of_all);
    assert!(number("precision_thompson_m") > 0.0);
    assert!((number("window_m") - 16.0 * number("bin_m")).abs() < 1e-12);

    let longer = Wall {
        laser_cycles: number("laser_cycles_for_goal") as u64,
        ..wall
    };
    let at = columns()
        .iter()
        .position(|c| c.name == "p_detection")
        .unwrap();
    assert!(
        longer.results(&mut TheoryCache::default())[at]
            .number()
            .unwrap()
            >= 0.99
    );
}

/// 200 MHz and steps of four periods; elements of 2.6 ns and steps of 12.5 ns (thesis Tables 11 and 14); both of 7 bits.
#[test]
fn bins_and_steps_are_those_of_the_sensor() {
    let scene = Scene::outdoor();
    for (sensor, bin_ns, step_ns) in [(hslidar(), 5.0, 20.0), (hslidar_delay_line(), 2.6, 12.5)] {
        let results = Wall::new(Rig::new(&sensor, &scene), &TheorySettings::default())
            .results(&mut TheoryCache::default());
        let number = |name: &str| {
            let at = columns().iter().position(|c| c.name == name).unwrap();
            results[at].number().unwrap()
        };
        let metres = |ns: f64| 0.5e-9 * ns * SPEED_OF_LIGHT_M_PER_S;
        assert!((number("bin_m") - metres(bin_ns)).abs() < 1e-9);
        assert!((number("window_m") - metres(8.0 * bin_ns)).abs() < 1e-9);
        assert!((number("reach_m") - metres(128.0 * step_ns)).abs() < 1e-9);
    }
}

#[test]
fn what_was_computed_before_changes_nothing() {
    let mut last = TheoryCache::default();
    let rig = Rig::new(&SensorConfig::default(), &Scene::outdoor());
    for range_m in [20.0, 150.0] {
        for laser_cycles in [100, 1000] {
            for model in [Counts::Bernoulli, Counts::Gaussian] {
                for guide_sigma_m in [0.5, 2.0] {
                    let asked = TheorySettings {
                        range_m,
                        laser_cycles,
                        model,
                        guide_sigma_m,
                        ..TheorySettings::default()
                    };
                    let wall = Wall::new(rig, &asked);
                    assert_eq!(
                        wall.results(&mut last),
                        wall.results(&mut TheoryCache::default())
                    );
                }
            }
        }
    }
}

#[test]
fn a_black_wall_has_no_precision_and_is_found_by_chance() {
    let asked = TheorySettings {
        reflectivity: 0.0,
        ..TheorySettings::default()
    };
    let rig = Rig::new(&SensorConfig::default(), &Scene::outdoor());
    let wall = Wall::new(rig, &asked);
    let results = wall.results(&mut TheoryCache::default());
    assert_eq!(results[4], TableCell::Empty);
    // The echo's bin and its neighbour.
    assert!((results[2].number().unwrap() - 2.0 / 16.0).abs() < 1e-9);
}

/// Pulses of 1, 2 and 4.5 ns gave the same; beyond the reach windows held the wall.
#[test]
fn longer_pulses_are_found_less_often_and_walls_beyond_the_reach_never() {
    let number = |fwhm_ns: f64, range_m: f64, name: &str| {
        let mut scene = Scene::outdoor();
        scene.lidar.pulse_fwhm_ns = fwhm_ns;
        let asked = TheorySettings {
            range_m,
            reflectivity: 0.1,
            illuminance_klux: Some(100.0),
            laser_cycles: 200,
            ..TheorySettings::default()
        };
        let wall = Wall::new(Rig::new(&SensorConfig::default(), &scene), &asked);
        let at = columns().iter().position(|c| c.name == name).unwrap();
        wall.results(&mut TheoryCache::default())[at].number()
    };
    let [short, usual, long] = [1.0, 2.0, 4.5].map(|fwhm_ns| number(fwhm_ns, 200.0, "p_detection"));
    assert!(
        short > usual && usual > long,
        "{short:?} {usual:?} {long:?}"
    );
    let reach_m = number(2.0, 1.0, "reach_m").unwrap();
    assert_eq!(number(2.0, 1.01 * reach_m, "p_right"), Some(0.0));
    // Too far away for a precision: empty, not 1.7e199.
    assert_eq!(number(2.0, 1e5, "precision_bound_m"), None);
}

fn uniform(random: &mut Philox) -> f64 {
    f64::from(random.next_u32()) * 2f64.powi(-32)
}

/// A number of photons, by multiplication of uniform numbers.
fn photons(mean: f64, random: &mut Philox) -> u32 {
    let (mut left, mut photons) = (uniform(random), 0);
    while left > libm::exp(-mean) {
        left *= uniform(random);
        photons += 1;
    }
    photons
}

/// Each photon has a place in the pulse, and its avalanche and the trigger have a delay of their own.
#[test]
fn photons_that_are_late_one_by_one_are_found_as_often_as_theory_says() {
    const TO_SIGMA: f64 = 0.424_660_900_144_009_5;
    let mut scene = Scene::outdoor();
    scene.lidar.pulse_fwhm_ns = 1.0;
    scene.lidar.spad_jitter_fwhm_ps = 3000.0;
    scene.lidar.trigger_jitter_ps = 1500.0;
    let asked = TheorySettings {
        range_m: 150.0,
        reflectivity: 0.1,
        illuminance_klux: Some(50.0),
        laser_cycles: 15,
        ..TheorySettings::default()
    };
    let wall = Wall::new(Rig::new(&SensorConfig::default(), &scene), &asked);
    let results = wall.results(&mut TheoryCache::default());
    let number = |name: &str| {
        let at = columns().iter().position(|c| c.name == name).unwrap();
        results[at].number().unwrap()
    };
    let (signal, background) = (
        number("signal_per_cycle"),
        number("background_per_bin_cycle"),
    );
    let bin_ns = 1e9 * wall.rig.bin_s;
    let widths_ns = [1.0 * TO_SIGMA, 3.0 * TO_SIGMA, 1.5];
    let fwhm_ns = widths_ns.map(|ns| ns * ns).iter().sum::<f64>().sqrt() / TO_SIGMA;
    let within = (0.5 * fwhm_ns / bin_ns).max(1.0);
    let mut random = random_stream(5, RandomPurpose::Photons, 0, 0);
    let mut right = 0;
    let trials = 3000;
    for _ in 0..trials {
        let at = 8.0 + uniform(&mut random);
        let mut counts = [0; 16];
        for _ in 0..wall.laser_cycles {
            let mut hits = [false; 16];
            for hit in &mut hits {
                *hit = photons(background, &mut random) > 0;
            }
            let trigger_ns = widths_ns[2] * normal(&mut random);
            for _ in 0..photons(signal, &mut random) {
                let late_ns =
                    widths_ns[0] * normal(&mut random) + widths_ns[1] * normal(&mut random);
                let place = at + (trigger_ns + late_ns) / bin_ns;
                if (0.0..16.0).contains(&place) {
                    hits[place as usize] = true;
                }
            }
            for (count, hit) in counts.iter_mut().zip(hits) {
                *count += i32::from(hit);
            }
        }
        let most = *counts.iter().max().expect("16 bins");
        let tied: Vec<usize> = (0..16).filter(|&bin| counts[bin] == most).collect();
        let winner = tied[random.next_u32() as usize % tied.len()];
        right += u32::from((winner as f64 + 0.5 - at).abs() <= within);
    }
    let (share, expected) = (f64::from(right) / f64::from(trials), number("p_detection"));
    let deviation = (expected * (1.0 - expected) / f64::from(trials)).sqrt();
    assert!((0.3..0.95).contains(&expected), "{expected} tells little");
    assert!(
        (share - expected).abs() < 4.0 * deviation + 0.005,
        "{share} {expected}"
    );
}
