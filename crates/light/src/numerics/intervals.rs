//! Confidence intervals, at 95 %, of what was counted or scattered in repeated frames.
//!
//! * A share of frames: Wilson's score interval, which keeps its level near 0 and 1. Frames may count in part, as a tie
//!   of k bins counts 1/k; a part varies less than a hit or a miss, so the interval is then wider than it need be.
//! * A standard deviation: the chi-square interval, with degrees of freedom that follow from the sample's own fourth
//!   moment (Satterthwaite): n − 1 for a normal sample, fewer where outliers make the spread itself uncertain.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Normal quantile of 97.5 %.
pub const Z_95: f64 = 1.959_963_984_540_054;

/// A measured number and the ends of its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The measurement.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Estimate {
    /// Whether `value` lies in the interval.
    pub fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// The estimate with `f`, which rises, applied to value and ends.
    pub fn map(&self, f: impl Fn(f64) -> f64) -> Self {
        Estimate {
            value: f(self.value),
            low: f(self.low),
            high: f(self.high),
        }
    }
}

/// The chance that a sum of `freedom` ≥ 1 squared standard normal numbers is at least `chi_squared`.
pub fn chi_squared_above(chi_squared: f64, freedom: usize) -> f64 {
    let law = ChiSquared::new(freedom as f64).expect("at least one number");
    law.sf(chi_squared)
}

/// Share `successes`/`trials` (`trials` > 0) with Wilson's interval.
pub fn share(successes: f64, trials: f64) -> Estimate {
    let p = successes / trials;
    let z2 = Z_95 * Z_95 / trials;
    let middle = (p + 0.5 * z2) / (1.0 + z2);
    let half = Z_95 / (1.0 + z2) * (p * (1.0 - p) / trials + 0.25 * z2 / trials).sqrt();
    Estimate {
        value: p,
        low: (middle - half).clamp(0.0, p),
        high: (middle + half).clamp(p, 1.0),
    }
}

/// Mean and standard deviation of all values there are, divided by their number, not by one less.
pub fn mean_and_sigma(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    (mean, variance.sqrt())
}

/// Mean of at least two values, with the normal interval.
pub fn mean(values: &[f64]) -> Estimate {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    let half = Z_95 * (squares / (n - 1.0) / n).sqrt();
    Estimate {
        value: mean,
        low: mean - half,
        high: mean + half,
    }
}

/// Standard deviation of at least two values, with the chi-square interval.
pub fn deviation(values: &[f64]) -> Estimate {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let moment = |power| values.iter().map(|v| (v - mean).powi(power)).sum::<f64>() / n;
    let variance = moment(2) * n / (n - 1.0);
    if variance == 0.0 {
        return Estimate {
            value: 0.0,
            low: 0.0,
            high: 0.0,
        };
    }
    // Var(s²) = σ⁴·(κ − 1)/n, which is 2σ⁴/n for a normal law.
    let kurtosis = moment(4) / moment(2).powi(2);
    let freedom = (2.0 * (n - 1.0) / (kurtosis - 1.0)).clamp(1.0, n * n);
    let law = ChiSquared::new(freedom).expect("positive degrees of freedom");
    let end = |p: f64| (variance * freedom / law.inverse_cdf(p)).sqrt();
    Estimate {
        value: variance.sqrt(),
        low: end(0.975),
        high: end(0.025),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::{RandomPurpose, normal, random_stream};

    #[test]
    fn shares_by_hand() {
        // Wilson for 7 of 10: (0.7 + 0.19207 ± 1.95996·√(0.021 + 0.009604))/1.38415.
        let seven = share(7.0, 10.0);
        assert!(
            (seven.low - 0.396_78).abs() < 1e-5 && (seven.high - 0.892_21).abs() < 1e-5,
            "{seven:?}"
        );
        let none = share(0.0, 1000.0);
        assert_eq!((none.value, none.low), (0.0, 0.0));
        assert!((none.high - 0.003_826_8).abs() < 1e-6, "{none:?}");
        let all = share(1000.0, 1000.0);
        assert_eq!(all.high, 1.0);
    }

    /// 10 000 intervals at 95 %: their coverage has a standard error of 0.22 %.
    #[test]
    fn deviations_are_covered_as_often_as_promised() {
        let (runs, n) = (10_000, 60);
        let mut covered = [0.0; 2];
        for run in 0..runs {
            let mut random = random_stream(3, RandomPurpose::Stereo, run, 0);
            let values: Vec<f64> = (0..n).map(|_| 2.0 + 3.0 * normal(&mut random)).collect();
            covered[0] += f64::from(deviation(&values).contains(3.0));
            covered[1] += f64::from(mean(&values).contains(2.0));
        }
        for share in covered.map(|c| c / f64::from(runs)) {
            assert!((0.93..0.96).contains(&share), "{covered:?}");
        }
    }

    #[test]
    fn outliers_widen_the_interval() {
        let mut values: Vec<f64> = (0..1000).map(|i| f64::from(i % 10)).collect();
        let without = deviation(&values);
        values.extend([300.0, -300.0]);
        let with = deviation(&values);
        let relative = |e: Estimate| (e.high - e.low) / e.value;
        assert!(relative(with) > 5.0 * relative(without));
        assert_eq!(deviation(&[2.0; 5]).value, 0.0);
    }
}
