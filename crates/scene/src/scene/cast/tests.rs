//! What rays meet, and what sends light back along them.

use super::*;
use crate::scene::shape::{any_point, any_shape};
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
        shape in any_shape(), aside in any_point(0.7),
    ) {
        // Most rays aimed at it meet it.
        let (middle, reach_m) = shape.ball_around().unwrap_or((DVec3::new(0.0, 4.0, 5.0), 3.0));
        let aim = (middle + aside * reach_m).normalize();
        let (right, down) = aim.any_orthonormal_pair();
        let scene = scene(vec![Object::new("it", 0.5, shape)]);
        let ray = |x: f64, y: f64| Ray::new(DVec3::ZERO, aim + right * x + down * y);
        let straight = ray(0.0, 0.0);
        let Some(hit) = scene.hit(&straight) else { return Ok(()) };
        prop_assert!((hit.normal.length() - 1.0).abs() < 1e-12);
        prop_assert!(hit.normal.dot(straight.direction) <= 0.0);
        let point = straight.point(hit.range_m);
        for (dx, dy) in [(1e-6, 0.0), (0.0, 1e-6)] {
            let beside = ray(dx, dy);
            let Some(next) = scene.hit(&beside) else { continue };
            let same_face = (next.normal - hit.normal).length() < 1e-3;
            // Where a ray grazes, one step is no small one.
            if same_face && hit.normal.dot(straight.direction) < -0.1 {
                let along = (beside.point(next.range_m) - point).normalize();
                prop_assert!(along.dot(hit.normal).abs() < 1e-3, "{along} {}", hit.normal);
            }
        }
    }
}
