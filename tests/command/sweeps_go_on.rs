//! `gdtof sweep`: the table is the same however often a run was killed, on however many threads, and in however many parts.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Far longer than any of this takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

fn gdtof(folder: &Path, threads: usize, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gdtof"));
    command.arg("sweep").args(arguments).current_dir(folder);
    command.env("RAYON_NUM_THREADS", threads.to_string());
    command
}

fn done(folder: &Path, threads: usize, arguments: &[&str]) -> String {
    let output = gdtof(folder, threads, arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    // Nobody looks at progress that is piped.
    let said = text(&output.stderr);
    let is_note = |line: &str| line.contains("is far from the usual");
    assert!(said.lines().all(is_note), "{said}");
    text(&output.stdout)
}

fn refused(folder: &Path, arguments: &[&str]) -> String {
    let Output { status, stderr, .. } = gdtof(folder, 1, arguments).output().unwrap();
    assert_eq!(status.code(), Some(2));
    String::from_utf8(stderr).unwrap()
}

/// The number in the last word of the line that begins so; 0 without one.
fn number(report: &str, line: &str) -> usize {
    let found = report.lines().find(|l| l.trim().starts_with(line));
    found.map_or(0, |l| l.split_whitespace().last().unwrap().parse().unwrap())
}

fn lines(path: &Path) -> usize {
    fs::read_to_string(path).unwrap_or_default().lines().count()
}

fn table(folder: &Path) -> (String, Vec<u8>) {
    let csv = fs::read_to_string(folder.join("results.csv")).unwrap();
    (csv, fs::read(folder.join("results.parquet")).unwrap())
}

/// Frames of little light, so that they are quick; among them an engine that refuses its frame, and a sensor that cannot be.
const FRAMES: &str = "\
[fixed]
sensor.cols = 3
frame.engine = \"cohort\"
scene.lidar.pulse_energy_uj = \"1 nJ\"
scene.lidar.fov_deg = 0.8
[study]
replicas = 4
[vary]
sensor.rows = [2, 3]
sensor.dead_time_ns = [8, 0.001]
sensor.spad_rows = [3, 4]
frame.laser_cycles = { from = 20, to = 200, steps = 3, scale = \"log\" }
scene.light.illuminance_klux = [0, 0.5]
";

fn killed_at(mut child: Child, journal: &Path, at_least: usize) {
    let begin = Instant::now();
    while lines(journal) < at_least {
        assert!(begin.elapsed() < PATIENCE, "the journal does not grow");
        assert!(
            child.try_wait().unwrap().is_none(),
            "it ended before it was killed"
        );
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_study_killed_three_times_is_that_of_one_run() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    fs::write(here.join("study.toml"), FRAMES).unwrap();
    let whole = done(here, 2, &["study.toml", "--out", "whole"]);
    assert_eq!(
        (number(&whole, "points  "), number(&whole, "taken")),
        (192, 192)
    );

    let journal = here.join("killed").join("journal.log");
    for at_least in [3, 8, 15] {
        let mut command = gdtof(here, 2, &["study.toml", "--out", "killed"]);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        killed_at(
            command.spawn().unwrap(),
            &journal,
            lines(&journal) + at_least,
        );
        assert!(!here.join("killed").join("results.csv").exists());
        // As if it had been killed within a write.
        let torn = fs::read_to_string(&journal).unwrap() + "0123abcd 00ff";
        fs::write(&journal, torn).unwrap();
    }
    let there = lines(&journal) - 1;
    let rest = done(here, 1, &["study.toml", "--out", "killed"]);
    assert_eq!(number(&rest, "there before"), there);
    assert_eq!(number(&rest, "taken"), 192 - there);
    assert_eq!(table(&here.join("whole")), table(&here.join("killed")));

    // What went wrong is in the table.
    let (csv, _) = table(&here.join("whole"));
    assert_eq!(csv.lines().count(), 193);
    let with = |words: &str| csv.lines().filter(|line| line.contains(words)).count();
    assert_eq!(with("spad_rows = 3 is impossible"), 96);
    assert_eq!(with("is shorter than the front end follows"), 48);
    assert_eq!(number(&whole, "without results"), 144);

    // A line that is damaged is found, and its point taken anew.
    let text = fs::read_to_string(&journal).unwrap();
    fs::write(&journal, text.replacen("null", "nul1", 1)).unwrap();
    let Output { stdout, stderr, .. } = gdtof(here, 1, &["study.toml", "--out", "killed"])
        .output()
        .unwrap();
    assert!(
        String::from_utf8(stderr)
            .unwrap()
            .contains("damaged in the journal: 1 line; ")
    );
    assert!(String::from_utf8(stdout).unwrap().contains("taken"));
    assert_eq!(table(&here.join("whole")), table(&here.join("killed")));

    fs::write(&journal, text).unwrap();

    // A study that has grown takes what is new.
    let grown = FRAMES
        .replace("[0, 0.5]", "[0, 0.25, 0.5]")
        .replace("replicas = 4", "replicas = 5");
    fs::write(here.join("study.toml"), grown).unwrap();
    let report = done(here, 2, &["study.toml", "--out", "killed"]);
    assert_eq!(number(&report, "points  "), 360);
    assert_eq!(number(&report, "there before"), 48);
    assert_eq!(lines(&here.join("killed").join("results.csv")), 361);
}

const THEORY: &str = "\
[study]
kind = \"theory\"
[vary]
theory.range_m = { from = 5, to = 150, steps = 20 }
theory.reflectivity = [0, 0.1, 0.5]
theory.model = [\"bernoulli\", \"gaussian\"]
sensor.clk_hz = [\"384 MHz\", \"192 MHz\"]
theory.goal_detection = [0.9]
";

#[test]
fn parts_make_up_the_whole() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    fs::write(here.join("study.toml"), THEORY).unwrap();
    let plot = "theory.range_m,p_detection,theory.reflectivity";
    done(here, 1, &["study.toml", "--out", "one", "--plot", plot]);
    done(here, 2, &["study.toml", "--out", "two"]);
    assert_eq!(table(&here.join("one")), table(&here.join("two")));
    let svg = fs::read_to_string(
        here.join("one")
            .join("p_detection_over_theory.range_m_by_theory.reflectivity.svg"),
    );
    let svg = svg.unwrap();
    assert!(svg.contains("reflectivity = 0.5") && !svg.contains("theory."));

    for (part, out) in [("1/3", "a"), ("2/3", "a"), ("3/3", "b")] {
        let report = done(here, 1, &["study.toml", "--shard", part, "--out", out]);
        assert_eq!(number(&report, "points  "), 80);
        assert!(!here.join(out).join("results.csv").exists());
    }
    assert!(
        refused(here, &["merge", "a"]).contains("80 of 240 points are in none of these folders")
    );
    done(here, 1, &["merge", "a", "--partial", "--out", "some"]);
    assert_eq!(lines(&here.join("some").join("results.csv")), 161);
    done(here, 1, &["merge", "a", "b", "--out", "all"]);
    assert_eq!(table(&here.join("one")), table(&here.join("all")));

    fs::write(here.join("study.toml"), THEORY.replace("150", "151")).unwrap();
    done(here, 1, &["study.toml", "--shard", "1/3", "--out", "other"]);
    assert!(refused(here, &["merge", "a", "other"]).contains("other: is of another study than a"));
    assert!(refused(here, &["merge", "nowhere"]).contains("nowhere: holds no sweep"));
}

#[test]
fn two_runs_in_one_folder_do_not_meet() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let long = FRAMES.replace("replicas = 4", "replicas = 1000");
    fs::write(here.join("study.toml"), long).unwrap();
    let mut command = gdtof(here, 1, &["study.toml", "--out", "out"]);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let child = command.spawn().unwrap();
    let journal = here.join("out").join("journal.log");
    let begin = Instant::now();
    while lines(&journal) == 0 {
        assert!(begin.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_millis(1));
    }
    let sentence = refused(here, &["study.toml", "--out", "out"]);
    killed_at(child, &journal, 1);
    assert!(
        sentence.contains("another process takes these points"),
        "{sentence}"
    );
}

#[test]
fn studies_that_cannot_be_are_refused_with_their_lines() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let many = "[vary]\nsensor.clk_hz = {from=1e8, to=2e8, steps=100000}\nsensor.dead_time_ns = {from=5, to=6, steps=100000}\n";
    for (text, says) in [
        (
            "[vary]\nsensor.colour = [1]\n",
            "study.toml:2: sensor.colour is not a key of a study; `gdtof sensor` lists",
        ),
        (
            "[vary]\nscene.lidar.pdx = [1]\n",
            "study.toml:2: scene.lidar.pdx is not a key",
        ),
        (
            "[vary]\nsensor.rows = []\n",
            "study.toml:2: sensor.rows has no values",
        ),
        (
            "[vary]\nsensor.rows = 4\n",
            "study.toml:2: sensor.rows has one value; give a list",
        ),
        (
            "[vary]\nsensor.rows = [4, 900]\n",
            "study.toml:2: rows = 900 is impossible; give 1 to 256",
        ),
        ("[vary]\nsensor.rows = [4.5]\n", "give a whole number"),
        (
            "[vary]\nsensor.clk_hz = [\"8 ns\"]\n",
            "is a time; give a frequency",
        ),
        (
            "[vary]\nsensor.tdc = [\"sundial\"]\n",
            "give clocked, counter, delay_line",
        ),
        (
            "[vary]\nscene.light.illuminance_klux = {from=0, to=100, steps=3, scale=\"log\"}\n",
            "above 0",
        ),
        (
            "[vary]\nsensor.clk_hz = {from=1e8, to=2e8}\n",
            "a grid needs steps",
        ),
        (
            "[vary]\nsensor.clk_hz = {from=1e8, to=2e8, step=3}\n",
            "unknown key `step`; did you mean `steps`?",
        ),
        (
            "[study]\ndesign=\"sobol\"\n[vary]\nsensor.rows=[1,2]\n",
            "give points",
        ),
        (
            "[study]\npoints=5\n[vary]\nsensor.rows=[1,2]\n",
            "leave it out",
        ),
        ("[study]\nkind=\"poem\"\n", "kind"),
        (
            "[study]\nkind=\"theory\"\nreplicas=3\n",
            "study.toml:3: replicas",
        ),
        (
            "[study]\nkind=\"theory\"\n[vary]\nguide=[\"radar\"]\n",
            "guide is not a key of a study",
        ),
        ("[vary]\nframe.seed=[1]\n", "seeds are those of [study]"),
        (
            "[vary]\nsensor.rows=[1]\n[fixed]\nsensor.rows=2\n",
            "is fixed and varies",
        ),
        (
            "[[vary.zip]]\nsensor.rows=[1,2]\nsensor.cols=[1]\n",
            "sensor.rows has 2 values and sensor.cols has 1 value",
        ),
        (
            "[varie]\nsensor.rows=[1]\n",
            "study.toml:1: varie: unknown section",
        ),
        ("[vary\n", "study.toml:1"),
        (many, "has more than 100000000 points"),
    ] {
        fs::write(here.join("study.toml"), text).unwrap();
        let sentence = refused(here, &["study.toml"]);
        assert!(sentence.contains(says), "{text}\n{sentence}");
    }
    assert_eq!(
        fs::read_dir(here).unwrap().count(),
        1,
        "nothing was written"
    );
    fs::write(here.join("study.toml"), THEORY).unwrap();
    assert!(
        refused(here, &["study.toml", "--plot", "colour,p_miss"])
            .contains("\"colour\" is not a column")
    );
    assert!(
        refused(here, &["study.toml", "--plot", "theory.model,p_miss"])
            .contains("holds no numbers")
    );
    assert!(
        refused(here, &["study.toml", "--plot", "p_miss"]).contains("is not a pair of columns")
    );
    assert!(refused(here, &["study.toml", "--shard", "4/3"]).contains("as 3/16"));
    assert!(refused(here, &["no.toml"]).contains("no.toml: cannot be read"));
}

/// One point of each.
#[test]
fn the_example_studies_run() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/studies");
    let mut studies = 0;
    for entry in fs::read_dir(examples).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            let dir = tempfile::tempdir().unwrap();
            let report = done(
                dir.path(),
                2,
                &[path.to_str().unwrap(), "--shard", "1/1000000"],
            );
            assert_eq!(number(&report, "without results"), 0, "{report}");
            studies += 1;
        }
    }
    assert_eq!(studies, 4);
}
