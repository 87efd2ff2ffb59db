//! Claims 7 to 10 and 21: photon budget, sunlight, probability of detection, precision.

use rayon::prelude::*;

use super::claim::Row;
use super::published::Published::*;
use crate::photon::solar::{FULL_SUN_KLUX, band_irradiance};
use crate::photon::{
    Convention, Filter, FilterShape, LaserDrift, PhotonBudget, Poisson, Purpose, random_stream,
};
use crate::report::{Axis, Chart, Style};
use crate::theory::detection::{self, Model, PerCycle, Ties};

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
pub(super) fn signal_rows() -> Vec<Row> {
    let thesis = table_6(Convention::Thesis);
    let at_200 = thesis.signal_per_pulse_far_field(200.0, REFLECTIVITY);
    let exact = thesis.signal_per_pulse(200.0, REFLECTIVITY);
    let lambertian = table_6(Convention::Lambertian).signal_per_pulse(200.0, REFLECTIVITY);
    vec![
        Row::holds("signal photons per pulse times z²", "m²", Within("1140", 5.0), at_200 * 4e4)
            .remark("Eq. 15 as printed; three digits of 1140."),
        Row::holds("signal photons per pulse at 200 m", "", Exactly("0.03"), at_200),
        Row::ours("relative error of 4z² ≫ d² at 200 m", "", at_200 / exact - 1.0),
        Row::ours("signal photons per pulse times z², Lambertian", "m²", lambertian * 4e4)
            .remark("Eq. 9 divides by π, and Eq. 12 multiplies by sin²α where radiometry has π sin²α: π times as much."),
    ]
}

/// Claim 8: sunlight.
pub(super) fn background_rows() -> Vec<Row> {
    let filter = Filter::new(905.0, 20.0, FilterShape::TopHat);
    let irradiance = band_irradiance(&filter);
    let hz = table_6(Convention::Thesis).background_hz(REFLECTIVITY, FULL_SUN_KLUX);
    let lambertian_hz = table_6(Convention::Lambertian).background_hz(REFLECTIVITY, FULL_SUN_KLUX);
    vec![
        Row::holds(
            "solar irradiance in 905 ± 10 nm",
            "W/m²",
            Exactly("13.8"),
            irradiance,
        )
        .remark("ASTM G173, global tilt, trapezoids. Printed as W/sr/m², used as it stands."),
        Row::holds(
            "background at 100 klux",
            "Mcounts/s",
            Exactly("20"),
            hz / 1e6,
        ),
        Row::ours(
            "background at 100 klux, Lambertian",
            "Mcounts/s",
            lambertian_hz / 1e6,
        ),
    ]
}

/// Claim 21: the demonstrator's measured light.
pub(super) fn demonstrator_rows() -> Vec<Row> {
    let scaled = super::penalty::demonstrator_light(100.0) / 1e6;
    vec![
        Row::holds(
            "background at 100 klux, from 4.8 Mcounts/s at 60 klux",
            "Mcounts/s",
            Exactly("8"),
            scaled,
        )
        .given("4.8 × 100/60: both published, and the model does not come between."),
        Row::holds(
            "signal photons per pulse times z²",
            "m²",
            Exactly("89"),
            super::penalty::demonstrator().link.signal,
        )
        .given("Measured, and put into the model: the laser's energy, which could give it, is not published."),
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
    std::array::from_fn(|i| 1000f64.powf(i as f64 / 19.0).round() as u64)
}

/// Share of runs whose peak is the signal bin, ties drawn by lot.
fn monte_carlo(bins: u32, cycles: u64) -> f64 {
    let light = fig_32_light(bins);
    let n = cycles as f64;
    let background = Poisson::new(n * light.background);
    let signal = Poisson::new(n * (light.signal + light.background));
    let mut random = random_stream(32, Purpose::Photons, bins, cycles as u32);
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

fn formula(bins: u32, cycles: u64, model: Model) -> f64 {
    detection::probability(&fig_32_light(bins), cycles, model).probability
}

/// Claim 9: P_D against Monte Carlo.
pub(super) fn detection_rows() -> Vec<Row> {
    let points: Vec<(u32, u64)> = FIG_32_BINS
        .into_iter()
        .flat_map(|bins| fig_32_cycles().map(|cycles| (bins, cycles)))
        .collect();
    let simulated: Vec<f64> = points.par_iter().map(|&(b, n)| monte_carlo(b, n)).collect();
    let worst = |model: Model, from: u64, error: &dyn Fn(f64, f64) -> f64| {
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
    let lot = Model::Poisson(Ties::Random);
    let printed = worst(Model::GaussianAsPrinted, 100, &absolute);
    vec![
        Row::holds("largest deviation from Monte Carlo, exact Poisson", "standard errors", Says("match closely", 0.0, 4.0), worst(lot, 1, &in_sigmas))
            .remark("60 points of 5000 runs: M = 2, 4, 8, N = 1 to 1000. Ties by lot; 4 standard errors happen by chance once in 250 such comparisons."),
        Row::holds("largest deviation from N = 100 on, Gaussian as meant", "", Says("match closely", 0.0, 0.02), worst(Model::Gaussian, 100, &absolute))
            .remark("σ = √mean."),
        Row::holds("largest deviation from N = 100 on, Gaussian as printed", "", Says("match closely", 0.0, 0.02), printed)
            .differs("Eq. 18 and 19 print the mean where σ = √mean is meant; with that the formula cannot match the Monte Carlo beside it."),
        Row::holds(
            "P_D in the limit of no counts, M = 8",
            "",
            Exactly("0.125"),
            detection::poisson(1e-9, 1e-9, 8, Ties::Random).probability,
        )
        .remark("It “converges to 1/M”: with ties by lot."),
        Row::ours("P_D after one laser cycle, M = 8", "", formula(8, 1, lot)),
        Row::ours("the same, ties lost (as the text says)", "", formula(8, 1, Model::Poisson(Ties::Strict))),
        Row::ours("the same, ties won (as Eq. 17 is printed)", "", formula(8, 1, Model::Poisson(Ties::Loose))),
        Row::ours("P_D at N = 1000, M = 2", "", formula(2, 1000, lot)),
        Row::ours("the same, one hit per bin and cycle", "", formula(2, 1000, Model::Bernoulli(Ties::Random)))
            .remark("As the chip counts: at half a background photon per bin and cycle it loses some."),
    ]
}

/// Fig. 32: P_D by formula and by Monte Carlo.
pub(super) fn figure_32() -> Vec<Chart> {
    let mut chart = Chart::new(
        "Probability of detection, γ_s = 0.1, γ_b = 1/M: formula and 5000 Monte Carlo runs a point",
        Axis::log("laser cycles N"),
        Axis::linear("P_D").between(0.0, 1.02),
    );
    for bins in FIG_32_BINS {
        let line = (0..=60).map(|i| 1000f64.powf(f64::from(i) / 60.0).round() as u64);
        let exact = line.map(|n| (n as f64, formula(bins, n, Model::Poisson(Ties::Random))));
        let runs = fig_32_cycles().map(|n| (n as f64, monte_carlo(bins, n)));
        chart = chart
            .with(format!("Eq. 17, Poisson, M = {bins}"), Style::Line, exact)
            .with(format!("Monte Carlo, M = {bins}"), Style::Points, runs);
    }
    let printed = fig_32_cycles().map(|n| (n as f64, formula(8, n, Model::GaussianAsPrinted)));
    vec![chart.with("Eq. 18–19 as printed, M = 8", Style::Dashed, printed)]
}

/// Fig. 34: photon budget against distance.
pub(super) fn figure_34() -> Vec<Chart> {
    let budget = table_6(Convention::Thesis);
    let signal = (5..=250).map(|z| {
        (
            f64::from(z),
            budget.signal_per_pulse(f64::from(z), REFLECTIVITY),
        )
    });
    let mut chart = Chart::new(
        "Photon budget of Table 6: signal per pulse, and background per bin",
        Axis::linear("distance (m)"),
        Axis::log("photons"),
    )
    .with("signal", Style::Line, signal);
    for bin_ns in [1.0, 5.0, 10.0, 20.0] {
        let counts = budget.background_hz(REFLECTIVITY, FULL_SUN_KLUX) * bin_ns * 1e-9;
        let name = format!("background in {bin_ns} ns");
        chart = chart.with(name, Style::Dashed, [(5.0, counts), (250.0, counts)]);
    }
    vec![chart]
}

/// Fig. 94b: the demonstrator's budget.
pub(super) fn figure_94() -> Vec<Chart> {
    let signal = (2..=75).map(|z| (f64::from(z), 89.0 / f64::from(z * z)));
    let background = |klux: f64| super::penalty::demonstrator_light(klux) * 2.6e-9;
    let level = |klux: f64| [(2.0, background(klux)), (75.0, background(klux))];
    vec![
        Chart::new(
            "The demonstrator's measured budget: 89 z⁻² counts a pulse, background in a 2.6 ns bin",
            Axis::linear("distance (m)"),
            Axis::log("counts per laser cycle"),
        )
        .with("signal", Style::Line, signal)
        .with("background at 60 klux", Style::Dashed, level(60.0))
        .with("background at 100 klux", Style::Dashed, level(100.0)),
    ]
}

/// Fig. 20: wavelength of a VCSEL over temperature.
pub(super) fn figure_20() -> Vec<Chart> {
    let drift = LaserDrift::vcsel(940.0);
    let line = |offset_nm: f64| {
        (-40..=105).map(move |c| (f64::from(c), drift.wavelength_nm(f64::from(c), offset_nm)))
    };
    vec![
        Chart::new(
            "Wavelength of a 940 nm VCSEL over temperature and process",
            Axis::linear("temperature (°C)"),
            Axis::linear("wavelength (nm)"),
        )
        .with("typical", Style::Line, line(0.0))
        .with("longest", Style::Dashed, line(10.0))
        .with("shortest", Style::Dashed, line(-10.0)),
    ]
}
