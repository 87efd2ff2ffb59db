//! The guided system as a whole: camera pair, sensor and laser take one frame together.

mod frame;
pub mod pareto;
mod result;
mod speed;
pub mod stability;
mod tolerance;

pub use frame::{EngineKind, FrameError, FrameSettings, Probe, take_frame};
pub use result::{Frame, PhaseTimes, PixelDepth, Summary};
pub use speed::{SPEED_LASER_CYCLES, SpeedFrame};
pub use tolerance::{Kept, Tolerance};
