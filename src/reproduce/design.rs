//! Claims 1, 12, 13, 16 and 28: design tables, memory and silicon, and the published sensors.

use super::claim::Row;
use super::published::Published::*;
use crate::report::Grid;
use crate::theory::capacity::{SRAM_CELLS, Storage, bits_for, full_bins};
use crate::theory::design::Design;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// The speed of light as the thesis rounds it, m/s.
pub(super) const ROUNDED_LIGHT_M_PER_S: f64 = 3e8;

/// Table 9: clock in MHz, then z_max, z_bin and σ_source in m, as printed.
const TABLE_9: [(f64, &str, &str, &str); 7] = [
    (100.0, "768", "1.50", "4"),
    (150.0, "512", "1.00", "2.7"),
    (200.0, "384", "0.75", "2.0"),
    (250.0, "307", "0.60", "1.6"),
    (300.0, "256", "0.50", "1.3"),
    (350.0, "219", "0.43", "1.1"),
    (400.0, "192", "0.38", "1.0"),
];

/// The guided QuantIC4x4 at a clock.
fn quantic(clk_mhz: f64, light_m_per_s: f64) -> Design {
    Design {
        counter_bits: 9,
        bins: 16,
        clk_hz: clk_mhz * 1e6,
        light_m_per_s,
    }
}

/// Claim 1: Table 9 and the example at 384 MHz.
pub(super) fn table_9_rows() -> Vec<Row> {
    let mut rows = Vec::new();
    for (mhz, z_max, z_bin, sigma) in TABLE_9 {
        let design = quantic(mhz, ROUNDED_LIGHT_M_PER_S);
        let row = |what: &str, published, computed| {
            Row::holds(
                format!("{what} at {mhz} MHz"),
                "m",
                Exactly(published),
                computed,
            )
        };
        rows.push(row("z_max", z_max, design.max_range_m()));
        rows.push(row("z_bin", z_bin, design.bin_m()));
        rows.push(row("σ_source", sigma, design.tolerated_sigma_m()));
    }
    let example = quantic(384.0, ROUNDED_LIGHT_M_PER_S);
    rows.push(Row::holds(
        "z_max at 384 MHz",
        "m",
        Exactly("200"),
        example.max_range_m(),
    ));
    rows.push(Row::holds(
        "z_bin at 384 MHz",
        "m",
        Exactly("0.4"),
        example.bin_m(),
    ));
    let sigma = example.tolerated_sigma_m();
    rows.push(Row::holds("σ_source at 384 MHz", "m", Exactly("1"), sigma));
    let exact = quantic(384.0, SPEED_OF_LIGHT_M_PER_S);
    rows.push(
        Row::ours("z_max at 384 MHz, exact c", "m", exact.max_range_m())
            .remark("c rounded to 3·10⁸ flatters every range by 0.07 %."),
    );
    rows.push(
        Row::ours(
            "σ_source at 384 MHz, exact c, centres on the bin grid",
            "m",
            exact.tolerated_sigma_on_grid_m(),
        )
        .remark("Eq. 25 centres the window on the estimate; the P-counter can only do so to half a bin."),
    );
    rows
}

/// Table 9 at both speeds of light, with the window's steps counted.
pub(super) fn table_9() -> Grid {
    let mut grid = Grid::new([
        "f_CLK (MHz)",
        "z_max (m), c = 3e8",
        "z_max (m)",
        "z_bin (m), c = 3e8",
        "z_bin (m)",
        "σ_source (m), c = 3e8",
        "σ_source (m)",
        "σ_source (m), bin grid",
    ]);
    for mhz in TABLE_9.map(|row| row.0).into_iter().chain([384.0]) {
        let [rounded, exact] =
            [ROUNDED_LIGHT_M_PER_S, SPEED_OF_LIGHT_M_PER_S].map(|c| quantic(mhz, c));
        grid.push([
            format!("{mhz}"),
            format!("{:.2}", rounded.max_range_m()),
            format!("{:.2}", exact.max_range_m()),
            format!("{:.4}", rounded.bin_m()),
            format!("{:.4}", exact.bin_m()),
            format!("{:.3}", rounded.tolerated_sigma_m()),
            format!("{:.3}", exact.tolerated_sigma_m()),
            format!("{:.3}", exact.tolerated_sigma_on_grid_m()),
        ]);
    }
    grid
}

/// Background rate (counts/s) and laser cycles that size the histogram of Table 6's system (3.3.2, 3.3.3).
pub(super) const TABLE_6_BACKGROUND_HZ: f64 = 20e6;
/// See [`TABLE_6_BACKGROUND_HZ`].
pub(super) const TABLE_6_CYCLES: f64 = 25_000.0;
/// Bin interval of Table 6's system: what the thesis calls 5 ns and 0.8 m.
pub(super) const TABLE_6_BIN_S: f64 = 5e-9;
/// See [`TABLE_6_BIN_S`].
pub(super) const TABLE_6_BIN_M: f64 = 0.8;
/// A quarter of a 30 µm pixel, µm² (3.3.5).
pub(super) const QUARTER_PIXEL_UM2: f64 = 225.0;

/// The full histogram of Table 6's system: 256 bins, of as many bits as its background asks for.
pub(super) fn full_histogram() -> Storage {
    Storage {
        bins: full_bins(200.0, TABLE_6_BIN_M).next_power_of_two(),
        bin_bits: bits_for(TABLE_6_BACKGROUND_HZ * TABLE_6_BIN_S * TABLE_6_CYCLES),
    }
}

/// Claim 12: bins and bits of a full histogram.
pub(super) fn size_rows() -> Vec<Row> {
    let storage = full_histogram();
    let background = TABLE_6_BACKGROUND_HZ * TABLE_6_BIN_S * TABLE_6_CYCLES;
    let bins_of_5_ns = full_bins(200.0, TABLE_6_BIN_S * SPEED_OF_LIGHT_M_PER_S / 2.0);
    vec![
        Row::holds(
            "bins for 200 m",
            "",
            Exactly("256"),
            f64::from(storage.bins),
        )
        .remark("0.8 m bins: 250, and 256 as the next power of two."),
        Row::ours("bins of 5 ns for 200 m", "", f64::from(bins_of_5_ns))
            .remark("5 ns are 0.749 m, which the thesis rounds to 0.8 m."),
        Row::ours(
            "background counts a bin after 25 000 cycles",
            "",
            background,
        ),
        Row::holds(
            "bits of a bin",
            "",
            Exactly("12"),
            f64::from(storage.bin_bits),
        )
        .remark("Enough for the mean background alone, as in the thesis."),
        Row::holds(
            "bits of a pixel",
            "kbit",
            AtLeast("3"),
            storage.bits() as f64 / 1e3,
        ),
    ]
}

/// Claim 13: process generations that the histograms fit.
pub(super) fn silicon_rows() -> Vec<Row> {
    let full = full_histogram();
    let reduced = Storage { bins: 16, ..full };
    let node = |storage: Storage, area| {
        let cell = storage.oldest_node(area);
        cell.map_or(f64::NAN, |cell| f64::from(cell.node_nm))
    };
    let pixel = 4.0 * QUARTER_PIXEL_UM2;
    vec![
        Row::holds(
            "oldest node, 256 bins in the whole pixel",
            "nm",
            Exactly("40"),
            node(full, pixel),
        ),
        Row::holds(
            "oldest node, 256 bins in a quarter of the pixel",
            "nm",
            Exactly("16"),
            node(full, QUARTER_PIXEL_UM2),
        ),
        Row::holds(
            "oldest node, 16 bins in a quarter of the pixel",
            "nm",
            Exactly("90"),
            node(reduced, QUARTER_PIXEL_UM2),
        )
        .remark("Static RAM cells alone, of the sources that table 39 names; the thesis's Fig. 39 prints no numbers."),
    ]
}

/// Fig. 39's data: the cells by generation, and what fits a quarter of the pixel.
pub(super) fn table_39() -> Grid {
    let mut grid = Grid::new([
        "source",
        "node (nm)",
        "cell (µm²)",
        "256 × 12 bit (µm²)",
        "16 × 12 bit (µm²)",
        "12-bit bins in 225 µm²",
    ]);
    let full = full_histogram();
    for cell in &SRAM_CELLS {
        let fit = crate::theory::capacity::bins_within(QUARTER_PIXEL_UM2, full.bin_bits, cell);
        grid.push([
            cell.source.to_owned(),
            cell.node_nm.to_string(),
            cell.area_um2.to_string(),
            format!("{:.1}", full.area_um2(cell)),
            format!("{:.1}", Storage { bins: 16, ..full }.area_um2(cell)),
            fit.to_string(),
        ]);
    }
    grid
}

/// The demonstrator's bin interval, 2.6 ns, in metres.
pub(super) const HSLIDAR_BIN_M: f64 = 2.6e-9 * SPEED_OF_LIGHT_M_PER_S / 2.0;

/// Claim 16: on-chip data of the demonstrator.
pub(super) fn data_rows() -> Vec<Row> {
    let bins = full_bins(75.0, HSLIDAR_BIN_M);
    let ratio = f64::from(bins) / 8.0;
    let to_window_end = full_bins(75.0 + 8.0 * HSLIDAR_BIN_M, HSLIDAR_BIN_M);
    let per_sensor = 512.0 / 16.0;
    vec![
        Row::holds("bins of a full histogram to 75 m", "", Says("almost 200", 190.0, 200.0), f64::from(bins)),
        Row::holds("on-chip data, full over guided", "", AtLeast("25"), ratio)
            .differs("193 bins over 8 are 24.1; “over 25 times” takes the 193 for 200, or counts a histogram that ends beyond 75 m."),
        Row::ours(
            "the same, full histogram one window beyond 75 m",
            "",
            f64::from(to_window_end) / 8.0,
        ),
        Row::ours("the same, QuantIC4x4: 2⁹ bins over 16", "", per_sensor),
    ]
}
