//! Scene files: reading them, and finding the line of a value that breaks a rule.
//!
//! A file is read in two passes, the second of which only runs on a complaint, to find its line.

use std::path::Path;

use super::rules::{Fault, complaint};
use super::settings::Scene;
use super::shape::{Object, Shape};
use super::vector::Vec3;
use crate::files::{InputError, line_of, parse_toml, read_text};

const OUTDOOR: &str = include_str!("../../vectors/scenes/outdoor.toml");

/// Kinds of object in a file.
#[derive(Debug, Clone, Copy, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Ground,
    Plane,
    Box,
    Sphere,
}

/// An `[[object]]` entry: one flat table, so that unknown keys are found at their own line.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectEntry {
    kind: Kind,
    name: String,
    reflectivity: f64,
    depth_m: Option<f64>,
    centre_m: Option<Vec3>,
    normal: Option<Vec3>,
    width_m: Option<f64>,
    height_m: Option<f64>,
    size_m: Option<Vec3>,
    yaw_deg: Option<f64>,
    radius_m: Option<f64>,
}

impl ObjectEntry {
    /// The value of a key that this kind of object needs.
    fn need<T>(&self, key: &str, value: Option<T>) -> Result<T, String> {
        value.ok_or_else(|| format!("object \"{}\" lacks `{key}`", self.name))
    }

    /// Complains about keys that mean nothing for this kind of object.
    fn refuse_others(&self, allowed: &[&str]) -> Result<(), String> {
        let given = [
            ("depth_m", self.depth_m.is_some()),
            ("centre_m", self.centre_m.is_some()),
            ("normal", self.normal.is_some()),
            ("width_m", self.width_m.is_some()),
            ("height_m", self.height_m.is_some()),
            ("size_m", self.size_m.is_some()),
            ("yaw_deg", self.yaw_deg.is_some()),
            ("radius_m", self.radius_m.is_some()),
        ];
        match given
            .iter()
            .find(|(key, present)| *present && !allowed.contains(key))
        {
            None => Ok(()),
            Some((key, _)) => Err(format!(
                "object \"{}\" has `{key}`, which its kind does not use",
                self.name
            )),
        }
    }
}

impl TryFrom<ObjectEntry> for Object {
    type Error = String;

    fn try_from(entry: ObjectEntry) -> Result<Self, String> {
        let shape = match entry.kind {
            Kind::Ground => {
                entry.refuse_others(&["depth_m"])?;
                Shape::Ground {
                    depth_m: entry.need("depth_m", entry.depth_m)?,
                }
            }
            Kind::Plane => {
                entry.refuse_others(&["centre_m", "normal", "width_m", "height_m"])?;
                Shape::Plane {
                    centre_m: entry.need("centre_m", entry.centre_m)?,
                    normal: entry.normal.unwrap_or(Vec3::new(0.0, 0.0, -1.0)),
                    width_m: entry.need("width_m", entry.width_m)?,
                    height_m: entry.need("height_m", entry.height_m)?,
                }
            }
            Kind::Box => {
                entry.refuse_others(&["centre_m", "size_m", "yaw_deg"])?;
                Shape::Box {
                    centre_m: entry.need("centre_m", entry.centre_m)?,
                    size_m: entry.need("size_m", entry.size_m)?,
                    yaw_deg: entry.yaw_deg.unwrap_or(0.0),
                }
            }
            Kind::Sphere => {
                entry.refuse_others(&["centre_m", "radius_m"])?;
                Shape::Sphere {
                    centre_m: entry.need("centre_m", entry.centre_m)?,
                    radius_m: entry.need("radius_m", entry.radius_m)?,
                }
            }
        };
        Ok(Object {
            name: entry.name,
            reflectivity: entry.reflectivity,
            shape,
        })
    }
}

impl Scene {
    /// The built-in scene: a street from 15 to 180 m, 50 klux.
    pub fn outdoor() -> Self {
        match Scene::parse("outdoor.toml", OUTDOOR) {
            Ok(scene) => scene,
            Err(error) => unreachable!("the built-in scene is tested: {error}"),
        }
    }

    /// Reads a scene file.
    ///
    /// # Errors
    /// As [`Scene::parse`], or when the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        Scene::parse(&path.display().to_string(), &read_text(path)?)
    }

    /// Reads a scene from TOML text; `source` names it in complaints.
    ///
    /// # Errors
    /// Syntax errors, unknown or missing keys, and values [`Scene::validate`] refuses, each with
    /// the line where it stands.
    pub fn parse(source: &str, text: &str) -> Result<Self, InputError> {
        let scene: Scene = parse_toml(source, text)?;
        scene.first_fault().map_err(|fault| InputError {
            line: line_of_fault(text, &fault),
            ..complaint(source, &fault)
        })?;
        Ok(scene)
    }
}

/// Where the faulty value stands, or its section if the value was left to its default.
fn line_of_fault(text: &str, fault: &Fault) -> Option<usize> {
    let document = toml::de::DeTable::parse(text).ok()?;
    let mut place = document.get_ref().get(fault.section)?;
    if let Some(index) = fault.entry {
        place = place.get_ref().get(index)?;
    }
    let value = place.get_ref().get(fault.key).unwrap_or(place);
    Some(line_of(text, value.span().start))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The complaint about the built-in scene after one replacement, which must apply.
    fn complaint_after(old: &str, new: &str) -> (InputError, String) {
        let text = OUTDOOR.replacen(old, new, 1);
        assert_ne!(text, OUTDOOR, "{old} is not in the scene");
        (Scene::parse("s.toml", &text).unwrap_err(), text)
    }

    fn line_with(text: &str, what: &str) -> Option<usize> {
        text.lines().position(|l| l.contains(what)).map(|i| i + 1)
    }

    #[test]
    fn the_built_in_scene_is_valid() {
        let scene = Scene::outdoor();
        scene.validate("outdoor.toml").unwrap();
        assert!(scene.objects.len() >= 6);
    }

    #[test]
    fn bad_numbers_are_refused_with_their_line() {
        for (old, new) in [
            ("fov_deg = 16.0", "fov_deg = nan"),
            ("pulse_energy_uj = 20.0", "pulse_energy_uj = -20.0"),
            ("pde = 0.185", "pde = 1.5"),
            ("lens_diameter_mm = 4.0", "lens_diameter_mm = 0.0"),
            ("illuminance_klux = 50.0", "illuminance_klux = inf"),
            ("reflectivity = 0.15", "reflectivity = 1.15"),
            ("radius_m = 0.12", "radius_m = 0"),
            ("baseline_m = 1.0", "baseline_m = -1"),
            ("max_disparity_px = 232.0", "max_disparity_px = 5.0"),
        ] {
            let (error, text) = complaint_after(old, new);
            assert_eq!(error.line, line_with(&text, new), "{error}");
            assert!(error.to_string().contains("; give "), "{error}");
        }
    }

    #[test]
    fn unknown_missing_and_misplaced_keys_are_named() {
        let (error, text) = complaint_after("radius_m = 0.12", "radius_mm = 120");
        assert_eq!(error.line, line_with(&text, "radius_mm"), "{error}");
        let (error, _) = complaint_after("radius_m = 0.12", "");
        assert!(error.to_string().contains("lacks `radius_m`"), "{error}");
        assert!(error.line.is_some(), "{error}");
        let (error, _) = complaint_after("radius_m = 0.12", "radius_m = 0.12\ndepth_m = 3");
        assert!(error.to_string().contains("has `depth_m`"), "{error}");
        let (error, text) = complaint_after("kind = \"sphere\"", "kind = \"cone\"");
        assert_eq!(error.line, line_with(&text, "\"cone\""), "{error}");
    }

    #[test]
    fn the_stereo_section_may_be_left_out() {
        let text = "[lidar]\nfov_deg = 16\nwavelength_nm = 940\npulse_energy_uj = 10\n\
            pulse_fwhm_ns = 4\npde = 0.2\nlens_diameter_mm = 6\nlens_f_number = 2\n\
            solar_irradiance_w_m2 = 3\n[light]\nilluminance_klux = 1\n";
        let scene = Scene::parse("s.toml", text).unwrap();
        assert_eq!(scene.stereo.width, 1440);
        assert!(scene.objects.is_empty());
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in "\\PC{0,200}") {
            let _ = Scene::parse("garbage", &text);
        }

        #[test]
        fn a_scene_with_a_hole_never_panics(from in 0usize..4000, length in 0usize..60, filler in "[ -~\n]{0,8}") {
            let mut text = OUTDOOR.to_owned();
            prop_assert!(text.is_ascii());
            let from = from.min(text.len());
            let to = (from + length).min(text.len());
            text.replace_range(from..to, &filler);
            if let Err(error) = Scene::parse("s.toml", &text) {
                prop_assert!(error.to_string().starts_with("s.toml"));
            }
        }
    }
}
