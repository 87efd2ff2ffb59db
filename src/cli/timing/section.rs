//! A table that prints for people and for programs: the same rows as text and as JSON.

use serde_json::{Map, Value, json};

use crate::report::Grid;
use crate::units::Time;

/// One value of a table.
pub(super) enum SectionCell {
    /// A name.
    Text(String),
    /// A time; in JSON, picoseconds.
    Time(Option<Time>),
    /// A number, with the decimals that are printed.
    Number(Option<f64>, usize),
}

impl SectionCell {
    fn text(&self) -> String {
        match self {
            SectionCell::Text(text) => text.clone(),
            SectionCell::Time(time) => time.map_or("-".to_owned(), |t| t.to_string()),
            SectionCell::Number(number, decimals) => {
                number.map_or("-".to_owned(), |n| format!("{n:.decimals$}"))
            }
        }
    }

    fn json(&self) -> Value {
        match self {
            SectionCell::Text(text) => json!(text),
            SectionCell::Time(time) => json!(time.map(|t| t.as_fs() as f64 * 1e-3)),
            SectionCell::Number(number, _) => json!(number),
        }
    }
}

impl From<&str> for SectionCell {
    fn from(text: &str) -> Self {
        SectionCell::Text(text.to_owned())
    }
}

impl From<String> for SectionCell {
    fn from(text: String) -> Self {
        SectionCell::Text(text)
    }
}

impl From<Time> for SectionCell {
    fn from(time: Time) -> Self {
        SectionCell::Time(Some(time))
    }
}

impl From<Option<Time>> for SectionCell {
    fn from(time: Option<Time>) -> Self {
        SectionCell::Time(time)
    }
}

/// A titled table.
pub(super) struct Section {
    key: &'static str,
    title: String,
    headings: &'static [&'static str],
    rows: Vec<Vec<SectionCell>>,
}

impl Section {
    /// An empty table; `key` is its name in JSON, where headings name the columns.
    pub(super) fn new(
        key: &'static str,
        title: impl Into<String>,
        headings: &'static [&'static str],
    ) -> Self {
        Section {
            key,
            title: title.into(),
            headings,
            rows: Vec::new(),
        }
    }

    /// Adds a row, which must have a cell for every heading.
    pub(super) fn push(&mut self, cells: impl IntoIterator<Item = SectionCell>) {
        let row: Vec<SectionCell> = cells.into_iter().collect();
        debug_assert_eq!(row.len(), self.headings.len());
        self.rows.push(row);
    }

    /// The table for a terminal, title first and an empty line last.
    pub(super) fn text(&self) -> String {
        if self.rows.is_empty() {
            return format!("{}\n\n", self.title);
        }
        let mut grid = Grid::new(self.headings.iter().copied());
        for row in &self.rows {
            grid.push(row.iter().map(SectionCell::text));
        }
        format!("{}\n{grid}\n", self.title)
    }

    /// Adds the table to a document: a list of objects.
    pub(super) fn add_to(&self, document: &mut Map<String, Value>) {
        let object = |row: &Vec<SectionCell>| -> Value {
            let keys = self.headings.iter().map(|h| h.replace([' ', '-'], "_"));
            keys.zip(row.iter().map(SectionCell::json))
                .collect::<Map<_, _>>()
                .into()
        };
        document.insert(self.key.to_owned(), self.rows.iter().map(object).collect());
    }
}
