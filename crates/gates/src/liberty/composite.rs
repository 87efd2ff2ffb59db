//! One instance of a kind: the cells that stand for it, between its pins.
//!
//! ```text
//!   slew at each pin ─► stage ─► stage ─► slew at each output
//!                         └──────────────► delay from each pin to each output, limits at the pins
//! ```

use std::collections::BTreeMap;

use super::candidate::FlipFlop;
use super::cell::{CellEnergy, CellModel};
use super::mapping::{Recipe, Source};
use crate::netlist::{
    ArcDelay, CellDelays, CellKind, CheckKind, Control, Edge, InstanceLimits, MAX_INPUTS,
    MAX_OUTPUTS,
};

/// Something of each direction of a change: rise, fall.
pub(super) type ByEdge = [f64; 2];

/// An instance: what stands for it, and which drive of each stage.
#[derive(Debug, Clone, Copy)]
pub(super) struct Composite<'m> {
    pub recipe: &'m Recipe,
    pub drives: &'m [u8],
    /// Whether each output leads anywhere.
    pub is_connected: [bool; MAX_OUTPUTS],
}

/// What loads and slews make of an instance.
pub(super) struct Conditions {
    /// Slew at each input pin, fs.
    pub slews: [ByEdge; MAX_INPUTS],
    /// Load of each output's net, fF.
    pub loads: [ByEdge; MAX_OUTPUTS],
}

/// Where a signal comes to within an instance: an input pin, or a stage's output.
const PLACES: usize = MAX_INPUTS + 2 * MOST_STAGES;
/// Most stages of a recipe: a flip-flop with an inverter at each pin and output.
pub(super) const MOST_STAGES: usize = 8;

/// Longest times to both edges at all places, fs.
type Times = [[Option<f64>; 2]; PLACES];

fn place(source: Source) -> Option<usize> {
    match source {
        Source::Input(pin) => Some(pin),
        Source::Stage(stage, output) => Some(MAX_INPUTS + 2 * stage + output),
        Source::Constant(_) => None,
    }
}

impl<'m> Composite<'m> {
    /// The cell of a stage.
    pub(super) fn cell(&self, stage: usize) -> &'m CellModel {
        &self.recipe.stages[stage].drives[self.drives[stage] as usize]
    }

    /// Stages that something comes of, in order: a flip-flop's inverse output may lead nowhere.
    pub(super) fn used(&self) -> impl Iterator<Item = usize> {
        (0..self.recipe.stages.len()).filter(|&stage| self.is_used(stage))
    }

    fn is_used(&self, stage: usize) -> bool {
        (0..self.cell(stage).outputs.len()).any(|output| self.is_read(Source::Stage(stage, output)))
    }

    /// Whether a signal within leads to an output or to a stage that does.
    pub(super) fn is_read(&self, signal: Source) -> bool {
        let outputs = self.recipe.outputs.iter().zip(self.is_connected);
        let stages = self.recipe.stages.iter().enumerate();
        outputs
            .into_iter()
            .any(|(source, connected)| *source == signal && connected)
            || stages
                .into_iter()
                .any(|(stage, made)| made.sources.contains(&signal) && self.is_used(stage))
    }

    /// What the cell of a stage is called, of the instance at `path`: without dots, at which some readers of SDF cut names.
    pub(super) fn instance_name(&self, path: &str, stage: usize) -> String {
        let path = path.replace('.', "__");
        match self.recipe.stages.len() {
            1 => path,
            _ => format!("{path}__{stage}"),
        }
    }

    /// The first stage and pin that a signal leads to.
    pub(super) fn pin_behind(&self, source: Source) -> Option<(usize, usize)> {
        let mut stages = self.recipe.stages.iter().enumerate();
        stages.find_map(|(stage, made)| {
            let pin = made.sources.iter().position(|own| *own == source)?;
            Some((stage, pin))
        })
    }

    /// Load that this instance puts on one of its input pins, fF.
    pub(super) fn input_load(&self, pin: usize) -> ByEdge {
        self.load_at(Source::Input(pin))
    }

    /// Load of this instance's own cells on a signal within it, fF.
    fn load_at(&self, signal: Source) -> ByEdge {
        let mut load = [0.0; 2];
        for (stage, made) in self.recipe.stages.iter().enumerate() {
            for (pin, source) in made.sources.iter().enumerate() {
                if *source == signal && self.is_used(stage) {
                    let own = self.cell(stage).inputs[pin].load_ff;
                    load = std::array::from_fn(|edge| load[edge] + own[edge]);
                }
            }
        }
        load
    }

    /// Load of a stage's output, its pin's own capacitance included, fF.
    pub(super) fn output_load(
        &self,
        stage: usize,
        output: usize,
        loads: &[ByEdge; MAX_OUTPUTS],
    ) -> ByEdge {
        let from = Source::Stage(stage, output);
        let (mut load, own) = (self.load_at(from), self.cell(stage).outputs[output].load_ff);
        load = std::array::from_fn(|edge| load[edge] + own[edge]);
        for (net, source) in loads.iter().zip(&self.recipe.outputs) {
            if *source == from {
                load = std::array::from_fn(|edge| load[edge] + net[edge]);
            }
        }
        load
    }

    /// Slews at all places for slews at the pins, fs; none where no arc leads.
    fn slews(&self, conditions: &Conditions) -> [Option<ByEdge>; PLACES] {
        let mut slews = [None; PLACES];
        for (pin, slew) in conditions.slews.iter().enumerate() {
            slews[pin] = Some(*slew);
        }
        for stage in 0..self.recipe.stages.len() {
            let cell = self.cell(stage);
            for output in 0..cell.outputs.len() {
                let load = self.output_load(stage, output, &conditions.loads);
                let mut worst: [Option<f64>; 2] = [None; 2];
                for arc in cell.arcs.iter().filter(|arc| arc.to == output) {
                    let from = place(self.recipe.stages[stage].sources[arc.from]);
                    let Some(before) = from.and_then(|from| slews[from]) else {
                        continue;
                    };
                    let effect = arc.effect as usize;
                    let slew = arc
                        .slew
                        .interpolate(before[arc.cause as usize], load[effect]);
                    worst[effect] = Some(worst[effect].map_or(slew, |w: f64| w.max(slew)));
                }
                if let [rise, fall] = worst
                    && let Some(other) = rise.or(fall)
                {
                    let place = MAX_INPUTS + 2 * stage + output;
                    slews[place] = Some([rise.unwrap_or(other), fall.unwrap_or(other)]);
                }
            }
        }
        slews
    }

    /// Slews of the outputs, fs.
    pub(super) fn output_slews(&self, conditions: &Conditions) -> Vec<Option<ByEdge>> {
        let slews = self.slews(conditions);
        let outputs = self.recipe.outputs.iter();
        outputs.map(|&source| slews[place(source)?]).collect()
    }

    /// Slew of a stage's output for a slew at its every input, fs, the worse of both directions.
    pub(super) fn stage_slew(&self, stage: usize, slew: f64, loads: &[ByEdge; MAX_OUTPUTS]) -> f64 {
        let cell = self.cell(stage);
        let loads: Vec<ByEdge> = (0..cell.outputs.len())
            .map(|output| self.output_load(stage, output, loads))
            .collect();
        let slews = cell.arcs.iter().map(|arc| {
            arc.slew
                .interpolate(slew, loads[arc.to][arc.effect as usize])
        });
        slews.fold(0.0, f64::max)
    }

    /// Longest times from an edge at a pin to both edges at all places, fs.
    fn times(
        &self,
        conditions: &Conditions,
        slews: &[Option<ByEdge>; PLACES],
        pin: usize,
        edge: Edge,
    ) -> Times {
        let mut times = [[None; 2]; PLACES];
        times[pin][edge as usize] = Some(0.0);
        for stage in 0..self.recipe.stages.len() {
            let cell = self.cell(stage);
            for arc in &cell.arcs {
                let Some(from) = place(self.recipe.stages[stage].sources[arc.from]) else {
                    continue;
                };
                let (cause, effect) = (arc.cause as usize, arc.effect as usize);
                let (Some(time), Some(slew)) = (times[from][cause], slews[from]) else {
                    continue;
                };
                let load = self.output_load(stage, arc.to, &conditions.loads)[effect];
                let time = time + arc.delay.interpolate(slew[cause], load);
                let worst = &mut times[MAX_INPUTS + 2 * stage + arc.to][effect];
                *worst = Some(worst.map_or(time, |w: f64| w.max(time)));
            }
        }
        times
    }

    /// Delay of every arc of a stage's cell, fs: from an input to an output's edge, at the slower of the input's edges.
    pub(super) fn stage_delays(
        &self,
        stage: usize,
        conditions: &Conditions,
    ) -> BTreeMap<(usize, usize, Edge), f64> {
        let (slews, mut delays) = (self.slews(conditions), BTreeMap::new());
        for arc in &self.cell(stage).arcs {
            let at = place(self.recipe.stages[stage].sources[arc.from]);
            let Some(slew) = at.and_then(|at| slews[at]) else {
                continue;
            };
            let load = self.output_load(stage, arc.to, &conditions.loads)[arc.effect as usize];
            let delay = arc.delay.interpolate(slew[arc.cause as usize], load);
            let slowest: &mut f64 = delays
                .entry((arc.from, arc.to, arc.effect))
                .or_insert(delay);
            *slowest = slowest.max(delay);
        }
        delays
    }

    /// Energy within the cells, and of the loads at their outputs for 1 V, fJ, when nets at the pins change so often. Conditions (`when`) are
    /// averaged, and of an output's energies those of the pins that change more often count more. What changes within is taken from
    /// the input of a single one, and else from the outputs.
    pub(super) fn energy_fj(
        &self,
        conditions: &Conditions,
        inputs: [f64; MAX_INPUTS],
        outputs: [f64; MAX_OUTPUTS],
    ) -> [f64; 2] {
        let (slews, mut changes) = (self.slews(conditions), [0.0; PLACES]);
        changes[..MAX_INPUTS].copy_from_slice(&inputs);
        let shown = outputs.into_iter().fold(0.0, f64::max);
        let (mut within, mut loads) = (0.0, 0.0);
        for stage in self.used() {
            let (cell, sources) = (self.cell(stage), &self.recipe.stages[stage].sources);
            // Changes of a pin, and its slew.
            let changes_and_slew = |pin: usize, changes: &[f64; PLACES]| {
                let place = place(sources[pin]);
                let slew = place.and_then(|at| slews[at]).unwrap_or_default();
                (
                    place.map_or(0.0, |at| changes[at]),
                    0.5 * (slew[0] + slew[1]),
                )
            };
            let mean = |to, only: Option<usize>, load, changes: &[f64; PLACES]| {
                let ours = |e: &&CellEnergy| e.to == to && (only.is_none() || e.from == only);
                let each = cell.energies.iter().filter(ours).map(|energy| {
                    let (weight, slew) = changes_and_slew(energy.from.unwrap_or(0), changes);
                    let [rise, fall] = energy
                        .tables
                        .each_ref()
                        .map(|table| table.interpolate(slew, load));
                    (weight, 0.5 * (rise + fall))
                });
                let (mut sum, mut weights, mut plain, mut count) = (0.0, 0.0, 0.0, 0.0);
                for (weight, fj) in each {
                    (sum, weights) = (sum + weight * fj, weights + weight);
                    (plain, count) = (plain + fj, count + 1.0);
                }
                if weights > 0.0 {
                    sum / weights
                } else {
                    plain / f64::max(count, 1.0)
                }
            };
            for output in 0..cell.outputs.len() {
                let from = Source::Stage(stage, output);
                let mut pins = self
                    .recipe
                    .outputs
                    .iter()
                    .zip(self.is_connected)
                    .zip(outputs);
                let pin = pins.find(|((source, connected), _)| **source == from && *connected);
                let count = match pin {
                    Some((_, count)) => count,
                    None if sources.len() == 1 => changes_and_slew(0, &changes).0,
                    None => shown,
                };
                let load = self.output_load(stage, output, &conditions.loads);
                let load = 0.5 * (load[0] + load[1]);
                within += count * mean(Some(output), None, load, &changes);
                loads += count * 0.5 * load;
                changes[MAX_INPUTS + 2 * stage + output] = count;
            }
            for pin in 0..sources.len() {
                within += changes_and_slew(pin, &changes).0 * mean(None, Some(pin), 0.0, &changes);
            }
        }
        [within, loads]
    }

    /// Delays of this instance, which is of `kind`, and its limits.
    pub(super) fn characterise(
        &self,
        kind: CellKind,
        conditions: &Conditions,
    ) -> (CellDelays, InstanceLimits) {
        let slews = self.slews(conditions);
        let mut delays = CellDelays::default();
        let times = self.times_of_pins(kind, conditions, &slews);
        for (pin, output, latest) in self.latest(kind, &times) {
            let [rise, fall] = latest.map(|fs| fs.map(whole_fs));
            // Every edge that the kind makes has an arc. A control makes one edge alone, and the other never happens.
            delays[pin][output] = ArcDelay {
                rise_fs: rise.or(fall).unwrap_or(0),
                fall_fs: fall.or(rise).unwrap_or(0),
            };
        }
        let mut limits = InstanceLimits::none();
        if let Some((stage, roles)) = &self.recipe.flip_flop {
            self.limit(&mut limits, (*stage, roles), &times, &slews);
        }
        (delays, limits)
    }

    /// Times from both edges of each pin to all places.
    fn times_of_pins(
        &self,
        kind: CellKind,
        conditions: &Conditions,
        slews: &[Option<ByEdge>; PLACES],
    ) -> Vec<[Times; 2]> {
        let pins = 0..kind.inputs().len();
        pins.map(|pin| Edge::BOTH.map(|edge| self.times(conditions, slews, pin, edge)))
            .collect()
    }

    /// Of each pin that makes edges and each output: the latest rise and fall, fs.
    fn latest(
        &self,
        kind: CellKind,
        times: &[[Times; 2]],
    ) -> impl Iterator<Item = (usize, usize, [Option<f64>; 2])> {
        let pins = times
            .iter()
            .enumerate()
            .filter(move |(pin, _)| kind.triggers(*pin));
        pins.flat_map(move |(pin, by_edge)| {
            let outputs = self.recipe.outputs.iter().enumerate();
            outputs.filter_map(move |(output, &source)| {
                let at = place(source)?;
                let latest = |to: usize| {
                    let times = by_edge.iter().filter_map(|times| times[at][to]);
                    times.reduce(f64::max)
                };
                Some((pin, output, [latest(0), latest(1)]))
            })
        })
    }

    /// The shortest and the longest delay between pins of this instance, fs, before they are whole and none is below 0.
    pub(super) fn extreme_delays(&self, kind: CellKind, conditions: &Conditions) -> [f64; 2] {
        let times = self.times_of_pins(kind, conditions, &self.slews(conditions));
        let mut extremes = [f64::INFINITY, f64::NEG_INFINITY];
        for (_, output, latest) in self.latest(kind, &times) {
            // An output that leads nowhere has no load, and nobody waits for it.
            if !self.is_connected[output] {
                continue;
            }
            for fs in latest.into_iter().flatten() {
                extremes = [extremes[0].min(fs), extremes[1].max(fs)];
            }
        }
        extremes
    }

    /// Limits of the flip-flop among the stages, moved to the pins of the whole by what lies between.
    fn limit(
        &self,
        limits: &mut InstanceLimits,
        (stage, roles): (usize, &FlipFlop),
        times: &[[Times; 2]],
        slews: &[Option<ByEdge>; PLACES],
    ) {
        let sources = &self.recipe.stages[stage].sources;
        // The pin of the whole behind a pin of the flip-flop, and by how much later the flip-flop sees the latter's `edge`.
        let behind = |pin: usize, edge: Edge| {
            let at = place(sources[pin])?;
            (0..times.len()).find_map(|outer| {
                Edge::BOTH.iter().find_map(|&own| {
                    let late = times[outer][own as usize][at][edge as usize]?;
                    Some((outer, own, late))
                })
            })
        };
        let (clock, inverted) = roles.clock;
        let active = if inverted { Edge::Fall } else { Edge::Rise };
        let Some((_, _, clock_late)) = behind(clock, active) else {
            return;
        };
        let slew_of = |pin: usize, edge: Edge| {
            let at = place(sources[pin]).and_then(|at| slews[at]);
            at.map_or(0.0, |slew| slew[edge as usize])
        };
        let clock_slew = slew_of(clock, active);
        for check in &self.cell(stage).checks {
            let Some((outer, own_edge, late)) = behind(check.pin, check.edge) else {
                continue;
            };
            let own_slew = slew_of(check.pin, check.edge);
            let apart = late - clock_late;
            let need = match check.kind {
                CheckKind::Setup | CheckKind::Recovery => {
                    check.limit.interpolate(clock_slew, own_slew) + apart
                }
                CheckKind::Hold | CheckKind::Removal => {
                    check.limit.interpolate(clock_slew, own_slew) - apart
                }
                _ => check.limit.interpolate(own_slew, own_slew),
            };
            let need = whole_fs(need.max(0.0));
            let controls: &[Control] = match outer {
                2 => &[Control::Reset],
                3 => &[Control::Set],
                _ => &[Control::Reset, Control::Set],
            };
            // Only setup and hold know the direction of D.
            let edges: &[Edge] = if check.kind.concerns_data() {
                &[own_edge][..]
            } else {
                &Edge::BOTH
            };
            for &control in controls {
                for &edge in edges {
                    let known = limits.limit_fs(control, check.kind, edge);
                    limits.set(control, check.kind, edge, known.max(need));
                }
            }
        }
    }
}

/// Femtoseconds as the kernel has them; nothing is faster than one.
fn whole_fs(fs: f64) -> u32 {
    fs.round().clamp(0.0, f64::from(u32::MAX)) as u32
}
