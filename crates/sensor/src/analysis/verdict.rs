//! The verdict on a sensor's timing: whether it is met, with how much left over, and where it is tightest.
//!
//! | margin | what must not be too late, too early, too short | against |
//! |---|---|---|
//! | CLK | data and clock pulses of the flip-flops behind CLK | the CLK period |
//! | strobe | LOCAL_STOP's strobe, a ripple after the counted CLK edge | two changes of the shift register |
//! | first count | the release of COUNTER_RESET | the CLK edges before and after it |
//! | blocking COUNTER_CLK | LOCAL_STOP, which ends the count | the pulses of COUNTER_CLK after it |
//! | reset pulse | COUNTER_RESET | what it must outlast |
//! | SPAD_RAW | pulse width, toggle rate and hold of the toggle flip-flops | the dead time |
//! | HIT | data of the histogram's counters | the shortest laser cycle |
//! | LOAD_CLK | as CLK, and the gating of MEMORY_LOAD | the LOAD_CLK period |
//!
//! Static timing knows of no values, but what each clock edge is for: a strobe that comes after a rising CLK edge which it
//! precedes at a slow clock breaks nothing. It takes the shift register one bin later, and so the window law aims it. Only
//! silicon that differs from the library's must strobe between the same two edges as the library does.

use serde::Serialize;

use super::{Aim, LoadTiming, LocalClocks, MacropixelTiming};
use crate::chip::front_end::{DeadTimeTooShort, PulseLimits};
use crate::chip::window_law::WindowOutcome;
use crate::chip::{
    ChipTiming, Conflict, Exposure, Limits, Probe, Race, SensorConfig, Silicon, Tdc, WindowLaw,
};
use crate::netlist::{CheckKind, Netlist, Requirement};
use crate::units::Time;

/// Rows of memories that are analysed for LOAD_CLK: they differ in their token only.
const LOADED_ROWS: usize = 2;

/// The check of what the window law finds besides.
const LAW: &str = "window law";

/// What is left over at one place.
#[derive(Debug, Clone, PartialEq)]
pub struct Margin {
    /// Which limit: clock and check.
    pub check: String,
    /// Where: the path's ends.
    pub path: String,
    /// What is left over, negative where the limit is broken.
    pub slack: Time,
    /// Why it is broken, where more can be said than that.
    fault: Option<Fault>,
}

impl Margin {
    /// The limit in words: its check and path, or what the window law says.
    pub fn cause(&self) -> String {
        match &self.fault {
            Some(Fault::Race(race)) if self.check == LAW => format!("the {LAW}: {race}"),
            _ => format!("{} ({})", self.check, self.path),
        }
    }

    /// Whether a faster CLK cannot keep the limit either: that of a path between flip-flops, or of CLK's own pulses.
    pub(super) fn is_for_good(&self) -> bool {
        self.check.starts_with("CLK ") && self.slack < Time::ZERO
    }
}

/// Why a limit is broken.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum Fault {
    /// Something comes when it must not.
    #[error("{0}; {cure}", cure = .0.cure)]
    Race(Race),
    /// The strobe is clear of the shift register's changes, but between other ones than the library's.
    #[error(
        "windows end {bins} {} later than the window law says, which uses the library's delays; give another clk_hz, or silicon nearer to the library's",
        if *bins == 1 { "bin" } else { "bins" }
    )]
    Slipped {
        /// By how many bins.
        bins: i64,
    },
    /// A piece of a pulse clocks the P-counter.
    #[error(
        "LOCAL_STOP blocks COUNTER_CLK within a pulse, of which it leaves too short a piece; give clk_hz below {:.2} MHz or above {:.2} MHz",
        1e3 / until.as_ns(),
        1e3 / from.as_ns()
    )]
    CutPulse {
        /// The shortest CLK period at which it does.
        from: Time,
        /// And the longest.
        until: Time,
    },
    /// SPADs are too fast for the front end.
    #[error("{0}; {cure}", cure = .0.cure())]
    FrontEnd(DeadTimeTooShort),
}

/// Whether a sensor's timing is met.
#[derive(Debug, Clone, PartialEq)]
pub struct TimingVerdict {
    /// The least margin of each check, the tightest first.
    pub margins: Vec<Margin>,
    /// What should be known beside them.
    pub notes: Vec<String>,
    /// The one among the notes that says by how many bins windows end later, where they do.
    pub later_windows: Option<String>,
}

/// The verdict as JSON: times in picoseconds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VerdictReport {
    /// Whether every limit is kept.
    pub met: bool,
    /// What is left over where it is tightest, ps.
    pub slack_ps: f64,
    /// The check that is tightest.
    pub check: String,
    /// Its path.
    pub path: String,
    /// The verdict in words, with the cure.
    pub verdict: String,
    /// What should be known beside it.
    pub notes: Vec<String>,
    /// The one among the notes that says by how many bins windows end later, where they do.
    #[serde(skip)]
    pub later_windows: Option<String>,
}

impl VerdictReport {
    /// What to say before anything is simulated, where timing is not met.
    pub fn warning(&self) -> Option<String> {
        (!self.met).then(|| {
            format!(
                "timing {}. The gates show what their model makes of a broken limit: their counts cannot be trusted",
                self.verdict
            )
        })
    }
}

/// What verdicts at any CLK follow from, analysed once.
pub struct TimingAnalysis<'c> {
    config: &'c SensorConfig,
    pixel: MacropixelTiming,
    /// In the library's delays, where those of the silicon are others.
    library: Option<MacropixelTiming>,
    local: LocalClocks,
    pulses: PulseLimits,
    load: LoadTiming,
}

impl<'c> TimingAnalysis<'c> {
    /// Analyses a sensor; where macropixels differ, the one at `position`.
    pub fn new(config: &'c SensorConfig, silicon: &Silicon, position: (usize, usize)) -> Self {
        let nominal = Silicon::new(config);
        let pixel =
            |silicon, position| MacropixelTiming::analyse(config, silicon, Limits::Kept, position);
        let few_rows = SensorConfig {
            rows: config.rows.min(LOADED_ROWS),
            ..config.clone()
        };
        TimingAnalysis {
            pixel: pixel(silicon, position),
            library: (*silicon != nominal).then(|| pixel(&nominal, (0, 0))),
            local: LocalClocks::analyse(config, silicon),
            pulses: ChipTiming::measure(config, silicon).pulses,
            load: LoadTiming::analyse(&few_rows, silicon, Limits::Kept),
            config,
        }
    }

    /// The verdict with another CLK; STOP's phase, LOAD_CLK and the dead time stay.
    pub fn at_clk(&self, clk_hz: f64) -> TimingVerdict {
        TimingVerdict::from_analysis(
            self,
            &SensorConfig {
                clk_hz,
                ..self.config.clone()
            },
        )
    }
}

impl TimingVerdict {
    /// Judges the sensor at its CLK, STOP phase, LOAD_CLK and dead time; where macropixels differ, the one at `position`.
    pub fn analyse(config: &SensorConfig, silicon: &Silicon, position: (usize, usize)) -> Self {
        Self::from_analysis(&TimingAnalysis::new(config, silicon, position), config)
    }

    fn from_analysis(analysis: &TimingAnalysis<'_>, config: &SensorConfig) -> Self {
        let (period, phase) = (config.clock().period(), config.stop_phase());
        let TimingAnalysis { pixel, library, .. } = analysis;
        let aim = library.as_ref().unwrap_or(pixel).aim(period, phase);
        let mut margins = pixel_margins(pixel, config, aim);
        margins.extend(local_margins(config, &analysis.local, &analysis.pulses));
        margins.extend(load_margins(config, &analysis.load));
        // The law also knows what reset P-counters of other kinds wait for, and is on the safe side by a rounding.
        let is_met = margins.iter().all(|margin| margin.slack >= Time::ZERO);
        let race = (library.is_none() && is_met)
            .then(|| law_race(config))
            .flatten();
        if let Some(race) = race {
            margins.push(Margin {
                check: LAW.to_owned(),
                path: pixel.probes.p_counter(),
                // Where the law rounds to the safe side, too.
                slack: race.slack().min(Time::from_fs(-1)),
                fault: Some(Fault::Race(race)),
            });
        }
        margins.sort_by_key(|margin| margin.slack);
        let later_windows = is_met.then(|| later_windows(config, pixel, aim)).flatten();
        TimingVerdict {
            notes: (later_windows.iter().cloned())
                .chain(cancelling_photons(config))
                .collect(),
            later_windows,
            margins,
        }
    }

    /// The tightest place.
    pub fn worst(&self) -> &Margin {
        self.margins.first().expect("a sensor has flip-flops")
    }

    /// Whether every limit is kept.
    pub fn is_met(&self) -> bool {
        self.worst().slack >= Time::ZERO
    }

    /// For JSON.
    pub fn report(&self) -> VerdictReport {
        let worst = self.worst();
        VerdictReport {
            met: self.is_met(),
            slack_ps: worst.slack.as_ns() * 1e3,
            check: worst.check.clone(),
            path: worst.path.clone(),
            verdict: self.to_string(),
            notes: self.notes.clone(),
            later_windows: self.later_windows.clone(),
        }
    }
}

impl std::fmt::Display for TimingVerdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Margin {
            check,
            path,
            slack,
            fault,
        } = self.worst();
        if self.is_met() {
            return write!(f, "met, {slack} left ({check}: {path})");
        }
        write!(f, "fails by {} ({check}: {path})", -*slack)?;
        match fault {
            Some(fault) => write!(f, ": {fault}"),
            None => Ok(()),
        }
    }
}

/// The tightest requirement of each check behind a clock; `name` is what the checks are called by.
fn tightest<'r>(
    name: &str,
    clock: &str,
    netlist: &Netlist,
    requirements: impl Iterator<Item = &'r Requirement>,
    slack: impl Fn(&Requirement) -> Option<Time>,
) -> Vec<Margin> {
    let mut least: [Option<(Time, &Requirement)>; CheckKind::ALL.len()] = Default::default();
    for requirement in requirements {
        let Some(slack) = slack(requirement) else {
            continue;
        };
        let least = &mut least[requirement.kind as usize];
        if least.is_none_or(|(before, _)| slack < before) {
            *least = Some((slack, requirement));
        }
    }
    let margin = |(slack, requirement): (Time, &Requirement)| Margin {
        check: format!("{name} {}", requirement.kind.name()),
        path: requirement.ends(netlist, clock),
        slack,
        fault: None,
    };
    least.into_iter().flatten().map(margin).collect()
}

/// Margins within one macropixel, but for those of SPADs and histogram.
fn pixel_margins(pixel: &MacropixelTiming, config: &SensorConfig, aim: Aim) -> Vec<Margin> {
    let (period, phase) = (config.clock().period(), config.stop_phase());
    let mut margins = tightest("CLK", "CLK", &pixel.netlist, pixel.clk.iter(), |r| {
        Some(r.slack(period))
    });
    for margin in &mut margins {
        if margin.slack < Time::ZERO && margin.check == "CLK setup" {
            let race = Race::too_slow(Conflict::SlowPath, period - margin.slack, period);
            margin.fault = Some(Fault::Race(race));
        }
    }
    let strobes = tightest("strobe", "CLK", &pixel.netlist, pixel.hits.iter(), |r| {
        Some(pixel.strobe_slack(r, period, phase, aim))
    });
    // Slower or faster silicon may strobe clear of the change that it is near, but on the other side of it.
    let race = pixel.strobe_race(period, phase);
    let race = race.filter(|race| race.slack() < Time::ZERO);
    let bins = pixel.aim(period, phase).moved() - aim.moved();
    for mut margin in strobes {
        if margin.slack < Time::ZERO {
            let slipped = (bins != 0).then_some(Fault::Slipped { bins });
            margin.fault = race.map(Fault::Race).or(slipped);
        }
        margins.push(margin);
    }
    let counter_reset = pixel.probes.path(Probe::CounterReset);
    let path = format!("STOP rise to {counter_reset} fall");
    if let Some((slack, race)) = pixel.first_count(period, phase, aim) {
        margins.push(Margin {
            check: "first count, recovery and removal".to_owned(),
            path: path.clone(),
            slack,
            fault: (slack < Time::ZERO).then_some(Fault::Race(race)),
        });
    }
    if let Some(slack) = pixel.block_slack(period) {
        let cutting = pixel.cutting(period).filter(|_| slack < Time::ZERO);
        margins.push(Margin {
            check: "blocking COUNTER_CLK".to_owned(),
            path: format!("CLK fall to {} rise", pixel.probes.path(Probe::LocalStop)),
            slack,
            fault: cutting.map(|(from, until)| Fault::CutPulse { from, until }),
        });
    }
    margins.push(Margin {
        check: "reset pulse".to_owned(),
        path,
        slack: pixel.reset_width() - pixel.reset_need(),
        fault: None,
    });
    margins.extend(pixel.strobe_lead.map(|slack| Margin {
        check: "STOP's strobe, recovery of HIT".to_owned(),
        path: format!("STOP rise to {}", pixel.probes.path(Probe::Strobe)),
        slack,
        fault: None,
    }));
    margins.extend(pixel.load_pulse_slack.map(|slack| Margin {
        check: "load pulse, before COUNTER_INIT changes".to_owned(),
        path: "LOAD_CLK fall to the P-counter's flip-flops".to_owned(),
        slack,
        fault: None,
    }));
    margins
}

/// Margins of flip-flops with clocks of their own.
fn local_margins(config: &SensorConfig, local: &LocalClocks, pulses: &PulseLimits) -> Vec<Margin> {
    let width = config.pulse_width();
    let mut margins = tightest(
        "SPAD_RAW",
        "SPAD_RAW",
        &local.netlist,
        local.toggles.iter(),
        |r| local.toggle_slack(r, width),
    );
    let fault = pulses.follow(config).err();
    for margin in margins
        .iter_mut()
        .filter(|margin| margin.slack < Time::ZERO)
    {
        margin.fault = fault.map(Fault::FrontEnd);
    }
    // No laser cycle is shorter than two CLK periods. How long HIT is high and low, start values say.
    let between = config.clock().periods(2);
    margins.extend(tightest(
        Probe::Hit.name(),
        Probe::Hit.name(),
        &local.netlist,
        local.counts.iter(),
        |r| r.kind.concerns_data().then(|| r.slack(between)),
    ));
    margins
}

/// Margins of the load path.
fn load_margins(config: &SensorConfig, load: &LoadTiming) -> Vec<Margin> {
    let period = config.load_clock().period();
    let mut margins = tightest(
        "LOAD_CLK",
        "LOAD_CLK",
        &load.netlist,
        load.load_clk.iter(),
        |r| Some(r.slack(period)),
    );
    margins.push(Margin {
        check: "LOAD_CLK gating".to_owned(),
        path: "LOAD_CLK rise to the gates of MEMORY_LOAD".to_owned(),
        slack: Time::from_fs(period.as_fs() / 2) - load.row_done.max(load.token),
        fault: None,
    });
    margins
}

/// What the window law says against every window in the middle of a long laser cycle.
fn law_race(config: &SensorConfig) -> Option<Race> {
    let start = config.largest_start() / 4;
    let periods = 4 * config.step_periods as u32 * (u32::from(config.largest_start()) + 1);
    match WindowLaw::new(config, &Exposure::new(config, periods, 1)).window(start) {
        WindowOutcome::Race(race) => Some(race),
        WindowOutcome::Open(_) | WindowOutcome::Never | WindowOutcome::Irregular(_) => None,
    }
}

/// By how many bins windows end later, where the strobe comes after CLK edges that it precedes at a slow clock.
fn later_windows(config: &SensorConfig, pixel: &MacropixelTiming, aim: Aim) -> Option<String> {
    if config.tdc != Tdc::Clocked || aim.edges <= 0 {
        return None;
    }
    let (period, earlier) = (config.clock().period(), aim.earlier());
    let hold = pixel.hits.iter().filter(|r| r.kind == CheckKind::Hold);
    let slack = hold
        .map(|r| pixel.strobe_slack(r, period, config.stop_phase(), earlier))
        .min();
    Some(format!(
        "the strobe comes after {} that it precedes at a slow clock, and windows end {} later, as the window law has it; the hold slack of {} before that edge is of a path that nothing exercises",
        plural(aim.edges, "rising CLK edge"),
        plural(aim.moved(), "bin"),
        slack.unwrap_or_default()
    ))
}

/// Whether photons can cancel in a front end that CLK samples.
fn cancelling_photons(config: &SensorConfig) -> Option<String> {
    let (period, dead_time) = (config.clock().period(), config.pulse_width());
    (config.tdc.has_clk_bins() && dead_time <= period).then(|| {
        format!(
            "two photons of a SPAD within a CLK period ({period}) cancel, as the dead time ({dead_time}) lets them"
        )
    })
}

fn plural(count: i64, what: &str) -> String {
    let ending = if count == 1 { "" } else { "s" };
    format!("{count} {what}{ending}")
}
