//! Claims 11, 14 and 15: laser cycles, and what zooming and sliding add to them.

use super::claim::Row;
use super::design::{ROUNDED_LIGHT_M_PER_S, TABLE_6_BACKGROUND_HZ, TABLE_6_BIN_M, TABLE_6_BIN_S};
use super::measured::partial::{
    AtRange, demonstrator_on_chip, demonstrator_on_delay_lines, long_range_on_chip, with_interval,
};
use super::published::Published::*;
use crate::theory::detection::{Model, Ties};
use crate::theory::partial::{Cost, Goal, Link, Models, System};
use crate::theory::precision;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

pub(super) mod charts;

/// σ of a Gaussian pulse over its full width at half maximum, 1/√(8 ln 2).
pub(super) fn sigma_over_fwhm() -> f64 {
    1.0 / (8.0 * std::f64::consts::LN_2).sqrt()
}

/// Eq. 17 as one peak finder sees it: every photon counted, ties by lot.
const EVERY_PHOTON: Model = Model::Poisson(Ties::Random);
/// As this chip counts: one hit per bin and cycle.
const ONE_HIT: Model = Model::Bernoulli(Ties::Random);

/// Table 6's system with 16 bins (Table 7).
pub(super) fn long_range() -> System {
    System {
        link: Link {
            signal: 1140.0,
            background_hz: TABLE_6_BACKGROUND_HZ,
            pulse_sigma_s: 8e-9 * sigma_over_fwhm(),
        },
        goal: Goal {
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

/// The demonstrator (Table 15).
pub(super) fn demonstrator() -> System {
    let link = Link {
        signal: 89.0,
        background_hz: 8e6,
        pulse_sigma_s: 4.5e-9 * sigma_over_fwhm(),
    };
    let goal = Goal {
        precision_m: 0.1,
        detection: 0.997,
    };
    let models = Models {
        precision: precision::thompson,
        detection: EVERY_PHOTON,
    };
    System::new(link, goal, models, 8, 2.6e-9)
}

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
pub(super) fn cycles_rows() -> Vec<Row> {
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
        Row::holds("laser cycles that fit a frame at 200 m and 30 fps", "", Within("25000", 500.0), in_frame(SPEED_OF_LIGHT_M_PER_S))
            .remark(format!("{:.0} with c = 3·10⁸.", in_frame(ROUNDED_LIGHT_M_PER_S))),
        Row::holds("laser cycles for 0.1 m at 200 m, 5 ns bins", "", Within("25000", 500.0), needed)
            .differs(format!(
                "σ = FWHM/2.355 = 3.397 ns gives fewer; the published 25 000 takes σ = {sigma_ns:.3} ns, a pulse {:.1} % wider. That they “converge to around” it is said of both this and the line above.",
                100.0 * (sigma_ns / (8.0 * sigma_over_fwhm()) - 1.0)
            ))
            .remark("Cramér-Rao bound, averaged over the echo's place in its bin."),
        Row::ours("the same, bins of 0.8 m = 5.34 ns", "", wide.measure(200.0).laser_cycles),
        Row::ours("the same, 5 ns, Thompson", "", thompson.measure(200.0).laser_cycles),
        Row::ours("pulse σ at which 25 000 cycles are needed", "ns", sigma_ns),
    ]
}

/// Claim 14: penalties of Table 7's configurations at 200 m.
pub(super) fn long_range_rows() -> Vec<Row> {
    let system = long_range();
    let full = system.full(200.0);
    let (zooming, sliding) = (system.zooming(200.0), system.sliding(200.0, 0));
    let chip = one_hit(system).zooming(200.0);
    let approaching = Says("approaching 4×", 3.0, 4.0);
    let on_chip = long_range_on_chip().at(200.0);
    let measured = on_chip.penalty_of_sliding();
    let mut rows = vec![
        Row::measured("penalty of sliding, measured", "×", approaching, &measured)
            .remark(format!("{}: 16 guided windows of the chip, {} laser cycles over {}.", with_interval(&measured, 2), with_interval(&on_chip.sliding, 0), with_interval(&on_chip.guided, 0))),
        zooming_row("penalty of zooming, measured", on_chip, approaching)
            .differs("The conventional mode's bins on a CLK of 12 MHz hold 1.7 background photons a laser cycle, of which the chip counts one: they lose the echo that the thesis reckons with."),
    ];
    rows.extend(detection_rows(on_chip));
    rows.extend([
        Row::holds("penalty of sliding", "×", approaching, penalty(&sliding, &full)),
        Row::holds("penalty of zooming", "×", approaching, penalty(&zooming, &full))
            .remark("σ = FWHM/2.355, Cramér-Rao, exact Poisson P_D, ties by lot."),
        Row::holds("zooming over sliding at 200 m", "", Says("zooming is preferred", 0.0, 1.0), penalty(&zooming, &sliding))
            .remark("Said of “longer distances”: holds with Cramér-Rao, not with Thompson."),
        Row::holds("windows of sliding", "", Exactly("16"), sliding.steps.len() as f64)
            .given("Table 7's 12.5 m windows and 200 m are put in.")
            .aside(),
        Row::holds("steps of zooming", "", Exactly("2"), zooming.steps.len() as f64)
            .given("As the windows: 16 bins of 12.5 m reach 200 m.")
            .aside(),
        Row::ours("penalty of zooming, one hit per bin and cycle", "×", penalty(&chip, &full))
            .remark("83 ns bins hold 1.7 background photons a cycle, of which such a chip counts one: its coarse bins lose the echo."),
        Row::ours("exposures of zooming, 14-bit bins", "", zooming.exposures(14))
            .remark("So that no bin overflows with more than 0.3 %: the coarse bins must be read and cleared several times. The thesis does not count this."),
        Row::ours("exposures of zooming, 12-bit bins", "", zooming.exposures(12)),
        Row::ours("exposures of sliding, 12-bit bins", "", sliding.exposures(12)),
        Row::ours("exposures of a full or guided histogram, 12-bit bins", "", full.exposures(12)),
        Row::ours("penalty of a guided histogram", "×", penalty(&full, &full))
            .remark("Its window's 16 bins need the measurement's cycles and no more."),
    ]);
    rows
}

/// The measured penalty of zooming.
fn zooming_row(what: &str, at: &AtRange, published: super::published::Published) -> Row {
    let penalty = at.penalty_of_zooming();
    let text = penalty.map_or("never".to_owned(), |p| with_interval(&p, 2));
    let row = match penalty {
        Some(penalty) => Row::measured(what, "×", published, &penalty),
        None => Row::holds(what, "×", published, f64::INFINITY),
    };
    row.remark(format!(
        "{text}: the conventional mode's coarse bins, then a guided window."
    ))
}

/// What the chip finds in as many laser cycles as zooming's coarsest detection is reckoned to take, and what its counters do.
fn detection_rows(at: &AtRange) -> Vec<Row> {
    let Some(coarsest) = at.detections.first() else {
        return Vec::new();
    };
    let range_m = at.range_m;
    let [in_12, in_14] = coarsest.exposures.map(f64::from);
    vec![
        Row::ours(
            format!("P_D of zooming's coarsest step in the reckoned cycles at {range_m} m, measured"),
            "",
            coarsest.found.value,
        )
        .remark(format!(
            "{} of 0.997 wanted, in {} frames of {:.0} laser cycles, added from exposures that the counters hold.",
            with_interval(&coarsest.found, 2),
            coarsest.frames,
            coarsest.reckoned
        )),
        Row::ours(
            format!("its exposures, 12-bit bins, at {range_m} m, measured"),
            "",
            in_12,
        )
        .remark(format!(
            "In a single one {:.0} % have a full bin of 12 bits, {:.0} % one of 14.",
            100.0 * coarsest.full[0],
            100.0 * coarsest.full[1]
        )),
        Row::ours(format!("the same, 14-bit bins, at {range_m} m"), "", in_14),
    ]
}

/// Sliding in the bins that the demonstrator had, and why zooming is not beside it.
fn delay_line_rows() -> Vec<Row> {
    let lines = demonstrator_on_delay_lines();
    let (sliding, penalty) = (lines.sliding(), lines.penalty_of_sliding());
    let guided = &lines.guided;
    vec![
        Row::measured(
            "penalty of sliding in delay-line bins, windows every 12.5 ns, measured",
            "×",
            AtLeast("6"),
            &penalty,
        )
        .remark(format!(
            "{}: {} windows, of which each repeats 8.3 ns of the one before, where the thesis has none overlap; {} laser cycles over {}; {:.2} by the thesis's formula for these windows. Zooming needs bins of 20.8 and 166 ns, and elements of a delay line are 2.6 ns whatever CLK is: it is measured in CLK bins alone.",
            with_interval(&penalty, 2),
            lines.windows.len(),
            with_interval(&sliding, 0),
            with_interval(&guided.cycles, 0),
            lines.reckoned / demonstrator().full(lines.range_m).laser_cycles(),
        )),
        Row::ours(
            "laser cycles of a guided histogram in delay-line bins, measured",
            "",
            guided.cycles.value,
        )
        .remark(format!(
            "{}; {} of {} frames of the reckoned number measure the echo within 0.5 m. Bins are calibrated.",
            with_interval(&guided.cycles, 0),
            with_interval(&guided.found, 3),
            guided.frames
        )),
        Row::ours(
            "exposures of these windows in which a bin of 12 bits is full, measured",
            "%",
            100.0 * lines.full.value,
        )
        .remark(format!(
            "{} %: none is read out twice.",
            with_interval(&lines.full.map(|share| 100.0 * share), 2)
        )),
    ]
}

/// The least range at which zooming takes so many steps, m.
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
pub(super) fn demonstrator_rows() -> Vec<Row> {
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
        demonstrator_on_chip().at(75.0),
        demonstrator_on_chip().at(74.0),
    );
    let sliding_75 = at_75.penalty_of_sliding();
    let sliding_74 = at_74.penalty_of_sliding();
    let zooming_75 = at_75.penalty_of_zooming();
    let better = zooming_75.filter(|zooming| zooming.value < sliding_75.value);
    let mut rows = vec![
        Row::measured(
            "penalty of the better partial histogram, measured",
            "×",
            AtLeast("6"),
            &better.unwrap_or(sliding_75),
        )
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
        zooming_row("penalty of zooming, measured", at_75, Nothing),
        zooming_row("the same at 74 m, measured", at_74, Nothing),
        Row::ours("laser cycles of a guided histogram, measured", "", at_75.guided.value).remark(
            format!(
                "{} for the spread of those frames that measure the echo within 0.5 m: {} of {} frames of the reckoned number do. The others take a peak of the background for it, which no formula of a spread knows.",
                with_interval(&at_75.guided, 0),
                with_interval(&at_75.measurement.found, 3),
                at_75.measurement.frames
            ),
        ),
    ]);
    rows.extend(detection_rows(at_75));
    rows.extend(detection_rows(at_74));
    rows.extend([
        Row::holds(
            "penalty of the better partial histogram",
            "×",
            AtLeast("6"),
            least,
        )
        .remark("Sliding, here and at 74 m."),
        Row::ours("penalty of sliding", "×", penalty(&sliding, &full)).remark(format!(
            "{} windows of {:.2} m, the last to {last_end_m:.1} m.",
            sliding.steps.len(),
            system.window_m,
        )),
        Row::ours("the same at 74 m", "×", penalty(&system.sliding(74.0, 0), &nearer)),
        Row::ours("penalty of zooming", "×", penalty(&zooming, &full)).remark(format!(
            "Just beyond a step: detection among 4 bins of {coarse_m:.2} m, of which three end at {:.2} m.",
            3.0 * coarse_m
        )),
        Row::ours("the same at 74 m", "×", penalty(&system.zooming(74.0), &nearer))
            .remark("Just before it: among 3 bins, and with an echo no farther than their end."),
        Row::holds("second zoom step from", "m", Exactly("3"), zooming_takes(&system, 2)).aside(),
        Row::holds("third zoom step from", "m", Exactly("25"), zooming_takes(&system, 3)).aside(),
        Row::holds(
            "bin interval of the third zoom step",
            "ns",
            Exactly("166"),
            coarse_ns,
        )
        .given("8 × 8 bins of the 2.6 ns that are put in.")
        .aside(),
        Row::ours(
            "laser cycles of a full or guided histogram",
            "",
            full.laser_cycles(),
        )
        .remark("Thompson, as the thesis uses here. The frame has 16 000."),
        Row::ours(
            "penalty of zooming, one hit per bin and cycle",
            "×",
            penalty(&chip, &full),
        ),
        Row::ours(
            "exposures of zooming, 12-bit bins",
            "",
            zooming.exposures(12),
        )
        .remark("HSLIDAR's bins; without off-chip sums its coarse bins overflow."),
    ]);
    rows
}
