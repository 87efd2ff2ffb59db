//! Settings that a user writes: TOML files and `--set`, read against tables of their keys.
//!
//! ```text
//!   file ─► Document ◄─ --set key=value         Key: unit, range, source
//!              └──► quantities to plain numbers ─► types ─► ranges ─► struct, or all faults at once
//! ```
//!
//! A key's table says its unit, its range and where its default comes from, once: for reading, for rules, and for the
//! commented file that `commented` prints.

mod document;
mod key;
mod print;
mod quantity;
mod schema;

pub use document::{Document, Fault};
pub use key::{Key, Range};
pub use print::Section;
pub(crate) use print::commented;
pub(crate) use schema::schema;
