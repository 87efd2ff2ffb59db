//! What one macropixel sees.
//!
//! Several rays look out of it, more where not all of them end on the same object:
//!
//! ```text
//!   ┌───────────────┐    ┌───────────────┐
//!   │ ·    ·   ·  · │    │· · · ·│x x x x│     16 rays on one surface; 64 where surfaces meet or one is deep: the light of
//!   │   ·   ·    · ·│    │ · · · ·\x x x x│     each is known to a hundredth of the macropixel's, and no two in a row
//!   │·   ·    · ·   │    │· · · · ·│x x x│     or column
//!   │  ·   · ·    · │    │       …       │     Each ray stands for the piece of surface about it, whose slope
//!   └───────────────┘    └───────────────┘     tells how far its ranges are spread.
//! ```
//!
//! A Lambertian surface sends back the cosine of the angle at which the laser meets it.

use glam::DVec3;
use smallvec::SmallVec;

use super::bounce::Bounce;
use super::bounds::{Bounds, Cone};
use super::camera::PinholeCamera;
use super::cast::{End, First, Stage, SurfaceReturn, SurfaceReturns};
use super::medium::Medium;
use super::others_light::OtherLight;
use super::vector::Ray;

/// Rays of a macropixel in a row and in a column.
const RAYS: u32 = 4;

/// The same where surfaces meet: an upright edge is then misplaced by at most 1/128 of the macropixel.
const RAYS_AT_EDGES: u32 = 8;

/// Rays of a macropixel.
const RAYS_OF_ALL: usize = (RAYS * RAYS) as usize;

/// Where within its cell's columns a ray of the n-th row of cells is, and within its rows one of the n-th column from the right: no two rays are in one column or row,
/// so that an upright edge is found by all of them, and rows and columns are not correlated. Were n to count up, they would be, by
/// 0.47 with 16 rays, and the range over a surface that is slanted along a diagonal would vary by half too much.
const PLACES: [u32; RAYS as usize] = [1, 3, 0, 2];

/// The same where surfaces meet. Of the light of planes 10 standard deviations of the pulse deep, towards any side, the brightest instant
/// is right to 1.5 %; to 5 % with a turned square lattice.
const PLACES_AT_EDGES: [u32; RAYS_AT_EDGES as usize] = [2, 6, 4, 0, 7, 3, 1, 5];

/// The range over a ray's piece of surface is taken to change by at most this part of it. Only where a ray grazes a surface is it more.
const MOST_SLOPE: f64 = 0.5;

/// A surface that a macropixel sees: what its rays meet of one object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Index into [`Scene::objects`](crate::scene::Scene::objects).
    pub object: usize,
    /// Mean distance from the lidar, by the light that comes back from it, m.
    pub range_m: f64,
    /// Mean reflectivity, 0 to 1.
    pub reflectivity: f64,
    /// Share of the macropixel's echo that it sends back, 0 to 1.
    pub light_share: f64,
    /// Share of the macropixel's rays that meet it, 0 to 1.
    pub ray_share: f64,
}

/// What one ray sees of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Glimpse {
    pub object: usize,
    reflectivity: f64,
    ray_share: f64,
    pub range_m: f64,
    /// Variance of the range over the ray's piece of the surface.
    pub range_m2: f64,
    /// Reflectivity of a surface that fills the macropixel and is met at a right angle, and sends back as much.
    pub frontal_reflectivity: f64,
}

/// What all rays of a macropixel see.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct View {
    pub glimpses: SmallVec<[Glimpse; 16]>,
    /// Mean reflectivity in sunlight that would give as much light, that of the sky and of fog included.
    pub sunlit_reflectivity: f64,
    /// Where light of the laser ends, m, and its share of all; infinite for the sky.
    pub ends_m: SmallVec<[(f64, f64); 2]>,
    /// Light of other lidars.
    pub others: Vec<OtherLight>,
    /// Laser light by way of other surfaces.
    pub bounced: Vec<Bounce>,
}

impl View {
    /// What a macropixel, by row and column, sees. A surface is deep from `deep_m` on.
    pub(super) fn new(
        stage: &Stage,
        bounds: &Bounds,
        camera: &PinholeCamera,
        pixel: (u32, u32),
        deep_m: f64,
    ) -> Self {
        let candidates = bounds.candidates(cone(camera, pixel));
        let mut few = SmallVec::<[(PixelRay, First); RAYS_OF_ALL]>::new();
        for look in looks(camera, pixel, RAYS) {
            few.push((look, stage.meeting_of(&look.ray, &candidates)));
        }
        let object = |(_, first): &(PixelRay, First)| first.map(|(_, object)| object);
        let mut view = View::default();
        let needs_more = if few.iter().all(|(_, first)| stage.ends_there(first)) {
            // What they end on tells, without a look at what it is made of.
            let range_m =
                |(_, first): &(PixelRay, First)| first.map(|(meeting, _)| meeting.range_m);
            let needs_more = few.iter().any(|ray| object(ray) != object(&few[0]))
                || is_deep(few.iter().filter_map(range_m), deep_m);
            if !needs_more {
                let piece = Piece::new(camera, RAYS);
                for (look, first) in &few {
                    view.see_end(stage, &piece, look, first);
                }
            }
            needs_more
        } else {
            let follow = |(look, first): &(PixelRay, First)| {
                stage.returns_from(&look.ray, *first, &candidates)
            };
            let all: Vec<SurfaceReturns> = few.iter().map(follow).collect();
            let first = |returns: &SurfaceReturns| returns.surfaces.first().map(|s| s.hit.object);
            let nth_m = |n: usize| {
                let nth = all
                    .iter()
                    .filter_map(move |returns| returns.surfaces.get(n));
                nth.map(|surface| surface.hit.range_m)
            };
            let needs_more = all.iter().any(|returns| {
                first(returns) != first(&all[0]) || returns.surfaces.len() != all[0].surfaces.len()
            }) || (0..all[0].surfaces.len()).any(|n| is_deep(nth_m(n), deep_m));
            if !needs_more {
                let piece = Piece::new(camera, RAYS);
                for ((look, _), returns) in few.iter().zip(&all) {
                    view.add_ray(stage, &piece, look, &returns.surfaces, &returns.ends);
                }
            }
            needs_more
        };
        if needs_more {
            let piece = Piece::new(camera, RAYS_AT_EDGES);
            for look in looks(camera, pixel, RAYS_AT_EDGES) {
                let first = stage.meeting_of(&look.ray, &candidates);
                if stage.ends_there(&first) {
                    view.see_end(stage, &piece, &look, &first);
                } else {
                    let returns = stage.returns_from(&look.ray, first, &candidates);
                    view.add_ray(stage, &piece, &look, &returns.surfaces, &returns.ends);
                }
            }
        }
        let is_here = |place_m: DVec3| {
            let at = camera.project(place_m);
            at.and_then(|at| camera.pixel_at(at)) == Some(pixel)
        };
        stage.add_straight(is_here, &mut view.others);
        view
    }

    /// Adds a ray that ends where it first meets something, or in the sky.
    fn see_end(&mut self, stage: &Stage, piece: &Piece, look: &PixelRay, first: &First) {
        let end = |range_m| {
            [End {
                range_m,
                share: 1.0,
                share_back: 1.0,
            }]
        };
        match first {
            None => self.add_ray(stage, piece, look, &[], &end(f64::INFINITY)),
            Some(first) => {
                let hit = stage.seen_at(&look.ray, *first);
                let surface = SurfaceReturn {
                    hit,
                    place_m: look.ray.point(hit.range_m),
                    facing: hit.normal,
                    share: 1.0,
                    share_back: 1.0,
                };
                self.add_ray(stage, piece, look, &[surface], &end(hit.range_m));
            }
        }
    }

    /// Adds a ray with what sends light back along it, nearest first, and where its light ends.
    fn add_ray(
        &mut self,
        stage: &Stage,
        piece: &Piece,
        look: &PixelRay,
        surfaces: &[SurfaceReturn],
        ends: &[End],
    ) {
        let (scene, ray_share) = (stage.scene, piece.ray_share);
        let (medium, sky) = (&scene.medium, scene.light.sky_reflectivity);
        for end in ends {
            // The air before it has its own light.
            let air = medium.airlight(end.range_m);
            self.sunlit_reflectivity += ray_share * end.share_back * air * sky;
            self.end(end.range_m, ray_share * end.share);
        }
        for surface in surfaces {
            let SurfaceReturn {
                hit,
                place_m,
                facing,
                share,
                share_back,
            } = surface;
            let daylight = stage.daylight(*place_m, hit.normal);
            let left = medium.transmission(hit.range_m);
            let seen = left * hit.reflectivity * daylight;
            self.sunlit_reflectivity += ray_share * share_back * seen;
            let reflected = ray_share * share_back * left * hit.reflectivity;
            let place = (*place_m, hit.normal);
            stage.add_others(place, hit.object, reflected, hit.range_m, &mut self.others);
            let (camera, bounced) = (&piece.camera, &mut self.bounced);
            stage.add_bounced(camera, place, reflected, hit.range_m, bounced);
            let cosine = look.ray.direction.dot(*facing).abs();
            self.glimpses.push(Glimpse {
                object: hit.object,
                reflectivity: hit.reflectivity,
                ray_share,
                range_m: hit.range_m,
                range_m2: range_variance(look, *facing, hit.range_m, piece.steps),
                frontal_reflectivity: hit.reflectivity * hit.retro * cosine * share * ray_share,
            });
        }
    }

    /// Notes where a ray ends.
    fn end(&mut self, end_m: f64, ray_share: f64) {
        match self
            .ends_m
            .iter_mut()
            .find(|(other_m, _)| *other_m == end_m)
        {
            Some((_, share)) => *share += ray_share,
            None => self.ends_m.push((end_m, ray_share)),
        }
    }

    /// What is seen of each object through this air, that which sends back most light first.
    pub(super) fn surfaces(&self, medium: &Medium) -> SmallVec<[Surface; 1]> {
        let mut surfaces = SmallVec::<[Surface; 1]>::new();
        let light = self.glimpses.iter().map(|glimpse| {
            let way = medium.transmission(glimpse.range_m).powi(2);
            glimpse.frontal_reflectivity * way / (glimpse.range_m * glimpse.range_m)
        });
        let mut weights: SmallVec<[f64; 64]> = light.collect();
        if weights.iter().sum::<f64>() <= 0.0 {
            // Where nothing sends back any light, rays count alike.
            weights = self.glimpses.iter().map(|g| g.ray_share).collect();
        }
        let all: f64 = weights.iter().sum();
        for (glimpse, weight) in self.glimpses.iter().zip(weights) {
            let same = surfaces.iter().position(|s| s.object == glimpse.object);
            let at = same.unwrap_or_else(|| {
                surfaces.push(Surface {
                    object: glimpse.object,
                    range_m: 0.0,
                    reflectivity: 0.0,
                    light_share: 0.0,
                    ray_share: 0.0,
                });
                surfaces.len() - 1
            });
            let surface = &mut surfaces[at];
            let light = weight / all;
            surface.light_share += light;
            surface.ray_share += glimpse.ray_share;
            surface.range_m += light * glimpse.range_m;
            surface.reflectivity += glimpse.ray_share * glimpse.reflectivity;
        }
        for surface in &mut surfaces {
            surface.reflectivity /= surface.ray_share;
            surface.range_m = if surface.light_share > 0.0 {
                surface.range_m / surface.light_share
            } else {
                self.mean_range_m(surface.object)
            };
        }
        surfaces.sort_by(|a, b| b.light_share.total_cmp(&a.light_share));
        surfaces
    }

    /// The range of an object that sends back no light, all rays alike.
    fn mean_range_m(&self, object: usize) -> f64 {
        let glimpses = || self.glimpses.iter().filter(|g| g.object == object);
        glimpses().map(|g| g.range_m).sum::<f64>() / glimpses().count() as f64
    }
}

/// Whether these ranges are so far apart.
fn is_deep(ranges_m: impl Iterator<Item = f64>, deep_m: f64) -> bool {
    let ends = |(near, far): (f64, f64), range_m: f64| (near.min(range_m), far.max(range_m));
    let (near, far) = ranges_m.fold((f64::INFINITY, f64::NEG_INFINITY), ends);
    far - near > deep_m
}

/// What a macropixel sees.
pub(super) fn cone(camera: &PinholeCamera, (row, col): (u32, u32)) -> Cone {
    let direction = |du: f64, dv: f64| {
        let place = (f64::from(col) + du, f64::from(row) + dv);
        camera.at_unit_depth(place).normalize()
    };
    let corners = [
        direction(0.0, 0.0),
        direction(0.0, 1.0),
        direction(1.0, 0.0),
        direction(1.0, 1.0),
    ];
    Cone::enclosing(direction(0.5, 0.5), corners)
}

/// A ray of a macropixel.
#[derive(Debug, Clone, Copy)]
struct PixelRay {
    ray: Ray,
    /// How far it is along the ray to unit depth.
    to_unit_depth: f64,
}

impl PixelRay {
    fn new(at_unit_depth: DVec3) -> Self {
        PixelRay {
            ray: Ray::new(DVec3::ZERO, at_unit_depth),
            to_unit_depth: at_unit_depth.length(),
        }
    }
}

/// The part of a macropixel that a ray stands for. It is as wide and as high as rays are apart in columns and rows: their own spread is
/// that of the whole macropixel but for as much.
#[derive(Debug, Clone, Copy)]
struct Piece {
    /// The lidar's.
    camera: PinholeCamera,
    ray_share: f64,
    /// Width and height at unit depth.
    steps: [f64; 2],
}

impl Piece {
    fn new(camera: &PinholeCamera, across: u32) -> Self {
        let all = f64::from(across * across);
        Piece {
            camera: *camera,
            ray_share: 1.0 / all,
            steps: [camera.focal_px, camera.focal_v_px].map(|px| 1.0 / (px * all)),
        }
    }
}

/// Rays of a macropixel, `across` of them in a row and in a column.
fn looks(
    camera: &PinholeCamera,
    (row, col): (u32, u32),
    across: u32,
) -> impl Iterator<Item = PixelRay> {
    // Of a power of two, so that nothing is rounded.
    let part = 1.0 / f64::from(across);
    let within = move |n: u32| match across {
        RAYS => PLACES[n as usize],
        _ => PLACES_AT_EDGES[n as usize],
    };
    let place = move |first: u32, n: u32, other: u32| {
        f64::from(first) + (f64::from(n) + (f64::from(other) + 0.5) * part) * part
    };
    (0..across * across).map(move |n| {
        let (x, y) = (n % across, n / across);
        let (u, v) = (
            place(col, x, within(y)),
            place(row, y, within(across - 1 - x)),
        );
        PixelRay::new(camera.at_unit_depth((u, v)))
    })
}

/// Variance of the range over the piece of a plane that a rectangle about a ray covers, `width` × `height` at unit depth.
fn range_variance(look: &PixelRay, normal: DVec3, range_m: f64, [width, height]: [f64; 2]) -> f64 {
    let ray = look.ray.direction;
    let across = |side: DVec3, step: f64| {
        // How the ray turns towards that side, and with it the range to a plane.
        let turn = (side - ray * ray.dot(side)) * (step / look.to_unit_depth);
        let change = turn.dot(normal) / ray.dot(normal);
        // A ray within the plane has none.
        let slope = if change.is_finite() {
            change.abs()
        } else {
            MOST_SLOPE
        };
        range_m * slope.min(MOST_SLOPE)
    };
    (across(DVec3::X, width).powi(2) + across(DVec3::Y, height).powi(2)) / 12.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_of_a_piece_is_that_of_its_rays() {
        let step = 0.004;
        for normal in [
            DVec3::new(0.3, -0.8, -0.2),
            DVec3::new(0.0, -1.0, -0.1),
            -DVec3::Z,
        ] {
            let normal = normal.normalize();
            let direction = DVec3::new(0.05, 0.1, 1.0);
            let range_m = |d: DVec3| 2.0 / -normal.dot(d.normalize());
            let fine = 100;
            let offset = |n: i32| ((f64::from(n) + 0.5) / f64::from(fine) - 0.5) * step;
            let ranges: Vec<f64> = (0..fine * fine)
                .map(|n| direction + DVec3::new(offset(n % fine), offset(n / fine), 0.0))
                .map(range_m)
                .collect();
            let mean = ranges.iter().sum::<f64>() / ranges.len() as f64;
            let exact =
                ranges.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / ranges.len() as f64;
            let found = range_variance(
                &PixelRay::new(direction),
                normal,
                range_m(direction),
                [step; 2],
            );
            assert!((found / exact - 1.0).abs() < 0.01, "{found} {exact}");
        }
    }

    /// Mean and variance of the range to a plane over a macropixel, from its rays and their pieces, beside a grid of 256 × 256 rays.
    #[test]
    fn the_spread_over_a_macropixel_is_that_of_very_many_rays() {
        const FINE: u32 = 256;
        let camera = PinholeCamera::centred(200.0, 1, 1);
        let moments = |ranges: &[(f64, f64)]| {
            let all = ranges.len() as f64;
            let mean = ranges.iter().map(|(range, _)| range).sum::<f64>() / all;
            let squares = ranges
                .iter()
                .map(|(range, own)| (range - mean).powi(2) + own);
            (mean, squares.sum::<f64>() / all)
        };
        for turn_deg in (0..180).step_by(5) {
            let (sine, cosine) = f64::from(turn_deg).to_radians().sin_cos();
            let normal = DVec3::new(0.9 * cosine, 0.9 * sine, -0.44).normalize();
            let range_m = |at: DVec3| 20.0 * normal.z / normal.dot(at.normalize());
            let place = |n: u32| (f64::from(n) + 0.5) / f64::from(FINE);
            let fine = (0..FINE * FINE).map(|n| (place(n % FINE), place(n / FINE)));
            let fine = fine.map(|at| (range_m(camera.at_unit_depth(at)), 0.0));
            let (mean, exact) = moments(&fine.collect::<Vec<_>>());
            for (across, most) in [(RAYS, 0.08), (RAYS_AT_EDGES, 0.02)] {
                let piece = Piece::new(&camera, across);
                let few = looks(&camera, (0, 0), across).map(|look| {
                    let range_m = range_m(look.ray.direction);
                    (range_m, range_variance(&look, normal, range_m, piece.steps))
                });
                let (found_mean, found) = moments(&few.collect::<Vec<_>>());
                let off = (found_mean - mean).abs() / exact.sqrt();
                assert!(off < 2e-3, "{turn_deg}: {found_mean} {mean}");
                let ratio = found / exact;
                assert!(
                    (ratio - 1.0).abs() < most,
                    "{turn_deg}: {ratio} with {across}"
                );
            }
        }
    }
}
