//! The temperature of a scene's lidar acts on its light and on the chip's delays; it need not be said twice.

use std::path::Path;

use serde_json::Value as Json;

use super::tools::gdtof_words;

fn said(folder: &Path, words: &str) -> String {
    let output = gdtof_words(folder, words);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{words}: {error}");
    String::from_utf8(output.stdout).unwrap()
}

fn frame(folder: &Path, more: &str) -> Json {
    // With a probe, whose gates must agree with the engine.
    let words = format!(
        "frame --rows 4 --cols 4 --laser-cycles 60 --probe 1,2 --set scene.lidar.fov_deg=2 --json {more}"
    );
    serde_json::from_str(&said(folder, words.trim_end())).unwrap()
}

#[test]
fn the_chip_is_as_warm_as_its_lidar() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let slack = |frame: &Json| frame["timing"]["slack_ps"].as_f64().unwrap();
    let usual = frame(folder, "");
    assert!(usual["sensor"].get("temperature_c").is_none());
    let hot = frame(folder, "--set scene.lidar.temperature_c=105");
    assert_eq!(hot["sensor"]["temperature_c"], 130.0);
    let own = frame(folder, "--set sensor.temperature_c=130");
    assert_eq!(hot["timing"], own["timing"]);
    assert_ne!(slack(&hot), slack(&usual));
    // The more special one wins: a chip that is cooled, in hot light.
    let cooled = "--set scene.lidar.temperature_c=105 --set sensor.temperature_c=50";
    let cooled = frame(folder, cooled);
    assert_eq!(slack(&cooled), slack(&usual));
    assert!(cooled["photons_expected"].as_f64() != usual["photons_expected"].as_f64());
    // A frame that was taken in heat is the same later.
    said(
        folder,
        "frame --rows 4 --cols 4 --laser-cycles 60 --probe none --set scene.lidar.temperature_c=105 --out hot",
    );
    said(folder, "wave --frame hot/frame.json --pixel 1,2 --cycle 40");
}

#[test]
fn timing_takes_the_temperature_of_the_sensor_or_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let timing = |more: &str| -> Json {
        serde_json::from_str(&said(
            folder.path(),
            &format!("timing --rows 2 --cols 2 --json {more}"),
        ))
        .unwrap()
    };
    let of_sensor = timing("--set sensor.temperature_c=130");
    let of_option = timing("--temperature 130");
    let both = timing("--set sensor.temperature_c=-20 --temperature 130");
    for section in ["conditions", "ripples", "periods"] {
        assert_eq!(of_sensor[section], of_option[section], "{section}");
        assert_eq!(both[section], of_option[section], "{section}");
    }
    // Windows are loaded for the sensor's temperature, not for that of the option.
    assert_eq!(of_sensor["timing"]["met"], true);
    assert_eq!(of_option["timing"]["met"], false);
}
