//! What makes a scene possible, beyond the range of each key; the same rules for files and for scenes built in code.

use super::object::Object;
use super::rig::Rig;
use super::settings::{Scene, Stereo};
use super::shape::Shape;
use crate::files::InputError;
use crate::settings::{Document, Fault};

impl Scene {
    /// Makes sure that every value has a physical meaning; `source` names the scene in complaints.
    ///
    /// # Errors
    /// For every value that is NaN, infinite, or outside its range.
    pub fn validate(&self, source: &str) -> Result<(), InputError> {
        Scene::read(&Document::from_table(source, self.table())).map(|_| ())
    }
}

/// Disparities from least to most, and a third camera between the others.
pub(super) fn check_stereo(stereo: &Stereo) -> Option<Fault> {
    if stereo.third_camera_baseline_m >= stereo.baseline_m {
        return Some(Fault {
            path: "stereo.third_camera_baseline_m".into(),
            message: format!(
                "third_camera_baseline_m = {} is impossible; give less than baseline_m, {}",
                stereo.third_camera_baseline_m, stereo.baseline_m
            ),
        });
    }
    (stereo.max_disparity_px < stereo.min_disparity_px).then(|| {
        Fault::new(
            "stereo.max_disparity_px",
            format!(
                "max_disparity_px = {} is impossible; give a number not below min_disparity_px, {}",
                stereo.max_disparity_px, stereo.min_disparity_px
            ),
        )
    })
}

/// The object at `path` is somewhere, faces somewhere, makes no light, and moves in one way.
pub(super) fn check_object(path: &str, object: &Object) -> Option<Fault> {
    let fault = |key: &str, message: String| {
        let path = format!("{path}.{key}");
        Some(Fault { path, message })
    };
    let no_length = |key: &str| {
        let message =
            format!("{key} = [0, 0, 0] is impossible; give a vector whose length is not zero");
        fault(key, message)
    };
    match object.shape {
        Shape::Plane { normal, .. } if normal.length() <= 1e-9 => return no_length("normal"),
        Shape::Cylinder { axis, .. } | Shape::Cone { axis, .. } if axis.length() <= 1e-9 => {
            return no_length("axis");
        }
        _ => {}
    }
    let texture = object.texture.as_ref();
    let second = texture.map_or(0.0, |t| {
        t.second_reflectivity.max(t.second_grey.unwrap_or(0.0))
    });
    let first = object.reflectivity.max(object.grey.unwrap_or(0.0));
    let passed = object.transmittance + object.mirror;
    if passed > 0.0 && passed + first.max(second) > 1.0 + 1e-9 {
        let message = format!(
            "transmittance, mirror and reflectivity (or grey) are {} together, more light than there is; give at most 1",
            passed + first.max(second)
        );
        return fault("transmittance", message);
    }
    let is_moving = object.velocity_m_s != glam::DVec3::ZERO;
    if is_moving && !object.waypoints.is_empty() {
        return fault("waypoints", BOTH.into());
    }
    let times = object.waypoints.iter().map(|at| at.time_s);
    times_fall(times).and_then(|message| fault("waypoints", message))
}

const BOTH: &str = "waypoints and a velocity are two motions; give one of them";

/// The rig moves in one way.
pub(super) fn check_rig(rig: &Rig) -> Option<Fault> {
    let turns = rig.yaw_rate_deg_s != 0.0 || rig.velocity_m_s != glam::DVec3::ZERO;
    let message = if turns && !rig.waypoints.is_empty() {
        Some(BOTH.to_owned())
    } else {
        times_fall(rig.waypoints.iter().map(|at| at.time_s))
    };
    message.map(|message| Fault::new("rig.waypoints", message))
}

/// What is wrong with the times of waypoints, if anything.
fn times_fall(times: impl Iterator<Item = f64> + Clone) -> Option<String> {
    let falls = |(from, to): &(f64, f64)| from >= to;
    let (from, to) = times.clone().zip(times.skip(1)).find(falls)?;
    Some(format!(
        "waypoints go from {from} s to {to} s; give times that rise"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_built_in_code_are_checked_by_the_same_rules() {
        let mut scene = Scene::outdoor();
        scene.validate("my scene").unwrap();
        scene.objects[1].reflectivity = f64::NAN;
        let error = scene.validate("my scene").unwrap_err().to_string();
        assert_eq!(
            error,
            "my scene: in [[object]] number 2 (car), reflectivity = NaN is impossible; give 0 to 1"
        );
    }
}
