//! Figures of laser cycles and penalties, and table 7.

use super::{one_hit, penalty};
use crate::report::{Chart, Grid};
use crate::reproduce::measured::partial::{
    AtRange, OnChip, demonstrator_on_chip, demonstrator_on_delay_lines, long_range_on_chip,
};
use crate::reproduce::parameters::{demonstrator, long_range};
use crate::reproduce::thesis::{chart, grid};
use crate::theory::capacity::full_bins;
use crate::theory::partial::{StepPurpose, System};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

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
    fn new(system: System, to_m: u32) -> Self {
        let windows = full_bins(f64::from(to_m), system.window_m);
        let window_end_m = |window: u32| f64::from(window) * system.window_m;
        let detecting = (1..=windows).map(|window| {
            let steps = system.zooming(window_end_m(window)).steps;
            let detections = steps
                .iter()
                .filter(|step| step.purpose != StepPurpose::Measure);
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
pub(in crate::reproduce) fn figure_35() -> Chart {
    let fits = |z_m: f64| SPEED_OF_LIGHT_M_PER_S / (2.0 * z_m * 30.0);
    let needed = Curves::new(long_range(), 200).full();
    chart(35)
        .line("needed, Cramér-Rao", needed)
        .line(
            "that fit a frame",
            (5..=200).map(|z| (f64::from(z), fits(f64::from(z)))),
        )
        .points("published, both at 200 m", [(200.0, 25_000.0)])
}

/// Fig. 42: laser cycles of the detection step.
pub(in crate::reproduce) fn figure_42() -> Chart {
    let detecting = |system: System| Curves::new(system, 200).detecting();
    chart(42)
        .line("every photon counts (thesis)", detecting(long_range()))
        .dashed(
            "one hit per bin and cycle (this chip)",
            detecting(one_hit(long_range())),
        )
        .points(
            "measured on the chip",
            points(long_range_on_chip(), |at| Some(at.detecting()?.value)),
        )
}

/// Fig. 43: laser cycles of each window of sliding.
pub(in crate::reproduce) fn figure_43() -> Chart {
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
    chart(43)
        .line("all windows so far", total)
        .bars("this window", each)
        .points("this window, measured on the chip", measured)
}

/// What was measured, against range.
fn points(on_chip: &OnChip, value: impl Fn(&AtRange) -> Option<f64>) -> Points {
    let ranges = on_chip.ranges.iter();
    ranges
        .filter_map(|at| Some((at.range_m, value(at)?)))
        .collect()
}

fn schemes(figure: u32, on_chip: &OnChip, to_m: u32) -> Chart {
    let curves = Curves::new(on_chip.system, to_m);
    let measured = |value: fn(&AtRange) -> Option<f64>| points(on_chip, value);
    chart(figure)
        .line("full and guided", curves.full())
        .line("zooming", curves.zooming())
        .line("sliding", curves.sliding())
        .points("guided, measured", measured(|at| Some(at.guided.value)))
        .points(
            "zooming, measured",
            measured(|at| Some(at.zooming()?.value)),
        )
        .points("sliding, measured", measured(|at| Some(at.sliding.value)))
}

fn penalties(figure: u32, on_chip: &OnChip, to_m: u32) -> Chart {
    let curves = Curves::new(on_chip.system, to_m);
    let chip = Curves::new(one_hit(on_chip.system), to_m);
    chart(figure)
        .line("guided", [(1.0, 1.0), (f64::from(to_m), 1.0)])
        .line("zooming", curves.penalty_of_zooming())
        .line("sliding", curves.penalty_of_sliding())
        .dashed(
            "zooming, one hit per bin and cycle",
            chip.penalty_of_zooming(),
        )
        .points(
            "zooming, measured",
            points(on_chip, |at| Some(at.penalty_of_zooming()?.value)),
        )
        .points(
            "sliding, measured",
            points(on_chip, |at| Some(at.penalty_of_sliding().value)),
        )
}

/// Fig. 44: laser cycles of the three schemes.
pub(in crate::reproduce) fn figure_44() -> Chart {
    schemes(44, long_range_on_chip(), 200)
}

/// Fig. 45: their penalties.
pub(in crate::reproduce) fn figure_45() -> Chart {
    let chart = penalties(45, long_range_on_chip(), 200);
    chart.points("published: approaching 4", [(200.0, 4.0)])
}

/// Fig. 108: laser cycles of the demonstrator's schemes.
pub(in crate::reproduce) fn figure_108() -> Chart {
    let chart = schemes(108, demonstrator_on_chip(), 80);
    let lines = demonstrator_on_delay_lines();
    let point = |cycles: f64| [(lines.range_m, cycles)];
    chart
        .points(
            "guided in delay-line bins, measured",
            point(lines.guided.cycles.value),
        )
        .points(
            "sliding in delay-line bins, measured",
            point(lines.sliding().value),
        )
}

/// Fig. 109: their penalties.
pub(in crate::reproduce) fn figure_109() -> Chart {
    let chart = penalties(109, demonstrator_on_chip(), 80);
    let lines = demonstrator_on_delay_lines();
    chart
        .points(
            "sliding in delay-line bins, measured",
            [(lines.range_m, lines.penalty_of_sliding().value)],
        )
        .points("published: at least 6 at 75 m", [(75.0, 6.0)])
}

/// Tables 7 and 15's systems, scheme by scheme, with overflow counted.
pub(in crate::reproduce) fn table_7() -> Grid {
    let mut grid = grid(7);
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
