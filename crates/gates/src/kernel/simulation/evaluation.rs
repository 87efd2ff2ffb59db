//! What cells do in the event loop when their inputs have changed: gates follow, flip-flops look at their clock, reset and set.

use super::{Kernel, RESET_AND_SET};
use crate::kernel::compiled::CLOCK;
use crate::kernel::observer::Observer;
use crate::logic::Logic;

impl Kernel {
    /// The flip-flops on a clock that has risen look at D.
    #[inline]
    pub(super) fn clock(&mut self, net: usize, observer: &mut dyn Observer) {
        self.give_values_to(net);
        for bank in 0..self.banks.len() {
            if self.banks[bank].clock as usize == net {
                self.clock_bank(bank, observer);
            }
        }
        let loads = self.fan_out.clocks.net_loads(net);
        self.statistics.evaluations += loads.len() as u64;
        let (cells, nets) = (&self.cells[..], &self.nets[..]);
        // Most hold already what they would take.
        self.woken
            .extend(loads.iter().map(|load| load.cell()).filter(|&cell| {
                let cell = &cells[cell];
                cell.inputs & RESET_AND_SET != 0 || nets[cell.data as usize].value != cell.state
            }));
        while let Some(cell) = self.woken.pop() {
            self.evaluate_flip_flop(cell, self.cells[cell].inputs, observer);
        }
        let state = &mut self.nets[net];
        state.has_risen = false;
        state.clock_before = state.value;
    }

    #[inline]
    pub(super) fn evaluate(&mut self, index: usize, observer: &mut dyn Observer) {
        let cell = &mut self.cells[index];
        cell.is_dirty = false;
        // An input that changed and changed back within the instant did nothing.
        if cell.inputs == cell.evaluated {
            return;
        }
        let (inputs, evaluated, kind) = (cell.inputs, cell.evaluated, cell.kind);
        cell.evaluated = inputs;
        if kind.is_flip_flop() {
            self.give_all_values();
            self.dissolve_bank_of(index);
            self.evaluate_flip_flop(index, evaluated, observer);
        } else {
            let (output, set) = (cell.outputs[0], cell.delays[0]);
            let value = self.tables.gate(kind, inputs);
            let delays = self.delays[set as usize].shortest_delays(inputs, evaluated);
            self.schedule(output, value, &delays, observer);
        }
    }

    /// With its reset and set before.
    #[inline]
    pub(super) fn evaluate_flip_flop(
        &mut self,
        index: usize,
        evaluated: u8,
        observer: &mut dyn Observer,
    ) {
        let cell = &mut self.cells[index];
        let clock = &self.nets[cell.clock as usize];
        let data = self.nets[cell.data as usize].value;
        let inputs = cell.inputs | clock.value << (2 * CLOCK);
        let before = evaluated | clock.clock_before << (2 * CLOCK);
        let state = self
            .tables
            .flip_flop(inputs | data, clock.clock_before, cell.state);
        if state == cell.state {
            return;
        }
        cell.state = state;
        let (outputs, [to_q, to_qn]) = (cell.outputs, cell.delays);
        let inverted = Logic::from_bits(state).inverted().bits();
        let mut delays = self.delays[to_q as usize].shortest_delays(inputs, before);
        self.schedule(outputs[0], state, &delays, observer);
        if to_qn != to_q {
            delays = self.delays[to_qn as usize].shortest_delays(inputs, before);
        }
        self.schedule(outputs[1], inverted, &delays, observer);
    }
}
