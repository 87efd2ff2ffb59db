//! What would help surfaces whose peak is not significant: up to where this light reaches, and whether less background would help, too.
//!
//! A number of laser cycles is not advised, because the photons of echoes do not tell it: 4.5 and 8.2 times as many, reckoned from them, brought 16 % and
//! 25 % of such surfaces a depth, not half.

use super::circumstances::{Circumstances, signal_in_window};
use super::pixel::NoDepth;
use crate::chip::WindowLaw;
use crate::ranging::Response;

/// Parts of equally many surfaces in which the reach is looked for.
const PARTS: usize = 20;

/// A surface in its window.
#[derive(Debug, Clone, Copy)]
struct SeenSurface {
    range_m: f64,
    has_depth: bool,
    /// Whether most photons beneath its echo are background.
    is_mostly_background: bool,
}

/// Surfaces in their windows, with a depth or without a significant peak; rising by range.
pub(super) struct LostPeaks {
    surfaces: Vec<SeenSurface>,
}

impl LostPeaks {
    pub(super) fn new(frame: &Circumstances<'_>) -> Self {
        let law = WindowLaw::new(frame.sensor, frame.exposure);
        let response = Response::new(frame.sensor, frame.bin_s, frame.scene.echo_width());
        // Two standard deviations either side of an echo, and the bin that it lies in.
        let beneath_s = (1.0 + 4.0 * response.pulse_sigma_bins) * frame.bin_s;
        let pixels = frame.pixels.iter().zip(frame.light);
        let seen = pixels.filter_map(|(pixel, light)| {
            let is_told = pixel
                .no_depth
                .is_none_or(|why| why == NoDepth::NoSignificantPeak);
            let range_m = pixel.true_m.filter(|_| pixel.in_window && is_told)?;
            let background = light.background_hz() * beneath_s;
            Some(SeenSurface {
                range_m,
                has_depth: pixel.no_depth.is_none(),
                is_mostly_background: background > signal_in_window(&law, pixel, light),
            })
        });
        let mut surfaces: Vec<SeenSurface> = seen.collect();
        surfaces.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
        LostPeaks { surfaces }
    }

    /// How far this light reaches, and what would help.
    pub(super) fn advice(&self) -> String {
        let lost = || self.surfaces.iter().filter(|surface| !surface.has_depth);
        let in_background = lost().filter(|surface| surface.is_mostly_background);
        let background = if 2 * in_background.count() > lost().count() {
            ", or less background (a narrower filter, less sun)"
        } else {
            ""
        };
        let reach = match self.reach_m() {
            Some(reach_m) => {
                format!("beyond about {reach_m:.0} m most surfaces are too dark in this light; ")
            }
            None => String::new(),
        };
        format!(
            "{reach}give more laser cycles or more light (pulse_energy_uj, a larger lens){background}"
        )
    }

    /// The distance beyond which most surfaces have no depth, m, if there is one.
    fn reach_m(&self) -> Option<f64> {
        let part = self.surfaces.len().div_ceil(PARTS).max(1);
        let is_lost = |part: &&[SeenSurface]| {
            2 * part.iter().filter(|surface| surface.has_depth).count() < part.len()
        };
        let parts = self.surfaces.chunks(part);
        let lost_parts = parts.clone().rev().take_while(is_lost).count();
        let first = parts.rev().take(lost_parts).next_back()?;
        Some(first[0].range_m)
    }
}

#[cfg(test)]
mod tests {
    use crate::chip::{Exposure, SensorConfig};
    use crate::scene::Scene;
    use crate::system::{Frame, FrameSettings, NoDepth, take_frame};

    fn frame(laser_cycles: u32, klux: f64) -> Frame {
        let sensor = SensorConfig::parse("test", "rows = 24\ncols = 24").unwrap();
        let mut scene = Scene::outdoor();
        scene.light.illuminance_klux = klux;
        let exposure = Exposure::new(&sensor, 520, laser_cycles);
        let settings = FrameSettings::new(sensor, scene, exposure);
        take_frame(&settings, |_| Vec::new(), |_| {}).unwrap()
    }

    fn lost(frame: &Frame) -> usize {
        let is_lost = |pixel: &&crate::system::PixelDepth| {
            pixel.no_depth == Some(NoDepth::NoSignificantPeak) && pixel.true_m.is_some()
        };
        frame.pixels.iter().filter(is_lost).count()
    }

    fn sentence(frame: &Frame) -> &str {
        let mut hints = frame.hints.iter();
        let hint = hints.find(|hint| hint.reason == NoDepth::NoSignificantPeak);
        &hint.unwrap().sentence
    }

    /// Each of what is advised brings depths.
    #[test]
    fn what_is_advised_helps() {
        let dim = frame(400, 50.0);
        let advice = "give more laser cycles or more light (pulse_energy_uj, a larger lens), or less background";
        assert!(sentence(&dim).contains(advice), "{}", sentence(&dim));
        let (longer, darker) = (frame(4000, 50.0), frame(400, 1.0));
        let [before, longer, darker] = [&dim, &longer, &darker].map(lost);
        assert!(
            4 * longer < 3 * before && 4 * darker < 3 * before,
            "{before} {longer} {darker}"
        );
    }

    /// Beyond the reach every seventh surface still has a depth.
    #[test]
    fn the_reach_parts_surfaces_with_and_without_a_depth() {
        let near_and_far = |range_m: f64, has_depth| super::SeenSurface {
            range_m,
            has_depth,
            is_mostly_background: false,
        };
        let surfaces: Vec<_> = (0..200)
            .map(|number| near_and_far(f64::from(number), number < 130 || number % 7 == 0))
            .collect();
        let reach_m = super::LostPeaks { surfaces }.reach_m().unwrap();
        assert!((reach_m - 130.0).abs() <= 10.0, "{reach_m}");
        let all = (0..200).map(|number| near_and_far(f64::from(number), true));
        let surfaces = all.collect();
        assert_eq!(super::LostPeaks { surfaces }.reach_m(), None);
    }
}
