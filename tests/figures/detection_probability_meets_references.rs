//! Probability of detection against 360-digit sums (`vectors/theory/detection.py`) and against dice.

use guided_dtof::photon::{Poisson, RandomPurpose, random_stream};
use guided_dtof::theory::cycles::laser_cycles_for;
use guided_dtof::theory::detection::{DetectionModel, PerCycle, Ties, poisson, probability};
use rand_philox::Philox;

/// Rows of a CSV table without its header.
fn rows(text: &str) -> impl Iterator<Item = Vec<&str>> {
    text.lines().skip(1).map(|line| line.split(',').collect())
}

fn number(text: &str) -> f64 {
    text.parse().unwrap()
}

fn ties(name: &str) -> Ties {
    match name {
        "strict" => Ties::Strict,
        "random" => Ties::Random,
        "loose" => Ties::Loose,
        other => panic!("{other}"),
    }
}

fn relative(got: f64, want: f64) -> f64 {
    if got == want {
        0.0
    } else {
        (got / want - 1.0).abs()
    }
}

#[test]
fn exact_sums_agree_to_one_in_a_million_million() {
    let mut worst = 0.0f64;
    for row in rows(include_str!("../../vectors/theory/detection.csv")) {
        let (signal, background) = (number(row[2]), number(row[3]));
        let (bins, ties) = (row[4].parse().unwrap(), ties(row[5]));
        let got = match row[0] {
            "poisson" => poisson(signal, background, bins, ties),
            _ => {
                let light = PerCycle {
                    signal,
                    background,
                    bins,
                };
                probability(
                    &light,
                    row[1].parse().unwrap(),
                    DetectionModel::Bernoulli(ties),
                )
            }
        };
        for (got, want) in [
            (got.probability, number(row[6])),
            (got.miss, number(row[7])),
        ] {
            let error = relative(got, want);
            if error > 1e-13 {
                println!("{row:?}: {got:e} {error:e}");
            }
            worst = worst.max(error);
        }
    }
    assert!(worst < 1e-12, "{worst:e}");
}

#[test]
fn gaussian_sums_agree_to_one_in_a_million_million() {
    for row in rows(include_str!("../../vectors/theory/gaussian.csv")) {
        let light = PerCycle {
            signal: number(row[1]),
            background: number(row[2]),
            bins: row[3].parse().unwrap(),
        };
        let model = match row[0] {
            "meant" => DetectionModel::Gaussian,
            _ => DetectionModel::GaussianAsPrinted,
        };
        let got = probability(&light, 1, model).probability;
        let error = relative(got, number(row[4]));
        assert!(error < 1e-12, "{row:?}: {got:e}, off by {error:e}");
    }
}

/// How many of `runs` histograms have their peak in the signal bin, by each rule: (strict, random, loose).
fn roll(
    runs: u32,
    bins: u32,
    mut signal: impl FnMut() -> u32,
    mut other: impl FnMut() -> u32,
) -> [f64; 3] {
    let mut won = [0.0; 3];
    for _ in 0..runs {
        let signal = signal();
        let others: Vec<u32> = (1..bins).map(|_| other()).collect();
        let higher = others.iter().filter(|&&n| n > signal).count();
        let tied = others.iter().filter(|&&n| n == signal).count();
        if higher == 0 {
            won[0] += f64::from(u8::from(tied == 0));
            won[1] += 1.0 / (tied + 1) as f64;
            won[2] += 1.0;
        }
    }
    won.map(|w| w / f64::from(runs))
}

/// Asserts that `won` lies within 4.5 standard errors of the three rules' probabilities.
fn assert_near(won: [f64; 3], runs: u32, expected: impl Fn(Ties) -> f64, what: &str) {
    for (won, ties) in won
        .into_iter()
        .zip([Ties::Strict, Ties::Random, Ties::Loose])
    {
        let p = expected(ties);
        let error = (p * (1.0 - p) / f64::from(runs)).sqrt();
        assert!(
            (won - p).abs() < 4.5 * error,
            "{what} {ties:?}: {won} for {p}"
        );
    }
}

/// The system of Fig. 32, four times its 5000 runs.
#[test]
fn the_system_of_figure_32_agrees_with_dice() {
    let runs = 20_000;
    for bins in [2, 4, 8] {
        let light = PerCycle {
            signal: 0.1,
            background: 1.0 / f64::from(bins),
            bins,
        };
        for cycles in [1, 10, 60, 300, 1200] {
            let n = cycles as f64;
            let signal = Poisson::new(n * (light.signal + light.background));
            let other = Poisson::new(n * light.background);
            let mut random = random_stream(9, RandomPurpose::Photons, bins, cycles as u32);
            let mut more = random_stream(10, RandomPurpose::Photons, bins, cycles as u32);
            let won = roll(
                runs,
                bins,
                || signal.draw(&mut random),
                || other.draw(&mut more),
            );
            let expected =
                |ties| probability(&light, cycles, DetectionModel::Poisson(ties)).probability;
            assert_near(
                won,
                runs,
                expected,
                &format!("{bins} bins, {cycles} cycles"),
            );
        }
    }
}

/// Counts cycle by cycle: a bin takes a hit if any photon came.
#[test]
fn one_hit_a_cycle_agrees_with_dice() {
    let (runs, cycles) = (5_000, 50);
    let light = PerCycle {
        signal: 0.4,
        background: 0.8,
        bins: 4,
    };
    let hits = |random: &mut Philox, photons: f64| -> u32 {
        let nothing = ((-photons).exp() * 2f64.powi(32)) as u64;
        (0..cycles)
            .map(|_| u32::from(u64::from(random.next_u32()) >= nothing))
            .sum()
    };
    let mut random = random_stream(11, RandomPurpose::Photons, 0, 0);
    let mut more = random_stream(12, RandomPurpose::Photons, 0, 0);
    let won = roll(runs, 4, || hits(&mut random, 1.2), || hits(&mut more, 0.8));
    let expected = |ties| probability(&light, cycles, DetectionModel::Bernoulli(ties)).probability;
    assert_near(won, runs, expected, "one hit a cycle");
    let every_photon =
        probability(&light, cycles, DetectionModel::Poisson(Ties::Random)).probability;
    assert!(
        expected(Ties::Random) < every_photon,
        "saturation costs detections"
    );
}

#[test]
fn gaussian_as_meant_nears_the_exact_sum_and_as_printed_never_learns() {
    let light = PerCycle {
        signal: 0.1,
        background: 0.25,
        bins: 4,
    };
    let p = |cycles, model| probability(&light, cycles, model).probability;
    let error =
        |n| (p(n, DetectionModel::Gaussian) - p(n, DetectionModel::Poisson(Ties::Random))).abs();
    assert!(
        error(1000) < 2e-3 && error(1000) < error(30),
        "{} {}",
        error(30),
        error(1000)
    );
    let printed = [100, 10_000, 1_000_000].map(|n| p(n, DetectionModel::GaussianAsPrinted));
    assert!(printed.iter().all(|p| *p < 0.5), "{printed:?}");
}

#[test]
fn the_number_of_laser_cycles_is_the_smallest() {
    let models = [
        DetectionModel::Poisson(Ties::Strict),
        DetectionModel::Poisson(Ties::Random),
        DetectionModel::Poisson(Ties::Loose),
        DetectionModel::Bernoulli(Ties::Random),
        DetectionModel::Gaussian,
    ];
    for (signal, background, bins) in [
        (0.1, 0.25, 4),
        (0.0285, 0.1, 256),
        (5.0, 0.01, 16),
        (1e-5, 1e-4, 2),
    ] {
        let light = PerCycle {
            signal,
            background,
            bins,
        };
        for model in models {
            for target in [0.6, 0.997, 1.0 - 1e-9] {
                let n = laser_cycles_for(target, &light, model).unwrap();
                let p = |n| probability(&light, n, model).probability;
                assert!(p(n) >= target, "{light:?} {model:?} {target}: {n}");
                assert!(
                    n == 1 || p(n - 1) < target,
                    "{light:?} {model:?} {target}: {n}"
                );
            }
        }
    }
}

#[test]
fn what_cannot_be_reached_is_said() {
    let light = PerCycle {
        signal: 0.0,
        background: 0.1,
        bins: 8,
    };
    assert_eq!(
        laser_cycles_for(0.9, &light, DetectionModel::Poisson(Ties::Random)),
        None
    );
    let light = PerCycle {
        signal: 0.1,
        ..light
    };
    assert_eq!(
        laser_cycles_for(1.0, &light, DetectionModel::Poisson(Ties::Random)),
        None
    );
    assert_eq!(
        laser_cycles_for(0.997, &light, DetectionModel::GaussianAsPrinted),
        None
    );
}
