//! `[light]`, `[medium]` and `[rig]`: sunlight, what is in the air, and how lidar and cameras move.

use super::{CHOSEN, LENGTH, PLACES, SHARE, SPEED};
use crate::settings::{Key, Range};

pub(in crate::scene) const LIGHT: &[Key] = &[
    Key::new(
        "illuminance_klux",
        "klux",
        Range::Limited(
            0.0,
            200.0,
            "the sun with bright clouds about it stays below 150 klux",
        ),
        "Illuminance of the scene by the sun",
        CHOSEN,
    ),
    Key::new(
        "sun_elevation_deg",
        "deg",
        Range::Within(-90.0, 90.0),
        "Height of the sun above the horizon, for shadows and slopes; light from everywhere if left out",
        "thesis Eq. 16, where surfaces face the sun",
    ),
    Key::new(
        "sun_azimuth_deg",
        "deg",
        Range::Within(-360.0, 360.0),
        "Where the sun stands, to the right of forward",
        "chosen",
    ),
    Key::new(
        "sky_share",
        "",
        SHARE,
        "Share of the illuminance that comes from the sky, where the sun has a place",
        "chosen: a clear day; 1 is an overcast one",
    ),
    Key::new(
        "sky_reflectivity",
        "",
        Range::Within(0.0, 10.0),
        "What a surface in the sun's light would reflect to be as bright as the sky",
        "chosen: a clear sky in the near infrared; haze is brighter",
    ),
];

pub(in crate::scene) const MEDIUM: &[Key] = &[
    Key::new(
        "extinction_1_m",
        "1/m",
        Range::Within(0.0, 10.0),
        "Share of light that fog takes away per metre: 3.912 over the visibility",
        "clear air; Koschmieder's law",
    ),
    Key::new(
        "backscatter_1_m_sr",
        "1/m/sr",
        Range::Within(0.0, 10.0),
        "Share of light that fog sends straight back; extinction over 18.8 sr if left out",
        "O'Connor, Illingworth and Hogan 2004, droplets at 905 nm",
    ),
    Key::new(
        "rain_mm_h",
        "mm/h",
        Range::Within(0.0, 500.0),
        "Rain, which weakens light and sends none back",
        "ITU-R P.1814: 1.076 R^0.67 dB/km",
    ),
    Key::new(
        "overlap_m",
        "m",
        LENGTH,
        "Nearest fog that the laser lights up and the macropixels see",
        "chosen: laser and lens stand side by side",
    ),
];

pub(in crate::scene) const RIG: &[Key] = &[
    Key::new(
        "velocity_m_s",
        "m/s",
        SPEED,
        "Velocity of lidar and cameras in the world, [right, down, forward] of how they look at time 0",
        "at rest",
    ),
    Key::new(
        "yaw_rate_deg_s",
        "deg/s",
        Range::Within(-3600.0, 3600.0),
        "How fast they turn to the right",
        "at rest",
    ),
    Key::new(
        "waypoints",
        "",
        PLACES,
        "Where they are at what time, straight between: a list of [s, m right, m down, m forward, degrees to the right]",
        "none",
    ),
];
