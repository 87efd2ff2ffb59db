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

use std::ops::Range;

use super::stream::{Flow, Tap};
use super::word::Word;

/// Place of a word that is always 0.
pub(super) const ZERO: u16 = 0;
/// Place of a word that nobody reads.
pub(super) const SINK: u16 = 1;

/// What an action computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Code {
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
    /// Reset and set of a flip-flop: (), (), reset, set. Reset wins.
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
pub(super) struct Action {
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

impl Action {
    /// An action for both directions that reads nothing and wakes nobody yet.
    pub(super) fn new(code: Code, out: u16) -> Self {
        Action {
            code,
            inputs: [ZERO; 4],
            invert: [0; 5],
            out,
            directions: [u64::MAX; 2],
            masks: [SINK; 2],
            wakes: [0; 3],
            traps: [false; 2],
            is_doubtful: false,
        }
    }
}

/// The tape.
#[derive(Debug, Clone, Default)]
pub(super) struct PassTape {
    /// Actions in order of arrival.
    pub actions: Vec<Action>,
    /// Actions that are woken.
    pub wakes: Vec<u16>,
    /// The actions of CLK's edges, in every pass.
    pub clock: Vec<u16>,
    /// What the flip-flops sample of the stream.
    pub taps: Vec<Tap>,
    /// Passes within which all that follows a sample is over.
    pub settling: i64,
}

impl PassTape {
    /// What a change of an action's result wakes.
    #[inline(always)]
    pub(super) fn woken(&self, action: &Action, direction: usize) -> &[u16] {
        &self.wakes[action.wakes[direction] as usize..action.wakes[direction + 1] as usize]
    }
}

/// A set of actions.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Bits(pub Vec<u64>);

impl Bits {
    /// Without any of `count` actions.
    pub(super) fn new(count: usize) -> Self {
        Bits(vec![0; count.div_ceil(64)])
    }

    /// Adds one; whether it was new.
    #[inline(always)]
    pub(super) fn insert(&mut self, index: u16) -> bool {
        let word = &mut self.0[usize::from(index >> 6)];
        let old = *word;
        *word |= 1 << (index & 63);
        *word != old
    }

    /// Takes one out.
    #[inline(always)]
    pub(super) fn remove(&mut self, index: u16) {
        self.0[usize::from(index >> 6)] &= !(1 << (index & 63));
    }

    /// Takes out a range of them, if all are in the set; whether they were.
    #[inline(always)]
    pub(super) fn remove_range(&mut self, range: &Range<u16>) -> bool {
        for index in range.start..range.end {
            if !self.contains(index) {
                return false;
            }
        }
        for index in range.start..range.end {
            self.remove(index);
        }
        true
    }

    /// Whether it is in the set.
    #[inline(always)]
    pub(super) fn contains(&self, index: u16) -> bool {
        self.0[usize::from(index >> 6)] >> (index & 63) & 1 == 1
    }

    /// Whether none is.
    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        let mut any = 0;
        for word in &self.0 {
            any |= word;
        }
        any == 0
    }

    /// The first one from `from` on that is also in `among`.
    #[inline(always)]
    pub(super) fn next_among(&self, among: &Bits, from: u16) -> Option<u16> {
        let mut group = usize::from(from >> 6);
        let mut bits = self.0.get(group)? & among.0[group] & u64::MAX << (from & 63);
        while bits == 0 {
            group += 1;
            bits = self.0.get(group)? & among.0[group];
        }
        Some((group * 64) as u16 + bits.trailing_zeros() as u16)
    }
}

/// One block of macropixels.
#[derive(Debug, Clone)]
pub(super) struct Block {
    /// Values of nets and masks of lanes.
    pub words: Vec<Word>,
    /// Actions to run, a bit each.
    pub pending: Bits,
    /// Where the first effect goes that the tape has no place for.
    pub trapped: Option<u16>,
}

impl Block {
    /// A block whose nets have these values.
    pub(super) fn new(tape: &PassTape, words: Vec<Word>) -> Self {
        Block {
            words,
            pending: Bits::new(tape.actions.len()),
            trapped: None,
        }
    }

    /// Notes that an action's effect is not known.
    #[cold]
    pub(super) fn doubt(&mut self, action: &Action) {
        self.trapped.get_or_insert(action.out);
    }

    /// Whether nothing is on its way.
    pub(super) fn is_settled(&self) -> bool {
        self.pending.is_empty()
    }
}

/// Runs one action; whether any lane rose, and fell.
#[inline(always)]
pub(super) fn step(
    action: &Action,
    words: &mut [Word],
    taps: &[Tap],
    flow: &mut Flow<'_>,
    pass: i64,
) -> [bool; 2] {
    let [a, b, c, d] = action.inputs;
    let (a, b, c, d) = (
        usize::from(a),
        usize::from(b),
        usize::from(c),
        usize::from(d),
    );
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
        Code::FlipFlop => {
            let edge = clocked(action, words);
            (old & !edge) | ((words[a] ^ ia) & edge)
        }
        Code::Sampler { .. } => sampled(action, words, taps, flow, pass),
    };
    change(action, words, new)
}

/// Gives an action its result; whether any lane rose, and fell.
#[inline(always)]
pub(super) fn change(action: &Action, words: &mut [Word], new: Word) -> [bool; 2] {
    let old = words[usize::from(action.out)];
    let [rising, falling] = action.directions;
    let rise = new & !old & rising;
    let fall = !new & old & falling;
    words[usize::from(action.out)] = (old | rise) & !fall;
    words[usize::from(action.masks[0])] = rise;
    words[usize::from(action.masks[1])] = fall;
    [rise.any(), fall.any()]
}

/// Lanes in which a flip-flop's clock has risen, and neither reset nor set holds it.
#[inline(always)]
pub(super) fn clocked(action: &Action, words: &[Word]) -> Word {
    let [_, edge, reset, set] = action.inputs;
    let [_, _, ireset, iset, _] = action.invert;
    words[usize::from(edge)]
        & !(words[usize::from(reset)] ^ ireset)
        & !(words[usize::from(set)] ^ iset)
}

/// What a sampler holds when it has sampled.
#[inline(always)]
fn sampled(action: &Action, words: &[Word], taps: &[Tap], flow: &mut Flow<'_>, pass: i64) -> Word {
    let Code::Sampler { tap, offset } = action.code else {
        unreachable!("a sampler")
    };
    let edge = clocked(action, words);
    let data = flow.read(taps[usize::from(tap)].delayed_by(offset), pass);
    (words[usize::from(action.out)] & !edge) | (data & edge)
}

/// Whether a flip-flop's clock has risen in a lane that neither reset nor set holds.
#[cold]
pub(super) fn counts(action: &Action, words: &[Word]) -> bool {
    clocked(action, words).any()
}
