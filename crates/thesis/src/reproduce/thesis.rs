//! What the thesis prints and what is said of it, from `thesis.toml`: claims with their rows, tables, figures, slips and published
//! sensors. Code beside it computes a number for each row, and points for each chart.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use super::claim::ClaimRow;
use super::measured::MeasuredStudy;
use super::published::Published;
use crate::numerics::intervals::Estimate;
use crate::report::{Chart, Grid};

/// All of it.
pub(super) static THESIS: LazyLock<Thesis> = LazyLock::new(|| {
    let thesis = toml::from_str(include_str!("thesis.toml"));
    thesis.unwrap_or_else(|why| panic!("thesis.toml: {why}"))
});

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Thesis {
    pub claims: Vec<ClaimText>,
    pub tables: Vec<TableText>,
    pub figures: Vec<FigureText>,
    pub measurements: Vec<MeasurementText>,
    pub slips: Vec<Slip>,
    pub sensors: Vec<PublishedSensor>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ClaimText {
    pub number: u32,
    pub title: String,
    /// Section, equation, figure or table.
    pub source: String,
    /// By the names under which code computes them.
    pub rows: BTreeMap<String, RowText>,
}

/// All of a row but its number. What is said of other numbers that are computed stands in code.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RowText {
    what: String,
    #[serde(default)]
    unit: String,
    /// As [`Published::parse`] reads it.
    #[serde(default)]
    published: String,
    differs: Option<String>,
    given: Option<String>,
    #[serde(default)]
    aside: bool,
    #[serde(default)]
    remark: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TableText {
    pub number: u32,
    pub title: String,
    headings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FigureText {
    pub number: u32,
    pub title: String,
    /// Without its series; absent where the demonstrator's own chart is shown.
    chart: Option<Chart>,
}

/// A place where the thesis contradicts itself or physics, and what the model makes of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Slip {
    /// Section, equation, figure or table.
    pub place: String,
    /// What is printed there.
    pub printed: String,
    /// What it cannot stand beside.
    pub against: String,
    /// What the model does.
    pub model: String,
}

/// How a sensor makes do with its bins.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Scheme {
    /// All bins at once, or no histogram at all.
    Full,
    /// Zooming, with this number of steps.
    Zooming(u32),
    /// Sliding: the number of windows, and the bins that neighbours share.
    Sliding(u32, u32),
    /// One window that a guide chooses.
    Guided,
}

/// A line of Tables 5 and 16.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PublishedSensor {
    pub author: String,
    pub year: u32,
    /// Rows and columns of ToF pixels.
    pub pixels: (u32, u32),
    pub max_range_m: f64,
    pub bins: Option<u32>,
    pub scheme: Scheme,
    pub stacked: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MeasurementText {
    pub number: u32,
    pub title: String,
    /// `{frames}` and the like stand for numbers.
    notes: Vec<String>,
    tables: Vec<StudyTable>,
    /// Without its series.
    chart: Option<Chart>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StudyTable {
    title: String,
    /// Absent where they follow from what is measured.
    #[serde(default)]
    headings: Vec<String>,
}

/// The claim of this number.
///
/// # Panics
/// When there is none: the numbers in code are ours.
pub(super) fn claim(number: u32) -> &'static ClaimText {
    let claim = THESIS.claims.iter().find(|claim| claim.number == number);
    claim.unwrap_or_else(|| panic!("thesis.toml has no claim {number}"))
}

/// The empty table of this number, with its headings.
///
/// # Panics
/// When there is none.
pub(super) fn grid(number: u32) -> Grid {
    let table = THESIS.tables.iter().find(|table| table.number == number);
    let table = table.unwrap_or_else(|| panic!("thesis.toml has no table {number}"));
    Grid::new(&table.headings)
}

/// The empty chart of this figure.
///
/// # Panics
/// When there is none.
pub(super) fn chart(number: u32) -> Chart {
    let figure = THESIS.figures.iter().find(|f| f.number == number);
    let chart = figure.and_then(|figure| figure.chart.clone());
    chart.unwrap_or_else(|| panic!("thesis.toml has no chart {number}"))
}

/// The measurement of this number.
///
/// # Panics
/// When there is none.
pub(super) fn measurement(number: u32) -> &'static MeasurementText {
    let found = THESIS.measurements.iter().find(|m| m.number == number);
    found.unwrap_or_else(|| panic!("thesis.toml has no measurement {number}"))
}

impl MeasurementText {
    /// An empty table of its study, with its headings.
    pub(super) fn grid(&self, place: usize) -> Grid {
        Grid::new(&self.tables[place].headings)
    }

    /// The empty chart of its study.
    ///
    /// # Panics
    /// When it has none.
    pub(super) fn chart(&self) -> Chart {
        let chart = self.chart.clone();
        chart.unwrap_or_else(|| panic!("measurement {} has no chart", self.number))
    }

    /// The study with what was found, its notes filled with numbers.
    pub(super) fn study(
        &'static self,
        numbers: &[(&str, usize)],
        grids: [Grid; 2],
        chart: Option<Chart>,
    ) -> MeasuredStudy {
        let note = |note: &String| {
            let fill = |text: String, (name, number): &(&str, usize)| {
                text.replace(&format!("{{{name}}}"), &number.to_string())
            };
            numbers.iter().fold(note.clone(), fill)
        };
        let titles = self.tables.iter().map(|table| &*table.title);
        MeasuredStudy {
            notes: self.notes.iter().map(note).collect(),
            grids: titles.zip(grids).collect(),
            charts: chart.into_iter().collect(),
        }
    }
}

impl ClaimText {
    /// The row of this name with the number that the model gives.
    ///
    /// # Panics
    /// When the claim has no such row.
    pub(super) fn row(&'static self, name: &str, computed: f64) -> ClaimRow {
        let Some(text) = self.rows.get(name) else {
            panic!("claim {} of thesis.toml has no row {name}", self.number)
        };
        ClaimRow {
            published: Published::parse(&text.published),
            known_difference: text.differs.clone(),
            input: text.given.clone(),
            is_aside: text.aside,
            remark: text.remark.clone(),
            ..ClaimRow::ours(&text.what, &text.unit, computed)
        }
    }

    /// The same with a measured number, which chance has a part in.
    pub(super) fn measured(&'static self, name: &str, measured: &Estimate) -> ClaimRow {
        ClaimRow {
            interval: Some((measured.low, measured.high)),
            ..self.row(name, measured.value)
        }
    }
}
