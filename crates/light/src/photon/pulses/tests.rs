//! Statistics of the photon stream, at fixed seeds.

use proptest::prelude::*;

use super::*;
use crate::photon::{
    CROSSTALK_DELAY, CycleGroup, DeadTimeLaw, EchoLaw, GROUP, PulseShape, SpadGrid, SpadModel,
    StreamConfig,
};
use crate::units::Frequency;

fn config() -> StreamConfig {
    StreamConfig {
        seed: 1,
        clock: Frequency::from_hz(384_000_000),
        stop_periods: 500,
        laser_cycles: 2000,
        lead: Time::from_ps(1_100),
        pulse_sigma: Time::from_ps(1_700),
        pulse_shape: None,
        energy_spread: 0.0,
        spads: SpadModel::default(),
    }
}

const LIGHT: PixelLight = PixelLight::echo(0.5, Time::from_ns(400)).with_background(8e6);

const BACKGROUND: PixelLight = PixelLight::background(8e6);

/// Is a Poisson count within five standard deviations of its mean?
fn plausible(count: u64, mean: f64) -> bool {
    (count as f64 - mean).abs() < 5.0 * mean.sqrt()
}

/// Largest distance of the samples' distribution from `cumulative`, times √n (Kolmogorov and Smirnov).
fn kolmogorov(mut samples: Vec<f64>, cumulative: impl Fn(f64) -> f64) -> f64 {
    samples.sort_by(f64::total_cmp);
    let n = samples.len() as f64;
    let distance = |(i, &x): (usize, &f64)| {
        let c = cumulative(x);
        (c - i as f64 / n).abs().max((c - (i + 1) as f64 / n).abs())
    };
    samples.iter().enumerate().map(distance).fold(0.0, f64::max) * n.sqrt()
}

/// Exceeded once in a thousand samples.
const KOLMOGOROV_LIMIT: f64 = 1.95;

/// χ² of counts that should all have the same mean, in standard deviations from its own mean.
fn chi_square(counts: &[u64]) -> f64 {
    let mean = counts.iter().sum::<u64>() as f64 / counts.len() as f64;
    let square = |&c: &u64| (c as f64 - mean).powi(2) / mean;
    let freedom = (counts.len() - 1) as f64;
    (counts.iter().map(square).sum::<f64>() - freedom) / (2.0 * freedom).sqrt()
}

#[test]
fn rates_are_as_asked() {
    let stream = PhotonStream::new(&config());
    let cycles = f64::from(config().laser_cycles);
    let background = stream.pixel_events(3, &BACKGROUND);
    let mean = LIGHT.background_hz() * config().cycle_s() * cycles;
    assert!(
        plausible(background.drawn, mean),
        "{} {mean}",
        background.drawn
    );
    let signal = LIGHT.with_background(0.0);
    let signal = stream.pixel_events(3, &signal);
    assert!(plausible(signal.drawn, 0.5 * cycles), "{}", signal.drawn);
    let dark = PixelLight::dark();
    assert_eq!(stream.pixel_events(3, &dark), PixelPhotons::default());
}

#[test]
fn background_is_even_over_spads_cycles_and_time() {
    let config = config();
    let photons = PhotonStream::new(&config).pixel_events(0, &BACKGROUND);
    let mut by_spad = [0u64; 16];
    let mut by_cycle = vec![0u64; 2000];
    let mut times = Vec::new();
    let cycle_fs = config.cycle_s() * 1e15;
    for e in &photons.events {
        by_spad[usize::from(e.spad)] += 1;
        let cycles = e.time.as_fs() as f64 / cycle_fs;
        by_cycle[cycles as usize] += 1;
        times.push(cycles.fract());
    }
    for counts in [&by_spad[..], &by_cycle] {
        let chi = chi_square(counts);
        assert!(chi.abs() < 4.0, "{chi}");
    }
    let d = kolmogorov(times, |x| x);
    assert!(d < KOLMOGOROV_LIMIT, "{d}");
}

#[test]
fn background_gaps_are_exponential_also_across_slots_and_cycles() {
    let photons = PhotonStream::new(&config()).pixel_events(0, &BACKGROUND);
    let gaps = photons
        .events
        .windows(2)
        .map(|w| (w[1].time - w[0].time).as_s());
    let d = kolmogorov(gaps.collect(), |x| -(-LIGHT.background_hz() * x).exp_m1());
    assert!(d < KOLMOGOROV_LIMIT, "{d}");
}

#[test]
fn numbers_in_disjoint_intervals_are_poisson() {
    // Mean and variance of the photons in a fifth of every cycle, echo included.
    let config = StreamConfig {
        laser_cycles: 20_000,
        ..config()
    };
    let photons = PhotonStream::new(&config).pixel_events(8, &LIGHT);
    let mut counts = vec![0.0; 20_000];
    let cycle_fs = config.cycle_s() * 1e15;
    for e in &photons.events {
        let cycles = e.time.as_fs() as f64 / cycle_fs;
        if (0.2..0.4).contains(&cycles.fract()) {
            counts[cycles as usize] += 1.0;
        }
    }
    let n = counts.len() as f64;
    let mean = counts.iter().sum::<f64>() / n;
    let variance = counts.iter().map(|c| (c - mean) * (c - mean)).sum::<f64>() / n;
    let expected = 0.2 * LIGHT.background_hz() * config.cycle_s() + LIGHT.signal_per_cycle();
    assert!((mean - expected).abs() < 5.0 * (expected / n).sqrt());
    assert!((variance / mean - 1.0).abs() < 5.0 * (2.0 / n).sqrt());
}

#[test]
fn the_echo_is_a_gaussian_around_its_arrival() {
    let config = config();
    let light = PixelLight::echo(5.0, LIGHT.arrival());
    let photons = PhotonStream::new(&config).pixel_events(9, &light);
    let cycle = Time::from_fs(config.clock.whole_fs(500));
    let late = photons.events.iter().map(|e| {
        let cycles = e.time.as_fs() / cycle.as_fs();
        (e.time - config.cycle_start(cycles as u32) - light.arrival()).as_ns()
    });
    let d = kolmogorov(late.collect(), |x| libm::erfc(-x / 1.7 / 2f64.sqrt()) / 2.0);
    assert!(d < KOLMOGOROV_LIMIT, "{d}");
}

#[test]
fn a_measured_pulse_adds_to_the_jitter() {
    let shape = PulseShape::new(Time::from_ns(2), &[0.0, 3.0, 1.0, 0.5, 0.0]).unwrap();
    let config = StreamConfig {
        pulse_shape: Some(shape.clone()),
        energy_spread: 0.0,
        ..config()
    };
    let light = PixelLight::echo(5.0, LIGHT.arrival());
    let photons = PhotonStream::new(&config).pixel_events(9, &light);
    let late = photons.events.iter().map(|e| {
        let cycles = e.time.as_fs() / config.clock.whole_fs(500);
        (e.time - config.cycle_start(cycles as u32) - light.arrival()).as_ns()
    });
    // The convolution, summed over slices of the pulse.
    let slices = 2000;
    let d = kolmogorov(late.collect(), |x| {
        let slice_start = |i: i32| Time::from_fs(8_000_000 / i64::from(slices) * i64::from(i));
        (0..slices)
            .map(|i| {
                let mass = shape.cumulative(slice_start(i + 1)) - shape.cumulative(slice_start(i));
                let middle = (slice_start(i) + slice_start(i + 1)).as_ns() / 2.0;
                mass * libm::erfc(-(x - middle) / 1.7 / 2f64.sqrt()) / 2.0
            })
            .sum()
    });
    assert!(d < KOLMOGOROV_LIMIT, "{d}");
}

#[test]
fn any_part_can_be_drawn_alone() {
    let stream = PhotonStream::new(&config());
    let pixel = &stream.parts(5, &LIGHT)[0];
    let mut parts = Vec::new();
    let mut draw = Draw::default();
    let cuts = [0, 1, 160, 189, 190, 191, stream.slots.count];
    let groups: Vec<_> = stream.groups().collect();
    for group in groups.into_iter().rev() {
        for cut in cuts.windows(2).rev() {
            pixel.draw(group, &stream.span(cut[0]..cut[1]), &mut draw);
            parts.extend(draw.photons(pixel, GROUP).filter_map(|(place, time_fs)| {
                let (cycle, spad) = group.split(place);
                let cycle = group.first_cycle() + cycle;
                let time = stream.config().cycle_start(cycle) + Time::from_fs(time_fs);
                (cycle < stream.config().laser_cycles).then_some(SpadEvent { time, spad })
            }));
        }
    }
    parts.sort_unstable();
    let whole = stream.pixel_events(5, &LIGHT);
    assert_eq!(parts.len() as u64, whole.drawn);
    parts.dedup();
    assert_eq!(parts, whole.events);
}

#[test]
fn a_longer_exposure_begins_with_the_same_photons() {
    let events = |laser_cycles| {
        let config = StreamConfig {
            laser_cycles,
            ..config()
        };
        PhotonStream::new(&config).pixel_events(5, &LIGHT).events
    };
    let (short, long) = (events(700), events(1500));
    assert_eq!(short, long[..short.len()]);
}

/// Photons in two parts of the first, a middle and the last laser cycle are as many as the law of echoes says.
#[test]
fn what_overruns_a_cycle_falls_into_its_neighbours() {
    let (cycles, cycle_ns) = (12u32, 125.0);
    let clock = Frequency::from_hz(384_000_000);
    let stop_periods = 48;
    for (arrival_ns, sigma_ns, signal_per_cycle) in [
        (-2.0, 2.0, 0.7),
        (1.0, 2.0, 5.0),
        (124.0, 3.0, 0.7),
        (126.0, 3.0, 5.0),
        (60.0, 90.0, 1.0),
        (60.0, 90.0, 5.0),
        (0.0, 0.0, 0.7),
        (0.0, 0.0, 5.0),
    ] {
        let config = StreamConfig {
            clock,
            stop_periods,
            laser_cycles: cycles,
            pulse_sigma: Time::from_fs((sigma_ns * 1e6) as i64),
            spads: SpadModel::with_dead_time(Time::ZERO),
            ..config()
        };
        let light = PixelLight::echo(signal_per_cycle, Time::from_fs((arrival_ns * 1e6) as i64));
        let law = EchoLaw {
            cycle_fs: cycle_ns * 1e6,
            arrival_fs: arrival_ns * 1e6,
            sigma_fs: sigma_ns * 1e6,
        };
        let stream = PhotonStream::new(&config);
        let pixels = 3000;
        let mut counts = [[0u64; 2]; 3];
        for pixel in 0..pixels {
            // Nothing is lost without dead time, but for photons at the same femtosecond.
            let photons = stream.pixel_events(pixel, &light);
            for event in &photons.events {
                let ns = event.time.as_ns();
                let cycle = (ns / cycle_ns) as u32;
                let which = [0, 5, cycles - 1]
                    .iter()
                    .position(|&wanted| wanted == cycle);
                if let Some(which) = which {
                    let is_late = ns % cycle_ns >= 3.0;
                    counts[which][usize::from(is_late)] += 1;
                }
            }
        }
        for (number, counts) in [0, 5, cycles - 1].into_iter().zip(counts) {
            let parts = [(0.0, 3e6), (3e6, cycle_ns * 1e6)];
            for (count, (from_fs, to_fs)) in counts.into_iter().zip(parts) {
                let share = law.share(number, cycles, from_fs, to_fs);
                let photons = f64::from(pixels) * signal_per_cycle * share;
                // A pulse without width fires each SPAD once.
                let fired = 16.0 * -libm::expm1(-signal_per_cycle / 16.0);
                let expected = if sigma_ns == 0.0 {
                    photons * fired / signal_per_cycle
                } else {
                    photons
                };
                let off = (count as f64 - expected).abs();
                assert!(
                    off <= 5.0 * expected.sqrt() + 1e-6 * f64::from(pixels),
                    "{arrival_ns} {sigma_ns} cycle {number} from {from_fs}: {count}, not {expected}"
                );
            }
        }
    }
}

#[test]
fn neighbours_in_pixel_slot_group_and_seed_are_independent() {
    // Numbers of photons by cycle within the group.
    let counts = |seed: u64, pixel: u32, group: u32, slot: u32| -> Vec<f64> {
        let config = StreamConfig { seed, ..config() };
        let stream = PhotonStream::new(&config);
        let light = BACKGROUND.with_background(40e6);
        let mut draw = Draw::default();
        let parts = stream.parts(pixel, &light);
        let pixel = &parts[0];
        pixel.draw(
            CycleGroup::of_cycle(group * GROUP, SpadGrid::default()),
            &stream.span(slot..slot + 1),
            &mut draw,
        );
        let mut counts = vec![0.0; GROUP as usize];
        for (place, _) in draw.photons(pixel, GROUP) {
            counts[draw.group.split(place).0 as usize] += 1.0;
        }
        counts
    };
    let here = counts(1, 100, 1, 8);
    let correlation = |other: &[f64]| {
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let (a, b) = (mean(&here), mean(other));
        let dot = |u: &[f64], ub: f64, v: &[f64], vb: f64| -> f64 {
            u.iter().zip(v).map(|(x, y)| (x - ub) * (y - vb)).sum()
        };
        dot(&here, a, other, b) / (dot(&here, a, &here, a) * dot(other, b, other, b)).sqrt()
    };
    for other in [
        counts(2, 100, 1, 8),
        counts(1, 101, 1, 8),
        counts(1, 100, 2, 8),
        counts(1, 100, 1, 9),
        here[1..].to_vec(),
    ] {
        let r = correlation(&other);
        assert!(r.abs() < 4.0 / f64::from(GROUP).sqrt(), "correlation {r}");
    }
}

/// Fraction of photons that make edges at this rate per SPAD, in cycles much shorter than the dead time.
fn edge_share(law: DeadTimeLaw, per_spad_hz: f64) -> f64 {
    let config = StreamConfig {
        clock: Frequency::from_hz(100_000_000),
        stop_periods: 2,
        // Few photons survive a paralysable dead time.
        laser_cycles: 20_000,
        spads: SpadModel {
            law,
            ..SpadModel::with_dead_time(Time::from_ns(100))
        },
        ..config()
    };
    let light = BACKGROUND.with_background(per_spad_hz * 16.0);
    let photons = PhotonStream::new(&config).pixel_events(0, &light);
    photons.events.len() as f64 / photons.drawn as f64
}

#[test]
fn dead_time_carries_over_from_cycle_to_cycle_by_either_law() {
    for load in [0.2, 1.0, 5.0] {
        let hz = load / 100e-9;
        let non_paralysable = edge_share(DeadTimeLaw::NonParalysable, hz) * (1.0 + load);
        let paralysable = edge_share(DeadTimeLaw::Paralysable, hz) / (-load).exp();
        assert!((non_paralysable - 1.0).abs() < 0.05, "{non_paralysable}");
        assert!((paralysable - 1.0).abs() < 0.12, "{paralysable}");
    }
}

#[test]
fn secondaries_come_after_their_avalanches_in_a_stream_too() {
    let spads = SpadModel {
        afterpulse_probability: 0.05,
        afterpulse_time: Time::from_ns(5),
        crosstalk_probability: 0.02,
        ..SpadModel::with_dead_time(Time::from_ns(8))
    };
    let config = StreamConfig {
        spads,
        laser_cycles: 20_000,
        ..config()
    };
    let light = BACKGROUND.with_background(1e6);
    let photons = PhotonStream::new(&config).pixel_events(0, &light);
    let more =
        (photons.events.len() as f64 + photons.lost_to_dead_time as f64) / photons.drawn as f64;
    // Three of four directions lead to a neighbour on average: 48 of 64.
    let expected = 1.0 + 0.05 + 0.02 * 48.0 / 64.0;
    assert!((more - expected).abs() < 0.004, "{more} {expected}");
    let prompt = photons
        .events
        .windows(2)
        .filter(|w| w[1].time - w[0].time == CROSSTALK_DELAY);
    let share = prompt.count() as f64 / photons.drawn as f64;
    assert!((share - 0.015).abs() < 0.002, "{share}");
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
        afterpulse_probability in prop_oneof![Just(0.0), 0.0f64..0.5],
    ) {
        let config = StreamConfig {
            seed,
            clock: Frequency::from_hz(hz),
            stop_periods,
            laser_cycles: 50,
            lead: Time::ZERO,
            pulse_sigma: Time::from_ns(2),
            pulse_shape: None,
            energy_spread: 0.0,
            spads: SpadModel {
                afterpulse_probability,
                afterpulse_time: Time::from_ns(10),
                ..SpadModel::with_dead_time(Time::from_ns(dead_ns))
            },
        };
        let light = PixelLight::echo(signal_per_cycle, Time::from_ns(arrival_ns)).with_background(background_hz);
        let photons = PhotonStream::new(&config).pixel_events(pixel, &light);
        if afterpulse_probability == 0.0 {
            prop_assert_eq!(photons.events.len() as u64 + photons.lost_to_dead_time, photons.drawn);
        }
        prop_assert!(photons.events.is_sorted());
        prop_assert!(photons.events.iter().all(|e| e.time >= Time::ZERO
            && e.time < config.cycle_start(config.laser_cycles)));
        for spad in 0..16u8 {
            let times: Vec<_> =
                photons.events.iter().filter(|e| e.spad == spad).map(|e| e.time).collect();
            prop_assert!(times.windows(2).all(|w| w[1] > w[0] + config.spads.dead_time));
        }
    }
}

/// Counts of a laser cycle are Poisson about its energy, which all macropixels share.
#[test]
fn pulses_differ_in_energy() {
    const CYCLES: u32 = 2000;
    // Drawn by groups, and by laser cycle.
    for photons in [4.0, 12.0] {
        let light = PixelLight::echo(photons, Time::from_ns(400));
        let counts = |energy_spread: f64, pixel: u32| {
            let stream = PhotonStream::new(&StreamConfig {
                energy_spread,
                ..config()
            });
            let mut counts = vec![0.0; CYCLES as usize];
            for event in stream.pixel_events(pixel, &light).events {
                counts[(event.time.as_ns() / (500.0 / 0.384)) as usize] += 1.0;
            }
            counts
        };
        let covariance = |a: &[f64], b: &[f64]| {
            let products = a.iter().zip(b).map(|(a, b)| (a - photons) * (b - photons));
            products.sum::<f64>() / f64::from(CYCLES)
        };
        for spread in [0.0, 0.3] {
            let (one, other) = (counts(spread, 1), counts(spread, 2));
            let (of_energy, of_all) = ((spread * photons).powi(2), photons);
            let error = 5.0 * (of_all + of_energy) * (2.0 / f64::from(CYCLES)).sqrt();
            let mean = one.iter().sum::<f64>() / f64::from(CYCLES);
            let mean_error = 5.0 * ((of_all + of_energy) / f64::from(CYCLES)).sqrt();
            assert!((mean - photons).abs() < mean_error, "{spread} {mean}");
            let variance = covariance(&one, &one);
            assert!((variance - of_all - of_energy).abs() < error, "{variance}");
            let shared = covariance(&one, &other);
            assert!((shared - of_energy).abs() < error, "{shared} {of_energy}");
        }
    }
}
