//! What is made of a point: a frame, or what theory says.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use serde_json::Value as Json;
use sha2::{Digest, Sha256};
use toml::{Table, Value};

use super::SweepError;
use super::cell::{Cell, Column, Holds};
use super::row::{Key, Row};
use super::study::{Kind, Point, Study};
use super::theory::{self, Last, Rig, Wall};
use crate::chip::{Sensor, SensorConfig};
use crate::files::{InputError, in_plain_words};
use crate::request::{FrameRequest, Sources, Spelling, is_bad_input, sentence};
use crate::scene::Scene;
use crate::system::{Frame, FrameError, NoDepth, Summary, WindowPolicy, take_frame_by};

/// A study's points as they are taken.
pub(super) struct Subject<'a> {
    study: &'a Study,
    names: Vec<String>,
    columns: Vec<Column>,
    /// Hashes of files that have been looked at: they are taken not to change while a study runs.
    hashes: Mutex<HashMap<PathBuf, String>>,
    /// The latest sensors that differ.
    sensors: Mutex<Vec<Sensor>>,
}

/// Sensors that are kept for points to come: a study that varies more of them has each of them measured again.
const MOST_SENSORS: usize = 64;

/// What a thread keeps from point to point.
#[derive(Default)]
pub(super) struct Scratch {
    world: Option<Arc<World>>,
    theory: Last,
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
pub(super) struct Ready {
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
        }
    }

    /// Columns of results.
    pub(super) fn columns(kind: Kind) -> Vec<Column> {
        match kind {
            Kind::Frame => frame_columns(),
            Kind::Theory => theory::columns(),
        }
    }

    /// Reads a point's settings.
    ///
    /// # Errors
    /// A point that cannot be: a sensor or a scene with values that do not go together, files that cannot be read.
    pub(super) fn ready(&self, point: &Point, scratch: &mut Scratch) -> Result<Ready, InputError> {
        let mut sources = Sources::default();
        let mut frame = Table::new();
        let mut windows: Vec<String> = Vec::new();
        let mut of_theory: Vec<(&str, &Value)> = Vec::new();
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
                Some(("theory", key)) => of_theory.push((key, value)),
                Some(_) => sources.set.push(format!("{name}={value}")),
            }
        }
        let world = match &scratch.world {
            Some(world) if world.sources == sources => Arc::clone(world),
            _ => Arc::new(self.world(sources)?),
        };
        scratch.world = Some(Arc::clone(&world));
        let key = |content: &str| {
            let kind = match self.study.kind {
                Kind::Frame => "frame",
                Kind::Theory => "theory",
            };
            Key::of(kind, &self.columns, content)
        };
        if self.study.kind == Kind::Theory {
            let mut wall = Box::new(Wall::new(world.rig));
            for (name, value) in of_theory {
                wall.set(name, value);
            }
            return Ok(Ready {
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
        Ok(Ready {
            key: key(&content),
            task: Task::Frame(world, Box::new(request)),
        })
    }

    /// Files are relative to the study's folder; what is none there goes by its name.
    fn placed(&self, name: &str) -> PathBuf {
        let path = self.study.folder().join(name);
        match path.exists() {
            true => path,
            false => name.into(),
        }
    }

    fn world(&self, sources: Sources) -> Result<World, InputError> {
        let (sensor, scene) = sources.read()?;
        let sensor = self.shared(sensor);
        let json = serde_json::to_value((&*sensor, &scene)).expect("numbers and words");
        let mut content = json.to_string();
        self.files_in(&json[1]["object"], &mut content);
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
            Json::String(text) => *content += &self.hash(Path::new(text)),
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
        let hash = hashes.entry(path.to_owned()).or_insert_with(|| {
            let bytes = std::fs::read(path).unwrap_or_default();
            Sha256::digest(bytes)
                .iter()
                .map(|b| format!("{b:02x}"))
                .collect()
        });
        hash.clone()
    }

    /// Takes a point.
    ///
    /// # Errors
    /// Faults of the program; a frame that an engine refuses is a row that says so.
    pub(super) fn take(&self, ready: Ready, scratch: &mut Scratch) -> Result<Row, SweepError> {
        match ready.task {
            Task::Theory(wall) => Ok(Row {
                run_time_s: 0.0,
                error: None,
                cells: wall.results(&mut scratch.theory),
            }),
            Task::Frame(world, request) => {
                let begin = Instant::now();
                let taken = take(&world, &request);
                let run_time_s = begin.elapsed().as_secs_f64();
                match taken {
                    Ok(frame) => Ok(Row {
                        run_time_s,
                        error: None,
                        cells: frame_cells(&frame, &world.sensor),
                    }),
                    Err(why) if is_bad_input(&why) => Ok(Row {
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

fn take(world: &World, request: &FrameRequest) -> Result<Frame, FrameError> {
    let (settings, policy) = request.settings(world.sensor.clone(), world.scene.clone())?;
    take_frame_by(&settings, policy, |_| Vec::new(), |_| ())
}

/// Results of a frame, in order. [`frame_cells`] has the same order.
fn frame_columns() -> Vec<Column> {
    let whole = |name: &str| Column::new(name, "", Holds::Whole);
    let number = |name: &str, unit| Column::new(name, unit, Holds::Number);
    let mut columns: Vec<Column> = [
        "macropixels",
        "with_target",
        "guided",
        "in_window",
        "depths",
        "depths_without_surface",
        "outliers",
    ]
    .map(whole)
    .into();
    let reason = |reason: NoDepth| {
        format!(
            "no_depth_{}",
            reason.name().replace(' ', "_").to_lowercase()
        )
    };
    columns.extend(NoDepth::ALL.map(|no_depth| whole(&reason(no_depth))));
    columns.push(number("outlier_share", ""));
    columns.push(number("share_within_a_bin", ""));
    columns.extend(
        [
            "rms_error_m",
            "median_absolute_error_m",
            "rms_error_without_outliers_m",
            "mean_error_m",
            "mean_error_with_walk_m",
            "median_absolute_error_of_all_m",
            "rms_error_of_every_peak_m",
            "guide_rms_error_m",
            "rms_bound_m",
            "bin_m",
        ]
        .map(|name| number(name, "m")),
    );
    columns.push(number("photons_expected", ""));
    columns.push(whole("counts"));
    columns.push(number("exposure_time_s", "s"));
    columns.push(number("frame_time_s", "s"));
    columns
}

fn frame_cells(frame: &Frame, sensor: &SensorConfig) -> Vec<Cell> {
    let Summary {
        pixels,
        with_target,
        guided,
        in_window,
        depths,
        depths_without_surface,
        no_depth,
        bin_m,
        outliers,
        outlier_share,
        rms_error_m,
        rms_bound_m,
        walk_left: _,
        median_absolute_error_m,
        rms_error_without_outliers_m,
        mean_error_m,
        mean_error_with_walk_m,
        median_absolute_error_of_all_m,
        share_within_a_bin,
        rms_error_of_every_peak_m,
        guide_rms_error_m,
    } = frame.summary();
    let mut cells: Vec<Cell> = [
        pixels,
        with_target,
        guided,
        in_window,
        depths,
        depths_without_surface,
        outliers,
    ]
    .map(Cell::count)
    .into();
    let without = |reason| no_depth.get(&reason).copied().unwrap_or(0);
    cells.extend(NoDepth::ALL.map(|reason| Cell::count(without(reason))));
    cells.extend(
        [
            outlier_share,
            share_within_a_bin,
            rms_error_m,
            median_absolute_error_m,
            rms_error_without_outliers_m,
            mean_error_m,
            mean_error_with_walk_m,
            median_absolute_error_of_all_m,
            rms_error_of_every_peak_m,
            guide_rms_error_m,
            rms_bound_m,
            Some(bin_m),
            Some(frame.photons_expected),
        ]
        .map(Cell::maybe),
    );
    let counts: u64 = frame.histograms.iter().map(|&n| u64::from(n)).sum();
    cells.push(Cell::Whole(counts as i64));
    cells.push(Cell::Number(frame.exposure_time.as_s()));
    cells.push(Cell::Number(sensor.frame_time(frame.exposure_time).as_s()));
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study(text: &str) -> Study {
        Study::parse("study.toml", text, Path::new(""), "test").unwrap()
    }

    #[test]
    fn points_of_one_sensor_share_it() {
        let study =
            study("[vary]\nscene.lidar.pde = [0.1, 0.2]\nsensor.clk_hz = [\"384 MHz\", 3e8]\n");
        let subject = Subject::new(&study);
        let sensor = |index| {
            // Each point on a thread of its own, as it were.
            let ready = subject.ready(&study.point(index), &mut Scratch::default());
            match ready.unwrap().task {
                Task::Frame(world, _) => world.sensor.clone(),
                Task::Theory(_) => unreachable!("frames are asked for"),
            }
        };
        let sensors: Vec<Sensor> = (0..study.len()).map(sensor).collect();
        assert_eq!(sensors.len(), 4);
        for one in &sensors {
            let same: Vec<&Sensor> = sensors.iter().filter(|other| *other == one).collect();
            assert_eq!(same.len(), 2);
            assert!(same.iter().all(|s| std::ptr::eq(s.timing(), one.timing())));
        }
    }

    fn keys(text: &str) -> Vec<Key> {
        let study = study(text);
        let subject = Subject::new(&study);
        let mut scratch = Scratch::default();
        let of = |index| {
            subject
                .ready(&study.point(index), &mut scratch)
                .unwrap()
                .key
        };
        (0..study.len()).map(of).collect()
    }

    #[test]
    fn what_says_the_same_has_the_same_key() {
        let varied =
            keys("[vary]\nframe.laser_cycles = [500, 1000]\nsensor.clk_hz = [\"384 MHz\", 3e8]\n");
        assert_eq!(varied.len(), 4);
        let default = keys("[fixed]\nframe.laser_cycles = 1000\n");
        assert_eq!(varied[2], default[0]);
        let other_way = keys(
            "[study]\nseed = 1\n[fixed]\nscene = \"street\"\nwindows.overlap = 0.25\n[vary]\nsensor.clk_hz = [0.3e9]\n",
        );
        assert_eq!(varied[3], other_way[0]);
        let seeds = keys("[study]\nseed = 1\nreplicas = 2\n");
        assert_eq!(seeds[0], default[0]);
        let mut all = [varied, seeds].concat();
        all.sort();
        all.dedup();
        assert_eq!(all.len(), 5);
    }

    #[test]
    fn a_file_that_changes_makes_another_point() {
        let dir = tempfile::tempdir().unwrap();
        let mesh = "v 0 0 10\nv 1 0 10\nv 0 1 10\nf 1 2 3\n";
        let key = |mesh: &str| {
            std::fs::write(dir.path().join("a.obj"), mesh).unwrap();
            let scene = "[[object]]\nname = \"a\"\nkind = \"mesh\"\nfile = \"a.obj\"\ncentre_m = [0, 0, 5]\nreflectivity = 0.5\n";
            std::fs::write(dir.path().join("scene.toml"), scene).unwrap();
            let study =
                Study::parse("s", "[fixed]\nscene = \"scene.toml\"\n", dir.path(), "s").unwrap();
            let subject = Subject::new(&study);
            subject
                .ready(&study.point(0), &mut Scratch::default())
                .unwrap()
                .key
        };
        let first = key(mesh);
        assert_eq!(key(mesh), first);
        assert_ne!(key(&mesh.replace("10", "11")), first);
    }

    /// Whoever changes what a frame counts, or how a row is made of it, makes the rows of others' journals wrong: then `RESULTS` in
    /// `row.rs` must be raised, and the numbers here be those of the new program.
    #[test]
    fn rows_are_those_that_journals_keep() {
        let study = study(
            "[fixed]\nsensor.rows = 8\nsensor.cols = 8\nframe.laser_cycles = 200\nframe.engine = \"cohort\"\nscene = \"night\"\n",
        );
        let subject = Subject::new(&study);
        let mut scratch = Scratch::default();
        let ready = subject.ready(&study.point(0), &mut scratch).unwrap();
        let row = subject.take(ready, &mut scratch).unwrap();
        assert_eq!(row.error, None);
        let of = |name: &str| {
            let at = frame_columns().iter().position(|c| c.name == name).unwrap();
            row.cells[at].number().unwrap()
        };
        assert_eq!(row.cells.len(), frame_columns().len());
        assert_eq!((of("depths"), of("counts")), (29.0, 5168.0));
        let error_m = of("rms_error_m");
        assert!((error_m - 13.025_12).abs() < 1e-4, "{error_m}");
    }
}
