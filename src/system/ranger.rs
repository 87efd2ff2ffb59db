//! Depths from the histograms of a frame: echo, distance, and the one reason why a macropixel has none.

use super::aim::{Aims, Place, own_law};
use super::pixel::{NoDepth, PixelDepth};
use crate::chip::{Exposure, SensorConfig, WindowLaw};
use crate::ranging::{BinProfile, DepthOptions, EchoFinder, UnequalBins};
use crate::scene::Scene;
use crate::units::Time;

/// What is known of a macropixel beside its histogram.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Known {
    /// Its number in the array.
    pub(crate) pixel: usize,
    /// Its start value; `None` where its SPADs are off.
    pub(crate) start: Option<u16>,
    /// The true distance, m; `None` for the sky.
    pub(crate) true_m: Option<f64>,
    /// The guide's estimate, m.
    pub(crate) guide_m: Option<f64>,
}

impl Known {
    /// Whether this was known of a macropixel when its depth was found.
    pub(crate) fn is_of(&self, pixel: &PixelDepth) -> bool {
        (self.start, self.true_m, self.guide_m) == (pixel.start, pixel.true_m, pixel.guide_m)
    }
}

/// Finds depths with one sensor in one exposure.
#[derive(Debug)]
pub(crate) struct Ranger<'a> {
    law: WindowLaw,
    aims: Aims<'a>,
    finder: EchoFinder,
    options: &'a DepthOptions,
    spads_fire: bool,
    farthest: u16,
}

impl<'a> Ranger<'a> {
    /// For a sensor behind the optics of `scene`; `calibration` is that of delay lines.
    ///
    /// # Errors
    /// Bins that the finder does not take.
    pub(crate) fn new(
        sensor: &SensorConfig,
        exposure: &Exposure,
        scene: &Scene,
        options: &'a DepthOptions,
        calibration: Option<&'a BinProfile>,
    ) -> Result<Self, UnequalBins> {
        let law = WindowLaw::new(sensor, exposure);
        let finder = EchoFinder::new(&law, scene.pulse_resolution(), options)?;
        Ok(Ranger {
            law,
            aims: Aims::new(sensor, exposure, calibration),
            finder,
            options,
            spads_fire: scene.lidar.pde > 0.0 || scene.lidar.dark_count_hz > 0.0,
            farthest: sensor.largest_start(),
        })
    }

    /// Length of a bin, s.
    pub(crate) fn bin_s(&self) -> f64 {
        self.finder.bin_s()
    }

    /// The window of a macropixel with this start value, as distances in m; `None` where it never opens.
    pub(crate) fn window_m(&self, pixel: usize, start: u16) -> Option<(f64, f64)> {
        let law = own_law(&self.law, pixel);
        let seen = law.interval(&law.window(start).open()?);
        Some((seen.start.as_range_m(), seen.end.as_range_m()))
    }

    /// The macropixel's depth from its `counts`, one for each bin.
    pub(crate) fn depth(&self, known: &Known, counts: &[u16]) -> PixelDepth {
        let &Known {
            pixel,
            start,
            true_m,
            guide_m,
        } = known;
        let law = own_law(&self.law, pixel);
        let window = start.and_then(|start| law.window(start).open());
        let in_window = window.zip(true_m).is_some_and(|(window, true_m)| {
            law.interval(&window).contains(&Time::of_flight(true_m))
        });
        let counts: Vec<u32> = counts.iter().map(|&n| n.into()).collect();
        let place = Place {
            pixel,
            start: start.unwrap_or(self.farthest),
            law: &law,
            profile: self.aims.profile(),
            peak: &self.options.peak,
        };
        let sighting = window.and_then(|_| place.find(&self.finder, &counts));
        let found = sighting.filter(|s| s.is_significant && !s.is_saturated);
        let range_m = |bins: f64, at: usize| place.range_m(window?, &counts, bins, at);
        let no_depth = match found {
            Some(_) => None,
            None if true_m.is_none() => Some(NoDepth::NoSurface),
            None if start.is_none() && guide_m.is_none() => Some(NoDepth::NoGuide),
            None if start.is_none() => Some(NoDepth::OutOfReach),
            None if !self.spads_fire => Some(NoDepth::SpadsOff),
            None if sighting.is_some_and(|s| s.is_saturated) => Some(NoDepth::Saturated),
            None if !in_window => Some(NoDepth::OutsideWindow),
            None => Some(NoDepth::NoSignificantPeak),
        };
        PixelDepth {
            true_m,
            guide_m,
            start,
            in_window,
            measured_m: found.and_then(|s| range_m(s.position_bins, s.peak.peak_bin)),
            no_depth,
            peak_m: sighting.and_then(|s| range_m(s.peak.position_bins, s.peak.peak_bin)),
            confidence: sighting.map(|s| s.confidence),
        }
    }
}
