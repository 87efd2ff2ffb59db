//! Settings that a user writes: TOML files and `--set`, read against tables of their keys.
//!
//! ```text
//!   file ─► Document ◄─ --set key=value         Key: unit, range, source
//!              └──► quantities to plain numbers ─► types ─► ranges ─► struct, or all faults at once
//! ```
//!
//! A struct of settings is declared by [`keys!`](crate::keys), a word of them by [`words!`](crate::words): each key stands once, with its
//! unit, its range, its default and where that comes from, for reading, for rules, and for the commented file that `commented` prints.

mod assignment;
mod declare;
mod document;
mod key;
mod notes;
mod print;
mod quantity;
mod remarks;
mod schema;

pub use crate::{keys, words};
pub use assignment::Assignment;
pub use declare::{Setting, Settings, help};
pub use document::{Document, Fault};
pub use key::{Key, Range};
pub use notes::Notes;
pub use print::Section;
pub use print::commented;
pub use remarks::{remarks, said_remarks};
pub use schema::schema;
