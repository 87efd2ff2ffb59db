//! `gdtof drive`: frame after frame while the world moves.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde::Serialize;

use super::SceneArgs;
use super::asked::ExposureArgs;
use super::foxglove::Foxglove;
use super::voice::{announce, notes, progress, say_file, say_unless_quiet};
use crate::engine::EngineWork;
use crate::files::{InputError, MANIFEST, OutputFile, ResultSet};
use crate::report::{DepthImage, ImageCell, NpyStack, Table};
use crate::request::{ExposureReport, Spelling, check_drive_times};
use crate::system::{
    DriveFrame, DriveReuse, DriveSettings, DriveSimulation, FrameClock, FrameSummary, FrameTimes,
    NoDepth, Noise, PhaseTimes, WindowPolicy, drive_scale_m,
};

/// Arguments of `gdtof drive`.
#[derive(Args)]
pub(super) struct DriveArgs {
    /// Scene: a name or a file, as for --scene.
    #[arg(value_name = "SCENE", conflicts_with = "scene")]
    world: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneArgs,
    /// Frames to take.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: u32,
    /// Folder for the results; created if missing.
    #[arg(long, value_name = "DIR", default_value = "drive")]
    out: PathBuf,
    #[command(flatten)]
    exposure: ExposureArgs,
    /// Time from the cameras' images to the guide's map, ms.
    #[arg(long, value_name = "MS", default_value_t = 145.0)]
    guide_latency_ms: f64,
    /// Let the guide work on the next frame while this one is loaded, exposed and read out.
    #[arg(long)]
    pipelined: bool,
    /// Start from the window policy for sequences, which --windows can change: macropixels hold the peak that they
    /// have found, step their window in doubt, and take over estimates from neighbours.
    #[arg(long)]
    tracking: bool,
    /// Scene time at which the first images are taken, s.
    #[arg(
        long,
        value_name = "S",
        default_value_t = 0.0,
        allow_hyphen_values = true
    )]
    start_s: f64,
    /// Number of parts of an exposure; the world stands still within each.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    segments: u32,
    /// Photons of the frames. With `still`, a macropixel whose light and start value have not changed keeps its
    /// histogram.
    #[arg(long, value_enum, default_value_t)]
    noise: Noise,
    /// Learn from depths how far the right camera has turned (scene.stereo.yaw_error_deg), and correct the guide from frame to frame.
    #[arg(long)]
    self_calibrate: bool,
    /// Simulate everything anew in every frame: same results, more work.
    #[arg(long)]
    no_skip: bool,
    /// Do not write a picture of each frame.
    #[arg(long)]
    no_pictures: bool,
    /// Also record drive.mcap for Foxglove: points, depths, pictures and windows.
    #[arg(long)]
    mcap: bool,
    /// Print drive.json instead of the table.
    #[arg(long)]
    json: bool,
}

/// A line of `frames.jsonl`.
#[derive(Serialize)]
struct FrameLine<'a> {
    number: u32,
    times: FrameTimes,
    summary: FrameSummary,
    reused: DriveReuse,
    work: EngineWork,
    run_times: PhaseTimes,
    /// Degrees outwards.
    #[serde(skip_serializing_if = "Option::is_none")]
    camera_turn_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    picture: Option<&'a str>,
}

/// `drive.json`.
#[derive(Serialize)]
struct Report<'a> {
    version: &'static str,
    #[serde(flatten)]
    configuration: &'a Configuration<'a>,
    frames: u32,
    frame_period_s: f64,
    frames_per_s: f64,
    load_s: f64,
    exposure_s: f64,
    readout_s: f64,
    macropixels: u64,
    macropixels_reused: u64,
    loads_reused: u32,
    worlds_reused: u32,
    views: u64,
    views_reused: u64,
    depths: u64,
    outliers: u64,
    work: EngineWork,
    run_time_s: f64,
}

/// What was asked for.
#[derive(Serialize)]
struct Configuration<'a> {
    #[serde(flatten)]
    exposed: ExposureReport<'a>,
    /// As they were asked for; none for the camera pair.
    guides: &'a [String],
    windows: WindowPolicy,
    calibration: Option<&'a Path>,
    start_s: f64,
    clock: FrameClock,
    segments: u32,
    noise: Noise,
    skip: bool,
    self_calibrates: bool,
}

/// Runs the command.
///
/// # Errors
/// Bad input, unwritable output, and what a drive reports.
pub(super) fn run(args: DriveArgs) -> anyhow::Result<()> {
    let scene_args = args.scene.or_file(args.world);
    let (sensor, scene) = scene_args.read()?;
    let policy = if args.tracking {
        WindowPolicy::for_sequences()
    } else {
        WindowPolicy::default()
    };
    let asked = &args.exposure;
    let request = asked.request();
    let policy = request.policy(policy)?;
    let frame = request.settings_by(sensor, scene, request.guide()?, &policy)?;
    check_drive_times(args.guide_latency_ms, args.start_s, Spelling::Options)?;
    let settings = DriveSettings {
        policy,
        clock: FrameClock {
            guide_latency_s: args.guide_latency_ms * 1e-3,
            pipelined: args.pipelined,
        },
        segments: args.segments,
        noise: args.noise,
        reuse: !args.no_skip,
        self_calibrates: args.self_calibrate,
        start_s: args.start_s,
        ..DriveSettings::new(frame)
    };
    let configuration = Configuration {
        exposed: request.exposed(scene_args.scene_name(), &settings.frame),
        guides: &asked.guiding.guides,
        windows: settings.policy,
        calibration: asked.calibration.as_deref(),
        start_s: args.start_s,
        clock: settings.clock,
        segments: args.segments,
        noise: args.noise,
        skip: settings.reuse,
        self_calibrates: settings.self_calibrates,
    };
    let results = ResultSet::begin(&args.out, "drive")?;
    let began = Instant::now();
    let mut drive = DriveSimulation::new(&settings)?;
    let [load_s, exposure_s, readout_s] = drive.chip_s();
    let mut report = Report {
        version: env!("CARGO_PKG_VERSION"),
        configuration: &configuration,
        frames: args.frames,
        frame_period_s: drive.period_s(),
        frames_per_s: 1.0 / drive.period_s(),
        load_s,
        exposure_s,
        readout_s,
        macropixels: 0,
        macropixels_reused: 0,
        loads_reused: 0,
        worlds_reused: 0,
        views: 0,
        views_reused: 0,
        depths: 0,
        outliers: 0,
        work: EngineWork::default(),
        run_time_s: 0.0,
    };
    let mut recording = Recording::begin(results.staging(), &settings, args.frames)?;
    let mcap = results.staging().join("drive.mcap");
    let mut foxglove = if args.mcap {
        Some(Foxglove::begin(&mcap, &settings)?)
    } else {
        None
    };
    let first = Instant::now();
    let progress = progress(
        args.frames.into(),
        "driving {bar:40} {pos}/{len} frames, {eta} left",
    );
    for number in 0..args.frames {
        if number == 1 {
            // The first frame takes as long as the others, or longer.
            let rest_s = first.elapsed().as_secs_f64() * f64::from(args.frames - 1);
            progress.suspend(|| announce("the rest of the drive", rest_s));
        }
        let frame = drive.frame(|_| {})?;
        let picture = format!("depth_{number:05}.png");
        let picture = (!args.no_pictures).then_some(picture);
        if let Some(name) = &picture {
            depth_map(&frame, &settings, &results.staging().join(name))?;
        }
        recording.add(&frame, picture.as_deref())?;
        if let Some(foxglove) = &mut foxglove {
            let picture = picture.map(|name| results.staging().join(name));
            let added = foxglove.add(&frame, picture.as_deref());
            added.map_err(|e| InputError::unwritable(&mcap, &e))?;
        }
        report.add(&frame);
        progress.inc(1);
    }
    progress.finish_and_clear();
    recording.finish()?;
    if let Some(foxglove) = foxglove {
        foxglove.finish(&mcap)?;
    }
    report.run_time_s = began.elapsed().as_secs_f64();
    let json = serde_json::to_string_pretty(&report)?;
    let file = results.staging().join("drive.json");
    OutputFile::write_text(&file, &format!("{json}\n"))?;
    notes(results.commit(&configuration)?);
    if args.json {
        Ok(say_file(format_args!("{json}\n"))?)
    } else {
        Ok(say_unless_quiet(report.table(&args.out))?)
    }
}

impl Report<'_> {
    fn add(&mut self, frame: &DriveFrame) {
        let summary = frame.summary();
        self.macropixels += frame.pixels.len() as u64;
        self.macropixels_reused += frame.reused.macropixels as u64;
        self.loads_reused += u32::from(frame.reused.load);
        self.worlds_reused += u32::from(frame.reused.world);
        self.views += (frame.worlds * frame.pixels.len()) as u64;
        self.views_reused += frame.reused.views as u64;
        self.depths += summary.depths as u64;
        self.outliers += summary.outliers as u64;
        self.work += frame.work;
    }

    fn table(&self, out: &Path) -> Table {
        let ms = |s: f64| format!("{:.2} ms", 1e3 * s);
        let part_of_whole = |part: u64, whole: u64| format!("{part} of {whole}");
        let clock = self.configuration.clock;
        let mut table = Table::new(format!(
            "{} frames of {}",
            self.frames, self.configuration.exposed.scene_name
        ))
        .row(
            "frame rate",
            format!(
                "{:.2} fps, one every {}",
                self.frames_per_s,
                ms(self.frame_period_s)
            ),
        )
        .row("guide, from images to map", ms(clock.guide_latency_s))
        .row("load", ms(self.load_s))
        .row("exposure", ms(self.exposure_s))
        .row("readout", ms(self.readout_s))
        .row(
            "depths, wrong by more than a bin",
            format!("{}, {}", self.depths, self.outliers),
        )
        .row("photons drawn", self.work.photons_drawn)
        .row(
            "CLK periods visited",
            part_of_whole(self.work.clk_periods_visited, self.work.clk_periods),
        )
        .row(
            "macropixels not exposed again",
            part_of_whole(self.macropixels_reused, self.macropixels),
        )
        .row(
            "loads not run again",
            part_of_whole(self.loads_reused.into(), self.frames.into()),
        )
        .row(
            "macropixels' views not cast again",
            part_of_whole(self.views_reused, self.views),
        );
        let each = ms(self.run_time_s / f64::from(self.frames));
        table.push(
            "run time",
            format!("{:.2} s, {each} a frame", self.run_time_s),
        );
        let names = [
            "depth.npy",
            "guide.npy",
            "truth.npy",
            "starts.npy",
            "histograms.npy",
        ];
        let rest = ["frames.jsonl", "drive.json", MANIFEST];
        table.push(format!("in {}", out.display()), names.join(" "));
        table.push("", rest.join(" "));
        table
    }
}

/// The recording of a drive: stacks of arrays whose first axis is the frame, and an index with a line for each.
struct Recording {
    depth: NpyStack<f32>,
    guide: NpyStack<f32>,
    truth: NpyStack<f32>,
    starts: NpyStack<i16>,
    histograms: NpyStack<u16>,
    index: BufWriter<File>,
    folder: PathBuf,
    self_calibrates: bool,
}

impl Recording {
    fn begin(folder: &Path, settings: &DriveSettings, frames: u32) -> Result<Self, InputError> {
        let sensor = &settings.frame.sensor;
        let shape = [frames as usize, sensor.rows, sensor.cols];
        let [frames, rows, cols] = shape;
        let index = File::create(folder.join("frames.jsonl"));
        Ok(Recording {
            depth: NpyStack::begin(&folder.join("depth.npy"), &shape)?,
            guide: NpyStack::begin(&folder.join("guide.npy"), &shape)?,
            truth: NpyStack::begin(&folder.join("truth.npy"), &shape)?,
            starts: NpyStack::begin(&folder.join("starts.npy"), &shape)?,
            histograms: NpyStack::begin(
                &folder.join("histograms.npy"),
                &[frames, rows, cols, sensor.bins],
            )?,
            index: BufWriter::new(index.map_err(|e| InputError::unwritable(folder, &e))?),
            folder: folder.to_owned(),
            self_calibrates: settings.self_calibrates,
        })
    }

    fn add(&mut self, frame: &DriveFrame, picture: Option<&str>) -> Result<(), InputError> {
        let line = FrameLine {
            number: frame.number,
            times: frame.times,
            summary: frame.summary(),
            reused: frame.reused,
            work: frame.work,
            run_times: frame.run_times,
            camera_turn_deg: self.self_calibrates.then_some(frame.camera_turn_deg),
            picture,
        };
        let metres = |m: Option<f64>| m.map_or(f32::NAN, |m| m as f32);
        let pixels = &frame.pixels;
        let starts = pixels.iter().map(|p| p.start.map_or(-1, |s| s as i16));
        let write = || -> std::io::Result<()> {
            self.depth
                .extend(pixels.iter().map(|p| metres(p.measured_m)))?;
            self.guide
                .extend(pixels.iter().map(|p| metres(p.guide_m)))?;
            self.truth.extend(pixels.iter().map(|p| metres(p.true_m)))?;
            self.starts.extend(starts)?;
            self.histograms
                .extend(frame.histograms.counts().iter().copied())?;
            serde_json::to_writer(&mut self.index, &line)?;
            writeln!(self.index)
        };
        write().map_err(|e| InputError::unwritable(&self.folder, &e))
    }

    fn finish(mut self) -> Result<(), InputError> {
        let flushed = self.index.flush();
        let stacks = [
            self.depth.finish(),
            self.guide.finish(),
            self.truth.finish(),
        ];
        let rest = [self.starts.finish(), self.histograms.finish(), flushed];
        let written: std::io::Result<()> = stacks.into_iter().chain(rest).collect();
        written.map_err(|e| InputError::unwritable(&self.folder, &e))
    }
}

/// The frame's depths as a picture; all frames of a drive have the scale of what its guide can see.
fn depth_map(frame: &DriveFrame, settings: &DriveSettings, path: &Path) -> Result<(), InputError> {
    let cells: Vec<ImageCell> = frame
        .pixels
        .iter()
        .map(|pixel| match (pixel.measured_m, pixel.no_depth) {
            (Some(m), _) => ImageCell::Depth(m as f32),
            (None, why) => ImageCell::Category(why.map_or(0, |why| why as usize)),
        })
        .collect();
    let title = format!(
        "frame {}, exposed at {:.3} s",
        frame.number,
        frame.times.middle_s()
    );
    DepthImage {
        title: &title,
        cols: settings.frame.sensor.cols,
        cells: &cells,
        range_m: drive_scale_m(&settings.frame.scene),
        unit: "m",
        categories: &NoDepth::categories(),
        scale: 8,
    }
    .write_png(path)
}
