//! Pulses as lines of text and as NumPy records.
//!
//! | file | what a pulse is |
//! |---|---|
//! | `.csv` | `time_fs,row,col,spad` below that header, as `gdtof replay` reads it |
//! | `.npy` | a record of `time_fs` (int64), `row` and `col` (uint16) and `spad` (uint8) |
//! | `.txt` | `time_fs spad`, for `$fscanf(file, "%d %d", time_fs, spad)` |

use std::io::{self, Seek, SeekFrom, Write};

use crate::files::write_npy_records_head;
use crate::photon::SpadEvent;

/// Fields of a record and their types.
const FIELDS: [(&str, &str); 4] = [
    ("time_fs", "<i8"),
    ("row", "<u2"),
    ("col", "<u2"),
    ("spad", "|u1"),
];

/// Writes the pulses of all macropixels one after the other.
pub(super) trait ArrayWriter {
    /// The next pulses, of a macropixel at a row and column.
    ///
    /// # Errors
    /// Those of the file.
    fn write(&mut self, place: (usize, usize), pulses: &[SpadEvent]) -> io::Result<()>;

    /// Ends the file.
    ///
    /// # Errors
    /// Those of the file.
    fn finish(&mut self) -> io::Result<()>;
}

/// Comma-separated values.
pub(super) struct Csv<W>(W);

impl<W: Write> Csv<W> {
    pub(super) fn begin(mut out: W) -> io::Result<Self> {
        out.write_all(b"time_fs,row,col,spad\n")?;
        Ok(Csv(out))
    }
}

impl<W: Write> ArrayWriter for Csv<W> {
    fn write(&mut self, (row, col): (usize, usize), pulses: &[SpadEvent]) -> io::Result<()> {
        for pulse in pulses {
            writeln!(self.0, "{},{row},{col},{}", pulse.time.as_fs(), pulse.spad)?;
        }
        Ok(())
    }

    fn finish(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// NumPy records.
pub(super) struct Npy<W> {
    out: W,
    records: u64,
}

impl<W: Write + Seek> Npy<W> {
    pub(super) fn begin(mut out: W) -> io::Result<Self> {
        write_npy_records_head(&mut out, &FIELDS, 0)?;
        Ok(Npy { out, records: 0 })
    }
}

impl<W: Write + Seek> ArrayWriter for Npy<W> {
    fn write(&mut self, (row, col): (usize, usize), pulses: &[SpadEvent]) -> io::Result<()> {
        let [row, col] = [row as u16, col as u16].map(u16::to_le_bytes);
        for pulse in pulses {
            self.out.write_all(&pulse.time.as_fs().to_le_bytes())?;
            self.out.write_all(&row)?;
            self.out.write_all(&col)?;
            self.out.write_all(&[pulse.spad])?;
        }
        self.records += pulses.len() as u64;
        Ok(())
    }

    /// The head says how many records there are, which is known now.
    fn finish(&mut self) -> io::Result<()> {
        self.out.seek(SeekFrom::Start(0))?;
        write_npy_records_head(&mut self.out, &FIELDS, self.records)?;
        self.out.flush()
    }
}

/// Writes the pulses of one macropixel, in the order of their times.
pub(super) trait PixelWriter {
    /// The next pulses.
    ///
    /// # Errors
    /// Those of the file.
    fn write(&mut self, pulses: &[SpadEvent]) -> io::Result<()>;

    /// Ends the file. Returns how many pulses it cannot tell from others.
    ///
    /// # Errors
    /// Those of the file.
    fn finish(&mut self) -> io::Result<u64>;
}

/// A pulse a line.
pub(super) struct Txt<W>(pub(super) W);

impl<W: Write> PixelWriter for Txt<W> {
    fn write(&mut self, pulses: &[SpadEvent]) -> io::Result<()> {
        for pulse in pulses {
            writeln!(self.0, "{} {}", pulse.time.as_fs(), pulse.spad)?;
        }
        Ok(())
    }

    fn finish(&mut self) -> io::Result<u64> {
        self.0.flush()?;
        Ok(0)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::units::Time;

    fn pulses() -> Vec<SpadEvent> {
        let pulse = |(time_fs, spad)| SpadEvent::new(Time::from_fs(time_fs), spad);
        [(0, 3), (7, 0), (8_999_999_999_999_999, 15)]
            .map(pulse)
            .to_vec()
    }

    #[test]
    fn a_line_has_time_place_and_spad() {
        let mut csv = Csv::begin(Vec::new()).unwrap();
        csv.write((2, 63), &pulses()[..2]).unwrap();
        csv.finish().unwrap();
        let text = String::from_utf8(csv.0).unwrap();
        assert_eq!(text, "time_fs,row,col,spad\n0,2,63,3\n7,2,63,0\n");
        let mut txt = Txt(Vec::new());
        txt.write(&pulses()[1..]).unwrap();
        assert_eq!(txt.finish().unwrap(), 0);
        assert_eq!(txt.0, b"7 0\n8999999999999999 15\n");
    }

    /// The head is as long for every number of records, and elements begin at a multiple of 64 bytes.
    #[test]
    fn records_follow_a_head_that_says_how_many() {
        let mut npy = Npy::begin(Cursor::new(Vec::new())).unwrap();
        npy.write((1, 300), &pulses()).unwrap();
        npy.finish().unwrap();
        let bytes = npy.out.into_inner();
        let head_length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]])) + 10;
        assert_eq!(head_length % 64, 0);
        let head = String::from_utf8_lossy(&bytes[10..head_length]).into_owned();
        let says = "{'descr': [('time_fs', '<i8'), ('row', '<u2'), ('col', '<u2'), ('spad', '|u1')], 'fortran_order': False, 'shape': (3,), }";
        assert!(head.starts_with(says) && head.ends_with(" \n"), "{head}");
        let records: Vec<&[u8]> = bytes[head_length..].chunks(13).collect();
        assert_eq!(records.len(), 3);
        let last = 8_999_999_999_999_999i64.to_le_bytes();
        assert_eq!(records[2][..8], last);
        assert_eq!(records[2][8..], [1, 0, 44, 1, 15]);
    }
}
