//! Readout: the histograms leave through pins (thesis 4.2, Fig. 46; 4.7).
//!
//! ```text
//!                  macropixel (row, col)
//!                  ┌────────────────────────┐
//!   ROW_READ ──────┼─► bin_select ─ WORD ───┼──┐ of all rows of a column
//!   BIN_READ ──────┼─►    ▲ COUNT of bins   │  │
//!                  └────────────────────────┘  ▼
//!                                       column_bus ─ COLUMN ─► serialiser ─► DATA_OUT<k>   (a pin for several columns)
//!                                                                 ▲
//!   READ_CLK, READ_ENABLE ─► readout_scanner ─ ROW_READ, BIN_READ, WORD_LOAD
//! ```
//!
//! One bin of one row is selected at a time, all columns in parallel. WORD_LOAD copies it into the serialisers' shift
//! registers; while these shift it out, the next bin settles on the columns. The thesis names a serialiser that is a pipeline
//! apart from the deserialiser, so that loading and reading overlap (4.7); how it is built is not said. Row selection,
//! column-parallel words and a serialiser for a group of columns are the usual way, and the least wires.
//!
//! Timing contract: a period of READ_CLK for each bit, from its rising edge on; the reader samples DATA_OUT with the
//! falling one. The stream never pauses: rows × bins × (columns of a pin) × bits periods. READ_ENABLE low (or chip
//! reset) returns to row 0, bin 0. A reading that is broken off is begun anew; one that goes on too long starts again
//! with row 0. Reading changes no count. Counts that change meanwhile are caught in mid-ripple: read after the
//! exposure.
//!
//! Not read, nothing here moves: a macropixel's word is closed by ROW_READ, which READ_ENABLE holds low.
//!
//! | file | block |
//! |---|---|
//! | `bin_select` | the selected bin of a macropixel |
//! | `scanner` | which row, which bin, and when the serialisers take it |
//! | `serialiser` | words of several columns, bit by bit |
//! | this | the columns, all of it put together, the order of the bits |

mod bin_select;
mod scanner;
mod serialiser;

use std::sync::Arc;

use bitvec::slice::BitSlice;
use bitvec::vec::BitVec;

use super::finished;
use crate::chip::config::SensorConfig;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};

pub use bin_select::{circuit as bin_select, model as selected_word};
pub use scanner::{Scanner, circuit as scanner};
pub use serialiser::{Serialiser, circuit as serialiser};

/// In which order counts leave the chip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReadoutOrder {
    /// Macropixel rows.
    pub rows: usize,
    /// Macropixel columns.
    pub cols: usize,
    /// Bins of a macropixel.
    pub bins: usize,
    /// Bits of a bin.
    pub bits: usize,
    /// Columns that share a pin; the last pin may have fewer.
    pub cols_per_pin: usize,
}

impl ReadoutOrder {
    /// That of a sensor.
    pub fn new(config: &SensorConfig) -> Self {
        Self::of_array(config, (config.rows, config.cols))
    }

    /// That of `rows` and `cols` of a sensor's macropixels.
    pub(super) fn of_array(config: &SensorConfig, (rows, cols): (usize, usize)) -> Self {
        ReadoutOrder {
            rows,
            cols,
            bins: config.bins,
            bits: config.bin_bits,
            cols_per_pin: cols.div_ceil(config.readout_pins),
        }
    }

    /// Pins, DATA_OUT's width.
    pub fn pins(&self) -> usize {
        self.cols.div_ceil(self.cols_per_pin)
    }

    /// READ_CLK periods that a bin of one row takes on every pin.
    pub fn word_periods(&self) -> usize {
        self.cols_per_pin * self.bits
    }

    /// READ_CLK periods of the whole readout.
    pub fn periods(&self) -> usize {
        self.rows * self.bins * self.word_periods()
    }

    /// Columns of a pin.
    fn columns(&self, pin: usize) -> std::ops::Range<usize> {
        let first = pin * self.cols_per_pin;
        first..(first + self.cols_per_pin).min(self.cols)
    }

    /// Reference model: what leaves each pin, first bit first, for `counts` (macropixels row-major, bin 0 first).
    pub fn streams(&self, counts: &[u16]) -> Vec<BitVec> {
        debug_assert_eq!(counts.len(), self.rows * self.cols * self.bins);
        let stream = |pin| {
            let mut stream = BitVec::new();
            for row in 0..self.rows {
                for bin in 0..self.bins {
                    for col in self.columns(pin) {
                        let count = counts[(row * self.cols + col) * self.bins + bin];
                        stream.extend((0..self.bits).rev().map(|bit| count >> bit & 1 == 1));
                    }
                    stream.resize(stream.len().next_multiple_of(self.word_periods()), false);
                }
            }
            stream
        };
        (0..self.pins()).map(stream).collect()
    }

    /// Reference model: the counts that streams of whole words tell of, as [`ReadoutOrder::streams`] takes them; 0 where
    /// they have ended.
    pub fn counts(&self, streams: &[impl AsRef<BitSlice>]) -> Vec<u16> {
        debug_assert_eq!(streams.len(), self.pins());
        let mut counts = vec![0; self.rows * self.cols * self.bins];
        for (pin, stream) in streams.iter().enumerate() {
            let words = stream.as_ref().chunks_exact(self.word_periods());
            for (index, word) in words.take(self.rows * self.bins).enumerate() {
                let (row, bin) = (index / self.bins, index % self.bins);
                for (col, bits) in self.columns(pin).zip(word.chunks_exact(self.bits)) {
                    let count = bits
                        .iter()
                        .fold(0, |count, bit| count << 1 | u16::from(*bit));
                    counts[(row * self.cols + col) * self.bins + bin] = count;
                }
            }
        }
        counts
    }
}

/// A column: the words of its rows, of which all but the selected one are 0. The gates stand for the bus with a
/// three-state driver in each macropixel that a chip would have; the library has none.
///
/// Ports: WORD\<rows × bits\> → COLUMN\<bits\>.
fn column_bus(rows: usize, bits: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("column_bus");
    let words = m.input_bus("WORD", rows * bits);
    let column = m.output_bus("COLUMN", bits);
    for (bit, &column) in column.iter().enumerate() {
        let of_rows: Vec<Net> = (0..rows).map(|row| words[row * bits + bit]).collect();
        let (upper, lower) = of_rows.split_at(rows.div_ceil(2));
        let halves = [upper, lower].map(|half| m.tree(CellKind::Or2, half));
        m.gate_into(CellKind::Or2, &halves, column);
    }
    finished(m.finish())
}

/// What macropixels are connected to.
pub(super) struct ReadNets {
    /// ROW_READ of each row.
    pub rows: Vec<Net>,
    /// WORD, `bits` nets for each macropixel, row-major.
    pub words: Vec<Net>,
}

/// Places scanner, columns and serialisers in a parent, which declares READ_CLK, READ_ENABLE and `data_out`, and connects
/// what is returned and BIN_READ.
pub(super) fn place(
    m: &mut ModuleBuilder,
    order: ReadoutOrder,
    [enable, resetb]: [Net; 2],
    data_out: &[Net],
) -> ReadNets {
    let ReadoutOrder {
        rows,
        cols,
        bins,
        bits,
        ..
    } = order;
    let row_read = m.wire_bus("ROW_READ", rows);
    m.wire_bus("BIN_READ", bins);
    let words = m.wire_bus("WORD", rows * cols * bits);
    m.wire("WORD_LOAD");
    let reset = m.wire("READ_RESET");
    m.gate_into(CellKind::Nand2, &[enable, resetb], reset);
    let scanner = scanner(rows, bins, order.word_periods());
    m.instance_by_names("readout_scanner", &scanner, &[]);
    let columns = match rows {
        1 => words.clone(),
        _ => {
            let columns = m.wire_bus("COLUMN", cols * bits);
            let bus = column_bus(rows, bits);
            for (col, column) in columns.chunks(bits).enumerate() {
                let word = |row| &words[(row * cols + col) * bits..][..bits];
                let of_column: Vec<Net> = (0..rows).flat_map(word).copied().collect();
                let name = format!("column_c{col}");
                m.instance(&name, &bus, &[("WORD", &of_column), ("COLUMN", column)]);
            }
            columns
        }
    };
    let full = serialiser(order.cols_per_pin, order.cols_per_pin, bits);
    for (pin, data_out) in data_out.chunks(1).enumerate() {
        let of_pin = order.columns(pin);
        let circuit = if of_pin.len() == order.cols_per_pin {
            Arc::clone(&full)
        } else {
            serialiser(of_pin.len(), order.cols_per_pin, bits)
        };
        let words = &columns[of_pin.start * bits..of_pin.end * bits];
        let ports = [("WORD", words), ("DATA_OUT", data_out)];
        m.instance_by_names(&format!("serialiser_{pin}"), &circuit, &ports);
    }
    ReadNets {
        rows: row_read,
        words,
    }
}

/// The readout with pins for counts in place of the histograms, for reading a whole array at gate level without its pixels.
///
/// Ports: READ_CLK, READ_ENABLE, RESETB, COUNT\<rows × cols × bins × bits\> (macropixels row-major, bin 0 first, bit 0
/// first) → DATA_OUT.
pub fn with_counts(order: ReadoutOrder) -> Arc<Module> {
    let (bins, bits) = (order.bins, order.bits);
    let mut m = ModuleBuilder::new("readout");
    m.input("READ_CLK");
    let enable = m.input("READ_ENABLE");
    let resetb = m.input("RESETB");
    let counts = m.input_bus("COUNT", order.rows * order.cols * bins * bits);
    let data_out = m.output_bus("DATA_OUT", order.pins());
    let read = place(&mut m, order, [enable, resetb], &data_out);
    let select = bin_select(bins, bits);
    let pixels = counts.chunks(bins * bits).zip(read.words.chunks(bits));
    for (pixel, (counts, word)) in pixels.enumerate() {
        let (row, col) = (pixel / order.cols, pixel % order.cols);
        let row_read = &read.rows[row..=row];
        let ports = [("ROW_READ", row_read), ("COUNT", counts), ("WORD", word)];
        m.instance_by_names(&format!("bin_select_r{row}_c{col}"), &select, &ports);
    }
    finished(m.finish())
}
