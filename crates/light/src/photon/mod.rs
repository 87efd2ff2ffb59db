//! Light and the SPADs that see it: photon budget (thesis 3.2.1), sunlight, lens and filter, dead time,
//! and the random-access photon stream that drives every engine.

mod avalanches;
mod budget;
mod echo;
mod gaussian;
mod light;
mod mixture;
mod optics;
pub mod philox;
mod pulse;
mod pulses;
mod quantile;
mod random;
pub mod solar;
mod spad;
mod spad_grid;
mod spad_layout;
mod spad_rows;
mod stream;
mod tail;

pub use avalanches::{Avalanches, apply_dead_time};
pub use budget::{Convention, PhotonBudget, Spot};
pub use echo::{ECHO_REACH, EchoLaw};
pub use gaussian::{pulse_share, pulse_shares};
pub use light::{
    Echo, LightError, MeanLight, OtherLaser, PixelLight, Profile, PulseTrain, Segment, SpadSpread,
};
pub use mixture::{DEEP, Glint, MERGED_ERROR, NEGLIGIBLE, merged};
pub use optics::{Atmosphere, Filter, FilterShape, LaserDrift, Lens};
pub use philox::LANES;
pub use pulse::{PulseError, PulseShape};
pub use pulses::PixelPhotons;
pub use quantile::{NormalSampler, RANKS};
pub use random::{Poisson, RandomPurpose, normal, philox_key, random_stream};
pub use spad::{
    AFTERPULSE_REACH, CROSSTALK_DELAY, DeadTimeLaw, MOST_SPREAD, Photon, SpadEvent, SpadModel,
    Unknown, sort_photons,
};
pub use spad_grid::{MOST_SPADS, SIDES, SpadGrid, count_bits};
pub use spad_layout::SpadLayout;
pub use spad_rows::SpadRows;
pub use stream::{
    BackgroundBlock, CycleGroup, Draw, GROUP, GroupPlace, LightParts, ListedEchoes, NEVER_FS,
    OrderedEchoes, PER_BLOCK, PLACE_BITS, PhotonStream, PixelStream, SlotRun, Slots, Span,
    StreamConfig, TILE, TIME_BITS, signal_rank, spad_of,
};
pub use tail::{DiffusionTail, EchoWidth, TAIL_REACH, late_edge};
