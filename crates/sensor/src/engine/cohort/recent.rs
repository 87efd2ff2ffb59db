//! Laser cycles by which of their last bins had an event: the fast way in much light.
//!
//! ```text
//!   bins of a laser cycle     …  b−5  b−4  b−3  b−2  b−1   b
//!   had an event                  ?    1    0    1    1    ──► with this probability bin b has one, too
//!                            left out  └── history ─┘
//! ```
//!
//! A histogram only counts events, and what a laser cycle will count follows nearly as well from which of its last bins had
//! one as from what became of each SPAD. Of these histories there are 2ᵏ, however many laser cycles there are and however
//! much light, where states of 16 SPADs go into thousands.
//!
//! That some bins all are without an event has a probability that is one SPAD's to the power of their number
//! (`weighted.rs`), and from those of all subsets of k + 1 successive bins follow the probabilities of every history of them, by
//! inclusion and exclusion. So counts of these have the joint distribution that the SPADs give them. What is left out is how
//! bins farther apart depend on each other beyond what those between them tell. That is computed, too: the
//! correlation of each two bins, from the SPADs and from the histories; k is 4, 6 or 8, the least with which
//! they differ by no more than is to be neglected ([`CohortOptions::neglect`](super::CohortOptions)).
//!
//! By joint states ([`joint`](super::joint)) the street would take 2.9 times as long, with 16 000 laser cycles 4.4 times.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;

use super::Counts;
use super::abreast::{LANES, Lanes, binomials};
use super::cycles::LikeCycles;
use super::draw::binomial;
use super::events::{EventTable, NoEvent};
use super::weighted::WeightedSpad;
use super::words::RandomWords;

/// Bins that a history may tell of; of the fewest, all histories go abreast.
const KNOWN: [u32; 3] = [4, 6, 8];

/// Where at most this many histories of [`LANES`] have laser cycles in them, they are drawn one by one.
const FEW: usize = 3;

/// How likely a bin has no event after each history.
pub(super) struct Histories {
    /// Bins of a history.
    known: u32,
    /// By bin and history: of bin b, bit b mod k of a history is whether it was without an event; before the window all
    /// were.
    none: Vec<Lanes>,
}

/// As few histories as leave out no larger correlation between two bins than `neglect`; `None` where the most do not do,
/// where nothing is to be left out, or where events are of a kind that probabilities of a single SPAD do not tell.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(crate) fn histories(
    like: &LikeCycles,
    is_event: &EventTable,
    neglect: f64,
) -> Option<Histories> {
    let LikeCycles {
        blindness,
        ages,
        means,
        ..
    } = like;
    let no_event = is_event.no_event().filter(|_| neglect > 0.0)?;
    let spads = (no_event.weight, is_event.spads());
    let rows = means.len().div_ceil(LANES);
    let pairs = Pairs::new(
        WeightedSpad::new(blindness, ages, spads, rows),
        &no_event,
        means,
    );
    for known in KNOWN {
        let rows = (1 << known) / LANES;
        let spads = WeightedSpad::new(blindness, ages, spads, rows);
        let (histories, without) = Histories::new(spads, &no_event, known, means);
        if pairs.left_out_by(&histories, &without, neglect) <= neglect {
            return Some(histories);
        }
    }
    None
}

/// Turns expectations under the weightings that name each subset of some bins into probabilities of which had no event.
#[inline(always)]
fn unravel(table: &mut [Lanes], no_event: &NoEvent) {
    let pair = |unnamed: &mut f64, named: &mut f64| {
        *named = no_event.expectation(*unnamed, *named);
        *unnamed -= *named;
    };
    for row in table.iter_mut() {
        for half in [1, 2, 4, 8] {
            for pairs in row.chunks_exact_mut(2 * half) {
                let (unnamed, named) = pairs.split_at_mut(half);
                unnamed.iter_mut().zip(named).for_each(|(a, b)| pair(a, b));
            }
        }
    }
    let mut half = 1;
    while half < table.len() {
        for pairs in table.chunks_exact_mut(2 * half) {
            let (unnamed, named) = pairs.split_at_mut(half);
            let (unnamed, named) = (unnamed.as_flattened_mut(), named.as_flattened_mut());
            unnamed.iter_mut().zip(named).for_each(|(a, b)| pair(a, b));
        }
        half *= 2;
    }
}

impl Histories {
    /// Histories of `known` bins, with `means` photons on a SPAD, and the probability that each is followed by a bin
    /// without an event; both by bin and history.
    #[inline(always)]
    fn new(
        mut spads: WeightedSpad,
        no_event: &NoEvent,
        known: u32,
        means: &[f64],
    ) -> (Self, Vec<Lanes>) {
        let rows = (1 << known) / LANES;
        let mut none = vec![[1.0; LANES]; means.len() * rows];
        let mut without = none.clone();
        // How likely each history is before a bin.
        let mut likely = vec![[0.0; LANES]; rows];
        likely[rows - 1][LANES - 1] = 1.0;
        let mut unnamed = likely.clone();
        let by_bin = none
            .chunks_exact_mut(rows)
            .zip(without.chunks_exact_mut(rows));
        for (bin, (none, without)) in by_bin.enumerate() {
            if no_event.needs_unnamed() {
                spads.expectations(&mut unnamed);
            }
            spads.bin(bin, means[bin]);
            spads.expectations_named(without);
            let each = without
                .as_flattened_mut()
                .iter_mut()
                .zip(unnamed.as_flattened());
            each.for_each(|(named, &unnamed)| *named = no_event.expectation(unnamed, *named));
            unravel(without, no_event);
            for ((none, without), likely) in none.iter_mut().zip(&mut *without).zip(&likely) {
                for lane in 0..LANES {
                    // What cannot be may come out as anything that is nearly nothing.
                    without[lane] = without[lane].max(0.0).min(likely[lane]);
                    let is_likely = likely[lane] > 0.0;
                    none[lane] = if is_likely {
                        without[lane] / likely[lane]
                    } else {
                        1.0
                    };
                }
            }
            let here = 1 << (bin as u32 % known);
            let pairs = likely.as_flattened_mut().chunks_exact_mut(2 * here);
            for (likely, without) in pairs.zip(without.as_flattened().chunks_exact(2 * here)) {
                let (event, no_event) = likely.split_at_mut(here);
                for lane in 0..here {
                    let either = event[lane] + no_event[lane];
                    no_event[lane] = without[lane] + without[here + lane];
                    event[lane] = (either - no_event[lane]).max(0.0);
                }
            }
            spads.name_every_other(here);
        }
        (Histories { known, none }, without)
    }

    fn rows(&self) -> usize {
        (1 << self.known) / LANES
    }

    /// Histories, over all bins.
    pub(super) fn number(&self) -> usize {
        self.none.len() * LANES
    }

    /// Counts of every bin after `cycles` laser cycles.
    pub(super) fn draw_counts(&self, cycles: u64, random: &mut RandomWords) -> Counts {
        draw_counts(self, cycles, random)
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn draw_counts(histories: &Histories, cycles: u64, random: &mut RandomWords) -> Counts {
    let rows = histories.rows();
    let mut present = vec![[0; LANES]; rows];
    present[rows - 1][LANES - 1] = cycles;
    let mut without = vec![[0; LANES]; rows];
    let mut counts = Counts::new();
    for (bin, none) in histories.none.chunks_exact(rows).enumerate() {
        for ((present, none), without) in present.iter().zip(none).zip(&mut without) {
            draw_row(present, none, without, random);
        }
        let here = 1 << (bin as u32 % histories.known);
        let pairs = present.as_flattened_mut().chunks_exact_mut(2 * here);
        let mut count = 0;
        for (present, without) in pairs.zip(without.as_flattened().chunks_exact(2 * here)) {
            let (event, no_event) = present.split_at_mut(here);
            for lane in 0..here {
                let cycles = event[lane] + no_event[lane];
                no_event[lane] = without[lane] + without[here + lane];
                event[lane] = cycles - no_event[lane];
                count += event[lane];
            }
        }
        counts.push(count);
    }
    counts
}

/// How many of the laser cycles with each history have no event.
#[inline(always)]
fn draw_row(
    present: &[u64; LANES],
    none: &Lanes,
    without: &mut [u64; LANES],
    random: &mut RandomWords,
) {
    let inhabited = present.iter().filter(|&&cycles| cycles > 0).count();
    if inhabited > FEW {
        let some = none.map(|none| 1.0 - none);
        *without = binomials(present, none, &some, random);
        return;
    }
    for (lane, &cycles) in present.iter().enumerate() {
        without[lane] = match cycles {
            0 => 0,
            _ => binomial(cycles, none[lane], 1.0 - none[lane], random),
        };
    }
}

/// How likely bins and pairs of them have no event, from the SPADs.
struct Pairs {
    /// Of each bin.
    single: Vec<f64>,
    /// By the later bin, both of it and each earlier one.
    both: Vec<Lanes>,
}

impl Pairs {
    /// With `means` photons on a SPAD; `spads` are under a weighting for every bin.
    #[inline(always)]
    fn new(mut spads: WeightedSpad, no_event: &NoEvent, means: &[f64]) -> Self {
        let bins = means.len();
        let rows = bins.div_ceil(LANES);
        let mut single = Vec::with_capacity(bins);
        let mut both = vec![[0.0; LANES]; bins * rows];
        let mut unnamed = vec![[0.0; LANES]; rows];
        for (bin, &mean) in means.iter().enumerate() {
            if no_event.needs_unnamed() {
                spads.expectations(&mut unnamed);
            }
            spads.bin(bin, mean);
            let both = &mut both[bin * rows..][..rows];
            spads.expectations_named(both);
            let (both, unnamed) = (both.as_flattened_mut(), unnamed.as_flattened());
            // Until now the weighting of this bin names nothing.
            let named = both[bin];
            single.push(no_event.expectation(1.0, named));
            for earlier in 0..bin {
                let alone = no_event.expectation(1.0, unnamed[earlier]);
                both[earlier] =
                    no_event.expectation(alone, no_event.expectation(named, both[earlier]));
            }
            spads.name(bin);
        }
        Pairs { single, both }
    }

    /// By how much the correlation of two bins is off by `histories` at most, or one that is off by more than is `allowed`;
    /// `without` is as of [`Histories::new`].
    #[inline(always)]
    fn left_out_by(&self, histories: &Histories, without: &[Lanes], allowed: f64) -> f64 {
        let (bins, known, rows) = (
            self.single.len(),
            histories.known as usize,
            histories.rows(),
        );
        let deviation = |bin: usize| (self.single[bin] * (1.0 - self.single[bin])).sqrt();
        let mut most: f64 = 0.0;
        let mut then = vec![[0.0; LANES]; rows];
        for later in known + 1..bins {
            let both = self.both[later * bins.div_ceil(LANES)..].as_flattened();
            // How likely the later bin has no event, after each history.
            then.copy_from_slice(&histories.none[later * rows..][..rows]);
            for bin in (0..later).rev() {
                let here = 1 << (bin % known);
                if bin + known < later {
                    let off = together(&without[bin * rows..][..rows], &then, here) - both[bin];
                    if off.abs() > ROUNDING {
                        most = most.max(off.abs() / (deviation(bin) * deviation(later)));
                    }
                }
                let none = histories.none[bin * rows..][..rows].as_flattened();
                let pairs = then.as_flattened_mut().chunks_exact_mut(2 * here);
                for (then, none) in pairs.zip(none.chunks_exact(2 * here)) {
                    let (event, no_event) = then.split_at_mut(here);
                    for lane in 0..here {
                        let more = no_event[lane] - event[lane];
                        no_event[lane] = event[lane] + none[here + lane] * more;
                        event[lane] += none[lane] * more;
                    }
                }
            }
            if most > allowed {
                break;
            }
        }
        most
    }
}

/// Sum over all histories of `before`, times `after` that history and a bin without an event, whose bit is `here`.
#[inline(always)]
fn together(before: &[Lanes], after: &[Lanes], here: usize) -> f64 {
    let mut sums = [0.0; LANES];
    for (row, before) in before.iter().enumerate() {
        let after = &after[row | (here / LANES)];
        for lane in 0..LANES {
            sums[lane] += before[lane] * after[lane | (here % LANES)];
        }
    }
    sums.iter().sum()
}

/// What probabilities are off by computing, at most.
const ROUNDING: f64 = 1e-13;

#[cfg(test)]
mod tests {
    use super::super::Means;
    use super::super::blindness::{Ages, Blindness};
    use super::super::one_by_one;
    use super::*;
    use crate::photon::DeadTimeLaw;

    const BINS: usize = 9;

    /// Odd numbers of SPADs, or any.
    fn events() -> [EventTable; 2] {
        [
            EventTable::new(5, |spads| spads > 0),
            EventTable::new(5, |spads| spads % 2 == 1),
        ]
    }

    fn light() -> Means {
        let means = [0.1, 0.02, 0.4, 0.9, 0.3, 0.05, 0.1, 0.02, 0.3];
        means.as_slice().into()
    }

    /// Which bins of a laser cycle have events, bit by bit, against its SPADs followed one by one: each history of all but one
    /// of five successive bins is as frequent, and leads to an event as often.
    #[test]
    fn histories_are_as_frequent_as_of_spads_one_by_one() {
        const TRIALS: usize = 200_000;
        for law in [DeadTimeLaw::NonParalysable, DeadTimeLaw::Paralysable] {
            for is_event in events() {
                let blindness = Blindness::new(law, 2.6);
                let like = LikeCycles::steady(1, blindness, 0.1, &light());
                let no_event = is_event.no_event().unwrap();
                let spads = (no_event.weight, is_event.spads());
                let spads = WeightedSpad::new(&like.blindness, &like.ages, spads, 1);
                let (histories, _) = Histories::new(spads, &no_event, 4, &like.means);
                let mut random = RandomWords::new(6, 0);
                let mut seen = [vec![[0u32; 32]; BINS - 4], vec![[0u32; 32]; BINS - 4]];
                for _ in 0..TRIALS {
                    let reference = one_by_one::draw_counts(&like, &is_event, &mut random);
                    for (seen, counts) in seen
                        .iter_mut()
                        .zip([reference, histories.draw_counts(1, &mut random)])
                    {
                        for (seen, bins) in seen.iter_mut().zip(counts.windows(5)) {
                            let word = bins.iter().fold(0, |word, &bin| word << 1 | bin as usize);
                            seen[word] += 1;
                        }
                    }
                }
                let [reference, drawn] = seen.each_ref().map(|seen| seen.as_flattened());
                for (reference, drawn) in reference.iter().zip(drawn) {
                    let error = 5.0 * f64::from(reference + drawn + 1).sqrt();
                    let off = f64::from(*reference) - f64::from(*drawn);
                    assert!(
                        off.abs() < error,
                        "{law:?}, {is_event:?}: {reference} {drawn}"
                    );
                }
            }
        }
    }

    /// Correlations of all bins, from the probability of each of all 2⁹ laser cycles that there may be.
    fn correlations(histories: &Histories) -> Vec<f64> {
        let rows = histories.rows();
        let mut moments = [[0.0; BINS]; BINS];
        for word in 0..1usize << BINS {
            let (mut p, mut history) = (1.0, rows * LANES - 1);
            for bin in 0..BINS {
                let none = histories.none[bin * rows..].as_flattened()[history];
                let here = 1 << (bin as u32 % histories.known);
                if word >> bin & 1 == 1 {
                    (p, history) = (p * (1.0 - none), history & !here);
                } else {
                    (p, history) = (p * none, history | here);
                }
            }
            for a in (0..BINS).filter(|a| word >> a & 1 == 1) {
                for b in (0..BINS).filter(|b| word >> b & 1 == 1) {
                    moments[a][b] += p;
                }
            }
        }
        let pairs = (0..BINS).flat_map(|a| (0..BINS).map(move |b| [a, b]));
        let each = pairs.map(|[a, b]| {
            let covariance = |a: usize, b: usize| moments[a][b] - moments[a][a] * moments[b][b];
            covariance(a, b) / (covariance(a, a) * covariance(b, b)).sqrt()
        });
        each.collect()
    }

    /// Histories of eight bins leave nothing of nine out; beside them shorter ones leave out as much as they are said to.
    #[test]
    fn what_is_left_out_is_told() {
        for is_event in events() {
            let blindness = Blindness::new(DeadTimeLaw::NonParalysable, 3.07);
            let ages = Ages::steady(&blindness, 0.1);
            let means = light();
            let no_event = is_event.no_event().unwrap();
            let weighted = |rows| {
                let spads = (no_event.weight, is_event.spads());
                WeightedSpad::new(&blindness, &ages, spads, rows)
            };
            let pairs = Pairs::new(weighted(1), &no_event, &means);
            let [few, some, all] = KNOWN.map(|known| {
                Histories::new(weighted((1 << known) / LANES), &no_event, known, &means)
            });
            assert_eq!(pairs.left_out_by(&all.0, &all.1, 1.0), 0.0);
            let exact = correlations(&all.0);
            for (histories, without) in [&few, &some] {
                let found = correlations(histories);
                let off = exact
                    .iter()
                    .zip(&found)
                    .map(|(exact, found)| (exact - found).abs());
                let (off, told) = (
                    off.fold(0.0, f64::max),
                    pairs.left_out_by(histories, without, 1.0),
                );
                assert!(
                    off > 1e-6 && (off / told - 1.0).abs() < 1e-3,
                    "{off} {told}"
                );
            }
        }
    }

    /// As many bins as are known are left to the least histories that keep to what may be neglected.
    #[test]
    fn the_least_histories_that_do_are_taken() {
        let is_event = EventTable::new(16, |spads| spads > 0);
        let found = |neglect, mean: f64, is_event: &EventTable| {
            let blindness = Blindness::new(DeadTimeLaw::NonParalysable, 3.07);
            let means: Means = light().iter().map(|light| light * mean).collect();
            let like = LikeCycles::steady(1, blindness, 0.01, &means);
            histories(&like, is_event, neglect).map(|found| found.known)
        };
        assert_eq!(found(1e-4, 0.02, &is_event), Some(4));
        assert!(found(1e-4, 1.0, &is_event) > Some(4));
        assert_eq!(found(1e-15, 1.0, &is_event), Some(8));
        assert_eq!(found(0.0, 0.02, &is_event), None);
        let two = EventTable::new(16, |spads| spads > 1);
        assert!(found(1.0, 0.02, &two).is_none());
    }
}
