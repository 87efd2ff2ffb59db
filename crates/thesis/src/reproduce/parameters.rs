//! The systems that the thesis reckons with, in its numbers: Table 6's and the demonstrator's (Table 15).

use crate::scene::{Lidar, Scene};
use crate::theory::detection::{DetectionModel, Ties};
use crate::theory::partial::{Link, Models, RangingGoal, System};
use crate::theory::precision;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// The speed of light as the thesis rounds it, m/s.
pub(super) const ROUNDED_LIGHT_M_PER_S: f64 = 3e8;

/// Background rate (counts/s) and laser cycles that size the histogram of Table 6's system (3.3.2, 3.3.3).
pub(super) const TABLE_6_BACKGROUND_HZ: f64 = 20e6;
/// See [`TABLE_6_BACKGROUND_HZ`].
pub(super) const TABLE_6_CYCLES: f64 = 25_000.0;
/// Bin interval of Table 6's system: what the thesis calls 5 ns and 0.8 m.
pub(super) const TABLE_6_BIN_S: f64 = 5e-9;
/// See [`TABLE_6_BIN_S`].
pub(super) const TABLE_6_BIN_M: f64 = 0.8;
/// The demonstrator's bin interval, 2.6 ns, in metres.
pub(super) const HSLIDAR_BIN_M: f64 = 2.6e-9 * SPEED_OF_LIGHT_M_PER_S / 2.0;

/// σ of a Gaussian pulse over its full width at half maximum, 1/√(8 ln 2).
pub(super) fn sigma_over_fwhm() -> f64 {
    1.0 / (8.0 * std::f64::consts::LN_2).sqrt()
}

/// Eq. 17 as one peak finder sees it: every photon counted, ties by lot.
const EVERY_PHOTON: DetectionModel = DetectionModel::Poisson(Ties::Random);

/// Table 6's system with 16 bins (Table 7).
pub(super) fn long_range() -> System {
    System {
        link: Link {
            signal: 1140.0,
            background_hz: TABLE_6_BACKGROUND_HZ,
            pulse_sigma_s: 8e-9 * sigma_over_fwhm(),
        },
        goal: RangingGoal {
            precision_m: 0.1,
            detection: 0.997,
        },
        models: Models {
            precision: precision::cramer_rao,
            detection: EVERY_PHOTON,
        },
        bins: 16,
        bin_s: TABLE_6_BIN_S,
        // 16 windows of 12.5 m make 200 m, where 16 bins of 0.8 m are 12.8 m.
        window_m: 12.5,
    }
}

/// Background rate of the demonstrator at an illuminance, counts/s: 4.8 Mcounts/s at 60 klux (Fig. 94).
pub(super) fn demonstrator_light(klux: f64) -> f64 {
    4.8e6 * klux / 60.0
}

/// Illuminance at which Table 15 has its background of 8 Mcounts/s, klux.
pub(super) const TABLE_15_KLUX: f64 = 100.0;

/// The demonstrator (Table 15).
pub(super) fn demonstrator() -> System {
    let link = Link {
        signal: 89.0,
        background_hz: 8e6,
        pulse_sigma_s: 4.5e-9 * sigma_over_fwhm(),
    };
    let goal = RangingGoal {
        precision_m: 0.1,
        detection: 0.997,
    };
    let models = Models {
        precision: precision::thompson,
        detection: EVERY_PHOTON,
    };
    System::new(link, goal, models, 8, 2.6e-9)
}

/// The demonstrator in the photons that come at its chip under an illuminance, those that SPADs would detect if they were always ready:
/// more than Table 15's, which its chip counts.
pub(super) fn demonstrator_photons(klux: f64) -> System {
    const REFLECTIVITY: f64 = 0.1;
    let scene = Scene {
        lidar: Lidar::demonstrator(),
        ..Scene::default()
    };
    let budget = scene.photon_budget(32, 64);
    let mut system = demonstrator();
    system.link.signal = budget.signal_per_pulse_far_field(1.0, REFLECTIVITY);
    system.link.background_hz = budget.background_hz(REFLECTIVITY, klux);
    system
}
