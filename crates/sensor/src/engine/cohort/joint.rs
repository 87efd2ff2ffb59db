//! The joint state of a macropixel's SPADs, cohort by cohort.
//!
//! Laser cycles whose SPADs fired at the same steps form a cohort; which SPAD is which does not matter. Cohorts are the
//! nodes of a tree: the way from the root tells the avalanches that still matter, newest first.
//!
//! ```text
//!   root: all SPADs rested ── n cycles
//!    ├─ 7 ── one SPAD fired in step 7
//!    │  └─ 5 ── one in step 7, one in step 5
//!    └─ 5 ── one SPAD fired in step 5
//! ```
//!
//! In each step a binomial draw takes the cycles of a node in which something happens out of it, and further ones tell
//! what. When an avalanche is forgotten, its nodes are leaves, and fold into their parents. Only nodes with cycles
//! in them cost anything; nothing is rounded or merged that differs.
//!
//! Events of several SPADs are counted here five times faster than by the engine `window`, with 16 000 laser cycles.

use smallvec::SmallVec;

use super::Counts;
use super::blindness::{Ages, Blindness};
use super::cycles::LikeCycles;
use super::draw::binomial;
use super::events::EventTable;
use super::hits::Hits;
use super::words::RandomWords;
use crate::chip::MOST_SPADS;
use crate::photon::DeadTimeLaw;

/// Counts of every bin after these laser cycles.
pub(super) fn draw_counts(
    like: &LikeCycles,
    is_event: &EventTable,
    random: &mut RandomWords,
) -> Counts {
    let mut tree = Tree::new(&like.blindness, is_event.spads(), like.cycles);
    tree.age(&like.ages, random);
    like.means
        .iter()
        .map(|&mean| {
            tree.advance(mean, random);
            let count = tree.count(is_event);
            tree.forget();
            count
        })
        .collect()
}

/// An avalanche on the way to a node: its step, and whether it made a pulse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Avalanche {
    step: u32,
    pulse: bool,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    /// Cycles in this state.
    cycles: u64,
    /// The node without the oldest avalanche.
    parent: u32,
    oldest: Avalanche,
    /// SPADs with an avalanche that matters.
    depth: u8,
    first_child: u32,
    next_sibling: u32,
}

const ROOT: u32 = 0;
const NONE: u32 = u32::MAX;

struct Tree<'a> {
    blindness: &'a Blindness,
    spads: usize,
    nodes: Vec<Node>,
    unused: Vec<u32>,
    laws: Laws,
    /// Nodes that hold cycles in the present step.
    live: Vec<u32>,
    /// Nodes by the step of their oldest avalanche, parents before children.
    by_step: Vec<Vec<u32>>,
    /// First step that is not forgotten.
    remembered: u32,
    /// The step to come.
    step: u32,
}

/// SPADs that behave alike in a step: those that are free, or those with one and the same avalanche.
#[derive(Debug, Clone, Copy)]
struct Group {
    avalanche: Option<Avalanche>,
    /// Of [`Laws`].
    hits: usize,
    /// Probability that a hit makes a pulse.
    able: f64,
    /// Probability that anything happens in this group or one after it, and its complement.
    any_from_here: f64,
    none_from_here: f64,
}

impl Group {
    /// A group without avalanches, the last one.
    fn free(number: usize, hits: &Hits, able: f64) -> Self {
        Group {
            avalanche: None,
            hits: number,
            able,
            any_from_here: hits.any(),
            none_from_here: hits.none(),
        }
    }
}

/// Laws of the number of SPADs that are hit in the present step, by the number that can be. There are few different
/// laws, and many nodes.
#[derive(Debug, Clone, Default)]
struct Laws {
    laws: Vec<Hits>,
    /// Index of the law for each number of SPADs, plus 1, by the class of SPADs.
    numbers: Vec<[u16; MOST_SPADS + 1]>,
}

impl Laws {
    fn forget(&mut self) {
        self.laws.clear();
        self.numbers.clear();
    }

    /// The law of `spads` SPADs, each of which is hit with `p`; `q` is 1 − `p`. Both are the same for all of a class.
    fn number(&mut self, class: usize, spads: usize, p: f64, q: f64) -> usize {
        if self.numbers.len() <= class {
            self.numbers.resize(class + 1, [0; MOST_SPADS + 1]);
        }
        let known = &mut self.numbers[class][spads];
        if *known == 0 {
            self.laws.push(Hits::new(spads, p, q));
            *known = self.laws.len() as u16;
        }
        usize::from(*known) - 1
    }
}

/// The class of SPADs that are free, and of all where every photon counts.
const FREE: usize = 0;

/// What became of a node's SPADs in a step.
#[derive(Debug, Clone, Default)]
struct Outcome {
    /// Avalanches that newer ones replaced, oldest first.
    replaced: Vec<Avalanche>,
    pulses: usize,
    silent: usize,
}

impl<'a> Tree<'a> {
    fn new(blindness: &'a Blindness, spads: usize, cycles: u64) -> Self {
        let root = Node {
            cycles,
            parent: NONE,
            oldest: Avalanche {
                step: 0,
                pulse: false,
            },
            depth: 0,
            first_child: NONE,
            next_sibling: NONE,
        };
        Tree {
            blindness,
            spads,
            nodes: vec![root],
            unused: Vec::new(),
            laws: Laws::default(),
            live: Vec::new(),
            by_step: Vec::new(),
            remembered: 0,
            step: 0,
        }
    }

    /// Draws the state at the start: independent SPADs, each with the probabilities `ages`.
    fn age(&mut self, ages: &Ages, random: &mut RandomWords) {
        let mut younger: f64 = 1.0;
        for &share in ages.aged.iter().rev() {
            let p = Ages::conditional_share(share, younger);
            younger -= share;
            self.laws.forget();
            self.each_node(|tree, node| {
                let group = tree.free(node, p, 1.0 - p, 0.0);
                let taken = tree.draw_cycles(node, &group, random);
                tree.spread(node, taken, &[group], true, &Outcome::default(), random);
            });
            self.step += 1;
        }
    }

    /// One step with `mean` photons on each SPAD.
    fn advance(&mut self, mean: f64, random: &mut RandomWords) {
        let (p, q) = (-libm::expm1(-mean), libm::exp(-mean));
        if p > 0.0 {
            self.laws.forget();
            let mut groups: Vec<Group> = Vec::new();
            self.each_node(|tree, node| {
                groups.clear();
                groups.push(tree.free(node, p, q, 1.0));
                tree.add_aged(node, p, q, &mut groups);
                let taken = tree.draw_cycles(node, &groups[0], random);
                if taken > 0 {
                    tree.spread(node, taken, &groups, true, &Outcome::default(), random);
                }
            });
        }
        self.step += 1;
    }

    /// Calls `visit` for the nodes that hold cycles now.
    fn each_node(&mut self, mut visit: impl FnMut(&mut Self, u32)) {
        let mut live = std::mem::take(&mut self.live);
        let nodes = (0..).zip(&self.nodes);
        live.extend(nodes.filter(|(_, node)| node.cycles > 0).map(|(at, _)| at));
        for node in live.drain(..) {
            visit(self, node);
        }
        self.live = live;
    }

    /// The free SPADs of `node`.
    fn free(&mut self, node: u32, p: f64, q: f64, able: f64) -> Group {
        let spads = self.spads - usize::from(self.nodes[node as usize].depth);
        let number = self.laws.number(FREE, spads, p, q);
        Group::free(number, &self.laws.laws[number], able)
    }

    /// Takes those cycles out of `node` in which something happens from group `first` on.
    fn draw_cycles(&mut self, node: u32, first: &Group, random: &mut RandomWords) -> u64 {
        let node = &mut self.nodes[node as usize];
        let (any, none) = (first.any_from_here, first.none_from_here);
        let taken = binomial(node.cycles, any.min(1.0), none, random);
        node.cycles -= taken;
        taken
    }

    /// Adds the groups of `node`'s SPADs with an avalanche that a photon may do something to.
    fn add_aged(&mut self, node: u32, p: f64, q: f64, groups: &mut Vec<Group>) {
        let mut at = node;
        while at != ROOT {
            let Node { parent, oldest, .. } = self.nodes[at as usize];
            let age = (self.step - oldest.step) as usize;
            let step = self.step as usize - self.blindness.memory();
            let able = self.blindness.firing_probability(step, age);
            let (class, p, q, able) = match self.blindness.law {
                DeadTimeLaw::NonParalysable => (age, p * able, q + p * (1.0 - able), 1.0),
                DeadTimeLaw::Paralysable => (FREE, p, q, able),
            };
            if p == 0.0 {
                break; // newer ones are as blind
            }
            let same = groups.pop_if(|group| group.avalanche == Some(oldest));
            let spads = same.map_or(0, |group| self.laws.laws[group.hits].spads) + 1;
            let number = self.laws.number(class, spads, p, q);
            groups.push(Group {
                avalanche: Some(oldest),
                ..Group::free(number, &self.laws.laws[number], able)
            });
            at = parent;
        }
        for i in (0..groups.len() - 1).rev() {
            let (any, none) = (groups[i + 1].any_from_here, groups[i + 1].none_from_here);
            let group = &mut groups[i];
            group.any_from_here += group.none_from_here * any;
            group.none_from_here *= none;
        }
    }

    /// Puts `cycles`, taken out of `node`, where the avalanches in `groups` lead them. While `waiting`, nothing has
    /// happened yet, but something must.
    fn spread(
        &mut self,
        node: u32,
        cycles: u64,
        groups: &[Group],
        waiting: bool,
        outcome: &Outcome,
        random: &mut RandomWords,
    ) {
        if cycles == 0 {
            return;
        }
        let Some((group, rest)) = groups.split_first() else {
            debug_assert!(!waiting, "something happened");
            let to = self.destination(node, outcome);
            self.nodes[to as usize].cycles += cycles;
            return;
        };
        let law = &self.laws.laws[group.hits];
        let spads = law.spads;
        let hit = if !waiting {
            binomial(cycles, law.any(), law.none(), random)
        } else if rest.is_empty() {
            cycles
        } else {
            let p = law.any() / group.any_from_here;
            let q = law.none() * rest[0].any_from_here / group.any_from_here;
            binomial(cycles, p.min(1.0), q.min(1.0), random)
        };
        self.spread(node, cycles - hit, rest, waiting, outcome, random);
        let mut at_least = hit;
        for count in 1..=spads {
            let more = self.laws.laws[group.hits].more(at_least, count, random);
            self.renew(node, at_least - more, groups, count, outcome, random);
            at_least = more;
            if more == 0 {
                break;
            }
        }
    }

    /// `count` SPADs of the first of `groups` are hit in `cycles`: some make pulses, some do not.
    fn renew(
        &mut self,
        node: u32,
        cycles: u64,
        groups: &[Group],
        count: usize,
        outcome: &Outcome,
        random: &mut RandomWords,
    ) {
        if cycles == 0 {
            return;
        }
        let (group, rest) = groups.split_first().expect("the group that is hit");
        let pulses = Hits::new(count, group.able, 1.0 - group.able);
        let mut at_least = cycles;
        for pulsing in 0..=count {
            let more = pulses.more(at_least, pulsing, random);
            let these = at_least - more;
            if these > 0 {
                let mut outcome = outcome.clone();
                outcome.pulses += pulsing;
                outcome.silent += count - pulsing;
                if let Some(old) = group.avalanche {
                    outcome.replaced.extend(std::iter::repeat_n(old, count));
                }
                self.spread(node, these, rest, false, &outcome, random);
            }
            at_least = more;
            if more == 0 {
                break;
            }
        }
    }

    /// The node that `node` becomes, created if missing.
    fn destination(&mut self, node: u32, outcome: &Outcome) -> u32 {
        let mut way: SmallVec<[Avalanche; 16]> = SmallVec::new();
        let mut at = node;
        let mut replaced = outcome.replaced.iter().peekable();
        while at != ROOT {
            let Node { parent, oldest, .. } = self.nodes[at as usize];
            if replaced.next_if(|&&old| old == oldest).is_none() {
                way.push(oldest);
            }
            at = parent;
        }
        debug_assert!(replaced.next().is_none(), "what is replaced was there");
        let mut at = ROOT;
        for (count, pulse) in [(outcome.pulses, true), (outcome.silent, false)] {
            let step = self.step;
            for _ in 0..count {
                at = self.child(at, Avalanche { step, pulse });
            }
        }
        for &avalanche in way.iter().rev() {
            at = self.child(at, avalanche);
        }
        at
    }

    /// The child of `parent` with one avalanche more, an older one.
    fn child(&mut self, parent: u32, oldest: Avalanche) -> u32 {
        let mut child = self.nodes[parent as usize].first_child;
        while child != NONE {
            let node = &self.nodes[child as usize];
            if node.oldest == oldest {
                return child;
            }
            child = node.next_sibling;
        }
        let node = Node {
            cycles: 0,
            parent,
            oldest,
            depth: self.nodes[parent as usize].depth + 1,
            first_child: NONE,
            next_sibling: self.nodes[parent as usize].first_child,
        };
        let child = match self.unused.pop() {
            Some(index) => {
                self.nodes[index as usize] = node;
                index
            }
            None => {
                self.nodes.push(node);
                self.nodes.len() as u32 - 1
            }
        };
        self.nodes[parent as usize].first_child = child;
        let step = oldest.step as usize;
        if self.by_step.len() <= step {
            self.by_step.resize_with(step + 1, Vec::new);
        }
        self.by_step[step].push(child);
        child
    }

    /// Cycles whose pulses in the step before the one to come make an event.
    fn count(&self, is_event: &EventTable) -> u64 {
        let live = self.nodes.iter().filter(|node| node.cycles > 0);
        let counted = live.filter(|node| {
            let mut pulses = 0;
            let mut at = *node;
            while at.parent != NONE {
                pulses += usize::from(at.oldest.pulse && at.oldest.step + 1 == self.step);
                at = &self.nodes[at.parent as usize];
            }
            is_event.0[pulses]
        });
        counted.map(|node| node.cycles).sum()
    }

    /// Folds avalanches that no longer matter in the step to come into the nodes without them.
    fn forget(&mut self) {
        let memory = self.blindness.memory() as u32;
        while self.remembered + memory < self.step {
            let Some(leaves) = self.by_step.get_mut(self.remembered as usize) else {
                self.remembered += 1;
                continue;
            };
            for leaf in std::mem::take(leaves).into_iter().rev() {
                let Node {
                    cycles,
                    parent,
                    next_sibling,
                    first_child,
                    ..
                } = self.nodes[leaf as usize];
                debug_assert_eq!(first_child, NONE, "nothing is older than the oldest");
                self.nodes[parent as usize].cycles += cycles;
                self.nodes[leaf as usize].cycles = 0;
                let mut link = self.nodes[parent as usize].first_child;
                if link == leaf {
                    self.nodes[parent as usize].first_child = next_sibling;
                } else {
                    while self.nodes[link as usize].next_sibling != leaf {
                        link = self.nodes[link as usize].next_sibling;
                    }
                    self.nodes[link as usize].next_sibling = next_sibling;
                }
                self.unused.push(leaf);
            }
            self.remembered += 1;
        }
    }
}
