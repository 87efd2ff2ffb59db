//! Radar as a guide (thesis 7.4.1): good range, coarse angle: “it could point a guided dToF system to a broad area of interest”.
//!
//! ```text
//!        beam (azimuth × elevation)                          power
//!     ┌──────────────────────────┐                             │      ▂
//!     │ rays to all surfaces     │ ──► range cells, ΔΩ·cos²/r² │  ▂   █      strongest cell: the beam's range,
//!     │            in the beam   │                             └──┴───┴──► r  for all macropixels in it
//!     └──────────────────────────┘
//! ```
//!
//! The scene says nothing of radio waves: all materials send back alike, as rough surfaces that favour the perpendicular (cos² of the
//! angle of incidence), and power falls with r⁴ while a beam covers r² of surface. Radar and lidar stand in the same place. There is no
//! clutter, no multipath, no Doppler.
//!
//! A beam's range is one for all of its macropixels, and which of the surfaces in the beam one of them sees, radar does not know. Its
//! claim says so: the variance is that of the range itself and the spread of the beam's profile about it. Power alone tells little of how much
//! of the beam a surface fills: a road that is met at 3 degrees sends back a 400th of what a car does. But it fills a run of cells, and a plane that crosses
//! the beam has in each of them a solid angle that goes as 1/r². So a cell counts with the solid angle that its power would stand for if it faced the radar
//! (power·r²), and every run once more as a plane that crosses the whole beam.

use rayon::prelude::*;

use super::{Guide, GuideError, GuideInput, GuideMap};
use crate::photon::{RandomPurpose, normal, random_stream};
use crate::scene::{DVec3, Ray, Scene, Stage};
use crate::settings::Range::{Above, Within};
use crate::settings::keys;

/// What of a guide's random numbers tells this one's from others'.
const DRAWS: u32 = 5;

/// Rays across a beam, either way: surfaces of a sixteenth of a beam are found.
const RAYS_ACROSS: u32 = 16;

/// Cells are of one run when they are nearer to each other than this part of twice their range. Farther road falls into several runs, which makes claims wider:
/// of a street and a van's road like the built-in ones 3 σ hold 0.999 and 1.000 with it, with 0.1 and more 0.977 and 0.989.
const SAME_RUN: f64 = 0.05;

keys! {
    /// A radar that looks where the lidar looks.
    #[derive(Copy)]
    #[non_exhaustive]
    pub struct Radar {
        /// Width of a beam.
        azimuth_beam_deg: f64 ["deg"] = 2.0, in Within(0.1, 90.0),
            from "chosen: an automotive imaging radar";
        /// Height of a beam.
        elevation_beam_deg: f64 ["deg"] = 4.0, in Within(0.1, 90.0),
            from "chosen: an automotive imaging radar";
        /// Surfaces nearer to each other than this are one echo.
        resolution_m: f64 ["m"] = 0.5, in Within(0.01, 100.0), from "chosen: 300 MHz of bandwidth";
        /// Standard deviation of an echo's range.
        range_sigma_m: f64 ["m"] = 0.15, in Within(0.0, 100.0);
        /// Distance beyond which nothing is found.
        reach_m: f64 ["m"] = 250.0, in Above(0.0, 1e5);
    }
}

/// What a ray of a beam meets.
#[derive(Debug, Clone, Copy)]
struct Echo {
    range_m: f64,
    power: f64,
}

/// A range cell in which something is.
#[derive(Debug, Clone, Copy)]
struct Cell {
    number: i64,
    power: f64,
    /// Power times range, m.
    moment: f64,
}

impl Cell {
    fn range_m(&self) -> f64 {
        self.moment / self.power
    }
}

impl Radar {
    /// The beam, counted from the one about the axis, that a direction is in: column and row.
    fn beam_of(&self, towards: DVec3) -> (i32, i32) {
        let azimuth_deg = libm::atan2(towards.x, towards.z).to_degrees();
        let elevation_deg = libm::atan2(towards.y, libm::hypot(towards.x, towards.z)).to_degrees();
        (
            (azimuth_deg / self.azimuth_beam_deg).round() as i32,
            (elevation_deg / self.elevation_beam_deg).round() as i32,
        )
    }

    /// What comes back within a beam.
    fn echoes(&self, stage: &Stage, (col, row): (i32, i32)) -> Vec<Echo> {
        let angles = |beam: i32, width_deg: f64| {
            let offset = move |n: u32| (f64::from(n) + 0.5) / f64::from(RAYS_ACROSS) - 0.5;
            (0..RAYS_ACROSS).map(move |n| ((f64::from(beam) + offset(n)) * width_deg).to_radians())
        };
        let rays = angles(row, self.elevation_beam_deg).flat_map(|elevation| {
            angles(col, self.azimuth_beam_deg).map(move |azimuth| {
                let across = libm::cos(elevation);
                DVec3::new(
                    across * libm::sin(azimuth),
                    libm::sin(elevation),
                    across * libm::cos(azimuth),
                )
            })
        });
        let echoes = rays.filter_map(|towards| {
            let hit = stage.hit(&Ray::new(DVec3::ZERO, towards))?;
            let incidence = hit.normal.dot(towards).abs();
            let power = (incidence / hit.range_m).powi(2);
            (hit.range_m <= self.reach_m && power > 0.0).then_some(Echo {
                range_m: hit.range_m,
                power,
            })
        });
        echoes.collect()
    }

    /// Range of the strongest cell, and its variance as the range of any surface of the beam, m and m².
    fn strongest(&self, echoes: &[Echo]) -> Option<(f64, f64)> {
        let mut sorted = echoes.to_vec();
        sorted.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
        let number = |range_m: f64| (range_m / self.resolution_m).floor() as i64;
        let mut cells: Vec<Cell> = Vec::new();
        for echo in &sorted {
            let moment = echo.power * echo.range_m;
            match cells.last_mut() {
                Some(last) if last.number == number(echo.range_m) => {
                    last.power += echo.power;
                    last.moment += moment;
                }
                _ => cells.push(Cell {
                    number: number(echo.range_m),
                    power: echo.power,
                    moment,
                }),
            }
        }
        let strongest = (cells.iter()).max_by(|a, b| a.power.total_cmp(&b.power))?;
        let range_m = strongest.range_m();
        let (mut total, mut spread) = (0.0, 0.0);
        let mut add = |share: f64, cell: &Cell| {
            total += share;
            spread += share * (cell.range_m() - range_m).powi(2);
        };
        for run in cells
            .chunk_by(|a, b| (a.range_m() + b.range_m()) * SAME_RUN > b.range_m() - a.range_m())
        {
            let of_cell = |cell: &Cell| cell.range_m().powi(-2);
            let all: f64 = run.iter().map(of_cell).sum();
            for cell in run {
                add(cell.power * cell.range_m().powi(2), cell);
                add(
                    f64::from(RAYS_ACROSS * RAYS_ACROSS) * of_cell(cell) / all,
                    cell,
                );
            }
        }
        Some((range_m, spread / total))
    }
}

impl Guide for Radar {
    fn name(&self) -> &str {
        "radar"
    }

    fn estimate(&self, input: &GuideInput<'_>) -> Result<GuideMap, GuideError> {
        let lidar = input.scene.lidar_camera(input.rows, input.cols);
        let pixels = input.rows as usize * input.cols as usize;
        let beams: Vec<(i32, i32)> = (0..pixels)
            .map(|pixel| {
                let (row, col) = (pixel as u32 / input.cols, pixel as u32 % input.cols);
                let centre = (f64::from(col) + 0.5, f64::from(row) + 0.5);
                self.beam_of(lidar.at_unit_depth(centre))
            })
            .collect();
        let mut each = beams.clone();
        each.sort_unstable();
        each.dedup();
        let stage = Stage::new(input.scene);
        let found: Vec<Option<(f64, f64)>> = (0..each.len() as u32)
            .into_par_iter()
            .map(|number| {
                let echoes = self.echoes(&stage, each[number as usize]);
                let (range_m, spread_m2) = self.strongest(&echoes)?;
                let mut random = random_stream(input.seed, RandomPurpose::Guide, number, DRAWS);
                let measured_m = range_m + self.range_sigma_m * normal(&mut random);
                let sigma_m = (self.range_sigma_m.powi(2) + spread_m2).sqrt();
                Some((measured_m.max(0.0), sigma_m))
            })
            .collect();
        let of_pixel = |beam| found[each.binary_search(beam).expect("a beam of the array")];
        let estimates = beams.iter().map(of_pixel);
        Ok(GuideMap::new(input.rows, input.cols, estimates))
    }

    fn reach(&self, _scene: &Scene) -> Option<String> {
        Some(format!("the radar finds nothing beyond {} m", self.reach_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guide::test_scenes::{normalised_errors, wall_at};

    #[test]
    fn a_wall_is_as_far_as_it_says_and_one_range_serves_a_beam() {
        let scene = wall_at(50.0);
        let radar = Radar::default();
        let map = radar
            .estimate(&GuideInput::still(&scene, 64, 64, 1))
            .unwrap();
        let mut ranges: Vec<u64> = map.range_m.iter().flatten().map(|m| m.to_bits()).collect();
        ranges.sort_unstable();
        ranges.dedup();
        // 16 degrees of 2 and 4, beams about the axis: 9 by 5.
        assert_eq!((map.guided(), ranges.len()), (4096, 45));
        // The wall's range changes within a beam, by up to half a metre in the corners.
        let errors = normalised_errors(&radar, &scene, 32, 0..60);
        let variance = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
        assert!((0.85..1.15).contains(&variance), "{variance}");
    }

    /// Rays are spread evenly over their beam, and none is another beam's.
    #[test]
    fn rays_fill_their_beam() {
        let radar = Radar::default();
        let scene = wall_at(50.0);
        for beam in [(0, 0), (3, -1), (-2, 2)] {
            let echoes = radar.echoes(&Stage::new(&scene), beam);
            assert_eq!(echoes.len() as u32, RAYS_ACROSS * RAYS_ACROSS);
            // A wall is met at 50 m over the cosine of the angle off the axis; so are all rays of the beam's grid.
            let angle = |beam: i32, n: u32, width_deg: f64| {
                ((f64::from(beam) + (f64::from(n) + 0.5) / 16.0 - 0.5) * width_deg).to_radians()
            };
            let rays = (0..16).flat_map(|row| (0..16).map(move |col| (row, col)));
            for (echo, (row, col)) in echoes.iter().zip(rays) {
                let cosine =
                    libm::cos(angle(beam.1, row, 4.0)) * libm::cos(angle(beam.0, col, 2.0));
                assert!((echo.range_m * cosine / 50.0 - 1.0).abs() < 1e-9);
                assert!((echo.power / (cosine / echo.range_m).powi(2) - 1.0).abs() < 1e-9);
            }
        }
    }

    /// By hand: a car in one cell and a road in two that are one run. Each cell weighs with power·r², a run once more as a plane
    /// across the beam, whose cells have solid angles that go as 1/r².
    #[test]
    fn a_claim_weighs_what_fills_the_beam() {
        let echo = |range_m: f64, power: f64| Echo { range_m, power };
        let echoes = [
            echo(50.2, 1e-5),
            echo(20.1, 4e-7),
            echo(20.3, 4e-7),
            echo(20.7, 2e-7),
            echo(50.4, 1e-5),
        ];
        let (range_m, variance_m2) = Radar::default().strongest(&echoes).expect("an echo");
        assert!((range_m - 50.3).abs() < 1e-9);
        let runs: [&[(f64, f64)]; 2] = [&[(20.2, 8e-7), (20.7, 2e-7)], &[(50.3, 2e-5)]];
        let (mut total, mut spread) = (0.0, 0.0);
        for run in runs {
            let all: f64 = run.iter().map(|(r, _)| 1.0 / (r * r)).sum();
            for (r, power) in run {
                let weight = power * r * r + 256.0 / (r * r) / all;
                total += weight;
                spread += weight * (r - 50.3) * (r - 50.3);
            }
        }
        assert!(
            (variance_m2 / (spread / total) - 1.0).abs() < 1e-9,
            "{variance_m2}"
        );
        // Cells farther apart than a tenth of their range are runs of their own; the road then counts twice.
        let apart = |far_m: f64| {
            Radar::default()
                .strongest(&[echo(20.1, 1e-6), echo(far_m, 1e-9)])
                .expect("an echo")
                .1
        };
        let by_hand = |far_m: f64, is_one_run: bool| {
            let (near, far) = (1.0 / (20.1 * 20.1), 1.0 / (far_m * far_m));
            let [of_near, of_far] =
                [near, far].map(|one| 256.0 * if is_one_run { one / (near + far) } else { 1.0 });
            let weight = 1e-9 * far_m * far_m + of_far;
            weight * (far_m - 20.1).powi(2) / (weight + 1e-6 * 20.1 * 20.1 + of_near)
        };
        for (far_m, is_one_run) in [(22.1, true), (22.3, false)] {
            assert!(
                (apart(far_m) / by_hand(far_m, is_one_run) - 1.0).abs() < 1e-9,
                "{far_m} m"
            );
        }
        assert_eq!(Radar::default().strongest(&[]), None);
    }

    /// Of the road, which radar hardly sees, macropixels are given the range of what stands on it; the claim holds them all the same.
    #[test]
    fn over_the_street_claims_hold_what_faces_it_and_what_it_grazes() {
        let scene = Scene::outdoor();
        let radar = Radar::default();
        let lidar = scene.lidar_camera(64, 64);
        let (mut facing, mut grazing) = (Vec::new(), Vec::new());
        for seed in 1..4 {
            let map = radar
                .estimate(&GuideInput::still(&scene, 64, 64, seed))
                .unwrap();
            for pixel in 0..4096 {
                let centre = ((pixel % 64) as f64 + 0.5, (pixel / 64) as f64 + 0.5);
                let towards = lidar.at_unit_depth(centre).normalize();
                let hit = scene.hit(&Ray::new(DVec3::ZERO, towards));
                let (Some(hit), Some((range_m, sigma_m))) = (hit, map.estimate_of(pixel)) else {
                    continue;
                };
                let error = (range_m - hit.range_m).abs() / sigma_m;
                if hit.normal.dot(towards).abs() > 0.5 {
                    facing.push(error)
                } else {
                    grazing.push(error)
                }
            }
        }
        // The normal share of 3 standard deviations less a hundredth.
        for errors in [facing, grazing] {
            let held = errors.iter().filter(|e| **e <= 3.0).count();
            assert!(
                held as f64 >= 0.987 * errors.len() as f64,
                "{held} of {}",
                errors.len()
            );
        }
    }

    #[test]
    fn it_says_how_far_it_reaches() {
        let reach = Radar {
            reach_m: 90.0,
            ..Radar::default()
        }
        .reach(&Scene::outdoor());
        assert_eq!(
            reach.as_deref(),
            Some("the radar finds nothing beyond 90 m")
        );
    }

    #[test]
    fn empty_beams_and_what_is_out_of_reach_have_no_estimate() {
        let radar = Radar {
            reach_m: 49.0,
            ..Radar::default()
        };
        let map = radar.estimate(&GuideInput::still(&wall_at(50.0), 16, 16, 1));
        assert_eq!(map.unwrap().guided(), 0);
    }
}
