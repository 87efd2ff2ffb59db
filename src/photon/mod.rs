//! Light and the SPADs that see it: photon budget (thesis 3.2.1), sunlight, lens and filter, dead time,
//! and the random-access photon stream that drives every engine.

mod budget;
mod optics;
mod random;
pub mod solar;
mod spad;
mod stream;

pub use budget::{Convention, PhotonBudget, Spot};
pub use optics::{Atmosphere, Filter, FilterShape, LaserDrift, Lens};
pub use random::{Poisson, Purpose, normal, random_stream};
pub use spad::{SPADS, SpadEvent, apply_dead_time};
pub use stream::{PhotonStream, PixelLight, PixelPhotons, PixelStream, StreamConfig};
