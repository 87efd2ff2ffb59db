//! Mirrors and panes against closed forms: a plane mirror shows what stands before it as if it stood behind it, once more by its
//! reflectance weaker each way. The image is worked out here from points and planes alone.

use glam::DVec3;
use proptest::prelude::*;

use super::{GroundTruth, Object, Ray, Scene, Shape, Stage};
use crate::photon::{Echo, PixelLight};
use crate::units::{Time, TimeOfFlight};

/// A lidar of one macropixel, 0.25 degrees wide, that looks along z.
fn lidar() -> Scene {
    let mut scene = Scene::outdoor();
    scene.lidar.fov_deg = 0.25;
    // All of a pulse goes into the one macropixel.
    scene.lidar.pulse_energy_uj = 1e-3;
    scene.objects.clear();
    scene
}

fn light(scene: &Scene) -> PixelLight {
    let truth = GroundTruth::render(scene, 1, 1);
    scene.pixel_light(&truth).swap_remove(0)
}

fn sheet(centre_m: DVec3, normal: DVec3, size_m: f64) -> Shape {
    Shape::Plane {
        centre_m,
        normal,
        width_m: size_m,
        height_m: size_m,
    }
}

fn mirror(shape: Shape, mirror: f64) -> Object {
    Object {
        mirror,
        ..Object::new("mirror", 0.0, shape)
    }
}

/// The image of a point, or of a direction where the mirror goes through the origin.
fn image(point: DVec3, (through, normal): (DVec3, DVec3)) -> DVec3 {
    point - 2.0 * (point - through).dot(normal) * normal
}

/// A direction in the x-z plane, `deg` degrees from z towards x.
fn heading(deg: f64) -> DVec3 {
    let (sine, cosine) = deg.to_radians().sin_cos();
    DVec3::new(sine, 0.0, cosine)
}

/// A wall of 90 % at 12 m over a mirror of 0.9 that stands 5 m away and is met at `incidence_deg`; the wall is met at `tilt_deg`.
fn over_a_mirror(incidence_deg: f64, tilt_deg: f64) -> Scene {
    let mut scene = lidar();
    let at = DVec3::new(0.0, 0.0, 5.0);
    let onwards = heading(180.0 - 2.0 * incidence_deg);
    let facing_back = heading(tilt_deg - 2.0 * incidence_deg);
    scene.objects = vec![
        mirror(sheet(at, heading(180.0 - incidence_deg), 1.0), 0.9),
        Object::new("wall", 0.9, sheet(at + 7.0 * onwards, facing_back, 1.0)),
    ];
    scene
}

/// The same wall at 12 m without a mirror.
fn straight_ahead(tilt_deg: f64) -> Scene {
    let mut scene = lidar();
    let wall = sheet(DVec3::new(0.0, 0.0, 12.0), heading(-tilt_deg), 1.0);
    scene.objects = vec![Object::new("wall", 0.9, wall)];
    scene
}

/// Photons, arrival in m and standard deviation in m of all echoes.
fn echoes(light: &PixelLight) -> Vec<[f64; 3]> {
    let segments = light.segments().flat_map(|segment| segment.echoes());
    let numbers = |echo: &Echo| {
        let sigma = echo.sigma.unwrap_or(Time::ZERO);
        [echo.photons, echo.arrival.as_range_m(), sigma.as_range_m()]
    };
    segments.map(numbers).collect()
}

/// Whether echoes are those of another light but for their photons, of which they have `share`.
fn are_alike(one: &PixelLight, other: &PixelLight, share: f64) -> Result<(), TestCaseError> {
    let (one, other) = (echoes(one), echoes(other));
    prop_assert_eq!(one.len(), other.len());
    for (a, b) in one.iter().zip(&other) {
        prop_assert!((a[0] / b[0] / share - 1.0).abs() < 1e-6, "{a:?} {b:?}");
        prop_assert!(
            (a[1] - b[1]).abs() < 1e-6 && (a[2] - b[2]).abs() < 1e-6,
            "{a:?} {b:?}"
        );
    }
    Ok(())
}

/// What daylight makes of a surface, with dark counts left out.
fn daylight_hz(scene: &Scene) -> f64 {
    light(scene).background_hz() - scene.lidar.dark_count_hz
}

#[test]
fn a_wall_over_a_mirror_returns_what_its_image_would() {
    for incidence_deg in [10.0, 30.0, 45.0, 60.0] {
        for tilt_deg in [0.0, 40.0, -70.0] {
            let scene = over_a_mirror(incidence_deg, tilt_deg);
            let found = light(&scene);
            let cosine = f64::to_radians(tilt_deg).cos();
            let whole = scene.photon_budget(1, 1).signal_per_pulse(12.0, 0.9);
            let expected = 0.9 * 0.9 * cosine * whole;
            let photons = found.signal_per_cycle();
            assert!(
                (photons / expected - 1.0).abs() < 1e-3,
                "{incidence_deg}, {tilt_deg} degrees: {photons} {expected}"
            );
            are_alike(&found, &light(&straight_ahead(tilt_deg)), 0.81).unwrap();
        }
    }
}

/// The wall of [`over_a_mirror`] tilted by 20 degrees, and the sun 25 degrees beside its normal, 35 degrees up.
fn in_the_sun(incidence_deg: f64) -> Scene {
    let mut scene = over_a_mirror(incidence_deg, 20.0);
    scene.light.sun_elevation_deg = Some(35.0);
    scene.light.sun_azimuth_deg = 20.0 - 2.0 * incidence_deg + 25.0;
    scene.light.sky_share = 0.2;
    scene
}

#[test]
fn the_sun_shines_on_what_a_mirror_shows_and_not_on_its_image() {
    let unlit = daylight_hz(&straight_ahead(0.0));
    for incidence_deg in [10.0, 30.0, 45.0, 60.0] {
        let mut scene = in_the_sun(incidence_deg);
        let incidence = f64::to_radians(35.0).cos() * f64::to_radians(25.0).cos();
        let (sun, sky) = (0.8 * incidence, 0.2 / 2.0);
        let share = daylight_hz(&scene) / unlit;
        let expected = 0.9 * (sun + sky);
        assert!((share / expected - 1.0).abs() < 1e-6, "{share} {expected}");
        // Where the wall's image is, a box changes nothing; between wall and sun it does.
        let before = light(&scene);
        let cube = |centre_m| Shape::Box {
            centre_m,
            size_m: DVec3::ONE,
            yaw_deg: 0.0,
        };
        let image_m = DVec3::new(0.0, 0.0, 12.0);
        let behind = Object::new("behind", 0.5, cube(image_m));
        scene.objects.push(behind);
        assert_eq!(light(&scene), before);
        let Shape::Plane { centre_m, .. } = scene.objects[1].shape else {
            unreachable!("it is a wall");
        };
        let towards_sun = scene.towards_sun().unwrap();
        let shade = Object::new("shade", 0.5, cube(centre_m + 3.0 * towards_sun));
        scene.objects.push(shade);
        let share = daylight_hz(&scene) / unlit;
        assert!((share / (0.9 * sky) - 1.0).abs() < 1e-6, "{share}");
    }
}

#[test]
fn a_pane_at_an_angle_shows_what_is_behind_it_and_what_it_mirrors() {
    for incidence_deg in [10.0, 30.0, 45.0, 60.0] {
        let mut scene = over_a_mirror(incidence_deg, 40.0);
        (scene.objects[0].mirror, scene.objects[0].transmittance) = (0.1, 0.8);
        let behind = sheet(DVec3::new(0.0, 0.0, 20.0), heading(150.0), 1.0);
        scene.objects.push(Object::new("behind", 0.5, behind));
        let budget = scene.photon_budget(1, 1);
        let cosine = |deg: f64| deg.to_radians().cos();
        let expected = [
            0.01 * cosine(40.0) * budget.signal_per_pulse(12.0, 0.9),
            0.64 * cosine(30.0) * budget.signal_per_pulse(20.0, 0.5),
        ];
        let found = echoes(&light(&scene));
        let near = |metres: std::ops::Range<f64>| -> f64 {
            let near = found
                .iter()
                .filter(|[_, range_m, _]| metres.contains(range_m));
            near.map(|[photons, ..]| photons).sum()
        };
        for (found, expected) in [near(11.0..13.0), near(19.0..21.0)].iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
        }
    }
}

/// Shares of the laser's light that end at 5 m and at 12 m.
fn ends(scene: &Scene) -> [f64; 2] {
    let truth = GroundTruth::render(scene, 1, 1);
    [4.9..5.1, 11.9..12.1].map(|metres: std::ops::Range<f64>| {
        let ends = truth.views[0].ends_m.iter();
        let there = ends.filter(|(end_m, _)| metres.contains(end_m));
        there.map(|(_, share)| share).sum()
    })
}

#[test]
fn fog_before_a_mirror_or_pane_is_there_once() {
    let unlit = daylight_hz(&straight_ahead(0.0));
    let mut scene = over_a_mirror(45.0, 0.0);
    scene.medium.extinction_1_m = 0.05;
    // Of daylight alone: the laser's glare counts as background, too.
    scene.medium.backscatter_1_m_sr = Some(0.0);
    let left = |range_m: f64| (-0.05 * range_m).exp();
    let sky = scene.light.sky_reflectivity;
    let beyond = (left(5.0) - left(12.0)) * sky + left(12.0) * 0.9;
    let expected = (1.0 - left(5.0)) * sky + 0.9 * beyond;
    let share = daylight_hz(&scene) / unlit * 0.9;
    assert!((share / expected - 1.0).abs() < 1e-5, "{share} {expected}");
    let [at_mirror, at_wall] = ends(&scene);
    assert!((at_mirror - 0.19).abs() < 1e-9 && (at_wall - 0.81).abs() < 1e-9);
    // What a pane passes whole changes nothing, in fog with the laser's glare as well.
    let mut scene = straight_ahead(30.0);
    scene.medium.extinction_1_m = 0.05;
    let without = light(&scene);
    let pane = sheet(DVec3::new(0.0, 0.0, 5.0), heading(160.0), 1.0);
    scene.objects.push(Object {
        transmittance: 1.0,
        ..Object::new("pane", 0.0, pane)
    });
    are_alike(&light(&scene), &without, 1.0).unwrap();
    let hz = [light(&scene), without].map(|light| light.background_hz());
    assert!((hz[0] / hz[1] - 1.0).abs() < 1e-9, "{hz:?}");
    scene.objects[1].transmittance = 0.5;
    let [at_pane, at_wall] = ends(&scene);
    assert!((at_pane - 0.75).abs() < 1e-9 && (at_wall - 0.25).abs() < 1e-9);
}

/// Something at the image that the lidar sees, and then what there is.
fn object_at(place: DVec3, normal: DVec3, is_ball: bool) -> Object {
    let shape = if is_ball {
        Shape::Sphere {
            centre_m: place,
            radius_m: 0.5,
        }
    } else {
        sheet(place, normal, 0.7)
    };
    Object::new("thing", 0.6, shape)
}

/// How near a point is to the way from one place to another.
fn distance_m(point: DVec3, (from, to): (DVec3, DVec3)) -> f64 {
    let way = to - from;
    let along = ((point - from).dot(way) / way.length_squared()).clamp(0.0, 1.0);
    point.distance(from + along * way)
}

/// A unit vector within some 60 degrees of `about`.
fn tilted(about: DVec3, (x, y): (f64, f64)) -> DVec3 {
    let (right, down) = about.any_orthonormal_pair();
    (about + x * right + y * down).normalize()
}

fn lean() -> impl Strategy<Value = (f64, f64)> {
    (-1.2f64..1.2, -1.2f64..1.2)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Photons, arrival and spread of range of what is seen over two mirrors are those of its image.
    #[test]
    fn two_mirrors_show_the_image_of_an_image(
        first in lean(), second in lean(), third in lean(), is_ball in any::<bool>(),
    ) {
        let seen = DVec3::new(0.0, 0.0, 15.0);
        let facing = tilted(DVec3::NEG_Z, third);
        let one = (DVec3::new(0.0, 0.0, 5.0), tilted(DVec3::NEG_Z, first));
        let onwards = image(DVec3::Z, (DVec3::ZERO, one.1));
        let two = (one.0 + 4.0 * onwards, tilted(-onwards, second));
        let place = image(image(seen, one), two);
        let turned = [one.1, two.1].iter().fold(facing, |v, &n| image(v, (DVec3::ZERO, n)));
        // Nothing stands in the light's way.
        let ways = [(DVec3::ZERO, one.0), (one.0, two.0), (two.0, place)];
        prop_assume!(distance_m(place, ways[0]) > 1.0 && distance_m(place, ways[1]) > 1.0);
        prop_assume!(distance_m(two.0, ways[0]) > 1.0 && distance_m(one.0, ways[2]) > 1.0);
        let mut scene = lidar();
        scene.objects = vec![object_at(seen, facing, is_ball)];
        let straight = light(&scene);
        scene.objects = vec![
            mirror(sheet(one.0, one.1, 1.0), 0.9),
            mirror(sheet(two.0, two.1, 1.0), 0.8),
            object_at(place, turned, is_ball),
        ];
        are_alike(&light(&scene), &straight, (0.9f64 * 0.8).powi(2))?;
    }

    /// What returns say of light over a mirror that is a ball, a cylinder or a cone, seen from outside: how the way changes with the
    /// look, and how wide the light is spread, which is the same from either end of the way.
    #[test]
    fn curved_mirrors_spread_light_as_neighbouring_rays_do(
        aim in (-0.2f64..0.2, -0.2f64..0.2), lean in lean(), kind in 0..3, radius_m in 0.3f64..3.0,
    ) {
        let centre_m = DVec3::new(0.0, 0.0, 4.0 + radius_m);
        let axis = DVec3::new(0.3, 1.0, 0.2);
        let shape = match kind {
            0 => Shape::Sphere { centre_m, radius_m },
            1 => Shape::Cylinder { centre_m, axis, radius_m, height_m: 9.0 },
            _ => Shape::Cone { centre_m, axis, radius_m: 0.6 * radius_m, tip_radius_m: 1.4 * radius_m, height_m: 9.0 },
        };
        let mut scene = lidar();
        scene.objects = vec![mirror(shape, 1.0)];
        let look = Ray::new(DVec3::ZERO, DVec3::new(aim.0 * radius_m / 3.0, aim.1 * radius_m / 3.0, 1.0));
        let stage = Stage::new(&scene);
        let meeting_m = stage.range_to_hit(&look).unwrap();
        let thrown = |ray: &Ray| {
            let hit = stage.hit(ray).unwrap();
            Ray::new(ray.point(hit.range_m), image(ray.direction, (DVec3::ZERO, hit.normal)))
        };
        let onwards = thrown(&look);
        // A wall beside the lidar, tilted as it likes.
        let place = onwards.point(6.0);
        let normal = tilted(-onwards.direction, lean);
        let ends_at = |ray: Ray| ray.point((place - ray.origin).dot(normal) / ray.direction.dot(normal));
        let length_m = |look: &Ray| {
            let onwards = thrown(look);
            look.origin.distance(onwards.origin) + onwards.origin.distance(ends_at(onwards))
        };
        let mut walled = scene.clone();
        walled.objects.push(Object::new("wall", 0.5, sheet(place, normal, 1.0)));
        prop_assume!(distance_m(place, (DVec3::ZERO, onwards.origin)) > 1.0);
        let returns = walled.returns(&look);
        let [back] = returns.surfaces[..] else { panic!("{} surfaces", returns.surfaces.len()) };
        prop_assert!((back.hit.range_m - (meeting_m + 6.0)).abs() < 1e-9);
        prop_assert!(back.place_m.distance(place) < 1e-9);
        prop_assert!((back.facing.dot(look.direction) - onwards.direction.dot(normal)).abs() < 1e-9);
        // The area of rays within a small solid angle about a ray, across it at the other end.
        let step = 1e-5;
        let area_m2 = |ray: &Ray, end: &dyn Fn(&Ray) -> DVec3| {
            let (right, down) = ray.direction.any_orthonormal_pair();
            let beside = |turn: DVec3| end(&Ray::new(ray.origin, ray.direction + step * turn)) - end(&Ray::new(ray.origin, ray.direction - step * turn));
            beside(right).cross(beside(down)) / (4.0 * step * step)
        };
        let there_m2 = area_m2(&look, &|ray| ends_at(thrown(ray))).dot(onwards.direction).abs();
        let back_look = Ray::new(place, -onwards.direction);
        let to_lens = |ray: &Ray| { let r = thrown(ray); r.point(-r.origin.dot(look.direction) / r.direction.dot(look.direction)) };
        let back_m2 = area_m2(&back_look, &to_lens).dot(look.direction).abs();
        prop_assert!((there_m2 / back_m2 - 1.0).abs() < 1e-4, "{there_m2} {back_m2}");
        let kept = back.hit.range_m.powi(2) / there_m2;
        prop_assert!(kept < 1.0 && (back.share / kept - 1.0).abs() < 1e-4, "{} {kept}", back.share);
        for turn in <[DVec3; 2]>::from(look.direction.any_orthonormal_pair()) {
            let beside = |step: f64| length_m(&Ray::new(DVec3::ZERO, look.direction + step * turn));
            let slope = (beside(step) - beside(-step)) / (2.0 * step * back.hit.range_m);
            let found = -turn.dot(back.facing) / look.direction.dot(back.facing);
            prop_assert!((slope - found).abs() < 1e-4 * (1.0 + slope.abs()), "{slope} {found}");
        }
    }
}

#[test]
fn a_ball_spreads_light_as_optics_says() {
    let (ball_m, wall_m, radius_m) = (5.0, 8.0, 0.5);
    let mut scene = lidar();
    let ball = Shape::Sphere {
        centre_m: DVec3::new(0.0, 0.0, ball_m + radius_m),
        radius_m,
    };
    let wall = sheet(DVec3::new(0.0, 0.0, ball_m - wall_m), DVec3::Z, 1.0);
    scene.objects = vec![mirror(ball, 1.0), Object::new("wall", 0.5, wall)];
    let returns = scene.returns(&Ray::new(DVec3::ZERO, DVec3::Z));
    // A look beside the middle meets the ball beside it and turns by twice the angle between the normals there.
    let spread_m = ball_m + wall_m * (1.0 + 2.0 * ball_m / radius_m);
    let kept = ((ball_m + wall_m) / spread_m).powi(2);
    assert!((returns.surfaces[0].share / kept - 1.0).abs() < 1e-9);
}
