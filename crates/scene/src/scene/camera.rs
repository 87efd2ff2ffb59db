//! The pinhole camera: pixels to rays and world points to pixels (the K matrices of thesis 6.3.3,
//! Equations 30 to 32).
//!
//! Pixel coordinates are continuous: pixel number i covers [i, i + 1) and has its centre at
//! i + 0.5. With focal lengths f_u in pixel widths and f_v in pixel heights and principal point (u₀, v₀), K is
//! `[f_u 0 u₀; 0 f_v v₀; 0 0 1]`. The camera looks along +z from the origin of its own coordinates.

use glam::DVec3;

/// A camera without distortion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PinholeCamera {
    /// Focal length in widths of a pixel (f_u).
    pub focal_px: f64,
    /// Focal length in heights of a pixel (f_v).
    pub focal_v_px: f64,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Principal point (u₀, v₀), px.
    pub centre: (f64, f64),
}

impl PinholeCamera {
    /// A camera with square pixels whose principal point is the middle of its image.
    pub fn centred(focal_px: f64, width: u32, height: u32) -> Self {
        PinholeCamera {
            focal_px,
            focal_v_px: focal_px,
            width,
            height,
            centre: (f64::from(width) / 2.0, f64::from(height) / 2.0),
        }
    }

    /// A centred camera with square pixels that sees `fov_deg` degrees (0 to 180, exclusive) from its left to its
    /// right edge.
    pub(crate) fn with_horizontal_fov(fov_deg: f64, width: u32, height: u32) -> Self {
        let half_width = f64::from(width) / 2.0;
        let focal_px = half_width / libm::tan(fov_deg.to_radians() / 2.0);
        Self::centred(focal_px, width, height)
    }

    /// This camera with pixels that are `aspect` (> 0) times as high as wide.
    #[must_use]
    pub(crate) fn with_pixel_aspect(self, aspect: f64) -> Self {
        PinholeCamera {
            focal_v_px: self.focal_px / aspect,
            ..self
        }
    }

    /// The world point at depth z = 1 that pixel coordinates (u, v) see: K⁻¹·(u, v, 1), Eq. 30.
    pub fn at_unit_depth(&self, (u, v): (f64, f64)) -> DVec3 {
        DVec3::new(
            (u - self.centre.0) / self.focal_px,
            (v - self.centre.1) / self.focal_v_px,
            1.0,
        )
    }

    /// The direction, of length 1, that the centre of the pixel in a row and column sees.
    pub fn direction(&self, (row, col): (usize, usize)) -> DVec3 {
        let middle = (col as f64 + 0.5, row as f64 + 0.5);
        self.at_unit_depth(middle).normalize()
    }

    /// The pixel coordinates of a world point, Eq. 32 (with R = 1, T = 0), whether inside the
    /// image or not. `None` for points that are not in front of the camera.
    pub(crate) fn project(&self, point: DVec3) -> Option<(f64, f64)> {
        (point.z > 0.0).then(|| {
            (
                self.focal_px * point.x / point.z + self.centre.0,
                self.focal_v_px * point.y / point.z + self.centre.1,
            )
        })
    }

    /// The (row, column) of the pixel that pixel coordinates fall on; `None` outside the image.
    pub(crate) fn pixel_at(&self, (u, v): (f64, f64)) -> Option<(u32, u32)> {
        let inside =
            (0.0..f64::from(self.width)).contains(&u) && (0.0..f64::from(self.height)).contains(&v);
        inside.then_some((v as u32, u as u32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_field_of_view_ends_at_the_image_edges() {
        let camera = PinholeCamera::with_horizontal_fov(90.0, 64, 32);
        let edge = camera.at_unit_depth((64.0, 16.0));
        assert!((edge.x - 1.0).abs() < 1e-12 && edge.y.abs() < 1e-12);
    }

    #[test]
    fn the_thesis_camera_sees_23_by_18_degrees() {
        let camera = PinholeCamera::centred(12e-3 / 3.45e-6, 1440, 1080);
        let corner = camera.at_unit_depth((1440.0, 1080.0));
        assert!((2.0 * corner.x.atan().to_degrees() - 23.4).abs() < 0.1);
        assert!((2.0 * corner.y.atan().to_degrees() - 17.7).abs() < 0.1);
    }

    #[test]
    fn nothing_behind_the_camera_is_seen() {
        let camera = PinholeCamera::centred(100.0, 64, 64);
        assert_eq!(camera.project(DVec3::new(0.0, 0.0, -1.0)), None);
        assert_eq!(camera.project(DVec3::ZERO), None);
        assert_eq!(camera.pixel_at((-0.1, 3.0)), None);
        assert_eq!(camera.pixel_at((64.0, 3.0)), None);
        assert_eq!(camera.pixel_at((63.9, 3.2)), Some((3, 63)));
    }

    #[test]
    fn hslidar_sees_16_by_4_degrees() {
        // Macropixels of 114 um x 54 um behind 25 mm (thesis 6.3.1).
        let camera = PinholeCamera::centred(25e-3 / 114e-6, 64, 32).with_pixel_aspect(54.0 / 114.0);
        let corner = camera.at_unit_depth((64.0, 32.0));
        let (h, v) = (corner.x.atan(), corner.y.atan());
        assert!((2.0 * h.to_degrees() - 16.6).abs() < 0.05, "{h}");
        assert!((2.0 * v.to_degrees() - 3.96).abs() < 0.01, "{v}");
    }

    proptest! {
        #[test]
        fn projection_undoes_the_ray(
            u in 0.0f64..1440.0,
            v in 0.0f64..1080.0,
            z in 0.1f64..500.0,
            aspect in 0.1f64..10.0,
        ) {
            let camera = PinholeCamera::centred(3478.0, 1440, 1080).with_pixel_aspect(aspect);
            let (u2, v2) = camera.project(camera.at_unit_depth((u, v)) * z).unwrap();
            prop_assert!((u - u2).abs() < 1e-9 && (v - v2).abs() < 1e-9);
        }
    }
}
