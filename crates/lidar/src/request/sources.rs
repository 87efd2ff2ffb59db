//! A sensor and a scene: by name or file, with single keys set.
//!
//! ```text
//!   sensor ────────┐                      scene ─────────┐
//!   set sensor.… ──┼─► Sensor             set scene.… ───┴─► Scene
//!   rows, cols, block ─┘
//! ```

use std::path::{Path, PathBuf};

use super::spelling::Spelling;
use crate::chip::own_block::replaceable;
use crate::chip::sensors::CHIPS;
use crate::chip::{Sensor, SensorConfig};
use crate::files::{InputError, instead_of};
use crate::scene::Scene;
use crate::settings::{Assignment, Document};

/// Where a sensor and a scene come from. The default is QuantIC4x4 before the street.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sources {
    /// A sensor file (TOML), or one of the chips by name; a file of such a name comes first.
    pub sensor: Option<PathBuf>,
    /// A scene file (TOML), or one of the built-in scenes by name; a file of such a name comes first.
    pub scene: Option<PathBuf>,
    /// Macropixel rows, instead of the sensor's.
    pub rows: Option<usize>,
    /// Macropixel columns, instead of the sensor's.
    pub cols: Option<usize>,
    /// Netlists in the place of built-in blocks, as `p_counter=my.json`, relative to the current folder.
    pub block: Vec<String>,
    /// Single keys, such as `sensor.clk_hz` or `scene.lidar.pde`; the last one counts.
    pub set: Vec<Assignment>,
    /// What complaints call these settings.
    pub spelling: Spelling,
}

impl Sources {
    /// The sensor, where there is no scene.
    ///
    /// # Errors
    /// Unreadable files, bad keys and values, and a key of anything but the sensor.
    pub fn read_sensor(&self) -> Result<Sensor, InputError> {
        self.read_sensor_with(None)
    }

    /// The sensor and the scene.
    ///
    /// # Errors
    /// Unreadable files, bad keys and values.
    pub fn read(&self) -> Result<(Sensor, Scene), InputError> {
        let mut document = match &self.scene {
            Some(path) => scene_document(path, self.spelling)?,
            None => Scene::outdoor_document(),
        };
        let sensor = self.read_sensor_with(Some(&mut document));
        let scene = Scene::read(&document);
        match (sensor, scene) {
            (Ok(sensor), Ok(scene)) => Ok((sensor, scene)),
            (sensor, scene) => {
                let faults = [sensor.err(), scene.err()];
                InputError::all(faults.into_iter().flatten()).map(|()| unreachable!("one failed"))
            }
        }
    }

    fn read_sensor_with(&self, mut scene: Option<&mut Document>) -> Result<Sensor, InputError> {
        let mut sensor = match &self.sensor {
            Some(path) => described(path, self.spelling)?,
            None => Document::from_table("the sensor", toml::Table::new()),
        };
        for assignment in &self.set {
            let refuse = |message| Err(InputError::new(assignment.origin(), message));
            if let Some(meant) = of_the_other_kind(assignment.names()) {
                return refuse(format!("there is no such key; did you mean {meant}?"));
            }
            let kind = assignment.names()[0].as_str();
            match (kind, assignment.within_section(), &mut scene) {
                ("sensor", Some(key), _) => sensor.assign(&key)?,
                ("scene", Some(key), Some(scene)) => scene.assign(&key)?,
                ("scene", Some(_), None) => {
                    return refuse("this command reads no scene; leave it out".to_owned());
                }
                _ => {
                    return refuse("is not a key of the sensor or scene; give sensor.KEY=VALUE or scene.SECTION.KEY=VALUE".to_owned());
                }
            }
        }
        for (key, value) in [("rows", self.rows), ("cols", self.cols)] {
            if let Some(value) = value {
                let value = i64::try_from(value).unwrap_or(i64::MAX);
                sensor.assign(&Assignment::new(key, value, self.spelling.name(key))?)?;
            }
        }
        for block in &self.block {
            let option = format!("{} {block}", self.spelling.name("block"));
            let given = block.split_once('=');
            let Some((name, file)) =
                given.filter(|(name, _)| replaceable().any(|block| block == *name))
            else {
                let name = block.split('=').next().unwrap_or_default();
                let instead = instead_of(name, replaceable());
                let message = format!("is no BLOCK=FILE with a block; {instead}");
                return Err(InputError::new(option, message));
            };
            // A path in a sensor file is relative to that.
            let file = if sensor.folder == Path::new("") {
                PathBuf::from(file)
            } else {
                std::path::absolute(file).unwrap_or_else(|_| file.into())
            };
            let file = file.to_string_lossy().into_owned();
            sensor.assign(&Assignment::new(&format!("{name}_block"), file, option)?)?;
        }
        Ok(SensorConfig::read_document(&sensor)?.into())
    }

    /// The built-in chip that is asked for by its name.
    pub fn chip(&self) -> Option<&'static str> {
        let name = self.sensor.as_ref().filter(|path| is_name(path))?.to_str();
        let mut chips = CHIPS.iter().map(|chip| chip.name);
        chips.find(|&chip| name == Some(chip))
    }

    /// What reports call the scene.
    pub fn scene_name(&self) -> String {
        match &self.scene {
            Some(path) if is_name(path) => format!("built-in {}", path.display()),
            Some(path) => path.display().to_string(),
            None => "built-in street".to_owned(),
        }
    }
}

/// The name that a key of the scene has which is given as one of the sensor, or the other way round.
fn of_the_other_kind(names: &[String]) -> Option<String> {
    let [kind, rest @ ..] = names else {
        return None;
    };
    let key = rest.last()?;
    match kind.as_str() {
        "sensor" if SensorConfig::key(key).is_none() => scene_key_named(key),
        "scene" if Scene::key(&rest.join(".")).is_none() => {
            SensorConfig::key(key).map(|key| format!("sensor.{}", key.name))
        }
        _ => None,
    }
}

/// The whole name of the scene's key that is called `key`, if one section that is not a list has it.
pub(crate) fn scene_key_named(key: &str) -> Option<String> {
    let sections = Scene::SECTIONS.iter();
    let mut plain = sections.filter(|section| !["object", "interferer"].contains(&section.name));
    let section = plain.find(|section| section.keys.iter().any(|known| known.name == key))?;
    Some(format!("scene.{}.{key}", section.name))
}

/// Whether something is the name of what is built in rather than a file. A file of such a name comes first; a folder does not,
/// because results of a demo stand in one with the name of its scene.
fn is_name(path: &Path) -> bool {
    if path.is_dir() {
        let is_scene = |name: &str| Scene::built_in().any(|(known, _)| known == name);
        let is_chip = |name: &str| CHIPS.iter().any(|chip| chip.name == name);
        return path
            .to_str()
            .is_some_and(|name| is_scene(name) || is_chip(name));
    }
    !path.exists() && path.extension().is_none()
}

/// A scene file, or a built-in scene.
fn scene_document(path: &Path, spelling: Spelling) -> Result<Document, InputError> {
    if !is_name(path) {
        let document = Document::load(path)?;
        refuse_other_kind(&document, ReadAs::Scene, spelling)?;
        return Ok(document);
    }
    if path.to_str().and_then(Sensor::named).is_some() {
        return Err(is_other(
            path.display(),
            ReadAs::Sensor,
            ReadAs::Scene,
            spelling,
        ));
    }
    let named = path.to_str().and_then(Scene::built_in_document);
    named.ok_or_else(|| {
        let given = path.to_string_lossy();
        let instead = instead_of(&given, Scene::built_in().map(|(name, _)| name));
        let message = format!("is neither a file nor a built-in scene; {instead}");
        InputError::new(path.display(), message)
    })
}

/// Refuses settings that are those of something else.
///
/// # Errors
/// When they are.
pub(crate) fn refuse_other_kind(
    document: &Document,
    wanted: ReadAs,
    spelling: Spelling,
) -> Result<(), InputError> {
    match kind_of(&document.table) {
        Some(kind) if kind != wanted => Err(is_other(document.source(), kind, wanted, spelling)),
        _ => Ok(()),
    }
}

/// What a settings file describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ReadAs {
    Sensor,
    Scene,
    Study,
}

/// What the keys at the root are those of, if they are all of one kind.
fn kind_of(table: &toml::Table) -> Option<ReadAs> {
    let is_section = |name: &String| {
        let value = &table[name];
        let is_table = value.is_table() || value.is_array();
        is_table && Scene::SECTIONS.iter().any(|section| section.name == name)
    };
    let is_of_study = |name: &String| ["study", "vary", "fixed"].contains(&name.as_str());
    if table.is_empty() {
        None
    } else if table.keys().all(is_section) {
        Some(ReadAs::Scene)
    } else if table.keys().all(is_of_study) {
        Some(ReadAs::Study)
    } else if table.keys().all(|name| SensorConfig::key(name).is_some()) {
        Some(ReadAs::Sensor)
    } else {
        None
    }
}

fn is_other(
    source: impl std::fmt::Display,
    kind: ReadAs,
    wanted: ReadAs,
    spelling: Spelling,
) -> InputError {
    let (what, key) = match kind {
        ReadAs::Sensor => ("a sensor", "sensor"),
        ReadAs::Scene => ("a scene", "scene"),
        ReadAs::Study => return InputError::new(source, "is a study; `gdtof sweep` runs it"),
    };
    let message = match wanted {
        ReadAs::Study => {
            format!("is {what}; name it in a study, as {key} = \"FILE\" below [fixed]")
        }
        _ => format!("is {what}; give it as {}", spelling.name(key)),
    };
    InputError::new(source, message)
}

/// A sensor file, or the description of a chip that is known by name. A file of such a name comes first.
fn described(path: &Path, spelling: Spelling) -> Result<Document, InputError> {
    if !is_name(path) {
        let document = Document::load(path)?;
        if document.table.is_empty() {
            let message =
                "has no settings; give at least one, or leave the sensor out for quantic4x4";
            return Err(InputError::new(path.display(), message));
        }
        refuse_other_kind(&document, ReadAs::Sensor, spelling)?;
        return Ok(document);
    }
    if path.to_str().and_then(Scene::built_in_document).is_some() {
        return Err(is_other(
            path.display(),
            ReadAs::Scene,
            ReadAs::Sensor,
            spelling,
        ));
    }
    let chip = path.to_str().and_then(Sensor::named).ok_or_else(|| {
        let instead = instead_of(&path.to_string_lossy(), CHIPS.map(|chip| chip.name));
        let message = format!("is neither a file nor a chip; {instead}");
        InputError::new(path.display(), message)
    })?;
    let table = toml::Table::try_from(&*chip).expect("numbers and words");
    Ok(Document::from_table(path.display(), table))
}
