//! Any column of a table against any other, as a chart.

use std::collections::BTreeMap;

use super::cell::{Column, Holds, TableCell};
use super::study::Study;
use crate::files::InputError;
use crate::report::{Axis, Chart, Style};

/// Series that a chart tells apart.
const MOST_SERIES: usize = 12;

/// Which columns are drawn.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plot {
    /// Along.
    pub x: String,
    /// Upwards.
    pub y: String,
    /// What tells series apart, if anything.
    pub series: Option<String>,
}

impl Plot {
    /// From `x,y` or `x,y,series`.
    pub fn parse(text: &str) -> Option<Self> {
        let mut parts = text.split(',').map(|part| part.trim().to_owned());
        let plot = Plot {
            x: parts.next()?,
            y: parts.next()?,
            series: parts.next(),
        };
        parts.next().is_none().then_some(plot)
    }

    /// Name of its files, without an extension.
    pub fn file_name(&self) -> String {
        let plain = |c: char| {
            if c.is_alphanumeric() || "._-".contains(c) {
                c
            } else {
                '_'
            }
        };
        let series = self.series.iter().map(|series| format!("_by_{series}"));
        let name = format!("{}_over_{}{}", self.y, self.x, series.collect::<String>());
        name.chars().map(plain).collect()
    }
}

/// What has been seen of the columns of a plot.
pub struct Drawing<'a> {
    plot: &'a Plot,
    columns: [usize; 2],
    /// Number of the column of series, and its words.
    series_column: Option<(usize, String)>,
    x: Column,
    y: Column,
    is_log: bool,
    /// By series, and in it by x.
    series: BTreeMap<String, BTreeMap<Order, ValueStatistics>>,
}

/// Values at one x.
#[derive(Debug, Clone, Copy)]
struct ValueStatistics {
    sum: f64,
    count: u64,
    least: f64,
    most: f64,
}

impl ValueStatistics {
    const NOTHING: ValueStatistics = ValueStatistics {
        sum: 0.0,
        count: 0,
        least: f64::INFINITY,
        most: f64::NEG_INFINITY,
    };

    fn mean(&self) -> f64 {
        self.sum / self.count as f64
    }
}

/// Numbers in their order.
#[derive(Debug, Clone, Copy)]
struct Order(f64);

impl PartialEq for Order {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Order {}

impl PartialOrd for Order {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Order {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl<'a> Drawing<'a> {
    /// Of columns of a study's table; `option` is what complaints call the wish.
    ///
    /// # Errors
    /// When there are no such columns, or they hold no numbers.
    pub fn new(
        plot: &'a Plot,
        study: &Study,
        columns: &[Column],
        option: &str,
    ) -> Result<Self, InputError> {
        let find = |name: &str| {
            columns
                .iter()
                .position(|column| column.name == name)
                .ok_or_else(|| {
                    let names: Vec<&str> =
                        columns.iter().map(|column| column.name.as_str()).collect();
                    let message = format!(
                        "{name:?} is not a column; give two or three of {}",
                        names.join(", ")
                    );
                    InputError::new(option, message)
                })
        };
        let number = |name: &str| {
            let column = find(name)?;
            match columns[column].holds {
                Holds::Whole | Holds::Number => Ok(column),
                _ => {
                    let message = format!(
                        "{name} holds no numbers, so it cannot be an axis; give it as the series, the third column"
                    );
                    Err(InputError::new(option, message))
                }
            }
        };
        let (x, y) = (number(&plot.x)?, number(&plot.y)?);
        let series_column = plot.series.as_deref().map(find).transpose()?;
        let series_column = series_column.map(|column| (column, columns[column].label()));
        Ok(Drawing {
            plot,
            columns: [x, y],
            series_column,
            x: columns[x].clone(),
            y: columns[y].clone(),
            is_log: study.is_log(&plot.x),
            series: BTreeMap::new(),
        })
    }

    /// Sees a row.
    pub fn add_row(&mut self, cells: &[TableCell]) {
        let [x, y] = self.columns;
        let (Some(x), Some(y)) = (cells[x].number(), cells[y].number()) else {
            return;
        };
        if !(x.is_finite() && y.is_finite()) {
            return;
        }
        let name = match self
            .series_column
            .as_ref()
            .map(|(column, _)| &cells[*column])
        {
            None => String::new(),
            Some(TableCell::Number(x)) => x.to_string(),
            Some(other) => other.csv(),
        };
        if self.series.len() > MOST_SERIES {
            return;
        }
        let at = self.series.entry(name).or_default();
        let seen = at.entry(Order(x)).or_insert(ValueStatistics::NOTHING);
        seen.sum += y;
        seen.count += 1;
        seen.least = seen.least.min(y);
        seen.most = seen.most.max(y);
    }

    /// The chart: a line through the mean at each x, with a stroke from the least to the greatest value where there are several; dots where
    /// hardly any two rows have one x, as in a design that draws its points.
    ///
    /// # Errors
    /// More series than a chart tells apart.
    pub fn chart(self, option: &str) -> Result<Chart, InputError> {
        if self.series.len() > MOST_SERIES {
            let series = self.plot.series.as_deref().unwrap_or_default();
            let message = format!(
                "{series} has more than {MOST_SERIES} values; give another column for the series"
            );
            return Err(InputError::new(option, message));
        }
        let all = || self.series.values().flat_map(BTreeMap::values);
        let (least, most) = all().fold((f64::INFINITY, 0.0f64), |(least, most), seen| {
            (least.min(seen.least), most.max(seen.most))
        });
        // A hundred to one is more than equal steps show.
        let y_is_log = least > 0.0 && most > 100.0 * least;
        let axis = |column: &Column, is_log| {
            if is_log {
                Axis::log(column.label())
            } else {
                Axis::linear(column.label())
            }
        };
        let mut title = format!("{} over {}", self.y.words(), self.x.words());
        if let Some(first) = title.get_mut(..1) {
            first.make_ascii_uppercase();
        }
        let axes = (axis(&self.x, self.is_log), axis(&self.y, y_is_log));
        let mut chart = Chart::new(title, axes.0, axes.1);
        for (name, at) in &self.series {
            let label = match &self.series_column {
                Some((_, series)) => format!("{series} = {name}"),
                None => String::new(),
            };
            let rows: u64 = at.values().map(|seen| seen.count).sum();
            let is_cloud = at.len() == 1 || (at.len() > 50 && rows < 2 * at.len() as u64);
            let style = if is_cloud { Style::Points } else { Style::Line };
            let means = at.iter().map(|(x, seen)| (x.0, seen.mean()));
            chart = chart.with_series(label, style, means);
            if rows > at.len() as u64 {
                let ends = at
                    .iter()
                    .map(|(x, seen)| [(x.0, seen.least), (x.0, seen.most)]);
                chart = chart.whiskers("", ends.flatten());
            }
        }
        Ok(chart)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::columns;
    use super::*;

    #[test]
    fn means_are_drawn_with_the_reach_of_what_they_are_of() {
        let text = "[study]\nkind = \"theory\"\n[vary]\ntheory.range_m = [1, 2]\ntheory.reflectivity = [0.1]\n";
        let study = Study::parse("s", text, Path::new(""), "s").unwrap();
        let columns = columns(&study);
        let plot = Plot::parse("theory.range_m, p_miss,theory.reflectivity").unwrap();
        let mut drawing = Drawing::new(&plot, &study, &columns, "--plot").unwrap();
        let p_miss = columns.iter().position(|c| c.name == "p_miss").unwrap();
        for (x, y) in [(2.0, 5.0), (1.0, 1.0), (2.0, 7.0), (1.0, f64::INFINITY)] {
            let mut cells = vec![TableCell::Empty; columns.len()];
            (cells[1], cells[2], cells[p_miss]) = (
                TableCell::Number(x),
                TableCell::Number(0.5),
                TableCell::Number(y),
            );
            drawing.add_row(&cells);
        }
        let chart = drawing.chart("--plot").unwrap();
        let series: Vec<_> = chart
            .series
            .iter()
            .map(|s| (s.style, &s.points[..]))
            .collect();
        let whiskers = [(1.0, 1.0), (1.0, 1.0), (2.0, 5.0), (2.0, 7.0)];
        assert_eq!(
            series,
            [
                (Style::Line, &[(1.0, 1.0), (2.0, 6.0)][..]),
                (Style::Whiskers, &whiskers)
            ]
        );
        assert_eq!(chart.series[0].name, "reflectivity = 0.5");
    }
}
