//! A random order of what happens in one instant, to show that no result depends on it.

use rand_philox::splitmix64;

use crate::kernel::wheel::Event;

pub(super) struct Shuffle {
    state: u64,
    /// Kept for its memory.
    pub(super) events: Vec<Event>,
}

impl Shuffle {
    pub(super) fn new(seed: u64) -> Self {
        Shuffle {
            state: seed,
            events: Vec::new(),
        }
    }

    /// Fisher and Yates.
    pub(super) fn permute<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let other = splitmix64(self.state) % (last as u64 + 1);
            items.swap(last, other as usize);
        }
    }
}
