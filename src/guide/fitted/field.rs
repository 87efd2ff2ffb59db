//! Random numbers that are alike in neighbouring pixels: pure functions of seed, field and pixel.
//!
//! ```text
//!   fine:     0.6 of the variance patches, 0.2 the mean of 3×3 normals, 0.2 own     as a median filter and smoothness leave errors
//!   patches:  normals on a grid of p pixels, smoothly between them                  as a speckle filter leaves patches
//! ```

use crate::photon::{Purpose, normal, random_stream};

/// Which of the fields of a camera pair.
#[derive(Debug, Clone, Copy)]
pub(super) enum Field {
    Common = 0,
    Own = 1,
    Invalid = 2,
    Gross = 3,
    GrossAt = 4,
    Wide = 5,
}

/// A standard normal number of a grid point; `row` and `col` from −2¹³ to 2¹³.
fn at(seed: u64, field: Field, row: i64, col: i64) -> f64 {
    let place = ((row + (1 << 13)) as u32) << 16 | (col + (1 << 13)) as u32;
    normal(&mut random_stream(
        seed,
        Purpose::StereoField,
        place,
        field as u32,
    ))
}

/// Shares of the variance that 3×3 pixels and that patches have in common; the rest is each pixel's own.
const OF_NINE: f64 = 0.2;
const OF_PATCHES: f64 = 0.6;

/// Standard normal numbers that are alike over some `across_px` pixels; independent where that is 1 or less.
///
/// Over 6 pixels they are alike by 0.71, 0.57, 0.31 and 0.02 at one pixel, two, four and eight.
pub(super) fn fine(seed: u64, row: i64, col: i64, across_px: f64) -> f64 {
    let own = at(seed, Field::Own, row, col);
    if across_px <= 1.0 {
        return own;
    }
    let nine: f64 = (-1..=1)
        .flat_map(|dr| (-1..=1).map(move |dc| (dr, dc)))
        .map(|(dr, dc)| at(seed, Field::Common, row + dr, col + dc))
        .sum();
    let wide = patches(seed, Field::Wide, row, col, across_px);
    OF_PATCHES.sqrt() * wide
        + OF_NINE.sqrt() * nine / 3.0
        + (1.0 - OF_PATCHES - OF_NINE).sqrt() * own
}

/// Standard normal numbers that change over `patch_px` pixels.
pub(super) fn patches(seed: u64, field: Field, row: i64, col: i64, patch_px: f64) -> f64 {
    let (y, x) = (row as f64 / patch_px, col as f64 / patch_px);
    let (top, left) = (y.floor(), x.floor());
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (down, right) = (smooth(y - top), smooth(x - left));
    let (mut sum, mut squares) = (0.0, 0.0);
    for (dr, wr) in [(0, 1.0 - down), (1, down)] {
        for (dc, wc) in [(0, 1.0 - right), (1, right)] {
            let weight = wr * wc;
            sum += weight * at(seed, field, top as i64 + dr, left as i64 + dc);
            squares += weight * weight;
        }
    }
    sum / squares.sqrt()
}

/// A standard normal number that a patch of `patch_px` pixels has in common.
pub(super) fn of_patch(seed: u64, field: Field, row: i64, col: i64, patch_px: f64) -> f64 {
    let cell = |n: i64| (n as f64 / patch_px).floor() as i64;
    at(seed, field, cell(row), cell(col))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn correlation(value: impl Fn(i64, i64) -> f64, apart: i64) -> (f64, f64) {
        let pixels = || (0..160).flat_map(|row| (0..160).map(move |col| (row, col)));
        let variance = pixels().map(|(r, c)| value(r, c).powi(2)).sum::<f64>() / 25_600.0;
        let products: f64 = pixels()
            .map(|(r, c)| value(r, c) * value(r, c + apart))
            .sum();
        (variance, products / 25_600.0 / variance)
    }

    #[test]
    fn neighbours_have_what_they_share_in_common() {
        let value = |row, col| fine(1, row, col, 6.0);
        for (apart, expected) in [(1, 0.71), (2, 0.57), (4, 0.31), (8, 0.02), (16, 0.0)] {
            let (variance, found) = correlation(value, apart);
            assert!((variance - 1.0).abs() < 0.1, "{variance}");
            assert!((found - expected).abs() < 0.06, "{found} at {apart}");
        }
        let (variance, found) = correlation(|row, col| fine(1, row, col, 1.0), 1);
        assert!((variance - 1.0).abs() < 0.05 && found.abs() < 0.03);
    }

    #[test]
    fn patches_are_normal_and_as_large_as_asked() {
        let value = |row, col| patches(2, Field::Invalid, row, col, 8.0);
        let (variance, near) = correlation(value, 1);
        let (_, far) = correlation(value, 16);
        assert!((variance - 1.0).abs() < 0.2, "{variance}");
        assert!(near > 0.9 && far.abs() < 0.15, "{near} {far}");
    }
}
