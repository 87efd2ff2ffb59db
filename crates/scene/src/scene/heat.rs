//! What temperature does to the lidar: dark counts, detection efficiency, the laser's line in the filter.
//!
//! ```text
//!   T ──┬─► breakdown voltage rises, the bias stays ─► avalanches are rarer ─┬─► PDE
//!       ├─► carriers are generated: exp(-E/kT) ──────────────────────────────┴─► dark counts
//!       ├─► laser's wavelength ─┬─► share of the signal within the filter
//!       ├─► filter's centre ────┘
//!       └─► junction, 25 K above ─► delays of the chip (`SensorConfig::temperature_c`)
//! ```
//!
//! An excess bias V makes an avalanche of a carrier with the probability 1 − exp(−V/V₀): Otte et al., arXiv:1606.05186, who operate at
//! 90 % of what can be had. That and all keys hold at 25 °C, where every factor here is exactly 1.

use super::curve::CurveSetting;
use super::settings::{Lidar, REFERENCE_C};
use crate::numerics::integrate;
use crate::photon::{Filter, FilterShape};
use crate::units::{BOLTZMANN_EV_PER_K, ZERO_CELSIUS_K};

/// The chip's junction is so much warmer, K. Chosen: the built-in library, whose delays the default scene has, is of 50 °C.
const JUNCTION_RISE_K: f64 = 25.0;

/// What the excess bias at 25 °C detects of what it could.
const TRIGGERED: f64 = 0.9;

impl Lidar {
    /// How much warmer it is than 25 °C, K.
    fn warmer_k(&self) -> f64 {
        self.temperature_c - REFERENCE_C
    }

    /// Temperature of the chip's junction, °C; `None` where the lidar is at 25 °C.
    pub fn junction_c(&self) -> Option<f64> {
        (self.temperature_c != REFERENCE_C).then_some(self.temperature_c + JUNCTION_RISE_K)
    }

    /// Probability that a carrier makes an avalanche, relative to that at 25 °C.
    fn triggering(&self) -> f64 {
        let lost_v = self.breakdown_drift_mv_k * 1e-3 * self.warmer_k();
        let excess = (1.0 - lost_v / self.excess_bias_v).max(0.0);
        -libm::expm1(excess * libm::log1p(-TRIGGERED)) / -libm::expm1(libm::log1p(-TRIGGERED))
    }

    /// Dark counts relative to those at 25 °C, of every SPAD.
    pub(super) fn dark_count_factor(&self) -> f64 {
        // Asked for every macropixel.
        if self.temperature_c == REFERENCE_C {
            return 1.0;
        }
        let inverse = |celsius: f64| 1.0 / (BOLTZMANN_EV_PER_K * (celsius + ZERO_CELSIUS_K));
        let colder = inverse(REFERENCE_C) - inverse(self.temperature_c);
        libm::exp(self.dark_count_activation_ev * colder) * self.triggering()
    }

    /// Dark counts of one macropixel at its temperature, all its SPADs together, Hz.
    pub fn dark_counts_hz(&self) -> f64 {
        self.dark_count_hz * self.dark_count_factor()
    }

    /// Detection efficiency at its temperature and its laser's wavelength, 0 to 1.
    pub fn warm_pde(&self) -> f64 {
        let of_wavelength = match &self.pde_curve {
            CurveSetting::Word(_) => 1.0,
            CurveSetting::Curve(curve) => {
                let pde = |nm| curve.interpolate(nm).unwrap_or(0.0);
                pde(self.warm_wavelength_nm()) / pde(self.wavelength_nm)
            }
        };
        (self.pde * self.triggering() * of_wavelength).min(1.0)
    }

    /// Energy of a pulse at its temperature, J.
    pub fn warm_pulse_j(&self) -> f64 {
        let grown = 1.0 + self.pulse_energy_drift_1_k * self.warmer_k();
        self.pulse_energy_uj * 1e-6 * grown.max(0.0)
    }

    /// The laser's wavelength at its temperature, nm.
    pub(super) fn warm_wavelength_nm(&self) -> f64 {
        self.wavelength_nm + self.laser_drift_nm_k * self.warmer_k()
    }

    /// Share of the laser's light that passes the filter, at its temperature.
    pub fn laser_transmission(&self) -> f64 {
        self.line_transmission(self.warm_wavelength_nm())
    }

    /// Share of the light that passes the filter of a line at `nm` that is as wide as the laser's.
    fn line_transmission(&self, nm: f64) -> f64 {
        let fwhm_nm = self.laser_fwhm_nm;
        if fwhm_nm == 0.0 {
            return self.filter_at(nm).unwrap_or(1.0);
        }
        let breaks = match &self.filter {
            CurveSetting::Word(word) => match word.shape() {
                None => return 1.0,
                Some(shape) => {
                    let filter = self.filter_of(shape);
                    if let Some(share) = filter.transmission_of(nm, fwhm_nm) {
                        return share;
                    }
                    let edge = |k: i32| filter.centre_nm + f64::from(k) * 0.5 * filter.fwhm_nm;
                    (-2..=2).map(edge).collect()
                }
            },
            CurveSetting::Curve(curve) => {
                let points = curve.points.iter();
                points.map(|[at, _]| at + self.filter_shift_nm()).collect()
            }
        };
        let line = Filter::new(nm, fwhm_nm, FilterShape::Gaussian);
        self.passed_share(breaks, line)
    }

    /// Detected photons of a joule of light at `nm`, relative to those of the laser's own light: by the filter, the detection efficiency
    /// and the energy of a photon.
    pub(super) fn detected_beside_own(&self, nm: f64) -> f64 {
        let filter = self.line_transmission(nm) / self.laser_transmission();
        filter * self.relative_pde(nm) * nm / self.warm_wavelength_nm()
    }

    /// Share of a Gaussian line that passes the filter, by its integral; `breaks` are where the filter has kinks.
    fn passed_share(&self, mut breaks: Vec<f64>, line: Filter) -> f64 {
        breaks.extend((-12..=12).map(|k| line.centre_nm + f64::from(k) * 0.25 * line.fwhm_nm));
        let reach_nm = 3.0 * line.fwhm_nm;
        breaks.retain(|nm| (nm - line.centre_nm).abs() <= reach_nm);
        breaks.sort_by(f64::total_cmp);
        let density = |nm: f64| self.filter_at(nm).unwrap_or(0.0) * line.transmission(nm);
        integrate(density, &breaks, 1e-10) / integrate(|nm| line.transmission(nm), &breaks, 1e-10)
    }

    /// By how much the filter's wavelengths have grown, nm.
    pub(super) fn filter_shift_nm(&self) -> f64 {
        self.filter_drift_nm_k * self.warmer_k()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Scene, Train};

    fn lidar_at(celsius: f64) -> Lidar {
        let keys = format!("[lidar]\ntemperature_c = {celsius}\ndark_count_hz = 2e4\n");
        Scene::parse("test", &keys).unwrap().lidar
    }

    #[test]
    fn nothing_changes_at_25_degrees() {
        let (given, lidar) = (Lidar::default(), lidar_at(25.0));
        assert_eq!(lidar.dark_counts_hz(), 2e4);
        assert_eq!(lidar.warm_pde(), given.pde);
        assert_eq!(lidar.warm_wavelength_nm(), given.wavelength_nm);
        assert_eq!((lidar.filter_shift_nm(), lidar.junction_c()), (0.0, None));
    }

    #[test]
    fn heat_acts_as_its_closed_forms_say() {
        let near = |value: f64, expected: f64| {
            assert!((value / expected - 1.0).abs() < 1e-9, "{value} {expected}");
        };
        let hot = lidar_at(105.0);
        // 80 K take 1.72 V of 3 V, of which 1 V loses a factor of 10^(1/3).
        let triggered = (1.0 - 10f64.powf(-(3.0 - 1.72) / 3.0)) / 0.9;
        near(hot.warm_pde(), 0.185 * triggered);
        let generated = f64::exp(0.56 / 8.617_333_262e-5 * (1.0 / 298.15 - 1.0 / 378.15));
        near(hot.dark_counts_hz(), 2e4 * generated * triggered);
        near(hot.warm_wavelength_nm(), 946.4);
        near(hot.filter_shift_nm(), 1.6);
        assert_eq!(hot.junction_c(), Some(130.0));
        // Generation doubles every 9.8 K.
        let steady = |celsius| Lidar {
            breakdown_drift_mv_k: 0.0,
            ..lidar_at(celsius)
        };
        let doubled = steady(34.8).dark_counts_hz() / steady(25.0).dark_counts_hz();
        assert!((doubled - 2.0).abs() < 0.02, "{doubled}");
    }

    #[test]
    fn the_warmer_the_more_dark_counts_and_the_fewer_photons() {
        let all: Vec<Lidar> = (-55..=125)
            .step_by(5)
            .map(|c| lidar_at(f64::from(c)))
            .collect();
        for pair in all.windows(2) {
            assert!(pair[1].dark_counts_hz() > pair[0].dark_counts_hz());
            assert!(pair[1].warm_pde() < pair[0].warm_pde());
        }
        // Without any bias left there are neither.
        let dead = Lidar {
            breakdown_drift_mv_k: 1000.0,
            ..lidar_at(60.0)
        };
        assert_eq!((dead.dark_counts_hz(), dead.warm_pde()), (0.0, 0.0));
    }

    #[test]
    fn a_warm_laser_has_less_energy_for_echoes_and_eyes() {
        let scene = |celsius: f64, drift: f64| {
            let keys = format!(
                "[lidar]\ntemperature_c = {celsius}\npulse_energy_drift_1_k = {drift}\npulse_energy_uj = 20\n"
            );
            Scene::parse("test", &keys)
        };
        let (cold, hot) = (scene(25.0, -0.004).unwrap(), scene(75.0, -0.004).unwrap());
        assert_eq!(cold.lidar.warm_pulse_j(), 20.0 * 1e-6);
        let still = scene(75.0, 0.0).unwrap();
        let train = Train {
            rate_hz: 1e5,
            pulses: 10.0,
            frame_s: 1.0,
        };
        for (less, all) in [
            (hot.lidar.warm_pulse_j(), still.lidar.warm_pulse_j()),
            (
                hot.photon_budget(8, 8).signal_per_pulse(30.0, 0.3),
                still.photon_budget(8, 8).signal_per_pulse(30.0, 0.3),
            ),
            (
                hot.emission(8, 8, train).pulse_j,
                still.emission(8, 8, train).pulse_j,
            ),
        ] {
            assert!((less / all - 0.8).abs() < 1e-12, "{less} {all}");
        }
        let fault = scene(75.0, -0.02).unwrap_err().to_string();
        assert!(
            fault.contains("leaves no light of the laser at 75 C"),
            "{fault}"
        );
    }

    #[test]
    fn a_line_drifts_out_of_its_filter() {
        let share = |keys: &str| {
            let scene = Scene::parse("test", &format!("[lidar]\n{keys}\n")).unwrap();
            scene.lidar.laser_transmission()
        };
        // 4.8 nm off the middle of 10 nm, at 105 degC.
        let hot = share("filter = \"gaussian\"\ntemperature_c = 105");
        assert!((hot - 0.5f64.powf(0.96 * 0.96)).abs() < 1e-12, "{hot}");
        assert_eq!(share("filter = \"top_hat\"\ntemperature_c = 105"), 1.0);
        let of_curve = share("filter = [[930, 0.0], [940, 1.0], [950, 0.0]]\ntemperature_c = 105");
        assert!((of_curve - 0.52).abs() < 1e-9, "{of_curve}");
        // The line's own width: closed forms are the integral's.
        let integral = |shape: FilterShape, lidar: &Lidar| {
            let line = Filter::new(lidar.warm_wavelength_nm(), 2.0, FilterShape::Gaussian);
            let filter = Filter::new(940.0 + lidar.filter_shift_nm(), 10.0, shape);
            let (mut sum, mut all) = (0.0, 0.0);
            for n in -40_000..40_000 {
                let nm = line.centre_nm + (f64::from(n) + 0.5) * 2e-4;
                sum += line.transmission(nm) * filter.transmission(nm);
                all += line.transmission(nm);
            }
            sum / all
        };
        for (shape, word) in [
            (FilterShape::TopHat, "top_hat"),
            (FilterShape::Gaussian, "gaussian"),
            (FilterShape::Cosine, "cosine"),
            (FilterShape::Lorentz, "lorentz"),
        ] {
            let keys =
                format!("[lidar]\nfilter = \"{word}\"\nlaser_fwhm_nm = 2\ntemperature_c = 105");
            let lidar = Scene::parse("test", &keys).unwrap().lidar;
            let (found, expected) = (lidar.laser_transmission(), integral(shape, &lidar));
            assert!(
                (found - expected).abs() < 2e-5,
                "{word}: {found} {expected}"
            );
        }
        let edge = "[lidar]\nfilter = \"top_hat\"\nlaser_drift_nm_k = 0.3\ntemperature_c = 105";
        let fault = Scene::parse("test", edge).unwrap_err().to_string();
        assert!(
            fault.contains("nothing of the laser's 964 nm through at 105 C"),
            "{fault}"
        );
    }
}
