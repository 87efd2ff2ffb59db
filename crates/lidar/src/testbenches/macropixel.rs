//! Testbench of the macropixel: two of them in a sensor, as in Fig. 48, and what a photon becomes on its way to
//! a bin (thesis 4.2, 4.3, Fig. 47, 48).
//!
//! ```text
//!   SPAD_RAW ─► mp_r0_c0, start value 52 ─► LOCAL_STOP ─► histogram
//!          └──► mp_r0_c1, start value 49 ─► LOCAL_STOP, 3 CLK periods earlier ─► the same histogram, 3 bins on
//! ```
//!
//! Everything goes through the sensor's pins: serial load, CLK, STOP and the SPADs' pulses.

mod photons;

use std::fmt::Debug;
use std::path::Path;

use crate::chip::window_law::{OpenWindow, WindowOutcome};
use crate::chip::{
    self, EventType, Exposure, Mode, Probe, Race, Sensor, SensorConfig, SensorPins, Tdc, WindowLaw,
    array, histogram, probes,
};
use crate::engine::GateSimulation;
use crate::engine::waveform::hits;
use crate::files::InputError;
use crate::kernel::Recorder;
use crate::netlist::Netlist;
use crate::photon::{SpadEvent, apply_dead_time};
use crate::report::Checks;
use crate::testbenches::Testbench;
use crate::testbenches::rig::{beside, record_exposure};
use crate::testbenches::testbench::GivenSensor;
use crate::units::Time;
use crate::waves::{Entry, Layout, Mark, SignalGroup};

/// Start values of Fig. 48's two macropixels, three bins apart.
const FIG_48: [u16; 2] = [52, 49];
/// Start values of two macropixels of HSLIDAR, half a window apart.
const HSLIDAR: [u16; 2] = [13, 12];
/// CLK periods between two STOP edges, where windows are short.
const STOP_PERIODS: u32 = 64;

/// CLK periods between two STOP edges that leave room for two windows.
fn stop_periods(sensor: &SensorConfig) -> u32 {
    STOP_PERIODS.max((sensor.bins + 3 * sensor.step_periods) as u32 + 40)
}

pub(super) const TESTBENCH: Testbench = Testbench {
    name: "tb_macropixel",
    about: "Macropixels: Fig. 48's two windows, and which photon is counted where",
    run,
    given: Some(GivenSensor {
        blocks: &["correlation", "front_end", "metdc", "histogram"],
        check: |sensor| window_starts(&driven(sensor)).map(|_| ()),
        run: run_on,
    }),
};

fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    two_windows(waves, &config(), FIG_48, "Fig. 48", checks)?;
    let hslidar = beside(waves, "tb_macropixel_hslidar");
    let chip = SensorConfig {
        rows: 1,
        ..(*chip::hslidar()).clone()
    };
    two_windows(&hslidar, &chip, HSLIDAR, "4.9.3", checks)?;
    photons::bin_edge(checks);
    photons::full_bins(checks);
    photons::coincidences(&config(), (20, 32), checks);
    photons::cancelling_pulses(checks);
    Ok(())
}

/// What any sensor and block must do, against the law of the built-in ones.
fn run_on(sensor: &SensorConfig, waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let sensor = driven(sensor);
    let starts = window_starts(&sensor)?;
    two_windows(waves, &sensor, starts, "Fig. 48", checks)?;
    photons::coincidences(&sensor, (starts[1], stop_periods(&sensor)), checks);
    Ok(())
}

/// A row of macropixels in which every photon is an event.
fn driven(sensor: &SensorConfig) -> SensorConfig {
    SensorConfig {
        rows: 1,
        event_type: EventType::Greater,
        threshold: 0,
        ..sensor.clone()
    }
}

/// The start values of Fig. 48, or two others, at most three apart, whose windows and the CLK periods around them lie within a laser cycle.
fn window_starts(sensor: &SensorConfig) -> Result<[u16; 2], InputError> {
    let refused = |why: &str| {
        let message = format!("cannot be driven by tb_macropixel: {why}");
        Err(InputError::new("the sensor", message))
    };
    if sensor.tdc == Tdc::DelayLine {
        return refused("delay lines time its photons; run tb_delay_line without a sensor");
    }
    if sensor.lines() != sensor.spads() {
        return refused("its SPADs share a wire; run tb_front_ends without a sensor");
    }
    if sensor.mode == Mode::Conventional {
        return refused("its macropixels have one window; give mode = \"guided\"");
    }
    if !sensor.p_counter.row().has_memory {
        return refused("its P-counter has no memory; run tb_p_counter_variants without a sensor");
    }
    if sensor.bins < 2 {
        return refused("windows of one bin share none; give 2 bins or more");
    }
    let exposure = Exposure::new(sensor, stop_periods(sensor), 1);
    // Windows share bins.
    let Some(apart) = [3, 2, 1]
        .into_iter()
        .find(|&apart| apart * sensor.step_periods < sensor.bins)
    else {
        return refused(&format!(
            "no two of its windows share any of their {} bins; give a smaller step_periods",
            sensor.bins
        ));
    };
    let fits = |&start: &u16| {
        let Some((law, window)) = find_window(sensor, &exposure, start) else {
            return false;
        };
        let last = (sensor.bins + apart * sensor.step_periods) as i64 + 5;
        law.bin_interval(&window, 0, -5).start > Time::ZERO
            && law.bin_interval(&window, 0, last).end < exposure.stop(1)
    };
    let apart = apart as u16;
    let pairs = (apart..=sensor.largest_start()).rev();
    let pairs = pairs.map(|later| [later, later - apart]);
    let known = (apart == 3 && FIG_48[0] <= sensor.largest_start()).then_some(FIG_48);
    match known
        .into_iter()
        .chain(pairs)
        .find(|starts| starts.iter().all(fits))
    {
        Some(starts) => Ok(starts),
        None => match race(sensor, &exposure) {
            Some(race) => refused(&format!("{race}; {}", race.cure)),
            None => refused(&format!(
                "no two start values {apart} apart open windows of {} bins within {} CLK periods; give more counter_bits",
                sensor.bins, exposure.stop_periods
            )),
        },
    }
}

/// A sensor of one macropixel.
fn config() -> SensorConfig {
    SensorConfig {
        rows: 1,
        cols: 1,
        ..SensorConfig::default()
    }
}

/// The law of an exposure, and the window that it gives a start value.
fn window(config: &SensorConfig, exposure: &Exposure, start: u16) -> (WindowLaw, OpenWindow) {
    find_window(config, exposure, start).expect("a start value within the laser cycle")
}

/// The same; `None` where there is no window.
fn find_window(
    config: &SensorConfig,
    exposure: &Exposure,
    start: u16,
) -> Option<(WindowLaw, OpenWindow)> {
    let law = built_in_law(config, exposure);
    let window = law.window(start).open()?;
    Some((law, window))
}

/// The signals that come too close to each other to tell a window.
fn race(config: &SensorConfig, exposure: &Exposure) -> Option<Race> {
    let law = built_in_law(config, exposure);
    (0..=config.largest_start()).find_map(|start| match law.window(start) {
        WindowOutcome::Race(race) => Some(race),
        _ => None,
    })
}

/// The law with the built-in blocks.
fn built_in_law(config: &SensorConfig, exposure: &Exposure) -> WindowLaw {
    let built_in = SensorConfig {
        correlation_block: None,
        front_end_block: None,
        metdc_block: None,
        histogram_block: None,
        ..config.clone()
    };
    WindowLaw::new(built_in, exposure)
}

/// The middle of a bin in one laser cycle.
fn middle(law: &WindowLaw, window: &OpenWindow, cycle: u32, bin: i64) -> Time {
    let bin = law.bin_interval(window, cycle as i64, bin);
    Time::from_fs((bin.start + bin.end).as_fs() / 2)
}

/// What the window law says is counted of pulses that come alone in their CLK period.
fn by_law(
    config: &SensorConfig,
    exposure: &Exposure,
    start: u16,
    pulses: &[SpadEvent],
) -> Vec<u16> {
    let (law, window) = window(config, exposure, start);
    let in_bin = |bin: i64, pulse: &&SpadEvent| {
        let mut cycles = 0..exposure.laser_cycles as i64;
        cycles.any(|cycle| law.bin_interval(&window, cycle, bin).contains(&pulse.time))
    };
    let bins = 0..config.bins as i64;
    let hits = bins.map(|bin| pulses.iter().filter(|p| in_bin(bin, p)).count());
    hits.map(|hits| histogram::model(hits as u64, config.bin_bits as u32, config.overflow))
        .collect()
}

/// Histograms and other lists, or that there is none.
fn counts_text<T: Debug>(counts: &Option<T>) -> String {
    counts
        .as_ref()
        .map_or("unknown".to_owned(), |c| format!("{c:?}"))
}

/// Two macropixels with windows that overlap, in the same light.
fn two_windows(
    waves: &Path,
    sensor: &SensorConfig,
    starts: [u16; 2],
    figure: &str,
    checks: &mut Checks,
) -> Result<(), InputError> {
    let config = SensorConfig {
        cols: 2,
        ..sensor.clone()
    };
    let exposure = Exposure::new(&config, stop_periods(&config), 6);
    let shift = usize::from(starts[0] - starts[1]) * config.step_periods;
    let (law, second) = window(&config, &exposure, starts[1]);
    let photons_of = |bin: i64| (bin * bin * bin + 3 * bin).rem_euclid(11) as u32 / 2;
    // Photons from before the earlier window to after the later one, a different number in every CLK period;
    // no SPAD fires twice within its dead time.
    let (first_bin, last_bin) = (-4, (config.bins + shift) as i64 + 4);
    let mut pulses: Vec<SpadEvent> = (0..exposure.laser_cycles)
        .flat_map(|cycle| (first_bin..last_bin).map(move |bin| (cycle, bin)))
        .filter(|(cycle, bin)| (cycle + 3) % exposure.laser_cycles <= photons_of(*bin))
        .map(|(cycle, bin)| SpadEvent {
            time: middle(&law, &second, cycle, bin),
            spad: bin.rem_euclid(config.spads() as i64) as u8,
        })
        .collect();
    pulses.sort_unstable();
    apply_dead_time(&mut pulses, &config.spad_model(), 0);

    let lists = [&pulses[..], &pulses[..]];
    let mut gate = GateSimulation::new(&config, &exposure, (0, 0), (1, 2), &starts, &lists);
    let local_stop = SensorPins::find(gate.netlist()).local_stop;
    let mut recorder = Recorder::new(local_stop.iter().copied());
    let origin = gate.schedule().origin;
    // Edges of the bins of both windows, the earlier one's first.
    let edges =
        (0..=(config.bins + shift) as i64).map(|bin| law.bin_interval(&second, 0, bin).start);
    let edges: Vec<Time> = edges.map(|edge| origin + edge).collect();
    let view = view(
        (&config, gate.netlist()),
        (starts, figure),
        (origin, origin + exposure.stop(1)),
        edges,
    );
    record_exposure(&mut gate, waves, &view, &mut recorder)?;

    checks.equal(
        "start values loaded",
        counts_text(&Some(starts)),
        counts_text(&gate.loaded().into_iter().collect::<Option<Vec<u16>>>()),
    );
    let histograms = gate.histograms().ok();
    for (pixel, &start) in starts.iter().enumerate() {
        let found = histograms.as_ref().map(|h| &h[pixel]);
        checks.equal(
            format!("start value {start}: histogram, against the window law"),
            counts_text(&Some(by_law(&config, &exposure, start, &pulses))),
            counts_text(&found),
        );
    }
    let (later, earlier) = match &histograms {
        Some(h) => (&h[0][..config.bins - shift], &h[1][shift..]),
        None => (&[][..], &[][..]),
    };
    checks.add_verdict(
        format!(
            "bins 0 up of {} are bins {shift} up of {}",
            starts[0], starts[1]
        ),
        format!("{earlier:?}"),
        format!("{later:?}"),
        !later.is_empty() && later == earlier,
    );
    let rises = local_stop
        .iter()
        .map(|&net| {
            let rises = recorder.rising_edges(net).into_iter();
            // A counter without a first STOP may raise it before.
            rises.filter(|rise| *rise >= origin).collect()
        })
        .collect::<Vec<Vec<Time>>>();
    let sensor = Sensor::from(config.clone());
    let skew = |pixel: usize| sensor.clk_skew(pixel);
    let local_stop_of = |pixel: usize| {
        let (_, window) = window(&config, &exposure, starts[pixel]);
        window.strobe_cause + skew(pixel)
    };
    // Each edge of CLK is rounded to a femtosecond.
    let expected = local_stop_of(0) - local_stop_of(1);
    let in_periods = exposure.clock.periods(shift as i64);
    let is_whole = (expected - in_periods).as_fs().abs() <= 1;
    let expected_text = if is_whole {
        format!("{shift} periods, {in_periods}")
    } else {
        format!("{expected}, by the law")
    };
    for (cycle, (later, earlier)) in rises[0].iter().zip(&rises[1]).enumerate() {
        let found = *later - *earlier;
        checks.add_verdict(
            format!(
                "laser cycle {cycle}: LOCAL_STOP {} before that of {}",
                starts[1], starts[0]
            ),
            &expected_text,
            found,
            (found - expected).as_fs().abs() <= 1,
        );
    }
    for (pixel, (rises, start)) in rises.iter().zip(starts).enumerate() {
        let what = format!("start value {start}: LOCAL_STOPs");
        checks.equal(what, exposure.laser_cycles as usize, rises.len());
        let found: Vec<Time> = rises.iter().take(1).map(|&t| t - origin).collect();
        let what = format!("start value {start}: first LOCAL_STOP after STOP, by the law");
        checks.times(what, local_stop_of(pixel), &found);
    }
    Ok(())
}

fn view(
    (config, netlist): (&SensorConfig, &Netlist),
    (starts, figure): ([u16; 2], &str),
    (origin, end): (Time, Time),
    edges: Vec<Time>,
) -> Layout {
    // Where few bins leave room, the view shows all of them and opens on the windows, so that a value has its place in a CLK
    // period; else the first, the middle and the last bin, in a whole laser cycle.
    let has_room = config.bins <= 8;
    let pins = if has_room {
        &["CLK", "STOP"][..]
    } else {
        &["CLK", "STOP", "ENABLE"]
    };
    let pins = pins.iter().copied().map(Entry::binary);
    let mut groups = vec![SignalGroup::new("Global signals", pins)];
    let is_there = |entry: &Entry| netlist.signal(&entry.path).is_some();
    for (col, start) in starts.into_iter().enumerate() {
        let pixel = array::pixel_name(0, col);
        let signals = [
            Entry::hex(Probe::SpadRaw.path(&pixel)),
            Entry::hex(Probe::SpadTimed.path(&pixel)),
            Entry::binary(Probe::SpadEvent.path(&pixel)),
            Entry::decimal(Probe::CounterOut.path(&pixel)),
            Entry::binary(Probe::LocalStop.path(&pixel)),
            Entry::binary(Probe::Shift.path(&pixel)),
            hits(Probe::Hit.path(&pixel), config.bins),
            // Of a counter TDC.
            Entry::decimal(Probe::Code.path(&pixel)),
            Entry::decimal(Probe::Events.path(&pixel)),
            Entry::binary(Probe::Select.path(&pixel)),
        ];
        let bins = if has_room {
            (0..config.bins).collect()
        } else {
            vec![0, config.bins / 2, config.bins - 1]
        };
        let bins = bins.into_iter();
        let bins = bins.map(|bin| Entry::decimal(probes::bin_path(&pixel, bin)));
        groups.push(SignalGroup::new(
            format!("Macropixel {}: start value {start} ({figure})", col + 1),
            signals.into_iter().filter(is_there).chain(bins),
        ));
    }
    let mut marks = vec![Mark::new(origin, "STOP")];
    for start in starts {
        let first = usize::from(start - starts[1]) * config.step_periods;
        marks.push(Mark::new(edges[first], format!("{start} on")));
        marks.push(Mark::new(
            edges[first + config.bins],
            format!("{start} off"),
        ));
    }
    let shown = match edges[..] {
        // LOCAL_STOP and the counts come some CLK periods after the last bin's photons.
        [first, .., last] if has_room => (first, last + Time::from_s(3.0 / config.clk_hz)),
        _ => (origin, end + Time::from_ns(5)),
    };
    Layout {
        groups,
        zoom: (shown.0 - Time::from_ns(5), shown.1),
        marker: Some(origin),
        marks,
    }
}
