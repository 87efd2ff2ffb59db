//! What `gdtof frame` prints: a dozen rows, or all.

use super::{FrameArgs, scene_name, wave_name};
use crate::analysis::VerdictReport;
use crate::chip::Mode;
use crate::cli::quality;
use crate::files::MANIFEST;
use crate::report::Table;
use crate::request::{eye_safety_of, frame_s, variance_left_out_of};
use crate::scene::EyeSafety;
use crate::system::{Frame, FrameSettings, FrameSummary, NoDepth};
use crate::units::Time;

/// What matters first.
pub(super) fn brief(
    args: &FrameArgs,
    settings: &FrameSettings,
    timing: &VerdictReport,
    frame: &Frame,
) -> Table {
    let summary = frame.summary();
    let part_of_whole = |part: usize, whole: usize| format!("{part} of {whole}");
    let with_surface = summary.depths - summary.depths_without_surface;
    let mut table = Table::new(format!("Frame of {}", scene_name(args)))
        .row(
            "macropixels that see a surface",
            part_of_whole(summary.with_target, summary.pixels),
        )
        .row(
            "windows that hold their surface",
            part_of_whole(summary.in_window, summary.guided),
        )
        .row(
            "surfaces with a depth",
            part_of_whole(with_surface, summary.with_target),
        )
        .row(
            format!("depths off by more than a bin ({:.2} m)", summary.bin_m),
            part_of_whole(summary.outliers, with_surface),
        );
    if let Some(error_m) = summary.median_absolute_error_m {
        table.push("median error of these depths", format!("{error_m:.3} m"));
    }
    if frame.depths_of_medium > 0 {
        table.push(
            "depths of the fog or smoke itself, before any surface",
            part_of_whole(frame.depths_of_medium, summary.depths),
        );
    }
    if frame.light_cut > 0 {
        table.push(
            "macropixels with more light than is modelled",
            part_of_whole(frame.light_cut, summary.pixels),
        );
    }
    if let Some(why) = without_a_depth(&summary) {
        table.push("surfaces without a depth", why);
    }
    if let Some(kept) = &frame.kept {
        let added = format!("{:.1e} m of {:.1e} m", kept.bound_m, kept.tolerance_m);
        table.push("depth error added, bound", added);
    }
    table.push(
        "time from frame to frame",
        format!(
            "{}, exposure {}",
            settings.sensor.frame_time(frame.exposure_time),
            frame.exposure_time
        ),
    );
    table.push("laser", eye_safety_text(settings, frame));
    table.push("timing of the chip", timing_of(settings, timing));
    probes(&mut table, args, frame);
    table.push("run time", format!("{:.2} s", frame.times.total_s()));
    files(&mut table, args, frame);
    table
}

/// Surfaces without a depth by reason, the commonest first.
fn without_a_depth(summary: &FrameSummary) -> Option<String> {
    let reasons = summary.no_depth.iter();
    let mut reasons: Vec<_> = reasons
        .filter(|(reason, _)| **reason != NoDepth::NoSurface)
        .collect();
    reasons.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
    let said = reasons.iter();
    let said: Vec<String> = said
        .map(|(reason, count)| format!("{count} {}", reason.name()))
        .collect();
    (!said.is_empty()).then(|| said.join(", "))
}

/// Whether the chip can be clocked so fast, and how much is left.
fn timing_of(settings: &FrameSettings, timing: &VerdictReport) -> String {
    let slack = Time::from_s(timing.slack_ps.abs() * 1e-12);
    let mhz = settings.sensor.clk_hz / 1e6;
    if timing.met {
        format!("met at {mhz} MHz, {slack} left")
    } else {
        format!("FAILS at {mhz} MHz by {slack} ({})", timing.check)
    }
}

/// What gates counted.
fn probes(table: &mut Table, args: &FrameArgs, frame: &Frame) {
    for ((row, col), cycles) in frame.probes.iter().zip(&frame.probed_cycles) {
        let engine = args.exposure.engine.of_probes(frame.kept.is_some());
        let agree =
            format!("agree with the engine {engine:?} in {cycles} laser cycles").to_lowercase();
        table.push(format!("gates of macropixel ({row}, {col})"), agree);
    }
}

/// What was written.
fn files(table: &mut Table, args: &FrameArgs, frame: &Frame) {
    let names = ["depth.png", "histograms.npy", "frame.json", MANIFEST].map(String::from);
    let page = args.page.then(|| "page.html".to_owned());
    let waves = frame.probes.iter().map(|&at| wave_name(args, at));
    let names: Vec<String> = names.into_iter().chain(page).chain(waves).collect();
    table.push(format!("in {}", args.out.display()), names.join(" "));
}

/// How far the laser is from the limit of class 1.
fn eye_safety_text(settings: &FrameSettings, frame: &Frame) -> String {
    match safety(settings, frame) {
        None => "not judged at this wavelength".to_owned(),
        Some(EyeSafety { times_class_1, .. }) if times_class_1 > 1.0 => {
            format!("ABOVE class 1, {times_class_1:.2} times its limit")
        }
        Some(EyeSafety { times_class_1, .. }) => {
            format!("class 1, {times_class_1:.2} of its limit")
        }
    }
}

fn safety(settings: &FrameSettings, frame: &Frame) -> Option<EyeSafety> {
    let laser_cycles = settings.exposure.laser_cycles;
    eye_safety_of(&settings.sensor, &settings.scene, laser_cycles, frame)
}

/// The rest, for `--verbose`.
pub(super) fn push_details(
    table: &mut Table,
    args: &FrameArgs,
    settings: &FrameSettings,
    timing: &VerdictReport,
    frame: &Frame,
) {
    let summary = frame.summary();
    let part_of_whole = |part: usize, whole: usize| format!("{part} of {whole}");
    table.push(
        match settings.sensor.mode {
            Mode::Guided => "guided",
            Mode::Conventional => "with the one window of the conventional mode",
        },
        part_of_whole(summary.guided, summary.pixels),
    );
    if !args.exposure.guiding.guides.is_empty() {
        table.push("guide", settings.guide.name());
    }
    quality::rows(table, &settings.depth, &summary);
    let work = &frame.work;
    let percent = |part: f64, whole: f64| format!("{:.2} %", 100.0 * part / whole.max(1.0));
    table.push(
        "photons on the array",
        format!("{:.0}", frame.photons_expected),
    );
    // More than are expected where several windows look back on the same photons, or by chance where all are drawn.
    table.push(
        "simulated: photons, each time they are drawn",
        percent(work.photons_drawn as f64, frame.photons_expected),
    );
    table.push(
        "simulated: CLK periods",
        percent(work.clk_periods_visited as f64, work.clk_periods as f64),
    );
    let skipped = work.skipped_dark + work.skipped_closed;
    table.push(
        "simulated: macropixels",
        part_of_whole((work.macropixels - skipped) as usize, summary.pixels),
    );
    if let Some(kept) = &frame.kept {
        table.push(
            "macropixels on window, cohort",
            format!("{}, {}", kept.on_window, kept.on_cohort),
        );
        for (why, pixels) in kept.refused() {
            table.push(format!("  refused by cohort: {why}"), pixels);
        }
        if kept.refused().next().is_some() {
            table.push(
                "  run time of those refused",
                percent(kept.refused_run_time_share, 1.0),
            );
        }
    }
    if let Some(share) = variance_left_out_of(settings, frame) {
        table.push(
            "variance of counts, left out by cohort",
            format!(
                "up to {}: no afterpulse follows its pulse there",
                percent(share, 1.0)
            ),
        );
    }
    let lost = work.lost_to_dead_time as f64;
    table.push(
        "lost to dead time",
        percent(lost, work.pulses as f64 + lost),
    );
    if work.cancelled > 0 {
        let share = percent(work.cancelled as f64, work.pulses as f64);
        table.push(
            "photons that cancel",
            format!("{}, {share}", work.cancelled),
        );
    }
    table.push(
        "serial load",
        format!("{} bits, {}", frame.load_bits, frame.load_time),
    );
    table.push("readout", frame.readout_time);
    let load = if settings.sensor.reset_to_load {
        "between frames, after a reset"
    } else {
        "hidden behind the frame before"
    };
    table.push("windows are loaded", load);
    if let Some(EyeSafety { rule, within_s, .. }) = safety(settings, frame) {
        let frames_hz = 1.0 / frame_s(&settings.sensor, &settings.scene, frame);
        let limit = format!(
            "{}, within {within_s:.2e} s, at {frames_hz:.1} frames a second",
            rule.name()
        );
        table.push("laser, what limits it", limit);
    }
    table.push("timing, tightest", &timing.check);
    let times = &frame.times;
    table.push(
        "run time: load, gate level",
        format!("{:.2} s", times.load_s),
    );
    table.push(
        "run time: photons and engine",
        format!("{:.2} s", times.exposure_s),
    );
    table.push(
        "run time: probes, gate level",
        format!("{:.2} s", times.probes_s),
    );
}
