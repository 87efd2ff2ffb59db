//! Depths from existing histograms: a frame's own once more, or those that a real chip counted in the same windows.

use super::pixel::PixelDepth;
use super::ranger::{PixelContext, Ranger};
use super::summary::FrameSummary;
use super::taken::{TakenFrame, TakenSettings};
use crate::ranging::{BinProfile, DepthOptions, UnequalBins};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Depths of an array.
#[derive(Debug, Clone)]
pub struct ArrayDepths {
    /// Every macropixel, row-major.
    pub pixels: Vec<PixelDepth>,
    /// Light's way there and back in one bin, m.
    pub bin_m: f64,
}

impl ArrayDepths {
    /// In a few numbers.
    pub fn summary(&self) -> FrameSummary {
        FrameSummary::new(&self.pixels, self.bin_m)
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
    pub fn range(
        &self,
        counts: &[u16],
        options: &DepthOptions,
        calibration: Option<&BinProfile>,
    ) -> Result<ArrayDepths, UnequalBins> {
        let TakenSettings {
            sensor,
            exposure,
            scene,
            ..
        } = &self.settings;
        let ranger = Ranger::new(sensor, exposure, scene, options, calibration)?;
        let depth = |pixel: usize, counts: &[u16]| {
            ranger.depth(&PixelContext::new(pixel, &self.pixels[pixel]), counts)
        };
        Ok(ArrayDepths {
            pixels: ranger.of_array(counts, depth),
            bin_m: ranger.bin_s() * SPEED_OF_LIGHT_M_PER_S / 2.0,
        })
    }
}
