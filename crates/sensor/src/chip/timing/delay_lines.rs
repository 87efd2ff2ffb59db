//! Delay lines of every macropixel, measured: when an edge of PHOTONS comes to each tap.
//!
//! The METDC alone is enough for that, with the delays its cells have at their place in the array. Lines are kept from one
//! [`Sensor`](crate::chip::Sensor) of a description to the next: measuring those of an array of 64×32 takes some tenths of a second, and a drive
//! makes sensors for every frame.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::silicon::Silicon;
use crate::chip::config::SensorConfig;
use crate::chip::metdc_delay_line::Elements;
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
    silicon: Silicon,
    cols: usize,
    of_macropixel: Box<[OnceLock<Taps>]>,
}

/// What delay lines depend on.
#[derive(Debug, Clone, PartialEq)]
struct Lines {
    bins: usize,
    elements: Elements,
    rows: usize,
    cols: usize,
    silicon: Silicon,
}

/// Arrays whose lines are kept: the chip as it is, without differences, and some others.
const KEPT: usize = 8;

impl DelayLines {
    /// Those of a sensor whose TDC has some, perhaps measured before.
    pub(crate) fn measured(config: &SensorConfig, silicon: &Silicon) -> Arc<Self> {
        static MEASURED: Mutex<Vec<(Lines, Arc<DelayLines>)>> = Mutex::new(Vec::new());
        let lines = Lines {
            bins: config.bins,
            elements: config.delay_elements(),
            rows: config.rows,
            cols: config.cols,
            silicon: *silicon,
        };
        let mut measured = MEASURED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, known)) = measured.iter().find(|(other, _)| *other == lines) {
            return Arc::clone(known);
        }
        let new = Arc::new(Self::new(config, *silicon));
        if measured.len() == KEPT {
            measured.remove(0);
        }
        measured.push((lines, Arc::clone(&new)));
        new
    }

    fn new(config: &SensorConfig, silicon: Silicon) -> Self {
        let metdc = metdc_delay_line::circuit(config.bins, &config.delay_elements());
        DelayLines {
            netlist: Netlist::elaborate(&metdc),
            silicon,
            cols: config.cols,
            of_macropixel: (0..config.pixels()).map(|_| OnceLock::new()).collect(),
        }
    }

    /// Those of a macropixel, by its number in the array, row-major.
    pub(crate) fn taps(&self, number: usize) -> Taps {
        let measured = || self.measure((number / self.cols, number % self.cols));
        match self.of_macropixel.get(number) {
            Some(known) => Arc::clone(known.get_or_init(measured)),
            None => measured(),
        }
    }

    fn measure(&self, (row, col): (usize, usize)) -> Taps {
        let Self {
            netlist, silicon, ..
        } = self;
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
