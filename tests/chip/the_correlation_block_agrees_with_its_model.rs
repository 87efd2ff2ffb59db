//! The correlation block, elaborated alone, compares every number of SPADs with every threshold as the plain-Rust model beside it does.

use crate::bench;

use bench::{Bench, SETTLING};
use guided_dtof::chip::{ChipTiming, EventType, SensorConfig, correlation, count_bits};
use guided_dtof::kernel::{LaneDrive, LaneKernel, Lanes};
use guided_dtof::logic::Logic;
use guided_dtof::netlist::{Corner, Edge, Library, NetId, Netlist, StaticTiming, Timing};
use guided_dtof::units::Time;

/// TYPE as the circuit decodes it, all four codes.
const TYPES: [EventType; 4] = [
    EventType::Less,
    EventType::Equal,
    EventType::Greater,
    EventType::Greater,
];

/// Drives one condition after the other and returns the longest time that SPAD_EVENT took to settle.
fn correlate(
    spads: usize,
    corner: Corner,
    conditions: impl Iterator<Item = (u64, u8, u8)>,
) -> Time {
    let mut bench = Bench::new(&correlation::circuit(spads), corner);
    let timing = bench.timing();
    // That of 16 SPADs; a tree of 64 adds two levels and bits.
    let step = timing.clk_to_event * if spads > 16 { 2 } else { 1 };
    let conditions: Vec<_> = conditions.collect();
    let edge_time = |k: usize| SETTLING + step * k as i64;
    for (k, &(timed, code, threshold)) in conditions.iter().enumerate() {
        bench.number(edge_time(k), "SPAD_TIMED", timed);
        bench.number(edge_time(k), "TYPE", code as u64);
        bench.number(edge_time(k), "THRESHOLD", threshold as u64);
    }
    let event = bench.net("SPAD_EVENT");
    let mut run = bench.start(&["SPAD_EVENT"]);
    for (k, &(timed, code, threshold)) in conditions.iter().enumerate() {
        let expected = correlation::model(timed, TYPES[code as usize], threshold);
        let found = run.is_high_at(edge_time(k + 1) - Time::from_fs(1), event);
        assert_eq!(
            found,
            Some(expected),
            "{spads}: {timed:#x} {code} {threshold}"
        );
    }
    let taken = |&(time, ..): &(Time, NetId, Logic)| {
        let since = (time - SETTLING).as_fs().max(0);
        Time::from_fs(since % step.as_fs())
    };
    let slowest = run.recorder.changes().iter().map(taken).max();
    let netlist = Netlist::elaborate(&correlation::circuit(spads));
    let starts = netlist.inputs().into_iter();
    let starts: Vec<_> = starts
        .flat_map(|net| Edge::BOTH.map(|edge| (net, edge)))
        .collect();
    let timing = Timing::nominal(&netlist, &Library::generic_40nm(), corner);
    let arrivals = StaticTiming::new(&netlist, &timing)
        .arrivals(&starts, &[])
        .unwrap();
    let (_, longest) = arrivals.window(netlist.net("SPAD_EVENT").unwrap()).unwrap();
    let slowest = slowest.unwrap_or(Time::ZERO);
    assert!(
        slowest <= longest && longest < step,
        "{slowest} {longest} {step}"
    );
    slowest
}

#[test]
fn the_correlation_block_counts_every_pattern_of_spads() {
    // Neighbours in this order differ in about half their bits; type and threshold go through all pairs.
    let conditions = (0..1u32 << 16).map(|i| {
        let timed = u64::from(i.wrapping_mul(0x9e37) as u16);
        (timed, (i % 4) as u8, (i / 4 % 32) as u8)
    });
    let slowest = correlate(16, Corner::Typ, conditions);
    assert!(slowest > Time::ZERO);
}

/// All words, types and thresholds, also those that nothing meets: 64 words at once, which differ in the first six SPADs.
/// The others change one at a time, and thresholds and types run while they rest, so that little changes from one condition
/// to the next.
#[test]
fn the_correlation_block_compares_every_word_by_every_type_with_every_threshold() {
    const THRESHOLDS: u8 = 18;
    let netlist = Netlist::elaborate(&correlation::circuit(16));
    let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
    let bus = |path: &str| netlist.signal(path).unwrap();
    let (timed, code, threshold) = (bus("SPAD_TIMED"), bus("TYPE"), bus("THRESHOLD"));
    let event = netlist.net("SPAD_EVENT").unwrap();
    let step = ChipTiming::new(&SensorConfig::default()).clk_to_event;
    let mut kernel = LaneKernel::new(&netlist, &timing);
    let mut now = Time::ZERO;
    let (mut compared, mut met) = (0u64, [0u64; 3]);
    for upper in (0..1u64 << 10).map(|k| k ^ k >> 1) {
        for t in 0..THRESHOLDS {
            for (kind, event_type) in TYPES.into_iter().take(3).enumerate() {
                let bits = |nets: &[NetId], number: u64| -> Vec<(NetId, u64)> {
                    let all = |bit: usize| if number >> bit & 1 == 1 { u64::MAX } else { 0 };
                    nets.iter()
                        .enumerate()
                        .map(|(bit, &net)| (net, all(bit)))
                        .collect()
                };
                let lanes =
                    |bit: usize| (0..64).fold(0, |word, lane| word | (lane >> bit & 1) << lane);
                let lower = timed[..6].iter().enumerate();
                let values = lower
                    .map(|(bit, &net)| (net, lanes(bit)))
                    .chain(bits(&timed[6..], upper))
                    .chain(bits(&code, kind as u64))
                    .chain(bits(&threshold, t.into()));
                let drives: Vec<LaneDrive> = values
                    .map(|(net, values)| LaneDrive {
                        time: now,
                        net,
                        mask: u64::MAX,
                        values: Lanes::from_bits(values),
                    })
                    .collect();
                now += step;
                kernel
                    .run(
                        &mut drives.into_iter().peekable(),
                        now - Time::from_fs(1),
                        &mut (),
                    )
                    .unwrap();
                let expected = (0..64).fold(0, |word, lane| {
                    let is_met = correlation::model(upper << 6 | lane, event_type, t);
                    word | u64::from(is_met) << lane
                });
                assert_eq!(
                    kernel.value(event),
                    Lanes::from_bits(expected),
                    "{upper:#x} {event_type:?} {t}"
                );
                compared += 64;
                met[kind] += u64::from(expected.count_ones());
            }
        }
    }
    assert_eq!(compared, (1 << 16) * 3 * u64::from(THRESHOLDS));
    // A word of c SPADs is fewer than the 17 − c thresholds above c, exactly one of them, and more than c.
    let words = 1u64 << 16;
    let fired = words * 8;
    assert_eq!(met, [words * 17 - fired, words, fired]);
}

#[test]
fn the_correlation_block_compares_every_count_with_every_threshold() {
    for (spads, corner) in [1, 2, 4, 16, 64]
        .into_iter()
        .zip(Corner::ALL.into_iter().cycle())
    {
        let all = u64::MAX >> (64 - spads);
        let thresholds = 1 << count_bits(spads);
        let conditions = (0..=spads as u32).flat_map(|count| {
            let timed = ((1u128 << count) - 1) as u64;
            (0..4 * thresholds as u32).map(move |c| {
                let by = c % spads as u32;
                let turned =
                    (timed << by | timed.checked_shr(spads as u32 - by).unwrap_or(0)) & all;
                (turned, (c % 4) as u8, (c / 4) as u8)
            })
        });
        correlate(spads, corner, conditions);
    }
}
