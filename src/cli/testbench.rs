//! The frame of every testbench: where its waveforms go, its checks printed, its exit status.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser};

use crate::files::{InputError, clean_up_when_interrupted, create_folder};
use crate::report::Checks;
use crate::waves::WaveFormat;

#[derive(Parser)]
struct TestbenchArgs {
    /// Folder for the waveform and its views for GTKWave and Surfer, made if it is not there.
    #[arg(long, value_name = "DIR", default_value = "waves")]
    out: PathBuf,
    /// Format of the waveform.
    #[arg(long, value_enum, default_value_t)]
    wave_format: WaveFormat,
}

/// Runs the testbench `name`: `run` fills in the checks and writes the waveform that it is given the path of. Exit status 0 when every check holds, 1 when one fails, 2 when a file cannot be written.
pub fn testbench(
    name: &'static str,
    about: &'static str,
    run: impl FnOnce(&Path, &mut Checks) -> Result<(), InputError>,
) -> ExitCode {
    let command = TestbenchArgs::command().name(name).about(about);
    let args = TestbenchArgs::from_arg_matches(&command.get_matches());
    let args = args.unwrap_or_else(|error| error.exit());
    let waves = format!("{name}.{}", args.wave_format.extension());
    let waves = args.out.join(waves);
    let mut checks = Checks::new();
    if let Err(error) = clean_up_when_interrupted() {
        eprintln!("{name}: signals cannot be watched ({error})");
    }
    let result = create_folder(&args.out).and_then(|()| run(&waves, &mut checks));
    match result {
        Ok(()) => {
            print!("{checks}");
            println!(
                "waveform: gtkwave {}",
                waves.with_extension("gtkw").display()
            );
            checks.exit_code()
        }
        Err(error) => {
            eprintln!("{name}: {error}");
            ExitCode::from(2)
        }
    }
}
