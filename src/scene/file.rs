//! Scene files: reading them, and saying what is wrong with them and where.
//!
//! One set of rules serves files and scenes built in code: [`Scene::validate`]. A file is read in
//! two passes, the second of which only runs on a complaint, to find the line of the value.

use std::path::Path;

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

/// A value that breaks a rule, and where it stands.
struct Fault {
    section: &'static str,
    /// Which `[[object]]`, from 0.
    entry: Option<usize>,
    key: &'static str,
    message: String,
}

/// Collects the first fault of one section.
struct Rules {
    section: &'static str,
    entry: Option<usize>,
}

impl Rules {
    fn check(&self, key: &'static str, value: f64, fine: bool, wanted: &str) -> Result<(), Fault> {
        if fine && value.is_finite() {
            return Ok(());
        }
        Err(Fault {
            section: self.section,
            entry: self.entry,
            key,
            message: format!("`{key}` is {value}; give {wanted}"),
        })
    }

    fn positive(&self, key: &'static str, value: f64) -> Result<(), Fault> {
        self.check(key, value, value > 0.0, "a number above zero")
    }

    fn not_negative(&self, key: &'static str, value: f64) -> Result<(), Fault> {
        self.check(key, value, value >= 0.0, "zero or a positive number")
    }

    fn within(&self, key: &'static str, value: f64, low: f64, high: f64) -> Result<(), Fault> {
        let wanted = format!("a number from {low} to {high}");
        self.check(key, value, (low..=high).contains(&value), &wanted)
    }

    fn finite(&self, key: &'static str, value: Vec3) -> Result<(), Fault> {
        let all = value.components();
        // Beyond a million metres the squares in the geometry lose the small lengths.
        all.into_iter()
            .try_for_each(|v| self.within(key, v, -1e6, 1e6))
    }

    fn extent(&self, key: &'static str, value: f64) -> Result<(), Fault> {
        self.positive(key, value)?;
        self.within(key, value, 0.0, 1e6)
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

    /// Makes sure that every value has a physical meaning; `source` names the scene in complaints.
    ///
    /// # Errors
    /// For the first value that is NaN, infinite, or outside its range.
    pub fn validate(&self, source: &str) -> Result<(), InputError> {
        self.first_fault()
            .map_err(|fault| complaint(source, &fault))
    }

    fn first_fault(&self) -> Result<(), Fault> {
        self.check_lidar()?;
        self.check_stereo()?;
        let light = Rules {
            section: "light",
            entry: None,
        };
        light.within("illuminance_klux", self.light.illuminance_klux, 0.0, 1000.0)?;
        (self.objects.iter().enumerate()).try_for_each(|(i, object)| check_object(i, object))
    }

    fn check_lidar(&self) -> Result<(), Fault> {
        let lidar = &self.lidar;
        let rules = Rules {
            section: "lidar",
            entry: None,
        };
        rules.within("fov_deg", lidar.fov_deg, 0.1, 150.0)?;
        rules.within("wavelength_nm", lidar.wavelength_nm, 100.0, 10_000.0)?;
        rules.not_negative("pulse_energy_uj", lidar.pulse_energy_uj)?;
        rules.within("pulse_fwhm_ns", lidar.pulse_fwhm_ns, 0.0, 1e6)?;
        rules.within("pde", lidar.pde, 0.0, 1.0)?;
        rules.positive("lens_diameter_mm", lidar.lens_diameter_mm)?;
        rules.positive("lens_f_number", lidar.lens_f_number)?;
        rules.within("transmittance", lidar.transmittance, 0.0, 1.0)?;
        rules.not_negative("solar_irradiance_w_m2", lidar.solar_irradiance_w_m2)?;
        rules.within("dark_count_hz", lidar.dark_count_hz, 0.0, 1e9)
    }

    fn check_stereo(&self) -> Result<(), Fault> {
        let stereo = &self.stereo;
        let rules = Rules {
            section: "stereo",
            entry: None,
        };
        rules.extent("baseline_m", stereo.baseline_m)?;
        rules.positive("focal_mm", stereo.focal_mm)?;
        rules.positive("pixel_pitch_um", stereo.pixel_pitch_um)?;
        rules.within("width", stereo.width.into(), 1.0, 65_536.0)?;
        rules.within("height", stereo.height.into(), 1.0, 65_536.0)?;
        rules.not_negative("disparity_sigma_px", stereo.disparity_sigma_px)?;
        rules.within(
            "subpixel_steps",
            stereo.subpixel_steps.into(),
            1.0,
            65_536.0,
        )?;
        rules.positive("min_disparity_px", stereo.min_disparity_px)?;
        let max = stereo.max_disparity_px;
        let wanted = "a number not below `min_disparity_px`";
        rules.check(
            "max_disparity_px",
            max,
            max >= stereo.min_disparity_px,
            wanted,
        )?;
        rules.finite("position_m", stereo.position_m)?;
        rules.within("yaw_error_deg", stereo.yaw_error_deg, -45.0, 45.0)
    }
}

fn check_object(index: usize, object: &Object) -> Result<(), Fault> {
    let rules = Rules {
        section: "object",
        entry: Some(index),
    };
    rules.within("reflectivity", object.reflectivity, 0.0, 1.0)?;
    match object.shape {
        Shape::Ground { depth_m } => rules.extent("depth_m", depth_m),
        Shape::Plane {
            centre_m,
            normal,
            width_m,
            height_m,
        } => {
            rules.finite("centre_m", centre_m)?;
            rules.finite("normal", normal)?;
            let wanted = "a vector whose length is not zero";
            rules.check("normal", normal.norm(), normal.norm() > 1e-9, wanted)?;
            rules.extent("width_m", width_m)?;
            rules.extent("height_m", height_m)
        }
        Shape::Box {
            centre_m,
            size_m,
            yaw_deg,
        } => {
            rules.finite("centre_m", centre_m)?;
            let sizes = size_m.components();
            sizes
                .into_iter()
                .try_for_each(|v| rules.extent("size_m", v))?;
            rules.within("yaw_deg", yaw_deg, -360.0, 360.0)
        }
        Shape::Sphere { centre_m, radius_m } => {
            rules.finite("centre_m", centre_m)?;
            rules.extent("radius_m", radius_m)
        }
    }
}

fn complaint(source: &str, fault: &Fault) -> InputError {
    let place = match fault.entry {
        Some(i) => format!("[[{}]] number {}", fault.section, i + 1),
        None => format!("[{}]", fault.section),
    };
    InputError::new(source, format!("in {place}, {}", fault.message))
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
    fn scenes_built_in_code_are_checked_by_the_same_rules() {
        let mut scene = Scene::outdoor();
        scene.objects[1].reflectivity = f64::NAN;
        let error = scene.validate("my scene").unwrap_err().to_string();
        assert_eq!(
            error,
            "my scene: in [[object]] number 2, `reflectivity` is NaN; give a number from 0 to 1"
        );
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
