//! Claims 11, 14 and 15: laser cycles, and what zooming and sliding add to them.

use super::claim::ClaimRow;
use super::measured::partial::{
    AtRange, demonstrator_on_chip, demonstrator_on_delay_lines, long_range_on_chip, with_interval,
};
use super::parameters::{
    ROUNDED_LIGHT_M_PER_S, TABLE_6_BIN_M, TABLE_15_KLUX, demonstrator, demonstrator_photons,
    long_range, sigma_over_fwhm,
};
use super::thesis::{ClaimText, claim};
use crate::theory::detection::{DetectionModel, Ties};
use crate::theory::partial::{Cost, Models, System};
use crate::theory::precision;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

pub(super) mod charts;

/// As this chip counts: one hit per bin and cycle.
const ONE_HIT: DetectionModel = DetectionModel::Bernoulli(Ties::Random);

/// The same system, counting as this chip does in its detection steps.
fn one_hit(system: System) -> System {
    System {
        models: Models {
            detection: ONE_HIT,
            ..system.models
        },
        ..system
    }
}

fn penalty(partial: &Cost, full: &Cost) -> f64 {
    partial.laser_cycles() / full.laser_cycles()
}

/// The pulse σ at which Table 6's system needs `cycles` at 200 m, s.
fn sigma_for(cycles: f64) -> f64 {
    let needs = |sigma_s: f64| {
        let mut system = long_range();
        system.link.pulse_sigma_s = sigma_s;
        system.measure(200.0).laser_cycles
    };
    let (mut low, mut high) = (1e-9, 1e-8);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if needs(middle) < cycles {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Claim 11: laser cycles at 200 m.
pub(super) fn cycles_rows() -> Vec<ClaimRow> {
    let claim = claim(11);
    let system = long_range();
    let needed = system.measure(200.0).laser_cycles;
    let thompson = System {
        models: Models {
            precision: precision::thompson,
            ..system.models
        },
        ..system
    };
    let wide = System {
        bin_s: 2.0 * TABLE_6_BIN_M / SPEED_OF_LIGHT_M_PER_S,
        ..system
    };
    let in_frame = |light_m_per_s: f64| light_m_per_s / (2.0 * 200.0 * 30.0);
    let sigma_ns = 1e9 * sigma_for(25_000.0);
    vec![
        claim.row("in_frame", in_frame(SPEED_OF_LIGHT_M_PER_S)).remark(format!("{:.0} with c = 3·10⁸.", in_frame(ROUNDED_LIGHT_M_PER_S))),
        claim.row("needed", needed).differs(format!(
                "σ = FWHM/2.355 = 3.397 ns gives fewer; the published 25 000 takes σ = {sigma_ns:.3} ns, a pulse {:.1} % wider. That they “converge to around” it is said of both this and the line above.",
                100.0 * (sigma_ns / (8.0 * sigma_over_fwhm()) - 1.0)
            )),
        claim.row("needed_wide_bins", wide.measure(200.0).laser_cycles),
        claim.row("needed_thompson", thompson.measure(200.0).laser_cycles),
        claim.row("sigma", sigma_ns),
    ]
}

/// Claim 14: penalties of Table 7's configurations at 200 m.
pub(super) fn long_range_rows() -> Vec<ClaimRow> {
    let claim = claim(14);
    let system = long_range();
    let full = system.full(200.0);
    let (zooming, sliding) = (system.zooming(200.0), system.sliding(200.0, 0));
    let chip = one_hit(system).zooming(200.0);
    let on_chip = long_range_on_chip().result(200.0);
    let measured = on_chip.penalty_of_sliding();
    let mut rows = vec![
        claim
            .measured("sliding_measured", &measured)
            .remark(format!(
                "{}: 16 guided windows of the chip, {} laser cycles over {}.",
                with_interval(&measured, 2),
                with_interval(&on_chip.sliding, 0),
                with_interval(&on_chip.guided, 0)
            )),
        zooming_row(claim, on_chip),
    ];
    rows.extend(detection_rows(claim, on_chip));
    rows.extend([
        claim.row("sliding", penalty(&sliding, &full)),
        claim.row("zooming", penalty(&zooming, &full)),
        claim.row("zooming_over_sliding", penalty(&zooming, &sliding)),
        claim.row("windows", sliding.steps.len() as f64),
        claim.row("steps", zooming.steps.len() as f64),
        claim.row("zooming_one_hit", penalty(&chip, &full)),
        claim.row("zooming_exposures_14", zooming.exposures(14)),
        claim.row("zooming_exposures_12", zooming.exposures(12)),
        claim.row("sliding_exposures_12", sliding.exposures(12)),
        claim.row("full_exposures_12", full.exposures(12)),
        claim.row("guided", penalty(&full, &full)),
    ]);
    rows
}

/// The measured penalty of zooming.
fn zooming_row(claim: &'static ClaimText, at: &AtRange) -> ClaimRow {
    let name = format!("zooming_measured_{}", at.range_m);
    let penalty = at.penalty_of_zooming();
    let text = penalty.map_or("never".to_owned(), |p| with_interval(&p, 2));
    let row = match penalty {
        Some(penalty) => claim.measured(&name, &penalty),
        None => claim.row(&name, f64::INFINITY),
    };
    row.remark(format!(
        "{text}: the conventional mode's coarse bins, then a guided window."
    ))
}

/// What the chip finds in as many laser cycles as zooming's coarsest detection is reckoned to take, and what its counters do.
fn detection_rows(claim: &'static ClaimText, at: &AtRange) -> Vec<ClaimRow> {
    let Some(coarsest) = at.detections.first() else {
        return Vec::new();
    };
    let range_m = at.range_m;
    let [in_12, in_14] = coarsest.exposures.map(f64::from);
    vec![
        claim.row(&format!("coarsest_{range_m}"), coarsest.found.value)
        .remark(format!(
            "{} of 0.997 wanted, in {} frames of {:.0} laser cycles, added from exposures that the counters hold.",
            with_interval(&coarsest.found, 2),
            coarsest.frames,
            coarsest.reckoned
        )),
        claim.row(&format!("coarsest_exposures_12_{range_m}"), in_12)
        .remark(format!(
            "In a single one {:.0} % have a full bin of 12 bits, {:.0} % one of 14.",
            100.0 * coarsest.full[0],
            100.0 * coarsest.full[1]
        )),
        claim.row(&format!("coarsest_exposures_14_{range_m}"), in_14),
    ]
}

/// Sliding in the bins that the demonstrator had, and why zooming is not beside it.
fn delay_line_rows() -> Vec<ClaimRow> {
    let claim = claim(15);
    let lines = demonstrator_on_delay_lines();
    let (sliding, penalty) = (lines.sliding(), lines.penalty_of_sliding());
    let guided = &lines.guided;
    let photons = demonstrator_photons(TABLE_15_KLUX);
    vec![
        claim.measured("lines_sliding", &penalty).remark(format!(
            "{}: {} windows, of which each repeats 8.3 ns of the one before, where the thesis has none overlap; {} laser cycles over {}; {:.2} by the thesis's formula for these windows. Zooming needs bins of 20.8 and 166 ns, and elements of a delay line are 2.6 ns whatever CLK is: it is measured in CLK bins alone.",
            with_interval(&penalty, 2),
            lines.windows.len(),
            with_interval(&sliding, 0),
            with_interval(&guided.cycles, 0),
            lines.reckoned / photons.full(lines.range_m).laser_cycles(),
        )),
        claim.row("lines_guided", guided.cycles.value).remark(format!(
            "{}; {} of {} frames of the reckoned number measure the echo within 0.5 m. Bins are calibrated.",
            with_interval(&guided.cycles, 0),
            with_interval(&guided.found, 3),
            guided.frames
        )),
        claim.row("lines_full", 100.0 * lines.full.value).remark(format!(
            "{} %: none is read out twice.",
            with_interval(&lines.full.map(|share| 100.0 * share), 2)
        )),
    ]
}

/// The least range at which zooming takes `steps` steps, m.
fn zooming_takes(system: &System, steps: usize) -> f64 {
    let (mut low, mut high) = (1.0, 150.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if system.zooming(middle).steps.len() < steps {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Claim 15: penalties of the demonstrator at 75 m.
pub(super) fn demonstrator_rows() -> Vec<ClaimRow> {
    let claim = claim(15);
    let system = demonstrator();
    let full = system.full(75.0);
    let (zooming, sliding) = (system.zooming(75.0), system.sliding(75.0, 0));
    let least = penalty(&zooming, &full).min(penalty(&sliding, &full));
    let nearer = system.full(74.0);
    let chip = one_hit(system).zooming(75.0);
    let last_end_m = sliding.steps.last().map_or(f64::NAN, |step| step.range_m);
    let coarse_m = f64::from(system.bins) * system.window_m;
    let coarse_ns = 2e9 * coarse_m / SPEED_OF_LIGHT_M_PER_S;
    let (at_75, at_74) = (
        demonstrator_on_chip().result(75.0),
        demonstrator_on_chip().result(74.0),
    );
    let sliding_75 = at_75.penalty_of_sliding();
    let sliding_74 = at_74.penalty_of_sliding();
    let zooming_75 = at_75.penalty_of_zooming();
    let better = zooming_75.filter(|zooming| zooming.value < sliding_75.value);
    let mut rows = vec![
        claim
            .measured("better_measured", &better.unwrap_or(sliding_75))
            .remark(format!(
                "Sliding: {}, {} laser cycles over {}; at 74 m {}.",
                with_interval(&sliding_75, 2),
                with_interval(&at_75.sliding, 0),
                with_interval(&at_75.guided, 0),
                with_interval(&sliding_74, 2)
            )),
    ];
    rows.extend(delay_line_rows());
    rows.extend([
        zooming_row(claim, at_75),
        zooming_row(claim, at_74),
        claim.row("guided_measured", at_75.guided.value).remark(format!(
                "{} for the spread of those frames that measure the echo within 0.5 m: {} of {} frames of the reckoned number do. The others take a peak of the background for it, which no formula of a spread knows.",
                with_interval(&at_75.guided, 0),
                with_interval(&at_75.measurement.found, 3),
                at_75.measurement.frames
            )),
    ]);
    rows.extend(detection_rows(claim, at_75));
    rows.extend(detection_rows(claim, at_74));
    rows.extend([
        claim.row("better", least),
        claim.row("sliding", penalty(&sliding, &full)).remark(format!(
            "{} windows of {:.2} m, the last to {last_end_m:.1} m.",
            sliding.steps.len(),
            system.window_m,
        )),
        claim.row("sliding_74", penalty(&system.sliding(74.0, 0), &nearer)),
        claim.row("zooming", penalty(&zooming, &full)).remark(format!(
            "Just beyond a step: detection among 4 bins of {coarse_m:.2} m, of which three end at {:.2} m.",
            3.0 * coarse_m
        )),
        claim.row("zooming_74", penalty(&system.zooming(74.0), &nearer)),
        claim.row("second_step_from", zooming_takes(&system, 2)),
        claim.row("third_step_from", zooming_takes(&system, 3)),
        claim.row("third_step_bin", coarse_ns),
        claim.row("full", full.laser_cycles()),
        claim.row("zooming_one_hit", penalty(&chip, &full)),
        claim.row("zooming_exposures_12", zooming.exposures(12)),
    ]);
    rows
}
