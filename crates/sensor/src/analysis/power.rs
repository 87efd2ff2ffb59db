//! Switching power: what the toggles of a gate-level run charge, block by block.
//!
//! ```text
//!   Activity (toggles of every net) ─┐
//!   Capacitances ────────────────────┴─► energy of each cell ─► its block
//! ```
//!
//! A toggle of a net with capacitance C takes ½·C·V² from the supply on average: C·V² for a rise, nothing for a fall. Of a
//! net's capacitance each input pin on it belongs to the block that the pin is in, with its piece of wire, and the driver's
//! own drains and inner nodes to the driver's block. So the blocks add up to the whole, and a block pays for the load that
//! it puts on the clock. Not in it: leakage, short-circuit currents, the clock's tree and long wires, SPADs and their quenching.
//!
//! Capacitances stand for a 40 nm logic process like the delays do (`netlist/library`): about those of the smallest cells of
//! open libraries of that generation, a femtofarad or two a pin. The thesis gives none. Shares and ratios depend little on
//! them, absolute figures in proportion. With a Liberty file the same toggles are charged by its tables, too ([`BlockSilicon`]).

use crate::chip::{CellLibrary, Exposure, SensorConfig};
use crate::engine::GateSimulation;
use crate::kernel::{Activity, NetActivity};
use crate::netlist::{CellId, CellKind, NetId, Netlist, ScopeId};
use crate::photon::SpadEvent;

/// What is charged, and to what voltage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capacitances {
    /// Supply, V.
    pub supply_v: f64,
    /// Gates of one n and one p transistor, F.
    pub pair_f: f64,
    /// Wire to one input pin, F.
    pub wire_f: f64,
    /// Drains at an output, F.
    pub drain_f: f64,
}

impl Default for Capacitances {
    /// 1.1 V, the core voltage of 40 nm processes; 1 fF a pair, 1 fF of wire a pin (some 5 µm), 0.6 fF of drains: chosen.
    fn default() -> Self {
        Capacitances {
            supply_v: 1.1,
            pair_f: 1e-15,
            wire_f: 1e-15,
            drain_f: 0.6e-15,
        }
    }
}

/// Transistor pairs whose gates an input pin drives. A flip-flop's clock drives its inner inverters and transmission
/// gates, half of its 24 transistors; a multiplexer's select both of its transmission gates.
const fn pin_pairs(kind: CellKind, pin: usize) -> u32 {
    match (kind, pin) {
        (CellKind::Dffr | CellKind::Dffsr, 1) => 6,
        (CellKind::Dffr | CellKind::Dffsr, 2 | 3) => 2,
        (CellKind::Mux2, 2) | (CellKind::Xor2 | CellKind::Xnor2, _) => 2,
        _ => 1,
    }
}

/// Transistor pairs at nodes within a cell that change with its output: the inverter behind an AND's NAND, a flip-flop's
/// two latches.
const fn inner_pairs(kind: CellKind) -> u32 {
    match kind {
        CellKind::Buf | CellKind::And2 | CellKind::Or2 => 1,
        CellKind::Xor2 | CellKind::Xnor2 => 1,
        CellKind::Dffr => 4,
        CellKind::Dffsr => 6,
        CellKind::Inv | CellKind::Nand2 | CellKind::Nor2 | CellKind::Mux2 => 0,
    }
}

impl Capacitances {
    /// Energy of what a cell's pins and inner nodes did, J.
    fn cell_j(&self, netlist: &Netlist, cell: CellId, nets: &[NetActivity]) -> f64 {
        let cell = &netlist.cells()[cell.index()];
        let toggles = |net: NetId| nets[net.index()].toggles as f64;
        let pins = cell.input_nets().enumerate();
        let of_pin = |(pin, net): (usize, _)| {
            toggles(net) * (f64::from(pin_pairs(cell.kind, pin)) * self.pair_f + self.wire_f)
        };
        let inputs: f64 = pins.map(of_pin).sum();
        // A flip-flop's outputs change together, and its latches with them.
        let outputs = cell.outputs.map(|net| net.map_or(0.0, toggles));
        let changes = outputs.iter().copied().fold(0.0, f64::max);
        let inner = f64::from(inner_pairs(cell.kind)) * self.pair_f * changes;
        let drains = self.drain_f * outputs.iter().sum::<f64>();
        0.5 * self.supply_v * self.supply_v * (inputs + inner + drains)
    }

    /// Energy of a scope of the netlist and all below it, J.
    pub(crate) fn scope_j(&self, netlist: &Netlist, scope: ScopeId, nets: &[NetActivity]) -> f64 {
        let cells = netlist.cells_below(scope);
        cells.map(|cell| self.cell_j(netlist, cell, nets)).sum()
    }

    /// Energy of each block directly below a scope, J, by its name.
    pub(crate) fn blocks_j(
        &self,
        netlist: &Netlist,
        scope: ScopeId,
        nets: &[NetActivity],
    ) -> Vec<(String, f64)> {
        let block = |scope: ScopeId| {
            let name = netlist.scopes()[scope.index()].name.clone();
            (name, self.scope_j(netlist, scope, nets))
        };
        netlist.children(scope).map(block).collect()
    }
}

/// What the blocks of a macropixel take in an exposure.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct MacropixelPower {
    /// Energy of each block in a laser cycle, J, by the name of its instance.
    pub blocks_j: Vec<(String, f64)>,
    /// Toggles of all nets of the macropixel in a laser cycle.
    pub toggles: f64,
    /// A laser cycle, s.
    pub cycle_s: f64,
    /// The same blocks in a library's cells, the whole last; none with the built-in cells.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub silicon: Vec<BlockSilicon>,
}

/// A block in a library's cells.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct BlockSilicon {
    /// Name of its instance.
    pub block: String,
    /// In the library's unit, which for most is µm².
    pub area: f64,
    /// W.
    pub leakage_w: f64,
    /// Energy within its cells in a laser cycle, by the library's `internal_power`, J.
    pub internal_j: f64,
    /// Energy of what its cells' outputs drive in a laser cycle, J: pins and `wire_ff` at the library's voltage.
    pub loads_j: f64,
}

impl MacropixelPower {
    /// Simulates macropixel (0, 0) with this start value and these SPAD pulses at gate level, and charges what toggles from
    /// the first STOP edge on.
    pub fn simulate(
        config: &SensorConfig,
        exposure: &Exposure,
        start: u16,
        pulses: &[SpadEvent],
        capacitances: &Capacitances,
    ) -> Self {
        let mut gate = GateSimulation::new(config, exposure, (0, 0), (1, 1), &[start], &[pulses]);
        let netlist = gate.netlist().clone();
        let origin = gate.schedule().origin;
        // CLK's first fall comes with STOP, or half a period before it.
        let from = origin - exposure.clock.period();
        let mut activity = Activity::new(&netlist, from);
        gate.run(&mut activity);
        let nets = activity.net_activity(gate.now());
        let scope = netlist.scope(gate.probes()[0].macropixel());
        let scope = scope.expect("the simulation has a macropixel");
        let cycles = f64::from(exposure.laser_cycles);
        let blocks = capacitances.blocks_j(&netlist, scope, &nets).into_iter();
        let cells = netlist.cells_below(scope);
        let outputs = cells.flat_map(|cell| netlist.cells()[cell.index()].output_nets());
        let toggles: u64 = outputs.map(|net| nets[net.index()].toggles).sum();
        let library = CellLibrary::from_config(config)
            .ok()
            .and_then(CellLibrary::from_file);
        let silicon = library.map(|library| {
            let characterised = library.characterised(&netlist);
            let volt = library.liberty.conditions[0].unwrap_or(capacitances.supply_v);
            let block_silicon = |block: ScopeId| {
                let (area, leakage_w) = characterised.silicon(&netlist, &library.liberty, block);
                let changes = |net: NetId| nets[net.index()].toggles as f64 / cycles;
                let energy =
                    characterised.energy_j((&netlist, block), &library.liberty, volt, changes);
                BlockSilicon {
                    block: if block == scope {
                        "macropixel".to_owned()
                    } else {
                        netlist.scopes()[block.index()].name.clone()
                    },
                    area,
                    leakage_w,
                    internal_j: energy[0],
                    loads_j: energy[1],
                }
            };
            netlist
                .children(scope)
                .chain([scope])
                .map(block_silicon)
                .collect()
        });
        MacropixelPower {
            silicon: silicon.unwrap_or_default(),
            blocks_j: blocks.map(|(name, j)| (name, j / cycles)).collect(),
            toggles: toggles as f64 / cycles,
            cycle_s: exposure.stop(1).as_s(),
        }
    }

    /// Energy of a laser cycle, J.
    pub fn cycle_j(&self) -> f64 {
        self.blocks_j.iter().map(|(_, j)| j).sum()
    }

    /// Energy of the blocks of these names in a laser cycle, J.
    pub fn of_blocks_j(&self, names: &[&str]) -> f64 {
        let wanted = |block: &&(String, f64)| names.contains(&block.0.as_str());
        self.blocks_j.iter().filter(wanted).map(|(_, j)| j).sum()
    }

    /// Mean power, W.
    pub fn mean_w(&self) -> f64 {
        self.cycle_j() / self.cycle_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{Drive, Kernel, Stimulus};
    use crate::netlist::{Corner, Library, ModuleBuilder, Timing};
    use crate::units::Time;

    /// By hand: two inverters in a row and a flip-flop clocked by the second.
    #[test]
    fn an_inverter_chain_by_hand() {
        let mut m = ModuleBuilder::new("chain");
        let (a, d, r) = (m.input("A"), m.input("D"), m.input("R"));
        let z = m.wire("Z");
        let q = m.output("Q");
        m.gate_into(CellKind::Inv, &[a], z);
        m.cell("ff", CellKind::Dffr, &[d, z, r], &[Some(q), None]);
        let netlist = Netlist::elaborate(&m.finish().unwrap());
        let net = |name| netlist.net(name).unwrap();
        let mut drives = vec![
            Drive::new(Time::ZERO, net("R"), true),
            Drive::new(Time::ZERO, net("A"), true),
            Drive::new(Time::ZERO, net("D"), true),
            Drive::new(Time::from_ns(1), net("R"), false),
        ];
        for k in 0..10 {
            drives.push(Drive::new(Time::from_ns(10 + k), net("A"), k % 2 == 1));
        }
        let from = Time::from_ns(5);
        let mut activity = Activity::new(&netlist, from);
        let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
        let end = Time::from_ns(30);
        Kernel::new(&netlist, &timing)
            .run(&mut Stimulus::sorted(drives), end, &mut activity)
            .expect("no loop of cells without delay");
        let nets = activity.net_activity(end);
        assert_eq!(nets[net("A").index()].toggles, 10);
        assert_eq!(nets[net("Q").index()].toggles, 1);

        let c = Capacitances {
            supply_v: 2.0,
            pair_f: 3e-15,
            wire_f: 5e-15,
            drain_f: 7e-15,
        };
        // Ten toggles at the inverter's input and output; ten at the clock pin, and one of Q with its latches.
        let inverter = 10.0 * (3.0 + 5.0) + 10.0 * 7.0;
        let flip_flop = 10.0 * (6.0 * 3.0 + 5.0) + 7.0 + 4.0 * 3.0;
        let wanted = 0.5 * 4.0 * (inverter + flip_flop) * 1e-15;
        let found = c.scope_j(&netlist, ScopeId::TOP, &nets);
        assert!((found / wanted - 1.0).abs() < 1e-12, "{found} {wanted}");
    }
}
