//! Files of every wrong kind for every argument that is a file: one sentence that names the file and says what to do.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::Duration;

use super::every_command::{RUNS, commands, is_text, within, workplace};
use super::every_path::{Role, role, words_with};

/// Far longer than a refusal takes.
const LIMIT: Duration = Duration::from_secs(60);

/// Words of the readers that others wrote, which say nothing to a user.
const FOREIGN: [&str; 12] = [
    "expected",
    "unexpected",
    "invalid",
    "missing field",
    "unknown variant",
    "unknown field",
    "os error",
    "as i128",
    "panicked",
    "failed to fill",
    "digit found",
    "column 1",
];

/// Files that are read for what they are by some arguments, by the arguments' names.
const RIGHT: [(&str, &[&str]); 4] = [
    ("sensor.toml", &["sensor", "chip"]),
    ("scene.toml", &["scene", "world"]),
    ("whole.png", &["left", "right", "truth"]),
    ("captures.json", &["histograms"]),
];

/// Arguments of one name that are different files in different commands.
const SEVERAL: [&str; 2] = ["calibration", "frame"];

fn npy(kind: &str, shape: &str, bytes: &[u8]) -> Vec<u8> {
    let head = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    let head = format!("{head:<117}\n");
    [b"\x93NUMPY\x01\x00\x76\x00", head.as_bytes(), bytes].concat()
}

/// Names of files in `here` and what stands in them.
fn wrong_files(here: &Path) -> Vec<(&'static str, Vec<u8>)> {
    let picture = std::fs::read(here.join("picture.png")).unwrap();
    let mut state = 1u64;
    let noise = std::iter::repeat_with(|| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 56) as u8
    });
    let text = |text: &str| text.as_bytes().to_vec();
    vec![
        ("empty", Vec::new()),
        ("noise", noise.take(1 << 16).collect()),
        ("nul.txt", text("rows = 3\0")),
        ("long.txt", vec![b'x'; 2 << 20]),
        ("latin1.txt", b"rows = 3 # caf\xe9\n".to_vec()),
        ("sensor.toml", text("rows = 2\ncols = 2\n")),
        ("scene.toml", text("[lidar]\npde = 0.2\n")),
        ("twice.toml", text("rows = 2\nrows = 3\n")),
        (
            "wave.vcd",
            text("$timescale 1 fs $end\n$enddefinitions $end\n#0\n"),
        ),
        ("whole.png", picture.clone()),
        ("cut.png", picture[..picture.len() / 2].to_vec()),
        ("strings.npy", npy("<U3", "(2, 2)", &[0; 48])),
        ("cut.npy", npy("<f8", "(32, 32)", &[0; 100])),
        ("cut_head.npy", npy("<f8", "(32, 32)", &[])[..20].to_vec()),
        (
            "schema.json",
            text("{\"colour\": \"red\", \"sizes\": [1, 2.5, null]}\n"),
        ),
        ("nested.json", vec![b'['; 100_000]),
        (
            "captures.json",
            std::fs::read(here.join("captures.json")).unwrap(),
        ),
        (
            "open.lib",
            text("library (x) {\n  cell (a) {\n    area : 1;\n"),
        ),
        ("closed.lib", text("library (x) {}}\n")),
    ]
}

fn files(folder: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries
        .map(|entry| entry.file_name().into_string().unwrap())
        .collect()
}

/// What is wrong with a refusal, if anything.
fn flaw(status: Option<i32>, error: &str, names: &[&str]) -> Option<String> {
    let lower = error.to_lowercase();
    let foreign = FOREIGN.iter().find(|word| lower.contains(*word));
    if status != Some(2) {
        Some(format!("status {status:?}"))
    } else if error.trim_end().lines().count() != 1 {
        Some("not one line".into())
    } else if let Some(word) = foreign {
        Some(format!("says {word:?}"))
    } else if !names.iter().any(|name| error.contains(name)) {
        Some("does not name the file".into())
    } else if !error.contains("; ") {
        Some("does not say what to do".into())
    } else {
        (error.len() > 500).then(|| "is too long".into())
    }
}

fn unreadable(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    std::fs::write(path, "rows = 2\n").unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o0)).unwrap();
    std::fs::File::open(path).is_err()
}

/// An argument of several commands is read by the same lines in each, so it is tried with all files in one, and with one in each other.
#[test]
fn every_file_option_names_a_file_of_another_kind() {
    let dir = workplace();
    let here = dir.path();
    let mut wrong_kinds = wrong_files(here);
    for (name, bytes) in &wrong_kinds {
        std::fs::write(here.join(name), bytes).unwrap();
    }
    // Root reads it.
    if unreadable(&here.join("locked.toml")) {
        wrong_kinds.push(("locked.toml", Vec::new()));
    }
    let (mut tried, mut faults) = (0, Vec::new());
    let mut known: BTreeMap<String, usize> = BTreeMap::new();
    for (command, arguments) in commands() {
        for argument in arguments.iter().filter(|argument| is_text(argument)) {
            let id = argument.get_id().as_str();
            let Role::Input(_) = role(&command, id) else {
                continue;
            };
            let seen = known.entry(id.to_owned()).or_default();
            // Some are read in several ways.
            let is_new = *seen == 0 || SEVERAL.contains(&id);
            let kinds = if is_new { wrong_kinds.len() } else { 1 };
            for number in 0..kinds {
                let (name, _) = &wrong_kinds[(*seen + number) % wrong_kinds.len()];
                let is_right = RIGHT
                    .iter()
                    .any(|(file, ids)| file == name && ids.contains(&id));
                let before = files(here);
                let words = words_with(&command, argument, name);
                let run = within(here, &words, LIMIT);
                let error = String::from_utf8_lossy(&run.stderr).into_owned();
                let status = run.status.code();
                tried += 1;
                if is_right && status == Some(0) {
                    continue;
                }
                let flaw = flaw(status, &error, &[name]);
                let left = files(here);
                let new: Vec<_> = left.difference(&before).collect();
                if flaw.is_some() || !new.is_empty() {
                    faults.push(format!("{words:?} {flaw:?} {new:?}: {error}"));
                }
            }
            *seen += 1;
        }
    }
    assert!(
        faults.is_empty(),
        "{} of {tried}:\n{}",
        faults.len(),
        faults.join("\n")
    );
    assert!(tried > 300, "{tried}");
    assert!(known.len() > 12 && RUNS.len() > 20, "{known:?}");
}

/// Files that are found in a folder of results.
#[test]
fn every_file_of_a_folder_of_results_is_named_if_it_is_of_another_kind() {
    let dir = workplace();
    let here = dir.path();
    let mut faults = Vec::new();
    for (name, bytes) in wrong_files(here) {
        for (file, words) in [
            ("taken/frame.json", "page taken"),
            ("taken/frame.json", "export frame taken"),
            (
                "taken/frame.json",
                "wave --frame taken/frame.json --pixel 0,0 --cycle 0",
            ),
            ("taken/histograms.npy", "page taken"),
            ("taken/histograms.npy", "export frame taken"),
            (
                "taken/histograms.npy",
                "range --format frame --histograms taken/histograms.npy",
            ),
            ("swept/study.json", "sweep merge swept"),
        ] {
            let path = here.join(file);
            let before = std::fs::read(&path).unwrap();
            std::fs::write(&path, &bytes).unwrap();
            let all: Vec<&str> = words.split(' ').collect();
            let there = files(here);
            let run = within(here, &all, LIMIT);
            let error = String::from_utf8_lossy(&run.stderr).into_owned();
            let flaw = flaw(run.status.code(), &error, &[file]);
            if flaw.is_some() || files(here) != there {
                faults.push(format!("{words} with {name} {flaw:?}: {error}"));
            }
            std::fs::write(&path, before).unwrap();
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// What frames and sweeps find where they write is no input: it is set aside or left, and they succeed.
#[test]
fn files_of_another_kind_where_results_go_stop_nothing() {
    let dir = workplace();
    let here = dir.path();
    for (name, bytes) in wrong_files(here) {
        for (file, words) in [
            (
                "taken/manifest.json",
                "frame --rows 2 --cols 2 --laser-cycles 2 --probe none --out taken",
            ),
            ("swept/journal.log", "sweep study.toml --out swept"),
            ("swept/manifest.json", "sweep study.toml --out swept"),
        ] {
            std::fs::write(here.join(file), &bytes).unwrap();
            let all: Vec<&str> = words.split(' ').collect();
            let run = within(here, &all, LIMIT);
            assert!(run.status.success(), "{words} with {name}: {run:?}");
        }
    }
}

/// Files that a scene names.
#[test]
fn every_file_of_a_scene_is_named_if_it_is_of_another_kind() {
    let dir = workplace();
    let here = dir.path();
    let map = "kind = \"map\"\nfocal_px = 100\n";
    let object = "[[object]]\nname = \"a\"\nreflectivity = 0.3\n";
    let cube = "kind = \"box\"\ncentre_m = [0, 0, 5]\nsize_m = [1, 1, 1]\ntexture = \"image\"\n";
    let depths = npy("<f4", "(2, 2)", &5f32.to_le_bytes().repeat(4));
    std::fs::write(here.join("depths.npy"), depths).unwrap();
    let mut faults = Vec::new();
    for (name, bytes) in wrong_files(here) {
        for (file, text) in [
            (
                "part",
                format!("{object}kind = \"mesh\"\ncentre_m = [0, 0, 5]\nfile = \"part\"\n"),
            ),
            ("part", format!("{object}{map}depth_file = \"part\"\n")),
            (
                "part",
                format!("{object}{map}depth_file = \"depths.npy\"\nreflectivity_file = \"part\"\n"),
            ),
            ("part", format!("{object}{cube}texture_file = \"part\"\n")),
            ("part.csv", "[lidar]\npulse = \"part.csv\"\n".to_owned()),
        ] {
            std::fs::write(here.join(file), &bytes).unwrap();
            std::fs::write(here.join("world.toml"), &text).unwrap();
            let words = "frame world.toml --rows 2 --cols 2 --laser-cycles 2 --probe none --quiet";
            let words: Vec<&str> = words.split(' ').collect();
            let run = within(here, &words, LIMIT);
            let error = String::from_utf8_lossy(&run.stderr).into_owned();
            // A picture is a texture of any size.
            if name == "whole.png" && text.contains("texture_file") {
                assert!(run.status.success(), "{error}");
            } else if let Some(flaw) = flaw(run.status.code(), &error, &[file]) {
                faults.push(format!("{name} in {text} {flaw}: {error}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
