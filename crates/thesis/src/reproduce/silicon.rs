//! Fig. 36 to 41: how large histograms are, and what they cost in silicon.

use super::design::{QUARTER_PIXEL_UM2, full_histogram};
use super::parameters::{TABLE_6_BACKGROUND_HZ, TABLE_6_CYCLES};
use super::thesis::chart;
use crate::report::Chart;
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
pub(super) fn figure_36() -> Chart {
    let mut chart = chart(36);
    for hz in BACKGROUNDS_HZ {
        let counts = intervals_ns().map(move |ns| (ns, hz * ns * 1e-9 * TABLE_6_CYCLES));
        chart = chart.line(format!("{} Mcounts/s", hz / 1e6), counts);
    }
    let capacity = |bits: i32| libm::exp2(f64::from(bits)) - 1.0;
    for bits in [8, 12, 14] {
        let level = [(0.5, capacity(bits)), (20.0, capacity(bits))];
        chart = chart.dashed(format!("{bits} bits hold"), level);
    }
    chart
}

/// Fig. 37: bins of a full histogram.
pub(super) fn figure_37() -> Chart {
    let mut chart = chart(37);
    for ns in BINS_NS {
        let bins = (1..=50).map(move |i| {
            let z_m = f64::from(i) * 6.0;
            (z_m, f64::from(full_bins(z_m, bin_m(ns))))
        });
        chart = chart.line(format!("{ns} ns"), bins);
    }
    chart.points("published: 256 at 200 m, 5 ns", [(200.0, 256.0)])
}

/// Fig. 38: bits of a full histogram to 200 m.
pub(super) fn figure_38() -> Chart {
    let mut chart = chart(38);
    for hz in BACKGROUNDS_HZ {
        let bits = intervals_ns().map(move |ns| {
            let storage = Storage {
                bins: full_bins(200.0, bin_m(ns)),
                bin_bits: bits_for(hz * ns * 1e-9 * TABLE_6_CYCLES),
            };
            (ns, storage.bits() as f64)
        });
        chart = chart.line(format!("{} Mcounts/s", hz / 1e6), bits);
    }
    chart.points("published: over 3 kbit at 5 ns", [(5.0, 3072.0)])
}

/// Fig. 39: area of a bit.
pub(super) fn figure_39() -> Chart {
    let cells = SRAM_CELLS
        .iter()
        .map(|c| (f64::from(c.node_nm), c.area_um2));
    chart(39).points("published cells", cells)
}

/// Fig. 40: area of the full histogram against that of the pixel.
pub(super) fn figure_40() -> Chart {
    let area = |storage: Storage| {
        let nodes = SRAM_CELLS.iter();
        nodes.map(move |cell| (f64::from(cell.node_nm), storage.area_um2(cell)))
    };
    let full = full_histogram();
    let level = |um2: f64| [(5.0, um2), (130.0, um2)];
    chart(40)
        .line("256 bins (full)", area(full))
        .line(
            "16 bins (guided, partial)",
            area(Storage { bins: 16, ..full }),
        )
        .dashed("the pixel, 30 µm square", level(4.0 * QUARTER_PIXEL_UM2))
        .dashed("a quarter of it", level(QUARTER_PIXEL_UM2))
}

/// Fig. 41: bins and bits that fit a quarter of the pixel.
pub(super) fn figure_41() -> Chart {
    let mut chart = chart(41);
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
        chart = chart.line(format!("{} nm", cell.node_nm), bins);
    }
    chart.points(
        "full: 256 × 12; reduced: 16 × 12",
        [(12.0, 256.0), (12.0, 16.0)],
    )
}
