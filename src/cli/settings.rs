//! `--sensor`, `--scene` and `--set`, and the commands that print what they make: `gdtof sensor` and `gdtof scene`.

use std::path::PathBuf;

use clap::Args;

use super::voice::{note, say};
use crate::chip::sensors::{CHIPS, HSLIDAR_MOST_HZ};
use crate::chip::{Sensor, SensorConfig, array};
use crate::files::InputError;
use crate::request::{Sources, Spelling};
use crate::scene::Scene;

/// Which sensor.
#[derive(Args)]
pub(super) struct SensorArgs {
    /// Sensor: a file (TOML), or quantic4x4 (the default), hslidar or hslidar_delay_line.
    #[arg(long, value_name = "FILE")]
    sensor: Option<PathBuf>,
    /// Rows of macropixels, instead of the sensor's.
    #[arg(long, value_name = "R")]
    rows: Option<usize>,
    /// Columns of macropixels, instead of the sensor's.
    #[arg(long, value_name = "C")]
    cols: Option<usize>,
    /// Netlist (JSON of Yosys) in the place of a built-in block: p_counter=FILE (or FILE:MODULE); also correlation,
    /// front_end, metdc and histogram.
    #[arg(long, value_name = "BLOCK=FILE")]
    block: Vec<String>,
    /// Set one key of the sensor or scene, whatever its file says, for example sensor.clk_hz=300e6,
    /// "sensor.clk_hz=300 MHz" or scene.lidar.pde=0.2. May be repeated; the last value wins. `gdtof sensor` and
    /// `gdtof scene` list the keys.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Cell library that the chip is made of (Liberty: .lib or .lib.gz), instead of the built-in delays: short for
    /// --set sensor.liberty=FILE.
    #[arg(long, value_name = "FILE")]
    liberty: Option<PathBuf>,
    /// Cell of the library to take for a kind, for example DFFR=dfrtp_2. May be repeated.
    #[arg(long, value_name = "KIND=NAME", requires = "liberty")]
    cell: Vec<String>,
}

/// Which sensor, and which scene before it.
#[derive(Args)]
pub(super) struct SceneArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    /// Scene: a file (TOML), or street (the default), van, fog, glass, sweep, night or empty.
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
}

impl SensorArgs {
    /// The sensor, for a command that needs no scene.
    ///
    /// # Errors
    /// Unreadable files, bad keys and values, and `--set` of anything but the sensor.
    pub(super) fn read(&self) -> Result<Sensor, InputError> {
        let sensor = self.sources(None).read_sensor()?;
        self.note_clk(&sensor);
        Ok(sensor)
    }

    /// What the top of the exported chip is called: modes of a chip are named after it.
    pub(super) fn chip(&self) -> &'static str {
        let asked = self.sources(None).chip().unwrap_or(array::NAME);
        let mut chips = CHIPS.iter().map(|(chip, _)| *chip);
        chips.find(|chip| asked.starts_with(chip)).unwrap_or(asked)
    }

    /// Notes if CLK is faster than the thesis's chip takes.
    fn note_clk(&self, sensor: &SensorConfig) {
        if self.chip() == "hslidar" && sensor.clk_hz > HSLIDAR_MOST_HZ {
            note(format_args!(
                "CLK of {} MHz: the thesis's HSLIDAR takes {} MHz at most (6.3.1), and what is modelled here is its logic in a faster library",
                sensor.clk_hz / 1e6,
                HSLIDAR_MOST_HZ / 1e6
            ));
        }
    }

    /// Whether rows and columns are both asked for on the command line.
    pub(super) fn gives_size(&self) -> bool {
        let is_set = |key: &str| {
            let prefix = format!("sensor.{key}=");
            self.set.iter().any(|set| set.starts_with(&prefix))
        };
        (self.rows.is_some() || is_set("rows")) && (self.cols.is_some() || is_set("cols"))
    }

    /// What `--liberty` and `--cell` set.
    fn set_of_cells(&self) -> impl Iterator<Item = String> {
        let file = self.liberty.as_ref().map(|file| {
            let file = std::path::absolute(file).unwrap_or_else(|_| file.clone());
            format!("sensor.liberty={}", file.display())
        });
        let cells = (!self.cell.is_empty())
            .then(|| format!("sensor.liberty_cells={}", self.cell.join(", ")));
        file.into_iter().chain(cells)
    }

    fn sources(&self, scene: Option<PathBuf>) -> Sources {
        Sources {
            sensor: self.sensor.clone(),
            scene,
            rows: self.rows,
            cols: self.cols,
            block: self.block.clone(),
            set: self
                .set_of_cells()
                .chain(self.set.iter().cloned())
                .collect(),
            spelling: Spelling::Options,
        }
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
    pub(super) fn read(&self) -> Result<(Sensor, Scene), InputError> {
        let (sensor, scene) = self.sources().read()?;
        self.sensor.note_clk(&sensor);
        Ok((sensor, scene))
    }

    /// What reports call the scene.
    pub(super) fn scene_name(&self) -> String {
        self.sources().scene_name()
    }

    fn sources(&self) -> Sources {
        self.sensor.sources(self.scene.clone())
    }
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
