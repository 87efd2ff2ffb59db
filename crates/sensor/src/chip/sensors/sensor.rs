//! A sensor as a value: its description, what it is made of, and what has been measured of it.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use crate::chip::config::{SensorConfig, Tdc};
use crate::chip::sensor_file::SensorFault;
use crate::chip::timing::clk_skew::clk_skew;
use crate::chip::timing::delay_lines::{DelayLines, Taps};
use crate::chip::timing::measure::MeasuredDelays;
use crate::chip::timing::silicon::Silicon;
use crate::chip::timing::{ChipTiming, LocalStopDelays};
use crate::units::Time;

/// A sensor that is possible, and what it is made of. Copies share their contents; the fields of its [`SensorConfig`] are
/// read as its own.
#[derive(Debug, Clone)]
pub struct Sensor(Arc<Parts>);

#[derive(Debug)]
struct Parts {
    config: SensorConfig,
    silicon: Silicon,
    delays: OnceLock<MeasuredDelays>,
    delay_lines: OnceLock<Arc<DelayLines>>,
    clk_skews: OnceLock<Box<[Time]>>,
    alike: OnceLock<Sensor>,
}

impl Sensor {
    /// A sensor of this description, made of the library in its corner.
    ///
    /// # Errors
    /// What [`SensorConfig::check`] finds.
    pub fn new(config: SensorConfig) -> Result<Self, SensorFault> {
        config.check()?;
        Ok(config.into())
    }

    /// The same sensor made of other silicon: other conditions, mismatch of its cells.
    pub fn made_of(&self, silicon: &Silicon) -> Self {
        Self::from_parts(self.0.config.clone(), *silicon)
    }

    /// What it is made of.
    pub fn silicon(&self) -> &Silicon {
        &self.0.silicon
    }

    /// Delays of macropixel (0, 0), measured once. Where cells have mismatch, others have others.
    pub fn timing(&self) -> &ChipTiming {
        &self.delays().timing
    }

    /// When LOCAL_STOP of macropixel (0, 0) rises, for each start value.
    pub fn local_stop_delays(&self) -> &Arc<LocalStopDelays> {
        &self.delays().local_stop
    }

    fn delays(&self) -> &MeasuredDelays {
        let Parts {
            config,
            silicon,
            delays,
            ..
        } = &*self.0;
        delays.get_or_init(|| {
            if *silicon == Silicon::new(config) {
                MeasuredDelays::cached(config)
            } else {
                MeasuredDelays::measure(config, silicon)
            }
        })
    }

    /// Taps of a macropixel's delay lines, by its number in the array, row-major; `None` where it has none.
    pub(in crate::chip) fn taps(&self, number: usize) -> Option<Taps> {
        let Parts {
            config,
            silicon,
            delay_lines,
            ..
        } = &*self.0;
        (config.tdc == Tdc::DelayLine).then(|| {
            let lines = delay_lines.get_or_init(|| DelayLines::measured(config, silicon));
            lines.taps(number)
        })
    }

    /// Longer than the delay lines of any macropixel: twice the average, for mismatch and the slow corner. Nothing where there are
    /// none.
    pub fn longest_delay_line(&self) -> Time {
        let typical = self.delay_element() * (2 * self.bins as i64);
        match self.tdc {
            Tdc::Clocked | Tdc::Counter => Time::ZERO,
            Tdc::DelayLine => Time::from_s(typical.as_s() * self.silicon().factor.max(1.0)),
        }
    }

    /// By how much CLK, STOP and RUN come later to a column of macropixels than to column 0: what its wires take in this silicon.
    pub fn clk_skew(&self, col: usize) -> Time {
        let Parts {
            config,
            silicon,
            clk_skews,
            ..
        } = &*self.0;
        if config.clk_skew_ps == 0.0 {
            return Time::ZERO;
        }
        let of_column = |col| clk_skew(config, silicon, col);
        let known = clk_skews.get_or_init(|| (0..config.cols).map(of_column).collect());
        known.get(col).copied().unwrap_or_else(|| of_column(col))
    }

    /// Whether macropixels differ by description: each has delay lines of its own, or CLK comes later to some. One window law
    /// does not describe them all then ([`WindowLaw::of_macropixel`](crate::chip::WindowLaw::of_macropixel)).
    pub fn has_own_laws(&self) -> bool {
        self.tdc == Tdc::DelayLine || self.clk_skew_ps > 0.0
    }

    /// This sensor of the library's own silicon with delay lines whose elements are all alike, and a CLK that comes everywhere at once:
    /// what is assumed of one that has not been calibrated. A copy, where it is such a sensor.
    #[must_use]
    pub fn alike(&self) -> Self {
        let config = SensorConfig {
            delay_sigma: 0.0,
            clk_skew_ps: 0.0,
            ..self.0.config.clone()
        };
        let silicon = Silicon::new(&config);
        let is_alike = config == self.0.config || !self.has_own_laws();
        if is_alike && silicon == self.0.silicon {
            return self.clone();
        }
        let alike = || Self::from_parts(config, silicon);
        self.0.alike.get_or_init(alike).clone()
    }

    fn from_parts(config: SensorConfig, silicon: Silicon) -> Self {
        Sensor(Arc::new(Parts {
            config,
            silicon,
            delays: OnceLock::new(),
            delay_lines: OnceLock::new(),
            clk_skews: OnceLock::new(),
            alike: OnceLock::new(),
        }))
    }
}

impl Deref for Sensor {
    type Target = SensorConfig;

    fn deref(&self) -> &SensorConfig {
        &self.0.config
    }
}

/// Sensors are equal if they are described alike and made of the same.
impl PartialEq for Sensor {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
            || self.0.config == other.0.config && self.0.silicon == other.0.silicon
    }
}

impl From<SensorConfig> for Sensor {
    /// A sensor of this description, made of the library in its corner. The description must have passed
    /// [`SensorConfig::check`].
    fn from(config: SensorConfig) -> Self {
        let silicon = Silicon::new(&config);
        Self::from_parts(config, silicon)
    }
}

impl From<&SensorConfig> for Sensor {
    /// As from the [`SensorConfig`] itself.
    fn from(config: &SensorConfig) -> Self {
        config.clone().into()
    }
}

impl From<&Sensor> for Sensor {
    /// A copy, which shares its contents.
    fn from(sensor: &Sensor) -> Self {
        sensor.clone()
    }
}
