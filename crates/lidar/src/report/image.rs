//! Depth maps as PNG pictures, with a colour bar for the depths and a legend for what has none.
//!
//! ```text
//!   title
//!   ┌────────────┐ █ 20 m
//!   │    map     │ █ 40 m
//!   └────────────┘ █
//!   □ no surface 972   ▨ no guide 60   …      as many to a row as fit
//! ```
//!
//! Indexed colours keep the file small and every macropixel a clean square.

use std::io::{self, Write};
use std::path::Path;

use super::canvas::{CHARACTER_WIDTH_PX, Canvas, LINE_PX};
use super::colour::{Rgb, scale_colour};
use super::pattern::{Category, Pattern, SMALLEST_TILED_CELL_PX};
use crate::files::{InputError, OutputFile};

/// Palette: depth colours 0 to `STEPS - 1`, shades from paper to ink, then the greys of categories.
const STEPS: u8 = 224;
const SHADES: [u8; 16] = {
    let mut shades = [0; 16];
    let mut i = 0;
    while i < 16 {
        shades[i] = STEPS + i as u8;
        i += 1;
    }
    shades
};
const PAPER: u8 = SHADES[0];
const INK: u8 = SHADES[15];
/// The first grey of a category, and how many greys there may be.
const GREYS: u8 = INK + 1;
const MOST_GREYS: usize = u8::MAX as usize - INK as usize;
const PAPER_GREY: f64 = 255.0;
const INK_GREY: f64 = 20.0;

const MARGIN_PX: usize = 12;
const BAR_PX: usize = 18;
/// Longest tick label, such as `-1234.5 m`.
const LABEL_CHARACTERS: usize = 9;
const TICK_PX: usize = 4;
/// From the bar to its labels; wide enough that a tick does not look like a minus sign.
const LABEL_OFFSET_PX: usize = 10;
/// Side of a category's sample, and from there to its name.
const SAMPLE_PX: usize = 14;
const SAMPLE_OFFSET_PX: usize = 6;
const LEGEND_LINE_PX: usize = LINE_PX + 6;

/// What a square of the map shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ImageCell {
    /// A depth, m.
    Depth(f32),
    /// No depth, for the reason of this number among [`DepthImage::categories`].
    Category(usize),
}

/// A depth map to be drawn.
#[derive(Debug, Clone)]
pub struct DepthImage<'a> {
    /// Above the picture, in ASCII; cut off where the picture ends.
    pub title: &'a str,
    /// Squares in a row.
    pub cols: usize,
    /// Squares, row by row from the top left.
    pub cells: &'a [ImageCell],
    /// Ends of the depth scale, m: yellow, violet. Depths beyond take the end's colour. Where yellow is the greater number, as of disparities,
    /// the scale falls.
    pub range_m: (f32, f32),
    /// What stands behind numbers of the scale.
    pub unit: &'a str,
    /// Why cells have no depth. Those that occur stand in the legend with their numbers. All together they have at most 16 greys.
    pub categories: &'a [Category<'a>],
    /// Screen pixels of a square's side.
    pub scale: usize,
}

impl DepthImage<'_> {
    /// Writes the map as a PNG picture.
    ///
    /// # Errors
    /// When the file cannot be written, or a picture of this size cannot be made.
    ///
    /// # Panics
    /// When the cells do not fill rows of `cols`, there are none, `scale` is zero, categories have too many greys, or the range's
    /// ends are equal.
    pub fn write_png(&self, path: &Path) -> Result<(), InputError> {
        let greys = self.greys();
        let canvas = self.draw(&greys);
        OutputFile::write_with(path, |file| encode(file, &canvas, &greys))
    }

    /// A category's pattern in cells of the map.
    fn pattern_in_map(&self, category: usize) -> Pattern {
        let pattern = self.categories[category].pattern;
        if self.scale < SMALLEST_TILED_CELL_PX {
            pattern.blurred()
        } else {
            pattern
        }
    }

    /// Every grey that categories have, in map and legend.
    fn greys(&self) -> Vec<u8> {
        let patterns = self.categories.iter().map(|category| category.pattern);
        let in_map = (0..self.categories.len()).map(|category| self.pattern_in_map(category));
        let mut greys: Vec<u8> = (patterns.chain(in_map))
            .flat_map(|pattern| pattern.levels().concat())
            .collect();
        greys.sort_unstable();
        greys.dedup();
        assert!(greys.len() <= MOST_GREYS, "too many greys");
        greys
    }

    fn draw(&self, greys: &[u8]) -> Canvas {
        let &DepthImage {
            cols, cells, scale, ..
        } = self;
        let (min_m, max_m) = self.range_m;
        assert!(
            !cells.is_empty() && cols > 0 && scale > 0,
            "an empty picture"
        );
        assert_eq!(cells.len() % cols, 0, "cells do not fill rows of {cols}");
        assert!(min_m != max_m, "depth range {min_m} to {max_m}");
        let range_m = (f64::from(min_m), f64::from(max_m));
        let (map_width, map_height) = (cols * scale, cells.len() / cols * scale);
        let map_top = 2 * MARGIN_PX + LINE_PX;
        // The bar keeps room for two labels beside maps of a few pixels.
        let bar_height = map_height.max(4 * LINE_PX);
        let bar_left = 2 * MARGIN_PX + map_width;
        let labels_px = LABEL_OFFSET_PX + LABEL_CHARACTERS * CHARACTER_WIDTH_PX;
        let width = bar_left + BAR_PX + labels_px + MARGIN_PX;
        let legend_top = map_top + bar_height + MARGIN_PX;
        let (entries, legend_height) = self.legend(width);
        let height = legend_top + legend_height;

        let mut canvas = Canvas::new(width, height, PAPER);
        canvas.text(MARGIN_PX, MARGIN_PX, self.title, &SHADES);
        for (i, cell) in cells.iter().enumerate() {
            let (left, top) = (MARGIN_PX + i % cols * scale, map_top + i / cols * scale);
            match *cell {
                ImageCell::Depth(depth_m) => {
                    let colour = step(f64::from(depth_m), range_m);
                    canvas.fill(left, top, scale, scale, colour);
                }
                ImageCell::Category(category) => {
                    let pattern = self.pattern_in_map(category);
                    let origin = (MARGIN_PX, map_top);
                    tile(&mut canvas, origin, (left, top), scale, pattern, greys);
                }
            }
        }
        // White cells end at a line.
        let (left, top) = (MARGIN_PX - 1, map_top - 1);
        canvas.fill(left, top, map_width + 2, 1, INK);
        canvas.fill(left, top + map_height + 1, map_width + 2, 1, INK);
        canvas.fill(left, top, 1, map_height + 2, INK);
        canvas.fill(left + map_width + 1, top, 1, map_height + 2, INK);
        draw_bar(
            &mut canvas,
            bar_left,
            map_top,
            bar_height,
            range_m,
            self.unit,
        );
        for (category, text, left, top) in entries {
            let top = legend_top + top;
            let sample_top = top + (LINE_PX - SAMPLE_PX) / 2;
            canvas.fill(left, sample_top, SAMPLE_PX, SAMPLE_PX, INK);
            let corner = (left + 1, sample_top + 1);
            let pattern = self.categories[category].pattern;
            tile(&mut canvas, corner, corner, SAMPLE_PX - 2, pattern, greys);
            canvas.text(left + SAMPLE_PX + SAMPLE_OFFSET_PX, top, &text, &SHADES);
        }
        canvas
    }

    /// Categories that occur, each with its text, left and top; and the height of all.
    fn legend(&self, width: usize) -> (Vec<(usize, String, usize, usize)>, usize) {
        let (mut left, mut top) = (MARGIN_PX, 0);
        let mut entries = Vec::new();
        for (category, Category { name, .. }) in self.categories.iter().enumerate() {
            let is_this = |cell: &&ImageCell| **cell == ImageCell::Category(category);
            let count = self.cells.iter().filter(is_this).count();
            if count == 0 {
                continue;
            }
            let text = format!("{name} {count}");
            let entry_px = SAMPLE_PX + SAMPLE_OFFSET_PX + text.chars().count() * CHARACTER_WIDTH_PX;
            if left > MARGIN_PX && left + entry_px + MARGIN_PX > width {
                (left, top) = (MARGIN_PX, top + LEGEND_LINE_PX);
            }
            entries.push((category, text, left, top));
            left += entry_px + 2 * MARGIN_PX;
        }
        if entries.is_empty() {
            (entries, 0)
        } else {
            (entries, top + LEGEND_LINE_PX + MARGIN_PX / 2)
        }
    }
}

/// Fills a square at `corner` with a pattern that repeats from `origin`.
fn tile(
    canvas: &mut Canvas,
    origin: (usize, usize),
    (left, top): (usize, usize),
    side: usize,
    pattern: Pattern,
    greys: &[u8],
) {
    for y in top..top + side {
        for x in left..left + side {
            let level = pattern.level(x - origin.0, y - origin.1);
            let number = greys.binary_search(&level).expect("greys of all patterns");
            canvas.fill(x, y, 1, 1, GREYS + number as u8);
        }
    }
}

/// The palette index of a depth.
fn step(depth_m: f64, (min_m, max_m): (f64, f64)) -> u8 {
    let position = ((depth_m - min_m) / (max_m - min_m)).clamp(0.0, 1.0);
    (position * f64::from(STEPS - 1)).round() as u8
}

/// The colour bar: the nearest depth on top, round numbers beside it.
fn draw_bar(
    canvas: &mut Canvas,
    left: usize,
    top: usize,
    height: usize,
    range_m: (f64, f64),
    unit: &str,
) {
    let (min_m, max_m) = range_m;
    let (low_m, high_m) = (min_m.min(max_m), min_m.max(max_m));
    for y in 0..height {
        let depth_m = min_m + (max_m - min_m) * y as f64 / (height - 1) as f64;
        canvas.fill(left, top + y, BAR_PX, 1, step(depth_m, range_m));
    }
    let most = (height / (2 * LINE_PX)).clamp(2, 12);
    let interval_m = round_interval((high_m - low_m) / most as f64);
    let decimals = (-libm::log10(interval_m).floor()).clamp(0.0, 3.0) as usize;
    let first = (low_m / interval_m - 1e-6).ceil();
    for n in 0..=most {
        let depth_m = (first + n as f64) * interval_m;
        let position = (depth_m - min_m) / (max_m - min_m);
        if depth_m > high_m + 1e-6 * (high_m - low_m) {
            break;
        }
        let y = top + (position * (height - 1) as f64).round() as usize;
        canvas.fill(left + BAR_PX, y, TICK_PX, 1, INK);
        let label = format!("{depth_m:.decimals$} {unit}");
        canvas.text(
            left + BAR_PX + LABEL_OFFSET_PX,
            y - LINE_PX / 2,
            &label,
            &SHADES,
        );
    }
}

/// The smallest of 1, 2, 5, 10, 20, 50, … (and 0.1, 0.2, …) that is not below `at_least`.
fn round_interval(at_least: f64) -> f64 {
    let decade = libm::pow(10f64, libm::log10(at_least).floor());
    [1.0, 2.0, 5.0]
        .into_iter()
        .map(|m| m * decade)
        .find(|&m| m >= at_least * (1.0 - 1e-9))
        .unwrap_or(10.0 * decade)
}

/// A shade between paper and ink.
fn shade(i: usize) -> Rgb {
    let share = i as f64 / (SHADES.len() - 1) as f64;
    [(PAPER_GREY + share * (INK_GREY - PAPER_GREY)).round() as u8; 3]
}

fn encode(file: &mut dyn Write, canvas: &Canvas, greys: &[u8]) -> io::Result<()> {
    let too_large = |_| io::Error::other("the picture is too large");
    let width = u32::try_from(canvas.width()).map_err(too_large)?;
    let height = u32::try_from(canvas.height()).map_err(too_large)?;
    let palette: Vec<u8> = (0..STEPS)
        .map(|i| scale_colour(f64::from(i) / f64::from(STEPS - 1)))
        .chain((0..SHADES.len()).map(shade))
        .chain(greys.iter().map(|&grey| [grey; 3]))
        .flatten()
        .collect();
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette);
    let mut writer = encoder.write_header().map_err(of_png)?;
    writer.write_image_data(canvas.pixels()).map_err(of_png)?;
    writer.finish().map_err(of_png)?;
    Ok(())
}

/// An error of writing a picture, which keeps its kind: a full disk stays one.
pub(super) fn of_png(error: png::EncodingError) -> io::Error {
    match error {
        png::EncodingError::IoError(error) => error,
        other => other.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Width, height and RGB pixels of a PNG file.
    fn decode(path: &Path) -> (usize, usize, Vec<Rgb>) {
        let file = io::BufReader::new(std::fs::File::open(path).unwrap());
        let mut decoder = png::Decoder::new(file);
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut buffer = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut buffer).unwrap();
        assert_eq!(info.color_type, png::ColorType::Rgb);
        let pixels = buffer.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
        (info.width as usize, info.height as usize, pixels)
    }

    #[test]
    fn colours_are_where_the_depths_and_reasons_are() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.png");
        let cells = [
            ImageCell::Depth(10.0),
            ImageCell::Category(0),
            ImageCell::Category(2),
            ImageCell::Depth(90.0),
            ImageCell::Depth(1e9),
            ImageCell::Depth(-5.0),
        ];
        let map = DepthImage {
            title: "two by three",
            cols: 3,
            cells: &cells,
            range_m: (10.0, 90.0),
            unit: "m",
            categories: &[SKY, DARK, LOST],
            scale: 8,
        };
        map.write_png(&path).unwrap();
        let (width, _, pixels) = decode(&path);
        let map_top = 2 * MARGIN_PX + LINE_PX;
        let square = |row: usize, col: usize| {
            pixels[(map_top + row * 8 + 4) * width + MARGIN_PX + col * 8 + 4]
        };
        let (near, far) = (scale_colour(0.0), scale_colour(1.0));
        let [sky, dark] = [SKY, DARK].map(|category| [category.pattern.level(0, 0); 3]);
        assert_eq!([square(0, 0), square(0, 1)], [near, sky]);
        assert_eq!([square(1, 0), square(1, 1), square(1, 2)], [far, far, near]);
        // A cell of 8 pixels has four whole tiles.
        for (y, x) in (0..8).flat_map(|y| (0..8).map(move |x| (y, x))) {
            let pixel = pixels[(map_top + y) * width + MARGIN_PX + 16 + x];
            assert_eq!(pixel, [LOST.pattern.level(x, y); 3], "{x} {y}");
        }
        // The legend shows what occurs, and nothing else.
        let legend = &pixels[(map_top + 4 * LINE_PX) * width..];
        let ink = [LOST.pattern.level(1, 1); 3];
        assert!(legend.contains(&sky) && legend.contains(&ink) && !legend.contains(&dark));
    }

    const SKY: Category<'_> = Category {
        name: "sky",
        pattern: Pattern::plain(250),
    };
    const DARK: Category<'_> = Category {
        name: "dark",
        pattern: Pattern::plain(7),
    };
    const LOST: Category<'_> = Category {
        name: "lost",
        pattern: Pattern::tile(240, 60, [b"....", b".##.", b".##.", b"...."]),
    };

    #[test]
    fn cells_of_two_pixels_have_their_mean_grey_and_the_legend_has_the_tile() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.png");
        let map = DepthImage {
            title: "",
            cols: 30,
            cells: &[ImageCell::Category(0); 900],
            range_m: (0.0, 1.0),
            unit: "m",
            categories: &[LOST],
            scale: 2,
        };
        map.write_png(&path).unwrap();
        let (width, _, pixels) = decode(&path);
        let top = 2 * MARGIN_PX + LINE_PX;
        let mean = [LOST.pattern.mean(); 3];
        for y in 0..60 {
            let row = &pixels[(top + y) * width + MARGIN_PX..][..60];
            assert!(row.iter().all(|&pixel| pixel == mean));
        }
        let ink = [LOST.pattern.level(1, 1); 3];
        assert!(pixels[(top + 60) * width..].contains(&ink));
    }

    #[test]
    fn a_full_frame_is_a_small_file() {
        use crate::guide::{BehaviouralStereo, Guide, GuideInput};
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame.png");
        let scene = crate::scene::Scene::outdoor();
        let guide = BehaviouralStereo
            .estimate(&GuideInput::still(&scene, 64, 64, 1))
            .unwrap();
        let cells: Vec<ImageCell> = (guide.range_m.iter())
            .map(|range_m| range_m.map_or(ImageCell::Category(0), |m| ImageCell::Depth(m as f32)))
            .collect();
        let map = DepthImage {
            title: "Guide: stereo range, outdoor",
            cols: 64,
            cells: &cells,
            range_m: (10.0, 200.0),
            unit: "m",
            categories: &[DARK],
            scale: 8,
        };
        map.write_png(&path).unwrap();
        assert!(std::fs::metadata(&path).unwrap().len() < 100_000);
        let (width, height, _) = decode(&path);
        assert!(width > 512 && height > 512);
    }

    #[test]
    fn tick_intervals_are_round() {
        assert_eq!(round_interval(23.75), 50.0);
        assert_eq!(round_interval(20.0), 20.0);
        assert_eq!(round_interval(7.0), 10.0);
        assert!((round_interval(0.012) - 0.02).abs() < 1e-12);
    }

    #[test]
    fn the_smallest_picture_and_the_longest_texts_work() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.png");
        let title = "a title that is far too long for this picture ".repeat(9);
        let long = "a name that is far too long".repeat(9);
        let map = DepthImage {
            title: &title,
            cols: 1,
            cells: &[ImageCell::Depth(0.5)],
            range_m: (0.0, 1e-3),
            unit: "m",
            categories: &[],
            scale: 1,
        };
        map.write_png(&path).unwrap();
        decode(&path);
        let map = DepthImage {
            cells: &[ImageCell::Category(0)],
            range_m: (-2e6, 3e6),
            unit: "m",
            categories: &[Category { name: &long, ..SKY }],
            ..map
        };
        map.write_png(&path).unwrap();
        decode(&path);
    }
}
