//! The result of matching: a disparity for every pixel, or none.

/// Neighbours on one surface differ by no more, px: a road's grow by two thirds a row.
const STEP_PX: f32 = 1.0;

/// Disparities of the left image, row by row.
#[derive(Debug, Clone)]
pub struct DisparityMap {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// NaN where there is none.
    pub(crate) px: Vec<f32>,
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
    pub(crate) fn disparity_px(&self, row: usize, col: usize) -> Option<f32> {
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

    /// Takes out the answers of pixels, numbered row by row, that are not to be kept.
    pub(crate) fn keep(&mut self, is_kept: impl Fn(usize, f32) -> bool) {
        for (at, px) in self.px.iter_mut().enumerate() {
            if !px.is_nan() && !is_kept(at, *px) {
                *px = f32::NAN;
            }
        }
    }

    /// Which answers may be a nearer surface's that begins up to `reach_px` beside them: costs compare neighbourhoods, so its edge is found anywhere
    /// within half of one. Length width·height, row by row.
    ///
    /// Along a row or a column a surface ends where the next answer differs by more than a pixel, however many are missing between, for the
    /// right camera does not see what a near surface hides. The middle of one that is narrower than both of its rims stays. With `gaps_end`, for
    /// images of which edges alone have answers, surfaces end where answers are missing, too, and no middle stays.
    pub(crate) fn rims(&self, reach_px: usize, gaps_end: bool) -> Vec<bool> {
        let mut rims = vec![false; self.px.len()];
        let (width, height) = (self.width, self.height);
        for row in 0..height {
            let line: Vec<usize> = (row * width..(row + 1) * width).collect();
            self.rims_along(&line, reach_px, gaps_end, &mut rims);
        }
        for col in 0..width {
            let line: Vec<usize> = (0..height).map(|row| row * width + col).collect();
            self.rims_along(&line, reach_px, gaps_end, &mut rims);
        }
        rims
    }

    /// Rims along a row or a column, `line`.
    fn rims_along(&self, line: &[usize], reach_px: usize, gaps_end: bool, rims: &mut [bool]) {
        // Places along the line, and disparities.
        let answered = (0..line.len()).map(|at| (at, self.px[line[at]]));
        let answered: Vec<(usize, f32)> = answered.filter(|(_, px)| !px.is_nan()).collect();
        let is_gap = |a: usize, b: usize| gaps_end && b > a + 1;
        let surfaces = answered
            .chunk_by(|a, b| !is_gap(a.0, b.0) && (a.1 - b.1).abs() <= STEP_PX)
            .collect::<Vec<_>>();
        for (number, surface) in surfaces.iter().enumerate() {
            let (first, last) = (surface[0], surface[surface.len() - 1]);
            let before = number.checked_sub(1).map(|n| surfaces[n]);
            let begins = match before.and_then(|before| before.last()) {
                Some(before) => is_gap(before.0, first.0) || before.1 < first.1,
                None => gaps_end && first.0 > 0,
            };
            let ends = match surfaces.get(number + 1) {
                Some(after) => is_gap(last.0, after[0].0) || after[0].1 < last.1,
                None => gaps_end && last.0 + 1 < line.len(),
            };
            let most = if begins && ends && !gaps_end {
                (surface.len() - 1) / 2
            } else {
                surface.len()
            };
            let reach = |is_rim: bool| if is_rim { reach_px.min(most) } else { 0 };
            let from_first = &surface[..reach(begins)];
            let to_last = &surface[surface.len() - reach(ends)..];
            for (at, _) in from_first.iter().chain(to_last) {
                rims[line[*at]] = true;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: f32 = f32::NAN;

    /// Rims of one row, and of the same as a column.
    fn rims_of(px: &[f32], reach_px: usize, gaps_end: bool) -> String {
        let rims = |width, height| {
            let px = px.to_vec();
            DisparityMap { width, height, px }.rims(reach_px, gaps_end)
        };
        let row = rims(px.len(), 1);
        assert_eq!(row, rims(1, px.len()));
        row.iter().map(|&is| if is { '#' } else { '.' }).collect()
    }

    #[test]
    fn rims_are_of_the_nearer_surface() {
        let near = [5.0, 5.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.5, 4.0];
        assert_eq!(rims_of(&near, 2, false), "..##..##.");
        // What is hidden does not hide the edge; a farther surface has none.
        let hidden = [5.0, NONE, NONE, 9.0, 9.0, 9.0, 9.0, 12.0];
        assert_eq!(rims_of(&hidden, 2, false), "...##..#");
        // The middle of what is narrower than its rims.
        let post = [5.0, 9.0, 9.0, 9.0, 5.0];
        assert_eq!(rims_of(&post, 3, false), ".#.#.");
        assert_eq!(rims_of(&[5.0, 9.0, 5.0], 3, false), "...");
        // A slant is one surface.
        assert_eq!(rims_of(&[5.0, 5.8, 6.6, 7.4], 3, false), "....");
    }

    #[test]
    fn gaps_end_surfaces_where_edges_alone_have_answers() {
        let edge = [NONE, 9.0, 9.0, 9.0, 9.0, 9.0, NONE, 9.0];
        assert_eq!(rims_of(&edge, 2, true), ".##.##.#");
        assert_eq!(rims_of(&edge, 2, false), "........");
        assert_eq!(rims_of(&edge, 3, true), ".#####.#");
        // Beyond the image nothing ends.
        assert_eq!(rims_of(&[9.0, 9.0, 9.0], 2, true), "...");
    }

    #[test]
    fn what_is_not_kept_has_no_answer() {
        let px = vec![1.0, NONE, 3.0, 4.0];
        let mut map = DisparityMap {
            width: 2,
            height: 2,
            px,
        };
        map.keep(|at, px| at != 3 && px > 2.0);
        assert_eq!(map.matched(), 1);
        assert_eq!(map.disparity_px(1, 0), Some(3.0));
    }
}
