//! The command line. Bad input gives one sentence on standard error and exit status 2. Any other failure gives exit
//! status 1.

mod asked;
mod calibrate;
mod demo;
mod doctor;
mod drive;
mod export;
mod export_frame;
mod foxglove;
mod frame;
mod groups;
mod mapped;
mod page;
mod pareto;
mod photons;
mod power;
mod propose;
mod quality;
mod range;
mod readers;
mod replay;
mod reproduce;
mod sdf;
mod settings;
mod shell;
mod speed;
mod stereo;
mod sweep;
mod tb;
mod timing;
mod usage;
mod voice;
mod wave;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

#[doc(hidden)]
pub use readers::{READERS, Reader};
pub use tb::testbench;

use self::settings::{SceneArgs, SensorArgs};
use crate::engine::EngineError;
use crate::files::{InputError, clean_up_when_interrupted, guard_inputs, said_of_kept_files};
use crate::request::{self, Spelling};
use crate::system::FrameError;

/// Simulate a guided direct time-of-flight lidar chip, from the scene down to gates and flip-flops.
#[derive(Parser)]
#[command(name = "gdtof", version)]
struct Cli {
    /// Number of threads [default: one for each processor].
    #[arg(long, value_name = "N", global = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print only errors and what --json asks for: no table, no progress, no notes.
    #[arg(long, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Take one guided frame of a scene: depth map, histograms, waveform.
    Frame(frame::FrameArgs),
    /// Take frames one after another while the world moves: depth maps, and one recording.
    Drive(drive::DriveArgs),
    /// Repeat an experiment of the thesis's demonstrator, and print whether it finds the target.
    Demo(demo::DemoArgs),
    /// Write the SPAD pulses of a scene for any chip, or of a frame, as CSV, text, memory words, VCD or NumPy.
    Photons(photons::PhotonsArgs),
    /// Run recorded SPAD events through the chip.
    Replay(replay::ReplayArgs),
    /// Compare the thesis's published figures with what the model computes.
    Reproduce(reproduce::ReproduceArgs),
    /// Find depths in histograms: of a frame, of your chip or of a real sensor.
    Range(range::RangeArgs),
    /// Measure the bins of a sensor with delay lines, by sweeping a picosecond laser over them.
    Calibrate(calibrate::CalibrateArgs),
    /// Find the disparities of a rectified pair of pictures, by semi-global matching.
    Stereo(stereo::StereoArgs),
    /// Measure how fast the engines are on this machine, and how much memory they take.
    Speed(speed::SpeedArgs),
    /// Find how fast the chip can be clocked: verdict, ripple, periods, margins.
    Timing(timing::TimingArgs),
    /// Estimate the power of each block of a macropixel, from the toggles of a gate-level run.
    Power(power::PowerArgs),
    /// Make a table of frames, or of theory, over any settings.
    Sweep(sweep::SweepArgs),
    /// Find which chip to build: the best designs that detect and measure a target.
    Propose(propose::ProposeArgs),
    /// Compare run time with error for every engine.
    Pareto(pareto::ParetoArgs),
    /// Print the sensor as a commented file: every key with its unit, range and source.
    Sensor(settings::PrintSensorArgs),
    /// Print the scene as a commented file: every key with its unit, range and source.
    Scene(settings::PrintSceneArgs),
    /// Write one HTML file to look at a frame or a drive: maps, histograms, points in space.
    Page(page::PageArgs),
    /// Write one laser cycle of one macropixel as a waveform, after the frame has been taken.
    Wave(wave::WaveArgs),
    /// Run the testbenches of the chip's blocks.
    Tb(tb::TbArgs),
    /// Write the chip, or a frame, for other tools.
    #[command(subcommand)]
    Export(export::ExportCommand),
    /// Print what the program uses on this machine, and which other tools it found.
    Doctor(doctor::DoctorArgs),
    /// Print the JSON schema of sensor, scene or study files, for editors.
    Schema(shell::SchemaArgs),
    /// Print a script with which your shell completes commands and options.
    Completion(shell::CompletionArgs),
    /// Write manual pages.
    Man(shell::ManArgs),
}

/// Commands and options.
#[doc(hidden)]
pub fn command_line() -> clap::Command {
    fn with_negative_numbers(command: clap::Command) -> clap::Command {
        command
            .mut_args(|argument| {
                if argument.get_action().takes_values() && !argument.is_positional() {
                    argument.allow_negative_numbers(true)
                } else {
                    argument
                }
            })
            .mut_subcommands(with_negative_numbers)
    }
    groups::grouped(with_negative_numbers(Cli::command()))
}

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    guard_inputs();
    if let Err(error) = clean_up_when_interrupted() {
        voice::note(format_args!(
            "signals cannot be watched ({error}); an interrupted run will leave its files"
        ));
    }
    let matches = command_line()
        .try_get_matches()
        .unwrap_or_else(|error| usage::exit_with(&error));
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| usage::exit_with(&error));
    if cli.quiet {
        voice::be_quiet();
    }
    if let Some(threads) = cli.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into());
        if let Err(error) = pool.build_global() {
            return finish(Err(error.into()));
        }
    }
    let result = match cli.command {
        Command::Tb(args) => return finish(tb::run(&args)),
        Command::Frame(args) => frame::run(args),
        Command::Drive(args) => drive::run(args),
        Command::Demo(args) => demo::run(&args),
        Command::Page(args) => page::run(&args),
        Command::Wave(args) => wave::run(&args),
        Command::Photons(args) => photons::run(args),
        Command::Replay(args) => replay::run(&args),
        Command::Reproduce(args) => reproduce::run(&args),
        Command::Range(args) => range::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Stereo(args) => stereo::run(&args),
        Command::Speed(args) => speed::run(&args),
        Command::Timing(args) => timing::run(&args),
        Command::Power(args) => power::run(&args),
        Command::Sweep(args) => sweep::run(&args),
        Command::Propose(args) => propose::run(&args),
        Command::Pareto(args) => pareto::run(&args),
        Command::Sensor(args) => settings::print_sensor(args),
        Command::Scene(args) => settings::print_scene(args),
        Command::Export(command) => export::run(&command),
        Command::Doctor(args) => doctor::run(&args),
        Command::Schema(args) => shell::schema(&args),
        Command::Completion(args) => shell::completion(&args, Cli::command()),
        Command::Man(args) => shell::man(&args, Cli::command()),
    };
    finish(result.map(|()| ExitCode::SUCCESS))
}

fn finish(result: anyhow::Result<ExitCode>) -> ExitCode {
    voice::notes(said_of_kept_files());
    match result {
        Ok(status) => status,
        Err(error) if is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            voice::complain(sentence(&error));
            ExitCode::from(if is_bad_input(&error) { 2 } else { 1 })
        }
    }
}

/// A reader such as `head` that has seen enough is no failure.
fn is_closed_pipe(error: &anyhow::Error) -> bool {
    let io_error = error.downcast_ref::<std::io::Error>();
    io_error.is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
}

/// The sentence for standard error.
fn sentence(error: &anyhow::Error) -> String {
    if let Some(error) = error.downcast_ref::<EngineError>() {
        return request::of_engine(error, Spelling::Options);
    }
    match error.downcast_ref::<FrameError>() {
        Some(error) => request::sentence(error, Spelling::Options),
        None => format!("{error:#}"),
    }
}

/// Whether the user can mend it.
fn is_bad_input(error: &anyhow::Error) -> bool {
    error.is::<InputError>()
        || matches!(error.downcast_ref::<EngineError>(), Some(e) if e.is_refusal())
        || matches!(error.downcast_ref::<FrameError>(), Some(e) if request::is_bad_input(e))
}
