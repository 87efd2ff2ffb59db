//! Where each cause goes: arcs of gates and flip-flops, followed to the nets that they reach, with times of arrival.

use super::*;

/// Lanes in which a clock rises.
#[derive(Default)]
struct ClockMasks {
    /// Their mask.
    all: Option<u16>,
    /// Those of them in which a reset and set do not hold, where that has to be found out at once.
    unheld: HashMap<(Option<NetId>, Option<NetId>), u16>,
    /// Drafts that find it out.
    drafts: Vec<usize>,
}

/// Depth first, so that reversed it is an order in which causes precede effects, loops apart.
#[derive(Default)]
struct Search {
    order: Vec<Node>,
    seen: BTreeSet<(NetId, bool)>,
}

impl Search {
    fn visit(&mut self, leveliser: &Leveliser<'_>, held: &BTreeSet<usize>, node: Node) {
        if !self.seen.insert((node.0, node.1 == Edge::Rise)) {
            return;
        }
        for arc in leveliser.arcs(held, node) {
            for to in arc.to {
                self.visit(leveliser, held, to);
            }
        }
        self.order.push(node);
    }
}

impl Leveliser<'_> {
    /// What a change causes: by cell and pin, the changes of its outputs. Flip-flops that are held ignore their clock.
    fn arcs(&self, held: &BTreeSet<usize>, from: Node) -> Vec<Arc> {
        let cells = self.survey.netlist.cells();
        let loads = self.loads.get(&from.0).map_or(&[][..], Vec::as_slice);
        let arcs = loads
            .iter()
            .filter(|&&(cell, pin)| !(pin == CLOCK && held.contains(&cell)));
        arcs.map(|&(cell, pin)| {
            let leaf = &cells[cell];
            let outputs = leaf
                .outputs
                .iter()
                .enumerate()
                .filter_map(|(output, net)| Some((output, (*net)?)));
            let to = outputs.flat_map(|(output, net)| {
                caused(leaf.kind, pin, from.1, output)
                    .iter()
                    .map(move |&edge| (net, edge))
            });
            Arc {
                to: to.collect(),
                cell,
                pin,
            }
        })
        .filter(|arc| !arc.to.is_empty())
        .collect()
    }

    /// Delay to one change of an output.
    fn delay(&self, arc: &Arc, to: Node) -> i64 {
        let outputs = self.survey.netlist.cells()[arc.cell].outputs;
        let output = outputs.iter().position(|&net| net == Some(to.0));
        let output = output.expect("an arc leads to an output");
        let delays = self.survey.timing.cell_delays(CellId::new(arc.cell));
        delays[arc.pin][output].delay(to.1.level()).as_fs()
    }

    /// The longest delay to any output: a draft of a flip-flop stands for what both of them do.
    pub(super) fn longest_delay(&self, cell: usize, pin: usize) -> i64 {
        let leaf = &self.survey.netlist.cells()[cell];
        let arcs = &self.survey.timing.cell_delays(CellId::new(cell))[pin];
        let connected = arcs
            .iter()
            .zip(leaf.outputs)
            .filter(|(_, net)| net.is_some());
        let longest = connected.map(|(arc, _)| arc.rise().max(arc.fall())).max();
        longest.unwrap_or_default().as_fs()
    }

    /// The changes that a cause brings while these flip-flops are held.
    pub(super) fn spread(&self, cause: Cause, held: BTreeSet<usize>) -> Reach {
        let start = cause.node();
        let mut search = Search::default();
        search.visit(self, &held, start);
        search.order.reverse();
        let order = search.order;
        let rank: HashMap<Node, usize> = order.iter().enumerate().map(|(i, &n)| (n, i)).collect();
        let mut arrival: HashMap<Node, (i64, i64)> = HashMap::from([(start, (0, 0))]);
        for from in &order {
            let (early, late) = arrival[from];
            for arc in self.arcs(&held, *from) {
                for to in arc.to.iter().filter(|to| rank[*to] > rank[from]) {
                    let delay = self.delay(&arc, *to);
                    let window = arrival.entry(*to).or_insert((i64::MAX, i64::MIN));
                    *window = (window.0.min(early + delay), window.1.max(late + delay));
                }
            }
        }
        Reach {
            cause,
            order,
            rank,
            arrival,
            held,
        }
    }

    /// Drafts the actions of one cause; the first of them sets the shared net.
    pub(super) fn follow(&mut self, reach: &Reach) -> Result<usize, LevelisationError> {
        let cause = reach.cause;
        let (place, _) = self.bit(cause.net)?;
        let set = Action::new(Code::Set(cause.value), place);
        let first = self.draft(cause.position_fs, 0, set);
        // Which drafts make a node, and which evaluate a gate because of one.
        let mut makers: HashMap<Node, Vec<usize>> = HashMap::from([(cause.node(), vec![first])]);
        let mut gates: HashMap<Node, usize> = HashMap::new();
        for &node in &reach.order {
            let mut clock = ClockMasks::default();
            let mut targets = Vec::new();
            let mut is_lost = false;
            for arc in self.arcs(&reach.held, node) {
                let is_flip_flop = self.survey.netlist.cells()[arc.cell].kind.is_flip_flop();
                let ahead: Vec<Node> = arc
                    .to
                    .iter()
                    .copied()
                    .filter(|to| reach.rank[to] > reach.rank[&node])
                    .collect();
                is_lost |= ahead.len() < arc.to.len();
                // Of two drafts that make a clock, one would overwrite the other's edges.
                is_lost |= is_flip_flop && arc.pin == CLOCK && makers[&node].len() > 1;
                if is_flip_flop && !ahead.is_empty() {
                    let made = makers[&node].iter().map(|&m| self.drafts[m].arrival_fs);
                    let instant = made.max().expect("a node has a maker") + 1;
                    let draft = self.arrive(reach, node, &arc, &mut clock, instant)?;
                    for to in ahead {
                        makers.entry(to).or_default().push(draft);
                    }
                    targets.push(draft);
                } else {
                    for to in &ahead {
                        let draft = match gates.get(to) {
                            Some(&draft) => draft,
                            None => self.gate(cause, arc.cell, *to, &reach.arrival, &mut gates)?,
                        };
                        makers.insert(*to, vec![draft]);
                        targets.push(draft);
                    }
                }
            }
            targets.extend(clock.drafts);
            let (_, is_inverted) = self.bit(node.0)?;
            let direction = usize::from((node.1 == Edge::Fall) ^ is_inverted);
            for &maker in &makers[&node] {
                let draft = &mut self.drafts[maker];
                draft.wakes[direction].extend(&targets);
                draft.action.traps[direction] |= is_lost;
                if let Some(mask) = clock.all {
                    draft.action.masks[direction] = mask;
                }
            }
        }
        Ok(first)
    }

    /// Drafts what an edge does that arrives at a flip-flop.
    fn arrive(
        &mut self,
        reach: &Reach,
        node: Node,
        arc: &Arc,
        clock: &mut ClockMasks,
        instant_fs: i64,
    ) -> Result<usize, LevelisationError> {
        let cell = self.survey.netlist.cells()[arc.cell];
        let (early, late) = reach.arrival[&node];
        let delay = self.longest_delay(arc.cell, arc.pin);
        let is_released = self.may_be_released(reach.cause, &cell, late, delay);
        let mask = if arc.pin == CLOCK {
            let all = *clock.all.get_or_insert_with(|| self.new_place());
            let [_, _, reset, set] = cell.inputs;
            Some(match clock.unheld.get(&(reset, set)) {
                _ if !is_released => all,
                Some(&unheld) => unheld,
                None => {
                    let (unheld, drafts) = self.unheld(reach.cause, &cell, all, instant_fs)?;
                    clock.drafts.extend(drafts);
                    clock.unheld.insert((reset, set), unheld);
                    unheld
                }
            })
        } else if early != late {
            return Err(self.ambiguous(node.0, (early, late)));
        } else if is_released {
            return Err(LevelisationError::Clear(
                self.survey.netlist.cell_path(CellId::new(arc.cell)),
            ));
        } else {
            None
        };
        if mask.is_some() {
            self.refuse_early_data(reach, arc.cell, (early, late + delay))?;
        }
        let draft = self.flip_flop(reach.cause, arc.cell, mask, late + delay)?;
        let action = &mut self.drafts[draft].action;
        action.is_doubtful |= early != late;
        // A reset and a set on their way to Q both: each brings, and wakes, only what is its own.
        let own = caused(cell.kind, arc.pin, node.1, 0);
        action.directions = Edge::BOTH.map(|edge| inversion(own.contains(&edge)));
        Ok(draft)
    }
}
