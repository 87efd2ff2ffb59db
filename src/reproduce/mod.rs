//! The thesis's published figures beside ours: claims with verdicts, tables, figures, and the page that shows them.
//!
//! ```text
//!   CLAIMS ─► rows: published, computed, verdict ─┐
//!   TABLES ─► grids ──────────────────────────────┼─► terminal, JSON, Markdown, HTML, SVG and CSV
//!   FIGURES ─► charts ────────────────────────────┤
//!   MEASUREMENTS ─► the chip against its theory ──┘
//! ```
//!
//! What the thesis prints and what is said of it is data, in `thesis.toml`; the files here compute a number for each of its rows. A new
//! row is a line there, and its name with a number in the claim's function.
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
mod stereo;
mod system;
mod thesis;

pub use claim::{Claim, Row, Verdict, between_quotes, overall};
pub(crate) use page::heading;
pub use page::{SLIPS_TITLE, grid, html, markdown, slips as slips_grid, tally};
pub use published::Published;
pub use registry::{CLAIMS, FIGURES, Listed, MEASUREMENTS, TABLES};
pub use thesis::Slip;

use rayon::prelude::*;
use serde_json::{Value, json};

use crate::report::{Chart, Grid};
use crate::settings::words;
use thesis::THESIS;

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
    pub(crate) fn is_empty(&self) -> bool {
        self.parts() == 0
    }

    /// How many parts are chosen.
    pub(crate) fn parts(&self) -> usize {
        self.claims.len() + self.figures.len() + self.tables.len() + self.measurements.len()
    }

    /// Whether everything that is chosen exists.
    ///
    /// # Errors
    /// The first that does not.
    pub(crate) fn check(&self) -> Result<(), NothingThere> {
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

words! {
    /// What can be reproduced.
    pub enum Part {
        /// A claim of the thesis.
        Claim = "claim",
        /// A figure of it.
        Figure = "figure",
        /// A table of it.
        Table = "table",
        /// One of our own measurements.
        Measurement = "measurement",
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

impl Listed<Chart> {
    /// The file's name without extension.
    pub(crate) fn file(&self) -> String {
        format!("fig_{:03}", self.number)
    }
}

impl Listed<measured::Study> {
    /// File names without extension, each with its table.
    pub(crate) fn tables(&self) -> impl Iterator<Item = (String, &'static str, &Grid)> {
        let lettered = self.it.grids.iter().zip('a'..);
        lettered.map(|((title, grid), letter)| {
            (format!("measured_{}{letter}", self.number), *title, grid)
        })
    }

    /// File names without extension, each with its chart.
    pub(crate) fn files(&self) -> impl Iterator<Item = (String, &Chart)> {
        let charts = self.it.charts.iter().zip('a'..);
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
    pub tables: Vec<Listed<Grid>>,
    /// Figures.
    pub figures: Vec<Listed<Chart>>,
    /// Measurements of the chip.
    pub measurements: Vec<Listed<measured::Study>>,
}

/// Computes what is chosen, on all threads; `done` is told of each claim, table, figure and measurement as it is finished.
pub fn reproduce(selection: &Selection, done: impl Fn() + Sync) -> Report {
    let frames = selection.frames.unwrap_or(measured::FRAMES);
    let claims = || {
        let made = made(&CLAIMS, &selection.claims, &done, |rows| rows());
        let made = made.into_iter().map(|Listed { number, title, it }| {
            let text = thesis::claim(number);
            debug_assert!(
                it.len() >= text.rows.len(),
                "claim {number} has rows without numbers"
            );
            let claim = Claim {
                number,
                title,
                source: &text.source,
            };
            ClaimResult { claim, rows: it }
        });
        made.collect::<Vec<_>>()
    };
    let tables = || made(&TABLES, &selection.tables, &done, |grid| grid());
    let figures = || made(&FIGURES, &selection.figures, &done, |chart| chart());
    let study = |measure: registry::Measure| measure(frames).expect("what the engines run");
    let measurements = || made(&MEASUREMENTS, &selection.measurements, &done, study);
    let ((claims, tables), (figures, measurements)) = rayon::join(
        || rayon::join(claims, tables),
        || rayon::join(figures, measurements),
    );
    let slips = match claims.len() == CLAIMS.len() {
        true => THESIS.slips.clone(),
        false => Vec::new(),
    };
    Report {
        claims,
        slips,
        tables,
        figures,
        measurements,
    }
}

/// Makes those of these numbers, each by itself, in the order of `all`.
fn made<F: Copy + Sync, T: Send>(
    all: &[Listed<F>],
    numbers: &[u32],
    done: &(impl Fn() + Sync),
    make: impl Fn(F) -> T + Sync,
) -> Vec<Listed<T>> {
    let chosen = all.iter().filter(|listed| numbers.contains(&listed.number));
    let chosen: Vec<&Listed<F>> = chosen.collect();
    let made = chosen.into_par_iter().with_max_len(1).map(|listed| {
        let it = make(listed.it);
        done();
        Listed {
            number: listed.number,
            title: listed.title,
            it,
        }
    });
    made.collect()
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
        let table = |table: &Listed<Grid>| json!({"table": table.number, "title": table.title, "rows": table.it.lines().collect::<Vec<_>>()});
        let series = |chart: &Chart| {
            let series = chart.series.iter();
            series
                .map(|s| json!({"name": s.name, "points": s.points}))
                .collect::<Vec<_>>()
        };
        let figure = |figure: &Listed<Chart>| {
            let chart = &figure.it;
            let chart = json!({"title": chart.title, "x": chart.x.label, "y": chart.y.label, "series": series(chart)});
            json!({"figure": figure.number, "title": figure.title, "charts": [chart]})
        };
        let measurement = |result: &Listed<measured::Study>| {
            let tables = result.tables().map(|(_, title, grid)| {
                json!({"title": title, "rows": grid.lines().collect::<Vec<_>>()})
            });
            json!({
                "measurement": result.number,
                "title": result.title,
                "notes": result.it.notes,
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
        assert_eq!(Selection::all().claims, (1..=28).collect::<Vec<_>>());
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
