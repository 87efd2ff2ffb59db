//! Which actions photons can make a difference to, and which of those may wait.
//!
//! ```text
//!   CLK, STOP, … ─► counters ─► LOCAL_STOP ─► STROBE ─┬─► sampler ─► HIT ─► bit 0 ─► …
//!                        control                      │   photonic
//!                 the same in every laser cycle       │              tail: may wait
//!                                                 interface
//! ```
//!
//! Control never reads what photons reach, so that it can be run once and repeated. What follows a sample, the tail,
//! belongs to one lane alone: unless CLK or another cause interferes, it does not matter when it is run, and the
//! samples of many passes can be counted together.

use std::ops::Range;

use super::stream::Tap;
use super::tape::{Action, Bits, Code, PassTape, SINK, ZERO};

/// The parts of a tape.
#[derive(Debug, Clone)]
pub(super) struct Parts {
    /// All actions.
    pub every: Bits,
    /// Those that photons can make a difference to.
    pub photonic: Bits,
    /// By place: whether photons can make a difference to it.
    pub photonic_places: Vec<bool>,
    /// By place: whether photonic actions read it, and control writes it.
    pub interface: Vec<bool>,
    /// Samplers one behind the other that share clock, reset and set.
    pub runs: Vec<Run>,
    /// The run that begins with an action, if any.
    pub run_from: Vec<Option<u16>>,
    /// While only these are pending, samples are deferrable; empty if they never are.
    pub deferrable: Bits,
}

/// Samplers one behind the other that sample the same lanes.
#[derive(Debug, Clone)]
pub(super) struct Run {
    /// Them.
    pub actions: Range<u16>,
    /// What each of them samples, from the pass that it is in.
    pub taps: Vec<Tap>,
    /// Whether any of them is doubtful.
    pub is_doubtful: bool,
}

fn shares_clock(a: &Action, b: &Action) -> bool {
    a.inputs[1..] == b.inputs[1..] && a.invert[2..4] == b.invert[2..4]
}

fn is_sampler(action: &Action) -> bool {
    matches!(action.code, Code::Sampler { .. })
}

/// Places that an action writes.
fn written(action: &Action) -> impl Iterator<Item = u16> {
    let [rise, fall] = action.masks;
    [action.out, rise, fall].into_iter().filter(|&p| p != SINK)
}

/// Places that an action reads.
fn read(action: &Action) -> impl Iterator<Item = u16> {
    let inputs = action.inputs.into_iter().chain([action.out]);
    inputs.filter(|&place| place != ZERO)
}

impl Parts {
    /// The parts of a tape with `places` places.
    pub(super) fn new(tape: &PassTape, places: usize) -> Self {
        let samplers = || (0..).zip(&tape.actions).filter(|(_, a)| is_sampler(a));
        let mut every = Bits::new(tape.actions.len());
        (0..tape.actions.len()).for_each(|index| {
            every.insert(index as u16);
        });

        let mut photonic = Bits::new(tape.actions.len());
        let mut photonic_places = vec![false; places];
        for (index, action) in samplers() {
            photonic.insert(index);
            written(action).for_each(|p| photonic_places[usize::from(p)] = true);
        }
        loop {
            let mut settled = true;
            for (index, action) in (0..).zip(&tape.actions) {
                let mut touched = read(action).chain(written(action));
                if !photonic.contains(index) && touched.any(|p| photonic_places[usize::from(p)]) {
                    photonic.insert(index);
                    written(action).for_each(|p| photonic_places[usize::from(p)] = true);
                    settled = false;
                }
            }
            if settled {
                break;
            }
        }
        let mut interface = vec![false; places];
        for (_, action) in (0..)
            .zip(&tape.actions)
            .filter(|&(i, _)| photonic.contains(i))
        {
            read(action)
                .for_each(|p| interface[usize::from(p)] |= !photonic_places[usize::from(p)]);
        }

        let tail = reached(tape, samplers().flat_map(|(_, a)| targets(tape, a)));
        let clocked = reached(tape, tape.clock.iter().copied());
        let mut deferrable = Bits::new(tape.actions.len());
        if may_wait(tape, &tail, &clocked, places) {
            deferrable = clocked;
            for (index, _) in samplers() {
                deferrable.insert(index);
            }
        }
        let mut runs: Vec<Run> = Vec::new();
        let mut run_from = vec![None; tape.actions.len()];
        for (index, action) in samplers().filter(|&(index, _)| deferrable.contains(index)) {
            let tap = match action.code {
                Code::Sampler { tap, offset } => tape.taps[usize::from(tap)].delayed_by(offset),
                _ => unreachable!("a sampler"),
            };
            if let Some(run) = runs.last_mut().filter(|run| run.actions.end == index)
                && shares_clock(&tape.actions[usize::from(run.actions.start)], action)
            {
                run.actions.end = index + 1;
                run.taps.push(tap);
                run.is_doubtful |= action.is_doubtful;
                continue;
            }
            run_from[usize::from(index)] = Some(runs.len() as u16);
            runs.push(Run {
                actions: index..index + 1,
                taps: vec![tap],
                is_doubtful: action.is_doubtful,
            });
        }
        Parts {
            runs,
            run_from,
            every,
            photonic,
            photonic_places,
            interface,
            deferrable,
        }
    }
}

/// What an action may wake.
fn targets<'t>(tape: &'t PassTape, action: &Action) -> impl Iterator<Item = u16> + 't {
    let ends = action.wakes[0] as usize..action.wakes[2] as usize;
    tape.wakes[ends].iter().copied()
}

/// These and all that they may wake, up to the next sampler.
fn reached(tape: &PassTape, from: impl Iterator<Item = u16>) -> Bits {
    let mut reached = Bits::new(tape.actions.len());
    let mut open: Vec<u16> = from.collect();
    while let Some(index) = open.pop() {
        let action = &tape.actions[usize::from(index)];
        if reached.insert(index) && !is_sampler(action) {
            open.extend(targets(tape, action));
        }
    }
    reached
}

/// Whether CLK and what follows a sample leave each other alone.
fn may_wait(tape: &PassTape, tail: &Bits, clocked: &Bits, places: usize) -> bool {
    let actions_in = |set: &Bits| -> Vec<&Action> {
        let actions = (0..).zip(&tape.actions);
        let chosen = actions.filter(|&(index, _)| set.contains(index));
        chosen.map(|(_, action)| action).collect()
    };
    let samplers = tape.actions.iter().filter(|a| is_sampler(a));
    let (tail, clocked) = (actions_in(tail), actions_in(clocked));
    if tail.iter().any(|action| is_sampler(action)) {
        return false;
    }
    // By place: touched by CLK, written by CLK.
    let mut touched = vec![[false; 2]; places];
    for action in clocked.iter().filter(|action| !is_sampler(action)) {
        read(action).for_each(|p| touched[usize::from(p)][0] = true);
        written(action).for_each(|p| touched[usize::from(p)] = [true; 2]);
    }
    let mut follow = tail.iter().copied();
    follow.all(|action| read(action).all(|p| !touched[usize::from(p)][1]))
        && samplers
            .chain(tail)
            .all(|action| written(action).all(|p| !touched[usize::from(p)][0]))
}
