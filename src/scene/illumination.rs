//! From surfaces to light: what every macropixel detects.

use super::settings::Scene;
use super::truth::GroundTruth;
use crate::photon::PixelLight;
use crate::units::Time;

/// The sky has no reflectivity, but it is not dark: it counts as a surface of this reflectivity
/// in sunlight that returns no echo. A tenth of a white wall is of the order of a clear sky in
/// the near infrared; haze is brighter.
pub const SKY_REFLECTIVITY: f64 = 0.1;

/// Most signal photons per cycle that are modelled. Sixteen SPADs saturate long before, and a
/// surface right before the lens would ask for 10¹⁰.
const MOST_SIGNAL_PER_CYCLE: f64 = 1e4;

/// Highest background rate that is modelled, far beyond saturation.
const MOST_BACKGROUND_HZ: f64 = 1e11;

impl Scene {
    /// The light on every macropixel, in the order of `truth`.
    ///
    /// Background is sunlight from the surface (Eq. 16), or from the sky, plus dark counts.
    /// Signal is Eq. 15; a sky pixel has none. The laser fires with the STOP edge, so an echo
    /// arrives after its time of flight. Light far beyond saturation is cut at 10⁴ photons per
    /// pulse and 10¹¹ per second.
    pub fn pixel_light(&self, truth: &GroundTruth) -> Vec<PixelLight> {
        let budget = self.photon_budget(truth.rows, truth.cols);
        let klux = self.light.illuminance_klux;
        let dark_hz = self.lidar.dark_count_hz;
        let background_hz = |reflectivity| {
            (budget.background_hz(reflectivity, klux) + dark_hz).min(MOST_BACKGROUND_HZ)
        };
        (truth.range_m.iter().zip(&truth.reflectivity))
            .map(|(range_m, &reflectivity)| match *range_m {
                Some(range_m) => {
                    let signal = budget.signal_per_pulse(range_m, reflectivity);
                    let echo = signal.min(MOST_SIGNAL_PER_CYCLE);
                    PixelLight::echo(echo, Time::of_flight(range_m))
                        .with_background(background_hz(reflectivity))
                }
                None => PixelLight::background(background_hz(self.light.sky_reflectivity)),
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sky_gives_background_only() {
        let scene = Scene::outdoor();
        let truth = GroundTruth::render(&scene, 64, 64);
        let lights = scene.pixel_light(&truth);
        let sky = truth.range_m.iter().position(Option::is_none).unwrap();
        assert_eq!(lights[sky].signal_per_cycle(), 0.0);
        assert!(lights[sky].background_hz() > 1e6);
    }

    #[test]
    fn an_echo_at_100_m_stands_out_after_1000_cycles() {
        let scene = Scene::outdoor();
        let budget = scene.photon_budget(64, 64);
        let (cycles, bin_s) = (1000.0, 1.0 / 384e6);
        let signal = cycles * budget.signal_per_pulse(100.0, 0.1);
        let per_bin = cycles * bin_s * budget.background_hz(0.1, scene.light.illuminance_klux);
        assert!(
            signal > 5.0 * per_bin.sqrt() * 2.0,
            "{signal} over {per_bin}"
        );
    }

    #[test]
    fn a_blinding_surface_is_cut_off_beyond_saturation() {
        let mut scene = Scene::outdoor();
        scene.lidar.lens_diameter_mm = 1e200;
        scene.lidar.pulse_energy_uj = 1e300;
        let truth = GroundTruth::render(&scene, 4, 4);
        for light in scene.pixel_light(&truth) {
            assert!(light.signal_per_cycle() <= MOST_SIGNAL_PER_CYCLE);
            assert!(light.background_hz() <= MOST_BACKGROUND_HZ);
        }
    }

    #[test]
    fn light_follows_range_and_dark_counts_add() {
        let mut scene = Scene::outdoor();
        let truth = GroundTruth::render(&scene, 8, 8);
        let before = scene.pixel_light(&truth);
        scene.lidar.dark_count_hz += 1000.0;
        let after = scene.pixel_light(&truth);
        for ((range_m, a), b) in truth.range_m.iter().zip(&before).zip(&after) {
            assert!((b.background_hz() - a.background_hz() - 1000.0).abs() < 1e-6);
            if let Some(r) = range_m {
                assert!((a.arrival().as_range_m() - r).abs() < 1e-6);
            }
        }
    }
}
