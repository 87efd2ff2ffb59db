//! The feed-forward part of the netlist as expressions over time.
//!
//! A net of class `Stream` is a sequence V\[k\]: its value just before rising CLK edge k, in every macropixel.
//!
//! ```text
//!   input s            P[k]  parity of the pulses of SPAD s that edge k takes
//!   toggle flip-flop   V[k] = V[k-1] ^ P[k]
//!   flip-flop on CLK   V[k] = D[k-1]               no work: the same sequence, a period later
//!   gate               V[k] = f(A[k], B[k], …)
//! ```
//!
//! So registers cost nothing, however long a shift register is, and any number of periods is computed at once.
//! Delays common to a gate's inputs move behind the gate. Two identities are worth knowing: a toggle's sequence
//! against itself a period later is P, and a full adder's carry is a majority. Constants (TYPE, THRESHOLD) fold,
//! and equal expressions are built once.

use std::collections::HashMap;

use super::survey::{Class, Survey};
use super::unlevelled::LevelisationError;
use crate::netlist::{CellKind, NetId};

/// An expression, `delay` periods late, perhaps inverted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Literal {
    /// Index into [`Expressions::nodes`].
    pub node: usize,
    /// Whole periods.
    pub delay: usize,
    /// Whether it is inverted.
    pub inverted: bool,
}

impl Literal {
    const FALSE: Literal = Literal {
        node: 0,
        delay: 0,
        inverted: false,
    };
    const TRUE: Literal = Literal {
        node: 0,
        delay: 0,
        inverted: true,
    };

    fn plain(node: usize) -> Self {
        Literal {
            node,
            ..Literal::FALSE
        }
    }

    /// The opposite.
    pub(super) fn inverse(self) -> Self {
        self.inverse_if(true)
    }

    fn inverse_if(self, inverted: bool) -> Self {
        Literal {
            inverted: self.inverted ^ inverted,
            ..self
        }
    }

    fn delayed(self, periods: usize) -> Self {
        // A constant is the same at any time.
        let delay = if self.node == 0 {
            0
        } else {
            self.delay + periods
        };
        Literal { delay, ..self }
    }

    fn earlier(self, periods: usize) -> Self {
        let delay = if self.node == 0 {
            0
        } else {
            self.delay - periods
        };
        Literal { delay, ..self }
    }
}

/// How a sequence is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Node {
    /// Always 0.
    Zero,
    /// Parity of one SPAD's pulses.
    Input(usize),
    /// The state of a flip-flop that one SPAD toggles.
    Toggle(usize),
    /// Both.
    And(Literal, Literal),
    /// One of two.
    Xor(Literal, Literal),
    /// An odd number of three.
    Xor3(Literal, Literal, Literal),
    /// Two of three.
    Majority(Literal, Literal, Literal),
    /// The third chooses: the first where it is 0, the second where it is 1.
    Mux(Literal, Literal, Literal),
}

impl Node {
    /// What it reads.
    pub(super) fn inputs(self) -> Vec<Literal> {
        match self {
            Node::Zero | Node::Input(_) => vec![],
            Node::Toggle(spad) => vec![Literal {
                node: 1 + spad,
                ..Literal::FALSE
            }],
            Node::And(a, b) | Node::Xor(a, b) => vec![a, b],
            Node::Xor3(a, b, c) | Node::Majority(a, b, c) | Node::Mux(a, b, c) => vec![a, b, c],
        }
    }

    /// Its value for those of its inputs, inversions included; of a toggle without pulses, 0.
    pub(super) fn value(self, inputs: &[bool]) -> bool {
        match (self, inputs) {
            (Node::And(..), [a, b]) => a & b,
            (Node::Xor(..), [a, b]) => a ^ b,
            (Node::Xor3(..), [a, b, c]) => a ^ b ^ c,
            (Node::Majority(..), [a, b, c]) => a & b | a & c | b & c,
            (Node::Mux(..), [a, b, s]) => {
                if *s {
                    *b
                } else {
                    *a
                }
            }
            _ => false,
        }
    }
}

/// Expressions of a netlist's stream part: node 0 is constant, nodes 1 … are its SPADs.
pub(super) struct Expressions<'s> {
    survey: &'s Survey,
    /// Every node, inputs before what reads them.
    pub(super) nodes: Vec<Node>,
    index: HashMap<Node, usize>,
    of_net: HashMap<NetId, Literal>,
    /// What a register held when the exposure started: (node, delay) → value.
    held: HashMap<(usize, usize), bool>,
}

impl<'s> Expressions<'s> {
    /// None yet.
    pub(super) fn new(survey: &'s Survey) -> Self {
        let spads = survey.spads.len();
        let nodes: Vec<Node> = [Node::Zero]
            .into_iter()
            .chain((0..spads).map(Node::Input))
            .collect();
        Expressions {
            survey,
            index: nodes.iter().enumerate().map(|(i, &n)| (n, i)).collect(),
            nodes,
            of_net: HashMap::new(),
            held: HashMap::new(),
        }
    }

    /// The sequence of a net.
    ///
    /// # Errors
    /// When its registers start with values that it cannot have.
    pub(super) fn of_net(&mut self, net: NetId) -> Result<Literal, LevelisationError> {
        if let Class::Constant(value) = self.survey.class(net) {
            return Ok(Literal::FALSE.inverse_if(value));
        }
        if let Some(&literal) = self.of_net.get(&net) {
            return Ok(literal);
        }
        let (cell, output) = self.survey.driver[net.index()].expect("a stream net has a driver");
        let cell = self.survey.netlist.cells()[cell];
        let literal = if cell.kind.is_flip_flop() {
            let starts = self.survey.initial(net, 0)? ^ (output == 1);
            let q = match self
                .survey
                .spads
                .iter()
                .position(|&spad| spad == cell.input(1))
            {
                Some(spad) => self.node(Node::Toggle(spad)),
                None => self.of_net(cell.input(0))?.delayed(1),
            };
            self.hold(q, starts, net)?;
            q.inverse_if(output == 1)
        } else {
            let inputs = cell.input_nets().map(|net| self.of_net(net));
            let inputs: Result<Vec<_>, _> = inputs.collect();
            self.gate(cell.kind, &inputs?)
        };
        self.of_net.insert(net, literal);
        Ok(literal)
    }

    /// Notes what a register holds before the first edge.
    fn hold(&mut self, q: Literal, starts: bool, net: NetId) -> Result<(), LevelisationError> {
        let value = starts ^ q.inverted;
        let toggles = matches!(self.nodes[q.node], Node::Toggle(_));
        let known = *self.held.entry((q.node, q.delay)).or_insert(value);
        if known != value || toggles && value {
            return Err(LevelisationError::Start(self.survey.name(net)));
        }
        Ok(())
    }

    /// The value of a node `delay` periods before the first edge.
    pub(super) fn history(&self, node: usize, delay: usize) -> bool {
        if let Some(&held) = self.held.get(&(node, delay)) {
            return held;
        }
        let inputs = self.nodes[node].inputs();
        let values: Vec<bool> = inputs
            .iter()
            .map(|l| self.history(l.node, delay + l.delay) ^ l.inverted)
            .collect();
        self.nodes[node].value(&values)
    }

    fn node(&mut self, node: Node) -> Literal {
        let next = self.nodes.len();
        let index = *self.index.entry(node).or_insert(next);
        if index == next {
            self.nodes.push(node);
        }
        Literal::plain(index)
    }

    fn gate(&mut self, kind: CellKind, inputs: &[Literal]) -> Literal {
        match (kind, inputs) {
            (CellKind::Inv, [a]) => a.inverse(),
            (CellKind::Buf, [a]) => *a,
            (CellKind::And2, &[a, b]) => self.and(a, b),
            (CellKind::Nand2, &[a, b]) => self.and(a, b).inverse(),
            (CellKind::Or2, &[a, b]) => self.and(a.inverse(), b.inverse()).inverse(),
            (CellKind::Nor2, &[a, b]) => self.and(a.inverse(), b.inverse()),
            (CellKind::Xor2, &[a, b]) => self.xor(a, b),
            (CellKind::Xnor2, &[a, b]) => self.xor(a, b).inverse(),
            (CellKind::Mux2, &[a, b, s]) => self.mux(a, b, s),
            _ => unreachable!("a gate with its inputs"),
        }
    }

    fn and(&mut self, a: Literal, b: Literal) -> Literal {
        if a == Literal::FALSE || b == Literal::FALSE || a == b.inverse() {
            return Literal::FALSE;
        }
        if a == Literal::TRUE || a == b {
            return b;
        }
        if b == Literal::TRUE {
            return a;
        }
        self.shifted([a.min(b), a.max(b)], |[a, b]| Node::And(a, b))
    }

    fn xor(&mut self, a: Literal, b: Literal) -> Literal {
        let inverted = a.inverted ^ b.inverted;
        let [a, b] = [a, b].map(|l| Literal {
            inverted: false,
            ..l
        });
        let (a, b) = (a.min(b), a.max(b));
        if a.node == 0 {
            return b.inverse_if(inverted);
        }
        if a == b {
            return Literal::FALSE.inverse_if(inverted);
        }
        if let Node::Toggle(spad) = self.nodes[a.node]
            && a.node == b.node
            && a.delay + 1 == b.delay
        {
            return Literal::plain(1 + spad)
                .delayed(a.delay)
                .inverse_if(inverted);
        }
        for (sum, c) in [(a, b), (b, a)] {
            if let Node::Xor(p, q) = self.nodes[sum.node] {
                let mut three = [p.delayed(sum.delay), q.delayed(sum.delay), c];
                three.sort_unstable();
                let odd = self.shifted(three, |[a, b, c]| Node::Xor3(a, b, c));
                return odd.inverse_if(inverted);
            }
        }
        self.shifted([a, b], |[a, b]| Node::Xor(a, b))
            .inverse_if(inverted)
    }

    fn mux(&mut self, a: Literal, b: Literal, s: Literal) -> Literal {
        let (a, b, s) = if s.inverted {
            (b, a, s.inverse())
        } else {
            (a, b, s)
        };
        if s == Literal::FALSE || a == b {
            return a;
        }
        if a == b.inverse() {
            return self.xor(a, s);
        }
        if a.node == 0 || b.node == 0 {
            let (from_a, from_b) = (self.and(s.inverse(), a), self.and(s, b));
            return self.and(from_a.inverse(), from_b.inverse()).inverse();
        }
        // Where two differ the third decides, where they agree either does.
        if let Node::Xor(p, q) = self.nodes[s.node] {
            let (p, q) = (p.delayed(s.delay), q.delayed(s.delay));
            if a == p || a == q {
                let mut three = [p, q, b];
                three.sort_unstable();
                return self.shifted(three, |[a, b, c]| Node::Majority(a, b, c));
            }
        }
        self.shifted([a, b, s], |[a, b, s]| Node::Mux(a, b, s))
    }

    /// A gate whose inputs' common delay comes after it.
    fn shifted<const N: usize>(
        &mut self,
        inputs: [Literal; N],
        make: fn([Literal; N]) -> Node,
    ) -> Literal {
        let common = inputs.iter().map(|l| l.delay).min().unwrap_or(0);
        let node = make(inputs.map(|l| l.earlier(common)));
        self.node(node).delayed(common)
    }
}
