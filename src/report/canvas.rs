//! A small picture of palette indices, with rectangles and text.

use font8x8::legacy::BASIC_LEGACY;

/// Width and height of a character, px.
pub const CHARACTER_PX: usize = 8;

/// Pixels as indices into a palette, row by row from the top left.
#[derive(Debug, Clone)]
pub struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Canvas {
    /// A canvas of one colour.
    pub fn new(width: usize, height: usize, colour: u8) -> Self {
        Canvas {
            width,
            height,
            pixels: vec![colour; width * height],
        }
    }

    /// Width, px.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, px.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, length width·height.
    pub fn pixels(&self) -> &[u8] {
        &self.pixels
    }

    /// Fills a rectangle; what lies outside the canvas is cut off.
    pub fn fill(&mut self, left: usize, top: usize, width: usize, height: usize, colour: u8) {
        let right = left.saturating_add(width).min(self.width);
        let bottom = top.saturating_add(height).min(self.height);
        for y in top..bottom {
            if left < right {
                self.pixels[y * self.width + left..y * self.width + right].fill(colour);
            }
        }
    }

    /// Writes text from its top left corner; a character outside printable ASCII becomes `?`.
    pub fn text(&mut self, left: usize, top: usize, text: &str, colour: u8) {
        for (i, character) in text.chars().enumerate() {
            let printable = (' '..='~').contains(&character);
            let glyph = BASIC_LEGACY[if printable {
                character as usize
            } else {
                '?' as usize
            }];
            for (y, bits) in glyph.into_iter().enumerate() {
                for x in (0..CHARACTER_PX).filter(|x| bits >> x & 1 == 1) {
                    self.fill(left + i * CHARACTER_PX + x, top + y, 1, 1, colour);
                }
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
        canvas.text(0, 0, "W\u{1F600}", 1);
    }

    #[test]
    fn letters_leave_ink() {
        let mut canvas = Canvas::new(16, 8, 0);
        canvas.text(0, 0, "L ", 1);
        let ink = |from: usize| {
            let in_cell = |i: &usize| (from..from + 8).contains(&(i % 16));
            (0..canvas.pixels().len())
                .filter(|i| in_cell(i) && canvas.pixels()[*i] == 1)
                .count()
        };
        assert!(ink(0) > 10);
        assert_eq!(ink(8), 0);
    }
}
