//! Window policy: which window every macropixel opens, from the guide's map and from what the exposures before have seen.
//!
//! ```text
//!   guide's map ──► prior over distance ──┐
//!   windows without a peak ──► searched ──┴─► start value: the window with most of the chance that is left
//!   window with a peak ──► held
//! ```
//!
//! A window holds the target of a guide with Gaussian errors with the chance Φ((b − r)/σ) − Φ((a − r)/σ): ±3σ must fit into it for 99.7 %
//! (thesis Eq. 25). Bins are one CLK period of the whole chip, and start values are loaded before an exposure, so that a macropixel in
//! doubt cannot have a wider window than others, nor two in one exposure: it steps its window from exposure to exposure. Each time it
//! opens the window that holds most of the chance which earlier windows have left,
//!
//! ```text
//!   p(x) = [(1 − g)·N(x; r, σ) + g/reach]·(1 − d)ⁿ⁽ˣ⁾      g: guide altogether wrong, d: a target in a window is found,
//!                                                          n(x): windows that have looked at x without a peak
//! ```
//!
//! so that it goes outwards from the guide's estimate, then over the whole reach, and then begins again. Neighbouring windows overlap,
//! because an echo at a window's end is cut: only the inner part of a window counts as searched. A sweep is the same without a guide.
//!
//! Macropixels that find a peak keep to it, as [`StepAndLock`](super::StepAndLock) does, until the guide says that there is another target.

mod bins;
mod options;

use std::ops::Range;

use rayon::prelude::*;

use super::aim::Aims;
use crate::chip::{Exposure, Mode, Sensor};
use crate::guide::GuideMap;
use crate::numerics::normal_above;
use crate::ranging::BinProfile;
use crate::settings::Range::Within;
use crate::settings::{keys, words};
use crate::units::{Time, TimeOfFlight};

pub use bins::NoBins;

words! {
    /// What a macropixel does if the guide has no estimate for it.
    #[derive(Default)]
    #[non_exhaustive]
    pub enum Unguided {
        /// Its SPADs are off.
        #[default]
        Off = "off",
        /// It keeps the window that it had last, if any.
        Keep = "keep",
        /// It steps its window over the whole reach, and holds a peak that it finds.
        Sweep = "sweep",
        /// It takes the estimate of the nearest macropixel that has one, of several as near the farthest: what has no estimate is mostly
        /// background that an edge hides from one of two cameras.
        Neighbour = "neighbour",
    }
}

keys! {
    /// How windows are chosen. The default is that of a single frame: one window in the middle of the guide's estimate, whatever
    /// its uncertainty.
    #[derive(Copy)]
    #[non_exhaustive]
    pub struct WindowPolicy {
        /// What macropixels without an estimate do.
        unguided: Unguided = Unguided::Off, from "thesis 4.9 for sweep, else chosen";
        /// Step the window if one does not hold the guide's uncertainty.
        steps_in_doubt: bool = false;
        /// Exposures without a peak after which the window steps although the guide is sure; never, if left out.
        patience: Option<u32> = None, in Within(0.0, 1e6);
        /// Share of the estimate's distribution that a window must hold for the guide to be sure.
        within: f64 = 0.997, in Within(0.5, 0.999_999), from "thesis Eq. 25";
        /// Share by which successive windows overlap.
        overlap: f64 = 0.25, in Within(0.0, 0.9),
            from "chosen: a pulse of 4.5 ns and as much again of a window of 41.7 ns";
        /// Probability that a target within a window makes a significant peak.
        detection: f64 = 0.9, in Within(0.01, 0.999);
        /// Share of the guide's estimates that are completely wrong.
        gross: f64 = 0.01, in Within(0.0, 1.0);
        /// Largest distance, in macropixels, from which an estimate is taken over.
        neighbour_px: u32 = 3, in Within(0.0, 64.0);
    }
}

impl WindowPolicy {
    /// For sequences: steps when in doubt and after two exposures without a peak, and takes over estimates of neighbours.
    pub fn for_sequences() -> Self {
        WindowPolicy {
            unguided: Unguided::Neighbour,
            steps_in_doubt: true,
            patience: Some(2),
            ..WindowPolicy::default()
        }
    }
}

/// Standard deviations on either side of the mean that hold this share of a normal distribution.
fn sigmas_holding(share: f64) -> f64 {
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if 1.0 - 2.0 * normal_above(middle) < share {
            low = middle
        } else {
            high = middle
        }
    }
    0.5 * (low + high)
}

/// Why a macropixel has the window that it has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Why {
    /// SPADs are off: no estimate, or none within reach.
    Off,
    /// In the middle of the guide's estimate, or the one window of the conventional mode.
    Guided,
    /// Stepped from the guide's estimate on, in doubt or after exposures without a peak.
    Stepped,
    /// About the peak that was seen last.
    Held,
    /// Kept, without an estimate.
    Kept,
    /// On its way over the whole reach, without an estimate.
    Swept,
    /// About a neighbour's estimate.
    Neighbour,
}

/// What a macropixel remembers.
#[derive(Debug, Clone, Default)]
struct Memory {
    /// The window that was open last.
    start: Option<u16>,
    /// Exposures without a peak, one after the other.
    missed: u32,
    /// The last peak, m.
    seen_m: Option<f64>,
    /// The guide's last estimate and standard deviation, m.
    estimate: Option<(f64, f64)>,
    /// How often each cell of the reach has been looked at since, without a peak; empty: none of them.
    searched: Vec<u8>,
}

/// The windows of an array from frame to frame: a policy, the sensor it is for and what macropixels did last.
#[derive(Debug)]
pub struct Pointing<'p> {
    policy: WindowPolicy,
    /// Standard deviations that hold `policy.within`.
    sigmas: f64,
    aims: Aims<'p>,
    /// What each start value's window sees, m; `None` where it does not open.
    windows_m: Vec<Option<Range<f64>>>,
    /// Reach in cells of one step of start values: from, and the length of a cell, m.
    cells: (f64, f64, usize),
    cols: usize,
    is_guided: bool,
    pixels: Vec<Memory>,
    why: Vec<Why>,
}

impl<'p> Pointing<'p> {
    /// Before the first frame; `calibration` is that of delay lines.
    pub fn new(
        policy: WindowPolicy,
        sensor: &Sensor,
        exposure: &Exposure,
        calibration: Option<&'p BinProfile>,
    ) -> Self {
        let aims = Aims::new(sensor, exposure, calibration);
        let windows_m: Vec<Option<Range<f64>>> = (0..=sensor.largest_start())
            .map(|start| {
                let seen = aims.seen_by(start)?;
                Some(seen.start.as_range_m().max(0.0)..seen.end.as_range_m())
            })
            .collect();
        let ends = || windows_m.iter().flatten();
        let from = ends().map(|w| w.start).fold(f64::INFINITY, f64::min);
        let to = ends().map(|w| w.end).fold(0.0, f64::max);
        let step = Time::from_s(sensor.step_periods as f64 / exposure.clock.as_hz());
        let cell_m = step.as_range_m();
        let cells = ((to - from) / cell_m).ceil().max(0.0) as usize;
        Pointing {
            sigmas: sigmas_holding(policy.within),
            policy,
            aims,
            windows_m,
            cells: (from, cell_m, cells),
            cols: sensor.cols,
            is_guided: sensor.mode == Mode::Guided,
            pixels: vec![Memory::default(); sensor.pixels()],
            why: vec![Why::Off; sensor.pixels()],
        }
    }

    /// The start value of every macropixel for the next exposure, row-major; `None` where SPADs stay off.
    /// `seen_m` is the distance that each macropixel has measured in the exposure before, m, `None` without a significant peak, and
    /// empty before the first.
    ///
    /// # Panics
    /// When the map or `seen_m` is of another array.
    pub fn windows(&mut self, guide: &GuideMap, seen_m: &[Option<f64>]) -> Vec<Option<u16>> {
        assert_eq!(guide.range_m.len(), self.pixels.len());
        assert!(seen_m.is_empty() || seen_m.len() == self.pixels.len());
        let mut pixels = std::mem::take(&mut self.pixels);
        let chosen: Vec<(Option<u16>, Why)> = pixels
            .par_iter_mut()
            .enumerate()
            .map(|(pixel, memory)| {
                if !seen_m.is_empty() {
                    self.learn(memory, seen_m[pixel]);
                }
                let estimate = guide.estimate_of(pixel);
                let borrowed = match (estimate, self.policy.unguided) {
                    (None, Unguided::Neighbour) => self.neighbours(guide, pixel),
                    _ => None,
                };
                self.forget_old_target(memory, estimate.or(borrowed));
                let (start, why) = self.choose(pixel, memory, estimate, borrowed);
                memory.start = start;
                match start {
                    Some(_) => (start, why),
                    None => (None, Why::Off),
                }
            })
            .collect();
        self.pixels = pixels;
        let (starts, why) = chosen.into_iter().unzip();
        self.why = why;
        starts
    }

    /// Why every macropixel has the window that was chosen last, row-major.
    pub fn why(&self) -> &[Why] {
        &self.why
    }

    /// Takes note of what the window that was open last has seen.
    fn learn(&self, memory: &mut Memory, seen_m: Option<f64>) {
        let Some(window) = memory.start.and_then(|start| self.inner_cells(start)) else {
            return;
        };
        if seen_m.is_some() {
            (memory.seen_m, memory.missed) = (seen_m, 0);
            memory.searched.clear();
            return;
        }
        memory.missed = memory.missed.saturating_add(1);
        memory.searched.resize(self.cells.2, 0);
        for times in &mut memory.searched[window] {
            *times = times.saturating_add(1);
        }
    }

    /// Forgets what was seen and searched when the guide speaks of another target than before.
    fn forget_old_target(&self, memory: &mut Memory, estimate: Option<(f64, f64)>) {
        if let (Some((now_m, now_sigma)), Some((then_m, then_sigma))) = (estimate, memory.estimate)
            && (now_m - then_m).abs() > self.sigmas * libm::hypot(now_sigma, then_sigma)
        {
            *memory = Memory::default();
        }
        memory.estimate = estimate.or(memory.estimate);
    }

    fn choose(
        &self,
        pixel: usize,
        memory: &Memory,
        estimate: Option<(f64, f64)>,
        borrowed: Option<(f64, f64)>,
    ) -> (Option<u16>, Why) {
        if !self.is_guided {
            return (self.aims.start_of(pixel, None), Why::Guided);
        }
        let aimed_at = |range_m: f64| self.aims.start_of(pixel, Some(range_m));
        let peak_m = memory.seen_m.filter(|_| memory.missed == 0);
        let Some((range_m, sigma_m)) = estimate.or(borrowed) else {
            return match self.policy.unguided {
                Unguided::Off | Unguided::Neighbour => (None, Why::Off),
                Unguided::Keep => (memory.start, Why::Kept),
                Unguided::Sweep => match peak_m {
                    Some(peak_m) => (aimed_at(peak_m), Why::Held),
                    None => (self.most_likely(memory, None), Why::Swept),
                },
            };
        };
        let guided = match estimate {
            Some(_) => Why::Guided,
            None => Why::Neighbour,
        };
        let aimed = aimed_at(range_m);
        let may_step = self.policy.steps_in_doubt || self.policy.patience.is_some();
        if let Some(peak_m) = peak_m
            && may_step
            && !aimed.is_some_and(|start| self.holds_well(start, peak_m))
        {
            return (aimed_at(peak_m), Why::Held);
        }
        let is_sure =
            aimed.is_some_and(|start| self.share(start, range_m, sigma_m) >= self.policy.within);
        let in_doubt = self.policy.steps_in_doubt && !is_sure;
        let has_missed = self
            .policy
            .patience
            .is_some_and(|most| memory.missed >= most);
        if (in_doubt || has_missed) && memory.missed > 0 {
            (
                self.most_likely(memory, Some((range_m, sigma_m))),
                Why::Stepped,
            )
        } else {
            (aimed, guided)
        }
    }

    /// Chance that the window of a start value holds a target about which the guide errs normally.
    fn share(&self, start: u16, range_m: f64, sigma_m: f64) -> f64 {
        let Some(window) = &self.windows_m[usize::from(start)] else {
            return 0.0;
        };
        normal_between(window, range_m, sigma_m)
    }

    /// Whether a peak lies in the part of a window that it does not share with the next ones.
    fn holds_well(&self, start: u16, peak_m: f64) -> bool {
        self.inner(start)
            .is_some_and(|inner| inner.contains(&peak_m))
    }

    /// The part of a window in which a whole echo has room, m.
    fn inner(&self, start: u16) -> Option<Range<f64>> {
        let window = self.windows_m[usize::from(start)].clone()?;
        let cut_m = 0.5 * self.policy.overlap * (window.end - window.start);
        Some(window.start + cut_m..window.end - cut_m)
    }

    /// Cells whose middle lies in the inner part of a window.
    fn inner_cells(&self, start: u16) -> Option<Range<usize>> {
        let (from, cell_m, cells) = self.cells;
        let inner = self.inner(start)?;
        let cell = |m: f64| (((m - from) / cell_m).round().max(0.0) as usize).min(cells);
        let (first, end) = (cell(inner.start), cell(inner.end));
        // A window that steps farther than its inner part still looks at one cell.
        Some(first..end.max((first + 1).min(cells)))
    }

    /// The start value whose window holds most of what is left of the chance; without an estimate, the target is anywhere in reach.
    fn most_likely(&self, memory: &Memory, estimate: Option<(f64, f64)>) -> Option<u16> {
        let (from, cell_m, cells) = self.cells;
        let missed = 1.0 - self.policy.detection;
        let anywhere = 1.0 / cells as f64;
        let mut left = Vec::with_capacity(cells + 1);
        let mut sum = 0.0;
        left.push(sum);
        for cell in 0..cells {
            let begins = from + cell as f64 * cell_m;
            let chance = match estimate {
                None => anywhere,
                Some((range_m, sigma_m)) => {
                    let gross = self.policy.gross;
                    let within = normal_between(&(begins..begins + cell_m), range_m, sigma_m);
                    (1.0 - gross) * within + gross * anywhere
                }
            };
            let times = memory.searched.get(cell).copied().unwrap_or(0);
            sum += chance * missed.powi(times.into());
            left.push(sum);
        }
        let starts = 0..self.windows_m.len() as u16;
        let chances = starts.filter_map(|start| {
            let seen = self.inner_cells(start)?;
            Some((start, left[seen.end] - left[seen.start]))
        });
        // Of equal ones the nearest; sums of equal chances differ by rounding.
        let best = chances.reduce(|best, other| {
            if other.1 > best.1 * (1.0 + 1e-9) {
                other
            } else {
                best
            }
        });
        best.map(|(start, _)| start)
    }

    /// The estimate of the nearest macropixel that has one; of several as near the farthest away from the lidar.
    fn neighbours(&self, guide: &GuideMap, pixel: usize) -> Option<(f64, f64)> {
        let reach = i64::from(self.policy.neighbour_px);
        let (rows, cols) = ((guide.range_m.len() / self.cols) as i64, self.cols as i64);
        let (row, col) = (pixel as i64 / cols, pixel as i64 % cols);
        let around =
            (-reach..=reach).flat_map(|down| (-reach..=reach).map(move |right| (down, right)));
        let near = around.filter_map(|(down, right)| {
            let (r, c) = (row + down, col + right);
            let distance2 = down * down + right * right;
            let is_inside = (0..rows).contains(&r) && (0..cols).contains(&c);
            let estimate = guide.estimate_of(is_inside.then_some((r * cols + c) as usize)?)?;
            (distance2 <= reach * reach).then_some((distance2, estimate))
        });
        let nearest = near.min_by(|(da, (a, _)), (db, (b, _))| da.cmp(db).then(b.total_cmp(a)));
        nearest.map(|(_, estimate)| estimate)
    }
}

/// Share of a normal distribution in a range.
fn normal_between(range: &Range<f64>, mean: f64, sigma: f64) -> f64 {
    if sigma == 0.0 {
        return f64::from(u8::from(range.contains(&mean)));
    }
    normal_above((range.start - mean) / sigma) - normal_above((range.end - mean) / sigma)
}

#[cfg(test)]
mod tests;
