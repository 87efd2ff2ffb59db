//! Delays of the paths that decide what a macropixel counts, added up from the cell library.
//!
//! Reference models and the window law reckon with these few numbers instead of simulating cells; tests hold them
//! against the netlist.

use super::config::SensorConfig;
use super::front_end::PulseLimits;
use super::p_counter::CounterTiming;
use super::{Probe, Probes, correlation, p_counter_timing};
use crate::logic::Logic::{One, Zero};
use crate::netlist::{CellKind, CheckKind, Corner, Edge, Library, Netlist, StaticTiming, Timing};
use crate::units::Time;

/// Delays of the paths that decide where a window lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChipTiming {
    /// SPAD_RAW rising to the toggle flip-flop's output: the front-end latency.
    pub spad_to_toggle: Time,
    /// What the toggle flip-flops ask of SPAD_RAW.
    pub pulses: PulseLimits,
    /// CLK falling to COUNTER_CLK rising.
    pub clk_to_counter_clk: Time,
    /// The P-counter's own delays and limits.
    pub counter: CounterTiming,
    /// LOCAL_STOP rising to the clock of the HIT flip-flops.
    pub local_stop_to_strobe: Time,
    /// STOP rising to the clock of the HIT flip-flops, conventional mode.
    pub stop_to_strobe: Time,
    /// Clock of the HIT flip-flops to HIT.
    pub strobe_to_hit: Time,
    /// CLK rising to a change of the METDC's shift register.
    pub clk_to_shift: Time,
    /// STOP rising to COUNTER_RESET rising.
    pub stop_to_reset: Time,
    /// STOP rising to COUNTER_RESET falling.
    pub stop_to_reset_release: Time,
    /// STOP rising to the reset of the HIT flip-flops, guided mode.
    pub stop_to_hit_reset: Time,
    /// STOP rising to the release of the HIT flip-flops, guided mode.
    pub stop_to_hit_release: Time,
    /// STOP rising to ENABLE letting COUNTER_CLK through: RUN's clk-to-Q and the inverter behind it.
    pub stop_to_enabled: Time,
    /// CLK rising to SPAD_EVENT settled, longest path.
    pub clk_to_event: Time,
    /// How long before its clock a flip-flop's data must be stable.
    pub setup: Time,
    /// How long after its clock a flip-flop's data must be stable.
    pub hold: Time,
    /// How long before a strobe that counts the reset of HIT must be released.
    pub recovery: Time,
    /// How long after a strobe that must not count the reset of HIT must still hold.
    pub removal: Time,
}

impl ChipTiming {
    /// The timing of a sensor built from the default cell library, in its corner.
    pub fn of(config: &SensorConfig) -> Self {
        let library = Library::default();
        let corner = config.corner;
        let delay = |kind, pin, to| library.delay(kind, pin, to, corner);
        let limits = library.checks(CellKind::Dffr);
        let limit = |check| Time::from_fs(limits.at(check, corner) as i64);
        let clock_to_q = delay(CellKind::Dffr, 1, One);
        let mux_rise = delay(CellKind::Mux2, 0, One);
        let buffer_rise = delay(CellKind::Buf, 0, One);
        let or_rise = delay(CellKind::Or2, 0, One);
        let chain = buffer_rise * p_counter_timing::DELAY_CHAIN as i64;
        let stop_to_reset = delay(CellKind::And2, 0, One) + or_rise;
        let inverter_fall = delay(CellKind::Inv, 0, Zero);
        let stop_to_reset_release =
            chain + inverter_fall + delay(CellKind::And2, 0, Zero) + delay(CellKind::Or2, 0, Zero);
        let correlation = longest_correlation(&library, corner);
        let xor = delay(CellKind::Xor2, 0, One).max(delay(CellKind::Xor2, 0, Zero));
        ChipTiming {
            spad_to_toggle: clock_to_q,
            pulses: PulseLimits::of(corner),
            clk_to_counter_clk: delay(CellKind::Nor2, 0, One),
            counter: CounterTiming::of(config, &library),
            local_stop_to_strobe: mux_rise + buffer_rise,
            stop_to_strobe: chain + mux_rise + buffer_rise,
            strobe_to_hit: clock_to_q,
            clk_to_shift: clock_to_q,
            stop_to_reset,
            stop_to_reset_release,
            stop_to_hit_reset: stop_to_reset + mux_rise,
            stop_to_hit_release: stop_to_reset_release + delay(CellKind::Mux2, 0, Zero),
            stop_to_enabled: clock_to_q + inverter_fall,
            clk_to_event: clock_to_q + xor + correlation,
            setup: limit(CheckKind::Setup),
            hold: limit(CheckKind::Hold),
            recovery: limit(CheckKind::Recovery),
            removal: limit(CheckKind::Removal),
        }
    }

    /// CLK falling to LOCAL_STOP rising: what the thesis calls the ripple delay (4.6, Fig. 56).
    pub fn ripple(&self) -> Time {
        self.clk_to_counter_clk + self.counter.clk_to_local_stop
    }
}

/// The longest path from SPAD_TIMED to SPAD_EVENT.
fn longest_correlation(library: &Library, corner: Corner) -> Time {
    let netlist = Netlist::elaborate(&correlation::circuit());
    let timing = Timing::nominal(&netlist, library, corner);
    let probes = Probes::of_block(&netlist);
    let timed = probes.bus(Probe::SpadTimed).iter();
    let starts: Vec<_> = timed
        .flat_map(|&net| Edge::BOTH.map(|edge| (net, edge)))
        .collect();
    let arrivals = StaticTiming::new(&netlist, &timing)
        .arrivals(&starts, &[])
        .expect("the block is combinational");
    let (_, longest) = arrivals
        .window(probes.net(Probe::SpadEvent))
        .expect("SPAD_EVENT depends on SPAD_TIMED");
    longest
}
