//! Whether a laser stays within class 1: the accessible emission at 100 mm, beside the limits of IEC 60825-1.
//!
//! ```text
//!   beam, peak intensity ──► aperture at 100 mm ──► energy a pulse ─┬─ alone, or all within T_i   ≤ AEL(T_i)
//!   source ──► angle (1.5 to 100 mrad) ──► C6, T2                   ├─ as one of a train          ≤ C5 · AEL(T_i)
//!   rate, exposure, frames ──► pulses within any time T             ├─ an exposure, as one pulse  ≤ C5 · AEL(exposure)
//!                                                                   ╰─ all within T, T_i to 100 s ≤ AEL(T)
//! ```
//!
//! Source: IEC 60825-1:2014, 4.3, tables 2, 3, 9 and 10, 5.4.3 b (condition 3): the retina at 700 to 1200 nm, through 7 mm, and the cornea at
//! 1500 to 1800 nm, through 1 to 3.5 mm. Limits are those of ICNIRP 2013 times the area of the aperture, which the tests compute. Of a source
//! that is wider than α_max (5 mrad for pulses, 200 √T mrad from 625 us on, 100 mrad from 0.25 s on) only the light within α_max counts (5.4.3 b),
//! which is ICNIRP's C_E; the source is taken for a round one of equal brightness. An exposure counts as one pulse of a train where the source is
//! wider than 5 mrad: the strictest reading of 4.3 f 3. Pulses are taken to last 1 ns or more at 1500 to 1800 nm, and 10 ps or more elsewhere.
//!
//! Beams that a telescope collects (condition 1) are not judged: those of a flash lidar diverge by degrees. A fault of the driver is not, either.

use std::f64::consts::PI;

use serde::Serialize;

use super::settings::Scene;
use super::words::BeamWord;
use super::{CurveSetting, PinholeCamera};

/// Time over which an unintended look is averaged, s.
const TIME_BASE_S: f64 = 100.0;

/// Least angle of a source, mrad; and the largest that counts.
const POINT_MRAD: f64 = 1.5;
const WIDEST_MRAD: f64 = 100.0;

/// Times at which a limit changes its law, s.
const TURNS_S: [f64; 4] = [625e-6, 0.25, 0.35, 10.0];

/// What an eye's wavelengths have in common.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Band {
    /// 700 to 1050 nm: the retina.
    NearInfrared,
    /// 1050 to 1200 nm: the retina, which water before it protects.
    Retina1050,
    /// 1500 to 1800 nm: the cornea.
    Cornea1500,
}

/// When pulses come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Train {
    /// Pulses a second during an exposure.
    pub rate_hz: f64,
    /// Pulses of an exposure.
    pub pulses: f64,
    /// From the beginning of an exposure to that of the next one, s.
    pub frame_s: f64,
}

/// Light of a pulsed laser.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Emission {
    pub(crate) wavelength_nm: f64,
    /// Energy of one pulse, J.
    pub(crate) pulse_j: f64,
    /// Share of it that goes into the brightest direction, 1/sr.
    pub(crate) per_sr: f64,
    /// Angle of the apparent source at 100 mm, mrad.
    pub(crate) source_mrad: f64,
    pub(crate) train: Train,
    /// C4 up to 1050 nm, C7 from there on: what the eye absorbs less.
    absorbs_less: f64,
    /// Time after which an eye's movements spread the light, s (T2).
    t2_s: f64,
}

/// The rule that limits a laser first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum EyeRule {
    /// The pulses within T_i (5 us at 905 nm) together.
    SinglePulse,
    /// The same, as one of a train.
    PulseTrain,
    /// An exposure, as one of a train.
    Exposure,
    /// All pulses within a time.
    Average,
}

impl EyeRule {
    /// In tables.
    pub const fn name(self) -> &'static str {
        match self {
            EyeRule::SinglePulse => "one pulse, 4.3 f 1",
            EyeRule::PulseTrain => "train of pulses, 4.3 f 3",
            EyeRule::Exposure => "train of exposures, 4.3 f 3",
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
    /// Time whose pulses it adds up, s.
    pub within_s: f64,
    /// Energy of a pulse into an eye, J.
    pub pulse_into_eye_j: f64,
    /// Mean power into an eye, W.
    pub power_into_eye_w: f64,
}

impl Train {
    /// Most pulses within `time_s`; one that comes at its end counts, whatever rounding makes of that.
    fn most_pulses(&self, time_s: f64) -> f64 {
        let frames = (time_s / self.frame_s + 1e-9).floor();
        let rest_s = time_s - frames * self.frame_s;
        let of_rest = (rest_s * self.rate_hz + 1e-6).floor() + 1.0;
        frames * self.pulses + of_rest.min(self.pulses)
    }

    /// Times about `time_s` at which [`Train::most_pulses`] grows, s: the last one up to it, the next one, and the ends of this exposure and of the next.
    fn times_around(&self, time_s: f64) -> [f64; 4] {
        let begin_s = (time_s / self.frame_s).floor() * self.frame_s;
        let last = (self.pulses - 1.0).min(((time_s - begin_s) * self.rate_hz).floor());
        let pulse_s = |number: f64| begin_s + number / self.rate_hz;
        let end_s = pulse_s(self.pulses - 1.0);
        let next_s = if last + 1.0 < self.pulses {
            pulse_s(last + 1.0)
        } else {
            begin_s + self.frame_s
        };
        [pulse_s(last), next_s, end_s, end_s + self.frame_s]
    }
}

impl Band {
    fn from_wavelength(wavelength_nm: f64) -> Option<Self> {
        match wavelength_nm {
            700.0..1050.0 => Some(Band::NearInfrared),
            1050.0..=1200.0 => Some(Band::Retina1050),
            1500.0..=1800.0 => Some(Band::Cornea1500),
            _ => None,
        }
    }

    /// Pulses within this time count as one, s (T_i, table 2); at 1500 nm and more those of 10 s do, as [`EyeRule::Average`] has it.
    fn one_pulse_s(self) -> f64 {
        match self {
            Band::NearInfrared => 5e-6,
            Band::Retina1050 => 13e-6,
            Band::Cornea1500 => 1e-9,
        }
    }

    /// Diameter of the aperture (table 10), m.
    fn aperture_m(self, time_s: f64) -> f64 {
        match self {
            Band::Cornea1500 => 1e-3 * (1.5 * libm::pow(time_s, 0.375)).clamp(1.0, 3.5),
            _ => 7e-3,
        }
    }
}

impl Emission {
    /// Wavelengths that are judged, in words.
    pub const JUDGED: &str = "700 to 1200 nm or 1500 to 1800 nm";

    /// Light of `wavelength_nm` from a source of `source_mrad` at 100 mm, `pulse_j` in each pulse of the `train` and `per_sr` of it in the brightest direction.
    pub(super) fn new(
        (wavelength_nm, source_mrad): (f64, f64),
        (pulse_j, per_sr): (f64, f64),
        train: Train,
    ) -> Self {
        let decades = if wavelength_nm < 1050.0 {
            0.002 * (wavelength_nm - 700.0)
        } else {
            0.018 * (wavelength_nm - 1150.0).max(0.0)
        };
        let angle_mrad = source_mrad.clamp(POINT_MRAD, WIDEST_MRAD);
        Emission {
            wavelength_nm,
            pulse_j,
            per_sr,
            source_mrad,
            train,
            absorbs_less: libm::pow(10.0, decades),
            t2_s: 10.0 * libm::pow(10.0, (angle_mrad - POINT_MRAD) / 98.5),
        }
    }

    /// The same laser with `times` the energy in a pulse, and with other times.
    #[must_use]
    pub fn scaled(self, times: f64, train: Train) -> Self {
        Emission {
            pulse_j: times * self.pulse_j,
            train,
            ..self
        }
    }

    /// The limit that is nearest; `None` at wavelengths that are not judged.
    pub fn beside_class_1(&self) -> Option<EyeSafety> {
        let band = Band::from_wavelength(self.wavelength_nm)?;
        let train = &self.train;
        let judged = |rule, within_s: f64, share: f64| {
            let pulses = train.most_pulses(within_s);
            let into_eye_j = pulses * self.accessible_j(band, within_s);
            (
                rule,
                within_s,
                into_eye_j / (share * self.limit_j(band, within_s)),
            )
        };
        let one_s = band.one_pulse_s();
        let exposure_s = (train.pulses - 1.0) / train.rate_hz;
        let mut all = vec![judged(EyeRule::SinglePulse, one_s, 1.0)];
        if band != Band::Cornea1500 {
            let look_s = self.t2_s.min(TIME_BASE_S);
            let in_train = train.most_pulses(look_s) / train.most_pulses(one_s);
            all.push(judged(EyeRule::PulseTrain, one_s, c5(in_train)));
            // C5 is for pulses of a quarter of a second at most.
            if exposure_s > one_s && exposure_s <= 0.25 {
                let share =
                    self.c5_of_exposures(exposure_s, train.most_pulses(look_s) / train.pulses);
                all.push(judged(EyeRule::Exposure, exposure_s, share));
            }
        }
        // Between these times pulses and limits grow by one law, which has its largest ratio at an end.
        let turns_s = [one_s, exposure_s, self.t2_s, TIME_BASE_S];
        let has_turns = band == Band::Cornea1500 || self.source_mrad > widest_mrad(0.0);
        let more_s = TURNS_S.iter().filter(|_| has_turns);
        let times_s = (turns_s.iter().chain(more_s)).flat_map(|&turn_s| train.times_around(turn_s));
        let times_s = times_s.chain([TIME_BASE_S]);
        let times_s = times_s.filter(|time_s| (one_s..=TIME_BASE_S).contains(time_s));
        all.extend(times_s.map(|time_s| judged(EyeRule::Average, time_s, 1.0)));
        let (rule, within_s, times_class_1) =
            (all.iter().copied()).fold(
                all[0],
                |most, next| if next.2 > most.2 { next } else { most },
            );
        let pulse_into_eye_j = self.aperture_j(band, within_s);
        Some(EyeSafety {
            times_class_1,
            rule,
            within_s,
            pulse_into_eye_j,
            power_into_eye_w: pulse_into_eye_j * (train.pulses / train.frame_s),
        })
    }

    /// Energy of a pulse through the aperture, J.
    fn aperture_j(&self, band: Band, time_s: f64) -> f64 {
        let angle = 0.5 * band.aperture_m(time_s) / 0.1;
        self.pulse_j * (self.per_sr * PI * angle * angle).min(1.0)
    }

    /// What of that comes from within α_max, J.
    fn accessible_j(&self, band: Band, time_s: f64) -> f64 {
        let share = match band {
            Band::Cornea1500 => 1.0,
            _ => (widest_mrad(time_s) / self.source_mrad).powi(2).min(1.0),
        };
        share * self.aperture_j(band, time_s)
    }

    /// Limit of the energy within `time_s`, T_i to 100 s, J (AEL, table 3).
    fn limit_j(&self, band: Band, time_s: f64) -> f64 {
        let c6 = self.source_mrad.clamp(POINT_MRAD, widest_mrad(time_s)) / POINT_MRAD;
        let is_wide = c6 > 1.0;
        let c6 = c6 * self.absorbs_less;
        let (pulse_j, longer_j) = match band {
            Band::NearInfrared => (7.7e-8, 7e-4),
            Band::Retina1050 => (7.7e-7, 3.5e-3),
            Band::Cornea1500 => {
                return match time_s {
                    ..0.35 => 8e-3,
                    ..10.0 => 1.8e-2 * time_s * fourth_root_less(time_s),
                    _ => 1e-2 * time_s,
                };
            }
        };
        if time_s <= band.one_pulse_s() {
            pulse_j * c6
        } else if time_s <= self.t2_s {
            longer_j * c6 * time_s * fourth_root_less(time_s)
        } else if is_wide {
            longer_j * c6 * fourth_root_less(self.t2_s) * time_s
        } else {
            // 3.9e-4 W where 7e-4 · 10^−0.25 is 3.94e-4.
            longer_j * c6 * 3.9 / 7.0 * time_s
        }
    }

    /// What one of some exposures of this length may have of what it may have alone.
    fn c5_of_exposures(&self, exposure_s: f64, exposures: f64) -> f64 {
        let least = match self.source_mrad {
            ..=5.0 => 1.0,
            angle if angle > WIDEST_MRAD => 1.0,
            angle if angle > widest_mrad(exposure_s) => 0.2,
            _ => 0.4,
        };
        fourth_root_less(exposures.max(1.0)).max(least)
    }
}

/// Widest angle that counts for emission of this length, mrad (α_max).
fn widest_mrad(time_s: f64) -> f64 {
    (200.0 * time_s.sqrt()).clamp(5.0, WIDEST_MRAD)
}

/// `x` to the power of −1/4.
fn fourth_root_less(x: f64) -> f64 {
    1.0 / x.sqrt().sqrt()
}

/// What a pulse of a train of `pulses` may have of what it may have alone.
fn c5(pulses: f64) -> f64 {
    if pulses > 600.0 {
        (5.0 * fourth_root_less(pulses)).clamp(0.4, 1.0)
    } else {
        1.0
    }
}

impl Scene {
    /// The laser's light in the brightest direction of its beam.
    pub fn emission(&self, rows: u32, cols: u32, train: Train) -> Emission {
        let lidar = &self.lidar;
        let source = (lidar.warm_wavelength_nm(), lidar.laser_source_mm / 0.1);
        let per_sr = self.brightest_per_sr(&self.lidar_camera(rows, cols));
        Emission::new(source, (lidar.warm_pulse_j(), per_sr), train)
    }

    /// The largest share of a pulse that goes into a solid angle, 1/sr.
    fn brightest_per_sr(&self, camera: &PinholeCamera) -> f64 {
        let beam = &self.lidar.beam;
        if let Some(curve) = beam.curve() {
            return curve.greatest() / self.lidar.beam_total();
        }
        if *beam == CurveSetting::Word(BeamWord::Gaussian) {
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
mod tests;
