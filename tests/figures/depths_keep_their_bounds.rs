//! Depths lie within five bounds of a surface that is really there, in five scenes, three lights of the sun and three of the laser, and of a
//! slanting wall in pulses shorter than a bin.
//!
//! The truth is the light that the macropixel gets: its echoes, those closer together than a pulse being one surface, with their mean by
//! light. A fifth of the 45 frames is taken, and half of the lights of each wall; `GDTOF_CASES=45 cargo test --release --test figures
//! depths_keep` takes all of them, and prints every case.

use std::sync::Arc;

use guided_dtof::chip::{Exposure, Sensor, SensorConfig};
use guided_dtof::guide::NoisyTruth;
use guided_dtof::photon::{Echo, PixelLight};
use guided_dtof::scene::{GroundTruth, Scene};
use guided_dtof::system::{EngineKind, Frame, FrameSettings, take_frame};
use guided_dtof::units::TimeOfFlight;

const SCENES: [&str; 5] = ["street", "van", "fog", "glass", "night"];

const SIZE: usize = 64;

/// Whether all cases are taken.
fn takes_all() -> bool {
    std::env::var_os("GDTOF_CASES").is_some()
}

/// A frame of `size` by `size` macropixels and 1000 laser cycles.
fn on_cohort(scene: Scene, size: usize) -> FrameSettings {
    let sensor = Sensor::from(SensorConfig {
        rows: size,
        cols: size,
        ..SensorConfig::default()
    });
    let exposure = Exposure::new(&sensor, 520, 1000);
    FrameSettings {
        engine: EngineKind::Cohort,
        ..FrameSettings::new(sensor, scene, exposure)
    }
}

/// A frame, and the light that made it.
fn frame(scene: &str, klux: f64, energy_uj: f64) -> (Frame, GroundTruth, Vec<PixelLight>, f64) {
    let mut scene = Scene::named(scene).unwrap();
    scene.light.illuminance_klux = klux;
    scene.lidar.pulse_energy_uj = energy_uj;
    let truth = GroundTruth::render(&scene, SIZE as u32, SIZE as u32);
    let light = scene.pixel_light(&truth);
    let apart_m = scene.pulse_resolution().as_range_m() * 2.355;
    let frame = take_frame(&on_cohort(scene, SIZE), |_| Vec::new(), |_| ()).unwrap();
    (frame, truth, light, apart_m)
}

/// How far a depth is from what the macropixel gets light from: surfaces, and fog, whose echoes are wider than pulses.
fn off_m(depth_m: f64, light: &PixelLight, apart_m: f64) -> f64 {
    let echoes = || light.segments().flat_map(|segment| segment.echoes());
    let in_fog = echoes().filter_map(|echo| {
        let half_m = echo.sigma?.as_range_m();
        let off_m = (echo.arrival.as_range_m() - depth_m).abs() - half_m;
        (half_m > apart_m).then_some(off_m.max(0.0))
    });
    let offs = surfaces_m(echoes(), apart_m).into_iter();
    let offs = offs
        .map(|surface_m| (depth_m - surface_m).abs())
        .chain(in_fog);
    offs.fold(f64::INFINITY, f64::min)
}

/// Mean distances of the surfaces that echoes come from.
fn surfaces_m<'a>(echoes: impl Iterator<Item = &'a Echo>, apart_m: f64) -> Vec<f64> {
    let mut echoes: Vec<(f64, f64)> = echoes
        .map(|echo| (echo.arrival.as_range_m(), echo.photons))
        .collect();
    echoes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let groups = echoes.chunk_by(|a, b| b.0 - a.0 < apart_m);
    let mean = |group: &[(f64, f64)]| {
        let photons: f64 = group.iter().map(|echo| echo.1).sum();
        group.iter().map(|echo| echo.0 * echo.1).sum::<f64>() / photons
    };
    groups.map(mean).collect()
}

#[test]
fn of_surfaces_that_are_there() {
    let takes_all = takes_all();
    let (mut bounded, mut beyond, mut all) = (0, 0, 0);
    let mut worst: Vec<String> = Vec::new();
    for (n, scene) in SCENES.into_iter().enumerate() {
        for (sun, klux) in [0.0, 50.0, 100.0].into_iter().enumerate() {
            for (laser, energy_uj) in [2.0, 20.0, 200.0].into_iter().enumerate() {
                // Each sun with each laser in one scene.
                if !takes_all && (3 * sun + laser) % SCENES.len() != n {
                    continue;
                }
                let (frame, truth, light, apart_m) = frame(scene, klux, energy_uj);
                let (mut here, mut wrong) = (0, 0);
                for (number, (pixel, light)) in frame.pixels.iter().zip(&light).enumerate() {
                    all += usize::from(pixel.measured_m.is_some());
                    let Some((depth_m, bound_m)) = pixel.measured_m.zip(pixel.bound_m) else {
                        continue;
                    };
                    here += 1;
                    let own = truth.surfaces[number]
                        .iter()
                        .map(|surface| (surface.range_m - depth_m).abs());
                    let off_m = own.fold(off_m(depth_m, light, apart_m), f64::min);
                    if off_m > 5.0 * bound_m {
                        wrong += 1;
                        let bins = &frame.histograms[number * frame.bins..][..frame.bins];
                        worst.push(format!(
                            "{scene} {klux} klux {energy_uj} uJ: {number} {depth_m:.3} m is {off_m:.3} m off, bound {bound_m:.4} m, spread {:?}, {bins:?}",
                            pixel.spread_m
                        ));
                    }
                }
                if takes_all {
                    println!("{scene} {klux} klux {energy_uj} uJ: {wrong} of {here}");
                }
                (bounded, beyond) = (bounded + here, beyond + wrong);
            }
        }
    }
    println!("{beyond} of {bounded} depths with a bound, of {all}, are beyond five bounds");
    // One in a thousand of all frames; a part of them may have a quarter more.
    let most = if takes_all { bounded } else { bounded * 5 / 4 };
    assert!(
        1000 * beyond <= most && 10 * bounded > 8 * all,
        "{beyond} of {bounded} of {all}: {worst:#?}"
    );
}

/// Errors and bounds of what has both, m.
fn errors(frame: &Frame) -> Vec<(f64, f64)> {
    let errors = frame.pixels.iter().filter_map(|pixel| {
        let off_m = pixel.measured_m? - pixel.true_m?;
        Some((off_m, pixel.bound_m?))
    });
    errors.collect()
}

/// A slanting wall, in bins of 2.6 ns.
#[test]
fn of_pulses_shorter_than_a_bin() {
    let text = r#"
        [[object]]
        name = "wall"
        kind = "plane"
        centre_m = [0, 0, 30]
        normal = [0.4, 0, -1]
        width_m = 400
        height_m = 400
        reflectivity = 0.3
        "#;
    let (mut bounded, mut beyond, mut all) = (0, 0, 0);
    for (pulse, fwhm_ns) in [0.0, 0.2, 0.5, 1.0, 2.0].into_iter().enumerate() {
        for (sun, klux) in [0.0, 50.0].into_iter().enumerate() {
            for (laser, energy_uj) in [1.0, 10.0, 100.0].into_iter().enumerate() {
                // Each sun with each laser, and each of both with each pulse.
                if !takes_all() && !(pulse + sun + laser).is_multiple_of(2) {
                    continue;
                }
                let mut scene = Scene::parse("wall", text).unwrap();
                scene.light.illuminance_klux = klux;
                scene.lidar.pulse_energy_uj = energy_uj;
                scene.lidar.pulse_fwhm_ns = fwhm_ns;
                let settings = FrameSettings {
                    guide: Arc::new(NoisyTruth::default()),
                    ..on_cohort(scene, 24)
                };
                let frame = take_frame(&settings, |_| Vec::new(), |_| ()).unwrap();
                let errors = errors(&frame);
                let is_beyond = |(off_m, bound_m): &&(f64, f64)| off_m.abs() > 5.0 * bound_m;
                all += frame.summary().depths;
                bounded += errors.len();
                beyond += errors.iter().filter(is_beyond).count();
            }
        }
    }
    println!("{beyond} of {bounded} depths with a bound, of {all}, are beyond five bounds");
    assert!(
        1000 * beyond <= bounded && 100 * bounded > 95 * all,
        "{beyond} of {bounded} of {all}"
    );
}

/// A wall 30 m ahead, from a third of a photon to 4000 in a laser cycle.
#[test]
fn of_a_wall_in_any_light() {
    let text = r#"
        [[object]]
        name = "wall"
        kind = "plane"
        centre_m = [0, 0, 30]
        width_m = 200
        height_m = 200
        reflectivity = 0.5
        "#;
    for (sun, klux) in [0.0, 50.0, 100.0].into_iter().enumerate() {
        let energies_uj = [0.5, 2.0, 20.0, 50.0, 500.0, 2000.0].into_iter();
        for (laser, energy_uj) in energies_uj.enumerate() {
            // Each laser with one or two suns.
            if !takes_all() && !(sun + laser).is_multiple_of(2) {
                continue;
            }
            let mut scene = Scene::parse("wall", text).unwrap();
            scene.light.illuminance_klux = klux;
            scene.lidar.pulse_energy_uj = energy_uj;
            let frame = take_frame(&on_cohort(scene, 32), |_| Vec::new(), |_| ()).unwrap();
            // A bound of a bin says so, and is none of the counts.
            let errors = errors(&frame).into_iter();
            let of_counts = errors.filter(|(_, bound_m)| *bound_m < frame.bin_m);
            let all: Vec<(f64, f64)> = of_counts.collect();
            let mean = |term: &dyn Fn(&(f64, f64)) -> f64| {
                all.iter().map(term).sum::<f64>() / all.len() as f64
            };
            let bias_m = mean(&|(off_m, _)| *off_m);
            let rms_m = mean(&|(off_m, _)| off_m * off_m).sqrt();
            let bound_m = mean(&|(_, bound_m)| bound_m * bound_m).sqrt();
            let beyond = all
                .iter()
                .filter(|(off_m, bound_m)| off_m.abs() > 5.0 * bound_m);
            let beyond = beyond.count();
            let what = format!(
                "{klux} klux {energy_uj} uJ: {} depths, bias {bias_m:.4} m, RMS {rms_m:.4} m, bound {bound_m:.4} m, {beyond} beyond five",
                all.len()
            );
            println!("{what}");
            let error_m = rms_m / (all.len() as f64).sqrt();
            assert!(all.len() > 800, "{what}");
            assert!(bias_m.abs() < 0.005 + 2.0 * error_m, "{what}");
            assert!(rms_m < 1.35 * bound_m && beyond <= 5, "{what}");
        }
    }
}
