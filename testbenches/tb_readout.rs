//! The same as `gdtof tb tb_readout`.

fn main() -> std::process::ExitCode {
    gdtof::cli::testbench(env!("CARGO_BIN_NAME"))
}
