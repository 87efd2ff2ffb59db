//! A table of bits: which SPADs have a photon, by time and laser cycle, and what the dead time leaves of them.
//!
//! ```text
//!               words: laser cycle and SPAD, 16 bits each (one laser cycle of 16 SPADs, four of 4 SPADs, a quarter of one of 64)
//!   row 0       no photon of these: before the table
//!   row 1 …     the SPADs' memory before the window    ╮ certain to fire ─► stays
//!   …           bins of the window                     ╯ may fire        ─► `doubt`, for who knows exact times
//!   last row    no photon of these: after the window
//! ```
//!
//! All bits of a word are decided at once, many words abreast, from the first row to the last. Of two photons of a SPAD, their
//! rows tell whether the earlier one blinds the later one for certain, perhaps, or not at all.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;

use super::sight::ROUNDING_FS;
use crate::photon::{DeadTimeLaw, PER_BLOCK, PLACE_BITS, SpadModel};

/// Bits of a word.
pub(super) const WORD: u32 = u16::BITS;

/// Words of a row: those of the longest group and of the cycle after it. Rows 4096 bytes apart would share sets of the cache.
pub(super) const ROW: usize = (1 << PLACE_BITS) / WORD as usize + TOGETHER;

/// Words that are decided together.
const TOGETHER: usize = 32;

/// Most rows before the window. A longer memory has longer rows.
const MOST_BEFORE: usize = 16;

/// Rows of two laser cycles differ by less, fs.
const SLACK_FS: i64 = 4 * ROUNDING_FS;

/// What the rows are, and what a photon in one does to a later one of its SPAD.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    /// Where rows begin, and the last one ends, after the start of the window's cycle, within [`ROUNDING_FS`].
    pub edges_fs: Vec<i64>,
    /// Rows before the window.
    pub before: usize,
    /// By row: the first one whose photons blind it for certain, and the first one whose photons may.
    reach: Vec<[usize; 2]>,
    /// So many rows what came before the table may blind.
    open: usize,
    /// Whether a SPAD may fire twice in a row.
    pub fires_twice: bool,
    is_paralysable: bool,
    /// Lengths of rows before the window and in it, inverse.
    per_fs: [f64; 2],
}

impl Layout {
    /// Of a window whose bins have these edges; photons are known from `from_fs` on.
    pub(super) fn new(bins_fs: &[i64], from_fs: i64, spads: &SpadModel) -> Self {
        let (first_fs, bins) = (bins_fs[0], bins_fs.len() - 1);
        let bin_fs = (bins_fs[bins] - first_fs) / bins as i64;
        let memory_fs = (first_fs - from_fs).max(1);
        let before = (memory_fs as u64).div_ceil(bin_fs as u64) as usize;
        let row_fs = match before > MOST_BEFORE {
            true => (memory_fs as u64).div_ceil(MOST_BEFORE as u64) as i64,
            false => bin_fs,
        };
        let before = before.min(MOST_BEFORE);
        let earlier = (1..=before as i64).rev().map(|row| first_fs - row * row_fs);
        let edges_fs: Vec<i64> = earlier.chain(bins_fs.iter().copied()).collect();
        let rows = edges_fs.len() - 1;
        let dead_fs = spads.dead_time.as_fs();
        let blinds =
            |from: usize, row: usize| edges_fs[row + 1] - edges_fs[from] + SLACK_FS <= dead_fs;
        let may_blind =
            |from: usize, row: usize| edges_fs[row] - edges_fs[from + 1] - SLACK_FS <= dead_fs;
        // Both rise with the row.
        let (mut blind, mut may) = (0, 0);
        let mut reach = Vec::with_capacity(rows);
        for row in 0..rows {
            while blind < row && !blinds(blind, row) {
                blind += 1;
            }
            while may < row && !may_blind(may, row) {
                may += 1;
            }
            reach.push([blind, may]);
        }
        Layout {
            before,
            reach,
            open: (0..rows)
                .take_while(|&row| edges_fs[row] - SLACK_FS <= from_fs + dead_fs)
                .count(),
            fires_twice: !(0..rows).all(|row| blinds(row, row)),
            is_paralysable: spads.law == DeadTimeLaw::Paralysable,
            per_fs: [row_fs, bin_fs].map(|length_fs| 1.0 / length_fs as f64),
            edges_fs,
        }
    }

    /// How many rows there are.
    pub(super) fn rows(&self) -> usize {
        self.reach.len()
    }

    /// How many edges come before a time: its row in the table. `None` where it may be on either side of one.
    #[inline]
    pub(super) fn row_of(&self, time_fs: i64) -> Option<usize> {
        let (edges_fs, before) = (&self.edges_fs, self.before);
        let since_fs = (time_fs - edges_fs[before]) as f64;
        let length = self.per_fs[usize::from(since_fs >= 0.0)];
        let guess = (since_fs * length + before as f64) as i64;
        let guess = guess.clamp(0, self.rows() as i64) as usize;
        // Bins differ by a femtosecond or two, which moves a time into a neighbour.
        let mut row = guess;
        while row > 0 && time_fs < edges_fs[row] {
            row -= 1;
        }
        while row < self.rows() && time_fs >= edges_fs[row + 1] {
            row += 1;
        }
        if time_fs < edges_fs[0] {
            return Some(0);
        }
        let is_near = |edge: usize| {
            let edge_fs = edges_fs.get(edge);
            edge_fs.is_some_and(|edge_fs| (edge_fs - time_fs).abs() <= ROUNDING_FS)
        };
        let is_certain = !is_near(row) && !is_near(row + 1);
        is_certain.then_some(row + 1)
    }
}

/// Photons of a group of laser cycles.
#[derive(Debug, Default)]
pub(super) struct Table {
    /// By rows.
    words: Vec<u16>,
    /// Photons of these are to be settled by their times, and have no bit in bins.
    pub doubt: Vec<u16>,
    /// Room for words that are decided together, by row, and for what blinds in them: for certain, and perhaps.
    abreast: Vec<Abreast>,
    blinders: Vec<[Abreast; 2]>,
    /// SPADs by laser cycle.
    numbers: Vec<u16>,
}

impl Table {
    /// Forgets all photons.
    pub(super) fn clear(&mut self, layout: &Layout, words: usize) {
        let rows = layout.rows() + 2;
        self.words.resize(self.words.len().max(rows * ROW), 0);
        for row in self.words.chunks_exact_mut(ROW).take(rows) {
            row[..words + TOGETHER].fill(0);
        }
        self.doubt.clear();
        self.doubt.resize(ROW, 0);
    }

    /// Forgets the photons at this place and later ones.
    pub(super) fn cut(&mut self, layout: &Layout, end: u32) {
        let (word, kept) = ((end / WORD) as usize, (1u16 << (end % WORD)) - 1);
        self.doubt[word] &= kept;
        self.doubt[word + 1..].fill(0);
        for row in self.words.chunks_exact_mut(ROW).take(layout.rows() + 2) {
            row[word] &= kept;
            let later = word + 1..ROW.min(word + TOGETHER);
            row[later].fill(0);
        }
    }

    /// Puts a photon.
    #[inline]
    pub(super) fn put(&mut self, row: usize, place: u32) {
        let (at, bit) = ((place / WORD) as usize, 1 << (place % WORD));
        let word = &mut self.words[row * ROW + at];
        self.doubt[at] |= *word & bit;
        *word |= bit;
    }

    /// Puts photons of one row, whose random words are these. Returns how many are in windows.
    pub(super) fn put_words(
        &mut self,
        row: usize,
        is_twice: bool,
        place: Places,
        words: [&[u32]; PER_BLOCK],
    ) -> u64 {
        let row = &mut self.words[row * ROW..][..ROW];
        let doubt = &mut self.doubt[..];
        match is_twice {
            true => put_words::<true>(row, doubt, place, words),
            false => put_words::<false>(row, doubt, place, words),
        }
    }

    /// Puts photons of several rows. Those of which a row is not known go to row 0, and their numbers into `unknown`.
    pub(super) fn put_rows(
        &mut self,
        is_twice: bool,
        place: Places,
        words: &[u32],
        rows: [&[i16]; 2],
        unknown: &mut Vec<u32>,
    ) {
        let (table, doubt) = (&mut self.words[..], &mut self.doubt[..]);
        match is_twice {
            true => put_rows::<true>(table, doubt, place, words, rows, unknown),
            false => put_rows::<false>(table, doubt, place, words, rows, unknown),
        }
    }

    /// Decides which photons fire. Returns whether any is in doubt.
    pub(super) fn settle(&mut self, layout: &Layout, words: usize) -> bool {
        self.abreast.resize(layout.rows(), [0; TOGETHER]);
        self.blinders.resize(layout.rows(), [[0; TOGETHER]; 2]);
        let room = (&mut self.abreast[..], &mut self.blinders[..]);
        settle(layout, &mut self.words, &mut self.doubt, room, words)
    }

    /// Takes the laser cycle of every photon in doubt out of the bins, to be settled as a whole.
    pub(super) fn doubt_cycles(&mut self, layout: &Layout, spad_bits: u32, words: usize) {
        let doubt = &mut self.doubt[..words];
        match WORD.ilog2().checked_sub(spad_bits) {
            Some(in_word) => {
                let spads = u16::MAX >> (WORD - (1 << spad_bits));
                for word in &mut *doubt {
                    let cycles = (0..1 << in_word).map(|cycle| spads << (cycle << spad_bits));
                    *word = cycles.filter(|cycle| *word & cycle != 0).sum();
                }
            }
            None => {
                for cycle in doubt.chunks_exact_mut((1 << spad_bits) / WORD as usize) {
                    let is_in_doubt = cycle.iter().any(|word| *word != 0);
                    cycle.fill(if is_in_doubt { u16::MAX } else { 0 });
                }
            }
        }
        for (at, &doubt) in self.doubt[..words].iter().enumerate() {
            if doubt != 0 {
                let column = self.words[at..].iter_mut().step_by(ROW);
                column
                    .take(layout.rows() + 1)
                    .for_each(|word| *word &= !doubt);
            }
        }
    }

    /// Has the photons at a place settled by their times.
    pub(super) fn doubt_place(&mut self, place: u32) {
        self.doubt[(place / WORD) as usize] |= 1 << (place % WORD);
    }

    /// Notes that the photon at a place fires, or that one which fired is cancelled.
    pub(super) fn toggle(&mut self, row: usize, place: u32) {
        self.words[row * ROW + (place / WORD) as usize] ^= 1 << (place % WORD);
    }

    /// What the SPADs that fired in a row add up to, by what any number of them adds: hits, SPADs, and laser cycles with any.
    pub(super) fn count(
        &mut self,
        row: usize,
        spad_bits: u32,
        words: usize,
        adds: &[i64],
    ) -> [i64; 3] {
        let words = &self.words[row * ROW..][..words];
        let (pulses, visited) = (ones(words), lit(words, spad_bits));
        let step = |spads: usize| adds[spads] - adds[spads - 1];
        // Mostly only the first of them makes a difference, or each the same.
        let last = adds.len() - 1;
        let usual = step(last);
        let mut hits = usual * pulses + (step(1) - usual) * visited;
        self.numbers.clear();
        for spads in (2..last).filter(|&spads| step(spads) != usual) {
            if self.numbers.is_empty() {
                count_spads(words, spad_bits, &mut self.numbers);
            }
            let with_least = count_from(&self.numbers, spads as u16);
            hits += (step(spads) - usual) * with_least;
        }
        [hits, pulses, visited]
    }
}

/// Where photons go by their random words.
#[derive(Debug, Clone, Copy)]
pub(super) struct Places {
    /// By how much a word is shifted.
    pub shift: u32,
    /// What is added: the SPADs of a laser cycle, for windows of the next one.
    pub later: u32,
    /// Places from here on are of no window.
    pub end: u32,
}

impl Places {
    #[inline(always)]
    pub(super) fn of(self, word: u32) -> u32 {
        (word >> self.shift) + self.later
    }
}

#[multiversion(targets("x86_64+avx2+bmi1+bmi2"))]
fn put_words<const TWICE: bool>(
    row: &mut [u16],
    doubt: &mut [u16],
    place: Places,
    words: [&[u32]; PER_BLOCK],
) -> u64 {
    let mut seen = 0;
    for &word in words.into_iter().flatten() {
        let of_word = place.of(word);
        let (at, bit) = ((of_word / WORD) as usize, 1 << (of_word % WORD));
        let word = &mut row[at];
        if TWICE {
            doubt[at] |= *word & bit;
        }
        *word |= bit;
        seen += u64::from(of_word < place.end);
    }
    seen
}

#[multiversion(targets("x86_64+avx2+bmi1+bmi2"))]
fn put_rows<const TWICE: bool>(
    table: &mut [u16],
    doubt: &mut [u16],
    place: Places,
    words: &[u32],
    [rows, possible]: [&[i16]; 2],
    unknown: &mut Vec<u32>,
) {
    let rows = rows.iter().zip(possible);
    for ((number, &word), (&row, &possible)) in (0..).zip(words).zip(rows) {
        let place = place.of(word);
        let (at, bit) = ((place / WORD) as usize, 1 << (place % WORD));
        if row != possible {
            unknown.push(number);
            continue;
        }
        let word = &mut table[row as usize * ROW + at];
        if TWICE {
            doubt[at] |= *word & bit;
        }
        *word |= bit;
    }
}

type Abreast = [u16; TOGETHER];

#[inline(always)]
fn or(all: &mut Abreast, more: &Abreast) {
    for (all, more) in all.iter_mut().zip(more) {
        *all |= more;
    }
}

/// Decides which photons fire: only where a SPAD has two is there anything to decide.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn settle(
    layout: &Layout,
    words: &mut [u16],
    doubt: &mut [u16],
    (columns, blinders): (&mut [Abreast], &mut [[Abreast; 2]]),
    len: usize,
) -> bool {
    let rows = layout.rows();
    let mut doubtful = 0;
    let mut few: smallvec::SmallVec<[usize; 2 * TOGETHER]> = smallvec::SmallVec::new();
    for first in (0..len).step_by(TOGETHER) {
        let chunk = |row: usize| (row + 1) * ROW + first..(row + 1) * ROW + first + TOGETHER;
        let (mut once, mut twice): (Abreast, Abreast) = ([0; TOGETHER], [0; TOGETHER]);
        for row in 0..rows {
            let here: &Abreast = words[chunk(row)].try_into().expect("as many");
            for lane in 0..TOGETHER {
                twice[lane] |= once[lane] & here[lane];
                once[lane] |= here[lane];
            }
        }
        or(
            &mut twice,
            doubt[first..first + TOGETHER].try_into().expect("as many"),
        );
        if layout.open > layout.before {
            twice = once;
        }
        let many = twice.iter().map(|&word| u16::from(word != 0)).sum::<u16>();
        if usize::from(many) > TOGETHER / 4 {
            for row in 0..rows {
                columns[row].copy_from_slice(&words[chunk(row)]);
            }
            let doubts = &mut doubt[first..first + TOGETHER];
            let doubts: &mut Abreast = doubts.try_into().expect("as many");
            doubtful |= settle_columns(layout, columns, blinders, doubts);
            for row in layout.before..rows {
                words[chunk(row)].copy_from_slice(&columns[row]);
            }
        } else if many > 0 {
            for (lane, &word) in twice.iter().enumerate() {
                if word != 0 {
                    few.push(first + lane);
                }
            }
            if few.len() >= TOGETHER {
                doubtful |= settle_few(layout, [words, doubt], columns, blinders, &few[..TOGETHER]);
                few.drain(..TOGETHER);
            }
        }
    }
    doubtful | settle_few(layout, [words, doubt], columns, blinders, &few) != 0
}

/// The same for a few columns, at most [`TOGETHER`].
#[inline(always)]
fn settle_few(
    layout: &Layout,
    [words, doubt]: [&mut [u16]; 2],
    columns: &mut [Abreast],
    blinders: &mut [[Abreast; 2]],
    few: &[usize],
) -> u16 {
    if few.is_empty() {
        return 0;
    }
    let mut doubts = [0; TOGETHER];
    for (lane, &at) in few.iter().enumerate() {
        doubts[lane] = doubt[at];
        for (row, column) in columns.iter_mut().enumerate() {
            column[lane] = words[(row + 1) * ROW + at];
        }
    }
    for column in &mut *columns {
        column[few.len()..].fill(0);
    }
    let doubtful = settle_columns(layout, columns, blinders, &mut doubts);
    for (lane, &at) in few.iter().enumerate() {
        doubt[at] = doubts[lane];
        for row in layout.before..columns.len() {
            words[(row + 1) * ROW + at] = columns[row][lane];
        }
    }
    doubtful
}

/// The same for columns of all rows. Returns what is in doubt in any of them. `blinders` has room for what blinds for certain, and
/// what may.
#[inline(always)]
fn settle_columns(
    layout: &Layout,
    columns: &mut [Abreast],
    blinders: &mut [[Abreast; 2]],
    doubt: &mut Abreast,
) -> u16 {
    for (row, &[blind_from, may_from]) in layout.reach.iter().enumerate() {
        let photons = columns[row];
        let mut blind: Abreast = [0; TOGETHER];
        for [before, _] in &blinders[blind_from..row] {
            or(&mut blind, before);
        }
        let mut perhaps: Abreast = [if row < layout.open { u16::MAX } else { 0 }; TOGETHER];
        for [_, before] in &blinders[may_from..row] {
            or(&mut perhaps, before);
        }
        let is_seen = if row >= layout.before { u16::MAX } else { 0 };
        let paralyses = if layout.is_paralysable { u16::MAX } else { 0 };
        let (mut fires, mut may): (Abreast, Abreast) = (photons, photons);
        for lane in 0..TOGETHER {
            may[lane] = photons[lane] & !blind[lane];
            fires[lane] = may[lane] & !perhaps[lane];
            doubt[lane] |= may[lane] & perhaps[lane] & is_seen;
        }
        columns[row] = fires;
        for lane in 0..TOGETHER {
            fires[lane] |= photons[lane] & paralyses;
            may[lane] |= photons[lane] & paralyses;
        }
        blinders[row] = [fires, may];
    }
    let any = doubt.iter().fold(0, |any, word| any | word);
    if any != 0 {
        for column in &mut columns[layout.before..] {
            for (word, doubt) in column.iter_mut().zip(&*doubt) {
                *word &= !doubt;
            }
        }
    }
    any
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn ones(words: &[u16]) -> i64 {
    const { assert!(1 << PLACE_BITS <= u16::MAX as usize) };
    let of_words = words.iter().map(|word| word.count_ones() as u16);
    i64::from(of_words.sum::<u16>())
}

/// Laser cycles of a row with any bit.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+popcnt"))]
fn lit(words: &[u16], spad_bits: u32) -> i64 {
    if spad_bits == WORD.ilog2() {
        return i64::from(words.iter().map(|&word| u16::from(word != 0)).sum::<u16>());
    }
    if spad_bits > WORD.ilog2() {
        let cycles = words.chunks_exact((1 << spad_bits) / WORD as usize);
        let is_lit = |cycle: &&[u16]| cycle.iter().any(|&word| word != 0);
        return cycles.filter(is_lit).count() as i64;
    }
    // The first bit of every laser cycle.
    let firsts = u16::MAX / ((1 << (1 << spad_bits)) - 1);
    let of_word = |&word: &u16| {
        let any = (0..spad_bits).fold(word, |any, bit| any | any >> (1 << bit));
        (any & firsts).count_ones()
    };
    i64::from(words.iter().map(of_word).sum::<u32>())
}

/// How many SPADs fired in each laser cycle of a row.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn count_spads(words: &[u16], spad_bits: u32, numbers: &mut Vec<u16>) {
    let in_word = WORD >> spad_bits;
    if in_word == 1 {
        numbers.extend(words.iter().map(|word| word.count_ones() as u16));
        return;
    }
    if in_word == 0 {
        let cycles = words.chunks_exact((1 << spad_bits) / WORD as usize);
        let ones = |cycle: &[u16]| cycle.iter().map(|word| word.count_ones() as u16).sum();
        numbers.extend(cycles.map(|cycle| -> u16 { ones(cycle) }));
        return;
    }
    let spads = u16::MAX >> (WORD - (1 << spad_bits));
    for word in words {
        let cycles = (0..in_word).map(|cycle| word >> (cycle << spad_bits) & spads);
        numbers.extend(cycles.map(|cycle| cycle.count_ones() as u16));
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn count_from(numbers: &[u16], least: u16) -> i64 {
    let have = numbers.iter().map(|&number| u16::from(number >= least));
    i64::from(have.sum::<u16>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Time;
    use proptest::prelude::*;

    /// When a SPAD fires, photon by photon.
    fn fires(mut times_fs: Vec<i64>, dead_fs: i64, law: DeadTimeLaw) -> Vec<i64> {
        times_fs.sort_unstable();
        let mut ready_fs = i64::MIN;
        let mut fires = Vec::new();
        for time_fs in times_fs {
            let is_ready = time_fs > ready_fs;
            if is_ready {
                fires.push(time_fs);
            }
            if is_ready || law == DeadTimeLaw::Paralysable {
                ready_fs = time_fs + dead_fs;
            }
        }
        fires
    }

    proptest! {
        /// Whatever came before the table, and however many SPADs there are.
        #[test]
        fn what_is_not_in_doubt_is_what_times_give(
            bins in 1i64..20,
            bin_fs in 2_000_000i64..4_000_000,
            dead_fs in prop_oneof![Just(0i64), 1i64..4_000_000, 4_000_000i64..120_000_000],
            room_fs in 0i64..4_000_000,
            is_paralysable: bool,
            spad_bits in 0u32..=6,
            threshold in 0usize..4,
            photons in prop::collection::vec((0u32..128, 0f64..1.0), 0..200),
        ) {
            let law = if is_paralysable { DeadTimeLaw::Paralysable } else { DeadTimeLaw::NonParalysable };
            let spads = SpadModel { law, ..SpadModel::with_dead_time(Time::from_fs(dead_fs)) };
            let edges_fs: Vec<i64> = (0..=bins).map(|bin| bin * bin_fs).collect();
            let from_fs = -dead_fs - ROUNDING_FS - room_fs;
            let layout = Layout::new(&edges_fs, from_fs, &spads);
            let (begin_fs, end_fs) = (3 * from_fs, bins * bin_fs + bin_fs);
            let time = |at: f64| begin_fs + (at * (end_fs - begin_fs) as f64) as i64;
            let photons: Vec<(u32, i64)> = photons.into_iter().map(|(place, at)| (place, time(at))).collect();
            let mut table = Table::default();
            let words = (128 / WORD) as usize;
            table.clear(&layout, words);
            let row = |time_fs: i64| layout.edges_fs.partition_point(|&edge_fs| edge_fs <= time_fs);
            for &(place, time_fs) in photons.iter().filter(|&&(_, time_fs)| time_fs >= from_fs) {
                prop_assert!(layout.row_of(time_fs).is_none_or(|found| found == row(time_fs)));
                table.put(row(time_fs), place);
            }
            table.settle(&layout, words);
            let in_doubt = |table: &Table, place: u32| table.doubt[(place / WORD) as usize] >> (place % WORD) & 1 != 0;
            let mut expected = vec![vec![0usize; 128 >> spad_bits]; bins as usize];
            for place in 0..128 {
                let of_place = photons.iter().filter(|photon| photon.0 == place);
                let times_fs: Vec<i64> = of_place.map(|photon| photon.1).collect();
                let rows: Vec<usize> = fires(times_fs, dead_fs, law).into_iter().map(row).collect();
                let once = rows.iter().filter(|row| rows.iter().filter(|other| other == row).count() % 2 == 1);
                let mut fired: Vec<usize> = once.copied().collect();
                fired.dedup();
                fired.retain(|&row| row > layout.before && row <= layout.rows());
                if in_doubt(&table, place) {
                    fired.iter().for_each(|&row| table.toggle(row, place));
                }
                for &row in &fired {
                    expected[row - layout.before - 1][(place >> spad_bits) as usize] += 1;
                }
            }
            let adds: Vec<i64> = (0..=1 << spad_bits).map(|spads| i64::from(spads > threshold)).collect();
            for (bin, cycles) in expected.into_iter().enumerate() {
                let counts = table.count(layout.before + 1 + bin, spad_bits, words, &adds);
                let hits = cycles.iter().filter(|&&spads| spads > threshold).count() as i64;
                let pulses = cycles.iter().sum::<usize>() as i64;
                let lit = cycles.iter().filter(|&&spads| spads > 0).count() as i64;
                prop_assert_eq!(counts, [hits, pulses, lit]);
            }
        }
    }
}
