//! One frame in one picture, as Fig. 99 to 102 show them: what the camera sees, the guide's depths, the windows, the lidar's depths, the
//! point cloud, and the histograms of some macropixels.

use crate::report::picture::{INK, MARK, PAPER, Picture, TEXT_PX, VOID, colour_of, text_width};
use crate::scene::{DVec3, Ray, Scene, Stage};
use crate::system::DriveFrame;

/// Width and height of the image of a macropixel, px: those of HSLIDAR are 114 um wide and 54 um high.
const CELL: (usize, usize) = (8, 4);
const MARGIN: usize = 14;
/// Height of a panel of histograms or points, px.
const PLOT_HEIGHT: usize = 230;
/// Camera rays in a macropixel, across and down.
const CAMERA_RAYS: (u32, u32) = (8, 4);
/// Brightness of the sky in the camera's picture.
const SKY_GREY: f64 = 0.8;

/// What the picture shows beside the frame.
#[derive(Debug, Clone)]
pub(crate) struct Panel<'a> {
    /// Above the picture, in ASCII.
    pub(crate) title: String,
    /// The still world in the middle of the exposure.
    pub(crate) world: &'a Scene,
    /// The frame.
    pub(crate) frame: &'a DriveFrame,
    /// Ends of the depth scale, m.
    pub(crate) range_m: (f64, f64),
    /// Macropixels whose histograms are shown, with a name: (row, column), at most three.
    pub(crate) samples: &'a [(&'a str, (usize, usize))],
}

impl Panel<'_> {
    /// The picture.
    pub(crate) fn draw(&self) -> Picture {
        let (rows, cols) = (
            self.frame.truth.rows as usize,
            self.frame.truth.cols as usize,
        );
        let (map_width, map_height) = (cols * CELL.0, rows * CELL.1);
        let width = 3 * MARGIN + 2 * map_width;
        let map_block = TEXT_PX + map_height + MARGIN;
        let height = 2 * MARGIN + 2 * TEXT_PX + 2 * map_block + TEXT_PX + PLOT_HEIGHT + MARGIN;
        let mut picture = Picture::new(width, height);
        picture.text((MARGIN, MARGIN), &self.title, INK);
        let (left, right) = (MARGIN, 2 * MARGIN + map_width);
        let scale_top = MARGIN + TEXT_PX + 4;
        picture.text((left, scale_top), "distance", INK);
        let scale_left = left + text_width("distance ");
        picture.scale((scale_left, scale_top), map_width / 2, self.range_m, "m");

        let first = 2 * MARGIN + 2 * TEXT_PX;
        let second = first + map_block;
        let third = second + map_block;
        picture.text((left, first), "camera", INK);
        let camera = self.camera(rows as u32, cols as u32);
        let ray_px = (
            CELL.0 / CAMERA_RAYS.0 as usize,
            CELL.1 / CAMERA_RAYS.1 as usize,
        );
        let camera_cols = cols * CAMERA_RAYS.0 as usize;
        picture.raster((left, first + TEXT_PX), camera_cols, ray_px, camera);
        let pixels = &self.frame.pixels;
        let depths = |depth: &dyn Fn(usize) -> Option<f64>| -> Vec<_> {
            (0..pixels.len())
                .map(|pixel| depth(pixel).map_or(VOID, |m| colour_of(m, self.range_m)))
                .collect()
        };
        let maps = [
            ("guide", (right, first), depths(&|p| pixels[p].guide_m)),
            (
                "middle of the window",
                (left, second),
                depths(&|p| self.frame.windows_m[p].map(|(from, to)| 0.5 * (from + to))),
            ),
            ("lidar", (right, second), depths(&|p| pixels[p].measured_m)),
        ];
        for (name, (x, y), cells) in maps {
            picture.text((x, y), name, INK);
            picture.raster((x, y + TEXT_PX), cols, CELL, cells);
        }
        for (n, (_, (row, col))) in self.samples.iter().enumerate() {
            for (x, y) in [(left, first), (right, second)] {
                let at = (x + col * CELL.0, y + TEXT_PX + row * CELL.1);
                let at = (at.0.saturating_sub(2), at.1.saturating_sub(2));
                picture.outline(at, (CELL.0 + 4, CELL.1 + 4), 2, MARK);
                let mark = (at.0 + CELL.0 + 6, at.1.saturating_sub(TEXT_PX / 2));
                picture.text(mark, &label(n), MARK);
            }
        }
        picture.text((left, third), "point cloud, from above and behind", INK);
        self.cloud(
            &mut picture,
            (left, third + TEXT_PX),
            (map_width, PLOT_HEIGHT),
        );
        let shown = self.samples.len().max(1);
        let plot_width = map_width / shown;
        for (n, sample) in self.samples.iter().enumerate() {
            let at = (right + n * plot_width, third);
            self.histogram(&mut picture, at, plot_width - MARGIN / 2, n, sample);
        }
        picture
    }

    /// Grey of every camera ray, the lidar's field of view row by row: sunlight from above and behind.
    fn camera(&self, rows: u32, cols: u32) -> Vec<[u8; 3]> {
        let (wide, high) = CAMERA_RAYS;
        let camera = self.world.lidar_camera(rows, cols);
        let stage = Stage::new(self.world);
        let sun = DVec3::new(-0.3, -0.6, -0.74);
        let grey = |row: u32, col: u32| {
            let at = (
                (f64::from(col) + 0.5) / f64::from(wide),
                (f64::from(row) + 0.5) / f64::from(high),
            );
            let seen = stage.hit(&Ray::new(DVec3::ZERO, camera.at_unit_depth(at)));
            let light = seen.map_or(SKY_GREY, |hit| {
                hit.grey * (0.45 + 0.55 * hit.normal.dot(sun).max(0.0))
            });
            // Gamma of a display.
            [(255.0 * libm::pow(light.clamp(0.0, 1.0), 1.0 / 2.2)).round() as u8; 3]
        };
        let places = (0..rows * high).flat_map(|row| (0..cols * wide).map(move |col| (row, col)));
        places.map(|(row, col)| grey(row, col)).collect()
    }

    /// The measured points seen from above and behind the lidar, with rings at round distances.
    fn cloud(
        &self,
        picture: &mut Picture,
        (left, top): (usize, usize),
        (width, height): (usize, usize),
    ) {
        picture.fill((left, top), (width, height), [245; 3]);
        let truth = &self.frame.truth;
        let camera = self.world.lidar_camera(truth.rows, truth.cols);
        let (near, far) = self.range_m;
        // Across: the field of view at the far end. Down: distance, with height on top of it.
        let half_m = 1.1 * far * camera.at_unit_depth((f64::from(truth.cols), 0.0)).x;
        let px_per_m = 0.5 * width as f64 / half_m;
        let deep_px = 0.72 * height as f64;
        let lift = 2.5 * px_per_m;
        let place = |point: DVec3| {
            let along = (point.z - near) / (far - near);
            (
                left as f64 + 0.5 * width as f64 + point.x * px_per_m,
                top as f64 + height as f64 - 24.0 - along * deep_px + point.y * lift,
            )
        };
        let step_m = if far - near > 40.0 { 20.0 } else { 5.0 };
        let mut ring_m = (near / step_m).ceil() * step_m;
        while ring_m <= far {
            let y = place(DVec3::new(0.0, 0.0, ring_m)).1;
            picture.line((left as f64, y), ((left + width) as f64, y), VOID);
            picture.text(
                (left + 2, y as usize - TEXT_PX),
                &format!("{ring_m:.0} m"),
                [150; 3],
            );
            ring_m += step_m;
        }
        for (pixel, depth) in self.frame.pixels.iter().enumerate() {
            let Some(range_m) = depth.measured_m else {
                continue;
            };
            let (row, col) = (pixel / truth.cols as usize, pixel % truth.cols as usize);
            let ray = camera.at_unit_depth((col as f64 + 0.5, row as f64 + 0.5));
            let (x, y) = place(ray.normalize() * range_m);
            let inside = (left as f64..(left + width) as f64).contains(&x)
                && (top as f64..(top + height) as f64).contains(&y);
            if inside {
                picture.dot((x, y), 3, colour_of(range_m, self.range_m));
            }
        }
    }

    /// The counts of a macropixel over its window.
    fn histogram(
        &self,
        picture: &mut Picture,
        (left, top): (usize, usize),
        width: usize,
        n: usize,
        &(name, (row, col)): &(&str, (usize, usize)),
    ) {
        let pixel = row * self.frame.truth.cols as usize + col;
        let depth = &self.frame.pixels[pixel];
        picture.text((left, top), &format!("{} {name}", label(n)), MARK);
        let (plot_top, plot_height) = (top + TEXT_PX, PLOT_HEIGHT - 4 * TEXT_PX);
        picture.fill((left, plot_top), (width, plot_height), [245; 3]);
        let Some((from_m, to_m)) = self.frame.windows_m[pixel] else {
            picture.text((left + 4, plot_top + 4), "SPADs off", INK);
            return;
        };
        let counts = &self.frame.histograms[pixel];
        let most = f64::from(*counts.iter().max().unwrap_or(&1)).max(1.0);
        let bar = width / counts.len();
        for (bin, &count) in counts.iter().enumerate() {
            let high = (f64::from(count) / most * (plot_height - 6) as f64).round() as usize;
            let at = (left + bin * bar + 1, plot_top + plot_height - high);
            picture.fill(at, (bar - 2, high), [68, 68, 132]);
        }
        let mut mark = |m: f64, colour, long: usize| {
            let x = left as f64 + (m - from_m) / (to_m - from_m) * (bar * counts.len()) as f64;
            if (left as f64..(left + width) as f64).contains(&x) {
                let at = (x as usize, plot_top + plot_height - long);
                picture.fill(at, (2, long), colour);
            }
        };
        if let Some(m) = depth.true_m {
            mark(m, MARK, plot_height);
        }
        let below = plot_top + plot_height + 2;
        let measured = match (depth.measured_m, depth.no_depth) {
            (Some(m), _) => format!("depth {m:.2} m"),
            (None, Some(why)) => why.name().to_owned(),
            (None, None) => String::new(),
        };
        let truth = depth
            .true_m
            .map_or("sky".to_owned(), |m| format!("true {m:.2} m"));
        picture.text((left, below), &format!("{from_m:.1} to {to_m:.1} m"), INK);
        picture.text((left, below + TEXT_PX), &truth, MARK);
        picture.text((left, below + 2 * TEXT_PX), &measured, INK);
        picture.outline((left, plot_top), (width, plot_height), 1, VOID);
        let peak = format!("{most:.0}");
        let room = width.saturating_sub(text_width(&peak) + 4);
        picture.fill(
            (left + room, plot_top + 1),
            (text_width(&peak), TEXT_PX),
            PAPER,
        );
        picture.text((left + room, plot_top + 1), &peak, INK);
    }
}

/// A, B, C.
fn label(n: usize) -> String {
    char::from(b'A' + n as u8).to_string()
}
