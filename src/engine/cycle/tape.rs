//! The rest of the netlist as a tape: everything that can happen in a CLK period, in order of arrival.
//!
//! ```text
//!   a pass = one CLK period, from falling edge to falling edge
//!
//!   CLK↓ ─► COUNTER_CLK↑ ─► counter 0 ─► out 0 ─► counter 1 ─► … ─► LOCAL_STOP ─► STROBE ─► HIT ─► bit 0 ─► …
//!        action 0    1            2         3    …                     (a STOP edge's actions lie between them)
//! ```
//!
//! An action evaluates one cell for one cause, in all lanes of a block. What rose and what fell is a mask of
//! lanes; a mask that is empty wakes nobody, so that a carry stops where no lane carries on, and idle counters
//! cost nothing. An action that another one wakes lies behind it on the tape, or in front of it if it is due
//! only after the next falling edge: then it waits for the next pass.

use multiversion::multiversion;

use super::stream::Tap;
use super::word::Word;

/// Place of a word that is always 0.
pub const ZERO: u16 = 0;
/// Place of a word that nobody reads.
pub const SINK: u16 = 1;

/// What an action computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Code {
    /// A net that all macropixels share takes a value.
    Set(bool),
    /// a AND b.
    And,
    /// a XOR b.
    Xor,
    /// c ? b : a.
    Mux,
    /// Clock of a flip-flop whose D is its own Q̄ and that cannot be set: (), clock edge, reset. Lanes that are reset
    /// ignore it.
    Toggle,
    /// Clock of a flip-flop: D, clock edge, reset, set.
    FlipFlop,
    /// Reset and set of a flip-flop: (), (), reset, set.
    Async,
    /// Clock of a flip-flop whose D is a stream.
    Sampler {
        /// Which one.
        tap: u16,
        /// Rising CLK edges between this pass's falling edge and the instant of sampling.
        offset: i8,
    },
}

/// One step of the tape.
#[derive(Debug, Clone, Copy)]
pub struct Action {
    /// What is computed.
    pub code: Code,
    /// Places of the inputs.
    pub inputs: [u16; 4],
    /// All ones where an input, and last the output of a gate, is inverted.
    pub invert: [u64; 5],
    /// Place of the result.
    pub out: u16,
    /// All ones if lanes may rise, and fall: an action may be for one direction only.
    pub directions: [u64; 2],
    /// Where the masks of lanes that rose, and that fell, go.
    pub masks: [u16; 2],
    /// Ends of what rising and falling lanes wake, in [`PassTape::wakes`].
    pub wakes: [u32; 3],
    /// Whether a rise, or a fall, goes where the tape cannot follow.
    pub traps: [bool; 2],
    /// Whether a flip-flop's clock, should it rise while the flip-flop is not reset, comes at an uncertain time.
    pub is_doubtful: bool,
}

/// The tape.
#[derive(Debug, Clone, Default)]
pub struct PassTape {
    /// Actions in order of arrival.
    pub actions: Vec<Action>,
    /// Actions that are woken.
    pub wakes: Vec<u16>,
    /// The actions of CLK's edges, in every pass.
    pub clock: Vec<u16>,
    /// What the flip-flops sample of the stream.
    pub taps: Vec<Tap>,
}

/// One block of macropixels.
#[derive(Debug, Clone)]
pub struct Block {
    /// Values of nets and masks of lanes.
    pub words: Vec<Word>,
    /// Actions to run, a bit each.
    pending: Vec<u64>,
    /// The first action whose effect the tape has no place for.
    pub trapped: Option<usize>,
}

impl Block {
    /// A block whose nets have these values.
    pub fn new(tape: &PassTape, words: Vec<Word>) -> Self {
        Block {
            words,
            pending: vec![0; tape.actions.len().div_ceil(64)],
            trapped: None,
        }
    }

    /// Whether nothing is on its way.
    pub fn is_settled(&self) -> bool {
        self.pending.iter().all(|&word| word == 0)
    }
}

/// Passes to run: those of one chunk, or a few at the ends.
pub struct Passes<'a> {
    /// First pass, from the first of the chunk that the stream is in.
    pub first: isize,
    /// How many.
    pub count: usize,
    /// How many of them have CLK edges.
    pub clocked: usize,
    /// Other causes (pass, action) in order of passes, counted from `first`.
    pub causes: &'a [(usize, u16)],
}

/// Runs some passes of one block.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub fn run(tape: &PassTape, block: &mut Block, stream: &[Word], passes: &Passes<'_>) {
    let Block {
        words,
        pending,
        trapped,
    } = block;
    let mut causes = passes.causes.iter().peekable();
    for pass in 0..passes.count {
        if pass < passes.clocked {
            for &action in &tape.clock {
                pending[usize::from(action >> 6)] |= 1 << (action & 63);
            }
        }
        while let Some((_, action)) = causes.next_if(|(due, _)| *due == pass) {
            pending[usize::from(action >> 6)] |= 1 << (action & 63);
        }
        let period = passes.first + pass as isize;
        for group in 0..pending.len() {
            // Actions that have had their turn in this pass wait for the next one.
            let mut ahead = u64::MAX;
            loop {
                let bits = pending[group] & ahead;
                if bits == 0 {
                    break;
                }
                let bit = bits.trailing_zeros();
                pending[group] &= !(1 << bit);
                ahead = u64::MAX << 1 << bit;
                let index = group * 64 + bit as usize;
                let action = &tape.actions[index];
                if action.is_doubtful && counts(action, words) {
                    trapped.get_or_insert(index);
                }
                let changed = step(action, words, &tape.taps, stream, period);
                for (direction, _) in changed.iter().enumerate().filter(|(_, moved)| **moved) {
                    let ends =
                        action.wakes[direction] as usize..action.wakes[direction + 1] as usize;
                    for &next in &tape.wakes[ends] {
                        pending[usize::from(next >> 6)] |= 1 << (next & 63);
                    }
                    if action.traps[direction] {
                        trapped.get_or_insert(index);
                    }
                }
            }
        }
    }
}

/// Runs one action; whether any lane rose, and fell.
#[inline(always)]
fn step(
    action: &Action,
    words: &mut [Word],
    taps: &[Tap],
    stream: &[Word],
    period: isize,
) -> [bool; 2] {
    let [a, b, c, d] = action.inputs.map(usize::from);
    let [ia, ib, ic, id, io] = action.invert;
    let old = words[usize::from(action.out)];
    let new = match action.code {
        Code::Set(value) => Word::all(value),
        Code::And => ((words[a] ^ ia) & (words[b] ^ ib)) ^ io,
        Code::Xor => words[a] ^ words[b] ^ io,
        Code::Mux => {
            let select = words[c] ^ ic;
            (((words[a] ^ ia) & !select) | ((words[b] ^ ib) & select)) ^ io
        }
        Code::Toggle => old ^ (words[b] & !(words[c] ^ ic)),
        Code::Async => (old | (words[d] ^ id)) & !(words[c] ^ ic),
        Code::FlipFlop | Code::Sampler { .. } => {
            let data = match action.code {
                Code::Sampler { tap, offset } => {
                    taps[usize::from(tap)].read(stream, period + isize::from(offset))
                }
                _ => words[a] ^ ia,
            };
            let edge = words[b] & !(words[c] ^ ic) & !(words[d] ^ id);
            (old & !edge) | (data & edge)
        }
    };
    let [rising, falling] = action.directions;
    let rise = new & !old & rising;
    let fall = !new & old & falling;
    words[usize::from(action.out)] = (old | rise) & !fall;
    words[usize::from(action.masks[0])] = rise;
    words[usize::from(action.masks[1])] = fall;
    [rise.any(), fall.any()]
}

/// Whether a flip-flop's clock has risen in a lane that is not reset.
#[cold]
fn counts(action: &Action, words: &[Word]) -> bool {
    let [_, edge, reset, _] = action.inputs.map(|place| words[usize::from(place)]);
    let inverted = action.invert[2];
    (edge & !(reset ^ inverted)).any()
}
