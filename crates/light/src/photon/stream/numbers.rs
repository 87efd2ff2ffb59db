//! How many photons there are in a group of laser cycles.

use std::cell::{OnceCell, RefCell};
use std::collections::VecDeque;
use std::sync::Arc;

use super::group::{CycleGroup, FIRST};
use crate::photon::philox::Blocks;
use crate::photon::random::Poisson;

/// Numbers of photons in groups of any length.
#[derive(Debug, Clone)]
pub(super) struct Numbers {
    per_cycle: f64,
    /// In one cycle, one of the shortest groups, and one of the longest. Made when first wanted.
    one: OnceCell<Arc<Poisson>>,
    short: OnceCell<Arc<Poisson>>,
    long: OnceCell<Arc<Poisson>>,
}

/// Distributions that a thread keeps: a calibration asks for the same one of every step, a frame for hardly any twice.
const KEPT: usize = 4;

/// The distribution of this mean, perhaps made before: it takes longer to make than a group of photons to draw.
fn poisson(mean: f64) -> Arc<Poisson> {
    /// Bits of the mean, and its distribution; the oldest first.
    type Made = VecDeque<(u64, Arc<Poisson>)>;
    thread_local! {
        static MADE: RefCell<Made> = const { RefCell::new(VecDeque::new()) };
    }
    MADE.with_borrow_mut(|made| {
        let bits = mean.to_bits();
        if let Some((_, known)) = made.iter().find(|(other, _)| *other == bits) {
            return Arc::clone(known);
        }
        let new = Arc::new(Poisson::new(mean));
        if made.len() == KEPT {
            made.pop_front();
        }
        made.push_back((bits, Arc::clone(&new)));
        new
    })
}

impl Numbers {
    pub(super) fn new(per_cycle: f64) -> Self {
        Numbers {
            per_cycle,
            one: OnceCell::new(),
            short: OnceCell::new(),
            long: OnceCell::new(),
        }
    }

    /// The mean in one laser cycle.
    pub(super) fn mean(&self) -> f64 {
        self.per_cycle
    }

    /// In one laser cycle.
    pub(super) fn per_cycle(&self) -> &Poisson {
        self.one.get_or_init(|| poisson(self.per_cycle))
    }

    /// A distribution, and how many draws of it make the number in this group.
    pub(super) fn distribution(&self, group: CycleGroup) -> (&Poisson, u32) {
        let (cell, cycles) = if group.cycles() == group.longest() {
            (&self.long, group.longest())
        } else {
            (&self.short, FIRST)
        };
        let poisson = cell.get_or_init(|| poisson(self.per_cycle * f64::from(cycles)));
        (poisson, group.cycles() / cycles)
    }
}

/// Numbers of photons from blocks of random words.
pub(super) struct Counts<'a> {
    /// First and second word of the next number, as rows of blocks; and of the one after it, from the same block.
    rows: [[&'a [u32]; 2]; 2],
    block: usize,
}

impl<'a> Counts<'a> {
    pub(super) fn new(blocks: &'a Blocks) -> Self {
        let [a, b, c, d] = blocks.rows();
        Counts {
            rows: [[a, b], [c, d]],
            block: 0,
        }
    }

    /// The sum of `draws` Poisson numbers from the next blocks.
    #[inline]
    pub(super) fn next(&mut self, poisson: &Poisson, draws: u32) -> u32 {
        let parts = poisson.words() * draws;
        let mut total = 0;
        for part in 0..parts {
            let [low, high] = self.rows[part as usize % 2];
            let word = u64::from(low[self.block]) | u64::from(high[self.block]) << 32;
            total += poisson.part(word);
            self.block += usize::from(part % 2 == 1 || part + 1 == parts);
        }
        total
    }
}
