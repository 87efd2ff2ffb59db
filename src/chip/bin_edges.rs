//! From photon time to bin and back: the edges of every bin of a window, exact to the femtosecond.
//!
//! ```text
//!   rising CLK edges    e−1          e           e+1
//!                        │           │            │
//!   photon times   ─────╎───────────╎────────────╎─────      earlier by the front end's latency
//!                  edges(…)[b]   edges(…)[b+1]                bin b: [edges[b], edges[b + 1])
//! ```
//!
//! A pulse is taken by the first rising CLK edge at or after its toggle flip-flop has changed. Edges are given for each
//! laser cycle, because CLK edges are rounded to whole femtoseconds; nobody who asks for them needs to know that bins
//! are a CLK period long. Engines that bin many photons at once have copies of [`WindowLaw::edge_of`], held to it by tests.

use std::ops::Range;

use super::config::Mode;
use super::window_law::{OpenWindow, WindowLaw};
use crate::units::Time;

impl WindowLaw {
    /// Photon times at which the bins of `window` begin in laser cycle `cycle`, from the exposure's first STOP edge, and when
    /// the last one ends: bins + 1 of them.
    pub fn edges(&self, window: &OpenWindow, cycle: i64) -> impl Iterator<Item = Time> {
        let first = cycle * i64::from(self.exposure.stop_periods) + window.first_edge;
        (first - 1..first + self.bins).map(|edge| self.taken_until(edge))
    }

    /// The rising CLK edge that takes a SPAD pulse at `pulse` after the exposure's first STOP edge: the first one at or
    /// after the pulse has toggled its flip-flop.
    #[inline]
    pub fn edge_of(&self, pulse: Time) -> i64 {
        let sampled = pulse + self.timing.spad_to_toggle;
        let periods = (sampled + self.exposure.stop_phase).as_fs() as f64 / self.period_fs - 0.5;
        let edge = periods.ceil();
        // Exact arithmetic only where rounding could decide.
        if (edge - periods - 0.5).abs() < 0.499 {
            return edge as i64;
        }
        self.exposure.rising_until(sampled - Time::from_fs(1)) + 1
    }

    /// Whether a rising CLK edge, counted from the exposure's first STOP edge, takes photons for `window` in any laser
    /// cycle.
    pub fn collects(&self, window: &OpenWindow, edge: i64) -> bool {
        let (cycles, periods) = (self.exposure.laser_cycles, self.exposure.stop_periods);
        // A conventional cycle is latched by the STOP edge that ends it; the exposure's first one ends one, too.
        let first_cycle = match self.config.mode {
            Mode::Guided => 0,
            Mode::Conventional => -1,
        };
        let offset = edge - window.first_edge;
        let cycle = offset.div_euclid(periods.into()).min(i64::from(cycles) - 1);
        cycle >= first_cycle && offset - cycle * i64::from(periods) < self.bins
    }

    /// Photon times that `bin` of `window` collects in laser cycle `cycle`, half open, from the exposure's
    /// first STOP edge.
    pub fn bin_interval(&self, window: &OpenWindow, cycle: i64, bin: i64) -> Range<Time> {
        let edge = cycle * i64::from(self.exposure.stop_periods) + window.first_edge + bin;
        self.taken_until(edge - 1)..self.taken_until(edge)
    }

    /// Until when a rising CLK edge takes pulses.
    fn taken_until(&self, edge: i64) -> Time {
        self.exposure.rising(edge) - self.timing.spad_to_toggle + Time::from_fs(1)
    }

    /// How long before the exposure's first STOP edge the pulses begin that are taken together with one at that edge.
    pub fn lead(&self) -> Time {
        Time::ZERO - self.taken_until(self.edge_of(Time::ZERO) - 1)
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
        let opens = |start| Some((start, self.window(start).open()?));
        let (sample, window) = self.samples().into_iter().find_map(opens)?;
        let centre = self.interval(&window);
        let centre_s = (centre.start.as_s() + centre.end.as_s()) / 2.0;
        let guess = sample as f64 + ((time.as_s() - centre_s) / period_s).round();
        let largest = self.config.largest_start();
        let guess = guess.clamp(0.0, largest as f64) as u16;
        let candidates = guess.saturating_sub(1)..=(guess + 1).min(largest);
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
    use crate::chip::{Exposure, SensorConfig};
    use proptest::prelude::*;

    proptest! {
        /// Edges are where the bin of a photon changes: the last femtosecond before one belongs to the bin before it.
        #[test]
        fn a_photon_is_in_the_bin_between_whose_edges_it_comes(
            clk_mhz in 50f64..400.0,
            start in 0u16..512,
            cycle in 0i64..40,
            phase in -0.9f64..0.9,
        ) {
            let config = SensorConfig {
                clk_hz: clk_mhz * 1e6,
                stop_phase_ps: phase * 0.5e6 / clk_mhz,
                ..SensorConfig::default()
            };
            let exposure = Exposure::new(&config, 600, 40);
            let law = WindowLaw::new(&config, &exposure);
            let Some(window) = law.window(start).open() else {
                return Ok(());
            };
            let edges: Vec<Time> = law.edges(&window, cycle).collect();
            prop_assert_eq!(edges.len(), config.bins + 1);
            let first = cycle * 600 + window.first_edge;
            for (bin, &edge) in (0..).zip(&edges) {
                prop_assert_eq!(law.edge_of(edge) - first, bin);
                prop_assert_eq!(law.edge_of(edge - Time::from_fs(1)) - first, bin - 1);
            }
            for (bin, edges) in (0..).zip(edges.windows(2)) {
                prop_assert_eq!(law.bin_interval(&window, cycle, bin), edges[0]..edges[1]);
            }
        }
    }
}
