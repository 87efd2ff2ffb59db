//! What the gates say before any tape is made: every net's value when the exposure starts, for every start
//! value, and the waveform of the nets that all macropixels share.
//!
//! ```text
//!   Constant   never changes during the exposure, the same for every start value (TYPE, THRESHOLD, resets …)
//!   Static     never changes, but depends on the start value (MEMORY)
//!   Uniform    follows CLK, STOP and ENABLE alone (COUNTER_RESET, STOP_D, HIT_RESET …)
//!   Stream     follows photons and CLK alone, without feedback (SPAD_TIMED, SPAD_EVENT, SHIFT …)
//!   Free       everything else (the counters, LOCAL_STOP, STROBE, HIT …)
//! ```
//!
//! The classes come from the netlist's connections, not from names. Both kinds of values come from the event
//! kernel with real delays, through the pins and with the stimulus of the gate engine: loads and resets are
//! simulated once, and a pulse generator (STOP against its delayed self) is a waveform like any other, which
//! zero delay would lose.

use std::collections::HashMap;

use super::unlevelled::LevelisationError;
use crate::chip::{Exposure, Probes, SensorConfig, SensorPins, Silicon, array};
use crate::engine::{GateSimulation, LaneSimulation};
use crate::kernel::{LANES, Recorder};
use crate::logic::Logic;
use crate::netlist::{CellId, CellKind, FlatCell, MAX_INPUTS, NetId, Netlist, Timing};
use crate::units::Time;

/// What a net depends on during an exposure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Class {
    /// One value for all.
    Constant(bool),
    /// One value for each start value.
    Static,
    /// A waveform for all.
    Uniform,
    /// Photons and CLK, without feedback.
    Stream,
    /// Everything else.
    Free,
}

/// A change of a uniform net.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct UniformEdge {
    /// From the STOP edge of its laser cycle.
    pub time: Time,
    /// Which net.
    pub net: NetId,
    /// To what.
    pub value: bool,
}

/// The netlist of one macropixel with its load path, and what is known of it.
pub(super) struct Survey {
    /// The sensor with one macropixel.
    pub netlist: Netlist,
    /// Its delays.
    pub timing: Timing,
    /// Class of every net.
    pub class: Vec<Class>,
    /// The net that clocks the chip.
    pub clk: NetId,
    /// SPAD_RAW.
    pub spads: Vec<NetId>,
    /// Counter bits of every bin, bit 0 first.
    pub bins: Vec<Vec<NetId>>,
    /// Driver (cell, output) of every net.
    pub driver: Vec<Option<(usize, usize)>>,
    /// Lanes that are 1, and that are 0, of every net, for each 64 start values.
    initial: Vec<Vec<(u64, u64)>>,
}

impl Survey {
    /// Simulates power-up and load of every start value, and sorts the nets.
    pub(super) fn new(config: &SensorConfig, exposure: &Exposure) -> Self {
        let netlist = Netlist::elaborate(&array::subarray(config, (0, 0), (1, 1)));
        let timing = Silicon::new(config).timing(&netlist);
        let bins = Probes::of_macropixel(&netlist, 0, 0).bins().to_vec();
        let pins = SensorPins::find(&netlist);
        let mut driver = vec![None; netlist.net_count()];
        for (index, cell) in netlist.cells().iter().enumerate() {
            for (output, net) in cell.outputs.iter().enumerate() {
                if let Some(net) = net {
                    driver[net.index()] = Some((index, output));
                }
            }
        }
        let mut survey = Survey {
            clk: pins.clk,
            class: vec![Class::Free; netlist.net_count()],
            initial: initial_values(config, exposure, &netlist),
            bins,
            spads: pins.spad_raw.clone(),
            driver,
            timing,
            netlist,
        };
        survey.sort_nets(&pins);
        survey
    }

    /// The value of `net` for a start value when the exposure starts.
    ///
    /// # Errors
    /// When it is unknown.
    pub(super) fn initial(&self, net: NetId, start: u16) -> Result<bool, LevelisationError> {
        let (one, zero) = self.initial[usize::from(start) / LANES][net.index()];
        match (
            one >> (usize::from(start) % LANES) & 1,
            zero >> (usize::from(start) % LANES) & 1,
        ) {
            (1, _) => Ok(true),
            (_, 1) => Ok(false),
            _ => Err(LevelisationError::Unknown(self.name(net))),
        }
    }

    /// The net's path, for messages.
    pub(super) fn name(&self, net: NetId) -> String {
        self.netlist.net_path(net).unwrap_or_else(|| {
            let (cell, _) = self.driver[net.index()].expect("a net has a name or a driver");
            format!(
                "the output of {}",
                self.netlist.cell_path(CellId::new(cell))
            )
        })
    }

    pub(super) fn class(&self, net: NetId) -> Class {
        self.class[net.index()]
    }

    /// Which input pins of a cell can make a difference, given the constants.
    pub(super) fn relevant(&self, cell: &FlatCell) -> [bool; MAX_INPUTS] {
        let constant = cell.inputs.map(|net| match net.map(|net| self.class(net)) {
            // A pin that the cell does not have.
            None => Some(false),
            Some(Class::Constant(value)) => Some(value),
            Some(_) => None,
        });
        let pins = cell.kind.inputs().len();
        std::array::from_fn(|pin| {
            if pin >= pins || constant[pin].is_some() {
                return false;
            }
            cell.kind.is_flip_flop()
                || (0..1u8 << pins).any(|bits| {
                    let fits = |p: usize| constant[p].is_none_or(|c| c == (bits >> p & 1 == 1));
                    (0..pins).all(fits)
                        && output(cell.kind, bits) != output(cell.kind, bits ^ 1 << pin)
                })
        })
    }

    /// The value of `net` when the exposure starts, if it is the same for every start value.
    pub(super) fn shared_initial(&self, net: NetId) -> Option<bool> {
        let net = net.index();
        let full = |word: &dyn Fn(&(u64, u64)) -> u64| {
            self.initial
                .iter()
                .all(|chunk| word(&chunk[net]) == u64::MAX)
        };
        if full(&|w| w.0) {
            Some(true)
        } else if full(&|w| w.1) {
            Some(false)
        } else {
            None
        }
    }

    fn sort_nets(&mut self, pins: &SensorPins) {
        // What edges can reach at all.
        let mut moves = vec![false; self.netlist.net_count()];
        let shared = [pins.clk, pins.stop, pins.enable];
        for net in shared.into_iter().chain(pins.spad_raw.iter().copied()) {
            moves[net.index()] = true;
        }
        let spads = self.spads.clone();
        let cells = self.netlist.cells().to_vec();
        let spread = |flags: &mut Vec<bool>, reaches: &dyn Fn(&FlatCell, &[bool]) -> bool| {
            loop {
                let mut settled = true;
                for cell in &cells {
                    if reaches(cell, flags) {
                        for net in cell.output_nets() {
                            settled &= std::mem::replace(&mut flags[net.index()], true);
                        }
                    }
                }
                if settled {
                    break;
                }
            }
        };
        spread(&mut moves, &|cell, moves| {
            (0..cell.kind.inputs().len())
                .any(|pin| cell.kind.triggers(pin) && moves[cell.input(pin).index()])
        });
        for (net, _) in moves.iter().enumerate().filter(|(_, moves)| !**moves) {
            let shared = self.shared_initial(NetId::new(net));
            self.class[net] = shared.map_or(Class::Static, Class::Constant);
        }

        // What constants make of gates, in as many rounds as it takes.
        loop {
            let mut settled = true;
            for cell in cells.iter().filter(|cell| !cell.kind.is_flip_flop()) {
                let Some(net) = cell.outputs[0].map(NetId::index) else {
                    continue;
                };
                if !matches!(self.class[net], Class::Constant(_))
                    && self.relevant(cell) == [false; MAX_INPUTS]
                {
                    let ones = (0..cell.kind.inputs().len())
                        .filter(|&pin| self.class(cell.input(pin)) == Class::Constant(true));
                    let bits = ones.fold(0, |bits, pin| bits | 1 << pin);
                    self.class[net] = Class::Constant(output(cell.kind, bits));
                    moves[net] = false;
                    settled = false;
                }
            }
            if settled {
                break;
            }
        }

        // What differs between macropixels: whatever starts differently, and whatever photons or such a net can make a
        // difference to.
        let relevant: HashMap<FlatCellKey, [bool; MAX_INPUTS]> =
            cells.iter().map(|c| (key(c), self.relevant(c))).collect();
        let mut differs: Vec<bool> = (0..moves.len())
            .map(|net| self.shared_initial(NetId::new(net)).is_none())
            .collect();
        for net in &spads {
            differs[net.index()] = true;
        }
        spread(&mut differs, &|cell, differs| {
            let relevant = relevant[&key(cell)];
            (0..MAX_INPUTS).any(|pin| relevant[pin] && differs[cell.input(pin).index()])
        });

        // Toggle flip-flops on a SPAD, and everything that CLK and gates make of them.
        let mut stream = vec![false; moves.len()];
        let class = &self.class;
        let off =
            |net: Option<NetId>| net.is_none_or(|net| class[net.index()] == Class::Constant(false));
        spread(&mut stream, &|cell, stream| {
            if cell.kind.is_flip_flop() {
                let (d, ck, [_, _, r, s]) = (cell.input(0), cell.input(1), cell.inputs);
                let toggles = spads.contains(&ck) && Some(d) == cell.outputs[1];
                let samples = ck == self.clk && stream[d.index()];
                return off(r) && off(s) && (toggles || samples);
            }
            let relevant = relevant[&key(cell)];
            let mut inputs = (0..MAX_INPUTS).filter(|&p| relevant[p]).peekable();
            inputs.peek().is_some() && inputs.all(|p| stream[cell.input(p).index()])
        });
        for net in (0..moves.len()).filter(|&net| moves[net]) {
            self.class[net] = match (differs[net], stream[net]) {
                (false, _) => Class::Uniform,
                (true, true) => Class::Stream,
                (true, false) => Class::Free,
            };
        }
    }

    /// Every change of `nets` in the first, a middle and the last laser cycle, and at the STOP edge that ends
    /// the exposure; an exposure of fewer cycles has as many groups as STOP edges.
    pub(super) fn uniform_edges(
        &self,
        config: &SensorConfig,
        exposure: &Exposure,
        nets: &[NetId],
    ) -> Vec<Vec<UniformEdge>> {
        let exposure = Exposure {
            laser_cycles: exposure.laser_cycles.min(3),
            ..*exposure
        };
        let mut gate = GateSimulation::new(config, &exposure, (0, 0), (1, 1), &[0], &[&[]]);
        let mut recorder = Recorder::new(nets.iter().copied());
        gate.run(&mut recorder);
        let origin = gate.schedule().origin;
        let start = before_exposure(origin, &exposure);
        let cycles = i64::from(exposure.laser_cycles);
        let half = Time::from_fs(exposure.clock.period().as_fs() / 2);
        let mut groups = vec![Vec::new(); exposure.laser_cycles as usize + 1];
        for &(time, net, value) in recorder.changes() {
            let Some(value) = value.to_bool().filter(|_| time > start) else {
                continue;
            };
            let time = time - origin;
            let cycle = (0..=cycles)
                .rev()
                .find(|&c| exposure.stop(c) - half <= time)
                .unwrap_or(0);
            let time = time - exposure.stop(cycle);
            groups[cycle as usize].push(UniformEdge { time, net, value });
        }
        groups
    }
}

type FlatCellKey = (CellKind, [Option<NetId>; MAX_INPUTS]);

fn key(cell: &FlatCell) -> FlatCellKey {
    (cell.kind, cell.inputs)
}

/// Output of a gate whose inputs are the bits of `bits`.
pub(super) fn output(kind: CellKind, bits: u8) -> bool {
    let inputs = std::array::from_fn(|pin| Logic::from(bits >> pin & 1 == 1));
    kind.output(inputs) == Logic::One
}

/// An instant after the load, before the first edge of the exposure.
fn before_exposure(origin: Time, exposure: &Exposure) -> Time {
    origin - exposure.stop_phase.max(Time::ZERO) - Time::from_ps(1)
}

fn initial_values(
    config: &SensorConfig,
    exposure: &Exposure,
    netlist: &Netlist,
) -> Vec<Vec<(u64, u64)>> {
    let exposure = Exposure {
        stop_periods: 2,
        laser_cycles: 1,
        ..*exposure
    };
    let starts: Vec<u16> = (0..=config.largest_start()).collect();
    let chunks = starts.chunks(LANES).map(|starts| {
        let dark = vec![&[][..]; starts.len()];
        let mut lanes = LaneSimulation::new(config, &exposure, starts, &dark);
        lanes.run_until(before_exposure(lanes.schedule().origin, &exposure), &mut ());
        // Lanes that are not used repeat the first one.
        let used = if starts.len() == LANES {
            u64::MAX
        } else {
            (1 << starts.len()) - 1
        };
        let fill = |word: u64| {
            if word & 1 == 1 {
                word | !used
            } else {
                word & used
            }
        };
        let nets = (0..netlist.net_count()).map(|net| {
            let value = lanes.kernel.value(NetId::new(net));
            (fill(value.one), fill(value.zero))
        });
        nets.collect()
    });
    chunks.collect()
}
