//! What a SPAD does in each CLK period, on a grid much finer than one.
//!
//! The cohorts move in steps of a CLK period. What they need to know of a step is how likely a SPAD makes a pulse in it,
//! by the step of its last avalanche; and that depends on when within both steps photons come. So one SPAD's
//! probabilities are carried through the window on a grid of cells that makes the dead time exact:
//!
//! ```text
//!   phase     0  φ₁ φ₂    φ₃  δ             edges of all CLK periods, bends of the light, and edges in between, each
//!   ──────────┼──┼──┼─────┼───┼──┼──┼─────┼───┼──     repeated every dead time δ
//!   cell      0  1  2     3   4  5  6     7           what fires in cell i is ready again exactly in cell i + 4
//! ```
//!
//! With m photons on the SPAD in a cell at whose start it is ready with probability R, and with g, the pulses one dead
//! time earlier, coming back to it during the cell:
//!
//! ```text
//!   pulses  P = R·(1 − e⁻ᵐ) + g·(1 − (1 − e⁻ᵐ)/m)          next R = R·e⁻ᵐ + g·(1 − e⁻ᵐ)/m
//! ```
//!
//! exactly, were light and pulses even within a cell. The same recurrence, begun with the pulses of a single CLK
//! period, tells how the SPADs that fired last in that period go on. So mean counts, and the probabilities of each
//! pair of successive pulses, are as exact as the cells are fine, while cohorts remember no more than CLK
//! periods; what is left out is how three pulses in successive dead times depend on each other within a period.
//!
//! Halving all cells leaves a quarter of the error, so the difference between two grids bounds it ([`solve`]).

use smallvec::SmallVec;

use super::EventTable;
use super::blindness::{Ages, Blindness};
use super::cycles::{Before, Class, Scene};
use super::hits::Hits;
use crate::engine::EngineError;
use crate::photon::{DeadTimeLaw, SPADS};

/// Cells of a CLK period on the coarsest grid, at least.
const CELLS: f64 = 4.0;

/// How often cells are halved at most: 256 of them to a CLK period.
const HALVINGS: u32 = 6;

/// Of the difference between a grid and one twice as coarse, what the finer one is off at most. A second-order scheme
/// leaves a third.
const LEFT: f64 = 0.5;

/// Edges that are closer than that are one, fs.
const CLOSE_FS: f64 = 0.01;

/// Where a narrow pulse is cut, in standard deviations: cells within it are shorter than it.
const BENDS: [f64; 13] = [
    -4.5, -3.5, -2.75, -2.0, -1.4, -0.7, 0.0, 0.7, 1.4, 2.0, 2.75, 3.5, 4.5,
];

/// What a SPAD does in a window.
#[derive(Debug, Clone)]
pub struct Fine {
    /// Its state at the start.
    pub ages: Ages,
    /// Probability of being able to fire, for every CLK period and 1, 2, … of them since the last avalanche.
    pub able: Vec<f64>,
    /// Probability of a pulse in every CLK period.
    pub pulses: SmallVec<[f64; 16]>,
}

/// As fine as it takes for the mean of every bin of the class's laser cycles to be known to within `error` of its counting
/// noise.
///
/// # Errors
/// When the finest grid does not do.
pub fn solve(
    scene: &Scene,
    blindness: &Blindness,
    class: &Class,
    is_event: &EventTable,
    error: f64,
) -> Result<Fine, EngineError> {
    let events = |fine: &Fine| -> SmallVec<[[f64; 2]; 16]> {
        fine.pulses
            .iter()
            .map(|&pulse| event(is_event, pulse))
            .collect()
    };
    let cycles = class.cycles as f64;
    let mut coarse = events(&carry(scene, blindness, class, 0));
    for halvings in 1..=HALVINGS {
        let fine = carry(scene, blindness, class, halvings);
        let finer = events(&fine);
        // Of each bin, in counts: what the mean is off, and the noise that it may be a part of.
        let bins = coarse.iter().zip(&finer).map(|(coarse, &[p, q])| {
            let off = LEFT * cycles * (p - coarse[0]).abs();
            (off, (cycles * p * q).sqrt())
        });
        let worst = bins
            .enumerate()
            .find(|(_, (off, noise))| *off > error * noise + ROUNDING);
        match worst {
            None => return Ok(fine),
            Some((bin, (off, noise))) if halvings == HALVINGS => {
                return Err(EngineError::CoarseCohorts {
                    bin,
                    off,
                    noise,
                    cells: (CELLS as u32) << HALVINGS,
                });
            }
            Some(_) => coarse = finer,
        }
    }
    unreachable!("the last halving returns")
}

/// Counts that are no error.
const ROUNDING: f64 = 1e-6;

/// Probability of an event and of none, when each SPAD makes a pulse with probability `pulse`.
pub fn event(is_event: &EventTable, pulse: f64) -> [f64; 2] {
    let fired = Hits::new(SPADS, pulse, 1.0 - pulse);
    let mut sums = [0.0; 2];
    for (spads, &is_event) in is_event.iter().enumerate() {
        sums[usize::from(!is_event)] += fired.exactly(spads);
    }
    sums
}

/// Cells of time, which repeat every dead time.
struct Grid {
    /// Edges, fs after the start of the window.
    edges: Vec<f64>,
    /// Cells in a dead time.
    per_dead_time: usize,
    /// Edge at the start of every CLK period: those that are remembered at the start of the window, the window's, and one
    /// more.
    periods: Vec<usize>,
}

impl Grid {
    /// From `since_fs` before the window on.
    fn new(scene: &Scene, class: &Class, since_fs: f64, memory: usize, halvings: u32) -> Self {
        let (dead_fs, period_fs) = (scene.dead_fs, scene.period_fs);
        let start_fs = -since_fs;
        let period = |number: usize| (number as f64 - memory as f64) * period_fs;
        let periods = 0..memory + scene.bins + 1;
        let until_fs = scene.bins as f64 * period_fs;
        let mut bends: Vec<f64> = periods.clone().map(period).collect();
        let lit_fs = &class.extent.lit_fs;
        bends.extend([lit_fs.start, lit_fs.end].map(|end| end - scene.from_fs));
        let sigma_fs = scene.light.sigma_fs();
        if sigma_fs * CELLS < period_fs {
            let reaching = scene
                .light
                .echoes_in(scene.from_fs + start_fs..scene.until_fs());
            let echoes = &class.extent.echoes;
            for number in reaching.start.max(echoes.start)..reaching.end.min(echoes.end) {
                let centre_fs = scene.light.centre_fs(number) - scene.from_fs;
                bends.extend(BENDS.map(|bend| centre_fs + bend * sigma_fs));
                // A pulse without width is somewhere within a femtosecond.
                bends.push(centre_fs + 1.0);
            }
        }
        bends.retain(|bend| (start_fs..=until_fs).contains(bend));
        let mut phases: Vec<f64> = bends
            .iter()
            .map(|bend| (bend - start_fs).rem_euclid(dead_fs))
            .collect();
        phases.push(0.0);
        phases.retain(|phase| *phase < dead_fs - CLOSE_FS);
        phases.sort_unstable_by(f64::total_cmp);
        phases.dedup_by(|later, earlier| *later - *earlier < CLOSE_FS);
        let longest_fs = period_fs / CELLS;
        let mut cells = Vec::with_capacity(phases.len() << halvings);
        for (i, &phase) in phases.iter().enumerate() {
            let next = phases.get(i + 1).copied().unwrap_or(dead_fs);
            let parts = ((next - phase) / longest_fs).ceil() * f64::from(1u32 << halvings);
            cells.extend(
                (0..parts as usize).map(|part| phase + (next - phase) * part as f64 / parts),
            );
        }
        let dead_times = ((until_fs - start_fs) / dead_fs).ceil() as usize + 1;
        let repeated = (0..dead_times).flat_map(|n| cells.iter().map(move |cell| (n, *cell)));
        let all = repeated.map(|(n, cell)| start_fs + n as f64 * dead_fs + cell);
        let edges: Vec<f64> = all.take_while(|edge| *edge < until_fs + CLOSE_FS).collect();
        let edge_of =
            |number: usize| edges.partition_point(|edge| *edge < period(number) - CLOSE_FS);
        Grid {
            periods: periods.map(edge_of).collect(),
            per_dead_time: cells.len(),
            edges,
        }
    }
}

/// One SPAD, carried through the window.
fn carry(scene: &Scene, blindness: &Blindness, class: &Class, halvings: u32) -> Fine {
    let memory = blindness.memory();
    let remembered_fs = memory as f64 * scene.period_fs;
    let (is_dark, since_fs) = match class.before {
        Before::Dark(until_fs) => (true, scene.from_fs - until_fs),
        Before::Steady(until_fs) => (false, scene.from_fs - until_fs),
    };
    let since_fs = match blindness.law {
        DeadTimeLaw::NonParalysable => since_fs.max(remembered_fs),
        // No state but the photons of the last dead time.
        DeadTimeLaw::Paralysable => remembered_fs,
    };
    let grid = Grid::new(scene, class, since_fs, memory, halvings);
    let absolute: Vec<f64> = grid.edges.iter().map(|edge| scene.from_fs + edge).collect();
    let cells: Vec<Cell> = scene
        .light
        .between(&absolute, &class.extent)
        .into_iter()
        .map(Cell::new)
        .collect();
    let spad = Spad {
        grid,
        cells,
        memory,
    };
    match blindness.law {
        DeadTimeLaw::NonParalysable => {
            let steady = if is_dark {
                0.0
            } else {
                scene.light.background(scene.dead_fs)
            };
            spad.non_paralysable(blindness, steady / scene.dead_fs, scene.dead_fs)
        }
        DeadTimeLaw::Paralysable => spad.paralysable(blindness),
    }
}

/// Photons in a cell.
#[derive(Debug, Clone, Copy)]
struct Cell {
    mean: f64,
    /// Probability of none.
    none: f64,
    /// Probability of any.
    any: f64,
    /// Of those that come back to readiness in the cell, those still ready at its end.
    stay: f64,
    /// The others.
    fire: f64,
}

impl Cell {
    fn new(mean: f64) -> Self {
        let any = -libm::expm1(-mean);
        // Where the quotient would lose its digits, a series.
        let fire = match mean < 1e-3 {
            true => mean * (0.5 - mean * (1.0 / 6.0 - mean * (1.0 / 24.0))),
            false => 1.0 - any / mean,
        };
        Cell {
            mean,
            none: 1.0 - any,
            any,
            stay: 1.0 - fire,
            fire,
        }
    }
}

struct Spad {
    grid: Grid,
    cells: Vec<Cell>,
    memory: usize,
}

impl Spad {
    /// Cells of CLK period `number`, the earliest remembered one being 0.
    fn period(&self, number: usize) -> std::ops::Range<usize> {
        self.grid.periods[number]..self.grid.periods[number + 1]
    }

    fn bins(&self) -> usize {
        self.grid.periods.len() - 1 - self.memory
    }

    /// Probability of a photon in CLK period `number`.
    fn photon(&self, number: usize) -> f64 {
        let mean: f64 = self.cells[self.period(number)]
            .iter()
            .map(|cell| cell.mean)
            .sum();
        -libm::expm1(-mean)
    }

    /// From the steady state of `rate` photons a femtosecond.
    fn non_paralysable(&self, blindness: &Blindness, rate: f64, dead_fs: f64) -> Fine {
        let (memory, back) = (self.memory, self.grid.per_dead_time);
        let mut ready = 1.0 / (1.0 + rate * dead_fs);
        let edges = &self.grid.edges;
        let steady = rate * ready;
        // Pulses, from a dead time before the grid on.
        let mut pulses: Vec<f64> = (0..back.min(self.cells.len()))
            .map(|cell| steady * (edges[cell + 1] - edges[cell]))
            .collect();
        pulses.resize(back, 0.0);
        for (cell, light) in self.cells.iter().enumerate() {
            let returning = pulses[cell];
            pulses.push(ready * light.any + returning * light.fire);
            ready = ready * light.none + returning * light.stay;
        }
        let pulses = &pulses[back..];
        let in_period = |number: usize| -> f64 { pulses[self.period(number)].iter().sum() };

        let mut fine = Fine {
            ages: Ages::rested(blindness),
            able: vec![1.0; self.bins() * memory],
            pulses: (memory..memory + self.bins()).map(in_period).collect(),
        };
        // What a SPAD does after its last pulse in each CLK period.
        for number in 0..memory + self.bins() {
            let source = self.period(number);
            let mut blind = in_period(number);
            let mut ready = 0.0;
            for age in 1..=memory.min(memory + self.bins() - 1 - number) {
                let now = number + age;
                let left = (blind + ready).max(0.0);
                if now == memory {
                    fine.ages.aged[age - 1] = left;
                }
                let cells = self.period(now);
                if cells.end <= source.start + back {
                    // All are blind still.
                    if now >= memory {
                        fine.able[(now - memory) * memory + age - 1] = 0.0;
                    }
                    continue;
                }
                let mut fired = 0.0;
                for cell in cells {
                    let light = &self.cells[cell];
                    let from = cell.checked_sub(back).filter(|from| source.contains(from));
                    let returning = from.map_or(0.0, |from| pulses[from]);
                    blind -= returning;
                    fired += ready * light.any + returning * light.fire;
                    ready = ready * light.none + returning * light.stay;
                }
                let photon = self.photon(now);
                if now >= memory && left > 0.0 && photon > 0.0 {
                    fine.able[(now - memory) * memory + age - 1] = (fired / left / photon).min(1.0);
                }
            }
        }
        fine.ages.fill_up();
        fine
    }

    /// Avalanches do not depend on each other: a SPAD that gets a photon in a CLK period makes a pulse with the first one,
    /// if that comes a dead time after the last one of an earlier period.
    fn paralysable(&self, blindness: &Blindness) -> Fine {
        let (memory, back) = (self.memory, self.grid.per_dead_time);
        let numbers = 0..memory + self.bins();
        let mut first = vec![0.0; self.cells.len()];
        let mut last = first.clone();
        for number in numbers.clone() {
            let (mut none_before, mut none_after) = (1.0, 1.0);
            for cell in self.period(number) {
                first[cell] = none_before * self.cells[cell].any;
                none_before *= self.cells[cell].none;
            }
            for cell in self.period(number).rev() {
                last[cell] = none_after * self.cells[cell].any;
                none_after *= self.cells[cell].none;
            }
        }
        let photon: Vec<f64> = numbers.clone().map(|number| self.photon(number)).collect();
        let mut fine = Fine {
            ages: Ages::rested(blindness),
            able: vec![1.0; self.bins() * memory],
            pulses: SmallVec::new(),
        };
        for now in numbers.skip(memory) {
            let (mut aged, mut pulse) = (1.0, 0.0);
            for age in 1..=memory {
                let source = self.period(now - age);
                let mut before: f64 = 0.0;
                let mut joint = 0.0;
                let mut next = source.start;
                for cell in self.period(now) {
                    let Some(from) = cell.checked_sub(back) else {
                        continue;
                    };
                    while next < from.min(source.end) {
                        before += last[next];
                        next += 1;
                    }
                    let same = if source.contains(&from) {
                        last[from]
                    } else {
                        0.0
                    };
                    joint += first[cell] * (before + 0.5 * same);
                }
                let both = photon[now] * photon[now - age];
                let able = if both > 0.0 {
                    (joint / both).min(1.0)
                } else {
                    1.0
                };
                fine.able[(now - memory) * memory + age - 1] = able;
                let here = aged * photon[now - age];
                if now == memory {
                    fine.ages.aged[age - 1] = here;
                }
                pulse += here * able;
                aged *= 1.0 - photon[now - age];
            }
            fine.pulses.push(photon[now] * (pulse + aged));
        }
        fine.ages.fill_up();
        fine
    }
}
