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
//! Which photon times the bins of a window collect stands in [`bin_edges`](super::bin_edges), and what they count without photons in
//! [`empty_pixel`](super::empty_pixel).
//!
//! A counter TDC has no memory: its window begins where the shift register's ends. START rises a strobe and a clk-to-Q after LOCAL_STOP,
//! and the first rising edge that samples it high takes the photons of bin 0, so that `first_edge` is m + 1.
//!
//! Where delay lines time photons, LOCAL_STOP freezes the lines as soon as it comes: CLK has no part in the bins, only in where
//! windows end.
//!
//! [`ChipTiming`] has the delays of the paths concerned, measured on the netlist, and [`LocalStopDelays`] the ripple of each start value;
//! tests hold the law against it.

mod local_stop;

use super::bins::Bins;
use super::config::{AfterBorrow, Mode, Tdc};
use super::exposure::Exposure;
use super::p_counter::{Rises, starts_high};
use super::race::{Conflict, Cure, Irregular, NoAim, Race, RaceOrigin};
use super::sensors::Sensor;
use super::timing::macropixel::spread;
use super::timing::{ChipTiming, LocalStopDelays};
use crate::units::Time;
use local_stop::LocalStop;
use std::sync::Arc;

/// What the law adds to the flip-flops' limits: one femtosecond of rounding on either edge.
const ROUNDING: Time = Time::from_fs(2);

/// What becomes of a start value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WindowOutcome {
    /// The histogram is latched once in every laser cycle.
    Open(OpenWindow),
    /// LOCAL_STOP does not come within the laser cycle: nothing is ever counted.
    Never,
    /// The histogram is latched several times in a laser cycle, or not in the same CLK period of every one. What is
    /// counted then depends on what HIT still holds, and only an engine that goes through every CLK period can tell.
    Irregular(Irregular),
    /// Two signals come closer than a flip-flop's setup, hold, recovery or removal time allows: the circuit
    /// promises nothing, and only the gate-level engine shows what its model makes of it.
    Race(Race),
}

impl WindowOutcome {
    /// The open window, or `None` where it never opens.
    ///
    /// # Errors
    /// What keeps the law from telling.
    pub fn settled(self) -> Result<Option<OpenWindow>, NoAim> {
        match self {
            WindowOutcome::Open(window) => Ok(Some(window)),
            WindowOutcome::Never => Ok(None),
            WindowOutcome::Irregular(why) => Err(NoAim::Irregular(why)),
            WindowOutcome::Race(race) => Err(NoAim::Race(race)),
        }
    }

    /// The open window, if it is one.
    pub fn open(self) -> Option<OpenWindow> {
        match self {
            WindowOutcome::Open(window) => Some(window),
            WindowOutcome::Never | WindowOutcome::Irregular(_) | WindowOutcome::Race(_) => None,
        }
    }
}

/// A window relative to the STOP edge of its laser cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OpenWindow {
    /// The start value that opens it.
    pub start: u16,
    /// The rising CLK edge that takes the photons of bin 0 (edge 0 is the first after STOP at phase 0), where CLK does.
    pub first_edge: i64,
    /// Rise of LOCAL_STOP (guided) or STOP (conventional) after the laser cycle's STOP edge.
    pub strobe_cause: Time,
    /// The falling CLK edge whose count raises LOCAL_STOP, guided mode.
    pub(super) count_edge: i64,
    /// What the strobe has left of setup after one change of the shift register, and of hold before the next,
    /// whichever is smaller: the margin that a shorter CLK period or a slower ripple eats up. Means nothing where delay lines
    /// time photons.
    pub slack: Time,
}

/// The law for one sensor and exposure.
#[derive(Debug, Clone)]
pub struct WindowLaw {
    pub(super) sensor: Sensor,
    pub(super) exposure: Exposure,
    pub(super) timing: ChipTiming,
    /// The ripple of each start value; `None` where `timing` has one for all.
    pub(super) local_stop: Option<Arc<LocalStopDelays>>,
    pub(super) bins: i64,
    pub(super) edges: Bins,
    pub(super) period_fs: f64,
    /// From a SPAD's pulse to what is sampled, less what CLK and STOP come later to the macropixel than to column 0.
    pub(super) latency: Time,
}

impl WindowLaw {
    /// The law for this sensor in this exposure.
    pub fn new(sensor: impl Into<Sensor>, exposure: &Exposure) -> Self {
        let sensor = sensor.into();
        let timing = *sensor.timing();
        let local_stop = Some(Arc::clone(sensor.local_stop_delays()));
        WindowLaw {
            local_stop,
            ..Self::with_timing(sensor, exposure, timing)
        }
    }

    /// The law for a macropixel with delays of its own. Where they are known between bounds only, `timing` has the
    /// latest, and limits that are wider by the distance of the bounds.
    pub(crate) fn with_timing(
        sensor: impl Into<Sensor>,
        exposure: &Exposure,
        timing: ChipTiming,
    ) -> Self {
        let sensor = sensor.into();
        let edges = match sensor.tdc {
            Tdc::Clocked | Tdc::Counter => Bins::Clk,
            Tdc::DelayLine => Bins::of_delay_lines(&sensor, 0),
        };
        WindowLaw {
            bins: sensor.bins as i64,
            sensor,
            exposure: *exposure,
            timing,
            local_stop: None,
            edges,
            period_fs: 1e15 / exposure.clock.as_hz(),
            latency: timing.spad_to_sampled,
        }
    }

    /// The law of a macropixel, by its number in the array, row-major, where that has delay lines of its own, or CLK comes later to it
    /// than to column 0. Otherwise this one.
    #[must_use]
    pub fn of_macropixel(&self, number: u32) -> Self {
        let mut law = self.clone();
        let number = number as usize;
        if self.sensor.tdc == Tdc::DelayLine {
            law.edges = Bins::of_delay_lines(&self.sensor, number);
        }
        law.latency = self.timing.spad_to_sampled - self.sensor.clk_skew(number % self.sensor.cols);
        law
    }

    /// The sensor.
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// Its clocks.
    pub fn exposure(&self) -> &Exposure {
        &self.exposure
    }

    /// The delays the law is computed from.
    pub fn timing(&self) -> &ChipTiming {
        &self.timing
    }

    /// CLK falling to LOCAL_STOP rising from this start value (thesis 4.6, Fig. 56).
    pub fn ripple(&self, start: u16) -> Time {
        let own = self.local_stop.as_ref();
        let delay = own.map(|delays| delays.of_start(start));
        self.timing.clk_to_counter_clk + delay.unwrap_or(self.timing.counter.clk_to_local_stop)
    }

    /// A start value from which these delays count something else.
    fn miscount(&self, start: u16) -> Option<Irregular> {
        let found = self.local_stop.as_ref()?.miscount(start)?;
        Some(Irregular::Miscounts { start, found })
    }

    /// The earliest and the latest ripple of all start values.
    fn ripples(&self) -> (Time, Time) {
        let latest = self.timing.counter.clk_to_local_stop;
        let own = self.local_stop.as_ref();
        let (least, most) = own.map_or((latest, latest), |delays| delays.span());
        let before = self.timing.clk_to_counter_clk;
        (before + least, before + most)
    }

    /// Where the window of a start value lies.
    pub fn window(&self, start: u16) -> WindowOutcome {
        let (exposure, timing) = (&self.exposure, &self.timing);
        let end = exposure.clock.periods(exposure.stop_periods as i64);
        let period = exposure.clock.period();
        let is_clocked = self.sensor.tdc == Tdc::Clocked;
        let to_shift = timing.clk_to_event + timing.setup + ROUNDING;
        if self.sensor.tdc.has_clk_bins() && period <= to_shift {
            let own = &self.sensor;
            let is_own = own.front_end_block.is_some() || own.metdc_block.is_some();
            let what = if is_own || !is_clocked {
                Conflict::SlowPath
            } else {
                Conflict::SlowCorrelation
            };
            return WindowOutcome::Race(Race::too_slow(what, to_shift, period));
        }
        if let Some(need) = timing.broken_hold {
            return WindowOutcome::Race(Race::broken_hold(need));
        }
        if period < timing.clk_period {
            let race = Race::too_slow(Conflict::SlowPath, timing.clk_period, period);
            return WindowOutcome::Race(race);
        }
        if let (Mode::Guided, Some(why)) = (self.sensor.mode, self.miscount(start)) {
            return WindowOutcome::Irregular(why);
        }
        let (cause, arrival, count_edge, irregular) = match self.sensor.mode {
            // A laser cycle is counted by the STOP edge that ends it.
            Mode::Conventional => {
                if let Some(race) = self.strobe_of_stop() {
                    return WindowOutcome::Race(race);
                }
                (end, end + timing.stop_to_strobe, 0, None)
            }
            Mode::Guided => {
                let is_reset = self.sensor.p_counter.row().has_memory;
                let found = if is_reset {
                    self.with_reset(start)
                } else {
                    self.coming_round(start)
                };
                let unknown = self.own_counter();
                match found {
                    Ok(LocalStop {
                        time,
                        edge,
                        irregular,
                    }) => {
                        let irregular = unknown.or(irregular);
                        (time, time + timing.local_stop_to_strobe, edge, irregular)
                    }
                    Err(WindowOutcome::Never) => {
                        return unknown.map_or(WindowOutcome::Never, WindowOutcome::Irregular);
                    }
                    Err(window) => return window,
                }
            }
        };
        if self.sensor.tdc == Tdc::Counter {
            return self.counted_window(start, (cause, arrival), count_edge, irregular);
        }
        let last = exposure.rising_until(arrival - timing.clk_to_shift);
        let after = arrival - (exposure.rising(last) + timing.clk_to_shift);
        let before = exposure.rising(last + 1) + timing.clk_to_shift - arrival;
        let slack = (after - timing.setup).min(before - timing.hold);
        if is_clocked && slack <= ROUNDING {
            let change = if after < before {
                arrival - after
            } else {
                arrival + before
            };
            return WindowOutcome::Race(self.strobe_race(start, (cause, arrival), change));
        }
        if let Some(why) = irregular.or(self.sensor.lawless_block().map(Irregular::OwnBlock)) {
            return WindowOutcome::Irregular(why);
        }
        WindowOutcome::Open(OpenWindow {
            start,
            first_edge: last - self.bins,
            strobe_cause: cause,
            count_edge,
            slack,
        })
    }

    /// The window of a counter TDC: `arrival` is that of the strobe which sets START.
    fn counted_window(
        &self,
        start: u16,
        (cause, arrival): (Time, Time),
        count_edge: i64,
        irregular: Option<Irregular>,
    ) -> WindowOutcome {
        let (exposure, timing) = (&self.exposure, &self.timing);
        let (setup, hold) = (timing.setup + ROUNDING, timing.hold + ROUNDING);
        let (period, phase) = (exposure.clock.period(), exposure.stop_phase);
        // What is left of hold after the edge before a change of START, and of setup before the edge after it.
        let slacks = |change: Time| {
            let before = exposure.rising_until(change);
            let [before_s, after_s] = [before, before + 1].map(|edge| exposure.rising(edge));
            (before, change - before_s - hold, after_s - change - setup)
        };
        let falls = timing.stop_to_start_falls;
        let (edge, held, set_up) = slacks(falls);
        let low = edge + 1;
        if held.min(set_up) <= Time::ZERO {
            let comes = exposure.rising(if held < set_up { edge } else { low });
            let forbidden = (falls - hold, falls + setup);
            let what = Conflict::StartFallsAtClk;
            return WindowOutcome::Race(Race::with_stop(what, comes, forbidden, phase, period));
        }
        let rises = arrival + timing.strobe_to_hit;
        let (last, held, set_up) = slacks(rises);
        if held.min(set_up) <= Time::ZERO {
            let to_start = timing.local_stop_to_strobe + timing.strobe_to_hit;
            let from_fall = self.ripple(start) + to_start;
            let fall = exposure.rising_until(rises - from_fall) + 1;
            let edge = if held < set_up { last } else { last + 1 };
            let ripples = self.ripples();
            let starts = (ripples.0 + to_start, ripples.1 + to_start);
            let signals = (from_fall, Time::ZERO);
            // START is the data here, and CLK the clock.
            let limits = (hold, setup);
            let all = (starts, self.shortest_period());
            let race = Race::strobe_at_shift(period, edge - fall, signals, limits, all);
            let what = Conflict::StartAtClk;
            return WindowOutcome::Race(Race { what, ..race });
        }
        let periods = i64::from(exposure.stop_periods);
        let of_counter = if last < low {
            Some(Irregular::StartStaysHigh)
        } else {
            (last + 1 + self.bins > periods).then_some(Irregular::CutWindow)
        };
        let of_block = self.sensor.lawless_block().map(Irregular::OwnBlock);
        if let Some(why) = irregular.or(of_block).or(of_counter) {
            return WindowOutcome::Irregular(why);
        }
        WindowOutcome::Open(OpenWindow {
            start,
            first_edge: last + 1,
            strobe_cause: cause,
            count_edge,
            slack: held.min(set_up) + ROUNDING,
        })
    }

    /// The strobe of a start value at `arrival`, for this `cause`, too near a `change` of the shift register.
    fn strobe_race(&self, start: u16, (cause, arrival): (Time, Time), change: Time) -> Race {
        let (exposure, timing) = (&self.exposure, &self.timing);
        let period = exposure.clock.period();
        let (setup, hold) = (timing.setup + ROUNDING, timing.hold + ROUNDING);
        match self.sensor.mode {
            Mode::Guided => {
                let strobe = self.ripple(start) + timing.local_stop_to_strobe;
                let edge = exposure.rising_until(change - timing.clk_to_shift);
                let fall = exposure.rising_until(arrival - strobe) + 1;
                let ripples = self.ripples();
                let to_strobe = timing.local_stop_to_strobe;
                let strobes = (ripples.0 + to_strobe, ripples.1 + to_strobe);
                let signals = (strobe, timing.clk_to_shift);
                let limits = (setup, hold);
                let all = (strobes, self.shortest_period());
                Race::strobe_at_shift(period, edge - fall, signals, limits, all)
            }
            // The shift register comes earlier after STOP where STOP comes later.
            Mode::Conventional => {
                let what = Conflict::ShiftAtStrobe;
                let strobe = arrival - cause;
                let forbidden = (strobe - setup, strobe + hold);
                Race::with_stop(what, change - cause, forbidden, exposure.stop_phase, period)
            }
        }
    }

    /// The shortest CLK period that everything but strobe and block allows.
    fn shortest_period(&self) -> Time {
        let timing = &self.timing;
        let paths = timing.clk_to_event.max(timing.counter.period);
        timing.clk_period.max(paths + timing.setup + ROUNDING)
    }

    /// What keeps a P-counter of one's own from having a law, if anything.
    fn own_counter(&self) -> Option<Irregular> {
        let law = self.sensor.counter_law()?;
        let is_coded = self.sensor.tdc == Tdc::DelayLine && !law.is_plain();
        let uneven = law.uneven().map(Irregular::OwnCounter);
        uneven.or(is_coded.then_some(Irregular::OwnCodes))
    }

    /// Why no window can be aimed, if so: the reason for which start values do not open one.
    pub fn refusal(&self) -> Option<NoAim> {
        let reason = |start| self.window(start).settled().err();
        let mut reasons = self.samples().map(reason);
        let first = reasons.next()??;
        reasons.all(|why| why.is_some()).then_some(first)
    }

    /// All start values, and before them a few of which one opens a window if most do.
    pub(super) fn samples(&self) -> impl Iterator<Item = u16> + use<> {
        let largest = self.sensor.largest_start();
        let first = [0, 1, 16.min(largest), largest / 2];
        first.into_iter().chain(0..=largest)
    }

    /// CLK periods by which the ripples of two start values may differ, rounded up.
    pub(super) fn ripple_spread_periods(&self) -> u16 {
        let own = self.local_stop.as_ref();
        let spread = own.map_or(Time::ZERO, |delays| spread(delays.bounds()));
        (spread.as_fs() as f64 / self.period_fs).ceil() as u16
    }
}

#[cfg(test)]
mod by_edges;
#[cfg(test)]
mod tests;
