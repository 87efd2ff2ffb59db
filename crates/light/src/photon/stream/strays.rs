//! Single photons of another laser's pulses, in the slots or the laser cycles that somebody looks at.
//!
//! A photon's number, time and SPAD are a function of its pulse and its number in it. So whoever asks for any part of an exposure sees
//! the same.

use std::ops::Range;

use super::foreign::Foreign;
use super::group::{CycleGroup, GroupPlace};
use super::part::{PixelStream, nearest};

/// From there on second counter words give the number of a pulse's photons.
const NUMBER_RUN: u32 = 1 << 31;

/// A photon of another laser.
pub(super) struct Stray {
    pub cycle: u32,
    slot: u32,
    /// After the start of its laser cycle.
    pub time_fs: i64,
    pub spad: u8,
}

impl PixelStream<'_> {
    /// Appends the photons of another laser that fall into some slots of a group.
    pub(super) fn push_foreign(
        &self,
        foreign: &Foreign,
        group: CycleGroup,
        slots: Range<u32>,
        kept: &mut Vec<(GroupPlace, i64)>,
    ) {
        let (stream, all) = (self.stream, self.stream.slots);
        if slots.is_empty() {
            return;
        }
        let reach_fs = self.gaussian.reach().ceil() as i64;
        let within_fs =
            all.start_fs(slots.start) - reach_fs..all.start_fs(slots.end) + reach_fs + 2;
        let cycle_fs = stream.cycle_fs();
        // A pulse near the end of a laser cycle has photons in the next one, and the other way round.
        let wraps = [0, cycle_fs, -cycle_fs].into_iter().filter(|moved_fs| {
            let moved = within_fs.start + moved_fs..within_fs.end + moved_fs;
            *moved_fs == 0 || (moved.start < cycle_fs + 2 && moved.end > 0)
        });
        let first = group.first_cycle();
        let cycles = first..first.saturating_add(group.cycles());
        let (schedule, delay_fs) = (&foreign.schedule, foreign.delay_fs);
        let of_group = schedule.arriving_in(cycles.clone(), delay_fs, reach_fs);
        let arriving = wraps.flat_map(|moved_fs| {
            let moved_fs = (within_fs.start + moved_fs).max(0)..within_fs.end + moved_fs;
            schedule.arriving_within(moved_fs, delay_fs)
        });
        let mut pulses: Vec<u32> = arriving.filter(|pulse| of_group.contains(pulse)).collect();
        pulses.sort_unstable();
        pulses.dedup();
        for pulse in pulses {
            self.each_stray(foreign, pulse, cycles.clone(), |stray| {
                if slots.contains(&stray.slot) {
                    kept.push((
                        group.place_of(stray.cycle - first, stray.spad),
                        stray.time_fs,
                    ));
                }
            });
        }
    }

    /// All photons of another laser in some laser cycles.
    pub(super) fn strays_in(
        &self,
        foreign: &Foreign,
        cycles: Range<u32>,
        mut each: impl FnMut(Stray),
    ) {
        let reach_fs = self.gaussian.reach().ceil() as i64;
        let schedule = &foreign.schedule;
        let pulses = schedule.arriving_in(cycles.clone(), foreign.delay_fs, reach_fs);
        for pulse in pulses {
            self.each_stray(foreign, pulse, cycles.clone(), &mut each);
        }
    }

    /// The photons of a pulse that come in some laser cycles of the exposure.
    fn each_stray(
        &self,
        foreign: &Foreign,
        pulse: u32,
        cycles: Range<u32>,
        mut each: impl FnMut(Stray),
    ) {
        let stream = self.stream;
        let arrival = foreign.schedule.arrival(pulse, foreign.delay_fs);
        let Some((of_pulse, since_fs)) = arrival else {
            return;
        };
        if of_pulse.saturating_add(1) < cycles.start || of_pulse > cycles.end {
            return;
        }
        let words = |second: u32| {
            let counter = [pulse, second, self.pixel, self.kind.bright_echo()];
            rand_philox::philox4x32_10(counter, self.key)
        };
        let joined = |low: u32, high: u32| u64::from(low) | u64::from(high) << 32;
        let per_pulse = self.signal.per_cycle();
        let number = (0..per_pulse.words()).map(|part| {
            let [low, high, ..] = words(NUMBER_RUN + part);
            per_pulse.part(joined(low, high))
        });
        let spad_shift = u32::BITS - stream.config.spads.grid.bits();
        let length_fs =
            |cycle: u32| (stream.cycle_start(cycle + 1) - stream.cycle_start(cycle)).as_fs();
        let (slots, begins_fs) = (stream.slots, stream.ends_fs().start);
        for photon in 0..number.sum::<u32>() {
            let [low, high, spad, _] = words(photon);
            let spad = (u64::from(spad) >> spad_shift) as u8;
            if !self.keeps_signal(of_pulse, spad, [low, high]) {
                continue;
            }
            let unit = ((joined(low, high) >> 11) as f64 + 0.5) * 0.5f64.powi(53);
            let mut time_fs = since_fs + nearest(self.gaussian.quantile(unit * foreign.share));
            let mut cycle = of_pulse;
            while time_fs < begins_fs && cycle > 0 {
                cycle -= 1;
                time_fs += length_fs(cycle);
            }
            while time_fs >= length_fs(cycle) + begins_fs {
                time_fs -= length_fs(cycle);
                cycle += 1;
            }
            let is_before = cycle == 0 && time_fs < 0;
            if is_before || cycle >= stream.config.laser_cycles || !cycles.contains(&cycle) {
                continue;
            }
            // As far from the ends of its slot as background photons.
            let slot = slots.slot_at(time_fs).min(slots.count - 1);
            let (start_fs, margin_fs) = (slots.start_fs(slot), slots.margin_fs());
            let last_fs = start_fs + slots.length_fs() - margin_fs - 1;
            let time_fs = time_fs.clamp(start_fs + margin_fs, last_fs);
            each(Stray {
                cycle,
                slot,
                time_fs,
                spad,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::photon::{
        OtherLaser, PhotonStream, PixelLight, PulseTrain, SpadModel, StreamConfig,
    };
    use crate::units::{Frequency, Time};

    /// As many photons as an oncoming lidar sends straight into the lens, in a pulse in which SPADs are ready again.
    #[test]
    fn all_photons_of_an_oncoming_laser_are_drawn() {
        const PULSES: f64 = 20.0;
        let stream = PhotonStream::new(&StreamConfig {
            seed: 5,
            clock: Frequency::from_hz(80_000_000),
            stop_periods: 1000,
            laser_cycles: PULSES as u32,
            lead: Time::ZERO,
            pulse_sigma: Time::from_ns(1),
            pulse_shape: None,
            energy_spread: 0.0,
            spads: SpadModel::with_dead_time(Time::from_ns(8)),
        });
        let drawn = |photons: f64| {
            let train = PulseTrain {
                laser: OtherLaser {
                    number: 0,
                    period_s: 12.5e-6,
                    phase: Some(0.3),
                    dither_s: 0.0,
                    own_dither_s: 0.0,
                },
                photons,
                delay: Time::from_ns(100),
                sigma: Time::from_ps(1_900),
            };
            let light = PixelLight::dark().with_train(train);
            stream.pixel_events(0, &light).drawn as f64 / PULSES
        };
        for photons in [1e3, 1e4, 3e4, 9e4] {
            let found = drawn(photons);
            let noise = 5.0 * (photons / PULSES).sqrt();
            assert!((found - photons).abs() < noise, "{found} of {photons}");
        }
    }
}
