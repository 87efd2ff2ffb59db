//! Echoes that one light explains and those that none does, full bins, and reasons why range walk is left.

use super::*;
use crate::chip::{EventType, Exposure, FrontEnd, Overflow, SensorConfig, hslidar_delay_line};
use crate::ranging::{EchoLight, Response};
use crate::units::Time;
use rand::{RngExt, SeedableRng, rngs::StdRng};

const PULSE_SIGMA: Time = Time::from_ps(1_911);

/// A finder for the default exposure of 1000 laser cycles.
fn finder(config: &SensorConfig, stop_periods: u32) -> EchoFinder {
    let law = WindowLaw::new(config, &Exposure::new(config, stop_periods, 1000));
    EchoFinder::new(&law, PULSE_SIGMA, &DepthOptions::default()).unwrap()
}

#[test]
fn echoes_that_are_no_pulse_are_wide_or_told() {
    let config = SensorConfig::default();
    let finder = finder(&config, 520);
    let response = Response::new(&config, finder.bin_s, PULSE_SIGMA);
    let counts = |light: EchoLight| -> Vec<u32> {
        response
            .chances(&light)
            .iter()
            .map(|p| (1000.0 * p).round() as u32)
            .collect()
    };
    let sigma_bins = response.pulse_sigma_bins;
    let echo = EchoLight {
        position_bins: 6.3,
        signal: 2.0,
        background_per_bin: 0.02,
        sigma_bins,
    };
    let found = finder
        .find(&counts(EchoLight {
            sigma_bins: 2.0 * sigma_bins,
            ..echo
        }))
        .unwrap();
    let light = found.light.expect("a wide echo");
    assert!(
        (light.sigma_bins / sigma_bins - 2.0).abs() < 0.1,
        "{light:?}"
    );
    assert!((light.position_bins - 6.3).abs() < 0.02, "{light:?}");
    // Another echo besides is not the first one's.
    let both: Vec<u32> = counts(echo)
        .iter()
        .zip(counts(EchoLight {
            position_bins: 12.5,
            signal: 0.5,
            ..echo
        }))
        .map(|(a, b)| a + b - 20)
        .collect();
    let found = finder.find(&both).unwrap();
    assert!(
        (found.position_bins - 6.3).abs() < 0.03 && found.bound_bins.is_some(),
        "{found:?}"
    );
    // It is a return of its own.
    let other = found.others[0].expect("another echo");
    assert!((other.position_bins - 12.5).abs() < 0.05, "{other:?}");
    assert!((other.photons / 0.5 - 1.0).abs() < 0.1, "{other:?}");
    assert!(other.bound_bins.unwrap() < 0.2 && found.others[1..] == [None; 2]);
    // A road deeper than the window is no echo.
    let mut deep = [20u32; 16];
    deep[3..10].fill(400);
    let found = finder.find(&deep).unwrap();
    assert_eq!(
        (found.walk_left, found.bound_bins),
        (Some(WalkLeft::NotOneEcho), None)
    );
    assert_eq!(found.position_bins, found.peak.position_bins);
    // Nor are bins that go up and down.
    let mut uneven = [20u32; 16];
    uneven[5..10].copy_from_slice(&[400, 100, 420, 100, 400]);
    assert_eq!(
        finder.find(&uneven).unwrap().walk_left,
        Some(WalkLeft::NotOneEcho)
    );
    // What is left of a strong echo that came before the window looks like a weak one.
    let before = counts(EchoLight {
        position_bins: -1.4,
        signal: 100.0,
        ..echo
    });
    let found = finder.find(&before).unwrap();
    let is_right = (found.position_bins + 1.4).abs() < 4.0 * found.bound_bins.unwrap_or(0.0);
    assert!(
        is_right
            || matches!(
                found.walk_left,
                Some(WalkLeft::Ambiguous | WalkLeft::CutEcho)
            ),
        "{found:?}"
    );
}

#[test]
fn what_keeps_range_walk_in_is_named() {
    let mut counts = [20u32; 16];
    counts[6..9].copy_from_slice(&[150, 400, 150]);
    let default = SensorConfig::default;
    let joined = SensorConfig {
        front_end: FrontEnd::OrTree,
        ..default()
    };
    let walk_left = |config: &SensorConfig, stop_periods| {
        finder(config, stop_periods)
            .find(&counts)
            .unwrap()
            .walk_left
    };
    assert_eq!(walk_left(&default(), 520), None);
    assert_eq!(walk_left(&joined, 520), Some(WalkLeft::JoinedSpads));
    assert_eq!(walk_left(&default(), 18), Some(WalkLeft::ShortLaserCycle));
    let law = WindowLaw::new(default(), &Exposure::new(&default(), 520, 1000));
    let measured = EchoWidth {
        is_gaussian: false,
        ..PULSE_SIGMA.into()
    };
    let found = EchoFinder::new(&law, measured, &DepthOptions::default()).unwrap();
    let found = found.find(&counts).unwrap();
    assert_eq!(
        (found.walk_left, found.bound_bins),
        (Some(WalkLeft::PulseShape), None)
    );
    let sensor = hslidar_delay_line();
    let mut counts = [20u32; 8];
    counts[3..5].copy_from_slice(&[300, 200]);
    let found = finder(&sensor, 520).find_in(&counts, &[1.0; 8]).unwrap();
    assert_eq!(found.walk_left, Some(WalkLeft::DelayLine));
    let names = std::collections::BTreeSet::from(WalkLeft::ALL.map(WalkLeft::name));
    assert!(names.len() == WalkLeft::ALL.len() && !names.contains(""));
}

#[test]
fn full_bins_are_told_from_peaks() {
    let sensor = |event_type, threshold| SensorConfig {
        bin_bits: 5,
        event_type,
        threshold,
        ..SensorConfig::default()
    };
    let finder = self::finder(&sensor(EventType::Greater, 0), 520);
    let saturated = |counts: &[u32]| finder.find(counts).unwrap().is_saturated;
    assert!(saturated(&[31; 16]));
    let mut counts = [2; 16];
    counts[6..10].copy_from_slice(&[31, 31, 31, 18]);
    assert!(saturated(&counts));
    // One full bin, or two, still tell a place.
    for (full, position_bins) in [(7..9, 7.5), (8..9, 8.0)] {
        counts[6..10].copy_from_slice(&[9, 20, 20, 18]);
        counts[full].fill(31);
        let found = finder.find(&counts).unwrap();
        let told = (found.position_bins, found.bound_bins, found.walk_left);
        assert_eq!(told, (position_bins, Some(1.0), Some(WalkLeft::ToABin)));
        assert!(!found.is_saturated);
    }
    counts[8] = 30;
    assert!(!saturated(&counts));
    assert_eq!(finder.find(&[0; 16]), None);
    // Where light makes bins count less, those beside an echo are full.
    let finder = self::finder(&sensor(EventType::Less, 1), 520);
    let mut counts = [31; 16];
    counts[7..10].copy_from_slice(&[20, 3, 18]);
    assert!(finder.find(&counts).unwrap().is_saturated);
    let counts = counts.map(|n| n.min(30));
    assert!(!finder.find(&counts).unwrap().is_saturated);
}

/// SPADs that strong light paralyses at the window's first edges count almost as they would under a weaker echo: the fit from
/// one start ends there and explains nothing.
#[test]
fn strong_light_is_sought_in_more_than_one_place() {
    for (dead_time_ns, position_bins, signal) in [
        (1.3, -0.1, 600.0),
        (1.3, -0.01, 600.0),
        (1.5, -0.1, 413.0),
        (1.5, -0.2, 600.0),
    ] {
        let config = SensorConfig {
            dead_time_ns,
            paralysable: true,
            afterpulse_probability: 0.05,
            crosstalk_probability: 0.04,
            ..SensorConfig::default()
        };
        let finder = finder(&config, 520);
        let response = Response::new(&config, finder.bin_s, PULSE_SIGMA);
        let light = EchoLight {
            position_bins,
            signal,
            background_per_bin: 0.006,
            sigma_bins: response.pulse_sigma_bins,
        };
        let counts: Vec<u32> = response
            .chances(&light)
            .iter()
            .map(|p| (1000.0 * p).round() as u32)
            .collect();
        let found = finder.find(&counts).unwrap();
        let off = (found.position_bins - position_bins).abs();
        assert!(
            found.walk_left.is_none() && off < 0.002,
            "{light:?} {found:?}"
        );
    }
}

#[test]
fn an_echo_is_lost_where_it_is_strong_and_its_place_open() {
    let finder = finder(&SensorConfig::default(), 520);
    let is_lost = |signal: f64, bound_bins: f64| {
        let light = EchoLight {
            position_bins: 7.0,
            signal,
            background_per_bin: 0.02,
            sigma_bins: 0.74,
        };
        finder.is_lost(&CorrectedPeak { light, bound_bins })
    };
    // A photon for every SPAD, and a quarter of a bin.
    let found =
        [(15.9, 0.26), (16.1, 0.26), (16.1, 0.24)].map(|(signal, bound)| is_lost(signal, bound));
    assert_eq!(found, [false, true, false]);
}

/// A pulse much shorter than its bin says nothing of the place within it: that is the middle, give or take the root of a twelfth.
#[test]
fn an_echo_within_a_bin_is_known_to_that_bin() {
    let config = SensorConfig::default();
    let law = WindowLaw::new(&config, &Exposure::new(&config, 520, 1000));
    let finder = EchoFinder::new(&law, Time::ZERO, &DepthOptions::default()).unwrap();
    let mut counts = vec![20; config.bins];
    counts[4] = 400;
    let found = finder.find(&counts).unwrap();
    assert!((found.position_bins - 4.0).abs() < 0.05, "{found:?}");
    let bound_bins = found.bound_bins.unwrap();
    assert!((0.2..0.3).contains(&bound_bins), "{found:?}");
}

/// Of 1000 macropixels that see one echo, dim or bright, few have a return that is not there: the false-alarm rate is one of them.
#[test]
fn one_echo_is_one_return() {
    let config = SensorConfig::default();
    let finder = finder(&config, 520);
    let response = Response::new(&config, finder.bin_s, PULSE_SIGMA);
    let mut random = StdRng::seed_from_u64(1);
    for (signal, background_per_bin) in [(0.3, 0.02), (3.0, 0.02), (3.0, 0.3), (30.0, 0.1)] {
        let mut wrong = 0;
        for _ in 0..1000 {
            let chances = response.chances(&EchoLight {
                position_bins: random.random_range(3.0..12.0),
                signal,
                background_per_bin,
                sigma_bins: response.pulse_sigma_bins,
            });
            let mut count =
                |chance: &f64| (0..1000).filter(|_| random.random_bool(*chance)).count() as u32;
            let counts: Vec<u32> = chances.iter().map(&mut count).collect();
            let found = finder.find(&counts).unwrap();
            wrong += usize::from(found.others[0].is_some());
        }
        assert!(wrong <= 5, "{signal} {background_per_bin}: {wrong}");
    }
}

#[test]
fn counts_that_may_have_wrapped_have_no_bound() {
    let sensor = |bin_bits| SensorConfig {
        bin_bits,
        overflow: Overflow::Wrap,
        ..SensorConfig::default()
    };
    let echo = EchoLight {
        position_bins: 6.3,
        signal: 0.3,
        background_per_bin: 0.02,
        sigma_bins: PULSE_SIGMA.as_s() / finder(&sensor(14), 520).bin_s,
    };
    for (bin_bits, has_bound) in [(14, true), (9, true), (7, false), (6, false)] {
        let config = sensor(bin_bits);
        let finder = finder(&config, 520);
        let response = Response::new(&config, finder.bin_s, PULSE_SIGMA);
        let chances = response.chances(&echo);
        let counts = chances.iter().map(|p| (1000.0 * p).round() as u32);
        let counts: Vec<u32> = counts.map(|n| n % (1 << bin_bits)).collect();
        let found = finder.find(&counts).unwrap();
        assert!(found.is_significant, "{bin_bits}: {counts:?}");
        assert_eq!(
            found.bound_bins.is_some(),
            has_bound,
            "{bin_bits}: {counts:?}"
        );
        let why = (!has_bound).then_some(WalkLeft::NotOneEcho);
        assert_eq!(found.walk_left, why);
    }
}
