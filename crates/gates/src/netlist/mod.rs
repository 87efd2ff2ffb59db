//! The one description of the chip: cells, nets and hierarchy, read by every engine and exporter.
//!
//! ```text
//!   ModuleBuilder ──finish──► Module (hierarchical, shared) ──elaborate──► Netlist (flat)
//!   JSON of Yosys ──────────────►│                                           │
//!                                └─► Verilog                                 └─► simulation kernels
//! ```
//!
//! A [`Module`] is written once and instantiated many times; [`Netlist::elaborate`] stamps it out
//! into flat arrays in time linear in the number of cells.

mod builder;
mod cell;
mod chain;
mod check_limits;
mod corner;
mod delay;
mod error;
mod flat;
mod id;
mod instance_limits;
mod library;
mod mismatch;
mod module;
mod own_delay;
mod requirements;
mod static_timing;
mod timing;
mod variation;

pub use builder::ModuleBuilder;
#[cfg(feature = "yosys")]
pub(crate) use builder::is_identifier;
pub(crate) use cell::next_state;
pub use cell::{CellKind, MAX_INPUTS, MAX_OUTPUTS};
pub use chain::Chain;
pub use check_limits::{CheckKind, CheckLimits, DataLimit};
pub use corner::{Corner, Delay, Edge};
pub use delay::{ArcDelay, CellDelays, DelayModel};
pub use error::NetlistError;
pub use flat::{FlatCell, Netlist, Scope};
pub use id::{CellId, NetId, ScopeId};
pub use instance_limits::{Control, InstanceLimits};
pub use library::{CellArcs, Library, TimingArc};
pub use mismatch::Mismatch;
pub use module::{Cell, Direction, Instance, Module, Net, Port, Signal};
pub use own_delay::OwnDelay;
pub use requirements::{Requirement, Requirements};
pub use static_timing::caused;
pub use static_timing::{Arrivals, Bound, Path, PathStep, StaticTiming, TimingLoop};
pub use timing::Timing;
pub use variation::{Conditions, derated_limits, varied, varied_as};
