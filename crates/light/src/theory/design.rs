//! What a guided sensor's clock, counter and histogram allow (thesis 4.8, Equations 23 to 25, Table 9), and what a
//! stereo pair asks of them (5.2, Equations 26 and 27, Fig. 61 and 71).
//!
//! ```text
//!            ◄───────── window, M bins ─────────►
//!   ─────────┼──┬──┬──┬──┬──┬──┬──┬──┬──┬──┬──┬──┼──────────► range
//!                        ▲ centre: only every `step`
//!                     ▲ estimate ± σ
//! ```
//!
//! Equation 25 lets the estimate stray ±3σ before it leaves the window, the window being centred on it. A real
//! window can only be put on a grid of steps, so its centre is off by up to half a step: counted here as an
//! error of its own, uniform and independent of the estimate's.

use std::f64::consts::FRAC_1_SQRT_2;

use libm::erf;

use crate::numerics::{normal_above, normal_density};

/// ±3σ of a normal distribution: the thesis's "99.7 %".
pub fn three_sigma() -> f64 {
    erf(3.0 / std::f64::consts::SQRT_2)
}

/// A guided sensor's timing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Design {
    /// Programmable bits of the P-counter, n.
    pub counter_bits: u32,
    /// Histogram bins, M.
    pub bins: u32,
    /// CLK, Hz; its period is one bin.
    pub clk_hz: f64,
    /// Speed of light to use, m/s: Table 9 was made with 3·10⁸.
    pub light_m_per_s: f64,
}

impl Design {
    /// z_bin: the range of one bin, m (Eq. 23).
    pub fn bin_m(&self) -> f64 {
        self.light_m_per_s / (2.0 * self.clk_hz)
    }

    /// z_max: how far the P-counter reaches, m (Eq. 23).
    pub fn max_range_m(&self) -> f64 {
        libm::exp2(f64::from(self.counter_bits)) * self.bin_m()
    }

    /// z_hist: the range of the window, m (Eq. 24).
    pub(crate) fn window_m(&self) -> f64 {
        f64::from(self.bins) * self.bin_m()
    }

    /// σ_source: the greatest standard deviation of the guide at which ±3σ fit into the window, m (Eq. 25).
    pub fn tolerated_sigma_m(&self) -> f64 {
        self.window_m() / 6.0
    }

    /// As [`Design::tolerated_sigma_m`] with the window's centre on a grid of one bin, as the P-counter puts it.
    pub fn tolerated_sigma_on_grid_m(&self) -> f64 {
        tolerated_sigma(self.window_m(), self.bin_m(), three_sigma())
            .expect("a window is wider than its steps")
    }
}

/// Share of estimates whose true value lies inside a window of width `window`, for an unbiased normal error of
/// standard deviation `sigma` and a window centre that is off by up to half a `step` (0: none), uniformly.
///
/// All three in the same unit; `sigma` and `window` above 0.
pub fn share_inside(sigma: f64, window: f64, step: f64) -> f64 {
    let [middle, width] = [0.5 * window / sigma, step / sigma];
    if width <= 1e-3 {
        // Two terms of the mean's series in the step.
        let bend = middle * normal_density(middle) * width * width / 12.0;
        return erf(middle * FRAC_1_SQRT_2) - bend;
    }
    // The mean over the offset is a difference of integrals from the window's end nearest to the target to the farthest.
    let (low, high) = (middle - 0.5 * width, middle + 0.5 * width);
    if low > 1.0 {
        // Of the little outside; ∫ Q is t·Q(t) − φ(t).
        let outside = |t: f64| t * normal_above(t) - normal_density(t);
        return 1.0 - 2.0 / width * (outside(high) - outside(low));
    }
    // Of the inside: ∫ (½ − Q).
    let inside =
        |t: f64| 0.5 * t * erf(t * FRAC_1_SQRT_2) + normal_density(0.0) * libm::expm1(-0.5 * t * t);
    2.0 / width * (inside(high) - inside(low))
}

/// The greatest `sigma` for which [`share_inside`] is at least `share` (0 to 1, exclusive); `None` where even a
/// perfect estimate falls outside more often, because the steps are wider than the window.
pub fn tolerated_sigma(window: f64, step: f64, share: f64) -> Option<f64> {
    let (mut low, mut high) = (1e-9 * window, 1e3 * window);
    if share_inside(low, window, step) < share {
        return None;
    }
    for _ in 0..100 {
        let middle = (low * high).sqrt();
        if share_inside(middle, window, step) >= share {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(low)
}

/// A pair of cameras, reduced to what its depth errors depend on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoPair {
    /// Focal length, px.
    pub focal_px: f64,
    /// Distance between the cameras, m.
    pub baseline_m: f64,
}

impl StereoPair {
    /// Depth at which a point has `disparity_px`, m (Eq. 26).
    pub fn depth_m(&self, disparity_px: f64) -> f64 {
        self.focal_px * self.baseline_m / disparity_px
    }

    /// Depth error of a small disparity error at `depth_m`, m (Eq. 27).
    pub fn depth_error_m(&self, depth_m: f64, disparity_error_px: f64) -> f64 {
        depth_m * depth_m * disparity_error_px / (self.focal_px * self.baseline_m)
    }

    /// Depth error at `depth_m` of a point in the middle of the image after the cameras turned by `yaw_deg` away
    /// from each other, m: negative, as depths come out short (Fig. 70).
    pub fn yaw_error_m(&self, depth_m: f64, yaw_deg: f64) -> f64 {
        let shift_px = self.focal_px * libm::tan(yaw_deg.to_radians());
        self.depth_m(self.focal_px * self.baseline_m / depth_m + shift_px) - depth_m
    }

    /// The smallest bin interval that keeps ±3σ of the estimates at `depth_m` inside a window of `bins`, m, for a
    /// disparity error of standard deviation `sigma_px` (Eq. 25 solved for z_bin, Fig. 71).
    pub fn least_bin_m(&self, depth_m: f64, sigma_px: f64, bins: u32) -> f64 {
        6.0 * self.depth_error_m(depth_m, sigma_px) / f64::from(bins)
    }

    /// As [`StereoPair::least_bin_m`] with the window's centre on a grid of `step_bins` bins; `None` where the steps
    /// are too wide for any.
    pub fn least_bin_on_grid_m(
        &self,
        depth_m: f64,
        sigma_px: f64,
        bins: u32,
        step_bins: f64,
    ) -> Option<f64> {
        let tolerated = tolerated_sigma(f64::from(bins), step_bins, three_sigma())?;
        Some(self.depth_error_m(depth_m, sigma_px) / tolerated)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn table_9(clk_hz: f64) -> Design {
        Design {
            counter_bits: 9,
            bins: 16,
            clk_hz,
            light_m_per_s: 3e8,
        }
    }

    #[test]
    fn first_row_of_table_9_by_hand() {
        let design = table_9(100e6);
        assert_eq!(design.bin_m(), 1.5);
        assert_eq!(design.max_range_m(), 768.0);
        assert_eq!(design.window_m(), 24.0);
        assert_eq!(design.tolerated_sigma_m(), 4.0);
    }

    #[test]
    fn without_steps_three_sigma_is_a_sixth_of_the_window() {
        let sigma = tolerated_sigma(6.0, 0.0, three_sigma()).unwrap();
        assert!((sigma - 1.0).abs() < 1e-12, "{sigma}");
    }

    /// The closed form against the plain mean over many offsets.
    #[test]
    fn steps_are_averaged_over() {
        for (sigma, window, step) in [(1.0, 6.0, 1.0), (0.2, 3.0, 2.0), (2.0, 3.0, 0.5)] {
            let inside = |offset: f64| {
                let half = 0.5 * window;
                1.0 - normal_above((half - offset) / sigma) - normal_above((half + offset) / sigma)
            };
            let n = 20_000;
            let mean = (0..n)
                .map(|i| inside(step * ((i as f64 + 0.5) / n as f64 - 0.5)))
                .sum::<f64>()
                / n as f64;
            let closed = share_inside(sigma, window, step);
            assert!((closed - mean).abs() < 1e-9, "{closed} {mean}");
        }
    }

    #[test]
    fn steps_wider_than_the_window_tolerate_nothing() {
        assert_eq!(tolerated_sigma(1.0, 1.5, three_sigma()), None);
    }

    #[test]
    fn depth_error_follows_from_depth() {
        let pair = StereoPair {
            focal_px: 12e-3 / 3.45e-6,
            baseline_m: 1.0,
        };
        let z_m = 80.0;
        let d_px = pair.focal_px / z_m;
        let by_difference = (pair.depth_m(d_px - 1e-4) - pair.depth_m(d_px + 1e-4)) / 2e-4;
        assert!((by_difference / pair.depth_error_m(z_m, 1.0) - 1.0).abs() < 1e-6);
        // f tan 0.1° = 6.0706 px more than 86.957 px.
        assert!((pair.yaw_error_m(40.0, 0.1) + 40.0 * 6.0706 / (86.9565 + 6.0706)).abs() < 1e-3);
    }

    proptest! {
        #[test]
        fn steps_only_cost(window in 0.1f64..100.0, step_share in 0.0f64..0.9) {
            let with = tolerated_sigma(window, step_share * window, three_sigma());
            let without = tolerated_sigma(window, 0.0, three_sigma()).unwrap();
            prop_assert!(with.is_none_or(|with| with <= without * (1.0 + 1e-9)));
        }

        #[test]
        fn the_tolerated_sigma_is_where_the_share_is_met(window in 0.1f64..100.0, step_share in 0.0f64..0.9) {
            if let Some(sigma) = tolerated_sigma(window, step_share * window, three_sigma()) {
                let share = |sigma| share_inside(sigma, window, step_share * window);
                prop_assert!(share(sigma * 0.999) >= three_sigma() - 1e-12);
                prop_assert!(share(sigma * 1.001) <= three_sigma() + 1e-12);
            }
        }
    }
}
