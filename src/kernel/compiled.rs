//! The netlist compiled for the event loop: fan-out lists, truth tables and delay tables.
//!
//! A cell's inputs are packed two bits each into one byte, updated as nets change, so that
//! evaluating a gate is one table look-up.

use crate::logic::Logic;
use crate::netlist::{ArcDelay, CellKind, FlatCell, MAX_INPUTS, Netlist, Timing, next_state};

/// What a change of an input pin means for its cell. A flip-flop's D means nothing until it is sampled, and
/// is then read from its net: it has no entry in any fan-out.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum PinClass {
    /// Any change may change the output.
    Active,
    /// Only going high (or unknown) may change the output.
    Clock,
}

/// One entry of a net's fan-out: cell, class and pin in one word.
#[derive(Clone, Copy)]
pub(super) struct Load(u32);

impl Load {
    const CELL_SHIFT: u32 = 4;

    fn new(cell: usize, class: PinClass, pin: usize) -> Self {
        Load((cell as u32) << Self::CELL_SHIFT | (class as u32) << 2 | pin as u32)
    }

    #[inline]
    pub fn cell(self) -> usize {
        (self.0 >> Self::CELL_SHIFT) as usize
    }

    /// Shift of the pin's two bits in the packed inputs.
    #[inline]
    pub fn shift(self) -> u32 {
        (self.0 & 3) * 2
    }

    #[inline]
    pub fn class(self) -> PinClass {
        if self.0 >> 2 & 1 == 0 {
            PinClass::Active
        } else {
            PinClass::Clock
        }
    }
}

/// State of one cell.
#[derive(Clone, Copy)]
pub(super) struct CellState {
    /// Input values now, two bits each.
    pub inputs: u8,
    /// Input values at the last evaluation.
    pub evaluated: u8,
    pub kind: CellKind,
    /// A flip-flop's state, two bits.
    pub state: u8,
    pub is_dirty: bool,
    /// The net on a flip-flop's D.
    pub data: u32,
    /// Index of its delays.
    pub delays: u32,
    /// Output nets, `u32::MAX` where unconnected.
    pub outputs: [u32; 2],
}

/// Truth tables of every cell, indexed by packed inputs.
pub(super) struct Tables {
    gates: [[u8; 256]; CellKind::ALL.len()],
    /// Indexed by packed inputs, clock before (2 bits), state (2 bits).
    flip_flop: Vec<u8>,
}

impl Tables {
    pub fn new() -> Self {
        let unpack = |packed: usize| [0, 2, 4, 6].map(|s| Logic::from_bits((packed >> s) as u8));
        let mut tables = Tables {
            gates: [[0; 256]; CellKind::ALL.len()],
            flip_flop: vec![0; 1 << 12],
        };
        for kind in CellKind::ALL {
            if !kind.is_flip_flop() {
                for packed in 0..256 {
                    tables.gates[kind as usize][packed] = kind.output(unpack(packed)).bits();
                }
            }
        }
        for index in 0..1 << 12 {
            let [data, clock, reset, set] = unpack(index & 0xff);
            let [before, state, ..] = unpack(index >> 8);
            tables.flip_flop[index] = next_state(state, data, before, clock, reset, set).bits();
        }
        tables
    }

    #[inline]
    pub fn gate(&self, kind: CellKind, inputs: u8) -> u8 {
        self.gates[kind as usize][inputs as usize]
    }

    #[inline]
    pub fn flip_flop(&self, inputs: u8, evaluated: u8, state: u8) -> u8 {
        let clock_before = (evaluated >> 2 & 3) as usize;
        self.flip_flop[inputs as usize | clock_before << 8 | (state as usize) << 10]
    }
}

/// Delays of one set by new value, and by pin.
#[derive(Clone, Copy)]
pub(super) struct DelaySet([[u32; 4]; MAX_INPUTS]);

impl DelaySet {
    /// The sets of `timing`, in its order.
    pub fn all(timing: &Timing) -> Vec<Self> {
        let by_value = |arc: &ArcDelay| Logic::ALL.map(|to| arc.to(to));
        let sets = timing.sets().iter();
        sets.map(|set| DelaySet(set.each_ref().map(by_value)))
            .collect()
    }

    /// Delays by new value from one pin.
    pub fn after_pin(&self, pin: usize) -> &[u32; 4] {
        &self.0[pin]
    }

    /// Delays by new value for the pins in which `inputs` and `evaluated` differ: the shortest of the arcs
    /// concerned. A flip-flop's D is no cause; `inputs` and `evaluated` must agree on it.
    #[inline]
    pub fn after(&self, inputs: u8, evaluated: u8) -> [u32; 4] {
        let differing = inputs ^ evaluated;
        let mut pairs = (differing | differing >> 1) & 0b0101_0101;
        debug_assert!(pairs != 0, "evaluated without a cause");
        let mut delays = self.0[pairs.trailing_zeros() as usize / 2];
        pairs &= pairs - 1;
        while pairs != 0 {
            let others = self.0[pairs.trailing_zeros() as usize / 2];
            delays = std::array::from_fn(|to| delays[to].min(others[to]));
            pairs &= pairs - 1;
        }
        delays
    }
}

/// Fan-out lists of all nets, one after the other.
pub(super) struct FanOut {
    start: Vec<u32>,
    loads: Vec<Load>,
}

impl FanOut {
    pub fn new(netlist: &Netlist) -> Self {
        let mut start = vec![0u32; netlist.net_count() + 1];
        let cells = netlist.cells();
        assert!(
            cells.len() < 1 << (32 - Load::CELL_SHIFT),
            "more cells than a Load can number"
        );
        let triggers = |cell: &FlatCell| {
            let (kind, inputs) = (cell.kind, cell.inputs);
            let pins = (0..kind.inputs().len()).filter(move |&pin| kind.triggers(pin));
            pins.map(move |pin| (pin, inputs[pin].index()))
        };
        for cell in cells {
            for (_, net) in triggers(cell) {
                start[net + 1] += 1;
            }
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let mut next = start.clone();
        let mut loads = vec![Load(0); *start.last().expect("never empty") as usize];
        for (index, cell) in cells.iter().enumerate() {
            for (pin, net) in triggers(cell) {
                let class = if cell.kind.is_flip_flop() && pin == 1 {
                    PinClass::Clock
                } else {
                    PinClass::Active
                };
                let at = &mut next[net];
                loads[*at as usize] = Load::new(index, class, pin);
                *at += 1;
            }
        }
        FanOut { start, loads }
    }

    #[inline]
    pub fn of(&self, net: usize) -> &[Load] {
        &self.loads[self.start[net] as usize..self.start[net + 1] as usize]
    }
}

/// Every cell with unknown inputs and state.
pub(super) fn initial_cells(netlist: &Netlist, timing: &Timing) -> Vec<CellState> {
    netlist
        .cells()
        .iter()
        .enumerate()
        .map(|(index, cell)| {
            let pins = cell.kind.inputs().len() as u32;
            // Pins a cell does not have read 0: no set, no reset.
            let inputs = (0b1010_1010u32 & ((1 << (2 * pins)) - 1)) as u8;
            CellState {
                inputs,
                evaluated: inputs,
                kind: cell.kind,
                state: Logic::X.bits(),
                is_dirty: false,
                data: cell.inputs[0].index() as u32,
                delays: timing.set_of(index),
                outputs: cell.outputs.map(|n| {
                    if n.is_some() {
                        n.index() as u32
                    } else {
                        u32::MAX
                    }
                }),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::netlist::{Corner, Library, ModuleBuilder};

    #[test]
    fn the_delay_is_that_of_the_pin_that_changed() {
        let library = Library::default();
        let mut m = ModuleBuilder::new("m");
        let (a, b, s) = (m.input("A"), m.input("B"), m.input("S"));
        m.gate(CellKind::Mux2, &[a, b, s]);
        let netlist = Netlist::elaborate(&m.finish().unwrap());
        let timing = Timing::nominal(&netlist, &library, Corner::Typ);
        let set = DelaySet::all(&timing)[timing.set_of(0) as usize];
        let arc = |pin: usize| library.arcs(CellKind::Mux2)[pin].delay_fs(Corner::Typ, Logic::One);
        let by_pins = |differing: u8| set.after(differing, 0)[Logic::One as usize];
        assert_eq!(by_pins(0b00_00_01), arc(0));
        assert_eq!(by_pins(0b10_00_00), arc(2));
        assert_eq!(by_pins(0b11_01_00), arc(1).min(arc(2)));
    }
}
