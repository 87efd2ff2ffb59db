//! Why the values of a built-in file were chosen: its comments, for the file that `commented` prints.
//!
//! ```text
//!   # head of the file             at the top
//!
//!   # above a section              at the section
//!   [section]                      # at the section, too
//!   # below its name               at the section, too
//!   key = value                    # at the key
//! ```

use std::collections::BTreeMap;

use toml::{Table, Value};

/// Comments by what they stand at. One at a key is said of the value that the key has in the file, and of no other.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Notes {
    /// Empty for the head, `lidar`, `lidar.pde`, `object.3`, `object.3.yaw_deg`; lists are counted from 0.
    words: BTreeMap<String, String>,
    chosen: Table,
}

impl Notes {
    /// The comments of a file in TOML. `chosen` has its values, and those that it leaves out.
    pub fn read(text: &str, chosen: Table) -> Self {
        let mut notes = Notes {
            chosen,
            ..Notes::default()
        };
        let (mut counts, mut section) = (BTreeMap::<String, usize>::new(), String::new());
        let mut waiting = String::new();
        let mut is_at_name = true;
        for line in text.lines() {
            let (code, comment) = split_comment(line);
            if code.is_empty() {
                if comment.is_empty() && section.is_empty() {
                    notes.add("", &std::mem::take(&mut waiting));
                } else if is_at_name {
                    notes.add(&section, comment);
                } else {
                    join(&mut waiting, comment);
                }
                is_at_name = is_at_name && !comment.is_empty();
                continue;
            }
            if let Some(name) = code.strip_prefix("[[") {
                let name = name.trim_end_matches(']');
                let count = counts.entry(name.to_owned()).or_default();
                section = format!("{name}.{count}");
                *count += 1;
            } else if let Some(name) = code.strip_prefix('[') {
                section = name.trim_end_matches(']').to_owned();
            } else {
                let key = code.split('=').next().unwrap_or_default().trim();
                notes.add(&path(&section, key), comment);
                is_at_name = false;
                continue;
            }
            notes.add(&section, &std::mem::take(&mut waiting));
            notes.add(&section, comment);
            is_at_name = true;
        }
        notes
    }

    /// Notes of keys without a section, after what the file is.
    pub fn from_keys(head: &str, keys: &[(&str, &str)], chosen: Table) -> Self {
        let heads = std::iter::once(("", head));
        let words = heads.chain(keys.iter().copied());
        Notes {
            words: words.map(|(key, why)| (key.into(), why.into())).collect(),
            chosen,
        }
    }

    fn add(&mut self, path: &str, comment: &str) {
        if !comment.is_empty() {
            join(self.words.entry(path.to_owned()).or_default(), comment);
        }
    }

    /// The comment at a section, an item or, for an empty path, at the head.
    pub(super) fn comment(&self, path: &str) -> Option<&str> {
        self.words.get(path).map(String::as_str)
    }

    /// The comment at a key, where it has the value that the comment is about.
    pub(super) fn comment_on_value(&self, path: &str, value: &Value) -> Option<&str> {
        let note = self.comment(path)?;
        let mut names = path.split('.');
        let first = self.chosen.get(names.next()?);
        let chosen = names.fold(first, |within, name| match within? {
            Value::Array(items) => items.get(name.parse::<usize>().ok()?),
            Value::Table(table) => table.get(name),
            _ => None,
        });
        (chosen == Some(value)).then_some(note)
    }
}

/// The path of a key in a section; the root's name is empty.
pub(super) fn path(section: &str, key: &str) -> String {
    if section.is_empty() {
        key.to_owned()
    } else {
        format!("{section}.{key}")
    }
}

fn join(words: &mut String, more: &str) {
    if !words.is_empty() && !more.is_empty() {
        words.push(' ');
    }
    words.push_str(more);
}

/// What stands before the comment of a line, and the comment, both trimmed.
fn split_comment(line: &str) -> (&str, &str) {
    let mut is_text = false;
    let hash = line.char_indices().find(|&(_, c)| {
        is_text ^= c == '"';
        c == '#' && !is_text
    });
    let (code, comment) = hash.map_or((line, ""), |(at, _)| (&line[..at], &line[at + 1..]));
    (code.trim(), comment.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "# A hall.\n# Chosen.\n\n[lidar]  # a flash\n# and more\npde = 0.2  # at 940 nm\nname = \"a # b\"\n\n# Racks.\n\n[[object]]\nyaw_deg = 15.0\n\n[[object]]\nyaw_deg = 15.0 # turned\n";

    #[test]
    fn comments_are_found_where_they_stand() {
        let notes = Notes::read(FILE, toml::from_str(FILE).unwrap());
        assert_eq!(notes.comment(""), Some("A hall. Chosen."));
        assert_eq!(notes.comment("lidar"), Some("a flash and more"));
        assert_eq!(notes.comment("object.0"), Some("Racks."));
        assert_eq!(notes.comment("object.1"), None);
        assert_eq!(notes.comment("lidar.name"), None);
    }

    #[test]
    fn a_comment_is_about_one_value() {
        let notes = Notes::read(FILE, toml::from_str(FILE).unwrap());
        let comment = |path: &str, value: f64| notes.comment_on_value(path, &value.into());
        assert_eq!(comment("lidar.pde", 0.2), Some("at 940 nm"));
        assert_eq!(comment("lidar.pde", 0.3), None);
        assert_eq!(comment("object.1.yaw_deg", 15.0), Some("turned"));
        assert_eq!(comment("object.0.yaw_deg", 15.0), None);
    }
}
