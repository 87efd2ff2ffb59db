//! What is merged is close to the sum of all pulses, and no echo loses photons to a brighter one.

use super::*;
use proptest::prelude::*;

const SIGMA_FS: f64 = 1e6;

fn glint(photons: f64, sigmas: f64) -> Glint {
    Glint {
        photons,
        arrival_fs: 4e8 + sigmas * SIGMA_FS,
        variance_fs2: 0.0,
        surface: (100.0 * sigmas) as usize,
    }
}

fn merge(glints: &[Glint]) -> SmallVec<[Echo; 1]> {
    let sigma = Time::from_fs(SIGMA_FS as i64);
    merged(&mut glints.to_vec(), sigma, sigma)
}

/// Greatest share of the photons on the wrong side of an instant.
fn off(glints: &[Glint], echoes: &[Echo]) -> f64 {
    let all: f64 = glints.iter().map(|glint| glint.photons).sum();
    let (first, last) = (glints[0].arrival_fs, glints[glints.len() - 1].arrival_fs);
    let width_fs = last - first + 12.0 * SIGMA_FS;
    let off = |step: i32| {
        let time_fs = first - 6.0 * SIGMA_FS + width_fs * f64::from(step) / 2000.0;
        let exact: f64 = glints
            .iter()
            .map(|glint| glint.photons * normal_cdf((time_fs - glint.arrival_fs) / SIGMA_FS))
            .sum();
        let given: f64 = echoes
            .iter()
            .map(|echo| {
                let sigma_fs = echo.sigma.unwrap().as_fs() as f64;
                echo.photons * normal_cdf((time_fs - echo.arrival.as_fs() as f64) / sigma_fs)
            })
            .sum();
        (exact - given).abs() / all
    };
    (0..=2000).map(off).fold(0.0, f64::max)
}

#[test]
fn what_the_pulse_does_not_resolve_is_one_echo_and_what_it_does_is_two() {
    for (apart, echoes) in [(0.0, 1), (1.0, 1), (1.9, 1), (2.2, 2), (4.0, 2), (50.0, 2)] {
        let found = merge(&[glint(1.0, 0.0), glint(1.0, apart)]);
        assert_eq!(found.len(), echoes, "{apart} sigma");
    }
    // A faint one in the distance is an echo as well.
    let found = merge(&[glint(1.0, 0.0), glint(0.05, 20.0)]);
    assert_eq!(found.len(), 2);
    assert_eq!((found[0].photons, found[1].photons), (1.0, 0.05));
}

/// Points of one surface that is slanted, and bright all over.
fn slanted(sigmas: f64) -> Vec<Glint> {
    let row = (0..64).map(|i| Glint {
        surface: 7,
        variance_fs2: (sigmas * SIGMA_FS / 64.0).powi(2) / 12.0,
        ..glint(1.0, sigmas * (f64::from(i) + 0.5) / 64.0)
    });
    row.collect()
}

#[test]
fn a_slanted_surface_is_as_many_echoes_as_it_has_short_slices() {
    for (sigmas, echoes) in [
        (1.0, 1),
        (3.9, 1),
        (4.2, 2),
        (5.0, 3),
        (10.5, 6),
        (13.0, 7),
        (20.0, 10),
    ] {
        let found = merge(&slanted(sigmas));
        assert_eq!(found.len(), echoes, "{sigmas} sigma");
        let worst = off(&slanted(sigmas), &found);
        let most = [0.002, 0.015][usize::from(echoes == 1)];
        assert!(worst < most, "{sigmas} sigma: {worst}");
    }
    assert!(merge(&slanted(3000.0)).len() <= 20);
}

/// The peak of a box may be anywhere on its flat top, so no echo may stand out.
#[test]
fn slices_of_a_slanted_surface_have_a_flat_top() {
    for sigmas in [8.0, 10.5, 15.0, 20.0, 30.0] {
        let echoes = merge(&slanted(sigmas));
        let before = |z: f64| -> f64 {
            let share = |echo: &Echo| {
                let sigma_fs = echo.sigma.unwrap().as_fs() as f64;
                echo.photons
                    * normal_cdf((z * SIGMA_FS + 4e8 - echo.arrival.as_fs() as f64) / sigma_fs)
            };
            echoes.iter().map(share).sum::<f64>() / 64.0
        };
        let steps = ((sigmas - 6.0) / 0.1) as u32;
        for step in 0..steps {
            let from = 3.0 + 0.1 * f64::from(step);
            let density = (before(from + 0.1) - before(from)) / 0.1 * sigmas;
            assert!(
                (density - 1.0).abs() < 0.04,
                "{sigmas} at {from}: {density}"
            );
        }
    }
}

#[test]
fn a_post_before_a_slanted_surface_is_an_echo_of_its_own() {
    for sigmas in [3.0, 30.0] {
        let row = slanted(sigmas);
        let post = Glint {
            surface: 8,
            ..glint(80.0, -30.0)
        };
        let echoes = merge(&[&row[..], &[post]].concat());
        assert_eq!(echoes[0].photons, 80.0, "{sigmas} sigma");
        assert_eq!(echoes.len() > 2, merge(&row).len() > 1, "{sigmas} sigma");
    }
    // One that is faint beside it has as many slices as alone.
    let mut both = slanted(30.0);
    for glint in &mut both {
        glint.photons = 1e-3;
    }
    let alone = merge(&both).len();
    both.push(glint(2000.0, -40.0));
    assert_eq!(merge(&both).len(), alone + 1);
}

#[test]
fn an_echo_keeps_its_photons_and_its_place_beside_one_of_any_strength() {
    for brighter in [1.0, 1e2, 1e3, 1e4, 1e6] {
        for sigmas in [2.5, 4.0, 10.0, 100.0] {
            let found = merge(&[glint(5.0 * brighter, 0.0), glint(5.0, sigmas)]);
            let faint = found.iter().min_by(|a, b| a.photons.total_cmp(&b.photons));
            let faint = faint.unwrap();
            assert_eq!(found.len(), 2, "{brighter} times at {sigmas} sigma");
            assert_eq!(faint.photons, 5.0);
            // Of one object, too, where nothing of it lies between.
            let one = [glint(5.0 * brighter, 0.0), glint(5.0, sigmas)].map(|glint| Glint {
                surface: 0,
                ..glint
            });
            assert_eq!(merge(&one), found, "{brighter} times at {sigmas} sigma");
        }
    }
    // What no histogram shows goes to the others. Where it shows only together, it is one echo.
    let faint = |share: f64, sigmas: f64| glint(share * NEGLIGIBLE, sigmas);
    let found = merge(&[glint(5.0, 0.0), faint(0.5, 100.0)]);
    let brightest = glint(5.0 + 0.5 * NEGLIGIBLE, 0.0);
    assert_eq!(found, merge(&[brightest]));
    assert_eq!(merge(&[glint(5.0, 0.0), faint(2.0, 10.0)]).len(), 2);
    let many = [
        glint(5.0, 0.0),
        faint(0.6, 20.0),
        faint(0.6, 40.0),
        faint(0.6, 400.0),
    ];
    let found = merge(&many);
    assert_eq!(found.len(), 2);
    assert_eq!(found[1].arrival, Time::from_fs(553_333_333));
    let photons: f64 = found.iter().map(|echo| echo.photons).sum();
    assert!((photons - 5.0 - 1.8 * NEGLIGIBLE).abs() < 1e-12);
}

#[test]
fn nothing_gives_no_echo_and_one_point_the_pulse_itself() {
    assert!(merge(&[]).is_empty());
    assert!(merge(&[glint(0.0, 1.0), glint(0.0, 9.0)]).is_empty());
    let found = merge(&[glint(0.3, 2.0)]);
    let pulse = Echo::new(0.3, Time::from_fs(402_000_000));
    assert_eq!(found[0], pulse.with_sigma(Time::from_fs(SIGMA_FS as i64)));
}

proptest! {
    /// Photons, mean and variance are those of the sum of all pulses. Each echo puts at most [`MERGED_ERROR`] of its faintest surface's
    /// photons on the wrong side of an instant; where several overlap, these add up.
    #[test]
    fn merged_echoes_are_close_to_the_sum_of_all_pulses(
        mut glints in prop::collection::vec((0.0f64..1.0, 0.0f64..30.0), 1..40),
        scale in prop::sample::select(vec![0.03, 0.1, 0.2, 0.5, 1.0, 3.0]),
    ) {
        glints.sort_by(|a, b| a.1.total_cmp(&b.1));
        let glints: Vec<Glint> = glints.iter().map(|&(n, z)| glint(n + 1e-3, scale * z)).collect();
        let echoes = merge(&glints);
        let worst = off(&glints, &echoes);
        prop_assert!(worst < MERGED_ERROR, "{worst} with {} echoes", echoes.len());
        let photons: f64 = echoes.iter().map(|echo| echo.photons).sum();
        let sent: f64 = glints.iter().map(|glint| glint.photons).sum();
        prop_assert!((photons / sent - 1.0).abs() < 1e-12);
        let mean = |moment: &dyn Fn(f64, f64) -> f64| -> [f64; 2] {
            let echo = echoes.iter().map(|e| {
                let sigma = e.sigma.unwrap().as_fs() as f64 / SIGMA_FS;
                e.photons * moment(e.arrival.as_fs() as f64 / SIGMA_FS - 400.0, sigma * sigma)
            });
            let glint = glints.iter().map(|g| g.photons * moment(g.arrival_fs / SIGMA_FS - 400.0, 1.0));
            [echo.sum::<f64>() / sent, glint.sum::<f64>() / sent]
        };
        for of in [&|z: f64, _: f64| z, &|z: f64, own: f64| z * z + own] as [&dyn Fn(f64, f64) -> f64; 2] {
            let [found, exact] = mean(of);
            prop_assert!((found - exact).abs() < 1e-5 * (1.0 + exact.abs()), "{found} {exact}");
        }
    }
}
