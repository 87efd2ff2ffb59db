//! Claim 19 and Fig. 71 from simulated guides: the smallest bins that keep 99.7 % of a camera pair's estimates in their windows, by the
//! windows that the chips' own laws open.
//!
//! ```text
//!   wall ─► stereo guide, 64×64 ─► start values (window law at this CLK) ─► share of walls inside ≥ 99.73 %?
//!                                        ▲                                         │ no: longer bins
//!                                        └─────────────────────────────────────────┘
//! ```

use super::stereo::wall_at;
use crate::chip::{Exposure, SensorConfig, WindowLaw};
use crate::guide::{BehaviouralStereo, Guide, GuideInput, MatchedStereo};
use crate::scene::GroundTruth;
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time};

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
pub(super) fn least_window_m(depth_m: f64) -> f64 {
    let mut off_m: Vec<f64> = estimates_m(&BehaviouralStereo, depth_m)
        .iter()
        .map(|(guide_m, true_m)| (guide_m - true_m).abs())
        .collect();
    off_m.sort_by(f64::total_cmp);
    let last = (WITHIN * off_m.len() as f64).ceil() as usize - 1;
    2.0 * off_m[last]
}

/// The share of estimates by the camera pair that matches images which are off by no more than half of `window_m`.
pub(super) fn matched_within(depth_m: f64, window_m: f64) -> f64 {
    let estimates = estimates_m(&MatchedStereo::default(), depth_m);
    let within = |(guide_m, true_m): &&(f64, f64)| (guide_m - true_m).abs() <= 0.5 * window_m;
    estimates.iter().filter(within).count() as f64 / estimates.len() as f64
}

/// The smallest bin with the windows that `sensor` opens, whose bins are CLK periods: the first bin, from `from_m` on, with which its
/// start values hold as many. CLK periods at which no window can be aimed are passed over.
pub(super) fn least_bin_of_sensor_m(depth_m: f64, sensor: &SensorConfig, from_m: f64) -> f64 {
    let estimates = estimates_m(&BehaviouralStereo, depth_m);
    let farthest_m = estimates
        .iter()
        .fold(0.0f64, |far, e| far.max(e.0).max(e.1));
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
        let inside = estimates.iter().filter(|e| is_inside(e)).count();
        if inside as f64 >= WITHIN * estimates.len() as f64 {
            return bin_m;
        }
        bin_m *= FINER;
        // Beyond this the start values no longer reach the wall, or the wall is gone.
        if bin_m > farthest_m {
            return f64::INFINITY;
        }
    }
}
