//! Triangle meshes from Wavefront OBJ files.
//!
//! ```text
//!   OBJ ─► triangles ─► tree of boxes (obvhs, single precision) ─► candidates ─► each met in double precision
//! ```
//!
//! The tree only sorts out what a ray cannot meet: a ray is brought to the mesh in double precision before it enters the
//! tree, and boxes are a millionth of the mesh larger than their triangles, so nothing is lost by its rounding.
//!
//! An OBJ has x to the right, y up and z backwards; a model whose front looks along z there faces the lidar.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::ray::RayHit;
use obvhs::{Boundable, BvhBuildParams};

use super::{Meeting, NEAREST_M, solid};
use crate::files::InputError;
use crate::scene::vector::Ray;

/// Most triangles of a mesh. With their tree they take about 160 bytes each.
const MOST_TRIANGLES: usize = 4_000_000;

/// Largest file that is read, bytes. Four million triangles as text have some 300 MB.
const MOST_BYTES: u64 = 1 << 29;

/// Room about every triangle for the rounding of single precision, as a share of the mesh's size.
const ROOM: f32 = 1e-6;

/// A mesh in its own coordinates: x right, y down, z forward, in units of its file.
#[derive(Clone)]
pub struct Mesh {
    path: PathBuf,
    corners: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    /// Texture coordinates of each triangle's corners; empty where the file has none.
    on_texture: Vec<[[f32; 2]; 3]>,
    tree: Bvh2,
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
        self.path == other.path
            && self.corners == other.corners
            && self.triangles == other.triangles
            && self.on_texture == other.on_texture
    }
}

/// Counts the lines that are read through it, to say where a file is broken.
struct Counted<R> {
    inner: R,
    lines: usize,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        self.inner.read(into)
    }
}

impl<R: BufRead> BufRead for Counted<R> {
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

/// A triangle's box.
struct Bounds(Aabb);

impl Boundable for Bounds {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Mesh {
    /// Reads an OBJ file. Faces with more corners are cut into triangles; materials, lines and points are passed over.
    ///
    /// # Errors
    /// When it cannot be read, is broken, has no triangles or more than four million, or a corner that is no number.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let complain = |message: String| InputError::new(path.display(), message);
        let unreadable = |e: std::io::Error| {
            complain(format!(
                "cannot be read ({e}); check the path and its permissions"
            ))
        };
        let about = std::fs::metadata(path).map_err(unreadable)?;
        if !about.is_file() {
            return Err(complain("is no file; give an OBJ file".into()));
        }
        if about.len() > MOST_BYTES {
            let message = format!(
                "has {} MB, of which at most {} are read; make a mesh of fewer triangles",
                about.len() >> 20,
                MOST_BYTES >> 20
            );
            return Err(complain(message));
        }
        let mut reader = Counted {
            inner: BufReader::new(File::open(path).map_err(unreadable)?),
            lines: 0,
        };
        let options = tobj::LoadOptions {
            triangulate: true,
            ignore_points: true,
            ignore_lines: true,
            ..tobj::LoadOptions::default()
        };
        let no_materials = |_: &Path| Ok((Vec::new(), Default::default()));
        let loaded = tobj::load_obj_buf(&mut reader, &options, no_materials);
        let lines = reader.lines;
        let (models, _) = loaded.map_err(|e| {
            let message = format!("is a broken OBJ here ({e}); save it again, with its triangles");
            InputError::at(path.display(), lines.max(1), message)
        })?;
        let mut mesh = Mesh::of_models(path, models);
        if mesh.triangles.is_empty() {
            let message = "has no triangles; give an OBJ file with faces";
            return Err(complain(message.into()));
        }
        if mesh.triangles.len() > MOST_TRIANGLES {
            let message = format!(
                "has {} triangles, of which at most {MOST_TRIANGLES} are taken; make a mesh of fewer",
                mesh.triangles.len()
            );
            return Err(complain(message));
        }
        let is_number = |corner: &[f32; 3]| corner.iter().all(|v| v.abs() < 1e6);
        if let Some(at) = mesh.corners.iter().position(|corner| !is_number(corner)) {
            let message = format!(
                "has its corner number {} at {:?}; give numbers below a million",
                at + 1,
                mesh.corners[at]
            );
            return Err(complain(message));
        }
        mesh.grow_tree();
        Ok(mesh)
    }

    fn of_models(path: &Path, models: Vec<tobj::Model>) -> Self {
        let mut mesh = Mesh {
            path: path.to_owned(),
            corners: Vec::new(),
            triangles: Vec::new(),
            on_texture: Vec::new(),
            tree: Bvh2::default(),
            middle: DVec3::ZERO,
            size: DVec3::ZERO,
        };
        let is_textured = (models.iter())
            .all(|model| model.mesh.texcoord_indices.len() == model.mesh.indices.len());
        for tobj::Model { mesh: read, .. } in models {
            let first = mesh.corners.len() as u32;
            let corners = read.positions.as_chunks::<3>().0.iter();
            mesh.corners.extend(corners.map(|[x, y, z]| [*x, -y, -z]));
            let triangles = read.indices.as_chunks::<3>().0.iter();
            mesh.triangles
                .extend(triangles.map(|t| t.map(|corner| corner + first)));
            if is_textured {
                let place = |index: &u32| {
                    let at = 2 * *index as usize;
                    // OBJ counts v upwards.
                    [read.texcoords[at], 1.0 - read.texcoords[at + 1]]
                };
                let places = read.texcoord_indices.as_chunks::<3>().0.iter();
                mesh.on_texture
                    .extend(places.map(|[a, b, c]| [place(a), place(b), place(c)]));
            }
        }
        mesh
    }

    fn grow_tree(&mut self) {
        let corner = |index: u32| Vec3A::from_array(self.corners[index as usize]);
        let bounds = |[a, b, c]: [u32; 3]| Aabb::from_points(&[corner(a), corner(b), corner(c)]);
        let mut all = Aabb::empty();
        for &triangle in &self.triangles {
            all = all.union(&bounds(triangle));
        }
        let room = Vec3A::splat((all.max - all.min).max_element() * ROOM);
        let grown = |triangle: &[u32; 3]| {
            let bounds = bounds(*triangle);
            Bounds(Aabb::new(bounds.min - room, bounds.max + room))
        };
        let boxes: Vec<Bounds> = self.triangles.iter().map(grown).collect();
        let params = BvhBuildParams::fast_build();
        self.tree = build_bvh2(&boxes, params, &mut std::time::Duration::default());
        let (least, most) = (all.min - room, all.max + room);
        self.middle = (least.as_dvec3() + most.as_dvec3()) / 2.0;
        self.size = most.as_dvec3() - least.as_dvec3();
    }

    /// The file it was read from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.triangles.len()
    }

    fn corners_of(&self, triangle: u32) -> [DVec3; 3] {
        let corner = |index: u32| DVec3::from_array(self.corners[index as usize].map(f64::from));
        self.triangles[triangle as usize].map(corner)
    }

    /// Where a ray in the mesh's own coordinates first meets it; the part is the triangle.
    pub(super) fn meet(&self, ray: &Ray) -> Option<Meeting> {
        let about = Ray {
            origin: ray.origin - self.middle,
            direction: ray.direction,
        };
        let inside = (about.origin.abs() - self.size * 0.5).max_element() < 0.0;
        let skipped = match inside {
            true => 0.0,
            false => solid::meet_box(&about, self.size)?.range_m,
        };
        let start = ray.at(skipped).as_vec3a();
        let in_tree = obvhs::ray::Ray::new_inf(start, ray.direction.as_vec3a());
        let mut nearest: Option<Meeting> = None;
        self.tree
            .ray_traverse(in_tree, &mut RayHit::none(), |_, leaf| {
                let part = self.tree.primitive_indices[leaf];
                let Some(range) = self.meet_triangle(ray, part) else {
                    return f32::INFINITY;
                };
                if nearest.is_none_or(|n| range < n.range_m) {
                    nearest = Some(Meeting {
                        range_m: range,
                        part,
                    });
                }
                // Rounding must not hide a nearer triangle behind this one.
                ((range - skipped) as f32) * (1.0 + 1e-6) + self.size.max_element() as f32 * ROOM
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

    pub(super) fn normal(&self, triangle: u32) -> DVec3 {
        let [a, b, c] = self.corners_of(triangle);
        (b - a).cross(c - a).normalize()
    }

    /// Texture coordinates of a point of a triangle as the file has them; where it has none, places in its units of length,
    /// seen along the axis that the triangle faces most.
    pub(super) fn on_surface(&self, point: DVec3, triangle: u32) -> (f64, f64) {
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
mod tests {
    use std::fmt::Write;

    use super::*;
    use crate::scene::Shape;
    use proptest::prelude::*;

    fn read(text: &str) -> Result<Mesh, InputError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.obj");
        std::fs::write(&path, text).unwrap();
        Mesh::read(&path)
    }

    /// The slow way: every triangle.
    fn meet_all(mesh: &Mesh, ray: &Ray) -> Option<Meeting> {
        let meeting = |part| {
            mesh.meet_triangle(ray, part)
                .map(|range_m| Meeting { range_m, part })
        };
        let all = (0..mesh.triangles() as u32).filter_map(meeting);
        all.min_by(|a, b| a.range_m.total_cmp(&b.range_m))
    }

    fn obj_of(corners: &[[f64; 3]], faces: impl IntoIterator<Item = Vec<usize>>) -> String {
        let mut text = String::from("# made by a test\no it\n");
        for [x, y, z] in corners {
            let _ = writeln!(text, "v {x} {y} {z}");
        }
        for face in faces {
            let words: Vec<String> = face.iter().map(|i| (i + 1).to_string()).collect();
            let _ = writeln!(text, "f {}", words.join(" "));
        }
        text
    }

    /// A ball of `rings` by twice as many quadrangles.
    fn ball(rings: usize, radius: f64) -> String {
        let columns = 2 * rings;
        let mut corners = Vec::new();
        for ring in 0..=rings {
            for column in 0..columns {
                let (down, cross) = (std::f64::consts::PI * ring as f64 / rings as f64).sin_cos();
                let (z, x) = (std::f64::consts::PI * column as f64 / rings as f64).sin_cos();
                corners.push([radius * x * down, radius * cross, radius * z * down]);
            }
        }
        let at = move |ring: usize, column: usize| ring * columns + column % columns;
        let faces = (0..rings).flat_map(move |r| {
            (0..columns).map(move |c| vec![at(r, c), at(r, c + 1), at(r + 1, c + 1), at(r + 1, c)])
        });
        obj_of(&corners, faces)
    }

    #[test]
    fn a_cube_of_quadrangles_is_a_box() {
        let signs = [-1.0, 1.0];
        let corners: Vec<[f64; 3]> = (0..8)
            .map(|i| [signs[i & 1], 0.5 * signs[i >> 1 & 1], 2.0 * signs[i >> 2]])
            .collect();
        let faces = [
            [0, 1, 3, 2],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 3, 7, 6],
            [0, 2, 6, 4],
            [1, 3, 7, 5],
        ];
        let mesh = read(&obj_of(&corners, faces.map(|f| f.to_vec()))).unwrap();
        assert_eq!(mesh.triangles(), 12);
        let (centre_m, yaw_deg) = (DVec3::new(0.5, 0.2, 9.0), 30.0);
        let mesh = Shape::Mesh {
            centre_m,
            scale_m: 1.5,
            yaw_deg,
            mesh: mesh.into(),
        };
        let cuboid = Shape::Box {
            centre_m,
            size_m: DVec3::new(3.0, 1.5, 6.0),
            yaw_deg,
        };
        for number in 0..2000 {
            let (x, y) = (
                f64::from(number % 50) / 50.0 - 0.5,
                f64::from(number / 50) / 40.0 - 0.5,
            );
            let ray = Ray::new(DVec3::ZERO, DVec3::new(0.9 * x, 0.5 * y, 1.0));
            match (mesh.meet(&ray), cuboid.meet(&ray)) {
                (Some(a), Some(b)) => {
                    assert!((a.range_m - b.range_m).abs() < 1e-5);
                    let normals = [
                        mesh.normal_at(ray.at(a.range_m), a.part),
                        cuboid.normal_at(ray.at(b.range_m), b.part),
                    ];
                    assert!(normals[0].dot(normals[1]).abs() > 1.0 - 1e-6);
                }
                (a, b) => assert_eq!(a.is_some(), b.is_some(), "{x} {y}"),
            }
        }
    }

    #[test]
    fn a_fine_ball_of_triangles_is_a_sphere() {
        let mesh = read(&ball(200, 1.0)).unwrap();
        let centre_m = DVec3::new(0.3, -0.1, 12.0);
        let mesh = Shape::Mesh {
            centre_m,
            scale_m: 2.0,
            yaw_deg: 10.0,
            mesh: mesh.into(),
        };
        let sphere = Shape::Sphere {
            centre_m,
            radius_m: 2.0,
        };
        for number in 0..500 {
            let at = DVec3::new(
                f64::from(number % 25) / 25.0 - 0.5,
                f64::from(number / 25) / 20.0 - 0.5,
                0.0,
            );
            let ray = Ray::new(DVec3::ZERO, centre_m + 3.0 * at);
            let [a, b] = [&mesh, &sphere].map(|shape| shape.meet(&ray).map(|m| m.range_m));
            let (Some(a), Some(b)) = (a, b) else {
                assert_eq!(a.is_some(), b.is_some());
                continue;
            };
            // Facets lie below the sphere by up to 2 m · (1 - cos(pi/400)) along rings and as much along columns.
            let below = 2.0 - ray.at(a).distance(centre_m);
            assert!((0.0..1.3e-4).contains(&below) && a >= b, "{below} {a} {b}");
        }
    }

    #[test]
    fn texture_coordinates_come_from_the_file() {
        let text = "v 0 0 0\nv 1 0 0\nv 1 -1 0\nv 0 -1 0\nvt 0 1\nvt 2 1\nvt 2 0\nvt 0 0\nf 1/1 2/2 3/3 4/4\n";
        let mesh = read(text).unwrap();
        for (x, y) in [(0.25, 0.125), (0.75, 0.875), (0.5, 0.5)] {
            let ray = Ray::new(DVec3::new(x, y, -3.0), DVec3::Z);
            let Meeting { range_m, part } = mesh.meet(&ray).unwrap();
            let (u, v) = mesh.on_surface(ray.at(range_m), part);
            assert!(
                (u - 2.0 * x).abs() < 1e-6 && (v - y).abs() < 1e-6,
                "{u} {v}"
            );
        }
        // Without them, places along the surface.
        let bare = read("v 0 0 0\nv 1 0 0\nv 1 -1 0\nf 1 2 3\n").unwrap();
        assert_eq!(bare.on_surface(DVec3::new(0.6, 0.2, 0.0), 0), (0.6, 0.2));
    }

    #[test]
    fn broken_files_are_refused_with_their_line() {
        for (text, line, says) in [
            ("v 1 2 3\nv 1 2\nf 1 2 3\n", Some(2), "broken OBJ"),
            ("v 1 2 3\n\nf 1 2 3\n", Some(3), "broken OBJ"),
            (
                "v 1 2 3\nv 1 2 4\nv 2 2 nan\nf 1 2 3\n",
                None,
                "corner number 3",
            ),
            (
                "v 1 2 3\nv 1 2 4\nv 2 2 1e30\nf 1 2 3\n",
                None,
                "below a million",
            ),
            ("v 1 2 3\n", None, "no triangles"),
            ("", None, "no triangles"),
        ] {
            let error = read(text).unwrap_err();
            assert_eq!(error.line, line, "{error}");
            assert!(error.to_string().contains(says), "{error}");
        }
        assert!(Mesh::read(Path::new("/")).is_err());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// A heap of random triangles, large and small, some without area.
        #[test]
        fn the_tree_finds_what_every_triangle_tells(
            spread in 0.01f64..3.0, far in 1.0f64..3000.0,
            corners in prop::collection::vec((-2f64..2.0, -2f64..2.0, -2f64..2.0), 3..300),
            aims in prop::collection::vec((-2f64..2.0, -2f64..2.0, -2f64..2.0), 100),
        ) {
            let corners: Vec<[f64; 3]> = corners.iter().enumerate()
                .map(|(i, &(x, y, z))| if i % 3 == 0 { [x, y, z] } else { [x * spread, y * spread, z * spread] })
                .collect();
            let faces = (0..corners.len() / 3).map(|t| vec![3 * t, 3 * t + 1, 3 * t + 2]);
            let mesh = read(&obj_of(&corners, faces)).unwrap();
            for (number, &(x, y, z)) in aims.iter().enumerate() {
                let aim = DVec3::new(x, y, z);
                // From far away, and from within.
                let origin = if number % 4 == 0 { DVec3::new(y, z, x) * 0.3 } else { DVec3::new(y, z, x).normalize() * far };
                let ray = Ray::new(origin, aim - origin);
                let (found, expected) = (mesh.meet(&ray), meet_all(&mesh, &ray));
                prop_assert_eq!(found.map(|m| m.range_m), expected.map(|m| m.range_m));
            }
        }

        #[test]
        fn garbage_is_refused_without_a_panic(text in "([vf][tn]?( -?[0-9.e/]{1,6}){0,4}\n){0,12}", cut in "\\PC{0,40}") {
            let _ = read(&text);
            let _ = read(&cut);
        }
    }
}
