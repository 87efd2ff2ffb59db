//! METDC: the multi-event time-to-digital converter, a window of past CLK periods frozen by a strobe
//! (thesis 4.2, 4.3, Fig. 47, 48).
//!
//! ```text
//!   SPAD_EVENT ─►[SHIFT<0>]─►[SHIFT<1>]─► … ─►[SHIFT<M-1>]     one stage per CLK period
//!                    │           │                 │
//!                [HIT<M-1>]  [HIT<M-2>]  …      [HIT<0>]       clocked by STROBE
//!                    ▼           ▼                 ▼
//!                 bin M-1     bin M-2           bin 0 (earliest)
//!
//!   LOCAL_STOP ─┐                             COUNTER_RESET ─┐
//!               mux ─ buffer ─► STROBE                       mux ─► HIT reset
//!   STOP_D ─────┘ CONVENTIONAL                NOT STOP ──────┘ CONVENTIONAL
//! ```
//!
//! One rising edge of STROBE copies the shift register into HIT; each HIT bit that rises clocks its own
//! histogram counter. HIT returns to zero before the next strobe, or a 1 after a 1 would make no edge.
//! In the guided mode LOCAL_STOP strobes and COUNTER_RESET clears. In the conventional mode the global
//! STOP strobes, delayed by the timing block's chain so that the clear, NOT STOP, has been released.
//!
//! Timing: the strobe comes in CLK's low phase, ripple + mux + buffer after its falling edge, and must
//! precede the change of SHIFT, clk-to-Q after the next rising edge. A longer ripple moves the whole
//! histogram by one bin: this sets the shortest CLK period (4.6).

use std::sync::Arc;

use super::finished;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};

/// A METDC with `bins` stages.
///
/// Ports: CLK, SPAD_EVENT, LOCAL_STOP, STOP, STOP_D, COUNTER_RESET, CONVENTIONAL, PIXEL_CLEAR →
/// HIT\<bins\> (bin 0 = earliest CLK period).
pub fn circuit(bins: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("metdc");
    let clk = m.input("CLK");
    let event = m.input("SPAD_EVENT");
    let strobe_inputs = StrobeInputs::declare(&mut m);
    let clear = m.input("PIXEL_CLEAR");
    let hit = m.output_bus("HIT", bins);
    let shift = m.wire_bus("SHIFT", bins);
    let strobe = m.wire("STROBE");

    let hit_reset = strobe_inputs.place(&mut m, strobe);
    for stage in 0..bins {
        let data = if stage == 0 { event } else { shift[stage - 1] };
        m.cell(
            &format!("shift_{stage}"),
            CellKind::Dffr,
            &[data, clk, clear],
            &[Some(shift[stage]), None],
        );
    }
    for bin in 0..bins {
        m.cell(
            &format!("hit_{bin}"),
            CellKind::Dffr,
            &[shift[bins - 1 - bin], strobe, hit_reset],
            &[Some(hit[bin]), None],
        );
    }
    finished(m.finish())
}

/// What a METDC's strobe and the reset of its HIT flip-flops are made of.
pub(super) struct StrobeInputs {
    local_stop: Net,
    stop: Net,
    stop_d: Net,
    counter_reset: Net,
    conventional: Net,
}

impl StrobeInputs {
    /// The ports LOCAL_STOP, STOP, STOP_D, COUNTER_RESET and CONVENTIONAL.
    pub(super) fn declare(m: &mut ModuleBuilder) -> Self {
        StrobeInputs {
            local_stop: m.input("LOCAL_STOP"),
            stop: m.input("STOP"),
            stop_d: m.input("STOP_D"),
            counter_reset: m.input("COUNTER_RESET"),
            conventional: m.input("CONVENTIONAL"),
        }
    }

    /// Makes `strobe` and the wire HIT_RESET, which it returns.
    pub(super) fn place(&self, m: &mut ModuleBuilder, strobe: Net) -> Net {
        let hit_reset = m.wire("HIT_RESET");
        let causes = [self.local_stop, self.stop_d, self.conventional];
        let selected = m.gate(CellKind::Mux2, &causes);
        m.gate_into(CellKind::Buf, &[selected], strobe);
        let stop_n = m.gate(CellKind::Inv, &[self.stop]);
        let causes = [self.counter_reset, stop_n, self.conventional];
        m.gate_into(CellKind::Mux2, &causes, hit_reset);
        hit_reset
    }
}

/// Reference model: the shift register as bits of a word, the newest event in bit 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MetdcModel {
    shift: u64,
    bins: u32,
}

impl MetdcModel {
    /// An empty METDC with up to 64 stages.
    pub fn new(bins: u32) -> Self {
        debug_assert!((1..=64).contains(&bins));
        MetdcModel { shift: 0, bins }
    }

    /// A rising edge of CLK with this SPAD_EVENT.
    pub fn clock(&mut self, event: bool) {
        self.shift = self.shift << 1 | event as u64;
    }

    /// HIT as a strobe now would latch it: bit b is bin b.
    pub fn hits(&self) -> u64 {
        self.shift.reverse_bits() >> (64 - self.bins)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bin_zero_is_the_earliest_period() {
        let mut model = MetdcModel::new(16);
        model.clock(true);
        for _ in 0..15 {
            model.clock(false);
        }
        assert_eq!(model.hits(), 1);
        model.clock(true);
        assert_eq!(model.hits(), 1 << 15);
    }
}
