//! Random circuits, delays and stimuli, in a form that shrinks to something small.
//!
//! A circuit is a list of modules, each of which may instantiate the earlier ones. Its items are
//! numbers that are read modulo what there is to choose from, so that any list is a circuit and
//! any shorter list is one, too.

use std::collections::BTreeMap;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use guided_dtof::kernel::Drive;
use guided_dtof::logic::Logic;
use guided_dtof::netlist::{
    Arc as DelayArc, CellArcs, CellKind, Corner, Delay, DelayModel, Direction, Library, MAX_INPUTS,
    Module, ModuleBuilder, Net, Netlist, Timing,
};
use guided_dtof::units::Time;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng, rngs::StdRng, seq::SliceRandom};

/// Most inputs a module has.
const MOST_INPUTS: usize = 6;
/// Longest and shortest delay, fs.
const DELAYS_FS: std::ops::RangeInclusive<u32> = 1_000..=200_000;

/// A cell, or an instance of an earlier module.
#[derive(Debug, Clone)]
struct Item {
    /// Which cell; beyond the last one, which module.
    what: u8,
    /// Where each input comes from.
    pins: [u16; MOST_INPUTS],
    /// What the outputs are: wires, ports, bits of a bus.
    outputs: u8,
}

/// One module.
#[derive(Debug, Clone)]
struct Recipe {
    scalar_inputs: usize,
    bus_inputs: usize,
    items: Vec<Item>,
}

/// Some inputs take new values, some time after the last did.
#[derive(Debug, Clone)]
struct Instant {
    gap_fs: u32,
    drives: Vec<(u8, u8)>,
}

/// A circuit, its delays, and what is driven into it.
#[derive(Debug, Clone)]
pub struct Case {
    /// The last one is the top.
    modules: Vec<Recipe>,
    /// Whether gates may form loops without a flip-flop.
    has_gate_loops: bool,
    delay_seed: u64,
    /// All delays and gaps between drives are multiples of this: a coarse grid makes for many
    /// events in one instant.
    grid_fs: u32,
    /// A bit for each cell whose inputs all have the same delay.
    uniform: u16,
    /// A bit for each cell that rises as fast as it falls.
    symmetric: u16,
    corner: Corner,
    /// How many cells in four have transport delays.
    transport: u8,
    /// Whether all inputs get a known value at time 0.
    starts_known: bool,
    stimulus: Vec<Instant>,
}

fn recipe(items: std::ops::RangeInclusive<usize>) -> impl Strategy<Value = Recipe> {
    let item =
        (0u8..16, any::<[u16; MOST_INPUTS]>(), any::<u8>()).prop_map(|(what, pins, outputs)| {
            Item {
                what,
                pins,
                outputs,
            }
        });
    let inputs = (0usize..=4, 0usize..=2).prop_map(|(scalar, bus)| (scalar.max(1), bus));
    (inputs, prop::collection::vec(item, items)).prop_map(|((scalar_inputs, bus_inputs), items)| {
        Recipe {
            scalar_inputs,
            bus_inputs,
            items,
        }
    })
}

fn instant() -> impl Strategy<Value = Instant> {
    // Much shorter than a delay, about one, and longer than most paths.
    let gap = prop_oneof![1u32..5_000, 1_000u32..150_000, 100_000u32..1_000_000];
    let value = prop_oneof![6 => Just(0u8), 6 => Just(1u8), 1 => Just(2u8), 1 => Just(3u8)];
    let drives = prop::collection::vec((any::<u8>(), value), 1..=4);
    (gap, drives).prop_map(|(gap_fs, drives)| Instant { gap_fs, drives })
}

/// Cases whose circuit has one module of 1 to 40 cells.
pub fn flat() -> impl Strategy<Value = Case> {
    case(recipe(1..=40).prop_map(|top| vec![top]))
}

/// Cases whose circuit has two or three levels, with modules used several times.
pub fn hierarchical() -> impl Strategy<Value = Case> {
    let below = prop::collection::vec(recipe(1..=6), 1..=2);
    case((below, recipe(1..=12)).prop_map(|(mut modules, top)| {
        modules.push(top);
        modules
    }))
}

fn case(modules: impl Strategy<Value = Vec<Recipe>>) -> impl Strategy<Value = Case> {
    (
        modules,
        prop::bool::weighted(0.2),
        any::<u64>().no_shrink(),
        prop_oneof![3 => Just(1u32), 1 => Just(1_000), 1 => Just(25_000)],
        any::<(u16, u16)>(),
        (
            prop::sample::select(&Corner::ALL[..]),
            prop_oneof![2 => Just(0u8), 2 => Just(1), 1 => Just(3), 1 => Just(4)],
        ),
        prop::bool::weighted(0.7),
        prop::collection::vec(instant(), 1..=100),
    )
        .prop_map(
            |(
                modules,
                has_gate_loops,
                delay_seed,
                grid_fs,
                (uniform, symmetric),
                (corner, transport),
                starts_known,
                stimulus,
            )| Case {
                modules,
                has_gate_loops,
                delay_seed,
                grid_fs,
                uniform,
                symmetric,
                corner,
                transport,
                starts_known,
                stimulus,
            },
        )
}

impl Case {
    /// The corner to simulate.
    pub fn corner(&self) -> Corner {
        self.corner
    }

    /// Delays of the library, some cells' as transport delays: the same ones however the cells are ordered.
    pub fn timing(&self, netlist: &Netlist) -> Timing {
        let mut timing = Timing::nominal(netlist, &self.cell_library(), self.corner);
        for cell in 0..netlist.cells().len() {
            let mut hash = std::hash::DefaultHasher::new();
            (self.delay_seed, netlist.cell_path(cell)).hash(&mut hash);
            if hash.finish() % 4 < u64::from(self.transport) {
                timing.set_model(cell, DelayModel::Transport);
            }
        }
        timing
    }

    /// Whether any cell may have transport delays.
    pub fn has_transport(&self) -> bool {
        self.transport > 0
    }

    /// The circuit's top module.
    pub fn circuit(&self) -> Arc<Module> {
        self.build(None)
    }

    /// The same circuit with nets and cells declared in another order, which is the order in which
    /// a simulator comes upon them within an instant.
    pub fn shuffled_circuit(&self, random: &mut StdRng) -> Arc<Module> {
        self.build(Some(random))
    }

    fn build(&self, mut shuffle: Option<&mut StdRng>) -> Arc<Module> {
        let mut modules: Vec<Arc<Module>> = Vec::new();
        for (level, recipe) in self.modules.iter().enumerate() {
            let is_top = level + 1 == self.modules.len();
            let name = if is_top {
                "top".to_owned()
            } else {
                format!("level{level}")
            };
            let module = Placement::new(
                &name,
                recipe,
                &modules,
                self.has_gate_loops,
                shuffle.as_deref_mut(),
            )
            .finish();
            modules.push(module);
        }
        modules.pop().expect("there is a top")
    }

    fn on_grid(&self, fs: u32) -> u32 {
        fs.next_multiple_of(self.grid_fs)
    }

    /// Random delays of every arc in every corner.
    pub fn cell_library(&self) -> Library {
        let mut random = StdRng::seed_from_u64(self.delay_seed);
        let mut fs = || self.on_grid(random.random_range(DELAYS_FS));
        let mut delay = || Delay {
            min_fs: fs(),
            typ_fs: fs(),
            max_fs: fs(),
        };
        let mut library = Library::default();
        for kind in CellKind::ALL {
            let has = |mask: u16| mask >> kind as u16 & 1 == 1;
            let mut arcs: CellArcs = [(); MAX_INPUTS].map(|()| DelayArc {
                rise: delay(),
                fall: delay(),
            });
            for pin in 0..MAX_INPUTS {
                if has(self.uniform) {
                    arcs[pin] = arcs[0];
                }
                if has(self.symmetric) {
                    arcs[pin].fall = arcs[pin].rise;
                }
            }
            library.set_arcs(kind, arcs);
        }
        library
    }

    /// Everything driven into the circuit's inputs, in time order; no input takes two values in
    /// one instant.
    pub fn drives(&self, netlist: &Netlist) -> Vec<Drive> {
        let inputs = netlist.inputs();
        let mut values: BTreeMap<(Time, usize), Logic> = BTreeMap::new();
        if self.starts_known {
            for input in 0..inputs.len() {
                let value = Logic::from(self.delay_seed >> input & 1 == 1);
                values.insert((Time::ZERO, input), value);
            }
        }
        let mut time = Time::ZERO;
        for instant in &self.stimulus {
            for &(input, value) in &instant.drives {
                let input = input as usize % inputs.len();
                values.insert((time, input), Logic::from_bits(value));
            }
            time += Time::from_fs(self.on_grid(instant.gap_fs) as i64);
        }
        let drives = values.into_iter();
        drives
            .map(|((time, input), value)| Drive::new(time, inputs[input], value))
            .collect()
    }
}

/// A cell or an instance with its connections, still to be placed.
enum Pending<'a> {
    Cell(CellKind, Vec<Net>, Vec<Net>),
    Instance(&'a Arc<Module>, Vec<(String, Vec<Net>)>),
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
    fn new(
        name: &str,
        recipe: &'a Recipe,
        children: &'a [Arc<Module>],
        has_gate_loops: bool,
        shuffle: Option<&mut StdRng>,
    ) -> Self {
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
        placement
    }

    fn finish(self) -> Arc<Module> {
        self.builder.finish().unwrap()
    }

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
        let known = |nets: &[Net]| {
            nets.iter()
                .copied()
                .filter(|n| n.is_some())
                .collect::<Vec<_>>()
        };
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
                    let connections: Vec<(&str, &[Net])> = connections
                        .iter()
                        .map(|(name, nets)| (name.as_str(), nets.as_slice()))
                        .collect();
                    self.builder.instance(&name, module, &connections);
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
            for bit in 0..width {
                places.push(match item.outputs >> port & 7 {
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
    fn declare_outputs(&mut self) -> Vec<Vec<Net>> {
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
        let mut nets: Vec<Vec<Net>> = Vec::new();
        for (index, places) in places.iter().enumerate() {
            let net = |(bit, place): (usize, &Output)| match place {
                Output::Port => builder.output(&format!("O{index}_{bit}")),
                Output::WireBus => wire_bus.next().expect("counted"),
                Output::PortBus => port_bus.next().expect("counted"),
                Output::Wire | Output::Open => Net::NONE,
            };
            nets.push(places.iter().enumerate().map(net).collect());
        }
        // Ports have their order, but single wires may come in any.
        for &index in &self.order {
            for (bit, place) in places[index].iter().enumerate() {
                if *place == Output::Wire {
                    nets[index][bit] = builder.wire(&format!("W{index}_{bit}"));
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

    fn cell(&self, kind: CellKind, item: &Item, outputs: &[Net]) -> Pending<'a> {
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

    fn instance(&self, item: &Item, outputs: &[Net]) -> Pending<'a> {
        let child = self.child(item);
        let mut connections: Vec<(String, Vec<Net>)> = Vec::new();
        for (port, (name, width)) in ports(child, Direction::Input).enumerate() {
            // Neighbours become a slice of a bus, where they lie in one.
            let first = item.pins[port % MOST_INPUTS];
            let bit = |bit: usize| match first & 1 {
                1 => self.pool[(first as usize / 2 + bit) % self.pool.len()],
                _ => self.choose(item.pins[(port + bit) % MOST_INPUTS]),
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
