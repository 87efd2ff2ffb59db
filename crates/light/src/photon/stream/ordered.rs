//! Echoes whose photons are drawn in their order, and only where their SPAD is ready for them.
//!
//! ```text
//!   intensity       ▁▂▅█▅▂▁
//!   SPAD              │▔▔▔▔▔▔▔▔▔│         the next photon comes where the cumulated intensity since the SPAD became
//!                     ╰ dead    ╰ ready   ready has grown by an exponential number
//! ```

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;
use smallvec::{SmallVec, smallvec};

use super::bright::{PER_BLOCK, TILE};
use super::part::{PixelStream, nearest};
use crate::numerics::branchless;
use crate::photon::philox::blocks_from;
use crate::photon::spad::{DeadTimeLaw, FEW_SPADS, Photon};
use crate::photon::spad_grid::MOST_SPADS;
use crate::units::Time;

/// An exponential number of mean 1.
#[inline(always)]
fn exponential(word: u32) -> f64 {
    -branchless::ln((branchless::real(u64::from(word)) + 0.5) * 0.5f64.powi(32))
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1"
))]
fn exponentials(words: &[u32; TILE], numbers: &mut [f64; TILE]) {
    for (&word, number) in words.iter().zip(numbers) {
        *number = exponential(word);
    }
}

/// Smaller words are exponential numbers above [`LATE`](super::part::LATE): e⁻⁰·⁰¹ is 0.99005.
const LATE_WORD: u32 = (0.99 * 4294967296.0) as u32;

/// No photon comes: later than all that do.
pub const NEVER_FS: i64 = i64::MAX / 4;

impl<'a> PixelStream<'a> {
    /// When the next photon of an echo comes on a SPAD whose cumulated share of it is `passed`, fs after the start of the
    /// echo's cycle; [`NEVER_FS`] if none does.
    #[inline(always)]
    fn arrival_fs(&self, passed: f64, word: u32) -> i64 {
        self.reached_fs(passed + exponential(word))
    }

    /// When the cumulated intensity of an echo on a SPAD reaches a number of photons, fs after the start of its cycle.
    #[inline(always)]
    fn reached_fs(&self, reached: f64) -> i64 {
        if reached >= self.signal_per_spad {
            return NEVER_FS;
        }
        let after_fs = self.gaussian.quantile(reached / self.signal_per_spad);
        self.arrival_fs + nearest(after_fs)
    }

    /// Whether an echo has no photon later than `after_fs` after the start of its cycle.
    #[inline]
    pub fn is_over(&self, after_fs: i64) -> bool {
        after_fs >= self.echo_fs.1
    }

    /// The intensity of the echo on a SPAD until `time_fs` after the start of its cycle, photons.
    pub(super) fn passed_until(&self, time_fs: i64) -> f64 {
        let (after_fs, sigma_fs) = ((time_fs - self.arrival_fs) as f64, self.gaussian.sigma);
        if sigma_fs == 0.0 {
            return if after_fs >= 0.0 {
                self.signal_per_spad
            } else {
                0.0
            };
        }
        let z = after_fs / sigma_fs;
        let beyond = branchless::normal_above(z.abs());
        self.signal_per_spad * if z < 0.0 { beyond } else { 1.0 - beyond }
    }

    /// First photons of the echoes of [`TILE`] laser cycles from `first_cycle` on, by SPAD and cycle: times after the start of
    /// the cycle, fs, or [`NEVER_FS`].
    pub fn first_arrivals(&self, first_cycle: u32, times_fs: &mut [[i64; TILE]]) {
        if !self.has_ordered_echo() {
            times_fs.fill([NEVER_FS; TILE]);
            return;
        }
        let mut words = [[0; TILE]; MOST_SPADS];
        let words = &mut words[..times_fs.len().next_multiple_of(PER_BLOCK)];
        self.echo_words(first_cycle, 0, words);
        let mut reached = [0.0; TILE];
        for (words, times_fs) in words.iter().zip(times_fs) {
            exponentials(words, &mut reached);
            for (&reached, time_fs) in reached.iter().zip(times_fs) {
                *time_fs = self.reached_fs(reached);
            }
        }
    }

    /// The random words of the echoes of [`TILE`] laser cycles from `first_cycle` on, after `drawn` of them.
    /// There is a row for each SPAD, and as many more as fill up a block.
    pub fn echo_words(&self, first_cycle: u32, drawn: u32, words: &mut [[u32; TILE]]) {
        let runs = (words.len() / PER_BLOCK) as u32;
        for (run, words) in (drawn * runs..).zip(words.as_chunks_mut::<PER_BLOCK>().0) {
            let others = [run, self.pixel, self.kind.bright_echo()];
            blocks_from(first_cycle, others, self.key, words);
        }
    }

    /// The echoes of no laser cycle so far.
    pub fn ordered_echoes(&self) -> OrderedEchoes<'_> {
        OrderedEchoes {
            pixel: self,
            end: self.stream.cycle_start(self.stream.config.laser_cycles),
            echoes: SmallVec::new(),
            next: None,
            drawn: 0,
        }
    }
}

/// Echoes of which only the photons are drawn that find their SPAD ready.
pub struct OrderedEchoes<'a> {
    pixel: &'a PixelStream<'a>,
    /// End of the exposure.
    end: Time,
    echoes: SmallVec<[OrderedEcho; 1]>,
    /// The next photon of all of them.
    next: Option<Photon>,
    /// Photons that made avalanches so far.
    pub drawn: u64,
}

/// The echo of one laser cycle.
struct OrderedEcho {
    cycle: u32,
    start: Time,
    /// Its next photon on each SPAD.
    next: SmallVec<[Time; FEW_SPADS]>,
    /// How many have been drawn on each SPAD.
    drawn: SmallVec<[u32; FEW_SPADS]>,
}

impl OrderedEchoes<'_> {
    /// Adds the echo of a laser cycle, whose photons all come after those that were asked for so far.
    pub fn add(&mut self, cycle: u32) {
        if !self.pixel.has_ordered_echo() {
            return;
        }
        let start = self.pixel.stream.cycle_start(cycle);
        let mut echo = OrderedEcho {
            cycle,
            start,
            next: SmallVec::new(),
            drawn: smallvec![1; self.pixel.stream.spads()],
        };
        let mut words = [0; PER_BLOCK];
        for spad in 0..self.pixel.stream.spads() {
            if spad % PER_BLOCK == 0 {
                words = self.pixel.echo_block(cycle, 0, spad);
            }
            let time_fs = self.pixel.arrival_fs(0.0, words[spad % PER_BLOCK]);
            echo.next.push(start + Time::from_fs(time_fs));
            self.pixel.skip_before_exposure(&mut echo, spad);
        }
        self.echoes.push(echo);
        self.next = self.earliest();
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.echoes.is_empty()
    }

    /// Forgets the echoes that are over.
    pub(crate) fn forget_before(&mut self, time: Time) {
        let last_fs = self.pixel.echo_fs.1;
        self.echoes
            .retain(|echo| echo.start + Time::from_fs(last_fs) >= time);
    }

    /// The next photon of all echoes and SPADs that is within the exposure.
    #[inline]
    pub(in crate::photon) fn next(&self) -> Option<Photon> {
        self.next
    }

    fn earliest(&self) -> Option<Photon> {
        let times = self.echoes.iter().flat_map(|echo| (0u8..).zip(&echo.next));
        let (&time, spad) = times.map(|(spad, time)| (time, spad)).min()?;
        let photon = Photon::new(time, spad, false);
        (time < self.end).then_some(photon)
    }

    /// Takes notice that a SPAD with this dead time is blind `from` a time, or was known to be until then, `until` another one. Returns
    /// until when it is blind with the photons that come meanwhile.
    pub(in crate::photon) fn blind(
        &mut self,
        spad: u8,
        dead_time: Time,
        from: Time,
        until: Time,
    ) -> Time {
        let (spad, pixel) = (usize::from(spad), self.pixel);
        let model = &pixel.stream.config.spads;
        let (mut from, mut until) = (from, until);
        let mut is_changed = false;
        loop {
            let mut last = None;
            for echo in &mut self.echoes {
                let first = echo.next[spad];
                if first > until {
                    continue;
                }
                is_changed = true;
                // Others were never more than candidates.
                self.drawn += u64::from(first <= from);
                if model.law == DeadTimeLaw::Paralysable {
                    let of_echo = pixel.last_until(echo, spad, first, until);
                    last = last.max(Some(of_echo).filter(|&time| time > from));
                }
                pixel.draw_next(echo, spad, until);
            }
            let Some(last) = last else {
                if is_changed {
                    self.next = self.earliest();
                }
                return until;
            };
            (from, until) = (until, last + dead_time);
        }
    }
}

impl PixelStream<'_> {
    /// The next random word of a laser cycle's echo on a SPAD, of which `drawn` have been drawn.
    pub fn echo_word(&self, cycle: u32, spad: usize, drawn: &mut u32) -> u32 {
        let words = self.echo_block(cycle, *drawn, spad);
        *drawn += 1;
        words[spad % PER_BLOCK]
    }

    /// The random words of a SPAD and those that share its block, of which `drawn` have been drawn.
    fn echo_block(&self, cycle: u32, drawn: u32, spad: usize) -> [u32; PER_BLOCK] {
        let second =
            drawn * self.stream.spads().div_ceil(PER_BLOCK) as u32 + (spad / PER_BLOCK) as u32;
        let counter = [cycle, second, self.pixel, self.kind.bright_echo()];
        rand_philox::philox4x32_10(counter, self.key)
    }

    /// Draws the first photon of an echo after a time.
    fn draw_next(&self, echo: &mut OrderedEcho, spad: usize, after: Time) {
        let after_fs = (after - echo.start).as_fs();
        let time_fs = if self.is_over(after_fs) {
            NEVER_FS
        } else {
            let word = self.echo_word(echo.cycle, spad, &mut echo.drawn[spad]);
            self.next_arrival_fs(after_fs, word)
        };
        echo.next[spad] = echo.start + Time::from_fs(time_fs);
        self.skip_before_exposure(echo, spad);
    }

    /// What comes before the exposure is no photon, and the SPAD waits for the next one.
    fn skip_before_exposure(&self, echo: &mut OrderedEcho, spad: usize) {
        if echo.next[spad] < Time::ZERO {
            self.draw_next(echo, spad, Time::from_fs(-1));
        }
    }

    /// When the first photon of an echo comes on a SPAD after `after_fs`, both fs after the start of its cycle, by a random
    /// word; [`NEVER_FS`] if none does.
    #[inline]
    pub fn next_arrival_fs(&self, after_fs: i64, word: u32) -> i64 {
        // Most that come so late are decided by the word alone.
        if after_fs >= self.late_fs && word < LATE_WORD {
            return NEVER_FS;
        }
        // Quantiles are off by up to 10⁻⁷ σ.
        self.arrival_fs(self.passed_until(after_fs), word)
            .max(after_fs + 1)
    }

    /// The last photon of an echo until a time, if `first` is the first one.
    fn last_until(&self, echo: &mut OrderedEcho, spad: usize, first: Time, until: Time) -> Time {
        let passed = |time: Time| self.passed_until((time - echo.start).as_fs());
        let (at_first, at_end) = (passed(first), passed(until));
        let last = at_end - exponential(self.echo_word(echo.cycle, spad, &mut echo.drawn[spad]));
        if last <= at_first {
            return first;
        }
        let after_fs = self.gaussian.quantile(last / self.signal_per_spad);
        let time = echo.start + Time::from_fs(self.arrival_fs + nearest(after_fs));
        time.clamp(first, until)
    }
}
