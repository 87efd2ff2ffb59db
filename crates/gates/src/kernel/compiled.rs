//! The netlist compiled for the event loop: fan-out lists, truth tables and delay tables.
//!
//! A cell's inputs are packed two bits each into one byte, updated as nets change, so that
//! evaluating a gate is one table look-up.

use crate::logic::Logic;
use crate::netlist::{
    ArcDelay, CellDelays, CellId, CellKind, FlatCell, MAX_INPUTS, NetId, Netlist, Timing,
    next_state,
};

/// One entry of a net's fan-out: cell and pin in one word.
#[derive(Clone, Copy)]
pub(super) struct Load(u32);

impl Load {
    const CELL_SHIFT: u32 = 2;

    fn new(cell: usize, pin: usize) -> Self {
        Load((cell as u32) << Self::CELL_SHIFT | pin as u32)
    }

    #[inline]
    pub(super) fn cell(self) -> usize {
        (self.0 >> Self::CELL_SHIFT) as usize
    }

    #[inline]
    pub(super) fn pin(self) -> usize {
        (self.0 & 3) as usize
    }
}

/// State of one cell.
#[derive(Clone, Copy)]
pub(super) struct CellState {
    /// Input values now, two bits each. A flip-flop's D and clock are not among them: they are read from their
    /// nets, so that a clock edge writes nothing into the flip-flops it means nothing to.
    pub inputs: u8,
    /// Input values at the last evaluation.
    pub evaluated: u8,
    pub kind: CellKind,
    /// A flip-flop's state, two bits.
    pub state: u8,
    pub is_dirty: bool,
    /// The nets on a flip-flop's D and clock.
    pub data: u32,
    pub clock: u32,
    /// Index of the delays to each output.
    pub delays: [u32; 2],
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
    pub(super) fn new() -> Self {
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
    pub(super) fn gate(&self, kind: CellKind, inputs: u8) -> u8 {
        self.gates[kind as usize][inputs as usize]
    }

    /// `inputs` with D and clock among them, and the clock before.
    #[inline]
    pub(super) fn flip_flop(&self, inputs: u8, clock_before: u8, state: u8) -> u8 {
        let before_and_state = (clock_before | state << 2) as usize;
        self.flip_flop[inputs as usize | before_and_state << 8]
    }
}

/// Delays to one output by new value, and by pin.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct DelaySet([[u32; 4]; MAX_INPUTS]);

impl DelaySet {
    /// The sets of `timing` for the first output, in its order, and then those for a second output that differ from
    /// the first; and, by set of `timing`, where that of each output is. Cells look up one set where both are the same.
    pub(super) fn all(netlist: &Netlist, timing: &Timing) -> (Vec<Self>, Vec<[u32; 2]>) {
        let by_value = |arc: &ArcDelay| Logic::ALL.map(|to| arc.delay_fs(to));
        let to_output = |set: &CellDelays, output: usize| {
            DelaySet(set.each_ref().map(|outputs| by_value(&outputs[output])))
        };
        let sets = timing.sets();
        let mut all: Vec<Self> = sets.iter().map(|set| to_output(set, 0)).collect();
        let mut have_two = vec![false; sets.len()];
        for (index, cell) in netlist.cells().iter().enumerate() {
            have_two[timing.set_of(CellId::new(index)) as usize] |= cell.kind.outputs().len() > 1;
        }
        let places = (0..).zip(sets).map(|(first, set)| {
            let second = to_output(set, 1);
            if !have_two[first as usize] || second == all[first as usize] {
                return [first; 2];
            }
            all.push(second);
            [first, all.len() as u32 - 1]
        });
        let places = places.collect();
        (all, places)
    }

    /// Delays by new value from one pin.
    pub(super) fn after_pin(&self, pin: usize) -> &[u32; 4] {
        &self.0[pin]
    }

    /// Delays by new value for the pins in which `inputs` and `evaluated` differ: the shortest of the arcs
    /// concerned. A flip-flop's D is no cause; `inputs` and `evaluated` must agree on it.
    #[inline]
    pub(super) fn shortest_delays(&self, inputs: u8, evaluated: u8) -> [u32; 4] {
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

/// Pin of a flip-flop's clock.
pub(super) const CLOCK: usize = 1;

/// What hangs on each net. A flip-flop's D means nothing until it is sampled: it is in no list.
pub(super) struct FanOut {
    /// Pins any change of which may change the output.
    pub active: Loads,
    /// Clocks: only going high (or unknown) may change the output.
    pub clocks: Loads,
}

impl FanOut {
    /// Without the clocks of `apart`.
    pub(super) fn new(netlist: &Netlist, apart: &[bool]) -> Self {
        let is_clock = |cell: &FlatCell, pin| cell.kind.is_flip_flop() && pin == CLOCK;
        FanOut {
            active: Loads::new(netlist, |_, cell, pin| {
                cell.kind.triggers(pin) && !is_clock(cell, pin)
            }),
            clocks: Loads::new(netlist, |index, cell, pin| {
                !apart.get(index).is_some_and(|&apart| apart) && is_clock(cell, pin)
            }),
        }
    }
}

/// Lists of pins for all nets, one after the other.
pub(super) struct Loads {
    start: Vec<u32>,
    loads: Vec<Load>,
}

impl Loads {
    /// The pins that `counts`.
    fn new(netlist: &Netlist, counts: impl Fn(usize, &FlatCell, usize) -> bool) -> Self {
        let mut start = vec![0u32; netlist.net_count() + 1];
        let cells = netlist.cells();
        assert!(
            cells.len() < 1 << (32 - Load::CELL_SHIFT),
            "more cells than a Load can number"
        );
        let counts = &counts;
        let pins = |index: usize, cell: &FlatCell| {
            let cell = *cell;
            let pins = 0..cell.kind.inputs().len();
            let pins = pins.filter(move |&pin| counts(index, &cell, pin));
            pins.map(move |pin| (pin, cell.input(pin).index()))
        };
        for (index, cell) in cells.iter().enumerate() {
            for (_, net) in pins(index, cell) {
                start[net + 1] += 1;
            }
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let mut next = start.clone();
        let mut loads = vec![Load(0); *start.last().expect("never empty") as usize];
        for (index, cell) in cells.iter().enumerate() {
            for (pin, net) in pins(index, cell) {
                let at = &mut next[net];
                loads[*at as usize] = Load::new(index, pin);
                *at += 1;
            }
        }
        Loads { start, loads }
    }

    #[inline]
    pub(super) fn net_loads(&self, net: usize) -> &[Load] {
        &self.loads[self.range_of(net)]
    }

    /// Places of a net's loads among all.
    #[inline]
    pub(super) fn range_of(&self, net: usize) -> std::ops::Range<usize> {
        self.start[net] as usize..self.start[net + 1] as usize
    }

    /// The load at a place.
    #[inline]
    pub(super) fn load(&self, place: usize) -> Load {
        self.loads[place]
    }
}

/// A net's number, or the greatest one where there is none.
fn number(net: Option<NetId>) -> u32 {
    net.map_or(u32::MAX, |net| net.index() as u32)
}

/// Every cell with unknown inputs and state; `delays` are the places of [`DelaySet::all`].
pub(super) fn initial_cells(
    netlist: &Netlist,
    timing: &Timing,
    delays: &[[u32; 2]],
) -> Vec<CellState> {
    netlist
        .cells()
        .iter()
        .enumerate()
        .map(|(index, cell)| {
            let pins = cell.kind.inputs().len() as u32;
            // Pins a cell does not have read 0: no set, no reset.
            let mut inputs = (0b1010_1010u32 & ((1 << (2 * pins)) - 1)) as u8;
            if cell.kind.is_flip_flop() {
                inputs &= 0b1111_0000;
            }
            CellState {
                inputs,
                evaluated: inputs,
                kind: cell.kind,
                state: Logic::X.bits(),
                is_dirty: false,
                data: number(cell.inputs[0]),
                clock: number(cell.inputs[CLOCK]),
                delays: delays[timing.set_of(CellId::new(index)) as usize],
                outputs: cell.outputs.map(number),
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
        let library = Library::generic_40nm();
        let mut m = ModuleBuilder::new("m");
        let (a, b, s) = (m.input("A"), m.input("B"), m.input("S"));
        m.gate(CellKind::Mux2, &[a, b, s]);
        let netlist = Netlist::elaborate(&m.finish().unwrap());
        let timing = Timing::nominal(&netlist, &library, Corner::Typ);
        let set = DelaySet::all(&netlist, &timing).0[timing.set_of(CellId::new(0)) as usize];
        let arc = |pin: usize| {
            let delay = library.delay(CellKind::Mux2, pin, Logic::One, Corner::Typ);
            delay.as_fs() as u32
        };
        let by_pins = |differing: u8| set.shortest_delays(differing, 0)[Logic::One as usize];
        assert_eq!(by_pins(0b00_00_01), arc(0));
        assert_eq!(by_pins(0b10_00_00), arc(2));
        assert_eq!(by_pins(0b11_01_00), arc(1).min(arc(2)));
    }
}
