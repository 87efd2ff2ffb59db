//! 7.3.3 as a run: the QuantIC4x4 near 200 m and at 25 fps, which the thesis expects to be within reach.
//!
//! A frame has 40 ms. The guide works on the next one meanwhile, so that load and readout leave the rest to the exposure. What the
//! laser cycles of that exposure see of a target of 10 % at 190 m, and whether the guide's windows hold it, is measured for more and
//! more laser energy and for better and better stereo.

use super::found::TargetSummary;
use super::scenes;
use crate::chip::{Exposure, Sensor};
use crate::scene::{DVec3, GroundTruth, Scene, Stereo};
use crate::system::{DriveSettings, DriveSimulation, FrameClock, FrameError, FrameSettings};

/// Where the target stands, m. The chip's last window ends at 2⁹ bins, 199.9 m: a target at 200 m is outside all of them, and one just
/// before it where the guide is wrong by a little.
pub const RANGE_M: f64 = 190.0;
/// Frames per second.
pub const FPS: f64 = 25.0;
/// Illuminance, klux: the demonstrator's sweep.
pub const KLUX: f64 = 72.0;
/// Laser cycles a second: the demonstrator's laser, and the fastest that 200 m allow the chip (520 CLK periods at 384 MHz).
pub const LASER_PERIODS: [u32; 2] = [4800, 520];
/// The laser's energy per macropixel over the demonstrator's.
pub const ENERGIES: [f64; 5] = [1.0, 4.0, 16.0, 64.0, 256.0];
/// Errors of the disparity, px: Fig. 105's line, and that of the same windows with three standard deviations in them.
pub const DISPARITIES_PX: [f64; 2] = [0.25, 0.07];

/// What becomes of the target with one laser and one guide.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Limit {
    /// CLK periods in a laser cycle.
    pub stop_periods: u32,
    /// Laser cycles that fit into a frame.
    pub laser_cycles: u32,
    /// The laser's energy per macropixel over the demonstrator's.
    pub energy: f64,
    /// Error of the disparity, px.
    pub disparity_px: f64,
    /// Time from frame to frame, s.
    pub period_s: f64,
    /// What became of the target's macropixels in all frames.
    pub found: TargetSummary,
}

/// Two frames for every laser, energy and guide; `done` is called after each pair.
///
/// # Errors
/// What a drive reports.
pub fn limits(seed: u64, done: impl Fn()) -> Result<Vec<Limit>, FrameError> {
    let mut limits = Vec::new();
    for stop_periods in LASER_PERIODS {
        for energy in ENERGIES {
            for disparity_px in DISPARITIES_PX {
                limits.push(limit(stop_periods, energy, disparity_px, seed)?);
                done();
            }
        }
    }
    Ok(limits)
}

fn limit(
    stop_periods: u32,
    energy: f64,
    disparity_px: f64,
    seed: u64,
) -> Result<Limit, FrameError> {
    let sensor = Sensor::default();
    let chip_s = 1.0 / FPS - sensor.load_time().as_s() - sensor.readout_time().as_s();
    let laser_cycles = (chip_s * sensor.clk_hz / f64::from(stop_periods)).floor() as u32;
    let exposure = Exposure::new(&sensor, stop_periods, laser_cycles);
    let scene = target(energy, disparity_px);
    let truth = GroundTruth::render(&scene, sensor.rows as u32, sensor.cols as u32);
    let only: Vec<bool> = truth
        .object
        .iter()
        .map(|&object| object == Some(1))
        .collect();
    let frame = FrameSettings {
        seed,
        ..FrameSettings::new(sensor, scene, exposure)
    };
    let settings = DriveSettings {
        clock: FrameClock {
            guide_latency_s: 1.0 / FPS,
            pipelined: true,
        },
        segments: 1,
        only: Some(only.clone()),
        ..DriveSettings::new(frame)
    };
    let mut drive = DriveSimulation::new(&settings)?;
    let period_s = drive.period_s();
    let mut pixels = Vec::new();
    let mut bin_m = 0.0;
    for _ in 0..2 {
        let frame = drive.frame(|_| {})?;
        bin_m = frame.bin_m;
        let on_it = frame.pixels.into_iter().zip(&only);
        pixels.extend(on_it.filter(|&(_, &on)| on).map(|(pixel, _)| pixel));
    }
    Ok(Limit {
        stop_periods,
        laser_cycles,
        energy,
        disparity_px,
        period_s,
        found: TargetSummary::summarise(pixels.iter(), bin_m),
    })
}

/// A target of 10 % at [`RANGE_M`] before the demonstrator's optics, SPADs with the QuantIC4x4's 18.5 % (Table 11), and the whole
/// resolution of the cameras.
fn target(energy: f64, disparity_px: f64) -> Scene {
    let mut scene = scenes::target_at(RANGE_M, 0.1, KLUX);
    scene.lidar.pde = 0.185;
    // The energy of the demonstrator is spread over half as many macropixels.
    scene.lidar.pulse_energy_uj *= 2.0 * energy;
    scene.stereo = Stereo {
        disparity_sigma_px: disparity_px,
        position_m: DVec3::new(0.0, -0.1, 0.0),
        ..Stereo::default()
    };
    scene
}
