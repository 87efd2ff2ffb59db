//! Sweeps: one row of results for each point of a study (`gdtof sweep`).
//!
//! ```text
//!   study.toml ──► Study ──► point i ──► settings ──► key ──┬─ row in a journal? ─► reused
//!                  (points are computed                     └─ else taken, on any thread ─► line of the journal
//!                   from their number)
//!   journals of all shards ──► table by points: CSV, Parquet, charts
//! ```
//!
//! | file | what |
//! |---|---|
//! | `study.rs` | what varies, over what, point by point; `study/reading.rs`: the study file |
//! | `keys.rs` | the names it may give values to |
//! | `values.rs` | lists and ranges |
//! | `design.rs` | grid, Latin hypercube, Sobol' sequence |
//! | `subject.rs` | a point's settings and what is made of them: a frame |
//! | `theory.rs` | or what theory says of a wall |
//! | `row.rs` | rows under keys, in journals |
//! | `run.rs` | takes what is missing, on all threads |
//! | `table.rs`, `parquet.rs` | the table |
//! | `plot.rs` | charts of its columns |
//!
//! **A point is kept under a key made of everything that its row depends on**: the sensor and the scene as read, the files that they name,
//! the request, the seed, and the program's version. So whatever is changed in a study, rows that it shares with what was there before
//! are reused, and no others. The journal is only appended to: a run that is killed loses the points that were being taken.
//!
//! What grows with the study is an index, of 16 bytes a row.

mod cell;
mod design;
mod error;
mod keys;
mod parquet;
mod plot;
mod row;
mod run;
mod study;
mod subject;
mod table;
mod theory;
mod values;

pub use cell::{Column, Holds, TableCell};
pub use design::SamplingDesign;
pub use error::SweepError;
pub use plot::{Drawing, Plot};
pub use row::StudyRow;
pub use run::{Outcome, Shard, run, study_of};
pub use study::{MOST_POINTS, Study, StudyKind};
pub use table::{CSV, PARQUET, Results, TIMES, WrittenTable, columns};
