//! `--sensor`, `--scene` and `--set`, and the commands that print what they make: `gdtof sensor` and `gdtof scene`.
//!
//! ```text
//!   --sensor FILE ─┐                      --scene FILE ─┐
//!   --set sensor.… ┼─► SensorConfig       --set scene.… ┴─► Scene
//!   --rows, --cols ┘
//! ```

use std::path::{Path, PathBuf};

use clap::Args;

use super::say;
use crate::chip::sensors::CHIPS;
use crate::chip::{Sensor, SensorConfig};
use crate::files::InputError;
use crate::scene::Scene;
use crate::settings::Document;

/// Which sensor.
#[derive(Args)]
pub(super) struct SensorArgs {
    /// Sensor configuration (TOML), or one of the chips quantic4x4 (without it), hslidar and hslidar_delay_line.
    #[arg(long, value_name = "FILE")]
    sensor: Option<PathBuf>,
    /// Macropixel rows, instead of the configuration's.
    #[arg(long, value_name = "R")]
    rows: Option<usize>,
    /// Macropixel columns, instead of the configuration's.
    #[arg(long, value_name = "C")]
    cols: Option<usize>,
    /// Set one key of the sensor or scene, whatever its file says, as sensor.clk_hz=300e6, \"sensor.clk_hz=300 MHz\" or
    /// scene.lidar.pde=0.2; may be repeated, and the last one counts. `gdtof sensor` and `gdtof scene` list the keys.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// Which sensor, and which scene before it.
#[derive(Args)]
pub(super) struct SceneArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    /// Scene (TOML), or one of the built-in street (without it), van, fog, glass, sweep, night and empty.
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
}

impl SensorArgs {
    /// The sensor, for a command that needs no scene.
    ///
    /// # Errors
    /// Unreadable files, bad keys and values, and `--set` of anything but the sensor.
    pub(super) fn read(&self) -> Result<SensorConfig, InputError> {
        self.read_with(None)
    }

    /// Whether rows and columns are both asked for on the command line.
    pub(super) fn gives_size(&self) -> bool {
        let is_set = |key: &str| {
            let prefix = format!("sensor.{key}=");
            self.set.iter().any(|set| set.starts_with(&prefix))
        };
        (self.rows.is_some() || is_set("rows")) && (self.cols.is_some() || is_set("cols"))
    }

    fn read_with(&self, mut scene: Option<&mut Document>) -> Result<SensorConfig, InputError> {
        let mut sensor = match &self.sensor {
            Some(path) => described(path)?,
            None => Document::of("the sensor", toml::Table::new()),
        };
        for assignment in &self.set {
            let option = format!("--set {assignment}");
            if let Some(rest) = assignment.strip_prefix("sensor.") {
                sensor.assign(rest, &option)?;
            } else if let Some(rest) = assignment.strip_prefix("scene.") {
                let Some(scene) = &mut scene else {
                    let message = "this command reads no scene; leave it out";
                    return Err(InputError::new(option, message));
                };
                scene.assign(rest, &option)?;
            } else {
                let message = "is no key of the sensor or scene; give sensor.KEY=VALUE or scene.SECTION.KEY=VALUE";
                return Err(InputError::new(option, message));
            }
        }
        for (key, value) in [("rows", self.rows), ("cols", self.cols)] {
            if let Some(value) = value {
                let value = i64::try_from(value).unwrap_or(i64::MAX);
                sensor.set_value(key, value.into(), &format!("--{key}"));
            }
        }
        SensorConfig::read_document(&sensor)
    }
}

impl SceneArgs {
    /// The same with this scene file, if there is one.
    pub(super) fn or_file(self, scene: Option<PathBuf>) -> Self {
        SceneArgs {
            scene: scene.or(self.scene),
            ..self
        }
    }

    /// The sensor and the scene.
    ///
    /// # Errors
    /// Unreadable files, bad keys and values.
    pub(super) fn read(&self) -> Result<(SensorConfig, Scene), InputError> {
        let mut document = match &self.scene {
            Some(path) => scene_document(path)?,
            None => Scene::outdoor_document(),
        };
        let sensor = self.sensor.read_with(Some(&mut document));
        let scene = Scene::read(&document);
        match (sensor, scene) {
            (Ok(sensor), Ok(scene)) => Ok((sensor, scene)),
            (sensor, scene) => {
                let faults = [sensor.err(), scene.err()];
                InputError::all(faults.into_iter().flatten()).map(|()| unreachable!("one failed"))
            }
        }
    }

    /// What reports call the scene.
    pub(super) fn scene_name(&self) -> String {
        match &self.scene {
            Some(path) if is_name(path) => format!("built-in {}", path.display()),
            Some(path) => path.display().to_string(),
            None => "built-in street".to_owned(),
        }
    }
}

/// Whether something is the name of what is built in rather than a file. A file of such a name comes first.
fn is_name(path: &Path) -> bool {
    !path.exists() && path.extension().is_none()
}

/// A scene file, or a built-in scene.
fn scene_document(path: &Path) -> Result<Document, InputError> {
    if !is_name(path) {
        return read(path);
    }
    let named = path.to_str().and_then(Scene::built_in_document);
    named.ok_or_else(|| {
        let names: Vec<&str> = Scene::built_in().map(|(name, _)| name).collect();
        let message = format!(
            "is no file and no built-in scene; give {}, or a file",
            names.join(" or ")
        );
        InputError::new(path.display(), message)
    })
}

/// A sensor file, or the description of a chip that is known by name. A file of such a name comes first.
fn described(path: &Path) -> Result<Document, InputError> {
    if !is_name(path) {
        return read(path);
    }
    let chip = path.to_str().and_then(Sensor::named).ok_or_else(|| {
        let names = CHIPS.map(|(name, _)| name).join(" or ");
        InputError::new(
            path.display(),
            format!("is no file and no chip; give {names}, or a file"),
        )
    })?;
    let table = toml::Table::try_from(&*chip).expect("numbers and words");
    Ok(Document::of(path.display(), table))
}

fn read(path: &Path) -> Result<Document, InputError> {
    Document::load(path)
}

/// `gdtof sensor`.
///
/// # Errors
/// Bad input.
pub(super) fn print_sensor(args: &SensorArgs) -> anyhow::Result<()> {
    Ok(say(args.read()?.commented())?)
}

/// `gdtof scene`.
///
/// # Errors
/// Bad input.
pub(super) fn print_scene(args: &SceneArgs) -> anyhow::Result<()> {
    Ok(say(args.read()?.1.commented())?)
}
