//! The same as `gdtof tb tb_ripple_hazard`.

fn main() -> std::process::ExitCode {
    gdtof::cli::testbench(env!("CARGO_BIN_NAME"))
}
