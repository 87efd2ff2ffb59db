//! Stereo from the intensity images of two lidars (thesis 5.4, Fig. 79): all light that a macropixel detects makes a grey image, and
//! two of them, side by side, are matched as camera images are.
//!
//! ```text
//!   lidar    ──► counts of every pixel ──► √ ──┐
//!   at x = 0                                   ├─► semi-global matching ──► z = f·B/d (Eq. 26) ──► ranges
//!   second   ──► counts of every pixel ──► √ ──┘
//!   at x = B
//! ```
//!
//! Nothing is added but a second lidar, which car makers have (Fig. 72). Counts are what an exposure over whole laser cycles gives: the
//! sunlight that surfaces send back, the laser's echoes and dark counts, with their Poisson noise. The root makes that noise the same
//! everywhere. Images are as coarse as the sensor, or `finer` times as fine for a pair of short-range lidars with more pixels: at
//! 64 columns over 16° and a baseline of 1 m a pixel of disparity is 4 m at 30 m.
//!
//! What has no pattern cannot be matched: of the built-in street, whose surfaces are plain, next to nothing is found,
//! and there is no estimate where the pattern does not stand out of the counts' noise, as in fog, or where a pixel of
//! disparity is more than a tenth of the distance.
//!
//! Both lidars stand still, look straight ahead and see the scene at the same time; SPADs' dead time is left out, so that very bright
//! pixels are not compressed.

use rayon::prelude::*;

use super::facet::{self, Sample};
use super::{Guide, GuideError, GuideInput, GuideMap};
use crate::photon::{PixelLight, Poisson, RandomPurpose, normal, random_stream};
use crate::scene::{DVec3, GroundTruth, Scene};
use crate::settings::Range::Within;
use crate::settings::keys;
use crate::stereo::{Census, GreyImage, Matcher, Paths};

/// What of a guide's random numbers tells this one's from others': the counts of either lidar.
const DRAWS: [u32; 2] = [6, 7];

/// Pixels to either side that are compared.
const AROUND: usize = 2;

/// Pattern over noise below which a pixel has no estimate: the matcher's errors are 0.6 px at 1.8 and it answers anything at 0.9 (DESIGN.md).
const LEAST_TEXTURE: f64 = 2.0;

/// Smallest disparity that is reported, px: a whole pixel is then 10 % of the distance (thesis 5.2.1).
const LEAST_DISPARITY_PX: f64 = 10.0;

/// Counts from which a Poisson number is drawn as a normal one: their skewness is below 0.03.
const MANY: f64 = 1000.0;

keys! {
    /// Two lidars' intensity images, matched.
    #[derive(Copy)]
    #[non_exhaustive]
    pub struct IntensityStereo {
        /// Distance of the second lidar, to the right.
        baseline_m: f64 ["m"] = 1.0, in Within(0.01, 10.0), from "thesis 5.4.1: up to 1 m";
        /// Pixels of an intensity image across a macropixel.
        finer: u32 = 4, in Within(1.0, 16.0), from "chosen: a macropixel's SPADs, read one by one";
        /// Time for which light is counted.
        exposure_ms: f64 ["ms"] = 1.0, in Within(1e-3, 1e4);
        /// Laser pulses in a second.
        pulse_rate_hz: f64 ["Hz"] = 80e3, in Within(0.0, 1e7), from "thesis Table 14";
        /// Nearest depth that is searched.
        nearest_m: f64 ["m"] = 10.0, in Within(1.0, 1e4);
        /// Reported uncertainty (standard deviation) of a matched disparity.
        disparity_sigma_px: f64 ["px"] = 0.5, in Within(1e-3, 100.0),
            from "measured on walls with a pattern";
    }
}

impl IntensityStereo {
    /// What one of the lidars, `to_the_right_m` of the guided one, counts in every pixel.
    fn counts(&self, input: &GuideInput<'_>, to_the_right_m: f64, draws: u32) -> Vec<f64> {
        let (rows, cols) = (input.rows * self.finer, input.cols * self.finer);
        let scene = seen_from(input.scene, DVec3::new(to_the_right_m, 0.0, 0.0));
        let truth = GroundTruth::render(&scene, rows, cols);
        let light = scene.pixel_light(&truth);
        let seconds = self.exposure_ms * 1e-3;
        let mean = |light: &PixelLight| {
            (light.background_hz() + light.signal_per_cycle() * self.pulse_rate_hz) * seconds
        };
        let pixels = light.par_iter().enumerate().map(|(pixel, light)| {
            let mean = mean(light);
            let mut random = random_stream(input.seed, RandomPurpose::Guide, pixel as u32, draws);
            if mean < MANY {
                f64::from(Poisson::new(mean).draw(&mut random))
            } else {
                (mean + mean.sqrt() * normal(&mut random)).round()
            }
        });
        pixels.collect()
    }

    /// The root of counts as grey values of 16 bits, the brightest white.
    fn image(&self, input: &GuideInput<'_>, counts: &[f64], most: f64) -> Option<GreyImage> {
        let (rows, cols) = (input.rows * self.finer, input.cols * self.finer);
        let grey = |counts: &f64| (65_535.0 * (counts / most.max(1.0)).sqrt()).round() as u16;
        let pixels = counts.iter().map(grey).collect();
        GreyImage::new(cols as usize, rows as usize, 16, pixels).ok()
    }
}

/// The still scene with its origin elsewhere: as a rig sees it that has moved there.
fn seen_from(scene: &Scene, from_m: DVec3) -> Scene {
    let mut moved = scene.clone();
    moved.rig.velocity_m_s = from_m;
    moved.snapshot(1.0)
}

/// Whether the pattern about a pixel stands out of the counts' noise, whose standard deviation is ½ after the root.
fn textured(counts: &[f64], width: usize) -> Vec<bool> {
    let height = counts.len() / width;
    let about = |at: usize, size: usize| at.saturating_sub(AROUND)..(at + AROUND + 1).min(size);
    let is_textured = |pixel: usize| {
        let rows = about(pixel / width, height);
        let roots = rows
            .flat_map(|y| about(pixel % width, width).map(move |x| counts[y * width + x].sqrt()));
        let (n, sum, squares) = roots.fold((0.0, 0.0, 0.0), |(n, sum, squares), root| {
            (n + 1.0, sum + root, squares + root * root)
        });
        let variance = (squares - sum * sum / n) / (n - 1.0);
        variance > 0.25 * (1.0 + LEAST_TEXTURE * LEAST_TEXTURE)
    };
    (0..counts.len()).into_par_iter().map(is_textured).collect()
}

impl Guide for IntensityStereo {
    fn name(&self) -> &str {
        "intensity"
    }

    fn estimate(&self, input: &GuideInput<'_>) -> Result<GuideMap, GuideError> {
        let (rows, cols) = (input.rows, input.cols);
        let lidar = input
            .scene
            .lidar_camera(rows * self.finer, cols * self.finer);
        let metre_pixels = lidar.focal_px * self.baseline_m;
        let nothing = || GuideMap::new(rows, cols, vec![None; rows as usize * cols as usize]);
        let [left, right] = [(0.0, DRAWS[0]), (self.baseline_m, DRAWS[1])]
            .map(|(x_m, draws)| self.counts(input, x_m, draws));
        let most = left.iter().chain(&right).fold(0.0, |a: f64, &b| a.max(b));
        // Without a count there is nothing to tell pixels apart by.
        if most < 1.0 {
            return Ok(nothing());
        }
        let is_textured = textured(&left, (cols * self.finer) as usize);
        let images = [left, right].map(|counts| self.image(input, &counts, most));
        let [Some(left), Some(right)] = images else {
            return Ok(nothing());
        };
        // Disparities that leave half of the image to be matched.
        let widest = (cols * self.finer / 2).clamp(1, 255);
        let matcher = Matcher {
            // From infinity on, so that what is farther than the reach is not matched wrongly.
            min_disparity: 0,
            disparities: ((metre_pixels / self.nearest_m).ceil() as usize + 1)
                .clamp(1, widest as usize),
            census: Census {
                cols: 2 * AROUND + 1,
                rows: 2 * AROUND + 1,
            },
            paths: Paths::Four,
            speckle_px: 16,
            ..Matcher::default()
        };
        let Ok(mut found) = matcher.match_pair(&left, &right) else {
            return Ok(nothing());
        };
        found.keep(|at, px| is_textured[at] && f64::from(px) >= LEAST_DISPARITY_PX);
        // What has no pattern has no answer, so a surface before it ends where answers do. With the middle of narrow ones 0.047 of the street's targets have an
        // estimate, and 0.81 of them are within 3 σ; without it 0.005, all of which are.
        let rims = found.rims(AROUND, true);
        let estimates = (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col)));
        let finer = f64::from(self.finer);
        let pitch = [finer / lidar.focal_px, finer / lidar.focal_v_px];
        let estimates = estimates.map(|(row, col)| {
            let within = |at: u32| (at * self.finer..(at + 1) * self.finer).map(|at| at as usize);
            let pixels = within(row).flat_map(|row| within(col).map(move |col| (row, col)));
            let samples = pixels.filter_map(|(y, x)| {
                let disparity_px = f64::from(found.disparity_px(y, x)?);
                let at = [x as f64 + 0.5, y as f64 + 0.5];
                let metre_pixels = metre_pixels * lidar.at_unit_depth((at[0], at[1])).length();
                let off = |axis: usize, first: u32| at[axis] / finer - f64::from(first) - 0.5;
                Some(Sample {
                    at: [off(0, col), off(1, row)],
                    inverse: disparity_px / metre_pixels,
                    sigma: self.disparity_sigma_px / metre_pixels,
                    is_rim: rims[y * found.width() + x],
                })
            });
            facet::estimate(&mut samples.collect::<Vec<_>>(), pitch)
        });
        Ok(GuideMap::new(rows, cols, estimates))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guide::test_scenes::{errors_m, wall_at};
    use crate::scene::{Pattern, Texture};

    /// A wall with clouds on it.
    fn cloudy_wall(depth_m: f64) -> Scene {
        let mut scene = wall_at(depth_m);
        scene.objects[0].reflectivity = 0.1;
        scene.objects[0].texture = Some(Texture {
            pattern: Pattern::Noise(3),
            size_m: 4.0,
            second_reflectivity: 0.6,
            second_grey: None,
            shift_m: (0.0, 0.0),
            turn_deg: 0.0,
            seen_turned_deg: 0.0,
        });
        scene
    }

    #[test]
    fn a_second_lidar_sees_the_scene_from_its_place() {
        let scene = cloudy_wall(30.0);
        let truth = |scene: &Scene| GroundTruth::render(scene, 64, 64);
        let (here, there) = (truth(&scene), truth(&seen_from(&scene, DVec3::X)));
        assert_eq!(truth(&seen_from(&scene, DVec3::ZERO)), here);
        // A metre is 7.6 macropixels at 30 m: a quarter of one is a quarter of a pattern's step.
        let lidar = scene.lidar_camera(64, 64);
        let by_px = lidar.focal_px / 30.0;
        let mut products = [0.0; 2];
        for row in 0..64 {
            for col in 10..64 {
                let at = row * 64 + col;
                let unlike = |from: usize| (there.reflectivity[from] - here.reflectivity[at]).abs();
                products[0] += unlike(at - by_px.round() as usize);
                products[1] += unlike(at);
            }
        }
        assert!(2.0 * products[0] < products[1], "{products:?}");
    }

    #[test]
    fn a_wall_with_a_pattern_is_found_with_the_error_that_is_claimed() {
        for depth_m in [20.0, 40.0, 60.0] {
            let scene = cloudy_wall(depth_m);
            let errors = errors_m(&IntensityStereo::default(), &scene, 64, 1..2);
            let share = errors.len() as f64 / 4096.0;
            let within = |k: f64| {
                let inside = errors.iter().filter(|(e, s)| e.abs() <= k * s).count();
                inside as f64 / errors.len() as f64
            };
            assert!(share > 0.5, "{depth_m}: {share}");
            let (one, three) = (within(1.0), within(3.0));
            assert!(one > 0.68 && three > 0.95, "{depth_m}: {one} {three}");
            // Nor does it claim too little: 3.5 to 5.2 times its errors were measured.
            let sums = errors.iter().fold([0.0; 2], |[error, claim], (e, s)| {
                [error + e.abs(), claim + s]
            });
            assert!(sums[1] < 10.0 * sums[0], "{depth_m}: {sums:?}");
        }
    }

    /// Twice a mean over 1024 pixels errs as well as what is compared with it: within eight standard errors of one mean.
    #[test]
    fn counts_grow_with_time_and_the_laser_s_with_its_pulses() {
        let mut scene = wall_at(30.0);
        let mean = |scene: &Scene, pulse_rate_hz: f64, exposure_ms: f64| {
            let guide = IntensityStereo {
                finer: 1,
                pulse_rate_hz,
                exposure_ms,
                ..IntensityStereo::default()
            };
            let counts = guide.counts(&GuideInput::still(scene, 32, 32, 1), 0.0, DRAWS[0]);
            counts.iter().sum::<f64>() / 1024.0
        };
        let about = |mean: f64, expected: f64| {
            (mean - expected).abs() < 4.0 * 2.0 * (expected / 1024.0).sqrt()
        };
        scene.light.illuminance_klux = 0.0;
        scene.lidar.dark_count_hz = 0.0;
        let (once, twice, longer) = (
            mean(&scene, 4e5, 1.0),
            mean(&scene, 8e5, 1.0),
            mean(&scene, 4e5, 2.0),
        );
        let truth = GroundTruth::render(&scene, 32, 32);
        let light = scene.pixel_light(&truth);
        let signal = light.iter().map(PixelLight::signal_per_cycle).sum::<f64>() / 1024.0;
        assert!(once > 1.0 && about(once, 400.0 * signal), "{once} {signal}");
        assert!(
            about(twice, 2.0 * once) && about(longer, 2.0 * once),
            "{once} {twice} {longer}"
        );
        scene.light.illuminance_klux = 20.0;
        let (dim, long) = (mean(&scene, 0.0, 1.0), mean(&scene, 0.0, 2.0));
        assert!(dim > 1.0 && about(long, 2.0 * dim), "{dim} {long}");
    }

    /// Noise alone has a fifth of the variance that is asked for.
    #[test]
    fn a_pattern_stands_out_of_noise() {
        let stream = |pixel| random_stream(7, RandomPurpose::Guide, pixel, 0);
        let noisy = |mean: &dyn Fn(u32) -> f64| -> f64 {
            let counts = (0..1024)
                .map(|pixel| f64::from(Poisson::new(mean(pixel)).draw(&mut stream(pixel))));
            let found = textured(&counts.collect::<Vec<_>>(), 32);
            found.iter().filter(|&&is| is).count() as f64 / 1024.0
        };
        let even = [noisy(&|_| 20.0), noisy(&|_| 400.0)];
        assert!(even.iter().all(|share| *share < 0.01), "{even:?}");
        // Roots of 15 and 25: ten standard deviations of noise to either side of 20.
        let squares = noisy(&|pixel| {
            if (pixel + pixel / 32) % 2 == 0 {
                225.0
            } else {
                625.0
            }
        });
        assert_eq!(squares, 1.0);
    }

    #[test]
    fn in_the_dark_there_is_nothing_to_match() {
        let mut scene = Scene::outdoor();
        scene.light.illuminance_klux = 0.0;
        scene.lidar.dark_count_hz = 0.0;
        let guide = IntensityStereo {
            pulse_rate_hz: 0.0,
            ..IntensityStereo::default()
        };
        let map = guide
            .estimate(&GuideInput::still(&scene, 16, 16, 1))
            .unwrap();
        assert_eq!(map.guided(), 0);
    }
}
