//! What makes a scene a possible one; the same rules for files and for scenes built in code.

use super::settings::Scene;
use super::shape::{Object, Shape};
use super::vector::Vec3;
use crate::files::InputError;

/// A value that breaks a rule, and where it stands.
pub(super) struct Fault {
    pub section: &'static str,
    /// Which `[[object]]`, from 0.
    pub entry: Option<usize>,
    pub key: &'static str,
    pub message: String,
}

/// The place of the values being checked, for complaints about them.
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
    /// Makes sure that every value has a physical meaning; `source` names the scene in complaints.
    ///
    /// # Errors
    /// For the first value that is NaN, infinite, or outside its range.
    pub fn validate(&self, source: &str) -> Result<(), InputError> {
        self.first_fault()
            .map_err(|fault| complaint(source, &fault))
    }

    pub(super) fn first_fault(&self) -> Result<(), Fault> {
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
        rules.within("width", stereo.width.into(), 1.0, 16_384.0)?;
        rules.within("height", stereo.height.into(), 1.0, 16_384.0)?;
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

/// The sentence about a fault, without its line.
pub(super) fn complaint(source: &str, fault: &Fault) -> InputError {
    let place = match fault.entry {
        Some(i) => format!("[[{}]] number {}", fault.section, i + 1),
        None => format!("[{}]", fault.section),
    };
    InputError::new(source, format!("in {place}, {}", fault.message))
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
