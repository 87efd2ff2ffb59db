//! What is kept of a point: under a key made of its content, in a line of a journal.

use std::path::{Path, PathBuf};

use serde_json::Value as Json;
use sha2::{Digest, Sha256};

use super::cell::{Column, TableCell};
use crate::files::{InputError, JournalReader, journal_line};

/// Which results are the same: to be raised with every change of the program that changes a row. A test holds a frame to it.
const RESULTS: u32 = 8;

/// What a row is kept under: a hash of everything that it depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Key(u128);

impl Key {
    /// Of a point whose `content` says all of it, with results in `columns`.
    pub(super) fn from_content(kind: &str, columns: &[Column], content: &str) -> Self {
        let mut hash = Sha256::new();
        for part in [
            "gdtof",
            env!("CARGO_PKG_VERSION"),
            &RESULTS.to_string(),
            kind,
        ] {
            hash.update(part);
            hash.update([0]);
        }
        for column in columns {
            hash.update(&column.name);
            hash.update([0]);
        }
        hash.update(content);
        let hash = hash.finalize();
        Key(u128::from_be_bytes(
            hash[..16].try_into().expect("16 of 32 bytes"),
        ))
    }

    fn parse(text: &str) -> Option<Self> {
        (text.len() == 32).then(|| u128::from_str_radix(text, 16).ok().map(Key))?
    }

    fn prefix(self) -> u64 {
        (self.0 >> 64) as u64
    }
}

/// The results of a point.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyRow {
    /// What it took, s; 0 where nobody measured.
    pub run_time_s: f64,
    /// Why there are no results, where there are none.
    pub error: Option<String>,
    /// A cell for each column of results; none at all where there is an error.
    pub cells: Vec<TableCell>,
}

impl StudyRow {
    /// The line of a journal.
    pub(super) fn line(&self, key: Key) -> String {
        let mut parts: Vec<Json> = vec![
            self.run_time_s.into(),
            self.error.as_deref().map_or(Json::Null, Json::from),
        ];
        parts.extend(self.cells.iter().map(TableCell::json));
        journal_line(&format!("{:032x} {}", key.0, Json::from(parts)))
    }

    /// From the text of a line, if it is that of `key`.
    fn parse(text: &str, key: Key, columns: &[Column]) -> Option<Self> {
        let (said, json) = text.split_once(' ')?;
        if Key::parse(said)? != key {
            return None;
        }
        let parts: Vec<Json> = serde_json::from_str(json).ok()?;
        let (run_time_s, rest) = parts.split_first()?;
        let (error, cells) = rest.split_first()?;
        let (error, wanted) = match error {
            Json::Null => (None, columns.len()),
            error => (Some(error.as_str()?.to_owned()), 0),
        };
        if cells.len() != wanted {
            return None;
        }
        let cells: Option<Vec<TableCell>> = (cells.iter().zip(columns))
            .map(|(cell, column)| TableCell::from_json(cell, column.holds))
            .collect();
        Some(StudyRow {
            run_time_s: run_time_s.as_f64()?,
            error,
            cells: cells?,
        })
    }
}

/// Where the rows of some journals are: 16 bytes a row.
#[derive(Debug, Default)]
pub(super) struct Index {
    paths: Vec<PathBuf>,
    /// First half of the key, number of the journal and where in it the line begins; sorted. Of two keys that share that half, one is
    /// not found: among 10⁸ points there is such a pair with a chance of 3·10⁻⁴.
    places: Vec<(u64, u64)>,
    /// Lines with a wrong checksum, which are of no use.
    pub(super) spoilt: usize,
}

/// Bits of a place that say where in its journal.
const OFFSET_BITS: u32 = 48;

impl Index {
    /// Reads journals. A row that does not fit `columns` is not there.
    ///
    /// # Errors
    /// When one cannot be read.
    pub(super) fn read(paths: Vec<PathBuf>, columns: &[Column]) -> Result<Self, InputError> {
        let mut index = Index::default();
        for (number, path) in paths.iter().enumerate() {
            let places = &mut index.places;
            index.spoilt += JournalReader::open(path)?.scan(|begin, text| {
                let key = text.split_once(' ').and_then(|(key, _)| Key::parse(key));
                if let Some(key) = key.filter(|&key| StudyRow::parse(text, key, columns).is_some())
                {
                    places.push((key.prefix(), (number as u64) << OFFSET_BITS | begin));
                }
            })?;
        }
        index.places.sort_unstable();
        // A point that two processes took has the same row twice.
        index.places.dedup_by_key(|(prefix, _)| *prefix);
        index.places.shrink_to_fit();
        index.paths = paths;
        Ok(index)
    }

    /// Whether there is a row of this key.
    pub(super) fn has(&self, key: Key) -> bool {
        self.place(key).is_some()
    }

    fn place(&self, key: Key) -> Option<u64> {
        let found = self
            .places
            .binary_search_by_key(&key.prefix(), |(prefix, _)| *prefix);
        found.ok().map(|at| self.places[at].1)
    }

    /// Opens the journals to read rows.
    ///
    /// # Errors
    /// When one cannot be opened.
    pub(super) fn rows<'a>(&'a self, columns: &'a [Column]) -> Result<Rows<'a>, InputError> {
        let readers = self.paths.iter().map(|path| JournalReader::open(path));
        Ok(Rows {
            index: self,
            columns,
            readers: readers.collect::<Result<_, _>>()?,
        })
    }
}

/// Rows of an [`Index`], read one by one.
pub(super) struct Rows<'a> {
    index: &'a Index,
    columns: &'a [Column],
    readers: Vec<JournalReader>,
}

impl Rows<'_> {
    /// The row of a key, if there is one.
    ///
    /// # Errors
    /// When the journal cannot be read.
    pub(super) fn get(&mut self, key: Key) -> Result<Option<StudyRow>, InputError> {
        let Some(place) = self.index.place(key) else {
            return Ok(None);
        };
        let reader = &mut self.readers[(place >> OFFSET_BITS) as usize];
        let text = reader.read_line_at(place & ((1 << OFFSET_BITS) - 1))?;
        Ok(text.and_then(|text| StudyRow::parse(text, key, self.columns)))
    }
}

/// The journals in a folder, in the order of their names.
pub(super) fn journals_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    // Nothing is read through a link, nor from a device, which may not end.
    let is_journal = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str());
        let name = name.and_then(|name| name.strip_prefix("journal")?.strip_suffix(".log"));
        // Not one that was set aside: `journal.kept.log`.
        name.is_some_and(|part| part.is_empty() || part.starts_with('-') && !part.contains('.'))
            && path.symlink_metadata().is_ok_and(|about| about.is_file())
    };
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(is_journal)
        .collect();
    paths.sort();
    paths
}

#[cfg(test)]
mod tests {
    use super::super::cell::Holds;
    use super::*;
    use crate::files::Journal;

    #[test]
    fn rows_come_back_by_their_keys_from_several_journals() {
        let columns = [
            Column::new("a", "", Holds::Number),
            Column::new("b", "", Holds::Word),
        ];
        let dir = tempfile::tempdir().unwrap();
        let row = |i: usize| match i % 5 {
            0 => StudyRow {
                run_time_s: 0.1,
                error: Some(format!("no {i}")),
                cells: Vec::new(),
            },
            _ => StudyRow {
                run_time_s: 0.25,
                error: None,
                cells: vec![
                    TableCell::Number(1.0 / i as f64),
                    TableCell::Word("a \"b\", c".into()),
                ],
            },
        };
        let key = |i: usize| Key::from_content("x", &columns, &i.to_string());
        for name in ["journal.log", "journal-2-of-2.log", "notes.txt"] {
            let mut journal = Journal::open(&dir.path().join(name)).unwrap().unwrap();
            let own = (0..300).filter(|i| (i % 3 == 0) == (name == "journal.log"));
            for i in own {
                journal.append(&row(i).line(key(i))).unwrap();
            }
        }
        let index = Index::read(journals_in(dir.path()), &columns).unwrap();
        assert_eq!(index.places.len(), 300);
        let mut rows = index.rows(&columns).unwrap();
        for i in (0..300).rev() {
            assert_eq!(rows.get(key(i)).unwrap(), Some(row(i)));
        }
        assert_eq!(rows.get(key(300)).unwrap(), None);
        assert_ne!(Key::from_content("x", &columns[..1], "7"), key(7));
    }

    #[test]
    fn a_row_of_no_use_is_not_there() {
        let columns = [Column::new("a", "", Holds::Whole)];
        let key = |i: usize| Key::from_content("x", &columns, &i.to_string());
        let unusable = [
            "nonsense",
            "[]",
            "[0.5,null]",
            "[0.5,null,1,2]",
            "[0.5,null,1.5]",
            "[0.5,3,1]",
            "[0.5,\"why\",1]",
        ];
        let dir = tempfile::tempdir().unwrap();
        let mut journal = Journal::open(&dir.path().join("journal.log"))
            .unwrap()
            .unwrap();
        for (i, text) in unusable.iter().enumerate() {
            let line = journal_line(&format!("{:032x} {text}", key(i).0));
            journal.append(&line).unwrap();
        }
        let row = StudyRow {
            run_time_s: 0.0,
            error: None,
            cells: vec![TableCell::Whole(7)],
        };
        journal.append(&row.line(key(0))).unwrap();
        let index = Index::read(journals_in(dir.path()), &columns).unwrap();
        assert_eq!((index.places.len(), index.spoilt), (1, 0));
        assert_eq!(
            index.rows(&columns).unwrap().get(key(0)).unwrap(),
            Some(row)
        );
    }
}
