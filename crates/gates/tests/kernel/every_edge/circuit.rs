//! Random circuits, delays and stimuli, in a form that shrinks to something small.
//!
//! A circuit is a list of modules, each of which may instantiate the earlier ones. Its items are
//! numbers that are read modulo what there is to choose from, so that any list is a circuit and
//! any shorter list is one, too.

use std::collections::BTreeMap;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use super::placement::{Item, MOST_INPUTS, Recipe, placed};
use femtogate::kernel::Drive;
use femtogate::logic::Logic;
use femtogate::netlist::{
    CellArcs, CellKind, Corner, Delay, DelayModel, Library, MAX_INPUTS, Module, Netlist, ScopeId,
    Timing, TimingArc,
};
use femtogate::units::Time;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng, rngs::StdRng};

/// Longest and shortest delay, fs.
const DELAYS_FS: std::ops::RangeInclusive<u32> = 1_000..=200_000;

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
        for cell in netlist.cells_below(ScopeId::TOP) {
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

    /// For one case in four: the seed of delays of each instance's own, for an SDF file.
    pub fn sdf_seed(&self) -> Option<u64> {
        self.delay_seed.is_multiple_of(4).then_some(self.delay_seed)
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
            let shuffle = shuffle.as_deref_mut();
            let module = placed(&name, recipe, &modules, self.has_gate_loops, shuffle);
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
        let mut time = || Time::from_fs(self.on_grid(random.random_range(DELAYS_FS)).into());
        let mut delay = || Delay {
            min: time(),
            typ: time(),
            max: time(),
        };
        let mut library = Library::generic_40nm();
        for kind in CellKind::ALL {
            let has = |mask: u16| mask >> kind as u16 & 1 == 1;
            let mut arc = || TimingArc {
                rise: delay(),
                fall: delay(),
            };
            let mut arcs: CellArcs = [(); MAX_INPUTS].map(|()| [arc(), arc()]);
            for pin in 0..MAX_INPUTS {
                if has(self.uniform) {
                    arcs[pin] = arcs[0];
                }
                for arc in arcs[pin].iter_mut().filter(|_| has(self.symmetric)) {
                    arc.fall = arc.rise;
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
