//! What the front ends counted, beside their closed forms with the circuits' delays: table, checks and charts.

use std::path::Path;

use super::bench::{Bench, DEAD_TIME_NS, RatePoint, SPADS, STEPS, TOGETHER, WIRES};
use crate::chip::{ChipTiming, FrontEnd};
use crate::files::InputError;
use crate::logic::Logic;
use crate::netlist::{CellKind, Corner, Library};
use crate::report::{Axis, Chart, Checks, Grid};
use crate::theory::front_ends::{
    Meeting, any_periods_hz, coincidences_hz, fold_hz, non_paralysable_hz, odd_periods_hz,
    paralysable_hz, xor_edges_hz,
};

/// The closed forms with the circuits' delays.
pub(super) struct Laws {
    clk_hz: f64,
    /// Below this gap between two pulses of a SPAD a shaper misses the second, s.
    gap_s: f64,
    /// Width of a shaped pulse, s.
    width_s: f64,
    or: Meeting,
    coincidence: Meeting,
    /// Slowest XOR gate, s.
    xor_s: f64,
}

impl Laws {
    pub(super) fn new(bench: &Bench) -> Self {
        let library = Library::generic_40nm();
        let delay = |kind, to| library.delay(kind, 0, to, Corner::Typ).as_s();
        let width_s = ChipTiming::new(&bench.config)
            .pulses
            .shaped
            .expect("it shapes")
            .as_s();
        // A gap closes that is shorter than an OR gate's fall, and each level before makes it narrower.
        let (rise, fall) = (
            delay(CellKind::Or2, Logic::One),
            delay(CellKind::Or2, Logic::Zero),
        );
        let levels = f64::from(SPADS.ilog2());
        let joined_s = width_s + fall + (levels - 1.0) * (fall - rise);
        Laws {
            clk_hz: bench.clock().as_hz(),
            gap_s: delay(CellKind::And2, Logic::Zero),
            width_s,
            or: Meeting {
                together_s: width_s,
                joined_s,
            },
            coincidence: Meeting {
                together_s: width_s - delay(CellKind::And2, Logic::One),
                joined_s,
            },
            xor_s: delay(CellKind::Xor2, Logic::One),
        }
    }

    /// Avalanches of a SPAD, 1/s.
    fn avalanches_hz(&self, photons_hz: f64) -> f64 {
        non_paralysable_hz(photons_hz, DEAD_TIME_NS * 1e-9)
    }

    /// Those of them that its shaper sees.
    fn shaped_hz(&self, photons_hz: f64) -> f64 {
        self.avalanches_hz(photons_hz) * libm::exp(-photons_hz * self.gap_s)
    }

    /// Counts on a wire of [`WIRES`].
    fn wire_hz(&self, wire: usize, photons_hz: f64) -> f64 {
        let shaped = self.shaped_hz(photons_hz);
        match WIRES[wire].0 {
            FrontEnd::OrTree => coincidences_hz(SPADS, 1, shaped, self.or),
            FrontEnd::Coincidence => coincidences_hz(SPADS, TOGETHER, shaped, self.coincidence),
            _ => xor_edges_hz(
                f64::from(SPADS) * self.avalanches_hz(photons_hz),
                self.xor_s,
            ),
        }
    }

    /// Counts in CLK periods, where there is an exact form.
    fn sampled_hz(&self, kind: FrontEnd, photons_hz: f64) -> Option<f64> {
        let avalanches = self.avalanches_hz(photons_hz);
        match kind {
            FrontEnd::Summation => Some(f64::from(SPADS) * avalanches),
            FrontEnd::XorTree => Some(odd_periods_hz(SPADS, avalanches, self.clk_hz)),
            FrontEnd::OrTree | FrontEnd::Coincidence => None,
        }
    }
}

fn mega(hz: f64) -> String {
    format!("{:.1}", hz * 1e-6)
}

/// What was counted, rate by rate.
pub(super) fn table(points: &[RatePoint]) -> String {
    let mut grid = Grid::headed(
        "in | avalanches | OR wire | XOR wire | coincidence wire | summation sampled \
        | OR sampled | XOR sampled | coincidence sampled",
    );
    for point in points {
        let numbers = [point.photons_hz, point.avalanches];
        let numbers = numbers.iter().chain(&point.wires).chain(&point.sampled);
        grid.push(numbers.map(|&hz| mega(hz)));
    }
    format!(
        "{SPADS} SPADs with {DEAD_TIME_NS} ns of dead time; millions a second\n\
         in: detectable photons on one SPAD; all others of the macropixel; sampled: lines high at CLK edges\n{grid}"
    )
}

/// Every rate against its closed form.
pub(super) fn compare(points: &[RatePoint], laws: &Laws, checks: &mut Checks) {
    let mut worst = |what: String,
                     allowed: f64,
                     law: &dyn Fn(f64) -> f64,
                     found: &dyn Fn(&RatePoint) -> f64| {
        // Counts of a process no more irregular than Poisson's.
        let errors = points.iter().map(|point| {
            let (expected, found) = (law(point.photons_hz), found(point));
            let noise = (expected * point.seconds).max(1.0).sqrt() / point.seconds;
            let beyond = ((found - expected).abs() - 4.0 * noise).max(0.0) / expected;
            let sigmas = (found - expected).abs() / noise;
            (beyond, sigmas, found / expected - 1.0, point.photons_hz)
        });
        let errors: Vec<_> = errors.collect();
        let beyond = errors.iter().map(|error| error.0).fold(0.0, f64::max);
        let worst = errors.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let &(_, sigmas, off, at) = worst.expect("a sweep");
        checks.add_verdict(
            what,
            format!("within {:.0} % beyond 4 sigma", 100.0 * allowed),
            format!(
                "at worst {:+.1} %, {sigmas:.1} sigma, at {} M",
                100.0 * off,
                mega(at)
            ),
            beyond <= allowed,
        );
    };
    worst(
        "avalanches against the non-paralysable law".to_owned(),
        0.0,
        &|hz| f64::from(SPADS) * laws.avalanches_hz(hz),
        &|point| point.avalanches,
    );
    // What the closed forms leave out: pulses narrowed or delayed by gaps near a gate's delay.
    for (wire, (kind, _)) in WIRES.into_iter().enumerate() {
        let allowed = match kind {
            FrontEnd::OrTree => 0.02,
            _ => 0.05,
        };
        let what = format!("{} wire against its closed form", kind.name());
        worst(what, allowed, &|hz| laws.wire_hz(wire, hz), &|point| {
            point.wires[wire]
        });
    }
    for (place, kind) in FrontEnd::ALL.into_iter().enumerate() {
        if laws.sampled_hz(kind, 1e6).is_some() {
            let what = format!("{} sampled against its closed form", kind.name());
            let law = |hz| laws.sampled_hz(kind, hz).expect("it has one");
            worst(what, 0.01, &law, &|point| point.sampled[place]);
        }
    }
}

/// Where counts are most: measured in steps of the sweep, computed between them.
pub(super) fn folds(points: &[RatePoint], laws: &Laws, checks: &mut Checks) {
    let step = libm::pow(10f64, 1.0 / f64::from(STEPS));
    let most = |found: &dyn Fn(&RatePoint) -> f64| {
        let best = points.iter().max_by(|a, b| found(a).total_cmp(&found(b)));
        best.expect("a sweep").photons_hz
    };
    let last = points.last().expect("a sweep").photons_hz;
    for (wire, (kind, _)) in WIRES.into_iter().enumerate() {
        let found = most(&|point| point.wires[wire]);
        let together = match kind {
            FrontEnd::OrTree => Some(1),
            FrontEnd::Coincidence => Some(TOGETHER),
            _ => None,
        };
        // The rate of avalanches that the closed form gives for this light.
        let computed = together.map(|together| {
            let fold = fold_hz(SPADS, together, laws.or.joined_s);
            fold / (1.0 - fold * DEAD_TIME_NS * 1e-9)
        });
        match computed {
            Some(computed) => checks.add_verdict(
                format!("{} wire folds over at", kind.name()),
                format!("{} M photons/s a SPAD", mega(computed)),
                format!("{} M", mega(found)),
                // Near its maximum a curve is flat: two steps of the sweep, 1 % of counts.
                libm::log(found / computed).abs() <= 2.1 * libm::log(step),
            ),
            None => checks.add_verdict(
                format!("{} wire does not fold over", kind.name()),
                format!("most from {} M on", mega(last / step.powi(2))),
                format!("{} M", mega(found)),
                found >= last / (step.powi(2) * 1.01),
            ),
        }
    }
    let summation = most(&|point| point.sampled[0]);
    checks.add_verdict(
        "summation does not fold over",
        format!("most from {} M on", mega(last / step.powi(2))),
        format!("{} M", mega(summation)),
        summation >= last / (step.powi(2) * 1.01),
    );
    let xor = points.last().expect("a sweep").sampled[2];
    checks.add_verdict(
        "xor_tree sampled comes to half of CLK",
        mega(0.5 * laws.clk_hz),
        mega(xor),
        (xor / (0.5 * laws.clk_hz) - 1.0).abs() < 0.08,
    );
}

/// The waveform's charts: the wires without a clock, and what CLK samples.
pub(super) fn charts(waves: &Path, points: &[RatePoint], laws: &Laws) -> Result<(), InputError> {
    let axes = |y: &str| {
        let x = Axis::log("detectable photons on each SPAD (1/s)");
        (x, Axis::log(y))
    };
    let law = |counts_hz: &dyn Fn(f64) -> f64| -> Vec<(f64, f64)> {
        let rates = (0..=180).map(|step| 1e6 * libm::pow(10f64, f64::from(step) / 60.0));
        rates.map(|hz| (hz, counts_hz(hz))).collect()
    };
    let measured = |counts_hz: &dyn Fn(&RatePoint) -> f64| -> Vec<(f64, f64)> {
        points
            .iter()
            .map(|p| (p.photons_hz, counts_hz(p)))
            .collect()
    };
    let all = f64::from(SPADS);
    let (x, y) = axes("counts of the macropixel (1/s)");
    let title = format!("Fig. 22 without a clock: {SPADS} SPADs, dead time {DEAD_TIME_NS} ns");
    Chart::new(title, x, y.with_range(1e6, 1e10))
        .points("avalanches", measured(&|p| p.avalanches))
        .line("n φ / (1 + φ D)", law(&|hz| all * laws.avalanches_hz(hz)))
        .points("(a) OR tree, gates", measured(&|p| p.wires[0]))
        .line("n m (1 − m τ)ⁿ⁻¹", law(&|hz| laws.wire_hz(0, hz)))
        .dashed(
            "Λ exp(−Λ τ)",
            law(&|hz| paralysable_hz(all * laws.avalanches_hz(hz), laws.width_s)),
        )
        .points("(b) XOR tree, gates", measured(&|p| p.wires[1]))
        .line("Λ / (2 exp(Λ δ) − 1)", law(&|hz| laws.wire_hz(1, hz)))
        .points("(c) 2 of 16, gates", measured(&|p| p.wires[2]))
        .line("coincidences", law(&|hz| laws.wire_hz(2, hz)))
        .write(&waves.with_extension("svg"))?;
    let (x, y) = axes("sampled by CLK (1/s)");
    let title = format!(
        "Fig. 22 as the METDC gets it: CLK at {} MHz",
        mega(laws.clk_hz)
    );
    let sampled = |kind| law(&|hz| laws.sampled_hz(kind, hz).expect("it has a closed form"));
    Chart::new(title, x, y.with_range(1e5, 1e10))
        .points("(d) summation, gates: SPADs", measured(&|p| p.sampled[0]))
        .line("n m", sampled(FrontEnd::Summation))
        .dashed(
            "any SPAD: f (1 − (1 − m T)ⁿ)",
            law(&|hz| any_periods_hz(SPADS, laws.avalanches_hz(hz), laws.clk_hz)),
        )
        .points("(a) OR tree, gates", measured(&|p| p.sampled[1]))
        .points("(b) XOR tree, gates", measured(&|p| p.sampled[2]))
        .line("f (1 − (1 − 2 m T)ⁿ) / 2", sampled(FrontEnd::XorTree))
        .points("(c) 2 of 16, gates", measured(&|p| p.sampled[3]))
        .write(&waves.with_file_name("tb_front_ends_sampled.svg"))
}
