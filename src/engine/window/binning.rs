//! From random words to histogram bins, many photons at a time.
//!
//! A photon's place in the window is a number of CLK periods with 24 binary places, which decides its bin unless
//! it comes within a few femtoseconds of an edge; such photons are marked and settled exactly, one by one.
//! Bins have a row before them for photons that matter only as blinders, and one after them for those that do not
//! matter at all.
//!
//! ```text
//!   code    31        19     15         8 7      0         marks   31     15     0
//!          ┌─────────┬──────┬──┬─────────┬────────┐                ┌──────┬──────┐
//!          │ cycle   │ SPAD │  │doubtful │ row    │                │ bins │ SPADs│
//!          └─────────┴──────┴──┴─────────┴────────┘                └──────┴──────┘
//! ```

use multiversion::multiversion;

use super::echo::{EchoRows, Passed};
use super::sight::ROUNDING_FS;
use crate::photon::{Draw, GROUP, PER_BLOCK, PixelStream, Place, SPADS, Slots, TIME_BITS};

/// Binary places of a position in CLK periods.
const FRACTION_BITS: u32 = 24;
const FRACTION: u32 = (1 << FRACTION_BITS) - 1;

/// Whole CLK periods added to positions, so that all that matter are above 0.
const BIAS: u32 = 32;

/// Adding it to a number below 2³² leaves its nearest integer in the low half.
const INTEGER: f64 = (1u64 << 52) as f64;

const DOUBTFUL: u32 = 1 << 8;
const PLACE_SHIFT: u32 = 16;
const SPAD_BITS: u32 = SPADS.trailing_zeros();

/// The marks of SPADs.
pub const SPAD_MARKS: u32 = (1 << SPADS) - 1;

/// Bins that have a mark of their own.
pub const MARKED_BINS: usize = u32::BITS as usize - SPADS;
const CYCLE_SHIFT: u32 = PLACE_SHIFT + SPAD_BITS;

/// Rows that a code can name.
pub const ROWS: usize = 256;

/// Cycles that a code can name: those of a group, and more for photons that are none.
pub const CYCLES: usize = 2 * GROUP as usize;

const _: () = assert!(CYCLES << CYCLE_SHIFT == 1 << u32::BITS);

/// A photon's row, cycle and SPAD.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Code(u32);

impl Code {
    /// No photon, without marks. It has a row and a cycle that nobody looks at.
    pub const NONE: Code = Code(GROUP << CYCLE_SHIFT | (ROWS as u32 - 1));

    /// Of a photon at `place`, in one of `bins` bins, and its mark.
    #[inline(always)]
    pub fn new(place: u32, row: u32, is_doubtful: bool, bins: u32) -> (Code, u32) {
        let is_in_bin = row.wrapping_sub(1) < bins;
        let bin_mark = u32::from(is_in_bin) << (SPADS as u32 + row % MARKED_BINS as u32);
        let doubtful = u32::from(is_doubtful) << DOUBTFUL.trailing_zeros();
        let code = place << PLACE_SHIFT | doubtful | row;
        (Code(code), bin_mark | 1 << (place % SPADS as u32))
    }

    /// Cycle within the group.
    #[inline]
    pub fn cycle(self) -> usize {
        (self.0 >> CYCLE_SHIFT) as usize
    }

    /// SPAD.
    #[inline]
    pub fn spad(self) -> u8 {
        (self.0 >> PLACE_SHIFT) as u8 % SPADS as u8
    }

    /// Bin + 1; 0 before the window.
    #[inline]
    pub fn row(self) -> usize {
        self.0 as usize % ROWS
    }

    /// Whether the photon is too close to an edge.
    #[inline]
    pub fn is_doubtful(self) -> bool {
        self.0 & DOUBTFUL != 0
    }
}

/// The codes of photons, and what to look for in a cycle's other photons: a bit for the SPAD and one for the bin. More
/// than 16 bins share bits.
#[derive(Debug, Default)]
pub struct Codes {
    len: usize,
    /// Longer than needed, so that what was there before need not be cleared.
    codes: Vec<Code>,
    marks: Vec<u32>,
    passed: Passed,
}

impl Codes {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// How many there are, those that are no photons among them.
    pub fn len(&self) -> usize {
        self.len
    }

    /// The codes.
    pub fn codes(&self) -> &[Code] {
        &self.codes[..self.len]
    }

    /// Their marks.
    pub fn marks(&self) -> &[u32] {
        &self.marks[..self.len]
    }

    /// Photons that are too close to an edge.
    pub fn doubtful(&self) -> impl Iterator<Item = usize> {
        // They are rare: most groups have none, which is quickly seen.
        const TOGETHER: usize = 64;
        let chunks = self.codes().chunks(TOGETHER).enumerate();
        chunks
            .filter(|(_, chunk)| chunk.iter().fold(0, |any, code| any | code.0) & DOUBTFUL != 0)
            .flat_map(|(at, chunk)| (TOGETHER * at..).zip(chunk))
            .filter_map(|(photon, code)| code.is_doubtful().then_some(photon))
    }

    /// Appends what is no photon until their number is a multiple of `multiple`.
    pub fn fill_up(&mut self, multiple: usize) {
        let missing = self.len.next_multiple_of(multiple) - self.len;
        let (codes, marks) = self.append(missing);
        codes.fill(Code::NONE);
        marks.fill(0);
    }

    /// Room for more of them, to be written.
    fn append(&mut self, more: usize) -> (&mut [Code], &mut [u32]) {
        let first = self.len;
        self.len += more;
        if self.len > self.codes.len() {
            self.codes.resize(2 * self.len, Code::NONE);
            self.marks.resize(2 * self.len, 0);
        }
        let new = first..self.len;
        (&mut self.codes[new.clone()], &mut self.marks[new])
    }
}

/// Which photons of a draw are wanted, and what for.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// Those of cycles before this one of the group.
    pub cycles: u32,
    /// By how many cycles their windows come after them.
    pub later: u32,
    /// When bin 0 begins, counted from the start of their own cycle, fs.
    pub origin_fs: i64,
}

impl Wanted {
    /// The code and mark of a photon by the place of its window, or none.
    #[inline(always)]
    pub fn code(&self, place: u32, code: impl Fn(u32) -> (Code, u32)) -> (Code, u32) {
        let (own, mark) = code(place + (self.later << SPAD_BITS));
        let is_wanted = place < self.cycles << SPAD_BITS;
        if is_wanted {
            (own, mark)
        } else {
            (Code::NONE, 0)
        }
    }
}

/// Bins of one window. Times are relative to the start of bin 0.
#[derive(Debug, Clone, Copy)]
pub struct Binning {
    bins: u32,
    /// CLK periods of a femtosecond.
    periods_per_fs: f64,
    /// Binary places of a position in slots.
    slot_bits: u32,
    /// Distance from an edge that leaves a position in doubt.
    doubt: u32,
}

impl Binning {
    /// For `bins` bins (1 to 64) of a CLK of at most 2 GHz with these slots, fewer than 2²⁴ to a period.
    pub fn new(bins: usize, clk_hz: f64, slots: Slots) -> Self {
        let periods_per_fs = clk_hz * 1e-15;
        let one = f64::from(FRACTION + 1);
        // Slots start and photons come at whole femtoseconds; a little more is for the arithmetic.
        let doubt_fs = (ROUNDING_FS + 3) as f64;
        Binning {
            bins: bins as u32,
            periods_per_fs,
            slot_bits: FRACTION_BITS - slots.per_period_bits(),
            doubt: (doubt_fs * periods_per_fs * one).ceil() as u32 + 3,
        }
    }

    /// Appends the codes of a draw, those of its background photons (by rows, as [`Draw::words`] has them) before those
    /// of its signal.
    pub fn encode(
        &self,
        light: &PixelStream<'_>,
        draw: &Draw,
        wanted: &Wanted,
        echo: Option<&EchoRows>,
        codes: &mut Codes,
    ) {
        let blocks = draw.slots().len();
        let shift = draw.group().place_shift();
        let (background, marks) = codes.append(PER_BLOCK * blocks);
        if blocks > 0 {
            let rows = background.chunks_exact_mut(blocks);
            let rows = rows.zip(marks.chunks_exact_mut(blocks));
            for (words, row) in draw.words().into_iter().zip(rows) {
                encode(self, wanted, shift, (words, draw.slots()), row);
            }
        }
        // What the last blocks of runs and of all have too much. Written always: no branch to mispredict.
        let mut keep_if = |is_photon: bool, at: usize| {
            background[at] = if is_photon {
                background[at]
            } else {
                Code::NONE
            };
            marks[at] = if is_photon { marks[at] } else { 0 };
        };
        for run in draw.runs().iter().filter(|run| run.photons > 0) {
            let (block, words) = run.last_block();
            for row in 1..PER_BLOCK {
                keep_if(row < words, row * blocks + block);
            }
        }
        for row in 0..PER_BLOCK {
            for block in draw.blocks()..blocks {
                keep_if(false, row * blocks + block);
            }
        }
        match echo {
            Some(rows) => {
                let mut passed = std::mem::take(&mut codes.passed);
                for words in draw.echo() {
                    let out = codes.append(words[0].len());
                    rows.encode(wanted, shift, words, &mut passed, out);
                }
                codes.passed = passed;
            }
            None => {
                for photon in 0..draw.echo_photons() {
                    let (place, time_fs) = light.signal_photon(draw, photon);
                    let is_drawn = draw.within_fs().contains(&time_fs);
                    self.push(wanted, is_drawn.then_some((place, time_fs)), codes);
                }
            }
        }
    }

    /// Appends the code of one photon, as place and time after the start of its cycle.
    pub fn push(&self, wanted: &Wanted, photon: Option<(Place, i64)>, codes: &mut Codes) {
        let (code, mark) = codes.append(1);
        (code[0], mark[0]) = match photon {
            Some((place, time_fs)) => {
                let position = self.position(time_fs - wanted.origin_fs);
                wanted.code(u32::from(place), |place| self.code(position, place))
            }
            None => (Code::NONE, 0),
        };
    }

    /// The code of one photon at `time_fs`.
    #[inline]
    pub fn encode_one(&self, time_fs: i64, place: Place) -> Code {
        self.code(self.position(time_fs), u32::from(place)).0
    }

    #[inline(always)]
    fn position(&self, time_fs: i64) -> u32 {
        let periods = time_fs as f64 * self.periods_per_fs;
        // Far outside, a position between two edges will do.
        let (first, last) = (-1.5, f64::from(self.bins) + 1.5);
        let periods = if periods > first { periods } else { first };
        let periods = if periods < last { periods } else { last };
        ((periods + f64::from(BIAS)) * f64::from(FRACTION + 1) + INTEGER).to_bits() as u32
    }

    #[inline(always)]
    fn code(&self, position: u32, place: u32) -> (Code, u32) {
        let is_doubtful = position.wrapping_add(self.doubt) & FRACTION < 2 * self.doubt;
        let row = (position >> FRACTION_BITS).clamp(BIAS - 1, BIAS + self.bins) - (BIAS - 1);
        Code::new(place, row, is_doubtful, self.bins)
    }

    /// What turns slots into positions: the first and the last slot to tell apart, and what is added.
    fn slot_positions(&self, origin_fs: i64) -> (u32, u32, u32) {
        let one = f64::from(FRACTION + 1);
        let origin = origin_fs as f64 * self.periods_per_fs;
        let per_period = f64::from(1u32 << (FRACTION_BITS - self.slot_bits));
        // Far outside, a slot between two edges will do.
        let slot = |periods: f64| (periods.floor() * per_period).max(0.0) as u32;
        let (first, last) = (
            slot(origin - 16.0),
            slot(origin + f64::from(self.bins) + 2.0),
        );
        let half_step = f64::from(1u32 << self.slot_bits) / f64::from(2u32 << TIME_BITS);
        let added = (f64::from(BIAS) - origin) * one + half_step;
        (first, last, added.round() as i64 as u32)
    }
}

#[multiversion(targets("x86_64+avx2", "x86_64+sse4.1"))]
fn encode(
    binning: &Binning,
    wanted: &Wanted,
    place_shift: u32,
    (words, slots): (&[u32], &[u32]),
    (codes, marks): (&mut [Code], &mut [u32]),
) {
    let (binning, wanted) = (*binning, *wanted);
    let (first, last, added) = binning.slot_positions(wanted.origin_fs);
    let out = codes.iter_mut().zip(marks);
    for ((&word, &slot), (code, mark)) in words.iter().zip(slots).zip(out) {
        let in_slot = word << (u32::BITS - TIME_BITS) >> (u32::BITS - binning.slot_bits);
        let slot = slot.max(first).min(last) << binning.slot_bits;
        let position = slot.wrapping_add(added).wrapping_add(in_slot);
        let own = |place| binning.code(position, place);
        (*code, *mark) = wanted.code(word >> place_shift, own);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::{Group, PhotonStream, SpadModel, StreamConfig};
    use crate::units::{Frequency, Time};
    use proptest::prelude::*;

    fn dark() -> StreamConfig {
        StreamConfig {
            seed: 1,
            clock: Frequency::from_hz(1),
            stop_periods: 1,
            laser_cycles: 1,
            pulse_sigma: Time::ZERO,
            pulse_shape: None,
            spads: SpadModel::default(),
        }
    }

    proptest! {
        /// Whatever is not in doubt is in the bin that whole numbers say.
        #[test]
        fn codes_are_those_of_whole_numbers(
            bins in 1usize..=64,
            hz in prop_oneof![80_000u64..2_000_000, 2_000_000u64..2_000_000_000],
            slot: u32,
            near in 0i64..65,
            off in -30i64..30,
            start in -2f64..70.0,
            word: u32,
            cycles in 1u32..=GROUP,
            later in 0u32..2,
            aimed: bool,
        ) {
            let clock = Frequency::from_hz(hz);
            let config = StreamConfig { clock, stop_periods: 600, ..dark() };
            let slots = PhotonStream::new(&config).slots();
            let slot = slot % slots.count();
            let binning = Binning::new(bins, hz as f64, slots);
            let time_fs = slots.time_fs(slot, word);
            let period_fs = 1e15 / hz as f64;
            // Half of the photons come close to an edge.
            let origin_fs = match aimed {
                true => time_fs - clock.periods(near).as_fs() - off,
                false => time_fs - (start * period_fs) as i64,
            };
            let periods = (time_fs - origin_fs) as f64 / period_fs;
            let row = (periods.floor() + 1.0).clamp(0.0, bins as f64 + 1.0) as usize;
            let off_edge_fs = (periods - periods.round()).abs() * period_fs;
            let wanted = Wanted { cycles, later, origin_fs };
            let group = Group::of_cycle(GROUP);
            let mut codes = [Code::NONE; 2];
            let mut marks = [0; 2];
            encode(&binning, &wanted, group.place_shift(), (&[word], &[slot]), (&mut codes[..1], &mut marks[..1]));
            let place = group.place(word);
            let mut one = Codes::default();
            binning.push(&wanted, Some((place, time_fs)), &mut one);
            (codes[1], marks[1]) = (one.codes()[0], one.marks()[0]);
            let place = u32::from(place);
            if place / 16 >= cycles {
                prop_assert_eq!(codes, [Code::NONE; 2]);
                return Ok(());
            }
            let place = place + 16 * later;
            for (code, mark) in codes.into_iter().zip(marks) {
                prop_assert_eq!(code.cycle() as u32, place / 16);
                prop_assert_eq!(u32::from(code.spad()), place % 16);
                prop_assert_eq!(mark & 0xFFFF, 1 << (place % 16));
                let is_in_bin = (1..=bins).contains(&code.row());
                prop_assert_eq!(mark >> 16, u32::from(is_in_bin) << (code.row() % 16));
                if code.is_doubtful() {
                    let resolution_fs = period_fs / 2f64.powi(22);
                    prop_assert!(off_edge_fs <= 10.0 + resolution_fs || !(1..=bins).contains(&row), "{off_edge_fs}");
                } else {
                    prop_assert_eq!(code.row(), row);
                    prop_assert!(off_edge_fs > ROUNDING_FS as f64 || row == 0 || row > bins);
                }
            }
        }
    }

    #[test]
    fn nobody_looks_at_what_is_no_photon() {
        assert_eq!(Code::NONE.cycle(), GROUP as usize);
        assert!(Code::NONE.row() > 64 + 1 && !Code::NONE.is_doubtful());
    }
}
