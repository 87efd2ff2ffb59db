//! Fig. 36 to 41: how large histograms are, and what they cost in silicon.

use super::design::{QUARTER_PIXEL_UM2, TABLE_6_BACKGROUND_HZ, TABLE_6_CYCLES, full_histogram};
use crate::report::{Axis, Chart, Style};
use crate::theory::capacity::{SRAM_CELLS, Storage, bins_within, bits_for, full_bins};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Background rates of the design space, counts/s.
const BACKGROUNDS_HZ: [f64; 4] = [1e6, 5e6, TABLE_6_BACKGROUND_HZ, 100e6];
/// Bin intervals of the design space, ns.
const BINS_NS: [f64; 4] = [1.0, 2.0, 5.0, 10.0];

fn bin_m(bin_ns: f64) -> f64 {
    bin_ns * 1e-9 * SPEED_OF_LIGHT_M_PER_S / 2.0
}

/// Bin intervals along an axis, ns.
fn intervals_ns() -> impl Iterator<Item = f64> + Clone {
    (2..=80).map(|i| f64::from(i) * 0.25)
}

/// Fig. 36: counts that a bin must hold.
pub(super) fn figure_36() -> Vec<Chart> {
    let mut chart = Chart::new(
        "Background counts in a bin after 25 000 laser cycles",
        Axis::linear("bin interval (ns)"),
        Axis::log("counts"),
    );
    for hz in BACKGROUNDS_HZ {
        let counts = intervals_ns().map(move |ns| (ns, hz * ns * 1e-9 * TABLE_6_CYCLES));
        chart = chart.with(format!("{} Mcounts/s", hz / 1e6), Style::Line, counts);
    }
    let capacity = |bits: i32| f64::from(bits).exp2() - 1.0;
    for bits in [8, 12, 14] {
        let level = [(0.5, capacity(bits)), (20.0, capacity(bits))];
        chart = chart.with(format!("{bits} bits hold"), Style::Dashed, level);
    }
    vec![chart]
}

/// Fig. 37: bins of a full histogram.
pub(super) fn figure_37() -> Vec<Chart> {
    let mut chart = Chart::new(
        "Bins of a full histogram",
        Axis::linear("maximum distance (m)"),
        Axis::linear("bins"),
    );
    for ns in BINS_NS {
        let bins = (1..=50).map(move |i| {
            let z_m = f64::from(i) * 6.0;
            (z_m, f64::from(full_bins(z_m, bin_m(ns))))
        });
        chart = chart.with(format!("{ns} ns"), Style::Line, bins);
    }
    vec![chart.with(
        "published: 256 at 200 m, 5 ns",
        Style::Points,
        [(200.0, 256.0)],
    )]
}

/// Fig. 38: bits of a full histogram to 200 m.
pub(super) fn figure_38() -> Vec<Chart> {
    let mut chart = Chart::new(
        "Memory of a full histogram to 200 m, 25 000 laser cycles",
        Axis::linear("bin interval (ns)"),
        Axis::log("bits per pixel"),
    );
    for hz in BACKGROUNDS_HZ {
        let bits = intervals_ns().map(move |ns| {
            let storage = Storage {
                bins: full_bins(200.0, bin_m(ns)),
                bin_bits: bits_for(hz * ns * 1e-9 * TABLE_6_CYCLES),
            };
            (ns, storage.bits() as f64)
        });
        chart = chart.with(format!("{} Mcounts/s", hz / 1e6), Style::Line, bits);
    }
    vec![chart.with(
        "published: over 3 kbit at 5 ns",
        Style::Points,
        [(5.0, 3072.0)],
    )]
}

/// Fig. 39: area of a bit.
pub(super) fn figure_39() -> Vec<Chart> {
    let cells = SRAM_CELLS
        .iter()
        .map(|c| (f64::from(c.node_nm), c.area_um2));
    vec![
        Chart::new(
            "Area of a static RAM cell by process node (sources in table 39)",
            Axis::log("node (nm)"),
            Axis::log("area (µm²)"),
        )
        .with("published cells", Style::Points, cells),
    ]
}

/// Fig. 40: area of the full histogram against that of the pixel.
pub(super) fn figure_40() -> Vec<Chart> {
    let area = |storage: Storage| {
        let nodes = SRAM_CELLS.iter();
        nodes.map(move |cell| (f64::from(cell.node_nm), storage.area_um2(cell)))
    };
    let full = full_histogram();
    let level = |um2: f64| [(5.0, um2), (130.0, um2)];
    vec![
        Chart::new(
            "Area of a histogram of 12-bit bins by process node",
            Axis::log("node (nm)"),
            Axis::log("area (µm²)"),
        )
        .with("256 bins (full)", Style::Line, area(full))
        .with(
            "16 bins (guided, partial)",
            Style::Line,
            area(Storage { bins: 16, ..full }),
        )
        .with(
            "the pixel, 30 µm square",
            Style::Dashed,
            level(4.0 * QUARTER_PIXEL_UM2),
        )
        .with("a quarter of it", Style::Dashed, level(QUARTER_PIXEL_UM2)),
    ]
}

/// Fig. 41: bins and bits that fit a quarter of the pixel.
pub(super) fn figure_41() -> Vec<Chart> {
    let mut chart = Chart::new(
        "Bins that fit a quarter of the pixel (225 µm²)",
        Axis::linear("bits of a bin"),
        Axis::log("bins"),
    );
    for cell in SRAM_CELLS
        .iter()
        .filter(|c| [130, 90, 65, 40, 28, 16, 7].contains(&c.node_nm))
    {
        let bins = (4..=20).map(|bits| {
            (
                f64::from(bits),
                f64::from(bins_within(QUARTER_PIXEL_UM2, bits, cell)),
            )
        });
        chart = chart.with(format!("{} nm", cell.node_nm), Style::Line, bins);
    }
    vec![chart.with(
        "full: 256 × 12; reduced: 16 × 12",
        Style::Points,
        [(12.0, 256.0), (12.0, 16.0)],
    )]
}
