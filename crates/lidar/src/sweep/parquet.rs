//! Tables as Apache Parquet, column by column in groups of rows, so that no more than one group is held in memory.
//!
//! ```text
//!   PAR1 │ group: page of column 1 │ page of column 2 │ … │ group … │ footer: schema, places of pages │ its length │ PAR1
//! ```
//!
//! The plainest file that every reader takes: one data page (version 1) a column and group, PLAIN values without compression, a bit a cell
//! that says whether there is one. Headers are Thrift structs in its compact protocol. The crate `parquet` writes the same and
//! more, at 14 further crates (see DESIGN.md).
//!
//! Source: parquet.thrift and Encodings.md of apache/parquet-format; compact protocol of Apache Thrift.

use std::io::{self, Write};

use super::cell::{Column, Holds, TableCell};

/// Rows of a group: 2¹⁶ numbers are half a mebibyte.
const GROUP: usize = 1 << 16;

const MAGIC: &[u8] = b"PAR1";

/// A file that is being written.
pub(super) struct Parquet<W: Write> {
    out: W,
    at: u64,
    columns: Vec<Column>,
    /// Cells of the group, column by column.
    group: Vec<Vec<TableCell>>,
    groups: Vec<Group>,
}

/// A group that has been written.
struct Group {
    rows: usize,
    chunks: Vec<Chunk>,
}

struct Chunk {
    begin: u64,
    bytes: usize,
}

impl<W: Write> Parquet<W> {
    pub(super) fn begin(mut out: W, columns: &[Column]) -> io::Result<Self> {
        out.write_all(MAGIC)?;
        Ok(Parquet {
            out,
            at: MAGIC.len() as u64,
            columns: columns.to_vec(),
            group: vec![Vec::new(); columns.len()],
            groups: Vec::new(),
        })
    }

    /// Adds a row, a cell for every column.
    pub(super) fn push(&mut self, row: impl IntoIterator<Item = TableCell>) -> io::Result<()> {
        for (column, cell) in self.group.iter_mut().zip(row) {
            column.push(cell);
        }
        match self.group[0].len() {
            GROUP => self.write_group(),
            _ => Ok(()),
        }
    }

    fn write_group(&mut self) -> io::Result<()> {
        let rows = self.group[0].len();
        let mut chunks = Vec::new();
        for (column, cells) in self.columns.iter().zip(&mut self.group) {
            debug_assert_eq!(cells.len(), rows, "a cell for every column");
            let page = page(cells, column.holds);
            cells.clear();
            let header = page_header(page.len(), rows);
            self.out.write_all(&header)?;
            self.out.write_all(&page)?;
            let bytes = header.len() + page.len();
            chunks.push(Chunk {
                begin: self.at,
                bytes,
            });
            self.at += bytes as u64;
        }
        self.groups.push(Group { rows, chunks });
        Ok(())
    }

    /// Writes what is left, and the footer.
    pub(super) fn finish(mut self) -> io::Result<W> {
        if !self.group[0].is_empty() {
            self.write_group()?;
        }
        let footer = footer(&self.columns, &self.groups);
        self.out.write_all(&footer)?;
        self.out.write_all(&(footer.len() as u32).to_le_bytes())?;
        self.out.write_all(MAGIC)?;
        Ok(self.out)
    }
}

/// Numbers of parquet.thrift: Type.
fn physical_type(holds: Holds) -> i64 {
    match holds {
        Holds::Truth => 0,
        Holds::Whole => 2,
        Holds::Number => 5,
        Holds::Word => 6,
    }
}

/// Encoding.PLAIN and Encoding.RLE.
const PLAIN: i64 = 0;
const RLE: i64 = 3;

/// A page without its header: which cells there are, then their values.
fn page(cells: &[TableCell], holds: Holds) -> Vec<u8> {
    let is_there = |cell: &TableCell| {
        !matches!(cell, TableCell::Empty) && cell.number().is_none_or(|x| !x.is_nan())
    };
    // One run of bits, eight cells to a byte.
    let mut bits = Vec::new();
    varint(&mut bits, (cells.len().div_ceil(8) as u64) << 1 | 1);
    pack(&mut bits, cells.iter().map(is_there));
    let mut page = (bits.len() as u32).to_le_bytes().to_vec();
    page.extend(bits);
    let there = cells.iter().filter(|cell| is_there(cell));
    match holds {
        Holds::Truth => pack(&mut page, there.map(|cell| *cell == TableCell::Truth(true))),
        Holds::Whole => there.for_each(|cell| match cell {
            TableCell::Whole(n) => page.extend(n.to_le_bytes()),
            other => debug_assert!(false, "{other:?} among whole numbers"),
        }),
        Holds::Number => there.for_each(|cell| {
            page.extend(cell.number().unwrap_or(f64::NAN).to_le_bytes());
        }),
        Holds::Word => there.for_each(|cell| match cell {
            TableCell::Word(word) => {
                page.extend((word.len() as u32).to_le_bytes());
                page.extend(word.as_bytes());
            }
            other => debug_assert!(false, "{other:?} among words"),
        }),
    }
    page
}

/// Bits from the lowest of a byte on.
fn pack(out: &mut Vec<u8>, bits: impl Iterator<Item = bool>) {
    let mut place = 8;
    for bit in bits {
        if place == 8 {
            out.push(0);
            place = 0;
        }
        *out.last_mut().expect("pushed") |= u8::from(bit) << place;
        place += 1;
    }
}

fn page_header(bytes: usize, rows: usize) -> Vec<u8> {
    let mut header = Thrift::default();
    header
        .whole(1, 0)
        .whole(2, bytes as i64)
        .whole(3, bytes as i64);
    header.structure(5, |data| {
        data.whole(1, rows as i64)
            .whole(2, PLAIN)
            .whole(3, RLE)
            .whole(4, RLE);
    });
    header.finish()
}

/// FileMetaData.
fn footer(columns: &[Column], groups: &[Group]) -> Vec<u8> {
    let mut footer = Thrift::default();
    footer.whole(1, 1);
    footer.structures(2, columns.len() + 1, |n, element| match n.checked_sub(1) {
        None => {
            element.text(4, "schema").whole(5, columns.len() as i64);
        }
        Some(column) => {
            let Column { name, holds, .. } = &columns[column];
            element
                .whole(1, physical_type(*holds))
                .whole(3, 1)
                .text(4, name);
            if *holds == Holds::Word {
                element.whole(6, 0);
            }
        }
    });
    let rows: usize = groups.iter().map(|group| group.rows).sum();
    footer.long(3, rows as i64);
    footer.structures(4, groups.len(), |n, element| {
        let group = &groups[n];
        element.structures(1, columns.len(), |n, chunk| {
            let Chunk { begin, bytes } = group.chunks[n];
            chunk.long(2, begin as i64);
            chunk.structure(3, |data| {
                data.whole(1, physical_type(columns[n].holds));
                data.wholes(2, &[PLAIN, RLE])
                    .texts(3, &[&columns[n].name])
                    .whole(4, 0);
                data.long(5, group.rows as i64)
                    .long(6, bytes as i64)
                    .long(7, bytes as i64);
                data.long(9, begin as i64);
            });
        });
        let bytes: usize = group.chunks.iter().map(|chunk| chunk.bytes).sum();
        element.long(2, bytes as i64).long(3, group.rows as i64);
    });
    footer.text(6, concat!("gdtof ", env!("CARGO_PKG_VERSION")));
    footer.finish()
}

/// A struct in Thrift's compact protocol: fields in the order of their numbers.
#[derive(Default)]
struct Thrift {
    bytes: Vec<u8>,
    last: u8,
}

/// Types of fields.
const I32: u8 = 5;
const I64: u8 = 6;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

impl Thrift {
    fn field(&mut self, number: u8, kind: u8) {
        debug_assert!(number > self.last && number - self.last < 16);
        self.bytes.push((number - self.last) << 4 | kind);
        self.last = number;
    }

    fn whole(&mut self, number: u8, value: i64) -> &mut Self {
        self.field(number, I32);
        zigzag(&mut self.bytes, value);
        self
    }

    fn long(&mut self, number: u8, value: i64) -> &mut Self {
        self.field(number, I64);
        zigzag(&mut self.bytes, value);
        self
    }

    fn text(&mut self, number: u8, text: &str) -> &mut Self {
        self.field(number, BINARY);
        self.bare_text(text);
        self
    }

    fn bare_text(&mut self, text: &str) {
        varint(&mut self.bytes, text.len() as u64);
        self.bytes.extend(text.as_bytes());
    }

    fn list(&mut self, number: u8, kind: u8, items: usize) {
        self.field(number, LIST);
        match items {
            0..15 => self.bytes.push((items as u8) << 4 | kind),
            _ => {
                self.bytes.push(0xf0 | kind);
                varint(&mut self.bytes, items as u64);
            }
        }
    }

    fn wholes(&mut self, number: u8, values: &[i64]) -> &mut Self {
        self.list(number, I32, values.len());
        values
            .iter()
            .for_each(|&value| zigzag(&mut self.bytes, value));
        self
    }

    fn texts(&mut self, number: u8, texts: &[&str]) -> &mut Self {
        self.list(number, BINARY, texts.len());
        texts.iter().for_each(|text| self.bare_text(text));
        self
    }

    fn structure(&mut self, number: u8, fill: impl FnOnce(&mut Thrift)) -> &mut Self {
        self.field(number, STRUCT);
        self.bare_structure(fill);
        self
    }

    fn structures(
        &mut self,
        number: u8,
        items: usize,
        fill: impl Fn(usize, &mut Thrift),
    ) -> &mut Self {
        self.list(number, STRUCT, items);
        (0..items).for_each(|n| self.bare_structure(|item| fill(n, item)));
        self
    }

    fn bare_structure(&mut self, fill: impl FnOnce(&mut Thrift)) {
        let mut inner = Thrift::default();
        fill(&mut inner);
        self.bytes.extend(inner.finish());
    }

    fn finish(mut self) -> Vec<u8> {
        self.bytes.push(0);
        self.bytes
    }
}

fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn zigzag(out: &mut Vec<u8>, value: i64) {
    varint(out, (value << 1 ^ value >> 63) as u64);
}
