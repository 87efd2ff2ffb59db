//! Claim 28: the published sensors of Tables 5 and 16, and what their partial histograms cost in one common light.

use super::claim::Row;
use super::penalty::demonstrator;
use super::published::Published::*;
use crate::report::{Axis, Chart, Grid, Style};
use crate::theory::partial::{System, sliding_reduction, zooming_reduction};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// How a sensor makes do with its bins.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Scheme {
    /// All bins at once, or no histogram at all.
    Full,
    /// Zooming over so many steps.
    Zooming(u32),
    /// Sliding over so many windows that share so many bins.
    Sliding(u32, u32),
    /// One window that a guide chooses.
    Guided,
}

/// A line of Tables 5 and 16.
struct Sensor {
    author: &'static str,
    year: u32,
    /// Rows and columns of ToF pixels.
    pixels: (u32, u32),
    max_range_m: f64,
    bins: Option<u32>,
    scheme: Scheme,
    stacked: bool,
}

const fn sensor(
    author: &'static str,
    year: u32,
    pixels: (u32, u32),
    max_range_m: f64,
    bins: Option<u32>,
    scheme: Scheme,
    stacked: bool,
) -> Sensor {
    Sensor {
        author,
        year,
        pixels,
        max_range_m,
        bins,
        scheme,
        stacked,
    }
}

/// Tables 5 and 16. Steps are those of section 2.5.2; Taloud's windows are not disclosed and taken as Stoppa's.
const SENSORS: [Sensor; 13] = [
    sensor(
        "Ximenes [139]",
        2018,
        (64, 128),
        300.0,
        None,
        Scheme::Full,
        true,
    ),
    sensor(
        "Henderson [108]",
        2019,
        (64, 64),
        50.0,
        Some(16),
        Scheme::Full,
        true,
    ),
    sensor(
        "Zhang [52]",
        2019,
        (144, 252),
        50.0,
        Some(8),
        Scheme::Zooming(3),
        false,
    ),
    sensor(
        "Okino [148]",
        2020,
        (900, 1200),
        250.0,
        None,
        Scheme::Full,
        false,
    ),
    sensor(
        "Kim [53]",
        2021,
        (40, 48),
        45.0,
        Some(2),
        Scheme::Zooming(8),
        false,
    ),
    sensor(
        "Kumagai [55]",
        2021,
        (63, 168),
        200.0,
        None,
        Scheme::Full,
        true,
    ),
    sensor(
        "Preethi [109]",
        2021,
        (128, 256),
        100.0,
        None,
        Scheme::Full,
        true,
    ),
    sensor(
        "Gyongy [146]",
        2021,
        (32, 64),
        50.0,
        Some(8),
        Scheme::Sliding(16, 0),
        false,
    ),
    sensor(
        "Stoppa [54]",
        2021,
        (60, 80),
        4.4,
        Some(32),
        Scheme::Sliding(16, 6),
        true,
    ),
    sensor(
        "Zhang [143]",
        2021,
        (160, 240),
        9.5,
        Some(32),
        Scheme::Zooming(2),
        true,
    ),
    sensor(
        "Park [145]",
        2022,
        (60, 80),
        45.0,
        Some(4),
        Scheme::Zooming(4),
        false,
    ),
    sensor(
        "Taloud [144]",
        2022,
        (32, 42),
        8.2,
        Some(59),
        Scheme::Sliding(16, 6),
        true,
    ),
    sensor(
        "this work",
        2023,
        (32, 64),
        75.0,
        Some(8),
        Scheme::Guided,
        false,
    ),
];

impl Sensor {
    /// Bins of the full histogram that it stands for.
    fn equivalent_bins(&self) -> Option<f64> {
        let bins = f64::from(self.bins?);
        match self.scheme {
            Scheme::Full => Some(bins),
            Scheme::Zooming(steps) => Some(bins / zooming_reduction(self.bins?, steps)),
            Scheme::Sliding(windows, overlap) => {
                Some(bins / sliding_reduction(self.bins?, windows, overlap))
            }
            Scheme::Guided => Some((self.max_range_m / super::design::HSLIDAR_BIN_M).ceil()),
        }
    }

    /// Its bin interval if the equivalent histogram just spans the range, m.
    fn bin_m(&self) -> Option<f64> {
        Some(self.max_range_m / self.equivalent_bins()?)
    }

    /// Laser power penalty at its greatest range in the demonstrator's light (Table 15), to a precision of one bin.
    fn penalty(&self) -> Option<f64> {
        let (bins, bin_m) = (self.bins?, self.bin_m()?);
        let common = demonstrator();
        let mut goal = common.goal;
        goal.precision_m = bin_m;
        // The pulse that suits the bin: a = 1.5 σ (Eq. 21).
        let bin_s = 2.0 * bin_m / SPEED_OF_LIGHT_M_PER_S;
        let mut link = common.link;
        link.pulse_sigma_s = bin_s / 1.5;
        let system = System::new(link, goal, common.models, bins, bin_s);
        let z_m = self.max_range_m;
        let cost = match self.scheme {
            Scheme::Full | Scheme::Guided => system.full(z_m),
            Scheme::Zooming(_) => system.zooming(z_m),
            Scheme::Sliding(_, overlap) => system.sliding(z_m, overlap),
        };
        Some(cost.laser_cycles() / system.full(z_m).laser_cycles())
    }

    fn scheme_text(&self) -> String {
        match self.scheme {
            Scheme::Full => "none".into(),
            Scheme::Zooming(steps) => format!("zooming, {steps} steps"),
            Scheme::Sliding(windows, 0) => format!("sliding, {windows} windows"),
            Scheme::Sliding(windows, overlap) => {
                format!("sliding, {windows} windows, {overlap} shared")
            }
            Scheme::Guided => "guided".into(),
        }
    }
}

/// Claim 28: histogram reduction ratios, and the place of the demonstrator.
pub(super) fn rows() -> Vec<Row> {
    let inverse = |bins, steps| 1.0 / zooming_reduction(bins, steps);
    let widest = |stacked: bool| {
        let bins = SENSORS
            .iter()
            .filter(|s| s.stacked == stacked)
            .filter_map(|s| s.bins);
        f64::from(bins.max().unwrap_or(0))
    };
    let span = 1.0 / sliding_reduction(32, 16, 6) * 32.0;
    vec![
        Row::holds(
            "1/HRR of Zhang 2019: 8 bins, 3 steps",
            "",
            Exactly("64"),
            inverse(8, 3),
        ),
        Row::holds(
            "1/HRR of Kim 2021: 2 bins, 8 steps",
            "",
            Exactly("128"),
            inverse(2, 8),
        ),
        Row::holds(
            "bins that Park's 4 steps of 4 and Kim's 8 of 2 stand for",
            "",
            Says(
                "effectively covers 4 histogram bins at each zoom step",
                1.0,
                1.0,
            ),
            4.0 * inverse(4, 4) / (2.0 * inverse(2, 8)),
        )
        .remark("Their ratio: halving the steps by doubling the bins changes nothing."),
        Row::ours(
            "bins that Stoppa's 16 windows of 32, 6 shared, stand for",
            "",
            span,
        ),
        Row::holds(
            "most bins of a sensor that is not stacked",
            "",
            AtMost("8"),
            widest(false),
        )
        .given("Read from the same Table 5.")
        .aside(),
        Row::ours("most bins of a stacked sensor", "", widest(true)),
    ]
}

/// Tables 5 and 16 through the same theory.
pub(super) fn table() -> Grid {
    let mut grid = Grid::new([
        "sensor",
        "year",
        "ToF pixels",
        "range (m)",
        "bins",
        "stacked",
        "partial histogram",
        "stands for bins",
        "bin (m)",
        "penalty (×)",
    ]);
    let show = |value: Option<f64>, decimals: usize| {
        value.map_or("-".to_owned(), |v| format!("{v:.decimals$}"))
    };
    for sensor in &SENSORS {
        grid.push([
            sensor.author.to_owned(),
            sensor.year.to_string(),
            format!("{} × {}", sensor.pixels.0, sensor.pixels.1),
            sensor.max_range_m.to_string(),
            sensor.bins.map_or("-".to_owned(), |bins| bins.to_string()),
            if sensor.stacked { "yes" } else { "no" }.to_owned(),
            sensor.scheme_text(),
            show(sensor.equivalent_bins(), 0),
            show(sensor.bin_m(), 3),
            show(sensor.penalty(), 1),
        ]);
    }
    grid
}

/// Fig. 28: bins per pixel by year.
pub(super) fn figure_28() -> Vec<Chart> {
    let bins = |stacked: bool| {
        let of_kind = SENSORS.iter().filter(move |s| s.stacked == stacked);
        of_kind.filter_map(|s| Some((f64::from(s.year), f64::from(s.bins?))))
    };
    vec![
        Chart::new(
            "Histogram bins per ToF pixel of published sensors",
            Axis::linear("year").between(2018.0, 2024.0),
            Axis::linear("bins").between(0.0, 64.0),
        )
        .with("stacked", Style::Points, bins(true))
        .with("one tier", Style::Points, bins(false)),
    ]
}
