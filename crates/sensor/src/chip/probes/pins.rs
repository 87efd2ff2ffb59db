//! The sensor's pins, for code that drives them.

use super::{LoadProbe, ReadProbe, top_bus};
use crate::netlist::{NetId, Netlist};

/// The pins that start values come in through.
#[derive(Debug, Clone, Copy)]
pub struct LoadPins {
    /// RESETB.
    pub resetb: NetId,
    /// LOAD_CLK.
    pub clk: NetId,
    /// LOAD_ENABLE.
    pub enable: NetId,
    /// COUNTER_INITS.
    pub serial: NetId,
}

impl LoadPins {
    /// Finds the pins of an elaborated load path or sensor.
    ///
    /// # Panics
    /// When the netlist is neither.
    pub fn find(netlist: &Netlist) -> Self {
        LoadPins {
            resetb: top_bus(netlist, "RESETB")[0],
            clk: LoadProbe::Clk.net(netlist),
            enable: LoadProbe::Enable.net(netlist),
            serial: LoadProbe::Serial.net(netlist),
        }
    }
}

/// The pins that counts leave through.
#[derive(Debug, Clone)]
pub struct ReadPins {
    /// READ_CLK.
    pub clk: NetId,
    /// READ_ENABLE.
    pub enable: NetId,
    /// DATA_OUT, a net a serialiser.
    pub data: Vec<NetId>,
}

impl ReadPins {
    /// Finds the pins of an elaborated readout or sensor.
    ///
    /// # Panics
    /// When the netlist is neither.
    pub fn find(netlist: &Netlist) -> Self {
        ReadPins {
            clk: ReadProbe::Clk.net(netlist),
            enable: ReadProbe::Enable.net(netlist),
            data: ReadProbe::DataOut.bus(netlist),
        }
    }
}

/// The sensor's pins.
#[derive(Debug, Clone)]
pub struct SensorPins {
    /// Those of the load path.
    pub load: LoadPins,
    /// Those of the readout.
    pub read: ReadPins,
    /// CLK.
    pub clk: NetId,
    /// STOP.
    pub stop: NetId,
    /// ENABLE.
    pub enable: NetId,
    /// HISTOGRAM_CLEAR.
    pub histogram_clear: NetId,
    /// CONVENTIONAL.
    pub conventional: NetId,
    /// TYPE, bit 0 first.
    pub event_type: Vec<NetId>,
    /// THRESHOLD, bit 0 first.
    pub threshold: Vec<NetId>,
    /// SPAD_RAW, a net a SPAD, macropixels row-major.
    pub spad_raw: Vec<NetId>,
    /// LOCAL_STOP, a net a macropixel, row-major.
    pub local_stop: Vec<NetId>,
}

impl SensorPins {
    /// Finds the pins of an elaborated sensor.
    ///
    /// # Panics
    /// When the netlist is no sensor.
    pub fn find(netlist: &Netlist) -> Self {
        let bus = |name| top_bus(netlist, name);
        let pin = |name| bus(name)[0];
        SensorPins {
            load: LoadPins::find(netlist),
            read: ReadPins::find(netlist),
            clk: pin("CLK"),
            stop: pin("STOP"),
            enable: pin("ENABLE"),
            histogram_clear: pin("HISTOGRAM_CLEAR"),
            conventional: pin("CONVENTIONAL"),
            event_type: bus("TYPE"),
            threshold: bus("THRESHOLD"),
            spad_raw: bus("SPAD_RAW"),
            local_stop: bus("LOCAL_STOP"),
        }
    }
}
