//! The world during an exposure: a sequence of worlds that stand still, what the array sees of each, and its light.
//!
//! ```text
//!   exposure   ├────────┬────────┬────────┬────────┤
//!   worlds         0        1        2        3         each in the middle of its segment
//!   views         all ─► moved ─► moved ─► moved ─┐     what sees nothing of what has moved keeps its view, and what has the same
//!   next frame  moved ─► …                      ◄─┘     view keeps its light
//! ```

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use crate::chip::Exposure;
use crate::photon::{PhotonStream, PixelLight};
use crate::scene::{GroundTruth, PreviousWorld, Scene};

/// The last world of an exposure.
#[derive(Debug)]
pub(super) struct LastWorld {
    world: Scene,
    truth: GroundTruth,
    light: Vec<PixelLight>,
}

/// The world in the middle of each segment of an exposure, s on the scene's clock; one, if it does not move.
pub(super) fn worlds(scene: &Scene, exposure_s: Range<f64>, segments: u32) -> Vec<Scene> {
    let length_s = (exposure_s.end - exposure_s.start) / f64::from(segments);
    let middle_s = |n: u32| exposure_s.start + (f64::from(n) + 0.5) * length_s;
    if scene.is_still() {
        vec![scene.snapshot(0.0)]
    } else {
        (0..segments).map(|n| scene.snapshot(middle_s(n))).collect()
    }
}

/// What an array of `rows` × `cols` sees of some worlds. With `reuse` they are only looked at where something has moved, the first of
/// them since `last`. Returns how many views were kept, too.
pub(super) fn truths(
    worlds: &[Scene],
    (rows, cols): (u32, u32),
    last: Option<&LastWorld>,
    reuse: bool,
) -> (Vec<GroundTruth>, usize) {
    let mut truths: Vec<GroundTruth> = Vec::with_capacity(worlds.len());
    let mut all_kept = 0;
    for (n, world) in worlds.iter().enumerate() {
        let before = match truths.last() {
            Some(truth) => Some(PreviousWorld {
                world: &worlds[n - 1],
                truth,
            }),
            None => last.map(LastWorld::previous_world),
        };
        let before = before.filter(|_| reuse);
        let (truth, kept) = GroundTruth::render_after(world, rows, cols, before);
        truths.push(truth);
        all_kept += kept;
    }
    (truths, all_kept)
}

/// The light of some worlds on every macropixel, likewise.
pub(super) fn lights(
    worlds: &[Scene],
    truths: &[GroundTruth],
    stream: &PhotonStream,
    last: Option<&LastWorld>,
    reuse: bool,
) -> Vec<Vec<PixelLight>> {
    let mut lights: Vec<Vec<PixelLight>> = Vec::with_capacity(worlds.len());
    for (n, (world, truth)) in worlds.iter().zip(truths).enumerate() {
        let before = match lights.last() {
            Some(light) => {
                let (world, truth) = (&worlds[n - 1], &truths[n - 1]);
                Some((PreviousWorld { world, truth }, &light[..]))
            }
            None => last.map(|last| (last.previous_world(), &last.light[..])),
        };
        let before = before.filter(|_| reuse);
        lights.push(world.light_after(truth, &stream.config().spads, before));
    }
    lights
}

impl LastWorld {
    /// Of the worlds of an exposure, of which there is at least one.
    pub(super) fn new(
        worlds: &[Scene],
        truths: Vec<GroundTruth>,
        lights: Vec<Vec<PixelLight>>,
    ) -> Arc<Self> {
        Arc::new(LastWorld {
            world: worlds.last().expect("one").clone(),
            truth: truths.into_iter().next_back().expect("one"),
            light: lights.into_iter().next_back().expect("one"),
        })
    }

    fn previous_world(&self) -> PreviousWorld<'_> {
        PreviousWorld {
            world: &self.world,
            truth: &self.truth,
        }
    }
}

/// The light of an exposure on every macropixel: what stays the same in all worlds is the plain light of one. Light whose SPADs
/// differ cannot change within an exposure, and is that of its middle.
pub(super) fn light_of(lights: &[Vec<PixelLight>], exposure: &Exposure) -> Vec<PixelLight> {
    let parts = lights.len() as u64;
    let first_cycle = |n: usize| (n as u64 * u64::from(exposure.laser_cycles) / parts) as u32;
    (0..lights[0].len())
        .into_par_iter()
        .map(|pixel| {
            let mut segments: Vec<(u32, PixelLight)> = Vec::new();
            for (n, light) in lights.iter().enumerate() {
                let is_new = segments
                    .last()
                    .is_none_or(|(_, last)| *last != light[pixel]);
                // Of more segments than laser cycles some have none.
                let begins = segments
                    .last()
                    .is_none_or(|&(first, _)| first < first_cycle(n));
                if is_new && begins {
                    segments.push((first_cycle(n), light[pixel].clone()));
                }
            }
            match segments.len() {
                1 => segments.swap_remove(0).1,
                _ => PixelLight::timeline(segments)
                    .unwrap_or_else(|_| lights[lights.len() / 2][pixel].clone()),
            }
        })
        .collect()
}
