//! Delays of one macropixel, its P-counter left out.

use super::{DelaySpan, MacropixelPaths, changes, earliest, edge, latest};
use crate::chip::Probe;
use crate::netlist::{CellKind, Edge};
use crate::units::Time;

/// Delays of pulse shapers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShaperDelays {
    /// How long a shaped pulse is, longest.
    pub width: Time,
    /// SPAD_RAW falls → the delay chain is ready for the next pulse, latest.
    pub recovery: Time,
}

/// Delays of one macropixel, its P-counter left out.
#[derive(Debug, Clone)]
pub struct MacropixelDelays {
    /// SPAD_RAW rises → TOGGLE rises, falls; of each SPAD. Where SPADs share a wire: → what CLK samples, earliest and latest.
    pub latency: Vec<(Time, Time)>,
    /// The slowest pulse shaper, where there are any.
    pub shaper: Option<ShaperDelays>,
    /// TOGGLE → PHOTONS, where delay lines time what SPADs have in common.
    pub joining: Option<DelaySpan>,
    /// CLK rises → all that CLK samples has settled, latest, which of built-in blocks is SPAD_EVENT; nothing where delay lines time
    /// photons. A path that no values excite may be longer than any that they do: see the timing analysis of the correlation block.
    pub event: Time,
    /// CLK rises → the stage of SHIFT changes that each bin's HIT takes, bin 0 first; none where delay lines time photons.
    pub shift: Vec<DelaySpan>,
    /// STOP rises → COUNTER_RESET rises.
    pub reset: DelaySpan,
    /// STOP rises → COUNTER_RESET falls.
    pub release: DelaySpan,
    /// STOP rises → STOP_D rises, behind the delay chain.
    pub stop_d: DelaySpan,
    /// STOP rises → the pulse that becomes COUNTER_RESET rises, falls.
    pub pulse: (DelaySpan, DelaySpan),
    /// STOP rises → RUN changes.
    pub run: DelaySpan,
    /// STOP rises → RUN rises.
    pub run_rise: DelaySpan,
    /// STOP rises → STROBE rises, where STOP makes the strobe: in the conventional mode.
    pub stop_strobe: DelaySpan,
    /// STOP rises → what freezes the window rises, conventional mode: STROBE, or SAMPLE_CLK before it.
    pub stop_sample: DelaySpan,
    /// STOP rises → HIT's reset ends, conventional mode.
    pub stop_hit_release: DelaySpan,
    /// STROBE rises → HIT rises, latest.
    pub strobe_to_hit: Time,
    /// The flip-flop of a bin's lowest bit, and HIT's rise (latest) and fall (earliest) → its clock, where HIT clocks it.
    pub hit_to_count: Option<(CellKind, Time, Time)>,
    /// The slowest arc of any cell.
    pub slowest: Time,
    /// The slowest arc of an AND.
    pub slowest_and: Time,
    /// The fastest arc of a flip-flop.
    pub fastest_flip_flop: Time,
}

impl MacropixelDelays {
    /// Measures them.
    pub(crate) fn measure(paths: &MacropixelPaths<'_>) -> Self {
        let circuit = paths.circuit;
        let net = |probe| circuit.probes.net(probe);
        let rise = paths.after_clk(Edge::Rise);
        let stop = paths.after_stop();
        let hits = circuit.hits.iter();
        let shift = hits.clone().filter(|_| circuit.is_clocked());
        let hits = hits.zip(circuit.probes.latched());
        let hits = hits.map(|(&cell, &hit)| {
            let outputs = &circuit.netlist.cells()[cell.index()].outputs;
            paths
                .clock_to_q(cell, usize::from(outputs[0] != Some(hit)))
                .0
        });
        MacropixelDelays {
            latency: paths.front_end_latency(),
            shaper: paths.shaper_delays(),
            joining: paths.joining(),
            event: latest(circuit.clocked.iter().map(|&net| rise.window(net)))
                .unwrap_or(Time::ZERO),
            shift: shift
                .map(|&cell| changes(&rise, circuit.pin(cell, 0)))
                .collect(),
            reset: edge(&stop, net(Probe::CounterReset), Edge::Rise),
            release: edge(&stop, net(Probe::CounterReset), Edge::Fall),
            stop_d: edge(&stop, net(Probe::StopD), Edge::Rise),
            pulse: (
                edge(&stop, net(Probe::ResetPulse), Edge::Rise),
                edge(&stop, net(Probe::ResetPulse), Edge::Fall),
            ),
            run: changes(&stop, net(Probe::Enable)),
            run_rise: edge(&stop, net(Probe::Enable), Edge::Rise),
            stop_strobe: edge(&stop, circuit.hit_pin(1), Edge::Rise),
            stop_sample: edge(&stop, circuit.sampling(), Edge::Rise),
            stop_hit_release: edge(&stop, circuit.hit_pin(2), Edge::Fall),
            strobe_to_hit: hits.max().expect("a METDC has bins"),
            hit_to_count: paths.hit_to_count(),
            slowest: latest(paths.arcs(|_| true)).unwrap_or(Time::ZERO),
            slowest_and: latest(paths.arcs(|kind| kind == CellKind::And2)).unwrap_or(Time::ZERO),
            fastest_flip_flop: earliest(paths.arcs(CellKind::is_flip_flop)).unwrap_or(Time::ZERO),
        }
    }
}
