//! Ring oscillators of a row of pixels that differ by mismatch: each one's period at gate level against the sum of its cells'
//! delays, and what coupling makes of their frequencies (thesis 2.4.3).
//!
//! ```text
//!   START ─┬─► pixel_0.RING  ─► f₀ ┐
//!          ├─► pixel_1.RING  ─► f₁ ├─ pulled towards their neighbours: above a least pull all share the mean
//!          └─► …                   ┘
//! ```
//!
//! Gates run the rings alone; coupling is the model of `chip/blocks/tdc/coupling`.

use std::path::Path;

use super::converter::{BEGIN, BITS, SIGMA, STAGES, build};
use crate::chip::tdc::coupling::RingRow;
use crate::chip::tdc::ring_oscillator;
use crate::files::InputError;
use crate::kernel::Recorder;
use crate::netlist::ModuleBuilder;
use crate::report::{Axis, Chart, Checks};
use crate::testbenches::rig::finished;
use crate::units::Time;

/// Rings in a row.
const RINGS: usize = 16;

/// A row of rings that differ: each one's period at gate level, and what coupling makes of them.
pub(super) fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    const SHOWN: Time = Time::from_ns(100);
    let mut m = ModuleBuilder::new("rings");
    let pins = [
        ("START", m.input("START")),
        ("STOP", m.input("STOP")),
        ("TDC_RESET", m.input("TDC_RESET")),
    ];
    let pins = pins.map(|(name, net)| (name, [net]));
    let pins: Vec<_> = pins.iter().map(|(name, net)| (*name, &net[..])).collect();
    let ring = ring_oscillator::circuit(STAGES, BITS);
    (0..RINGS).for_each(|pixel| m.instance(&format!("pixel_{pixel}"), &ring, &pins));
    let rig = build(&finished(m), SIGMA, 2);
    let nets: Vec<_> = (0..RINGS)
        .map(|pixel| rig.bus(&format!("pixel_{pixel}.RING"))[0])
        .collect();
    let mut drives = rig.power_up();
    drives.set(BEGIN, rig.net("START"), true);
    let mut recorder = Recorder::new(nets.iter().copied());
    rig.run(drives, SHOWN, &mut recorder);

    let mut free_hz = Vec::new();
    let mut wrong = 0;
    for (pixel, &net) in nets.iter().enumerate() {
        let falls = recorder.falling_edges(net);
        // The first fall is from rest.
        let periods: Vec<Time> = falls.windows(2).map(|ends| ends[1] - ends[0]).collect();
        let model = ring_oscillator::RingOscillatorModel::from_netlist(
            &rig.netlist,
            &rig.timing,
            &format!("pixel_{pixel}"),
        );
        wrong += periods
            .iter()
            .filter(|&&period| period != model.period)
            .count();
        free_hz.push(1.0 / model.period.as_s());
    }
    checks.equal(
        format!("{RINGS} rings: periods that are not the sum of their cells' delays"),
        0,
        wrong,
    );
    let spread = |hz: &[f64]| {
        let mean = hz.iter().sum::<f64>() / hz.len() as f64;
        let square: f64 = hz.iter().map(|hz| (hz / mean - 1.0).powi(2)).sum();
        (square / (hz.len() - 1) as f64).sqrt()
    };
    let row = |pull_hz| RingRow {
        free_hz: free_hz.clone(),
        pull_hz,
    };
    let least = row(0.0).least_pull_hz();
    let coupled = [0.3, 1.1].map(|share| (share, row(share * least).mean_frequencies_hz(4e-6)));
    let locked = row(least).locked_hz();
    let mut text = format!(
        "{RINGS} rings, {:.1} MHz on average: spread {:.2} % alone",
        locked * 1e-6,
        100.0 * spread(&free_hz)
    );
    for (share, hz) in &coupled {
        text += &format!(
            ", {:.4} % pulled by {:.1} MHz ({share} of what locks them)",
            100.0 * spread(hz),
            share * least * 1e-6
        );
    }
    checks.note(text);
    // The mean of one delay for each stage, each with the mismatch of its cell.
    let inverter = SIGMA / (STAGES as f64).sqrt();
    let alone = spread(&free_hz);
    checks.add_verdict(
        "rings alone: spread of their periods, against an inverter's over the square root of the stages",
        format!("{:.1} % within a half", 100.0 * inverter),
        format!("{:.1} %", 100.0 * alone),
        (alone / inverter - 1.0).abs() < 0.5,
    );
    let [(_, loose), (_, tight)] = &coupled;
    checks.add_verdict(
        "rings coupled by 1.1 of the least pull share one frequency, the mean",
        format!("{:.4} MHz", locked * 1e-6),
        format!("{:.4} MHz, spread {:.1e}", tight[0] * 1e-6, spread(tight)),
        (tight[0] / locked - 1.0).abs() < 1e-6 && spread(tight) < 1e-6,
    );
    checks.add_verdict(
        "rings coupled by 0.3 of it do not",
        "a spread between",
        format!("{:.2} %", 100.0 * spread(loose)),
        spread(loose) > 1e-4 && spread(loose) < alone,
    );
    let points = |hz: &[f64]| -> Vec<(f64, f64)> {
        hz.iter()
            .enumerate()
            .map(|(pixel, hz)| (pixel as f64, hz * 1e-6))
            .collect()
    };
    let [(_, loose), (_, tight)] = &coupled;
    Chart::new(
        "Ring oscillators of a row of pixels",
        Axis::linear("pixel"),
        Axis::linear("frequency (MHz)"),
    )
    .points("alone, gates", points(&free_hz))
    .dashed("coupled, 0.3 of the least pull", points(loose))
    .line("coupled, 1.1 of the least pull", points(tight))
    .write(&waves.with_file_name("tb_tdc_rings.svg"))
}
