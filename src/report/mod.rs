//! What comes out: pictures, arrays, tables and the verdicts of testbenches.

mod array;
mod canvas;
mod checks;
mod colour;
mod image;
mod table;

pub use array::write_npy_u16;
pub use checks::Checks;
pub use image::depth_png;
pub use table::Table;
