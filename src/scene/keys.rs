//! The keys of a scene file: units, ranges, sources.

mod lidar;
mod object;
mod stereo;
mod surroundings;

pub(super) use lidar::LIDAR;
pub(super) use object::OBJECT;
pub(super) use stereo::STEREO;
pub(super) use surroundings::{LIGHT, MEDIUM, RIG};

use crate::settings::{Range, Section};

/// Beyond a million metres the squares in the geometry lose the small lengths.
const FAR_M: f64 = 1e6;

const CHOSEN: &str = "chosen for the street";
const TABLE_12: &str = "thesis Table 12";
const LENGTH: Range = Range::Above(0.0, FAR_M);
const POSITION: Range = Range::Within(-FAR_M, FAR_M);
const SHARE: Range = Range::Within(0.0, 1.0);
const SPEED: Range = Range::Within(-1e4, 1e4);
const PLACES: Range = Range::Within(-FAR_M, FAR_M);

/// The sections of a scene file.
pub(super) const SECTIONS: &[Section] = &[
    Section {
        name: "lidar",
        what: "Laser, lens and SPADs of the lidar",
        keys: LIDAR,
    },
    Section {
        name: "stereo",
        what: "The camera pair that guides it",
        keys: STEREO,
    },
    Section {
        name: "light",
        what: "Sunlight",
        keys: LIGHT,
    },
    Section {
        name: "medium",
        what: "What is in the air",
        keys: MEDIUM,
    },
    Section {
        name: "rig",
        what: "Motion of lidar and cameras together; the scene is described at time 0",
        keys: RIG,
    },
    Section {
        name: "object",
        what: "What there is to see: as many objects as wanted, none if left out. Metres; x right, y down, z forward; the lidar is at the origin",
        keys: OBJECT,
    },
];
