//! `gdtof stereo`: disparities of a rectified pair of pictures, by semi-global matching.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde::Serialize;

use super::voice::{notes, say_json, say_unless_quiet};
use crate::files::{InputError, MANIFEST, OutputFile, Raster, ResultSet};
use crate::report::{Category, DepthImage, ImageCell, Table, write_npy_f32};
use crate::stereo::{Census, DisparityMap, GreyImage, MatchError, Matcher, Paths, Workspace};
use crate::system::NoDepth;

/// Arguments of `gdtof stereo`.
#[derive(Args)]
pub(super) struct StereoArgs {
    /// Left picture (PNG), rectified.
    left: PathBuf,
    /// Right picture (PNG), rectified: a point is in the same row as in the left picture.
    right: PathBuf,
    #[command(flatten)]
    matching: MatchingArgs,
    #[command(flatten)]
    truth: TruthArgs,
    /// Folder for the results; created if missing.
    #[arg(long, short, value_name = "FOLDER", default_value = "stereo")]
    out: PathBuf,
    /// Match N times, and report the least and the median run time.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    repeat: u32,
    /// Print JSON instead of the table.
    #[arg(long)]
    json: bool,
}

/// What the disparities really are.
#[derive(Args)]
pub(super) struct TruthArgs {
    /// True disparities of the left picture (.npy, PFM, EXR or PNG, px; 0, NaN or infinite where unknown).
    #[arg(long, value_name = "FILE", requires = "left")]
    pub(super) truth: Option<PathBuf>,
    /// What its numbers count, px; a PNG needs it (KITTI: 0.00390625).
    #[arg(long, value_name = "PX", requires = "truth")]
    truth_unit: Option<f64>,
}

/// How to match.
#[derive(Args)]
struct MatchingArgs {
    /// Number of disparities to search, 1 to 256.
    #[arg(long, value_name = "N", default_value_t = Matcher::default().disparities)]
    disparities: usize,
    /// Smallest disparity to search, px.
    #[arg(
        long,
        value_name = "PX",
        default_value_t = 0,
        allow_negative_numbers = true
    )]
    min_disparity: i32,
    /// Number of paths along which costs are summed.
    #[arg(long, value_parser = paths_parser(), default_value = "5")]
    paths: Paths,
    /// Size of the census neighbourhood, columns x rows.
    #[arg(long, value_name = "COLSxROWS", default_value = "7x7")]
    census: String,
    /// Penalty for a step of one disparity.
    #[arg(long, value_name = "P", default_value_t = Matcher::default().p1)]
    p1: u8,
    /// Penalty for a larger step where the image is uniform.
    #[arg(long, value_name = "P", default_value_t = Matcher::default().p2)]
    p2: u8,
    /// How much worse the second-best disparity must be, per cent.
    #[arg(long, value_name = "PERCENT", default_value_t = Matcher::default().uniqueness_percent)]
    uniqueness: u32,
    /// How far left and right may disagree, px; "none" turns the check off.
    #[arg(long, value_name = "PX", default_value = "1")]
    left_right: String,
    /// Remove patches with fewer pixels than this.
    #[arg(long, value_name = "PX", default_value_t = Matcher::default().speckle_px)]
    speckle: usize,
    /// Leave out the median filter.
    #[arg(long)]
    no_median: bool,
}

/// One of the numbers of paths.
fn paths_parser() -> impl TypedValueParser<Value = Paths> {
    PossibleValuesParser::new(["3", "4", "5", "8"]).map(|number| {
        let mut all = Paths::ALL.into_iter();
        let paths = all.find(|paths| paths.number().to_string() == number);
        paths.expect("the same numbers")
    })
}

impl MatchingArgs {
    fn matcher(&self) -> Result<Matcher, InputError> {
        let census = (self.census.split_once('x'))
            .and_then(|(cols, rows)| Some((cols.parse().ok()?, rows.parse().ok()?)));
        let Some((cols, rows)) = census else {
            let message = format!(
                "{:?} is not a neighbourhood; give columns x rows such as 7x7",
                self.census
            );
            return Err(InputError::new("--census", message));
        };
        let left_right_px = match self.left_right.as_str() {
            "none" => None,
            px => Some(px.parse().map_err(|_| {
                let message = format!("{px:?} is not a number of pixels; give 0, 1, ... or none");
                InputError::new("--left-right", message)
            })?),
        };
        let matcher = Matcher {
            min_disparity: self.min_disparity,
            disparities: self.disparities,
            paths: self.paths,
            census: Census { cols, rows },
            p1: self.p1,
            p2: self.p2,
            uniqueness_percent: self.uniqueness,
            left_right_px,
            median: !self.no_median,
            speckle_px: self.speckle,
            ..Matcher::default()
        };
        Ok(Matcher {
            p2_least: matcher
                .p2_least
                .clamp(matcher.p1.min(matcher.p2), matcher.p2),
            ..matcher
        })
    }
}

/// What is wrong, and which option corrects it.
pub(super) fn cannot_match(left: &Path, right: &Path, error: &MatchError) -> InputError {
    let (what, cure) = match error {
        MatchError::Sizes { .. } => {
            let message = format!("{error} ({}); give a rectified pair", right.display());
            return InputError::new(left.display(), message);
        }
        MatchError::Disparities(_) => return InputError::new("--disparities", error.to_string()),
        MatchError::OutOfImage { .. } => ("--min-disparity", "give one within the image's width"),
        MatchError::Census { .. } => ("--census", "give odd ones such as 7x7"),
        MatchError::Penalties { .. } => ("--p1, --p2", "give smaller ones, P1 first"),
        MatchError::SpeckleStep(_) => ("--speckle", "give a positive one"),
        MatchError::Memory { .. } => ("--paths", "give 3 or 5, or smaller pictures"),
    };
    InputError::new(what, format!("{error}; {cure}"))
}

/// A picture as an image.
///
/// # Errors
/// When it cannot be read.
pub(super) fn read_image(path: &Path) -> Result<GreyImage, InputError> {
    let complain = |message: String| InputError::new(path.display(), message);
    let raster = Raster::read(path)?;
    let bits = match raster.white {
        255.0 => 8,
        65_535.0 => 16,
        _ => return Err(complain("is not a PNG; give a picture".into())),
    };
    let pixels = raster.values.iter().map(|v| v.round() as u16).collect();
    GreyImage::new(raster.width, raster.height, bits, pixels)
        .map_err(|error| complain(format!("is not a picture: {error}; give another")))
}

/// Errors of disparities against the truth, where that is known.
#[derive(Debug, Serialize)]
pub(super) struct Errors {
    /// Pixels whose truth is known.
    known: usize,
    /// Share of these that have a disparity, per cent.
    valid_percent: f64,
    /// Share of valid ones that are more than 2 px off, per cent.
    bad_2px_percent: f64,
    /// Share of known ones that are more than 2 px off or have none, per cent.
    bad_2px_or_invalid_percent: f64,
    /// Root mean square of valid ones, px.
    rms_px: f64,
    /// Half of the valid ones are off by no more, px.
    median_px: f64,
}

impl Errors {
    pub(super) fn new(map: &DisparityMap, truth: &[f32]) -> Self {
        let known = || {
            truth
                .iter()
                .zip(map.values_px())
                .filter(|(t, _)| t.is_finite())
        };
        let mut off_px: Vec<f64> = known()
            .filter(|(_, d)| !d.is_nan())
            .map(|(t, d)| (f64::from(*d) - f64::from(*t)).abs())
            .collect();
        off_px.sort_by(f64::total_cmp);
        let bad = off_px.iter().filter(|&&px| px > 2.0).count();
        let (known, valid) = (known().count(), off_px.len());
        let percent = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
        let squares: f64 = off_px.iter().map(|px| px * px).sum();
        Errors {
            known,
            valid_percent: percent(valid, known),
            bad_2px_percent: percent(bad, valid),
            bad_2px_or_invalid_percent: percent(known - valid + bad, known),
            rms_px: (squares / valid.max(1) as f64).sqrt(),
            median_px: off_px.get(valid / 2).copied().unwrap_or(f64::NAN),
        }
    }

    /// Adds them to a table.
    pub(super) fn rows(&self, table: &mut Table) {
        let percent = |value: f64| format!("{value:.2} %");
        table.push("true disparity known", self.known);
        table.push("  of these matched", percent(self.valid_percent));
        table.push(
            "  more than 2 px off, of those matched",
            percent(self.bad_2px_percent),
        );
        table.push(
            "  more than 2 px off or not matched",
            percent(self.bad_2px_or_invalid_percent),
        );
        table.push("  RMS error", format!("{:.3} px", self.rms_px));
        table.push("  median error", format!("{:.3} px", self.median_px));
    }
}

/// What is printed and kept.
#[derive(Serialize)]
struct Report {
    width: usize,
    height: usize,
    disparities: usize,
    paths: usize,
    matched: usize,
    /// Least and middle run time of all repetitions, s.
    run_time_s: [f64; 2],
    threads: usize,
    errors: Option<Errors>,
}

/// Runs the command.
///
/// # Errors
/// Bad input, and results that cannot be written.
pub(super) fn run(args: &StereoArgs) -> anyhow::Result<()> {
    let matcher = args.matching.matcher()?;
    let (left, right) = (read_image(&args.left)?, read_image(&args.right)?);
    let truth = args.truth.read(&left)?;
    let mut workspace = Workspace::default();
    let mut times_s = Vec::new();
    let mut matched = || {
        let start = Instant::now();
        let map = matcher.match_pair_in(&mut workspace, &left, &right);
        times_s.push(start.elapsed().as_secs_f64());
        map.map_err(|error| cannot_match(&args.left, &args.right, &error))
    };
    let mut map = matched()?;
    for _ in 1..args.repeat {
        map = matched()?;
    }
    times_s.sort_by(f64::total_cmp);
    let report = Report {
        width: map.width(),
        height: map.height(),
        disparities: matcher.disparities,
        paths: matcher.paths.number(),
        matched: map.matched(),
        run_time_s: [times_s[0], times_s[times_s.len() / 2]],
        threads: rayon::current_num_threads(),
        errors: truth.map(|truth| Errors::new(&map, &truth)),
    };
    let set = ResultSet::begin(&args.out, "stereo")?;
    let shape = [map.height(), map.width()];
    write_npy_f32(
        &set.staging().join("disparity.npy"),
        &shape,
        map.values_px(),
    )?;
    disparity_picture(&matcher, &map, &set.staging().join("disparity.png"))?;
    OutputFile::write_with(&set.staging().join("stereo.json"), |w| {
        serde_json::to_writer_pretty(&mut *w, &report)?;
        writeln!(w)
    })?;
    notes(set.commit([&args.left, &args.right])?);
    if args.json {
        say_json(&report)?
    } else {
        say_unless_quiet(table(args, &report))?
    }
    Ok(())
}

impl TruthArgs {
    /// The disparities, px, as many as `left` has pixels; NaN where unknown.
    ///
    /// # Errors
    /// As [`Raster::read_map`], a unit that is none, and another shape.
    pub(super) fn read(&self, left: &GreyImage) -> Result<Option<Vec<f32>>, InputError> {
        let Some(path) = &self.truth else {
            return Ok(None);
        };
        if let Some(unit) = self.truth_unit.filter(|unit| !(1e-6..=1e6).contains(unit)) {
            let message = format!("{unit} is impossible; give 1e-6 to 1e6 px");
            return Err(InputError::new("--truth-unit", message));
        }
        let truth = Raster::read_map(path, self.truth_unit, "--truth-unit (0.00390625 for KITTI)")?;
        if (truth.width, truth.height) == (left.width(), left.height()) {
            let known = |px: &f32| if *px > 0.0 { *px } else { f32::NAN };
            return Ok(Some(truth.values.iter().map(known).collect()));
        }
        let message = format!(
            "has {} x {} values and the pictures {} x {} pixels; give the truth of these pictures",
            truth.width,
            truth.height,
            left.width(),
            left.height()
        );
        Err(InputError::new(path.display(), message))
    }
}

/// Draws disparities; near is yellow as in pictures of depth.
///
/// # Errors
/// When the file cannot be written.
pub(super) fn disparity_picture(
    matcher: &Matcher,
    map: &DisparityMap,
    path: &Path,
) -> Result<(), InputError> {
    let cells: Vec<ImageCell> = (map.values_px().iter())
        .map(|&d| {
            if d.is_nan() {
                ImageCell::Category(0)
            } else {
                ImageCell::Depth(d)
            }
        })
        .collect();
    let known = || map.values_px().iter().copied().filter(|d| !d.is_nan());
    let least = known().fold(f32::INFINITY, f32::min).floor();
    let most = known().fold(f32::NEG_INFINITY, f32::max).ceil();
    let first = matcher.min_disparity as f32;
    let picture = DepthImage {
        title: "Disparity",
        cols: map.width(),
        cells: &cells,
        range_m: if least < most {
            (most, least)
        } else {
            (first + matcher.disparities as f32, first)
        },
        unit: "px",
        categories: &[Category {
            name: "none",
            pattern: NoDepth::NoGuide.pattern(),
        }],
        scale: (512 / map.width()).max(1),
    };
    picture.write_png(path)
}

fn table(args: &StereoArgs, report: &Report) -> Table {
    let pixels = report.width * report.height;
    let mut table = Table::new(format!(
        "{} and {}, {} disparities, {} paths",
        args.left.display(),
        args.right.display(),
        report.disparities,
        report.paths
    ))
    .row("matched", format!("{} of {pixels}", report.matched));
    if let Some(errors) = &report.errors {
        errors.rows(&mut table);
    }
    let [least, middle] = report.run_time_s.map(|s| format!("{:.1} ms", 1e3 * s));
    let threads = report.threads;
    let times = match args.repeat {
        1 => least,
        n => format!("{least} least, {middle} median of {n}"),
    };
    table.push("run time", format!("{times}, {threads} threads"));
    table.push(
        format!("in {}", args.out.display()),
        ["disparity.png", "disparity.npy", "stereo.json", MANIFEST].join(" "),
    );
    table
}
