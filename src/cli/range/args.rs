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
    /// Counts of any sensor, zones x bins (.npy, .npz, .json, or text with a line for each zone), with the bins that options describe.
    Counts,
    /// A log of an ams TMF8820, TMF8821 or TMF8828 with lines #Raw.
    Tmf882x,
    /// A log of an ams TMF8829 with a Result_Set (JSON, packed by gzip or not).
    Tmf8829,
    /// A log of an ST VL53L5, VL53L7 or VL53L8 with lines "Agg, zone, word, ambient, word, values".
    Cnh,
}

/// Which events a histogram counts.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Counts {
    /// Every event: every photon, unless the detector's description has a coincidence.
    Every,
    /// The first event of each laser cycle.
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
    /// Description of the detector (TOML) with the keys bin_width_ns or bin_edges_ns, start_ns, pulse_fwhm_ns, counts, laser_cycles,
    /// most_counts and coincidence; for all formats but frame and tmf8820, as the next eight options, which replace what it says.
    #[arg(long, value_name = "FILE")]
    pub(super) detector: Option<PathBuf>,
    /// Length of a bin, ns.
    #[arg(long, value_name = "NS")]
    pub(super) bin_width_ns: Option<f64>,
    /// Full width at half maximum of the laser pulse with all jitter, ns.
    #[arg(long, value_name = "NS")]
    pub(super) pulse_fwhm_ns: Option<f64>,
    /// When bin 0 begins after the centre of the laser pulse has left, ns [default: that of the reference histogram, or 0].
    #[arg(long, value_name = "NS", allow_negative_numbers = true)]
    pub(super) start_ns: Option<f64>,
    /// Bins to look at, from 0, as in 4-50 [default: all].
    #[arg(long, value_name = "FIRST-LAST")]
    pub(super) bins: Option<String>,
    /// Which events a histogram counts [default: every].
    #[arg(long, value_enum)]
    pub(super) counts: Option<Counts>,
    /// Laser cycles of a histogram, which --counts first and a coincidence need.
    #[arg(long, value_name = "N")]
    pub(super) laser_cycles: Option<u32>,
    /// Light of a cover glass: a file with captures without a target, in the same format, or `fit` for the echo nearest to the sensor in the
    /// sum of all captures.
    #[arg(long, value_name = "FILE|fit")]
    pub(super) crosstalk: Option<PathBuf>,
    /// Counts for each unit of a file's numbers, where they are rates (counts, cnh) [default: they are counts].
    #[arg(long, value_name = "N")]
    pub(super) counts_per_unit: Option<f64>,
    /// All but tmf8820: share of macropixels or zones without an echo that may get a depth [default: 0.001].
    #[arg(long, value_name = "P")]
    pub(super) false_alarm_rate: Option<f64>,
    /// All but tmf8820: do not correct depths for the range walk of strong echoes.
    #[arg(long)]
    pub(super) no_walk_correction: bool,
    /// File for the depths (CSV). tmf8820: capture,zone,true_m,depth_m,sensor_m; frame:
    /// row,col,start,true_m,guide_m,depth_m,bound_m,spread_m,photons_per_cycle,confidence,no_depth and
    /// depth_N_m,bound_N_m,photons_per_cycle_N of the further returns, N from 2 to 4; others:
    /// capture,zone,depth_m,bound_m,no_bound,spread_m,photons,confidence,no_depth,sensor_m and the further returns, whose photons are those of the
    /// whole histogram.
    #[arg(long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,
    /// Print JSON instead of tables.
    #[arg(long)]
    pub(super) json: bool,
}
