//! What was there before a command: results of other commands and inputs are refused as outputs and stay as they are, and files
//! of others get another name.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::tools::{gdtof, gdtof_words};

/// A frame of few macropixels in little light.
const FRAME: &str = "frame --rows 2 --cols 2 --laser-cycles 3 --probe none --set scene.light.illuminance_klux=0 --set scene.lidar.pulse_energy_uj=0.001";
const PROPOSE: &str = "propose --range 20 --reflectivity 0.1 --klux 1 --fps 50 --detection 0.95 --bins 16 --clk 384 --thresholds 0 --guide-sigma 0.3";
const PARETO: &str =
    "pareto --macropixels 2 --repeats 1 --no-gate --ranges 20 --klux 0 --laser-cycles 20";
const THEORY: &str = "[study]\nkind = \"theory\"\n[vary]\ntheory.range_m = [5, 20, 80]\n";

fn done(here: &Path, words: &str) -> String {
    let output = gdtof_words(here, words);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{words}: {said}");
    said
}

/// Every file below `folder`, with its contents; links by where they lead.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let (path, name) = (entry.path(), entry.file_name().into_string().unwrap());
        let kind = entry.file_type().unwrap();
        if kind.is_dir() {
            for (inner, bytes) in contents(&path) {
                found.insert(format!("{name}/{inner}"), bytes);
            }
        } else if kind.is_symlink() {
            let target = fs::read_link(&path).unwrap();
            found.insert(name, format!("-> {}", target.display()).into_bytes());
        } else {
            found.insert(name, fs::read(path).unwrap());
        }
    }
    found
}

/// Refused with one sentence that says `says`, status 2 and nothing touched.
fn refused(here: &Path, words: &str, says: &str) {
    let before = contents(here);
    let output = gdtof_words(here, words);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{words}: {said}");
    assert!(said.contains(says), "{words}: {said}");
    assert_eq!(said.lines().count(), 1, "{words}: {said}");
    assert!(contents(here) == before, "{words} touched something");
}

fn text(path: impl AsRef<Path>) -> String {
    fs::read_to_string(path).unwrap()
}

#[test]
fn each_command_has_a_folder_of_its_own_and_leaves_that_of_others() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    done(here, FRAME);
    let frame = contents(&here.join("out"));
    let output = gdtof_words(here, PROPOSE);
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{said}");
    done(here, PARETO);
    done(here, "man");
    assert_eq!(contents(&here.join("out")), frame);
    fs::write(here.join("study.toml"), THEORY).unwrap();

    for words in [
        PROPOSE,
        PARETO,
        "drive --rows 2 --cols 2 --frames 1 --laser-cycles 3",
        "demo glass",
        "photons --rows 1 --cols 1 --laser-cycles 2",
        "photons --frame out/frame.json",
        "sweep study.toml",
        "sweep study.toml --shard 1/2",
        "man",
        "export verilog --rows 1 --cols 1",
        "export frame out",
        "reproduce --claim 1",
    ] {
        refused(
            here,
            &format!("{words} --out out"),
            "out: holds the results of `gdtof frame`",
        );
    }
    refused(
        here,
        &format!("{FRAME} --out propose"),
        "propose: holds the results of `gdtof propose`",
    );
    // Nor do single files take the place of a set's.
    refused(
        here,
        "page out -o out/depth.png",
        "out/depth.png: is one of the results of `gdtof frame`",
    );
    refused(
        here,
        "wave --pixel 0,0 --cycle 0 --out propose/scene.toml",
        "one of the results",
    );

    // The command that `propose` prints reads files of its folder, and they stay, however often it is run.
    let printed = said
        .lines()
        .find_map(|line| line.trim().strip_prefix("gdtof frame "));
    let printed = format!(
        "frame {} --laser-cycles 3 --rows 2 --cols 2 --probe none",
        printed.unwrap().replace("--laser-cycles", "--seed")
    );
    let proposed = contents(&here.join("propose"));
    for _ in 0..2 {
        done(here, &printed);
        assert_eq!(contents(&here.join("propose")), proposed);
    }
    // Into a set of the same kind too, if it reads from it.
    refused(
        here,
        &format!("{PROPOSE} --sensor propose/sensor.toml"),
        "propose/sensor.toml: is read by this run",
    );
    done(
        here,
        &format!("{PROPOSE} --sensor propose/sensor.toml --out second"),
    );
}

#[test]
fn no_input_is_replaced_whatever_its_name() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let write = |name: &str, text: &str| fs::write(here.join(name), text).unwrap();
    write("i.csv", "row,col,init\n0,0,20\n");
    write("e.csv", "time_fs,row,col,spad\n0,0,0,3\n");
    done(here, FRAME);
    let chip = String::from_utf8(gdtof(here, &["sensor", "--sensor", "hslidar_delay_line"]).stdout);
    let chip = chip.unwrap();
    write("chip.toml", &chip);
    fs::hard_link(here.join("e.csv"), here.join("hard.csv")).unwrap();
    // Files that no manifest lists.
    fs::create_dir(here.join("fr")).unwrap();
    for name in ["frame.json", "histograms.npy"] {
        fs::copy(here.join("out").join(name), here.join("fr").join(name)).unwrap();
    }
    let replay = "replay --rows 1 --cols 1 --inits i.csv --events e.csv --stop-periods 100 --laser-cycles 10 --engine gate";
    let ranged = "range --format frame --histograms fr/histograms.npy";
    let mut cases = vec![
        (
            format!("{replay} --out e.csv"),
            "e.csv: is read by this run",
        ),
        (
            format!("{replay} --out ./i.csv"),
            "is the same file as i.csv",
        ),
        (
            format!("{replay} --out hard.csv"),
            "is the same file as e.csv",
        ),
        (
            format!("{replay} --vcd e.csv"),
            "e.csv: is read by this run",
        ),
        (
            format!("{replay} --saif e.csv"),
            "e.csv: is read by this run",
        ),
        (
            format!("{replay} --checks report --checks-json e.csv"),
            "e.csv: is read by this run",
        ),
        (
            format!("{ranged} --out fr/histograms.npy"),
            "fr/histograms.npy: is read by this run",
        ),
        (
            format!("{ranged} --out fr/frame.json"),
            "fr/frame.json: is read by this run",
        ),
        (
            "page fr -o fr/frame.json".into(),
            "fr/frame.json: is read by this run",
        ),
        (
            "page fr -o fr/histograms.npy".into(),
            "fr/histograms.npy: is read by this run",
        ),
        (
            "wave --frame fr/frame.json --pixel 0,0 --cycle 0 --out fr/frame.json".into(),
            "fr/frame.json: is read by this run",
        ),
        (
            "calibrate --sensor chip.toml --rows 1 --cols 1 --out chip.toml".into(),
            "chip.toml: is read by this run",
        ),
        (
            "export sdf --sensor chip.toml --rows 1 --cols 1 --out chip.toml".into(),
            "chip.toml: is read by this run",
        ),
    ];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("e.csv", here.join("link.csv")).unwrap();
        cases.push((
            format!("{replay} --out link.csv"),
            "link.csv: is the same file as e.csv",
        ));
    }
    for (words, says) in cases {
        refused(here, &words, says);
    }
    // A set that a run reads from is not replaced by another of its command.
    done(here, "photons --frame fr/frame.json --out p");
    refused(
        here,
        "photons --sensor p/sensor.toml --laser-cycles 3 --out p",
        "p/sensor.toml: is read by this run",
    );
    // Other names are as good as ever, and what an earlier run wrote is replaced.
    for _ in 0..2 {
        done(here, &format!("{replay} --out counts.csv"));
        done(here, &format!("{ranged} --out depths.csv"));
    }
}

#[test]
fn a_sweep_keeps_journals_and_studies_that_are_not_its_own() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    fs::write(here.join("study.toml"), THEORY).unwrap();
    let out = here.join("out");
    fs::create_dir(&out).unwrap();
    fs::write(out.join("journal.log"), "my diary\nwithout an end").unwrap();
    fs::write(out.join("study.json"), "{\"mine\": 1}").unwrap();
    let said = done(here, "sweep study.toml --out out");
    assert!(
        said.contains("out/journal.kept.log") && said.contains("out/study.kept.json"),
        "{said}"
    );
    assert_eq!(
        text(out.join("journal.kept.log")),
        "my diary\nwithout an end"
    );
    assert_eq!(text(out.join("study.kept.json")), "{\"mine\": 1}");
    // Its own are no longer in the way.
    let journal = text(out.join("journal.log"));
    assert_eq!(done(here, "sweep study.toml --out out"), "");
    assert_eq!(text(out.join("journal.log")), journal);
    assert_eq!(text(out.join("results.csv")).lines().count(), 4);
    // A study of that name is an input.
    fs::create_dir(here.join("in")).unwrap();
    fs::write(here.join("in/study.json"), THEORY).unwrap();
    refused(
        here,
        "sweep in/study.json --out in",
        "in/study.json: is read by this run",
    );
}

#[cfg(unix)]
#[test]
fn a_sweep_follows_no_links_in_its_folder() {
    use std::os::unix::fs::symlink;
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    fs::write(here.join("study.toml"), THEORY).unwrap();
    let out = here.join("out");
    fs::create_dir(&out).unwrap();
    for (link, target) in [
        ("journal.log", "diary"),
        ("study.json", "letter"),
        ("results.csv", "list"),
    ] {
        fs::write(here.join(target), "mine, without an end").unwrap();
        symlink(here.join(target), out.join(link)).unwrap();
    }
    symlink("/dev/zero", out.join("journal-9-of-9.log")).unwrap();
    done(here, "sweep study.toml --out out");
    for target in ["diary", "letter", "list"] {
        assert_eq!(text(here.join(target)), "mine, without an end");
    }
    for kept in ["journal.kept.log", "study.kept.json", "results.kept.csv"] {
        assert!(out.join(kept).is_symlink(), "{kept}");
    }
    assert!(!out.join("journal.log").is_symlink());
}

#[cfg(unix)]
#[test]
fn a_journal_that_is_removed_meanwhile_fails_the_sweep_and_unusable_rows_are_taken_anew() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let frames = "[fixed]\nsensor.rows = 2\nsensor.cols = 3\nscene.lidar.pulse_energy_uj = \"1 nJ\"\nscene.lidar.fov_deg = 0.8\nscene.light.illuminance_klux = 0\n[vary]\nframe.laser_cycles = { from = 20, to = 400, steps = 200 }\n";
    fs::write(here.join("study.toml"), frames).unwrap();
    let out = here.join("out");
    let mut child = Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args(["sweep", "study.toml", "--out", "out", "--threads", "1"])
        .current_dir(here)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while fs::metadata(out.join("journal.log")).map_or(0, |m| m.len()) == 0 {
        assert!(begun.elapsed() < Duration::from_secs(120));
        assert!(child.try_wait().unwrap().is_none(), "it has ended already");
    }
    fs::remove_file(out.join("journal.log")).unwrap();
    let ended = child.wait_with_output().unwrap();
    let said = String::from_utf8(ended.stderr).unwrap();
    assert!(!ended.status.success(), "{said}");
    assert!(said.contains("journal.log: was removed"), "{said}");
    assert!(!out.join("results.csv").exists());
    done(here, "sweep study.toml --out out");
    let table = text(out.join("results.csv"));
    assert_eq!(table.lines().count(), 201);

    // Lines with a good checksum whose text is no row.
    use sha2::{Digest, Sha256};
    let journal = text(out.join("journal.log"));
    let spoilt: String = journal
        .lines()
        .enumerate()
        .map(|(at, line)| {
            let row = line.split_once(' ').unwrap().1;
            let row = if at % 50 == 7 {
                format!("{} [1.0,null,true]", &row[..32])
            } else {
                row.to_owned()
            };
            let hash = Sha256::digest(&row);
            let check: String = hash[..4].iter().map(|byte| format!("{byte:02x}")).collect();
            format!("{check} {row}\n")
        })
        .collect();
    fs::write(out.join("journal.log"), spoilt).unwrap();
    let output = gdtof_words(here, "sweep study.toml --out out");
    let report = String::from_utf8(output.stdout).unwrap();
    let taken = report
        .lines()
        .find(|line| line.trim().starts_with("taken"))
        .unwrap();
    assert_eq!(taken.split_whitespace().last(), Some("4"), "{report}");
    assert_eq!(text(out.join("results.csv")), table);
}

#[test]
fn names_of_studies_stay_in_their_folder() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    for name in ["../../esc", "a/b", "a\\u0000b", "a\\\\b"] {
        let text = format!(
            "[study]\nname = \"{name}\"\nkind = \"theory\"\n[vary]\ntheory.range_m = [5, 20]\n"
        );
        fs::write(here.join("study.toml"), text).unwrap();
        refused(here, "sweep study.toml", "study.toml:2: name = ");
    }
}

#[test]
fn views_and_numbers_that_the_user_saved_are_kept() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    done(here, FRAME);
    let wave = "wave --pixel 0,0 --cycle 1 --out x.vcd";
    done(here, wave);
    let ours = contents(here);
    assert_eq!(done(here, wave), "");
    assert!(contents(here) == ours);
    let gtkwave = "[*]\n[*] GTKWave Analyzer v3.3.116 (w)1999-2023 BSI\n";
    fs::write(here.join("x.gtkw"), gtkwave).unwrap();
    fs::write(here.join("x.sucl"), "my commands\n").unwrap();
    let said = done(here, wave);
    assert!(
        said.contains("x.kept.gtkw") && said.contains("x.kept.sucl"),
        "{said}"
    );
    assert_eq!(text(here.join("x.kept.gtkw")), gtkwave);
    assert_eq!(text(here.join("x.kept.sucl")), "my commands\n");

    let plot = "timing --rows 2 --cols 2 --mismatch 0.2 --plot rip.svg";
    fs::write(here.join("rip.csv"), "my,numbers\n1,2\n").unwrap();
    let said = done(here, plot);
    assert!(said.contains("rip.kept.csv"), "{said}");
    assert_eq!(text(here.join("rip.kept.csv")), "my,numbers\n1,2\n");
    assert_eq!(done(here, plot), "");

    fs::write(here.join("page.html"), "<!DOCTYPE html>\nmy page\n").unwrap();
    let said = done(here, "page out");
    assert!(said.contains("page.kept.html"), "{said}");
    assert_eq!(
        text(here.join("page.kept.html")),
        "<!DOCTYPE html>\nmy page\n"
    );
    assert_eq!(done(here, "page out"), "");
}

/// What cannot be written whole is not written at all.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_all_files_of_an_export_or_none() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    for words in ["export verilog --rows 2 --cols 2", "man"] {
        done(here, &format!("{words} --out whole"));
        let whole = contents(&here.join("whole"));
        let sizes: Vec<usize> = whole.values().map(Vec::len).collect();
        // Enough for the smallest file, and not for the largest; blocks of 512 bytes.
        let blocks =
            (sizes.iter().min().unwrap() / 512 + 1).max(sizes.iter().max().unwrap() / 1024);
        let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" {words} --out half");
        let output = std::process::Command::new("sh")
            .args(["-c", &script, env!("CARGO_BIN_EXE_gdtof")])
            .current_dir(here)
            .output()
            .unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{words}: {said}");
        assert!(said.contains("free some space"), "{words}: {said}");
        assert!(!here.join("half").exists(), "{words}");
        fs::remove_dir_all(here.join("whole")).unwrap();
    }
}
