//! The photon stream: every avalanche of a pixel in an exposure, drawn in any order.
//!
//! An exposure is a row of laser cycles. Cycle n spans the half-open time from
//! `clock.periods(n · stop_periods)` to the start of cycle n + 1; the laser fires at its start,
//! with the rising edge of STOP. In each cycle a pixel detects
//!
//! * a Poisson number of signal photons, Gaussian in time around the arrival of the echo,
//! * a Poisson number of background photons and dark counts, uniform over the cycle,
//!
//! each on one of the 16 SPADs with equal chance. Photons outside their cycle are discarded.
//! One cycle's photons are a pure function of (seed, pixel, cycle), so engines may draw any cycle
//! of any pixel on any thread and see the same light. Only the dead time ties cycles together;
//! it is applied afterwards, over the whole exposure.
//!
//! Limits of the model: rates are detection rates and constant within an exposure; no
//! afterpulses, no crosstalk, no spread of dead time or dark counts between SPADs; an echo that
//! outlasts its cycle is cut off and not carried into the next one; timing jitter of SPADs and
//! electronics belongs into the pulse width.

use rand_philox::Philox;

use super::random::{Poisson, Purpose, normal, random_stream};
use super::spad::{SPADS, SpadEvent, apply_dead_time};
use crate::units::{Frequency, Time};

/// What all pixels of an exposure share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StreamConfig {
    /// Equal seeds give equal photons.
    pub seed: u64,
    /// The chip's CLK.
    pub clock: Frequency,
    /// CLK periods from one STOP edge to the next, at least 1; a cycle stays below 2⁵⁹ fs (576 s).
    pub stop_periods: u32,
    /// Laser cycles of the exposure.
    pub laser_cycles: u32,
    /// Standard deviation of a signal photon's time: laser pulse and all jitter.
    pub pulse_sigma: Time,
    /// How long a SPAD stays blind after an avalanche.
    pub dead_time: Time,
}

impl StreamConfig {
    /// Start of laser cycle `cycle`, exact to the femtosecond.
    #[inline]
    pub fn cycle_start(&self, cycle: u32) -> Time {
        self.clock
            .periods(i64::from(cycle) * i64::from(self.stop_periods))
    }

    /// Nominal length of a cycle, s.
    pub fn cycle_s(&self) -> f64 {
        f64::from(self.stop_periods) / self.clock.as_hz()
    }
}

/// The light on one macropixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelLight {
    /// Mean number of detected signal photons per laser cycle, finite and ≥ 0.
    pub signal_per_cycle: f64,
    /// Centre of the echo after the start of its cycle.
    pub arrival: Time,
    /// Mean rate of detected background photons and dark counts of all SPADs, finite and ≥ 0.
    pub background_hz: f64,
}

impl PixelLight {
    /// Mean number of photons and dark counts in a laser cycle of `config`.
    pub fn photons_per_cycle(&self, config: &StreamConfig) -> f64 {
        self.signal_per_cycle + self.background_hz * config.cycle_s()
    }
}

/// The avalanches of one macropixel in one exposure.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PixelPhotons {
    /// Rising edges of the SPAD wires, sorted by (time, SPAD).
    pub events: Vec<SpadEvent>,
    /// Photons and dark counts that fell into the exposure, seen or not.
    pub drawn: u64,
    /// How many of them met a blind SPAD: `drawn - events.len()`.
    pub lost_to_dead_time: u64,
}

/// The photons of one pixel before dead time, by laser cycle.
///
/// Holds what does not change between cycles, so that a cycle costs little more than its photons.
#[derive(Debug, Clone)]
pub struct PixelStream {
    config: StreamConfig,
    pixel: u32,
    arrival_fs: i64,
    sigma_fs: f64,
    signal: Poisson,
    background: Poisson,
    /// One cycle's photons as `time after its start in fs << SPAD_BITS | SPAD`, which sort fast.
    photons: Vec<u64>,
}

const SPAD_BITS: u32 = SPADS.trailing_zeros();
const TIME_BITS: u32 = 64 - SPAD_BITS;

impl PixelStream {
    /// Prepares pixel number `pixel` under `light`.
    pub fn new(config: &StreamConfig, pixel: u32, light: &PixelLight) -> Self {
        debug_assert!(config.stop_periods > 0, "a cycle needs a length");
        PixelStream {
            config: *config,
            pixel,
            arrival_fs: light.arrival.as_fs(),
            sigma_fs: config.pulse_sigma.as_fs() as f64,
            signal: Poisson::new(light.signal_per_cycle),
            background: Poisson::new(light.background_hz * config.cycle_s()),
            photons: Vec::new(),
        }
    }

    /// Appends the photons of laser cycle `cycle` to `events`, sorted by (time, SPAD); two
    /// photons may agree in both. Returns how many.
    pub fn append_cycle(&mut self, cycle: u32, events: &mut Vec<SpadEvent>) -> usize {
        let start = self.config.cycle_start(cycle);
        let length_fs = (self.config.cycle_start(cycle + 1) - start).as_fs();
        debug_assert!(length_fs < 1 << (TIME_BITS - 1), "cycle of {length_fs} fs");
        self.draw(cycle, length_fs);
        self.photons.sort_unstable();
        events.extend(self.photons.iter().map(|&photon| SpadEvent {
            time: start + Time::from_fs((photon >> SPAD_BITS) as i64),
            spad: (photon & (SPADS as u64 - 1)) as u8,
        }));
        self.photons.len()
    }

    fn draw(&mut self, cycle: u32, length_fs: i64) {
        let mut random = random_stream(self.config.seed, Purpose::Photons, self.pixel, cycle);
        let background = self.background.draw(&mut random);
        let signal = self.signal.draw(&mut random);
        self.photons.clear();
        for _ in 0..background {
            self.photons.push(uniform_photon(&mut random, length_fs));
        }
        for _ in 0..signal {
            let deviation_fs = (self.sigma_fs * normal(&mut random)).round() as i64;
            let spad = u64::from(random.next_u32() >> (32 - SPAD_BITS));
            let time_fs = self.arrival_fs.saturating_add(deviation_fs);
            if (0..length_fs).contains(&time_fs) {
                self.photons.push((time_fs as u64) << SPAD_BITS | spad);
            }
        }
    }
}

/// A photon uniform over the cycle and the SPADs: the word's low bits choose the SPAD, the others
/// the time.
#[inline]
fn uniform_photon(random: &mut Philox, length_fs: i64) -> u64 {
    let word = random.next_u64();
    let fraction = word >> SPAD_BITS;
    let time_fs = (u128::from(fraction) * length_fs as u128) >> TIME_BITS;
    (time_fs as u64) << SPAD_BITS | word & (SPADS as u64 - 1)
}

/// The photons of a whole array in an exposure.
#[derive(Debug, Clone)]
pub struct PhotonStream {
    config: StreamConfig,
}

impl PhotonStream {
    /// Prepares the stream.
    pub fn new(config: &StreamConfig) -> Self {
        PhotonStream { config: *config }
    }

    /// What it was made of.
    pub fn config(&self) -> &StreamConfig {
        &self.config
    }

    /// All avalanches of macropixel number `pixel` under `light` in the exposure, dead time applied.
    pub fn pixel_events(&self, pixel: u32, light: &PixelLight) -> PixelPhotons {
        let config = &self.config;
        let mut stream = PixelStream::new(config, pixel, light);
        let expected = light.photons_per_cycle(config) * f64::from(config.laser_cycles);
        // Five standard deviations of room; the cap keeps a huge request from failing up front.
        let room = (expected + 5.0 * expected.sqrt() + 16.0).min(1e7);
        let mut events = Vec::with_capacity(room as usize);
        let drawn = (0..config.laser_cycles)
            .map(|cycle| stream.append_cycle(cycle, &mut events) as u64)
            .sum();
        let lost_to_dead_time = apply_dead_time(&mut events, config.dead_time);
        PixelPhotons {
            events,
            drawn,
            lost_to_dead_time,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn config() -> StreamConfig {
        StreamConfig {
            seed: 1,
            clock: Frequency::from_hz(384_000_000),
            stop_periods: 512,
            laser_cycles: 2000,
            pulse_sigma: Time::from_ps(1_700),
            dead_time: Time::ZERO,
        }
    }

    const LIGHT: PixelLight = PixelLight {
        signal_per_cycle: 0.5,
        arrival: Time::from_ns(400),
        background_hz: 8e6,
    };

    /// Is a Poisson count within five standard deviations of its mean?
    fn plausible(count: u64, mean: f64) -> bool {
        (count as f64 - mean).abs() < 5.0 * mean.sqrt()
    }

    #[test]
    fn rates_are_as_asked() {
        let config = config();
        let cycles = f64::from(config.laser_cycles);
        let background = PhotonStream::new(&config).pixel_events(
            3,
            &PixelLight {
                signal_per_cycle: 0.0,
                ..LIGHT
            },
        );
        let mean = LIGHT.background_hz * config.cycle_s() * cycles;
        assert!(
            plausible(background.drawn, mean),
            "{} {mean}",
            background.drawn
        );
        let signal = PhotonStream::new(&config).pixel_events(
            3,
            &PixelLight {
                background_hz: 0.0,
                ..LIGHT
            },
        );
        assert!(
            plausible(signal.drawn, 0.5 * cycles),
            "{} signal photons",
            signal.drawn
        );
    }

    #[test]
    fn background_is_even_over_spads_and_time() {
        let config = config();
        let light = PixelLight {
            signal_per_cycle: 0.0,
            ..LIGHT
        };
        let photons = PhotonStream::new(&config).pixel_events(0, &light);
        let mut by_spad = [0u64; SPADS];
        let mut by_eighth = [0u64; 8];
        let period_fs = config.clock.period().as_fs();
        for e in &photons.events {
            by_spad[usize::from(e.spad)] += 1;
            let in_cycle = (e.time.as_fs() / period_fs) as usize % 512;
            by_eighth[in_cycle / 64] += 1;
        }
        let n = photons.events.len() as f64;
        assert!(
            by_spad.iter().all(|&c| plausible(c, n / 16.0)),
            "{by_spad:?}"
        );
        assert!(
            by_eighth.iter().all(|&c| plausible(c, n / 8.0)),
            "{by_eighth:?}"
        );
    }

    #[test]
    fn the_echo_has_its_centre_and_width() {
        let config = config();
        let light = PixelLight {
            signal_per_cycle: 5.0,
            background_hz: 0.0,
            ..LIGHT
        };
        let mut stream = PixelStream::new(&config, 9, &light);
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for cycle in 0..config.laser_cycles {
            let mut events = Vec::new();
            stream.append_cycle(cycle, &mut events);
            for e in events {
                let x = (e.time - config.cycle_start(cycle) - light.arrival).as_ns();
                n += 1.0;
                sum += x;
                squares += x * x;
            }
        }
        let mean = sum / n;
        let sigma = (squares / n - mean * mean).sqrt();
        assert!(mean.abs() < 5.0 * 1.7 / f64::sqrt(n), "mean {mean} ns");
        assert!((sigma / 1.7 - 1.0).abs() < 0.03, "sigma {sigma} ns");
    }

    #[test]
    fn any_cycle_can_be_drawn_alone() {
        let config = config();
        let whole = PhotonStream::new(&config).pixel_events(5, &LIGHT);
        let mut backwards = Vec::new();
        for cycle in (0..config.laser_cycles).rev() {
            PixelStream::new(&config, 5, &LIGHT).append_cycle(cycle, &mut backwards);
        }
        backwards.sort();
        assert_eq!(
            apply_dead_time(&mut backwards, config.dead_time),
            whole.lost_to_dead_time
        );
        assert_eq!(backwards, whole.events);
    }

    #[test]
    fn neighbours_in_pixel_cycle_and_seed_are_independent() {
        let config = StreamConfig {
            laser_cycles: 1000,
            ..config()
        };
        let counts = |seed: u64, pixel: u32| -> Vec<f64> {
            let mut stream = PixelStream::new(&StreamConfig { seed, ..config }, pixel, &LIGHT);
            (0..=config.laser_cycles)
                .map(|cycle| stream.append_cycle(cycle, &mut Vec::new()) as f64)
                .collect()
        };
        let here = counts(1, 100);
        let correlation = |other: &[f64]| {
            let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
            let (a, b) = (mean(&here), mean(other));
            let dot = |u: &[f64], ub: f64, v: &[f64], vb: f64| -> f64 {
                u.iter().zip(v).map(|(x, y)| (x - ub) * (y - vb)).sum()
            };
            dot(&here, a, other, b) / (dot(&here, a, &here, a) * dot(other, b, other, b)).sqrt()
        };
        for other in [&counts(1, 101)[..], &counts(2, 100)[..], &here[1..]] {
            let r = correlation(other);
            assert!(r.abs() < 5.0 / 1000f64.sqrt(), "correlation {r}");
        }
    }

    #[test]
    fn dead_time_carries_over_from_cycle_to_cycle() {
        // 20 ns cycles, one avalanche blinds a SPAD for five of them.
        let config = StreamConfig {
            clock: Frequency::from_hz(100_000_000),
            stop_periods: 2,
            dead_time: Time::from_ns(100),
            ..config()
        };
        let light = PixelLight {
            signal_per_cycle: 0.0,
            arrival: Time::ZERO,
            background_hz: 1e9,
        };
        let photons = PhotonStream::new(&config).pixel_events(0, &light);
        let per_spad_hz = light.background_hz / SPADS as f64;
        let seen = 1.0 / (1.0 + per_spad_hz * 100e-9);
        let fraction = photons.events.len() as f64 / photons.drawn as f64;
        assert!((fraction / seen - 1.0).abs() < 0.05, "{fraction} {seen}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn events_are_sorted_inside_the_exposure_and_heed_the_dead_time(
            seed: u64,
            pixel: u32,
            hz in 50_000_000u64..1_000_000_000,
            stop_periods in 1u32..600,
            signal_per_cycle in 0.0f64..20.0,
            arrival_ns in -10i64..3000,
            background_hz in 0.0f64..1e8,
            dead_ns in 0i64..200,
        ) {
            let config = StreamConfig {
                seed,
                clock: Frequency::from_hz(hz),
                stop_periods,
                laser_cycles: 50,
                pulse_sigma: Time::from_ns(2),
                dead_time: Time::from_ns(dead_ns),
            };
            let light = PixelLight {
                signal_per_cycle,
                arrival: Time::from_ns(arrival_ns),
                background_hz,
            };
            let photons = PhotonStream::new(&config).pixel_events( pixel, &light);
            prop_assert_eq!(photons.events.len() as u64 + photons.lost_to_dead_time, photons.drawn);
            prop_assert!(photons.events.is_sorted());
            prop_assert!(photons.events.iter().all(|e| e.time >= Time::ZERO
                && e.time < config.cycle_start(config.laser_cycles)));
            for spad in 0..SPADS as u8 {
                let times: Vec<_> =
                    photons.events.iter().filter(|e| e.spad == spad).map(|e| e.time).collect();
                prop_assert!(times.windows(2).all(|w| w[1] > w[0] + config.dead_time));
            }
        }
    }
}
