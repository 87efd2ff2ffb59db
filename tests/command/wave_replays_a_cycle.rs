//! `gdtof wave` makes of a frame.json the waveform of one laser cycle that `frame --wave-cycles all` has of it.

use std::collections::BTreeMap;
use std::path::Path;

use super::tools::gdtof_words;

fn succeeds(folder: &Path, arguments: &str) -> String {
    let run = gdtof_words(folder, arguments);
    let error = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(run.status.success(), "{arguments}: {error}");
    String::from_utf8(run.stdout).unwrap()
}

/// When every signal changes, and to what.
type Changes = BTreeMap<String, Vec<(u64, String)>>;

fn changes(path: &Path) -> Changes {
    let mut waves = wellen::simple::read(path).unwrap();
    let hierarchy = waves.hierarchy();
    let signals: Vec<_> = (hierarchy.all_vars())
        .map(|var| &hierarchy[var])
        .map(|var| (var.full_name(hierarchy), var.signal_ref()))
        .collect();
    waves.load_signals(&signals.iter().map(|(_, s)| *s).collect::<Vec<_>>());
    let times = waves.time_table();
    let signal_changes = |signal| {
        let changes = waves.get_signal(signal).unwrap().iter_changes();
        changes.map(|(time, value)| (times[time as usize], value.to_bit_string().unwrap()))
    };
    (signals.into_iter())
        .map(|(name, signal)| (name, signal_changes(signal).collect()))
        .collect()
}

/// The value at the beginning of a span, and the changes within it.
fn stretch(changes: &[(u64, String)], from: u64, to: u64) -> Vec<(u64, &str)> {
    let [first, end] = [from, to].map(|time| changes.partition_point(|&(at, _)| at <= time));
    let mut kept: Vec<(u64, &str)> = Vec::new();
    for (time, value) in &changes[first.saturating_sub(1)..end] {
        if kept.last().is_none_or(|(_, last)| last != value) {
            kept.push((from.max(*time), value));
        }
    }
    kept
}

#[test]
fn it_is_the_same_stretch_of_the_whole_waveform() {
    let folder = tempfile::tempdir().unwrap();
    let bright = "--set scene.lidar.dark_count_hz=40e6 --set sensor.afterpulse_probability=0.02";
    let (all, one): (&[u32], &[u32]) = (&[0, 3, 5], &[3]);
    for (options, file, cycles) in [
        ("", "cycle.vcd", all),
        (bright, "cycle.fst", one),
        ("--sensor hslidar --stop-periods 540", "cycle.vcd", one),
        (
            "--sensor hslidar_delay_line --stop-periods 140",
            "cycle.vcd",
            one,
        ),
        (
            "--engine gate --set sensor.dead_time_ns=8",
            "cycle.vcd",
            one,
        ),
        (
            "--set sensor.mode=conventional --stop-periods 120",
            "cycle.vcd",
            all,
        ),
    ] {
        let frame = format!(
            "frame --rows 8 --cols 8 --laser-cycles 6 --seed 3 --probe 4,3 --wave-cycles all {options}"
        );
        succeeds(folder.path(), frame.trim_end());
        let whole = changes(&folder.path().join("out/probe_r4_c3.vcd"));
        for &cycle in cycles {
            let wave = format!("wave --pixel 4,3 --cycle {cycle} --out {file} --json");
            let report = succeeds(folder.path(), &wave);
            let report: serde_json::Value = serde_json::from_str(&report).unwrap();
            let from = if cycle == 0 {
                0
            } else {
                report["from_fs"].as_u64().unwrap()
            };
            let to = if cycle == 5 {
                u64::MAX
            } else {
                report["to_fs"].as_u64().unwrap()
            };
            let part = changes(&folder.path().join(file));
            assert_eq!(whole.len(), part.len());
            let mut most = 0;
            for (name, changes) in &whole {
                let [whole, part] = [changes, &part[name]].map(|all| stretch(all, from, to));
                assert!(whole == part, "{options}, cycle {cycle}: {name}");
                most = most.max(whole.len());
            }
            assert!(most > 200);
        }
    }
}

#[test]
fn it_goes_beside_the_frame_with_its_views_and_leaves_the_frame_whole() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(
        folder.path(),
        "frame --rows 8 --cols 8 --laser-cycles 20 --probe none",
    );
    let text = succeeds(folder.path(), "wave --pixel 4,3 --cycle 7");
    assert!(text.contains("gtkwave out/wave_r4_c3_k7.gtkw"), "{text}");
    for extension in ["vcd", "gtkw", "sucl"] {
        let file = folder.path().join(format!("out/wave_r4_c3_k7.{extension}"));
        assert!(file.is_file(), "{extension}");
    }
    // Another frame keeps what it has not written.
    succeeds(
        folder.path(),
        "frame --rows 8 --cols 8 --laser-cycles 20 --probe none --seed 2",
    );
    assert!(folder.path().join("out/wave_r4_c3_k7.vcd").is_file());
}

#[test]
fn what_is_no_such_frame_or_not_in_it_is_one_sentence_and_exit_status_2() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(
        folder.path(),
        "frame --rows 8 --cols 8 --laser-cycles 20 --probe none",
    );
    let frame = std::fs::read_to_string(folder.path().join("out/frame.json")).unwrap();
    let mut changed = 0;
    let mut with = |from: &str, to: &str| {
        assert!(frame.contains(from), "{from}");
        changed += 1;
        let name = format!("changed{changed}.json");
        std::fs::write(folder.path().join(&name), frame.replacen(from, to, 1)).unwrap();
        name
    };
    let version = concat!("\"version\":\"", env!("CARGO_PKG_VERSION"), "\"");
    let cases = [
        (
            "out/frame.json".to_owned(),
            "8,0",
            "0",
            "outside the 8x8 array",
        ),
        ("out/frame.json".to_owned(), "8", "0", "is not a macropixel"),
        (
            "out/frame.json".to_owned(),
            "0,0",
            "20",
            "--cycle 20: the exposure has 20 laser cycles; give 0 to 19",
        ),
        (
            "out/nothing.json".to_owned(),
            "0,0",
            "0",
            "out/nothing.json",
        ),
        (
            "out/manifest.json".to_owned(),
            "0,0",
            "0",
            "give the frame.json of a frame",
        ),
        ("out/depth.png".to_owned(), "0,0", "0", "binary"),
        (
            with(version, "\"version\":\"0.0.9\""),
            "0,0",
            "0",
            "was written by version 0.0.9",
        ),
        (
            with("\"rows\":8", "\"rows\":16"),
            "0,0",
            "0",
            "macropixels and a sensor of 16x8",
        ),
        (
            with("\"clk_hz\":384000000.0", "\"clk_hz\":200000000.0"),
            "4,3",
            "0",
            "the start value",
        ),
        (
            with("\"clk_hz\":384000000.0", "\"clk_hz\":-1"),
            "4,3",
            "0",
            "clk_hz",
        ),
        (
            with("\"seed\":1", "\"seed\":-1"),
            "4,3",
            "0",
            "give the frame.json of a frame",
        ),
        (with("\"fov_deg\"", "\"fov\""), "4,3", "0", "fov"),
    ];
    for (file, pixel, cycle, says) in cases {
        let arguments = format!("wave --frame {file} --pixel {pixel} --cycle {cycle} --out w.vcd");
        let run = gdtof_words(folder.path(), &arguments);
        let error = String::from_utf8(run.stderr).unwrap();
        assert_eq!(run.status.code(), Some(2), "{arguments}: {error}");
        assert!(error.contains(says), "{arguments}: {error}");
        assert_eq!(error.lines().count(), 1, "{error}");
        assert!(run.stdout.is_empty() && !folder.path().join("w.vcd").exists());
    }
}
