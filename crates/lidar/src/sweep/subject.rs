//! What a study computes for a point: a frame, or what theory says.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use serde_json::Value as Json;
use toml::{Table, Value};

use super::cell::{Column, Holds, TableCell};
use super::error::SweepError;
use super::row::{Key, StudyRow};
use super::study::{Study, StudyKind, StudyPoint};
use super::theory::{self, Rig, TheoryCache, Wall};
use crate::chip::{Sensor, SensorConfig, library_files};
use crate::files::{InputError, file_hash, in_plain_words};
use crate::request::{FrameRequest, Sources, Spelling, eye_safety_of, is_bad_input, sentence};
use crate::scene::{EyeSafety, Scene};
use crate::settings::Assignment;
use crate::system::{Frame, FrameSummary, NoDepth, SharedWork, WindowPolicy, take_shared_frame};

/// A study's points as they are taken.
pub(super) struct Subject<'a> {
    study: &'a Study,
    names: Vec<String>,
    columns: Vec<Column>,
    /// Hashes of files that have been looked at: they are taken not to change while a study runs.
    hashes: Mutex<HashMap<PathBuf, String>>,
    /// The latest sensors that differ.
    sensors: Mutex<Vec<Sensor>>,
    shared: SharedWork,
}

/// Sensors that are kept for points to come: a study that varies more of them has each of them measured again.
const MOST_SENSORS: usize = 64;

/// What a thread keeps from point to point.
#[derive(Default)]
pub(super) struct Scratch {
    world: Option<Arc<World>>,
    theory: TheoryCache,
}

/// A sensor before a scene.
struct World {
    sources: Sources,
    sensor: Sensor,
    scene: Scene,
    /// All that a result depends on of it.
    content: String,
    rig: Rig,
}

/// A point whose settings have been read.
pub(super) struct PointTask {
    pub(super) key: Key,
    task: Task,
}

enum Task {
    Frame(Arc<World>, Box<FrameRequest>),
    Theory(Box<Wall>),
}

impl<'a> Subject<'a> {
    /// Of a study.
    pub(super) fn new(study: &'a Study) -> Self {
        Subject {
            study,
            names: study.varied().map(|varied| varied.name.clone()).collect(),
            columns: Self::columns(study.kind),
            hashes: Mutex::default(),
            sensors: Mutex::default(),
            shared: SharedWork::new(study.replicas),
        }
    }

    /// Columns of results.
    pub(super) fn columns(kind: StudyKind) -> Vec<Column> {
        match kind {
            StudyKind::Frame => frame_columns(),
            StudyKind::Theory => theory::columns(),
        }
    }

    /// Reads a point's settings.
    ///
    /// # Errors
    /// An impossible point: a sensor or a scene with values that do not go together, or files that cannot be read.
    pub(super) fn ready(
        &self,
        point: &StudyPoint,
        scratch: &mut Scratch,
    ) -> Result<PointTask, InputError> {
        let mut sources = Sources::default();
        let mut frame = Table::new();
        let mut windows: Vec<String> = Vec::new();
        let mut of_theory = Table::new();
        let fixed = self.study.fixed().iter().map(|(name, value)| (name, value));
        for (name, value) in fixed.chain(self.names.iter().zip(&point.values)) {
            let text = || value.as_str().expect("checked").to_owned();
            match name.split_once('.') {
                None if name == "sensor" => sources.sensor = Some(self.placed(&text())),
                None if name == "scene" => sources.scene = Some(self.placed(&text())),
                None if name == "guide" => {
                    let guides = match value {
                        Value::Array(_) => value.clone(),
                        one => Value::Array(vec![one.clone()]),
                    };
                    frame.insert("guides".into(), guides);
                }
                None => windows.push(text()),
                Some(("windows", key)) => windows.push(format!("{key}={value}")),
                Some(("frame", "calibration")) => {
                    let path = self.placed(&text()).display().to_string();
                    frame.insert("calibration".into(), path.into());
                }
                Some(("frame", key)) => drop(frame.insert(key.into(), value.clone())),
                Some(("theory", key)) => drop(of_theory.insert(key.into(), value.clone())),
                Some(_) => {
                    let origin = format!("{name} = {value}");
                    let assignment = Assignment::new(name, value.clone(), origin)?;
                    sources.set.push(assignment);
                }
            }
        }
        let world = match &scratch.world {
            Some(world) if world.sources == sources => Arc::clone(world),
            _ => Arc::new(self.world(sources)?),
        };
        scratch.world = Some(Arc::clone(&world));
        let key = |content: &str| {
            let kind = match self.study.kind {
                StudyKind::Frame => "frame",
                StudyKind::Theory => "theory",
            };
            Key::from_content(kind, &self.columns, content)
        };
        if self.study.kind == StudyKind::Theory {
            let asked = of_theory.try_into().expect("every value has been checked");
            if let Some(key) = world.scene.not_gaussian() {
                let message = "theory is of Gaussian pulses; leave this out, or study frames";
                return Err(InputError::new(format!("scene.lidar.{key}"), message));
            }
            if world.sensor.dead_time_spread > 0.0 {
                let message = "theory is of SPADs that are alike; leave this out, or study frames";
                return Err(InputError::new("sensor.dead_time_spread", message));
            }
            let wall = Box::new(Wall::new(world.rig, &asked));
            return Ok(PointTask {
                key: key(&format!("{wall:?}")),
                task: Task::Theory(wall),
            });
        }
        let request = frame.try_into::<FrameRequest>();
        let mut request = request
            .map_err(|e| InputError::new(self.study.source(), in_plain_words(e.message())))?;
        request.seed = point.seed;
        request.windows = windows.join(",");
        // Settings that say the same have the same key, however they are written.
        let policy = request.policy(WindowPolicy::default())?;
        let same = FrameRequest {
            windows: String::new(),
            ..request.clone()
        };
        let mut content = serde_json::to_string(&(&same, policy)).expect("numbers and words");
        content += &world.content;
        let guides = request
            .guides
            .iter()
            .flat_map(|guide| guide.split([':', ',']));
        let of_guides = guides
            .filter_map(|part| part.split_once('='))
            .map(|(_, value)| Path::new(value));
        for path in of_guides.chain(request.calibration.as_deref()) {
            content += &self.hash(path);
        }
        Ok(PointTask {
            key: key(&content),
            task: Task::Frame(world, Box::new(request)),
        })
    }

    /// Files are relative to the study's folder; what is none there goes by its name.
    fn placed(&self, name: &str) -> PathBuf {
        let path = self.study.folder().join(name);
        if path.exists() { path } else { name.into() }
    }

    fn world(&self, sources: Sources) -> Result<World, InputError> {
        let (sensor, scene) = sources.read()?;
        let sensor = self.shared(sensor);
        let json = serde_json::to_value((&*sensor, &scene)).expect("numbers and words");
        let mut content = json.to_string();
        self.files_in(&json[1]["object"], &mut content);
        let blocks = sensor.own_hashes().into_iter().flatten();
        content.extend(blocks.map(|hash| hash.to_string()));
        Ok(World {
            rig: Rig::new(&sensor, &scene),
            sources,
            sensor,
            scene,
            content,
        })
    }

    /// The sensor of an earlier point, where that was the same, with all that has been measured of it.
    fn shared(&self, sensor: Sensor) -> Sensor {
        let mut sensors = self.sensors.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = sensors.iter().find(|known| **known == sensor) {
            return known.clone();
        }
        if sensors.len() == MOST_SENSORS {
            sensors.remove(0);
        }
        sensors.push(sensor.clone());
        sensor
    }

    /// Adds the hashes of all files that are named anywhere in it.
    fn files_in(&self, json: &Json, content: &mut String) {
        match json {
            // A cell library may be several files.
            Json::String(text) => {
                for file in library_files(Path::new(text)) {
                    *content += &self.hash(&file);
                }
            }
            Json::Array(items) => items.iter().for_each(|item| self.files_in(item, content)),
            Json::Object(fields) => fields
                .values()
                .for_each(|item| self.files_in(item, content)),
            _ => {}
        }
    }

    /// The hash of a file; empty for what is none.
    fn hash(&self, path: &Path) -> String {
        if !path.is_file() {
            return String::new();
        }
        let mut hashes = self.hashes.lock().unwrap_or_else(PoisonError::into_inner);
        let hash = hashes
            .entry(path.to_owned())
            .or_insert_with(|| file_hash(path).map_or(String::new(), |(_, hash)| hash));
        hash.clone()
    }

    /// Takes a point.
    ///
    /// # Errors
    /// Faults of the program; a frame that an engine refuses is a row that says so.
    pub(super) fn compute_row(
        &self,
        ready: PointTask,
        scratch: &mut Scratch,
    ) -> Result<StudyRow, SweepError> {
        match ready.task {
            Task::Theory(wall) => Ok(StudyRow {
                run_time_s: 0.0,
                error: None,
                cells: wall.results(&mut scratch.theory),
            }),
            Task::Frame(world, request) => {
                let begin = Instant::now();
                let settings = request.settings(world.sensor.clone(), world.scene.clone());
                let taken = settings.and_then(|(settings, policy)| {
                    take_shared_frame(&settings, policy, &self.shared, |_| ())
                });
                let run_time_s = begin.elapsed().as_secs_f64();
                match taken {
                    Ok(frame) => Ok(StudyRow {
                        run_time_s,
                        error: None,
                        cells: frame_cells(&frame, &world, &request),
                    }),
                    Err(why) if is_bad_input(&why) => Ok(StudyRow {
                        run_time_s,
                        error: Some(sentence(&why, Spelling::Keys)),
                        cells: Vec::new(),
                    }),
                    Err(why) => Err(why.into()),
                }
            }
        }
    }
}

/// A frame that has been taken.
struct FrameResult<'a> {
    summary: FrameSummary,
    frame: &'a Frame,
    sensor: &'a SensorConfig,
    eye_safety: Option<EyeSafety>,
}

impl FrameResult<'_> {
    fn count_without(&self, reason: NoDepth) -> usize {
        let number = self.summary.no_depth.get(&reason);
        number.copied().unwrap_or(0)
    }

    fn counts(&self) -> usize {
        let counts = self.frame.histograms.iter();
        counts.map(|&n| usize::from(n)).sum()
    }

    fn frame_time_s(&self) -> f64 {
        self.sensor.frame_time(self.frame.exposure_time).as_s()
    }
}

/// What a column has of a frame.
enum Of {
    Whole(Box<dyn Fn(&FrameResult) -> usize>),
    Number(&'static str, fn(&FrameResult) -> Option<f64>),
}

/// Columns of the fields of a summary, by their names.
macro_rules! fields {
    (whole $($field:ident)*) => {
        [$((stringify!($field).to_owned(), Of::Whole(Box::new(|t| t.summary.$field)))),*]
    };
    ($unit:literal $($field:ident)*) => {
        [$((stringify!($field).to_owned(), Of::Number($unit, |t| t.summary.$field))),*]
    };
}

/// Results of a frame, in order.
fn results() -> Vec<(String, Of)> {
    let no_depth = |reason: NoDepth| {
        let name = reason.name().replace(' ', "_").to_lowercase();
        let pixels_without = move |t: &FrameResult| t.count_without(reason);
        (
            format!("no_depth_{name}"),
            Of::Whole(Box::new(pixels_without)),
        )
    };
    let number = |name: &str, unit, of| (name.to_owned(), Of::Number(unit, of));
    let mut all = vec![(
        "macropixels".to_owned(),
        Of::Whole(Box::new(|t| t.summary.pixels)),
    )];
    all.extend(fields!(whole with_target guided in_window depths depths_without_surface outliers));
    all.extend(NoDepth::ALL.map(no_depth));
    all.extend(fields!("" outlier_share share_within_a_bin));
    all.extend(
        fields!("m" rms_error_m median_absolute_error_m rms_error_without_outliers_m
        mean_error_m mean_error_with_walk_m median_absolute_error_of_all_m
        rms_error_of_every_peak_m guide_rms_error_m rms_bound_m),
    );
    all.extend([
        number("bin_m", "m", |t| Some(t.summary.bin_m)),
        number("photons_expected", "", |t| Some(t.frame.photons_expected)),
        ("counts".to_owned(), Of::Whole(Box::new(|t| t.counts()))),
        number("exposure_time_s", "s", |t| {
            Some(t.frame.exposure_time.as_s())
        }),
        number("frame_time_s", "s", |t| Some(t.frame_time_s())),
        number("times_class_1", "", |t| {
            t.eye_safety.map(|eye| eye.times_class_1)
        }),
    ]);
    all
}

fn frame_columns() -> Vec<Column> {
    let column = |(name, of)| match of {
        Of::Whole(_) => Column::new(name, "", Holds::Whole),
        Of::Number(unit, _) => Column::new(name, unit, Holds::Number),
    };
    results().into_iter().map(column).collect()
}

fn frame_cells(frame: &Frame, world: &World, request: &FrameRequest) -> Vec<TableCell> {
    let sensor = &world.sensor;
    let taken = FrameResult {
        summary: frame.summary(),
        frame,
        sensor,
        eye_safety: eye_safety_of(sensor, &world.scene, request.laser_cycles, frame),
    };
    let cell = |(_, of)| match of {
        Of::Whole(of) => TableCell::count(of(&taken)),
        Of::Number(_, of) => TableCell::maybe(of(&taken)),
    };
    results().into_iter().map(cell).collect()
}

#[cfg(test)]
mod tests;
