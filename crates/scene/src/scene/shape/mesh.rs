//! Triangle meshes from Wavefront OBJ files.
//!
//! ```text
//!   OBJ ─► triangles ─► tree of boxes (single precision) ─► candidates ─► each met in double precision
//! ```
//!
//! The tree only sorts out what a ray cannot meet: a ray is brought to the mesh in double precision before it enters the
//! tree, whose origin is the middle of the mesh, and boxes are a millionth of the mesh larger than their triangles, so nothing
//! is lost by its rounding. Triangles lie in memory with their corners, in the order of the tree: neighbours are met together.
//!
//! An OBJ has x to the right, y up and z backwards; a model whose front looks along z there faces the lidar.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use glam::DVec3;
use obvhs::aabb::Aabb;

use self::listed::{CrossedFace, TriangleList};
use self::tree::{Bounds, Tree};
use super::meeting::{Meeting, NEAREST_M};
use super::solid;
use crate::files::{InputError, open_input, skip_mark};
use crate::scene::vector::Ray;

mod listed;
mod placed;
mod tree;

pub(in crate::scene) use placed::PlacedMesh;

/// Most triangles of a mesh. With their tree they take about 160 bytes each.
const MOST_TRIANGLES: usize = 4_000_000;

/// Largest file that is read, bytes. Four million triangles as text have some 300 MB.
const MOST_BYTES: u64 = 1 << 29;

/// Room about every triangle for the rounding of single precision, as a share of the mesh's size.
const ROOM: f32 = 1e-6;

/// A mesh in its own coordinates: x right, y down, z forward, in units of its file.
#[derive(Clone)]
pub struct Mesh {
    /// The file it was read from.
    pub(crate) path: PathBuf,
    /// Corners of each triangle, in the tree's order.
    triangles: Vec<[[f64; 3]; 3]>,
    /// Texture coordinates of those corners; empty where the file has none.
    on_texture: Vec<[[f32; 2]; 3]>,
    /// Where in the file each triangle stands.
    numbers: Vec<u32>,
    /// About the middle.
    tree: Tree,
    middle: DVec3,
    size: DVec3,
}

impl std::fmt::Debug for Mesh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let triangles = self.triangles.len();
        write!(f, "Mesh({}, {triangles} triangles)", self.path.display())
    }
}

/// Trees follow from triangles.
impl PartialEq for Mesh {
    fn eq(&self, other: &Self) -> bool {
        // Worlds share meshes, and a comparison of millions of corners takes as long as a frame's rays.
        std::ptr::eq(self, other)
            || self.path == other.path
                && self.triangles == other.triangles
                && self.on_texture == other.on_texture
                && self.numbers == other.numbers
    }
}

/// Counts the lines that are read through it, to say where a file is broken.
struct LineCounter<R> {
    inner: R,
    lines: usize,
}

impl<R: Read> Read for LineCounter<R> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        self.inner.read(into)
    }
}

impl<R: BufRead> BufRead for LineCounter<R> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        self.inner.fill_buf()
    }

    fn consume(&mut self, amount: usize) {
        if let Ok(seen) = self.inner.fill_buf() {
            self.lines += seen[..amount].iter().filter(|&&b| b == b'\n').count();
        }
        self.inner.consume(amount);
    }
}

impl Mesh {
    /// Reads an OBJ file. Faces with more corners are cut into triangles; materials, lines and points are passed over.
    ///
    /// # Errors
    /// When it cannot be read, is broken, has no triangles or more than four million, a face that crosses itself, or a corner that is no number.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let complain = |message: String| InputError::new(path.display(), message);
        let unreadable = |e| InputError::unreadable(path, &e);
        let file = open_input(path)?;
        let about = file.metadata().map_err(unreadable)?;
        if !about.is_file() {
            return Err(complain(
                "is a pipe; write its contents to a file first".into(),
            ));
        }
        if about.len() > MOST_BYTES {
            let message = format!(
                "has {} MB, of which at most {} are read; make a mesh of fewer triangles",
                about.len() >> 20,
                MOST_BYTES >> 20
            );
            return Err(complain(message));
        }
        let mut reader = LineCounter {
            inner: BufReader::new(file),
            lines: 0,
        };
        skip_mark(&mut reader).map_err(unreadable)?;
        let options = tobj::LoadOptions {
            triangulate: false,
            ignore_points: true,
            ignore_lines: true,
            ..tobj::LoadOptions::default()
        };
        let no_materials = |_: &Path| Ok((Vec::new(), Default::default()));
        let loaded = tobj::load_obj_buf(&mut reader, &options, no_materials);
        let lines = reader.lines;
        let (models, _) = loaded.map_err(|e| {
            let message = format!("is a broken OBJ here ({e}); save it again, with its triangles");
            InputError::at_line(path.display(), lines.max(1), message)
        })?;
        let listed = TriangleList::of_models(models).map_err(|CrossedFace(at)| {
            let message = format!(
                "has a face that crosses itself, with a corner at {at:?}; cut its faces into triangles"
            );
            complain(message)
        })?;
        if listed.triangles.is_empty() {
            let message = "has no triangles; give an OBJ file with faces";
            return Err(complain(message.into()));
        }
        if listed.triangles.len() > MOST_TRIANGLES {
            let message = format!(
                "has {} triangles, of which at most {MOST_TRIANGLES} are taken; make a mesh of fewer",
                listed.triangles.len()
            );
            return Err(complain(message));
        }
        let is_number = |corner: &[f64; 3]| corner.iter().all(|v| v.abs() < 1e9);
        if let Some(at) = listed.corners.iter().position(|corner| !is_number(corner)) {
            let message = format!(
                "has its corner number {} at {:?}; give numbers below 10⁹",
                at + 1,
                listed.corners[at]
            );
            return Err(complain(message));
        }
        Ok(Mesh::from_triangles(path, listed))
    }

    fn from_triangles(path: &Path, listed: TriangleList) -> Self {
        let corners = |triangle: [u32; 3]| triangle.map(|corner| listed.corners[corner as usize]);
        let used = || {
            listed
                .triangles
                .iter()
                .flat_map(|&triangle| corners(triangle))
        };
        let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in used().map(DVec3::from_array) {
            (least, most) = (least.min(corner), most.max(corner));
        }
        let room = (most - least).max_element() as f32 * ROOM;
        let (least, most) = (least - f64::from(room), most + f64::from(room));
        let middle = (least + most) / 2.0;
        let grown = |&triangle: &[u32; 3]| {
            let from_middle = |corner: [f64; 3]| (DVec3::from_array(corner) - middle).as_vec3a();
            let bounds = Aabb::from_points(&corners(triangle).map(from_middle));
            Bounds(Aabb::new(bounds.min - room, bounds.max + room))
        };
        let bounds: Vec<Bounds> = listed.triangles.iter().map(grown).collect();
        let (tree, numbers) = Tree::build(&bounds);
        drop(bounds);
        let in_order = || numbers.iter().map(|&number| number as usize);
        Mesh {
            path: path.to_owned(),
            triangles: in_order().map(|n| corners(listed.triangles[n])).collect(),
            on_texture: if listed.on_texture.is_empty() {
                Vec::new()
            } else {
                in_order().map(|n| listed.on_texture[n]).collect()
            },
            numbers,
            tree,
            middle,
            size: most - least,
        }
    }

    /// Number of triangles.
    #[cfg(test)]
    pub(crate) fn triangles(&self) -> usize {
        self.triangles.len()
    }

    fn corners_of(&self, triangle: u32) -> [DVec3; 3] {
        self.triangles[triangle as usize].map(DVec3::from_array)
    }

    /// Where a ray in the mesh's own coordinates first meets it; the part is the triangle's place in the tree's order. Of two in the same
    /// place the one listed first in the file counts.
    fn intersect(&self, ray: &Ray) -> Option<Meeting> {
        let about = Ray {
            origin: ray.origin - self.middle,
            direction: ray.direction,
        };
        let inside = (about.origin.abs() - self.size * 0.5).max_element() < 0.0;
        let skipped = if inside {
            0.0
        } else {
            solid::meet_box(&about, self.size)?.range_m
        };
        // Rounding must not hide a nearer triangle behind this one.
        let room = self.size.max_element() as f32 * ROOM;
        let mut nearest: Option<Meeting> = None;
        let is_before = |part: u32, range_m: f64, other: &Meeting| {
            let number = |part: u32| self.numbers[part as usize];
            range_m < other.range_m
                || (range_m == other.range_m && number(part) < number(other.part))
        };
        let start = about.point(skipped).as_vec3a();
        self.tree.follow(start, ray.direction.as_vec3a(), |places| {
            for part in places.start as u32..places.end as u32 {
                if let Some(range_m) = self.meet_triangle(ray, part)
                    && nearest.is_none_or(|other| is_before(part, range_m, &other))
                {
                    nearest = Some(Meeting { range_m, part });
                }
            }
            nearest.map_or(f32::INFINITY, |nearest| {
                ((nearest.range_m - skipped) as f32) * (1.0 + 1e-6) + room
            })
        });
        nearest
    }

    /// Möller and Trumbore 1997, from both sides. Edges belong to both of their triangles.
    fn meet_triangle(&self, ray: &Ray, triangle: u32) -> Option<f64> {
        let [a, b, c] = self.corners_of(triangle);
        let (ab, ac) = (b - a, c - a);
        let across = ray.direction.cross(ac);
        let volume = ab.dot(across);
        let from_a = ray.origin - a;
        let u = from_a.dot(across) / volume;
        let turned = from_a.cross(ab);
        let v = ray.direction.dot(turned) / volume;
        let range = ac.dot(turned) / volume;
        // A triangle without area gives NaN or infinity, which is inside nothing.
        let inside = u >= -1e-12 && v >= -1e-12 && u + v <= 1.0 + 1e-12;
        (inside && range > NEAREST_M && range.is_finite()).then_some(range)
    }

    fn normal(&self, triangle: u32) -> DVec3 {
        let [a, b, c] = self.corners_of(triangle);
        (b - a).cross(c - a).normalize()
    }

    /// Texture coordinates of a point of a triangle as the file has them; where it has none, places in its units of length,
    /// seen along the axis that the triangle faces most.
    fn on_surface(&self, point: DVec3, triangle: u32) -> (f64, f64) {
        let [a, b, c] = self.corners_of(triangle);
        let normal = (b - a).cross(c - a);
        let Some(places) = self.on_texture.get(triangle as usize) else {
            let facing = normal.abs();
            let axis = if facing.x >= facing.max_element() {
                0
            } else if facing.y >= facing.max_element() {
                1
            } else {
                2
            };
            return solid::on_face(point, axis);
        };
        // Barycentric coordinates: shares of the triangle's area.
        let share = |from: DVec3, to: DVec3| {
            (to - from).cross(point - from).dot(normal) / normal.length_squared()
        };
        let shares = [share(b, c), share(c, a), share(a, b)];
        let mix = |axis: usize| -> f64 {
            let parts = shares.iter().zip(places);
            parts.map(|(s, place)| s * f64::from(place[axis])).sum()
        };
        (mix(0), mix(1))
    }
}

#[cfg(test)]
mod tests;
