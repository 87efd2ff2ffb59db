//! The same as `gdtof tb tb_front_ends`.

fn main() -> std::process::ExitCode {
    gdtof::cli::testbench(env!("CARGO_BIN_NAME"))
}
