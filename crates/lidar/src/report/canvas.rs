//! A small picture of palette indices, with rectangles and text in Noto Sans Mono.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

const WEIGHT: FontWeight = FontWeight::Regular;
const SIZE: RasterHeight = RasterHeight::Size16;

/// Width of a character, px.
pub(super) const CHARACTER_WIDTH_PX: usize = get_raster_width(WEIGHT, SIZE);

/// Height of a line of text, px.
pub(super) const LINE_PX: usize = SIZE.val();

/// Pixels as indices into a palette, row by row from the top left.
#[derive(Debug, Clone)]
pub(super) struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Canvas {
    /// A canvas of one colour.
    pub(super) fn new(width: usize, height: usize, colour: u8) -> Self {
        Canvas {
            width,
            height,
            pixels: vec![colour; width * height],
        }
    }

    /// Width, px.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Height, px.
    pub(super) fn height(&self) -> usize {
        self.height
    }

    /// All pixels, length width·height.
    pub(super) fn pixels(&self) -> &[u8] {
        &self.pixels
    }

    /// Fills a rectangle; what lies outside the canvas is cut off.
    pub(super) fn fill(
        &mut self,
        left: usize,
        top: usize,
        width: usize,
        height: usize,
        colour: u8,
    ) {
        let right = left.saturating_add(width).min(self.width);
        let bottom = top.saturating_add(height).min(self.height);
        for y in top..bottom {
            if left < right {
                self.pixels[y * self.width + left..y * self.width + right].fill(colour);
            }
        }
    }

    /// Writes text from its top left corner; a character outside printable ASCII becomes `?`.
    ///
    /// `shades` are the palette's colours from paper to ink; the first leaves what is there.
    pub(super) fn text(&mut self, left: usize, top: usize, text: &str, shades: &[u8]) {
        debug_assert!(shades.len() > 1, "no ink");
        letters(text, |x, y, ink| {
            let shade = (usize::from(ink) * (shades.len() - 1) + 127) / 255;
            if shade > 0 {
                self.fill(left + x, top + y, 1, 1, shades[shade]);
            }
        });
    }
}

/// Tells `put` of every pixel of a line of text: column, row and ink, 0 to 255. A character outside printable ASCII becomes `?`.
pub(super) fn letters(text: &str, mut put: impl FnMut(usize, usize, u8)) {
    for (i, character) in text.chars().enumerate() {
        let is_printable = (' '..='~').contains(&character);
        let character = if is_printable { character } else { '?' };
        let Some(glyph) = get_raster(character, WEIGHT, SIZE) else {
            continue;
        };
        for (y, row) in glyph.rows().enumerate() {
            for (x, &ink) in row.iter().enumerate() {
                put(i * CHARACTER_WIDTH_PX + x, y, ink);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawing_over_the_edge_is_cut_off() {
        let mut canvas = Canvas::new(4, 3, 0);
        canvas.fill(2, 1, 100, 100, 5);
        canvas.fill(9, 9, 1, 1, 7);
        assert_eq!(canvas.pixels(), [0, 0, 0, 0, 0, 0, 5, 5, 0, 0, 5, 5]);
        canvas.text(0, 0, "W\u{1F600}", &[0, 1]);
    }

    #[test]
    fn letters_leave_smooth_ink() {
        let (width, shades) = (2 * CHARACTER_WIDTH_PX, [0, 1, 2, 3]);
        let mut canvas = Canvas::new(width, LINE_PX, 9);
        canvas.text(0, 0, "S ", &shades);
        let (letter, space): (Vec<_>, Vec<_>) =
            (canvas.pixels().iter().enumerate()).partition(|(i, _)| i % width < CHARACTER_WIDTH_PX);
        for shade in [1, 2, 3, 9] {
            assert!(letter.iter().any(|&(_, &s)| s == shade), "no {shade}");
        }
        assert!(space.iter().all(|&(_, &s)| s == 9));
    }
}
