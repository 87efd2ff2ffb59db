//! The window engine: only what a start value can see.
//!
//! The window law gives the rising CLK edges whose photons reach a bin. Each pulse is taken by one edge;
//! the pulses of one edge that lies in the window of some laser cycle are summed, compared and counted.
//! CLK periods without photons are never visited: what an empty period does is the same for all of them
//! and is added in one step.

use super::{Engine, EngineError};
use crate::chip::{Exposure, Mode, SensorConfig, WindowLaw, correlation, histogram, window_law};
use crate::photon::SpadEvent;
use crate::units::Time;

/// Counts through the window law.
pub struct Window<'a> {
    config: &'a SensorConfig,
    exposure: &'a Exposure,
    law: WindowLaw,
    period_fs: f64,
}

impl<'a> Window<'a> {
    /// An engine for this sensor and exposure.
    pub fn new(config: &'a SensorConfig, exposure: &'a Exposure) -> Self {
        Window {
            config,
            exposure,
            law: WindowLaw::new(config, exposure),
            period_fs: 1e15 / exposure.clock.as_hz(),
        }
    }

    /// The rising CLK edge that takes a pulse at `time`.
    fn edge_of(&self, time: Time) -> i64 {
        let sampled = time + self.law.timing().spad_to_toggle;
        let periods = (sampled + self.exposure.stop_phase).as_fs() as f64 / self.period_fs - 0.5;
        let edge = periods.ceil();
        // Exact arithmetic only where rounding could decide.
        if (edge - periods - 0.5).abs() < 0.499 {
            return edge as i64;
        }
        self.exposure.rising_until(sampled - Time::from_fs(1)) + 1
    }

    fn is_event(&self, spads: u16) -> bool {
        correlation::model(spads, self.config.event_type, self.config.threshold)
    }
}

impl Engine for Window<'_> {
    fn histogram(&self, start: u16, pulses: &[SpadEvent]) -> Result<Vec<u16>, EngineError> {
        let bins = self.config.bins as i64;
        let periods = self.exposure.stop_periods as i64;
        let cycles = self.exposure.laser_cycles as i64;
        let window = match self.law.window(start) {
            window_law::Window::Open(window) => window,
            window_law::Window::Never => return Ok(vec![0; self.config.bins]),
            window_law::Window::Irregular(why) => return Err(EngineError::Irregular(why)),
            window_law::Window::Race(why) => return Err(EngineError::Race(why)),
        };
        // A conventional cycle is latched by the STOP edge that ends it; the exposure's first STOP edge
        // ends one, too.
        let first_cycle = match self.config.mode {
            Mode::Guided => 0,
            Mode::Conventional => -1,
        };
        let empty_is_event = self.is_event(0);
        let mut hits: Vec<i64> = (0..bins)
            .map(|bin| {
                if !empty_is_event {
                    return 0;
                }
                // The pipeline starts empty: nothing before rising edge -1 was ever compared.
                let edge = window.first_edge + bin;
                let first_compared = (-1 - edge + periods - 1).div_euclid(periods);
                (cycles - first_compared.max(first_cycle)).max(0)
            })
            .collect();
        for (edge, spads) in Taken::new(pulses, |p| self.edge_of(p.time)) {
            let is_event = self.is_event(spads);
            if is_event == empty_is_event {
                continue;
            }
            let offset = edge - window.first_edge;
            let last_cycle = offset.div_euclid(periods).min(cycles - 1);
            // More than one laser cycle sees an edge only when a cycle is shorter than the window.
            for cycle in (first_cycle..=last_cycle).rev() {
                let bin = offset - cycle * periods;
                if bin >= bins {
                    break;
                }
                hits[bin as usize] += if is_event { 1 } else { -1 };
            }
        }
        let (bits, overflow) = (self.config.bin_bits as u32, self.config.overflow);
        Ok(hits
            .iter()
            .map(|&n| histogram::model(n as u64, bits, overflow))
            .collect())
    }
}

/// Pulses grouped by the edge that takes them: (edge, SPADs with an odd number of pulses).
struct Taken<'p, F> {
    pulses: std::iter::Peekable<std::slice::Iter<'p, SpadEvent>>,
    edge_of: F,
}

impl<'p, F: Fn(&SpadEvent) -> i64> Taken<'p, F> {
    fn new(pulses: &'p [SpadEvent], edge_of: F) -> Self {
        Taken {
            pulses: pulses.iter().peekable(),
            edge_of,
        }
    }
}

impl<F: Fn(&SpadEvent) -> i64> Iterator for Taken<'_, F> {
    type Item = (i64, u16);

    fn next(&mut self) -> Option<(i64, u16)> {
        let first = self.pulses.next()?;
        let edge = (self.edge_of)(first);
        let mut spads = 1 << first.spad;
        while let Some(pulse) = self.pulses.next_if(|p| (self.edge_of)(p) == edge) {
            spads ^= 1 << pulse.spad;
        }
        Some((edge, spads))
    }
}
