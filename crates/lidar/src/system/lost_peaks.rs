//! What would bring back surfaces whose peak is not significant: more laser cycles, more light or less background.
//!
//! A peak stands out by its photons over the standard deviation of all photons beneath it, s·N / √((s + b)·N) for N laser cycles. The frame
//! itself tells how much of that a depth takes: the value at which as many surfaces above it are lost as surfaces below it are found. It
//! grows with √N, so that the square of what is missing is the factor on N.

use super::pixel::{NoDepth, PixelDepth};
use super::remark::{Circumstances, signal_in_window};
use crate::chip::{EventType, WindowLaw};
use crate::ranging::Response;

/// Most laser cycles that are advised, in those of the frame: chosen. For more, exposures are no longer exposures of one frame.
const MOST_TIMES: f64 = 100.0;

/// Parts of equally many surfaces in which the reach is looked for.
const PARTS: usize = 20;

/// A surface in its window.
#[derive(Debug, Clone, Copy)]
struct SeenSurface {
    range_m: f64,
    /// Photons of its echo, relative to the standard deviation of those beneath it.
    strength: f64,
    has_depth: bool,
    is_mostly_background: bool,
}

/// Surfaces in their windows, some without a significant peak.
pub(super) struct LostPeaks {
    surfaces: Vec<SeenSurface>,
}

impl LostPeaks {
    /// `None` where TYPE and THRESHOLD ask for several SPADs at once: then other numbers decide.
    pub(super) fn new(frame: &Circumstances<'_>) -> Option<Self> {
        let sensor = frame.sensor;
        if (sensor.event_type, sensor.threshold) != (EventType::Greater, 0) {
            return None;
        }
        let law = WindowLaw::new(sensor, frame.exposure);
        let response = Response::new(sensor, frame.bin_s, frame.scene.echo_width());
        // Two standard deviations either side of an echo, and the bin that it lies in.
        let beneath_s = (1.0 + 4.0 * response.pulse_sigma_bins) * frame.bin_s;
        let cycles = f64::from(frame.exposure.laser_cycles);
        let surface = |pixel: &PixelDepth, light| {
            let is_told = match pixel.no_depth {
                None => true,
                Some(why) => why == NoDepth::NoSignificantPeak,
            };
            let range_m = pixel.true_m.filter(|_| pixel.in_window && is_told)?;
            let signal = signal_in_window(&law, pixel, light);
            let background = light.background_hz() * beneath_s;
            Some(SeenSurface {
                range_m,
                strength: signal * (cycles / (signal + background).max(f64::MIN_POSITIVE)).sqrt(),
                has_depth: pixel.no_depth.is_none(),
                is_mostly_background: background > signal,
            })
        };
        let pixels = frame.pixels.iter().zip(frame.light);
        let surfaces = pixels.filter_map(|(pixel, light)| surface(pixel, light));
        Some(LostPeaks {
            surfaces: surfaces.collect(),
        })
    }

    /// How far this light reaches, and what would help; `None` where neither laser cycles nor light would.
    pub(super) fn advice(&self) -> Option<String> {
        let mut lost: Vec<SeenSurface> = self.surfaces.clone();
        lost.retain(|surface| !surface.has_depth);
        lost.sort_by(|a, b| a.strength.total_cmp(&b.strength));
        let median = lost.get(lost.len() / 2)?;
        let needed = self.needed_strength()?;
        let times = (needed / median.strength).powi(2);
        if !times.is_finite() || times <= 1.0 {
            return None;
        }
        let cycles = if times > MOST_TIMES {
            format!(
                "half of them would need more than {MOST_TIMES:.0} times as many laser cycles; give more light (pulse_energy_uj, a larger lens)"
            )
        } else {
            format!(
                "about {times:.1} times as many laser cycles, or {:.1} times the light, would bring half of them a depth",
                light_times(times, median.is_mostly_background)
            )
        };
        let background = if median.is_mostly_background {
            "; less background (a narrower filter, less sun) helps, too"
        } else {
            ""
        };
        let reach = match self.reach_m() {
            Some(reach_m) => {
                format!("beyond about {reach_m:.0} m most surfaces are too dark in this light; ")
            }
            None => "they are the darkest ones; ".to_owned(),
        };
        Some(format!("{reach}{cycles}{background}"))
    }

    /// The strength above which as many surfaces are lost as are found below it.
    fn needed_strength(&self) -> Option<f64> {
        let mut by_strength: Vec<(f64, bool)> = (self.surfaces.iter())
            .map(|s| (s.strength, s.has_depth))
            .collect();
        by_strength.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut lost_above = by_strength
            .iter()
            .filter(|(_, has_depth)| !has_depth)
            .count();
        let mut found_below = 0;
        for &(strength, has_depth) in &by_strength {
            found_below += usize::from(has_depth);
            lost_above -= usize::from(!has_depth);
            if found_below >= lost_above {
                return (found_below > 0).then_some(strength);
            }
        }
        None
    }

    /// The distance beyond which most surfaces have no depth, m, if there is one.
    fn reach_m(&self) -> Option<f64> {
        let mut by_range = self.surfaces.clone();
        by_range.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
        let part = by_range.len().div_ceil(PARTS).max(1);
        let is_lost = |part: &&[SeenSurface]| {
            2 * part.iter().filter(|surface| surface.has_depth).count() < part.len()
        };
        let lost_parts = by_range.chunks(part).rev().take_while(is_lost).count();
        let parts = by_range.chunks(part).count();
        let first = by_range.chunks(part).nth(parts - lost_parts)?;
        Some(first.first()?.range_m)
    }
}

/// The factor on the light that helps as much as `times` the laser cycles: strength goes with the light itself where the background makes the
/// noise, and with its root elsewhere.
fn light_times(times: f64, is_mostly_background: bool) -> f64 {
    if is_mostly_background {
        times.sqrt()
    } else {
        times
    }
}

#[cfg(test)]
mod tests {
    use crate::chip::{Exposure, SensorConfig};
    use crate::scene::Scene;
    use crate::system::{Frame, FrameSettings, NoDepth, take_frame};

    fn frame(laser_cycles: u32, energy_uj: f64, klux: f64) -> Frame {
        let sensor = SensorConfig::parse("test", "rows = 24\ncols = 24").unwrap();
        let mut scene = Scene::outdoor();
        scene.lidar.pulse_energy_uj = energy_uj;
        scene.light.illuminance_klux = klux;
        let exposure = Exposure::new(&sensor, 520, laser_cycles);
        let settings = FrameSettings::new(sensor, scene, exposure);
        take_frame(&settings, |_| Vec::new(), |_| {}).unwrap()
    }

    fn lost(frame: &Frame) -> Vec<usize> {
        let pixels = frame.pixels.iter().enumerate();
        let lost = pixels
            .filter(|(_, p)| p.no_depth == Some(NoDepth::NoSignificantPeak) && p.true_m.is_some());
        lost.map(|(number, _)| number).collect()
    }

    fn sentence(frame: &Frame) -> Option<&str> {
        let is_of_peaks =
            |hint: &&crate::system::DepthHint| hint.reason == NoDepth::NoSignificantPeak;
        frame
            .hints
            .iter()
            .find(is_of_peaks)
            .map(|hint| hint.sentence.as_str())
    }

    /// A number before `word` in a sentence.
    fn number(sentence: &str, word: &str) -> f64 {
        let before = sentence.split(word).next().unwrap().trim();
        before.rsplit(' ').next().unwrap().parse().unwrap()
    }

    /// What is advised is done: about half of the lost surfaces get a depth.
    #[test]
    fn advice_brings_half_of_the_lost_surfaces_a_depth() {
        let (cycles, energy_uj, klux) = (400, 60.0, 50.0);
        let dim = frame(cycles, energy_uj, klux);
        let hint = sentence(&dim).unwrap();
        let lost_before = lost(&dim);
        let share_found = |after: &Frame| {
            let still = lost(after);
            let found = lost_before
                .iter()
                .filter(|pixel| !still.contains(pixel))
                .count();
            found as f64 / lost_before.len() as f64
        };
        let times = number(hint, " times as many laser cycles");
        let longer = frame((times * f64::from(cycles)) as u32, energy_uj, klux);
        let share = share_found(&longer);
        assert!((0.3..0.75).contains(&share), "{share}: {hint}");
        let brighter = frame(cycles, energy_uj * number(hint, " times the light"), klux);
        let share = share_found(&brighter);
        assert!((0.3..0.75).contains(&share), "{share}: {hint}");
    }

    #[test]
    fn where_all_have_a_depth_nothing_is_advised() {
        let bright = frame(4000, 100.0, 1.0);
        assert!(lost(&bright).len() < 6, "{:?}", lost(&bright));
        assert_eq!(sentence(&bright), None);
    }
}
