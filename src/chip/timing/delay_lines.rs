//! Delay lines of every macropixel, measured: when an edge of PHOTONS comes to each tap.
//!
//! The METDC alone is enough for that, with the delays its cells have at their place in the array.

use std::sync::{Arc, OnceLock};

use super::silicon::Silicon;
use crate::chip::config::SensorConfig;
use crate::chip::{Probe, Probes, array, metdc_delay_line};
use crate::netlist::{Edge, NetId, Netlist, StaticTiming};
use crate::units::Time;

/// Taps of a macropixel's lines, the even one first: each with a tap more than there are bins, whose first is PHOTONS itself; times
/// after an edge of PHOTONS, rising.
pub(crate) type Taps = Arc<[Vec<Time>]>;

/// The delay lines of an array. Each macropixel's are measured when they are first asked for.
#[derive(Debug)]
pub(crate) struct DelayLines {
    netlist: Netlist,
    cols: usize,
    of_macropixel: Box<[OnceLock<Taps>]>,
}

impl DelayLines {
    /// Those of a sensor whose TDC has some.
    pub(crate) fn new(config: &SensorConfig) -> Self {
        let metdc = metdc_delay_line::circuit(config.bins, &config.delay_elements());
        DelayLines {
            netlist: Netlist::elaborate(&metdc),
            cols: config.cols,
            of_macropixel: (0..config.pixels()).map(|_| OnceLock::new()).collect(),
        }
    }

    /// Those of a macropixel, by its number in the array, row-major.
    pub(crate) fn taps(&self, silicon: &Silicon, number: usize) -> Taps {
        let measured = || self.measure(silicon, (number / self.cols, number % self.cols));
        let known = self.of_macropixel.get(number);
        Arc::clone(known.map_or(&measured(), |known| known.get_or_init(measured)))
    }

    fn measure(&self, silicon: &Silicon, (row, col): (usize, usize)) -> Taps {
        let netlist = &self.netlist;
        let path = |cell| {
            let macropixel = array::pixel_name(row, col);
            format!("{}.{macropixel}.{}", array::NAME, netlist.cell_path(cell))
        };
        let timing = silicon.timing_as(netlist, path);
        let analysis = StaticTiming::new(netlist, &timing);
        let probes = Probes::of_block(netlist);
        let starts = Edge::BOTH.map(|edge| (probes.net(Probe::Photons), edge));
        let arrivals = analysis.arrivals(&starts, &[]).expect("a line has no loop");
        let when = |&tap: &NetId| arrivals.window(tap).expect("elements connect taps").1;
        let line = |taps| {
            let taps = probes.bus(taps).iter().map(when);
            std::iter::once(Time::ZERO).chain(taps).collect()
        };
        [Probe::EvenTap, Probe::OddTap].map(line).into()
    }
}
