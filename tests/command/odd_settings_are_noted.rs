//! Settings that are possible and probably not meant: a note says what is odd and what to write.

use std::path::Path;

use serde_json::Value as Json;

use super::tools::gdtof;

/// What a command that succeeds says on standard output and on standard error.
fn said(here: &Path, words: &str) -> (String, String) {
    let words: Vec<&str> = words.split(' ').collect();
    let run = gdtof(here, &words);
    let [out, error] = [run.stdout, run.stderr].map(|said| String::from_utf8(said).unwrap());
    assert!(run.status.success(), "{words:?}: {error}");
    (out, error)
}

/// What a command that is refused says.
fn refused(here: &Path, words: &str) -> String {
    let words: Vec<&str> = words.split(' ').collect();
    let run = gdtof(here, &words);
    let error = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(2), "{words:?}: {error}");
    assert!(error.contains(['?', ';']), "{words:?}: {error}");
    error
}

const COUNTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/vectors/range/counts.csv");

/// The options that are right for [`COUNTS`]: echoes of 2 ns.
fn range(bin_width_ns: &str, pulse_fwhm_ns: &str) -> String {
    format!(
        "range --format counts --histograms {COUNTS} --bin-width-ns {bin_width_ns} --start-ns 10 --pulse-fwhm-ns {pulse_fwhm_ns}"
    )
}

#[test]
fn values_in_another_unit_are_told_with_that_unit() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    for (words, says) in [
        (
            "scene --set scene.lidar.pulse_fwhm_ns=5e-9",
            "in [lidar], pulse_fwhm_ns = 5e-9 ns is far from the usual 0.01 to 500 ns; if you mean 5e-9 s, give 5 ns",
        ),
        (
            "scene --set scene.object.car.centre_m=[-950,1500,7000]",
            "(car), centre_m = 7000 m is far from the usual sizes up to 1000 m; if you mean 7000 mm, give 7 m",
        ),
        (
            "scene --set scene.lidar.lens_diameter_mm=0.004",
            "if you mean 0.004 m, give 4 mm",
        ),
        (
            "scene --set scene.lidar.pulse_energy_uj=1e5",
            "if you mean 100000 nJ, give 100 uJ",
        ),
        (
            "scene --set scene.stereo.pixel_pitch_um=3450",
            "if you mean 3450 nm, give 3.45 um",
        ),
        (
            "scene --set scene.lidar.wavelength_nm=905 --set scene.lidar.filter=gaussian --set scene.lidar.filter_fwhm_nm=40",
            "passes less than half of its light; give filter_centre_nm = 905",
        ),
        (
            "scene --set scene.lidar.pulse=[[0,1],[4,1]] --set scene.lidar.pulse_fwhm_ns=0.3",
            "pulse is far from a Gaussian (skewness 0.00, excess kurtosis -1.1",
        ),
        (
            "photons --rows 1 --cols 1 --laser-cycles 2",
            "1 of 1 macropixels get more light than is modelled",
        ),
        (
            "sensor --set sensor.dead_time_ns=8000",
            "if you mean 8000 ps, give 8 ns",
        ),
    ] {
        let (_, error) = said(here, words);
        assert!(error.contains(says), "{words}: {error}");
        assert_eq!(error.lines().count(), 1, "{words}: {error}");
    }
    // What cannot be is refused with the unit in which it can.
    let error = refused(here, "sensor --set sensor.clk_hz=384");
    assert!(
        error.contains("if you mean 384 MHz, give 3.84e8 Hz"),
        "{error}"
    );
    let error = refused(here, "scene --set scene.light.illuminance_klux=50000");
    assert!(
        error.contains("if you mean 50000 lx, give 50 klux"),
        "{error}"
    );
}

/// Of a list and of a range, too.
#[test]
fn values_of_a_study_in_another_unit_are_told_with_that_unit() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let study = "[study]\nkind = \"theory\"\n[fixed]\nscene.lidar.pulse_fwhm_ns = 5e-9\n[vary]\nsensor.dead_time_ns = [8, 8000]\nscene.lidar.lens_diameter_mm = { from = 0.004, to = 4, steps = 2 }\n";
    std::fs::write(here.join("s.toml"), study).unwrap();
    let (_, error) = said(here, "sweep s.toml");
    for says in [
        "s.toml: scene.lidar.pulse_fwhm_ns = 5e-9 ns is far from the usual 0.01 to 500 ns; if you mean 5e-9 s, give 5 ns",
        "s.toml: sensor.dead_time_ns = 8000 ns",
        "s.toml: scene.lidar.lens_diameter_mm = 0.004 mm",
    ] {
        assert!(error.contains(says), "{error}");
    }
    assert_eq!(error.lines().count(), 3, "{error}");
}

#[test]
fn times_of_a_detector_in_another_unit_are_told_with_that_unit() {
    let dir = tempfile::tempdir().unwrap();
    let (_, error) = said(dir.path(), &range("1000", "2000"));
    for advice in [
        "if you mean 1000 ps, give 1 ns",
        "if you mean 2000 ps, give 2 ns",
    ] {
        assert!(error.contains(advice), "{error}");
    }
}

/// A text with its unit is the number that was meant.
#[test]
fn a_number_with_its_unit_has_no_note() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    std::fs::write(here.join("s.toml"), "[lidar]\npulse_fwhm_ns = \"5e-9 s\"\n").unwrap();
    let (out, error) = said(here, "scene s.toml");
    assert!(out.contains("\npulse_fwhm_ns = 5.0\n"), "{out}");
    assert!(!error.contains("far from"), "{error}");
}

#[test]
fn what_is_built_in_is_listed_and_has_no_note() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    for (command, wanted) in [("scene", 8), ("sensor", 4)] {
        let (list, error) = said(here, &format!("{command} --list"));
        assert_eq!(
            (list.lines().count(), error.as_str()),
            (wanted, ""),
            "{list}"
        );
        for line in list.lines() {
            let (name, what) = line.split_once(' ').unwrap();
            assert!(what.trim().len() > 8, "{line}");
            let (_, error) = said(here, &format!("{command} {name}"));
            assert_eq!(error, "", "{name}");
        }
    }
}

#[test]
fn a_pulse_unlike_the_echoes_is_noted() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    for (pulse_fwhm_ns, says) in [
        ("0.2", "times wider than pulse_fwhm_ns = 0.2"),
        ("5e-9", "far wider than pulse_fwhm_ns"),
        ("8", "times narrower than pulse_fwhm_ns = 8"),
        ("20", "times narrower than pulse_fwhm_ns = 20"),
    ] {
        let (_, error) = said(here, &range("1", pulse_fwhm_ns));
        let note = error.lines().find(|line| line.contains("echoes are about"));
        let note = note.unwrap_or_else(|| panic!("{pulse_fwhm_ns}: {error}"));
        assert!(note.contains(says), "{note}");
        let seen_ns: f64 = note.split(' ').nth(4).unwrap().parse().unwrap();
        assert!((1.4..2.6).contains(&seen_ns), "{note}");
    }
    for pulse_fwhm_ns in ["1.5", "2", "3"] {
        let (_, error) = said(here, &range("1", pulse_fwhm_ns));
        assert_eq!(error, "", "{pulse_fwhm_ns}");
    }
}

#[test]
fn a_filter_for_another_laser_is_noted() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let filter = "--set scene.lidar.filter=top_hat";
    let words = "scene --set scene.lidar.wavelength_nm=905";
    let (_, error) = said(here, words);
    assert!(error.contains("the laser has 905 nm"), "{error}");
    let advice = "filter = \"top_hat\" with filter_centre_nm = 905";
    assert!(error.contains(advice), "{error}");
    for words in [
        "scene --set scene.lidar.wavelength_nm=944".to_owned(),
        "scene --set scene.lidar.wavelength_nm=905 --set scene.lidar.solar_irradiance_w_m2=6"
            .to_owned(),
        format!(
            "scene --set scene.lidar.wavelength_nm=905 --set scene.lidar.filter_centre_nm=905 {filter}"
        ),
    ] {
        assert_eq!(said(here, &words).1, "", "{words}");
    }
}

/// A strong laser brings more light back from a retroreflector than is modelled, and a weak one does not.
#[test]
fn light_beyond_the_model_is_counted() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let scene = "[[object]]\nname = \"sign\"\nkind = \"plane\"\ncentre_m = [0, 0, 20]\nwidth_m = 100\nheight_m = 100\nreflectivity = 0.5\n";
    std::fs::write(here.join("sign.toml"), scene).unwrap();
    let frame = "frame --scene sign.toml --rows 2 --cols 2 --guide truth --laser-cycles 50 --probe none --out sign";
    let row = "macropixels with more light than is modelled";
    for (energy_uj, count) in [("100", Some(4)), ("0.001", None)] {
        let words = format!(
            "{frame} --set scene.object.sign.retro=1000 --set scene.lidar.pulse_energy_uj={energy_uj}"
        );
        let (table, _) = said(here, &words);
        let said = table.lines().find(|line| line.contains(row));
        assert_eq!(
            said.map(|line| line.contains("4 of 4")),
            count.map(|_| true),
            "{table}"
        );
        let text = std::fs::read(here.join("sign/frame.json")).unwrap();
        let frame: Json = serde_json::from_slice(&text).unwrap();
        assert_eq!(
            frame.get("light_cut").and_then(Json::as_u64),
            count,
            "{energy_uj} uJ"
        );
    }
}

/// Counted again from the depths of frame.json.
#[test]
fn depths_of_smoke_itself_are_counted() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let hall = "frame --scene warehouse --sensor vcsel_flash --rows 24 --cols 32 --laser-cycles 500 --probe none --out hall";
    let smoke = format!("{hall} --set scene.medium.extinction_1_m=0.2");
    let (table, _) = said(here, &smoke);
    let row = table
        .lines()
        .find(|line| line.contains("depths of the fog or smoke itself"));
    let row = row.unwrap_or_else(|| panic!("{table}"));
    let frame: Json =
        serde_json::from_slice(&std::fs::read(here.join("hall/frame.json")).unwrap()).unwrap();
    let count = frame["depths_of_medium"].as_u64().unwrap();
    assert!(row.contains(&format!(" {count} of ")), "{row}");
    let bin_m = frame["summary"]["bin_m"].as_f64().unwrap();
    let is_early = |pixel: &&Json| {
        let [depth_m, true_m] = ["measured_m", "true_m"].map(|key| pixel[key].as_f64());
        depth_m.is_some_and(|depth_m| true_m.is_none_or(|true_m| depth_m < true_m - bin_m))
    };
    let macropixels = frame["macropixels"].as_array().unwrap();
    let early = macropixels.iter().filter(is_early).count() as u64;
    // Some see a nearer surface beside that of most light.
    assert!(
        count <= early && count > 9 * early / 10 && count > 300,
        "{count} {early}"
    );
    let (table, _) = said(here, hall);
    assert!(!table.contains("smoke"), "{table}");
}

#[test]
fn keys_of_another_section_or_file_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    std::fs::write(
        here.join("s.toml"),
        "[lidar]\nillumnance_klux = 3\n[light]\npde = 1\n",
    )
    .unwrap();
    let study = "[vary]\nsensor.pde = [0.1]\nlidar.wavelength_nm = [905]\nscene.lidar.clk_hz = [1e8]\nframe.threshold = [1]\nscene.light.pde = [0.2]\n";
    std::fs::write(here.join("study.toml"), study).unwrap();
    for (words, says) in [
        (
            "scene s.toml",
            "s.toml:2: in [lidar], unknown key `illumnance_klux`; did you mean `illuminance_klux` of [light]?",
        ),
        (
            "scene s.toml",
            "s.toml:4: in [light], unknown key `pde`; did you mean `pde` of [lidar]?",
        ),
        (
            "scene --set scene.lidar.baseline_m=1",
            "did you mean `baseline_m` of [stereo]?",
        ),
        (
            "scene --set scene.lidar.clk_hz=1e8",
            "did you mean sensor.clk_hz?",
        ),
        (
            "sensor --set sensor.pde=0.2",
            "did you mean scene.lidar.pde?",
        ),
        (
            "sweep study.toml",
            "sensor.pde is not a key of a study; did you mean `scene.lidar.pde`?",
        ),
        (
            "sweep study.toml",
            "did you mean `scene.lidar.wavelength_nm`?",
        ),
        ("sweep study.toml", "did you mean `sensor.clk_hz`?"),
        ("sweep study.toml", "did you mean `sensor.threshold`?"),
        (
            "sweep study.toml",
            "scene.light.pde is not a key of a study; did you mean `scene.lidar.pde`?",
        ),
    ] {
        let error = refused(here, words);
        assert!(error.contains(says), "{words}: {error}");
    }
}

#[test]
fn no_guide_and_an_empty_world_name_the_way_on() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let error = refused(here, "frame --guide none");
    assert!(error.contains("mode = \"conventional\""), "{error}");
    assert!(error.contains("Take a frame without a guide"), "{error}");
    let book = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/src/recipes.md"));
    assert!(book.unwrap().contains("## Take a frame without a guide"));
    std::fs::write(here.join("s.toml"), "[lidar]\npde = 0.3\n").unwrap();
    let (_, error) = said(here, "scene s.toml");
    assert!(error.contains("s.toml lacks [[object]]"), "{error}");
    assert!(
        error.contains("gdtof scene warehouse > my_scene.toml"),
        "{error}"
    );
}

#[test]
fn the_scale_of_a_picture_can_be_set() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let frame = "frame --rows 8 --cols 8 --laser-cycles 200 --probe none";
    let picture = |folder: &str| std::fs::read(here.join(folder).join("depth.png")).unwrap();
    for (folder, scale) in [
        ("own", ""),
        ("wide", " --depth-scale-m 0-200"),
        ("again", " --depth-scale-m 0-200.0"),
    ] {
        said(here, &format!("{frame} --out {folder}{scale}"));
    }
    assert!(picture("own") != picture("wide") && picture("wide") == picture("again"));
    for wrong in ["5", "9-3", "-1-3", "a-b", "3-3", "0-inf"] {
        let error = refused(here, &format!("{frame} --depth-scale-m={wrong}"));
        assert!(error.contains("give them in metres, as in 0-50"), "{error}");
    }
}
