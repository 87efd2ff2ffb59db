//! What a netlist must be to stand in a built-in block's place: [`CONTRACTS`], a row for each block that can be replaced.
//!
//! Ports are those of the built-in block of the same sensor. Behind them, edges must go where delays are measured: what a row's
//! `flaw` finds missing there is said before anything is built. Gates that make a loop are refused; in a histogram, which nothing
//! is measured behind, flip-flops may be part of one, as where a full bin blocks its own clock.

use std::sync::Arc;

use super::block::OwnBlock;
use super::law::MOST_CELLS;
use crate::chip::config::{SensorConfig, Tdc};
use crate::chip::probes::{Probe, Probes, reached};
use crate::chip::timing::silicon::Silicon;
use crate::chip::{correlation, front_end, histogram, metdc};
use crate::netlist::{
    Arrivals, CellId, Corner, Direction, Edge, FlatCell, Module, NetId, Netlist, ScopeId,
    StaticTiming,
};

/// What a block's netlist must be.
pub(crate) struct Contract {
    /// Its name on the command line, and in the macropixel.
    pub name: &'static str,
    /// Its key in sensor files.
    pub key: &'static str,
    pub own: fn(&SensorConfig) -> Option<&OwnBlock>,
    pub own_mut: fn(&mut SensorConfig) -> Option<&mut OwnBlock>,
    /// Whose ports it must have.
    built_in: fn(&SensorConfig) -> Arc<Module>,
    /// What a sensor has instead where delay lines time photons, if that leaves no place for it.
    delay_lines: Option<&'static str>,
    /// What it does not do.
    flaw: fn(&CheckedBlock<'_>) -> Option<String>,
    /// Whether a window law says what it counts.
    has_law: bool,
    /// Whether loops may lead through flip-flops.
    may_loop: bool,
}

macro_rules! contract {
    ($name:literal, $key:ident, $($rest:tt)*) => {
        Contract {
            name: $name,
            key: stringify!($key),
            own: |config| config.$key.as_ref(),
            own_mut: |config| config.$key.as_mut(),
            $($rest)*
        }
    };
}

/// Every block that can be replaced.
pub(crate) const CONTRACTS: [Contract; 5] = [
    contract! { "p_counter", p_counter_block,
        built_in: |config| (config.p_counter.row().circuit)(config),
        delay_lines: None, flaw: p_counter, has_law: true, may_loop: false,
    },
    contract! { "correlation", correlation_block,
        built_in: |config| correlation::circuit(config.lines()),
        delay_lines: Some("correlates nothing"), flaw: correlation, has_law: false, may_loop: false,
    },
    contract! { "front_end", front_end_block,
        built_in: front_end::circuit,
        delay_lines: Some("has a photon line"), flaw: front_end, has_law: false, may_loop: false,
    },
    contract! { "metdc", metdc_block,
        built_in: |config| metdc::circuit(config.bins),
        delay_lines: Some("samples delay lines"), flaw: metdc, has_law: false, may_loop: false,
    },
    contract! { "histogram", histogram_block,
        built_in: |config| histogram::circuit(config.bins, config.bin_bits, config.overflow),
        delay_lines: None, flaw: histogram, has_law: false, may_loop: true,
    },
];

impl SensorConfig {
    /// The key of a block of one's own that no window law describes.
    pub(crate) fn lawless_block(&self) -> Option<&'static str> {
        let mut lawless = CONTRACTS.iter().filter(|contract| !contract.has_law);
        let found = lawless.find(|contract| (contract.own)(self).is_some());
        found.map(|contract| contract.key)
    }

    /// Whether a window law may describe it: no block of its own stands in the way.
    pub fn may_have_law(&self) -> bool {
        let law = self.counter_law();
        self.lawless_block().is_none() && law.is_none_or(|law| law.uneven().is_none())
    }

    /// Its own blocks that have been read: name on the command line, file, and what tells netlists apart.
    pub fn own_files(&self) -> impl Iterator<Item = (&'static str, &OwnBlock)> {
        let own = CONTRACTS
            .iter()
            .map(|contract| (contract.name, (contract.own)(self)));
        own.filter_map(|(name, block)| Some((name, block?)))
    }

    /// What tells the netlists of its own blocks apart.
    pub fn own_hashes(&self) -> [Option<u64>; CONTRACTS.len()] {
        CONTRACTS
            .each_ref()
            .map(|contract| (contract.own)(self)?.hash())
    }
}

/// Names of the blocks that can be replaced.
pub fn replaceable() -> impl Iterator<Item = &'static str> {
    CONTRACTS.iter().map(|contract| contract.name)
}

/// A netlist in question.
struct CheckedBlock<'n> {
    netlist: &'n Netlist,
    probes: Probes,
    paths: &'n StaticTiming<'n>,
}

impl<'n> CheckedBlock<'n> {
    fn arrivals_after(&self, from: &[NetId], edges: &[Edge]) -> Arrivals<'n> {
        let starts = from
            .iter()
            .flat_map(|&net| edges.iter().map(move |&edge| (net, edge)));
        let starts: Vec<(NetId, Edge)> = starts.collect();
        self.paths.arrivals(&starts, &[]).expect("there is no loop")
    }
}

impl Contract {
    /// Whether the sensor's own block, if it has one, can be this one.
    ///
    /// # Errors
    /// What is missing, what is too much, and what differs.
    pub(in crate::chip) fn check(&self, config: &SensorConfig) -> Result<(), String> {
        let Some(own) = (self.own)(config) else {
            return Ok(());
        };
        match self.delay_lines {
            Some(instead) if config.tdc == Tdc::DelayLine => {
                return Err(format!(
                    "{} is impossible with tdc = \"delay_line\", which {instead}; leave it out",
                    self.key
                ));
            }
            _ => self.holds(own, &(self.built_in)(config))?,
        }
        // Where a law is measured once, nothing may change it afterwards.
        let state = self.has_law.then(|| own.hidden_state(config)).flatten();
        match (state, own.module()) {
            (Some(state), Some(module)) => {
                let file = own.file().display();
                Err(format!("{file}: module {} {state}", module.name()))
            }
            _ => Ok(()),
        }
    }

    /// Whether this netlist can stand in the place of `built_in`.
    pub(super) fn holds(&self, own: &OwnBlock, built_in: &Module) -> Result<(), String> {
        let file = own.file().display();
        let Some(module) = own.module() else {
            return Err(format!(
                "{file} has not been read; give it in a sensor file"
            ));
        };
        let name = module.name();
        let faults = misfits(module, built_in);
        if !faults.is_empty() {
            return Err(format!(
                "{file}: module {name} has other ports than {}: {}",
                self.name,
                faults.join(", ")
            ));
        }
        let cells = module.total_cells();
        if cells > MOST_CELLS {
            return Err(format!(
                "{file}: module {name} has {cells} cells, of which a block has at most {MOST_CELLS}; give one block"
            ));
        }
        let netlist = Netlist::elaborate(module);
        let timing = Silicon::nominal(Corner::Typ).timing(&netlist);
        let paths = &StaticTiming::new(&netlist, &timing);
        let mut starts = netlist.inputs();
        if self.may_loop {
            let flip_flops = netlist
                .cells()
                .iter()
                .filter(|cell| cell.kind.is_flip_flop());
            starts.extend(flip_flops.flat_map(FlatCell::output_nets));
        }
        let starts: Vec<_> = starts
            .into_iter()
            .flat_map(|n| Edge::BOTH.map(|e| (n, e)))
            .collect();
        if let Err(found) = paths.arrivals(&starts, &[]) {
            return Err(format!(
                "{file}: module {name} has a loop of gates at {}, where time cannot be added up; break it with a flip-flop",
                found.path
            ));
        }
        let (netlist, probes) = (&netlist, Probes::of_block(&netlist));
        match (self.flaw)(&CheckedBlock {
            netlist,
            probes,
            paths,
        }) {
            None => Ok(()),
            Some(flaw) => Err(format!("{file}: module {name} {flaw}")),
        }
    }
}

fn p_counter(found: &CheckedBlock<'_>) -> Option<String> {
    let clk = found.probes.net(Probe::CounterClk);
    let after = found.arrivals_after(&[clk], &[Edge::Rise]);
    let mut cells = found.netlist.cells().iter();
    let counts = cells.any(|cell| {
        let is_clocked = cell.kind.is_flip_flop() && cell.input(1) == clk;
        is_clocked && after.window(cell.input(0)).is_some()
    });
    let stop = found.probes.net(Probe::LocalStop);
    let stops = after.edge_window(stop, Edge::Rise).is_some();
    let flaw = "does not count rising edges of COUNTER_CLK up to LOCAL_STOP; clock it with posedge COUNTER_CLK";
    if !counts || !stops {
        return Some(flaw.to_owned());
    }
    // Its timing would have no path behind a reset that is cut at its start.
    let reset = found.probes.net(Probe::CounterReset);
    let mut flip_flops = (found.netlist.cells().iter()).filter(|cell| cell.kind.is_flip_flop());
    if flip_flops.any(|cell| cell.input(1) == reset) {
        return Some("clocks a flip-flop with COUNTER_RESET; reset it by that instead".to_owned());
    }
    None
}

fn correlation(found: &CheckedBlock<'_>) -> Option<String> {
    let after = found.arrivals_after(found.probes.bus(Probe::SpadTimed), &Edge::BOTH);
    let changes = after.window(found.probes.net(Probe::SpadEvent)).is_some();
    let flaw = "has a SPAD_EVENT that no SPAD_TIMED changes; make it of gates behind them";
    (!changes).then(|| flaw.to_owned())
}

fn front_end(found: &CheckedBlock<'_>) -> Option<String> {
    let CheckedBlock {
        netlist, probes, ..
    } = found;
    let samplers: Vec<CellId> = probes.samplers(netlist).collect();
    let is_sampled = |raw: &NetId| {
        let reached = reached(netlist, netlist.cells_below(ScopeId::TOP), &[*raw]);
        let mut data = samplers
            .iter()
            .map(|&cell| netlist.cells()[cell.index()].input(0));
        data.any(|net| reached.contains(&net))
    };
    if let Some(spad) = probes
        .bus(Probe::SpadRaw)
        .iter()
        .position(|raw| !is_sampled(raw))
    {
        return Some(format!(
            "has a SPAD_RAW[{spad}] that no flip-flop samples; take it, or what it toggles, with posedge CLK"
        ));
    }
    let after = found.arrivals_after(&[probes.net(Probe::Clk)], &[Edge::Rise]);
    let mut lines = probes.bus(Probe::SpadTimed).iter();
    let line = lines.position(|&line| after.window(line).is_none())?;
    Some(format!(
        "has a SPAD_TIMED[{line}] that CLK does not change; make it of flip-flops with posedge CLK"
    ))
}

/// Where an edge must lead to in a METDC: pins of the HIT flip-flops, and what becomes of them, if not any change.
const TO_HIT: [(Probe, Edge, usize, Option<Edge>); 6] = [
    (Probe::LocalStop, Edge::Rise, 1, Some(Edge::Rise)),
    (Probe::StopD, Edge::Rise, 1, Some(Edge::Rise)),
    (Probe::CounterReset, Edge::Rise, 2, Some(Edge::Rise)),
    (Probe::CounterReset, Edge::Fall, 2, Some(Edge::Fall)),
    (Probe::Stop, Edge::Rise, 2, Some(Edge::Fall)),
    (Probe::Clk, Edge::Rise, 0, None),
];

fn metdc(found: &CheckedBlock<'_>) -> Option<String> {
    let CheckedBlock {
        netlist, probes, ..
    } = found;
    let cells = probes.find_hit_cells(netlist).unwrap_or_default();
    let mut cells = cells
        .into_iter()
        .map(|cell| &netlist.cells()[cell.index()])
        .peekable();
    let Some(first) = cells.peek().copied() else {
        return Some("has a HIT that no flip-flop drives, whose glitches would be counted; make each bit of it one flip-flop's output".to_owned());
    };
    let hits: Vec<_> = cells.collect();
    if hits.iter().any(|hit| hit.inputs[1..] != first.inputs[1..]) {
        return Some(
            "has HIT flip-flops of several clocks or resets; give them one of each".to_owned(),
        );
    }
    TO_HIT.into_iter().find_map(|(from, edge, pin, to)| {
        let after = found.arrivals_after(&[probes.net(from)], &[edge]);
        let leads = |cell: &&FlatCell| match to {
            Some(to) => after.edge_window(cell.input(pin), to).is_some(),
            None => after.window(cell.input(pin)).is_some(),
        };
        let words = |edge| match edge {
            Edge::Rise => "rises",
            Edge::Fall => "falls",
        };
        let to = to.map_or("changes", words);
        let pin = ["data", "clock", "reset"][pin];
        let cure = "LOCAL_STOP or, where CONVENTIONAL is high, STOP_D is HIT's clock, COUNTER_RESET or NOT STOP its reset";
        (!hits.iter().all(leads)).then(|| format!("has a HIT whose {pin} never {to} when {} {}; {cure}", from.name(), words(edge)))
    })
}

fn histogram(found: &CheckedBlock<'_>) -> Option<String> {
    let netlist = found.netlist;
    let reached = reached(
        netlist,
        netlist.cells_below(ScopeId::TOP),
        found.probes.bus(Probe::Hit),
    );
    let outputs = netlist.scopes()[0].module.port_signals();
    let mut outputs = outputs.filter(|(direction, _)| *direction == Direction::Output);
    let is_still = |name: &str| {
        let nets = netlist.signal(name).unwrap_or_default();
        !nets.iter().any(|net| reached.contains(net))
    };
    let (_, bin) = outputs.find(|(_, bin)| is_still(&bin.name))?;
    Some(format!(
        "has a {} that no HIT changes; count its rising edges with posedge HIT",
        bin.name
    ))
}

/// What is wrong with the ports of `own` in the place of `built_in`.
fn misfits(own: &Module, built_in: &Module) -> Vec<String> {
    let word = |direction| match direction {
        Direction::Input => "input",
        Direction::Output => "output",
    };
    let bits = |width| {
        if width == 1 {
            "1 bit".to_owned()
        } else {
            format!("{width} bits")
        }
    };
    let mut faults = Vec::new();
    for (direction, wanted) in built_in.port_signals() {
        let mut ports = own.port_signals();
        let (name, width) = (&wanted.name, wanted.width());
        match ports.find(|(_, port)| port.name == *name) {
            None => faults.push(format!(
                "{} {name} of {} is missing",
                word(direction),
                bits(width)
            )),
            Some((found, _)) if found != direction => {
                faults.push(format!(
                    "{name} is an {} instead of an {}",
                    word(found),
                    word(direction)
                ));
            }
            Some((_, port)) if port.width() != width => {
                faults.push(format!(
                    "{name} has {} instead of {width}",
                    bits(port.width())
                ));
            }
            Some(_) => {}
        }
    }
    for (direction, port) in own.port_signals() {
        if !built_in
            .port_signals()
            .any(|(_, wanted)| wanted.name == port.name)
        {
            faults.push(format!("{} {} is too much", word(direction), port.name));
        }
    }
    faults
}
