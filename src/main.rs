//! `gdtof`: the command line of guided-dtof.

use std::process::ExitCode;

fn main() -> ExitCode {
    gdtof::cli::main()
}
