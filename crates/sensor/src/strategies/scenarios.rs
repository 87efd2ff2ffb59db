//! A sensor and everything that happens to it in an exposure, and what its gates do then.
//!
//! All parts are drawn independently and put together at the end: what is shrunk in one of them leaves the others as they are.

use std::fmt;
use std::ops::RangeInclusive;

use proptest::collection::vec;
use proptest::prelude::*;

use super::exposures::{last_start, lengths};
use super::photons::{Photons, pulses_of};
use crate::chip::{Exposure, Probe, SensorConfig, WindowLaw};
use crate::engine::GateSimulation;
use crate::kernel::Recorder;
use crate::photon::SpadEvent;
use crate::units::Time;

/// A sensor and everything that happens to it.
#[derive(Clone, PartialEq)]
pub struct Scenario {
    /// The chip.
    pub config: SensorConfig,
    /// Its clocks.
    pub exposure: Exposure,
    /// Start values, row-major.
    pub starts: Vec<u16>,
    /// Rising edges of SPAD_RAW per macropixel, row-major.
    pub pulses: Vec<Vec<SpadEvent>>,
}

/// What is drawn for a macropixel: which part of all start values lies below its own, in 2⁻¹⁶, and its photons.
type DrawnPixel = (u16, Vec<Photons>);

fn drawn_pixels(
    photons: impl Strategy<Value = Vec<Photons>> + Clone,
    pixels: RangeInclusive<usize>,
) -> impl Strategy<Value = Vec<DrawnPixel>> + Clone {
    vec((any::<u16>(), photons), pixels)
}

/// Scenarios of arrays of these sensors and photons, with numbers of rows and columns from these ranges. Start values reach one whose window never opens.
///
/// Shrinks towards one short laser cycle, then a simple sensor, then few macropixels with low start values and few photons.
///
/// # Panics
/// If there are no rows or columns.
pub fn scenarios(
    sensors: impl Strategy<Value = SensorConfig> + Clone,
    photons: impl Strategy<Value = Vec<Photons>> + Clone,
    rows: RangeInclusive<usize>,
    cols: RangeInclusive<usize>,
) -> impl Strategy<Value = Scenario> + Clone {
    let (least_cols, most_cols) = cols.into_inner();
    let pixels = rows.start() * least_cols..=rows.end() * most_cols;
    let parts = (lengths(), sensors, rows, drawn_pixels(photons, pixels));
    parts.prop_map(move |(length, config, rows, pixels)| {
        // Any macropixel may be left out: what remains makes rows as long as it can.
        let rows = rows.min(pixels.len() / least_cols);
        let cols = most_cols.min(pixels.len() / rows);
        let config = SensorConfig {
            rows,
            cols,
            ..config
        };
        let exposure = length.exposure(&config);
        Scenario::put_together(config, exposure, &pixels)
    })
}

/// Scenarios of a sensor in an exposure.
///
/// The sensor must have passed [`SensorConfig::check`].
pub fn scenarios_of(
    config: SensorConfig,
    exposure: Exposure,
    photons: impl Strategy<Value = Vec<Photons>> + Clone,
) -> impl Strategy<Value = Scenario> + Clone {
    let pixels = drawn_pixels(photons, config.pixels()..=config.pixels());
    pixels.prop_map(move |pixels| Scenario::put_together(config.clone(), exposure, &pixels))
}

impl Scenario {
    fn put_together(config: SensorConfig, exposure: Exposure, pixels: &[DrawnPixel]) -> Self {
        let most = last_start(&config, &exposure);
        let drawn = pixels.iter().take(config.pixels());
        let (starts, pulses) = (0..)
            .zip(drawn)
            .map(|(number, (share, photons))| {
                // Smaller shares are smaller start values, so that they shrink to the least one that fails.
                let start = (u32::from(*share) * (u32::from(most) + 1)) >> 16;
                let start = start as u16;
                let pulses = pulses_of(photons, &config, &exposure, (number, start));
                (start, pulses)
            })
            .unzip();
        Scenario {
            config,
            exposure,
            starts,
            pulses,
        }
    }

    /// The pulses as the engines take them.
    pub fn pulses(&self) -> Vec<&[SpadEvent]> {
        self.pulses.iter().map(Vec::as_slice).collect()
    }

    /// The window law of its sensor and exposure.
    pub fn law(&self) -> WindowLaw {
        WindowLaw::new(&self.config, &self.exposure)
    }

    /// What the P-counters' memories hold after the load, if they have any.
    pub fn loaded(&self) -> Vec<Option<u16>> {
        let has_memory = self.config.p_counter.row().has_memory;
        let loaded = |&start| has_memory.then_some(start);
        self.starts.iter().map(loaded).collect()
    }

    /// The whole array on the gates, its wires included, not yet run.
    pub fn simulation(&self) -> GateSimulation {
        let size = (self.config.rows, self.config.cols);
        let (starts, pulses) = (&self.starts, self.pulses());
        GateSimulation::new(&self.config, &self.exposure, (0, 0), size, starts, &pulses)
    }

    /// When a net of each macropixel rises on the gates, counted from the first rising edge of STOP, row-major. What comes before that edge
    /// is left out.
    ///
    /// # Panics
    /// If the sensor's blocks have no such net.
    pub fn rising_edges(&self, probe: Probe) -> Vec<Vec<Time>> {
        let mut simulation = self.simulation();
        let nets = simulation.probes().iter().map(|probes| probes.net(probe));
        let nets: Vec<_> = nets.collect();
        let mut recorder = Recorder::new(nets.clone());
        let origin = simulation.schedule().origin;
        simulation.run(&mut recorder);
        let edges = nets.into_iter().map(|net| {
            let edges = recorder.rising_edges(net).into_iter();
            let edges = edges.map(|time| time - origin);
            edges.filter(|&time| time >= Time::ZERO).collect()
        });
        edges.collect()
    }
}

impl fmt::Debug for Scenario {
    /// Keys that differ from the QuantIC4x4's, clocks, and a line for each macropixel.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let table = |config: &SensorConfig| toml::Table::try_from(config).map_err(|_| fmt::Error);
        let usual = table(&SensorConfig::default())?;
        let own = table(&self.config)?.into_iter();
        let differs = own.filter(|(key, value)| usual.get(key) != Some(value));
        let keys: Vec<String> = differs
            .map(|(key, value)| format!("{key} = {value}"))
            .collect();
        let Exposure {
            stop_periods,
            laser_cycles,
            ..
        } = self.exposure;
        writeln!(f, "sensor: {}", keys.join(", "))?;
        write!(
            f,
            "exposure: {laser_cycles} laser cycles of {stop_periods} CLK periods"
        )?;
        for (number, (start, pulses)) in self.starts.iter().zip(&self.pulses).enumerate() {
            let pulses = pulses
                .iter()
                .map(|SpadEvent { time, spad }| format!("{} fs on SPAD {spad}", time.as_fs()));
            let pulses: Vec<String> = pulses.collect();
            let (row, col) = (number / self.config.cols, number % self.config.cols);
            write!(
                f,
                "\nmacropixel ({row}, {col}): start value {start}, {} pulses: {}",
                pulses.len(),
                pulses.join(", ")
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategies::{drawn, photons, sensors_of_every_engine};

    #[test]
    fn scenarios_fill_their_array() {
        let mut sizes = std::collections::BTreeSet::new();
        for seed in 0..60 {
            let cases = scenarios(sensors_of_every_engine(&[]), photons(20), 1..=2, 1..=3);
            let scenario = drawn(seed, &cases);
            let Scenario { config, .. } = &scenario;
            sizes.insert((config.rows, config.cols));
            assert_eq!(scenario.starts.len(), config.pixels());
            assert_eq!(scenario.pulses.len(), config.pixels());
            let largest = config.largest_start();
            assert!(scenario.starts.iter().all(|&start| start <= largest));
            assert!(scenario.pulses.iter().all(|pulses| pulses.is_sorted()));
        }
        assert_eq!(sizes.len(), 6);
    }

    #[test]
    fn a_scenario_is_printed_by_what_is_special_about_it() {
        let config = SensorConfig {
            rows: 1,
            cols: 1,
            bins: 4,
            ..SensorConfig::default()
        };
        let scenario = Scenario {
            exposure: Exposure::new(&config, 40, 2),
            config,
            starts: vec![7],
            pulses: vec![vec![SpadEvent::new(Time::from_ps(3), 5)]],
        };
        assert_eq!(
            format!("{scenario:?}"),
            "sensor: bins = 4, cols = 1, rows = 1\n\
             exposure: 2 laser cycles of 40 CLK periods\n\
             macropixel (0, 0): start value 7, 1 pulses: 3000 fs on SPAD 5"
        );
    }
}
