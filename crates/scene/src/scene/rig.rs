//! Where objects and the rig (lidar and cameras) are at what time: waypoints, and the motion of the rig.

use glam::DVec3;

use super::words::{PLACES, SPEED, SPEEDS};
use crate::settings::Range::Within;
use crate::settings::keys;

/// Where an object is at a time.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(from = "[f64; 4]", into = "[f64; 4]")]
pub struct Waypoint {
    /// When, s.
    pub time_s: f64,
    /// How far from its described place, m.
    pub displacement_m: DVec3,
}

/// Where the rig is at a time.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(from = "[f64; 5]", into = "[f64; 5]")]
pub struct RigWaypoint {
    /// When, s.
    pub time_s: f64,
    /// Where in the world, m.
    pub position_m: DVec3,
    /// Which way it looks, degrees to the right of forward.
    pub yaw_deg: f64,
}

keys! {
    /// Motion of lidar and cameras together.
    #[non_exhaustive]
    pub struct Rig {
        /// Velocity of lidar and cameras in the world, [right, down, forward] of how they look at time 0.
        velocity_m_s: DVec3 ["m/s"] = DVec3::ZERO, in SPEED, usually SPEEDS, from "at rest";
        /// How fast lidar and cameras turn to the right.
        yaw_rate_deg_s: f64 ["deg/s"] = 0.0, in Within(-3600.0, 3600.0), from "at rest";
        /// Positions of lidar and cameras over time, connected by straight lines: a list of [s, m right, m down, m
        /// forward, degrees to the right].
        ///
        /// In order of time. With waypoints there are no velocity and no rate.
        waypoints: Vec<RigWaypoint> = Vec::new(), in PLACES, from "none";
    }
}

impl From<[f64; 4]> for Waypoint {
    fn from([time_s, x, y, z]: [f64; 4]) -> Self {
        let displacement_m = DVec3::new(x, y, z);
        Waypoint {
            time_s,
            displacement_m,
        }
    }
}

impl From<Waypoint> for [f64; 4] {
    fn from(at: Waypoint) -> Self {
        let [x, y, z] = at.displacement_m.to_array();
        [at.time_s, x, y, z]
    }
}

impl From<[f64; 5]> for RigWaypoint {
    fn from([time_s, x, y, z, yaw_deg]: [f64; 5]) -> Self {
        RigWaypoint {
            time_s,
            position_m: DVec3::new(x, y, z),
            yaw_deg,
        }
    }
}

impl From<RigWaypoint> for [f64; 5] {
    fn from(at: RigWaypoint) -> Self {
        let [x, y, z] = at.position_m.to_array();
        [at.time_s, x, y, z, at.yaw_deg]
    }
}

/// Straight from each point to the next at even speed, standing still before the first and after the last; `None` without
/// points.
pub(super) fn interpolate<const N: usize>(
    points: impl Iterator<Item = [f64; N]>,
    time_s: f64,
) -> Option<[f64; N]> {
    let mut before: Option<[f64; N]> = None;
    for point in points {
        if point[0] > time_s {
            let Some(before) = before else {
                return Some(point);
            };
            let share = (time_s - before[0]) / (point[0] - before[0]);
            return Some(std::array::from_fn(|i| {
                before[i] + (point[i] - before[i]) * share
            }));
        }
        before = Some(point);
    }
    before
}

impl Rig {
    /// Place in the world, m, and turn to the right, degrees.
    pub(crate) fn pose(&self, time_s: f64) -> (DVec3, f64) {
        let points = self.waypoints.iter().map(|&at| at.into());
        match interpolate(points, time_s) {
            Some([_, x, y, z, yaw_deg]) => (DVec3::new(x, y, z), yaw_deg),
            None => (self.velocity_m_s * time_s, self.yaw_rate_deg_s * time_s),
        }
    }

    /// Whether it never moves.
    pub(crate) fn is_still(&self) -> bool {
        *self == Rig::default()
    }
}
