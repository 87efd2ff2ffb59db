//! From surfaces to light: what every macropixel detects.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::falling::Falling;
use super::fog::Fog;
use super::optics::OffAxis;
use super::settings::Scene;
use super::stray_light::with_stray_light;
use super::truth::{GroundTruth, PreviousWorld};
use super::view::{Glimpse, View};
use crate::photon::{
    CROSSTALK_DELAY, Echo, Glint, PhotonBudget, PixelLight, SpadLayout, SpadModel, merged,
};
use crate::units::SPEED_OF_LIGHT_M_PER_S;
use crate::units::TimeOfFlight;

#[cfg(test)]
mod tests;

/// Most photons of an echo per cycle that are modelled. Sixteen SPADs saturate long before, and a
/// surface right before the lens would ask for 10¹⁰.
pub const MOST_PER_ECHO: f64 = 1e4;

/// Most photons per cycle of a ray, so that sums stay finite.
const MOST_PER_RAY: f64 = 1e12;

/// Highest background rate that is modelled, far beyond saturation.
pub const MOST_BACKGROUND_HZ: f64 = 1e11;

/// Whether a macropixel would get more light than is modelled.
pub fn is_beyond_model(light: &PixelLight) -> bool {
    let has_bright = light.segments().any(|segment| {
        let mut echoes = segment.echoes();
        echoes.any(|echo| echo.photons >= MOST_PER_ECHO)
    });
    has_bright || light.background_hz() >= MOST_BACKGROUND_HZ
}

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
    /// arrives after its time of flight. Light far beyond saturation is cut: each echo at 10⁴ photons per
    /// pulse, whatever the others have, and background at 10¹¹ per second.
    pub fn pixel_light(&self, truth: &GroundTruth) -> Vec<PixelLight> {
        self.light_on(truth, &SpadModel::default(), None)
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
        if segments.len() == 1 {
            return self.light_after(truth, spads, None);
        }
        let mut seen: Vec<(u32, Vec<PixelLight>)> = Vec::new();
        let mut last: Option<(Scene, GroundTruth)> = None;
        for cycles in segments {
            let middle = 0.5 * (f64::from(cycles.start) + f64::from(cycles.end));
            let world = self.snapshot(middle * cycle_s);
            let before = last
                .as_ref()
                .map(|(world, truth)| PreviousWorld { world, truth });
            let (truth, _) = GroundTruth::render_after(&world, truth.rows, truth.cols, before);
            let light = seen.last().map(|(_, light)| light.as_slice());
            let light = world.light_on(&truth, spads, before.zip(light));
            seen.push((cycles.start, light));
            last = Some((world, truth));
        }
        let lights = (0..truth.views.len()).map(|pixel| timeline(&seen, pixel));
        self.on_own_spads(lights.collect(), spads)
    }

    /// As [`Scene::light_during`], on any number of SPADs: `spads` is the model of the layout's grid. Crosstalk between macropixels is
    /// that of the grid's sides.
    ///
    /// # Panics
    /// When `spads` has another grid than the layout.
    pub fn light_on_layout(
        &self,
        truth: &GroundTruth,
        (spads, layout): (&SpadModel, SpadLayout),
        laser_cycles: u32,
        cycle_s: f64,
    ) -> Vec<PixelLight> {
        assert_eq!(spads.grid, layout.grid());
        let lights = self.light_during(truth, spads, laser_cycles, cycle_s);
        if layout.is_full() {
            return lights;
        }
        let own = |(pixel, light): (usize, PixelLight)| {
            let spread = self.spad_spread(pixel as u32, layout.spads());
            let lit = layout.place_light(light, spread.as_ref());
            lit.expect("as many SPADs as the layout has")
        };
        lights.into_iter().enumerate().map(own).collect()
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

    /// The light of a world that stands still, as [`Scene::light_during`]. A macropixel keeps its light of a world `before` where it
    /// sees the same, but for crosstalk, which its neighbours have a part in.
    pub fn light_after(
        &self,
        truth: &GroundTruth,
        spads: &SpadModel,
        before: Option<(PreviousWorld<'_>, &[PixelLight])>,
    ) -> Vec<PixelLight> {
        self.on_own_spads(self.light_on(truth, spads, before), spads)
    }

    /// Light on SPADs that differ, if they do.
    fn on_own_spads(&self, lights: Vec<PixelLight>, spads: &SpadModel) -> Vec<PixelLight> {
        let of_own = |(pixel, light): (usize, PixelLight)| match self
            .spad_spread(pixel as u32, spads.grid.spads())
        {
            Some(spread) => light.with_spads(spread),
            None => light,
        };
        lights.into_iter().enumerate().map(of_own).collect()
    }

    fn light_on(
        &self,
        truth: &GroundTruth,
        spads: &SpadModel,
        before: Option<(PreviousWorld<'_>, &[PixelLight])>,
    ) -> Vec<PixelLight> {
        let has_crosstalk = spads.crosstalk_probability > 0.0;
        let has_stray_light = self.lidar.stray_share > 0.0;
        let before = before.filter(|(before, _)| {
            let world = before.world;
            !has_crosstalk
                && !has_stray_light
                && (&world.lidar, &world.light, &world.medium)
                    == (&self.lidar, &self.light, &self.medium)
        });
        let kept = |pixel: usize| {
            let (before, light) = before?;
            let [before, now] = [before.truth, truth].map(|truth| &truth.views[pixel]);
            (Arc::ptr_eq(before, now) || before == now).then(|| &light[pixel])
        };
        let (rows, cols) = (truth.rows, truth.cols);
        let budget = self.photon_budget(rows, cols);
        let off_axis = self.off_axis(&self.lidar_camera(rows, cols));
        let centre_fs = self.pulse_shape().map_or(0.0, |shape| shape.mean_fs());
        let views = truth.views.par_iter().zip(&off_axis).enumerate();
        let falling = views.map(|(pixel, (view, off_axis))| match kept(pixel) {
            Some(light) => PixelIllumination::AsBefore(light),
            None => PixelIllumination::Anew(self.falling(view, &budget, off_axis, centre_fs)),
        });
        let mut falling: Vec<PixelIllumination<'_>> = falling.collect();
        if has_crosstalk || has_stray_light {
            let all = falling.into_iter().filter_map(|lit| match lit {
                PixelIllumination::Anew(falling) => Some(falling),
                PixelIllumination::AsBefore(_) => None,
            });
            let (mut all, cols): (Vec<_>, _) = (all.collect(), cols as usize);
            if has_stray_light {
                all = with_stray_light(self, &all, cols);
            }
            if has_crosstalk {
                all = with_crosstalk(&all, spads, cols);
            }
            falling = all.into_iter().map(PixelIllumination::Anew).collect();
        }
        let (sigma, resolution) = (self.pulse_sigma(), self.pulse_resolution());
        let fog = Fog::from_scene(self, &budget);
        let light = |(lit, (view, off_axis)): (PixelIllumination<'_>, (&Arc<View>, &OffAxis))| {
            let mut falling = match lit {
                PixelIllumination::Anew(falling) => falling,
                PixelIllumination::AsBefore(light) => return light.clone(),
            };
            let echoes = merged(&mut falling.glints, sigma, resolution);
            let background = PixelLight::background(falling.background_hz);
            let echoes = echoes.into_iter().map(|echo| Echo {
                photons: echo.photons.min(MOST_PER_ECHO),
                ..echo
            });
            let light = echoes.fold(background, PixelLight::with_echo);
            let light = match &fog {
                Some(fog) => fog.add_to(light, &view.ends_m, off_axis.signal, sigma, centre_fs),
                None => light,
            };
            let trains = falling.trains.into_iter();
            trains.fold(light, PixelLight::with_train)
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
        let glint = |glimpse: &Glimpse| Glint {
            photons: budget.signal_per_pulse(glimpse.range_m, glimpse.frontal_reflectivity)
                * self.medium.transmission(glimpse.range_m).powi(2)
                * off_axis.signal,
            surface: glimpse.object,
            arrival_fs: glimpse.range_m * FLIGHT_FS_PER_M - centre_fs,
            variance_fs2: glimpse.range_m2 * FLIGHT_FS_PER_M * FLIGHT_FS_PER_M,
        };
        let bounced = view.bounced.iter().map(|bounce| Glint {
            photons: budget.photons_of_exposure(bounce.exposure_j_m2) * off_axis.background,
            // Beyond the surfaces that are seen.
            surface: self.objects.len() + bounce.object,
            arrival_fs: 0.5 * bounce.way_m * FLIGHT_FS_PER_M - centre_fs,
            variance_fs2: 0.0,
        });
        let glints = view.glimpses.iter().map(glint).chain(bounced);
        let finite = |glint: Glint| Glint {
            photons: glint.photons.min(MOST_PER_RAY),
            ..glint
        };
        Falling {
            glints: glints.map(finite).collect(),
            background_hz: (sun_hz + self.dark_hz()).min(MOST_BACKGROUND_HZ),
            trains: (view.others.iter())
                .filter_map(|other| other.train(self, budget, off_axis.background))
                .collect(),
        }
    }

    /// Dark counts of a macropixel, unless its SPADs have their own, per second.
    pub(super) fn dark_hz(&self) -> f64 {
        if self.lidar.has_spread() {
            0.0
        } else {
            self.lidar.dark_counts_hz()
        }
    }
}

/// How a macropixel comes by its light.
#[derive(Debug)]
enum PixelIllumination<'a> {
    /// It sees what it saw.
    AsBefore(&'a PixelLight),
    Anew(Falling),
}

/// The same with what crosses over from the neighbours. Of the avalanches of a SPAD at a side, a fourth of those with crosstalk
/// fire across it.
fn with_crosstalk(falling: &[Falling], spads: &SpadModel, cols: usize) -> Vec<Falling> {
    let (grid, all) = (spads.grid, spads.grid.spads() as f64);
    let (dead_s, dead_fs) = (spads.dead_time.as_s(), spads.dead_time.as_fs() as f64);
    let each = spads.crosstalk_probability / 4.0 / all;
    let (of_side, of_end) = (each * grid.rows() as f64, each * grid.cols() as f64);
    let rows = falling.len() / cols;
    let avalanches = falling.par_iter().map(|own| own.avalanches(all, dead_fs));
    let avalanches: Vec<Vec<Glint>> = avalanches.collect();
    let with_neighbours = |pixel: usize| {
        let (row, col) = (pixel / cols, pixel % cols);
        let mut own = falling[pixel].clone();
        let neighbours = [
            (col > 0).then(|| (pixel - 1, of_side)),
            (col + 1 < cols).then(|| (pixel + 1, of_side)),
            (row > 0).then(|| (pixel - cols, of_end)),
            (row + 1 < rows).then(|| (pixel + cols, of_end)),
        ];
        for (neighbour, share) in neighbours.into_iter().flatten() {
            own.glints
                .extend(avalanches[neighbour].iter().map(|glint| Glint {
                    photons: glint.photons * share,
                    arrival_fs: glint.arrival_fs + CROSSTALK_DELAY.as_fs() as f64,
                    ..*glint
                }));
            let other_hz = falling[neighbour].background_hz;
            let ready = 1.0 / (1.0 + other_hz * dead_s / all);
            own.background_hz += other_hz * ready * share;
        }
        own
    };
    (0..falling.len())
        .into_par_iter()
        .map(with_neighbours)
        .collect()
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
