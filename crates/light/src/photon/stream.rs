//! The photon stream: every avalanche of a macropixel in an exposure, drawn in any order.
//!
//! An exposure is a row of laser cycles. Cycle n spans the half-open time from `clock.periods(n · stop_periods)` to the
//! start of cycle n + 1; the laser fires at its start, with the rising edge of STOP. In each cycle a macropixel detects
//!
//! * a Poisson number of signal photons, spread around the arrival of the echo by the laser pulse and all jitter,
//! * a Poisson number of background photons and dark counts, uniform over the cycle,
//!
//! each on one of the macropixel's SPADs with equal chance. No echo is cut: what overruns its laser cycle, at either end, falls into
//! its neighbours ([`EchoLaw`](super::EchoLaw)). Only what comes before the first cycle or
//! after the last one is no photon.
//!
//! ```text
//!                  slot 0   slot 1   slot 2   …            a slot is a CLK period, or a 2ᵏ-th of a long one
//!   cycle 0      ┌────────┬────────┬────────┬──
//!   cycle 1      │ one    │        │        │             a group is 2048 laser cycles; the first are shorter, so
//!     …          │ draw   │        │        │             that a short exposure draws no long group: 128, 128, 256 …
//!   cycle 127    ├────────┼────────┼────────┼──
//!   cycle 128    │        │        │        │             background: one key per (macropixel, slot, group)
//!     …          │        │        │        │             signal:     one key per (macropixel, group)
//! ```
//!
//! The background photons of a cycle may begin a little before it ([`StreamConfig::lead`]), and then end as much before the
//! next one; none comes before the exposure.
//!
//! Macropixels in bright light are drawn by laser cycle instead (`bright`). Photons whose avalanches trigger others
//! ([`SpadModel`](super::SpadModel)) are a stream of their own: parts of a Poisson process chosen by chance are independent.
//!
//! The photons under one key are a pure function of (seed, macropixel, slot, group): their Poisson number is drawn
//! first, then each takes 32 random bits for its cycle, SPAD and time (a signal photon 64, and 128 more for a measured
//! pulse). So any part can be drawn on any thread in any order, and all see the same light. Only dead time,
//! afterpulses and crosstalk tie slots and cycles together; they are applied afterwards ([`Avalanches`](super::Avalanches)).
//!
//! Timing jitter of a SPAD displaces the points of a Poisson process, which leaves it one: jitter of background changes
//! nothing, and that of the signal is part of the pulse.
//!
//! Light that is a list ([`PixelLight`](super::PixelLight)) is drawn layer by layer: each is such a stream with a key of its own, in some laser
//! cycles. A profile, or SPADs that differ, are drawn at their greatest rate and thinned by a random word that is a pure
//! function of the photon's own (`thinning`); whatever SPADs there are, that leaves a Poisson process.
//!
//! Another laser's pulses ([`PulseTrain`](super::PulseTrain)) come at other times of each laser cycle; only those that are asked for are drawn
//! (`schedule`, `foreign`).
//!
//! Limits of the model: no spread of dead time between SPADs; background photons come at multiples of some 20 fs
//! ([`Slots`]).

mod bright;
mod dim;
mod draw;
mod exposure;
mod foreign;
mod group;
mod laser_cycles;
mod limits;
mod listed;
mod numbers;
mod ordered;
mod part;
mod schedule;
mod slot;
mod strays;

pub use bright::{BackgroundBlock, TILE, spad_of};
pub(super) use dim::{ByCycle, SPAD_SHIFT};
pub use draw::{Draw, PER_BLOCK, SlotRun};
pub use exposure::{PhotonStream, Span, StreamConfig};
pub use group::{CycleGroup, GROUP, GroupPlace, PLACE_BITS};
pub use listed::ListedEchoes;
pub use ordered::{NEVER_FS, OrderedEchoes};
pub use part::{LightParts, PixelStream, signal_rank};
pub use slot::{Slots, TIME_BITS};
