//! Testbench of the front ends: counts out against light in, from 1 M to 1 G detectable photons a second on each of 16
//! SPADs, for all of Fig. 22 at gate level beside their closed forms (thesis 2.4.1).
//!
//! ```text
//!                ┌─► summation ─────► SPAD_TIMED<16>
//!   SPAD_RAW ────┼─► or_tree ─WIRE──► SPAD_TIMED      rises of WIRE:  counted without a clock, as the figure has it
//!   CLK          ├─► xor_tree ─WIRE─► SPAD_TIMED      edges of WIRE
//!                └─► coincidence ───► SPAD_TIMED      CLK periods in which SPAD_TIMED is high: what the METDC gets
//! ```
//!
//! SPADs have 5 ns of dead time here, so that each front end's fold, if it has one, lies within the sweep. Beside the
//! waveform it leaves two charts with their numbers, one of the wires and one of what CLK samples.

use std::path::Path;

use crate::chip::{ChipTiming, FrontEnd, SensorConfig, front_end};
use crate::engine::waveform::write_waves;
use crate::files::InputError;
use crate::kernel::{Drive, Kernel, Observer, in_order};
use crate::logic::Logic;
use crate::netlist::{CellKind, Corner, Library, ModuleBuilder, NetId, Netlist, Timing};
use crate::report::{Axis, Chart, Checks, Grid, Style};
use crate::testbenches::Testbench;
use crate::theory::front_ends::{
    Meeting, any_periods_hz, coincidences_hz, fold_hz, non_paralysable_hz, odd_periods_hz,
    paralysable_hz, xor_edges_hz,
};
use crate::units::{Frequency, Time};
use crate::waves::{Entry, Group, Layout};
use rand_philox::{philox4x32_10, u32_to_unit_f64};

/// SPADs of a macropixel.
const SPADS: u32 = 16;
/// SPADs that make a coincidence.
const TOGETHER: u32 = 2;
/// Dead time, and width of SPAD_RAW, ns.
const DEAD_TIME_NS: f64 = 5.0;
/// Avalanches at each rate: a standard error of 1.6 % and less.
const AVALANCHES: f64 = 4_000.0;
/// Rates a decade.
const STEPS: i32 = 6;
/// When the flip-flops are out of their reset.
const BEGIN: Time = Time::from_ns(20);
/// Light of the waveform, photons/s a SPAD.
const SHOWN_HZ: f64 = 80e6;

pub(super) const TESTBENCH: Testbench = Testbench {
    name: "tb_front_ends",
    about: "Front ends of Fig. 22: counts out against light in, and where each folds over",
    run,
};

fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let bench = Bench::new();
    let laws = Laws::new(&bench);
    // 1 M to 1 G.
    let rates = (6 * STEPS..=9 * STEPS).map(|step| 10f64.powf(f64::from(step) / f64::from(STEPS)));
    let points: Vec<Point> = rates.map(|photons_hz| bench.count(photons_hz)).collect();
    checks.note(table(&points));
    compare(&points, &laws, checks);
    folds(&points, &laws, checks);
    charts(waves, &points, &laws)?;
    let end = BEGIN + Time::from_ns(150);
    write_waves(waves, &bench.netlist, &view(), |waves| {
        bench.simulate(SHOWN_HZ, end, waves);
        end
    })
}

/// All front ends on the same SPADs.
struct Bench {
    config: SensorConfig,
    netlist: Netlist,
    timing: Timing,
}

impl Bench {
    fn new() -> Self {
        let config = |front_end| SensorConfig {
            front_end,
            coincident_spads: TOGETHER as usize,
            dead_time_ns: DEAD_TIME_NS,
            ..SensorConfig::default()
        };
        let mut m = ModuleBuilder::new("front_ends");
        let raw = m.input_bus("SPAD_RAW", SPADS as usize);
        let clk = [m.input("CLK")];
        let clear = [m.input("PIXEL_CLEAR")];
        for kind in FrontEnd::ALL {
            let config = config(kind);
            let timed = format!("{}_TIMED", kind.name().to_uppercase());
            let timed = m.wire_bus(&timed, config.lines());
            m.instance(
                kind.name(),
                &front_end::circuit(&config),
                &[
                    ("SPAD_RAW", &raw),
                    ("CLK", &clk),
                    ("PIXEL_CLEAR", &clear),
                    ("SPAD_TIMED", &timed),
                ],
            );
        }
        let netlist = Netlist::elaborate(&m.finish().expect("the testbench's circuit is whole"));
        Bench {
            timing: Timing::nominal(&netlist, &Library::default(), Corner::Typ),
            config: config(FrontEnd::OrTree),
            netlist,
        }
    }

    fn clock(&self) -> Frequency {
        self.config.clock()
    }

    /// Pulses of all SPADs in this light from `BEGIN` to `end`, as drives.
    fn pulses(&self, photons_hz: f64, end: Time) -> Vec<Drive> {
        let raw = self.netlist.signal("SPAD_RAW").expect("it has SPADs");
        let dead = self.config.dead_time();
        let mut drives = Vec::new();
        for (spad, &net) in (0..).zip(&raw) {
            drives.push(Drive::new(Time::ZERO, net, false));
            // A SPAD that has been lit for long is as likely to be dead as ever: the first pulses are drawn, not driven.
            let mut time = BEGIN - dead * 20;
            for number in 0.. {
                let word = philox4x32_10(
                    [number, spad, photons_hz.log2().to_bits() as u32, 0],
                    [22, 0],
                )[0];
                time += Time::from_s(-u32_to_unit_f64(word).ln() / photons_hz);
                if time >= end {
                    break;
                }
                if time >= BEGIN {
                    drives.push(Drive::new(time, net, true));
                    drives.push(Drive::new(time + dead, net, false));
                }
                time += dead;
            }
        }
        drives
    }

    /// Runs all front ends until `end`.
    fn simulate(&self, photons_hz: f64, end: Time, observer: &mut impl Observer) {
        let input = |name: &str| self.netlist.net(name).expect("it is an input");
        let (clk, clear) = (input("CLK"), input("PIXEL_CLEAR"));
        let mut drives = self.pulses(photons_hz, end);
        drives.push(Drive::new(Time::ZERO, clear, true));
        drives.push(Drive::new(BEGIN - Time::from_ns(2), clear, false));
        let ticks = self.clock().ticks(0).take_while(|&tick| tick < end);
        drives.extend(
            (0..)
                .zip(ticks)
                .map(|(k, tick)| Drive::new(tick, clk, k % 2 == 1)),
        );
        let mut kernel = Kernel::new(&self.netlist, &self.timing);
        kernel.run(&mut in_order(drives), end, observer);
    }

    /// Counts of all front ends in this light.
    fn count(&self, photons_hz: f64) -> Point {
        let avalanches_hz = non_paralysable_hz(photons_hz, DEAD_TIME_NS * 1e-9);
        let seconds = AVALANCHES / (f64::from(SPADS) * avalanches_hz);
        let mut counter = Counter::new(self);
        self.simulate(photons_hz, BEGIN + Time::from_s(seconds), &mut counter);
        let hz = |count: u64| count as f64 / seconds;
        Point {
            photons_hz,
            seconds,
            avalanches: hz(counter.avalanches),
            wires: counter.wires.map(hz),
            sampled: counter.sampled.map(hz),
        }
    }
}

/// What was counted at one rate, 1/s.
struct Point {
    photons_hz: f64,
    /// How long.
    seconds: f64,
    /// Of all SPADs.
    avalanches: f64,
    /// By [`WIRES`].
    wires: [f64; 3],
    /// By [`FrontEnd::ALL`].
    sampled: [f64; 4],
}

/// Front ends with a wire, and whether its falls are counted, too.
const WIRES: [(FrontEnd, bool); 3] = [
    (FrontEnd::OrTree, false),
    (FrontEnd::XorTree, true),
    (FrontEnd::Coincidence, false),
];

/// What a net is counted as.
#[derive(Clone, Copy)]
enum Role {
    Spad,
    Clk,
    Wire(usize),
    Timed(usize),
}

/// Counts edges and samples.
struct Counter {
    roles: Vec<Option<Role>>,
    avalanches: u64,
    wires: [u64; 3],
    /// Lines that are high.
    high: [u64; 4],
    sampled: [u64; 4],
    was_high: Vec<bool>,
}

impl Counter {
    fn new(bench: &Bench) -> Self {
        let netlist = &bench.netlist;
        let mut roles = vec![None; netlist.net_count()];
        let mut watch = |path: &str, role| {
            for net in netlist.signal(path).expect("it was built above") {
                roles[net.index()] = Some(role);
            }
        };
        watch("SPAD_RAW", Role::Spad);
        watch("CLK", Role::Clk);
        for (place, (kind, _)) in WIRES.into_iter().enumerate() {
            watch(&format!("{}.WIRE", kind.name()), Role::Wire(place));
        }
        for (place, kind) in FrontEnd::ALL.into_iter().enumerate() {
            let timed = format!("{}_TIMED", kind.name().to_uppercase());
            watch(&timed, Role::Timed(place));
        }
        Counter {
            was_high: vec![false; roles.len()],
            roles,
            avalanches: 0,
            wires: [0; 3],
            high: [0; 4],
            sampled: [0; 4],
        }
    }
}

impl Observer for Counter {
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        let Some(role) = self.roles[net.index()] else {
            return;
        };
        let is_high = value == Logic::One;
        let was_high = std::mem::replace(&mut self.was_high[net.index()], is_high);
        if time < BEGIN || is_high == was_high {
            return;
        }
        match role {
            Role::Spad => self.avalanches += u64::from(is_high),
            Role::Wire(wire) => self.wires[wire] += u64::from(is_high || WIRES[wire].1),
            Role::Timed(place) if is_high => self.high[place] += 1,
            Role::Timed(place) => self.high[place] -= 1,
            Role::Clk if is_high => {
                for (sampled, high) in self.sampled.iter_mut().zip(self.high) {
                    *sampled += high;
                }
            }
            Role::Clk => {}
        }
    }
}

/// The closed forms with the circuits' delays.
struct Laws {
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
    fn new(bench: &Bench) -> Self {
        let library = Library::default();
        let delay = |kind, to| library.delay(kind, 0, to, Corner::Typ).as_s();
        let width_s = ChipTiming::of(&bench.config)
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
        self.avalanches_hz(photons_hz) * (-photons_hz * self.gap_s).exp()
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

fn table(points: &[Point]) -> String {
    let mut grid = Grid::new([
        "in",
        "avalanches",
        "OR wire",
        "XOR wire",
        "coincidence wire",
        "summation sampled",
        "OR sampled",
        "XOR sampled",
        "coincidence sampled",
    ]);
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
fn compare(points: &[Point], laws: &Laws, checks: &mut Checks) {
    let mut worst =
        |what: String, allowed: f64, law: &dyn Fn(f64) -> f64, found: &dyn Fn(&Point) -> f64| {
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
            checks.that(
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
fn folds(points: &[Point], laws: &Laws, checks: &mut Checks) {
    let step = 10f64.powf(1.0 / f64::from(STEPS));
    let most = |found: &dyn Fn(&Point) -> f64| {
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
        // Light in which so many avalanches come.
        let computed = together.map(|together| {
            let fold = fold_hz(SPADS, together, laws.or.joined_s);
            fold / (1.0 - fold * DEAD_TIME_NS * 1e-9)
        });
        match computed {
            Some(computed) => checks.that(
                format!("{} wire folds over at", kind.name()),
                format!("{} M photons/s a SPAD", mega(computed)),
                format!("{} M", mega(found)),
                // Near its maximum a curve is flat: two steps of the sweep, 1 % of counts.
                (found / computed).ln().abs() <= 2.1 * step.ln(),
            ),
            None => checks.that(
                format!("{} wire does not fold over", kind.name()),
                format!("most from {} M on", mega(last / step.powi(2))),
                format!("{} M", mega(found)),
                found >= last / (step.powi(2) * 1.01),
            ),
        }
    }
    let summation = most(&|point| point.sampled[0]);
    checks.that(
        "summation does not fold over",
        format!("most from {} M on", mega(last / step.powi(2))),
        format!("{} M", mega(summation)),
        summation >= last / (step.powi(2) * 1.01),
    );
    let xor = points.last().expect("a sweep").sampled[2];
    checks.that(
        "xor_tree sampled comes to half of CLK",
        mega(0.5 * laws.clk_hz),
        mega(xor),
        (xor / (0.5 * laws.clk_hz) - 1.0).abs() < 0.08,
    );
}

fn charts(waves: &Path, points: &[Point], laws: &Laws) -> Result<(), InputError> {
    let axes = |y: &str| {
        let x = Axis::log("detectable photons on each SPAD (1/s)");
        (x, Axis::log(y))
    };
    let law = |of: &dyn Fn(f64) -> f64| -> Vec<(f64, f64)> {
        let rates = (0..=180).map(|step| 1e6 * 10f64.powf(f64::from(step) / 60.0));
        rates.map(|hz| (hz, of(hz))).collect()
    };
    let measured = |of: &dyn Fn(&Point) -> f64| -> Vec<(f64, f64)> {
        points.iter().map(|p| (p.photons_hz, of(p))).collect()
    };
    let all = f64::from(SPADS);
    let (x, y) = axes("counts of the macropixel (1/s)");
    let title = format!("Fig. 22 without a clock: {SPADS} SPADs, dead time {DEAD_TIME_NS} ns");
    Chart::new(title, x, y.between(1e6, 1e10))
        .with("avalanches", Style::Points, measured(&|p| p.avalanches))
        .with(
            "n φ / (1 + φ D)",
            Style::Line,
            law(&|hz| all * laws.avalanches_hz(hz)),
        )
        .with(
            "(a) OR tree, gates",
            Style::Points,
            measured(&|p| p.wires[0]),
        )
        .with(
            "n m (1 − m τ)ⁿ⁻¹",
            Style::Line,
            law(&|hz| laws.wire_hz(0, hz)),
        )
        .with(
            "Λ exp(−Λ τ)",
            Style::Dashed,
            law(&|hz| paralysable_hz(all * laws.avalanches_hz(hz), laws.width_s)),
        )
        .with(
            "(b) XOR tree, gates",
            Style::Points,
            measured(&|p| p.wires[1]),
        )
        .with(
            "Λ / (2 exp(Λ δ) − 1)",
            Style::Line,
            law(&|hz| laws.wire_hz(1, hz)),
        )
        .with(
            "(c) 2 of 16, gates",
            Style::Points,
            measured(&|p| p.wires[2]),
        )
        .with("coincidences", Style::Line, law(&|hz| laws.wire_hz(2, hz)))
        .write(&waves.with_extension("svg"))?;
    let (x, y) = axes("sampled by CLK (1/s)");
    let title = format!(
        "Fig. 22 as the METDC gets it: CLK at {} MHz",
        mega(laws.clk_hz)
    );
    let sampled = |kind| law(&|hz| laws.sampled_hz(kind, hz).expect("it has a closed form"));
    Chart::new(title, x, y.between(1e5, 1e10))
        .with(
            "(d) summation, gates: SPADs",
            Style::Points,
            measured(&|p| p.sampled[0]),
        )
        .with("n m", Style::Line, sampled(FrontEnd::Summation))
        .with(
            "any SPAD: f (1 − (1 − m T)ⁿ)",
            Style::Dashed,
            law(&|hz| any_periods_hz(SPADS, laws.avalanches_hz(hz), laws.clk_hz)),
        )
        .with(
            "(a) OR tree, gates",
            Style::Points,
            measured(&|p| p.sampled[1]),
        )
        .with(
            "(b) XOR tree, gates",
            Style::Points,
            measured(&|p| p.sampled[2]),
        )
        .with(
            "f (1 − (1 − 2 m T)ⁿ) / 2",
            Style::Line,
            sampled(FrontEnd::XorTree),
        )
        .with(
            "(c) 2 of 16, gates",
            Style::Points,
            measured(&|p| p.sampled[3]),
        )
        .write(&waves.with_file_name("tb_front_ends_sampled.svg"))
}

fn view() -> Layout {
    let inside = |kind: FrontEnd, names: &[&str]| -> Vec<Entry> {
        let path = |name: &&str| format!("{}.{name}", kind.name());
        names.iter().map(|name| Entry::hex(path(name))).collect()
    };
    let timed = |kind: FrontEnd| Entry::hex(format!("{}_TIMED", kind.name().to_uppercase()));
    let group = |title: &str, kind, names| {
        Group::new(title, inside(kind, names).into_iter().chain([timed(kind)]))
    };
    Layout {
        groups: vec![
            Group::new(
                "SPADs and clock",
                [Entry::hex("SPAD_RAW"), Entry::binary("CLK")],
            ),
            group(
                "(a) Pulse shapers, OR tree",
                FrontEnd::OrTree,
                &["SHAPED", "WIRE", "joined.TOGGLE"],
            ),
            group(
                "(b) Toggles, XOR tree",
                FrontEnd::XorTree,
                &["TOGGLES", "WIRE"],
            ),
            group(
                "(c) Coincidence, 2 of 16",
                FrontEnd::Coincidence,
                &["SHAPED", "WIRE", "joined.TOGGLE"],
            ),
            group("(d) Synchronous summation", FrontEnd::Summation, &[]),
        ],
        zoom: (BEGIN, BEGIN + Time::from_ns(40)),
        marker: Some(BEGIN),
    }
}
