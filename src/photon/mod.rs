//! Light and the SPADs that see it: photon budget (thesis 3.2.1), dead time, and the
//! random-access photon stream that drives every engine.

mod budget;
mod gaussian;
mod random;
mod spad;
mod stream;

pub use budget::{Convention, PhotonBudget};
pub use gaussian::{PulseEdge, pulse_share};
pub use random::{Poisson, Purpose, normal, random_stream};
pub use spad::{SPADS, SpadEvent, apply_dead_time};
pub use stream::{PhotonStream, PixelLight, PixelPhotons, PixelStream, StreamConfig};
