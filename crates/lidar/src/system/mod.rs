//! The guided system as a whole: camera pair, sensor and laser take one frame together.

mod aim;
mod calibrate;
mod circumstances;
mod depth_scale;
mod distance;
mod drive;
mod error;
mod frame;
mod light;
mod load;
mod lost_peaks;
mod no_depth_pattern;
pub mod pareto;
mod pixel;
mod policy;
pub mod price;
mod ranger;
mod remark;
mod reports;
mod reranged;
mod result;
mod settings;
mod shared;
mod speed;
mod step_and_lock;
mod stopwatch;
mod summary;
mod swept_edges;
mod taken;
mod tolerance;
mod worlds;

pub use calibrate::{BinCalibration, BinSweepError, Sweep, calibrate};
pub use depth_scale::{drive_scale_m, frame_scale_m};
pub use distance::DistanceLaw;
pub use drive::{
    DriveFrame, DriveReuse, DriveSettings, DriveSimulation, FrameClock, FrameTimes, Noise,
};
pub use error::FrameError;
pub(crate) use frame::take_shared_frame;
pub use frame::{take_frame, take_frame_by, take_guided_frame};
pub use light::photon_stream;
pub use pixel::{DepthReturn, DepthReturns, NoDepth, PixelDepth, RETURNS, point_cloud};
pub use policy::{NoBins, Pointing, Unguided, Why, WindowPolicy};
pub use ranger::{PixelContext, Ranger, Reading, check_counts, range_counts};
pub use remark::DepthHint;
pub(crate) use reports::FrameArray;
pub use reports::{
    DriveConfiguration, DriveLine, DriveResult, DriveTotals, ExposureReport, FrameConfiguration,
    FrameResult, RunReport, WrittenExposure,
};
pub use reranged::ArrayDepths;
pub use result::{Frame, PhaseTimes};
pub use settings::{EngineKind, FrameSettings, GateProbe};
pub(crate) use shared::SharedWork;
pub use speed::{SPEED_LASER_CYCLES, SpeedCase, SpeedFrame};
pub use step_and_lock::{LockOptions, LockState, StepAndLock, Tracker};
pub use summary::{FrameSummary, median};
pub(crate) use taken::ReadExposure;
pub use taken::{TakenFrame, TakenPixel, TakenSettings};
pub use tolerance::{OnWindow, Tolerance, ToleranceResult};
