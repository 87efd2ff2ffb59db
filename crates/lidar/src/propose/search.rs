//! All designs of a space by theory: the best of them, the sensor itself among them, and what is wrong where none will do.
//!
//! For each CLK, THRESHOLD and energy the echo is computed once, and seen through windows of any number of bins. Left out is what
//! cannot be on the front: bins of more bits than the counts need, and energies below one that needs more laser cycles than a frame has.
//! Energies come in steps; those of the designs on the front are then solved for.

use rayon::prelude::*;

use super::confirm::{ConfirmedDesign, confirmed};
use super::front::{dominates, front};
use super::goal::{Choice, Space};
use super::point::{Candidate, DesignPoint, Limit, NotFound};
use super::problem::{MOST_CYCLES, Problem};
use crate::chip::SensorConfig;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Pulses a second that are tried below the most that the range allows, 1/s: of 200 kHz and its multiples fewer pulses
/// count as one for eyes (IEC 60825-1).
const RATES_HZ: [f64; 14] = [
    f64::MAX,
    1000e3,
    800e3,
    600e3,
    400e3,
    300e3,
    200e3,
    140e3,
    100e3,
    80e3,
    50e3,
    30e3,
    20e3,
    10e3,
];

/// Energies of a decade, and decades below the most that a single pulse may have (and above, where nothing else will do).
const A_DECADE: i32 = 8;
const BELOW: i32 = 5;
const ABOVE: i32 = 3;

/// The best designs.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchResult {
    /// The Pareto front, the least laser power first.
    pub front: Vec<ConfirmedDesign>,
    /// Designs that were judged.
    pub tried: u64,
    /// The sensor that all were made from.
    pub own: Own,
}

/// A step of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchStep {
    /// All designs of a CLK and a THRESHOLD are judged.
    Clock,
    /// A design is checked.
    Check,
}

/// What becomes of the sensor as it is, with the laser and guide that suit it best.
#[derive(Debug, Clone, PartialEq)]
pub enum Own {
    /// It is on the front.
    OnFront(DesignPoint),
    /// Points of the front beat it, the best first.
    Beaten(DesignPoint, Vec<DesignPoint>),
    /// It cannot do it.
    Impossible(Limit),
}

impl Own {
    /// The sensor with its laser and guide, where it can do it.
    pub fn point(&self) -> Option<&DesignPoint> {
        match self {
            Own::OnFront(point) | Own::Beaten(point, _) => Some(point),
            Own::Impossible(_) => None,
        }
    }
}

/// What some designs came to.
#[derive(Debug, Default)]
struct SearchTally {
    points: Vec<DesignPoint>,
    tried: u64,
    /// Of those that only eyes forbid, the nearest to what is allowed; and of the others.
    nearest: [Option<Candidate>; 2],
    limit: Option<Limit>,
}

impl SearchTally {
    fn add(&mut self, candidate: Candidate) {
        self.tried += 1;
        if candidate.limit().is_none() {
            return self.points.push(candidate.point);
        }
        let excess = |c: &Candidate| c.time.max(c.counts);
        let is_of_eyes = excess(&candidate) <= 1.0;
        let over = |c: &Candidate| if is_of_eyes { c.eye.0 } else { excess(c) };
        let nearest = &mut self.nearest[usize::from(!is_of_eyes)];
        if nearest.is_none_or(|best| over(&candidate) < over(&best)) {
            *nearest = Some(candidate);
        }
    }

    /// Of two limits the one that is nearer to a design.
    fn limited(&mut self, limit: Limit) {
        let rank = |limit: &Limit| match *limit {
            Limit::Light { .. } => 2.0,
            Limit::Guide { share, .. } => 1.0 + share,
            // Less energy is tried, too.
            Limit::Blinding { .. } => -1.0,
            _ => 0.0,
        };
        if self
            .limit
            .as_ref()
            .is_none_or(|known| rank(known) < rank(&limit))
        {
            self.limit = Some(limit);
        }
    }

    fn and(mut self, other: Self) -> Self {
        let tried = self.tried + other.tried;
        self.points.extend(other.points);
        let nearest = other.nearest.into_iter().flatten();
        nearest.for_each(|candidate| self.add(candidate));
        other
            .limit
            .into_iter()
            .for_each(|limit| self.limited(limit));
        SearchTally { tried, ..self }
    }
}

/// Energies, uJ, the most first.
fn energies_uj(problem: &Problem, above: i32) -> Vec<f64> {
    let steps = -above * A_DECADE..=BELOW * A_DECADE;
    let energy =
        |step| problem.most_energy_uj() * libm::pow(10f64, -f64::from(step) / f64::from(A_DECADE));
    steps.map(energy).collect()
}

/// Designs of one CLK and THRESHOLD; `own` keeps the bits of the sensor.
fn of_clock(
    problem: &Problem,
    space: &Space,
    (clk_hz, threshold): (f64, u8),
    own: bool,
    above: i32,
) -> SearchTally {
    let sensor = problem.sensor();
    let mut gathered = SearchTally::default();
    // What a frame leaves at the most pulses a second, which the target's range allows at best; no limit where limits are sought.
    let most = match above {
        0 => {
            let round_trip_s = 2.0 * problem.goal().range_m / SPEED_OF_LIGHT_M_PER_S;
            let most = 1.0 / problem.goal().fps / round_trip_s;
            most.min(f64::from(MOST_CYCLES)) as u32
        }
        _ => MOST_CYCLES,
    };
    // Windows that were wide enough before, and those of which less light is too little.
    let mut seen_before = vec![false; space.bins.len()];
    let mut is_done = vec![false; space.bins.len()];
    for pulse_energy_uj in energies_uj(problem, above) {
        if is_done.iter().all(|done| *done) {
            break;
        }
        let echo = problem.echo(clk_hz, threshold, pulse_energy_uj);
        for (at, &bins) in space.bins.iter().enumerate() {
            if is_done[at] {
                continue;
            }
            let seen = echo.windowed(bins);
            let choice = Choice {
                bins,
                clk_hz,
                threshold,
                pulse_energy_uj,
                bin_bits: own.then_some(sensor.bin_bits),
                counter_bits: own.then_some(sensor.counter_bits),
                ..Choice::default()
            };
            let mut least = 1;
            let mut found = false;
            // From the best guide on: a worse one takes as many laser cycles or more.
            for &guide_sigma_m in &space.guide_sigma_m {
                let choice = Choice {
                    guide_sigma_m,
                    ..choice
                };
                let take = |candidate| gathered.add(candidate);
                match problem.designs(&choice, &seen, (least, most), &RATES_HZ, take) {
                    Ok(cycles) => (least, found) = (cycles, true),
                    Err(limit) => {
                        gathered.limited(limit);
                        break;
                    }
                }
            }
            is_done[at] = seen_before[at] && !found;
            seen_before[at] |= found;
        }
    }
    gathered
}

/// All designs of a space; `done` is told of each CLK and THRESHOLD.
fn gather(
    problem: &Problem,
    space: &Space,
    own: bool,
    above: i32,
    done: &(impl Fn() + Sync),
) -> SearchTally {
    let clocks = space.clk_hz.iter();
    let clocks = clocks.flat_map(|&clk| space.thresholds.iter().map(move |&t| (clk, t)));
    let clocks: Vec<(f64, u8)> = clocks.collect();
    let all: Vec<SearchTally> = (clocks.par_iter())
        .map(|&clock| {
            let gathered = of_clock(problem, space, clock, own, above);
            done();
            gathered
        })
        .collect();
    all.into_iter()
        .fold(SearchTally::default(), SearchTally::and)
}

/// Designs of the front with as much energy as costs nothing else, and as much as is allowed.
fn solved(problem: &Problem, own: bool, points: &[DesignPoint]) -> Vec<DesignPoint> {
    let step = libm::pow(10f64, 1.0 / f64::from(A_DECADE));
    let solve = |point: &DesignPoint| -> Vec<DesignPoint> {
        let with = |times: f64| -> Option<DesignPoint> {
            // More light takes fewer laser cycles, by the square at most.
            let least = f64::from(point.design.laser_cycles) / (2.0 * times * times);
            let choice = Choice::from_point(point, times, own);
            let candidate = problem.judge_from(&choice, 1 + least as u32).ok()?;
            candidate.limit().is_none().then_some(candidate.point)
        };
        let costs = point.costs();
        let is_no_worse = |p: &DesignPoint| p.costs().iter().zip(&costs).all(|(p, own)| p <= own);
        let free = most_times(step, |times| with(times).filter(is_no_worse));
        let allowed = most_times(step, with);
        free.into_iter().chain(allowed).collect()
    };
    let best = front(points.to_vec(), DesignPoint::costs);
    best.par_iter().flat_map_iter(solve).collect()
}

/// What `of` makes of the greatest number from 1 to `step` of which it makes something, to a thousandth; nothing if that is 1 or `step`.
fn most_times<T>(step: f64, attempt: impl Fn(f64) -> Option<T>) -> Option<T> {
    if attempt(step).is_some() {
        return None;
    }
    let (mut low, mut high, mut found) = (1.0, step, None);
    while high - low > 1e-3 {
        let middle = 0.5 * (low + high);
        match attempt(middle) {
            Some(one) => (low, found) = (middle, Some(one)),
            None => high = middle,
        }
    }
    found
}

/// What makes all designs of a space impossible, the guide being as good as any that is tried.
fn limit_of(problem: &Problem, space: &Space, own: bool) -> Limit {
    let space = Space {
        guide_sigma_m: space.guide_sigma_m[..1].to_vec(),
        ..space.clone()
    };
    let gathered = gather(problem, &space, own, ABOVE, &|| ());
    let nearest = gathered.nearest.into_iter().flatten();
    let limit = nearest.filter_map(|candidate| candidate.limit()).next();
    limit
        .or(gathered.limit)
        .unwrap_or(Limit::Light { most: MOST_CYCLES })
}

/// The best of a space, with their timing met, and confirmed by `cohort` with the photons of `seed`. `done` is told of each pair of CLK and THRESHOLD,
/// and of each design that is checked.
///
/// # Errors
/// What makes all of them impossible, and what an engine refuses.
pub fn search(
    problem: &Problem,
    space: &Space,
    seed: u64,
    done: impl Fn(SearchStep) + Sync,
) -> Result<SearchResult, NotFound> {
    let mut space = space.clone();
    for values in [&mut space.clk_hz, &mut space.guide_sigma_m] {
        values.sort_by(f64::total_cmp);
        values.dedup();
    }
    let sensor = problem.sensor();
    let (bins, mut too_fast) = (space.bins[space.bins.len() / 2], None);
    space.clk_hz.retain(|&clk_hz| {
        let config = SensorConfig {
            clk_hz,
            bins,
            ..SensorConfig::clone(sensor)
        };
        let timing = timed(problem, &config);
        let is_met = timing.is_ok();
        too_fast = too_fast.take().or(timing.err());
        is_met
    });
    if let (true, Some(limit)) = (space.clk_hz.is_empty(), too_fast) {
        return Err(limit.into());
    }
    let gathered = gather(problem, &space, false, 0, &|| done(SearchStep::Clock));
    let own_space = Space {
        bins: vec![sensor.bins],
        clk_hz: vec![sensor.clk_hz],
        thresholds: vec![sensor.threshold],
        ..space.clone()
    };
    let of_own = gather(problem, &own_space, true, 0, &|| ());
    let solved_for = solved(problem, false, &gathered.points);
    let tried = gathered.tried + of_own.tried + solved_for.len() as u64;
    let points = [gathered.points, solved_for].concat();
    let front = confirmed(problem, points, seed, || done(SearchStep::Check))?;
    if front.is_empty() {
        return Err(limit_of(problem, &space, false).into());
    }
    let own = match timed(problem, sensor) {
        Err(limit) => Own::Impossible(limit),
        Ok(()) if of_own.points.is_empty() => Own::Impossible(limit_of(problem, &own_space, true)),
        Ok(()) => {
            let solved_for = solved(problem, true, &of_own.points);
            compare_own(&front, [of_own.points, solved_for].concat())
        }
    };
    Ok(SearchResult { tried, front, own })
}

/// A chip's timing as a limit.
fn timed(problem: &Problem, config: &SensorConfig) -> Result<(), Limit> {
    let mhz = config.clk_hz * 1e-6;
    problem
        .timing(config)
        .map_err(|why| Limit::Timing { mhz, why })
}

/// The sensor's own designs beside the front.
fn compare_own(best: &[ConfirmedDesign], mut own: Vec<DesignPoint>) -> Own {
    own.sort_by(|a, b| a.ln_cost().total_cmp(&b.ln_cost()));
    let beats = |point: &DesignPoint| {
        let own = point.costs();
        let best = best.iter().map(|one| one.point);
        let mut better: Vec<DesignPoint> = best.filter(|p| dominates(&p.costs(), &own)).collect();
        better.sort_by(|a, b| a.ln_cost().total_cmp(&b.ln_cost()));
        better
    };
    match own.iter().find(|point| beats(point).is_empty()) {
        Some(point) => Own::OnFront(*point),
        None => Own::Beaten(own[0], beats(&own[0])),
    }
}
