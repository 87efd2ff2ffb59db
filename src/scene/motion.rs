//! Motion: scenes are described at time 0, and here they are at other times.
//!
//! Everything else looks at a scene that stands still. Motion within an exposure is a row of such scenes.

use glam::DVec3;

use super::settings::Scene;

impl Scene {
    /// The scene as it stands still at `time_s` (negative times are before the described one): every object is where its
    /// velocity has taken it, and at rest.
    pub fn at(&self, time_s: f64) -> Scene {
        let mut scene = self.clone();
        for object in &mut scene.objects {
            object.shape = object.shape.shifted(object.velocity_m_s * time_s);
            object.velocity_m_s = DVec3::ZERO;
        }
        scene
    }

    /// Whether the scene is the same at all times.
    pub fn is_still(&self) -> bool {
        let mut objects = self.objects.iter();
        objects.all(|object| object.velocity_m_s == DVec3::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Ray;

    #[test]
    fn a_scene_at_a_time_stands_still_where_motion_has_taken_it() {
        let mut scene = Scene::outdoor();
        assert!(scene.is_still());
        assert_eq!(scene.at(7.0), scene);
        let end = scene.objects.len() - 1;
        scene.objects[end].velocity_m_s = DVec3::new(0.0, 0.0, -10.0);
        assert!(!scene.is_still());
        let ahead = Ray::new(DVec3::ZERO, DVec3::new(0.0, -0.05, 1.0));
        let range_m = |scene: &Scene| scene.hit(&ahead).unwrap().range_m;
        let later = scene.at(2.0);
        assert!(later.is_still());
        let expected = 20.0 / ahead.direction.z;
        assert!((range_m(&scene) - range_m(&later) - expected).abs() < 1e-9);
        assert_eq!(scene.at(0.0).objects[end].shape, scene.objects[end].shape);
    }
}
