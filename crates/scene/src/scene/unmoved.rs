//! Macropixels that need not be looked at again, because they see nothing that has moved between two worlds.
//!
//! ```text
//!   before     ▕ car ▏                    now        ▕ car ▏
//!            ╱ ╱ ╱ · ·  ·  ·                       ╱ ╱ ╱ · ·        looks, cones about them, meet the balls around
//!   lidar   ▏▏▏▏▏▏▏▏▏▏▏▏▏▏▏▏             lidar   ▏▏▏▏▏▏▏▏▏▏▏▏▏▏▏▏   objects that moved, before or now: looked at again
//! ```
//!
//! All that a view follows from is compared, so that it is the same to the bit as if it were looked at again. Mirrors throw rays
//! anywhere, and where the sun has a place anything may throw a shadow on anything, as in the light of other lidars: those are looked at again.

use glam::DVec3;

use super::bounds::{Bounds, Cone};
use super::settings::Scene;

/// Objects that are not the same in two worlds.
#[derive(Debug)]
pub(super) struct MovedObjects {
    /// Of each object, whether it is.
    is_moved: Vec<bool>,
    has_mirror: Vec<bool>,
    /// Before and now.
    bounds: [Bounds; 2],
}

impl MovedObjects {
    /// Those from one world to another; `None` where all has to be looked at again.
    pub(super) fn from_worlds(before: &Scene, now: &Scene) -> Option<Self> {
        let has_one_look = before.lidar == now.lidar
            && before.light == now.light
            && before.medium == now.medium
            && now.lidar.bounce_rays == 0
            && before.interferers.is_empty()
            && now.interferers.is_empty()
            && before.objects.len() == now.objects.len();
        if !has_one_look {
            return None;
        }
        let pairs = before.objects.iter().zip(&now.objects);
        let is_moved: Vec<bool> = pairs.map(|(before, now)| before != now).collect();
        let is_any = is_moved.contains(&true);
        (!is_any || now.towards_sun().is_none()).then(|| MovedObjects {
            is_moved,
            has_mirror: now.objects.iter().map(|o| o.mirror > 0.0).collect(),
            bounds: [before, now].map(|world| Bounds::from_scene(world, DVec3::ZERO)),
        })
    }

    /// Whether looks from the lidar within a cone meet none of them, before or now.
    pub(super) fn is_out_of_sight(&self, cone: Cone) -> bool {
        self.bounds.iter().all(|bounds| {
            let seen = bounds.candidates(cone);
            let mut seen = seen.iter().map(|&object| object as usize);
            seen.all(|object| !self.is_moved[object] && !self.has_mirror[object])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::SpadModel;
    use crate::scene::{GroundTruth, Object, PreviousWorld, Shape};
    use crate::units::Time;
    use proptest::prelude::*;

    /// A room with a wall, a ball, a box and a pane or mirror, all of which may stand elsewhere.
    fn room(places: &[(f64, f64)], mirror: f64, sun: Option<f64>) -> Scene {
        let mut scene = Scene::outdoor();
        scene.light.sun_elevation_deg = sun;
        let wall = Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, 40.0),
            normal: DVec3::NEG_Z,
            width_m: 30.0,
            height_m: 6.0,
        };
        let ground = Shape::Ground { depth_m: 1.5 };
        let ball = Shape::Sphere {
            centre_m: DVec3::ZERO,
            radius_m: 1.0,
        };
        let cube = Shape::Box {
            centre_m: DVec3::ZERO,
            size_m: DVec3::splat(1.5),
            yaw_deg: 20.0,
        };
        let pane = Shape::Plane {
            centre_m: DVec3::ZERO,
            normal: DVec3::new(0.5, 0.0, -1.0),
            width_m: 2.0,
            height_m: 2.0,
        };
        let shapes = [
            ("wall", wall),
            ("ball", ball),
            ("box", cube),
            ("pane", pane),
        ];
        scene.objects = vec![Object::new("ground", 0.2, ground)];
        for ((name, shape), &(x_m, z_m)) in shapes.into_iter().zip(places) {
            let shape = shape.shifted(DVec3::new(x_m, 0.0, z_m));
            scene.objects.push(Object::new(name, 0.4, shape));
        }
        let pane = scene.objects.last_mut().expect("it was pushed");
        (pane.mirror, pane.transmittance) = (mirror, 0.5);
        scene
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        /// What is kept is what another look would see, to the bit, of views and of light; with and without sun, mirrors, crosstalk and
        /// SPADs that differ.
        #[test]
        fn what_is_kept_is_what_a_new_look_would_see(
            places in prop::collection::vec((-6.0f64..6.0, 8.0f64..30.0), 4),
            moves in prop::collection::vec((-2.0f64..2.0, -2.0f64..2.0), 4),
            moved in 0usize..5,
            mirror in prop::sample::select(vec![0.0, 0.3]),
            sun in prop::option::of(20.0f64..60.0),
            crosstalk_probability in prop::sample::select(vec![0.0, 0.02]),
            pde_spread in prop::sample::select(vec![0.0, 0.1]),
        ) {
            let mut later = places.clone();
            if let Some(place) = later.get_mut(moved) {
                *place = (place.0 + moves[moved].0, place.1 + moves[moved].1);
            }
            let [mut before, mut now] = [&places, &later].map(|places| room(places, mirror, sun));
            (before.lidar.pde_spread, now.lidar.pde_spread) = (pde_spread, pde_spread);
            let spads = SpadModel {
                crosstalk_probability,
                ..SpadModel::with_dead_time(Time::from_ns(8))
            };
            let truth = GroundTruth::render(&before, 20, 24);
            let light = before.light_after(&truth, &spads, None);
            let seen = PreviousWorld { world: &before, truth: &truth };
            let (kept, _) = GroundTruth::render_after(&now, 20, 24, Some(seen));
            let anew = GroundTruth::render(&now, 20, 24);
            prop_assert_eq!(&kept, &anew);
            let kept_light = now.light_after(&kept, &spads, Some((seen, &light)));
            prop_assert_eq!(kept_light, now.light_after(&anew, &spads, None));
        }
    }

    #[test]
    fn one_thing_that_moves_is_all_that_is_looked_at_again() {
        let places = [(0.0, 0.0), (-3.0, 12.0), (3.0, 15.0), (8.0, 30.0)];
        let mut later = places;
        later[1].0 += 0.3;
        let [before, now] = [places, later].map(|places| room(&places, 0.0, None));
        let moved =
            MovedObjects::from_worlds(&before, &now).expect("nothing but a ball is another");
        let camera = now.lidar_camera(16, 16);
        let cones = (0..16).flat_map(|row| (0..16).map(move |col| (row, col)));
        let kept =
            cones.filter(|&place| moved.is_out_of_sight(crate::scene::view::cone(&camera, place)));
        let kept = kept.count();
        assert!((150..256).contains(&kept), "{kept}");
        let [lit, sunny] = [None, Some(30.0)].map(|sun| room(&places, 0.0, sun));
        assert!(MovedObjects::from_worlds(&lit, &sunny).is_none());
        assert!(MovedObjects::from_worlds(&sunny, &room(&later, 0.0, Some(30.0))).is_none());
        assert!(MovedObjects::from_worlds(&sunny, &sunny).is_some());
    }
}
