//! Front ends: from the pulses of a macropixel's SPADs to SPAD_TIMED (thesis 2.4.1, Fig. 22; 4.2, Fig. 47).
//!
//! [`FrontEnd`] lists them. The chip's own is the first. The others join all SPADs on one wire, whose edges are counted asynchronously in the
//! figure; here CLK samples them as it does a SPAD of the first (`summation::retiming`), so that the METDC can shift
//! what they give, and the correlation block gets one line.

mod pulse_limits;
mod pulse_shaper;
mod variant;
pub(in crate::chip) mod variants;

use std::sync::Arc;

use crate::chip::config::{FrontEnd, SensorConfig};
use crate::chip::timing::chip_timing::ChipTiming;
use crate::netlist::Module;
use crate::photon::count_bits;
use crate::units::Time;

pub use pulse_limits::{DeadTimeTooShort, PulseLimits};
pub use variant::FrontEndVariant;
use variants::coincidence::Wire;
pub use variants::summation;
pub(crate) use variants::summation::TOGGLE;
pub(super) use variants::xor_tree;

impl FrontEnd {
    /// What other files ask of it.
    pub(crate) fn row(self) -> &'static FrontEndVariant {
        const ROWS: [&FrontEndVariant; FrontEnd::ALL.len()] = variants::rows!();
        ROWS[self as usize]
    }

    /// Whether all SPADs share one line, whose edges depend on more than one SPAD.
    pub fn joins(self) -> bool {
        self.row().joins
    }
}

impl SensorConfig {
    /// Lines of SPAD_TIMED, which the correlation block counts: one a SPAD, or one for all.
    pub fn lines(&self) -> usize {
        if !self.front_end.joins() {
            self.spads()
        } else {
            1
        }
    }

    /// SPADs that must fire together to raise a line of SPAD_TIMED.
    pub(crate) fn spads_of_an_event(&self) -> usize {
        (self.front_end.row().together)(self)
    }

    /// Bits of THRESHOLD.
    pub(crate) fn threshold_bits(&self) -> usize {
        count_bits(self.lines())
    }
}

/// The front end of this sensor.
///
/// Ports: SPAD_RAW\<SPADs\>, CLK, PIXEL_CLEAR → SPAD_TIMED\<lines\>.
pub fn circuit(config: &SensorConfig) -> Arc<Module> {
    (config.front_end.row().circuit)(config)
}

/// Reference model of any front end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrontEndModel {
    kind: FrontEnd,
    wire: Wire,
    retiming: summation::SummationModel,
}

impl FrontEndModel {
    /// The front end of a sensor with these delays.
    pub fn new(config: &SensorConfig, timing: &ChipTiming) -> Self {
        let together = config.spads_of_an_event();
        FrontEndModel {
            kind: config.front_end,
            wire: Wire::new(together, timing.pulses.shaped.unwrap_or_default()),
            retiming: summation::SummationModel::default(),
        }
    }

    /// A pulse of one SPAD; pulses come in the order of time.
    pub fn pulse(&mut self, time: Time, spad: u8) {
        let FrontEndVariant { joins, shapes, .. } = *self.kind.row();
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
