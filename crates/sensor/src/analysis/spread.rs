//! Ripple and margin of every macropixel of an array whose cells differ at random.

use rayon::prelude::*;

use super::MacropixelTiming;
use crate::chip::{Limits, SensorConfig, Silicon};
use crate::units::Time;

/// One macropixel of the array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelTiming {
    /// Row.
    pub row: usize,
    /// Column.
    pub col: usize,
    /// CLK falls → LOCAL_STOP rises.
    pub ripple: Time,
    /// What the CLK period leaves over at the tightest flip-flop, limits kept.
    pub slack: Time,
    /// Whether it counts into the right bins, limits kept.
    pub keeps_limits: bool,
    /// Whether it counts into the right bins, limits ignored.
    pub counts_right: bool,
}

/// All macropixels, row-major, and their statistics.
#[derive(Debug, Clone, PartialEq)]
pub struct Spread {
    /// Every macropixel.
    pub pixels: Vec<PixelTiming>,
    /// Mean ripple, s.
    pub mean_s: f64,
    /// Standard deviation of the ripple, s.
    pub sigma_s: f64,
}

impl Spread {
    /// The macropixel with the longest ripple.
    pub fn slowest(&self) -> PixelTiming {
        let slowest = self.pixels.iter().max_by_key(|p| p.ripple);
        *slowest.expect("a sensor has a macropixel")
    }

    /// The macropixel with the least slack.
    pub fn tightest(&self) -> PixelTiming {
        let tightest = self.pixels.iter().min_by_key(|p| p.slack);
        *tightest.expect("a sensor has a macropixel")
    }
}

/// Analyses every macropixel of the sensor at its CLK and STOP phase; `done` hears of each.
pub fn spread(config: &SensorConfig, silicon: &Silicon, done: impl Fn() + Sync) -> Spread {
    let (period, phase) = (config.clock().period(), config.stop_phase());
    // As the window law has it, which knows of the library's delays only.
    let library = Silicon::new(config);
    let library = MacropixelTiming::analyse(config, &library, Limits::Kept, (0, 0));
    let aim = library.aim(period, phase);
    let pixel = |index: usize| {
        let position = config.position(index);
        let kept = MacropixelTiming::analyse(config, silicon, Limits::Kept, position);
        let slack = kept.slack(period, phase, aim);
        let keeps_limits = slack >= Time::ZERO;
        let counts_right = keeps_limits || {
            let ignored = MacropixelTiming::analyse(config, silicon, Limits::Ignored, position);
            ignored.slack(period, phase, aim) >= Time::ZERO
        };
        done();
        PixelTiming {
            row: position.0,
            col: position.1,
            ripple: kept.ripple.delay(),
            slack,
            keeps_limits,
            counts_right,
        }
    };
    let pixels: Vec<PixelTiming> = (0..config.pixels()).into_par_iter().map(pixel).collect();
    let count = pixels.len() as f64;
    let mean_s = pixels.iter().map(|p| p.ripple.as_s()).sum::<f64>() / count;
    let squares = pixels.iter().map(|p| (p.ripple.as_s() - mean_s).powi(2));
    Spread {
        sigma_s: (squares.sum::<f64>() / count).sqrt(),
        mean_s,
        pixels,
    }
}
