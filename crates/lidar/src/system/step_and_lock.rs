//! Step and lock: how HSLIDAR finds targets without a guide (thesis 4.9): every macropixel steps
//! its window over the range until a peak shows, locks on to it, and follows it to the windows beside.
//!
//! ```text
//!   searching ──no peak──► next window, after the last one the first
//!       │ peak                                           ▲
//!       ▼                                                │ no peak in `patience` exposures
//!   locked ──peak in its first or last bins──► window before or after it ──┘
//! ```
//!
//! One exposure is one step. The chip decides by comparing bins with each other; which comparison the thesis does not say, and here it is the
//! test that ranging makes of a peak ([`Scan`](crate::theory::significance::Scan)), at a false-alarm rate of its own.

use crate::chip::WindowLaw;
use crate::ranging::{DepthOptions, EchoFinder, UnequalBins};
use crate::units::Time;

/// What decides a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LockOptions {
    /// Share of exposures without an echo in which a macropixel may lock.
    pub false_alarm_rate: f64,
    /// Bins at either end of a window in which a peak moves the window towards it. With as many as windows do not share with
    /// the next, a peak that moves on is seen by the next window, too.
    pub edge_bins: usize,
    /// Exposures without a peak after which a locked macropixel searches again.
    pub patience: u32,
    /// The first start value to search.
    pub nearest: u16,
    /// The last start value to search.
    pub farthest: u16,
}

/// What a macropixel does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LockState {
    /// It steps its window.
    Searching,
    /// It follows a peak.
    Locked {
        /// Exposures since the peak was last seen.
        missed: u32,
    },
}

/// One macropixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tracker {
    /// The start value of the next exposure.
    pub start: u16,
    /// What it does.
    pub state: LockState,
}

/// The macropixels of an array that search and track on their own.
#[derive(Debug, Clone)]
pub struct StepAndLock {
    finder: EchoFinder,
    options: LockOptions,
    bins: usize,
    trackers: Vec<Tracker>,
}

impl StepAndLock {
    /// All of `macropixels` searching from the nearest window on; `law` is the sensor's and its exposure's, for Gaussian pulses of
    /// `pulse_sigma`.
    ///
    /// # Errors
    /// Bins that the finder of peaks does not take.
    pub fn new(
        law: &WindowLaw,
        pulse_sigma: Time,
        options: LockOptions,
        macropixels: usize,
    ) -> Result<Self, UnequalBins> {
        let depth = DepthOptions {
            false_alarm_rate: options.false_alarm_rate,
            ..DepthOptions::default()
        };
        let first = Tracker {
            start: options.nearest,
            state: LockState::Searching,
        };
        Ok(StepAndLock {
            finder: EchoFinder::new(law, pulse_sigma, &depth)?,
            options,
            bins: law.sensor().bins,
            trackers: vec![first; macropixels],
        })
    }

    /// The macropixels, with the start values of the next exposure.
    pub fn trackers(&self) -> &[Tracker] {
        &self.trackers
    }

    /// Steps every macropixel by its histogram of the exposure, row-major, a count for each bin.
    pub fn step<'h>(&mut self, histograms: impl IntoIterator<Item = &'h [u16]>) {
        for (pixel, counts) in histograms.into_iter().enumerate() {
            let counts: Vec<u32> = counts.iter().map(|&n| n.into()).collect();
            let found = self.finder.find(&counts);
            let peak = found.filter(|found| found.is_significant);
            self.trackers[pixel] = self.next(self.trackers[pixel], peak.map(|p| p.peak.peak_bin));
        }
    }

    fn next(&self, tracker: Tracker, peak_bin: Option<usize>) -> Tracker {
        let LockOptions {
            edge_bins,
            patience,
            nearest,
            farthest,
            ..
        } = self.options;
        let start = tracker.start;
        let searched_next = if start >= farthest {
            nearest
        } else {
            start + 1
        };
        match (tracker.state, peak_bin) {
            (_, Some(bin)) => Tracker {
                start: if bin < edge_bins {
                    start.saturating_sub(1).max(nearest)
                } else if bin + edge_bins >= self.bins {
                    (start + 1).min(farthest)
                } else {
                    start
                },
                state: LockState::Locked { missed: 0 },
            },
            (LockState::Locked { missed }, None) if missed + 1 < patience => Tracker {
                start,
                state: LockState::Locked { missed: missed + 1 },
            },
            (_, None) => Tracker {
                start: searched_next,
                state: LockState::Searching,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::{Exposure, Sensor, SensorConfig, hslidar, hslidar_delay_line};
    use crate::engine::{Expose, LitPixel, Window, stream_config};
    use crate::photon::{PhotonStream, PixelLight};
    use crate::units::TimeOfFlight;

    const OPTIONS: LockOptions = LockOptions {
        false_alarm_rate: 1e-6,
        edge_bins: 2,
        patience: 3,
        nearest: 2,
        farthest: 40,
    };

    /// Runs exposures in which macropixel `pixel` has its target at `range_m(pixel, exposure)`; reports the trackers
    /// after each.
    fn run(
        sensor: &Sensor,
        exposures: u32,
        range_m: impl Fn(u32, u32) -> Option<f64>,
        mut told: impl FnMut(u32, &WindowLaw, &[Tracker]),
    ) {
        const MACROPIXELS: u32 = 24;
        let exposure = Exposure::new(sensor, 60 * sensor.step_periods as u32, 600);
        let law = WindowLaw::new(sensor, &exposure);
        let sigma = Time::from_ps(1_900);
        // Windows of delay lines share 3.2 bins on average, of some macropixels only two.
        let edge_bins = if law.has_clk_bins() { 2 } else { 1 };
        let options = LockOptions {
            edge_bins,
            ..OPTIONS
        };
        let mut tracking = StepAndLock::new(&law, sigma, options, MACROPIXELS as usize).unwrap();
        let window = Window::new(sensor, &exposure);
        for number in 0..exposures {
            let stream = stream_config(sensor, &exposure, number.into(), sigma);
            let pixels = (0..).zip(tracking.trackers()).map(|(pixel, tracker)| {
                let dark = PixelLight::echo(0.0, Time::ZERO);
                let light = range_m(pixel, number)
                    .map_or(dark, |m| PixelLight::echo(0.4, Time::of_flight(m)));
                LitPixel {
                    number: pixel,
                    start: tracker.start,
                    light: Some(light.with_background(6e6)),
                }
            });
            let pixels: Vec<LitPixel> = pixels.collect();
            let exposed = window.expose(&PhotonStream::new(&stream), &pixels).unwrap();
            tracking.step(exposed.histograms.iter());
            told(number, &law, tracking.trackers());
        }
    }

    fn sensors() -> [Sensor; 2] {
        let small = |sensor: Sensor| {
            Sensor::from(SensorConfig {
                rows: 4,
                cols: 6,
                ..(*sensor).clone()
            })
        };
        [small(hslidar()), small(hslidar_delay_line())]
    }

    fn is_locked(tracker: &Tracker) -> bool {
        matches!(tracker.state, LockState::Locked { .. })
    }

    #[test]
    fn every_macropixel_locks_on_to_its_target_and_keeps_it_as_it_moves() {
        for sensor in sensors() {
            // All windows are searched before anything moves, by a tenth of a step at a time.
            let step_m = 0.5 * 299_792_458.0 * sensor.step_periods as f64 / sensor.clk_hz;
            let searched = 45;
            let range_m = |pixel: u32, exposure: u32| {
                let moved = 0.1 * f64::from(exposure.saturating_sub(searched));
                Some((6.0 + f64::from(pixel) + moved) * step_m)
            };
            run(
                &sensor,
                searched + 24,
                range_m,
                |exposure, law, trackers| {
                    if exposure < searched {
                        return;
                    }
                    for (pixel, tracker) in (0..).zip(trackers) {
                        assert!(is_locked(tracker), "{pixel} at {exposure}: {tracker:?}");
                        let law = law.of_macropixel(pixel);
                        let seen = law.interval(&law.window(tracker.start).open().unwrap());
                        let target = Time::of_flight(range_m(pixel, exposure).unwrap());
                        assert!(seen.contains(&target), "{pixel} at {exposure}");
                    }
                },
            );
        }
    }

    #[test]
    fn without_a_target_it_searches_on_and_a_lost_one_is_given_up() {
        for sensor in sensors() {
            let step_m = 0.5 * 299_792_458.0 * sensor.step_periods as f64 / sensor.clk_hz;
            let range_m = |pixel: u32, exposure: u32| {
                (pixel.is_multiple_of(2) && exposure < 45).then_some(12.0 * step_m)
            };
            run(&sensor, 50, range_m, |exposure, _, trackers| {
                for (pixel, tracker) in trackers.iter().enumerate() {
                    if pixel % 2 == 1 || exposure >= 48 {
                        assert!(!is_locked(tracker), "{pixel} at {exposure}");
                    }
                }
            });
        }
    }
}
