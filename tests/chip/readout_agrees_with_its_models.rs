//! Counts leave through the pins as the plain-Rust models say: each block edge by edge, the readout of any array, and the
//! sensor after an exposure, in our kernel and in Icarus Verilog.

use crate::bench;
use crate::every_edge;
use crate::icarus;
use crate::scenario;

use std::fs::{self, File};
use std::io::{BufReader, Cursor};

use bench::{Bench, SETTLING, corners};
use every_edge::waves::Waves;
use guided_dtof::chip::readout::{self, ReadoutOrder, Scanner, Serialiser};
use guided_dtof::chip::{SensorConfig, SensorPins};
use guided_dtof::engine::GateSimulation;
use guided_dtof::engine::readout::{PinSampler, read_out, readout_netlist};
use guided_dtof::kernel::{Drive, Kernel, Observer, Stimulus};
use guided_dtof::logic::Logic;
use guided_dtof::netlist::{NetId, ScopeId};
use guided_dtof::stimulus::{StimulusPlan, export_verilog};
use guided_dtof::units::Time;
use guided_dtof::waves::{VcdWriter, WaveSelection};
use icarus::IcarusChanges;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng, rngs::StdRng};
use scenario::Scenario;

/// Half a READ_CLK period that every corner keeps.
const HALF: Time = Time::from_ps(1_500);

fn random_counts(config: &SensorConfig, seed: u64) -> Vec<u16> {
    let mut random = StdRng::seed_from_u64(seed);
    let most = ((1u32 << config.bin_bits) - 1) as u16;
    let counts = 0..config.pixels() * config.bins;
    counts.map(|_| random.random_range(0..=most)).collect()
}

fn arrays() -> impl Strategy<Value = SensorConfig> {
    let size = (1usize..6, 1usize..6, 1usize..7);
    (size, 1usize..9, 1usize..15, corners()).prop_map(|(size, bins, bin_bits, corner)| {
        SensorConfig {
            rows: size.0,
            cols: size.1,
            readout_pins: size.2,
            bins,
            bin_bits,
            corner,
            ..SensorConfig::default()
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    #[test]
    fn the_scanner_follows_its_model_edge_by_edge(
        corner in corners(),
        (rows, bins, word_periods) in (1usize..5, 1usize..6, 1usize..12),
        steps in prop::collection::vec(prop_oneof![40 => Just(true), 1 => Just(false)], 1..250),
    ) {
        let mut bench = Bench::new(&readout::scanner(rows, bins, word_periods), corner);
        bench.drive(Time::ZERO, "READ_ENABLE", true);
        bench.pulse(Time::ZERO, SETTLING, "READ_RESET");
        let mut model = Scanner::new(rows, bins, word_periods);
        let mut now = SETTLING * 2;
        let mut expected = vec![(now, model)];
        for is_clocked in steps {
            if is_clocked { model.clock() } else { model.reset() }
            bench.pulse(now + HALF, HALF, if is_clocked { "READ_CLK" } else { "READ_RESET" });
            now += HALF * 2;
            expected.push((now, model));
        }
        let nets = ["ROW_READ", "BIN_READ", "WORD_LOAD"].map(|name| bench.bus(name));
        let mut run = bench.start(&[]);
        for (time, model) in expected {
            let (row, bin) = model.selected();
            let found = nets.each_ref().map(|nets| run.number_at(time, nets));
            let wanted = [1 << row, 1 << bin, u64::from(model.word_load())];
            prop_assert_eq!(found, wanted.map(Some));
        }
    }

    #[test]
    fn the_serialiser_follows_its_model_edge_by_edge(
        corner in corners(),
        (cols, bits) in (1usize..5, 1usize..15),
        steps in prop::collection::vec((prop::collection::vec(any::<u16>(), 4), 0u8..30), 1..120),
    ) {
        let mut bench = Bench::new(&readout::serialiser(cols, cols, bits), corner);
        bench.pulse(Time::ZERO, SETTLING, "READ_RESET");
        let mut model = Serialiser::new(cols, bits);
        let mut now = SETTLING * 2;
        let mut expected = Vec::new();
        for (words, what) in steps {
            let words: Vec<u16> = words.iter().take(cols).map(|w| w & ((1u32 << bits) - 1) as u16).collect();
            let number = words.iter().rev().fold(0, |n, &w| n << bits | u64::from(w));
            bench.number(now, "WORD", number);
            bench.drive(now, "WORD_LOAD", what < 3);
            match what {
                0..3 => model.clock(Some(&words)),
                29 => model.reset(),
                _ => model.clock(None),
            }
            bench.pulse(now + HALF, HALF, if what == 29 { "READ_RESET" } else { "READ_CLK" });
            now += HALF * 2;
            expected.push((now, model.data_out()));
        }
        let out = bench.net("DATA_OUT");
        let mut run = bench.start(&[]);
        for (time, bit) in expected {
            prop_assert_eq!(run.is_high_at(time, out), Some(bit));
        }
    }

    #[test]
    fn a_macropixel_shows_the_selected_bins_and_nothing_else(
        corner in corners(),
        bits in 1usize..15,
        counts in prop::collection::vec(any::<u16>(), 1..20),
        steps in prop::collection::vec((any::<bool>(), any::<u64>()), 1..20),
    ) {
        let bins = counts.len();
        let counts: Vec<u16> = counts.iter().map(|c| c & ((1u32 << bits) - 1) as u16).collect();
        let mut bench = Bench::new(&readout::bin_select(bins, bits), corner);
        let nets = bench.bus("COUNT");
        for (bin, nets) in nets.chunks(bits).enumerate() {
            for (bit, &net) in nets.iter().enumerate() {
                let value = counts[bin] >> bit & 1 == 1;
                bench.drives.push(Drive::new(Time::ZERO, net, value));
            }
        }
        let mut now = SETTLING;
        let mut expected = Vec::new();
        for (row, bin_read) in steps {
            bench.drive(now, "ROW_READ", row);
            bench.number(now, "BIN_READ", bin_read);
            now += SETTLING;
            let word = readout::selected_word(&counts, row, bin_read & ((1u64 << bins) - 1));
            expected.push((now - Time::from_fs(1), word));
        }
        let word = bench.bus("WORD");
        let mut run = bench.start(&[]);
        for (time, expected) in expected {
            prop_assert_eq!(run.number_at(time, &word), Some(expected.into()));
        }
    }

    #[test]
    fn any_counts_of_any_array_leave_through_its_pins(config in arrays(), seed: u64) {
        let order = ReadoutOrder::new(&config);
        prop_assert!(order.pins() <= config.readout_pins.min(config.cols));
        let counts = random_counts(&config, seed);
        prop_assert_eq!(&order.counts(&order.streams(&counts)), &counts);
        let netlist = readout_netlist(&config);
        let mut sampler = PinSampler::new(&netlist, |_| Logic::X);
        let found = read_out(&config, &netlist, &counts, &mut sampler);
        prop_assert_eq!(sampler.streams(), order.streams(&counts));
        prop_assert_eq!(found.counts, counts.into_iter().map(Some).collect::<Vec<_>>());
    }

    /// A reading that stops too early, a whole one, and one that does not stop when it should.
    #[test]
    fn a_reading_begins_anew_after_one_that_was_broken_off(
        config in arrays(),
        seed: u64,
        share in 0.0..1.0,
        more in 0usize..60,
    ) {
        let order = ReadoutOrder::new(&config);
        let counts = random_counts(&config, seed);
        let mut bench = Bench::new(&readout::with_counts(order), config.corner);
        let nets = bench.bus("COUNT");
        for (index, &net) in nets.iter().enumerate() {
            let value = counts[index / order.bits] >> (index % order.bits) & 1 == 1;
            bench.drives.push(Drive::new(Time::ZERO, net, value));
        }
        bench.drive(SETTLING, "RESETB", true);
        let whole = order.periods();
        let lengths = [(share * whole as f64) as usize, whole, whole + more];
        let mut now = SETTLING * 2;
        for length in lengths {
            bench.drive(now, "READ_ENABLE", true);
            now += SETTLING;
            for _ in 0..length {
                bench.pulse(now, HALF, "READ_CLK");
                now += HALF * 2;
            }
            bench.drive(now, "READ_ENABLE", false);
            now += SETTLING;
        }
        let mut sampler = PinSampler::new(&bench.netlist, |_| Logic::X);
        let mut run = bench.start(&[]);
        run.kernel.run(&mut run.stimulus, now, &mut sampler).unwrap();
        let wanted = order.streams(&counts);
        for (found, wanted) in sampler.streams().iter().zip(&wanted) {
            let again = wanted.iter().chain(wanted.iter().cycle());
            let parts = lengths.map(|length| again.clone().take(length).collect::<bitvec::vec::BitVec>());
            let wanted: bitvec::vec::BitVec = parts.iter().flatten().collect();
            prop_assert_eq!(found, &wanted);
        }
    }
}

/// A sensor of this many macropixels after anything that may happen to it, with any number of pins.
fn exposed(seed: u64, rows: usize, cols: usize) -> (Scenario, GateSimulation) {
    let mut scenario = scenario::random(&mut StdRng::seed_from_u64(seed), rows, cols);
    scenario.config.readout_pins = 1 + seed as usize % 3;
    let Scenario {
        config,
        exposure,
        starts,
        ..
    } = &scenario;
    let gate = GateSimulation::new(
        config,
        exposure,
        (0, 0),
        (rows, cols),
        starts,
        &scenario.pulses(),
    );
    (scenario, gate)
}

#[test]
fn what_the_pins_tell_of_an_exposed_sensor_is_what_its_counters_hold() {
    let mut counted = 0;
    for seed in 0..12 {
        let (_, mut gate) = exposed(seed, 1 + seed as usize % 3, 1 + seed as usize / 4);
        gate.run(&mut ());
        let counters = gate.histograms().unwrap();
        counted += counters.counts().iter().filter(|&&count| count > 0).count();
        // Reading takes nothing away.
        for _ in 0..2 {
            assert_eq!(
                gate.read_out(None, &mut ()).unwrap(),
                counters,
                "seed {seed}"
            );
        }
        assert_eq!(gate.histograms().unwrap(), counters);
    }
    assert!(counted > 100);
}

#[test]
fn the_readout_causes_no_event_while_nothing_is_read() {
    struct NetChanges {
        nets: Vec<bool>,
        from: Time,
        found: usize,
    }
    impl Observer for NetChanges {
        fn change(&mut self, time: Time, net: NetId, _: Logic) {
            self.found += usize::from(time > self.from && self.nets[net.index()]);
        }
    }
    let (_, mut gate) = exposed(5, 2, 2);
    let netlist = gate.netlist().clone();
    let mut nets = vec![false; netlist.net_count()];
    let is_readout = |name: &str| {
        ["readout_scanner", "bin_select", "column_", "serialiser"]
            .iter()
            .any(|part| name.starts_with(part))
    };
    for (index, scope) in netlist.scopes().iter().enumerate() {
        if is_readout(&scope.name) {
            for cell in netlist.cells_of(ScopeId::new(index)) {
                for net in netlist.cells()[cell.index()].output_nets() {
                    nets[net.index()] = true;
                }
            }
        }
    }
    assert!(nets.iter().filter(|&&watched| watched).count() > 100);
    let from = gate.schedule().reset_end + SETTLING;
    let mut moved = NetChanges {
        nets,
        from,
        found: 0,
    };
    gate.run(&mut moved);
    assert!(gate.histograms().unwrap().counts().iter().any(|&n| n > 0));
    assert_eq!(moved.found, 0);
}

/// Edge by edge in every net, and what the exported testbench reads from the pins.
#[test]
fn icarus_reads_the_same_through_the_exported_pins() {
    if !icarus::is_here() {
        return;
    }
    for (seed, (rows, cols)) in [(1, 1), (2, 2), (1, 3)].into_iter().enumerate() {
        let (scenario, mut gate) = exposed(seed as u64 + 40, rows, cols);
        let Scenario {
            config,
            exposure,
            starts,
            ..
        } = &scenario;
        let plan = StimulusPlan::new(config, exposure, cols, starts, &scenario.pulses());
        let plan = plan.with_readout();
        let folder = tempfile::tempdir().unwrap();
        export_verilog(folder.path(), config, Some(&plan), None).unwrap();
        icarus::simulate(folder.path(), &["tb.v", "design.v", "cells.v"], &["+vcd"]);
        let seen = IcarusChanges::by_testbench(folder.path());
        let pins = fs::read_to_string(folder.path().join("readout.csv")).unwrap();
        let counters = fs::read_to_string(folder.path().join("histograms.csv")).unwrap();
        assert_eq!(pins, counters, "{config:?}");

        gate = gate.with_readout();
        let all = WaveSelection::all().with_anonymous();
        let mut writer = VcdWriter::new(Vec::new(), gate.netlist(), &all).unwrap();
        gate.run(&mut writer);
        let end = gate.schedule().end;
        let top = gate.netlist().scopes()[0].name.clone();
        let ours = Waves::read(Cursor::new(writer.finish(end).unwrap()), &top);
        let dump = File::open(folder.path().join("dut.vcd")).unwrap();
        let theirs = Waves::read(BufReader::new(dump), "tb.dut");
        ours.compare(&theirs, ["the kernel", "Icarus"], end.as_fs() as u64)
            .unwrap_or_else(|difference| panic!("{difference}\n{config:?}"));
        let flat: Vec<i64> = seen.counts.iter().map(|row| row[3]).collect();
        let found = gate.histograms().unwrap();
        assert!(found.counts().iter().map(|&n| i64::from(n)).eq(flat));
    }
}

/// As the thesis has it (4.7): the next windows come in while the histograms go out, whichever takes longer.
#[test]
fn start_values_are_loaded_while_histograms_are_read() {
    for seed in 0..8 {
        let (mut scenario, _) = exposed(seed, 2, 3);
        let config = &mut scenario.config;
        config.load_clk_hz = [37e6, 200e6, 410e6][seed as usize % 3];
        config.read_clk_hz = [380e6, 90e6][seed as usize % 2];
        let (config, starts) = (&scenario.config, &scenario.starts);
        let pulses = scenario.pulses();
        let exposure = &scenario.exposure;
        let mut gate = GateSimulation::new(config, exposure, (0, 0), (2, 3), starts, &pulses);
        gate.run(&mut ());
        let counters = gate.histograms().unwrap();
        let next: Vec<u16> = starts.iter().map(|s| config.largest_start() - s).collect();
        let read = gate.read_out(Some(&next), &mut ()).unwrap();
        assert_eq!(read, counters, "{config:?}");
        assert_eq!(gate.histograms().unwrap(), counters);
        scenario.starts = next;
        assert_eq!(gate.loaded(), scenario.loaded());
    }
}

/// What a reading during the exposure sees is caught in the middle of counting, but it disturbs no count.
#[test]
fn a_reading_during_the_exposure_leaves_the_counts_as_they_are() {
    for seed in 0..6 {
        let (scenario, mut gate) = exposed(seed, 2, 2);
        let Scenario {
            config,
            exposure,
            starts,
            ..
        } = &scenario;
        gate.run(&mut ());
        let counters = gate.histograms().unwrap();

        let pulses = scenario.pulses();
        let plan = StimulusPlan::new(config, exposure, 2, starts, &pulses).with_readout();
        let netlist = gate.netlist();
        let pins = SensorPins::find(netlist);
        let mut drives: Vec<Drive> = plan.stimulus(&pins).collect();
        let schedule = plan.schedule;
        let mut now = schedule.origin;
        drives.push(Drive::new(now, pins.read.enable, true));
        while now + HALF * 4 < schedule.counted {
            drives.push(Drive::new(now + HALF, pins.read.clk, true));
            drives.push(Drive::new(now + HALF * 2, pins.read.clk, false));
            now += HALF * 2;
        }
        drives.push(Drive::new(now + HALF, pins.read.enable, false));
        let mut kernel = Kernel::new(netlist, gate.timing());
        let mut stimulus = Stimulus::sorted(drives);
        kernel.run(&mut stimulus, now + HALF * 2, &mut ()).unwrap();
        // What is read after it is right again.
        let mut sampler = PinSampler::new(netlist, |net| kernel.value(net));
        kernel
            .run(&mut stimulus, schedule.end, &mut sampler)
            .unwrap();
        let read = sampler.counts(&plan.readout().unwrap());
        let wanted = counters.counts().iter().map(|&count| Some(count));
        assert!(read.into_iter().eq(wanted), "seed {seed}");
    }
}
