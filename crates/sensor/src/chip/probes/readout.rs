//! Where the nets of the readout are, in a sensor or behind counts alone.

use super::top_bus;
use crate::netlist::{NetId, Netlist};

/// A net or bus of the readout, in a sensor or in [`readout::with_counts`](crate::chip::readout::with_counts).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadProbe {
    /// READ_CLK.
    Clk,
    /// READ_ENABLE.
    Enable,
    /// RESETB.
    ResetB,
    /// READ_RESET.
    Reset,
    /// The bit counter of the scanner.
    Bit,
    /// ROW_READ, one bit a row.
    Row,
    /// BIN_READ, one bit a bin.
    Bin,
    /// WORD_LOAD, which lets serialisers take what is on the columns.
    WordLoad,
    /// WORD of every macropixel, row-major.
    Word,
    /// COLUMN, the words of the selected row; an array of one row has WORD instead.
    Column,
    /// The pins that stand for the histograms in [`readout::with_counts`](crate::chip::readout::with_counts); a sensor has none.
    Count,
    /// DATA_OUT, one bit a pin.
    DataOut,
}

impl ReadProbe {
    /// Dotted path below the top.
    pub const fn path(self) -> &'static str {
        match self {
            ReadProbe::Clk => "READ_CLK",
            ReadProbe::Enable => "READ_ENABLE",
            ReadProbe::ResetB => "RESETB",
            ReadProbe::Reset => "READ_RESET",
            ReadProbe::Bit => "readout_scanner.BIT",
            ReadProbe::Row => "ROW_READ",
            ReadProbe::Bin => "BIN_READ",
            ReadProbe::WordLoad => "WORD_LOAD",
            ReadProbe::Word => "WORD",
            ReadProbe::Column => "COLUMN",
            ReadProbe::Count => "COUNT",
            ReadProbe::DataOut => "DATA_OUT",
        }
    }

    /// Its nets, bit 0 first.
    ///
    /// # Panics
    /// When the netlist has no such net.
    pub(crate) fn bus(self, netlist: &Netlist) -> Vec<NetId> {
        top_bus(netlist, self.path())
    }

    /// Its net, or the first of several.
    ///
    /// # Panics
    /// When the netlist has no such net.
    pub fn net(self, netlist: &Netlist) -> NetId {
        self.bus(netlist)[0]
    }
}
