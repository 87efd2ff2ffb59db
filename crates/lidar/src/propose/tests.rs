//! Designs beside closed forms, the thesis and engines; limits that are named.

use super::*;
use crate::chip::{Sensor, SensorConfig};
use crate::scene::{Lidar, Scene, Train};
use crate::theory::precision::{cramer_rao, cramer_rao_laser_cycles, range_m, thompson, time_ns};

/// A dark wall not far away.
const NEAR: Goal = Goal {
    range_m: 20.0,
    reflectivity: 0.1,
    illuminance_klux: 1.0,
    fps: 50.0,
    detection: 0.95,
    precision_m: 0.1,
};

fn problem(goal: Goal) -> Problem {
    // Light of a small lens, and eyes before a point.
    let mut scene = Scene::outdoor();
    (scene.lidar.lens_diameter_mm, scene.lidar.laser_source_mm) = (4.0, 0.0);
    Problem::new(goal, Sensor::default(), &scene).unwrap()
}

fn small() -> Space {
    Space {
        bins: vec![8, 16],
        clk_hz: vec![200e6, 384e6],
        thresholds: vec![0],
        guide_sigma_m: vec![0.3, 1.0],
    }
}

#[test]
fn a_macropixel_grows_with_its_bins_and_their_bits() {
    let problem = problem(NEAR);
    let area = |bins, bin_bits| {
        problem.area(&SensorConfig {
            bins,
            bin_bits,
            ..SensorConfig::default()
        })
    };
    let sizes = [4, 8, 12, 16, 24];
    for bits in [4, 8, 14] {
        assert!(
            sizes
                .windows(2)
                .all(|pair| area(pair[0], bits) < area(pair[1], bits))
        );
    }
    for bins in sizes {
        assert!((3..16).all(|bits| area(bins, bits) < area(bins, bits + 1)));
    }
}

/// Whatever is on the front keeps what was asked for, by other ways than its own: precision by the integral of theory, energy by
/// the judgement of its scene, time by its sensor, counts by its bins; and the engine finds at least as many.
#[test]
fn the_front_keeps_its_promises() {
    let problem = problem(NEAR);
    let found = search(&problem, &small(), 3, |_| ()).unwrap();
    assert!(found.front.len() > 1);
    for ConfirmedDesign { point, check } in &found.front {
        let design = &point.design;
        let config = problem.config_of(design);
        config.check().unwrap();
        let scene = problem.scene_of(design);
        let (signal, background_hz) = problem.light(design.pulse_energy_uj);
        let cycles = f64::from(design.laser_cycles);
        let bin_ns = 1e9 / design.clk_hz;
        let (background, signal) = (cycles * background_hz / design.clk_hz, cycles * signal);
        let bound_ns = cramer_rao(bin_ns, scene.pulse_sigma().as_ns(), background, signal);
        let ratio = point.precision_m / range_m(bound_ns);
        // Windows of few bins lose a pulse's ends.
        assert!((0.98..1.06).contains(&ratio), "{ratio} {point:?}");
        assert!(point.precision_m <= NEAR.precision_m && point.detection >= NEAR.detection);

        let laser_cycle_s = f64::from(design.stop_periods) / design.clk_hz;
        let train = Train {
            rate_hz: 1.0 / laser_cycle_s,
            pulses: cycles,
            frame_s: 1.0 / NEAR.fps,
        };
        let emission = scene.emission(64, 64, train);
        let judged = emission.beside_class_1().unwrap().times_class_1;
        assert!(judged <= 1.0 && (judged / point.times_class_1 - 1.0).abs() < 1e-9);
        let frame_s = cycles * laser_cycle_s + config.readout_time().as_s();
        assert!(frame_s <= 1.0 / NEAR.fps && point.fps <= 1.0 / frame_s * (1.0 + 1e-9));
        assert!(point.fps >= NEAR.fps);
        let power_w = scene.lidar.pulse_energy_uj * 1e-6 * cycles * NEAR.fps;
        assert!((power_w / point.power_w - 1.0).abs() < 1e-9);
        assert_eq!(problem.timing(&config), Ok(()));
        assert!(
            !found
                .front
                .iter()
                .any(|other| dominates(&other.point.costs(), &point.costs()))
        );
        assert!(check.reaches(&NEAR), "{check:?} {point:?}");
        let ratio = check.precision_m.value / point.precision_m;
        assert!((0.9..1.2).contains(&ratio), "{check:?} {point:?}");
    }
    for one in [found.front[0], found.front[found.front.len() - 1]] {
        assert_eq!(gates_agree(&problem, &one.point, 3).unwrap(), (true, 50));
    }
}

#[test]
fn the_quantic4x4_needs_fewer_bits_before_a_wall_not_far_away() {
    let found = search(&problem(NEAR), &small(), 3, |_| ()).unwrap();
    let Own::Beaten(own, better) = &found.own else {
        panic!("{:?}", found.own);
    };
    assert_eq!(
        (
            own.design.bins,
            own.design.bin_bits,
            own.design.counter_bits
        ),
        (16, 14, 9)
    );
    assert!(
        better
            .iter()
            .all(|point| dominates(&point.costs(), &own.costs()))
    );
    // The same with bins of fewer bits.
    assert!(
        better
            .iter()
            .any(|point| point.design.bins == 16 && point.design.bin_bits < 14)
    );
}

/// Table 15: 8 bins of 2.6 ns, 4.5 ns FWHM, 89 z⁻² counts a pulse and 8 Mcounts/s at 100 klux, 10 cm at 75 m: Eq. 20 has 4151 laser
/// cycles (`theory::partial`), and the Cramér-Rao bound, which is followed here, 5411: an echo's own counts are noise, too.
#[test]
fn the_demonstrators_precision_is_that_of_the_thesis() {
    let goal = Goal {
        range_m: 75.0,
        reflectivity: 0.1,
        illuminance_klux: 100.0,
        fps: 3.0,
        detection: 0.997,
        precision_m: 0.1,
    };
    let mut scene = Scene::outdoor();
    scene.lidar = Lidar::demonstrator();
    let array = Sensor::from(SensorConfig {
        rows: 32,
        ..SensorConfig::default()
    });
    let problem = Problem::new(goal, array, &scene).unwrap();
    // The energy with which what its chip counts (Table 15) would be all that comes.
    let counted_uj = scene.lidar.pulse_energy_uj * 89.0 / 129.87;
    let (signal, background_hz) = problem.light(counted_uj);
    assert!((signal * 75.0 * 75.0 / 89.0 - 1.0).abs() < 0.01, "{signal}");
    assert!((background_hz / 8e6 - 1.0).abs() < 0.02, "{background_hz}");
    let bin_ns = 2.6;
    let seen = problem.echo(1e9 / bin_ns, 0, counted_uj).windowed(8);
    let cycles = seen.variance(0.1) * (bin_ns / time_ns(0.1)).powi(2);
    let sigma_ns = scene.pulse_sigma().as_ns();
    let bound = cramer_rao_laser_cycles(
        time_ns(0.1),
        bin_ns,
        sigma_ns,
        background_hz * 2.6e-9,
        signal,
    );
    assert!((cycles / bound - 1.0).abs() < 0.03, "{cycles} {bound}");
    let by_thompson = thompson(
        bin_ns,
        scene.pulse_sigma().as_ns(),
        background_hz * 2.6e-9,
        signal,
    );
    let theirs = (by_thompson / time_ns(0.1)).powi(2);
    assert!(
        (theirs - 4151.0).abs() < 100.0 && cycles > theirs,
        "{theirs} {cycles}"
    );
}

/// What stands in the way is named, with figures that hold.
#[test]
fn what_makes_a_goal_impossible_is_named() {
    let limit = |goal: Goal, space: Space| {
        let found = search(&problem(goal), &space, 3, |_| ());
        match found.unwrap_err() {
            NotFound::Limit(limit) => limit,
            other => panic!("{other}"),
        }
    };
    let far = Goal {
        range_m: 190.0,
        illuminance_klux: 100.0,
        ..NEAR
    };
    match limit(far, small()) {
        Limit::Eye {
            allowed_uj,
            needed_uj,
            times,
            ..
        } => assert!(times > 1.0 && (needed_uj / allowed_uj / times - 1.0).abs() < 1e-9),
        other => panic!("{other}"),
    }
    // 64 x 64 macropixels of 8 bins and a bit take 20.5 us through 8 pins at 200 MHz; a frame of 10 us has none of it.
    let quick = Goal { fps: 1e5, ..NEAR };
    let quick = limit(quick, small());
    assert!(matches!(quick, Limit::Time { times: 2.0.., .. }), "{quick}");
    let beyond = Goal {
        range_m: 9000.0,
        ..NEAR
    };
    match limit(beyond, small()) {
        // 2¹² periods of 200 MHz are 3070 m.
        Limit::Reach { bits: 12, short_m } => assert!(short_m > 5900.0),
        other => panic!("{other}"),
    }
    let lost = Space {
        guide_sigma_m: vec![30.0],
        ..small()
    };
    match limit(NEAR, lost) {
        Limit::Guide {
            share, window_m, ..
        } => assert!(share < 0.95 && window_m < 12.0),
        other => panic!("{other}"),
    }
    let too_fast = Space {
        clk_hz: vec![1200e6],
        ..small()
    };
    assert!(matches!(limit(NEAR, too_fast), Limit::Timing { .. }));
    let cancelling = Space {
        clk_hz: vec![100e6],
        ..small()
    };
    assert!(matches!(limit(NEAR, cancelling), Limit::Timing { .. }));
}

/// A design by itself is what the search makes of it.
#[test]
fn a_design_by_itself_is_judged_as_among_others() {
    let problem = problem(NEAR);
    let found = search(&problem, &small(), 3, |_| ()).unwrap();
    let point = found.front[0].point;
    let design = &point.design;
    let choice = Choice::from_point(&point, 1.0, false);
    let candidate = problem.evaluate(&choice).unwrap();
    assert!(candidate.limit().is_none());
    let own = candidate.point.design;
    assert_eq!(
        (own.bin_bits, own.stop_periods, own.counter_bits),
        (design.bin_bits, design.stop_periods, design.counter_bits)
    );
    let ratio = f64::from(own.laser_cycles) / f64::from(design.laser_cycles);
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    let wide = Choice {
        guide_sigma_m: 100.0,
        ..choice
    };
    assert!(matches!(problem.evaluate(&wide), Err(Limit::Guide { .. })));
    let weak = Choice {
        pulse_energy_uj: 1e-9,
        ..choice
    };
    assert!(matches!(problem.evaluate(&weak), Err(Limit::Light { .. })));
    let blinding = Choice {
        pulse_energy_uj: 100.0,
        ..choice
    };
    assert!(matches!(
        problem.evaluate(&blinding),
        Err(Limit::Blinding { .. })
    ));
    let narrow = Choice {
        bin_bits: Some(1),
        ..choice
    };
    let limit = problem.evaluate(&narrow).unwrap().limit();
    assert!(
        matches!(limit, Some(Limit::Counts { bits: 1, .. })),
        "{limit:?}"
    );
}

#[test]
fn values_are_held_to_their_ranges() {
    assert_eq!(Goal::default().fault(), None);
    assert_eq!(Choice::default().fault(), None);
    assert_eq!(Space::default().fault(), None);
    let goal = Goal {
        fps: f64::NAN,
        ..NEAR
    };
    let fault = goal.fault().unwrap();
    assert_eq!(fault, "fps = NaN is impossible; give 0.2 to 1e5 Hz");
    let space = Space {
        bins: vec![16, 65],
        ..Space::default()
    };
    assert!(space.fault().unwrap().starts_with("bins = 65 "));
}

/// Designs of the same space at random, of any energy and rate: none that its check confirms beats the front by more than its search's steps.
#[test]
fn no_random_design_beats_the_front() {
    use rand::{RngExt, SeedableRng, rngs::StdRng};
    let problem = problem(NEAR);
    let space = small();
    let found = search(&problem, &space, 3, |_| ()).unwrap();
    let mut random = StdRng::seed_from_u64(5);
    let (mut possible, most_uj) = (0, problem.most_energy_uj());
    while possible < 20 {
        let mut one = |values: &[f64]| values[random.random_range(0..values.len())];
        let choice = Choice {
            bins: one(&[8.0, 16.0]) as usize,
            clk_hz: one(&space.clk_hz),
            guide_sigma_m: one(&space.guide_sigma_m),
            pulse_energy_uj: most_uj * libm::pow(10.0, random.random_range(-2.0..0.0)),
            rate_hz: libm::pow(10.0, random.random_range(4.0..6.0)),
            ..Choice::default()
        };
        let Ok(candidate) = problem.evaluate(&choice) else {
            continue;
        };
        if candidate.limit().is_some() {
            continue;
        }
        possible += 1;
        let point = candidate.point;
        let dearer = point.costs().map(|cost| 1.01 * cost);
        let beaten = found
            .front
            .iter()
            .find(|one| dominates(&dearer, &one.point.costs()));
        if let Some(beaten) = beaten {
            let check = super::check::check(&problem, &point, 3).unwrap();
            assert!(!check.reaches(&NEAR), "{point:?} beats {:?}", beaten.point);
        }
    }
}

/// 2⁹ periods of 384 MHz end at 199.9 m, whatever the light.
#[test]
fn a_sensor_that_does_not_reach_is_told_so() {
    let goal = Goal {
        range_m: 199.0,
        illuminance_klux: 1.0,
        fps: 5.0,
        ..NEAR
    };
    let mut scene = Scene::outdoor();
    (scene.lidar.lens_diameter_mm, scene.lidar.laser_source_mm) = (25.0, 10.0);
    let problem = Problem::new(goal, Sensor::default(), &scene).unwrap();
    let found = search(&problem, &small(), 3, |_| ()).unwrap();
    let is_reach = matches!(found.own, Own::Impossible(Limit::Reach { bits: 9, .. }));
    assert!(is_reach, "{:?}", found.own);
}
