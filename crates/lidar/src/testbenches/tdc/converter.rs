//! The size of the converters, their time, and one made with its mismatch.

use std::sync::Arc;

use crate::netlist::{Corner, Mismatch, Module, varied};
use crate::testbenches::rig::Rig;
use crate::units::Time;

/// Codes of each converter, those at the ends among them.
pub(super) const CODES: usize = 32;
/// Bits of the counters.
pub(super) const BITS: usize = 6;
/// Stages of a ring: a period of 1 ns.
pub(super) const STAGES: usize = 25;
/// Mismatch of an inverter; a buffer has 14 %, between the two of the thesis's delay line (15 %, 6.3.1) and none.
pub(super) const SIGMA: f64 = 0.2;
/// From a conversion's begin to its TDC_RESET's end, and to START where that is common.
pub(super) const CLEARED: Time = Time::from_ns(2);
pub(super) const BEGIN: Time = Time::from_ns(4);

/// A converter whose delays have a mismatch of `sigma`.
pub(super) fn build(module: &Arc<Module>, sigma: f64, seed: u64) -> Rig {
    let Rig { netlist, timing } = Rig::new(module, Corner::Typ);
    let mismatch = Mismatch { sigma, seed };
    let timing = varied(&netlist, &timing, 1.0, Some(mismatch));
    Rig { netlist, timing }
}
