//! SPAD pulses of a scene for any chip: the light of an exposure without a window and without a guide, and its pulses as files.
//!
//! ```text
//!   scene, SPADs, laser cycles ─► LightSource ─┬─► pulses of a macropixel, part by part ─► photons.csv, .npy: all in one file
//!   a frame that was taken ─────►              │                                         └► .txt, .mem, .vcd: a file each
//!                                              └─► means of its light ─► light.csv
//! ```
//!
//! The photons are those of the stream that every engine draws from ([`photon`](crate::photon)), so that an exposure of our own chip
//! has the pulses that its frame counts. Memory does not grow with the number of laser cycles.

mod lines;
mod source;
mod waves;
mod words;
mod write;

pub use source::{LightFacts, LightSource, LightSourceError, LitExposure, PulseTotals};
pub use write::{PulseFile, PulseFormat, PulseOptions, WrittenPulses, write_light, write_pulses};
