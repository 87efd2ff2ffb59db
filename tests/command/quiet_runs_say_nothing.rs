//! `--quiet`: errors, and what a program or a file takes, of all commands.

use std::time::Duration;

use super::every_command::{RUNS, commands, within, words, workplace};

const LIMIT: Duration = Duration::from_secs(600);

#[test]
fn a_quiet_command_prints_no_table_and_no_note() {
    let dir = workplace();
    let here = dir.path();
    for (command, is_file, has_json) in RUNS.iter().map(|(name, _, is_file)| {
        let commands = commands();
        let (_, arguments) = commands.iter().find(|(known, _)| known == name).unwrap();
        let has_json = arguments
            .iter()
            .any(|argument| argument.get_long() == Some("json"));
        (*name, *is_file, has_json)
    }) {
        // It times engines for minutes, and a demo for seconds.
        if command == "speed" || command == "demo" {
            continue;
        }
        let mut words = words(command);
        words.push("--quiet".into());
        let quiet = within(here, &words, LIMIT);
        assert!(quiet.status.success(), "{words:?}: {quiet:?}");
        let said = String::from_utf8_lossy(&quiet.stdout);
        assert_eq!(said.is_empty(), !is_file, "{words:?}: {said}");
        let noted = String::from_utf8_lossy(&quiet.stderr);
        assert!(noted.is_empty(), "{words:?}: {noted}");
        if has_json && command != "replay" {
            words.push("--json".into());
            let json = within(here, &words, LIMIT);
            let json: Result<serde_json::Value, _> = serde_json::from_slice(&json.stdout);
            assert!(json.is_ok(), "{words:?}");
        }
    }
}
