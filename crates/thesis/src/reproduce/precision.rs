//! Claim 10: Thompson against the Cramér-Rao bound.

use super::claim::ClaimRow;
use super::thesis::{chart, claim};
use crate::report::Chart;
use crate::theory::precision::{cramer_rao, thompson, thompson_best_ratio};

/// Bin interval and pulse σ (ns), and background counts per bin, of Fig. 33.
const BIN_NS: f64 = 1.0;
const SIGMA_NS: f64 = 1.5;
const BACKGROUND: f64 = 100.0;

/// Signal counts that are nothing beside the background: Thompson over bound no longer changes with them.
const FAINT: f64 = 1e-2;

/// Signal counts of Fig. 33, 100 to 100 000.
fn signals() -> impl Iterator<Item = f64> {
    (0..=60).map(|i| libm::pow(10f64, 2.0 + f64::from(i) / 20.0))
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
pub(super) fn rows() -> Vec<ClaimRow> {
    let claim = claim(10);
    let mut rows: Vec<ClaimRow> = KNOWN_BOUNDS_NS
        .into_iter()
        .map(|(signal, reference_ns)| {
            let bound_ns = bound_ns(signal);
            let off = 100.0 * (bound_ns / reference_ns - 1.0).abs();
            claim.row(&format!("bound_{signal}"), bound_ns)
                .remark(format!("Fig. 33 prints no numbers. {off:.4} % from our own reference of many digits, {reference_ns}."))
        })
        .collect();
    let off_percent = |s| 100.0 * (thompson_ns(s) / bound_ns(s) - 1.0).abs();
    rows.extend([
        claim.row(
            "thompson_off",
            signals().map(off_percent).fold(0.0, f64::max),
        ),
        claim.row("thompson_off_faint", off_percent(FAINT)),
        claim.row("thompson", thompson_ns(100.0)),
        claim.row("best_bin", thompson_best_ratio(0.08, 1.0)),
    ]);
    rows
}

/// Fig. 33.
pub(super) fn figure_33() -> Chart {
    chart(33)
        .line("Cramér-Rao", signals().map(|s| (s, bound_ns(s))))
        .dashed("Thompson", signals().map(|s| (s, thompson_ns(s))))
        .points("our references of many digits", KNOWN_BOUNDS_NS)
}
