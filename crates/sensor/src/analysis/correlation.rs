//! The photons that excite the longest path from CLK to SPAD_EVENT.
//!
//! ```text
//!   CLK ─► XOR ─► SPAD_TIMED ─► sum of 16 bits ─► COUNT<1> falls ─► bit 1 no longer agrees ─► greater falls
//!                                                                    ─► NOT (equal or greater) rises ─► SPAD_EVENT
//! ```
//!
//! Of 16 SPADs seven fire in one CLK period, five others in the next: with TYPE = less and THRESHOLD = 6, SPAD_EVENT
//! must rise, and does so through the whole carry and comparison chain. The sets were found by a search over pairs
//! of SPAD_TIMED words that share no SPAD (none fires in two successive periods: dead time). With other numbers of SPADs the
//! worst of [`TRIED`] random pairs is taken.
//!
//! The longest path of static timing is longer by two differences between XOR's rise and fall and one of AND's. It is
//! false. It wants a carry of the ones' column to *rise* last: then both bits of its half adder are 1, COUNT<0>
//! is 0, and nothing below bit 1 is greater, so that bit 1 cannot withdraw it. And it wants COUNT<1> to
//! *rise* with THRESHOLD<1> = 0: then bit 1 alone is greater, before its agreement withdraws the lower bits'.

use super::gates::{checks, simulation};
use super::shortest_period;
use crate::chip::{EventType, Exposure, Limits, Probe, SensorConfig, Silicon};
use crate::kernel::Recorder;
use crate::netlist::CheckKind;
use crate::photon::SpadEvent;
use crate::units::{Frequency, Time};

/// What excites a long path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Photons {
    /// SPADs that fire in one CLK period, and in the next.
    fired: [u64; 2],
    /// With TYPE = less, so that the second word makes an event and the first one none.
    threshold: u8,
}

/// The worst of 16 SPADs; see the head of this file.
const WORST_OF_16: Photons = Photons {
    fired: [0b1101_1100_1001_0000, 0b0010_0011_0000_1001],
    threshold: 6,
};

/// Random pairs that are tried with other numbers of SPADs. Chosen: a hundred take half a second.
const TRIED: u32 = 100;

impl Photons {
    /// Any that make an event after none: the `number`-th of a sequence.
    fn random(spads: usize, number: u32) -> Self {
        let word = |at: u32| rand_philox::philox4x32_10([number, at, 0, 0], [0; 2])[0] as usize;
        let threshold = 1 + word(64) % spads;
        let mut left: Vec<u32> = (0..spads as u32).collect();
        left.sort_by_key(|&spad| word(spad));
        let before = threshold + word(65) % (spads - threshold + 1);
        let after = (word(66) % threshold).min(spads - before);
        let mut fired = [0u64; 2];
        for (index, spad) in left.into_iter().take(before + after).enumerate() {
            fired[usize::from(index >= before)] |= 1 << spad;
        }
        let threshold = threshold as u8;
        Photons { fired, threshold }
    }

    /// The worst that is known for this sensor.
    fn worst(config: &SensorConfig, silicon: &Silicon, limits: Limits) -> Self {
        if config.front_end.joins() {
            // One line, which is high after the pulses that make an event, and low again.
            return Photons {
                fired: [(1 << config.spads_of_an_event()) - 1, 0],
                threshold: 1,
            };
        }
        if config.spads() == 16 {
            return WORST_OF_16;
        }
        let settled = |photons: &Photons| {
            let taken = simulate_photons(config, silicon, limits, SLOW, photons);
            taken.map_or(Time::ZERO, |taken| taken.settled)
        };
        let tried = (0..TRIED).map(|number| Photons::random(config.spads(), number));
        tried.max_by_key(settled).expect("some are tried")
    }
}

/// A CLK period that every path is shorter than.
const SLOW: Time = Time::from_ns(20);

/// The correlation path as the event kernel sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CorrelationTiming {
    /// CLK rises → SPAD_EVENT settled.
    pub settled: Time,
    /// Shortest CLK period at which the shift register takes the right event.
    pub period: Option<Time>,
}

impl CorrelationTiming {
    /// Simulates the worst photons at a slow clock, and at ever shorter periods.
    pub fn simulate(config: &SensorConfig, silicon: &Silicon, limits: Limits) -> Self {
        let photons = &Photons::worst(config, silicon, limits);
        let settled = simulate_photons(config, silicon, limits, SLOW, photons);
        CorrelationTiming {
            settled: settled.map_or(Time::MAX, |taken| taken.settled),
            period: shortest_period(SLOW, |period| {
                simulate_photons(config, silicon, limits, period, photons)
                    .is_some_and(|taken| taken.is_right)
            }),
        }
    }
}

struct CorrelationRun {
    settled: Time,
    is_right: bool,
}

fn simulate_photons(
    config: &SensorConfig,
    silicon: &Silicon,
    limits: Limits,
    period: Time,
    photons: &Photons,
) -> Option<CorrelationRun> {
    const FIRST: i64 = 6;
    if config.metdc_block.is_some() {
        // Which of its flip-flops holds an event, and how, is its own.
        return None;
    }
    let exposure = Exposure {
        clock: Frequency::from_period(period).ok()?,
        stop_phase: Time::ZERO,
        stop_periods: 24,
        laser_cycles: 1,
    };
    let config = SensorConfig {
        clk_hz: exposure.clock.as_hz(),
        event_type: EventType::Less,
        threshold: photons.threshold,
        ..config.clone()
    };
    let half = Time::from_fs(period.as_fs() / 2);
    let pulses: Vec<SpadEvent> = (FIRST..)
        .zip(photons.fired)
        .flat_map(|(edge, word)| {
            (0..64)
                .filter(move |s| word >> s & 1 == 1)
                .map(move |s| (edge, s))
        })
        .map(|(edge, spad)| SpadEvent::new(exposure.rising(edge) - half, spad))
        .collect();
    let mut gate = simulation(&config, silicon, &exposure, 2, &pulses);
    let probes = &gate.probes()[0];
    let (event, first) = (probes.net(Probe::SpadEvent), probes.net(Probe::Shift));
    let first_stage = gate
        .netlist()
        .cell_path(probes.shift_cells(gate.netlist())[0]);
    let mut recorder = Recorder::new([event, first]);
    let origin = gate.schedule().origin;
    // The event of edge e is at the shift register's first stage after edge e + 1.
    let stage_after = |recorder: &Recorder, edge: i64| {
        let seen = origin + exposure.rising(edge + 2) - Time::from_fs(1);
        recorder.value_at(first, seen).to_bool()
    };
    let mut checks = checks(silicon, &gate);
    gate.run(&mut (&mut recorder, &mut checks));
    let report = checks.report(gate.netlist());
    let at_first = report.violations.iter().filter(|v| v.cell == first_stage);
    let mut at_first = at_first.filter(|v| matches!(v.kind, CheckKind::Setup | CheckKind::Hold));
    let is_kept = limits == Limits::Ignored || at_first.next().is_none();
    let launch = origin + exposure.rising(FIRST + 1);
    let last = recorder
        .changes()
        .iter()
        .rfind(|(t, net, _)| *net == event && *t < launch + period);
    let captured = [FIRST, FIRST + 1].map(|edge| stage_after(&recorder, edge));
    Some(CorrelationRun {
        settled: last.map_or(Time::ZERO, |c| c.0 - launch),
        is_right: is_kept && captured == [Some(false), Some(true)],
    })
}
