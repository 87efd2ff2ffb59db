//! Which photons of a part are kept: those within its [`Limits`](super::limits::Limits), by random words of their own.
//!
//! ```text
//!   drawn     ↓ ↓  ↓   ↓ ↓  ↓ ↓ ↓    ↓  ↓↓     at the greatest rate
//!   profile   ▇▇▇▇▇▅▅▅▅▅▃▃▃▃▃▁▁▁▁▁             a photon is kept with the rate at its time, relative to the greatest
//!   kept      ↓ ↓  ↓     ↓    ↓                by a random word of its own
//! ```

use super::part::PixelStream;
use crate::photon::random::Purpose;
use crate::units::Time;

impl PixelStream<'_> {
    /// Whether the slots of a laser cycle may have photons that are kept.
    pub(super) fn draws_background_in(&self, cycle: u32) -> bool {
        let limits = self.limits.as_ref();
        limits.is_none_or(|limits| limits.drawn().contains(&cycle))
    }

    /// Whether photons of the echo of a laser cycle may be kept.
    pub(super) fn sends_echo_in(&self, cycle: u32) -> bool {
        let limits = self.limits.as_ref();
        limits.is_none_or(|limits| limits.cycles.contains(&cycle))
    }

    /// Whether a background photon is kept that comes `time_fs` after the start of its laser cycle. `words` are random ones
    /// that no other photon has, unless it comes at the same time on the same SPAD.
    #[inline(never)]
    pub(super) fn keeps_background(
        &self,
        cycle: u32,
        spad: u8,
        time_fs: i64,
        words: [u32; 2],
    ) -> bool {
        let Some(limits) = &self.limits else {
            return true;
        };
        let time = self.stream.cycle_start(cycle) + Time::from_fs(time_fs);
        if !limits.lit.contains(&time) {
            return false;
        }
        let mut chance = limits.chance(spad);
        if let Some(profile) = &limits.profile {
            let since_fs = match cycle.checked_sub(1) {
                Some(before) if time_fs < 0 => (time - self.stream.cycle_start(before)).as_fs(),
                _ => time_fs,
            };
            chance *= profile.rate_hz(since_fs) / profile.greatest_hz;
        }
        self.is_kept(chance, words)
    }

    /// Whether a photon of a laser cycle's echo is kept, with random words that no other photon has.
    #[inline]
    pub(super) fn keeps_signal(&self, cycle: u32, spad: u8, words: [u32; 2]) -> bool {
        match &self.limits {
            None => true,
            Some(limits) => {
                limits.cycles.contains(&cycle)
                    && self.is_kept(
                        limits.chance(spad) * limits.energy(cycle, self.stream),
                        words,
                    )
            }
        }
    }

    fn is_kept(&self, chance: f64, [first, second]: [u32; 2]) -> bool {
        if chance >= 1.0 {
            return true;
        }
        let counter = [first, second, self.pixel, Purpose::Thinning as u32];
        let word = rand_philox::philox4x32_10(counter, self.key)[0];
        f64::from(word) < chance * 2f64.powi(32)
    }
}
