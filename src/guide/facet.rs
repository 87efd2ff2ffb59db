//! What the camera pixels that land in one macropixel say together of its target.
//!
//! ```text
//!        ┌─────────┐   samples: inverse range q at places x about the centre
//!        │·  ·  ·  │   surface:  q(x) = q̄ + g·(x − x̄), for a plane's inverse depth is linear in the image
//!        │·  ×· ·  │   kept:     the sample nearest to ×, moved there along the slope g
//!        │·  ·  ·  │   range:    E[q²]/E[q³] over the macropixel: light falls with r² and the cosine of a plane with r
//!        └─────────┘
//! ```
//!
//! The lidar measures the mean by light over the macropixel. One pixel's depth, as it is, is off by the slope times its distance from there:
//! on a road up to metres. The slope is known from the samples alone.
//!
//! Samples that no plane fits belong to several surfaces, and the brightest part is meant: every sample stands for as much solid angle, whose
//! light falls with the square of the range and with the cosine that the slope tells. How much a surface reflects, depths do not say. So where
//! another part might be as bright the claim is widened to the variance that the choice has.

use crate::numerics::normal_above;

/// A depth that has landed in a macropixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Place in macropixels, to the right of the centre and below.
    pub(super) at: [f64; 2],
    /// Inverse distance from the lidar, 1/m, and its standard deviation as the rig tells.
    pub(super) inverse: f64,
    pub(super) sigma: f64,
}

/// A macropixel's width and height as the lidar sees them, rad.
pub(super) type Pitch = [f64; 2];

/// Slopes of inverse range that are expected before any is seen, 1/m per rad: ground seen from 1.5 m has 1/1.5.
const SLOPE: f64 = 0.7;

/// Steeper by so much than expected is no surface but two, of which samples on either side are missing.
const STEEPEST: f64 = 3.0 * SLOPE;

/// Residuals over what the rig claims, as a variance, beyond which samples are not of one plane: one in 1000 by chance where nine samples leave six
/// degrees of freedom.
const NOT_PLANE: f64 = 3.7;

/// The centre is meant where samples are as even about it as their grid allows, else their own middle: they do not fill the macropixel.
const OFF_CENTRE: f64 = 0.2;

/// Standard deviation of the logarithm of two surfaces' reflectivities over each other: from a tenth to a half is 1.6 of it.
const LOG_REFLECTIVITY: f64 = 1.0;

/// Range and its standard deviation, m; `None` without samples.
pub(super) fn estimate(samples: &mut [Sample], pitch: Pitch) -> Option<(f64, f64)> {
    samples.sort_by(|a, b| a.inverse.total_cmp(&b.inverse));
    let mut parts = Vec::new();
    split(samples, pitch, &mut parts);
    let brightest = parts
        .iter()
        .copied()
        .reduce(|a, b| if b.light > a.light { b } else { a })?;
    let is_alone = parts.len() == 1;
    let (range_m, mut variance_m2) = brightest.range(is_alone);
    for other in parts.iter().filter(|other| other.first != brightest.first) {
        let counting2 = 1.0 / brightest.count() + 1.0 / other.count();
        let unknown2 = brightest.log_unknown.powi(2) + other.log_unknown.powi(2);
        let sigma = (LOG_REFLECTIVITY * LOG_REFLECTIVITY + counting2 + unknown2).sqrt();
        let is_other = normal_above((brightest.light / other.light).ln() / sigma);
        variance_m2 += is_other * (other.range(false).0 - range_m).powi(2);
    }
    Some((range_m, variance_m2.sqrt()))
}

/// Samples on one plane.
#[derive(Debug, Clone, Copy)]
struct Part<'s> {
    samples: &'s [Sample],
    first: f64,
    middle: [f64; 2],
    slope: [f64; 2],
    /// Σ (x − x̄)·(x − x̄)ᵀ with what is expected of slopes before: its 00, 01 and 11.
    moments: [f64; 3],
    /// Variance of a sample by its residuals.
    residual: f64,
    sigma2: f64,
    /// Variances of the slopes.
    slope2: [f64; 2],
    light: f64,
    /// How little the logarithm of the light is known because slopes are not.
    log_unknown: f64,
}

/// Takes samples, sorted, apart until each part is a plane.
fn split<'s>(samples: &'s [Sample], pitch: Pitch, parts: &mut Vec<Part<'s>>) {
    let Some(part) = Part::new(samples, pitch) else {
        return;
    };
    let gap = |at: usize| samples[at].inverse - samples[at - 1].inverse;
    let widest = (1..samples.len()).max_by(|&a, &b| gap(a).total_cmp(&gap(b)));
    match widest {
        Some(at) if part.residual > NOT_PLANE * part.sigma2 || part.is_too_steep(pitch) => {
            split(&samples[..at], pitch, parts);
            split(&samples[at..], pitch, parts);
        }
        _ => parts.push(part),
    }
}

impl<'s> Part<'s> {
    fn new(samples: &'s [Sample], pitch: Pitch) -> Option<Self> {
        let first = samples.first()?.inverse;
        let n = samples.len() as f64;
        let mean = |value: &dyn Fn(&Sample) -> f64| samples.iter().map(value).sum::<f64>() / n;
        let middle = [mean(&|s| s.at[0]), mean(&|s| s.at[1])];
        let (inverse, sigma2) = (mean(&|s| s.inverse), mean(&|s| s.sigma * s.sigma));
        let off = |s: &Sample| [s.at[0] - middle[0], s.at[1] - middle[1]];
        // A rig that claims no error at all still has that of its numbers.
        let expected = SLOPE * pitch[0].max(pitch[1]);
        let ridge = (sigma2 / (expected * expected)).max(1e-9);
        let (mut moments, mut with) = ([ridge, 0.0, ridge], [0.0; 2]);
        for sample in samples {
            let [x, y] = off(sample);
            let above = sample.inverse - inverse;
            moments = [moments[0] + x * x, moments[1] + x * y, moments[2] + y * y];
            with = [with[0] + x * above, with[1] + y * above];
        }
        let slope = solve(moments, with);
        let squares = samples.iter().map(|s| {
            let [x, y] = off(s);
            (s.inverse - inverse - slope[0] * x - slope[1] * y).powi(2)
        });
        let free = n - 3.0;
        let residual = if free > 0.0 {
            squares.sum::<f64>() / free
        } else {
            0.0
        };
        // Tangents of the incidence: what slopes there are beyond those that noise makes, and how little is known of them.
        let [a, b, d] = moments;
        let noise = sigma2 / (a * d - b * b);
        let slope2 = [noise * d, noise * a];
        let (mut tangent2, mut unknown2) = (0.0, 0.0);
        for axis in 0..2 {
            let of_slope = (pitch[axis] * inverse).powi(-2);
            tangent2 += of_slope * (slope[axis] * slope[axis] - slope2[axis]).max(0.0);
            unknown2 += of_slope * slope2[axis];
        }
        let log_unknown = 0.25 * ((1.0 + tangent2 + unknown2) / (1.0 + tangent2)).ln();
        let light = n * inverse * inverse / (1.0 + tangent2).sqrt() / log_unknown.exp();
        Some(Part {
            samples,
            first,
            middle,
            slope,
            moments,
            residual,
            sigma2,
            slope2,
            light,
            log_unknown,
        })
    }

    /// Beyond four standard deviations of the slope.
    fn is_too_steep(&self, pitch: Pitch) -> bool {
        (0..2).any(|axis| {
            let least = self.slope[axis].abs() - 4.0 * self.slope2[axis].sqrt();
            least > STEEPEST * pitch[axis]
        })
    }

    fn count(&self) -> f64 {
        self.samples.len() as f64
    }

    /// Range and variance, m and m²; over the whole macropixel, if the part fills it.
    fn range(&self, is_alone: bool) -> (f64, f64) {
        let fills = |axis: usize| is_alone && self.middle[axis].abs() < OFF_CENTRE;
        let place = [0, 1].map(|axis| if fills(axis) { 0.0 } else { self.middle[axis] });
        let from = |s: &Sample| [place[0] - s.at[0], place[1] - s.at[1]];
        let distance2 = |s: &Sample| {
            let [x, y] = from(s);
            x * x + y * y
        };
        let kept = self
            .samples
            .iter()
            .reduce(|a, b| if distance2(b) < distance2(a) { b } else { a })
            .expect("no part is empty");
        let way = from(kept);
        let inverse = kept.inverse + self.slope[0] * way[0] + self.slope[1] * way[1];
        let carried = solve(self.moments, way);
        let beside =
            carried[0] * (kept.at[0] - self.middle[0]) + carried[1] * (kept.at[1] - self.middle[1]);
        let along = carried[0] * way[0] + carried[1] * way[1];
        let variance = self.sigma2 * (1.0 + 2.0 * beside + along).max(0.0);
        // Where samples are missing, the part may reach on as far again.
        let mut variance = variance;
        if is_alone {
            for axis in 0..2 {
                let slope2 = self.slope[axis].powi(2) + self.slope2[axis];
                variance += slope2 * place[axis].powi(2) / 3.0;
            }
        }
        let spread = self.slope.iter().map(|g| g * g / 12.0).sum::<f64>();
        let square = inverse * inverse;
        let range_m = (square + spread) / (square + 3.0 * spread) / inverse;
        (range_m, variance * range_m.powi(4))
    }
}

/// x of A·x = b, for a symmetric A given by its 00, 01 and 11.
fn solve([a, b, d]: [f64; 3], [x, y]: [f64; 2]) -> [f64; 2] {
    let determinant = a * d - b * b;
    [(d * x - b * y) / determinant, (a * y - b * x) / determinant]
}
