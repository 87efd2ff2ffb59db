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
    let mut groups = SmallVec::<[GlintGroup; 1]>::new();
    part(glints, resolution_fs, &mut groups);
    let mut groups = without_negligible(groups);
    groups.sort_by(|a, b| b.photons.total_cmp(&a.photons));
    let sigma_fs2 = (pulse_sigma.as_fs() as f64).powi(2);
    let echo = |group: &GlintGroup| {
        let sigma_fs = (sigma_fs2 + group.variance_fs2).sqrt().round() as i64;
        let arrival = Time::from_fs(group.mean_fs.round() as i64);
        Echo::new(group.photons, arrival).with_sigma(Time::from_fs(sigma_fs))
    };
    groups.iter().map(echo).collect()
}

/// The same light where no echo has less than [`NEGLIGIBLE`] photons: fainter ones are joined in order of time until they have as many, and
/// what is left goes to the brightest.
fn without_negligible(mut groups: SmallVec<[GlintGroup; 1]>) -> SmallVec<[GlintGroup; 1]> {
    if groups.len() < 2 {
        return groups;
    }
    groups.sort_by(|a, b| a.mean_fs.total_cmp(&b.mean_fs));
    let (mut kept, mut faint) = (SmallVec::<[GlintGroup; 1]>::new(), None::<GlintGroup>);
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
    struct ReachedSurface {
        object: usize,
        until_fs: f64,
        surface: usize,
    }
    let mut reached = SmallVec::<[ReachedSurface; 4]>::new();
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
                reached.push(ReachedSurface {
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
fn part(glints: &[Glint], resolution_fs: f64, groups: &mut SmallVec<[GlintGroup; 1]>) {
    let group = GlintGroup::new(glints);
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
fn slice(glints: &[Glint], slice_fs: f64, groups: &mut SmallVec<[GlintGroup; 1]>) {
    let group = GlintGroup::new(glints);
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
struct GlintGroup {
    photons: f64,
    mean_fs: f64,
    variance_fs2: f64,
}

impl GlintGroup {
    fn new(glints: &[Glint]) -> Self {
        let photons: f64 = glints.iter().map(|glint| glint.photons).sum();
        let origin_fs = glints.first().map_or(0.0, |glint| glint.arrival_fs);
        let late = |glint: &Glint| glint.photons * (glint.arrival_fs - origin_fs);
        let mean_fs = origin_fs + glints.iter().map(late).sum::<f64>() / photons;
        let square = |glint: &Glint| {
            let off_fs = glint.arrival_fs - mean_fs;
            glint.photons * (off_fs * off_fs + glint.variance_fs2)
        };
        GlintGroup {
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
        GlintGroup {
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
        let column = |value: fn(&Glint, f64) -> f64| -> SmallVec<[f64; 64]> {
            glints.iter().map(|glint| value(glint, pulse_fs2)).collect()
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
            (exact / self.photons - normal_cdf(z)).abs()
        };
        (0..INSTANTS).fold(0.0, |most, n| off(n).max(most))
    }
}

/// The share of each pulse that comes before an instant, from when the pulses come and their standard deviations: all as long as `shares`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn shares_before(time_fs: f64, arrivals_fs: &[f64], sigmas_fs: &[f64], shares: &mut [f64]) {
    let pulses = arrivals_fs.iter().zip(sigmas_fs);
    for (share, (arrival_fs, sigma_fs)) in shares.iter_mut().zip(pulses) {
        *share = normal_cdf((time_fs - arrival_fs) / sigma_fs);
    }
}

/// The standard normal distribution function.
#[inline(always)]
fn normal_cdf(z: f64) -> f64 {
    let tail = branchless::normal_above(z.abs());
    if z > 0.0 { 1.0 - tail } else { tail }
}

#[cfg(test)]
mod tests;
