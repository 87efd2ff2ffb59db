//! Every circuit, elaborated alone and driven at random, does what the plain-Rust model beside it says, at the
//! times that the chip's timing says. The correlation block has a file of its own.

use crate::bench;

use bench::{Bench, SETTLING, corners};
use guided_dtof::chip::{
    AfterBorrow, ChipTiming, Overflow, SensorConfig, Tdc, front_end, histogram, histogram_sums,
    metdc, metdc_counter, p_counter_timing, photon_line,
};
use guided_dtof::units::Time;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    #[test]
    fn the_timing_block_gates_the_clock_and_pulses_the_reset(
        corner in corners(),
        wraps: bool,
        steps in prop::collection::vec((0usize..5, 800i64..3_000), 1..80),
    ) {
        let after_borrow = if wraps { AfterBorrow::Wrap } else { AfterBorrow::Hold };
        let mut bench = Bench::new(&p_counter_timing::circuit(after_borrow, p_counter_timing::SHORTEST_CHAIN), corner);
        let timing = bench.timing();
        let names = ["CLK", "STOP", "RESETB", "ENABLE", "LOCAL_STOP"];
        let mut values = [false; 5];
        let mut expected = Vec::new();
        let mut clk_to_counter_clk = Vec::new();
        let mut pulses = Vec::new();
        let mut now = SETTLING;
        for (pin, gap_ps) in steps {
            values[pin] = !values[pin];
            bench.drive(now, names[pin], values[pin]);
            let [clk, stop, resetb, enable, local_stop] = values;
            let model = p_counter_timing::PCounterTimingModel { after_borrow, clk, resetb, enable, local_stop };
            if names[pin] == "CLK" && model.counter_clk() {
                clk_to_counter_clk.push(now + timing.clk_to_counter_clk);
            }
            if names[pin] == "STOP" && stop && !model.counter_reset() {
                pulses.push(p_counter_timing::PCounterTimingModel::reset_pulse(&timing, now));
            }
            now += Time::from_ps(gap_ps);
            expected.push((now - Time::from_fs(1), model));
        }
        let outputs = ["COUNTER_CLK", "MEMORY_RESET", "COUNTER_RESET"];
        let [counter_clk, memory_reset, counter_reset] = outputs.map(|name| bench.net(name));
        let mut run = bench.start(&outputs);
        for (time, model) in expected {
            prop_assert_eq!(run.is_high_at(time, counter_clk), Some(model.counter_clk()));
            prop_assert_eq!(run.is_high_at(time, memory_reset), Some(model.memory_reset()));
            prop_assert_eq!(run.is_high_at(time, counter_reset), Some(model.counter_reset()));
        }
        let rises = run.recorder.rising_edges(counter_clk);
        prop_assert!(clk_to_counter_clk.iter().all(|t| rises.contains(t)));
        let rises = run.recorder.rising_edges(counter_reset);
        let falls = run.recorder.falling_edges(counter_reset);
        for pulse in pulses {
            prop_assert!(rises.contains(&pulse.start) && falls.contains(&pulse.end), "{:?}", pulse);
            let within = |t: &&Time| pulse.contains(*t) && **t != pulse.start;
            prop_assert_eq!(rises.iter().chain(&falls).filter(within).count(), 0);
        }
    }

    #[test]
    fn the_front_end_gives_each_pulse_one_period(
        corner in corners(),
        period_ps in 600i64..5_000,
        spads in prop_oneof![Just(1u8), Just(4), Just(16), Just(64)],
        pulses in prop::collection::vec((0u8..64, 0i64..60, 0i64..1_000_000, any::<bool>()), 0..100),
    ) {
        let mut bench = Bench::new(&front_end::summation::circuit(usize::from(spads)), corner);
        let timing = bench.timing();
        let width = Time::from_ps(100);
        let rise = |k: i64| SETTLING * 2 + Time::from_ps(period_ps) * k;
        // Some so that the toggle changes with CLK or a femtosecond on either side of it.
        let mut pulses: Vec<(Time, u8)> = pulses
            .into_iter()
            .map(|(spad, k, within, is_close)| {
                let offset = if is_close { within % 3 - 1 } else { within * period_ps / 1_000 };
                (rise(k) - timing.spad_to_sampled + Time::from_fs(offset), spad % spads)
            })
            .collect();
        pulses.sort_unstable();
        let mut free_from = [Time::ZERO; 64];
        pulses.retain(|&(time, spad)| {
            let is_free = time > free_from[spad as usize];
            if is_free {
                free_from[spad as usize] = time + width * 2;
            }
            is_free
        });
        bench.pulse(Time::ZERO, SETTLING, "PIXEL_CLEAR");
        for &(time, spad) in &pulses {
            bench.pulse(time, width, &format!("SPAD_RAW[{spad}]"));
        }
        for k in 0..63 {
            bench.pulse(rise(k), Time::from_ps(period_ps / 2), "CLK");
        }
        let timed = bench.bus("SPAD_TIMED");
        let mut run = bench.start(&[]);
        let mut model = front_end::summation::SummationModel::default();
        let mut pulses = pulses.into_iter().peekable();
        for k in 0..63 {
            while let Some((_, spad)) = pulses.next_if(|(t, _)| *t + timing.spad_to_sampled <= rise(k)) {
                model.pulse(spad);
            }
            model.clock();
            let found = run.number_at(rise(k + 1) - Time::from_fs(1), &timed);
            prop_assert_eq!(found, Some(model.spad_timed()), "after edge {}", k);
        }
    }

    #[test]
    fn the_photon_line_keeps_the_edges_of_pulses_that_are_far_enough_apart(
        corner in corners(),
        spads in prop_oneof![Just(1u8), Just(2), Just(16), Just(64)],
        pulses in prop::collection::vec((0u8..64, 0i64..30, 0i64..200_000), 0..100),
    ) {
        let mut bench = Bench::new(&photon_line::circuit(usize::from(spads)), corner);
        let delay_line = SensorConfig {
            tdc: Tdc::DelayLine,
            spad_rows: 1 << (spads.trailing_zeros() / 2),
            spad_cols: 1 << spads.trailing_zeros().div_ceil(2),
            corner,
            ..SensorConfig::default()
        };
        let timing = ChipTiming::new(&delay_line);
        // In bursts, shorter than some XORs take.
        let pulse_time = |burst: i64, within: i64| SETTLING * 2 + Time::from_ns(2) * burst + Time::from_fs(within);
        let mut pulses: Vec<(Time, u8)> = pulses
            .into_iter()
            .map(|(spad, burst, within)| (pulse_time(burst, within), spad % spads))
            .collect();
        pulses.sort_unstable();
        let mut free_from = [Time::ZERO; 64];
        pulses.retain(|&(time, spad)| {
            let is_free = time > free_from[usize::from(spad)];
            if is_free {
                free_from[usize::from(spad)] = time + Time::from_ns(1);
            }
            is_free
        });
        bench.pulse(Time::ZERO, SETTLING, "PIXEL_CLEAR");
        for &(time, spad) in &pulses {
            bench.pulse(time, Time::from_ps(300), &format!("SPAD_RAW[{spad}]"));
        }
        let photons = bench.net("PHOTONS");
        let mut run = bench.start(&["PHOTONS"]);
        run.until(pulse_time(40, 0));
        let mut found: Vec<Time> = run.recorder.rising_edges(photons);
        found.extend(run.recorder.falling_edges(photons));
        found.retain(|&time| time > SETTLING);
        found.sort_unstable();
        photon_line::model(&mut pulses, |pulse| *pulse, usize::from(spads), timing.photon_line_stage);
        let expected: Vec<Time> = pulses.iter().map(|(time, _)| *time + timing.spad_to_sampled).collect();
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn the_counter_tdc_selects_each_bin_for_a_clk_period(
        corner in corners(),
        bins in 1usize..20,
        period_ps in 2_500i64..4_000,
        cycles in prop::collection::vec((0i64..20, 0i64..30), 1..8),
    ) {
        let mut bench = Bench::new(&metdc_counter::circuit(bins), corner);
        let timing = bench.timing();
        let rise = |k: i64| SETTLING * 3 + Time::from_ps(period_ps) * k;
        // Signals change as CLK falls, far from what samples them.
        let fall = |k: i64| rise(k) + Time::from_ps(period_ps / 2);
        bench.pulse(Time::ZERO, SETTLING, "PIXEL_CLEAR");
        bench.pulse(Time::ZERO, SETTLING * 2, "COUNTER_RESET");
        // START as each CLK edge finds it: low for one at least before LOCAL_STOP.
        let mut starts: Vec<bool> = Vec::new();
        let width = timing.stop_to_reset_release - timing.stop_to_reset;
        for (low, high) in cycles {
            let local_stop = starts.len() as i64 + low;
            bench.drive(fall(local_stop), "LOCAL_STOP", true);
            starts.resize(local_stop as usize + 1, false);
            starts.resize((local_stop + high) as usize + 2, true);
            let reset = fall(starts.len() as i64 - 1);
            bench.pulse(reset, width, "COUNTER_RESET");
            bench.drive(reset + Time::from_ps(100), "LOCAL_STOP", false);
        }
        starts.push(false);
        for k in 0..=starts.len() as i64 {
            bench.pulse(rise(k), Time::from_ps(period_ps / 2), "CLK");
        }
        let select = bench.bus("SELECTED");
        let mut run = bench.start(&[]);
        let mut model = metdc_counter::MetdcCounterModel::new(bins);
        for (k, &start) in (1..).zip(&starts) {
            model.clock(start);
            let expected = model.selected().map_or(0, |bin| 1u64 << bin);
            let found = run.number_at(rise(k) - Time::from_fs(1), &select);
            prop_assert_eq!(found, Some(expected), "before edge {}", k);
        }
    }

    #[test]
    fn bins_of_a_counter_tdc_add_what_they_are_given(
        corner in corners(),
        bins in 1usize..9,
        bits in 1usize..9,
        event_bits in 1usize..6,
        overflow in prop::sample::select(vec![Overflow::Saturate, Overflow::Wrap]),
        given in prop::collection::vec((0usize..10, any::<u64>()), 1..60),
    ) {
        let circuit = histogram_sums::circuit(bins, bits, event_bits, overflow);
        let mut bench = Bench::new(&circuit, corner);
        let rise = |k: usize| SETTLING * 2 + Time::from_ns(5) * k as i64;
        bench.pulse(Time::ZERO, SETTLING, "PIXEL_CLEAR");
        let mut sums = vec![0u64; bins];
        for (k, &(bin, events)) in given.iter().enumerate() {
            let events = events & ((1 << event_bits) - 1);
            bench.number(rise(k) - Time::from_ns(4), "EVENTS", events);
            // None of the bins now and then.
            let select = if bin < bins { 1 << bin } else { 0 };
            bench.number(rise(k) - Time::from_ns(4), "SELECTED", select);
            bench.pulse(rise(k), Time::from_ns(2), "CLK");
            if let Some(sum) = sums.get_mut(bin) {
                *sum += events;
            }
        }
        let counts: Vec<_> = (0..bins).map(|bin| bench.bus(&format!("BIN_{bin}"))).collect();
        let mut run = bench.start(&[]);
        run.until(rise(given.len()));
        for (count, sum) in counts.iter().zip(sums) {
            let expected = histogram::model(sum, bits as u32, overflow);
            prop_assert_eq!(run.kernel.number(count), Some(u64::from(expected)));
        }
    }

    #[test]
    fn the_metdc_latches_the_last_periods_and_returns_to_zero(
        corner in corners(),
        bins in 1usize..33,
        conventional: bool,
        period_ps in 2_000i64..4_000,
        cycles in prop::collection::vec((8i64..60, 0i64..1_000_000, any::<u64>()), 1..8),
    ) {
        let mut bench = Bench::new(&metdc::circuit(bins), corner);
        let timing = bench.timing();
        let chain = timing.stop_to_strobe - timing.local_stop_to_strobe;
        let rise = |k: i64| SETTLING * 2 + Time::from_ps(period_ps) * k;
        bench.pulse(Time::ZERO, SETTLING, "PIXEL_CLEAR");
        bench.drive(Time::ZERO, "COUNTER_RESET", true);
        bench.drive(Time::ZERO, "CONVENTIONAL", conventional);
        let mut events = Vec::new();
        let mut strobes = Vec::new();
        let mut zeros = Vec::new();
        let last = cycles.len() - 1;
        for (cycle, (periods, at, pattern)) in cycles.into_iter().enumerate() {
            // STOP a femtosecond off a whole number of picoseconds, on no edge of CLK.
            let first = events.len() as i64;
            let stop = rise(first) + Time::from_ps(period_ps / 2) + Time::from_fs(1);
            let end = rise(first + periods);
            let third = Time::from_fs((end - stop).as_fs() / 3);
            let local_stop = stop + third + Time::from_fs(third.as_fs() / 1_000_000 * at);
            bench.pulse(stop, third * 2, "STOP");
            bench.pulse(stop + chain, third * 2, "STOP_D");
            if cycle == 0 {
                bench.drive(stop + timing.stop_to_reset_release, "COUNTER_RESET", false);
            } else {
                let width = timing.stop_to_reset_release - timing.stop_to_reset;
                bench.pulse(stop + timing.stop_to_reset, width, "COUNTER_RESET");
                bench.drive(stop + timing.stop_to_reset * 2, "LOCAL_STOP", false);
            }
            bench.drive(local_stop, "LOCAL_STOP", true);
            if conventional {
                strobes.push(stop + timing.stop_to_strobe);
                // STOP is low again until the next laser cycle.
                zeros.push(stop + third * 2 + Time::from_ps(600));
            } else {
                strobes.push(local_stop + timing.local_stop_to_strobe);
                zeros.push(stop + timing.stop_to_reset_release + timing.clk_to_shift);
            }
            events.extend((0..periods).map(|k| pattern.rotate_left(k as u32) & 1 == 1));
            if cycle == last {
                events.extend([false; 2]);
            }
        }
        for (k, &event) in events.iter().enumerate() {
            let k = k as i64;
            // Takes its value well before the edge that shifts it in.
            bench.drive(rise(k) - Time::from_ps(period_ps / 4), "SPAD_EVENT", event);
            bench.pulse(rise(k), Time::from_ps(period_ps / 2), "CLK");
        }
        let expected: Vec<u64> = strobes
            .iter()
            .map(|&strobe| {
                let mut model = metdc::MetdcModel::new(bins as u32);
                let shifted = |&k: &usize| rise(k as i64) + timing.clk_to_shift <= strobe;
                (0..events.len()).take_while(shifted).for_each(|k| model.clock(events[k]));
                model.hits()
            })
            .collect();
        let hit = bench.bus("HIT");
        let mut run = bench.start(&["HIT"]);
        run.until(rise(events.len() as i64));
        for ((&strobe, hits), &zero) in strobes.iter().zip(&expected).zip(&zeros) {
            let latched = strobe + timing.strobe_to_hit;
            prop_assert_eq!(run.recorder.number_at(&hit, latched), Some(*hits));
            prop_assert_eq!(run.recorder.number_at(&hit, zero), Some(0));
        }
        for (bin, &net) in hit.iter().enumerate() {
            let counts = expected.iter().filter(|&hits| hits >> bin & 1 == 1).count();
            prop_assert_eq!(run.recorder.rising_edges(net).len(), counts);
        }
    }

    #[test]
    fn a_bin_counts_and_then_saturates_or_wraps(
        corner in corners(),
        bits in 1usize..11,
        saturates: bool,
        share in 0.0f64..2.5,
        width_ps in 200i64..2_000,
        again in 0u64..40,
    ) {
        let overflow = if saturates { Overflow::Saturate } else { Overflow::Wrap };
        let mut bench = Bench::new(&histogram::bin_counter(bits, overflow), corner);
        // Full bins must have stopped their clock before the next hit.
        let gap = Time::from_ps(width_ps) + SETTLING;
        let mut now = SETTLING * 2;
        let mut read = Vec::new();
        bench.pulse(Time::ZERO, SETTLING, "PIXEL_CLEAR");
        for hits in [(share * (1u64 << bits) as f64) as u64, again] {
            for _ in 0..hits {
                bench.pulse(now, Time::from_ps(width_ps), "HIT");
                now += gap;
            }
            now += SETTLING;
            read.push((now, histogram::model(hits, bits as u32, overflow)));
            bench.pulse(now + SETTLING, SETTLING, "PIXEL_CLEAR");
            now += SETTLING * 3;
        }
        let count = bench.bus("COUNT");
        let mut run = bench.start(&[]);
        for (time, expected) in read {
            prop_assert_eq!(run.number_at(time, &count), Some(expected as u64));
        }
    }

}
