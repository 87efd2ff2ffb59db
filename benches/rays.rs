//! Ray casting of a frame: what 64×64 macropixels see of every built-in scene and of meshes of a million triangles, on one thread and
//! on two, with the shadows that the sun throws where it has a place. `light` is that of an exposure of 0.2 s, which looks anew
//! as often as something has moved.

use std::fmt::Write;
use std::hint::black_box;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use guided_dtof::photon::SpadModel;
use guided_dtof::scene::{DVec3, GroundTruth, Mesh, Object, Scene, Shape};

/// Squares of a mesh along either side.
const SQUARES: usize = 708;

/// A sheet of squares, two triangles each, whose corners are at `point(u, v)`, x right, y up, z backwards; u and v from 0 to 1.
fn sheet(point: impl Fn(f64, f64) -> [f64; 3]) -> Mesh {
    let mut text = String::new();
    let share = |n: usize| n as f64 / SQUARES as f64;
    for (row, col) in (0..=SQUARES).flat_map(|row| (0..=SQUARES).map(move |col| (row, col))) {
        let [x, y, z] = point(share(col), share(row));
        writeln!(text, "v {x:.6} {y:.6} {z:.6}").expect("strings take all");
    }
    for (row, col) in (0..SQUARES).flat_map(|row| (0..SQUARES).map(move |col| (row, col))) {
        let corner = |down: usize, right: usize| (row + down) * (SQUARES + 1) + col + right + 1;
        let corners = [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0)];
        let [a, b, c, d] = corners;
        writeln!(text, "f {a} {b} {c} {d}").expect("strings take all");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("sheet.obj");
    std::fs::write(&path, text).expect("room for a mesh");
    Mesh::read(&path).expect("a mesh")
}

/// A ball with waves that fills most of the street's view.
fn ball() -> Mesh {
    sheet(|u, v| {
        let (around, down) = (std::f64::consts::TAU * u, std::f64::consts::PI * v);
        let radius = 2.0 + 0.02 * (40.0 * around).sin() * (20.0 * down).sin();
        let side = radius * down.sin();
        [
            side * around.sin(),
            radius * down.cos(),
            side * around.cos(),
        ]
    })
}

/// Hills that hide each other and rise from before the lidar to the horizon, 100 m away.
fn hills() -> Mesh {
    sheet(|u, v| {
        let (x, far) = (60.0 * (u - 0.5), 10.0 + 100.0 * v);
        let waves = 0.4 * (1.3 * x + 0.2 * far).sin() * (0.9 * far).sin();
        [x, -2.5 + 0.11 * (far - 10.0) + waves, -far]
    })
}

fn with_mesh(mesh: Mesh, far_m: f64, is_sunny: bool) -> Scene {
    let mut scene = Scene::outdoor();
    let shape = Shape::Mesh {
        centre_m: DVec3::new(0.0, 0.0, far_m),
        scale_m: 1.0,
        yaw_deg: 0.0,
        mesh: Arc::new(mesh),
    };
    scene.objects = vec![Object::new("mesh", 0.3, shape)];
    if is_sunny {
        scene.light.sun_elevation_deg = Some(35.0);
        scene.light.sun_azimuth_deg = 150.0;
    }
    scene
}

fn rays(c: &mut Criterion) {
    let built_in = Scene::built_in().map(|(name, _)| (name, Scene::named(name).expect("built in")));
    let mut scenes: Vec<(&str, Scene)> = built_in.collect();
    scenes.push(("ball", with_mesh(ball(), 17.0, false)));
    scenes.push(("hills", with_mesh(hills(), 0.0, false)));
    scenes.push(("sunny hills", with_mesh(hills(), 0.0, true)));
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.expect("threads");
        let mut group = c.benchmark_group(format!("rays of a frame, threads: {threads}"));
        group.sample_size(20);
        for (name, scene) in &scenes {
            let render = || GroundTruth::render(black_box(scene), 64, 64);
            group.bench_function(BenchmarkId::new("seen", name), |b| {
                b.iter(|| pool.install(render))
            });
            let truth = render();
            let light = || scene.light_during(&truth, &SpadModel::default(), 16_000, 12.5e-6);
            group.bench_function(BenchmarkId::new("light", name), |b| {
                b.iter(|| pool.install(light))
            });
        }
        group.finish();
    }
}

criterion_group!(benches, rays);
criterion_main!(benches);
