//! Sliding in delay-line bins: HSLIDAR in the mode in which the demonstrator ran it, its windows one after another.
//!
//! ```text
//!   start value k      ├┼┼┼┼┼┼┼┤           8 elements of 2.6 ns on average, other ones in each macropixel
//!               k + 1       ├┼┼┼┼┼┼┼┤      a CLK period of 12.5 ns later: every second window would leave gaps
//! ```
//!
//! Windows, light and laser cycles are those of [`steps`](super::steps), with the chip's own windows in place of ones that touch: each
//! takes what its far end needs. The echo lies in the middle of the macropixel's own window; its time is the likeliest between
//! the edges that a calibration has found ([`BinProfile`]), so that neither unequal elements nor skew are errors.
//!
//! Zooming has no such row. Its coarse bins are CLK periods (`steps`), and CLK has no part in a bin of a delay line: longer elements would
//! take another control voltage, of which the thesis gives no measurement.

use super::steps::{Measurement, measured_cycles, seed, wanted_ns};
use crate::chip::{Exposure, Sensor, WindowLaw};
use crate::demo::STOP_PERIODS;
use crate::engine::{EngineError, LitPixel, Window, expose, stream_config};
use crate::numerics::intervals::{Estimate, share};
use crate::photon::{PhotonStream, PixelLight};
use crate::ranging::BinProfile;
use crate::reproduce::measured::penalty::{ratio, sum};
use crate::theory::Pulse;
use crate::theory::estimators::InEdges;
use crate::theory::partial::{ExposureStep, System};
use crate::units::{Time, TimeOfFlight};

/// Seeds of a step from here on are free: those before are of measurements and exposures of detections ([`steps`](super::steps)).
const FIRST_SEED: u64 = 80;

/// What sliding takes up to a range in delay-line bins, and what a guided window takes there.
#[derive(Debug, Clone)]
pub(crate) struct OnDelayLines {
    /// The range, m.
    pub range_m: f64,
    /// Far ends of the windows, m, and the laser cycles of each.
    pub windows: Vec<(f64, Estimate)>,
    /// Laser cycles of all windows by the formula that the thesis takes.
    pub reckoned: f64,
    /// The measurement at the range, in a guided window.
    pub guided: Measurement,
    /// Share of the windows' exposures in which a bin is full.
    pub full: Estimate,
}

impl OnDelayLines {
    /// Laser cycles of all windows.
    pub(crate) fn sliding(&self) -> Estimate {
        let cycles = self.windows.iter().map(|(_, cycles)| *cycles);
        cycles.reduce(|a, b| sum(&a, &b)).expect("a window")
    }

    /// Those over the guided histogram's.
    pub(crate) fn penalty_of_sliding(&self) -> Estimate {
        ratio(&self.sliding(), &self.guided.cycles)
    }

    /// Measures windows with `frames` frames each, and the guided one with eight times as many, on the macropixels of the calibrated
    /// sensor.
    ///
    /// # Errors
    /// What the engine refuses.
    pub(super) fn measure(
        system: &System,
        calibration: &BinProfile,
        range_m: f64,
        frames: usize,
    ) -> Result<Self, EngineError> {
        let chip = Chip {
            system,
            sensor: Sensor::from(&calibration.sensor),
            calibration,
        };
        let (mut windows, mut reckoned, mut full, mut exposures) = (Vec::new(), 0.0, 0, 0);
        for (start, end_m) in chip.windows_to(range_m) {
            let step = system.measure(end_m);
            let taken = chip.measuring(start, &step, frames)?;
            reckoned += step.laser_cycles;
            windows.push((end_m, taken.measurement.cycles));
            full += taken.full;
            exposures += taken.measurement.frames;
        }
        let law = chip.nominal_law();
        let start = law.start_for(Time::of_flight(range_m));
        let start = start.expect("the demonstrator's range is within reach");
        let guided = chip.measuring(start, &system.measure(range_m), 8 * frames)?;
        Ok(OnDelayLines {
            range_m,
            windows,
            reckoned,
            guided: guided.measurement,
            full: share(f64::from(full), exposures as f64),
        })
    }
}

/// HSLIDAR with its calibration in a system's light.
struct Chip<'a> {
    system: &'a System,
    sensor: Sensor,
    calibration: &'a BinProfile,
}

/// What one macropixel counted, and what is known of its bins.
struct Frame {
    counts: Vec<u32>,
    /// Where its bins begin and the last one ends by the calibration, ns after the laser's trigger.
    edges_ns: Vec<f64>,
    /// When the echo came, ns after the laser's trigger.
    arrival_ns: f64,
}

/// A measurement, and how many of its frames have a full bin.
struct DelayLineMeasurement {
    measurement: Measurement,
    full: u32,
}

impl Chip<'_> {
    /// The window law of a macropixel as it is designed.
    fn nominal_law(&self) -> WindowLaw {
        let exposure = Exposure::new(&self.sensor, STOP_PERIODS, 1);
        WindowLaw::new(self.sensor.alike(), &exposure)
    }

    /// Start values whose windows lead from the chip to `range_m`, with the far end of each, m.
    fn windows_to(&self, range_m: f64) -> Vec<(u16, f64)> {
        let law = self.nominal_law();
        let windows = (0..=self.sensor.largest_start()).filter_map(|start| {
            let end = law.interval(&law.window(start).open()?).end;
            (end > Time::ZERO).then(|| (start, end.as_range_m()))
        });
        let mut windows: Vec<(u16, f64)> = windows.collect();
        windows.sort_by(|a, b| a.1.total_cmp(&b.1));
        let last = windows.iter().position(|(_, end_m)| *end_m >= range_m);
        windows.truncate(last.expect("the demonstrator's range is within reach") + 1);
        windows
    }

    /// A measurement in the window of `start`, in the light of `step`.
    fn measuring(
        &self,
        start: u16,
        step: &ExposureStep,
        frames: usize,
    ) -> Result<DelayLineMeasurement, EngineError> {
        let cycles = measured_cycles(step);
        let frames = self.frames(start, step, cycles, frames)?;
        let (background_per_ns, signal) = self.levels(&frames);
        let pulse = Pulse::Gaussian {
            sigma_ns: self.sigma_ns(),
        };
        let errors = frames.iter().map(|frame| {
            let expected = InEdges {
                pulse: &pulse,
                edges_ns: &frame.edges_ns,
                background_per_ns,
                signal,
            };
            expected.maximum_likelihood(&frame.counts) - frame.arrival_ns
        });
        let errors: Vec<f64> = errors.collect();
        let most = (1 << self.sensor.bin_bits) - 1;
        let full = frames.iter().filter(|frame| frame.counts.contains(&most));
        Ok(DelayLineMeasurement {
            measurement: Measurement::from_errors(&errors, cycles, wanted_ns(self.system)),
            full: full.count() as u32,
        })
    }

    fn sigma_ns(&self) -> f64 {
        1e9 * self.system.link.pulse_sigma_s
    }

    /// Frames on one macropixel after the other. Their echoes lie evenly about the middle of the bin in mid-window.
    fn frames(
        &self,
        start: u16,
        step: &ExposureStep,
        cycles: u32,
        frames: usize,
    ) -> Result<Vec<Frame>, EngineError> {
        let Chip {
            system,
            sensor,
            calibration,
        } = self;
        let exposure = Exposure::new(sensor, STOP_PERIODS, cycles);
        let engine = Window::new(sensor, &exposure);
        let law = WindowLaw::new(sensor, &exposure);
        let signal = system.link.signal / (step.range_m * step.range_m);
        let sigma = Time::from_s(system.link.pulse_sigma_s);
        let middle = f64::from(system.bins / 2);
        let shift = |frame: usize| (frame as f64 + 0.5) / frames as f64 - 0.5;
        let lit = |frame: usize| {
            let number = (frame % sensor.pixels()) as u32;
            let own = law.of_macropixel(number);
            let window = own.window(start).open();
            let window = window.expect("every macropixel has the window");
            let arrival = own.time_of(&window, middle + shift(frame));
            let light = PixelLight::echo(signal, arrival);
            let pixel = LitPixel {
                number,
                start,
                light: Some(light.with_background(system.link.background_hz)),
            };
            (pixel, arrival)
        };
        let all: Vec<(LitPixel, Time)> = (0..frames).map(lit).collect();
        let mut taken = Vec::new();
        // A macropixel's photons are those of its number: every turn of the array has a seed of its own.
        for (turn, lit) in (0..).zip(all.chunks(sensor.pixels())) {
            let seed = seed(step) + FIRST_SEED + turn;
            let stream = PhotonStream::new(&stream_config(sensor, &exposure, seed, sigma));
            let pixels: Vec<LitPixel> = lit.iter().map(|(pixel, _)| pixel.clone()).collect();
            let exposed = expose(&engine, &stream, &pixels, |_| ())?;
            let frames = lit.iter().zip(exposed.histograms.iter());
            taken.extend(frames.map(|((pixel, arrival), counts)| {
                let edges_s = calibration.edges_s(pixel.number as usize, start);
                Frame {
                    counts: counts.iter().map(|&n| n.into()).collect(),
                    edges_ns: edges_s.iter().map(|s| 1e9 * s).collect(),
                    arrival_ns: arrival.as_ns(),
                }
            }));
        }
        Ok(taken)
    }

    /// Mean background counts per ns of bins that the echo does not reach, and of the whole echo, at least 1: what a host knows after
    /// some frames.
    fn levels(&self, frames: &[Frame]) -> (f64, f64) {
        let reach_ns = 4.0 * self.sigma_ns() + 1e9 * self.system.bin_s;
        let (mut dark, mut dark_ns, mut all, mut all_ns) = (0.0, 0.0, 0.0, 0.0);
        for frame in frames {
            for (ends, &count) in frame.edges_ns.windows(2).zip(&frame.counts) {
                let middle_ns = 0.5 * (ends[0] + ends[1]);
                let (count, length_ns) = (f64::from(count), ends[1] - ends[0]);
                (all, all_ns) = (all + count, all_ns + length_ns);
                if (middle_ns - frame.arrival_ns).abs() > reach_ns {
                    (dark, dark_ns) = (dark + count, dark_ns + length_ns);
                }
            }
        }
        let background_per_ns = dark / f64::max(dark_ns, 1.0);
        let signal = (all - all_ns * background_per_ns) / frames.len() as f64;
        (background_per_ns, signal.max(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::delay_line;
    use crate::reproduce::parameters::demonstrator;

    fn chip<'a>(system: &'a System, calibration: &'a BinProfile) -> Chip<'a> {
        Chip {
            system,
            sensor: Sensor::from(&calibration.sensor),
            calibration,
        }
    }

    /// Steps of 12.5 ns are 1.874 m, windows of 20.8 ns 3.118 m.
    #[test]
    fn windows_lead_to_the_range_without_a_gap() {
        let system = demonstrator();
        let windows = chip(&system, delay_line::calibrated()).windows_to(75.0);
        assert!(windows[0].1 <= 3.118 + 1.874, "{:?}", windows[0]);
        for pair in windows.windows(2) {
            assert_eq!(pair[1].0, pair[0].0 + 1);
            assert!((pair[1].1 - pair[0].1 - 1.8737).abs() < 1e-3, "{pair:?}");
        }
        let [.., before, last] = &windows[..] else {
            panic!("{windows:?}")
        };
        assert!(before.1 < 75.0 && 75.0 <= last.1, "{before:?} {last:?}");
    }

    /// The same frames with edges that are all alike: elements of 0.4 ns σ and skew are errors then.
    #[test]
    fn calibrated_edges_take_fewer_laser_cycles_than_assumed_ones() {
        let system = demonstrator();
        let calibrated = delay_line::calibrated();
        let sensor = Sensor::from(&calibrated.sensor);
        let ideal = BinProfile::ideal(&sensor, &Exposure::new(&sensor, STOP_PERIODS, 1));
        let [found, assumed] = [calibrated, &ideal].map(|profile| {
            let step = system.measure(20.0);
            let start = chip(&system, profile).nominal_law();
            let start = start.start_for(Time::of_flight(20.0)).unwrap();
            let taken = chip(&system, profile).measuring(start, &step, 128);
            taken.unwrap().measurement
        });
        assert!(
            found.cycles.high < assumed.cycles.low,
            "{found:?} {assumed:?}"
        );
        assert!(found.found.value > 0.9, "{found:?}");
    }
}
