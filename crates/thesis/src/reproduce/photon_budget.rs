//! Claims 7 to 10 and 21: photon budget, sunlight, probability of detection, precision.

use rayon::prelude::*;

use super::claim::ClaimRow;
use super::parameters;
use super::thesis::{chart, claim};
use crate::photon::solar::{FULL_SUN_KLUX, band_irradiance};
use crate::photon::{
    Convention, Filter, FilterShape, LaserDrift, PhotonBudget, Poisson, RandomPurpose,
    random_stream,
};
use crate::report::Chart;
use crate::theory::detection::{self, DetectionModel, PerCycle, Ties};

/// Table 6's system in either convention.
fn table_6(convention: Convention) -> PhotonBudget {
    PhotonBudget {
        convention,
        ..PhotonBudget::table_6()
    }
}

/// Reflectivity of Table 6's target.
const REFLECTIVITY: f64 = 0.1;

/// Claim 7: signal photons.
pub(super) fn signal_rows() -> Vec<ClaimRow> {
    let claim = claim(7);
    let thesis = table_6(Convention::Thesis);
    let at_200 = thesis.signal_per_pulse_far_field(200.0, REFLECTIVITY);
    let exact = thesis.signal_per_pulse(200.0, REFLECTIVITY);
    let lambertian = table_6(Convention::Lambertian).signal_per_pulse(200.0, REFLECTIVITY);
    vec![
        claim.row("signal", at_200 * 4e4),
        claim.row("signal_200_m", at_200),
        claim.row("far_field_error", at_200 / exact - 1.0),
        claim.row("signal_lambertian", lambertian * 4e4),
    ]
}

/// Claim 8: sunlight.
pub(super) fn background_rows() -> Vec<ClaimRow> {
    let claim = claim(8);
    let filter = Filter::new(905.0, 20.0, FilterShape::TopHat);
    let irradiance = band_irradiance(&filter);
    let hz = table_6(Convention::Thesis).background_hz(REFLECTIVITY, FULL_SUN_KLUX);
    let lambertian_hz = table_6(Convention::Lambertian).background_hz(REFLECTIVITY, FULL_SUN_KLUX);
    vec![
        claim.row("irradiance", irradiance),
        claim.row("background", hz / 1e6),
        claim.row("background_lambertian", lambertian_hz / 1e6),
    ]
}

/// Claim 21: the demonstrator's measured light.
pub(super) fn demonstrator_rows() -> Vec<ClaimRow> {
    let claim = claim(21);
    let scaled = parameters::demonstrator_light(100.0) / 1e6;
    vec![
        claim.row("background", scaled),
        claim.row("signal", parameters::demonstrator().link.signal),
    ]
    .into_iter()
    .chain(super::delay_line::light_rows())
    .collect()
}

/// Signal photons per cycle, and numbers of bins, of Fig. 32.
const FIG_32_SIGNAL: f64 = 0.1;
const FIG_32_BINS: [u32; 3] = [2, 4, 8];
/// Runs of the Monte Carlo at each point.
const RUNS: u32 = 5000;

fn fig_32_light(bins: u32) -> PerCycle {
    PerCycle {
        signal: FIG_32_SIGNAL,
        background: 1.0 / f64::from(bins),
        bins,
    }
}

/// Twenty numbers of laser cycles from 1 to 1000 in equal ratios.
fn fig_32_cycles() -> [u64; 20] {
    std::array::from_fn(|i| libm::pow(1000f64, i as f64 / 19.0).round() as u64)
}

/// Share of runs whose peak is the signal bin, ties drawn by lot.
fn monte_carlo(bins: u32, cycles: u64) -> f64 {
    let light = fig_32_light(bins);
    let n = cycles as f64;
    let background = Poisson::new(n * light.background);
    let signal = Poisson::new(n * (light.signal + light.background));
    let mut random = random_stream(32, RandomPurpose::Photons, bins, cycles as u32);
    let mut won = 0.0;
    for _ in 0..RUNS {
        let own = signal.draw(&mut random);
        let others: Vec<u32> = (1..bins).map(|_| background.draw(&mut random)).collect();
        if others.iter().all(|&other| other <= own) {
            let ties = others.iter().filter(|&&other| other == own).count();
            // The chance of the lot itself, which has its mean and less noise.
            won += 1.0 / (ties + 1) as f64;
        }
    }
    won / f64::from(RUNS)
}

fn formula(bins: u32, cycles: u64, model: DetectionModel) -> f64 {
    detection::probability(&fig_32_light(bins), cycles, model).probability
}

/// Claim 9: P_D against Monte Carlo.
pub(super) fn detection_rows() -> Vec<ClaimRow> {
    let claim = claim(9);
    let points: Vec<(u32, u64)> = FIG_32_BINS
        .into_iter()
        .flat_map(|bins| fig_32_cycles().map(|cycles| (bins, cycles)))
        .collect();
    let simulated: Vec<f64> = points.par_iter().map(|&(b, n)| monte_carlo(b, n)).collect();
    let worst = |model: DetectionModel, from: u64, error: &dyn Fn(f64, f64) -> f64| {
        let pairs = points
            .iter()
            .zip(&simulated)
            .filter(|((_, n), _)| *n >= from);
        pairs
            .map(|(&(bins, n), &p)| error(formula(bins, n, model), p))
            .fold(0.0, f64::max)
    };
    let in_sigmas = |p: f64, found: f64| {
        let sigma = (p * (1.0 - p) / f64::from(RUNS))
            .sqrt()
            .max(1.0 / f64::from(RUNS));
        (found - p).abs() / sigma
    };
    let absolute = |p: f64, found: f64| (found - p).abs();
    let lot = DetectionModel::Poisson(Ties::Random);
    let printed = worst(DetectionModel::GaussianAsPrinted, 100, &absolute);
    vec![
        claim.row("poisson", worst(lot, 1, &in_sigmas)),
        claim.row("gaussian", worst(DetectionModel::Gaussian, 100, &absolute)),
        claim.row("as_printed", printed),
        claim.row(
            "no_counts",
            detection::poisson(1e-9, 1e-9, 8, Ties::Random).probability,
        ),
        claim.row("one_cycle", formula(8, 1, lot)),
        claim.row(
            "ties_lost",
            formula(8, 1, DetectionModel::Poisson(Ties::Strict)),
        ),
        claim.row(
            "ties_won",
            formula(8, 1, DetectionModel::Poisson(Ties::Loose)),
        ),
        claim.row("thousand_cycles", formula(2, 1000, lot)),
        claim.row(
            "one_hit",
            formula(2, 1000, DetectionModel::Bernoulli(Ties::Random)),
        ),
    ]
}

/// Fig. 32: P_D by formula and by Monte Carlo.
pub(super) fn figure_32() -> Chart {
    let mut chart = chart(32);
    for bins in FIG_32_BINS {
        let line = (0..=60).map(|i| libm::pow(1000f64, f64::from(i) / 60.0).round() as u64);
        let exact = line.map(|n| {
            (
                n as f64,
                formula(bins, n, DetectionModel::Poisson(Ties::Random)),
            )
        });
        let runs = fig_32_cycles().map(|n| (n as f64, monte_carlo(bins, n)));
        chart = chart
            .line(format!("Eq. 17, Poisson, M = {bins}"), exact)
            .points(format!("Monte Carlo, M = {bins}"), runs);
    }
    let printed =
        fig_32_cycles().map(|n| (n as f64, formula(8, n, DetectionModel::GaussianAsPrinted)));
    chart.dashed("Eq. 18–19 as printed, M = 8", printed)
}

/// Fig. 34: photon budget against distance.
pub(super) fn figure_34() -> Chart {
    let budget = table_6(Convention::Thesis);
    let signal = (5..=250).map(|z| {
        (
            f64::from(z),
            budget.signal_per_pulse(f64::from(z), REFLECTIVITY),
        )
    });
    let mut chart = chart(34).line("signal", signal);
    for bin_ns in [1.0, 5.0, 10.0, 20.0] {
        let counts = budget.background_hz(REFLECTIVITY, FULL_SUN_KLUX) * bin_ns * 1e-9;
        let name = format!("background in {bin_ns} ns");
        chart = chart.dashed(name, [(5.0, counts), (250.0, counts)]);
    }
    chart
}

/// Fig. 94b: the demonstrator's budget.
pub(super) fn figure_94() -> Chart {
    let signal = (2..=75).map(|z| (f64::from(z), 89.0 / f64::from(z * z)));
    let background = |klux: f64| parameters::demonstrator_light(klux) * 2.6e-9;
    let level = |klux: f64| [(2.0, background(klux)), (75.0, background(klux))];
    chart(94)
        .line("signal", signal)
        .dashed("background at 60 klux", level(60.0))
        .dashed("background at 100 klux", level(100.0))
}

/// Fig. 20: wavelength of a VCSEL over temperature.
pub(super) fn figure_20() -> Chart {
    let drift = LaserDrift::vcsel(940.0);
    let line = |offset_nm: f64| {
        (-40..=105).map(move |c| (f64::from(c), drift.wavelength_nm(f64::from(c), offset_nm)))
    };
    chart(20)
        .line("typical", line(0.0))
        .dashed("longest", line(10.0))
        .dashed("shortest", line(-10.0))
}
