//! Claim 10: Thompson against the Cramér-Rao bound.

use super::claim::Row;
use super::published::Published::*;
use crate::report::{Axis, Chart, Style};
use crate::theory::precision::{cramer_rao, thompson, thompson_best_ratio};

/// Bin interval and pulse σ (ns), and background counts per bin, of Fig. 33.
const BIN_NS: f64 = 1.0;
const SIGMA_NS: f64 = 1.5;
const BACKGROUND: f64 = 100.0;

/// Signal counts that are nothing beside the background: Thompson over bound no longer changes with them.
const FAINT: f64 = 1e-2;

/// Signal counts of Fig. 33, 100 to 100 000.
fn signals() -> impl Iterator<Item = f64> {
    (0..=60).map(|i| 10f64.powf(2.0 + f64::from(i) / 20.0))
}

fn bound_ns(signal: f64) -> f64 {
    cramer_rao(BIN_NS, SIGMA_NS, BACKGROUND, signal)
}

fn thompson_ns(signal: f64) -> f64 {
    thompson(BIN_NS, SIGMA_NS, BACKGROUND, signal)
}

/// The bound at some signal counts of Fig. 33, ns: by Fisher information of a Gaussian in bins on a flat background,
/// 1/FI averaged over the echo's place in its bin, at high precision (`vectors/theory/precision.py`).
const KNOWN_BOUNDS_NS: [(f64, f64); 3] = [(100.0, 0.536543), (1e3, 0.075241), (1e5, 0.004929)];

/// Claim 10.
pub(super) fn rows() -> Vec<Row> {
    let mut rows: Vec<Row> = KNOWN_BOUNDS_NS
        .into_iter()
        .map(|(signal, reference_ns)| {
            let bound_ns = bound_ns(signal);
            let off = 100.0 * (bound_ns / reference_ns - 1.0).abs();
            Row::ours(format!("bound at {signal} signal counts"), "ns", bound_ns)
                .remark(format!("Fig. 33 prints no numbers. {off:.4} % from our own reference of many digits, {reference_ns}."))
        })
        .collect();
    let deviation = signals()
        .map(|s| (thompson_ns(s) / bound_ns(s) - 1.0).abs())
        .fold(0.0, f64::max);
    rows.push(
        Row::holds(
            "largest deviation of Thompson from the bound",
            "%",
            Within("20", 2.0),
            100.0 * deviation,
        )
        .differs("An error “as high as 20%” is said of Thompson against a Monte Carlo (Koerner's) “with low SNR” that is not named; this is against the bound, over the light of Fig. 33 (100 to 100 000 signal counts)."),
    );
    let faintest = 100.0 * (thompson_ns(FAINT) / bound_ns(FAINT) - 1.0).abs();
    rows.push(
        Row::ours(
            "the same for an echo that is lost in the background",
            "%",
            faintest,
        )
        .remark("The limit of a signal far below Fig. 33's."),
    );
    rows.push(Row::ours(
        "Thompson at 100 signal counts",
        "ns",
        thompson_ns(100.0),
    ));
    rows.push(
        Row::ours("best bin over σ by Eq. 20 at µ_B/µ_S = 0.08", "", thompson_best_ratio(0.08, 1.0))
            .remark("Eq. 21's rule of thumb is 1.5; by Thompson's formula it belongs to one signal-to-background ratio."),
    );
    rows
}

/// Fig. 33.
pub(super) fn figure_33() -> Vec<Chart> {
    vec![
        Chart::new(
            "Precision: Thompson and the Cramér-Rao bound (a = 1 ns, σ = 1.5 ns, 100 background counts per bin)",
            Axis::log("signal counts"),
            Axis::log("δ (ns)"),
        )
        .with("Cramér-Rao", Style::Line, signals().map(|s| (s, bound_ns(s))))
        .with("Thompson", Style::Dashed, signals().map(|s| (s, thompson_ns(s))))
        .with("our references of many digits", Style::Points, KNOWN_BOUNDS_NS),
    ]
}
