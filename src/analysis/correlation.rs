//! The photons that excite the longest path from CLK to SPAD_EVENT.
//!
//! ```text
//!   CLK ─► XOR ─► SPAD_TIMED ─► sum of 16 bits ─► COUNT<1> falls ─► bit 1 no longer agrees ─► greater falls
//!                                                                    ─► NOT (equal or greater) rises ─► SPAD_EVENT
//! ```
//!
//! Seven SPADs fire in one CLK period, five others in the next: with TYPE = less and THRESHOLD = 6, SPAD_EVENT
//! must rise, and does so through the whole carry and comparison chain. The sets were found by a search over pairs
//! of SPAD_TIMED words that share no SPAD (none fires in two successive periods: dead time).
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

/// SPADs that fire in one CLK period, and in the next; see the head of this file.
pub const WORST_PHOTONS: [u16; 2] = [0b1101_1100_1001_0000, 0b0010_0011_0000_1001];
const THRESHOLD: u8 = 6;

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
    pub fn of(config: &SensorConfig, silicon: &Silicon, limits: Limits) -> Self {
        const SLOW: Time = Time::from_ns(20);
        CorrelationTiming {
            settled: take(config, silicon, limits, SLOW).map_or(Time::MAX, |taken| taken.settled),
            period: shortest_period(SLOW, |period| {
                take(config, silicon, limits, period).is_some_and(|taken| taken.is_right)
            }),
        }
    }
}

struct Taken {
    settled: Time,
    is_right: bool,
}

fn take(config: &SensorConfig, silicon: &Silicon, limits: Limits, period: Time) -> Option<Taken> {
    const FIRST: i64 = 6;
    let exposure = Exposure {
        clock: Frequency::from_period(period).ok()?,
        stop_phase: Time::ZERO,
        stop_periods: 24,
        laser_cycles: 1,
    };
    let config = SensorConfig {
        clk_hz: exposure.clock.as_hz(),
        event_type: EventType::Less,
        threshold: THRESHOLD,
        ..config.clone()
    };
    let half = Time::from_fs(period.as_fs() / 2);
    let pulses: Vec<SpadEvent> = (FIRST..)
        .zip(WORST_PHOTONS)
        .flat_map(|(edge, word)| {
            (0..16)
                .filter(move |s| word >> s & 1 == 1)
                .map(move |s| (edge, s))
        })
        .map(|(edge, spad)| SpadEvent {
            time: exposure.rising(edge) - half,
            spad,
        })
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
    Some(Taken {
        settled: last.map_or(Time::ZERO, |c| c.0 - launch),
        is_right: is_kept && captured == [Some(false), Some(true)],
    })
}
