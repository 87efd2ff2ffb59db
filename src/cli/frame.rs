//! `gdtof frame`: the main job.

mod pair;
mod picture;

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use self::pair::PairReport;
use super::asked::{Exposed, ExposureArgs};
use super::voice::{note, progress, say, tell};
use super::{SceneArgs, quality};
use crate::analysis::{TimingVerdict, VerdictReport};
use crate::chip::WindowLaw;
use crate::chip::{Mode, SensorConfig, Silicon};
use crate::engine::waveform::WaveCycles;
use crate::engine::{Work, variance_left_out};
use crate::files::{InputError, MANIFEST, OutputFile, ResultSet};
use crate::guide::GuideMap;
use crate::page::Page;
use crate::report::{Table, write_npy_u16};
use crate::request::FrameRequest;
use crate::system::{
    DistanceLaw, EngineKind, Frame, FrameSettings, Kept, PhaseTimes, PixelDepth, Probe, Summary,
    WindowPolicy, take_frame_by,
};
use crate::units::Time;
use crate::waves::WaveFormat;

/// Arguments of `gdtof frame`.
#[derive(Args)]
pub(super) struct FrameArgs {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    pair: pair::PairArgs,
    #[command(flatten)]
    exposure: ExposureArgs,
    /// Folder for the results; it is made if need be.
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// Macropixel to run at gate level with its waveform, as row,col or `none`; may be repeated. Without
    /// it, the guided macropixel nearest to the centre.
    #[arg(long, value_name = "R,C")]
    probe: Vec<String>,
    /// What the waveforms of probes keep: the first N laser cycles, or `all`. Without it, the first that counts, one
    /// before it and two after it.
    #[arg(long, value_name = "N|all", value_parser = wave_cycles)]
    wave_cycles: Option<WaveCycles>,
    /// Format of the waveforms of probes.
    #[arg(long, value_enum, default_value_t)]
    wave_format: WaveFormat,
    /// Steps to a CLK period in which the cohort engine follows the dead time. Without it, as finely as it takes to keep
    /// each bin's mean within a tenth of its counting noise.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u8).range(1..=64))]
    sub_bins: Option<u8>,
    /// Let every macropixel have the cheapest engine that adds at most M metres of depth error on average.
    #[arg(long, value_name = "M", conflicts_with_all = ["engine", "sub_bins", "no_skip"])]
    tolerance: Option<f64>,
    /// Draw and run everything, also what the engine could leave out: same histograms, more work.
    #[arg(long)]
    no_skip: bool,
    /// Share of macropixels without an echo that may be given a depth; 1 takes every peak for one.
    #[arg(long, value_name = "P", default_value_t = 1e-3)]
    false_alarm_rate: f64,
    /// Leave the range walk of strong echoes in the depths.
    #[arg(long)]
    no_walk_correction: bool,
    /// Also write page.html: one file to look at the frame in a browser (gdtof page makes one later).
    #[arg(long)]
    page: bool,
    /// Print frame.json instead of the table.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Bad input, unwritable output, and what [`take_frame_by`] reports.
pub(super) fn run(args: &FrameArgs) -> anyhow::Result<()> {
    let (sensor, scene) = args.scene.read()?;
    let pair = args.pair.take(&sensor, scene.clone(), &args.out)?;
    let scene = pair.as_ref().map_or(scene, |pair| pair.scene.clone());
    let request = args.request();
    let policy = request.policy(WindowPolicy::default())?;
    let guide = match &pair {
        Some(pair) if request.guides.is_empty() => pair.guide.clone(),
        _ => request.guide()?,
    };
    let chosen = chosen_probes(&args.probe, &sensor)?;
    let settings = request.settings_by(sensor, scene, guide, &policy)?;
    let silicon = Silicon::nominal(settings.sensor.corner);
    let timing = TimingVerdict::of(&settings.sensor, &silicon, (0, 0)).report();
    let results = ResultSet::begin(&args.out)?;
    let probe_at = |(row, col)| Probe {
        row,
        col,
        waves: results.staging().join(wave_name(args, (row, col))),
        wave_cycles: args.wave_cycles.unwrap_or_default(),
    };
    let progress = progress(
        settings.sensor.pixels() as u64,
        "exposing {bar:40} {pos}/{len} macropixels, {eta} left",
    );
    let frame = take_frame_by(
        &settings,
        policy,
        |guide| {
            progress.finish_and_clear();
            let pixels = match chosen {
                Some(pixels) => pixels,
                None => nearest_guided(guide).into_iter().collect(),
            };
            pixels.into_iter().map(probe_at).collect()
        },
        |macropixels| progress.inc(macropixels as u64),
    )?;

    let pair_report = pair.as_ref().map(|pair| &pair.report);
    let report = Report::new(args, &settings, &timing, &frame, pair_report);
    write_results(results.staging(), &frame, &report)?;
    if args.page {
        let page = Page::of(results.staging(), &args.out, 1)?;
        page.write(&results.staging().join("page.html"))?;
    }
    if let Some(pair) = &pair {
        pair.write(results.staging())?;
    }
    for sentence in results.commit("frame", &report.configuration)? {
        note(sentence);
    }
    if args.json {
        say(format_args!("{}\n", serde_json::to_string_pretty(&report)?))?;
    } else {
        let mut table = table(args, &settings, &timing, &frame);
        if let Some(pair) = pair_report {
            pair.rows(&mut table);
        }
        tell(table)?;
        if let Some(note) = pair_report.and_then(PairReport::note) {
            tell(format_args!("\n{note}\n"))?;
        }
        if let Some(remark) = &frame.remark {
            tell(format_args!("\n{remark}\n"))?;
        }
        if !timing.met {
            tell(format_args!("\nTiming {}\n", timing.verdict))?;
        }
        for note in &timing.notes {
            tell(format_args!("\nNote on timing: {note}\n"))?;
        }
    }
    Ok(())
}

impl FrameArgs {
    fn request(&self) -> FrameRequest {
        FrameRequest {
            sub_bins: self.sub_bins,
            tolerance_m: self.tolerance,
            skip: !self.no_skip,
            false_alarm_rate: self.false_alarm_rate,
            correct_walk: !self.no_walk_correction,
            ..self.exposure.request()
        }
    }
}

fn wave_cycles(text: &str) -> Result<WaveCycles, String> {
    match text {
        "all" => Ok(WaveCycles::All),
        _ => text
            .parse()
            .map(WaveCycles::First)
            .map_err(|_| "give a number of laser cycles, or all".to_owned()),
    }
}

/// What reports call the scene.
fn scene_name(args: &FrameArgs) -> String {
    (args.pair.name()).unwrap_or_else(|| args.scene.scene_name())
}

/// File name of a probe's waveform.
fn wave_name(args: &FrameArgs, (row, col): (usize, usize)) -> String {
    format!("probe_r{row}_c{col}.{}", args.wave_format.extension())
}

/// `None` where the choice is left to the guide.
fn chosen_probes(
    texts: &[String],
    sensor: &SensorConfig,
) -> Result<Option<Vec<(usize, usize)>>, InputError> {
    if texts.is_empty() {
        return Ok(None);
    }
    let mut probes = Vec::new();
    for text in texts.iter().filter(|text| *text != "none") {
        let place = super::pixel("--probe", text, sensor)?;
        if !probes.contains(&place) {
            probes.push(place);
        }
    }
    Ok(Some(probes))
}

fn nearest_guided(guide: &GuideMap) -> Option<(usize, usize)> {
    let cols = guide.cols as usize;
    let places = guide
        .range_m
        .iter()
        .enumerate()
        .filter(|(_, r)| r.is_some());
    places
        .map(|(pixel, _)| (pixel / cols, pixel % cols))
        .min_by_key(|&(row, col)| {
            let off = |at: usize, size: u32| (2 * at as i64 + 1 - size as i64).pow(2);
            off(row, guide.rows) + off(col, guide.cols)
        })
}

/// What was asked for: in frame.json and in the manifest.
#[derive(Serialize)]
struct Configuration<'a> {
    #[serde(flatten)]
    exposed: Exposed<'a>,
    false_alarm_rate: f64,
    walk_correction: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    calibration: Option<String>,
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    guides: &'a [String],
    #[serde(skip_serializing_if = "Option::is_none")]
    windows: Option<&'a str>,
}

/// The contents of frame.json.
#[derive(Serialize)]
struct Report<'a> {
    version: &'static str,
    #[serde(flatten)]
    configuration: Configuration<'a>,
    summary: Summary,
    remark: Option<&'a str>,
    photons_expected: f64,
    work: Work,
    timing: &'a VerdictReport,
    tolerance: Option<&'a Kept>,
    #[serde(skip_serializing_if = "Option::is_none")]
    variance_left_out: Option<f64>,
    distance: DistanceLaw,
    load_bits: usize,
    load_time_s: f64,
    readout_time_s: f64,
    exposure_time_s: f64,
    frame_time_s: f64,
    exposure_run_time_s: f64,
    run_time_s: f64,
    run_times: PhaseTimes,
    #[serde(skip_serializing_if = "Option::is_none")]
    pair: Option<&'a PairReport>,
    probes: &'a [(usize, usize)],
    histograms_shape: [usize; 3],
    macropixels: &'a [PixelDepth],
}

impl<'a> Report<'a> {
    fn new(
        args: &'a FrameArgs,
        settings: &'a FrameSettings,
        timing: &'a VerdictReport,
        frame: &'a Frame,
        pair: Option<&'a PairReport>,
    ) -> Self {
        let asked = &args.exposure;
        Report {
            version: env!("CARGO_PKG_VERSION"),
            configuration: Configuration {
                exposed: asked.exposed(scene_name(args), settings),
                false_alarm_rate: args.false_alarm_rate,
                walk_correction: !args.no_walk_correction,
                calibration: asked.calibration.as_ref().map(|p| p.display().to_string()),
                guides: asked.guiding.guides(),
                windows: asked.guiding.windows(),
            },
            summary: frame.summary(),
            remark: frame.remark.as_deref(),
            photons_expected: frame.photons_expected,
            work: frame.work,
            timing,
            tolerance: frame.kept.as_ref(),
            variance_left_out: variance_left_out_of(settings, frame),
            distance: DistanceLaw::new(
                // One law for all macropixels.
                &WindowLaw::new(settings.sensor.alike(), &settings.exposure),
                frame.pixels.iter().filter_map(|pixel| pixel.start),
            ),
            load_bits: frame.load_bits,
            load_time_s: frame.load_time.as_s(),
            readout_time_s: frame.readout_time.as_s(),
            exposure_time_s: frame.exposure_time.as_s(),
            frame_time_s: settings.sensor.frame_time(frame.exposure_time).as_s(),
            exposure_run_time_s: frame.times.exposure_s,
            run_time_s: frame.times.total_s(),
            run_times: frame.times,
            pair,
            probes: &frame.probes,
            histograms_shape: [frame.rows, frame.cols, frame.bins],
            macropixels: &frame.pixels,
        }
    }
}

/// The share of the variance of counts that may be missing, where cohorts made them of SPADs with afterpulses.
fn variance_left_out_of(settings: &FrameSettings, frame: &Frame) -> Option<f64> {
    let is_by_cohort = match &frame.kept {
        Some(kept) => kept.on_cohort > 0,
        None => settings.engine == EngineKind::Cohort,
    };
    let probability = settings.sensor.afterpulse_probability;
    (is_by_cohort && probability > 0.0).then(|| variance_left_out(probability))
}

fn write_results(out: &Path, frame: &Frame, report: &Report<'_>) -> anyhow::Result<()> {
    let shape = report.histograms_shape.map(|n| n as u64);
    write_npy_u16(&out.join("histograms.npy"), &shape, &frame.histograms)?;
    picture::depth_map(out, frame, &report.configuration.exposed)?;
    OutputFile::write_with(&out.join("frame.json"), |w| {
        serde_json::to_writer(&mut *w, report)?;
        writeln!(w)
    })?;
    Ok(())
}

fn table(
    args: &FrameArgs,
    settings: &FrameSettings,
    timing: &VerdictReport,
    frame: &Frame,
) -> Table {
    let summary = frame.summary();
    let of = |part: usize, whole: usize| format!("{part} of {whole}");
    let mut table = Table::new(format!("Frame of {}", scene_name(args)))
        .row(
            "macropixels that see a surface",
            of(summary.with_target, summary.pixels),
        )
        .row(
            match settings.sensor.mode {
                Mode::Guided => "guided",
                Mode::Conventional => "with the one window of the conventional mode",
            },
            of(summary.guided, summary.pixels),
        )
        .row("surface in window", of(summary.in_window, summary.guided));
    if !args.exposure.guiding.guides().is_empty() {
        table.push("guide", settings.guide.name());
    }
    quality::rows(&mut table, &settings.depth, &summary);
    let work = &frame.work;
    let percent = |part: f64, whole: f64| format!("{:.2} %", 100.0 * part / whole.max(1.0));
    table.push(
        "photons on the array",
        format!("{:.0}", frame.photons_expected),
    );
    // What two windows look back on is drawn twice, and there may be a few photons more than are expected.
    let drawn = (work.photons_drawn as f64).min(frame.photons_expected);
    table.push("simulated: photons", percent(drawn, frame.photons_expected));
    table.push(
        "simulated: CLK periods",
        percent(work.clk_periods_visited as f64, work.clk_periods as f64),
    );
    let skipped = work.skipped_dark + work.skipped_closed;
    table.push(
        "simulated: macropixels",
        of((work.macropixels - skipped) as usize, summary.pixels),
    );
    if let Some(kept) = &frame.kept {
        table.push(
            "depth error added, bound",
            format!("{:.1e} m of {:.1e} m", kept.bound_m, kept.tolerance_m),
        );
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
    table.push("exposure", frame.exposure_time);
    let load = match settings.sensor.reset_to_load {
        true => "windows are loaded between frames, after a reset",
        false => "the load is hidden behind the frame before",
    };
    table.push(
        "frame after frame",
        format!(
            "{}, {load}",
            settings.sensor.frame_time(frame.exposure_time)
        ),
    );
    let left_over = Time::from_s(timing.slack_ps * 1e-12);
    let met = if timing.met { "met" } else { "FAILS" };
    table.push("timing, slack", format!("{met}, {left_over}"));
    table.push("timing, tightest", &timing.check);
    for (row, col) in &frame.probes {
        let engine = args.exposure.engine.of_probes(frame.kept.is_some());
        let agrees = format!("agrees with {engine:?} engine").to_lowercase();
        table.push(format!("gate level ({row}, {col})"), agrees);
    }
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
    table.push("run time: all", format!("{:.2} s", times.total_s()));
    let names = ["depth.png", "histograms.npy", "frame.json", MANIFEST].map(String::from);
    let page = args.page.then(|| "page.html".to_owned());
    let waves = frame.probes.iter().map(|&at| wave_name(args, at));
    let names: Vec<String> = names.into_iter().chain(page).chain(waves).collect();
    table.push(format!("in {}", args.out.display()), names.join(" "));
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probes_are_checked() {
        let sensor = SensorConfig::default();
        let parse = |texts: &[&str]| {
            let texts: Vec<String> = texts.iter().map(|t| t.to_string()).collect();
            chosen_probes(&texts, &sensor)
        };
        assert_eq!(parse(&[]).unwrap(), None);
        assert_eq!(parse(&["none"]).unwrap(), Some(vec![]));
        assert_eq!(parse(&["10,20", "10, 20"]).unwrap(), Some(vec![(10, 20)]));
        for bad in ["64,0", "0,64", "x", "1", "1,2,3", "-1,0"] {
            assert!(parse(&[bad]).is_err(), "{bad}");
        }
    }
}
