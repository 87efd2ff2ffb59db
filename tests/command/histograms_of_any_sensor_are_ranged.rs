//! `gdtof range` of histograms that no chip of ours has taken: a table, and logs as evaluation kits write them.
//!
//! The samples in `vectors/range` are drawn here photon by photon, at known distances, in the form of each log.

use std::fmt::Write;
use std::path::Path;

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use super::tools::gdtof_words;

const METRES_PER_NS: f64 = 0.149_896_229;

/// How a sensor's bins lie, and the light that it sees.
struct Sample {
    bins: usize,
    bin_ns: f64,
    /// The pulse leaves in the middle of this bin.
    pulse_bin: f64,
    photons: f64,
    background_per_bin: f64,
}

impl Sample {
    /// A number of mean `mean`, of Poisson's distribution for a small one.
    fn poisson(random: &mut StdRng, mean: f64) -> u32 {
        let tries = 1000.0_f64.max(20.0 * mean).ceil();
        (0..tries as usize)
            .filter(|_| random.random::<f64>() < mean / tries)
            .count() as u32
    }

    /// Counts of a surface at `distance_m`.
    fn counts(&self, random: &mut StdRng, distance_m: f64) -> Vec<u32> {
        let mut counts: Vec<u32> = (0..self.bins)
            .map(|_| Self::poisson(random, self.background_per_bin))
            .collect();
        let place = self.pulse_bin + 0.5 + distance_m / METRES_PER_NS / self.bin_ns;
        for _ in 0..Self::poisson(random, self.photons) {
            // Nearly a normal number: the sum of twelve even ones.
            let normal = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
            let bin = place + normal * SIGMA_NS / self.bin_ns;
            if (0.0..self.bins as f64).contains(&bin) {
                counts[bin as usize] += 1;
            }
        }
        counts
    }
}

/// 2 ns full width at half maximum.
const SIGMA_NS: f64 = 2.0 / 2.354_820_045;

/// Distance of a zone of a capture, m.
fn distance_m(capture: usize, zone: usize) -> f64 {
    0.8 + 0.4 * capture as f64 + 0.13 * zone as f64
}

const TMF882X: Sample = Sample {
    bins: 128,
    bin_ns: 0.4,
    pulse_bin: 12.0,
    photons: 900.0,
    background_per_bin: 30.0,
};
const TMF8829: Sample = Sample {
    bins: 64,
    bin_ns: 1.7,
    pulse_bin: 3.0,
    photons: 700.0,
    background_per_bin: 60.0,
};
const CNH: Sample = Sample {
    bins: 24,
    bin_ns: 1.5,
    pulse_bin: -0.5,
    photons: 500.0,
    background_per_bin: 25.0,
};

fn tmf882x_log() -> String {
    let mut random = StdRng::seed_from_u64(8820);
    let mut text = String::from("#TMF8820 log of a model\n");
    for capture in 0..2 {
        // The reference sees the pulse itself.
        let mut channels = vec![TMF882X.counts(&mut random, 0.0)];
        channels.extend((0..9).map(|zone| TMF882X.counts(&mut random, distance_m(capture, zone))));
        for line in 0..30 {
            let counts = &channels[line % 10];
            let bytes = counts
                .iter()
                .map(|n| (n >> (8 * (line / 10)) & 0xff).to_string());
            let bytes: Vec<String> = bytes.collect();
            writeln!(text, "#Raw,0,{line},{}", bytes.join(",")).unwrap();
        }
        writeln!(text, "#Obj,{capture},27,0,0").unwrap();
    }
    text
}

fn tmf8829_log() -> String {
    let mut random = StdRng::seed_from_u64(8829);
    let frames: Vec<serde_json::Value> = (0..2)
        .map(|capture| {
            let bins = |counts: Vec<u32>| serde_json::json!({ "bin": counts });
            let references: Vec<_> = (0..4)
                .map(|_| bins(TMF8829.counts(&mut random, 0.0)))
                .collect();
            let row = |random: &mut StdRng, row: usize| -> Vec<serde_json::Value> {
                (0..4)
                    .map(|col| bins(TMF8829.counts(random, distance_m(capture, 4 * row + col))))
                    .collect()
            };
            let zones = [row(&mut random, 0), row(&mut random, 1)];
            let own = |row: usize| -> Vec<serde_json::Value> {
                (0..4)
                    .map(|col| {
                        let mm = (1e3 * distance_m(capture, 4 * row + col)).round();
                        serde_json::json!({"noise": 60, "peaks": [{"distance": mm, "snr": 90}]})
                    })
                    .collect()
            };
            serde_json::json!({
                "info": {"frame_number": capture, "temperature": 27},
                "ref_histo": references, "mp_histo": zones, "results": [own(0), own(1)],
            })
        })
        .collect();
    let log = serde_json::json!({"configuration": {"histogram_bins": 64}, "Result_Set": frames});
    format!("{log}\n")
}

/// Rates: a count is a tenth, and the ambient light is taken off.
fn cnh_log() -> String {
    let mut random = StdRng::seed_from_u64(58);
    let mut text = String::new();
    for capture in 0..2 {
        writeln!(text, "Data Count: {capture}").unwrap();
        for zone in 0..16 {
            let counts = CNH.counts(&mut random, distance_m(capture, zone));
            let ambient = 0.1 * CNH.background_per_bin;
            let values = counts
                .iter()
                .map(|&n| format!("{:.1}", 0.1 * f64::from(n) - ambient));
            let values: Vec<String> = values.collect();
            writeln!(
                text,
                "Agg, {zone}, Ambient, {ambient:.1}, Bins, {}",
                values.join(", ")
            )
            .unwrap();
        }
    }
    text
}

/// Name, text, words of the command, zones.
type Log = (&'static str, fn() -> String, &'static str, usize);

const SAMPLES: [Log; 3] = [
    (
        "tmf882x.log",
        tmf882x_log,
        "--format tmf882x --bin-width-ns 0.4",
        9,
    ),
    (
        "tmf8829.json",
        tmf8829_log,
        "--format tmf8829 --bin-width-ns 1.7",
        8,
    ),
    (
        "cnh.csv",
        cnh_log,
        "--format cnh --bin-width-ns 1.5 --counts-per-unit 10",
        16,
    ),
];

fn ranged(folder: &Path, words: &str) -> Vec<serde_json::Value> {
    let said = gdtof_words(folder, &format!("range {words} --json"));
    assert!(said.status.success(), "{said:?}");
    let report: serde_json::Value = serde_json::from_slice(&said.stdout).unwrap();
    report["zones"].as_array().unwrap().clone()
}

/// Set GDTOF_REMAKE to write the files anew (`vectors/remake.sh` does) after a deliberate change.
#[test]
fn the_sample_logs_give_their_distances() {
    let vectors = Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors/range");
    for (name, log, words, zones) in SAMPLES {
        let file = vectors.join(name);
        if std::env::var_os("GDTOF_REMAKE").is_some() {
            std::fs::write(&file, log()).unwrap();
        }
        assert_eq!(
            std::fs::read_to_string(&file).unwrap(),
            log(),
            "{name} is another one"
        );
        let folder = tempfile::tempdir().unwrap();
        let words = format!("{words} --histograms {} --pulse-fwhm-ns 2", file.display());
        let found = ranged(folder.path(), &words);
        assert_eq!(found.len(), 2 * zones, "{name}");
        for zone in &found {
            let number = |key: &str| zone[key].as_u64().unwrap() as usize;
            let true_m = distance_m(number("capture"), number("zone"));
            let first = &zone["returns"][0];
            let (depth_m, bound_m) = (first["depth_m"].as_f64(), first["bound_m"].as_f64());
            let (depth_m, bound_m) = (depth_m.unwrap(), bound_m.unwrap());
            // The reference's own place is known to some hundredths of a bin.
            let off_m = (depth_m - true_m).abs();
            assert!(off_m < 4.0 * bound_m + 0.01, "{name}: {off_m} {zone:#}");
            if name.starts_with("tmf8829") {
                assert!((zone["sensor_m"].as_f64().unwrap() - true_m).abs() < 0.001);
            }
        }
    }
}

/// A table of 40 bins of 1 ns that begin 10 ns after the pulse.
fn table() -> (String, Vec<f64>) {
    let sample = Sample {
        bins: 40,
        bin_ns: 1.0,
        pulse_bin: -10.5,
        photons: 300.0,
        background_per_bin: 12.0,
    };
    let mut random = StdRng::seed_from_u64(40);
    let distances: Vec<f64> = (0..12).map(|zone| 2.5 + 0.35 * f64::from(zone)).collect();
    let mut text = String::from("# zones x bins\n");
    for &distance_m in &distances {
        let counts = sample.counts(&mut random, distance_m);
        let counts: Vec<String> = counts.iter().map(u32::to_string).collect();
        writeln!(text, "{}", counts.join(";")).unwrap();
    }
    (text, distances)
}

#[test]
fn a_table_is_ranged_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (text, distances) = table();
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors/range/counts.csv");
    if std::env::var_os("GDTOF_REMAKE").is_some() {
        std::fs::write(&sample, &text).unwrap();
    }
    assert_eq!(
        std::fs::read_to_string(&sample).unwrap(),
        text,
        "counts.csv is another one"
    );
    std::fs::write(folder.join("counts.csv"), text).unwrap();
    let words =
        "--format counts --histograms counts.csv --bin-width-ns 1 --pulse-fwhm-ns 2 --start-ns 10";
    let found = ranged(folder, &format!("{words} --out depths.csv"));
    for (zone, true_m) in found.iter().zip(&distances) {
        let first = &zone["returns"][0];
        let off_m = first["depth_m"].as_f64().unwrap() - true_m;
        assert!(
            off_m.abs() < 5.0 * first["bound_m"].as_f64().unwrap(),
            "{zone:#}"
        );
    }
    let written = std::fs::read_to_string(folder.join("depths.csv")).unwrap();
    assert_eq!(written.lines().count(), 1 + distances.len());
    // The echo of the first zone, in bin 6, is left out, and nothing else stands there.
    let cut = ranged(folder, &format!("{words} --bins 12-39"));
    assert_eq!(cut[0]["no_depth"], "no_significant_peak");
    let same = |at: usize| {
        (
            found[at]["returns"][0]["depth_m"].clone(),
            cut[at]["returns"][0]["depth_m"].clone(),
        )
    };
    let (all, some) = same(9);
    assert!((all.as_f64().unwrap() - some.as_f64().unwrap()).abs() < 0.005);
}

/// As a public log of a TMF8829 has it, whose logger wrote one histogram of each row in all columns.
#[test]
fn histograms_that_a_logger_repeats_are_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (text, _) = table();
    let line = text.lines().nth(1).unwrap();
    std::fs::write(folder.join("counts.csv"), format!("{line}\n{line}\n")).unwrap();
    let words = "range --format counts --histograms counts.csv --bin-width-ns 1 --pulse-fwhm-ns 2";
    let said = gdtof_words(folder, words);
    let said = String::from_utf8(said.stderr).unwrap();
    assert!(
        said.contains("1 of 2 zones have the counts of the zone before"),
        "{said}"
    );
}

#[test]
fn what_is_missing_or_impossible_is_said_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("counts.csv"), table().0).unwrap();
    std::fs::write(folder.join("rates.csv"), "1.5,2\n3,4\n").unwrap();
    // As of a TMF8829 whose zones have 256 bins.
    let finer = r#"{"Result_Set": [{"mp_histo": [[{"bin": [1, 2, 3, 9, 1, 1]}]], "ref_histo": [{"bin": [5, 1, 0]}]}]}"#;
    std::fs::write(folder.join("finer.json"), finer).unwrap();
    std::fs::write(folder.join("captures.parquet"), b"PAR1\x15\x04").unwrap();
    let pair = "laser_cycles = 9000\ncoincidence = { spads = 2, within_ns = 4.0, of = 16 }\n";
    std::fs::write(folder.join("pair.toml"), pair).unwrap();
    // A flat stretch of light in every zone.
    let zone = format!(
        "{}1\n",
        "1,400,400,400,400,400,400,400,400,400,".repeat(2) + &"1,".repeat(19)
    );
    let zones = table()
        .0
        .lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()))
        .count();
    std::fs::write(folder.join("flat.csv"), zone.repeat(zones)).unwrap();
    let bins = "--bin-width-ns 1 --pulse-fwhm-ns 2";
    let counts = "range --format counts --histograms counts.csv";
    for (words, says) in [
        (counts.to_owned(), "--bin-width-ns: is needed"),
        (
            format!("{counts} --bin-width-ns 1"),
            "--pulse-fwhm-ns: is needed",
        ),
        (format!("{counts} {bins} --bins 5-90"), "has bins 0 to 39"),
        (format!("{counts} {bins} --bins 9"), "no range of bins"),
        (format!("{counts} {bins} --counts first"), "--laser-cycles"),
        (
            format!("{counts} {bins} --counts first --laser-cycles 5"),
            "zone 0 has",
        ),
        (
            format!("{counts} --bin-width-ns 1 --pulse-fwhm-ns 30"),
            "more than half",
        ),
        (
            format!("{counts} {bins} --fit even"),
            "is not for --format counts",
        ),
        (
            format!("range --format counts --histograms rates.csv {bins}"),
            "--counts-per-unit",
        ),
        (
            format!("range --format tmf8829 --histograms finer.json {bins}"),
            "a reference histogram of 3 bins beside zones of 6; say when bin 0 begins with --start-ns",
        ),
        (
            format!("range --format tmf8829 --histograms counts.csv {bins}"),
            "is a table of counts, which --format counts reads",
        ),
        (
            "range --format tmf8820 --histograms finer.json".to_owned(),
            "is a log of a TMF8829, which --format tmf8829 reads",
        ),
        (
            format!("range --format counts --histograms captures.parquet {bins}"),
            "is a Parquet file, which Python reads",
        ),
        (
            format!("{counts} {bins} --detector pair.toml --crosstalk flat.csv"),
            "flat.csv: zone 0 has counts of SPADs that fire together which are no echo",
        ),
    ] {
        let refused = gdtof_words(folder, &words);
        let said = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(2), "{words}: {said}");
        assert!(
            said.contains(says) && said.lines().count() == 1,
            "{words}: {said}"
        );
        assert!(refused.stdout.is_empty());
    }
}

/// A zone's first photon of each laser cycle: without saying so, the depth of strong light is too near.
#[test]
fn first_photons_are_ranged_as_such() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut random = StdRng::seed_from_u64(1);
    let (bins, cycles, true_m) = (40, 3000, 3.0);
    let place = true_m / METRES_PER_NS;
    let mut counts = vec![0; bins];
    for _ in 0..cycles {
        let mut first = f64::INFINITY;
        for _ in 0..Sample::poisson(&mut random, 2.5) {
            let normal = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
            first = first.min(place + normal * SIGMA_NS);
        }
        if Sample::poisson(&mut random, 0.5) > 0 {
            first = first.min(bins as f64 * random.random::<f64>());
        }
        if first < bins as f64 {
            counts[first.max(0.0) as usize] += 1;
        }
    }
    let counts: Vec<String> = counts.iter().map(u32::to_string).collect();
    std::fs::write(folder.join("first.csv"), counts.join(",") + "\n").unwrap();
    let words = "--format counts --histograms first.csv --bin-width-ns 1 --pulse-fwhm-ns 2";
    let depth = |words: &str| {
        let zone = ranged(folder, words).remove(0);
        let first = &zone["returns"][0];
        let number = |key: &str| first[key].as_f64();
        (number("depth_m").unwrap() - true_m, number("bound_m"))
    };
    let (off_m, bound_m) = depth(&format!("{words} --counts first --laser-cycles {cycles}"));
    assert!(off_m.abs() < 5.0 * bound_m.unwrap(), "{off_m} {bound_m:?}");
    let (naive_m, _) = depth(words);
    assert!(naive_m < -0.03, "{naive_m}");
}
