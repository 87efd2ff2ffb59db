//! What is between lidar and surfaces: fog and rain.
//!
//! ```text
//!   lidar ─►· · · · · ·►▐ surface       light that is left after z: exp(-extinction·z), both ways its square
//!         ◄─ · · · ·                    what droplets send back on the way: an early echo, long and falling as 1/z²
//! ```
//!
//! Single scattering: light that droplets throw aside is lost, though in dense fog some of it comes back later. Rain
//! weakens, but its few large drops send no steady light back.

use std::f64::consts::PI;

use super::words::{LENGTH, NEAR_M};
use crate::settings::Range::Within;
use crate::settings::keys;

/// Extinction over backscatter of droplets of water, sr: 18.8 ± 0.8 at 905 nm (O'Connor, Illingworth and Hogan 2004).
pub const DROPLET_LIDAR_RATIO_SR: f64 = 18.8;

keys! {
    /// The air. Clear unless given.
    #[derive(Copy)]
    #[non_exhaustive]
    pub struct Medium {
        /// Share of light that fog takes away per metre: 3.912 over the visibility.
        ///
        /// Of haze too, about the same in the near infrared as in the visible, because droplets are larger than either wavelength.
        extinction_1_m: f64 ["1/m"] = 0.0, in Within(0.0, 10.0), usually (0.0, 2.0),
            from "clear air; Koschmieder's law";
        /// Share of light that fog sends straight back; extinction over 18.8 sr if left out.
        ///
        /// 18.8 sr is [`DROPLET_LIDAR_RATIO_SR`].
        #[serde(skip_serializing_if = "Option::is_none")]
        backscatter_1_m_sr: Option<f64> ["1/m/sr"] = None, in Within(0.0, 10.0),
            from "O'Connor, Illingworth and Hogan 2004, droplets at 905 nm";
        /// Rain, which weakens light and sends none back.
        rain_mm_h: f64 ["mm/h"] = 0.0, in Within(0.0, 500.0),
            from "ITU-R P.1814: 1.076 R^0.67 dB/km";
        /// Nearest fog that the laser lights up and the macropixels see.
        overlap_m: f64 ["m"] = 0.5, in LENGTH, usually NEAR_M, from "chosen: laser and lens stand side by side";
    }
}

impl Medium {
    /// Whether light passes as through nothing.
    pub(crate) fn is_clear(&self) -> bool {
        self.total_extinction_1_m() == 0.0 && self.backscatter_1_m_sr() == 0.0
    }

    /// Whether droplets or smoke send light back by themselves.
    pub fn sends_light_back(&self) -> bool {
        self.backscatter_1_m_sr() > 0.0
    }

    /// Extinction of fog and rain together, 1/m.
    ///
    /// Rain: 1.076·R^0.67 dB/km (ITU-R P.1814, Japan's and France's measurements at optical wavelengths).
    pub(crate) fn total_extinction_1_m(&self) -> f64 {
        // A power is dear, and most air is dry.
        let rain = if self.rain_mm_h > 0.0 {
            let rain_db_km = 1.076 * libm::pow(self.rain_mm_h, 0.67);
            let db_km_per_1_m = 1e4 * std::f64::consts::LOG10_E;
            rain_db_km / db_km_per_1_m
        } else {
            0.0
        };
        self.extinction_1_m + rain
    }

    /// Share of light that droplets of fog send straight back, per metre and steradian.
    pub(crate) fn backscatter_1_m_sr(&self) -> f64 {
        (self.backscatter_1_m_sr).unwrap_or(self.extinction_1_m / DROPLET_LIDAR_RATIO_SR)
    }

    /// Share of light that is left after `range_m`, one way. There and back it is the square.
    pub(crate) fn transmission(&self, range_m: f64) -> f64 {
        libm::exp(-self.total_extinction_1_m() * range_m)
    }

    /// The early echo of the fog before a surface at `until_m`: what it sends back from each of the cells between
    /// `edges_m` (rising), as photons a pulse, or whatever else `surface` gives. `surface(range_m, reflectivity)` is what
    /// a Lambertian surface, met straight, would send back from there through clear air: a metre of fog is like a surface of
    /// reflectivity π·backscatter, because a Lambertian surface sends 1/π of what it reflects back into a steradian.
    ///
    /// Cells are integrated by Gauss's rule with three points; steps of a tenth of their range keep it exact to 1e-6.
    pub(crate) fn backscatter(
        &self,
        edges_m: &[f64],
        until_m: f64,
        surface: impl Fn(f64, f64) -> f64,
    ) -> Vec<f64> {
        let reflectivity_1_m = PI * self.backscatter_1_m_sr();
        let from_cell = |from_m: f64, to_m: f64| {
            let (from_m, to_m) = (from_m.max(self.overlap_m), to_m.min(until_m));
            if reflectivity_1_m == 0.0 || from_m >= to_m {
                return 0.0;
            }
            let (middle_m, half_m) = ((from_m + to_m) / 2.0, (to_m - from_m) / 2.0);
            let points = [(-0.6f64.sqrt(), 5.0), (0.0, 8.0), (0.6f64.sqrt(), 5.0)];
            let sum = points.map(|(place, weight)| {
                let range_m = middle_m + half_m * place;
                // A reflectivity is a share; that of half the cell may be no small one.
                let there = surface(range_m, 1.0) * reflectivity_1_m;
                weight / 9.0 * there * self.transmission(range_m).powi(2)
            });
            half_m * sum.iter().sum::<f64>()
        };
        (edges_m.windows(2))
            .map(|edge| from_cell(edge[0], edge[1]))
            .collect()
    }

    /// Share of the sky's light that fog before a surface at `range_m` has put in the place of the surface's own: what is
    /// taken out of the way is replaced by airlight (Koschmieder), as bright as the sky at the horizon. Without a surface, at an infinite
    /// range, it is all of it.
    pub(crate) fn airlight(&self, range_m: f64) -> f64 {
        if range_m.is_finite() {
            1.0 - self.transmission(range_m)
        } else {
            1.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn fog(extinction_1_m: f64) -> Medium {
        Medium {
            extinction_1_m,
            ..Medium::default()
        }
    }

    #[test]
    fn visibility_ends_where_a_fiftieth_of_the_contrast_is_left() {
        let medium = fog(3.912 / 60.0);
        assert!((medium.transmission(60.0) - 0.02).abs() < 1e-4);
        assert!((medium.airlight(60.0) - 0.98).abs() < 1e-4);
        assert!(Medium::default().is_clear() && !medium.is_clear());
    }

    #[test]
    fn heavy_rain_takes_nine_decibels_a_kilometre() {
        let medium = Medium {
            rain_mm_h: 25.0,
            ..Medium::default()
        };
        assert!((-10.0 * medium.transmission(1000.0).log10() - 9.3).abs() < 0.05);
        assert_eq!(medium.backscatter_1_m_sr(), 0.0);
    }

    /// Fog so dense that all light is sent back or lost, without distance: what comes back is the share that scatters
    /// back, pi over twice the lidar ratio.
    #[test]
    fn endless_fog_returns_pi_over_twice_the_lidar_ratio() {
        let edges: Vec<f64> = (0..=4000)
            .map(|step| 0.5 + 0.05 * f64::from(step))
            .collect();
        let medium = fog(0.1);
        let back: f64 = medium.backscatter(&edges, f64::MAX, |_, r| r).iter().sum();
        let expected = PI / (2.0 * DROPLET_LIDAR_RATIO_SR) * medium.transmission(0.5).powi(2);
        assert!((back / expected - 1.0).abs() < 1e-6, "{back} {expected}");
    }

    proptest! {
        /// Against a sum over steps of a tenth of a millimetre or so; nothing comes from behind the surface or from before the overlap.
        #[test]
        fn cells_agree_with_a_fine_sum(extinction in 0.001f64..0.2, first in 0.1f64..5.0, until in 1.0f64..40.0) {
            let medium = fog(extinction);
            let edges: Vec<f64> = (0..40).map(|step| first * 1.1f64.powi(step)).collect();
            let surface = |range_m: f64, reflectivity: f64| 50.0 * reflectivity / range_m.powi(2);
            let cells = medium.backscatter(&edges, until, surface);
            for (edge, photons) in edges.windows(2).zip(cells) {
                let step = (edge[1] - edge[0]) / 2000.0;
                let slow: f64 = (0..2000).map(|k| edge[0] + (f64::from(k) + 0.5) * step)
                    .filter(|z| (medium.overlap_m..until).contains(z))
                    .map(|z| step * surface(z, PI * extinction / DROPLET_LIDAR_RATIO_SR) * (-2.0 * extinction * z).exp())
                    .sum();
                // A cell that the overlap or the surface cuts is cut within a step of the sum.
                let cut = [medium.overlap_m, until].iter().any(|z| (edge[0]..edge[1]).contains(z));
                let tolerance = if cut { 2e-3 * step * 2000.0 * surface(edge[0], 0.01) + 1e-2 * slow } else { 1e-5 * slow };
                prop_assert!((photons - slow).abs() <= tolerance + 1e-15, "{photons} {slow} in {edge:?}");
            }
        }
    }
}
