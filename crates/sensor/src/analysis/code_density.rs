//! Linearity of a time-to-digital converter from a code-density test: how often each code comes where arrival times are
//! spread evenly.

/// Differential and integral non-linearity of the codes that have two edges, in steps (LSB).
#[derive(Debug, Clone, PartialEq)]
pub struct Linearity {
    /// The mean step, in units of what was given: counts or seconds.
    pub step: f64,
    /// By how much each code is wider than the mean one.
    pub dnl: Vec<f64>,
    /// By how much each code's end is late: the sum of the `dnl` up to it. The last is zero.
    pub inl: Vec<f64>,
}

impl Linearity {
    /// Of codes that are so wide, or come so often. The first and last code of a converter have no width: leave them out.
    ///
    /// # Panics
    /// When there are none, or all are empty.
    pub fn from_widths(widths: &[f64]) -> Self {
        let step = widths.iter().sum::<f64>() / widths.len() as f64;
        assert!(step > 0.0, "codes have widths");
        let dnl: Vec<f64> = widths.iter().map(|width| width / step - 1.0).collect();
        let inl = dnl.iter().scan(0.0, |sum, dnl| {
            *sum += dnl;
            Some(*sum)
        });
        Linearity {
            step,
            inl: inl.collect(),
            dnl,
        }
    }

    /// The greatest DNL, of either sign.
    pub fn worst_dnl(&self) -> f64 {
        worst(&self.dnl)
    }

    /// The greatest INL, of either sign.
    pub fn worst_inl(&self) -> f64 {
        worst(&self.inl)
    }
}

fn worst(values: &[f64]) -> f64 {
    let by_size = |a: &&f64, b: &&f64| a.abs().total_cmp(&b.abs());
    *values.iter().max_by(by_size).expect("there are codes")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_code_is_late_until_narrow_ones_make_up_for_it() {
        let linearity = Linearity::from_widths(&[150.0, 50.0, 100.0, 100.0]);
        assert_eq!(linearity.step, 100.0);
        assert_eq!(linearity.dnl, [0.5, -0.5, 0.0, 0.0]);
        assert_eq!(linearity.inl, [0.5, 0.0, 0.0, 0.0]);
        assert_eq!(
            (linearity.worst_dnl().abs(), linearity.worst_inl()),
            (0.5, 0.5)
        );
    }
}
