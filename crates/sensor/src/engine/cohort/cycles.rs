//! The laser cycles of an exposure by what they have in common: light, and the state in which their windows begin.
//!
//! ```text
//!   laser cycle   0    1    2    …                      N−2  N−1
//!                 ╰─ early ─╯   ╰─ settled, all alike ─╯   ╰─ late
//! ```
//!
//! Early ones may remember the first STOP edge, or lack an echo that a cycle before the exposure would have sent; late
//! ones lack that of a cycle after it. All others are alike, unless a SPAD stays busy from one window to the next:
//! without a dead time's length free of photons it cannot be told whether it has recovered. The probability of that
//! is bounded by going back from a window, dead time by dead time ([`CohortLight::busy_back_to`]).

use smallvec::SmallVec;

use super::blindness::{Ages, Blindness};
use super::spad_light::{Extent, SpadLight, absorbed};
use super::{CohortOptions, Means};
use crate::chip::window_law::OpenWindow;
use crate::chip::{SensorConfig, WindowLaw};
use crate::engine::EngineError;

/// What is left of a state that counts as forgotten.
const FORGOTTEN: f64 = 1e-15;

/// Dead times gone back at most. Light that keeps SPADs busy for longer is refused where laser cycles meet.
const FARTHEST: f64 = 1000.0;

/// Laser cycles with the same light and the same state at the start of the window.
pub(super) struct LikeCycles {
    pub cycles: u64,
    pub blindness: Blindness,
    pub ages: Ages,
    /// Mean photons on a SPAD in each bin.
    pub means: Means,
    /// First bins that the pipeline has not reached yet.
    pub not_compared: usize,
}

#[cfg(test)]
impl LikeCycles {
    /// Cycles in whose bins there are `means` photons on a SPAD, after much light of `before` photons in each step.
    pub(super) fn steady(cycles: u64, blindness: Blindness, before: f64, means: &[f64]) -> Self {
        LikeCycles {
            cycles,
            ages: Ages::steady(&blindness, before),
            blindness,
            means: means.into(),
            not_compared: 0,
        }
    }
}

/// Light and dead time around one macropixel's window. Times in femtoseconds from its laser cycle's STOP edge.
pub(super) struct CohortLight {
    pub light: SpadLight,
    pub dead_fs: f64,
    /// How long after a dead time its avalanche may have caused another one.
    pub pending_fs: f64,
    /// Steps in which what was before the window is remembered: a CLK period, or the shortest bin.
    pub period_fs: f64,
    pub from_fs: f64,
    pub bins: usize,
    /// Where bins begin and the last one ends, fs after the start of the window, if they are not CLK periods.
    pub edges_fs: Option<Vec<f64>>,
    pub cycle_fs: f64,
    /// Probability of a background photon on a SPAD within a dead time.
    busy: f64,
}

/// Lengths of the shortest and the longest bin between these edges.
pub(super) fn shortest_and_longest(edges_fs: &[f64]) -> [f64; 2] {
    let widths = edges_fs.windows(2).map(|pair| pair[1] - pair[0]);
    let shortest = widths.clone().fold(f64::INFINITY, f64::min);
    [shortest, widths.fold(0.0, f64::max)]
}

/// How far a window looks back.
#[derive(Debug, Clone, Copy)]
struct Back {
    /// Bound on the probability that a SPAD has seen no dead time's length without photons since then.
    busy: f64,
    /// How long before the window.
    for_fs: f64,
}

/// How a settled laser cycle's neighbours begin.
#[derive(Debug, Clone)]
pub(super) enum NeighbourStart {
    /// Dark until then: every SPAD is ready.
    Dark(f64),
    /// Background for ever, and from then on all the light there is. What is forgotten by the window may have been another.
    Steady(f64),
}

/// A class of laser cycles, before anything is computed of it.
pub(super) struct Class {
    pub cycles: u64,
    pub extent: Extent,
    pub before: NeighbourStart,
    pub not_compared: usize,
}

impl CohortLight {
    /// Lengths of a dead time, of what an avalanche may cause after it, and of a CLK period, the start of the window and the length of a laser cycle, fs.
    pub(super) fn new(
        light: SpadLight,
        [dead_fs, pending_fs, period_fs]: [f64; 3],
        [from_fs, cycle_fs]: [f64; 2],
        bins: usize,
        edges_fs: Option<Vec<f64>>,
    ) -> Self {
        CohortLight {
            edges_fs,
            busy: absorbed(light.most_background(dead_fs)),
            light,
            dead_fs,
            pending_fs,
            period_fs,
            from_fs,
            bins,
            cycle_fs,
        }
    }

    /// End of the window.
    pub(super) fn until_fs(&self) -> f64 {
        self.from_fs + self.edge_fs(self.bins)
    }

    /// Where bin `number` begins, or where the last one ends, fs after the start of the window.
    pub(super) fn edge_fs(&self, number: usize) -> f64 {
        match &self.edges_fs {
            Some(edges_fs) => edges_fs[number],
            None => number as f64 * self.period_fs,
        }
    }

    /// Goes back from the start of the window by dead times, until `enough` is known or `for_fs` is over: a SPAD that sees
    /// no photon in one of them is ready after it, whatever was before, but for what is pending.
    fn busy_back_to(&self, for_fs: f64, enough: f64) -> Back {
        let most = ((for_fs - self.pending_fs) / self.dead_fs)
            .floor()
            .clamp(0.0, FARTHEST);
        // The logarithm of 0 is −∞, that of 1 is 0: one dead time, and as many as there are.
        let dead_times = -libm::log(enough) / -libm::log(self.busy);
        let alone = dead_times.ceil().max(1.0).min(most);
        let reach = self.from_fs - alone * self.dead_fs..self.from_fs;
        if self.light.echoes_in(reach).is_empty() {
            return Back {
                busy: self.busy.powi(alone as i32),
                for_fs: alone * self.dead_fs + self.pending_fs,
            };
        }
        // Echoes of all laser cycles, sent or not: more light makes the bound no smaller.
        let (mut busy, mut stretches) = (1.0, 0.0);
        while busy > enough && stretches < most {
            stretches += 1.0;
            let from_fs = self.from_fs - stretches * self.dead_fs;
            busy *= absorbed(self.light.most(from_fs, self.dead_fs));
        }
        Back {
            busy,
            for_fs: stretches * self.dead_fs + self.pending_fs,
        }
    }

    /// The laser cycles of an exposure.
    ///
    /// # Errors
    /// Laser cycles that depend on each other.
    pub(super) fn classes(
        &self,
        config: &SensorConfig,
        law: &WindowLaw,
        window: &OpenWindow,
        options: &CohortOptions,
    ) -> Result<SmallVec<[Class; 1]>, EngineError> {
        let latched = law.latched_cycles();
        let (first, cycles) = (latched.start, latched.end);
        let for_one = options.memory / config.spads() as f64;
        let enough = FORGOTTEN.min(for_one / cycles as f64);
        let between_fs = self.cycle_fs - self.edge_fs(self.bins);
        let back = self.busy_back_to(f64::INFINITY, enough);
        if cycles > 1 && (back.for_fs > between_fs || back.busy > enough) {
            let busy =
                self.busy_back_to(between_fs, enough).busy * config.spads() as f64 * cycles as f64;
            if busy > options.memory {
                return Err(EngineError::CyclesNotIndependent { bound: busy });
            }
        }

        let is_settled = |cycle: i64| {
            let since_fs = cycle as f64 * self.cycle_fs + self.from_fs;
            since_fs >= back.for_fs || self.busy_back_to(since_fs, for_one).busy <= for_one
        };
        let mut settled_from = first;
        while settled_from < cycles && !is_settled(settled_from) {
            settled_from += 1;
        }
        let since_fs = self.from_fs - back.for_fs;
        let reaching = self.light.echoes_in(since_fs..self.until_fs());
        // Echo k, counted from laser cycle n, is sent if 0 ≤ n + k < N.
        let mut ends: SmallVec<[i64; 8]> = (first..settled_from).collect();
        ends.extend(reaching.clone().flat_map(|k| [-k, cycles - k]));
        ends.push(settled_from);
        // Where the light changes, laser cycles before and after it that see both are alone.
        let cycles_fs = |time_fs: f64| (time_fs / self.cycle_fs).ceil() as i64;
        let ahead = (cycles_fs(self.until_fs()) - 1).max(reaching.end).max(0);
        let behind = cycles_fs(-since_fs).max(-reaching.start).max(0);
        let near = |change: i64| change - ahead..=change + behind + 1;
        ends.extend(self.light.changes().flat_map(near));
        ends.push(cycles - ((self.until_fs() / self.cycle_fs).ceil() as i64 - 1).clamp(0, cycles));
        ends.retain(|end| (first..cycles).contains(end));
        ends.push(cycles);
        ends.sort_unstable();
        ends.dedup();
        let classes = ends.windows(2).map(|ends| {
            let cycle = ends[0];
            let is_settled = cycle >= settled_from;
            let starts_fs = -(cycle as f64) * self.cycle_fs;
            let sent = reaching.start.max(-cycle)..reaching.end.min(cycles - cycle);
            let start_fs = if is_settled {
                f64::NEG_INFINITY
            } else {
                starts_fs
            };
            let steady_until = self.light.steady_until(sent.clone(), self.from_fs);
            Class {
                cycles: (ends[1] - ends[0]) as u64,
                extent: Extent {
                    cycle,
                    lit_fs: start_fs..starts_fs + cycles as f64 * self.cycle_fs,
                    echoes: sent,
                },
                before: if is_settled {
                    NeighbourStart::Steady(steady_until.max(since_fs))
                } else {
                    NeighbourStart::Dark(starts_fs)
                },
                not_compared: law.not_compared(window, cycle),
            }
        });
        Ok(classes.collect())
    }

    /// The state at the start of the window.
    pub(super) fn start(&self, blindness: &Blindness, class: &Class) -> Ages {
        let step_fs = self.period_fs;
        let (mut ages, since_fs) = match class.before {
            NeighbourStart::Dark(until_fs) => (Ages::rested(blindness), until_fs),
            NeighbourStart::Steady(until_fs) => {
                let background = self.light.background(step_fs);
                (Ages::steady(blindness, background), until_fs)
            }
        };
        let count = ((self.from_fs - since_fs) / step_fs).ceil().max(0.0);
        if count > 0.0 {
            let from_fs = self.from_fs - count * step_fs;
            for mean in self
                .light
                .steps(from_fs, step_fs, count as usize, &class.extent)
            {
                ages.step(blindness, 0, mean);
            }
        }
        ages
    }

    /// The light on the window.
    pub(super) fn means(&self, extent: &Extent) -> Means {
        match &self.edges_fs {
            Some(edges_fs) => {
                let edges_fs: Vec<f64> = edges_fs.iter().map(|edge| self.from_fs + edge).collect();
                self.light.mean_photons(&edges_fs, extent).into()
            }
            None => (self.light).steps(self.from_fs, self.period_fs, self.bins, extent),
        }
    }

    /// The light on as many CLK periods before the window, if these are its bins, and it is far from even within one neither there nor
    /// in the window: no echo is shorter, none is missing, and the exposure has long begun.
    pub(super) fn even_past(&self, periods: usize, class: &Class) -> Option<Means> {
        if self.edges_fs.is_some() {
            return None;
        }
        let from_fs = self.from_fs - periods as f64 * self.period_fs;
        let finest_fs = self.light.finest_fs(from_fs..self.until_fs());
        let is_narrow = finest_fs.is_some_and(|sigma_fs| 2.0 * sigma_fs < self.period_fs);
        let is_lit =
            class.extent.lit_fs.start <= from_fs && class.extent.lit_fs.end >= self.until_fs();
        (is_lit && !is_narrow).then(|| {
            self.light
                .steps(from_fs, self.period_fs, periods, &class.extent)
        })
    }
}
