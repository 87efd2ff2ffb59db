//! What is known of a frame when its remarks are written.

use super::pixel::PixelDepth;
use crate::chip::{Exposure, Sensor, WindowLaw};
use crate::guide::Guide;
use crate::photon::PixelLight;
use crate::scene::Scene;
use crate::units::Time;

/// A frame's circumstances.
pub(super) struct Circumstances<'a> {
    /// The chip.
    pub sensor: &'a Sensor,
    /// Its clocks.
    pub exposure: &'a Exposure,
    /// Length of a bin, s.
    pub bin_s: f64,
    /// The world.
    pub scene: &'a Scene,
    /// What the windows were put by.
    pub guide: &'a dyn Guide,
    /// The light on every macropixel.
    pub light: &'a [PixelLight],
    /// What became of every macropixel.
    pub pixels: &'a [PixelDepth],
}

/// Photons of echoes that arrive in a laser cycle within a macropixel's window, or all where it has none.
pub(super) fn signal_in_window(law: &WindowLaw, pixel: &PixelDepth, light: &PixelLight) -> f64 {
    let window = pixel.start.and_then(|start| law.window(start).open());
    let seen = window.map(|window| law.interval(&window));
    let is_seen = |time: Time| seen.as_ref().is_none_or(|seen| seen.contains(&time));
    let of_segments = light.segments().map(|segment| {
        let echoes = segment.echoes().filter(|echo| is_seen(echo.arrival));
        echoes.map(|echo| echo.photons).sum()
    });
    of_segments.fold(0.0, f64::max)
}
