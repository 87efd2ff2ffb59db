//! The sections of a scene file.

use super::entry::ObjectEntry;
use super::interferer::Interferer;
use super::medium::Medium;
use super::rig::Rig;
use super::settings::{Lidar, Light, Scene, Stereo};
use crate::settings::{Section, Settings};

impl Scene {
    /// The sections of a scene file.
    pub const SECTIONS: &'static [Section] = &[
        Section {
            name: "lidar",
            what: "Laser, lens and SPADs of the lidar",
            keys: Lidar::KEYS,
        },
        Section {
            name: "stereo",
            what: "The camera pair that guides the lidar",
            keys: Stereo::KEYS,
        },
        Section {
            name: "light",
            what: "Sunlight",
            keys: Light::KEYS,
        },
        Section {
            name: "medium",
            what: "What is in the air",
            keys: Medium::KEYS,
        },
        Section {
            name: "rig",
            what: "Motion of lidar and cameras together; the scene is described at time 0",
            keys: Rig::KEYS,
        },
        Section {
            name: "object",
            what: "What there is to see: any number of objects, none if left out. Metres; x right, y down, z forward; the lidar is at the origin",
            keys: ObjectEntry::KEYS,
        },
        Section {
            name: "interferer",
            what: "Lidars of other vehicles: any number, none if left out",
            keys: Interferer::KEYS,
        },
    ];
}
