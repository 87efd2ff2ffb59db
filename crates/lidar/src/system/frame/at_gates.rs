//! A macropixel of a frame on its gates, with a waveform.

use crate::chip::Exposure;
use crate::engine::waveform::{self, View};
use crate::engine::{GateSimulation, LitPixel};
use crate::photon::{PhotonStream, SpadEvent};
use crate::system::error::FrameError;
use crate::system::settings::{EngineKind, FrameSettings, GateProbe};
use crate::waves::WaveFormat;

/// A macropixel as its gates counted.
pub(super) struct AtGates {
    pub(super) pixel: usize,
    pub(super) start: u16,
    /// Pulses of the frame's exposure.
    pub(super) events: Vec<SpadEvent>,
    /// What was simulated of it.
    pub(super) exposure: Exposure,
    pub(super) counts: Vec<u16>,
}

impl AtGates {
    /// Runs a probe, and writes its waveform. Only part of the exposure is simulated where the window law tells the rest.
    pub(super) fn run(
        settings: &FrameSettings,
        stream: &PhotonStream,
        pixels: &[LitPixel],
        probe: &GateProbe,
    ) -> Result<Self, FrameError> {
        let (sensor, exposure) = (&settings.sensor, &settings.exposure);
        let at = (probe.row, probe.col);
        let pixel = probe.row * sensor.cols + probe.col;
        let LitPixel {
            number,
            start,
            light,
        } = &pixels[pixel];
        let photons = light.as_ref();
        let photons = photons.map(|light| stream.pixel_events(*number, light));
        let events = photons.unwrap_or_default().events;
        let start = *start;
        let has_tolerance = settings.tolerance_m.is_some();
        let laser_cycles = match settings.engine.of_probes(has_tolerance) {
            EngineKind::Window => (probe.wave_cycles).simulated(sensor, exposure, start, &events),
            _ => exposure.laser_cycles,
        };
        let mut probed = AtGates {
            pixel,
            start,
            events,
            exposure: Exposure {
                laser_cycles,
                ..*exposure
            },
            counts: Vec::new(),
        };
        let (part, pulses) = (&probed.exposure, probed.simulated());
        let mut simulation = GateSimulation::new(sensor, part, at, (1, 1), &[start], &[pulses]);
        let view = View::of_pixel(at, sensor, part, start, pulses, probe.wave_cycles);
        let format = WaveFormat::from_path(&probe.waves);
        waveform::record(&mut simulation, &probe.waves, format, &view, &mut ())?;
        probed.counts = simulation.histograms()?.into_counts();
        Ok(probed)
    }

    /// Pulses of what was simulated.
    pub(super) fn simulated(&self) -> &[SpadEvent] {
        let end = self.exposure.end();
        &self.events[..self.events.partition_point(|event| event.time < end)]
    }
}
