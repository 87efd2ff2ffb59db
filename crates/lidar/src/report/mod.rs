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
pub mod picture;
mod series;
mod table;
mod verdicts;

pub use array::{NpyStack, write_depth_png, write_npy_f32, write_npy_u16};
pub use chart::{Axis, Chart, Scale};
pub use cloud::{CloudPoint, write_pcd, write_ply};
#[cfg(test)]
pub(crate) use colour::lightness;
pub use colour::{DEPTH_COLOURS, Rgb};
pub(crate) use grid::quoted;
pub use grid::{Grid, aligned, width};
pub use image::{DepthImage, ImageCell};
pub use mcap::{Channel, Mcap};
pub use npz::Npz;
pub(crate) use pattern::SMALLEST_TILED_CELL_PX;
pub use pattern::{Category, Pattern};
pub use series::{Series, Style};
pub use table::Table;
pub use verdicts::{CheckedValue, Checks};
