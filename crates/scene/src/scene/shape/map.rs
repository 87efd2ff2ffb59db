//! Depth maps as shapes: what a camera has seen stands in for a scene.
//!
//! ```text
//!   pixel (u, v), depth z ─► a point; between four pixels 1/z is interpolated, which is exact on planes
//!
//!   a ray from the map's own camera sees one pixel      a ray from beside it crosses a row of them:
//!                                                       it ends where it first comes to lie behind a surface
//! ```
//!
//! What no pixel saw is not known. A ray that passes far behind a surface goes on, and where it comes out from behind it
//! already behind the next one, or never comes out, the next one in the picture is taken to reach so far.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::meeting::{Meeting, in_front};
use super::pose::Pose;
use super::surface::Surface;
use crate::files::{InputError, Raster};
use crate::scene::camera::PinholeCamera;
use crate::scene::vector::Ray;

/// Depths of neighbouring pixels that differ by more than this share belong to two surfaces.
const EDGE: f64 = 0.1;

/// Most steps along a ray, a pixel each: more than any picture has in a row.
const MOST_STEPS: f64 = 65_536.0;

/// What a map's files hold and how they are to be read.
#[derive(Debug, Clone, PartialEq)]
pub struct MapFiles {
    /// Depths.
    pub depth: PathBuf,
    /// Reflectivities at the laser's wavelength, white is 1.
    pub reflectivity: Option<PathBuf>,
    /// What cameras see, white is 1.
    pub grey: Option<PathBuf>,
    /// Unit of depth, m; `None` for a metre, which only floats may leave out.
    pub unit_m: Option<f64>,
    /// Whether depths are distances from the camera; otherwise they are along its axis.
    pub is_range: bool,
    /// Focal length of the camera, px.
    pub focal_px: f64,
    /// Principal point of the camera, px; `None` for the middle.
    pub principal_px: Option<(f64, f64)>,
}

/// Where a map's unit is given, and what it is for files that many have.
const DEPTH_UNIT: &str = "depth_unit_m (0.001 for millimetres, 0.00390625 for KITTI's 1/256 m)";

/// A depth map, and what is there.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthMap {
    /// What was read, and how.
    pub(crate) files: MapFiles,
    camera: PinholeCamera,
    /// One over the depth along the axis, 1/m; 0 where nothing is.
    inverse_1_m: Vec<f32>,
    /// Least and greatest of those that are something.
    span_1_m: (f64, f64),
    reflectivity: Option<Raster>,
    grey: Option<Raster>,
}

impl DepthMap {
    /// Reads the files of a map.
    ///
    /// # Errors
    /// As [`Raster::read_map`]; a map without any surface; maps of different shape; reflectivities that are no shares.
    pub(crate) fn read(files: MapFiles) -> Result<Self, InputError> {
        let depth = Raster::read_map(&files.depth, files.unit_m, DEPTH_UNIT)?;
        Self::from_depths(files, depth)
    }

    /// A map whose depths, m, are at hand, 0 where nothing is; `files` says where they will stand, and which others are to be read.
    ///
    /// # Errors
    /// As `DepthMap::read`.
    pub fn from_depths(files: MapFiles, depth: Raster) -> Result<Self, InputError> {
        let (width, height) = (depth.width, depth.height);
        let complaint = |path: &Path, message: String| InputError::new(path.display(), message);
        let complain = |message: String| Err(complaint(&files.depth, message));
        let place = |at: usize| format!("row {}, column {}", at / width, at % width);
        let mut camera = PinholeCamera::centred(files.focal_px, width as u32, height as u32);
        if let Some(principal) = files.principal_px {
            camera.centre = principal;
        }
        let inverse = |(at, &depth): (usize, &f32)| {
            let pixel = ((at % width) as f64 + 0.5, (at / width) as f64 + 0.5);
            let slant = if files.is_range {
                camera.at_unit_depth(pixel).length()
            } else {
                1.0
            };
            match f64::from(depth) / slant {
                z if z > 0.0 && z < 1e6 => (1.0 / z) as f32,
                _ => 0.0,
            }
        };
        let inverse_1_m: Vec<f32> = depth.values.iter().enumerate().map(inverse).collect();
        let something = inverse_1_m.iter().filter(|w| **w > 0.0);
        let span_1_m = something.fold((f64::MAX, 0f64), |(least, most), &w| {
            (least.min(w.into()), most.max(w.into()))
        });
        if span_1_m.1 == 0.0 || !span_1_m.1.is_finite() {
            return complain("has no surface in it; give depths above 0 and below 1000 km".into());
        }
        let shares = |path: &Option<PathBuf>| {
            let Some(path) = path else { return Ok(None) };
            let mut raster = Raster::read(path)?;
            if (raster.width, raster.height) != (width, height) {
                let message = format!(
                    "has {} x {} pixels, and the depth map {width} x {height}; give maps of one shape",
                    raster.width, raster.height
                );
                return Err(complaint(path, message));
            }
            for value in &mut raster.values {
                *value /= raster.white;
            }
            let is_share = |value: &f32| (0.0..=1.0).contains(value);
            match raster.values.iter().position(|value| !is_share(value)) {
                None => Ok(Some(raster)),
                Some(at) => {
                    let (value, place) = (raster.values[at], place(at));
                    let message = format!("has {value} at {place}; give shares from 0 to 1");
                    Err(complaint(path, message))
                }
            }
        };
        Ok(DepthMap {
            camera,
            inverse_1_m,
            span_1_m,
            reflectivity: shares(&files.reflectivity)?,
            grey: shares(&files.grey)?,
            files,
        })
    }

    /// One over the depth at a pixel; 0 outside and where nothing is.
    fn inverse(&self, row: i64, col: i64) -> f64 {
        let (width, height) = (i64::from(self.camera.width), i64::from(self.camera.height));
        let inside = (0..height).contains(&row) && (0..width).contains(&col);
        if !inside {
            return 0.0;
        }
        f64::from(self.inverse_1_m[(row * width + col) as usize])
    }

    /// One over the depth at pixel coordinates: between four pixels of one surface, or else the nearest's.
    fn inverse_at(&self, (u, v): (f64, f64)) -> f64 {
        let (x, y) = (u - 0.5, v - 0.5);
        let (col, row) = (x.floor(), y.floor());
        let (right, down) = (x - col, y - row);
        let (col, row) = (col as i64, row as i64);
        let corners = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(r, c)| self.inverse(row + r, col + c));
        let [a, b, c, d] = corners;
        let least = corners.into_iter().fold(f64::MAX, f64::min);
        let most = corners.into_iter().fold(0.0, f64::max);
        if least > 0.0 && most <= least * (1.0 + EDGE) {
            let (above, below) = (a + (b - a) * right, c + (d - c) * right);
            above + (below - above) * down
        } else {
            self.inverse(v.floor() as i64, u.floor() as i64)
        }
    }

    /// Where a ray in the camera's coordinates first meets the map.
    fn intersect(&self, ray: &Ray) -> Option<Meeting> {
        let (origin, direction) = (ray.origin, ray.direction);
        if direction.z <= 0.0 {
            return None;
        }
        let slope = direction / direction.z;
        // The point of the ray at depth 1/w, in pixel coordinates: a straight line in w.
        let start = origin - slope * origin.z;
        let pixel = |w: f64| {
            let seen = slope + start * w;
            let (u, v) = (
                seen.x * self.camera.focal_px,
                seen.y * self.camera.focal_v_px,
            );
            (u + self.camera.centre.0, v + self.camera.centre.1)
        };
        let meeting = |w: f64| {
            let range_m = (1.0 / w - origin.z) / direction.z;
            in_front(range_m).map(|range_m| Meeting { range_m, part: 0 })
        };
        if start.length() < 1e-9 {
            return Some(self.inverse_at(pixel(0.0)))
                .filter(|w| *w > 0.0)
                .and_then(meeting);
        }
        let (far, near) = (self.span_1_m.0 * 0.99, self.span_1_m.1 * 1.01);
        let near = if origin.z > 0.0 {
            near.min(1.0 / origin.z)
        } else {
            near
        };
        let (from, to) = (pixel(near), pixel(far));
        let steps = (from.0 - to.0).abs().max((from.1 - to.1).abs());
        if !steps.is_finite() || near <= far {
            return None;
        }
        let steps = (steps.ceil() + 1.0).min(MOST_STEPS);
        // How far behind the map's surface a point lies, as a share of its depth; nothing is behind what is not there.
        let behind = |w: f64| match self.inverse_at(pixel(w)) {
            0.0 => f64::NEG_INFINITY,
            there => there / w - 1.0,
        };
        let (mut before, mut hidden_by) = (near, None);
        for step in 0..=steps as u32 {
            let w = near + (far - near) * f64::from(step) / steps;
            let there = self.inverse_at(pixel(w));
            match (behind(w), hidden_by) {
                (gap, _) if gap < 0.0 => hidden_by = None,
                // It came out from behind one surface and is within or behind the next one already.
                (_, Some(last)) if there * (1.0 + EDGE) < last => return meeting(there),
                (_, Some(_)) => hidden_by = Some(there),
                (_, None) => {
                    let crossed = cross(before, w, behind);
                    if behind(crossed) <= EDGE {
                        return meeting(crossed);
                    }
                    hidden_by = Some(there);
                }
            }
            before = w;
        }
        // Still behind a surface where the map ends in depth: the first farther surface beside it is behind it, too.
        let (last, width) = (hidden_by?, self.camera.width.max(self.camera.height));
        let beside = (1..=width).map(|step| far + (far - near) * f64::from(step) / steps);
        let mut theres = beside.map(|w| self.inverse_at(pixel(w)));
        let farther = theres.find(|there| there * (1.0 + EDGE) < last)?;
        Some(farther).filter(|there| *there > 0.0).and_then(meeting)
    }

    fn pixel_of(&self, point: DVec3) -> Option<(f64, f64)> {
        self.camera.project(point)
    }

    /// The normal at a point of the surface: the plane in which 1/z of the pixels about it lies.
    fn normal_at(&self, point: DVec3) -> DVec3 {
        let Some((u, v)) = self.pixel_of(point) else {
            return DVec3::Z;
        };
        let w = 1.0 / point.z;
        let (row, col) = (v.floor() as i64, u.floor() as i64);
        let here = self.inverse(row, col);
        let slope = |next: f64, last: f64| {
            let is_same = |other: f64| other > 0.0 && (other / here - 1.0).abs() <= EDGE;
            match (is_same(next), is_same(last)) {
                (true, true) => (next - last) / 2.0,
                (true, false) => next - here,
                (false, true) => here - last,
                (false, false) => 0.0,
            }
        };
        let right = slope(self.inverse(row, col + 1), self.inverse(row, col - 1));
        let down = slope(self.inverse(row + 1, col), self.inverse(row - 1, col));
        let along = w - right * (u - self.camera.centre.0) - down * (v - self.camera.centre.1);
        DVec3::new(
            right * self.camera.focal_px,
            down * self.camera.focal_v_px,
            along,
        )
        .normalize()
    }

    /// Reflectivity and grey at a point of the surface, where files give them.
    fn material_at(&self, point: DVec3) -> (Option<f64>, Option<f64>) {
        let pixel = self.pixel_of(point).and_then(|at| self.camera.pixel_at(at));
        let value = |raster: &Option<Raster>| {
            let ((row, col), raster) = (pixel?, raster.as_ref()?);
            Some(f64::from(raster.value(row as usize, col as usize)))
        };
        (value(&self.reflectivity), value(&self.grey))
    }
}

/// A map with the place and the turn of its camera.
#[derive(Debug)]
pub(in crate::scene) struct PlacedMap<'a> {
    pose: Pose,
    map: &'a DepthMap,
}

impl<'a> PlacedMap<'a> {
    pub(super) fn new(centre_m: DVec3, yaw_deg: f64, map: &'a DepthMap) -> Self {
        PlacedMap {
            pose: Pose::new(centre_m, yaw_deg),
            map,
        }
    }
}

impl Surface for PlacedMap<'_> {
    fn intersect(&self, ray: &Ray) -> Option<Meeting> {
        self.map.intersect(&self.pose.inwards(ray))
    }

    fn normal_at(&self, point: DVec3, _part: u32) -> DVec3 {
        self.pose
            .outwards(self.map.normal_at(self.pose.inside(point)))
    }

    fn on_surface(&self, point: DVec3, _part: u32, _seen_turned_deg: f64) -> (f64, f64) {
        let inside = self.pose.inside(point);
        (inside.x, inside.y)
    }

    fn own_material(&self, point: DVec3) -> (Option<f64>, Option<f64>) {
        self.map.material_at(self.pose.inside(point))
    }
}

/// Where a ray comes to lie behind the surface, between one over a depth before it and one behind it.
fn cross(before: f64, after: f64, behind: impl Fn(f64) -> f64) -> f64 {
    let (mut before, mut after) = (before, after);
    for _ in 0..40 {
        let middle = (before + after) / 2.0;
        if behind(middle) < 0.0 {
            before = middle;
        } else {
            after = middle;
        }
    }
    after
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Shape;
    use proptest::prelude::*;

    fn pfm(width: usize, values: &[f32]) -> Vec<u8> {
        let rows = values.chunks_exact(width).rev().flatten();
        let text = format!("Pf\n{width} {}\n-1\n", values.len() / width);
        [
            text.into_bytes(),
            rows.flat_map(|v| v.to_le_bytes()).collect(),
        ]
        .concat()
    }

    /// Reads depths (and reflectivities) of 40 columns.
    fn read(
        depth: &[f32],
        reflectivity: Option<(usize, &[f32])>,
        is_range: bool,
    ) -> Result<DepthMap, InputError> {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        std::fs::write(path("z.pfm"), pfm(40, depth)).unwrap();
        if let Some((width, values)) = reflectivity {
            std::fs::write(path("r.pfm"), pfm(width, values)).unwrap();
        }
        DepthMap::read(MapFiles {
            depth: path("z.pfm"),
            reflectivity: reflectivity.map(|_| path("r.pfm")),
            grey: None,
            unit_m: None,
            is_range,
            focal_px: 50.0,
            principal_px: None,
        })
    }

    const CAMERA: fn() -> PinholeCamera = || PinholeCamera::centred(50.0, 40, 30);

    /// What a camera sees of some shapes, along its axis.
    fn camera_depths(shapes: &[Shape], is_range: bool) -> Vec<f32> {
        let pixel = |at: usize| ((at % 40) as f64 + 0.5, (at / 40) as f64 + 0.5);
        let depth = |at: usize| {
            let ray = Ray::new(DVec3::ZERO, CAMERA().at_unit_depth(pixel(at)));
            let nearest = shapes
                .iter()
                .filter_map(|s| s.intersect(&ray))
                .reduce(f64::min);
            let along = if is_range { 1.0 } else { ray.direction.z };
            nearest.map_or(0.0, |range_m| (range_m * along) as f32)
        };
        (0..1200).map(depth).collect()
    }

    fn wall(z_m: f64, width_m: f64, tilt: f64) -> Shape {
        Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, z_m),
            normal: DVec3::new(tilt, 0.3 * tilt, -1.0),
            width_m,
            height_m: 1e3,
        }
    }

    #[test]
    fn broken_maps_are_refused() {
        let fine = vec![5.0; 1200];
        let with = |value: f32| {
            let mut depth = fine.clone();
            depth[45] = value;
            read(&depth, None, false)
        };
        for none in [0.0, f32::INFINITY, f32::NAN] {
            assert_eq!(with(none).unwrap().inverse(1, 5), 0.0);
        }
        for (read, says) in [
            (with(-1.0), "-1 at row 1, column 5"),
            (read(&[0.0; 1200], None, false), "no surface"),
            (
                read(&fine, Some((20, &[0.5; 200])), false),
                "has 20 x 10 pixels, and the depth map 40 x 30",
            ),
            (
                read(&fine, Some((40, &[1.5; 1200])), false),
                "has 1.5 at row 0, column 0",
            ),
            (
                read(&fine, Some((40, &[f32::NAN; 1200])), false),
                "has NaN at row 0, column 0",
            ),
        ] {
            let error = read.unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }

    #[test]
    fn reflectivity_is_that_of_the_pixel() {
        let shares: Vec<f32> = (0..1200).map(|at| (at % 40) as f32 / 40.0).collect();
        let map = read(&[5.0; 1200], Some((40, &shares)), false).unwrap();
        let point = CAMERA().at_unit_depth((7.3, 12.9)) * 5.0;
        let (reflectivity, grey) = map.material_at(point);
        assert!((reflectivity.unwrap() - 7.0 / 40.0).abs() < 1e-6 && grey.is_none());
    }

    /// A near board before a far wall, seen from beside: both where they are, and what the first camera did not see of the
    /// wall is filled with it.
    #[test]
    fn from_beside_near_things_move_before_far_ones() {
        let shapes = [wall(4.0, 1.0, 0.0), wall(20.0, 1e3, 0.0)];
        let map = read(&camera_depths(&shapes, false), None, false).unwrap();
        let origin = DVec3::new(0.5, 0.0, 0.0);
        let mut ends = (0, 0);
        for column in 0..40 {
            let ray = Ray::new(
                origin,
                CAMERA().at_unit_depth((f64::from(column) + 0.5, 15.2)),
            );
            let expected = shapes
                .iter()
                .filter_map(|s| s.intersect(&ray))
                .reduce(f64::min)
                .unwrap();
            let Some(Meeting { range_m, .. }) = map.intersect(&ray) else {
                continue; // Beyond the map's edge.
            };
            ends.0 += u32::from((range_m - expected).abs() < 1e-3);
            ends.1 += 1;
        }
        // The board's two edges fall within pixels.
        assert!(ends.1 >= 36 && ends.0 >= ends.1 - 2, "{ends:?}");
    }

    proptest! {
        /// A plane comes back exact, range and normal, from the camera's place and from beside it.
        #[test]
        fn planes_come_back(tilt in -0.8f64..0.8, z_m in 3.0f64..60.0, u in 8.0f64..32.0, v in 8.0f64..22.0, beside in -0.3f64..0.3, is_range: bool) {
            let plane = wall(z_m, 1e4, tilt);
            let map = read(&camera_depths(std::slice::from_ref(&plane), is_range), None, is_range).unwrap();
            for origin in [DVec3::ZERO, DVec3::new(beside, 0.3 * beside, -0.1)] {
                let ray = Ray::new(origin, CAMERA().at_unit_depth((u, v)));
                let expected = plane.intersect(&ray).unwrap();
                let Meeting { range_m, .. } = map.intersect(&ray).unwrap();
                prop_assert!((range_m / expected - 1.0).abs() < 1e-5, "{range_m} {expected}");
                let normal = map.normal_at(ray.point(range_m));
                prop_assert!(normal.dot(plane.placed().normal_at(DVec3::ZERO, 0)).abs() > 1.0 - 1e-4);
            }
        }
    }
}
