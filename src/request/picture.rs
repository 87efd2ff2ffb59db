//! `depth.png`: depths, and why there are none.

use std::path::Path;

use serde::Deserialize;

use crate::chip::Mode;
use crate::files::InputError;
use crate::report::{Cell, DepthMap};
use crate::system::{NoDepth, PixelDepth};

/// What frame.json says that is also in the other files.
#[derive(Deserialize)]
pub(super) struct Drawn {
    sensor: Chip,
    laser_cycles: u32,
    pub(super) histograms_shape: [usize; 3],
    macropixels: Vec<PixelDepth>,
}

#[derive(Deserialize)]
struct Chip {
    mode: Mode,
}

/// Writes `depth.png` into `out`.
///
/// # Errors
/// When it cannot be written.
pub(super) fn depth_map(out: &Path, drawn: &Drawn) -> Result<(), InputError> {
    let mode = match drawn.sensor.mode {
        Mode::Guided => "guided",
        Mode::Conventional => "conventional",
    };
    let [rows, cols, _] = drawn.histograms_shape;
    let cells: Vec<Cell> = (drawn.macropixels.iter())
        .map(|pixel| match (pixel.measured_m, pixel.no_depth) {
            (_, Some(reason)) => Cell::Category(reason as usize),
            (depth_m, None) => Cell::Depth(depth_m.unwrap_or_default() as f32),
        })
        .collect();
    let map = DepthMap {
        title: &format!("{mode} dToF depth, {} laser cycles", drawn.laser_cycles),
        cols,
        cells: &cells,
        range_m: depth_range(&cells),
        unit: "m",
        categories: &NoDepth::ALL.map(NoDepth::name),
        scale: (512 / rows.max(cols)).max(1),
    };
    map.write_png(&out.join("depth.png"))
}

/// Shortest and longest depth, a little apart even if all are the same.
fn depth_range(cells: &[Cell]) -> (f32, f32) {
    let known = || {
        cells.iter().filter_map(|cell| match *cell {
            Cell::Depth(depth_m) => Some(depth_m),
            Cell::Category(_) => None,
        })
    };
    let shortest = known().fold(f32::INFINITY, f32::min);
    let longest = known().fold(f32::NEG_INFINITY, f32::max);
    if shortest.is_finite() && longest.is_finite() {
        (shortest.floor(), longest.ceil().max(shortest.floor() + 1.0))
    } else {
        (0.0, 1.0)
    }
}
