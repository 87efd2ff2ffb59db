//! The share of a Gaussian pulse that a stretch of time receives.
//!
//! Differences of the distribution function lose their digits in two places: far from the pulse, where both values are
//! near 0 or 1, and in stretches much shorter than the pulse. The first is avoided by keeping the smaller tail of
//! each edge, the second by expanding the density about the middle of the stretch.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use multiversion::multiversion;

use crate::numerics::branchless::{self, VECTOR};

/// An edge of a stretch of time, with the tail of the pulse on its far side.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PulseEdge {
    /// Standard deviations after the pulse's centre; infinite for a pulse without width.
    z: f64,
    /// Share of the pulse beyond the edge, seen from the centre.
    tail: f64,
}

impl PulseEdge {
    /// An edge `time` after the centre of a pulse of standard deviation `sigma` ≥ 0, both in the same unit.
    fn new(time: f64, sigma: f64) -> Self {
        let z = deviations(time, sigma);
        let tail = 0.5 * libm::erfc(z.abs() * FRAC_1_SQRT_2);
        PulseEdge { z, tail }
    }

    /// Share of the pulse between this edge and a `later` one.
    #[inline(always)]
    fn share_until(&self, later: &PulseEdge) -> f64 {
        let after = self.tail - later.tail;
        let across = 1.0 - self.tail - later.tail;
        let until_centre = if later.z > 0.0 { across } else { -after };
        let share = if self.z > 0.0 { after } else { until_centre };
        share.max(0.0)
    }
}

/// Stretches that go side by side.
const ROW: usize = 16;

/// Edges of a row, filled up to whole vectors.
const EDGES: usize = (ROW + 1).next_multiple_of(VECTOR);

/// Gives every stretch of `shares` its share of a Gaussian pulse of standard deviation `sigma` ≥ 0: stretch i lies between
/// `edge`(i) and `edge`(i + 1), times counted from the pulse's centre in the unit of `sigma`. Relative error below
/// 10⁻¹² where stretches are not much shorter than the pulse.
pub fn pulse_shares(edge: impl Fn(usize) -> f64, sigma: f64, shares: &mut [f64]) {
    for (row, shares) in shares.chunks_mut(ROW).enumerate() {
        let mut distances = [0.0; EDGES];
        for (i, z) in distances.iter_mut().enumerate().take(shares.len() + 1) {
            *z = deviations(edge(row * ROW + i), sigma);
        }
        let mut tails = distances;
        tails_beyond(&mut tails[..(shares.len() + 1).next_multiple_of(VECTOR)]);
        let edge = |i: usize| PulseEdge {
            z: distances[i],
            tail: tails[i],
        };
        for (i, share) in shares.iter_mut().enumerate() {
            *share = edge(i).share_until(&edge(i + 1));
        }
    }
}

/// Replaces distances from the centre by the tails beyond them.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1"
))]
fn tails_beyond(distances: &mut [f64]) {
    for z in distances {
        *z = branchless::normal_above(z.abs());
    }
}

fn deviations(time: f64, sigma: f64) -> f64 {
    match sigma {
        // A pulse at the very edge belongs to what follows it.
        0.0 if time > 0.0 => f64::INFINITY,
        0.0 => f64::NEG_INFINITY,
        _ => time / sigma,
    }
}

/// Below this product of width and distance (both in standard deviations) the density is expanded.
const NARROW: f64 = 0.1;

/// Share of a Gaussian pulse of standard deviation `sigma` ≥ 0 that falls into `[from, to)`, times counted from its
/// centre in the unit of `sigma`. Relative error below 10⁻¹², also in the far tail and in the narrowest stretch.
pub fn pulse_share(from: f64, to: f64, sigma: f64) -> f64 {
    debug_assert!(from <= to && sigma >= 0.0, "{from} to {to}, sigma {sigma}");
    let width = (to - from) / sigma;
    let z = (0.5 * from + 0.5 * to) / sigma;
    if sigma > 0.0 && width * z.abs().max(1.0) < NARROW {
        // Derivatives of the density are Hermite polynomials; odd ones cancel about the middle.
        let (z2, w2) = (z * z, width * width);
        let he2 = z2 - 1.0;
        let he4 = (z2 - 6.0) * z2 + 3.0;
        let he6 = ((z2 - 15.0) * z2 + 45.0) * z2 - 15.0;
        let series = 1.0 + w2 / 24.0 * (he2 + w2 / 80.0 * (he4 + w2 / 168.0 * he6));
        return width * libm::exp(-0.5 * z2) / (2.0 * PI).sqrt() * series;
    }
    PulseEdge::new(from, sigma).share_until(&PulseEdge::new(to, sigma))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_pulse_without_width_is_in_one_stretch() {
        assert_eq!(pulse_share(0.0, 1.0, 0.0), 1.0);
        assert_eq!(pulse_share(-1.0, 0.0, 0.0), 0.0);
        assert_eq!(pulse_share(-1.0, 1.0, 0.0), 1.0);
        assert_eq!(pulse_share(2.0, 3.0, 0.0), 0.0);
    }

    #[test]
    fn one_standard_deviation_either_way_holds_68_percent() {
        let share = pulse_share(-2.0, 2.0, 2.0);
        assert!((share - 0.682_689_492_137_085_9).abs() < 1e-15, "{share}");
    }

    proptest! {
        #[test]
        fn stretches_side_by_side_have_the_shares_they_have_alone(
            first in -60.0f64..20.0,
            step in 0.5f64..10.0,
            count in 0usize..40,
            sigma in prop_oneof![Just(0.0), 1.0f64..5.0],
        ) {
            let edge = |i: usize| first + step * i as f64;
            let mut shares = vec![f64::NAN; count];
            pulse_shares(edge, sigma, &mut shares);
            for (i, &found) in shares.iter().enumerate() {
                let alone = pulse_share(edge(i), edge(i + 1), sigma);
                prop_assert!((found - alone).abs() <= 1e-12 * alone + 1e-300, "{i}: {found} {alone}");
            }
        }

        #[test]
        fn stretches_add_up(from in -8.0f64..8.0, a in 1e-6f64..3.0, b in 1e-6f64..3.0, sigma in 0.1f64..5.0) {
            let parts = pulse_share(from, from + a, sigma) + pulse_share(from + a, from + a + b, sigma);
            let whole = pulse_share(from, from + a + b, sigma);
            prop_assert!((parts / whole - 1.0).abs() < 1e-9 || whole < 1e-200, "{parts} {whole}");
        }
    }
}
