//! What comes out: pictures, charts, arrays, tables and the verdicts of testbenches.

mod array;
mod canvas;
mod chart;
mod cloud;
mod colour;
mod grid;
mod image;
mod legend;
mod mcap;
mod npz;
mod pattern;
pub(crate) mod picture;
mod series;
mod table;
mod verdicts;

pub(crate) use array::write_depth_png;
pub(crate) use array::{NpyStack, write_npy_f32, write_npy_u16};
pub use chart::{Axis, Chart, Scale};
pub(crate) use cloud::{CloudPoint, FLOATS, SHORTS, write_pcd, write_ply};
#[cfg(test)]
pub(crate) use colour::lightness;
pub use colour::{DEPTH_COLOURS, Rgb};
pub use grid::{Grid, width};
pub(crate) use grid::{aligned, quoted};
pub use image::{DepthImage, ImageCell};
pub(crate) use mcap::{Channel, Mcap};
pub(crate) use npz::Npz;
pub(crate) use pattern::SMALLEST_TILED_CELL_PX;
pub use pattern::{Category, Pattern};
pub use series::{Series, Style};
pub use table::Table;
pub use verdicts::Checks;
