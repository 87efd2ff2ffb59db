//! What a front end is to other files, and the pins that all have.

use std::sync::Arc;

use crate::chip::config::SensorConfig;
use crate::netlist::{Module, ModuleBuilder, Net};

/// What other files ask of a front end.
#[derive(Debug)]
pub struct FrontEndVariant {
    /// Its circuit; ports as in [`super::circuit`].
    pub circuit: fn(&SensorConfig) -> Arc<Module>,
    /// Whether all SPADs share one line, whose edges depend on more than one SPAD. Only gates run such a front end.
    pub joins: bool,
    /// Whether a pulse shaper stands before that line.
    pub shapes: bool,
    /// SPADs that must fire together to raise a line.
    pub together: fn(&SensorConfig) -> usize,
}

/// Declares the inputs that every front end has; returns SPAD_RAW.
pub(super) fn pins(m: &mut ModuleBuilder, spads: usize) -> Vec<Net> {
    let raw = m.input_bus("SPAD_RAW", spads);
    m.input("CLK");
    m.input("PIXEL_CLEAR");
    raw
}
