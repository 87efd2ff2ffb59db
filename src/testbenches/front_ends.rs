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

mod closed_forms;

use std::path::Path;

use self::closed_forms::{Laws, charts, compare, folds, table};
use crate::chip::{FrontEnd, SensorConfig, front_end};
use crate::engine::waveform::write_waves;
use crate::files::InputError;
use crate::kernel::{Drive, Kernel, Observer, in_order};
use crate::logic::Logic;
use crate::netlist::{Corner, Library, ModuleBuilder, NetId, Netlist, Timing};
use crate::report::Checks;
use crate::testbenches::Testbench;
use crate::theory::front_ends::non_paralysable_hz;
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
        m.input_bus("SPAD_RAW", SPADS as usize);
        m.input("CLK");
        m.input("PIXEL_CLEAR");
        for kind in FrontEnd::ALL {
            let config = config(kind);
            let timed = format!("{}_TIMED", kind.name().to_uppercase());
            let timed = m.wire_bus(&timed, config.lines());
            let ports = [("SPAD_TIMED", &timed[..])];
            m.instance_by_names(kind.name(), &front_end::circuit(&config), &ports);
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
        marks: Vec::new(),
    }
}
