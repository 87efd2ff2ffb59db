//! Pulses as words of a memory, for `$readmemh`: a word for each step of time, a bit for each SPAD.
//!
//! ```text
//!   word  0000    no SPAD of 16 in the first step
//!   word  0008    SPAD 3 rises in the second one, from w until 2w
//! ```
//!
//! Word k has the rising edges from k·w until (k + 1)·w after the first STOP edge, without an address: all words of the exposure
//! are there. Two pulses of a SPAD in one step are one bit.

use std::io::{self, Write};

use super::lines::PixelWriter;
use crate::photon::SpadEvent;
use crate::units::Time;

/// Words without a pulse that are written at once.
const BLOCK: u64 = 4096;

/// Words of an exposure.
pub(super) fn words(end: Time, step: Time) -> u64 {
    (end.as_fs() as u64).div_ceil(step.as_fs() as u64)
}

/// Bytes of each, with the end of its line.
pub(super) fn word_bytes(spads: usize) -> usize {
    spads.div_ceil(4) + 1
}

/// A memory.
pub(super) struct Memh<W> {
    out: W,
    step_fs: u64,
    words: u64,
    digits: usize,
    /// Number of the word that is being filled.
    now: u64,
    bits: u64,
    merged: u64,
    empty: Vec<u8>,
}

impl<W: Write> Memh<W> {
    /// For pulses of `spads` SPADs until `end`, in steps of time above 0.
    pub(super) fn new(out: W, spads: usize, end: Time, step: Time) -> Self {
        let digits = spads.div_ceil(4);
        let line = [&vec![b'0'; digits][..], b"\n"].concat();
        Memh {
            out,
            step_fs: step.as_fs() as u64,
            words: words(end, step),
            digits,
            now: 0,
            bits: 0,
            merged: 0,
            empty: line.repeat(BLOCK as usize),
        }
    }

    /// Writes all words before number `next`.
    fn advance(&mut self, next: u64) -> io::Result<()> {
        if next == self.now {
            return Ok(());
        }
        writeln!(self.out, "{:0digits$x}", self.bits, digits = self.digits)?;
        self.bits = 0;
        let mut left = next - self.now - 1;
        while left > 0 {
            let some = left.min(BLOCK);
            let bytes = some as usize * (self.digits + 1);
            self.out.write_all(&self.empty[..bytes])?;
            left -= some;
        }
        self.now = next;
        Ok(())
    }
}

impl<W: Write> PixelWriter for Memh<W> {
    fn write(&mut self, pulses: &[SpadEvent]) -> io::Result<()> {
        for pulse in pulses {
            self.advance(pulse.time.as_fs() as u64 / self.step_fs)?;
            let bit = 1 << pulse.spad;
            self.merged += u64::from(self.bits & bit != 0);
            self.bits |= bit;
        }
        Ok(())
    }

    fn finish(&mut self) -> io::Result<u64> {
        self.advance(self.words)?;
        self.out.flush()?;
        Ok(self.merged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn memory(pulses: &[(i64, u8)], spads: usize, end_ns: i64, step_ns: i64) -> (String, u64) {
        let (end, step) = (Time::from_ns(end_ns), Time::from_ns(step_ns));
        let mut memory = Memh::new(Vec::new(), spads, end, step);
        for &(time_fs, spad) in pulses {
            let pulse = SpadEvent::new(Time::from_fs(time_fs), spad);
            memory.write(&[pulse]).unwrap();
        }
        let merged = memory.finish().unwrap();
        assert_eq!(
            memory.out.len() as u64,
            words(end, step) * word_bytes(spads) as u64
        );
        (String::from_utf8(memory.out).unwrap(), merged)
    }

    #[test]
    fn a_bit_is_a_spad_and_a_word_a_step_of_time() {
        let pulses = [(0, 0), (1_999_999, 15), (2_000_000, 3), (9_000_000, 4)];
        let (text, merged) = memory(&pulses, 16, 10, 2);
        assert_eq!(text, "8001\n0008\n0000\n0000\n0010\n");
        assert_eq!(merged, 0);
        assert_eq!(memory(&[], 9, 5, 2).0, "000\n000\n000\n");
        assert_eq!(memory(&[(1, 0)], 1, 1, 1).0, "1\n");
        assert_eq!(memory(&[(1, 63)], 64, 1, 1).0, "8000000000000000\n");
    }

    #[test]
    fn pulses_of_a_spad_in_one_word_are_counted() {
        let (text, merged) = memory(&[(0, 1), (1, 1), (2, 0)], 2, 1, 1);
        assert_eq!((text.as_str(), merged), ("3\n", 1));
    }

    #[test]
    fn long_gaps_are_all_there() {
        let (text, _) = memory(&[(8_999_500_000, 2)], 4, 10_000, 1);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 10_000);
        let lit = lines.iter().enumerate().filter(|(_, word)| **word != "0");
        assert_eq!(lit.collect::<Vec<_>>(), [(8_999, &"4")]);
    }
}
