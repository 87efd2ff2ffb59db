//! What `gdtof frame` leaves of its probes: a few laser cycles around the first HIT, the same as VCD and as FST, as they
//! are in the waveform of everything; and views that open there.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A laser cycle of 520 CLK periods at 384 MHz, fs.
const LASER_CYCLE_FS: u64 = 1_354_166_667;

/// Takes a frame of 8×8 macropixels of a street in the dark and returns its probe's waveform.
fn probe(folder: &Path, extra: &[&str]) -> PathBuf {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/vectors/scenes/outdoor.toml");
    let scene = std::fs::read_to_string(scene).unwrap();
    let mut dim = scene;
    for (from, to) in [
        ("illuminance_klux = 50.0", "illuminance_klux = 0.01"),
        ("pulse_energy_uj = 100.0", "pulse_energy_uj = 0.001"),
    ] {
        assert!(dim.contains(from), "{from}");
        dim = dim.replace(from, to);
    }
    std::fs::write(folder.join("dim.toml"), dim).unwrap();
    let out = folder.join(extra.join("_"));
    let run = Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args("frame --rows 8 --cols 8 --laser-cycles 100 --scene dim.toml".split(' '))
        .args(extra)
        .arg("--out")
        .arg(&out)
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(
        run.status.success(),
        "{}",
        String::from_utf8_lossy(&run.stderr)
    );
    let files = std::fs::read_dir(&out).unwrap().map(|f| f.unwrap().path());
    let is_wave = |f: &PathBuf| f.extension().is_some_and(|e| e == "vcd" || e == "fst");
    files.into_iter().find(is_wave).expect("a probe's waveform")
}

/// Times and values of a signal, one an instant.
type Changes = Vec<(u64, String)>;

/// Beginning, end, and changes of every signal.
fn read(path: &Path) -> (u64, u64, BTreeMap<String, Changes>) {
    let mut waves = wellen::simple::read(path).unwrap();
    let signals: Vec<_> = waves
        .hierarchy()
        .all_vars()
        .map(|var| {
            let var = &waves.hierarchy()[var];
            (var.full_name(waves.hierarchy()), var.signal_ref())
        })
        .collect();
    let refs: Vec<_> = signals.iter().map(|(_, signal)| *signal).collect();
    waves.load_signals(&refs);
    let times = waves.time_table().to_vec();
    let mut all = BTreeMap::new();
    for (name, signal) in signals {
        let mut changes = Changes::new();
        for (time, value) in waves.get_signal(signal).unwrap().iter_changes() {
            let time = times[time as usize];
            changes.pop_if(|(last, _)| *last == time);
            changes.push((time, value.to_bit_string().unwrap()));
        }
        all.insert(name, changes);
    }
    (times[0], times[times.len() - 1], all)
}

/// The number behind the last `key` of a text.
fn number(text: &str, key: &str) -> u64 {
    let (_, rest) = text.rsplit_once(key).expect(key);
    let end = rest
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(rest.len());
    rest[..end].parse().unwrap()
}

#[test]
fn a_frame_keeps_and_shows_the_first_hit() {
    let folder = tempfile::tempdir().unwrap();
    let vcd = probe(folder.path(), &["--wave-format", "vcd"]);
    let fst = probe(folder.path(), &["--wave-format", "fst"]);
    let everything = ["--wave-format", "fst", "--wave-cycles", "all"];
    let everything = probe(folder.path(), &everything);

    let (from, until, kept) = read(&vcd);
    assert_eq!(read(&fst), (from, until, kept.clone()));
    let (start, end, all) = read(&everything);
    assert_eq!(start, 0);
    assert!(all.keys().eq(kept.keys()));
    let hit = all.iter().find(|(name, _)| name.ends_with("metdc.HIT"));
    let (_, hit) = hit.expect("the macropixel has a HIT");
    let is_hit = |(_, value): &&(u64, String)| value.contains('1');
    let first_hit = hit.iter().find(is_hit).expect("something is counted").0;

    // A few laser cycles around the first HIT, not the first ones.
    assert!(
        from > LASER_CYCLE_FS && until < end,
        "{from} to {until} of {end}"
    );
    assert!((until - from).abs_diff(4 * LASER_CYCLE_FS) < 10);
    let hit_in_kept = first_hit - from;
    assert!((LASER_CYCLE_FS..2 * LASER_CYCLE_FS).contains(&hit_in_kept));
    // The same state at its beginning and the same changes as in the waveform of everything, at the same times.
    for (name, changes) in &all {
        let seen = changes.partition_point(|&(time, _)| time <= from);
        let mut wanted = vec![(from, changes[seen - 1].1.clone())];
        let later = changes[seen..].iter().filter(|&&(time, _)| time <= until);
        wanted.extend(later.cloned());
        assert_eq!(kept[name], wanted, "{name}");
    }

    let gtkw = std::fs::read_to_string(fst.with_extension("gtkw")).unwrap();
    assert!(gtkw.contains(".fst\""));
    let opens = number(&gtkw, "[timestart] ");
    assert!(opens < first_hit && first_hit - opens < LASER_CYCLE_FS / 10);
    let marker = gtkw.lines().find(|line| line.starts_with('*')).unwrap();
    assert_eq!(marker.split(' ').nth(1), Some(&*first_hit.to_string()));

    let surfer = std::fs::read_to_string(fst.with_extension("sucl")).unwrap();
    assert_eq!(number(&surfer, "cursor_set "), first_hit);
    let added = surfer
        .lines()
        .filter_map(|line| line.strip_prefix("variable_add "));
    let added: Vec<&str> = added.collect();
    assert!(added.len() > 20);
    for name in added {
        assert!(kept.contains_key(name), "{name} is not in the waveform");
    }
}

#[test]
fn so_many_laser_cycles_from_the_first_one_on() {
    let folder = tempfile::tempdir().unwrap();
    let (from, until, signals) = read(&probe(folder.path(), &["--wave-cycles", "3"]));
    let stop = &signals["quantic4x4.STOP"];
    let rises = stop.iter().filter(|(_, value)| value == "1").count();
    assert_eq!(from, 0);
    assert!(until < 5 * LASER_CYCLE_FS);
    // The edge that ends the third is kept.
    assert_eq!(rises, 4);
}
