//! Claim 19 and Fig. 71 from simulated guides: the smallest bins that keep 99.7 % of a camera pair's estimates in their windows, by the
//! windows that the chips' own laws open.
//!
//! ```text
//!   wall ─► stereo guide, 64×64 ─► start values (window law at this CLK) ─► share of walls inside ≥ 99.73 %?
//!                                        ▲                                         │ no: longer bins
//!                                        └─────────────────────────────────────────┘
//! ```

use super::claim::ClaimRow;
use super::parameters::HSLIDAR_BIN_M;
use super::stereo::{DEPTHS_M, HSLIDAR_STEP_BINS, PAIR, THIRD_PX, wall_at};
use super::thesis::{chart, claim};
use crate::chip::{Exposure, SensorConfig, WindowLaw, hslidar};
use crate::guide::{BehaviouralStereo, Guide, GuideInput, MatchedStereo};
use crate::report::Chart;
use crate::scene::{GroundTruth, Scene};
use crate::theory::design::{three_sigma, tolerated_sigma};
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time, TimeOfFlight};

/// Maps behind each number: 32 768 estimates, of which 88 may be outside, give or take 9.
const MAPS: u32 = 8;

/// How far apart the walls of two maps are, m: all places within a step of HSLIDAR's windows come in turn.
const APART_M: f64 = 0.5;

/// What is expected of Eq. 25, ±3σ of a normal distribution.
const WITHIN: f64 = 0.997_300_2;

/// Bins are tried in steps of 1 %.
const FINER: f64 = 1.01;

/// Estimates of `guide` and true ranges before walls about `depth_m`, m.
fn estimates_m(guide: &dyn Guide, depth_m: f64) -> Vec<(f64, f64)> {
    let of_wall = |number: u32| {
        let off_m = APART_M * (f64::from(number) - 0.5 * f64::from(MAPS - 1));
        let scene = wall_at(depth_m + off_m);
        let truth = GroundTruth::render(&scene, 64, 64);
        let map = guide.estimate(&GuideInput::still(&scene, 64, 64, number.into()));
        let map = map.expect("a camera pair always has a map");
        let pairs = map.range_m.into_iter().zip(truth.range_m);
        let pairs = pairs.filter_map(|(guide_m, true_m)| Some((guide_m?, true_m?)));
        pairs.collect::<Vec<_>>()
    };
    (0..MAPS).flat_map(of_wall).collect()
}

/// The smallest window that is centred on every estimate and holds the truth for all but 0.27 % of them, m.
fn least_window_m(depth_m: f64) -> f64 {
    let mut off_m: Vec<f64> = estimates_m(&BehaviouralStereo, depth_m)
        .iter()
        .map(|(guide_m, true_m)| (guide_m - true_m).abs())
        .collect();
    off_m.sort_by(f64::total_cmp);
    let last = (WITHIN * off_m.len() as f64).ceil() as usize - 1;
    2.0 * off_m[last]
}

/// The share of estimates by the camera pair that matches images, before walls about `depth_m` and on the built-in street, which are off
/// by no more than half of the window: as long as `window_m` says of the true range, m.
fn matched_within(depth_m: f64, window_m: impl Fn(f64) -> f64) -> [f64; 2] {
    let matched = MatchedStereo::default();
    let of_street = || {
        let scene = Scene::outdoor();
        let truth = GroundTruth::render(&scene, 64, 64);
        let map = matched.estimate(&GuideInput::still(&scene, 64, 64, 0));
        let map = map.expect("a camera pair always has a map");
        let pairs = map.range_m.into_iter().zip(truth.range_m);
        pairs
            .filter_map(|(guide_m, true_m)| Some((guide_m?, true_m?)))
            .collect()
    };
    let within =
        |(guide_m, true_m): &&(f64, f64)| (guide_m - true_m).abs() <= 0.5 * window_m(*true_m);
    [estimates_m(&matched, depth_m), of_street()].map(|estimates: Vec<_>| {
        estimates.iter().filter(within).count() as f64 / estimates.len() as f64
    })
}

/// The smallest bin with the windows that `sensor` opens, whose bins are CLK periods: the first bin, from `from_m` on, with which its
/// start values hold as many. CLK periods at which no window can be aimed are passed over.
fn least_bin_of_sensor_m(depth_m: f64, sensor: &SensorConfig, from_m: f64) -> f64 {
    let estimates = estimates_m(&BehaviouralStereo, depth_m);
    let farthest_m = estimates
        .iter()
        .fold(0.0f64, |far, e| far.max(e.0).max(e.1));
    let least_inside = (WITHIN * estimates.len() as f64).ceil() as usize;
    let most_outside = estimates.len() - least_inside;
    let mut bin_m = from_m;
    loop {
        let config = SensorConfig {
            clk_hz: SPEED_OF_LIGHT_M_PER_S / (2.0 * bin_m),
            ..sensor.clone()
        };
        let periods = (farthest_m / bin_m).ceil() as u32 + 4 * config.bins as u32 + 64;
        let law = WindowLaw::new(&config, &Exposure::new(&config, periods, 1));
        let is_inside = |&(guide_m, true_m): &(f64, f64)| {
            let start = law.start_for(Time::of_flight(guide_m));
            let window = start.and_then(|start| law.window(start).open());
            window.is_some_and(|window| law.interval(&window).contains(&Time::of_flight(true_m)))
        };
        // One more than may be outside tells of the bin: most bins are much too small.
        let outside = estimates.iter().filter(|e| !is_inside(e));
        if outside.take(most_outside + 1).count() <= most_outside {
            return bin_m;
        }
        bin_m *= FINER;
        // Beyond this the start values no longer reach the wall, or the wall is gone.
        if bin_m > farthest_m {
            return f64::INFINITY;
        }
    }
}

/// Claim 19: the smallest bins that a stereo guide allows.
pub(super) fn bin_rows() -> Vec<ClaimRow> {
    let claim = claim(19);
    let hslidar_sigma_m = 8.0 * HSLIDAR_BIN_M / 6.0;
    let reach = |sigma_m: f64| (sigma_m * PAIR.focal_px * PAIR.baseline_m / THIRD_PX).sqrt();
    let on_steps = tolerated_sigma(8.0, HSLIDAR_STEP_BINS, three_sigma());
    let quantic = |z_m| PAIR.least_bin_m(z_m, THIRD_PX, 16);
    let (primary, contingency) = (SensorConfig::default(), hslidar());
    let centred = least_window_m(100.0) / primary.bins as f64;
    let by_primary = least_bin_of_sensor_m(100.0, &primary, 0.5 * centred);
    let by_contingency = least_bin_of_sensor_m(100.0, &contingency, centred);
    // Eq. 25 takes 1/3 px; the rig's disparities are rounded to 1/16 px besides.
    let rig_px = libm::hypot(THIRD_PX, 1.0 / 16.0 / 12f64.sqrt());
    let on_grid = |bins, step| {
        PAIR.least_bin_on_grid_m(100.0, rig_px, bins, step)
            .unwrap_or(f64::INFINITY)
    };
    let [on_walls, on_street] = matched_within(100.0, |z_m| 16.0 * quantic(z_m));
    let fig_71 = "Fig. 71 is drawn from the measured spread (Fig. 67), whose values are not printed; these use ⅓ px.";
    vec![
        claim.row("matched_street", 100.0 * on_street),
        claim.row("matched_walls", 100.0 * on_walls),
        claim.row("simulated", centred / PAIR.least_bin_m(100.0, rig_px, 16)),
        claim.row("simulated_quantic", by_primary).remark(format!("CLK period by CLK period, in steps of 1 %; with centres on the grid of bins the formula gives {:.3} m.", on_grid(16, 1.0))),
        claim.row("simulated_hslidar", by_contingency).remark(format!("Windows of 8 bins step by 4; with centres on that grid the formula gives {:.3} m.", on_grid(8, 4.0))),
        claim.row("quantic_100_m", quantic(100.0)).remark(fig_71),
        claim.row("quantic_200_m", quantic(200.0)),
        claim.row("hslidar_100_m", PAIR.least_bin_m(100.0, THIRD_PX, 8)),
        claim.row("hslidar_100_m_on_steps", PAIR.least_bin_on_grid_m(100.0, THIRD_PX, 8, HSLIDAR_STEP_BINS)
                .unwrap_or(f64::INFINITY)),
        claim.row("reach", reach(hslidar_sigma_m)),
        claim.row("reach_on_steps", on_steps.map_or(0.0, |bins| reach(bins * HSLIDAR_BIN_M))),
    ]
}

/// Fig. 71: the least bin interval against distance, both sensors.
pub(super) fn figure_71() -> Chart {
    let depths = || (10..=200).step_by(2).map(f64::from);
    let least = |bins: u32| depths().map(move |z_m| (z_m, PAIR.least_bin_m(z_m, THIRD_PX, bins)));
    let windows = DEPTHS_M.map(|z_m| (z_m, least_window_m(z_m)));
    let simulated = |bins: f64| windows.map(|(z_m, window_m)| (z_m, window_m / bins));
    let on_grid = |bins: u32, step: f64| {
        depths().filter_map(move |z_m| {
            Some((z_m, PAIR.least_bin_on_grid_m(z_m, THIRD_PX, bins, step)?))
        })
    };
    chart(71)
        .line("primary: QuantIC4x4, 16 bins", least(16))
        .line("contingency: HSLIDAR, 8 bins", least(8))
        .points("simulated guide, 16 bins", simulated(16.0))
        .points("simulated guide, 8 bins", simulated(8.0))
        .dashed("QuantIC4x4, centres on the bin grid", on_grid(16, 1.0))
        .dashed("HSLIDAR clocked, steps of 4 bins", on_grid(8, 4.0))
}
