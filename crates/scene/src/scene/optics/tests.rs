//! Optics beside their formulas.

use super::*;
use crate::photon::PixelLight;
use crate::scene::{DVec3, GroundTruth, Object, Shape};
use crate::units::TimeOfFlight;

/// The street's optics with these keys, before a white sphere about the lidar, which every ray meets at a right angle.
fn sphere(lidar: &str) -> Scene {
    let mut scene = Scene::parse("test", &format!("[lidar]\n{lidar}\n")).unwrap();
    let shape = Shape::Sphere {
        centre_m: DVec3::ZERO,
        radius_m: 30.0,
    };
    scene.objects = vec![Object::new("sphere", 1.0, shape)];
    // Little enough for one macropixel.
    scene.lidar.pulse_energy_uj = 1e-3;
    scene.light.illuminance_klux = 1e-6;
    scene
}

fn lights(scene: &Scene, across: u32) -> Vec<PixelLight> {
    scene.pixel_light(&GroundTruth::render(scene, across, across))
}

fn curve(points: &[[f64; 2]]) -> Curve {
    Curve::new(points).unwrap()
}

#[test]
fn the_array_fills_the_field_of_view() {
    let scene = Scene::outdoor();
    let budget = scene.photon_budget(64, 64);
    let half_width_m = 32.0 * budget.pixel_pitch_m[0];
    let fov_deg = 2.0 * (half_width_m / budget.lens_focal_m).atan().to_degrees();
    assert!((fov_deg - scene.lidar.fov_deg).abs() < 1e-9);
}

#[test]
fn the_demonstrator_has_the_published_pitch_and_light() {
    let mut scene = Scene::outdoor();
    scene.lidar = Lidar::demonstrator();
    let budget = scene.photon_budget(32, 64);
    let [x_m, y_m] = budget.pixel_pitch_m;
    assert!((x_m - 114e-6).abs() < 1e-8 && (y_m - 54e-6).abs() < 1e-8);
    assert!((budget.lens_focal_m - 25e-3).abs() < 1e-12);
    // Such that its chip counts what Fig. 94 shows (claim 21).
    let signal = budget.signal_per_pulse_far_field(30.0, 0.1) * 900.0;
    let background_hz = budget.background_hz(0.1, 60.0);
    assert!((signal - 129.9).abs() < 0.1, "{signal}");
    assert!((background_hz - 4.876e6).abs() < 0.01e6, "{background_hz}");
}

#[test]
fn a_lens_loses_light_off_the_axis() {
    let (plain, cos4) = (
        sphere("fov_deg = 60"),
        sphere("fov_deg = 60\nvignetting = \"cos4\""),
    );
    let (plain, cos4) = (lights(&plain, 5), lights(&cos4, 5));
    let tangent = 30f64.to_radians().tan() * 4.0 / 5.0;
    let cosine = 1.0 / (1.0 + 2.0 * tangent * tangent).sqrt();
    let signal = cos4[0].signal_per_cycle() / plain[0].signal_per_cycle();
    let background = cos4[0].background_hz() / plain[0].background_hz();
    assert!((signal / cosine - 1.0).abs() < 1e-9, "{signal} {cosine}");
    assert!(
        (background / cosine.powi(4) - 1.0).abs() < 1e-9,
        "{background}"
    );
    assert_eq!(cos4[12], plain[12]);
}

#[test]
fn a_beam_has_its_energy_whatever_its_shape() {
    // A narrow beam lies within the field of view, and a sphere sends back the same from everywhere.
    let sum = |scene: &Scene| -> f64 {
        lights(scene, 64)
            .iter()
            .map(PixelLight::signal_per_cycle)
            .sum()
    };
    let uniform = sum(&sphere("fov_deg = 30"));
    let gaussian = sum(&sphere(
        "fov_deg = 30\nbeam = \"gaussian\"\nbeam_fwhm_deg = 8",
    ));
    let measured = sum(&sphere(
        "fov_deg = 30\nbeam = [[0, 3.0], [4, 3.0], [9, 0.0]]",
    ));
    assert!(
        (gaussian / uniform - 1.0).abs() < 1e-3,
        "{gaussian} {uniform}"
    );
    assert!(
        (measured / uniform - 1.0).abs() < 1e-3,
        "{measured} {uniform}"
    );
    // One of the field of view's width sends part of it beside, and is brightest in the middle.
    let wide = lights(
        &sphere("fov_deg = 30\nbeam = \"gaussian\"\nbeam_fwhm_deg = 30"),
        3,
    );
    let (corner, middle) = (wide[0].signal_per_cycle(), wide[4].signal_per_cycle());
    let tangent = 15f64.to_radians().tan() * 2.0 / 3.0 * 2f64.sqrt();
    let angle_deg = tangent.atan().to_degrees();
    let expected = 0.5f64.powf((angle_deg / 15.0).powi(2)) / (1.0 + tangent * tangent).powf(1.5);
    assert!(
        (corner / middle / expected - 1.0).abs() < 1e-9,
        "{corner} {middle}"
    );
}

#[test]
fn sunlight_is_that_of_the_filter_and_of_the_efficiency() {
    let irradiance = |keys: &str| sphere(keys).lidar.effective_irradiance_w_m2();
    assert_eq!(irradiance("solar_irradiance_w_m2 = 4.5"), 4.5);
    // The street's number is that of 935 to 945 nm; photons instead of joules change it by a part in a thousand.
    let street = irradiance("filter = \"top_hat\"");
    assert!((street / 3.047 - 1.0).abs() < 2e-3, "{street}");
    let pairs = irradiance("filter = [[934.999, 0.0], [935, 1.0], [945, 1.0], [945.001, 0.0]]");
    assert!((pairs / street - 1.0).abs() < 1e-3, "{pairs} {street}");
    let wide = "filter = \"gaussian\"\nfilter_fwhm_nm = 60";
    let flat = irradiance(wide);
    let falling = irradiance(&format!(
        "{wide}\npde_curve = [[700, 0.4], [940, 0.1], [1200, 0.0]]"
    ));
    assert!(falling > 1.02 * flat, "{falling} {flat}");
    // Twice the curve is the same curve.
    let twice = irradiance(&format!(
        "{wide}\npde_curve = [[700, 0.8], [940, 0.2], [1200, 0.0]]"
    ));
    assert!((twice / falling - 1.0).abs() < 1e-9);
    // The laser loses what the filter takes at its wavelength, the sun what it takes of the band.
    let (half, whole) = (
        sphere("filter = [[935, 0.5], [945, 0.5]]"),
        sphere("filter = [[935, 1.0], [945, 1.0]]"),
    );
    let (half, whole) = (&lights(&half, 2)[0], &lights(&whole, 2)[0]);
    assert!((half.signal_per_cycle() / whole.signal_per_cycle() - 0.5).abs() < 1e-9);
    assert!((half.background_hz() / whole.background_hz() - 0.5).abs() < 1e-9);
}

#[test]
fn late_avalanches_keep_the_mean_and_need_a_time_constant() {
    for pulse in ["", "pulse = [[0, 0.0], [1, 1.0], [5, 0.0]]"] {
        let keys =
            format!("pulse_fwhm_ns = 0.5\n{pulse}\nspad_tail_share = 0.2\nspad_tail_ps = 800");
        let scene = sphere(&keys);
        let shape = scene.pulse_shape().unwrap();
        let light = &lights(&scene, 1)[0];
        let mean_fs = light.arrival().as_fs() as f64 + shape.mean_fs();
        assert!((mean_fs - Time::of_flight(30.0).as_fs() as f64).abs() < 1e3);
        assert_eq!(
            scene.not_gaussian(),
            Some(if pulse.is_empty() {
                "spad_tail_share"
            } else {
                "pulse"
            })
        );
    }
    let usual = sphere("pulse_fwhm_ns = 0.5");
    assert_eq!((usual.pulse_shape(), usual.not_gaussian()), (None, None));
    let none = sphere("pulse_fwhm_ns = 0.5\nspad_tail_ps = 100");
    assert_eq!(none.pulse_shape(), None);
    let fault = Scene::parse("test", "[lidar]\nspad_tail_share = 0.1\n").unwrap_err();
    assert!(
        fault.to_string().contains("give spad_tail_ps, too"),
        "{fault}"
    );
}

#[test]
fn a_measured_pulse_comes_when_its_centre_has_flown() {
    let scene = sphere("pulse_fwhm_ns = 0.5\npulse = [[0, 0.0], [1, 1.0], [5, 0.0]]");
    let shape = scene.pulse_shape().unwrap();
    // A triangle's centre is the mean of its corners.
    assert!((shape.mean_fs() / 2e6 - 1.0).abs() < 1e-3);
    let light = &lights(&scene, 1)[0];
    let centre_fs = light.arrival().as_fs() as f64 + shape.mean_fs();
    assert!((centre_fs - Time::of_flight(30.0).as_fs() as f64).abs() < 1e3);
    let triangle_ns2: f64 = (0.0 + 1.0 + 25.0 - 0.0 - 0.0 - 5.0) / 18.0;
    let jitter_ns = 0.5 / 2.354_820_045;
    let expected = (triangle_ns2 + jitter_ns * jitter_ns).sqrt();
    assert!((scene.pulse_resolution().as_ns() / expected - 1.0).abs() < 1e-3);
    assert_eq!(
        curve(&[[0.0, 0.0], [1.0, 1.0], [5.0, 0.0]]),
        *scene.lidar.pulse.curve().unwrap()
    );
}
