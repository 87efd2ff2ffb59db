//! What a front end asks of the pulses it is given: how long they must be, and how far apart.

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

    /// Whether the flip-flops follow pulses of this dead time, ns.
    ///
    /// # Errors
    /// When it is shorter than they ask for.
    pub(crate) fn follow(&self, dead_time_ns: f64) -> Result<(), DeadTimeTooShort> {
        match dead_time_ns >= self.shortest().as_ns() {
            true => Ok(()),
            false => Err(DeadTimeTooShort {
                dead_time_ns,
                limits: *self,
            }),
        }
    }
}

/// A dead time that the front end's flip-flops cannot follow.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "dead_time_ns = {dead_time_ns} is shorter than the front end follows, whose {} takes pulses of at least {} and no two closer than {} ({})",
    if limits.shaped.is_some() { "pulse shaper" } else { "toggle flip-flop" },
    limits.width,
    limits.apart,
    if limits.shaped.is_some() { "the shaped pulse and its recovery" } else { "clk-to-Q and setup" },
)]
pub struct DeadTimeTooShort {
    /// The dead time, ns.
    pub dead_time_ns: f64,
    /// What the flip-flops ask for.
    pub limits: PulseLimits,
}

impl DeadTimeTooShort {
    /// The shortest dead time that the flip-flops follow, ns, rounded up to a tenth of a picosecond.
    pub(crate) fn at_least_ns(&self) -> f64 {
        (self.limits.shortest().as_ns() * 1e4).ceil() * 1e-4
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
