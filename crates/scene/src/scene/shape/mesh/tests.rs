//! Meshes beside shapes that they approximate, and files that are none.

use std::fmt::Write;

use super::*;
use crate::scene::Shape;
use crate::scene::shape::Surface;
use proptest::prelude::*;

fn read(text: &str) -> Result<Mesh, InputError> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.obj");
    std::fs::write(&path, text).unwrap();
    Mesh::read(&path)
}

/// The slow way: every triangle, as the file lists them. The range and which it is.
fn meet_all(mesh: &Mesh, ray: &Ray) -> Option<(f64, u32)> {
    let met = |part: usize| Some((mesh.meet_triangle(ray, part as u32)?, mesh.numbers[part]));
    let all = (0..mesh.triangles()).filter_map(met);
    all.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
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
    let corner = move |ring: usize, column: usize| ring * columns + column % columns;
    let faces = (0..rings).flat_map(move |r| {
        (0..columns).map(move |c| {
            vec![
                corner(r, c),
                corner(r, c + 1),
                corner(r + 1, c + 1),
                corner(r + 1, c),
            ]
        })
    });
    obj_of(&corners, faces)
}

/// A file of one face in the plane z = -5, whose outline is this.
fn one_face(outline: &[[f64; 2]]) -> String {
    let corners: Vec<[f64; 3]> = outline.iter().map(|&[x, y]| [x, y, -5.0]).collect();
    obj_of(&corners, [(0..corners.len()).collect()])
}

/// Whether a point is inside a polygon: a line from it crosses the outline an odd number of times.
fn is_within(outline: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let sides = outline.iter().zip(outline.iter().cycle().skip(1));
    let crossed = sides.filter(|([ax, ay], [bx, by])| {
        (*ay > y) != (*by > y) && x < ax + (bx - ax) * (y - ay) / (by - ay)
    });
    crossed.count() % 2 == 1
}

#[test]
fn convex_faces_are_cut_from_their_first_corner() {
    let hexagon = [
        [1.0, 0.0],
        [2.0, 0.0],
        [3.0, 1.0],
        [2.0, 2.0],
        [1.0, 2.0],
        [0.0, 1.0],
    ];
    assert_eq!(read(&one_face(&hexagon)).unwrap().triangles(), 4);
    let mut backwards = hexagon;
    backwards.reverse();
    assert_eq!(read(&one_face(&backwards)).unwrap().triangles(), 4);
}

#[test]
fn a_folded_quadrangle_is_two_triangles() {
    // Seen along its normal its sides cross.
    let corners = [
        [12.880, 236.295, 43.735],
        [12.819, 236.279, 43.792],
        [12.945, 236.357, 42.973],
        [12.884, 236.198, 42.910],
    ];
    let mesh = read(&obj_of(&corners, [vec![0, 1, 2, 3]])).unwrap();
    assert_eq!(mesh.triangles(), 2);
}

#[test]
fn a_face_that_crosses_itself_is_refused() {
    let bow = [[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 1.0]];
    let error = read(&one_face(&bow)).unwrap_err().to_string();
    assert!(error.contains("crosses itself"), "{error}");
}

proptest! {
    /// Stars, whose notches triangles from one corner would fill.
    #[test]
    fn concave_faces_hide_nothing_in_their_notches(
        radii in prop::collection::vec(0.2f64..3.0, 4..14),
        turn in 0.0f64..6.0,
        at in prop::collection::vec((-3.0f64..3.0, -3.0f64..3.0), 60),
    ) {
        let outline: Vec<[f64; 2]> = (radii.iter().enumerate())
            .map(|(n, radius)| {
                let (y, x) = (turn + std::f64::consts::TAU * n as f64 / radii.len() as f64).sin_cos();
                [radius * x, radius * y]
            })
            .collect();
        let mesh = read(&one_face(&outline)).unwrap();
        for (x, y) in at {
            // The file's y is up.
            let ray = Ray { origin: DVec3::new(x, -y, 0.0), direction: DVec3::Z };
            prop_assert_eq!(mesh.intersect(&ray).is_some(), is_within(&outline, [x, y]));
        }
    }
}

#[test]
fn a_byte_order_mark_hides_no_line() {
    let text = "v 0 0 -5\nv 1 0 -5\nv 0 1 -5\nf 1 2 3\n";
    assert_eq!(read(&format!("\u{feff}{text}")).unwrap().triangles(), 1);
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
    let (mesh, cuboid) = (mesh.placed(), cuboid.placed());
    for number in 0..2000 {
        let (x, y) = (
            f64::from(number % 50) / 50.0 - 0.5,
            f64::from(number / 50) / 40.0 - 0.5,
        );
        let ray = Ray::new(DVec3::ZERO, DVec3::new(0.9 * x, 0.5 * y, 1.0));
        match (mesh.intersect(&ray), cuboid.intersect(&ray)) {
            (Some(a), Some(b)) => {
                assert!((a.range_m - b.range_m).abs() < 1e-5);
                let normals = [
                    mesh.normal_at(ray.point(a.range_m), a.part),
                    cuboid.normal_at(ray.point(b.range_m), b.part),
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
        let [a, b] = [&mesh, &sphere].map(|shape| shape.intersect(&ray));
        let (Some(a), Some(b)) = (a, b) else {
            assert_eq!(a.is_some(), b.is_some());
            continue;
        };
        // Facets lie below the sphere by up to 2 m · (1 - cos(pi/400)) along rings and as much along columns.
        let below = 2.0 - ray.point(a).distance(centre_m);
        assert!((0.0..1.3e-4).contains(&below) && a >= b, "{below} {a} {b}");
    }
}

#[test]
fn texture_coordinates_come_from_the_file() {
    let text =
        "v 0 0 0\nv 1 0 0\nv 1 -1 0\nv 0 -1 0\nvt 0 1\nvt 2 1\nvt 2 0\nvt 0 0\nf 1/1 2/2 3/3 4/4\n";
    let mesh = read(text).unwrap();
    for (x, y) in [(0.25, 0.125), (0.75, 0.875), (0.5, 0.5)] {
        let ray = Ray::new(DVec3::new(x, y, -3.0), DVec3::Z);
        let Meeting { range_m, part } = mesh.intersect(&ray).unwrap();
        let (u, v) = mesh.on_surface(ray.point(range_m), part);
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
        ("v 1 2 3\nv 1 2 4\nv 2 2 1e30\nf 1 2 3\n", None, "below 10⁹"),
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

    /// A heap of random triangles, large and small, some without area, some twice, anywhere in the file's coordinates.
    #[test]
    fn the_tree_finds_what_every_triangle_tells(
        spread in 0.01f64..3.0, far in 1.0f64..3000.0, aside in prop::sample::select(vec![0.0, -70.0, 3000.0]),
        corners in prop::collection::vec((-2f64..2.0, -2f64..2.0, -2f64..2.0), 3..300),
        aims in prop::collection::vec((-2f64..2.0, -2f64..2.0, -2f64..2.0), 100),
    ) {
        let corners: Vec<[f64; 3]> = corners.iter().enumerate()
            .map(|(i, &(x, y, z))| if i % 3 == 0 { [x, y, z] } else { [x * spread, y * spread, z * spread] })
            .map(|corner| corner.map(|along| along + aside))
            .collect();
        let faces = (0..corners.len() / 3).chain([0, 0]).map(|t| vec![3 * t, 3 * t + 1, 3 * t + 2]);
        let mesh = read(&obj_of(&corners, faces)).unwrap();
        for (number, &(x, y, z)) in aims.iter().enumerate() {
            let aim = DVec3::new(x, y, z) + mesh.middle;
            // From far away, and from within.
            let away = if number % 4 == 0 { DVec3::new(y, z, x) * 0.3 } else { DVec3::new(y, z, x).normalize() * far };
            let origin = mesh.middle + away;
            let ray = Ray::new(origin, aim - origin);
            let found = mesh.intersect(&ray).map(|m| (m.range_m, mesh.numbers[m.part as usize]));
            prop_assert_eq!(found, meet_all(&mesh, &ray));
        }
    }

    #[test]
    fn garbage_is_refused_without_a_panic(text in "([vf][tn]?( -?[0-9.e/]{1,6}){0,4}\n){0,12}", cut in "\\PC{0,40}") {
        let _ = read(&text);
        let _ = read(&cut);
    }
}

/// A sheet a millimetre before another one, where surveys count metres from the equator.
#[test]
fn corners_far_from_the_origin_keep_their_millimetres() {
    let far = [500_000.0, -4_500_000.0, -250.0];
    let sheet = |z: f64| {
        [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]].map(|[x, y]| [far[0] + x, far[1] + y, far[2] - z])
    };
    let corners = [sheet(10.001), sheet(10.0)].concat();
    let mesh = read(&obj_of(&corners, [vec![0, 1, 2], vec![3, 4, 5]])).unwrap();
    // x right, y down, z forward.
    let origin = DVec3::new(far[0], -far[1], -far[2]);
    let ray = Ray {
        origin,
        direction: DVec3::Z,
    };
    let met = mesh.intersect(&ray).unwrap();
    assert!((met.range_m - 10.0).abs() < 1e-6, "{}", met.range_m);
    assert_eq!(mesh.numbers[met.part as usize], 1);
}
