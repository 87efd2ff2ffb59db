//! Patterns on surfaces: two materials and where which of them shows.
//!
//! ```text
//!   checker  ■□■□   stripes  │█│ │█│   noise  clouds of six sizes, each half the last   image  a picture, tiled
//! ```
//!
//! A pattern is a share, 1 for the object's own material and 0 for its second one, over metres along the surface. Laser and
//! cameras see the same pattern, each with its own two reflectivities: what is black and white to a camera may be one
//! grey at 940 nm.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

use multiversion::multiversion;

use crate::files::{InputError, Raster};

/// Sizes of the clouds of noise: from `size_m` to a 32nd of it, so that a texture of half a metre has details of
/// 16 mm, a pixel of the thesis's cameras at 55 m.
const OCTAVES: usize = 6;

/// How strong the clouds of each size are: fine ones as coarse ones up to a half, because matchers live on them.
static STRENGTHS: LazyLock<[f64; OCTAVES]> = LazyLock::new(|| {
    std::array::from_fn(|octave| libm::pow(0.5f64, octave as f64 / (OCTAVES - 1) as f64))
});

/// A pattern of an object's material and a second one.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    /// What it looks like.
    pub pattern: Pattern,
    /// Edge of a checker, width of a stripe, size of the largest clouds, width of a picture, m.
    pub size_m: f64,
    /// Reflectivity of the second material at the laser's wavelength, 0 to 1.
    pub second_reflectivity: f64,
    /// What cameras see of the second material, 0 to 1; `None` for the same as the laser's.
    pub second_grey: Option<f64>,
    /// By how much the pattern is shifted along the surface, right and down, m.
    pub shift_m: (f64, f64),
    /// By how much the surface's coordinates are turned before they are shifted, degrees.
    pub turn_deg: f64,
    /// By how much a sphere, cylinder or cone has been turned to the left since it got its pattern: the rig's turn to the right,
    /// degrees. Other shapes carry their own turn.
    pub seen_turned_deg: f64,
}

/// What a texture looks like.
#[derive(Debug, Clone, PartialEq)]
pub enum Pattern {
    /// Squares.
    Checker,
    /// Upright stripes.
    Stripes,
    /// Clouds; equal seeds give equal ones.
    Noise(u32),
    /// A picture, side by side and one above the other.
    Image(Arc<Picture>),
}

/// A picture as a pattern.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// The file it was read from.
    pub path: PathBuf,
    /// Shares of white, row by row from the top left.
    raster: Raster,
}

impl Picture {
    /// Reads a picture; white is 1, black 0, linearly in what the file holds.
    ///
    /// # Errors
    /// As [`Raster::read`], or where a value is no number.
    pub(crate) fn read(path: &Path) -> Result<Self, InputError> {
        let mut raster = Raster::read(path)?;
        if let Some(at) = raster.values.iter().position(|v| !v.is_finite()) {
            let (row, col) = (at / raster.width, at % raster.width);
            let message = format!(
                "has no number at row {row}, column {col} ({}); give shares from 0 to 1 everywhere",
                raster.values[at]
            );
            return Err(InputError::new(path.display(), message));
        }
        for value in &mut raster.values {
            *value = (*value / raster.white).clamp(0.0, 1.0);
        }
        Ok(Picture {
            path: path.to_owned(),
            raster,
        })
    }

    /// Between the four pixels around a point given in widths of the picture.
    fn share_at(&self, (u, v): (f64, f64)) -> f64 {
        let (width, height) = (self.raster.width, self.raster.height);
        let (x, y) = (u * width as f64 - 0.5, v * width as f64 - 0.5);
        let cell = |at: f64, count: usize| {
            let first = at.floor().rem_euclid(count as f64) as usize % count;
            (first, (first + 1) % count, at - at.floor())
        };
        let ((left, right, to_right), (top, bottom, down)) = (cell(x, width), cell(y, height));
        let value = |row, col| f64::from(self.raster.value(row, col));
        let row = |row| value(row, left) * (1.0 - to_right) + value(row, right) * to_right;
        row(top) * (1.0 - down) + row(bottom) * down
    }
}

impl Texture {
    /// A pattern of `size_m` with a second material that laser and cameras see alike.
    pub(crate) fn new(pattern: Pattern, size_m: f64, second_reflectivity: f64) -> Self {
        Texture {
            pattern,
            size_m,
            second_reflectivity,
            second_grey: None,
            shift_m: (0.0, 0.0),
            turn_deg: 0.0,
            seen_turned_deg: 0.0,
        }
    }

    /// Share of the object's own material at a point of its surface, 0 to 1.
    pub(crate) fn share_at(&self, (right_m, down_m): (f64, f64)) -> f64 {
        let (sine, cosine) = match self.turn_deg {
            0.0 => (0.0, 1.0),
            deg => libm::sincos(deg.to_radians()),
        };
        let u = (cosine * right_m - sine * down_m + self.shift_m.0) / self.size_m;
        let v = (sine * right_m + cosine * down_m + self.shift_m.1) / self.size_m;
        match &self.pattern {
            Pattern::Checker => f64::from((u.floor() + v.floor()).rem_euclid(2.0) < 1.0),
            Pattern::Stripes => f64::from(u.floor().rem_euclid(2.0) < 1.0),
            Pattern::Noise(seed) => noise((u, v), *seed),
            Pattern::Image(picture) => picture.share_at((u, v)),
        }
    }
}

/// Clouds about 1/2, from 0 to 1: values at the corners of a lattice, smoothly between them, over lattices that halve.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1"
))]
fn noise((u, v): (f64, f64), seed: u32) -> f64 {
    // Loops without closures over arrays: those are compiled once, for any machine.
    let mut places = [[0.0; 2]; OCTAVES];
    let mut corners = [[0; OCTAVES]; 4];
    for octave in 0..OCTAVES {
        let finer = f64::from(1 << octave);
        // Every lattice is shifted, so that no point is a corner of all of them.
        let shift = 0.37 * octave as f64;
        let (x, y) = (u * finer + shift, v * finer + shift);
        let (left, top) = (x.floor(), y.floor());
        places[octave] = [x - left, y - top];
        let which = (u64::from(seed) << 8 | octave as u64).wrapping_mul(0x1656_67b1_9e37_79f9);
        let (left, right) = (column(left) ^ which, column(left + 1.0) ^ which);
        let (top, bottom) = (row(top), row(top + 1.0));
        corners[0][octave] = left ^ top;
        corners[1][octave] = right ^ top;
        corners[2][octave] = left ^ bottom;
        corners[3][octave] = right ^ bottom;
    }
    let mut values = [[0.0; OCTAVES]; 4];
    for corner in 0..4 {
        for octave in 0..OCTAVES {
            values[corner][octave] = mixed(corners[corner][octave]);
        }
    }
    let strengths = &*STRENGTHS;
    let (mut sum, mut squares) = (0.0, 0.0);
    for octave in 0..OCTAVES {
        let (right, down) = (smooth(places[octave][0]), smooth(places[octave][1]));
        let above = mix(values[0][octave], values[1][octave], right);
        let below = mix(values[2][octave], values[3][octave], right);
        sum += strengths[octave] * mix(above, below, down);
        squares += strengths[octave] * strengths[octave];
    }
    // Two standard deviations of the sum, of which a lattice's is 1/sqrt(12) times what is left between corners, about
    // 0.62 on average, reach from 0 to 1.
    let sigma = 0.62 * (squares / 12.0).sqrt();
    (0.5 + sum / (4.0 * sigma)).clamp(0.0, 1.0)
}

#[inline(always)]
fn smooth(t: f64) -> f64 {
    t * t * (3.0 - 2.0 * t)
}

#[inline(always)]
fn mix(a: f64, b: f64, share: f64) -> f64 {
    a + (b - a) * share
}

/// What a corner's column gives to its place, and what its row does.
#[inline(always)]
fn column(x: f64) -> u64 {
    (x as i64 as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
}

#[inline(always)]
fn row(y: f64) -> u64 {
    (y as i64 as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
}

/// The value at a corner of a lattice, -1/2 to 1/2: a mix of its place (SplitMix64's last steps).
#[inline(always)]
fn mixed(place: u64) -> f64 {
    let mixed = (place ^ (place >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    // 53 bits, which are the same with a sign.
    ((mixed ^ (mixed >> 31)) >> 11) as i64 as f64 / (1u64 << 53) as f64 - 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn checkers_and_stripes_change_at_their_edges() {
        let checker = Texture::new(Pattern::Checker, 0.5, 0.1);
        assert_eq!(checker.share_at((0.1, 0.1)), 1.0);
        assert_eq!(checker.share_at((0.6, 0.1)), 0.0);
        assert_eq!(checker.share_at((0.6, 0.6)), 1.0);
        assert_eq!(checker.share_at((-0.1, 0.1)), 0.0);
        let stripes = Texture::new(Pattern::Stripes, 0.5, 0.1);
        assert_eq!(stripes.share_at((0.6, 0.1)), stripes.share_at((0.6, 7.1)));
        assert_ne!(stripes.share_at((0.6, 0.1)), stripes.share_at((0.1, 0.1)));
    }

    #[test]
    fn a_picture_is_tiled_and_its_pixels_have_their_values_at_their_centres() {
        let raster = Raster {
            width: 2,
            height: 1,
            values: vec![0.25, 1.0],
            white: 1.0,
        };
        let path = PathBuf::new();
        let picture = Arc::new(Picture { path, raster });
        let texture = Texture::new(Pattern::Image(picture), 2.0, 0.1);
        for (x, share) in [
            (0.5, 0.25),
            (1.5, 1.0),
            (2.5, 0.25),
            (-0.5, 1.0),
            (1.0, 0.625),
        ] {
            assert!((texture.share_at((x, 0.7)) - share).abs() < 1e-9, "{x}");
        }
    }

    #[test]
    fn noise_uses_its_range_evenly_about_a_half_and_seeds_differ() {
        let at =
            |number: u32, seed| noise((0.173 * f64::from(number), 0.319 * f64::from(number)), seed);
        let shares: Vec<f64> = (0..20_000).map(|number| at(number, 1)).collect();
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        let variance = shares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / shares.len() as f64;
        assert!((mean - 0.5).abs() < 0.03, "{mean}");
        assert!((0.2..0.3).contains(&variance.sqrt()), "{}", variance.sqrt());
        let alike = (0..1000).filter(|&number| (at(number, 1) - at(number, 2)).abs() < 0.01);
        assert!(alike.count() < 100);
    }

    /// Clouds one after the other and corner by corner, the slow way.
    fn plain_noise((u, v): (f64, f64), seed: u32) -> f64 {
        let (mut sum, mut squares) = (0.0, 0.0);
        for octave in 0..6u32 {
            let (finer, shift) = (2f64.powi(octave as i32), 0.37 * f64::from(octave));
            let (x, y) = (u * finer + shift, v * finer + shift);
            let (left, top) = (x.floor(), y.floor());
            let value = |x: f64, y: f64| {
                let place = (x as i64 as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
                    ^ (y as i64 as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
                    ^ (u64::from(seed) << 8 | u64::from(octave))
                        .wrapping_mul(0x1656_67b1_9e37_79f9);
                let mixed = (place ^ (place >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                ((mixed ^ (mixed >> 31)) >> 11) as f64 / 2f64.powi(53) - 0.5
            };
            let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
            let (right, down) = (smooth(x - left), smooth(y - top));
            let between = |a: f64, b: f64, share: f64| a + (b - a) * share;
            let row = |y: f64| between(value(left, y), value(left + 1.0, y), right);
            let strength = 0.5f64.powf(f64::from(octave) / 5.0);
            sum += strength * between(row(top), row(top + 1.0), down);
            squares += strength * strength;
        }
        (0.5 + sum / (4.0 * (0.62 * (squares / 12.0f64).sqrt()))).clamp(0.0, 1.0)
    }

    proptest! {
        #[test]
        fn noise_is_that_of_its_corners(u in -1e6f64..1e6, v in -1e3f64..1e3, seed: u32) {
            prop_assert_eq!(noise((u, v), seed), plain_noise((u, v), seed));
        }

        #[test]
        fn shares_are_shares_and_noise_has_no_edges(u in -1e4f64..1e4, v in -1e4f64..1e4, seed: u32) {
            let texture = Texture::new(Pattern::Noise(seed), 0.7, 0.0);
            let share = texture.share_at((u, v));
            prop_assert!((0.0..=1.0).contains(&share));
            prop_assert!((texture.share_at((u + 1e-6, v - 1e-6)) - share).abs() < 1e-2);
        }

        #[test]
        fn a_shifted_and_turned_pattern_is_found_where_it_went(u in -9f64..9.0, v in -9f64..9.0, turn_deg in -180f64..180.0) {
            let plain = Texture::new(Pattern::Noise(3), 0.7, 0.0);
            let moved = Texture { shift_m: (1.5, -2.0), turn_deg, ..plain.clone() };
            let (sine, cosine) = turn_deg.to_radians().sin_cos();
            let there = (cosine * u - sine * v + 1.5, sine * u + cosine * v - 2.0);
            prop_assert!((moved.share_at((u, v)) - plain.share_at(there)).abs() < 1e-9);
        }
    }
}
