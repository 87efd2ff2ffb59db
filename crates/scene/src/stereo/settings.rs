//! The settings of a matcher, and which of them are impossible.

use super::image::GreyImage;

/// Most disparities that are searched: a lane's number is a byte.
pub(super) const MOST_DISPARITIES: usize = 256;

/// Lanes for `disparities` disparities, rounded up to whole vectors.
pub(super) fn lanes(disparities: usize) -> usize {
    disparities.next_power_of_two().max(32)
}

/// Cost of a pixel without partner, and the most that a path can say.
pub(super) const NO_PARTNER: u8 = u8::MAX;

/// Sums of paths that must be kept for the way back (8 and 4 paths) take at most this, bytes. The thesis's rig at full resolution
/// takes 0.74 GiB.
const MOST_SUMS_BYTES: usize = 1 << 30;

/// Along which ways costs are gathered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Paths {
    /// From the left, the right and above.
    Three = 3,
    /// From the left, the right, above and below.
    Four = 4,
    /// From the left, the right, above and both corners above.
    Five = 5,
    /// From the left, the right, above, below and all corners.
    Eight = 8,
}

impl Paths {
    /// All of them.
    pub const ALL: [Paths; 4] = [Paths::Three, Paths::Four, Paths::Five, Paths::Eight];

    /// How many.
    pub fn number(self) -> usize {
        self as usize
    }

    pub(super) fn diagonals(self) -> bool {
        matches!(self, Paths::Five | Paths::Eight)
    }

    pub(super) fn upward(self) -> bool {
        matches!(self, Paths::Four | Paths::Eight)
    }
}

/// The neighbourhood whose pixels are compared with its centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Census {
    /// Columns, odd.
    pub cols: usize,
    /// Rows, odd.
    pub rows: usize,
}

impl Census {
    /// Comparisons, which is the greatest cost.
    pub(crate) fn bits(self) -> usize {
        self.cols * self.rows - 1
    }
}

/// A semi-global matcher. Its default was chosen on a real pair and on rendered ones (DESIGN.md, Stereo).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matcher {
    /// Least disparity, px; negative where points beyond infinity are to be found, which a rig out of adjustment sees.
    pub min_disparity: i32,
    /// Disparities that are searched, 1 to 256.
    pub disparities: usize,
    /// Paths.
    pub paths: Paths,
    /// Neighbourhood, 3 to 81 pixels.
    pub census: Census,
    /// Cost of a step of one disparity along a path, in comparisons of the census.
    pub p1: u8,
    /// Cost of a greater step where the image is even, likewise.
    pub p2: u8,
    /// Least cost of a greater step: at edges of the image.
    pub p2_least: u8,
    /// A step in brightness, of 256, that halves P2: surfaces end where brightness changes. 0: P2 is the same everywhere.
    pub p2_halved_by: u8,
    /// By how much the second best cost must exceed the best one, per cent. Disparities beside the best do not count.
    pub uniqueness_percent: u32,
    /// By how much the disparity of the pixel that was found in the right image may differ, px; `None`: it is not asked.
    pub left_right_px: Option<u32>,
    /// The middle of three by three disparities, where all are known.
    pub median: bool,
    /// Patches of fewer pixels are taken out. 0: none.
    pub speckle_px: usize,
    /// What belongs to a patch differs by no more from its neighbour, px.
    pub speckle_step_px: f32,
}

impl Default for Matcher {
    fn default() -> Self {
        Matcher {
            min_disparity: 0,
            disparities: 64,
            paths: Paths::Five,
            census: Census { cols: 7, rows: 7 },
            p1: 12,
            p2: 60,
            p2_least: 20,
            p2_halved_by: 10,
            uniqueness_percent: 10,
            left_right_px: Some(1),
            median: true,
            speckle_px: 100,
            speckle_step_px: 1.0,
        }
    }
}

/// Memory for the way back of 8 and 4 paths, 47 MB for 741 × 500 pixels and 64 disparities; to have it from the operating system anew takes as long
/// as a quarter of the matching.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    pub(super) kept: Vec<u16>,
}

/// Why two images are not matched.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum MatchError {
    /// Two sizes.
    #[error("the left image has {} x {} pixels and the right one {} x {}", left.0, left.1, right.0, right.1)]
    Sizes {
        /// Width and height of the left image.
        left: (usize, usize),
        /// Width and height of the right image.
        right: (usize, usize),
    },
    /// None, or more than 256.
    #[error("{0} disparities are impossible; give 1 to 256")]
    Disparities(usize),
    /// No pixel of the right image is a partner.
    #[error("disparities from {first} to {last} px reach no pixel of an image {width} pixels wide")]
    OutOfImage {
        /// Least disparity searched.
        first: i64,
        /// Greatest disparity searched.
        last: i64,
        /// Columns of the images.
        width: usize,
    },
    /// An even or too large neighbourhood.
    #[error("a census of {cols} x {rows} pixels: both must be odd, and 3 to 81 pixels in all")]
    Census {
        /// Columns.
        cols: usize,
        /// Rows.
        rows: usize,
    },
    /// P1 ≤ least P2 ≤ P2 ≤ 254 − comparisons does not hold.
    #[error(
        "penalties P1 {p1}, least P2 {p2_least} and P2 {p2} must not decrease, and P2 must be at most {most}"
    )]
    Penalties {
        /// P1.
        p1: u8,
        /// Least P2.
        p2_least: u8,
        /// P2.
        p2: u8,
        /// Most that P2 can be with this census.
        most: u8,
    },
    /// A step that is no length.
    #[error("a speckle step of {0} px is impossible; give one above 0")]
    SpeckleStep(f32),
    /// The way back would take too much memory.
    #[error("{paths} paths keep {mib} MiB of sums, more than 1024")]
    Memory {
        /// Paths.
        paths: usize,
        /// What they would keep, MiB.
        mib: usize,
    },
}

impl Matcher {
    /// Refuses images and settings that cannot be matched.
    ///
    /// # Errors
    /// Images of different size, or impossible settings.
    pub(super) fn check(&self, left: &GreyImage, right: &GreyImage) -> Result<(), MatchError> {
        let size = |image: &GreyImage| (image.width(), image.height());
        let &Matcher {
            disparities,
            census: Census { cols, rows },
            p1,
            p2,
            p2_least,
            ..
        } = self;
        if size(left) != size(right) {
            return Err(MatchError::Sizes {
                left: size(left),
                right: size(right),
            });
        }
        if !(1..=MOST_DISPARITIES).contains(&disparities) {
            return Err(MatchError::Disparities(disparities));
        }
        let width = left.width();
        let first = i64::from(self.min_disparity);
        let last = first + disparities as i64 - 1;
        if first >= width as i64 || last <= -(width as i64) {
            return Err(MatchError::OutOfImage { first, last, width });
        }
        let area = cols.saturating_mul(rows);
        if cols % 2 == 0 || rows % 2 == 0 || !(3..=81).contains(&area) {
            return Err(MatchError::Census { cols, rows });
        }
        // A path's cost of a pixel with a partner then stays below that of one without.
        let most = NO_PARTNER - 1 - self.census.bits() as u8;
        if p1 > p2_least || p2_least > p2 || p2 > most {
            return Err(MatchError::Penalties {
                p1,
                p2_least,
                p2,
                most,
            });
        }
        if self.speckle_step_px.is_nan() || self.speckle_step_px <= 0.0 {
            return Err(MatchError::SpeckleStep(self.speckle_step_px));
        }
        let sums = (left.pixels().len())
            .saturating_mul(lanes(disparities))
            .saturating_mul(size_of::<u16>());
        if self.paths.upward() && sums > MOST_SUMS_BYTES {
            return Err(MatchError::Memory {
                paths: self.paths.number(),
                mib: sums >> 20,
            });
        }
        Ok(())
    }

    /// P2 by the step in brightness along a path.
    pub(super) fn p2_by_step(&self) -> [u8; 256] {
        std::array::from_fn(|step| {
            if self.p2_halved_by == 0 {
                return self.p2;
            }
            let halved_by = u32::from(self.p2_halved_by);
            let p2 = u32::from(self.p2) * halved_by / (halved_by + step as u32);
            (p2 as u8).max(self.p2_least)
        })
    }
}
