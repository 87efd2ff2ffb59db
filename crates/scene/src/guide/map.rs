//! What every guide gives: a range and its standard deviation for each macropixel.

/// A guide's estimate for every macropixel.
#[derive(Debug, Clone, PartialEq)]
pub struct GuideMap {
    /// Rows of the array.
    pub rows: u32,
    /// Columns of the array.
    pub cols: u32,
    /// Distance from the lidar to the estimated point (radial, as a time of flight measures it,
    /// not z), m; `None` where the guide has no estimate. Row by row, length rows·cols.
    pub range_m: Vec<Option<f64>>,
    /// Standard deviation that the guide claims for its range, m; infinite where it has no estimate.
    /// Length rows·cols.
    pub sigma_m: Vec<f64>,
}

impl GuideMap {
    /// A map of pairs of range and standard deviation, m, row by row.
    ///
    /// # Panics
    /// When there are not rows·cols of them.
    pub fn new(
        rows: u32,
        cols: u32,
        estimates: impl IntoIterator<Item = Option<(f64, f64)>>,
    ) -> Self {
        let (range_m, sigma_m): (Vec<Option<f64>>, Vec<f64>) = estimates
            .into_iter()
            .map(|estimate| match estimate {
                Some((range_m, sigma_m)) => (Some(range_m), sigma_m),
                None => (None, f64::INFINITY),
            })
            .unzip();
        assert_eq!(range_m.len(), rows as usize * cols as usize);
        GuideMap {
            rows,
            cols,
            range_m,
            sigma_m,
        }
    }

    /// Range and standard deviation of a macropixel, by its number, m.
    pub fn estimate_of(&self, pixel: usize) -> Option<(f64, f64)> {
        Some((self.range_m[pixel]?, self.sigma_m[pixel]))
    }

    /// This map, with another's estimates where it has none.
    pub(super) fn or(&self, other: &GuideMap) -> Self {
        let either = |pixel| self.estimate_of(pixel).or(other.estimate_of(pixel));
        GuideMap::new(self.rows, self.cols, (0..self.range_m.len()).map(either))
    }

    /// How many macropixels have an estimate.
    pub fn guided(&self) -> usize {
        self.range_m.iter().flatten().count()
    }
}
