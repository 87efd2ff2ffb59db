//! The text of a value change dump, written fast: a line is a few copies of a fixed length, and of a time only those digits are converted
//! that differ from the time before.

use crate::units::Time;

/// Bytes collected before they are handed to the underlying writer.
pub(super) const BLOCK: usize = 1 << 16;

/// Text that is collected before it is written.
///
/// Its bytes are there before they are used, so that a line is a few copies of a fixed length: half the time of a
/// `Vec` that grows by lengths known only at run time.
pub(super) struct Block {
    bytes: Vec<u8>,
    end: usize,
}

impl Block {
    pub(super) fn new() -> Self {
        Block {
            bytes: vec![0; 2 * BLOCK],
            end: 0,
        }
    }

    pub(super) fn text(&self) -> &[u8] {
        &self.bytes[..self.end]
    }

    pub(super) fn clear(&mut self) {
        self.end = 0;
    }

    #[inline]
    pub(super) fn end(&self) -> usize {
        self.end
    }

    /// Writes another byte over the one at a place.
    #[inline]
    pub(super) fn replace(&mut self, place: usize, byte: u8) {
        self.bytes[place] = byte;
    }

    /// Appends the first `length` of `bytes`, and overwrites what may follow.
    #[inline]
    pub(super) fn push_part<const N: usize>(&mut self, bytes: &[u8; N], length: usize) {
        if self.bytes.len() - self.end < N {
            self.grow(N);
        }
        self.bytes[self.end..][..N].copy_from_slice(bytes);
        self.end += length;
    }

    /// Appends text of any length.
    #[inline]
    pub(super) fn push(&mut self, text: &[u8]) {
        if self.bytes.len() - self.end < text.len() {
            self.grow(text.len());
        }
        let out = &mut self.bytes[self.end..][..text.len()];
        match (text.first_chunk::<8>(), text.last_chunk::<8>()) {
            // Most buses: two copies that overlap.
            (Some(first), Some(last)) if text.len() <= 16 => {
                out[..8].copy_from_slice(first);
                out[text.len() - 8..].copy_from_slice(last);
            }
            _ => out.copy_from_slice(text),
        }
        self.end += text.len();
    }

    /// An instant of very many changes is longer than a block.
    #[cold]
    fn grow(&mut self, more: usize) {
        self.bytes.resize(2 * self.bytes.len() + more, 0);
    }
}

/// Femtoseconds that the last eight digits of a time count: 100 ns.
const LOW: u64 = 100_000_000;

/// The line of a time, `#123456789`. From one time to the next mostly the last digits change, and only these are found
/// again: dividing every digit off takes 138 instructions for a time of 15 digits.
pub(super) struct Stamp {
    time: Time,
    /// The time without its last eight digits, and the line's beginning that says so; unused where this is 0.
    high: u64,
    prefix: [u8; 16],
    length: usize,
}

impl Stamp {
    pub(super) fn new() -> Self {
        Stamp {
            time: Time::ZERO,
            high: 0,
            prefix: [0; 16],
            length: 0,
        }
    }

    /// The last time written.
    pub(super) fn time(&self) -> Time {
        self.time
    }

    #[inline]
    pub(super) fn write(&mut self, time: Time, block: &mut Block) {
        self.time = time;
        let fs = time.as_fs().unsigned_abs();
        let (high, low) = (fs / LOW, fs % LOW);
        if high != self.high {
            self.set_prefix(high);
        }
        if high == 0 {
            // Fewer digits; only the first 100 ns are like that.
            return block.push(format!("#{fs}\n").as_bytes());
        }
        block.push_part(&self.prefix, self.length);
        block.push_part(&eight_digits(low), 8);
        block.push_part(b"\n", 1);
    }

    #[cold]
    #[inline(never)]
    fn set_prefix(&mut self, high: u64) {
        let text = format!("#{high}");
        self.high = high;
        self.length = text.len();
        self.prefix[..text.len()].copy_from_slice(text.as_bytes());
    }
}

/// The decimal digits of a number below 10⁸, leading zeros included: halved three times, all parts at once.
#[inline]
fn eight_digits(number: u64) -> [u8; 8] {
    // Reciprocals 10486/2²⁰ and 103/2¹⁰ divide numbers below 10⁴ by 100 and below 100 by 10.
    let fours = (number / 10_000) | ((number % 10_000) << 32);
    let hundreds = ((fours * 10_486) >> 20) & 0x0000_007f_0000_007f;
    let twos = hundreds | (fours - 100 * hundreds) << 16;
    let tens = ((twos * 103) >> 10) & 0x000f_000f_000f_000f;
    let ones = tens | (twos - 10 * tens) << 8;
    (ones | 0x3030_3030_3030_3030).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_written_as_the_standard_library_writes_them() {
        let (mut stamp, mut block) = (Stamp::new(), Block::new());
        let mut fs = 0;
        let steps = [1, 7, 9_999, 10_001, 99_999_999, LOW as i64, 123_456_789_012];
        let few = [
            0,
            9,
            10,
            99_999_999,
            100_000_000,
            100_000_001,
            1 << 53,
            i64::MAX,
        ];
        let walk = (0..100_000).map(|i| {
            fs += steps[i * i % 7] * (i as i64 % 3);
            fs
        });
        for fs in few.into_iter().chain(walk).chain(few) {
            stamp.write(Time::from_fs(fs), &mut block);
            assert_eq!(block.text(), format!("#{fs}\n").as_bytes());
            block.clear();
        }
    }

    #[test]
    fn eight_digits_are_those_of_the_standard_library() {
        for number in (0..LOW).step_by(997).chain(LOW - 20_000..LOW) {
            assert_eq!(eight_digits(number), *format!("{number:08}").as_bytes());
        }
    }

    #[test]
    fn text_of_any_length_is_appended_whole() {
        let mut block = Block::new();
        let text: Vec<u8> = (0..40).collect();
        let mut expected = Vec::new();
        while expected.len() < 3 * BLOCK {
            for length in 0..=text.len() {
                block.push(&text[..length]);
                block.push_part(b"abcdefgh", length.min(8));
                expected.extend_from_slice(&text[..length]);
                expected.extend_from_slice(&b"abcdefgh"[..length.min(8)]);
            }
        }
        assert!(block.text() == expected);
    }
}
