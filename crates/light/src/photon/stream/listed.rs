//! Echoes in bright light whose photons are drawn one by one, whatever the SPADs do: those of measured pulses or of
//! half a laser cycle, of light with several layers, and photons whose avalanches trigger others.
//!
//! ```text
//!   laser cycle    n    n+1   n+2  …  n+15        side by side, photon by photon
//!   first photon   │     │     │       │          one block of random words each
//!   second         │     │             │          cycles that have fewer draw none that is kept
//! ```

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;

use super::bright::{PER_BLOCK, TILE};
use super::part::{PixelStream, nearest};
use crate::photon::philox::blocks_from;
use crate::photon::quantile::NormalSampler;
use crate::photon::spad::Photon;
use crate::units::Time;

/// From there on second counter words give the numbers of an echo's photons.
const NUMBER_RUN: u32 = 1 << 31;

/// The photons of the listed echoes of [`TILE`] laser cycles of one part of the light, kept for the caller that asks
/// for the next of them.
#[derive(Debug, Default)]
pub struct ListedEchoes {
    /// Of those that are kept.
    first_cycle: Option<u32>,
    photons: [Vec<Photon>; TILE],
}

impl ListedEchoes {
    /// Forgets all photons, for other light.
    pub fn clear(&mut self) {
        self.first_cycle = None;
    }

    /// The photons of one laser cycle's echo of `light`, in no particular order, where they do not depend on the SPADs' states; those
    /// before or after the exposure are none.
    pub fn photons(&mut self, light: &PixelStream<'_>, cycle: u32) -> &[Photon] {
        if !light.has_listed_echo() {
            return &[];
        }
        let lane = cycle as usize % TILE;
        let first_cycle = cycle - lane as u32;
        if !light.has_echo_in(&(first_cycle..first_cycle + TILE as u32)) {
            return &[];
        }
        if self.first_cycle != Some(first_cycle) {
            self.draw(light, first_cycle);
            self.first_cycle = Some(first_cycle);
        }
        &self.photons[lane]
    }

    fn draw(&mut self, light: &PixelStream<'_>, first_cycle: u32) {
        let (stream, config) = (light.stream, &light.stream.config);
        if let Some(foreign) = &light.foreign {
            self.photons.iter_mut().for_each(Vec::clear);
            light.strays_in(foreign, first_cycle..first_cycle + TILE as u32, |stray| {
                self.photons[(stray.cycle - first_cycle) as usize].push(Photon::new(
                    stream.cycle_start(stray.cycle) + Time::from_fs(stray.time_fs),
                    stray.spad,
                    light.has_secondaries(),
                ));
            });
            return;
        }
        let draw = |second: u32| {
            let mut words = [[0; TILE]; PER_BLOCK];
            let others = [second, light.pixel, light.kind.bright_echo()];
            blocks_from(first_cycle, others, light.key, &mut words);
            words
        };
        let mut numbers = [0u32; TILE];
        let per_cycle = light.signal.per_cycle();
        for part in 0..per_cycle.words() {
            let [low, high, ..] = draw(NUMBER_RUN + part);
            for (number, (low, high)) in numbers.iter_mut().zip(low.into_iter().zip(high)) {
                *number += per_cycle.part(u64::from(low) | u64::from(high) << 32);
            }
        }
        for (cycle, number) in (first_cycle..).zip(&mut numbers) {
            if cycle >= config.laser_cycles || !light.sends_echo_in(cycle) {
                *number = 0;
            }
        }
        let end = stream.cycle_start(config.laser_cycles);
        let spad_shift = u32::BITS - config.spads.grid.bits();
        let starts: [Time; TILE] =
            std::array::from_fn(|lane| stream.cycle_start(first_cycle + lane as u32));
        let mut after_fs = [0.0; TILE];
        self.photons.iter_mut().for_each(Vec::clear);
        for photon in 0..numbers.into_iter().max().unwrap_or(0) {
            let words = draw(2 * photon);
            let [lows, highs, ..] = &words;
            displacements(&light.gaussian, [lows, highs], &mut after_fs);
            let of_shape = light.shape.as_ref();
            if let Some((shape, words)) = of_shape.map(|shape| (shape, draw(2 * photon + 1))) {
                for lane in (0..TILE).filter(|&lane| numbers[lane] > photon) {
                    after_fs[lane] += shape.draw(words.map(|row| row[lane]));
                }
            }
            for lane in (0..TILE).filter(|&lane| numbers[lane] > photon) {
                let after = Time::from_fs(light.arrival_fs + nearest(after_fs[lane]));
                let time = starts[lane] + after;
                let (low, high) = (lows[lane], highs[lane]);
                let spad = (u64::from(high) >> spad_shift) as u8;
                let cycle = first_cycle + lane as u32;
                if (Time::ZERO..end).contains(&time) && light.keeps_signal(cycle, spad, [low, high])
                {
                    self.photons[lane].push(Photon::new(time, spad, light.has_secondaries()));
                }
            }
        }
    }
}

/// Gaussian draws of photons from their low and high words.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1"
))]
fn displacements(
    gaussian: &NormalSampler,
    [lows, highs]: [&[u32; TILE]; 2],
    after_fs: &mut [f64; TILE],
) {
    for ((&low, &high), after_fs) in lows.iter().zip(highs).zip(after_fs) {
        *after_fs = gaussian.draw(u64::from(low) | u64::from(high) << 32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::light::{Echo, PixelLight};
    use crate::photon::pulse::PulseShape;
    use crate::photon::{PhotonStream, SpadModel, StreamConfig};
    use crate::units::Frequency;
    use proptest::prelude::*;

    /// The photons of one laser cycle's echo, one after the other.
    fn one_by_one(light: &PixelStream<'_>, cycle: u32) -> Vec<Photon> {
        let config = &light.stream.config;
        if !light.has_listed_echo() || !light.sends_echo_in(cycle) || cycle >= config.laser_cycles {
            return Vec::new();
        }
        let start = light.stream.cycle_start(cycle);
        let end = light.stream.cycle_start(config.laser_cycles);
        let words = |second: u32| {
            let counter = [cycle, second, light.pixel, light.kind.bright_echo()];
            rand_philox::philox4x32_10(counter, light.key)
        };
        let per_cycle = light.signal.per_cycle();
        let number = (0..per_cycle.words()).map(|part| {
            let [low, high, ..] = words(NUMBER_RUN + part);
            per_cycle.part(u64::from(low) | u64::from(high) << 32)
        });
        let photon = |photon: u32| {
            let [low, high, ..] = words(2 * photon);
            let mut after_fs = light.gaussian.draw(u64::from(low) | u64::from(high) << 32);
            if let Some(shape) = &light.shape {
                after_fs += shape.draw(words(2 * photon + 1));
            }
            let time = start + Time::from_fs(light.arrival_fs + nearest(after_fs));
            let spad = (u64::from(high) >> (u32::BITS - config.spads.grid.bits())) as u8;
            let is_one =
                time >= Time::ZERO && time < end && light.keeps_signal(cycle, spad, [low, high]);
            is_one.then(|| Photon::new(time, spad, light.has_secondaries()))
        };
        (0..number.sum::<u32>()).filter_map(photon).collect()
    }

    proptest! {
        #[test]
        fn echoes_side_by_side_are_those_drawn_one_by_one(
            seed: u64,
            pixel in 0u32..4096,
            laser_cycles in 1u32..100,
            photons in prop::collection::vec(0.0f64..90.0, 2..4),
            arrival_ns in prop_oneof![-2i64..2, 0i64..1310],
            is_measured: bool,
            afterpulse_probability in prop::sample::select(vec![0.0, 0.1]),
            asked in prop::collection::vec(0u32..110, 1..30),
        ) {
            let shape = PulseShape::new(Time::from_ps(500), &[0.0, 3.0, 2.0, 1.0, 0.5]).unwrap();
            let stream = PhotonStream::new(&StreamConfig {
                seed,
                clock: Frequency::from_hz(384_000_000),
                stop_periods: 500,
                laser_cycles,
                lead: Time::ZERO,
                pulse_sigma: Time::from_ps(800),
                pulse_shape: is_measured.then_some(shape),
                energy_spread: 0.0,
                spads: SpadModel { afterpulse_probability, ..SpadModel::default() },
            });
            let mut light = PixelLight::background(8e6);
            for (later, &photons) in (0..).zip(&photons) {
                light = light.with_echo(Echo::new(photons, Time::from_ns(arrival_ns + 7 * later)));
            }
            for part in stream.parts(pixel, &light) {
                let mut listed = ListedEchoes::default();
                for &cycle in &asked {
                    prop_assert_eq!(listed.photons(&part, cycle), &one_by_one(&part, cycle)[..]);
                }
            }
        }
    }
}
