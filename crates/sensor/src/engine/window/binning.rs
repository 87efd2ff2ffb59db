//! From random words to histogram bins, many photons at a time.
//!
//! A background photon's bin is that of its slot. A single photon's place in the window is a number of CLK periods with
//! 24 binary places. Either decides, unless the photon comes within a few femtoseconds of an edge; such photons are
//! marked and settled exactly, one by one.
//!
//! ```text
//!   slot       │ 17 │ 18 │ 19 │ 20 │ 21 │ …            a slot is a bin, or a 2ᵏ-th of one
//!   row        │  0 │  0 │  1 │  2 │  3 │ …
//!   word       cycle, SPAD │ time in the slot: in doubt in its first and last steps only
//! ```

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;

use super::codes::{Code, Codes, SPAD_BITS, bin_mark, spad_mark};
use super::echo_rows::{EchoRows, PassedEdges};
use super::photon_selection::PhotonSelection;
use super::sight::ROUNDING_FS;
use crate::photon::{Draw, GroupPlace, PER_BLOCK, PixelStream, Slots, TIME_BITS};

/// Binary places of a position in CLK periods.
const FRACTION_BITS: u32 = 24;
const FRACTION: u32 = (1 << FRACTION_BITS) - 1;

/// Whole CLK periods added to positions, so that all that matter are above 0.
const BIAS: u32 = 32;

/// Slots that begin no farther from bins are bins, fs: three times are rounded to whole ones.
const ALIGNED_FS: i64 = 2;

/// Room for what is found out on the way.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    slot_codes: Vec<Code>,
    slot_marks: Vec<u32>,
    passed: PassedEdges,
}

/// Bins of one window. Times are relative to the start of bin 0.
#[derive(Debug, Clone, Copy)]
pub(super) struct Binning {
    bins: u32,
    slots: Slots,
    /// CLK periods of a femtosecond.
    periods_per_fs: f64,
    /// Distance from an edge that leaves a position in doubt.
    doubt: u32,
    /// Steps at the beginning and the end of a slot that an edge may come to.
    doubtful_steps: u32,
}

impl Binning {
    /// For `bins` bins (1 to 64) of a CLK of at most 2 GHz with these slots, fewer than 2²⁴ to a period.
    pub(super) fn new(bins: usize, clk_hz: f64, slots: Slots) -> Self {
        let periods_per_fs = clk_hz * 1e-15;
        let one = f64::from(FRACTION + 1);
        // Slots start and photons come at whole femtoseconds; a little more is for the arithmetic.
        let doubt_fs = (ROUNDING_FS + 3) as f64;
        let steps =
            (doubt_fs + ALIGNED_FS as f64) * f64::from(1 << TIME_BITS) / slots.length_fs() as f64;
        Binning {
            bins: bins as u32,
            slots,
            periods_per_fs,
            doubt: (doubt_fs * periods_per_fs * one).ceil() as u32 + 3,
            doubtful_steps: (steps + 0.5).floor() as u32,
        }
    }

    /// The slot that begins at `origin_fs`, the start of bin 0; `None` if none does, so that bins are not slots.
    pub(super) fn slot_of(&self, origin_fs: i64) -> Option<i32> {
        let length_fs = self.slots.length_s * 1e15;
        let slot = ((origin_fs + self.slots.lead_fs) as f64 / length_fs).round();
        let off_fs = (origin_fs + self.slots.lead_fs) as f64 - slot * length_fs;
        (off_fs.abs() <= ALIGNED_FS as f64).then_some(slot as i32)
    }

    /// The row of a slot.
    pub(super) fn row_of(&self, wanted: &PhotonSelection, slot: u32) -> usize {
        let k = self.slots.per_period_bits;
        row_of(slot, wanted.origin_slot, k, self.bins) as usize
    }

    /// Appends the codes of a draw, those of its background photons (by rows, as [`Draw::words`] has them) before those
    /// of its signal.
    pub(super) fn encode(
        &self,
        light: &PixelStream<'_>,
        draw: &Draw,
        wanted: &PhotonSelection,
        echo: Option<&EchoRows>,
        scratch: &mut Scratch,
        codes: &mut Codes,
    ) {
        let first = codes.len;
        let blocks = draw.slots().len();
        let shift = draw.group.place_shift();
        let (background, marks) = codes.append(PER_BLOCK * blocks);
        if blocks > 0 {
            let Scratch {
                slot_codes,
                slot_marks,
                ..
            } = scratch;
            slot_codes.resize(blocks, Code::NONE);
            slot_marks.resize(blocks, 0);
            encode_slots(self, wanted, draw.slots(), (slot_codes, slot_marks));
            let rows = background.chunks_exact_mut(blocks);
            let rows = rows.zip(marks.chunks_exact_mut(blocks));
            for (words, (codes, marks)) in draw.words().into_iter().zip(rows) {
                encode(shift, words, (slot_codes, slot_marks), (codes, marks));
                if self.doubtful_steps > 0 {
                    doubt(self.doubtful_steps, words, codes);
                }
            }
        }
        for run in draw.runs.iter().filter(|run| run.photons > 0) {
            keep_words(blocks, run.last_block(), background, marks);
        }
        for row in 0..PER_BLOCK {
            let filler = row * blocks + draw.blocks()..(row + 1) * blocks;
            background[filler.clone()].fill(Code::NONE);
            marks[filler].fill(0);
        }
        match echo {
            Some(rows) => {
                for (words, photons) in draw.echo().into_iter().zip(draw.echo_photons()) {
                    let (out, marks) = codes.append(words[0].len());
                    let passed = &mut scratch.passed;
                    rows.encode(wanted, shift, words, passed, (&mut *out, &mut *marks));
                    out[photons..].fill(Code::NONE);
                    marks[photons..].fill(0);
                }
            }
            None => {
                let half = draw.half_an_echo();
                for (first, photons) in [0, half].into_iter().zip(draw.echo_photons()) {
                    for number in first..first + half {
                        let photon = (number < first + photons)
                            .then(|| light.signal_photon(draw, number))
                            .filter(|(_, time_fs)| draw.within_fs().contains(time_fs));
                        self.push(wanted, photon, codes);
                    }
                }
            }
        }
        if wanted.cycles < draw.group.cycles() {
            codes.drop_from(first, wanted.place(wanted.cycles << SPAD_BITS));
        }
    }

    /// Appends the code of one photon, as place and time after the start of its cycle.
    pub(super) fn push(
        &self,
        wanted: &PhotonSelection,
        photon: Option<(GroupPlace, i64)>,
        codes: &mut Codes,
    ) {
        let (code, mark) = codes.append(1);
        (code[0], mark[0]) = match photon {
            Some((place, time_fs)) => {
                let place = wanted.place(u32::from(place));
                self.code(time_fs - wanted.origin_fs, place)
            }
            None => (Code::NONE, 0),
        };
    }

    #[inline]
    fn code(&self, time_fs: i64, place: u32) -> (Code, u32) {
        let periods = time_fs as f64 * self.periods_per_fs;
        // Far outside, a position between two edges will do.
        let periods = periods.clamp(-1.5, f64::from(self.bins) + 1.5);
        let position = ((periods + f64::from(BIAS)) * f64::from(FRACTION + 1)).round() as u32;
        let is_doubtful = position.wrapping_add(self.doubt) & FRACTION < 2 * self.doubt;
        let row = (position >> FRACTION_BITS).clamp(BIAS - 1, BIAS + self.bins) - (BIAS - 1);
        Code::new(place, row, is_doubtful, self.bins)
    }
}

/// Makes none of what the last block of a run has too much, by rows of `blocks`. Something is written for every word but
/// the first, perhaps the last one again: no branch to mispredict.
#[inline]
fn keep_words(
    blocks: usize,
    (block, words): (usize, usize),
    codes: &mut [Code],
    marks: &mut [u32],
) {
    let last = (PER_BLOCK - 1) * blocks + block;
    let (code, mark) = if words < PER_BLOCK {
        (Code::NONE, 0)
    } else {
        (codes[last], marks[last])
    };
    (codes[last], marks[last]) = (code, mark);
    for row in 1..PER_BLOCK - 1 {
        let at = if row < words {
            last
        } else {
            row * blocks + block
        };
        (codes[at], marks[at]) = (code, mark);
    }
}

/// The row of a slot, 2ᵏ to a bin.
#[inline(always)]
fn row_of(slot: u32, origin_slot: i32, k: u32, bins: u32) -> u32 {
    (((slot as i32 - origin_slot) >> k) + 1).clamp(0, bins as i32 + 1) as u32
}

/// The codes and marks of a photon in each slot, but for its place.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn encode_slots(
    binning: &Binning,
    wanted: &PhotonSelection,
    slots: &[u32],
    out: (&mut [Code], &mut [u32]),
) {
    let (bins, k) = (binning.bins, binning.slots.per_period_bits);
    let (origin_slot, later) = (wanted.origin_slot, wanted.place(0));
    for ((&slot, code), mark) in slots.iter().zip(out.0).zip(out.1) {
        let row = row_of(slot, origin_slot, k, bins);
        (*code, _) = Code::new(later, row, false, bins);
        *mark = bin_mark(row, bins);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn encode(
    place_shift: u32,
    words: &[u32],
    (slot_codes, slot_marks): (&[Code], &[u32]),
    (codes, marks): (&mut [Code], &mut [u32]),
) {
    let slots = slot_codes.iter().zip(slot_marks);
    for (((&word, (in_slot, in_bin)), code), mark) in words.iter().zip(slots).zip(codes).zip(marks)
    {
        let place = word >> place_shift;
        *code = in_slot.moved_by(place);
        *mark = spad_mark(place) | in_bin;
    }
}

/// Marks photons that come in the first or last steps of their slot.
fn doubt(steps: u32, words: &[u32], codes: &mut [Code]) {
    for (&word, code) in words.iter().zip(codes) {
        let step = word % (1 << TIME_BITS);
        let is_doubtful = (step + steps) % (1 << TIME_BITS) < 2 * steps;
        *code = code.doubtful_if(is_doubtful);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::SpadGrid;
    use crate::photon::{CycleGroup, GROUP, PhotonStream, SpadModel, StreamConfig};
    use crate::units::{Frequency, Time};
    use proptest::prelude::*;

    fn slots(clock: Frequency, lead: Time) -> Slots {
        let config = StreamConfig {
            seed: 1,
            clock,
            stop_periods: 600,
            laser_cycles: 1,
            lead,
            pulse_sigma: Time::ZERO,
            pulse_shape: None,
            energy_spread: 0.0,
            spads: SpadModel::default(),
        };
        PhotonStream::new(&config).slots
    }

    proptest! {
        /// Whatever is not in doubt is in the bin that whole numbers say.
        #[test]
        fn codes_are_those_of_whole_numbers(
            bins in 1usize..=64,
            hz in prop_oneof![80_000u64..2_000_000, 2_000_000u64..2_000_000_000],
            lead in 0f64..1.0,
            slot: u32,
            start in -2i64..70,
            off in -1i64..=0,
            steps in prop_oneof![0u32..4, (1u32 << TIME_BITS) - 4..1 << TIME_BITS, any::<u32>()],
            place: u32,
            cycles in 1u32..=GROUP,
            later in 0u32..2,
        ) {
            let clock = Frequency::from_hz(hz);
            let period_fs = 1e15 / hz as f64;
            let slots = slots(clock, Time::from_fs((lead * period_fs) as i64));
            let slot = slot % slots.count;
            let binning = Binning::new(bins, hz as f64, slots);
            let word = place << TIME_BITS | steps;
            let time_fs = slots.time_fs(slot, word);
            // Bins begin where slots of the same CLK period do, but for rounding.
            let in_period = slot % (1 << slots.per_period_bits);
            let origin_fs = slots.start_fs(slot - in_period) - clock.periods(start).as_fs() - off;
            let origin_slot = binning.slot_of(origin_fs).unwrap();
            let periods = (time_fs - origin_fs) as f64 / period_fs;
            let row = (periods.floor() + 1.0).clamp(0.0, bins as f64 + 1.0) as usize;
            let off_edge_fs = (periods - periods.round()).abs() * period_fs;
            let wanted = PhotonSelection { cycles, later, origin_fs, origin_slot };
            let group = CycleGroup::of_cycle(GROUP, SpadGrid::default());
            let mut codes = Codes::default();
            let mut in_slot = (vec![Code::NONE], vec![0]);
            encode_slots(&binning, &wanted, &[slot], (&mut in_slot.0, &mut in_slot.1));
            let (out, marks) = codes.append(1);
            encode(group.place_shift(), &[word], (&in_slot.0, &in_slot.1), (&mut out[..], marks));
            doubt(binning.doubtful_steps, &[word], out);
            let place = group.place(word);
            binning.push(&wanted, Some((place, time_fs)), &mut codes);
            codes.drop_from(0, wanted.place(cycles << SPAD_BITS));
            let place = u32::from(place);
            if place / 16 >= cycles {
                prop_assert_eq!(codes.codes(), [Code::NONE; 2]);
                prop_assert_eq!(codes.marks(), [0; 2]);
                return Ok(());
            }
            let place = place + 16 * later;
            for (code, mark) in codes.codes().iter().zip(codes.marks()) {
                prop_assert_eq!(code.cycle() as u32, place / 16);
                prop_assert_eq!(u32::from(code.spad()), place % 16);
                prop_assert_eq!(mark & 0xFFFF, 1 << (place % 16));
                let is_in_bin = (1..=bins).contains(&code.row());
                prop_assert_eq!(mark >> 16, u32::from(is_in_bin) << (code.row() % 16));
                if code.is_doubtful() {
                    let resolution_fs = period_fs / 2f64.powi(22);
                    let is_part = slots.per_period_bits > 0;
                    prop_assert!(is_part || off_edge_fs <= 12.0 + resolution_fs || !(1..=bins).contains(&row), "{off_edge_fs}");
                } else {
                    prop_assert_eq!(code.row(), row);
                    prop_assert!(off_edge_fs > ROUNDING_FS as f64 || row == 0 || row > bins);
                }
            }
        }
    }

    #[test]
    fn slots_elsewhere_are_no_bins() {
        let clock = Frequency::from_hz(384_000_000);
        let binning = Binning::new(16, 384e6, slots(clock, Time::from_ps(300)));
        let begins_fs = |slot: i64| clock.periods(slot).as_fs() - 300_000;
        assert_eq!(binning.slot_of(begins_fs(5)), Some(5));
        assert_eq!(binning.slot_of(begins_fs(-7) + 1), Some(-7));
        assert_eq!(binning.slot_of(begins_fs(5) + 20), None);
    }
}
