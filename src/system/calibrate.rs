//! Calibration of delay lines as it was done (thesis 6.3.1, Fig. 89 to 91): a picosecond laser on all macropixels, delayed step by
//! step over a window, and for each step the bin that is fullest.
//!
//! ```text
//!   laser delay ├┤10 ps
//!   fullest bin  0 0 0 0 1 1 1 1 1 2 2 …       bin b: from the first step at which it is, for as many steps as it is
//! ```
//!
//! Every step is an exposure of its own on the window engine, with photons of its own. One even and one odd window are swept: others
//! differ from them by whole steps of CLK.

use rayon::prelude::*;

use crate::chip::{Exposure, Sensor, Tdc, WindowLaw};
use crate::engine::{EngineError, Expose, LitPixel, Window, stream_config};
use crate::photon::{PhotonStream, PixelLight};
use crate::ranging::{BinProfile, LineProfile};
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
        }
    }
}

/// Sweeps all macropixels of a sensor with delay lines, in laser cycles of `stop_periods` CLK periods; `swept` is told of every
/// macropixel.
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
) -> Result<BinProfile, SweepError> {
    assert_eq!(
        sensor.tdc,
        Tdc::DelayLine,
        "a clocked TDC has nothing to sweep"
    );
    let exposure = Exposure::new(sensor, stop_periods, sweep.laser_cycles);
    let starts = [
        first_seen(sensor, &exposure, 0)?,
        first_seen(sensor, &exposure, 1)?,
    ];
    let law = WindowLaw::new(sensor, &exposure);
    let stream = PhotonStream::new(&stream_config(
        sensor,
        &exposure,
        sweep.seed,
        sweep.pulse_sigma,
    ));
    let line = |pixel: usize, start: u16| -> Result<LineProfile, SweepError> {
        let law = law.of_macropixel(pixel as u32);
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
        let counts = Window::of_one(law).expose(&stream, &lit)?.histograms;
        Ok(profile(
            &counts.iter().collect::<Vec<_>>(),
            &delays,
            sweep.step,
        ))
    };
    let macropixels: Result<Vec<[LineProfile; 2]>, SweepError> = (0..sensor.pixels())
        .into_par_iter()
        .map(|pixel| {
            let lines = [line(pixel, starts[0])?, line(pixel, starts[1])?];
            swept();
            Ok(lines)
        })
        .collect();
    Ok(BinProfile {
        sensor: (**sensor).clone(),
        starts,
        macropixels: macropixels?,
    })
}

/// Why bins cannot be swept.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SweepError {
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

/// The first even (`parity` 0) or odd (1) start value whose window lies after the laser's trigger, by half a line for mismatch.
fn first_seen(sensor: &Sensor, exposure: &Exposure, parity: u16) -> Result<u16, SweepError> {
    let law = WindowLaw::new(sensor.alike(), exposure);
    let half = Time::from_fs(sensor.longest_delay_line().as_fs() / 4);
    let is_seen = |start: &u16| {
        let window = law.window(*start).open();
        window.is_some_and(|window| law.interval(&window).start > half)
    };
    let mut starts = (parity..=sensor.largest_start()).step_by(2);
    let is_odd = parity == 1;
    starts.find(is_seen).ok_or(SweepError::NoWindow { is_odd })
}

/// Middle and length of every bin from the steps at which it is the fullest.
fn profile(counts: &[&[u16]], delays: &[Time], step: Time) -> LineProfile {
    let bins = counts[0].len();
    let mut steps = vec![(0u32, 0.0); bins];
    for (counts, delay) in counts.iter().zip(delays) {
        let fullest = (0..bins).rev().max_by_key(|&bin| counts[bin]);
        if let Some(bin) = fullest.filter(|&bin| counts[bin] > 0) {
            steps[bin].0 += 1;
            steps[bin].1 += delay.as_s();
        }
    }
    LineProfile {
        middle_s: steps
            .iter()
            .map(|&(n, sum)| sum / f64::from(n.max(1)))
            .collect(),
        length_s: steps
            .iter()
            .map(|&(n, _)| f64::from(n) * step.as_s())
            .collect(),
    }
}
