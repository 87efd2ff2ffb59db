//! `gdtof export frame`: a frame as point clouds and arrays.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::voice::{notes, say_unless_quiet};
use crate::files::{InputError, ResultSet, read_counts};
use crate::report::{Npz, write_depth_png, write_npy_f32, write_pcd, write_ply};
use crate::system::{DepthReturn, NoDepth, PixelDepth, RETURNS, TakenFrame, point_cloud};

/// Arguments of `gdtof export frame`.
#[derive(Args)]
pub(super) struct FrameExportArgs {
    /// Folder that `gdtof frame` has written.
    #[arg(value_name = "DIR")]
    frame: PathBuf,
    /// What to write, separated by commas [default: all].
    #[arg(long, value_name = "FORMAT,…", value_delimiter = ',', value_enum)]
    format: Vec<Format>,
    /// Folder for the files; created if missing.
    #[arg(long, value_name = "DIR", default_value = "export")]
    out: PathBuf,
}

/// What a frame is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// frame.ply: point cloud, binary PLY: x right, y down, z forward, intensity, confidence, row, col, return.
    Ply,
    /// frame.pcd: point cloud, binary PCD 0.7, with the same fields.
    Pcd,
    /// depth.npy: depths along the rays, rows x cols, m, float32; NaN where there is none.
    Npy,
    /// frame.npz: everything: histograms, depths, their bounds and spreads, all returns, guide, truth, peaks, confidence, start values, reasons.
    Npz,
    /// depth16.png: depths as a 16-bit picture, in steps of 1/256 m; 0 where there is none (as in KITTI).
    Png16,
}

/// The frame's file in a folder.
fn frame_json(folder: &Path) -> Result<PathBuf, InputError> {
    let path = folder.join("frame.json");
    if path.exists() {
        return Ok(path);
    }
    let message = "has no frame.json; give a folder that `gdtof frame` has written";
    Err(InputError::new(folder.display(), message))
}

/// Runs the command.
///
/// # Errors
/// A folder without a frame of this version, and files that cannot be written.
pub(super) fn run(args: &FrameExportArgs) -> anyhow::Result<()> {
    let TakenFrame {
        settings, pixels, ..
    } = TakenFrame::read(&frame_json(&args.frame)?)?;
    let sensor = &settings.sensor;
    let (rows, cols, bins) = (sensor.rows, sensor.cols, sensor.bins);
    let shape = [rows, cols, bins];
    let histograms = read_counts(&args.frame.join("histograms.npy"), &shape)?;

    let camera = settings.scene.lidar_camera(rows as u32, cols as u32);
    let points = point_cloud(&camera, cols, &pixels);
    let depths = pixel_values(&pixels, |pixel| pixel.measured_m);

    let results = ResultSet::begin(&args.out, "export frame")?;
    let all = Format::value_variants();
    let formats = if args.format.is_empty() {
        all
    } else {
        &args.format[..]
    };
    let mut names = Vec::new();
    for format in all.iter().filter(|format| formats.contains(format)) {
        let name = match format {
            Format::Ply => "frame.ply",
            Format::Pcd => "frame.pcd",
            Format::Npy => "depth.npy",
            Format::Npz => "frame.npz",
            Format::Png16 => "depth16.png",
        };
        let path = results.staging().join(name);
        match format {
            Format::Ply => write_ply(&path, &points)?,
            Format::Pcd => write_pcd(&path, &points)?,
            Format::Npy => write_npy_f32(&path, &[rows, cols], &depths)?,
            Format::Npz => whole(&pixels, &histograms, shape).write(&path)?,
            Format::Png16 => write_depth_png(&path, cols, &depths)?,
        }
        names.push(name);
    }
    let frame = args.frame.display().to_string();
    notes(results.commit(serde_json::json!({ "frame": frame }))?);
    let found = depths.iter().filter(|depth| depth.is_finite()).count();
    say_unless_quiet(format_args!(
        "{} in {}: {found} of {} macropixels have a depth\n",
        names.join(", "),
        args.out.display(),
        pixels.len()
    ))?;
    Ok(())
}

/// A number of each macropixel; not a number where there is none.
fn pixel_values(pixels: &[PixelDepth], number: impl Fn(&PixelDepth) -> Option<f64>) -> Vec<f32> {
    let number = |pixel| number(pixel).map_or(f32::NAN, |x| x as f32);
    pixels.iter().map(number).collect()
}

fn whole(pixels: &[PixelDepth], histograms: &[u16], [rows, cols, bins]: [usize; 3]) -> Npz {
    let mut arrays = Npz::default();
    let shape = [rows, cols];
    arrays.add("histograms", &[rows, cols, bins], histograms);
    for (name, number) in [
        (
            "depth_m",
            (|m| m.measured_m) as fn(&PixelDepth) -> Option<f64>,
        ),
        ("bound_m", |m| m.bound_m),
        ("spread_m", |m| m.spread_m),
        ("guide_m", |m| m.guide_m),
        ("truth_m", |m| m.true_m),
        ("peak_m", |m| m.peak_m),
        ("confidence", |m| m.confidence),
    ] {
        arrays.add(name, &shape, &pixel_values(pixels, number));
    }
    for (name, number) in [
        (
            "returns_m",
            (|r| Some(r.depth_m)) as fn(&DepthReturn) -> Option<f64>,
        ),
        ("returns_bound_m", |r| r.bound_m),
        ("returns_photons", |r| Some(r.photons)),
    ] {
        let numbers = pixels.iter().flat_map(|m| m.returns.numbers(number));
        let all: Vec<f32> = numbers.map(|x| x as f32).collect();
        arrays.add(name, &[rows, cols, RETURNS], &all);
    }
    let start = |m: &PixelDepth| m.start.map_or(-1, i32::from);
    arrays.add(
        "start",
        &shape,
        &pixels.iter().map(start).collect::<Vec<i32>>(),
    );
    let in_window = |m: &PixelDepth| u8::from(m.in_window);
    arrays.add(
        "in_window",
        &shape,
        &pixels.iter().map(in_window).collect::<Vec<u8>>(),
    );
    let reason = |m: &PixelDepth| NoDepth::number(m.no_depth);
    arrays.add(
        "no_depth",
        &shape,
        &pixels.iter().map(reason).collect::<Vec<u8>>(),
    );
    arrays
}
