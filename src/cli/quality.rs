//! How good depths are: rows of the tables of `gdtof frame` and `gdtof range`.

use crate::ranging::DepthOptions;
use crate::report::Table;
use crate::system::FrameSummary;

/// How good the depths are, and why macropixels have none.
pub(super) fn rows(table: &mut Table, options: &DepthOptions, summary: &FrameSummary) {
    let metres = |value: Option<f64>| match value {
        Some(m) => format!("{m:.3} m"),
        None => "-".to_owned(),
    };
    let millimetres = |value: Option<f64>| match value {
        Some(m) => format!("{:.1} mm", 1e3 * m),
        None => "-".to_owned(),
    };
    let part_of_whole = |part: usize, whole: usize| format!("{part} of {whole}");
    let with_surface = summary.depths - summary.depths_without_surface;
    let is_corrected = options.correct_walk;
    table.push(
        format!(
            "depths of surfaces, false alarms {:e}",
            options.false_alarm_rate
        ),
        part_of_whole(with_surface, summary.with_target),
    );
    table.push("depths of nothing", summary.depths_without_surface);
    table.push(
        format!("outliers, beyond a bin of {:.2} m", summary.bin_m),
        part_of_whole(summary.outliers, with_surface),
    );
    table.push("RMS error of these depths", metres(summary.rms_error_m));
    table.push(
        "  without outliers",
        metres(summary.rms_error_without_outliers_m),
    );
    if is_corrected {
        table.push("  bound of their counts", metres(summary.rms_bound_m));
    }
    table.push(
        "  without the detection threshold",
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
    for (reason, count) in &summary.walk_left {
        table.push(format!("  not taken out: {}", reason.name()), count);
    }
    table.push(
        "RMS error of the guide in window",
        metres(summary.guide_rms_error_m),
    );
    for (reason, count) in &summary.no_depth {
        table.push(format!("no depth: {}", reason.name()), count);
    }
}
