//! Claims 11, 14 and 15: laser cycles, and what zooming and sliding add to them.

use super::claim::{Published::*, Row};
use super::design::{ROUNDED_LIGHT_M_PER_S, TABLE_6_BACKGROUND_HZ, TABLE_6_BIN_M, TABLE_6_BIN_S};
use super::measured::partial::{
    AtRange, OnChip, demonstrator_on_chip, long_range_on_chip, with_interval,
};
use crate::report::{Axis, Chart, Grid, Style};
use crate::theory::capacity::full_bins;
use crate::theory::detection::{Model, Ties};
use crate::theory::partial::{Cost, Goal, Link, Models, Purpose, System};
use crate::theory::precision;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

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
                "σ = FWHM/2.355 = 3.397 ns gives fewer; the published 25 000 takes σ = {sigma_ns:.3} ns, a pulse {:.1} % wider. \"Converge to around\" is said of both this and the line above.",
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
        Row::holds("penalty of sliding, measured", "×", approaching, measured.value)
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
            .remark("\"At longer distances\": holds with Cramér-Rao, not with Thompson."),
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
fn zooming_row(what: &str, at: &AtRange, published: super::claim::Published) -> Row {
    let penalty = at.penalty_of_zooming();
    let text = penalty.map_or("never".to_owned(), |p| with_interval(&p, 2));
    Row::holds(
        what,
        "×",
        published,
        penalty.map_or(f64::INFINITY, |p| p.value),
    )
    .remark(format!(
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
    let zooming_75 = at_75
        .penalty_of_zooming()
        .map_or(f64::INFINITY, |p| p.value);
    let mut rows = vec![
        Row::holds(
            "penalty of the better partial histogram, measured",
            "×",
            AtLeast("6"),
            sliding_75.value.min(zooming_75),
        )
        .remark(format!(
            "Sliding: {}, {} laser cycles over {}; at 74 m {}.",
            with_interval(&sliding_75, 2),
            with_interval(&at_75.sliding, 0),
            with_interval(&at_75.guided, 0),
            with_interval(&sliding_74, 2)
        )),
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
    ];
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

/// Laser cycles of a system's schemes against range. What zooming detects and which windows sliding visits changes
/// only from window to window, so that is computed once a window.
struct Curves {
    system: System,
    to_m: u32,
    /// Detection cycles of zooming, by the target's window.
    detecting: Vec<f64>,
    /// Cycles of sliding, by the target's window.
    sliding: Vec<f64>,
}

/// Points (x, y).
type Points = Vec<(f64, f64)>;

impl Curves {
    fn of(system: System, to_m: u32) -> Self {
        let windows = full_bins(f64::from(to_m), system.window_m);
        let window_end_m = |window: u32| f64::from(window) * system.window_m;
        let detecting = (1..=windows).map(|window| {
            let steps = system.zooming(window_end_m(window)).steps;
            let detections = steps.iter().filter(|step| step.purpose != Purpose::Measure);
            detections.map(|step| step.laser_cycles).sum()
        });
        let mut sum = 0.0;
        let sliding = system.sliding(window_end_m(windows), 0).steps;
        let sliding = sliding.iter().map(|step| {
            sum += step.laser_cycles;
            sum
        });
        Curves {
            system,
            to_m,
            detecting: detecting.collect(),
            sliding: sliding.collect(),
        }
    }

    /// `cost` of the measurement's cycles and the target's window (from 0), every metre.
    fn points(&self, cost: impl Fn(f64, usize) -> f64) -> Points {
        let ranges = (1..=self.to_m).map(f64::from);
        ranges
            .map(|z_m| {
                let window = full_bins(z_m, self.system.window_m) as usize - 1;
                (z_m, cost(self.system.measure(z_m).laser_cycles, window))
            })
            .collect()
    }

    fn full(&self) -> Points {
        self.points(|measuring, _| measuring)
    }

    fn detecting(&self) -> Points {
        let mut points = self.points(|_, window| self.detecting[window]);
        points.retain(|p| p.1 > 0.0);
        points
    }

    fn zooming(&self) -> Points {
        self.points(|measuring, window| self.detecting[window] + measuring)
    }

    fn sliding(&self) -> Points {
        self.points(|_, window| self.sliding[window])
    }

    fn penalty_of_zooming(&self) -> Points {
        self.points(|measuring, window| 1.0 + self.detecting[window] / measuring)
    }

    fn penalty_of_sliding(&self) -> Points {
        self.points(|measuring, window| self.sliding[window] / measuring)
    }
}

/// Fig. 35: laser cycles of a full histogram.
pub(super) fn figure_35() -> Vec<Chart> {
    let fits = |z_m: f64| SPEED_OF_LIGHT_M_PER_S / (2.0 * z_m * 30.0);
    let needed = Curves::of(long_range(), 200).full();
    vec![
        Chart::new(
            "Laser cycles for 0.1 m (Table 6, 5 ns bins), and what a frame at 30 fps holds",
            Axis::linear("distance (m)").between(0.0, 205.0),
            Axis::log("laser cycles").between(1.0, 1e6),
        )
        .with("needed, Cramér-Rao", Style::Line, needed)
        .with(
            "that fit a frame",
            Style::Line,
            (5..=200).map(|z| (f64::from(z), fits(f64::from(z)))),
        )
        .with(
            "published, both at 200 m",
            Style::Points,
            [(200.0, 25_000.0)],
        ),
    ]
}

/// Fig. 42: laser cycles of the detection step.
pub(super) fn figure_42() -> Vec<Chart> {
    let detecting = |system: System| Curves::of(system, 200).detecting();
    vec![
        Chart::new(
            "Laser cycles of zooming's detection step (16 bins of 12.5 m, P_D 99.7 %)",
            Axis::linear("distance (m)").between(0.0, 205.0),
            Axis::linear("laser cycles"),
        )
        .with(
            "every photon counts (thesis)",
            Style::Line,
            detecting(long_range()),
        )
        .with(
            "one hit per bin and cycle (this chip)",
            Style::Dashed,
            detecting(one_hit(long_range())),
        )
        .with(
            "measured on the chip",
            Style::Points,
            points(long_range_on_chip(), |at| Some(at.detecting()?.value)),
        ),
    ]
}

/// Fig. 43: laser cycles of each window of sliding.
pub(super) fn figure_43() -> Vec<Chart> {
    let steps = long_range().sliding(200.0, 0).steps;
    let each: Points = steps
        .iter()
        .map(|step| (step.range_m, step.laser_cycles))
        .collect();
    let mut sum = 0.0;
    let total = each.iter().map(|&(end_m, cycles)| {
        sum += cycles;
        (end_m, sum)
    });
    let total: Points = total.collect();
    let windows = &long_range_on_chip().windows;
    let measured: Points = windows.iter().map(|(end_m, n)| (*end_m, n.value)).collect();
    vec![
        Chart::new(
            "Sliding: laser cycles of each window, and of all up to it",
            Axis::linear("end of the window (m)"),
            Axis::linear("laser cycles"),
        )
        .with("all windows so far", Style::Line, total)
        .with("this window", Style::Bars, each)
        .with("this window, measured on the chip", Style::Points, measured),
    ]
}

/// What was measured, against range.
fn points(on_chip: &OnChip, of: impl Fn(&AtRange) -> Option<f64>) -> Points {
    let ranges = on_chip.ranges.iter();
    ranges
        .filter_map(|at| Some((at.range_m, of(at)?)))
        .collect()
}

fn schemes(title: &str, on_chip: &OnChip, to_m: u32) -> Chart {
    let curves = Curves::of(on_chip.system, to_m);
    let measured = |of: fn(&AtRange) -> Option<f64>| points(on_chip, of);
    Chart::new(
        title,
        Axis::linear("distance (m)"),
        Axis::log("laser cycles"),
    )
    .with("full and guided", Style::Line, curves.full())
    .with("zooming", Style::Line, curves.zooming())
    .with("sliding", Style::Line, curves.sliding())
    .with(
        "guided, measured",
        Style::Points,
        measured(|at| Some(at.guided.value)),
    )
    .with(
        "zooming, measured",
        Style::Points,
        measured(|at| Some(at.zooming()?.value)),
    )
    .with(
        "sliding, measured",
        Style::Points,
        measured(|at| Some(at.sliding.value)),
    )
}

fn penalties(title: &str, on_chip: &OnChip, to_m: u32) -> Chart {
    let curves = Curves::of(on_chip.system, to_m);
    let chip = Curves::of(one_hit(on_chip.system), to_m);
    Chart::new(
        title,
        Axis::linear("distance (m)"),
        Axis::log("penalty (×)"),
    )
    .with("guided", Style::Line, [(1.0, 1.0), (f64::from(to_m), 1.0)])
    .with("zooming", Style::Line, curves.penalty_of_zooming())
    .with("sliding", Style::Line, curves.penalty_of_sliding())
    .with(
        "zooming, one hit per bin and cycle",
        Style::Dashed,
        chip.penalty_of_zooming(),
    )
    .with(
        "zooming, measured",
        Style::Points,
        points(on_chip, |at| Some(at.penalty_of_zooming()?.value)),
    )
    .with(
        "sliding, measured",
        Style::Points,
        points(on_chip, |at| Some(at.penalty_of_sliding().value)),
    )
}

/// Fig. 44: laser cycles of the three schemes.
pub(super) fn figure_44() -> Vec<Chart> {
    vec![schemes(
        "Laser cycles for Table 6's goals (16-bin schemes of Table 7)",
        long_range_on_chip(),
        200,
    )]
}

/// Fig. 45: their penalties.
pub(super) fn figure_45() -> Vec<Chart> {
    let chart = penalties(
        "Laser power penalty of 16-bin partial histograms (Table 6)",
        long_range_on_chip(),
        200,
    );
    vec![chart.with("published: approaching 4", Style::Points, [(200.0, 4.0)])]
}

/// Fig. 108: laser cycles of the demonstrator's schemes.
pub(super) fn figure_108() -> Vec<Chart> {
    vec![schemes(
        "Laser cycles for 10 cm (Table 15, 8 bins)",
        demonstrator_on_chip(),
        80,
    )]
}

/// Fig. 109: their penalties.
pub(super) fn figure_109() -> Vec<Chart> {
    let chart = penalties(
        "Laser power penalty of 8-bin partial histograms (Table 15)",
        demonstrator_on_chip(),
        80,
    );
    vec![chart.with(
        "published: at least 6 at 75 m",
        Style::Points,
        [(75.0, 6.0)],
    )]
}

/// Tables 7 and 15's systems, scheme by scheme, with overflow counted.
pub(super) fn table_7() -> Grid {
    let mut grid = Grid::new([
        "system, scheme",
        "steps",
        "laser cycles",
        "penalty (×)",
        "exposures, 12 bit",
        "exposures, 14 bit",
    ]);
    let systems = [
        ("Table 6 at 200 m", long_range(), 200.0),
        ("Table 15 at 75 m", demonstrator(), 75.0),
    ];
    for (name, system, z_m) in systems {
        let full = system.full(z_m);
        let costs = [
            ("full or guided", system.full(z_m)),
            ("zooming", system.zooming(z_m)),
            (
                "zooming, one hit per bin and cycle",
                one_hit(system).zooming(z_m),
            ),
            ("sliding", system.sliding(z_m, 0)),
            (
                "sliding, quarter overlap",
                system.sliding(z_m, system.bins / 4),
            ),
        ];
        for (scheme, cost) in costs {
            grid.push([
                format!("{name}, {scheme}"),
                cost.steps.len().to_string(),
                format!("{:.0}", cost.laser_cycles()),
                format!("{:.2}", penalty(&cost, &full)),
                format!("{:.0}", cost.exposures(12)),
                format!("{:.0}", cost.exposures(14)),
            ]);
        }
    }
    grid
}
