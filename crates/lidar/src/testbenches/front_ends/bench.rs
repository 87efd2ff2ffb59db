//! All front ends on the same SPADs, and what each counts in a light.

use crate::chip::{FrontEnd, SensorConfig, front_end};
use crate::kernel::Observer;
use crate::logic::Logic;
use crate::netlist::{Corner, ModuleBuilder, NetId};
use crate::testbenches::rig::{Drives, Rig, finished};
use crate::theory::front_ends::non_paralysable_hz;
use crate::units::{Frequency, Time};
use crate::waves::{Entry, Layout, SignalGroup};
use rand_philox::{philox4x32_10, u32_to_unit_f64};

/// SPADs of a macropixel.
pub(super) const SPADS: u32 = 16;
/// SPADs that make a coincidence.
pub(super) const TOGETHER: u32 = 2;
/// Dead time, and width of SPAD_RAW, ns.
pub(super) const DEAD_TIME_NS: f64 = 5.0;
/// Avalanches at each rate: a standard error of 1.6 % and less.
const AVALANCHES: f64 = 4_000.0;
/// Rates a decade.
pub(super) const STEPS: i32 = 6;
/// When the flip-flops are out of their reset.
pub(super) const BEGIN: Time = Time::from_ns(20);
/// All front ends on the same SPADs.
pub(super) struct Bench {
    pub(super) config: SensorConfig,
    pub(super) rig: Rig,
}

impl Bench {
    pub(super) fn new() -> Self {
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
        Bench {
            config: config(FrontEnd::OrTree),
            rig: Rig::new(&finished(m), Corner::Typ),
        }
    }

    pub(super) fn clock(&self) -> Frequency {
        self.config.clock()
    }

    /// Pulses of all SPADs in this light from `BEGIN` to `end`.
    fn drive_pulses(&self, drives: &mut Drives, photons_hz: f64, end: Time) {
        let dead = self.config.dead_time();
        for (spad, net) in (0..).zip(self.rig.bus("SPAD_RAW")) {
            // A SPAD that has been lit for long is as likely to be dead as ever: the first pulses are drawn, not driven.
            let mut time = BEGIN - dead * 20;
            for number in 0.. {
                let word = philox4x32_10(
                    [number, spad, libm::log2(photons_hz).to_bits() as u32, 0],
                    [22, 0],
                )[0];
                time += Time::from_s(-libm::log(u32_to_unit_f64(word)) / photons_hz);
                if time >= end {
                    break;
                }
                if time >= BEGIN {
                    drives.pulse(net, time, time + dead);
                }
                time += dead;
            }
        }
    }

    /// Runs all front ends until `end`.
    pub(super) fn simulate(&self, photons_hz: f64, end: Time, observer: &mut dyn Observer) {
        let mut drives = Drives::low(self.rig.bus("SPAD_RAW"));
        self.drive_pulses(&mut drives, photons_hz, end);
        let cleared = BEGIN - Time::from_ns(2);
        drives.pulse(self.rig.net("PIXEL_CLEAR"), Time::ZERO, cleared);
        let ticks = self.clock().ticks(0).take_while(|&tick| tick < end);
        let edges = (0, ticks.count() as i64);
        drives.clock(self.rig.net("CLK"), self.clock(), Time::ZERO, edges);
        self.rig.run(drives, end, observer);
    }

    /// Counts of all front ends in this light.
    pub(super) fn count(&self, photons_hz: f64) -> RatePoint {
        let avalanches_hz = non_paralysable_hz(photons_hz, DEAD_TIME_NS * 1e-9);
        let seconds = AVALANCHES / (f64::from(SPADS) * avalanches_hz);
        let mut counter = Counter::new(self);
        self.simulate(photons_hz, BEGIN + Time::from_s(seconds), &mut counter);
        let hz = |count: u64| count as f64 / seconds;
        RatePoint {
            photons_hz,
            seconds,
            avalanches: hz(counter.avalanches),
            wires: counter.wires.map(hz),
            sampled: counter.sampled.map(hz),
        }
    }
}

/// What was counted at one rate, 1/s.
pub(super) struct RatePoint {
    pub(super) photons_hz: f64,
    /// How long.
    pub(super) seconds: f64,
    /// Of all SPADs.
    pub(super) avalanches: f64,
    /// By [`WIRES`].
    pub(super) wires: [f64; 3],
    /// By [`FrontEnd::ALL`].
    pub(super) sampled: [f64; 4],
}

/// Front ends with a wire, and whether its falls are counted, too.
pub(super) const WIRES: [(FrontEnd, bool); 3] = [
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
        let mut roles = vec![None; bench.rig.netlist.net_count()];
        let mut watch = |path: &str, role| {
            for net in bench.rig.bus(path) {
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

/// What the waveform shows first.
pub(super) fn view() -> Layout {
    let inside = |kind: FrontEnd, names: &[&str]| -> Vec<Entry> {
        let path = |name: &&str| format!("{}.{name}", kind.name());
        names.iter().map(|name| Entry::hex(path(name))).collect()
    };
    let timed = |kind: FrontEnd| Entry::hex(format!("{}_TIMED", kind.name().to_uppercase()));
    let group = |title: &str, kind, names| {
        SignalGroup::new(title, inside(kind, names).into_iter().chain([timed(kind)]))
    };
    let groups = vec![
        SignalGroup::new(
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
    ];
    Layout::new(groups, (BEGIN, BEGIN + Time::from_ns(40)), BEGIN)
}
