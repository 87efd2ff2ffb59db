//! Other lidars beside what their light is by hand.

use super::*;
use crate::photon::{PhotonStream, PixelLight, SpadModel, StreamConfig};
use crate::scene::{GroundTruth, Interferer, Object, Shape, turned};
use crate::units::Frequency;

fn other(keys: &str) -> Interferer {
    let text = format!("[[interferer]]\nname = \"other\"\n{keys}\n");
    Scene::parse("test", &text).unwrap().interferers.remove(0)
}

/// A laser and a lens before a wall of this reflectivity, 40 m ahead, with another lidar.
fn before_a_wall(reflectivity: f64, keys: &str) -> Scene {
    let mut scene = Scene::outdoor();
    (scene.lidar.pulse_energy_uj, scene.lidar.lens_diameter_mm) = (20.0, 4.0);
    let shape = Shape::Plane {
        centre_m: DVec3::new(0.0, 0.0, 40.0),
        normal: DVec3::NEG_Z,
        width_m: 100.0,
        height_m: 100.0,
    };
    scene.objects = vec![Object::new("wall", reflectivity, shape)];
    scene.interferers = vec![other(keys)];
    scene
}

fn others(scene: &Scene, across: u32) -> Vec<Vec<PulseTrain>> {
    let truth = GroundTruth::render(scene, across, across);
    let budget = scene.photon_budget(across, across);
    let trains = |view: &std::sync::Arc<crate::scene::view::View>| {
        let others = view.others.iter();
        others
            .filter_map(|s| s.train(scene, &budget, 1.0))
            .collect()
    };
    truth.views.iter().map(trains).collect()
}

#[test]
fn all_of_a_pulse_is_in_its_beam() {
    let keys = "place_m = [3, -1, 20]\nyaw_deg = 130\npitch_deg = -20\nbeam_width_deg = 50\nbeam_height_deg = 24";
    let other = other(keys);
    let (steps, mut sent_j) = (800, 0.0);
    for (row, col) in (0..steps).flat_map(|row| (0..2 * steps).map(move |col| (row, col))) {
        let step = std::f64::consts::PI / f64::from(steps);
        let (theta, phi) = ((f64::from(row) + 0.5) * step, (f64::from(col) + 0.5) * step);
        let direction = DVec3::new(
            theta.sin() * phi.cos(),
            theta.cos(),
            theta.sin() * phi.sin(),
        );
        let point = other.place_m + 7.0 * direction;
        sent_j += other.intensity_j_sr(point) * theta.sin() * step * step;
    }
    assert!((sent_j / 20e-6 - 1.0).abs() < 5e-3, "{sent_j}");
    let ahead = other.place_m
        + turned(
            DVec3::Z,
            (130f64.to_radians().cos(), 130f64.to_radians().sin()),
        );
    let down = DVec3::new(0.0, 20f64.to_radians().tan(), 0.0);
    assert_eq!(other.intensity_j_sr(ahead), 0.0);
    assert!(other.intensity_j_sr(ahead + down) > 0.0);
}

/// A lidar like ours beside ours sends a macropixel what ours does, and as late.
#[test]
fn a_lidar_beside_ours_with_our_beam_makes_our_echo() {
    let own_beam = Scene::outdoor().lidar.fov_deg;
    let keys = format!(
        "place_m = [0.05, 0, 0]\nyaw_deg = 0\nbeam_width_deg = {own_beam}\nbeam_height_deg = {own_beam}"
    );
    let scene = before_a_wall(0.3, &keys);
    let truth = GroundTruth::render(&scene, 16, 16);
    let lights = scene.pixel_light(&truth);
    let middle = 8 * 16 + 8;
    let own = lights[middle].signal_per_cycle();
    let [train] = others(&scene, 16)[middle][..] else {
        panic!("one train");
    };
    // A uniform beam fills the plane field of view, and a pyramid its solid angle: 0.7 % less on the axis.
    assert!(
        (train.photons / own - 1.0).abs() < 0.02,
        "{} {own}",
        train.photons
    );
    let off = train.delay - lights[middle].arrival();
    assert!(off.as_ns().abs() < 0.05, "{off}");
}

#[test]
fn a_lidar_that_looks_at_us_shines_into_one_macropixel_as_its_intensity_says() {
    let scene = before_a_wall(0.3, "place_m = [1.0, 0.5, 30]");
    let all = others(&scene, 16);
    let lit: Vec<_> = all.iter().flatten().collect();
    // The wall is behind it.
    let [train] = lit[..] else {
        panic!("{} trains", lit.len());
    };
    let half = 8f64.to_radians().sin();
    let intensity_j_sr = 20e-6 / (4.0 * (half * half).asin());
    let range_m = DVec3::new(1.0, 0.5, 30.0).length();
    let aperture_m2 = std::f64::consts::PI * 0.002f64.powi(2);
    let joules = intensity_j_sr * aperture_m2 * (30.0 / range_m) / (range_m * range_m);
    let photon_j = 6.626_070_15e-34 * 299_792_458.0 / 940e-9;
    let expected = 0.185 * joules / photon_j;
    assert!(
        (train.photons / expected - 1.0).abs() < 1e-9,
        "{} {expected}",
        train.photons
    );
    assert!((train.delay.as_s() * 299_792_458.0 - range_m).abs() < 1e-6);
    let mut hidden = scene.clone();
    hidden.interferers[0].place_m.z = 41.0;
    assert!(others(&hidden, 16).iter().all(Vec::is_empty));
    hidden.interferers[0] = other("place_m = [1.0, 0.5, 30]\nyaw_deg = 90");
    assert!(others(&hidden, 16).iter().all(Vec::is_empty));
}

/// Another wavelength gets through our filter as much as the filter says, and meets the efficiency that SPADs have there.
#[test]
fn another_wavelength_meets_our_filter() {
    let photons = |lidar: &str, keys: &str| -> f64 {
        let text = format!(
            "[lidar]\n{lidar}\n[[interferer]]\nname = \"car\"\nplace_m = [1.0, 0.5, 30]\n{keys}\n"
        );
        let mut scene = Scene::parse("test", &text).unwrap();
        let interferers = std::mem::take(&mut scene.interferers);
        let street = before_a_wall(0.3, "place_m = [1.0, 0.5, 30]");
        let scene = Scene {
            interferers,
            lidar: scene.lidar,
            ..street
        };
        others(&scene, 16)
            .iter()
            .flatten()
            .map(|train| train.photons)
            .sum()
    };
    let gaussian = "filter = \"gaussian\"\nfilter_fwhm_nm = 20";
    let own = photons(gaussian, "");
    assert_eq!(photons(gaussian, "wavelength_nm = 940"), own);
    // 35 nm are 1.75 widths off the centre; a photon of 905 nm has more energy.
    let expected = 0.5f64.powf(3.5 * 3.5) * 905.0 / 940.0;
    let found = photons(gaussian, "wavelength_nm = 905") / own;
    assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    assert_eq!(photons("filter = \"top_hat\"", "wavelength_nm = 905"), 0.0);
    let curves = "filter = [[890, 0.1], [950, 0.1], [960, 1.0]]\npde_curve = [[900, 0.4], [905, 0.4], [940, 0.1], [960, 0.1]]";
    let found = photons(curves, "wavelength_nm = 905") / photons(curves, "");
    assert!(
        (found / (4.0 * 905.0 / 940.0) - 1.0).abs() < 1e-9,
        "{found}"
    );
    // Our laser drifts with the temperature, theirs is where it is.
    let warm = photons(
        &format!("{gaussian}\ntemperature_c = 105"),
        "wavelength_nm = 946.4",
    );
    assert_eq!(
        warm,
        photons(&format!("{gaussian}\ntemperature_c = 105"), "")
    );
    let keys = "[[interferer]]\nname = \"car\"\nplace_m = [0, 0, 9]\nwavelength_nm = 905\n";
    let fault = Scene::parse("test", keys).unwrap_err().to_string();
    assert!(
        fault.contains("in [[interferer]] number 1 (car)")
            && fault.contains("lidar.filter is irradiance"),
        "{fault}"
    );
}

/// Arrivals in the laser cycle of a laser of our rate, of one whose clock is fast, and where either laser dithers.
#[test]
fn a_laser_of_our_rate_stands_still_until_a_clock_drifts_or_a_laser_dithers() {
    const CYCLES: u32 = 4000;
    let stream = |seed| {
        PhotonStream::new(&StreamConfig {
            seed,
            clock: Frequency::from_hz(80_000_000),
            stop_periods: 1000,
            laser_cycles: CYCLES,
            lead: Time::ZERO,
            pulse_sigma: Time::from_ns(1),
            pulse_shape: None,
            energy_spread: 0.0,
            spads: SpadModel::with_dead_time(Time::from_ns(8)),
        })
    };
    let times_ns = |keys: &str, own_dither_ns: f64, seed: u64| -> Vec<f64> {
        let other = other(&format!("place_m = [0, 0, 30]\npulse_fwhm_ns = 0\n{keys}"));
        let train = PulseTrain {
            laser: other.law(0, own_dither_ns),
            // The first photon on each SPAD of every pulse.
            photons: 1e4,
            delay: Time::from_ns(100),
            sigma: Time::ZERO,
        };
        let light = PixelLight::dark().with_train(train);
        let events = stream(seed).pixel_events(0, &light).events;
        let first = events.chunk_by(|a, b| a.time == b.time).map(|all| {
            assert_eq!(all.len(), 16);
            all[0].time
        });
        first
            .map(|time| time.as_ns().rem_euclid(12_500.0))
            .collect()
    };
    let spread = |times_ns: &[f64]| {
        let ends = times_ns
            .iter()
            .fold((f64::MAX, 0f64), |(a, b), &t| (a.min(t), b.max(t)));
        ends.1 - ends.0
    };
    let still = times_ns("phase = 0.25", 0.0, 1);
    assert_eq!(still.len(), CYCLES as usize);
    assert!(
        still.iter().all(|ns| (ns - 3225.0).abs() < 1e-3),
        "{:?}",
        &still[..3]
    );
    // 2 ppm over 4000 laser cycles of 12.5 us are 100 ns.
    let drifting = times_ns("phase = 0.25\ndrift_ppm = 2", 0.0, 1);
    assert!(
        (spread(&drifting) - 100.0).abs() < 0.1,
        "{}",
        spread(&drifting)
    );
    let dithering = times_ns("phase = 0.25\ndither_ns = 500", 0.0, 1);
    assert!((490.0..500.0).contains(&spread(&dithering)));
    // Waits of 100 ns on average, as random walk and drift, take it everywhere; 100 of 12 600 ns are lost.
    let waiting = times_ns("phase = 0.25", 200.0, 1);
    let lost = 1.0 - waiting.len() as f64 / (f64::from(CYCLES) * 1.008);
    assert!(
        spread(&waiting) > 12_300.0 && (lost - 100.0 / 12_600.0).abs() < 3e-3,
        "{lost}"
    );
    let quarters = (0..4).map(|n| {
        let within = f64::from(n) * 3125.0..f64::from(n + 1) * 3125.0;
        waiting.iter().filter(|ns| within.contains(ns)).count()
    });
    assert!(
        quarters.clone().all(|n| (900..1100).contains(&n)),
        "{:?}",
        quarters.collect::<Vec<_>>()
    );
    let random = [1, 2].map(|seed| times_ns("", 0.0, seed)[0]);
    assert!((random[0] - random[1]).abs() > 1.0);
}

#[test]
fn what_cannot_be_is_refused_in_one_sentence() {
    for (keys, complaint) in [
        (
            "place_m = [0, 0, 0]",
            "place_m is where the sensor itself is",
        ),
        (
            "place_m = [0, 0, 9]\nrate_hz = 0",
            "rate_hz = 0 is impossible; give 1 to 1e7 Hz",
        ),
        (
            "place_m = [0, 0, 9]\ndither_ns = 12500",
            "give less than the 12500 ns from pulse to pulse",
        ),
        ("", "lacks `name` or `place_m`"),
    ] {
        let text = format!("[[interferer]]\nname = \"car\"\n{keys}\n");
        let error = Scene::parse("test", &text).unwrap_err().to_string();
        assert!(error.contains(complaint), "{error}");
        assert!(
            error.contains("in [[interferer]] number 1 (car)"),
            "{error}"
        );
    }
}

#[test]
fn another_lidar_moves_with_the_world() {
    let mut scene = before_a_wall(0.3, "place_m = [0, 0, 30]\nvelocity_m_s = [1, 0, -10]");
    scene.rig.yaw_rate_deg_s = 30.0;
    let later = &scene.snapshot(3.0).interferers[0];
    assert!(
        (later.place_m - DVec3::new(0.0, 0.0, 3.0)).length() < 1e-9,
        "{}",
        later.place_m
    );
    assert_eq!((later.yaw_deg, later.velocity_m_s), (90.0, DVec3::ZERO));
    assert!(!scene.is_still());
}
