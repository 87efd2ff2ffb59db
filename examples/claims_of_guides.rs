//! Whether guides are as wrong as they say: the share of estimates whose target lies within 1, 2 and 3 of the standard deviations claimed.
//!
//! The target is the ground truth's: the mean, by light, over what of a macropixel sends back most light. Windows are there for that.
//! `cargo run --release --example claims_of_guides` prints all of the book's table (`docs/src/guides.md`), guides by name only theirs.

use std::fmt::Write;

use guided_dtof::guide::{GuideError, GuideInput, GuideMap, PastFrame, options};
use guided_dtof::photon::{RandomPurpose, normal, random_stream};
use guided_dtof::scene::{GroundTruth, Scene};

/// Guides of the table, fused where there are several.
pub const GUIDES: [&str; 8] = [
    "truth",
    "stereo",
    "matched",
    "monocular",
    "radar",
    "intensity",
    "kalman",
    "stereo+radar+monocular",
];

/// Scenes of the table.
pub const SCENES: [&str; 3] = ["street", "van", "fog"];

/// Rows and columns of the array.
const SIZE: u32 = 64;

/// What of a guide's random numbers tells earlier frames' errors from others.
const DRAWS: u32 = 8;

/// Frames before the one that is guided, their distance, s, and the standard deviation of their depths, m.
const EARLIER: usize = 6;
const FRAME_S: f64 = 1.0 / 30.0;
const DEPTH_SIGMA_M: f64 = 0.1;

/// How a guide's claims have been kept.
#[derive(Debug, Clone, PartialEq, Default)]
struct GuideErrors {
    targets: usize,
    /// Error over the standard deviation claimed, of all that have an estimate, and the error, m.
    errors: Vec<(f64, f64)>,
}

impl GuideErrors {
    /// Share of the estimates whose target is within `sigmas` standard deviations as claimed.
    fn share_within(&self, sigmas: f64) -> f64 {
        let inside = self.errors.iter().filter(|(size, _)| *size <= sigmas);
        inside.count() as f64 / self.errors.len() as f64
    }

    /// Share of the macropixels with a target that have an estimate.
    fn share_guided(&self) -> f64 {
        self.errors.len() as f64 / self.targets as f64
    }

    /// Half of the estimates are no farther off than this, m; `None` without any.
    fn median_error_m(&self) -> Option<f64> {
        let mut errors_m: Vec<f64> = self.errors.iter().map(|(_, error_m)| *error_m).collect();
        errors_m.sort_by(f64::total_cmp);
        errors_m.get(errors_m.len() / 2).copied()
    }

    fn add(&mut self, map: &GuideMap, truth: &GroundTruth) {
        for (pixel, true_m) in truth.range_m.iter().enumerate() {
            let Some(true_m) = true_m else { continue };
            self.targets += 1;
            if let Some((range_m, sigma_m)) = map.estimate_of(pixel) {
                let error_m = (range_m - true_m).abs();
                let size = if error_m > 0.0 {
                    error_m / sigma_m
                } else {
                    0.0
                };
                self.errors.push((size, error_m));
            }
        }
    }
}

/// Compares the maps of a guide, as on the command line, with the truth: `frames` of them, a second apart, each with a seed of its own.
///
/// Earlier frames, for guides that look at them, are the true ranges with independent errors of 0.1 m, 30 a second.
///
/// # Errors
/// When the guide has no map.
///
/// # Panics
/// When there is no such guide.
fn kept(guide: &str, scene: &Scene, frames: u32) -> Result<GuideErrors, GuideError> {
    let looks_back = guide.contains("kalman");
    let guide = options::parse_all(guide.split('+'), "guide").expect("a guide");
    let mut all = GuideErrors::default();
    for frame in 0..frames {
        let (now_s, seed) = (f64::from(frame), u64::from(frame));
        let now = scene.snapshot(now_s);
        let truth = GroundTruth::render(&now, SIZE, SIZE);
        let past = |number: usize| past(scene, now_s - FRAME_S * number as f64, seed, number);
        let earlier: Vec<PastFrame> = if looks_back {
            (1..=EARLIER).rev().map(past).collect()
        } else {
            Vec::new()
        };
        let input = GuideInput {
            time_s: now_s,
            earlier: &earlier,
            ..GuideInput::still(&now, SIZE, SIZE, seed)
        };
        all.add(&guide.estimate(&input)?, &truth);
    }
    Ok(all)
}

fn past(scene: &Scene, time_s: f64, seed: u64, number: usize) -> PastFrame {
    let truth = GroundTruth::render(&scene.snapshot(time_s), SIZE, SIZE);
    let ranges = (0u32..).zip(&truth.range_m).map(|(pixel, range_m)| {
        let mut random = random_stream(seed, RandomPurpose::Guide, pixel, DRAWS + number as u32);
        range_m.map(|range_m| range_m + DEPTH_SIGMA_M * normal(&mut random))
    });
    PastFrame {
        time_s,
        range_m: ranges.collect(),
        counts: vec![0; truth.range_m.len()],
    }
}

/// Frames behind a line of the table: most of a network's error is common to a frame or to patches of it.
fn frames(guide: &str) -> u32 {
    match guide {
        "monocular" => 40,
        "radar" => 10,
        _ => 4,
    }
}

/// A line of the table, in Markdown.
///
/// # Errors
/// When the guide has no map.
///
/// # Panics
/// When there is no such guide or built-in scene.
pub fn line(guide: &str, scene: &str) -> Result<String, GuideError> {
    let world = Scene::named(scene).expect("a built-in scene");
    let kept = kept(guide, &world, frames(guide))?;
    let mut line = format!(
        "| `{}` | {scene} | {:.3} |",
        guide.replace('+', "` + `"),
        kept.share_guided()
    );
    match kept.median_error_m() {
        Some(error_m) => {
            write!(line, " {error_m:.2} |").expect("memory");
            for sigmas in [1.0, 2.0, 3.0] {
                write!(line, " {:.3} |", kept.share_within(sigmas)).expect("memory");
            }
        }
        None => line += " | | | |",
    }
    Ok(line)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let named: Vec<String> = std::env::args().skip(1).collect();
    println!("| guide | scene | has an estimate | median error, m | within 1 σ | 2 σ | 3 σ |");
    println!("|---|---|---|---|---|---|---|");
    println!("| promised | | | | 0.683 | 0.954 | 0.997 |");
    for guide in GUIDES {
        if !named.is_empty() && !named.iter().any(|name| name == guide) {
            continue;
        }
        for scene in SCENES {
            println!("{}", line(guide, scene)?);
        }
    }
    Ok(())
}
