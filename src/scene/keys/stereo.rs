//! `[stereo]`: the camera pair.

use super::{CHOSEN, LENGTH, POSITION, TABLE_12};
use crate::settings::{Key, Range};

pub(in crate::scene) const STEREO: &[Key] = &[
    Key::new(
        "baseline_m",
        "m",
        LENGTH,
        "Distance from the principal (left) to the right camera",
        TABLE_12,
    ),
    Key::new(
        "focal_mm",
        "mm",
        Range::Above(0.0, f64::MAX),
        "Focal length of both lenses",
        TABLE_12,
    ),
    Key::new(
        "pixel_pitch_um",
        "um",
        Range::Above(0.0, f64::MAX),
        "Pixel pitch of both cameras",
        TABLE_12,
    ),
    Key::new(
        "width",
        "px",
        Range::Within(1.0, 16_384.0),
        "Columns of an image",
        TABLE_12,
    ),
    Key::new(
        "height",
        "px",
        Range::Within(1.0, 16_384.0),
        "Rows of an image",
        TABLE_12,
    ),
    Key::new(
        "disparity_sigma_px",
        "px",
        Range::Within(0.0, f64::MAX),
        "Standard deviation of the matched disparity",
        "thesis Fig. 68, where 1/3 px is overlaid",
    ),
    Key::new(
        "subpixel_steps",
        "",
        Range::Within(1.0, 65_536.0),
        "Disparities are multiples of one over this many pixels",
        "chosen: what semi-global matching gives",
    ),
    Key::new(
        "min_disparity_px",
        "px",
        Range::Above(0.0, f64::MAX),
        "Smallest disparity accepted",
        "thesis 5.2.1, an error below 10 % for a whole pixel",
    ),
    Key::new(
        "max_disparity_px",
        "px",
        Range::Above(0.0, f64::MAX),
        "Largest disparity searched",
        "chosen: the disparity at 15 m, where the thesis's rig begins to see",
    ),
    Key::new(
        "position_m",
        "m",
        POSITION,
        "Place of the principal camera, [right, down, forward] of the lidar",
        CHOSEN,
    ),
    Key::new(
        "yaw_error_deg",
        "deg",
        Range::Within(-45.0, 45.0),
        "By how much the right camera has turned outwards since calibration",
        "thesis Fig. 70; none",
    ),
    Key::new(
        "pitch_error_deg",
        "deg",
        Range::Within(-45.0, 45.0),
        "By how much it has turned upwards",
        "none",
    ),
    Key::new(
        "roll_error_deg",
        "deg",
        Range::Within(-45.0, 45.0),
        "By how much it has turned clockwise about its axis",
        "none",
    ),
    Key::new(
        "baseline_error_m",
        "m",
        Range::Within(-10.0, 10.0),
        "By how much it has moved outwards",
        "none",
    ),
    Key::new(
        "focal_error_percent",
        "",
        Range::Within(-50.0, 50.0),
        "By how much its focal length has grown, per cent",
        "none",
    ),
];
