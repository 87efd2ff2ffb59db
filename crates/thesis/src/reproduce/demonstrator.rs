//! Claims 22 to 26 on the whole chain: the demonstrator of chapter 6 before its scenes, as `gdtof demo` runs it.
//!
//! ```text
//!   world in motion ─► stereo guide ─► windows ─► 16 000 laser cycles ─► calibrated delay lines ─► depths ─► found or not
//! ```
//!
//! The chip has the four rows that claim 20 calibrates, in the middle of the view, where all targets are: 256 macropixels of 2048,
//! a laser that lights as much less, and otherwise every part as in the demos.

use std::sync::{Arc, OnceLock};

use super::claim::ClaimRow;
use super::delay_line;
use super::thesis::claim;
use crate::demo::found::{TargetSummary, mean};
use crate::demo::schemes::SchemeOutcome;
use crate::demo::show::{Show, ShowResult};
use crate::demo::sweep::{self, SweepPoint};
use crate::demo::{Demonstrator, shows};
use crate::guide::NoisyTruth;
use crate::report::Chart;
use crate::scene::DVec3;
use crate::system::FrameSettings;

/// Seed of photons and guide errors.
const SEED: u64 = 1;

/// Distances from which on the van is followed, m, to its end at 75 m; four frames each.
const VAN_FROM_M: [f64; 4] = [22.0, 35.0, 50.0, 72.0];

/// How much lower than in the demo the demonstrator stands before the fog, m: four rows are 0.5 m high at 60 m, and should be on
/// the car.
const LOWER_M: f64 = 0.6;

/// Reflectivity of a figure brighter than that of the sweep.
const BRIGHTER: f64 = 0.25;

/// The demonstrator, of four rows.
fn chain() -> Demonstrator {
    Demonstrator::new(delay_line::calibrated().clone())
}

/// Length of its exposure, s.
pub(super) fn exposure_s() -> f64 {
    chain().exposure.end().as_s()
}

/// A show, without its pictures.
fn run_show(mut show: Show) -> ShowResult {
    show.pictures.clear();
    let shown = show.run(&chain(), || ());
    shown.expect("the window engine follows delay lines")
}

/// What became of a show's first target in its frames.
fn target_summaries(show: Show) -> Vec<TargetSummary> {
    let frames = run_show(show).frames.into_iter();
    frames
        .filter_map(|frame| frame.targets.into_iter().next())
        .collect()
}

/// The share of a target's macropixels over all frames that are `counted`.
fn share(frames: &[TargetSummary], counted: impl Fn(&TargetSummary) -> usize) -> f64 {
    let all: usize = frames.iter().map(|found| found.seen_by).sum();
    frames.iter().map(counted).sum::<usize>() as f64 / all.max(1) as f64
}

fn share_right(frames: &[TargetSummary]) -> f64 {
    share(frames, |found| found.right)
}

fn share_in_window(frames: &[TargetSummary]) -> f64 {
    share(frames, |found| found.in_window)
}

/// The distance sweep, run once for all that is shown of it.
pub(super) fn swept() -> &'static [SweepPoint] {
    static SWEPT: OnceLock<Vec<SweepPoint>> = OnceLock::new();
    SWEPT.get_or_init(|| {
        let points = sweep::sweep(&chain(), sweep::REFLECTIVITY, SEED, || ());
        points.expect("the window engine follows delay lines")
    })
}

/// What of the demonstrator is otherwise, to see what σ comes from.
#[derive(Clone, Copy)]
struct DemonstratorVariant {
    /// All elements of its delay lines are alike.
    alike: bool,
    /// Its windows are centred on the figure, to a step.
    centred: bool,
    /// There is no daylight to speak of.
    dark: bool,
}

const AS_IT_IS: DemonstratorVariant = DemonstratorVariant {
    alike: false,
    centred: false,
    dark: false,
};

/// Sweeps behind each σ: what changes from one to the next is then known to 4 %.
const SWEEPS: u64 = 4;

/// σ of the sweep's last point, m.
fn sigma_m(otherwise: DemonstratorVariant) -> f64 {
    let demonstrator = if otherwise.alike {
        Demonstrator::new(delay_line::calibrated_alike().clone())
    } else {
        chain()
    };
    let change = |frame: &mut FrameSettings| {
        if otherwise.centred {
            frame.guide = Arc::new(NoisyTruth {
                sigma_m: 0.0,
                sigma_per_m: 0.0,
            });
        }
        if otherwise.dark {
            frame.scene.light.illuminance_klux = 1e-3;
        }
    };
    let distance_m = sweep::DISTANCES_M[sweep::DISTANCES_M.len() - 1];
    let points: Vec<SweepPoint> = (0..SWEEPS)
        .map(|seed| {
            let seed = SEED + 1000 * seed;
            let point = sweep::point_with(
                &demonstrator,
                distance_m,
                sweep::REFLECTIVITY,
                seed,
                change,
                || (),
            );
            point.expect("the window engine follows delay lines")
        })
        .collect();
    // About the mean of all.
    let square_m2 = mean(points.iter().map(|p| p.rms_m.powi(2))).unwrap_or(f64::NAN);
    let mean_m = mean(points.iter().map(|p| p.mean_error_m)).unwrap_or(f64::NAN);
    (square_m2 - mean_m * mean_m).sqrt()
}

/// Why σ at the end of the sweep is several times `bound_m`, its Cramér-Rao bound: one cause after the other is taken
/// away.
pub(super) fn sigma_rows(bound_m: f64) -> Vec<ClaimRow> {
    let claim = claim(22);
    let (alike, centred) = (
        DemonstratorVariant {
            alike: true,
            ..AS_IT_IS
        },
        DemonstratorVariant {
            centred: true,
            ..AS_IT_IS
        },
    );
    let both = DemonstratorVariant {
        alike: true,
        ..centred
    };
    let ways = [AS_IT_IS, alike, centred, both].map(sigma_m);
    let [dark, dark_alike] =
        [centred, both].map(|way| sigma_m(DemonstratorVariant { dark: true, ..way }));
    let over = |row: &str, sigma_m: f64| claim.row(row, sigma_m / bound_m);
    vec![
        over("over_bound", ways[0])
            .remark(format!("Of {SWEEPS} sweeps. What it comes from is taken away below; hardly any photon is lost to dead time or cancels there.")),
        over("over_bound_alike", ways[1]).remark(format!(
            "Unequal bins hold unequal daylight. In the dark unequal elements leave {:.3} m where alike ones leave {:.3} m, windows centred on the figure.",
            dark, dark_alike
        )),
        over("over_bound_centred", ways[2]),
        over("over_bound_both", ways[3]),
    ]
}

/// Claim 22: errors to 50 m.
pub(super) fn error_rows() -> Vec<ClaimRow> {
    let claim = claim(22);
    let points = swept();
    let greatest_m = points.iter().map(|p| p.rms_m).fold(0.0, f64::max);
    let farthest = &points[points.len() - 1];
    let (samples, depths) = points
        .iter()
        .fold((0, 0), |(a, b), p| (a + p.samples, b + p.depths));
    let brighter = sweep::point(&chain(), farthest.distance_m, BRIGHTER, SEED, || ());
    let brighter = brighter.expect("the window engine follows delay lines");
    let percent = |p: &SweepPoint| 100.0 * p.sigma_m / p.distance_m;
    let counts = format!(
        "Nine frames of 3×3 macropixels on a figure of {:.0} % at {} distances from {} m on; {depths} of {samples} samples have a depth.",
        100.0 * sweep::REFLECTIVITY,
        points.len(),
        points[0].distance_m,
    );
    vec![
        claim.row("rms_error", greatest_m).remark(counts),
        claim
            .row("sigma", percent(farthest))
            .remark(format!("{} samples, of nine macropixels.", farthest.depths)),
        claim.row("brighter", percent(&brighter)),
        claim.row("guide_error", farthest.guide_rms_m),
    ]
}

/// Fig. 103: the sweep's means.
pub(super) fn figure_103() -> Chart {
    let [(_, means), ..] = sweep::charts(swept());
    means
}

/// Claim 23: the van.
pub(super) fn tracking_rows() -> Vec<ClaimRow> {
    let claim = claim(23);
    let from =
        |from_m: f64| target_summaries(shows::van_at(&chain(), shows::VAN_M_S, from_m, SEED));
    let legs = VAN_FROM_M.map(from);
    let frames = legs.concat();
    let where_found = frames.iter().filter(|found| found.is_found());
    let farthest_m = where_found.clone().filter_map(|found| found.true_m);
    let missed = frames.iter().filter(|found| !found.is_found());
    let missed: Vec<String> = missed.map(ToString::to_string).collect();
    let fast = target_summaries(shows::van_at(&chain(), 5.0, 70.0, SEED));
    let mut rows = vec![
        claim.row("found", where_found.count() as f64 / frames.len() as f64).remark(format!(
            "{} frames, four from each of 22, 35, 50 and 72 m on; the van drives away at 2 m/s, which is chosen. {}",
            frames.len(),
            missed.join(" ")
        )),
        claim.row("farthest", farthest_m.fold(0.0, f64::max)),
    ];
    rows.extend(
        VAN_FROM_M.iter().zip(&legs).map(|(from_m, frames)| {
            claim.row(&format!("right_from_{from_m}_m"), share_right(frames))
        }),
    );
    rows.push(claim.row("fast_van", share_right(&fast)));
    rows
}

/// Claim 24: a pedestrian and a car in fog.
pub(super) fn fog_rows() -> Vec<ClaimRow> {
    let claim = claim(24);
    let lower = |mut show: Show| {
        show.settings.frame.scene.rig.waypoints = vec![[0.0, 0.0, LOWER_M, 0.0, 0.0].into()];
        show
    };
    let car = |visibility_m| lower(shows::car_in_fog(&chain(), visibility_m, SEED));
    let cars: Vec<(f64, Vec<TargetSummary>)> = shows::CAR_VISIBILITIES_M
        .map(|visibility_m| (visibility_m, target_summaries(car(visibility_m))))
        .into();
    let seen = cars
        .iter()
        .filter(|(_, frames)| frames.iter().all(TargetSummary::is_found));
    let least_m = seen.map(|(visibility_m, _)| *visibility_m);
    let places_m = cars[0].1.iter().filter_map(|found| found.true_m);
    let crossing = lower(shows::pedestrian_in_fog(&chain(), SEED));
    let mut walking = crossing.clone();
    let people = walking.settings.frame.scene.objects.iter_mut();
    for part in people.filter(|object| object.name.starts_with("pedestrian")) {
        part.velocity_m_s = DVec3::new(0.0, 0.0, part.velocity_m_s.length());
    }
    let in_window = |show: Show| share_in_window(&target_summaries(show));
    let mut rows = vec![
        claim.row("least_visibility", least_m.fold(f64::INFINITY, f64::min)).remark(format!(
            "At {:.1} m; published: up to 60 m, without the fog's visibility. Fog is what one sees less than a kilometre through (WMO). 5 klux, car of 35 %.",
            mean(places_m).unwrap_or(f64::NAN)
        )),
    ];
    rows.extend(cars.iter().map(|(visibility_m, frames)| {
        claim.row(&format!("right_in_{visibility_m}_m"), share_right(frames))
    }));
    rows.extend([
        claim.row("walking", in_window(walking)),
        claim.row("crossing", in_window(crossing)),
    ]);
    rows
}

/// Claim 25: a figure behind a glass door.
pub(super) fn glass_rows() -> Vec<ClaimRow> {
    let claim = claim(25);
    let mut shows = shows::glass(&chain(), SEED);
    let mut show = shows.swap_remove(0);
    show.frames = 1;
    let shown = run_show(show);
    let outcome = |scheme: &str| -> &SchemeOutcome {
        let mut schemes = shown.schemes.iter();
        let outcome = schemes.find(|outcome| outcome.scheme == scheme);
        outcome.expect("all schemes are compared")
    };
    let pixels = outcome("guided").found.seen_by;
    let one = |found: &TargetSummary| share_right(std::slice::from_ref(found));
    vec![
        claim
            .row("guided", one(&outcome("guided").found))
            .remark(format!(
                "{pixels} macropixels in one frame; door at 14 m, figure at 17 m, both chosen."
            )),
        claim.row("first_peak", one(&outcome("full, first peak").found)),
        claim.row("full", one(&outcome("full").found)),
        claim.row("zooming", one(&outcome("zooming").found)),
    ]
}

/// Claim 26: what throws a target out of its window.
pub(super) fn motion_rows() -> Vec<ClaimRow> {
    let claim = claim(26);
    let slipped = target_summaries(shows::pedestrian(&chain(), -0.1, SEED));
    let straight = target_summaries(shows::pedestrian(&chain(), 0.0, SEED));
    let fast = target_summaries(shows::car(&chain(), 65.0, SEED));
    let slow = target_summaries(shows::car(&chain(), 5.0, SEED));
    vec![
        claim.row("slipped", share_right(&slipped)),
        claim.row("straight", share_right(&straight)),
        claim.row("fast_car", share_in_window(&fast)),
        claim.row("slow_car", share_in_window(&slow)),
    ]
}
