//! Testbench of the P-counter's variants: what each costs, and what the literal reading of the thesis does (4.4, 4.5).
//!
//! ```text
//!   CLK, STOP, ENABLE ─► p_counter_timing ─► p_counter ─ LOCAL_STOP ─┬► metdc, HIT cleared by COUNTER_RESET: the sensor's
//!   COUNTER_INIT, MEMORY_LOAD ─────────────────►                     └► metdc_early, HIT cleared before STOP
//!
//!   four channels:  borrow_hold (the default)   borrow_wrap   msb_wrap (the literal reading)   msb_hold
//! ```
//!
//! A second waveform, `tb_p_counters`, has every variant on the same pins. The first has two scenes. First a start value beyond 255, whose most significant bit is high from the reset
//! on: with the tap `msb` LOCAL_STOP rises at STOP, too, and a METDC that is ready by then counts the tail of the
//! laser cycle before. Then a laser rate of 80 kHz, at which a counter that runs on comes round again and again in each
//! laser cycle.

mod circuit;
mod comparison;
mod memoryless;
mod side_by_side;

use std::path::Path;
use std::sync::Arc;

use self::circuit::{ORIGIN, RESET_END, place_counter};
use crate::chip::{
    AfterBorrow, ChipTiming, Exposure, Irregular, Probe, SensorConfig, Tap, WindowLaw,
    WindowOutcome, metdc,
};
use crate::files::{InputError, OutputFile};
use crate::kernel::Recorder;
use crate::netlist::{Module, ModuleBuilder};
use crate::report::Checks;
use crate::testbenches::Testbench;
use crate::testbenches::rig::{Drives, Rig, finished};
use crate::testbenches::text::{in_a_row, listed};
use crate::units::Time;
use crate::waves::{Entry, Layout, Mark, SignalGroup};

/// The first scene: a start value with its most significant bit high.
const HIGH: Scene = Scene {
    from: 0,
    start: 300,
    stop_periods: 600,
    cycles: 3,
};
/// The second scene: Fig. 48's start value at a laser rate of 80 kHz, 4800 periods of 384 MHz.
const SLOW_LASER: Scene = Scene {
    from: 1820,
    start: 52,
    stop_periods: 4800,
    cycles: 1,
};
/// An event in the tail of each laser cycle of the first scene: CLK edges before STOP.
const TAIL: i64 = 5;
/// An event in each window: CLK edges before the last that it sees.
const BEFORE_END: i64 = 10;

pub(super) const TESTBENCH: Testbench = Testbench {
    name: "tb_p_counter_variants",
    about: "P-counter variants: cost and speed, the tap msb's false capture, the wrapping counter's repeated one",
    run,
    given: None,
};

fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let grid = comparison::compare(checks);
    checks.note(format!(
        "{grid}\n\
        T: transistors. Shares are of the macropixel's transistors, and of their area; the thesis's, below 5 %, is of the layout.\n\
        settled: every net after a count. CLK period: STOP on CLK's fall, setup and hold not counted.\n"
    ));
    let table = waves.with_extension("csv");
    OutputFile::write_with(&table, |out| grid.write_csv(out))?;

    let bench = Bench::new();
    let seen = bench.simulate(waves)?;
    false_capture(&bench, &seen, checks);
    repeated_capture(&bench, &seen, checks);
    memoryless::coming_round(checks);
    side_by_side::run(waves, checks)
}

/// Some laser cycles with one start value.
struct Scene {
    /// CLK period of the first STOP edge.
    from: i64,
    start: i64,
    stop_periods: i64,
    cycles: i64,
}

impl Scene {
    fn stop(&self, cycle: i64) -> i64 {
        self.from + cycle * self.stop_periods
    }

    fn end(&self) -> i64 {
        self.stop(self.cycles)
    }
}

/// The four P-counters that are shown.
const CHANNELS: [(&str, Tap, AfterBorrow); 4] = [
    ("borrow_hold", Tap::Borrow, AfterBorrow::Hold),
    ("borrow_wrap", Tap::Borrow, AfterBorrow::Wrap),
    ("msb_wrap", Tap::Msb, AfterBorrow::Wrap),
    ("msb_hold", Tap::Msb, AfterBorrow::Hold),
];

fn config(tap: Tap, after_borrow: AfterBorrow) -> SensorConfig {
    SensorConfig {
        tap,
        after_borrow,
        ..SensorConfig::default()
    }
}

/// Both METDCs of a channel: HIT cleared by COUNTER_RESET, and before STOP.
const METDCS: [&str; 2] = ["metdc", "metdc_early"];
/// Pins that all channels share, in order of declaration.
const PINS: [&str; 9] = [
    "CLK",
    "STOP",
    "RESETB",
    "ENABLE",
    "MEMORY_LOAD",
    "SPAD_EVENT",
    "CONVENTIONAL",
    "PIXEL_CLEAR",
    "HIT_CLEAR",
];

/// P-counter, timing block and the two METDCs.
fn channel(name: &str, config: &SensorConfig) -> Arc<Module> {
    let mut m = ModuleBuilder::new(name);
    let [.., early_clear] = PINS.map(|name| [m.input(name)]);
    let counter_reset = [place_counter(&mut m, config)];
    for (name, hit_clear) in METDCS.into_iter().zip([&counter_reset, &early_clear]) {
        let metdc = metdc::circuit(config.bins);
        m.instance_by_names(name, &metdc, &[("COUNTER_RESET", hit_clear)]);
    }
    finished(m)
}

/// The four channels side by side, and their clocks.
struct Bench {
    rig: Rig,
    exposure: Exposure,
}

impl Bench {
    fn new() -> Self {
        let bits = SensorConfig::default().counter_bits;
        let mut m = ModuleBuilder::new("tb_p_counter_variants");
        for pin in PINS {
            m.input(pin);
        }
        m.input_bus("COUNTER_INIT", bits);
        for (name, tap, after_borrow) in CHANNELS {
            m.instance_by_names(name, &channel(name, &config(tap, after_borrow)), &[]);
        }
        Bench {
            rig: Rig::new(&finished(m), SensorConfig::default().corner),
            exposure: Exposure::new(&SensorConfig::default(), 2, 1),
        }
    }

    /// Falling CLK edge `period`, with which STOP rises.
    fn falling_clk(&self, period: i64) -> Time {
        ORIGIN + self.exposure.falling(period)
    }

    fn drives(&self) -> Drives {
        let rig = &self.rig;
        let clk = |period| self.falling_clk(period);
        let mut drives = rig.power_up();
        drives.set(Time::ZERO, rig.net("CLK"), true);
        drives.set(RESET_END, rig.net("RESETB"), true);
        drives.pulse(rig.net("PIXEL_CLEAR"), Time::ZERO, RESET_END);
        for scene in [&HIGH, &SLOW_LASER] {
            let load = clk(scene.from) - Time::from_ns(15);
            drives.number(load, &rig.bus("COUNTER_INIT"), scene.start as u64);
            let rise = load + Time::from_ns(2);
            drives.pulse(rig.net("MEMORY_LOAD"), rise, rise + Time::from_ns(2));
            drives.pulse(rig.net("ENABLE"), clk(scene.from), clk(scene.end()));
            for stop in (0..=scene.cycles).map(|cycle| scene.stop(cycle)) {
                drives.pulse(rig.net("STOP"), clk(stop), clk(stop + 10));
                drives.pulse(rig.net("HIT_CLEAR"), clk(stop - 10), clk(stop - 9));
            }
            for edge in events(scene) {
                drives.pulse(rig.net("SPAD_EVENT"), clk(edge), clk(edge + 1));
            }
        }
        let half_periods = (0, 2 * (SLOW_LASER.end() + 40));
        drives.clock(rig.net("CLK"), self.exposure.clock, ORIGIN, half_periods);
        drives
    }

    /// Runs both scenes, with their waveform in `waves`.
    fn simulate(&self, waves: &Path) -> Result<Recorder, InputError> {
        let nets = CHANNELS.iter().flat_map(|(name, ..)| {
            let local_stop = self.rig.bus(&Probe::LocalStop.path(name));
            let hits =
                METDCS.map(|metdc| self.rig.bus(&Probe::Hit.path(&format!("{name}.{metdc}"))));
            hits.into_iter().chain([local_stop])
        });
        let mut recorder = Recorder::new(nets.flatten());
        let end = self.falling_clk(SLOW_LASER.end() + 40);
        let drives = self.drives();
        (self.rig).record(waves, &self.view(), drives, end, &mut recorder)?;
        Ok(recorder)
    }

    fn view(&self) -> Layout {
        let shared = ["CLK", "STOP", "ENABLE", "SPAD_EVENT", "HIT_CLEAR"].map(Entry::binary);
        let mut groups = vec![SignalGroup::new("Global signals", shared)];
        for (name, tap, _) in CHANNELS {
            let [hit, early_hit] =
                METDCS.map(|metdc| Entry::hex(Probe::Hit.path(&format!("{name}.{metdc}"))));
            let signals = [
                Entry::binary(Probe::CounterReset.path(name)),
                Entry::binary(Probe::CounterClk.path(name)),
                Entry::decimal(Probe::CounterOut.path(name)),
                Entry::binary(Probe::LocalStop.path(name)),
                hit,
            ];
            groups.push(SignalGroup::new(format!("P-counter {name}"), signals));
            if tap == Tap::Msb {
                let name = format!("P-counter {name}, HIT cleared before STOP");
                groups.push(SignalGroup::new(name, [early_hit]));
            }
        }
        Layout {
            groups,
            // About the second STOP, where counters that go on or reset show how they differ.
            zoom: (
                self.falling_clk(HIGH.stop(1) - 16),
                self.falling_clk(HIGH.stop(1) + 40),
            ),
            marker: Some(self.falling_clk(HIGH.stop(1))),
            marks: vec![Mark::new(self.falling_clk(HIGH.stop(1)), "STOP")],
        }
    }

    /// Rises of LOCAL_STOP in a scene, from its first STOP edge; the load's own are left out.
    fn rises(&self, seen: &Recorder, channel: &str, scene: &Scene) -> Vec<Time> {
        let from = self.falling_clk(scene.from);
        let rises = seen.rising_edges(self.rig.bus(&Probe::LocalStop.path(channel))[0]);
        let within = rises
            .into_iter()
            .filter(|&t| t > from && t < self.falling_clk(scene.end() + 10));
        within.map(|t| t - from).collect()
    }

    /// Counts that the histogram of a METDC would have after a scene, bin by bin.
    fn counts(&self, seen: &Recorder, metdc: &str, scene: &Scene) -> Vec<usize> {
        let within = |t: &Time| {
            (self.falling_clk(scene.from)..self.falling_clk(scene.end() + 10)).contains(t)
        };
        let hit = self.rig.bus(&Probe::Hit.path(metdc));
        let rises = hit.iter().map(|&net| seen.rising_edges(net));
        rises
            .map(|times| times.iter().filter(|t| within(t)).count())
            .collect()
    }
}

/// CLK edges that take an event.
fn events(scene: &Scene) -> Vec<i64> {
    let mut edges = Vec::new();
    for cycle in 0..scene.cycles {
        let window = scene.stop(cycle) + scene.start - BEFORE_END;
        if scene.from == HIGH.from {
            edges.extend([window, scene.stop(cycle + 1) - TAIL]);
        } else {
            // One in every round, each a bin later than the one before, so that HIT changes.
            let rounds = (0..).map(|round| window + round * (ROUND + 1));
            edges.extend(rounds.take_while(|&edge| edge < scene.end()));
        }
    }
    edges
}

/// Counts after which a counter of nine bits and a borrow comes round.
const ROUND: i64 = 1024;

/// A start value whose most significant bit is high.
fn false_capture(bench: &Bench, seen: &Recorder, checks: &mut Checks) {
    let scene = &HIGH;
    let ripple = |tap| {
        let timing = ChipTiming::new(&config(tap, AfterBorrow::Wrap));
        (timing.ripple(), timing)
    };
    let true_rises = |tap| -> Vec<Time> {
        let edges = (0..scene.cycles).map(|cycle| scene.stop(cycle) + scene.start + 1);
        edges
            .map(|edge| bench.exposure.falling(edge) + ripple(tap).0)
            .collect()
    };
    let (_, timing) = ripple(Tap::Msb);
    let at_reset = timing.stop_to_reset
        + timing
            .counter
            .reset_to_local_stop
            .expect("the tap msb rises at a reset");
    let false_rises =
        (1..=scene.cycles).map(|cycle| bench.exposure.falling(scene.stop(cycle)) + at_reset);
    let mut both = true_rises(Tap::Msb);
    both.extend(false_rises);
    both.sort_unstable();
    let mut last_bin = vec![0; 16];
    last_bin[(15 - BEFORE_END) as usize] = scene.cycles as usize;
    // Strobed at STOP, the newest event is the one before it; HIT is clear again by the next true strobe.
    let mut with_tail = last_bin.clone();
    with_tail[(16 - TAIL) as usize] = scene.cycles as usize;
    let nothing = vec![0; 16];
    let start = scene.start;
    for (channel, rises, counts, early) in [
        ("borrow_hold", true_rises(Tap::Borrow), &last_bin, &last_bin),
        ("borrow_wrap", true_rises(Tap::Borrow), &last_bin, &last_bin),
        ("msb_wrap", both, &last_bin, &with_tail),
        ("msb_hold", vec![], &nothing, &nothing),
    ] {
        let what = format!(
            "{channel}, start {start}, {} laser cycles: LOCAL_STOP rises (ns)",
            scene.cycles
        );
        checks.equal(
            what,
            listed(&rises),
            listed(&bench.rises(seen, channel, scene)),
        );
        let found = bench.counts(seen, &format!("{channel}.metdc"), scene);
        checks.equal(
            format!("{channel}, start {start}: counted, bin by bin"),
            in_a_row(counts),
            in_a_row(&found),
        );
        let found = bench.counts(seen, &format!("{channel}.metdc_early"), scene);
        let what = format!("{channel}, start {start}: counted where HIT is not in reset at STOP");
        checks.equal(what, in_a_row(early), in_a_row(&found));
    }
    let arrival = at_reset + timing.local_stop_to_strobe;
    checks.add_verdict(
        "the false strobe comes while the sensor's HIT is still in reset, after STOP",
        format!("before {}", timing.stop_to_hit_release),
        arrival,
        arrival + timing.removal < timing.stop_to_hit_release,
    );
}

/// A laser cycle of 4800 CLK periods.
fn repeated_capture(bench: &Bench, seen: &Recorder, checks: &mut Checks) {
    let scene = &SLOW_LASER;
    for (channel, tap, after_borrow) in CHANNELS {
        let config = config(tap, after_borrow);
        let timing = ChipTiming::new(&config);
        let every = match (after_borrow, tap) {
            (AfterBorrow::Hold, _) => i64::MAX,
            (AfterBorrow::Wrap, Tap::Borrow) => ROUND,
            (AfterBorrow::Wrap, Tap::Msb) => ROUND / 2,
        };
        let edges = (scene.start + 1..scene.stop_periods).step_by(every as usize);
        let expected: Vec<Time> = edges
            .map(|edge| bench.exposure.falling(edge) + timing.ripple())
            .collect();
        let found = bench.rises(seen, channel, scene);
        let what = format!(
            "{channel} at 80 kHz, start {}: LOCAL_STOP rises in a laser cycle (ns)",
            scene.start
        );
        checks.equal(what, listed(&expected), listed(&found));
        let counted = bench.counts(seen, &format!("{channel}.metdc"), scene);
        let what = format!(
            "{channel} at 80 kHz: counted of {} events, 1 of them in the window",
            events(scene).len()
        );
        let expected = if after_borrow == AfterBorrow::Hold {
            1
        } else {
            events(scene).len()
        };
        checks.equal(what, expected, counted.iter().sum());
        let exposure = Exposure::new(&config, scene.stop_periods as u32, 1);
        let law = match WindowLaw::new(&config, &exposure).window(scene.start as u16) {
            WindowOutcome::Open(_) => "one window".to_owned(),
            WindowOutcome::Irregular(Irregular::LocalStopRepeats { .. }) => {
                "LOCAL_STOP rises more than once in a laser cycle".to_owned()
            }
            other => format!("{other:?}"),
        };
        let expected = match after_borrow {
            AfterBorrow::Hold => "one window",
            AfterBorrow::Wrap => "LOCAL_STOP rises more than once in a laser cycle",
        };
        checks.equal(
            format!("{channel} at 80 kHz: the window law says"),
            expected,
            &law,
        );
    }
}
