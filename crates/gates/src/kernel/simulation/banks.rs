//! Long shift registers in the event loop: a bank forms at a clock edge where its flip-flops allow it, shifts a word at a time, and is dissolved by anything else.

use super::{BANKED, Kernel, NONE, NetState, RESET_AND_SET};
use crate::kernel::compiled::CLOCK;
use crate::kernel::observer::Observer;
use crate::kernel::shift_banks::ShiftBank;
use crate::kernel::wheel::Event;
use crate::logic::Logic;
use crate::netlist::NetId;
use crate::units::Time;

impl Kernel {
    #[inline]
    pub(super) fn clocks_a_bank(&self, net: usize) -> bool {
        self.banks.iter().any(|bank| bank.clock as usize == net)
    }

    /// A clock edge at a bank: one shift if it is formed or can be, otherwise flip-flop by flip-flop.
    #[inline]
    pub(super) fn clock_bank(&mut self, index: usize, observer: &mut dyn Observer) {
        self.statistics.evaluations += self.banks[index].cells.len() as u64;
        let bank = &self.banks[index];
        let clock = &self.nets[bank.clock as usize];
        let is_edge = (clock.clock_before, clock.value) == (Logic::Zero.bits(), Logic::One.bits());
        let data = Logic::from_bits(self.nets[bank.data as usize].value).to_bool();
        if let Some(data) = data
            && is_edge
            && self.forms_banks
            && (bank.is_formed && bank.arrives_fs.is_none() || !bank.is_formed && self.form(index))
        {
            let bank = &mut self.banks[index];
            if bank.shift(data) {
                // Either way: both are the same for a bank.
                let delay = self.delays[bank.delays as usize].after_pin(CLOCK);
                let time_fs = self.now_fs + i64::from(delay[Logic::One.bits() as usize]);
                bank.arrives_fs = Some(time_fs);
                let net = bank.nets[0];
                let state = &mut self.nets[net as usize];
                state.pending = BANKED;
                // Of another generation than the net's own events.
                let tag = ((state.generation + 1) & (u32::MAX >> 2)) << 2;
                self.wheel.push(Event { time_fs, net, tag });
            }
            return;
        }
        self.dissolve(index);
        for stage in 0..self.banks[index].cells.len() {
            let cell = self.banks[index].cells[stage] as usize;
            self.evaluate_flip_flop(cell, self.cells[cell].inputs, observer);
        }
    }

    /// Forms a bank if its flip-flops allow it.
    fn form(&mut self, index: usize) -> bool {
        let bank = &self.banks[index];
        let delay = self.delays[bank.delays as usize].after_pin(CLOCK);
        let (zero, one) = (Logic::Zero.bits(), Logic::One.bits());
        let is_quiet = |(&cell, &net): (&u32, &u32)| {
            let (cell, net) = (&self.cells[cell as usize], &self.nets[net as usize]);
            net.value <= 1
                && net.value == cell.state
                && net.pending == NONE
                && cell.inputs & RESET_AND_SET == 0
                && !cell.is_dirty
        };
        debug_assert!(zero == 0 && one == 1);
        let forms = delay[zero as usize] == delay[one as usize]
            && bank.cells.iter().zip(&bank.nets).all(is_quiet);
        if forms {
            let nets = &self.nets;
            let bank = &mut self.banks[index];
            let shown: Vec<bool> = bank
                .nets
                .iter()
                .map(|&n| nets[n as usize].value == one)
                .collect();
            bank.form(shown.into_iter());
        }
        forms
    }

    /// The changes of a bank come, in the order of its nets.
    pub(super) fn arrive_bank(&mut self, first: usize, observer: &mut dyn Observer) {
        let is_its = |bank: &&mut ShiftBank| {
            bank.nets[0] as usize == first && bank.arrives_fs == Some(self.now_fs)
        };
        let Some(bank) = self.banks.iter_mut().find(is_its) else {
            return;
        };
        bank.arrives_fs = None;
        self.nets[first].pending = NONE;
        if !observer.needs_changes() {
            let both = bank.state.iter().zip(&mut bank.shown);
            for (&state, shown) in both {
                self.statistics.changes += u64::from((state ^ *shown).count_ones());
                *shown = state;
            }
            bank.nets_are_late = true;
            return;
        }
        bank.give_values(&mut self.nets);
        let time = Time::from_fs(self.now_fs);
        for (word, nets) in bank.nets.chunks(64).enumerate() {
            let state = bank.state[word];
            let mut changes = state ^ bank.shown[word];
            bank.shown[word] = state;
            self.statistics.changes += u64::from(changes.count_ones());
            while changes != 0 {
                let stage = changes.trailing_zeros() as usize;
                changes &= changes - 1;
                let value = Logic::from(state >> stage & 1 == 1);
                let net = nets[stage] as usize;
                self.nets[net].value = value.bits();
                observer.change(time, NetId::new(net), value);
            }
        }
    }

    /// Before flip-flops on this clock look at D: some of them may look at outputs of a bank.
    #[inline]
    pub(super) fn give_values_to(&mut self, clock: usize) {
        let clock = clock as u32;
        for bank in &mut self.banks {
            if bank.nets_are_late && bank.reading_clocks.binary_search(&clock).is_ok() {
                bank.give_values(&mut self.nets);
            }
        }
    }

    /// Before anybody may look at any net.
    pub(super) fn give_all_values(&mut self) {
        for bank in &mut self.banks {
            bank.give_values(&mut self.nets);
        }
    }

    /// Gives a bank's states and what is on its way back to its flip-flops.
    #[cold]
    fn dissolve(&mut self, index: usize) {
        let bank = &mut self.banks[index];
        if !bank.is_formed {
            return;
        }
        bank.give_values(&mut self.nets);
        bank.is_formed = false;
        let arrives_fs = bank.arrives_fs.take();
        for stage in 0..bank.cells.len() {
            let (cell, net) = (bank.cells[stage] as usize, bank.nets[stage]);
            let value = Logic::from(bank.is_set(stage)).bits();
            self.cells[cell].state = value;
            let state = &mut self.nets[net as usize];
            if let Some(time_fs) = arrives_fs {
                // No event of the bank finds its net again.
                state.generation = (state.generation + 2) & (u32::MAX >> 2);
                state.pending = NONE;
                if bank.is_set(stage) != bank.shows(stage) {
                    state.pending = value;
                    let tag = state.generation << 2 | u32::from(value);
                    self.wheel.push(Event { time_fs, net, tag });
                }
            }
        }
    }

    /// Before a flip-flop is looked at by itself.
    #[inline]
    pub(super) fn dissolve_bank_of(&mut self, cell: usize) {
        let has = |bank: &ShiftBank| bank.is_formed && bank.cells.contains(&(cell as u32));
        if !self.banks.is_empty()
            && let Some(index) = self.banks.iter().position(has)
        {
            self.dissolve(index);
        }
    }
}

impl ShiftBank {
    /// Gives the nets the values that the outputs show.
    fn give_values(&mut self, nets: &mut [NetState]) {
        if !self.nets_are_late {
            return;
        }
        self.nets_are_late = false;
        for (stage, &net) in self.nets.iter().enumerate() {
            nets[net as usize].value = Logic::from(self.shows(stage)).bits();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::stimulus::{Drive, Stimulus};
    use crate::netlist::{CellKind, Corner, Library, ModuleBuilder, Netlist, Timing};

    /// A register is a bank from the first edge at which all is known and at rest, until a reset comes.
    #[test]
    fn a_register_at_rest_is_a_bank_from_its_next_edge_on() {
        let mut m = ModuleBuilder::new("register");
        let [d, ck, r] = ["D", "CK", "R"].map(|name| m.input(name));
        let q = m.output_bus("Q", 100);
        for stage in 0..100 {
            let data = if stage == 0 { d } else { q[stage - 1] };
            let pins = [data, ck, r];
            m.cell(
                &format!("stage_{stage}"),
                CellKind::Dffr,
                &pins,
                &[Some(q[stage]), None],
            );
        }
        let netlist = Netlist::elaborate(&m.finish().expect("a register"));
        let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
        let mut kernel = Kernel::new(&netlist, &timing);
        let net = |name: &str| netlist.net(name).expect("a net");
        let mut now = Time::ZERO;
        // Whether it is a bank after each of these, which come 10 ns apart.
        for (name, value, is_formed) in [
            ("D", true, false),
            ("CK", false, false),
            ("R", true, false),
            ("R", false, false),
            ("CK", true, true),
            ("CK", false, true),
            ("D", false, true),
            ("CK", true, true),
            ("CK", false, true),
            ("R", true, false),
            ("CK", true, false),
            ("CK", false, false),
            ("R", false, false),
            ("CK", true, true),
        ] {
            let drive = Drive::new(now, net(name), value);
            now += Time::from_ns(10);
            kernel
                .run(&mut Stimulus::sorted(vec![drive]), now, &mut ())
                .expect("no loop of cells without delay");
            assert_eq!(kernel.banks.len(), 1);
            assert_eq!(
                kernel.banks[0].is_formed, is_formed,
                "{name} {value} before {now:?}"
            );
        }
    }
}
