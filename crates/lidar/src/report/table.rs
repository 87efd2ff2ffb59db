//! Small tables of names and values, aligned for a terminal.

use std::fmt;

use super::grid::{aligned, width};

/// Rows of a name and a value. Names align left, values right.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Table {
    title: String,
    rows: Vec<[String; 2]>,
}

impl Table {
    /// An empty table; an empty title is not printed.
    pub fn new(title: impl Into<String>) -> Self {
        Table {
            title: title.into(),
            rows: Vec::new(),
        }
    }

    /// Adds a row and returns the table, for chaining.
    #[must_use]
    pub fn row(mut self, name: impl Into<String>, value: impl fmt::Display) -> Self {
        self.push(name, value);
        self
    }

    /// Adds a row.
    pub fn push(&mut self, name: impl Into<String>, value: impl fmt::Display) {
        self.rows.push([name.into(), value.to_string()]);
    }
}

impl fmt::Display for Table {
    /// The title on a line of its own, then one line per row, indented by two, each line ending
    /// in a line feed.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.title.is_empty() {
            writeln!(f, "{}", self.title)?;
        }
        let widths = [0, 1].map(|column| width(self.rows.iter().map(|row| &row[column])));
        let mut rows = self.rows.iter();
        rows.try_for_each(|row| write!(f, "  {}", aligned(row, &widths)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_values_line_up() {
        let table = Table::new("Frame")
            .row("pixels", 4096)
            .row("photons drawn", "45.1 M")
            .row("µ", 0.5);
        let expected =
            "Frame\n  pixels           4096\n  photons drawn  45.1 M\n  µ                 0.5\n";
        assert_eq!(table.to_string(), expected);
    }

    #[test]
    fn an_empty_table_prints_its_title_only() {
        assert_eq!(Table::new("Nothing").to_string(), "Nothing\n");
        assert_eq!(Table::new("").to_string(), "");
    }
}
