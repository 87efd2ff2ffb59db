//! What disturbs flash lidars on the road, and what it costs guided, full, sliding and zooming histograms: other lidars, a retroreflector's
//! halo, light that comes by way of a wall.
//!
//! ```text
//!   interference   ten vehicles with the demonstrator's lidar share the street: five oncoming ones shine straight into the lens, which throws
//!                  half a per cent of that over the array; the others light what we light
//!   sign           a road sign beside a pedestrian at 30 m, in a lens that scatters more and more
//!   corner         a wall beside a target at 30 m throws laser light on it: an echo that comes later
//! ```
//!
//! That guiding mitigates interference is claimed at the end of the thesis (8.2), and not measured there. Lasers of 80 kHz whose clocks are
//! equal make echoes that stand still at a random time of the laser cycle; a macropixel that looks there is wrong. Everything is drawn again
//! and again, with other phases and photons. Macropixels of one draw are hit together, so that intervals are those of as many
//! trials as there are draws.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::Demonstrator;
use super::scenes::{busy_street, corner, sign};
use super::schemes;
use crate::guide::{BehaviouralStereo, Guide, GuideInput};
use crate::numerics::intervals::{Estimate, share};
use crate::scene::{GroundTruth, Scene};
use crate::system::FrameError;

/// Macropixels that are looked at: each tells the same of a draw, and more draws tell more.
const LOOKED_AT: usize = 12;
/// Crystals keep their rate to that, ppm; those of vehicles are spread evenly over it.
const CRYSTAL_PPM: f64 = 20.0;
/// Full histograms in the memory of the guided chip: those of as many macropixels less; the others have no depth.
const EQUAL_SILICON: &str = "full, equal silicon";
/// Dither, ns.
const DITHER_NS: f64 = 1000.0;

/// Worlds that differ in what disturbs them.
pub struct Disturbance {
    /// What it is.
    pub name: &'static str,
    /// What is looked at: objects whose name begins so.
    target: &'static str,
    /// Each case and its world; the first one is undisturbed.
    pub cases: Vec<(String, Scene)>,
    /// Draws of each.
    pub draws: u64,
}

/// What one scheme makes of one case.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct DisturbanceOutcome {
    /// Name of the case.
    pub case: String,
    /// Name of the scheme.
    pub scheme: &'static str,
    /// Bins of memory that a macropixel needs.
    pub bins: usize,
    /// Share of macropixels whose depth is wrong by more than a bin: value and ends of its 95 % interval.
    pub wrong: [f64; 3],
    /// The same of those without a depth.
    pub lost: [f64; 3],
    /// Mean error of the depths that are right, m.
    pub mean_error_m: Option<f64>,
}

impl Disturbance {
    /// Ten vehicles.
    pub fn interference() -> Self {
        let street = busy_street();
        let changed = |change: fn(&mut Scene)| {
            let mut street = street.clone();
            change(&mut street);
            street
        };
        let cases = [
            (
                "no other lidar",
                changed(|street| street.interferers.clear()),
            ),
            ("equal clocks", street.clone()),
            (
                "crystals, 20 ppm",
                changed(|street| {
                    let last = (street.interferers.len() - 1) as f64;
                    for (n, other) in street.interferers.iter_mut().enumerate() {
                        other.drift_ppm = CRYSTAL_PPM * (2.0 * n as f64 / last - 1.0);
                    }
                }),
            ),
            (
                "equal clocks, we wait up to 1 us",
                changed(|street| street.lidar.dither_ns = DITHER_NS),
            ),
            (
                "equal clocks, they dither by 1 us",
                changed(|street| {
                    let others = street.interferers.iter_mut();
                    others.for_each(|other| other.dither_ns = DITHER_NS);
                }),
            ),
        ];
        Disturbance {
            name: "ten other lidars",
            target: "",
            cases: cases.map(|(name, world)| (name.to_owned(), world)).into(),
            draws: 120,
        }
    }

    /// A sign beside a pedestrian, within the pedestrian's window and outside.
    pub fn sign() -> Self {
        let case = |sign_m: f64, stray_share: f64| {
            let name = format!("sign at {sign_m} m, {} % stray", 100.0 * stray_share);
            (name, sign(sign_m, stray_share))
        };
        let shares = [0.0, 1e-2, 5e-2];
        let cases = [31.5, 40.0].into_iter();
        Disturbance {
            name: "road sign",
            target: "pedestrian",
            cases: cases
                .flat_map(|sign_m| shares.map(|share| case(sign_m, share)))
                .collect(),
            draws: 20,
        }
    }

    /// A target beside a wall, without and with light that bounces.
    pub fn corner() -> Self {
        let cases = [("one way", 0), ("one bounce", 16)];
        Disturbance {
            name: "corner",
            target: "target",
            cases: cases
                .map(|(name, rays)| (name.to_owned(), corner(rays)))
                .into(),
            draws: 20,
        }
    }

    /// All cases and schemes; `done` is called after each draw of a case.
    ///
    /// # Errors
    /// What guide and engines report.
    pub fn outcomes(
        &self,
        demonstrator: &Demonstrator,
        seed: u64,
        done: impl Fn() + Sync,
    ) -> Result<Vec<DisturbanceOutcome>, FrameError> {
        let cases = self.cases.iter();
        let of_cases: Result<Vec<_>, _> = cases
            .map(|(case, world)| self.of_case(demonstrator, case, world, seed, &done))
            .collect();
        Ok(of_cases?.concat())
    }

    fn of_case(
        &self,
        demonstrator: &Demonstrator,
        case: &str,
        world: &Scene,
        seed: u64,
        done: &(impl Fn() + Sync),
    ) -> Result<Vec<DisturbanceOutcome>, FrameError> {
        let (rows, cols) = (
            demonstrator.sensor.rows as u32,
            demonstrator.sensor.cols as u32,
        );
        let truth = GroundTruth::render(world, rows, cols);
        // The road is the first object.
        let is_target =
            |object: usize| object > 0 && world.objects[object].name.starts_with(self.target);
        let on_target = |pixel: &usize| truth.object[*pixel].is_some_and(is_target);
        let pixels: Vec<usize> = (0..truth.object.len()).filter(on_target).collect();
        let every = pixels.len().div_ceil(LOOKED_AT).max(1);
        let pixels: Vec<usize> = pixels.into_iter().step_by(every).collect();
        let draw = |draw: u64| {
            // All cases have the same photons of our own laser in their first draw, and so on.
            let seed = seed.wrapping_mul(10_000).wrapping_add(draw);
            let input = GuideInput::still(world, rows, cols, seed);
            let guide = BehaviouralStereo.estimate(&input)?;
            let found = schemes::compare(demonstrator, world, &guide, &pixels, seed)?;
            done();
            Ok(found)
        };
        let drawn: Result<Vec<_>, FrameError> = (0..self.draws).into_par_iter().map(draw).collect();
        #[derive(Default)]
        struct Sums {
            bins: usize,
            wrong: f64,
            lost: f64,
            errors_m: Vec<f64>,
        }
        let mut by_scheme: BTreeMap<(usize, &'static str), Sums> = BTreeMap::new();
        for (place, outcome) in drawn?.iter().flat_map(|draw| draw.iter().enumerate()) {
            let found = &outcome.found;
            let all = found.seen_by as f64;
            let sums = by_scheme.entry((place, outcome.scheme)).or_default();
            sums.bins = outcome.bins;
            sums.wrong += found.wrong as f64 / all;
            sums.lost += found.without.values().sum::<usize>() as f64 / all;
            sums.errors_m.extend(found.mean_error_m);
        }
        let ends = |sum: f64| {
            let Estimate { value, low, high } = share(sum, self.draws as f64);
            [value, low, high]
        };
        let outcome = |((_, scheme), sums): ((usize, &'static str), Sums)| DisturbanceOutcome {
            case: case.to_owned(),
            scheme,
            bins: sums.bins,
            wrong: ends(sums.wrong),
            lost: ends(sums.lost),
            mean_error_m: super::found::mean(sums.errors_m.into_iter()),
        };
        let mut outcomes: Vec<DisturbanceOutcome> = by_scheme.into_iter().map(outcome).collect();
        let scheme_outcome = |scheme| outcomes.iter().find(|outcome| outcome.scheme == scheme);
        let of_equal_silicon =
            scheme_outcome("guided")
                .zip(scheme_outcome("full"))
                .map(|(guided, full)| {
                    let with_histogram = 1.0 / full.bins.div_ceil(guided.bins) as f64;
                    let of_draws = |share: f64| ends(share * self.draws as f64);
                    DisturbanceOutcome {
                        scheme: EQUAL_SILICON,
                        bins: guided.bins,
                        wrong: of_draws(full.wrong[0] * with_histogram),
                        lost: of_draws(1.0 - (1.0 - full.lost[0]) * with_histogram),
                        ..full.clone()
                    }
                });
        outcomes.extend(of_equal_silicon);
        Ok(outcomes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Time;

    /// One oncoming lidar whose clock is equal to ours, and whose pulses come as an echo from 60 m would.
    #[test]
    fn a_lidar_that_stands_still_misleads_full_histograms_until_we_wait() {
        let demonstrator = Demonstrator::calibrated(Time::from_ps(200), || ()).unwrap();
        let mut one = busy_street();
        one.interferers.truncate(1);
        let way_ns = one.interferers[0].place_m.length() / 0.299_792_458;
        one.interferers[0].phase = Some((400.0 - way_ns) / 12_500.0);
        let mut waiting = one.clone();
        waiting.lidar.dither_ns = DITHER_NS;
        let disturbance = Disturbance {
            cases: vec![("still".into(), one), ("we wait".into(), waiting)],
            draws: 1,
            ..Disturbance::interference()
        };
        let outcomes = disturbance.outcomes(&demonstrator, 1, || ()).unwrap();
        let wrong = |case: &str, scheme: &str| {
            let mut matching = outcomes
                .iter()
                .filter(|o| o.case == case && o.scheme == scheme);
            matching.next().unwrap().wrong[0]
        };
        assert!(wrong("still", "full") > 0.2, "{outcomes:#?}");
        assert!(wrong("still", "sliding") > 0.2);
        for scheme in ["guided", "full", "sliding"] {
            assert!(wrong("we wait", scheme) < 0.05, "{scheme}");
        }
        assert!(wrong("still", "guided") < 0.05);
        // A bin of the guided chip's memory for 27 of a full histogram.
        let lost = |scheme: &str| {
            let outcome = outcomes
                .iter()
                .find(|o| o.case == "we wait" && o.scheme == scheme);
            outcome.unwrap().lost[0]
        };
        let with_depth = [1.0 - lost("full"), 1.0 - lost(EQUAL_SILICON)];
        assert!(
            (with_depth[0] / with_depth[1] / 27.0 - 1.0).abs() < 1e-9,
            "{with_depth:?}"
        );
    }
}
