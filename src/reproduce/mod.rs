//! The thesis's published figures beside ours: claims with verdicts, tables, figures, and the page that shows them.
//!
//! ```text
//!   CLAIMS ─► rows: published, computed, verdict ─┐
//!   TABLES ─► grids ──────────────────────────────┼─► terminal, JSON, Markdown, HTML, SVG and CSV
//!   FIGURES ─► charts ────────────────────────────┤
//!   MEASUREMENTS ─► the chip against its theory ──┘
//! ```
//!
//! A claim that the model must meet and does not is a fault, and `gdtof reproduce` fails. One that no honest
//! convention meets says so and why; it is never bent. Where the thesis's convention and the physically right one
//! part, both are shown.

mod chip;
mod claim;
mod delay_line;
mod demonstrator;
mod design;
mod guided_bins;
pub mod measured;
mod page;
mod penalty;
mod photon_budget;
mod precision;
mod published;
mod registry;
mod sensors;
mod silicon;
mod slips;
mod stereo;
mod system;

pub use claim::{Claim, Row, Verdict, between_quotes, overall};
pub(crate) use page::heading;
pub use page::{SLIPS_TITLE, grid, html, markdown, slips as slips_grid, tally};
pub use published::Published;
pub use registry::{CLAIMS, FIGURES, Figure, MEASUREMENTS, Measurement, TABLES, Table};

pub use slips::{SLIPS, Slip};

use rayon::prelude::*;
use serde_json::{Value, json};

use crate::report::{Chart, Grid};

/// Which numbers to reproduce: claims of the list, figures and tables of the thesis.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Selection {
    /// Numbers of claims.
    pub claims: Vec<u32>,
    /// Numbers of figures.
    pub figures: Vec<u32>,
    /// Numbers of tables.
    pub tables: Vec<u32>,
    /// Numbers of measurements of the chip against its theory.
    pub measurements: Vec<u32>,
    /// Frames behind each measured number; [`measured::FRAMES`] where none is given.
    pub frames: Option<usize>,
}

impl Selection {
    /// Everything there is.
    pub fn all() -> Self {
        Selection {
            claims: CLAIMS.iter().map(|c| c.number).collect(),
            figures: FIGURES.iter().map(|f| f.number).collect(),
            tables: TABLES.iter().map(|t| t.number).collect(),
            measurements: MEASUREMENTS.iter().map(|m| m.number).collect(),
            frames: None,
        }
    }

    /// Whether nothing is chosen.
    pub fn is_empty(&self) -> bool {
        let chosen = [
            &self.claims,
            &self.figures,
            &self.tables,
            &self.measurements,
        ];
        chosen.into_iter().all(Vec::is_empty)
    }

    /// How many parts are chosen.
    pub fn parts(&self) -> usize {
        let chosen = [
            &self.claims,
            &self.figures,
            &self.tables,
            &self.measurements,
        ];
        chosen.into_iter().map(Vec::len).sum()
    }

    /// Whether everything that is chosen exists.
    ///
    /// # Errors
    /// The first that does not.
    pub fn check(&self) -> Result<(), NothingThere> {
        let known = Selection::all();
        let parts = [
            (Part::Claim, &self.claims, known.claims),
            (Part::Figure, &self.figures, known.figures),
            (Part::Table, &self.tables, known.tables),
            (Part::Measurement, &self.measurements, known.measurements),
        ];
        for (part, chosen, known) in parts {
            if let Some(&number) = chosen.iter().find(|n| !known.contains(n)) {
                return Err(NothingThere {
                    part,
                    number,
                    known,
                });
            }
        }
        Ok(())
    }
}

/// What can be reproduced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// A claim of the thesis.
    Claim,
    /// A figure of it.
    Figure,
    /// A table of it.
    Table,
    /// One of our own measurements.
    Measurement,
}

impl Part {
    /// What it is called.
    pub const fn name(self) -> &'static str {
        match self {
            Part::Claim => "claim",
            Part::Figure => "figure",
            Part::Table => "table",
            Part::Measurement => "measurement",
        }
    }
}

/// A number that nothing has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no {} {number} to reproduce; choose from {}", part.name(), listed(known))]
pub struct NothingThere {
    /// What was asked for.
    pub part: Part,
    /// Its number.
    pub number: u32,
    /// Numbers that there are.
    pub known: Vec<u32>,
}

fn listed(numbers: &[u32]) -> String {
    let numbers: Vec<String> = numbers.iter().map(u32::to_string).collect();
    numbers.join(", ")
}

/// A claim and its rows.
pub struct ClaimResult {
    /// The claim.
    pub claim: Claim,
    /// Its comparisons.
    pub rows: Vec<Row>,
}

/// A table of the thesis, computed.
pub struct TableResult {
    /// Its number in the thesis.
    pub number: u32,
    /// What it shows.
    pub title: &'static str,
    /// The computed table.
    pub grid: Grid,
}

/// A figure of the thesis, computed.
pub struct FigureResult {
    /// Its number in the thesis.
    pub number: u32,
    /// What it shows.
    pub title: &'static str,
    /// Its charts.
    pub charts: Vec<Chart>,
}

impl FigureResult {
    /// File names without extension, each with its chart.
    pub fn files(&self) -> impl Iterator<Item = (String, &Chart)> {
        let several = self.charts.len() > 1;
        self.charts.iter().zip('a'..).map(move |(chart, letter)| {
            let letter = if several {
                letter.to_string()
            } else {
                String::new()
            };
            (format!("fig_{:03}{letter}", self.number), chart)
        })
    }
}

/// The chip, measured against its theory.
pub struct MeasurementResult {
    /// Its number.
    pub number: u32,
    /// What it shows.
    pub title: &'static str,
    /// What was found.
    pub found: measured::Study,
}

impl MeasurementResult {
    /// File names without extension, each with its table.
    pub fn tables(&self) -> impl Iterator<Item = (String, &'static str, &Grid)> {
        let lettered = self.found.grids.iter().zip('a'..);
        lettered.map(|((title, grid), letter)| {
            (format!("measured_{}{letter}", self.number), *title, grid)
        })
    }

    /// File names without extension, each with its chart.
    pub fn files(&self) -> impl Iterator<Item = (String, &Chart)> {
        let charts = self.found.charts.iter().zip('a'..);
        charts.map(|(chart, letter)| (format!("measured_{}{letter}_chart", self.number), chart))
    }
}

/// Everything that was reproduced, in the thesis's order.
#[derive(Default)]
pub struct Report {
    /// Claims.
    pub claims: Vec<ClaimResult>,
    /// The thesis's slips, where every claim is chosen.
    pub slips: Vec<Slip>,
    /// Tables.
    pub tables: Vec<TableResult>,
    /// Figures.
    pub figures: Vec<FigureResult>,
    /// Measurements of the chip.
    pub measurements: Vec<MeasurementResult>,
}

/// One thing to compute, so that all of them share the threads.
enum Job {
    Claim(Claim),
    Table(Table),
    Figure(Figure),
    Measurement(Measurement, usize),
}

/// What it gives.
enum Done {
    Claim(ClaimResult),
    Table(TableResult),
    Figure(FigureResult),
    Measurement(MeasurementResult),
}

impl Job {
    fn run(self) -> Done {
        match self {
            Job::Claim(claim) => Done::Claim(ClaimResult {
                claim,
                rows: (claim.compute)(),
            }),
            Job::Table(table) => Done::Table(TableResult {
                number: table.number,
                title: table.title,
                grid: (table.make)(),
            }),
            Job::Figure(figure) => Done::Figure(FigureResult {
                number: figure.number,
                title: figure.title,
                charts: (figure.draw)(),
            }),
            Job::Measurement(measurement, frames) => Done::Measurement(MeasurementResult {
                number: measurement.number,
                title: measurement.title,
                found: (measurement.measure)(frames).expect("configurations that the engines run"),
            }),
        }
    }
}

/// Computes what is chosen, on all threads; `done` is told of each claim, table and figure as it is finished.
pub fn reproduce(selection: &Selection, done: impl Fn() + Sync) -> Report {
    let claims = CLAIMS
        .iter()
        .filter(|c| selection.claims.contains(&c.number));
    let tables = TABLES
        .iter()
        .filter(|t| selection.tables.contains(&t.number));
    let figures = FIGURES
        .iter()
        .filter(|f| selection.figures.contains(&f.number));
    let measurements = MEASUREMENTS
        .iter()
        .filter(|m| selection.measurements.contains(&m.number));
    let frames = selection.frames.unwrap_or(measured::FRAMES);
    let jobs: Vec<Job> = claims
        .map(|&c| Job::Claim(c))
        .chain(tables.map(|&t| Job::Table(t)))
        .chain(figures.map(|&f| Job::Figure(f)))
        .chain(measurements.map(|&m| Job::Measurement(m, frames)))
        .collect();
    let results: Vec<Done> = jobs
        .into_par_iter()
        .with_max_len(1)
        .map(|job| {
            let result = job.run();
            done();
            result
        })
        .collect();
    let mut report = Report::default();
    if CLAIMS.iter().all(|c| selection.claims.contains(&c.number)) {
        report.slips = SLIPS.to_vec();
    }
    for result in results {
        match result {
            Done::Claim(claim) => report.claims.push(claim),
            Done::Table(table) => report.tables.push(table),
            Done::Figure(figure) => report.figures.push(figure),
            Done::Measurement(measurement) => report.measurements.push(measurement),
        }
    }
    report
}

impl Report {
    /// The rows of all claims.
    pub fn rows(&self) -> impl Iterator<Item = &Row> {
        self.claims.iter().flat_map(|result| &result.rows)
    }

    /// Rows that leave their tolerance although they are expected to hold, with the number of their claim.
    pub fn failures(&self) -> Vec<(u32, &Row)> {
        let rows = self
            .claims
            .iter()
            .flat_map(|result| result.rows.iter().map(|row| (result.claim.number, row)));
        rows.filter(|(_, row)| row.verdict() == Verdict::Fails)
            .collect()
    }

    /// Everything for a machine to read. Numbers that are not finite become null.
    pub fn json(&self) -> Value {
        let row = |row: &Row| {
            let range = row.published.range();
            json!({
                "quantity": row.what,
                "unit": row.unit,
                "published": row.published.text(),
                "least": range.map(|r| r.0),
                "greatest": range.map(|r| r.1),
                "computed": row.computed,
                "interval": row.interval,
                "difference": row.difference().map(|d| d.0),
                "verdict": row.verdict(),
                "aside": row.is_aside,
                "notes": row.notes(),
            })
        };
        let claim = |result: &ClaimResult| {
            json!({
                "claim": result.claim.number,
                "title": result.claim.title,
                "source": result.claim.source,
                "verdict": overall(&result.rows),
                "rows": result.rows.iter().map(row).collect::<Vec<_>>(),
            })
        };
        let table = |table: &TableResult| json!({"table": table.number, "title": table.title, "rows": table.grid.lines().collect::<Vec<_>>()});
        let series = |chart: &Chart| {
            let series = chart.series.iter();
            series
                .map(|s| json!({"name": s.name, "points": s.points}))
                .collect::<Vec<_>>()
        };
        let figure = |figure: &FigureResult| {
            let charts = figure.charts.iter().map(|chart| {
                json!({"title": chart.title, "x": chart.x.label, "y": chart.y.label, "series": series(chart)})
            });
            json!({"figure": figure.number, "title": figure.title, "charts": charts.collect::<Vec<_>>()})
        };
        let measurement = |result: &MeasurementResult| {
            let tables = result.tables().map(|(_, title, grid)| {
                json!({"title": title, "rows": grid.lines().collect::<Vec<_>>()})
            });
            json!({
                "measurement": result.number,
                "title": result.title,
                "notes": result.found.notes,
                "tables": tables.collect::<Vec<_>>(),
            })
        };
        json!({
            "claims": self.claims.iter().map(claim).collect::<Vec<_>>(),
            "slips": self.slips,
            "tables": self.tables.iter().map(table).collect::<Vec<_>>(),
            "figures": self.figures.iter().map(figure).collect::<Vec<_>>(),
            "measurements": self.measurements.iter().map(measurement).collect::<Vec<_>>(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_unique_and_in_order() {
        let all = Selection::all();
        for numbers in [all.claims, all.figures, all.tables, all.measurements] {
            assert!(
                numbers.windows(2).all(|pair| pair[0] < pair[1]),
                "{numbers:?}"
            );
        }
        assert_eq!(
            CLAIMS.map(|c| c.number).to_vec(),
            (1..=28).collect::<Vec<_>>()
        );
    }

    #[test]
    fn what_does_not_exist_is_named() {
        let selection = Selection {
            figures: vec![35, 999],
            ..Selection::default()
        };
        let fault = selection.check().unwrap_err();
        assert_eq!((fault.part, fault.number), (Part::Figure, 999));
        let message = fault.to_string();
        assert!(
            message.contains("no figure 999") && message.contains("35"),
            "{message}"
        );
        assert!(Selection::all().check().is_ok());
    }
}
