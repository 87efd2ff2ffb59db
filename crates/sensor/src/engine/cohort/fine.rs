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
//! Halving all cells leaves a quarter of the error; so from two grids follows what the next ones would tell, and from how far
//! that moves with another halving what it is off at most ([`solve`]).

use smallvec::{SmallVec, smallvec};

use super::FEW_STEPS;
use super::blindness::{Ages, Blindness};
use super::cycles::{Class, CohortLight, NeighbourStart};
use super::events::EventTable;
use super::grid::{CELLS, Grid};
use super::hits::Hits;
use super::secondaries::{Acts, HazardCell, Secondaries};
use super::spad_light::absorbed;
use crate::engine::EngineError;
use crate::photon::DeadTimeLaw;

/// How often cells are halved at most: 256 of them to a CLK period.
const HALVINGS: u32 = 6;

/// What a SPAD does in a window.
#[derive(Debug, Clone)]
pub(super) struct Fine {
    /// Its state at the start.
    pub ages: Ages,
    /// Probability of being able to fire, for every CLK period and 1, 2, … of them since the last avalanche.
    pub able: Vec<f64>,
    /// Mean photons in every CLK period: what makes a SPAD fire that has been ready for long as often as it does.
    pub photons: SmallVec<[f64; FEW_STEPS]>,
    /// Probability of a pulse in every CLK period.
    pulses: SmallVec<[f64; FEW_STEPS]>,
    /// What cohorts that know no more than this are off it.
    missed: SmallVec<[f64; FEW_STEPS]>,
}

impl Fine {
    /// What ever finer cells would tell, from these and ones twice as long: a second-order error has a third of their
    /// difference left.
    fn extrapolated(&self, coarse: &Self) -> Self {
        let probability = |fine: f64, coarse: f64| (fine + (fine - coarse) / 3.0).clamp(0.0, 1.0);
        let mut found = self.clone();
        let probabilities = [
            (&mut found.ages.aged[..], &coarse.ages.aged[..]),
            (&mut found.able[..], &coarse.able[..]),
            (&mut found.pulses[..], &coarse.pulses[..]),
        ];
        for (fine, coarse) in probabilities {
            for (fine, coarse) in fine.iter_mut().zip(coarse) {
                *fine = probability(*fine, *coarse);
            }
        }
        for (fine, coarse) in found.photons.iter_mut().zip(&coarse.photons) {
            *fine = (*fine + (*fine - coarse) / 3.0).max(0.0);
        }
        found.ages.fill_up();
        found
    }

    /// Turns the probabilities of a pulse in `able` into what they are for a SPAD that gets a photon.
    fn divide_by_photons(&mut self) {
        let memory = self.ages.aged.len();
        for (able, &mean) in self.able.chunks_mut(memory).zip(&self.photons) {
            let photon = absorbed(mean);
            for able in able {
                *able = if photon > 0.0 {
                    (*able / photon).min(1.0)
                } else {
                    1.0
                };
            }
        }
    }

    /// The same where avalanches have secondaries: SPADs that have been ready for long are given as many photons as make
    /// all pulses of each CLK period, among them those of carriers that are released later than the cohorts remember.
    fn balance(&mut self) {
        let memory = self.ages.aged.len();
        let (mut aged, mut free) = (self.ages.aged.clone(), self.ages.free);
        for (bin, able) in self.able.chunks_mut(memory).enumerate() {
            let pulses = self.pulses[bin];
            let of_aged = |photon: f64| -> f64 {
                let each = aged.iter().zip(&*able);
                each.map(|(share, fires)| share * fires.min(photon)).sum()
            };
            let mut photon = absorbed(self.photons[bin]);
            // A SPAD of some age fires no more often than it gets photons; few rounds settle how often that is.
            for _ in 0..8 {
                let wanted = (pulses - of_aged(photon)) / free.max(f64::MIN_POSITIVE);
                photon = wanted.clamp(0.0, 1.0 - f64::EPSILON);
            }
            let reached = of_aged(photon) + free * photon;
            self.missed[bin] = reached - pulses;
            for (share, able) in aged.iter_mut().zip(&mut *able) {
                *able = able.min(photon);
                *share *= 1.0 - *able;
                *able = if photon > 0.0 { *able / photon } else { 1.0 };
            }
            free *= 1.0 - photon;
            if let Some(oldest) = aged.last_mut() {
                free += std::mem::replace(oldest, reached);
                aged.rotate_right(1);
            }
            self.photons[bin] = -libm::log1p(-photon);
        }
    }
}

/// As fine as it takes for the mean of every bin of the class's laser cycles to be known to within `error` of its counting
/// noise.
///
/// # Errors
/// When the finest grid does not do.
pub(super) fn solve(
    scene: &CohortLight,
    blindness: &Blindness,
    secondaries: Secondaries,
    class: &Class,
    is_event: &EventTable,
    error: f64,
) -> Result<Fine, EngineError> {
    let events = |fine: &Fine| -> SmallVec<[[f64; 2]; FEW_STEPS]> {
        fine.pulses
            .iter()
            .map(|&pulse| event(is_event, pulse))
            .collect()
    };
    let missed = |fine: &Fine, bin: usize| {
        let reached = (fine.pulses[bin] + fine.missed[bin]).clamp(0.0, 1.0);
        event(is_event, reached)[0] - event(is_event, fine.pulses[bin])[0]
    };
    let cycles = class.cycles as f64;
    let mut coarse = carry(scene, blindness, secondaries, class, 0);
    let mut known = None;
    for halvings in 1..=HALVINGS {
        let fine = carry(scene, blindness, secondaries, class, halvings);
        let found = fine.extrapolated(&coarse);
        let (events_found, before) = (events(&found), known.unwrap_or_else(|| events(&fine)));
        // Of each bin, in counts: what the mean is off at most, and the noise that it may be a part of.
        let bins = before.iter().zip(&events_found).enumerate();
        let bins = bins.map(|(bin, (before, &[p, q]))| {
            let off = (p - before[0]).abs() + missed(&found, bin).abs();
            (cycles * off, (cycles * p * q).sqrt())
        });
        let mut bins = bins.enumerate();
        let worst = bins.find(|(_, (off, noise))| *off > error * noise + ROUNDING);
        match worst {
            None => return Ok(found),
            Some((bin, (off, noise))) if halvings == HALVINGS => {
                return Err(EngineError::CoarseCohorts {
                    bin,
                    off,
                    noise,
                    cells: (CELLS as u32) << HALVINGS,
                });
            }
            Some(_) => (coarse, known) = (fine, Some(events_found)),
        }
    }
    unreachable!("the last halving returns")
}

/// Counts that are no error.
const ROUNDING: f64 = 1e-6;

/// Probability of an event and of none, when each SPAD makes a pulse with probability `pulse`.
pub(super) fn event(is_event: &EventTable, pulse: f64) -> [f64; 2] {
    let fired = Hits::new(is_event.spads(), pulse, 1.0 - pulse);
    let mut sums = [0.0; 2];
    for (spads, &is_event) in is_event.0.iter().enumerate() {
        sums[usize::from(!is_event)] += fired.exactly(spads);
    }
    sums
}

/// One SPAD, carried through the window.
fn carry(
    scene: &CohortLight,
    blindness: &Blindness,
    secondaries: Secondaries,
    class: &Class,
    halvings: u32,
) -> Fine {
    let memory = blindness.memory();
    let remembered_fs = memory as f64 * scene.period_fs;
    let (is_dark, since_fs) = match class.before {
        NeighbourStart::Dark(until_fs) => (true, scene.from_fs - until_fs),
        NeighbourStart::Steady(until_fs) => (false, scene.from_fs - until_fs),
    };
    let since_fs = match blindness.law {
        DeadTimeLaw::NonParalysable => since_fs.max(remembered_fs),
        // No state but the photons of the last dead time.
        DeadTimeLaw::Paralysable => remembered_fs,
    };
    let grid = Grid::new(scene, class, since_fs, memory, halvings);
    let absolute: Vec<f64> = grid.edges.iter().map(|edge| scene.from_fs + edge).collect();
    let cells: Vec<HazardCell> = scene
        .light
        .mean_photons(&absolute, &class.extent)
        .into_iter()
        .map(HazardCell::new)
        .collect();
    let spad = Spad {
        grid,
        cells,
        memory,
        secondaries,
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

struct Spad {
    grid: Grid,
    cells: Vec<HazardCell>,
    memory: usize,
    secondaries: Secondaries,
}

impl Spad {
    /// Cells of CLK period `number`, the earliest remembered one being 0.
    fn period(&self, number: usize) -> std::ops::Range<usize> {
        self.grid.periods[number]..self.grid.periods[number + 1]
    }

    fn bins(&self) -> usize {
        self.grid.periods.len() - 1 - self.memory
    }

    fn width_fs(&self, cell: usize) -> f64 {
        self.grid.edges[cell + 1] - self.grid.edges[cell]
    }

    /// Mean photons in CLK period `number`.
    fn mean(&self, number: usize) -> f64 {
        self.cells[self.period(number)]
            .iter()
            .map(|cell| cell.mean)
            .sum()
    }

    /// From the steady state of `rate` photons a femtosecond.
    fn non_paralysable(&self, blindness: &Blindness, rate: f64, dead_fs: f64) -> Fine {
        let (memory, back, secondaries) = (self.memory, self.grid.per_dead_time, &self.secondaries);
        let (mut ready, steady) = secondaries.steady(rate, dead_fs);
        // From a dead time before the grid on.
        let mut acts: Vec<Acts> = (0..back)
            .map(|cell| {
                if cell < self.cells.len() {
                    steady.times(self.width_fs(cell))
                } else {
                    Acts::default()
                }
            })
            .collect();
        // Of each cell, avalanches that one SPAD gets from others.
        let mut crossing = Vec::with_capacity(self.cells.len());
        for (cell, light) in self.cells.iter().enumerate() {
            let before = acts[cell];
            let returning = [0, 1].map(|trap| before.pulses[trap] + before.silent[trap]);
            let [ours, _] = light.hit_and_ready(ready[0] + ready[1], returning[0] + returning[1]);
            crossing.push(secondaries.crosstalk * ours);
            let width_fs = self.width_fs(cell);
            acts.push(secondaries.advance_cell(
                light,
                crossing[cell],
                width_fs,
                &mut ready,
                returning,
            ));
        }
        let acts = &acts[back..];
        let in_period =
            |number: usize| -> f64 { acts[self.period(number)].iter().map(Acts::pulse_sum).sum() };

        let windows = memory..memory + self.bins();
        let mut fine = Fine {
            ages: Ages::rested(blindness),
            able: vec![1.0; self.bins() * memory],
            photons: windows.clone().map(|number| self.mean(number)).collect(),
            pulses: windows.map(in_period).collect(),
            missed: smallvec![0.0; self.bins()],
        };
        // What a SPAD does after its last pulse in each CLK period.
        for number in 0..memory + self.bins() {
            let source = self.period(number);
            let mut blind = in_period(number);
            let mut ready = [0.0; 2];
            for age in 1..=memory.min(memory + self.bins() - 1 - number) {
                let now = number + age;
                let left = (blind + ready[0] + ready[1]).max(0.0);
                if now == memory {
                    fine.ages.aged[age - 1] = left;
                }
                let cells = self.period(now);
                let mut fired = 0.0;
                if cells.end > source.start + back {
                    for cell in cells {
                        let from = cell.checked_sub(back).filter(|from| source.contains(from));
                        let returning = from.map_or([0.0; 2], |from| acts[from].pulses);
                        blind -= returning[0] + returning[1];
                        let (light, width_fs) = (&self.cells[cell], self.width_fs(cell));
                        let act = secondaries.advance_cell(
                            light,
                            crossing[cell],
                            width_fs,
                            &mut ready,
                            returning,
                        );
                        fired += act.pulse_sum();
                        // Who is blinded without a pulse stays so for as long as that matters.
                        blind += act.silent[0] + act.silent[1];
                    }
                }
                if now >= memory && left > 0.0 {
                    fine.able[(now - memory) * memory + age - 1] = fired / left;
                }
            }
        }
        fine.ages.fill_up();
        if secondaries.are_none() {
            fine.divide_by_photons()
        } else {
            fine.balance()
        }
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
        let photon: Vec<f64> = numbers
            .clone()
            .map(|number| -libm::expm1(-self.mean(number)))
            .collect();
        let mut fine = Fine {
            ages: Ages::rested(blindness),
            able: vec![1.0; self.bins() * memory],
            photons: numbers
                .clone()
                .skip(memory)
                .map(|number| self.mean(number))
                .collect(),
            pulses: SmallVec::new(),
            missed: smallvec![0.0; self.bins()],
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
