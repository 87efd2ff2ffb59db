//! The frame on which speed is stated: 8 Mcounts/s of background and a tenth of a signal photon per laser cycle on
//! every macropixel, windows spread over the whole range, the echo in the middle of each.

use crate::chip::{Exposure, SensorConfig};
use crate::engine::{Engine, EngineError, Exposed, LitPixel, expose, stream_config};
use crate::photon::{PhotonStream, PixelLight};
use crate::units::Time;

/// Laser cycles of the published exposure: 80 kHz for 200 ms (thesis 6.4).
pub const SPEED_LASER_CYCLES: u32 = 16_000;

/// A frame's chip, clocks and light.
#[derive(Debug, Clone)]
pub struct SpeedFrame {
    /// The default sensor, of another size.
    pub config: SensorConfig,
    /// Its exposure.
    pub exposure: Exposure,
    /// The photons.
    pub stream: PhotonStream,
    /// Every macropixel.
    pub pixels: Vec<LitPixel>,
}

impl SpeedFrame {
    /// A frame of `side` × `side` macropixels, at least 1, and laser cycles of `stop_periods` CLK periods, at least
    /// 520: at 384 MHz, 4800 are 80 kHz.
    pub fn new(side: usize, stop_periods: u32, laser_cycles: u32) -> Self {
        let config = SensorConfig {
            rows: side,
            cols: side,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&config, stop_periods, laser_cycles);
        let stream = stream_config(&config, &exposure, 1, Time::from_ps(1_900));
        let starts = u32::from(config.largest_start()) + 1;
        let pixels = (0..config.pixels() as u32).map(|number| {
            // An odd factor reaches every start value.
            let start = number.wrapping_mul(197) % starts;
            let middle = i64::from(start) - config.bins as i64 / 2;
            LitPixel {
                number,
                start: start as u16,
                light: Some(PixelLight {
                    signal_per_cycle: 0.1,
                    arrival: exposure.clock.periods(middle),
                    background_hz: 8e6,
                }),
            }
        });
        SpeedFrame {
            pixels: pixels.collect(),
            stream: PhotonStream::new(&stream),
            config,
            exposure,
        }
    }

    /// Exposes the frame on rayon's threads.
    ///
    /// # Errors
    /// As [`expose`].
    pub fn expose(&self, engine: &dyn Engine) -> Result<Exposed, EngineError> {
        expose(engine, &self.stream, &self.pixels, |_| ())
    }
}
