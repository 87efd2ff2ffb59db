//! What comes out: pictures, charts, arrays, tables and the verdicts of testbenches.

mod array;
mod canvas;
mod chart;
mod colour;
mod grid;
mod image;
mod legend;
mod table;
mod verdicts;

pub use array::write_npy_u16;
pub use chart::{Axis, Chart, Scale, Series, Style};
pub use grid::{Grid, aligned, width};
pub use image::{Cell, DepthMap};
pub use table::Table;
pub use verdicts::Checks;
