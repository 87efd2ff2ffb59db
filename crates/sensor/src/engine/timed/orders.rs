//! Which orders of events a macropixel's delays decide, and what the window law makes of them.
//!
//! ```text
//!   CLK    ──┐     ┌─────┐     ┌──     order decided:  spans apart        ├──a──┤  ├─b─┤
//!            └─────┘     └─────┘       in doubt:       spans overlap      ├──a─├──┤─b─┤
//!   STROBE ────────────├─┤──────
//!   SHIFT  ──────────├┤──────────├┤
//! ```
//!
//! A flip-flop of the gate engine takes what is at D in the instant of its clock, so that nothing but order counts.
//! [`WindowLaw`] asks for the orders that move windows. It is given the latest of every arrival, and limits as wide as
//! the arrival is uncertain: its *race* is then two spans that overlap. Orders that hold in any silicon scaled as a whole,
//! but perhaps not in one whose cells differ, are asked for here. Whatever is not proven is in doubt.

use super::doubt::Doubt;
use crate::chip::p_counter::{Rises, starts_high};
use crate::chip::timing::CounterTiming;
use crate::chip::timing::macropixel::{CounterDelays, DelaySpan, MacropixelDelays, hull, spread};
use crate::chip::window_law::{WindowLaw, WindowOutcome};
use crate::chip::{
    AfterBorrow, ChipTiming, Conflict, Exposure, Mode, Overflow, Sensor, SensorConfig,
};
use crate::photon::SpadEvent;
use crate::stimulus::Schedule;
use crate::units::Time;

/// Two events are in order if they are at least so far apart: a thousand times the rounding of clock edges, less than a tenth
/// of the fastest gate of the fast corner.
const MARGIN: Time = Time::from_ps(1);

/// One macropixel's own time.
#[derive(Clone)]
pub(super) struct Orders {
    law: WindowLaw,
    /// CLK rises → what each bin takes changes.
    shift: Vec<DelaySpan>,
    latency: Vec<Time>,
    /// What is in doubt for every start value.
    doubt: Option<Doubt>,
    /// CLK falls → COUNTER_CLK rises, earliest.
    counter_clk: Time,
    /// STOP rises → COUNTER_RESET rises, latest.
    reset: Time,
}

/// Delays of a macropixel in its mode.
pub(super) struct Delays {
    /// Those of either mode.
    pub macropixel: MacropixelDelays,
    /// What the guided mode needs, too.
    pub counter: Option<CounterDelays>,
}

impl Delays {
    /// CLK falls (guided) or STOP rises (conventional) → STROBE rises.
    fn strobe(&self) -> DelaySpan {
        let counter = self.counter.as_ref();
        counter.map_or(self.macropixel.stop_strobe, |counter| counter.strobe)
    }

    /// COUNTER_RESET falls (guided) or STOP rises (conventional) → HIT's reset ends.
    fn hit_release(&self) -> DelaySpan {
        let counter = self.counter.as_ref();
        counter.map_or(self.macropixel.stop_hit_release, |counter| {
            counter.hit_release
        })
    }
}

/// Bins that follow one law.
pub(super) struct Part {
    /// The law.
    pub law: WindowLaw,
    /// The rising CLK edge that takes the photons of bin 0; `None` where the window never opens.
    pub first_edge: Option<i64>,
    /// Which bins.
    pub bins: Vec<usize>,
}

/// What all macropixels of an array share.
pub(super) struct Setting {
    /// The sensor with the library's delays.
    pub sensor: Sensor,
    /// Its clocks.
    pub exposure: Exposure,
    /// Delays of the library, where a macropixel's own do not matter.
    pub nominal: ChipTiming,
    /// Where power-up, load and exposure lie in simulation time.
    pub schedule: Schedule,
}

impl Orders {
    /// What these delays decide.
    pub(super) fn new(setting: &Setting, delays: &Delays) -> Self {
        let counter = delays.counter.as_ref();
        let rises = delays.macropixel.latency.iter();
        let timing = match counter {
            None => conventional(setting, delays),
            Some(counter) => guided(setting, delays, counter),
        };
        Orders {
            law: WindowLaw::with_timing(&setting.sensor, &setting.exposure, timing),
            shift: delays.macropixel.shift.clone(),
            latency: rises.map(|&(rise, _)| rise).collect(),
            doubt: common_doubt(setting, delays),
            counter_clk: counter.map_or(Time::ZERO, |c| c.counter_clk.0),
            reset: delays.macropixel.reset.1,
        }
    }

    /// The laws that the bins follow with this start value: one for all, or two where the strobe comes between the changes
    /// of their stages.
    ///
    /// # Errors
    /// What is in doubt.
    pub(super) fn parts(&self, setting: &Setting, start: u16) -> Result<Vec<Part>, Doubt> {
        if let Some(doubt) = self.doubt {
            return Err(doubt);
        }
        let (config, exposure) = (&setting.sensor, &setting.exposure);
        // Otherwise a LOCAL_STOP that starts high stays so, and the counter at rest.
        let reset_can_raise_local_stop =
            config.after_borrow == AfterBorrow::Wrap || config.p_counter.row().clears_first;
        if config.mode == Mode::Guided && starts_high(config, start) && reset_can_raise_local_stop {
            return Err(Doubt::ResetRaisesLocalStop);
        }
        let whole = |first_edge| Part {
            law: self.law.clone(),
            first_edge,
            bins: (0..config.bins).collect(),
        };
        match self.law.window(start) {
            WindowOutcome::Open(window) => Ok(vec![whole(Some(window.first_edge))]),
            WindowOutcome::Irregular(why) => Err(Doubt::Irregular(why)),
            WindowOutcome::Race(_) => self.bin_by_bin(setting, start),
            WindowOutcome::Never => {
                // No count is earlier than the one of CLK's first falling edge.
                let is_reset_first = Rises::from_start_value(config, start).is_none_or(|rises| {
                    let count = exposure.falling(rises.first) + self.counter_clk;
                    count > exposure.stop(1) + self.reset + MARGIN
                });
                if is_reset_first {
                    Ok(vec![whole(None)])
                } else {
                    Err(Doubt::Race(Conflict::StrobeAtNextReset))
                }
            }
        }
    }

    /// The same where not all bins see the shift register after the same change. Bins know nothing of each other.
    fn bin_by_bin(&self, setting: &Setting, start: u16) -> Result<Vec<Part>, Doubt> {
        let mut parts: Vec<Part> = Vec::new();
        for (bin, &shift) in self.shift.iter().enumerate() {
            let timing = ChipTiming {
                clk_to_shift: shift.1,
                hold: spread(shift),
                ..*self.law.timing()
            };
            let law = WindowLaw::with_timing(&setting.sensor, &setting.exposure, timing);
            let window = law.window(start).settled()?;
            debug_assert!(window.is_some(), "bins do not stop a counter");
            let first_edge = window.map(|window| window.first_edge);
            match parts.iter_mut().find(|part| part.first_edge == first_edge) {
                Some(part) => part.bins.push(bin),
                None => parts.push(Part {
                    law,
                    first_edge,
                    bins: vec![bin],
                }),
            }
        }
        Ok(parts)
    }

    /// `pulses` as a macropixel must see them whose front end is that of `law`, to take them at the same CLK edges.
    pub(super) fn shifted(&self, law: &WindowLaw, pulses: &[SpadEvent]) -> Vec<SpadEvent> {
        let common = law.timing().spad_to_sampled;
        let shift = |pulse: &SpadEvent| {
            SpadEvent::new(
                pulse.time + self.latency[usize::from(pulse.spad)] - common,
                pulse.spad,
            )
        };
        let mut shifted: Vec<SpadEvent> = pulses.iter().map(shift).collect();
        shifted.sort_unstable();
        shifted
    }
}

/// What the law asks for in either mode.
fn common(setting: &Setting, delays: &Delays) -> ChipTiming {
    let strobe = delays.strobe();
    let delays = &delays.macropixel;
    let shift = delays.shift.iter().copied().reduce(hull);
    let shift = shift.expect("a sensor has bins");
    ChipTiming {
        spad_to_sampled: delays.latency[0].0,
        clk_to_shift: shift.1,
        clk_to_event: delays.event.max(shift.1),
        // Limits are not looked at: a flip-flop takes what is there.
        clk_period: Time::ZERO,
        broken_hold: None,
        // Until the bin has taken the hit: a cell each for HIT and the gate of its clock, and one more as a margin.
        strobe_to_hit: delays.slowest * 3,
        hit_high: Time::ZERO,
        // The law adds the rounding of clock edges.
        setup: spread(strobe),
        hold: spread(shift),
        recovery: MARGIN,
        removal: MARGIN,
        ..setting.nominal
    }
}

fn conventional(setting: &Setting, delays: &Delays) -> ChipTiming {
    ChipTiming {
        stop_to_strobe: delays.strobe().1,
        // An order of its own, below.
        stop_to_hit_ready: Time::ZERO,
        ..common(setting, delays)
    }
}

fn guided(setting: &Setting, delays: &Delays, counter: &CounterDelays) -> ChipTiming {
    let CounterDelays {
        counter_clk,
        local_stop,
        strobe,
        hit_release,
        ..
    } = *counter;
    let MacropixelDelays { reset, release, .. } = delays.macropixel;
    let jitter = spread(counter_clk);
    ChipTiming {
        clk_to_counter_clk: counter_clk.1,
        counter: CounterTiming {
            clk_to_local_stop: local_stop.1 - counter_clk.1,
            release: counter.released,
            settle: counter.reset_settled.unwrap_or(Time::ZERO),
            period: counter.settled - counter_clk.0 + MARGIN,
            recovery: jitter + MARGIN,
            removal: spread(release) + MARGIN,
            // Orders of their own, below.
            block: None,
            reset_width: Time::ZERO,
            reset_need: Time::ZERO,
            load_pulse: None,
            ..setting.nominal.counter
        },
        local_stop_to_strobe: strobe.1 - local_stop.1,
        stop_to_reset: reset.1 + jitter + MARGIN,
        stop_to_reset_release: release.1,
        stop_to_hit_reset: reset.0 + counter.hit_reset.0,
        stop_to_hit_release: release.1 + hit_release.1,
        ..common(setting, delays)
    }
}

/// The first thing in doubt for every start value.
fn common_doubt(setting: &Setting, delays: &Delays) -> Option<Doubt> {
    let (config, exposure, schedule) = (&setting.sensor, &setting.exposure, setting.schedule);
    let (strobe, hit_release) = (delays.strobe(), delays.hit_release());
    let counter = delays.counter.as_ref();
    let delays = &delays.macropixel;
    let slowest = delays.slowest;
    let period = exposure.clock.period() - MARGIN;
    let half = Time::from_fs(period.as_fs() / 2);
    // A count runs through a bin's bits, the tree that tells when it is full, and back to its clock's gate.
    let settling = slowest * (2 * config.bin_bits as i64 + 4);
    let laser_cycle = period * i64::from(exposure.stop_periods);
    let quiet = Time::from_fs((schedule.origin - schedule.load_end).as_fs() / 2);
    let after_the_end = schedule.end - schedule.origin - exposure.end();
    let shared = [
        (
            slowest * 4 < schedule.reset_end && slowest * 10 < quiet,
            Doubt::PowerUp,
        ),
        (slowest < half, Doubt::SlowCell),
        (!config.front_end.joins(), Doubt::SharedWire),
        (
            delays.latency.iter().all(|(rise, fall)| rise == fall),
            Doubt::UnevenLatency,
        ),
        (
            delays
                .latency
                .iter()
                .all(|(rise, _)| *rise + MARGIN < config.dead_time()),
            Doubt::ShortPulse,
        ),
        (
            settling < laser_cycle && strobe.1 + settling < after_the_end,
            Doubt::SlowBin,
        ),
        (
            // A carry passes 2ⁿ bits of a bin before it comes to those beside them in the tree that tells when the bin is
            // full, n gates deep: the tree has seen them fall by then, and is never high on the way.
            delays.slowest_and < delays.fastest_flip_flop * 2 || config.overflow == Overflow::Wrap,
            Doubt::FullForAMoment,
        ),
    ];
    let unmet = |orders: &[(bool, Doubt)]| orders.iter().find(|(holds, _)| !holds).map(|o| o.1);
    let by_mode = || match counter {
        // STOP stays high, and low, for a period at least.
        None => unmet(&[(
            hit_release.1 + MARGIN < strobe.0 && strobe.1 + slowest * 4 < period,
            Doubt::ResetMeetsStrobe,
        )]),
        Some(counter) => unmet(&counter_orders(config, delays, counter, period)),
    };
    unmet(&shared).or_else(by_mode)
}

/// Orders within the P-counter and its timing block, from one STOP edge.
fn counter_orders(
    config: &SensorConfig,
    delays: &MacropixelDelays,
    counter: &CounterDelays,
    period: Time,
) -> [(bool, Doubt); 7] {
    let MacropixelDelays { reset, release, .. } = *delays;
    let clear = counter.clear;
    // From a count to its strobe, at the least.
    let to_strobe = counter.strobe.0 - counter.counter_clk.1;
    let reset_width = release.0 - reset.1;
    let blocks_late = counter.block.is_some_and(|block| block.1 >= period);
    [
        (config.p_counter.row().has_memory, Doubt::Memoryless),
        (config.p_counter_block.is_none(), Doubt::OwnCounter),
        (
            counter.reset_edges() + MARGIN < reset_width && release.1 < period,
            Doubt::ShortReset,
        ),
        (
            // COUNTER_RESET's two causes overlap, and the first COUNTER_CLK edge meets it.
            reset.1 + MARGIN < clear.0
                && clear.1 + MARGIN < release.0
                && counter.enabled + MARGIN < release.0,
            Doubt::EnableMeetsReset,
        ),
        (
            !blocks_late || config.after_borrow == AfterBorrow::Wrap,
            Doubt::LateBlock,
        ),
        (
            counter.hit_release.1 + MARGIN < to_strobe,
            Doubt::StrobeMeetsReset,
        ),
        (
            reset.1 + counter.hit_falls + delays.slowest < release.0 + to_strobe,
            Doubt::SlowHit,
        ),
    ]
}
