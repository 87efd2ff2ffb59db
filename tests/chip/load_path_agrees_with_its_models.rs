//! Deserialiser and row scanner, alone and with memories, do what the plain-Rust models beside them say.

use crate::bench;

use bench::{Bench, SETTLING, corners};
use guided_dtof::chip::{load_path, probes};
use guided_dtof::logic::Logic;
use guided_dtof::netlist::CellKind;
use guided_dtof::units::Time;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    #[test]
    fn the_deserialiser_follows_its_model_edge_by_edge(
        corner in corners(),
        cols in 1usize..6,
        bits in 2usize..12,
        steps in prop::collection::vec(prop_oneof![30 => any::<bool>().prop_map(Some), 1 => Just(None)], 1..300),
    ) {
        let mut bench = Bench::new(&load_path::deserialiser(cols, bits), corner);
        bench.pulse(Time::ZERO, SETTLING, "LOAD_RESET");
        let mut model = load_path::Deserialiser::new(cols, bits);
        let mut expected = Vec::new();
        let half = Time::from_ps(1_250);
        let mut now = SETTLING * 2;
        for step in steps {
            match step {
                Some(bit) => {
                    bench.drive(now - half, "COUNTER_INITS", bit);
                    bench.pulse(now, half, "LOAD_CLK");
                    model.clock(bit);
                }
                None => {
                    bench.pulse(now, half, "LOAD_RESET");
                    model.reset();
                }
            }
            now += half * 2;
            let row: Vec<bool> = model.row().iter().by_vals().collect();
            expected.push((now - half, row, model.row_done()));
        }
        let (row, done) = (bench.bus("COUNTER_INIT_ROW"), bench.net("ROW_DONE"));
        let mut run = bench.start(&[]);
        for (time, bits, is_done) in expected {
            prop_assert_eq!(run.is_high_at(time, done), Some(is_done));
            let found: Vec<Option<bool>> = row.iter().map(|&net| run.kernel.value(net).to_bool()).collect();
            prop_assert_eq!(found, bits.into_iter().map(Some).collect::<Vec<_>>());
        }
    }

    #[test]
    fn the_row_scanner_loads_one_row_at_a_time(
        corner in corners(),
        rows in 1usize..9,
        steps in prop::collection::vec(prop_oneof![20 => any::<bool>().prop_map(Some), 1 => Just(None)], 1..120),
    ) {
        let mut bench = Bench::new(&load_path::row_scanner(rows), corner);
        bench.pulse(Time::ZERO, SETTLING, "LOAD_RESET");
        let mut model = load_path::RowScanner::new(rows);
        let mut expected = Vec::new();
        let mut loads = 0;
        let half = Time::from_ps(1_250);
        // ROW_DONE changes clk-to-Q after a rise of LOAD_CLK.
        let after = bench.delay(CellKind::Dffr, 1, Logic::One);
        let mut now = SETTLING * 2;
        let mut done_before = false;
        for step in steps {
            let done = step.unwrap_or(false);
            if step.is_none() {
                bench.pulse(now, half, "LOAD_RESET");
                model.reset();
            } else {
                bench.pulse(now, half, "LOAD_CLK");
                model.row_done(done);
            }
            if done != done_before {
                bench.drive(now + after, "ROW_DONE", done);
                done_before = done;
            }
            if step.is_some() {
                expected.push((now + half - Time::from_fs(1), model.memory_load(true)));
            }
            expected.push((now + half * 2 - Time::from_fs(1), model.memory_load(false)));
            loads += done as usize;
            now += half * 2;
        }
        let load = bench.bus("MEMORY_LOAD");
        let mut run = bench.start(&["MEMORY_LOAD"]);
        for (time, row) in expected {
            let one_hot = row.map_or(0, |row| 1u64 << row);
            prop_assert_eq!(run.number_at(time, &load), Some(one_hot));
        }
        let rises: usize = load.iter().map(|&net| run.recorder.rising_edges(net).len()).sum();
        prop_assert_eq!(rises, loads, "a pulse that no row asked for");
    }

    /// Any number of loads, each full, cut off after any bit or longer than the array: the memories hold what the whole
    /// rows of each have left in them, and what is too much begins again with row 0.
    #[test]
    fn loads_cut_off_anywhere_leave_whole_rows(
        corner in corners(),
        rows in 1usize..5,
        cols in 1usize..4,
        bits in 2usize..10,
        loads in prop::collection::vec((prop::collection::vec(any::<bool>(), 160), 0.0f64..1.5), 1..5),
    ) {
        let mut bench = Bench::new(&load_path::with_memories(rows, cols, bits), corner);
        let half = Time::from_ps(2_500);
        bench.drive(SETTLING, "RESETB", true);
        let mut now = SETTLING * 2;
        let mut expected = vec![0u16; rows * cols];
        for (bits_in, share) in &loads {
            let whole = rows * cols * bits;
            let length = ((share * whole as f64) as usize).min(bits_in.len());
            let stream: bitvec::vec::BitVec = (0..length).map(|i| bits_in[i]).collect();
            bench.drive(now, "LOAD_ENABLE", true);
            for bit in stream.iter().by_vals() {
                bench.drive(now, "COUNTER_INITS", bit);
                bench.pulse(now + half, half, "LOAD_CLK");
                now += half * 2;
            }
            now += half;
            bench.drive(now, "LOAD_ENABLE", false);
            now += SETTLING;
            let arrived = load_path::codes(&stream, cols, bits);
            for (row, arrived) in arrived.chunks(cols).enumerate() {
                expected[row % rows * cols..][..cols].copy_from_slice(arrived);
            }
        }
        let memories = probes::memories(&bench.netlist, rows, cols);
        let mut run = bench.start(&[]);
        run.until(now + SETTLING);
        let found: Vec<Option<u64>> = memories.iter().map(|nets| run.kernel.number(nets)).collect();
        let expected: Vec<Option<u64>> = expected.into_iter().map(|code| Some(code as u64)).collect();
        prop_assert_eq!(found, expected);
    }
}
