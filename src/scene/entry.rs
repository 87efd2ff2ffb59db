//! Objects as scene files write them: one flat table each, with the keys of its kind.

use glam::DVec3;

use super::shape::{Object, Shape};

/// Kinds of object in a file.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Ground,
    Plane,
    Box,
    Sphere,
}

/// An `[[object]]` entry: one flat table, so that unknown keys are found at their own line.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectEntry {
    name: String,
    kind: Kind,
    reflectivity: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    grey: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    retro: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    velocity_m_s: Option<DVec3>,
    #[serde(skip_serializing_if = "Option::is_none")]
    depth_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    centre_m: Option<DVec3>,
    #[serde(skip_serializing_if = "Option::is_none")]
    normal: Option<DVec3>,
    #[serde(skip_serializing_if = "Option::is_none")]
    width_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    height_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    size_m: Option<DVec3>,
    #[serde(skip_serializing_if = "Option::is_none")]
    yaw_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    radius_m: Option<f64>,
}

impl ObjectEntry {
    /// The value of a key that this kind of object needs.
    fn need<T>(&self, key: &str, value: Option<T>) -> Result<T, String> {
        value.ok_or_else(|| format!("object \"{}\" lacks `{key}`; add it", self.name))
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
                "object \"{}\" has `{key}`, which its kind does not use; remove it",
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
                    normal: entry.normal.unwrap_or(DVec3::new(0.0, 0.0, -1.0)),
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
            grey: entry.grey,
            retro: entry.retro.unwrap_or(1.0),
            velocity_m_s: entry.velocity_m_s.unwrap_or(DVec3::ZERO),
            ..Object::new(entry.name, entry.reflectivity, shape)
        })
    }
}

impl From<Object> for ObjectEntry {
    fn from(object: Object) -> Self {
        let mut entry = ObjectEntry {
            name: object.name,
            kind: Kind::Ground,
            reflectivity: object.reflectivity,
            grey: object.grey,
            retro: (object.retro != 1.0).then_some(object.retro),
            velocity_m_s: (object.velocity_m_s != DVec3::ZERO).then_some(object.velocity_m_s),
            depth_m: None,
            centre_m: None,
            normal: None,
            width_m: None,
            height_m: None,
            size_m: None,
            yaw_deg: None,
            radius_m: None,
        };
        match object.shape {
            Shape::Ground { depth_m } => entry.depth_m = Some(depth_m),
            Shape::Plane {
                centre_m,
                normal,
                width_m,
                height_m,
            } => {
                entry.kind = Kind::Plane;
                entry.centre_m = Some(centre_m);
                entry.normal = Some(normal);
                entry.width_m = Some(width_m);
                entry.height_m = Some(height_m);
            }
            Shape::Box {
                centre_m,
                size_m,
                yaw_deg,
            } => {
                entry.kind = Kind::Box;
                entry.centre_m = Some(centre_m);
                entry.size_m = Some(size_m);
                entry.yaw_deg = Some(yaw_deg);
            }
            Shape::Sphere { centre_m, radius_m } => {
                entry.kind = Kind::Sphere;
                entry.centre_m = Some(centre_m);
                entry.radius_m = Some(radius_m);
            }
        }
        entry
    }
}
