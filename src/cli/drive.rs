//! `gdtof drive`: frame after frame while the world moves.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;

use super::SceneArgs;
use super::asked::ExposureArgs;
use super::foxglove::Foxglove;
use super::voice::{announce, notes, progress, say_file, say_unless_quiet};
use crate::files::{InputError, MANIFEST, OutputFile, ResultSet};
use crate::report::{DepthImage, ImageCell, NpyStack, Table};
use crate::request::{Spelling, check_drive_times};
use crate::system::{
    DriveConfiguration, DriveFrame, DriveLine, DriveResult, DriveSettings, DriveSimulation,
    DriveTotals, FrameClock, NoDepth, Noise, RunReport, WindowPolicy, WrittenExposure,
    drive_scale_m,
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

/// The contents of drive.json.
type DriveReport<'a> = RunReport<DriveConfiguration<WrittenExposure<'a>>, DriveResult>;

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
    let configuration = DriveConfiguration {
        exposed: request.exposed(scene_args.scene_name(), &settings.frame),
        guides: asked.guiding.guides.clone(),
        windows: settings.policy,
        calibration: asked.calibration.clone(),
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
    let totals = DriveTotals {
        frame_period_s: drive.period_s(),
        frames_per_s: 1.0 / drive.period_s(),
        load_s,
        exposure_s,
        readout_s,
        ..DriveTotals::default()
    };
    let result = DriveResult {
        frames: args.frames,
        totals,
    };
    let mut report = DriveReport::from_parts(configuration, result);
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
        add_frame(&mut report.result.totals, &frame);
        progress.inc(1);
    }
    progress.finish_and_clear();
    recording.finish()?;
    if let Some(foxglove) = foxglove {
        foxglove.finish(&mcap)?;
    }
    report.result.totals.run_time_s = began.elapsed().as_secs_f64();
    let json = serde_json::to_string_pretty(&report)?;
    let file = results.staging().join("drive.json");
    OutputFile::write_text(&file, &format!("{json}\n"))?;
    notes(results.commit(&report.configuration)?);
    if args.json {
        Ok(say_file(format_args!("{json}\n"))?)
    } else {
        Ok(say_unless_quiet(table(&report, &args.out))?)
    }
}

fn add_frame(totals: &mut DriveTotals, frame: &DriveFrame) {
    let summary = frame.summary();
    totals.macropixels += frame.pixels.len() as u64;
    totals.macropixels_reused += frame.reused.macropixels as u64;
    totals.loads_reused += u32::from(frame.reused.load);
    totals.worlds_reused += u32::from(frame.reused.world);
    totals.views += (frame.worlds * frame.pixels.len()) as u64;
    totals.views_reused += frame.reused.views as u64;
    totals.depths += summary.depths as u64;
    totals.outliers += summary.outliers as u64;
    totals.work += frame.work;
}

fn table(report: &DriveReport<'_>, out: &Path) -> Table {
    let DriveResult { frames, totals } = &report.result;
    let ms = |s: f64| format!("{:.2} ms", 1e3 * s);
    let part_of_whole = |part: u64, whole: u64| format!("{part} of {whole}");
    let asked = &report.configuration;
    let mut table = Table::new(format!("{} frames of {}", frames, asked.exposed.scene_name))
        .row(
            "frame rate",
            format!(
                "{:.2} fps, one every {}",
                totals.frames_per_s,
                ms(totals.frame_period_s)
            ),
        )
        .row("guide, from images to map", ms(asked.clock.guide_latency_s))
        .row("load", ms(totals.load_s))
        .row("exposure", ms(totals.exposure_s))
        .row("readout", ms(totals.readout_s))
        .row(
            "depths, wrong by more than a bin",
            format!("{}, {}", totals.depths, totals.outliers),
        )
        .row("photons drawn", totals.work.photons_drawn)
        .row(
            "CLK periods visited",
            part_of_whole(totals.work.clk_periods_visited, totals.work.clk_periods),
        )
        .row(
            "macropixels not exposed again",
            part_of_whole(totals.macropixels_reused, totals.macropixels),
        )
        .row(
            "loads not run again",
            part_of_whole(totals.loads_reused.into(), (*frames).into()),
        )
        .row(
            "macropixels' views not cast again",
            part_of_whole(totals.views_reused, totals.views),
        );
    let each = ms(totals.run_time_s / f64::from(*frames));
    table.push(
        "run time",
        format!("{:.2} s, {each} a frame", totals.run_time_s),
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
        let line = DriveLine {
            number: frame.number,
            times: frame.times,
            summary: frame.summary(),
            reused: frame.reused,
            work: frame.work,
            run_times: frame.run_times,
            camera_turn_deg: self.self_calibrates.then_some(frame.camera_turn_deg),
            picture: picture.map(str::to_owned),
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
