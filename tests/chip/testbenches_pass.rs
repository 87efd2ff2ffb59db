//! Every testbench passes, and leaves a waveform that a viewer can read and a save file beside it.

use std::process::Command;

use guided_dtof::chip::Probe;

fn passes(name: &str, program: &str, signal: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("waves");
    let run = Command::new(program).arg("--out").arg(&out).output();
    let run = run.unwrap();
    let text = String::from_utf8(run.stdout).unwrap();
    assert!(run.status.success(), "{name}:\n{text}");
    assert!(text.contains(" checked, 0 failed"), "{name}:\n{text}");

    let waves = wellen::simple::read(out.join(format!("{name}.vcd"))).unwrap();
    let (last, scopes) = signal.split_last().unwrap();
    let signal = waves.hierarchy().lookup_var(scopes, last);
    assert!(signal.is_some(), "{name} has no {last}");
    assert!(waves.time_table().len() > 100);
    let view = std::fs::read_to_string(out.join(format!("{name}.gtkw"))).unwrap();
    assert!(view.contains(&format!("[dumpfile] \"{name}.vcd\"")));
    // The views in the repository are those that the testbenches write.
    let kept = concat!(env!("CARGO_MANIFEST_DIR"), "/waves");
    let kept = std::fs::read_to_string(format!("{kept}/{name}.gtkw")).unwrap();
    assert_eq!(
        view, kept,
        "{name}: run it in the repository to renew its view"
    );
}

#[test]
fn the_p_counter_and_its_timing_block() {
    let signal = ["tb_p_counter", "p_counter", "LOCAL_STOP"];
    passes("tb_p_counter", env!("CARGO_BIN_EXE_tb_p_counter"), &signal);
}

#[test]
fn the_variants_of_the_p_counter() {
    let count = Probe::CounterOut.name();
    let signal = ["tb_p_counter_variants", "msb_wrap", "p_counter", count];
    passes(
        "tb_p_counter_variants",
        env!("CARGO_BIN_EXE_tb_p_counter_variants"),
        &signal,
    );
}

#[test]
fn the_load_path() {
    let signal = ["load_path", "row_scanner", "MEMORY_LOAD"];
    passes("tb_load_path", env!("CARGO_BIN_EXE_tb_load_path"), &signal);
}

#[test]
fn the_macropixel() {
    let signal = ["quantic4x4", "mp_r0_c1", "LOCAL_STOP"];
    passes(
        "tb_macropixel",
        env!("CARGO_BIN_EXE_tb_macropixel"),
        &signal,
    );
}

#[test]
fn the_ripple_hazard() {
    let signal = ["quantic4x4", "mp_r0_c1", "LOCAL_STOP"];
    passes(
        "tb_ripple_hazard",
        env!("CARGO_BIN_EXE_tb_ripple_hazard"),
        &signal,
    );
}

#[test]
fn a_folder_that_cannot_be_made_is_one_sentence_and_exit_status_2() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let program = env!("CARGO_BIN_EXE_tb_macropixel");
    let run = Command::new(program).arg("--out").arg(file.path()).output();
    let run = run.unwrap();
    assert_eq!(run.status.code(), Some(2));
    assert_eq!(String::from_utf8(run.stderr).unwrap().lines().count(), 1);
}
