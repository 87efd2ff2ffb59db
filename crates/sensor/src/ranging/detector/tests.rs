//! Detectors are held to histograms that are drawn photon by photon, and SPAD by SPAD: depths and glasses here, counts in `means`.

mod means;

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use super::*;

const BINS: usize = 64;
const LASER_CYCLES: u32 = 2000;

fn detector(counted: CountedEvents) -> Detector {
    Detector {
        edges_s: Detector::equal_edges_s(BINS, 20e-9, 1e-9),
        pulse_sigma_s: 0.8e-9,
        counted,
        laser_cycles: Some(LASER_CYCLES),
        coincidence: None,
        most_counts: None,
        crosstalk: Vec::new(),
    }
}

/// Bins whose lengths go from a half to one and a half of the mean and back.
fn unequal(counted: CountedEvents) -> Detector {
    let mut edges_s = vec![20e-9];
    for bin in 0..BINS {
        let length_s = 1e-9 * (1.0 + 0.5 * libm::sin(bin as f64 * 0.9));
        edges_s.push(edges_s[bin] + length_s);
    }
    Detector {
        edges_s,
        ..detector(counted)
    }
}

fn together(counted: CountedEvents, spads: u32) -> Detector {
    let coincidence = Coincidence {
        spads,
        within_s: 4e-9,
        lit_spads: 16,
    };
    Detector {
        coincidence: Some(coincidence),
        ..detector(counted)
    }
}

/// Light in photons of a laser cycle.
#[derive(Debug, Clone, Copy)]
struct Light {
    /// Arrival of the echo after the centre of the pulse has left, s.
    place_s: f64,
    signal: f64,
    background: f64,
    /// A cover glass, and when its light comes.
    glass: f64,
    glass_s: f64,
}

const GLASS_S: f64 = 24e-9;

impl Light {
    fn new(place_s: f64, signal: f64, background: f64) -> Self {
        Light {
            place_s,
            signal,
            background,
            glass: 0.0,
            glass_s: GLASS_S,
        }
    }

    fn depth_m(&self) -> f64 {
        0.5 * SPEED_OF_LIGHT_M_PER_S * self.place_s
    }

    fn of_histogram(&self) -> SurfaceLight {
        let cycles = f64::from(LASER_CYCLES);
        SurfaceLight {
            depth_m: self.depth_m(),
            photons: self.signal * cycles,
            background: self.background * cycles,
        }
    }
}

/// A number of standard normal distribution: the sum of twelve even ones, less six.
fn normal(random: &mut StdRng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

fn poisson(random: &mut StdRng, mean: f64) -> u32 {
    let (mut number, mut product) = (0, random.random::<f64>());
    while product > libm::exp(-mean) {
        product *= random.random::<f64>();
        number += 1;
    }
    number
}

fn histogram(random: &mut StdRng, detector: &Detector, light: &Light) -> Vec<u32> {
    let bins = detector.bins();
    let mut counts = vec![0; bins];
    let (first_s, end_s) = (detector.edges_s[0], detector.edges_s[bins]);
    let Coincidence {
        spads,
        within_s,
        lit_spads: of,
    } = detector.coincidence.unwrap_or(Coincidence {
        spads: 1,
        within_s: 0.0,
        lit_spads: 1,
    });
    // Background comes before the first bin, too.
    let before_s = 2.0 * within_s;
    let background = light.background * (1.0 + before_s / (end_s - first_s));
    for _ in 0..LASER_CYCLES {
        let mut times = Vec::new();
        for (place_s, mean) in [(light.place_s, light.signal), (light.glass_s, light.glass)] {
            for _ in 0..poisson(random, mean) {
                times.push(place_s + detector.pulse_sigma_s * normal(random));
            }
        }
        for _ in 0..poisson(random, background) {
            let share = random.random::<f64>();
            times.push(first_s - before_s + share * (end_s - first_s + before_s));
        }
        times.sort_by(f64::total_cmp);
        let mut last_s = vec![f64::NEG_INFINITY; of as usize];
        for time in times {
            let is_high = |last_s: &&f64| time - **last_s < within_s;
            let spad = random.random_range(0..of as usize);
            let high = last_s.iter().filter(is_high).count();
            let is_event = !is_high(&&last_s[spad]) && high + 1 == spads as usize;
            last_s[spad] = time;
            if !is_event {
                continue;
            }
            let bin = detector.edges_s.partition_point(|&edge_s| edge_s <= time);
            // An event before the first bin or after the last one is none that the detector sees.
            if (1..=bins).contains(&bin) {
                counts[bin - 1] += 1;
                if detector.counted == CountedEvents::First {
                    break;
                }
            }
        }
    }
    let most = detector.most_counts.unwrap_or(u32::MAX);
    counts.iter().map(|&count| count.min(most)).collect()
}

/// How depths scatter about the truth, all in bounds: the root of the mean square, the mean, and the greatest.
fn scatter(detector: &Detector, seed: u64, repeats: usize, light: &Light) -> [f64; 3] {
    let mut random = StdRng::seed_from_u64(seed);
    let (mut squares, mut sum, mut most) = (0.0, 0.0, 0.0_f64);
    for repeat in 0..repeats {
        let light = Light {
            place_s: light.place_s + 0.37e-9 * repeat as f64 % 10e-9,
            ..*light
        };
        let counts = histogram(&mut random, detector, &light);
        detector.check(&counts).unwrap();
        let found = detector.returns(&counts, &DepthOptions::default());
        let first = found.unwrap_or_else(|why| panic!("{light:?}: {why}"))[0];
        let bound_m = first
            .bound_m
            .unwrap_or_else(|| panic!("{light:?}: {first:?}"));
        let off = (first.depth_m - light.depth_m()) / bound_m;
        squares += off * off;
        sum += off;
        most = most.max(off.abs());
    }
    let all = repeats as f64;
    [(squares / all).sqrt(), sum / all, most]
}

fn assert_within_bounds(detector: &Detector, seed: u64, light: &Light) {
    const REPEATS: usize = 40;
    let [rms, mean, most] = scatter(detector, seed, REPEATS, light);
    let is_right = rms < 1.4 && mean.abs() < 4.0 / (REPEATS as f64).sqrt() && most < 5.0;
    assert!(is_right, "{detector:?} {light:?}: {rms} {mean} {most}");
}

#[test]
fn depths_of_photons_drawn_one_by_one_keep_their_bounds() {
    for counted in [CountedEvents::Every, CountedEvents::First] {
        for detector in [detector(counted), unequal(counted)] {
            for (signal, background) in [(0.05, 0.2), (0.3, 0.5), (1.5, 0.5)] {
                assert_within_bounds(&detector, 1, &Light::new(45e-9, signal, background));
            }
        }
    }
}

/// Of 2000 laser cycles some 40 reach the echo; in the first bins nothing is.
#[test]
fn first_events_behind_much_background_leave_no_depth_where_nothing_is() {
    let detector = detector(CountedEvents::First);
    let light = Light::new(59e-9, 0.8, 6.4);
    let mut random = StdRng::seed_from_u64(5);
    let (mut found, mut known) = (0, 0);
    for _ in 0..200 {
        let counts = histogram(&mut random, &detector, &light);
        let Ok(returns) = detector.returns(&counts, &DepthOptions::default()) else {
            continue;
        };
        found += 1;
        if let Some(bound_m) = returns[0].bound_m {
            known += 1;
            let off_m = (returns[0].depth_m - light.depth_m()).abs();
            assert!(off_m < 5.0 * bound_m, "{returns:?}");
        }
    }
    assert!(found > 50 && 2 * known > found, "{found} {known}");
}

#[test]
fn depths_of_spads_that_fire_together_keep_their_bounds() {
    for counted in [CountedEvents::Every, CountedEvents::First] {
        for (spads, signal, background) in
            [(2, 0.5, 0.5), (2, 1.5, 2.0), (2, 4.0, 1.0), (3, 4.0, 4.0)]
        {
            let light = Light::new(45e-9, signal, background);
            assert_within_bounds(&together(counted, spads), 2, &light);
        }
    }
}

/// Outputs that are high for a time as short as the pulse: some light is so strong under it that more of it makes fewer events.
#[test]
fn depths_of_spads_with_short_outputs_have_a_bound_that_they_keep() {
    for within_s in [1e-9, 2e-9] {
        let coincidence = Coincidence {
            spads: 2,
            within_s,
            lit_spads: 16,
        };
        let detector = Detector {
            coincidence: Some(coincidence),
            ..detector(CountedEvents::Every)
        };
        for signal in [0.5, 0.7, 1.0, 1.5] {
            for background in [0.0, 1.0, 4.0] {
                assert_within_bounds(&detector, 7, &Light::new(45e-9, signal, background));
            }
        }
    }
}

#[test]
fn a_surface_beside_a_cover_glass_keeps_its_bound() {
    for counted in [CountedEvents::Every, CountedEvents::First] {
        for mut detector in [detector(counted), unequal(counted)] {
            let glass = Light::new(GLASS_S, 0.3, 0.0);
            let every = Detector {
                counted: CountedEvents::Every,
                ..detector.clone()
            };
            detector.crosstalk = every.expected(&glass.of_histogram());
            for place_s in [27e-9, 45e-9] {
                let light = Light {
                    glass: 0.3,
                    ..Light::new(place_s, 0.15, 0.3)
                };
                assert_within_bounds(&detector, 3, &light);
            }
            let alone = Light {
                glass: 0.3,
                ..Light::new(45e-9, 0.0, 0.3)
            };
            let mut random = StdRng::seed_from_u64(4);
            let options = DepthOptions::default();
            for _ in 0..50 {
                let counts = histogram(&mut random, &detector, &alone);
                let none = detector.returns(&counts, &options);
                assert_eq!(none, Err(NoReturn::NoSignificantPeak));
            }
        }
    }
}

#[test]
fn a_surface_beside_a_glass_keeps_its_bound_where_spads_fire_together() {
    let glass = 1.0;
    for spads in [2, 3] {
        let mut detector = together(CountedEvents::Every, spads);
        detector.crosstalk = photons_of_glass(&detector, GLASS_S, glass);
        for place_s in [27e-9, 45e-9] {
            let light = Light {
                glass,
                ..Light::new(place_s, 1.0, 1.0)
            };
            assert_within_bounds(&detector, 10, &light);
        }
        let alone = Light {
            glass,
            ..Light::new(45e-9, 0.0, 1.0)
        };
        let mut random = StdRng::seed_from_u64(11);
        for _ in 0..30 {
            let counts = histogram(&mut random, &detector, &alone);
            let none = detector.returns(&counts, &DepthOptions::default());
            assert_eq!(none, Err(NoReturn::NoSignificantPeak), "{detector:?}");
        }
        // The glass is no background that can be taken off: its photons make those of the surface count more.
        let near = Light {
            glass,
            ..Light::new(27e-9, 1.0, 1.0)
        };
        let counts = histogram(&mut random, &detector, &near);
        let with_glass = detector.expected(&near.of_histogram());
        assert!(
            detector.agreement(&counts, &with_glass).p > 1e-3,
            "{detector:?}"
        );
        let sole = |crosstalk: Vec<f64>, light: &Light| {
            let sole = Detector {
                crosstalk,
                ..detector.clone()
            };
            sole.expected(&light.of_histogram())
        };
        let of_glass = sole(detector.crosstalk.clone(), &Light::new(27e-9, 0.0, 0.0));
        let of_surface = sole(Vec::new(), &near);
        let sum: Vec<f64> = of_glass
            .iter()
            .zip(of_surface)
            .map(|(a, b)| a + b)
            .collect();
        assert!(detector.agreement(&counts, &sum).p < 1e-6, "{detector:?}");
    }
}

/// The mean of first events takes that too few SPADs fired before, and not when. Just behind a glass that moves depths by up to a bound.
#[test]
fn first_events_behind_a_glass_are_off_by_a_bound_at_most() {
    let mut detector = together(CountedEvents::First, 2);
    let glass = 0.3;
    detector.crosstalk = photons_of_glass(&detector, GLASS_S, glass);
    for place_s in [27e-9, 45e-9] {
        let light = Light {
            glass,
            ..Light::new(place_s, 1.0, 1.0)
        };
        let [rms, mean, most] = scatter(&detector, 10, 40, &light);
        assert!(
            rms < 1.6 && mean.abs() < 1.1 && most < 5.0,
            "{rms} {mean} {most}"
        );
    }
}

/// Photons of a glass in each bin of a histogram.
fn photons_of_glass(detector: &Detector, place_s: f64, photons: f64) -> Vec<f64> {
    let every = Detector {
        counted: CountedEvents::Every,
        coincidence: None,
        crosstalk: Vec::new(),
        ..detector.clone()
    };
    every.expected(&Light::new(place_s, photons, 0.0).of_histogram())
}

#[test]
fn bins_that_stop_have_no_bound_that_is_too_short() {
    let stops = Detector {
        most_counts: Some(255),
        ..detector(CountedEvents::Every)
    };
    let mut random = StdRng::seed_from_u64(5);
    let (mut saturated, mut depths) = (0, 0);
    for repeat in 0..40 {
        let light = Light::new(45e-9 + 0.37e-9 * f64::from(repeat), 1.5, 0.5);
        let counts = histogram(&mut random, &stops, &light);
        match stops.returns(&counts, &DepthOptions::default()) {
            Err(NoReturn::Saturated) => saturated += 1,
            Ok(found) => {
                let off_m = (found[0].depth_m - light.depth_m()).abs();
                let bound_m = found[0].bound_m.unwrap_or(f64::INFINITY);
                assert!(off_m < 5.0 * bound_m, "{light:?} {found:?}");
                depths += 1;
            }
            Err(why) => panic!("{light:?}: {why}"),
        }
    }
    assert!(saturated > 0, "{saturated} {depths}");
    let mut more = vec![0; BINS];
    more[3] = 256;
    assert!(stops.check(&more).is_err());
}

#[test]
fn background_alone_has_no_return_and_impossible_counts_are_refused() {
    let mut random = StdRng::seed_from_u64(6);
    let options = DepthOptions::default();
    for counted in [CountedEvents::Every, CountedEvents::First] {
        for detector in [detector(counted), unequal(counted), together(counted, 2)] {
            for _ in 0..50 {
                let dark = histogram(&mut random, &detector, &Light::new(40e-9, 0.0, 0.8));
                let none = detector.returns(&dark, &options);
                assert_eq!(none, Err(NoReturn::NoSignificantPeak), "{detector:?}");
            }
        }
    }
    let mut many = vec![0; BINS];
    many[3] = LASER_CYCLES + 1;
    assert!(detector(CountedEvents::Every).check(&many).is_ok());
    assert!(detector(CountedEvents::First).check(&many).is_err());
}

#[test]
fn a_glass_is_found_from_captures_without_a_target_and_from_those_with_one() {
    let mut random = StdRng::seed_from_u64(9);
    const CAPTURES: u32 = 6;
    let sum_of = |random: &mut StdRng, detector: &Detector, light: &Light| {
        let mut sums = vec![0; BINS];
        for _ in 0..CAPTURES {
            let counts = histogram(random, detector, light);
            sums.iter_mut().zip(counts).for_each(|(sum, n)| *sum += n);
        }
        sums
    };
    let bright = |detector: Detector| (detector, 3.0);
    for (detector, by) in [
        (detector(CountedEvents::Every), 1.0),
        (detector(CountedEvents::First), 1.0),
        bright(together(CountedEvents::Every, 2)),
        bright(together(CountedEvents::First, 2)),
    ] {
        // Bins that begin before the glass, whose light comes at nearly no distance.
        let near = detector.later(-23.7e-9);
        let moved = |place_s: f64| place_s - 23.7e-9;
        let truth = photons_of_glass(&near, moved(GLASS_S), 0.4 * by);
        let alone = Light::new(moved(GLASS_S), 0.4 * by, 0.5 * by);
        let measured = near.measured_crosstalk(&sum_of(&mut random, &near, &alone), CAPTURES);
        let sum: f64 = measured.unwrap().iter().sum();
        let all: f64 = truth.iter().sum();
        assert!((sum / all - 1.0).abs() < 0.1, "{sum} {all}");
        let none = Light::new(moved(45e-9), 0.0, 0.5 * by);
        let measured = near.measured_crosstalk(&sum_of(&mut random, &near, &none), CAPTURES);
        assert_eq!(measured, Ok(Vec::new()));
        // A target beside it.
        let target = Light::new(moved(45e-9), 0.5 * by, 0.0);
        let both = Light {
            glass: 0.4 * by,
            glass_s: moved(GLASS_S),
            ..Light::new(target.place_s, target.signal, alone.background)
        };
        let fitted = near.fitted_crosstalk(&sum_of(&mut random, &near, &both), CAPTURES);
        let sum: f64 = fitted.unwrap().iter().sum();
        assert!((sum / all - 1.0).abs() < 0.1, "{sum} {all}");
        let far = sum_of(&mut random, &near, &target);
        assert_eq!(near.fitted_crosstalk(&far, CAPTURES), Ok(Vec::new()));
    }
}

/// A glass that throws back a flat stretch of light.
#[test]
fn light_of_another_form_is_not_told_from_spads_that_fire_together() {
    let mut sums = vec![2_u32; BINS];
    sums[3..15].iter_mut().for_each(|sum| *sum = 400);
    let single = detector(CountedEvents::Every).later(-23.7e-9);
    let glass = single.measured_crosstalk(&sums, 1).unwrap();
    assert!(
        (glass.iter().sum::<f64>() / 4776.0 - 1.0).abs() < 0.1,
        "{glass:?}"
    );
    let pair = together(CountedEvents::Every, 2).later(-23.7e-9);
    assert_eq!(pair.measured_crosstalk(&sums, 1), Err(UnknownCrosstalk));
}
