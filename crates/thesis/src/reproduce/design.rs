//! Claims 1, 12, 13, 16 and 28: design tables, memory and silicon, and the published sensors.

use super::claim::ClaimRow;
use super::parameters::{
    HSLIDAR_BIN_M, ROUNDED_LIGHT_M_PER_S, TABLE_6_BACKGROUND_HZ, TABLE_6_BIN_M, TABLE_6_BIN_S,
    TABLE_6_CYCLES,
};
use super::thesis::{claim, grid};
use crate::report::Grid;
use crate::theory::capacity::{SRAM_CELLS, Storage, bits_for, full_bins};
use crate::theory::design::Design;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Clocks of Table 9 and of its example, MHz.
const TABLE_9_MHZ: [f64; 8] = [100.0, 150.0, 200.0, 250.0, 300.0, 350.0, 400.0, 384.0];

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
pub(super) fn table_9_rows() -> Vec<ClaimRow> {
    let claim = claim(1);
    let of_clock = |mhz| {
        let design = quantic(mhz, ROUNDED_LIGHT_M_PER_S);
        [
            claim.row(&format!("z_max_{mhz}"), design.max_range_m()),
            claim.row(&format!("z_bin_{mhz}"), design.bin_m()),
            claim.row(&format!("sigma_{mhz}"), design.tolerated_sigma_m()),
        ]
    };
    let exact = quantic(384.0, SPEED_OF_LIGHT_M_PER_S);
    let mut rows = TABLE_9_MHZ.map(of_clock).concat();
    rows.push(claim.row("z_max_exact", exact.max_range_m()));
    rows.push(claim.row("sigma_on_grid", exact.tolerated_sigma_on_grid_m()));
    rows
}

/// Table 9 at both speeds of light, with the window's steps counted.
pub(super) fn table_9() -> Grid {
    let mut grid = grid(9);
    for mhz in TABLE_9_MHZ {
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
pub(super) fn size_rows() -> Vec<ClaimRow> {
    let claim = claim(12);
    let storage = full_histogram();
    let background = TABLE_6_BACKGROUND_HZ * TABLE_6_BIN_S * TABLE_6_CYCLES;
    let bins_of_5_ns = full_bins(200.0, TABLE_6_BIN_S * SPEED_OF_LIGHT_M_PER_S / 2.0);
    vec![
        claim.row("bins", f64::from(storage.bins)),
        claim.row("bins_of_5_ns", f64::from(bins_of_5_ns)),
        claim.row("background", background),
        claim.row("bits_of_bin", f64::from(storage.bin_bits)),
        claim.row("bits_of_pixel", storage.bits() as f64 / 1e3),
    ]
}

/// Claim 13: process generations that the histograms fit.
pub(super) fn silicon_rows() -> Vec<ClaimRow> {
    let claim = claim(13);
    let full = full_histogram();
    let reduced = Storage { bins: 16, ..full };
    let node = |storage: Storage, area| {
        let cell = storage.oldest_node(area);
        cell.map_or(f64::NAN, |cell| f64::from(cell.node_nm))
    };
    let pixel = 4.0 * QUARTER_PIXEL_UM2;
    vec![
        claim.row("full_in_pixel", node(full, pixel)),
        claim.row("full_in_quarter", node(full, QUARTER_PIXEL_UM2)),
        claim.row("reduced_in_quarter", node(reduced, QUARTER_PIXEL_UM2)),
    ]
}

/// Fig. 39's data: the cells by generation, and what fits a quarter of the pixel.
pub(super) fn table_39() -> Grid {
    let mut grid = grid(39);
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

/// Claim 16: on-chip data of the demonstrator.
pub(super) fn data_rows() -> Vec<ClaimRow> {
    let claim = claim(16);
    let bins = full_bins(75.0, HSLIDAR_BIN_M);
    let ratio = f64::from(bins) / 8.0;
    let to_window_end = full_bins(75.0 + 8.0 * HSLIDAR_BIN_M, HSLIDAR_BIN_M);
    let per_sensor = 512.0 / 16.0;
    vec![
        claim.row("bins", f64::from(bins)),
        claim.row("ratio", ratio),
        claim.row("ratio_to_window_end", f64::from(to_window_end) / 8.0),
        claim.row("ratio_quantic", per_sensor),
    ]
}
