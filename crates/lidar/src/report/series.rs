//! What a chart shows: named rows of points, and how they are drawn.

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// A line through the points, in order.
    Line,
    /// A dashed line through the points, in order.
    Dashed,
    /// A dot at each point.
    Points,
    /// A stroke between every two points, for intervals; in the colour of the series before.
    Whiskers,
    /// A bar from zero (or the axis' least value) to each point, as wide as the spacing of the first two.
    Bars,
}

/// A named row of points.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name in the legend and the CSV.
    pub name: String,
    /// How it is drawn.
    pub style: Style,
    /// (x, y) in the axes' units.
    pub points: Vec<(f64, f64)>,
}
