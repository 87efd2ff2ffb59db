//! The command line. Bad input ends with one sentence on standard error and exit status 2; anything
//! else that goes wrong with exit status 1.

mod calibrate;
mod demo;
mod drive;
mod export;
mod frame;
mod guiding;
mod pareto;
mod power;
mod range;
mod replay;
mod reproduce;
mod sdf;
mod settings;
mod silicon;
mod speed;
mod stereo;
mod tb;
mod timing;
mod wave;
mod wording;

pub use tb::testbench;

use std::io::Write;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use self::settings::{SceneArgs, SensorArgs};
use crate::chip::SensorConfig;
use crate::files::{InputError, clean_up_when_interrupted};

/// A guided direct time-of-flight lidar chip, simulated down to gates and flip-flops.
#[derive(Parser)]
#[command(name = "gdtof", version, about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Take one guided frame of a scene: depth map, histograms, waveform.
    Frame(frame::FrameArgs),
    /// Take frame after frame of a world in motion: depth maps, and one recording.
    Drive(drive::DriveArgs),
    /// Show the thesis's demonstrator a scene, and say what it found.
    Demo(demo::DemoArgs),
    /// Run recorded SPAD events through the chip.
    Replay(replay::ReplayArgs),
    /// Print the thesis's figures, published beside computed.
    Reproduce(reproduce::ReproduceArgs),
    /// Depths from a real sensor's histograms, beside its own.
    Range(range::RangeArgs),
    /// Sweep a picosecond laser over the bins of a sensor with delay lines, and keep when they are.
    Calibrate(calibrate::CalibrateArgs),
    /// Disparities of a rectified pair of pictures, by semi-global matching.
    Stereo(stereo::StereoArgs),
    /// How fast the fast engines are, by size of the array and threads, and the memory they take.
    Speed(speed::SpeedArgs),
    /// How fast the chip can be clocked: ripple, periods, margins.
    Timing(timing::TimingArgs),
    /// What the blocks of a macropixel take from the supply, by the toggles of a gate-level run.
    Power(power::PowerArgs),
    /// Run time against error.
    Pareto(pareto::ParetoArgs),
    /// Print the sensor as a commented file: every key with its unit, range and source.
    Sensor(SensorArgs),
    /// Print the scene as a commented file: every key with its unit, range and source.
    Scene(SceneArgs),
    /// Replay one laser cycle of one macropixel of a frame that was taken, as a waveform.
    Wave(wave::WaveArgs),
    /// Run the testbenches of the chip's blocks, all or those named.
    Tb(tb::TbArgs),
    /// Write the chip for other tools.
    #[command(subcommand)]
    Export(export::ExportCommand),
}

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    if let Err(error) = clean_up_when_interrupted() {
        eprintln!(
            "gdtof: signals cannot be watched ({error}); an interrupted run will leave its files"
        );
    }
    let result = match Cli::parse().command {
        Command::Tb(args) => return finish(tb::run(&args)),
        Command::Frame(args) => frame::run(&args),
        Command::Drive(args) => drive::run(args),
        Command::Demo(args) => demo::run(&args),
        Command::Wave(args) => wave::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Reproduce(args) => reproduce::run(&args),
        Command::Range(args) => range::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Stereo(args) => stereo::run(&args),
        Command::Speed(args) => speed::run(&args),
        Command::Timing(args) => timing::run(&args),
        Command::Power(args) => power::run(&args),
        Command::Pareto(args) => pareto::run(&args),
        Command::Sensor(args) => settings::print_sensor(&args),
        Command::Scene(args) => settings::print_scene(&args),
        Command::Export(command) => export::run(&command),
    };
    finish(result.map(|()| ExitCode::SUCCESS))
}

fn finish(result: anyhow::Result<ExitCode>) -> ExitCode {
    match result {
        Ok(status) => status,
        Err(error) if is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            for line in wording::sentence(&error).lines() {
                eprintln!("gdtof: {line}");
            }
            ExitCode::from(if wording::is_bad_input(&error) { 2 } else { 1 })
        }
    }
}

/// The macropixel that an option names as row,col.
///
/// # Errors
/// When it is none of the array.
fn pixel(option: &str, text: &str, sensor: &SensorConfig) -> Result<(usize, usize), InputError> {
    let place = text
        .split_once(',')
        .and_then(|(row, col)| Some((row.trim().parse().ok()?, col.trim().parse().ok()?)));
    let message = match place {
        Some((row, col)) if row < sensor.rows && col < sensor.cols => return Ok((row, col)),
        Some((row, col)) => format!(
            "macropixel ({row}, {col}) is outside the {}x{} array; give rows 0 to {} and columns 0 to {}",
            sensor.rows,
            sensor.cols,
            sensor.rows - 1,
            sensor.cols - 1
        ),
        None => format!("{text:?} is no macropixel; give row,col such as 10,20"),
    };
    Err(InputError::new(option, message))
}

/// Writes to standard output, whose reader may have gone away.
fn say(text: impl std::fmt::Display) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    write!(out, "{text}")?;
    out.flush()
}

/// A reader such as `head` that has seen enough is no failure.
fn is_closed_pipe(error: &anyhow::Error) -> bool {
    let io_error = error.downcast_ref::<std::io::Error>();
    io_error.is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
}
