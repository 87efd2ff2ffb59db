//! The same as `gdtof tb tb_load_path`.

fn main() -> std::process::ExitCode {
    gdtof::cli::testbench(env!("CARGO_BIN_NAME"))
}
