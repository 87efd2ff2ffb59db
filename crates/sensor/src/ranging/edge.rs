//! The edge of a Gaussian pulse: the share of it that has come, from a table.
//!
//! A histogram of 16 bins asks for a hundred of them. Between its points the table is a cubic of the right values and
//! slopes, which is right to 3·10⁻⁹ of the pulse, and to 10⁻⁵ of the share itself where that is above 10⁻⁹.

use std::sync::LazyLock;

use crate::numerics::{normal_above, normal_density};

/// Where the table ends, standard deviations either side, and its points to each.
const REACH: f64 = 7.0;
const POINTS: f64 = 32.0;

/// Share and density.
type Point = (f64, f64);

static TABLE: LazyLock<Vec<Point>> = LazyLock::new(|| {
    let points = (2.0 * REACH * POINTS) as usize;
    let at = |i: usize| i as f64 / POINTS - REACH;
    (0..=points + 1)
        .map(|i| (normal_above(-at(i)), normal_density(at(i))))
        .collect()
});

/// Share of the pulse that comes before `z` standard deviations after its centre, and its slope with z.
#[inline]
pub(super) fn share_before(z: f64) -> (f64, f64) {
    let at = (z + REACH) * POINTS;
    if !(0.0..2.0 * REACH * POINTS).contains(&at) {
        return (f64::from(u8::from(z > 0.0)), 0.0);
    }
    let first = at as usize;
    let table = &*TABLE;
    let ((from, slope_from), (to, slope_to)) = (table[first], table[first + 1]);
    let (u, h) = (at - first as f64, 1.0 / POINTS);
    let v = 1.0 - u;
    let rise = to - from;
    let (a, b) = (slope_from * h - rise, rise - slope_to * h);
    let bend = v * a + u * b;
    let share = from + u * (rise + v * bend);
    (share, POINTS * (rise + (v - u) * bend + u * v * (b - a)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_normal_distribution() {
        for i in 0..14_000 {
            let z = -7.0 + f64::from(i) * 1e-3 + 3e-4;
            let (share, (found, slope)) = (normal_above(-z), share_before(z));
            let error = (found - share).abs();
            assert!(
                error < 3e-9 && (share < 1e-9 || error < 1e-5 * share),
                "{z}: {error}"
            );
            let error = (slope - normal_density(z)).abs();
            assert!(error < 2e-6, "{z}: slope off by {error}");
        }
    }
}
