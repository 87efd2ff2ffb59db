//! `gdtof photons`: pulses of a frame give its histograms again, every format has the same pulses, and what is impossible is refused.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::tools::{gdtof, gdtof_words};

/// Time in fs, row, column, SPAD.
type Pulse = (i64, usize, usize, u8);

fn done(here: &Path, words: &str) -> String {
    let output = gdtof_words(here, words);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{words}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

fn csv(path: &Path) -> Vec<Pulse> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("time_fs,row,col,spad"));
    lines
        .map(|line| {
            let fields: Vec<i64> = line
                .split(',')
                .map(|field| field.parse().unwrap())
                .collect();
            let [time, row, col, spad] = fields[..] else {
                panic!("{line}");
            };
            (time, row as usize, col as usize, spad as u8)
        })
        .collect()
}

/// Files of macropixels in a folder, with their rows and columns.
fn files(folder: &Path, ending: &str) -> Vec<(usize, usize, PathBuf)> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let mut found: Vec<_> = entries
        .filter_map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            let place = name.strip_prefix("photons_r")?.strip_suffix(ending)?;
            let (row, col) = place.split_once("_c")?;
            Some((row.parse().unwrap(), col.parse().unwrap(), entry.path()))
        })
        .collect();
    found.sort();
    found
}

fn txt(folder: &Path) -> Vec<Pulse> {
    let mut pulses = Vec::new();
    for (row, col, path) in files(folder, ".txt") {
        for line in fs::read_to_string(path).unwrap().lines() {
            let (time, spad) = line.split_once(' ').unwrap();
            pulses.push((time.parse().unwrap(), row, col, spad.parse().unwrap()));
        }
    }
    pulses
}

fn npy(path: &Path) -> Vec<Pulse> {
    let bytes = fs::read(path).unwrap();
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let begin = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let records = bytes[begin..].chunks(13).map(|record| {
        let short = |at: usize| usize::from(u16::from_le_bytes([record[at], record[at + 1]]));
        let time = i64::from_le_bytes(record[..8].try_into().unwrap());
        (time, short(8), short(10), record[12])
    });
    let pulses: Vec<Pulse> = records.collect();
    let head = String::from_utf8_lossy(&bytes[10..begin]).into_owned();
    assert!(
        head.contains(&format!("'shape': ({},)", pulses.len())),
        "{head}"
    );
    pulses
}

/// Rising edges of the SPADs of a waveform, and how long each is high; how often STOP and CLK rise.
fn vcd(path: &Path, (row, col): (usize, usize)) -> (Vec<Pulse>, BTreeSet<i64>, [usize; 2]) {
    let mut waves = wellen::simple::read(path).unwrap();
    let (names, signals): (Vec<String>, Vec<_>) = {
        let hierarchy = waves.hierarchy();
        let vars = hierarchy.all_vars().map(|var| &hierarchy[var]);
        vars.map(|var| (var.name(hierarchy).to_owned(), var.signal_ref()))
            .unzip()
    };
    waves.load_signals(&signals);
    let times = waves.time_table();
    let (mut pulses, mut widths, mut rises) = (Vec::new(), BTreeSet::new(), [0; 2]);
    for (name, signal) in names.iter().zip(signals) {
        let mut risen = None;
        let mut edges = Vec::new();
        let signal = waves.get_signal(signal).unwrap();
        for (index, value) in signal.iter_changes() {
            let time = times[index as usize] as i64;
            if value.to_bit_string().unwrap() == "1" {
                risen = Some(time);
                edges.push(time);
            } else if let Some(risen) = risen.take() {
                widths.extend(name.starts_with("SPAD").then_some(time - risen));
            }
        }
        match name.strip_prefix("SPAD_RAW_") {
            Some(spad) => {
                let spad: u8 = spad.parse().unwrap();
                pulses.extend(edges.into_iter().map(|time| (time, row, col, spad)));
            }
            None => rises[usize::from(name == "CLK")] = edges.len(),
        }
    }
    pulses.sort_unstable();
    (pulses, widths, rises)
}

#[test]
fn replay_of_a_frame_s_photons_gives_its_histograms() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    for (name, more) in [
        ("street", ""),
        (
            "restless",
            "--set sensor.afterpulse_probability=0.02 --set sensor.crosstalk_probability=0.03 --set sensor.dead_time_spread=0.1 --seed 7",
        ),
        ("bins", "--bins-from-guide --windows within=0.8"),
        ("lines", "--set sensor.tdc=delay_line"),
        (
            "unlike",
            "--scene fog --set scene.lidar.pde_spread=0.2 --windows unguided=neighbour",
        ),
    ] {
        let size =
            "--rows 4 --cols 5 --laser-cycles 130 --probe none --set scene.lidar.fov_deg=1.5";
        done(
            here,
            format!("frame {size} --out {name} {more}")
                .replace("  ", " ")
                .trim(),
        );
        let printed = done(
            here,
            &format!("photons --frame {name}/frame.json --out p_{name}"),
        );
        let replay = printed.lines().find_map(|line| line.strip_prefix("gdtof "));
        done(here, &format!("{} --out {name}.npy", replay.unwrap()));
        let [frame, replayed] = [format!("{name}/histograms.npy"), format!("{name}.npy")]
            .map(|file| fs::read(here.join(file)).unwrap());
        assert!(frame == replayed, "{name}");
        assert!(frame[128..].iter().any(|&byte| byte > 0), "{name} is empty");
    }
    // Without the frame there are the same pulses, and those of macropixels that it leaves dark.
    done(
        here,
        "photons --rows 4 --cols 5 --laser-cycles 130 --set scene.lidar.fov_deg=1.5 --out all",
    );
    let all = csv(&here.join("all/photons.csv"));
    let of_frame = csv(&here.join("p_street/photons.csv"));
    let lit: BTreeSet<(usize, usize)> = of_frame.iter().map(|p| (p.1, p.2)).collect();
    assert_eq!(
        all.iter()
            .map(|p| (p.1, p.2))
            .collect::<BTreeSet<_>>()
            .len(),
        20
    );
    let of_lit: Vec<Pulse> = all
        .into_iter()
        .filter(|p| lit.contains(&(p.1, p.2)))
        .collect();
    assert!(of_lit == of_frame);
}

#[test]
fn a_frame_s_dark_macropixels_are_told() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    done(
        here,
        "frame --rows 6 --cols 6 --laser-cycles 3 --probe none --scene empty",
    );
    let output = gdtof_words(here, "photons --frame out/frame.json");
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success());
    assert!(
        said.contains("36 of 36 macropixels have no pulses"),
        "{said}"
    );
    assert_eq!(csv(&here.join("photons/photons.csv")), []);
}

#[test]
fn every_format_has_the_same_pulses() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    for (name, asked, spads) in [
        (
            "chip",
            "--laser-cycles 30 --rows 4 --cols 4 --pixel 1-2,3 --pixel 0,0",
            16,
        ),
        (
            "other",
            "--period-ns 333.25 --laser-cycles 200 --spads 9 --rows 2 --cols 2",
            9,
        ),
        (
            "single",
            "--period-ns 1000 --laser-cycles 50 --fov-deg 0.3 --spads 1",
            1,
        ),
    ] {
        for format in ["csv", "txt", "npy", "vcd", "memh --word-ns 2"] {
            let folder = format!("{name}_{}", format.split(' ').next().unwrap());
            done(
                here,
                &format!("photons {asked} --format {format} --out {folder}"),
            );
        }
        let folder = |format: &str| here.join(format!("{name}_{format}"));
        let pulses = csv(&folder("csv").join("photons.csv"));
        assert!(pulses.len() > 300, "{name}: {}", pulses.len());
        assert!(pulses.iter().all(|pulse| pulse.3 < spads));
        assert!(npy(&folder("npy").join("photons.npy")) == pulses, "{name}");
        assert!(txt(&folder("txt")) == pulses, "{name}");

        let mut of_waves = Vec::new();
        for (row, col, path) in files(&folder("vcd"), ".vcd") {
            let (own, widths, [stop, clk]) = vcd(&path, (row, col));
            of_waves.extend(own);
            // 8 ns, but for pulses at the end of the exposure.
            assert_eq!(widths.last(), Some(&8_000_000), "{name}");
            assert_eq!(widths.len(), 1, "{name}: {widths:?}");
            let (stops, clks) = match name {
                "chip" => (30, 30 * 520),
                "other" => (200, 25_594),
                _ => (50, 19_200),
            };
            assert_eq!((stop, clk), (stops, clks), "{name}");
        }
        assert!(of_waves == pulses, "{name}");

        let mut of_words = Vec::new();
        for (row, col, path) in files(&folder("memh"), ".mem") {
            let text = fs::read_to_string(path).unwrap();
            for (word, line) in (0..).zip(text.lines()) {
                let bits = u64::from_str_radix(line, 16).unwrap();
                let set = (0..64).filter(|spad| bits >> spad & 1 == 1);
                of_words.extend(set.map(|spad| (word, row, col, spad)));
            }
        }
        let mut words: Vec<Pulse> = pulses
            .iter()
            .map(|&(time, row, col, spad)| (time / 2_000_000, row, col, spad))
            .collect();
        words.sort_unstable();
        of_words.sort_unstable();
        assert!(of_words == words, "{name}");
    }
}

/// What a golden model takes beside the pulses, against these.
#[test]
fn the_light_is_that_of_the_pulses() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let dim = "--set scene.lidar.fov_deg=1.5 --set scene.light.illuminance_klux=1 --set scene.lidar.pulse_energy_uj=0.2 --set scene.lidar.dark_count_hz=1e4";
    let words = format!("photons --rows 3 --cols 3 --period-ns 1500 --laser-cycles 4000 {dim}");
    done(here, &words);
    let mut counts = [0.0f64; 9];
    for (time, row, col, _) in csv(&here.join("photons/photons.csv")) {
        assert!(time < 4000 * 1_500_000_000);
        counts[3 * row + col] += 1.0;
    }
    let light = fs::read_to_string(here.join("photons/light.csv")).unwrap();
    let mut lines = light.lines();
    assert_eq!(
        lines.next(),
        Some("row,col,signal,background_hz,arrival_ns,truth_m")
    );
    for (count, line) in counts.iter().zip(lines) {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |at: usize| fields[at].parse::<f64>().unwrap();
        let (signal, background) = (number(2) * 4000.0, number(3) * 1.5e-6 * 4000.0);
        let mean = signal + background;
        // Of the echo's photons on 16 SPADs, some come while theirs is blind.
        let lost = signal * number(2) / 16.0;
        let allowed = 5.0 * mean.sqrt();
        assert!(
            *count < mean + allowed && *count > mean - lost - allowed,
            "{line}: {count}"
        );
        if !fields[5].is_empty() {
            let flight_ns = number(5) * 2.0 / 0.299_792_458;
            assert!((number(4) - flight_ns).abs() < 15.0, "{line}");
        }
    }
    assert!(counts.iter().all(|count| *count > 100.0), "{counts:?}");
}

#[test]
fn what_is_impossible_is_refused_with_what_to_give() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    for (words, says) in [
        (
            "--pixel 3",
            "--pixel: \"3\" is not a macropixel; give row,col",
        ),
        (
            "--pixel 3,64",
            "--pixel: macropixel 3,64 is outside the 64x64 array; give",
        ),
        (
            "--pixel 5-3,0",
            "--pixel: \"5-3,0\" is not a macropixel; give",
        ),
        (
            "--spads 0",
            "--spads: 0 are no SPADs of a macropixel; give 1 to 64",
        ),
        (
            "--spads 65",
            "--spads: 65 are no SPADs of a macropixel; give 1 to 64",
        ),
        (
            "--period-ns 0.2",
            "--period-ns: 0.2 ns is no laser period; give 1 to 1e6 ns",
        ),
        (
            "--period-ns 1e6 --laser-cycles 10000000",
            "--laser-cycles: 10000000 laser cycles of",
        ),
        (
            "--period-ns 100 --laser-cycles 0",
            "--laser-cycles: an exposure needs a laser cycle; give",
        ),
        (
            "--laser-cycles 10000000",
            "--laser-cycles: 520 CLK periods times 10000000",
        ),
        ("--period-ns 100 --stop-periods 5", "--stop-periods"),
        (
            "--fov-deg 170",
            "--fov-deg: fov_deg = 170 is impossible; give 0.1 to 150 deg",
        ),
        (
            "--fov-deg 1 --pixel 0,0",
            "--fov-deg: cannot be used with --pixel",
        ),
        (
            "--word-ns 2",
            "--word-ns 2: only memh has words; add --format memh",
        ),
        (
            "--format memh --word-ns 0",
            "--word-ns 0: is no length of a word; give",
        ),
        ("--no-clk", "--no-clk: only vcd has a CLK; add --format vcd"),
        (
            "--format vcd --period-ns 1e6 --laser-cycles 10000 --fov-deg 1",
            "--format vcd: an exposure of 10.0 s has no waveform",
        ),
        ("--frame none/frame.json", "none/frame.json: "),
        ("--frame x --seed 3", "--frame: cannot be used with --seed"),
        (
            "--period-ns 1e6 --fov-deg 50",
            "photons a laser cycle on a macropixel, of which",
        ),
    ] {
        let arguments: Vec<&str> = std::iter::once("photons").chain(words.split(' ')).collect();
        let output = gdtof(here, &arguments);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{words}: {said}");
        assert!(said.contains(says), "{words}: {said}");
        assert_eq!(said.lines().count(), 1, "{words}: {said}");
        assert_eq!(fs::read_dir(here).unwrap().count(), 0, "{words}");
    }
}

/// The sentence comes before the files, which do not fit here.
#[cfg(unix)]
#[test]
fn a_large_output_tells_its_size_first() {
    let dir = tempfile::tempdir().unwrap();
    let script = "trap '' XFSZ; ulimit -f 64; exec \"$0\" \"$@\"";
    let words =
        "photons --format memh --period-ns 1000 --laser-cycles 1000000 --fov-deg 1 --scene night";
    let run = std::process::Command::new("sh")
        .args(["-c", script, env!("CARGO_BIN_EXE_gdtof")])
        .args(words.split(' '))
        .current_dir(dir.path())
        .output()
        .unwrap();
    let said = String::from_utf8(run.stderr).unwrap();
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(run.status.code(), Some(2), "{said}");
    assert_eq!(lines.len(), 2, "{said}");
    assert_eq!(lines[0], "gdtof: writes about 5.0 GB into photons");
    assert!(lines[1].contains("free some space"), "{said}");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}
