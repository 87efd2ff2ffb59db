//! Scene files: what they say is read, and what is wrong with them is reported.

use std::collections::BTreeSet;

use super::*;
use crate::scene::entry::ObjectKind;
use crate::scene::shape::any_shape;
use crate::scene::{Lidar, Object, Stereo};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

const OUTDOOR: &str = include_str!("../../../../../vectors/scenes/outdoor.toml");

/// The complaint about the built-in scene after one replacement, which must apply.
fn complaint_after(old: &str, new: &str) -> (InputError, String) {
    let text = OUTDOOR.replacen(old, new, 1);
    assert_ne!(text, OUTDOOR, "{old} is not in the scene");
    (Scene::parse("s.toml", &text).unwrap_err(), text)
}

fn line_with(text: &str, what: &str) -> Option<usize> {
    text.lines().position(|l| l.contains(what)).map(|i| i + 1)
}

#[test]
fn the_built_in_scene_is_valid() {
    let scene = Scene::outdoor();
    scene.validate("outdoor.toml").unwrap();
    assert!(scene.objects.len() >= 6);
}

#[test]
fn bad_numbers_are_refused_with_their_line() {
    for (old, new) in [
        ("fov_deg = 16.0", "fov_deg = nan"),
        ("pulse_energy_uj = 100.0", "pulse_energy_uj = -100.0"),
        ("pde = 0.185", "pde = 1.5"),
        ("lens_diameter_mm = 4.0", "lens_diameter_mm = 0.0"),
        ("illuminance_klux = 50.0", "illuminance_klux = inf"),
        ("reflectivity = 0.15", "reflectivity = 1.15"),
        ("radius_m = 0.12", "radius_m = 0"),
        ("baseline_m = 1.0", "baseline_m = -1"),
        ("max_disparity_px = 232.0", "max_disparity_px = 5.0"),
    ] {
        let (error, text) = complaint_after(old, new);
        assert_eq!(error.line, line_with(&text, new), "{error}");
        assert!(error.to_string().contains("; give "), "{error}");
        assert!(error.further.is_empty(), "{error}");
    }
}

#[test]
fn a_place_of_two_numbers_is_refused() {
    let two = "position_m = [-0.1, 0.0]";
    let (error, text) = complaint_after("position_m = [-0.1, 0.0, 0.0]", two);
    assert_eq!(error.line, line_with(&text, two));
    let says = "a list of 2 is impossible; give a list of 3 numbers";
    assert!(error.to_string().contains(says), "{error}");
}

#[test]
fn optics_that_cannot_be_are_refused_with_their_line() {
    for (lines, says) in [
        (
            "filter = \"top_hat\"\nfilter_centre_nm = 905",
            "lets nothing of the laser's 940 nm through",
        ),
        (
            "filter = [[930, 0.9], [935, 0.0]]",
            "lets nothing of the laser's 940 nm through",
        ),
        (
            "filter = [[930, 0.9], [945, 1.7]]",
            "transmittance of 1.7; give 0 to 1",
        ),
        ("filter = \"brick\"", "filter: `brick` is impossible"),
        ("filter = 3", "3 is neither a word nor a list of pairs"),
        (
            "pde_curve = [[400, 0.3], [900, 0.1]]",
            "no detection efficiency at the laser's 940 nm",
        ),
        (
            "vignetting = [[1, 1.0], [9, 0.5]]",
            "angles from 1 to 9 degrees",
        ),
        ("beam = [[0, 1.0], [0, 0.5]]", "rising order"),
        ("beam = \"no/such.csv\"", "no/such.csv"),
        ("pulse = [[0, 1]]", "the number of points is 1"),
        ("pulse = [[0, 0.0], [1, 0.0]]", "all values are 0"),
        ("hot_spad_share = 1.5", "give 0 to 1"),
    ] {
        let text = format!("[light]\nilluminance_klux = 5\n[lidar]\n{lines}\n");
        let error = Scene::parse("s.toml", &text).unwrap_err();
        assert!(error.to_string().contains(says), "{lines}: {error}");
        assert!(
            error.line.is_some_and(|line| line >= 3),
            "{lines}: {error:?}"
        );
    }
}

#[test]
fn curves_are_read_from_files_beside_the_scene_and_kept_in_it() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("laser.csv"), "ns,power\n0,0\n2,1\n6,0\n").unwrap();
    let path = folder.path().join("s.toml");
    std::fs::write(&path, "[lidar]\npulse = \"laser.csv\"\n").unwrap();
    let scene = Scene::load(&path).unwrap();
    let points = [[0.0, 0.0], [2.0, 1.0], [6.0, 0.0]];
    assert_eq!(*scene.lidar.pulse.curve().unwrap().points, points);
    assert_eq!(
        Scene::parse("elsewhere", &scene.commented()).unwrap(),
        scene
    );
    std::fs::write(folder.path().join("laser.csv"), "0,0\n2,x\n").unwrap();
    let error = Scene::load(&path).unwrap_err();
    assert_eq!(error.line, Some(2));
    assert!(
        error
            .to_string()
            .contains("laser.csv:2: \"2,x\" is not a pair of numbers"),
        "{error}"
    );
}

#[test]
fn unknown_missing_and_misplaced_keys_are_named() {
    let (error, text) = complaint_after("radius_m = 0.12", "radius_mm = 120");
    assert_eq!(error.line, line_with(&text, "radius_mm"), "{error}");
    let (error, _) = complaint_after("radius_m = 0.12", "");
    assert!(error.to_string().contains("lacks `radius_m`"), "{error}");
    assert!(error.line.is_some(), "{error}");
    let (error, _) = complaint_after("radius_m = 0.12", "radius_m = 0.12\ndepth_m = 3");
    assert!(error.to_string().contains("has `depth_m`"), "{error}");
    let (error, text) = complaint_after("kind = \"sphere\"", "kind = \"prism\"");
    assert_eq!(error.line, line_with(&text, "\"prism\""), "{error}");
}

#[test]
fn what_is_left_out_takes_its_default() {
    let scene = Scene::parse("s.toml", "[light]\nilluminance_klux = 5\n").unwrap();
    let street = Scene::outdoor();
    assert_eq!(scene.light.illuminance_klux, 5.0);
    assert_eq!(scene.stereo, Stereo::default());
    assert!(scene.objects.is_empty());
    // The street's optics, but for the dark counts, which files have always left out for none.
    let dark_count_hz = 0.0;
    let lidar = Lidar {
        dark_count_hz,
        ..street.lidar
    };
    assert_eq!(scene.lidar, lidar);
    let scene = Scene::parse("s.toml", "[lidar]\npde = 0.3\n").unwrap();
    assert_eq!(scene.lidar, Lidar { pde: 0.3, ..lidar });
    assert_eq!(scene.light, street.light);
    assert!(Scene::parse("s.toml", "# nothing\n").is_err());
}

#[test]
fn all_faults_are_told_at_once_with_their_lines() {
    let text = "[lidar]\npde = 1.5\nfov_deg = \"8 ns\"\ncolour = 1\n\
        [light]\nilluminance_klux = nan\n[[object]]\nname = \"a\"\nkind = \"prism\"\n\
        reflectivity = -1\n[[object]]\nkind = \"sphere\"\n[weather]\n";
    let error = Scene::parse("s.toml", text).unwrap_err();
    let told = error.to_string();
    let lines: Vec<&str> = told.lines().collect();
    for (line, says) in [
        "s.toml:2: in [lidar], pde = 1.5 is impossible; give 0 to 1",
        "s.toml:3: in [lidar], fov_deg = \"8 ns\" is a time; give an angle",
        "s.toml:4: in [lidar], unknown key `colour`",
        "s.toml:6: in [light], illuminance_klux = NaN is impossible; give 0 to 200 klux",
        "s.toml:9: in [[object]] number 1 (a), kind: `prism` is impossible",
        "s.toml:10: in [[object]] number 1 (a), reflectivity = -1 is impossible",
        "s.toml:11: in [[object]] number 2, lacks `name`",
        "s.toml:13: weather: unknown section",
    ]
    .iter()
    .enumerate()
    {
        assert!(lines[line].starts_with(says), "{told}");
    }
    assert_eq!(lines.len(), 8, "{told}");
}

/// What has the keys that the street lacks.
const FURTHER: &str = r#"
[medium]
extinction_1_m = 0.05
backscatter_1_m_sr = 0.003

[rig]
waypoints = [[0, 0, 0, 0, 0], [1, 0, 0, 5, 3]]

[[object]]
name = "sign"
kind = "sphere"
centre_m = [0, 0, 9]
radius_m = 1
reflectivity = 0.5
grey = 0.1
retro = 500
transmittance = 0.2
mirror = 0.3
velocity_m_s = [1, 0, "-2 m/s"]

[[object]]
name = "pole"
kind = "cylinder"
centre_m = [0, 0, 9]
radius_m = 1
height_m = 2
axis = [0, 1, 1]
reflectivity = 0.5
texture = "noise"
texture_size_m = 0.1
texture_seed = 4
texture_shift_m = [0.1, 0.2]
texture_turn_deg = 3
second_reflectivity = 0.4
second_grey = 0.3

[[object]]
name = "traffic cone"
kind = "cone"
centre_m = [1, 1, 9]
radius_m = 0.2
tip_radius_m = 0.03
height_m = 0.75
reflectivity = 0.5

[[object]]
name = "child"
kind = "person"
foot_m = [0, 2, 9]
height_m = 1.2
reflectivity = 0.5
waypoints = [[0, 0, 0, 0], [2, 1, 0, 0]]

[[interferer]]
wavelength_nm = 905
name = "oncoming"
place_m = [-3, 0, 40]
phase = 0.5
"#;

#[test]
fn the_commented_scene_reads_back_and_has_every_key() {
    let street = Scene::parse(
        "further",
        &format!(
            "{}{FURTHER}",
            OUTDOOR
                .replace("[light]", "[light]\nsun_elevation_deg = 30")
                .replace("[lidar]", "[lidar]\nfilter = \"gaussian\"")
        ),
    )
    .unwrap();
    let text = street.commented();
    assert_eq!(Scene::parse("printed", &text).unwrap(), street);
    // Every key of the structs, as serde knows them, is in the tables and in the text, and the other way round.
    let table = street.table();
    let mut keys: Vec<(String, String)> = Vec::new();
    for (section, value) in &table {
        let section_keys = |table: &Table| -> Vec<(String, String)> {
            table
                .keys()
                .map(|key| (section.clone(), key.clone()))
                .collect()
        };
        match value {
            Value::Array(items) => keys.extend(
                items
                    .iter()
                    .flat_map(|i| section_keys(i.as_table().unwrap())),
            ),
            value => keys.extend(section_keys(value.as_table().unwrap())),
        }
    }
    keys.sort();
    keys.dedup();
    let mut known: Vec<(String, String)> = Scene::SECTIONS
        .iter()
        .flat_map(|s| {
            s.keys
                .iter()
                .map(|key| (s.name.to_owned(), key.name.to_owned()))
        })
        .collect();
    known.sort();
    // Files beside the scene; other tests have them.
    let of_files = [
        "scale_m",
        "depth_unit_m",
        "depth_along",
        "focal_px",
        "principal_px",
    ];
    known.retain(|(_, key)| !key.ends_with("file") && !of_files.contains(&key.as_str()));
    assert_eq!(keys, known);
    for (_, key) in keys {
        assert!(
            text.lines()
                .any(|line| line.starts_with(&format!("{key} = "))),
            "{key}"
        );
    }
}

/// A scene file in a folder of its own, with a picture beside it.
fn with_picture(picture: &[u8], object: &str) -> Result<Scene, InputError> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.toml");
    std::fs::write(dir.path().join("p.pfm"), picture).unwrap();
    std::fs::write(
        &path,
        format!("[light]\n[[object]]\nname = \"it\"\n{object}"),
    )
    .unwrap();
    Scene::load(&path)
}

const PICTURED: &str = "kind = \"ground\"\nreflectivity = 0.8\ndepth_m = 2\ntexture = \"image\"\n\
    texture_file = \"p.pfm\"\ntexture_size_m = 2\n";

#[test]
fn pictures_are_relative_to_their_scene_file() {
    let picture = [
        b"Pf\n2 1\n-1\n".to_vec(),
        [0f32, 1.0].map(f32::to_le_bytes).concat(),
    ]
    .concat();
    let scene = with_picture(&picture, PICTURED).unwrap();
    let down = |x: f64| crate::scene::Ray::new(glam::DVec3::new(x, 0.0, 0.3), glam::DVec3::Y);
    let seen = |x| scene.hit(&down(x)).unwrap().reflectivity;
    assert!(seen(0.5).abs() < 1e-9 && (seen(1.5) - 0.8).abs() < 1e-9);
    assert!((seen(1.0) - 0.4).abs() < 1e-9);
    // Printed, it names the file in a way that holds anywhere.
    let file = scene.table()["object"][0]["texture_file"]
        .as_str()
        .unwrap()
        .to_owned();
    assert!(Path::new(&file).is_absolute() && file.ends_with("p.pfm"));
}

#[test]
fn pictures_that_cannot_be_used_are_refused_with_scene_and_line() {
    let not_a_number = [b"Pf\n1 1\n-1\n".to_vec(), f32::NAN.to_le_bytes().to_vec()].concat();
    for (picture, object, says) in [
        (&b"P6"[..], PICTURED, "is not a PNG"),
        (&not_a_number, PICTURED, "no number at row 0, column 0"),
        (
            b"",
            "kind = \"ground\"\nreflectivity = 1\ndepth_m = 1\ntexture = \"image\"",
            "lacks `texture_file`",
        ),
        (
            b"",
            "kind = \"ground\"\nreflectivity = 1\ndepth_m = 1\nsecond_grey = 0.5",
            "no `texture`",
        ),
    ] {
        let error = with_picture(picture, object).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
        assert_eq!(error.line, Some(2), "{error}");
    }
}

#[test]
fn impossible_panes_and_motions_are_refused() {
    for (keys, says) in [
        (
            "transmittance = 0.9\nmirror = 0.2",
            "more light than there is",
        ),
        (
            "transmittance = 0.9\ngrey = 0.3",
            "more light than there is",
        ),
        (
            "velocity_m_s = [1, 0, 0]\nwaypoints = [[0, 0, 0, 0]]",
            "two motions",
        ),
        (
            "waypoints = [[1, 0, 0, 0], [0, 0, 0, 0]]",
            "from 1 s to 0 s; give times that rise",
        ),
        (
            "waypoints = [[1, 0, 0]]",
            "waypoints = a list of 3 is impossible; give a list of 4",
        ),
    ] {
        let text = format!(
            "[[object]]\nname = \"it\"\nkind = \"ground\"\ndepth_m = 1\nreflectivity = 0.2\n{keys}\n"
        );
        let error = Scene::parse("s.toml", &text).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
    }
    let error = Scene::parse(
        "s.toml",
        "[rig]\nyaw_rate_deg_s = 3\nwaypoints = [[0, 0, 0, 0, 0]]\n",
    );
    assert!(
        error
            .unwrap_err()
            .to_string()
            .contains("in [rig], waypoints and a velocity")
    );
}

/// Units stand in names, too; what they say must be the table's.
#[test]
fn units_are_those_of_the_names() {
    let keys = Scene::SECTIONS.iter().flat_map(|s| s.keys);
    for key in keys.filter(|key| !key.unit.is_empty() && key.unit != "px") {
        let unit = key.unit.to_lowercase();
        let is_said = |per: &str| key.name.ends_with(&format!("_{}", unit.replace('/', per)));
        assert!(is_said("_") || is_said("_per_"), "{}", key.name);
    }
}

proptest! {
    #[test]
    fn garbage_never_panics(text in "\\PC{0,200}") {
        let _ = Scene::parse("garbage", &text);
    }

    #[test]
    fn a_scene_with_a_hole_never_panics(from in 0usize..4000, length in 0usize..60, filler in "[ -~\n]{0,8}") {
        let mut text = OUTDOOR.to_owned();
        prop_assert!(text.is_ascii());
        let from = from.min(text.len());
        let to = (from + length).min(text.len());
        text.replace_range(from..to, &filler);
        if let Err(error) = Scene::parse("s.toml", &text) {
            prop_assert!(error.to_string().starts_with("s.toml"));
        }
    }
}

#[test]
fn lists_and_files_that_are_too_long_are_refused_with_their_number() {
    let many = 65_537;
    let pairs = "[0, 1],\n".repeat(many);
    for (text, says) in [
        (
            "[light]\n".to_owned() + &"[[object]]\n".repeat(many),
            "a.toml:2: object is a list of 65537, of which at most 65536 are read",
        ),
        (
            format!("[lidar]\n\npulse = [{pairs}]"),
            "a.toml:3: pulse is a list of 65537, ",
        ),
        (
            format!("[[object]]\nname = 'it'\nwaypoints = [{pairs}]"),
            "a.toml:3: waypoints is a list of 65537, ",
        ),
        (
            format!("[lidar]\nfov_deg = {}1", " ".repeat(16 << 20)),
            "a.toml: has more than 16 MiB, ",
        ),
        (
            format!("[lidar]\npulse = [{}]", "[0,1],".repeat(1_000_000)),
            "a.toml: has 2000001 lines and commas, of which at most 1048576 ",
        ),
    ] {
        let refused = Scene::parse("a.toml", &text).unwrap_err().to_string();
        assert!(refused.starts_with(says), "{refused}");
    }
}

/// A test that draws shapes draws those of all kinds.
#[test]
fn every_kind_without_files_is_drawn_and_comes_back_from_its_file() {
    let (mut drawn, mut runner) = (BTreeSet::new(), TestRunner::deterministic());
    for _ in 0..300 {
        let shape = any_shape().new_tree(&mut runner).unwrap().current();
        let mut scene = Scene::outdoor();
        scene.objects = vec![Object::new("it", 0.5, shape)];
        let text = scene.commented();
        assert_eq!(Scene::parse("printed", &text).unwrap(), scene);
        let line = text.lines().find(|line| line.starts_with("kind = "));
        drawn.insert(line.unwrap().split('"').nth(1).unwrap().to_owned());
    }
    let names = ObjectKind::NAMES.iter().map(|name| (*name).to_owned());
    let plain: BTreeSet<String> = names
        .filter(|name| !["mesh", "map"].contains(&name.as_str()))
        .collect();
    assert_eq!(drawn, plain);
}
