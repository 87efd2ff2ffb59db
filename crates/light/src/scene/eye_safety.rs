//! Whether a laser stays within class 1: the accessible emission that gets into an eye at 100 mm, beside the limits of IEC 60825-1.
//!
//! ```text
//!   beam, peak intensity ──► 7 mm at 100 mm ──► energy a pulse ──┬─ alone, or all within 5 us   ≤ AEL(pulse)
//!   source ──► angle (1.5 to 100 mrad) ──► C6, T2                ├─ as one of a train           ≤ C5 · AEL(pulse)
//!   rates ──► pulses within 5 us, N within T2                    ╰─ on average over 100 s       ≤ AEL(100 s)
//! ```
//!
//! Source: IEC 60825-1:2014, 4.3, tables 3 and 9, 5.4.3 b (condition 3), for the retina at 700 to 1050 nm. Limits are those of ICNIRP 2013
//! times the area of a 7 mm pupil, which the tests compute. Beams that a telescope collects (condition 1) are not judged: those of a flash lidar
//! diverge by degrees. A fault of the driver is not, either.

use std::f64::consts::PI;

use serde::Serialize;

use super::settings::Scene;
use super::words::BeamWord;
use super::{Measured, PinholeCamera};

/// Wavelengths that are judged, nm.
const JUDGED_NM: std::ops::RangeInclusive<f64> = 700.0..=1050.0;

/// Solid angle of an eye's 7 mm at 100 mm, sr.
const APERTURE_SR: f64 = PI * 0.035 * 0.035;

/// Pulses within this time count as one, s (T_i).
const ONE_PULSE_S: f64 = 5e-6;

/// Time over which an unintended look is averaged, s.
const TIME_BASE_S: f64 = 100.0;

/// Least angle of a source, mrad; and the largest that counts for pulses below 625 us.
const POINT_MRAD: f64 = 1.5;
const WIDEST_FOR_PULSES_MRAD: f64 = 5.0;
const WIDEST_MRAD: f64 = 100.0;

/// Light of a pulsed laser that gets through 7 mm at 100 mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Emission {
    pub(crate) wavelength_nm: f64,
    /// Energy of one pulse through the aperture, J.
    pub(crate) pulse_j: f64,
    /// Pulses a second while there are pulses.
    pub(crate) rate_hz: f64,
    /// Pulses a second on average.
    pub(crate) mean_rate_hz: f64,
    /// Angle of the apparent source at 100 mm, mrad.
    pub(crate) source_mrad: f64,
}

/// The rule that limits a laser first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum EyeRule {
    /// The pulses within 5 us together.
    SinglePulse,
    /// The same, as one of a train.
    PulseTrain,
    /// The mean over 100 s.
    Average,
}

impl EyeRule {
    /// In tables.
    pub const fn name(self) -> &'static str {
        match self {
            EyeRule::SinglePulse => "one pulse, 4.3 f 1",
            EyeRule::PulseTrain => "train of pulses, 4.3 f 3",
            EyeRule::Average => "average power, 4.3 f 2",
        }
    }
}

/// A laser beside class 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EyeSafety {
    /// Accessible emission over its limit, by the rule that limits first; class 1 up to 1.
    pub times_class_1: f64,
    /// That rule.
    pub rule: EyeRule,
    /// Energy of a pulse into an eye, J.
    pub pulse_into_eye_j: f64,
    /// Mean power into an eye, W.
    pub power_into_eye_w: f64,
}

impl Emission {
    /// The same laser with `times` the energy in a pulse and other rates, pulses a second during an exposure and on average.
    #[must_use]
    pub fn with(self, times: f64, rate_hz: f64, mean_rate_hz: f64) -> Self {
        Emission {
            pulse_j: times * self.pulse_j,
            rate_hz,
            mean_rate_hz,
            ..self
        }
    }

    /// The limit that is nearest; `None` at wavelengths that are not judged.
    pub fn beside_class_1(&self) -> Option<EyeSafety> {
        if !JUDGED_NM.contains(&self.wavelength_nm) {
            return None;
        }
        let together = (ONE_PULSE_S * self.rate_hz).floor() + 1.0;
        let angle = self.source_mrad.clamp(POINT_MRAD, WIDEST_MRAD);
        let in_train = self.mean_rate_hz / together * t2_s(angle);
        // Pulses of a diverging source are short beside 625 us, so that no more than 5 mrad count.
        let pulse_limit_j = self.pulse_limit_j(angle.min(WIDEST_FOR_PULSES_MRAD));
        let pulse_j = together * self.pulse_j;
        let power_w = self.pulse_j * self.mean_rate_hz;
        let times = [
            (EyeRule::SinglePulse, pulse_j / pulse_limit_j),
            (
                EyeRule::PulseTrain,
                pulse_j / (c5(in_train) * pulse_limit_j),
            ),
            (EyeRule::Average, power_w / self.mean_limit_w(angle)),
        ];
        let (rule, times_class_1) =
            times.into_iter().fold(
                times[0],
                |most, next| {
                    if next.1 > most.1 { next } else { most }
                },
            );
        Some(EyeSafety {
            times_class_1,
            rule,
            pulse_into_eye_j: self.pulse_j,
            power_into_eye_w: power_w,
        })
    }

    /// Limit of a pulse of 10 ps to 5 us, J.
    fn pulse_limit_j(&self, angle_mrad: f64) -> f64 {
        7.7e-8 * self.c4() * angle_mrad / POINT_MRAD
    }

    /// Limit of the mean power over 100 s, W.
    fn mean_limit_w(&self, angle_mrad: f64) -> f64 {
        match angle_mrad > POINT_MRAD {
            true => {
                let lasts_s = t2_s(angle_mrad).min(TIME_BASE_S);
                7e-4 * self.c4() * angle_mrad / POINT_MRAD * libm::pow(lasts_s, -0.25)
            }
            false => 3.9e-4 * self.c4(),
        }
    }

    /// The eye's lower absorption in the near infrared.
    fn c4(&self) -> f64 {
        libm::pow(10f64, 0.002 * (self.wavelength_nm - 700.0))
    }
}

/// Time after which an eye's movements spread the light, s.
fn t2_s(angle_mrad: f64) -> f64 {
    10.0 * libm::pow(10f64, (angle_mrad - POINT_MRAD) / 98.5)
}

/// What a pulse of a train of `pulses` may have of what it may have alone.
fn c5(pulses: f64) -> f64 {
    match pulses > 600.0 {
        true => (5.0 * libm::pow(pulses, -0.25)).clamp(0.4, 1.0),
        false => 1.0,
    }
}

impl Scene {
    /// What gets into an eye at 100 mm before the brightest direction of the beam. Pulses come at `rate_hz` during an exposure and at
    /// `mean_rate_hz` on average.
    pub fn emission(&self, rows: u32, cols: u32, rate_hz: f64, mean_rate_hz: f64) -> Emission {
        let lidar = &self.lidar;
        let per_sr = self.brightest_per_sr(&self.lidar_camera(rows, cols));
        Emission {
            wavelength_nm: lidar.warm_wavelength_nm(),
            pulse_j: lidar.pulse_energy_uj * 1e-6 * (per_sr * APERTURE_SR).min(1.0),
            rate_hz,
            mean_rate_hz,
            source_mrad: lidar.laser_source_mm / 0.1,
        }
    }

    /// The largest share of a pulse that goes into a solid angle, 1/sr.
    fn brightest_per_sr(&self, camera: &PinholeCamera) -> f64 {
        let beam = &self.lidar.beam;
        if let Some(curve) = beam.curve() {
            return curve.greatest() / self.lidar.beam_total();
        }
        if *beam == Measured::Word(BeamWord::Gaussian) {
            return 1.0 / self.lidar.beam_total();
        }
        // All macropixels get the same, and one in a corner sees the smallest solid angle.
        let pitch = [1.0 / camera.focal_px, 1.0 / camera.focal_v_px];
        let share = (self.lidar.spot).share_per_pixel(camera.height, camera.width, pitch);
        let cosine = 1.0 / camera.at_unit_depth((0.5, 0.5)).length();
        share / (pitch[0] * pitch[1] * cosine.powi(3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn emission(wavelength_nm: f64, pulse_j: f64) -> Emission {
        Emission {
            wavelength_nm,
            pulse_j,
            rate_hz: 1.0,
            mean_rate_hz: 1.0,
            source_mrad: 0.0,
        }
    }

    fn within(value: f64, expected: f64, share: f64) {
        assert!((value / expected - 1.0).abs() < share, "{value} {expected}");
    }

    /// ICNIRP 2013, table 5, in J/m² and W/m² at the cornea, through a pupil of 7 mm.
    #[test]
    fn limits_are_exposure_limits_times_the_pupil() {
        let pupil_m2 = PI * 3.5e-3 * 3.5e-3;
        for nm in [700.0, 850.0, 905.0, 1050.0] {
            let c4 = 10f64.powf(0.002 * (nm - 700.0));
            let light = emission(nm, 1e-9);
            within(light.pulse_limit_j(1.5), 2e-3 * c4 * pupil_m2, 0.01);
            within(light.pulse_limit_j(3.0), 4e-3 * c4 * pupil_m2, 0.01);
            within(light.mean_limit_w(1.5), 10.0 * c4 * pupil_m2, 0.02);
            let of_10_s = 18.0 * c4 * 10f64.powf(0.75) * pupil_m2 / 10.0;
            within(light.mean_limit_w(1.500_001), of_10_s, 0.02);
        }
    }

    /// Class 1 at 850 nm is known to end at 0.78 mW from a point, and at 905 nm at 0.2 uJ for one short pulse.
    #[test]
    fn known_limits_are_met() {
        within(emission(850.0, 0.0).mean_limit_w(1.5), 0.78e-3, 0.01);
        within(emission(905.0, 0.0).pulse_limit_j(1.5), 0.198e-6, 0.01);
    }

    #[test]
    fn the_strictest_rule_decides() {
        let judged = |light: Emission| light.beside_class_1().unwrap();
        let alone = emission(905.0, 0.1e-6);
        assert_eq!(judged(alone).rule, EyeRule::SinglePulse);
        // 10 000 pulses a second within 10 s: C5 is at its least.
        let train = Emission {
            rate_hz: 1e4,
            mean_rate_hz: 1e4,
            ..emission(905.0, 2e-9)
        };
        within(judged(train).times_class_1, 2e-9 / (0.4 * 0.198e-6), 0.01);
        assert_eq!(judged(train).rule, EyeRule::PulseTrain);
        // At 1 MHz six pulses come within 5 us, and the mean is 2 mW.
        let fast = Emission {
            rate_hz: 1e6,
            mean_rate_hz: 1e6,
            ..train
        };
        assert_eq!(judged(fast).rule, EyeRule::Average);
        within(judged(fast).times_class_1, 2e-3 / 1.003e-3, 0.01);
        // A source of 10 mm may have as much on average as 66.7 points, for 100 s instead of 10.
        let wide = Emission {
            source_mrad: 100.0,
            ..fast
        };
        let average = 2e-3 / (1.003e-3 * 66.67 * 10f64.powf(-0.25) * 0.998);
        let pulses = 6.0 * 2e-9 / (0.4 * 0.198e-6 * 5.0 / 1.5);
        within(judged(wide).times_class_1, f64::max(average, pulses), 0.02);
        assert_eq!(emission(1550.0, 1.0).beside_class_1(), None);
    }

    /// A published example: pulses of 1.55 nJ at 80.1 MHz and 784 nm from a diffusing sphere 2 mm wide, judged by EN 60825-1:2014 in the
    /// repository github.com/akufcsak/laser_safety. Its two figures are those of LaserBee: what reaches 100 mm within 100 s, and how
    /// much may; limits of the source's width are reckoned by its tables.
    #[test]
    fn a_published_example_is_met() {
        let (power_w, rate_hz, pupil_m2) = (0.124, 80.1e6, PI * 3.5e-3 * 3.5e-3);
        let point = Emission {
            rate_hz,
            mean_rate_hz: rate_hz,
            ..emission(784.0, power_w / rate_hz * APERTURE_SR / (4.0 * PI))
        };
        let wide = Emission {
            source_mrad: 2.0 / 0.101,
            ..point
        };
        let judged = |light: Emission| light.beside_class_1().unwrap();
        within(
            judged(point).power_into_eye_w * 100.0 / pupil_m2,
            98.678,
            1e-4,
        );
        let limit_w = |found: EyeSafety| found.power_into_eye_w / found.times_class_1;
        // AELs are rounded MPEs: 3.9e-4 W for 10 W/m2 within the pupil.
        within(limit_w(judged(point)) / pupil_m2, 14.72, 0.015);
        // C4 is 1.4723, C6 19.8/1.5, T2 15.34 s.
        within(
            limit_w(judged(wide)),
            7e-4 * 1.4723 * 13.201 * 15.34f64.powf(-0.25),
            1e-3,
        );
        for found in [point, wide].map(judged) {
            assert!(
                found.rule == EyeRule::Average && found.times_class_1 < 1.0,
                "{found:?}"
            );
        }
    }

    /// What goes into the aperture, by hand: a field of 16 x 16 degrees, bright alike.
    #[test]
    fn a_beam_spreads_its_pulse_over_its_field() {
        let scene = Scene::parse("test", "[lidar]\nfov_deg = 16\n").unwrap();
        let into_eye = scene.emission(64, 64, 1.0, 1.0).pulse_j / 20e-6;
        let side = 2.0 * 8f64.to_radians().tan();
        within(into_eye, APERTURE_SR / (side * side), 0.07);
        assert!(into_eye > APERTURE_SR / (side * side));
        let narrow = Scene::parse("test", "[lidar]\nfov_deg = 0.2\n").unwrap();
        within(narrow.emission(64, 64, 1.0, 1.0).pulse_j, 20e-6, 1e-12);
        // A Gaussian beam has 4 ln 2 / pi of its pulse in a square of its width, at most.
        let gaussian = "[lidar]\nbeam = \"gaussian\"\nbeam_fwhm_deg = 10\n";
        let gaussian = Scene::parse("test", gaussian).unwrap();
        let width = 10f64.to_radians();
        let most = 4.0 * std::f64::consts::LN_2 / PI / (width * width) * APERTURE_SR;
        let into_eye = gaussian.emission(64, 64, 1.0, 1.0).pulse_j / 20e-6;
        within(into_eye, most, 0.02);
    }
}
