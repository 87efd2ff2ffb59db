//! Charts as SVG, with their numbers as CSV beside them.
//!
//! One [`Chart`] holds the data and both outputs, so that a figure and its table cannot drift apart.

use std::io::Write;
use std::ops::Range;
use std::path::Path;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;
use serde::Deserialize;

use super::grid::quoted;
use super::legend::{self, looks};
use super::series::{Series, Style};
use crate::files::{InputError, OutputFile, begins_with, set_aside_foreign};

/// How an axis is divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Equal steps.
    #[default]
    Linear,
    /// Equal ratios; what is not above zero is left out.
    Log,
}

/// One axis: its label, with the unit, its scale, and its range where the data should not choose it.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Axis {
    /// Quantity and unit, for example `range (m)`.
    pub label: String,
    /// Linear or logarithmic.
    pub scale: Scale,
    /// Least and greatest value shown; `None` fits the data.
    pub range: Option<(f64, f64)>,
}

impl Axis {
    /// A linear axis that fits the data.
    pub fn linear(label: impl Into<String>) -> Self {
        Axis {
            label: label.into(),
            ..Axis::default()
        }
    }

    /// A logarithmic axis that fits the data.
    pub fn log(label: impl Into<String>) -> Self {
        Axis {
            scale: Scale::Log,
            ..Self::linear(label)
        }
    }

    /// The same axis from `least` to `greatest`.
    #[must_use]
    pub(crate) fn with_range(mut self, least: f64, greatest: f64) -> Self {
        self.range = Some((least, greatest));
        self
    }

    fn shows(&self, value: f64) -> bool {
        let visible = value.is_finite() && (self.scale == Scale::Linear || value > 0.0);
        visible
            && self
                .range
                .is_none_or(|(least, greatest)| (least..=greatest).contains(&value))
    }

    fn range_over(&self, values: impl Iterator<Item = f64>) -> Range<f64> {
        if let Some((least, greatest)) = self.range {
            return least..greatest;
        }
        let (least, greatest) = values
            .filter(|&v| self.shows(v))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
                (a.min(v), b.max(v))
            });
        match self.scale {
            _ if least > greatest => 1.0..10.0,
            Scale::Linear if least == greatest => least - 0.5..least + 0.5,
            Scale::Linear => {
                let margin = 0.04 * (greatest - least);
                least - margin..greatest + margin
            }
            Scale::Log => least / 1.2..greatest * 1.2,
        }
    }
}

/// A chart of one or more series over two axes.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Chart {
    /// What the chart shows.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// The data, in legend order.
    #[serde(skip)]
    pub series: Vec<Series>,
}

/// Size of a picture, pixels.
const SIZE: (u32, u32) = (900, 560);

impl Chart {
    /// An empty chart.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Chart {
            title: title.into(),
            x,
            y,
            series: Vec::new(),
        }
    }

    /// Adds a series and returns the chart, for chaining.
    #[must_use]
    pub(crate) fn with_series(
        mut self,
        name: impl Into<String>,
        style: Style,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        self.series.push(Series {
            name: name.into(),
            style,
            points: points.into_iter().collect(),
        });
        self
    }

    /// Adds a line through `points`, and returns the chart.
    #[must_use]
    pub fn line(
        self,
        name: impl Into<String>,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        self.with_series(name, Style::Line, points)
    }

    /// Adds a dashed line through `points`, and returns the chart.
    #[must_use]
    pub fn dashed(
        self,
        name: impl Into<String>,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        self.with_series(name, Style::Dashed, points)
    }

    /// Adds a dot at each of `points`, and returns the chart.
    #[must_use]
    pub fn points(
        self,
        name: impl Into<String>,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        self.with_series(name, Style::Points, points)
    }

    /// Adds a stroke between every two of `points`, and returns the chart.
    #[must_use]
    pub fn whiskers(
        self,
        name: impl Into<String>,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        self.with_series(name, Style::Whiskers, points)
    }

    /// Adds a bar to each of `points`, and returns the chart.
    #[must_use]
    pub fn bars(
        self,
        name: impl Into<String>,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        self.with_series(name, Style::Bars, points)
    }

    /// The chart as an SVG document.
    pub fn svg(&self) -> String {
        let mut text = String::new();
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        let xs = self.series.iter().flat_map(|s| &s.points).map(|p| p.0);
        let ys = self.series.iter().flat_map(|s| &s.points).map(|p| p.1);
        let (x, y) = (self.x.range_over(xs), self.y.range_over(ys));
        let drawn = match (self.x.scale, self.y.scale) {
            (Scale::Linear, Scale::Linear) => self.draw(&area, x, y),
            (Scale::Linear, Scale::Log) => self.draw(&area, x, y.log_scale()),
            (Scale::Log, Scale::Linear) => self.draw(&area, x.log_scale(), y),
            (Scale::Log, Scale::Log) => self.draw(&area, x.log_scale(), y.log_scale()),
        };
        drawn.expect("a string takes every drawing");
        drop(area);
        text.push('\n');
        text
    }

    fn draw<'a, X, Y>(
        &self,
        area: &DrawingArea<SVGBackend<'a>, Shift>,
        x: X,
        y: Y,
    ) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64>,
        Y::CoordDescType: ValueFormatter<f64>,
    {
        area.fill(&WHITE)?;
        let legend = legend::Legend::new(&self.series);
        let (plot, below) = area.split_vertically(SIZE.1 - legend.height());
        let mut chart = ChartBuilder::on(&plot)
            .caption(&self.title, ("sans-serif", 19))
            .margin(14)
            .x_label_area_size(46)
            .y_label_area_size(74)
            .build_cartesian_2d(x, y)?;
        // Ticks are sums of steps, and come to zero only nearly.
        let (wide, high) = (chart.x_range(), chart.y_range());
        let tick = |value: f64, scale: Scale, range: &Range<f64>| {
            let is_zero = value.abs() < 1e-9 * (range.end - range.start);
            short(if scale == Scale::Linear && is_zero {
                0.0
            } else {
                value
            })
        };
        chart
            .configure_mesh()
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .x_label_formatter(&|v| tick(*v, self.x.scale, &wide))
            .y_label_formatter(&|v| tick(*v, self.y.scale, &high))
            .light_line_style(WHITE)
            .label_style(("sans-serif", 14))
            .draw()?;
        let floor = chart.y_range().start.max(match self.y.scale {
            Scale::Linear => 0.0,
            Scale::Log => f64::MIN_POSITIVE,
        });
        for (series, look) in self.series.iter().zip(looks(&self.series)) {
            let colour = look.colour;
            let points: Vec<(f64, f64)> = series
                .points
                .iter()
                .copied()
                .filter(|p| self.x.shows(p.0) && self.y.shows(p.1))
                .collect();
            let stroke = colour.stroke_width(2);
            match series.style {
                Style::Line => chart.draw_series(LineSeries::new(points, stroke))?,
                Style::Dashed => chart.draw_series(DashedLineSeries::new(points, 7, 5, stroke))?,
                Style::Points => chart.draw_series(points.into_iter().map(|p| {
                    EmptyElement::at(p) + Polygon::new(look.outline(), colour.filled())
                }))?,
                Style::Whiskers => chart.draw_series(
                    points
                        .chunks_exact(2)
                        .map(|ends| PathElement::new(ends, colour.stroke_width(1))),
                )?,
                Style::Bars => {
                    let half = match points[..] {
                        [a, b, ..] => 0.5 * (b.0 - a.0).abs(),
                        _ => 0.5,
                    };
                    chart.draw_series(points.into_iter().map(|(x, y)| {
                        Rectangle::new([(x - half, floor), (x + half, y)], colour.mix(0.7).filled())
                    }))?
                }
            };
        }
        legend.draw(&below)?;
        area.present()
    }

    /// Writes the picture to `path` and its numbers, `series,x,y` a line, to the same name with `.csv`. A file of that name that has
    /// other columns is set aside.
    ///
    /// # Errors
    /// When one of the files cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), InputError> {
        let numbers = path.with_extension("csv");
        let svg = OutputFile::prepared(path, |out| out.write_all(self.svg().as_bytes()))?;
        let csv = OutputFile::prepared(&numbers, |out| self.write_csv(out))?;
        set_aside_foreign(&numbers, begins_with(&self.csv_headings()))?;
        svg.commit()?;
        csv.commit()
    }

    fn csv_headings(&self) -> String {
        let [x, y] = [&self.x, &self.y].map(|axis| quoted(&axis.label));
        format!("series,{x},{y}\n")
    }

    fn write_csv(&self, out: &mut dyn Write) -> std::io::Result<()> {
        out.write_all(self.csv_headings().as_bytes())?;
        for series in &self.series {
            for (x, y) in &series.points {
                writeln!(out, "{},{x},{y}", quoted(&series.name))?;
            }
        }
        Ok(())
    }
}

/// A number as short as four significant digits allow.
fn short(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 {
        "0".into()
    } else if !(1e-3..1e5).contains(&magnitude) {
        let text = format!("{value:.2e}");
        let (digits, exponent) = text.split_once('e').expect("exponent form");
        let digits = digits.trim_end_matches('0').trim_end_matches('.');
        format!("{digits}e{exponent}")
    } else {
        let decimals = (3 - libm::log10(magnitude).floor() as i32).max(0) as usize;
        let text = format!("{value:.decimals$}");
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(x: Axis, y: Axis) -> Chart {
        Chart::new("Squares & more", x, y)
            .line("x², <exact>", (0..20).map(|i| (i as f64, (i * i) as f64)))
            .points("dots", [(1.0, 2.0), (f64::NAN, 3.0), (4.0, f64::INFINITY)])
            .bars("bars", [(1.0, 2.0), (2.0, 8.0)])
            .dashed("", [(1.0, 1.0), (19.0, 300.0)])
    }

    #[test]
    fn every_pair_of_scales_is_drawn_and_text_is_escaped() {
        for x in [Axis::linear("x"), Axis::log("x")] {
            for y in [Axis::linear("y"), Axis::log("y").with_range(1.0, 1e3)] {
                let svg = chart(x.clone(), y).svg();
                assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
                assert!(svg.contains("Squares &amp; more") && svg.contains("&lt;exact&gt;"));
                assert!(!svg.contains("NaN") && !svg.contains("inf"));
            }
        }
        Chart::default().svg();
    }

    #[test]
    fn the_table_beside_the_picture_holds_every_point() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("squares.svg");
        chart(Axis::linear("x (m)"), Axis::log("y"))
            .write(&path)
            .unwrap();
        let csv = std::fs::read_to_string(path.with_extension("csv")).unwrap();
        assert!(csv.starts_with("series,x (m),y\n\"x², <exact>\",0,0\n"));
        assert_eq!(csv.lines().count(), 1 + 20 + 3 + 2 + 2);
    }

    #[test]
    fn labels_are_short() {
        let labels: Vec<String> = [0.0, 1.0, 0.25, 1234.5, 2e6, 1.5e-7, -40.0]
            .map(short)
            .into();
        assert_eq!(labels, ["0", "1", "0.25", "1234", "2e6", "1.5e-7", "-40"]);
    }
}
