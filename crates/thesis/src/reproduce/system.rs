//! Claims 22 to 24 and 27: what formulas and budgets say of the demonstrator of chapter 6, beside what the chain gives
//! ([`mod@demonstrator`]).

use super::claim::ClaimRow;
use super::demonstrator::{self, swept};
use super::parameters::{HSLIDAR_BIN_M, demonstrator_photons};
use super::thesis::{chart, claim};
use crate::chip::hslidar_delay_line;
use crate::photon::Atmosphere;
use crate::report::Chart;
use crate::theory::detection::{self, DetectionModel, PerCycle, Ties};
use crate::theory::precision::cramer_rao;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Laser cycles of the demonstrator's exposure: 80 kHz for 200 ms.
const LASER_HZ: f64 = 80e3;
const EXPOSURE_S: f64 = 0.2;
const BEFORE_EXPOSURE_S: f64 = 0.145;
/// Window step of the demonstrator, s (Table 14 prints 1.25 ns, which is not the 1.875 m beside it).
const STEP_S: f64 = 12.5e-9;
/// FWHM of its laser, s.
const PULSE_FWHM_S: f64 = 4.5e-9;

fn metres(time_s: f64) -> f64 {
    time_s * SPEED_OF_LIGHT_M_PER_S / 2.0
}

/// Cramér-Rao bound of the range at `range_m` under `klux` after the demonstrator's exposure, m.
fn bound_m(range_m: f64, klux: f64) -> f64 {
    let mut system = demonstrator_photons(klux);
    system.models.precision = cramer_rao;
    let one_frame = LASER_HZ * EXPOSURE_S;
    // The cycles that a millimetre takes tell what these many give.
    system.goal.precision_m = 1e-3;
    (system.measure(range_m).laser_cycles / one_frame).sqrt() * 1e-3
}

/// Claim 22: errors to 50 m.
pub(super) fn error_rows() -> Vec<ClaimRow> {
    let claim = claim(22);
    let mut rows = demonstrator::error_rows();
    rows.extend(demonstrator::sigma_rows(bound_m(50.0, 72.0)));
    rows.extend([
        claim.row("bound_50_m", 100.0 * bound_m(50.0, 72.0) / 50.0),
        claim.row("bound_75_m", bound_m(75.0, 15.0)),
    ]);
    rows
}

/// Fig. 104: σ against distance, and its bound.
pub(super) fn figure_104() -> Chart {
    let measured = swept().iter().map(|p| (p.distance_m, p.sigma_m));
    let line = |klux| (5..=80).map(move |z| (f64::from(z), bound_m(f64::from(z), klux)));
    chart(104)
        .points("measured, 72 klux (Fig. 104)", measured)
        .line("bound, 72 klux", line(72.0))
        .line("bound, 15 klux (Fig. 99)", line(15.0))
        .points("published, about 0.1 % at 50 m", [(50.0, 0.05)])
}

/// Claim 23: a van is followed, in windows that overlap enough.
pub(super) fn tracking_rows() -> Vec<ClaimRow> {
    let claim = claim(23);
    let window_m = 8.0 * HSLIDAR_BIN_M;
    let step_m = metres(STEP_S);
    let overlap_m = window_m - step_m;
    let reach_m = libm::exp2(7f64) * step_m;
    let budget = detection_at(75.0, 15.0, 1.0);
    let mut rows = demonstrator::tracking_rows();
    rows.extend([
        claim.row("step_m", STEP_S * 3e8 / 2.0),
        claim.row("step_ns", 1e9 * STEP_S),
        claim.row("step_over_window", step_m / window_m),
        claim.row("overlap_over_pulse", overlap_m / metres(PULSE_FWHM_S)),
        claim.row("reach", reach_m),
        claim.row("detection", budget),
    ]);
    rows
}

/// P_D among the demonstrator's 8 bins, the signal times `factor`.
fn detection_at(range_m: f64, klux: f64, factor: f64) -> f64 {
    let system = demonstrator_photons(klux);
    let light = PerCycle {
        signal: factor * system.link.signal / (range_m * range_m),
        background: system.link.background_hz * system.bin_s,
        bins: system.bins,
    };
    let cycles = (LASER_HZ * EXPOSURE_S) as u64;
    detection::probability(&light, cycles, DetectionModel::Bernoulli(Ties::Random)).probability
}

/// Least visibility in which a target of 10 % at `range_m` is found with 99.7 %, m.
fn least_visibility_m(range_m: f64, klux: f64) -> f64 {
    let found = |visibility_m: f64| {
        let air = Atmosphere::from_visibility(visibility_m, 940.0);
        detection_at(range_m, klux, air.round_trip(range_m)) >= 0.997
    };
    let (mut low, mut high) = (1.0, 1e5);
    for _ in 0..50 {
        let middle = f64::sqrt(low * high);
        if found(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// Claim 24: fog.
pub(super) fn fog_rows() -> Vec<ClaimRow> {
    let claim = claim(24);
    let mut rows = demonstrator::fog_rows();
    rows.push(claim.row(
        "least_visibility_by_extinction",
        least_visibility_m(60.0, 5.0),
    ));
    rows
}

/// Claim 27: the time of a frame.
pub(super) fn frame_rows() -> Vec<ClaimRow> {
    let claim = claim(27);
    let hslidar = hslidar_delay_line();
    let load_ms = hslidar.load_time().as_s() * 1e3;
    let stereo_fps = 16.0;
    vec![
        claim.row("rate_without_exposure", 1.0 / BEFORE_EXPOSURE_S),
        claim.row("rate", 1.0 / (BEFORE_EXPOSURE_S + EXPOSURE_S)),
        claim.row("laser_cycles", LASER_HZ * EXPOSURE_S),
        claim.row("exposure", demonstrator::exposure_s() * 1e3),
        claim.row("readout", hslidar.readout_time().as_s() * 1e3),
        claim.row("guide_share", 100.0 / stereo_fps / BEFORE_EXPOSURE_S),
        claim.row("load", load_ms),
    ]
}

/// Fig. 106: the frame's time.
pub(super) fn figure_106() -> Chart {
    let bars = [
        BEFORE_EXPOSURE_S,
        EXPOSURE_S,
        BEFORE_EXPOSURE_S + EXPOSURE_S,
    ];
    chart(106).bars(
        "published times",
        bars.into_iter()
            .enumerate()
            .map(|(i, s)| (i as f64 + 1.0, 1e3 * s)),
    )
}
