//! The book's chapter of keys is made of the tables that files are held to.

use std::fmt::Write;
use std::path::Path;

use guided_dtof::chip::SensorConfig;
use guided_dtof::guide::options;
use guided_dtof::request::FrameRequest;
use guided_dtof::scene::Scene;
use guided_dtof::settings::{Key, Settings};
use guided_dtof::sweep::Study;
use guided_dtof::system::WindowPolicy;

const HEAD: &str = "# Keys

Every key that you can set, with its unit, range and source. `gdtof sensor` and `gdtof scene` print the same keys with the values of a sensor or scene.
";

fn table(title: &str, what: &str, keys: &[Key]) -> String {
    let mut text = format!("\n## {title}\n\n{what}.\n");
    if !keys.is_empty() {
        text += "\n| key | what it is | range | source |\n|---|---|---|---|\n";
    }
    for key in keys {
        let (name, what, range, source) = (key.name, key.what, key.range, key.source);
        let range = format!("{range} {}", key.unit);
        let _ = writeln!(text, "| `{name}` | {what} | {} | {source} |", range.trim());
    }
    text
}

fn chapter() -> String {
    let sensor = SensorConfig::SECTION;
    let mut text = HEAD.to_owned() + &table("Sensor files", sensor.what, sensor.keys);
    for section in Scene::SECTIONS {
        let title = format!("Scene files: `[{}]`", section.name);
        text += &table(&title, section.what, section.keys);
    }
    let windows = "How windows are chosen";
    text += &table("Windows: `--windows`", windows, WindowPolicy::KEYS);
    for kind in options::KINDS {
        let title = format!("Guides: `--guide {}`", kind.name);
        text += &table(&title, kind.what, kind.keys);
    }
    for section in Study::SECTIONS {
        let title = format!("Studies: `{}`", section.name);
        text += &table(&title, section.what, section.keys);
    }
    let frame = "Settings of a frame besides its sensor and scene";
    text + &table("Studies: `frame`", frame, FrameRequest::KEYS)
}

/// Set GDTOF_REMAKE to write the chapter anew (`vectors/remake.sh` does).
#[test]
fn with_its_unit_range_and_source() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/src/keys.md");
    if std::env::var_os("GDTOF_REMAKE").is_some() {
        std::fs::write(&path, chapter()).unwrap();
    }
    assert_eq!(std::fs::read_to_string(path).unwrap(), chapter());
}
