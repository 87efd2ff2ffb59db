//! Integrals by Gauss and Legendre's rule of sixteen points: on one panel, or halved where needed.

use std::f64::consts::PI;
use std::sync::OnceLock;

/// Points of the rule; it is exact for polynomials up to degree 31.
const POINTS: usize = 16;

/// Panels are halved at most this often.
const DEEPEST: u32 = 24;

/// Nodes in (−1, 1) and weights of the rule.
fn rule() -> &'static [(f64, f64); POINTS] {
    static RULE: OnceLock<[(f64, f64); POINTS]> = OnceLock::new();
    RULE.get_or_init(|| std::array::from_fn(node))
}

/// Newton's iteration on the Legendre polynomial P₁₆ from the usual cosine guess.
fn node(k: usize) -> (f64, f64) {
    let n = POINTS as f64;
    let mut x = libm::cos(PI * (k as f64 + 0.75) / (n + 0.5));
    let mut slope = 0.0;
    for _ in 0..8 {
        let (mut before, mut value) = (1.0, x);
        for j in 2..=POINTS {
            let j = j as f64;
            (before, value) = (
                value,
                ((2.0 * j - 1.0) * x * value - (j - 1.0) * before) / j,
            );
        }
        slope = n * (x * value - before) / (x * x - 1.0);
        x -= value / slope;
    }
    (x, 2.0 / ((1.0 - x * x) * slope * slope))
}

/// ∫ f over \[`from`, `to`\] by one panel.
pub(crate) fn gauss_legendre(f: impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let sum: f64 = rule().iter().map(|&(x, w)| w * f(middle + half * x)).sum();
    half * sum
}

/// ∫ f from the first to the last of `breaks` (ascending), to about `tolerance` of its size per panel.
///
/// A panel is also good when its own halves agree with it to ten times `tolerance`; that must not be less than
/// the rounding noise of `f`, or every panel is halved for nothing. Put a break at every kink and near every narrow peak; between two of them `f` should be smooth.
pub fn integrate(f: impl Fn(f64) -> f64, breaks: &[f64], tolerance: f64) -> f64 {
    let panels = || breaks.windows(2).map(|p| (p[0], p[1]));
    let whole: Vec<f64> = panels().map(|(a, b)| gauss_legendre(&f, a, b)).collect();
    let size: f64 = whole.iter().map(|s| s.abs()).sum();
    let enough = Enough {
        absolute: tolerance * size,
        relative: 10.0 * tolerance,
    };
    panels()
        .zip(whole)
        .map(|((a, b), s)| refine(&f, (a, b), s, &enough, DEEPEST))
        .sum()
}

/// How closely a panel and its halves have to agree.
struct Enough {
    absolute: f64,
    relative: f64,
}

fn refine(
    f: &impl Fn(f64) -> f64,
    (from, to): (f64, f64),
    whole: f64,
    enough: &Enough,
    depth: u32,
) -> f64 {
    let middle = 0.5 * (from + to);
    let left = gauss_legendre(f, from, middle);
    let right = gauss_legendre(f, middle, to);
    let both = left + right;
    let settled = (both - whole).abs() <= enough.absolute.max(enough.relative * whole.abs());
    if settled || depth == 0 || !both.is_finite() {
        return both;
    }
    refine(f, (from, middle), left, enough, depth - 1)
        + refine(f, (middle, to), right, enough, depth - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_is_exact_up_to_degree_31() {
        for degree in 0..32 {
            let got = gauss_legendre(|x| x.powi(degree), 0.0, 1.0);
            let want = 1.0 / (f64::from(degree) + 1.0);
            assert!((got - want).abs() < 1e-15, "x^{degree}: {got}");
        }
    }

    #[test]
    fn narrow_peaks_and_kinks_are_found() {
        let peak = integrate(|x| (-x * 1e7).exp(), &[0.0, 1e-3, 1.0], 1e-15);
        assert!((peak * 1e7 - 1.0).abs() < 1e-13, "{peak}");
        let kink = integrate(|x: f64| (x - 0.3).abs(), &[0.0, 1.0], 1e-13);
        assert!((kink - 0.29).abs() < 1e-12, "{kink}");
    }
}
