//! The guided system as a whole: camera pair, sensor and laser take one frame together.

mod aim;
mod calibrate;
mod distance;
mod drive;
mod frame;
pub mod pareto;
mod pixel;
mod policy;
pub mod price;
mod ranger;
mod remark;
mod reranged;
mod result;
mod speed;
mod step_and_lock;
mod stopwatch;
mod summary;
mod taken;
mod tolerance;

pub use calibrate::{Calibrated, Sweep, SweepError, calibrate};
pub use distance::DistanceLaw;
pub use drive::{Drive, DriveFrame, DriveSettings, FrameClock, FrameTimes, Noise, Reused};
pub use frame::{
    EngineKind, FrameError, FrameSettings, Probe, take_frame, take_frame_by, take_guided_frame,
};
pub(crate) use pixel::above_background;
pub use pixel::{NoDepth, PixelDepth};
pub use policy::{POLICY_KEYS, Pointing, Unguided, Why, WindowPolicy, share_held};
pub(crate) use ranger::{Known, Ranger};
pub use ranger::{Reading, range_counts};
pub use reranged::Ranged;
pub use result::{Frame, PhaseTimes};
pub use speed::{SPEED_LASER_CYCLES, SpeedCase, SpeedFrame};
pub use step_and_lock::{LockOptions, LockState, StepAndLock, Tracker};
pub use summary::Summary;
pub use taken::{TakenFrame, TakenPixel};
pub use tolerance::{Kept, OnWindow, Tolerance};
