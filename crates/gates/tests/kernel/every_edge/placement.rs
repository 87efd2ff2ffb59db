//! A random module built from its recipe: cells and instances placed, their wires declared and chosen.

use std::sync::Arc;

use femtogate::netlist::{CellKind, Direction, Module, ModuleBuilder, Net};
use rand::{rngs::StdRng, seq::SliceRandom};

/// Most inputs a module has.
pub const MOST_INPUTS: usize = 6;

/// A cell, or an instance of an earlier module.
#[derive(Debug, Clone)]
pub struct Item {
    /// Which cell; beyond the last one, which module.
    pub what: u8,
    /// Where each input comes from.
    pub pins: [u16; MOST_INPUTS],
    /// What the outputs are: wires, ports, bits of a bus.
    pub outputs: u8,
}

/// One module.
#[derive(Debug, Clone)]
pub struct Recipe {
    pub scalar_inputs: usize,
    pub bus_inputs: usize,
    pub items: Vec<Item>,
}

/// The module of a recipe, which may instantiate `children`; `shuffle` decides the order in which cells and wires are
/// declared.
pub fn placed(
    name: &str,
    recipe: &Recipe,
    children: &[Arc<Module>],
    has_gate_loops: bool,
    shuffle: Option<&mut StdRng>,
) -> Arc<Module> {
    let mut order: Vec<usize> = (0..recipe.items.len()).collect();
    if let Some(random) = shuffle {
        order.shuffle(random);
    }
    let mut placement = Placement {
        builder: ModuleBuilder::new(name),
        recipe,
        order,
        children,
        inputs: Vec::new(),
        pool: Vec::new(),
    };
    placement.place(has_gate_loops);
    placement.builder.finish().unwrap()
}

/// A cell or an instance with its connections, still to be placed.
enum Pending<'a> {
    Cell(CellKind, Vec<Net>, Vec<Option<Net>>),
    Instance(&'a Arc<Module>, Vec<(String, Vec<Option<Net>>)>),
}

/// A module being built from its recipe.
struct Placement<'a> {
    builder: ModuleBuilder,
    recipe: &'a Recipe,
    /// Items in the order in which they are placed and their wires declared.
    order: Vec<usize>,
    children: &'a [Arc<Module>],
    inputs: Vec<Net>,
    /// Nets that may be chosen from.
    pool: Vec<Net>,
}

/// Where one output bit goes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Output {
    Wire,
    Port,
    WireBus,
    PortBus,
    Open,
}

impl<'a> Placement<'a> {
    fn place(&mut self, has_gate_loops: bool) {
        let recipe = self.recipe;
        for i in 0..recipe.scalar_inputs {
            self.inputs.push(self.builder.input(&format!("I{i}")));
        }
        if recipe.bus_inputs > 0 {
            let bus = self.builder.input_bus("IN", recipe.bus_inputs);
            self.inputs.extend(bus);
        }
        self.pool.clone_from(&self.inputs);
        let outputs = self.declare_outputs();
        let is_early = |item| has_gate_loops || self.kind(item).is_some_and(|k| k.is_flip_flop());
        let early: Vec<bool> = recipe.items.iter().map(is_early).collect();
        let known = |nets: &[Option<Net>]| nets.iter().copied().flatten().collect::<Vec<_>>();
        for (nets, _) in outputs.iter().zip(&early).filter(|(_, early)| **early) {
            self.pool.extend(known(nets));
        }
        // Gates take what is upstream of them; flip-flops, considered last, take anything.
        let mut pending: Vec<Option<Pending>> = recipe.items.iter().map(|_| None).collect();
        for is_flip_flop in [false, true] {
            for (index, item) in recipe.items.iter().enumerate() {
                let kind = self.kind(item);
                if kind.is_some_and(|k| k.is_flip_flop()) != is_flip_flop {
                    continue;
                }
                pending[index] = Some(match kind {
                    Some(kind) => self.cell(kind, item, &outputs[index]),
                    None => self.instance(item, &outputs[index]),
                });
                if !early[index] {
                    self.pool.extend(known(&outputs[index]));
                }
            }
        }
        for &index in &self.order {
            let name = format!("u{index}");
            match pending[index].take().expect("every item is considered") {
                Pending::Cell(kind, inputs, outputs) => {
                    self.builder.cell(&name, kind, &inputs, &outputs);
                }
                Pending::Instance(module, connections) => {
                    let connections: Vec<(&str, Vec<Option<Net>>)> = connections
                        .iter()
                        .map(|(port, nets)| (port.as_str(), nets.clone()))
                        .collect();
                    self.builder
                        .instance_with_open_bits(&name, module, &connections);
                }
            }
        }
    }

    fn kind(&self, item: &Item) -> Option<CellKind> {
        match CellKind::ALL.get(item.what as usize) {
            None if self.children.is_empty() => Some(CellKind::ALL[item.what as usize - 7]),
            kind => kind.copied(),
        }
    }

    fn child(&self, item: &Item) -> &'a Arc<Module> {
        &self.children[item.what as usize % self.children.len()]
    }

    /// Widths of the output pins or ports of an item.
    fn output_widths(&self, item: &Item) -> Vec<usize> {
        match self.kind(item) {
            Some(kind) => vec![1; kind.outputs().len()],
            None => ports(self.child(item), Direction::Output)
                .map(|(_, width)| width)
                .collect(),
        }
    }

    /// What each output bit of an item becomes.
    fn output_places(&self, item: &Item) -> Vec<Output> {
        let widths = self.output_widths(item);
        let mut places = Vec::new();
        for (port, &width) in widths.iter().enumerate() {
            // A nested module may have more ports than the recipe has bits: the rest stay open.
            let recipe = item.outputs.checked_shr(port as u32).unwrap_or(0) & 7;
            for bit in 0..width {
                places.push(match recipe {
                    0 if widths.len() > 1 => Output::Open,
                    1 if bit % 2 == 1 => Output::Open,
                    0 | 1 => Output::Wire,
                    2 => Output::Port,
                    3 | 4 => Output::WireBus,
                    5 => Output::PortBus,
                    _ if bit % 2 == 0 => Output::Wire,
                    _ => Output::WireBus,
                });
            }
        }
        places
    }

    /// Declares the nets of every item's outputs.
    fn declare_outputs(&mut self) -> Vec<Vec<Option<Net>>> {
        let recipe = self.recipe;
        let places: Vec<Vec<Output>> = recipe
            .items
            .iter()
            .map(|item| self.output_places(item))
            .collect();
        let count = |wanted| places.iter().flatten().filter(|p| **p == wanted).count();
        let (wires, ports) = (count(Output::WireBus), count(Output::PortBus));
        let builder = &mut self.builder;
        let mut wire_bus = Vec::new();
        if wires > 0 {
            wire_bus = builder.wire_bus("WIRES", wires);
        }
        let mut port_bus = Vec::new();
        if ports > 0 {
            port_bus = builder.output_bus("OUTS", ports);
        }
        let (mut wire_bus, mut port_bus) = (wire_bus.into_iter(), port_bus.into_iter());
        let mut nets: Vec<Vec<Option<Net>>> = Vec::new();
        for (index, places) in places.iter().enumerate() {
            let net = |(bit, place): (usize, &Output)| match place {
                Output::Port => Some(builder.output(&format!("O{index}_{bit}"))),
                Output::WireBus => wire_bus.next(),
                Output::PortBus => port_bus.next(),
                Output::Wire | Output::Open => None,
            };
            nets.push(places.iter().enumerate().map(net).collect());
        }
        // Ports have their order, but single wires may come in any.
        for &index in &self.order {
            for (bit, place) in places[index].iter().enumerate() {
                if *place == Output::Wire {
                    nets[index][bit] = Some(builder.wire(&format!("W{index}_{bit}")));
                }
            }
        }
        nets
    }

    /// One of the nets to choose from, often a recent one.
    fn choose(&self, pin: u16) -> Net {
        let choice = pin as usize >> 1;
        let recent = self.pool.len().min(6);
        if pin & 1 == 1 {
            self.pool[self.pool.len() - 1 - choice % recent]
        } else {
            self.pool[choice % self.pool.len()]
        }
    }

    fn cell(&self, kind: CellKind, item: &Item, outputs: &[Option<Net>]) -> Pending<'a> {
        let inputs = (0..kind.inputs().len())
            .map(|pin| {
                let choice = item.pins[pin];
                // A flip-flop of whose clock, set and reset nothing is known stays unknown.
                if kind.is_flip_flop() && pin > 0 && choice >> 14 != 0 {
                    self.inputs[choice as usize % self.inputs.len()]
                } else {
                    self.choose(choice)
                }
            })
            .collect();
        Pending::Cell(kind, inputs, outputs.to_vec())
    }

    fn instance(&self, item: &Item, outputs: &[Option<Net>]) -> Pending<'a> {
        let child = self.child(item);
        let mut connections: Vec<(String, Vec<Option<Net>>)> = Vec::new();
        for (port, (name, width)) in ports(child, Direction::Input).enumerate() {
            // Neighbours become a slice of a bus, where they lie in one.
            let first = item.pins[port % MOST_INPUTS];
            let bit = |bit: usize| match first & 1 {
                1 => Some(self.pool[(first as usize / 2 + bit) % self.pool.len()]),
                _ => Some(self.choose(item.pins[(port + bit) % MOST_INPUTS])),
            };
            connections.push((name.to_owned(), (0..width).map(bit).collect()));
        }
        let mut rest = outputs;
        for (name, width) in ports(child, Direction::Output) {
            let (nets, after) = rest.split_at(width);
            rest = after;
            connections.push((name.to_owned(), nets.to_vec()));
        }
        Pending::Instance(child, connections)
    }
}

/// Names and widths of a module's ports in one direction.
fn ports(module: &Module, direction: Direction) -> impl Iterator<Item = (&str, usize)> {
    module
        .port_signals()
        .filter(move |(d, _)| *d == direction)
        .map(|(_, signal)| (signal.name.as_str(), signal.width()))
}
