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
//! [`ChipTiming`] adds up the cell delays on the paths concerned; tests hold both against the netlist.

use std::ops::Range;

use super::config::{Mode, SensorConfig};
use super::exposure::Exposure;
use super::{correlation, p_counter_timing};
use crate::logic::Logic::{One, Zero};
use crate::netlist::{CellKind, CheckKind, Corner, Edge, Library, Netlist, StaticTiming, Timing};
use crate::units::Time;

/// Delays of the paths that decide where a window lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChipTiming {
    /// SPAD_RAW rising to the toggle flip-flop's output: the front-end latency.
    pub spad_to_toggle: Time,
    /// CLK falling to COUNTER_CLK rising.
    pub clk_to_counter_clk: Time,
    /// COUNTER_CLK rising to LOCAL_STOP rising: the ripple through every stage.
    pub counter_clk_to_local_stop: Time,
    /// LOCAL_STOP rising to the clock of the HIT flip-flops.
    pub local_stop_to_strobe: Time,
    /// STOP rising to the clock of the HIT flip-flops, conventional mode.
    pub stop_to_strobe: Time,
    /// Clock of the HIT flip-flops to HIT.
    pub strobe_to_hit: Time,
    /// CLK rising to a change of the METDC's shift register.
    pub clk_to_shift: Time,
    /// STOP rising to COUNTER_RESET rising.
    pub stop_to_reset: Time,
    /// STOP rising to COUNTER_RESET falling.
    pub stop_to_reset_release: Time,
    /// STOP rising to the reset of the HIT flip-flops, guided mode.
    pub stop_to_hit_reset: Time,
    /// CLK rising to SPAD_EVENT settled, longest path.
    pub clk_to_event: Time,
    /// How long before its clock a flip-flop's data must be stable.
    pub setup: Time,
    /// How long after its clock a flip-flop's data must be stable.
    pub hold: Time,
    /// How long before a clock edge that counts a reset must be released.
    pub recovery: Time,
    /// How long after a clock edge that must not count a reset must still hold.
    pub removal: Time,
}

impl ChipTiming {
    /// The timing of a sensor built from the default cell library, in its corner.
    pub fn of(config: &SensorConfig) -> Self {
        let library = Library::default();
        let corner = config.corner;
        let delay = |kind, pin, to| library.delay(kind, pin, to, corner);
        let limits = library.checks(CellKind::Dffr);
        let limit = |check| Time::from_fs(limits.at(check, corner) as i64);
        let clock_to_q = delay(CellKind::Dffr, 1, One);
        let mux_rise = delay(CellKind::Mux2, 0, One);
        let buffer_rise = delay(CellKind::Buf, 0, One);
        let or_rise = delay(CellKind::Or2, 0, One);
        let chain = buffer_rise * p_counter_timing::DELAY_CHAIN as i64;
        let stop_to_reset = delay(CellKind::And2, 0, One) + or_rise;
        let correlation = longest_correlation(&library, corner);
        let xor = delay(CellKind::Xor2, 0, One).max(delay(CellKind::Xor2, 0, Zero));
        ChipTiming {
            spad_to_toggle: clock_to_q,
            clk_to_counter_clk: delay(CellKind::Nor2, 0, One),
            counter_clk_to_local_stop: (clock_to_q + mux_rise) * config.counter_bits as i64
                + clock_to_q,
            local_stop_to_strobe: mux_rise + buffer_rise,
            stop_to_strobe: chain + mux_rise + buffer_rise,
            strobe_to_hit: clock_to_q,
            clk_to_shift: clock_to_q,
            stop_to_reset,
            stop_to_reset_release: chain
                + delay(CellKind::Inv, 0, Zero)
                + delay(CellKind::And2, 0, Zero)
                + delay(CellKind::Or2, 0, Zero),
            stop_to_hit_reset: stop_to_reset + mux_rise,
            clk_to_event: clock_to_q + xor + correlation,
            setup: limit(CheckKind::Setup),
            hold: limit(CheckKind::Hold),
            recovery: limit(CheckKind::Recovery),
            removal: limit(CheckKind::Removal),
        }
    }

    /// CLK falling to LOCAL_STOP rising: what the thesis calls the ripple delay (4.6, Fig. 56).
    pub fn ripple(&self) -> Time {
        self.clk_to_counter_clk + self.counter_clk_to_local_stop
    }
}

/// The longest path from SPAD_TIMED to SPAD_EVENT.
fn longest_correlation(library: &Library, corner: Corner) -> Time {
    let netlist = Netlist::elaborate(&correlation::circuit());
    let timing = Timing::nominal(&netlist, library, corner);
    let nets = |name| netlist.signal(name).expect("a port of the block");
    let starts: Vec<_> = nets("SPAD_TIMED")
        .into_iter()
        .flat_map(|net| Edge::BOTH.map(|edge| (net, edge)))
        .collect();
    let arrivals = StaticTiming::new(&netlist, &timing)
        .arrivals(&starts, &[])
        .expect("the block is combinational");
    let (_, longest) = arrivals
        .window(nets("SPAD_EVENT")[0])
        .expect("SPAD_EVENT depends on SPAD_TIMED");
    longest
}

/// What the law adds to the flip-flops' limits: one femtosecond of rounding on either edge.
const ROUNDING: Time = Time::from_fs(2);

/// What becomes of a start value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Window {
    /// The histogram is latched once in every laser cycle.
    Open(OpenWindow),
    /// LOCAL_STOP does not come within the laser cycle: nothing is ever counted.
    Never,
    /// Two signals come closer than a flip-flop's setup, hold, recovery or removal time allows: the circuit
    /// promises nothing, and only the gate-level engine shows what its model makes of it.
    Race(&'static str),
}

impl Window {
    /// The open window, if it is one.
    pub fn open(self) -> Option<OpenWindow> {
        match self {
            Window::Open(window) => Some(window),
            Window::Never | Window::Race(_) => None,
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

/// The law for one sensor and exposure.
#[derive(Debug, Clone)]
pub struct WindowLaw {
    exposure: Exposure,
    timing: ChipTiming,
    mode: Mode,
    bins: i64,
    largest_start: u16,
}

impl WindowLaw {
    /// The law for this sensor in this exposure.
    pub fn new(config: &SensorConfig, exposure: &Exposure) -> Self {
        WindowLaw {
            exposure: *exposure,
            timing: ChipTiming::of(config),
            mode: config.mode,
            bins: config.bins as i64,
            largest_start: config.largest_start(),
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
        if exposure.clock.period() <= timing.clk_to_event + timing.setup + ROUNDING {
            return Window::Race("the correlation block is slower than a CLK period");
        }
        let (cause, arrival) = match self.mode {
            // A laser cycle is counted by the STOP edge that ends it.
            Mode::Conventional => (end, end + timing.stop_to_strobe),
            Mode::Guided => {
                let counts_from = timing.stop_to_reset_release - timing.clk_to_counter_clk;
                let mut first = 0;
                while exposure.falling(first) < counts_from {
                    first += 1;
                }
                let near = |k| {
                    let distance = exposure.falling(k) - counts_from;
                    -timing.removal - ROUNDING <= distance && distance <= timing.recovery + ROUNDING
                };
                if near(first) || near(first - 1) {
                    return Window::Race("a CLK edge meets the end of the reset pulse");
                }
                let local_stop = exposure.falling(first + start as i64) + timing.ripple();
                (local_stop, local_stop + timing.local_stop_to_strobe)
            }
        };
        if self.mode == Mode::Guided {
            let margin = end + timing.stop_to_hit_reset - timing.strobe_to_hit - arrival;
            if margin < -ROUNDING {
                return Window::Never;
            }
            if margin <= ROUNDING {
                return Window::Race("the strobe meets the next laser cycle's reset");
            }
        }
        let last = exposure.rising_until(arrival - timing.clk_to_shift);
        let after = arrival - (exposure.rising(last) + timing.clk_to_shift);
        let before = exposure.rising(last + 1) + timing.clk_to_shift - arrival;
        let slack = (after - timing.setup).min(before - timing.hold);
        if slack <= ROUNDING {
            return Window::Race("the strobe meets a change of the shift register");
        }
        Window::Open(OpenWindow {
            first_edge: last - self.bins,
            strobe_cause: cause,
            slack,
        })
    }

    /// Photon times that `bin` of `window` collects in laser cycle `cycle`, half open, from the exposure's
    /// first STOP edge.
    pub fn bin_interval(&self, window: &OpenWindow, cycle: i64, bin: i64) -> Range<Time> {
        let one = Time::from_fs(1);
        let edge = cycle * self.exposure.stop_periods as i64 + window.first_edge + bin;
        let taken_until = |edge| self.exposure.rising(edge) - self.timing.spad_to_toggle + one;
        taken_until(edge - 1)..taken_until(edge)
    }

    /// Photon times that the whole window collects, relative to its laser cycle's STOP edge.
    pub fn interval(&self, window: &OpenWindow) -> Range<Time> {
        self.bin_interval(window, 0, 0).start..self.bin_interval(window, 0, self.bins - 1).end
    }

    /// Photon time of a position in the histogram (bin b's centre is b), relative to STOP.
    pub fn time_of(&self, window: &OpenWindow, position_bins: f64) -> Time {
        let first = self.bin_interval(window, 0, 0);
        let centre = (first.start.as_fs() + first.end.as_fs()) as f64 / 2.0;
        let bin_fs = 1e15 / self.exposure.clock.as_hz();
        Time::from_fs((centre + position_bins * bin_fs).round() as i64)
    }

    /// The start value whose window is centred nearest to photon time `time` after STOP, or `None` where no
    /// start value opens a window that contains it.
    pub fn start_for(&self, time: Time) -> Option<u16> {
        let distance = |start: u16| {
            let interval = self.interval(&self.window(start).open()?);
            let centre = Time::from_fs((interval.start.as_fs() + interval.end.as_fs()) / 2);
            Some((centre - time).as_fs().abs())
        };
        let period_s = 1.0 / self.exposure.clock.as_hz();
        let centre = self.interval(&self.window(0).open()?);
        let centre_s = (centre.start.as_s() + centre.end.as_s()) / 2.0;
        let guess = ((time.as_s() - centre_s) / period_s).round();
        let guess = guess.clamp(0.0, self.largest_start as f64) as u16;
        let candidates = guess.saturating_sub(1)..=(guess + 1).min(self.largest_start);
        let best = candidates
            .filter_map(|start| Some((distance(start)?, start)))
            .min()?
            .1;
        let window = self.window(best).open()?;
        self.interval(&window).contains(&time).then_some(best)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
