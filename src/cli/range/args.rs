//! Arguments of `gdtof range`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// JSON captures of an ams TMF8820.
    Tmf8820,
    /// Counts of a sensor like ours, rows x columns x bins (.npy), in the windows of a frame.json.
    Frame,
    /// Counts of any sensor, zones x bins (.npy, or text with a line for each zone), with the bins that options describe.
    Counts,
}

/// Which photons a histogram counts.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Counts {
    /// Every photon.
    Every,
    /// The first photon of each laser cycle.
    First,
}

/// Captures that a calibration is fitted on; the others are reported.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(super) enum Fit {
    /// Every second capture, from the first.
    Even,
    /// Every second capture, from the second.
    Odd,
    /// The nearer half.
    Near,
    /// The farther half.
    Far,
}

/// Arguments of `gdtof range`.
#[derive(Args)]
pub(in crate::cli) struct RangeArgs {
    /// File with the histograms.
    #[arg(long, value_name = "FILE")]
    pub(super) histograms: PathBuf,
    /// Format of the file.
    #[arg(long, value_enum)]
    pub(super) format: Format,
    /// tmf8820: captures to calibrate on, by their true distances; depths and errors are given for the others
    /// [default: even].
    #[arg(long, value_enum, conflicts_with = "calibration")]
    pub(super) fit: Option<Fit>,
    /// tmf8820: calibration to use instead, on all captures. frame: bin profile of the sensor's delay lines, from
    /// `gdtof calibrate`.
    #[arg(long, value_name = "FILE")]
    pub(super) calibration: Option<PathBuf>,
    /// tmf8820: file to save the calibration to (JSON).
    #[arg(long, value_name = "FILE", conflicts_with = "calibration")]
    pub(super) save_calibration: Option<PathBuf>,
    /// frame: frame.json with sensor, scene, exposure and start values [default: the one beside the histograms].
    #[arg(long, value_name = "FILE")]
    pub(super) frame: Option<PathBuf>,
    /// counts: length of a bin, ns.
    #[arg(long, value_name = "NS")]
    pub(super) bin_width_ns: Option<f64>,
    /// counts: when the first bin begins after the laser pulse has left, ns [default: 0].
    #[arg(long, value_name = "NS", allow_negative_numbers = true)]
    pub(super) start_ns: Option<f64>,
    /// counts: laser cycles of a histogram.
    #[arg(long, value_name = "N")]
    pub(super) laser_cycles: Option<u32>,
    /// counts: full width at half maximum of the laser pulse with all jitter, ns.
    #[arg(long, value_name = "NS")]
    pub(super) pulse_fwhm_ns: Option<f64>,
    /// counts: which photons a histogram counts [default: every].
    #[arg(long, value_enum)]
    pub(super) counts: Option<Counts>,
    /// frame, counts: share of macropixels without an echo that may get a depth [default: 0.001].
    #[arg(long, value_name = "P")]
    pub(super) false_alarm_rate: Option<f64>,
    /// frame, counts: do not correct depths for the range walk of strong echoes.
    #[arg(long)]
    pub(super) no_walk_correction: bool,
    /// File for the depths (CSV). tmf8820: capture,zone,true_m,depth_m,sensor_m; frame:
    /// row,col,start,true_m,guide_m,depth_m,bound_m,spread_m,photons,confidence,no_depth and
    /// depth_N_m,bound_N_m,photons_N of the further returns, N from 2 to 4; counts: zone,depth_m,bound_m,spread_m,photons,confidence,no_depth
    /// and the further returns.
    #[arg(long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,
    /// Print JSON instead of tables.
    #[arg(long)]
    pub(super) json: bool,
}
