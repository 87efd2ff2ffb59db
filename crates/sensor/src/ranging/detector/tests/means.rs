//! Mean histograms of detectors, and counts that agree with them or do not.

use super::*;

/// Detectors, and light whose counts are to agree with their means.
fn known_means() -> Vec<(Detector, Light)> {
    let mut cases = Vec::new();
    for counted in [CountedEvents::Every, CountedEvents::First] {
        let light = Light::new(45.2e-9, 0.1, 0.2);
        cases.push((detector(counted), light));
        cases.push((unequal(counted), light));
        cases.push((together(counted, 2), Light::new(45.2e-9, 1.0, 1.0)));
        cases.push((together(counted, 3), Light::new(45.2e-9, 4.0, 4.0)));
    }
    cases
}

#[test]
fn counts_drawn_photon_by_photon_agree_and_those_of_other_light_do_not() {
    let mut random = StdRng::seed_from_u64(7);
    for (detector, light) in known_means() {
        let (mut low, mut high) = (0, 0);
        const REPEATS: usize = 100;
        for repeat in 0..REPEATS {
            let light = Light {
                place_s: light.place_s + 0.29e-9 * repeat as f64 % 20e-9,
                ..light
            };
            let counts = histogram(&mut random, &detector, &light);
            let expected = detector.expected(&light.of_histogram());
            let found = detector.agreement(&counts, &expected);
            low += usize::from(found.p < 0.05);
            high += usize::from(found.p > 0.95);
            // A bin too late, and twice as much background.
            let place_s = light.place_s + 1e-9;
            let background = 2.0 * light.background;
            for other in [
                Light { place_s, ..light },
                Light {
                    background,
                    ..light
                },
            ] {
                let expected = detector.expected(&other.of_histogram());
                let agreement = detector.agreement(&counts, &expected);
                assert!(agreement.p < 1e-3, "{detector:?} {other:?} {agreement:?}");
            }
        }
        // Five each are expected.
        let is_right = (0..=13).contains(&low) && (0..=16).contains(&high);
        assert!(is_right, "{detector:?}: {low} {high}");
    }
}

/// Of the first event of SPADs that fire together the mean takes that too few fired before, and not when. In this light, some events in each
/// laser cycle, a mean is off by 0.9 of the noise of one histogram with two SPADs, and by 2.1 with three.
#[test]
fn means_of_first_events_are_right_to_a_part_of_their_noise() {
    let mut random = StdRng::seed_from_u64(8);
    const HISTOGRAMS: u32 = 50;
    for (detector, light, most) in [
        (
            together(CountedEvents::First, 2),
            Light::new(45.2e-9, 3.0, 6.0),
            1.2,
        ),
        (
            together(CountedEvents::First, 3),
            Light::new(45.2e-9, 6.0, 12.0),
            2.5,
        ),
        (
            together(CountedEvents::Every, 2),
            Light::new(45.2e-9, 3.0, 6.0),
            0.6,
        ),
    ] {
        let mut sums = vec![0; BINS];
        for _ in 0..HISTOGRAMS {
            let counts = histogram(&mut random, &detector, &light);
            sums.iter_mut().zip(counts).for_each(|(sum, n)| *sum += n);
        }
        let expected = detector.expected(&light.of_histogram());
        let mut worst: f64 = 0.0;
        for (&sum, mean) in sums.iter().zip(&expected) {
            let off = f64::from(sum) / f64::from(HISTOGRAMS) - mean;
            worst = worst.max(off.abs() / (mean + 1.0).sqrt());
        }
        assert!(worst < most, "{detector:?} {light:?}: {worst}");
    }
}

#[test]
fn first_photons_are_no_more_than_laser_cycles() {
    let first = detector(CountedEvents::First);
    let light = Light::new(50.5e-9, 5.0, 8.0).of_histogram();
    let all: f64 = first.expected(&light).iter().sum();
    assert!(all < f64::from(LASER_CYCLES) && all > 0.999 * f64::from(LASER_CYCLES));
    let same = detector(CountedEvents::Every).expected(&light);
    assert!((same.iter().sum::<f64>() / f64::from(LASER_CYCLES) - 13.0).abs() < 1e-6);
    assert_eq!(same.len(), BINS);
}

#[test]
fn counts_where_none_can_be_do_not_agree() {
    let every = detector(CountedEvents::Every);
    let mut counts = vec![0; BINS];
    assert_eq!(every.agreement(&counts, &[0.0; BINS]).p, 1.0);
    counts[4] = 1;
    assert_eq!(every.agreement(&counts, &[0.0; BINS]).p, 0.0);
}
