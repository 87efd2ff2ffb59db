//! Every reader of files that users give, by name, as the fuzzer (`fuzz`) and the test of the inputs that it kept (`vectors/fuzz`) call them.

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use toml::Table;

use super::frame::calibration;
use crate::chip::{Exposure, SensorConfig, Silicon, hslidar_delay_line, macropixel};
use crate::files::{
    InputError, Journal, JournalReader, MANIFEST, Raster, ResultSet, journal_line, parse_json,
    read_counts, read_text, write_npy,
};
use crate::guide::options;
use crate::liberty::Liberty;
use crate::netlist::{Module, Netlist, Timing};
use crate::page::Page;
use crate::ranging::{Calibration, tmf8820};
use crate::request::read_calibration;
use crate::scene::{Mesh, Scene};
use crate::sdf::{Sdf, annotate, suspect_delays};
use crate::settings::{Assignment, Document};
use crate::stimulus::recording::{read_events, read_starts};
use crate::sweep::{Study, study_of};
use crate::system::WindowPolicy;

/// Reads a file, which it may change, and says what is wrong with it. Other files in its folder may be made.
pub type Reader = fn(&Path) -> Result<(), String>;

/// Of one macropixel, so that files are short.
static SENSOR: LazyLock<SensorConfig> = LazyLock::new(|| SensorConfig {
    rows: 1,
    cols: 1,
    ..SensorConfig::default()
});

/// The same with delay lines, whose bins are measured.
static DELAY_LINES: LazyLock<SensorConfig> = LazyLock::new(|| SensorConfig {
    rows: 1,
    cols: 1,
    ..SensorConfig::clone(&hslidar_delay_line())
});

/// A macropixel and its delays.
static MACROPIXEL: LazyLock<(Netlist, Timing)> = LazyLock::new(|| {
    let netlist = Netlist::elaborate(&macropixel::circuit(&SENSOR));
    let timing = Silicon::new(&SENSOR).timing(&netlist);
    (netlist, timing)
});

/// The readers; the corpus of each is the folder of its name.
pub const READERS: &[(&str, Reader)] = &[
    ("sensor", |path| {
        error_text(SensorConfig::read_document(&document(path)?))
    }),
    ("scene", |path| error_text(Scene::read(&document(path)?))),
    ("study", |path| error_text(Study::load(path))),
    ("kept_study", |path| {
        read_in_folder(path, "study.json", study_of)
    }),
    ("options", read_options),
    ("starts", |path| error_text(read_starts(path, &SENSOR))),
    ("events", |path| {
        let exposure = Exposure::new(&SENSOR, 100, 10);
        error_text(read_events(path, &SENSOR, &exposure))
    }),
    ("curve", |path| {
        let (mut scene, csv) = (
            Document::from_table("curve", Table::new()),
            path.with_extension("csv"),
        );
        fs::copy(path, &csv).expect("a file of ours");
        let file = csv.display().to_string();
        assign(&mut scene, Assignment::new("lidar.pulse", file, "--set"))?;
        error_text(Scene::read(&scene))
    }),
    ("sdf", |path| {
        let text = text(path)?;
        let sdf = Sdf::parse("SDF", &text).map_err(|e| e.to_string())?;
        let (netlist, timing) = &*MACROPIXEL;
        suspect_delays(&sdf, SENSOR.corner);
        error_text(annotate(&mut timing.clone(), netlist, &sdf, SENSOR.corner))
    }),
    ("liberty", |path| {
        error_text(Liberty::read(&text(path)?, &[]))
    }),
    ("yosys", |path| {
        let module = Module::from_yosys(&text(path)?, None);
        error_text(module.map(|module| Netlist::elaborate(&module)))
    }),
    ("block", |path| {
        let file = path.display().to_string().into();
        let table = Table::from_iter([("p_counter_block".to_owned(), file)]);
        error_text(SensorConfig::read_document(&Document::from_table(
            "block", table,
        )))
    }),
    ("captures", |path| error_text(tmf8820::read(path))),
    ("zones", |path| {
        error_text(parse_json::<Calibration>("zones", &text(path)?, "zones"))
    }),
    ("bin_profile", |path| {
        error_text(read_calibration(path, &DELAY_LINES))
    }),
    ("pair", |path| {
        error_text(calibration::read_calibration(path))
    }),
    ("frame", |path| {
        read_in_folder(path, "frame.json", |folder| {
            let mut counts = Vec::new();
            write_npy(&mut counts, &[1, 1, 16], &[1u16; 16]).expect("it is in memory");
            fs::write(folder.join("histograms.npy"), counts).expect("a folder of ours");
            Page::read(folder, folder, 1)
        })
    }),
    ("counts", |path| error_text(read_counts(path, &[1, 1, 16]))),
    ("npy", |path| error_text(Raster::read(path))),
    ("png", |path| error_text(Raster::read(path))),
    ("pfm", |path| error_text(Raster::read(path))),
    ("exr", |path| error_text(Raster::read(path))),
    ("obj", |path| error_text(Mesh::read(path))),
    ("journal", read_journal),
    ("manifest", |path| {
        read_in_folder(path, MANIFEST, |folder| {
            let set = ResultSet::begin(folder, "frame")?;
            fs::write(set.staging().join("result"), "new").expect("a folder of ours");
            set.commit(())
        })
    }),
];

fn assign(
    document: &mut Document,
    assignment: Result<Assignment, InputError>,
) -> Result<(), String> {
    error_text(assignment.and_then(|assignment| document.assign(&assignment)))
}

fn error_text<T, E: ToString>(read: Result<T, E>) -> Result<(), String> {
    read.map(drop).map_err(|error| error.to_string())
}

fn text(path: &Path) -> Result<String, String> {
    read_text(path).map_err(|error| error.to_string())
}

fn document(path: &Path) -> Result<Document, String> {
    Document::load(path).map_err(|error| error.to_string())
}

/// What reads a file by its folder reads it in one of its own.
fn read_in_folder<T, E: ToString>(
    path: &Path,
    name: &str,
    read: impl FnOnce(&Path) -> Result<T, E>,
) -> Result<(), String> {
    let folder = path.with_extension("folder");
    fs::create_dir_all(&folder).expect("a folder of ours");
    fs::copy(path, folder.join(name)).expect("a file of ours");
    let read = error_text(read(&folder));
    fs::remove_dir_all(&folder).expect("a folder of ours");
    read
}

/// Options as users write them, one a line: `guide=GUIDE`, `windows=POLICY`, `sensor.KEY=VALUE`, `scene.SECTION.KEY=VALUE`.
fn read_options(path: &Path) -> Result<(), String> {
    let (mut sensor, mut scene) = (
        Document::from_table("--set", Table::new()),
        Scene::outdoor_document(),
    );
    for line in text(path)?.lines() {
        match line.split_once(['=', '.']) {
            Some(("guide", guide)) => error_text(options::parse_all(guide.split(' '), "--guide"))?,
            Some(("windows", policy)) => {
                error_text(WindowPolicy::default().with_changes(policy, "--windows"))?;
            }
            Some(("sensor", text)) => assign(&mut sensor, Assignment::parse(text, "--set"))?,
            Some(("scene", text)) => assign(&mut scene, Assignment::parse(text, "--set"))?,
            _ => return Err(format!("{line} is no option")),
        }
    }
    error_text(SensorConfig::read_document(&sensor))?;
    error_text(Scene::read(&scene))
}

/// Whole lines stay, whatever they are, and what is appended is read.
fn read_journal(path: &Path) -> Result<(), String> {
    let count = || {
        let mut lines = 0;
        let wrong = JournalReader::open(path)?.scan(|_, _| lines += 1)?;
        Ok::<_, crate::files::InputError>((lines, wrong))
    };
    let before = count().map_err(|error| error.to_string())?;
    let mut journal = Journal::open(path).map_err(|error| error.to_string())?;
    let journal = journal.as_mut().expect("nobody else has it");
    error_text(journal.append(&journal_line("next")))?;
    assert_eq!(count(), Ok((before.0 + 1, before.1)));
    Ok(())
}
