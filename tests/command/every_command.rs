//! All commands as clap describes them, with arguments that let each run in little time: a new command or option fails the
//! tests that use this until it is entered here.

use std::any::TypeId;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use clap::Arg;

/// Commands, the words after each that let it run in a folder made by [`workplace`], and whether its standard output is a file's text.
pub const RUNS: &[(&str, &str, bool)] = &[
    (
        "frame",
        "--rows 2 --cols 2 --laser-cycles 2 --probe none",
        false,
    ),
    (
        "drive",
        "--rows 2 --cols 2 --laser-cycles 2 --frames 1",
        false,
    ),
    ("photons", "--rows 2 --cols 2 --laser-cycles 2", false),
    (
        "demo",
        "glass --calibration-step-ps 200 --laser-cycles 100",
        false,
    ),
    (
        "replay",
        "--rows 1 --cols 2 --inits inits.csv --events events.csv --stop-periods 100 --laser-cycles 5",
        true,
    ),
    ("reproduce", "--claim 1", false),
    (
        "range",
        "--format tmf8820 --histograms captures.json",
        false,
    ),
    (
        "calibrate",
        "--sensor hslidar_delay_line --rows 1 --cols 1 --step-ps 200 --out profile.json",
        false,
    ),
    ("stereo", "picture.png picture.png --disparities 4", false),
    ("speed", "--runs 1 --largest 1", false),
    ("timing", "--rows 1 --cols 1", false),
    (
        "power",
        "--rows 1 --cols 1 --laser-cycles 1 --stop-periods 600",
        false,
    ),
    ("sweep", "study.toml", false),
    ("sweep merge", "swept", false),
    (
        "propose",
        "--range 20 --reflectivity 0.5 --klux 1 --fps 10 --bins 16 --clk 384 --thresholds 0 --guide-sigma 0.3",
        false,
    ),
    (
        "pareto",
        "--ranges 20 --macropixels 1 --repeats 1 --laser-cycles 2",
        false,
    ),
    ("sensor", "", true),
    ("scene", "", true),
    ("page", "taken", false),
    (
        "wave",
        "--frame taken/frame.json --pixel 0,0 --cycle 0",
        false,
    ),
    ("tb", "front_ends", false),
    ("export verilog", "--rows 1 --cols 1 --out verilog", false),
    (
        "export sdc",
        "--rows 1 --cols 1 --liberty example.lib --out a.sdc",
        false,
    ),
    ("export sdf", "--rows 1 --cols 1 --out a.sdf", false),
    ("export frame", "taken", false),
    ("doctor", "", false),
    ("schema", "sensor", true),
    ("completion", "bash", true),
    ("man", "", false),
];

/// A folder with what [`RUNS`] read.
pub fn workplace() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let vectors = Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors");
    let copy = |from: &str, to: &str| std::fs::copy(vectors.join(from), here.join(to)).unwrap();
    copy("range/captures.json", "captures.json");
    copy("range/counts.csv", "counts.csv");
    copy("liberty/example.lib", "example.lib");
    let write = |name: &str, text: &str| std::fs::write(here.join(name), text).unwrap();
    write("inits.csv", "row,col,init\n0,0,20\n0,1,30\n");
    write("events.csv", "time_fs,row,col,spad\n20000000,0,0,3\n");
    write(
        "study.toml",
        "[study]\nkind = \"theory\"\n[vary]\ntheory.laser_cycles = [100, 200]\n",
    );
    let file = std::fs::File::create(here.join("picture.png")).unwrap();
    let mut picture = png::Encoder::new(file, 32, 32);
    picture.set_color(png::ColorType::Grayscale);
    let grey: Vec<u8> = (0..32 * 32).map(|at| (at * at % 251) as u8).collect();
    let mut picture = picture.write_header().unwrap();
    picture.write_image_data(&grey).unwrap();
    picture.finish().unwrap();
    for words in [
        "sweep study.toml --out swept",
        "frame --rows 2 --cols 2 --laser-cycles 2 --probe none --out taken",
    ] {
        let words: Vec<&str> = words.split(' ').collect();
        let made = within(here, &words, Duration::from_secs(120));
        assert!(made.status.success(), "{made:?}");
    }
    dir
}

/// Commands that do something, by their names, with their arguments.
pub fn commands() -> Vec<(String, Vec<Arg>)> {
    fn add(command: &clap::Command, path: &str, to: &mut Vec<(String, Vec<Arg>)>) {
        let children: Vec<_> = command
            .get_subcommands()
            .filter(|c| c.get_name() != "help")
            .collect();
        if children.is_empty() || !command.is_subcommand_required_set() {
            let arguments = command.get_arguments().cloned().collect();
            to.push((path.to_owned(), arguments));
        }
        for child in children {
            let path = format!("{path} {}", child.get_name());
            add(child, path.trim(), to);
        }
    }
    let mut program = gdtof::cli::command_line();
    program.build();
    let mut commands = Vec::new();
    for child in program.get_subcommands().filter(|c| c.get_name() != "help") {
        add(child, child.get_name(), &mut commands);
    }
    commands
}

/// The words with which a command runs.
pub fn words(command: &str) -> Vec<String> {
    let run = RUNS.iter().find(|(name, ..)| *name == command);
    let (_, words, _) = run.unwrap_or_else(|| panic!("enter {command} in RUNS"));
    let words = format!("{command} {words}");
    words.split_whitespace().map(str::to_owned).collect()
}

/// Whether an argument's value is a file, a folder or a text, which may name a file.
pub fn is_text(argument: &Arg) -> bool {
    let kind = argument.get_value_parser().type_id();
    let takes_value = argument.get_action().takes_values();
    takes_value
        && [TypeId::of::<PathBuf>(), TypeId::of::<String>()]
            .into_iter()
            .any(|known| kind == known)
}

/// Runs it to its end, which must come in time.
pub fn within(folder: &Path, words: &[impl AsRef<str>], limit: Duration) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args(words.iter().map(AsRef::as_ref))
        .args(["--threads", "1"])
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Pipes are emptied meanwhile, or a long text would wait for its reader.
    let mut streams: [Box<dyn std::io::Read + Send>; 2] = [
        Box::new(child.stdout.take().unwrap()),
        Box::new(child.stderr.take().unwrap()),
    ];
    let [stdout, stderr] = std::thread::scope(|scope| {
        let readers = streams.each_mut().map(|stream| {
            scope.spawn(move || {
                let mut bytes = Vec::new();
                stream.read_to_end(&mut bytes).unwrap();
                bytes
            })
        });
        let begun = Instant::now();
        while child.try_wait().unwrap().is_none() {
            if begun.elapsed() > limit {
                child.kill().unwrap();
                let words: Vec<&str> = words.iter().map(AsRef::as_ref).collect();
                panic!("{words:?} does not end");
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        readers.map(|reader| reader.join().unwrap())
    });
    Output {
        status: child.wait().unwrap(),
        stdout,
        stderr,
    }
}

#[test]
fn every_command_is_entered() {
    let commands = commands();
    for (name, _) in &commands {
        words(name);
    }
    assert_eq!(commands.len(), RUNS.len());
}
