//! The right camera as it really stands: where calibration has left it, and how it has moved since (thesis 5.2.1, Fig. 70).

use glam::{DMat3, DVec3};

use crate::scene::{PinholeCamera, Ray, Stereo};

/// The right camera in the lidar's coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct RightCamera {
    /// Where it stands, m.
    pub(super) origin_m: DVec3,
    camera: PinholeCamera,
    to_world: DMat3,
}

impl RightCamera {
    /// The scene's right camera, its errors included.
    pub(super) fn new(stereo: &Stereo) -> Self {
        let mut camera = stereo.camera();
        let share = 1.0 + stereo.focal_error_percent / 100.0;
        camera.focal_px *= share;
        camera.focal_v_px *= share;
        let baseline_m = stereo.baseline_m + stereo.baseline_error_m;
        let [yaw, pitch, roll] = [
            stereo.yaw_error_deg,
            stereo.pitch_error_deg,
            stereo.roll_error_deg,
        ]
        .map(f64::to_radians);
        RightCamera {
            origin_m: stereo.position_m + DVec3::new(baseline_m, 0.0, 0.0),
            camera,
            // y points down: a turn about it takes z to x, a turn about x takes z up, one about z takes x down.
            to_world: turn(1, yaw) * turn(0, pitch) * turn(2, roll),
        }
    }

    /// The pixel coordinates at which it sees a point of the world; `None` outside of its image.
    pub(super) fn sees_at(&self, point_m: DVec3) -> Option<(f64, f64)> {
        let in_camera = self.to_world.transpose() * (point_m - self.origin_m);
        let at = self.camera.project(in_camera)?;
        self.camera.pixel_at(at)?;
        Some(at)
    }

    /// What it sees at pixel coordinates.
    pub(super) fn ray(&self, at: (f64, f64)) -> Ray {
        Ray::new(self.origin_m, self.to_world * self.camera.at_unit_depth(at))
    }
}

/// About x, y or z (0, 1, 2). That of `glam` asks the system's library for sines, whose last digits differ among machines.
fn turn(axis: usize, by_rad: f64) -> DMat3 {
    let (sine, cosine) = libm::sincos(by_rad);
    let [next, last] = [1, 2].map(|more| DVec3::AXES[(axis + more) % 3]);
    let mut columns = DVec3::AXES;
    columns[(axis + 1) % 3] = cosine * next + sine * last;
    columns[(axis + 2) % 3] = cosine * last - sine * next;
    DMat3::from_cols(columns[0], columns[1], columns[2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_point_is_seen_where_its_ray_starts(
            at in (1.0f64..1439.0, 1.0f64..1079.0), range_m in 5.0f64..300.0,
            errors in (-5.0f64..5.0, -5.0f64..5.0, -5.0f64..5.0, -0.1f64..0.1, -5.0f64..5.0),
        ) {
            let stereo = Stereo {
                yaw_error_deg: errors.0, pitch_error_deg: errors.1, roll_error_deg: errors.2,
                baseline_error_m: errors.3, focal_error_percent: errors.4, ..Stereo::default()
            };
            let right = RightCamera::new(&stereo);
            let seen = right.sees_at(right.ray(at).point(range_m)).unwrap();
            prop_assert!((seen.0 - at.0).hypot(seen.1 - at.1) < 1e-6);
        }
    }

    #[test]
    fn errors_move_the_image_the_way_their_names_say() {
        let image_point = |stereo: Stereo| {
            let ahead = DVec3::new(1.0, 0.0, 40.0);
            RightCamera::new(&stereo).sees_at(ahead).unwrap()
        };
        let none = Stereo::default();
        assert_eq!(image_point(none), (720.0, 540.0));
        // Turned outwards, to the right, it sees everything further left.
        assert!(
            image_point(Stereo {
                yaw_error_deg: 0.1,
                ..none
            })
            .0 < 719.0
        );
        assert!(
            image_point(Stereo {
                baseline_error_m: 0.1,
                ..none
            })
            .0 < 719.0
        );
        // Turned up it sees everything further down.
        assert!(
            image_point(Stereo {
                pitch_error_deg: 0.1,
                ..none
            })
            .1 > 541.0
        );
    }
}
