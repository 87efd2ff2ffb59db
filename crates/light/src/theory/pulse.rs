//! The shape of the detected laser pulse, jitter and all: a Gaussian, or samples of a measured one.
//!
//! A histogram asks two things of it, both for a bin that reaches from `from` to `to` (ns, counted from the
//! pulse's position): its share of the photons, and how fast that share changes when the pulse moves.
//! Both are answered as logarithms, because far from the pulse they are smaller than any `f64`.

use std::f64::consts::{FRAC_1_SQRT_2, LN_2, PI};

use libm::{exp, expm1, log};

use crate::numerics::{erfcx, gauss_legendre};

/// Shape of the pulse, normalised to one photon.
#[derive(Debug, Clone, PartialEq)]
pub enum Pulse {
    /// A Gaussian of this standard deviation, ns; its position is its centre.
    Gaussian {
        /// Standard deviation, ns, > 0.
        sigma_ns: f64,
    },
    /// Straight lines between samples; its position is its centroid.
    Measured(MeasuredPulse),
}

/// ln of a bin's share of the pulse and of the share's change per nanosecond of movement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LnBin {
    /// ln share.
    pub share: f64,
    /// ln |d share / d position|, position in ns.
    pub slope: f64,
}

impl Pulse {
    /// A Gaussian given by its full width at half maximum, ns.
    pub fn from_fwhm(fwhm_ns: f64) -> Self {
        Pulse::Gaussian {
            sigma_ns: fwhm_ns / (8.0 * LN_2).sqrt(),
        }
    }

    /// Standard deviation, ns.
    pub fn sigma_ns(&self) -> f64 {
        match self {
            Pulse::Gaussian { sigma_ns } => *sigma_ns,
            Pulse::Measured(pulse) => pulse.sigma_ns,
        }
    }

    /// How far before and after its position the pulse matters, ns.
    pub(crate) fn reach_ns(&self) -> (f64, f64) {
        match self {
            Pulse::Gaussian { sigma_ns } => (-12.0 * sigma_ns, 12.0 * sigma_ns),
            Pulse::Measured(pulse) => (pulse.first_ns, pulse.knot_ns(pulse.density.len() - 1)),
        }
    }

    /// The bin from `from_ns` to `to_ns` after the pulse's position.
    pub(crate) fn ln_bin(&self, from_ns: f64, to_ns: f64) -> LnBin {
        match self {
            Pulse::Gaussian { sigma_ns } => gaussian_bin(*sigma_ns, from_ns, to_ns),
            Pulse::Measured(pulse) => LnBin {
                share: log((pulse.cumulative(to_ns) - pulse.cumulative(from_ns)).max(0.0)),
                slope: log((pulse.density(from_ns) - pulse.density(to_ns)).abs()),
            },
        }
    }

    /// Share of the photons between `from_ns` and `to_ns` after the pulse's position.
    pub(crate) fn share(&self, from_ns: f64, to_ns: f64) -> f64 {
        exp(self.ln_bin(from_ns, to_ns).share)
    }
}

fn gaussian_bin(sigma_ns: f64, from_ns: f64, to_ns: f64) -> LnBin {
    let (from, to) = (from_ns / sigma_ns, to_ns / sigma_ns);
    // Mirrored if need be, so that the edge `near` is the one closer to the centre.
    let (near, far) = if from + to < 0.0 {
        (-to, -from)
    } else {
        (from, to)
    };
    let width = (to_ns - from_ns) / sigma_ns;
    let ln_near = -0.5 * near * near - 0.5 * log(2.0 * PI);
    // φ(far)/φ(near) = e^(−fall)
    let fall = 0.5 * (near + far) * width;
    let mills = |z: f64| (0.5 * PI).sqrt() * erfcx(z * FRAC_1_SQRT_2);
    let share = if width < 0.5 && near.abs() * width < 4.0 {
        ln_near + log(gauss_legendre(|s| exp(-s * (near + 0.5 * s)), 0.0, width))
    } else if near < 0.0 {
        log(0.5 * (libm::erf(far * FRAC_1_SQRT_2) + libm::erf(-near * FRAC_1_SQRT_2)))
    } else {
        ln_near + log(mills(near) - exp(-fall) * mills(far))
    };
    let slope = ln_near + log(-expm1(-fall)) - log(sigma_ns);
    LnBin { share, slope }
}

/// A pulse known by samples, for example from an oscilloscope.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredPulse {
    /// Time of the first sample relative to the centroid, ns.
    first_ns: f64,
    step_ns: f64,
    /// Density at the samples, 1/ns.
    density: Vec<f64>,
    /// Share before each sample.
    below: Vec<f64>,
    sigma_ns: f64,
}

/// Why samples make no pulse.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PulseSamplesError {
    /// Too few samples, or no spacing.
    #[error("a measured pulse needs at least three samples and a positive time step between them")]
    TooShort,
    /// A sample that is negative or not a number.
    #[error("sample {index} of the measured pulse is {value}: subtract the baseline first")]
    Negative {
        /// Position in the list, from 0.
        index: usize,
        /// The sample.
        value: f64,
    },
    /// All samples are zero, or the ends are not.
    #[error("a measured pulse must start and end at zero and rise in between")]
    Open,
}

impl MeasuredPulse {
    /// A pulse of `samples` in any unit, `step_ns` apart, that begins and ends with zero.
    ///
    /// # Errors
    /// When there are fewer than three samples, one is negative, or the pulse does not begin and end at zero.
    pub fn new(step_ns: f64, samples: &[f64]) -> Result<Self, PulseSamplesError> {
        if samples.len() < 3 || !(step_ns > 0.0 && step_ns.is_finite()) {
            return Err(PulseSamplesError::TooShort);
        }
        if let Some(index) = samples.iter().position(|s| !(*s >= 0.0 && s.is_finite())) {
            return Err(PulseSamplesError::Negative {
                index,
                value: samples[index],
            });
        }
        let area: f64 = step_ns * samples.iter().sum::<f64>();
        if samples[0] != 0.0 || samples[samples.len() - 1] != 0.0 || area == 0.0 {
            return Err(PulseSamplesError::Open);
        }
        let density: Vec<f64> = samples.iter().map(|s| s / area).collect();
        let mut below = vec![0.0; density.len()];
        for i in 1..density.len() {
            below[i] = below[i - 1] + 0.5 * step_ns * (density[i - 1] + density[i]);
        }
        // Each sample stands for a triangle two steps wide, whose own variance is step²/6.
        let time = |i: usize| i as f64 * step_ns;
        let mean = |value: &dyn Fn(f64) -> f64| -> f64 {
            let terms = density.iter().enumerate();
            step_ns * terms.map(|(i, d)| d * value(time(i))).sum::<f64>()
        };
        let centroid = mean(&|t| t);
        let variance = mean(&|t| (t - centroid).powi(2)) + step_ns * step_ns / 6.0;
        Ok(MeasuredPulse {
            first_ns: -centroid,
            step_ns,
            density,
            below,
            sigma_ns: variance.sqrt(),
        })
    }

    /// Times of the samples relative to the centroid, ns.
    pub(crate) fn knots_ns(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.density.len()).map(|i| self.knot_ns(i))
    }

    fn knot_ns(&self, i: usize) -> f64 {
        self.first_ns + i as f64 * self.step_ns
    }

    /// Segment and position within it, 0 to 1, of a time inside the pulse.
    fn locate(&self, t_ns: f64) -> Option<(usize, f64)> {
        let x = (t_ns - self.first_ns) / self.step_ns;
        let segments = self.density.len() - 1;
        (x >= 0.0 && x < segments as f64).then(|| (x as usize, x.fract()))
    }

    fn density(&self, t_ns: f64) -> f64 {
        self.locate(t_ns).map_or(0.0, |(i, x)| {
            self.density[i] * (1.0 - x) + self.density[i + 1] * x
        })
    }

    fn cumulative(&self, t_ns: f64) -> f64 {
        match self.locate(t_ns) {
            Some((i, x)) => {
                let here = self.density[i] + 0.5 * x * (self.density[i + 1] - self.density[i]);
                self.below[i] + self.step_ns * x * here
            }
            None if t_ns < self.first_ns => 0.0,
            None => self.below[self.below.len() - 1],
        }
    }
}
