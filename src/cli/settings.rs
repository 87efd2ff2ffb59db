//! `--sensor`, `--scene` and `--set`, and the commands that print what they make: `gdtof sensor` and `gdtof scene`.

use std::fmt::Display;
use std::path::PathBuf;

use clap::Args;

use super::voice::{note, say_file};
use crate::chip::sensors::{CHIPS, HSLIDAR_MOST_HZ};
use crate::chip::{
    CellLibrary, Sensor, SensorConfig, Silicon, UnknownConditions, array, library_files,
    library_setting,
};
use crate::files::InputError;
use crate::netlist::{Conditions, Corner, Mismatch};
use crate::request::{Sources, Spelling};
use crate::scene::Scene;
use crate::settings::{Assignment, Notes, said_remarks};

/// Which sensor.
#[derive(Args)]
pub(super) struct SensorArgs {
    /// Sensor: a file (TOML), or quantic4x4 (the default), vcsel_flash, hslidar or hslidar_delay_line.
    #[arg(long, value_name = "NAME|FILE")]
    sensor: Option<PathBuf>,
    /// Rows of macropixels, instead of the sensor's.
    #[arg(long, value_name = "R")]
    rows: Option<usize>,
    /// Columns of macropixels, instead of the sensor's.
    #[arg(long, value_name = "C")]
    cols: Option<usize>,
    /// Netlist (JSON of Yosys) that replaces a built-in block: p_counter=FILE (or FILE:MODULE). Other blocks are
    /// correlation, front_end, metdc and histogram.
    #[arg(long, value_name = "BLOCK=FILE")]
    block: Vec<String>,
    /// Set one key of the sensor or scene, whatever its file says, for example sensor.clk_hz=300e6,
    /// "sensor.clk_hz=300 MHz" or scene.lidar.pde=0.2. May be repeated; the last value wins. `gdtof sensor` and
    /// `gdtof scene` list the keys.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Cell library that the chip is made of (Liberty: .lib or .lib.gz), instead of the built-in delays: short for
    /// --set sensor.liberty=FILE. May be repeated for a kit of several files.
    #[arg(long, value_name = "FILE")]
    liberty: Vec<PathBuf>,
    /// Cell of the library to take for a kind, for example DFFR=dfrtp_2. May be repeated.
    #[arg(long, value_name = "KIND=NAME", requires = "liberty")]
    cell: Vec<String>,
}

/// Which sensor, and which scene before it.
#[derive(Args)]
pub(super) struct SceneArgs {
    #[command(flatten)]
    sensor: SensorArgs,
    /// Scene: a file (TOML), or street (the default), warehouse, van, fog, glass, sweep, night or empty.
    #[arg(long, value_name = "NAME|FILE")]
    scene: Option<PathBuf>,
}

/// Arguments of `gdtof sensor`.
#[derive(Args)]
pub(super) struct PrintSensorArgs {
    /// Sensor: a name or a file, as for --sensor.
    #[arg(value_name = "SENSOR", conflicts_with = "sensor")]
    chip: Option<PathBuf>,
    /// Print the names of the built-in sensors instead, and what they are.
    #[arg(long)]
    list: bool,
    #[command(flatten)]
    sensor: SensorArgs,
}

/// Arguments of `gdtof scene`.
#[derive(Args)]
pub(super) struct PrintSceneArgs {
    /// Scene: a name or a file, as for --scene.
    #[arg(value_name = "SCENE", conflicts_with = "scene")]
    world: Option<PathBuf>,
    /// Print the names of the built-in scenes instead, and what they show.
    #[arg(long)]
    list: bool,
    #[command(flatten)]
    scene: SceneArgs,
}

impl SensorArgs {
    /// The sensor, for a command that needs no scene.
    ///
    /// # Errors
    /// Unreadable files, bad keys and values, and `--set` of anything but the sensor.
    pub(super) fn read(&self) -> Result<Sensor, InputError> {
        let sensor = self.sources(None)?.read_sensor()?;
        self.warn_of_unusual(&sensor);
        Ok(sensor)
    }

    /// The sensor, where anything of it is given.
    ///
    /// # Errors
    /// As [`SensorArgs::read`].
    pub(super) fn read_if_given(&self) -> Result<Option<Sensor>, InputError> {
        let has_file = self.sensor.is_some() || !self.liberty.is_empty();
        let has_size = self.rows.is_some() || self.cols.is_some();
        let is_given = has_file || has_size || !self.block.is_empty() || !self.set.is_empty();
        is_given.then(|| self.read()).transpose()
    }

    /// Why the values of the chip were chosen, if it is built in.
    fn notes(&self) -> Notes {
        let default = self.sensor.is_none().then_some(CHIPS[0].name);
        let name = self.named_sources(None).chip().or(default);
        name.and_then(Sensor::built_in_notes).unwrap_or_default()
    }

    /// What the top of the exported chip is called: modes of a chip are named after it.
    pub(super) fn chip(&self) -> &'static str {
        let asked = self.named_sources(None).chip().unwrap_or(array::NAME);
        let mut chips = CHIPS.iter().map(|chip| chip.name);
        chips.find(|chip| asked.starts_with(chip)).unwrap_or(asked)
    }

    /// Notes what is odd about the cell library, and if CLK is faster than the thesis's chip takes.
    fn warn_of_unusual(&self, sensor: &SensorConfig) {
        let library = CellLibrary::from_config(sensor).ok();
        if let Some(library) = library.and_then(CellLibrary::from_file) {
            library.remarks.iter().for_each(note);
        }
        note_unusual(self.source_name(), &sensor.remarks());
        if self.chip() == "hslidar" && sensor.clk_hz > HSLIDAR_MOST_HZ {
            note(format_args!(
                "CLK of {} MHz: the thesis's HSLIDAR takes {} MHz at most (6.3.1), and what is modelled here is its logic in a faster library",
                sensor.clk_hz / 1e6,
                HSLIDAR_MOST_HZ / 1e6
            ));
        }
    }

    /// What notes call the sensor.
    fn source_name(&self) -> String {
        let path = self.sensor.as_ref();
        path.map_or("the sensor".to_owned(), |path| path.display().to_string())
    }

    /// Whether rows and columns are both asked for on the command line.
    pub(super) fn gives_size(&self) -> bool {
        let is_set = |key: &str| {
            let mut given = self
                .set
                .iter()
                .filter_map(|text| Assignment::parse(text, "").ok());
            given.any(|given| given.names() == ["sensor", key])
        };
        (self.rows.is_some() || is_set("rows")) && (self.cols.is_some() || is_set("cols"))
    }

    /// What `--liberty` and `--cell` set.
    fn set_of_cells(&self) -> Result<Vec<Assignment>, InputError> {
        let mut set = Vec::new();
        if !self.liberty.is_empty() {
            let files = self.liberty.iter().flat_map(|files| library_files(files));
            let files = files.map(|file| std::path::absolute(&file).unwrap_or(file));
            let setting = library_setting(files).display().to_string();
            let origin = format!("--liberty {setting}");
            set.push(Assignment::new("sensor.liberty", setting, origin)?);
        }
        if !self.cell.is_empty() {
            let cells = self.cell.join(", ");
            let origin = format!("--cell {}", self.cell.join(" --cell "));
            set.push(Assignment::new("sensor.liberty_cells", cells, origin)?);
        }
        Ok(set)
    }

    /// The sensor and the scene with all that is set.
    ///
    /// # Errors
    /// `--set` of what is no key and value.
    fn sources(&self, scene: Option<PathBuf>) -> Result<Sources, InputError> {
        let mut set = self.set_of_cells()?;
        for text in &self.set {
            set.push(Assignment::parse(text, format!("--set {text}"))?);
        }
        Ok(Sources {
            set,
            ..self.named_sources(scene)
        })
    }

    /// The sensor and the scene as they are named, before single keys are set.
    fn named_sources(&self, scene: Option<PathBuf>) -> Sources {
        Sources {
            sensor: self.sensor.clone(),
            scene,
            rows: self.rows,
            cols: self.cols,
            block: self.block.clone(),
            set: Vec::new(),
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
        let (sensor, scene) = self.sensor.sources(self.scene.clone())?.read()?;
        self.sensor.warn_of_unusual(&sensor);
        note_unusual(self.scene_name(), &scene.remarks());
        if let (Some(path), true) = (
            &self.scene,
            scene.objects.is_empty() && self.scene != Some("empty".into()),
        ) {
            note(format_args!(
                "{} lacks [[object]], so the world is empty and no light returns; begin with a whole scene (`gdtof scene warehouse > my_scene.toml`, `gdtof scene --list` names others) and change it, or keep a built-in one and change keys with --set scene.lidar.pde=0.2",
                path.display()
            ));
        }
        Ok((sensor, scene))
    }

    /// What reports call the scene.
    pub(super) fn scene_name(&self) -> String {
        self.sensor.named_sources(self.scene.clone()).scene_name()
    }

    /// Why the values of the scene were chosen, if it is built in.
    fn notes(&self) -> Notes {
        let name = self.scene_name();
        let name = name.strip_prefix("built-in ");
        name.and_then(Scene::built_in_notes).unwrap_or_default()
    }
}

/// Notes what is probably in another unit.
pub(super) fn note_unusual(source: impl Display, remarks: &[String]) {
    said_remarks(&source.to_string(), remarks)
        .iter()
        .for_each(note);
}

/// What is built in, a line each.
fn print_names<'a>(names: impl Iterator<Item = (&'a str, &'a str)>) -> anyhow::Result<()> {
    let lines = names.map(|(name, what)| format!("{name:<20}{what}\n"));
    Ok(say_file(lines.collect::<String>())?)
}

/// The text up to its first full stop.
fn first_sentence(text: &str) -> &str {
    let end = text.find(". ").unwrap_or(text.len());
    text[..end].trim_end_matches('.')
}

/// `gdtof sensor`.
///
/// # Errors
/// Bad input.
pub(super) fn print_sensor(args: PrintSensorArgs) -> anyhow::Result<()> {
    if args.list {
        return print_names(
            CHIPS
                .iter()
                .map(|chip| (chip.name, first_sentence(chip.head))),
        );
    }
    let sensor = SensorArgs {
        sensor: args.chip.or(args.sensor.sensor),
        ..args.sensor
    };
    let notes = sensor.notes();
    Ok(say_file(sensor.read()?.commented_with(&notes))?)
}

/// `gdtof scene`.
///
/// # Errors
/// Bad input.
pub(super) fn print_scene(args: PrintSceneArgs) -> anyhow::Result<()> {
    if args.list {
        return print_names(Scene::built_in());
    }
    let args = args.scene.or_file(args.world);
    let (_, scene) = args.read()?;
    Ok(say_file(scene.commented_with(&args.notes()))?)
}

// What the chip is made of and where it is operated: `--process`, `--voltage`, `--temperature`, `--mismatch`.
//
// ```text
//   process, voltage, temperature ─► factor on every delay ─┐
//   mismatch, its seed ─────────────► factor on each cell's ┴─► Silicon
// ```

/// Silicon and its conditions.
#[derive(Args)]
pub(super) struct SiliconArgs {
    /// Speed of the silicon: slow, typ or fast. Like voltage and temperature it scales the delays of the sensor's
    /// corner.
    #[arg(long, value_name = "SPEED", default_value = "typ")]
    process: Corner,
    /// Supply voltage, V.
    #[arg(long, value_name = "V", default_value_t = 1.1)]
    voltage: f64,
    /// Junction temperature, °C, instead of the sensor's [default: sensor.temperature_c, or 50].
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    temperature: Option<f64>,
    /// Random mismatch: relative standard deviation of an inverter's delay.
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0)]
    mismatch: f64,
    /// Seed of the mismatch.
    #[arg(long, value_name = "S", visible_alias = "seed", default_value_t = 1)]
    mismatch_seed: u64,
}

impl SiliconArgs {
    /// The silicon: a sensor's library in its corner.
    ///
    /// # Errors
    /// Conditions and mismatch for which no delays are known.
    pub(super) fn read(&self, config: &SensorConfig) -> Result<Silicon, InputError> {
        let silicon = Silicon::new(config).in_conditions(self.conditions(config));
        let silicon = silicon.map_err(|why| {
            let options = match why {
                UnknownConditions::OfLibrary => "--process, --voltage, --temperature",
                UnknownConditions::Far => "--voltage, --temperature",
            };
            InputError::new(options, why.to_string())
        })?;
        if !(0.0..=0.5).contains(&self.mismatch) {
            let message = format!("{} is not a relative spread; give 0 to 0.5", self.mismatch);
            return Err(InputError::new("--mismatch", message));
        }
        let mismatch = (self.mismatch > 0.0).then_some(Mismatch {
            sigma: self.mismatch,
            seed: self.mismatch_seed,
        });
        Ok(Silicon {
            mismatch,
            ..silicon
        })
    }

    /// Process, supply and temperature.
    pub(super) fn conditions(&self, config: &SensorConfig) -> Conditions {
        let usual = config.conditions();
        Conditions {
            process: self.process,
            voltage_v: self.voltage,
            temperature_c: self.temperature.unwrap_or(usual.temperature_c),
        }
    }
}
