//! Windows from guides, and the search for targets that a guide has missed.

use std::sync::Arc;

use super::*;
use crate::chip::{SensorConfig, hslidar};
use crate::guide::{Guide, GuideInput, NoisyTruth};
use crate::photon::{RandomPurpose, normal, random_stream};
use crate::scene::{DVec3, Object, Scene, Shape};
use crate::system::{FrameSettings, PixelDepth, take_guided_frame};

const SIZE: usize = 16;

fn config() -> SensorConfig {
    SensorConfig {
        rows: SIZE,
        cols: SIZE,
        ..SensorConfig::default()
    }
}

fn sensor() -> Sensor {
    config().into()
}

fn pointing(policy: WindowPolicy, sensor: &Sensor) -> Pointing<'static> {
    Pointing::new(policy, sensor, &Exposure::new(sensor, 520, 100), None)
}

fn map(estimates: &[Option<(f64, f64)>]) -> GuideMap {
    GuideMap::new(SIZE as u32, SIZE as u32, estimates.iter().copied())
}

/// What a sensor that finds every target in its window would measure.
fn measured_depths(
    pointing: &Pointing<'_>,
    starts: &[Option<u16>],
    truth_m: &[Option<f64>],
) -> Vec<Option<f64>> {
    let pixels = starts.iter().zip(truth_m);
    pixels
        .map(|(start, truth_m)| {
            let window = pointing.windows_m[usize::from((*start)?)].clone()?;
            truth_m.filter(|m| window.contains(m))
        })
        .collect()
}

/// Runs exposures with the same guide; how many until each macropixel has found its target, `None` if it has not in `most`.
fn exposures_until_found(
    policy: WindowPolicy,
    sensor: &Sensor,
    guide: &GuideMap,
    truth_m: &[Option<f64>],
    most: usize,
) -> Vec<Option<usize>> {
    let mut pointing = pointing(policy, sensor);
    let mut found = vec![None; truth_m.len()];
    let mut last = Vec::new();
    for exposure in 0..most {
        let starts = pointing.windows(guide, &last);
        last = measured_depths(&pointing, &starts, truth_m);
        for (found, seen) in found.iter_mut().zip(&last) {
            match (*found, seen) {
                (None, Some(_)) => *found = Some(exposure + 1),
                (Some(_), None) => panic!("lost again in exposure {exposure}"),
                _ => {}
            }
        }
    }
    found
}

fn window_m(pointing: &Pointing<'_>) -> f64 {
    let windows = pointing.windows_m.iter().flatten();
    windows.map(|w| w.end - w.start).fold(0.0, f64::max)
}

#[test]
fn by_default_every_window_is_in_the_middle_of_its_estimate() {
    let sensor = sensor();
    let exposure = Exposure::new(&sensor, 520, 100);
    let mut pointing = pointing(WindowPolicy::default(), &sensor);
    let estimates: Vec<_> = (0..SIZE * SIZE)
        .map(|pixel| (pixel % 3 > 0).then_some((pixel as f64, 50.0)))
        .collect();
    let starts = pointing.windows(&map(&estimates), &[]);
    let aims = Aims::new(&sensor, &exposure, None);
    for (pixel, estimate) in estimates.iter().enumerate() {
        assert_eq!(starts[pixel], aims.start_of(pixel, estimate.map(|e| e.0)));
    }
    // It stays so, whatever was seen.
    let nothing = vec![None; SIZE * SIZE];
    assert_eq!(pointing.windows(&map(&estimates), &nothing), starts);
}

/// Six windows of uncertainty: the target is found, the sooner the likelier its place is.
#[test]
fn a_macropixel_in_doubt_steps_until_it_has_found_its_target() {
    let (sigma_m, guide_m) = (6.0, 80.0);
    let policy = WindowPolicy {
        steps_in_doubt: true,
        ..WindowPolicy::default()
    };
    let truth_m: Vec<Option<f64>> = (0..SIZE * SIZE)
        .map(|pixel| {
            let mut random = random_stream(3, RandomPurpose::Guide, pixel as u32, 0);
            Some(guide_m + sigma_m * normal(&mut random))
        })
        .collect();
    let guide = map(&vec![Some((guide_m, sigma_m)); SIZE * SIZE]);
    let found = exposures_until_found(policy, &sensor(), &guide, &truth_m, 16);
    let pointing = pointing(policy, &sensor());
    let inner_m = 0.75 * window_m(&pointing);
    for (found, truth_m) in found.iter().zip(&truth_m) {
        let off_m = (truth_m.unwrap() - guide_m).abs();
        // Steps to either side in turns, with a few for windows that are looked at again.
        let most = 2.0 * (off_m / inner_m).ceil() + 6.0;
        assert!(
            found.is_some_and(|n| n as f64 <= most),
            "{off_m} m: {found:?}"
        );
    }
    let soon = found.iter().filter(|n| n.is_some_and(|n| n == 1)).count();
    // A window of 6.2 m about the middle holds 39 % of errors of 6 m.
    assert!((70..135).contains(&soon), "{soon}");
}

#[test]
fn a_sure_guide_is_followed_and_left_only_after_patience() {
    let patient = WindowPolicy {
        patience: Some(2),
        ..WindowPolicy::default()
    };
    // Sure and wrong by four windows.
    let guide = map(&vec![Some((80.0, 0.1)); SIZE * SIZE]);
    let truth_m = vec![Some(105.0); SIZE * SIZE];
    let never = exposures_until_found(WindowPolicy::default(), &sensor(), &guide, &truth_m, 30);
    assert!(never.iter().all(Option::is_none));
    let found = exposures_until_found(patient, &sensor(), &guide, &truth_m, 80);
    assert!(
        found.iter().all(|n| n.is_some_and(|n| n > 3)),
        "{:?}",
        found[0]
    );
    let mut sure = pointing(patient, &sensor());
    let first = sure.windows(&guide, &[]);
    let nothing = vec![None; SIZE * SIZE];
    assert_eq!(sure.windows(&guide, &nothing), first);
    assert_ne!(sure.windows(&guide, &nothing), first);
    assert!(sure.why().iter().all(|why| *why == Why::Stepped));
}

#[test]
fn a_sweep_finds_everything_in_one_round_and_holds_it() {
    let policy = WindowPolicy {
        unguided: Unguided::Sweep,
        ..WindowPolicy::default()
    };
    for sensor in [
        sensor(),
        Sensor::from(SensorConfig {
            rows: SIZE,
            cols: SIZE,
            ..(*hslidar()).clone()
        }),
    ] {
        let nothing = map(&vec![None; SIZE * SIZE]);
        let sweeping = pointing(policy, &sensor);
        let ends: Vec<_> = sweeping.windows_m.iter().flatten().collect();
        let (near_m, far_m) = (ends[0].start + 2.0, ends[ends.len() - 1].end - 2.0);
        let truth_m: Vec<Option<f64>> = (0..SIZE * SIZE)
            .map(|n| Some(near_m + (far_m - near_m) * n as f64 / (SIZE * SIZE) as f64))
            .collect();
        // Windows step by what they do not share, in whole start values.
        let step_m = sweeping.cells.1;
        let each_m = ((0.75 * window_m(&sweeping) / step_m).round() * step_m).max(step_m);
        let round = ((far_m - near_m + 4.0) / each_m).ceil() as usize + 1;
        let found = exposures_until_found(policy, &sensor, &nothing, &truth_m, round + 5);
        assert!(
            found.iter().all(|n| n.is_some_and(|n| n <= round)),
            "{round}: {found:?}"
        );
    }
}

#[test]
fn macropixels_without_an_estimate_do_what_the_policy_says() {
    let mut estimates = vec![Some((60.0, 0.1)); SIZE * SIZE];
    let here = 5 * SIZE + 5;
    let starts_with = |unguided, estimates: &[Option<(f64, f64)>]| {
        let policy = WindowPolicy {
            unguided,
            ..WindowPolicy::default()
        };
        let mut pointing = pointing(policy, &sensor());
        let before = pointing.windows(&map(&vec![Some((60.0, 0.1)); SIZE * SIZE]), &[]);
        let after = pointing.windows(&map(estimates), &[]);
        (before[here], after[here], pointing.why()[here])
    };
    estimates[here] = None;
    estimates[here + 1] = Some((90.0, 0.1));
    let (before, off, why) = starts_with(Unguided::Off, &estimates);
    assert_eq!((off, why), (None, Why::Off));
    assert_eq!(
        starts_with(Unguided::Keep, &estimates),
        (before, before, Why::Kept)
    );
    let (_, taken, why) = starts_with(Unguided::Neighbour, &estimates);
    assert_eq!(why, Why::Neighbour);
    // Of the eight beside it the farthest, as an occluded background is.
    let aims = pointing(WindowPolicy::default(), &sensor()).aims;
    assert_eq!(taken, aims.start_of(here, Some(90.0)));
    let (_, swept, why) = starts_with(Unguided::Sweep, &estimates);
    assert_eq!((swept.is_some(), why), (true, Why::Swept));
    // Nobody near enough has one.
    let none = vec![None; SIZE * SIZE];
    assert_eq!(starts_with(Unguided::Neighbour, &none).1, None);
}

#[test]
fn another_target_of_the_guide_ends_a_search() {
    let policy = WindowPolicy::for_sequences();
    let mut pointing = pointing(policy, &sensor());
    let nothing = vec![None; SIZE * SIZE];
    let there = map(&vec![Some((80.0, 0.1)); SIZE * SIZE]);
    for _ in 0..6 {
        pointing.windows(&there, &nothing);
    }
    assert!(pointing.why().iter().all(|why| *why == Why::Stepped));
    let here = map(&vec![Some((40.0, 0.1)); SIZE * SIZE]);
    let starts = pointing.windows(&here, &nothing);
    assert!(pointing.why().iter().all(|why| *why == Why::Guided));
    assert_eq!(starts[0], pointing.aims.start_of(0, Some(40.0)));
}

#[test]
fn the_conventional_mode_has_one_window() {
    let sensor = Sensor::from(SensorConfig {
        mode: Mode::Conventional,
        ..config()
    });
    let mut pointing = pointing(WindowPolicy::for_sequences(), &sensor);
    let starts = pointing.windows(&map(&vec![None; SIZE * SIZE]), &[]);
    assert!(starts[0].is_some() && starts.iter().all(|start| *start == starts[0]));
}

/// The whole chain, photons and ranging included: a guide that errs by a window and says so, before a wall.
#[test]
fn stepped_windows_find_the_wall_that_one_window_misses() {
    let sensor = SensorConfig {
        rows: 8,
        cols: 8,
        ..SensorConfig::default()
    };
    // An array of 8×8 gathers on each macropixel the light of 64 of the real one; it is given as much less.
    let mut scene = Scene::outdoor();
    scene.light.illuminance_klux /= 64.0;
    scene.lidar.pulse_energy_uj /= 64.0;
    let wall = Shape::Plane {
        centre_m: DVec3::new(0.0, 0.0, 60.0),
        normal: DVec3::new(0.0, 0.0, -1.0),
        width_m: 1e3,
        height_m: 1e3,
    };
    scene.objects = vec![Object::new("wall", 0.5, wall)];
    let guide = NoisyTruth {
        sigma_m: 6.0,
        sigma_per_m: 0.0,
    };
    let exposure = Exposure::new(&sensor, 520, 2000);
    let mut settings = FrameSettings {
        guide: Arc::new(guide),
        ..FrameSettings::new(sensor, scene, exposure)
    };
    let input = GuideInput::still(&settings.scene, 8, 8, 1);
    let map = guide.estimate(&input).unwrap();
    let mut found = |policy: WindowPolicy, frames: u64| {
        let sensor = settings.sensor.clone();
        let mut pointing = Pointing::new(policy, &sensor, &settings.exposure, None);
        let mut seen_m = Vec::new();
        let mut right = 0;
        for frame in 0..frames {
            settings.seed = 1 + frame;
            let wanted = pointing.windows(&map, &seen_m);
            let taken = take_guided_frame(&settings, &map, &wanted, |_| Vec::new(), |_| {});
            let pixels = taken.unwrap().pixels;
            seen_m = pixels.iter().map(|p| p.measured_m).collect();
            let is_right = |p: &&PixelDepth| p.error_m().is_some_and(|e| e.abs() < 0.4);
            right = pixels.iter().filter(is_right).count();
        }
        right
    };
    let stepping = WindowPolicy {
        steps_in_doubt: true,
        ..WindowPolicy::default()
    };
    let (one, last) = (found(WindowPolicy::default(), 1), found(stepping, 8));
    assert!(
        3 * one < 2 * last && map.guided() * 9 <= last * 10,
        "{one} {last} of {}",
        map.guided()
    );
}
