//! Objects as scene files write them: one flat table each, with the keys of its kind.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

use super::object::Object;
use super::rig::Waypoint;
use super::shape::{DepthMap, MapFiles, Mesh, Shape};
use super::texture::{Pattern, Picture, Texture};
use super::words::{LENGTH, NEAR_M, PLACES, POSITION, SHARE, SPEED, SPEEDS};
use crate::files::placed;
use crate::settings::Range::{Above, Within};
use crate::settings::{keys, words};

/// Height of a person that a file gives none, m: about the mean of adults in Europe.
const PERSON_M: f64 = 1.72;

/// Size of a texture that a file gives none, m.
const TEXTURE_M: f64 = 0.5;

words! {
    /// Kinds of object in a file.
    pub(super) enum ObjectKind {
        Ground = "ground",
        Plane = "plane",
        Box = "box",
        Sphere = "sphere",
        Cylinder = "cylinder",
        Cone = "cone",
        Person = "person",
        Mesh = "mesh",
        Map = "map",
    }
}

words! {
    /// What the numbers of a depth map are.
    pub(super) enum DepthKind {
        Axis = "axis",
        Range = "range",
    }
}

words! {
    /// Kinds of texture in a file.
    pub(super) enum TextureKind {
        Checker = "checker",
        Stripes = "stripes",
        Noise = "noise",
        Image = "image",
    }
}

/// An entry's struct, and the list of which of its optional keys are given.
macro_rules! entry {
    ($(
        $(#[doc = $help:literal])+
        $key:ident: $type:ty $([$unit:literal])? $(, in $range:expr)? $(, usually $usual:expr)? $(, from $source:expr)?;
    )*) => {
        keys! {
            /// An `[[object]]` entry: one flat table, so that unknown keys are found at their own line.
            pub(super) struct ObjectEntry {
                /// Name in messages and for --set.
                name: String = String::new(), from "-";
                /// Shape.
                kind: ObjectKind = ObjectKind::Ground, from "-";
                /// Lambertian reflectivity at the laser's wavelength.
                reflectivity: f64 = 0.0, in SHARE, from "-";
                $(
                    $(#[doc = $help])+
                    #[serde(skip_serializing_if = "Option::is_none")]
                    $key: Option<$type> $([$unit])? = None $(, in $range)? $(, usually $usual)?,
                        from entry!(@source $($source)?);
                )*
            }
        }

        impl ObjectEntry {
            fn given(&self) -> impl Iterator<Item = &'static str> {
                let keys = [$((stringify!($key), self.$key.is_some()),)*];
                keys.into_iter().filter_map(|(key, is_given)| is_given.then_some(key))
            }
        }
    };
    (@source) => { "-" };
    (@source $source:expr) => { $source };
}

entry! {
    /// Lambertian reflectivity that the cameras see; as reflectivity if left out.
    grey: f64, in SHARE;
    /// How many times more of the laser's light returns than from a Lambertian surface; 1 if left out, traffic signs 300 to 2000.
    retro: f64, in Within(1.0, 1e4),
        from "chosen: pi * 100 to 700 cd/lx/m2 of signs' sheeting, over a reflectivity of 1";
    /// Share of light that passes straight through: panes; 0 if left out.
    transmittance: f64, in SHARE;
    /// Share of light that is reflected as by a mirror; 0 if left out, clean panes about 0.08.
    mirror: f64, in SHARE;
    /// Pattern of this and a second material; plain if left out.
    texture: TextureKind;
    /// Picture of an image texture: PNG, .npy, PFM or EXR, relative to the scene file; white is this material, black
    /// the second.
    texture_file: PathBuf;
    /// Edge of a checker, width of a stripe or image, size of the largest clouds; 0.5 m if left out.
    texture_size_m: f64 ["m"], in LENGTH, usually NEAR_M;
    /// Of a noise texture: equal seeds give equal clouds; 0 if left out.
    texture_seed: u32, in Within(0.0, 4_294_967_295.0);
    /// Shift of the pattern along the surface, [right, down]; none if left out.
    texture_shift_m: (f64, f64) ["m"], in POSITION, usually NEAR_M;
    /// Turn of the pattern on the surface; none if left out.
    texture_turn_deg: f64 ["deg"], in Within(-3600.0, 3600.0);
    /// Of a texture: the second material's reflectivity at the laser's wavelength; 0 if left out.
    second_reflectivity: f64, in SHARE;
    /// Of a texture: what the cameras see of the second material; as second_reflectivity if left out.
    second_grey: f64, in SHARE;
    /// Velocity in the world, [right, down, forward]; at rest if left out.
    velocity_m_s: DVec3 ["m/s"], in SPEED, usually SPEEDS;
    /// Positions over time, connected by straight lines: a list of [s, m right, m down, m forward] from its place.
    waypoints: Vec<Waypoint>, in PLACES;
    /// Of a ground: how far it lies below the lidar.
    depth_m: f64 ["m"], in LENGTH, usually NEAR_M;
    /// Of a plane, box, sphere, cylinder or cone: its middle, of a mesh: its file's origin, of a map: its camera, [right, down, forward] of the lidar.
    centre_m: DVec3 ["m"], in POSITION, usually NEAR_M;
    /// Of a plane: any vector at right angles to it; towards the lidar if left out.
    normal: DVec3, in POSITION;
    /// Of a plane: extent along its horizontal edge.
    width_m: f64 ["m"], in LENGTH, usually NEAR_M;
    /// Of a plane: extent along its other edge; of a cylinder or cone: its length; of a person: 1.72 m if left out.
    height_m: f64 ["m"], in LENGTH, usually NEAR_M;
    /// Of a box: extents [right, down, forward] before it is turned.
    size_m: DVec3 ["m"], in LENGTH, usually NEAR_M;
    /// Of a box, person, mesh or map: its turn about the vertical axis, the front to the right; none if left out, and a person walks forward.
    yaw_deg: f64 ["deg"], in Within(-360.0, 360.0);
    /// Of a sphere or cylinder: its radius; of a cone: at its foot.
    radius_m: f64 ["m"], in LENGTH, usually NEAR_M;
    /// Of a cone: its radius at the end that its axis points to; a tip if left out.
    tip_radius_m: f64 ["m"], in Within(0.0, 1e6), usually NEAR_M;
    /// Of a cylinder or cone: any vector along it, of a cone towards its tip; upright if left out, as poles are.
    axis: DVec3, in POSITION;
    /// Of a person: where it stands, [right, down, forward] of the lidar.
    foot_m: DVec3 ["m"], in POSITION, usually NEAR_M;
    /// Of a mesh: an OBJ file (x right, y up, z backwards), relative to the scene file.
    file: PathBuf;
    /// Of a mesh: the file's unit of length; 1 m if left out.
    scale_m: f64 ["m"], in LENGTH;
    /// Of a map: depths that a camera has seen (PNG, .npy, PFM or EXR), 0 where nothing is, relative to the scene file.
    depth_file: PathBuf;
    /// Of a map: reflectivities at the laser's wavelength, white is 1; the object's reflectivity if left out.
    reflectivity_file: PathBuf;
    /// Of a map: what the cameras see, white is 1; the object's grey if left out.
    grey_file: PathBuf;
    /// Of a map: unit of its depths, a metre if left out; whole numbers need it (0.001 for millimetres, 0.00390625 for KITTI's 1/256 m).
    depth_unit_m: f64 ["m"], in LENGTH;
    /// Of a map: whether depths are along the camera's axis or distances from it; axis if left out.
    depth_along: DepthKind;
    /// Of a map: focal length of its camera.
    focal_px: f64 ["px"], in Above(0.0, 1e6);
    /// Of a map: principal point of its camera, [column, row]; the middle if left out.
    principal_px: (f64, f64) ["px"], in Within(-1e6, 1e6);
}

/// Keys that meshes have beside those of all.
const OF_MESHES: &[&str] = &["file", "centre_m", "scale_m", "yaw_deg"];

/// Keys that maps have beside those of all.
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

/// Shapes whose fields are keys of the same names, with what a field is where a file gives none: how they are read and written.
macro_rules! plain_shapes {
    ($($kind:ident { $($key:ident $(= $usual:expr)?),+ })+) => {
        /// Their keys beside those of all.
        const OF_PLAIN_SHAPES: &[&str] = &[$($(stringify!($key)),+),+];

        impl ObjectEntry {
            fn plain_shape(&self) -> Result<Option<Shape>, String> {
                Ok(Some(match self.kind {
                    $(ObjectKind::$kind => {
                        self.refuse_others(&[$(stringify!($key)),+])?;
                        Shape::$kind { $($key: plain_shapes!(@read self $key $($usual)?)),+ }
                    })+
                    ObjectKind::Mesh | ObjectKind::Map => return Ok(None),
                }))
            }

            fn write_plain_shape(&mut self, shape: Shape) {
                match shape {
                    $(Shape::$kind { $($key),+ } => {
                        self.kind = ObjectKind::$kind;
                        $(self.$key = Some($key);)+
                    })+
                    Shape::Mesh { .. } | Shape::Map { .. } => {}
                }
            }
        }
    };
    (@read $entry:ident $key:ident) => { $entry.need(stringify!($key), $entry.$key)? };
    (@read $entry:ident $key:ident $usual:expr) => { $entry.$key.unwrap_or($usual) };
}

plain_shapes! {
    Ground { depth_m }
    Plane { centre_m, normal = DVec3::NEG_Z, width_m, height_m }
    Box { centre_m, size_m, yaw_deg = 0.0 }
    Sphere { centre_m, radius_m }
    Cylinder { centre_m, axis = DVec3::NEG_Y, radius_m, height_m }
    Cone { centre_m, axis = DVec3::NEG_Y, radius_m, tip_radius_m = 0.0, height_m }
    Person { foot_m, height_m = PERSON_M, yaw_deg = 0.0 }
}

impl ObjectEntry {
    /// The value of a key that this kind of object needs.
    fn need<T>(&self, key: &str, value: Option<T>) -> Result<T, String> {
        value.ok_or_else(|| format!("object \"{}\" lacks `{key}`; add it", self.name))
    }

    /// Complains about keys that mean nothing for this kind of object.
    fn refuse_others(&self, allowed: &[&str]) -> Result<(), String> {
        let of_some = |key: &&str| {
            let of_some = [OF_PLAIN_SHAPES, OF_MESHES, OF_MAPS];
            of_some.iter().any(|keys| keys.contains(key)) && !allowed.contains(key)
        };
        match self.given().find(of_some) {
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
        if let Some(plain) = self.plain_shape()? {
            return Ok(plain);
        }
        Ok(match self.kind {
            ObjectKind::Mesh => {
                self.refuse_others(OF_MESHES)?;
                let file = placed(folder, self.need("file", self.file.as_ref())?);
                Shape::Mesh {
                    centre_m: self.need("centre_m", self.centre_m)?,
                    scale_m: self.scale_m.unwrap_or(1.0),
                    yaw_deg: self.yaw_deg.unwrap_or(0.0),
                    mesh: Arc::new(Mesh::read(&file).map_err(|e| e.to_string())?),
                }
            }
            _ => {
                self.refuse_others(OF_MAPS)?;
                let path = |file: &PathBuf| placed(folder, file);
                let files = MapFiles {
                    depth: path(self.need("depth_file", self.depth_file.as_ref())?),
                    reflectivity: self.reflectivity_file.as_ref().map(path),
                    grey: self.grey_file.as_ref().map(path),
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

/// An object is written as its file has it.
impl serde::Serialize for Object {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        ObjectEntry::from(self.clone()).serialize(serializer)
    }
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
            name: object.name,
            reflectivity: object.reflectivity,
            ..ObjectEntry::default()
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
            Shape::Mesh {
                centre_m,
                scale_m,
                yaw_deg,
                mesh,
            } => {
                self.kind = ObjectKind::Mesh;
                self.centre_m = Some(centre_m);
                self.scale_m = Some(scale_m);
                self.yaw_deg = Some(yaw_deg);
                self.file = Some(mesh.path.to_owned());
            }
            Shape::Map {
                centre_m,
                yaw_deg,
                map,
            } => {
                let files = map.files.clone();
                self.kind = ObjectKind::Map;
                self.centre_m = Some(centre_m);
                self.yaw_deg = Some(yaw_deg);
                self.depth_file = Some(files.depth);
                self.reflectivity_file = files.reflectivity;
                self.grey_file = files.grey;
                self.depth_unit_m = files.unit_m;
                self.depth_along = Some(if files.is_range {
                    DepthKind::Range
                } else {
                    DepthKind::Axis
                });
                self.focal_px = Some(files.focal_px);
                self.principal_px = files.principal_px;
            }
            plain => self.write_plain_shape(plain),
        }
    }
}
