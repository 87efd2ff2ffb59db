//! What people get wrong, and what they are told: one sentence with the name or the number that they meant.

use std::path::Path;

use super::every_command::workplace;
use super::tools::gdtof;

const STUDY: &str = "[fixed]\nsensor = \"x.toml\"\nsensor.rows = 2\nsensor.cols = 3\nframe.laser_cycles = 2\n[vary]\nscene.lidar.pde = [0.1, 0.2]\n";

fn folder() -> tempfile::TempDir {
    let dir = workplace();
    for (name, text) in [
        ("x.toml", "rows = 16\ncols = 16\n"),
        ("scene.toml", "[lidar]\npde = 0.2\n"),
        ("misspelt.toml", "clkhz = 3e8\n"),
        ("big.toml", "clk_hz = 1e308\n"),
        ("beside.toml", STUDY),
        (
            "misspelt_study.toml",
            "[fixed]\nsensor.rws = 2\n[vary]\nframe.laser_cycle = [1]\n",
        ),
    ] {
        std::fs::write(dir.path().join(name), text).unwrap();
    }
    dir
}

/// What is said on standard error, in a line or, of files with several faults, a line each.
fn said(here: &Path, words: &[&str]) -> (Option<i32>, String) {
    let run = gdtof(here, words);
    (run.status.code(), String::from_utf8(run.stderr).unwrap())
}

#[test]
fn what_was_meant_is_named() {
    let dir = folder();
    let here = dir.path();
    for (words, says) in [
        // Keys.
        (
            "sensor --set sensor.clkhz=3e8",
            "unknown key `clkhz`; did you mean `clk_hz`?",
        ),
        (
            "sensor --sensor misspelt.toml",
            "misspelt.toml:1: unknown key `clkhz`; did you mean `clk_hz`?",
        ),
        (
            "sensor --set sensor.colour=3",
            "unknown key `colour`; give one of the",
        ),
        (
            "scene --set scene.lidar.pd=0.2",
            "in [lidar], unknown key `pd`; did you mean `pde`?",
        ),
        (
            "scene --set scene.lidr.pde=0.2",
            "--set scene.lidr.pde=0.2: lidr: unknown section; did you mean [lidar]?",
        ),
        ("scene --set scene.pde=0.2", "did you mean scene.lidar.pde?"),
        (
            "scene --set scene.object.cars.reflectivity=1",
            "there is no object \"cars\"; did you mean `car`?",
        ),
        (
            "sensor --set sensor.p_counter=riple",
            "p_counter: `riple` is impossible; did you mean `ripple`?",
        ),
        ("sweep misspelt_study.toml", "did you mean `sensor.rows`?"),
        (
            "sweep misspelt_study.toml",
            "did you mean `frame.laser_cycles`?",
        ),
        // Guides and windows.
        (
            "frame --guide radr",
            "\"radr\" is not a guide; did you mean `radar`?",
        ),
        (
            "frame --guide stereo,radar",
            "give each by itself: --guide stereo --guide radar",
        ),
        (
            "frame --guide radar:range_sigma=0.2",
            "did you mean `range_sigma_m`?",
        ),
        (
            "frame --guide matched:paths=6",
            "paths = 6 is impossible; give 3, 4, 5 or 8",
        ),
        (
            "frame --windows neighbour",
            "did you mean unguided=neighbour?",
        ),
        (
            "frame --windows unguided=neighbor",
            "did you mean `neighbour`?",
        ),
        // Scenes and sensors.
        ("frame --scene strete", "did you mean `street`?"),
        ("frame --sensor quantic", "did you mean `quantic4x4`?"),
        (
            "frame --sensor street",
            "street: is a scene; give it as --scene",
        ),
        (
            "frame --sensor scene.toml",
            "scene.toml: is a scene; give it as --scene",
        ),
        (
            "frame --scene x.toml",
            "x.toml: is a sensor; give it as --sensor",
        ),
        (
            "frame --scene hslidar",
            "hslidar: is a sensor; give it as --sensor",
        ),
        (
            "frame study.toml",
            "study.toml: is a study; `gdtof sweep` runs it",
        ),
        (
            "frame --sensor study.toml",
            "study.toml: is a study; `gdtof sweep` runs it",
        ),
        ("frame drive.toml", "drive.toml: cannot be read"),
        (
            "frame strete",
            "strete: is neither a file nor a built-in scene; did you mean `street`?",
        ),
        ("frame street --scene van", "cannot be used with"),
        // Cells, blocks, testbenches.
        (
            "timing --liberty example.lib --cell DFR=x",
            "did you mean `DFFR`?",
        ),
        (
            "timing --liberty example.lib --cell DFFR=DFR",
            "has no cell DFR that does what DFFR does; did you mean",
        ),
        ("sensor --block p_count=x", "did you mean `p_counter`?"),
        ("tb tb_macropixl", "did you mean `tb_macropixel`?"),
        // What a command needs first.
        ("wave --pixel 0,0 --cycle 0", "run `gdtof frame` first"),
        // Numbers.
        (
            "frame --laser-cycles 1e4",
            "--laser-cycles 1e4: is not written as a whole number; give 10000",
        ),
        (
            "frame --laser-cycles -5",
            "--laser-cycles -5: is impossible; give 0 to 4294967295",
        ),
        (
            "frame --laser-cycles many",
            "--laser-cycles many: is not a whole number",
        ),
        ("frame --laser-cycles 99999999999999999999", "is too large"),
        (
            "frame --false-alarm-rate few",
            "--false-alarm-rate few: is not a number",
        ),
        ("frame --tolerance -1", "--tolerance"),
        (
            "sensor --sensor big.toml",
            "big.toml:1: clk_hz = 1e308 is impossible; give 1e6 to 2e9 Hz",
        ),
        (
            "sensor --set sensor.rows=99999999999999999999",
            "rows = 1e20 is impossible; give a whole number, 1 to 256",
        ),
    ] {
        let words: Vec<&str> = words.split(' ').collect();
        let (status, error) = said(here, &words);
        assert_eq!(status, Some(2), "{words:?}: {error}");
        assert!(
            error.contains(says),
            "{words:?}: {error} does not say {says}"
        );
        for foreign in [
            "unknown field",
            "unknown variant",
            "missing field",
            "os error",
            "i128",
            "digit found",
        ] {
            assert!(!error.contains(foreign), "{words:?}: {error}");
        }
        assert!(error.len() < 600, "{words:?}: {error}");
    }
    let (status, error) = said(here, &["frame", "--set", "sensor.clk_hz=300 Mhz"]);
    assert_eq!(status, Some(2));
    assert!(
        error.contains("has an unknown unit; did you mean MHz?"),
        "{error}"
    );
}

#[test]
fn a_scene_goes_by_its_place_and_one_without_objects_is_noted() {
    let dir = folder();
    let here = dir.path();
    let small = "--rows 2 --cols 2 --laser-cycles 2 --probe none --out";
    let run = |more: &str, out: &str| {
        let words = format!("frame {more} {small} {out}");
        let (status, error) = said(here, &words.split_whitespace().collect::<Vec<_>>());
        assert_eq!(status, Some(0), "{error}");
        error
    };
    run("van", "a");
    run("--scene van", "b");
    let counts = |out: &str| std::fs::read(here.join(out).join("histograms.npy")).unwrap();
    assert_eq!(counts("a"), counts("b"));
    let noted = run("scene.toml", "c");
    assert!(noted.contains("scene.toml lacks [[object]]"), "{noted}");
    assert_eq!(run("empty", "d"), "");
}

#[test]
fn a_study_names_a_sensor_and_changes_its_keys() {
    let dir = folder();
    let here = dir.path();
    let (status, error) = said(here, &["sweep", "beside.toml", "--out", "beside"]);
    assert_eq!(status, Some(0), "{error}");
    let table = std::fs::read_to_string(here.join("beside/results.csv")).unwrap();
    assert_eq!(table.lines().count(), 3, "{table}");
}

#[test]
fn paths_stay_in_one_short_line() {
    let dir = folder();
    let here = dir.path();
    for path in [
        "a\nb\u{1b}[2J.toml".to_owned(),
        "d/".repeat(1000) + "end.toml",
    ] {
        let (status, error) = said(here, &["sensor", "--sensor", &path]);
        assert_eq!(status, Some(2), "{error}");
        assert_eq!(error.trim_end().lines().count(), 1, "{error}");
        assert!(error.len() < 400 && !error.contains('\u{1b}'), "{error}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_is_named() {
    let full = std::fs::File::options()
        .write(true)
        .open("/dev/full")
        .unwrap();
    let run = std::process::Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .arg("sensor")
        .stdout(full)
        .output()
        .unwrap();
    let error = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(1), "{error}");
    assert!(
        error.starts_with("gdtof: standard output cannot be written ("),
        "{error}"
    );
    assert!(!error.contains("os error"), "{error}");
}

#[test]
fn help_texts_are_whole() {
    let dir = tempfile::tempdir().unwrap();
    let help = gdtof(dir.path(), &["frame", "-h"]);
    let help = String::from_utf8(help.stdout).unwrap();
    assert!(!help.contains("none for the camera pair"), "{help}");
}

/// What was meant as something else, tried by hand.
#[test]
fn a_file_in_the_place_of_a_folder_and_the_like_are_named() {
    let dir = folder();
    let here = dir.path();
    for (words, says) in [
        (
            "frame --out picture.png",
            "gdtof: picture.png: is not a folder; give the name of one",
        ),
        (
            "man --out picture.png",
            "gdtof: picture.png: is not a folder; give the name of one",
        ),
        (
            "sweep study.toml --out picture.png",
            "gdtof: picture.png: is not a folder; give the name of one",
        ),
        (
            "page taken/frame.json",
            "gdtof: taken/frame.json: is a file; give a folder that",
        ),
        (
            "export frame swept",
            "gdtof: swept: has no frame.json; give a folder that",
        ),
        (
            "frame --guide file:path=",
            "\"\": is no name of a file; give one",
        ),
        (
            "timing --liberty example.lib,example.lib",
            "example.lib:31: the cell INV_1 is in example.lib as well; leave one of both files out",
        ),
        (
            "timing --liberty picture.png",
            "picture.png: is not text; give a Liberty file",
        ),
        (
            "frame --set scene.lidar.pulse=picture.png",
            "pulse: `picture.png` is impossible; give gaussian, pairs of time in ns and power, or a .csv file",
        ),
        (
            "frame --set scene.lidar.pulse=gausian",
            "did you mean `gaussian`?",
        ),
        (
            "propose --range 0 --reflectivity 0.5 --klux 1 --fps 10",
            "gdtof: --range: range_m = 0 is impossible; give 0.5 to 10000 m",
        ),
        (
            "timing --rows 1 --cols 1 --mismatch 0.05 --plot p.png",
            "gdtof: --plot p.png: is written as SVG; give a name that ends in .svg",
        ),
        (
            "power --supply-v 10000",
            "gdtof: --supply-v 10000: is impossible; give a number from 0 to 10",
        ),
        (
            "sweep scene.toml",
            "gdtof: scene.toml: is a scene; name it in a study, as scene = \"FILE\" below [fixed]",
        ),
        (
            "sweep x.toml",
            "gdtof: x.toml: is a sensor; name it in a study, as sensor = \"FILE\" below [fixed]",
        ),
        (
            "pareto --sensor x.toml --macropixels 1 --repeats 1 --laser-cycles 2 --no-gate --reflectivity 1 --klux 100 --set scene.lidar.lens_diameter_mm=40",
            "gdtof pareto: ",
        ),
    ] {
        let words: Vec<&str> = words.split(' ').collect();
        let (status, error) = said(here, &words);
        assert_eq!(status, Some(2), "{words:?}: {error}");
        assert!(error.contains(says), "{words:?}: {error}");
        assert_eq!(error.trim_end().lines().count(), 1, "{error}");
    }
    std::fs::write(here.join("nothing.toml"), "# nothing yet\n").unwrap();
    for words in ["sensor --sensor", "frame --scene", "sweep"] {
        let words: Vec<&str> = words.split(' ').chain(["nothing.toml"]).collect();
        let (status, error) = said(here, &words);
        assert_eq!(status, Some(2), "{words:?}: {error}");
        let says = "gdtof: nothing.toml: has no settings; give ";
        assert!(error.starts_with(says), "{words:?}: {error}");
    }
}

/// A table of nothing but refusals is a fault of the study.
#[test]
fn a_study_without_any_result_fails_and_says_why() {
    let dir = folder();
    let here = dir.path();
    let study = |fixed: &str| {
        let text =
            format!("[fixed]\n{fixed}\nsensor.cols = 2\n[vary]\nframe.laser_cycles = [1, 2]\n");
        std::fs::write(here.join("refused.toml"), text).unwrap();
    };
    for (fixed, says) in [
        (
            "guide = \"radr\"",
            "gdtof: refused: no point has a result: guide: \"radr\" is not a guide; did you mean `radar`?",
        ),
        (
            "sensor = \"gone.toml\"",
            "gdtof: refused: no point has a result: gone.toml: cannot be read",
        ),
    ] {
        study(fixed);
        // Again, with what is in the journal.
        for _ in 0..2 {
            let (status, error) = said(here, &["sweep", "refused.toml", "--out", fixed]);
            assert_eq!(status, Some(2), "{error}");
            assert!(error.starts_with(says), "{error}");
            let (status, error) = said(here, &["sweep", "merge", fixed]);
            assert_eq!(status, Some(2), "{error}");
        }
    }
    study("sensor.rows = 2");
    let (status, error) = said(here, &["sweep", "refused.toml", "--out", "whole"]);
    assert_eq!(status, Some(0), "{error}");
}

/// As of `gdtof … 2>&1 | head -1`.
#[cfg(unix)]
#[test]
fn a_reader_of_messages_that_has_gone_stops_nothing() {
    use std::process::{Command, Stdio};
    let dir = folder();
    for (words, status) in [
        ("sensor --set sensor.clkhz=3e8", 2),
        ("sensor --liberty example.lib", 0),
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let run = Command::new(env!("CARGO_BIN_EXE_gdtof"))
            .args(words.split(' '))
            .current_dir(dir.path())
            .stdout(Stdio::null())
            .stderr(writer)
            .status()
            .unwrap();
        assert_eq!(run.code(), Some(status), "{words}");
    }
}
