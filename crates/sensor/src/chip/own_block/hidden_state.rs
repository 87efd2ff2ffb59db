//! What a P-counter of one's own may remember: what MEMORY_LOAD has loaded, and nothing besides.
//!
//! ```text
//!   COUNTER_INIT ──X──────────────────────────────► LOCAL_STOP      no path, except through
//!        └─► memory: flip-flops that move with MEMORY_LOAD alone ─┐
//!                                                                 ▼
//!   COUNTER_RESET ─► every other flip-flop that LOCAL_STOP depends on, whatever it held before
//! ```
//!
//! The law of a counter is measured in one laser cycle ([`CounterLaw`](super::CounterLaw)) and then holds for all of them. That is
//! true if each laser cycle begins in a state that the loaded code alone decides. Five rules are checked on the netlist; each
//! names the cell that breaks it. They are rules, not trials: a counter that passes has no state that could change its law later.
//!
//! 1. With MEMORY_LOAD low, no path leads from COUNTER_INIT to LOCAL_STOP. Nets that are constant then cut paths, as does a
//!    flip-flop whose clock is constant.
//! 2. With MEMORY_LOAD high, COUNTER_INIT reaches no memory: the load path shifts on before MEMORY_LOAD falls.
//! 3. A load decides the whole memory, whatever it held before and whatever COUNTER_INIT does after the rising edge.
//! 4. With a memory: COUNTER_RESET sets or clears all other flip-flops, in a way that depends on the memory alone. Without one
//!    (`p_counter = "memoryless"`): COUNTER_RESET has no effect on LOCAL_STOP.
//! 5. A counter that comes round within a laser cycle (`after_borrow = "wrap"`, or without a memory) is in the same state after
//!    each round.
//!
//! Paths and constants are found with zero delay and three values, where X stands for any value; loads and rounds are simulated,
//! 64 codes at a time, with the library's delays, because pulses that a netlist makes for itself need delays.

mod load;

use std::collections::VecDeque;
use std::sync::Arc;

use self::load::Load;
use crate::chip::config::AfterBorrow;
use crate::chip::p_counter::count_down::CountDownSetup;
use crate::chip::{Probe, Probes};
use crate::kernel::LANES;
use crate::logic::Logic;
use crate::netlist::{CellId, CellKind, FlatCell, MAX_INPUTS, Module, NetId, Netlist};

/// Pins of a flip-flop.
const D: usize = 0;
const CK: usize = 1;
const R: usize = 2;
const S: usize = 3;

/// The cell by which a P-counter remembers more than it may, in the words of its user; `None` where there is none.
pub(super) fn hidden_state(module: &Arc<Module>, expected: CountDownSetup) -> Option<String> {
    let netlist = &Netlist::elaborate(module);
    let counter = &Counter::new(netlist);
    let idle = counter.values(&[(Probe::MemoryLoad, false)], &[]);
    if let Some((bit, cell)) = counter.path(
        Probe::CounterInit,
        &idle,
        [Some(counter.local_stop()), None],
    ) {
        return Some(format!(
            "uses COUNTER_INIT[{bit}] after the load, because {cell} leads it to LOCAL_STOP; \
             store it with posedge MEMORY_LOAD, and use what is stored"
        ));
    }
    let cone = counter.cone(&idle);
    // What only a load can change.
    let is_stored = |&cell: &usize| {
        let mut controls = netlist.cells()[cell].input_nets().skip(1);
        controls.all(|net| idle[net.index()] != Value::Any)
    };
    let (memory, counting): (Vec<usize>, Vec<usize>) =
        cone.iter().partition(|cell| is_stored(cell));
    let loaded = if expected.has_memory { &memory } else { &cone };
    let load = [
        (Probe::MemoryLoad, true),
        (Probe::CounterReset, true),
        (Probe::CounterClk, false),
    ];
    let load = counter.values(&load, &[]);
    for &cell in loaded {
        if counter
            .path(Probe::CounterInit, &load, netlist.cells()[cell].outputs)
            .is_some()
        {
            return Some(format!(
                "follows COUNTER_INIT for as long as MEMORY_LOAD is high, in {}; store it with posedge MEMORY_LOAD",
                counter.name(cell)
            ));
        }
    }
    if !expected.has_memory
        && let Some((_, cell)) = counter.path(
            Probe::CounterReset,
            &idle,
            [Some(counter.local_stop()), None],
        )
    {
        return Some(format!(
            "has a COUNTER_RESET that {cell} leads to LOCAL_STOP, although p_counter = \"memoryless\" says that no STOP resets it; \
             leave COUNTER_RESET unconnected, or leave p_counter out"
        ));
    }
    let codes: Vec<u16> = (0..1u32 << counter.init().len())
        .map(|code| code as u16)
        .collect();
    codes.chunks(LANES).find_map(|codes| {
        let still = Load::new(counter, codes, false);
        let moved = Load::new(counter, codes, true);
        if let Some(&cell) = loaded.iter().find(|&&cell| still.unknown(cell) != 0) {
            return Some(format!(
                "holds more than COUNTER_INIT after a load, in {}; load it with posedge MEMORY_LOAD from COUNTER_INIT alone",
                counter.name(cell)
            ));
        }
        if let Some(&cell) = loaded.iter().find(|&&cell| still.ones(cell) != moved.ones(cell)) {
            return Some(format!(
                "takes COUNTER_INIT later than MEMORY_LOAD rises, in {}; store it with posedge MEMORY_LOAD",
                counter.name(cell)
            ));
        }
        if expected.has_memory
            && let Some(cell) = counter.survivor(&still, &memory, &counting)
        {
            return Some(format!(
                "keeps state from one laser cycle to the next in {}, on which LOCAL_STOP depends; \
                 set or clear it while COUNTER_RESET is high, without an edge of COUNTER_CLK",
                counter.name(cell)
            ));
        }
        let comes_round = !expected.has_memory || expected.after_borrow == AfterBorrow::Wrap;
        let cell = comes_round.then(|| still.changed_by_a_round(&counting, expected))??;
        Some(format!(
            "counts each round in {}, which differs when LOCAL_STOP rises again; \
             let every round of the counter be the same",
            counter.name(cell)
        ))
    })
}

/// What a net can be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Value {
    Known(bool),
    /// Either value, at any time.
    Any,
}

/// The netlist of a counter, with what paths are followed by.
struct Counter<'n> {
    netlist: &'n Netlist,
    probes: Probes,
    /// Cells in an order in which gates come after what drives them.
    order: Vec<usize>,
    /// By net.
    driver: Vec<Option<usize>>,
    /// By net: cells and their pins.
    readers: Vec<Vec<(usize, usize)>>,
}

impl<'n> Counter<'n> {
    fn new(netlist: &'n Netlist) -> Self {
        let mut driver = vec![None; netlist.net_count()];
        let mut readers = vec![Vec::new(); netlist.net_count()];
        for (index, cell) in netlist.cells().iter().enumerate() {
            for output in cell.output_nets() {
                driver[output.index()] = Some(index);
            }
            for pin in 0..cell.kind.inputs().len() {
                readers[cell.input(pin).index()].push((index, pin));
            }
        }
        let mut counter = Counter {
            netlist,
            probes: Probes::of_block(netlist),
            order: Vec::new(),
            driver,
            readers,
        };
        counter.order = counter.gates_in_order();
        counter
    }

    /// Flip-flops, and then gates behind what drives them. There are no loops of gates: the contract has been checked.
    fn gates_in_order(&self) -> Vec<usize> {
        let cells = self.netlist.cells();
        let is_flip_flop = |cell: &usize| cells[*cell].kind.is_flip_flop();
        let (mut order, gates): (Vec<usize>, Vec<usize>) = (0..cells.len()).partition(is_flip_flop);
        let mut awaited = vec![0; cells.len()];
        for &gate in &gates {
            let drivers = cells[gate].input_nets();
            let drivers = drivers.filter_map(|net| self.driver[net.index()]);
            awaited[gate] = drivers.filter(|driver| !is_flip_flop(driver)).count();
        }
        let first = order.len();
        order.extend(gates.iter().filter(|&&gate| awaited[gate] == 0));
        let mut next = first;
        while let Some(&gate) = order.get(next) {
            next += 1;
            let reached = cells[gate].output_nets();
            for &(reader, _) in reached.flat_map(|net| &self.readers[net.index()]) {
                if !is_flip_flop(&reader) {
                    awaited[reader] -= 1;
                    if awaited[reader] == 0 {
                        order.push(reader);
                    }
                }
            }
        }
        order
    }

    fn init(&self) -> &[NetId] {
        self.probes.bus(Probe::CounterInit)
    }

    fn local_stop(&self) -> NetId {
        self.probes.net(Probe::LocalStop)
    }

    /// A cell, as its user knows it: with the net that it drives, where that has a name.
    fn name(&self, cell: usize) -> String {
        let leaf = &self.netlist.cells()[cell];
        let kind = leaf.kind;
        let path = self.netlist.cell_path(CellId::new(cell));
        let (_, cell) = path.split_once('.').expect("a cell is below the top");
        let mut nets = leaf.output_nets();
        match (nets.find_map(|net| self.named(net)), kind.is_flip_flop()) {
            (Some(net), true) => format!("flip-flop {net} ({cell})"),
            (Some(net), false) => format!("gate {cell} ({}, which drives {net})", kind.name()),
            (None, true) => format!("flip-flop {cell}"),
            (None, false) => format!("gate {cell} ({})", kind.name()),
        }
    }

    /// The name of a net that has one in the file.
    fn named(&self, net: NetId) -> Option<String> {
        let top = &self.netlist.scopes()[0];
        let mut signals = top.module.signals().iter().filter(|signal| signal.is_named);
        signals.find_map(|signal| {
            let bit = self
                .netlist
                .signal_nets(top, signal)
                .position(|other| other == net)?;
            Some(if signal.is_bus {
                format!("{}[{bit}]", signal.name)
            } else {
                signal.name.clone()
            })
        })
    }

    /// What nets are while these pins, and MEMORY_RESET, are constant; other pins can be anything, as can flip-flops that
    /// are not among the `held`.
    fn values(&self, pins: &[(Probe, bool)], held: &[(usize, bool)]) -> Vec<Value> {
        let cells = self.netlist.cells();
        let mut values = vec![Value::Any; self.netlist.net_count()];
        for &(pin, value) in pins.iter().chain(&[(Probe::MemoryReset, false)]) {
            values[self.probes.net(pin).index()] = Value::Known(value);
        }
        let mut states = vec![Value::Any; cells.len()];
        for &(cell, state) in held {
            states[cell] = Value::Known(state);
        }
        // Each round makes known what those before it decide, and nothing unknown again.
        loop {
            let mut is_settled = true;
            for &index in &self.order {
                let cell = &cells[index];
                let value = if cell.kind.is_flip_flop() {
                    state(cell, &values, states[index])
                } else {
                    output(cell, &values)
                };
                let Value::Known(one) = value else { continue };
                for (net, value) in cell.outputs.iter().zip([one, !one]) {
                    if let Some(net) = net
                        && values[net.index()] == Value::Any
                    {
                        values[net.index()] = Value::Known(value);
                        is_settled = false;
                    }
                }
            }
            if is_settled {
                return values;
            }
        }
    }

    /// The first step of a path from a pin to any of `to`: the pin's bit, and the cell that reads it.
    fn path(
        &self,
        from: Probe,
        values: &[Value],
        to: [Option<NetId>; 2],
    ) -> Option<(usize, String)> {
        let mut first: Vec<Option<(usize, usize)>> = vec![None; self.netlist.net_count()];
        let mut queue = VecDeque::new();
        for (bit, &net) in self.probes.bus(from).iter().enumerate() {
            queue.push_back((net, bit, None));
        }
        while let Some((net, bit, through)) = queue.pop_front() {
            for &(cell, pin) in &self.readers[net.index()] {
                if !passes(&self.netlist.cells()[cell], pin, values) {
                    continue;
                }
                let through = through.unwrap_or(cell);
                for output in self.netlist.cells()[cell].output_nets() {
                    if first[output.index()].is_none() {
                        first[output.index()] = Some((bit, through));
                        queue.push_back((output, bit, Some(through)));
                    }
                }
            }
        }
        let to = to.into_iter().flatten();
        let (bit, cell) = to.filter_map(|net| first[net.index()]).next()?;
        Some((bit, self.name(cell)))
    }

    /// Every flip-flop that LOCAL_STOP depends on.
    fn cone(&self, values: &[Value]) -> Vec<usize> {
        let mut is_seen = vec![false; self.netlist.cells().len()];
        let mut nets = vec![self.probes.net(Probe::LocalStop)];
        while let Some(net) = nets.pop() {
            let Some(cell) = self.driver[net.index()] else {
                continue;
            };
            if std::mem::replace(&mut is_seen[cell], true) {
                continue;
            }
            let cell = &self.netlist.cells()[cell];
            let pins = (0..cell.kind.inputs().len()).filter(|&pin| passes(cell, pin, values));
            nets.extend(pins.map(|pin| cell.input(pin)));
        }
        let cells = (0..is_seen.len()).filter(|&cell| is_seen[cell]);
        cells
            .filter(|&cell| self.netlist.cells()[cell].kind.is_flip_flop())
            .collect()
    }

    /// A flip-flop of `counting` that COUNTER_RESET leaves as it was, from what has been loaded into the memory: one that is
    /// neither set nor cleared rather than one whose set or clear another one decides.
    fn survivor(&self, loaded: &Load<'_>, memory: &[usize], counting: &[usize]) -> Option<usize> {
        let reset = [(Probe::MemoryLoad, false), (Probe::CounterReset, true)];
        let left = |held: &[(usize, bool)]| {
            let values = self.values(&reset, held);
            let is_any = |cell: &&usize| self.state(**cell, &values) == Value::Any;
            let left: Vec<usize> = counting.iter().filter(is_any).copied().collect();
            let is_kept = |cell: &&usize| {
                let mut controls = self.netlist.cells()[**cell].input_nets().skip(R);
                controls.all(|net| values[net.index()] != Value::Any)
            };
            left.iter().find(is_kept).or(left.first()).copied()
        };
        // Most counters need no look at what is loaded.
        left(&[])?;
        (0..loaded.codes.len()).find_map(|lane| {
            let held = memory
                .iter()
                .map(|&cell| (cell, loaded.ones(cell) >> lane & 1 == 1));
            left(&held.collect::<Vec<_>>())
        })
    }

    /// What a flip-flop holds.
    fn state(&self, cell: usize, values: &[Value]) -> Value {
        let [q, qn] = self.netlist.cells()[cell].outputs;
        match (q, qn) {
            (Some(q), _) => values[q.index()],
            (_, Some(qn)) => match values[qn.index()] {
                Value::Known(one) => Value::Known(!one),
                Value::Any => Value::Any,
            },
            _ => Value::Any,
        }
    }
}

/// What a flip-flop that holds `held` holds while its reset and set are these.
fn state(cell: &FlatCell, values: &[Value], held: Value) -> Value {
    let reset = values[cell.input(R).index()];
    let set = match cell.kind {
        CellKind::Dffsr => values[cell.input(S).index()],
        _ => Value::Known(false),
    };
    match (reset, set) {
        (Value::Known(true), _) => Value::Known(false),
        (Value::Known(false), Value::Known(true)) => Value::Known(true),
        (Value::Known(false), Value::Known(false)) => held,
        _ => Value::Any,
    }
}

/// Every output of a gate that its inputs allow, with the inputs that make it; pins of one net are equal.
fn outputs<'c>(
    cell: &'c FlatCell,
    values: &'c [Value],
) -> impl Iterator<Item = (usize, bool)> + use<'c> {
    let pins = cell.kind.inputs().len();
    (0..1usize << pins).filter_map(move |word| {
        let bit = |pin: usize| word >> pin & 1 == 1;
        let is_possible = (0..pins).all(|pin| {
            let net = cell.input(pin);
            let other = cell.input_nets().position(|other| other == net);
            let is_equal = other.is_none_or(|other| bit(other) == bit(pin));
            is_equal && values[net.index()] != Value::Known(!bit(pin))
        });
        let mut inputs = [Logic::Zero; MAX_INPUTS];
        for (pin, input) in inputs.iter_mut().enumerate().take(pins) {
            *input = Logic::from(bit(pin));
        }
        is_possible.then(|| (word, cell.kind.output(inputs) == Logic::One))
    })
}

/// The output of a gate.
fn output(cell: &FlatCell, values: &[Value]) -> Value {
    let mut outputs = outputs(cell, values).map(|(_, output)| output);
    match outputs.next() {
        Some(first) if outputs.all(|output| output == first) => Value::Known(first),
        _ => Value::Any,
    }
}

/// Whether a change at a pin can change what a cell drives.
fn passes(cell: &FlatCell, pin: usize, values: &[Value]) -> bool {
    let value = |pin: usize| values[cell.input(pin).index()];
    if value(pin) != Value::Any {
        return false;
    }
    if cell.kind.is_flip_flop() {
        let mut outputs = cell.output_nets();
        let moves = outputs.any(|net| values[net.index()] == Value::Any);
        return moves && (pin != D || value(CK) == Value::Any);
    }
    let net = cell.input(pin);
    let of_net = (0..cell.kind.inputs().len()).filter(|&other| cell.input(other) == net);
    let flipped = of_net.fold(0, |word, pin| word | 1 << pin);
    let possible: Vec<(usize, bool)> = outputs(cell, values).collect();
    let output_of = |word: usize| possible.iter().find(|(known, _)| *known == word);
    possible
        .iter()
        .any(|&(word, output)| output_of(word ^ flipped).is_some_and(|&(_, other)| other != output))
}
