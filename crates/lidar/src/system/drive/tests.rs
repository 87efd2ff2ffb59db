//! Drives before a wall and a ball: what is reused, what the guide sees, what the light does within an exposure.

use std::sync::Arc;

use super::*;
use crate::chip::{Exposure, SensorConfig};
use crate::guide::NoisyTruth;
use crate::photon::PixelLight;
use crate::scene::{DVec3, Object, Scene, Shape};
use crate::system::FrameSettings;
use crate::system::light::photon_stream;
use crate::system::worlds;
use proptest::prelude::*;

/// A ball that crosses the field of view before a wall.
fn crossing(speed_m_s: f64) -> Scene {
    let mut scene = Scene::outdoor();
    let wall = Shape::Plane {
        centre_m: DVec3::new(0.0, 0.0, 60.0),
        normal: DVec3::NEG_Z,
        width_m: 1e3,
        height_m: 1e3,
    };
    let ball = Shape::Sphere {
        centre_m: DVec3::new(-3.0, 0.0, 40.0),
        radius_m: 2.0,
    };
    scene.objects = vec![
        Object::new("wall", 0.3, wall),
        Object::new("ball", 0.5, ball),
    ];
    scene.objects[1].velocity_m_s = DVec3::new(speed_m_s, 0.0, 0.0);
    scene
}

fn settings(scene: Scene, noise: Noise) -> DriveSettings {
    let sensor = SensorConfig {
        rows: 6,
        cols: 8,
        ..SensorConfig::default()
    };
    let exposure = Exposure::new(&sensor, 520, 200);
    let truth = NoisyTruth {
        sigma_m: 0.0,
        ..NoisyTruth::default()
    };
    let frame = FrameSettings {
        seed: 7,
        guide: Arc::new(truth),
        ..FrameSettings::new(sensor, scene, exposure)
    };
    DriveSettings {
        clock: FrameClock {
            guide_latency_s: 0.1,
            pipelined: false,
        },
        segments: 2,
        noise,
        ..DriveSettings::new(frame)
    }
}

fn frames(settings: &DriveSettings, number: u32) -> Vec<DriveFrame> {
    let mut drive = DriveSimulation::new(settings).unwrap();
    (0..number).map(|_| drive.frame(|_| {}).unwrap()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn pictures_are_the_same_without_reuse(
        speed_m_s in prop_oneof![Just(0.0), -8.0f64..8.0],
        is_still: bool,
        seed: u64,
    ) {
        let noise = if is_still { Noise::Still } else { Noise::Fresh };
        let mut settings = settings(crossing(speed_m_s), noise);
        settings.frame.seed = seed;
        let with = frames(&settings, 3);
        settings.reuse = false;
        let without = frames(&settings, 3);
        for (with, without) in with.iter().zip(&without) {
            prop_assert_eq!(&with.histograms, &without.histograms);
            prop_assert_eq!(&with.pixels, &without.pixels);
            prop_assert_eq!(&with.windows_m, &without.windows_m);
            prop_assert_eq!(without.reused, DriveReuse::default());
        }
    }
}

#[test]
fn only_what_changed_is_exposed_again_where_photons_are_still() {
    let moving = frames(&settings(crossing(5.0), Noise::Still), 3);
    let pixels = moving[0].pixels.len();
    assert_eq!(moving[0].reused.macropixels, 0);
    assert!((pixels / 2..pixels).contains(&moving[1].reused.macropixels));
    assert!(!moving[1].reused.world);
    let still = frames(&settings(crossing(0.0), Noise::Still), 2);
    assert_eq!(still[1].reused.macropixels, pixels);
    assert!(still[1].reused.world && still[1].reused.load);
    assert_eq!(still[0].histograms, still[1].histograms);
    let fresh = frames(&settings(crossing(0.0), Noise::Fresh), 2);
    assert_eq!(fresh[1].reused.macropixels, 0);
    assert_ne!(fresh[0].histograms, fresh[1].histograms);
}

#[test]
fn the_guide_sees_the_world_of_its_images_and_the_exposure_a_later_one() {
    let mut scene = crossing(0.0);
    scene.objects[0].velocity_m_s = DVec3::new(0.0, 0.0, 10.0);
    let drive = settings(scene, Noise::Fresh);
    for frame in frames(&drive, 2) {
        let age_s = frame.times.middle_s() - frame.times.images_s;
        assert!(age_s > 0.1);
        for (guide, truth) in frame.guide.range_m.iter().zip(&frame.truth.range_m) {
            let moved_m = truth.unwrap() - guide.unwrap();
            // Worlds of an exposure are segments: that of the second half is the nearest to its middle.
            let off_m = 10.0 * (frame.times.readout_s - frame.times.exposure_s) / 4.0;
            let is_wall = truth.unwrap() > 59.0;
            let expected_m = if is_wall { 10.0 * age_s + off_m } else { 0.0 };
            assert!((moved_m - expected_m).abs() < 0.1, "{moved_m} {expected_m}");
        }
    }
}

#[test]
fn a_pipelined_guide_makes_frames_come_as_fast_as_the_slower_part() {
    let mut settings = settings(crossing(0.0), Noise::Fresh);
    let chip_s: f64 = DriveSimulation::new(&settings)
        .unwrap()
        .chip_s()
        .iter()
        .sum();
    let period_s = |settings: &DriveSettings| DriveSimulation::new(settings).unwrap().period_s();
    assert!((period_s(&settings) - 0.1 - chip_s).abs() < 1e-12);
    settings.clock.pipelined = true;
    assert_eq!(period_s(&settings), 0.1f64.max(chip_s));
    settings.start_s = 3.0;
    let times: Vec<f64> = frames(&settings, 2)
        .iter()
        .map(|f| f.times.images_s)
        .collect();
    assert!((times[0] - 3.0).abs() < 1e-12 && (times[1] - 3.1).abs() < 1e-12);
}

#[test]
fn light_in_motion_is_a_timeline_where_something_moves_and_plain_elsewhere() {
    let settings = settings(crossing(40.0), Noise::Fresh);
    let times = FrameTimes {
        images_s: 0.0,
        load_s: 0.0,
        exposure_s: 0.0,
        readout_s: 0.1,
        end_s: 0.1,
    };
    let worlds = worlds::worlds(&settings.frame.scene, times.exposed_s(), 4);
    let (truths, kept) = worlds::truths(&worlds, (6, 8), None, true);
    assert!((1..3 * 48).contains(&kept), "{kept}");
    let FrameSettings {
        sensor,
        scene,
        exposure,
        ..
    } = &settings.frame;
    let stream = photon_stream(sensor, exposure, 7, scene);
    let seen = worlds::lights(&worlds, &truths, &stream, None, true);
    let light = worlds::light_of(&seen, exposure);
    let parts: Vec<usize> = light.iter().map(|light| light.segments().count()).collect();
    assert!(parts.contains(&1) && parts.iter().any(|&n| n > 1));
    let spads = &stream.config().spads;
    let lights: Vec<Vec<PixelLight>> = (worlds.iter().zip(&truths))
        .map(|(world, truth)| world.light_during(truth, spads, exposure.laser_cycles, 1e-6))
        .collect();
    for (pixel, &parts) in parts.iter().enumerate() {
        let changes = lights
            .windows(2)
            .filter(|two| two[0][pixel] != two[1][pixel]);
        assert_eq!(parts, 1 + changes.count(), "{pixel}");
    }
}
