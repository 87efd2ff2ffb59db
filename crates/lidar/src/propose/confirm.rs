//! The front of designs that `cohort` confirms. Theory's precision is a bound: ranging also fits the echo's width, and windows of four bins scatter
//! two to three times as much.
//!
//! ```text
//!   designs by theory ──► front ──► static timing ──► check on `cohort` ──┬─► all reach the goal: done
//!            ▲                                                            │
//!            └── the same with more laser cycles, or without it ◄── does not reach it
//! ```

use std::collections::HashSet;

use rayon::prelude::*;

use super::check::{Check, check};
use super::front::front;
use super::goal::Choice;
use super::point::{DesignPoint, Limit, NotFound};
use super::problem::Problem;
use crate::system::FrameError;

/// Laser cycles of a design that misses the goal are made more by this at most; of one that misses by more, the whole kind is given up.
const MORE: f64 = 1.5;

/// Fronts that are checked, each without what the one before it has lost: chosen, as later ones change little and take as long.
const ROUNDS: usize = 4;

/// A design, and what `cohort` finds of it: its interval reaches what was asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConfirmedDesign {
    /// The design.
    pub point: DesignPoint,
    /// What `cohort` finds of it.
    pub check: Check,
}

/// The front of `points`, each confirmed with the photons of `seed`; `done` is told of every check. Empty if no chip of them meets its timing.
///
/// # Errors
/// What the nearest design misses, if none is confirmed, and what an engine refuses.
pub(super) fn confirmed(
    problem: &Problem,
    mut points: Vec<DesignPoint>,
    seed: u64,
    done: impl Fn() + Sync,
) -> Result<Vec<ConfirmedDesign>, NotFound> {
    let (mut good, mut chips) = (Vec::<ConfirmedDesign>::new(), HashSet::new());
    let mut nearest: Option<ConfirmedDesign> = None;
    for _ in 0..ROUNDS {
        let best = met(problem, &mut points, &mut chips);
        let new = (best.iter()).filter(|p| !good.iter().any(|known| known.point == **p));
        let checked: Result<Vec<ConfirmedDesign>, FrameError> =
            (new.collect::<Vec<_>>().par_iter())
                .map(|&&point| {
                    let check = check(problem, &point, seed)?;
                    done();
                    Ok(ConfirmedDesign { point, check })
                })
                .collect();
        let (reach, miss): (Vec<_>, Vec<_>) =
            (checked?.into_iter()).partition(|one| one.check.reaches(problem.goal()));
        good.extend(reach);
        if miss.is_empty() {
            break;
        }
        for one in &miss {
            let times = one.check.short_of(problem.goal());
            if times < MORE {
                points.retain(|point| *point != one.point);
                points.extend(longer(problem, &one.point, times));
            } else {
                points.retain(|point| kind(point) != kind(&one.point));
            }
        }
        let far = |one: &ConfirmedDesign| one.check.short_of(problem.goal());
        nearest = (nearest.into_iter().chain(miss)).min_by(|a, b| far(a).total_cmp(&far(b)));
    }
    match nearest {
        Some(nearest) if good.is_empty() => Err(limit(problem, &nearest).into()),
        _ => Ok(front(good, |one| one.point.costs())),
    }
}

/// What laser cycles and light leave as it is.
fn kind(point: &DesignPoint) -> (usize, u64, u8, u64) {
    let design = &point.design;
    let [clk, guide] = [design.clk_hz, design.guide_sigma_m].map(f64::to_bits);
    (design.bins, clk, design.threshold, guide)
}

/// The same design with `times` the laser cycles, or a little more; nothing if these cost more than may be.
fn longer(problem: &Problem, point: &DesignPoint, times: f64) -> Option<DesignPoint> {
    let least = (f64::from(point.design.laser_cycles) * times.max(1.02)).ceil() as u32;
    let candidate = problem.judge_from(&Choice::from_point(point, 1.0, false), least);
    let candidate = candidate.ok()?;
    candidate.limit().is_none().then_some(candidate.point)
}

/// What a check says against a goal.
fn limit(problem: &Problem, missed: &ConfirmedDesign) -> Limit {
    let goal = problem.goal();
    Limit::Unconfirmed {
        detection: missed.check.detection.value,
        detection_goal: goal.detection,
        precision_m: missed.check.precision_m.value,
        precision_goal_m: goal.precision_m,
    }
}

/// A chip, by what its timing depends on.
pub(super) type Chip = (usize, usize, usize, u64);

fn chip(point: &DesignPoint) -> Chip {
    let design = &point.design;
    (
        design.bins,
        design.bin_bits,
        design.counter_bits,
        design.clk_hz.to_bits(),
    )
}

/// The front of those whose chips meet their timing; the others are taken from `points`. Chips that do are kept in `known`.
pub(super) fn met(
    problem: &Problem,
    points: &mut Vec<DesignPoint>,
    known: &mut HashSet<Chip>,
) -> Vec<DesignPoint> {
    loop {
        let best = front(points.clone(), DesignPoint::costs);
        let mut chips = best.clone();
        chips.retain(|point| !known.contains(&chip(point)));
        chips.sort_by_key(chip);
        chips.dedup_by_key(|point| chip(point));
        let failed: HashSet<_> = (chips.par_iter())
            .filter(|p| problem.timing(&problem.config_of(&p.design)).is_err())
            .map(chip)
            .collect();
        known.extend(chips.iter().map(chip).filter(|chip| !failed.contains(chip)));
        if failed.is_empty() {
            return best;
        }
        points.retain(|point| !failed.contains(&chip(point)));
    }
}
