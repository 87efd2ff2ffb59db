//! Delays of a P-counter with its timing block.

use super::{DelaySpan, MacropixelDelays, MacropixelPaths, changes, earliest, edge, latest};
use crate::chip::Probe;
use crate::netlist::Edge;
use crate::units::Time;

/// Delays of a P-counter with its timing block, and of the strobe that it makes.
#[derive(Debug, Clone)]
pub struct CounterDelays {
    /// CLK falls → COUNTER_CLK rises.
    pub counter_clk: DelaySpan,
    /// CLK falls → LOCAL_STOP rises. Every stage is taken to toggle, as it does when the counter rolls over.
    pub local_stop: DelaySpan,
    /// CLK falls → STROBE rises.
    pub strobe: DelaySpan,
    /// CLK falls → what freezes the window rises: STROBE, or SAMPLE_CLK before it.
    pub sample: DelaySpan,
    /// CLK falls → LOCAL_STOP → BLOCK rises; none where LOCAL_STOP does not block.
    pub block: Option<DelaySpan>,
    /// BLOCK rises → COUNTER_CLK falls, earliest.
    pub block_to_counter_clk: Option<Time>,
    /// CLK falls → data of the flip-flops that COUNTER_CLK clocks settled, latest.
    pub settled: Time,
    /// COUNTER_RESET falls → the last flip-flop is released, latest.
    pub released: Time,
    /// COUNTER_RESET rises → the last edge at the clock of a stage behind another, latest.
    pub reset_to_stage_clock: Option<Time>,
    /// A stage counts → the clock of a stage behind it rises, latest: a count may be on its way when the reset comes.
    pub stage_to_stage_clock: Option<Time>,
    /// COUNTER_RESET rises → LOCAL_STOP falls → COUNTER_CLK rises, latest; none where LOCAL_STOP does not block.
    pub reset_to_counter_clk: Option<Time>,
    /// COUNTER_RESET rises → data of the counting flip-flops settled, latest; none where nothing resets them.
    pub reset_settled: Option<Time>,
    /// COUNTER_RESET rises → LOCAL_STOP rises, latest, where a start value can make it.
    pub reset_to_local_stop: Option<Time>,
    /// LOAD_CLK falls → the pulse that loads the flip-flops is over, latest, less LOAD_CLK rises → COUNTER_INIT changes there, earliest;
    /// none where a memory takes the start value.
    pub load_pulse: Option<Time>,
    /// COUNTER_RESET rises → HIT's reset begins.
    pub hit_reset: DelaySpan,
    /// COUNTER_RESET falls → HIT's reset ends.
    pub hit_release: DelaySpan,
    /// COUNTER_RESET rises → HIT has fallen, latest.
    pub hit_falls: Time,
    /// STOP rises → RUN changes → COUNTER_RESET's other cause changes.
    pub clear: DelaySpan,
    /// STOP rises → RUN rises → that cause falls, latest.
    pub clear_falls: Time,
    /// STOP rises → RUN changes → COUNTER_CLK changes, latest.
    pub enabled: Time,
    /// STOP rises → RUN rises → the inverse of ENABLE falls, latest.
    pub enable: Time,
}

impl CounterDelays {
    /// Measures them; `delays` are those of the same paths.
    pub(crate) fn measure(paths: &MacropixelPaths<'_>, delays: &MacropixelDelays) -> Self {
        let (circuit, run) = (paths.circuit, delays.run);
        let net = |probe| circuit.probes.net(probe);
        let fall = paths.after_clk(Edge::Fall);
        let reset = paths.after_counter_reset(Edge::Rise);
        let release = paths.after_counter_reset(Edge::Fall);
        let enable = paths.after_enable();
        let after_run = |net| {
            let (first, last) = changes(&enable, net);
            (run.0 + first, run.1 + last)
        };
        let counter_clk = net(Probe::CounterClk);
        let data = circuit.clocked_by_counter_clk();
        let data = data.map(|cell| fall.window(circuit.pin(cell, 0)));
        let all_data = circuit.counting.iter().map(|&cell| circuit.pin(cell, 0));
        let later_stages = paths.stage_clocks().filter(|&clock| clock != counter_clk);
        let controls = circuit.counting.iter().flat_map(|&cell| {
            let inputs = circuit.netlist.cells()[cell.index()].inputs;
            inputs.into_iter().flatten().skip(2)
        });
        let hits = circuit.probes.latched().iter();
        let reset_settled = latest(all_data.map(|data| reset.window(data)));
        let load_pulse = || {
            let [fall, rise] = [Edge::Fall, Edge::Rise].map(|edge| paths.after_load_clk(edge));
            let over = latest(
                controls
                    .clone()
                    .map(|net| fall.edge_window(net, Edge::Fall)),
            );
            let changes = earliest(controls.clone().map(|net| rise.window(net)));
            Some(over? - changes?)
        };
        let load_pulse = if reset_settled.is_none() {
            load_pulse()
        } else {
            None
        };
        let rises_after_reset = |net| reset.edge_window(net, Edge::Rise);
        CounterDelays {
            counter_clk: edge(&fall, counter_clk, Edge::Rise),
            local_stop: edge(&fall, net(Probe::LocalStop), Edge::Rise),
            strobe: edge(&fall, circuit.hit_pin(1), Edge::Rise),
            sample: edge(&fall, circuit.sampling(), Edge::Rise),
            block: fall.edge_window(net(Probe::Block), Edge::Rise),
            block_to_counter_clk: paths.block_to_counter_clk(),
            settled: latest(data).expect("a P-counter counts"),
            released: latest(
                controls
                    .clone()
                    .map(|net| release.edge_window(net, Edge::Fall)),
            )
            .unwrap_or(Time::ZERO),
            stage_to_stage_clock: paths.stage_to_stage_clock(&fall),
            reset_to_stage_clock: latest(later_stages.map(rises_after_reset)),
            reset_to_counter_clk: latest([rises_after_reset(counter_clk)].into_iter()),
            reset_settled,
            load_pulse,
            reset_to_local_stop: latest([rises_after_reset(net(Probe::LocalStop))].into_iter()),
            hit_reset: edge(&reset, circuit.hit_pin(2), Edge::Rise),
            hit_release: edge(&release, circuit.hit_pin(2), Edge::Fall),
            hit_falls: latest(hits.map(|&hit| reset.edge_window(hit, Edge::Fall)))
                .expect("COUNTER_RESET resets HIT"),
            clear: after_run(circuit.clear),
            enabled: after_run(counter_clk).1,
            enable: delays.run_rise.1 + edge(&enable, circuit.disabled, Edge::Fall).1,
            clear_falls: delays.run_rise.1 + edge(&enable, circuit.clear, Edge::Fall).1,
        }
    }

    /// COUNTER_RESET rises → the last edge at the clock of any stage, latest, that of a count on its way included.
    pub(crate) fn reset_edges(&self) -> Time {
        let of_reset = self.reset_to_stage_clock.max(self.reset_to_counter_clk);
        let edges = of_reset.max(self.stage_to_stage_clock);
        edges.unwrap_or(Time::ZERO)
    }
}
