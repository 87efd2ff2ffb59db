//! One macropixel of a frame: its depth and how sure that is, or the one reason why it has none.

use serde::{Deserialize, Serialize};

use crate::ranging::WalkLeft;
use crate::report::CloudPoint;
use crate::scene::PinholeCamera;

/// Why a macropixel has no depth: the first of these that holds, in this order.
///
/// Two are known to the simulation alone, not to the chip: that there is no surface, and that a surface lies outside the
/// window. Both only say why no peak stood out. A window without its surface whose peak is significant all the same gets a
/// depth, as it would from the real chip, and counts as an outlier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoDepth {
    /// The macropixel sees the sky.
    NoSurface,
    /// The guide has no estimate; the SPADs are switched off.
    NoGuide,
    /// No start value opens a window on the guide's estimate; the SPADs are switched off.
    OutOfReach,
    /// No SPAD can fire: they detect no photons and make no dark counts.
    SpadsOff,
    /// A bin of the peak is full, or light so strong that its counts do not tell where it came.
    Saturated,
    /// The surface lies outside the window, and no peak is significant.
    OutsideWindow,
    /// The surface lies in the window, and no peak is significant.
    NoSignificantPeak,
    /// The echo seems to come from behind the lidar, by more than its bound.
    BehindLidar,
}

impl NoDepth {
    /// Every reason, in their order.
    pub const ALL: [NoDepth; 8] = [
        NoDepth::NoSurface,
        NoDepth::NoGuide,
        NoDepth::OutOfReach,
        NoDepth::SpadsOff,
        NoDepth::Saturated,
        NoDepth::OutsideWindow,
        NoDepth::NoSignificantPeak,
        NoDepth::BehindLidar,
    ];

    /// The reason as a number in arrays: its place in [`NoDepth::ALL`] from 1 on, and 0 where there is a depth.
    pub fn number(no_depth: Option<Self>) -> u8 {
        no_depth.map_or(0, |why| 1 + why as u8)
    }

    /// In tables and legends.
    pub const fn name(self) -> &'static str {
        match self {
            NoDepth::NoSurface => "no surface",
            NoDepth::NoGuide => "no guide",
            NoDepth::OutOfReach => "out of reach",
            NoDepth::SpadsOff => "SPADs off",
            NoDepth::Saturated => "saturated",
            NoDepth::OutsideWindow => "target outside window",
            NoDepth::NoSignificantPeak => "no significant peak",
            NoDepth::BehindLidar => "echo from behind the lidar",
        }
    }
}

/// One echo of a macropixel's window. Distances are radial, in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DepthReturn {
    /// From the counts, with range walk taken out where there is a bound.
    pub depth_m: f64,
    /// As [`PixelDepth::bound_m`].
    pub bound_m: Option<f64>,
    /// Standard deviation of the depths that the macropixel sees there: of what widens the laser's pulse to this echo.
    pub spread_m: Option<f64>,
    /// Photons that the SPADs would detect in a laser cycle without dead time; without a bound the echo's counts over the laser cycles.
    pub photons: f64,
    /// −log₁₀ of the chance that light without this echo makes such counts.
    pub confidence: f64,
}

/// Returns of a macropixel that are told, at most.
pub const RETURNS: usize = 4;

/// Up to four returns, strongest first. In files they are a list.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Vec<DepthReturn>", into = "Vec<DepthReturn>")]
pub struct DepthReturns([Option<DepthReturn>; RETURNS]);

impl DepthReturns {
    /// The returns, strongest first.
    pub fn iter(&self) -> impl Iterator<Item = &DepthReturn> {
        self.0.iter().flatten()
    }

    /// A number of each; not a number where there are fewer, or it has none.
    pub fn numbers(&self, number: impl Fn(&DepthReturn) -> Option<f64>) -> [f64; RETURNS] {
        self.0
            .map(|of| of.and_then(|of| number(&of)).unwrap_or(f64::NAN))
    }

    /// The `n`-th of them, from 0 on.
    pub fn get(&self, n: usize) -> Option<&DepthReturn> {
        self.iter().nth(n)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.get(0).is_none()
    }
}

impl FromIterator<DepthReturn> for DepthReturns {
    fn from_iter<I: IntoIterator<Item = DepthReturn>>(returns: I) -> Self {
        let mut all = returns.into_iter();
        DepthReturns(std::array::from_fn(|_| all.next()))
    }
}

impl From<Vec<DepthReturn>> for DepthReturns {
    fn from(returns: Vec<DepthReturn>) -> Self {
        returns.into_iter().collect()
    }
}

impl From<DepthReturns> for Vec<DepthReturn> {
    fn from(returns: DepthReturns) -> Self {
        returns.iter().copied().collect()
    }
}

/// One macropixel of a frame. Distances are radial, in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PixelDepth {
    /// Ground truth; `None` for the sky.
    pub true_m: Option<f64>,
    /// The guide's estimate.
    pub guide_m: Option<f64>,
    /// Start value, where the guide gave one within reach; in the conventional mode any, everywhere.
    pub start: Option<u16>,
    /// Whether the echo's centre lies in the time window.
    pub in_window: bool,
    /// Depth from the histogram, where its peak is significant and not saturated.
    pub measured_m: Option<f64>,
    /// Standard deviation of that depth: the least that its counts allow (Cramér-Rao), with what its spread and other lights add; of a pulse
    /// within a bin, that of all places which explain the counts; a bin where the echo is saturated. `None` where range walk is not taken out, or the window cuts the echo off.
    #[serde(default)]
    pub bound_m: Option<f64>,
    /// Standard deviation of the depths within the macropixel, from the width of its echo; `None` where there is no bound.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spread_m: Option<f64>,
    /// All echoes of the window, the one of the depth first.
    #[serde(default, skip_serializing_if = "DepthReturns::is_empty")]
    pub returns: DepthReturns,
    /// Why range walk is left in that depth; `None` where it is taken out, or was not asked to be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub walk_left: Option<WalkLeft>,
    /// Why there is no depth; `None` exactly where there is one.
    pub no_depth: Option<NoDepth>,
    /// Distance of the histogram's peak with its range walk, significant or not.
    pub peak_m: Option<f64>,
    /// −log₁₀ of the chance that light without an echo makes such a peak; `None` where there is no peak.
    pub confidence: Option<f64>,
}

/// A point for each return of the array's `pixels`, row by row.
pub fn point_cloud(camera: &PinholeCamera, cols: usize, pixels: &[PixelDepth]) -> Vec<CloudPoint> {
    let points = pixels.iter().enumerate().flat_map(|(pixel, of)| {
        let (row, col) = (pixel / cols, pixel % cols);
        let towards = camera.direction((row, col));
        let point = move |(number, found): (u16, &DepthReturn)| CloudPoint {
            at_m: (towards * found.depth_m).to_array().map(|x| x as f32),
            intensity: found.photons as f32,
            confidence: found.confidence as f32,
            pixel: [row as u16, col as u16],
            number,
        };
        (1..).zip(of.returns.iter()).map(point)
    });
    points.collect()
}

impl PixelDepth {
    /// Measured less true distance, m.
    pub fn error_m(&self) -> Option<f64> {
        Some(self.measured_m? - self.true_m?)
    }

    /// The peak's less the true distance, m: the error with range walk, and before peaks are judged.
    pub(crate) fn peak_error_m(&self) -> Option<f64> {
        Some(self.peak_m? - self.true_m?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_numbered_in_their_order() {
        let numbers = NoDepth::ALL.map(|why| NoDepth::number(Some(why)));
        assert_eq!(numbers, [1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(NoDepth::number(None), 0);
    }
}
