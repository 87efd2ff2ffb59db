//! What an arriving edge does: the action of a gate or flip-flop, before it has its place on the tape.

use super::*;

impl Leveliser<'_> {
    pub(super) fn draft(&mut self, position_fs: i64, arrival_fs: i64, action: Action) -> usize {
        self.drafts.push(Draft {
            position_fs: (position_fs + arrival_fs).rem_euclid(self.period_fs),
            arrival_fs,
            action,
            wakes: Default::default(),
        });
        self.drafts.len() - 1
    }

    /// Where a flip-flop's reset and set are found.
    fn control_bits(&mut self, cell: &FlatCell) -> Result<[Bit; 2], LevelisationError> {
        let mut bit = |net: Option<NetId>| net.map_or(Ok((ZERO, false)), |net| self.bit(net));
        Ok([bit(cell.inputs[2])?, bit(cell.inputs[3])?])
    }

    /// Lanes of a clock mask in which the flip-flop is not held in the instant of the edge: the place of their mask, and
    /// the actions that find them.
    pub(super) fn unheld(
        &mut self,
        cause: Cause,
        cell: &FlatCell,
        mask: u16,
        instant_fs: i64,
    ) -> Result<(u16, Vec<usize>), LevelisationError> {
        let (mut lanes, mut drafts) = (mask, Vec::new());
        for (control, after_fs) in self.control_bits(cell)?.into_iter().zip(0..) {
            if control == (ZERO, false) {
                continue;
            }
            let action = Action {
                inputs: [lanes, control.0, ZERO, ZERO],
                invert: [0, inversion(!control.1), 0, 0, 0],
                ..Action::new(Code::And, self.new_place())
            };
            lanes = action.out;
            drafts.push(self.draft(cause.position_fs, instant_fs + after_fs, action));
        }
        Ok((lanes, drafts))
    }

    pub(super) fn flip_flop(
        &mut self,
        cause: Cause,
        index: usize,
        mask: Option<u16>,
        arrival_fs: i64,
    ) -> Result<usize, LevelisationError> {
        let cell = self.survey.netlist.cells()[index];
        let d = cell.input(0);
        let q = cell.output_nets().next().expect("an output is read");
        let (out, _) = self.bit(q)?;
        let [reset, set] = self.control_bits(&cell)?;
        let mut is_doubtful = false;
        let (code, data) = if mask.is_none() {
            (Code::Async, (ZERO, false))
        } else if self.survey.class(d) == Class::Stream {
            let (code, is_race) = self.sampler(cause, &cell, index, arrival_fs)?;
            is_doubtful = is_race;
            (code, (ZERO, false))
        } else {
            let data = self.bit(d)?;
            let toggles = data == (out, true) && set == (ZERO, false);
            (
                if toggles {
                    Code::Toggle
                } else {
                    Code::FlipFlop
                },
                data,
            )
        };
        let action = Action {
            inputs: [data.0, mask.unwrap_or(ZERO), reset.0, set.0],
            invert: [
                inversion(data.1),
                0,
                inversion(reset.1),
                inversion(set.1),
                0,
            ],
            is_doubtful,
            ..Action::new(code, out)
        };
        Ok(self.draft(cause.position_fs, arrival_fs, action))
    }

    /// A flip-flop that samples the stream `arrival_fs − clk-to-Q` after its cause, and whether that is within setup
    /// and hold of a change.
    pub(super) fn sampler(
        &self,
        cause: Cause,
        cell: &FlatCell,
        index: usize,
        arrival_fs: i64,
    ) -> Result<(Code, bool), LevelisationError> {
        let survey = self.survey;
        let data = cell.input(0);
        let (register, output) = survey.driver[data.index()].expect("a stream net has a driver");
        if !survey.netlist.cells()[register].kind.is_flip_flop() {
            return Err(LevelisationError::Structure(survey.name(data)));
        }
        // Where the flip-flop's clock comes is told by the delay with which it was given its place.
        let to_output = self.longest_delay(index, CLOCK);
        let of_register = &survey.timing.cell_delays(CellId::new(register))[CLOCK][output];
        let (rise, fall) = (of_register.rise().as_fs(), of_register.fall().as_fs());
        let due = (cause.position_fs + arrival_fs).rem_euclid(self.period_fs);
        let after_change = due - to_output - self.period_fs / 2 - rise.max(fall);
        let edges = after_change.div_euclid(self.period_fs);
        let after = after_change.rem_euclid(self.period_fs);
        let limits = self.cell_library.checks(cell.kind);
        let limit = |limit: DataLimit| {
            let corner = self.config.corner;
            let longest = limit
                .rise
                .in_corner(corner)
                .max(limit.fall.in_corner(corner));
            longest.as_fs() + ROUNDING_FS
        };
        let before = self.period_fs - after - (rise - fall).abs();
        let is_race = after <= limit(limits.setup) || before <= limit(limits.hold);
        let tap = self
            .sampled
            .iter()
            .position(|&net| net == data)
            .expect("noted before");
        let offset = edges as i8 + 1;
        Ok((
            Code::Sampler {
                tap: tap as u16,
                offset,
            },
            is_race,
        ))
    }

    /// The action of a gate for one change of its output, or for both where nothing comes between them.
    pub(super) fn gate(
        &mut self,
        cause: Cause,
        index: usize,
        to: Node,
        arrival: &HashMap<Node, (i64, i64)>,
        gates: &mut HashMap<Node, usize>,
    ) -> Result<usize, LevelisationError> {
        let cell = self.survey.netlist.cells()[index];
        let times = Edge::BOTH.map(|edge| arrival.get(&(to.0, edge)).map(|window| window.1));
        let is_quiet = |from: i64, until: i64| {
            let inputs = cell
                .input_nets()
                .flat_map(|net| Edge::BOTH.map(|edge| (net, edge)));
            let mut times = inputs.filter_map(|node| arrival.get(&node));
            !times.any(|window| window.1 >= from && window.0 < until)
        };
        let both = match times {
            [Some(rise), Some(fall)] => {
                let (first, last) = (rise.min(fall), rise.max(fall));
                (last - first < self.fastest_fs && is_quiet(first, last)).then_some(last)
            }
            _ => None,
        };
        let own = arrival[&to].1;
        let directions = match (both, to.1) {
            (Some(_), _) => [u64::MAX; 2],
            (None, Edge::Rise) => [u64::MAX, 0],
            (None, Edge::Fall) => [0, u64::MAX],
        };
        let (code, inputs, invert) = self.function(&cell)?;
        let action = Action {
            inputs,
            invert,
            directions,
            ..Action::new(code, self.bit(to.0)?.0)
        };
        let draft = self.draft(cause.position_fs, both.unwrap_or(own), action);
        gates.insert(to, draft);
        if both.is_some() {
            for edge in Edge::BOTH {
                gates.insert((to.0, edge), draft);
            }
        }
        Ok(draft)
    }

    /// A gate with its constants folded in.
    pub(super) fn function(
        &mut self,
        cell: &FlatCell,
    ) -> Result<(Code, [u16; 4], [u64; 5]), LevelisationError> {
        let relevant = self.survey.relevant(cell);
        let pins: Vec<usize> = (0..cell.kind.inputs().len())
            .filter(|&p| relevant[p])
            .collect();
        let mut fixed = 0u8;
        for pin in 0..cell.kind.inputs().len() {
            if self.survey.class(cell.input(pin)) == Class::Constant(true) {
                fixed |= 1 << pin;
            }
        }
        let bits: Result<Vec<Bit>, _> = pins.iter().map(|&pin| self.bit(cell.input(pin))).collect();
        let bits = bits?;
        let value = |on: u8| {
            let set = pins.iter().enumerate().filter(|(i, _)| on >> i & 1 == 1);
            output(cell.kind, set.fold(fixed, |word, (_, pin)| word | 1 << pin))
        };
        let action = |code, places: &[u16], flags: &[bool], inverted: bool| {
            let mut inputs = [ZERO; 4];
            let mut invert = [0; 5];
            inputs[..places.len()].copy_from_slice(places);
            for (mask, &flag) in invert.iter_mut().zip(flags) {
                *mask = inversion(flag);
            }
            invert[4] = inversion(inverted);
            (code, inputs, invert)
        };
        Ok(match bits[..] {
            [(a, ia)] => action(Code::Xor, &[a, ZERO], &[], ia ^ value(0)),
            [(a, ia), (b, ib)] => {
                let table = [0, 1, 2, 3].map(value);
                let ones = table.iter().filter(|&&v| v).count();
                if ones == 2 {
                    action(Code::Xor, &[a, b], &[], ia ^ ib ^ table[0])
                } else {
                    // The one combination of inputs that differs from the others.
                    let odd = (0..4)
                        .find(|&i| table[i] == (ones == 1))
                        .expect("a gate of two inputs");
                    let (wants_a, wants_b) = (odd & 1 == 1, odd & 2 == 2);
                    action(
                        Code::And,
                        &[a, b],
                        &[ia ^ !wants_a, ib ^ !wants_b],
                        ones == 3,
                    )
                }
            }
            // A multiplexer between a flip-flop's outputs.
            [(a, ia), (b, ib), (s, is)] if a == b && ia != ib => {
                action(Code::Xor, &[a, s], &[], ia ^ is)
            }
            [(a, ia), (b, ib), (s, is)] if cell.kind == CellKind::Mux2 => {
                action(Code::Mux, &[a, b, s], &[ia, ib, is], false)
            }
            _ => {
                return Err(LevelisationError::Structure(
                    self.survey
                        .name(cell.outputs[0].expect("a gate that is read")),
                ));
            }
        })
    }
}
