//! Where rays end: the nearest surface along one, and everything that sends light back along it.

use std::ops::Range;

use glam::DVec3;
use smallvec::SmallVec;

use super::bounds::Candidates;
use super::bundle::{Bundle, reflected};
use super::settings::Scene;
use super::shape::{Meeting, PlacedShape, Shape, Surface};
use super::vector::Ray;

#[cfg(test)]
mod tests;

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
pub(crate) struct SurfaceReturn {
    /// The surface; its range is the whole way to it, its normal is turned against the light that meets it.
    pub hit: Hit,
    /// Where the ray meets it, m: over a mirror not on the ray's own line.
    pub place_m: DVec3,
    /// Its normal as the ray's origin sees it, in the mirror's image: minus its product with the ray's direction is the cosine at which
    /// light meets the surface, and as the ray turns, the range changes as that of a plane at right angles to it. Its length
    /// is 1, but not over curved mirrors.
    pub facing: DVec3,
    /// Share of the laser's light that is left of the way there and back by panes and mirrors, 0 to 1. A curved mirror spreads the
    /// light that it throws; what one gathers counts as if it were plane.
    pub share: f64,
    /// Share of the surface's own light (sunlight that it reflects) that arrives, 0 to 1.
    pub share_back: f64,
}

/// Where some of a ray's light goes no further: a surface that is met, or the sky.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct End {
    /// The whole way to it, m; infinite for the sky.
    pub range_m: f64,
    /// Share of the laser's light, there and back, that fog sends back before it and no longer behind it, 0 to 1.
    pub share: f64,
    /// The same share of light that comes back only: of daylight in the air.
    pub share_back: f64,
}

/// All that sends light back along a ray, nearest first.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SurfaceReturns {
    /// Surfaces; none where there is only sky.
    pub surfaces: SmallVec<[SurfaceReturn; 2]>,
    /// Where light ends; each of its shares is 1 in all.
    pub ends: SmallVec<[End; 2]>,
    /// Share of the sky's light that arrives, 0 to 1.
    pub sky_share: f64,
}

/// What is weaker than this share of its light, both ways, is not followed, where a Lambertian surface may send it back: of 10⁴ signal
/// photons a pulse one is left. Where retroreflectors send back more, weaker light is followed by as much.
const LEAST_SHARE: f64 = 1e-4;

/// Most mirrors that a ray is followed over.
const MOST_MIRRORS: u32 = 2;

impl Scene {
    /// The nearest opaque surface along `ray`, as if panes were not there; `None` for the sky. Of two in the same place
    /// the one listed first in the scene counts.
    pub fn hit(&self, ray: &Ray) -> Option<Hit> {
        Stage::new(self).hit(ray)
    }

    /// All that sends light back along `ray`: panes themselves, what stands behind them, and what they mirror.
    ///
    /// Light goes there and back the same way, so what is left of it is a share of a share: a plane mirror shows what stands before
    /// it as far behind it. A pane's thickness, and light that goes one way over a mirror and the other past it, are left out.
    #[cfg(test)]
    pub(crate) fn returns(&self, ray: &Ray) -> SurfaceReturns {
        let stage = Stage::new(self);
        stage.followed(ray, stage.first_meeting(ray, stage.all()), None)
    }
}

/// A scene made ready for many rays.
#[derive(Debug)]
pub struct Stage<'a> {
    /// What was made ready.
    pub(crate) scene: &'a Scene,
    placed: Vec<PlacedShape<'a>>,
    /// Balls around the objects, for rays that do not come from one place.
    balls: Vec<Option<(DVec3, f64)>>,
    /// Towards the sun.
    pub(super) sun: Option<DVec3>,
    /// What is weaker than this share of its light, both ways, is not followed.
    least_share: f64,
}

/// How far light has come along a ray.
#[derive(Debug, Clone, Copy)]
struct RayProgress {
    so_far_m: f64,
    /// Share of it that arrives one way.
    share: f64,
    mirrors: u32,
    /// Rays about it; `None` before the first mirror, where they only spread.
    bundle: Option<Bundle>,
}

impl Default for RayProgress {
    fn default() -> Self {
        RayProgress {
            so_far_m: 0.0,
            share: 1.0,
            mirrors: 0,
            bundle: None,
        }
    }
}

/// Where a ray first meets an object, and that object's index.
pub(super) type First = Option<(Meeting, usize)>;

impl<'a> Stage<'a> {
    pub fn new(scene: &'a Scene) -> Self {
        let shapes = || scene.objects.iter().map(|object| &object.shape);
        let retro = scene.objects.iter().map(|object| object.retro);
        Stage {
            scene,
            placed: shapes().map(Shape::placed).collect(),
            balls: shapes().map(Shape::ball_around).collect(),
            sun: scene.towards_sun(),
            least_share: LEAST_SHARE / retro.fold(1.0, f64::max),
        }
    }

    /// As [`Scene::hit`].
    pub fn hit(&self, ray: &Ray) -> Option<Hit> {
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
            self.balls[n].is_none_or(|ball| may_be_met(ball, ray))
                && self.placed[n].intersect(ray).is_some()
        })
    }

    /// As [`Scene::returns`], where the ray meets no others than the `candidates`.
    pub(crate) fn returns_of(&self, ray: &Ray, candidates: &Candidates) -> SurfaceReturns {
        self.returns_from(ray, self.meeting_of(ray, candidates), candidates)
    }

    /// The same for a ray that first meets what [`Stage::meeting_of`] says.
    pub(super) fn returns_from(
        &self,
        ray: &Ray,
        first: First,
        candidates: &Candidates,
    ) -> SurfaceReturns {
        self.followed(ray, first, Some(candidates))
    }

    /// Whether all light that comes back along a ray with this end comes from there.
    pub(super) fn ends_there(&self, first: &First) -> bool {
        first.is_none_or(|(_, object)| self.scene.objects[object].ends_rays())
    }

    fn followed(&self, ray: &Ray, first: First, candidates: Option<&Candidates>) -> SurfaceReturns {
        let mut returns = SurfaceReturns {
            surfaces: SmallVec::new(),
            ends: SmallVec::new(),
            sky_share: 0.0,
        };
        self.follow(ray, first, candidates, RayProgress::default(), &mut returns);
        let by_range =
            |a: &SurfaceReturn, b: &SurfaceReturn| a.hit.range_m.total_cmp(&b.hit.range_m);
        returns.surfaces.sort_by(by_range);
        returns
    }

    /// Follows a ray, up to where it first meets something and from there on; it meets no others than the `candidates`, if
    /// they are known.
    fn follow(
        &self,
        ray: &Ray,
        first: First,
        candidates: Option<&Candidates>,
        way: RayProgress,
        returns: &mut SurfaceReturns,
    ) {
        let RayProgress {
            so_far_m, share, ..
        } = way;
        let Some((meeting, index)) = first else {
            returns.sky_share += share;
            returns.ends.push(End {
                range_m: f64::INFINITY,
                share: share * share,
                share_back: share,
            });
            return;
        };
        let mut hit = self.seen_at(ray, (meeting, index));
        let object = &self.scene.objects[index];
        let point = ray.point(hit.range_m);
        let bundle = way.bundle.map(|bundle| bundle.advanced(hit.range_m));
        hit.range_m += so_far_m;
        if hit.reflectivity > 0.0 || hit.grey > 0.0 || object.ends_rays() {
            let (facing, kept) = match &bundle {
                None => (hit.normal, 1.0),
                Some(bundle) => bundle.facing_and_share(ray.direction, hit.normal, hit.range_m),
            };
            returns.surfaces.push(SurfaceReturn {
                hit,
                place_m: point,
                facing,
                share: share * share * kept,
                share_back: share,
            });
        }
        let so_far_m = hit.range_m;
        let onwards =
            |part: f64| Some(share * part).filter(|share| share * share >= self.least_share);
        let passed = onwards(object.transmittance);
        let thrown = onwards(object.mirror).filter(|_| way.mirrors < MOST_MIRRORS);
        let [passed_on, thrown_on] = [passed, thrown].map(|share| share.unwrap_or(0.0));
        returns.ends.push(End {
            range_m: so_far_m,
            share: share * share - passed_on * passed_on - thrown_on * thrown_on,
            share_back: share - passed_on - thrown_on,
        });
        if let Some(share) = passed {
            let beyond = Ray {
                origin: point,
                ..*ray
            };
            let next = match candidates {
                Some(candidates) => self.meeting_of(&beyond, candidates),
                None => self.first_meeting(&beyond, self.all()),
            };
            let onwards = RayProgress {
                so_far_m,
                share,
                bundle,
                ..way
            };
            self.follow(&beyond, next, candidates, onwards, returns);
        }
        if let Some(share) = thrown {
            let reflected = Ray::new(point, reflected(ray.direction, hit.normal));
            let bundle = bundle.unwrap_or_else(|| Bundle::new(ray.direction).advanced(so_far_m));
            let placed = &self.placed[index];
            let outward = placed.normal_at(point, meeting.part);
            let bend = |step_m| placed.bend(point, meeting.part, step_m);
            let back = RayProgress {
                so_far_m,
                share,
                mirrors: way.mirrors + 1,
                bundle: Some(bundle.thrown_back(ray.direction, outward, bend)),
            };
            let next = self.first_meeting(&reflected, self.all());
            self.follow(&reflected, next, None, back, returns);
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
            if let Some(meeting) = self.placed[index].intersect(ray)
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
        let point = ray.point(range_m);
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

/// Whether a ray comes into a ball, or passes it so closely that rounding could hide it.
fn may_be_met((centre_m, radius_m): (DVec3, f64), ray: &Ray) -> bool {
    let to_centre = centre_m - ray.origin;
    let (away_m2, along_m) = (to_centre.length_squared(), to_centre.dot(ray.direction));
    let room_m2 = 1e-6 * radius_m * radius_m + 1e-9 * away_m2;
    let reach_m2 = radius_m * radius_m + room_m2;
    away_m2 <= reach_m2 || (along_m > 0.0 && away_m2 - along_m * along_m <= reach_m2)
}
