//! Early light of fog: what droplets before a surface send back of every laser pulse.
//!
//! ```text
//!   rate   ▇
//!          █▆▅▄▃▃▂▂▂▁▁▁▁▁▁▁▁▁▁│      falls as 1/z² and with the fog's own transmission, until the surface
//!          ├┼─┼──┼───┼────────┤
//!           echoes    profile        near cells outshine the daylight and are echoes of their own width; the rest is background
//! ```
//!
//! In dim light a profile is drawn at its greatest rate all the time and thinned, so that the glare of the first metres is not part of it.

use super::settings::Scene;
use crate::photon::{Echo, PhotonBudget, PixelLight, Profile};
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time, TimeOfFlight};

/// The end of a cell is this many times as far away as its beginning. An echo has the mean and the variance of its
/// cell, so that only what is finer than the cell is lost: at its edges, a tenth of the rate.
const GROWTH: f64 = 1.3;

/// Nor is a cell deeper than that over the extinction: light that falls by a fifth is taken for even.
const DEPTH: f64 = 0.1;

/// Beyond that share of the light, there and back, fog is not followed.
const LEAST_TRANSMISSION: f64 = 1e-4;

/// Nor farther away, m.
const FARTHEST_M: f64 = 1000.0;

/// What fog sends back where no surface ends it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fog {
    edges_m: Vec<f64>,
    /// Photons a pulse of each cell, on the axis.
    photons: Vec<f64>,
}

/// Where the rays of a macropixel leave the fog, and their share of all rays.
pub(super) type Ends = [(f64, f64)];

impl Fog {
    /// Of the scene's medium; `None` if it sends nothing back.
    pub(super) fn from_scene(scene: &Scene, budget: &PhotonBudget) -> Option<Self> {
        let medium = &scene.medium;
        if medium.backscatter_1_m_sr() <= 0.0 {
            return None;
        }
        // The lens is no point: nearer than this the budget gives no more.
        let mut edges_m = vec![medium.overlap_m.max(budget.lens_diameter_m).max(1e-3)];
        let thinning_m = DEPTH / medium.total_extinction_1_m();
        let last = |edges_m: &[f64]| edges_m[edges_m.len() - 1];
        while last(&edges_m) < FARTHEST_M
            && medium.transmission(last(&edges_m)).powi(2) > LEAST_TRANSMISSION
        {
            let step_m = (GROWTH - 1.0) * last(&edges_m);
            edges_m.push(last(&edges_m) + step_m.min(thinning_m));
        }
        let surface = |range_m, reflectivity| budget.signal_per_pulse(range_m, reflectivity);
        let photons = medium.backscatter(&edges_m, f64::MAX, surface);
        (!photons.is_empty()).then_some(Fog { edges_m, photons })
    }

    /// Adds it to the light of a macropixel whose rays end there. `centre_fs` is when the centre of the laser pulse comes in its own
    /// time, `sigma` the standard deviation of its Gaussian part, `gain` what the macropixel gets relative to one on the axis.
    pub(super) fn add_to(
        &self,
        mut light: PixelLight,
        ends: &Ends,
        gain: f64,
        sigma: Time,
        centre_fs: f64,
    ) -> PixelLight {
        let daylight_hz = light.background_hz();
        let (mut edges, mut rates_hz) = (Vec::new(), Vec::new());
        for (cell, &photons) in self.edges_m.windows(2).zip(&self.photons) {
            let [from_m, to_m] = [cell[0], cell[1]];
            let within = |end_m: f64| ((end_m - from_m) / (to_m - from_m)).clamp(0.0, 1.0);
            let seen: f64 = ends
                .iter()
                .map(|&(end_m, share)| share * within(end_m))
                .sum();
            let photons = photons * gain * seen;
            let [from, to] = [from_m, to_m].map(Time::of_flight);
            let rate_hz = photons / (to - from).as_s();
            if photons <= 0.0 {
                continue;
            }
            if rate_hz > daylight_hz && rates_hz.is_empty() {
                // Mean and mean square of z over the cell, where light falls as 1/z².
                let mean_m = libm::log(to_m / from_m) * from_m * to_m / (to_m - from_m);
                let variance_m2 = (from_m * to_m - mean_m * mean_m).max(0.0);
                let fs_per_m = 2e15 / SPEED_OF_LIGHT_M_PER_S;
                let sigma_fs = libm::hypot(sigma.as_fs() as f64, variance_m2.sqrt() * fs_per_m);
                let arrival_fs = mean_m * fs_per_m - centre_fs;
                let echo = Echo::new(photons, Time::from_fs(arrival_fs.round() as i64));
                light = light.with_echo(echo.with_sigma(Time::from_fs(sigma_fs.round() as i64)));
                continue;
            }
            if edges.is_empty() {
                edges.push(from);
            }
            edges.push(to);
            rates_hz.push(rate_hz);
        }
        match Profile::new(&edges, &rates_hz) {
            Ok(profile) => light.with_profile(profile),
            // None of it is left beyond the glare.
            Err(_) => light,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{GroundTruth, Medium};

    fn foggy() -> Scene {
        let mut scene = Scene::outdoor();
        scene.medium = Medium {
            extinction_1_m: 3.912 / 100.0,
            ..Medium::default()
        };
        scene
    }

    #[test]
    fn fog_weakens_echoes_and_sends_back_early_light() {
        let (clear, foggy) = (Scene::outdoor(), foggy());
        let truth = |scene: &Scene| GroundTruth::render(scene, 16, 16);
        let lights = |scene: &Scene| scene.pixel_light(&truth(scene));
        let [of_clear, of_fog] = [&clear, &foggy].map(lights);
        let budget = foggy.photon_budget(16, 16);
        let glare = Fog::from_scene(&foggy, &budget).unwrap();
        let truth = truth(&foggy);
        for pixel in 0..256 {
            let echoes = |light: &PixelLight| -> Vec<Echo> {
                light
                    .segments()
                    .flat_map(|s| s.echoes().cloned().collect::<Vec<_>>())
                    .collect()
            };
            let (before, after) = (echoes(&of_clear[pixel]), echoes(&of_fog[pixel]));
            // The surface's own echoes come first.
            let Some(range_m) = truth.range_m[pixel] else {
                continue;
            };
            let left = foggy.medium.transmission(range_m).powi(2);
            let is_flat = before.len() == 1
                && before[0].sigma.unwrap() < Time::from_s(1.05 * clear.pulse_sigma().as_s());
            if is_flat && truth.surfaces[pixel].len() == 1 {
                let found = after[0].photons / before[0].photons;
                assert!(
                    (found / left - 1.0).abs() < 0.05,
                    "{found} {left} at {range_m} m"
                );
            }
            // What comes back besides is all the fog up to there.
            let profile = of_fog[pixel]
                .segments()
                .next()
                .unwrap()
                .profile
                .as_ref()
                .unwrap();
            let sent = of_fog[pixel].signal_per_cycle() + profile.photons(0.0, 1e13);
            let all: f64 = glare.photons.iter().sum();
            let surfaces = of_clear[pixel].signal_per_cycle();
            assert!(
                sent <= 1.001 * all + surfaces && sent > 0.9 * all,
                "{sent} of {all}"
            );
        }
    }

    /// Rate of early light over time beside the law, each cell's echo and the profile summed up.
    #[test]
    fn early_light_follows_the_law_of_fog() {
        let scene = foggy();
        let budget = scene.photon_budget(64, 64);
        let fog = Fog::from_scene(&scene, &budget).unwrap();
        let sigma = scene.pulse_sigma();
        let dim = PixelLight::background(1e6);
        let light = fog.add_to(dim, &[(60.0, 1.0)], 1.0, sigma, 0.0);
        let segment = light.segments().next().unwrap();
        let profile = segment.profile.as_ref().unwrap();
        let below = |z: f64| 0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2);
        let before = |range_m: f64| -> f64 {
            let time_fs = Time::of_flight(range_m).as_fs() as f64;
            let echo = |e: &Echo| {
                let sigma_fs = e.sigma.unwrap().as_fs() as f64;
                e.photons * below((time_fs - e.arrival.as_fs() as f64) / sigma_fs)
            };
            segment.echoes().map(echo).sum::<f64>() + profile.photons(0.0, time_fs)
        };
        for range_m in [4.0, 8.0, 15.0, 30.0, 50.0] {
            let (near_m, far_m) = (range_m, 1.4 * range_m);
            let surface = |range_m, reflectivity| budget.signal_per_pulse(range_m, reflectivity);
            let edges: Vec<f64> = (0..=40)
                .map(|i| near_m + (far_m - near_m) * f64::from(i) / 40.0)
                .collect();
            let exact: f64 = scene.medium.backscatter(&edges, 60.0, surface).iter().sum();
            let found = before(far_m) - before(near_m);
            assert!(
                (found / exact - 1.0).abs() < 0.12,
                "from {near_m} m: {found} {exact}"
            );
        }
        assert!((before(200.0) / before(60.0) - 1.0).abs() < 1e-2);
    }
}
