//! The same as `gdtof tb tb_tdc`.

fn main() -> std::process::ExitCode {
    guided_dtof::cli::testbench(env!("CARGO_BIN_NAME"))
}
