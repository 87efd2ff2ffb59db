//! What is chosen, reproduced: claims with their rows, tables, figures and measurements.

use rayon::prelude::*;
use serde_json::{Value, json};

use super::claim::{Claim, ClaimRow, Verdict, overall};
use super::measured;
use super::registry::{self, CLAIMS, FIGURES, MEASUREMENTS, NumberedItem, TABLES};
use super::selection::Selection;
use super::thesis::{self, Slip, THESIS};
use crate::report::{Chart, Grid};

/// A claim and its rows.
pub struct ClaimResult {
    /// The claim.
    pub claim: Claim,
    /// Its comparisons.
    pub rows: Vec<ClaimRow>,
}

impl NumberedItem<Chart> {
    /// The file's name without extension.
    pub fn file(&self) -> String {
        format!("fig_{:03}", self.number)
    }
}

impl NumberedItem<measured::MeasuredStudy> {
    /// File names without extension, each with its table.
    pub fn tables(&self) -> impl Iterator<Item = (String, &'static str, &Grid)> {
        let lettered = self.it.grids.iter().zip('a'..);
        lettered.map(|((title, grid), letter)| {
            (format!("measured_{}{letter}", self.number), *title, grid)
        })
    }

    /// File names without extension, each with its chart.
    pub fn files(&self) -> impl Iterator<Item = (String, &Chart)> {
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
    pub tables: Vec<NumberedItem<Grid>>,
    /// Figures.
    pub figures: Vec<NumberedItem<Chart>>,
    /// Measurements of the chip.
    pub measurements: Vec<NumberedItem<measured::MeasuredStudy>>,
}

/// Computes what is chosen, on all threads; `done` is told of each claim, table, figure and measurement as it is finished.
pub fn reproduce(selection: &Selection, done: impl Fn() + Sync) -> Report {
    let frames = selection.frames.unwrap_or(measured::FRAMES);
    let claims = || {
        let made = make_numbered(&CLAIMS, &selection.claims, &done, |rows| rows());
        let made = made.into_iter().map(|NumberedItem { number, title, it }| {
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
    let tables = || make_numbered(&TABLES, &selection.tables, &done, |grid| grid());
    let figures = || make_numbered(&FIGURES, &selection.figures, &done, |chart| chart());
    let study = |measure: registry::Measure| measure(frames).expect("what the engines run");
    let measurements = || make_numbered(&MEASUREMENTS, &selection.measurements, &done, study);
    let ((claims, tables), (figures, measurements)) = rayon::join(
        || rayon::join(claims, tables),
        || rayon::join(figures, measurements),
    );
    let slips = if claims.len() == CLAIMS.len() {
        THESIS.slips.clone()
    } else {
        Vec::new()
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
fn make_numbered<F: Copy + Sync, T: Send>(
    all: &[NumberedItem<F>],
    numbers: &[u32],
    done: &(impl Fn() + Sync),
    make: impl Fn(F) -> T + Sync,
) -> Vec<NumberedItem<T>> {
    let chosen = all.iter().filter(|listed| numbers.contains(&listed.number));
    let chosen: Vec<&NumberedItem<F>> = chosen.collect();
    let made = chosen.into_par_iter().with_max_len(1).map(|listed| {
        let it = make(listed.it);
        done();
        NumberedItem {
            number: listed.number,
            title: listed.title,
            it,
        }
    });
    made.collect()
}

impl Report {
    /// The rows of all claims.
    pub fn rows(&self) -> impl Iterator<Item = &ClaimRow> {
        self.claims.iter().flat_map(|result| &result.rows)
    }

    /// Rows that leave their tolerance although they are expected to hold, with the number of their claim.
    pub fn failures(&self) -> Vec<(u32, &ClaimRow)> {
        let rows = self
            .claims
            .iter()
            .flat_map(|result| result.rows.iter().map(|row| (result.claim.number, row)));
        rows.filter(|(_, row)| row.verdict() == Verdict::Fails)
            .collect()
    }

    /// Everything for a machine to read. Numbers that are not finite become null.
    pub fn json(&self) -> Value {
        let row = |row: &ClaimRow| {
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
        let table = |table: &NumberedItem<Grid>| json!({"table": table.number, "title": table.title, "rows": table.it.lines().collect::<Vec<_>>()});
        let series = |chart: &Chart| {
            let series = chart.series.iter();
            series
                .map(|s| json!({"name": s.name, "points": s.points}))
                .collect::<Vec<_>>()
        };
        let figure = |figure: &NumberedItem<Chart>| {
            let chart = &figure.it;
            let chart = json!({"title": chart.title, "x": chart.x.label, "y": chart.y.label, "series": series(chart)});
            json!({"figure": figure.number, "title": figure.title, "charts": [chart]})
        };
        let measurement = |result: &NumberedItem<measured::MeasuredStudy>| {
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
