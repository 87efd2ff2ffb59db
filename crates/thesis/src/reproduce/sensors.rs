//! Claim 28: the published sensors of Tables 5 and 16, and what their partial histograms cost in one common light.

use super::claim::ClaimRow;
use super::parameters::{HSLIDAR_BIN_M, demonstrator};
use super::thesis::{PublishedSensor, Scheme, THESIS, chart, claim, grid};
use crate::report::{Chart, Grid};
use crate::theory::partial::{System, sliding_reduction, zooming_reduction};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

impl PublishedSensor {
    /// Bins of the full histogram that it stands for.
    fn equivalent_bins(&self) -> Option<f64> {
        let bins = f64::from(self.bins?);
        match self.scheme {
            Scheme::Full => Some(bins),
            Scheme::Zooming(steps) => Some(bins / zooming_reduction(self.bins?, steps)),
            Scheme::Sliding(windows, overlap) => {
                Some(bins / sliding_reduction(self.bins?, windows, overlap))
            }
            Scheme::Guided => Some((self.max_range_m / HSLIDAR_BIN_M).ceil()),
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
pub(super) fn rows() -> Vec<ClaimRow> {
    let claim = claim(28);
    let inverse = |bins, steps| 1.0 / zooming_reduction(bins, steps);
    let widest = |stacked: bool| {
        let bins = THESIS
            .sensors
            .iter()
            .filter(|s| s.stacked == stacked)
            .filter_map(|s| s.bins);
        f64::from(bins.max().unwrap_or(0))
    };
    let span = 1.0 / sliding_reduction(32, 16, 6) * 32.0;
    vec![
        claim.row("zhang", inverse(8, 3)),
        claim.row("kim", inverse(2, 8)),
        claim.row("park_over_kim", 4.0 * inverse(4, 4) / (2.0 * inverse(2, 8))),
        claim.row("stoppa", span),
        claim.row("widest_single", widest(false)),
        claim.row("widest_stacked", widest(true)),
    ]
}

/// Tables 5 and 16 through the same theory.
pub(super) fn table() -> Grid {
    let mut grid = grid(16);
    let show = |value: Option<f64>, decimals: usize| {
        value.map_or("-".to_owned(), |v| format!("{v:.decimals$}"))
    };
    for sensor in &THESIS.sensors {
        grid.push([
            sensor.author.clone(),
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
pub(super) fn figure_28() -> Chart {
    let bins = |stacked: bool| {
        let of_kind = THESIS.sensors.iter().filter(move |s| s.stacked == stacked);
        of_kind.filter_map(|s| Some((f64::from(s.year), f64::from(s.bins?))))
    };
    chart(28)
        .points("stacked", bins(true))
        .points("one tier", bins(false))
}
