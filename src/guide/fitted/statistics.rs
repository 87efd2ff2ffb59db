//! How disparities are wrong: the figures by which the drawn guide is held to the matcher.

use crate::guide::render::Crop;
use crate::scene::Scene;

/// A disparity is grossly wrong beyond this, binned pixels: many standard deviations of all others.
const GROSS_PX: f64 = 2.0;

/// Distances between pixels at which errors are compared, binned pixels.
pub(super) const APART: [usize; 4] = [1, 2, 4, 8];

/// Disparities of a crop beside the true ones, binned pixels.
pub(super) struct Disparities {
    pub(super) width: usize,
    /// Row by row; `None` where there is no answer.
    pub(super) found_px: Vec<Option<f64>>,
    /// `None` in the sky and where the right camera does not see what the left one does.
    pub(super) true_px: Vec<Option<f64>>,
}

/// What a crop of disparities comes to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Statistics {
    /// Share of pixels with a true disparity that have one.
    pub(super) valid: f64,
    /// Share of those that are more than two pixels off.
    pub(super) gross: f64,
    /// Standard deviation of the others.
    pub(super) sigma_px: f64,
    /// Correlation of their errors along rows, at [`APART`].
    pub(super) alike: [f64; 4],
    /// Share of pixels beside one without an answer that have none either.
    pub(super) invalid_beside: f64,
}

impl Disparities {
    fn error_px(&self, at: usize) -> Option<f64> {
        Some(self.found_px[at]? - self.true_px[at]?)
    }

    fn is_gross(&self, at: usize) -> bool {
        self.error_px(at).is_some_and(|e| e.abs() > GROSS_PX)
    }

    /// For the first pixels to the right of right edges of near surfaces: how far right, and the share of them that are told to be as near.
    pub(super) fn near_at_right_edges(&self, pixels: usize) -> Vec<(usize, f64)> {
        let edges: Vec<(usize, f64)> = (1..self.true_px.len() - pixels)
            .filter_map(|at| {
                let (near, far) = (self.true_px[at - 1]?, self.true_px[at]?);
                (near > far + 1.0).then_some((at, near))
            })
            .collect();
        let is_near = |px: Option<f64>, near: f64| px.is_some_and(|px| (px - near).abs() < 1.0);
        (0..pixels)
            .map(|off| {
                let as_near = edges
                    .iter()
                    .filter(|&&(at, near)| is_near(self.found_px[at + off], near));
                (off, as_near.count() as f64 / edges.len().max(1) as f64)
            })
            .collect()
    }

    /// All figures at once.
    pub(super) fn statistics(&self) -> Statistics {
        let seen: Vec<usize> = (0..self.true_px.len())
            .filter(|&at| self.true_px[at].is_some())
            .collect();
        let share = |n: usize, of: usize| n as f64 / of.max(1) as f64;
        let count = |is: &dyn Fn(usize) -> bool| seen.iter().filter(|&&at| is(at)).count();
        let valid = count(&|at| self.found_px[at].is_some());
        let gross = count(&|at| self.is_gross(at));
        let fine: Vec<Option<f64>> = (0..self.true_px.len())
            .map(|at| self.error_px(at).filter(|_| !self.is_gross(at)))
            .collect();
        let number = fine.iter().flatten().count().max(1) as f64;
        let mean_px = fine.iter().flatten().sum::<f64>() / number;
        let variance = fine
            .iter()
            .flatten()
            .map(|e| (e - mean_px).powi(2))
            .sum::<f64>()
            / number;
        let pairs = |apart: usize| {
            let width = self.width;
            (0..fine.len())
                .filter_map(move |at| (at % width + apart < width).then_some((at, at + apart)))
        };
        let alike = APART.map(|apart| {
            let products: Vec<f64> = pairs(apart)
                .filter_map(|(a, b)| Some((fine[a]? - mean_px) * (fine[b]? - mean_px)))
                .collect();
            products.iter().sum::<f64>() / products.len().max(1) as f64 / variance.max(1e-12)
        });
        let beside = |is: &dyn Fn(usize) -> bool| {
            let firsts: Vec<(usize, usize)> = pairs(1)
                .filter(|&(a, b)| is(a) && self.true_px[b].is_some())
                .collect();
            share(firsts.iter().filter(|&&(_, b)| is(b)).count(), firsts.len())
        };
        Statistics {
            valid: share(valid, seen.len()),
            gross: share(gross, valid),
            sigma_px: variance.sqrt(),
            alike,
            invalid_beside: beside(&|at| self.true_px[at].is_some() && self.found_px[at].is_none()),
        }
    }
}

/// True disparities of a crop, binned pixels.
pub(super) fn true_disparities_px(scene: &Scene, crop: Crop) -> Vec<Option<f64>> {
    let rig = crate::guide::StereoRig::new(scene, 0);
    let pixels = (0..crop.height as usize)
        .flat_map(|row| (0..crop.width as usize).map(move |col| (row, col)));
    pixels
        .map(|(row, col)| rig.true_disparity_px(crop.middle(row, col)))
        .map(|px| px.map(|px| px / f64::from(crop.binning)))
        .collect()
}
