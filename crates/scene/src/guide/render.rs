//! What the two cameras see of a scene: grey images with the noise of a sensor (thesis Table 12).
//!
//! ```text
//!  ray of a pixel ─► surface: grey · daylight ─► fog ─► exposure ─► electrons + shot and read noise ─► 12 bits
//!                    sky
//! ```
//!
//! One ray a pixel, through its middle. Details smaller than a pixel would be chance, another one in each image; so textures of the scene should not be
//! finer, and the grain that plain surfaces are given here (no real surface is without) has none finer than two pixels.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;
use smallvec::SmallVec;

use super::GuideInput;
use super::right_camera::RightCamera;
use crate::numerics::branchless;
use crate::photon::{RandomPurpose, normal, random_stream};
use crate::scene::{Bounds, PinholeCamera, Ray, SKY_REFLECTIVITY, Scene, Stage};
use crate::stereo::GreyImage;

/// Electrons of a pixel that is full, and of its readout noise: Sony's IMX273 holds some 10 000 and reads with some 2.5.
const FULL_WELL_E: f64 = 10_000.0;
const READ_NOISE_E: f64 = 2.5;

/// Electrons per second of a pixel for a white surface in a klux: E·τ/(4N²) on the sensor with the f-number 2.4 of Table 12 and τ = 0.9, 3.45 µm
/// pixels, 4.2·10¹⁵ photons in a lumen second (sunlight, visible), quantum efficiency 0.6 (assumed).
const ELECTRONS_PER_S_KLUX: f64 = 1e3 * 0.9 / (4.0 * 2.4 * 2.4) * 3.45e-6 * 3.45e-6 * 4.2e15 * 0.6;

/// Longest exposure: a frame of 226 frames a second (Table 12).
const LONGEST_EXPOSURE_S: f64 = 1.0 / 226.0;

/// The exposure fills this share of the well with what but a hundredth of the pixels are brighter than.
const EXPOSED_TO: f64 = 0.8;

const BITS: u32 = 12;

/// Pixels of a row that are tried on the same objects. Chosen.
const TOGETHER: usize = 32;

/// Grain of surfaces in pictures that are for people.
const GRAIN_OF_VIEWS: f64 = 0.05;

/// The part of the images that is rendered, in binned pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Crop {
    /// Camera pixels that make one across.
    pub(super) binning: u32,
    /// First column and row.
    pub(super) left: u32,
    pub(super) top: u32,
    /// Columns and rows.
    pub(super) width: u32,
    pub(super) height: u32,
}

impl Crop {
    /// A whole image, unbinned.
    fn whole(rows: u32, cols: u32) -> Self {
        Crop {
            binning: 1,
            left: 0,
            top: 0,
            width: cols,
            height: rows,
        }
    }

    /// The camera's coordinates of the middle of a pixel of the crop.
    pub(super) fn middle(&self, row: usize, col: usize) -> (f64, f64) {
        let along =
            |first: u32, n: usize| (f64::from(first) + n as f64 + 0.5) * f64::from(self.binning);
        (along(self.left, col), along(self.top, row))
    }
}

/// What a camera in the lidar's place sees in its whole view, `rows` × `cols`: a white surface in the scene's daylight would give 1.
pub fn view(scene: &Scene, rows: u32, cols: u32) -> Vec<f32> {
    let camera = scene.lidar_camera(rows, cols);
    let whole = Crop::whole(rows, cols);
    radiances(scene, whole, &camera, GRAIN_OF_VIEWS, |at| {
        Ray::new(DVec3::ZERO, camera.at_unit_depth(at))
    })
}

/// What both cameras see without noise, left and right, and how long they expose.
#[derive(Debug)]
pub(super) struct Radiances {
    /// As of [`radiances`].
    pub(super) images: [Vec<f32>; 2],
    pub(super) exposure_s: f64,
}

impl Radiances {
    fn of_pair(scene: &Scene, crop: Crop, grain: f64) -> Self {
        let camera = scene.stereo.camera();
        let right = RightCamera::new(&scene.stereo);
        let position_m = scene.stereo.position_m;
        let images = [
            radiances(scene, crop, &camera, grain, |at| {
                Ray::new(position_m, camera.at_unit_depth(at))
            }),
            radiances(scene, crop, &camera, grain, |at| right.ray(at)),
        ];
        Radiances {
            exposure_s: exposure_s(scene, &images[0]),
            images,
        }
    }
}

/// Left and right image of the crop.
pub(super) fn pair(input: &GuideInput<'_>, crop: Crop, grain: f64) -> [GreyImage; 2] {
    let scene = input.scene;
    let render = || Radiances::of_pair(scene, crop, grain);
    let seen = match input.views {
        Some(views) => views.radiances(scene, (crop, grain), render),
        None => Arc::new(render()),
    };
    let mut side = 0;
    seen.images.each_ref().map(|radiances| {
        side += 1;
        expose(scene, crop, radiances, seen.exposure_s, input.seed, side)
    })
}

/// What a white surface in the scene's daylight would give as 1, row by row.
fn radiances(
    scene: &Scene,
    crop: Crop,
    camera: &PinholeCamera,
    grain: f64,
    ray: impl Fn((f64, f64)) -> Ray + Sync,
) -> Vec<f32> {
    let pixel_rad = f64::from(crop.binning) / camera.focal_px;
    let has_panes = scene
        .objects
        .iter()
        .any(|o| o.transmittance > 0.0 || o.mirror > 0.0);
    let (width, height) = (crop.width as usize, crop.height as usize);
    let bounds = Bounds::from_scene(scene, ray(crop.middle(0, 0)).origin);
    let stage = Stage::new(scene);
    let radiance = |ray: &Ray, candidates: &_| {
        if !has_panes {
            match stage.hit_of(ray, candidates) {
                Some(hit) => {
                    let seen = surface(&stage, ray.point(hit.range_m), &hit, grain, pixel_rad);
                    seen + air(&stage, hit.range_m)
                }
                None => SKY_REFLECTIVITY,
            }
        } else {
            let returns = stage.returns_of(ray, candidates);
            let surfaces = returns.surfaces.iter();
            let seen = surfaces
                .map(|r| r.share_back * surface(&stage, r.place_m, &r.hit, grain, pixel_rad));
            let ends = returns.ends.iter();
            let air = ends.map(|end| end.share_back * air(&stage, end.range_m));
            seen.sum::<f64>() + air.sum::<f64>()
        }
    };
    let mut seen = vec![0.0; width * height];
    let rows = seen.par_chunks_mut(width.max(1)).enumerate();
    rows.for_each(|(row, radiances)| {
        let groups = radiances.chunks_mut(TOGETHER).enumerate();
        for (group, radiances) in groups {
            let cols = (TOGETHER * group..).take(radiances.len());
            let rays: SmallVec<[Ray; TOGETHER]> =
                cols.map(|col| ray(crop.middle(row, col))).collect();
            let candidates = bounds.of_rays(&rays);
            for (seen, ray) in radiances.iter_mut().zip(&rays) {
                *seen = radiance(ray, &candidates) as f32;
            }
        }
    });
    seen
}

fn surface(
    stage: &Stage,
    point: DVec3,
    hit: &crate::scene::Hit,
    grain: f64,
    pixel_rad: f64,
) -> f64 {
    let scene = stage.scene;
    let mut grey = hit.grey * stage.daylight(point, hit.normal);
    if grain > 0.0 && scene.objects[hit.object].texture.is_none() {
        grey *= (1.0 + grain * grain_at(point, 2.0 * pixel_rad * hit.range_m)).max(0.0);
    }
    let medium = &scene.medium;
    if medium.is_clear() {
        return grey;
    }
    grey * medium.transmission(hit.range_m)
}

/// What the air before a surface, or the sky, adds to it.
fn air(stage: &Stage, until_m: f64) -> f64 {
    stage.scene.medium.airlight(until_m) * SKY_REFLECTIVITY
}

/// Noise of standard deviation 1.1 to 1.2 at a point: clouds of three sizes, each half the one before, of which the smallest is at least `finest_m` and fades
/// as it comes near to that.
fn grain_at(point: DVec3, finest_m: f64) -> f64 {
    let finest = libm::log2(finest_m.max(1e-3));
    let first = finest.floor() as i32;
    let fade = 1.0 - (finest - f64::from(first));
    let octave = |k: i32| cloud(point * power_of_two(-(first + k)), first + k);
    // A cloud has a standard deviation of 0.37; it would be 0.31 if corners were blended evenly.
    (fade * octave(1) + octave(2) + octave(3) + (1.0 - fade) * octave(4)) / (0.31 * 3f64.sqrt())
}

/// 2 to the power of `exponent`, −1022 to 1023.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// Random numbers from −1 to 1 on a grid of 1, smoothly between.
fn cloud(point: DVec3, layer: i32) -> f64 {
    let axes = point.to_array().map(|at| {
        let corner = branchless::floor(at);
        let within = at - corner;
        let smooth = within * within * (3.0 - 2.0 * within);
        let cell = corner as i64;
        [
            (cell as u64, 1.0 - smooth),
            (cell.wrapping_add(1) as u64, smooth),
        ]
    });
    // Corners that share coordinates share the hash so far.
    let mixed = |hash: u64, at: u64| {
        let hash = (hash ^ at).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        hash ^ hash >> 29
    };
    let mut corners = [(layer as u64, 1.0); 8];
    for (axis, ends) in axes.iter().enumerate() {
        for known in 0..1 << axis {
            let (hash, weight) = corners[known];
            for (end, (at, share)) in ends.iter().enumerate() {
                corners[known | end << axis] = (mixed(hash, *at), weight * share);
            }
        }
    }
    let of_corner = |(hash, weight): (u64, f64)| {
        let hash = hash.wrapping_mul(0xbf58_476d_1ce4_e5b9);
        weight * ((hash >> 40) as f64 / f64::from(1 << 23) - 1.0)
    };
    corners.into_iter().map(of_corner).sum()
}

fn exposure_s(scene: &Scene, radiances: &[f32]) -> f64 {
    let mut sorted = radiances.to_vec();
    let rank = sorted.len() * 99 / 100;
    let bright = *sorted.select_nth_unstable_by(rank, f32::total_cmp).1;
    let per_s = f64::from(bright) * scene.light.illuminance_klux * ELECTRONS_PER_S_KLUX;
    (EXPOSED_TO * FULL_WELL_E / per_s).min(LONGEST_EXPOSURE_S)
}

fn expose(
    scene: &Scene,
    crop: Crop,
    radiances: &[f32],
    exposure_s: f64,
    seed: u64,
    side: u32,
) -> GreyImage {
    let binned = f64::from(crop.binning * crop.binning);
    let electrons = scene.light.illuminance_klux * ELECTRONS_PER_S_KLUX * exposure_s * binned;
    let white = f64::from((1u32 << BITS) - 1);
    let width = crop.width as usize;
    let rows = radiances.par_chunks(width).enumerate();
    let pixels: Vec<u16> = rows
        .flat_map_iter(|(row, radiances)| {
            let mut random = random_stream(seed, RandomPurpose::Stereo, row as u32, side);
            radiances.iter().map(move |&radiance| {
                let signal_e = f64::from(radiance) * electrons;
                let noise_e = (signal_e + READ_NOISE_E * READ_NOISE_E * binned).sqrt();
                let share = (signal_e + noise_e * normal(&mut random)) / (FULL_WELL_E * binned);
                (share * white).round().clamp(0.0, white) as u16
            })
        })
        .collect();
    GreyImage::new(width, crop.height as usize, BITS, pixels).expect("held to its bits")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Object, Shape};

    #[test]
    fn a_binned_pixel_lies_in_the_middle_of_its_pixels() {
        let crop = Crop {
            binning: 2,
            left: 3,
            top: 5,
            width: 4,
            height: 4,
        };
        assert_eq!(
            [crop.middle(0, 0), crop.middle(1, 2)],
            [(7.0, 11.0), (11.0, 13.0)]
        );
    }

    /// Photons' noise and what reading adds, in the units of a pixel's number; as full as it gets is white.
    #[test]
    fn a_pixel_counts_its_electrons_with_their_noise_until_it_is_full() {
        const SIDE: u32 = 64;
        let mut scene = Scene::outdoor();
        scene.light.illuminance_klux = 10.0;
        for (binning, share) in [(1, 0.5), (2, 0.02), (1, 0.0), (2, 1.5)] {
            let crop = Crop {
                binning,
                ..Crop::whole(SIDE, SIDE)
            };
            let exposure_s = 1e-3;
            let full_of = FULL_WELL_E / (10.0 * ELECTRONS_PER_S_KLUX * exposure_s);
            let radiances = vec![(share * full_of) as f32; (SIDE * SIDE) as usize];
            let image = expose(&scene, crop, &radiances, exposure_s, 1, 0);
            let pixels: Vec<f64> = image.pixels().iter().map(|&p| f64::from(p)).collect();
            let white = f64::from((1u32 << BITS) - 1);
            let n = pixels.len() as f64;
            let mean = pixels.iter().sum::<f64>() / n;
            if share > 1.0 {
                assert_eq!(mean, white);
                continue;
            }
            let cells = f64::from(binning * binning);
            let noise_e =
                (share * FULL_WELL_E * cells + READ_NOISE_E * READ_NOISE_E * cells).sqrt();
            // Rounding to whole numbers has a variance of 1/12; in the dark the lower half is cut off.
            let sigma = (noise_e / (FULL_WELL_E * cells) * white).hypot(1.0 / 12f64.sqrt());
            if share > 0.0 {
                let found = (pixels.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / n).sqrt();
                assert!(
                    (mean - share * white).abs() < 4.0 * sigma / n.sqrt(),
                    "{share}: {mean}"
                );
                assert!(
                    (found / sigma - 1.0).abs() < 0.05,
                    "{share}: {found} {sigma}"
                );
            }
            assert!(mean < share * white + 4.0 * sigma);
        }
    }

    #[test]
    fn clouds_are_smooth_and_as_strong_as_is_said() {
        let mut squares = [0.0; 3];
        for number in 0..10_000 {
            let coordinate = |n: u32| f64::from(n * 7919 % 10_007) * 0.0371 - 150.0;
            let point = DVec3::new(
                coordinate(number),
                coordinate(number + 3),
                coordinate(number + 7),
            );
            let here = cloud(point, 5);
            assert!(here.abs() <= 1.0);
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                // A blend from -1 to 1 is no steeper than 3.
                assert!((cloud(point + 1e-3 * axis, 5) - here).abs() < 3.1e-3);
            }
            squares[0] += here * here / 10_000.0;
            squares[1] += grain_at(point, 0.2).powi(2) / 10_000.0;
            squares[2] += grain_at(point, 0.25).powi(2) / 10_000.0;
        }
        // A corner has 1/√3; smooth weights of two corners have squares of 26/35 on average, and there are three axes.
        let expected = (26.0f64 / 35.0).powi(3).sqrt() / 3f64.sqrt();
        let [cloud, fading, whole] = squares.map(f64::sqrt);
        assert!((cloud / expected - 1.0).abs() < 0.03, "{cloud}");
        assert!(
            (1.08..1.22).contains(&whole) && (1.0..whole).contains(&fading),
            "{fading} {whole}"
        );
    }

    /// A wall in fog: weaker by what the fog takes, brighter by its airlight; with grain as bright as that says. With a pane that nobody
    /// sees, light goes another way through the code.
    #[test]
    fn a_wall_in_fog_and_with_grain() {
        let mut scene = crate::guide::test_scenes::wall_at(30.0);
        scene.objects[0].texture = None;
        let pane = Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, -50.0),
            normal: DVec3::Z,
            width_m: 1.0,
            height_m: 1.0,
        };
        let behind = Object {
            transmittance: 0.5,
            ..Object::new("pane", 0.1, pane)
        };
        let camera = scene.lidar_camera(4, 6);
        let whole = Crop::whole(4, 6);
        let ray = |at| Ray::new(DVec3::ZERO, camera.at_unit_depth(at));
        for has_pane in [false, true] {
            if has_pane {
                scene.objects.push(behind.clone());
            }
            let seen = |scene: &Scene, grain: f64| radiances(scene, whole, &camera, grain, ray);
            let mut foggy = scene.clone();
            foggy.medium.extinction_1_m = 0.03;
            let [clear, grainy] = [0.0, 0.4].map(|grain| seen(&scene, grain));
            let fog = seen(&foggy, 0.0);
            for pixel in 0..24 {
                let ray = ray(whole.middle(pixel / 6, pixel % 6));
                let hit = scene.hit(&ray).expect("a wall");
                let transmission = libm::exp(-0.03 * hit.range_m);
                let clear = f64::from(clear[pixel]);
                let wanted = clear * transmission + SKY_REFLECTIVITY * (1.0 - transmission);
                assert!(
                    (f64::from(fog[pixel]) / wanted - 1.0).abs() < 1e-5,
                    "{pixel}"
                );
                let grain = grain_at(ray.point(hit.range_m), 2.0 / camera.focal_px * hit.range_m);
                let wanted = clear * (1.0 + 0.4 * grain).max(0.0);
                assert!(
                    (f64::from(grainy[pixel]) - wanted).abs() < 1e-5,
                    "{pixel}: {} {wanted}",
                    grainy[pixel]
                );
            }
            let pictures = [view(&scene, 4, 6), seen(&scene, GRAIN_OF_VIEWS)];
            assert_eq!(pictures[0], pictures[1]);
        }
    }

    #[test]
    fn where_nothing_is_the_sky_is_seen() {
        let mut scene = Scene::outdoor();
        scene.objects.clear();
        let sky = [SKY_REFLECTIVITY as f32; 6];
        assert_eq!(view(&scene, 2, 3), sky);
    }

    /// A mirror of 0.9 at 45 degrees shows a wall on the right, which the sun shines on from the left, straight but 30 degrees up.
    #[test]
    fn a_camera_sees_a_wall_over_a_mirror_in_the_light_it_has_in_its_place() {
        let sheet = |centre_m, normal| Shape::Plane {
            centre_m,
            normal,
            width_m: 2.0,
            height_m: 2.0,
        };
        let at = DVec3::new(0.0, 0.0, 5.0);
        let mut scene = Scene::outdoor();
        scene.lidar.fov_deg = 1.0;
        scene.light.sun_elevation_deg = Some(30.0);
        scene.light.sun_azimuth_deg = -90.0;
        scene.light.sky_share = 0.2;
        let mirror = sheet(at, DVec3::new(1.0, 0.0, -1.0));
        let wall = sheet(at + 7.0 * DVec3::X, DVec3::NEG_X);
        // Where the wall's image is.
        let behind = sheet(at + 7.0 * DVec3::Z, DVec3::Z);
        scene.objects = vec![
            Object {
                mirror: 0.9,
                ..Object::new("mirror", 0.0, mirror)
            },
            Object::new("wall", 0.9, wall),
            Object::new("behind", 0.1, behind),
        ];
        let camera = scene.lidar_camera(4, 4);
        let whole = Crop::whole(4, 4);
        let ray = |at| Ray::new(DVec3::ZERO, camera.at_unit_depth(at));
        let daylight = 0.8 * f64::to_radians(30.0).cos() + 0.2 / 2.0;
        for seen in radiances(&scene, whole, &camera, 0.0, ray) {
            let expected = 0.9 * 0.9 * daylight;
            assert!(
                (f64::from(seen) - expected).abs() < 1e-6,
                "{seen} {expected}"
            );
        }
    }
}
