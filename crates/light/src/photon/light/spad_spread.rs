//! SPADs of a macropixel that differ in how many photons they detect, and in dark counts.

use std::sync::Arc;

use super::error::{LightError, is_amount};
use super::layer::Layer;

/// How the SPADs of a macropixel differ.
#[derive(Debug, Clone, PartialEq)]
pub struct SpadSpread {
    /// Of every SPAD, relative to the greatest one.
    pub(super) efficiency: Arc<[f64]>,
    pub(super) greatest_factor: f64,
    /// Of every SPAD, relative to the greatest one.
    dark: Arc<[f64]>,
    pub(super) greatest_dark_hz: f64,
}

impl SpadSpread {
    /// Of SPAD i, `factors[i]` times the photons of an even share are detected, and `dark_hz[i]` dark counts per second come
    /// besides. Factors need not have a mean of 1.
    ///
    /// # Errors
    /// When there is not one factor and one rate for each SPAD, or one is negative or not finite.
    pub fn new(factors: &[f64], dark_hz: &[f64]) -> Result<Self, LightError> {
        if factors.is_empty() || factors.len() != dark_hz.len() {
            return Err(LightError::Spads {
                factors: factors.len(),
                dark: dark_hz.len(),
            });
        }
        if let Some(&odd) = factors.iter().chain(dark_hz).find(|n| !is_amount(**n)) {
            return Err(LightError::Spad(odd));
        }
        let (efficiency, greatest_factor) = relative(factors);
        let (dark, greatest_dark_hz) = relative(dark_hz);
        Ok(SpadSpread {
            efficiency,
            greatest_factor,
            dark,
            greatest_dark_hz,
        })
    }

    /// How many SPADs it is for.
    pub fn spads(&self) -> usize {
        self.efficiency.len()
    }

    /// The factor of every SPAD.
    pub(in crate::photon) fn factors(&self) -> Vec<f64> {
        let factors = self.efficiency.iter();
        factors.map(|share| share * self.greatest_factor).collect()
    }

    /// Dark counts of every SPAD, per second.
    pub(in crate::photon) fn dark_hz(&self) -> Vec<f64> {
        let rates_hz = self.dark.iter();
        rates_hz
            .map(|share| share * self.greatest_dark_hz)
            .collect()
    }

    /// The mean of all factors.
    pub(super) fn mean_factor(&self) -> f64 {
        self.factors().iter().sum::<f64>() / self.spads() as f64
    }

    /// Dark counts of all SPADs, per second.
    pub(super) fn total_dark_hz(&self) -> f64 {
        self.dark_hz().iter().sum()
    }

    pub(super) fn dark_counts(&self) -> Layer<'_> {
        Layer {
            by_spad: Some(&self.dark),
            ..Layer::constant(self.greatest_dark_hz * self.spads() as f64)
        }
    }
}

/// Numbers relative to the greatest one, and that one.
fn relative(numbers: &[f64]) -> (Arc<[f64]>, f64) {
    let greatest = numbers.iter().copied().fold(0.0, f64::max);
    let share = |n: &f64| if greatest > 0.0 { n / greatest } else { 0.0 };
    (numbers.iter().map(share).collect(), greatest)
}
