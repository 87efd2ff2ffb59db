//! The passes of a block, one after the other, and those that need not be run.
//!
//! ```text
//!   laser cycle 0      1           2   3   4   …            N-2   N-1
//!               live   recorded    replayed: photons only         live
//!               └─ passes that change nothing are skipped ─┘
//! ```
//!
//! * A pass that CLK alone starts, and that changes nothing but CLK, leaves everything as it was; so would the next one.
//!   Such passes are skipped up to the next cause: counters at rest cost nothing.
//! * Control ([`Parts`]) is the same in every laser cycle that it enters in the same state, whatever the photons. The
//!   first such cycle's effects on photonic actions are written down, and repeated in the cycles that follow.
//! * What follows a sample waits until another cause is due, and is then done for all lanes at once.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;

use super::parts::{Parts, Run};
use super::schedule::Schedule;
use super::stream::Flow;
use super::tape::{Action, Bits, Block, Code, PassTape, change, clocked, counts, step};
use super::word::Word;

/// Passes after the last CLK edge within which every count has rippled through.
const SETTLING_PASSES: i64 = 256;

/// Laser cycles that are recorded before control is taken to have no period.
const RECORDINGS: usize = 4;

/// Runs all passes of one block, control in every laser cycle anew unless it may be replayed.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(crate) fn run_passes(
    tape: &PassTape,
    parts: &Parts,
    block: &mut Block,
    flow: &mut Flow<'_>,
    mut schedule: Schedule<'_>,
    replays_control: bool,
) {
    let is_control = |action: u16| !parts.photonic.contains(action);
    let can_replay = replays_control
        && schedule.is_periodic()
        && tape
            .clock
            .iter()
            .copied()
            .chain(schedule.actions())
            .all(is_control);
    let mut recordings = if can_replay { RECORDINGS } else { 0 };
    let mut record: Option<Record> = None;
    let end = schedule.clocked + SETTLING_PASSES;
    let mut passes = Passes {
        tape,
        parts,
        block,
        flow,
        // STOP may rise before the first falling CLK edge.
        pass: -1,
        samples: parts.runs.iter().map(Samples::new).collect(),
        waiting: Bits::new(tape.actions.len()),
        seen: Word::ZERO,
    };
    while passes.pass < end {
        if let Some(left) = schedule.middle_cycles(passes.pass) {
            let is_same = record.take_if(|record| record.is_back(parts, passes.block));
            if let Some(record) = is_same {
                passes.replay(&record, left, &mut schedule);
                recordings = 0;
            } else if recordings > 0 {
                recordings -= 1;
                record = Some(Record::new(passes.pass, passes.block));
            } else {
                record = None;
            }
        }
        passes.live(&mut schedule, record.as_mut(), end);
    }
    passes.count_waiting();
}

/// What control does in a laser cycle, as photonic actions see it.
struct Record {
    first_pass: i64,
    /// The block at its beginning.
    words: Vec<Word>,
    pending: Bits,
    effects: Vec<Effect>,
    /// Places and what was written to them.
    written: Vec<u16>,
    values: Vec<Word>,
    /// Photonic actions woken.
    woken: Vec<u16>,
    /// Samplers that run, in passes from the first, while control makes them not deferrable.
    not_deferrable: Vec<(i64, u16)>,
}

/// Effects of one action of control: ends in the lists of the record.
struct Effect {
    /// From the first of the laser cycle.
    pass: i64,
    action: u16,
    written: usize,
    woken: usize,
}

impl Record {
    fn new(first_pass: i64, block: &Block) -> Self {
        Record {
            first_pass,
            words: block.words.clone(),
            pending: block.pending.clone(),
            effects: Vec::new(),
            written: Vec::new(),
            values: Vec::new(),
            woken: Vec::new(),
            not_deferrable: Vec::new(),
        }
    }

    /// Whether control is as it was at the beginning.
    fn is_back(&self, parts: &Parts, block: &Block) -> bool {
        let mut words = self
            .words
            .iter()
            .zip(&block.words)
            .zip(&parts.photonic_places);
        let mut pending = (self.pending.0.iter().zip(&block.pending.0)).zip(&parts.photonic.0);
        words.all(|((was, is), is_photonic)| *is_photonic || was == is)
            && pending.all(|((was, is), photonic)| (was ^ is) & !photonic == 0)
    }

    /// Notes what an action of control did, given what was at the places that it writes.
    fn note(&mut self, passes: &Passes<'_, '_>, index: u16, before: [Word; 3], changed: [bool; 2]) {
        let action = &passes.tape.actions[usize::from(index)];
        let [rise, fall] = action.masks;
        for (place, before) in [action.out, rise, fall].into_iter().zip(before) {
            let value = passes.block.words[usize::from(place)];
            if passes.parts.interface[usize::from(place)] && value != before {
                self.written.push(place);
                self.values.push(value);
            }
        }
        for direction in (0..2).filter(|&direction| changed[direction]) {
            let woken = passes.tape.woken(action, direction).iter().copied();
            self.woken
                .extend(woken.filter(|&next| passes.parts.photonic.contains(next)));
        }
        let effect = Effect {
            pass: passes.pass - self.first_pass,
            action: index,
            written: self.written.len(),
            woken: self.woken.len(),
        };
        let ends = self.effects.last().map_or((0, 0), |e| (e.written, e.woken));
        if ends != (effect.written, effect.woken) {
            self.effects.push(effect);
        }
    }
}

/// What the samplers of a run have sampled.
struct Samples {
    lanes: Word,
    /// In those lanes; 0 elsewhere.
    values: Vec<Word>,
}

impl Samples {
    fn new(run: &Run) -> Self {
        Samples {
            lanes: Word::ZERO,
            values: vec![Word::ZERO; run.taps.len()],
        }
    }
}

struct Passes<'a, 'f> {
    tape: &'a PassTape,
    parts: &'a Parts,
    block: &'a mut Block,
    flow: &'a mut Flow<'f>,
    pass: i64,
    /// Samples that wait, by run.
    samples: Vec<Samples>,
    /// Lanes that have any.
    seen: Word,
    /// What they have woken.
    waiting: Bits,
}

impl Passes<'_, '_> {
    /// Runs one pass, and skips those that would change nothing.
    #[inline(always)]
    fn live(&mut self, schedule: &mut Schedule<'_>, mut record: Option<&mut Record>, end: i64) {
        let mut is_at_rest = self.block.is_settled();
        let has_clock = (0..schedule.clocked).contains(&self.pass);
        if has_clock {
            for &action in &self.tape.clock {
                self.block.pending.insert(action);
            }
        }
        is_at_rest &= !self.start_causes(schedule, true);
        let due = match schedule.due() {
            Some((due, _)) => due,
            None => end,
        };
        let mut from = 0;
        while let Some(index) = self.block.pending.next_among(&self.parts.every, from) {
            from = index + 1;
            let action = &self.tape.actions[usize::from(index)];
            let waits = self.may_wait(index, due);
            let changed = match &mut record {
                Some(record) if !self.parts.photonic.contains(index) => {
                    let [rise, fall] = action.masks;
                    let before = [action.out, rise, fall].map(|p| self.block.words[usize::from(p)]);
                    let changed = self.perform(index, false);
                    record.note(self, index, before, changed);
                    changed
                }
                Some(record) => {
                    if waits && !self.is_deferrable(false) {
                        record
                            .not_deferrable
                            .push((self.pass - record.first_pass, index));
                    }
                    self.perform(
                        index,
                        waits && self.is_deferrable(true) && self.is_deferrable(false),
                    )
                }
                None => self.perform(
                    index,
                    waits && self.is_deferrable(true) && self.is_deferrable(false),
                ),
            };
            is_at_rest &= changed == [false; 2] || matches!(action.code, Code::Set(_));
        }
        self.pass += 1;
        if is_at_rest && self.block.is_settled() {
            let same_until = if has_clock { schedule.clocked } else { end };
            self.pass = self.pass.max(due.min(same_until));
        }
    }

    /// Replays `cycles` laser cycles.
    #[inline(always)]
    fn replay(&mut self, record: &Record, cycles: i64, schedule: &mut Schedule<'_>) {
        for _ in 0..cycles {
            let first_pass = self.pass;
            let end = first_pass + schedule.stop_periods;
            let (mut next_effect, mut written, mut woken) = (0, 0, 0);
            loop {
                let pending = &self.block.pending;
                if pending.next_among(&self.parts.photonic, 0).is_none() {
                    self.pass = match record.effects.get(next_effect) {
                        Some(effect) => first_pass + effect.pass,
                        None => end,
                    };
                }
                if self.pass >= end {
                    break;
                }
                self.start_causes(schedule, false);
                let due = match schedule.due() {
                    Some((due, _)) => due,
                    None => end,
                };
                let mut from = 0;
                loop {
                    let pending = &self.block.pending;
                    let next = pending.next_among(&self.parts.photonic, from);
                    if let Some(effect) = record.effects.get(next_effect)
                        && first_pass + effect.pass == self.pass
                        && effect.action < next.unwrap_or(u16::MAX)
                    {
                        for i in written..effect.written {
                            self.block.words[usize::from(record.written[i])] = record.values[i];
                        }
                        for &action in &record.woken[woken..effect.woken] {
                            self.block.pending.insert(action);
                        }
                        (written, woken) = (effect.written, effect.woken);
                        next_effect += 1;
                        // What it has woken behind itself is for the next pass.
                        from = effect.action + 1;
                    } else if let Some(next) = next {
                        from = next + 1;
                        let waits = self.may_wait(next, due)
                            && self.is_deferrable(true)
                            && !record
                                .not_deferrable
                                .contains(&(self.pass - first_pass, next));
                        self.perform(next, waits);
                    } else {
                        break;
                    }
                }
                self.pass += 1;
            }
            // Causes after the last effect.
            self.pass = end - 1;
            self.start_causes(schedule, false);
            self.pass = end;
        }
    }

    /// Takes the causes that are due by this pass, for which samples do not wait; whether there are any.
    #[inline(always)]
    fn start_causes(&mut self, schedule: &mut Schedule<'_>, is_live: bool) -> bool {
        let mut is_any = false;
        while let Some(action) = schedule.next_until(self.pass) {
            if !is_any {
                self.count_waiting();
            }
            is_any = true;
            if is_live {
                self.block.pending.insert(action);
            }
        }
        is_any
    }

    /// Whether an action begins a run of samplers that are done with what follows before the next cause is due.
    #[inline(always)]
    fn may_wait(&self, index: u16, due: i64) -> bool {
        self.parts.run_from[usize::from(index)].is_some() && self.pass + self.tape.settling < due
    }

    /// Whether none of the photonic actions, or of the others, that are pending would mind a sample that waits.
    #[inline(always)]
    fn is_deferrable(&self, photonic: bool) -> bool {
        let Parts {
            deferrable,
            photonic: all,
            ..
        } = self.parts;
        let mut any = 0;
        for (group, pending) in self.block.pending.0.iter().enumerate() {
            let which = if photonic {
                all.0[group]
            } else {
                !all.0[group]
            };
            any |= pending & which & !deferrable.0[group];
        }
        any == 0
    }

    /// Runs one action, or a run of samplers whose samples wait, and wakes others; whether any lane rose, and fell.
    #[inline(always)]
    fn perform(&mut self, index: u16, waits: bool) -> [bool; 2] {
        let action = &self.tape.actions[usize::from(index)];
        if matches!(action.code, Code::Sampler { .. }) {
            if waits
                && let Some(run) = self.parts.run_from[usize::from(index)]
                && self
                    .block
                    .pending
                    .remove_range(&self.parts.runs[usize::from(run)].actions)
            {
                self.sample(usize::from(run));
                return [true; 2];
            }
            self.count_waiting();
        }
        self.block.pending.remove(index);
        let changed = self.step(action);
        self.wake(index, changed, false);
        changed
    }

    /// Samples; what follows waits.
    #[inline(always)]
    fn sample(&mut self, run: usize) {
        let Run {
            actions,
            taps,
            is_doubtful,
        } = &self.parts.runs[run];
        let first = &self.tape.actions[usize::from(actions.start)];
        let lanes = clocked(first, &self.block.words);
        if (lanes & self.seen).any() {
            self.count_waiting();
        }
        self.seen = self.seen | lanes;
        if *is_doubtful && lanes.any() {
            self.block.doubt(first);
        }
        let samples = &mut self.samples[run];
        samples.lanes = samples.lanes | lanes;
        self.flow
            .gather(taps, self.pass, lanes, &mut samples.values);
    }

    #[inline(always)]
    fn step(&mut self, action: &Action) -> [bool; 2] {
        if action.is_doubtful && counts(action, &self.block.words) {
            self.block.doubt(action);
        }
        let words = &mut self.block.words;
        step(action, words, &self.tape.taps, self.flow, self.pass)
    }

    #[inline(always)]
    fn wake(&mut self, index: u16, changed: [bool; 2], waits: bool) {
        let action = &self.tape.actions[usize::from(index)];
        for (direction, &moved) in changed.iter().enumerate() {
            if !moved {
                continue;
            }
            for &next in self.tape.woken(action, direction) {
                if waits {
                    self.waiting.insert(next);
                } else {
                    self.block.pending.insert(next);
                }
            }
            if action.traps[direction] {
                self.block.doubt(action);
            }
        }
    }

    /// Hands out the samples that have waited, and does what follows.
    #[inline(always)]
    fn count_waiting(&mut self) {
        if !self.seen.any() {
            return;
        }
        self.seen = Word::ZERO;
        for run in 0..self.samples.len() {
            let lanes = std::mem::replace(&mut self.samples[run].lanes, Word::ZERO);
            if !lanes.any() {
                continue;
            }
            let actions = &self.parts.runs[run].actions;
            for index in actions.start..actions.end {
                let samples = &mut self.samples[run];
                let value = &mut samples.values[usize::from(index - actions.start)];
                let value = std::mem::replace(value, Word::ZERO);
                let action = &self.tape.actions[usize::from(index)];
                let old = self.block.words[usize::from(action.out)];
                let new = (old & !lanes) | value;
                let changed = change(action, &mut self.block.words, new);
                self.wake(index, changed, true);
            }
        }
        while !self.waiting.is_empty() {
            let mut from = 0;
            while let Some(index) = self.waiting.next_among(&self.parts.every, from) {
                from = index + 1;
                self.waiting.remove(index);
                let changed = self.step(&self.tape.actions[usize::from(index)]);
                self.wake(index, changed, true);
            }
        }
    }
}
