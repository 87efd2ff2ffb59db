//! The colours of depths in `depth.png`, on the page and in Python.
//!
//! Near is yellow, far is dark violet. The scale runs through a few hand-picked colours whose
//! CIE L* lightness falls in even steps, so that equal steps of depth look about equally large,
//! also in grey and to the colour-blind. Between them sRGB values change linearly, which is even
//! in lightness to within the tested bounds.

/// A colour, sRGB.
pub type Rgb = [u8; 3];

/// Nearest to farthest, in equal steps.
pub const DEPTH_COLOURS: [Rgb; 6] = [
    [250, 232, 60],
    [140, 205, 80],
    [42, 165, 135],
    [45, 118, 145],
    [68, 68, 132],
    [66, 10, 86],
];

/// The colour at `position` of the scale, 0 (nearest) to 1 (farthest); clamped, NaN is nearest.
pub(super) fn scale_colour(position: f64) -> Rgb {
    let along = position.clamp(0.0, 1.0) * (DEPTH_COLOURS.len() - 1) as f64;
    let stop = (along as usize).min(DEPTH_COLOURS.len() - 2);
    let share = if along.is_nan() {
        0.0
    } else {
        along - stop as f64
    };
    std::array::from_fn(|channel| {
        let (a, b) = (
            DEPTH_COLOURS[stop][channel],
            DEPTH_COLOURS[stop + 1][channel],
        );
        (f64::from(a) + share * (f64::from(b) - f64::from(a))).round() as u8
    })
}

/// CIE L* of an sRGB colour.
#[cfg(test)]
pub(crate) fn lightness(rgb: Rgb) -> f64 {
    let linear = rgb.map(|c| {
        let c = f64::from(c) / 255.0;
        if c <= 0.04045 {
            c / 12.92
        } else {
            ((c + 0.055) / 1.055).powf(2.4)
        }
    });
    let y = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
    116.0 * y.cbrt() - 16.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lightness_falls_evenly_from_near_to_far() {
        let steps: Vec<f64> = (0..=20)
            .map(|i| lightness(scale_colour(f64::from(i) / 20.0)))
            .collect();
        for pair in steps.windows(2) {
            let fall = pair[0] - pair[1];
            assert!((2.0..6.0).contains(&fall), "{steps:?}");
        }
    }

    #[test]
    fn out_of_range_is_clamped() {
        assert_eq!(scale_colour(-3.0), DEPTH_COLOURS[0]);
        assert_eq!(scale_colour(7.0), DEPTH_COLOURS[5]);
        assert_eq!(scale_colour(f64::NAN), DEPTH_COLOURS[0]);
    }
}
