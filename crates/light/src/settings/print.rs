//! Settings as a commented TOML file, which reads back as they are.

use std::fmt::Write;

use toml::{Table, Value};

use super::key::Key;
use super::notes::{Notes, path};

/// A section of a settings file.
#[derive(Debug, Clone, Copy)]
pub struct Section {
    /// Name in brackets; empty for the root.
    pub name: &'static str,
    /// What it describes.
    pub what: &'static str,
    /// Its keys, in order.
    pub keys: &'static [Key],
}

impl Section {
    /// A section; see its fields.
    pub const fn new(name: &'static str, what: &'static str, keys: &'static [Key]) -> Self {
        Section { name, what, keys }
    }
}

/// All of `values`, by `sections`, every key with what it is, its unit, range and source. What a key is where a file
/// leaves it out is added where that is another value (`left_out` has these). A list gets its keys explained once, before
/// its items. `notes` add why a value was chosen.
pub fn commented(sections: &[Section], values: &Table, left_out: &Table, notes: &Notes) -> String {
    let mut text = String::new();
    write_note(&mut text, "", notes.comment(""));
    for section in sections {
        if !text.is_empty() {
            text.push('\n');
        }
        let _ = writeln!(text, "# {}.", section.what);
        if section.name.is_empty() {
            write_keys(&mut text, section, values, left_out, notes);
            continue;
        }
        let nothing = Table::new();
        match values.get(section.name) {
            Some(Value::Array(items)) => {
                for key in section.keys {
                    let _ = writeln!(text, "#   {}: {}", key.name, explained(key));
                }
                for (number, item) in items.iter().filter_map(Value::as_table).enumerate() {
                    let place = path(section.name, &number.to_string());
                    text.push('\n');
                    write_note(&mut text, "", notes.comment(&place));
                    let _ = writeln!(text, "[[{}]]", section.name);
                    for key in section.keys {
                        if let Some(value) = item.get(key.name) {
                            let note = notes.comment_on_value(&path(&place, key.name), value);
                            write_note(&mut text, WHY, note);
                            let _ = writeln!(text, "{} = {value}", key.name);
                        }
                    }
                }
            }
            Some(Value::Table(table)) => {
                let left_out = left_out.get(section.name).and_then(Value::as_table);
                write_note(&mut text, WHY, notes.comment(section.name));
                let _ = writeln!(text, "[{}]", section.name);
                let left_out = left_out.unwrap_or(&nothing);
                write_keys(&mut text, section, table, left_out, notes);
            }
            _ => {}
        }
    }
    text
}

/// Before a reason.
const WHY: &str = "Why: ";

fn write_note(text: &mut String, before: &str, note: Option<&str>) {
    if let Some(note) = note {
        let end = if note.ends_with('.') { "" } else { "." };
        let _ = writeln!(text, "# {before}{note}{end}");
    }
}

fn write_keys(
    text: &mut String,
    section: &Section,
    values: &Table,
    left_out: &Table,
    notes: &Notes,
) {
    for key in section.keys {
        let Some(value) = values.get(key.name) else {
            continue;
        };
        let _ = write!(text, "\n# {}", explained(key));
        if let Some(other) = left_out.get(key.name).filter(|other| *other != value) {
            let _ = write!(text, " {other} where a file leaves it out.");
        }
        text.push('\n');
        let note = notes.comment_on_value(&path(section.name, key.name), value);
        write_note(text, WHY, note);
        let _ = writeln!(text, "{} = {value}", key.name);
    }
}

fn explained(key: &Key) -> String {
    let unit = match key.unit {
        "" => String::new(),
        unit => format!(" {unit}"),
    };
    format!("{}; {}{unit}. Source: {}.", key.what, key.range, key.source)
}
