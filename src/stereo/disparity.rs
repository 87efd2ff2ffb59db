//! The result of matching: a disparity for every pixel, or none.

/// Disparities of the left image, row by row.
#[derive(Debug, Clone)]
pub struct DisparityMap {
    pub(super) width: usize,
    pub(super) height: usize,
    /// NaN where there is none.
    pub(super) px: Vec<f32>,
}

/// Equal to the bit.
impl PartialEq for DisparityMap {
    fn eq(&self, other: &Self) -> bool {
        let bits = |map: &Self| map.px.iter().map(|d| d.to_bits()).collect::<Vec<_>>();
        (self.width, self.height) == (other.width, other.height) && bits(self) == bits(other)
    }
}

impl DisparityMap {
    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The disparity at (`row`, `col`), px: the partner's column in the right image is `col` minus it.
    ///
    /// # Panics
    /// Outside the image.
    pub fn at(&self, row: usize, col: usize) -> Option<f32> {
        assert!(col < self.width, "column {col} of {}", self.width);
        let d = self.px[row * self.width + col];
        (!d.is_nan()).then_some(d)
    }

    /// All disparities row by row, px; NaN where there is none.
    pub fn values_px(&self) -> &[f32] {
        &self.px
    }

    /// How many pixels have a disparity.
    pub fn matched(&self) -> usize {
        self.px.iter().filter(|d| !d.is_nan()).count()
    }
}
