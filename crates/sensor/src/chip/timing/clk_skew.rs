//! By how much CLK, STOP and RUN come later to a column of macropixels than to column 0: the delay of the array's
//! wires, measured in the sensor's silicon. Everyone who needs it asks
//! [`Sensor::clk_skew`](crate::chip::Sensor::clk_skew).

use super::silicon::Silicon;
use crate::chip::SensorConfig;
use crate::chip::array;
use crate::netlist::{Edge, Netlist, StaticTiming};
use crate::units::Time;

/// That of one column.
pub(crate) fn clk_skew(config: &SensorConfig, silicon: &Silicon, col: usize) -> Time {
    let Some(wire) = array::clk_wire(config, col) else {
        return Time::ZERO;
    };
    let netlist = Netlist::elaborate(&wire);
    let timing = silicon.timing(&netlist);
    let analysis = StaticTiming::new(&netlist, &timing);
    let starts = Edge::BOTH.map(|edge| (netlist.inputs()[0], edge));
    let arrivals = analysis.arrivals(&starts, &[]).expect("a wire has no loop");
    let end = netlist.cells()[0].outputs[0];
    let window = end.and_then(|end| arrivals.window(end));
    window.expect("a wire connects").1
}
