//! Where a rising share of successes crosses a level: probit regression.
//!
//! P(success at x) = Φ(a + b·x), fitted by maximum likelihood (Fisher's scoring) to shares measured at several x. The
//! crossing is x = (z − a)/b with z the normal quantile of the level; its interval follows from the fit's covariance
//! (delta method).

use super::intervals::{Estimate, Z_95};
use super::{ln_normal_below, normal_density};
use statrs::distribution::{ContinuousCDF, Normal};

/// Trials at one place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbitPoint {
    /// The place.
    pub x: f64,
    /// Trials made.
    pub trials: f64,
    /// Those that succeeded; parts count.
    pub successes: f64,
}

/// Where the share of successes crosses `level`; `None` when the points do not say.
pub fn crossing(points: &[ProbitPoint], level: f64) -> Option<Estimate> {
    let standard = Normal::standard();
    // Places in units of their own scale about their middle keep the normal equations well conditioned.
    let middle = points.iter().map(|p| p.x).sum::<f64>() / points.len() as f64;
    let scale = points
        .iter()
        .map(|p| (p.x - middle).abs())
        .fold(0.0, f64::max);
    let start = {
        let share = |p: &ProbitPoint| (p.successes + 0.5) / (p.trials + 1.0);
        let (first, last) = (points.first()?, points.last()?);
        let probit = |p: &ProbitPoint| standard.inverse_cdf(share(p));
        let slope = (probit(last) - probit(first)) * scale / (last.x - first.x);
        (probit(first) - slope * (first.x - middle) / scale, slope)
    };
    let (mut a, mut b) = start;
    let mut inverse = [0.0; 3];
    for _ in 0..50 {
        let (mut score, mut information) = ([0.0; 2], [0.0; 3]);
        for point in points {
            let u = (point.x - middle) / scale;
            let eta = a + b * u;
            let (p, q) = (
                libm::exp(ln_normal_below(eta)),
                libm::exp(ln_normal_below(-eta)),
            );
            let density = normal_density(eta);
            let weight = point.trials * density * density / (p * q);
            let residual = (point.successes - point.trials * p) * density / (p * q);
            score[0] += residual;
            score[1] += residual * u;
            information[0] += weight;
            information[1] += weight * u;
            information[2] += weight * u * u;
        }
        let determinant = information[0] * information[2] - information[1] * information[1];
        inverse = [information[2], -information[1], information[0]].map(|i| i / determinant);
        let step = (
            inverse[0] * score[0] + inverse[1] * score[1],
            inverse[1] * score[0] + inverse[2] * score[1],
        );
        (a, b) = (a + step.0, b + step.1);
        if step.0.abs().max(step.1.abs()) < 1e-10 {
            break;
        }
    }
    if !(b > 0.0 && b.is_finite()) {
        return None;
    }
    let u = (standard.inverse_cdf(level) - a) / b;
    let variance = (inverse[0] + 2.0 * u * inverse[1] + u * u * inverse[2]) / (b * b);
    let place = |u: f64| middle + scale * u;
    let half = Z_95 * variance.sqrt();
    Some(Estimate {
        value: place(u),
        low: place(u - half),
        high: place(u + half),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_shares_give_the_exact_crossing() {
        // Φ(−3 + 0.5·x) is 0.975 at x = (1.95996 + 3)/0.5.
        let shares = [4.0, 6.0, 7.0, 8.0, 9.0].map(|x: f64| ProbitPoint {
            x,
            trials: 1e4,
            successes: 1e4 * ln_normal_below(-3.0 + 0.5 * x).exp(),
        });
        let found = crossing(&shares, 0.975).unwrap();
        assert!((found.value - 2.0 * (Z_95 + 3.0)).abs() < 1e-6, "{found:?}");
        assert!(found.low < found.value && found.value < found.high);
        assert!(found.high - found.low < 0.2);
    }

    #[test]
    fn falling_shares_cross_nothing() {
        let shares = [(1.0, 90.0), (2.0, 50.0), (3.0, 10.0)].map(|(x, successes)| ProbitPoint {
            x,
            trials: 100.0,
            successes,
        });
        assert_eq!(crossing(&shares, 0.9), None);
    }
}
