//! Arguments that are paths, of all commands as clap describes them, and words with which their files are opened.

use clap::Arg;

use super::every_command::words;

/// What an argument of a kind is in a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// A file that is read, in the words that name it.
    Input(&'static str),
    /// A folder that is read.
    InputFolder,
    /// A file that is written.
    Output,
    /// A folder that is written.
    OutputFolder,
    /// No file.
    Text,
}

/// Of an argument that is a path or a text; a new one fails here until it is entered.
pub fn role(command: &str, argument: &str) -> Role {
    use Role::*;
    match (command, argument) {
        ("sweep merge", "folders") | ("page", "folder") | ("export frame", "frame") => InputFolder,
        (_, "block") => Input("p_counter="),
        (_, "set") => Input("sensor.liberty="),
        (_, "guide" | "guides") => Input("file:path="),
        (
            "calibrate" | "range" | "replay" | "page" | "wave" | "export sdc" | "export sdf",
            "out",
        ) => Output,
        (_, "out") => OutputFolder,
        (_, "plot" | "vcd" | "saif" | "checks_json" | "save_calibration")
            if command != "sweep" && command != "sweep merge" =>
        {
            Output
        }
        (
            _,
            "sensor" | "chip" | "scene" | "world" | "liberty" | "left" | "right" | "calib"
            | "truth" | "calibration" | "inits" | "events" | "sdf" | "histograms" | "frame"
            | "study" | "detector" | "crosstalk",
        ) => Input(""),
        (
            _,
            "census" | "left_right" | "plots" | "cell" | "windows" | "probe" | "pixel" | "names"
            | "plot" | "only" | "bins",
        ) => Text,
        _ => panic!("enter the argument {argument} of {command} here"),
    }
}

/// What must be given besides an argument, so that its file is opened; `@` stands for the same file.
fn besides(command: &str, argument: &str) -> &'static str {
    match (command, argument) {
        ("frame", "left" | "right" | "calib" | "truth") => "--left @ --right @ --calib @ --truth @",
        ("replay", "vcd" | "saif" | "sdf") => "--engine gate",
        ("replay", "checks_json") => "--engine gate --checks report",
        ("timing", "plot") => "--mismatch 0.05",
        ("range", "calibration") => "",
        ("range", "detector") => "--format counts --histograms counts.csv",
        ("range", "crosstalk") => {
            "--format counts --histograms counts.csv --bin-width-ns 1 --pulse-fwhm-ns 1"
        }
        ("range", "frame") => "--format frame",
        ("export verilog", "sdf" | "inits" | "events") => {
            "--inits inits.csv --events events.csv --rows 1 --cols 2 --stop-periods 100 --laser-cycles 5"
        }
        _ => "",
    }
}

/// The words of a command with `value` for an argument, instead of what it has there.
pub fn words_with(command: &str, argument: &Arg, value: &str) -> Vec<String> {
    let id = argument.get_id().as_str();
    let mut all = words(command);
    // Its other words are not for what was taken.
    if [("reproduce", "liberty"), ("photons", "frame")].contains(&(command, id)) {
        all.truncate(1);
    }
    all.push("--quiet".into());
    let extra = besides(command, id).replace('@', value);
    let option = argument.get_long().map(|long| format!("--{long}"));
    let mut extra: Vec<String> = extra.split_whitespace().map(str::to_owned).collect();
    let named = option.iter().cloned().chain(extra.iter().cloned());
    // An option that is given twice is refused.
    for option in named
        .filter(|word| word.starts_with("--"))
        .collect::<Vec<_>>()
    {
        if let Some(at) = all.iter().position(|word| *word == option) {
            all.drain(at..at + 2);
        }
    }
    let value = match role(command, id) {
        Role::Input(prefix) => format!("{prefix}{value}"),
        _ => value.to_owned(),
    };
    let place = command.split(' ').count() + argument.get_index().map_or(0, |index| index - 1);
    let position = |words: &[String], option: &String| words.iter().position(|word| word == option);
    match option {
        Some(option) => match position(&extra, &option) {
            Some(at) => extra[at + 1] = value,
            None => extra.extend([option, value]),
        },
        // After the command's own words.
        None if all.get(place).is_some_and(|word| !word.starts_with("--")) => all[place] = value,
        None => all.push(value),
    }
    all.extend(extra);
    all
}
