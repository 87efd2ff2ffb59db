//! The window law: which photons a start value selects.
//!
//! ```text
//!   STOP  ─┐0                                                      time →
//!   CLK    └──┐  ┌──┐  ┌──┐  ┌──      falling edge k at k·T − phase, rising edge half a period on
//!   COUNTER_CLK  counts falling edges from the first one after the reset pulse, f₀
//!   LOCAL_STOP   rises a ripple after falling edge f₀ + start
//!   STROBE       sees the shift register as rising edge m left it: the last with e_m + clk-to-Q ≤ strobe
//!   bin b        holds the photons that rising edge m − M + b took: (e − T − d, e − d], d = pulse → toggle
//! ```
//!
//! So bin b covers `[first_edge + b − 1, first_edge + b)` in rising edges, shifted by the front-end latency
//! d, with `first_edge = m − M`. At 384 MHz and phase 0, m = start: the start value counts CLK periods from
//! STOP to the end of the window, less one and a half. Windows of small start values begin before the STOP
//! edge, in the tail of the previous laser cycle.
//!
//! So it is with the sensor's own P-counter and the variants that are reset as it is. One without memory counts from
//! the first falling edge that ENABLE lets through. One that wraps may raise LOCAL_STOP again in the same laser
//! cycle, where HIT still holds what it latched before: no single window describes that, and the law says so.
//!
//! Which photon times the bins of a window collect stands in [`bin_edges`](super::bin_edges).
//!
//! [`ChipTiming`] has the delays of the paths concerned, measured on the netlist; tests hold the law against it.

use super::config::{Mode, PCounter, SensorConfig};
use super::exposure::Exposure;
use super::p_counter::{Rises, starts_high};
use super::race::{Cure, Race};
use super::timing::ChipTiming;
use crate::units::Time;

/// What the law adds to the flip-flops' limits: one femtosecond of rounding on either edge.
const ROUNDING: Time = Time::from_fs(2);

/// What becomes of a start value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Window {
    /// The histogram is latched once in every laser cycle.
    Open(OpenWindow),
    /// LOCAL_STOP does not come within the laser cycle: nothing is ever counted.
    Never,
    /// The histogram is latched several times in a laser cycle, or not in the same CLK period of every one. What is
    /// counted then depends on what HIT still holds, and only an engine that goes through every CLK period can tell.
    Irregular(&'static str),
    /// Two signals come closer than a flip-flop's setup, hold, recovery or removal time allows: the circuit
    /// promises nothing, and only the gate-level engine shows what its model makes of it.
    Race(Race),
}

impl Window {
    /// The open window, if it is one.
    pub fn open(self) -> Option<OpenWindow> {
        match self {
            Window::Open(window) => Some(window),
            Window::Never | Window::Irregular(_) | Window::Race(_) => None,
        }
    }
}

/// A window relative to the STOP edge of its laser cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OpenWindow {
    /// The rising CLK edge that takes the photons of bin 0 (edge 0 is the first after STOP at phase 0).
    pub first_edge: i64,
    /// Rise of LOCAL_STOP (guided) or STOP (conventional) after the laser cycle's STOP edge.
    pub strobe_cause: Time,
    /// What the strobe has left of setup after one change of the shift register, and of hold before the next,
    /// whichever is smaller: the margin that a shorter CLK period or a slower ripple eats up.
    pub slack: Time,
}

/// Where LOCAL_STOP rises first.
struct LocalStop {
    /// After its laser cycle's STOP edge.
    time: Time,
    /// What keeps it from rising once in every laser cycle at this place, if anything.
    irregular: Option<&'static str>,
}

/// The law for one sensor and exposure.
#[derive(Debug, Clone)]
pub struct WindowLaw {
    pub(super) config: SensorConfig,
    pub(super) exposure: Exposure,
    pub(super) timing: ChipTiming,
    pub(super) bins: i64,
    pub(super) period_fs: f64,
}

impl WindowLaw {
    /// The law for this sensor in this exposure.
    pub fn new(config: &SensorConfig, exposure: &Exposure) -> Self {
        Self::with_timing(config, exposure, ChipTiming::of(config))
    }

    /// The law for a macropixel with delays of its own. Where they are known between bounds only, `timing` has the
    /// latest, and limits that are wider by the distance of the bounds.
    pub fn with_timing(config: &SensorConfig, exposure: &Exposure, timing: ChipTiming) -> Self {
        WindowLaw {
            config: config.clone(),
            exposure: *exposure,
            timing,
            bins: config.bins as i64,
            period_fs: 1e15 / exposure.clock.as_hz(),
        }
    }

    /// The delays the law is computed from.
    pub fn timing(&self) -> &ChipTiming {
        &self.timing
    }

    /// Where the window of a start value lies.
    pub fn window(&self, start: u16) -> Window {
        let (exposure, timing) = (&self.exposure, &self.timing);
        let end = exposure.clock.periods(exposure.stop_periods as i64);
        let period = exposure.clock.period();
        let to_shift = timing.clk_to_event + timing.setup + ROUNDING;
        if period <= to_shift {
            let what = "the correlation block is slower than a CLK period";
            return Window::Race(Race::too_slow(what, to_shift, period));
        }
        let (cause, arrival, irregular) = match self.config.mode {
            // A laser cycle is counted by the STOP edge that ends it.
            Mode::Conventional => (end, end + timing.stop_to_strobe, None),
            Mode::Guided => {
                let is_reset = self.config.p_counter != PCounter::Memoryless;
                let found = if is_reset {
                    self.with_reset(start)
                } else {
                    self.coming_round(start)
                };
                match found {
                    Ok(LocalStop { time, irregular }) => {
                        (time, time + timing.local_stop_to_strobe, irregular)
                    }
                    Err(window) => return window,
                }
            }
        };
        let last = exposure.rising_until(arrival - timing.clk_to_shift);
        let after = arrival - (exposure.rising(last) + timing.clk_to_shift);
        let before = exposure.rising(last + 1) + timing.clk_to_shift - arrival;
        let slack = (after - timing.setup).min(before - timing.hold);
        if slack <= ROUNDING {
            let change = if after < before {
                arrival - after
            } else {
                arrival + before
            };
            return Window::Race(self.strobe_race(cause, arrival, change));
        }
        if let Some(why) = irregular {
            return Window::Irregular(why);
        }
        Window::Open(OpenWindow {
            first_edge: last - self.bins,
            strobe_cause: cause,
            slack,
        })
    }

    /// A strobe at `arrival`, for this `cause`, too near a `change` of the shift register.
    fn strobe_race(&self, cause: Time, arrival: Time, change: Time) -> Race {
        let (exposure, timing) = (&self.exposure, &self.timing);
        let period = exposure.clock.period();
        let (setup, hold) = (timing.setup + ROUNDING, timing.hold + ROUNDING);
        match self.config.mode {
            Mode::Guided => {
                let strobe = timing.ripple() + timing.local_stop_to_strobe;
                let edge = exposure.rising_until(change - timing.clk_to_shift);
                let fall = exposure.rising_until(arrival - strobe) + 1;
                let shortest = timing.clk_to_event.max(timing.counter.period) + setup;
                let signals = (strobe, timing.clk_to_shift);
                Race::strobe_at_shift(period, edge - fall, signals, (setup, hold), shortest)
            }
            // The shift register comes earlier after STOP where STOP comes later.
            Mode::Conventional => {
                let what = "a change of the shift register meets the strobe";
                let strobe = arrival - cause;
                let forbidden = (strobe - setup, strobe + hold);
                Race::with_stop(what, change - cause, forbidden, exposure.stop_phase, period)
            }
        }
    }

    /// LOCAL_STOP of a counter that each STOP resets.
    fn with_reset(&self, start: u16) -> Result<LocalStop, Window> {
        let (exposure, timing) = (&self.exposure, &self.timing);
        let counter = &timing.counter;
        let (period, phase) = (exposure.clock.period(), exposure.stop_phase);
        let count = counter.period + ROUNDING;
        if period <= count {
            let what = "the P-counter is slower than a CLK period";
            return Err(Window::Race(Race::too_slow(what, count, period)));
        }
        let Some(rises) = Rises::of(&self.config, start) else {
            return Err(Window::Never);
        };
        let released = timing.stop_to_reset_release + counter.release + counter.recovery;
        let in_doubt = timing.stop_to_reset_release - counter.removal - ROUNDING
            ..=released.max(timing.stop_to_reset + counter.settle) + ROUNDING;
        let counter_clk = |edge| exposure.falling(edge) + timing.clk_to_counter_clk;
        let mut first = 0;
        while counter_clk(first) <= *in_doubt.end() {
            first += 1;
        }
        let edge = counter_clk(first - 1);
        if in_doubt.contains(&edge) {
            let what = "a CLK edge meets the end of the reset pulse";
            let race = Race::with_stop(what, edge, in_doubt.into_inner(), phase, period);
            return Err(Window::Race(race));
        }

        // Later than the counts that the next reset forestalls.
        let end = exposure.clock.periods(exposure.stop_periods as i64);
        let edges = (0..).map(|n| first + rises.first + n * rises.every.unwrap_or(i64::MAX / 2));
        let edges = edges.take_while(|&edge| counter_clk(edge) < end + timing.stop_to_reset);
        let edges: Vec<i64> = edges
            .take(if rises.every.is_some() { usize::MAX } else { 1 })
            .collect();
        let (Some(&edge), Some(&last)) = (edges.first(), edges.last()) else {
            return Err(Window::Never);
        };
        let deadline = end + timing.stop_to_hit_reset - timing.strobe_to_hit;
        let strobe = exposure.falling(last) + timing.ripple() + timing.local_stop_to_strobe;
        let margin = deadline - strobe;
        if margin < -ROUNDING && rises.every.is_none() {
            return Err(Window::Never);
        }
        if margin <= ROUNDING {
            return Err(Window::Race(Race {
                what: "the strobe meets the next laser cycle's reset",
                after: "STOP rises",
                comes: strobe,
                from: deadline - ROUNDING,
                to: rises.every.is_none().then_some(deadline + ROUNDING),
                cure: Cure::LaserCycle,
            }));
        }
        if rises.every.is_some() && starts_high(&self.config, start) {
            let delay = counter
                .reset_to_local_stop
                .expect("the tap msb rises at a reset");
            let arrival = timing.stop_to_reset + delay + timing.local_stop_to_strobe;
            let until = timing.stop_to_hit_release - timing.removal - ROUNDING;
            if arrival >= until {
                return Err(Window::Race(Race {
                    what: "the strobe that the reset makes meets the end of HIT's reset",
                    after: "STOP rises",
                    comes: arrival,
                    from: until,
                    to: None,
                    cure: Cure::Tap,
                }));
            }
        }
        Ok(LocalStop {
            time: exposure.falling(edge) + timing.ripple(),
            irregular: (edges.len() > 1)
                .then_some("LOCAL_STOP rises more than once in a laser cycle"),
        })
    }

    /// LOCAL_STOP of a counter that nothing resets.
    fn coming_round(&self, start: u16) -> Result<LocalStop, Window> {
        let (exposure, timing) = (&self.exposure, &self.timing);
        let counter = &timing.counter;
        let enabled = timing.stop_to_enabled;
        let first = exposure.rising_until(enabled) + 1;
        let shortest = counter.clock_high + timing.clk_to_counter_clk + ROUNDING;
        let in_doubt = (enabled - ROUNDING, enabled + shortest);
        let meets = [first, first - 1].map(|edge| exposure.rising(edge));
        let meets = meets
            .into_iter()
            .find(|t| (in_doubt.0..=in_doubt.1).contains(t));
        if let Some(edge) = meets {
            let what = "CLK rises as ENABLE lets it through";
            let (phase, period) = (exposure.stop_phase, exposure.clock.period());
            let race = Race::with_stop(what, edge, in_doubt, phase, period);
            return Err(Window::Race(race));
        }
        let rises = Rises::of(&self.config, start).expect("a counter without memory wraps");
        let every = rises.every.expect("a counter without memory wraps");
        let periods = exposure.stop_periods as i64;
        let last = periods * exposure.laser_cycles as i64;
        let edge = first + rises.first;
        let is_first_count = rises.first == 0 && exposure.falling(first) <= enabled + ROUNDING;
        if is_first_count || (last >= edge && (last - edge) % every == 0) {
            let comes = exposure.falling(if is_first_count { first } else { last });
            return Err(Window::Race(Race {
                what: "LOCAL_STOP rises as ENABLE changes",
                after: "the first STOP edge",
                comes,
                from: comes.min(enabled),
                to: Some(comes.max(if is_first_count {
                    enabled
                } else {
                    exposure.end() + enabled
                })),
                cure: Cure::LaserCycle,
            }));
        }
        // STOP also resets HIT.
        let end = exposure.clock.periods(periods);
        let in_doubt = timing.stop_to_hit_reset - timing.strobe_to_hit - ROUNDING
            ..=timing.stop_to_hit_release + timing.recovery + ROUNDING;
        let meets_reset = |edge: i64| {
            let place = exposure.falling(edge.rem_euclid(periods));
            let arrival = place + timing.ripple() + timing.local_stop_to_strobe;
            [arrival, arrival - end]
                .into_iter()
                .find(|t| in_doubt.contains(t))
        };
        let mut edges = (edge..last).step_by(every as usize).take(periods as usize);
        if let Some(strobe) = edges.find_map(meets_reset) {
            return Err(Window::Race(Race {
                what: "the strobe meets a laser cycle's reset",
                after: "STOP rises",
                comes: strobe,
                from: *in_doubt.start(),
                to: Some(*in_doubt.end()),
                cure: Cure::LaserCycle,
            }));
        }
        Ok(LocalStop {
            time: exposure.falling(edge) + timing.ripple(),
            irregular: (periods != every)
                .then_some("STOP does not come once in each round of the P-counter without memory"),
        })
    }

    /// Why no window can be aimed, if so, and the cure: the reason for which start values do not open one.
    pub fn refusal(&self) -> Option<(String, String)> {
        let reason = |start| match self.window(start) {
            Window::Race(race) => Some((race.to_string(), race.cure.to_string())),
            Window::Irregular(why) => {
                let cure = "give after_borrow = \"hold\", or other --stop-periods";
                Some((why.to_owned(), cure.to_owned()))
            }
            Window::Open(_) | Window::Never => None,
        };
        let mut reasons = self.samples().into_iter().map(reason);
        reasons.try_fold(None, |_, why| why.map(Some))?
    }

    /// A few start values, one of which opens a window if most do.
    pub(super) fn samples(&self) -> [u16; 4] {
        let largest = self.config.largest_start();
        [0, 1, 16.min(largest), largest / 2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::AfterBorrow;
    use crate::netlist::Corner;
    use proptest::prelude::*;

    fn law(config: &SensorConfig) -> WindowLaw {
        WindowLaw::new(config, &Exposure::new(config, 520, 1))
    }

    #[test]
    fn the_typical_ripple_is_the_published_one() {
        let ripple = ChipTiming::of(&SensorConfig::default()).ripple();
        assert!((ripple.as_ns() - 1.2).abs() < 0.01, "{ripple}");
    }

    #[test]
    fn at_384_mhz_the_window_ends_one_and_a_half_periods_before_the_start_value() {
        let config = SensorConfig::default();
        let law = law(&config);
        let window = law.window(100).open().unwrap();
        assert_eq!(window.first_edge, 100 - 16);
        let end = law.interval(&window).end;
        let expected = config.clock().half_periods(2 * 99 + 1) - law.timing().spad_to_toggle;
        assert!((end - expected).as_fs().abs() <= 2);
    }

    #[test]
    fn a_start_value_beyond_the_laser_cycle_never_opens() {
        let config = SensorConfig::default();
        let short = WindowLaw::new(&config, &Exposure::new(&config, 100, 1));
        assert!(short.window(98).open().is_some());
        assert_eq!(short.window(99), Window::Never);
        assert_eq!(short.window(511), Window::Never);
    }

    proptest! {
        #[test]
        fn a_cure_keeps_the_two_signals_apart(
            clk_mhz in 150f64..900.0,
            phase in -1f64..1.0,
            corner in prop::sample::select(Corner::ALL.to_vec()),
            mode in prop::sample::select(vec![Mode::Guided, Mode::Conventional]),
            p_counter in prop::sample::select(PCounter::ALL.to_vec()),
        ) {
            let after_borrow = match p_counter {
                PCounter::Memoryless => AfterBorrow::Wrap,
                _ => AfterBorrow::Hold,
            };
            let config = SensorConfig {
                clk_hz: clk_mhz * 1e6,
                stop_phase_ps: phase * 0.5e6 / clk_mhz,
                corner,
                mode,
                p_counter,
                after_borrow,
                ..SensorConfig::default()
            };
            let window = |config: &SensorConfig| {
                WindowLaw::new(config, &Exposure::new(config, 1024, 1)).window(100)
            };
            if let Window::Race(race) = window(&config) {
                prop_assert!(race.slack() <= ROUNDING, "{race}");
                let mut cured = Vec::new();
                let mut push = |change: &dyn Fn(&mut SensorConfig)| {
                    let mut config = config.clone();
                    change(&mut config);
                    cured.push(config);
                };
                match race.cure {
                    Cure::Period { at_least, at_most } => {
                        for period in [Some(at_least), at_most].into_iter().flatten() {
                            push(&|config| config.clk_hz = 1.0 / period.as_s());
                        }
                    }
                    Cure::Phase { at_most, at_least } => {
                        for phase in [at_most, at_least].into_iter().flatten() {
                            push(&|config| config.stop_phase_ps = phase.as_ns() * 1e3);
                        }
                    }
                    Cure::LaserCycle | Cure::Tap => {}
                }
                for config in cured {
                    let again = window(&config);
                    let is_same = matches!(again, Window::Race(r) if r.what == race.what);
                    prop_assert!(!is_same, "{race}; {}: {again:?}", race.cure);
                }
            }
        }

        #[test]
        fn bins_tile_time(start in 0u16..512, cycle in 0i64..1000, clk_mhz in 100f64..420.0) {
            let config = SensorConfig { clk_hz: clk_mhz * 1e6, ..SensorConfig::default() };
            let law = law(&config);
            if let Some(window) = law.window(start).open() {
                for bin in 0..15 {
                    let here = law.bin_interval(&window, cycle, bin);
                    let next = law.bin_interval(&window, cycle, bin + 1);
                    prop_assert_eq!(here.end, next.start);
                    let width = here.end - here.start;
                    prop_assert!((width - config.clock().period()).as_fs().abs() <= 1);
                }
            }
        }

        #[test]
        fn the_chosen_start_value_is_the_best_of_all(ns in 0.0f64..1400.0, clk_mhz in 200f64..400.0) {
            let config = SensorConfig { clk_hz: clk_mhz * 1e6, ..SensorConfig::default() };
            let law = law(&config);
            let time = Time::from_s(ns * 1e-9);
            let centre_distance = |start| {
                let interval = law.interval(&law.window(start).open()?);
                interval.contains(&time).then(|| {
                    let centre = (interval.start.as_fs() + interval.end.as_fs()) / 2;
                    ((centre - time.as_fs()).abs(), start)
                })
            };
            let best = (0..512).filter_map(centre_distance).min();
            let chosen = law.start_for(time);
            prop_assert_eq!(chosen.is_some(), best.is_some());
            if let (Some(chosen), Some((distance, _))) = (chosen, best) {
                let got = centre_distance(chosen).unwrap().0;
                prop_assert!(got <= distance + 1, "{got} {distance}");
            }
        }
    }
}
