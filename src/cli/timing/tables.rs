//! The tables of `gdtof timing`, one function each.

use super::section::{Section, SectionCell};
use crate::analysis::{
    CorrelationTiming, LoadTiming, LocalClocks, MacropixelTiming, ReadTiming, TimingVerdict,
    corner_limits, factor_range, gate_works, load_works, longest, phases, read_works, reset,
    ripple, shortest_period,
};
use crate::chip::{CellLibrary, Limits, Probe, SensorConfig, Silicon, macropixel, p_counter};
use crate::netlist::{CellId, CheckKind, Module, Netlist, Path, Requirement};
use crate::units::Time;

/// Longest period that is tried.
const SLOW: Time = Time::from_ns(20);

/// What is analysed: the sensor, its silicon, and its macropixel with limits kept and ignored.
pub(super) struct Subject<'a> {
    pub config: &'a SensorConfig,
    pub silicon: &'a Silicon,
    pub kept: MacropixelTiming,
    pub ignored: MacropixelTiming,
}

impl<'a> Subject<'a> {
    pub(super) fn new(config: &'a SensorConfig, silicon: &'a Silicon) -> Self {
        let pixel = |limits| MacropixelTiming::analyse(config, silicon, limits, (0, 0));
        Subject {
            config,
            silicon,
            kept: pixel(Limits::Kept),
            ignored: pixel(Limits::Ignored),
        }
    }

    fn timing(&self, limits: Limits) -> &MacropixelTiming {
        match limits {
            Limits::Kept => &self.kept,
            Limits::Ignored => &self.ignored,
        }
    }
}

/// The verdict, and what should be known beside it.
pub(super) fn verdict(verdict: &TimingVerdict) -> Section {
    let title = format!("Timing: {verdict}");
    let notes = verdict.notes.iter().map(|note| format!("\n  note: {note}"));
    let title = title + &notes.collect::<String>();
    let mut section = Section::new("margins", title, &["check", "slack", "path"]);
    for margin in &verdict.margins {
        section.push([
            margin.check.as_str().into(),
            margin.slack.into(),
            margin.path.as_str().into(),
        ]);
    }
    section
}

/// Earliest and latest changes.
pub(super) fn windows(subject: &Subject<'_>) -> Section {
    let pixel = &subject.kept;
    let title = "Windows of a macropixel";
    let mut section = Section::new("windows", title, &["from, to", "shortest", "longest"]);
    let only = |path: &Path| (None, path.delay());
    let both = |window: (Time, Time)| (Some(window.0), window.1);
    for (name, (shortest, longest)) in [
        ("CLK fall to LOCAL_STOP rise (ripple)", only(&pixel.ripple)),
        ("CLK fall to COUNTER_CLK rise", both(pixel.counter_clk)),
        ("CLK fall to STROBE rise", both(pixel.strobe)),
        (
            "CLK rise to SHIFT change",
            pixel.shift.map_or((None, Time::ZERO), both),
        ),
        (
            "CLK rise to SPAD_EVENT",
            pixel.event.as_ref().map_or((None, Time::ZERO), only),
        ),
        ("STOP rise to COUNTER_RESET rise", both(pixel.reset)),
        ("STOP rise to COUNTER_RESET fall", both(pixel.release)),
    ] {
        section.push([name.into(), shortest.into(), longest.into()]);
    }
    section
}

/// The reset pulse and what it must outlast.
pub(super) fn reset_pulse(subject: &Subject<'_>) -> Section {
    let (pixel, simulated) = (&subject.kept, reset(subject.config, subject.silicon));
    let title = format!(
        "Reset pulse of {} buffers (reset_stages), and what it must outlast",
        subject.config.reset_buffers()
    );
    let mut section = Section::new("reset", title, &["", "static", "event-driven"]);
    let need = simulated.to_stage_clock.max(simulated.to_counter_clk);
    let limits = pixel.reset_need() - pixel.reset_to_stage_clock.max(pixel.reset_to_counter_clk);
    for (name, paths, gates) in [
        ("width", pixel.reset_width(), simulated.width),
        (
            "to the next stage's clock",
            pixel.reset_to_stage_clock,
            simulated.to_stage_clock,
        ),
        (
            "to the COUNTER_CLK that LOCAL_STOP lets through",
            pixel.reset_to_counter_clk,
            simulated.to_counter_clk,
        ),
        (
            "left over, removal kept",
            pixel.reset_width() - pixel.reset_need(),
            simulated.width - need - limits,
        ),
    ] {
        section.push([name.into(), paths.into(), gates.into()]);
    }
    section
}

/// Shortest CLK periods.
pub(super) fn periods(subject: &Subject<'_>) -> Section {
    let Subject {
        config, silicon, ..
    } = subject;
    let title = "Shortest CLK period";
    let mut section = Section::new("periods", title, PERIODS);
    let mut push = |name: &str, paths: Option<Time>, gates: Option<Time>| {
        section.push(period_row(name, paths, gates));
    };
    push(
        "twice the ripple (thesis 4.6)",
        Some(subject.kept.ripple.delay() * 2),
        None,
    );
    for (limits, suffix) in [
        (Limits::Ignored, "what is captured"),
        (Limits::Kept, "setup, hold, widths"),
    ] {
        let pixel = subject.timing(limits);
        let gates = gate_works(config, silicon, limits, 0);
        let correlation = CorrelationTiming::simulate(config, silicon, limits);
        push(
            &format!("STOP on CLK's fall: {suffix}"),
            shortest_period(SLOW, |p| pixel.works(p, Time::ZERO)),
            shortest_period(SLOW, |p| gates((p, Time::ZERO))),
        );
        // Below the band in which the strobe meets the shift register a STOP phase helps again.
        let below = pixel.forbidden(0).0 - Time::from_ps(2);
        let simulated = shortest_period(below, |p| phases(p).any(|phase| gates((p, phase))));
        push(
            &format!("best STOP phase: {suffix}"),
            shortest_period(below, |p| phases(p).any(|phase| pixel.works(p, phase))),
            simulated.zip(correlation.period).map(|(a, b)| a.max(b)),
        );
        push(
            &format!("correlation path: {suffix}"),
            pixel.correlation_period(),
            correlation.period,
        );
    }
    section
}

/// CLK periods at which no STOP phase helps.
pub(super) fn forbidden(subject: &Subject<'_>) -> Section {
    let title = "CLK periods at which the strobe breaks setup or hold, whatever STOP's phase";
    let headings = &["rising CLK edge after the counted fall", "from", "to"];
    let mut section = Section::new("forbidden", title, headings);
    for edge in 0..2 {
        let (from, to) = subject.kept.forbidden(edge);
        section.push([(edge + 1).to_string().into(), from.into(), to.into()]);
    }
    section
}

/// How fast start values can be loaded.
pub(super) fn load_clk(subject: &Subject<'_>, load: &LoadTiming) -> Section {
    let (config, silicon) = (subject.config, subject.silicon);
    let ignored = LoadTiming::analyse(config, silicon, Limits::Ignored).period();
    let names = ["load_clk", "Shortest LOAD_CLK period", "what is loaded"];
    serial_clk(names, [ignored, load.period()], |limits| {
        load_works(config, silicon, limits)
    })
}

/// How fast histograms can be read.
pub(super) fn read_clk(subject: &Subject<'_>, read: &ReadTiming) -> Section {
    let (config, silicon) = (subject.config, subject.silicon);
    let ignored = ReadTiming::analyse(config, silicon, Limits::Ignored).period();
    let names = ["read_clk", "Shortest READ_CLK period", "what is read"];
    serial_clk(names, [ignored, read.period()], |limits| {
        read_works(config, silicon, limits)
    })
}

/// A clock's shortest periods, limits ignored and kept: static ones, and those at which the gates work.
fn serial_clk<W: Fn(Time) -> bool>(
    [key, title, what]: [&'static str; 3],
    paths: [Option<Time>; 2],
    works: impl Fn(Limits) -> W,
) -> Section {
    let mut section = Section::new(key, title, PERIODS);
    let names = [
        (what, Limits::Ignored),
        ("setup, hold, widths", Limits::Kept),
    ];
    for ((name, limits), paths) in names.into_iter().zip(paths) {
        let gates = shortest_period(SLOW, works(limits));
        section.push(period_row(name, paths, gates));
    }
    section
}

/// Headings of [`period_row`].
const PERIODS: &[&str] = &["limited by", "static", "event-driven", "static (MHz)"];

fn period_row(name: &str, paths: Option<Time>, gates: Option<Time>) -> [SectionCell; 4] {
    let mhz = SectionCell::Number(paths.map(|t| 1e-6 / t.as_s()), 1);
    [name.into(), paths.into(), gates.into(), mhz]
}

/// The tightest flip-flop of every clock and check.
pub(super) fn flip_flops(subject: &Subject<'_>, load: &LoadTiming, read: &ReadTiming) -> Section {
    let config = subject.config;
    let headings = &[
        "clock",
        "check",
        "flip-flops",
        "tightest",
        "shortest period",
        "slack",
    ];
    let title =
        "Tightest flip-flops; slack at the configured CLK, LOAD_CLK, READ_CLK and dead time";
    let mut section = Section::new("flip_flops", title, headings);
    let local = LocalClocks::analyse(config, subject.silicon);
    let pixel = &subject.kept;
    let period = config.clock().period();
    let phase = config.stop_phase();
    let aim = pixel.aim(period, phase);
    let load_period = config.load_clock().period();
    let read_period = config.read_clock().period();
    type Slack<'s> = &'s dyn Fn(&Requirement) -> Option<Time>;
    let clocks: [(&str, &Netlist, &[Requirement], Slack<'_>); 6] = [
        ("CLK", &pixel.netlist, &pixel.clk, &|r| {
            Some(r.slack(period))
        }),
        (Probe::Strobe.name(), &pixel.netlist, &pixel.hits, &|r| {
            Some(pixel.strobe_slack(r, period, phase, aim))
        }),
        (Probe::Hit.name(), &local.netlist, &local.counts, &|_| None),
        ("SPAD_RAW", &local.netlist, &local.toggles, &|r| {
            local.toggle_slack(r, config.pulse_width())
        }),
        ("LOAD_CLK", &load.netlist, &load.load_clk, &|r| {
            Some(r.slack(load_period))
        }),
        ("READ_CLK", &read.netlist, &read.read_clk, &|r| {
            Some(r.slack(read_period))
        }),
    ];
    for (clock, netlist, all, slack) in clocks {
        for kind in CheckKind::ALL {
            let of_kind: Vec<&Requirement> = all.iter().filter(|r| r.kind == kind).collect();
            let Some(limiting) = of_kind.iter().max_by_key(|r| (r.period(), r.need)) else {
                continue;
            };
            let slacks = of_kind.iter().filter_map(|r| slack(r));
            let mut cells: Vec<CellId> = of_kind.iter().map(|r| r.cell).collect();
            cells.sort_unstable();
            cells.dedup();
            section.push([
                clock.into(),
                kind.name().into(),
                cells.len().to_string().into(),
                netlist.cell_path(limiting.cell).into(),
                longest(of_kind.iter().copied()).into(),
                slacks.min().into(),
            ]);
        }
    }
    section
}

/// A P-counter of one's own beside the built-in one.
pub(super) fn own_counter(config: &SensorConfig) -> Option<Section> {
    let block = config.p_counter_block.as_ref()?;
    let law = config.counter_law()?;
    let built_in_config = SensorConfig {
        p_counter_block: None,
        ..config.clone()
    };
    let [own, built_in] = [config, &built_in_config].map(p_counter::circuit);
    let stops = match law.uneven() {
        Some(why) => why.to_string(),
        None => format!("{} x start value + {}", config.step_periods, law.offset()),
    };
    let codes = if law.is_plain() {
        "the start value"
    } else {
        "a code for each start value"
    };
    let number = |n: u64| SectionCell::Number(Some(n as f64), 0);
    let title = format!("P-counter: {}", block.file().display());
    let headings = &["what", "this one", "built-in"];
    let mut section = Section::new("p_counter", title, headings);
    section.push([
        "transistors".into(),
        number(own.transistors()),
        number(built_in.transistors()),
    ]);
    let area = |config: &SensorConfig, circuit: &Module| match library_area(config) {
        Some(um2) => SectionCell::Number(Some(um2), 1),
        None => number(circuit.area()),
    };
    section.push([
        area_heading(config).into(),
        area(config, &own),
        area(&built_in_config, &built_in),
    ]);
    let edge = "COUNTER_CLK edge of LOCAL_STOP".into();
    section.push([
        edge,
        stops.into(),
        format!("{} x start value + 0", config.step_periods).into(),
    ]);
    section.push([
        Probe::CounterInit.name().into(),
        codes.into(),
        "the start value".into(),
    ]);
    section.push([
        "COUNTER_INIT that never raise LOCAL_STOP".into(),
        law.silent_in_words()
            .unwrap_or_else(|| "none".to_owned())
            .into(),
        "none".into(),
    ]);
    Some(section)
}

/// What areas are in: a library's square micrometres, or transistors that are packed as in the custom flip-flop.
fn area_heading(config: &SensorConfig) -> &'static str {
    match CellLibrary::from_config(config)
        .ok()
        .and_then(CellLibrary::from_file)
    {
        Some(_) => "area, um2",
        None => "area, packed transistors",
    }
}

/// Area of the P-counter in a macropixel, um2, in the cells of the sensor's library, as `gdtof power` has it; `None` without one.
fn library_area(config: &SensorConfig) -> Option<f64> {
    let library = CellLibrary::from_config(config).ok()?.from_file()?;
    let netlist = Netlist::elaborate(&macropixel::circuit(config));
    let scope = netlist.scope("p_counter")?;
    let placed = library.characterised(&netlist);
    Some(placed.silicon(&netlist, &library.liberty, scope).0)
}

/// Ripple by number of stages.
pub(super) fn ripples(config: &SensorConfig, silicon: &Silicon) -> Section {
    let title = "Ripple COUNTER_CLK to LOCAL_STOP";
    let headings = &[
        "stages",
        "static",
        "event-driven",
        "latest from start value",
    ];
    let mut section = Section::new("ripples", title, headings);
    // A netlist has the bits that it has.
    let bits = match config.p_counter_block {
        Some(_) => config.counter_bits..=config.counter_bits,
        None => 2..=12,
    };
    for counter_bits in bits {
        let config = SensorConfig {
            counter_bits,
            ..config.clone()
        };
        let found = ripple(&config, silicon);
        let is_even = config
            .counter_law()
            .is_none_or(|law| law.uneven().is_none());
        let gates = is_even.then_some(found.latest);
        let start = if is_even {
            found.start.to_string()
        } else {
            String::new()
        };
        section.push([
            counter_bits.to_string().into(),
            found.longest_path.into(),
            gates.into(),
            start.into(),
        ]);
    }
    section
}

/// Factor on delays up to which the simulation's power-up is over before it counts: with 18 times the built-in delays it is not.
const MOST_SIMULATED: f64 = 10.0;

/// Where the sensor's CLK fails: the factors on all delays beyond which it does, and the conditions that have them.
pub(super) fn corners(config: &SensorConfig, silicon: &Silicon) -> Section {
    let headings = &[
        "process",
        "at 1.1 V, 50 C",
        "too slow from (V) down",
        "too slow from (C) up",
        "too fast from (V) up",
        "too fast from (C) down",
    ];
    let range = factor_range(config, silicon, Limits::Kept);
    let mhz = config.clk_hz / 1e6;
    let title = match range {
        None => format!("Where {mhz} MHz fails: everywhere"),
        Some(range) => {
            let at = (config.clock().period(), config.stop_phase());
            let works = |factor: f64| {
                let silicon = silicon.with_factor(factor);
                gate_works(config, &silicon, Limits::Kept, range.moved)(at)
            };
            let gates = |works_at: f64, fails_at: f64| match (works(works_at), works(fails_at)) {
                _ if !config.may_have_law() || works_at > MOST_SIMULATED => "not simulated",
                (true, false) => "simulation agrees",
                (true, true) => "simulation still works there",
                (false, _) => "SIMULATION FAILS ALREADY",
            };
            let slowest = range.slowest;
            let agrees = gates(slowest, slowest + 2e-5);
            let faster = range.fastest.map_or(String::new(), |fastest| {
                let agrees = gates(fastest, fastest - 2e-5);
                format!(", and less than {fastest:.5} times ({agrees})")
            });
            format!(
                "Where {mhz} MHz fails: delays more than {slowest:.5} times the library's ({agrees}){faster}"
            )
        }
    };
    let mut section = Section::new("corners", title, headings);
    // A library was characterised at conditions of its own, and how its delays move with them nobody says.
    let knows_conditions = silicon.cell_library.from_file().is_none();
    for limit in corner_limits(range)
        .into_iter()
        .filter(|_| knows_conditions)
    {
        let verdict = if limit.works_at_reference {
            "works"
        } else {
            "fails"
        };
        section.push([
            limit.process.name().into(),
            verdict.into(),
            SectionCell::Number(limit.fails_below_v, 3),
            SectionCell::Number(limit.fails_above_c, 1),
            SectionCell::Number(limit.fails_above_v, 3),
            SectionCell::Number(limit.fails_below_c, 1),
        ]);
    }
    section
}

/// Every step of the longest and shortest paths.
pub(super) fn paths(subject: &Subject<'_>, load: &LoadTiming) -> Section {
    let headings = &["path", "cell, input", "net", "edge", "time"];
    let mut section = Section::new("paths", "Longest and shortest paths", headings);
    let pixel = &subject.kept;
    let event = pixel.event.as_ref().expect("of clocked TDCs only");
    for (name, netlist, path) in [
        ("CLK to LOCAL_STOP, longest", &pixel.netlist, &pixel.ripple),
        ("CLK to SPAD_EVENT, longest", &pixel.netlist, event),
        ("CLK to D, shortest", &pixel.netlist, &pixel.shortest),
        ("LOAD_CLK to D, longest", &load.netlist, &load.longest),
        ("LOAD_CLK to D, shortest", &load.netlist, &load.shortest),
    ] {
        for step in &path.steps {
            section.push([
                name.into(),
                step.arc.as_deref().unwrap_or("-").into(),
                netlist.net_path(step.net).unwrap_or_default().into(),
                if step.edge == crate::netlist::Edge::Rise {
                    "rise"
                } else {
                    "fall"
                }
                .into(),
                step.time.into(),
            ]);
        }
    }
    section
}
