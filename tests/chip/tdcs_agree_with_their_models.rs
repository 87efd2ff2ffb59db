//! Time-to-digital converters of 2.4.3: the circuit gives the code that the plain-Rust model reckons from its cells' delays,
//! for random intervals, corners and mismatch.

use crate::bench;

use std::sync::Arc;

use bench::{SETTLING, corners};
use guided_dtof::chip::tdc::{clock_counter, delay_line, ring_oscillator};
use guided_dtof::kernel::{Drive, Kernel, Stimulus};
use guided_dtof::netlist::{
    CellId, CellKind, Corner, Library, Mismatch, Module, Netlist, Timing, varied,
};
use guided_dtof::units::Time;
use proptest::prelude::*;

/// From one conversion's clear to the next one's, longer than any interval and its ripple.
const SLOT: Time = Time::from_ns(60);
/// Longest interval, ps.
const LONGEST_PS: i64 = 30_000;

struct Converter {
    netlist: Netlist,
    timing: Timing,
}

impl Converter {
    fn new(module: &Arc<Module>, corner: Corner, mismatch_seed: u64) -> Self {
        let netlist = Netlist::elaborate(module);
        let nominal = Timing::nominal(&netlist, &Library::generic_40nm(), corner);
        let mismatch = Mismatch {
            sigma: 0.2,
            seed: mismatch_seed,
        };
        Converter {
            timing: varied(&netlist, &nominal, 1.0, Some(mismatch)),
            netlist,
        }
    }

    /// The word on the output `code` after each conversion of STOP so long after START, which rises `SETTLING` × 2 into
    /// its slot; with `clk` running with this period, its rises at multiples.
    fn convert(&self, code: &str, clk: Option<Time>, intervals: &[Time]) -> Vec<Option<u64>> {
        let input = |name: &str| self.netlist.net(name).unwrap();
        let (start, stop, clear) = (input("START"), input("STOP"), input("TDC_RESET"));
        let low = |net| Drive::new(Time::ZERO, net, false);
        let mut drives: Vec<Drive> = self.netlist.inputs().into_iter().map(low).collect();
        for (slot, &interval) in (0..).zip(intervals) {
            let at = SLOT * slot;
            let rise = at + SETTLING * 2;
            let fall = at + SLOT - SETTLING;
            let pulses = [
                (clear, at + Time::from_fs(1), at + SETTLING),
                (start, rise, fall),
                (stop, rise + interval, fall + Time::from_ns(2)),
            ];
            for (net, up, down) in pulses {
                drives.extend([Drive::new(up, net, true), Drive::new(down, net, false)]);
            }
        }
        let end = SLOT * intervals.len() as i64;
        if let Some(period) = clk {
            let half = Time::from_fs(period.as_fs() / 2);
            let edges = (0..)
                .map(|k| (half * k, k % 2 == 0))
                .take_while(|e| e.0 < end);
            drives.extend(edges.map(|(time, level)| Drive::new(time, input("CLK"), level)));
        }
        let code = self.netlist.signal(code).unwrap();
        let mut kernel = Kernel::new(&self.netlist, &self.timing);
        let mut stimulus = Stimulus::sorted(drives);
        let slots = 1..=intervals.len() as i64;
        slots
            .map(|slot| {
                kernel
                    .run(
                        &mut stimulus,
                        SLOT * slot - SETTLING - Time::from_fs(1),
                        &mut (),
                    )
                    .unwrap();
                kernel.number(&code)
            })
            .collect()
    }
}

fn intervals() -> impl Strategy<Value = Vec<Time>> {
    // Off any whole number of picoseconds, as sums of the library's delays are.
    let interval = (0..LONGEST_PS).prop_map(|ps| Time::from_ps(ps) + Time::from_fs(501));
    prop::collection::vec(interval, 1..12)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 30, ..ProptestConfig::default() })]

    #[test]
    fn the_clock_counter_counts_falls_of_clk(
        corner in corners(),
        seed: u64,
        period_ps in 700i64..4_000,
        intervals in intervals(),
    ) {
        let converter = Converter::new(&clock_counter::circuit(6), corner, seed);
        let period = Time::from_fs(period_ps * 1_000 / 2 * 2);
        let found = converter.convert("CODE", Some(period), &intervals);
        // NOT CLK rises so long after CLK falls.
        let inverter = converter.netlist.cells().iter().position(|c| c.kind == CellKind::Inv).unwrap();
        let late = converter.timing.cell_delays(CellId::new(inverter))[0][0].rise();
        for (slot, (&interval, found)) in (0..).zip(intervals.iter().zip(found)) {
            let start = SLOT * slot + SETTLING * 2;
            let half = Time::from_fs(period.as_fs() / 2);
            let falls = (0..).map(|k| half * (2 * k + 1) + late).take_while(|&t| t < SLOT * (slot + 1));
            let expected = clock_counter::model(falls, start, start + interval);
            prop_assert_eq!(found, Some(expected as u64), "{}", interval);
        }
    }

    #[test]
    fn the_ring_counts_its_own_periods(
        corner in corners(),
        seed: u64,
        stages in (5usize..20).prop_map(|n| 2 * n + 1),
        intervals in intervals(),
    ) {
        let converter = Converter::new(&ring_oscillator::circuit(stages, 7), corner, seed);
        let steps = ring_oscillator::RingOscillatorModel::from_netlist(&converter.netlist, &converter.timing, "").steps(128);
        let found = converter.convert("CODE", None, &intervals);
        for (&interval, found) in intervals.iter().zip(found) {
            prop_assert_eq!(found, Some(steps.code(interval) as u64), "{}", interval);
        }
    }

    #[test]
    fn the_delay_line_counts_the_elements_that_start_has_passed(
        corner in corners(),
        seed: u64,
        elements in 1usize..60,
        intervals in intervals(),
    ) {
        let converter = Converter::new(&delay_line::circuit(elements), corner, seed);
        let steps = delay_line::model(&converter.netlist, &converter.timing, "");
        prop_assert_eq!(steps.edges().len(), elements);
        // A tenth: most end on the line.
        let intervals: Vec<Time> = intervals.iter().map(|t| Time::from_fs(t.as_fs() / 10)).collect();
        let found = converter.convert("SEEN", None, &intervals);
        for (&interval, found) in intervals.iter().zip(found) {
            let ones = (1u64 << steps.code(interval)) - 1;
            prop_assert_eq!(found, Some(ones), "{}", interval);
        }
    }
}
