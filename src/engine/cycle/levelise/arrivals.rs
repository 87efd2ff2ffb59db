//! Where each cause goes: arcs of gates and flip-flops, followed to the nets that they reach, with times of arrival.

use super::*;

impl Leveliser<'_> {
    /// What a change causes: by cell and pin, the changes of its outputs.
    pub(super) fn arcs(&self, cause: Cause, from: Node) -> Vec<Arc> {
        let cells = self.survey.netlist.cells();
        let loads = self.loads.get(&from.0).map_or(&[][..], Vec::as_slice);
        let arcs = loads
            .iter()
            .filter(|&&(cell, pin)| !self.is_held(cause, &cells[cell], pin));
        arcs.map(|&(cell, pin)| {
            let leaf = &cells[cell];
            let outputs = leaf
                .outputs
                .iter()
                .enumerate()
                .filter(|(_, net)| net.is_some());
            let to = outputs.flat_map(|(output, &net)| {
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

    /// Whether this pin clocks a flip-flop that the cause itself resets: it ignores its clock.
    pub(super) fn is_held(&self, cause: Cause, cell: &FlatCell, pin: usize) -> bool {
        cell.kind.is_flip_flop() && pin == 1 && cause.value && cell.inputs[2] == cause.net
    }

    pub(super) fn delay(&self, arc: &Arc, edge: Edge) -> i64 {
        i64::from(self.survey.timing.of(arc.cell)[arc.pin].to(edge.level()))
    }

    /// Drafts the actions of one cause; the first of them sets the shared net.
    pub(super) fn follow(&mut self, cause: Cause) -> Result<usize, Unlevelled> {
        let edge = if cause.value { Edge::Rise } else { Edge::Fall };
        let start = (cause.net, edge);
        let mut search = Search::default();
        search.visit(self, cause, start);
        search.order.reverse();
        let rank: HashMap<Node, usize> = search
            .order
            .iter()
            .enumerate()
            .map(|(i, &n)| (n, i))
            .collect();
        let mut arrival: HashMap<Node, (i64, i64)> = HashMap::from([(start, (0, 0))]);
        for from in &search.order {
            let (early, late) = arrival[from];
            for arc in self.arcs(cause, *from) {
                for to in arc.to.iter().filter(|to| rank[*to] > rank[from]) {
                    let delay = self.delay(&arc, to.1);
                    let window = arrival.entry(*to).or_insert((i64::MAX, i64::MIN));
                    *window = (window.0.min(early + delay), window.1.max(late + delay));
                }
            }
        }
        self.check_clears(cause, &arrival)?;

        let (place, _) = self.bit(cause.net)?;
        let set = Action {
            code: Code::Set(cause.value),
            inputs: [ZERO; 4],
            invert: [0; 5],
            out: place,
            directions: [u64::MAX; 2],
            masks: [SINK; 2],
            wakes: [0; 3],
            traps: [false; 2],
            is_doubtful: false,
        };
        let first = self.draft(cause.position_fs, 0, set);
        // Which drafts make a node, and which evaluate a cell because of one.
        let mut makers: HashMap<Node, Vec<usize>> = HashMap::from([(start, vec![first])]);
        let mut gates: HashMap<Node, usize> = HashMap::new();
        let mut flip_flops: HashMap<(usize, usize), usize> = HashMap::new();
        let mut masks: HashMap<NetId, u16> = HashMap::new();
        for &node in &search.order {
            for arc in self.arcs(cause, node) {
                let kind = self.survey.netlist.cells()[arc.cell].kind;
                let ahead: Vec<Node> = arc
                    .to
                    .iter()
                    .copied()
                    .filter(|to| rank[to] > rank[&node])
                    .collect();
                let is_cut = ahead.len() < arc.to.len();
                let mut targets = Vec::new();
                if kind.is_flip_flop() && !ahead.is_empty() {
                    let (early, late) = arrival[&node];
                    if early != late && arc.pin != 1 {
                        return Err(Unlevelled::Ambiguous {
                            net: self.survey.name(node.0),
                            shortest_fs: early,
                            longest_fs: late,
                        });
                    }
                    let draft = match flip_flops.get(&(arc.cell, arc.pin)) {
                        Some(&draft) => draft,
                        None => {
                            let time = late + self.delay(&arc, Edge::Rise);
                            let made = makers[&node].iter().map(|&m| self.drafts[m].arrival_fs);
                            let instant = made.max().expect("a node has a maker") + 1;
                            let mask = (arc.pin == 1).then(|| {
                                *masks.entry(node.0).or_insert_with(|| {
                                    self.next_place += 1;
                                    self.next_place - 1
                                })
                            });
                            let mask = match mask {
                                Some(mask) => {
                                    let (mask, gate) =
                                        self.sampled_reset(cause, &arc, mask, late, instant)?;
                                    targets.extend(gate);
                                    Some(mask)
                                }
                                None => None,
                            };
                            let draft = self.flip_flop(cause, arc.cell, mask, time)?;
                            self.drafts[draft].action.is_doubtful |= early != late;
                            flip_flops.insert((arc.cell, arc.pin), draft);
                            draft
                        }
                    };
                    for to in &ahead {
                        let made = makers.entry(*to).or_default();
                        if !made.contains(&draft) {
                            made.push(draft);
                        }
                    }
                    targets.push(draft);
                } else {
                    for to in &ahead {
                        let draft = match gates.get(to) {
                            Some(&draft) => draft,
                            None => self.gate(cause, arc.cell, *to, &arrival, &mut gates)?,
                        };
                        makers.insert(*to, vec![draft]);
                        targets.push(draft);
                    }
                }
                let (_, is_inverted) = self.bit(node.0)?;
                let direction = usize::from((node.1 == Edge::Fall) ^ is_inverted);
                for &maker in &makers[&node] {
                    let draft = &mut self.drafts[maker];
                    draft.wakes[direction].extend(&targets);
                    draft.action.traps[direction] |= is_cut;
                    if let (Some(&mask), Edge::Rise) = (masks.get(&node.0), node.1) {
                        draft.action.masks[direction] = mask;
                    }
                }
            }
        }
        Ok(first)
    }

    /// A reset must outlast whatever its own clearing clocks.
    pub(super) fn check_clears(
        &self,
        cause: Cause,
        arrival: &HashMap<Node, (i64, i64)>,
    ) -> Result<(), Unlevelled> {
        let Some(&width) = self.pulse_fs.get(&cause.net) else {
            return Ok(());
        };
        let cells = self.survey.netlist.cells();
        for (&(net, edge), &(_, late)) in arrival {
            let loads = self.loads.get(&net).map_or(&[][..], Vec::as_slice);
            for &(cell, pin) in loads.iter().filter(|_| edge == Edge::Rise) {
                let removal = self
                    .cell_library
                    .checks(cells[cell].kind)
                    .removal
                    .at(self.config.corner);
                if self.is_held(cause, &cells[cell], pin) && late + i64::from(removal) >= width {
                    return Err(Unlevelled::Clear(self.survey.netlist.cell_path(cell)));
                }
            }
        }
        Ok(())
    }
}
