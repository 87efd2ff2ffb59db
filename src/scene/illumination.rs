//! From surfaces to light: what every macropixel detects.

use std::ops::Range;

use rayon::prelude::*;

use super::fog::Fog;
use super::optics::OffAxis;
use super::settings::Scene;
use super::truth::{Glimpse, GroundTruth, View};
use crate::photon::{CROSSTALK_DELAY, Glint, PhotonBudget, PixelLight, SpadModel, merged};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// The sky has no reflectivity, but it is not dark: it counts as a surface of this reflectivity
/// in sunlight that returns no echo. A tenth of a white wall is of the order of a clear sky in
/// the near infrared; haze is brighter.
pub const SKY_REFLECTIVITY: f64 = 0.1;

/// Most signal photons per cycle that are modelled. Sixteen SPADs saturate long before, and a
/// surface right before the lens would ask for 10¹⁰.
const MOST_SIGNAL_PER_CYCLE: f64 = 1e4;

/// Highest background rate that is modelled, far beyond saturation.
const MOST_BACKGROUND_HZ: f64 = 1e11;

/// Femtoseconds that light takes for a metre there and back.
const FLIGHT_FS_PER_M: f64 = 2e15 / SPEED_OF_LIGHT_M_PER_S;

/// Part of the laser pulse's standard deviation by which a surface may move within a segment of an exposure.
const STEP_OF_MOTION: f64 = 0.5;

/// Part of a macropixel by which the lidar may turn within a segment.
const STEP_OF_TURN: f64 = 0.5;

/// Most segments of an exposure in which something moves: each needs a look at the scene.
const MOST_SEGMENTS: u32 = 64;

impl Scene {
    /// The light on every macropixel, in the order of `truth`, of SPADs that are alike and have no crosstalk.
    ///
    /// Background is sunlight from the surfaces (Eq. 16) and from the sky, plus dark counts. Signal is Eq. 15 times the
    /// cosine of the angle at which the laser meets a surface, which the thesis leaves out, summed over the rays of the macropixel;
    /// rays that the pulse does not resolve make one echo ([`merged`]). The laser fires with the STOP edge, so an echo
    /// arrives after its time of flight. Light far beyond saturation is cut at 10⁴ photons per
    /// pulse and 10¹¹ per second.
    pub fn pixel_light(&self, truth: &GroundTruth) -> Vec<PixelLight> {
        self.light_on(truth, &SpadModel::default())
    }

    /// The light of an exposure of `laser_cycles` of `cycle_s` seconds each on macropixels with these SPADs, in the order of `truth`: of
    /// segments where something moves, with crosstalk from neighbouring macropixels, and with SPADs that differ.
    ///
    /// Crosstalk that leaves a macropixel adds to its neighbour's light what of its avalanches at that side crosses over, as a
    /// light of its own: which avalanche it was that crossed is not followed. One macropixel's crosstalk goes to the four
    /// beside it.
    pub fn light_during(
        &self,
        truth: &GroundTruth,
        spads: &SpadModel,
        laser_cycles: u32,
        cycle_s: f64,
    ) -> Vec<PixelLight> {
        let focal_px = self.lidar_camera(truth.rows, truth.cols).focal_px;
        let segments = self.segments(laser_cycles, cycle_s, focal_px);
        let lights = match segments.len() {
            1 => self.light_on(truth, spads),
            _ => {
                let seen = segments.iter().map(|cycles| {
                    let middle = 0.5 * (f64::from(cycles.start) + f64::from(cycles.end));
                    let scene = self.at(middle * cycle_s);
                    let truth = GroundTruth::render(&scene, truth.rows, truth.cols);
                    scene.light_on(&truth, spads)
                });
                let starts = segments.iter().map(|cycles| cycles.start);
                let seen: Vec<(u32, Vec<PixelLight>)> = starts.zip(seen).collect();
                (0..truth.views.len())
                    .map(|pixel| timeline(&seen, pixel))
                    .collect()
            }
        };
        let of_own = |(pixel, light): (usize, PixelLight)| match self
            .spad_spread(pixel as u32, spads.grid.spads())
        {
            Some(spread) => light.with_spads(spread),
            None => light,
        };
        lights.into_iter().enumerate().map(of_own).collect()
    }

    /// Laser cycles in each of which the scene may be taken to stand still.
    fn segments(&self, laser_cycles: u32, cycle_s: f64, focal_px: f64) -> Vec<Range<u32>> {
        if self.is_still() {
            return std::iter::once(0..laser_cycles).collect();
        }
        let (way_m, turn_deg) = self.ways_over(f64::from(laser_cycles) * cycle_s);
        let step_m = STEP_OF_MOTION * self.pulse_resolution().as_range_m();
        let macropixel_rad = 1.0 / focal_px;
        let turns = turn_deg.to_radians() / (STEP_OF_TURN * macropixel_rad);
        let wanted = (way_m / step_m.max(1e-6)).max(turns).ceil() as u32;
        let count = wanted.clamp(1, MOST_SEGMENTS.min(laser_cycles.max(1)));
        let edge = |n: u32| (u64::from(laser_cycles) * u64::from(n) / u64::from(count)) as u32;
        (0..count).map(|n| edge(n)..edge(n + 1)).collect()
    }

    fn light_on(&self, truth: &GroundTruth, spads: &SpadModel) -> Vec<PixelLight> {
        let (rows, cols) = (truth.rows, truth.cols);
        let budget = self.photon_budget(rows, cols);
        let off_axis = self.off_axis(&self.lidar_camera(rows, cols));
        let centre_fs = self.pulse_shape().map_or(0.0, |shape| shape.mean_fs());
        let views = truth.views.par_iter().zip(&off_axis);
        let mut falling: Vec<Falling> = views
            .map(|(view, off_axis)| self.falling(view, &budget, off_axis, centre_fs))
            .collect();
        if spads.crosstalk_probability > 0.0 {
            falling = with_crosstalk(&falling, spads, cols as usize);
        }
        let (sigma, resolution) = (self.pulse_sigma(), self.pulse_resolution());
        let fog = Fog::of(self, &budget);
        let light = |(mut falling, (view, off_axis)): (Falling, (&View, &OffAxis))| {
            let echoes = merged(&mut falling.glints, sigma, resolution);
            let background = PixelLight::background(falling.background_hz);
            let light = echoes.into_iter().fold(background, PixelLight::with_echo);
            match &fog {
                Some(fog) => fog.onto(light, &view.ends_m, off_axis.signal, sigma, centre_fs),
                None => light,
            }
        };
        let views = truth.views.par_iter().zip(&off_axis);
        falling.into_par_iter().zip(views).map(light).collect()
    }

    /// What falls on a macropixel.
    fn falling(
        &self,
        view: &View,
        budget: &PhotonBudget,
        off_axis: &OffAxis,
        centre_fs: f64,
    ) -> Falling {
        let klux = self.light.illuminance_klux;
        let sun_hz = budget.background_hz(view.sunlit_reflectivity, klux) * off_axis.background;
        let dark_hz = match self.lidar.has_spread() {
            true => 0.0,
            false => self.lidar.dark_count_hz,
        };
        let glint = |glimpse: &Glimpse| Glint {
            photons: budget.signal_per_pulse(glimpse.range_m, glimpse.frontal_reflectivity)
                * self.medium.transmission(glimpse.range_m).powi(2)
                * off_axis.signal,
            surface: glimpse.object,
            arrival_fs: glimpse.range_m * FLIGHT_FS_PER_M - centre_fs,
            variance_fs2: glimpse.range_m2 * FLIGHT_FS_PER_M * FLIGHT_FS_PER_M,
        };
        let mut glints: Vec<Glint> = view.glimpses.iter().map(glint).collect();
        let all: f64 = glints.iter().map(|glint| glint.photons).sum();
        for glint in &mut glints {
            glint.photons *= (MOST_SIGNAL_PER_CYCLE / all).min(1.0);
        }
        Falling {
            glints,
            background_hz: (sun_hz + dark_hz).min(MOST_BACKGROUND_HZ),
        }
    }
}

/// The light of a macropixel before echoes are merged.
#[derive(Debug, Clone)]
struct Falling {
    glints: Vec<Glint>,
    background_hz: f64,
}

/// The same with what crosses over from the neighbours. Of the avalanches of a SPAD at a side, a fourth of those with crosstalk
/// fire across it; a SPAD has one avalanche of an echo at most.
fn with_crosstalk(falling: &[Falling], spads: &SpadModel, cols: usize) -> Vec<Falling> {
    let (grid, all) = (spads.grid, spads.grid.spads() as f64);
    let dead_s = spads.dead_time.as_s();
    let each = spads.crosstalk_probability / 4.0 / all;
    let (of_side, of_end) = (each * grid.rows() as f64, each * grid.cols() as f64);
    let rows = falling.len() / cols;
    let of = |pixel: usize| {
        let (row, col) = (pixel / cols, pixel % cols);
        let mut own = falling[pixel].clone();
        let neighbours = [
            (col > 0).then(|| (pixel - 1, of_side)),
            (col + 1 < cols).then(|| (pixel + 1, of_side)),
            (row > 0).then(|| (pixel - cols, of_end)),
            (row + 1 < rows).then(|| (pixel + cols, of_end)),
        ];
        for (neighbour, share) in neighbours.into_iter().flatten() {
            let other = &falling[neighbour];
            let photons: f64 = other.glints.iter().map(|glint| glint.photons).sum();
            let fire = -all * (-photons / all).exp_m1() / photons.max(f64::MIN_POSITIVE);
            own.glints.extend(other.glints.iter().map(|glint| Glint {
                photons: glint.photons * fire * share,
                arrival_fs: glint.arrival_fs + CROSSTALK_DELAY.as_fs() as f64,
                ..*glint
            }));
            let ready = 1.0 / (1.0 + other.background_hz * dead_s / all);
            own.background_hz += other.background_hz * ready * share;
        }
        own
    };
    (0..falling.len()).into_par_iter().map(of).collect()
}

/// A macropixel's light over all segments; segments with the same light are one.
fn timeline(seen: &[(u32, Vec<PixelLight>)], pixel: usize) -> PixelLight {
    let mut segments: Vec<(u32, PixelLight)> = Vec::new();
    for (first_cycle, lights) in seen {
        let light = &lights[pixel];
        if segments.last().is_none_or(|(_, before)| before != light) {
            segments.push((*first_cycle, light.clone()));
        }
    }
    if let [(_, still)] = &segments[..] {
        return still.clone();
    }
    PixelLight::timeline(segments).expect("segments begin one after the other, from 0 on")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{DVec3, Object, Ray, Shape};
    use crate::units::Time;
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
        for light in scene.pixel_light(&truth) {
            assert!(light.signal_per_cycle() <= 1.000_001 * MOST_SIGNAL_PER_CYCLE);
            assert!(light.background_hz() <= MOST_BACKGROUND_HZ);
        }
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
        let truth = GroundTruth::render(&scene.at(0.1), 32, 32);
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
            };
            let dark = Falling {
                glints: Vec::new(),
                background_hz: 0.0,
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

    fn below(z: f64) -> f64 {
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
            let place =
                |first: u32, n: u32| f64::from(first) + (f64::from(n) + 0.5) / f64::from(FINE);
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
            worst_photons =
                worst_photons.max((light.signal_per_cycle() - photons).abs() / brightest);
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
                    photons * below((time_fs - centre_fs) / sigma_fs)
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
        let at = |share: f64| off[(share * (off.len() - 1) as f64) as usize];
        println!(
            "median {:.4}, 90 % {:.4}, worst {:.4} of a macropixel's photons, {worst_photons:.4} of the brightest; {plain} of {} have one echo",
            at(0.5),
            at(0.9),
            at(1.0),
            off.len()
        );
        assert!(at(0.5) < 0.02 && at(0.9) < 0.08 && worst_photons < 0.01);
    }
}
