//! A random order of what happens in one instant, for tests of what must not depend on it.

use rand_philox::splitmix64;

use crate::kernel::wheel::Event;

pub(super) struct Shuffle {
    pub(super) state: u64,
    /// Kept for its memory.
    pub(super) events: Vec<Event>,
}

impl Shuffle {
    /// Fisher and Yates.
    pub(super) fn permute<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let other = splitmix64(self.state) % (last as u64 + 1);
            items.swap(last, other as usize);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every one of the 24 orders of four comes, about as often as any other.
    #[test]
    fn a_shuffle_gives_every_order() {
        let mut shuffle = Shuffle {
            state: 7,
            events: Vec::new(),
        };
        let mut orders = std::collections::BTreeMap::new();
        for _ in 0..2400 {
            let mut items = [0, 1, 2, 3];
            shuffle.permute(&mut items);
            *orders.entry(items).or_insert(0) += 1;
        }
        assert_eq!(orders.len(), 24);
        assert!(
            orders.values().all(|&n| (60..140).contains(&n)),
            "{orders:?}"
        );
    }
}
