//! Depths from the histograms of any sensor: how long its bins are, and which photons they count.
//!
//! ```text
//!   every photon   a bin counts each photon that comes in it               counts are Poisson numbers
//!   first photon   a laser cycle counts its first photon, in one bin       later bins see what is left (pile-up)
//! ```
//!
//! The echo finder is that of our own chip, whose bins count at most once a laser cycle. A histogram is taken for one of a hundred times
//! as many laser cycles with as much less light, so that the bins are hardly tied together. What ties first photons together is in the mean
//! histogram ([`expected`](super::expected)); the search for echoes knows from the counts before a bin in what share of laser cycles it was
//! still to count (Coates 1968, doi 10.1088/0022-3735/1/8/437).
//!
//! No timing of gates is asked for.

mod mean;

use super::arrival::{ArrivalOptions, arrival};
use super::expected::{OtherBins, Response};
use super::finder::{DepthOptions, EchoFinder};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

pub use mean::{Agreement, SurfaceLight};

/// Parts that a laser cycle of first photons is cut into; and laser cycles for each count of the fullest bin, where every photon counts.
const PARTS: u32 = 100;

/// Which photons a detector counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counted {
    /// All of them.
    EveryPhoton,
    /// The first of each laser cycle.
    FirstPhoton {
        /// Laser cycles of a histogram.
        laser_cycles: u32,
    },
}

/// What counts photons: bins of one length, and laser pulses of one width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detector {
    /// Bins of a histogram.
    pub bins: usize,
    /// Length of a bin, s.
    pub bin_s: f64,
    /// When the first bin begins after the centre of the laser pulse has left, s.
    pub begins_s: f64,
    /// Standard deviation of the laser pulse with all jitter, s.
    pub pulse_sigma_s: f64,
    /// Which photons count.
    pub counted: Counted,
}

/// An echo in a histogram.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct DetectedReturn {
    /// Distance, m.
    pub depth_m: f64,
    /// Standard deviation of the distance, m; `None` where counts are not those of echoes of this pulse.
    pub bound_m: Option<f64>,
    /// Standard deviation of the depths that the zone sees there, m.
    pub spread_m: Option<f64>,
    /// Photons of the echo in all laser cycles.
    pub photons: f64,
    /// −log₁₀ of the chance that light without this echo makes such counts.
    pub confidence: f64,
}

/// Why a histogram has no echo.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NoReturn {
    /// No stretch of bins stands out.
    #[error("no significant peak")]
    NoSignificantPeak,
    /// Light is so strong that its counts do not tell its place.
    #[error("saturated")]
    Saturated,
    /// The echo would come from behind the sensor.
    #[error("behind the sensor")]
    BehindSensor,
}

/// More counts than laser cycles, where only the first photon of each counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "has {counts} counts in {laser_cycles} laser cycles, each of which counts its first photon only"
)]
pub struct TooManyCounts {
    counts: u64,
    laser_cycles: u32,
}

impl NoReturn {
    /// All of them.
    pub const ALL: [NoReturn; 3] = [
        NoReturn::NoSignificantPeak,
        NoReturn::Saturated,
        NoReturn::BehindSensor,
    ];
}

impl Detector {
    /// Checks that a histogram may be this detector's.
    ///
    /// # Errors
    /// More counts than the detector can have.
    pub fn check(&self, counts: &[u32]) -> Result<(), TooManyCounts> {
        let all: u64 = counts.iter().map(|&n| u64::from(n)).sum();
        match self.counted {
            Counted::FirstPhoton { laser_cycles } if all > u64::from(laser_cycles) => {
                Err(TooManyCounts {
                    counts: all,
                    laser_cycles,
                })
            }
            _ => Ok(()),
        }
    }

    /// The echoes in `counts`, one for each bin, the clearest first.
    ///
    /// # Errors
    /// Why there is none.
    pub fn returns(
        &self,
        counts: &[u32],
        options: &DepthOptions,
    ) -> Result<Vec<DetectedReturn>, NoReturn> {
        debug_assert_eq!(counts.len(), self.bins);
        let finder = self.finder(counts, options);
        let sighting = match self.counted {
            Counted::EveryPhoton => finder.find(counts),
            Counted::FirstPhoton { laser_cycles } => {
                finder.find_in(counts, &shares_of_cycles(counts, laser_cycles))
            }
        };
        let sighting = sighting.ok_or(NoReturn::NoSignificantPeak)?;
        if !sighting.is_significant {
            return Err(NoReturn::NoSignificantPeak);
        }
        if sighting.is_saturated {
            return Err(NoReturn::Saturated);
        }
        let to_m = 0.5 * SPEED_OF_LIGHT_M_PER_S * self.bin_s;
        let place_m = |position_bins: f64| {
            0.5 * SPEED_OF_LIGHT_M_PER_S * self.begins_s + (position_bins + 0.5) * to_m
        };
        let laser_cycles = f64::from(self.laser_cycles(counts));
        let bound_m = sighting.bound_bins.map(|bins| bins * to_m);
        let depth_m = place_m(sighting.position_bins);
        if depth_m < -bound_m.map_or(to_m, |bound_m| 5.0 * bound_m) {
            return Err(NoReturn::BehindSensor);
        }
        let spread_bins = sighting.light.and_then(|light| finder.spread_bins(&light));
        let first = DetectedReturn {
            depth_m,
            bound_m,
            spread_m: bound_m.and(spread_bins).map(|bins| bins * to_m),
            photons: match sighting.light {
                Some(light) => light.signal * laser_cycles,
                None => sighting.peak.signal_counts,
            },
            confidence: sighting.confidence,
        };
        let others = sighting.others.into_iter().flatten();
        let others = others.map(|other| DetectedReturn {
            depth_m: place_m(other.position_bins),
            bound_m: other.bound_bins.map(|bins| bins * to_m),
            spread_m: other.spread_bins.map(|bins| bins * to_m),
            photons: other.photons * laser_cycles,
            confidence: other.confidence,
        });
        Ok(std::iter::once(first).chain(others).collect())
    }

    /// When bin 0 begins after the laser pulse has left, s, if `reference` has counts of the pulse itself in such bins; `None` without a
    /// pulse.
    pub fn begins_after_reference_s(&self, reference: &[u32]) -> Option<f64> {
        let pulse = arrival(reference, &ArrivalOptions::default())?;
        Some(-(pulse.position_bins + 0.5) * self.bin_s)
    }

    /// Laser cycles in which our bins would count like this detector's.
    fn laser_cycles(&self, counts: &[u32]) -> u32 {
        let most = match self.counted {
            Counted::FirstPhoton { laser_cycles } => laser_cycles,
            Counted::EveryPhoton => counts.iter().copied().max().unwrap_or(0),
        };
        most.max(1).saturating_mul(PARTS)
    }

    fn finder(&self, counts: &[u32], options: &DepthOptions) -> EchoFinder {
        let law = match self.counted {
            Counted::EveryPhoton => OtherBins::EveryPhoton,
            Counted::FirstPhoton { .. } => OtherBins::FirstPhoton {
                parts: f64::from(PARTS),
            },
        };
        let sigma_bins = self.pulse_sigma_s / self.bin_s;
        let response = Response::of_other_bins(self.bins, sigma_bins, law);
        EchoFinder::of_response(response, self.bin_s, self.laser_cycles(counts), options)
    }
}

/// The share of laser cycles in which each bin was still to count, 1 on average.
fn shares_of_cycles(counts: &[u32], laser_cycles: u32) -> Vec<f64> {
    let mut left = f64::from(laser_cycles);
    let shares = counts.iter().map(|&count| {
        let share = left.max(1e-3);
        left -= f64::from(count);
        share
    });
    let mut shares: Vec<f64> = shares.collect();
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    shares.iter_mut().for_each(|share| *share /= mean);
    shares
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::rngs::StdRng;
    use rand::{RngExt, SeedableRng};

    pub(super) const BINS: usize = 64;
    pub(super) const LASER_CYCLES: u32 = 2000;
    pub(super) const FIRST: Counted = Counted::FirstPhoton {
        laser_cycles: LASER_CYCLES,
    };

    pub(super) fn detector(counted: Counted) -> Detector {
        Detector {
            bins: BINS,
            bin_s: 1e-9,
            begins_s: 20e-9,
            pulse_sigma_s: 0.8e-9,
            counted,
        }
    }

    /// A number of standard normal distribution: the sum of twelve even ones, less six.
    fn normal(random: &mut StdRng) -> f64 {
        (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
    }

    /// A histogram of an echo at `place_bins` with `signal` photons a laser cycle, over `background` photons in all bins, photon by photon.
    pub(super) fn histogram(
        random: &mut StdRng,
        detector: &Detector,
        (place_bins, signal, background): (f64, f64, f64),
    ) -> Vec<u32> {
        let mut counts = vec![0; BINS];
        let sigma_bins = detector.pulse_sigma_s / detector.bin_s;
        for _ in 0..LASER_CYCLES {
            let mut times = Vec::new();
            // Each photon is one of twenty that may come: nearly a Poisson number.
            for _ in 0..20 {
                if random.random::<f64>() < signal / 20.0 {
                    times.push(place_bins + 0.5 + sigma_bins * normal(random));
                }
                if random.random::<f64>() < background / 20.0 {
                    times.push(BINS as f64 * random.random::<f64>());
                }
            }
            times.retain(|time| (0.0..BINS as f64).contains(time));
            if detector.counted == FIRST {
                let first = times.iter().copied().min_by(f64::total_cmp);
                times = first.into_iter().collect();
            }
            for time in times {
                counts[time as usize] += 1;
            }
        }
        counts
    }

    #[test]
    fn depths_of_photons_drawn_one_by_one_keep_their_bounds() {
        let mut random = StdRng::seed_from_u64(1);
        for counted in [Counted::EveryPhoton, FIRST] {
            let detector = detector(counted);
            let to_m = 0.5 * SPEED_OF_LIGHT_M_PER_S * detector.bin_s;
            for (signal, background) in [(0.05, 0.2), (0.3, 0.5), (1.5, 0.5)] {
                let (mut squares, mut sum, mut bounds, mut photons) = (0.0, 0.0, 0.0, 0.0);
                const REPEATS: usize = 40;
                for repeat in 0..REPEATS {
                    let place_bins = 25.0 + 0.37 * repeat as f64 % 10.0;
                    let light = (place_bins, signal, background);
                    let counts = histogram(&mut random, &detector, light);
                    detector.check(&counts).unwrap();
                    let found = detector.returns(&counts, &DepthOptions::default()).unwrap();
                    let first = found[0];
                    let true_m = (20.0 + place_bins + 0.5) * to_m;
                    let off_m = first.depth_m - true_m;
                    let bound_m = first.bound_m.unwrap();
                    assert!(
                        off_m.abs() < 5.0 * bound_m,
                        "{counted:?} {light:?} {first:?}"
                    );
                    squares += off_m * off_m;
                    sum += off_m;
                    bounds += bound_m * bound_m;
                    photons += first.photons / f64::from(LASER_CYCLES);
                }
                let of = REPEATS as f64;
                let (rms_m, bound_m) = ((squares / of).sqrt(), (bounds / of).sqrt());
                assert!(
                    rms_m < 1.4 * bound_m,
                    "{counted:?} {signal}: {rms_m} {bound_m}"
                );
                assert!((sum / of).abs() < 4.0 * bound_m / of.sqrt());
                assert!(
                    (photons / of / signal - 1.0).abs() < 0.1,
                    "{counted:?} {signal}: {photons}"
                );
            }
        }
    }

    #[test]
    fn background_alone_has_no_return_and_impossible_counts_are_refused() {
        let mut random = StdRng::seed_from_u64(2);
        let every = detector(Counted::EveryPhoton);
        let dark = histogram(&mut random, &every, (20.0, 0.0, 0.8));
        let none = every.returns(&dark, &DepthOptions::default());
        assert_eq!(none, Err(NoReturn::NoSignificantPeak));
        let first = detector(FIRST);
        let mut many = vec![0; BINS];
        many[3] = LASER_CYCLES + 1;
        assert!(every.check(&many).is_ok() && first.check(&many).is_err());
    }
}
