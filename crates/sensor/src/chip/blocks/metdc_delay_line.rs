//! METDC with delay lines instead of CLK: HSLIDAR's delay-line mode (thesis 2.4.3, 4.9.3, Table 10, 6.3.1, Fig. 88).
//!
//! ```text
//!              ┌─► E ─TAP<1>─► E ─TAP<2>─► … ─► E ─TAP<M>       E: an element, on average T_DL long
//!   PHOTONS ───┤ TAP<0>          even line; the odd one alike
//!              │    │        │                      │
//!              │ [SAMPLE<0>] [SAMPLE<1>]   …   [SAMPLE<M>]      clocked by SAMPLE_CLK: LOCAL_STOP, through mux and buffer
//!              │    └── XOR ──┘└── XOR … ──┘
//!              │        ODD: mux ── of the two lines            ODD: memory of COUNTER_INIT<0>, as the P-counter has it
//!              │        [HIT<M-1>]  …   [HIT<0>]                clocked by STROBE: SAMPLE_CLK, delayed
//! ```
//!
//! The line holds the last M × T_DL of PHOTONS, the newest at TAP\<0\>. LOCAL_STOP freezes it; where neighbouring taps differ, an odd
//! number of photons came in between, and their bin counts. Bin 0 is the earliest. Elements differ from each other by mismatch, and
//! windows of odd start values use a line of their own: the thesis has two calibration profiles for *subtleties in the chip
//! design* that it does not name (6.3.1), and this is the way in which they are here.
//!
//! Timing: bin b takes photons that come from SAMPLE_CLK − TAP\<M−b\> to SAMPLE_CLK − TAP\<M−b−1\>, less what it takes them to come to
//! PHOTONS. Elements pass pulses however short: each is a chain that is much faster than it is long. STROBE comes after SAMPLE,
//! XOR and mux have settled.

use std::sync::Arc;

use super::{finished, metdc};
use crate::netlist::{CellKind, DelayModel, Mismatch, Module, ModuleBuilder, Net, OwnDelay};
use crate::units::Time;

/// Buffers from SAMPLE_CLK to STROBE: clk-to-Q, XOR, mux and setup take 0.2 ns in the typical corner, four buffers 0.18 ns.
const STROBE_BUFFERS: usize = 6;

/// What the elements of a sensor's delay lines are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elements {
    /// Delay of an element on average, in the typical corner.
    pub mean: Time,
    /// Standard deviation of an element's delay, relative to the mean.
    pub sigma: f64,
    /// Which chip.
    pub seed: u64,
}

impl Elements {
    fn delay(&self) -> OwnDelay {
        OwnDelay {
            typical: self.mean,
            spread: Some(Mismatch {
                sigma: self.sigma,
                seed: self.seed,
            }),
            model: DelayModel::Transport,
            mismatches: true,
        }
    }
}

/// Names of the two lines, those of even and of odd start values.
pub const LINES: [&str; 2] = ["EVEN", "ODD"];

/// A METDC of `bins` bins.
///
/// Ports: PHOTONS, LOCAL_STOP, STOP, STOP_D, COUNTER_RESET, CONVENTIONAL, PIXEL_CLEAR, COUNTER_INIT (bit 0), MEMORY_LOAD,
/// MEMORY_RESET → HIT\<bins\> (bin 0 = earliest).
pub fn circuit(bins: usize, elements: &Elements) -> Arc<Module> {
    let mut m = ModuleBuilder::new("metdc");
    let photons = m.input("PHOTONS");
    let strobe_inputs = metdc::StrobeInputs::declare(&mut m);
    let clear = m.input("PIXEL_CLEAR");
    let init = m.input("COUNTER_INIT");
    let load = m.input("MEMORY_LOAD");
    let memory_reset = m.input("MEMORY_RESET");
    let hit = m.output_bus("HIT", bins);
    let sample_clk = m.wire("SAMPLE_CLK");
    let strobe = m.wire("STROBE");
    let odd = m.wire("ODD_WINDOW");

    let hit_reset = strobe_inputs.place(&mut m, sample_clk);
    let mut delayed = sample_clk;
    for _ in 1..STROBE_BUFFERS {
        delayed = m.gate(CellKind::Buf, &[delayed]);
    }
    m.gate_into(CellKind::Buf, &[delayed], strobe);
    m.cell(
        "odd",
        CellKind::Dffr,
        &[init, load, memory_reset],
        &[Some(odd), None],
    );

    let changes = LINES.map(|line| {
        let taps = m.wire_bus(&format!("{line}_TAP"), bins);
        let samples = m.wire_bus(&format!("{line}_SAMPLE"), bins + 1);
        let prefix = line.to_lowercase();
        for (element, &tap) in taps.iter().enumerate() {
            let input = element
                .checked_sub(1)
                .map_or(photons, |before| taps[before]);
            let name = format!("{prefix}_element_{}", element + 1);
            m.cell_with_delay(&name, CellKind::Buf, &[input], &[tap], elements.delay());
        }
        for (number, &sample) in samples.iter().enumerate() {
            let tap = number.checked_sub(1).map_or(photons, |tap| taps[tap]);
            m.cell(
                &format!("{prefix}_sample_{number}"),
                CellKind::Dffr,
                &[tap, sample_clk, clear],
                &[Some(sample), None],
            );
        }
        let pairs = samples.windows(2);
        let changes = pairs.map(|pair| m.gate(CellKind::Xor2, pair));
        changes.collect::<Vec<Net>>()
    });
    for (bin, &hit) in hit.iter().enumerate() {
        let newest_first = bins - 1 - bin;
        let [even, of_odd] = [0, 1].map(|line: usize| changes[line][newest_first]);
        let data = m.gate(CellKind::Mux2, &[even, of_odd, odd]);
        m.cell(
            &format!("hit_{bin}"),
            CellKind::Dffr,
            &[data, strobe, hit_reset],
            &[Some(hit), None],
        );
    }
    finished(m.finish())
}

/// Whether the cell at this dotted path samples a delay line: its D follows SPADs, and breaks setup and hold by design.
pub(crate) fn is_asynchronous_sampler(cell_path: &str) -> bool {
    let mut parts = cell_path.rsplit('.');
    let is_sample = |name: &str| {
        LINES
            .iter()
            .any(|line| name.starts_with(&format!("{}_sample_", line.to_lowercase())))
    };
    parts.next().is_some_and(is_sample) && parts.next() == Some("metdc")
}
