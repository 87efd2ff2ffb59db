//! Eq. 17 against the chip: how often the fullest bin is the echo's.

use super::trial::{Effect, Trial};
use super::{MeasuredStudy, interval_text};
use crate::chip::Overflow;
use crate::engine::EngineError;
use crate::numerics::intervals::{Estimate, share};
use crate::report::{Chart, Grid};
use crate::reproduce::parameters::sigma_over_fwhm;
use crate::reproduce::thesis::measurement;
use crate::theory::cycles::laser_cycles_for;
use crate::theory::detection::{DetectionModel, PerCycle, Ties, probability};

/// Eq. 17 with every photon counted, ties by lot.
const EQ_17: DetectionModel = DetectionModel::Poisson(Ties::Random);
/// The same with one hit per bin and cycle.
const ONE_HIT: DetectionModel = DetectionModel::Bernoulli(Ties::Random);

/// Background of the thesis's Table 6, counts/s.
const DAYLIGHT_HZ: f64 = 20e6;

/// P_D of `trial` in `frames` frames, or as many as are affordable.
///
/// # Errors
/// Configurations that no engine can run.
pub fn detected(trial: &Trial, frames: usize, seed: u64) -> Result<Estimate, EngineError> {
    let histograms = trial.histograms(trial.affordable(frames), seed, |_| 0.0)?;
    Ok(detection_share(trial, &histograms, trial.ties_by_lot))
}

/// P_D in some histograms. By lot, a tie of k bins is found one time in k.
pub(super) fn detection_share(trial: &Trial, histograms: &[Vec<u32>], by_lot: bool) -> Estimate {
    let echo = trial.echo_bins.round() as usize;
    let won = |counts: &Vec<u32>| {
        let most = counts.iter().max().expect("a bin");
        let mut fullest = (0..counts.len()).filter(|&bin| counts[bin] == *most);
        if !by_lot {
            f64::from(fullest.next() == Some(echo))
        } else if counts[echo] == *most {
            1.0 / fullest.count() as f64
        } else {
            0.0
        }
    };
    share(histograms.iter().map(won).sum(), histograms.len() as f64)
}

fn by_formula(light: &PerCycle, cycles: u32, model: DetectionModel) -> f64 {
    probability(light, cycles.into(), model).probability
}

/// Light under which P_D is swept: its name, photons of the echo, background.
const LIGHTS: [(&str, f64, f64); 2] = [
    ("daylight", 0.05, DAYLIGHT_HZ),
    ("15 x daylight", 0.3, 15.0 * DAYLIGHT_HZ),
];

/// Values of P_D by Eq. 17 at which the chip is measured.
const LEVELS: [f64; 6] = [0.1, 0.3, 0.6, 0.8, 0.95, 0.997];

/// P_D against laser cycles.
fn sweep(frames: usize) -> Result<(Grid, Chart), EngineError> {
    let mut grid = measurement(1).grid(0);
    let mut chart = measurement(1).chart();
    for (name, signal, background_hz) in LIGHTS {
        let trial = Trial::new(signal, background_hz, 1);
        let light = trial.per_cycle();
        let cycles = LEVELS.map(|level| {
            let cycles = laser_cycles_for(level, &light, EQ_17);
            cycles.expect("an echo that can be found") as u32
        });
        let (mut measured, mut ends) = (Vec::new(), Vec::new());
        for (index, cycles) in cycles.into_iter().enumerate() {
            let trial = Trial {
                cycles,
                ties_by_lot: true,
                ..trial.clone()
            };
            let chip = detected(&trial, frames, index as u64)?;
            let thin = detected(&trial.in_thin_light(), frames, index as u64)?;
            let formula = by_formula(&light, cycles, EQ_17);
            grid.push([
                name.to_owned(),
                cycles.to_string(),
                format!("{formula:.4}"),
                format!("{:.4}", by_formula(&light, cycles, ONE_HIT)),
                format!("{:.4}", chip.value),
                interval_text(&chip, 4),
                format!("{:+.4}", chip.value - formula),
                format!("{:.4}", thin.value),
                interval_text(&thin, 4),
            ]);
            let x = f64::from(cycles);
            measured.push((x, chip.value));
            ends.extend([(x, chip.low), (x, chip.high)]);
        }
        let (first, last) = (f64::from(cycles[0]), f64::from(cycles[LEVELS.len() - 1]));
        let curve = (0..=40).map(|i| {
            let cycles = (first * libm::pow(last / first, f64::from(i) / 40.0)).round();
            (cycles, by_formula(&light, cycles as u32, EQ_17))
        });
        chart = chart
            .line(format!("Eq. 17, {name}"), curve)
            .points(format!("chip, {name}"), measured)
            .whiskers("", ends);
    }
    Ok((grid, chart))
}

/// Cases in which an assumption of Eq. 17 fails. Their exposures make Eq. 17 promise 90 %, where none is given.
fn cases() -> Vec<(&'static str, Trial)> {
    let case = |signal, times_daylight: f64| Trial::new(signal, times_daylight * DAYLIGHT_HZ, 0);
    let long = |overflow, cycles| Trial {
        cycles,
        ..case(0.3, 15.0).with_sensor_change(|sensor| sensor.overflow = overflow)
    };
    let cases = vec![
        ("daylight, a narrow echo", case(0.05, 1.0)),
        ("few photons: no background to speak of", case(0.05, 0.002)),
        (
            "Table 6's pulse of 8 ns over bins of 2.6 ns",
            Trial {
                sigma_ns: 8.0 * sigma_over_fwhm(),
                ..case(0.05, 1.0)
            },
        ),
        ("15 x daylight", case(0.3, 15.0)),
        ("60 x daylight", case(1.0, 60.0)),
        (
            "15 x daylight, paralysable SPADs of 8 ns",
            case(0.3, 15.0).with_sensor_change(|sensor| sensor.paralysable = true),
        ),
        (
            "daylight, 2 SPADs at a time",
            case(0.05, 1.0).with_sensor_change(|sensor| sensor.threshold = 1),
        ),
        (
            "60 x daylight, 5 SPADs at a time",
            case(1.0, 60.0).with_sensor_change(|sensor| sensor.threshold = 4),
        ),
        (
            "15 x daylight, 40 000 cycles, saturating",
            long(Overflow::Saturate, 40_000),
        ),
        (
            "15 x daylight, 28 000 cycles, wrapping",
            long(Overflow::Wrap, 28_000),
        ),
    ];
    let with_cycles = |(name, trial): (&'static str, Trial)| {
        let enough = laser_cycles_for(0.9, &trial.per_cycle(), EQ_17);
        let cycles = match trial.cycles {
            0 => enough.expect("an echo that can be found") as u32,
            given => given,
        };
        (name, Trial { cycles, ..trial })
    };
    cases.into_iter().map(with_cycles).collect()
}

/// A case, measured with everything in place and with each effect taken out alone.
#[derive(Debug, Clone)]
pub struct Attribution {
    /// What the case is.
    pub name: &'static str,
    /// The macropixel.
    pub trial: Trial,
    /// Eq. 17.
    pub formula: f64,
    /// P_D of the chip.
    pub chip: Estimate,
    /// P_D without each of [`Effect::ALL`]; `None` where it plays no part. Of long exposures only what overflow and ties
    /// do is measured.
    pub without: [Option<Estimate>; 6],
    /// P_D without any.
    pub control: Estimate,
}

impl Attribution {
    /// The effect whose absence brings the chip nearest to Eq. 17, if the chip misses it and the absence shows.
    pub fn cause(&self) -> Option<Effect> {
        if self.chip.contains(self.formula) {
            return None;
        }
        let distance = |e: &Estimate| (e.value - self.formula).abs();
        let absent = Effect::ALL.into_iter().zip(&self.without);
        let shows = absent.filter_map(|(effect, without)| {
            let without = without.as_ref()?;
            let apart = without.low > self.chip.high || without.high < self.chip.low;
            (apart && distance(without) < distance(&self.chip)).then(|| (effect, distance(without)))
        });
        shows
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(effect, _)| effect)
    }
}

/// Measures every case in `frames` frames.
///
/// # Errors
/// Configurations that no engine can run.
pub fn attributions(frames: usize) -> Result<Vec<Attribution>, EngineError> {
    let cases = cases().into_iter().enumerate();
    let measured = cases.map(|(number, (name, trial))| {
        let seed = 100 + number as u64;
        let histograms = trial.histograms(trial.affordable(frames), seed, |_| 0.0)?;
        let mut without = [None; 6];
        let is_long = trial.without_effect(Effect::Overflow).is_some();
        for (effect, without) in Effect::ALL.into_iter().zip(&mut without) {
            let is_slow = is_long && matches!(effect, Effect::DeadTime | Effect::OneHit);
            if is_slow {
                continue;
            } else if effect == Effect::Ties {
                *without = Some(detection_share(&trial, &histograms, true));
            } else if let Some(trial) = trial.without_effect(effect) {
                *without = Some(detected(&trial, frames, seed)?);
            }
        }
        let control = trial.in_thin_light();
        let control = control.without_effect(Effect::Spread).unwrap_or(control);
        Ok(Attribution {
            name,
            formula: by_formula(&trial.per_cycle(), trial.cycles, EQ_17),
            chip: detection_share(&trial, &histograms, false),
            without,
            control: detected(&control, frames, seed)?,
            trial,
        })
    });
    measured.collect()
}

fn failures(frames: usize) -> Result<Grid, EngineError> {
    let mut headings = vec![
        "case",
        "laser cycles",
        "Eq. 17",
        "chip",
        "95 % interval",
        "chip - Eq. 17",
    ];
    headings.extend(Effect::ALL.map(Effect::absent));
    headings.extend(["thin light, none of these", "mends most"]);
    let mut grid = Grid::new(headings);
    for case in attributions(frames)? {
        let mut cells = vec![
            case.name.to_owned(),
            case.trial.cycles.to_string(),
            format!("{:.4}", case.formula),
            format!("{:.4}", case.chip.value),
            interval_text(&case.chip, 4),
            format!("{:+.4}", case.chip.value - case.formula),
        ];
        let without = case.without.iter();
        cells.extend(without.map(|w| w.map_or("-".into(), |w| format!("{:.4}", w.value))));
        cells.push(format!("{:.4}", case.control.value));
        let cause = case.cause().map_or("-", Effect::absent);
        cells.push(cause.to_owned());
        grid.push(cells);
    }
    Ok(grid)
}

/// The study.
///
/// # Errors
/// Configurations that no engine can run.
pub(crate) fn study(frames: usize) -> Result<MeasuredStudy, EngineError> {
    let (sweep, chart) = sweep(frames)?;
    let grids = [sweep, failures(frames)?];
    Ok(measurement(1).study(&[("frames", frames)], grids, Some(chart)))
}
