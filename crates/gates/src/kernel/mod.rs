//! The discrete event kernel: four-valued, integer femtoseconds, inertial or transport delays, total order.
//!
//! One instant is simulated in two phases. First every net change due at that femtosecond, from
//! the stimulus or from a cell, is applied; then every cell that saw a triggering change is
//! evaluated once, with all inputs new. A cell output that must change is scheduled one arc delay
//! later; a different value computed in the meantime cancels it (inertial delay), the same value
//! leaves it where it is. Cells can be given transport delays instead. Zero delays make further rounds of the two phases (delta cycles) within
//! the instant.
//!
//! ```text
//!   Stimulus ──┐              ┌─► Observer (waveforms, recorders)
//!              ├─► apply ─────┤    timing checks)
//!   TimeWheel ─┘   changes    └─► dirty cells ─► evaluate ─► schedule ─┐
//!       ▲                                                             │
//!       └─────────────────────────────────────────────────────────────┘
//! ```
//!
//! Because each phase is complete before the next begins, results do not depend on the order
//! of events within an instant. The exported Verilog cells keep the same two phases, so that other
//! simulators agree with this one, ties included. The hot loop neither allocates (buckets keep
//! their memory), nor hashes, nor touches a string.

mod activity;
mod check_banks;
mod check_judge;
mod check_report;
mod compiled;
mod lane_word;
mod lanes;
mod observer;
mod oscillation;
mod shift_banks;
mod simulation;
mod stimulus;
mod timing_checks;
mod trace_hash;
mod transport;
mod wheel;

pub use activity::{Activity, NetActivity};
pub use check_report::{
    BIN_WIDTH, BINS, CheckReport, CheckSummary, FIRST_BIN, Policy, SlackLocation, Violation,
};
pub use lane_word::{LANES, Lanes};
pub use lanes::{LaneDrive, LaneKernel, LaneObserver};
pub use observer::{Observer, Recorder};
pub use oscillation::Oscillation;
pub use simulation::{Kernel, Statistics};
pub use stimulus::{Drive, Stimulus, clock};
pub use timing_checks::TimingChecks;
pub use trace_hash::TraceHash;
