//! Static timing is never optimistic: whatever the event kernel does after some inputs change, every change
//! lies between the shortest and the longest path to it; and the longest ripple is reached.

use std::sync::Arc;

use guided_dtof::chip::{
    Overflow, PCounter, SensorConfig, correlation, front_end, histogram, load_path, metdc,
    p_counter,
};
use guided_dtof::kernel::{Drive, Kernel, Observer, Stimulus};
use guided_dtof::logic::Logic;
use guided_dtof::netlist::{
    ArcDelay, CellKind, Corner, Edge, Library, Module, ModuleBuilder, NetId, Netlist, ScopeId,
    StaticTiming, Timing,
};
use guided_dtof::units::Time;
use proptest::prelude::*;

/// Keeps every change from `from` on.
struct Changes {
    from: Time,
    seen: Vec<(Time, NetId, Logic)>,
}

impl Observer for Changes {
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        if time >= self.from {
            self.seen.push((time - self.from, net, value));
        }
    }
}

/// Resets the circuit, lets it settle under each word of `words` in turn, and checks every change after each.
/// Bit i of a word is input i; a bit of `resets` marks an input that is held high at first.
fn check(
    netlist: &Netlist,
    timing: &Timing,
    words: &[u64],
    resets: u64,
) -> Result<(), TestCaseError> {
    const GAP: Time = Time::from_ns(100);
    let inputs = netlist.inputs();
    let starts: Vec<_> = inputs
        .iter()
        .flat_map(|&net| Edge::BOTH.map(|edge| (net, edge)))
        .collect();
    let analysis = StaticTiming::new(netlist, timing);
    let arrivals = analysis.arrivals(&starts, &[]).unwrap();
    let mut kernel = Kernel::new(netlist, timing);
    let mut before = None;
    for (index, &word) in [resets, 0].iter().chain(words).enumerate() {
        let now = GAP * index as i64;
        let changed = before.map_or(u64::MAX, |b: u64| b ^ word);
        before = Some(word);
        let drives = inputs
            .iter()
            .enumerate()
            .filter(|(i, _)| changed >> (i % 64) & 1 == 1)
            .map(|(i, &net)| Drive::new(now, net, word >> (i % 64) & 1 == 1));
        let mut changes = Changes {
            from: now,
            seen: Vec::new(),
        };
        let mut stimulus = Stimulus::new(drives);
        kernel
            .run(&mut stimulus, now + GAP - Time::from_fs(1), &mut changes)
            .unwrap();
        for (time, net, value) in changes.seen.into_iter().filter(|_| index > 1) {
            let edge = Edge::from_final_value(value).expect("everything is known after the reset");
            let window = arrivals.edge_window(net, edge);
            let (first, last) = window.expect("a net that changes has a path to it");
            prop_assert!(
                first <= time && time <= last,
                "{:?} {edge:?} at {time}, not from {first} to {last}",
                netlist.net_path(net)
            );
        }
    }
    Ok(())
}

/// A sensor with this P-counter.
fn sensor(p_counter: PCounter, counter_bits: usize) -> SensorConfig {
    SensorConfig {
        p_counter,
        counter_bits,
        ..SensorConfig::default()
    }
}

/// A random circuit: every cell reads inputs or earlier cells; flip-flops may also read their own Q̄.
fn random_circuit(choices: &[(usize, [usize; 4], bool)]) -> Arc<Module> {
    let mut m = ModuleBuilder::new("random");
    let reset = m.input("RESET");
    let mut nets = m.input_bus("A", 6);
    for (index, (kind, pins, toggles)) in choices.iter().enumerate() {
        let kind = CellKind::ALL[kind % CellKind::ALL.len()];
        let mut inputs: Vec<_> = pins[..kind.inputs().len()]
            .iter()
            .map(|pin| nets[pin % nets.len()])
            .collect();
        if kind.is_flip_flop() {
            let (q, qn) = (m.wire(&format!("q{index}")), m.wire(&format!("qn{index}")));
            if *toggles {
                inputs[0] = qn;
                inputs[2] = reset;
            } else {
                inputs[2] = m.gate(CellKind::Or2, &[reset, inputs[2]]);
            }
            m.cell(&format!("ff{index}"), kind, &inputs, &[q, qn]);
            nets.extend([q, qn]);
        } else {
            nets.push(m.gate(kind, &inputs));
        }
    }
    m.finish().unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn random_circuits_stay_within_their_bounds(
        choices in prop::collection::vec((any::<usize>(), any::<[usize; 4]>(), any::<bool>()), 1..60),
        delays in prop::collection::vec((1i64..90_000, 1i64..90_000), 1..64),
        words in prop::collection::vec(0u64..128, 1..12),
    ) {
        let netlist = Netlist::elaborate(&random_circuit(&choices));
        let mut timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
        let mut next = delays.iter().cycle();
        for cell in netlist.cells_below(ScopeId::TOP) {
            let mut arc = || {
                let &(rise, fall) = next.next().expect("endless");
                ArcDelay::new(Time::from_fs(rise), Time::from_fs(fall))
            };
            timing.set(cell, std::array::from_fn(|_| [arc(), arc()]));
        }
        check(&netlist, &timing, &words, 1)?;
    }

    #[test]
    fn the_chips_blocks_stay_within_their_bounds(
        block in 0usize..6 + PCounter::ALL.len(),
        words in prop::collection::vec(any::<u64>(), 1..12),
    ) {
        let circuit = match block {
            0 => correlation::circuit(16),
            1 => front_end::summation::circuit(16),
            2 => metdc::circuit(16),
            // A saturating bin's FULL gates its own clock: a loop.
            3 => histogram::circuit(2, 5, Overflow::Wrap),
            4 => load_path::deserialiser(3, 3),
            5 => load_path::row_scanner(5),
            _ => p_counter::circuit(&sensor(PCounter::ALL[block - 6], 9)),
        };
        let netlist = Netlist::elaborate(&circuit);
        let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
        check(&netlist, &timing, &words, u64::MAX)?;
    }

    #[test]
    fn the_longest_ripple_is_reached_from_any_start_value(
        p_counter in prop::sample::select(PCounter::ALL.to_vec()),
        bits in 2usize..=12,
        start: u16,
    ) {
        prop_assume!(p_counter.row().has_memory);
        let netlist = Netlist::elaborate(&p_counter::circuit(&sensor(p_counter, bits)));
        let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
        let net = |name| netlist.net(name).unwrap();
        let (clk, stop) = (net("COUNTER_CLK"), net("LOCAL_STOP"));
        let analysis = StaticTiming::new(&netlist, &timing);
        let arrivals = analysis.arrivals(&[(clk, Edge::Rise)], &[]).unwrap();
        let (shortest, longest) = arrivals.edge_window(stop, Edge::Rise).unwrap();
        prop_assert_eq!(shortest, longest);

        let start = start % (1 << bits);
        let mut drives = vec![];
        let mut drive = |ns, net, value: bool| drives.push(Drive::new(Time::from_ns(ns), net, value));
        for name in ["MEMORY_LOAD", "COUNTER_CLK"] {
            drive(0, net(name), false);
        }
        for name in ["MEMORY_RESET", "COUNTER_RESET"] {
            drive(0, net(name), true);
        }
        for (bit, &pin) in netlist.signal("COUNTER_INIT").unwrap().iter().enumerate() {
            drive(0, pin, start >> bit & 1 == 1);
        }
        drive(10, net("MEMORY_RESET"), false);
        drive(20, net("MEMORY_LOAD"), true);
        drive(30, net("COUNTER_RESET"), false);
        let last = 40 + 10 * start as i64;
        for edge in 0..=start as i64 {
            drive(40 + 10 * edge, clk, true);
            drive(45 + 10 * edge, clk, false);
        }
        let mut stimulus = Stimulus::new(drives);
        let mut recorder = guided_dtof::kernel::Recorder::new([stop]);
        Kernel::new(&netlist, &timing).run(&mut stimulus, Time::from_ns(last + 20), &mut recorder).unwrap();
        prop_assert_eq!(recorder.rising_edges(stop), [Time::from_ns(last) + longest]);
    }
}
