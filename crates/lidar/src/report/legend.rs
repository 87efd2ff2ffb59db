//! How the series of a chart look, and the legend beneath it that says so.
//!
//! ```text
//!   ┌──────────── plot ────────────┐
//!   └──────────────────────────────┘
//!    ── first   - - second   ● third        as many to a row as fit; nothing of the plot is covered
//! ```

use plotters::coord::Shift;
use plotters::prelude::*;

use super::series::{Series, Style};

/// Colours of the series in turn; the first eight after Okabe and Ito, who chose them for the colour-blind.
const COLOURS: [RGBColor; 12] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(90, 90, 90),
    RGBColor(150, 120, 40),
    RGBColor(160, 0, 60),
    RGBColor(0, 0, 0),
    RGBColor(110, 170, 40),
    RGBColor(100, 60, 180),
];

/// Colour of a series, and the shape of its dots.
#[derive(Debug, Clone, Copy)]
pub(super) struct SeriesLook {
    /// Of everything drawn.
    pub colour: RGBColor,
    /// Which of the six shapes.
    shape: usize,
}

/// How each of `series` looks. Whiskers take the colour of the series before; dots change their shape each time.
pub(super) fn looks(series: &[Series]) -> impl Iterator<Item = SeriesLook> {
    let (mut coloured, mut dotted) = (0, 0);
    series.iter().map(move |series| {
        coloured += usize::from(series.style != Style::Whiskers);
        dotted += usize::from(series.style == Style::Points);
        SeriesLook {
            colour: COLOURS[coloured.saturating_sub(1) % COLOURS.len()],
            shape: dotted.saturating_sub(1) % 6,
        }
    })
}

impl SeriesLook {
    /// Corners of a dot, in pixels from its place.
    pub(super) fn outline(self) -> Vec<(i32, i32)> {
        match self.shape {
            0 => vec![
                (-2, -4),
                (2, -4),
                (4, -2),
                (4, 2),
                (2, 4),
                (-2, 4),
                (-4, 2),
                (-4, -2),
            ],
            1 => vec![(0, -6), (5, 4), (-5, 4)],
            2 => vec![(-4, -4), (4, -4), (4, 4), (-4, 4)],
            3 => vec![(0, -6), (5, 0), (0, 6), (-5, 0)],
            4 => vec![(0, 6), (5, -4), (-5, -4)],
            _ => {
                let arm = [(-1, -5), (1, -5), (1, -1), (5, -1), (5, 1), (1, 1)];
                let other = arm.map(|(x, y): (i32, i32)| (-x, -y));
                arm.into_iter().chain(other).collect()
            }
        }
    }
}

/// Pixels of a row, of a sample of a series, between entries, and of an average letter.
const ROW: u32 = 20;
const SAMPLE: i32 = 22;
const GAP: i32 = 20;
const LETTER: f64 = 7.0;

/// Pixels left of the first entry, and width of a row.
const LEFT: i32 = 30;
const WIDTH: i32 = 860;

/// The names of the series, row by row.
pub(super) struct Legend<'s> {
    entries: Vec<(&'s Series, SeriesLook, (i32, i32))>,
    rows: u32,
}

impl<'s> Legend<'s> {
    /// Lays out all series that have a name.
    pub(super) fn new(series: &'s [Series]) -> Self {
        let (mut x, mut row) = (LEFT, 0);
        let named = series.iter().zip(looks(series));
        let entries = named
            .filter(|(s, _)| !s.name.is_empty())
            .map(|(series, look)| {
                let letters = series.name.chars().count() as f64;
                let width = SAMPLE + (LETTER * letters) as i32 + GAP;
                if x > LEFT && x + width > WIDTH {
                    (x, row) = (LEFT, row + 1);
                }
                let place = (x, row * ROW as i32 + 4);
                x += width;
                (series, look, place)
            });
        let entries: Vec<_> = entries.collect();
        Legend {
            rows: if entries.is_empty() {
                0
            } else {
                row as u32 + 1
            },
            entries,
        }
    }

    /// Pixels that it takes.
    pub(super) fn height(&self) -> u32 {
        self.rows * ROW + if self.rows > 0 { 10 } else { 0 }
    }

    /// Draws it into an area of that height.
    pub(super) fn draw<'a>(
        &self,
        area: &DrawingArea<SVGBackend<'a>, Shift>,
    ) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>> {
        for &(series, look, (x, y)) in &self.entries {
            let middle = y + 8;
            let stroke = look.colour.stroke_width(2);
            let line =
                |from: i32, to: i32| PathElement::new([(from, middle), (to, middle)], stroke);
            match series.style {
                Style::Line => area.draw(&line(x, x + 18))?,
                Style::Dashed => {
                    area.draw(&line(x, x + 7))?;
                    area.draw(&line(x + 11, x + 18))?;
                }
                Style::Points => {
                    let dot = Polygon::new(look.outline(), look.colour.filled());
                    area.draw(&(EmptyElement::at((x + 9, middle)) + dot))?;
                }
                Style::Whiskers => {
                    area.draw(&PathElement::new([(x + 9, y + 2), (x + 9, y + 14)], stroke))?
                }
                Style::Bars => area.draw(&Rectangle::new(
                    [(x + 2, y + 2), (x + 16, y + 14)],
                    look.colour.mix(0.7).filled(),
                ))?,
            }
            area.draw(&Text::new(
                series.name.clone(),
                (x + SAMPLE, y + 1),
                ("sans-serif", 14),
            ))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(name: &str, style: Style) -> Series {
        Series {
            name: name.into(),
            style,
            points: Vec::new(),
        }
    }

    #[test]
    fn no_two_of_twelve_dotted_series_look_alike() {
        let all: Vec<Series> = (0..12)
            .map(|i| series(&i.to_string(), Style::Points))
            .collect();
        let mut seen: Vec<_> = looks(&all)
            .map(|l| (l.colour.0, l.colour.1, l.colour.2, l.shape))
            .collect();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 12);
    }

    #[test]
    fn whiskers_share_the_colour_of_what_they_belong_to() {
        let all = [
            series("a", Style::Line),
            series("b", Style::Points),
            series("", Style::Whiskers),
        ];
        let colours: Vec<RGBColor> = looks(&all).map(|l| l.colour).collect();
        assert!(colours[0] != colours[1] && colours[1] == colours[2]);
    }

    #[test]
    fn entries_stay_within_the_picture_and_apart() {
        let all: Vec<Series> = (0..14)
            .map(|i| series(&"name ".repeat(1 + i % 5), Style::Line))
            .collect();
        let legend = Legend::new(&all);
        assert_eq!(legend.entries.len(), 14);
        for pair in legend.entries.windows(2) {
            let ((a, _, (x, y)), (_, _, (next_x, next_y))) = (pair[0], pair[1]);
            let end = x + SAMPLE + (LETTER * a.name.chars().count() as f64) as i32;
            assert!(end < 900 && (next_y > y || next_x >= end));
        }
        assert_eq!(Legend::new(&[]).height(), 0);
    }
}
