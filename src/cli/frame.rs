//! `gdtof frame`: the main job.

pub(super) mod calibration;
mod pair;
mod table;

use std::path::PathBuf;

use clap::Args;

use self::pair::PairReport;
use super::asked::{ExposureArgs, WaveFormatOption};
use super::voice::{note, notes, progress, say_json, say_unless_quiet};
use super::{SceneArgs, asked};
use crate::analysis::TimingVerdict;
use crate::chip::{SensorConfig, Silicon};
use crate::engine::waveform::WaveCycles;
use crate::files::{InputError, ResultSet};
use crate::guide::GuideMap;
use crate::page::Page;
use crate::request::{FrameReport, FrameRequest};
use crate::system::{GateProbe, WindowPolicy, take_frame_by};
use crate::waves::WaveFormat;

/// Arguments of `gdtof frame`.
#[derive(Args)]
pub(super) struct FrameArgs {
    /// Scene: a name or a file, as for --scene.
    #[arg(value_name = "SCENE", conflicts_with = "scene")]
    world: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    pair: pair::PairArgs,
    #[command(flatten)]
    exposure: ExposureArgs,
    /// Folder for the results; created if missing.
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// Macropixel to run at gate level with a waveform, as row,col or `none`; may be repeated [default: the guided
    /// macropixel nearest to the centre].
    #[arg(long, value_name = "R,C")]
    probe: Vec<String>,
    /// Laser cycles in the waveforms of probes: the first N, or `all` [default: the first that counts, one before it
    /// and two after it]. No others are simulated at gate level, beyond the first 64.
    #[arg(long, value_name = "N|all", value_parser = wave_cycles)]
    wave_cycles: Option<WaveCycles>,
    /// Format of the waveforms of probes.
    #[arg(long, value_enum, default_value_t)]
    wave_format: WaveFormatOption,
    /// Run every macropixel on the cheapest engine that adds at most M metres of depth error on average.
    #[arg(long, value_name = "M", conflicts_with_all = ["engine", "no_skip"])]
    tolerance: Option<f64>,
    /// Print more rows: kinds of errors, simulated work, run times.
    #[arg(long)]
    verbose: bool,
    /// Draw and run everything, even what the engine could leave out: same histograms, more work.
    #[arg(long)]
    no_skip: bool,
    /// Share of macropixels without an echo that may get a depth. With 1 every peak gives a depth.
    #[arg(long, value_name = "P", default_value_t = 1e-3)]
    false_alarm_rate: f64,
    /// Do not correct depths for the range walk of strong echoes.
    #[arg(long)]
    no_walk_correction: bool,
    /// Ends of the colours of depth.png, m, as in 0-50, so that pictures of several frames compare [default: the frame's shortest and longest
    /// depth].
    #[arg(long, value_name = "NEAR-FAR", value_parser = depth_scale)]
    depth_scale_m: Option<(f32, f32)>,
    /// Also write page.html, to look at the frame in a browser (gdtof page makes one later).
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
pub(super) fn run(mut args: FrameArgs) -> anyhow::Result<()> {
    args.scene = args.scene.or_file(args.world.take());
    let args = &args;
    let (sensor, scene) = args.scene.read()?;
    let pair = args.pair.match_pair(&sensor, scene.clone(), &args.out)?;
    let scene = pair.as_ref().map_or(scene, |pair| pair.scene.clone());
    let request = args.request();
    let policy = request.policy(WindowPolicy::default())?;
    let guide = match &pair {
        Some(pair) if request.guides.is_empty() => pair.guide.clone(),
        _ => request.guide()?,
    };
    let chosen = chosen_probes(&args.probe, &sensor)?;
    let settings = request.settings_by(sensor, scene, guide, &policy)?;
    let silicon = Silicon::new(&settings.sensor);
    let timing = TimingVerdict::analyse(&settings.sensor, &silicon, (0, 0)).report();
    if let Some(warning) = timing.warning() {
        note(warning);
    }
    let results = ResultSet::begin(&args.out, "frame")?;
    let probe_at = |(row, col)| GateProbe {
        row,
        col,
        waves: results.staging().join(wave_name(args, (row, col))),
        wave_cycles: args.wave_cycles.unwrap_or_default(),
    };
    let progress = progress(
        settings.sensor.pixels() as u64,
        "{msg} {bar:40} {pos}/{len} macropixels, {eta} left",
    );
    progress.set_message("guiding");
    let frame = take_frame_by(
        &settings,
        policy,
        |guide| {
            progress.set_message("exposing");
            let pixels = match chosen {
                Some(pixels) => pixels,
                None => nearest_guided(guide).into_iter().collect(),
            };
            pixels.into_iter().map(probe_at).collect()
        },
        |macropixels| progress.inc(macropixels as u64),
    )?;
    progress.set_message("writing");

    let pair_report = pair.as_ref().map(|pair| &pair.report);
    let name = scene_name(args);
    let report = FrameReport::new(name, &request, &settings, &timing, &frame, pair_report);
    report.write(results.staging(), &frame.histograms, args.depth_scale_m)?;
    if args.page {
        let page = Page::read(results.staging(), &args.out, 1)?;
        page.write(&results.staging().join("page.html"))?;
    }
    if let Some(pair) = &pair {
        pair.write(results.staging())?;
    }
    let kept = results.commit(&report.configuration)?;
    progress.finish_and_clear();
    notes(kept);
    if args.json {
        say_json(&report)?;
    } else {
        let mut table = table::brief(args, &settings, &timing, &frame);
        if args.verbose {
            table::push_details(&mut table, args, &settings, &timing, &frame);
        }
        if let Some(pair) = pair_report {
            pair.rows(&mut table);
        }
        say_unless_quiet(table)?;
        if let Some(note) = pair_report.and_then(PairReport::note) {
            say_unless_quiet(format_args!("\n{note}\n"))?;
        }
        if let Some(remark) = &frame.remark {
            say_unless_quiet(format_args!("\n{remark}\n"))?;
        }
        for hint in &frame.hints {
            say_unless_quiet(format_args!("\n{}\n", hint.sentence))?;
        }
        for note in &timing.notes {
            say_unless_quiet(format_args!("\nNote on timing: {note}\n"))?;
        }
    }
    Ok(())
}

impl FrameArgs {
    fn request(&self) -> FrameRequest {
        let mut request = self.exposure.request();
        request.tolerance_m = self.tolerance;
        request.skip = !self.no_skip;
        request.false_alarm_rate = self.false_alarm_rate;
        request.correct_walk = !self.no_walk_correction;
        request
    }
}

fn depth_scale(text: &str) -> Result<(f32, f32), String> {
    let ends = text.split_once('-');
    let ends = ends.and_then(|(near, far)| Some((near.parse().ok()?, far.parse().ok()?)));
    let is_scale = |ends: &(f32, f32)| ends.0 >= 0.0 && ends.0 < ends.1 && ends.1 <= 1e5;
    ends.filter(is_scale)
        .ok_or_else(|| "are no two rising distances; give them in metres, as in 0-50".to_owned())
}

fn wave_cycles(text: &str) -> Result<WaveCycles, String> {
    match text {
        "all" => Ok(WaveCycles::All),
        _ => text
            .parse()
            .map(WaveCycles::First)
            .map_err(|_| "is not a number of laser cycles; give one, or all".to_owned()),
    }
}

/// What reports call the scene.
fn scene_name(args: &FrameArgs) -> String {
    (args.pair.name()).unwrap_or_else(|| args.scene.scene_name())
}

/// File name of a probe's waveform.
fn wave_name(args: &FrameArgs, (row, col): (usize, usize)) -> String {
    format!(
        "probe_r{row}_c{col}.{}",
        WaveFormat::from(args.wave_format).extension()
    )
}

/// `None` if the guide chooses.
fn chosen_probes(
    texts: &[String],
    sensor: &SensorConfig,
) -> Result<Option<Vec<(usize, usize)>>, InputError> {
    if texts.is_empty() {
        return Ok(None);
    }
    let mut probes = Vec::new();
    for text in texts.iter().filter(|text| *text != "none") {
        let place = asked::pixel("--probe", text, sensor)?;
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
