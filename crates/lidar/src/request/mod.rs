//! What a user asks for, read and checked: a sensor and a scene by name, file and single keys, and a frame of them.
//!
//! ```text
//!   names, files, KEY=VALUE ──► Sources ──► Sensor, Scene ───────┐
//!   counts, engine, guides ───► FrameRequest ────────────────────┴─► FrameSettings, WindowPolicy
//!   a Frame of them ──────────────────────────────► FrameReport ───► frame.json, histograms.npy, depth.png
//! ```
//!
//! The command line, sweeps and Python all take this road, so that the same request has the same numbers whichever way it
//! comes. What complaints call a setting is the [`Spelling`] of the way it came.

mod frame;
mod frame_files;
mod light;
mod sources;
mod spelling;
mod wording;

pub use self::frame::{FrameRequest, check_drive_times, check_false_alarm_rate, read_calibration};
pub use self::frame_files::{
    FrameReport, eye_safety_of, frame_s, variance_left_out_of, write_frame,
};
pub use self::light::LightRequest;
pub use self::sources::Sources;
pub(crate) use self::sources::scene_key_named;
pub(crate) use self::sources::{ReadAs, refuse_other_kind};
pub use self::spelling::Spelling;
pub use self::wording::{exposure, guided_exposure, is_bad_input, of_engine, of_no_aim, sentence};
