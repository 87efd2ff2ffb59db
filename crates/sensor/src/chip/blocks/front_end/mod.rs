//! Front ends: from the pulses of a macropixel's SPADs to SPAD_TIMED (thesis 2.4.1, Fig. 22; 4.2, Fig. 47).
//!
//! [`FrontEnd`] lists them. The chip's own is the first. The others join all SPADs on one wire, whose edges are counted asynchronously in the
//! figure; here CLK samples them as it does a SPAD of the first (`summation::retiming`), so that the METDC can shift
//! what they give, and the correlation block gets one line.

pub mod coincidence;
pub mod or_tree;
pub mod pulse_shaper;
pub mod summation;
pub mod xor_tree;

use std::sync::Arc;

use crate::chip::config::SensorConfig;
use crate::chip::timing::ChipTiming;
use crate::netlist::{Module, ModuleBuilder, Net};
use crate::settings::words;
use crate::units::Time;

/// The instance that retimes the one wire of a front end that joins its SPADs.
pub(crate) const JOINED: &str = "joined";

words! {
    /// How the pulses of a macropixel's SPADs become SPAD_TIMED (thesis 2.4.1, Fig. 22).
    pub enum FrontEnd: Variant {
        /// A toggle flip-flop and two samplers for each SPAD, whose events the correlation block sums up (Fig. 22d). Two pulses
        /// of one SPAD in a CLK period are lost.
        Summation = "summation": summation::VARIANT,
        /// Pulse shapers and an OR tree (Fig. 22a). Pulses that overlap are lost, and two that are sampled together.
        OrTree = "or_tree": or_tree::VARIANT,
        /// Toggle flip-flops and an XOR tree (Fig. 22b). Two pulses in a CLK period are lost.
        XorTree = "xor_tree": xor_tree::VARIANT,
        /// Pulse shapers, and an event where `coincident_spads` SPADs fire within a shaped pulse (Fig. 22c). What
        /// does not coincide is lost.
        Coincidence = "coincidence": coincidence::VARIANT,
    }
}

/// What other files ask of a front end.
#[derive(Debug)]
pub struct Variant {
    /// Its circuit; ports as in [`circuit`].
    pub circuit: fn(&SensorConfig) -> Arc<Module>,
    /// Whether all SPADs share one line, whose edges depend on more than one SPAD. Only gates run such a front end.
    pub joins: bool,
    /// Whether a pulse shaper stands before that line.
    pub shapes: bool,
    /// SPADs that must fire together to raise a line.
    pub together: fn(&SensorConfig) -> usize,
}

impl FrontEnd {
    /// Whether all SPADs share one line, whose edges depend on more than one SPAD.
    pub fn joins(self) -> bool {
        self.row().joins
    }
}

/// The front end of this sensor.
///
/// Ports: SPAD_RAW\<SPADs\>, CLK, PIXEL_CLEAR → SPAD_TIMED\<lines\>.
pub fn circuit(config: &SensorConfig) -> Arc<Module> {
    (config.front_end.row().circuit)(config)
}

/// Declares the inputs that every front end has; returns SPAD_RAW.
fn pins(m: &mut ModuleBuilder, spads: usize) -> Vec<Net> {
    let raw = m.input_bus("SPAD_RAW", spads);
    m.input("CLK");
    m.input("PIXEL_CLEAR");
    raw
}

/// SPAD_TIMED of one line, from the rising edges of `joined`.
fn retime(m: &mut ModuleBuilder, joined: Net) {
    m.output_bus("SPAD_TIMED", 1);
    let retiming = summation::retiming();
    m.instance_by_names(JOINED, &retiming, &[("SPAD_RAW", &[joined])]);
}

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

/// Whether the cell at this dotted path is a front end's first sampling flip-flop. Its D follows SPADs, not CLK, so that
/// it breaks setup and hold by design; the second one gives it a period to make up its mind.
pub(crate) fn is_asynchronous_sampler(cell_path: &str) -> bool {
    let mut parts = cell_path.rsplit('.');
    parts.next() == Some("first")
        && parts
            .next()
            .is_some_and(|retiming| retiming.starts_with("spad_") || retiming == JOINED)
        && parts.next() == Some("front_end")
}

/// Reference model of any front end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Model {
    kind: FrontEnd,
    wire: coincidence::Wire,
    retiming: summation::Model,
}

impl Model {
    /// The front end of a sensor with these delays.
    pub fn new(config: &SensorConfig, timing: &ChipTiming) -> Self {
        let together = config.spads_of_an_event();
        Model {
            kind: config.front_end,
            wire: coincidence::Wire::new(together, timing.pulses.shaped.unwrap_or_default()),
            retiming: summation::Model::default(),
        }
    }

    /// A pulse of one SPAD; pulses come in the order of time.
    pub fn pulse(&mut self, time: Time, spad: u8) {
        let Variant { joins, shapes, .. } = *self.kind.row();
        if !joins {
            self.retiming.pulse(spad);
        } else if !shapes || self.wire.pulse(time) {
            self.retiming.pulse(0);
        }
    }

    /// A rising edge of CLK.
    pub fn clock(&mut self) {
        self.retiming.clock();
    }

    /// SPAD_TIMED, a bit for each line.
    pub fn spad_timed(&self) -> u64 {
        self.retiming.spad_timed()
    }
}
