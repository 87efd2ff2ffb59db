//! `gdtof doctor`, `schema`, `completion` and `man`, and `--quiet` and `--threads`.

use std::process::Output;

use super::tools::gdtof_words;

fn said(output: Output) -> String {
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

const SMALL: &str =
    "frame --rows 2 --cols 2 --probe none --laser-cycles 20 --set scene.lidar.pulse_energy_uj=0.1";

#[test]
fn a_quiet_run_writes_its_files_and_says_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let quiet = gdtof_words(folder, &format!("{SMALL} --quiet"));
    assert!(quiet.status.success());
    assert_eq!(
        (quiet.stdout.len(), quiet.stderr.len()),
        (0, 0),
        "{quiet:?}"
    );
    assert!(folder.join("out/frame.json").exists());
    let json = said(gdtof_words(folder, &format!("--quiet {SMALL} --json")));
    assert!(serde_json::from_str::<serde_json::Value>(&json).is_ok());
    let refused = gdtof_words(folder, &format!("{SMALL} --quiet --seed x"));
    assert_eq!(refused.status.code(), Some(2));
    assert!(!refused.stderr.is_empty());
}

#[test]
fn threads_are_as_many_as_asked_for_and_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let doctor = said(gdtof_words(folder, "doctor --threads 3 --json"));
    let doctor: serde_json::Value = serde_json::from_str(&doctor).unwrap();
    assert_eq!(doctor["threads"], 3);
    assert_eq!(doctor["version"], env!("CARGO_PKG_VERSION"));
    let tools = doctor["tools"].as_array().unwrap();
    assert!(tools.iter().any(|tool| tool["name"] == "iverilog"));
    for threads in ["1", "3"] {
        said(gdtof_words(
            folder,
            &format!("{SMALL} --threads {threads} --out {threads}"),
        ));
    }
    let counts = |name: &str| std::fs::read(folder.join(name).join("histograms.npy")).unwrap();
    assert_eq!(counts("1"), counts("3"));
    assert_eq!(
        gdtof_words(folder, "doctor --threads 0").status.code(),
        Some(2)
    );
}

/// Keys and limits that a schema has: those of the file that the same program prints.
#[test]
fn schemas_have_every_key_of_the_printed_files() {
    let folder = tempfile::tempdir().unwrap();
    let read = |what: &str| -> (toml::Table, serde_json::Value) {
        let schema = said(gdtof_words(folder.path(), &format!("schema {what}")));
        let file = said(gdtof_words(folder.path(), what));
        (
            toml::from_str(&file).unwrap(),
            serde_json::from_str(&schema).unwrap(),
        )
    };
    let (sensor, schema) = read("sensor");
    for key in sensor.keys() {
        assert!(
            schema["properties"][key]["description"].is_string(),
            "{key}"
        );
    }
    assert_eq!(schema["additionalProperties"], false);
    assert_eq!(schema["properties"]["rows"]["anyOf"][0]["maximum"], 256.0);
    assert_eq!(schema["properties"]["front_end"]["enum"][0], "summation");

    let (scene, schema) = read("scene");
    for (section, values) in &scene {
        let of = &schema["properties"][section];
        let (of, values) = match values {
            toml::Value::Array(items) => (&of["items"], items[0].as_table().unwrap()),
            other => (of, other.as_table().unwrap()),
        };
        for key in values.keys() {
            assert!(of["properties"][key].is_object(), "{section}.{key}");
        }
    }
}

#[test]
fn shells_and_manuals_know_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let help = said(gdtof_words(folder, "--help"));
    let commands = help.split("<COMMAND>").nth(1).unwrap();
    let commands = commands.split("Options:").next().unwrap().lines();
    let commands: Vec<&str> = commands
        .filter_map(|line| line.strip_prefix("  ")?.split(' ').next())
        .filter(|name| !name.is_empty() && *name != "help")
        .collect();
    assert!(
        commands.contains(&"frame") && commands.contains(&"doctor"),
        "{commands:?}"
    );
    let script = said(gdtof_words(folder, "completion bash"));
    said(gdtof_words(folder, "man --out pages"));
    for name in commands {
        assert!(script.contains(&format!("gdtof__subcmd__{name}")), "{name}");
        let page = folder.join(format!("pages/gdtof-{name}.1"));
        let page = std::fs::read_to_string(page).unwrap();
        assert!(page.contains(".SH SYNOPSIS"), "{name}");
    }
    assert!(folder.join("pages/gdtof-export-verilog.1").exists());
    for shell in ["zsh", "fish", "powershell", "elvish"] {
        assert!(
            said(gdtof_words(folder, &format!("completion {shell}"))).contains("--laser-cycles")
                || shell == "fish"
        );
    }
}
