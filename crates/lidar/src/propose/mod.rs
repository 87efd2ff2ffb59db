//! Which chip to build: designs of chip, laser and guide that find and measure a target, and the best of them (`gdtof propose`).
//!
//! ```text
//!   Goal ──► Problem ──┬─► every design of a Space, by theory ──► front ──► static timing ──► `cohort` ──► front
//!   sensor, scene ─────┘        │                                                                            ├─► one at the gates
//!                               └─► the sensor itself, on the front or beaten by a point of it ──────────────┘
//! ```
//!
//! | file | what |
//! |---|---|
//! | `goal.rs` | what is asked, and over what |
//! | `point.rs` | a design, and what it costs |
//! | `problem.rs` | designs by theory |
//! | `echo.rs` | what a macropixel sees of the target, and how many laser cycles that takes |
//! | `front.rs` | which of many nothing beats |
//! | `search.rs` | all designs, and what is wrong where none will do |
//! | `check.rs` | designs on `cohort`, and at the gates |
//! | `confirm.rs` | the front of those that the check confirms |
//!
//! Theory here is what depths are found by: the mean histogram of an echo with its dead time and THRESHOLD
//! ([`Response`](crate::ranging::Response)), the power of the test that a depth has to pass ([`Scan::power`](crate::theory::significance::Scan::power)), Fisher's
//! information of its place, and the share of guided windows that hold it ([`share_inside`](crate::theory::design::share_inside)).

mod check;
mod confirm;
mod echo;
mod front;
mod goal;
mod point;
mod problem;
mod search;
#[cfg(test)]
mod tests;

pub use check::{Check, gates_agree};
pub use confirm::ConfirmedDesign;
pub use front::{dominates, front};
pub use goal::{Choice, Goal, Space};
pub use point::{Candidate, ChipDesign, Costs, DesignPoint, Limit, NotFound};
pub use problem::Problem;
pub use search::{Own, SearchResult, SearchStep, search};
