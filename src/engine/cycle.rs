//! The cycle engine: every CLK period of the exposure, through the blocks' reference models.

use super::{Engine, EngineError};
use crate::chip::macropixel::Model;
use crate::chip::window_law::{Window, WindowLaw};
use crate::chip::{Exposure, SensorConfig};
use crate::photon::SpadEvent;

/// Steps a macropixel's reference model through every CLK period.
pub struct Cycle<'a> {
    model: Model<'a>,
    law: WindowLaw,
}

impl<'a> Cycle<'a> {
    /// An engine for this sensor and exposure.
    pub fn new(config: &'a SensorConfig, exposure: &'a Exposure) -> Self {
        Cycle {
            model: Model::new(config, exposure),
            law: WindowLaw::new(config, exposure),
        }
    }
}

impl Engine for Cycle<'_> {
    fn histogram(&self, start: u16, pulses: &[SpadEvent]) -> Result<Vec<u16>, EngineError> {
        if let Window::Race(why) = self.law.window(start) {
            return Err(EngineError::Race(why));
        }
        let pulses = pulses.iter().map(|p| (p.time, p.spad));
        Ok(self.model.histogram(start, pulses))
    }
}
