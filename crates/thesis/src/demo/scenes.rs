//! Worlds of the demos that have a size of their own: a figure at a distance, a van, a pedestrian, a car.

use crate::scene::{DVec3, Interferer, Lidar, Object, Scene, Shape, Stereo};

/// Height of the lidar above the road, m.
const LIDAR_HEIGHT_M: f64 = 1.2;

/// The rig of Table 12 as the demonstrator runs it: pixels binned 2×2 (6.3.2), the principal camera right above the lidar.
pub(crate) fn binned_rig() -> Stereo {
    let full = Stereo::default();
    Stereo {
        pixel_pitch_um: 2.0 * full.pixel_pitch_um,
        width: full.width / 2,
        height: full.height / 2,
        // Fig. 105's line.
        disparity_sigma_px: 0.25,
        // What is searched reaches from 15 m on, as with whole pixels; the least is that of 5.2.1.
        max_disparity_px: 0.5 * full.max_disparity_px,
        position_m: DVec3::new(0.0, -0.1, 0.0),
        ..full
    }
}

/// The demonstrator on a road, under `klux`, before these objects.
fn on_a_road(klux: f64, objects: impl IntoIterator<Item = Object>) -> Scene {
    let road = Shape::Ground {
        depth_m: LIDAR_HEIGHT_M,
    };
    let mut scene = Scene::outdoor();
    scene.lidar = Lidar::demonstrator();
    scene.stereo = binned_rig();
    scene.light.illuminance_klux = klux;
    scene.objects = vec![Object::new("road", 0.15, road)];
    scene.objects.extend(objects);
    scene
}

/// Something that stands on the road, `size_m` wide, high and long, its front `z_m` ahead and its middle `x_m` to the right, moving
/// forward at `speed_m_s`.
fn standing(
    name: &str,
    reflectivity: f64,
    size_m: [f64; 3],
    (x_m, z_m): (f64, f64),
    speed_m_s: f64,
) -> Object {
    let size_m = DVec3::from_array(size_m);
    let shape = Shape::Box {
        centre_m: DVec3::new(x_m, LIDAR_HEIGHT_M - 0.5 * size_m.y, z_m + 0.5 * size_m.z),
        size_m,
        yaw_deg: 0.0,
    };
    let mut object = Object::new(name, reflectivity, shape);
    object.velocity_m_s = DVec3::new(0.0, 0.0, speed_m_s);
    object
}

/// A figure `z_m` ahead: a box as wide and deep as a body, of this reflectivity. It stands in the middle of a column of HSLIDAR's
/// macropixels, the first on the right: at 50 m three of them are hardly wider.
pub(crate) fn figure_at(z_m: f64, reflectivity: f64, klux: f64) -> Scene {
    let column = 114e-6 / 25e-3;
    let at = (0.5 * column * z_m, z_m);
    let figure = standing("figure", reflectivity, [0.6, 1.8, 0.3], at, 0.0);
    on_a_road(klux, [figure])
}

/// A board of 10 m × 4 m `z_m` ahead, of this reflectivity.
pub(crate) fn target_at(z_m: f64, reflectivity: f64, klux: f64) -> Scene {
    let target = standing("target", reflectivity, [10.0, 4.0, 0.2], (0.0, z_m), 0.0);
    on_a_road(klux, [target])
}

/// The pedestrian of Fig. 107, who walks nearer at 1.4 m/s from 43 m on, under 30 klux, before a hedge; the right camera has turned by
/// `yaw_deg` since it was calibrated.
pub(crate) fn pedestrian(yaw_deg: f64) -> Scene {
    let mut scene = on_a_road(
        30.0,
        [
            standing("pedestrian", 0.2, [0.6, 1.75, 0.3], (-0.5, 43.0), -1.4),
            standing("hedge", 0.4, [40.0, 2.5, 1.0], (0.0, 70.0), 0.0),
        ],
    );
    scene.stereo.yaw_error_deg = yaw_deg;
    scene
}

/// A car that drives away from 40 m on at `speed_m_s`, under 30 klux.
pub(crate) fn car(speed_m_s: f64) -> Scene {
    on_a_road(
        30.0,
        [
            standing("car", 0.2, [1.8, 1.45, 4.3], (0.2, 40.0), speed_m_s),
            standing("hedge", 0.4, [8.0, 2.5, 60.0], (-9.0, 30.0), 0.0),
        ],
    )
}

/// A built-in scene.
pub(crate) fn built_in(name: &str) -> Scene {
    Scene::named(name).expect("it is built in")
}

/// The built-in van (20 m to 75 m), driving at `speed_m_s` instead of its 5 m/s.
pub(crate) fn van(speed_m_s: f64) -> Scene {
    let mut scene = built_in("van");
    let waypoints = scene.objects.iter_mut().flat_map(|o| &mut o.waypoints);
    waypoints.for_each(|waypoint| waypoint.time_s *= 5.0 / speed_m_s);
    scene
}

/// The built-in fog, of another visibility.
pub(crate) fn fog(visibility_m: f64) -> Scene {
    let mut scene = built_in("fog");
    // Koschmieder: the contrast of black on the sky is 2 % at the visibility.
    scene.medium.extinction_1_m = libm::log(1.0f64 / 0.02) / visibility_m;
    scene
}

/// Three pedestrians and ten vehicles, each with the demonstrator's lidar above its windscreen, under 30 klux: five oncoming in the
/// next lane, five that go our way, two of them behind us. Our lens scatters half a per cent, as a good one does.
pub(crate) fn busy_street() -> Scene {
    const CAR_M: [f64; 3] = [1.8, 1.45, 4.3];
    let pedestrians = [(-1.4, 20.0), (1.7, 30.0), (-0.6, 42.0)];
    let oncoming = [28.0, 37.0, 46.0, 55.0, 64.0].map(|z_m| (-3.4, z_m, 180.0));
    let our_way = [
        (3.4, -9.0),
        (-0.2, -14.0),
        (3.4, 33.0),
        (3.4, 48.0),
        (0.2, 60.0),
    ];
    let our_way = our_way.map(|(x_m, z_m)| (x_m, z_m, 0.0));
    let cars = || oncoming.into_iter().chain(our_way);
    let objects = pedestrians
        .map(|at| standing("pedestrian", 0.2, [0.6, 1.75, 0.3], at, 0.0))
        .into_iter()
        .chain(cars().map(|(x_m, z_m, _)| standing("car", 0.2, CAR_M, (x_m, z_m), 0.0)));
    let mut scene = on_a_road(30.0, objects);
    scene.lidar.stray_share = 0.005;
    let Lidar {
        fov_deg,
        pulse_energy_uj,
        pulse_fwhm_ns,
        ..
    } = scene.lidar;
    scene.interferers = cars()
        .enumerate()
        .map(|(n, (x_m, z_m, yaw_deg))| Interferer {
            name: format!("car {}", n + 1),
            // On the edge of the roof at the front.
            place_m: DVec3::new(
                x_m,
                -0.35,
                z_m + if yaw_deg == 0.0 { CAR_M[2] } else { 0.0 },
            ),
            yaw_deg,
            beam_width_deg: fov_deg,
            beam_height_deg: 0.25 * fov_deg,
            pulse_energy_uj,
            pulse_fwhm_ns,
            ..Interferer::default()
        })
        .collect();
    scene
}

/// A pedestrian 30 m ahead, and at `sign_m` a road sign that shines past him, under 30 klux; the lens scatters this share.
pub(crate) fn sign(sign_m: f64, stray_share: f64) -> Scene {
    let pedestrian = standing("pedestrian", 0.2, [0.6, 1.75, 0.3], (-0.5, 30.0), 0.0);
    let mut scene = on_a_road(30.0, [pedestrian]);
    let shape = Shape::Plane {
        centre_m: DVec3::new(0.02 * sign_m, -0.01 * sign_m, sign_m),
        normal: DVec3::NEG_Z,
        width_m: 0.6,
        height_m: 0.6,
    };
    let mut sign = Object::new("sign", 0.5, shape);
    sign.retro = 500.0;
    scene.objects.push(sign);
    scene.lidar.stray_share = stray_share;
    scene
}

/// A target of 10 % 30 m ahead, and a white wall that leads up to it on the right, under 30 klux; so many rays look for bounced light.
pub(crate) fn corner(bounce_rays: u32) -> Scene {
    let mut scene = target_at(30.0, 0.1, 30.0);
    let wall = standing("wall", 0.8, [0.3, 4.0, 12.0], (1.5, 18.0), 0.0);
    scene.objects.push(wall);
    scene.lidar.bounce_rays = bounce_rays;
    scene
}
