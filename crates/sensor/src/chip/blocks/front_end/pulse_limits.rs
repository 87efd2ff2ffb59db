//! What a front end asks of the pulses it is given: how long they must be, and how far apart.

use crate::chip::SensorConfig;
use crate::units::Time;

/// What toggle flip-flops or pulse shapers ask of SPAD_RAW. What lies between the end of one pulse and the next one is
/// chance, and left to the timing checks of the gate engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PulseLimits {
    /// Shortest pulse.
    pub width: Time,
    /// Shortest time from one rise to the next: clk-to-Q and setup, or what a pulse shaper takes to be ready again.
    pub apart: Time,
    /// Width of a shaped pulse, where there are pulse shapers: SPAD_RAW must outlast it.
    pub shaped: Option<Time>,
}

impl PulseLimits {
    /// The shortest dead time that keeps both.
    pub fn shortest(&self) -> Time {
        self.width.max(self.apart)
    }

    /// Whether the flip-flops follow the pulses of a sensor.
    ///
    /// # Errors
    /// When they are shorter than the flip-flops ask for.
    pub(crate) fn follow(&self, sensor: &SensorConfig) -> Result<(), DeadTimeTooShort> {
        if sensor.pulse_width() >= self.shortest() {
            return Ok(());
        }
        Err(DeadTimeTooShort {
            dead_time_ns: sensor.dead_time_ns,
            pulse_width: sensor.pulse_width(),
            limits: *self,
        })
    }
}

/// A dead time that the front end's flip-flops cannot follow.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "dead_time_ns = {dead_time_ns} is shorter than the front end follows, whose {} takes pulses of at least {} and no two closer than {} ({}){}",
    if limits.shaped.is_some() { "pulse shaper" } else { "toggle flip-flop" },
    limits.width,
    limits.apart,
    if limits.shaped.is_some() { "the shaped pulse and its recovery" } else { "clk-to-Q and setup" },
    self.of_spread(),
)]
pub struct DeadTimeTooShort {
    /// The dead time, ns.
    pub dead_time_ns: f64,
    /// The shortest dead time of the array, which is the pulses' width.
    pub pulse_width: Time,
    /// What the flip-flops ask for.
    pub limits: PulseLimits,
}

impl DeadTimeTooShort {
    /// The shortest mean dead time that the flip-flops follow, ns, rounded up to a tenth of a picosecond.
    pub(crate) fn at_least_ns(&self) -> f64 {
        // A spread keeps its share of the mean.
        let scale = self.dead_time_ns / self.pulse_width.as_ns();
        let scale = if self.has_spread() { scale } else { 1.0 };
        (self.limits.shortest().as_ns() * scale * 1e4).ceil() * 1e-4
    }

    fn has_spread(&self) -> bool {
        self.pulse_width != Time::from_s(self.dead_time_ns * 1e-9)
    }

    fn of_spread(&self) -> String {
        if self.has_spread() {
            let width = self.pulse_width;
            format!("; with dead_time_spread the shortest dead time is {width}")
        } else {
            String::new()
        }
    }

    /// The dead time in nanoseconds that was probably meant: those of SPADs are some nanoseconds, and this one would be in
    /// another unit.
    pub(crate) fn probably_meant_ns(&self) -> Option<f64> {
        let meant = [1e3, 1e6, 1e9].map(|factor| (self.dead_time_ns * factor * 1e6).round() * 1e-6);
        meant.into_iter().find(|ns| (0.5..500.0).contains(ns))
    }

    /// What to give instead.
    pub fn cure(&self) -> String {
        let meant = self.probably_meant_ns();
        let meant = meant.map_or(String::new(), |ns| format!("; did you mean {ns} (ns)?"));
        format!("give at least {:.4}{meant}", self.at_least_ns())
    }
}
