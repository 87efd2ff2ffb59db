//! Worlds of the demos that have a size of their own: a figure at a distance, a van, a pedestrian, a car.

use crate::scene::{DVec3, Lidar, Object, Scene, Shape, Stereo};

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
    scene.medium.extinction_1_m = (1.0f64 / 0.02).ln() / visibility_m;
    scene
}
