//! The thesis's published figures beside ours: claims with verdicts, tables, figures, and the page that shows them.
//!
//! ```text
//!   CLAIMS ─► rows: published, computed, verdict ─┐
//!   TABLES ─► grids ──────────────────────────────┼─► terminal, JSON, Markdown, HTML, SVG and CSV
//!   FIGURES ─► charts ────────────────────────────┤
//!   MEASUREMENTS ─► the chip against its theory ──┘
//! ```
//!
//! What the thesis prints and what is said of it is data, in `thesis.toml`; the files here compute a number for each of its rows. A new
//! row is a line there, and its name with a number in the claim's function.
//!
//! A claim that the model must meet and does not is a fault, and `gdtof reproduce` fails. One that no honest
//! convention meets says so and why; it is never bent. Where the thesis's convention and the physically right one
//! part, both are shown.

mod chip;
mod claim;
mod delay_line;
mod demonstrator;
mod design;
mod guided_bins;
mod hslidar_modes;
mod libraries;
pub mod measured;
mod page;
mod parameters;
mod penalty;
mod photon_budget;
mod precision;
mod published;
mod registry;
mod report;
mod selection;
mod sensors;
mod silicon;
mod stereo;
mod system;
mod thesis;

pub use claim::{Claim, ClaimRow, Verdict, between_quotes, overall};
pub use libraries::libraries;
pub use page::heading;
pub use page::{SLIPS_TITLE, grid, html, markdown, slips as slips_grid, tally};
pub use published::Published;
pub use registry::{CLAIMS, FIGURES, MEASUREMENTS, NumberedItem, TABLES};
pub use report::{ClaimResult, Report, reproduce};
pub use selection::{NothingThere, Part, Selection};
pub use thesis::Slip;
