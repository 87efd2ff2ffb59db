//! What comes out: pictures, arrays and tables.

mod array;
mod canvas;
mod colour;
mod image;
mod table;

pub use array::write_npy_u16;
pub use image::depth_png;
pub use table::Table;
