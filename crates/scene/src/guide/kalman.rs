//! Prediction from the lidar's own earlier depths (thesis 7.4.1): a Kalman filter for the target of every macropixel.
//!
//! ```text
//!   state    range r and the target's own speed v along the line of sight, covariance P
//!   predict  r ← |r·d + v·Δt·d − u·Δt|,  P ← F·P·Fᵀ + Q,  F = [1 Δt; 0 1],  Q = σ_a²·[Δt⁴/4 Δt³/2; Δt³/2 Δt²]
//!   update   with a measured z:  K = P·Hᵀ/(P₀₀ + σ_z²),  r ← r + K₀·(z − r),  v ← v + K₁·(z − r)
//! ```
//!
//! u is the rig's own velocity, known from odometry: what stands still comes closer by it and moves over the image, so that its
//! state moves on to another macropixel (direction d); where two arrive, the nearer hides the other. Macropixels into which nothing
//! moves have no estimate.
//!
//! A measurement farther off than `gate` standard deviations is another target's, and begins anew. Without a measurement a state is
//! predicted on, until its standard deviation exceeds `lost_m`. The state is computed anew from the earlier frames each time, so that the map
//! is a function of the input alone.

use super::{Guide, GuideError, GuideInput, GuideMap, PastFrame};
use crate::scene::{DVec3, PinholeCamera};
use crate::settings::Range::{Above, Within};
use crate::settings::keys;

keys! {
    /// Depth predicted from the frames before.
    ///
    /// It claims the filter's standard deviation, which is right as far as targets move as assumed.
    #[derive(Copy)]
    #[non_exhaustive]
    pub struct Kalman {
        /// Standard deviation of a measured distance.
        measured_sigma_m: f64 ["m"] = 0.1, in Above(0.0, 1e4),
            from "chosen: about a bin of 0.39 m over the root of 12";
        /// Standard deviation of a target's acceleration along the line of sight, m/s².
        acceleration_m_s2: f64 = 3.0, in Within(0.0, 1e4), from "chosen: a car that brakes gently";
        /// Standard deviation of the speed of a target seen for the first time, m/s.
        speed_m_s: f64 = 10.0, in Within(0.0, 1e4);
        /// Number of standard deviations from the prediction beyond which a measurement belongs to another target.
        gate: f64 = 4.0, in Above(0.0, 100.0),
            from "chosen: one of 16 000 right ones is taken for another's";
        /// Standard deviation at which an unseen target is given up.
        lost_m: f64 ["m"] = 10.0, in Above(0.0, 1e5);
    }
}

/// A target along a macropixel's line of sight.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Track {
    range_m: f64,
    /// Own speed away from the lidar, m/s: without what the rig's motion makes of it.
    speed_m_s: f64,
    /// Variance of range, covariance, variance of speed.
    covariance: [f64; 3],
}

impl Kalman {
    /// A target that has just been seen.
    fn begin(&self, measured_m: f64) -> Track {
        Track {
            range_m: measured_m,
            speed_m_s: 0.0,
            covariance: [self.measured_sigma_m.powi(2), 0.0, self.speed_m_s.powi(2)],
        }
    }

    /// The track after a measurement.
    fn update(&self, track: &Track, measured_m: f64) -> Track {
        let [rr, rv, vv] = track.covariance;
        let innovation_m = measured_m - track.range_m;
        let variance = rr + self.measured_sigma_m.powi(2);
        if innovation_m.powi(2) > self.gate.powi(2) * variance {
            return self.begin(measured_m);
        }
        let (gain_r, gain_v) = (rr / variance, rv / variance);
        Track {
            range_m: track.range_m + gain_r * innovation_m,
            speed_m_s: track.speed_m_s + gain_v * innovation_m,
            covariance: [(1.0 - gain_r) * rr, (1.0 - gain_r) * rv, vv - gain_v * rv],
        }
    }

    /// The track `dt_s` later, and the point where its target then is, for a line of sight along the unit vector `towards`.
    fn predict(
        &self,
        track: &Track,
        towards: DVec3,
        velocity_m_s: DVec3,
        dt_s: f64,
    ) -> (Track, DVec3) {
        let [rr, rv, vv] = track.covariance;
        let q = self.acceleration_m_s2.powi(2);
        let along_m = track.range_m + track.speed_m_s * dt_s;
        let point_m = towards * along_m - velocity_m_s * dt_s;
        let predicted = Track {
            range_m: point_m.length(),
            speed_m_s: track.speed_m_s,
            covariance: [
                rr + 2.0 * dt_s * rv + dt_s * dt_s * vv + q * dt_s.powi(4) / 4.0,
                rv + dt_s * vv + q * dt_s.powi(3) / 2.0,
                vv + q * dt_s * dt_s,
            ],
        };
        (predicted, point_m)
    }

    /// All tracks `dt_s` later, each in the macropixel where its target then is.
    fn move_on(
        &self,
        tracks: &[Option<Track>],
        lidar: &PinholeCamera,
        velocity_m_s: DVec3,
        dt_s: f64,
    ) -> Vec<Option<Track>> {
        let cols = lidar.width as usize;
        let mut moved: Vec<Option<Track>> = vec![None; tracks.len()];
        for (pixel, track) in tracks.iter().enumerate() {
            let Some(track) = track else { continue };
            let centre = ((pixel % cols) as f64 + 0.5, (pixel / cols) as f64 + 0.5);
            let towards = lidar.at_unit_depth(centre).normalize();
            let (track, point_m) = self.predict(track, towards, velocity_m_s, dt_s);
            let landed = lidar.project(point_m).and_then(|at| lidar.pixel_at(at));
            let Some((row, col)) = landed else { continue };
            let slot = &mut moved[row as usize * cols + col as usize];
            let is_hidden = slot.is_some_and(|other| other.range_m <= track.range_m);
            if !is_hidden && track.covariance[0].sqrt() <= self.lost_m {
                *slot = Some(track);
            }
        }
        moved
    }

    /// The tracks after all earlier frames, and when the last of them was taken.
    fn tracks(&self, input: &GuideInput<'_>, lidar: &PinholeCamera) -> (Vec<Option<Track>>, f64) {
        let mut tracks = vec![None; input.rows as usize * input.cols as usize];
        let mut now_s = input.earlier.first().map_or(input.time_s, |f| f.time_s);
        for PastFrame {
            time_s, range_m, ..
        } in input.earlier
        {
            tracks = self.move_on(&tracks, lidar, input.velocity_m_s, time_s - now_s);
            now_s = *time_s;
            for (track, measured_m) in tracks.iter_mut().zip(range_m) {
                *track = match (*track, measured_m) {
                    (Some(track), &Some(measured_m)) => Some(self.update(&track, measured_m)),
                    (None, &Some(measured_m)) => Some(self.begin(measured_m)),
                    (track, None) => track,
                };
            }
        }
        (tracks, now_s)
    }
}

impl Guide for Kalman {
    fn name(&self) -> &str {
        "kalman"
    }

    fn estimate(&self, input: &GuideInput<'_>) -> Result<GuideMap, GuideError> {
        let lidar = input.scene.lidar_camera(input.rows, input.cols);
        let (tracks, now_s) = self.tracks(input, &lidar);
        let moved = self.move_on(&tracks, &lidar, input.velocity_m_s, input.time_s - now_s);
        let estimates = moved
            .iter()
            .map(|track| track.map(|t| (t.range_m, t.covariance[0].sqrt())));
        Ok(GuideMap::new(input.rows, input.cols, estimates))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guide::test_scenes::wall_at;
    use crate::photon::{RandomPurpose, normal, random_stream};

    /// Frames `dt_s` apart, in which every macropixel measures `range_m(frame)`.
    fn frames(
        count: usize,
        pixels: usize,
        dt_s: f64,
        range_m: impl Fn(usize, usize) -> Option<f64>,
    ) -> Vec<PastFrame> {
        (0..count)
            .map(|frame| PastFrame {
                time_s: frame as f64 * dt_s,
                range_m: (0..pixels).map(|pixel| range_m(frame, pixel)).collect(),
                counts: vec![0; pixels],
            })
            .collect()
    }

    /// A prediction's covariance is F·P·Fᵀ + q·g·gᵀ with F = [1 dt; 0 1] and g = [dt²/2, dt].
    #[test]
    fn covariances_grow_as_a_random_acceleration_makes_them() {
        let guide = Kalman::default();
        for (dt_s, [rr, rv, vv]) in [
            (0.1, [0.3, 0.2, 4.0]),
            (2.0, [1.0, -0.5, 0.7]),
            (0.7, [2.0, 1.1, 9.0]),
        ] {
            let track = Track {
                range_m: 40.0,
                speed_m_s: -3.0,
                covariance: [rr, rv, vv],
            };
            let (predicted, _) = guide.predict(&track, DVec3::Z, DVec3::ZERO, dt_s);
            let (of_r, of_v) = ([1.0, dt_s], [0.0, 1.0]);
            let carried = |a: [f64; 2], b: [f64; 2]| {
                a[0] * b[0] * rr + (a[0] * b[1] + a[1] * b[0]) * rv + a[1] * b[1] * vv
            };
            let pushed = |a: f64, b: f64| guide.acceleration_m_s2 * a * guide.acceleration_m_s2 * b;
            let (g_r, g_v) = (0.5 * dt_s * dt_s, dt_s);
            let wanted = [
                carried(of_r, of_r) + pushed(g_r, g_r),
                carried(of_r, of_v) + pushed(g_r, g_v),
                carried(of_v, of_v) + pushed(g_v, g_v),
            ];
            for (found, wanted) in predicted.covariance.iter().zip(wanted) {
                assert!(
                    (found - wanted).abs() < 1e-12 * wanted.abs().max(1.0),
                    "{dt_s} s: {found} {wanted}"
                );
            }
        }
    }

    /// Targets that accelerate at random, as the filter assumes, measured with its error: predictions are off by what it claims.
    #[test]
    fn predictions_have_the_error_that_the_filter_claims() {
        const PIXELS: usize = 64 * 64;
        let (guide, dt_s, count) = (Kalman::default(), 0.1, 8);
        let mut last_m = vec![0.0; PIXELS];
        let mut measured = vec![vec![None; PIXELS]; count];
        for pixel in 0..PIXELS {
            let mut random = random_stream(5, RandomPurpose::Guide, pixel as u32, 99);
            let (mut range_m, mut speed_m_s) = (60.0, guide.speed_m_s * normal(&mut random));
            for (frame, measured) in measured.iter_mut().enumerate() {
                if frame > 0 {
                    let a = guide.acceleration_m_s2 * normal(&mut random);
                    range_m += speed_m_s * dt_s + a * dt_s * dt_s / 2.0;
                    speed_m_s += a * dt_s;
                }
                measured[pixel] = Some(range_m + guide.measured_sigma_m * normal(&mut random));
            }
            let a = guide.acceleration_m_s2 * normal(&mut random);
            last_m[pixel] = range_m + speed_m_s * dt_s + a * dt_s * dt_s / 2.0;
        }
        let earlier = frames(count, PIXELS, dt_s, |frame, pixel| measured[frame][pixel]);
        let scene = wall_at(60.0);
        let input = GuideInput {
            time_s: count as f64 * dt_s,
            earlier: &earlier,
            ..GuideInput::still(&scene, 64, 64, 0)
        };
        let map = guide.estimate(&input).unwrap();
        let squares = (0..PIXELS).map(|pixel| {
            let (range_m, sigma_m) = map.estimate_of(pixel).unwrap();
            ((range_m - last_m[pixel]) / sigma_m).powi(2)
        });
        let variance = squares.sum::<f64>() / PIXELS as f64;
        // One of 16 000 right measurements, at 8 a target, is taken for another's: a few wild ones of 4096.
        assert!((variance - 1.0).abs() < 0.12, "{variance}");
        let sure = map.sigma_m.iter().filter(|&&s| s < 0.12).count();
        assert!(sure > PIXELS * 99 / 100, "{sure}");
    }

    #[test]
    fn a_wall_that_the_rig_drives_at_is_expected_where_it_will_be() {
        let scene = wall_at(60.0);
        let lidar = scene.lidar_camera(16, 16);
        let range_m = |pixel: usize, depth_m: f64| {
            let centre = ((pixel % 16) as f64 + 0.5, (pixel / 16) as f64 + 0.5);
            lidar.at_unit_depth(centre).length() * depth_m
        };
        let earlier = frames(3, 256, 0.3, |frame, pixel| {
            Some(range_m(pixel, 60.0 - 6.0 * frame as f64))
        });
        let input = GuideInput {
            time_s: 0.9,
            velocity_m_s: DVec3::new(0.0, 0.0, 20.0),
            earlier: &earlier,
            ..GuideInput::still(&scene, 16, 16, 0)
        };
        let map = Kalman::default().estimate(&input).unwrap();
        // The wall comes nearer, so that some macropixels have nothing moving into them.
        assert!(map.guided() > 150, "{}", map.guided());
        for (pixel, estimated_m) in map.range_m.iter().enumerate() {
            let expected_m = range_m(pixel, 42.0);
            assert!(estimated_m.is_none_or(|m| (m - expected_m).abs() < 0.15));
        }
    }

    #[test]
    fn another_target_begins_anew_and_an_unseen_one_is_given_up() {
        let scene = wall_at(60.0);
        let earlier = frames(6, 2, 0.1, |frame, pixel| match (pixel, frame) {
            (0, 0..5) => Some(60.0),
            // Nearer by less than the gate's number of metres.
            (0, _) => Some(57.0),
            (1, 0) => Some(40.0),
            _ => None,
        });
        let estimate = |time_s| {
            let input = GuideInput {
                time_s,
                earlier: &earlier,
                ..GuideInput::still(&scene, 1, 2, 0)
            };
            Kalman::default().estimate(&input).unwrap()
        };
        let soon = estimate(0.6);
        assert_eq!(soon.range_m, [Some(57.0), Some(40.0)]);
        // 10 m/s in 0.1 s.
        assert!((soon.sigma_m[0] - 1.0).abs() < 0.02, "{}", soon.sigma_m[0]);
        assert_eq!(estimate(1.2).range_m, [Some(57.0), None]);
        assert_eq!(estimate(2.0).range_m, [None, None]);
    }

    /// Seen from a rig that moves sideways, near targets move by more than far ones.
    #[test]
    fn of_two_targets_in_a_macropixel_the_nearer_is_expected() {
        let scene = wall_at(60.0);
        let focal_px = scene.lidar_camera(1, 9).focal_px;
        // The near one moves by 0.6 macropixels, the far one by 0.4.
        for (moved_px, near, far) in [(-0.6, 3, 4), (0.6, 5, 4)] {
            let earlier = frames(1, 9, 0.1, |_, pixel| match pixel {
                _ if pixel == near => Some(40.0),
                _ if pixel == far => Some(60.0),
                _ => None,
            });
            let input = GuideInput {
                time_s: 0.1,
                velocity_m_s: DVec3::new(moved_px * 40.0 / focal_px / 0.1, 0.0, 0.0),
                earlier: &earlier,
                ..GuideInput::still(&scene, 1, 9, 0)
            };
            let map = Kalman::default().estimate(&input).unwrap();
            assert!(
                map.range_m[4].is_some_and(|m| (m - 40.0).abs() < 0.5),
                "{:?}",
                map.range_m
            );
            assert_eq!(map.guided(), 1);
        }
    }

    #[test]
    fn without_earlier_frames_nothing_is_known() {
        let scene = wall_at(60.0);
        let map = Kalman::default().estimate(&GuideInput::still(&scene, 4, 4, 0));
        assert_eq!(map.unwrap().guided(), 0);
    }
}
