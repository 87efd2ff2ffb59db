//! Testbench of the readout: an exposed sensor's histograms leave through its pins while the next start values come in
//! (thesis 4.2, 4.7), and what a whole array takes for both.
//!
//! ```text
//!   exposed macropixels ─ WORD ─► column_bus ─ COLUMN ─► serialiser ─► DATA_OUT      READ_CLK, READ_ENABLE
//!   COUNTER_INITS ─► deserialiser ─► memories                                       LOAD_CLK, LOAD_ENABLE
//! ```
//!
//! Three columns share two pins, so that the second serialiser has fewer columns than the first. Then
//! a small array and the whole one are loaded and read with nothing but memories and counts behind them, at 50 to 400 MHz.

use std::path::Path;

use crate::chip::readout::ReadoutOrder;
use crate::chip::{
    Exposure, LoadPins, LoadProbe, Probe, ReadPins, ReadProbe, SensorConfig, WindowLaw, array,
    probes,
};
use crate::engine::GateSimulation;
use crate::engine::readout::{PinNetlists, PinTimes, sparse_counts};
use crate::engine::waveform::write_waves;
use crate::files::InputError;
use crate::kernel::Recorder;
use crate::photon::SpadEvent;
use crate::report::Checks;
use crate::testbenches::Testbench;
use crate::units::{Frequency, Time};
use crate::waves::{Entry, Layout, SignalGroup};

/// Shown before the readout begins.
const PAUSE: Time = Time::from_ns(50);
/// Clocks of deserialiser and serialisers that are compared, MHz.
const CLOCKS_MHZ: [u32; 6] = [50, 100, 150, 200, 300, 400];

pub(super) const TESTBENCH: Testbench = Testbench {
    name: "tb_readout",
    about: "Readout: counts leave through the pins while start values come in; both times, 50 to 400 MHz",
    run,
    given: None,
};

fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    exposed_sensor(waves, checks)?;
    clocks(checks);
    whole_array(checks);
    Ok(())
}

/// Pulses that give every macropixel counts of its own: the photon of bin b in every laser cycle from the b-th on.
fn pulses(config: &SensorConfig, exposure: &Exposure, start: u16, pixel: usize) -> Vec<SpadEvent> {
    let law = WindowLaw::new(config, exposure);
    let first = law
        .window(start)
        .open()
        .map_or(1, |window| window.first_edge);
    let periods = i64::from(exposure.stop_periods);
    let cycles = 0..i64::from(exposure.laser_cycles);
    let half = Time::from_fs(exposure.clock.period().as_fs() / 2);
    let bins = move |cycle: i64| (0..=cycle.min(14)).filter(move |bin| bin % 5 == pixel as i64 % 5);
    let of_cycle = |cycle| {
        bins(cycle).map(move |bin| SpadEvent {
            time: exposure.rising(cycle * periods + first + bin) - half,
            spad: (bin % config.spads() as i64) as u8,
        })
    };
    let mut pulses: Vec<SpadEvent> = cycles.flat_map(of_cycle).collect();
    pulses.sort_unstable();
    pulses
}

fn exposed_sensor(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let config = SensorConfig {
        rows: 2,
        cols: 3,
        readout_pins: 2,
        ..SensorConfig::default()
    };
    let order = ReadoutOrder::new(&config);
    let exposure = Exposure::new(&config, 64, 16);
    let starts: Vec<u16> = (0..config.pixels() as u16).map(|i| 20 + 3 * i).collect();
    let next: Vec<u16> = starts.iter().map(|start| 511 - start).collect();
    let photons: Vec<Vec<SpadEvent>> = (0..config.pixels())
        .map(|pixel| pulses(&config, &exposure, starts[pixel], pixel))
        .collect();
    let photons: Vec<&[SpadEvent]> = photons.iter().map(Vec::as_slice).collect();
    let size = (config.rows, config.cols);
    let mut gate = GateSimulation::new(&config, &exposure, (0, 0), size, &starts, &photons);
    let netlist = std::sync::Arc::clone(gate.netlist());
    let pins = ReadPins::find(&netlist);
    let (word_load, load_clk) = (
        ReadProbe::WordLoad.net(&netlist),
        LoadPins::find(&netlist).clk,
    );
    let mut recorder = Recorder::new([pins.clk, pins.enable, word_load, load_clk]);
    let counted = gate.schedule().counted;
    let mut read = None;
    let view = view(&config, counted);
    write_waves(waves, &netlist, &view, |waves| {
        gate.run(&mut (&mut *waves, &mut recorder));
        let mut observers = (&mut *waves, &mut recorder);
        read = Some(gate.read_out(Some(&next), &mut observers));
        gate.now()
    })?;

    let counters = gate.histograms();
    let read = read.expect("it has been read");
    let sum = |counts: &[u16]| counts.iter().map(|&n| u64::from(n)).sum::<u64>();
    match (counters, read) {
        (Ok(counters), Ok(read)) => {
            checks.add_verdict(
                "counts of the exposure",
                "more than 0",
                sum(counters.counts()).to_string(),
                sum(counters.counts()) > 0,
            );
            let equal = counters.counts().iter().zip(read.counts());
            checks.equal(
                "counts that the pins tell as the counters hold them",
                counters.counts().len(),
                equal.filter(|(a, b)| a == b).count(),
            );
        }
        (counters, read) => {
            checks.equal("counters are known", true, counters.is_ok());
            checks.equal("bits of the pins are known", true, read.is_ok());
        }
    }
    let loaded = gate.loaded().into_iter().zip(&next);
    checks.equal(
        "start values that came in meanwhile",
        next.len(),
        loaded.filter(|(a, b)| *a == Some(**b)).count(),
    );
    let reads = recorder.rising_edges(pins.clk);
    checks.equal(
        "READ_CLK rises, rows x bins x columns of a pin x bits",
        order.periods(),
        reads.len(),
    );
    let words = recorder.rising_edges(word_load);
    checks.equal(
        "words taken while reading",
        config.rows * config.bins,
        words.into_iter().filter(|&t| t > reads[0]).count(),
    );
    let last_load = recorder.rising_edges(load_clk).into_iter().next_back();
    let last_load = last_load.unwrap_or(Time::ZERO);
    checks.add_verdict(
        "the load ends before the readout",
        "yes",
        format!("{} before it", reads[reads.len() - 1] - last_load),
        last_load > reads[0] && last_load < reads[reads.len() - 1],
    );
    Ok(())
}

/// Whether every start value and every count came through.
fn is_right(times: &PinTimes, config: &SensorConfig) -> bool {
    times.starts_right == config.pixels() && times.counts_right == config.pixels() * config.bins
}

/// Four rows of eight columns, the columns of one pin, at every clock.
fn clocks(checks: &mut Checks) {
    let config = SensorConfig {
        rows: 4,
        cols: 8,
        readout_pins: 1,
        ..SensorConfig::default()
    };
    let netlists = PinNetlists::new(&config);
    let most = ((1u32 << config.bin_bits) - 1) as u16;
    let counts: Vec<u16> = (0..config.pixels() * config.bins)
        .map(|i| (i as u16).wrapping_mul(0x9e37) & most)
        .collect();
    let order = ReadoutOrder::new(&config);
    for mhz in CLOCKS_MHZ {
        let found = netlists.run_at(mhz, &config, &counts);
        let (load, read) = (found.load.as_s() * 1e6, found.read.as_s() * 1e6);
        let clock = Frequency::from_hz_f64(f64::from(mhz) * 1e6).expect("a frequency");
        let expected = [config.load_bits(), order.periods()].map(|n| clock.periods(n as i64));
        let off = |a: Time, b: Time| (a - b).as_fs().abs();
        let is_exact = off(found.load, expected[0]) <= 1 && off(found.read, expected[1]) <= 1;
        checks.add_verdict(
            format!("4 x 8, one pin, {mhz} MHz: load and readout, us"),
            "all right, a period a bit",
            format!("{load:7.2} {read:7.2}"),
            is_right(&found, &config) && is_exact,
        );
    }
}

/// The whole sensor, with a count here and there.
fn whole_array(checks: &mut Checks) {
    let config = SensorConfig::default();
    let counts = sparse_counts(&config);
    let netlists = PinNetlists::new(&config);
    let pins = ReadoutOrder::new(&config).pins();
    for mhz in CLOCKS_MHZ {
        let found = netlists.run_at(mhz, &config, &counts);
        let (load, read) = (found.load.as_s() * 1e6, found.read.as_s() * 1e6);
        checks.add_verdict(
            format!("64 x 64, {pins} pins, {mhz} MHz: load and readout, us (4.7)"),
            "all right, load shorter",
            format!("{load:7.2} {read:7.2}"),
            is_right(&found, &config) && found.load <= found.read,
        );
    }
    let least = (1..=config.cols).find(|&readout_pins| {
        let config = SensorConfig {
            readout_pins,
            ..config.clone()
        };
        config.readout_time() < config.load_time()
    });
    let bits = config.histogram_bits() as f64 / config.load_bits() as f64;
    checks.add_verdict(
        "pins from which on a load outlasts the readout at the same clock",
        format!("more than {bits:.1}, the ratio of bits"),
        least.map_or("none".to_owned(), |pins| pins.to_string()),
        least.is_some_and(|pins| pins as f64 > bits),
    );
}

/// The readout from its beginning: scanner, columns, pins; then the load that goes on meanwhile; then counts.
fn view(config: &SensorConfig, counted: Time) -> Layout {
    let word = config
        .read_clock()
        .periods(ReadoutOrder::new(config).word_periods() as i64);
    let readout = [
        Entry::binary(ReadProbe::Enable.path()),
        Entry::binary(ReadProbe::Clk.path()),
        Entry::binary(ReadProbe::Row.path()),
        Entry::binary(ReadProbe::Bin.path()),
        Entry::decimal(ReadProbe::Bit.path()),
        Entry::binary(ReadProbe::WordLoad.path()),
        Entry::hex(ReadProbe::Word.path()),
        Entry::hex(ReadProbe::Column.path()),
        Entry::binary(ReadProbe::DataOut.path()),
    ];
    let load = [
        Entry::binary(LoadProbe::Enable.path()),
        Entry::binary(LoadProbe::Clk.path()),
        Entry::binary(LoadProbe::Serial.path()),
        Entry::hex(LoadProbe::Row.path()),
        Entry::binary(LoadProbe::MemoryLoad.path()),
    ];
    let mut groups = vec![
        SignalGroup::new("Readout (4.2)", readout),
        SignalGroup::new("Load meanwhile (4.7)", load),
    ];
    for col in 0..config.cols {
        let pixel = array::pixel_name(0, col);
        let bins = (0..3).map(|bin| Entry::decimal(probes::bin_path(&pixel, bin)));
        let memory = [Entry::decimal(Probe::Memory.path(&pixel))];
        groups.push(SignalGroup::new(
            format!("Macropixel {pixel}"),
            bins.chain(memory),
        ));
    }
    Layout::new(groups, (counted - PAUSE, counted + word * 3), counted)
}
