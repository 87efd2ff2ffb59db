//! Where the nets of the load path are, in a sensor or in front of memories alone.

use super::{Probe, join, top_bus};
use crate::chip::load_path;
use crate::netlist::{NetId, Netlist};

/// A net or bus of the load path, in a sensor or in [`load_path::with_memories`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoadProbe {
    /// LOAD_CLK.
    Clk,
    /// LOAD_ENABLE.
    Enable,
    /// COUNTER_INITS, the serial bits.
    Serial,
    /// COUNTER_INIT_ROW, the deserialised row.
    Row,
    /// ROW_DONE.
    RowDone,
    /// The bit counter of the deserialiser.
    Bit,
    /// The row scanner's token, one bit a row.
    Select,
    /// What lets the selected row's MEMORY_LOAD pass.
    Write,
    /// MEMORY_LOAD, one bit a row.
    MemoryLoad,
}

impl LoadProbe {
    /// Dotted path below the top.
    pub const fn path(self) -> &'static str {
        match self {
            LoadProbe::Clk => "LOAD_CLK",
            LoadProbe::Enable => "LOAD_ENABLE",
            LoadProbe::Serial => "COUNTER_INITS",
            LoadProbe::Row => "COUNTER_INIT_ROW",
            LoadProbe::RowDone => "ROW_DONE",
            LoadProbe::Bit => "deserialiser.BIT",
            LoadProbe::Select => "row_scanner.SELECT",
            LoadProbe::Write => "row_scanner.WRITE",
            LoadProbe::MemoryLoad => "MEMORY_LOAD",
        }
    }

    /// Its nets, bit 0 first.
    ///
    /// # Panics
    /// When the netlist has no load path.
    pub fn bus(self, netlist: &Netlist) -> Vec<NetId> {
        top_bus(netlist, self.path())
    }

    /// Its net, or the first of several.
    ///
    /// # Panics
    /// When the netlist has no load path.
    pub(crate) fn net(self, netlist: &Netlist) -> NetId {
        self.bus(netlist)[0]
    }
}

/// Dotted path of the start value at a row and column of [`load_path::with_memories`].
pub fn memory_path(row: usize, col: usize) -> String {
    join([&load_path::memory_name(row, col), Probe::Memory.name()])
}

/// Start values of [`load_path::with_memories`], row-major, bit 0 first.
///
/// # Panics
/// When the netlist is another.
pub fn memories(netlist: &Netlist, rows: usize, cols: usize) -> Vec<Vec<NetId>> {
    let all = (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col)));
    all.map(|(row, col)| top_bus(netlist, &memory_path(row, col)))
        .collect()
}
