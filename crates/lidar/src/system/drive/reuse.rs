//! What a frame of a drive may take over from the one before.

use std::sync::Arc;

use crate::engine::{Histograms, LitPixel};
use crate::photon::{PhotonStream, PixelLight};
use crate::scene::{GroundTruth, Scene};
use crate::system::pixel::PixelDepth;
use crate::system::result::PhaseTimes;
use crate::system::worlds::LastWorld;

/// What was not simulated again in a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct DriveReuse {
    /// The load at gate level.
    pub load: bool,
    /// Ray casting and light of all of the exposure.
    pub world: bool,
    /// Of the views of [`DriveFrame::worlds`](super::DriveFrame::worlds) from every macropixel, those that stood.
    pub views: usize,
    /// Macropixels with the histogram and depth of the frame before.
    pub macropixels: usize,
}

/// What the next frame may reuse.
#[derive(Debug)]
pub(super) struct PreviousFrame {
    pub(super) starts: Vec<u16>,
    pub(super) light: ExposureLight,
    pub(super) histograms: Histograms,
    pub(super) pixels: Vec<PixelDepth>,
}

/// What is there during an exposure, and what of it falls on the array.
#[derive(Debug)]
pub(super) struct ExposureLight {
    pub(super) stream: PhotonStream,
    pub(super) worlds: Vec<Scene>,
    /// The last of them.
    pub(super) newest: Arc<LastWorld>,
    /// In the middle of the exposure.
    pub(super) truth: GroundTruth,
    pub(super) each: Vec<PixelLight>,
    pub(super) pixels: Vec<LitPixel>,
}

/// Macropixels that have the light, start value and photons of the frame before.
pub(super) struct UnchangedPixels<'l> {
    pub(super) last: Option<&'l PreviousFrame>,
    pub(super) is_same: Vec<bool>,
}

impl<'l> UnchangedPixels<'l> {
    pub(super) fn new(last: Option<&'l PreviousFrame>, light: &ExposureLight) -> Self {
        let is_same = match last {
            None => vec![false; light.pixels.len()],
            Some(last) => {
                let pairs = last.light.pixels.iter().zip(&light.pixels);
                pairs.map(|(before, now)| before == now).collect()
            }
        };
        UnchangedPixels { last, is_same }
    }

    pub(super) fn number(&self) -> usize {
        self.is_same.iter().filter(|&&is_same| is_same).count()
    }

    /// The frame before, if this macropixel is the same in it.
    pub(super) fn last_of(&self, pixel: usize) -> Option<&'l PreviousFrame> {
        self.last.filter(|_| self.is_same[pixel])
    }
}

/// What a frame took and left out.
#[derive(Default)]
pub(super) struct Spent {
    pub(super) run: PhaseTimes,
    pub(super) reused: DriveReuse,
}
