//! Every variant of the P-counter, elaborated alone and driven at random, counts as its plain-Rust model does and
//! raises LOCAL_STOP at the femtosecond that static timing says.

use crate::{bench, scenario};

use bench::{Bench, SETTLING, corners};
use guided_dtof::chip::p_counter::{self, starts_high};
use guided_dtof::chip::{AfterBorrow, ChipTiming, PCounter, Probe, Probes, SensorConfig, Tap};
use guided_dtof::kernel::Recorder;
use guided_dtof::logic::Logic::One;
use guided_dtof::netlist::{CellKind, Corner};
use guided_dtof::units::Time;
use proptest::prelude::*;

/// What is done to a P-counter.
#[derive(Debug, Clone)]
enum Action {
    /// A new start value, with COUNTER_RESET held as the timing block holds it.
    Load(u16),
    /// A COUNTER_RESET pulse.
    Reset,
    /// Edges of COUNTER_CLK this many ps apart.
    Clocks(u16, i64),
}

fn actions() -> impl Strategy<Value = Vec<Action>> {
    let action = prop_oneof![
        1 => any::<u16>().prop_map(Action::Load),
        2 => Just(Action::Reset),
        4 => (0u16..40, 300i64..3_000).prop_map(|(n, gap)| Action::Clocks(n, gap)),
        1 => (0u16..3_000, 300i64..600).prop_map(|(n, gap)| Action::Clocks(n, gap)),
    ];
    prop::collection::vec(action, 1..12)
}

fn sensors() -> impl Strategy<Value = SensorConfig> {
    let p_counter = prop::sample::select(PCounter::ALL.to_vec());
    let tap = prop::sample::select(Tap::ALL.to_vec());
    let after_borrow = prop::sample::select(AfterBorrow::ALL.to_vec());
    let step_periods = prop::sample::select(vec![1usize, 1, 2, 4, 8]);
    let sensor =
        |(p_counter, tap, after_borrow, step_periods, counter_bits, corner)| SensorConfig {
            step_periods,
            p_counter,
            tap,
            after_borrow,
            counter_bits,
            corner,
            ..SensorConfig::default()
        };
    (
        p_counter,
        tap,
        after_borrow,
        step_periods,
        2usize..13,
        corners(),
    )
        .prop_map(sensor)
        .prop_filter("possible", |sensor| sensor.check().is_ok())
}

/// What lies between the last flip-flop and LOCAL_STOP: a rise that has left the flip-flop comes, whatever is reset
/// behind it.
fn behind_the_last_flip_flop(bench: &Bench) -> Time {
    let (mut net, mut behind) = (bench.net("LOCAL_STOP"), Time::ZERO);
    loop {
        let mut cells = bench.netlist.cells().iter();
        let driver = cells.find(|cell| cell.outputs.contains(&Some(net)));
        let driver = driver.expect("LOCAL_STOP has a driver");
        if driver.kind.is_flip_flop() {
            return behind;
        }
        behind += bench.delay(driver.kind, 0, One);
        net = driver.input(0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// Clock edges are closer together than the ripple is long, and resets come while it is under way: the pauses
    /// before them are often shorter than it, too.
    #[test]
    fn count_by_count(
        config in sensors(),
        first in any::<u16>(),
        actions in actions(),
        pauses in prop::collection::vec(1i64..2_500, 12),
    ) {
        let mut bench = Bench::new(&p_counter::circuit(&config), config.corner);
        bench.config = config.clone();
        let timing = bench.timing();
        let counter = timing.counter;
        let pulse = timing.stop_to_reset_release - timing.stop_to_reset;
        let has_memory = config.p_counter.row().has_memory;
        // After a reset, how long until a count may come.
        let ready = (counter.release + counter.recovery).max(counter.settle - pulse);
        bench.drive(Time::ZERO, "MEMORY_RESET", true);
        bench.drive(Time::ZERO, "COUNTER_RESET", true);
        bench.drive(SETTLING, "MEMORY_RESET", false);
        let mut now = SETTLING * 2;
        let mut start = 0;
        let mut model = p_counter::PCounterModel::new(&config, start);
        // When LOCAL_STOP is to rise; a reset before that keeps it low.
        let mut rises: Vec<Time> = Vec::new();
        // A load may raise it in passing.
        let mut loads = vec![Time::ZERO..now];
        let behind = behind_the_last_flip_flop(&bench);
        let reset_at = |rises: &mut Vec<Time>, time: Time| rises.retain(|&rise| rise - behind < time || !has_memory);
        for (action, pause) in std::iter::once(&Action::Load(first)).chain(&actions).zip(std::iter::once(&1).chain(&pauses)) {
            match action {
                Action::Load(value) => {
                    start = value & config.largest_start();
                    reset_at(&mut rises, now);
                    bench.drive(now, "COUNTER_RESET", true);
                    bench.number(now, "COUNTER_INIT", u64::from(start));
                    bench.pulse(now + SETTLING, SETTLING, "MEMORY_LOAD");
                    loads.push(now..now + SETTLING * 3);
                    now += SETTLING * 3;
                    bench.drive(now, "COUNTER_RESET", false);
                    now += ready;
                    model = p_counter::PCounterModel::new(&config, start);
                }
                Action::Reset => {
                    // Where the reset itself may raise LOCAL_STOP, it must have settled.
                    if starts_high(&config, start) {
                        now += SETTLING;
                    }
                    reset_at(&mut rises, now);
                    bench.pulse(now, pulse, "COUNTER_RESET");
                    if model.reset() {
                        rises.push(now + counter.reset_to_local_stop.unwrap());
                    }
                    now += pulse + ready;
                }
                Action::Clocks(edges, gap_ps) => {
                    let gap = Time::from_ps(*gap_ps).max(counter.period);
                    for _ in 0..*edges {
                        // The timing block lets no edge through.
                        if config.after_borrow == AfterBorrow::Hold && model.local_stop() {
                            break;
                        }
                        if model.clock() {
                            rises.push(now + counter.clk_to_local_stop);
                        }
                        bench.pulse(now, Time::from_fs(gap.as_fs() / 2), "COUNTER_CLK");
                        now += gap;
                    }
                }
            }
            now += Time::from_ps(*pause);
        }
        let out = Probes::of_block(&bench.netlist).bus(Probe::CounterOut).to_vec();
        let local_stop = bench.net("LOCAL_STOP");
        let mut run = bench.start(&["LOCAL_STOP"]);
        let found = run.number_at(now + SETTLING, &out);
        prop_assert_eq!(found, Some(model.counter_out()));
        prop_assert_eq!(run.is_high_at(now + SETTLING, local_stop), Some(model.local_stop()));
        let in_load = |t: &Time| loads.iter().any(|load| load.contains(t));
        rises.retain(|t| !in_load(t));
        let mut found = run.recorder.rising_edges(local_stop);
        found.retain(|t| !in_load(t));
        prop_assert_eq!(found, rises);
    }
}

/// The sum of cell delays that the ripple is, beside what static timing finds on the netlist.
#[test]
fn the_ripple_is_the_sum_of_its_stages() {
    use guided_dtof::netlist::Library;
    for corner in Corner::ALL {
        let library = Library::generic_40nm();
        let delay = |kind, pin| library.delay(kind, pin, One, corner);
        let (custom, library_cell) = (delay(CellKind::Dffr, 1), delay(CellKind::Dffsr, 1));
        let (mux, buffer) = (delay(CellKind::Mux2, 0), delay(CellKind::Buf, 0));
        for (p_counter, tap, _) in scenario::p_counters() {
            // What the borrow's clock or the buffer waits for.
            let ripple = match p_counter {
                PCounter::Ripple => (custom + mux) * 9,
                PCounter::SetReset | PCounter::Memoryless => library_cell * 9,
                PCounter::Segmented => (custom + mux) * 3,
                PCounter::Synchronous | PCounter::Gray if tap == Tap::Msb => custom + mux,
                PCounter::Synchronous | PCounter::Gray | PCounter::Comparator => Time::ZERO,
                other => panic!("{other:?} has no sum here"),
            };
            let last = match tap {
                Tap::Borrow => custom,
                Tap::Msb => buffer,
            };
            let config = SensorConfig {
                p_counter,
                tap,
                corner,
                ..SensorConfig::default()
            };
            let timing = ChipTiming::new(&config).counter;
            let expected = ripple + last;
            assert_eq!(timing.clk_to_local_stop, expected, "{p_counter:?} {tap:?}");
        }
    }
}

/// A counter that is loaded with 37, as far as it goes, and then counts so often; with the edges that do so.
fn counting(config: &SensorConfig) -> (Bench, Vec<Time>) {
    let mut bench = Bench::new(&p_counter::circuit(config), config.corner);
    let start = 37 & config.largest_start();
    bench.pulse(Time::ZERO, SETTLING, "MEMORY_RESET");
    bench.pulse(Time::ZERO, SETTLING * 4, "COUNTER_RESET");
    bench.number(SETTLING, "COUNTER_INIT", start.into());
    bench.pulse(SETTLING * 2, SETTLING, "MEMORY_LOAD");
    let edges: Vec<Time> = (5..300).map(|edge| SETTLING * edge).collect();
    for &edge in &edges {
        bench.pulse(edge, Time::from_ns(2), "COUNTER_CLK");
    }
    (bench, edges)
}

/// Whoever reads the count with another clock is wrong by one at most.
#[test]
fn a_gray_count_changes_in_one_bit_at_a_time() {
    for tap in Tap::ALL {
        let (mut bench, edges) = counting(&SensorConfig {
            tap,
            after_borrow: AfterBorrow::Wrap,
            counter_bits: 6,
            ..PCounter::Gray.sensor()
        });
        let mut nets = Probes::of_block(&bench.netlist)
            .bus(Probe::CounterOut)
            .to_vec();
        if tap == Tap::Borrow {
            nets.push(bench.net("LOCAL_STOP"));
        }
        let mut run = bench.start(&[]);
        run.recorder = Recorder::new(nets);
        run.until(SETTLING * 300);
        let changes = run.recorder.changes().iter().map(|change| change.0);
        let counted: Vec<Time> = changes.filter(|&time| time >= edges[0]).collect();
        assert_eq!(counted.len(), edges.len());
        for (change, &edge) in counted.into_iter().zip(&edges) {
            assert!((edge..edge + SETTLING).contains(&change), "{change}");
        }
    }
}

/// The bits of a segment rise in one instant, a stage after the last bit of the segment below.
#[test]
fn a_segmented_count_ripples_from_segment_to_segment_only() {
    for counter_bits in 2..=12 {
        let (mut bench, edges) = counting(&SensorConfig {
            counter_bits,
            after_borrow: AfterBorrow::Wrap,
            ..PCounter::Segmented.sensor()
        });
        let last = bench.delay(CellKind::Dffr, 1, One);
        let stage = last + bench.delay(CellKind::Mux2, 0, One);
        let out = Probes::of_block(&bench.netlist)
            .bus(Probe::CounterOut)
            .to_vec();
        let local_stop = bench.net("LOCAL_STOP");
        let mut run = bench.start(&[]);
        run.recorder = Recorder::new(out.iter().copied().chain([local_stop]));
        run.until(SETTLING * 300);
        let segments = |bits: usize| stage * bits.div_ceil(3) as i64;
        let bits = (0..counter_bits).map(|bit| (out[bit], segments(bit + 1)));
        for (net, after) in bits.chain([(local_stop, segments(counter_bits) + last)]) {
            let mut rises = run.recorder.rising_edges(net);
            rises.retain(|&rise| rise >= edges[0]);
            assert!(!rises.is_empty(), "{counter_bits} bits");
            for rise in rises {
                assert!(
                    edges.contains(&(rise - after)),
                    "{counter_bits} bits: {rise}"
                );
            }
        }
    }
}
