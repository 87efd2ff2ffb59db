//! Where rays end: the nearest surface along one, and everything that sends light back along it.

use std::ops::Range;

use glam::DVec3;
use smallvec::SmallVec;

use super::bounds::Candidates;
use super::settings::Scene;
use super::shape::{Meeting, Placed, Shape};
use super::vector::Ray;

/// A surface point that a ray meets, and what its material is there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance from the ray's origin, m.
    pub range_m: f64,
    /// Unit vector at right angles to the surface, on the side of the ray's origin.
    pub normal: DVec3,
    /// Lambertian reflectivity at the laser's wavelength, 0 to 1.
    pub reflectivity: f64,
    /// Lambertian reflectivity that the cameras see, 0 to 1.
    pub grey: f64,
    /// How many times more of the laser's light returns than from a Lambertian surface of this reflectivity, 1 or more.
    pub retro: f64,
    /// Index into [`Scene::objects`].
    pub object: usize,
}

/// A surface that sends light back along a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Return {
    /// The surface; its range is the whole way to it, its normal is turned against the light that meets it.
    pub hit: Hit,
    /// Share of the laser's light that is left of the way there and back by panes, 0 to 1.
    pub share: f64,
    /// Share of the surface's own light (sunlight that it reflects) that arrives, 0 to 1.
    pub share_back: f64,
}

/// All that sends light back along a ray, nearest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Returns {
    /// Surfaces; none where there is only sky.
    pub surfaces: SmallVec<[Return; 2]>,
    /// Share of the sky's light that arrives, 0 to 1.
    pub sky_share: f64,
}

/// What is weaker than this share of its light, both ways, is not followed: of 10⁴ signal photons a pulse, more than
/// are modelled, one is left.
const LEAST_SHARE: f64 = 1e-4;

/// Most mirrors that a ray is followed over.
const MOST_MIRRORS: u32 = 2;

impl Scene {
    /// The nearest opaque surface along `ray`, as if panes were not there; `None` for the sky. Of two in the same place
    /// the one listed first in the scene counts.
    pub fn hit(&self, ray: &Ray) -> Option<Hit> {
        Stage::of(self).hit(ray)
    }

    /// All that sends light back along `ray`: panes themselves, what stands behind them, and what they mirror.
    ///
    /// Light goes there and back the same way, so what is left of it is a share of a share. A pane's thickness and the
    /// laser's own mirror image are left out.
    pub fn returns(&self, ray: &Ray) -> Returns {
        let stage = Stage::of(self);
        stage.followed(ray, stage.first_meeting(ray, stage.all()), None)
    }
}

/// A scene made ready for many rays.
#[derive(Debug)]
pub(crate) struct Stage<'a> {
    scene: &'a Scene,
    placed: Vec<Placed<'a>>,
    /// Balls around the objects, for rays that do not come from one place.
    balls: Vec<Option<Ball>>,
    /// Towards the sun.
    sun: Option<DVec3>,
}

/// Where a ray first meets an object, and that object's index.
pub(super) type First = Option<(Meeting, usize)>;

impl<'a> Stage<'a> {
    pub(crate) fn of(scene: &'a Scene) -> Self {
        let shapes = || scene.objects.iter().map(|object| &object.shape);
        Stage {
            scene,
            placed: shapes().map(Shape::placed).collect(),
            balls: shapes()
                .map(|shape| shape.ball_around().map(Ball::from))
                .collect(),
            sun: scene.towards_sun(),
        }
    }

    /// What was made ready.
    pub(crate) fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Unit vector towards the sun, as [`Scene::towards_sun`].
    pub(super) fn sun(&self) -> Option<DVec3> {
        self.sun
    }

    /// As [`Scene::hit`].
    pub(crate) fn hit(&self, ray: &Ray) -> Option<Hit> {
        Some(self.seen_at(ray, self.first_meeting(ray, self.opaque(self.all()))?))
    }

    /// The same, where the ray meets no others than the `candidates`.
    pub(crate) fn hit_of(&self, ray: &Ray, candidates: &Candidates) -> Option<Hit> {
        let candidates = self.opaque(candidates.iter().map(|&n| n as usize));
        Some(self.seen_at(ray, self.first_meeting(ray, candidates)?))
    }

    /// How far it is to that surface, m, without what is there.
    pub(crate) fn range_to_hit(&self, ray: &Ray) -> Option<f64> {
        let (meeting, _) = self.first_meeting(ray, self.opaque(self.all()))?;
        Some(meeting.range_m)
    }

    /// Whether there is such a surface at all.
    pub(super) fn is_blocked(&self, ray: &Ray) -> bool {
        let mut opaque = self.opaque(self.all());
        opaque.any(|n| {
            self.balls[n].is_none_or(|ball| ball.may_be_met(ray))
                && self.placed[n].meet(ray).is_some()
        })
    }

    /// As [`Scene::returns`], where the ray meets no others than the `candidates`.
    pub(crate) fn returns_of(&self, ray: &Ray, candidates: &Candidates) -> Returns {
        self.returns_from(ray, self.meeting_of(ray, candidates), candidates)
    }

    /// The same for a ray that first meets what [`Stage::meeting_of`] says.
    pub(super) fn returns_from(&self, ray: &Ray, first: First, candidates: &Candidates) -> Returns {
        self.followed(ray, first, Some(candidates))
    }

    /// Whether all light that comes back along a ray with this end comes from there.
    pub(super) fn ends_there(&self, first: &First) -> bool {
        first.is_none_or(|(_, object)| self.scene.objects[object].ends_rays())
    }

    fn followed(&self, ray: &Ray, first: First, candidates: Option<&Candidates>) -> Returns {
        let mut returns = Returns {
            surfaces: SmallVec::new(),
            sky_share: 0.0,
        };
        self.follow(ray, first, candidates, (0.0, 1.0), 0, &mut returns);
        let by_range = |a: &Return, b: &Return| a.hit.range_m.total_cmp(&b.hit.range_m);
        returns.surfaces.sort_by(by_range);
        returns
    }

    /// Follows a ray, up to where it first meets something and from there on, that has come `so_far_m` and of whose light `share`
    /// arrives one way; it meets no others than the `candidates`, if they are known.
    fn follow(
        &self,
        ray: &Ray,
        first: First,
        candidates: Option<&Candidates>,
        (so_far_m, share): (f64, f64),
        mirrors: u32,
        returns: &mut Returns,
    ) {
        let Some(mut hit) = first.map(|first| self.seen_at(ray, first)) else {
            returns.sky_share += share;
            return;
        };
        let object = &self.scene.objects[hit.object];
        let point = ray.at(hit.range_m);
        hit.range_m += so_far_m;
        if hit.reflectivity > 0.0 || hit.grey > 0.0 || object.ends_rays() {
            returns.surfaces.push(Return {
                hit,
                share: share * share,
                share_back: share,
            });
        }
        let onwards = |part: f64| Some(share * part).filter(|share| share * share >= LEAST_SHARE);
        if let Some(left) = onwards(object.transmittance) {
            let beyond = Ray {
                origin: point,
                ..*ray
            };
            let next = match candidates {
                Some(candidates) => self.meeting_of(&beyond, candidates),
                None => self.first_meeting(&beyond, self.all()),
            };
            let so_far = (hit.range_m, left);
            self.follow(&beyond, next, candidates, so_far, mirrors, returns);
        }
        if let Some(left) = onwards(object.mirror)
            && mirrors < MOST_MIRRORS
        {
            let thrown_back = ray.direction - hit.normal * (2.0 * ray.direction.dot(hit.normal));
            let reflected = Ray::new(point, thrown_back);
            let next = self.first_meeting(&reflected, self.all());
            let so_far = (hit.range_m, left);
            self.follow(&reflected, next, None, so_far, mirrors + 1, returns);
        }
    }

    fn all(&self) -> Range<usize> {
        0..self.placed.len()
    }

    /// Without panes.
    fn opaque(&self, objects: impl Iterator<Item = usize>) -> impl Iterator<Item = usize> {
        objects.filter(|&n| !self.scene.objects[n].is_pane())
    }

    /// Where a ray meets the first of the `candidates`, panes among them.
    pub(super) fn meeting_of(&self, ray: &Ray, candidates: &Candidates) -> First {
        self.first_meeting(ray, candidates.iter().map(|&n| n as usize))
    }

    /// Where `ray` meets the first of some objects, which are given by their index, rising, and which that is.
    #[inline]
    fn first_meeting(&self, ray: &Ray, objects: impl Iterator<Item = usize>) -> First {
        let mut nearest: First = None;
        for index in objects {
            if let Some(meeting) = self.placed[index].meet(ray)
                && nearest.is_none_or(|(least, _)| meeting.range_m < least.range_m)
            {
                nearest = Some((meeting, index));
            }
        }
        nearest
    }

    /// The surface that `ray` meets there.
    pub(super) fn seen_at(&self, ray: &Ray, (meeting, index): (Meeting, usize)) -> Hit {
        let Meeting { range_m, part } = meeting;
        let (object, placed) = (&self.scene.objects[index], &self.placed[index]);
        let point = ray.at(range_m);
        let normal = placed.normal_at(point, part);
        let (reflectivity, grey) = object.material_at(placed, point, part);
        Hit {
            range_m,
            normal: if normal.dot(ray.direction) > 0.0 {
                -normal
            } else {
                normal
            },
            reflectivity,
            grey,
            retro: object.retro,
            object: index,
        }
    }
}

/// A ball that rays from anywhere may meet.
#[derive(Debug, Clone, Copy)]
struct Ball {
    centre_m: DVec3,
    radius_m: f64,
}

impl From<(DVec3, f64)> for Ball {
    fn from((centre_m, radius_m): (DVec3, f64)) -> Self {
        Ball { centre_m, radius_m }
    }
}

impl Ball {
    /// Whether a ray comes into it, or passes it so closely that rounding could hide it.
    fn may_be_met(&self, ray: &Ray) -> bool {
        let to_centre = self.centre_m - ray.origin;
        let (away_m2, along_m) = (to_centre.length_squared(), to_centre.dot(ray.direction));
        let room_m2 = 1e-6 * self.radius_m * self.radius_m + 1e-9 * away_m2;
        let reach_m2 = self.radius_m * self.radius_m + room_m2;
        away_m2 <= reach_m2 || (along_m > 0.0 && away_m2 - along_m * along_m <= reach_m2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Object, Pattern, Shape, Texture};
    use proptest::prelude::*;

    fn wall(z_m: f64) -> Object {
        let shape = Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, z_m),
            normal: DVec3::new(0.0, 0.0, 1.0),
            width_m: 1e4,
            height_m: 1e4,
        };
        Object::new("wall", 0.4, shape)
    }

    fn scene(objects: Vec<Object>) -> Scene {
        let mut scene = Scene::outdoor();
        scene.objects = objects;
        scene
    }

    fn ahead() -> Ray {
        Ray::new(DVec3::ZERO, DVec3::Z)
    }

    #[test]
    fn the_nearest_surface_hides_the_others() {
        let scene = scene(vec![wall(50.0), wall(20.0)]);
        let hit = scene.hit(&ahead()).unwrap();
        assert_eq!((hit.range_m, hit.object), (20.0, 1));
        let returns = scene.returns(&ahead());
        assert_eq!(returns.surfaces.len(), 1);
        assert_eq!((returns.surfaces[0].hit, returns.sky_share), (hit, 0.0));
    }

    #[test]
    fn cameras_see_what_the_laser_sees_unless_told_otherwise() {
        let mut objects = vec![wall(5.0)];
        let hit = scene(objects.clone()).hit(&ahead()).unwrap();
        assert_eq!((hit.reflectivity, hit.grey, hit.retro), (0.4, 0.4, 1.0));
        objects[0].grey = Some(0.1);
        objects[0].retro = 500.0;
        let hit = scene(objects).hit(&ahead()).unwrap();
        assert_eq!((hit.reflectivity, hit.grey, hit.retro), (0.4, 0.1, 500.0));
    }

    #[test]
    fn nothing_but_sky_returns_nothing() {
        let returns = scene(vec![]).returns(&ahead());
        assert_eq!((returns.surfaces.len(), returns.sky_share), (0, 1.0));
    }

    /// A pane between two walls, at 45 degrees, that throws light to the right.
    fn behind_glass(transmittance: f64, mirror: f64) -> Scene {
        let pane = Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, 5.0),
            normal: DVec3::new(1.0, 0.0, -1.0),
            width_m: 4.0,
            height_m: 4.0,
        };
        let aside = Shape::Plane {
            centre_m: DVec3::new(7.0, 0.0, 5.0),
            normal: DVec3::X,
            width_m: 4.0,
            height_m: 4.0,
        };
        scene(vec![
            Object {
                transmittance,
                mirror,
                ..Object::new("pane", 0.02, pane)
            },
            Object::new("aside", 0.7, aside),
            wall(20.0),
        ])
    }

    #[test]
    fn a_pane_returns_itself_what_stands_behind_it_and_what_it_mirrors() {
        let scene = behind_glass(0.8, 0.1);
        let returns = scene.returns(&ahead());
        let found: Vec<_> = (returns.surfaces.iter())
            .map(|r| (r.hit.object, r.hit.range_m.round(), (r.share * 1e6).round()))
            .collect();
        assert_eq!(found, [(0, 5.0, 1e6), (1, 12.0, 1e4), (2, 20.0, 64e4)]);
        assert!((returns.surfaces[2].share_back - 0.8).abs() < 1e-12);
        assert_eq!(returns.sky_share, 0.0);
        // The guide's opaque surface is behind the pane.
        assert_eq!(scene.hit(&ahead()).unwrap().object, 2);
        // Without a wall there is sky behind it, and a little of it arrives.
        let mut open = behind_glass(0.8, 0.1);
        open.objects.truncate(1);
        let returns = open.returns(&ahead());
        assert_eq!(returns.surfaces.len(), 1);
        assert!((returns.sky_share - 0.9).abs() < 1e-12);
    }

    #[test]
    fn two_mirrors_that_face_each_other_end() {
        let mut scene = behind_glass(0.0, 1.0);
        scene.objects[0].shape = wall(5.0).shape;
        let behind = Object {
            mirror: 1.0,
            ..wall(-5.0)
        };
        scene.objects.push(behind);
        let returns = scene.returns(&ahead());
        assert_eq!(returns.surfaces.len(), 3);
        assert_eq!(returns.surfaces[1].hit.range_m, 15.0);
    }

    #[test]
    fn a_texture_gives_laser_and_cameras_their_own_greys() {
        let mut objects = vec![wall(5.0)];
        objects[0].grey = Some(0.9);
        objects[0].texture = Some(Texture {
            second_grey: Some(0.1),
            ..Texture::new(Pattern::Stripes, 1.0, 0.3)
        });
        let scene = scene(objects);
        let look = |x: f64| {
            let hit = scene.hit(&Ray::new(DVec3::new(x, 0.0, 0.0), DVec3::Z));
            hit.map(|hit| (hit.reflectivity, hit.grey)).unwrap()
        };
        assert_ne!(look(0.5), look(1.5));
        for (reflectivity, grey) in [look(0.5), look(1.5)] {
            assert!([(0.4, 0.9), (0.3, 0.1)].contains(&(reflectivity, grey)));
        }
    }

    proptest! {
        /// No light is made: shares one way sum to what is not lost, at most 1.
        #[test]
        fn panes_pass_no_more_light_than_they_get(transmittance in 0.0f64..1.0, rest in 0.0f64..1.0, x in -0.3f64..0.3) {
            let mirror = (1.0 - transmittance) * rest;
            let scene = behind_glass(transmittance, mirror);
            let returns = scene.returns(&Ray::new(DVec3::ZERO, DVec3::new(x, 0.0, 1.0)));
            let opaque = returns.surfaces.iter().filter(|r| r.hit.object != 0);
            let sum = returns.sky_share + opaque.map(|r| r.share_back).sum::<f64>();
            prop_assert!(sum <= 1.0 + 1e-12);
            prop_assert!(returns.surfaces.is_sorted_by(|a, b| a.hit.range_m <= b.hit.range_m));
        }

        /// The normal says how the range changes with the ray: to first order, neighbouring rays end in the plane at
        /// right angles to it.
        #[test]
        fn normals_are_at_right_angles_to_the_surface(
            x in -0.4f64..0.4, y in -0.4f64..0.4, yaw_deg in -180.0f64..180.0, kind in 0..6,
        ) {
            let centre_m = DVec3::new(0.0, 0.0, 5.0);
            let shape = match kind {
                0 => Shape::Ground { depth_m: 1.0 },
                1 => Shape::Plane { centre_m, normal: DVec3::new(0.3, -0.5, 1.0), width_m: 9.0, height_m: 9.0 },
                2 => Shape::Box { centre_m, size_m: DVec3::new(1.0, 2.0, 3.0), yaw_deg },
                3 => Shape::Sphere { centre_m, radius_m: 1.5 },
                4 => Shape::Cylinder { centre_m, axis: DVec3::new(0.2, -0.5, yaw_deg / 90.0), radius_m: 0.8, height_m: 2.0 },
                _ => Shape::Person { foot_m: DVec3::new(0.0, 1.0, 5.0), height_m: 2.0, yaw_deg },
            };
            let scene = scene(vec![Object::new("it", 0.5, shape)]);
            let ray = |x, y| Ray::new(DVec3::ZERO, DVec3::new(x, y, 1.0));
            let Some(hit) = scene.hit(&ray(x, y)) else { return Ok(()) };
            prop_assert!((hit.normal.length() - 1.0).abs() < 1e-12);
            prop_assert!(hit.normal.dot(ray(x, y).direction) <= 0.0);
            let point = ray(x, y).at(hit.range_m);
            for (dx, dy) in [(1e-6, 0.0), (0.0, 1e-6)] {
                let beside = ray(x + dx, y + dy);
                let Some(next) = scene.hit(&beside) else { continue };
                let same_face = (next.normal - hit.normal).length() < 1e-3;
                // Where a ray grazes, one step is no small one.
                if same_face && hit.normal.dot(ray(x, y).direction) < -0.1 {
                    let along = (beside.at(next.range_m) - point).normalize();
                    prop_assert!(along.dot(hit.normal).abs() < 1e-3, "{along} {}", hit.normal);
                }
            }
        }
    }
}
