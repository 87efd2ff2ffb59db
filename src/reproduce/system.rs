//! Claims 22 to 24 and 27: what formulas and budgets say of the demonstrator of chapter 6, beside what the chain gives
//! ([`mod@demonstrator`]).

use super::claim::Row;
use super::demonstrator::{self, swept};
use super::design::HSLIDAR_BIN_M;
use super::penalty::{demonstrator, demonstrator_light};
use super::published::Published::*;
use crate::chip::hslidar_delay_line;
use crate::photon::Atmosphere;
use crate::report::{Axis, Chart, Style};
use crate::theory::detection::{self, Model, PerCycle, Ties};
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
    let mut system = demonstrator();
    system.link.background_hz = demonstrator_light(klux);
    system.models.precision = cramer_rao;
    let one_frame = LASER_HZ * EXPOSURE_S;
    // The cycles that a millimetre takes tell what these many give.
    system.goal.precision_m = 1e-3;
    (system.measure(range_m).laser_cycles / one_frame).sqrt() * 1e-3
}

/// Claim 22: errors to 50 m.
pub(super) fn error_rows() -> Vec<Row> {
    let mut rows = demonstrator::error_rows();
    rows.extend(demonstrator::sigma_rows(bound_m(50.0, 72.0)));
    rows.extend([
        Row::ours(
            "bound of σ at 50 m, share of the distance",
            "%",
            100.0 * bound_m(50.0, 72.0) / 50.0,
        )
        .remark("Cramér-Rao with 89 z⁻² counts, 5.76 Mcounts/s and 16 000 cycles."),
        Row::ours("bound of σ at 75 m and 15 klux", "m", bound_m(75.0, 15.0)),
    ]);
    rows
}

/// Fig. 104: σ against distance, and its bound.
pub(super) fn figure_104() -> Vec<Chart> {
    let measured = swept().iter().map(|p| (p.distance_m, p.sigma_m));
    let line = |klux| (5..=80).map(move |z| (f64::from(z), bound_m(f64::from(z), klux)));
    vec![
        Chart::new(
            "σ of the demonstrator's range after 16 000 laser cycles: measured on the model, and its Cramér-Rao bound",
            Axis::linear("distance (m)"),
            Axis::log("σ (m)"),
        )
        .with("measured, 72 klux (Fig. 104)", Style::Points, measured)
        .with("bound, 72 klux", Style::Line, line(72.0))
        .with("bound, 15 klux (Fig. 99)", Style::Line, line(15.0))
        .with(
            "published, about 0.1 % at 50 m",
            Style::Points,
            [(50.0, 0.05)],
        ),
    ]
}

/// Claim 23: a van is followed, in windows that overlap enough.
pub(super) fn tracking_rows() -> Vec<Row> {
    let window_m = 8.0 * HSLIDAR_BIN_M;
    let step_m = metres(STEP_S);
    let overlap_m = window_m - step_m;
    let reach_m = 7f64.exp2() * step_m;
    let budget = detection_at(75.0, 15.0, 1.0);
    let mut rows = demonstrator::tracking_rows();
    rows.extend([
        Row::holds("window step", "m", Exactly("1.875"), STEP_S * 3e8 / 2.0)
            .given("12.5 ns with c = 3·10⁸, as printed.")
            .aside(),
        Row::holds("window step", "ns", Exactly("1.25"), 1e9 * STEP_S)
            .differs("Table 14's 1.25 ns is a slip: 1.875 m are 12.5 ns.")
            .aside(),
        Row::holds(
            "step over window",
            "",
            Says("around half", 0.35, 0.65),
            step_m / window_m,
        )
        .given("12.5 ns over 8 bins of 2.6 ns, all published.")
        .aside(),
        Row::holds(
            "overlap of windows over the pulse's FWHM",
            "",
            Says("seamless", 1.0, f64::INFINITY),
            overlap_m / metres(PULSE_FWHM_S),
        )
        .given("Published times alone.")
        .aside()
        .remark("An echo that one window cuts lies whole in the next."),
        Row::ours("reach of 7 bits", "m", reach_m),
        Row::ours("P_D in a guided window at 75 m and 15 klux", "", budget).remark(
            "8 bins, the whole echo in one, 16 000 cycles, no more than one hit per bin and cycle.",
        ),
    ]);
    rows
}

/// P_D among the demonstrator's 8 bins, the signal times `factor`.
fn detection_at(range_m: f64, klux: f64, factor: f64) -> f64 {
    let system = demonstrator();
    let light = PerCycle {
        signal: factor * system.link.signal / (range_m * range_m),
        background: demonstrator_light(klux) * system.bin_s,
        bins: system.bins,
    };
    let cycles = (LASER_HZ * EXPOSURE_S) as u64;
    detection::probability(&light, cycles, Model::Bernoulli(Ties::Random)).probability
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
pub(super) fn fog_rows() -> Vec<Row> {
    let mut rows = demonstrator::fog_rows();
    rows.push(
        Row::ours("least visibility for P_D 99.7 % at 60 m, 10 % target, 5 klux", "m", least_visibility_m(60.0, 5.0))
            .remark("Extinction alone: a fog of this visibility still lets the published range be reached. 5 klux of an overcast sky is assumed."),
    );
    rows
}

/// Claim 27: the time of a frame.
pub(super) fn frame_rows() -> Vec<Row> {
    let hslidar = hslidar_delay_line();
    let load_ms = hslidar.load_time().as_s() * 1e3;
    let stereo_fps = 16.0;
    vec![
        Row::holds(
            "frame rate without exposure",
            "fps",
            Exactly("7"),
            1.0 / BEFORE_EXPOSURE_S,
        )
        .given("1 / 145 ms; the time itself is a laptop's and is not modelled.")
        .remark("7.3.3 has 6 fps for the same."),
        Row::holds(
            "frame rate",
            "fps",
            Exactly("3"),
            1.0 / (BEFORE_EXPOSURE_S + EXPOSURE_S),
        )
        .given("1 / 345 ms."),
        Row::holds(
            "laser cycles of an exposure",
            "",
            Exactly("16000"),
            LASER_HZ * EXPOSURE_S,
        )
        .given("80 kHz × 200 ms, which are printed; their product is not."),
        Row::ours(
            "exposure by the chip's clocks",
            "ms",
            demonstrator::exposure_s() * 1e3,
        )
        .remark("16 000 laser cycles of 1000 CLK periods at 80 MHz."),
        Row::ours(
            "readout of 64×32 histograms of 8 × 12 bits",
            "ms",
            hslidar.readout_time().as_s() * 1e3,
        ),
        Row::ours(
            "share of the 145 ms in which a new guide is made at 16 fps",
            "%",
            100.0 / stereo_fps / BEFORE_EXPOSURE_S,
        ),
        Row::ours(
            "serial load of 64×32 start values of 7 bits at 200 MHz",
            "ms",
            load_ms,
        )
        .remark("The chip's own part of the 145 ms; the rest is a laptop's, and is not modelled."),
    ]
}

/// Fig. 106: the frame's time.
pub(super) fn figure_106() -> Vec<Chart> {
    let bars = [
        BEFORE_EXPOSURE_S,
        EXPOSURE_S,
        BEFORE_EXPOSURE_S + EXPOSURE_S,
    ];
    vec![
        Chart::new(
            "Time of a frame: 1 everything before the exposure, 2 exposure, 3 together",
            Axis::linear("part").between(0.0, 4.0),
            Axis::linear("time (ms)").between(0.0, 400.0),
        )
        .with(
            "published times",
            Style::Bars,
            bars.into_iter()
                .enumerate()
                .map(|(i, s)| (i as f64 + 1.0, 1e3 * s)),
        ),
    ]
}
