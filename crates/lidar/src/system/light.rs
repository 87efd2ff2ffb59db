//! What falls on the array in an exposure: the photons of a scene, and the light of every macropixel.

use crate::chip::{Exposure, Sensor, SensorConfig};
use crate::engine::{LitPixel, stream_config};
use crate::photon::{PhotonStream, PixelLight};
use crate::scene::{GroundTruth, Scene};

/// The photons that a sensor behind the optics of `scene` meets in an exposure, with the scene's laser pulse.
pub fn photon_stream(
    sensor: &Sensor,
    exposure: &Exposure,
    seed: u64,
    scene: &Scene,
) -> PhotonStream {
    let config = stream_config(sensor, exposure, seed, scene.pulse_sigma());
    PhotonStream::new(&scene.with_pulse(config))
}

/// What is really there for every macropixel in the middle of an exposure that begins at time 0 of the scene.
pub(super) fn truth_in(sensor: &SensorConfig, exposure: &Exposure, scene: &Scene) -> GroundTruth {
    let middle_s = 0.5 * exposure.end().as_s();
    GroundTruth::render(
        &scene.snapshot(middle_s),
        sensor.rows as u32,
        sensor.cols as u32,
    )
}

/// The light of an exposure on every macropixel, in the order of `truth`, on the SPADs of `stream`.
pub(super) fn light_in(
    exposure: &Exposure,
    scene: &Scene,
    truth: &GroundTruth,
    stream: &PhotonStream,
) -> Vec<PixelLight> {
    let config = stream.config();
    scene.light_during(
        truth,
        &config.spads,
        exposure.laser_cycles,
        config.cycle_s(),
    )
}

/// The start value of every macropixel; one whose SPADs are off looks as far as it can.
pub(super) fn starts_of(sensor: &SensorConfig, wanted: &[Option<u16>]) -> Vec<u16> {
    let farthest = sensor.largest_start();
    let starts = wanted.iter().map(|start| start.unwrap_or(farthest));
    starts.collect()
}

/// Every macropixel of the array with its start value and, where its SPADs are on, its light.
pub(super) fn lit_pixels(
    sensor: &SensorConfig,
    wanted: &[Option<u16>],
    light: &[PixelLight],
) -> Vec<LitPixel> {
    let starts = starts_of(sensor, wanted);
    let pixels = (0..).zip(starts).zip(wanted.iter().zip(light));
    pixels
        .map(|((number, start), (wanted, light))| LitPixel {
            number,
            start,
            light: wanted.map(|_| light.clone()),
        })
        .collect()
}
