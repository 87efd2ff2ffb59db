//! How good a frame is: its rows of the table, and the picture that paints depths and reasons.

use std::path::Path;

use super::{Configuration, FrameArgs};
use crate::chip::Mode;
use crate::files::InputError;
use crate::report::{Cell, DepthMap, Table};
use crate::system::{Frame, NoDepth, Summary};

/// How good the depths are, and why there are no others.
pub(super) fn rows(table: &mut Table, args: &FrameArgs, summary: &Summary) {
    let metres = |value: Option<f64>| match value {
        Some(m) => format!("{m:.3} m"),
        None => "-".to_owned(),
    };
    let millimetres = |value: Option<f64>| match value {
        Some(m) => format!("{:.1} mm", 1e3 * m),
        None => "-".to_owned(),
    };
    let of = |part: usize, whole: usize| format!("{part} of {whole}");
    let with_surface = summary.depths - summary.depths_without_surface;
    let is_corrected = !args.no_walk_correction;
    table.push(
        format!(
            "depths of surfaces, false alarms {:e}",
            args.false_alarm_rate
        ),
        of(with_surface, summary.with_target),
    );
    table.push("depths of nothing", summary.depths_without_surface);
    table.push(
        format!("outliers, beyond a bin of {:.2} m", summary.bin_m),
        of(summary.outliers, with_surface),
    );
    table.push("RMS error of these depths", metres(summary.rms_error_m));
    table.push(
        "  without outliers",
        metres(summary.rms_error_without_outliers_m),
    );
    table.push(
        "  if every peak were a depth",
        metres(summary.rms_error_of_every_peak_m),
    );
    table.push(
        "median absolute error of these depths",
        metres(summary.median_absolute_error_m),
    );
    table.push(
        "  of all surfaces, missing ones infinite",
        metres(summary.median_absolute_error_of_all_m),
    );
    table.push(
        "mean error with range walk",
        millimetres(summary.mean_error_with_walk_m),
    );
    if is_corrected {
        table.push("  corrected for it", millimetres(summary.mean_error_m));
    }
    table.push(
        "RMS error of the guide in window",
        metres(summary.guide_rms_error_m),
    );
    for (reason, count) in &summary.no_depth {
        table.push(format!("no depth: {}", reason.name()), count);
    }
}

/// Writes `depth.png` into `out`.
///
/// # Errors
/// When it cannot be written.
pub(super) fn depth_map(
    out: &Path,
    frame: &Frame,
    asked: &Configuration<'_>,
) -> Result<(), InputError> {
    let mode = match asked.sensor.mode {
        Mode::Guided => "guided",
        Mode::Conventional => "conventional",
    };
    let cells: Vec<Cell> = (frame.pixels.iter())
        .map(|pixel| match (pixel.measured_m, pixel.no_depth) {
            (_, Some(reason)) => Cell::Category(reason as usize),
            (depth_m, None) => Cell::Depth(depth_m.unwrap_or_default() as f32),
        })
        .collect();
    let map = DepthMap {
        title: &format!("{mode} dToF depth, {} laser cycles", asked.laser_cycles),
        cols: frame.cols,
        cells: &cells,
        range_m: depth_range(&cells),
        unit: "m",
        categories: &NoDepth::ALL.map(NoDepth::name),
        scale: (512 / frame.rows.max(frame.cols)).max(1),
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
