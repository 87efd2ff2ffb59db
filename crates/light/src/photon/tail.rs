//! A SPAD's own timing: avalanches of carriers that first diffuse to the junction are late.
//!
//! ```text
//!   avalanches     ▂█▂                    Gaussian: jitter of the multiplication, with laser pulse and trigger
//!   of one pulse  ▂███▅▃▂▂▁▁▁▁ ▁  ▁       share of the photons that are late, by an exponential delay
//! ```
//!
//! Cova et al., "Avalanche photodiodes and quenching circuits for single-photon detection", Applied Optics 35 (1996) 1956: a peak and
//! an exponential diffusion tail. Photons that are each displaced on their own are Poisson again, of the shape that is convolved;
//! background stays what it is. So the displaced shape is that of the echo, and the dead time begins at the displaced avalanche. This file
//! is the one place of that shape: drawn photons take it sampled ([`DiffusionTail::shape`]), ranging as a formula ([`late_edge`]).

use std::f64::consts::FRAC_1_SQRT_2;

use super::pulse::PulseShape;
use crate::numerics::{erfcx, normal_above, normal_density};
use crate::units::Time;

/// Late avalanches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DiffusionTail {
    /// Share of the photons that are late, above 0, up to 1.
    pub share: f64,
    /// Time constant of their delay, above 0.
    pub time: Time,
}

/// How wide the echo of one place is, and how much of it differs from pulse to pulse and from SPAD to SPAD.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EchoWidth {
    /// Standard deviation of its Gaussian part: laser pulse and all jitter.
    pub sigma: Time,
    /// What is late beyond that.
    pub tail: Option<DiffusionTail>,
    /// Whether a Gaussian is near enough to the rest for bounds to hold.
    pub is_gaussian: bool,
    /// Standard deviation of a pulse's energy, relative to the mean: uniform, as in the photon stream.
    pub energy_spread: f64,
    /// Standard deviation of a SPAD's detection efficiency, relative to the mean.
    pub pde_spread: f64,
}

impl From<Time> for EchoWidth {
    /// A Gaussian of this standard deviation.
    fn from(sigma: Time) -> Self {
        EchoWidth {
            sigma,
            tail: None,
            is_gaussian: true,
            energy_spread: 0.0,
            pde_spread: 0.0,
        }
    }
}

/// Time constants after which a tail ends: 10⁻¹¹ of it is left out, as of the Gaussian in ranging.
pub const TAIL_REACH: f64 = 25.0;

/// Samples to a time constant, or to the standard deviation of the Gaussian that the shape is convolved with: a spike that stands for
/// all that is not late then adds 0.04 % to the Gaussian's variance.
const SAMPLES: f64 = 20.0;

/// Most samples of a shape.
const MOST_SAMPLES: f64 = 60_000.0;

impl DiffusionTail {
    /// Mean delay of all photons.
    pub fn mean_s(&self) -> f64 {
        self.share * self.time.as_s()
    }

    /// The shape of what is detected of a pulse, to be convolved with a Gaussian of standard deviation `sigma`: of a measured pulse, or of
    /// none but that Gaussian.
    pub fn shape(&self, measured: Option<&PulseShape>, sigma: Time) -> PulseShape {
        let tau_fs = self.time.as_fs() as f64;
        let tail_fs = TAIL_REACH * tau_fs;
        let fine_fs = match sigma {
            Time::ZERO => tau_fs / SAMPLES,
            sigma => tau_fs.min(sigma.as_fs() as f64) / SAMPLES,
        };
        // Where nothing is measured, a triangle of two steps is a pulse without width.
        let (powers, step_fs): (Vec<f64>, f64) = match measured {
            None => {
                let least_fs = tail_fs / MOST_SAMPLES;
                (vec![0.0, 1.0, 0.0], fine_fs.max(least_fs).ceil())
            }
            Some(shape) => {
                let own_fs = shape.step.as_fs() as f64;
                let last = (shape.samples.len() - 1) as f64;
                let least_fs = (tail_fs + own_fs * last) / MOST_SAMPLES;
                let step_fs = own_fs.min((tau_fs / SAMPLES).max(least_fs)).ceil();
                let samples = (own_fs * last / step_fs).ceil() as usize + 1;
                let sample_power = |n: usize| shape.power_at(n as f64 * step_fs / own_fs);
                ((0..samples).map(sample_power).collect(), step_fs)
            }
        };
        // Exact for powers that are linear between samples.
        let kept = libm::exp(-step_fs / tau_fs);
        let mean = tau_fs / step_fs * -libm::expm1(-step_fs / tau_fs);
        let (of_first, of_second) = (mean - kept, 1.0 - mean);
        let mut late = 0.0;
        let mut before = 0.0;
        let rest = (tail_fs / step_fs).ceil() as usize;
        let shape = powers.iter().copied().chain(std::iter::repeat_n(0.0, rest));
        let detected = shape.map(|power| {
            late = kept * late + of_first * before + of_second * power;
            before = power;
            (1.0 - self.share) * power + self.share * late
        });
        let samples: Vec<f64> = detected.collect();
        PulseShape::new(Time::from_fs(step_fs as i64), &samples).expect("a pulse stays one")
    }
}

/// The rise of a Gaussian pulse of standard deviation `sigma` whose photons are all late with the time constant `tau`, `time` after the
/// Gaussian's centre, all in one unit and the first two above 0: share of the photons until then, their density, and the slope of the share
/// with ln sigma.
pub fn late_edge(time: f64, sigma: f64, tau: f64) -> [f64; 3] {
    let (z, k) = (time / sigma, sigma / tau);
    let (x, density) = (k - z, normal_density(z));
    // What has been absorbed and not yet come.
    let pending = if x > 0.0 {
        0.5 * libm::exp(-0.5 * z * z) * erfcx(x * FRAC_1_SQRT_2)
    } else {
        libm::exp(k * (0.5 * k - z)) * normal_above(x)
    };
    let share = (normal_above(-z) - pending).max(0.0);
    [share, pending / tau, k * (density - k * pending)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::pulse_share;
    use proptest::prelude::*;

    /// Share of the photons before a time, by adding up over delays.
    fn by_sum(time: f64, sigma: f64, tau: f64) -> f64 {
        let steps = 20_000;
        let share = |n: i32| {
            let u = (f64::from(n) + 0.5) / f64::from(steps);
            let delay = -tau * u.ln();
            pulse_share(f64::NEG_INFINITY.max(-1e6), time - delay, sigma)
        };
        (0..steps).map(share).sum::<f64>() / f64::from(steps)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn the_edge_is_that_of_its_photons(time in -5.0f64..20.0, sigma in 0.1f64..2.0, tau in 0.05f64..5.0) {
            let [share, density, by_width] = late_edge(time, sigma, tau);
            prop_assert!((share - by_sum(time, sigma, tau)).abs() < 2e-4);
            let slope = |f: &dyn Fn(f64) -> f64| (f(1e-4) - f(-1e-4)) / 2e-4;
            let by_time = slope(&|h| late_edge(time + h, sigma, tau)[0]);
            prop_assert!((by_time - density).abs() < 1e-5, "{by_time} {density}");
            let by_ln = slope(&|h| late_edge(time, sigma * h.exp(), tau)[0]);
            prop_assert!((by_ln - by_width).abs() < 1e-5, "{by_ln} {by_width}");
        }

        /// The sampled shape and the formula are one shape.
        #[test]
        fn what_is_sampled_is_what_the_formula_says(share in 0.01f64..1.0, ratio in 0.1f64..10.0, time in -4.0f64..40.0) {
            let sigma = Time::from_ps(100);
            let tail = DiffusionTail { share, time: Time::from_s(ratio * 1e-10) };
            let shape = tail.shape(None, sigma);
            // From its spike on, by cells and convolved with the Gaussian.
            let spike_ps = shape.step.as_fs() as f64 * 1e-3;
            let step_ps = 4.0;
            let cells = (shape.samples.len() as f64 * spike_ps / step_ps).ceil() as i64;
            let before = |ps: f64| shape.cumulative(Time::from_fs((1e3 * ps) as i64));
            let sum: f64 = (0..=cells)
                .map(|n| {
                    let from = n as f64 * step_ps;
                    let mass = before(from + step_ps) - before(from);
                    let late = from + 0.5 * step_ps - spike_ps;
                    mass * normal_above(-(100.0 * time - late) / 100.0)
                })
                .sum();
            let late = late_edge(100.0 * time, 100.0, 100.0 * ratio)[0];
            let expected = (1.0 - share) * normal_above(-time) + share * late;
            prop_assert!((sum - expected).abs() < 2e-3, "{sum} {expected}");
            let mean_ps = (shape.mean_fs() * 1e-3) - spike_ps;
            prop_assert!((mean_ps / (1e12 * tail.mean_s()) - 1.0).abs() < 5e-3, "{mean_ps}");
        }
    }

    #[test]
    fn a_measured_pulse_gets_the_tails_moments() {
        let measured = PulseShape::new(Time::from_ps(250), &[0.0, 3.0, 1.0, 0.0]).unwrap();
        let tail = DiffusionTail {
            share: 0.3,
            time: Time::from_ps(400),
        };
        let shape = tail.shape(Some(&measured), Time::ZERO);
        let [mean, variance] = [0.3 * 4e5, (2.0 * 0.3 - 0.09) * 1.6e11];
        assert!((shape.mean_fs() / (measured.mean_fs() + mean) - 1.0).abs() < 1e-3);
        assert!((shape.variance_fs2() / (measured.variance_fs2() + variance) - 1.0).abs() < 5e-3);
    }
}
