//! Words and numbers at and beyond their limits, for every argument that is not a file: one sentence, with what to give instead.

use std::collections::BTreeMap;
use std::process::Output;
use std::time::Duration;

use clap::Arg;

use super::every_command::{commands, is_text, within, words, workplace};
use super::every_path::{Role, role};
use super::tools::{gdtof, takes_all};

/// Far longer than a refusal, or what a value makes of a small run.
const LIMIT: Duration = Duration::from_secs(100);

/// No argument takes these, whatever it is.
const NEVER: [&str; 10] = [
    "", " ", "nan", "1e999", "漢é", "a\nb", "=", "1 000", "0x10", "１",
];

/// Of these, what is tried where a number belongs. Not a number and infinity are numbers to some readers.
const FOR_NUMBERS: [&str; 3] = ["", "nan", "1e999"];

/// Some do.
const SOMETIMES: [&str; 9] = [
    "-1",
    "0",
    "-0",
    "1e4",
    "1e-320",
    "1,2",
    ":",
    "99999999999999999999",
    "\u{1b}[2J",
];

/// Texts that may be empty: nothing is set.
const MAY_BE_EMPTY: [&str; 1] = ["windows"];

/// The words of a command with `value` for an argument that is no file.
fn with_word(command: &str, argument: &Arg, value: &str) -> Vec<String> {
    let mut all = words(command);
    match argument.get_long() {
        Some(long) => {
            let option = format!("--{long}");
            if let Some(at) = all.iter().position(|word| *word == option) {
                all.drain(at..at + 2);
            }
            all.push(format!("{option}={value}"));
        }
        None => {
            let place = command.split(' ').count() + argument.get_index().unwrap_or(1) - 1;
            all.truncate(place);
            all.push(value.to_owned());
        }
    }
    all.push("--quiet".into());
    all
}

/// What is wrong with a refusal, if anything.
fn flaw(run: &Output) -> Option<&'static str> {
    let error = String::from_utf8_lossy(&run.stderr);
    let foreign = [
        "invalid digit",
        "invalid float",
        "os error",
        "panicked",
        "expected",
    ];
    if run.status.code() != Some(2) {
        Some("another status")
    } else if error.trim_end_matches('\n').chars().any(char::is_control) {
        Some("more than a line")
    } else if foreign.iter().any(|word| error.contains(word)) {
        Some("words of a library")
    } else if !error.starts_with("gdtof: ") {
        Some("not in our form")
    } else if !error.contains("; ") {
        Some("nothing to do about it")
    } else {
        (error.chars().count() > 540).then_some("too long")
    }
}

/// An argument of several commands is read by the same lines in each, so it is tried with half of the values in one, and with one in each
/// other. Each night all values are tried.
#[test]
fn every_word_and_number_is_refused_with_what_to_give_instead() {
    let dir = workplace();
    let here = dir.path();
    let long = ["x".repeat(20_000), "x ".repeat(10_000), "9".repeat(20_000)];
    let never: Vec<&str> = NEVER.into_iter().chain(long.iter().map(|s| &**s)).collect();
    let (mut tried, mut faults) = (0, Vec::new());
    let mut known: BTreeMap<String, usize> = BTreeMap::new();
    for (command, arguments) in commands() {
        let is_word = |argument: &&Arg| {
            let id = argument.get_id().as_str();
            argument.get_action().takes_values()
                && id != "threads"
                && (!is_text(argument)
                    || role(&command, id) == Role::Text
                    || ["guide", "guides", "set", "block"].contains(&id))
        };
        for argument in arguments.iter().filter(is_word) {
            let id = argument.get_id().as_str();
            let known_before = known.len();
            let seen = known.entry(id.to_owned()).or_default();
            // All numbers are read by the same lines, which are tried with a few of what no argument takes.
            let is_number = !is_text(argument) && argument.get_possible_values().is_empty();
            let never = never
                .iter()
                .filter(|value| !is_number || FOR_NUMBERS.contains(value));
            // A demo whose words are right takes a minute.
            let sometimes = SOMETIMES.iter().filter(|_| command != "demo");
            let values = never.map(|value| (*value, false));
            let values: Vec<_> = values
                .chain(sometimes.map(|value| (*value, true)))
                .collect();
            let apart = if takes_all() { 1 } else { 2 };
            let count = if *seen == 0 {
                values.len().div_ceil(apart)
            } else {
                1
            };
            // Arguments begin in turn with the first and the second value.
            let first = *seen + known_before % apart;
            for number in 0..count {
                let (value, may_be) = values[(first + apart * number) % values.len()];
                let may_be = may_be || value.trim().is_empty() && MAY_BE_EMPTY.contains(&id);
                let words = with_word(&command, argument, value);
                let run = within(here, &words, LIMIT);
                tried += 1;
                if may_be && run.status.success() {
                    continue;
                }
                if let Some(flaw) = flaw(&run) {
                    let error = String::from_utf8_lossy(&run.stderr);
                    let error: String = error.chars().take(300).collect();
                    let value: String = value.chars().take(20).collect();
                    faults.push(format!(
                        "{command} {id} {value:?}: {flaw}: {:?} {error:?}",
                        run.status.code()
                    ));
                }
            }
            *seen += 1;
        }
    }
    assert!(
        faults.is_empty(),
        "{} of {tried}:\n{}",
        faults.len(),
        faults.join("\n")
    );
    let least = if takes_all() { 800 } else { 450 };
    assert!(tried > least && known.len() > 50, "{tried} {}", known.len());
}

#[test]
fn what_is_no_command_and_no_option_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let long = "x".repeat(20_000);
    for (words, says) in [
        (
            &["fram"][..],
            "gdtof: fram: is not a command; did you mean `frame`?",
        ),
        // Several names are like it, and one is more so.
        (
            &["scen"],
            "gdtof: scen: is not a command; did you mean `scene`?",
        ),
        (
            &["frame", "--lasercycles", "3"],
            "--lasercycles: is unknown here; did you mean `--laser-cycles`?",
        ),
        (
            &["frame", "--engine", "windw"],
            "--engine windw: is unknown; did you mean `window`?",
        ),
        (
            &["frame", "--engine", ""],
            "--engine: has no value; give gate, cycle, window or cohort",
        ),
        (
            &["frame", "--engine"],
            "--engine: has no value; give gate, cycle, window or cohort",
        ),
        (&["frame", "--rows"], "--rows: has no value; give one"),
        (
            &["frame", "--seed", "1", "--seed", "2"],
            "--seed: is given twice; leave one of them out",
        ),
        (
            &["frame", "--cell", "DFFR=x"],
            "--liberty: is needed; give it, as `--help` says",
        ),
        (
            &["wave"],
            "--pixel, --cycle: are needed; give them, as `--help` says",
        ),
        (&["demo"], "gdtof: DEMO: is needed; give it"),
        (
            &["schema", "sensors"],
            "gdtof: FILE sensors: is unknown; did you mean `sensor`?",
        ),
        (&["frame", "street", "van"], "van: is unknown here; "),
        (
            &["frame", "--wave-cycles", "many"],
            "--wave-cycles many: is not a number of laser cycles; give one, or all",
        ),
        (
            &["timing", "--process", "quick"],
            "--process quick: is not a speed of silicon; give slow, typ or fast",
        ),
        (
            &["sweep", "x.toml", "--shard", "4/3"],
            "--shard 4/3: is not a part of a study; ",
        ),
        (
            &["sensor", "--threads", "0"],
            "--threads 0: is impossible; give 1 to 1024",
        ),
        (&["sensor", "--threads", "-0"], "--threads -0: "),
        (
            &["sensor", "--threads", ""],
            "--threads: has no value; give one",
        ),
        (
            &["frame", "--rows", "-0"],
            "--rows -0: is not written as a whole number; give 0",
        ),
        (&[&long], "is not a command; "),
        (&["frame", &format!("--{long}")], "is unknown here; "),
        (&["frame", "a\u{1b}[2Jb"], "a\\u{1b}[2Jb: "),
    ] {
        let run = gdtof(dir.path(), words);
        let error = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(error.contains(says), "{words:?}: {error}");
        assert_eq!(flaw(&run), None, "{error}");
    }
    for words in [&[][..], &["frame", "--help"], &["--version"]] {
        let run = gdtof(dir.path(), words);
        assert_eq!(
            run.status.code(),
            Some(if words.is_empty() { 2 } else { 0 })
        );
    }
}
