//! Costs of a row: in how many comparisons of the census two pixels differ, for every pixel and every disparity.
//!
//! Signatures of the right image stand in reversed order, so that partners of rising disparity are neighbours:
//!
//! ```text
//!  left    … x …                       lane         0     1     2
//!  right   … x−min−2  x−min−1  x−min …   reversed   x−min x−min−1 x−min−2 …
//! ```

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;

use super::census::{Layout, Signatures};
use super::image::GreyImage;
use super::settings::{Matcher, NO_PARTNER};

/// The signatures of both images, and which lanes have partners.
pub(super) struct Costs {
    left: Signatures,
    right: Signatures,
    width: usize,
    min_disparity: isize,
    disparities: usize,
    /// Where the right row's last column stands.
    front: usize,
}

impl Costs {
    pub(super) fn new(
        matcher: &Matcher,
        left: &GreyImage,
        right: &GreyImage,
        lanes: usize,
    ) -> Self {
        let min_disparity = matcher.min_disparity as isize;
        let front = min_disparity.min(0).unsigned_abs();
        let back = min_disparity.max(0) as usize + lanes;
        let plain = Layout {
            pads: (0, 0),
            reversed: false,
        };
        let turned = Layout {
            pads: (front, back),
            reversed: true,
        };
        Costs {
            left: Signatures::new(left, matcher.census, plain),
            right: Signatures::new(right, matcher.census, turned),
            width: left.width(),
            min_disparity,
            disparities: matcher.disparities,
            front,
        }
    }

    /// Length of a row of the right image by lanes: for column x, lane d has its partner at [`Costs::partner`] + d.
    pub(super) fn partners(&self, lanes: usize) -> usize {
        self.front + self.width + self.min_disparity.max(0) as usize + lanes
    }

    /// Where lane 0 of column `x` stands in a row of the right image.
    pub(super) fn partner(&self, x: usize) -> usize {
        let from_right = (self.width - 1 - x + self.front) as isize;
        (from_right + self.min_disparity) as usize
    }

    /// Lanes of column `x` that have a partner, first to beyond the last.
    fn paired(&self, x: usize) -> (usize, usize) {
        let greatest = x as isize - self.min_disparity;
        let first = (greatest - (self.width as isize - 1)).max(0) as usize;
        let end = (greatest + 1).clamp(0, self.disparities as isize) as usize;
        (first.min(end), end)
    }

    /// Writes the costs of row `y`, `LANES` to a pixel.
    pub(super) fn row(&self, y: usize, lanes: usize, out: &mut [u8]) {
        row(self, y, lanes, out);
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx512bitalg",
    "x86_64+avx2"
))]
fn row(costs: &Costs, y: usize, lanes: usize, out: &mut [u8]) {
    match lanes {
        32 => row_of::<32>(costs, y, out),
        64 => row_of::<64>(costs, y, out),
        128 => row_of::<128>(costs, y, out),
        _ => row_of::<256>(costs, y, out),
    }
}

#[inline(always)]
fn row_of<const LANES: usize>(costs: &Costs, y: usize, out: &mut [u8]) {
    let (left, left_stride) = costs.left.row(y);
    let (right, right_stride) = costs.right.row(y);
    for (x, out) in out.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
        let (first, end) = costs.paired(x);
        *out = [0; LANES];
        if first < end {
            let partner = costs.partner(x);
            let planes = left.chunks_exact(left_stride);
            for (left, right) in planes.zip(right.chunks_exact(right_stride)) {
                let own = left[x];
                let partners: &[u8; LANES] = right[partner..partner + LANES]
                    .try_into()
                    .expect("as long as asked");
                for (cost, partner) in out.iter_mut().zip(partners) {
                    *cost += (own ^ partner).count_ones() as u8;
                }
            }
        }
        if end - first < LANES {
            out[..first].fill(NO_PARTNER);
            out[end..].fill(NO_PARTNER);
        }
    }
}
