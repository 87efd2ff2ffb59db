//! Whether guides are as wrong as they say: the share of macropixels whose true range lies within 1, 2 and 3 of the standard deviations claimed.
//!
//! Truth is [`GroundTruth`]'s: the mean, by light, over what of a macropixel sends back most light. That is what the windows are there for.

use super::{Guide, GuideError, GuideInput, GuideMap, PastFrame};
use crate::photon::{Purpose, normal, random_stream};
use crate::scene::{GroundTruth, Scene};

/// Shares of a normal distribution within 1, 2 and 3 standard deviations of its mean: what a claim promises.
pub const PROMISED: [f64; 3] = [0.682_689_5, 0.954_499_7, 0.997_300_2];

/// What of a guide's random numbers tells earlier frames' errors from others.
const DRAWS: u32 = 8;

/// Frames before the one that is guided, their distance, s, and the standard deviation of their depths, m.
const EARLIER: usize = 6;
const FRAME_S: f64 = 1.0 / 30.0;
const DEPTH_SIGMA_M: f64 = 0.1;

/// How a guide's claims have been kept.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Kept {
    /// Macropixels with a target.
    pub targets: usize,
    /// Error over the standard deviation claimed, of all that have an estimate, ascending in size.
    sizes: Vec<f64>,
    /// Size of the error, m, ascending.
    errors_m: Vec<f64>,
}

impl Kept {
    /// Estimates that were compared.
    pub fn estimates(&self) -> usize {
        self.sizes.len()
    }

    /// Share of the estimates whose target is within `sigmas` standard deviations as claimed.
    pub fn share_within(&self, sigmas: f64) -> f64 {
        let inside = self.sizes.partition_point(|&size| size <= sigmas);
        inside as f64 / self.sizes.len().max(1) as f64
    }

    /// Share of the macropixels with a target that have an estimate.
    pub fn share_guided(&self) -> f64 {
        self.sizes.len() as f64 / self.targets.max(1) as f64
    }

    /// Half of the estimates are no farther off than this, m.
    pub fn median_error_m(&self) -> f64 {
        self.errors_m
            .get(self.errors_m.len() / 2)
            .copied()
            .unwrap_or(f64::NAN)
    }
}

/// Compares a guide's maps with the truth, one for each of `seeds` and so many seconds into the scene.
///
/// Earlier frames, for guides that look at them, are the true ranges with independent errors of 0.1 m, 30 a second.
///
/// # Errors
/// When the guide has no map.
pub fn kept(
    guide: &dyn Guide,
    scene: &Scene,
    rows: u32,
    cols: u32,
    seeds: impl Iterator<Item = u64>,
) -> Result<Kept, GuideError> {
    let mut all = Kept::default();
    for seed in seeds {
        let now_s = seed as f64;
        let now = scene.at(now_s);
        let truth = GroundTruth::render(&now, rows, cols);
        let earlier: Vec<PastFrame> = (0..EARLIER)
            .map(|frame| past(scene, now_s, frame, (rows, cols), seed))
            .collect();
        let moved_m = scene.rig.at(now_s).0 - scene.rig.at(now_s - FRAME_S).0;
        let input = GuideInput {
            time_s: now_s,
            velocity_m_s: moved_m / FRAME_S,
            earlier: &earlier,
            ..GuideInput::still(&now, rows, cols, seed)
        };
        all.add(&guide.estimate(&input)?, &truth);
    }
    all.sizes.sort_by(f64::total_cmp);
    all.errors_m.sort_by(f64::total_cmp);
    Ok(all)
}

fn past(scene: &Scene, now_s: f64, frame: usize, (rows, cols): (u32, u32), seed: u64) -> PastFrame {
    let time_s = now_s - FRAME_S * (EARLIER - frame) as f64;
    let truth = GroundTruth::render(&scene.at(time_s), rows, cols);
    let ranges = (0u32..).zip(&truth.range_m).map(|(pixel, range_m)| {
        let mut random = random_stream(seed, Purpose::Guide, pixel, DRAWS + frame as u32);
        range_m.map(|range_m| range_m + DEPTH_SIGMA_M * normal(&mut random))
    });
    PastFrame {
        time_s,
        range_m: ranges.collect(),
        counts: vec![0; truth.range_m.len()],
    }
}

impl Kept {
    fn add(&mut self, map: &GuideMap, truth: &GroundTruth) {
        for (pixel, true_m) in truth.range_m.iter().enumerate() {
            let Some(true_m) = true_m else { continue };
            self.targets += 1;
            if let Some((range_m, sigma_m)) = map.estimate_of(pixel) {
                let error_m = (range_m - true_m).abs();
                self.errors_m.push(error_m);
                self.sizes.push(match error_m == 0.0 {
                    true => 0.0,
                    false => error_m / sigma_m,
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    #[ignore]
    fn table() {
        let args: Vec<String> = std::env::var("T")
            .unwrap()
            .split(';')
            .map(String::from)
            .collect();
        let guides: Vec<&str> = args[0].split(' ').collect();
        let seeds: u64 = args[1].parse().unwrap();
        for name in guides {
            let guide = crate::guide::options::parse_all(name.split('+'), "guide").unwrap();
            for scene_name in args[2].split(' ') {
                let scene = Scene::named(scene_name).unwrap();
                let k = kept(&*guide, &scene, 64, 64, 0..seeds).unwrap();
                println!(
                    "{name:10} {scene_name:7} guided {:.3} n {} err {:.3} | {:.4} {:.4} {:.4} | {:.4}@4",
                    k.share_guided(),
                    k.estimates(),
                    k.median_error_m(),
                    k.share_within(1.),
                    k.share_within(2.),
                    k.share_within(3.),
                    k.share_within(4.)
                );
                if args.len() > 3 {
                    let mut by: std::collections::BTreeMap<(String, bool), Vec<f64>> =
                        Default::default();
                    for seed in 0..seeds {
                        let s = scene.at(seed as f64);
                        let truth = GroundTruth::render(&s, 64, 64);
                        let map = guide
                            .estimate(&GuideInput::still(&s, 64, 64, seed))
                            .unwrap();
                        for p in 0..4096 {
                            if let (Some(o), Some((r, sg))) = (truth.object[p], map.estimate_of(p))
                            {
                                let edge = truth.surfaces[p].len() > 1
                                    || truth.surfaces[p][0].ray_share < 0.999;
                                let z = (r - truth.range_m[p].unwrap()) / sg;
                                if args.len() > 4 && z.abs() > 3. && edge {
                                    let t = &truth.surfaces[p];
                                    println!(
                                        "      {} {} r {:.2} sg {:.2} true {}",
                                        p / 64,
                                        p % 64,
                                        r,
                                        sg,
                                        t.iter()
                                            .map(|s| format!(
                                                "{} {:.2} light {:.2} rays {:.2}",
                                                s.object, s.range_m, s.light_share, s.ray_share
                                            ))
                                            .collect::<Vec<_>>()
                                            .join("; ")
                                    );
                                }
                                by.entry((s.objects[o].name.clone(), edge))
                                    .or_default()
                                    .push(z);
                            }
                        }
                    }
                    for ((name, edge), mut z) in by {
                        z.sort_by(f64::total_cmp);
                        let w = |k: f64| {
                            z.iter().filter(|z| z.abs() <= k).count() as f64 / z.len() as f64
                        };
                        println!(
                            "   {name:24} edge {edge:5} n {:6} median z {:+.2} | {:.3} {:.3} {:.3} out {}",
                            z.len(),
                            z[z.len() / 2],
                            w(1.),
                            w(2.),
                            w(3.),
                            z.iter().filter(|z| z.abs() > 3.).count()
                        );
                    }
                }
            }
        }
    }
}
