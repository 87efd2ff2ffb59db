//! Waveforms of the sensor: every named net as VCD or FST, and beside it views for GTKWave and Surfer that group the
//! signals as the thesis's timing diagrams do (Fig. 47, 54, 57) and open at the first HIT.

use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;

use super::gate::GateSimulation;
use super::{Replay, Window};
use crate::chip::window_law::{OpenWindow, WindowLaw};
use crate::chip::{Exposure, LoadProbe, Probe, Probes, SensorConfig};
use crate::files::InputError;
use crate::kernel::Observer;
use crate::logic::Logic;
use crate::netlist::{NetId, Netlist};
use crate::photon::SpadEvent;
use crate::units::Time;
use crate::waves::{
    Entry, Layout, Mark, SignalGroup, WaveFile, WaveFormat, WaveSelection, write_views,
};

/// CLK periods that a view shows before its marker, and after: the end of a window, and what becomes of it.
const SHOWN_PERIODS: (i64, i64) = (18, 4);

/// Laser cycles kept before the first one that counts, and after it.
const KEPT_AROUND: (i64, i64) = (1, 2);

/// Which laser cycles a waveform keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum WaveCycles {
    /// The first laser cycle that counts, one before it (the load, if there is none) and two after it. Where nothing is
    /// ever counted, the first laser cycles.
    #[default]
    FirstHits,
    /// So many laser cycles from power-up on.
    First(u32),
    /// Everything from power-up on.
    All,
}

/// Laser cycles that the simulation of a macropixel has at least, so that there is something to compare: a laser cycle of the gates takes
/// 0.3 ms.
const LEAST_SIMULATED: i64 = 64;

impl WaveCycles {
    /// Laser cycles to simulate for the waveform of one macropixel: those that it keeps, and 64 at least.
    pub fn simulated(
        self,
        config: &SensorConfig,
        exposure: &Exposure,
        start: u16,
        pulses: &[SpadEvent],
    ) -> u32 {
        let (_, until) = self.kept_cycles(config, exposure, start, pulses);
        let wanted = LEAST_SIMULATED.max(until + 1);
        wanted.min(exposure.laser_cycles.into()) as u32
    }

    /// Laser cycles of which the waveform of one macropixel is kept; it has everything from power-up if the first of
    /// them is not after the exposure's first.
    fn kept_cycles(
        self,
        config: &SensorConfig,
        exposure: &Exposure,
        start: u16,
        pulses: &[SpadEvent],
    ) -> (i64, i64) {
        match self {
            WaveCycles::All => (0, i64::from(exposure.laser_cycles)),
            WaveCycles::First(cycles) => (0, i64::from(cycles)),
            WaveCycles::FirstHits => {
                let first = first_counting_cycle(config, exposure, start, pulses);
                let first = i64::from(first.unwrap_or(0));
                (first - KEPT_AROUND.0, first + 1 + KEPT_AROUND.1)
            }
        }
    }
}

/// The laser cycle of a macropixel's first count by the window law, `None` if it never counts or the law does not hold
/// for this start value.
fn first_counting_cycle(
    config: &SensorConfig,
    exposure: &Exposure,
    start: u16,
    pulses: &[SpadEvent],
) -> Option<u32> {
    let counts_within = |laser_cycles: u32| {
        let part = Exposure {
            laser_cycles,
            ..*exposure
        };
        let end = part.end();
        let seen = pulses.partition_point(|pulse| pulse.time < end);
        let histogram = Window::new(config, &part).histogram(start, &pulses[..seen]);
        Some(histogram.ok()?.iter().any(|&count| count > 0))
    };
    // Nothing within `without` laser cycles, something within `with`. Doubling keeps the search as cheap as what it
    // finds, and below the number of laser cycles after which a counter could have wrapped to zero.
    let (mut without, mut with) = (0, 1);
    while !counts_within(with)? {
        if with == exposure.laser_cycles {
            return None;
        }
        without = with;
        with = with.saturating_mul(2).min(exposure.laser_cycles);
    }
    while with - without > 1 {
        let middle = without + (with - without) / 2;
        if counts_within(middle)? {
            with = middle
        } else {
            without = middle
        }
    }
    Some(without)
}

/// What a waveform keeps and shows. Times are from the first rising edge of STOP.
#[derive(Debug, Clone)]
pub struct View {
    /// Macropixels (row, col): the one that hits first is shown, the first of them if none does.
    pixels: Vec<(usize, usize)>,
    /// Where the first window of the first of them closes: the marker, if none hits.
    closing: Time,
    /// The law of the first of them and its window, whose ends are marked.
    law: WindowLaw,
    window: Option<OpenWindow>,
    /// What is shown before and after the marker.
    around: (Time, Time),
    /// From when to when changes are kept; from power-up if the beginning is not after the first rising edge of STOP.
    kept: RangeInclusive<Time>,
    /// Whether the simulation may end with what is kept.
    is_part: bool,
}

impl View {
    /// Everything about these macropixels; `start` is the start value of the first.
    pub fn of_array(
        pixels: Vec<(usize, usize)>,
        config: &SensorConfig,
        exposure: &Exposure,
        start: u16,
    ) -> Self {
        let law = WindowLaw::new(config, exposure);
        let window = law.window(start).open();
        let (before, after) = SHOWN_PERIODS;
        View {
            pixels,
            closing: window.map_or(Time::ZERO, |open| open.strobe_cause),
            law,
            window,
            around: (
                exposure.clock.periods(before),
                exposure.clock.periods(after),
            ),
            kept: Time::ZERO..=Time::MAX,
            is_part: false,
        }
    }

    /// STOP, the ends of the window and the strobe in the laser cycle in which the marker stands, `marker` after the first STOP edge.
    /// Of another macropixel than the first STOP alone is known.
    fn marks(&self, origin: Time, (pixel, marker): ((usize, usize), Time)) -> Vec<Mark> {
        let exposure = self.law.exposure();
        let cycles = (0..i64::from(exposure.laser_cycles)).rev();
        let cycle = { cycles }.find(|&cycle| exposure.stop(cycle) <= marker);
        let cycle = cycle.unwrap_or(0);
        let stop = exposure.stop(cycle);
        let mut marks = vec![Mark::new(origin + stop, "STOP")];
        if let Some(window) = self.window.filter(|_| pixel == self.pixels[0]) {
            let seen = self.law.interval_in(&window, cycle);
            for (time, name) in [
                (seen.start, "window begins"),
                (seen.end, "window ends"),
                (stop + window.strobe_cause, "strobe"),
            ] {
                marks.push(Mark::new(origin + time, name));
            }
        }
        marks
    }

    /// What is to be kept of one macropixel with its start value and SPAD pulses (in order of time).
    pub fn of_pixel(
        pixel: (usize, usize),
        config: &SensorConfig,
        exposure: &Exposure,
        start: u16,
        pulses: &[SpadEvent],
        cycles: WaveCycles,
    ) -> Self {
        let (from, until) = cycles.kept_cycles(config, exposure, start, pulses);
        View {
            kept: stop(exposure, from)..=stop(exposure, until),
            ..Self::of_array(vec![pixel], config, exposure, start)
        }
    }

    /// One laser cycle of one macropixel with its start value, and nothing after it.
    pub fn of_cycle(
        pixel: (usize, usize),
        config: &SensorConfig,
        exposure: &Exposure,
        start: u16,
        cycle: u32,
    ) -> Self {
        let cycle = i64::from(cycle);
        let whole = Self::of_array(vec![pixel], config, exposure, start);
        View {
            closing: exposure.stop(cycle) + whole.closing,
            kept: stop(exposure, cycle)..=stop(exposure, cycle + 1),
            is_part: true,
            ..whole
        }
    }
}

/// The rising STOP edge of a laser cycle. The counts of the exposure's last one settle after its end.
fn stop(exposure: &Exposure, cycle: i64) -> Time {
    match cycle {
        cycle if cycle >= i64::from(exposure.laser_cycles) => Time::MAX,
        cycle => exposure.stop(cycle),
    }
}

/// Runs `simulation` to its end, or that of a view of one laser cycle, with every named net in the file `waves` (and `observer` watching, too), and writes the
/// views beside it.
///
/// # Errors
/// When a file cannot be written.
pub fn record(
    simulation: &mut GateSimulation,
    waves: &Path,
    format: WaveFormat,
    view: &View,
    observer: &mut dyn Observer,
) -> Result<(), InputError> {
    let schedule = simulation.schedule();
    let origin = schedule.origin;
    let waveform_time = |time: Time| match time {
        Time::MAX => schedule.end,
        time => (origin + time).min(schedule.end),
    };
    let span = match *view.kept.start() {
        from if from > Time::ZERO => waveform_time(from)..=waveform_time(*view.kept.end()),
        _ => Time::ZERO..=waveform_time(*view.kept.end()),
    };
    let netlist = Arc::clone(simulation.netlist());
    let mut first_hit = FirstHit::new(&netlist, &view.pixels, origin.max(*span.start()));
    let mut file = WaveFile::create(waves, format, &netlist, &WaveSelection::all(), span.clone())?;
    let end = if view.is_part {
        *span.end()
    } else {
        schedule.end
    };
    simulation.run_until(end, &mut (&mut file, (&mut first_hit, observer)));
    file.finish(end)?;
    let found = first_hit.found.filter(|(time, _)| span.contains(time));
    let (marker, pixel) = found.unwrap_or((origin + view.closing, view.pixels[0]));
    let marks = view.marks(origin, (pixel, marker - origin));
    // The whole window, where it is known.
    let begins = marks.get(1).map_or(marker, |mark| mark.time);
    let period = view.law.exposure().clock.periods(1);
    let layout = Layout {
        groups: groups(&netlist, pixel),
        zoom: (
            (marker - view.around.0).min(begins - period),
            marker + view.around.1,
        ),
        marker: Some(marker),
        marks,
    };
    write_views(&layout, waves, &netlist, *span.end())
}

/// Finds the first HIT of an exposure, or the first count of a counter TDC.
struct FirstHit {
    /// Macropixel of every net that is a HIT.
    hits: Vec<Option<(usize, usize)>>,
    /// Those before it, of power-up or of what is not kept, do not count.
    from: Time,
    found: Option<(Time, (usize, usize))>,
}

impl FirstHit {
    fn new(netlist: &Netlist, pixels: &[(usize, usize)], from: Time) -> Self {
        let mut hits = vec![None; netlist.net_count()];
        for &(row, col) in pixels {
            let probes = Probes::of_macropixel(netlist, row, col);
            // A counter TDC has no HIT, but what it adds shows in a bin.
            let found = probes.find(Probe::Hit).map(<[NetId]>::to_vec);
            for net in found.unwrap_or_else(|| probes.bins().concat()) {
                hits[net.index()] = Some((row, col));
            }
        }
        FirstHit {
            hits,
            from,
            found: None,
        }
    }
}

impl Observer for FirstHit {
    #[inline]
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        if self.found.is_none() && value == Logic::One && time >= self.from {
            self.found = self.hits[net.index()].map(|pixel| (time, pixel));
        }
    }
}

/// Writes every named net of `netlist` that `run` lets the observer see to `waves`, in the format of its name, and
/// `layout` beside it; `run` returns the end of the simulation.
///
/// # Errors
/// When a file cannot be written; it is then not there at all.
pub fn write_waves(
    waves: &Path,
    netlist: &Netlist,
    layout: &Layout,
    run: impl FnOnce(&mut WaveFile) -> Time,
) -> Result<(), InputError> {
    let all = Time::ZERO..=Time::MAX;
    let format = WaveFormat::from_path(waves);
    let mut file = WaveFile::create(waves, format, netlist, &WaveSelection::all(), all)?;
    let end = run(&mut file);
    file.finish(end)?;
    write_views(layout, waves, netlist, end)
}

/// HIT, with the order of its bits in its name.
pub fn hits(path: impl Into<String>, bins: usize) -> Entry {
    Entry::binary(path).named(format!("HIT, bin {} to 0", bins - 1))
}

/// The signals of the macropixel (row, col), and the load path.
fn groups(netlist: &Netlist, (row, col): (usize, usize)) -> Vec<SignalGroup> {
    let probes = Probes::of_macropixel(netlist, row, col);
    let binary = |probe| Entry::binary(probes.path(probe));
    let decimal = |probe| Entry::decimal(probes.path(probe));
    let hex = |probe| Entry::hex(probes.path(probe));
    let [memory, count] =
        [Probe::Memory, Probe::CounterOut].map(|probe| probes.find(probe).map(|_| decimal(probe)));
    let loaded = [
        // Names that the sensor's pins have, too.
        Entry::binary(Probe::Clk.name()),
        Entry::binary(Probe::Stop.name()),
        binary(Probe::Enable),
        binary(Probe::MemoryLoad),
        decimal(Probe::CounterInit),
    ];
    let counted = [binary(Probe::CounterReset), binary(Probe::CounterClk)];
    let counted = counted.into_iter().chain(count);
    let counted = counted.chain([binary(Probe::LocalStop)]);
    // Either TDC has some of them.
    let events = [
        (Probe::SpadRaw, hex(Probe::SpadRaw)),
        (Probe::SpadTimed, hex(Probe::SpadTimed)),
        (Probe::SpadEvent, binary(Probe::SpadEvent)),
        (Probe::Shift, binary(Probe::Shift)),
        (Probe::Photons, binary(Probe::Photons)),
        (Probe::EvenTap, binary(Probe::EvenTap)),
        (Probe::OddTap, binary(Probe::OddTap)),
        (Probe::SampleClk, binary(Probe::SampleClk)),
        (Probe::Strobe, binary(Probe::Strobe)),
        (
            Probe::Hit,
            hits(probes.path(Probe::Hit), probes.bins().len()),
        ),
        (Probe::Start, binary(Probe::Start)),
        (Probe::Counting, binary(Probe::Counting)),
        (Probe::Code, decimal(Probe::Code)),
        (Probe::Events, decimal(Probe::Events)),
        (Probe::Select, binary(Probe::Select)),
    ];
    let events = events
        .into_iter()
        .filter(|(probe, _)| probes.find(*probe).is_some());
    let events = events.map(|(_, entry)| entry);
    let bins = (0..probes.bins().len()).map(|bin| Entry::decimal(probes.bin_path(bin)));
    let load = [
        Entry::binary(LoadProbe::Enable.path()),
        Entry::binary(LoadProbe::Clk.path()),
        Entry::binary(LoadProbe::Serial.path()),
        Entry::hex(LoadProbe::Row.path()),
        Entry::binary(LoadProbe::RowDone.path()),
        Entry::binary(LoadProbe::MemoryLoad.path()),
    ];
    let pixel = probes.macropixel();
    vec![
        SignalGroup::new(
            format!("P-counter {pixel} (Fig. 54)"),
            loaded.into_iter().chain(memory).chain(counted),
        ),
        SignalGroup::new(format!("Histogram {pixel} (Fig. 47)"), events.chain(bins)),
        SignalGroup::new("Load path (Fig. 57)", load),
    ]
}
