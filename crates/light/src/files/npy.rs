//! NumPy files (`.npy`): a head that says type, order and shape, then the elements.
//!
//! ```text
//!   \x93NUMPY 1 0 │ length │ {'descr': '<u2', 'fortran_order': False, 'shape': (64, 64, 16, ), } … \n │ elements
//! ```
//!
//! Written: version 1.0, little endian, last axis fastest. Read: versions 1 to 3, whole numbers and floats of 1 to 8 bytes,
//! either byte order, either order of axes. Source: `numpy.lib.format`.

use std::io::{self, Read, Write};

const MAGIC: &[u8] = b"\x93NUMPY";

/// Longest head that is read, bytes. NumPy's own heads of such arrays have 118.
const LONGEST_HEAD: usize = 1 << 16;

/// A number that an array may have.
pub trait Element: Copy {
    /// Its type, as NumPy spells it.
    const DESCR: &'static str;

    /// Appends its bytes, the least first.
    fn put(self, bytes: &mut Vec<u8>);

    /// The number, if this type has it.
    fn from_number(number: Number) -> Option<Self>;
}

/// An element that was read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// Of a type of whole numbers.
    Whole(i128),
    /// Of a type of floats.
    Float(f64),
}

macro_rules! elements {
    ($($kind:ty, $descr:literal, $variant:ident;)*) => {$(
        impl Element for $kind {
            const DESCR: &'static str = $descr;

            fn put(self, bytes: &mut Vec<u8>) {
                bytes.extend(self.to_le_bytes());
            }

            fn from_number(number: Number) -> Option<Self> {
                match number {
                    Number::$variant(value) => Some(value as $kind),
                    _ => None,
                }
            }
        }
    )*};
}

elements! {
    u8, "|u1", Whole;
    u16, "<u2", Whole;
    u32, "<u4", Whole;
    u64, "<u8", Whole;
    i8, "|i1", Whole;
    i16, "<i2", Whole;
    i32, "<i4", Whole;
    i64, "<i8", Whole;
    f32, "<f4", Float;
    f64, "<f8", Float;
}

/// Writes the head of an array of `shape`, last axis fastest.
///
/// # Errors
/// Those of `out`.
pub fn write_npy_head<T: Element>(
    out: &mut (impl Write + ?Sized),
    shape: &[usize],
) -> io::Result<()> {
    let axes: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let descr = T::DESCR;
    let head = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({axes}), }}");
    let length = head.len();
    write_head(out, head, length)
}

/// Writes a head as long as one of `least` characters needs to be.
fn write_head(out: &mut (impl Write + ?Sized), mut head: String, least: usize) -> io::Result<()> {
    // Elements begin at a multiple of 64 bytes.
    let before = MAGIC.len() + 4;
    while head.len() < least || !(before + head.len() + 1).is_multiple_of(64) {
        head.push(' ');
    }
    head.push('\n');
    out.write_all(MAGIC)?;
    out.write_all(&[1, 0])?;
    out.write_all(&(head.len() as u16).to_le_bytes())?;
    out.write_all(head.as_bytes())
}

/// Writes the head of a list of records with these fields and their types, as NumPy spells them. It has the same length for any number of
/// records, so that it can be written again when they have been counted.
///
/// # Errors
/// Those of `out`.
pub fn write_npy_records_head(
    out: &mut (impl Write + ?Sized),
    fields: &[(&str, &str)],
    records: u64,
) -> io::Result<()> {
    let fields: Vec<String> = (fields.iter())
        .map(|(name, descr)| format!("('{name}', '{descr}')"))
        .collect();
    let fields = fields.join(", ");
    let head = |records: u64| {
        format!("{{'descr': [{fields}], 'fortran_order': False, 'shape': ({records},), }}")
    };
    write_head(out, head(records), head(u64::MAX).len())
}

/// Writes elements, without a head.
///
/// # Errors
/// Those of `out`.
pub fn write_npy_elements<T: Element>(
    out: &mut (impl Write + ?Sized),
    elements: impl IntoIterator<Item = T>,
) -> io::Result<usize> {
    let mut bytes = Vec::new();
    let mut written = 0;
    for element in elements {
        element.put(&mut bytes);
        written += 1;
        if bytes.len() >= 1 << 16 {
            out.write_all(&bytes)?;
            bytes.clear();
        }
    }
    out.write_all(&bytes)?;
    Ok(written)
}

/// Writes an array of `shape`, last axis fastest.
///
/// # Errors
/// Those of `out`.
///
/// # Panics
/// When `shape` does not have as many elements as `data`.
pub fn write_npy<T: Element>(
    out: &mut (impl Write + ?Sized),
    shape: &[usize],
    data: &[T],
) -> io::Result<()> {
    let elements: usize = shape.iter().product();
    assert_eq!(
        elements,
        data.len(),
        "shape {shape:?} does not fit the data"
    );
    write_npy_head::<T>(out, shape)?;
    write_npy_elements(out, data.iter().copied()).map(drop)
}

/// What the head of an array says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NpyHead {
    /// Type of the elements as it stands there: `'<u2'`.
    pub descr: String,
    /// Whether the first axis is fastest.
    pub is_fortran: bool,
    /// Length of each axis.
    pub shape: Vec<usize>,
}

impl NpyHead {
    /// Reads the head, so that `reader` stands before the elements.
    ///
    /// # Errors
    /// Those of `reader`, and what is no such head.
    pub fn read(reader: &mut impl Read) -> io::Result<Self> {
        let mut start = [0; 8];
        reader.read_exact(&mut start)?;
        if !start.starts_with(MAGIC) {
            return Err(invalid("it does not begin as one"));
        }
        let mut length = [0; 4];
        let length_bytes = if start[6] == 1 { 2 } else { 4 };
        reader.read_exact(&mut length[..length_bytes])?;
        let length = u32::from_le_bytes(length) as usize;
        if !(1..=3).contains(&start[6]) || length > LONGEST_HEAD {
            return Err(invalid("its head is of a version that is not known"));
        }
        let mut text = vec![0; length];
        reader.read_exact(&mut text)?;
        Self::parse(&String::from_utf8_lossy(&text)).ok_or_else(|| invalid("its head is broken"))
    }

    /// From the text of a Python dictionary.
    fn parse(text: &str) -> Option<Self> {
        let after = |key: &str| {
            let rest = text.split_once(&format!("'{key}'"))?.1;
            Some(rest.trim_start().strip_prefix(':')?.trim_start())
        };
        let descr = after("descr")?;
        let end = match descr.strip_prefix('\'') {
            Some(quoted) => quoted.find('\'')? + 2,
            // A record, whose fields are listed.
            None => descr.find(']')? + 1,
        };
        let is_fortran = after("fortran_order")?.starts_with("True");
        let axes = after("shape")?.strip_prefix('(')?.split_once(')')?.0;
        let axes = axes
            .split(',')
            .map(str::trim)
            .filter(|axis| !axis.is_empty());
        Some(NpyHead {
            descr: descr[..end].to_owned(),
            is_fortran,
            shape: axes.map(|axis| axis.parse().ok()).collect::<Option<_>>()?,
        })
    }

    /// Whether elements are of type `T`.
    pub(crate) fn is_of<T: Element>(&self) -> bool {
        let same = |descr: &str| {
            descr
                .trim_matches('\'')
                .trim_start_matches(['<', '|', '='])
                .to_owned()
        };
        self.is_little_endian() && same(&self.descr) == same(T::DESCR)
    }

    fn is_little_endian(&self) -> bool {
        !self.descr.starts_with("'>")
    }

    /// Reads the elements, in their order in the file; `None` if they are neither whole numbers nor floats.
    pub(crate) fn numbers(&self, reader: &mut impl Read) -> Option<io::Result<Vec<Number>>> {
        let kind = self.descr.trim_matches(['\'', '<', '>', '|', '=']);
        let (sort, width) = kind.split_at_checked(1)?;
        let width = match (sort, width) {
            ("u" | "i", "1" | "2" | "4" | "8") | ("f", "4" | "8") => width.parse().ok()?,
            _ => return None,
        };
        let number = |bytes: &[u8]| {
            let mut least_first = [0; 8];
            least_first[..width].copy_from_slice(bytes);
            if !self.is_little_endian() {
                least_first[..width].reverse();
            }
            let bits = u64::from_le_bytes(least_first);
            let unused = 64 - 8 * width as u32;
            match (sort, width) {
                ("u", _) => Number::Whole(bits.into()),
                ("i", _) => Number::Whole(((bits << unused) as i64 >> unused).into()),
                (_, 4) => Number::Float(f32::from_bits(bits as u32).into()),
                _ => Number::Float(f64::from_bits(bits)),
            }
        };
        let elements = self
            .shape
            .iter()
            .try_fold(1usize, |all, &n| all.checked_mul(n));
        let wanted = elements
            .and_then(|n| n.checked_mul(width))
            .unwrap_or(usize::MAX);
        let mut bytes = Vec::new();
        // As much as there is, however much the head promises.
        let read = reader.take(wanted as u64).read_to_end(&mut bytes);
        let checked = read.and_then(|read| {
            if read == wanted {
                Ok(())
            } else {
                Err(io::Error::from(io::ErrorKind::UnexpectedEof))
            }
        });
        Some(checked.map(|()| bytes.chunks_exact(width).map(number).collect()))
    }
}

fn invalid(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn round_trip<T: Element + PartialEq + std::fmt::Debug>(values: &[T]) {
        let mut bytes = Vec::new();
        write_npy(&mut bytes, &[values.len()], values).unwrap();
        assert_eq!((bytes.len() - size_of_val(values)) % 64, 0);
        let mut reader = &bytes[..];
        let head = NpyHead::read(&mut reader).unwrap();
        assert!(head.is_of::<T>() && head.shape == [values.len()]);
        let numbers = head.numbers(&mut reader).unwrap().unwrap();
        let read: Vec<T> = numbers
            .into_iter()
            .map(|n| T::from_number(n).unwrap())
            .collect();
        assert_eq!(read, values);
    }

    proptest! {
        #[test]
        fn arrays_come_back_as_written(bits in prop::collection::vec(any::<u64>(), 0..40)) {
            macro_rules! of {
                ($($kind:ty),*) => {$(round_trip(&bits.iter().map(|&b| b as $kind).collect::<Vec<_>>());)*};
            }
            of!(u8, u16, u32, u64, i8, i16, i32, i64, f32, f64);
        }
    }

    #[test]
    fn a_file_of_numpy_s_is_read() {
        // numpy.save of numpy.array([[1, -2, 3]], ">i2", order="F")
        let mut file = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        let head = "{'descr': '>i2', 'fortran_order': True, 'shape': (1, 3), }";
        file.extend(format!("{head:<117}\n").as_bytes());
        file.extend([0, 1, 0xff, 0xfe, 0, 3]);
        let mut reader = &file[..];
        let head = NpyHead::read(&mut reader).unwrap();
        assert!(head.is_fortran && head.shape == [1, 3] && head.descr == "'>i2'");
        let numbers = head.numbers(&mut reader).unwrap().unwrap();
        assert_eq!(numbers, [1, -2, 3].map(Number::Whole));
    }

    #[test]
    fn the_head_is_numpy_s() {
        let mut bytes = Vec::new();
        write_npy(&mut bytes, &[1, 2], &[7u16, 8]).unwrap();
        let head = "{'descr': '<u2', 'fortran_order': False, 'shape': (1, 2, ), }";
        let expected = [
            b"\x93NUMPY\x01\x00\x76\x00",
            format!("{head:<117}\n").as_bytes(),
            &[7, 0, 8, 0],
        ]
        .concat();
        assert_eq!(bytes, expected);
    }
}
