//! What merging rays into echoes costs in depth: depths from a macropixel's light beside those from 64 × 64 rays, each with a
//! pulse of its own. Counts are drawn from the mean of every bin, without pile-up, and ranged as a frame's are.

use guided_dtof::chip::{Exposure, Sensor, SensorConfig, WindowLaw};
use guided_dtof::photon::PixelLight;
use guided_dtof::ranging::{DepthOptions, EchoFinder};
use guided_dtof::scene::{DVec3, GroundTruth, Object, Ray, Scene, Shape};
use guided_dtof::units::SPEED_OF_LIGHT_M_PER_S;
use guided_dtof::units::TimeOfFlight;

const FINE: u32 = 64;
const BINS: usize = 16;
/// Laser cycles that the finder is told: enough that no bin is filled twice in one.
const LASER_CYCLES: u32 = 16_000;

/// Light of Gaussian pulses: photons, range and standard deviation of each, m.
type Pulses = Vec<[f64; 3]>;

/// What 64 × 64 rays of a macropixel meet.
fn of_rays(scene: &Scene, (rows, cols): (u32, u32), (row, col): (u32, u32)) -> Pulses {
    let camera = scene.lidar_camera(rows, cols);
    let budget = scene.photon_budget(rows, cols);
    let sigma_m = scene.pulse_sigma().as_range_m();
    let place = |first: u32, n: u32| f64::from(first) + (f64::from(n) + 0.5) / f64::from(FINE);
    let rays = (0..FINE * FINE).filter_map(|n| {
        let at = (place(col, n % FINE), place(row, n / FINE));
        let ray = Ray::new(DVec3::ZERO, camera.at_unit_depth(at));
        let hit = scene.hit(&ray)?;
        let cosine = hit.normal.dot(ray.direction).abs();
        let photons = budget.signal_per_pulse(hit.range_m, hit.reflectivity) * cosine;
        Some([photons / f64::from(FINE * FINE), hit.range_m, sigma_m])
    });
    rays.collect()
}

fn of_light(light: &PixelLight) -> Pulses {
    let echoes = light.segments().flat_map(|segment| segment.echoes());
    let pulse = |echo: &guided_dtof::photon::Echo| {
        let sigma_m = echo.sigma.unwrap().as_range_m();
        [echo.photons, echo.arrival.as_range_m(), sigma_m]
    };
    echoes.map(pulse).collect()
}

fn photons(pulses: &Pulses) -> f64 {
    pulses.iter().map(|pulse| pulse[0]).sum()
}

fn mean_m(pulses: &Pulses) -> f64 {
    pulses.iter().map(|[n, at_m, _]| n * at_m).sum::<f64>() / photons(pulses)
}

/// Splitmix64, as a number from 0 to 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Errors of depths, m: how many, their sum and squares, and how many are beyond a bin.
#[derive(Default)]
struct Errors {
    number: f64,
    sum_m: f64,
    squares_m2: f64,
    beyond: f64,
}

impl Errors {
    fn mean_m(&self) -> f64 {
        self.sum_m / self.number
    }

    fn rms_m(&self) -> f64 {
        (self.squares_m2 / self.number).sqrt()
    }

    fn beyond(&self) -> f64 {
        self.beyond / self.number
    }

    /// Adds the depths of `trials` histograms with `counts` counts of `pulses` and `background` counts a bin, about
    /// the range `true_m`, which lies anywhere relative to the bins.
    fn add(&mut self, pulses: &Pulses, true_m: f64, [counts, background]: [f64; 2], trials: u32) {
        let sensor = Sensor::from(SensorConfig::default());
        let law = WindowLaw::new(&sensor, &Exposure::new(&sensor, 520, LASER_CYCLES));
        let sigma = Scene::outdoor().pulse_sigma();
        let finder = EchoFinder::new(&law, sigma, &DepthOptions::default()).unwrap();
        let bin_m = finder.bin_s * SPEED_OF_LIGHT_M_PER_S / 2.0;
        let all = photons(pulses);
        let mut random = Random(5);
        const PLACES: u32 = 20;
        for place in 0..PLACES {
            let true_bins = 7.0 + f64::from(place) / f64::from(PLACES);
            let before = |edge: usize| -> f64 {
                let edge_m = (edge as f64 - 0.5 - true_bins) * bin_m + true_m;
                let share = |&[n, at_m, sigma_m]: &[f64; 3]| {
                    0.5 * n * libm::erfc((at_m - edge_m) / (sigma_m * std::f64::consts::SQRT_2))
                };
                pulses.iter().map(share).sum::<f64>() / all * counts
            };
            let edges: Vec<f64> = (0..=BINS)
                .map(|edge| before(edge) - before(0) + background * edge as f64)
                .collect();
            for _ in 0..trials / PLACES {
                let mut histogram = [0u32; BINS];
                // A Poisson process over the bins, laid end to end.
                let mut at = -(1.0 - random.next()).ln();
                while at < edges[BINS] {
                    histogram[edges.partition_point(|&edge| edge <= at) - 1] += 1;
                    at -= (1.0 - random.next()).ln();
                }
                let found = finder.find(&histogram).filter(|s| s.is_significant);
                let Some(found) = found else { continue };
                let off_m = (found.position_bins - true_bins) * bin_m;
                self.number += 1.0;
                self.sum_m += off_m;
                self.squares_m2 += off_m * off_m;
                self.beyond += f64::from(u8::from(off_m.abs() > bin_m));
            }
        }
    }
}

/// A plane 50 m away that fills a macropixel of 0.25 degrees, so deep there, and slanted towards this side.
fn slanted(depth_m: f64, turn_deg: f64) -> Scene {
    let mut scene = Scene::outdoor();
    scene.lidar.fov_deg = 0.25;
    let (sine, cosine) = turn_deg.to_radians().sin_cos();
    // Across the macropixel the range changes by so much in all, along both of its sides.
    let side_m = 50.0 * 2.0 * 0.125f64.to_radians().tan();
    let slope = depth_m / side_m / (sine.abs() + cosine.abs());
    let shape = Shape::Plane {
        centre_m: DVec3::new(0.0, 0.0, 50.0),
        normal: DVec3::new(slope * cosine, slope * sine, -1.0),
        width_m: 1e3,
        height_m: 1e3,
    };
    scene.objects = vec![Object::new("plane", 0.4, shape)];
    scene
}

#[test]
fn a_slanted_plane_is_ranged_as_from_all_its_rays() {
    for (depth_m, turn_deg, counts, trials) in [
        (0.5, 90.0, 3000.0, 400),
        (3.0, 14.0, 3000.0, 1000),
        (3.0, 45.0, 3000.0, 1000),
        (3.0, 135.0, 3000.0, 1000),
        (1.1, 90.0, 300.0, 2000),
        (1.1, 90.0, 3000.0, 1000),
        (1.5, 0.0, 3000.0, 1000),
        (2.0, 90.0, 3000.0, 1000),
        (3.0, 90.0, 300.0, 2000),
        (3.0, 90.0, 3000.0, 1000),
        (3.0, 0.0, 3000.0, 1000),
        (5.0, 90.0, 3000.0, 1000),
    ] {
        let scene = slanted(depth_m, turn_deg);
        let rays = of_rays(&scene, (1, 1), (0, 0));
        let truth = GroundTruth::render(&scene, 1, 1);
        let light = of_light(&scene.pixel_light(&truth)[0]);
        let true_m = mean_m(&rays);
        assert!((mean_m(&light) - true_m).abs() < 0.005 * depth_m);
        let [mut exact, mut found] = [Errors::default(), Errors::default()];
        exact.add(&rays, true_m, [counts, 20.0], trials);
        found.add(&light, true_m, [counts, 20.0], trials);
        println!(
            "{depth_m} m towards {turn_deg}°, {counts} counts, {} echoes: mean {:+.3} m for {:+.3}, RMS {:.3} for {:.3}, beyond a bin {:.3} for {:.3}",
            light.len(),
            found.mean_m(),
            exact.mean_m(),
            found.rms_m(),
            exact.rms_m(),
            found.beyond(),
            exact.beyond()
        );
        // Four standard deviations of what is drawn, and what the constants of `photon/mixture` allow.
        let share = exact.number / f64::from(trials);
        let noise = 4.0 * (2.0 * share * (1.0 - share) / f64::from(trials)).sqrt();
        assert!((found.number / f64::from(trials) - share).abs() <= noise);
        let noise = 4.0 * exact.rms_m() / found.number.sqrt();
        assert!((found.mean_m() - exact.mean_m()).abs() < 0.003 + noise);
        assert!((found.rms_m() - exact.rms_m()).abs() < 0.006 + noise);
        let share = exact.beyond();
        let noise = 4.0 * (2.0 * share * (1.0 - share) / found.number).sqrt();
        assert!((found.beyond() - share).abs() < 0.01 + noise);
    }
}

#[test]
fn the_road_of_the_street_is_ranged_as_from_all_its_rays() {
    let scene = Scene::outdoor();
    let truth = GroundTruth::render(&scene, 64, 64);
    let lights = scene.pixel_light(&truth);
    let [mut exact, mut found] = [Errors::default(), Errors::default()];
    let (mut deepest_m, mut pixels) = (0f64, 0);
    for pixel in (0..64 * 64).step_by(3) {
        let [surface] = truth.surfaces[pixel as usize][..] else {
            continue;
        };
        let is_road = scene.objects[surface.object].name == "road";
        if !is_road || !(33.0..38.0).contains(&surface.range_m) {
            continue;
        }
        let rays = of_rays(&scene, (64, 64), (pixel / 64, pixel % 64));
        let light = &lights[pixel as usize];
        let true_m = mean_m(&rays);
        let (least_m, most_m) = rays.iter().fold((f64::MAX, 0f64), |(a, b), ray| {
            (a.min(ray[1]), b.max(ray[1]))
        });
        deepest_m = deepest_m.max(most_m - least_m);
        pixels += 1;
        let counts = 1000.0 * photons(&rays);
        let background = 1000.0 * light.background_hz() / 384e6;
        exact.add(&rays, true_m, [counts, background], 100);
        found.add(&of_light(light), true_m, [counts, background], 100);
    }
    println!(
        "{pixels} macropixels, {deepest_m:.2} m deep: {} and {} depths, mean {:+.3} m for {:+.3}, RMS {:.3} for {:.3}, beyond a bin {:.3} for {:.3}",
        found.number,
        exact.number,
        found.mean_m(),
        exact.mean_m(),
        found.rms_m(),
        exact.rms_m(),
        found.beyond(),
        exact.beyond()
    );
    assert!(pixels > 20 && deepest_m > 2.0);
    assert!((found.number / exact.number - 1.0).abs() < 0.02);
    assert!((found.mean_m() - exact.mean_m()).abs() < 0.03);
    assert!((found.rms_m() / exact.rms_m() - 1.0).abs() < 0.05);
    assert!((found.beyond() - exact.beyond()).abs() < 0.03);
}
