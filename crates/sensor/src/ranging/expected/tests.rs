//! Mean histograms against theory, closed forms and finer steps.

use super::*;
use crate::numerics::normal_above;
use crate::theory::precision::cramer_rao;
use crate::units::Time;
use proptest::prelude::*;

const PULSE_SIGMA: Time = Time::from_ps(1_911);

/// In light so little that SPADs never meet, what counts tell of a place is the Cramér-Rao bound of theory.
#[test]
fn little_light_tells_as_much_of_its_place_as_theory_has_it() {
    for (clk_hz, signal, background) in [
        (384e6, 2e-3, 3e-3),
        (200e6, 1e-3, 2e-4),
        (800e6, 1e-4, 1e-3),
    ] {
        let config = SensorConfig {
            clk_hz,
            bins: 64,
            ..SensorConfig::default()
        };
        let response = Response::new(&config, 1.0 / clk_hz, PULSE_SIGMA);
        const PHASES: usize = 16;
        let mean = (0..PHASES).map(|phase| {
            let light = EchoLight {
                position_bins: 32.0 + (phase as f64 + 0.5) / PHASES as f64,
                signal,
                background_per_bin: background,
                sigma_bins: response.pulse_sigma_bins,
            };
            let told: f64 = response.information(&light).iter().map(|bin| bin.1).sum();
            1.0 / told / PHASES as f64
        });
        let bound_ns = mean.sum::<f64>().sqrt() * 1e9 / clk_hz;
        let theory_ns = cramer_rao(1e9 / clk_hz, PULSE_SIGMA.as_ns(), background, signal);
        assert!(
            (bound_ns / theory_ns - 1.0).abs() < 0.01,
            "{bound_ns} {theory_ns}"
        );
    }
}

/// Fisher's information of a bin that counts with chance p is (dp/dx)²/(p(1 − p)), also where it counts nearly always.
#[test]
fn information_is_that_of_a_bin_that_counts_or_does_not() {
    let config = SensorConfig::default();
    let response = Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA);
    for signal in [0.3, 3.0, 30.0] {
        let echo_light = |position_bins: f64| EchoLight {
            position_bins,
            signal,
            background_per_bin: 0.05,
            sigma_bins: response.pulse_sigma_bins,
        };
        let [before, after] =
            [7.3 - 1e-5, 7.3 + 1e-5].map(|place| response.chances(&echo_light(place)));
        for (bin, (chance, told)) in response
            .information(&echo_light(7.3))
            .into_iter()
            .enumerate()
        {
            let slope = (after[bin] - before[bin]) / 2e-5;
            let wanted = slope * slope / (chance * (1.0 - chance));
            assert!(
                (told - wanted).abs() < 1e-5 + 1e-3 * wanted,
                "{signal}, bin {bin}: {told} {wanted}"
            );
        }
    }
}

/// Under background alone all bins are as those before the first one that is looked at.
#[test]
fn the_dark_stands_still() {
    for (dead_time_ns, paralysable, afterpulse_probability, crosstalk_probability) in [
        (8.0, false, 0.0, 0.0),
        (8.0, false, 0.08, 0.0),
        (8.0, true, 0.08, 0.03),
        (1.3, false, 0.08, 0.03),
        (1.3, true, 0.0, 0.03),
        (40.0, false, 0.04, 0.01),
    ] {
        let config = SensorConfig {
            dead_time_ns,
            paralysable,
            afterpulse_probability,
            crosstalk_probability,
            ..SensorConfig::default()
        };
        let response = Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA);
        for background_per_bin in [0.01, 0.3, 3.0] {
            let echo_light = |position_bins: f64| EchoLight {
                position_bins,
                signal: 1e-9,
                background_per_bin,
                sigma_bins: 0.7,
            };
            // Long before all bins, and after them.
            let [stepped, steady] = [-40.0, 60.0].map(|place| response.chances(&echo_light(place)));
            let worst = stepped
                .iter()
                .zip(&steady)
                .map(|(a, b)| (a / b - 1.0).abs())
                .fold(0.0, f64::max);
            // Rounds of triggering are few: 6.5·10⁻⁷ at most here.
            assert!(
                worst < 2e-6,
                "{dead_time_ns} ns, {background_per_bin}: {worst}"
            );
        }
    }
}

/// In the dark bins before an echo never count, and those after it tell nothing of its place.
#[test]
fn bins_that_never_count_tell_nothing() {
    let config = SensorConfig::default();
    let response = Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA);
    let light = EchoLight {
        position_bins: 7.0,
        signal: 0.5,
        background_per_bin: 0.0,
        sigma_bins: response.pulse_sigma_bins,
    };
    let told = response.information(&light);
    assert_eq!(told[0], (0.0, 0.0));
    assert!(told.iter().all(|bin| bin.1.is_finite()) && told[7].1 > 0.0);
}

proptest! {
    /// Bins know no place: what an echo does to one, it does a bin later to the next, also where it comes before all bins.
    #[test]
    fn the_mean_histogram_moves_with_its_echo(
        bins_later in 1usize..12,
        position_bins in -9f64..9.0,
        ln_signal in -2f64..7.0,
        background_per_bin in 1e-3f64..0.3,
        width in 1f64..2.5,
        dead_time_ns in prop_oneof![1.0f64..2.6, 2.6f64..40.0],
        paralysable: bool,
        afterpulse_probability in 0f64..0.05,
    ) {
        let config = SensorConfig { bins: 32, dead_time_ns, paralysable, afterpulse_probability, ..SensorConfig::default() };
        let response = Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA);
        let sigma_bins = width * response.pulse_sigma_bins;
        let light = EchoLight { position_bins, signal: ln_signal.exp(), background_per_bin, sigma_bins };
        let later = EchoLight { position_bins: position_bins + bins_later as f64, ..light };
        for steps in [Steps::Coarse, Steps::Fine] {
            let [here, later] = [&light, &later].map(|light| response.chances_in(light, steps));
            for (bin, (here, later)) in here.iter().zip(&later[bins_later..]).enumerate() {
                prop_assert!((here - later).abs() < 1e-7, "{bin} {here} {later}");
            }
        }
    }
}

/// By hand: three steps and three to two standard deviations where a SPAD fires once under the pulse, else twelve to a dead time and sixteen
/// to the time in which light fires it, at most 32. With a dead time below a bin, four, and two to a dead time, to find where to look.
#[test]
fn steps_go_by_dead_time_and_rate() {
    let steps = |dead_time_ns: f64, signal: f64, sigma_bins: f64, steps: Steps| {
        let config = SensorConfig {
            dead_time_ns,
            ..SensorConfig::default()
        };
        // Bins of a nanosecond.
        let response = Response::new(&config, 1e-9, PULSE_SIGMA);
        response.steps(
            &EchoLight {
                position_bins: 7.0,
                signal,
                background_per_bin: 0.01,
                sigma_bins,
            },
            steps,
        )
    };
    // A pulse of half a bin is over in 6.7 bins.
    assert_eq!(
        [6.6, 6.8].map(|dead| steps(dead, 2000.0, 0.5, Steps::Fine)),
        [32, 3]
    );
    // Fifteen steps to a bin are three to two standard deviations of a tenth.
    assert_eq!(
        [1.9, 2.1].map(|dead| steps(dead, 0.1, 0.1, Steps::Fine)),
        [15, 15]
    );
    // Sixteen times 0.4 · 30/(16 · 0.5) a bin.
    assert_eq!(steps(6.0, 30.0, 0.5, Steps::Fine), 24);
    assert_eq!(steps(6.0, 0.8, 0.5, Steps::Fine), 3);
    assert_eq!(steps(0.5, 0.8, 0.5, Steps::Fine), 24);
    let coarse = [8.0, 0.5, 0.21, 0.05].map(|dead| steps(dead, 80.0, 0.5, Steps::Coarse));
    assert_eq!(coarse, [3, 4, 10, 16]);
}

proptest! {
    /// A SPAD that is blind for the rest of the laser cycle fires once, on the first photon: a closed form, whatever the
    /// width of the echo and its place, also where it comes before all bins or after them.
    #[test]
    fn spads_that_fire_once_follow_the_first_photon(
        position_bins in -8f64..40.0,
        signal in 0.1f64..60.0,
        sigma_bins in prop_oneof![Just(0.0), 0.02f64..0.5, 0.5f64..4.0],
        spads in prop::sample::select(vec![1usize, 2, 4, 8]),
    ) {
        let config = SensorConfig { bins: 32, spad_rows: 1, spad_cols: spads, dead_time_ns: 400.0, ..SensorConfig::default() };
        let response = Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA);
        let light = EchoLight { position_bins, signal, background_per_bin: 0.0, sigma_bins };
        let of_spad = signal / config.spads() as f64;
        let dark_until = |edge: f64| libm::exp(-of_spad * normal_above((position_bins - edge) / sigma_bins.max(1e-6)));
        for steps in [Steps::Coarse, Steps::Fine] {
            for (bin, chance) in response.chances_in(&light, steps).into_iter().enumerate() {
                let fires = dark_until(bin as f64 - 0.5) - dark_until(bin as f64 + 0.5);
                let wanted = -libm::expm1(config.spads() as f64 * libm::log1p(-fires));
                prop_assert!((chance - wanted).abs() < 1e-6, "bin {bin}: {chance}, {wanted}");
            }
        }
    }

    #[test]
    fn steps_are_as_fine_as_the_light_needs(
        position_bins in 2f64..12.0,
        ln_signal in -2f64..7.0,
        background_per_bin in 1e-3f64..0.3,
        sigma_bins in 0.2f64..2.5,
        dead_time_ns in prop_oneof![0.3f64..2.6, 2.6f64..40.0],
        paralysable: bool,
    ) {
        let config = SensorConfig { dead_time_ns, paralysable, ..SensorConfig::default() };
        let response = Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA);
        let light = EchoLight { position_bins, signal: ln_signal.exp(), background_per_bin, sigma_bins };
        let steps = response.steps(&light, Steps::Fine);
        // Plain SPADs, too, against small steps of the others.
        let chosen = response.chances_of::<0>(&light, Steps::Fine);
        let finer = response.chances_by::<0>(&light, 6 * steps.max(16));
        let worst = chosen.iter().zip(&finer).map(|(a, b)| (a.value - b.value).abs()).fold(0.0, f64::max);
        // Of 3000 lights: 1.0·10⁻³ below 20 photons; above, 1.4·10⁻³ where a non-paralysable SPAD fires again under the
        // pulse, 1.3·10⁻² where it fires once, 2.0·10⁻² where it is paralysable or would need more than the most steps.
        // Steps of SPADs that are not plain do not follow the pulse: of 400 000 lights below 20 photons one was 3.5·10⁻³ beside, with a
        // pulse of a fifth of a bin that ends with the bin.
        let is_plain = response.dead.is_plain();
        let most = if is_plain { MOST_PLAIN_STEPS } else { MOST_STEPS } as usize;
        let fires_again = steps > response.steps(&light, Steps::Coarse) && steps < most && !paralysable;
        let allowed = match (light.signal < 20.0 || fires_again, is_plain) {
            (true, true) => 2e-3,
            (true, false) => 6e-3,
            (false, _) => 4e-2,
        };
        prop_assert!(worst < allowed, "{worst} with {steps} steps");
        prop_assert!(steps <= most && response.steps(&light, Steps::Coarse) <= steps);
    }

    /// Lights side by side go in the steps that one of them needs, and single ones in their own.
    #[test]
    fn lights_side_by_side_are_as_each_alone(
        places in prop::collection::vec(-6f64..20.0, 1..20),
        is_at_one_place: bool,
        ln_signals in prop::array::uniform20(-2f64..7.0),
        background_per_bin in 1e-3f64..0.3,
        sigma_bins in prop_oneof![0.05f64..0.4, 0.4f64..2.5],
        dead_time_ns in prop_oneof![0.3f64..2.6, 2.6f64..40.0],
        threshold in 0u8..4,
        is_fine: bool,
    ) {
        let config = SensorConfig { dead_time_ns, threshold, ..SensorConfig::default() };
        let response = Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA);
        let light = |(place, ln_signal): (&f64, &f64)| EchoLight {
            position_bins: if is_at_one_place { places[0] } else { *place },
            signal: ln_signal.exp(),
            background_per_bin,
            sigma_bins,
        };
        let lights: Vec<EchoLight> = places.iter().zip(&ln_signals).map(light).collect();
        let steps = if is_fine { Steps::Fine } else { Steps::Coarse };
        let mut side_by_side = Vec::new();
        response.chances_of_each::<4>(&lights, steps, |number, chances| {
            assert_eq!(number, side_by_side.len());
            side_by_side.push(chances.to_vec());
        });
        prop_assert_eq!(side_by_side.len(), lights.len());
        let most = lights.iter().map(|light| response.steps(light, steps)).max();
        for (light, found) in lights.iter().zip(side_by_side) {
            let alone = response.chances_of::<4>(light, steps);
            // Of the same steps nothing but rounding is left.
            let is_same = is_at_one_place && most == Some(response.steps(light, steps));
            let allowed = if is_same { 1e-9 } else { 4e-2 };
            for (found, alone) in found.iter().zip(&alone) {
                prop_assert!((found.value - alone.value).abs() < allowed, "{found:?} {alone:?}");
                for (a, b) in found.slope.iter().zip(alone.slope) {
                    prop_assert!(!is_same || (a - b).abs() < allowed * (1.0 + b.abs()), "{found:?} {alone:?}");
                }
            }
        }
    }

    /// What a thread keeps, of steps and of mean histograms, is to the bit what a new thread finds.
    #[test]
    fn what_is_kept_is_what_would_be_found_anew(
        order in prop::collection::vec((0usize..6, 0usize..2, 0usize..4), 5..60),
        places in prop::array::uniform6(-6f64..20.0),
        ln_signals in prop::array::uniform6(-2f64..7.0),
        dead_times_ns in prop::array::uniform2(2.7f64..40.0),
        bins in prop::sample::select(vec![4usize, 16, 24]),
    ) {
        let responses = dead_times_ns.map(|dead_time_ns| {
            let config = SensorConfig { dead_time_ns, bins, ..SensorConfig::default() };
            Response::new(&config, 1.0 / config.clk_hz, PULSE_SIGMA)
        });
        let values = |(light, response, slopes): (usize, usize, usize)| {
            let light = EchoLight {
                position_bins: places[light],
                signal: ln_signals[light].exp(),
                background_per_bin: 0.03,
                sigma_bins: 0.74,
            };
            let response = &responses[response];
            fn flat<const K: usize>(chances: &[Dual<K>]) -> Vec<f64> {
                chances.iter().flat_map(|c| std::iter::once(c.value).chain(c.slope)).collect()
            }
            match slopes {
                0 => response.chances(&light),
                1 => flat(&response.chances_of::<2>(&light, Steps::Fine)),
                2 => flat(&response.chances_of::<3>(&light, Steps::Fine)),
                _ => flat(&response.chances_of::<4>(&light, Steps::Fine)),
            }
        };
        for asked in order {
            let kept = values(asked);
            let anew = std::thread::scope(|scope| scope.spawn(|| values(asked)).join().unwrap());
            prop_assert!(kept == anew, "{kept:?} {anew:?}");
            prop_assert_eq!(kept.len(), bins * [1, 3, 4, 5][asked.2]);
        }
    }
}
