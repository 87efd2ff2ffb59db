//! Dead time in a table: which photons fire, may fire, or come while their SPAD is blind.
//!
//! Words are decided many abreast, row by row. Where a SPAD has one photon there is nothing to decide; the few words in which one has two
//! are gathered first.
#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;

use super::layout::Layout;
use super::{Abreast, ROW, TOGETHER};

#[inline(always)]
fn or(all: &mut Abreast, more: &Abreast) {
    for (all, more) in all.iter_mut().zip(more) {
        *all |= more;
    }
}

/// Decides which photons fire: only where a SPAD has two is there anything to decide.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn settle(
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
