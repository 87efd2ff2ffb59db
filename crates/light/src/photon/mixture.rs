//! Echoes of many surface points seen as few: what the laser pulse does not resolve is one echo with a width of its own.
//!
//! ```text
//!   rays of a macropixel      | | | |            | || |        each sends a pulse back, some more, some less
//!   exact light              ▁▂▅██▅▂▁         ▁▃▇█▇▃▁          the sum of all these pulses
//!   echoes                     one               one           Gaussians of the same photons, mean and variance
//! ```
//!
//! Surfaces are one echo if a Gaussian is close enough to their sum. The photons that come before any instant may differ by
//! [`NEGLIGIBLE`] photons a pulse, or by [`MERGED_ERROR`] of the faintest of these surfaces. Otherwise the brightest surface is parted from
//! the others, or the group is parted where that leaves least variance within, and so on. No limit depends on how bright other light is: a
//! wall keeps its photons beside a retroreflector of any strength.
//!
//! Within one surface it is the depth that decides ([`DEEP`]). The light of a slanted surface is a box, and its peak may be anywhere on the
//! flat top; that of a Gaussian is in the middle. So a deep surface becomes slices, short enough that their sum has a flat top. An object
//! whose points leave a gap is two surfaces.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;
use smallvec::SmallVec;

use super::light::Echo;
use crate::numerics::branchless;
use crate::units::Time;

/// Share of the faintest surface's photons that surfaces merged into one echo may put on the wrong side of an instant: two even pulses
/// do up to a distance of two standard deviations, from which on their sum has two peaks.
pub const MERGED_ERROR: f64 = 0.04;

/// Photons a pulse that may be on the wrong side of an instant, whatever they are of: 1.6 counts of 16 000 laser cycles.
pub const NEGLIGIBLE: f64 = 1e-4;

/// A surface deeper than that, in standard deviations of the pulse, is no single echo; it is as deep as an even box of its variance. 4.0
/// are 1.15 m with a pulse of 4.5 ns. RMS error of the depth from 16 bins of 0.39 m with 20 background counts each, anywhere
/// relative to the bins, for the box itself | as a Gaussian (m, 32 000 histograms each):
///
/// ```text
///   counts       100              300              1000             3000
///   depth 1.0 m  0.086 | 0.082    0.039 | 0.038    0.022 | 0.021    0.016 | 0.017
///   1.15 m       0.103 | 0.092    0.049 | 0.043    0.029 | 0.027    0.022 | 0.022
///   1.4 m        0.144 | 0.115    0.079 | 0.058    0.052 | 0.038    0.039 | 0.032
///   3.0 m                         0.523 | 0.221                     0.437 | 0.115     of these 48 % | 0 % beyond a bin
/// ```
pub const DEEP: f64 = 4.0;

/// Depth of a slice of a deeper surface at most, in standard deviations of the pulse. RMS error of the depth as
/// above, of the box itself | of equal slices, by their depth in standard deviations (m, 3000 counts, 6400 histograms
/// each):
///
/// ```text
///   depth        box     2.1      2.6      2.9      3.5
///   1.5 m        0.051            0.058
///   2.5 m        0.296   0.289             0.268
///   3.0 m        0.437   0.439    0.427             0.380
///   5.0 m        0.990   0.986             0.975    0.961
/// ```
///
/// And the light of a plane that is slanted along a macropixel's diagonal is a triangle: 3 m deep, slices of 2.6 move its depth by 0.03 m
/// on average, slices of 2.1 by 0.004 m.
const SLICE: f64 = 2.0;

/// Slices are of whole rays, so one that is longer by no more than this part is not cut again.
const ROUNDED: f64 = 0.15;

/// Slices of a surface at most: 16 are 9 m deep with a pulse of 4.5 ns, more than most windows.
const MOST_SLICES: f64 = 16.0;

/// Points of one object that leave a gap of this many standard deviations of the pulse are two surfaces.
const GAP: f64 = 2.0;

/// A surface that sends back more than this share of a group's photons is parted from the others whole.
const DOMINANT: f64 = 0.25;

/// Instants at which a group is compared with its Gaussian, and how many standard deviations about the middle they lie. With 25
/// instead of 13 the greatest error is a sixth smaller.
const INSTANTS: i32 = 13;
const REACH: f64 = 2.4;

/// Points within so little of the pulse's standard deviation are no question: two even ones are then 0.0001 off, and an uneven one
/// puts less than [`MERGED_ERROR`] of its photons on the wrong side.
const LITTLE: f64 = 0.45;

/// Light that a small piece of a surface sends back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glint {
    /// Detected photons per laser cycle, at least 0.
    pub photons: f64,
    /// When the centre of its pulse comes after the start of the laser cycle, fs.
    pub arrival_fs: f64,
    /// Variance of that over the piece, fs².
    pub variance_fs2: f64,
    /// Which surface it is of.
    pub surface: usize,
}

impl Glint {
    /// Half the depth of an even box of its variance, fs.
    fn half_fs(&self) -> f64 {
        (3.0 * self.variance_fs2).sqrt()
    }
}

/// The echoes of `glints`, brightest first: the same number of photons with the same mean and variance of their times.
/// `pulse_sigma` is the standard deviation of the Gaussian part of the pulse, which becomes part of each echo's;
/// `resolution` that of the whole pulse, which decides what is merged.
pub fn merged(glints: &mut [Glint], pulse_sigma: Time, resolution: Time) -> SmallVec<[Echo; 1]> {
    glints.sort_by(|a, b| a.arrival_fs.total_cmp(&b.arrival_fs));
    let resolution_fs = resolution.as_fs() as f64;
    part_at_gaps(glints, GAP * resolution_fs);
    let mut groups = SmallVec::<[Group; 1]>::new();
    part(glints, resolution_fs, &mut groups);
    let mut groups = without_negligible(groups);
    groups.sort_by(|a, b| b.photons.total_cmp(&a.photons));
    let sigma_fs2 = (pulse_sigma.as_fs() as f64).powi(2);
    let echo = |group: &Group| {
        let sigma_fs = (sigma_fs2 + group.variance_fs2).sqrt().round() as i64;
        let arrival = Time::from_fs(group.mean_fs.round() as i64);
        Echo::new(group.photons, arrival).with_sigma(Time::from_fs(sigma_fs))
    };
    groups.iter().map(echo).collect()
}

/// The same light where no echo has less than [`NEGLIGIBLE`] photons: fainter ones are joined in order of time until they have as many, and
/// what is left goes to the brightest.
fn without_negligible(mut groups: SmallVec<[Group; 1]>) -> SmallVec<[Group; 1]> {
    if groups.len() < 2 {
        return groups;
    }
    groups.sort_by(|a, b| a.mean_fs.total_cmp(&b.mean_fs));
    let (mut kept, mut faint) = (SmallVec::<[Group; 1]>::new(), None::<Group>);
    for group in groups {
        let group = match faint.take() {
            Some(before) if group.photons <= NEGLIGIBLE => before.joined(&group),
            before => {
                faint = before;
                group
            }
        };
        if group.photons > NEGLIGIBLE {
            kept.push(group);
        } else {
            faint = Some(group);
        }
    }
    let brightest = kept
        .iter_mut()
        .max_by(|a, b| a.photons.total_cmp(&b.photons));
    match (faint, brightest) {
        (Some(faint), Some(brightest)) => brightest.photons += faint.photons,
        (faint, _) => kept.extend(faint),
    }
    kept
}

/// Numbers the surfaces of `glints`, which are in order of time: what is of one object before and after a gap are two.
fn part_at_gaps(glints: &mut [Glint], gap_fs: f64) {
    struct Reached {
        object: usize,
        until_fs: f64,
        surface: usize,
    }
    let mut reached = SmallVec::<[Reached; 4]>::new();
    let mut surfaces = 0;
    for glint in glints {
        let half_fs = glint.half_fs();
        let (from_fs, until_fs) = (glint.arrival_fs - half_fs, glint.arrival_fs + half_fs);
        let last = match reached.iter_mut().find(|last| last.object == glint.surface) {
            Some(last) => {
                if from_fs - last.until_fs > gap_fs {
                    last.surface = surfaces;
                    surfaces += 1;
                }
                last.until_fs = last.until_fs.max(until_fs);
                last
            }
            None => {
                reached.push(Reached {
                    object: glint.surface,
                    until_fs,
                    surface: surfaces,
                });
                surfaces += 1;
                reached.last_mut().expect("just added")
            }
        };
        glint.surface = last.surface;
    }
}

/// Adds the groups of `glints`, which are in order of time, to `groups`.
fn part(glints: &[Glint], resolution_fs: f64, groups: &mut SmallVec<[Group; 1]>) {
    let group = Group::of(glints);
    if group.photons == 0.0 {
        return;
    }
    let surfaces = surfaces(glints);
    let resolution_fs2 = resolution_fs * resolution_fs;
    if let [_] = surfaces[..] {
        // As deep as an even box of the same variance.
        let is_deep = 12.0 * group.variance_fs2 > DEEP * DEEP * resolution_fs2;
        if is_deep {
            let slice_fs = (SLICE * resolution_fs).max(depth_fs(glints) / MOST_SLICES);
            slice(glints, slice_fs, groups);
        } else {
            groups.push(group);
        }
        return;
    }
    let faintest = surfaces
        .iter()
        .fold(f64::INFINITY, |least, s| least.min(s.1));
    let most_off = NEGLIGIBLE.max(MERGED_ERROR * faintest);
    let is_off = group.photons > most_off
        && depth_fs(glints) > LITTLE * resolution_fs
        && group.photons * group.distance(glints, resolution_fs2) > most_off;
    let brighter = |a: (usize, f64), b: &(usize, f64)| if b.1 > a.1 { *b } else { a };
    let (brightest, its_photons) = surfaces.iter().fold((0, 0.0), brighter);
    if is_off && its_photons > DOMINANT * group.photons {
        let is_own = |glint: &Glint| glint.surface == brightest;
        let (own, others): (Vec<Glint>, Vec<Glint>) = glints.iter().copied().partition(is_own);
        part(&own, resolution_fs, groups);
        part(&others, resolution_fs, groups);
        return;
    }
    match is_off.then(|| best_cut(glints)).flatten() {
        None => groups.push(group),
        Some(cut) => {
            let (earlier, later) = glints.split_at(cut);
            part(earlier, resolution_fs, groups);
            part(later, resolution_fs, groups);
        }
    }
}

/// From end to end, as if glints were even, fs.
fn depth_fs(glints: &[Glint]) -> f64 {
    let (first, last) = (&glints[0], &glints[glints.len() - 1]);
    last.arrival_fs + last.half_fs() - (first.arrival_fs - first.half_fs())
}

/// Adds slices of one deep surface, equally deep, of `slice_fs` at most.
fn slice(glints: &[Glint], slice_fs: f64, groups: &mut SmallVec<[Group; 1]>) {
    let group = Group::of(glints);
    if group.photons == 0.0 {
        return;
    }
    // A pulse without width resolves everything.
    let depth_fs = depth_fs(glints);
    let slices = (depth_fs / slice_fs - ROUNDED).ceil().min(MOST_SLICES);
    let from_fs = glints[0].arrival_fs - glints[0].half_fs();
    let middle_fs = from_fs + depth_fs * (slices / 2.0).floor() / slices;
    let cut = glints.partition_point(|glint| glint.arrival_fs < middle_fs);
    if slices > 1.0 && group.photons > NEGLIGIBLE && (1..glints.len()).contains(&cut) {
        let (earlier, later) = glints.split_at(cut);
        slice(earlier, slice_fs, groups);
        slice(later, slice_fs, groups);
    } else {
        groups.push(group);
    }
}

/// The surfaces that send back any photons, and how many.
fn surfaces(glints: &[Glint]) -> SmallVec<[(usize, f64); 4]> {
    let mut surfaces = SmallVec::<[(usize, f64); 4]>::new();
    for glint in glints.iter().filter(|glint| glint.photons > 0.0) {
        match surfaces
            .iter_mut()
            .find(|(surface, _)| *surface == glint.surface)
        {
            Some((_, photons)) => *photons += glint.photons,
            None => surfaces.push((glint.surface, glint.photons)),
        }
    }
    surfaces
}

/// Where two groups have least variance within; `None` where all come at the same time.
fn best_cut(glints: &[Glint]) -> Option<usize> {
    // Times from the first one on keep their digits.
    let origin_fs = glints.first()?.arrival_fs;
    let moment = |glint: &Glint| glint.photons * (glint.arrival_fs - origin_fs);
    let photons: f64 = glints.iter().map(|glint| glint.photons).sum();
    let moments: f64 = glints.iter().map(moment).sum();
    let (mut before, mut moment_before) = (0.0, 0.0);
    let mut best = None;
    let mut most = 0.0;
    for (cut, pair) in (1..).zip(glints.windows(2)) {
        before += pair[0].photons;
        moment_before += moment(&pair[0]);
        let after = photons - before;
        if before <= 0.0 || after <= 0.0 || pair[0].arrival_fs == pair[1].arrival_fs {
            continue;
        }
        let apart_fs = (moments - moment_before) / after - moment_before / before;
        let between = before * after * apart_fs * apart_fs;
        if between > most {
            (best, most) = (Some(cut), between);
        }
    }
    best
}

/// Moments of the arrivals of some glints.
struct Group {
    photons: f64,
    mean_fs: f64,
    variance_fs2: f64,
}

impl Group {
    fn of(glints: &[Glint]) -> Self {
        let photons: f64 = glints.iter().map(|glint| glint.photons).sum();
        let origin_fs = glints.first().map_or(0.0, |glint| glint.arrival_fs);
        let late = |glint: &Glint| glint.photons * (glint.arrival_fs - origin_fs);
        let mean_fs = origin_fs + glints.iter().map(late).sum::<f64>() / photons;
        let square = |glint: &Glint| {
            let off_fs = glint.arrival_fs - mean_fs;
            glint.photons * (off_fs * off_fs + glint.variance_fs2)
        };
        Group {
            photons,
            mean_fs,
            variance_fs2: glints.iter().map(square).sum::<f64>() / photons,
        }
    }

    /// Both as one.
    fn joined(&self, other: &Self) -> Self {
        let photons = self.photons + other.photons;
        let share = other.photons / photons;
        let apart_fs = other.mean_fs - self.mean_fs;
        Group {
            photons,
            mean_fs: self.mean_fs + share * apart_fs,
            variance_fs2: self.variance_fs2
                + share * (other.variance_fs2 - self.variance_fs2)
                + share * (1.0 - share) * apart_fs * apart_fs,
        }
    }

    /// Greatest share of their photons on the wrong side of an instant, were they one Gaussian.
    fn distance(&self, glints: &[Glint], pulse_fs2: f64) -> f64 {
        let sigma_fs = (self.variance_fs2 + pulse_fs2).sqrt();
        let column = |of: fn(&Glint, f64) -> f64| -> SmallVec<[f64; 64]> {
            glints.iter().map(|glint| of(glint, pulse_fs2)).collect()
        };
        let arrivals_fs = column(|glint, _| glint.arrival_fs);
        let own_fs = column(|glint, pulse_fs2| {
            let own_fs = (glint.variance_fs2 + pulse_fs2).sqrt();
            own_fs.max(f64::MIN_POSITIVE)
        });
        let mut shares = column(|_, _| 0.0);
        let mut off = |n: i32| {
            let z = REACH * (2.0 * f64::from(n) / f64::from(INSTANTS - 1) - 1.0);
            shares_before(
                self.mean_fs + z * sigma_fs,
                &arrivals_fs,
                &own_fs,
                &mut shares,
            );
            let before = glints.iter().zip(&shares);
            let exact: f64 = before.map(|(glint, share)| glint.photons * share).sum();
            (exact / self.photons - below(z)).abs()
        };
        (0..INSTANTS).fold(0.0, |most, n| off(n).max(most))
    }
}

/// The share of each pulse that comes before an instant, from when the pulses come and their standard deviations: all as long as `shares`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn shares_before(time_fs: f64, arrivals_fs: &[f64], sigmas_fs: &[f64], shares: &mut [f64]) {
    let pulses = arrivals_fs.iter().zip(sigmas_fs);
    for (share, (arrival_fs, sigma_fs)) in shares.iter_mut().zip(pulses) {
        *share = below((time_fs - arrival_fs) / sigma_fs);
    }
}

/// The standard normal distribution function.
#[inline(always)]
fn below(z: f64) -> f64 {
    let tail = branchless::normal_above(z.abs());
    if z > 0.0 { 1.0 - tail } else { tail }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIGMA_FS: f64 = 1e6;

    fn glint(photons: f64, sigmas: f64) -> Glint {
        Glint {
            photons,
            arrival_fs: 4e8 + sigmas * SIGMA_FS,
            variance_fs2: 0.0,
            surface: (100.0 * sigmas) as usize,
        }
    }

    fn merge(glints: &[Glint]) -> SmallVec<[Echo; 1]> {
        let sigma = Time::from_fs(SIGMA_FS as i64);
        merged(&mut glints.to_vec(), sigma, sigma)
    }

    /// Greatest share of the photons on the wrong side of an instant.
    fn off(glints: &[Glint], echoes: &[Echo]) -> f64 {
        let all: f64 = glints.iter().map(|glint| glint.photons).sum();
        let (first, last) = (glints[0].arrival_fs, glints[glints.len() - 1].arrival_fs);
        let width_fs = last - first + 12.0 * SIGMA_FS;
        let off = |step: i32| {
            let time_fs = first - 6.0 * SIGMA_FS + width_fs * f64::from(step) / 2000.0;
            let exact: f64 = glints
                .iter()
                .map(|glint| glint.photons * below((time_fs - glint.arrival_fs) / SIGMA_FS))
                .sum();
            let given: f64 = echoes
                .iter()
                .map(|echo| {
                    let sigma_fs = echo.sigma.unwrap().as_fs() as f64;
                    echo.photons * below((time_fs - echo.arrival.as_fs() as f64) / sigma_fs)
                })
                .sum();
            (exact - given).abs() / all
        };
        (0..=2000).map(off).fold(0.0, f64::max)
    }

    #[test]
    fn what_the_pulse_does_not_resolve_is_one_echo_and_what_it_does_is_two() {
        for (apart, echoes) in [(0.0, 1), (1.0, 1), (1.9, 1), (2.2, 2), (4.0, 2), (50.0, 2)] {
            let found = merge(&[glint(1.0, 0.0), glint(1.0, apart)]);
            assert_eq!(found.len(), echoes, "{apart} sigma");
        }
        // A faint one in the distance is an echo as well.
        let found = merge(&[glint(1.0, 0.0), glint(0.05, 20.0)]);
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].photons, found[1].photons), (1.0, 0.05));
    }

    /// Points of one surface that is slanted, and bright all over.
    fn slanted(sigmas: f64) -> Vec<Glint> {
        let row = (0..64).map(|i| Glint {
            surface: 7,
            variance_fs2: (sigmas * SIGMA_FS / 64.0).powi(2) / 12.0,
            ..glint(1.0, sigmas * (f64::from(i) + 0.5) / 64.0)
        });
        row.collect()
    }

    #[test]
    fn a_slanted_surface_is_as_many_echoes_as_it_has_short_slices() {
        for (sigmas, echoes) in [
            (1.0, 1),
            (3.9, 1),
            (4.2, 2),
            (5.0, 3),
            (10.5, 6),
            (13.0, 7),
            (20.0, 10),
        ] {
            let found = merge(&slanted(sigmas));
            assert_eq!(found.len(), echoes, "{sigmas} sigma");
            let worst = off(&slanted(sigmas), &found);
            let most = [0.002, 0.015][usize::from(echoes == 1)];
            assert!(worst < most, "{sigmas} sigma: {worst}");
        }
        assert!(merge(&slanted(3000.0)).len() <= 20);
    }

    /// The peak of a box may be anywhere on its flat top, so no echo may stand out.
    #[test]
    fn slices_of_a_slanted_surface_have_a_flat_top() {
        for sigmas in [8.0, 10.5, 15.0, 20.0, 30.0] {
            let echoes = merge(&slanted(sigmas));
            let before = |z: f64| -> f64 {
                let share = |echo: &Echo| {
                    let sigma_fs = echo.sigma.unwrap().as_fs() as f64;
                    echo.photons
                        * below((z * SIGMA_FS + 4e8 - echo.arrival.as_fs() as f64) / sigma_fs)
                };
                echoes.iter().map(share).sum::<f64>() / 64.0
            };
            let steps = ((sigmas - 6.0) / 0.1) as u32;
            for step in 0..steps {
                let from = 3.0 + 0.1 * f64::from(step);
                let density = (before(from + 0.1) - before(from)) / 0.1 * sigmas;
                assert!(
                    (density - 1.0).abs() < 0.04,
                    "{sigmas} at {from}: {density}"
                );
            }
        }
    }

    #[test]
    fn a_post_before_a_slanted_surface_is_an_echo_of_its_own() {
        for sigmas in [3.0, 30.0] {
            let row = slanted(sigmas);
            let post = Glint {
                surface: 8,
                ..glint(80.0, -30.0)
            };
            let echoes = merge(&[&row[..], &[post]].concat());
            assert_eq!(echoes[0].photons, 80.0, "{sigmas} sigma");
            assert_eq!(echoes.len() > 2, merge(&row).len() > 1, "{sigmas} sigma");
        }
        // One that is faint beside it has as many slices as alone.
        let mut both = slanted(30.0);
        for glint in &mut both {
            glint.photons = 1e-3;
        }
        let alone = merge(&both).len();
        both.push(glint(2000.0, -40.0));
        assert_eq!(merge(&both).len(), alone + 1);
    }

    #[test]
    fn an_echo_keeps_its_photons_and_its_place_beside_one_of_any_strength() {
        for brighter in [1.0, 1e2, 1e3, 1e4, 1e6] {
            for sigmas in [2.5, 4.0, 10.0, 100.0] {
                let found = merge(&[glint(5.0 * brighter, 0.0), glint(5.0, sigmas)]);
                let faint = found.iter().min_by(|a, b| a.photons.total_cmp(&b.photons));
                let faint = faint.unwrap();
                assert_eq!(found.len(), 2, "{brighter} times at {sigmas} sigma");
                assert_eq!(faint.photons, 5.0);
                // Of one object, too, where nothing of it lies between.
                let one = [glint(5.0 * brighter, 0.0), glint(5.0, sigmas)].map(|glint| Glint {
                    surface: 0,
                    ..glint
                });
                assert_eq!(merge(&one), found, "{brighter} times at {sigmas} sigma");
            }
        }
        // What no histogram shows goes to the others. Where it shows only together, it is one echo.
        let faint = |share: f64, sigmas: f64| glint(share * NEGLIGIBLE, sigmas);
        let found = merge(&[glint(5.0, 0.0), faint(0.5, 100.0)]);
        let brightest = glint(5.0 + 0.5 * NEGLIGIBLE, 0.0);
        assert_eq!(found, merge(&[brightest]));
        assert_eq!(merge(&[glint(5.0, 0.0), faint(2.0, 10.0)]).len(), 2);
        let many = [
            glint(5.0, 0.0),
            faint(0.6, 20.0),
            faint(0.6, 40.0),
            faint(0.6, 400.0),
        ];
        let found = merge(&many);
        assert_eq!(found.len(), 2);
        assert_eq!(found[1].arrival, Time::from_fs(553_333_333));
        let photons: f64 = found.iter().map(|echo| echo.photons).sum();
        assert!((photons - 5.0 - 1.8 * NEGLIGIBLE).abs() < 1e-12);
    }

    #[test]
    fn nothing_gives_no_echo_and_one_point_the_pulse_itself() {
        assert!(merge(&[]).is_empty());
        assert!(merge(&[glint(0.0, 1.0), glint(0.0, 9.0)]).is_empty());
        let found = merge(&[glint(0.3, 2.0)]);
        let pulse = Echo::new(0.3, Time::from_fs(402_000_000));
        assert_eq!(found[0], pulse.with_sigma(Time::from_fs(SIGMA_FS as i64)));
    }

    proptest! {
        /// Photons, mean and variance are those of the sum of all pulses. Each echo puts at most [`MERGED_ERROR`] of its faintest surface's
        /// photons on the wrong side of an instant; where several overlap, these add up.
        #[test]
        fn merged_echoes_are_close_to_the_sum_of_all_pulses(
            mut glints in prop::collection::vec((0.0f64..1.0, 0.0f64..30.0), 1..40),
            scale in prop::sample::select(vec![0.03, 0.1, 0.2, 0.5, 1.0, 3.0]),
        ) {
            glints.sort_by(|a, b| a.1.total_cmp(&b.1));
            let glints: Vec<Glint> = glints.iter().map(|&(n, z)| glint(n + 1e-3, scale * z)).collect();
            let echoes = merge(&glints);
            let worst = off(&glints, &echoes);
            prop_assert!(worst < MERGED_ERROR, "{worst} with {} echoes", echoes.len());
            let photons: f64 = echoes.iter().map(|echo| echo.photons).sum();
            let sent: f64 = glints.iter().map(|glint| glint.photons).sum();
            prop_assert!((photons / sent - 1.0).abs() < 1e-12);
            let mean = |of: &dyn Fn(f64, f64) -> f64| -> [f64; 2] {
                let echo = echoes.iter().map(|e| {
                    let sigma = e.sigma.unwrap().as_fs() as f64 / SIGMA_FS;
                    e.photons * of(e.arrival.as_fs() as f64 / SIGMA_FS - 400.0, sigma * sigma)
                });
                let glint = glints.iter().map(|g| g.photons * of(g.arrival_fs / SIGMA_FS - 400.0, 1.0));
                [echo.sum::<f64>() / sent, glint.sum::<f64>() / sent]
            };
            for of in [&|z: f64, _: f64| z, &|z: f64, own: f64| z * z + own] as [&dyn Fn(f64, f64) -> f64; 2] {
                let [found, exact] = mean(of);
                prop_assert!((found - exact).abs() < 1e-5 * (1.0 + exact.abs()), "{found} {exact}");
            }
        }
    }
}
