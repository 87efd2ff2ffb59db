//! An echo keeps its counts beside a brighter one, however bright that is: a wall and a road sign before it in one macropixel.

use guided_dtof::chip::{Exposure, SensorConfig, WindowLaw};
use guided_dtof::engine::{Cohort, CohortOptions, Expose, LitPixel, Window, expose, stream_config};
use guided_dtof::photon::PhotonStream;
use guided_dtof::scene::{GroundTruth, Scene};
use guided_dtof::units::{Time, TimeOfFlight};

const LASER_CYCLES: u32 = 1000;

/// A sign of this brightness over a retroreflection of 1, 25 m ahead, that covers a part of the macropixel; beside it the wall is seen.
fn sign_before_a_wall(retro: f64, wall_m: f64) -> Scene {
    let text = format!(
        r#"
        [light]
        illuminance_klux = 0
        [[object]]
        name = "sign"
        kind = "plane"
        centre_m = [-0.745, 0, 25]
        width_m = 1.6
        height_m = 1.6
        reflectivity = 0.5
        retro = {retro}
        [[object]]
        name = "wall"
        kind = "plane"
        centre_m = [0, 0, {wall_m}]
        width_m = 200
        height_m = 200
        reflectivity = 0.1
        "#
    );
    Scene::parse("sign before a wall", &text).unwrap()
}

/// Counts of the bins from 8 ns before the wall on, of a window that begins so long before it, with `window` and `cohort`.
fn counts(retro: f64, wall_m: f64, before_ns: i64) -> [Vec<f64>; 2] {
    let scene = sign_before_a_wall(retro, wall_m);
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 520, LASER_CYCLES);
    let light = scene.pixel_light(&GroundTruth::render(&scene, 64, 64));
    let stream = PhotonStream::new(&stream_config(&config, &exposure, 1, scene.pulse_sigma()));
    let number = 32 * 64 + 32;
    let opens = Time::of_flight(wall_m) - Time::from_ns(before_ns);
    let law = WindowLaw::new(&config, &exposure);
    let start = law.start_for(opens).unwrap();
    let edges = law.edges(&law.window(start).open().unwrap(), 0);
    let from = Time::of_flight(wall_m) - Time::from_ns(8);
    let bins = (0..config.bins).filter(|&bin| edges.bin(bin).start >= from);
    let first = bins.min().unwrap();
    let pixel = LitPixel {
        number,
        start,
        light: Some(light[number as usize].clone()),
    };
    let of_engine = |engine: &dyn Expose| -> Vec<f64> {
        let exposed = expose(engine, &stream, std::slice::from_ref(&pixel), |_| ()).unwrap();
        exposed.histograms[0][first..]
            .iter()
            .map(|&n| f64::from(n))
            .collect()
    };
    [
        of_engine(&Window::new(&config, &exposure)),
        of_engine(&Cohort::new(&config, &exposure, CohortOptions::default())),
    ]
}

/// Whether two counts of [`LASER_CYCLES`] laser cycles are of one probability, by five standard deviations of their difference.
fn are_alike(a: f64, b: f64) -> bool {
    let all = f64::from(LASER_CYCLES);
    let mean = (0.5 * (a + b) / all).clamp(1.0 / all, 1.0 - 1.0 / all);
    (a - b).abs() < 5.0 * (2.0 * all * mean * (1.0 - mean)).sqrt()
}

#[test]
fn beside_a_retroreflector() {
    // At 28 m SPADs are ready again since the sign; 40 m are a window of its own.
    for (wall_m, before_ns) in [(28.0, 6), (40.0, 15)] {
        let faint = counts(100.0, wall_m, before_ns);
        for counts in &faint {
            assert!(counts.iter().sum::<f64>() > 300.0, "{counts:?}");
        }
        for retro in [300.0, 600.0, 1000.0] {
            let bright = counts(retro, wall_m, before_ns);
            for (engine, (faint, bright)) in faint.iter().zip(&bright).enumerate() {
                println!("{wall_m} m, retro {retro}, {engine}: {faint:?} {bright:?}");
                for (a, b) in faint.iter().zip(bright) {
                    assert!(
                        are_alike(*a, *b),
                        "{wall_m} m, retro {retro}: {faint:?} {bright:?}"
                    );
                }
            }
        }
    }
}
