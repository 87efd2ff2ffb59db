//! A scene shown as in Fig. 99 to 102: a drive through it, what became of its targets in every frame, and some frames as pictures.

use super::Demonstrator;
use super::found::TargetSummary;
use super::panel::Panel;
use super::schemes::{self, SchemeOutcome};
use crate::report::CloudPoint;
use crate::report::picture::Picture;
use crate::scene::{GroundTruth, Scene};
use crate::system::{
    DriveFrame, DriveSettings, DriveSimulation, FrameError, FrameTimes, PhaseTimes, point_cloud,
};

/// Something that is to be found: all objects whose name begins so.
#[derive(Debug, Clone)]
pub struct Target {
    /// Its name, or how the names of its parts begin.
    pub name: &'static str,
    objects: Vec<usize>,
}

impl Target {
    /// The target of this name in a scene.
    pub(crate) fn in_scene(scene: &Scene, name: &'static str) -> Self {
        let objects = scene.objects.iter().enumerate();
        Target {
            name,
            objects: objects
                .filter_map(|(n, object)| object.name.starts_with(name).then_some(n))
                .collect(),
        }
    }

    /// What became of it in a frame.
    pub(crate) fn summary(&self, frame: &DriveFrame) -> TargetSummary {
        let pixels = self.pixels(&frame.truth).map(|pixel| &frame.pixels[pixel]);
        TargetSummary::summarise(pixels, frame.bin_m)
    }

    /// The macropixels that see it.
    pub(crate) fn pixels<'t>(&'t self, truth: &'t GroundTruth) -> impl Iterator<Item = usize> + 't {
        let objects = truth.object.iter().enumerate();
        objects.filter_map(|(pixel, object)| self.objects.contains(&(*object)?).then_some(pixel))
    }

    /// The macropixel in the middle of those that see it, as row and column.
    fn middle(&self, truth: &GroundTruth) -> Option<(usize, usize)> {
        let cols = truth.cols as usize;
        let mut pixels: Vec<(usize, usize)> =
            self.pixels(truth).map(|p| (p / cols, p % cols)).collect();
        pixels.sort_unstable();
        let row = pixels.get(pixels.len() / 2)?.0;
        let in_row: Vec<usize> = pixels.iter().filter(|p| p.0 == row).map(|p| p.1).collect();
        Some((row, in_row[in_row.len() / 2]))
    }
}

/// What is shown.
#[derive(Debug, Clone)]
pub struct Show {
    /// Its name, fit for files.
    pub name: String,
    /// The drive.
    pub settings: DriveSettings,
    /// How many frames of it.
    pub frames: u32,
    /// What is to be found.
    pub targets: Vec<Target>,
    /// Ends of the depth scale of pictures, m.
    pub(crate) range_m: (f64, f64),
    /// The frames that become pictures.
    pub pictures: Vec<u32>,
    /// Whether the first target is looked for with other schemes, too, as it stands in the last frame.
    pub(crate) compares: bool,
}

/// A frame of a show.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ShownFrame {
    /// Its number.
    pub number: u32,
    /// When what happened.
    pub(crate) times: FrameTimes,
    /// Each target.
    pub targets: Vec<TargetSummary>,
    /// What the simulation took.
    pub(crate) run_times: PhaseTimes,
}

/// A show that has been run.
#[derive(Debug, Clone)]
pub struct ShowResult {
    /// Its frames.
    pub frames: Vec<ShownFrame>,
    /// Frames as pictures, with their numbers.
    pub pictures: Vec<(u32, Picture)>,
    /// Point clouds of the same frames.
    pub clouds: Vec<(u32, Vec<CloudPoint>)>,
    /// From one frame to the next, s.
    pub period_s: f64,
    /// What load, exposure and readout take, s.
    pub chip_s: [f64; 3],
    /// Other schemes in the last frame.
    pub schemes: Vec<SchemeOutcome>,
}

/// Macropixels of a target on which schemes are compared, at most: a full histogram exposes each of them forty times.
const COMPARED: usize = 48;

impl Show {
    /// Runs it; `done` is called after every frame.
    ///
    /// # Errors
    /// What a drive reports.
    pub fn run(
        &self,
        demonstrator: &Demonstrator,
        done: impl Fn(),
    ) -> Result<ShowResult, FrameError> {
        let mut drive = DriveSimulation::new(&self.settings)?;
        let mut shown = ShowResult {
            frames: Vec::new(),
            pictures: Vec::new(),
            clouds: Vec::new(),
            period_s: drive.period_s(),
            chip_s: drive.chip_s(),
            schemes: Vec::new(),
        };
        for number in 0..self.frames {
            let frame = drive.frame(|_| {})?;
            if self.pictures.contains(&number) {
                shown.pictures.push((number, self.picture(&frame)));
                let (rows, cols) = (frame.truth.rows, frame.truth.cols);
                let camera = self.settings.frame.scene.lidar_camera(rows, cols);
                let points = point_cloud(&camera, cols as usize, &frame.pixels);
                shown.clouds.push((number, points));
            }
            if self.compares && number + 1 == self.frames {
                shown.schemes = self.schemes(demonstrator, &frame)?;
            }
            shown.frames.push(ShownFrame {
                number,
                times: frame.times,
                targets: self.targets.iter().map(|t| t.summary(&frame)).collect(),
                run_times: frame.run_times,
            });
            done();
        }
        Ok(shown)
    }

    fn schemes(
        &self,
        demonstrator: &Demonstrator,
        frame: &DriveFrame,
    ) -> Result<Vec<SchemeOutcome>, FrameError> {
        let world = self.settings.frame.scene.snapshot(frame.times.middle_s());
        let pixels: Vec<usize> = self.targets[0].pixels(&frame.truth).collect();
        let every = pixels.len().div_ceil(COMPARED).max(1);
        let pixels: Vec<usize> = pixels.into_iter().step_by(every).collect();
        if pixels.is_empty() {
            Ok(Vec::new())
        } else {
            let seed = self.settings.frame.seed;
            schemes::compare(demonstrator, &world, &frame.guide, &pixels, seed)
        }
    }

    fn picture(&self, frame: &DriveFrame) -> Picture {
        let world = self.settings.frame.scene.snapshot(frame.times.middle_s());
        let middles = self.targets.iter();
        let samples: Vec<(&str, (usize, usize))> = middles
            .filter_map(|target| Some((target.name, target.middle(&frame.truth)?)))
            .take(3)
            .collect();
        let (name, number) = (&self.name, frame.number);
        let klux = world.light.illuminance_klux;
        Panel {
            title: format!(
                "{name}, frame {number}, {:.2} s, {klux} klux, {} laser cycles",
                frame.times.middle_s(),
                self.settings.frame.exposure.laser_cycles
            ),
            world: &world,
            frame,
            range_m: self.range_m,
            samples: &samples,
        }
        .draw()
    }
}
