//! Random P-counters, as a user might write them: legal ones of several kinds, and ones with state that they must not have.
//!
//! ```text
//!   COUNTER_INIT ─► memory, of a random kind ─► counter, of a random kind ─ HIT ─► (hidden state) ─► flip-flop ─► LOCAL_STOP
//! ```
//!
//! HIT is high in the one state of the counter that the memory chooses. Each counter goes through the JSON of Yosys.

use guided_dtof::chip::{AfterBorrow, OwnBlock, PCounter, SensorConfig, Tap};
use guided_dtof::netlist::Module;
use rand::{RngExt, rngs::StdRng};

use crate::yosys;
use counter_circuit::Circuit;

mod counter_circuit;

/// What counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CounterKind {
    /// Binary, up, with a comparator.
    Up,
    /// One flip-flop for each state, and a decoder of the memory.
    Ring,
    /// Half as many, and such a decoder.
    Johnson,
    /// Binary, down; COUNTER_RESET loads it from the memory.
    Load,
    /// A shift register with feedback, with a comparator.
    Feedback,
    /// Without a memory: a pulse of MEMORY_LOAD's edge loads it.
    Memoryless,
}

impl CounterKind {
    pub const ALL: [CounterKind; 6] = [
        CounterKind::Up,
        CounterKind::Ring,
        CounterKind::Johnson,
        CounterKind::Load,
        CounterKind::Feedback,
        CounterKind::Memoryless,
    ];
}

/// What a counter remembers besides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Hidden {
    /// Nothing.
    Nothing,
    /// State that does not lead to LOCAL_STOP: legal.
    Aside,
    /// Whether LOCAL_STOP has risen since the reset: legal where the counter then holds.
    Rounds,
    /// COUNTER_INIT itself instead of a bit of the memory.
    Init,
    /// COUNTER_INIT, taken by COUNTER_CLK.
    Clocked,
    /// Laser cycles, until 1, 3, 7 … of them are over.
    Cycles,
    /// A bit that COUNTER_CLK clocks and nothing resets.
    Free,
    /// A bit of the count that COUNTER_RESET resets with the next edge of COUNTER_CLK.
    Synchronous,
    /// A bit of the count that COUNTER_RESET resets where another bit is high.
    Gated,
    /// A memory that follows COUNTER_INIT while MEMORY_LOAD is high.
    Transparent,
    /// A memory that MEMORY_LOAD's falling edge loads.
    Late,
    /// A memory that adds what is loaded to what it had.
    Adding,
    /// A memory that LOCAL_STOP clears.
    Moving,
    /// COUNTER_RESET in a counter without memory.
    Reset,
}

impl Hidden {
    const WITH_MEMORY: [Hidden; 13] = [
        Hidden::Nothing,
        Hidden::Aside,
        Hidden::Rounds,
        Hidden::Init,
        Hidden::Clocked,
        Hidden::Cycles,
        Hidden::Free,
        Hidden::Synchronous,
        Hidden::Gated,
        Hidden::Transparent,
        Hidden::Late,
        Hidden::Adding,
        Hidden::Moving,
    ];
    const WITHOUT: [Hidden; 7] = [
        Hidden::Nothing,
        Hidden::Aside,
        Hidden::Rounds,
        Hidden::Init,
        Hidden::Cycles,
        Hidden::Free,
        Hidden::Reset,
    ];
}

/// A counter.
#[derive(Debug)]
pub struct RandomCounter {
    pub kind: CounterKind,
    pub hidden: Hidden,
    /// The sensor with it, not checked.
    pub config: SensorConfig,
    /// What a refusal names; nothing where the counter is legal.
    pub named: Option<&'static str>,
}

/// Number `which` of all kinds with all that they might hide; `random` decides the rest.
pub fn drawn(which: usize, random: &mut StdRng) -> RandomCounter {
    let hidden_states = |kind: CounterKind| match kind {
        CounterKind::Memoryless => &Hidden::WITHOUT[..],
        _ => &Hidden::WITH_MEMORY[..],
    };
    let all = CounterKind::ALL.into_iter().flat_map(|kind| {
        hidden_states(kind)
            .iter()
            .map(move |&hidden| (kind, hidden))
    });
    let all: Vec<(CounterKind, Hidden)> = all.collect();
    let (kind, hidden) = all[which % all.len()];
    let has_memory = kind != CounterKind::Memoryless;
    let wraps = !has_memory || random.random_bool(0.3);
    let after_borrow = if wraps {
        AfterBorrow::Wrap
    } else {
        AfterBorrow::Hold
    };
    let config = SensorConfig {
        counter_bits: random.random_range(3..6),
        after_borrow,
        p_counter: if has_memory {
            PCounter::Ripple
        } else {
            PCounter::Memoryless
        },
        tap: if has_memory { Tap::Borrow } else { Tap::Msb },
        clk_hz: random.random_range(50e6..150e6),
        bins: random.random_range(2..9),
        ..SensorConfig::default()
    };
    let (module, named) = Circuit::new(config.counter_bits, random).build(kind, hidden, wraps);
    let json = yosys::json(&module);
    let module = Module::from_yosys(&json, None).unwrap();
    RandomCounter {
        kind,
        hidden,
        config: SensorConfig {
            p_counter_block: Some(OwnBlock::from_module("random.json", module, &json)),
            ..config
        },
        named,
    }
}
