//! Objects as scene files write them: one flat table each, with the keys of its kind.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

use super::motion::Waypoint;
use super::object::Object;
use super::shape::{DepthMap, MapFiles, Mesh, Shape};
use super::texture::{Pattern, Picture, Texture};

/// Height of a person that a file gives none, m: about the mean of adults in Europe.
const PERSON_M: f64 = 1.72;

/// Size of a texture that a file gives none, m.
const TEXTURE_M: f64 = 0.5;

/// Kinds of object in a file.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Ground,
    Plane,
    Box,
    Sphere,
    Cylinder,
    Person,
    Mesh,
    Map,
}

/// What the numbers of a depth map are.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
enum DepthKind {
    Axis,
    Range,
}

/// Kinds of texture in a file.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
enum TextureKind {
    Checker,
    Stripes,
    Noise,
    Image,
}

/// Writes an entry's struct, an entry without optional keys, and the list of which of them are given.
macro_rules! entry {
    ($($key:ident: $kind:ty,)*) => {
        /// An `[[object]]` entry: one flat table, so that unknown keys are found at their own line.
        #[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub(super) struct ObjectEntry {
            name: String,
            kind: Kind,
            reflectivity: f64,
            $(#[serde(skip_serializing_if = "Option::is_none")] $key: Option<$kind>,)*
        }

        impl ObjectEntry {
            fn bare(name: String, reflectivity: f64) -> Self {
                ObjectEntry { name, kind: Kind::Ground, reflectivity, $($key: None,)* }
            }

            fn given(&self) -> impl Iterator<Item = &'static str> {
                let keys = [$((stringify!($key), self.$key.is_some()),)*];
                keys.into_iter().filter_map(|(key, is_given)| is_given.then_some(key))
            }
        }
    };
}

entry! {
    grey: f64,
    retro: f64,
    transmittance: f64,
    mirror: f64,
    texture: TextureKind,
    texture_file: PathBuf,
    texture_size_m: f64,
    texture_seed: u32,
    texture_shift_m: (f64, f64),
    texture_turn_deg: f64,
    second_reflectivity: f64,
    second_grey: f64,
    velocity_m_s: DVec3,
    waypoints: Vec<Waypoint>,
    depth_m: f64,
    centre_m: DVec3,
    normal: DVec3,
    width_m: f64,
    height_m: f64,
    size_m: DVec3,
    yaw_deg: f64,
    radius_m: f64,
    axis: DVec3,
    foot_m: DVec3,
    file: PathBuf,
    scale_m: f64,
    depth_file: PathBuf,
    reflectivity_file: PathBuf,
    grey_file: PathBuf,
    depth_unit_m: f64,
    depth_along: DepthKind,
    focal_px: f64,
    principal_px: (f64, f64),
}

/// Keys that every kind of object may have.
const OF_ALL: &[&str] = &[
    "grey",
    "retro",
    "transmittance",
    "mirror",
    "texture",
    "texture_file",
    "texture_size_m",
    "texture_seed",
    "texture_shift_m",
    "texture_turn_deg",
    "second_reflectivity",
    "second_grey",
    "velocity_m_s",
    "waypoints",
];

/// Keys that maps have beside these.
const OF_MAPS: &[&str] = &[
    "depth_file",
    "reflectivity_file",
    "grey_file",
    "depth_unit_m",
    "depth_along",
    "focal_px",
    "principal_px",
    "centre_m",
    "yaw_deg",
];

impl ObjectEntry {
    /// The value of a key that this kind of object needs.
    fn need<T>(&self, key: &str, value: Option<T>) -> Result<T, String> {
        value.ok_or_else(|| format!("object \"{}\" lacks `{key}`; add it", self.name))
    }

    /// Complains about keys that mean nothing for this kind of object.
    fn refuse_others(&self, allowed: &[&str]) -> Result<(), String> {
        let is_other = |key: &&str| !allowed.contains(key) && !OF_ALL.contains(key);
        match self.given().find(is_other) {
            None => Ok(()),
            Some(key) => Err(format!(
                "object \"{}\" has `{key}`, which its kind does not use; remove it",
                self.name
            )),
        }
    }

    /// The object, with the files that it names, which are relative to `folder`.
    ///
    /// # Errors
    /// Keys that its kind needs and does not have, or has and does not use; files that cannot be read.
    pub(super) fn object(self, folder: &Path) -> Result<Object, String> {
        let shape = self.shape(folder)?;
        let texture = self.pattern(folder)?;
        Ok(Object {
            grey: self.grey,
            retro: self.retro.unwrap_or(1.0),
            texture,
            transmittance: self.transmittance.unwrap_or(0.0),
            mirror: self.mirror.unwrap_or(0.0),
            velocity_m_s: self.velocity_m_s.unwrap_or(DVec3::ZERO),
            waypoints: self.waypoints.unwrap_or_default(),
            ..Object::new(self.name, self.reflectivity, shape)
        })
    }

    fn shape(&self, folder: &Path) -> Result<Shape, String> {
        Ok(match self.kind {
            Kind::Ground => {
                self.refuse_others(&["depth_m"])?;
                Shape::Ground {
                    depth_m: self.need("depth_m", self.depth_m)?,
                }
            }
            Kind::Plane => {
                self.refuse_others(&["centre_m", "normal", "width_m", "height_m"])?;
                Shape::Plane {
                    centre_m: self.need("centre_m", self.centre_m)?,
                    normal: self.normal.unwrap_or(DVec3::NEG_Z),
                    width_m: self.need("width_m", self.width_m)?,
                    height_m: self.need("height_m", self.height_m)?,
                }
            }
            Kind::Box => {
                self.refuse_others(&["centre_m", "size_m", "yaw_deg"])?;
                Shape::Box {
                    centre_m: self.need("centre_m", self.centre_m)?,
                    size_m: self.need("size_m", self.size_m)?,
                    yaw_deg: self.yaw_deg.unwrap_or(0.0),
                }
            }
            Kind::Sphere => {
                self.refuse_others(&["centre_m", "radius_m"])?;
                Shape::Sphere {
                    centre_m: self.need("centre_m", self.centre_m)?,
                    radius_m: self.need("radius_m", self.radius_m)?,
                }
            }
            Kind::Cylinder => {
                self.refuse_others(&["centre_m", "axis", "radius_m", "height_m"])?;
                Shape::Cylinder {
                    centre_m: self.need("centre_m", self.centre_m)?,
                    axis: self.axis.unwrap_or(DVec3::NEG_Y),
                    radius_m: self.need("radius_m", self.radius_m)?,
                    height_m: self.need("height_m", self.height_m)?,
                }
            }
            Kind::Person => {
                self.refuse_others(&["foot_m", "height_m", "yaw_deg"])?;
                Shape::Person {
                    foot_m: self.need("foot_m", self.foot_m)?,
                    height_m: self.height_m.unwrap_or(PERSON_M),
                    yaw_deg: self.yaw_deg.unwrap_or(0.0),
                }
            }
            Kind::Mesh => {
                self.refuse_others(&["file", "centre_m", "scale_m", "yaw_deg"])?;
                let file = placed(folder, self.need("file", self.file.as_ref())?);
                Shape::Mesh {
                    centre_m: self.need("centre_m", self.centre_m)?,
                    scale_m: self.scale_m.unwrap_or(1.0),
                    yaw_deg: self.yaw_deg.unwrap_or(0.0),
                    mesh: Arc::new(Mesh::read(&file).map_err(|e| e.to_string())?),
                }
            }
            Kind::Map => {
                self.refuse_others(OF_MAPS)?;
                let at = |file: &PathBuf| placed(folder, file);
                let files = MapFiles {
                    depth: at(self.need("depth_file", self.depth_file.as_ref())?),
                    reflectivity: self.reflectivity_file.as_ref().map(at),
                    grey: self.grey_file.as_ref().map(at),
                    unit_m: self.depth_unit_m,
                    is_range: matches!(self.depth_along, Some(DepthKind::Range)),
                    focal_px: self.need("focal_px", self.focal_px)?,
                    principal_px: self.principal_px,
                };
                Shape::Map {
                    centre_m: self.centre_m.unwrap_or(DVec3::ZERO),
                    yaw_deg: self.yaw_deg.unwrap_or(0.0),
                    map: Arc::new(DepthMap::read(files).map_err(|e| e.to_string())?),
                }
            }
        })
    }

    fn pattern(&self, folder: &Path) -> Result<Option<Texture>, String> {
        let is_of_texture = |key: &&str| key.starts_with("texture_") || key.starts_with("second_");
        let Some(kind) = self.texture else {
            return match self.given().find(is_of_texture) {
                None => Ok(None),
                Some(key) => Err(format!(
                    "object \"{}\" has `{key}`, but no `texture`; give one of checker, stripes, noise and image",
                    self.name
                )),
            };
        };
        let pattern = match kind {
            TextureKind::Checker => Pattern::Checker,
            TextureKind::Stripes => Pattern::Stripes,
            TextureKind::Noise => Pattern::Noise(self.texture_seed.unwrap_or(0)),
            TextureKind::Image => {
                let file = self.need("texture_file", self.texture_file.as_ref())?;
                let picture = Picture::read(&placed(folder, file)).map_err(|e| e.to_string())?;
                Pattern::Image(Arc::new(picture))
            }
        };
        let second_reflectivity = self.second_reflectivity.unwrap_or(0.0);
        let size_m = self.texture_size_m.unwrap_or(TEXTURE_M);
        Ok(Some(Texture {
            second_grey: self.second_grey,
            shift_m: self.texture_shift_m.unwrap_or((0.0, 0.0)),
            turn_deg: self.texture_turn_deg.unwrap_or(0.0),
            ..Texture::new(pattern, size_m, second_reflectivity)
        }))
    }
}

/// A file that a scene in `folder` names. It keeps its place when the scene is printed elsewhere.
fn placed(folder: &Path, file: &Path) -> PathBuf {
    let joined = folder.join(file);
    std::path::absolute(&joined).unwrap_or(joined)
}

impl From<Object> for ObjectEntry {
    fn from(object: Object) -> Self {
        let other_than = |usual: f64, value: f64| (value != usual).then_some(value);
        let mut entry = ObjectEntry {
            grey: object.grey,
            retro: other_than(1.0, object.retro),
            transmittance: other_than(0.0, object.transmittance),
            mirror: other_than(0.0, object.mirror),
            velocity_m_s: (object.velocity_m_s != DVec3::ZERO).then_some(object.velocity_m_s),
            waypoints: (!object.waypoints.is_empty()).then_some(object.waypoints),
            ..ObjectEntry::bare(object.name, object.reflectivity)
        };
        entry.write_shape(object.shape);
        if let Some(texture) = object.texture {
            entry.write_texture(texture);
        }
        entry
    }
}

impl ObjectEntry {
    fn write_texture(&mut self, texture: Texture) {
        self.texture = Some(match texture.pattern {
            Pattern::Checker => TextureKind::Checker,
            Pattern::Stripes => TextureKind::Stripes,
            Pattern::Noise(seed) => {
                self.texture_seed = Some(seed);
                TextureKind::Noise
            }
            Pattern::Image(picture) => {
                self.texture_file = Some(picture.path.clone());
                TextureKind::Image
            }
        });
        self.texture_size_m = Some(texture.size_m);
        self.texture_shift_m = (texture.shift_m != (0.0, 0.0)).then_some(texture.shift_m);
        self.texture_turn_deg = (texture.turn_deg != 0.0).then_some(texture.turn_deg);
        self.second_reflectivity = Some(texture.second_reflectivity);
        self.second_grey = texture.second_grey;
    }

    fn write_shape(&mut self, shape: Shape) {
        match shape {
            Shape::Ground { depth_m } => self.depth_m = Some(depth_m),
            Shape::Plane {
                centre_m,
                normal,
                width_m,
                height_m,
            } => {
                self.kind = Kind::Plane;
                self.centre_m = Some(centre_m);
                self.normal = Some(normal);
                self.width_m = Some(width_m);
                self.height_m = Some(height_m);
            }
            Shape::Box {
                centre_m,
                size_m,
                yaw_deg,
            } => {
                self.kind = Kind::Box;
                self.centre_m = Some(centre_m);
                self.size_m = Some(size_m);
                self.yaw_deg = Some(yaw_deg);
            }
            Shape::Sphere { centre_m, radius_m } => {
                self.kind = Kind::Sphere;
                self.centre_m = Some(centre_m);
                self.radius_m = Some(radius_m);
            }
            Shape::Cylinder {
                centre_m,
                axis,
                radius_m,
                height_m,
            } => {
                self.kind = Kind::Cylinder;
                self.centre_m = Some(centre_m);
                self.axis = Some(axis);
                self.radius_m = Some(radius_m);
                self.height_m = Some(height_m);
            }
            Shape::Person {
                foot_m,
                height_m,
                yaw_deg,
            } => {
                self.kind = Kind::Person;
                self.foot_m = Some(foot_m);
                self.height_m = Some(height_m);
                self.yaw_deg = Some(yaw_deg);
            }
            Shape::Mesh {
                centre_m,
                scale_m,
                yaw_deg,
                mesh,
            } => {
                self.kind = Kind::Mesh;
                self.centre_m = Some(centre_m);
                self.scale_m = Some(scale_m);
                self.yaw_deg = Some(yaw_deg);
                self.file = Some(mesh.path().to_owned());
            }
            Shape::Map {
                centre_m,
                yaw_deg,
                map,
            } => {
                let files = map.files().clone();
                self.kind = Kind::Map;
                self.centre_m = Some(centre_m);
                self.yaw_deg = Some(yaw_deg);
                self.depth_file = Some(files.depth);
                self.reflectivity_file = files.reflectivity;
                self.grey_file = files.grey;
                self.depth_unit_m = files.unit_m;
                self.depth_along = Some(match files.is_range {
                    true => DepthKind::Range,
                    false => DepthKind::Axis,
                });
                self.focal_px = Some(files.focal_px);
                self.principal_px = files.principal_px;
            }
        }
    }
}
