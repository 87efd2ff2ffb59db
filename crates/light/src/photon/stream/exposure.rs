//! What the photons of all macropixels of an exposure have in common: its laser cycles, their slots, and the laser pulse.

use std::ops::Range;
use std::sync::{Arc, Mutex};

use super::group::CycleGroup;
use super::laser_cycles::LaserCycles;
use super::schedule::Schedule;
use super::slot::Slots;
use crate::photon::light::{OtherLaser, PixelLight};
use crate::photon::pulse::{PulseSampler, PulseShape};
use crate::photon::quantile::NormalSampler;
use crate::photon::random::philox_key;
use crate::photon::spad::SpadModel;
use crate::units::{Frequency, Time};

/// Farther away than any photon comes in its cycle, fs.
pub(super) const FAR_FS: i64 = 1 << 60;

/// A part of every laser cycle.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Span {
    /// Whose background photons belong to it.
    pub slots: Range<u32>,
    /// When photons of the cycle's own echo belong to it, fs after the start of the cycle; that may be outside the cycle.
    pub within_fs: Range<i64>,
}

/// Another laser, and when it sends its pulses.
type KnownLaser = (OtherLaser, Arc<Schedule>);

/// The photons of a whole array in an exposure.
#[derive(Debug, Clone)]
pub struct PhotonStream {
    pub(super) config: StreamConfig,
    pub(super) key: [u32; 2],
    laser_cycles: LaserCycles,
    /// Slots of a laser cycle.
    pub slots: Slots,
    pub(super) gaussian: NormalSampler,
    pub(super) shape: Option<Arc<PulseSampler>>,
    /// Of other lasers, which all macropixels see.
    schedules: Arc<Mutex<Vec<KnownLaser>>>,
}

impl PhotonStream {
    /// Prepares the stream.
    pub fn new(config: &StreamConfig) -> Self {
        debug_assert!(config.stop_periods > 0, "a cycle needs a length");
        PhotonStream {
            key: philox_key(config.seed),
            laser_cycles: LaserCycles {
                number: config.laser_cycles,
                whole_fs: config.clock.whole_fs(i64::from(config.stop_periods)),
                starts: config.clock.every(config.stop_periods),
            },
            slots: Slots::new(config.clock, config.stop_periods, config.lead),
            gaussian: NormalSampler::new(config.pulse_sigma.as_fs() as f64),
            shape: config.pulse_shape.as_ref().map(sampler),
            schedules: Arc::default(),
            config: config.clone(),
        }
    }

    /// When another laser sends its pulses.
    pub(super) fn schedule(&self, laser: &OtherLaser) -> Arc<Schedule> {
        let mut known = self.schedules.lock().expect("nobody panics with it");
        if let Some((_, schedule)) = known.iter().find(|(other, _)| other == laser) {
            return Arc::clone(schedule);
        }
        let schedule = Arc::new(Schedule::new(laser, self.config.seed, self.laser_cycles));
        known.push((*laser, Arc::clone(&schedule)));
        schedule
    }

    /// What it was made of.
    pub fn config(&self) -> &StreamConfig {
        &self.config
    }

    /// The key of its random words.
    pub(in crate::photon) fn key(&self) -> [u32; 2] {
        self.key
    }

    /// SPADs of a macropixel.
    #[inline]
    pub fn spads(&self) -> usize {
        self.config.spads.grid.spads()
    }

    /// The whole femtoseconds of a laser cycle.
    #[inline]
    pub fn cycle_fs(&self) -> i64 {
        self.laser_cycles.whole_fs
    }

    /// Start of laser cycle `cycle`, exact to the femtosecond.
    #[inline]
    pub fn cycle_start(&self, cycle: u32) -> Time {
        self.laser_cycles.start(cycle)
    }

    /// When the photons of a cycle begin and end, fs after its start.
    pub fn ends_fs(&self) -> Range<i64> {
        -self.slots.lead_fs..self.cycle_fs() - self.slots.lead_fs
    }

    /// What these slots are. Of the cycle's own echo, all that comes before the cycle begins with the first slot, and all
    /// that comes after it ends with the last one.
    pub(crate) fn span(&self, slots: Range<u32>) -> Span {
        let from_fs = match slots.start {
            0 => -FAR_FS,
            first => self.slots.start_fs(first),
        };
        let until_fs = if slots.end == self.slots.count {
            FAR_FS
        } else {
            self.slots.start_fs(slots.end)
        };
        Span {
            within_fs: from_fs..until_fs,
            slots,
        }
    }

    /// Groups of the exposure; the last one may outlast it.
    pub fn groups(&self) -> impl Iterator<Item = CycleGroup> + use<> {
        CycleGroup::groups_until(self.config.laser_cycles, self.config.spads.grid)
    }
}

/// Draws times of a measured pulse.
pub(super) fn sampler(shape: &PulseShape) -> Arc<PulseSampler> {
    Arc::new(PulseSampler::measured(shape))
}

/// Background photons of a macropixel per second from which on a light is drawn by laser cycle. Time of 4096 windows
/// of 16 bins in 1600 laser cycles with 8 ns of dead time, by slots and groups | by laser cycle: 0.5 | 1.9 s at 80
/// Mcounts/s, 9.3 | 3.6 s at 400, on a busy machine; between them it is a guess.
const BRIGHT_BACKGROUND_HZ: f64 = 160e6;

/// The same for photons of an echo a laser cycle: 1.0 | 2.0 s at 5, 52 | 3.6 s at 60. Of several echoes the brightest counts: fog sends many back from
/// its first metres, which no window sees.
const BRIGHT_SIGNAL: f64 = 8.0;

/// And where a SPAD is blind for more than this share of the time, so that its state before a window is often unknown: as
/// much as by the background above.
const BRIGHT_BLIND_SHARE: f64 = 0.08;

/// And where a laser cycle has as many background photons: a group of 2048 laser cycles would hold 4 million photons and more. At
/// [`BRIGHT_BACKGROUND_HZ`] these are laser cycles of 12.8 µs.
const BRIGHT_CYCLE: f64 = 2048.0;

/// What all macropixels of an exposure share.
#[derive(Debug, Clone, PartialEq)]
pub struct StreamConfig {
    /// Equal seeds give equal photons.
    pub seed: u64,
    /// The chip's CLK.
    pub clock: Frequency,
    /// CLK periods from one STOP edge to the next, at least 1.
    pub stop_periods: u32,
    /// Laser cycles of the exposure.
    pub laser_cycles: u32,
    /// How much before their laser cycle the photons of a cycle begin, at least 0 and less than a CLK period. Where it
    /// puts slots on a chip's bins, those are counted fastest.
    pub lead: Time,
    /// Standard deviation of a signal photon's time: a Gaussian laser pulse and all jitter.
    pub pulse_sigma: Time,
    /// A measured laser pulse, whose times add to those of the Gaussian; its time 0 comes at the echo's arrival.
    pub pulse_shape: Option<PulseShape>,
    /// Standard deviation of a pulse's energy relative to the mean, 0 to 0.5. Energies are uniform within √3 times as much: bounded, so
    /// that photons can be drawn at the greatest one and thinned.
    pub energy_spread: f64,
    /// How the SPADs answer.
    pub spads: SpadModel,
}

impl StreamConfig {
    /// Start of laser cycle `cycle`, exact to the femtosecond.
    #[cfg(test)]
    pub(crate) fn cycle_start(&self, cycle: u32) -> Time {
        self.clock
            .periods(i64::from(cycle) * i64::from(self.stop_periods))
    }

    /// The greatest energy of a pulse, relative to the mean.
    pub(super) fn greatest_energy(&self) -> f64 {
        1.0 + 3f64.sqrt() * self.energy_spread
    }

    /// Rising edges of a macropixel's SPADs to be expected in the exposure, at most: as many as photons, and as dead times.
    pub fn most_edges(&self, light: &PixelLight) -> f64 {
        let causes = 1.0 + self.spads.afterpulse_probability + self.spads.crosstalk_probability;
        let photons = self.most_photons_per_cycle(light) * causes;
        let dead_times = self.spads.grid.spads() as f64
            * (self.cycle_s() / self.spads.shortest_dead_time().as_s() + 1.0);
        photons.min(dead_times) * f64::from(self.laser_cycles)
    }

    /// Mean number of photons and dark counts that are drawn for a laser cycle, at most: of the brightest segment, and before
    /// any are thinned.
    pub fn most_photons_per_cycle(&self, light: &PixelLight) -> f64 {
        let others = light.trains_hz() * self.cycle_s();
        let signal = light.signal_per_cycle() * self.greatest_energy();
        signal + light.background_hz() * self.cycle_s() + others
    }

    /// Nominal length of a cycle, s.
    pub fn cycle_s(&self) -> f64 {
        f64::from(self.stop_periods) / self.clock.as_hz()
    }

    /// Whether this light is drawn by laser cycle, all parts of it.
    pub(super) fn is_bright(&self, light: &PixelLight) -> bool {
        let background_hz = light.background_hz();
        let blind = background_hz / self.spads.grid.spads() as f64 * self.spads.dead_time.as_s();
        background_hz > BRIGHT_BACKGROUND_HZ
            || light.brightest_echo() > BRIGHT_SIGNAL
            || blind > BRIGHT_BLIND_SHARE
            || background_hz * self.cycle_s() > BRIGHT_CYCLE
    }
}
