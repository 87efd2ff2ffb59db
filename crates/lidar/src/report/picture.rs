//! Pictures in true colour, composed of panels: rectangles, lines, dots and text in Noto Sans Mono.
//!
//! What lies outside the picture is cut off. A [`DepthImage`](super::DepthImage) alone is an indexed picture of its own kind.

use std::io::{self, Write};
use std::path::Path;

use super::canvas::{CHARACTER_WIDTH_PX, LINE_PX, letters};
use super::colour::{Rgb, scale_colour};
use super::image::of_png;
use crate::files::{InputError, OutputFile};

/// Background of pictures.
pub const PAPER: Rgb = [255; 3];
/// Text and outlines.
pub const INK: Rgb = [20; 3];
/// Where there is nothing to show.
pub const VOID: Rgb = [226; 3];
/// What is pointed at.
pub const MARK: Rgb = [190, 20, 60];

/// Height of a line of text, px.
pub const TEXT_PX: usize = LINE_PX;

/// Width of some text, px.
pub fn text_width(text: &str) -> usize {
    text.chars().count() * CHARACTER_WIDTH_PX
}

/// The colour of `value` on a scale from `least` (yellow) to `most` (violet); beyond, the end's.
pub fn colour_of(value: f64, (least, most): (f64, f64)) -> Rgb {
    scale_colour((value - least) / (most - least))
}

/// A picture, drawn from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    width: usize,
    height: usize,
    pixels: Vec<Rgb>,
}

impl Picture {
    /// An empty picture.
    pub fn new(width: usize, height: usize) -> Self {
        Picture {
            width,
            height,
            pixels: vec![PAPER; width * height],
        }
    }

    /// Fills the rectangle of this size at `(left, top)`.
    pub fn fill(
        &mut self,
        (left, top): (usize, usize),
        (width, height): (usize, usize),
        colour: Rgb,
    ) {
        let right = left.saturating_add(width).min(self.width);
        let bottom = top.saturating_add(height).min(self.height);
        for y in top..bottom {
            if left < right {
                self.pixels[y * self.width + left..y * self.width + right].fill(colour);
            }
        }
    }

    /// Draws the outline of a rectangle, `thick` pixels inwards.
    pub fn outline(
        &mut self,
        (left, top): (usize, usize),
        (width, height): (usize, usize),
        thick: usize,
        colour: Rgb,
    ) {
        let (right, bottom) = (
            (left + width).saturating_sub(thick),
            (top + height).saturating_sub(thick),
        );
        self.fill((left, top), (width, thick), colour);
        self.fill((left, bottom), (width, thick), colour);
        self.fill((left, top), (thick, height), colour);
        self.fill((right, top), (thick, height), colour);
    }

    /// Draws a straight line between two points, which may lie outside.
    pub fn line(&mut self, from: (f64, f64), to: (f64, f64), colour: Rgb) {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let steps = dx.abs().max(dy.abs()).ceil().clamp(1.0, 1e5);
        for step in 0..=steps as usize {
            let share = step as f64 / steps;
            self.dot((from.0 + share * dx, from.1 + share * dy), 1, colour);
        }
    }

    /// A square of `side` pixels about a point.
    pub fn dot(&mut self, (x, y): (f64, f64), side: usize, colour: Rgb) {
        let corner = |at: f64| (at - 0.5 * side as f64).round();
        let (left, top) = (corner(x), corner(y));
        if left >= 0.0 && top >= 0.0 {
            self.fill((left as usize, top as usize), (side, side), colour);
        }
    }

    /// Writes text from its top left corner; a character outside printable ASCII becomes `?`.
    pub fn text(&mut self, (left, top): (usize, usize), text: &str, colour: Rgb) {
        letters(text, |x, y, ink| {
            let (x, y) = (left + x, top + y);
            if ink > 0 && x < self.width && y < self.height {
                let below = &mut self.pixels[y * self.width + x];
                *below = mixed(*below, colour, f64::from(ink) / 255.0);
            }
        });
    }

    /// A raster of cells, row by row, each `cell` pixels wide and high.
    ///
    /// # Panics
    /// When the cells do not fill rows of `cols`.
    pub fn raster(
        &mut self,
        (left, top): (usize, usize),
        cols: usize,
        (wide, high): (usize, usize),
        cells: impl IntoIterator<Item = Rgb>,
    ) {
        let mut drawn = 0;
        for (i, colour) in cells.into_iter().enumerate() {
            let at = (left + i % cols * wide, top + i / cols * high);
            self.fill(at, (wide, high), colour);
            drawn += 1;
        }
        assert_eq!(drawn % cols, 0, "cells do not fill rows of {cols}");
    }

    /// A bar of the colour scale from `least` to `most`, left to right, with its ends beside it.
    pub fn scale(
        &mut self,
        (left, top): (usize, usize),
        width: usize,
        (least, most): (f64, f64),
        unit: &str,
    ) {
        let (from, to) = (format!("{least:.0} "), format!(" {most:.0} {unit}"));
        let bar = width.saturating_sub(text_width(&from) + text_width(&to));
        self.text((left, top), &from, INK);
        let bar_left = left + text_width(&from);
        for x in 0..bar {
            let colour = scale_colour(x as f64 / bar as f64);
            self.fill((bar_left + x, top + 2), (1, TEXT_PX - 4), colour);
        }
        self.text((bar_left + bar, top), &to, INK);
    }

    /// Writes the picture as a PNG file.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_png(&self, path: &Path) -> Result<(), InputError> {
        OutputFile::write_with(path, |file| self.encode(file))
    }

    fn encode(&self, file: &mut dyn Write) -> io::Result<()> {
        let too_large = |_| io::Error::other("the picture is too large");
        let width = u32::try_from(self.width).map_err(too_large)?;
        let height = u32::try_from(self.height).map_err(too_large)?;
        let mut encoder = png::Encoder::new(file, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().map_err(of_png)?;
        writer
            .write_image_data(self.pixels.as_flattened())
            .map_err(of_png)?;
        writer.finish().map_err(of_png)?;
        Ok(())
    }
}

fn mixed(below: Rgb, above: Rgb, share: f64) -> Rgb {
    std::array::from_fn(|channel| {
        let (a, b) = (f64::from(below[channel]), f64::from(above[channel]));
        (a + share * (b - a)).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Picture {
        fn pixel(&self, (x, y): (usize, usize)) -> Rgb {
            self.pixels[y * self.width + x]
        }
    }

    #[test]
    fn what_lies_outside_is_cut_off() {
        let mut picture = Picture::new(20, 10);
        picture.fill((15, 8), (100, 100), MARK);
        picture.outline((10, 5), (50, 50), 2, INK);
        picture.line((-5.0, -5.0), (40.0, 30.0), INK);
        picture.dot((-3.0, 4.0), 3, MARK);
        picture.text((17, 0), "W\u{1F600}", INK);
        picture.scale((0, 0), 5, (0.0, 1.0), "m");
        assert_eq!(picture.pixel((15, 9)), MARK);
        assert_eq!(picture.pixel((12, 5)), INK);
    }

    #[test]
    fn a_picture_comes_back_as_drawn() {
        let mut picture = Picture::new(6, 4);
        picture.raster((1, 1), 2, (2, 1), [MARK, INK, VOID, PAPER]);
        let mut bytes = Vec::new();
        picture.encode(&mut bytes).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(bytes))
            .read_info()
            .unwrap();
        let mut buffer = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut buffer).unwrap();
        assert_eq!(buffer, picture.pixels.as_flattened());
        assert_eq!([picture.pixel((2, 1)), picture.pixel((3, 1))], [MARK, INK]);
        assert_eq!(
            [picture.pixel((1, 2)), picture.pixel((0, 0))],
            [VOID, PAPER]
        );
    }

    #[test]
    fn letters_leave_smooth_ink() {
        let mut picture = Picture::new(text_width("S"), TEXT_PX);
        picture.text((0, 0), "S", INK);
        let greys = picture.pixels.iter().filter(|&&p| p != PAPER && p != INK);
        assert!(greys.count() > 5);
    }
}
