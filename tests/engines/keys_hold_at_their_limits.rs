//! Every number of sensor and scene at the ends of its range and beyond: a frame of sound numbers or a sentence at the ends, a sentence beyond.

use std::sync::Arc;

use guided_dtof::chip::SensorConfig;
use guided_dtof::guide::BehaviouralStereo;
use guided_dtof::request::{FrameRequest, Sources, is_bad_input};
use guided_dtof::scene::Scene;
use guided_dtof::settings::{Assignment, Key, Range, Settings};
use guided_dtof::system::{EngineKind, Frame, WindowPolicy, take_frame};

/// Macropixels of the four look at a quarter of a degree each, as the street's do.
const SCENE: &str = r#"
[lidar]
fov_deg = 0.5
[[object]]
name = "road"
kind = "ground"
depth_m = 2.1
reflectivity = 0.15
[[object]]
name = "thing"
kind = "box"
centre_m = [0.0, 0.0, 40.0]
size_m = [6.0, 6.0, 2.0]
reflectivity = 0.3
[[interferer]]
name = "other"
place_m = [1.0, 0.5, 30]
"#;

const LASER_CYCLES: u32 = 10;

/// Keys, each with the beginning of its assignment; what sizes the array is left out, as its ends only take time.
fn keys() -> Vec<(String, Key)> {
    let sensor = SensorConfig::KEYS
        .iter()
        .map(|key| ("sensor".to_owned(), *key));
    let scene = Scene::SECTIONS.iter().flat_map(|section| {
        let place = match section.name {
            "object" => "scene.object.thing".to_owned(),
            "interferer" => "scene.interferer.other".to_owned(),
            name => format!("scene.{name}"),
        };
        section.keys.iter().map(move |key| (place.clone(), *key))
    });
    sensor
        .chain(scene)
        .filter(|(_, key)| !["rows", "cols"].contains(&key.name))
        .map(|(place, key)| (format!("{place}.{}", key.name), key))
        .collect()
}

/// What a key may just be, and what it may not.
fn values(range: Range) -> (Vec<f64>, Vec<f64>) {
    let beyond = |most: f64| most + 1.0 + 1e-3 * most.abs();
    match range {
        Range::Within(least, most) | Range::Limited(least, most, _) => (
            vec![least, most],
            vec![-beyond(-least), beyond(most), f64::NAN],
        ),
        Range::Above(below, most) => {
            let least = below + f64::max(1e-9, 1e-12 * below.abs());
            (vec![least, most], vec![below, beyond(most), f64::NAN])
        }
        _ => (Vec::new(), Vec::new()),
    }
}

/// As files have it: whole numbers without a point.
fn written(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e15 {
        format!("{value:.0}")
    } else {
        format!("{value:e}")
    }
}

/// A frame of four macropixels with such a key, in a list where the key is one: `Err` has what a user reads, and whether the input is at fault.
fn frame(
    scene: &std::path::Path,
    key: &str,
    value: f64,
    engine: EngineKind,
) -> Result<Frame, (String, bool)> {
    let value = written(value);
    let shapes = [1, 2, 3].map(|numbers| vec![value.clone(); numbers].join(", "));
    let [one, two, three] = &shapes;
    let mut frames = [one.clone(), format!("[{two}]"), format!("[{three}]")]
        .into_iter()
        .map(|value| frame_with(scene, &format!("{key}={value}"), engine));
    let first = frames.next().expect("three");
    match &first {
        Err((says, _)) if says.contains("give a list") => {
            frames.find(Result::is_ok).unwrap_or(first)
        }
        _ => first,
    }
}

fn frame_with(
    scene: &std::path::Path,
    set: &str,
    engine: EngineKind,
) -> Result<Frame, (String, bool)> {
    let sources = Sources {
        scene: Some(scene.into()),
        rows: Some(2),
        cols: Some(2),
        set: vec![Assignment::parse(set, set).unwrap()],
        ..Sources::default()
    };
    let (sensor, scene) = sources.read().map_err(|e| (e.to_string(), true))?;
    let mut request = FrameRequest::default();
    (request.laser_cycles, request.engine) = (LASER_CYCLES, engine);
    let guide = Arc::new(BehaviouralStereo);
    let settings = request.settings_by(sensor, scene, guide, &WindowPolicy::default());
    let settings = settings.map_err(|e| (e.to_string(), is_bad_input(&e)))?;
    take_frame(&settings, |_| Vec::new(), |_| {}).map_err(|e| (e.to_string(), is_bad_input(&e)))
}

/// Numbers that a frame may have.
fn assert_sound(frame: &Frame, set: &str) {
    let counts = frame.histograms.iter();
    assert!(
        counts.clone().all(|&n| u32::from(n) <= LASER_CYCLES),
        "{set}"
    );
    for pixel in &frame.pixels {
        assert_eq!(
            pixel.measured_m.is_some(),
            pixel.no_depth.is_none(),
            "{set}"
        );
        for metres in [pixel.measured_m, pixel.bound_m].into_iter().flatten() {
            assert!(metres.is_finite() && metres >= 0.0, "{set}: {pixel:?}");
        }
    }
}

#[test]
fn every_number_at_and_beyond_the_ends_of_its_range() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.toml");
    std::fs::write(&scene, SCENE).unwrap();
    let (mut taken, mut refused) = (0, 0);
    for (key, about) in keys() {
        let (inside, outside) = values(about.range);
        for value in inside {
            let set = format!("{key}={value}");
            for engine in [EngineKind::Window, EngineKind::Cohort] {
                match frame(&scene, &key, value, engine) {
                    Ok(frame) => {
                        assert_sound(&frame, &set);
                        taken += 1;
                    }
                    Err((says, is_bad_input)) => {
                        assert!(is_bad_input && says.len() < 500, "{set}: {says}");
                        refused += 1;
                    }
                }
            }
        }
        for value in outside
            .into_iter()
            .filter(|v| v.abs() < 1e300 || v.is_nan())
        {
            let set = format!("{key}={value}");
            let Err((says, is_bad_input)) = frame(&scene, &key, value, EngineKind::Window) else {
                panic!("{set} was taken");
            };
            assert!(is_bad_input && says.contains(about.name), "{set}: {says}");
        }
    }
    assert!(taken > 400 && refused < taken, "{taken} {refused}");
}
