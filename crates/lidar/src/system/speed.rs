//! The frames on which speed is stated: a typical one, and the worst cases of the engines.

use serde::{Deserialize, Serialize};

use crate::chip::{Exposure, Sensor, SensorConfig};
use crate::engine::{EngineError, Expose, ExposureResult, LitPixel, expose, stream_config};
use crate::photon::{PhotonStream, PixelLight, SpadEvent};
use crate::units::Time;

/// Laser cycles of the published exposure: 80 kHz for 200 ms (thesis 6.4).
pub const SPEED_LASER_CYCLES: u32 = 16_000;

/// What the macropixels of a frame see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SpeedCase {
    /// 8 Mcounts/s of background and a tenth of a signal photon per laser cycle on every macropixel, windows spread over
    /// the whole range, the echo in the middle of each.
    Street,
    /// The same, STOP every 40 CLK periods: windows are open nearly half of the time, and nothing is at rest for long.
    ShortStop,
    /// The same, with 100 Mcounts/s of background on every SPAD: each fires as often as its dead time lets it.
    Bright,
    /// Every SPAD fires once in every CLK period: recorded pulses, no light gives them.
    EverySpadEveryClk,
}

/// STOP period of [`SpeedCase::ShortStop`], CLK periods.
const SHORT_STOP_PERIODS: u32 = 40;

/// A frame's chip, clocks and light.
#[derive(Debug, Clone)]
pub struct SpeedFrame {
    /// The default sensor, of another size.
    pub sensor: Sensor,
    /// Its exposure.
    pub exposure: Exposure,
    /// The photons.
    pub stream: PhotonStream,
    /// Every macropixel.
    pub pixels: Vec<LitPixel>,
    case: SpeedCase,
}

impl SpeedFrame {
    /// A frame of `rows` × `cols` macropixels, at least 1, and laser cycles of `stop_periods` CLK periods, at least
    /// 520: at 384 MHz, 4800 are 80 kHz. [`SpeedCase::ShortStop`] has its own.
    pub fn new(
        case: SpeedCase,
        (rows, cols): (usize, usize),
        stop_periods: u32,
        laser_cycles: u32,
    ) -> Self {
        let mut config = SensorConfig {
            rows,
            cols,
            ..SensorConfig::default()
        };
        if case == SpeedCase::EverySpadEveryClk {
            // Below the CLK period of 2.6 ns, or pulses would cancel in the front end.
            config.dead_time_ns = 2.0;
        }
        let sensor = Sensor::from(config);
        let stop_periods = match case {
            SpeedCase::ShortStop => SHORT_STOP_PERIODS,
            _ => stop_periods,
        };
        let background_hz = match case {
            SpeedCase::Bright => 100e6 * sensor.spads() as f64,
            _ => 8e6,
        };
        let exposure = Exposure::new(&sensor, stop_periods, laser_cycles);
        let stream = stream_config(&sensor, &exposure, 1, Time::from_ps(1_900));
        // A start value that the laser cycle is too short for never opens a window.
        let starts = (u32::from(sensor.largest_start()) + 1).min(stop_periods - 2);
        let pixels = (0..sensor.pixels() as u32).map(|number| {
            // An odd factor reaches every start value.
            let start = number.wrapping_mul(197) % starts;
            let middle = i64::from(start) - sensor.bins as i64 / 2;
            LitPixel {
                number,
                start: start as u16,
                light: Some(
                    PixelLight::echo(
                        0.1,
                        exposure
                            .clock
                            .periods(middle.rem_euclid(i64::from(stop_periods))),
                    )
                    .with_background(background_hz),
                ),
            }
        });
        SpeedFrame {
            pixels: pixels.collect(),
            stream: PhotonStream::new(&stream),
            sensor,
            exposure,
            case,
        }
    }

    /// Start values, in the macropixels' order.
    pub fn starts(&self) -> Vec<u16> {
        self.pixels.iter().map(|pixel| pixel.start).collect()
    }

    /// Every pulse of every macropixel: those of [`SpeedFrame::expose`], but for [`SpeedCase::EverySpadEveryClk`].
    pub fn pulses(&self) -> Vec<Vec<SpadEvent>> {
        if self.case == SpeedCase::EverySpadEveryClk {
            return vec![self.every_spad_every_clk(); self.pixels.len()];
        }
        let lit = self
            .pixels
            .iter()
            .filter_map(|p| Some((p, p.light.as_ref()?)));
        lit.map(|(pixel, light)| self.stream.pixel_events(pixel.number, light).events)
            .collect()
    }

    fn every_spad_every_clk(&self) -> Vec<SpadEvent> {
        let exposure = &self.exposure;
        let edges = i64::from(exposure.stop_periods) * i64::from(exposure.laser_cycles);
        // Pulses come with the falling CLK edge, far from the rising one that takes them.
        let times = (0..edges).map(|edge| exposure.falling(edge));
        let spads = 0..self.sensor.spads() as u8;
        times
            .flat_map(|time| spads.clone().map(move |spad| SpadEvent { time, spad }))
            .collect()
    }

    /// Exposes the frame on rayon's threads.
    ///
    /// # Errors
    /// As [`expose`].
    pub fn expose(&self, engine: &dyn Expose) -> Result<ExposureResult, EngineError> {
        expose(engine, &self.stream, &self.pixels, |_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{Cycle, Replay, Window};

    /// What is timed is one and the same exposure, however much of it is left out.
    #[test]
    fn every_way_that_is_timed_gives_the_same_histograms() {
        for case in [
            SpeedCase::Street,
            SpeedCase::ShortStop,
            SpeedCase::Bright,
            SpeedCase::EverySpadEveryClk,
        ] {
            let frame = SpeedFrame::new(case, (2, 13), 520, 8);
            let (sensor, exposure) = (&frame.sensor, &frame.exposure);
            let (starts, pulses) = (frame.starts(), frame.pulses());
            let pulses: Vec<&[SpadEvent]> = pulses.iter().map(Vec::as_slice).collect();
            let cycle = Cycle::new(sensor, exposure);
            let packed = cycle.pack(&starts, &pulses);
            let replayed = cycle.replay_packed(&starts, &packed).unwrap();
            let live = Cycle::new(sensor, exposure).with_live_control();
            assert_eq!(
                live.replay_packed(&starts, &packed).unwrap(),
                replayed,
                "{case:?}"
            );
            let window = Window::new(sensor, exposure);
            assert_eq!(
                window.histograms(&starts, &pulses).unwrap(),
                replayed,
                "{case:?}"
            );
            if case == SpeedCase::EverySpadEveryClk {
                // Every bin of every full window takes its hit in all but the first laser cycle.
                assert!(
                    replayed.iter().all(|counts| counts.iter().all(|&n| n >= 7)),
                    "{replayed:?}"
                );
            } else {
                assert_eq!(
                    frame.expose(&window).unwrap().histograms,
                    replayed,
                    "{case:?}"
                );
            }
        }
    }
}
