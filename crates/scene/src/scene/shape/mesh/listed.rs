//! The triangles of an OBJ file, as it lists them; faces with more corners are cut.
//!
//! ```text
//!   convex face ─► triangles from its first corner
//!   concave     ─► seen along its normal ─► ears cut off it (Mapbox's Earcut), which fill no notch
//! ```

use earcut::Earcut;
use earcut::utils3d::project3d_to_2d;
use glam::DVec3;
use smallvec::SmallVec;

/// Part of a face's area by which its triangles may differ from it. Files round corners, often to single precision.
const ROUNDED: f64 = 1e-5;

/// Volume that three sides from a corner span, over that of sides of their lengths at right angles, from which on they are in no plane: chosen.
const FOLDED: f64 = 1e-3;

/// Triangles with their corners.
#[derive(Default)]
pub(super) struct TriangleList {
    /// Corners: x right, y down, z forward.
    pub(super) corners: Vec<[f64; 3]>,
    /// Places among the corners.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Texture coordinates of each triangle's corners; empty where not every corner has them.
    pub(super) on_texture: Vec<[[f32; 2]; 3]>,
}

/// A face whose sides cross, by a corner of it as the file has it.
#[derive(Debug)]
pub(super) struct CrossedFace(pub(super) [f64; 3]);

impl TriangleList {
    /// The triangles of all objects of a file.
    pub(super) fn of_models(models: Vec<tobj::Model>) -> Result<Self, CrossedFace> {
        let mut all = TriangleList::default();
        let is_textured = (models.iter())
            .all(|model| model.mesh.texcoord_indices.len() == model.mesh.indices.len());
        for tobj::Model { mesh: read, .. } in models {
            let first = all.corners.len() as u32;
            let corners = read.positions.as_chunks::<3>().0;
            all.corners
                .extend(corners.iter().map(|[x, y, z]| [*x, -y, -z]));
            let place = |index: u32| {
                let at = 2 * index as usize;
                // OBJ counts v upwards.
                [read.texcoords[at], 1.0 - read.texcoords[at + 1]].map(|x| x as f32)
            };
            // Without a list of them all faces are triangles.
            let triangles = read.indices.len() / 3;
            let listed = read.face_arities.iter().map(|&n| n as usize);
            let triangular = std::iter::repeat_n(3, triangles);
            let is_listed = !read.face_arities.is_empty();
            let mut begins = 0;
            for corners_of_face in listed.chain(triangular.filter(|_| !is_listed)) {
                let face = begins..begins + corners_of_face;
                begins = face.end;
                let indices = &read.indices[face.clone()];
                let outline: SmallVec<[[f64; 3]; 4]> =
                    indices.iter().map(|&at| corners[at as usize]).collect();
                let cut = cut_face(&outline).ok_or_else(|| CrossedFace(outline[0]))?;
                for triangle in cut {
                    // What has no area is met by no ray; thousands in one place would be tried by every ray.
                    if !has_area(triangle.map(|n| outline[n])) {
                        continue;
                    }
                    all.triangles.push(triangle.map(|n| indices[n] + first));
                    if is_textured {
                        let on_texture = &read.texcoord_indices[face.clone()];
                        all.on_texture.push(triangle.map(|n| place(on_texture[n])));
                    }
                }
            }
        }
        Ok(all)
    }
}

/// Triangles that cover a face, by the places of their corners in its outline; `None` where its sides cross.
fn cut_face(outline: &[[f64; 3]]) -> Option<SmallVec<[[usize; 3]; 2]>> {
    let from_first = || (2..outline.len()).map(|n| [0, n - 1, n]).collect();
    if !is_concave(outline) {
        return Some(from_first());
    }
    let mut flat = Vec::new();
    if !project3d_to_2d(outline, outline.len(), &mut flat) {
        return None;
    }
    let mut cut: Vec<usize> = Vec::new();
    Earcut::new().earcut_slice(&flat, &[], &mut cut);
    if earcut::deviation(flat, &[], &cut) < ROUNDED {
        return Some(cut.as_chunks::<3>().0.into());
    }
    // Sides of a folded quadrangle cross only as they are seen from somewhere.
    is_folded(outline).then(from_first)
}

/// Whether four corners are plainly not in one plane.
fn is_folded(outline: &[[f64; 3]]) -> bool {
    let [first, others @ ..] = outline else {
        return false;
    };
    let [a, b, c] = others else { return false };
    let [a, b, c] = [a, b, c].map(|corner| DVec3::from_array(*corner) - DVec3::from_array(*first));
    let lengths = a.length() * b.length() * c.length();
    a.cross(b).dot(c).abs() > FOLDED * lengths
}

/// Whether a triangle is more than a line.
fn has_area(corners: [[f64; 3]; 3]) -> bool {
    let [a, b, c] = corners.map(DVec3::from_array);
    // Not a number is told as such later.
    (b - a).cross(c - a) != DVec3::ZERO
}

/// Whether a polygon turns the other way at some corner. Its normal is Newell's.
fn is_concave(outline: &[[f64; 3]]) -> bool {
    if outline.len() < 4 {
        return false;
    }
    let corners: Vec<DVec3> = outline.iter().copied().map(DVec3::from_array).collect();
    let from_first = |n: usize| corners[n % corners.len()] - corners[0];
    let normal: DVec3 = (1..corners.len())
        .map(|n| from_first(n).cross(from_first(n + 1)))
        .sum();
    let turn = |n: usize| {
        let [a, b, c] = [n, n + 1, n + 2].map(from_first);
        (b - a).cross(c - b).dot(normal)
    };
    let room = ROUNDED * normal.length_squared();
    (0..corners.len()).any(|n| turn(n) < -room)
}
