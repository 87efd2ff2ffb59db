//! Depth from arrival times, calibrated on targets at known distances.
//!
//! ```text
//!   depth = scale_z · (arrival − reference arrival) + offset_z + walk · signal counts
//! ```
//!
//! * The *reference* histogram is that of light sent straight from the laser to a SPAD. Its arrival, measured in the
//!   same capture, takes drifts of laser and electronics out.
//! * Each zone z has a *scale* (metres a bin times the cosine of the direction it looks in: depth to a plane is
//!   shorter than the range along the ray) and an *offset* (its wiring, and where the plane lies).
//! * The *walk* is shared: photons that come while a SPAD is dead are lost, so strong pulses lose their end
//!   and seem early, to first order in proportion to their counts (pile-up, which thesis 3.2.2 assumes away).
//!
//! The fit is by least squares. Only the walk ties zones together, so it comes first, from what is left of depth
//! and counts once each zone's straight line is taken out of both (Frisch, Waugh and Lovell); then each zone is
//! a straight line of its own.

use serde::{Deserialize, Serialize};

/// One zone of one capture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZoneEcho {
    /// Zone, from 0.
    pub zone: usize,
    /// Arrival after the reference's arrival, bins.
    pub arrival_bins: f64,
    /// Counts of the pulse above background.
    pub signal_counts: f64,
}

/// A straight line from arrival to depth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ZoneCalibration {
    /// Metres a bin.
    pub scale_m: f64,
    /// Depth at the reference's arrival, m.
    pub offset_m: f64,
}

/// What turns echoes into depths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Metres that a pulse seems too near for each of its counts.
    pub walk_m_per_count: f64,
    /// One line for every zone.
    pub zones: Vec<ZoneCalibration>,
}

/// Why a calibration cannot be fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// A zone saw the target fewer than three times, or always at one distance.
    #[error("zone {0} saw the target at fewer than three distances")]
    TooFew(usize),
}

impl Calibration {
    /// Fits `zones` zones to echoes of targets at known depths, m.
    ///
    /// # Errors
    /// When a zone has too few echoes to tell its line.
    pub fn fit(zones: usize, echoes: &[(ZoneEcho, f64)]) -> Result<Self, CalibrationError> {
        let mut covariance = 0.0;
        let mut variance = 0.0;
        let of_zone = |zone| {
            let echoes = echoes.iter().filter(move |(echo, _)| echo.zone == zone);
            let arrivals: Vec<f64> = echoes.clone().map(|(e, _)| e.arrival_bins).collect();
            let counts: Vec<f64> = echoes.clone().map(|(e, _)| e.signal_counts).collect();
            let depths: Vec<f64> = echoes.map(|&(_, depth)| depth).collect();
            (arrivals, counts, depths)
        };
        for zone in 0..zones {
            let (arrivals, counts, depths) = of_zone(zone);
            // A single distance leaves the line's slope free, and the offset takes all of the error.
            if distinct(&depths) < 3 {
                return Err(CalibrationError::TooFew(zone));
            }
            let line = |y: &[f64]| Line::fit(&arrivals, y);
            let (Some(of_counts), Some(of_depths)) = (line(&counts), line(&depths)) else {
                return Err(CalibrationError::TooFew(zone));
            };
            for ((&x, &n), &depth) in arrivals.iter().zip(&counts).zip(&depths) {
                let (n, depth) = (n - of_counts.value(x), depth - of_depths.value(x));
                covariance += n * depth;
                variance += n * n;
            }
        }
        let walk_m_per_count = if variance > 0.0 {
            covariance / variance
        } else {
            0.0
        };
        let lines = (0..zones).map(|zone| {
            let (arrivals, counts, depths) = of_zone(zone);
            let without_walk: Vec<f64> = depths
                .iter()
                .zip(&counts)
                .map(|(depth, n)| depth - walk_m_per_count * n)
                .collect();
            let line = Line::fit(&arrivals, &without_walk).ok_or(CalibrationError::TooFew(zone))?;
            Ok(ZoneCalibration {
                scale_m: line.slope,
                offset_m: line.value(0.0),
            })
        });
        Ok(Calibration {
            walk_m_per_count,
            zones: lines.collect::<Result<_, _>>()?,
        })
    }

    /// Depth of an echo, m. Its zone must be one of the calibration's.
    pub fn depth_m(&self, echo: &ZoneEcho) -> f64 {
        let zone = &self.zones[echo.zone];
        zone.scale_m * echo.arrival_bins
            + zone.offset_m
            + self.walk_m_per_count * echo.signal_counts
    }
}

/// How many different values there are.
fn distinct(values: &[f64]) -> usize {
    let mut values = values.to_vec();
    values.sort_unstable_by(f64::total_cmp);
    values.dedup();
    values.len()
}

/// A least-squares line.
struct Line {
    slope: f64,
    mean_x: f64,
    mean_y: f64,
}

impl Line {
    /// Through at least three points at three different x.
    fn fit(x: &[f64], y: &[f64]) -> Option<Self> {
        if distinct(x) < 3 {
            return None;
        }
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let (mean_x, mean_y) = (mean(x), mean(y));
        let (mut xy, mut xx) = (0.0, 0.0);
        for (x, y) in x.iter().zip(y) {
            xy += (x - mean_x) * (y - mean_y);
            xx += (x - mean_x) * (x - mean_x);
        }
        Some(Line {
            slope: xy / xx,
            mean_x,
            mean_y,
        })
    }

    fn value(&self, x: f64) -> f64 {
        self.mean_y + self.slope * (x - self.mean_x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn echo(zone: usize, arrival_bins: f64, signal_counts: f64) -> ZoneEcho {
        ZoneEcho {
            zone,
            arrival_bins,
            signal_counts,
        }
    }

    #[test]
    fn a_zone_that_saw_too_little_is_named() {
        let echoes: Vec<(ZoneEcho, f64)> = (0..5)
            .flat_map(|i| {
                let at = f64::from(i);
                [(echo(0, at, 1.0), 0.1 * at), (echo(1, 2.0, 1.0), 0.1 * at)]
            })
            .collect();
        assert_eq!(
            Calibration::fit(2, &echoes),
            Err(CalibrationError::TooFew(1))
        );
        assert_eq!(Calibration::fit(1, &[]), Err(CalibrationError::TooFew(0)));
        // Arrivals are noisy where the target stands still.
        let still: Vec<(ZoneEcho, f64)> = (0..5)
            .map(|i| (echo(0, 7.0 + 0.01 * f64::from(i), 1.0), 0.5))
            .collect();
        assert_eq!(
            Calibration::fit(1, &still),
            Err(CalibrationError::TooFew(0))
        );
    }

    #[test]
    fn three_places_are_a_line() {
        let sample = |i: f64| (echo(0, i, 7.0), 2.0 * i + 1.0);
        let fitted = Calibration::fit(1, &[sample(1.0), sample(4.0), sample(6.0)]).unwrap();
        assert!((fitted.depth_m(&echo(0, 10.0, 7.0)) - 21.0).abs() < 1e-12);
        let two = Calibration::fit(1, &[sample(1.0), sample(4.0), sample(4.0)]);
        assert_eq!(two, Err(CalibrationError::TooFew(0)));
    }

    #[test]
    fn without_a_spread_of_counts_there_is_no_walk() {
        let echoes: Vec<(ZoneEcho, f64)> = (0..5)
            .map(|i| (echo(0, i as f64, 7.0), 2.0 * i as f64 + 1.0))
            .collect();
        let fitted = Calibration::fit(1, &echoes).unwrap();
        assert_eq!(fitted.walk_m_per_count, 0.0);
        assert!((fitted.depth_m(&echo(0, 10.0, 7.0)) - 21.0).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn a_fit_finds_the_calibration_that_made_the_echoes(
            scale in 0.005f64..0.1,
            offset in -0.2f64..0.2,
            walk in -1e-8f64..1e-8,
            counts in proptest::collection::vec(1e3f64..1e7, 30),
        ) {
            let made = Calibration {
                walk_m_per_count: walk,
                zones: (0..3)
                    .map(|z| ZoneCalibration { scale_m: scale * (1.0 + z as f64), offset_m: offset * z as f64 })
                    .collect(),
            };
            let echoes: Vec<(ZoneEcho, f64)> = counts
                .iter()
                .enumerate()
                .map(|(i, &n)| echo(i % 3, (i / 3) as f64 * 1.3, n))
                .map(|e| (e, made.depth_m(&e)))
                .collect();
            let fitted = Calibration::fit(3, &echoes).unwrap();
            for (e, depth) in &echoes {
                prop_assert!((fitted.depth_m(e) - depth).abs() < 1e-9);
            }
            prop_assert!((fitted.walk_m_per_count - walk).abs() < 1e-12);
        }
    }
}
