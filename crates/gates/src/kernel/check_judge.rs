//! The judgement of one instant: which checks its changes have completed, and whether their limits were kept.
//!
//! What completes what is the table at the head of [`TimingChecks`]'s file. Nets that changed within the instant are
//! brought up to date first, so that the order of their changes means nothing.

use super::check_banks::{Bank, CLOCK, DATA, Data, RESET, SET};
use super::check_report::{BINS, Policy, slack_bin};
use super::timing_checks::{History, MeasuredSlack, NEVER, TimingChecks};
use crate::logic::Logic;
use crate::netlist::{CheckKind, Control, Edge};

/// Violations that are kept one by one; further ones are only counted.
const MOST_VIOLATIONS: usize = 100_000;

impl TimingChecks {
    /// Judges the instant that has just ended.
    pub(super) fn complete(&mut self) {
        if self.touched.is_empty() {
            return;
        }
        let mut touched = std::mem::take(&mut self.touched);
        // All histories first, so that the judgement sees the whole instant.
        touched.retain(|&net| self.nets[net as usize].advance(self.now_fs));
        for &net in &touched {
            for position in self.pins.positions(net as usize) {
                let (index, pin) = self.pins.pin(position);
                if pin == DATA {
                    self.unsettle(index);
                }
            }
        }
        if self.now_fs >= self.not_before_fs {
            for &net in &touched {
                for position in self.pins.positions(net as usize) {
                    match self.pins.pin(position) {
                        (flip_flop, DATA) => self.judge_data(flip_flop),
                        (bank, pin) => self.judge_bank(bank as usize, pin),
                    }
                }
            }
        }
        touched.clear();
        self.touched = touched;
    }

    /// Puts a flip-flop whose D has changed on the list of those whose setup is judged.
    #[inline]
    fn unsettle(&mut self, index: u32) {
        let flip_flop = &mut self.flip_flops[index as usize];
        let bank = &mut self.banks[flip_flop.bank as usize];
        match flip_flop.data {
            Data::Recent => return,
            Data::Settled => bank.settled -= 1,
            Data::Still => {}
        }
        flip_flop.data = Data::Recent;
        bank.recent.push(index);
    }

    /// Whether R or S holds the flip-flops of a bank.
    #[inline]
    fn is_held(&self, bank: &Bank) -> bool {
        let is_high = |pin: usize| {
            let net = self.nets.get(bank.nets[pin] as usize);
            net.is_some_and(|net| net.now == Logic::One)
        };
        is_high(RESET) || is_high(SET)
    }

    /// Judges what a change of D has completed.
    #[inline]
    fn judge_data(&mut self, index: u32) {
        let flip_flop = &self.flip_flops[index as usize];
        let bank = flip_flop.bank as usize;
        if self.is_held(&self.banks[bank]) {
            return;
        }
        let edge = self.nets[flip_flop.nets[DATA] as usize].last_edge();
        let clock = &self.nets[flip_flop.nets[CLOCK] as usize];
        let since_fs = clock.rose_fs;
        self.measure(bank, &[index], CheckKind::Hold, DATA, edge, since_fs);
    }

    /// Judges what the change of one pin other than D has completed.
    #[inline]
    fn judge_bank(&mut self, index: usize, pin: usize) {
        let now_fs = self.now_fs;
        if self.is_held(&self.banks[index]) {
            return;
        }
        let nets = self.banks[index].nets;
        let clock = self.nets[nets[CLOCK] as usize];
        if pin != CLOCK {
            let control = self.nets[nets[pin] as usize];
            // A rise to X completes nothing.
            if control.fell_fs != now_fs {
                return;
            }
            if clock.rose_fs != now_fs {
                self.measure_all(index, CheckKind::Removal, pin, Edge::Fall, clock.rose_fs);
            }
            let rose_fs = control.rose_fs;
            self.measure_all(index, CheckKind::ControlHigh, pin, Edge::Fall, rose_fs);
        } else if clock.rose_fs == now_fs {
            self.judge_setup(index);
            for control in [RESET, SET] {
                if let Some(net) = self.nets.get(nets[control] as usize) {
                    let fell_fs = net.fell_fs;
                    self.measure_all(index, CheckKind::Recovery, control, Edge::Fall, fell_fs);
                }
            }
            self.measure_all(index, CheckKind::ClockLow, CLOCK, Edge::Rise, clock.fell_fs);
        } else {
            self.measure_all(
                index,
                CheckKind::ClockHigh,
                CLOCK,
                Edge::Fall,
                clock.rose_fs,
            );
        }
    }

    /// Judges the setup of a bank whose clock has risen.
    #[inline]
    fn judge_setup(&mut self, index: usize) {
        let bank = &mut self.banks[index];
        let (settled, is_asynchronous) = (bank.settled, bank.is_asynchronous);
        let tally = &mut self.summaries[CheckKind::Setup as usize];
        if is_asynchronous {
            tally.asynchronous += settled;
        } else {
            tally.checked += settled;
            tally.histogram[BINS - 1] += settled;
        }
        if bank.recent.is_empty() {
            return;
        }
        let mut recent = std::mem::take(&mut bank.recent);
        recent.retain(|&flip_flop| {
            let data = self.nets[self.flip_flops[flip_flop as usize].nets[DATA] as usize];
            let Some(edge) = self.edge_nearest_setup(flip_flop, data) else {
                return true;
            };
            let since_fs = data.last(edge);
            let of_one = &[flip_flop];
            let slack_fs = self.measure(index, of_one, CheckKind::Setup, DATA, edge, since_fs);
            let changes_now = data.last(data.last_edge()) == self.now_fs;
            let is_recent = changes_now || slack_bin(slack_fs) < BINS - 1;
            if !is_recent {
                self.flip_flops[flip_flop as usize].data = Data::Settled;
                self.banks[index].settled += 1;
            }
            is_recent
        });
        self.banks[index].recent = recent;
    }

    /// Which of the last rise and fall of D before this instant comes nearer to its setup limit.
    #[inline]
    fn edge_nearest_setup(&self, index: u32, data: History) -> Option<Edge> {
        let limits = &self.limits[self.flip_flops[index as usize].limits as usize];
        let limit = |edge| limits.limit_fs(Control::Reset, CheckKind::Setup, edge);
        let before = |edge: &Edge| ![NEVER, self.now_fs].contains(&data.last(*edge));
        let edges = Edge::BOTH.into_iter().filter(before);
        edges.max_by_key(|&edge| data.last(edge) + i64::from(limit(edge)))
    }

    /// Judges one distance of every flip-flop of a bank.
    #[inline]
    fn measure_all(&mut self, bank: usize, kind: CheckKind, pin: usize, edge: Edge, since_fs: i64) {
        let members = std::mem::take(&mut self.banks[bank].members);
        self.measure(bank, &members, kind, pin, edge, since_fs);
        self.banks[bank].members = members;
    }

    /// Judges one distance for some flip-flops of a bank: from `since_fs` to now, where `pin` changes or has changed
    /// in the direction of `edge`. Returns its slack, fs.
    #[inline]
    fn measure(
        &mut self,
        bank: usize,
        members: &[u32],
        kind: CheckKind,
        pin: usize,
        edge: Edge,
        since_fs: i64,
    ) -> i64 {
        if since_fs == NEVER {
            return i64::MAX;
        }
        let bank = &self.banks[bank];
        let control = match pin {
            SET => Control::Set,
            _ => Control::Reset,
        };
        let limit_fs = self.limits[bank.limits as usize].limit_fs(control, kind, edge);
        let slack_fs = self.now_fs - since_fs - i64::from(limit_fs);
        let is_asynchronous = bank.is_asynchronous && kind.concerns_data();
        let tally = &mut self.summaries[kind as usize];
        let count = members.len() as u64;
        let found = MeasuredSlack {
            time_fs: self.now_fs,
            slack_fs,
            flip_flop: members[0],
            kind,
            pin: pin as u8,
            edge,
            is_asynchronous,
        };
        if is_asynchronous {
            tally.asynchronous += count;
            tally.asynchronous_violated += count * u64::from(slack_fs < 0);
        } else {
            tally.checked += count;
            tally.histogram[slack_bin(slack_fs)] += count;
            // The first smallest; of one instant, the first in the netlist.
            let rank = |f: &MeasuredSlack| (f.slack_fs, f.time_fs, f.flip_flop);
            if tally.worst.is_none_or(|worst| rank(&found) < rank(&worst)) {
                tally.worst = Some(found);
            }
        }
        if slack_fs < 0 {
            for &flip_flop in members {
                self.violated(MeasuredSlack { flip_flop, ..found });
            }
        }
        slack_fs
    }

    #[cold]
    fn violated(&mut self, found: MeasuredSlack) {
        if self.found.len() < MOST_VIOLATIONS {
            self.found.push(found);
        } else {
            self.left_out += 1;
        }
        if found.is_asynchronous {
            return;
        }
        self.summaries[found.kind as usize].violated += 1;
        if self.policy == Policy::XOnViolation && found.kind.spoils_state() {
            let cell = self.flip_flops[found.flip_flop as usize].cell;
            self.doubtful.push(cell);
        }
    }
}
