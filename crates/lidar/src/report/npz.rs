//! Several arrays in one file, as `numpy.savez` writes them: a ZIP archive of `.npy` files, not compressed.
//!
//! Source: APPNOTE.TXT of PKWARE, 4.3; `numpy.lib.format`.

use std::path::Path;

use crate::files::{Element, InputError, OutputFile, write_npy};

/// An archive that is put together in memory.
#[derive(Debug, Default)]
pub struct Npz {
    bytes: Vec<u8>,
    /// Entries of the central directory.
    directory: Vec<u8>,
    entries: u16,
}

/// A file that was made at the beginning of the format's time, so that the same arrays are the same bytes.
const DOS_TIME: u16 = 0;
const DOS_DATE: u16 = 1 << 5 | 1;

impl Npz {
    /// Adds an array of `shape`, last axis fastest.
    ///
    /// # Panics
    /// When `shape` does not have as many elements as `data`, or the archive exceeds 4 GiB.
    pub fn add<T: Element>(&mut self, name: &str, shape: &[usize], data: &[T]) {
        let mut array = Vec::new();
        write_npy(&mut array, shape, data).expect("memory takes what is written");
        let name = format!("{name}.npy");
        let offset = u32::try_from(self.bytes.len()).expect("below 4 GiB");
        let size = u32::try_from(array.len()).expect("below 4 GiB");
        // Version, flags, method, time and date, checksum, sizes, lengths of name and further fields.
        let mut common = Vec::new();
        for number in [20, 0, 0, DOS_TIME, DOS_DATE] {
            common.extend(u16::to_le_bytes(number));
        }
        for number in [crc32fast::hash(&array), size, size] {
            common.extend(number.to_le_bytes());
        }
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0; 2]);
        self.bytes.extend(b"PK\x03\x04");
        self.bytes.extend(&common);
        self.bytes.extend(name.as_bytes());
        self.bytes.extend(&array);
        self.directory.extend(b"PK\x01\x02\x14\x00");
        self.directory.extend(&common);
        // Comment, disk, attributes.
        self.directory.extend([0; 10]);
        self.directory.extend(offset.to_le_bytes());
        self.directory.extend(name.as_bytes());
        self.entries += 1;
    }

    /// Writes the archive.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), InputError> {
        OutputFile::write_with(path, |out| {
            out.write_all(&self.bytes)?;
            out.write_all(&self.directory)?;
            out.write_all(b"PK\x05\x06\0\0\0\0")?;
            out.write_all(&self.entries.to_le_bytes())?;
            out.write_all(&self.entries.to_le_bytes())?;
            out.write_all(&(self.directory.len() as u32).to_le_bytes())?;
            out.write_all(&(self.bytes.len() as u32).to_le_bytes())?;
            out.write_all(&[0; 2])
        })
    }
}
