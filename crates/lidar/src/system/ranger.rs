//! Depths from the histograms of a frame: echo, distance, and the one reason why a macropixel has none.

use std::borrow::Cow;

use rayon::prelude::*;

use super::aim::{AimedHistogram, Aims, own_law};
use super::pixel::{DepthReturn, DepthReturns, NoDepth, PixelDepth};
use crate::chip::window_law::OpenWindow;
use crate::chip::{Exposure, Sensor, Tdc, WindowLaw};
use crate::files::InputError;
use crate::ranging::{BinProfile, DepthOptions, EchoFinder, Peak, Sighting, UnequalBins, WalkLeft};
use crate::scene::Scene;
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time, TimeOfFlight};

/// What is known of a macropixel beside its histogram.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelContext {
    /// Its number in the array.
    pub pixel: usize,
    /// Its start value; `None` where its SPADs are off.
    pub start: Option<u16>,
    /// The true distance, m; `None` for the sky.
    pub true_m: Option<f64>,
    /// The guide's estimate, m.
    pub guide_m: Option<f64>,
}

impl PixelContext {
    /// What was known of macropixel number `pixel` when its depth was found.
    pub(crate) fn new(pixel: usize, depth: &PixelDepth) -> Self {
        PixelContext {
            pixel,
            start: depth.start,
            true_m: depth.true_m,
            guide_m: depth.guide_m,
        }
    }

    /// Whether this was known of a macropixel when its depth was found.
    pub(crate) fn is_of(&self, depth: &PixelDepth) -> bool {
        *self == PixelContext::new(self.pixel, depth)
    }
}

/// Finds depths with one sensor in one exposure.
#[derive(Debug)]
pub struct Ranger<'a> {
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
    pub fn new(
        sensor: &Sensor,
        exposure: &Exposure,
        scene: &Scene,
        options: &'a DepthOptions,
        calibration: Option<&'a BinProfile>,
    ) -> Result<Self, UnequalBins> {
        let law = WindowLaw::new(sensor, exposure);
        let finder = EchoFinder::new(&law, scene.echo_width(), options)?;
        Ok(Ranger {
            law,
            aims: Aims::new(sensor, exposure, calibration),
            finder,
            options,
            spads_fire: scene.lidar.warm_pde() > 0.0 || scene.lidar.dark_counts_hz() > 0.0,
            farthest: sensor.largest_start(),
        })
    }

    /// Length of a bin, s.
    pub(crate) fn bin_s(&self) -> f64 {
        self.finder.bin_s
    }

    /// Light's way there and back in a bin, as a distance, m.
    fn bin_m(&self) -> f64 {
        self.bin_s() * SPEED_OF_LIGHT_M_PER_S / 2.0
    }

    /// The window of a macropixel with this start value, as distances in m; `None` where it never opens.
    pub(crate) fn window_m(&self, pixel: usize, start: u16) -> Option<(f64, f64)> {
        let law = own_law(&self.law, pixel);
        let seen = law.interval(&law.window(start).open()?);
        Some((seen.start.as_range_m(), seen.end.as_range_m()))
    }

    /// Whether macropixels with the same start value may have windows of their own.
    pub(crate) fn has_own_windows(&self) -> bool {
        self.law.sensor().has_own_laws()
    }

    /// The edges of the bins of a macropixel with this start value, as distances in m; `None` where the window never opens.
    pub(crate) fn edges_m(&self, pixel: usize, start: u16) -> Option<Vec<f64>> {
        let law = own_law(&self.law, pixel);
        let edges = law.edges(&law.window(start).open()?, 0);
        Some(edges.edges().iter().map(|edge| edge.as_range_m()).collect())
    }

    /// The peak that the depth is found by, significant or not.
    pub(crate) fn peak(&self, known: &PixelContext, counts: &[u16]) -> Option<Peak> {
        let sight = self.sight(known.pixel, known.start, counts);
        sight.sighting.map(|sighting| sighting.peak)
    }

    /// What the `counts` of a macropixel with this start value say, one for each bin.
    fn sight(&self, pixel: usize, start: Option<u16>, counts: &[u16]) -> Sight<'_> {
        let law = own_law(&self.law, pixel);
        let window = start.and_then(|start| law.window(start).open());
        let counts: Vec<u32> = counts.iter().map(|&n| n.into()).collect();
        let place = AimedHistogram {
            pixel,
            start: start.unwrap_or(self.farthest),
            law: &law,
            profile: self.aims.profile(),
            peak: &self.options.peak,
        };
        let sighting = window.and_then(|_| place.find(&self.finder, &counts));
        let found = sighting.filter(|s| s.is_significant && !s.is_saturated);
        let range_m = |bins: f64, at: usize| place.range_m(window?, &counts, bins, at);
        let to_m = |bins: f64| bins * self.bin_m();
        let in_front = |depth_m, bound_bins: Option<f64>| {
            in_front(depth_m, bound_bins.map(to_m), self.bin_m())
        };
        let of_fit = found.and_then(|s| range_m(s.position_bins, s.peak.peak_bin));
        let told = of_fit.and_then(|depth_m| in_front(depth_m, found?.bound_bins));
        let is_behind = of_fit.is_some() && told.is_none();
        let found = found.filter(|_| !is_behind);
        let (measured_m, bound_m) = told.unzip();
        let bound_m = bound_m.flatten();
        let no_depth = match sighting {
            _ if found.is_some() => None,
            _ if is_behind => Some(NoDepth::BehindLidar),
            _ if start.is_none() => Some(NoDepth::NoGuide),
            Some(sighting) if sighting.is_saturated => Some(NoDepth::Saturated),
            _ => Some(NoDepth::NoSignificantPeak),
        };
        let spread_m = found.filter(|s| s.bound_bins.is_some()).and_then(|s| {
            let spread_bins = self.finder.spread_bins(&s.light?)?;
            Some(to_m(spread_bins))
        });
        let first = found.zip(measured_m).map(|(s, depth_m)| DepthReturn {
            depth_m,
            bound_m,
            spread_m,
            photons: s.light.map_or_else(
                || s.peak.signal_counts / f64::from(self.law.exposure().laser_cycles),
                |light| light.signal,
            ),
            confidence: s.confidence,
        });
        let others = found.into_iter().flat_map(|s| s.others).flatten();
        let others = others.filter_map(|other| {
            let at = other.position_bins.round().max(0.0) as usize;
            let at = at.min(counts.len() - 1);
            let depth_m = range_m(other.position_bins, at)?;
            let (depth_m, bound_m) = in_front(depth_m, other.bound_bins)?;
            Some(DepthReturn {
                depth_m,
                bound_m,
                spread_m: other.spread_bins.map(to_m),
                photons: other.photons,
                confidence: other.confidence,
            })
        });
        let returns: DepthReturns = first.into_iter().chain(others).collect();
        let reading = Reading {
            measured_m,
            bound_m,
            spread_m,
            returns,
            walk_left: found.and_then(|s| s.walk_left),
            no_depth,
            peak_m: sighting.and_then(|s| range_m(s.peak.position_bins, s.peak.peak_bin)),
            confidence: sighting.map(|s| s.confidence),
        };
        Sight {
            reading,
            sighting,
            window,
            law,
        }
    }

    /// The macropixel's depth from its `counts`, one for each bin.
    pub fn depth(&self, known: &PixelContext, counts: &[u16]) -> PixelDepth {
        let &PixelContext {
            pixel,
            start,
            true_m,
            guide_m,
        } = known;
        let sight = self.sight(pixel, start, counts);
        let in_window = sight.window.zip(true_m).is_some_and(|(window, true_m)| {
            sight
                .law
                .interval(&window)
                .contains(&Time::of_flight(true_m))
        });
        let no_depth = sight.reading.no_depth.map(|seen| match seen {
            _ if true_m.is_none() => NoDepth::NoSurface,
            _ if start.is_none() && guide_m.is_none() => NoDepth::NoGuide,
            _ if start.is_none() => NoDepth::OutOfReach,
            _ if !self.spads_fire => NoDepth::SpadsOff,
            NoDepth::Saturated | NoDepth::BehindLidar => seen,
            _ if !in_window => NoDepth::OutsideWindow,
            _ => NoDepth::NoSignificantPeak,
        });
        PixelDepth {
            true_m,
            guide_m,
            start,
            in_window,
            measured_m: sight.reading.measured_m,
            bound_m: sight.reading.bound_m,
            spread_m: sight.reading.spread_m,
            returns: sight.reading.returns,
            walk_left: sight.reading.walk_left,
            no_depth,
            peak_m: sight.reading.peak_m,
            confidence: sight.reading.confidence,
        }
    }

    /// What `of` makes of every macropixel and its counts; `counts` are those of the array, rows × cols × bins.
    ///
    /// # Panics
    /// When there is not a count for every bin of the array.
    pub(crate) fn of_array<T: Send>(
        &self,
        counts: &[u16],
        evaluate: impl Fn(usize, &[u16]) -> T + Sync,
    ) -> Vec<T> {
        let sensor = self.law.sensor();
        assert_eq!(counts.len(), sensor.pixels() * sensor.bins);
        let pixels = counts.par_chunks_exact(sensor.bins).enumerate();
        pixels
            .map(|(pixel, counts)| evaluate(pixel, counts))
            .collect()
    }
}

/// Bounds within which a depth behind the lidar may be one at the lidar.
const WITHIN_BOUNDS: f64 = 5.0;

/// What is told of a depth that a fit may have put behind the lidar: nothing is there. Up to five bounds behind, or a bin where there is no bound,
/// the depth is 0, and off by as much at least; `None` beyond.
fn in_front(depth_m: f64, bound_m: Option<f64>, bin_m: f64) -> Option<(f64, Option<f64>)> {
    let behind_m = (-depth_m).max(0.0);
    let most_m = bound_m.map_or(bin_m, |bound_m| WITHIN_BOUNDS * bound_m);
    (behind_m <= most_m).then(|| {
        (
            depth_m.max(0.0),
            bound_m.map(|bound_m| bound_m.max(behind_m)),
        )
    })
}

/// What a histogram says, and through which window.
struct Sight<'l> {
    reading: Reading,
    sighting: Option<Sighting>,
    window: Option<OpenWindow>,
    law: Cow<'l, WindowLaw>,
}

/// What a histogram says of distance where nothing is known of what is really there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Distance, where the peak is significant and not saturated, m.
    pub measured_m: Option<f64>,
    /// Cramér-Rao bound of it, where range walk is taken out, m.
    pub bound_m: Option<f64>,
    /// Standard deviation of the depths within the macropixel, where there is a bound, m.
    pub spread_m: Option<f64>,
    /// All echoes of the window, that of the distance first.
    pub returns: DepthReturns,
    /// Why range walk is left in it.
    pub walk_left: Option<WalkLeft>,
    /// Why there is none: no guide (SPADs are off), saturated, no significant peak, or an echo from behind the lidar.
    pub no_depth: Option<NoDepth>,
    /// Distance of the histogram's peak with its range walk, significant or not, m.
    pub peak_m: Option<f64>,
    /// −log₁₀ of the chance that light without an echo makes such a peak; `None` where there is no peak.
    pub confidence: Option<f64>,
}

/// Checks that a chip may have counted so much in this exposure; `name` is that of the counts.
///
/// # Errors
/// The first bin with more counts than are possible.
pub fn check_counts(
    name: impl std::fmt::Display,
    (sensor, exposure): (&Sensor, &Exposure),
    counts: &[u16],
) -> Result<(), InputError> {
    let of_a_cycle = match sensor.tdc {
        Tdc::Clocked | Tdc::DelayLine => 1,
        Tdc::Counter => sensor.spads() as u64,
    };
    let full = (1 << sensor.bin_bits) - 1;
    let most = full.min(of_a_cycle * u64::from(exposure.laser_cycles));
    let Some(at) = counts.iter().position(|&count| u64::from(count) > most) else {
        return Ok(());
    };
    let (pixel, bin) = (at / sensor.bins, at % sensor.bins);
    let (row, col) = (pixel / sensor.cols, pixel % sensor.cols);
    let message = format!(
        "has {} counts in bin {bin} of macropixel ({row}, {col}), and a bin of {} bits counts at most {most} in {} laser cycles; give counts of this sensor and exposure",
        counts[at], sensor.bin_bits, exposure.laser_cycles
    );
    Err(InputError::new(name, message))
}

/// Depths from histograms of whatever origin: `counts` are those of the array, rows × cols × bins, counted in the windows of `starts`,
/// row-major, `None` where SPADs are off. Of the scene only the laser pulse matters; `calibration` is that of delay lines.
///
/// # Errors
/// Bins that depths are not found in.
///
/// # Panics
/// When there is not a start value for each macropixel and a count for each bin.
pub fn range_counts(
    (sensor, exposure): (&Sensor, &Exposure),
    scene: &Scene,
    options: &DepthOptions,
    calibration: Option<&BinProfile>,
    starts: &[Option<u16>],
    counts: &[u16],
) -> Result<Vec<Reading>, UnequalBins> {
    assert_eq!(starts.len(), sensor.pixels());
    let ranger = Ranger::new(sensor, exposure, scene, options, calibration)?;
    let reading = |pixel, counts: &[u16]| ranger.sight(pixel, starts[pixel], counts).reading;
    Ok(ranger.of_array(counts, reading))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_depth_is_behind_the_lidar_by_more_than_its_bound_or_not_at_all() {
        let in_front = |depth_m, bound_m| in_front(depth_m, bound_m, 0.4);
        assert_eq!(in_front(0.1, Some(0.02)), Some((0.1, Some(0.02))));
        assert_eq!(in_front(-0.01, Some(0.02)), Some((0.0, Some(0.02))));
        assert_eq!(in_front(-0.09, Some(0.02)), Some((0.0, Some(0.09))));
        assert_eq!(in_front(-0.11, Some(0.02)), None);
        assert_eq!(in_front(-0.39, None), Some((0.0, None)));
        assert_eq!(in_front(-0.41, None), None);
    }
}
