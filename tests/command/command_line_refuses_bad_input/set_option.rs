//! `--set KEY=VALUE` on the commands that read settings.

use super::{folder, gdtof, refused, replay};
use guided_dtof::chip::{SensorConfig, hslidar};

#[test]
fn chips_are_known_by_name_and_files_come_first() {
    let folder = folder();
    let dir = folder.path();
    let printed = |arguments: &[&str]| {
        let output = gdtof(dir, arguments);
        assert!(output.status.success(), "{output:?}");
        let text = String::from_utf8(output.stdout).unwrap();
        SensorConfig::parse("printed", &text).unwrap()
    };
    assert_eq!(printed(&["sensor", "--sensor", "hslidar"]), *hslidar());
    let changed = [
        "sensor",
        "--sensor",
        "hslidar",
        "--set",
        "sensor.step_periods=2",
    ];
    assert_eq!(printed(&changed).step_periods, 2);
    let impossible = [
        "sensor",
        "--sensor",
        "hslidar",
        "--set",
        "sensor.step_periods=3",
    ];
    refused(
        dir,
        &impossible,
        "step_periods = 3 is impossible; give 1, 2, 4 or 8",
    );
    refused(
        dir,
        &["sensor", "--sensor", "hsl"],
        "hsl: is neither a file nor a chip; did you mean `hslidar`?",
    );
    std::fs::write(dir.join("hslidar"), "bins = 5\n").unwrap();
    assert_eq!(printed(&["sensor", "--sensor", "hslidar"]).bins, 5);
}

#[test]
fn set_changes_single_keys_and_names_itself_in_complaints() {
    let folder = folder();
    let dir = folder.path();
    let printed = |arguments: &[&str]| {
        let output = gdtof(dir, arguments);
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let has = |text: &str, line: &str| assert!(text.lines().any(|l| l == line), "{line}: {text}");
    std::fs::write(dir.join("s.toml"), "bins = 8\nclk_hz = 200e6\n").unwrap();
    let sensor = printed(&[
        "sensor",
        "--sensor",
        "s.toml",
        "--set",
        "sensor.clk_hz=300 MHz",
        "--set",
        "sensor.p_counter=comparator",
        "--set",
        "sensor.rows=3",
        "--set",
        "sensor.rows=4",
        "--cols",
        "5",
    ]);
    for line in [
        "bins = 8",
        "clk_hz = 300000000.0",
        "p_counter = \"comparator\"",
        "rows = 4",
        "cols = 5",
    ] {
        has(&sensor, line);
    }
    // What is printed is input.
    std::fs::write(dir.join("printed.toml"), &sensor).unwrap();
    assert_eq!(printed(&["sensor", "--sensor", "printed.toml"]), sensor);
    let scene = printed(&[
        "scene",
        "--set",
        "scene.lidar.pde=20 %",
        "--set",
        "scene.stereo.position_m=[0, \"20 cm\", 0]",
        "--set",
        "scene.object.car.reflectivity=0.77",
        "--set",
        "scene.object.1.depth_m=3",
    ]);
    for line in [
        "pde = 0.2",
        "position_m = [0.0, 0.2, 0.0]",
        "reflectivity = 0.77",
        "depth_m = 3.0",
    ] {
        has(&scene, line);
    }
    std::fs::write(dir.join("printed.toml"), &scene).unwrap();
    // Only what is built in has comments that say why.
    let values = |text: &str| -> Vec<String> {
        let is_value = |line: &&str| !line.is_empty() && !line.starts_with('#');
        text.lines().filter(is_value).map(str::to_owned).collect()
    };
    let again = printed(&["scene", "--scene", "printed.toml"]);
    assert_eq!(values(&again), values(&scene));

    let timing = |value| vec!["timing", "--set", value];
    for (arguments, says) in [
        (
            timing("sensor.rows=0"),
            "--set sensor.rows=0: rows = 0 is impossible; give 1 to 256",
        ),
        (
            timing("sensor.clk_hz=8 ns"),
            "--set sensor.clk_hz=8 ns: clk_hz = \"8 ns\" is a time; give a frequency",
        ),
        (
            timing("sensor.clk=8"),
            "--set sensor.clk=8: unknown key `clk`",
        ),
        (
            timing("sensor.threshold=16"),
            "--set sensor.threshold=16: threshold = 16 with event_type = \"greater\" asks for more than 16, which 16 SPADs can never be; give 0 to 15",
        ),
        (timing("sensor.clk_hz"), "has no value; give key=value"),
        (
            timing("clk_hz=3e8"),
            "give sensor.KEY=VALUE or scene.SECTION.KEY=VALUE",
        ),
        (timing("scene.lidar.pde=0.1"), "this command reads no scene"),
        (
            vec!["scene", "--set", "scene.object.bus.reflectivity=1"],
            "there is no object \"bus\"",
        ),
        (
            vec!["scene", "--set", "scene.object.reflectivity=1"],
            "object is a list",
        ),
        (
            vec!["frame", "--set", "scene.light.illuminance_klux=1e5"],
            "illuminance_klux = 100000 is impossible",
        ),
        (
            vec!["frame", "--set", "scene.light.illuminance_klux=700"],
            "the sun with bright clouds about it stays below 150 klux",
        ),
        (
            vec!["frame", "--set", "scene.lidar.solar_irradiance_w_m2=1e6"],
            "the sun has no more outside the atmosphere",
        ),
        (
            vec!["frame", "--set", "scene.lidar.dark_count_hz=1e9"],
            "16 hot SPADs have 10 MHz each",
        ),
        (
            vec!["frame", "--set", "scene.lidar.pulse_energy_uj=1e7"],
            "lasers of flash lidars stay below 1 J a pulse",
        ),
        (
            vec!["frame", "--set", "scene.lidar.temperature_c=2000"],
            "its delays are known up to 150 degC",
        ),
        (
            vec!["frame", "--set", "scene.lidar.temperature_c=300 K"],
            "give a temperature such as",
        ),
        (
            replay(&["--set", "sensor.bins=0"]),
            "bins = 0 is impossible",
        ),
        (
            vec!["pareto", "--set", "scene.lidar.pde=-1"],
            "in [lidar], pde = -1 is impossible; give 0 to 1",
        ),
    ] {
        refused(dir, &arguments, says);
    }
    let both = gdtof(
        dir,
        &[
            "frame",
            "--set",
            "scene.lidar.pde=2",
            "--set",
            "sensor.bins=0",
        ],
    );
    let error = String::from_utf8(both.stderr).unwrap();
    assert_eq!(
        (both.status.code(), error.lines().count()),
        (Some(2), 2),
        "{error}"
    );
}
