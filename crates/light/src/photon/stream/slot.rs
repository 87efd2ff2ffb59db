//! Slots: equal parts of a laser cycle that are drawn by themselves.
//!
//! A slot is a CLK period or, where that is longer than [`LONGEST_FS`], one of 2ᵏ equal parts of it. The first one leads
//! the laser cycle by less than a CLK period, so that slots can be what a chip's bins are. Photons come in the middles of
//! 2¹⁷ equal steps of a slot: 20 fs at 384 MHz, at most 32 fs.
//!
//! ```text
//!   laser cycle          ├─────────────────────────────────────────── …
//!   slot           0               1               2                     start of slot n: ⌊n · length⌋ − lead, fs
//!          ├───────────────┼───────────────┼───────────────┼── …
//!   step    ·   ·   ·   ·   ·   ·   ·   ·
//! ```

use crate::units::{Frequency, Time};

/// Slots are no longer than that, fs.
pub(super) const LONGEST_FS: i64 = 1 << 22;

/// Bits of a random word that place a photon in its slot, the lowest ones.
pub const TIME_BITS: u32 = 17;
const TIME: u32 = (1 << TIME_BITS) - 1;

/// The slots of a laser cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slots {
    /// How many there are.
    pub count: u32,
    /// How much before its cycle the first one begins, fs.
    pub lead_fs: i64,
    /// k, where a CLK period has 2ᵏ slots.
    pub per_period_bits: u32,
    whole_fs: u64,
    /// In 2⁻⁶⁴ fs.
    fraction: u64,
    /// Length of each, s.
    pub length_s: f64,
}

impl Slots {
    /// Those of a cycle of `periods` periods of `clock`, which they lead.
    pub(super) fn new(clock: Frequency, periods: u32, lead: Time) -> Self {
        let mut per_period_bits = 0;
        while clock.part_fs(per_period_bits).0 >= LONGEST_FS as u64 {
            per_period_bits += 1;
        }
        let (whole_fs, fraction) = clock.part_fs(per_period_bits);
        Slots {
            count: periods << per_period_bits,
            lead_fs: lead.as_fs(),
            per_period_bits,
            whole_fs,
            fraction,
            length_s: 1.0 / (clock.as_hz() * f64::from(1u32 << per_period_bits)),
        }
    }

    /// Length of each, whole femtoseconds.
    pub fn length_fs(&self) -> i64 {
        self.whole_fs as i64
    }

    /// Background photons come no closer to the beginning or end of their slot, fs.
    pub fn margin_fs(&self) -> i64 {
        (self.whole_fs >> (TIME_BITS + 1)) as i64
    }

    /// When a slot begins, fs after the start of its cycle.
    #[inline]
    pub fn start_fs(&self, slot: u32) -> i64 {
        let fraction = (u128::from(self.fraction) * u128::from(slot)) >> 64;
        (self.whole_fs * u64::from(slot) + fraction as u64) as i64 - self.lead_fs
    }

    /// The slot that is running `time_fs` after the start of its cycle, no earlier than the first one begins.
    pub fn slot_at(&self, time_fs: i64) -> u32 {
        let into_fs = time_fs + self.lead_fs;
        debug_assert!(into_fs >= 0);
        let length = u128::from(self.whole_fs) << 32 | u128::from(self.fraction >> 32);
        let mut slot = (((into_fs as u128) << 32) / length) as u32;
        while self.start_fs(slot) > time_fs {
            slot -= 1;
        }
        while self.start_fs(slot + 1) <= time_fs {
            slot += 1;
        }
        slot
    }

    /// When a background photon comes after the start of its cycle, by its slot and random word, fs.
    #[inline]
    pub fn time_fs(&self, slot: u32, word: u32) -> i64 {
        let half_steps = u64::from(2 * (word & TIME) + 1);
        self.start_fs(slot) + ((half_steps * self.whole_fs) >> (TIME_BITS + 1)) as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn slots_fill_the_cycle(
            hz in prop_oneof![1_000u64..1_000_000, 1_000_000u64..2_000_000_000],
            periods in 1u32..600,
            lead in 0.0f64..1.0,
            slot: u32,
            word: u32,
        ) {
            let clock = Frequency::from_hz(hz);
            let lead = Time::from_s(lead / clock.as_hz());
            let slots = Slots::new(clock, periods, lead);
            prop_assert!(slots.length_fs() < LONGEST_FS);
            prop_assert_eq!(slots.count, periods << slots.per_period_bits);
            let slot = slot % slots.count;
            let (start, end) = (slots.start_fs(slot), slots.start_fs(slot + 1));
            prop_assert!((slots.length_fs()..=slots.length_fs() + 1).contains(&(end - start)));
            prop_assert!(slots.start_fs(slots.count) <= clock.whole_fs(i64::from(periods)) - lead.as_fs());
            if slots.per_period_bits == 0 {
                let edge = clock.whole_fs(i64::from(slot)) - lead.as_fs();
                prop_assert!((edge - 1..=edge).contains(&start));
            }
            prop_assert_eq!(slots.slot_at(start), slot);
            prop_assert_eq!(slots.slot_at(end - 1), slot);
            let time = slots.time_fs(slot, word);
            let margin = slots.margin_fs();
            prop_assert!((start + margin..end - margin).contains(&time));
            prop_assert_eq!(slots.slot_at(time), slot);
        }
    }
}
