//! Groups of laser cycles: what is drawn at once.
//!
//! ```text
//!   number     0     1     2       3           4          5       6
//!           ├─────┼─────┼─────┼───────────┼────────── … ──┼─── … ─┼─── … ─┼──
//!   cycle   0    128   256   512         1024            2048    4096    6144
//! ```
//!
//! Long groups take less time per photon, but an exposure draws its last one whole, whatever it needs of it. So
//! groups begin short and double until they have [`GROUP`] cycles: less than half of what is drawn comes after the
//! exposure, and a longer exposure begins with the same photons. With more than 16 SPADs the longest groups are
//! shorter, because cycle and SPAD share [`PLACE_BITS`]. Photons that trigger others and are rare have long groups
//! only.

use super::slot::TIME_BITS;
use crate::photon::SpadGrid;

/// Laser cycles of the longest groups, with up to 16 SPADs.
pub const GROUP: u32 = 1 << GROUP_BITS;
const GROUP_BITS: u32 = 11;

/// Laser cycles of the shortest groups.
pub(super) const FIRST: u32 = 1 << FIRST_BITS;
const FIRST_BITS: u32 = 7;

/// Where in its group a photon falls: cycle within the group and, in the lowest bits, SPAD ([`CycleGroup::split`]).
pub type GroupPlace = u16;

/// Most bits of a [`GroupPlace`], the highest ones of a random word: 2048 cycles and 16 SPADs.
pub const PLACE_BITS: u32 = GROUP_BITS + 4;

const _: () = assert!(PLACE_BITS + TIME_BITS <= u32::BITS);

/// A group of laser cycles, 2ᵏ of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CycleGroup {
    number: u32,
    first_cycle: u32,
    bits: u32,
    spad_bits: u32,
}

impl Default for CycleGroup {
    fn default() -> Self {
        CycleGroup::of_cycle(0, SpadGrid::default())
    }
}

impl CycleGroup {
    /// Bits of the longest groups' cycles.
    fn longest_bits(spad_bits: u32) -> u32 {
        GROUP_BITS.min(PLACE_BITS - spad_bits)
    }

    /// The group of a laser cycle.
    pub fn of_cycle(cycle: u32, grid: SpadGrid) -> Self {
        let spad_bits = grid.bits();
        let longest = Self::longest_bits(spad_bits);
        let bits = cycle.max(1).ilog2().clamp(FIRST_BITS, longest);
        let first_cycle = cycle >> bits << bits;
        let shorter = match first_cycle {
            0 => 0,
            _ => bits - FIRST_BITS,
        };
        CycleGroup {
            number: shorter + (first_cycle >> bits),
            first_cycle,
            bits,
            spad_bits,
        }
    }

    /// The longest group that a laser cycle may be in, where all groups are so long; a numbering of their own.
    pub(crate) fn long(cycle: u32, grid: SpadGrid) -> Self {
        let spad_bits = grid.bits();
        let bits = Self::longest_bits(spad_bits);
        CycleGroup {
            number: cycle >> bits,
            first_cycle: cycle >> bits << bits,
            bits,
            spad_bits,
        }
    }

    /// All groups that begin before laser cycle `end`.
    pub(crate) fn groups_until(end: u32, grid: SpadGrid) -> impl Iterator<Item = Self> {
        let mut next = Some(0);
        std::iter::from_fn(move || {
            let group = CycleGroup::of_cycle(next.filter(|&first| first < end)?, grid);
            next = group.first_cycle.checked_add(group.cycles());
            Some(group)
        })
    }

    /// Groups before it.
    pub(crate) fn number(self) -> u32 {
        self.number
    }

    /// Its first laser cycle.
    pub fn first_cycle(self) -> u32 {
        self.first_cycle
    }

    /// Its laser cycles.
    pub fn cycles(self) -> u32 {
        1 << self.bits
    }

    /// Laser cycles of the longest groups of this stream.
    pub(crate) fn longest(self) -> u32 {
        1 << Self::longest_bits(self.spad_bits)
    }

    /// Those of them that belong to an exposure of `laser_cycles`.
    pub fn cycles_in(self, laser_cycles: u32) -> u32 {
        laser_cycles
            .saturating_sub(self.first_cycle)
            .min(self.cycles())
    }

    /// By how much the random word of a photon is shifted to give its place.
    #[inline]
    pub fn place_shift(self) -> u32 {
        u32::BITS - self.spad_bits - self.bits
    }

    /// The place of a photon.
    #[inline]
    pub fn place(self, word: u32) -> GroupPlace {
        (word >> self.place_shift()) as GroupPlace
    }

    /// The place of a SPAD in a cycle within the group.
    pub(super) fn place_of(self, cycle: u32, spad: u8) -> GroupPlace {
        (cycle << self.spad_bits) as GroupPlace | GroupPlace::from(spad)
    }

    /// The cycle within the group, and the SPAD, of a place.
    #[inline]
    pub fn split(self, place: GroupPlace) -> (u32, u8) {
        let spad = place & ((1 << self.spad_bits) - 1);
        (u32::from(place >> self.spad_bits), spad as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn lengths_double_up_to_the_longest() {
        let groups: Vec<_> = CycleGroup::groups_until(4097, SpadGrid::default())
            .map(|group| (group.first_cycle(), group.cycles()))
            .collect();
        let expected = [
            (0, 128),
            (128, 128),
            (256, 256),
            (512, 512),
            (1024, 1024),
            (2048, 2048),
            (4096, 2048),
        ];
        assert_eq!(groups, expected);
        assert_eq!(CycleGroup::groups_until(0, SpadGrid::default()).count(), 0);
        assert_eq!(
            CycleGroup::groups_until(129, SpadGrid::default()).count(),
            2
        );
    }

    proptest! {
        #[test]
        fn every_cycle_is_in_the_group_of_its_number(
            cycle in prop_oneof![0u32..5000, any::<u32>()],
            side in 0usize..4,
            other in 0usize..4,
            word: u32,
        ) {
            let grid = SpadGrid::new(1 << side, 1 << other);
            let group = CycleGroup::of_cycle(cycle, grid);
            prop_assert!(cycle - group.first_cycle() < group.cycles());
            prop_assert_eq!(CycleGroup::of_cycle(group.first_cycle(), grid), group);
            let last = group.first_cycle() + (group.cycles() - 1);
            prop_assert_eq!(CycleGroup::of_cycle(last, grid), group);
            if let Some(next) = last.checked_add(1) {
                prop_assert_eq!(CycleGroup::of_cycle(next, grid).number(), group.number() + 1);
            }
            prop_assert!([128, 256, 512, 1024, 2048].contains(&group.cycles()));
            prop_assert!(group.number() < 1 << 24, "the counter has 24 bits for it");
            let last_place = (group.cycles() << grid.bits()) - 1;
            prop_assert_eq!(u32::from(group.place(u32::MAX)), last_place);
            let (within, spad) = group.split(group.place(word));
            prop_assert!(within < group.cycles() && usize::from(spad) < grid.spads());
            prop_assert!(group.cycles() <= group.longest());
        }
    }
}
