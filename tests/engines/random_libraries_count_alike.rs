//! In the cells of any library, the fast engines count what the gates count, or refuse start values whose signals really meet.
//!
//! Random libraries, P-counters, start values and photons; clocks and STOP phases lie in and around every band in which two
//! signals meet, down to the femtosecond. `GDTOF_CASES=10000 cargo test --release --test engines random_libraries` runs more.

use std::collections::BTreeMap;
use std::path::Path;

use crate::cases::cases;
use crate::scenario::{self, Scenario, p_counters};
use guided_dtof::chip::race::{Conflict, Race};
use guided_dtof::chip::window_law::WindowLaw;
use guided_dtof::chip::{Exposure, Mode, Probe, Sensor, SensorConfig, Tdc};
use guided_dtof::engine::{
    Cycle, EngineError, Gate, GateSimulation, PulsedPixel, Replay, Runner, Timed, Window,
};
use guided_dtof::kernel::Recorder;
use guided_dtof::photon::{SpadEvent, apply_dead_time};
use guided_dtof::units::Time;
use guided_dtof_sensor::strategies::library_of;
use rand::{RngExt, SeedableRng, rngs::StdRng};

/// Chips made of one library.
const CHIPS_OF_A_LIBRARY: u32 = 10;

/// Chips that engines counted otherwise, or refused without need, once: strobes of STOP before HIT is ready, load pulses longer than
/// COUNTER_INIT stays, resets too short for HIT or for a count on its way, COUNTER_RESET of the first laser cycle alone, HIT too short for
/// its bin, parities of Gray counters that change before the bits that sample them, a count after the exposure, flip-flops that rise and
/// fall at different speeds.
const FOUND: [u32; 17] = [
    584, 1042, 1584, 1743, 1821, 1826, 2010, 2071, 2154, 2580, 2956, 4439, 4657, 5203, 5603, 6021,
    7293,
];

/// What became of the cases.
#[derive(Debug, Default)]
struct Tally {
    counted: usize,
    refused: usize,
    irregular: usize,
    unbuildable: usize,
    conflicts: BTreeMap<Conflict, usize>,
    /// By engine or conflict: how many failed, and the first that did.
    failures: BTreeMap<String, (usize, String)>,
}

impl Tally {
    fn fail(&mut self, what: String, case: impl FnOnce() -> String) {
        let failure = self.failures.entry(what);
        failure.or_insert_with(|| (0, case())).0 += 1;
    }
}

#[test]
fn as_the_gates_count() {
    let mut tally = Tally::default();
    let folder = tempfile::tempdir().unwrap();
    for seed in (0..cases(30)).chain(FOUND) {
        let library = seed / CHIPS_OF_A_LIBRARY;
        let file = folder.path().join(format!("{library}.lib"));
        if !file.exists() {
            let random = &mut StdRng::seed_from_u64(1_000_000 + u64::from(library));
            std::fs::write(&file, library_of(|| random.random_range(0.0..1.0))).unwrap();
        }
        compare(seed, &file, &mut tally);
    }
    let Tally {
        counted,
        refused,
        unbuildable,
        ..
    } = tally;
    assert!(tally.failures.is_empty(), "{tally:#?}");
    println!("{tally:?}");
    assert!(
        counted > 2 * unbuildable && counted > refused / 2,
        "{tally:?}"
    );
}

/// A chip of this library, at its speed.
fn sensor_of(random: &mut StdRng, file: &Path) -> SensorConfig {
    let p_counters = p_counters();
    let (p_counter, tap, after_borrow) = p_counters[random.random_range(0..p_counters.len())];
    let has_memory = p_counter.row().has_memory;
    // Few SPADs leave the correlation time at the clocks at which the strobe meets the shift register.
    let (spad_rows, spad_cols) = [(1, 1), (1, 2), (2, 2), (4, 4)][random.random_range(0..4)];
    SensorConfig {
        rows: 1,
        cols: 8,
        spad_rows,
        spad_cols,
        p_counter,
        tap,
        after_borrow,
        step_periods: if has_memory {
            [1, 1, 2][random.random_range(0..3)]
        } else {
            1
        },
        counter_bits: random.random_range(3..10),
        bins: random.random_range(2..17),
        bin_bits: 6,
        tdc: if random.random_bool(0.2) {
            Tdc::Counter
        } else {
            Tdc::Clocked
        },
        reset_stages: if random.random_bool(0.2) {
            random.random_range(1..12)
        } else {
            0
        },
        mode: if random.random_bool(0.1) {
            Mode::Conventional
        } else {
            Mode::Guided
        },
        liberty: file.to_owned(),
        clk_hz: 10e6,
        dead_time_ns: 400.0,
        ..SensorConfig::default()
    }
}

/// Puts CLK and STOP's phase in or near a band where signals meet.
fn aim_at_a_band(random: &mut StdRng, config: &mut SensorConfig) {
    let slow = WindowLaw::new(&*config, &Exposure::new(config, 600, 1));
    let timing = *slow.timing();
    let start = random.random_range(0..=config.largest_start());
    let strobe = slow.ripple(start) + timing.local_stop_to_strobe - timing.clk_to_shift;
    let odd = [1, 1, 1, 3, 5][random.random_range(0..5)];
    let limits = [Time::ZERO, timing.setup, Time::ZERO - timing.hold];
    let near = strobe - limits[random.random_range(0..3)];
    let off = match random.random_range(0..4) {
        0 => 0,
        1 => random.random_range(-4..5),
        2 => random.random_range(-20_000..20_000),
        _ => random.random_range(-400_000..400_000),
    };
    let in_band = Time::from_fs(2 * (near.as_fs() + off) / odd);
    let shortest = timing.clk_period.max(timing.clk_to_event + timing.setup);
    let period = if in_band > shortest || random.random_bool(0.1) {
        in_band
    } else {
        Time::from_s(shortest.as_s() * random.random_range(0.99..3.0))
    };
    let period = period.max(Time::from_ps(500)).min(Time::from_ns(900));
    config.clk_hz = 1.0 / period.as_s();
    let half_ps = period.as_s() * 1e12 / 2.0;
    config.stop_phase_ps = match random.random_range(0..3) {
        0 => 0.0,
        1 => random.random_range(-half_ps..half_ps),
        // A COUNTER_CLK edge near the end of the reset pulse.
        _ => {
            let meets = timing.clk_to_counter_clk - timing.stop_to_reset_release;
            let fs = meets.as_fs() + off;
            let half = period.as_fs() / 2;
            ((fs + half).rem_euclid(period.as_fs()) - half) as f64 * 1e-3
        }
    };
    config.stop_phase_ps = config
        .stop_phase_ps
        .clamp(-0.499 * 2.0 * half_ps, 0.499 * 2.0 * half_ps);
    config.dead_time_ns = (period.as_s() * 1e9 * 1.3).max(60.0);
}

/// Some photons anywhere and, of each open window, pairs beside its edges.
fn add_photons_at_edges(scenario: &mut Scenario, law: &WindowLaw) {
    let pixels = scenario.starts.iter().zip(&mut scenario.pulses);
    for (&start, pulses) in pixels {
        let Some(window) = law.window(start).open() else {
            continue;
        };
        for cycle in 0..i64::from(scenario.exposure.laser_cycles) {
            let edges = law.edges(&window, cycle);
            for (place, &edge) in edges.edges().iter().enumerate() {
                let spad = (place % scenario.config.spads()) as u8;
                let off = Time::from_fs([-1, 0][(place + cycle as usize) % 2]);
                let time = edge + off;
                if (Time::ZERO..scenario.exposure.end()).contains(&time) {
                    pulses.push(SpadEvent { time, spad });
                }
            }
        }
        pulses.sort_unstable();
        apply_dead_time(pulses, &scenario.config.spad_model(), 0);
    }
}

fn compare(seed: u32, file: &Path, tally: &mut Tally) {
    let random = &mut StdRng::seed_from_u64(seed.into());
    let mut config = sensor_of(random, file);
    if config.check().is_err() {
        tally.unbuildable += 1;
        return;
    }
    aim_at_a_band(random, &mut config);
    if config.check().is_err() {
        tally.unbuildable += 1;
        return;
    }
    let mut scenario = scenario::of_sensor(random, config);
    let law = WindowLaw::new(&scenario.config, &scenario.exposure);
    add_photons_at_edges(&mut scenario, &law);
    let Scenario {
        config,
        exposure,
        starts,
        ..
    } = &scenario;
    let all_pulses = scenario.pulses();
    let gates = Gate::new(config, exposure).histograms(starts, &all_pulses);
    let silicon = Sensor::from(config);
    let timed = Timed::new(&silicon, exposure, Runner::Window);
    for (place, (&start, pulses)) in starts.iter().zip(&all_pulses).enumerate() {
        let name = || format!("seed {seed}, start {start}, {config:?} {exposure:?}");
        let counted = gates.as_ref().map(|gates| gates[place].to_vec());
        match Window::new(config, exposure).histogram(start, pulses) {
            Ok(window) => {
                if Ok(&window) != counted.as_ref() {
                    tally.fail("window".into(), || {
                        format!("{window:?} {counted:?} {}", name())
                    });
                }
                tally.counted += 1;
            }
            Err(EngineError::Race { race, .. }) => {
                let case = (config, exposure, start);
                if !really_meet(case, pulses, &law, &race) {
                    tally.fail(format!("{:?}", race.what), || format!("{race}, {}", name()));
                }
                tally.refused += 1;
                *tally.conflicts.entry(race.what).or_default() += 1;
            }
            Err(EngineError::Irregular(_)) => tally.irregular += 1,
            Err(other) => tally.fail(other.to_string(), name),
        }
        if let Ok(cycle) = Cycle::new(config, exposure).histogram(start, pulses)
            && Ok(&cycle) != counted.as_ref()
        {
            tally.fail("cycle".into(), || {
                format!("{cycle:?} {counted:?} {}", name())
            });
        }
        let pixel = PulsedPixel {
            number: place as u32,
            start,
            pulses,
        };
        if let (Ok(timed), Ok(counted)) = (timed.replay(&[pixel]), &counted)
            && &timed[0] != counted
        {
            tally.fail("timed".into(), || {
                format!("{:?} {counted:?} {}", &timed[0], name())
            });
        }
    }
}

/// Whether the gates show the signals of a race as close as it says.
fn really_meet(
    (config, exposure, start): (&SensorConfig, &Exposure, u16),
    pulses: &[SpadEvent],
    law: &WindowLaw,
    race: &Race,
) -> bool {
    let period = exposure.clock.period();
    let mut gate = GateSimulation::new(config, exposure, (0, 0), (1, 1), &[start], &[pulses]);
    let probes = gate.probes()[0].clone();
    let net = |probe| probes.net(probe);
    let always = [
        Probe::CounterReset,
        Probe::CounterClk,
        Probe::LocalStop,
        Probe::Clk,
        Probe::Strobe,
        Probe::HitReset,
        Probe::Stop,
    ];
    let own = [Probe::Block, Probe::Start];
    let own = own.into_iter().filter_map(|probe| probes.find(probe));
    let watched: Vec<_> = always
        .map(net)
        .into_iter()
        .chain(own.map(|nets| nets[0]))
        .collect();
    let mut recorder = Recorder::new(watched);
    let origin = gate.schedule().origin;
    gate.run(&mut recorder);
    let timing = law.timing();
    let rises = |probe| {
        let all = recorder.rising_edges(net(probe)).into_iter();
        all.map(move |time| time - origin)
            .filter(|&time| time >= Time::ZERO)
            .collect::<Vec<_>>()
    };
    let falls = |probe| {
        let all = recorder.falling_edges(net(probe)).into_iter();
        all.map(move |time| time - origin)
            .filter(|&time| time >= Time::ZERO)
            .collect::<Vec<_>>()
    };
    let near = Time::from_fs(6);
    // Whether an edge of one list comes from `before` before one of the other list to `after` after it.
    let close = |edges: &[Time], others: &[Time], before: Time, after: Time| {
        others.iter().any(|&other| {
            let mut edges = edges.iter();
            edges.any(|&edge| other - before - near <= edge && edge <= other + after + near)
        })
    };
    match race.what {
        Conflict::SlowCorrelation | Conflict::SlowCounter | Conflict::SlowPath => {
            period <= race.comes
        }
        // A strobe within the limits of a change of the shift register.
        Conflict::StrobeAtShift | Conflict::ShiftAtStrobe => {
            let changes = rises(Probe::Clk)
                .into_iter()
                .map(|clk| clk + timing.clk_to_shift);
            let changes: Vec<Time> = changes.collect();
            rises(Probe::Strobe).iter().any(|&strobe| {
                let mut changes = changes.iter();
                changes.any(|&change| {
                    change - timing.hold - near <= strobe && strobe <= change + timing.setup + near
                })
            })
        }
        Conflict::ClkAtResetEnd => {
            let counter = &timing.counter;
            let edges = falls(Probe::Clk)
                .into_iter()
                .map(|clk| clk + timing.clk_to_counter_clk);
            let edges: Vec<Time> = edges.collect();
            let resets = rises(Probe::CounterReset)
                .into_iter()
                .zip(falls(Probe::CounterReset));
            resets.into_iter().any(|(rise, fall)| {
                let from = fall - counter.removal - near;
                let released = fall + counter.release + counter.recovery;
                let until = released.max(rise + counter.settle) + near;
                edges.iter().any(|&edge| from <= edge && edge <= until)
            })
        }
        Conflict::ShortReset => {
            let resets = rises(Probe::CounterReset)
                .into_iter()
                .zip(falls(Probe::CounterReset));
            resets
                .into_iter()
                .all(|(rise, fall)| fall - rise < timing.counter.reset_need)
        }
        Conflict::CutPulse => {
            let pulses = rises(Probe::CounterClk)
                .into_iter()
                .zip(falls(Probe::CounterClk));
            pulses
                .into_iter()
                .any(|(rise, fall)| fall - rise <= timing.counter.clock_high + near)
        }
        // START is data of CLK here.
        Conflict::StartAtClk => {
            let (starts, clks) = (rises(Probe::Start), rises(Probe::Clk));
            close(&starts, &clks, timing.setup, timing.hold)
        }
        Conflict::StartFallsAtClk => {
            let (starts, clks) = (falls(Probe::Start), rises(Probe::Clk));
            close(&starts, &clks, timing.setup, timing.hold)
        }
        // STOP strobes before it has released HIT.
        Conflict::StrobeAtReset if config.mode == Mode::Conventional => close(
            &rises(Probe::Strobe),
            &falls(Probe::HitReset),
            race.comes,
            timing.recovery,
        ),
        // A strobe while HIT is in reset, or too soon after.
        Conflict::StrobeAtReset => {
            let strobes = rises(Probe::Strobe);
            let resets = rises(Probe::HitReset);
            let width = timing.stop_to_hit_release - timing.stop_to_hit_reset;
            let before = timing.strobe_to_hit + timing.hit_high;
            close(&strobes, &resets, before, width + timing.recovery)
        }
        Conflict::ClkAtEnable => {
            let pulse = timing.counter.clock_high + timing.clk_to_counter_clk;
            close(&rises(Probe::Clk), &falls(Probe::Block), pulse, pulse)
        }
        Conflict::ResetStrobeAtHitReset => {
            let (strobes, stops) = (rises(Probe::Strobe), rises(Probe::Stop));
            // The law does not ask whether LOCAL_STOP is high already, so that nothing rises.
            let next = |edges: &[Time], stop: Time| edges.iter().copied().find(|&t| t >= stop);
            let (ls_rises, ls_falls) = (rises(Probe::LocalStop), falls(Probe::LocalStop));
            let was_high = |&stop: &Time| match (next(&ls_falls, stop), next(&ls_rises, stop)) {
                (Some(fall), Some(rise)) => fall < rise,
                (_, rise) => rise.is_none(),
            };
            close(&strobes, &stops, Time::ZERO - race.comes, race.comes)
                || stops.iter().any(was_high)
        }
        // Of the cells alone, swallowed by the reset, or a count too early or late: no two edges show it.
        Conflict::InitAtLoadPulse
        | Conflict::BrokenHold
        | Conflict::StrobeAtNextReset
        | Conflict::LocalStopAtEnable => true,
        other => unreachable!("{other}"),
    }
}
