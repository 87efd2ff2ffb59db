//! The census: each pixel's neighbours as bits, 1 where the neighbour is darker. Gain, exposure and vignetting do not change it.
//!
//! Bits are kept eight to a byte, and the same byte of all pixels of a row stands in a row of its own (a plane), so that costs are counted in bytes,
//! as many at once as a vector holds. Beyond the border, the image continues with the border's pixels.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;
use rayon::prelude::*;

use super::image::GreyImage;
use super::settings::Census;

/// Bits of all pixels: `planes` bytes each.
pub(super) struct Signatures {
    planes: usize,
    stride: usize,
    bytes: Vec<u8>,
}

/// How rows of a [`Signatures`] are laid out.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    /// Bytes in front of and behind a row's.
    pub(super) pads: (usize, usize),
    /// The last column comes first.
    pub(super) reversed: bool,
}

impl Signatures {
    pub(super) fn new(image: &GreyImage, census: Census, layout: Layout) -> Self {
        let (width, height) = (image.width(), image.height());
        let planes = census.bits().div_ceil(8);
        let stride = layout.pads.0 + width + layout.pads.1;
        let mut bytes = vec![0; planes * stride * height];
        let rows = bytes.par_chunks_mut(planes * stride).enumerate();
        rows.with_min_len(16).for_each_init(
            || Neighbourhood::new(width, census),
            |around, (y, out)| {
                around.load_rows(image, y);
                for (plane, out) in out.chunks_exact_mut(stride).enumerate() {
                    let out = &mut out[layout.pads.0..][..width];
                    around.compare(plane, out);
                    if layout.reversed {
                        out.reverse();
                    }
                }
            },
        );
        Signatures {
            planes,
            stride,
            bytes,
        }
    }

    /// All planes of row `y`, pads included, and the length of each.
    pub(super) fn row(&self, y: usize) -> (&[u8], usize) {
        let length = self.planes * self.stride;
        (&self.bytes[y * length..(y + 1) * length], self.stride)
    }
}

/// The rows around one row, continued at both ends.
struct Neighbourhood {
    width: usize,
    census: Census,
    rows: Vec<Vec<u16>>,
}

impl Neighbourhood {
    fn new(width: usize, census: Census) -> Self {
        let rows = vec![vec![0; width + census.cols - 1]; census.rows];
        Neighbourhood {
            width,
            census,
            rows,
        }
    }

    fn load_rows(&mut self, image: &GreyImage, y: usize) {
        let side = self.census.cols / 2;
        let last = image.height() - 1;
        for (i, row) in self.rows.iter_mut().enumerate() {
            let from = image.row((y + i).saturating_sub(self.census.rows / 2).min(last));
            row[..side].fill(from[0]);
            row[side..side + from.len()].copy_from_slice(from);
            row[side + from.len()..].fill(from[from.len() - 1]);
        }
    }

    fn compare(&self, plane: usize, out: &mut [u8]) {
        let Census { cols, rows } = self.census;
        let centre = &self.rows[rows / 2][cols / 2..][..self.width];
        let middle = rows / 2 * cols + cols / 2;
        let neighbours = (0..cols * rows).filter(|&i| i != middle);
        out.fill(0);
        for (bit, i) in neighbours.skip(8 * plane).take(8).enumerate() {
            darker(
                &self.rows[i / cols][i % cols..][..self.width],
                centre,
                1 << bit,
                out,
            );
        }
    }
}

/// Sets `bit` where the neighbour is darker.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx512bitalg",
    "x86_64+avx2"
))]
fn darker(neighbours: &[u16], centre: &[u16], bit: u8, out: &mut [u8]) {
    for ((out, n), c) in out.iter_mut().zip(neighbours).zip(centre) {
        *out |= if n < c { bit } else { 0 };
    }
}
