//! The stream part as a straight tape: word operations over a chunk of CLK periods at a time.
//!
//! ```text
//!   photons of the chunk ─► inputs[SPAD][period] ─► operations, each over all periods ─► rings that the passes read
//!                                                                                       [history | this chunk]
//! ```
//!
//! Operations are those of [`Expressions`], a sum and a carry of the same three bits fused into one. What is
//! only used within a chunk lives in few, reused places, so that a block's working set stays in the first-level
//! cache.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use std::cell::Cell;

use multiversion::multiversion;

use super::expression::{Expressions, Literal, Node};
use super::packing::{PERIODS, Packed, Pulse};
use super::unlevelled::LevelisationError;
use super::word::{Word, inversion};
use crate::netlist::NetId;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum OpKind {
    And,
    Xor,
    HalfAdder,
    Xor3,
    Majority,
    FullAdder,
    Mux,
    Toggle,
}

/// One operation over a chunk: places are word indices of its first period.
#[derive(Debug, Clone, Copy)]
struct Op {
    kind: OpKind,
    inputs: [u32; 3],
    invert: [u64; 3],
    /// The result, and the carry of an adder.
    out: [u32; 2],
}

/// A sequence as the passes read it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tap {
    /// Place of the chunk's first period, delay included.
    place: usize,
    invert: u64,
}

/// A node that is remembered from chunk to chunk.
#[derive(Debug, Clone)]
struct Ring {
    start: usize,
    /// Oldest first.
    history: Vec<bool>,
}

/// The tape.
#[derive(Debug, Clone, Default)]
pub(super) struct StreamTape {
    ops: Vec<Op>,
    rings: Vec<Ring>,
    /// Place of each SPAD's input, if it is used.
    inputs: Vec<Option<u32>>,
    words: usize,
    /// For how many chunks after its own a photon can make a difference; `None` is for ever: its parity is read.
    memory: Option<usize>,
}

impl StreamTape {
    /// A tape for these nets, and where each of them is found.
    ///
    /// # Errors
    /// When the registers start with values that they cannot have.
    pub(super) fn new(
        expressions: &mut Expressions<'_>,
        spads: usize,
        nets: &[NetId],
    ) -> Result<(Self, Vec<Tap>), LevelisationError> {
        let roots: Result<Vec<Literal>, _> = nets.iter().map(|&n| expressions.of_net(n)).collect();
        let roots = roots?;
        let mut layout = Layout::new(expressions, &roots);
        let mut tape = StreamTape::default();
        for node in 0..expressions.nodes.len() {
            layout.place(expressions, node, &mut tape);
        }
        tape.words = layout.end;
        tape.memory = layout.memory(expressions, &roots);
        tape.inputs = (1..=spads)
            .map(|n| layout.places[n].map(|p| p as u32))
            .collect();
        let tap = |root: &Literal| Tap {
            place: layout.places[root.node].expect("a root is placed") - root.delay,
            invert: inversion(root.inverted),
        };
        let taps = roots.iter().map(tap).collect();
        Ok((tape, taps))
    }

    /// Words of a block, as they are before the first chunk.
    fn start(&self) -> Vec<Word> {
        let mut words = vec![Word::ZERO; self.words];
        for ring in &self.rings {
            for (word, &value) in words[ring.start..].iter_mut().zip(&ring.history) {
                *word = Word::all(value);
            }
        }
        words
    }

    /// Makes the last chunk the past.
    fn pass_on(&self, words: &mut [Word]) {
        for ring in &self.rings {
            let from = ring.start + PERIODS;
            words.copy_within(from..from + ring.history.len(), ring.start);
        }
    }

    /// Computes a chunk with these pulses in it.
    fn compute(&self, words: &mut [Word], pulses: &[Pulse]) {
        for &place in self.inputs.iter().flatten() {
            words[place as usize..][..PERIODS].fill(Word::ZERO);
        }
        for &pulse in pulses {
            if let Some(place) = self.inputs[pulse.spad()] {
                words[place as usize + pulse.period()].flip(pulse.lane());
            }
        }
        apply_ops(&self.ops, words);
    }
}

/// The stream of one block: chunks are computed when something first reads them, and those that nobody reads are
/// not, nor are their photons looked at.
pub(super) struct Flow<'a> {
    tape: &'a StreamTape,
    pulses: &'a Packed,
    words: Vec<Word>,
    /// The chunk that `words` hold.
    chunk: Option<usize>,
}

impl Tap {
    /// The same sequence, `offset` periods later.
    pub(super) fn delayed_by(self, offset: i8) -> Self {
        Tap {
            place: self.place.wrapping_add_signed(offset.into()),
            ..self
        }
    }
}

impl<'a> Flow<'a> {
    /// A block with these pulses.
    pub(super) fn new(tape: &'a StreamTape, pulses: &'a Packed) -> Self {
        Flow {
            tape,
            pulses,
            words: tape.start(),
            chunk: None,
        }
    }

    /// A sequence just before rising edge `pass`.
    #[inline(always)]
    pub(super) fn read(&mut self, tap: Tap, pass: i64) -> Word {
        let period = self.seek(pass);
        self.words[tap.place.wrapping_add_signed(period)] ^ tap.invert
    }

    /// Adds to `sums` what sequences are in some lanes just before rising edge `pass`.
    #[inline(always)]
    pub(super) fn gather(&mut self, taps: &[Tap], pass: i64, lanes: Word, sums: &mut [Word]) {
        let period = self.seek(pass);
        for (tap, sum) in taps.iter().zip(sums) {
            let value = self.words[tap.place.wrapping_add_signed(period)] ^ tap.invert;
            *sum = *sum | (value & lanes);
        }
    }

    /// Computes the chunk that a pass is in, if it is not yet; the period there. Passes never go back.
    #[inline(always)]
    fn seek(&mut self, pass: i64) -> isize {
        let chunk = pass.max(0) as usize / PERIODS;
        if self.chunk != Some(chunk) {
            self.compute(chunk);
        }
        pass as isize - (chunk * PERIODS) as isize
    }

    /// Computes a chunk, and those before it whose photons it can still feel.
    #[inline(never)]
    fn compute(&mut self, chunk: usize) {
        let next = self.chunk.map_or(0, |last| last + 1);
        let felt = self
            .tape
            .memory
            .map_or(0, |memory| chunk.saturating_sub(memory));
        for chunk in next.max(felt)..=chunk {
            if chunk > 0 {
                self.tape.pass_on(&mut self.words);
            }
            self.tape.compute(&mut self.words, self.pulses.chunk(chunk));
        }
        self.chunk = Some(chunk);
    }
}

/// Where everything goes.
struct Layout {
    /// How far back each node is read; `None` if it is not.
    reach: Vec<Option<usize>>,
    /// Nodes that have yet to read it.
    readers: Vec<usize>,
    places: Vec<Option<usize>>,
    free: Vec<usize>,
    end: usize,
}

/// A pass reads up to two periods before the period that it is in.
const READ_BACK: usize = 2;

impl Layout {
    fn new(expressions: &Expressions<'_>, roots: &[Literal]) -> Self {
        let nodes = &expressions.nodes;
        let mut reach: Vec<Option<usize>> = vec![None; nodes.len()];
        let mut readers = vec![0; nodes.len()];
        let read = |reach: &mut Vec<Option<usize>>, literal: &Literal, back: usize| {
            let least = reach[literal.node].unwrap_or(0);
            reach[literal.node] = Some(least.max(literal.delay + back));
        };
        for root in roots {
            read(&mut reach, root, READ_BACK);
        }
        for node in (0..nodes.len()).rev().filter(|&n| n > 0) {
            if reach[node].is_some() {
                for input in nodes[node].inputs() {
                    read(&mut reach, &input, 0);
                    readers[input.node] += 1;
                }
                if let Node::Toggle(_) = nodes[node] {
                    reach[node] = reach[node].max(Some(1));
                }
            }
        }
        Layout {
            reach,
            readers,
            places: vec![None; nodes.len()],
            free: Vec::new(),
            end: 0,
        }
    }

    /// Chunks before its own that a read of `roots` can depend on, if that ends.
    fn memory(&self, expressions: &Expressions<'_>, roots: &[Literal]) -> Option<usize> {
        let mut periods: Vec<usize> = Vec::new();
        for (node, kind) in expressions.nodes.iter().enumerate() {
            if self.reach[node].is_some() && matches!(kind, Node::Toggle(_)) {
                return None;
            }
            let inputs = kind.inputs();
            let back = inputs.iter().map(|l| l.delay + periods[l.node]);
            periods.push(back.max().unwrap_or(0));
        }
        let back = roots.iter().map(|l| READ_BACK + l.delay + periods[l.node]);
        Some(back.max().unwrap_or(0).div_ceil(PERIODS))
    }

    fn allocate(
        &mut self,
        expressions: &Expressions<'_>,
        node: usize,
        tape: &mut StreamTape,
    ) -> u32 {
        let reach = self.reach[node].unwrap_or(0);
        let place = match self.free.pop_if(|_| reach == 0) {
            Some(place) => place,
            None => {
                let start = self.end;
                self.end += reach + PERIODS;
                start + reach
            }
        };
        if reach > 0 {
            let history = (1..=reach)
                .rev()
                .map(|delay| expressions.history(node, delay))
                .collect();
            tape.rings.push(Ring {
                start: place - reach,
                history,
            });
        }
        self.places[node] = Some(place);
        place as u32
    }

    fn place(&mut self, expressions: &Expressions<'_>, node: usize, tape: &mut StreamTape) {
        let nodes = &expressions.nodes;
        if self.reach[node].is_none() || self.places[node].is_some() {
            return;
        }
        let partner = |wanted: Node| {
            let index = nodes.iter().position(|&n| n == wanted);
            index.filter(|&n| self.reach[n].is_some() && self.places[n].is_none())
        };
        use Node as N;
        let (kind, partner) = match nodes[node] {
            N::Zero => {
                self.allocate(expressions, node, tape);
                // No register delays a constant, so that a pass that samples after its rising edge reads a period ahead.
                self.end += 1;
                return;
            }
            N::Input(_) => {
                self.allocate(expressions, node, tape);
                return;
            }
            N::Toggle(_) => (OpKind::Toggle, None),
            N::Mux(..) => (OpKind::Mux, None),
            N::And(a, b) => match partner(N::Xor(a, b)) {
                Some(sum) => (OpKind::HalfAdder, Some(sum)),
                None => (OpKind::And, None),
            },
            N::Xor(a, b) => match partner(N::And(a, b)) {
                Some(carry) => (OpKind::HalfAdder, Some(carry)),
                None => (OpKind::Xor, None),
            },
            N::Majority(a, b, c) => match partner(N::Xor3(a, b, c)) {
                Some(sum) => (OpKind::FullAdder, Some(sum)),
                None => (OpKind::Majority, None),
            },
            N::Xor3(a, b, c) => match partner(N::Majority(a, b, c)) {
                Some(carry) => (OpKind::FullAdder, Some(carry)),
                None => (OpKind::Xor3, None),
            },
        };
        let literals = nodes[node].inputs();
        let mut op = Op {
            kind,
            inputs: [0; 3],
            invert: [0; 3],
            out: [0; 2],
        };
        for (pin, literal) in literals.iter().enumerate() {
            let place = self.places[literal.node].expect("inputs come first");
            op.inputs[pin] = (place - literal.delay) as u32;
            op.invert[pin] = inversion(literal.inverted);
        }
        let sum_first = matches!(nodes[node], N::Xor(..) | N::Xor3(..));
        let own = self.allocate(expressions, node, tape);
        op.out = match partner {
            None => [own, own],
            Some(other) => {
                let theirs = self.allocate(expressions, other, tape);
                if sum_first {
                    [own, theirs]
                } else {
                    [theirs, own]
                }
            }
        };
        tape.ops.push(op);
        // An adder reads its inputs for two nodes.
        let reads = if partner.is_some() { 2 } else { 1 };
        for literal in literals {
            self.readers[literal.node] -= reads;
            let is_free = self.readers[literal.node] == 0 && self.reach[literal.node] == Some(0);
            if is_free && !matches!(nodes[literal.node], N::Input(_)) {
                self.free.push(self.places[literal.node].expect("placed"));
            }
        }
    }
}

/// The periods of a chunk that begins at `place`.
#[inline(always)]
fn chunk(words: &[Cell<Word>], place: u32) -> &[Cell<Word>] {
    &words[place as usize..][..PERIODS]
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn apply_ops(ops: &[Op], words: &mut [Word]) {
    let words = Cell::from_mut(words).as_slice_of_cells();
    for op in ops {
        let [a, b, c] = op.inputs;
        let [out, carry] = op.out;
        let (a, b, c) = (chunk(words, a), chunk(words, b), chunk(words, c));
        let (out, carry) = (chunk(words, out), chunk(words, carry));
        let [ia, ib, ic] = op.invert;
        for t in 0..PERIODS {
            let (a, b) = (a[t].get(), b[t].get());
            match op.kind {
                OpKind::And => out[t].set((a ^ ia) & (b ^ ib)),
                OpKind::Xor => out[t].set(a ^ b),
                OpKind::HalfAdder => {
                    out[t].set(a ^ b);
                    carry[t].set(a & b);
                }
                OpKind::Xor3 => out[t].set(a ^ b ^ c[t].get()),
                OpKind::Majority => {
                    let (a, b, c) = (a ^ ia, b ^ ib, c[t].get() ^ ic);
                    out[t].set((a & b) | (a & c) | (b & c));
                }
                OpKind::FullAdder => {
                    let c = c[t].get();
                    out[t].set(a ^ b ^ c);
                    carry[t].set((a & b) | (a & c) | (b & c));
                }
                OpKind::Mux => {
                    let select = c[t].get();
                    out[t].set(((a ^ ia) & !select) | ((b ^ ib) & select));
                }
                OpKind::Toggle => {
                    let state = words[op.out[0] as usize + t - 1].get();
                    out[t].set(state ^ a);
                }
            }
        }
    }
}
