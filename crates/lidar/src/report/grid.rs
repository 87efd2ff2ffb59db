//! Tables of several columns: aligned for a terminal, as Markdown and as CSV.

use std::fmt;
use std::io::Write;

/// Rows of cells under headings. The first column aligns left, all others right.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Grid {
    headings: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Grid {
    /// An empty table with these headings.
    pub fn new<S: Into<String>>(headings: impl IntoIterator<Item = S>) -> Self {
        Grid {
            headings: headings.into_iter().map(Into::into).collect(),
            rows: Vec::new(),
        }
    }

    /// An empty table under one line of headings, with ` | ` between them.
    pub fn headed(headings: &str) -> Self {
        Self::new(headings.split(" | "))
    }

    /// Adds a row, which must have a cell for every heading.
    pub fn push<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        let row: Vec<String> = cells.into_iter().map(Into::into).collect();
        debug_assert_eq!(row.len(), self.headings.len(), "a cell for every heading");
        self.rows.push(row);
    }

    /// The headings, then every row.
    pub fn lines(&self) -> impl Iterator<Item = &[String]> {
        std::iter::once(&self.headings)
            .chain(&self.rows)
            .map(Vec::as_slice)
    }

    /// The table in GitHub's Markdown.
    pub fn markdown(&self) -> String {
        let line = |cells: &[String]| {
            let cells: Vec<String> = cells.iter().map(|c| c.replace('|', "\\|")).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let marks: Vec<String> = (0..self.headings.len())
            .map(|column| if column == 0 { "---" } else { "---:" }.to_owned())
            .collect();
        let rows = self.rows.iter().map(|row| line(row));
        line(&self.headings) + &line(&marks) + &rows.collect::<String>()
    }

    /// Writes the table as CSV, headings first.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_csv(&self, out: &mut dyn Write) -> std::io::Result<()> {
        for row in std::iter::once(&self.headings).chain(&self.rows) {
            let cells: Vec<String> = row.iter().map(|cell| quoted(cell)).collect();
            writeln!(out, "{}", cells.join(","))?;
        }
        Ok(())
    }
}

impl fmt::Display for Grid {
    /// One line per row, columns two spaces apart, each line ending in a line feed.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = || std::iter::once(&self.headings).chain(&self.rows);
        let widths: Vec<usize> = (0..self.headings.len())
            .map(|column| width(all().map(|row| &row[column])))
            .collect();
        all().try_for_each(|row| f.write_str(&aligned(row, &widths)))
    }
}

/// A CSV field, in quotation marks where it needs them: also where a spreadsheet would take words for a formula. Numbers have none.
pub(crate) fn quoted(field: &str) -> String {
    let is_like_formula = field.starts_with(['=', '+', '-', '@']) && field.parse::<f64>().is_err();
    if is_like_formula || field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

/// What the widest of these cells takes on a terminal.
pub fn width<'c>(cells: impl Iterator<Item = &'c String>) -> usize {
    cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
}

/// A line of cells, columns of these widths two spaces apart. The first column aligns left, all others right.
pub fn aligned(cells: &[String], widths: &[usize]) -> String {
    let mut line = String::new();
    for (column, (cell, &width)) in cells.iter().zip(widths).enumerate() {
        line += &match column {
            0 => format!("{cell:<width$}"),
            _ => format!("  {cell:>width$}"),
        };
    }
    line.truncate(line.trim_end().len());
    line + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        let mut grid = Grid::new(["engine", "time (ms)"]);
        grid.push(["window", "142"]);
        grid.push(["a|b, c", "7"]);
        grid
    }

    #[test]
    fn columns_line_up() {
        assert_eq!(
            grid().to_string(),
            "engine  time (ms)\nwindow        142\na|b, c          7\n"
        );
    }

    #[test]
    fn markdown_and_csv_escape_what_separates_cells() {
        assert_eq!(
            grid().markdown(),
            "| engine | time (ms) |\n| --- | ---: |\n| window | 142 |\n| a\\|b, c | 7 |\n"
        );
        let mut csv = Vec::new();
        grid().write_csv(&mut csv).unwrap();
        assert_eq!(
            String::from_utf8(csv).unwrap(),
            "engine,time (ms)\nwindow,142\n\"a|b, c\",7\n"
        );
    }

    #[test]
    fn words_that_look_like_a_formula_are_in_quotation_marks_and_numbers_are_not() {
        for word in ["=1+1", "+a", "-x", "@a", "-", "=", "-1-1"] {
            assert_eq!(quoted(word), format!("\"{word}\""));
        }
        for number in ["-1", "-1.5", "+2", "-3e-7", "-inf", "-0.0"] {
            assert_eq!(quoted(number), number);
        }
        assert_eq!(quoted("a=b"), "a=b");
        assert_eq!(quoted("=\"a\""), "\"=\"\"a\"\"\"");
    }
}
