//! The frame of every testbench: where its waveforms go, its checks printed, its exit status.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser};

use crate::files::{InputError, create_folder};
use crate::report::Checks;

#[derive(Parser)]
struct TestbenchArgs {
    /// Folder for the waveform and its GTKWave save file, made if it is not there.
    #[arg(long, value_name = "DIR", default_value = "waves")]
    out: PathBuf,
}

/// Runs the testbench `name`: `run` fills in the checks and returns the waveform that it wrote into the folder
/// it is given. Exit status 0 when every check holds, 1 when one fails, 2 when a file cannot be written.
pub fn testbench(
    name: &'static str,
    about: &'static str,
    run: impl FnOnce(&Path, &mut Checks) -> Result<PathBuf, InputError>,
) -> ExitCode {
    let command = TestbenchArgs::command().name(name).about(about);
    let args = TestbenchArgs::from_arg_matches(&command.get_matches());
    let args = args.unwrap_or_else(|error| error.exit());
    let mut checks = Checks::new();
    let result = create_folder(&args.out).and_then(|()| run(&args.out, &mut checks));
    match result {
        Ok(vcd) => {
            print!("{checks}");
            println!("waveform: gtkwave {}", vcd.with_extension("gtkw").display());
            checks.exit_code()
        }
        Err(error) => {
            eprintln!("{name}: {error}");
            ExitCode::from(2)
        }
    }
}
