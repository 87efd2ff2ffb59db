//! `gdtof range --detector`: unequal bins, first events, SPADs that fire together, and the light of a cover glass.

use std::fmt::Write;
use std::path::Path;

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use super::tools::gdtof_words;

const METRES_PER_NS: f64 = 0.149_896_229;
const SIGMA_NS: f64 = 1.5 / 2.354_820_045;
const CYCLES: usize = 1500;
/// Long bins behind short ones.
const EDGES_NS: [f64; 25] = [
    -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.5, 13.0, 14.5, 16.0,
    17.5, 19.0, 20.5, 22.0, 23.5, 25.0, 26.5, 28.0,
];

fn normal(random: &mut StdRng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

fn poisson(random: &mut StdRng, mean: f64) -> usize {
    let (mut number, mut product) = (0, random.random::<f64>());
    while product > libm::exp(-mean) {
        product *= random.random::<f64>();
        number += 1;
    }
    number
}

/// Photons of a laser cycle: of a surface, of the background and of a glass at no distance.
type Light = (f64, f64, f64, f64);

/// The times of a laser cycle's photons, ns, in order.
fn photons(random: &mut StdRng, (distance_m, signal, background, glass): Light) -> Vec<f64> {
    let mut times = Vec::new();
    for (place, mean) in [(distance_m / METRES_PER_NS, signal), (0.0, glass)] {
        for _ in 0..poisson(random, mean) {
            times.push(place + SIGMA_NS * normal(random));
        }
    }
    let from = EDGES_NS[0] - 5.0;
    for _ in 0..poisson(random, background) {
        times.push(from + (EDGES_NS[24] - from) * random.random::<f64>());
    }
    times.sort_by(f64::total_cmp);
    times
}

/// A zone's counts of the times that `events` makes of a laser cycle's photons, as a line.
fn line(
    random: &mut StdRng,
    light: Light,
    events: impl Fn(&mut StdRng, Vec<f64>) -> Vec<f64>,
) -> String {
    let mut counts = [0; 24];
    for _ in 0..CYCLES {
        let times = photons(random, light);
        for time in events(random, times) {
            let bin = EDGES_NS.partition_point(|&edge| edge <= time);
            if (1..=24).contains(&bin) {
                counts[bin - 1] += 1;
            }
        }
    }
    counts.map(|count| count.to_string()).join(",")
}

fn write_table(path: &Path, lines: impl Iterator<Item = String>) {
    let mut text = String::new();
    lines.for_each(|line| writeln!(text, "{line}").unwrap());
    std::fs::write(path, text).unwrap();
}

fn description(more: &str) -> String {
    format!("bin_edges_ns = {EDGES_NS:?}\npulse_fwhm_ns = 1.5\n{more}")
}

/// Depth and bound of each zone, which has one.
fn ranged(folder: &Path, words: &str) -> Vec<(f64, f64)> {
    let said = gdtof_words(
        folder,
        &format!("range --format counts --histograms counts.csv {words} --json"),
    );
    assert!(said.status.success(), "{said:?}");
    let report: serde_json::Value = serde_json::from_slice(&said.stdout).unwrap();
    let zones = report["zones"].as_array().unwrap();
    let zones = zones.iter().map(|zone| {
        let first = &zone["returns"][0];
        let number = |key: &str| {
            first[key]
                .as_f64()
                .unwrap_or_else(|| panic!("{key}: {zone:#}"))
        };
        (number("depth_m"), number("bound_m"))
    });
    zones.collect()
}

fn distances_m() -> impl Iterator<Item = f64> {
    (0..10).map(|zone| 0.7 + 0.27 * f64::from(zone))
}

fn assert_right(depths: &[(f64, f64)]) {
    for (&(depth_m, bound_m), true_m) in depths.iter().zip(distances_m()) {
        let off_m = depth_m - true_m;
        assert!(off_m.abs() < 5.0 * bound_m, "{true_m} {off_m} {bound_m}");
    }
}

#[test]
fn bins_of_unequal_lengths_are_ranged() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut random = StdRng::seed_from_u64(1);
    let every = |_: &mut StdRng, times| times;
    write_table(
        &folder.join("counts.csv"),
        distances_m().map(|true_m| line(&mut random, (true_m, 0.3, 0.4, 0.0), every)),
    );
    std::fs::write(folder.join("detector.toml"), description("")).unwrap();
    let depths = ranged(folder, "--detector detector.toml");
    assert_right(&depths);
    // Options go before the file: equal bins put the last surface elsewhere.
    let equal = ranged(
        folder,
        "--detector detector.toml --bin-width-ns 1.25 --start-ns -2",
    );
    let [(true_m, bound_m), (equal_m, _)] = [depths[5], equal[5]];
    assert!(
        (equal_m - true_m).abs() > 10.0 * bound_m,
        "{equal_m} {true_m}"
    );
}

/// Two SPADs of 16 within 4 ns, of which the first event of a laser cycle counts.
#[test]
fn spads_that_fire_together_are_ranged_as_such() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut random = StdRng::seed_from_u64(2);
    let first_of_two = |random: &mut StdRng, times: Vec<f64>| {
        let mut last = [f64::NEG_INFINITY; 16];
        for time in times {
            let spad = random.random_range(0..16);
            let is_high = |last: &f64| time - last < 4.0;
            let high = last.iter().filter(|last| is_high(last)).count();
            let is_event = high == 1 && !is_high(&last[spad]);
            last[spad] = time;
            if is_event {
                return vec![time];
            }
        }
        Vec::new()
    };
    write_table(
        &folder.join("counts.csv"),
        distances_m().map(|true_m| line(&mut random, (true_m, 3.0, 1.0, 0.0), first_of_two)),
    );
    let together = description(&format!(
        "counts = \"first\"\nlaser_cycles = {CYCLES}\ncoincidence = {{ spads = 2, within_ns = 4.0, of = 16 }}\n"
    ));
    std::fs::write(folder.join("detector.toml"), together).unwrap();
    assert_right(&ranged(folder, "--detector detector.toml"));
    // As first photons, most depths are wrong by more than their bounds say.
    let photons = description(&format!("counts = \"first\"\nlaser_cycles = {CYCLES}\n"));
    std::fs::write(folder.join("photons.toml"), photons).unwrap();
    let said = gdtof_words(
        folder,
        "range --format counts --histograms counts.csv --detector photons.toml --json",
    );
    let report: serde_json::Value = serde_json::from_slice(&said.stdout).unwrap();
    let zones = report["zones"].as_array().unwrap();
    let right = zones.iter().zip(distances_m()).filter(|(zone, true_m)| {
        let first = &zone["returns"][0];
        let (depth_m, bound_m) = (first["depth_m"].as_f64(), first["bound_m"].as_f64());
        depth_m
            .zip(bound_m)
            .is_some_and(|(depth, bound)| (depth - true_m).abs() < 3.0 * bound)
    });
    assert!(right.count() < 5);
}

#[test]
fn surfaces_behind_a_cover_glass_are_ranged() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut random = StdRng::seed_from_u64(3);
    let every = |_: &mut StdRng, times| times;
    write_table(
        &folder.join("counts.csv"),
        distances_m().map(|true_m| line(&mut random, (true_m, 0.2, 0.4, 0.8), every)),
    );
    write_table(
        &folder.join("glass.csv"),
        distances_m().map(|_| line(&mut random, (0.0, 0.0, 0.4, 0.8), every)),
    );
    std::fs::write(folder.join("detector.toml"), description("")).unwrap();
    let words = "--detector detector.toml --crosstalk";
    assert_right(&ranged(folder, &format!("{words} glass.csv")));
    assert_right(&ranged(folder, &format!("{words} fit")));
    // Without it the glass is the clearest echo.
    for (depth_m, _) in ranged(folder, "--detector detector.toml") {
        assert!(depth_m.abs() < 0.1, "{depth_m}");
    }
}

#[test]
fn a_wrong_description_is_said_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_table(
        &folder.join("counts.csv"),
        [["1"; 24].join(","), ["2"; 24].join(",")].into_iter(),
    );
    write_table(&folder.join("one.csv"), [["1"; 24].join(",")].into_iter());
    let words = "range --format counts --histograms counts.csv --detector d.toml";
    for (text, more, says) in [
        (
            "bin_width_ns = 1\n".to_owned(),
            "",
            "d.toml: pulse_fwhm_ns: is needed",
        ),
        (
            "bin_edges_ns = [1, 2]\npulse_fwhm_ns = 1\n".into(),
            "",
            "d.toml: bin_edges_ns: has 2 numbers for 24 bins",
        ),
        (
            description("start_ns = 3\n"),
            "",
            "start_ns: says the same as bin_edges_ns",
        ),
        (description("counts = \"second\"\n"), "", "d.toml:3"),
        (description("bins = 4\n"), "", "d.toml:3"),
        (
            description("coincidence = { spads = 3, within_ns = 4, of = 2 }\nlaser_cycles = 3\n"),
            "",
            "coincidence.spads: 3 is impossible",
        ),
        (
            description("coincidence = { spads = 2, within_ns = 4, of = 16 }\n"),
            "",
            "laser_cycles",
        ),
        (
            description("most_counts = 1\n"),
            "",
            "zone 1 has 2 counts in bin 0, where a bin stops at 1",
        ),
        (
            description(""),
            " --crosstalk one.csv",
            "one.csv: has 1 zones",
        ),
    ] {
        std::fs::write(folder.join("d.toml"), text).unwrap();
        let refused = gdtof_words(folder, &format!("{words}{more}"));
        let said = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(2), "{says}: {said}");
        assert!(
            said.contains(says) && said.lines().count() == 1,
            "{says}: {said}"
        );
        assert!(refused.stdout.is_empty());
    }
}
