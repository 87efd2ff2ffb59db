//! Depth maps as PNG pictures with a colour bar.
//!
//! Indexed colours: 240 steps of the depth scale and a few for the rest, which keeps the file
//! small and every macropixel a clean square.

use std::io::{self, Write};
use std::path::Path;

use super::canvas::{CHARACTER_PX, Canvas};
use super::colour::{Rgb, scale_colour};
use crate::files::{InputError, OutputFile};

/// Palette: depth colours 0 to `STEPS - 1`, then these.
const STEPS: u8 = 240;
const PAPER: u8 = STEPS;
const INK: u8 = STEPS + 1;
const NO_DEPTH: u8 = STEPS + 2;
const OTHERS: [Rgb; 3] = [[255, 255, 255], [20, 20, 20], [64, 64, 64]];

const MARGIN_PX: usize = 12;
const BAR_PX: usize = 16;
/// Longest tick label, such as `-1234.5 m`.
const LABEL_CHARACTERS: usize = 9;
const TICK_PX: usize = 3;
/// From the bar to its labels; wide enough that a tick does not look like a minus sign.
const LABEL_OFFSET_PX: usize = 10;

/// Writes a depth map as a PNG picture.
///
/// `depth_m` holds `rows` × `cols` depths in metres, row by row from the top left; `None` (and
/// NaN) are drawn dark grey. Each becomes a square of `scale` ≥ 1 screen pixels. Colours run from
/// yellow at `min_m` to violet at `max_m`, and depths beyond take the end's colour. The title
/// stands above the picture in ASCII, cut off where the picture ends.
///
/// # Errors
/// When the file cannot be written, or a picture of this size cannot be made.
///
/// # Panics
/// When `depth_m` does not have rows·cols entries, one of these or `scale` is zero, or
/// `min_m < max_m` does not hold.
pub fn depth_png(
    path: &Path,
    rows: usize,
    cols: usize,
    depth_m: &[Option<f32>],
    (min_m, max_m): (f32, f32),
    title: &str,
    scale: usize,
) -> Result<(), InputError> {
    assert!(rows > 0 && cols > 0 && scale > 0, "an empty picture");
    assert_eq!(depth_m.len(), rows * cols, "depths do not fit the array");
    assert!(min_m < max_m, "depth range {min_m} to {max_m} m");
    let range_m = (f64::from(min_m), f64::from(max_m));
    let (map_width, map_height) = (cols * scale, rows * scale);
    let map_top = 2 * MARGIN_PX + CHARACTER_PX;
    // The bar keeps room for two labels beside maps of a few pixels.
    let bar_height = map_height.max(4 * CHARACTER_PX);
    let bar_left = 2 * MARGIN_PX + map_width;
    let width = bar_left + BAR_PX + LABEL_OFFSET_PX + LABEL_CHARACTERS * CHARACTER_PX + MARGIN_PX;
    let height = map_top + bar_height + MARGIN_PX;

    let mut canvas = Canvas::new(width, height, PAPER);
    canvas.text(MARGIN_PX, MARGIN_PX, title, INK);
    for (i, depth) in depth_m.iter().enumerate() {
        let (left, top) = (MARGIN_PX + i % cols * scale, map_top + i / cols * scale);
        let colour = depth.map_or(NO_DEPTH, |d| step(f64::from(d), range_m));
        canvas.fill(left, top, scale, scale, colour);
    }
    draw_bar(&mut canvas, bar_left, map_top, bar_height, range_m);
    OutputFile::write_with(path, |file| encode(file, &canvas))
}

/// The palette index of a depth.
fn step(depth_m: f64, (min_m, max_m): (f64, f64)) -> u8 {
    if depth_m.is_nan() {
        return NO_DEPTH;
    }
    let position = ((depth_m - min_m) / (max_m - min_m)).clamp(0.0, 1.0);
    (position * f64::from(STEPS - 1)).round() as u8
}

/// The colour bar: the nearest depth on top, round numbers beside it.
fn draw_bar(canvas: &mut Canvas, left: usize, top: usize, height: usize, range_m: (f64, f64)) {
    let (min_m, max_m) = range_m;
    for y in 0..height {
        let depth_m = min_m + (max_m - min_m) * y as f64 / (height - 1) as f64;
        canvas.fill(left, top + y, BAR_PX, 1, step(depth_m, range_m));
    }
    let most = (height / (3 * CHARACTER_PX)).clamp(2, 12);
    let interval_m = round_interval((max_m - min_m) / most as f64);
    let decimals = (-interval_m.log10().floor()).clamp(0.0, 3.0) as usize;
    let first = (min_m / interval_m - 1e-6).ceil();
    for n in 0..=most {
        let depth_m = (first + n as f64) * interval_m;
        let position = (depth_m - min_m) / (max_m - min_m);
        if position > 1.0 + 1e-6 {
            break;
        }
        let y = top + (position * (height - 1) as f64).round() as usize;
        canvas.fill(left + BAR_PX, y, TICK_PX, 1, INK);
        let label = format!("{depth_m:.decimals$} m");
        canvas.text(
            left + BAR_PX + LABEL_OFFSET_PX,
            y - CHARACTER_PX / 2,
            &label,
            INK,
        );
    }
}

/// The smallest of 1, 2, 5, 10, 20, 50, … (and 0.1, 0.2, …) that is not below `at_least`.
fn round_interval(at_least: f64) -> f64 {
    let decade = 10f64.powf(at_least.log10().floor());
    [1.0, 2.0, 5.0]
        .into_iter()
        .map(|m| m * decade)
        .find(|&m| m >= at_least * (1.0 - 1e-9))
        .unwrap_or(10.0 * decade)
}

fn encode(file: &mut dyn Write, canvas: &Canvas) -> io::Result<()> {
    let too_large = |_| io::Error::other("the picture is too large");
    let width = u32::try_from(canvas.width()).map_err(too_large)?;
    let height = u32::try_from(canvas.height()).map_err(too_large)?;
    let palette: Vec<u8> = (0..STEPS)
        .map(|i| scale_colour(f64::from(i) / f64::from(STEPS - 1)))
        .chain(OTHERS)
        .flatten()
        .collect();
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(canvas.pixels())?;
    writer.finish()?;
    Ok(())
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
    fn colours_are_where_the_depths_are() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.png");
        let depths = [
            Some(10.0),
            None,
            Some(f32::NAN),
            Some(90.0),
            Some(1e9),
            Some(-5.0),
        ];
        depth_png(&path, 2, 3, &depths, (10.0, 90.0), "two by three", 8).unwrap();
        let (width, _, pixels) = decode(&path);
        let map_top = 2 * MARGIN_PX + CHARACTER_PX;
        let at = |row: usize, col: usize| {
            pixels[(map_top + row * 8 + 4) * width + MARGIN_PX + col * 8 + 4]
        };
        let (near, far, none) = (scale_colour(0.0), scale_colour(1.0), OTHERS[2]);
        assert_eq!([at(0, 0), at(0, 1), at(0, 2)], [near, none, none]);
        assert_eq!([at(1, 0), at(1, 1), at(1, 2)], [far, far, near]);
    }

    #[test]
    fn a_full_frame_is_a_small_file() {
        let dir = tempfile::tempdir().unwrap();
        // Set to keep the picture for a look at it.
        let path = match std::env::var_os("GDTOF_TEST_PICTURE") {
            Some(path) => path.into(),
            None => dir.path().join("frame.png"),
        };
        let scene = crate::scene::Scene::outdoor();
        let guide = crate::guide::GuideMap::estimate(&scene, 64, 64, 1);
        let depths: Vec<_> = guide.range_m.iter().map(|r| r.map(|r| r as f32)).collect();
        depth_png(
            &path,
            64,
            64,
            &depths,
            (10.0, 200.0),
            "Guide: stereo range, outdoor",
            8,
        )
        .unwrap();
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
    fn the_smallest_picture_and_the_longest_title_work() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.png");
        let title = "a title that is far too long for this picture ".repeat(9);
        depth_png(&path, 1, 1, &[Some(0.5)], (0.0, 1e-3), &title, 1).unwrap();
        depth_png(&path, 1, 1, &[None], (-2e6, 3e6), "", 1).unwrap();
        decode(&path);
    }
}
