//! `gdtof photons`: SPAD pulses of a scene for any chip.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::voice::{note, notes, progress, say_json, say_unless_quiet};
use super::{SceneArgs, asked};
use crate::chip::Sensor;
use crate::files::{InputError, OutputFile, ResultSet};
use crate::photons::{
    LightSource, PulseFile, PulseFormat, PulseOptions, WrittenPulses, write_light, write_pulses,
};
use crate::report::Table;
use crate::request::{LightRequest, Spelling};
use crate::scene::{MOST_BACKGROUND_HZ, MOST_PER_ECHO};
use crate::system::TakenFrame;
use crate::units::Time;

/// Output of which the size is told before it is written, bytes.
const LARGE_BYTES: f64 = 1e9;

/// Waveforms end before 2⁵³ fs, beyond which GTKWave reads no time.
const LONGEST_WAVEFORM_S: f64 = 9.0;

/// Times that a word of `memh` may cover, ns.
const WORDS_NS: std::ops::RangeInclusive<f64> = 1e-3..=1e6;

/// Arguments of `gdtof photons`.
#[derive(Args)]
pub(super) struct PhotonsArgs {
    /// Scene: a name or a file, as for --scene.
    #[arg(value_name = "SCENE", conflicts_with = "scene")]
    world: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneArgs,
    /// Pulses of a frame that was taken: its frame.json. Macropixels whose SPADs were off have none. Start values and
    /// sensor go beside the pulses, for gdtof replay.
    #[arg(long, value_name = "FILE", conflicts_with_all = [
        "world", "scene", "sensor", "rows", "cols", "block", "set", "liberty", "cell",
        "period_ns", "stop_periods", "laser_cycles", "seed", "spads", "fov_deg",
    ])]
    frame: Option<PathBuf>,
    /// Length of a laser cycle, ns [default: CLK periods of the sensor, by --stop-periods].
    #[arg(long, value_name = "T", conflicts_with = "stop_periods")]
    period_ns: Option<f64>,
    /// CLK periods in a laser cycle.
    #[arg(long, value_name = "P", default_value_t = 520)]
    stop_periods: u32,
    /// Laser cycles.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    laser_cycles: u32,
    /// Seed of the photons.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// SPADs of a macropixel, 1 to 64 [default: the sensor's].
    #[arg(long, value_name = "N")]
    spads: Option<usize>,
    /// A single pixel on the optical axis with this horizontal field of view, degrees, instead of an array. All of the laser's
    /// energy falls into it.
    #[arg(long, value_name = "DEG", conflicts_with_all = ["rows", "cols", "pixel"])]
    fov_deg: Option<f64>,
    /// Macropixels to write, as row,col or with ranges such as 8-11,20-23; may be repeated [default: all].
    #[arg(long, value_name = "R,C")]
    pixel: Vec<String>,
    /// What to write.
    #[arg(long, value_enum, default_value_t)]
    format: PulseFormat,
    /// Time that a word of memh covers, ns [default: 1].
    #[arg(long, value_name = "W")]
    word_ns: Option<f64>,
    /// Leave CLK out of waveforms. In weak light, CLK is most of a VCD.
    #[arg(long)]
    no_clk: bool,
    /// Folder for the results; created if missing.
    #[arg(long, value_name = "DIR", default_value = "photons")]
    out: PathBuf,
    /// Print photons.json instead of the table.
    #[arg(long)]
    json: bool,
}

/// What photons.json says: of what the pulses are, and how many there are.
#[derive(Serialize)]
struct Report {
    version: &'static str,
    #[serde(flatten)]
    configuration: Configuration,
    /// CLK periods in a laser cycle; 1 where the period is given.
    #[serde(skip)]
    stop_periods: u32,
    /// SPAD n is in row n / `spad_cols` and column n % `spad_cols` of its macropixel.
    spad_cols: usize,
    /// How long the wire of a SPAD is high.
    pulse_ns: f64,
    macropixels: usize,
    macropixels_off: usize,
    photons: u64,
    pulses: u64,
    pulses_merged: u64,
    files: Vec<PulseFile>,
}

/// What was asked for: in photons.json and in the manifest.
#[derive(Clone, Serialize)]
struct Configuration {
    scene_name: String,
    rows: usize,
    cols: usize,
    period_ns: f64,
    laser_cycles: u32,
    seed: u64,
    spads: usize,
    format: PulseFormat,
    #[serde(skip_serializing_if = "Option::is_none")]
    word_ns: Option<f64>,
}

/// Where pulses come from.
struct Origin {
    source: LightSource,
    scene_name: String,
    /// Of a frame: its sensor, and start values of all macropixels.
    frame: Option<(Sensor, Vec<u16>)>,
}

/// Runs the command.
///
/// # Errors
/// Bad input and unwritable output.
pub(super) fn run(mut args: PhotonsArgs) -> anyhow::Result<()> {
    args.scene = args.scene.or_file(args.world.take());
    let args = &args;
    let options = args.options()?;
    let Origin {
        source,
        scene_name,
        frame,
    } = args.origin()?;
    let pixels = args.pixels(&source)?;
    if args.format == PulseFormat::Vcd && source.end().as_s() > LONGEST_WAVEFORM_S {
        let message = format!(
            "an exposure of {:.1} s has no waveform, whose viewers read times up to {LONGEST_WAVEFORM_S} s; give fewer laser cycles or another format",
            source.end().as_s()
        );
        return Err(InputError::new("--format vcd", message).into());
    }
    let off = pixels.iter().filter(|pixel| !source.is_on(**pixel)).count();
    if off > 0 {
        note(format_args!(
            "{off} of {} macropixels have no pulses, because their SPADs were off in the frame; without --frame all have some",
            pixels.len()
        ));
    }
    let bytes = options.expected_bytes(&source, &pixels);
    if bytes > LARGE_BYTES {
        note(format_args!(
            "writes about {:.1} GB into {}",
            bytes * 1e-9,
            args.out.display()
        ));
    }
    let results = ResultSet::begin(&args.out, "photons")?;
    let folder = results.staging();
    let progress = progress(
        pixels.len() as u64,
        "drawing {bar:40} {pos}/{len} macropixels, {eta} left",
    );
    let written = write_pulses(folder, &source, &pixels, &options, |n| {
        progress.inc(n as u64);
    })?;
    write_light(&folder.join("light.csv"), &source, &pixels)?;
    if let Some((sensor, starts)) = &frame {
        OutputFile::write_text(&folder.join("sensor.toml"), &sensor.commented())?;
        OutputFile::write_text(&folder.join("inits.csv"), &inits(&source, starts))?;
    }
    let report = Report::new(args, scene_name, &source, (pixels.len(), off), written);
    let text = serde_json::to_string_pretty(&report)? + "\n";
    OutputFile::write_text(&folder.join("photons.json"), &text)?;
    let kept = results.commit(report.configuration.clone())?;
    progress.finish_and_clear();
    notes(kept);
    let is_cut = |pixel: &&u32| source.is_beyond_model(**pixel);
    let cut = pixels.iter().filter(is_cut).count();
    if cut > 0 {
        note(format_args!(
            "{cut} of {} macropixels get more light than is modelled: it is cut to {MOST_PER_ECHO:e} photons of an echo a laser cycle, and {MOST_BACKGROUND_HZ:e} Hz of background",
            pixels.len()
        ));
    }
    if report.pulses_merged > 0 {
        note(format_args!(
            "{} pulses are one bit with another of their SPAD in the same word; a --word-ns of at most {} tells them apart",
            report.pulses_merged, report.pulse_ns
        ));
    }
    if args.json {
        return say_json(&report);
    }
    Ok(say_unless_quiet(report.table(args, frame.is_some()))?)
}

impl PhotonsArgs {
    fn options(&self) -> Result<PulseOptions, InputError> {
        let word_ns = self.word_ns.unwrap_or(1.0);
        let option = format!("--word-ns {word_ns}");
        if self.word_ns.is_some() && self.format != PulseFormat::Memh {
            let message = "only memh has words; add --format memh or leave it out";
            return Err(InputError::new(option, message));
        }
        if !WORDS_NS.contains(&word_ns) {
            let message = "is no length of a word; give 0.001 to 1e6 ns";
            return Err(InputError::new(option, message));
        }
        if self.no_clk && self.format != PulseFormat::Vcd {
            let message = "only vcd has a CLK; add --format vcd or leave it out";
            return Err(InputError::new("--no-clk", message));
        }
        Ok(PulseOptions {
            format: self.format,
            word: Time::from_s(word_ns * 1e-9),
            has_clk: !self.no_clk,
        })
    }

    fn origin(&self) -> Result<Origin, InputError> {
        let Some(path) = &self.frame else {
            let (sensor, scene) = self.scene.read()?;
            let request = LightRequest {
                period_ns: self.period_ns,
                stop_periods: self.stop_periods,
                laser_cycles: self.laser_cycles,
                seed: self.seed,
                spads: self.spads,
                fov_deg: self.fov_deg,
                spelling: Spelling::Options,
            };
            return Ok(Origin {
                source: request.source(sensor, scene)?,
                scene_name: self.scene.scene_name(),
                frame: None,
            });
        };
        let frame = TakenFrame::read(path)?;
        let source = LightSource::of_frame(&frame)
            .map_err(|why| InputError::new(path.display(), format!("{why}; take another frame")))?;
        if frame.has_tolerance || frame.settings.engine.of_probes(false) != frame.settings.engine {
            note(
                "the frame's counts were not all made of photons (cohort); these are the photons that the window engine counts",
            );
        }
        let sensor = frame.settings.sensor;
        let start = |start: Option<u16>| start.unwrap_or(sensor.largest_start());
        let starts = frame.pixels.iter().map(|pixel| start(pixel.start));
        Ok(Origin {
            source,
            scene_name: frame.settings.scene_name,
            frame: Some((sensor.clone(), starts.collect())),
        })
    }

    /// Numbers of the macropixels to write, in order.
    fn pixels(&self, source: &LightSource) -> Result<Vec<u32>, InputError> {
        if self.pixel.is_empty() {
            return Ok((0..source.pixels() as u32).collect());
        }
        let mut pixels = Vec::new();
        for text in &self.pixel {
            let [rows, cols] = asked::region("--pixel", text, (source.rows, source.cols))?;
            for row in rows {
                pixels.extend(cols.clone().map(|col| (row * source.cols + col) as u32));
            }
        }
        pixels.sort_unstable();
        pixels.dedup();
        Ok(pixels)
    }
}

/// Start values as `gdtof replay` reads them.
fn inits(source: &LightSource, starts: &[u16]) -> String {
    let mut text = "row,col,init\n".to_owned();
    for (pixel, start) in (0..).zip(starts) {
        let (row, col) = source.position(pixel);
        text += &format!("{row},{col},{start}\n");
    }
    text
}

impl Report {
    fn new(
        args: &PhotonsArgs,
        scene_name: String,
        source: &LightSource,
        (macropixels, macropixels_off): (usize, usize),
        written: WrittenPulses,
    ) -> Self {
        let (exposure, is_memh) = (&source.exposure, args.format == PulseFormat::Memh);
        let period_s = f64::from(exposure.periods) / exposure.clock.as_hz();
        Report {
            version: env!("CARGO_PKG_VERSION"),
            configuration: Configuration {
                scene_name,
                rows: source.rows,
                cols: source.cols,
                period_ns: period_s * 1e9,
                laser_cycles: exposure.laser_cycles,
                seed: exposure.seed,
                spads: exposure.layout.spads(),
                format: args.format,
                word_ns: is_memh.then(|| args.word_ns.unwrap_or(1.0)),
            },
            stop_periods: exposure.periods,
            spad_cols: exposure.layout.cols(),
            pulse_ns: source.pulse_width().as_ns(),
            macropixels,
            macropixels_off,
            photons: written.totals.photons,
            pulses: written.totals.pulses,
            pulses_merged: written.merged,
            files: written.files,
        }
    }

    fn table(&self, args: &PhotonsArgs, has_starts: bool) -> String {
        let to_fs = |ns: f64| libm::round(1e6 * ns) / 1e6;
        let asked = &self.configuration;
        let table = Table::new(format!("Pulses of {}", asked.scene_name))
            .row("macropixels", self.macropixels)
            .row("SPADs of each", asked.spads)
            .row("laser cycles", asked.laser_cycles)
            .row("laser period", format!("{} ns", to_fs(asked.period_ns)))
            .row("photons and dark counts", self.photons)
            .row("pulses", self.pulses);
        let folder = args.out.display();
        let files = match &self.files[..] {
            [file] => file.name.clone(),
            files => format!("{} files such as {}", files.len(), files[0].name),
        };
        let more = if has_starts {
            ", light.csv, inits.csv, sensor.toml"
        } else {
            ", light.csv"
        };
        let mut text = format!("{table}{files}{more} and photons.json in {folder}\n");
        if has_starts && args.format == PulseFormat::Csv {
            text += &format!(
                "gdtof replay --sensor {folder}/sensor.toml --inits {folder}/inits.csv --events {folder}/photons.csv --stop-periods {} --laser-cycles {}\n",
                self.stop_periods, asked.laser_cycles
            );
        }
        text
    }
}
