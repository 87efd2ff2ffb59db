//! The circuit of a random P-counter: its memory, its counter, and what it hides.

use std::sync::Arc;

use guided_dtof::netlist::CellKind::{And2, Buf, Dffr, Dffsr, Inv, Mux2, Nor2, Or2, Xnor2, Xor2};
use guided_dtof::netlist::{CellKind, Module, ModuleBuilder, Net};
use rand::{RngExt, rngs::StdRng};

use super::CounterKind;
use super::Hidden::{self, *};

/// A counter that is being built.
pub(super) struct Circuit<'r> {
    random: &'r mut StdRng,
    m: ModuleBuilder,
    init: Vec<Net>,
    load: Net,
    memory_reset: Net,
    clk: Net,
    reset: Net,
    local_stop: Net,
    zero: Net,
    /// What the count's lowest bit has of it.
    hidden: Hidden,
    named: Option<&'static str>,
    flip_flops: usize,
}

impl<'r> Circuit<'r> {
    pub(super) fn new(bits: usize, random: &'r mut StdRng) -> Self {
        let mut m = ModuleBuilder::new("random");
        let init = m.input_bus("COUNTER_INIT", bits);
        let [load, memory_reset, clk, reset] = [
            "MEMORY_LOAD",
            "MEMORY_RESET",
            "COUNTER_CLK",
            "COUNTER_RESET",
        ]
        .map(|pin| m.input(pin));
        let local_stop = m.output("LOCAL_STOP");
        // As Yosys's constants become, of any pin.
        let pin = [load, clk, reset, init[0]][random.random_range(0..4)];
        let zero = m.gate(Xor2, &[pin, pin]);
        Circuit {
            random,
            m,
            init,
            load,
            memory_reset,
            clk,
            reset,
            local_stop,
            zero,
            hidden: Nothing,
            named: None,
            flip_flops: 0,
        }
    }

    fn gate(&mut self, kind: CellKind, inputs: &[Net]) -> Net {
        self.m.gate(kind, inputs)
    }

    /// A flip-flop that `reset` takes to `value`; Q is `q`.
    fn flip_flop(&mut self, q: Net, [data, clock, reset]: [Net; 3], value: bool) {
        let name = format!("flip_flop_{}", self.flip_flops);
        self.flip_flops += 1;
        if value {
            let data = self.gate(Inv, &[data]);
            self.m
                .cell(&name, Dffr, &[data, clock, reset], &[None, Some(q)]);
        } else {
            self.m
                .cell(&name, Dffr, &[data, clock, reset], &[Some(q), None]);
        }
    }

    /// The memory, whose bits may be those of COUNTER_INIT in another order or inverted.
    fn memory(&mut self, hidden: Hidden) -> Vec<Net> {
        let bits = self.init.len();
        let memory = self.m.wire_bus("MEMORY", bits);
        let mut data = self.init.clone();
        if self.random.random_bool(0.3) {
            data.rotate_left(self.random.random_range(1..bits));
            data[0] = self.gate(Inv, &data[..1]);
        }
        let odd = self.random.random_range(0..bits);
        let reset = [self.memory_reset, self.zero][self.random.random_range(0..2)];
        let clock = match self.random.random_range(0..4) {
            // COUNTER_RESET is high while something is loaded.
            0 => self.gate(And2, &[self.load, self.reset]),
            1 => {
                let late = self.gate(Buf, &[self.load]);
                self.gate(Buf, &[late])
            }
            _ => self.load,
        };
        let is_plain = !matches!(
            hidden,
            Init | Clocked | Transparent | Late | Adding | Moving
        );
        let has_ranks = is_plain && self.random.random_bool(0.2);
        let ranks = has_ranks.then(|| self.m.wire_bus("FOREMOST", bits));
        for bit in 0..bits {
            let q = memory[bit];
            match hidden {
                Init if bit == odd => {
                    // Of the memory, this bit alone is missing.
                    self.m.gate_into(Buf, &[data[bit]], q);
                    self.named = Some("COUNTER_INIT[");
                }
                Clocked if bit == odd => {
                    self.flip_flop(q, [data[bit], self.clk, self.memory_reset], false);
                    self.named = Some("COUNTER_INIT[");
                }
                Transparent if bit == odd => {
                    let zero = self.gate(Inv, &[data[bit]]);
                    let [set, clear] =
                        [data[bit], zero].map(|data| self.gate(And2, &[self.load, data]));
                    let inputs = [q, self.zero, clear, set];
                    self.m.cell("transparent", Dffsr, &inputs, &[Some(q), None]);
                    self.named = Some("MEMORY[");
                }
                Late if bit == odd => {
                    let over = self.gate(Inv, &[self.load]);
                    self.flip_flop(q, [data[bit], over, reset], false);
                    self.named = Some("MEMORY[");
                }
                Adding if bit == odd => {
                    let sum = self.gate(Xor2, &[data[bit], q]);
                    self.flip_flop(q, [sum, clock, self.memory_reset], false);
                    self.named = Some("MEMORY[");
                }
                Moving if bit == odd => {
                    let clear = self.gate(Or2, &[self.memory_reset, self.local_stop]);
                    self.flip_flop(q, [data[bit], clock, clear], false);
                    self.named = Some("MEMORY[");
                }
                _ => {
                    let Some(first) = ranks.as_ref().map(|ranks| ranks[bit]) else {
                        self.flip_flop(q, [data[bit], clock, reset], false);
                        continue;
                    };
                    self.flip_flop(first, [data[bit], clock, reset], false);
                    let over = self.gate(Inv, &[self.load]);
                    self.flip_flop(q, [first, over, reset], false);
                }
            }
        }
        memory
    }

    /// What resets the count: COUNTER_RESET, or that until the next edge of COUNTER_CLK.
    fn count_reset(&mut self) -> Net {
        if self.random.random_bool(0.8) {
            return self.reset;
        }
        let late = self.m.wire("RESET_LATE");
        self.flip_flop(late, [self.zero, self.clk, self.reset], true);
        late
    }

    /// The count's flip-flops, of which those with a 1 in `start` are set by a reset.
    fn count(&mut self, reset: Net, (q, next): (&[Net], &[Net]), start: u64) {
        for (bit, (&q_bit, &next)) in q.iter().zip(next).enumerate() {
            let value = start >> bit & 1 == 1;
            let (mut data, mut reset) = (next, reset);
            if bit == 0 && matches!(self.hidden, Synchronous | Gated) {
                self.named = Some("COUNT[0]");
                if self.hidden == Gated {
                    reset = self.gate(And2, &[self.reset, q[1]]);
                } else {
                    let kept = self.gate(Inv, &[self.reset]);
                    data = if value {
                        self.gate(Or2, &[next, self.reset])
                    } else {
                        self.gate(And2, &[next, kept])
                    };
                    reset = self.memory_reset;
                }
            }
            self.flip_flop(q_bit, [data, self.clk, reset], value);
        }
    }

    /// A binary count's next value, up or down.
    fn next(&mut self, q: &[Net], up: bool) -> Vec<Net> {
        let mut carry: Option<Net> = None;
        let mut next = Vec::new();
        for &bit in q {
            next.push(match carry {
                None => self.gate(Inv, &[bit]),
                Some(carry) => self.gate(Xor2, &[bit, carry]),
            });
            let carries = if up { bit } else { self.gate(Inv, &[bit]) };
            carry = Some(match carry {
                None => carries,
                Some(carry) => self.gate(And2, &[carry, carries]),
            });
        }
        next
    }

    fn equal(&mut self, a: &[Net], b: &[Net]) -> Net {
        let same: Vec<Net> = a
            .iter()
            .zip(b)
            .map(|(&a, &b)| self.m.gate(Xnor2, &[a, b]))
            .collect();
        self.m.tree(And2, &same)
    }

    /// Whether these bits are a number.
    fn is(&mut self, bits: &[Net], number: usize) -> Net {
        let literals: Vec<Net> = (0..)
            .zip(bits)
            .map(|(bit, &net)| match number >> bit & 1 {
                1 => net,
                _ => self.m.gate(Inv, &[net]),
            })
            .collect();
        self.m.tree(And2, &literals)
    }

    /// HIT, and what resets the count.
    fn counter(&mut self, kind: CounterKind, hidden: Hidden) -> (Net, Net) {
        let bits = self.init.len();
        if kind == CounterKind::Memoryless {
            return self.memoryless(hidden);
        }
        let memory = self.memory(hidden);
        self.hidden = hidden;
        let reset = match kind {
            CounterKind::Load => self.reset,
            _ => self.count_reset(),
        };
        let hit = match kind {
            CounterKind::Up => {
                let q = self.m.wire_bus("COUNT", bits);
                let next = self.next(&q, true);
                self.count(reset, (&q, &next), 0);
                self.equal(&q, &memory)
            }
            CounterKind::Feedback => {
                let q = self.m.wire_bus("COUNT", bits);
                let taps = [[2, 1], [3, 2], [4, 2]][bits - 3];
                let first = self.gate(Xnor2, &taps.map(|tap| q[tap]));
                let next: Vec<Net> = [first]
                    .into_iter()
                    .chain(q[..bits - 1].iter().copied())
                    .collect();
                self.count(reset, (&q, &next), 0);
                self.equal(&q, &memory)
            }
            CounterKind::Ring => {
                let states = 1 << bits;
                let q = self.m.wire_bus("COUNT", states);
                let next: Vec<Net> = (0..states)
                    .map(|state| q[(state + states - 1) % states])
                    .collect();
                self.count(reset, (&q, &next), 1);
                let hits = (0..states).map(|state| {
                    let chosen = self.is(&memory, state);
                    self.gate(And2, &[chosen, q[state]])
                });
                let hits: Vec<Net> = hits.collect();
                self.m.tree(Or2, &hits)
            }
            CounterKind::Johnson => {
                let half = 1 << (bits - 1);
                let q = self.m.wire_bus("COUNT", half);
                let last = self.gate(Inv, &q[half - 1..]);
                let next: Vec<Net> = [last]
                    .into_iter()
                    .chain(q[..half - 1].iter().copied())
                    .collect();
                self.count(reset, (&q, &next), 0);
                let hits = (0..2 * half).map(|state| {
                    let chosen = self.is(&memory, state);
                    let place = state % half;
                    // Left of the place is what went in last, the other value from there on.
                    let (before, here) = (q[(place + half - 1) % half], q[place]);
                    let falls = state >= half;
                    let pair = match (place, falls) {
                        (0, false) => 0b00,
                        (0, true) => 0b11,
                        (_, false) => 0b01,
                        (_, true) => 0b10,
                    };
                    let is_state = self.is(&[before, here], pair);
                    self.gate(And2, &[chosen, is_state])
                });
                let hits: Vec<Net> = hits.collect();
                self.m.tree(Or2, &hits)
            }
            CounterKind::Load => {
                let q = self.m.wire_bus("COUNT", bits);
                let next = self.next(&q, false);
                for bit in 0..bits {
                    let is_odd = bit == 0 && matches!(hidden, Synchronous | Gated);
                    if is_odd {
                        self.named = Some("COUNT[0]");
                        let loads = match hidden {
                            Gated => self.gate(And2, &[self.reset, self.clk]),
                            _ => self.zero,
                        };
                        self.load_bit((bit, q[bit]), next[bit], memory[bit], loads);
                    } else {
                        self.load_bit((bit, q[bit]), next[bit], memory[bit], self.reset);
                    }
                }
                self.is(&q, 0)
            }
            CounterKind::Memoryless => unreachable!("it has been built"),
        };
        (hit, reset)
    }

    /// A bit of the count that takes `value` while `loads` is high.
    fn load_bit(&mut self, (bit, q): (usize, Net), next: Net, value: Net, loads: Net) {
        let other = self.gate(Inv, &[value]);
        let [set, clear] = [value, other].map(|value| self.gate(And2, &[loads, value]));
        let inputs = [next, self.clk, clear, set];
        self.m
            .cell(&format!("count_{bit}"), Dffsr, &inputs, &[Some(q), None]);
    }

    fn memoryless(&mut self, hidden: Hidden) -> (Net, Net) {
        let bits = self.init.len();
        let mut late = self.load;
        for _ in 0..6 {
            late = self.gate(Buf, &[late]);
        }
        let late = self.gate(Inv, &[late]);
        let pulse = self.m.wire("PULSE_OF_LOAD");
        self.m.gate_into(And2, &[self.load, late], pulse);
        let q = self.m.wire_bus("COUNT", bits);
        let next = self.next(&q, false);
        for bit in 0..bits {
            let mut data = next[bit];
            if hidden == Reset && bit == 0 {
                data = self.gate(Or2, &[data, self.reset]);
                self.named = Some("(OR2)");
            }
            self.load_bit((bit, q[bit]), data, self.init[bit], pulse);
        }
        let mut hit = self.is(&q, 0);
        if hidden == Init {
            // The window comes an edge later for odd values.
            let one = self.is(&q, 1);
            hit = self.gate(Mux2, &[hit, one, self.init[0]]);
            self.named = Some("COUNTER_INIT[0]");
        }
        (hit, pulse)
    }

    /// HIDDEN: a ripple counter of rising edges.
    fn ripple(&mut self, width: usize, mut clock: Net, reset: Net) -> Vec<Net> {
        let count = self.m.wire_bus("HIDDEN", width);
        for &bit in &count {
            let other = self.gate(Inv, &[bit]);
            self.flip_flop(bit, [other, clock, reset], false);
            clock = other;
        }
        count
    }

    pub(super) fn build(
        mut self,
        kind: CounterKind,
        hidden: Hidden,
        wraps: bool,
    ) -> (Arc<Module>, Option<&'static str>) {
        let (mut hit, reset) = self.counter(kind, hidden);
        match hidden {
            Aside => {
                let [aside, event] = ["ASIDE", "EVENT"].map(|name| self.m.wire(name));
                let data = self.gate(Xor2, &[self.init[0], aside]);
                let clock = [self.local_stop, self.clk][self.random.random_range(0..2)];
                self.flip_flop(aside, [data, clock, self.memory_reset], false);
                self.m.gate_into(Nor2, &[aside, hit], event);
            }
            Rounds => {
                // The fourth LOCAL_STOP since the reset does not come.
                let [low, high] = self.ripple(2, self.local_stop, reset)[..] else {
                    unreachable!("two bits");
                };
                let over = self.gate(And2, &[low, high]);
                let not = self.gate(Inv, &[over]);
                hit = self.gate(And2, &[hit, not]);
                if wraps {
                    self.named = Some("HIDDEN");
                }
            }
            Cycles => {
                let width = self.random.random_range(1..8);
                let clock = match self.random.random_range(0..2) {
                    0 if kind != CounterKind::Memoryless => {
                        self.gate(Or2, &[self.reset, self.load])
                    }
                    _ => self.local_stop,
                };
                let count = self.ripple(width, clock, self.memory_reset);
                let over = self.m.tree(And2, &count);
                let not = self.gate(Inv, &[over]);
                hit = self.gate(And2, &[hit, not]);
                self.named = Some("HIDDEN");
            }
            Free => {
                let free = self.m.wire("HIDDEN");
                let data = self.gate(Xor2, &[free, hit]);
                let reset = [self.memory_reset, self.zero][self.random.random_range(0..2)];
                self.flip_flop(free, [data, self.clk, reset], false);
                hit = self.gate(And2, &[hit, free]);
                self.named = Some("HIDDEN");
            }
            _ => {}
        }
        let inputs = [hit, self.clk, reset];
        self.m
            .cell("stop", Dffr, &inputs, &[Some(self.local_stop), None]);
        (self.m.finish().unwrap(), self.named)
    }
}
