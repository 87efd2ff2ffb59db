//! Depths from existing histograms: a frame's own once more, or those that a real chip counted in the same windows.

use super::pixel::PixelDepth;
use super::ranger::{Known, Ranger};
use super::summary::Summary;
use super::taken::{TakenFrame, TakenSettings};
use crate::ranging::{BinProfile, DepthOptions, UnequalBins};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Depths of an array.
#[derive(Debug, Clone)]
pub struct Ranged {
    /// Every macropixel, row-major.
    pub pixels: Vec<PixelDepth>,
    /// Light's way there and back in one bin, m.
    pub bin_m: f64,
}

impl Ranged {
    /// In a few numbers.
    pub(crate) fn summary(&self) -> Summary {
        Summary::new(&self.pixels, self.bin_m)
    }
}

impl TakenFrame {
    /// Depths from `counts`, rows × columns × bins, counted in the windows of this frame; `calibration` is that of delay lines, and
    /// true distances and the guide's are the frame's.
    ///
    /// # Errors
    /// Bins that depths cannot be found in.
    ///
    /// # Panics
    /// When there is not a count for every bin of the array.
    pub(crate) fn range(
        &self,
        counts: &[u16],
        options: &DepthOptions,
        calibration: Option<&BinProfile>,
    ) -> Result<Ranged, UnequalBins> {
        let TakenSettings {
            sensor,
            exposure,
            scene,
            ..
        } = &self.settings;
        let ranger = Ranger::new(sensor, exposure, scene, options, calibration)?;
        let depth = |pixel: usize, counts: &[u16]| {
            ranger.depth(&Known::new(pixel, &self.pixels[pixel]), counts)
        };
        Ok(Ranged {
            pixels: ranger.of_array(counts, depth),
            bin_m: ranger.bin_s() * SPEED_OF_LIGHT_M_PER_S / 2.0,
        })
    }
}
