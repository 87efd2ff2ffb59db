//! What commands leave behind: results of good runs in both formats, earlier results after bad ones.

use guided_dtof::files::NpyHead;
use std::process::Command;

use super::{folder, gdtof, replay, with_value};

#[test]
fn an_existing_result_survives_a_failed_run() {
    let folder = folder();
    let out = folder.path().join("h.csv");
    std::fs::write(&out, "precious").unwrap();
    let arguments = with_value(&replay(&["--out", "h.csv"]), "--events", "early.csv");
    assert_eq!(gdtof(folder.path(), &arguments).status.code(), Some(2));
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "precious");
}

#[test]
fn all_engines_give_the_same_histograms_in_both_formats() {
    let folder = folder();
    let mut texts = Vec::new();
    for engine in ["gate", "cycle", "window"] {
        let output = gdtof(folder.path(), &replay(&["--engine", engine]));
        assert!(output.status.success(), "{output:?}");
        texts.push(String::from_utf8(output.stdout).unwrap());
        let npy = format!("{engine}.npy");
        let output = gdtof(folder.path(), &replay(&["--engine", engine, "--out", &npy]));
        assert!(
            output.status.success() && output.stdout.is_empty(),
            "{output:?}"
        );
    }
    assert!(
        texts[0].lines().any(|l| l.ends_with(",1")),
        "nothing was counted"
    );
    assert!(texts.iter().all(|t| *t == texts[0]));
    let bytes = |engine: &str| std::fs::read(folder.path().join(format!("{engine}.npy"))).unwrap();
    assert_eq!(bytes("gate"), bytes("cycle"));
    assert_eq!(bytes("gate"), bytes("window"));
    let gate = bytes("gate");
    let head = NpyHead::read(&mut &gate[..]).unwrap();
    assert_eq!(head.shape, [1, 2, 16]);
}

/// A reader that stops early, such as `head`, ends the command quietly.
#[test]
fn a_closed_pipe_is_no_crash() {
    let folder = folder();
    let mut child = Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args(replay(&[]))
        .current_dir(folder.path())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(
        output.stderr.is_empty(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(output.status.success());
}
