//! Loads a whole array at gate level: serial bits into the netlist of deserialiser, row scanner and memories.

use crate::chip::{LoadPins, SensorConfig, Silicon, load_path, probes};
use crate::kernel::{Kernel, Observer, Statistics};
use crate::netlist::Netlist;
use crate::stimulus::load_stimulus;
use crate::units::Time;

/// What the load path did with a set of start values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Load {
    /// Start values in the memories, row-major; `None` where a bit is unknown.
    pub starts: Vec<Option<u16>>,
    /// From the falling edge of LOAD_CLK that brings the first bit to the end of the load.
    pub duration: Time,
    /// What the simulation did.
    pub statistics: Statistics,
}

/// Sends `starts` (row-major, one for every macropixel), as their codes where the P-counter has such, through the serial pin; `observer` sees the netlist
/// that `netlist` elaborates.
pub fn load(
    config: &SensorConfig,
    netlist: &Netlist,
    starts: &[u16],
    observer: &mut dyn Observer,
) -> Load {
    debug_assert_eq!(starts.len(), config.pixels());
    let codes = config.load_codes(starts);
    let stream = load_path::stream(&codes, config.cols, config.counter_bits);
    let (end, mut stimulus) = load_stimulus(LoadPins::find(netlist), config.load_clock(), &stream);
    let timing = Silicon::new(config).timing(netlist);
    let mut kernel = Kernel::new(netlist, &timing);
    let settled = end + config.load_clock().periods(1);
    kernel
        .run(&mut stimulus, settled, observer)
        .expect("no loop of cells without delay");
    let memories = probes::memories(netlist, config.rows, config.cols);
    let start = |nets: &Vec<_>| {
        let code = kernel.number(nets)? as u16;
        Some(config.start_of_code(code))
    };
    Load {
        starts: memories.iter().map(start).collect(),
        duration: config.load_time(),
        statistics: kernel.statistics(),
    }
}

/// The load path of this sensor, elaborated.
pub fn load_netlist(config: &SensorConfig) -> Netlist {
    Netlist::elaborate(&load_path::with_memories(
        config.rows,
        config.cols,
        config.counter_bits,
    ))
}
