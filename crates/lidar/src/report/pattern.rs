//! What cells without a value look like: greys in tiles of 4×4 pixels.
//!
//! Every colour of the depth scale has one lightness. In print without colours a plain grey would therefore be a depth. A
//! tile has two greys that are far apart, so a cell of 4 pixels or more is no depth in print either. Only white and black are plain: the
//! scale has neither. Tiles repeat from the top left corner of a map, over all its cells. Cells that are smaller than 3 pixels have
//! the tile's mean grey.

/// Pixels of a tile's side.
pub(crate) const TILE_PX: usize = 4;

/// Smallest cell that shows the tile, pixels of its side.
pub(crate) const SMALLEST_TILED_CELL_PX: usize = 3;

/// A tile of greys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pattern {
    /// sRGB levels, row by row from the top left.
    levels: [[u8; TILE_PX]; TILE_PX],
}

impl Pattern {
    /// A plain grey.
    pub const fn plain(level: u8) -> Self {
        Pattern {
            levels: [[level; TILE_PX]; TILE_PX],
        }
    }

    /// A tile with `ink` where `rows` have a `#`, and `ground` elsewhere.
    pub const fn tile(ground: u8, ink: u8, rows: [&[u8; TILE_PX]; TILE_PX]) -> Self {
        let mut levels = [[ground; TILE_PX]; TILE_PX];
        let mut at = 0;
        while at < TILE_PX * TILE_PX {
            let (y, x) = (at / TILE_PX, at % TILE_PX);
            if rows[y][x] == b'#' {
                levels[y][x] = ink;
            }
            at += 1;
        }
        Pattern { levels }
    }

    /// sRGB levels, row by row from the top left.
    pub fn levels(&self) -> &[[u8; TILE_PX]; TILE_PX] {
        &self.levels
    }

    /// The grey of a pixel of a map.
    pub(super) fn level(&self, x: usize, y: usize) -> u8 {
        self.levels[y % TILE_PX][x % TILE_PX]
    }

    /// The grey of cells that are too small for a tile.
    pub fn mean(&self) -> u8 {
        let sum: u32 = self.levels.iter().flatten().map(|&l| u32::from(l)).sum();
        let pixels = (TILE_PX * TILE_PX) as u32;
        ((sum + pixels / 2) / pixels) as u8
    }

    /// The plain pattern of its mean.
    pub(super) fn blurred(&self) -> Self {
        Pattern::plain(self.mean())
    }
}

/// Cells without a value for the same reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Category<'a> {
    /// In the legend.
    pub name: &'a str,
    /// What the cells look like.
    pub pattern: Pattern,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_repeat_and_small_cells_have_their_mean() {
        let tile = Pattern::tile(200, 40, [b"#...", b"....", b"....", b"...#"]);
        assert_eq!([tile.level(4, 8), tile.level(5, 8)], [40, 200]);
        assert_eq!(tile.level(7, 3), 40);
        assert_eq!(tile.mean(), 180);
        assert_eq!(tile.blurred(), Pattern::plain(180));
    }
}
