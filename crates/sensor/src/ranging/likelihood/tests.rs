//! Deviance, score and information against their definitions, steps and bounds against Cramer's rule, and what light can be.

use super::*;
use crate::chip::SensorConfig;
use crate::units::Time;
use proptest::prelude::*;

const CYCLES: f64 = 1000.0;

fn response(threshold: u8) -> Response {
    let config = SensorConfig {
        threshold,
        ..SensorConfig::default()
    };
    Response::new(&config, 1.0 / config.clk_hz, Time::from_ps(1_911))
}

fn likelihood<'a>(
    response: &'a Response,
    counts: &'a [f64],
    bins: Range<usize>,
    free: Free,
) -> Likelihood<'a> {
    Likelihood {
        response,
        counts,
        cycles: CYCLES,
        bins,
        free,
        most_background: 0.1,
    }
}

fn local_at(likelihood: &Likelihood<'_>, light: EchoLight, steps: Steps) -> Local {
    let mut found = Vec::new();
    likelihood.at_each(&[light], steps, |_, local| found.push(local));
    found.remove(0)
}

/// Parameters in their order.
fn moved_by(light: &EchoLight, parameter: usize, by: f64) -> EchoLight {
    let mut light = *light;
    match parameter {
        0 => light.position_bins += by,
        1 => light.signal *= by.exp(),
        2 => light.background_per_bin *= by.exp(),
        _ => light.sigma_bins *= by.exp(),
    }
    light
}

prop_compose! {
    fn lights()(
        position_bins in 2f64..13.0, ln_signal in -2f64..3.0, ln_background in -6f64..-1.0, sigma_bins in 0.74f64..2.0,
    ) -> EchoLight {
        EchoLight { position_bins, signal: ln_signal.exp(), background_per_bin: ln_background.exp(), sigma_bins }
    }
}

fn counts() -> impl Strategy<Value = Vec<f64>> {
    let count = prop_oneof![8 => 0u32..1001, 1 => Just(0), 1 => Just(1000)];
    prop::collection::vec(count.prop_map(f64::from), 16)
}

fn bins() -> impl Strategy<Value = Range<usize>> {
    (0usize..6, 10usize..17).prop_map(|(first, end)| first..end)
}

/// The determinant of what a matrix has in these rows and columns, along the first row.
fn minor(rows: &[usize], cols: &[usize], entry: &dyn Fn(usize, usize) -> f64) -> f64 {
    let Some((&row, rows)) = rows.split_first() else {
        return 1.0;
    };
    let of_col = |(n, &col): (usize, &usize)| {
        let others: Vec<usize> = cols.iter().copied().filter(|&other| other != col).collect();
        let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
        sign * entry(row, col) * minor(rows, &others, entry)
    };
    cols.iter().enumerate().map(of_col).sum()
}

/// Parameter `which` of matrix · x = wanted, of the parameters `free` alone, by Cramer's rule.
fn by_cramer(
    matrix: &[[f64; PARAMETERS]; PARAMETERS],
    wanted: &[f64; PARAMETERS],
    free: &[usize],
    which: usize,
) -> f64 {
    let swapped = |row: usize, col: usize| {
        if col == which {
            wanted[row]
        } else {
            matrix[row][col]
        }
    };
    minor(free, free, &swapped) / minor(free, free, &|row, col| matrix[row][col])
}

proptest! {
    #[test]
    fn the_deviance_is_what_is_missing_to_the_counts_own_shares(
        counts in counts(), bins in bins(), light in lights(), threshold in 0u8..3,
    ) {
        let response = response(threshold);
        let chances = response.chances_in(&light, Steps::Coarse);
        let ln = |count: f64, chance: f64| if count > 0.0 { count * chance.ln() } else { 0.0 };
        let ln_likelihood = |count: f64, chance: f64| ln(count, chance) + ln(CYCLES - count, 1.0 - chance);
        let missing: f64 = bins.clone().map(|bin| {
            let chance = chances[bin].clamp(1e-9, 1.0 - 1e-9);
            ln_likelihood(counts[bin], counts[bin] / CYCLES) - ln_likelihood(counts[bin], chance)
        }).sum();
        let found = likelihood(&response, &counts, bins, ECHO).deviances(&[light], Steps::Coarse)[0];
        prop_assert!((found - 2.0 * missing).abs() < 1e-9 * (1.0 + found), "{found} {missing}");
    }

    #[test]
    fn score_and_information_are_those_of_the_chances_slopes(
        counts in counts(), bins in bins(), light in lights(), threshold in 0u8..3, is_wide: bool,
    ) {
        let response = response(threshold);
        let likelihood = likelihood(&response, &counts, bins.clone(), if is_wide { WIDE_ECHO } else { ECHO });
        let parameters = if is_wide { 4 } else { 3 };
        let chances = |light: &EchoLight| response.chances_in(light, Steps::Coarse);
        let slopes: Vec<Vec<f64>> = (0..parameters).map(|parameter| {
            const BY: f64 = 1e-4;
            let [more, less] = [BY, -BY].map(|by| chances(&moved_by(&light, parameter, by)));
            more.iter().zip(less).map(|(more, less)| (more - less) / (2.0 * BY)).collect()
        }).collect();
        let chances = chances(&light);
        let local = local_at(&likelihood, light, Steps::Coarse);
        let sum = |term: &dyn Fn(usize, f64) -> f64| -> f64 {
            bins.clone().map(|bin| term(bin, chances[bin].clamp(1e-9, 1.0 - 1e-9))).sum()
        };
        for i in 0..parameters {
            let score = |bin: usize, p: f64| (counts[bin] / p - (CYCLES - counts[bin]) / (1.0 - p)) * slopes[i][bin];
            let scale = sum(&|bin, p| score(bin, p).abs());
            prop_assert!((local.score[i] - sum(&score)).abs() < 1e-4 * scale + 1e-6, "score {i}");
            for j in 0..parameters {
                let told = |bin: usize, p: f64| CYCLES * slopes[i][bin] * slopes[j][bin] / (p * (1.0 - p));
                let scale = sum(&|bin, p| told(bin, p).abs());
                prop_assert!((local.information[i][j] - sum(&told)).abs() < 1e-4 * scale + 1e-6, "told {i} {j}");
            }
        }
        prop_assert_eq!(local.background, light.background_per_bin);
    }

    #[test]
    fn steps_and_bounds_solve_what_is_free(
        factors in prop::array::uniform4(prop::array::uniform4(-1f64..1.0)),
        score in prop::array::uniform4(-3f64..3.0),
        free in prop::array::uniform4(any::<bool>()),
        light in lights(),
        damping in prop::sample::select(vec![0.0, 0.5, 30.0]),
    ) {
        let mut information = [[0.0; PARAMETERS]; PARAMETERS];
        for (i, row) in information.iter_mut().enumerate() {
            for (j, of_row) in row.iter_mut().enumerate() {
                *of_row = factors.iter().map(|row| row[i] * row[j]).sum();
            }
            row[i] += 0.2;
        }
        let (response, counts) = (response(0), [0.0; 16]);
        let likelihood = likelihood(&response, &counts, 0..16, free);
        let local = Local { background: light.background_per_bin, deviance: 0.0, score, information };
        let numbers: Vec<usize> = (0..PARAMETERS).filter(|&i| free[i]).collect();

        let mut damped = information;
        (0..PARAMETERS).for_each(|i| damped[i][i] += damping * information[i][i] + 1e-6);
        let step = likelihood.step(&light, &local, damping).unwrap();
        let whole: Vec<f64> = (0..PARAMETERS).map(|i| if free[i] { by_cramer(&damped, &score, &numbers, i) } else { 0.0 }).collect();
        let most = [0.5 + 0.5 * response.pulse_sigma_bins, 1.0, 1.5, 0.5];
        let times = whole.iter().zip(most).map(|(step, most)| step.abs() / most).fold(1.0, f64::max);
        for (step, whole) in step.iter().zip(&whole) {
            prop_assert!((step - whole / times).abs() < 1e-6 * (1.0 + whole.abs()), "{step} {whole} {times}");
        }

        let mut known = information;
        if free[2] {
            // The variance of a number that may be anything between none and the most.
            known[2][2] += 12.0 * (light.background_per_bin / 0.1).powi(2);
        }
        let bound = likelihood.bound_bins(&local);
        let variance = if free[0] { by_cramer(&known, &[1.0, 0.0, 0.0, 0.0], &numbers, 0) } else { 1.0 };
        prop_assert!((bound / variance.sqrt() - 1.0).abs() < 1e-6, "{bound} {variance}");
    }
}

/// A bin that always counts tells nothing, and is never divided by.
#[test]
fn bins_that_always_count_are_finite() {
    let response = response(0);
    let counts = [CYCLES; 16];
    let likelihood = likelihood(&response, &counts, 0..16, ECHO);
    let light = EchoLight {
        position_bins: 7.0,
        signal: 1e6,
        background_per_bin: 0.01,
        sigma_bins: 0.74,
    };
    let chances = response.chances(&light);
    assert!(chances.iter().any(|chance| *chance > 1.0 - 1e-12));
    let local = local_at(&likelihood, light, Steps::Fine);
    let numbers = local.score.iter().chain(local.information.iter().flatten());
    assert!(numbers.chain([&local.deviance]).all(|n| n.is_finite()));
}

#[test]
fn what_is_not_positive_has_no_solution() {
    let unit = [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ];
    assert_eq!(
        solved(unit, [1.0, 2.0, 3.0, 4.0]),
        Some([1.0, 2.0, 3.0, 4.0])
    );
    for pivot in [0.0, -1.0, f64::NAN] {
        let mut matrix = unit;
        matrix[2][2] = pivot;
        assert_eq!(solved(matrix, [1.0; 4]), None);
    }
}

#[test]
fn light_moves_within_what_light_can_be() {
    let response = response(0);
    let (counts, pulse) = ([0.0; 16], response.pulse_sigma_bins);
    let likelihood = likelihood(&response, &counts, 0..16, ECHO);
    let light = EchoLight {
        position_bins: 7.0,
        signal: 2.0,
        background_per_bin: 0.01,
        sigma_bins: 1.5,
    };
    let as_numbers = |light: EchoLight| {
        [
            light.position_bins,
            light.signal,
            light.background_per_bin,
            light.sigma_bins,
        ]
    };
    let moved = |by: f64| as_numbers(likelihood.moved(&light, [by; 4]));
    let near = |found: [f64; 4], expected: [f64; 4]| {
        let is_near = |(found, expected): (&f64, f64)| (found / expected - 1.0).abs() < 1e-12;
        assert!(
            found.iter().zip(expected).all(is_near),
            "{found:?} {expected:?}"
        );
    };
    let grown = 0.2f64.exp();
    near(moved(0.2), [7.2, 2.0 * grown, 0.01 * grown, 1.5 * grown]);
    // Three widths beside the bins, and a pulse as wide as they are.
    near(moved(100.0), [15.0 + 4.5, 1e7, 1e4, pulse + 15.0]);
    near(moved(-100.0), [-4.5, 1e-6, 1e-3 / (CYCLES * 15.0), pulse]);
}

#[test]
fn one_in_30_000_right_fits_scatters_more_than_is_explained() {
    let with = |freedom: f64, deviance: f64| Fit {
        light: EchoLight {
            position_bins: 7.0,
            signal: 1.0,
            background_per_bin: 0.1,
            sigma_bins: 1.0,
        },
        deviance,
        freedom,
        has_converged: true,
        bound_bins: 1.0,
    };
    // Of chi-squared, which the cube root's normal law overestimates: by 4 % at 3 bins more than parameters.
    for (freedom, quantile) in [(3.0, 23.51), (13.0, 43.92), (100.0, 166.8)] {
        let (less, more) = (
            with(freedom, 0.99 * quantile),
            with(freedom, 1.06 * quantile),
        );
        assert!(less.explains() && !more.explains(), "{freedom}");
    }
    let unfinished = Fit {
        has_converged: false,
        ..with(13.0, 1.0)
    };
    assert!(unfinished.is_close() && !unfinished.explains());
}
