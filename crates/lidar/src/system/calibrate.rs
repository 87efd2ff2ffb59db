//! Calibration of delay lines as it was done on the chip (thesis 6.3.1, Fig. 89 to 91): a picosecond laser on all
//! macropixels, delayed step by step over a window, and for each step the bin that is fullest.
//!
//! ```text
//!   laser delay ├┤10 ps
//!   fullest bin  0 0 0 0 1 1 1 1 1 2 2 …       an edge between two bins; the first and the last one: swept_edges
//! ```
//!
//! Every step is an exposure of its own on the window engine, with photons of its own. One even and one odd window are swept: others
//! differ from them by whole steps of CLK. [`Sweep::every_window`] sweeps all and takes the mean of what each finds, which is
//! also the proof of that: [`BinCalibration::largest_difference`] is of the order of a step.

use rayon::prelude::*;

use crate::chip::{Exposure, Sensor, Tdc, WindowLaw};
use crate::engine::{EngineError, Expose, LitPixel, Window, stream_config};
use crate::photon::{PhotonStream, PixelLight};
use crate::ranging::{BinProfile, LineProfile};
use crate::system::swept_edges::Swept;
use crate::units::Time;

/// How the laser sweeps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// Delay from one step to the next.
    pub step: Time,
    /// Standard deviation of the laser pulse, with all jitter.
    pub pulse_sigma: Time,
    /// Laser cycles of a step.
    pub laser_cycles: u32,
    /// Detected photons of a macropixel in a laser cycle, on average. Two in one cycle leave no edge.
    pub photons_per_cycle: f64,
    /// Seed of the photons.
    pub seed: u64,
    /// Whether every window is swept, or one even and one odd one.
    pub every_window: bool,
}

/// What a sweep has found.
#[derive(Debug, Clone, PartialEq)]
pub struct BinCalibration {
    /// The bins of every macropixel: means over its even and over its odd windows that were swept.
    pub profile: BinProfile,
    /// Even and odd windows of a macropixel that were swept.
    pub windows: [usize; 2],
    /// How far the middle of a bin lay from the same bin's mean over all windows, at most.
    pub largest_difference: Time,
}

impl Default for Sweep {
    /// The thesis's 10 ps (6.3.1); the rest is chosen. The laser's 30 ps are 70 ps full width at half maximum. Half a photon a cycle
    /// leaves an edge in 0.32 of them, where no light leaves more than one in half of them, and 16 cycles leave 5 edges.
    fn default() -> Self {
        Sweep {
            step: Time::from_ps(10),
            pulse_sigma: Time::from_ps(30),
            laser_cycles: 16,
            photons_per_cycle: 0.5,
            seed: 1,
            every_window: false,
        }
    }
}

/// Sweeps all macropixels of a sensor with delay lines, in laser cycles of `stop_periods` CLK periods; `swept` is
/// called for every macropixel.
///
/// # Errors
/// What the window engine refuses, and laser cycles without a window of either kind that can be swept.
///
/// # Panics
/// Where the TDC is clocked.
pub fn calibrate(
    sensor: &Sensor,
    stop_periods: u32,
    sweep: &Sweep,
    swept: impl Fn() + Sync,
) -> Result<BinCalibration, BinSweepError> {
    assert_eq!(
        sensor.tdc,
        Tdc::DelayLine,
        "a clocked TDC has nothing to sweep"
    );
    let exposure = Exposure::new(sensor, stop_periods, sweep.laser_cycles);
    let law = WindowLaw::new(sensor, &exposure);
    let starts = [0, 1].map(|parity| {
        let seen = swept_starts(sensor, &exposure, parity);
        let wanted = if sweep.every_window { usize::MAX } else { 1 };
        seen.take(wanted).collect::<Vec<u16>>()
    });
    for (starts, is_odd) in starts.iter().zip([false, true]) {
        if starts.is_empty() {
            return Err(BinSweepError::NoWindow { is_odd });
        }
    }
    let sweeping = Sweeping {
        sensor,
        sweep,
        exposure: &exposure,
    };
    // What is looked for is how far the windows of one line differ by anything but whole steps.
    let line = |pixel: usize, starts: &[u16]| -> Result<(LineProfile, f64), BinSweepError> {
        let law = law.of_macropixel(pixel as u32);
        let lines: Result<Vec<LineProfile>, BinSweepError> = (0..)
            .zip(starts)
            .map(|(nth, &start)| {
                let mut line = sweeping.line(&law, pixel, start, nth)?;
                let steps = i64::from(start - starts[0]) * sensor.step_periods as i64;
                let later_s = exposure.clock.periods(steps).as_s();
                line.middle_s
                    .iter_mut()
                    .for_each(|middle_s| *middle_s -= later_s);
                Ok(line)
            })
            .collect();
        Ok(mean(&lines?))
    };
    let macropixels: Result<Vec<_>, BinSweepError> = (0..sensor.pixels())
        .into_par_iter()
        .map(|pixel| {
            let lines = [line(pixel, &starts[0])?, line(pixel, &starts[1])?];
            swept();
            Ok(lines)
        })
        .collect();
    let mut largest_s = 0f64;
    let macropixels = macropixels?.into_iter().map(|lines| {
        lines.map(|(line, difference_s)| {
            largest_s = largest_s.max(difference_s);
            line
        })
    });
    let macropixels = macropixels.collect();
    Ok(BinCalibration {
        profile: BinProfile {
            sensor: (**sensor).clone(),
            starts: [starts[0][0], starts[1][0]],
            macropixels,
        },
        windows: [starts[0].len(), starts[1].len()],
        largest_difference: Time::from_s(largest_s),
    })
}

/// What all sweeps of a sensor share.
struct Sweeping<'a> {
    sensor: &'a Sensor,
    sweep: &'a Sweep,
    exposure: &'a Exposure,
}

impl Sweeping<'_> {
    /// The bins of one window of a macropixel, the `nth` of its kind that is swept.
    fn line(
        &self,
        law: &WindowLaw,
        pixel: usize,
        start: u16,
        nth: u64,
    ) -> Result<LineProfile, BinSweepError> {
        let Sweeping {
            sensor,
            sweep,
            exposure,
        } = *self;
        let window = law.window(start).settled().map_err(EngineError::from)?;
        let window = window.expect("it opens in the law of all");
        let seen = law.interval(&window);
        // The laser knows no more of the window than where it may be at most.
        let room = sweep.step * 40;
        let (first, last) = (seen.start - room, seen.end + room);
        let steps = (last - first).as_fs() / sweep.step.as_fs();
        let first = Time::from_fs(first.as_fs() / sweep.step.as_fs() * sweep.step.as_fs());
        let delays: Vec<Time> = (0..steps).map(|n| first + sweep.step * n).collect();
        let lit: Vec<LitPixel> = (0..)
            .zip(&delays)
            .map(|(step, &delay)| LitPixel {
                // Each step has photons of its own.
                number: (pixel as u32) + sensor.pixels() as u32 * (2 * step + u32::from(start % 2)),
                start,
                light: Some(PixelLight::echo(sweep.photons_per_cycle, delay)),
            })
            .collect();
        let seed = sweep.seed.wrapping_add(nth);
        let stream = stream_config(sensor, exposure, seed, sweep.pulse_sigma);
        let stream = PhotonStream::new(&stream);
        let counts = Window::of_one(law.clone())
            .expose(&stream, &lit)?
            .histograms;
        let counts: Vec<&[u16]> = counts.iter().collect();
        let swept = Swept {
            counts: &counts,
            first: delays[0],
            step: sweep.step,
            pulse_sigma: sweep.pulse_sigma,
        };
        Ok(swept.profile())
    }
}

/// The mean of several profiles of one line, and how far a middle of theirs is from its mean at most, s.
fn mean(lines: &[LineProfile]) -> (LineProfile, f64) {
    let means = |values: fn(&LineProfile) -> &[f64]| -> Vec<f64> {
        let bins = values(&lines[0]).len();
        let sum = |bin: usize| lines.iter().map(|line| values(line)[bin]).sum::<f64>();
        (0..bins).map(|bin| sum(bin) / lines.len() as f64).collect()
    };
    let mean = LineProfile {
        middle_s: means(|line| &line.middle_s),
        length_s: means(|line| &line.length_s),
    };
    let differences = lines.iter().flat_map(|line| {
        let pairs = line.middle_s.iter().zip(&mean.middle_s);
        pairs.map(|(one, mean)| (one - mean).abs())
    });
    let largest_s = differences.fold(0.0, f64::max);
    (mean, largest_s)
}

/// Why bins cannot be swept.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BinSweepError {
    /// The window engine refuses.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// All windows begin before the laser's trigger, or end after the laser cycle.
    #[error(
        "no window of {} start value lies within the laser cycle, after the laser's trigger",
        if *.is_odd { "an odd" } else { "an even" }
    )]
    NoWindow {
        /// Which kind has none.
        is_odd: bool,
    },
}

/// The even (`parity` 0) or odd (1) start values whose windows lie within the laser cycle and after the laser's trigger, by half a
/// line for mismatch.
fn swept_starts(sensor: &Sensor, exposure: &Exposure, parity: u16) -> impl Iterator<Item = u16> {
    let law = WindowLaw::new(sensor.alike(), exposure);
    let half = Time::from_fs(sensor.longest_delay_line().as_fs() / 4);
    let end = exposure.stop(1) - exposure.stop(0) - half;
    let starts = (parity..=sensor.largest_start()).step_by(2);
    starts.filter(move |&start| {
        let window = law.window(start).open();
        window.is_some_and(|window| {
            let seen = law.interval(&window);
            seen.start > half && seen.end < end
        })
    })
}
