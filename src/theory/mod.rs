//! Chapter 3 of the thesis in formulas, and what follows from it for a design.

pub mod capacity;
pub mod design;
