//! Background that depends on the time in the laser cycle, for example what fog sends back.

use std::ops::Range;

use super::error::{LightError, is_amount};
use crate::units::Time;

/// Background that changes within the laser cycle, and is the same in each.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Femtoseconds after the start of the laser cycle.
    pub edges_fs: Vec<i64>,
    rates_hz: Vec<f64>,
    /// The greatest rate, photons per second.
    pub greatest_hz: f64,
}

impl Profile {
    /// Mean rate `rates_hz[i]` of detected photons from `edges[i]` until `edges[i + 1]` after the start of the laser cycle,
    /// and none before the first edge and after the last one; what would come after the cycle is left out.
    ///
    /// Photons are drawn at the greatest rate and thinned: that of a block of time in bright light, that of the profile otherwise.
    ///
    /// # Errors
    /// Another number of edges than one more than there are rates, no rate at all, edges that do not rise or are negative,
    /// and rates that are negative or not finite.
    pub fn new(edges: &[Time], rates_hz: &[f64]) -> Result<Self, LightError> {
        if rates_hz.is_empty() || edges.len() != rates_hz.len() + 1 {
            return Err(LightError::Pieces {
                rates: rates_hz.len(),
                edges: edges.len(),
            });
        }
        if edges[0] < Time::ZERO || !edges.is_sorted_by(|a, b| a < b) {
            return Err(LightError::Edges);
        }
        if let Some(&rate) = rates_hz.iter().find(|rate| !is_amount(**rate)) {
            return Err(LightError::Rate(rate));
        }
        Ok(Profile {
            edges_fs: edges.iter().map(|edge| edge.as_fs()).collect(),
            rates_hz: rates_hz.to_vec(),
            greatest_hz: rates_hz.iter().copied().fold(0.0, f64::max),
        })
    }

    /// Rate at a time after the start of the laser cycle, photons per second.
    pub(crate) fn rate_hz(&self, time_fs: i64) -> f64 {
        let piece = self.edges_fs.partition_point(|&edge_fs| edge_fs <= time_fs);
        let rate = piece.checked_sub(1).and_then(|i| self.rates_hz.get(i));
        rate.copied().unwrap_or(0.0)
    }

    /// The greatest rate within a time after the start of the laser cycle, photons per second.
    pub(crate) fn greatest_within_hz(&self, within_fs: &Range<i64>) -> f64 {
        let next = self
            .edges_fs
            .partition_point(|&edge_fs| edge_fs <= within_fs.start);
        let pieces = self
            .edges_fs
            .iter()
            .zip(&self.rates_hz)
            .skip(next.saturating_sub(1));
        pieces
            .take_while(|&(&begins_fs, _)| begins_fs < within_fs.end)
            .map(|(_, &rate_hz)| rate_hz)
            .fold(0.0, f64::max)
    }

    /// Mean number of photons from one time until another one, femtoseconds after the start of the laser cycle.
    pub fn photons(&self, from_fs: f64, until_fs: f64) -> f64 {
        let pieces = self.edges_fs.windows(2).zip(&self.rates_hz);
        pieces
            .map(|(ends, rate_hz)| {
                let lit_fs = until_fs.min(ends[1] as f64) - from_fs.max(ends[0] as f64);
                rate_hz * 1e-15 * lit_fs.max(0.0)
            })
            .sum()
    }
}
