//! What makes a scene a possible one, beyond the range of each key; the same rules for files and for scenes built in
//! code.

use super::settings::{Scene, Stereo};
use super::shape::{Object, Shape};
use crate::files::InputError;
use crate::settings::{Document, Fault};

impl Scene {
    /// Makes sure that every value has a physical meaning; `source` names the scene in complaints.
    ///
    /// # Errors
    /// For every value that is NaN, infinite, or outside its range.
    pub fn validate(&self, source: &str) -> Result<(), InputError> {
        Scene::read(&Document::of(source, self.table())).map(|_| ())
    }
}

/// Disparities from least to most.
pub(super) fn check_stereo(stereo: &Stereo) -> Option<Fault> {
    (stereo.max_disparity_px < stereo.min_disparity_px).then(|| Fault {
        path: "stereo.max_disparity_px".into(),
        message: format!(
            "max_disparity_px = {} is impossible; give a number not below min_disparity_px, {}",
            stereo.max_disparity_px, stereo.min_disparity_px
        ),
    })
}

/// The object at `path` is somewhere and faces somewhere.
pub(super) fn check_object(path: &str, object: &Object) -> Option<Fault> {
    match object.shape {
        Shape::Plane { normal, .. } if normal.length() <= 1e-9 => Some(Fault {
            path: format!("{path}.normal"),
            message: "normal = [0, 0, 0] is impossible; give a vector whose length is not zero"
                .into(),
        }),
        _ => None,
    }
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
