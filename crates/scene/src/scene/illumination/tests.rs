//! Light of single surfaces, of tilted and moving ones, and what crosses over between macropixels.

use super::*;
use crate::scene::{DVec3, Object, Ray, Shape};
use crate::units::{Time, TimeOfFlight};
use proptest::prelude::*;

#[test]
fn sky_gives_background_only() {
    let scene = Scene::outdoor();
    let truth = GroundTruth::render(&scene, 64, 64);
    let lights = scene.pixel_light(&truth);
    let sky = truth.range_m.iter().position(Option::is_none).unwrap();
    assert_eq!(lights[sky].signal_per_cycle(), 0.0);
    assert!(lights[sky].background_hz() > 1e6);
}

#[test]
fn an_echo_at_100_m_stands_out_after_1000_cycles() {
    let scene = Scene::outdoor();
    let budget = scene.photon_budget(64, 64);
    let (cycles, bin_s) = (1000.0, 1.0 / 384e6);
    let signal = cycles * budget.signal_per_pulse(100.0, 0.1);
    let per_bin = cycles * bin_s * budget.background_hz(0.1, scene.light.illuminance_klux);
    assert!(
        signal > 5.0 * per_bin.sqrt() * 2.0,
        "{signal} over {per_bin}"
    );
}

#[test]
fn a_blinding_surface_is_cut_off_beyond_saturation() {
    let mut scene = Scene::outdoor();
    scene.lidar.lens_diameter_mm = 1e200;
    scene.lidar.pulse_energy_uj = 1e300;
    let truth = GroundTruth::render(&scene, 4, 4);
    let lights = scene.pixel_light(&truth);
    let echoes = lights.iter().flat_map(PixelLight::segments);
    let echoes = echoes.flat_map(|segment| segment.echoes());
    let brightest = echoes.map(|echo| echo.photons).fold(0.0, f64::max);
    assert_eq!(brightest, MOST_PER_ECHO);
    for light in &lights {
        assert!(light.background_hz() <= MOST_BACKGROUND_HZ);
    }
}

/// A sign before a wall in one macropixel, both so bright that their sum is beyond what is modelled of an echo.
#[test]
fn an_echo_that_is_cut_off_leaves_the_others_their_light() {
    let echoes = |retro: f64| -> Vec<f64> {
        let mut scene = tilted(0.0, 100.0);
        let mut sign = tilted(0.0, 0.1).objects.remove(0);
        sign.shape = sign.shape.shifted(DVec3::new(0.0, 0.0, -20.0));
        sign.retro = retro;
        scene.objects.push(sign);
        (scene.lidar.pulse_energy_uj, scene.lidar.lens_diameter_mm) = (4.0, 4.0);
        let light = light(&scene);
        let echoes = light.segments().flat_map(|segment| segment.echoes());
        echoes.map(|echo| echo.photons).collect()
    };
    let (faint, bright) = (echoes(1.0), echoes(1e4));
    assert_eq!(bright[0], MOST_PER_ECHO);
    assert!(faint[0] < MOST_PER_ECHO && faint.iter().sum::<f64>() > 10.0);
    let wall = |echoes: &[f64]| echoes[1..].iter().sum::<f64>();
    let before: f64 = echoes(2.0).iter().sum::<f64>() - faint.iter().sum::<f64>();
    let of_wall = faint.iter().sum::<f64>() - before;
    assert!(
        (wall(&bright) / of_wall - 1.0).abs() < 1e-9,
        "{bright:?} {faint:?}"
    );
}

#[test]
fn light_follows_range_and_dark_counts_add() {
    let mut scene = Scene::outdoor();
    let truth = GroundTruth::render(&scene, 8, 8);
    let before = scene.pixel_light(&truth);
    scene.lidar.dark_count_hz += 1000.0;
    let after = scene.pixel_light(&truth);
    for (pixel, (a, b)) in before.iter().zip(&after).enumerate() {
        assert!((b.background_hz() - a.background_hz() - 1000.0).abs() < 1e-6);
        if let [surface] = truth.surfaces[pixel][..]
            && a.is_plain()
        {
            assert!((a.arrival().as_range_m() - surface.range_m).abs() < 1e-6);
        }
    }
}

/// A wall at 50 m on the axis, tilted by this angle, before one macropixel of 0.25 degrees.
fn tilted(tilt_deg: f64, size_m: f64) -> Scene {
    let mut scene = Scene::outdoor();
    scene.lidar.fov_deg = 0.25;
    // All of a pulse goes into the one macropixel.
    scene.lidar.pulse_energy_uj = 1e-3;
    let (sine, cosine) = tilt_deg.to_radians().sin_cos();
    let shape = Shape::Plane {
        centre_m: DVec3::new(0.0, 0.0, 50.0),
        normal: DVec3::new(0.0, sine, cosine),
        width_m: size_m,
        height_m: size_m,
    };
    scene.objects = vec![Object::new("wall", 0.4, shape)];
    scene
}

fn light(scene: &Scene) -> PixelLight {
    let truth = GroundTruth::render(scene, 1, 1);
    scene.pixel_light(&truth).swap_remove(0)
}

proptest! {
    #[test]
    fn a_tilted_wall_returns_the_cosine(tilt_deg in 0.0f64..80.0) {
        let ratio = light(&tilted(tilt_deg, 1e3)).signal_per_cycle()
            / light(&tilted(0.0, 1e3)).signal_per_cycle();
        let cosine = tilt_deg.to_radians().cos();
        // Rays that meet it nearer return more than those that meet it farther away lack.
        prop_assert!((ratio / cosine - 1.0).abs() < 2e-3, "{tilt_deg} degrees: {ratio} {cosine}");
    }

    /// Nothing is lost or made where macropixels are divided: what a coarse array detects, a fine one does.
    #[test]
    fn light_does_not_depend_on_how_the_view_is_divided(fine in 2u32..6, offset_m in -0.1f64..0.1) {
        let mut scene = tilted(40.0, 0.15);
        scene.objects[0].shape = scene.objects[0].shape.clone().shifted(DVec3::new(offset_m, 0.0, 0.0));
        let sum = |across: u32| -> (f64, f64) {
            let truth = GroundTruth::render(&scene, across, across);
            let lights = scene.pixel_light(&truth);
            let signal = lights.iter().map(PixelLight::signal_per_cycle).sum();
            let hz: f64 = lights.iter().map(PixelLight::background_hz).sum();
            (signal, hz - f64::from(across * across) * scene.lidar.dark_count_hz)
        };
        let (coarse, divided) = (sum(8), sum(8 * fine));
        prop_assert!((coarse.0 / divided.0 - 1.0).abs() < 0.02, "{coarse:?} {divided:?}");
        prop_assert!((coarse.1 / divided.1 - 1.0).abs() < 0.02, "{coarse:?} {divided:?}");
    }
}

#[test]
fn what_moves_has_light_of_segments_and_the_rest_has_not() {
    let mut scene = Scene::outdoor();
    let spads = SpadModel::with_dead_time(Time::from_ns(8));
    let truth = GroundTruth::render(&scene, 32, 32);
    let still = scene.light_during(&truth, &spads, 16_000, 12.5e-6);
    assert_eq!(still, scene.pixel_light(&truth));
    let truck = scene
        .objects
        .iter()
        .position(|o| o.name == "truck")
        .unwrap();
    scene.objects[truck].velocity_m_s = DVec3::new(0.0, 0.0, -15.0);
    let truth = GroundTruth::render(&scene.snapshot(0.1), 32, 32);
    let moving = scene.light_during(&truth, &spads, 16_000, 12.5e-6);
    let mut seen = 0;
    for (pixel, (a, b)) in still.iter().zip(&moving).enumerate() {
        if truth.surfaces[pixel].iter().all(|s| s.object != truck) && a != b {
            // Only what the truck hides or gives free.
            assert!(b.segments().count() > 1);
        }
        let [surface] = truth.surfaces[pixel][..] else {
            continue;
        };
        if surface.object == truck && b.segments().all(|s| s.echoes().count() == 1) {
            seen += 1;
            let arrivals: Vec<f64> = (b.segments())
                .map(|s| s.echoes().next().unwrap().arrival.as_range_m())
                .collect();
            let way_m = arrivals[0] - arrivals[arrivals.len() - 1];
            // 3 m in 0.2 s, less the first and last half of a segment.
            assert!((2.5..3.2).contains(&way_m), "{way_m}");
        }
    }
    assert!(seen > 0);
    let unchanged = still.iter().zip(&moving).filter(|(a, b)| a == b).count();
    assert!(unchanged > 900, "{unchanged}");
}

/// What crosses over to a dark macropixel, beside the avalanches at the side of its bright neighbour.
#[test]
fn crosstalk_into_a_neighbour_is_that_of_the_avalanches_at_its_side() {
    use crate::photon::{PhotonStream, StreamConfig};
    use crate::units::Frequency;

    const CYCLES: u32 = 4000;
    for photons in [0.1, 2.0, 12.0] {
        let spads = SpadModel {
            crosstalk_probability: 0.04,
            ..SpadModel::with_dead_time(Time::from_ns(8))
        };
        let bright = Falling {
            glints: vec![Glint {
                photons,
                arrival_fs: 3e8,
                variance_fs2: 0.0,
                surface: 0,
            }],
            background_hz: 20e6,
            trains: Vec::new(),
        };
        let dark = Falling {
            glints: Vec::new(),
            background_hz: 0.0,
            trains: Vec::new(),
        };
        let crossed = with_crosstalk(&[bright, dark], &spads, 2).swap_remove(1);
        let stream = PhotonStream::new(&StreamConfig {
            seed: 5,
            clock: Frequency::from_hz(400_000_000),
            stop_periods: 200,
            laser_cycles: CYCLES,
            lead: Time::ZERO,
            pulse_sigma: Time::from_ns(1),
            pulse_shape: None,
            energy_spread: 0.0,
            spads: SpadModel {
                crosstalk_probability: 0.0,
                ..spads
            },
        });
        let light = PixelLight::echo(photons, Time::from_ns(300)).with_background(20e6);
        let events = stream.pixel_events(0, &light).events;
        let at_side = events.iter().filter(|event| event.spad % 4 == 3).count() as f64;
        let expected = at_side * spads.crosstalk_probability / 4.0 / f64::from(CYCLES);
        let given = crossed.glints[0].photons + crossed.background_hz * 500e-9;
        let noise = 5.0 / at_side.sqrt();
        // Echo and background blind each other, which the sum leaves out.
        assert!(
            (given / expected - 1.0).abs() < noise + 0.02,
            "{photons}: {given} {expected}"
        );
        assert_eq!(
            crossed.glints[0].arrival_fs,
            3e8 + CROSSTALK_DELAY.as_fs() as f64
        );
    }
}

/// SPADs that a strong echo has fired are ready again for the next one, whose avalanches cross over as if it were alone.
#[test]
fn crosstalk_of_an_echo_does_not_depend_on_one_before_it() {
    let glint = |photons: f64, at_ns: f64| Glint {
        photons,
        arrival_fs: 1e6 * at_ns,
        variance_fs2: 0.0,
        surface: at_ns as usize,
    };
    let avalanches = |before: f64| -> Vec<f64> {
        let falling = Falling {
            glints: vec![
                glint(5.0, 320.0),
                glint(before, 300.0),
                glint(before, 302.0),
            ],
            background_hz: 0.0,
            trains: Vec::new(),
        };
        let glints = falling.avalanches(16.0, 8e6);
        glints.iter().map(|glint| glint.photons).collect()
    };
    let alone = 16.0 * -libm::expm1(-5.0 / 16.0);
    for before in [0.0, 1.0, 1000.0] {
        let found = avalanches(before);
        assert!((found[2] - alone).abs() < 1e-9, "{found:?}");
        let both = 16.0 * -libm::expm1(-2.0 * before / 16.0);
        assert!((found[0] + found[1] - both).abs() < 1e-9, "{found:?}");
    }
}

fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2)
}

/// The street's macropixels beside 64 × 64 rays each, every one with a pulse of its own.
#[test]
fn light_of_few_rays_is_close_to_that_of_very_many() {
    const FINE: u32 = 64;
    let scene = Scene::outdoor();
    let (rows, cols) = (64, 64);
    let truth = GroundTruth::render(&scene, rows, cols);
    let lights = scene.pixel_light(&truth);
    let camera = scene.lidar_camera(rows, cols);
    let budget = scene.photon_budget(rows, cols);
    let sigma_fs = scene.pulse_sigma().as_fs() as f64;
    let brightest = lights
        .iter()
        .map(PixelLight::signal_per_cycle)
        .fold(0.0, f64::max);
    let (mut off, mut worst_photons, mut plain) = (Vec::new(), 0f64, 0);
    for pixel in (0..rows * cols).step_by(23) {
        let (row, col) = (pixel / cols, pixel % cols);
        let place = |first: u32, n: u32| f64::from(first) + (f64::from(n) + 0.5) / f64::from(FINE);
        let exact: Vec<(f64, f64)> = (0..FINE * FINE)
            .filter_map(|n| {
                let at = (place(col, n % FINE), place(row, n / FINE));
                let ray = Ray::new(DVec3::ZERO, camera.at_unit_depth(at));
                let hit = scene.hit(&ray)?;
                let cosine = -hit.normal.dot(ray.direction);
                let photons = budget.signal_per_pulse(hit.range_m, hit.reflectivity) * cosine;
                Some((
                    photons / f64::from(FINE * FINE),
                    hit.range_m * FLIGHT_FS_PER_M,
                ))
            })
            .collect();
        let light = &lights[pixel as usize];
        let photons: f64 = exact.iter().map(|(photons, _)| photons).sum();
        worst_photons = worst_photons.max((light.signal_per_cycle() - photons).abs() / brightest);
        // Of slivers, as many photons as rays are missed.
        if exact.len() < (FINE * FINE / 8) as usize {
            continue;
        }
        let mut worst = 0f64;
        plain += u32::from(light.is_plain());
        let (first, last) = exact
            .iter()
            .fold((f64::MAX, 0f64), |(a, b), e| (a.min(e.1), b.max(e.1)));
        let (first, last) = (first - 4.0 * sigma_fs, last + 4.0 * sigma_fs);
        let steps = 40;
        for step in 0..=steps {
            let time_fs = first + (last - first) * f64::from(step) / f64::from(steps);
            let early = |photons: f64, centre_fs: f64, sigma_fs: f64| {
                photons * normal_cdf((time_fs - centre_fs) / sigma_fs)
            };
            let all: f64 = exact
                .iter()
                .map(|&(n, at_fs)| early(n, at_fs, sigma_fs))
                .sum();
            let few: f64 = light
                .segments()
                .flat_map(|segment| segment.echoes())
                .map(|e| {
                    early(
                        e.photons,
                        e.arrival.as_fs() as f64,
                        e.sigma.unwrap().as_fs() as f64,
                    )
                })
                .sum();
            worst = worst.max((all - few).abs() / photons);
        }
        off.push(worst);
    }
    off.sort_by(f64::total_cmp);
    let quantile = |share: f64| off[(share * (off.len() - 1) as f64) as usize];
    println!(
        "median {:.4}, 90 % {:.4}, worst {:.4} of a macropixel's photons, {worst_photons:.4} of the brightest; {plain} of {} have one echo",
        quantile(0.5),
        quantile(0.9),
        quantile(1.0),
        off.len()
    );
    assert!(quantile(0.5) < 0.002 && quantile(0.9) < 0.02 && worst_photons < 0.01);
}
