//! Stray light: what the lens throws from where it belongs over other macropixels.
//!
//! ```text
//!   a sign       ▁▁▁▁▁▁█▁▁▁▁▁▁▁           a share s of its light is scattered (lens surfaces, dust, filter), and makes a halo about it:
//!   its image    ▁▁▂▃▅▇█▇▅▃▂▁▁▁           s / (2πw²) · (1 + r²/w²)^(-3/2) a macropixel at a distance of r macropixels
//! ```
//!
//! The halo is that of a lens that scatters little, falling off with the cube of the distance (Harvey's law for surfaces has powers of 2 to
//! 3); a measured one may be given as a curve. It has all that comes through the lens: echoes, sunlight, pulses of other lidars. Light
//! from outside the field of view throws none in. Six macropixels beside a retroreflector of 1000 photons a pulse, a halo of
//! one per cent is another echo of 0.01: what *blooming* is called where it hides what stands there.

use rayon::prelude::*;

use super::curve::Measured;
use super::illumination::Falling;
use super::settings::Lidar;
use crate::photon::Glint;

/// What a macropixel gets less of than that a pulse from another one is left out: of 16 000 laser cycles a sixth of a photon.
const LEAST_PHOTONS: f64 = 1e-5;

/// How far the sum of a halo is taken macropixel by macropixel.
const SUMMED: i32 = 200;

/// How one macropixel's light is spread over the array.
struct Halo {
    cols: usize,
    /// Share that a macropixel so many rows and columns away gets, row by row.
    shares: Vec<f64>,
    /// Share that stays.
    own: f64,
}

impl Halo {
    fn of(lidar: &Lidar, rows: usize, cols: usize) -> Self {
        let aspect = lidar.macropixel_aspect;
        let radius = lidar.stray_radius;
        let strength = |row: f64, col: f64| {
            let away = libm::hypot(row * aspect, col);
            match &lidar.stray {
                Measured::Word(_) => libm::pow(1.0 + (away / radius).powi(2), -1.5),
                Measured::Curve(curve) => curve.at(away).unwrap_or(0.0),
            }
        };
        let cells = (-SUMMED..=SUMMED)
            .flat_map(|row| (-SUMMED..=SUMMED).map(move |col| (f64::from(row), f64::from(col))));
        let is_near = |(row, col): &(f64, f64)| {
            libm::hypot(row * aspect, *col) <= f64::from(SUMMED) * aspect.min(1.0)
        };
        let near: f64 = cells
            .filter(is_near)
            .map(|(row, col)| strength(row, col))
            .sum();
        // Beyond, the integral of the power.
        let end = f64::from(SUMMED) * aspect.min(1.0);
        let far = match &lidar.stray {
            Measured::Word(_) => {
                std::f64::consts::TAU * radius.powi(3) / libm::hypot(radius, end) / aspect
            }
            Measured::Curve(_) => 0.0,
        };
        let unit = lidar.stray_share / (near + far);
        let place = |at: usize| ((at / cols) as f64, (at % cols) as f64);
        let share = |at: usize| unit * strength(place(at).0, place(at).1);
        let shares: Vec<f64> = (0..rows * cols).map(share).collect();
        Halo {
            cols,
            own: 1.0 - lidar.stray_share + shares[0],
            shares,
        }
    }

    /// Share of the light of macropixel `from` that macropixel `to` gets.
    fn share(&self, from: usize, to: usize) -> f64 {
        let cols = self.cols;
        let apart = (from / cols).abs_diff(to / cols) * cols + (from % cols).abs_diff(to % cols);
        match apart {
            0 => self.own,
            _ => self.shares[apart],
        }
    }
}

/// Light on all macropixels with what the lens scatters, of which `dark_hz` on each does not come through it.
pub(super) fn with_stray_light(
    lidar: &Lidar,
    falling: &[Falling],
    cols: usize,
    dark_hz: f64,
) -> Vec<Falling> {
    let halo = Halo::of(lidar, falling.len() / cols, cols);
    // One echo of each surface is enough for others.
    let sources: Vec<Falling> = falling.iter().map(Falling::by_surface).collect();
    let of = |to: usize| {
        let mut own = Falling {
            background_hz: dark_hz,
            ..falling[to].clone()
        };
        own.glints.iter_mut().for_each(|g| g.photons *= halo.own);
        own.trains.iter_mut().for_each(|t| t.photons *= halo.own);
        for (from, source) in sources.iter().enumerate() {
            let share = halo.share(from, to);
            own.background_hz += share * (source.background_hz - dark_hz);
            if from == to {
                continue;
            }
            let is_seen = |photons: f64| photons * share >= LEAST_PHOTONS;
            let glints = source.glints.iter().filter(|g| is_seen(g.photons));
            own.glints.extend(glints.map(|glint| Glint {
                photons: glint.photons * share,
                ..*glint
            }));
            for train in source.trains.iter().filter(|t| is_seen(t.photons)) {
                let mut train = *train;
                train.photons *= share;
                own.trains.push(train);
            }
        }
        own
    };
    (0..falling.len()).into_par_iter().map(of).collect()
}

impl Falling {
    /// The same with one glint for each surface, as wide as all of them.
    fn by_surface(&self) -> Self {
        let mut glints: Vec<Glint> = Vec::new();
        for glint in &self.glints {
            let Some(all) = glints.iter_mut().find(|all| all.surface == glint.surface) else {
                glints.push(*glint);
                continue;
            };
            let photons = all.photons + glint.photons;
            let share = if photons > 0.0 {
                glint.photons / photons
            } else {
                0.0
            };
            let apart_fs = glint.arrival_fs - all.arrival_fs;
            all.variance_fs2 += share * (glint.variance_fs2 - all.variance_fs2)
                + share * (1.0 - share) * apart_fs * apart_fs;
            all.arrival_fs += share * apart_fs;
            all.photons = photons;
        }
        Falling {
            glints,
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::{DVec3, GroundTruth, Object, Scene, Shape};

    /// A white board that fills the middle macropixel of 33 × 33, 30 m ahead in the dark, so many times as bright as if it were no mirror.
    fn sign(lidar: &str, retro: f64) -> Scene {
        let mut scene = Scene::parse("test", &format!("[lidar]\n{lidar}\n")).unwrap();
        let side_m = 30.0 * 2.0 * 8f64.to_radians().tan() / 33.0;
        let shape = Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, 30.0),
            normal: DVec3::NEG_Z,
            width_m: side_m,
            height_m: side_m,
        };
        let mut board = Object::new("sign", 1.0, shape);
        board.retro = retro;
        scene.objects = vec![board];
        scene.light.sky_reflectivity = 0.0;
        scene
    }

    fn signals(scene: &Scene) -> Vec<f64> {
        let truth = GroundTruth::render(scene, 33, 33);
        let lights = scene.pixel_light(&truth);
        lights
            .iter()
            .map(|light| light.signal_per_cycle())
            .collect()
    }

    #[test]
    fn a_halo_has_the_share_that_it_takes_and_falls_off_as_said() {
        let (plain, halo) = (
            sign("", 100.0),
            sign("stray_share = 0.05\nstray_radius = 2", 100.0),
        );
        let middle = 16 * 33 + 16;
        let all = signals(&plain)[middle];
        let spread = signals(&halo);
        let at = |row: i32, col: i32| spread[((16 + row) * 33 + 16 + col) as usize] / all;
        let law = |r: f64| 0.05 / (std::f64::consts::TAU * 4.0) * (1.0 + r * r / 4.0).powf(-1.5);
        for (row, col) in [(1, 0), (0, -3), (4, 4), (-9, 2), (16, 16)] {
            let expected = law(f64::from(row * row + col * col).sqrt());
            assert!(
                (at(row, col) / expected - 1.0).abs() < 0.02,
                "{row} {col}: {}",
                at(row, col)
            );
        }
        assert!((at(0, 0) - (0.95 + law(0.0))).abs() < 1e-3, "{}", at(0, 0));
        // What misses the array: about 2 w / side of the halo.
        let total: f64 = spread.iter().sum::<f64>() / all;
        assert!((0.992..0.996).contains(&total), "{total}");
    }

    #[test]
    fn a_measured_halo_ends_where_its_curve_does_and_none_changes_nothing() {
        let middle = 16 * 33 + 16;
        let scene = sign("stray_share = 0.1\nstray = [[0, 1], [1, 1], [2, 0]]", 100.0);
        let (all, spread) = (signals(&sign("", 100.0))[middle], signals(&scene));
        let total: f64 = spread.iter().sum::<f64>() / all;
        assert!((total - 1.0).abs() < 1e-9, "{total}");
        let lit = spread.iter().filter(|photons| **photons > 0.0).count();
        assert_eq!(lit, 9);
        assert!((spread[middle + 1] - spread[middle + 33]).abs() < 1e-12 * all);
        assert_eq!(
            signals(&sign("stray_share = 0", 100.0)),
            signals(&sign("", 100.0))
        );
    }

    #[test]
    fn an_even_sky_stays_even_but_for_what_leaves_the_array() {
        let mut scene = sign(
            "stray_share = 0.05\nstray_radius = 0.5\ndark_count_hz = 1e5",
            1.0,
        );
        scene.objects.clear();
        scene.light.sky_reflectivity = 0.1;
        let rates = |scene: &Scene| -> Vec<f64> {
            let truth = GroundTruth::render(scene, 33, 33);
            scene
                .pixel_light(&truth)
                .iter()
                .map(|light| light.background_hz())
                .collect()
        };
        let spread = rates(&scene);
        scene.lidar.stray_share = 0.0;
        let even = rates(&scene)[0];
        let (middle, corner) = (spread[16 * 33 + 16], spread[0]);
        assert!(middle < even && middle > 0.998 * even, "{middle} {even}");
        assert!(corner < middle && corner > 0.95 * even, "{corner}");
    }

    #[test]
    fn more_halo_than_light_is_refused() {
        for (keys, complaint) in [
            (
                "stray_share = 1.1",
                "stray_share = 1.1 is impossible; give 0 to 1",
            ),
            (
                "stray = [[1, 1], [2, 0]]",
                "stray has distances from 1 to 2",
            ),
            ("stray = \"lots\"", "halo"),
        ] {
            let error = Scene::parse("test", &format!("[lidar]\n{keys}\n")).unwrap_err();
            assert!(error.to_string().contains(complaint), "{error}");
        }
    }
}
