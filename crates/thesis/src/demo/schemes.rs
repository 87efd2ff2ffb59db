//! The same light through full, zooming, sliding and guided histograms, at equal laser energy (thesis 3.4, 6.4.2, Table 17).
//!
//! ```text
//!   guided    one window of 8 bins at the guide's estimate                                     all laser cycles
//!   full      every window of the chip at once, as a chip with some 300 bins would have them   all laser cycles
//!   sliding   every window, one after the other                                                each an equal part of them
//!   zooming   8 bins of 166 ns, then of 20.8 ns in the fullest, then of 2.6 ns                 each a third of them
//! ```
//!
//! All on the same delay lines with the same calibration; the coarse steps of zooming are the clocked chip on a slower CLK (6.4.2). Of
//! several windows the most significant peak counts, or the nearest significant one, which is the first peak of Fig. 102. Tests
//! of many windows share the false alarms of one.

use rayon::prelude::*;

use super::Demonstrator;
use super::found::TargetSummary;
use crate::chip::{Exposure, Sensor, SensorConfig, Tdc, WindowLaw, hslidar};
use crate::engine::{Histograms, LitPixel, Window, expose};
use crate::guide::GuideMap;
use crate::photon::PixelLight;
use crate::ranging::DepthOptions;
use crate::scene::{GroundTruth, Scene};
use crate::system::{
    FrameError, PixelContext, PixelDepth, Pointing, Ranger, WindowPolicy, photon_stream,
};
use crate::units::{Time, TimeOfFlight};

/// How far full, sliding and zooming histograms look, m: the demonstrator's 75 m and a little.
pub(crate) const REACH_M: f64 = 80.0;
/// Bins of zooming's coarse steps, s (6.4.2).
const ZOOM_BINS_S: [f64; 2] = [166e-9, 20.8e-9];

/// What a scheme makes of a target.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct SchemeOutcome {
    /// The scheme.
    pub scheme: &'static str,
    /// Bins that each macropixel needs at once.
    pub bins: usize,
    /// Exposures between which windows change.
    pub exposures: usize,
    /// What became of the target.
    pub found: TargetSummary,
}

/// A still world before the chip, and the macropixels that matter.
struct Bench<'a> {
    demonstrator: &'a Demonstrator,
    world: &'a Scene,
    truth: &'a GroundTruth,
    light: Vec<PixelLight>,
    pixels: &'a [usize],
    seed: u64,
}

/// All schemes on the macropixels `pixels` of a still `world`, with the demonstrator's laser cycles; `guide` is what guided windows go by.
///
/// # Errors
/// What engines refuse.
pub(crate) fn compare(
    demonstrator: &Demonstrator,
    world: &Scene,
    guide: &GuideMap,
    pixels: &[usize],
    seed: u64,
) -> Result<Vec<SchemeOutcome>, FrameError> {
    let sensor = &demonstrator.sensor;
    let truth = GroundTruth::render(world, sensor.rows as u32, sensor.cols as u32);
    let bench = Bench {
        demonstrator,
        world,
        light: world.pixel_light(&truth),
        truth: &truth,
        pixels,
        seed,
    };
    let cycles = demonstrator.exposure.laser_cycles;
    let law = WindowLaw::new(sensor.alike(), &demonstrator.exposure);
    let starts: Vec<u16> = (0..=sensor.largest_start())
        .filter(|&start| {
            let window = law.window(start).open();
            window.is_some_and(|window| {
                let seen = law.interval(&window);
                seen.start > Time::ZERO && seen.start.as_range_m() < REACH_M
            })
        })
        .collect();
    let policy = WindowPolicy::default();
    let calibration = Some(&demonstrator.calibration);
    let mut pointing = Pointing::new(policy, sensor, &demonstrator.exposure, calibration);
    let wanted = pointing.windows(guide, &[]);
    let guided = bench.depths(cycles, 0, 1, |pixel| wanted[pixel])?;
    let windows = |part: u32, fresh: bool| -> Result<Vec<Vec<PixelDepth>>, FrameError> {
        let each = |(n, &start): (usize, &u16)| {
            let salt = if fresh { n as u64 + 1 } else { 0 };
            bench.depths(part, salt, starts.len(), |_| Some(start))
        };
        starts.par_iter().enumerate().map(each).collect()
    };
    let full = windows(cycles, false)?;
    let sliding = windows((cycles / starts.len() as u32).max(1), true)?;
    let zooming = bench.zoom(cycles / 3)?;
    let outcome = |scheme, bins, exposures, depths: Vec<PixelDepth>| SchemeOutcome {
        scheme,
        bins,
        exposures,
        found: TargetSummary::summarise(depths.iter(), 0.39),
    };
    // Windows overlap: a full histogram has the bins of one step of each, and the rest of the last.
    let step_bins = 12.5 / 2.6;
    let full_bins = (starts.len() as f64 * step_bins).ceil() as usize + sensor.bins;
    Ok(vec![
        outcome("guided", sensor.bins, 1, guided),
        outcome("full", full_bins, 1, best(&full, most_significant)),
        outcome("full, first peak", full_bins, 1, best(&full, nearest)),
        outcome(
            "sliding",
            sensor.bins,
            starts.len(),
            best(&sliding, most_significant),
        ),
        outcome("zooming", sensor.bins, 3, zooming),
    ])
}

/// Of two windows of a macropixel, whether the second is to be preferred.
type Preference = fn(&PixelDepth, &PixelDepth) -> bool;

fn most_significant(chosen: &PixelDepth, other: &PixelDepth) -> bool {
    other.confidence > chosen.confidence
}

fn nearest(chosen: &PixelDepth, other: &PixelDepth) -> bool {
    other.measured_m < chosen.measured_m
}

/// Of all windows of each macropixel the preferred one with a depth; the last one, if none has.
fn best(windows: &[Vec<PixelDepth>], prefers: Preference) -> Vec<PixelDepth> {
    (0..windows[0].len())
        .map(|pixel| {
            let all = windows.iter().map(|depths| depths[pixel]);
            let chosen = all.clone().filter(|depth| depth.measured_m.is_some());
            let chosen = chosen.reduce(|a, b| if prefers(&a, &b) { b } else { a });
            chosen.unwrap_or_else(|| windows[windows.len() - 1][pixel])
        })
        .collect()
}

impl Bench<'_> {
    fn lit_pixels(&self, start_of: impl Fn(usize) -> Option<u16>, farthest: u16) -> Vec<LitPixel> {
        let pixels = self.pixels.iter();
        pixels
            .map(|&pixel| LitPixel {
                number: pixel as u32,
                start: start_of(pixel).unwrap_or(farthest),
                light: start_of(pixel).map(|_| self.light[pixel].clone()),
            })
            .collect()
    }

    fn expose(
        &self,
        sensor: &Sensor,
        exposure: &Exposure,
        salt: u64,
        lit: &[LitPixel],
    ) -> Result<Histograms, FrameError> {
        let seed = self.seed.wrapping_mul(1000).wrapping_add(salt);
        let stream = photon_stream(sensor, exposure, seed, self.world);
        let engine = Window::new(sensor, exposure);
        let exposed = expose(&engine, &stream, lit, |_| {})?;
        Ok(exposed.histograms)
    }

    /// Depths after `cycles` laser cycles in the windows of `start_of`, where `tests` windows share the false alarms of one.
    fn depths(
        &self,
        cycles: u32,
        salt: u64,
        tests: usize,
        start_of: impl Fn(usize) -> Option<u16> + Sync,
    ) -> Result<Vec<PixelDepth>, FrameError> {
        let Demonstrator {
            sensor,
            calibration,
            ..
        } = self.demonstrator;
        let exposure = Exposure::new(sensor, super::STOP_PERIODS, cycles);
        let options = DepthOptions::default();
        let options = DepthOptions {
            false_alarm_rate: options.false_alarm_rate / tests as f64,
            ..options
        };
        let ranger = Ranger::new(sensor, &exposure, self.world, &options, Some(calibration))?;
        let lit = self.lit_pixels(&start_of, sensor.largest_start());
        let histograms = self.expose(sensor, &exposure, salt, &lit)?;
        let depth = |(n, &pixel): (usize, &usize)| {
            let known = PixelContext {
                pixel,
                start: start_of(pixel),
                true_m: self.truth.range_m[pixel],
                guide_m: None,
            };
            ranger.depth(&known, &histograms[n])
        };
        Ok(self.pixels.par_iter().enumerate().map(depth).collect())
    }

    /// Depths of zooming, `cycles` laser cycles in each of its three steps.
    fn zoom(&self, cycles: u32) -> Result<Vec<PixelDepth>, FrameError> {
        let laser_cycle_s = f64::from(super::STOP_PERIODS) / self.demonstrator.sensor.clk_hz;
        // Where each macropixel looks next: at first, in the middle of a window that begins with the laser pulse.
        let mut looks: Vec<Time> =
            vec![Time::from_s(0.5 * ZOOM_BINS_S[0] * 8.0); self.pixels.len()];
        for (step, bin_s) in ZOOM_BINS_S.into_iter().enumerate() {
            let sensor = Sensor::from(SensorConfig {
                tdc: Tdc::Clocked,
                step_periods: 1,
                clk_hz: 1.0 / bin_s,
                ..(*hslidar()).clone()
            });
            let periods = (laser_cycle_s / bin_s).floor() as u32;
            let exposure = Exposure::new(&sensor, periods, cycles);
            let law = WindowLaw::new(&sensor, &exposure);
            let starts: Vec<Option<u16>> = looks.iter().map(|&look| law.start_for(look)).collect();
            let place = |pixel: usize| {
                let at = self.pixels.iter().position(|&p| p == pixel);
                starts[at.expect("one of them")]
            };
            let lit = self.lit_pixels(place, sensor.largest_start());
            let histograms = self.expose(&sensor, &exposure, 900 + step as u64, &lit)?;
            for ((look, start), counts) in looks.iter_mut().zip(&starts).zip(&histograms) {
                let window = start.and_then(|start| law.window(start).open());
                let fullest = (0..counts.len()).rev().max_by_key(|&bin| counts[bin]);
                if let Some((window, bin)) = window.zip(fullest) {
                    *look = law.time_of(&window, bin as f64);
                }
            }
        }
        let sensor = &self.demonstrator.sensor;
        let law = WindowLaw::new(sensor.alike(), &self.demonstrator.exposure);
        let starts: Vec<Option<u16>> = looks.iter().map(|&look| law.start_for(look)).collect();
        self.depths(cycles, 990, 1, |pixel| {
            let at = self.pixels.iter().position(|&p| p == pixel);
            starts[at.expect("one of them")]
        })
    }
}
