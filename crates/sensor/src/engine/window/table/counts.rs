//! What the bits of a row of a table add up to.
#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;

use super::{ROW, Table, WORD};
use crate::photon::PLACE_BITS;

impl Table {
    /// What the SPADs that fired in a row add up to, by what any number of them adds: hits, SPADs, and laser cycles with any.
    pub(in crate::engine::window) fn count(
        &mut self,
        row: usize,
        spad_bits: u32,
        words: usize,
        adds: &[i64],
    ) -> [i64; 3] {
        let words = &self.words[row * ROW..][..words];
        let (pulses, visited) = (ones(words), cycles_with_bits(words, spad_bits));
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

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn ones(words: &[u16]) -> i64 {
    const { assert!(1 << PLACE_BITS <= u16::MAX as usize) };
    let of_words = words.iter().map(|word| word.count_ones() as u16);
    i64::from(of_words.sum::<u16>())
}

/// Laser cycles of a row with any bit.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+popcnt"))]
fn cycles_with_bits(words: &[u16], spad_bits: u32) -> i64 {
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
