//! A settings file and what assignments change in it, with the place of every value for complaints.
//!
//! An [`Assignment`] writes as a line `KEY = VALUE` of its section would. Later ones win, and all win over the file. An object goes
//! by its name or its number from 1: `object.car.reflectivity`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

use super::assignment::Assignment;
use super::declare::Settings;
use crate::files::{
    InputError, LineEnds, MOST_TOML_BYTES, in_plain_words, nearest, read_text_within,
};

/// Most items of a list. A scene with this many objects is read and printed in 1.1 s of processor time and 270 MB
/// (dev profile).
const MOST_ITEMS: usize = 65_536;

/// Something wrong with a setting.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Names from the root to the value, lists counted from 0, joined by dots.
    pub path: String,
    /// What is wrong and what to do about it.
    pub message: String,
}

impl Fault {
    /// A fault of the value at `path`; see its fields.
    pub fn new(path: impl Into<String>, message: impl Into<String>) -> Self {
        let (path, message) = (path.into(), message.into());
        Fault { path, message }
    }
}

/// Where a value comes from.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Origin {
    Line(usize),
    Assignment {
        origin: String,
        text: Option<String>,
    },
}

/// Settings as given, not yet checked.
#[derive(Debug, Clone)]
pub struct Document {
    source: String,
    /// The folder that files named in it are relative to: the file's own, or else the current one.
    pub folder: PathBuf,
    /// All values.
    pub table: Table,
    origins: BTreeMap<String, Origin>,
}

impl Document {
    /// Reads TOML text; `source` names it in complaints.
    ///
    /// # Errors
    /// When it is no TOML, or has a list that is too long, with the line; when the text is too long.
    pub fn parse(source: impl std::fmt::Display, text: &str) -> Result<Self, InputError> {
        let table: Table = crate::files::parse_toml(&source, text)?;
        let mut document = Self::from_table(source, table);
        if let Ok(spans) = DeTable::parse(text) {
            let (ends, mut long) = (LineEnds::new(text), Vec::new());
            note_lines(spans.get_ref(), "", &ends, &mut document.origins, &mut long);
            document.complain(long)?;
        }
        Ok(document)
    }

    /// Reads a TOML file.
    ///
    /// # Errors
    /// When it cannot be read or is no TOML.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        let mut document = Self::parse(path.display(), &Self::text(path)?)?;
        document.folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Ok(document)
    }

    /// The text of a file of settings.
    ///
    /// # Errors
    /// When it cannot be read or is too long.
    pub fn text(path: &Path) -> Result<String, InputError> {
        read_text_within(path, MOST_TOML_BYTES)
    }

    /// Settings that stand in no file.
    pub fn from_table(source: impl std::fmt::Display, table: Table) -> Self {
        Document {
            source: source.to_string(),
            folder: PathBuf::new(),
            table,
            origins: BTreeMap::new(),
        }
    }

    /// What complaints call it.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// Whether there is no value at all.
    pub fn is_empty(&self) -> bool {
        self.table.is_empty()
    }

    /// Writes the value of an assignment.
    ///
    /// # Errors
    /// When it names no section, or no object that there is.
    pub fn assign(&mut self, assignment: &Assignment) -> Result<(), InputError> {
        let Assignment {
            names,
            value,
            origin,
        } = assignment;
        let complain = |message: String| Err(InputError::new(origin, message));
        let (last, folders) = names.split_last().expect("a key has a name");
        let mut path = String::new();
        let mut table = &mut self.table;
        let mut folders = folders.iter();
        while let Some(name) = folders.next() {
            extend(&mut path, name);
            let entry = table
                .entry(name.as_str())
                .or_insert_with(|| Table::new().into());
            table = match entry {
                Value::Table(inner) => inner,
                Value::Array(list) => {
                    let Some(which) = folders.next() else {
                        let message = format!(
                            "{name} is a list; give {name}.NAME.key=value or {name}.NUMBER.key=value, counted from 1"
                        );
                        return complain(message);
                    };
                    let Some(index) = index_in(list, which) else {
                        let names = list.iter().filter_map(|item| item.get("name")?.as_str());
                        return complain(match nearest(which, names) {
                            Some(meant) => {
                                format!("there is no {name} {which:?}; did you mean `{meant}`?")
                            }
                            None => format!(
                                "there is no {name} {which:?}; give the name of one, or its number from 1 to {}",
                                list.len()
                            ),
                        });
                    };
                    extend(&mut path, &index.to_string());
                    list[index].as_table_mut().expect("index_in finds tables")
                }
                _ => return complain(format!("{name} is not a section; give another key")),
            };
        }
        extend(&mut path, last);
        table.insert(last.clone(), value.clone());
        let origin = Origin::Assignment {
            origin: origin.clone(),
            text: value.as_str().map(str::to_owned),
        };
        self.origins.insert(path, origin);
        Ok(())
    }

    /// Reads a section: quantities to plain numbers, then types, then ranges. Faults are added to `faults`, and their values
    /// left out.
    pub fn section<T: Settings>(
        &self,
        path: &str,
        given: &Table,
        faults: &mut Vec<Fault>,
    ) -> Table {
        let mut read = Table::new();
        let plain = |(name, value): (&String, &Value)| {
            let key = T::KEYS.iter().find(|key| key.name == name);
            let plain = key.map_or(Ok(value.clone()), |key| key.plain(value));
            (name.clone(), key, plain)
        };
        let given: Vec<_> = given.iter().map(plain).collect();
        let all = given.iter().filter_map(|(name, _, value)| {
            let value = value.as_ref().ok()?;
            Some((name.clone(), value.clone()))
        });
        // Where all of them fit together, each does alone.
        let is_whole = all.collect::<Table>().try_into::<T>().is_ok();
        for (name, key, plain) in given {
            let typed = plain.and_then(|value| {
                if is_whole {
                    return Ok(value);
                }
                let alone = Table::from_iter([(name.clone(), value.clone())]);
                match alone.try_into::<T>() {
                    Ok(_) => Ok(value),
                    Err(e) => {
                        let said = e.message();
                        Err(match key {
                            Some(key) => key.misfit(said),
                            None => in_plain_words(said),
                        })
                    }
                }
            });
            let checked = typed.and_then(|value| match key.and_then(|key| key.fault(&value)) {
                None => Ok(value),
                Some(message) => Err(message),
            });
            match checked {
                Ok(value) => drop(read.insert(name.clone(), value)),
                Err(message) => {
                    let mut path = path.to_owned();
                    extend(&mut path, &name);
                    faults.push(Fault { path, message });
                }
            }
        }
        read
    }

    /// All faults as one complaint, in the order of the file.
    ///
    /// # Errors
    /// When there is any.
    pub fn complain(&self, faults: Vec<Fault>) -> Result<(), InputError> {
        let mut placed: Vec<_> = faults
            .into_iter()
            .map(|fault| (self.origin(&fault.path).cloned(), fault.message))
            .collect();
        placed.sort_by(|a, b| a.0.cmp(&b.0));
        InputError::all(placed.into_iter().map(|(origin, message)| match origin {
            Some(Origin::Line(line)) => InputError::at_line(&self.source, line, message),
            Some(Origin::Assignment { origin, text }) => {
                about_assignment(&origin, &text.unwrap_or_default(), message)
            }
            None => InputError::new(&self.source, message),
        }))
    }

    /// A complaint about the value at `path`.
    pub fn refuse(&self, path: &str, message: String) -> InputError {
        let fault = Fault::new(path, message);
        self.complain(vec![fault]).expect_err("there is one fault")
    }

    /// The line of a value, if it stands in a file.
    pub fn line(&self, path: &str) -> Option<usize> {
        match self.origins.get(path) {
            Some(Origin::Line(line)) => Some(*line),
            _ => None,
        }
    }

    /// Where a value stands, or else the first in it, or else its section.
    fn origin(&self, path: &str) -> Option<&Origin> {
        let within = || {
            let first = self.origins.range(format!("{path}.")..).next()?;
            first
                .0
                .strip_prefix(path)?
                .starts_with('.')
                .then_some(first.1)
        };
        self.origins.get(path).or_else(within).or_else(|| {
            let (section, _) = path.rsplit_once('.')?;
            self.origin(section)
        })
    }
}

/// A complaint about a value that was assigned; about a file that its text names, where the message begins with that.
fn about_assignment(origin: &str, text: &str, message: String) -> InputError {
    let about_file = || {
        let (file, rest) = text.split(',').find_map(|file| {
            let file = file.trim();
            let rest = message.strip_prefix(file)?;
            (!file.is_empty() && rest.starts_with(':')).then_some((file, rest))
        })?;
        let numbered = rest[1..].split_once(": ");
        let line = numbered.and_then(|(line, rest)| Some((line.parse().ok()?, rest)));
        Some(match line {
            Some((line, rest)) => InputError::at_line(file, line, rest),
            None => InputError::new(file, rest.strip_prefix(": ")?),
        })
    };
    about_file().unwrap_or_else(|| InputError::new(origin, message))
}

fn extend(path: &mut String, name: &str) {
    if !path.is_empty() {
        path.push('.');
    }
    path.push_str(name);
}

/// Notes where values stand, and lists that are too long.
fn note_lines(
    table: &DeTable<'_>,
    path: &str,
    ends: &LineEnds,
    origins: &mut BTreeMap<String, Origin>,
    long: &mut Vec<Fault>,
) {
    for (key, value) in table.iter() {
        let mut path = path.to_owned();
        extend(&mut path, key.get_ref());
        let line = |offset| Origin::Line(ends.line_of(offset));
        origins.insert(path.clone(), line(key.span().start));
        match value.get_ref() {
            DeValue::Table(inner) => note_lines(inner, &path, ends, origins, long),
            DeValue::Array(list) if list.len() > MOST_ITEMS => {
                let message = format!(
                    "{} is a list of {}, of which at most {MOST_ITEMS} are read; give fewer",
                    key.get_ref(),
                    list.len()
                );
                long.push(Fault { path, message });
            }
            DeValue::Array(list) => {
                for (index, item) in list.iter().enumerate() {
                    // Other items have the line of their list.
                    if let DeValue::Table(inner) = item.get_ref() {
                        let path = format!("{path}.{index}");
                        origins.insert(path.clone(), line(item.span().start));
                        note_lines(inner, &path, ends, origins, long);
                    }
                }
            }
            _ => {}
        }
    }
}

fn index_in(list: &[Value], which: &str) -> Option<usize> {
    let has_name = |item: &Value| item.get("name").and_then(Value::as_str) == Some(which);
    let number = || which.parse::<usize>().ok()?.checked_sub(1);
    let index = list.iter().position(has_name).or_else(number)?;
    list.get(index)?.is_table().then_some(index)
}
